!> What the batch program does: indent the crystals, fit the surrogate. Each stage reads what the one before it wrote.
module batch_stages
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use, intrinsic :: iso_fortran_env, only: error_unit
   use errors, only: error_type, exit_bad_input, raise
   use fe_indentation, only: free_indentation_model, indentation_model_type, indentation_options_type, &
      & indentation_result_type, new_indentation_model, numerics_revision, simulate_indentation
   use files, only: file_exists, read_text_file, replace_file
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: degree, i8, wp
   use namelist_file, only: place
   use numbers, only: number_text
   use omp_lib, only: omp_get_num_procs
   use point_tables, only: points_type, read_crystals
   use problem, only: problem_type
   use surrogate_basis, only: coordinates_from_name, truncation_from_name
   use surrogate_fit, only: domain_type, fit_options_type, fit_surrogate, prior_from_name
   use surrogate_model, only: save_surrogate, surrogate_type
   use tables, only: csv_cell
   use text, only: to_text
   implicit none
   private
   public :: simulate_crystals, fits_surrogate, fit_simulations, worker_count, surrogate_name

   character(len=*), parameter :: simulations_name = 'simulations.csv', surrogate_name = 'surrogate.nml'
   character, parameter :: newline = achar(10)

   !> What became of one crystal.
   integer, parameter :: waiting = 0, done = 1, failed = 2
   type :: outcome_type
      integer :: status = waiting
      real(wp) :: modulus = 0.0_wp, seconds = 0.0_wp
      integer :: elements = 0
      !> The curve, numbers separated by blanks: um, mN.
      character(len=:), allocatable :: depths, forces
      character(len=:), allocatable :: message
   end type outcome_type

contains

   !> Indent every crystal of the file that `simulations.csv` does not have yet; rows are kept as they come.
   subroutine simulate_crystals(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      !> One line on what was done.
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(outcome_type), allocatable :: outcomes(:)
      type(indentation_options_type) :: options
      type(indentation_model_type) :: model
      character(len=:), allocatable :: path, physics, simulator
      integer(i8) :: last_told
      integer :: i, new

      path = output//'/'//simulations_name
      call self%get('simulation', 'simulator', simulator)
      options = options_of(self)
      physics = physics_text(simulator, options)
      allocate (outcomes(self%crystals%n))
      if (file_exists(path)) call recall(self, path, physics, outcomes, error)
      if (allocated(error)) return
      new = count(outcomes%status == waiting)
      if (simulator == 'fe' .and. new > 0) then
         call new_indentation_model(options, model, error)
         if (allocated(error)) then
            error%message = place(self%path, 'simulation', '')//error%message
            return
         end if
      end if
      call system_clock(last_told)
      !$omp parallel do num_threads(worker_count(self)) schedule(dynamic, 1)
      do i = 1, self%crystals%n
         if (outcomes(i)%status == waiting) call simulate_one(i)
      end do
      !$omp end parallel do
      call free_indentation_model(model)
      if (.not. allocated(error)) call save_outcomes(self, path, physics, outcomes, error)
      told = to_text(self%crystals%n)//' crystals, '//to_text(new)//' new, ' &
         & //to_text(count(outcomes%status == failed))//' failed: '//path

   contains

      subroutine simulate_one(i)
         integer, intent(in) :: i
         integer, parameter :: interval = 5
         type(outcome_type) :: outcome
         integer(i8) :: now, rate
         logical :: late

         if (simulator == 'fe') then
            call indent(model, self%crystals%stiffness(:, :, i), self%crystals%euler_deg(:, i)*degree, outcome)
         else
            call evaluate(self%crystals%stiffness(:, :, i), self%crystals%euler_deg(:, i)*degree, outcome)
         end if
         !$omp critical (batch_outcomes)
         outcomes(i) = outcome
         call system_clock(now, rate)
         late = now - last_told > interval*rate
         ! A finite element result is never lost; the theory's, microseconds each, are saved now and then.
         if ((late .or. simulator == 'fe') .and. .not. allocated(error)) call save_outcomes(self, path, physics, outcomes, error)
         if (late) then
            call system_clock(last_told)
            write (error_unit, '(4a)') 'simulate: ', to_text(count(outcomes%status /= waiting)), ' of ', &
               & to_text(self%crystals%n)
         end if
         !$omp end critical (batch_outcomes)
      end subroutine simulate_one
   end subroutine simulate_crystals

   !> One crystal by finite elements.
   subroutine indent(model, stiffness, euler, outcome)
      type(indentation_model_type), intent(in) :: model
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(outcome_type), intent(inout) :: outcome
      type(indentation_result_type) :: result
      type(error_type), allocatable :: error

      call simulate_indentation(model, stiffness, euler, result, error)
      outcome%modulus = result%modulus
      outcome%elements = result%elements
      outcome%seconds = result%seconds
      if (.not. allocated(error)) then
         outcome%depths = number_list(result%depth)
         outcome%forces = number_list(result%force)
      end if
      call conclude(outcome, error)
   end subroutine indent

   !> One crystal by the half-space theory.
   subroutine evaluate(stiffness, euler, outcome)
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(outcome_type), intent(inout) :: outcome
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      integer(i8) :: start, finish, rate

      call system_clock(start, rate)
      call halfspace_modulus(stiffness, euler, theory, error)
      call system_clock(finish)
      outcome%modulus = theory%modulus
      outcome%seconds = real(finish - start, wp)/real(rate, wp)
      call conclude(outcome, error)
   end subroutine evaluate

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

   !> A simulation that fails is a recorded outcome.
   subroutine conclude(outcome, error)
      type(outcome_type), intent(inout) :: outcome
      type(error_type), allocatable, intent(in) :: error

      outcome%message = ''
      outcome%status = done
      if (.not. allocated(outcome%depths)) outcome%depths = ''
      if (.not. allocated(outcome%forces)) outcome%forces = ''
      if (.not. allocated(error)) return
      outcome%message = error%message
      outcome%status = failed
   end subroutine conclude

   !> &simulation as the simulator takes it.
   function options_of(self) result(options)
      type(problem_type), intent(in) :: self
      type(indentation_options_type) :: options
      character(len=:), allocatable :: word

      call self%get('simulation', 'mesh', word)
      options%mesh = word
      call self%get('simulation', 'element', word)
      options%element = word
      call self%get('simulation', 'integration', word)
      options%integration = word
      call self%get('simulation', 'refine', options%refine)
      call self%get('simulation', 'extrapolate', options%extrapolate)
      call self%get('simulation', 'radius_um', options%radius_um)
      call self%get('simulation', 'depths', options%depths)
   end function options_of

   integer function worker_count(self) result(workers)
      type(problem_type), intent(in) :: self

      call self%get('execution', 'workers', workers)
      if (workers == 0) workers = omp_get_num_procs()
   end function worker_count

   !> What makes two simulations the same physics, in the words of the Python program's campaign.
   function physics_text(simulator, options) result(text)
      character(len=*), intent(in) :: simulator
      type(indentation_options_type), intent(in) :: options
      character(len=:), allocatable :: text

      text = '"simulator": "'//simulator//'"}'
      if (simulator == 'fe') then
         text = '"depths": '//to_text(options%depths)//', "element": "'//trim(options%element) &
            & //'", "estimator": "least squares through the origin", "extrapolate": ' &
            & //trim(merge('true ', 'false', options%extrapolate))//', "integration": "'//trim(options%integration) &
            & //'", "mesh": "'//trim(options%mesh)//'", "numerics": '//to_text(numerics_revision)//', "radius_um": ' &
            & //number_text(options%radius_um)//', "refine": '//number_text(options%refine)//', '//text
      end if
      text = '{'//text
   end function physics_text

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
            if (outcomes(i)%status /= waiting .or. allocated(error)) exit
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
      outcome%depths = cell('depth_um')
      outcome%forces = cell('force_mn')
      if (cell('status') == 'failed') then
         outcome%status = failed
      else if (ieee_is_finite(old%modulus_gpa(row))) then
         outcome%status = done
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
               if (outcomes(i)%status == waiting) cycle
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
            else if (outcomes(i)%status == done) then
               row = row//number_text(outcomes(i)%modulus)//','//to_text(outcomes(i)%elements)//',' &
                  & //to_text(outcomes(i)%seconds, 4)//','//outcomes(i)%depths//','//outcomes(i)%forces//',done,'
            else
               row = row//',,,,,failed,'//csv_cell(outcomes(i)%message)
            end if
            page = page//row//newline
         end do
      end associate
      call replace_file(path, page, error)
   end subroutine save_outcomes

   !> Whether the file asks for a fit; else a &surrogate is one that is there already.
   pure logical function fits_surrogate(self)
      type(problem_type), intent(in) :: self

      fits_surrogate = self%has_group('design') .or. (self%has_group('surrogate') .and. self%has_group('crystals'))
   end function fits_surrogate

   !> Fit the surrogate to `simulations.csv` of the output folder.
   subroutine fit_simulations(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(points_type) :: points
      type(domain_type) :: domain
      type(fit_options_type) :: options
      type(surrogate_type) :: surrogate
      character(len=:), allocatable :: path, word
      integer, allocatable :: rows(:)
      integer :: i, k

      path = output//'/'//simulations_name
      if (.not. file_exists(path)) then
         call raise(error, path//': the file does not exist; &crystals or the Python program make the simulations that ' &
            & //'&surrogate is fitted to', exit_bad_input)
         return
      end if
      call read_crystals(path, path//': ', self%class, points, error)
      if (allocated(error)) return
      rows = pack([(i, i=1, points%n)], ieee_is_finite(points%modulus_gpa))
      do i = 1, size(rows)
         if (points%class(rows(i))%name == self%class%name) cycle
         call raise(error, path//': line '//to_text(points%table%line(rows(i)))//': the crystal is not of the symmetry of ' &
            & //'&problem', exit_bad_input)
         return
      end do
      domain%class = self%class
      call self%get('domain', 'c_min', domain%lower)
      call self%get('domain', 'c_max', domain%upper)
      call self%get('domain', 'anisotropy_cap', domain%anisotropy_cap)
      call self%get('surrogate', 'coordinates', word)
      options%coordinates = coordinates_from_name(word)
      call self%get('surrogate', 'truncation', word)
      options%truncation = truncation_from_name(word)
      call self%get('surrogate', 'prior', word)
      options%prior = prior_from_name(word)
      call self%get('surrogate', 'degree', options%degree)
      call self%get('surrogate', 'bandlimit', options%bandlimit)
      k = size(domain%lower)
      call fit_surrogate(domain, options, points%constants(:k, rows), points%euler_deg(:, rows)*degree, &
         & points%modulus_gpa(rows), surrogate, error)
      if (allocated(error)) return
      path = output//'/'//surrogate_name
      call save_surrogate(surrogate, path, error)
      told = to_text(size(rows))//' simulations, '//to_text(surrogate%basis%n_terms)//' terms, alpha ' &
         & //to_text(surrogate%alpha)//', beta '//to_text(surrogate%beta)//': '//path
   end subroutine fit_simulations
end module batch_stages
