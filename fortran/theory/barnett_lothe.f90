!> The Barnett-Lothe tensor L of several directions of a crystal at once, inverted.
!>
!> B of the half-space theory is L/(4 pi), and -L is the lower left block of the mean, over the turn of m and n about t, of Stroh's
!> matrix N = [A, D; E, A^T], A = -(nn)^-1 (nm), D = (nn)^-1, E = (mn)(nn)^-1 (nm) - (mm) (Barnett & Lothe, Phys. Norvegica 7, 13,
!> 1973). A turn by phi maps N as it maps the cotangent of an angle: N(phi) = (N cos phi - sin phi)(cos phi + N sin phi)^-1. So
!> the trapezoid rule F over n equally spaced angles of half a turn obeys F_2n = (F_n - F_n^-1)/2, the rule of cot 2 x: one inverse of a
!> 6 x 6 matrix doubles the angles, where the sum would need n inverses of (nn). F_n^-1 has the blocks of N too; D is positive and E
!> negative definite in both, being means of (nn)^-1, so that the 3 x 3 inverses below need no pivots.
module barnett_lothe
   use crystal_elasticity, only: voigt_index
   use kinds, only: pi, wp
   implicit none
   private
   public :: lanes, tolerance, contraction_maps, inverse_barnett

   !> Directions that one call takes: they fill the vector units.
   integer, parameter :: lanes = 8
   !> Relative change on doubling the angles below which the finer grid is accepted. The rule converges exponentially on these
   !> periodic integrands, so that the error left is about the square of the change.
   real(wp), parameter :: tolerance = 2.0e-5_wp
   !> Doublings before the first result, and the most.
   integer, parameter :: first_doublings = 3, most_doublings = 14
   !> Places of the elements of a transposed matrix, by columns.
   integer, parameter :: transposed(9) = [1, 4, 7, 2, 5, 8, 3, 6, 9]

contains

   !> The contractions (ab)_ij = a_k C_kijl b_l of a stiffness as linear functions of the products a_k b_l.
   pure subroutine contraction_maps(c, one, both)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      !> From a_k b_l, l fastest, to (ab) by columns.
      real(wp), intent(out) :: one(9, 9)
      !> From a_k a_l to (aa), both by the components 11, 22, 33, 23, 13, 12.
      real(wp), intent(out) :: both(6, 6)
      integer, parameter :: first(6) = [1, 2, 3, 2, 1, 1], second(6) = [1, 2, 3, 3, 3, 2]
      integer :: i, j, k, l, p, q

      do j = 1, 3
         do i = 1, 3
            do k = 1, 3
               do l = 1, 3
                  one(l + 3*(k - 1), i + 3*(j - 1)) = c(voigt_index(k, i), voigt_index(j, l))
               end do
            end do
         end do
      end do
      do q = 1, 6
         i = first(q)
         j = second(q)
         do p = 1, 6
            k = first(p)
            l = second(p)
            both(p, q) = c(voigt_index(k, i), voigt_index(j, l))
            if (k /= l) both(p, q) = both(p, q) + c(voigt_index(l, i), voigt_index(j, k))
         end do
      end do
   end subroutine contraction_maps

   !> B^-1/(8 pi^2) = L^-1/(2 pi), 1/GPa: components 11, 22, 33, 23, 13, 12.
   pure subroutine inverse_barnett(mm, mn, nn, f)
      !> The contractions (ab)_ij = a_k C_kijl b_l with two directions perpendicular to t and to each other, GPa: those six components of
      !> (mm) and (nn), and (mn) by columns.
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      !> Those of B^-1/(8 pi^2) in the axes of the contractions.
      real(wp), intent(out) :: f(lanes, 6)
      real(wp) :: a(lanes, 9), d(lanes, 6), e(lanes, 6), x(lanes, 9), before(lanes, 3), change
      integer :: k

      ! A = -(nn)^-1 (nm), D, and E = (mn)(nn)^-1 (nm) - (mm).
      x = mn(:, transposed)
      call invert(nn, d)
      call multiply(d, x, a)
      call multiply_transposed(a, x, e)
      a = -a
      e = e - mm
      do k = 1, first_doublings
         call double_angles(a, d, e, change)
      end do
      call invert(e, f)
      do k = first_doublings + 1, most_doublings
         before = f(:, 1:3)
         call double_angles(a, d, e, change)
         call invert(e, f)
         if (change <= tolerance .and. all(abs(f(:, 1:3) - before) <= -tolerance*f(:, 1:3))) exit
      end do
      f = f*(-0.5_wp/pi)
   end subroutine inverse_barnett

   !> F of twice as many angles.
   pure subroutine double_angles(a, d, e, change)
      !> The blocks of F: A by columns, D and E by components.
      real(wp), intent(inout) :: a(lanes, 9), d(lanes, 6), e(lanes, 6)
      !> The largest of the elements of A, which have no unit.
      real(wp), intent(out) :: change
      real(wp) :: inverse(lanes, 6), s(lanes, 6), t(lanes, 6), k(lanes, 9), w(lanes, 9)
      integer :: i, j

      ! K = D^-1 A, S = E - A^T K, and its inverse T, the upper right block of F^-1; W = T K^T: F^-1 = [-W, T; D^-1 + W^T K^T, -W^T].
      call invert(d, inverse)
      call multiply(inverse, a, k)
      call multiply_transposed(a, k, s)
      call invert(e - s, t)
      k = k(:, transposed)
      call multiply(t, k, w)
      call multiply_transposed(w, k, s)
      change = 0.0_wp
      !$omp simd collapse(2) reduction(max: change)
      do j = 1, 9
         do i = 1, lanes
            change = max(change, abs(w(i, j) - a(i, j)))
         end do
      end do
      change = 0.5_wp*change
      a = 0.5_wp*(a + w)
      d = 0.5_wp*(d - t)
      e = 0.5_wp*(e - inverse - s)
   end subroutine double_angles

   !> Inverses of symmetric matrices.
   pure subroutine invert(a, inverse)
      real(wp), intent(in) :: a(lanes, 6)
      real(wp), intent(out) :: inverse(lanes, 6)
      real(wp) :: scale(lanes)
      integer :: k

      inverse(:, 1) = a(:, 2)*a(:, 3) - a(:, 4)*a(:, 4)
      inverse(:, 2) = a(:, 1)*a(:, 3) - a(:, 5)*a(:, 5)
      inverse(:, 3) = a(:, 1)*a(:, 2) - a(:, 6)*a(:, 6)
      inverse(:, 4) = a(:, 6)*a(:, 5) - a(:, 1)*a(:, 4)
      inverse(:, 5) = a(:, 6)*a(:, 4) - a(:, 2)*a(:, 5)
      inverse(:, 6) = a(:, 4)*a(:, 5) - a(:, 6)*a(:, 3)
      scale = 1.0_wp/(a(:, 1)*inverse(:, 1) + a(:, 6)*inverse(:, 6) + a(:, 5)*inverse(:, 5))
      do k = 1, 6
         inverse(:, k) = inverse(:, k)*scale
      end do
   end subroutine invert

   !> S A of symmetric matrices and others.
   pure subroutine multiply(s, a, product)
      real(wp), intent(in) :: s(lanes, 6), a(lanes, 9)
      real(wp), intent(out) :: product(lanes, 9)
      integer :: j

      do j = 0, 6, 3
         product(:, j + 1) = s(:, 1)*a(:, j + 1) + s(:, 6)*a(:, j + 2) + s(:, 5)*a(:, j + 3)
         product(:, j + 2) = s(:, 6)*a(:, j + 1) + s(:, 2)*a(:, j + 2) + s(:, 4)*a(:, j + 3)
         product(:, j + 3) = s(:, 5)*a(:, j + 1) + s(:, 4)*a(:, j + 2) + s(:, 3)*a(:, j + 3)
      end do
   end subroutine multiply

   !> A^T B, where that is symmetric.
   pure subroutine multiply_transposed(a, b, product)
      real(wp), intent(in) :: a(lanes, 9), b(lanes, 9)
      real(wp), intent(out) :: product(lanes, 6)
      !> Where the two columns of a component begin.
      integer, parameter :: first(6) = [0, 3, 6, 3, 0, 0], second(6) = [0, 3, 6, 6, 6, 3]
      integer :: k

      do k = 1, 6
         product(:, k) = a(:, first(k) + 1)*b(:, second(k) + 1) + a(:, first(k) + 2)*b(:, second(k) + 2) &
            & + a(:, first(k) + 3)*b(:, second(k) + 3)
      end do
   end subroutine multiply_transposed
end module barnett_lothe
