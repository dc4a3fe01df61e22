!> Problems that another language holds: what is behind their handles.
module problem_handles
   use errors, only: error_type
   use kinds, only: i8
   use object_registry, only: find_object, register_object
   use point_tables, only: points_type
   use problem, only: problem_type
   use problem_texts, only: static_text, text_of
   implicit none
   private
   public :: register_problem, problem_of_handle, table_of_handle, text_of_handle

contains

   !> A handle for a problem on the heap; if `error` is set, 0, and the problem is no more.
   subroutine register_problem(self, error, handle)
      type(problem_type), pointer, intent(inout) :: self
      type(error_type), allocatable, intent(in) :: error
      integer(i8), intent(out) :: handle
      class(*), pointer :: object

      handle = 0
      if (allocated(error)) then
         deallocate (self)
      else
         object => self
         call register_object(object, 'problem', handle)
      end if
   end subroutine register_problem

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

   !> Table 1 crystals, 2 measurements, 3 candidates; null if the problem has it not.
   subroutine table_of_handle(handle, table, points, error)
      integer(i8), intent(in) :: handle
      integer, intent(in) :: table
      type(points_type), pointer, intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: self

      points => null()
      call problem_of_handle(handle, self, error)
      if (allocated(error)) return
      select case (table)
      case (1)
         if (allocated(self%crystals)) points => self%crystals
      case (2)
         if (allocated(self%measurements)) points => self%measurements
      case default
         if (allocated(self%candidates)) points => self%candidates
      end select
   end subroutine table_of_handle

   !> The text number `item` of `problem_texts`; handle 0: one without a problem.
   subroutine text_of_handle(handle, item, text, error)
      integer(i8), intent(in) :: handle
      integer, intent(in) :: item
      character(len=:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: self

      text = ''
      if (handle == 0) then
         text = static_text(item)
         return
      end if
      call problem_of_handle(handle, self, error)
      if (.not. allocated(error)) text = text_of(self, item)
   end subroutine text_of_handle
end module problem_handles
