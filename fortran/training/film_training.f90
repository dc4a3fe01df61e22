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
   use crystal_elasticity, only: isotropic_stiffness, logarithmic_mean
   use detected_speeds, only: draw_aside
   use errors, only: error_type
   use evidence_regression, only: add_data
   use film_theory, only: film_type, indent_films, young_of_film
   use indenters, only: indenter_type, new_indenter
   use kinds, only: degree, i8, wp
   use observables, only: new_observable, observable_type
   use posterior_focus, only: accurate_z, changes_of_variance, extend
   use problem, only: problem_type
   use problem_posterior, only: run_type
   use progress, only: advance_progress, begin_progress, end_progress
   use random, only: new_random_stream, random_stream_type
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: complete_domain, domain_type, spread_crystals
   use surrogate_learner, only: fit_learner, learner_type, new_learner, surrogate_of
   use surrogate_model, only: predict_crystals, simulations_type, surrogate_type
   use variance_shares, only: find_shares, from_surrogate, shares_type
   implicit none
   private
   public :: train_film, plan_film

   !> Numbers of values over the broad region, and in each round at draws of the posterior and over
   !> the domain, which holds all draws.
   integer, parameter :: n_broad = 400, n_drawn = 400, n_spread = 100, most_rounds = 6
   !> Chains of the posterior of a round.
   type(run_type), parameter :: pilot = run_type(1500, 500, 2, 7000001)
   !> Noise of values over the domain, relative to that of draws. These values keep the correction
   !> from going astray far from the posterior, and do not limit its accuracy there.
   real(wp), parameter :: coarse_noise = 30.0_wp
   !> Greatest share of the correction in the variance of each constant.
   real(wp), parameter :: accurate_share = 0.01_wp
   !> Greatest share of crystals of a round that theory cannot indent.
   real(wp), parameter :: most_failed = 0.5_wp
   !> The broad region: greatest log-anisotropy, range of Poisson's ratio, and factor on the scale.
   real(wp), parameter :: broad_anisotropy = 2.5_wp, broad_poisson(2) = [0.05_wp, 0.45_wp], &
      & broad_scale = 3.0_wp, typical_poisson = 0.3_wp

contains

   !> A problem with the measurements that &plan expects to be least precise, without their errors.
   subroutine plan_film(problem, planned, error)
      type(problem_type), intent(in) :: problem
      type(problem_type), intent(out) :: planned
      type(error_type), allocatable, intent(out) :: error
      type(film_type), allocatable :: films(:)
      type(observable_type) :: observable
      integer :: i, n

      planned = problem
      if (allocated(planned%measurements)) deallocate (planned%measurements)
      allocate (planned%measurements)
      associate (model => planned%settings%measurements, plan => problem%settings%plan, &
         & points => planned%measurements)
         if (.not. allocated(model%modulus_kind)) model%modulus_kind = 'indentation_modulus'
         call new_observable(model%modulus_kind, model, observable, error)
         if (allocated(error)) return
         n = nint(minval(plan%grains))
         points%n = n
         points%euler_deg = directions(problem%settings%problem%seed, 0, n)
         allocate (films(n), points%paths(n))
         call indent_films(problem, problem%class%stiffnesses(spread(plan%constants, 2, n)), &
            & points%euler_deg, problem%threads(), films, error)
         points%modulus_gpa = films%modulus
         call observable%to_measured(points%modulus_gpa)
         points%sd_gpa = maxval(plan%noise)*points%modulus_gpa
         points%orientation_sd_deg = spread(-1.0_wp, 1, n)
         points%group = spread(1, 1, n)
         points%row = [(i, i=1, n)]
      end associate
      if (allocated(planned%shared_errors)) deallocate (planned%shared_errors)
   end subroutine plan_film

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

   !> Train the correction of a film where the posterior of the problem is.
   subroutine train_film(problem, surrogate, error)
      type(problem_type), intent(in) :: problem
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(simulations_type) :: known
      !> Noise of each value, relative.
      real(wp), allocatable :: noise(:)
      type(domain_type) :: domain
      type(posterior_type) :: posterior
      real(wp), allocatable :: draws(:, :), share(:)
      real(wp) :: z
      integer :: round, n_before

      call begin_progress('exact values of the film', int(n_broad + most_rounds*(n_drawn &
         & + n_spread), i8))
      call add_broad()
      do round = 1, most_rounds
         if (allocated(error)) exit
         call draw_aside(problem, problem%settings%measurements, surrogate, pilot, posterior, &
            & draws, error)
         if (allocated(error)) exit
         call find_share()
         if (.not. allocated(error)) call add_draws()
         if (allocated(error)) exit
         if (all(share <= accurate_share) .and. z <= accurate_z) exit
      end do
      call end_progress()

   contains

      !> Train on crystals over the broad region.
      subroutine add_broad()
         type(observable_type) :: observable
         real(wp) :: poisson, anisotropy, scale, young

         young = 100.0_wp
         domain%log_anisotropy_max = broad_anisotropy
         domain%poisson = broad_poisson
         associate (model => problem%settings%measurements)
            call new_observable(model%modulus_kind, model, observable, error)
            if (allocated(error)) return
            young = sum(problem%measurements%modulus_gpa)/size(problem%measurements%modulus_gpa)
            young = young_of_film(problem, young/max(observable%factor &
               & - observable%compliance*young, 1.0e-3_wp), typical_poisson)
         end associate
         call logarithmic_mean(isotropic_stiffness(young, typical_poisson), poisson, anisotropy, &
            & scale)
         domain%stiffness = scale*[1.0_wp/broad_scale, broad_scale]
         call complete_domain(problem%class%name, domain, error)
         if (allocated(error)) return
         domain%is_extended = .true.
         allocate (known%constants(problem%class%n_constants, 0), known%euler_deg(3, 0), &
            & known%modulus(0), noise(0))
         call add_spread(n_broad, 0)
         if (.not. allocated(error)) call fit()
      end subroutine add_broad

      !> Add values at crystals that are spread over the domain.
      subroutine add_spread(n, number)
         !> Of crystals; of the random stream.
         integer, intent(in) :: n, number
         real(wp), allocatable :: constants(:, :), euler_deg(:, :)

         call spread_crystals(domain, n, problem%settings%problem%seed + number, constants, &
            & euler_deg, error)
         if (.not. allocated(error)) call add_values(constants, euler_deg, coarse_noise)
      end subroutine add_spread

      !> Find the share of the correction in the variances. Grains of unknown orientation have none.
      subroutine find_share()
         type(shares_type), allocatable :: shares(:)
         integer :: i

         share = spread(0.0_wp, 1, posterior%n_constants)
         if (allocated(posterior%unknown)) return
         call find_shares(posterior, draws, draws(:size(share), :), real(size(draws, 2), wp), &
            & problem%threads(), shares, error)
         if (allocated(error)) return
         share = max([(shares(i)%by_source(from_surrogate), i=1, size(share))], &
            & changes_of_variance(posterior, draws, size(share), problem%threads()))
      end subroutine find_share

      !> Train on crystals of the posterior, and compare them with the predictions.
      subroutine add_draws()
         real(wp) :: euler_deg(3, n_drawn)
         real(wp), allocatable, dimension(:) :: modulus, sd
         integer :: i

         euler_deg = directions(problem%settings%problem%seed, round, n_drawn)
         do i = 1, n_drawn, 2
            if (allocated(posterior%unknown)) exit
            associate (grains => problem%measurements%euler_deg)
               euler_deg(:, i) = grains(:, 1 + mod(i/2, size(grains, 2)))
            end associate
         end do
         n_before = size(known%modulus)
         call add_values(draws(:posterior%n_constants, &
            & [(1 + (i - 1)*size(draws, 2)/n_drawn, i=1, n_drawn)]), euler_deg, 1.0_wp)
         if (allocated(error)) return
         associate (constants => known%constants(:, n_before + 1:), &
            & exact => known%modulus(n_before + 1:))
            allocate (modulus(size(exact)), sd(size(exact)))
            call predict_crystals(surrogate, problem%class%stiffnesses(constants), &
               & degree*known%euler_deg(:, n_before + 1:), problem%threads(), modulus, sd, error)
            if (allocated(error)) return
            z = norm2((exact - modulus)/sd)/sqrt(real(size(exact), wp))
         end associate
         call extend(domain, problem%class%stiffnesses(known%constants(:, n_before + 1:)))
         call add_spread(n_spread, round)
         if (allocated(error)) return
         call fit()
      end subroutine add_draws

      !> Compute exact values. Crystals that theory cannot indent are left out.
      subroutine add_values(constants, euler_deg, relative_noise)
         !> GPa, (n_constants, n); degrees, (3, n).
         real(wp), intent(in) :: constants(:, :), euler_deg(:, :), relative_noise
         type(film_type) :: films(size(constants, 2))
         integer, allocatable :: made(:)
         integer :: i

         call indent_films(problem, problem%class%stiffnesses(constants), euler_deg, &
            & problem%threads(), films, error)
         made = pack([(i, i=1, size(films))], films%modulus > 0.0_wp)
         if (size(made) < (1.0_wp - most_failed)*size(films)) return
         if (allocated(error)) deallocate (error)
         call advance_progress(int(size(films), i8))
         associate (n => size(known%modulus) + size(made))
            known%constants = reshape(known%constants, [size(constants, 1), n], &
               & constants(:, made))
            known%euler_deg = reshape(known%euler_deg, [3, n], euler_deg(:, made))
            known%modulus = [known%modulus, films(made)%modulus]
            noise = [noise, spread(relative_noise, 1, size(made))]
         end associate
      end subroutine add_values

      !> Fit the correction to all values.
      subroutine fit()
         type(surrogate_settings_type) :: settings
         class(basis_type), allocatable :: basis
         type(learner_type) :: learner
         class(indenter_type), allocatable :: indenter
         real(wp), allocatable :: terms(:, :), scale(:), growth(:)

         settings%model = 'film'
         settings%degree = 3
         call new_basis(domain, settings, basis, error)
         if (.not. allocated(error)) call new_learner(basis, learner, error)
         if (allocated(error)) return
         call basis%evaluate_crystals(known%constants, known%euler_deg, terms, scale, growth)
         learner%simulations = known
         associate (y => basis%to_y(known%modulus, scale, growth))
            call add_data(learner%design%regression, terms/spread(noise, 1, size(terms, 1)), &
               & y/noise)
         end associate
         call fit_learner(learner, error)
         if (.not. allocated(error)) call surrogate_of(learner, '{}', surrogate, error)
         if (.not. allocated(error)) call new_indenter(problem%settings%indenter, indenter, error)
         if (.not. allocated(error)) surrogate%contact_radius = indenter%contact_radius
      end subroutine fit
   end subroutine train_film
end module film_training
