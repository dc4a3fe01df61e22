!> What a program asks of the operating system: arguments, exit status, the threads of BLAS, the package's data.
module system
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
   use version, only: installed_data
   implicit none
   private
   public :: argument, end_process, settle_blas, data_folder, say, output_stream, error_stream

   !> Where `say` writes.
   integer(c_int), parameter :: output_stream = 1, error_stream = 2

   interface
      !> End with this status; unlike STOP it prints nothing.
      subroutine end_process(status) bind(c, name='exit')
         import :: c_int
         integer(c_int), value :: status
      end subroutine end_process
      !> Have the vector kernels of OpenBLAS that fit this processor, and one thread, in this program or the same one started once more.
      subroutine settle_blas() bind(c, name='bayesindent_settle_blas')
      end subroutine settle_blas
      subroutine c_print(to, line) bind(c, name='bayesindent_print')
         import :: c_char, c_int
         integer(c_int), value :: to
         character(kind=c_char), intent(in) :: line(*)
      end subroutine c_print
      subroutine c_data_folder(installed, folder, size) bind(c, name='bayesindent_data_folder')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: installed(*)
         ! allow(C072)
         character(kind=c_char), intent(out) :: folder(*)
         integer(c_int), value :: size
      end subroutine c_data_folder
   end interface

contains

   !> Write a `line` at once; if standard output cannot be written, say so and end. Unlike WRITE it never prints a message of its own.
   subroutine say(line, to)
      character(len=*), intent(in) :: line
      !> `output_stream`, or where it is given `error_stream`.
      integer(c_int), intent(in), optional :: to

      if (present(to)) then
         call c_print(to, line//c_null_char)
      else
         call c_print(output_stream, line//c_null_char)
      end if
   end subroutine say

   !> Argument number `i` of the command line, whole.
   function argument(i) result(text)
      integer, intent(in) :: i
      character(len=:), allocatable :: text
      integer :: length

      call get_command_argument(i, length=length)
      allocate (character(len=length) :: text)
      if (length > 0) call get_command_argument(i, text)
   end function argument

   !> The folder of the package's data, with a slash at its end.
   function data_folder() result(folder)
      character(len=:), allocatable :: folder
      character(kind=c_char, len=4096) :: found

      call c_data_folder(installed_data//c_null_char, found, len(found))
      folder = found(:index(found, c_null_char) - 1)
   end function data_folder
end module system
