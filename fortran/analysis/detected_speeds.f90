!> Speeds of waves that cannot have been measured: at crystals of the posterior, another wave is
!> detected in that direction. They are left out of the measurements.
module detected_speeds
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use kinds, only: degree, wp
   use observables, only: path_type
   use point_tables, only: points_type
   use problem, only: problem_type
   use problem_posterior, only: pilot_run, new_table_posterior, run_type, sample_aside
   use rayleigh_wave, only: new_surface, surface_type, surface_waves, wave_type
   use samplers, only: chains_type
   use settings_schema, only: measurements_settings_type
   use statistics, only: flattened
   use surrogate_model, only: surrogate_type
   use velocity_tables, only: append_velocities
   implicit none
   private
   public :: are_detected, omit_undetected, draw_aside

contains

   !> Leave out the speeds that `find_detected` leaves out.
   subroutine omit_undetected(problem, surrogate, error)
      type(problem_type), intent(inout) :: problem
      type(surrogate_type), intent(in) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(points_type), allocatable :: detected

      call find_detected(problem, problem%settings%measurements, surrogate, detected, error)
      if (allocated(error)) return
      call move_alloc(detected, problem%data%measurements)
      problem%data%are_detected = .true.
   end subroutine omit_undetected

   !> The measurements without the speeds whose wave is not the one that a measurement shows, at
   !> some crystals of the posterior.
   subroutine find_detected(problem, model, surrogate, detected, error)
      type(problem_type), intent(in) :: problem
      !> Of the errors. In the first round they have Student's distribution instead, since another
      !> wave that was measured may be far off.
      type(measurements_settings_type), intent(in) :: model
      type(surrogate_type), intent(in) :: surrogate
      type(points_type), allocatable, intent(out) :: detected
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: most_rounds = 4
      type(measurements_settings_type) :: model_of_round
      type(posterior_type) :: posterior
      type(chains_type) :: chains
      logical, allocatable :: retained(:)
      integer :: round

      if (allocated(problem%data%measurements)) detected = problem%data%measurements
      if (problem%data%are_detected .or. .not. allocated(problem%data%velocities)) return
      retained = spread(.true., 1, problem%data%velocities%n)
      model_of_round = model
      model_of_round%likelihood = 'student'
      model_of_round%student_dof = 2.0_wp
      do round = 1, most_rounds
         call append_velocities(detected, problem%data%velocities, retained)
         if (detected%n == 0) exit
         call new_table_posterior(problem, model_of_round, detected, surrogate, posterior, &
            & error)
         if (allocated(error)) return
         call sample_aside(problem, posterior, pilot_run, chains, error)
         if (allocated(error)) return
         ! A speed that was left out in one round is not taken up in a later one.
         retained = retained .and. are_detected(posterior, chains%draws(:, :, 1), &
            & problem%data%velocities%euler_deg, problem%data%velocities%paths)
         if (round > 1 .and. count(retained) == posterior%n_grains - posterior%n_moduli) exit
         model_of_round = model
      end do
      call append_velocities(detected, problem%data%velocities, retained)
      if (detected%n == 0) then
         call problem%refuse('measurements', 'velocities', 'all speeds are left out: at crystals ' &
            & //'of the posterior their wave is not the one that is measured. Choose other ' &
            & //'directions', error)
      end if
   end subroutine find_detected

   !> Whether waves are those that a measurement shows, at all but a few of some crystals.
   function are_detected(posterior, draws, euler_deg, paths) result(detected)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw); Bunge-Euler angles, degrees, (3, n).
      real(wp), intent(in) :: draws(:, :), euler_deg(:, :)
      !> (n).
      type(path_type), intent(in) :: paths(:)
      logical :: detected(size(paths))
      !> Of the draws, what is no chance.
      real(wp), parameter :: some = 0.05_wp
      type(surface_type) :: surface
      type(wave_type) :: waves(size(detected))
      integer :: weak(size(detected)), i

      call new_surface(euler_deg*degree, paths, surface)
      weak = 0
      do i = 1, size(draws, 2)
         call surface_waves(surface, reshape(posterior%stiffness(draws(:, i)), [6, 6, 1]), waves)
         weak = weak + merge(0, 1, waves%is_detected())
      end do
      detected = weak <= some*size(draws, 2)
   end function are_detected

   !> Draw from the posterior of a problem with another surrogate or model of the errors.
   subroutine draw_aside(problem, model, surrogate, run, posterior, draws, error)
      type(problem_type), intent(in) :: problem
      type(measurements_settings_type), intent(in) :: model
      type(surrogate_type), intent(in) :: surrogate
      type(run_type), intent(in) :: run
      type(posterior_type), intent(out) :: posterior
      !> (parameter, draw).
      real(wp), allocatable, intent(out) :: draws(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(points_type), allocatable :: detected
      type(chains_type) :: chains

      call find_detected(problem, model, surrogate, detected, error)
      if (allocated(error)) return
      call new_table_posterior(problem, model, detected, surrogate, posterior, error)
      if (allocated(error)) return
      call sample_aside(problem, posterior, run, chains, error)
      if (allocated(error)) return
      draws = flattened(chains%draws)
   end subroutine draw_aside
end module detected_speeds
