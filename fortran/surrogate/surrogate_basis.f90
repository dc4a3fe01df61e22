!> The terms of the surrogate (paper's Eq. 1-2): symmetrised surface harmonics of the indentation direction times products of
!> Legendre polynomials of the elastic constants.
!>
!> Term k = h + (q-1) n_harmonics is K_h P_q. Both families are orthonormal for the mean: of K_h K_h' over the sphere and of
!> P_q P_q' over the cube [-1, 1]^n, so that K_1 = P_1 = 1.
!>
!> With `coordinates_box` the coordinates are the constants and the model is M = y. With `coordinates_dimensionless` they are
!> ratios of the constants and M = s exp(y), s a stiffness: the modulus is homogeneous of degree one in the constants.
module surrogate_basis
   use crystal_class, only: crystal_class_type
   use dimensionless_coordinates, only: has_ratios, ratios_of
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use symmetric_harmonics, only: harmonics_type, largest_bandlimit, new_harmonics, harmonics_of => evaluate_harmonics
   use text, only: to_text
   implicit none
   private
   public :: basis_type, new_basis, polynomial_count, coordinate_count
   public :: coordinates_box, coordinates_dimensionless, coordinates_from_name, coordinates_name
   public :: truncation_tensor, truncation_total, truncation_from_name, truncation_name
   public :: evaluate_harmonics, evaluate_polynomials, evaluate_terms, raw_coordinates, is_in_ranges
   public :: largest_bandlimit, largest_degree

   integer, parameter :: coordinates_box = 1, coordinates_dimensionless = 2
   integer, parameter :: truncation_tensor = 1, truncation_total = 2
   integer, parameter :: largest_degree = 12, most_coordinates = 5

   type :: basis_type
      type(crystal_class_type) :: class
      integer :: coordinates = 0, truncation = 0
      !> Highest degree of the polynomials (per coordinate, or in all) and of the harmonics.
      integer :: degree = 0, bandlimit = 0
      integer :: n_coordinates = 0, n_harmonics = 0, n_polynomials = 0, n_terms = 0
      !> Ranges of the raw coordinates (GPa, or dimensionless) that are mapped to [-1, 1].
      real(wp), allocatable :: lower(:), upper(:)
      !> Degree of each polynomial in each coordinate, degrees(n_coordinates, n_polynomials).
      integer, allocatable :: degrees(:, :)
      !> K_h, a function of the indentation direction in crystal axes.
      type(harmonics_type) :: harmonics
      !> P_q = P_parent(q) times the Legendre polynomial of degree factor_degree(q) in coordinate factor(q).
      integer, allocatable, private :: parent(:), factor(:), factor_degree(:)
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

   !> How many coordinates replace the constants of a class.
   pure integer function coordinate_count(class, coordinates) result(n)
      type(crystal_class_type), intent(in) :: class
      integer, intent(in) :: coordinates

      n = class%n_constants
      if (coordinates == coordinates_dimensionless) n = n - 1
   end function coordinate_count

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
   subroutine new_basis(class, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
      type(crystal_class_type), intent(in) :: class
      integer, intent(in) :: coordinates, truncation
      !> 0 to `largest_degree`; even, 0 to `largest_bandlimit`.
      integer, intent(in) :: degree, bandlimit
      real(wp), intent(in) :: lower(:), upper(:)
      type(basis_type), intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      if (coordinates == coordinates_dimensionless .and. .not. has_ratios(class)) then
         call raise(error, 'coordinates: a '//class%name//' crystal has no dimensionless ones; allowed ''box''', exit_bad_input)
      else if (coordinates /= coordinates_box .and. coordinates /= coordinates_dimensionless) then
         call raise(error, 'coordinates: allowed are ''box'' and ''dimensionless''', exit_bad_input)
      else if (truncation /= truncation_tensor .and. truncation /= truncation_total) then
         call raise(error, 'truncation: allowed are ''tensor'' and ''total''', exit_bad_input)
      else if (degree < 0 .or. degree > largest_degree) then
         call raise(error, 'degree = '//to_text(degree)//' is outside 0 .. '//to_text(largest_degree), exit_bad_input)
      else if (size(lower) /= coordinate_count(class, coordinates) .or. size(upper) /= size(lower)) then
         call raise(error, 'a range is needed for each of '//to_text(coordinate_count(class, coordinates)) &
            & //' coordinates, not '//to_text(size(lower)), exit_bad_input)
      else if (.not. all(upper - lower > 0.0_wp .and. upper - lower < huge(1.0_wp))) then
         call raise(error, 'the range of a coordinate is empty', exit_bad_input)
      end if
      if (.not. allocated(error)) call new_harmonics(class, bandlimit, basis%harmonics, error)
      if (allocated(error)) return
      basis%class = class
      basis%coordinates = coordinates
      basis%truncation = truncation
      basis%degree = degree
      basis%bandlimit = bandlimit
      basis%lower = lower
      basis%upper = upper
      basis%n_coordinates = size(lower)
      basis%n_harmonics = basis%harmonics%n
      basis%n_polynomials = polynomial_count(basis%n_coordinates, truncation, degree)
      basis%n_terms = basis%n_harmonics*basis%n_polynomials
      call list_polynomials(basis)
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

   !> K_h of a grain: its indentation direction is sample z in crystal axes, g z.
   pure subroutine evaluate_harmonics(basis, euler, k)
      type(basis_type), intent(in) :: basis
      !> Bunge-Euler angles, radians.
      real(wp), intent(in) :: euler(3)
      real(wp), intent(out) :: k(:)

      call harmonics_of(basis%harmonics, [sin(euler(3))*sin(euler(2)), cos(euler(3))*sin(euler(2)), cos(euler(2))], k)
   end subroutine evaluate_harmonics

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
   pure subroutine raw_coordinates(class, coordinates, constants, raw, scale)
      type(crystal_class_type), intent(in) :: class
      integer, intent(in) :: coordinates
      !> GPa, of a Born-stable crystal; the coordinates of others may be NaN.
      real(wp), intent(in) :: constants(:)
      real(wp), intent(out) :: raw(:), scale

      if (coordinates == coordinates_box) then
         scale = 1.0_wp
         raw = constants
      else
         call ratios_of(class, constants, raw, scale)
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

      call raw_coordinates(basis%class, basis%coordinates, constants, raw, scale)
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

      call raw_coordinates(basis%class, basis%coordinates, constants, raw, scale)
      slack = 1.0e-9_wp*(basis%upper - basis%lower)
      is_in_ranges = all(raw >= basis%lower - slack .and. raw <= basis%upper + slack)
   end function is_in_ranges
end module surrogate_basis
