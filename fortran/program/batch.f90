!> bayesindent-batch: the computing stages of a namelist file without Python.
program batch
   use abstract_stage, only: stage_type
   use errors, only: error_type, exit_bad_input, exit_failure, exit_unusable, raise, warning_type
   use files, only: printable
   use namelist_file, only: place
   use problem, only: problem_type
   use problem_input, only: read_problem
   use running_command, only: show_progress, take_folder, watch_signals
   use settings_schema, only: schema_page
   use simulation_loop, only: simulate_all
   use stage_documents, only: begin_results
   use stages, only: check_simulator, check_stages, groups_of, new_stage
   use surrogate_model, only: places_type
   use text, only: join, newline
   use system, only: argument, data_folder, end_process, error_stream, say, settle_blas
   use version, only: package_version, shipped_surrogates
   implicit none

   character(len=*), parameter :: usage = 'usage: bayesindent-batch FILE.nml [--stage NAME] [--output DIR] [--check]'
   character(len=:), allocatable :: path, output, command
   logical :: check_only

   call settle_blas()
   call watch_signals()
   call show_progress(1)
   call read_arguments()
   call perform()

contains

   subroutine read_arguments()
      character(len=:), allocatable :: word
      integer :: i

      path = ''
      output = ''
      command = 'run'
      check_only = .false.
      i = 1
      do while (i <= command_argument_count())
         word = argument(i)
         i = i + 1
         select case (word)
         case ('--help', '-h')
            call print_help()
            call end_process(0)
         case ('--version')
            call say('bayesindent-batch '//package_version)
            call end_process(0)
         case ('--schema')
            word = schema_page()
            call say(word(:len(word) - 1))
            call end_process(0)
         case ('--check')
            check_only = .true.
         case ('--stage')
            command = ''
            if (i <= command_argument_count()) command = argument(i)
            i = i + 1
            if (len(command) == 0) call refuse_usage('--stage needs a name')
         case ('--output')
            if (i <= command_argument_count()) output = argument(i)
            i = i + 1
            if (len(output) == 0) call refuse_usage('--output needs a folder')
         case default
            if (index(word, '-') == 1) call refuse_usage('unknown option '//word)
            if (len(path) > 0) call refuse_usage('more than one file: '//path//', '//word)
            path = word
         end select
      end do
      if (len(path) == 0) call refuse_usage('a namelist file is needed')
      if (len(output) == 0) output = 'runs/'//stem(path)
   end subroutine read_arguments

   subroutine perform()
      type(problem_type), target :: self
      type(error_type), allocatable :: error
      type(places_type) :: places
      logical :: usable
      integer :: i

      call read_problem(path, command, '', .false., self, error)
      if (.not. allocated(error) .and. allocated(self%table_file)) call raise(error, place(path, 'measurements', 'file') &
         & //printable(self%settings%measurements%file)//': a spreadsheet is read by bayesindent, not by bayesindent-batch; save ' &
         & //'its sheet as CSV', exit_bad_input)
      if (.not. allocated(error) .and. allocated(self%map)) call raise(error, place(path, 'measurements', 'ebsd') &
         & //printable(self%settings%measurements%ebsd)//': an orientation map is read by bayesindent, not by ' &
         & //'bayesindent-batch, which needs the orientations as columns', exit_bad_input)
      call stop_on(error)
      call tell(self%warnings)
      ! A function of deferred length in a structure constructor makes gfortran 12 allocate one byte for it.
      places%output = output//'/'
      places%folder = self%folder
      places%data_folder = data_folder()
      places%shipped = shipped_surrogates
      call check_stages(self, places, error)
      call stop_on(error)
      if (check_only) then
         call check_simulator(self, error)
         call stop_on(error)
         call say(path//' is right; it asks for: '//join(self%stages, ' '))
         return
      end if
      call take_folder(output, 0, .true., error)
      if (.not. allocated(error)) call begin_results(self, groups_of(self%stages), places, error)
      call stop_on(error)
      do i = 1, size(self%stages)
         call perform_stage(self, trim(self%stages(i)), places, usable)
         ! What to measure next follows from a posterior that can be used.
         if (.not. usable) call end_process(exit_unusable)
      end do
   end subroutine perform

   !> A stage to its end; `usable`: whether its result can be used.
   subroutine perform_stage(self, name, places, usable)
      type(problem_type), intent(in), target :: self
      character(len=*), intent(in) :: name
      type(places_type), intent(in) :: places
      logical, intent(out) :: usable
      class(stage_type), allocatable :: stage
      type(error_type), allocatable :: error
      character(len=:), allocatable :: document
      integer :: i

      call new_stage(name, stage, error)
      if (.not. allocated(error)) call stage%open(self, places, error)
      if (.not. allocated(error)) call simulate_all(stage, error)
      if (.not. allocated(error)) call stage%close(document, error)
      call stop_on(error)
      usable = size(stage%reasons) == 0
      do i = 1, size(stage%reasons)
         call say('the result cannot be used: '//stage%reasons(i)%text, error_stream)
      end do
      call tell(stage%warnings)
      call say(name//': '//stage%done)
      do i = 1, size(stage%more)
         call say(stage%more(i)%text)
      end do
   end subroutine perform_stage

   subroutine tell(warnings)
      type(warning_type), intent(in) :: warnings(:)
      integer :: i

      do i = 1, size(warnings)
         call say('warning: '//warnings(i)%text, error_stream)
      end do
   end subroutine tell

   !> 'a' of 'folder/a.nml'.
   function stem(name)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: stem
      integer :: dot

      stem = name(index(name, '/', back=.true.) + 1:)
      dot = index(stem, '.', back=.true.)
      if (dot > 1) stem = stem(:dot - 1)
   end function stem

   !> End with the error's status and its one line; go on if there is none.
   subroutine stop_on(error)
      type(error_type), allocatable, intent(in) :: error

      if (.not. allocated(error)) return
      call say(error%message, error_stream)
      call end_process(merge(exit_bad_input, exit_failure, error%status == exit_bad_input))
   end subroutine stop_on

   subroutine refuse_usage(reason)
      character(len=*), intent(in) :: reason

      call say('bayesindent-batch: '//reason, error_stream)
      call say(usage, error_stream)
      call end_process(exit_bad_input)
   end subroutine refuse_usage

   subroutine print_help()
      character(len=*), parameter :: lines(17) = [character(len=120) :: usage, &
         & '', &
         & 'The computing stages of a namelist file, without Python:', &
         & '  &crystals      indents the crystals: campaign.sqlite, moduli.csv, curves.csv; and theory.csv', &
         & '  &design        chooses simulations, performs and learns them: campaign.sqlite, surrogate.txt, build.json', &
         & '  &measurements  samples the constants: posterior.csv, posterior.bin, summary.json', &
         & '  &next          ranks the grains to measure next: next.json', &
         & 'bayesindent report DIR makes the page of results.', &
         & '', &
         & '  --stage NAME  only simulate, theory, size, build, extract or next', &
         & '  --output DIR  folder of the results (default runs/<stem of the file>)', &
         & '  --check       only say whether the file, and what it names, is right', &
         & '  --schema      print the page of all groups and variables', &
         & '  --version     print the version', &
         & '', &
         & 'exit status: 0 done, perhaps with warnings; 2 bad input; 3 done, but the result cannot be used; 1 anything else; ', &
         & '128 + N stopped by signal N (run it again to go on).']

      call say(join(lines, newline))
   end subroutine print_help
end program batch
