!> The sd that each constant is expected to have, before anything is measured.
!>
!> Several synthetic data sets have the moduli, and the speeds, of grains of the stated crystal with
!> normal noise. Short chains sample the posterior of each data set, with the prior, the knowledge
!> and the errors that `extract` would use. The expected sd is the median over the data sets. An
!> expansion about the crystal is not enough: it gives a fifth of the sd if the long tails of the
!> prior determine the result.
module planned_measurements
   use analysis, only: analysis_type
   use errors, only: error_type
   use json, only: json_type
   use kinds, only: wp
   use measured_grains, only: measured_type
   use observables, only: new_observable, observable_type
   use problem_posterior, only: new_measured_posterior, run_type, sample_aside, shared_errors
   use quantities, only: evaluate_quantities
   use samplers, only: chains_type
   use settings_schema, only: measurements_settings_type
   use statistics, only: flattened, median, moments
   use synthetic_grains, only: experiment_type, measure_grains
   use text, only: join, to_text
   implicit none
   private
   public :: check_plan, plan_measurements

   !> Data sets of each number of grains and noise; the chains of each, short because the median
   !> over the data sets is more precise than each sd; and the first of their random streams.
   integer, parameter :: n_sets = 8, burn_in = 2000, samples = 2000, n_chains = 2, &
      & first_stream = 6000000

contains

   !> Write the expected sds for every number of grains and noise into the object of a `page`.
   subroutine plan_measurements(self, page, error)
      type(analysis_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      type(chains_type) :: chains
      real(wp), allocatable :: draws(:, :)
      real(wp), dimension(self%problem%class%n_constants) :: mean
      real(wp) :: sd(size(mean), n_sets)
      character(len=:), allocatable :: names
      integer :: i, j, k

      call check_plan(self, error)
      if (allocated(error)) return
      names = join(self%problem%class%constants, ', ')
      associate (plan => self%problem%settings%plan)
         call page%put_numbers(names, plan%constants, 'constants')
         call page%begin_array('results')
         do i = 1, size(plan%grains)
            do j = 1, size(plan%noise)
               do k = 1, n_sets
                  call new_synthetic_posterior(self, [i, j, k], error)
                  if (allocated(error)) return
                  call sample_aside(self%problem, self%posterior, run_type(burn_in, samples, &
                     & n_chains, first_stream + n_chains*k), chains, error)
                  if (allocated(error)) return
                  draws = flattened(chains%draws(:size(mean), :, :))
                  call moments(draws, mean, sd(:, k))
               end do
               call page%begin_object('')
               call page%put_numbers('grains, noise', [plan%grains(i), plan%noise(j)])
               call page%put_numbers(names, &
                  & [(median(n_sets, sd(k, :)), k=1, size(plan%constants))], 'sd')
               call page%end_object()
            end do
         end do
      end associate
      call page%end_array()
   end subroutine plan_measurements

   !> Refuse a plan whose first data set has no posterior, whose crystal the prior excludes, or
   !> whose knowledge contradicts the crystal.
   subroutine check_plan(self, error)
      type(analysis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Deviations of the knowledge from the crystal that are allowed, in sds.
      real(wp), parameter :: greatest_deviation = 3.0_wp
      real(wp), allocatable :: values(:)
      integer :: k

      call new_synthetic_posterior(self, [1, 1, 1], error)
      if (allocated(error)) return
      associate (crystal => self%problem%settings%plan%constants, &
         & known => self%posterior%prior%knowledge)
         if (.not. self%posterior%prior%admits(crystal, self%problem%class%stiffness(crystal))) then
            call self%problem%refuse('plan', 'constants', 'the crystal is outside the limits of ' &
               & //'the prior, or the domain of the surrogate', error)
            return
         end if
         allocate (values(size(known%mean)))
         call evaluate_quantities(known%quantities, self%problem%class%stiffness(crystal), values)
         k = findloc(abs(values - known%mean) > greatest_deviation*known%sd(), .true., dim=1)
         if (k > 0) then
            call self%problem%refuse('knowledge', 'mean', to_text(known%mean(k)) &
               & //' is more than three sds from the '//known%quantities(k)%name &
               & //' of the crystal, '//to_text(values(k), 4), error)
         end if
      end associate
   end subroutine check_plan

   !> The posterior of synthetic measurements of the stated crystal.
   subroutine new_synthetic_posterior(self, number, error)
      type(analysis_type), intent(inout) :: self
      !> Of the grains and of the noise in the lists of &plan, and of the data set.
      integer, intent(in) :: number(3)
      type(error_type), allocatable, intent(out) :: error
      type(measurements_settings_type) :: model
      type(observable_type) :: observable
      type(experiment_type) :: experiment
      type(measured_type) :: measured
      real(wp), allocatable :: stated(:, :)

      associate (problem => self%problem, plan => self%problem%settings%plan, &
         & stated_problem => self%problem%settings%problem)
         model = problem%settings%measurements
         if (.not. allocated(model%modulus_kind)) model%modulus_kind = 'indentation_modulus'
         call new_observable(model%modulus_kind, model, observable, error)
         if (allocated(error)) return
         experiment%n_grains = nint(plan%grains(number(1)))
         experiment%seed = stated_problem%seed
         experiment%streams = [-1 - number(3), -1 - n_sets - number(3)]
         experiment%noise = plan%noise(number(2))
         experiment%scatter_sd = model%scatter_sd
         experiment%orientation_sd_deg = model%orientation_sd_deg
         if (allocated(plan%velocity_noise)) experiment%velocity_noise = plan%velocity_noise
         if (allocated(stated_problem%density_kg_m3)) then
            experiment%density = stated_problem%density_kg_m3
         end if
         call measure_grains(experiment, self%surrogate, observable, &
            & problem%class%stiffness(plan%constants), measured, error)
         if (allocated(error)) return
         ! Each grain has the mean of the shared errors that the user stated for measured grains.
         allocate (stated(experiment%n_grains, 0))
         if (allocated(problem%data%shared_errors)) then
            stated = spread(sum(problem%data%shared_errors, 1) &
               & /size(problem%data%shared_errors, 1), 1, experiment%n_grains)
         end if
         measured%shared = shared_errors(problem, stated, size(measured%modulus))
         call new_measured_posterior(problem, model, measured, self%surrogate, self%posterior, &
            & error)
      end associate
   end subroutine new_synthetic_posterior
end module planned_measurements
