! What f2py reads: one procedure that does an operation on named values, and one that fetches what it gave. See `operations`.
! gfortran keeps lengths of texts that functions give in static memory, so that two threads must not use such texts at once: only long
! work on numbers gives up Python's lock.

!> Do an `operation` on an object that is held under a `handle` (0: on none). `request`: its named values, n words of 8 bytes (see
!> `named_values`). What it gives, named values of so many `words`, waits under the handle `reply`. status: 0 done, 1 failure, 2 bad
!> input, 3
!> the machine's failure; then what it gives is the reason, 'message'.
subroutine core_do(operation, handle, n, request, reply, words, status)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use operations, only: perform
   implicit none
   character(len=*), intent(in) :: operation
   integer(c_int64_t), intent(in) :: handle, n, request(n)
   integer(c_int64_t), intent(out) :: reply, words
   integer(c_int), intent(out) :: status

   call perform(operation, handle, request, reply, words, status)
end subroutine core_do

!> The same `operation` on the n words of a `request`, without Python's lock: `words` wait under the handle `reply`.
subroutine core_do_long(operation, handle, n, request, reply, words, status)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use operations, only: perform
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: operation
   integer(c_int64_t), intent(in) :: handle, n, request(n)
   integer(c_int64_t), intent(out) :: reply, words
   integer(c_int), intent(out) :: status

   call perform(operation, handle, request, reply, words, status)
end subroutine core_do_long

!> The `content` that waits under the handle `reply`, which is freed; so many `words`.
subroutine core_take(reply, words, content)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use operations, only: take_reply
   implicit none
   integer(c_int64_t), intent(in) :: reply, words
   integer(c_int64_t), intent(out) :: content(words)

   call take_reply(reply, content)
end subroutine core_take

!> Give back the memory of an object; a handle that is not known any more does no harm.
subroutine core_release(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use object_registry, only: release_object
   implicit none
   integer(c_int64_t), intent(in) :: handle

   call release_object(handle)
end subroutine core_release
