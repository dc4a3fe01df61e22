! What f2py reads: a procedure that does an operation on named values, and one that gives memory
! back. See `operations`. gfortran keeps lengths of texts that functions give in static memory, so
! that two threads must not use such texts at once: only long work on numbers gives up Python's
! lock.

!> Do an `operation` on an object that is held under a `handle` (0: on none). `request`: its named
!> values, n words of 8 bytes (see `named_values`). What it gives, named values of so many `words`,
!> is at an `address` until the handle `reply` is released. status: 0 done, 1 failure, 2 bad input,
!> 3 the machine's failure; then what it gives is the reason, 'message'.
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

!> The same `operation` on the n words of a `request`, without Python's lock: `words` are at an
!> `address` until the handle `reply` is released; its `status`.
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

!> Give back the memory of an object; a handle that is not known any more does no harm.
subroutine core_release(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use exchange, only: release_object
   implicit none
   integer(c_int64_t), intent(in) :: handle

   call release_object(handle)
end subroutine core_release
