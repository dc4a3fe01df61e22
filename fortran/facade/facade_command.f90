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

!> Let a problem (problem_handle) keep its finished chains in a folder.
subroutine command_keep_chains(problem_handle, folder, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: problem_handle
   character(len=*), intent(in) :: folder
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   call problem_of_handle(problem_handle, self, error)
   if (.not. allocated(error)) self%kept_in = folder
   call error_to_status(error, status, message)
end subroutine command_keep_chains

!> Remove the chains that are kept in a folder.
subroutine command_forget_chains(folder)
   use chain_checkpoints, only: chain_prefix
   use running_command, only: remove_files
   implicit none
   character(len=*), intent(in) :: folder

   call remove_files(folder, chain_prefix)
end subroutine command_forget_chains

!> Leave the folder to others and signals to the interpreter.
subroutine command_end()
   use running_command, only: end_command
   implicit none

   call end_command()
end subroutine command_end
