!> Normal errors (Eq. 13).
module normal_errors
   use abstract_error_model, only: error_model_type
   use kinds, only: pi, wp
   use random, only: random_stream_type
   use small_matrices, only: fit_columns
   implicit none
   private
   public :: normal_errors_type

   type, extends(error_model_type) :: normal_errors_type
   contains
      procedure :: log_density
      procedure :: integrate
      procedure :: leave_one_out
      procedure :: draw
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

   !> Exact: with the precision W of r, the inverse of I + U Uᵀ, the residual i given the others is normal of mean r_i - (W r)_i/W_ii and
   !> variance 1/W_ii (Bürkner, Gabry and Vehtari, Comput. Stat. 36, 1243, 2021).
   pure subroutine leave_one_out(self, r, u, b, l, values)
      class(normal_errors_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mean of b given r, and the lower factor of its precision.
      real(wp), intent(in) :: b(:), l(:, :)
      !> (measurement).
      real(wp), intent(out) :: values(:)
      real(wp) :: z(size(b)), precision
      integer :: i, j

      do i = 1, size(r)
         do j = 1, size(b)
            z(j) = (u(i, j) - sum(l(j, :j - 1)*z(:j - 1)))/l(j, j)
         end do
         precision = self%scale - sum(z**2)
         values(i) = 0.5_wp*(log(precision/(2.0_wp*pi)) - (r(i) - sum(u(i, :)*b))**2/precision)
      end do
   end subroutine leave_one_out

   subroutine draw(self, stream, e)
      class(normal_errors_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: e

      call stream%normal(e)
      e = self%scale*e
   end subroutine draw
end module normal_errors
