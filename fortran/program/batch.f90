!> bayesindent-batch: the computing stages of a namelist file without Python.
program batch
   use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
   use batch_build, only: build_surrogate, check_new_surrogate
   use batch_sample, only: check_sampling, sample_constants
   use batch_simulate, only: simulate_crystals
   use errors, only: error_type, exit_bad_input, exit_status, raise
   use files, only: printable, replace_file
   use namelist_file, only: place
   use choices, only: all_choices
   use problem, only: problem_type
   use problem_input, only: read_problem
   use running_command, only: take_folder, watch_signals
   use settings_lists, only: new_schema, schema_markdown
   use system, only: argument, settle_blas, end_process
   use version, only: package_version
   use warning_lists, only: warning_type
   implicit none

   character(len=*), parameter :: usage = 'usage: bayesindent-batch FILE.nml [--output DIR] [--check]'
   character(len=:), allocatable :: path, output
   logical :: check_only

   call settle_blas()
   call watch_signals()
   call read_arguments()
   call perform()

contains

   subroutine read_arguments()
      character(len=:), allocatable :: word
      integer :: i

      path = ''
      output = ''
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
            write (output_unit, '(2a)') 'bayesindent-batch ', package_version
            call end_process(0)
         case ('--schema')
            write (output_unit, '(a)', advance='no') schema_markdown(new_schema(all_choices()))
            call end_process(0)
         case ('--check')
            check_only = .true.
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
      type(problem_type) :: self
      type(error_type), allocatable :: error
      character(len=:), allocatable :: told
      type(warning_type), allocatable :: prior(:), warnings(:)
      integer :: i

      call read_problem(path, 'run', self, error)
      if (.not. allocated(error) .and. allocated(self%spreadsheet)) call raise(error, place(path, 'measurements', 'file') &
         & //printable(self%settings%measurements%file)//': a spreadsheet is read by bayesindent, not by bayesindent-batch; save ' &
         & //'its sheet as CSV', exit_bad_input)
      if (.not. allocated(error) .and. allocated(self%map)) call raise(error, place(path, 'measurements', 'ebsd') &
         & //printable(self%settings%measurements%ebsd)//': an orientation map is read by bayesindent, not by ' &
         & //'bayesindent-batch, which needs the orientations as columns', exit_bad_input)
      call stop_on(error)
      call tell(self%warnings)
      if (self%settings%design%given) call check_new_surrogate(self, output, error)
      call stop_on(error)
      if (check_only) then
         if (self%settings%measurements%given) call check_sampling(self, output, error)
         call stop_on(error)
         write (output_unit, '(3a)') path, ' is right; it asks for: ', self%stages
         return
      end if
      call take_folder(output, 0, .true., error)
      call stop_on(error)
      self%kept_in = output
      call replace_file(output//'/resolved.nml', self%resolved_text(), error)
      call stop_on(error)
      if (self%settings%crystals%given) then
         call simulate_crystals(self, output, told, error)
         call stop_on(error)
         write (output_unit, '(2a)') 'simulate: ', told
         flush (output_unit)
      end if
      if (self%settings%design%given) then
         call build_surrogate(self, output, told, warnings, error)
         call stop_on(error)
         call tell(warnings)
         write (output_unit, '(2a)') 'build: ', told
         flush (output_unit)
      end if
      if (self%settings%measurements%given) then
         call sample_constants(self, output, told, prior, warnings, error)
         call stop_on(error)
         call tell(warnings)
         write (output_unit, '(2a)') 'sample: ', told
         do i = 1, size(prior)
            write (output_unit, '(2a)') 'prior: ', prior(i)%text
         end do
      end if
   end subroutine perform

   subroutine tell(warnings)
      type(warning_type), intent(in) :: warnings(:)
      integer :: i

      do i = 1, size(warnings)
         write (error_unit, '(2a)') 'warning: ', warnings(i)%text
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
      write (error_unit, '(a)') error%message
      call end_process(exit_status(error))
   end subroutine stop_on

   subroutine refuse_usage(reason)
      character(len=*), intent(in) :: reason

      write (error_unit, '(2a)') 'bayesindent-batch: ', reason
      write (error_unit, '(a)') usage
      call end_process(exit_bad_input)
   end subroutine refuse_usage

   subroutine print_help()
      write (output_unit, '(a)') usage, &
         & '', &
         & 'The computing stages of a namelist file, without Python:', &
         & '  &crystals      indents the crystals: campaign.sqlite, moduli.csv, curves.csv', &
         & '  &design        chooses simulations, performs and learns them: campaign.sqlite, surrogate.txt, build.json', &
         & '  &measurements  samples the constants: posterior.csv, summary.json', &
         & '', &
         & '  --output DIR  folder of the results (default runs/<stem of the file>)', &
         & '  --check       only say whether the file, and what it names, is right', &
         & '  --schema      print the page of all groups and variables', &
         & '  --version     print the version', &
         & '', &
         & 'exit status: 0 done, perhaps with warnings; 2 bad input; 1 anything else; 128 + N stopped by signal N (run it again ', &
         & 'to go on).'
   end subroutine print_help
end program batch
