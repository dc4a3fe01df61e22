!> The prior of a surrogate's coefficients, N(mean, (alpha W)^-1), and how far the standard deviations that follow can be believed.
module coefficient_prior
   use abstract_basis, only: basis_type
   use errors, only: error_type, exit_bad_input, raise
   use evidence_regression, only: add_data, coefficient_mean, maximise_evidence, new_regression, regression_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use linear_algebra, only: multiply
   use surrogate_domain, only: spread_crystals
   implicit none
   private
   public :: prior_names, new_coefficient_prior, learn_inflation, inflation_of

   character(len=*), parameter :: prior_names = 'zero, theory'

   !> Evaluations of the half-space theory behind the informative prior; the variance of a coefficient falls eightfold for each
   !> degree of its polynomial, and as much for every four degrees of its harmonic; the constant term is almost free.
   integer, parameter :: theory_points = 10000
   real(wp), parameter :: fall = 8.0_wp, level_per_degree = 4.0_wp, constant_weight = 1.0e-4_wp
   !> The factor on the sds that is learnt from crystals left out: so many more count as if they agreed with their sds; its bound.
   real(wp), parameter :: agreeing = 20.0_wp, inflation_most = 3.0_wp
   !> Evaluations of the theory against which the sds must hold, and the share of them that z = `normal_90` must cover.
   integer, parameter :: misfit_points = 2000
   real(wp), parameter :: covered = 0.9_wp, normal_90 = 1.6448536269514722_wp

contains

   !> 'zero': all coefficients alike about zero (Eq. 6). 'theory': about those of the half-space theory, with precisions that rise
   !> with the degree.
   subroutine new_coefficient_prior(basis, name, weights, mean, error)
      class(basis_type), intent(in) :: basis
      !> A word of `prior_names`.
      character(len=*), intent(in) :: name
      !> Diagonal of W, and mean, (n_terms).
      real(wp), allocatable, intent(out) :: weights(:), mean(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: directional(basis%n_terms), polynomial(basis%n_terms)

      select case (name)
      case ('zero')
         allocate (weights(basis%n_terms), source=1.0_wp)
         allocate (mean(basis%n_terms), source=0.0_wp)
      case ('theory')
         call basis%term_degrees(directional, polynomial)
         weights = fall**(polynomial + directional/level_per_degree)
         weights(1) = constant_weight
         call fit_theory(basis, mean, error)
      case default
         call raise(error, 'prior: '''//name//''' is unknown; allowed: '//prior_names, exit_bad_input)
      end select
   end subroutine new_coefficient_prior

   !> Coefficients of the half-space theory, fitted over the basis' domain.
   subroutine fit_theory(basis, mean, error)
      class(basis_type), intent(in) :: basis
      real(wp), allocatable, intent(out) :: mean(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: least_noise = 1.0e-6_wp
      type(regression_type) :: regression
      real(wp), allocatable :: terms(:, :), y(:)

      call evaluate_theory(basis, max(theory_points, 4*basis%n_terms), terms, y, error)
      if (allocated(error)) return
      call new_regression(spread(1.0_wp, 1, basis%n_terms), spread(0.0_wp, 1, basis%n_terms), least_noise, regression, error)
      if (allocated(error)) return
      call add_data(regression, terms, y)
      call maximise_evidence(regression, error)
      if (allocated(error)) return
      mean = coefficient_mean(regression)
   end subroutine fit_theory

   !> Terms (n_terms, n) and y (n) of the half-space theory at n crystals spread over the domain.
   subroutine evaluate_theory(basis, n, terms, y, error)
      class(basis_type), intent(in) :: basis
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: terms(:, :), y(:)
      type(error_type), allocatable, intent(out) :: error
      type(halfspace_type) :: theory
      real(wp), allocatable :: constants(:, :), euler(:, :)
      real(wp) :: c(6, 6), scale
      integer :: i

      call spread_crystals(basis%domain, n, constants, euler, error)
      if (allocated(error)) return
      allocate (terms(basis%n_terms, n), y(n))
      do i = 1, n
         c = basis%domain%class%stiffness(constants(:, i))
         call halfspace_modulus(c, euler(:, i), theory, error)
         if (allocated(error)) return
         call basis%evaluate_terms(c, euler(:, i), terms(:, i), scale)
         y(i) = basis%to_y(theory%modulus, scale)
      end do
   end subroutine evaluate_theory

   !> The factor on every sd that makes the errors of crystals left out of the fit agree with their sds; `z` are the former over
   !> the latter. A few crystals chosen for their large variance say little of the others, so the factor is shrunk towards 1.
   pure real(wp) function learn_inflation(z) result(factor)
      real(wp), intent(in) :: z(:)

      factor = min(inflation_most, sqrt((agreeing + sum(z**2))/(agreeing + size(z))))
   end function learn_inflation

   !> The factor on every sd of a surrogate: as learnt from crystals left out and, with the theory as prior, at least what covers
   !> what truncation alone leaves out, the difference between the half-space theory and its own fit at random crystals:
   !> simulations chosen where the variance is large say little of it.
   subroutine inflation_of(basis, prior, mean, covariance, beta, z, factor, error)
      class(basis_type), intent(in) :: basis
      !> A word of `prior_names`.
      character(len=*), intent(in) :: prior
      !> The prior's coefficients; posterior covariance and precision of the noise, in units of y.
      real(wp), intent(in) :: mean(:), covariance(:, :), beta
      !> Errors of the simulations over their sds with their crystals left out.
      real(wp), intent(in) :: z(:)
      real(wp), intent(out) :: factor
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: terms(:, :), product(:, :), y(:)
      real(wp) :: low, high, middle
      integer :: i, step

      factor = learn_inflation(z)
      if (prior /= 'theory') return
      call evaluate_theory(basis, misfit_points, terms, y, error)
      if (allocated(error)) return
      allocate (product(basis%n_terms, misfit_points))
      call multiply(covariance, terms, product)
      do i = 1, misfit_points
         y(i) = abs(y(i) - dot_product(terms(:, i), mean)) &
            & /sqrt(max(0.0_wp, dot_product(terms(:, i), product(:, i))) + 1.0_wp/beta)
      end do
      ! The quantile by bisection.
      low = 0.0_wp
      high = maxval(y)
      do step = 1, 60
         middle = 0.5_wp*(low + high)
         if (count(y <= middle) < covered*misfit_points) then
            low = middle
         else
            high = middle
         end if
      end do
      factor = max(factor, high/normal_90)
   end subroutine inflation_of
end module coefficient_prior
