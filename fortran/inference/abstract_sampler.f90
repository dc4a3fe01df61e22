!> What a sampler is: it makes one chain of a target from one random stream.
module abstract_sampler
   use interruption, only: stop_requested
   use kinds, only: wp
   use random, only: random_stream_type
   use sampling_target, only: outside, target_type
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
      integer, parameter :: most_tries = 20000
      real(wp), allocatable :: x(:, :), values(:)
      integer :: tried, i

      found = 0
      tried = 0
      do while (found < size(density) .and. tried < most_tries*size(density) .and. .not. stop_requested())
         allocate (x(target%dimension, size(density) - found), values(size(density) - found))
         do i = 1, size(values)
            call target%draw_start(stream, x(:, i))
         end do
         call target%evaluate(x, values)
         do i = 1, size(values)
            if (.not. values(i) > outside) cycle
            found = found + 1
            points(:, found) = x(:, i)
            density(found) = values(i)
         end do
         tried = tried + size(values)
         deallocate (x, values)
      end do
   end subroutine draw_starts
end module abstract_sampler
