!> The exact theory of the half-space, for crystals of every class, times a correction of the specimen: M = M_theory exp(y).
!>
!> Theory has the crystal's own anisotropy. y is a polynomial of the logarithm of the Kelvin stiffness in the frame of the indenter, which
!> does not change when the crystal is turned about the axis, nor with its scale unless the domain states a
!> range of that; its coefficients are the less likely to be large the higher their degree. Terms of the highest degree that the
!> simulations have not decided are the misfit of the others: a function of the crystal, which grains of like orientation share.
!>
!> The model 'halfspace' has no terms, and needs no simulation: its error is that of the expansion of the surface compliance, see
!> `compliance_field`.
!>
!> The polynomials are those of the coordinates of a stiffness about the indenter's axis that do not change when the crystal is turned about
!> that axis or mirrored: what a specimen with axial symmetry may depend on.
!>
!> Each is the real part of a product of order 0: numbers of order 0, and waves and conjugate waves whose orders cancel. There are 1, 5,
!> 29, 141 of them up to degree 0, 1, 2, 3, and 1, 6, 35, 176 where the scale of the stiffness is one of the numbers. Each has a factor
!> such that for two points the sum of the products of those of degree d is the mean of (x x')^d over all turns and mirrors of one of
!> them: equal coefficients prefer no basis of the coordinates.
module correction_basis
   use abstract_basis, only: basis_type, grain_model_type, growth_power, spread_of
   use compliance_field, only: field_moduli, field_type, modulus_expansion_type, new_field, new_modulus_expansion
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: log_anisotropy, rotation_matrix
   use errors, only: error_type, refuse
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use linear_algebra, only: add_gram, cholesky_factor, multiply, symmetric_eigen
   use logarithmic_coordinates, only: axial_coordinates_of, kelvin_rotation, log_coordinates_type, logarithm_of, n_axial, &
      & n_coordinates, n_waves, new_log_coordinates, wave_orders
   use statistics, only: sort_order
   use surrogate_domain, only: spread_crystals
   use text, only: to_text
   implicit none
   private
   public :: correction_basis_type, axial_polynomials_type, new_axial_polynomials, evaluate_polynomials, greatest_degree

   integer, parameter :: greatest_degree = 4
   !> Factors, numbered as the coordinates: numbers of order 0, waves, in place of imaginary parts their conjugates, the scale.
   integer, parameter :: n_factors = n_coordinates
   integer, parameter :: orders(n_factors) = [[0, 0, 0, 0], wave_orders, -wave_orders, 0]

   type :: axial_polynomials_type
      integer :: n = 0
      !> The coordinates that they depend on: all, or all but the last, which is the scale.
      integer :: n_coordinates = 0
      !> Degree of each, (n), ascending.
      integer, allocatable :: degrees(:)
      !> The factors of each, 0 for the number 1, (greatest_degree, n).
      integer, allocatable, private :: factors(:, :)
      !> The scale is counted from here.
      real(wp), private :: centre = 0.0_wp
      !> Before the product, (n).
      real(wp), allocatable, private :: weights(:)
   end type axial_polynomials_type

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
      procedure :: set_up, exchange, evaluate_many, new_grain_model
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
      procedure :: set_grains, evaluate_independent, evaluate_columns, expand
   end type correction_grain_model_type

contains

   !> All up to a degree.
   pure type(axial_polynomials_type) function new_axial_polynomials(degree, centre) result(self)
      !> 0 to `greatest_degree`.
      integer, intent(in) :: degree
      !> The value from which the last coordinate, the scale, is counted; without it they do not depend on that.
      real(wp), intent(in), optional :: centre
      integer :: chosen(greatest_degree), d, k, last

      self%n_coordinates = n_coordinates - 1
      last = n_factors - 1
      if (present(centre)) then
         self%n_coordinates = n_coordinates
         last = n_factors
         self%centre = centre
      end if
      allocate (self%degrees(1), self%factors(greatest_degree, 1), self%weights(1))
      self%degrees = 0
      self%factors = 0
      self%weights = 1.0_wp
      do d = 1, degree
         ! Every product of d factors in ascending order.
         chosen = 0
         chosen(:d) = 1
         do
            if (sum(orders(chosen(:d))) == 0) call append_if_first(chosen, d)
            k = d
            do while (k > 0)
               if (chosen(k) < last) exit
               k = k - 1
            end do
            if (k == 0) exit
            chosen(k:d) = chosen(k) + 1
         end do
      end do
      self%n = size(self%degrees)

   contains

      !> A product and its conjugate have the same real part: the first of the two counts.
      pure subroutine append_if_first(product, d)
         integer, intent(in) :: product(greatest_degree), d
         integer :: conjugate(d), order(d), i, k
         real(wp) :: square

         conjugate = product(:d)
         where (is_wave(conjugate)) conjugate = conjugate + merge(n_waves, -n_waves, conjugate <= n_axial + n_waves)
         call sort_order(real(conjugate, wp), order)
         conjugate = conjugate(order)
         i = findloc(conjugate /= product(:d), .true., 1)
         if (i > 0) then
            if (conjugate(i) < product(i)) return
         end if
         ! d!/(n1! n2! ..) of the factors' powers; half for each wave; twice if the product is not its own conjugate.
         square = 1.0_wp
         do k = 1, d
            square = square*k/count(product(:k) == product(k))
            if (is_wave(product(k))) square = 0.5_wp*square
         end do
         if (i > 0) square = 2.0_wp*square
         self%weights = [self%weights, sqrt(square)]
         self%degrees = [self%degrees, d]
         self%factors = reshape([self%factors, product], [greatest_degree, size(self%degrees)])
      end subroutine append_if_first
   end function new_axial_polynomials

   !> Whether a factor is a wave or a conjugate wave.
   pure elemental logical function is_wave(factor)
      integer, intent(in) :: factor

      is_wave = orders(factor) /= 0
   end function is_wave

   !> All at points, which are worked on side by side.
   pure subroutine evaluate_polynomials(self, x, values)
      type(axial_polynomials_type), intent(in) :: self
      !> Coordinates about the axis of each point, (point, self%n_coordinates).
      real(wp), intent(in), contiguous :: x(:, :)
      !> (point, n).
      real(wp), intent(out), contiguous :: values(:, :)
      complex(wp) :: factors(size(x, 1), n_factors), product(size(x, 1), 0:greatest_degree)
      integer, parameter :: last_wave = n_axial + n_waves
      integer :: chosen(greatest_degree), i, k

      factors(:, :n_axial) = x(:, :n_axial)
      factors(:, n_axial + 1:last_wave) = cmplx(x(:, n_axial + 1:last_wave), x(:, last_wave + 1:last_wave + n_waves), wp)
      factors(:, last_wave + 1:last_wave + n_waves) = conjg(factors(:, n_axial + 1:last_wave))
      if (self%n_coordinates == n_coordinates) factors(:, n_coordinates) = x(:, n_coordinates) - self%centre
      product(:, 0) = 1.0_wp
      chosen = 0
      do k = 1, self%n
         ! The first factors are often those of the polynomial before.
         do i = max(1, findloc(self%factors(:, k) /= chosen, .true., 1)), self%degrees(k)
            product(:, i) = product(:, i - 1)*factors(:, self%factors(i, k))
         end do
         chosen = self%factors(:, k)
         values(:, k) = self%weights(k)*real(product(:, self%degrees(k)), wp)
      end do
   end subroutine evaluate_polynomials

   subroutine set_up(self, error)
      class(correction_basis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%logarithmic = .true.
      if (self%settings%model == 'halfspace') return
      associate (domain => self%domain, degree => self%settings%degree)
         if (degree < 1 .or. degree > greatest_degree) call refuse(error, 'degree = '//to_text(degree)//' is outside 1 .. ' &
            & //to_text(greatest_degree))
         if (allocated(error)) return
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
      if (self%n_terms > 0) call evaluate_polynomials(self%polynomials, x(:, :self%polynomials%n_coordinates), values)
      do i = 1, size(scale)
         terms(:, i) = values(i, :)/spread(i)
      end do
   end subroutine evaluate_many

   !> Coordinates about the indenter's axis of a matrix in crystal axes.
   pure function turned_coordinates(matrix, euler) result(x)
      real(wp), intent(in) :: matrix(6, 6)
      !> Bunge-Euler angles, radians.
      real(wp), intent(in) :: euler(3)
      real(wp) :: x(n_coordinates), turn(6, 6)

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
      real(wp) :: terms(last - first + 1, self%polynomials%n), x(last - first + 1, self%polynomials%n_coordinates)
      integer :: k

      x = 0.0_wp
      do k = 1, size(w)
         x = x + w(k)*self%maps(first:last, :, k)
      end do
      call evaluate_polynomials(self%polynomials, x, terms)
   end function terms_of_grains

   pure subroutine evaluate_independent(self, c, modulus)
      class(correction_grain_model_type), intent(in) :: self
      real(wp), intent(in), contiguous :: c(:, :, :)
      real(wp), intent(out), contiguous :: modulus(:, :)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp) :: w(self%logarithms%n)
      integer :: first, last, i

      ! A negative limit: none is read.
      if (self%full_above >= 0.0_wp) call field_moduli(self%field, c, modulus)
      do i = 1, size(c, 3)
         if (self%full_above >= huge(1.0_wp)) exit
         if (log_anisotropy(c(:, :, i)) <= self%full_above) cycle
         do first = 1, size(modulus, 1)
            call halfspace_modulus(c(:, :, i), self%euler(:, first), theory, error)
            modulus(first, i) = theory%modulus
         end do
      end do
      if (self%polynomials%n == 0) return
      do i = 1, size(c, 3)
         w = self%logarithms%to_logarithms(c(:, :, i))
         do first = 1, size(modulus, 1), at_once
            last = min(first + at_once - 1, size(modulus, 1))
            modulus(first:last, i) = modulus(first:last, i)*exp(matmul(terms_of_grains(self, w, first, last), self%coefficients))
         end do
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
