!> Polynomials of the coordinates of a stiffness about the indenter's axis that do not change when
!> the crystal is turned about that axis or mirrored. The modulus on a specimen with axial symmetry
!> depends on the crystal through these.
!>
!> Each is the real part of a product of order 0: of numbers of order 0, and of pairs and conjugate
!> pairs whose orders cancel. There are 1, 5, 29, 141 of them up to degree 0, 1, 2, 3, and 1, 6, 35,
!> 176 where the scale of the stiffness is one of the numbers. Each has a weight such that, for two
!> points x and x', the sum of the products of those of degree d is the mean of (x x')^d over all
!> turns and mirrors of one point. So equal coefficients prefer no basis of the coordinates.
module axial_polynomials
   use kinds, only: wp
   use logarithmic_coordinates, only: n_axial, n_coordinates, n_pairs, pair_orders
   use statistics, only: sort_order
   implicit none
   private
   public :: axial_polynomials_type, new_axial_polynomials, evaluate_polynomials, greatest_degree

   integer, parameter :: greatest_degree = 4
   !> Factors, numbered as the coordinates: numbers of order 0, pairs, conjugate pairs in place of
   !> the imaginary parts, the scale.
   integer, parameter :: orders(n_coordinates) = [[0, 0, 0, 0], pair_orders, -pair_orders, 0]

   type :: axial_polynomials_type
      integer :: n = 0
      !> Number of coordinates that they depend on: all, or all but the last, which is the scale.
      integer :: n_coordinates = 0
      !> Degree of each, (n), ascending.
      integer, allocatable :: degrees(:)
      !> The factors of each, 0 for the number 1, (greatest_degree, n).
      integer, allocatable, private :: factors(:, :)
      !> Value from which the scale is counted.
      real(wp) :: centre = 0.0_wp
      !> Weight of each product, (n).
      real(wp), allocatable, private :: weights(:)
   end type axial_polynomials_type

contains

   !> All polynomials up to a degree.
   pure type(axial_polynomials_type) function new_axial_polynomials(degree, centre) result(self)
      !> 0 to `greatest_degree`.
      integer, intent(in) :: degree
      !> Value from which the last coordinate, the scale, is counted. Without it they do not depend
      !> on the scale.
      real(wp), intent(in), optional :: centre
      integer :: chosen(greatest_degree), d, k

      self%n_coordinates = n_coordinates - 1
      if (present(centre)) then
         self%n_coordinates = n_coordinates
         self%centre = centre
      end if
      allocate (self%degrees(1), self%factors(greatest_degree, 1), source=0)
      self%weights = [1.0_wp]
      do d = 1, degree
         ! Every product of d factors in ascending order.
         chosen = 0
         chosen(:d) = 1
         do
            if (sum(orders(chosen(:d))) == 0) call append_if_first(chosen, d)
            k = d
            do while (k > 0)
               if (chosen(k) < self%n_coordinates) exit
               k = k - 1
            end do
            if (k == 0) exit
            chosen(k:d) = chosen(k) + 1
         end do
      end do
      self%n = size(self%degrees)

   contains

      !> Append a product unless its conjugate precedes it: both have the same real part.
      pure subroutine append_if_first(product, d)
         integer, intent(in) :: product(greatest_degree), d
         integer :: conjugate(d), order(d), i, k
         real(wp) :: square

         conjugate = product(:d)
         where (is_pair(conjugate)) conjugate = conjugate + merge(n_pairs, -n_pairs, &
            & conjugate <= n_axial + n_pairs)
         call sort_order(real(conjugate, wp), order)
         conjugate = conjugate(order)
         i = findloc(conjugate /= product(:d), .true., 1)
         if (i > 0) then
            if (conjugate(i) < product(i)) return
         end if
         ! The square of the weight is d!/(n1! n2! ..) of the powers of the factors; half of that
         ! for each pair; twice if the product is not its own conjugate.
         square = 1.0_wp
         do k = 1, d
            square = square*k/count(product(:k) == product(k))
            if (is_pair(product(k))) square = 0.5_wp*square
         end do
         if (i > 0) square = 2.0_wp*square
         self%weights = [self%weights, sqrt(square)]
         self%degrees = [self%degrees, d]
         self%factors = reshape([self%factors, product], [greatest_degree, size(self%degrees)])
      end subroutine append_if_first
   end function new_axial_polynomials

   !> Whether a factor is a pair or a conjugate pair.
   pure elemental logical function is_pair(factor)
      integer, intent(in) :: factor

      is_pair = orders(factor) /= 0
   end function is_pair

   !> All polynomials at points. A loop over the points is innermost.
   pure subroutine evaluate_polynomials(self, x, values)
      type(axial_polynomials_type), intent(in) :: self
      !> Coordinates about the axis of each point, (point, self%n_coordinates).
      real(wp), intent(in), contiguous :: x(:, :)
      !> (point, n).
      real(wp), intent(out), contiguous :: values(:, :)
      complex(wp) :: factors(size(x, 1), n_coordinates), product(size(x, 1), 0:greatest_degree)
      integer, parameter :: last_pair = n_axial + n_pairs
      integer :: chosen(greatest_degree), i, k

      factors(:, :n_axial) = x(:, :n_axial)
      factors(:, n_axial + 1:last_pair) = cmplx(x(:, n_axial + 1:last_pair), &
         & x(:, last_pair + 1:last_pair + n_pairs), wp)
      factors(:, last_pair + 1:last_pair + n_pairs) = conjg(factors(:, n_axial + 1:last_pair))
      if (self%n_coordinates == n_coordinates) then
         factors(:, n_coordinates) = x(:, n_coordinates) - self%centre
      end if
      product(:, 0) = 1.0_wp
      chosen = 0
      do k = 1, self%n
         ! The first factors are often those of the polynomial before, whose partial products are
         ! then used again.
         do i = max(1, findloc(self%factors(:, k) /= chosen, .true., 1)), self%degrees(k)
            product(:, i) = product(:, i - 1)*factors(:, self%factors(i, k))
         end do
         chosen = self%factors(:, k)
         values(:, k) = self%weights(k)*real(product(:, self%degrees(k)), wp)
      end do
   end subroutine evaluate_polynomials
end module axial_polynomials
