!> Calls of LAPACK, with `info` turned into messages, and kernels on short arrays that the compiler
!> vectorises.
module linear_algebra
   use errors, only: error_type, raise
   use kinds, only: i8, wp
   use text, only: to_text
   implicit none
   private
   public :: cholesky_factor, cholesky_solve, cholesky_inverse, symmetric_eigen, gram_of, &
      & multiply, multiply_by_factor, orthonormalize, dot, exp_all, transposed_product

   !> Procedures of LAPACK and BLAS. The callers in this module check the sizes.
   ! allow(C091)
   external :: dpotrf, dpotrs, dpotri, dsyevd, dsyrk, dtrmm

   interface
      pure subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
         import
         !> 'N' or 'T'; see BLAS.
         character, intent(in) :: transa, transb
         !> Rows and columns of c, terms of each sum, leading dimensions.
         integer, intent(in) :: m, n, k, lda, ldb, ldc
         !> c = alpha a b + beta c.
         real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
         !> (m, n).
         real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm
   end interface

   real(wp), parameter :: log2e = 1.44269504088896340735992468100189_wp
   !> log 2 in two parts. The last bits of the first are zero, so that k log 2 is exact (Cody &
   !> Waite).
   real(wp), parameter :: ln2_high = 6.93145751953125e-1_wp, ln2_low = 1.42860682030941723212e-6_wp
   !> Adding and then subtracting 1.5 x 2^52 rounds to the nearest integer.
   real(wp), parameter :: rounder = 6755399441055744.0_wp

contains

   !> Overwrite the symmetric positive definite `a` with its lower Cholesky factor. The strict upper
   !> triangle is left unchanged.
   subroutine cholesky_factor(a, error)
      real(wp), intent(inout), contiguous :: a(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: info

      call dpotrf('L', size(a, 2), a, max(1, size(a, 1)), info)
      if (info > 0) then
         call raise(error, 'a matrix is not positive definite (leading minor '//to_text(info) &
            & //' of '//to_text(size(a, 2))//')')
      else if (info < 0) then
         call raise(error, 'a matrix holds a value that is not finite (dpotrf, argument ' &
            & //to_text(-info)//')')
      end if
   end subroutine cholesky_factor

   !> Overwrite the columns of `b` with the solutions of (L Lᵀ) x = b.
   subroutine cholesky_solve(factor, b)
      !> L, lower, (n, n).
      real(wp), intent(in), contiguous :: factor(:, :)
      real(wp), intent(inout), contiguous :: b(:, :)
      integer :: info

      call dpotrs('L', size(factor, 2), size(b, 2), factor, max(1, size(factor, 1)), b, &
         & max(1, size(b, 1)), info)
   end subroutine cholesky_solve

   !> Replace a lower Cholesky factor by the full symmetric inverse of the factored matrix.
   subroutine cholesky_inverse(factor)
      real(wp), intent(inout), contiguous :: factor(:, :)
      integer :: info, j

      call dpotri('L', size(factor, 2), factor, max(1, size(factor, 1)), info)
      do j = 2, size(factor, 2)
         factor(:j - 1, j) = factor(j, :j - 1)
      end do
   end subroutine cholesky_inverse

   !> Ascending eigenvalues of the symmetric `a`, of which the lower triangle is read. `a` is
   !> overwritten with the eigenvectors, one a column.
   subroutine symmetric_eigen(a, values, error)
      real(wp), intent(inout), contiguous :: a(:, :)
      !> Eigenvalues, (n).
      real(wp), intent(out), contiguous :: values(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: n, info
      integer, allocatable :: iwork(:)
      real(wp), allocatable :: work(:)

      n = size(a, 2)
      allocate (work(1 + 6*n + 2*n*n), iwork(3 + 5*n))
      call dsyevd('V', 'L', n, a, max(1, n), values, work, size(work), iwork, size(iwork), info)
      if (info /= 0) then
         call raise(error, 'the symmetric eigenvalue problem did not converge (dsyevd, info ' &
            & //to_text(info)//')')
      end if
   end subroutine symmetric_eigen

   !> The full symmetric matrix a aᵀ, or aᵀ a if `transposed`, times a factor.
   function gram_of(a, transposed, factor) result(gram)
      !> (n, m).
      real(wp), intent(in), contiguous :: a(:, :)
      logical, intent(in), optional :: transposed
      !> 1 if it is left out.
      real(wp), intent(in), optional :: factor
      real(wp), allocatable :: gram(:, :)
      real(wp) :: scale
      character :: form
      integer :: j, n

      form = 'N'
      if (present(transposed)) form = merge('T', 'N', transposed)
      scale = 1.0_wp
      if (present(factor)) scale = factor
      n = size(a, merge(2, 1, form == 'T'))
      allocate (gram(n, n), source=0.0_wp)
      call dsyrk('L', form, n, size(a, merge(1, 2, form == 'T')), scale, a, max(1, size(a, 1)), &
         & 1.0_wp, gram, max(1, n))
      do j = 2, n
         gram(:j - 1, j) = gram(j, :j - 1)
      end do
   end function gram_of

   !> product = a b, or aᵀ b if `transposed`.
   pure subroutine multiply(a, b, product, transposed)
      !> (n, k), or (k, n), and (k, m).
      real(wp), intent(in), contiguous :: a(:, :), b(:, :)
      real(wp), intent(out), contiguous :: product(:, :)
      !> Whether the product is aᵀ b.
      logical, intent(in), optional :: transposed
      character :: form

      form = 'N'
      if (present(transposed)) form = merge('T', 'N', transposed)
      call dgemm(form, 'N', size(product, 1), size(b, 2), size(b, 1), 1.0_wp, a, &
         & max(1, size(a, 1)), b, max(1, size(b, 1)), 0.0_wp, product, max(1, size(product, 1)))
   end subroutine multiply

   !> Overwrite b with Lᵀ b.
   subroutine multiply_by_factor(factor, b)
      !> L, lower, (n, n); its strict upper triangle is not read.
      real(wp), intent(in), contiguous :: factor(:, :)
      !> (n, m).
      real(wp), intent(inout), contiguous :: b(:, :)

      call dtrmm('L', 'L', 'T', 'N', size(b, 1), size(b, 2), 1.0_wp, factor, &
         & max(1, size(factor, 1)), b, max(1, size(b, 1)))
   end subroutine multiply_by_factor

   !> Replace the columns of `a` by orthonormal ones (Gram and Schmidt, twice). Each lies in the
   !> span of the original column and those before it; one that depends on these becomes zero.
   subroutine orthonormalize(a)
      !> (m, n), m >= n.
      real(wp), intent(inout), contiguous :: a(:, :)
      real(wp) :: length
      integer :: j, pass

      do j = 1, size(a, 2)
         length = norm2(a(:, j))
         do pass = 1, 2
            a(:, j) = a(:, j) - matmul(a(:, :j - 1), matmul(a(:, j), a(:, :j - 1)))
         end do
         if (norm2(a(:, j)) <= 1.0e-12_wp*length) a(:, j) = 0.0_wp
         a(:, j) = a(:, j)/max(tiny(length), norm2(a(:, j)))
      end do
   end subroutine orthonormalize

   !> `a`ᵀ b; the order of the sum is chosen for speed.
   pure real(wp) function dot(a, b)
      real(wp), intent(in), contiguous :: a(:), b(:)
      integer :: i

      dot = 0.0_wp
      !$omp simd reduction(+:dot)
      do i = 1, size(a)
         dot = dot + a(i)*b(i)
      end do
   end function dot

   !> y = exp(x), element by element, to two units in the last place; x is limited to -700 .. 700.
   pure subroutine exp_all(x, y)
      real(wp), intent(in), contiguous :: x(:)
      real(wp), intent(out), contiguous :: y(:)
      real(wp) :: k, r, tail, p, clamped
      integer :: i

      !$omp simd private(k, r, tail, p, clamped)
      do i = 1, size(x)
         clamped = min(700.0_wp, max(-700.0_wp, x(i)))
         k = (clamped*log2e + rounder) - rounder
         r = (clamped - k*ln2_high) - k*ln2_low
         ! The Taylor series on |r| < 0.35; the first neglected term is below 1e-17.
         tail = 1.0_wp/40320.0_wp + r*(1.0_wp/362880.0_wp + r*(1.0_wp/3628800.0_wp &
            & + r*(1.0_wp/39916800.0_wp + r*(1.0_wp/479001600.0_wp + r*(1.0_wp/6227020800.0_wp)))))
         p = 1.0_wp + r*(1.0_wp + r*(0.5_wp + r*(1.0_wp/6.0_wp + r*(1.0_wp/24.0_wp &
            & + r*(1.0_wp/120.0_wp + r*(1.0_wp/720.0_wp + r*(1.0_wp/5040.0_wp + r*tail)))))))
         y(i) = p*transfer(ishft(int(k, i8) + 1023_i8, 52), 1.0_wp)
      end do
   end subroutine exp_all

   !> y(m) = `a`(n, m)ᵀ x(n) for matrices too small for BLAS. Four columns at a time keep the adders
   !> busy.
   pure subroutine transposed_product(a, x, y)
      real(wp), intent(in), contiguous :: a(:, :)
      real(wp), intent(in) :: x(size(a, 1))
      real(wp), intent(out) :: y(size(a, 2))
      real(wp) :: t1, t2, t3, t4
      integer :: i, j, m

      m = size(y)
      do j = 1, m - 3, 4
         t1 = 0.0_wp
         t2 = 0.0_wp
         t3 = 0.0_wp
         t4 = 0.0_wp
         !$omp simd reduction(+:t1, t2, t3, t4)
         do i = 1, size(x)
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

end module linear_algebra
