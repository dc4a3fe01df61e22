!> The exact theory of the half-space, for crystals of every class, times a correction of the specimen: M = M_theory exp(y).
!>
!> Theory has the crystal's own anisotropy. y is a polynomial of the logarithm of the Kelvin stiffness in the frame of the indenter, which
!> does not change when the crystal is turned about the axis (see `axial_polynomials`), nor with its scale unless the domain states a
!> range of that; its coefficients are the less likely to be large the higher their degree. Terms of the highest degree that the
!> simulations have not decided are the misfit of the others: a function of the crystal, which grains of like orientation share.
!>
!> The model 'halfspace' has no terms, and needs no simulation: its error is that of the expansion of the surface compliance, see
!> `compliance_field`.
module correction_basis
   use abstract_basis, only: basis_type, grain_model_type, growth_power, spread_of
   use axial_coordinates, only: axial_coordinates_of, kelvin_rotation, n_coordinates
   use axial_polynomials, only: axial_polynomials_type, evaluate_polynomials, greatest_degree, new_axial_polynomials
   use compliance_field, only: field_moduli, field_type, new_field
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: log_anisotropy, rotation_matrix
   use errors, only: error_type, exit_bad_input, raise
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use linear_algebra, only: add_gram, cholesky_factor, multiply, symmetric_eigen
   use logarithmic_coordinates, only: log_coordinates_type, logarithm_of, new_log_coordinates
   use modulus_expansion, only: modulus_expansion_type, new_modulus_expansion
   use surrogate_domain, only: spread_crystals
   use text, only: to_text
   implicit none
   private
   public :: correction_basis_type

   !> Relative: least sd of the noise, and sds of a coefficient of degree 1 and of the noise before the first regression.
   real(wp), parameter :: least_noise = 1.7e-4_wp, first_sds(2) = [0.017_wp, 1.0e-3_wp]

   !> How much larger than that of a nearly isotropic crystal the noise of a crystal at the domain's greatest log-anisotropy is, less 1.
   real(wp), parameter :: spread_at_end = 8.0_wp

   !> Grains that are worked on side by side.
   integer, parameter :: at_once = 64

   type, extends(basis_type) :: correction_basis_type
      !> None of the theory alone.
      type(axial_polynomials_type) :: polynomials
   contains
      procedure :: set_up
      procedure :: exchange
      procedure :: evaluate_many
      procedure :: new_grain_model
   end type correction_basis_type

   type, extends(grain_model_type) :: correction_grain_model_type
      private
      type(crystal_class_type) :: class
      !> Of the grains, or of the directions of their expansion if that pays.
      type(field_type) :: field
      type(modulus_expansion_type) :: expansion
      !> Bunge-Euler angles of the moduli that are computed, (3, n_independent), radians.
      real(wp), allocatable :: euler(:, :)
      type(axial_polynomials_type) :: polynomials
      type(log_coordinates_type) :: logarithms
      !> From coordinates of log K to those about each axis for which moduli are computed, (axis, coordinate, n_constants).
      real(wp), allocatable :: maps(:, :, :)
      !> Of the polynomials, and F with F Fᵀ their covariance as far as it matters, (n_terms, n_columns).
      real(wp), allocatable :: coefficients(:), factor(:, :)
   contains
      procedure :: set_grains
      procedure :: evaluate_independent
      procedure :: evaluate_columns
      procedure :: expand
   end type correction_grain_model_type

contains

   subroutine set_up(self, error)
      class(correction_basis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%logarithmic = .true.
      if (self%settings%model == 'halfspace') return
      associate (domain => self%domain, degree => self%settings%degree)
         if (degree < 1 .or. degree > greatest_degree) then
            call raise(error, 'degree = '//to_text(degree)//' is outside 1 .. '//to_text(greatest_degree), exit_bad_input)
            return
         end if
         if (domain%has_scale()) then
            ! The trace of log K over sqrt 6 is sqrt 6 times the logarithm of the geometric mean of the eigenvalues.
            self%polynomials = new_axial_polynomials(degree, sqrt(6.0_wp)*0.5_wp*sum(log(domain%stiffness)))
         else
            self%polynomials = new_axial_polynomials(degree)
         end if
      end associate
      self%n_terms = self%polynomials%n
      self%prior_degrees = self%polynomials%degrees
      self%least_noise = least_noise
      self%noise_growth = 0.0_wp
      if (self%domain%log_anisotropy_max < huge(1.0_wp)) then
         self%noise_growth = spread_at_end/self%domain%log_anisotropy_max**growth_power
      end if
      self%first_sds = first_sds
   end subroutine set_up

   subroutine exchange(self, file)
      class(correction_basis_type), intent(inout) :: self
      type(labelled_values_type), intent(inout) :: file

      if (self%settings%model /= 'halfspace') call file%integer('degree', self%settings%degree)
   end subroutine exchange

   !> The polynomials of many are worked on side by side.
   subroutine evaluate_many(self, c, euler, terms, scale, spread)
      class(correction_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(:, :, :), euler(:, :)
      real(wp), intent(out) :: terms(:, :), scale(:), spread(:)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp) :: x(size(scale), n_coordinates), values(size(scale), self%n_terms)
      integer :: i

      do i = 1, size(scale)
         call halfspace_modulus(c(:, :, i), euler(:, i), theory, error)
         scale(i) = theory%modulus
         spread(i) = spread_of(self%noise_growth, c(:, :, i))
         if (self%n_terms > 0) x(i, :) = turned_coordinates(logarithm_of(c(:, :, i)), euler(:, i))
      end do
      call evaluate_polynomials(self%polynomials, x(:, :self%polynomials%n_coordinates), values)
      do i = 1, size(scale)
         terms(:, i) = values(i, :)/spread(i)
      end do
   end subroutine evaluate_many

   !> Coordinates about the indenter's axis of a matrix in crystal axes.
   pure function turned_coordinates(matrix, euler) result(x)
      real(wp), intent(in) :: matrix(6, 6)
      !> Bunge-Euler angles, radians.
      real(wp), intent(in) :: euler(3)
      real(wp) :: x(n_coordinates)
      real(wp) :: turn(6, 6)

      turn = kelvin_rotation(transpose(rotation_matrix(euler)))
      x = axial_coordinates_of(matmul(turn, matmul(matrix, transpose(turn))))
   end function turned_coordinates

   subroutine new_grain_model(self, class, coefficients, covariance, model, error)
      class(correction_basis_type), intent(in) :: self
      type(crystal_class_type), intent(in) :: class
      !> (n_terms); (n_terms, n_terms), or of size 0.
      real(wp), intent(in) :: coefficients(:), covariance(:, :)
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      type(correction_grain_model_type), allocatable :: new

      allocate (new)
      new%class = class
      new%has_theory = .true.
      new%noise_growth = self%noise_growth
      new%polynomials = self%polynomials
      new%logarithms = new_log_coordinates(class)
      new%coefficients = coefficients
      if (size(covariance) > 0) then
         call factor_where_it_matters(self, covariance, new%factor, error)
         if (allocated(error)) return
         new%n_columns = size(new%factor, 2)
      end if
      call move_alloc(new, model)
   end subroutine new_grain_model

   !> F with F Fᵀ the covariance but for 0.2 % of the variance of y, the mean over crystals of the domain: most directions of the
   !> coefficients hardly matter to any crystal.
   subroutine factor_where_it_matters(self, covariance, factor, error)
      class(correction_basis_type), intent(in) :: self
      real(wp), intent(in) :: covariance(:, :)
      real(wp), allocatable, intent(out) :: factor(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: n_crystals = 500, seed = 1
      real(wp), parameter :: share = 2.0e-3_wp
      real(wp), allocatable, dimension(:, :) :: constants, euler_deg, terms, root, projected, gram
      real(wp), allocatable :: scale(:), spread(:), values(:)
      integer :: i, j, n

      call spread_crystals(self%domain, n_crystals, seed, constants, euler_deg, error)
      if (allocated(error)) return
      n = self%n_terms
      allocate (projected(n, n_crystals), gram(n, n), values(n))
      call self%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      root = covariance
      call cholesky_factor(root, error)
      if (allocated(error)) return
      do j = 2, n
         root(:j - 1, j) = 0.0_wp
      end do
      call multiply(transpose(root), terms, projected)
      gram = 0.0_wp
      call add_gram(projected, 1.0_wp, gram, transposed=.false.)
      call symmetric_eigen(gram, values, error)
      if (allocated(error)) return
      ! Ascending.
      i = 1
      do while (i < n .and. sum(values(:i)) <= share*sum(values))
         i = i + 1
      end do
      factor = matmul(root, gram(:, i:))
   end subroutine factor_where_it_matters

   subroutine set_grains(self, euler, error)
      class(correction_grain_model_type), intent(inout) :: self
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: x(n_coordinates)
      integer :: i, k

      call new_modulus_expansion(self%class, self%field_degree, euler, self%expansion, error)
      if (allocated(error)) return
      self%euler = euler
      if (self%expansion%pays) self%euler = self%expansion%euler
      self%field_cost = self%expansion%cost
      self%n_independent = size(self%euler, 2)
      call new_field(self%class, self%field_degree, self%euler, self%field, error)
      if (allocated(error)) return
      self%full_cost = self%field_cost + 2.6_wp*self%n_independent
      self%field_cost = self%field_cost + size(self%field%nodes, 2)*(0.09_wp + 0.004_wp*self%n_independent) &
         & + 0.07_wp*self%n_independent
      if (allocated(self%maps)) deallocate (self%maps)
      allocate (self%maps(self%n_independent, self%polynomials%n_coordinates, self%logarithms%n))
      do i = 1, self%n_independent
         do k = 1, self%logarithms%n
            x = turned_coordinates(self%logarithms%basis(:, :, k), self%euler(:, i))
            self%maps(i, :, k) = x(:self%polynomials%n_coordinates)
         end do
      end do
   end subroutine set_grains

   !> The polynomials of a crystal in the grains from first to last, (grain, n_terms).
   pure function terms_of_grains(self, w, first, last) result(terms)
      class(correction_grain_model_type), intent(in) :: self
      !> log K in the coordinates of its class.
      real(wp), intent(in) :: w(:)
      integer, intent(in) :: first, last
      real(wp) :: terms(last - first + 1, self%polynomials%n)
      real(wp) :: x(last - first + 1, self%polynomials%n_coordinates)
      integer :: k

      x = 0.0_wp
      do k = 1, size(w)
         x = x + w(k)*self%maps(first:last, :, k)
      end do
      call evaluate_polynomials(self%polynomials, x, terms)
   end function terms_of_grains

   pure subroutine evaluate_independent(self, c, modulus)
      class(correction_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      real(wp), intent(out), contiguous :: modulus(:)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp) :: w(self%logarithms%n)
      logical :: in_full
      integer :: first, last

      in_full = self%full_above < huge(1.0_wp)
      if (in_full) in_full = log_anisotropy(c) > self%full_above
      if (in_full) then
         do first = 1, size(modulus)
            call halfspace_modulus(c, self%euler(:, first), theory, error)
            modulus(first) = theory%modulus
         end do
      else
         call field_moduli(self%field, c, modulus)
      end if
      if (self%polynomials%n == 0) return
      w = self%logarithms%to_logarithms(c)
      do first = 1, size(modulus), at_once
         last = min(first + at_once - 1, size(modulus))
         modulus(first:last) = modulus(first:last)*exp(matmul(terms_of_grains(self, w, first, last), self%coefficients))
      end do
   end subroutine evaluate_independent

   pure subroutine expand(self, independent, modulus)
      class(correction_grain_model_type), intent(in) :: self
      real(wp), intent(in), contiguous :: independent(:)
      real(wp), intent(out), contiguous :: modulus(:)

      if (self%expansion%pays) then
         call self%expansion%expand(independent, modulus)
      else
         modulus = independent
      end if
   end subroutine expand

   pure subroutine evaluate_columns(self, c, columns)
      class(correction_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> (n, n_columns).
      real(wp), intent(out), contiguous :: columns(:, :)
      real(wp), allocatable :: independent(:, :)
      real(wp) :: w(self%logarithms%n), spread
      integer :: first, last, j

      spread = spread_of(self%noise_growth, c)
      w = self%logarithms%to_logarithms(c)
      allocate (independent(self%n_independent, self%n_columns))
      do first = 1, self%n_independent, at_once
         last = min(first + at_once - 1, self%n_independent)
         independent(first:last, :) = matmul(terms_of_grains(self, w, first, last), self%factor/spread)
      end do
      do j = 1, self%n_columns
         call self%expand(independent(:, j), columns(:, j))
      end do
   end subroutine evaluate_columns
end module correction_basis
