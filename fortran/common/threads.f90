!> How many threads work.
module threads
   use omp_lib, only: omp_get_num_procs
   implicit none
   private
   public :: thread_count

contains

   !> As many as are wanted; 0: one for each processor that this process may use.
   integer function thread_count(wanted)
      integer, intent(in) :: wanted

      thread_count = wanted
      if (wanted == 0) thread_count = omp_get_num_procs()
   end function thread_count
end module threads
