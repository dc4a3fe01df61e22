!> What a likelihood is: the distribution of the errors of independent measurements, with or without
!> errors that they share.
module error_models
   use errors, only: error_type, refuse
   use kinds, only: pi, wp
   use linear_algebra, only: dot
   use random, only: random_stream_type
   use settings_schema, only: measurements_settings_type
   use small_matrices, only: factor_definite, fit_columns, solve_lower, sum_of_logs, weighted_gram
   implicit none
   private
   public :: error_model_type, likelihood_names, new_error_model

   !> A new likelihood: its type, which extends `error_model_type`, its name here, and its lines in
   !> `new_error_model`.
   character(len=*), parameter :: likelihood_names = 'normal, student'

   !> Normal errors (Eq. 13).
   type :: error_model_type
      !> The scale of the density for a standard deviation of one: residuals come in units of it.
      real(wp) :: scale = 1.0_wp
   contains
      procedure :: log_density, weigh, as_normals, draw, integrate, leave_one_out
   end type error_model_type

   !> Student's t: errors of which some are far off.
   !>
   !> For more than two degrees of freedom its standard deviation is that of the measurement, so the
   !> scale is sqrt((dof - 2)/dof) of it. With two or fewer the distribution has no standard
   !> deviation, and what is stated is its scale.
   type, extends(error_model_type) :: student_errors_type
      !> Degrees of freedom, positive.
      real(wp) :: dof = 4.0_wp
   contains
      procedure :: log_density => student_log_density, weigh => student_weigh, &
         & as_normals => student_as_normals, draw => student_draw
   end type student_errors_type

   !> A pivot of the precision that is a smaller share of its entry has lost its digits.
   real(wp), parameter :: resolution = 1.0e-13_wp

contains

   !> The errors that &measurements has.
   subroutine new_error_model(settings, model, error)
      type(measurements_settings_type), intent(in) :: settings
      class(error_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error

      select case (settings%likelihood)
      case ('normal')
         allocate (model)
      case ('student')
         associate (dof => settings%student_dof)
            allocate (model, source=student_errors_type(scale=merge(sqrt(abs(dof - 2.0_wp)/dof), &
               & 1.0_wp, dof > 2.0_wp), dof=dof))
         end associate
      case default
         call refuse(error, 'likelihood: '''//settings%likelihood//''' is unknown; allowed: ' &
            & //likelihood_names)
      end select
   end subroutine new_error_model

   !> Logarithm of the density of residuals `r` whose scales are all `factor`, their units.
   pure real(wp) function log_density(self, r, factor)
      class(error_model_type), intent(in) :: self
      !> (measurement).
      real(wp), intent(in) :: r(:), factor

      log_density = -0.5_wp*dot(r, r)/factor**2 - size(r)*(log(factor) + 0.5_wp*log(2.0_wp*pi))
   end function log_density

   !> Minus the first derivative of the log density of scale one over the residual, minus the
   !> second, and the one that is expected.
   pure subroutine weigh(self, e, weight, curvature, expected)
      class(error_model_type), intent(in) :: self
      !> Residuals in units of the scale, (measurement).
      real(wp), intent(in) :: e(:)
      !> In the order above, (measurement).
      real(wp), intent(out) :: weight(:)
      !> (measurement), likewise.
      real(wp), intent(out), optional :: curvature(:), expected(:)

      weight = 1.0_wp
      if (present(curvature)) curvature = 1.0_wp
      if (present(expected)) expected = 1.0_wp
   end subroutine weigh

   !> The density of scale one as a mixture of normal ones.
   pure subroutine as_normals(self, variance, share)
      class(error_model_type), intent(in) :: self
      !> (component).
      real(wp), allocatable, intent(out) :: variance(:), share(:)

      variance = [1.0_wp]
      share = [1.0_wp]
   end subroutine as_normals

   !> An error `e` of scale one.
   subroutine draw(self, stream, e)
      class(error_model_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: e

      call stream%normal(e)
   end subroutine draw

   !> Logarithm of the integral over b of the density of r - U b, of scale one, times N(b; 0, 1): by
   !> Laplace's approximation about the mode, which is exact for normal errors.
   pure subroutine integrate(self, r, u, b, l, value)
      class(error_model_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode of b given r, and the lower factor of its precision.
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp), dimension(size(r)) :: e, weight, used, curvature, expected
      real(wp) :: before(size(b))
      integer :: j, step
      logical :: definite

      b = 0.0_wp
      call self%weigh(r, weight)
      do step = 1, 40
         before = b
         used = weight
         call fit_columns(r, u, used, b, l)
         e = r - matmul(u, b)
         call self%weigh(e, weight)
         if (maxval(abs(b - before)) < 1.0e-9_wp .or. maxval(abs(weight - used)) <= 0.0_wp) exit
      end do
      call self%weigh(e, weight, curvature, expected)
      value = self%log_density(e, 1.0_wp) - 0.5_wp*sum(b**2)
      if (maxval(abs(curvature - used)) > 0.0_wp) then
         call weighted_gram(u, curvature, l)
         call factor_definite(l, resolution, definite)
         ! Outliers outweigh the rest: the expected curvature stands in for the observed one.
         if (.not. definite) call fit_columns(e, u, expected, before, l)
      end if
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate

   !> Logarithm of the density of each residual given all others, of scale one: without shared
   !> errors the density itself. Else b given the others is taken as normal: curvature of the log
   !> density at the mode less that of residual i, where convex, and one step of Newton's from
   !> there. The integral over that is one over the variances of the normal errors of which the
   !> density is a mixture; it is exact for normal errors (Bürkner, Gabry and Vehtari, Comput. Stat.
   !> 36, 1243, 2021).
   pure subroutine leave_one_out(self, r, u, b, l, values)
      class(error_model_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> What `integrate` gave of them.
      real(wp), intent(in) :: b(:), l(:, :)
      !> (measurement).
      real(wp), intent(out) :: values(:)
      real(wp), allocatable :: variance(:), share(:), terms(:)
      real(wp), dimension(size(r)) :: e, weight, curvature
      real(wp) :: factor(size(b), size(b)), z(size(b)), h, spread
      logical :: definite
      integer :: i

      if (size(b) == 0) then
         values = [(self%log_density(r(i:i), 1.0_wp), i=1, size(r))]
         return
      end if
      e = r - matmul(u, b)
      call self%weigh(e, weight, curvature)
      curvature = max(0.0_wp, curvature)
      call weighted_gram(u, curvature, factor)
      call factor_definite(factor, resolution, definite)
      if (.not. definite) factor = l
      call self%as_normals(variance, share)
      do i = 1, size(r)
         z = u(i, :)
         call solve_lower(factor, z)
         ! Of u b: the variance without i, and what the pull of i on the mode was.
         h = sum(z**2)
         spread = h/max(1.0e-6_wp, 1.0_wp - curvature(i)*h)
         terms = log(share) - 0.5_wp*(e(i)*(1.0_wp + spread*weight(i)))**2/(variance + spread) &
            & - 0.5_wp*log(2.0_wp*pi*(variance + spread))
         values(i) = maxval(terms) + log(sum(exp(terms - maxval(terms))))
      end do
   end subroutine leave_one_out

   pure real(wp) function student_log_density(self, r, factor) result(log_density)
      class(student_errors_type), intent(in) :: self
      real(wp), intent(in) :: r(:), factor

      log_density = size(r)*(log_gamma(0.5_wp*(self%dof + 1.0_wp)) &
         & - log_gamma(0.5_wp*self%dof) - 0.5_wp*log(pi*self%dof) - log(factor)) &
         & - 0.5_wp*(self%dof + 1.0_wp)*sum_of_logs(1.0_wp + (r/factor)**2/self%dof)
   end function student_log_density

   pure subroutine student_weigh(self, e, weight, curvature, expected)
      class(student_errors_type), intent(in) :: self
      real(wp), intent(in) :: e(:)
      real(wp), intent(out) :: weight(:)
      real(wp), intent(out), optional :: curvature(:), expected(:)

      weight = (self%dof + 1.0_wp)/(self%dof + e**2)
      if (present(curvature)) curvature = (self%dof + 1.0_wp)*(self%dof - e**2)/(self%dof + e**2)**2
      if (present(expected)) expected = (self%dof + 1.0_wp)/(self%dof + 3.0_wp)
   end subroutine student_weigh

   !> 1/variance has a gamma distribution, whose logarithm is put on an even grid.
   pure subroutine student_as_normals(self, variance, share)
      class(student_errors_type), intent(in) :: self
      real(wp), allocatable, intent(out) :: variance(:), share(:)
      real(wp) :: width, low, step
      real(wp), allocatable :: x(:)
      integer :: i, n

      width = sqrt(2.0_wp/self%dof)
      low = -72.0_wp/(self%dof + 1.0_wp) - 9.0_wp*min(1.0_wp, width)
      step = min(0.25_wp, 0.5_wp*width)
      n = 1 + int((log(1.0_wp + 80.0_wp/self%dof) + 9.0_wp*min(1.0_wp, width) - low)/step)
      x = [(low + (i - 1)*step, i=1, n)]
      variance = exp(-x)
      share = step*exp(0.5_wp*self%dof*(x - exp(x) + log(0.5_wp*self%dof)) &
         & - log_gamma(0.5_wp*self%dof))
   end subroutine student_as_normals

   !> By the polar method (Bailey, Math. Comp. 62, 779, 1994).
   subroutine student_draw(self, stream, e)
      class(student_errors_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: e
      real(wp) :: u, v, w

      do
         call stream%uniform(u)
         call stream%uniform(v)
         u = 2.0_wp*u - 1.0_wp
         v = 2.0_wp*v - 1.0_wp
         w = u**2 + v**2
         if (w < 1.0_wp) exit
      end do
      e = u*sqrt(self%dof*(w**(-2.0_wp/self%dof) - 1.0_wp)/w)
   end subroutine student_draw

end module error_models
