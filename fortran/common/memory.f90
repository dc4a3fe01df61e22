!> What the machine has left. Sizes come from users: what cannot be had is refused in words before it is asked for, since the
!> system would end the process when it is used, not when it is allocated.
module memory
   use, intrinsic :: iso_c_binding, only: c_double
   use errors, only: error_type, machine_failure, raise
   use kinds, only: wp
   use text, only: to_text
   implicit none
   private
   public :: check_memory, free_memory, memory_text, raise_no_memory

   !> Bytes that OpenBLAS takes for each thread; where it cannot, it waits for ever.
   real(wp), parameter, public :: blas_bytes = 1.5e8_wp

   interface
      !> Bytes that this process may still use: of the machine, of its group of processes, and of its address space.
      real(c_double) function free_memory() bind(c, name='bayesindent_free_memory')
         import :: c_double
      end function free_memory
   end interface

contains

   !> Refuse what needs more memory than is free.
   subroutine check_memory(bytes, what, error)
      !> Bytes needed: a real, whose products do not overflow.
      real(wp), intent(in) :: bytes
      !> What for: 'a mesh of 100 elements'.
      character(len=*), intent(in) :: what
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: share = 0.95_wp
      real(wp) :: available

      available = free_memory()
      if (bytes > share*available) call raise(error, 'too little memory for '//what//': '//memory_text(bytes) &
         & //' are needed, '//memory_text(available)//' are free', machine_failure)
   end subroutine check_memory

   !> The error of an allocation that failed.
   subroutine raise_no_memory(what, error)
      !> What it was for.
      character(len=*), intent(in) :: what
      type(error_type), allocatable, intent(out) :: error

      call raise(error, 'too little memory for '//what, machine_failure)
   end subroutine raise_no_memory

   !> A number of `bytes` in words: '5.6 GB'.
   pure function memory_text(bytes) result(string)
      real(wp), intent(in) :: bytes
      character(len=len_trim(in_units(bytes))) :: string

      string = in_units(bytes)
   end function memory_text

   pure function in_units(bytes) result(string)
      real(wp), intent(in) :: bytes
      character(len=40) :: string

      if (bytes < 1.0e9_wp) then
         string = to_text(nint(1.0e-6_wp*bytes))//' MB'
      else if (bytes < 1.0e11_wp) then
         string = to_text(1.0e-9_wp*bytes, 3)//' GB'
      else
         string = to_text(nint(1.0e-12_wp*min(bytes, 1.0e21_wp)))//' TB'
      end if
   end function in_units
end module memory
