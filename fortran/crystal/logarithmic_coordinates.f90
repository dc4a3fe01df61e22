!> Unbounded coordinates of the stable crystals of a class: the logarithm of the Kelvin stiffness.
!>
!> The Kelvin stiffnesses K of a class form a linear space that is closed under symmetric products,
!> so log K lies in it, too. Its orthonormal basis begins with the dilatation and the shear of an
!> isotropic solid. The coordinates after these two are the anisotropy, and their norm is the
!> log-anisotropy. The volume element follows from the derivative of the matrix exponential (divided
!> differences in the frame of the eigenvectors, Higham, Functions of Matrices, SIAM 2008, theorem
!> 3.11).
!>
!> The second part of the module has coordinates of a symmetric 6 x 6 matrix (Kelvin form) that show
!> how it changes under rotation about the z axis.
!>
!> Strains of order 0, 1, 2 about the axis are p = zz and q = (xx + yy)/sqrt 2; w1 = (xz + i
!> yz)/sqrt 2; w2 = ((xx - yy)/sqrt 2 + i xy)/sqrt 2. A rotation multiplies the component of the
!> matrix between two of them by a phase, m times the angle, with m the sum of their orders. There
!> are five real components of order 0, one of them the trace, which is the last coordinate, and
!> eight complex ones of order 1 to 4. A mirror plane through the axis and x conjugates the complex
!> ones. The basis is orthonormal: the sum of the squares of the coordinates is that of the entries
!> of the matrix.
module logarithmic_coordinates
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: bond_matrix, diagonalise, kelvin_form, stiffness_of_kelvin
   use kinds, only: wp
   implicit none
   private
   public :: log_coordinates_type, new_log_coordinates, logarithm_of, n_axial, n_pairs, &
      & pair_orders, n_coordinates, axial_coordinates_of, kelvin_rotation

   type :: log_coordinates_type
      !> Number of coordinates, which is that of the constants.
      integer :: n = 0
      !> Orthonormal symmetric matrices (6, 6, n).
      real(wp), allocatable :: basis(:, :, :)
      !> The class, whose constants are coordinates in another, sparse basis of the same space.
      type(crystal_class_type), private :: class
   contains
      procedure :: to_logarithms, from_logarithms, log_volume
   end type log_coordinates_type

   integer, parameter :: n_axial = 4, n_pairs = 8
   integer, parameter :: pair_orders(n_pairs) = [1, 1, 1, 2, 2, 2, 3, 4]
   !> Number of coordinates: those of order 0, the real parts of the pairs, their imaginary parts,
   !> and the trace over sqrt 6.
   integer, parameter :: n_coordinates = n_axial + 2*n_pairs + 1

   real(wp), parameter :: root_2 = sqrt(2.0_wp), root_half = sqrt(0.5_wp)
   !> The directions, orthogonal to the trace, in the space of pp, qq, sqrt 2 pq, sqrt 2 w1*w1, sqrt
   !> 2 w2*w2: dilatation against shear, the two shears against each other, and two more.
   real(wp), parameter :: dilatation(5) = &
      & [1.0_wp, 3.0_wp, 4.0_wp, -root_2, -root_2]/sqrt(30.0_wp)
   real(wp), parameter :: shears(5) = [0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, -1.0_wp]/root_2
   real(wp), parameter :: others(5, 2) = reshape([ &
      & [2.0_wp, -1.0_wp, 0.0_wp, -0.25_wp*root_2, -0.25_wp*root_2]/sqrt(5.25_wp), &
      & [1.0_wp, 3.0_wp, -3.5_wp, -root_2, -root_2]/sqrt(26.25_wp)], [5, 2])
   real(wp), parameter :: directions(5, n_axial) = &
      & reshape([dilatation, shears, others], [5, n_axial])

contains

   !> The coordinates of a class.
   pure type(log_coordinates_type) function new_log_coordinates(class) result(self)
      type(crystal_class_type), intent(in) :: class
      !> A unit matrix whose remainder is below this norm lies in the span of the others.
      real(wp), parameter :: spanned = 1.0e-8_wp
      real(wp) :: matrix(6, 6), unit(class%n_constants)
      integer :: i, k

      self%class = class
      allocate (self%basis(6, 6, class%n_constants))
      matrix = 0.0_wp
      matrix(:3, :3) = 1.0_wp/3.0_wp
      call append(matrix)
      matrix = -matrix
      do i = 1, 6
         matrix(i, i) = matrix(i, i) + 1.0_wp
      end do
      call append(matrix)
      do k = 1, class%n_constants
         unit = 0.0_wp
         unit(k) = 1.0_wp
         call append(kelvin_form(class%stiffness(unit)))
      end do

   contains

      pure subroutine append(matrix)
         real(wp), intent(in) :: matrix(6, 6)
         real(wp) :: rest(6, 6)
         integer :: j, pass

         if (self%n == class%n_constants) return
         rest = matrix/norm2(matrix)
         do pass = 1, 2
            do j = 1, self%n
               rest = rest - sum(rest*self%basis(:, :, j))*self%basis(:, :, j)
            end do
         end do
         if (norm2(rest) < spanned) return
         self%n = self%n + 1
         self%basis(:, :, self%n) = rest/norm2(rest)
      end subroutine append
   end function new_log_coordinates

   !> Coordinates of a stable crystal.
   pure function to_logarithms(self, c) result(w)
      class(log_coordinates_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: w(self%n)

      w = matmul(reshape(logarithm_of(c), [36]), reshape(self%basis, [36, self%n]))
   end function to_logarithms

   !> log K of a stable crystal.
   pure function logarithm_of(c) result(logarithm)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: logarithm(6, 6), values(6), vectors(6, 6)

      call diagonalise(kelvin_form(c), values, vectors)
      logarithm = composed(log(values), vectors)
   end function logarithm_of

   !> The symmetric matrix with these eigenvalues and eigenvectors.
   pure function composed(values, vectors) result(matrix)
      real(wp), intent(in) :: values(6), vectors(6, 6)
      real(wp) :: matrix(6, 6)

      matrix = matmul(spread(values, 1, 6)*vectors, transpose(vectors))
   end function composed

   !> Stiffness in crystal axes, GPa, of the crystal at coordinates w.
   pure function from_logarithms(self, w) result(c)
      class(log_coordinates_type), intent(in) :: self
      !> (n).
      real(wp), intent(in) :: w(:)
      real(wp) :: c(6, 6), values(6), vectors(6, 6)

      call diagonalise(logarithm_at(self, w), values, vectors)
      c = stiffness_of_kelvin(composed(exp(values), vectors))
   end function from_logarithms

   !> log K at coordinates w.
   pure function logarithm_at(self, w) result(logarithm)
      type(log_coordinates_type), intent(in) :: self
      !> (n).
      real(wp), intent(in) :: w(:)
      real(wp) :: logarithm(6, 6)
      integer :: k

      logarithm = 0.0_wp
      do k = 1, self%n
         logarithm = logarithm + w(k)*self%basis(:, :, k)
      end do
   end function logarithm_at

   !> log |dc/dw| at coordinates w, up to a constant of the class.
   pure real(wp) function log_volume(self, w)
      class(log_coordinates_type), intent(in) :: self
      !> (n).
      real(wp), intent(in) :: w(:)
      real(wp), parameter :: kelvin(6) = [1.0_wp, 1.0_wp, 1.0_wp, root_2, root_2, root_2]
      real(wp) :: parts(21, self%n), gram(self%n, self%n), pairs(21), weights(21), values(6), &
         & vectors(6, 6), half, quotient
      integer :: i, j, k

      call diagonalise(logarithm_at(self, w), values, vectors)
      associate (row => self%class%row, column => self%class%column, &
         & constant => self%class%constant)
         k = 0
         do j = 1, 6
            do i = 1, j
               half = 0.5_wp*(values(i) - values(j))
               quotient = 1.0_wp + half**2/6.0_wp
               if (abs(half) > 1.0e-3_wp) quotient = sinh(half)/half
               k = k + 1
               weights(k) = sqrt(merge(1.0_wp, 2.0_wp, i == j) &
                                & *exp(0.5_wp*(values(i) + values(j)))*quotient)
            end do
         end do
         parts = 0.0_wp
         do k = 1, size(row)
            i = 0
            do j = 1, 6
               associate (p => vectors(column(k), :), q => vectors(row(k), :))
                  pairs(i + 1:i + j) = p(:j)*q(j)
                  if (row(k) /= column(k)) pairs(i + 1:i + j) = pairs(i + 1:i + j) + q(:j)*p(j)
               end associate
               i = i + j
            end do
            parts(:, constant(k)) = parts(:, constant(k)) &
               & + self%class%factor(k)*kelvin(row(k))*kelvin(column(k))*pairs*weights
         end do
         gram = matmul(transpose(parts), parts)
         log_volume = 0.0_wp
         ! The determinant, by elimination in place.
         do j = 1, self%n
            log_volume = log_volume + log(gram(j, j))
            do k = j + 1, self%n
               gram(k:, k) = gram(k:, k) - (gram(k, j)/gram(j, j))*gram(k:, j)
            end do
         end do
      end associate
   end function log_volume

   !> The axial coordinates of a symmetric matrix.
   pure function axial_coordinates_of(matrix) result(x)
      !> Rows and columns in Voigt's order, (6, 6).
      real(wp), intent(in) :: matrix(6, 6)
      real(wp) :: x(n_coordinates)
      !> Components xx, yy, zz, yz, xz, xy of p, q, w1, w2.
      complex(wp), parameter :: o = (0.0_wp, 0.0_wp), h = (root_half, 0.0_wp), &
         & ih = (0.0_wp, root_half)
      complex(wp), parameter :: p(6) = [o, o, (1.0_wp, 0.0_wp), o, o, o], &
         & q(6) = [h, h, o, o, o, o], w1(6) = [o, o, o, ih, h, o], &
         & w2(6) = [(0.5_wp, 0.0_wp), (-0.5_wp, 0.0_wp), o, o, o, ih]
      complex(wp) :: pairs(n_pairs)
      real(wp) :: order_0(5)
      integer :: i

      order_0 = [between(p, p), between(q, q), root_2*between(p, q), &
         & root_2*between(conjg(w1), w1), root_2*between(conjg(w2), w2)]
      pairs(:3) = 2.0_wp*[between(p, w1), between(q, w1), between(conjg(w1), w2)]
      pairs(4:6) = [2.0_wp*between(p, w2), 2.0_wp*between(q, w2), root_2*between(w1, w1)]
      pairs(7:) = [2.0_wp*between(w1, w2), root_2*between(w2, w2)]
      x = [matmul(order_0, directions), real(pairs, wp), aimag(pairs), &
         & sum([(matrix(i, i), i=1, 6)])/sqrt(6.0_wp)]

   contains

      pure complex(wp) function between(a, b)
         complex(wp), intent(in) :: a(6), b(6)

         between = sum(a*matmul(matrix, b))
      end function between
   end function axial_coordinates_of

   !> The orthogonal matrix Q that rotates the Kelvin form of a strain, and a stiffness K to Q K Qᵀ.
   pure function kelvin_rotation(r) result(q)
      !> A rotation of vectors.
      real(wp), intent(in) :: r(3, 3)
      real(wp) :: q(6, 6)

      q = bond_matrix(r)
      q(4:, :) = root_2*q(4:, :)
      q(:, 4:) = root_half*q(:, 4:)
   end function kelvin_rotation

end module logarithmic_coordinates
