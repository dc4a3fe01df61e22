!> The simulations of a stage on the threads of this process.
module simulation_loop
   use abstract_stage, only: stage_type
   use errors, only: error_type, machine_failure
   use kinds, only: degree, i8
   use namelist_file, only: place
   use machine, only: thread_count
   use running_command, only: advance_progress, begin_progress, end_progress
   use simulate, only: new_simulator, outcome_type, simulator_type
   implicit none
   private
   public :: simulate_all

   type :: held_simulator_type
      type(simulator_type), allocatable :: simulator
      !> Jobs that still need it.
      integer :: left = 0
   end type held_simulator_type

contains

   !> Have all simulations made that a stage wants. An error starts no more; what is under way is still taken.
   subroutine simulate_all(stage, error)
      class(stage_type), intent(inout) :: stage
      type(error_type), allocatable, intent(out) :: error
      type(held_simulator_type), allocatable :: held(:)
      type(error_type), allocatable :: ignored
      logical :: stopped
      integer :: i

      call begin_progress('simulations', int(stage%n_expected, i8))
      allocate (held(size(stage%physics)))
      do
         call stage%want(error)
         if (allocated(error) .or. size(stage%jobs) == 0) exit
         stopped = .false.
         held%left = [(count(stage%jobs%physics == i), i=1, size(held))]
         !$omp parallel do num_threads(thread_count(stage%problem%settings%execution%workers)) schedule(dynamic, 1)
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
         logical :: enough

         !$omp atomic read
         enough = stopped
         if (enough) return
         associate (job => stage%jobs(i), needed => held(stage%jobs(i)%physics))
            !$omp critical (simulation_loop_simulators)
            if (.not. allocated(needed%simulator)) then
               allocate (needed%simulator)
               call new_simulator(stage%physics(job%physics), needed%simulator, own)
            end if
            ! What could not be made is made anew for the next job.
            if (allocated(own) .and. allocated(needed%simulator)) deallocate (needed%simulator)
            !$omp end critical (simulation_loop_simulators)
            if (allocated(own)) then
               own%message = place(stage%problem%path, 'simulation', '')//own%message
            else
               call needed%simulator%run(job%stiffness, job%euler_deg*degree, outcome, own)
            end if
            !$omp critical (simulation_loop_outcomes)
            if (allocated(own)) then
               if (own%status == machine_failure) then
                  outcome%message = own%message
                  deallocate (own)
               end if
            end if
            if (.not. allocated(own)) call stage%take(job%number, outcome, own)
            if (allocated(own) .and. .not. allocated(error)) error = own
            needed%left = needed%left - 1
            ! Of many physics each has few jobs; of one there are more to come.
            if (needed%left == 0 .and. size(held) > 1 .and. allocated(needed%simulator)) deallocate (needed%simulator)
            call advance_progress(1_i8)
            !$omp end critical (simulation_loop_outcomes)
         end associate
         !$omp atomic write
         stopped = allocated(error)
      end subroutine simulate_one
   end subroutine simulate_all
end module simulation_loop
