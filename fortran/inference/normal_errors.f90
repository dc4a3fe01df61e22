!> Normal errors (Eq. 13).
module normal_errors
   use abstract_error_model, only: error_model_type
   use kinds, only: pi, wp
   use random, only: random_stream_type
   implicit none
   private
   public :: normal_errors_type

   type, extends(error_model_type) :: normal_errors_type
   contains
      procedure :: log_density, weigh, as_normals, draw
   end type normal_errors_type

contains

   pure real(wp) function log_density(self, r, factor)
      class(normal_errors_type), intent(in) :: self
      !> Residuals in units of the scale, and the factor on that.
      real(wp), intent(in) :: r(:), factor
      real(wp) :: total
      integer :: i

      total = 0.0_wp
      !$omp simd reduction(+:total)
      do i = 1, size(r)
         total = total + r(i)**2
      end do
      log_density = -0.5_wp*total/factor**2 - size(r)*(log(self%scale*factor) + 0.5_wp*log(2.0_wp*pi))
   end function log_density

   pure subroutine weigh(self, e, weight, curvature, expected)
      class(normal_errors_type), intent(in) :: self
      real(wp), intent(in) :: e(:)
      real(wp), intent(out) :: weight(:)
      real(wp), intent(out), optional :: curvature(:), expected(:)

      weight = 1.0_wp
      if (present(curvature)) curvature = 1.0_wp
      if (present(expected)) expected = 1.0_wp
   end subroutine weigh

   pure subroutine as_normals(self, variance, share)
      class(normal_errors_type), intent(in) :: self
      real(wp), allocatable, intent(out) :: variance(:), share(:)

      variance = [1.0_wp]
      share = [1.0_wp]
   end subroutine as_normals

   subroutine draw(self, stream, e)
      class(normal_errors_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: e

      call stream%normal(e)
   end subroutine draw
end module normal_errors
