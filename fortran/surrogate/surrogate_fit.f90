!> A surrogate from simulated moduli: the domain and its coordinates, the prior of the coefficients, the fit, and how honest its
!> standard deviations are. Both programs fit here.
module surrogate_fit
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: anisotropy_index, is_stable
   use errors, only: error_type, exit_bad_input, raise
   use evidence_regression, only: add_data, coefficient_covariance, coefficient_mean, leave_groups_out, maximise_evidence, &
      & new_regression, regression_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: pi, wp
   use linear_algebra, only: multiply
   use surrogate_basis, only: basis_type, coordinate_count, coordinates_box, coordinates_dimensionless, evaluate_terms, &
      & new_basis, raw_coordinates
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: domain_type, fit_options_type, fit_surrogate, coordinate_ranges, prior_weights, theory_coefficients, spread_crystals
   public :: least_noise_of, number_crystals, learn_inflation, inflation_of
   public :: prior_zero, prior_theory, prior_from_name

   integer, parameter :: prior_zero = 1, prior_theory = 2

   !> Born-stable crystals between bounds (GPa) whose anisotropy index (Eq. 14) does not exceed a cap.
   type :: domain_type
      type(crystal_class_type) :: class
      real(wp), allocatable :: lower(:), upper(:)
      real(wp) :: anisotropy_cap = huge(1.0_wp)
   end type domain_type

   type :: fit_options_type
      integer :: coordinates = 0, truncation = 0, degree = 0, bandlimit = 0
      integer :: prior = prior_theory
   end type fit_options_type

   !> Points from which the ranges of ratios are taken, and by how much these are widened, relative to the range.
   integer, parameter :: range_points = 2**15
   real(wp), parameter :: range_margin = 0.02_wp
   !> Evaluations of the half-space theory behind the informative prior; the variance of a coefficient falls eightfold for each
   !> degree of its polynomial, and as much for every four degrees of its harmonic; the constant term is almost free.
   integer, parameter :: theory_points = 10000
   real(wp), parameter :: fall = 8.0_wp, level_per_degree = 4.0_wp, constant_weight = 1.0e-4_wp
   !> Least sd of the noise that evidence maximisation may believe: GPa for a box, relative for dimensionless coordinates.
   real(wp), parameter :: least_noise_box = 0.05_wp, least_noise_dimensionless = 5.0e-4_wp
   !> The factor on the sds that is learnt from crystals left out: so many more count as if they agreed with their sds; its bound.
   real(wp), parameter :: agreeing = 20.0_wp, inflation_most = 3.0_wp
   !> Evaluations of the theory against which the sds must hold, and the share of them that z = `normal_90` must cover.
   integer, parameter :: misfit_points = 2000
   real(wp), parameter :: covered = 0.9_wp, normal_90 = 1.6448536269514722_wp

contains

   pure integer function prior_from_name(name) result(prior)
      character(len=*), intent(in) :: name

      prior = 0
      if (name == 'zero') prior = prior_zero
      if (name == 'theory') prior = prior_theory
   end function prior_from_name

   pure real(wp) function least_noise_of(coordinates) result(sd)
      integer, intent(in) :: coordinates

      sd = merge(least_noise_dimensionless, least_noise_box, coordinates == coordinates_dimensionless)
   end function least_noise_of

   !> Whether a crystal is in the domain.
   pure logical function is_admissible(domain, constants)
      type(domain_type), intent(in) :: domain
      real(wp), intent(in) :: constants(:)
      real(wp) :: c(6, 6)

      is_admissible = .false.
      if (any(constants < domain%lower) .or. any(constants > domain%upper)) return
      c = domain%class%stiffness(constants)
      if (.not. is_stable(c)) return
      is_admissible = anisotropy_index(c) <= domain%anisotropy_cap
   end function is_admissible

   !> The first n admissible crystals of a Halton sequence in the box, with indentation directions uniform on the sphere.
   subroutine spread_crystals(domain, n, constants, euler, error)
      type(domain_type), intent(in) :: domain
      integer, intent(in) :: n
      !> Constants (k, n), GPa; Bunge-Euler angles (3, n), radians.
      real(wp), allocatable, intent(out) :: constants(:, :), euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: bases(8) = [2, 3, 5, 7, 11, 13, 17, 19]
      !> An empty domain shows after this many points.
      integer, parameter :: most_trials = 20000000, least_share = 10000
      real(wp) :: u(8)
      integer :: found, trial, k, j

      k = size(domain%lower)
      allocate (constants(k, n), euler(3, n))
      found = 0
      do trial = 1, most_trials
         if (found == n) return
         if (trial > 1000000 .and. found < trial/least_share) exit
         do j = 1, k + 3
            u(j) = radical_inverse(trial, bases(j))
         end do
         constants(:, found + 1) = domain%lower + u(:k)*(domain%upper - domain%lower)
         if (.not. is_admissible(domain, constants(:, found + 1))) cycle
         found = found + 1
         ! Phi within 0..90 degrees: a direction and its opposite are the same indentation.
         euler(:, found) = [2.0_wp*pi*u(k + 1), acos(1.0_wp - u(k + 2)), 2.0_wp*pi*u(k + 3)]
      end do
      if (found < n) call raise(error, 'the domain holds (almost) no stable crystal below its anisotropy cap of ' &
         & //to_text(domain%anisotropy_cap), exit_bad_input)
   end subroutine spread_crystals

   !> Van der Corput's sequence: the digits of i in a base, mirrored at the point.
   pure real(wp) function radical_inverse(i, base) result(u)
      integer, intent(in) :: i, base
      integer :: rest
      real(wp) :: unit

      u = 0.0_wp
      unit = 1.0_wp/base
      rest = i
      do while (rest > 0)
         u = u + unit*mod(rest, base)
         rest = rest/base
         unit = unit/base
      end do
   end function radical_inverse

   !> Ranges of the raw coordinates: the bounds, or the ranges of the ratios over the domain, slightly widened.
   subroutine coordinate_ranges(domain, coordinates, lower, upper, error)
      type(domain_type), intent(in) :: domain
      integer, intent(in) :: coordinates
      real(wp), allocatable, intent(out) :: lower(:), upper(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: constants(:, :), euler(:, :), raw(:), margin(:), corner(:)
      real(wp) :: scale
      integer :: i, j, k, m

      if (coordinates == coordinates_box) then
         lower = domain%lower
         upper = domain%upper
         return
      end if
      call spread_crystals(domain, range_points, constants, euler, error)
      if (allocated(error)) return
      k = domain%class%n_constants
      m = coordinate_count(domain%class, coordinates)
      allocate (lower(m), upper(m), raw(m), corner(k))
      lower = huge(1.0_wp)
      upper = -huge(1.0_wp)
      do i = 1, range_points
         call raw_coordinates(domain%class, coordinates, constants(:, i), raw, scale)
         lower = min(lower, raw)
         upper = max(upper, raw)
      end do
      do i = 0, 2**k - 1
         do j = 1, k
            corner(j) = merge(domain%upper(j), domain%lower(j), btest(i, j - 1))
         end do
         if (.not. is_admissible(domain, corner)) cycle
         call raw_coordinates(domain%class, coordinates, corner, raw, scale)
         lower = min(lower, raw)
         upper = max(upper, raw)
      end do
      margin = range_margin*(upper - lower)
      lower = lower - margin
      upper = upper + margin
   end subroutine coordinate_ranges

   !> Relative precisions of the coefficients: all alike (Eq. 6), or rising with degree from an almost free constant term.
   pure function prior_weights(basis, prior) result(weights)
      type(basis_type), intent(in) :: basis
      integer, intent(in) :: prior
      real(wp) :: weights(basis%n_terms)
      integer :: h, q

      weights = 1.0_wp
      if (prior == prior_zero) return
      do q = 1, basis%n_polynomials
         do h = 1, basis%n_harmonics
            weights(h + (q - 1)*basis%n_harmonics) = &
               & fall**(sum(basis%degrees(:, q)) + basis%harmonics%degrees(h)/level_per_degree)
         end do
      end do
      weights(1) = constant_weight
   end function prior_weights

   !> Coefficients of the half-space theory, fitted over the domain.
   subroutine theory_coefficients(basis, domain, mean, error)
      type(basis_type), intent(in) :: basis
      type(domain_type), intent(in) :: domain
      real(wp), allocatable, intent(out) :: mean(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: least_noise = 1.0e-6_wp
      type(regression_type) :: regression
      type(halfspace_type) :: theory
      real(wp), allocatable :: constants(:, :), euler(:, :), terms(:, :), y(:)
      integer :: n, i

      n = max(theory_points, 4*basis%n_terms)
      call spread_crystals(domain, n, constants, euler, error)
      if (allocated(error)) return
      allocate (terms(basis%n_terms, n), y(n))
      do i = 1, n
         call halfspace_modulus(domain%class%stiffness(constants(:, i)), euler(:, i), theory, error)
         if (allocated(error)) return
         call observe(basis, constants(:, i), euler(:, i), theory%modulus, terms(:, i), y(i))
      end do
      call new_regression(spread(1.0_wp, 1, basis%n_terms), spread(0.0_wp, 1, basis%n_terms), least_noise, regression, error)
      if (allocated(error)) return
      call add_data(regression, terms, y)
      call maximise_evidence(regression, error)
      if (allocated(error)) return
      mean = coefficient_mean(regression)
   end subroutine theory_coefficients

   !> Terms of a point, and the y of its modulus (GPa).
   pure subroutine observe(basis, constants, euler, modulus, terms, y)
      type(basis_type), intent(in) :: basis
      real(wp), intent(in) :: constants(:), euler(3), modulus
      real(wp), intent(out) :: terms(:), y
      real(wp) :: scale

      call evaluate_terms(basis, constants, euler, terms, scale)
      y = modulus
      if (basis%coordinates == coordinates_dimensionless) y = log(modulus/scale)
   end subroutine observe

   !> The same number for equal crystals.
   pure function number_crystals(constants) result(groups)
      !> Constants (k, n).
      real(wp), intent(in) :: constants(:, :)
      integer :: groups(size(constants, 2))
      integer :: i, j, last

      last = 0
      do i = 1, size(constants, 2)
         groups(i) = 0
         do j = 1, i - 1
            if (all(abs(constants(:, j) - constants(:, i)) <= 0.0_wp)) then
               groups(i) = groups(j)
               exit
            end if
         end do
         if (groups(i) > 0) cycle
         last = last + 1
         groups(i) = last
      end do
   end function number_crystals

   !> The factor on every sd that makes the errors of crystals left out of the fit agree with their sds; `z` are the former over
   !> the latter. A few crystals chosen for their large variance say little of the others, so the factor is shrunk towards 1.
   pure real(wp) function learn_inflation(z) result(factor)
      real(wp), intent(in) :: z(:)

      factor = min(inflation_most, sqrt((agreeing + sum(z**2))/(agreeing + size(z))))
   end function learn_inflation

   !> The factor on every sd of a surrogate: as learnt from crystals left out and, with the theory as prior, at least what covers
   !> truncation. `z` as in `learn_inflation`, the others as in `truncation_factor`.
   subroutine inflation_of(basis, domain, prior, mean, covariance, beta, z, factor, error)
      type(basis_type), intent(in) :: basis
      type(domain_type), intent(in) :: domain
      integer, intent(in) :: prior
      real(wp), intent(in) :: mean(:), covariance(:, :), beta, z(:)
      real(wp), intent(out) :: factor
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: least

      factor = learn_inflation(z)
      if (prior /= prior_theory) return
      call truncation_factor(basis, domain, mean, covariance, beta, least, error)
      factor = max(factor, least)
   end subroutine inflation_of

   !> The factor on every sd with which it covers what truncation alone leaves out: the difference between the half-space theory
   !> and its own fit `mean`, at random crystals. Simulations chosen where the variance is large say little of it.
   subroutine truncation_factor(basis, domain, mean, covariance, beta, factor, error)
      type(basis_type), intent(in) :: basis
      type(domain_type), intent(in) :: domain
      !> Coefficients of the theory; posterior covariance and precision of the noise, in units of y.
      real(wp), intent(in) :: mean(:), covariance(:, :), beta
      real(wp), intent(out) :: factor
      type(error_type), allocatable, intent(out) :: error
      type(halfspace_type) :: theory
      real(wp), allocatable :: constants(:, :), euler(:, :), terms(:, :), product(:, :)
      real(wp) :: z(misfit_points), y, low, high
      integer :: i, step

      factor = 0.0_wp
      call spread_crystals(domain, misfit_points, constants, euler, error)
      if (allocated(error)) return
      allocate (terms(basis%n_terms, misfit_points), product(basis%n_terms, misfit_points))
      do i = 1, misfit_points
         call halfspace_modulus(domain%class%stiffness(constants(:, i)), euler(:, i), theory, error)
         if (allocated(error)) return
         call observe(basis, constants(:, i), euler(:, i), theory%modulus, terms(:, i), y)
         z(i) = abs(y - dot_product(terms(:, i), mean))
      end do
      call multiply(covariance, terms, product)
      do i = 1, misfit_points
         z(i) = z(i)/sqrt(max(0.0_wp, dot_product(terms(:, i), product(:, i))) + 1.0_wp/beta)
      end do
      ! The quantile by bisection.
      low = 0.0_wp
      high = maxval(z)
      do step = 1, 60
         factor = 0.5_wp*(low + high)
         if (count(z <= factor) < covered*misfit_points) then
            low = factor
         else
            high = factor
         end if
      end do
      factor = high/normal_90
   end subroutine truncation_factor

   !> Fit a surrogate to simulated moduli by evidence maximisation.
   subroutine fit_surrogate(domain, options, constants, euler, modulus, surrogate, error)
      type(domain_type), intent(in) :: domain
      type(fit_options_type), intent(in) :: options
      !> Constants (k, n) and moduli (n), GPa; Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: constants(:, :), euler(:, :), modulus(:)
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(regression_type) :: regression
      real(wp), allocatable :: lower(:), upper(:), mean(:), terms(:, :), y(:), residual(:), sd(:)
      integer :: n, i

      n = size(modulus)
      if (n < 2) then
         call raise(error, 'there are '//to_text(n)//' simulations to learn from; at least 2 are needed', exit_bad_input)
         return
      end if
      call coordinate_ranges(domain, options%coordinates, lower, upper, error)
      if (allocated(error)) return
      call new_basis(domain%class, options%coordinates, options%truncation, options%degree, options%bandlimit, lower, upper, &
         & surrogate%basis, error)
      if (allocated(error)) return
      associate (basis => surrogate%basis)
         if (options%prior == prior_theory) then
            call theory_coefficients(basis, domain, mean, error)
            if (allocated(error)) return
         else
            mean = spread(0.0_wp, 1, basis%n_terms)
         end if
         call new_regression(prior_weights(basis, options%prior), mean, least_noise_of(options%coordinates), regression, error)
         if (allocated(error)) return
         allocate (terms(basis%n_terms, n), y(n), residual(n), sd(n))
         do i = 1, n
            call observe(basis, constants(:, i), euler(:, i), modulus(i), terms(:, i), y(i))
         end do
         call add_data(regression, terms, y)
         call maximise_evidence(regression, error)
         if (allocated(error)) return
         call leave_groups_out(regression, number_crystals(constants), residual, sd, error)
         if (allocated(error)) return
         surrogate%anisotropy_cap = domain%anisotropy_cap
         surrogate%alpha = regression%alpha
         surrogate%beta = regression%beta
         surrogate%coefficients = reshape(coefficient_mean(regression), [basis%n_harmonics, basis%n_polynomials])
         allocate (surrogate%covariance(basis%n_terms, basis%n_terms))
         call coefficient_covariance(regression, surrogate%covariance)
         call inflation_of(basis, domain, options%prior, mean, surrogate%covariance, surrogate%beta, residual/sd, &
            & surrogate%sd_inflation, error)
      end associate
   end subroutine fit_surrogate
end module surrogate_fit
