!> A sampler for long ridges that bounds truncate.
!>
!> Runs are independent of each other. In the burn-in an ensemble of points finds the posterior
!> (`ensemble_evolution`). A normal mixture is fitted to the points that the ensemble visited, in
!> coordinates in which the ridge is straight, and improved by importance sampling.
!>
!> Where the mixture fits well, its draws are the proposals of the chain (`independent_draws`).
!> Elsewhere, and where runs disagree, a plain Markov chain with a fixed kernel follows. A step is
!> either an independent draw of the mixture, repeated until it is in the support, or a move along
!> the difference of two points of the burn-in. One sample takes two steps, or more where the
!> mixture fits badly.
module ensemble_sampler
   use abstract_sampler, only: chain_type, sampler_type, target_type
   use ensemble_evolution, only: evolve_population, many_dimensions, &
      & population_type
   use independent_draws, only: draw_independently
   use student_mixture, only: log_mixture
   use moves, only: is_accepted, mixture_move_type, new_points, points_type
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use random, only: random_stream_type
   implicit none
   private
   public :: ensemble_sampler_type, most_efforts

   !> State of a Markov chain, whose kernel is fixed.
   type :: walk_type
      !> Share of the steps that are draws of the mixture, and number of steps for a sample.
      real(wp) :: mixture_share = 0.0_wp
      integer :: steps = 1
      !> The present point, of number 1.
      type(points_type) :: state
      !> Number of draws of the mixture, and of the accepted ones.
      integer :: drawn = 0, accepted = 0
   end type walk_type

   type, extends(sampler_type) :: ensemble_sampler_type
      !> Points of the burn-in, and the move along their differences. A sampler that has them begins
      !> with them.
      type(population_type) :: population
      type(mixture_move_type) :: mixture
   contains
      procedure :: run => run_ensemble
   end type ensemble_sampler_type

   !> The efforts: a short burn-in or the points of another run, and independent draws; the whole
   !> burn-in and independent draws; a Markov chain.
   integer, parameter :: whole_effort = 2, most_efforts = 3

contains

   !> Run one chain, in working coordinates.
   subroutine run_ensemble(self, effort, target, stream, chain)
      class(ensemble_sampler_type), intent(inout) :: self
      integer, intent(in) :: effort
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> Its acceptance is the share of accepted draws of the mixture.
      type(chain_type), intent(inout) :: chain
      !> The short burn-in is divided by this number. Fewer proposals do not show the tail of their
      !> weights.
      integer, parameter :: short_divisor = 3, least_proposals = 5000
      integer :: sweeps
      !> Whether there is a chain, and whether the points are new. The mixture of earlier points is
      !> used again.
      logical :: is_made, is_new

      is_new = .false.
      if (effort == whole_effort .or. .not. allocated(self%population%log_density)) then
         sweeps = self%burn_in
         if (effort < whole_effort .and. target%dimension < many_dimensions) then
            sweeps = sweeps/short_divisor
         end if
         call evolve_population(target, int(sweeps, i8)*target%dimension, stream, self%population)
         is_new = .true.
      end if
      chain%started = size(self%population%log_density) > 0
      if (.not. chain%started .or. stop_requested()) return
      is_made = .false.
      if (effort < most_efforts) then
         if (is_new) call self%mixture%setup(self%population, self%population%whitening)
         ! A sampler of one effort looks for any draws near the posterior.
         call draw_independently(self%mixture, target, stream, merge(1, least_proposals, &
            & self%efforts == 1), chain, is_made)
      end if
      if (effort == self%efforts .and. .not. is_made) then
         call walk_from_population(self, target, stream, chain)
      end if
      if (.not. stop_requested()) call target%from_working(chain%draws, chain%log_density)
   end subroutine run_ensemble

   !> Make a Markov chain.
   subroutine walk_from_population(self, target, stream, chain)
      class(ensemble_sampler_type), intent(inout) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      type(chain_type), intent(inout) :: chain
      type(walk_type) :: kernel
      integer :: i

      if (allocated(chain%estimate)) deallocate (chain%estimate)
      ! Steps along differences reach tails that the mixture misses. Where it fits badly, more of
      ! the steps are of this kind.
      associate (quality => self%mixture%quality)
         if (quality > 0.0_wp) kernel%mixture_share = min(0.6_wp, max(0.2_wp, quality))
         kernel%steps = 2 + nint(2.0_wp*target%dimension*max(0.0_wp, 0.7_wp - quality))
      end associate
      associate (state => kernel%state, population => self%population)
         state = new_points(target%dimension, 1)
         call stream%pick(size(population%log_density), i)
         call state%set(1, population, i)
         call population%whitening%from_white(state%u(:, 1), state%w(:, 1))
         call target%evaluate_working(state%w, state%log_density)
         do i = 1, size(chain%log_density)
            if (stop_requested()) return
            call advance_progress(1_i8)
            call walk(self, kernel, target, stream)
            chain%draws(:, i) = state%w(:, 1)
            chain%log_density(i) = state%log_density(1)
         end do
      end associate
      chain%acceptance = real(kernel%accepted, wp)/max(1, kernel%drawn)
   end subroutine walk_from_population

   !> Make the steps of one sample. log_q is the logarithm of the mixture's density.
   subroutine walk(self, kernel, target, stream)
      class(ensemble_sampler_type), intent(inout) :: self
      type(walk_type), intent(inout) :: kernel
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      type(points_type) :: proposed
      real(wp) :: log_q, proposed_log_q, v
      integer :: step, a, b

      associate (state => kernel%state, mixture => self%mixture, population => self%population)
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
