!> Operations by name, 'KIND.VERB': on an object of a kind that another language holds, or without an object on a subject.
module operations
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int, c_int64_t, c_loc
   use crystal_operations, only: perform_crystal
   use errors, only: error_type, exit_bad_input, raise
   use exchange, only: exchange_type
   use file_operations, only: perform_file
   use named_values, only: named_values_type
   use object_registry, only: find_object, register_object, release_object
   use posterior_operations, only: perform_posterior
   use problem_operations, only: perform_problem
   use simulation_operations, only: perform_simulation
   use stage_operations, only: perform_stage
   use surrogate_operations, only: perform_surrogate
   implicit none
   private
   public :: perform, take_reply

contains

   !> Do an operation on a `request`; `words` wait under the handle `reply`, see `core_do`.
   subroutine perform(operation, handle, request, reply, words, status)
      character(len=*), intent(in) :: operation
      integer(c_int64_t), intent(in) :: handle
      integer(c_int64_t), intent(in), target, contiguous :: request(:)
      integer(c_int64_t), intent(out) :: reply, words
      integer(c_int), intent(out) :: status
      type(exchange_type) :: values
      type(named_values_type), pointer :: given
      type(error_type), allocatable :: error
      class(*), pointer :: object
      character(len=:), allocatable :: kind, verb

      kind = operation(:index(operation, '.') - 1)
      verb = operation(index(operation, '.') + 1:)
      call c_f_pointer(c_loc(request), values%in%bytes, [8*size(request, kind=c_int64_t)])
      object => null()
      if (handle > 0) call find_object(handle, kind, object, error)
      if (.not. allocated(error)) then
         select case (kind)
         case ('crystal')
            call perform_crystal(verb, values, error)
         case ('problem', 'settings')
            call perform_problem(verb, object, values, error)
         case ('indentation', 'simulator')
            call perform_simulation(verb, object, values, error)
         case ('basis', 'surrogate', 'learner')
            call perform_surrogate(verb, object, values, error)
         case ('stage', 'campaign')
            call perform_stage(verb, object, values, error)
         case ('posterior')
            call perform_posterior(verb, object, values, error)
         case default
            call perform_file(verb, values, error)
         end select
      end if
      if (.not. allocated(error) .and. allocated(values%in%error)) error = values%in%error
      allocate (given)
      status = 0
      if (allocated(error)) then
         status = error%status
         call given%put('message', error%message)
         if (associated(values%made)) deallocate (values%made)
      else
         if (associated(values%made)) call values%keep()
         given = values%out
      end if
      if (given%filled == 0) call given%put('', 0)
      words = given%filled/8
      object => given
      call register_object(object, 'reply', reply)
   end subroutine perform

   !> The `content` of a reply, which is freed.
   subroutine take_reply(reply, content)
      integer(c_int64_t), intent(in) :: reply
      integer(c_int64_t), intent(out) :: content(:)
      class(*), pointer :: object
      type(error_type), allocatable :: error
      integer(c_int64_t) :: i

      call find_object(reply, 'reply', object, error)
      if (allocated(error)) return
      select type (object)
      type is (named_values_type)
         do i = 1, size(content, kind=c_int64_t)
            content(i) = transfer(object%bytes(8*i - 7:8*i), content(i))
         end do
      end select
      call release_object(reply)
   end subroutine take_reply
end module operations
