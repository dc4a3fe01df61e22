!> The posterior of the elastic constants given indentation moduli measured in grains of known orientation (Eqs. 12 and 13).
!>
!> The model of a measurement is m = f(M) (1 + e) + noise: f maps the indentation modulus M to the kind that was measured, e is a
!> relative error common to all grains (sd `calibration_sd`), and the noise is normal or Student t with the grain's sd, or that
!> sd times a common factor that is inferred. The surrogate's own uncertainty is correlated between grains, since one set of
!> coefficients predicts them all: its covariance is G T(c) Gᵀ with G = (df/dy) K, of the rank of the harmonics. So
!> V = D + U Uᵀ with a thin U, and |V| and V^-1 cost a matrix of the size of U's columns (Woodbury).
module constants_posterior
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr
   use constants_prior, only: prior_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: i8, pi, wp
   use polynomial_products, only: covariance_polynomial, evaluate_products, new_products, products_type
   use random, only: random_stream_type
   use sampling_target, only: target_type
   use surrogate_basis, only: basis_type, coordinates_dimensionless, evaluate_harmonics, raw_coordinates
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   use vector_math, only: exp_all, transposed_product
   implicit none
   private
   public :: posterior_type, new_posterior, likelihood_type
   public :: kind_indentation, kind_effective, kind_sample, kind_from_name
   public :: posterior_to_handle, posterior_from_handle

   !> What was measured: M itself; E_eff of the contact, 1/E_eff = 1/M + (1-nu_i²)/E_i; or (1-nu_s²) M.
   integer, parameter :: kind_indentation = 1, kind_effective = 2, kind_sample = 3

   !> Bounds of the common factor on the sds where it is inferred; its logarithm is uniform between them.
   real(wp), parameter :: least_factor = 0.05_wp, greatest_factor = 50.0_wp

   !> More, in GPa, is taken for MPa.
   real(wp), parameter :: greatest_modulus = 2000.0_wp
   !> Work arrays of a thread are on its stack.
   integer, parameter :: most_grains = 5000

   type :: likelihood_type
      integer :: modulus_kind = kind_indentation
      !> Of the indenter (GPa) and of the sample, for the kinds that need them.
      real(wp) :: indenter_modulus = 1140.0_wp, indenter_nu = 0.07_wp, sample_nu = 0.3_wp
      !> Relative sd of an error common to all grains.
      real(wp) :: calibration_sd = 0.0_wp
      !> Degrees of freedom of Student's t; 0 for normal errors.
      real(wp) :: student_t = 0.0_wp
      !> Infer a common factor on the sds: one more parameter, its logarithm.
      logical :: infer_scale = .false.
      !> Count the surrogate's uncertainty.
      logical :: surrogate_uncertainty = .true.
      !> Leave the data out: the prior alone.
      logical :: prior_only = .false.
   end type likelihood_type

   type, extends(target_type) :: posterior_type
      type(prior_type) :: prior
      type(likelihood_type) :: likelihood
      integer :: n_grains = 0, n_constants = 0
      integer, private :: n_harmonics = 0, n_columns = 0
      logical, private :: dimensionless = .false.
      !> Harmonics K(grain, h), measured values and their sds, GPa.
      real(wp), allocatable, private :: k(:, :), measured(:), sd(:)
      type(basis_type) :: basis
      type(products_type), private :: terms, squares
      !> Coefficients A(q, h), and those of T(c).
      real(wp), allocatable, private :: coefficients(:, :), covariance(:, :)
      !> Variance of y that is not correlated between grains.
      real(wp), private :: scatter = 0.0_wp
      !> Of the normal likelihood with the stated sds.
      real(wp), private :: constant = 0.0_wp
      !> (1-nu_i²)/E_i, 1/GPa.
      real(wp), private :: indenter_compliance = 0.0_wp
   contains
      procedure :: admits
      procedure :: log_density
      procedure :: log_likelihood
      procedure :: moduli
      procedure :: map_modulus
      procedure :: draw_moduli
      procedure :: to_working
      procedure :: from_working
      procedure :: log_volume
   end type posterior_type

contains

   !> A posterior of the heap as a 64-bit integer, to cross into Python.
   function posterior_to_handle(posterior) result(handle)
      type(posterior_type), pointer, intent(in) :: posterior
      integer(i8) :: handle

      handle = transfer(c_loc(posterior), handle)
   end function posterior_to_handle

   !> The posterior that a handle stands for.
   function posterior_from_handle(handle) result(posterior)
      integer(i8), intent(in) :: handle
      type(posterior_type), pointer :: posterior
      type(c_ptr) :: address

      address = transfer(handle, address)
      call c_f_pointer(address, posterior)
   end function posterior_from_handle

   pure integer function kind_from_name(name) result(kind)
      character(len=*), intent(in) :: name

      select case (name)
      case ('indentation_modulus')
         kind = kind_indentation
      case ('effective_modulus')
         kind = kind_effective
      case ('sample_modulus')
         kind = kind_sample
      case default
         kind = 0
      end select
   end function kind_from_name

   !> The posterior for n grains: Bunge-Euler angles (radians), measured values and standard errors (GPa).
   subroutine new_posterior(surrogate, prior, likelihood, euler, measured, sd, posterior, error)
      type(surrogate_type), intent(in) :: surrogate
      type(prior_type), intent(in) :: prior
      type(likelihood_type), intent(in) :: likelihood
      real(wp), intent(in) :: euler(:, :), measured(:), sd(:)
      type(posterior_type), intent(out) :: posterior
      type(error_type), allocatable, intent(out) :: error
      integer :: i, n

      n = size(measured)
      if (size(euler, 2) /= n .or. size(sd) /= n) then
         call raise(error, 'angles, moduli and sds are needed for the same number of grains', exit_bad_input)
      else if (n == 0 .and. .not. likelihood%prior_only) then
         call raise(error, 'there are no measurements: at least one grain is needed', exit_bad_input)
      else if (n > most_grains) then
         call raise(error, to_text(n)//' grains are more than the '//to_text(most_grains)//' that are allowed', exit_bad_input)
      else if (.not. (all(measured > 0.0_wp .and. measured < huge(1.0_wp)) .and. all(abs(euler) < huge(1.0_wp)))) then
         call raise(error, 'a measured modulus is not positive, or a value is not finite', exit_bad_input)
      else if (any(measured > greatest_modulus)) then
         call raise(error, 'a measured modulus of '//to_text(maxval(measured))//' GPa looks like MPa; allowed up to ' &
            & //to_text(greatest_modulus)//' GPa', exit_bad_input)
      else if (.not. all(sd > 0.0_wp .and. sd < huge(1.0_wp))) then
         call raise(error, 'the sd of a measurement must be positive and finite', exit_bad_input)
      else if (likelihood%modulus_kind < kind_indentation .or. likelihood%modulus_kind > kind_sample) then
         call raise(error, 'modulus_kind: allowed are ''indentation_modulus'', ''effective_modulus'', ''sample_modulus''', &
            & exit_bad_input)
      else if (.not. (likelihood%calibration_sd >= 0.0_wp .and. likelihood%calibration_sd < 1.0_wp)) then
         call raise(error, 'calibration_sd = '//to_text(likelihood%calibration_sd)//' is relative: 0 <= calibration_sd < 1', &
            & exit_bad_input)
      else if (.not. (likelihood%student_t >= 0.0_wp .and. likelihood%student_t < huge(1.0_wp))) then
         call raise(error, 'student_t = '//to_text(likelihood%student_t)//' must be positive, or 0 for normal errors', &
            & exit_bad_input)
      else if (.not. (likelihood%indenter_modulus > 0.0_wp .and. abs(likelihood%indenter_nu) < 1.0_wp &
         & .and. likelihood%sample_nu > -1.0_wp .and. likelihood%sample_nu <= 0.5_wp)) then
         call raise(error, 'the indenter''s modulus must be positive, its Poisson ratio within -1 .. 1, and the sample''s ' &
            & //'within -1 .. 0.5', exit_bad_input)
      end if
      if (allocated(error)) return
      posterior%prior = prior
      posterior%likelihood = likelihood
      posterior%basis = surrogate%basis
      posterior%dimensionless = surrogate%basis%coordinates == coordinates_dimensionless
      posterior%n_grains = n
      posterior%n_constants = prior%n_constants
      posterior%n_harmonics = surrogate%basis%n_harmonics
      posterior%indenter_compliance = (1.0_wp - likelihood%indenter_nu**2)/likelihood%indenter_modulus
      posterior%measured = measured
      posterior%sd = sd
      posterior%constant = -sum(log(sd)) - 0.5_wp*n*log(2.0_wp*pi)
      allocate (posterior%k(n, posterior%n_harmonics))
      do i = 1, n
         call evaluate_harmonics(surrogate%basis, euler(:, i), posterior%k(i, :))
      end do
      posterior%terms = new_products(surrogate%basis%degrees)
      posterior%coefficients = transpose(surrogate%coefficients)
      if (likelihood%surrogate_uncertainty) then
         posterior%scatter = surrogate%sd_inflation**2/surrogate%beta
         posterior%n_columns = posterior%n_harmonics
         call covariance_polynomial(surrogate%basis, surrogate%sd_inflation**2*surrogate%covariance, posterior%squares, &
            & posterior%covariance)
      end if
      if (likelihood%calibration_sd > 0.0_wp) posterior%n_columns = posterior%n_columns + 1
      posterior%dimension = prior%n_constants
      posterior%lower = prior%lower
      posterior%upper = prior%upper
      if (likelihood%infer_scale) then
         posterior%dimension = posterior%dimension + 1
         posterior%lower = [posterior%lower, log(least_factor)]
         posterior%upper = [posterior%upper, log(greatest_factor)]
      end if
   end subroutine new_posterior

   pure logical function admits(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      admits = self%prior%admits(x)
      if (admits .and. self%likelihood%infer_scale) then
         admits = x(self%dimension) >= self%lower(self%dimension) .and. x(self%dimension) <= self%upper(self%dimension)
      end if
   end function admits

   pure real(wp) function log_density(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      log_density = self%prior%log_density(x)
      if (.not. self%likelihood%prior_only) log_density = log_density + self%log_likelihood(x)
   end function log_density

   !> Logarithms of stiffnesses, in which moduli are nearly linear and ridges nearly straight. Cubic: bulk modulus, C11 - C12, C44.
   !> Hexagonal, with r = sqrt(C11 C33): r - C13, r + C13, C44, C11 - C12 and the ratio C33/C11. All exist for stable crystals.
   pure subroutine to_working(self, x, w)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: w(:)
      real(wp) :: r

      w = x(:self%dimension)
      if (self%n_constants == 3) then
         w(:3) = log([x(1) + 2.0_wp*x(2), x(1) - x(2), x(3)])
      else
         r = sqrt(x(1)*x(4))
         w(:5) = log([r - x(5), r + x(5), x(3), x(1) - x(2), x(4)/x(1)])
      end if
   end subroutine to_working

   pure subroutine from_working(self, w, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: x(:)
      real(wp) :: e(5), r, ratio

      x = w(:self%dimension)
      e(:self%n_constants) = exp(min(50.0_wp, w(:self%n_constants)))
      if (self%n_constants == 3) then
         x(1) = (e(1) + 2.0_wp*e(2))/3.0_wp
         x(2) = (e(1) - e(2))/3.0_wp
         x(3) = e(3)
      else
         r = 0.5_wp*(e(1) + e(2))
         ratio = sqrt(e(5))
         x(1) = r/ratio
         x(2) = x(1) - e(4)
         x(3) = e(3)
         x(4) = r*ratio
         x(5) = 0.5_wp*(e(2) - e(1))
      end if
   end subroutine from_working

   pure real(wp) function log_volume(self, w)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: w(:)

      log_volume = sum(w(:3))
      if (self%n_constants == 5) log_volume = log_volume + w(4) + log(exp(w(1)) + exp(w(2)))
   end function log_volume

   !> y(h) = sum over q of A(h, q) P_q at a crystal, its scale s, and its coordinates in [-1, 1].
   pure subroutine evaluate_surrogate(self, c, y, scale, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: c(:)
      real(wp), intent(out) :: y(:), scale, x(:)
      real(wp) :: p(self%terms%n_products)

      call raw_coordinates(self%prior%symmetry, self%basis%coordinates, c(:self%n_constants), x, scale)
      x = (2.0_wp*x - self%basis%lower - self%basis%upper) &
         & /(self%basis%upper - self%basis%lower)
      call evaluate_products(self%terms, x, p)
      call transposed_product(self%terms%n_products, self%n_harmonics, self%coefficients, p, y)
   end subroutine evaluate_surrogate

   !> Indentation modulus (GPa) of the grains whose harmonics are k(grain, h), and dM/dy.
   pure subroutine evaluate_moduli(self, k, y, scale, modulus, slope)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in), contiguous :: k(:, :)
      real(wp), intent(in) :: y(:), scale
      real(wp), intent(out), contiguous :: modulus(:), slope(:)
      integer :: i, h

      slope = 0.0_wp
      do h = 1, self%n_harmonics
         !$omp simd
         do i = 1, size(slope)
            slope(i) = slope(i) + k(i, h)*y(h)
         end do
      end do
      if (self%dimensionless) then
         call exp_all(slope, modulus)
         modulus = scale*modulus
         slope = modulus
      else
         modulus = slope
         slope = 1.0_wp
      end if
   end subroutine evaluate_moduli

   !> From indentation modulus to the kind that was measured, value and slope, in place.
   pure subroutine map_modulus(self, modulus, slope)
      class(posterior_type), intent(in) :: self
      real(wp), intent(inout) :: modulus(:), slope(:)

      select case (self%likelihood%modulus_kind)
      case (kind_effective)
         slope = slope/(1.0_wp + self%indenter_compliance*modulus)**2
         modulus = modulus/(1.0_wp + self%indenter_compliance*modulus)
      case (kind_sample)
         slope = slope*(1.0_wp - self%likelihood%sample_nu**2)
         modulus = modulus*(1.0_wp - self%likelihood%sample_nu**2)
      case default
         ! The indentation modulus is what the model gives.
      end select
   end subroutine map_modulus

   !> Indentation moduli (GPa) that the mean surrogate gives the grains at a point.
   pure subroutine moduli(self, x, values)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out), contiguous :: values(:)
      real(wp) :: y(self%n_harmonics), coordinates(self%terms%n_coordinates), scale, slope(self%n_grains)

      call evaluate_surrogate(self, x, y, scale, coordinates)
      call evaluate_moduli(self, self%k, y, scale, values, slope)
   end subroutine moduli

   !> Logarithm of Eq. 13 and its extensions, normalised over the measurements.
   pure real(wp) function log_likelihood(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp) :: y(self%n_harmonics), coordinates(self%terms%n_coordinates), scale
      real(wp) :: model(self%n_grains), slope(self%n_grains), sd(self%n_grains), residual(self%n_grains)
      real(wp) :: u(self%n_grains, self%n_columns), b(self%n_columns), gram(self%n_columns, self%n_columns), factor, total
      integer :: i

      call evaluate_surrogate(self, x, y, scale, coordinates)
      call evaluate_moduli(self, self%k, y, scale, model, slope)
      call self%map_modulus(model, slope)
      factor = 1.0_wp
      if (self%likelihood%infer_scale) factor = exp(x(self%dimension))
      if (self%n_columns == 0 .and. self%likelihood%student_t == 0.0_wp) then
         total = 0.0_wp
         !$omp simd reduction(+:total)
         do i = 1, self%n_grains
            total = total + ((model(i) - self%measured(i))/self%sd(i))**2
         end do
         log_likelihood = -0.5_wp*total/factor**2 - self%n_grains*log(factor) + self%constant
         return
      end if
      sd = factor*self%sd
      if (self%scatter > 0.0_wp) sd = sqrt(sd**2 + self%scatter*slope**2)
      residual = (self%measured - model)/sd
      call whitened_columns(self, coordinates, model, slope, sd, u)
      if (self%likelihood%student_t > 0.0_wp) then
         call integrate_student(residual, u, self%likelihood%student_t, b, gram, log_likelihood)
      else
         call integrate_normal(residual, u, b, gram, log_likelihood)
         log_likelihood = log_likelihood - 0.5_wp*self%n_grains*log(2.0_wp*pi)
      end if
      log_likelihood = log_likelihood - sum_of_logs(sd)
   end function log_likelihood

   !> Sum of the logarithms of positive numbers of ordinary size: one logarithm for eight of them.
   pure real(wp) function sum_of_logs(values)
      real(wp), intent(in) :: values(:)
      integer :: i

      sum_of_logs = 0.0_wp
      do i = 1, size(values), 8
         sum_of_logs = sum_of_logs + log(product(values(i:min(i + 7, size(values)))))
      end do
   end function sum_of_logs

   !> Columns of U over the sds: the surrogate's correlated errors, then the calibration's.
   pure subroutine whitened_columns(self, coordinates, model, slope, sd, u)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: coordinates(:), model(:), slope(:), sd(:)
      real(wp), intent(out) :: u(:, :)
      real(wp) :: factor(self%n_harmonics, self%n_harmonics), ratio(size(sd))
      integer :: h, g

      if (self%likelihood%surrogate_uncertainty) then
         call covariance_factor(self, coordinates, factor)
         ratio = slope/sd
         do g = 1, self%n_harmonics
            u(:, g) = 0.0_wp
            do h = g, self%n_harmonics
               u(:, g) = u(:, g) + self%k(:, h)*factor(h, g)
            end do
            u(:, g) = u(:, g)*ratio
         end do
      end if
      if (self%likelihood%calibration_sd > 0.0_wp) u(:, self%n_columns) = self%likelihood%calibration_sd*model/sd
   end subroutine whitened_columns

   !> Lower factor of T(c); directions without variance are left out.
   pure subroutine covariance_factor(self, coordinates, factor)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: coordinates(:)
      real(wp), intent(out) :: factor(:, :)
      real(wp) :: p(self%squares%n_products), pairs(size(self%covariance, 2))
      integer :: g, first, n

      call evaluate_products(self%squares, coordinates, p)
      call transposed_product(size(p), size(pairs), self%covariance, p, pairs)
      n = self%n_harmonics
      factor = 0.0_wp
      first = 1
      do g = 1, n
         factor(g:, g) = pairs(first:first + n - g)
         first = first + n - g + 1
      end do
      call small_cholesky(factor)
   end subroutine covariance_factor

   !> Lower Cholesky factor in place; a column whose pivot is lost to rounding becomes zero.
   pure subroutine small_cholesky(a)
      real(wp), intent(inout) :: a(:, :)
      real(wp) :: pivot, whole
      integer :: j, i

      do j = 1, size(a, 1)
         whole = a(j, j)
         pivot = whole - sum(a(j, :j - 1)**2)
         if (pivot > 1.0e-13_wp*whole) then
            a(j, j) = sqrt(pivot)
            do i = j + 1, size(a, 1)
               a(i, j) = (a(i, j) - sum(a(i, :j - 1)*a(j, :j - 1)))/a(j, j)
            end do
         else
            a(j:, j) = 0.0_wp
         end if
      end do
   end subroutine small_cholesky

   !> Solve (L Lᵀ) x = b in place.
   pure subroutine small_solve(l, b)
      real(wp), intent(in) :: l(:, :)
      real(wp), intent(inout) :: b(:)
      integer :: j

      do j = 1, size(b)
         b(j) = (b(j) - sum(l(j, :j - 1)*b(:j - 1)))/l(j, j)
      end do
      do j = size(b), 1, -1
         b(j) = (b(j) - sum(l(j + 1:, j)*b(j + 1:)))/l(j, j)
      end do
   end subroutine small_solve

   !> log of the integral of N(r; U b, 1) N(b; 0, 1) over b, without the constant of the first; `b` is the mean of b given r and
   !> `l` the factor of its precision.
   pure subroutine integrate_normal(r, u, b, l, value)
      real(wp), intent(in) :: r(:), u(:, :)
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp) :: rhs(size(b)), ones(size(r))
      integer :: j

      ones = 1.0_wp
      call weighted_gram(u, ones, l)
      do j = 1, size(b)
         rhs(j) = sum(u(:, j)*r)
      end do
      call small_cholesky(l)
      b = rhs
      call small_solve(l, b)
      value = -0.5_wp*(sum(r**2) - sum(rhs*b))
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate_normal

   !> The same with Student's t for the first factor, its constant included, by Laplace's approximation about the mode.
   pure subroutine integrate_student(r, u, dof, b, l, value)
      real(wp), intent(in) :: r(:), u(:, :), dof
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp) :: e(size(r)), weight(size(r)), before(size(b))
      integer :: j, step
      logical :: definite

      b = 0.0_wp
      e = r
      do step = 1, 40
         if (size(b) == 0) exit
         weight = (dof + 1.0_wp)/(dof + e**2)
         call weighted_gram(u, weight, l)
         call small_cholesky(l)
         before = b
         do j = 1, size(b)
            b(j) = sum(u(:, j)*weight*r)
         end do
         call small_solve(l, b)
         e = r - matmul(u, b)
         if (maxval(abs(b - before)) < 1.0e-9_wp) exit
      end do
      value = size(r)*(log_gamma(0.5_wp*(dof + 1.0_wp)) - log_gamma(0.5_wp*dof) - 0.5_wp*log(pi*dof)) &
         & - 0.5_wp*(dof + 1.0_wp)*sum_of_logs(1.0_wp + e**2/dof) - 0.5_wp*sum(b**2)
      if (size(b) == 0) return
      weight = (dof + 1.0_wp)*(dof - e**2)/(dof + e**2)**2
      call weighted_gram(u, weight, l)
      call small_cholesky(l)
      definite = .true.
      do j = 1, size(b)
         definite = definite .and. l(j, j) > 0.0_wp
      end do
      if (.not. definite) then
         ! Outliers outweigh the rest: the expected curvature of Student's t stands in for the observed one.
         weight = (dof + 1.0_wp)/(dof + 3.0_wp)
         call weighted_gram(u, weight, l)
         call small_cholesky(l)
      end if
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate_student

   !> I + Uᵀ W U, lower triangle.
   pure subroutine weighted_gram(u, weight, gram)
      real(wp), intent(in) :: u(:, :), weight(:)
      real(wp), intent(out) :: gram(:, :)
      real(wp) :: total
      integer :: g, h, i

      gram = 0.0_wp
      do g = 1, size(u, 2)
         do h = g, size(u, 2)
            total = 0.0_wp
            !$omp simd reduction(+:total)
            do i = 1, size(u, 1)
               total = total + u(i, h)*weight(i)*u(i, g)
            end do
            gram(h, g) = total
         end do
         gram(g, g) = gram(g, g) + 1.0_wp
      end do
   end subroutine weighted_gram

   !> Indentation moduli (GPa) of any grains at a point, with the surrogate's error drawn given the data; `factor` is one plus the
   !> calibration error drawn likewise. Without these uncertainties the moduli are the mean surrogate's and the factor is 1.
   subroutine draw_moduli(self, x, k, stream, values, factor)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      !> Harmonics k(grain, h).
      real(wp), intent(in), contiguous :: k(:, :)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out), contiguous :: values(:)
      real(wp), intent(out) :: factor
      real(wp) :: y(self%n_harmonics), coordinates(self%terms%n_coordinates), scale, value
      real(wp) :: model(self%n_grains), slope(self%n_grains), sd(self%n_grains), new_slope(size(values))
      real(wp) :: u(self%n_grains, self%n_columns), b(self%n_columns), gram(self%n_columns, self%n_columns)
      real(wp) :: z(self%n_columns), lower(self%n_harmonics, self%n_harmonics)
      integer :: j

      factor = 1.0_wp
      call evaluate_surrogate(self, x, y, scale, coordinates)
      call evaluate_moduli(self, k, y, scale, values, new_slope)
      if (self%n_columns == 0) return
      call evaluate_moduli(self, self%k, y, scale, model, slope)
      call self%map_modulus(model, slope)
      sd = self%sd
      if (self%likelihood%infer_scale) sd = exp(x(self%dimension))*sd
      if (self%scatter > 0.0_wp) sd = sqrt(sd**2 + self%scatter*slope**2)
      call whitened_columns(self, coordinates, model, slope, sd, u)
      if (self%likelihood%student_t > 0.0_wp) then
         call integrate_student((self%measured - model)/sd, u, self%likelihood%student_t, b, gram, value)
      else
         call integrate_normal((self%measured - model)/sd, u, b, gram, value)
      end if
      do j = 1, self%n_columns
         call stream%normal(z(j))
      end do
      ! b + L^-ᵀ z has the covariance (L Lᵀ)^-1.
      do j = self%n_columns, 1, -1
         z(j) = (z(j) - sum(gram(j + 1:, j)*z(j + 1:)))/gram(j, j)
      end do
      b = b + z
      if (self%likelihood%calibration_sd > 0.0_wp) factor = 1.0_wp + self%likelihood%calibration_sd*b(self%n_columns)
      if (self%likelihood%surrogate_uncertainty) then
         call covariance_factor(self, coordinates, lower)
         values = values + new_slope*matmul(k, matmul(lower, b(:self%n_harmonics)))
      end if
   end subroutine draw_moduli
end module constants_posterior
