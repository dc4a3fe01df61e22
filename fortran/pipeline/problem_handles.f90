!> Problems that another language holds: what is behind their handles.
module problem_handles
   use errors, only: error_type
   use kinds, only: i8
   use object_registry, only: find_object
   use problem, only: problem_type
   implicit none
   private
   public :: problem_of_handle

contains

   subroutine problem_of_handle(handle, self, error)
      integer(i8), intent(in) :: handle
      type(problem_type), pointer, intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      self => null()
      call find_object(handle, 'problem', object, error)
      if (allocated(error)) return
      select type (object)
      type is (problem_type)
         self => object
      end select
   end subroutine problem_of_handle
end module problem_handles
