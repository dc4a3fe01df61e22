! Objects that Python holds, for f2py.

!> Give back the memory of an object of any kind; a handle that is not known any more does no harm.
subroutine object_release(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use object_registry, only: release_object
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle

   call release_object(handle)
end subroutine object_release
