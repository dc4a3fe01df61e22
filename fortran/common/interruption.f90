!> Ctrl-C while the library works. A caller's handler of SIGINT, such as Python's, only takes note until compiled code has returned; so
!> while somebody listens the signal is noted here, too, and then given to that handler. Long loops ask, leave, and their results are
!> not used. Where SIGINT has no handler, or is that of a running command, nothing is changed.
module interruption
   use, intrinsic :: iso_c_binding, only: c_bool
   implicit none
   private
   public :: listen, stop_listening, stop_requested

   interface
      !> From now on; threads may do so at the same time.
      subroutine listen() bind(c, name='bayesindent_listen')
      end subroutine listen
      !> As often as `listen`; with the last what was noted is forgotten.
      subroutine stop_listening() bind(c, name='bayesindent_stop_listening')
      end subroutine stop_listening
      !> Whether a signal came; it stays so while somebody listens.
      logical(c_bool) function stop_requested() bind(c, name='bayesindent_stop_requested')
         import :: c_bool
      end function stop_requested
   end interface
end module interruption
