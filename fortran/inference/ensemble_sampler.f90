!> A sampler for long ridges that bounds truncate.
!>
!> Chains are independent of each other. In the burn-in an ensemble of points finds the posterior
!> (`ensemble_evolution`). A normal mixture is fitted to the points that the ensemble visited, in
!> coordinates in which the ridge is straight, and improved by importance sampling.
!>
!> Then follows a plain Markov chain with a fixed kernel. A step is either an independent draw of
!> the mixture, repeated until it is in the support, or a move along the difference of two points of
!> the burn-in. One sample takes two steps, or more where the mixture fits badly.
module ensemble_sampler
   use abstract_sampler, only: chain_type, target_type
   use ensemble_evolution, only: evolve_population, many_dimensions, population_type
   use gaussian_mixture, only: log_mixture
   use moves, only: is_accepted, mixture_move_type, new_points, points_type
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use random, only: random_stream_type
   implicit none
   private
   public :: run_ensemble

   !> Kernel of the chain, which is fixed after the burn-in, and the state of the chain.
   type :: kernel_type
      !> Points of the burn-in, and the move along their differences.
      type(population_type) :: population
      type(mixture_move_type) :: mixture
      !> Share of the steps that are draws of the mixture, and number of steps for a sample.
      real(wp) :: mixture_share = 0.0_wp
      integer :: steps = 1
      !> The present point, of number 1.
      type(points_type) :: state
      !> Number of draws of the mixture, and of the accepted ones.
      integer :: drawn = 0, accepted = 0
   end type kernel_type

contains

   !> Run one chain, in working coordinates.
   subroutine run_ensemble(burn_in, target, stream, chain)
      !> Number of sweeps before the first sample.
      integer, intent(in) :: burn_in
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> Its acceptance is the share of accepted draws of the mixture.
      type(chain_type), intent(inout) :: chain
      !> The short burn-in is divided by this number; and the effective share of the draws of a
      !> mixture that fits well.
      integer, parameter :: short_divisor = 3
      real(wp), parameter :: good_quality = 0.5_wp
      type(kernel_type) :: kernel
      integer :: sweeps, i

      ! A short burn-in is enough for most posteriors of few parameters. The whole one follows if
      ! its mixture fits badly.
      sweeps = burn_in
      if (target%dimension < many_dimensions) sweeps = burn_in/short_divisor
      do
         call evolve_population(target, int(sweeps, i8)*target%dimension, stream, kernel%population)
         chain%started = size(kernel%population%log_density) > 0
         if (.not. chain%started .or. stop_requested()) return
         call kernel%mixture%setup(target, kernel%population, kernel%population%whitening, &
            & size(chain%log_density), stream)
         if (stop_requested()) return
         if (kernel%mixture%quality >= good_quality .or. sweeps == burn_in) exit
         sweeps = burn_in
      end do
      ! Steps along differences reach tails that the mixture misses. Where it fits badly, more of
      ! the steps are of this kind.
      associate (quality => kernel%mixture%quality)
         if (quality > 0.0_wp) kernel%mixture_share = min(0.6_wp, max(0.2_wp, quality))
         kernel%steps = 2 + nint(2.0_wp*target%dimension*max(0.0_wp, 0.7_wp - quality))
      end associate
      associate (state => kernel%state, population => kernel%population)
         state = new_points(target%dimension, 1)
         call stream%pick(size(population%log_density), i)
         call state%set(1, population, i)
         call population%whitening%from_white(state%u(:, 1), state%w(:, 1))
         call target%evaluate_working(state%w, state%log_density)
         do i = 1, size(chain%log_density)
            if (stop_requested()) return
            call advance_progress(1_i8)
            call walk(kernel, target, stream)
            chain%draws(:, i) = state%w(:, 1)
            chain%log_density(i) = state%log_density(1)
         end do
      end associate
      call target%from_working(chain%draws, chain%log_density)
      chain%acceptance = real(kernel%accepted, wp)/max(1, kernel%drawn)
   end subroutine run_ensemble

   !> Make the steps of one sample. log_q is the logarithm of the mixture's density.
   subroutine walk(kernel, target, stream)
      type(kernel_type), intent(inout) :: kernel
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      type(points_type) :: proposed
      real(wp) :: log_q, proposed_log_q, v
      integer :: step, a, b

      associate (state => kernel%state, mixture => kernel%mixture, population => kernel%population)
         proposed = state
         log_q = log_mixture(mixture%mixture, state%u(:, 1))
         do step = 1, kernel%steps
            call stream%uniform(v)
            if (v < kernel%mixture_share) then
               kernel%drawn = kernel%drawn + 1
               call mixture%propose(target, stream)
               if (mixture%next == 0) cycle
               call proposed%set(1, mixture%pool, mixture%next)
               proposed_log_q = log_mixture(mixture%mixture, proposed%u(:, 1))
               if (.not. is_accepted(stream, proposed%log_density(1) - proposed_log_q, &
                  & state%log_density(1) - log_q, 1.0_wp)) then
                  cycle
               end if
               kernel%accepted = kernel%accepted + 1
            else
               ! Along the difference of two points of the burn-in.
               call stream%pick(size(population%u, 2), a)
               call stream%pick(size(population%u, 2), b)
               call population%move%propose(stream, population%u(:, a) - population%u(:, b), &
                  & state%u(:, 1), proposed%u(:, 1))
               call population%whitening%from_white(proposed%u(:, 1), proposed%w(:, 1))
               call target%evaluate_working(proposed%w, proposed%log_density)
               if (.not. is_accepted(stream, proposed%log_density(1), state%log_density(1), &
                  & 1.0_wp)) then
                  cycle
               end if
               proposed_log_q = log_mixture(mixture%mixture, proposed%u(:, 1))
            end if
            state = proposed
            log_q = proposed_log_q
         end do
      end associate
   end subroutine walk
end module ensemble_sampler
