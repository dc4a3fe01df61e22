!> bayesindent-batch: perform the computing stages of a namelist file, without Python.
program batch
   use, intrinsic :: iso_c_binding, only: c_int, c_null_char
   use abstract_stage, only: stage_type
   use diagnostics, only: diagnostic_type, is_usable
   use errors, only: error_type, exit_bad_input, exit_failure, exit_unusable
   use files, only: printable
   use named_values, only: named_values_reader_type
   use problem, only: problem_type
   use progress, only: show_progress
   use running_command, only: error_stream, output_stream, print_line, take_folder, watch_signals
   use settings_reader, only: variables_text
   use simulation_loop, only: simulate_all
   use stage_documents, only: begin_results
   use stages, only: all_stages, check_stages, groups_of, load_problem, new_stage, read_problem
   use surrogate_model, only: places_type
   use text, only: join, lower, newline
   use version, only: installed_data, package_version, shipped_surrogates
   implicit none

   character(len=*), parameter :: usage = 'usage: bayesindent-batch FILE.nml [--stage NAME] ' &
      & //'[--output DIR] [--check]'
   character(len=:), allocatable :: path, output, command
   logical :: check_only

   interface
      !> End the process with this status; unlike STOP it prints nothing.
      subroutine end_process(status) bind(c, name='exit')
         import
         integer(c_int), value :: status
      end subroutine end_process
      !> Choose the OpenBLAS kernels that fit this processor, and one thread. The program may be
      !> started once more for this.
      subroutine prepare_blas() bind(c, name='bayesindent_prepare_blas')
      end subroutine prepare_blas
      subroutine c_data_folder(installed, folder, size) bind(c, name='bayesindent_data_folder')
         import
         character, intent(in) :: installed(*)
         ! allow(C072)
         character, intent(out) :: folder(*)
         integer(c_int), value :: size
      end subroutine c_data_folder
   end interface

   call prepare_blas()
   call watch_signals()
   call show_progress(.true.)
   call read_arguments()
   call perform()

contains

   subroutine read_arguments()
      character(len=:), allocatable :: word
      integer :: i, dot

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
            call print_line(output_stream, 'bayesindent-batch '//package_version)
            call end_process(0)
         case ('--schema')
            call print_line(output_stream, variables_text())
            call end_process(0)
         case ('--check')
            check_only = .true.
         case ('--stage')
            command = argument(i)
            i = i + 1
            if (len(command) == 0) call refuse_usage('--stage needs a name')
         case ('--output')
            output = argument(i)
            i = i + 1
            if (len(output) == 0) call refuse_usage('--output needs a folder')
         case default
            if (index(word, '-') == 1) call refuse_usage('unknown option '//word)
            if (len(path) > 0) call refuse_usage('more than one file: '//path//', '//word)
            path = word
         end select
      end do
      if (len(path) == 0) call refuse_usage('a namelist file is needed')
      if (len(output) > 0) return
      ! 'a' of 'folder/a.nml'.
      word = path(index(path, '/', back=.true.) + 1:)
      dot = index(word, '.', back=.true.)
      output = 'runs/'//word(:merge(dot - 1, len(word), dot > 1))
   end subroutine read_arguments

   subroutine perform()
      type(problem_type), target :: self
      type(named_values_reader_type) :: no_texts
      type(error_type), allocatable :: error
      type(places_type) :: places
      character(len=4096) :: folder
      logical :: usable
      integer :: i

      call read_problem(path, command, '', self, error)
      call stop_on(error)
      associate (stated => self%settings%measurements)
         if (allocated(stated%ebsd)) then
            call self%refuse('measurements', 'ebsd', printable(stated%ebsd) &
               & //': an orientation map is read by bayesindent, not by bayesindent-batch, which ' &
               & //'needs the orientations as columns', error)
         else if (allocated(stated%file)) then
            if (allocated(stated%columns) .or. len(stated%sheet) > 0 &
               & .or. index(lower(stated%file), '.xls') > 0) then
               call self%refuse_table(': is a spreadsheet, or its columns are stated', error)
            else if (allocated(stated%orientations_file)) then
               call self%refuse_table(' has its orientations in another file', error)
            end if
         end if
      end associate
      call stop_on(error)
      if (allocated(self%settings%curves%files)) then
         call self%refuse('curves', 'files', 'files of instruments are read by bayesindent, not ' &
            & //'by bayesindent-batch; state file, a CSV of the curves', error)
      else
         call load_problem(self, no_texts, error)
      end if
      call stop_on(error)
      self%run%is_of_batch = .true.
      call print_diagnostics(self%warnings)
      ! A function of deferred length in a structure constructor makes gfortran 12 allocate one byte
      ! for it.
      places%output = output//'/'
      places%folder = self%run%folder
      call c_data_folder(installed_data//c_null_char, folder, len(folder))
      places%data_folder = folder(:index(folder, c_null_char) - 1)
      places%shipped = shipped_surrogates
      call check_stages(self, places, check_only, error)
      call stop_on(error)
      if (check_only) then
         call print_line(output_stream, path//' is right; it asks for: '//join(self%run%stages, &
            & ' '))
         return
      end if
      call take_folder(output, 0, .true., error)
      if (.not. allocated(error)) then
         call begin_results(self, groups_of(self%run%stages), places, error)
      end if
      call stop_on(error)
      do i = 1, size(self%run%stages)
         call perform_stage(self, trim(self%run%stages(i)), places, usable)
         ! The next measurements are computed only from a posterior that can be used.
         if (.not. usable) call end_process(exit_unusable)
      end do
   end subroutine perform

   !> Perform a stage; `usable` is whether its result can be used.
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
      usable = is_usable(stage%warnings)
      call print_diagnostics(stage%warnings)
      call print_line(output_stream, name//': '//stage%done)
      do i = 1, size(stage%more)
         call print_line(output_stream, stage%more(i)%text)
      end do
   end subroutine perform_stage

   !> Print diagnostics on standard error, each with its severity.
   subroutine print_diagnostics(list)
      type(diagnostic_type), intent(in) :: list(:)
      character(len=:), allocatable :: severity
      integer :: i

      do i = 1, size(list)
         severity = list(i)%severity()
         if (severity == 'unusable') severity = 'the result cannot be used'
         call print_line(error_stream, severity//': '//list(i)%message())
      end do
   end subroutine print_diagnostics

   !> Argument number `i` of the command line; '' if there is none.
   function argument(i) result(text)
      integer, intent(in) :: i
      character(len=:), allocatable :: text
      integer :: length

      call get_command_argument(i, length=length)
      allocate (character(len=length) :: text)
      if (length > 0) call get_command_argument(i, text)
   end function argument

   !> If there is an error, print its line and end with its status.
   subroutine stop_on(error)
      type(error_type), allocatable, intent(in) :: error

      if (.not. allocated(error)) return
      call print_line(error_stream, error%line())
      call end_process(merge(exit_bad_input, exit_failure, error%status == exit_bad_input))
   end subroutine stop_on

   subroutine refuse_usage(reason)
      character(len=*), intent(in) :: reason

      call print_line(error_stream, 'bayesindent-batch: '//reason)
      call print_line(error_stream, usage)
      call end_process(exit_bad_input)
   end subroutine refuse_usage

   subroutine print_help()
      character(len=120) :: lines(19)

      lines = [character(len=120) :: usage, '', &
         & 'The computing stages of a namelist file, without Python:', '  &crystals      indents ' &
         & //'the crystals: campaign.sqlite, moduli.csv, curves.csv; and theory.csv', &
         & '  &design        chooses simulations, performs and learns them: campaign.sqlite, ' &
         & //'surrogate.txt, build.json', '  &plan          says how well the constants would be ' &
         & //'known before anything is measured: plan.json', '  &curves        infers moduli ' &
         & //'from measured curves: measurements.csv, shared_errors.csv, fits.csv, curves.json', &
         & '  &measurements  samples the constants: posterior.bin, posterior.csv, summary.json', &
         & '  &next          ranks the grains to measure next: next.json', &
         & 'bayesindent report DIR makes the page of results.', '', &
         & '  --stage NAME  only one of '//join(all_stages%name, ', '), &
         & '  --output DIR  folder of the results (default runs/<stem of the file>)', &
         & '  --check       only say whether the file, and what it names, is right', &
         & '  --schema      list all variables: group, name, default, kind and meaning', &
         & '  --version     print the version', '', 'exit status: 0 done, perhaps with warnings; ' &
         & //'2 bad input; 3 done, but the result cannot be used; 1 anything else; ', &
         & '128 + N stopped by signal N (run it again to go on).']
      call print_line(output_stream, join(lines, newline))
   end subroutine print_help
end program batch
