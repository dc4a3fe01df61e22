!> The progress of long loops, as lines on standard error: 'sampling: 45 %, about 12 s left'.
!>
!> The library prints nothing until a program calls `show_progress`. Loops may be nested; steps
!> count for the innermost one. Threads may call `advance_progress` at the same time; a single
!> thread begins and ends loops.
module progress
   use kinds, only: i8
   use running_command, only: error_stream, print_line
   implicit none
   private
   public :: show_progress, begin_progress, advance_progress, end_progress

   type :: loop_type
      character(len=64) :: name = ''
      integer(i8) :: steps = 1_i8, done = 0_i8
      !> Times of the beginning and of the next line, ms.
      integer(i8) :: begun = 0_i8, next_line = 0_i8
   end type loop_type

   !> The first line is printed after this time, and the others follow at this distance, ms.
   integer(i8), parameter :: interval_ms = 10000_i8
   !> Loops nested more deeply count as part of this one.
   integer, parameter :: deepest = 8

   type(loop_type) :: loops(0:deepest)
   integer :: innermost = 0
   logical :: wanted = .false.

contains

   !> Turn the lines on or off.
   subroutine show_progress(on)
      !> Whether lines are printed.
      logical, intent(in) :: on

      wanted = on
   end subroutine show_progress

   !> Begin a loop of this `name` and number of `steps`.
   subroutine begin_progress(name, steps)
      character(len=*), intent(in) :: name
      integer(i8), intent(in) :: steps
      integer(i8) :: now

      now = milliseconds()
      innermost = min(innermost + 1, deepest)
      loops(innermost) = loop_type(name, max(1_i8, steps), begun=now, next_line=now + interval_ms)
   end subroutine begin_progress

   !> Count this number of `steps` as done.
   subroutine advance_progress(steps)
      integer(i8), intent(in) :: steps
      integer(i8) :: now

      now = milliseconds()
      !$omp critical (progress_loops)
      associate (loop => loops(innermost))
         loop%done = loop%done + steps
         if (wanted .and. loop%done > 0_i8 .and. now >= loop%next_line) then
            call print_progress(loop, now)
         end if
      end associate
      !$omp end critical (progress_loops)
   end subroutine advance_progress

   !> End the innermost loop.
   subroutine end_progress()
      innermost = max(innermost - 1, 0)
   end subroutine end_progress

   !> Print the line of a loop and set the time of the next one.
   subroutine print_progress(loop, now)
      type(loop_type), intent(inout) :: loop
      !> Present time, ms.
      integer(i8), intent(in) :: now
      integer(i8) :: left
      character(len=128) :: line

      left = (now - loop%begun)*max(0_i8, loop%steps - loop%done)/loop%done/1000_i8
      loop%next_line = now + interval_ms
      write (line, '(a, ": ", i0, " %, about ", i0, " s left")') trim(loop%name), &
         & 100_i8*loop%done/loop%steps, left
      call print_line(error_stream, trim(line))
   end subroutine print_progress

   !> Time of a clock that never runs backwards, ms.
   integer(i8) function milliseconds()
      integer(i8) :: ticks, per_second

      call system_clock(ticks, per_second)
      milliseconds = ticks/max(1_i8, per_second/1000_i8)
   end function milliseconds
end module progress
