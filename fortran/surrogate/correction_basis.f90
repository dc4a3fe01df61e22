!> The exact theory of the half-space, for crystals of every class, times a correction for the
!> specimen: M = M_theory exp(y).
!>
!> The theory has the crystal's own anisotropy. y is a polynomial of the logarithm of the Kelvin
!> stiffness in the frame of the indenter. It does not change when the crystal is turned about the
!> axis. It depends on the scale of the stiffness only if the domain states a range of it. The prior
!> sd of a coefficient decays with its degree. Terms of the highest degree that the simulations have
!> not determined describe the misfit of the others: it is a function of the crystal, which grains
!> of similar orientation share.
!>
!> The model 'film' is trained on exact values where the posterior is. The model 'halfspace' has no
!> terms and needs no simulation. Its error is that of the expansion of
!> the surface compliance, see `compliance_field`.
module correction_basis
   use abstract_basis, only: basis_type, grain_model_type, growth_power, spread_of
   use axial_polynomials, only: axial_polynomials_type, evaluate_polynomials, greatest_degree, &
      & new_axial_polynomials
   use compliance_field, only: field_moduli, field_type, modulus_expansion_type, new_field, &
      & new_modulus_expansion
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: log_anisotropy, rotation_matrix
   use errors, only: error_type, refuse
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use legendre_products, only: count_products, evaluate_products, legendre_products_type, &
      & new_legendre_products
   use linear_algebra, only: cholesky_factor, cholesky_solve, gram_of, multiply, symmetric_eigen, &
      & transposed_product
   use logarithmic_coordinates, only: axial_coordinates_of, kelvin_rotation, log_coordinates_type, &
      & logarithm_of, n_coordinates, new_log_coordinates
   use random, only: new_random_stream, random_stream_type
   use surrogate_domain, only: domain_type, spread_crystals
   use text, only: to_text
   implicit none
   private
   public :: correction_basis_type, correction_grain_model_type

   !> Noise of a crystal at the greatest log-anisotropy of the domain relative to a nearly isotropic
   !> one, less 1; chosen on 390 crystals (docs/verification/surrogate.md).
   real(wp), parameter :: spread_at_end = 8.0_wp

   !> Approximate times, microseconds, on the core of docs/verification/theory.md: a modulus by the
   !> exact theory, a contact ellipse, a node of the field, and a node for the modes of a grain.
   !> They reproduce the moduli per second and the densities of 50 grains there. Only their ratios
   !> matter.
   real(wp), parameter :: theory_time = 2.6_wp, ellipse_time = 0.07_wp, node_time = 0.09_wp, &
      & mode_time = 0.004_wp

   type, extends(basis_type) :: correction_basis_type
      !> Polynomials of y; the model 'halfspace' has none.
      type(axial_polynomials_type) :: polynomials
      !> Of the domain's class.
      type(log_coordinates_type), private :: logarithms
   contains
      procedure :: set_up, evaluate_many, new_grain_model
   end type correction_basis_type

   type, extends(grain_model_type) :: correction_grain_model_type
      private
      type(crystal_class_type) :: class
      !> Field of the grains, or of the directions of their expansion if that is used.
      type(field_type) :: field
      type(modulus_expansion_type), public :: expansion
      !> Number of moduli that are computed, and their Bunge-Euler angles, (3, n_independent),
      !> radians.
      integer :: n_independent = 0
      real(wp), allocatable :: euler(:, :)
      type(axial_polynomials_type) :: polynomials
      type(log_coordinates_type) :: logarithms
      type(domain_type) :: domain
      !> Map from coordinates of log K to those about each axis for which moduli are computed,
      !> (axis, coordinate, n_constants).
      real(wp), allocatable :: maps(:, :, :)
      !> Coefficients of the polynomials, and F with F Fᵀ approximately their covariance, (n_terms,
      !> n_columns).
      real(wp), allocatable :: coefficients(:), factor(:, :)
      !> If the class has few constants: products of polynomials of its own coordinates, and the
      !> coefficients of y in them, for the moduli that are computed and for each column, (product,
      !> n_independent*(1 + n_columns)). Otherwise n_products is 0.
      type(legendre_products_type) :: own
      real(wp), allocatable :: expanded(:, :)
   contains
      procedure :: set_grains, evaluate_crystals, evaluate_columns
   end type correction_grain_model_type

contains

   subroutine set_up(self, error)
      class(correction_basis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Of the scale, if y depends on it.
      real(wp), allocatable :: centre

      self%logarithmic = .true.
      if (self%settings%model == 'halfspace') return
      associate (domain => self%domain, degree => self%settings%degree)
         if (degree < 1 .or. degree > greatest_degree) then
            call refuse(error, 'degree = '//to_text(degree)//' is outside 1 .. ' &
               & //to_text(greatest_degree))
            return
         end if
         ! The trace of log K over sqrt 6 is sqrt 6 times the logarithm of the geometric mean of the
         ! eigenvalues.
         if (domain%has_scale()) centre = sqrt(6.0_wp)*0.5_wp*sum(log(domain%stiffness))
         self%polynomials = new_axial_polynomials(degree, centre)
      end associate
      self%n_terms = self%polynomials%n
      self%prior_degrees = self%polynomials%degrees
      ! Both are relative. The sd of a coefficient of degree 1 is that of 1900 simulations of a
      ! block (docs/verification/surrogate.md); docs/surrogate.md states the least noise.
      self%least_noise = 1.7e-4_wp
      self%first_sds = [0.017_wp, 1.0e-3_wp]
      if (self%settings%model == 'film') then
         ! Ten times the error of exact values.
         self%least_noise = 1.0e-4_wp
         self%logarithms = new_log_coordinates(self%domain%class)
      end if
      if (self%domain%log_anisotropy_max < huge(1.0_wp)) then
         self%noise_growth = spread_at_end/self%domain%log_anisotropy_max**growth_power
      end if
   end subroutine set_up

   !> The polynomials of many crystals are evaluated together.
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
         if (self%n_terms > 0) x(i, :) = turned_coordinates(logarithm(c(:, :, i)), euler(:, i))
      end do
      if (self%n_terms > 0) then
         call evaluate_polynomials(self%polynomials, x(:, :self%polynomials%n_coordinates), values)
      end if
      do i = 1, size(scale)
         terms(:, i) = values(i, :)/spread(i)
      end do

   contains

      !> Logarithm of a stiffness, or of the nearest one within the limits of an extended domain.
      pure function logarithm(stiffness)
         real(wp), intent(in) :: stiffness(6, 6)
         real(wp) :: logarithm(6, 6), w(self%logarithms%n)
         integer :: k

         if (.not. self%domain%is_extended) then
            logarithm = logarithm_of(stiffness)
            return
         end if
         w = self%domain%nearest(self%logarithms%to_logarithms(stiffness))
         logarithm = 0.0_wp
         do k = 1, size(w)
            logarithm = logarithm + w(k)*self%logarithms%basis(:, :, k)
         end do
      end function logarithm
   end subroutine evaluate_many

   !> Coordinates of a matrix in crystal axes about the indenter's axis.
   pure function turned_coordinates(matrix, euler) result(x)
      real(wp), intent(in) :: matrix(6, 6)
      !> Bunge-Euler angles, radians.
      real(wp), intent(in) :: euler(3)
      real(wp) :: x(n_coordinates), turn(6, 6)

      turn = kelvin_rotation(transpose(rotation_matrix(euler)))
      x = axial_coordinates_of(matmul(turn, matmul(matrix, transpose(turn))))
   end function turned_coordinates

   subroutine new_grain_model(self, class, coefficients, covariance, trained, &
      & trained_euler_deg, model, error)
      class(correction_basis_type), intent(in) :: self
      type(crystal_class_type), intent(in) :: class
      !> (n_terms); (n_terms, n_terms), or of size 0.
      real(wp), intent(in) :: coefficients(:), covariance(:, :), trained(:, :), &
         & trained_euler_deg(:, :)
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      type(correction_grain_model_type), allocatable :: new

      allocate (new)
      new%class = class
      new%has_theory = .true.
      new%noise_growth = self%noise_growth
      new%polynomials = self%polynomials
      new%logarithms = new_log_coordinates(class)
      new%domain = self%domain
      new%coefficients = coefficients
      if (size(covariance) > 0) then
         call factor_covariance()
         if (allocated(error)) return
         new%n_columns = size(new%factor, 2)
      end if
      call move_alloc(new, model)

   contains

      !> F with F Fᵀ the covariance, less a part of the variance of y in the mean over crystals of
      !> the class in the domain, or those of the training for a film: most directions of the
      !> coefficients hardly change y in any of them.
      subroutine factor_covariance()
         integer, parameter :: n_crystals = 500, seed = 1
         !> That part, and that of a film, whose variance is small beside the measurements'.
         real(wp), parameter :: variance_left_out(2) = [2.0e-3_wp, 0.2_wp]
         real(wp), allocatable, dimension(:, :) :: constants, euler_deg, terms, root, projected, &
            & gram
         real(wp), allocatable :: scale(:), spread(:), values(:)
         type(domain_type) :: domain
         real(wp) :: left_out
         integer :: i, j, n

         left_out = variance_left_out(1)
         if (self%settings%model == 'film') then
            left_out = variance_left_out(2)
            constants = trained
            euler_deg = trained_euler_deg
         else
            domain = self%domain
            domain%members = class%name
            call spread_crystals(domain, n_crystals, seed, constants, euler_deg, error)
            if (allocated(error)) return
         end if
         n = self%n_terms
         allocate (projected(n, size(constants, 2)), values(n))
         call self%evaluate_crystals(constants, euler_deg, terms, scale, spread)
         root = covariance
         call cholesky_factor(root, error)
         if (allocated(error)) return
         do j = 2, n
            root(:j - 1, j) = 0.0_wp
         end do
         call multiply(transpose(root), terms, projected)
         gram = gram_of(projected)
         call symmetric_eigen(gram, values, error)
         if (allocated(error)) return
         ! The eigenvalues are in ascending order.
         i = 1
         do while (i < n .and. sum(values(:i)) <= left_out*sum(values))
            i = i + 1
         end do
         new%factor = matmul(root, gram(:, i:))
      end subroutine factor_covariance
   end subroutine new_grain_model

   subroutine set_grains(self, euler, error)
      class(correction_grain_model_type), intent(inout) :: self
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: x(n_coordinates)
      integer :: i, k

      ! Other grains, if many, need the moduli in the same directions.
      if (self%expansion%is_used .and. self%expansion%degree == self%field_degree &
         & .and. size(euler, 2) > self%n_independent .and. self%full_above >= 0.0_wp) then
         call self%expansion%set_grains(euler)
         return
      end if
      self%expansion%is_used = .false.
      if (self%full_above >= 0.0_wp) then
         call new_modulus_expansion(self%class, self%field_degree, euler, self%expansion, error)
      end if
      if (allocated(error)) return
      self%euler = euler
      if (self%expansion%is_used) self%euler = self%expansion%euler
      self%field_cost = self%expansion%cost
      self%n_independent = size(self%euler, 2)
      if (self%full_above >= 0.0_wp) then
         if (self%field%degree == self%field_degree) then
            call self%field%set_grains(self%euler)
         else
            call new_field(self%class, self%field_degree, self%euler, self%field, error)
         end if
         if (allocated(error)) return
         self%field_cost = self%field_cost + ellipse_time*self%n_independent &
            & + size(self%field%nodes, 2)*(node_time + mode_time*self%n_independent)
      end if
      self%full_cost = self%expansion%cost + theory_time*self%n_independent
      self%maps = reshape([real(wp) ::], &
         & [self%n_independent, self%polynomials%n_coordinates, self%logarithms%n], [0.0_wp])
      do i = 1, self%n_independent
         do k = 1, self%logarithms%n
            x = turned_coordinates(self%logarithms%basis(:, :, k), self%euler(:, i))
            self%maps(i, :, k) = x(:self%polynomials%n_coordinates)
         end do
      end do
      call expand_in_class()

   contains

      !> Set `own` and `expanded`, if that is cheaper: least squares over random points, which is
      !> exact for polynomials.
      subroutine expand_in_class()
         type(random_stream_type) :: stream
         real(wp), allocatable :: products(:, :), values(:, :), gram(:, :), terms(:, :)
         real(wp) :: w(self%logarithms%n)
         integer :: j, n

         self%own%n_products = 0
         if (self%polynomials%n == 0) return
         k = self%logarithms%n - merge(0, 1, self%polynomials%n_coordinates == n_coordinates)
         n = maxval(self%polynomials%degrees)
         if (count_products(k, n, .true.) > self%polynomials%n) return
         self%own = new_legendre_products(k, n, .true.)
         n = self%own%n_products
         allocate (products(n, 2*n), values(self%n_independent*(1 + self%n_columns), 2*n))
         stream = new_random_stream(1, 1)
         do j = 1, 2*n
            call stream%normals(w)
            ! An isotropic stiffness of the middle scale has these two coordinates.
            w(:2) = w(:2) + self%polynomials%centre*sqrt([1.0_wp, 5.0_wp]/6.0_wp)
            terms = terms_of_grains(self, w)
            values(:self%n_independent, j) = matmul(terms, self%coefficients)
            if (self%n_columns > 0) then
               values(self%n_independent + 1:, j) = [matmul(terms, self%factor)]
            end if
            products(:, j) = own_products(self, w)
         end do
         gram = gram_of(products)
         call cholesky_factor(gram, error)
         self%expanded = matmul(products, transpose(values))
         if (allocated(error)) return
         call cholesky_solve(gram, self%expanded)
      end subroutine expand_in_class
   end subroutine set_grains

   !> Products of polynomials of log(3K/2G), of the anisotropic coordinates and, if y depends on it,
   !> of the scale.
   pure function own_products(self, w) result(products)
      class(correction_grain_model_type), intent(in) :: self
      !> Coordinates of log K in the class.
      real(wp), intent(in) :: w(:)
      real(wp) :: products(self%own%n_products), x(size(w))

      x = [(sqrt(5.0_wp)*w(1) - w(2))/sqrt(6.0_wp), w(3:), &
         & (w(1) + sqrt(5.0_wp)*w(2))/sqrt(6.0_wp) - self%polynomials%centre]
      call evaluate_products(self%own, x/3.0_wp, products)
   end function own_products

   !> The polynomials of a crystal in the orientations that are computed, (n_independent, n_terms).
   pure function terms_of_grains(self, w) result(terms)
      class(correction_grain_model_type), intent(in) :: self
      !> Coordinates of log K in the class.
      real(wp), intent(in) :: w(:)
      !> Allocatable, since they are too large for the stack of a thread if there are many grains.
      real(wp), allocatable :: terms(:, :), x(:, :)
      integer :: k

      allocate (terms(self%n_independent, self%polynomials%n), &
         & x(self%n_independent, self%polynomials%n_coordinates), source=0.0_wp)
      do k = 1, size(w)
         x = x + w(k)*self%maps(:, :, k)
      end do
      call evaluate_polynomials(self%polynomials, x, terms)
   end function terms_of_grains

   pure subroutine evaluate_crystals(self, c, modulus)
      class(correction_grain_model_type), intent(in) :: self
      real(wp), intent(in), contiguous :: c(:, :, :)
      real(wp), intent(out), contiguous :: modulus(:, :)
      !> Moduli that are computed, (n_independent, crystal).
      real(wp), allocatable :: independent(:, :)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp) :: w(self%logarithms%n), y(self%n_independent)
      integer :: i, k

      allocate (independent(self%n_independent, size(c, 3)))
      ! With a negative limit no crystal uses the field.
      if (self%full_above >= 0.0_wp) call field_moduli(self%field, c, independent)
      do i = 1, size(c, 3)
         if (self%full_above >= huge(1.0_wp)) exit
         if (log_anisotropy(c(:, :, i)) <= self%full_above) cycle
         do k = 1, self%n_independent
            call halfspace_modulus(c(:, :, i), self%euler(:, k), theory, error)
            independent(k, i) = theory%modulus
         end do
      end do
      do i = 1, size(c, 3)
         if (self%polynomials%n == 0) exit
         w = self%domain%nearest(self%logarithms%to_logarithms(c(:, :, i)))
         if (self%own%n_products > 0) then
            call transposed_product(self%expanded(:, :size(y)), own_products(self, w), y)
         else
            y = matmul(terms_of_grains(self, w), self%coefficients)
         end if
         independent(:, i) = independent(:, i)*exp(y)
      end do
      call self%expansion%expand(independent, modulus)
   end subroutine evaluate_crystals

   pure subroutine evaluate_columns(self, c, columns)
      class(correction_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> (n, n_columns).
      real(wp), intent(out), contiguous :: columns(:, :)
      real(wp), allocatable :: independent(:, :)
      real(wp) :: w(self%logarithms%n)

      allocate (independent(self%n_independent, self%n_columns))
      w = self%domain%nearest(self%logarithms%to_logarithms(c))
      if (self%own%n_products > 0) then
         call transposed_product(self%expanded(:, self%n_independent + 1:), &
            & own_products(self, w), independent)
      else
         call multiply(terms_of_grains(self, w), self%factor, independent)
      end if
      independent = independent/spread_of(self%noise_growth, c)
      call self%expansion%expand(independent, columns)
   end subroutine evaluate_columns

end module correction_basis
