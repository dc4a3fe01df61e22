!> The paper's terms (Eq. 1-2): symmetrised surface harmonics of the indentation direction times
!> products of Legendre polynomials of the elastic constants of one crystal class.
!>
!> Term k = h + (q-1) n_harmonics is K_h P_q. Both families are orthonormal: the mean of K_h K_h'
!> over the sphere and that of P_q P_q' over the cube [-1, 1]^n are 1 for equal functions and 0
!> otherwise, and K_1 = P_1 = 1. The coordinates are the constants between their bounds, and M = y.
module paper_basis
   use abstract_basis, only: basis_type, grain_model_type
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: rotation_matrix
   use errors, only: error_type, raise, refuse
   use kinds, only: wp
   use legendre_products, only: count_products, covariance_polynomial, evaluate_products, &
      & legendre_products_type, new_legendre_products
   use small_matrices, only: factor_definite
   use surrogate_domain, only: domain_type
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, new_harmonics
   use text, only: to_text
   use linear_algebra, only: multiply, transposed_product
   implicit none
   private
   public :: paper_basis_type, largest_degree, truncation_names

   integer, parameter :: largest_degree = 12, largest_bandlimit = 20
   character(len=*), parameter :: truncation_names = 'tensor, total'

   type, extends(basis_type) :: paper_basis_type
      !> K_h, a function of the indentation direction in crystal axes.
      type(harmonics_type) :: harmonics
      !> P_q.
      type(legendre_products_type) :: polynomials
   contains
      procedure :: set_up, evaluate_many, new_grain_model
   end type paper_basis_type

   type, extends(grain_model_type) :: paper_grain_model_type
      private
      type(domain_type) :: domain
      type(harmonics_type) :: harmonics
      !> K_h of each grain, (n_grains, n_harmonics).
      real(wp), allocatable :: k(:, :)
      !> A(q, h).
      real(wp), allocatable :: coefficients(:, :)
      !> P_q, and T(c), see `legendre_products`.
      type(legendre_products_type) :: polynomials, squares
      real(wp), allocatable :: covariance(:, :)
   contains
      procedure :: set_grains, evaluate_crystals, evaluate_columns
   end type paper_grain_model_type

contains

   subroutine set_up(self, error)
      class(paper_basis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      !> With more terms the covariance alone would take more than 3 GB.
      real(wp), parameter :: most_terms = 20000.0_wp
      integer :: n, q
      real(wp) :: terms

      n = self%domain%class%n_constants
      associate (truncation => self%settings%truncation, degree => self%settings%degree, &
         & bandlimit => self%settings%bandlimit)
         if (size(self%domain%lower) /= n) then
            call refuse(error, 'the paper''s model needs bounds of all constants')
         else if (truncation /= 'tensor' .and. truncation /= 'total') then
            call refuse(error, 'truncation: '''//truncation//''' is unknown; allowed: ' &
               & //truncation_names)
         else if (degree < 0 .or. degree > largest_degree) then
            call refuse(error, 'degree = '//to_text(degree)//' is outside 0 .. ' &
               & //to_text(largest_degree))
         else if (bandlimit < 0 .or. bandlimit > largest_bandlimit .or. mod(bandlimit, 2) /= 0) then
            call refuse(error, 'bandlimit = '//to_text(bandlimit) &
               & //' is not an even number in 0 .. '//to_text(largest_bandlimit))
         else
            call new_harmonics(self%domain%class%generators, bandlimit, self%harmonics, error)
         end if
         if (allocated(error)) return
         terms = self%harmonics%n*count_products(n, degree, truncation == 'total')
         if (terms > most_terms) then
            call refuse(error, 'degree = '//to_text(degree)//' and bandlimit = ' &
               & //to_text(bandlimit)//' make '//to_text(terms, 4)//' terms; at most ' &
               & //to_text(nint(most_terms))//' are possible')
            return
         end if
         self%polynomials = new_legendre_products(n, degree, truncation == 'total')
      end associate
      self%n_terms = nint(terms)
      ! GPa.
      self%least_noise = 0.05_wp
      self%first_sds = [100.0_wp, 1.0_wp]
      if (self%settings%prior_sd == 'equal') return
      ! The degree of the polynomial of the constants; of a function of the orientation alone it is
      ! 1, and of the mean 0.
      associate (m => self%harmonics%n, degrees => sum(self%polynomials%degrees, 1))
         self%prior_degrees = [(spread(max(1, degrees(q)), 1, m), q=1, size(degrees))]
         self%prior_degrees(1) = 0
      end associate
   end subroutine set_up

   subroutine evaluate_many(self, c, euler, terms, scale, spread)
      class(paper_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(:, :, :), euler(:, :)
      real(wp), intent(out) :: terms(:, :), scale(:), spread(:)
      !> Axes of the sample in crystal axes, of which the third is indented.
      real(wp) :: g(3, 3)
      real(wp) :: p(self%polynomials%n_products), k(self%harmonics%n)
      integer :: i, q

      scale = 1.0_wp
      spread = 1.0_wp
      do i = 1, size(scale)
         call evaluate_products(self%polynomials, self%domain%coordinates_of(c(:, :, i)), p)
         g = rotation_matrix(euler(:, i))
         call evaluate_harmonics(self%harmonics, g(:, 3), k)
         do q = 1, size(p)
            terms((q - 1)*size(k) + 1:q*size(k), i) = k*p(q)
         end do
      end do
   end subroutine evaluate_many

   subroutine new_grain_model(self, class, coefficients, covariance, trained, &
      & trained_euler_deg, model, error)
      class(paper_basis_type), intent(in) :: self
      !> Class of the domain.
      type(crystal_class_type), intent(in) :: class
      !> (n_terms); (n_terms, n_terms), or of size 0.
      real(wp), intent(in) :: coefficients(:), covariance(:, :)
      !> Not used.
      real(wp), intent(in) :: trained(:, :), trained_euler_deg(:, :)
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      type(paper_grain_model_type), allocatable :: new

      if (class%name /= self%domain%class%name) then
         call raise(error, 'this basis has no model of '//class%name//' grains')
         return
      end if
      allocate (new)
      new%domain = self%domain
      new%harmonics = self%harmonics
      new%polynomials = self%polynomials
      new%coefficients = transpose(reshape(coefficients, &
         & [self%harmonics%n, self%polynomials%n_products]))
      if (size(covariance) > 0) then
         new%n_columns = self%harmonics%n
         call covariance_polynomial(self%polynomials, self%harmonics%n, covariance, new%squares, &
            & new%covariance)
      end if
      call move_alloc(new, model)
   end subroutine new_grain_model

   subroutine set_grains(self, euler, error)
      class(paper_grain_model_type), intent(inout) :: self
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> Axes of the sample in crystal axes, of which the third is indented.
      real(wp) :: g(3, 3)
      integer :: i

      self%k = reshape([real(wp) ::], [size(euler, 2), self%harmonics%n], [0.0_wp])
      do i = 1, size(euler, 2)
         g = rotation_matrix(euler(:, i))
         call evaluate_harmonics(self%harmonics, g(:, 3), self%k(i, :))
      end do
   end subroutine set_grains

   pure subroutine evaluate_crystals(self, c, modulus)
      class(paper_grain_model_type), intent(in) :: self
      real(wp), intent(in), contiguous :: c(:, :, :)
      real(wp), intent(out), contiguous :: modulus(:, :)
      real(wp) :: p(self%polynomials%n_products), y(self%harmonics%n, size(c, 3))
      integer :: i

      do i = 1, size(c, 3)
         call evaluate_products(self%polynomials, self%domain%coordinates_of(c(:, :, i)), p)
         call transposed_product(self%coefficients, p, y(:, i))
      end do
      call multiply(self%k, y, modulus)
   end subroutine evaluate_crystals

   pure subroutine evaluate_columns(self, c, columns)
      class(paper_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> (n, n_columns).
      real(wp), intent(out), contiguous :: columns(:, :)
      real(wp) :: p(self%squares%n_products), pairs(size(self%covariance, 2)), &
         & factor(self%n_columns, self%n_columns)
      integer :: g, h, first

      call evaluate_products(self%squares, self%domain%coordinates_of(c), p)
      call transposed_product(self%covariance, p, pairs)
      factor = 0.0_wp
      first = 1
      do g = 1, self%n_columns
         factor(g:, g) = pairs(first:first + self%n_columns - g)
         first = first + self%n_columns - g + 1
      end do
      ! A direction of no more variance than rounding is left out.
      call factor_definite(factor, 1.0e-13_wp)
      do g = 1, self%n_columns
         columns(:, g) = 0.0_wp
         do h = g, self%n_columns
            columns(:, g) = columns(:, g) + self%k(:, h)*factor(h, g)
         end do
      end do
   end subroutine evaluate_columns
end module paper_basis
