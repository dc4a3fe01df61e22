!> Operations by name, 'KIND.VERB', on an object of this kind that another language holds.
!> Operations of the kinds 'crystal', 'file' and 'settings' need no object.
module operations
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_loc
   use abstract_basis, only: basis_type
   use abstract_stage, only: stage_type
   use analysis, only: analysis_type
   use analysis_document, only: read_posterior
   use analysis_operations, only: use_analysis
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_operations, only: perform_crystal
   use diagnostics, only: diagnostic, diagnostics_text
   use errors, only: locate_error
   use exchange, only: exchange_type, find_object, register_object
   use fe_indentation, only: indentation_model_type
   use namelist_file, only: entry_type, parse_namelist
   use machine, only: check_memory
   use point_tables, only: read_crystals
   use problem, only: problem_type
   use problem_tables, only: read_shared_errors
   use kinds, only: i8, wp
   use progress, only: advance_progress, begin_progress, end_progress, show_progress
   use running_command, only: end_command, listen, stop_listening, take_folder, watch_signals
   use settings_schema, only: settings_type
   use settings_reader, only: put_settings, put_variables, read_settings
   use simulate, only: simulator_type
   use simulation_operations, only: run_simulator, use_indentation, use_problem, use_stage
   use stage_documents, only: digest_surrogate, read_document, read_resolved, write_document
   use stages, only: all_stages, read_problem, run_command, stage_row_type
   use surrogate_model, only: load_named_surrogate, surrogate_type
   use surrogate_operations, only: use_basis, use_surrogate
   use tables, only: table_type
   implicit none
   private
   public :: perform

contains

   !> Perform an operation on a `request`. `reply`, `address`, `words` and `status` describe the
   !> result, see `core_do`.
   subroutine perform(operation, handle, request, reply, address, words, status)
      character(len=*), intent(in) :: operation
      integer(c_int64_t), intent(in) :: handle
      integer(c_int64_t), intent(in), target, contiguous :: request(:)
      integer(c_int64_t), intent(out) :: reply, address, words
      integer(c_int), intent(out) :: status
      type(exchange_type), pointer :: x
      class(*), pointer :: object
      character(len=:), allocatable :: kind, verb
      logical :: can_be_stopped

      kind = operation(:index(operation, '.') - 1)
      verb = operation(index(operation, '.') + 1:)
      can_be_stopped = any(operation == [character(len=14) :: 'analysis.infer', 'stage.close'])
      allocate (x)
      call x%open(request)
      if (can_be_stopped) call listen()
      select case (kind)
      case ('crystal')
         call perform_crystal(verb, x)
      case ('file', 'settings')
         call perform_file(operation, x)
      case default
         if (.not. allocated(x%error)) call find_object(handle, kind, object, x%error)
         if (.not. allocated(x%error)) call use_object(verb, object, x)
      end select
      if (can_be_stopped) call stop_listening()
      call x%close(status)
      ! An empty result has no address.
      if (x%out%filled == 0) call x%out%put('', 0)
      words = x%out%filled/8
      address = transfer(c_loc(x%out%bytes), address)
      object => x
      call register_object(object, 'reply', reply)
   end subroutine perform

   subroutine use_object(verb, object, x)
      character(len=*), intent(in) :: verb
      class(*), intent(inout) :: object
      type(exchange_type), intent(inout) :: x

      select type (object)
      type is (problem_type)
         call use_problem(verb, object, x)
      type is (indentation_model_type)
         call use_indentation(verb, object, x)
      type is (simulator_type)
         call run_simulator(object, x)
      class is (basis_type)
         call use_basis(verb, object, x)
      type is (surrogate_type)
         call use_surrogate(verb, object, x)
      type is (analysis_type)
         call use_analysis(verb, object, x)
      class is (stage_type)
         call use_stage(verb, object, x)
      end select
   end subroutine use_object

   !> Perform an operation on files of results, problems, surrogates, settings, or the folder of a
   !> running command.
   subroutine perform_file(operation, x)
      !> Name of a case below.
      character(len=*), intent(in) :: operation
      type(exchange_type), intent(inout) :: x
      type(problem_type), pointer :: problem
      type(surrogate_type), pointer :: surrogate
      type(crystal_class_type) :: class
      type(entry_type), allocatable :: namelist(:)
      type(settings_type) :: settings
      type(table_type) :: table
      real(wp), allocatable :: values(:, :)
      type(stage_row_type), parameter :: rows(*) = [run_command, all_stages]
      character(len=:), allocatable :: path, content
      integer :: i

      if (x%in%has('path')) path = x%in%text('path')
      select case (operation)
      case ('settings.list')
         !> -> group, group_meaning, name, kind, shape, unit, default, allowed, meaning, stages
         ! The properties of all variables; name, groups and document's file of each stage.
         call put_variables(x%out)
         call x%out%put('stages', [character(len=len(rows%groups)) :: (rows(i)%name, &
            & rows(i)%groups, rows(i)%document, i=1, size(rows))])
      case ('settings.diagnostic')
         !> code, subject -> text
         ! A diagnostic without numbers, JSON.
         x%text = diagnostics_text(diagnostic(x%in%text('code'), x%in%text('subject')))
      case ('settings.values')
         !> path, content -> ..
         ! Values of a namelist's text. The tables that it names are not read.
         call parse_namelist(x%in%text('content'), namelist, x%error)
         if (.not. allocated(x%error)) call read_settings(namelist, '', '', settings, x%error)
         if (.not. allocated(x%error)) call put_settings(settings, x%out)
         call locate_error(x%error, path)
      case ('file.problem')
         !> path, content, command, changes -> handle
         ! A problem of a text, or of a file for a command.
         allocate (problem)
         call x%give(problem, 'problem')
         ! An unallocated text is an absent argument.
         if (x%in%has('content')) content = x%in%text('content')
         call read_problem(path, x%in%text('command'), x%in%text('changes'), problem, x%error, &
            & content)
      case ('file.crystals')
         !> path, symmetry -> handle
         ! A problem that has only a table of crystals. `symmetry` applies to rows without one.
         allocate (problem)
         call x%give(problem, 'problem')
         allocate (problem%data%crystals)
         call new_crystal_class(x%in%text('symmetry'), class, x%error)
         if (allocated(x%error)) return
         call read_crystals(path, class, problem%data%crystals, x%error)
         call locate_error(x%error, path)
      case ('file.shared_errors')
         !> path, rows -> values
         ! The relative errors that rows share, (n, k).
         call read_shared_errors(path, x%in%integer('rows'), table, values, x%error)
         if (.not. allocated(x%error)) call x%out%put('values', values)
      case ('file.surrogate')
         !> name, symmetry, output, folder, data_folder, shipped -> handle
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         call load_named_surrogate(x%in%text('name'), x%in%text('symmetry'), x%places(), &
            & surrogate, x%error)
      case ('file.check_memory')
         !> bytes, what ->
         call check_memory(x%in%real('bytes'), x%in%text('what'), x%error)
      case ('file.watch_signals')
         !> ->
         call watch_signals()
      case ('file.take_folder')
         !> folder, patience, resumes ->
         call take_folder(x%in%text('folder'), x%in%integer('patience'), &
            & x%in%logical('resumes'), x%error)
      case ('file.show_progress')
         !> wanted ->
         call show_progress(x%in%logical('wanted'))
      case ('file.begin_progress')
         !> name, steps ->
         call begin_progress(x%in%text('name'), int(x%in%integer('steps'), i8))
      case ('file.advance_progress')
         !> steps ->
         call advance_progress(int(x%in%integer('steps'), i8))
      case ('file.end_progress')
         !> ->
         call end_progress()
      case ('file.end_command')
         !> ->
         call end_command()
      case ('file.digest_surrogate')
         !> name, output, folder, data_folder, shipped -> text
         call digest_surrogate(x%in%text('name'), x%places(), x%text, x%error)
      case ('file.read_resolved')
         !> folder -> text
         call read_resolved(x%in%text('folder'), x%text, x%error)
      case ('file.write_document')
         !> path, document ->
         call write_document(path, x%in%text('document'), x%error)
      case ('file.read_document')
         !> path -> text
         call read_document(path, x%text, x%error)
      case ('file.read_posterior')
         !> folder -> ..
         ! The result is the content of the file.
         call read_posterior(x%in%text('folder'), x%out%bytes, x%error)
         if (allocated(x%out%bytes)) x%out%filled = len(x%out%bytes)
      case default
         call x%refuse(operation)
      end select
   end subroutine perform_file
end module operations
