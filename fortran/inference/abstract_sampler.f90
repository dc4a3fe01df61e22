!> Interfaces of samplers and targets. A sampler makes one chain of a target from one random stream.
!> A target is a probability density: it evaluates its logarithm at many points in one call.
module abstract_sampler
   use running_command, only: stop_requested
   use kinds, only: wp
   use random, only: random_stream_type
   implicit none
   private
   public :: sampler_type, chain_type, estimate_type, draw_starts, target_type, outside

   !> Logarithm of a density outside its support.
   real(wp), parameter :: outside = -huge(1.0_wp)

   type, abstract :: target_type
      !> Number of parameters.
      integer :: dimension = 0
   contains
      !> Draw a start: a point that is often in the support. Starts are widely spread.
      procedure(draw_start_interface), deferred :: draw_start
      !> Logarithm of the density of the parameters, up to a constant.
      procedure(evaluate_interface), deferred :: evaluate
      !> Working coordinates, in which the density is smoother: the density there, and the maps to
      !> and from them. By default they are the parameters themselves.
      procedure :: evaluate_working, to_working, from_working, coarsen
   end type target_type

   abstract interface
      subroutine draw_start_interface(self, stream, x)
         import
         class(target_type), intent(in) :: self
         type(random_stream_type), intent(inout) :: stream
         !> (dimension).
         real(wp), intent(out) :: x(:)
      end subroutine draw_start_interface
      !> Several threads call it at the same time.
      pure subroutine evaluate_interface(self, points, log_density)
         import
         class(target_type), intent(in) :: self
         !> (dimension, point).
         real(wp), intent(in) :: points(:, :)
         !> (point); the value `outside` where a point is not in the support.
         real(wp), intent(out) :: log_density(:)
      end subroutine evaluate_interface
   end interface

   !> Estimates from weighted draws of a density in the working coordinates.
   type :: estimate_type
      !> Logarithm of the integral of the density, and its standard error.
      real(wp) :: log_integral = 0.0_wp, log_integral_error = 0.0_wp
      !> Shape k of a Pareto distribution: the greatest of that of the weights and, for each
      !> coordinate, that of the weights times its squared deviation from the mean.
      real(wp) :: pareto_k = 0.0_wp
      !> Whether the weights can be trusted.
      logical :: is_reliable = .false.
      !> Mean and sd of each coordinate, and their standard errors, (dimension).
      real(wp), allocatable :: mean(:), sd(:), mean_error(:), sd_error(:)
   end type estimate_type

   !> A chain, of which the sampler fills the arrays.
   type :: chain_type
      !> draws(parameter, sample) and their log densities, (sample).
      real(wp), pointer, contiguous :: draws(:, :) => null(), log_density(:) => null()
      !> Share of accepted proposals.
      real(wp) :: acceptance = 0.0_wp
      !> Whether a start with a finite density was found. Without one there is no chain.
      logical :: started = .false.
      !> Allocated if all proposals were independent draws of a fixed density.
      type(estimate_type), allocatable :: estimate
   end type chain_type

   type, abstract :: sampler_type
      character(len=8) :: name = ''
      !> Number of sweeps before the first retained sample. A sweep evaluates the density once for
      !> each parameter.
      integer :: burn_in = 0
      !> Number of efforts, see `run`. Most runs: if there are more chains and their number is a
      !> multiple of it, each run makes several chains, one after the other.
      integer :: efforts = 1, most_runs = huge(1)
   contains
      !> Run one chain. Several threads call it at the same time, each with its own sampler. It may
      !> return early once `stop_requested` is true.
      procedure(run_interface), deferred :: run
   end type sampler_type

   abstract interface
      subroutine run_interface(self, effort, target, stream, chain)
         import
         class(sampler_type), intent(inout) :: self
         !> The first effort is 1. The next one, which takes more time, follows if the chain has
         !> no estimate or those of all runs disagree. The chain of the last effort has none.
         integer, intent(in) :: effort
         class(target_type), intent(in) :: target
         type(random_stream_type), intent(inout) :: stream
         type(chain_type), intent(inout) :: chain
      end subroutine run_interface
   end interface

contains

   !> Logarithm of the density of working coordinates `w`, up to a constant. It includes the
   !> Jacobian |dx/dw|. It is recursive, because targets divide many points into blocks.
   pure recursive subroutine evaluate_working(self, w, log_density)
      class(target_type), intent(in) :: self
      !> (dimension, point).
      real(wp), intent(in), contiguous :: w(:, :)
      !> (point); the value `outside` where a point is not in the support.
      real(wp), intent(out) :: log_density(:)

      call self%evaluate(w, log_density)
   end subroutine evaluate_working

   !> Convert working coordinates and the logarithms of their density, in place, to parameters and
   !> the logarithms of theirs.
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

   !> Make the density cheaper if the target can. The tails become less accurate, which is good
   !> enough to find proposals.
   subroutine coarsen(self)
      class(target_type), intent(inout) :: self

      associate (unused => self)
      end associate
   end subroutine coarsen

   !> Draw points of the support from the target's starts, with their log densities. `n_found` is
   !> below the number asked for if too few tries are in the support.
   subroutine draw_starts(target, stream, points, density, n_found)
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> (parameter, point), (point).
      real(wp), intent(out) :: points(:, :), density(:)
      integer, intent(out) :: n_found
      !> Most tries: `tries_a_point` for each point that is found and for `extra_points` more.
      integer, parameter :: tries_a_point = 20000, extra_points = 100
      integer :: n_tried, i

      n_found = 0
      n_tried = 0
      do while (n_found < size(density) .and. n_tried < tries_a_point*(extra_points &
         & + n_found) .and. .not. stop_requested())
         n_tried = n_tried + size(density) - n_found
         do i = n_found + 1, size(density)
            call target%draw_start(stream, points(:, i))
         end do
         call target%evaluate(points(:, n_found + 1:), density(n_found + 1:))
         ! The points of the support move to the front.
         do i = n_found + 1, size(density)
            ! This leaves out NaN as well.
            if (.not. density(i) > outside) cycle
            n_found = n_found + 1
            points(:, n_found) = points(:, i)
            density(n_found) = density(i)
         end do
      end do
   end subroutine draw_starts

end module abstract_sampler
