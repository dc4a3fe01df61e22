!> What a sampler is: it makes one chain of a target from one random stream.
module abstract_sampler
   use interruption, only: stop_requested
   use kinds, only: wp
   use random, only: random_stream_type
   use sampling_target, only: target_type
   implicit none
   private
   public :: sampler_type, draw_starts

   type, abstract :: sampler_type
      !> Sweeps before the samples that are kept: as many evaluations of the density each as there are parameters.
      integer :: burn_in = 0
   contains
      procedure(run_interface), deferred :: run
   end type sampler_type

   abstract interface
      !> One chain; threads call it at the same time. It may end at any point once `stop_requested`.
      subroutine run_interface(self, target, stream, draws, log_density, acceptance, started)
         import :: random_stream_type, sampler_type, target_type, wp
         class(sampler_type), intent(in) :: self
         class(target_type), intent(in) :: target
         type(random_stream_type), intent(inout) :: stream
         !> draws(parameter, sample) and their log densities.
         real(wp), intent(out) :: draws(:, :), log_density(:)
         !> Share of accepted proposals.
         real(wp), intent(out) :: acceptance
         !> Whether a point of the support with a finite density was found; else nothing is done.
         logical, intent(out) :: started
      end subroutine run_interface
   end interface

contains

   !> Points of the support from the target's starts, with their log densities; `found` may be fewer than asked for.
   subroutine draw_starts(target, stream, points, density, found)
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> (parameter, point), (point).
      real(wp), intent(out) :: points(:, :), density(:)
      integer, intent(out) :: found
      real(wp) :: x(target%dimension)
      integer :: attempt
      logical :: admitted

      found = 0
      do attempt = 1, 20000*size(density)
         if (stop_requested()) exit
         call target%draw_start(stream, x)
         call target%evaluate(x, density(found + 1), admitted)
         if (.not. (admitted .and. density(found + 1) > -huge(1.0_wp))) cycle
         found = found + 1
         points(:, found) = x
         if (found == size(density)) exit
      end do
   end subroutine draw_starts
end module abstract_sampler
