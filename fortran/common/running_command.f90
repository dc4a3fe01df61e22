!> A running command. It has its output folder to itself, and SIGINT, SIGTERM and SIGHUP end it at
!> once, even in compiled loops.
!>
!> Loops do not check for signals. Stored results are complete at every moment (files are written
!> under temporary names, rows are committed), so the handler prints a message and ends the process,
!> whatever the process is doing. Programs call these procedures and the library does not, because
!> signals in the library are the user's. Only one command runs at a time.
!>
!> Ctrl-C during a call of the library is different. A caller's handler of SIGINT, such as Python's,
!> only sets a flag until compiled code has returned. Therefore the library listens: it records the
!> signal and then passes it to that handler. Long loops check `stop_requested` and leave, and their
!> results are discarded. Nothing changes if SIGINT has no handler, or if the handler is that of a
!> running command.
module running_command
   use, intrinsic :: iso_c_binding, only: c_bool, c_int, c_null_char
   use errors, only: error_type, raise, refuse
   use files, only: make_folder, unfinished
   use text, only: to_text
   implicit none
   private
   public :: watch_signals, take_folder, remove_files, end_command
   public :: listen, stop_listening, stop_requested, print_line, output_stream, error_stream

   !> Streams of `print_line`.
   integer(c_int), parameter :: output_stream = 1, error_stream = 2

   interface
      !> From now on a signal ends the process, with status 128 + signal and one line.
      subroutine watch_signals() bind(c, name='bayesindent_watch_signals')
      end subroutine watch_signals
      integer(c_int) function c_take_folder(folder, prefix, milliseconds, resumes, holder) bind(c, &
         & name='bayesindent_take_folder')
         import
         character, intent(in) :: folder(*), prefix(*)
         integer(c_int), value :: milliseconds, resumes
         integer(c_int), intent(out) :: holder
      end function c_take_folder
      subroutine c_remove_files(folder, prefix) bind(c, name='bayesindent_remove_files')
         import
         character, intent(in) :: folder(*), prefix(*)
      end subroutine c_remove_files
      !> Release the folder and restore the handlers of signals.
      subroutine end_command() bind(c, name='bayesindent_end_command')
      end subroutine end_command
      subroutine c_print(to, line) bind(c, name='bayesindent_print')
         import
         integer(c_int), value :: to
         character, intent(in) :: line(*)
      end subroutine c_print
      !> Begin to record SIGINT; threads may call this at the same time.
      subroutine listen() bind(c, name='bayesindent_listen')
      end subroutine listen
      !> Called once for each `listen`; the last call forgets a recorded signal.
      subroutine stop_listening() bind(c, name='bayesindent_stop_listening')
      end subroutine stop_listening
      !> Whether a signal was recorded since listening began.
      logical(c_bool) function stop_requested() bind(c, name='bayesindent_stop_requested')
         import
      end function stop_requested
   end interface

contains

   !> Make an output folder and lock it: wait for another process, or refuse with a message that
   !> names it. Signals are then written to the log of the folder, too, and the unfinished files of
   !> killed processes are removed.
   subroutine take_folder(path, patience, resumes, error)
      character(len=*), intent(in) :: path
      !> How long to wait, s.
      integer, intent(in) :: patience
      !> Whether the same command resumes from its stored results.
      logical, intent(in) :: resumes
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: owner
      integer(c_int), parameter :: locked = 0, in_use = 1
      integer(c_int) :: status, holder

      call make_folder(path, error)
      if (allocated(error)) return
      status = c_take_folder(path//c_null_char, unfinished//c_null_char, 1000*patience, &
         & merge(1, 0, resumes), holder)
      if (status == in_use) then
         owner = 'another process'
         if (holder > 0) owner = 'process '//to_text(holder)
         call refuse(error, path//': '//owner//' is at work in this folder; wait until it has ' &
            & //'ended, or choose another with --output')
      else if (status /= locked) then
         call raise(error, path//'/.lock: is a link, or cannot be written; choose a folder of ' &
            & //'your own with --output')
      end if
   end subroutine take_folder

   !> Print a `line` at once. If standard output cannot be written, the program ends with status 1.
   subroutine print_line(stream, line)
      !> `output_stream` or `error_stream`.
      integer(c_int), intent(in) :: stream
      character(len=*), intent(in) :: line

      call c_print(stream, line//c_null_char)
   end subroutine print_line

   !> Remove the files of a folder whose names begin with `prefix`.
   subroutine remove_files(path, prefix)
      character(len=*), intent(in) :: path, prefix

      call c_remove_files(path//c_null_char, prefix//c_null_char)
   end subroutine remove_files

end module running_command
