!> Training of the correction of a film on exact values, without simulations.
!>
!> The exact modulus of a film takes milliseconds, too long for a density that is evaluated millions
!> of times. A correction is therefore trained on some thousand values: first over a broad region
!> about the isotropic crystal that has the mean measurement, then round by round at the crystals of
!> the posterior, which is sampled with the correction so far and its uncertainty.
module film_training
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: isotropic_stiffness, log_anisotropy, logarithmic_mean
   use detected_speeds, only: draw_aside
   use errors, only: error_type
   use evidence_regression, only: add_data
   use film_theory, only: film_type, indent_films, young_of_film
   use indenters, only: indenter_type, new_indenter
   use kinds, only: degree, i8, wp
   use observables, only: new_observable, observable_type
   use posterior_focus, only: accurate_z, extend
   use problem, only: problem_type
   use problem_posterior, only: run_type
   use progress, only: advance_progress, begin_progress, end_progress
   use random, only: new_random_stream, random_stream_type
   use settings_schema, only: surrogate_settings_type
   use simulate, only: n_derivatives
   use statistics, only: sort_order
   use surrogate_domain, only: complete_domain, domain_type, spread_crystals
   use surrogate_learner, only: fit_learner, learner_type, new_learner, surrogate_of
   use surrogate_model, only: predict_crystals, simulations_type, surrogate_type, values_alone
   use variance_shares, only: find_shares, from_surrogate, shares_type
   implicit none
   private
   public :: train_film

   !> Numbers of values over the broad region, of &plan and of measurements, and in each round at
   !> draws of the posterior and over the domain, which holds all draws.
   integer, parameter :: n_planned = 1500, n_broad = 400, n_drawn = 400, n_spread = 100, &
      & most_rounds = 4
   !> Chains of the posterior of a round.
   type(run_type), parameter :: pilot = run_type(1500, 500, 2, 7000001)
   !> Noise of values over the domain, and of those at draws of a correction that was wrong there,
   !> relative to that of other draws. These values keep the correction from going astray far from
   !> the posterior.
   real(wp), parameter :: coarse_noise = 20.0_wp
   !> Share of the draws whose crystals are used, the least anisotropic ones: a correction that
   !> holds at the end of long tails is less accurate elsewhere.
   real(wp), parameter :: used = 0.95_wp
   !> Greatest share of the correction in the variance of each constant.
   real(wp), parameter :: accurate_share = 0.01_wp
   !> Greatest share of crystals of a round that theory cannot indent.
   real(wp), parameter :: most_failed = 0.5_wp
   !> The broad region: greatest log-anisotropy, range of Poisson's ratio, and factor on the scale.
   real(wp), parameter :: broad_anisotropy = 2.5_wp, broad_poisson(2) = [0.05_wp, 0.45_wp], &
      & broad_scale = 3.0_wp, typical_poisson = 0.3_wp

   type :: training_type
      type(problem_type), pointer :: problem => null()
      !> The exact values, and the noise of each, relative to that of draws.
      type(simulations_type) :: known
      real(wp), allocatable :: noise(:)
      !> Contains all values.
      type(domain_type) :: domain
      !> Trained on the values so far.
      type(surrogate_type) :: surrogate
   end type training_type

contains

   !> Angles, degrees, (3, n), of directions that are uniform over the sphere.
   function directions(seed, number, n) result(euler_deg)
      !> Of the random stream; of the directions.
      integer, intent(in) :: seed, number, n
      real(wp) :: euler_deg(3, n), u(3)
      type(random_stream_type) :: stream
      integer :: i, k

      stream = new_random_stream(seed, number)
      do i = 1, n
         do k = 1, 3
            call stream%uniform(u(k))
         end do
         euler_deg(:, i) = [360.0_wp*u(1), acos(1.0_wp - 2.0_wp*u(2))/degree, 360.0_wp*u(3)]
      end do
   end function directions

   !> Train the correction of a film where the posterior of the problem is, or, for &plan, over the
   !> broad region alone.
   subroutine train_film(problem, is_plan, surrogate, error)
      type(problem_type), intent(in), target :: problem
      !> Whether the measurements are those of &plan.
      logical, intent(in) :: is_plan
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(training_type) :: self
      type(posterior_type) :: posterior
      type(shares_type), allocatable :: shares(:)
      real(wp), allocatable :: draws(:, :)
      real(wp) :: z
      logical :: is_accurate
      integer :: round, i, n_first

      self%problem => problem
      n_first = merge(n_planned, n_broad, is_plan)
      call begin_progress('exact values of the film', int(n_first + merge(0, most_rounds*(n_drawn &
         & + n_spread), is_plan), i8))
      call find_broad()
      if (.not. allocated(error)) call add_spread(n_first, 0)
      if (.not. allocated(error)) call fit(self, error)
      do round = 1, merge(0, most_rounds, is_plan)
         if (allocated(error)) exit
         call draw_aside(problem, problem%settings%measurements, self%surrogate, pilot, posterior, &
            & draws, error)
         if (allocated(error)) exit
         is_accurate = .true.
         ! Grains of unknown orientation have no shares.
         if (.not. allocated(posterior%unknown)) then
            call find_shares(posterior, draws, draws(:posterior%n_constants, :), &
               & real(size(draws, 2), wp), problem%threads(), shares, error)
            if (allocated(error)) exit
            is_accurate = all([(shares(i)%by_source(from_surrogate) <= accurate_share, i=1, &
               & size(shares))])
         end if
         call add_draws()
         if (.not. allocated(error)) call add_spread(n_spread, round)
         if (.not. allocated(error)) call fit(self, error)
         if (is_accurate .and. z <= accurate_z) exit
      end do
      call end_progress()
      surrogate = self%surrogate

   contains

      !> Set the domain to the broad region about the crystal of &plan, or the isotropic crystal
      !> with the mean measurement.
      subroutine find_broad()
         type(observable_type) :: observable
         real(wp) :: crystal(6, 6), poisson, anisotropy, scale, young

         associate (model => problem%settings%measurements, domain => self%domain, &
            & known => self%known)
            if (is_plan) then
               crystal = problem%class%stiffness(problem%settings%plan%constants)
            else
               call new_observable(model%modulus_kind, model, observable, error)
               if (allocated(error)) return
               young = sum(problem%data%measurements%modulus_gpa) &
                  & /size(problem%data%measurements%modulus_gpa)
               young = young_of_film(problem, young/max(observable%factor &
                  & - observable%compliance*young, 1.0e-3_wp), typical_poisson)
               crystal = isotropic_stiffness(young, typical_poisson)
            end if
            call logarithmic_mean(crystal, poisson, anisotropy, scale)
            domain%log_anisotropy_max = broad_anisotropy
            domain%poisson = broad_poisson
            domain%stiffness = scale*[1.0_wp/broad_scale, broad_scale]
            call complete_domain(problem%class%name, domain, error)
            domain%is_extended = .true.
            allocate (known%constants(problem%class%n_constants, 0), known%euler_deg(3, 0), &
               & known%modulus(0), known%by_stiffness(n_derivatives, 0), self%noise(0))
         end associate
      end subroutine find_broad

      !> Add values at crystals that are spread over the domain.
      subroutine add_spread(n, number)
         !> Of crystals; of the random stream.
         integer, intent(in) :: n, number
         real(wp), allocatable :: constants(:, :), euler_deg(:, :)

         call spread_crystals(self%domain, n, self%problem%settings%problem%seed + number, &
            & constants, euler_deg, error)
         if (.not. allocated(error)) then
            call add_values(self, constants, euler_deg, coarse_noise, error)
         end if
      end subroutine add_spread

      !> Add values at crystals of the posterior, half of them in the orientations of the grains,
      !> and extend the domain to these crystals.
      subroutine add_draws()
         real(wp) :: euler_deg(3, n_drawn), anisotropy(size(draws, 2))
         real(wp), allocatable, dimension(:) :: modulus, sd
         integer :: order(size(draws, 2)), before, i

         euler_deg = directions(self%problem%settings%problem%seed, round, n_drawn)
         do i = 1, n_drawn, 2
            if (allocated(posterior%unknown)) exit
            associate (grains => self%problem%data%measurements%euler_deg)
               euler_deg(:, i) = grains(:, 1 + mod(i/2, size(grains, 2)))
            end associate
         end do
         before = size(self%known%modulus)
         associate (constants => draws(:posterior%n_constants, :))
            anisotropy = [(log_anisotropy(self%problem%class%stiffness(constants(:, i))), &
               & i=1, size(anisotropy))]
            call sort_order(anisotropy, order)
            call add_values(self, constants(:, order([(1 + int((i - 1)*used*size(order)/n_drawn), &
               & i=1, n_drawn)])), euler_deg, 1.0_wp, error)
         end associate
         if (allocated(error)) return
         associate (crystals => &
            & self%problem%class%stiffnesses(self%known%constants(:, before + 1:)), &
            & exact => self%known%modulus(before + 1:))
            allocate (modulus(size(exact)), sd(size(exact)))
            call predict_crystals(self%surrogate, crystals, &
               & degree*self%known%euler_deg(:, before + 1:), self%problem%threads(), modulus, sd, &
               & error)
            if (allocated(error)) return
            z = norm2((exact - modulus)/sd)/sqrt(real(size(exact), wp))
            if (z > accurate_z) self%noise(:before) = coarse_noise
            call extend(self%domain, crystals)
         end associate
      end subroutine add_draws
   end subroutine train_film

   !> Compute exact values. Crystals that theory cannot indent are left out.
   subroutine add_values(self, constants, euler_deg, noise, error)
      type(training_type), intent(inout) :: self
      !> GPa, (n_constants, n); degrees, (3, n); noise of the values, relative to that of draws.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :), noise
      type(error_type), allocatable, intent(out) :: error
      type(film_type) :: films(size(constants, 2))
      integer, allocatable :: made(:)
      integer :: i

      call indent_films(self%problem, self%problem%class%stiffnesses(constants), euler_deg, &
         & self%problem%threads(), films, error)
      made = pack([(i, i=1, size(films))], films%modulus > 0.0_wp)
      if (size(made) < (1.0_wp - most_failed)*size(films)) return
      if (allocated(error)) deallocate (error)
      call advance_progress(int(size(films), i8))
      call self%known%append(values_alone(constants(:, made), euler_deg(:, made), &
         & films(made)%modulus))
      self%noise = [self%noise, spread(noise, 1, size(made))]
   end subroutine add_values

   !> Fit the correction to all values.
   subroutine fit(self, error)
      type(training_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_settings_type) :: settings
      class(basis_type), allocatable :: basis
      type(learner_type) :: learner
      class(indenter_type), allocatable :: indenter
      real(wp), allocatable :: terms(:, :), scale(:), growth(:)

      settings%model = 'film'
      settings%degree = 3
      call new_basis(self%domain, settings, basis, error)
      if (.not. allocated(error)) call new_learner(basis, learner, error)
      if (allocated(error)) return
      learner%simulations = self%known
      call basis%evaluate_crystals(self%known%constants, self%known%euler_deg, terms, scale, growth)
      associate (y => basis%to_y(self%known%modulus, scale, growth))
         call add_data(learner%design%regression, terms/spread(self%noise, 1, size(terms, 1)), &
            & y/self%noise, spread(.false., 1, size(y)))
      end associate
      call fit_learner(learner, error)
      if (.not. allocated(error)) call surrogate_of(learner, '{}', self%surrogate, error)
      if (.not. allocated(error)) then
         call new_indenter(self%problem%settings%indenter, indenter, error)
      end if
      if (.not. allocated(error)) self%surrogate%contact_radius = indenter%contact_radius
   end subroutine fit
end module film_training
