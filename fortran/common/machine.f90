!> Memory and processors of the machine. Sizes come from users, so a size that exceeds the free
!> memory is refused before it is allocated: the system grants an allocation, and ends the process
!> when the memory is used.
module machine
   use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
   use errors, only: error_type, machine_failure, raise
   use files, only: process_number
   use kinds, only: wp
   use omp_lib, only: omp_get_num_procs
   use text, only: to_text
   implicit none
   private
   public :: check_memory, free_memory, memory_text, raise_no_memory, reserve_blas, thread_count

   interface
      !> Bytes that this process may still use, limited by the machine, its control group and its
      !> address space.
      real(c_double) function free_memory() bind(c, name='bayesindent_free_memory')
         import
      end function free_memory
      !> Let BLAS allocate its buffers for this number of `callers` at a time. The result is the
      !> number that it has buffers for. A caller without a buffer would wait for ever.
      integer(c_int32_t) function reserve_blas(callers) bind(c, name='bayesindent_reserve_blas')
         import
         integer(c_int32_t), value :: callers
      end function reserve_blas
   end interface

   !> The process that first called `thread_count`.
   integer :: first_process = 0

contains

   !> Refuse a task that needs more memory than is free.
   subroutine check_memory(bytes, what, error)
      !> Bytes needed; a real, because its products do not overflow.
      real(wp), intent(in) :: bytes
      !> The task: 'a mesh of 100 elements'.
      character(len=*), intent(in) :: what
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: share = 0.95_wp
      real(wp) :: available

      available = free_memory()
      if (bytes > share*available) then
         call raise(error, 'too little memory for '//what//': '//memory_text(bytes) &
            & //' are needed, '//memory_text(available)//' are free', machine_failure)
      end if
   end subroutine check_memory

   !> Report an allocation that failed.
   subroutine raise_no_memory(what, error)
      !> The task that needs the memory.
      character(len=*), intent(in) :: what
      type(error_type), allocatable, intent(out) :: error

      call raise(error, 'too little memory for '//what, machine_failure)
   end subroutine raise_no_memory

   !> A number of `bytes` in words: '5.6 GB'.
   pure function memory_text(bytes) result(string)
      real(wp), intent(in) :: bytes
      character(len=:), allocatable :: string

      string = to_text(1.0e-9_wp*bytes, 3)//' GB'
   end function memory_text

   !> The number of threads to use: `wanted`, or one for each processor that this process may use if
   !> `wanted` is 0. More than four for each processor gain nothing, and BLAS must have a buffer for
   !> each. A forked process gets one thread: OpenMP would wait for threads that the process has not
   !> inherited.
   integer function thread_count(wanted)
      integer, intent(in) :: wanted

      thread_count = min(wanted, 4*omp_get_num_procs())
      if (wanted <= 0) thread_count = omp_get_num_procs()
      thread_count = max(1, min(thread_count, reserve_blas(thread_count)))
      !$omp critical (machine)
      if (first_process == 0) first_process = process_number()
      if (first_process /= process_number()) thread_count = 1
      !$omp end critical (machine)
   end function thread_count

end module machine
