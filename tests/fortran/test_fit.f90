!> The prior of the coefficients, the fit of a surrogate, and the choice of the next simulation.
program test_fit
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use coefficient_prior, only: learn_inflation, new_coefficient_prior
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: degree, wp
   use settings_groups, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, new_domain, spread_crystals
   use surrogate_learner, only: add_simulations, choose_next, exclude_candidates, fit_learner, learner_type, new_learner, &
      & set_learner_candidates, surrogate_of
   use surrogate_model, only: predict, surrogate_type
   use testing, only: check, check_close, check_refused, check_success, finish
   implicit none

   call test_inflation()
   call test_prior()
   call test_fits('cubic', 'dimensionless', 'total', 3, 6, 'zero', 80, 0.5_wp)
   call test_fits('cubic', 'dimensionless', 'total', 2, 4, 'theory', 12, 1.5_wp)
   call test_fits('cubic', 'box', 'tensor', 2, 4, 'zero', 200, 6.0_wp)
   call test_fits('hexagonal', 'dimensionless', 'total', 3, 4, 'theory', 30, 2.0_wp)
   call test_choice()
   call finish()

contains

   !> A basis over the paper's domain of a class.
   subroutine make_basis(symmetry, coordinates, truncation, degree, bandlimit, basis)
      character(len=*), intent(in) :: symmetry, coordinates, truncation
      integer, intent(in) :: degree, bandlimit
      class(basis_type), allocatable, intent(out) :: basis
      type(domain_type) :: domain
      type(surrogate_settings_type) :: settings
      type(error_type), allocatable :: error

      if (symmetry == 'cubic') then
         call new_domain(symmetry, [50.0_wp, 40.0_wp, 15.0_wp], [250.0_wp, 150.0_wp, 120.0_wp], 7.2_wp, domain, error)
      else
         call new_domain(symmetry, [80.0_wp, 40.0_wp, 30.0_wp, 70.0_wp, 40.0_wp], [240.0_wp, 120.0_wp, 90.0_wp, 210.0_wp, &
            & 90.0_wp], 10.0_wp, domain, error)
      end if
      settings%coordinates = coordinates
      settings%truncation = truncation
      settings%degree = degree
      settings%bandlimit = bandlimit
      call new_basis(domain, settings, basis, error)
      if (allocated(error)) call check_success('new_basis', error)
   end subroutine make_basis

   subroutine test_inflation()
      call check_close('errors as large as their sds', learn_inflation(spread(1.0_wp, 1, 9)), 1.0_wp, 1.0e-12_wp)
      call check_close('few crystals move the factor a little', learn_inflation(spread(3.0_wp, 1, 5)), sqrt(2.6_wp), 1.0e-12_wp)
      call check_close('many decide it', learn_inflation(spread(0.5_wp, 1, 100000)), 0.5_wp, 1.0e-3_wp)
      call check_close('the factor is bounded', learn_inflation(spread(99.0_wp, 1, 9)), 3.0_wp, 1.0e-12_wp)
   end subroutine test_inflation

   subroutine test_prior()
      class(basis_type), allocatable :: basis
      type(error_type), allocatable :: error
      real(wp), allocatable :: weights(:), mean(:)

      call make_basis('cubic', 'dimensionless', 'total', 2, 4, basis)
      call new_coefficient_prior(basis, 'theory', weights, mean, error)
      call check('the constant term is almost free', weights(1) < 0.01_wp*minval(weights(2:)))
      call check_close('eightfold per degree, l = 4 as one degree', maxval(weights), 512.0_wp, 1.0e-12_wp)
      call new_coefficient_prior(basis, 'zero', weights, mean, error)
      call check('Eq. 6', all(abs(weights - 1.0_wp) <= 0.0_wp) .and. all(abs(mean) <= 0.0_wp))
      call new_coefficient_prior(basis, 'wild', weights, mean, error)
      call check_refused('an unknown prior', error, '''wild'' is unknown; allowed: zero, theory')
   end subroutine test_prior

   !> Crystals of the basis' domain, angles in degrees, and what the theory gives them.
   subroutine simulate(basis, n, constants, euler_deg, modulus)
      class(basis_type), intent(in) :: basis
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: constants(:, :), euler_deg(:, :), modulus(:)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp), allocatable :: euler(:, :)
      integer :: i

      call spread_crystals(basis%domain, n, constants, euler, error)
      allocate (modulus(n))
      do i = 1, n
         call halfspace_modulus(basis%domain%class%stiffness(constants(:, i)), euler(:, i), theory, error)
         modulus(i) = theory%modulus
      end do
      euler_deg = euler/degree
   end subroutine simulate

   !> Fit n crystals that the theory simulates, and meet others within `limit` GPa on the average.
   subroutine test_fits(symmetry, coordinates, truncation, highest_degree, bandlimit, prior, n, limit)
      character(len=*), intent(in) :: symmetry, coordinates, truncation, prior
      integer, intent(in) :: highest_degree, bandlimit, n
      real(wp), intent(in) :: limit
      integer, parameter :: unseen = 200
      class(basis_type), allocatable :: basis
      type(learner_type) :: learner
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
      real(wp) :: mean, sd, difference(unseen), c(6, 6)
      logical :: covered
      integer :: i

      call make_basis(symmetry, coordinates, truncation, highest_degree, bandlimit, basis)
      call simulate(basis, n + unseen, constants, euler_deg, modulus)
      call new_learner(basis, prior, learner, error)
      call add_simulations(learner, constants(:, :1), euler_deg(:, :1), modulus(:1), .true., error)
      call surrogate_of(learner, '{}', surrogate, error)
      call check_refused('one simulation', error, 'at least 2')
      call add_simulations(learner, constants(:, 2:n), euler_deg(:, 2:n), modulus(2:n), .true., error)
      call fit_learner(learner, error)
      call check_success('a fit', error)
      call surrogate_of(learner, '{}', surrogate, error)
      call check_success('its surrogate', error)
      covered = .true.
      do i = 1, unseen
         c = basis%domain%class%stiffness(constants(:, n + i))
         call predict(surrogate, c, degree*euler_deg(:, n + i), mean, sd)
         difference(i) = abs(mean - modulus(n + i))
         covered = covered .and. basis%covers(c)
      end do
      call check_close('mean absolute error on unseen crystals', sum(difference)/unseen, 0.0_wp, limit)
      call check('every crystal of the domain is covered', covered)
      call add_simulations(learner, constants(:, :1), euler_deg(:, :1), [-1.0_wp], .true., error)
      call check_refused('a negative modulus', error, 'not positive')
   end subroutine test_fits

   !> The rules 'modulus' and 'log_modulus' against the variances themselves.
   subroutine test_choice()
      class(basis_type), allocatable :: basis
      type(learner_type) :: learner
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
      character(len=*), parameter :: rules(2) = [character(len=11) :: 'modulus', 'log_modulus']
      real(wp) :: mean(200), sd(200), variance(3), c(6, 6)
      integer :: i, rule, chosen(3)

      call make_basis('cubic', 'dimensionless', 'total', 2, 4, basis)
      call simulate(basis, 230, constants, euler_deg, modulus)
      call new_learner(basis, 'zero', learner, error)
      call choose_next(learner, 1, chosen, variance, error)
      call check_refused('no candidates', error, 'no candidates')
      call add_simulations(learner, constants(:, 201:), euler_deg(:, 201:), modulus(201:), .true., error)
      call set_learner_candidates(learner, constants(:, :200), euler_deg(:, :200), 'guess', error)
      call check_refused('an unknown rule', error, '''guess'' is unknown; allowed: modulus, log_modulus')
      do rule = 1, 2
         call set_learner_candidates(learner, constants(:, :200), euler_deg(:, :200), trim(rules(rule)), error)
         call fit_learner(learner, error)
         call surrogate_of(learner, '{}', surrogate, error)
         do i = 1, 200
            c = basis%domain%class%stiffness(constants(:, i))
            call predict(surrogate, c, degree*euler_deg(:, i), mean(i), sd(i))
         end do
         if (rule == 2) sd = sd/mean
         call choose_next(learner, 1, chosen, variance, error)
         call check('the largest variance by '//trim(rules(rule)), chosen(1) == maxloc(sd, 1))
      end do
      call set_learner_candidates(learner, constants(:, :200), euler_deg(:, :200), 'modulus', error)
      call exclude_candidates(learner, [(i, i=3, 200)], error)
      call choose_next(learner, 1, chosen(:2), variance(:2), error)
      call check('what is excluded is not chosen', all(chosen(:2) <= 2))
      call choose_next(learner, 1, chosen(:1), variance(:1), error)
      call check_refused('none is left', error, 'no candidate is left')
      call exclude_candidates(learner, [201], error)
      call check_refused('a candidate that is not there', error, '1 .. 200')
   end subroutine test_choice
end program test_fit
