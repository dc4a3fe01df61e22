!> Kernels on short arrays that the compiler turns into vector instructions.
module vector_math
   use kinds, only: i8, wp
   implicit none
   private
   public :: dot, exp_all, transposed_product

   real(wp), parameter :: log2e = 1.44269504088896340735992468100189_wp
   !> log 2 in two pieces, the first with zeros in its last bits, so that k log 2 is exact (Cody & Waite).
   real(wp), parameter :: ln2_high = 6.93145751953125e-1_wp, ln2_low = 1.42860682030941723212e-6_wp
   !> Adding and subtracting 1.5 x 2^52 rounds to the nearest integer.
   real(wp), parameter :: rounder = 6755399441055744.0_wp

contains

   !> `a`ᵀ b, summed in the order that is fastest.
   pure real(wp) function dot(a, b)
      real(wp), intent(in), contiguous :: a(:), b(:)
      integer :: i

      dot = 0.0_wp
      !$omp simd reduction(+:dot)
      do i = 1, size(a)
         dot = dot + a(i)*b(i)
      end do
   end function dot

   !> y = exp(x), element by element, to two units in the last place; x is clamped to -700 .. 700.
   pure subroutine exp_all(x, y)
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: y(:)
      real(wp) :: k, r, p, clamped
      integer :: i

      !$omp simd private(k, r, p, clamped)
      do i = 1, size(x)
         clamped = min(700.0_wp, max(-700.0_wp, x(i)))
         k = (clamped*log2e + rounder) - rounder
         r = (clamped - k*ln2_high) - k*ln2_low
         ! The Taylor series on |r| < 0.35; the first term left out is below 1e-17.
         p = 1.0_wp/6227020800.0_wp
         p = p*r + 1.0_wp/479001600.0_wp
         p = p*r + 1.0_wp/39916800.0_wp
         p = p*r + 1.0_wp/3628800.0_wp
         p = p*r + 1.0_wp/362880.0_wp
         p = p*r + 1.0_wp/40320.0_wp
         p = p*r + 1.0_wp/5040.0_wp
         p = p*r + 1.0_wp/720.0_wp
         p = p*r + 1.0_wp/120.0_wp
         p = p*r + 1.0_wp/24.0_wp
         p = p*r + 1.0_wp/6.0_wp
         p = p*r + 0.5_wp
         p = p*r + 1.0_wp
         p = p*r + 1.0_wp
         y(i) = p*transfer(ishft(int(k, i8) + 1023_i8, 52), 1.0_wp)
      end do
   end subroutine exp_all

   !> y(m) = `a`(n, m)ᵀ x(n) for matrices too small for BLAS; four columns at a time keep the adders busy.
   pure subroutine transposed_product(n, m, a, x, y)
      integer, intent(in) :: n, m
      real(wp), intent(in) :: a(n, m), x(n)
      real(wp), intent(out) :: y(m)
      real(wp) :: t1, t2, t3, t4
      integer :: i, j

      do j = 1, m - 3, 4
         t1 = 0.0_wp
         t2 = 0.0_wp
         t3 = 0.0_wp
         t4 = 0.0_wp
         !$omp simd reduction(+:t1, t2, t3, t4)
         do i = 1, n
            t1 = t1 + a(i, j)*x(i)
            t2 = t2 + a(i, j + 1)*x(i)
            t3 = t3 + a(i, j + 2)*x(i)
            t4 = t4 + a(i, j + 3)*x(i)
         end do
         y(j:j + 3) = [t1, t2, t3, t4]
      end do
      do j = m - mod(m, 4) + 1, m
         y(j) = dot(a(:, j), x)
      end do
   end subroutine transposed_product
end module vector_math
