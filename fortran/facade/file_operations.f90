!> Files of results, and a command at work in its folder.
module file_operations
   use checksums, only: checksum
   use errors, only: error_type
   use exchange, only: exchange_type
   use files, only: read_bytes
   use posterior_file, only: read_posterior
   use problem, only: problem_type
   use running_command, only: end_command, take_folder, watch_signals
   use stage_documents, only: begin_results, read_document, read_resolved, write_document
   use stages, only: check_stages
   use surrogate_lookup, only: find_surrogate
   use surrogate_operations, only: places_of
   implicit none
   private
   public :: perform_file

contains

   subroutine perform_file(verb, x, error)
      !> See the cases.
      character(len=*), intent(in) :: verb
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: problem
      character(len=:), allocatable :: text

      select case (verb)
      case ('watch_signals')
         call watch_signals()
      case ('take_folder')
         call take_folder(x%in%text('folder'), int(x%in%integer('patience')), x%in%logical('resumes'), error)
      case ('end_command')
         call end_command()
      case ('begin_results')
         problem => x%problem(error)
         if (.not. allocated(error)) call begin_results(problem, x%in%text('groups'), places_of(x), error)
      case ('check_stages')
         problem => x%problem(error)
         if (.not. allocated(error)) call check_stages(problem, places_of(x), error)
      case ('digest')
         text = x%in%text('path')
         if (len(text) > 0) call read_bytes(x%in%text('path'), text, error)
         if (.not. allocated(error)) call x%out%put('text', checksum(text))
      case ('read_resolved')
         call read_resolved(x%in%text('folder'), text, error)
         if (.not. allocated(error)) call x%out%put('text', text)
      case ('write_document')
         call write_document(x%in%text('path'), x%in%text('document'), error)
      case ('read_document')
         call read_document(x%in%text('path'), text, error)
         if (.not. allocated(error)) call x%out%put('text', text)
      case ('read_posterior')
         ! Its values are those of the file.
         call read_posterior(x%in%text('folder'), text, error)
         if (allocated(error)) return
         x%out%filled = len(text)
         call move_alloc(text, x%out%bytes)
      case ('find_surrogate')
         call find_surrogate(x%in%text('name'), places_of(x), text, error)
         if (.not. allocated(error)) call x%out%put('text', text)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine perform_file
end module file_operations
