!> Performs the simulations of a stage on the threads of this process.
module simulation_loop
   use abstract_stage, only: stage_type
   use errors, only: error_type, machine_failure
   use kinds, only: degree, i8
   use progress, only: advance_progress, begin_progress, end_progress
   use simulate, only: new_simulator, outcome_type, simulator_type
   implicit none
   private
   public :: simulate_all

contains

   !> Make all simulations that a stage requests. After an error no more are started, but the stage
   !> still receives the outcomes of those that are running.
   subroutine simulate_all(stage, error)
      class(stage_type), intent(inout) :: stage
      type(error_type), allocatable, intent(out) :: error
      type(simulator_type), allocatable :: simulator
      type(error_type), allocatable :: ignored
      logical :: stopped
      integer :: i

      call begin_progress('simulations', int(stage%n_expected, i8))
      do
         call stage%want(error)
         if (allocated(error) .or. size(stage%jobs) == 0) exit
         if (.not. allocated(simulator)) then
            allocate (simulator)
            call new_simulator(stage%problem%settings, simulator, error)
            call stage%problem%locate('simulation', '', error)
            if (allocated(error)) exit
         end if
         stopped = .false.
         !$omp parallel do num_threads(stage%problem%threads()) schedule(dynamic, 1)
         do i = 1, size(stage%jobs)
            call simulate_one(i)
         end do
         !$omp end parallel do
         if (.not. allocated(error)) cycle
         call stage%campaign%flush(ignored)
         exit
      end do
      call end_progress()

   contains

      subroutine simulate_one(i)
         integer, intent(in) :: i
         type(outcome_type) :: outcome
         type(error_type), allocatable :: own
         logical :: is_stopped

         !$omp atomic read
         is_stopped = stopped
         if (is_stopped) return
         associate (job => stage%jobs(i))
            call simulator%run(job%stiffness, job%euler_deg*degree, outcome, own)
            !$omp critical (simulation_loop_outcomes)
            if (allocated(own)) then
               if (own%status == machine_failure) then
                  outcome%message = own%line()
                  deallocate (own)
               end if
            end if
            if (.not. allocated(own)) call stage%take(job%number, outcome, own)
            if (allocated(own) .and. .not. allocated(error)) error = own
            call advance_progress(1_i8)
            !$omp end critical (simulation_loop_outcomes)
         end associate
         !$omp atomic write
         stopped = allocated(error)
      end subroutine simulate_one
   end subroutine simulate_all
end module simulation_loop
