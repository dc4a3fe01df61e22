!> Cholesky factors of matrices too small for LAPACK, in the innermost loop of Step 2.
module small_matrices
   use kinds, only: wp
   implicit none
   private
   public :: factor_columns, factor_definite, fit_columns, solve_lower, solve_upper, &
      & weighted_gram, sum_of_logs

contains

   !> F with F Fᵀ = U Uᵀ and as few columns as matter beside errors of unit variance (pivoted
   !> Cholesky factorisation).
   pure subroutine factor_columns(u, f)
      !> (m, n); (m, rank).
      real(wp), intent(in), contiguous :: u(:, :)
      real(wp), allocatable, intent(out) :: f(:, :)
      real(wp) :: columns(size(u, 1), size(u, 2)), residual(size(u, 1)), least
      integer :: j, k, pivot

      residual = sum(u**2, 2)
      ! Smallest pivot: 1e-8 of the unit error variance, and at least the rounding error of the
      ! largest one.
      least = max(1.0e-8_wp, 1.0e-13_wp*maxval(residual))
      do k = 1, min(size(u, 1), size(u, 2))
         pivot = maxloc(residual, 1)
         if (residual(pivot) <= least) exit
         columns(:, k) = 0.0_wp
         do j = 1, size(u, 2)
            columns(:, k) = columns(:, k) + u(pivot, j)*u(:, j)
         end do
         do j = 1, k - 1
            columns(:, k) = columns(:, k) - columns(pivot, j)*columns(:, j)
         end do
         columns(:, k) = columns(:, k)/sqrt(residual(pivot))
         residual = residual - columns(:, k)**2
      end do
      f = columns(:, :k - 1)
   end subroutine factor_columns

   !> Minimise the sum of w (r - U b)² + b² over b.
   !>
   !> The normal equations are solved. If a pivot has lost its digits, U over the unit matrix is
   !> orthogonalised instead, which does not square the condition number.
   pure subroutine fit_columns(r, u, weight, b, l)
      !> (m), (m, n), (m); weights are not negative.
      real(wp), intent(in), contiguous :: r(:), u(:, :), weight(:)
      !> (n); (n, n), the lower factor of I + Uᵀ W U.
      real(wp), intent(out), contiguous :: b(:), l(:, :)
      integer :: j
      logical :: accurate

      call weighted_gram(u, weight, l)
      do j = 1, size(b)
         b(j) = sum(u(:, j)*weight*r)
      end do
      call factor_definite(l, 1.0e-10_wp, accurate)
      if (accurate) then
         call solve_lower(l, b)
         call solve_upper(l, b)
      else
         call orthogonalise(r, u, weight, b, l)
      end if
   end subroutine fit_columns

   !> Solve the problem of `fit_columns` by modified Gram-Schmidt orthogonalisation.
   pure subroutine orthogonalise(r, u, weight, b, l)
      real(wp), intent(in), contiguous :: r(:), u(:, :), weight(:)
      real(wp), intent(out), contiguous :: b(:), l(:, :)
      real(wp) :: q(size(r) + size(b), size(b) + 1)
      integer :: m, n, i, j

      m = size(r)
      n = size(b)
      q = 0.0_wp
      do j = 1, n
         q(:m, j) = sqrt(weight)*u(:, j)
         q(m + j, j) = 1.0_wp
      end do
      q(:m, n + 1) = sqrt(weight)*r
      l = 0.0_wp
      do j = 1, n
         l(j, j) = sqrt(sum(q(:, j)**2))
         q(:, j) = q(:, j)/l(j, j)
         do i = j + 1, n
            l(i, j) = sum(q(:, j)*q(:, i))
            q(:, i) = q(:, i) - l(i, j)*q(:, j)
         end do
         b(j) = sum(q(:, j)*q(:, n + 1))
         q(:, n + 1) = q(:, n + 1) - b(j)*q(:, j)
      end do
      call solve_upper(l, b)
   end subroutine orthogonalise

   !> Overwrite the lower triangle of a positive definite matrix with its lower Cholesky factor.
   pure subroutine factor_definite(a, resolution, definite)
      !> (n, n).
      real(wp), intent(inout), contiguous :: a(:, :)
      !> A pivot below this share of its diagonal entry has lost its digits.
      real(wp), intent(in) :: resolution
      !> Whether all pivots are accurate. The column of an inaccurate pivot is set to zero: the
      !> factor then serves for products, not for solutions.
      logical, intent(out), optional :: definite
      real(wp) :: diagonal
      integer :: j, k

      if (present(definite)) definite = .true.
      do j = 1, size(a, 1)
         diagonal = a(j, j)
         do k = 1, j - 1
            a(j:, j) = a(j:, j) - a(j, k)*a(j:, k)
         end do
         if (a(j, j) > resolution*abs(diagonal)) then
            a(j:, j) = a(j:, j)/sqrt(a(j, j))
         else
            a(j:, j) = 0.0_wp
            if (present(definite)) definite = .false.
         end if
      end do
   end subroutine factor_definite

   !> Overwrite b with L^-1 b.
   pure subroutine solve_lower(l, b)
      !> (n, n) or larger, with positive diagonal; (n).
      real(wp), intent(in), contiguous :: l(:, :)
      real(wp), intent(inout), contiguous :: b(:)
      integer :: j, n

      n = size(b)
      do j = 1, n
         b(j) = b(j)/l(j, j)
         b(j + 1:) = b(j + 1:) - l(j + 1:n, j)*b(j)
      end do
   end subroutine solve_lower

   !> Overwrite b with L^-ᵀ b.
   pure subroutine solve_upper(l, b)
      !> As in `solve_lower`.
      real(wp), intent(in), contiguous :: l(:, :)
      real(wp), intent(inout), contiguous :: b(:)
      integer :: j, n

      n = size(b)
      do j = n, 1, -1
         b(j) = (b(j) - sum(l(j + 1:n, j)*b(j + 1:)))/l(j, j)
      end do
   end subroutine solve_upper

   !> The lower triangle of I + Uᵀ W U.
   pure subroutine weighted_gram(u, weight, gram)
      !> (m, n), (m).
      real(wp), intent(in), contiguous :: u(:, :), weight(:)
      !> (n, n).
      real(wp), intent(out), contiguous :: gram(:, :)
      real(wp) :: total
      integer :: g, h, i

      gram = 0.0_wp
      do g = 1, size(u, 2)
         do h = g, size(u, 2)
            total = 0.0_wp
            !$omp simd reduction(+:total)
            do i = 1, size(u, 1)
               total = total + u(i, h)*weight(i)*u(i, g)
            end do
            gram(h, g) = total
         end do
         gram(g, g) = gram(g, g) + 1.0_wp
      end do
   end subroutine weighted_gram

   !> Sum of the logarithms of positive `values` of ordinary size: one logarithm for each eight of
   !> them.
   pure real(wp) function sum_of_logs(values)
      !> (n).
      real(wp), intent(in), contiguous :: values(:)
      integer :: i

      sum_of_logs = 0.0_wp
      do i = 1, size(values), 8
         sum_of_logs = sum_of_logs + log(product(values(i:min(i + 7, size(values)))))
      end do
   end function sum_of_logs
end module small_matrices
