!> Student's t: errors of which some are far off.
!>
!> For more than two degrees of freedom its standard deviation is that of the measurement, so the scale is sqrt((dof - 2)/dof) of
!> it.
!> With two or fewer the distribution has no standard deviation, and what is stated is its scale.
module student_errors
   use abstract_error_model, only: error_model_type
   use kinds, only: pi, wp
   use random, only: random_stream_type
   use small_matrices, only: factor_definite, fit_columns, sum_of_logs, weighted_gram
   implicit none
   private
   public :: student_errors_type, new_student_errors

   type, extends(error_model_type) :: student_errors_type
      !> Degrees of freedom, positive.
      real(wp) :: dof = 4.0_wp
   contains
      procedure :: log_density
      procedure :: integrate
      procedure :: leave_one_out
      procedure :: draw
   end type student_errors_type

contains

   pure function new_student_errors(dof) result(self)
      !> Degrees of freedom.
      real(wp), intent(in) :: dof
      type(student_errors_type) :: self

      self%dof = dof
      if (dof > 2.0_wp) self%scale = sqrt((dof - 2.0_wp)/dof)
   end function new_student_errors

   pure real(wp) function log_density(self, r, factor)
      class(student_errors_type), intent(in) :: self
      !> Residuals in units of the scale, and the factor on that.
      real(wp), intent(in) :: r(:), factor

      log_density = size(r)*(log_gamma(0.5_wp*(self%dof + 1.0_wp)) - log_gamma(0.5_wp*self%dof) &
         & - 0.5_wp*log(pi*self%dof) - log(factor)) &
         & - 0.5_wp*(self%dof + 1.0_wp)*sum_of_logs(1.0_wp + (r/factor)**2/self%dof)
   end function log_density

   !> By Laplace's approximation about the mode.
   pure subroutine integrate(self, r, u, b, l, value)
      class(student_errors_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode of b given r, and the lower factor of its precision.
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp) :: e(size(r)), weight(size(r)), before(size(b)), misfit
      integer :: j, step
      logical :: definite

      b = 0.0_wp
      e = r
      do step = 1, 40
         before = b
         weight = (self%dof + 1.0_wp)/(self%dof + e**2)
         call fit_columns(r, u, weight, b, l, misfit)
         e = r - matmul(u, b)
         if (maxval(abs(b - before)) < 1.0e-9_wp) exit
      end do
      value = self%log_density(e, 1.0_wp) - 0.5_wp*sum(b**2)
      weight = (self%dof + 1.0_wp)*(self%dof - e**2)/(self%dof + e**2)**2
      call weighted_gram(u, weight, l)
      call factor_definite(l, 1.0e-13_wp, definite)
      if (.not. definite) then
         ! Outliers outweigh the rest: the expected curvature of Student's t stands in for the observed one.
         weight = (self%dof + 1.0_wp)/(self%dof + 3.0_wp)
         call fit_columns(e, u, weight, before, l, misfit)
      end if
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate

   !> Without shared errors the density itself. Else b given the others is taken as normal: curvature of the log density at the mode less
   !> that of residual i, where convex, and one step of Newton's from there; the integral over that is one over the variance of the
   !> normal error of which t is a mixture.
   pure subroutine leave_one_out(self, r, u, b, l, values)
      class(student_errors_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode of b given r, and the lower factor of the precision there.
      real(wp), intent(in) :: b(:), l(:, :)
      !> (measurement).
      real(wp), intent(out) :: values(:)
      real(wp), allocatable :: variance(:), weight(:), curvature(:)
      real(wp) :: e(size(r)), factor(size(b), size(b)), z(size(b)), h, spread, shift
      logical :: definite
      integer :: i, j

      if (size(b) == 0) then
         do i = 1, size(r)
            values(i) = self%log_density(r(i:i), 1.0_wp)
         end do
         return
      end if
      e = r - matmul(u, b)
      curvature = max(0.0_wp, (self%dof + 1.0_wp)*(self%dof - e**2)/(self%dof + e**2)**2)
      call weighted_gram(u, curvature, factor)
      call factor_definite(factor, 1.0e-13_wp, definite)
      if (.not. definite) factor = l
      call mixture_of_variances(self%dof, variance, weight)
      do i = 1, size(r)
         do j = 1, size(b)
            z(j) = (u(i, j) - sum(factor(j, :j - 1)*z(:j - 1)))/factor(j, j)
         end do
         ! Of u b: the variance without i, and what the pull of i on the mode was.
         h = sum(z**2)
         spread = h/max(1.0e-6_wp, 1.0_wp - curvature(i)*h)
         shift = -spread*(self%dof + 1.0_wp)*e(i)/(self%dof + e(i)**2)
         values(i) = log(sum(weight*exp(-0.5_wp*(e(i) - shift)**2/(variance + spread))/sqrt(2.0_wp*pi*(variance + spread))))
      end do
   end subroutine leave_one_out

   !> Student's t as normal errors of these variances with these weights: 1/variance has a gamma distribution, whose logarithm is put on an
   !> even grid.
   pure subroutine mixture_of_variances(dof, variance, weight)
      real(wp), intent(in) :: dof
      real(wp), allocatable, intent(out) :: variance(:), weight(:)
      real(wp) :: width, low, step, x
      integer :: i, n

      width = sqrt(2.0_wp/dof)
      low = -72.0_wp/(dof + 1.0_wp) - 9.0_wp*min(1.0_wp, width)
      step = min(0.25_wp, 0.5_wp*width)
      n = 1 + int((log(1.0_wp + 80.0_wp/dof) + 9.0_wp*min(1.0_wp, width) - low)/step)
      allocate (variance(n), weight(n))
      do i = 1, n
         x = low + (i - 1)*step
         variance(i) = exp(-x)
         weight(i) = step*exp(0.5_wp*dof*(x - exp(x) + log(0.5_wp*dof)) - log_gamma(0.5_wp*dof))
      end do
   end subroutine mixture_of_variances

   !> By the polar method (Bailey, Math. Comp. 62, 779, 1994).
   subroutine draw(self, stream, e)
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
   end subroutine draw
end module student_errors
