!> A command at work: it has its output folder to itself, and SIGINT, SIGTERM and SIGHUP end it at once, in compiled loops too.
!>
!> No loop asks whether a signal came. Results are whole at every moment (files are written beside their names, rows are committed),
!> so that the handler can tell the user and end the process, which nothing can keep from happening. Programs call this and the
!> library does not: there signals are the user's. One command at a time.
module running_command
   use, intrinsic :: iso_c_binding, only: c_char, c_int32_t, c_null_char
   use errors, only: error_type, exit_bad_input, raise
   use files, only: make_folder, unfinished
   use text, only: to_text
   implicit none
   private
   public :: watch_signals, take_folder, remove_files, end_command

   !> The lock of a folder, and what the programs tell of a run.
   character(len=*), parameter :: lock_name = '/.lock', log_name = '/run.log'

   interface
      subroutine c_watch(words, log) bind(c, name='bayesindent_watch_signals')
         import :: c_char
         character(kind=c_char), intent(in) :: words(*), log(*)
      end subroutine c_watch
      subroutine c_unwatch() bind(c, name='bayesindent_unwatch_signals')
      end subroutine c_unwatch
      integer(c_int32_t) function c_lock(file, milliseconds, holder) bind(c, name='bayesindent_lock_file')
         import :: c_char, c_int32_t
         character(kind=c_char), intent(in) :: file(*)
         integer(c_int32_t), value :: milliseconds
         integer(c_int32_t), intent(out) :: holder
      end function c_lock
      subroutine c_unlock() bind(c, name='bayesindent_unlock_file')
      end subroutine c_unlock
      subroutine c_remove_remains(folder, prefix) bind(c, name='bayesindent_remove_remains')
         import :: c_char
         character(kind=c_char), intent(in) :: folder(*), prefix(*)
      end subroutine c_remove_remains
      subroutine c_remove_files(folder, prefix) bind(c, name='bayesindent_remove_files')
         import :: c_char
         character(kind=c_char), intent(in) :: folder(*), prefix(*)
      end subroutine c_remove_files
   end interface

contains

   !> From now on a signal ends the process, with status 128 + signal and one line.
   subroutine watch_signals()
      call c_watch('; the same command begins anew'//c_null_char, c_null_char)
   end subroutine watch_signals

   !> Make an output folder and have it alone: wait for another process, or refuse in words that name it. Then a signal is told in its log,
   !> too, and what killed processes left unfinished there is gone.
   subroutine take_folder(path, patience, resumes, error)
      character(len=*), intent(in) :: path
      !> How long to wait, s.
      integer, intent(in) :: patience
      !> Whether the command goes on from what it has kept.
      logical, intent(in) :: resumes
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: words
      integer(c_int32_t), parameter :: locked = 0, held = 1
      integer(c_int32_t) :: status, holder

      call make_folder(path, error)
      if (allocated(error)) return
      status = c_lock(path//lock_name//c_null_char, 1000_c_int32_t*int(patience, c_int32_t), holder)
      if (status == held) then
         words = 'another process'
         if (holder > 0) words = 'process '//to_text(int(holder))
         call raise(error, path//': '//words//' is at work in this folder; wait until it has ended, or choose another with ' &
            & //'--output', exit_bad_input)
      else if (status /= locked) then
         call raise(error, path//lock_name//': cannot be written; choose a folder of your own with --output')
      end if
      if (allocated(error)) return
      call c_remove_remains(path//c_null_char, unfinished//c_null_char)
      words = '; the same command begins anew'
      if (resumes) words = '; what was finished is kept in '//path//', and the same command goes on from there'
      call c_watch(words//c_null_char, path//log_name//c_null_char)
   end subroutine take_folder

   !> Remove the files of a folder whose names begin with `prefix`.
   subroutine remove_files(path, prefix)
      character(len=*), intent(in) :: path, prefix

      call c_remove_files(path//c_null_char, prefix//c_null_char)
   end subroutine remove_files

   !> Leave the folder to others, and signals to what they did before.
   subroutine end_command()
      call c_unwatch()
      call c_unlock()
   end subroutine end_command
end module running_command
