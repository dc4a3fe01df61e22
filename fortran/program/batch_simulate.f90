!> The simulations of the batch program: the crystals of a file, kept in the campaign of the output folder as they come.
module batch_simulate
   use, intrinsic :: iso_fortran_env, only: error_unit
   use batch_tables, only: write_curves, write_moduli
   use campaign, only: campaign_name, campaign_type, row_type
   use errors, only: error_type, machine_failure, raise
   use kinds, only: degree, i8, wp
   use namelist_file, only: place
   use physics_identity, only: identity_text
   use point_index, only: number_equal
   use problem, only: problem_type
   use simulate, only: new_simulator, outcome_failed, outcome_type, outcome_waiting, simulation_error, simulator_type
   use text, only: to_text
   use parallelism, only: thread_count
   implicit none
   private
   public :: simulate_crystals, simulate_into

contains

   !> Simulate every crystal of the file that the campaign does not have yet.
   subroutine simulate_crystals(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      !> One line on what was done.
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(row_type), allocatable :: rows(:)
      type(row_type) :: stored
      type(campaign_type) :: store
      type(simulator_type), allocatable :: simulator
      character(len=:), allocatable :: warning
      real(wp) :: largest(self%crystals%n)
      logical :: found
      integer :: i, new, failed

      associate (settings => self%settings, points => self%crystals)
         allocate (rows(points%n))
         call store%open(output//'/'//campaign_name, identity_text(settings), error)
         do i = 1, points%n
            if (allocated(error)) return
            associate (class => points%classes(points%class(i)))
               rows(i)%symmetry = class%name
               rows(i)%constants = points%constants(:class%n_constants, i)
            end associate
            rows(i)%euler_deg = points%euler_deg(:, i)
            call store%find(rows(i)%symmetry, rows(i)%constants, rows(i)%euler_deg, stored, found, error)
            if (found) rows(i) = stored
         end do
         if (allocated(error)) return
         new = 0
         if (any(rows%outcome%status == outcome_waiting)) then
            call new_simulator(settings, simulator, error)
            if (.not. allocated(error)) call simulate_into(store, simulator, points%stiffness, &
               & thread_count(self%settings%execution%workers), rows, new, error)
            if (allocated(error)) then
               error%message = place(self%path, 'simulation', '')//error%message
               return
            end if
         end if
         call store%close()
         call write_moduli(self, output//'/moduli.csv', rows, error)
         if (.not. allocated(error)) call write_curves(self, output//'/curves.csv', rows, error)
         if (allocated(error)) return
         failed = count(rows%outcome%status == outcome_failed)
         if (failed == points%n) then
            call raise(error, place(self%path, 'simulation', '')//'all of '//to_text(failed)//' simulations failed, the first: ' &
               & //rows(1)%outcome%message)
            return
         end if
         do i = 1, points%n
            if (rows(i)%outcome%status == outcome_failed) write (error_unit, '(4a)') 'warning: crystal ', to_text(i), &
               & ' could not be simulated: ', rows(i)%outcome%message
         end do
         call simulation_error(settings, points%stiffness, largest, warning)
         if (len(warning) > 0) write (error_unit, '(3a)') 'warning: ', place(self%path, 'simulation', ''), warning
         told = to_text(points%n)//' crystals, '//to_text(new)//' new, '//to_text(failed)//' failed: '//output//'/moduli.csv'
      end associate
   end subroutine simulate_crystals

   !> Simulate on threads what waits among `rows`, a point that is there twice once, and store each outcome as soon as it is there. What
   !> the machine could not do is tried once more, alone. An error starts no more; what is under way is still stored.
   subroutine simulate_into(store, simulator, stiffness, n_threads, rows, new, error)
      type(campaign_type), intent(inout) :: store
      type(simulator_type), intent(in) :: simulator
      !> Of each row, GPa (6, 6, rows).
      real(wp), intent(in) :: stiffness(:, :, :)
      integer, intent(in) :: n_threads
      !> Points, in the order of their positions; those without one get the next.
      type(row_type), intent(inout) :: rows(:)
      !> How many were simulated.
      integer, intent(out) :: new
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: unsaved
      integer :: first(size(rows)), unstored(size(rows)), n_unstored, position
      logical :: again(size(rows)), stopped
      integer(i8) :: last_told
      integer :: i

      new = 0
      n_unstored = 0
      again = .false.
      stopped = .false.
      first = first_of_equals(rows)
      call store%next_position(position, error)
      if (allocated(error)) return
      do i = 1, size(rows)
         if (rows(i)%outcome%status /= outcome_waiting .or. first(i) /= i .or. rows(i)%position >= 0) cycle
         rows(i)%position = position
         position = position + 1
      end do
      call system_clock(last_told)
      !$omp parallel do num_threads(n_threads) schedule(dynamic, 1)
      do i = 1, size(rows)
         if (rows(i)%outcome%status == outcome_waiting .and. first(i) == i) call simulate_one(i, .false.)
      end do
      !$omp end parallel do
      do i = 1, size(rows)
         if (again(i)) call simulate_one(i, .true.)
         if (first(i) /= i) rows(i) = rows(first(i))
      end do
      call store_rows(unsaved)
      if (allocated(unsaved) .and. .not. allocated(error)) error = unsaved

   contains

      subroutine simulate_one(i, alone)
         integer, intent(in) :: i
         logical, intent(in) :: alone
         integer, parameter :: interval = 5
         type(outcome_type) :: outcome
         type(error_type), allocatable :: refusal
         integer(i8) :: now, rate
         logical :: late, enough

         !$omp atomic read
         enough = stopped
         if (enough) return
         call simulator%run(stiffness(:, :, i), rows(i)%euler_deg*degree, outcome, refusal)
         !$omp critical (batch_outcomes)
         call system_clock(now, rate)
         late = now - last_told > interval*rate
         if (.not. allocated(refusal)) then
            rows(i)%outcome = outcome
            new = new + 1
            n_unstored = n_unstored + 1
            unstored(n_unstored) = i
            ! A finite element result is never lost; the theory's, microseconds each, are stored now and then.
            if (late .or. outcome%elements > 0) call store_rows(refusal)
         else if (refusal%status == machine_failure .and. .not. alone) then
            again(i) = .true.
            deallocate (refusal)
         end if
         if (allocated(refusal) .and. .not. allocated(error)) error = refusal
         !$omp atomic write
         stopped = allocated(error)
         if (late) then
            call system_clock(last_told)
            write (error_unit, '(4a)') 'simulate: ', to_text(count(rows%outcome%status /= outcome_waiting)), ' of ', &
               & to_text(size(rows))
         end if
         !$omp end critical (batch_outcomes)
      end subroutine simulate_one

      subroutine store_rows(error)
         type(error_type), allocatable, intent(out) :: error

         call store%add_rows(rows, unstored(:n_unstored), error)
         n_unstored = 0
      end subroutine store_rows
   end subroutine simulate_into

   !> The first row with the same crystal, by class and constants, in the same orientation, for each.
   function first_of_equals(rows) result(first)
      type(row_type), intent(in) :: rows(:)
      integer, allocatable :: first(:)
      real(wp), allocatable :: points(:, :)
      integer :: i, j, longest, most

      longest = 0
      most = 0
      do i = 1, size(rows)
         longest = max(longest, len(rows(i)%symmetry))
         most = max(most, size(rows(i)%constants))
      end do
      allocate (points(longest + 3 + most, size(rows)), source=0.0_wp)
      do i = 1, size(rows)
         associate (row => rows(i), point => points(:, i))
            do j = 1, len(row%symmetry)
               point(j) = iachar(row%symmetry(j:j))
            end do
            point(longest + 1:longest + 3) = row%euler_deg
            point(longest + 4:longest + 3 + size(row%constants)) = row%constants
         end associate
      end do
      first = number_equal(points)
   end function first_of_equals
end module batch_simulate
