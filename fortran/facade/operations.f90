!> Operations by name, 'KIND.VERB': on an object of a kind that another language holds, or on none. Of these most make an object.
module operations
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_loc
   use abstract_basis, only: basis_type
   use build_checks, only: basis_of_problem
   use checksums, only: checksum
   use constants_posterior, only: posterior_type
   use crystal_operations, only: perform_crystal
   use exchange, only: exchange_type
   use fe_indentation, only: indentation_model_type, new_indentation_model
   use files, only: read_bytes
   use interruption, only: listen, stop_listening
   use namelist_file, only: place
   use object_registry, only: find_object, register_object
   use posterior_file, only: read_posterior
   use posterior_operations, only: new_posterior, use_posterior
   use problem, only: problem_type
   use problem_input, only: problem_of_text, read_problem
   use problem_operations, only: list_settings, read_table_alone, read_values, use_problem
   use running_command, only: end_command, take_folder, watch_signals
   use simulate, only: new_simulator
   use simulation_operations, only: held_simulator_type, run_simulator, use_model
   use stage_documents, only: begin_results, read_document, read_resolved, write_document
   use stage_operations, only: held_stage_type, use_stage
   use stages, only: check_stages, new_stage
   use surrogate_learner, only: learner_type
   use surrogate_lookup, only: find_surrogate, load_named_surrogate
   use surrogate_model, only: surrogate_type
   use surrogate_operations, only: give_basis, use_basis, use_learner, use_surrogate
   implicit none
   private
   public :: perform

contains

   !> Do an operation on a `request`; `words` are at an `address` while the handle `reply` is held; its `status`: see `core_do`.
   subroutine perform(operation, handle, request, reply, address, words, status)
      character(len=*), intent(in) :: operation
      integer(c_int64_t), intent(in) :: handle
      integer(c_int64_t), intent(in), target, contiguous :: request(:)
      integer(c_int64_t), intent(out) :: reply, address, words
      integer(c_int), intent(out) :: status
      character(len=*), parameter :: of_a_problem = ' basis indentation learner posterior simulator stage '
      type(exchange_type), pointer :: x
      class(*), pointer :: object
      character(len=:), allocatable :: kind, verb

      kind = operation(:index(operation, '.') - 1)
      verb = operation(index(operation, '.') + 1:)
      allocate (x)
      object => null()
      if (handle > 0) call find_object(handle, kind, object, x%error)
      if (.not. allocated(x%error)) call x%open(request, handle <= 0 .and. index(of_a_problem, ' '//kind//' ') > 0, &
         & handle <= 0 .and. kind == 'posterior')
      if (kind == 'posterior' .or. operation == 'stage.close') call listen()
      if (allocated(x%error)) then
         continue
      else if (associated(object)) then
         call use_object(verb, object, x)
      else if (kind == 'crystal') then
         call perform_crystal(verb, x)
      else if (kind == 'file') then
         call perform_file(verb, x)
      else
         call make_object(operation, x)
      end if
      if (kind == 'posterior' .or. operation == 'stage.close') call stop_listening()
      call x%close(status)
      ! Nothing has no address.
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
         call use_model(verb, object, x)
      type is (held_simulator_type)
         call run_simulator(object%simulator, x)
      class is (basis_type)
         call use_basis(verb, object, x)
      type is (surrogate_type)
         call use_surrogate(verb, object, x)
      type is (learner_type)
         call use_learner(verb, object, x)
      type is (held_stage_type)
         call use_stage(verb, object%stage, x)
      type is (posterior_type)
         call use_posterior(verb, object, x)
      end select
   end subroutine use_object

   subroutine make_object(operation, x)
      character(len=*), intent(in) :: operation
      type(exchange_type), intent(inout) :: x
      type(problem_type), pointer :: problem
      type(indentation_model_type), pointer :: model
      type(held_simulator_type), pointer :: simulator
      type(held_stage_type), pointer :: stage
      type(surrogate_type), pointer :: surrogate
      class(basis_type), allocatable :: basis

      select case (operation)
      case ('settings.list')
         call list_settings(x%out)
      case ('settings.values')
         call read_values(x)
      case ('problem.read', 'problem.parse', 'problem.table')
         allocate (problem)
         call x%give(problem, 'problem')
         if (operation == 'problem.read') then
            call read_problem(x%in%text('path'), x%in%text('command'), problem, x%error)
         else if (operation == 'problem.parse') then
            call problem_of_text(x%in%text('path'), x%in%text('content'), problem, x%error)
         else
            call read_table_alone(problem, x)
         end if
      case ('indentation.new')
         allocate (model)
         call x%give(model, 'indentation')
         call new_indentation_model(x%problem%settings, model, x%error)
      case ('simulator.new')
         allocate (simulator)
         call x%give(simulator, 'simulator')
         call new_simulator(x%problem%settings, simulator%simulator, x%error)
      case ('basis.new')
         call basis_of_problem(x%problem, basis, x%error)
         if (.not. allocated(x%error)) call give_basis(basis, x)
      case ('surrogate.load')
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         call load_named_surrogate(x%in%text('name'), x%in%text('symmetry'), x%places(), surrogate, x%error)
      case ('posterior.extract', 'posterior.density', 'posterior.prior')
         call new_posterior(operation, x)
      case ('stage.open')
         allocate (stage)
         call x%give(stage, 'stage')
         call new_stage(x%in%text('name'), stage%stage, x%error)
         if (.not. allocated(x%error)) call stage%stage%open(x%problem, x%places(), x%error)
         if (.not. allocated(x%error)) call x%out%put('expected', stage%stage%n_expected)
      case default
         call x%refuse(operation)
      end select
      if (allocated(x%error) .and. index('indentation.new simulator.new', operation) > 0) &
         & x%error%message = place(x%problem%path, 'simulation', '')//x%error%message
   end subroutine make_object

   !> Files of results, and a command at work in its folder.
   subroutine perform_file(verb, x)
      character(len=*), intent(in) :: verb
      type(exchange_type), intent(inout) :: x

      select case (verb)
      case ('watch_signals')
         call watch_signals()
      case ('take_folder')
         call take_folder(x%in%text('folder'), x%in%integer('patience'), x%in%logical('resumes'), x%error)
      case ('end_command')
         call end_command()
      case ('begin_results')
         call begin_results(x%problem, x%in%text('groups'), x%places(), x%error)
      case ('check_stages')
         call check_stages(x%problem, x%places(), x%error)
      case ('digest')
         x%text = x%in%text('path')
         if (len(x%text) > 0) call read_bytes(x%in%text('path'), x%text, x%error)
         if (.not. allocated(x%error)) x%text = checksum(x%text)
      case ('read_resolved')
         call read_resolved(x%in%text('folder'), x%text, x%error)
      case ('write_document')
         call write_document(x%in%text('path'), x%in%text('document'), x%error)
      case ('read_document')
         call read_document(x%in%text('path'), x%text, x%error)
      case ('read_posterior')
         ! Its values are those of the file.
         call read_posterior(x%in%text('folder'), x%out%bytes, x%error)
         if (allocated(x%out%bytes)) x%out%filled = len(x%out%bytes)
      case ('find_surrogate')
         call find_surrogate(x%in%text('name'), x%places(), x%text, x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine perform_file
end module operations
