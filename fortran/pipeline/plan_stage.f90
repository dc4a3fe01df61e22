!> `plan`: the sd that each constant is expected to have, before anything is measured.
!>
!> Grains get the moduli, and the speeds, of the stated crystal with normal noise, several times.
!> Each of these data sets has the posterior that `extract` would sample, with its prior, knowledge
!> and errors, and short chains; the median of the sds over the data sets is what is to be expected.
!> An expansion about the crystal would not do: where the long tails of the prior decide, it gives a
!> fifth of the sd.
module plan_stage
   use crystal_elasticity, only: path_type, rayleigh
   use errors, only: error_type, prefix_error, refuse
   use extract_stage, only: extract_stage_type
   use json, only: json_type
   use kinds, only: degree, wp
   use namelist_file, only: place
   use observables, only: new_observable, observable_type
   use point_tables, only: points_type
   use problem, only: problem_type
   use problem_posterior, only: draw_aside, new_problem_posterior, run_type
   use quantities, only: evaluate_quantities
   use random, only: new_random_stream, random_stream_type
   use rayleigh_wave, only: rayleigh_waves, wave_speed, wave_type
   use statistics, only: median, moments
   use surrogate_model, only: load_named_surrogate, predict_crystals
   use text, only: join, to_text
   use velocity_tables, only: append_velocities
   implicit none
   private
   public :: plan_stage_type

   type, extends(extract_stage_type) :: plan_stage_type
   contains
      procedure :: begin, finish
   end type plan_stage_type

   !> Data sets of each number of grains and noise; the chains of each, and where their random
   !> streams begin.
   integer, parameter :: n_sets = 8, burn_in = 2000, samples = 2000, n_chains = 2, &
      & first_stream = 6000000

contains

   !> The surrogate, and what the plan is refused for.
   subroutine begin(self, error)
      class(plan_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%done = self%output//'/plan.json'
      call load_named_surrogate(self%problem%settings%surrogate%file, self%problem%class%name, &
         & self%places, self%surrogate, error)
      call prefix_error(error, place(self%problem%path, 'surrogate', 'file'))
      if (allocated(error)) return
      call check_plan(self, error)
   end subroutine begin

   !> The expected sds for every number of grains and noise. Of the stage it needs the problem and
   !> the surrogate alone.
   subroutine finish(self, page, error)
      class(plan_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      type(problem_type) :: used
      real(wp), allocatable :: draws(:, :)
      real(wp), dimension(self%problem%class%n_constants + 1) :: mean
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
                  call make_up(self, [i, j, k], used, error)
                  if (allocated(error)) return
                  call draw_aside(used, self%surrogate, run_type(burn_in, samples, n_chains, &
                     & first_stream + n_chains*k), self%posterior, draws, error)
                  if (allocated(error)) return
                  call moments(draws, mean(:size(draws, 1)), sd(:size(draws, 1), k))
               end do
               call page%begin_object()
               call page%put_numbers('grains, noise', [plan%grains(i), plan%noise(j)])
               call page%put_numbers(names, &
                  & [(median(n_sets, sd(k, :)), k=1, size(plan%constants))], 'sd')
               call page%end_object()
            end do
         end do
      end associate
      call page%end_array()
   end subroutine finish

   !> Refuse what the first data set would be refused for, and a crystal that the prior excludes.
   subroutine check_plan(self, error)
      class(plan_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      !> More is no chance.
      real(wp), parameter :: far = 3.0_wp
      type(problem_type) :: used
      real(wp), allocatable :: values(:)
      integer :: k

      call make_up(self, [1, 1, 1], used, error)
      if (allocated(error)) return
      call new_problem_posterior(used, self%surrogate, self%posterior, error)
      if (allocated(error)) return
      associate (crystal => self%problem%settings%plan%constants, &
         & known => self%posterior%prior%knowledge)
         if (.not. self%posterior%prior%admits(crystal, self%problem%class%stiffness(crystal))) then
            call refuse(error, place(self%problem%path, 'plan', 'constants') &
               & //'the crystal is outside the limits of &prior, or the domain of the surrogate')
         end if
         if (allocated(error)) return
         allocate (values(size(known%mean)))
         call evaluate_quantities(known%quantities, self%problem%class%stiffness(crystal), values)
         k = findloc(abs(values - known%mean) > far*known%sd(), .true., dim=1)
         if (k > 0) then
            call refuse(error, place(self%problem%path, 'knowledge', 'mean') &
               & //to_text(known%mean(k))//' is more than three sds from the ' &
               & //known%quantities(k)%name//' of the crystal of &plan, '//to_text(values(k), 4))
         end if
      end associate
   end subroutine check_plan

   !> The problem with made-up measurements. Those of fewer grains, and of less noise, are the same
   !> but for that.
   subroutine make_up(self, number, used, error)
      class(plan_stage_type), intent(in) :: self
      !> Of the grains and of the noise in the lists of &plan, and of the data set.
      integer, intent(in) :: number(3)
      type(problem_type), intent(out) :: used
      type(error_type), allocatable, intent(out) :: error
      type(observable_type) :: observable
      type(random_stream_type) :: stream, of_waves
      type(wave_type), allocatable :: waves(:)
      real(wp), allocatable :: z(:, :), unused(:)
      real(wp) :: c(6, 6), noise
      integer :: i, j, n

      used = self%problem
      n = nint(used%settings%plan%grains(number(1)))
      noise = used%settings%plan%noise(number(2))
      allocate (z(6, n), unused(n), source=0.0_wp)
      allocate (waves(n))
      used%measurements = points_type(n=n, row=[(i, i=1, n)], group=spread(1, 1, n), &
         & orientation_sd_deg=spread(-1.0_wp, 1, n), modulus_gpa=unused, sd_gpa=unused, &
         & paths=[(path_type(), i=1, n)])
      ! Of the errors that were stated they have those of the mean grain.
      if (allocated(used%shared_errors)) then
         used%shared_errors = spread(sum(self%problem%shared_errors, &
            & 1)/size(self%problem%shared_errors, 1), 1, n)
      end if
      stream = new_random_stream(used%settings%problem%seed, -1 - number(3))
      of_waves = new_random_stream(used%settings%problem%seed, -1 - n_sets - number(3))
      do i = 1, n
         do j = 1, 3
            call stream%uniform(z(j, i))
         end do
         call stream%normal(z(4, i))
         call of_waves%uniform(z(5, i))
         call of_waves%normal(z(6, i))
      end do
      associate (grains => used%measurements, asked => used%settings%measurements, &
         & crystal => self%problem%settings%plan%constants)
         grains%euler_deg = reshape([(360.0_wp*z(1, i), acos(2.0_wp*z(2, i) - 1.0_wp)/degree, &
            & 360.0_wp*z(3, i), i=1, n)], [3, n])
         c = used%class%stiffness(crystal)
         call predict_crystals(self%surrogate, spread(c, 3, n), grains%euler_deg*degree, 1, &
            & grains%modulus_gpa, unused, error)
         if (.not. allocated(asked%modulus_kind)) asked%modulus_kind = 'indentation_modulus'
         if (allocated(error)) return
         call new_observable(asked%modulus_kind, asked, observable, error)
         if (allocated(error)) return
         call observable%to_measured(grains%modulus_gpa, unused)
         grains%sd_gpa = noise*grains%modulus_gpa
         grains%modulus_gpa = grains%modulus_gpa*(1.0_wp + hypot(noise, asked%scatter_sd)*z(4, :))
         if (.not. allocated(used%settings%plan%velocity_noise)) return
         noise = used%settings%plan%velocity_noise
         used%velocities = grains
         associate (speeds => used%velocities)
            speeds%paths = [(path_type(rayleigh, 180.0_wp*z(5, i)), i=1, n)]
            call rayleigh_waves(spread(c, 3, n), speeds%euler_deg, speeds%paths, waves, error)
            speeds%modulus_gpa = wave_speed(waves%modulus, used%settings%problem%density_kg_m3)
            speeds%sd_gpa = noise*speeds%modulus_gpa
            speeds%modulus_gpa = speeds%modulus_gpa*(1.0_wp + noise*z(6, :))
         end associate
      end associate
      call append_velocities(used%measurements, used%velocities, waves%is_detected())
      used%are_detected = .true.
   end subroutine make_up
end module plan_stage
