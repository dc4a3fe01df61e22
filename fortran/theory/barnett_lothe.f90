!> The Barnett-Lothe tensor L of several directions of a crystal at once, inverted.
!>
!> B of the half-space theory is L/(4 pi), and -L is the lower left block of the mean, over the turn of m and n about t, of Stroh's
!> matrix N = [A, D; E, A^T], A = -(nn)^-1 (nm), D = (nn)^-1, E = (mn)(nn)^-1 (nm) - (mm) (Barnett & Lothe, Phys. Norvegica 7, 13,
!> 1973). A turn by phi maps N as it maps the cotangent of an angle: N(phi) = (N cos phi - sin phi)(cos phi + N sin phi)^-1. So
!> the trapezoid rule F over n equally spaced angles of half a turn obeys F_2n = (F_n - F_n^-1)/2, the rule of cot 2 x: one inverse of a
!> 6 x 6 matrix doubles the angles, where the sum would need n inverses of (nn). F_n^-1 has the blocks of N too; D is positive and E
!> negative definite in both, being means of (nn)^-1, so that the 3 x 3 inverses below need no pivots.
module barnett_lothe
   use kinds, only: pi, wp
   implicit none
   private
   public :: lanes, tolerance, inverse_barnett

   !> Directions that one call takes: they fill the vector units.
   integer, parameter :: lanes = 8
   !> Relative change on doubling the angles below which the finer grid is accepted. The rule converges exponentially on these
   !> periodic integrands, so that the error left is about the square of the change.
   real(wp), parameter :: tolerance = 2.0e-5_wp
   !> Doublings before the first result, and the most.
   integer, parameter :: first_doublings = 3, most_doublings = 14

contains

   !> B^-1/(8 pi^2) = L^-1/(2 pi), 1/GPa: components 11, 22, 33, 23, 13, 12.
   pure subroutine inverse_barnett(mm, mn, nn, f)
      !> The contractions (ab)_ij = a_k C_kijl b_l with two directions perpendicular to t and to each other, GPa: those six components of
      !> (mm) and (nn), and (mn) by columns.
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      !> Those of B^-1/(8 pi^2) in the axes of the contractions.
      real(wp), intent(out) :: f(lanes, 6)
      real(wp) :: a(lanes, 9), d(lanes, 6), e(lanes, 6), before(lanes, 3), change
      integer :: k

      call stroh_matrix(mm, mn, nn, a, d, e)
      do k = 1, first_doublings
         call double_angles(a, d, e, change)
      end do
      call invert_tensor(e, f)
      do k = first_doublings + 1, most_doublings
         before = f(:, 1:3)
         call double_angles(a, d, e, change)
         call invert_tensor(e, f)
         if (change <= tolerance .and. all(abs(f(:, 1:3) - before) <= tolerance*f(:, 1:3))) exit
      end do
   end subroutine inverse_barnett

   !> The blocks of Stroh's matrix: A by columns, D and E by components.
   pure subroutine stroh_matrix(mm, mn, nn, a, d, e)
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      real(wp), intent(out) :: a(lanes, 9), d(lanes, 6), e(lanes, 6)
      real(wp) :: i11, i22, i33, i23, i13, i12, determinant
      real(wp) :: k11, k21, k31, k12, k22, k32, k13, k23, k33
      integer :: i

      !$omp simd
      do i = 1, lanes
         i11 = nn(i, 2)*nn(i, 3) - nn(i, 4)*nn(i, 4)
         i22 = nn(i, 1)*nn(i, 3) - nn(i, 5)*nn(i, 5)
         i33 = nn(i, 1)*nn(i, 2) - nn(i, 6)*nn(i, 6)
         i23 = nn(i, 6)*nn(i, 5) - nn(i, 1)*nn(i, 4)
         i13 = nn(i, 6)*nn(i, 4) - nn(i, 2)*nn(i, 5)
         i12 = nn(i, 4)*nn(i, 5) - nn(i, 6)*nn(i, 3)
         determinant = 1.0_wp/(nn(i, 1)*i11 + nn(i, 6)*i12 + nn(i, 5)*i13)
         i11 = i11*determinant
         i22 = i22*determinant
         i33 = i33*determinant
         i23 = i23*determinant
         i13 = i13*determinant
         i12 = i12*determinant
         ! K = (mn)(nn)^-1.
         k11 = mn(i, 1)*i11 + mn(i, 4)*i12 + mn(i, 7)*i13
         k21 = mn(i, 2)*i11 + mn(i, 5)*i12 + mn(i, 8)*i13
         k31 = mn(i, 3)*i11 + mn(i, 6)*i12 + mn(i, 9)*i13
         k12 = mn(i, 1)*i12 + mn(i, 4)*i22 + mn(i, 7)*i23
         k22 = mn(i, 2)*i12 + mn(i, 5)*i22 + mn(i, 8)*i23
         k32 = mn(i, 3)*i12 + mn(i, 6)*i22 + mn(i, 9)*i23
         k13 = mn(i, 1)*i13 + mn(i, 4)*i23 + mn(i, 7)*i33
         k23 = mn(i, 2)*i13 + mn(i, 5)*i23 + mn(i, 8)*i33
         k33 = mn(i, 3)*i13 + mn(i, 6)*i23 + mn(i, 9)*i33
         d(i, 1) = i11
         d(i, 2) = i22
         d(i, 3) = i33
         d(i, 4) = i23
         d(i, 5) = i13
         d(i, 6) = i12
         a(i, 1) = -k11
         a(i, 2) = -k12
         a(i, 3) = -k13
         a(i, 4) = -k21
         a(i, 5) = -k22
         a(i, 6) = -k23
         a(i, 7) = -k31
         a(i, 8) = -k32
         a(i, 9) = -k33
         e(i, 1) = k11*mn(i, 1) + k12*mn(i, 4) + k13*mn(i, 7) - mm(i, 1)
         e(i, 2) = k21*mn(i, 2) + k22*mn(i, 5) + k23*mn(i, 8) - mm(i, 2)
         e(i, 3) = k31*mn(i, 3) + k32*mn(i, 6) + k33*mn(i, 9) - mm(i, 3)
         e(i, 4) = k21*mn(i, 3) + k22*mn(i, 6) + k23*mn(i, 9) - mm(i, 4)
         e(i, 5) = k11*mn(i, 3) + k12*mn(i, 6) + k13*mn(i, 9) - mm(i, 5)
         e(i, 6) = k11*mn(i, 2) + k12*mn(i, 5) + k13*mn(i, 8) - mm(i, 6)
      end do
   end subroutine stroh_matrix

   !> F of twice as many angles.
   pure subroutine double_angles(a, d, e, change)
      real(wp), intent(inout) :: a(lanes, 9), d(lanes, 6), e(lanes, 6)
      !> The largest of the elements of A, which have no unit.
      real(wp), intent(out) :: change
      real(wp) :: i11, i22, i33, i23, i13, i12, s11, s22, s33, s23, s13, s12, t11, t22, t33, t23, t13, t12, determinant
      real(wp) :: k11, k21, k31, k12, k22, k32, k13, k23, k33, w11, w21, w31, w12, w22, w32, w13, w23, w33
      integer :: i

      change = 0.0_wp
      !$omp simd reduction(max: change)
      do i = 1, lanes
         ! D^-1, and K = D^-1 A.
         i11 = d(i, 2)*d(i, 3) - d(i, 4)*d(i, 4)
         i22 = d(i, 1)*d(i, 3) - d(i, 5)*d(i, 5)
         i33 = d(i, 1)*d(i, 2) - d(i, 6)*d(i, 6)
         i23 = d(i, 6)*d(i, 5) - d(i, 1)*d(i, 4)
         i13 = d(i, 6)*d(i, 4) - d(i, 2)*d(i, 5)
         i12 = d(i, 4)*d(i, 5) - d(i, 6)*d(i, 3)
         determinant = 1.0_wp/(d(i, 1)*i11 + d(i, 6)*i12 + d(i, 5)*i13)
         i11 = i11*determinant
         i22 = i22*determinant
         i33 = i33*determinant
         i23 = i23*determinant
         i13 = i13*determinant
         i12 = i12*determinant
         k11 = i11*a(i, 1) + i12*a(i, 2) + i13*a(i, 3)
         k21 = i12*a(i, 1) + i22*a(i, 2) + i23*a(i, 3)
         k31 = i13*a(i, 1) + i23*a(i, 2) + i33*a(i, 3)
         k12 = i11*a(i, 4) + i12*a(i, 5) + i13*a(i, 6)
         k22 = i12*a(i, 4) + i22*a(i, 5) + i23*a(i, 6)
         k32 = i13*a(i, 4) + i23*a(i, 5) + i33*a(i, 6)
         k13 = i11*a(i, 7) + i12*a(i, 8) + i13*a(i, 9)
         k23 = i12*a(i, 7) + i22*a(i, 8) + i23*a(i, 9)
         k33 = i13*a(i, 7) + i23*a(i, 8) + i33*a(i, 9)
         ! S = E - A^T K, and its inverse T, the upper right block of F^-1.
         s11 = e(i, 1) - (a(i, 1)*k11 + a(i, 2)*k21 + a(i, 3)*k31)
         s22 = e(i, 2) - (a(i, 4)*k12 + a(i, 5)*k22 + a(i, 6)*k32)
         s33 = e(i, 3) - (a(i, 7)*k13 + a(i, 8)*k23 + a(i, 9)*k33)
         s23 = e(i, 4) - (a(i, 4)*k13 + a(i, 5)*k23 + a(i, 6)*k33)
         s13 = e(i, 5) - (a(i, 1)*k13 + a(i, 2)*k23 + a(i, 3)*k33)
         s12 = e(i, 6) - (a(i, 1)*k12 + a(i, 2)*k22 + a(i, 3)*k32)
         t11 = s22*s33 - s23*s23
         t22 = s11*s33 - s13*s13
         t33 = s11*s22 - s12*s12
         t23 = s12*s13 - s11*s23
         t13 = s12*s23 - s22*s13
         t12 = s23*s13 - s12*s33
         determinant = 1.0_wp/(s11*t11 + s12*t12 + s13*t13)
         t11 = t11*determinant
         t22 = t22*determinant
         t33 = t33*determinant
         t23 = t23*determinant
         t13 = t13*determinant
         t12 = t12*determinant
         ! W = K T. F^-1 = [-W^T, T; D^-1 + W K^T, -W].
         w11 = k11*t11 + k12*t12 + k13*t13
         w21 = k21*t11 + k22*t12 + k23*t13
         w31 = k31*t11 + k32*t12 + k33*t13
         w12 = k11*t12 + k12*t22 + k13*t23
         w22 = k21*t12 + k22*t22 + k23*t23
         w32 = k31*t12 + k32*t22 + k33*t23
         w13 = k11*t13 + k12*t23 + k13*t33
         w23 = k21*t13 + k22*t23 + k23*t33
         w33 = k31*t13 + k32*t23 + k33*t33
         change = max(change, abs(w11 - a(i, 1)), abs(w12 - a(i, 2)), abs(w13 - a(i, 3)), abs(w21 - a(i, 4)), &
            & abs(w22 - a(i, 5)), abs(w23 - a(i, 6)), abs(w31 - a(i, 7)), abs(w32 - a(i, 8)), abs(w33 - a(i, 9)))
         a(i, 1) = 0.5_wp*(a(i, 1) + w11)
         a(i, 2) = 0.5_wp*(a(i, 2) + w12)
         a(i, 3) = 0.5_wp*(a(i, 3) + w13)
         a(i, 4) = 0.5_wp*(a(i, 4) + w21)
         a(i, 5) = 0.5_wp*(a(i, 5) + w22)
         a(i, 6) = 0.5_wp*(a(i, 6) + w23)
         a(i, 7) = 0.5_wp*(a(i, 7) + w31)
         a(i, 8) = 0.5_wp*(a(i, 8) + w32)
         a(i, 9) = 0.5_wp*(a(i, 9) + w33)
         d(i, 1) = 0.5_wp*(d(i, 1) - t11)
         d(i, 2) = 0.5_wp*(d(i, 2) - t22)
         d(i, 3) = 0.5_wp*(d(i, 3) - t33)
         d(i, 4) = 0.5_wp*(d(i, 4) - t23)
         d(i, 5) = 0.5_wp*(d(i, 5) - t13)
         d(i, 6) = 0.5_wp*(d(i, 6) - t12)
         e(i, 1) = 0.5_wp*(e(i, 1) - i11 - (w11*k11 + w12*k12 + w13*k13))
         e(i, 2) = 0.5_wp*(e(i, 2) - i22 - (w21*k21 + w22*k22 + w23*k23))
         e(i, 3) = 0.5_wp*(e(i, 3) - i33 - (w31*k31 + w32*k32 + w33*k33))
         e(i, 4) = 0.5_wp*(e(i, 4) - i23 - (w21*k31 + w22*k32 + w23*k33))
         e(i, 5) = 0.5_wp*(e(i, 5) - i13 - (w11*k31 + w12*k32 + w13*k33))
         e(i, 6) = 0.5_wp*(e(i, 6) - i12 - (w11*k21 + w12*k22 + w13*k23))
      end do
      change = 0.5_wp*change
   end subroutine double_angles

   !> f = (-E)^-1/(2 pi).
   pure subroutine invert_tensor(e, f)
      real(wp), intent(in) :: e(lanes, 6)
      real(wp), intent(out) :: f(lanes, 6)
      real(wp) :: scale
      integer :: i

      !$omp simd private(scale)
      do i = 1, lanes
         f(i, 1) = e(i, 2)*e(i, 3) - e(i, 4)*e(i, 4)
         f(i, 2) = e(i, 1)*e(i, 3) - e(i, 5)*e(i, 5)
         f(i, 3) = e(i, 1)*e(i, 2) - e(i, 6)*e(i, 6)
         f(i, 4) = e(i, 6)*e(i, 5) - e(i, 1)*e(i, 4)
         f(i, 5) = e(i, 6)*e(i, 4) - e(i, 2)*e(i, 5)
         f(i, 6) = e(i, 4)*e(i, 5) - e(i, 6)*e(i, 3)
         scale = -1.0_wp/(2.0_wp*pi*(e(i, 1)*f(i, 1) + e(i, 6)*f(i, 6) + e(i, 5)*f(i, 5)))
         f(i, 1) = f(i, 1)*scale
         f(i, 2) = f(i, 2)*scale
         f(i, 3) = f(i, 3)*scale
         f(i, 4) = f(i, 4)*scale
         f(i, 5) = f(i, 5)*scale
         f(i, 6) = f(i, 6)*scale
      end do
   end subroutine invert_tensor
end module barnett_lothe
