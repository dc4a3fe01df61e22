!> Cholesky factors of matrices too small for LAPACK, in the innermost loop of Step 2.
module small_matrices
   use kinds, only: wp
   implicit none
   private
   public :: factor_semidefinite, factor_columns, factor_definite, fit_columns, solve_lower, solve_upper, weighted_gram, sum_of_logs

contains

   !> Lower factor, in place, of a positive semidefinite matrix (lower triangle). A direction whose variance is lost to rounding has
   !> none: its column becomes zero, so the factor is for products, not for solutions.
   pure subroutine factor_semidefinite(a)
      !> (n, n).
      real(wp), intent(inout), contiguous :: a(:, :)
      logical :: definite

      call factor_definite(a, 1.0e-13_wp, definite)
   end subroutine factor_semidefinite

   !> F with F Fᵀ = U Uᵀ and no more columns than rows: U itself, or the lower factor of the product.
   pure subroutine factor_columns(u, f)
      !> (m, n); (m, min(m, n)).
      real(wp), intent(in), contiguous :: u(:, :)
      real(wp), intent(out), contiguous :: f(:, :)
      integer :: i, j, k

      if (size(u, 2) == size(f, 2)) then
         f = u
         return
      end if
      f = 0.0_wp
      do k = 1, size(u, 2)
         do j = 1, size(u, 1)
            do i = j, size(u, 1)
               f(i, j) = f(i, j) + u(i, k)*u(j, k)
            end do
         end do
      end do
      call factor_semidefinite(f)
   end subroutine factor_columns

   !> Minimise sum of w (r - U b)² + b² over b.
   !>
   !> By normal equations; where a pivot has lost its digits, by orthogonalisation of U over the unit matrix, which squares nothing.
   pure subroutine fit_columns(r, u, weight, b, l)
      !> (m), (m, n), (m): weights that are not negative.
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

   !> The same by modified Gram-Schmidt.
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

   !> Lower factor, in place, of a positive definite matrix (lower triangle).
   pure subroutine factor_definite(a, resolution, definite)
      !> (n, n).
      real(wp), intent(inout), contiguous :: a(:, :)
      !> A pivot that is a smaller share of its entry has lost its digits.
      real(wp), intent(in) :: resolution
      !> Whether no pivot has; the column of one that has is zero.
      logical, intent(out) :: definite
      real(wp) :: whole
      integer :: j, k

      definite = .true.
      do j = 1, size(a, 1)
         whole = a(j, j)
         do k = 1, j - 1
            a(j:, j) = a(j:, j) - a(j, k)*a(j:, k)
         end do
         if (a(j, j) > resolution*abs(whole)) then
            a(j:, j) = a(j:, j)/sqrt(a(j, j))
         else
            a(j:, j) = 0.0_wp
            definite = .false.
         end if
      end do
   end subroutine factor_definite

   !> L^-1 b in place.
   pure subroutine solve_lower(l, b)
      !> (n, n) or more, the diagonal positive; (n).
      real(wp), intent(in), contiguous :: l(:, :)
      real(wp), intent(inout), contiguous :: b(:)
      integer :: j, n

      n = size(b)
      do j = 1, n
         b(j) = b(j)/l(j, j)
         b(j + 1:) = b(j + 1:) - l(j + 1:n, j)*b(j)
      end do
   end subroutine solve_lower

   !> L^-ᵀ b in place.
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

   !> I + Uᵀ W U, lower triangle.
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

   !> Sum of the logarithms of positive `values` of ordinary size: one logarithm for eight of them.
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
