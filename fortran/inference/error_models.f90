!> Likelihoods: the distribution of the errors of independent measurements, with or without errors
!> that they share.
!>
!> Residuals are divided by the scale of their error, and U has the effect of one sd of each shared
!> error b on them, (measurement, shared error).
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

   !> A new likelihood needs a type that extends `error_model_type`, its name here, and a case in
   !> `new_error_model`.
   character(len=*), parameter :: likelihood_names = 'normal, student'

   !> Normal errors (Eq. 13).
   type :: error_model_type
      !> Scale of the density for a standard deviation of one.
      real(wp) :: scale = 1.0_wp
   contains
      procedure :: log_density, weigh, as_normals, draw, integrate, leave_one_out
   end type error_model_type

   !> Student's t: errors with outliers.
   !>
   !> For more than two degrees of freedom its standard deviation is that of the measurement, so the
   !> scale is sqrt((dof - 2)/dof) times it. With two or fewer the distribution has no standard
   !> deviation, and the stated sd is its scale.
   type, extends(error_model_type) :: student_errors_type
      !> Degrees of freedom, positive.
      real(wp) :: dof = 4.0_wp
   contains
      procedure :: log_density => student_log_density, weigh => student_weigh, &
         & as_normals => student_as_normals, draw => student_draw
   end type student_errors_type

   !> Least share of its diagonal entry that a pivot of the precision may have: a smaller one has
   !> lost its digits.
   real(wp), parameter :: resolution = 1.0e-13_wp

contains

   !> The error model that &measurements states.
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

   !> Logarithm of the density of residuals `r` that all have the scale `factor`.
   pure real(wp) function log_density(self, r, factor)
      class(error_model_type), intent(in) :: self
      !> (measurement).
      real(wp), intent(in) :: r(:), factor

      log_density = -0.5_wp*dot(r, r)/factor**2 - size(r)*(log(factor) + 0.5_wp*log(2.0_wp*pi))
   end function log_density

   !> Derivatives of the log density of scale one: minus the first over the residual, minus the
   !> second, and the expectation of the latter.
   pure subroutine weigh(self, e, weight, curvature, expected)
      class(error_model_type), intent(in) :: self
      !> Residuals in units of the scale, (measurement).
      real(wp), intent(in) :: e(:)
      !> Minus the first derivative over the residual; minus the second and its expectation;
      !> (measurement).
      real(wp), intent(out) :: weight(:), curvature(:), expected(:)

      weight = 1.0_wp
      curvature = 1.0_wp
      expected = 1.0_wp
   end subroutine weigh

   !> Write the density of scale one as a mixture of normal densities.
   pure subroutine as_normals(self, variance, share)
      class(error_model_type), intent(in) :: self
      !> Variance and share of each component.
      real(wp), allocatable, intent(out) :: variance(:), share(:)

      variance = [1.0_wp]
      share = [1.0_wp]
   end subroutine as_normals

   !> Draw an error `e` of scale one.
   subroutine draw(self, stream, e)
      class(error_model_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: e

      call stream%normal(e)
   end subroutine draw

   !> Integrate the density of r - U b, of scale one, times N(b; 0, 1) over b: by Laplace's
   !> approximation about the mode, which is exact for normal errors.
   pure subroutine integrate(self, r, u, b, l, value)
      class(error_model_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode of b given r, (shared error), and the lower factor of its precision.
      real(wp), allocatable, intent(out) :: b(:), l(:, :)
      !> Logarithm of the integral.
      real(wp), intent(out) :: value
      integer, parameter :: most_steps = 40
      real(wp), dimension(size(r)) :: e, weight, previous_weight, curvature, expected
      real(wp) :: previous_b(size(u, 2))
      integer :: j, step
      logical :: definite

      allocate (b(size(u, 2)), l(size(u, 2), size(u, 2)), source=0.0_wp)
      call self%weigh(r, weight, curvature, expected)
      do step = 1, most_steps
         previous_b = b
         previous_weight = weight
         call fit_columns(r, u, previous_weight, b, l)
         e = r - matmul(u, b)
         call self%weigh(e, weight, curvature, expected)
         if (maxval(abs(b - previous_b)) < 1.0e-9_wp) exit
         if (maxval(abs(weight - previous_weight)) <= 0.0_wp) exit
      end do
      value = self%log_density(e, 1.0_wp) - 0.5_wp*sum(b**2)
      if (maxval(abs(curvature - previous_weight)) > 0.0_wp) then
         call weighted_gram(u, curvature, l)
         call factor_definite(l, resolution, definite)
         ! The observed curvature is not definite if outliers outweigh the rest. The expected
         ! curvature then replaces it.
         if (.not. definite) call fit_columns(e, u, expected, previous_b, l)
      end if
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate

   !> Logarithm of the density of each residual given all others, of scale one. Without shared
   !> errors it is the density itself.
   !>
   !> Otherwise b given the other residuals is taken as normal. Its precision is the curvature of
   !> the log density at the mode less that of residual i, where convex; its mean is one step of
   !> Newton's method from the mode. The density of residual i is then integrated over b as a
   !> mixture of normal densities. The result is exact for normal errors (Bürkner, Gabry and
   !> Vehtari, Comput. Stat. 36, 1243, 2021).
   pure subroutine leave_one_out(self, r, u, b, l, values)
      class(error_model_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode and lower factor from `integrate`.
      real(wp), intent(in) :: b(:), l(:, :)
      !> (measurement).
      real(wp), intent(out) :: values(:)
      real(wp), allocatable :: variance(:), share(:), terms(:)
      real(wp), dimension(size(r)) :: e, weight, curvature, expected
      real(wp) :: factor(size(b), size(b)), z(size(b)), h, h_without
      logical :: definite
      integer :: i

      if (size(b) == 0) then
         values = [(self%log_density(r(i:i), 1.0_wp), i=1, size(r))]
         return
      end if
      e = r - matmul(u, b)
      call self%weigh(e, weight, curvature, expected)
      curvature = max(0.0_wp, curvature)
      call weighted_gram(u, curvature, factor)
      call factor_definite(factor, resolution, definite)
      if (.not. definite) factor = l
      call self%as_normals(variance, share)
      do i = 1, size(r)
         z = u(i, :)
         call solve_lower(factor, z)
         ! Variances of the shared part at measurement i, with and without that measurement.
         h = sum(z**2)
         h_without = h/max(1.0e-6_wp, 1.0_wp - curvature(i)*h)
         terms = log(share) &
            & - 0.5_wp*(e(i)*(1.0_wp + h_without*weight(i)))**2/(variance + h_without) &
            & - 0.5_wp*log(2.0_wp*pi*(variance + h_without))
         values(i) = maxval(terms) + log(sum(exp(terms - maxval(terms))))
      end do
   end subroutine leave_one_out

   pure real(wp) function student_log_density(self, r, factor) result(log_density)
      class(student_errors_type), intent(in) :: self
      real(wp), intent(in) :: r(:), factor

      associate (dof => self%dof)
         log_density = size(r)*(log_gamma(0.5_wp*(dof + 1.0_wp)) - log_gamma(0.5_wp*dof) &
            & - 0.5_wp*log(pi*dof) - log(factor)) &
            & - 0.5_wp*(dof + 1.0_wp)*sum_of_logs(1.0_wp + (r/factor)**2/dof)
      end associate
   end function student_log_density

   pure subroutine student_weigh(self, e, weight, curvature, expected)
      class(student_errors_type), intent(in) :: self
      real(wp), intent(in) :: e(:)
      real(wp), intent(out) :: weight(:), curvature(:), expected(:)

      weight = (self%dof + 1.0_wp)/(self%dof + e**2)
      curvature = (self%dof + 1.0_wp)*(self%dof - e**2)/(self%dof + e**2)**2
      expected = (self%dof + 1.0_wp)/(self%dof + 3.0_wp)
   end subroutine student_weigh

   !> The inverse variance has a gamma distribution. Its logarithm is placed on an even grid that
   !> reaches to where the density is negligible.
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

   !> Draw an error by the polar method (Bailey, Math. Comp. 62, 779, 1994).
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
