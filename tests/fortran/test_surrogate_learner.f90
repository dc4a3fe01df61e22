!> The fit of a surrogate, and the choice of the next simulation.
program test_surrogate_learner
   use abstract_basis, only: basis_type
   use acquisitions, only: new_acquisition
   use bases, only: new_basis
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: degree, wp
   use sequential_design, only: set_candidates
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, spread_crystals
   use surrogate_learner, only: add_simulations, fit_learner, learner_type, new_learner, &
      & surrogate_of
   use surrogate_model, only: surrogate_type, values_alone
   use testing, only: check, check_close, check_refused, check_success, evaluate_terms, finish, &
      & new_domain, new_wide_domain, predict
   implicit none

   call test_fits('cubic', 'paper', 2, 4, 200, 6.0_wp)
   call test_fits('cubic', 'correction', 3, 0, 40, 0.25_wp)
   call test_fits('', 'correction', 3, 0, 40, 0.4_wp)
   call test_choice()
   call test_choice([50.0_wp, 450.0_wp])
   call finish()

contains

   !> A basis over the paper's domain of a class, or over that of all crystals, of any scale or
   !> between two, GPa.
   subroutine make_basis(symmetry, model, degree_of_terms, bandlimit, basis, stiffness)
      !> The class, or ''; 'paper' or 'correction'.
      character(len=*), intent(in) :: symmetry, model
      integer, intent(in) :: degree_of_terms, bandlimit
      class(basis_type), allocatable, intent(out) :: basis
      real(wp), intent(in), optional :: stiffness(2)
      type(domain_type) :: domain
      type(surrogate_settings_type) :: settings
      type(error_type), allocatable :: error

      if (symmetry == 'cubic') then
         call new_domain(symmetry, [50.0_wp, 40.0_wp, 15.0_wp], [250.0_wp, 150.0_wp, 120.0_wp], &
            & 7.2_wp, domain, error)
      else
         call new_wide_domain('triclinic', 'triclinic', 1.5_wp, [0.05_wp, 0.45_wp], domain, &
            & error, stiffness)
      end if
      settings%model = model
      settings%truncation = 'tensor'
      settings%degree = degree_of_terms
      settings%bandlimit = bandlimit
      call new_basis(domain, settings, basis, error)
      if (allocated(error)) call check_success('new_basis', error)
   end subroutine make_basis

   !> Crystals of the basis' domain, angles in degrees, and their moduli: what the theory gives
   !> them, and a factor such as a specimen with axial symmetry may add.
   subroutine simulate(basis, n, constants, euler_deg, modulus)
      class(basis_type), intent(in) :: basis
      integer, intent(in) :: n
      real(wp), allocatable, intent(out) :: constants(:, :), euler_deg(:, :), modulus(:)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp) :: c(6, 6)
      integer :: i

      call spread_crystals(basis%domain, n, 3, constants, euler_deg, error)
      allocate (modulus(n))
      do i = 1, n
         c = basis%domain%class%stiffness(constants(:, i))
         call halfspace_modulus(c, degree*euler_deg(:, i), theory, error)
         c = rotate_stiffness(c, rotation_matrix(degree*euler_deg(:, i)))
         modulus(i) = theory%modulus*1.1_wp*(c(3, 3)/(c(4, 4) + c(5, 5)))**0.04_wp
      end do
   end subroutine simulate

   !> Fit n simulated crystals, and meet others within `limit` GPa on the average.
   subroutine test_fits(symmetry, model, degree_of_terms, bandlimit, n, limit)
      character(len=*), intent(in) :: symmetry, model
      integer, intent(in) :: degree_of_terms, bandlimit, n
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

      call make_basis(symmetry, model, degree_of_terms, bandlimit, basis)
      call simulate(basis, n + unseen, constants, euler_deg, modulus)
      call new_learner(basis, learner, error)
      call add_simulations(learner, values_alone(constants(:, :1), euler_deg(:, :1), modulus(:1)), &
         & .true., error)
      call surrogate_of(learner, '{}', surrogate, error)
      call check_refused('one simulation', error, 'at least 2')
      call add_simulations(learner, values_alone(constants(:, 2:n), euler_deg(:, 2:n), &
         & modulus(2:n)), .true., error)
      call fit_learner(learner, error)
      call check_success('a fit', error)
      call surrogate_of(learner, '{}', surrogate, error)
      call check_success('its surrogate', error)
      covered = .true.
      do i = 1, unseen
         c = basis%domain%class%stiffness(constants(:, n + i))
         call predict(surrogate, c, degree*euler_deg(:, n + i), mean, sd)
         difference(i) = abs(mean - modulus(n + i))
         covered = covered .and. basis%domain%admits(c)
      end do
      call check_close(model//': mean absolute error on unseen crystals', sum(difference)/unseen, &
         & 0.0_wp, limit)
      call check('every crystal of the domain is covered', covered)
      call add_simulations(learner, values_alone(constants(:, :1), euler_deg(:, :1), [-1.0_wp]), &
         & .true., error)
      call check_refused('a negative modulus', error, 'not positive')
   end subroutine test_fits

   !> The rules against the variances themselves: the largest, or that of all that a choice would
   !> leave, of log M where the scale varies.
   subroutine test_choice(stiffness)
      !> The range of the scale, if it counts.
      real(wp), intent(in), optional :: stiffness(2)
      class(basis_type), allocatable :: basis
      type(learner_type) :: learner
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
      character(len=*), parameter :: rules(2) = [character(len=8) :: 'variance', 'imse']
      real(wp) :: mean(200), sd(200), variance(3), c(6, 6), scale, spread(200)
      real(wp), allocatable :: terms(:, :), reach(:)
      integer :: i, rule, chosen(3)

      call make_basis('', 'correction', 2, 0, basis, stiffness)
      allocate (terms(basis%n_terms, 200))
      call simulate(basis, 230, constants, euler_deg, modulus)
      call new_learner(basis, learner, error)
      call add_simulations(learner, values_alone(constants(:, 201:), euler_deg(:, 201:), &
         & modulus(201:)), .true., error)
      do rule = 1, size(rules)
         learner%rule = new_acquisition(rules(rule))
         call set_candidates(learner%design, basis, constants(:, :200), euler_deg(:, :200), .false.)
         call fit_learner(learner, error)
         call surrogate_of(learner, '{}', surrogate, error)
         do i = 1, 200
            c = basis%domain%class%stiffness(constants(:, i))
            call evaluate_terms(basis, c, degree*euler_deg(:, i), terms(:, i), scale, spread(i))
            call predict(surrogate, c, degree*euler_deg(:, i), mean(i), sd(i))
         end do
         if (rule == 2) then
            do i = 1, 200
               reach = matmul(surrogate%covariance, terms(:, i))
               sd(i) = sum(merge(1.0_wp, mean**2, present(stiffness))*(spread*matmul(reach, &
                  & terms))**2)/(dot_product(reach, terms(:, i)) + 1.0_wp/surrogate%beta)
            end do
         end if
         call learner%rule%choose(learner%design, basis, 1, chosen, variance)
         call check('the best by '//trim(rules(rule)), chosen(1) == maxloc(sd, 1))
      end do
      learner%rule = new_acquisition('variance')
      call set_candidates(learner%design, basis, constants(:, :200), euler_deg(:, :200), .false.)
      learner%design%available(3:) = .false.
      call learner%rule%choose(learner%design, basis, 1, chosen(:2), variance(:2))
      call check('what is excluded is not chosen', all(chosen(:2) <= 2))
   end subroutine test_choice
end program test_surrogate_learner
