!> Student's t: errors of which some are far off.
!>
!> For more than two degrees of freedom its standard deviation is that of the measurement, so the scale is sqrt((dof - 2)/dof) of
!> it.
!> With two or fewer the distribution has no standard deviation, and what is stated is its scale.
module student_errors
   use abstract_error_model, only: error_model_type
   use kinds, only: pi, wp
   use random, only: random_stream_type
   use small_matrices, only: sum_of_logs
   implicit none
   private
   public :: student_errors_type, new_student_errors

   type, extends(error_model_type) :: student_errors_type
      !> Degrees of freedom, positive.
      real(wp) :: dof = 4.0_wp
   contains
      procedure :: log_density, weigh, as_normals, draw
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

   pure subroutine weigh(self, e, weight, curvature, expected)
      class(student_errors_type), intent(in) :: self
      real(wp), intent(in) :: e(:)
      real(wp), intent(out) :: weight(:)
      real(wp), intent(out), optional :: curvature(:), expected(:)

      weight = (self%dof + 1.0_wp)/(self%dof + e**2)
      if (present(curvature)) curvature = (self%dof + 1.0_wp)*(self%dof - e**2)/(self%dof + e**2)**2
      if (present(expected)) expected = (self%dof + 1.0_wp)/(self%dof + 3.0_wp)
   end subroutine weigh

   !> 1/variance has a gamma distribution, whose logarithm is put on an even grid.
   pure subroutine as_normals(self, variance, share)
      class(student_errors_type), intent(in) :: self
      !> (component).
      real(wp), allocatable, intent(out) :: variance(:), share(:)
      real(wp) :: width, low, step, x
      integer :: i, n

      width = sqrt(2.0_wp/self%dof)
      low = -72.0_wp/(self%dof + 1.0_wp) - 9.0_wp*min(1.0_wp, width)
      step = min(0.25_wp, 0.5_wp*width)
      n = 1 + int((log(1.0_wp + 80.0_wp/self%dof) + 9.0_wp*min(1.0_wp, width) - low)/step)
      allocate (variance(n), share(n))
      do i = 1, n
         x = low + (i - 1)*step
         variance(i) = exp(-x)
         share(i) = step*exp(0.5_wp*self%dof*(x - exp(x) + log(0.5_wp*self%dof)) - log_gamma(0.5_wp*self%dof))
      end do
   end subroutine as_normals

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
