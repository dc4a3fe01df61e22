!> The terms of the surrogate (paper's Eq. 1-2): symmetrised surface harmonics of the indentation direction times products of
!> Legendre polynomials of the elastic constants.
!>
!> Term k = h + (q-1) n_harmonics is K_h P_q. Both families are orthonormal for the mean: of K_h K_h' over the sphere and of
!> P_q P_q' over the cube [-1, 1]^n, so that K_1 = P_1 = 1.
!>
!> With `coordinates_box` the coordinates are the constants and the model is M = y. With `coordinates_dimensionless` they are
!> ratios of the constants and M = s exp(y), s a stiffness: the modulus is homogeneous of degree one in the constants.
module surrogate_basis
   use crystal_elasticity, only: constant_count, symmetry_cubic, symmetry_hexagonal
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: pi, wp
   use text, only: to_text
   implicit none
   private
   public :: basis_type, new_basis, harmonic_count, polynomial_count, coordinate_count
   public :: coordinates_box, coordinates_dimensionless, coordinates_from_name, coordinates_name
   public :: truncation_tensor, truncation_total, truncation_from_name, truncation_name
   public :: evaluate_harmonics, evaluate_direction, evaluate_polynomials, evaluate_terms, raw_coordinates, is_in_ranges
   public :: largest_bandlimit, largest_degree

   integer, parameter :: coordinates_box = 1, coordinates_dimensionless = 2
   integer, parameter :: truncation_tensor = 1, truncation_total = 2
   integer, parameter :: largest_bandlimit = 20, largest_degree = 12, most_coordinates = 5

   type :: basis_type
      integer :: symmetry = 0, coordinates = 0, truncation = 0
      !> Highest degree of the polynomials (per coordinate, or in all) and of the harmonics.
      integer :: degree = 0, bandlimit = 0
      integer :: n_coordinates = 0, n_harmonics = 0, n_polynomials = 0, n_terms = 0
      !> Ranges of the raw coordinates (GPa, or dimensionless) that are mapped to [-1, 1].
      real(wp), allocatable :: lower(:), upper(:)
      !> Degree of each polynomial in each coordinate, degrees(n_coordinates, n_polynomials).
      integer, allocatable :: degrees(:, :)
      !> Degree l of each harmonic.
      integer, allocatable :: harmonic_degrees(:)
      !> P_q = P_parent(q) times the Legendre polynomial of degree factor_degree(q) in coordinate factor(q).
      integer, allocatable, private :: parent(:), factor(:), factor_degree(:)
      !> Cubic harmonics as lower-triangular combinations of monomials u^powers(1,:) v^powers(2,:) of the invariants.
      integer, allocatable, private :: powers(:, :)
      real(wp), allocatable, private :: combination(:, :)
   end type basis_type

contains

   pure integer function coordinates_from_name(name) result(coordinates)
      character(len=*), intent(in) :: name

      coordinates = 0
      if (name == 'box') coordinates = coordinates_box
      if (name == 'dimensionless') coordinates = coordinates_dimensionless
   end function coordinates_from_name

   pure function coordinates_name(coordinates) result(name)
      integer, intent(in) :: coordinates
      character(len=:), allocatable :: name

      name = 'unknown'
      if (coordinates == coordinates_box) name = 'box'
      if (coordinates == coordinates_dimensionless) name = 'dimensionless'
   end function coordinates_name

   pure integer function truncation_from_name(name) result(truncation)
      character(len=*), intent(in) :: name

      truncation = 0
      if (name == 'tensor') truncation = truncation_tensor
      if (name == 'total') truncation = truncation_total
   end function truncation_from_name

   pure function truncation_name(truncation) result(name)
      integer, intent(in) :: truncation
      character(len=:), allocatable :: name

      name = 'unknown'
      if (truncation == truncation_tensor) name = 'tensor'
      if (truncation == truncation_total) name = 'total'
   end function truncation_name

   !> How many coordinates replace the constants of a symmetry.
   pure integer function coordinate_count(symmetry, coordinates) result(n)
      integer, intent(in) :: symmetry, coordinates

      n = constant_count(symmetry)
      if (coordinates == coordinates_dimensionless) n = n - 1
   end function coordinate_count

   !> Number of symmetrised harmonics up to degree `bandlimit`: all are even; cubic ones are the polynomials in the two
   !> invariants of degree 4 and 6, hexagonal ones (transverse isotropy) are zonal.
   pure integer function harmonic_count(symmetry, bandlimit) result(n)
      integer, intent(in) :: symmetry, bandlimit
      integer :: l

      n = 0
      if (symmetry == symmetry_cubic) then
         do l = 0, bandlimit, 2
            n = n + cubic_multiplicity(l)
         end do
      else
         n = bandlimit/2 + 1
      end if
   end function harmonic_count

   !> How many cubic harmonics have the even degree l: the number of a, b >= 0 with 4a + 6b = l.
   pure integer function cubic_multiplicity(l) result(n)
      integer, intent(in) :: l
      integer :: b

      n = 0
      do b = 0, l/6
         if (mod(l - 6*b, 4) == 0) n = n + 1
      end do
   end function cubic_multiplicity

   !> Number of products of Legendre polynomials in n coordinates.
   pure integer function polynomial_count(n, truncation, degree) result(count)
      integer, intent(in) :: n, truncation, degree
      integer :: i

      if (truncation == truncation_tensor) then
         count = (degree + 1)**n
      else
         count = 1
         do i = 1, n
            count = count*(degree + i)/i
         end do
      end if
   end function polynomial_count

   !> A basis; `lower` and `upper` are the ranges of its raw coordinates (see `raw_coordinates`).
   subroutine new_basis(symmetry, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
      integer, intent(in) :: symmetry, coordinates, truncation
      !> 0 to `largest_degree`; even, 0 to `largest_bandlimit`.
      integer, intent(in) :: degree, bandlimit
      real(wp), intent(in) :: lower(:), upper(:)
      type(basis_type), intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      if (symmetry /= symmetry_cubic .and. symmetry /= symmetry_hexagonal) then
         call raise(error, 'symmetry: a surrogate is for cubic or hexagonal crystals', exit_bad_input)
      else if (coordinates /= coordinates_box .and. coordinates /= coordinates_dimensionless) then
         call raise(error, 'coordinates: allowed are ''box'' and ''dimensionless''', exit_bad_input)
      else if (truncation /= truncation_tensor .and. truncation /= truncation_total) then
         call raise(error, 'truncation: allowed are ''tensor'' and ''total''', exit_bad_input)
      else if (degree < 0 .or. degree > largest_degree) then
         call raise(error, 'degree = '//to_text(degree)//' is outside 0 .. '//to_text(largest_degree), exit_bad_input)
      else if (bandlimit < 0 .or. bandlimit > largest_bandlimit .or. mod(bandlimit, 2) /= 0) then
         call raise(error, 'bandlimit = '//to_text(bandlimit)//' is not an even number in 0 .. ' &
            & //to_text(largest_bandlimit), exit_bad_input)
      else if (size(lower) /= coordinate_count(symmetry, coordinates) .or. size(upper) /= size(lower)) then
         call raise(error, 'a range is needed for each of '//to_text(coordinate_count(symmetry, coordinates)) &
            & //' coordinates, not '//to_text(size(lower)), exit_bad_input)
      else if (.not. all(upper - lower > 0.0_wp .and. upper - lower < huge(1.0_wp))) then
         call raise(error, 'the range of a coordinate is empty', exit_bad_input)
      end if
      if (allocated(error)) return
      basis%symmetry = symmetry
      basis%coordinates = coordinates
      basis%truncation = truncation
      basis%degree = degree
      basis%bandlimit = bandlimit
      basis%lower = lower
      basis%upper = upper
      basis%n_coordinates = size(lower)
      basis%n_harmonics = harmonic_count(symmetry, bandlimit)
      basis%n_polynomials = polynomial_count(basis%n_coordinates, truncation, degree)
      basis%n_terms = basis%n_harmonics*basis%n_polynomials
      call list_polynomials(basis)
      if (symmetry == symmetry_cubic) then
         call build_cubic_harmonics(basis)
      else
         call list_zonal_harmonics(basis)
      end if
   end subroutine new_basis

   !> Degrees of the polynomials, ordered by total degree, and from which earlier one each follows.
   subroutine list_polynomials(basis)
      type(basis_type), intent(inout) :: basis
      integer :: counter(most_coordinates), n, total, highest, k, i, code
      integer, allocatable :: find(:)

      n = basis%n_coordinates
      allocate (basis%degrees(n, basis%n_polynomials))
      allocate (basis%parent(basis%n_polynomials), basis%factor(basis%n_polynomials))
      allocate (basis%factor_degree(basis%n_polynomials))
      highest = basis%degree
      if (basis%truncation == truncation_tensor) highest = n*basis%degree
      k = 0
      allocate (find(0:(largest_degree + 1)**n - 1))
      find = 0
      do total = 0, highest
         counter = 0
         do
            if (sum(counter(:n)) == total) then
               k = k + 1
               basis%degrees(:, k) = counter(:n)
               find(number(counter(:n))) = k
            end if
            ! The next combination, the last coordinate fastest.
            do i = n, 1, -1
               if (counter(i) < basis%degree) exit
               counter(i) = 0
            end do
            if (i == 0) exit
            counter(i) = counter(i) + 1
         end do
      end do
      basis%parent(1) = 0
      basis%factor(1) = 1
      basis%factor_degree(1) = 0
      do k = 2, basis%n_polynomials
         counter(:n) = basis%degrees(:, k)
         do i = n, 1, -1
            if (counter(i) > 0) exit
         end do
         basis%factor(k) = i
         basis%factor_degree(k) = counter(i)
         counter(i) = 0
         code = number(counter(:n))
         basis%parent(k) = find(code)
      end do
   end subroutine list_polynomials

   pure integer function number(degrees)
      integer, intent(in) :: degrees(:)
      integer :: i

      number = 0
      do i = 1, size(degrees)
         number = number*(largest_degree + 1) + degrees(i)
      end do
   end function number

   subroutine list_zonal_harmonics(basis)
      type(basis_type), intent(inout) :: basis
      integer :: h

      allocate (basis%harmonic_degrees(basis%n_harmonics))
      do h = 1, basis%n_harmonics
         basis%harmonic_degrees(h) = 2*(h - 1)
      end do
   end subroutine list_zonal_harmonics

   !> The cubic harmonics by Gram-Schmidt on the monomials of the two invariants, in order of degree.
   !>
   !> Polynomials on the sphere that the cubic group leaves alone are polynomials in I4 = x^4+y^4+z^4 and I6 = x^2 y^2 z^2, and
   !> harmonics of degree l are orthogonal to all polynomials of lower degree. The sign makes the coefficient of the last
   !> monomial positive; two harmonics of one degree are told apart by the order of monomials (higher power of I4 first).
   subroutine build_cubic_harmonics(basis)
      type(basis_type), intent(inout) :: basis
      real(wp), allocatable :: values(:, :), weights(:), nodes(:), node_weights(:)
      real(wp) :: direction(3), uv(2), phi, sine, projection
      integer :: l, a, b, h, i, j, n, m, sweep, point

      allocate (basis%harmonic_degrees(basis%n_harmonics), basis%powers(2, basis%n_harmonics))
      allocate (basis%combination(basis%n_harmonics, basis%n_harmonics))
      h = 0
      do l = 0, basis%bandlimit, 2
         do b = 0, l/6
            if (mod(l - 6*b, 4) /= 0) cycle
            a = (l - 6*b)/4
            h = h + 1
            basis%harmonic_degrees(h) = l
            basis%powers(:, h) = [a, b]
         end do
      end do
      ! Products have degree 2 bandlimit at most: n Gauss-Legendre heights and 2n longitudes integrate them exactly.
      n = basis%bandlimit + 2
      m = 2*n
      allocate (nodes(n), node_weights(n), weights(n*m), values(n*m, basis%n_harmonics))
      call gauss_legendre(nodes, node_weights)
      point = 0
      do i = 1, n
         sine = sqrt(1.0_wp - nodes(i)**2)
         do j = 1, m
            phi = 2.0_wp*pi*(j - 0.5_wp)/m
            direction = [sine*cos(phi), sine*sin(phi), nodes(i)]
            point = point + 1
            weights(point) = 0.5_wp*node_weights(i)/m
            uv = cubic_invariants(direction)
            do h = 1, basis%n_harmonics
               values(point, h) = uv(1)**basis%powers(1, h)*uv(2)**basis%powers(2, h)
            end do
         end do
      end do
      basis%combination = 0.0_wp
      do h = 1, basis%n_harmonics
         basis%combination(h, h) = 1.0_wp
         do sweep = 1, 2
            do i = 1, h - 1
               projection = sum(weights*values(:, h)*values(:, i))
               values(:, h) = values(:, h) - projection*values(:, i)
               basis%combination(h, :i) = basis%combination(h, :i) - projection*basis%combination(i, :i)
            end do
            projection = sqrt(sum(weights*values(:, h)**2))
            values(:, h) = values(:, h)/projection
            basis%combination(h, :h) = basis%combination(h, :h)/projection
         end do
      end do
   end subroutine build_cubic_harmonics

   !> I4 and I6, shifted to mean 0 and scaled to order 1.
   pure function cubic_invariants(direction) result(uv)
      real(wp), intent(in) :: direction(3)
      real(wp) :: uv(2)
      real(wp) :: square(3)

      square = direction**2
      uv(1) = 2.5_wp*sum(square**2) - 1.5_wp
      uv(2) = 27.0_wp*(square(1)*square(2)*square(3) - 1.0_wp/105.0_wp)
   end function cubic_invariants

   !> Nodes and weights on [-1, 1] by Newton's method on the Legendre polynomial.
   pure subroutine gauss_legendre(nodes, weights)
      real(wp), intent(out) :: nodes(:), weights(:)
      real(wp) :: x, p0, p1, p2, slope
      integer :: n, i, k, iteration

      n = size(nodes)
      do i = 1, n
         x = cos(pi*(i - 0.25_wp)/(n + 0.5_wp))
         do iteration = 1, 100
            p0 = 1.0_wp
            p1 = x
            do k = 2, n
               p2 = ((2*k - 1)*x*p1 - (k - 1)*p0)/k
               p0 = p1
               p1 = p2
            end do
            slope = n*(x*p1 - p0)/(x*x - 1.0_wp)
            x = x - p1/slope
            if (abs(p1/slope) < 4.0_wp*epsilon(1.0_wp)) exit
         end do
         nodes(i) = x
         weights(i) = 2.0_wp/((1.0_wp - x*x)*slope**2)
      end do
   end subroutine gauss_legendre

   !> K_h of a grain: its indentation direction is sample z in crystal axes, g z.
   pure subroutine evaluate_harmonics(basis, euler, k)
      type(basis_type), intent(in) :: basis
      !> Bunge-Euler angles, radians.
      real(wp), intent(in) :: euler(3)
      real(wp), intent(out) :: k(:)

      call evaluate_direction(basis, [sin(euler(3))*sin(euler(2)), cos(euler(3))*sin(euler(2)), cos(euler(2))], k)
   end subroutine evaluate_harmonics

   !> K_h of a unit vector in crystal axes.
   pure subroutine evaluate_direction(basis, direction, k)
      type(basis_type), intent(in) :: basis
      real(wp), intent(in) :: direction(3)
      real(wp), intent(out) :: k(:)
      real(wp) :: uv(2), monomials(basis%n_harmonics), p(0:basis%bandlimit)
      integer :: h

      if (basis%symmetry == symmetry_cubic) then
         uv = cubic_invariants(direction)
         do h = 1, basis%n_harmonics
            monomials(h) = uv(1)**basis%powers(1, h)*uv(2)**basis%powers(2, h)
         end do
         do h = 1, basis%n_harmonics
            k(h) = sum(basis%combination(h, :h)*monomials(:h))
         end do
      else
         call legendre(direction(3), p)
         do h = 1, basis%n_harmonics
            k(h) = p(2*(h - 1))
         end do
      end if
   end subroutine evaluate_direction

   !> Legendre polynomials of mean square 1 on [-1, 1]: sqrt(2n+1) P_n(x), n = 0, 1, ..
   pure subroutine legendre(x, p)
      real(wp), intent(in) :: x
      real(wp), intent(out) :: p(0:)
      real(wp) :: before, last, next
      integer :: n

      p(0) = 1.0_wp
      if (ubound(p, 1) == 0) return
      before = 1.0_wp
      last = x
      p(1) = sqrt(3.0_wp)*x
      do n = 2, ubound(p, 1)
         next = ((2*n - 1)*x*last - (n - 1)*before)/n
         before = last
         last = next
         p(n) = sqrt(2.0_wp*n + 1.0_wp)*next
      end do
   end subroutine legendre

   !> The coordinates of a crystal before they are mapped to [-1, 1], and the stiffness scale s in GPa (1 for a box).
   !>
   !> Cubic: s = Voigt's shear modulus, K/(K+s), log of the Zener ratio. Hexagonal, with r = sqrt(C11 C33): s is the geometric
   !> mean of r-C13, r+C13, C44, C66; the coordinates are contrasts of their logarithms, and log C33/C11.
   pure subroutine raw_coordinates(symmetry, coordinates, constants, raw, scale)
      integer, intent(in) :: symmetry, coordinates
      !> GPa, of a Born-stable crystal; the coordinates of others may be NaN.
      real(wp), intent(in) :: constants(:)
      real(wp), intent(out) :: raw(:), scale
      real(wp) :: bulk, r, a, b, c66

      if (coordinates == coordinates_box) then
         scale = 1.0_wp
         raw = constants
      else if (symmetry == symmetry_cubic) then
         bulk = (constants(1) + 2.0_wp*constants(2))/3.0_wp
         scale = (constants(1) - constants(2) + 3.0_wp*constants(3))/5.0_wp
         raw(1) = bulk/(bulk + scale)
         raw(2) = log(2.0_wp*constants(3)/(constants(1) - constants(2)))
      else
         r = sqrt(constants(1)*constants(4))
         a = r - constants(5)
         b = r + constants(5)
         c66 = 0.5_wp*(constants(1) - constants(2))
         scale = sqrt(sqrt(a*b*constants(3)*c66))
         raw(1) = log(a/b)
         raw(2) = log(constants(3)/c66)
         raw(3) = log(a*b/(constants(3)*c66))
         raw(4) = log(constants(4)/constants(1))
      end if
   end subroutine raw_coordinates

   !> P_q of a crystal, and its stiffness scale s in GPa: the modulus is y = Kᵀ A p for a box, s exp(y) else.
   pure subroutine evaluate_polynomials(basis, constants, p, scale)
      type(basis_type), intent(in) :: basis
      !> GPa, of a Born-stable crystal.
      real(wp), intent(in) :: constants(:)
      real(wp), intent(out) :: p(:), scale
      real(wp) :: raw(basis%n_coordinates), factors(0:basis%degree, basis%n_coordinates)
      integer :: i, q

      call raw_coordinates(basis%symmetry, basis%coordinates, constants, raw, scale)
      do i = 1, basis%n_coordinates
         call legendre((2.0_wp*raw(i) - basis%lower(i) - basis%upper(i))/(basis%upper(i) - basis%lower(i)), factors(:, i))
      end do
      p(1) = 1.0_wp
      do q = 2, basis%n_polynomials
         p(q) = p(basis%parent(q))*factors(basis%factor_degree(q), basis%factor(q))
      end do
   end subroutine evaluate_polynomials

   !> All terms of one crystal at one orientation, terms(h + (q-1) n_harmonics) = K_h P_q, and the scale s in GPa.
   pure subroutine evaluate_terms(basis, constants, euler, terms, scale)
      type(basis_type), intent(in) :: basis
      real(wp), intent(in) :: constants(:), euler(3)
      real(wp), intent(out) :: terms(:), scale
      real(wp) :: k(basis%n_harmonics), p(basis%n_polynomials)
      integer :: q, first

      call evaluate_harmonics(basis, euler, k)
      call evaluate_polynomials(basis, constants, p, scale)
      do q = 1, basis%n_polynomials
         first = (q - 1)*basis%n_harmonics
         terms(first + 1:first + basis%n_harmonics) = k*p(q)
      end do
   end subroutine evaluate_terms

   !> Whether the coordinates of a stable crystal lie in the ranges, to a relative `slack` of 1e-9.
   pure logical function is_in_ranges(basis, constants)
      type(basis_type), intent(in) :: basis
      real(wp), intent(in) :: constants(:)
      real(wp) :: raw(basis%n_coordinates), scale, slack(basis%n_coordinates)

      call raw_coordinates(basis%symmetry, basis%coordinates, constants, raw, scale)
      slack = 1.0e-9_wp*(basis%upper - basis%lower)
      is_in_ranges = all(raw >= basis%lower - slack .and. raw <= basis%upper + slack)
   end function is_in_ranges
end module surrogate_basis
