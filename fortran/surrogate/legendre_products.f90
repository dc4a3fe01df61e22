!> Products of orthonormal Legendre polynomials of several coordinates, and products of two of them.
!>
!> The covariance of y between grains i and j is K_iᵀ T(c) K_j with T_hh' = sum over q, q' of
!> S_(h,q)(h',q') P_q P_q'. A product of two Legendre polynomials is a sum of them (Adams, Proc. R.
!> Soc. 27, 63, 1878). So T is a polynomial of twice the degree whose coefficients are computed
!> once. Its evaluation takes some thousand operations, the double sum hundreds of thousands.
module legendre_products
   use kinds, only: wp
   implicit none
   private
   public :: legendre_products_type, new_legendre_products, count_products, evaluate_products, &
      & covariance_polynomial

   type :: legendre_products_type
      integer :: n_coordinates = 0, n_products = 0
      !> Largest degree in one coordinate; degree of each product in each coordinate,
      !> (n_coordinates, n_products).
      integer :: degree = 0
      integer, allocatable :: degrees(:, :)
      logical, private :: total = .false.
      !> Product q > 1 is product parent(q) times the polynomial of degree factor_degree(q) in
      !> coordinate factor(q).
      integer, allocatable, private :: parent(:), factor(:), factor_degree(:)
      !> p_(n+1) = a_n x p_n - b_n p_(n-1) for p_n = sqrt(2n+1) P_n, n = 0, 1, ..
      real(wp), allocatable, private :: a(:), b(:)
   end type legendre_products_type

contains

   !> Number of products, as a real, which does not overflow.
   pure real(wp) function count_products(n, degree, total) result(count)
      !> Number of coordinates.
      integer, intent(in) :: n, degree
      !> Whether `degree` limits the sum of the degrees, or each of them.
      logical, intent(in) :: total
      integer :: i

      count = product([(merge((degree + i)/real(i, wp), degree + 1.0_wp, total), i=1, n)])
   end function count_products

   !> All products up to a degree. Those of lower total degree are first; within a total degree the
   !> last coordinate varies fastest.
   pure type(legendre_products_type) function new_legendre_products(n, degree, total) result(self)
      !> Number of coordinates.
      integer, intent(in) :: n, degree
      !> Whether `degree` limits the sum of the degrees, or each of them.
      logical, intent(in) :: total
      integer :: counter(n), largest_sum, sum_of_degrees, q, i, m

      self%n_coordinates = n
      self%degree = degree
      self%total = total
      self%n_products = nint(count_products(n, degree, total))
      allocate (self%degrees(n, self%n_products), self%parent(self%n_products), &
         & self%factor(self%n_products), self%factor_degree(self%n_products))
      q = 0
      largest_sum = n*degree
      if (total) largest_sum = degree
      do sum_of_degrees = 0, largest_sum
         call fill_last(counter, sum_of_degrees, degree)
         do
            q = q + 1
            self%degrees(:, q) = counter
            ! Go on to the next product of this sum: a later degree moves to an earlier coordinate.
            do i = n - 1, 1, -1
               if (counter(i) < degree .and. sum(counter(i + 1:)) > 0) exit
            end do
            if (i < 1) exit
            counter(i) = counter(i) + 1
            call fill_last(counter(i + 1:), sum_of_degrees - sum(counter(:i)), degree)
         end do
      end do
      do q = 2, self%n_products
         counter = self%degrees(:, q)
         i = findloc(counter > 0, .true., 1, back=.true.)
         self%factor(q) = i
         self%factor_degree(q) = counter(i)
         counter(i) = 0
         self%parent(q) = place_of(self, counter)
      end do
      self%a = [(sqrt((2.0_wp*m + 3.0_wp)*(2.0_wp*m + 1.0_wp))/(m + 1), m=0, degree)]
      self%b = [(m*sqrt((2.0_wp*m + 3.0_wp)/max(1.0_wp, 2.0_wp*m - 1.0_wp))/(m + 1), m=0, degree)]
   end function new_legendre_products

   !> Degrees of a given sum, none above `highest`, the last as large as possible.
   pure subroutine fill_last(degrees, total, highest)
      integer, intent(out) :: degrees(:)
      integer, intent(in) :: total, highest
      integer :: i, left

      left = total
      do i = size(degrees), 1, -1
         degrees(i) = min(left, highest)
         left = left - degrees(i)
      end do
   end subroutine fill_last

   !> Number of the product of these degrees.
   pure integer function place_of(self, degrees) result(middle)
      type(legendre_products_type), intent(in) :: self
      integer, intent(in) :: degrees(:)
      integer :: low, high, i
      logical :: precedes

      low = 1
      high = self%n_products
      do
         middle = (low + high)/2
         if (low >= high) return
         associate (found => self%degrees(:, middle))
            precedes = sum(found) < sum(degrees)
            i = findloc(found /= degrees, .true., 1)
            if (i > 0 .and. sum(found) == sum(degrees)) precedes = found(i) < degrees(i)
         end associate
         if (precedes) then
            low = middle + 1
         else
            high = middle
         end if
      end do
   end function place_of

   !> All products at coordinates x in [-1, 1].
   pure subroutine evaluate_products(self, x, p)
      type(legendre_products_type), intent(in) :: self
      !> (n_coordinates).
      real(wp), intent(in) :: x(:)
      !> (n_products).
      real(wp), intent(out), contiguous :: p(:)
      real(wp) :: factors(-1:self%degree, self%n_coordinates)
      integer :: i, n, q

      do i = 1, self%n_coordinates
         factors(:0, i) = [0.0_wp, 1.0_wp]
         do n = 0, self%degree - 1
            factors(n + 1, i) = self%a(n + 1)*x(i)*factors(n, i) - self%b(n + 1)*factors(n - 1, i)
         end do
      end do
      p(1) = 1.0_wp
      do q = 2, self%n_products
         p(q) = p(self%parent(q))*factors(self%factor_degree(q), self%factor(q))
      end do
   end subroutine evaluate_products

   !> Expand T(c): its products, and the coefficients of T_hh', h >= h', one column for each pair in
   !> the order (1,1), (2,1), .. (n,1), (2,2), ..
   subroutine covariance_polynomial(self, n, covariance, squares, coefficients)
      type(legendre_products_type), intent(in) :: self
      !> Number of harmonics.
      integer, intent(in) :: n
      !> Covariance of the coefficients, harmonics fastest, (n n_products, n n_products).
      real(wp), intent(in) :: covariance(:, :)
      type(legendre_products_type), intent(out) :: squares
      !> (n_products of the squares, n (n + 1)/2).
      real(wp), allocatable, intent(out) :: coefficients(:, :)
      real(wp), allocatable :: table(:, :, :), sums(:, :), pair(:)
      integer :: q, r, i, h, g, column, low(self%n_coordinates), high(self%n_coordinates), &
         & c(self%n_coordinates)
      real(wp) :: weight

      allocate (table(0:self%degree, 0:self%degree, 0:2*self%degree), source=0.0_wp)
      call linearisation_table()
      squares = new_legendre_products(self%n_coordinates, 2*self%degree, self%total)
      allocate (sums(n*(n + 1)/2, squares%n_products), pair(n*(n + 1)/2), source=0.0_wp)
      do q = 1, self%n_products
         do r = 1, q
            column = 0
            do g = 1, n
               do h = g, n
                  column = column + 1
                  pair(column) = covariance(h + (q - 1)*n, g + (r - 1)*n)
                  if (r /= q) pair(column) = pair(column) + covariance(h + (r - 1)*n, g + (q - 1)*n)
               end do
            end do
            low = abs(self%degrees(:, q) - self%degrees(:, r))
            high = self%degrees(:, q) + self%degrees(:, r)
            c = low
            do
               weight = product([(table(self%degrees(i, q), self%degrees(i, r), c(i)), &
                  & i=1, size(c))])
               i = place_of(squares, c)
               sums(:, i) = sums(:, i) + weight*pair
               do i = size(c), 1, -1
                  if (c(i) < high(i)) exit
                  c(i) = low(i)
               end do
               if (i == 0) exit
               c(i) = c(i) + 2
            end do
         end do
      end do
      coefficients = transpose(sums)

   contains

      !> p_a p_b = sum of table(a, b, c) p_c over c.
      subroutine linearisation_table()
         real(wp) :: half(0:2*self%degree)
         integer :: a, b, r, c

         ! half(r) = (2r-1)!!/r!
         half(0) = 1.0_wp
         do r = 1, 2*self%degree
            half(r) = half(r - 1)*(2*r - 1)/r
         end do
         do b = 0, self%degree
            do a = 0, self%degree
               do r = 0, min(a, b)
                  c = a + b - 2*r
                  table(a, b, c) = half(r)*half(a - r)*half(b - r)/half(a + b - r)*(2*c + 1) &
                     & /real(2*(a + b - r) + 1, wp)*sqrt((2*a + 1)*(2*b + 1)/real(2*c + 1, wp))
               end do
            end do
         end do
      end subroutine linearisation_table
   end subroutine covariance_polynomial

end module legendre_products
