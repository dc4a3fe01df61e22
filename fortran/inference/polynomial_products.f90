!> Products of orthonormal Legendre polynomials, fast: the terms of a surrogate at one crystal, and the covariance of its
!> harmonics as a polynomial of the constants.
!>
!> The covariance of y between grains i and j is K_iᵀ T(c) K_j with T_hh' = sum over q, q' of S_(h,q)(h',q') P_q P_q'. A product of
!> two Legendre polynomials is a sum of them (Adams, Proc. R. Soc. 27, 63, 1878), so T is a polynomial of twice the degree whose
!> coefficients are found once; evaluating it costs some thousand operations where the double sum costs hundreds of thousands.
module polynomial_products
   use kinds, only: wp
   use surrogate_basis, only: basis_type
   implicit none
   private
   public :: products_type, new_products, evaluate_products, covariance_polynomial

   type :: products_type
      integer :: n_coordinates = 0, degree = 0, n_products = 0
      !> Degree of each product in each coordinate.
      integer, allocatable :: degrees(:, :)
      !> Product q is product parent(q) times the polynomial of degree factor_degree(q) in coordinate factor(q).
      integer, allocatable, private :: parent(:), factor(:), factor_degree(:)
      !> p_(n+1) = a_n x p_n - b_n p_(n-1) for p_n = sqrt(2n+1) P_n.
      real(wp), allocatable, private :: a(:), b(:)
   end type products_type

contains

   !> The products with these degrees, degrees(coordinate, product); a product must follow those it contains.
   pure function new_products(degrees) result(self)
      integer, intent(in) :: degrees(:, :)
      type(products_type) :: self
      integer, allocatable :: number(:)
      integer :: part(size(degrees, 1)), q, i, n

      self%n_coordinates = size(degrees, 1)
      self%n_products = size(degrees, 2)
      self%degrees = degrees
      self%degree = maxval(degrees)
      allocate (self%parent(self%n_products), self%factor(self%n_products), self%factor_degree(self%n_products))
      call number_products(degrees, self%degree, number)
      self%parent = 0
      self%factor = 1
      self%factor_degree = 0
      do q = 1, self%n_products
         part = degrees(:, q)
         do i = self%n_coordinates, 1, -1
            if (part(i) > 0) exit
         end do
         if (i == 0) cycle
         self%factor(q) = i
         self%factor_degree(q) = part(i)
         part(i) = 0
         self%parent(q) = number(code(part, self%degree))
      end do
      allocate (self%a(0:self%degree), self%b(0:self%degree))
      do n = 0, self%degree
         self%a(n) = sqrt((2.0_wp*n + 3.0_wp)*(2.0_wp*n + 1.0_wp))/(n + 1)
         self%b(n) = 0.0_wp
         if (n > 0) self%b(n) = n*sqrt((2.0_wp*n + 3.0_wp)/(2.0_wp*n - 1.0_wp))/(n + 1)
      end do
   end function new_products

   !> Which product has which degrees: number(code(degrees)), 0 where there is none.
   pure subroutine number_products(degrees, highest, number)
      integer, intent(in) :: degrees(:, :), highest
      integer, allocatable, intent(out) :: number(:)
      integer :: q

      allocate (number(0:(highest + 1)**size(degrees, 1) - 1))
      number = 0
      do q = 1, size(degrees, 2)
         number(code(degrees(:, q), highest)) = q
      end do
   end subroutine number_products

   pure integer function code(degrees, highest)
      integer, intent(in) :: degrees(:), highest
      integer :: i

      code = 0
      do i = 1, size(degrees)
         code = code*(highest + 1) + degrees(i)
      end do
   end function code

   !> All products at coordinates x in [-1, 1].
   pure subroutine evaluate_products(self, x, p)
      type(products_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out), contiguous :: p(:)
      real(wp) :: factors(0:self%degree, self%n_coordinates)
      integer :: i, n, q

      do i = 1, self%n_coordinates
         factors(0, i) = 1.0_wp
         if (self%degree > 0) factors(1, i) = self%a(0)*x(i)
         do n = 1, self%degree - 1
            factors(n + 1, i) = self%a(n)*x(i)*factors(n, i) - self%b(n)*factors(n - 1, i)
         end do
      end do
      p(1) = 1.0_wp
      do q = 2, self%n_products
         p(q) = p(self%parent(q))*factors(self%factor_degree(q), self%factor(q))
      end do
   end subroutine evaluate_products

   !> T(c) of a basis with coefficient covariance S: the products it is made of, and the coefficients of T_hh', h >= h', one
   !> column a pair in the order (1,1), (2,1), .. (n,1), (2,2), ..
   subroutine covariance_polynomial(basis, covariance, products, coefficients)
      type(basis_type), intent(in) :: basis
      real(wp), intent(in) :: covariance(:, :)
      type(products_type), intent(out) :: products
      real(wp), allocatable, intent(out) :: coefficients(:, :)
      real(wp), allocatable :: table(:, :, :), sums(:, :), pair(:)
      integer, allocatable :: degrees(:, :), number(:)
      integer :: d, n, q, r, i, h, g, column, low(basis%n_coordinates), high(basis%n_coordinates), c(basis%n_coordinates)
      real(wp) :: weight

      d = basis%degree
      n = basis%n_harmonics
      allocate (table(0:d, 0:d, 0:2*d))
      call linearisation_table(d, table)
      call list_degrees(basis, degrees)
      products = new_products(degrees)
      call number_products(degrees, products%degree, number)
      allocate (sums(n*(n + 1)/2, size(degrees, 2)), pair(n*(n + 1)/2))
      sums = 0.0_wp
      do q = 1, basis%n_polynomials
         do r = 1, q
            column = 0
            do g = 1, n
               do h = g, n
                  column = column + 1
                  pair(column) = covariance(h + (q - 1)*n, g + (r - 1)*n)
                  if (r /= q) pair(column) = pair(column) + covariance(h + (r - 1)*n, g + (q - 1)*n)
               end do
            end do
            low = abs(basis%degrees(:, q) - basis%degrees(:, r))
            high = basis%degrees(:, q) + basis%degrees(:, r)
            c = low
            do
               weight = 1.0_wp
               do i = 1, size(c)
                  weight = weight*table(basis%degrees(i, q), basis%degrees(i, r), c(i))
               end do
               i = number(code(c, products%degree))
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
   end subroutine covariance_polynomial

   !> The degrees of all products of two terms of the basis.
   subroutine list_degrees(basis, degrees)
      type(basis_type), intent(in) :: basis
      integer, allocatable, intent(out) :: degrees(:, :)
      logical, allocatable :: met(:)
      integer :: highest, n, q, r, i, k, total, c(basis%n_coordinates)

      n = basis%n_coordinates
      highest = 2*basis%degree
      allocate (met(0:(highest + 1)**n - 1))
      met = .false.
      do q = 1, basis%n_polynomials
         do r = 1, q
            met(code(basis%degrees(:, q) + basis%degrees(:, r), highest)) = .true.
         end do
      end do
      ! Sums of degrees include every smaller combination, so each product finds its parent; fewer degrees come first.
      allocate (degrees(n, count(met)))
      k = 0
      do total = 0, n*highest
         do q = 0, size(met) - 1
            if (.not. met(q)) cycle
            r = q
            do i = n, 1, -1
               c(i) = mod(r, highest + 1)
               r = r/(highest + 1)
            end do
            if (sum(c) /= total) cycle
            k = k + 1
            degrees(:, k) = c
         end do
         if (k == size(degrees, 2)) exit
      end do
   end subroutine list_degrees

   !> p_a p_b = sum of table(a, b, c) p_c over c.
   pure subroutine linearisation_table(d, table)
      integer, intent(in) :: d
      real(wp), intent(out) :: table(0:, 0:, 0:)
      real(wp) :: half(0:2*d)
      integer :: a, b, r, c

      ! (2r-1)!!/r!
      half(0) = 1.0_wp
      do r = 1, 2*d
         half(r) = half(r - 1)*(2*r - 1)/r
      end do
      table = 0.0_wp
      do b = 0, d
         do a = 0, d
            do r = 0, min(a, b)
               c = a + b - 2*r
               table(a, b, c) = half(r)*half(a - r)*half(b - r)/half(a + b - r)*(2*c + 1)/real(2*a + 2*b - 2*r + 1, wp) &
                               & *sqrt((2*a + 1)*(2*b + 1)/real(2*c + 1, wp))
            end do
         end do
      end do
   end subroutine linearisation_table
end module polynomial_products
