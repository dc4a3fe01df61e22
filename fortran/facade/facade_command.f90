! A command at work, for the command line alone; see `running_command`. status: 0 done, 1 failure, 2 bad input; message: the reason, blank
! on success.

!> Let signals end the process from now on.
subroutine command_watch_signals()
   use running_command, only: watch_signals
   implicit none

   call watch_signals()
end subroutine command_watch_signals

!> Have an output folder alone, which is made; wait `patience` seconds for another process. resumes: 1 if the command goes on from what it
!> has kept.
subroutine command_take_folder(folder, patience, resumes, status, message)
   use interoperation, only: c_int, error_to_status, error_type
   use running_command, only: take_folder
   implicit none
   character(len=*), intent(in) :: folder
   integer(c_int), intent(in) :: patience, resumes
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(error_type), allocatable :: error

   call take_folder(folder, int(patience), resumes /= 0, error)
   call error_to_status(error, status, message)
end subroutine command_take_folder

!> Leave the folder to others and signals to the interpreter.
subroutine command_end()
   use running_command, only: end_command
   implicit none

   call end_command()
end subroutine command_end
