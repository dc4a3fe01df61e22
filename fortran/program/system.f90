!> What a program asks of the operating system, through the C library: arguments, exit status, the threads of BLAS.
module system
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_long, c_null_char, c_null_ptr, c_ptr, c_loc
   use files, only: folder_of, is_folder, read_entry
   use text, only: to_text
   use version, only: installed_data
   implicit none
   private
   public :: argument, end_process, settle_blas, data_folder

   interface
      subroutine c_exit(status) bind(c, name='exit')
         import :: c_int
         integer(c_int), value :: status
      end subroutine c_exit
      integer(c_int) function c_setenv(name, value, overwrite) bind(c, name='setenv')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: name(*), value(*)
         integer(c_int), value :: overwrite
      end function c_setenv
      integer(c_long) function c_readlink(path, buffer, size) bind(c, name='readlink')
         import :: c_char, c_long
         character(kind=c_char), intent(in) :: path(*)
         ! allow(C072)
         character(kind=c_char), intent(out) :: buffer(*)
         integer(c_long), value :: size
      end function c_readlink
      integer(c_int) function c_execv(path, arguments) bind(c, name='execv')
         import :: c_char, c_int, c_ptr
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr), intent(in) :: arguments(*)
      end function c_execv
   end interface

   type :: string_type
      character(kind=c_char, len=:), allocatable :: text
   end type string_type

contains

   !> Argument number `i` of the command line, whole.
   function argument(i) result(text)
      integer, intent(in) :: i
      character(len=:), allocatable :: text
      integer :: length

      call get_command_argument(i, length=length)
      allocate (character(len=length) :: text)
      if (length > 0) call get_command_argument(i, text)
   end function argument

   !> The folder of the package's data, with a slash at its end: as the environment says, or where it is from this program,
   !> installed, in a wheel (where programs have a folder beside the package), in the build folder, or among the packages of a Python
   !> that has other folders than it said when this was built, as Debian's has.
   function data_folder() result(folder)
      character(len=:), allocatable :: folder
      character(len=*), parameter :: places(4) = [character(len=max(32, len(installed_data))) :: &
         & installed_data, '../bayesindent/data/', '../data/', '../python/bayesindent/data/']
      character(len=*), parameter :: libraries(2) = [character(len=5) :: 'lib', 'lib64'], packages(2) = ['site', 'dist']
      integer, parameter :: newest = 40, oldest = 10
      integer :: i, length, minor, status

      call get_environment_variable('BAYESINDENT_DATA', length=length, status=status)
      if (status == 0 .and. length > 0) then
         allocate (character(len=length) :: folder)
         call get_environment_variable('BAYESINDENT_DATA', folder)
         folder = folder//'/'
         return
      end if
      do i = 1, size(places)
         folder = own_folder()//trim(places(i))
         if (is_folder(folder)) return
      end do
      do minor = newest, oldest, -1
         do i = 0, 3
            folder = own_folder()//'../'//trim(libraries(1 + i/2))//'/python3.'//to_text(minor)//'/'//packages(1 + mod(i, 2)) &
               & //'-packages/bayesindent/data/'
            if (is_folder(folder)) return
         end do
      end do
   end function data_folder

   !> Where this program is, with a slash at its end.
   function own_folder() result(folder)
      character(len=:), allocatable :: folder
      integer(c_long), parameter :: longest = 4096
      character(kind=c_char, len=longest) :: program_path
      integer :: length

      length = int(c_readlink('/proc/self/exe'//c_null_char, program_path, longest))
      folder = folder_of(program_path(:max(0, length)))
   end function own_folder

   !> End with this status; unlike STOP it prints nothing.
   subroutine end_process(status)
      integer, intent(in) :: status

      call c_exit(int(status, c_int))
   end subroutine end_process

   !> Say which vector kernels OpenBLAS shall use and how many threads, which it reads before a program starts: so start this one
   !> once more.
   !>
   !> OpenBLAS runs a processor that it does not know with the kernels of 2004; what counts is the instruction set. More than one
   !> thread would change the last bits of results with the number of cores. A user's own choice stands. A wheel has this program
   !> twice, for any x86-64 processor and for x86-64-v3: it is the fitting one that is started. The Python package does the same.
   subroutine settle_blas()
      character(len=*), parameter :: wide_program = '../bayesindent/x86_64_v3/bayesindent-batch'
      character(len=:), allocatable :: flags, kernels
      character(len=16) :: chosen
      integer(c_int) :: status
      integer :: kernels_status, threads_status
      logical :: wide

      call get_environment_variable('OPENBLAS_CORETYPE', chosen, status=kernels_status)
      call get_environment_variable('OPENBLAS_NUM_THREADS', status=threads_status)
      kernels = ''
      call read_entry('/proc/cpuinfo', 'flags', flags)
      if (has(['avx512f ', 'avx512dq', 'avx512bw', 'avx512vl'])) then
         kernels = 'SKYLAKEX'
      else if (has(['avx2', 'fma '])) then
         kernels = 'HASWELL'
      end if
      if (kernels_status == 1) chosen = kernels
      inquire (file=own_folder()//wide_program, exist=wide)
      wide = wide .and. any(chosen == [character(len=16) :: 'HASWELL', 'SKYLAKEX']) &
         & .and. has(['avx2 ', 'fma  ', 'f16c ', 'bmi1 ', 'bmi2 ', 'movbe', 'abm  '])
      status = c_setenv('OPENBLAS_NUM_THREADS'//c_null_char, '1'//c_null_char, 0_c_int)
      if (len(kernels) > 0) status = c_setenv('OPENBLAS_CORETYPE'//c_null_char, kernels//c_null_char, 0_c_int)
      if (wide) call restart(own_folder()//wide_program)
      if (threads_status /= 1 .and. (kernels_status /= 1 .or. len(kernels) == 0)) return
      call restart('/proc/self/exe')

   contains

      logical function has(names)
         character(len=*), intent(in) :: names(:)
         integer :: i

         has = all([(index(flags//' ', ' '//trim(names(i))//' ') > 0, i=1, size(names))])
      end function has
   end subroutine settle_blas

   !> Start the program of this file with the arguments of this one; return where that is not possible.
   subroutine restart(program_file)
      character(len=*), intent(in) :: program_file
      type(string_type), allocatable, target :: words(:)
      type(c_ptr), allocatable :: arguments(:)
      integer(c_int) :: status
      integer :: i

      allocate (words(0:command_argument_count()), arguments(0:command_argument_count() + 1))
      do i = 0, command_argument_count()
         words(i)%text = argument(i)//c_null_char
         arguments(i) = c_loc(words(i)%text)
      end do
      arguments(command_argument_count() + 1) = c_null_ptr
      status = c_execv(program_file//c_null_char, arguments)
   end subroutine restart
end module system
