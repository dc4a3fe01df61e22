!> How many threads work.
module parallelism
   use files, only: process_number
   use omp_lib, only: omp_get_num_procs
   implicit none
   private
   public :: thread_count

   !> The process in which threads were first asked for.
   integer :: first_process = 0

contains

   !> As many as are wanted, 0: one for each processor that this process may use; at most four for each, since more gain nothing. One in a
   !> process that was forked from one with threads, which it has not inherited though OpenMP waits for them.
   integer function thread_count(wanted)
      integer, intent(in) :: wanted

      thread_count = min(wanted, 4*omp_get_num_procs())
      if (wanted <= 0) thread_count = omp_get_num_procs()
      !$omp critical (parallelism)
      if (first_process == 0) first_process = process_number()
      if (first_process /= process_number()) thread_count = 1
      !$omp end critical (parallelism)
   end function thread_count
end module parallelism
