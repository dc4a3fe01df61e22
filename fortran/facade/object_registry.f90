!> Objects that another language holds: each under a number that is never used again, with the kind of object it stands for.
!>
!> A number that was freed, was never given, or stands for another kind is an error in words, not a crash. Threads may
!> register, find and release at the same time; who holds a number keeps its object alive while it is used.
module object_registry
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: i8
   use text, only: to_text
   implicit none
   private
   public :: register_object, find_object, release_object

   type :: entry_type
      integer(i8) :: handle = 0
      character(len=:), allocatable :: kind
      class(*), pointer :: object => null()
   end type entry_type

   type(entry_type), allocatable :: entries(:)
   integer(i8) :: last_handle = 0

contains

   !> Keep an object of the heap; `release_object` frees it.
   subroutine register_object(object, kind, handle)
      class(*), pointer, intent(in) :: object
      !> What it is, for messages: 'surrogate', 'posterior', ..
      character(len=*), intent(in) :: kind
      !> Its number, above 0.
      integer(i8), intent(out) :: handle
      type(entry_type), allocatable :: larger(:)
      integer :: i

      !$omp critical (object_registry)
      if (.not. allocated(entries)) allocate (entries(16))
      i = place_of(0_i8)
      if (i == 0) then
         i = size(entries) + 1
         allocate (larger(2*size(entries)))
         larger(:i - 1) = entries
         call move_alloc(larger, entries)
      end if
      last_handle = last_handle + 1
      handle = last_handle
      entries(i)%handle = handle
      entries(i)%kind = kind
      entries(i)%object => object
      !$omp end critical (object_registry)
   end subroutine register_object

   !> Where a handle stands, 0: nowhere.
   integer function place_of(handle)
      integer(i8), intent(in) :: handle

      place_of = 0
      if (allocated(entries)) place_of = findloc(entries%handle, handle, 1)
   end function place_of

   !> The object of a handle, if it is of this kind.
   subroutine find_object(handle, kind, object, error)
      integer(i8), intent(in) :: handle
      character(len=*), intent(in) :: kind
      class(*), pointer, intent(out) :: object
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: found
      integer :: i

      object => null()
      found = ''
      i = 0
      !$omp critical (object_registry)
      if (handle > 0) i = place_of(handle)
      if (i > 0) found = entries(i)%kind
      if (found == kind) object => entries(i)%object
      !$omp end critical (object_registry)
      if (associated(object)) return
      if (len(found) > 0) then
         call raise(error, 'handle '//to_text(handle)//' stands for a '//found//', not a '//kind, exit_bad_input)
      else
         call raise(error, 'the '//kind//' does not exist any more (handle '//to_text(handle)//' was freed, or is of ' &
            & //'another process)', exit_bad_input)
      end if
   end subroutine find_object

   !> Free the object of a handle; one that is not there is no error, so that freeing twice does no harm.
   subroutine release_object(handle)
      integer(i8), intent(in) :: handle
      class(*), pointer :: object
      integer :: i

      object => null()
      i = 0
      !$omp critical (object_registry)
      if (handle > 0) i = place_of(handle)
      if (i > 0) then
         object => entries(i)%object
         entries(i)%handle = 0
         entries(i)%object => null()
      end if
      !$omp end critical (object_registry)
      if (associated(object)) deallocate (object)
   end subroutine release_object
end module object_registry
