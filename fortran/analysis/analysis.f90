!> Step 2 of a problem as an object: the problem and a surrogate, the posterior, its chains and what
!> follows from them. Stages, the batch program and the library use it alike: `prepare` sets up the
!> posterior, `infer` samples it. `further_measurements` and `planned_measurements` work on it, too.
module analysis
   use constants_posterior, only: posterior_type
   use assumptions, only: assumption_type, list_assumptions
   use crystal_elasticity, only: averages_type, polycrystal_averages
   use detected_speeds, only: draw_aside, omit_undetected
   use diagnostics, only: diagnosed_type
   use errors, only: error_type
   use further_knowledge, only: conflict_type, expect_gains, find_conflict, gain_type, &
      & without_knowledge
   use halfspace_theory, only: halfspace_moduli
   use kinds, only: nan, wp
   use omp_lib, only: omp_get_wtime
   use model_checks, only: check_model, checks_type
   use posterior_summary, only: find_maximum, combination_type, find_combinations, parameter_type, &
      & predict_grains, predictions_type, summarise_parameters, thinning
   use prior_limits, only: limit_type, list_limits
   use problem, only: problem_type
   use field_reading, only: allowed_error, choose_field_degree, find_field_error
   use problem_posterior, only: free_run, new_table_posterior, &
      & pilot_run, prior_run, sample_aside, sample_posterior, theory_run
   use quantities, only: evaluate_draws, quantity_type, reported_quantities
   use rivals, only: compare_rivals, diagnosis_type
   use samplers, only: chains_type
   use statistics, only: flattened, moments, thinned
   use surrogate_model, only: new_theory_surrogate, predict_crystals, surrogate_type
   use variance_shares, only: find_shares, shares_type, verdict_of
   implicit none
   private
   public :: analysis_type, greatest_p

   !> A misfit of this probability leaves no constant determined.
   real(wp), parameter :: greatest_p = 1.0e-3_wp

   type, extends(diagnosed_type) :: analysis_type
      !> Speeds that cannot be used are removed from it.
      type(problem_type), pointer :: problem => null()
      type(surrogate_type) :: surrogate
      type(posterior_type) :: posterior
      !> The sampler has the logarithms of the parameters beside the constants; here they are the
      !> parameters themselves.
      type(chains_type) :: chains, prior_chains
      !> Names of the parameters.
      character(len=9), allocatable :: names(:)
      type(parameter_type), allocatable :: parameters(:)
      !> The point of greatest density, (parameter). NaN where it is outside the 95 % interval.
      real(wp), allocatable :: most_probable(:)
      !> Shares of measurements, knowledge and prior in the variances.
      type(shares_type), allocatable :: parameter_shares(:), combination_shares(:), &
         & quantity_shares(:)
      type(combination_type), allocatable :: combinations(:)
      !> Changes of the constants if an assumption is wrong.
      type(assumption_type), allocatable :: assumptions(:)
      !> Expected gains from further knowledge.
      type(gain_type), allocatable :: gains(:)
      type(quantity_type), allocatable :: quantities(:)
      !> Mean and sd of each quantity in the posterior, then in the prior, (4, quantity).
      real(wp), allocatable :: quantity_moments(:, :)
      !> Of &knowledge with all other information.
      type(conflict_type) :: conflict
      type(predictions_type) :: predictions
      type(checks_type) :: checks
      !> Other models of the same measurements.
      type(diagnosis_type) :: diagnosis
      !> The limits of the support.
      type(limit_type), allocatable :: limits(:)
      !> Degree of the harmonics that represent the half-space theory, 0 if the surrogate has none,
      !> and the error of the worst grain from this, in its sds.
      integer :: field_degree = 0
      real(wp) :: field_error = 0.0_wp
      !> Mean sd of the surrogate for the grains of the mean crystal, GPa, and mean relative
      !> distance of its simulations from the half-space theory.
      real(wp) :: surrogate_sd = 0.0_wp, surrogate_correction = 0.0_wp
      !> Mean and sd of the constants by the half-space theory alone, GPa, if the surrogate has a
      !> correction.
      real(wp), allocatable :: theory_mean(:), theory_sd(:)
      !> Wall-clock time of the posterior's chains.
      real(wp) :: seconds = 0.0_wp
   contains
      procedure :: prepare, infer, verdict, is_misfit, least_value, most_r_hat
   end type analysis_type

contains

   !> Set up the posterior.
   subroutine prepare(self, error)
      class(analysis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call new_table_posterior(self%problem, self%problem%settings%measurements, &
         & self%problem%data%measurements, self%surrogate, self%posterior, error)
   end subroutine prepare

   !> Sample the posterior and the prior, and summarise the chains.
   subroutine infer(self, error)
      class(analysis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(posterior_type) :: prior, free
      type(chains_type) :: free_chains
      real(wp) :: start

      call omit_undetected(self%problem, self%surrogate, error)
      if (.not. allocated(error)) call self%prepare(error)
      if (allocated(error)) return
      prior = self%posterior
      prior%prior_only = .true.
      start = omp_get_wtime()
      call sample_with_theory()
      if (allocated(error)) return
      self%seconds = omp_get_wtime() - start
      call sample_aside(self%problem, prior, prior_run, self%prior_chains, error)
      if (allocated(error)) return
      if (size(self%posterior%prior%knowledge%mean) > 0) then
         call without_knowledge(self%posterior, free, error)
         if (allocated(error)) return
         call sample_aside(self%problem, free, free_run, free_chains, error)
         if (allocated(error)) return
      end if
      call find_conflict(self%posterior, self%chains, free_chains, self%conflict, error)
      if (allocated(error)) return
      call summarise(self, error)
      if (allocated(error)) return
      if (size(self%surrogate%simulations%modulus) == 0) return
      call test_surrogate()
      if (.not. allocated(error)) call compare_theory()

   contains

      !> Set the error of the surrogate, and its distance from the theory.
      subroutine test_surrogate()
         real(wp), dimension(size(self%surrogate%simulations%modulus)) :: theory
         real(wp), allocatable :: modulus(:), sd(:)

         associate (posterior => self%posterior, n => self%posterior%n_moduli, &
            & known => self%surrogate%simulations)
            if (self%surrogate%contact_radius > 0.0_wp) then
               call halfspace_moduli( &
                  & self%surrogate%basis%domain%class%stiffnesses(known%constants), &
                  & known%euler_deg, 1, theory, error)
               if (allocated(error)) return
               self%surrogate_correction = sum(abs(known%modulus/theory - 1.0_wp))/size(theory)
            end if
            allocate (modulus(n), sd(n))
            call predict_crystals(self%surrogate, &
               & spread(posterior%stiffness(self%parameters%mean), 3, n), posterior%euler(:, :n), &
               & 1, modulus, sd, error)
            if (.not. allocated(error)) self%surrogate_sd = sum(sd)/max(1, n)
         end associate
      end subroutine test_surrogate

      !> Infer the constants by the half-space theory without the specimen correction.
      subroutine compare_theory()
         type(surrogate_type) :: theory
         type(posterior_type) :: posterior
         real(wp), allocatable :: draws(:, :)
         integer :: n

         if (.not. self%posterior%grains%has_theory) return
         call new_theory_surrogate(theory)
         call draw_aside(self%problem, self%problem%settings%measurements, theory, theory_run, &
            & posterior, draws, error)
         if (allocated(error)) return
         n = self%posterior%n_constants
         allocate (self%theory_mean(n), self%theory_sd(n))
         call moments(draws(:n, :), self%theory_mean, self%theory_sd)
      end subroutine compare_theory

      !> Sample the posterior. If the surrogate has the half-space theory, harmonics represent it up
      !> to a degree with a negligible error: draws of a short run determine the degree, and the
      !> draws of the chains check it.
      subroutine sample_with_theory()
         integer, parameter :: checked_draws = 500, most_attempts = 6
         real(wp), allocatable :: test_draws(:, :), new_draws(:, :)
         integer :: attempt, threads
         logical :: is_hopeless

         threads = self%problem%threads()
         if (.not. self%posterior%grains%has_theory) then
            call sample_posterior(self%problem, self%posterior, self%chains, error)
            return
         end if
         call sample_aside(self%problem, self%posterior, pilot_run, self%chains, error)
         if (allocated(error)) return
         test_draws = flattened(self%chains%draws)
         do attempt = 1, most_attempts
            call choose_field_degree(self%posterior, test_draws, threads, error, is_hopeless)
            if (allocated(error)) return
            call sample_posterior(self%problem, self%posterior, self%chains, error)
            if (allocated(error)) return
            new_draws = thinned(self%chains%draws, checked_draws)
            call find_field_error(self%posterior, new_draws, threads, self%field_error, error)
            if (allocated(error)) return
            if (self%field_error < allowed_error .or. is_hopeless) exit
            ! Chains with too low a degree go astray, and the next ones may not return to the
            ! earlier draws. The degree must therefore suffice for both.
            test_draws = reshape([test_draws, new_draws], &
               & [size(test_draws, 1), size(test_draws, 2) + size(new_draws, 2)])
         end do
         self%field_degree = self%posterior%grains%field_degree
      end subroutine sample_with_theory
   end subroutine infer

   !> Compute all results from the chains.
   subroutine summarise(self, error)
      class(analysis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      !> (parameter, draw), (quantity, draw), (combination, draw).
      real(wp), allocatable :: draws(:, :), prior_draws(:, :), values(:, :), prior_values(:, :), &
         & logarithms(:, :)
      integer :: k, threads

      threads = self%problem%threads()
      associate (posterior => self%posterior, chains => self%chains)
         k = posterior%n_constants
         self%names = [character(len=9) :: posterior%prior%class%constants, &
            & posterior%nuisances%name]
         call reported_quantities(posterior%prior%class, self%quantities, error)
         if (allocated(error)) return
         call predict_grains(posterior, chains, threads, self%quantities, &
            & self%predictions, error)
         if (allocated(error)) return
         call check_model(posterior, chains, threads, self%checks)
         self%most_probable = chains%best_draw()
         call find_maximum(posterior, chains, self%most_probable)
         call compare_rivals(self%problem, self%surrogate, posterior, self%most_probable, &
            & self%diagnosis, error)
         if (allocated(error)) return
         draws = flattened(chains%draws(:, ::self%predictions%stride, :))
         prior_draws = flattened(self%prior_chains%draws(:, ::thinning(self%prior_chains, 1), :))
         values = flattened(self%predictions%quantities)
         call find_combinations(posterior%prior, draws, prior_draws, self%combinations, &
            & logarithms, error)
         if (allocated(error)) return
         chains%draws(k + 1:, :, :) = exp(chains%draws(k + 1:, :, :))
         self%most_probable(k + 1:) = exp(self%most_probable(k + 1:))
         call summarise_parameters(chains, threads, self%parameters)
         ! Along a ridge the point of greatest density is noise.
         where (.not. (self%most_probable >= self%parameters%hdi_95(1) &
            & .and. self%most_probable <= self%parameters%hdi_95(2))) self%most_probable = nan
         call find_all_shares()
         if (allocated(error)) return
         call list_assumptions(posterior, self%parameters(:k)%mean, self%parameter_shares(:k), &
            & self%assumptions, error)
         if (allocated(error)) return
         self%limits = list_limits(posterior%prior, draws)
         call expect_gains(posterior%prior, chains%draws, self%gains)
         call evaluate_draws(self%quantities, posterior%prior%class, &
            & flattened(self%prior_chains%draws), prior_values)
      end associate
      allocate (self%quantity_moments(4, size(values, 1)))
      associate (quantity_moments => self%quantity_moments)
         call moments(values, quantity_moments(1, :), quantity_moments(2, :))
         call moments(prior_values, quantity_moments(3, :), quantity_moments(4, :))
         ! The constants are the first quantities. Their moments are those of all draws.
         quantity_moments(1, :k) = self%parameters(:k)%mean
         quantity_moments(2, :k) = self%parameters(:k)%sd
      end associate

   contains

      !> Find the shares of the parameters from as many draws as the time allows, and of
      !> combinations and quantities from fewer.
      subroutine find_all_shares()
         !> Limit of draws times grains for the parameters: each costs a prediction of a modulus.
         integer, parameter :: most_predictions = 150000
         real(wp), allocatable :: parameter_draws(:, :), parameter_values(:, :), other_values(:, :)
         type(shares_type), allocatable :: shares(:)
         real(wp) :: effective
         integer :: n_combinations

         n_combinations = size(logarithms, 1)
         effective = minval(self%parameters%diagnostics%ess_bulk)
         ! Grains of unknown orientation have no shares either: the posterior mean does not depend
         ! linearly on a modulus.
         if (any(self%parameters%diagnostics%r_hat > self%most_r_hat()) &
            & .or. allocated(self%posterior%unknown)) then
            effective = 0.0_wp
         end if
         parameter_draws = thinned(self%chains%draws, &
            & max(size(draws, 2), most_predictions/self%posterior%n_grains))
         parameter_values = parameter_draws
         parameter_draws(k + 1:, :) = log(parameter_draws(k + 1:, :))
         call find_shares(self%posterior, parameter_draws, parameter_values, &
            & min(effective, real(size(parameter_draws, 2), wp)), threads, &
            & self%parameter_shares, error)
         if (allocated(error)) return
         allocate (other_values(n_combinations + size(values, 1), size(draws, 2)))
         other_values(:n_combinations, :) = logarithms
         other_values(n_combinations + 1:, :) = values
         call find_shares(self%posterior, draws, other_values, &
            & min(effective, real(size(draws, 2), wp)), threads, shares, error)
         if (allocated(error)) return
         self%combination_shares = shares(:n_combinations)
         self%quantity_shares = shares(n_combinations + 1:)
         ! The constants are the first quantities.
         self%quantity_shares(:k) = self%parameter_shares(:k)
      end subroutine find_all_shares
   end subroutine summarise

   !> Whether the parameter i is 'determined', 'weak' or 'not_determined', or 'stated' by equal
   !> bounds.
   pure function verdict(self, i)
      class(analysis_type), intent(in) :: self
      integer, intent(in) :: i
      character(len=:), allocatable :: verdict

      verdict = verdict_of(self%parameters(i)%mean, self%parameters(i)%sd, &
         & merge(self%least_value(), 0.0_wp, i <= self%posterior%n_constants), &
         & self%parameter_shares(i))
      if (verdict == 'determined' .and. self%is_misfit(greatest_p)) verdict = 'weak'
      if (i > self%posterior%n_constants) return
      if (self%posterior%prior%is_stated(i)) verdict = 'stated'
   end function verdict

   !> R-hat above which the chains are not draws of one distribution. Chains of the ensemble follow
   !> where independent draws failed: at 1.034 the sds of 21 constants were 12 to 35 % too small.
   pure real(wp) function most_r_hat(self)
      class(analysis_type), intent(in) :: self
      real(wp), parameter :: of_chains = 1.05_wp, of_ensemble = 1.02_wp

      most_r_hat = of_chains
      if (self%problem%settings%sampler%method == 'ensemble' &
         & .and. .not. allocated(self%chains%estimates)) then
         most_r_hat = of_ensemble
      end if
   end function most_r_hat

   !> Whether the residuals are so large that their probability is below p, and that another factor
   !> on the sds matters.
   pure logical function is_misfit(self, p)
      class(analysis_type), intent(in) :: self
      real(wp), intent(in) :: p
      real(wp), parameter :: least_factor = 1.3_wp

      is_misfit = self%diagnosis%p < p .and. self%diagnosis%factor > least_factor
   end function is_misfit

   !> A tenth of Hill's Young's modulus of the mean crystal, GPa. The sd of a constant near zero is
   !> compared with it.
   pure real(wp) function least_value(self)
      class(analysis_type), intent(in) :: self
      type(averages_type) :: averages

      averages = polycrystal_averages(self%posterior%stiffness(self%parameters%mean))
      least_value = 0.1_wp*averages%young
   end function least_value
end module analysis
