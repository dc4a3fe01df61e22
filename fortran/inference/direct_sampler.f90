!> Independent draws of a target whose starts are distributed by its density, such as a prior
!> without knowledge.
module direct_sampler
   use abstract_sampler, only: draw_starts, sampler_type, target_type
   use kinds, only: i8, wp
   use random, only: random_stream_type
   use progress, only: advance_progress
   implicit none
   private
   public :: direct_sampler_type

   type, extends(sampler_type) :: direct_sampler_type
   contains
      procedure :: run
   end type direct_sampler_type

contains

   subroutine run(self, target, stream, draws, log_density, acceptance, started)
      class(direct_sampler_type), intent(in) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> (parameter, sample), (sample).
      real(wp), intent(out) :: draws(:, :), log_density(:)
      !> 1: every draw is accepted.
      real(wp), intent(out) :: acceptance
      !> Whether enough points of the support were found.
      logical, intent(out) :: started
      integer :: n_found

      call draw_starts(target, stream, draws, log_density, n_found)
      acceptance = 1.0_wp
      started = n_found == size(log_density)
      call advance_progress(int(self%burn_in + size(log_density), i8))
   end subroutine run
end module direct_sampler
