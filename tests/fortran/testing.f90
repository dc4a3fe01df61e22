!> A test harness of a few lines: each check prints one line of the Test Anything Protocol.
module testing
   use errors, only: error_type
   use kinds, only: wp
   use text, only: to_text
   implicit none
   private
   public :: check, check_close, check_success, check_refused, finish

   integer :: count = 0, failures = 0

contains

   !> Record whether `condition` holds; `detail` is printed when it does not.
   subroutine check(name, condition, detail)
      character(len=*), intent(in) :: name
      logical, intent(in) :: condition
      character(len=*), intent(in), optional :: detail

      count = count + 1
      if (condition) then
         print '(a,i0,2a)', 'ok ', count, ' - ', name
      else
         failures = failures + 1
         print '(a,i0,2a)', 'not ok ', count, ' - ', name
         if (present(detail)) print '(2a)', '# ', detail
      end if
   end subroutine check

   !> |actual - expected| <= tolerance, absolute.
   subroutine check_close(name, actual, expected, tolerance)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: actual, expected, tolerance

      call check(name, abs(actual - expected) <= tolerance, to_text(actual, 15)//' is not within ' &
         & //to_text(tolerance)//' of '//to_text(expected, 15))
   end subroutine check_close

   subroutine check_success(name, error)
      character(len=*), intent(in) :: name
      type(error_type), intent(in), allocatable :: error

      if (allocated(error)) then
         call check(name, .false., error%message)
      else
         call check(name, .true.)
      end if
   end subroutine check_success

   !> An error is there, and its message holds `fragment`.
   subroutine check_refused(name, error, fragment)
      character(len=*), intent(in) :: name, fragment
      type(error_type), intent(in), allocatable :: error

      if (allocated(error)) then
         call check(name, index(error%message, fragment) > 0, 'the message is: '//error%message)
      else
         call check(name, .false., 'no error was raised')
      end if
   end subroutine check_refused

   !> Print the plan; the process ends with status 1 if anything failed.
   subroutine finish()
      print '(a,i0)', '1..', count
      if (failures > 0) error stop 1
   end subroutine finish
end module testing
