!> Coordinates of a symmetric 6 x 6 matrix (Kelvin form) about the z axis: how it changes when it is turned about that axis.
!>
!> Strains of order 0, 1, 2 about the axis: p = zz, q = (xx + yy)/sqrt 2; w1 = (xz + i yz)/sqrt 2; w2 = ((xx - yy)/sqrt 2 + i xy)/sqrt 2.
!> The components of the matrix between them turn by m times the angle, m the sum of their orders: five real numbers of order 0, one of
!> them the trace, which comes last here, and eight complex ones of order 1 to 4. A mirror that holds the axis and x conjugates the
!> latter. All are coordinates in an orthonormal basis: the sum of their squares is that of the matrix' entries.
module axial_coordinates
   use crystal_elasticity, only: bond_matrix
   use kinds, only: wp
   implicit none
   private
   public :: n_axial, n_waves, wave_orders, n_coordinates, axial_coordinates_of, kelvin_rotation

   integer, parameter :: n_axial = 4, n_waves = 8
   integer, parameter :: wave_orders(n_waves) = [1, 1, 1, 2, 2, 2, 3, 4]
   !> Order 0, then the real parts of the waves, then their imaginary parts, then the trace over sqrt 6.
   integer, parameter :: n_coordinates = n_axial + 2*n_waves + 1

   real(wp), parameter :: root_2 = sqrt(2.0_wp), root_half = sqrt(0.5_wp)
   !> The numbers pp, qq, sqrt 2 pq, sqrt 2 w1*w1, sqrt 2 w2*w2 in four directions orthogonal to the trace: dilatation against shear, the
   !> two shears against each other, and what is left.
   real(wp), parameter :: directions(5, n_axial) = reshape([ &
      & [1.0_wp, 3.0_wp, 4.0_wp, -root_2, -root_2]/sqrt(30.0_wp), &
      & [0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, -1.0_wp]/root_2, &
      & [2.0_wp, -1.0_wp, 0.0_wp, -0.25_wp*root_2, -0.25_wp*root_2]/sqrt(5.25_wp), &
      & [1.0_wp, 3.0_wp, -3.5_wp, -root_2, -root_2]/sqrt(26.25_wp)], [5, n_axial])

contains

   !> The coordinates of a symmetric matrix.
   pure function axial_coordinates_of(matrix) result(x)
      !> Rows and columns in Voigt's order, (6, 6).
      real(wp), intent(in) :: matrix(6, 6)
      real(wp) :: x(n_coordinates)
      !> xx, yy, zz, yz, xz, xy of p, q, w1, w2.
      complex(wp), parameter :: o = (0.0_wp, 0.0_wp), h = (root_half, 0.0_wp), ih = (0.0_wp, root_half)
      complex(wp), parameter :: p(6) = [o, o, (1.0_wp, 0.0_wp), o, o, o], q(6) = [h, h, o, o, o, o], &
         & w1(6) = [o, o, o, ih, h, o], w2(6) = [(0.5_wp, 0.0_wp), (-0.5_wp, 0.0_wp), o, o, o, ih]
      complex(wp) :: waves(n_waves)
      real(wp) :: order_0(5), trace
      integer :: i

      order_0 = [between(p, p), between(q, q), root_2*between(p, q), root_2*between(conjg(w1), w1), root_2*between(conjg(w2), w2)]
      waves = [2.0_wp*between(p, w1), 2.0_wp*between(q, w1), 2.0_wp*between(conjg(w1), w2), &
         & 2.0_wp*between(p, w2), 2.0_wp*between(q, w2), root_2*between(w1, w1), 2.0_wp*between(w1, w2), root_2*between(w2, w2)]
      trace = sum([(matrix(i, i), i=1, 6)])
      x = [matmul(order_0, directions), real(waves, wp), aimag(waves), trace/sqrt(6.0_wp)]

   contains

      pure complex(wp) function between(a, b)
         complex(wp), intent(in) :: a(6), b(6)

         between = sum(a*matmul(matrix, b))
      end function between
   end function axial_coordinates_of

   !> The orthogonal matrix that turns the Kelvin form of a strain, and a stiffness K to Q K Qᵀ.
   pure function kelvin_rotation(r) result(q)
      !> A rotation of vectors.
      real(wp), intent(in) :: r(3, 3)
      real(wp) :: q(6, 6)

      q = bond_matrix(r)
      q(4:, :) = root_2*q(4:, :)
      q(:, 4:) = root_half*q(:, 4:)
   end function kelvin_rotation
end module axial_coordinates
