! Procedures that f2py wraps: they perform an operation on named values, and free memory. See
! `operations`. gfortran keeps the lengths of the texts that functions return in static memory, so
! two threads must not use such texts at once: only long numerical work releases Python's lock.

!> Perform an `operation` on the object of a `handle` (0: on none). The `request` has its named
!> values, n words of 8 bytes (see `named_values`). The result, named values of `words` words, is at
!> the `address` until the handle `reply` is released. status: 0 done, 1 failure, 2 bad input, 3
!> failure of the machine; after a failure the result is the reason, 'message'.
subroutine core_do(operation, handle, n, request, reply, address, words, status)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use operations, only: perform
   implicit none
   character(len=*), intent(in) :: operation
   integer(c_int64_t), intent(in) :: handle, n, request(n)
   integer(c_int64_t), intent(out) :: reply, address, words
   integer(c_int), intent(out) :: status

   call perform(operation, handle, request, reply, address, words, status)
end subroutine core_do

!> Perform an `operation` on the object of a `handle` without Python's lock. The arguments are those
!> of `core_do`: n words of the `request`; `reply`, `address`, `words` and `status` of the result.
subroutine core_do_long(operation, handle, n, request, reply, address, words, status)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use operations, only: perform
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: operation
   integer(c_int64_t), intent(in) :: handle, n, request(n)
   integer(c_int64_t), intent(out) :: reply, address, words
   integer(c_int), intent(out) :: status

   call perform(operation, handle, request, reply, address, words, status)
end subroutine core_do_long

!> Free the object of a `handle`; one that was freed before is ignored.
subroutine core_release(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use exchange, only: release_object
   implicit none
   integer(c_int64_t), intent(in) :: handle

   call release_object(handle)
end subroutine core_release
