!> Normal errors (Eq. 13).
module normal_errors
   use abstract_error_model, only: error_model_type
   use kinds, only: pi, wp
   use small_matrices, only: fit_columns
   implicit none
   private
   public :: normal_errors_type

   type, extends(error_model_type) :: normal_errors_type
   contains
      procedure :: log_density
      procedure :: integrate
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

   pure subroutine integrate(self, r, u, b, l, value)
      class(normal_errors_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mean of b given r, and the lower factor of its precision.
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp) :: ones(size(r)), misfit
      integer :: j

      ones = self%scale
      call fit_columns(r, u, ones, b, l, misfit)
      value = -0.5_wp*misfit - 0.5_wp*size(r)*log(2.0_wp*pi)
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate
end module normal_errors
