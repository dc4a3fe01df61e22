!> The progress of long loops, as plain lines on standard error: 'sampling: 45 %, about 12 s left'.
!>
!> The library prints nothing until a program calls `show_progress`. A loop may begin within another
!> one; steps belong to the innermost loop. Threads may call `advance_progress` at the same time.
module progress
   use kinds, only: i8
   use running_command, only: error_stream, print_line
   implicit none
   private
   public :: show_progress, begin_progress, advance_progress, end_progress

   type :: loop_type
      character(len=64) :: name = ''
      integer(i8) :: steps = 1_i8, done = 0_i8
      !> Time of the begin, and of the next line, ms.
      integer(i8) :: begun = 0_i8, next_line = 0_i8
      !> Lines that were printed.
      integer :: lines = 0
   end type loop_type

   !> The first line is printed after this time, and the others follow at this distance, ms.
   integer(i8), parameter :: first_ms = 2000_i8, interval_ms = 5000_i8
   !> After so many lines the distance is twice as long.
   integer, parameter :: many = 12
   !> The deepest loop also counts the steps of loops within it.
   integer, parameter :: deepest = 8

   type(loop_type) :: loops(0:deepest)
   integer :: innermost = 0
   logical :: wanted = .false.

contains

   !> From now on print lines, or do not.
   subroutine show_progress(asked)
      !> Whether lines are printed.
      logical, intent(in) :: asked

      !$omp atomic write
      wanted = asked
   end subroutine show_progress

   !> A loop of so many `steps` begins, by this `name`.
   subroutine begin_progress(name, steps)
      character(len=*), intent(in) :: name
      integer(i8), intent(in) :: steps
      integer(i8) :: now

      now = milliseconds()
      !$omp critical (progress_loops)
      innermost = min(innermost + 1, deepest)
      loops(innermost) = loop_type(name, max(1_i8, steps), begun=now, next_line=now + first_ms)
      !$omp end critical (progress_loops)
   end subroutine begin_progress

   !> So many more `steps` are done.
   subroutine advance_progress(steps)
      integer(i8), intent(in) :: steps
      integer(i8) :: done, now, due
      logical :: prints
      integer :: k

      !$omp atomic read
      k = innermost
      !$omp atomic capture
      loops(k)%done = loops(k)%done + steps
      done = loops(k)%done
      !$omp end atomic
      !$omp atomic read
      prints = wanted
      if (.not. prints .or. done <= 0_i8) return
      now = milliseconds()
      !$omp atomic read
      due = loops(k)%next_line
      if (now < due) return
      !$omp critical (progress_loops)
      if (now >= loops(k)%next_line) call print_progress(loops(k), done, now)
      !$omp end critical (progress_loops)
   end subroutine advance_progress

   !> The innermost loop ends.
   subroutine end_progress()
      !$omp critical (progress_loops)
      innermost = max(innermost - 1, 0)
      !$omp end critical (progress_loops)
   end subroutine end_progress

   !> Print a line on a loop, and choose the time of the next one.
   subroutine print_progress(loop, done, now)
      type(loop_type), intent(inout) :: loop
      !> Steps, and the time in ms.
      integer(i8), intent(in) :: done, now
      integer(i8) :: left, next
      character(len=128) :: line

      left = (now - loop%begun)*max(0_i8, loop%steps - done)/done/1000_i8
      loop%lines = loop%lines + 1
      next = now + merge(interval_ms, 2_i8*interval_ms, loop%lines < many)
      !$omp atomic write
      loop%next_line = next
      write (line, '(a, ": ", i0, " %, about ", i0, " s left")') trim(loop%name), &
         & 100_i8*done/loop%steps, left
      call print_line(error_stream, trim(line))
   end subroutine print_progress

   !> Of a clock that only counts forwards.
   integer(i8) function milliseconds()
      integer(i8) :: ticks, per_second

      call system_clock(ticks, per_second)
      milliseconds = ticks/max(1_i8, per_second/1000_i8)
   end function milliseconds
end module progress
