!> The simulations of the batch program: the crystals of a file, kept in `simulations.csv` as they come.
module batch_simulate
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: iso_fortran_env, only: error_unit
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists, read_text_file, replace_file
   use kinds, only: degree, i8, wp
   use namelist_file, only: place
   use numbers, only: number_text
   use physics_identity, only: identity_text
   use point_tables, only: points_type, read_crystals
   use problem, only: problem_type
   use settings_groups, only: simulation_settings_type
   use simulate, only: new_simulator, outcome_done, outcome_failed, outcome_type, outcome_waiting, simulation_error, &
      & simulator_type
   use tables, only: csv_cell
   use text, only: to_text
   use threads, only: thread_count
   implicit none
   private
   public :: simulate_crystals, simulations_name

   character(len=*), parameter :: simulations_name = 'simulations.csv'
   character, parameter :: newline = achar(10)

contains

   !> Simulate every crystal of the file that `simulations.csv` does not have yet.
   subroutine simulate_crystals(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      !> One line on what was done.
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(outcome_type), allocatable :: outcomes(:)
      type(simulation_settings_type) :: settings
      class(simulator_type), allocatable :: simulator
      character(len=:), allocatable :: path, physics, warning
      real(wp) :: largest(self%crystals%n)
      integer :: new, failed

      path = output//'/'//simulations_name
      settings = self%settings%simulation
      physics = identity_text(settings)
      allocate (outcomes(self%crystals%n))
      if (file_exists(path)) call recall(self, path, physics, outcomes, error)
      if (allocated(error)) return
      new = count(outcomes%status == outcome_waiting)
      if (new > 0) then
         call new_simulator(settings, simulator, error)
         if (.not. allocated(error)) call simulate_waiting(self, simulator, path, physics, outcomes, error)
         if (allocated(error)) then
            error%message = place(self%path, 'simulation', '')//error%message
            return
         end if
      end if
      failed = count(outcomes%status == outcome_failed)
      if (failed == size(outcomes)) then
         call raise(error, place(self%path, 'simulation', '')//'all of '//to_text(failed)//' simulations failed, the first: ' &
            & //outcomes(1)%message)
         return
      end if
      call simulation_error(settings, self%crystals%stiffness, largest, warning)
      if (len(warning) > 0) write (error_unit, '(3a)') 'warning: ', place(self%path, 'simulation', ''), warning
      told = to_text(self%crystals%n)//' crystals, '//to_text(new)//' new, '//to_text(failed)//' failed: '//path
   end subroutine simulate_crystals

   !> Simulate on threads what waits; each result is kept as soon as it is there. An error starts no more.
   subroutine simulate_waiting(self, simulator, path, physics, outcomes, error)
      type(problem_type), intent(in) :: self
      class(simulator_type), intent(in) :: simulator
      character(len=*), intent(in) :: path, physics
      type(outcome_type), intent(inout) :: outcomes(:)
      type(error_type), allocatable, intent(out) :: error
      type(error_type), allocatable :: unsaved
      integer(i8) :: last_told
      logical :: stopped
      integer :: i

      stopped = .false.
      call system_clock(last_told)
      !$omp parallel do num_threads(thread_count(self%settings%execution%workers)) schedule(dynamic, 1)
      do i = 1, self%crystals%n
         if (outcomes(i)%status == outcome_waiting) call simulate_one(i)
      end do
      !$omp end parallel do
      if (allocated(unsaved)) return
      call save_outcomes(self, path, physics, outcomes, unsaved)
      if (allocated(unsaved) .and. .not. allocated(error)) error = unsaved

   contains

      subroutine simulate_one(i)
         integer, intent(in) :: i
         integer, parameter :: interval = 5
         type(outcome_type) :: outcome
         type(error_type), allocatable :: refusal
         integer(i8) :: now, rate
         logical :: late, enough

         !$omp atomic read
         enough = stopped
         if (enough) return
         call simulator%run(self%crystals%stiffness(:, :, i), self%crystals%euler_deg(:, i)*degree, outcome, refusal)
         !$omp critical (batch_outcomes)
         outcomes(i) = outcome
         call system_clock(now, rate)
         late = now - last_told > interval*rate
         ! A finite element result is never lost; the theory's, microseconds each, are saved now and then.
         if ((late .or. outcome%elements > 0) .and. .not. allocated(error)) then
            call save_outcomes(self, path, physics, outcomes, unsaved)
            if (allocated(unsaved)) refusal = unsaved
         end if
         if (allocated(refusal) .and. .not. allocated(error)) error = refusal
         !$omp atomic write
         stopped = allocated(error)
         if (late) then
            call system_clock(last_told)
            write (error_unit, '(4a)') 'simulate: ', to_text(count(outcomes%status /= outcome_waiting)), ' of ', &
               & to_text(self%crystals%n)
         end if
         !$omp end critical (batch_outcomes)
      end subroutine simulate_one
   end subroutine simulate_waiting

   !> Numbers to the last bit, separated by blanks.
   function number_list(numbers) result(list)
      real(wp), intent(in) :: numbers(:)
      character(len=:), allocatable :: list
      integer :: i

      list = ''
      do i = 1, size(numbers)
         if (i > 1) list = list//' '
         list = list//number_text(numbers(i))
      end do
   end function number_list

   !> The numbers of a list; none if it is none.
   pure function numbers_of(list) result(numbers)
      character(len=*), intent(in) :: list
      real(wp), allocatable :: numbers(:)
      integer :: i, status

      allocate (numbers(count([(list(i:i) == ' ', i=1, len(list))]) + min(1, len(list))))
      read (list, *, iostat=status) numbers
      if (status /= 0) numbers = [real(wp) ::]
   end function numbers_of

   !> Take over the results that an earlier run wrote.
   subroutine recall(self, path, physics, outcomes, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: path, physics
      type(outcome_type), intent(inout) :: outcomes(:)
      type(error_type), allocatable, intent(out) :: error
      type(points_type) :: old
      character(len=:), allocatable :: content
      integer :: i, j

      call read_text_file(path, content, error)
      if (allocated(error)) then
         error%message = path//': '//error%message
         return
      end if
      if (index(content, '# physics: '//physics//newline) /= 1) then
         call raise(error, path//': holds results of another physics than '//physics//'; choose another --output, or move ' &
            & //'the file away', exit_bad_input)
         return
      end if
      call read_crystals(path, path//': ', self%class, old, error)
      if (allocated(error)) return
      do i = 1, self%crystals%n
         do j = 1, old%n
            if (same_point(self%crystals, i, old, j)) call take(old, j, outcomes(i), error)
            if (outcomes(i)%status /= outcome_waiting .or. allocated(error)) exit
         end do
         if (allocated(error)) then
            error%message = path//': '//error%message
            return
         end if
      end do
   end subroutine recall

   !> The outcome in a row of an earlier table; one without modulus waits unless it says that it failed.
   subroutine take(old, row, outcome, error)
      type(points_type), intent(in) :: old
      integer, intent(in) :: row
      type(outcome_type), intent(inout) :: outcome
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: number

      outcome%message = cell('message')
      outcome%depth = numbers_of(cell('depth_um'))
      outcome%force = numbers_of(cell('force_mn'))
      if (cell('status') == 'failed') then
         outcome%status = outcome_failed
      else if (ieee_is_finite(old%modulus_gpa(row))) then
         outcome%status = outcome_done
         outcome%modulus = old%modulus_gpa(row)
         if (len(cell('elements')) > 0) then
            call old%table%number(old%table%find('elements'), row, number, error)
            if (allocated(error)) return
            outcome%elements = nint(number)
         end if
         if (len(cell('seconds')) > 0) call old%table%number(old%table%find('seconds'), row, outcome%seconds, error)
      end if

   contains

      function cell(name)
         character(len=*), intent(in) :: name
         character(len=:), allocatable :: cell
         integer :: column

         cell = ''
         column = old%table%find(name)
         if (column > 0) cell = old%table%cell(column, row)
      end function cell
   end subroutine take

   !> The same crystal in the same orientation, to the last bit.
   pure logical function same_point(a, i, b, j)
      type(points_type), intent(in) :: a, b
      integer, intent(in) :: i, j

      same_point = all(abs(a%stiffness(:, :, i) - b%stiffness(:, :, j)) <= 0.0_wp) &
         & .and. all(abs(a%euler_deg(:, i) - b%euler_deg(:, j)) <= 0.0_wp)
   end function same_point

   !> Write `simulations.csv`: the rows as given, with what became of them; rows that wait are left out.
   subroutine save_outcomes(self, path, physics, outcomes, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: path, physics
      type(outcome_type), intent(in) :: outcomes(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: names(7) = [character(len=23) :: 'indentation_modulus_gpa', 'elements', 'seconds', &
         & 'depth_um', 'force_mn', 'status', 'message']
      logical :: kept(self%crystals%table%columns)
      character(len=:), allocatable :: page, row
      integer :: i, j

      associate (table => self%crystals%table)
         do j = 1, table%columns
            kept(j) = .not. any(names == table%name(j))
         end do
         page = '# physics: '//physics//newline
         do i = 0, table%rows
            if (i > 0) then
               if (outcomes(i)%status == outcome_waiting) cycle
            end if
            row = ''
            do j = 1, table%columns
               if (kept(j)) row = row//csv_cell(table%cell(j, i))//','
            end do
            if (i == 0) then
               do j = 1, size(names)
                  row = row//trim(names(j))//','
               end do
               row = row(:len(row) - 1)
            else if (outcomes(i)%status == outcome_done) then
               row = row//number_text(outcomes(i)%modulus)//','//to_text(outcomes(i)%elements)//',' &
                  & //to_text(outcomes(i)%seconds, 4)//','//number_list(outcomes(i)%depth)//',' &
                  & //number_list(outcomes(i)%force)//',done,'
            else
               row = row//',,,,,failed,'//csv_cell(outcomes(i)%message)
            end if
            page = page//row//newline
         end do
      end associate
      call replace_file(path, page, error)
   end subroutine save_outcomes

end module batch_simulate
