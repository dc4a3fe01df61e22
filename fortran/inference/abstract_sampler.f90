!> What a sampler is: it makes one chain of a target from one random stream. And what it needs of a
!> target, a density: its logarithm at many points in one call.
module abstract_sampler
   use running_command, only: stop_requested
   use kinds, only: wp
   use random, only: random_stream_type
   implicit none
   private
   public :: sampler_type, draw_starts, target_type, outside

   !> The logarithm of a density out of its support.
   real(wp), parameter :: outside = -huge(1.0_wp)

   type, abstract :: target_type
      !> Number of parameters.
      integer :: dimension = 0
   contains
      !> A point that may be in the support, to begin with: widely spread, and in it often enough.
      procedure(draw_start_interface), deferred :: draw_start
      !> Logarithm of the density of the parameters, up to a constant.
      procedure(evaluate_interface), deferred :: evaluate
      !> The same of coordinates in which the density is smoother; by default these are the
      !> parameters themselves.
      procedure :: evaluate_working, to_working, from_working, coarsen
   end type target_type

   abstract interface
      subroutine draw_start_interface(self, stream, x)
         import :: random_stream_type, target_type, wp
         class(target_type), intent(in) :: self
         type(random_stream_type), intent(inout) :: stream
         !> (dimension).
         real(wp), intent(out) :: x(:)
      end subroutine draw_start_interface
      !> Threads call it at the same time.
      pure subroutine evaluate_interface(self, points, log_density)
         import :: target_type, wp
         class(target_type), intent(in) :: self
         !> (dimension, point).
         real(wp), intent(in) :: points(:, :)
         !> (point); `outside` the support.
         real(wp), intent(out) :: log_density(:)
      end subroutine evaluate_interface
   end interface

   type, abstract :: sampler_type
      !> Sweeps before the samples that are kept: as many evaluations of the density each as there
      !> are parameters.
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

   !> Logarithm of the density of working coordinates `w`, which has the volume |dx/dw| in it, up to
   !> a constant.
   pure recursive subroutine evaluate_working(self, w, log_density)
      class(target_type), intent(in) :: self
      !> (dimension, point).
      real(wp), intent(in), contiguous :: w(:, :)
      !> (point); `outside` the support.
      real(wp), intent(out) :: log_density(:)

      call self%evaluate(w, log_density)
   end subroutine evaluate_working

   !> The parameters of points of the support and the logarithms of their density, in place of
   !> working coordinates and that of these.
   pure subroutine from_working(self, points, log_density)
      class(target_type), intent(in) :: self
      !> (dimension, point), (point).
      real(wp), intent(inout) :: points(:, :), log_density(:)

      associate (unused => self)
      end associate
   end subroutine from_working

   !> Working coordinates `w` of the parameters `x` of points of the support.
   pure subroutine to_working(self, x, w)
      class(target_type), intent(in) :: self
      !> (dimension, point).
      real(wp), intent(in) :: x(:, :)
      real(wp), intent(out) :: w(:, :)

      w = x(:self%dimension, :)
   end subroutine to_working

   !> Be cheaper, if that can be at all, where that costs accuracy in tails: to find proposals there
   !> is good enough.
   subroutine coarsen(self)
      class(target_type), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine coarsen

   !> Points of the support from the target's starts, with their log densities; `found` may be fewer
   !> than asked for.
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
      do while (found < size(density) .and. tried < most_tries*size(density) &
         & .and. .not. stop_requested())
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
