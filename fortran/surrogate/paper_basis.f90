!> The paper's terms (Eq. 1-2): symmetrised surface harmonics of the indentation direction times products of Legendre polynomials of
!> the elastic constants of one crystal class.
!>
!> Term k = h + (q-1) n_harmonics is K_h P_q. Both families are orthonormal for the mean: of K_h K_h' over the sphere and of
!> P_q P_q' over the cube [-1, 1]^n, so that K_1 = P_1 = 1. The coordinates are the constants between their bounds, and M = y.
module paper_basis
   use abstract_basis, only: basis_type, grain_model_type
   use crystal_class, only: crystal_class_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use legendre_products, only: count_products, covariance_polynomial, evaluate_products, legendre_products_type, &
      & new_legendre_products
   use small_matrices, only: factor_semidefinite
   use surrogate_domain, only: domain_type
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, new_harmonics
   use text, only: to_text
   use vector_math, only: transposed_product
   implicit none
   private
   public :: paper_basis_type, new_paper_basis, largest_degree, truncation_names

   integer, parameter :: largest_degree = 12
   character(len=*), parameter :: truncation_names = 'tensor, total'

   !> Least sd of the noise, GPa.
   real(wp), parameter :: least_noise = 0.05_wp
   !> sds of a coefficient and of the noise before they are learnt, GPa.
   real(wp), parameter :: first_sds(2) = [100.0_wp, 1.0_wp]

   type, extends(basis_type) :: paper_basis_type
      character(len=:), allocatable :: truncation
      !> Highest degree of the polynomials (per coordinate, or in all) and of the harmonics.
      integer :: degree = 0, bandlimit = 0
      !> K_h, a function of the indentation direction in crystal axes.
      type(harmonics_type) :: harmonics
      !> P_q.
      type(legendre_products_type) :: polynomials
   contains
      procedure :: evaluate_terms
      procedure :: reach
      procedure :: term_degrees
      procedure :: exchange
      procedure :: new_grain_model
   end type paper_basis_type

   type, extends(grain_model_type) :: paper_grain_model_type
      private
      type(paper_basis_type) :: basis
      !> K_h of each grain, (n_grains, n_harmonics).
      real(wp), allocatable :: k(:, :)
      !> A(q, h).
      real(wp), allocatable :: coefficients(:, :)
      !> T(c), see `legendre_products`.
      type(legendre_products_type) :: squares
      real(wp), allocatable :: covariance(:, :)
   contains
      procedure :: set_grains
      procedure :: evaluate_moduli
      procedure :: evaluate_columns
   end type paper_grain_model_type

contains

   !> The basis over a domain with bounds.
   subroutine new_paper_basis(domain, truncation, degree, bandlimit, basis, error)
      type(domain_type), intent(in) :: domain
      !> A word of `truncation_names`.
      character(len=*), intent(in) :: truncation
      !> 0 to `largest_degree`; even, 0 to 20.
      integer, intent(in) :: degree, bandlimit
      type(paper_basis_type), intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error
      !> More terms are a mistake: their covariance alone would take 3 GB.
      real(wp), parameter :: most_terms = 20000.0_wp
      integer :: n
      real(wp) :: terms

      n = domain%class%n_constants
      if (size(domain%lower) /= n) then
         call raise(error, 'the paper''s model needs bounds of all constants', exit_bad_input)
      else if (truncation /= 'tensor' .and. truncation /= 'total') then
         call raise(error, 'truncation: '''//truncation//''' is unknown; allowed: '//truncation_names, exit_bad_input)
      else if (degree < 0 .or. degree > largest_degree) then
         call raise(error, 'degree = '//to_text(degree)//' is outside 0 .. '//to_text(largest_degree), exit_bad_input)
      end if
      if (.not. allocated(error)) call new_harmonics(domain%class, bandlimit, basis%harmonics, error)
      if (allocated(error)) return
      terms = basis%harmonics%n*count_products(n, degree, truncation == 'total')
      if (terms > most_terms) then
         call raise(error, 'degree = '//to_text(degree)//' and bandlimit = '//to_text(bandlimit)//' make '//to_text(terms, 4) &
            & //' terms; at most '//to_text(nint(most_terms))//' are possible', exit_bad_input)
         return
      end if
      basis%domain = domain
      basis%truncation = truncation
      basis%degree = degree
      basis%bandlimit = bandlimit
      basis%least_noise = least_noise
      basis%first_sds = first_sds
      basis%polynomials = new_legendre_products(n, degree, truncation == 'total')
      basis%n_terms = basis%harmonics%n*basis%polynomials%n_products
   end subroutine new_paper_basis

   !> The constants of a crystal, mapped from their bounds to [-1, 1].
   pure function coordinates_of(self, c) result(x)
      class(paper_basis_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: x(self%polynomials%n_coordinates)

      associate (lower => self%domain%lower, upper => self%domain%upper)
         x = (2.0_wp*self%domain%class%constants_of(c) - lower - upper)/(upper - lower)
      end associate
   end function coordinates_of

   pure real(wp) function reach(self, c)
      class(paper_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: x(self%polynomials%n_coordinates)

      x = coordinates_of(self, c)
      reach = maxval(abs(x))
   end function reach

   pure subroutine term_degrees(self, directional, polynomial)
      class(paper_basis_type), intent(in) :: self
      !> (n_terms).
      integer, intent(out) :: directional(:), polynomial(:)
      integer :: q, first

      do q = 1, self%polynomials%n_products
         first = (q - 1)*self%harmonics%n
         directional(first + 1:first + self%harmonics%n) = self%harmonics%degrees
         polynomial(first + 1:first + self%harmonics%n) = sum(self%polynomials%degrees(:, q))
      end do
   end subroutine term_degrees

   subroutine exchange(self, file)
      class(paper_basis_type), intent(inout) :: self
      class(labelled_values_type), intent(inout) :: file
      type(error_type), allocatable :: error
      type(paper_basis_type) :: new

      call file%text('truncation', self%truncation)
      call file%integer('degree', self%degree)
      call file%integer('bandlimit', self%bandlimit)
      if (allocated(file%error) .or. .not. file%reading) return
      call new_paper_basis(self%domain, self%truncation, self%degree, self%bandlimit, new, error)
      if (allocated(error)) then
         call file%fail(error%message)
      else
         select type (self)
         type is (paper_basis_type)
            self = new
         end select
      end if
   end subroutine exchange

   !> Indentation direction in crystal axes: sample z turned by g.
   pure function direction_of(euler) result(direction)
      !> Bunge-Euler angles, radians.
      real(wp), intent(in) :: euler(3)
      real(wp) :: direction(3)

      direction = [sin(euler(3))*sin(euler(2)), cos(euler(3))*sin(euler(2)), cos(euler(2))]
   end function direction_of

   pure subroutine evaluate_terms(self, c, euler, terms, scale)
      class(paper_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6), euler(3)
      !> (n_terms), and GPa.
      real(wp), intent(out) :: terms(:), scale
      real(wp) :: p(self%polynomials%n_products), k(self%harmonics%n)
      integer :: q, first

      scale = 1.0_wp
      call evaluate_products(self%polynomials, coordinates_of(self, c), p)
      call evaluate_harmonics(self%harmonics, direction_of(euler), k)
      do q = 1, size(p)
         first = (q - 1)*size(k)
         terms(first + 1:first + size(k)) = k*p(q)
      end do
   end subroutine evaluate_terms

   subroutine new_grain_model(self, class, coefficients, covariance, model, error)
      class(paper_basis_type), intent(in) :: self
      !> That of the domain.
      type(crystal_class_type), intent(in) :: class
      !> (n_terms); (n_terms, n_terms), or of size 0.
      real(wp), intent(in) :: coefficients(:), covariance(:, :)
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      type(paper_grain_model_type), allocatable :: new

      allocate (new)
      select type (self)
      type is (paper_basis_type)
         new%basis = self
      class default
         call raise(error, 'this basis has no model of '//class%name//' grains')
         return
      end select
      new%coefficients = transpose(reshape(coefficients, [self%harmonics%n, self%polynomials%n_products]))
      if (size(covariance) > 0) then
         new%n_columns = self%harmonics%n
         call covariance_polynomial(self%polynomials, self%harmonics%n, covariance, new%squares, new%covariance)
      end if
      allocate (new%k(0, self%harmonics%n))
      call move_alloc(new, model)
   end subroutine new_grain_model

   subroutine set_grains(self, euler, error)
      class(paper_grain_model_type), intent(inout) :: self
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: i, status

      deallocate (self%k, stat=status)
      if (status /= 0) call raise(error, 'the model of grains was not made')
      allocate (self%k(size(euler, 2), self%basis%harmonics%n))
      do i = 1, size(euler, 2)
         call evaluate_harmonics(self%basis%harmonics, direction_of(euler(:, i)), self%k(i, :))
      end do
   end subroutine set_grains

   pure subroutine evaluate_moduli(self, c, modulus, slope)
      class(paper_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> GPa, (n).
      real(wp), intent(out), contiguous :: modulus(:), slope(:)
      real(wp) :: p(self%basis%polynomials%n_products), y(self%basis%harmonics%n)
      integer :: i, h

      call evaluate_products(self%basis%polynomials, coordinates_of(self%basis, c), p)
      call transposed_product(size(p), size(y), self%coefficients, p, y)
      modulus = 0.0_wp
      do h = 1, size(y)
         !$omp simd
         do i = 1, size(modulus)
            modulus(i) = modulus(i) + self%k(i, h)*y(h)
         end do
      end do
      slope = 1.0_wp
   end subroutine evaluate_moduli

   pure subroutine evaluate_columns(self, c, columns)
      class(paper_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> (n, n_columns).
      real(wp), intent(out), contiguous :: columns(:, :)
      real(wp) :: p(self%squares%n_products), pairs(size(self%covariance, 2)), factor(self%n_columns, self%n_columns)
      integer :: g, h, first

      call evaluate_products(self%squares, coordinates_of(self%basis, c), p)
      call transposed_product(size(p), size(pairs), self%covariance, p, pairs)
      factor = 0.0_wp
      first = 1
      do g = 1, self%n_columns
         factor(g:, g) = pairs(first:first + self%n_columns - g)
         first = first + self%n_columns - g + 1
      end do
      call factor_semidefinite(factor)
      do g = 1, self%n_columns
         columns(:, g) = 0.0_wp
         do h = g, self%n_columns
            columns(:, g) = columns(:, g) + self%k(:, h)*factor(h, g)
         end do
      end do
   end subroutine evaluate_columns
end module paper_basis
