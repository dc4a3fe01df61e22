!> A sampler for long ridges that bounds truncate.
!>
!> Runs are independent of each other. In the burn-in an ensemble of points finds the posterior
!> (`ensemble_evolution`). A normal mixture is fitted to the points that the ensemble visited, in
!> coordinates in which the ridge is straight, and improved by importance sampling.
!>
!> Where the mixture fits well, its draws are the proposals of the chain (`independent_draws`).
!> Elsewhere, and where runs disagree, Markov chains with a fixed kernel follow. A step is either an
!> independent draw of the mixture or a move along the difference of two points of the burn-in.
module ensemble_sampler
   use abstract_sampler, only: chain_type, sampler_type, target_type
   use ensemble_evolution, only: evolve_population, many_dimensions, population_type
   use independent_draws, only: draw_independently
   use student_mixture, only: draw_mixture, log_mixture
   use moves, only: is_accepted, mixture_move_type, new_points, points_type
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use random, only: random_stream_type
   implicit none
   private
   public :: ensemble_sampler_type, most_efforts

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
      type(chain_type), intent(inout) :: chain
      !> The short burn-in is divided by this number. Fewer proposals do not show the tail of their
      !> weights.
      integer, parameter :: short_divisor = 3, least_proposals = 5000
      integer :: sweeps
      !> Whether there is a chain, and whether the points are new. The mixture of earlier points is
      !> used again.
      logical :: is_made, is_new

      ! In many dimensions the first burn-in was a whole one.
      if (effort == whole_effort .and. target%dimension >= many_dimensions) then
         if (self%mixture%fits_badly()) return
      end if
      is_new = .false.
      if (effort == whole_effort .or. .not. allocated(self%population%log_density)) then
         sweeps = self%burn_in
         if (effort < whole_effort .and. target%dimension < many_dimensions) then
            sweeps = sweeps/short_divisor
         end if
         call evolve_population(target, int(sweeps, i8)*target%dimension, stream, self%population)
         is_new = .true.
      else
         call advance_progress(int(self%burn_in, i8))
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

   !> Make Markov chains with a fixed kernel, side by side, so that a call evaluates all of them.
   !> The chains' samples follow one another.
   !>
   !> A step walks for some steps by a cheap density, and is then accepted by the ratio of the exact
   !> density to the cheap one (surrogate transition; Liu, Monte Carlo Strategies in Scientific
   !> Computing, 2001, section 9.4.3).
   subroutine walk_from_population(self, target, stream, chain)
      class(ensemble_sampler_type), intent(inout) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      type(chain_type), intent(inout) :: chain
      integer, parameter :: most_walkers = 20, cheap_steps = 10
      type(points_type) :: walkers, proposed
      class(target_type), allocatable :: cheap
      real(wp), allocatable :: exact(:)
      real(wp) :: mixture_share
      integer :: i, k, m, n, step, steps, sample

      if (allocated(chain%estimate)) deallocate (chain%estimate)
      allocate (cheap, source=target)
      if (self%population%is_coarse) call cheap%coarsen()
      ! Where the mixture fits badly, there are more steps, and more of them along differences.
      mixture_share = 0.0_wp
      associate (quality => self%mixture%quality)
         if (quality > 0.0_wp) mixture_share = min(0.6_wp, max(0.2_wp, quality))
         steps = 1 + nint(0.8_wp*target%dimension*max(0.0_wp, 0.7_wp - quality))
      end associate
      m = min(most_walkers, size(chain%log_density))
      n = (size(chain%log_density) + m - 1)/m
      walkers = new_points(target%dimension, m)
      call self%population%start_walkers(stream, walkers)
      proposed = walkers
      allocate (exact(m))
      call target%evaluate_working(walkers%w, exact)
      call cheap%evaluate_working(walkers%w, walkers%log_density)
      chain%acceptance = 0.0_wp
      ! A tenth of the samples is left out.
      do sample = 1 - n/10, n
         do step = 1, steps
            proposed = walkers
            do i = 1, cheap_steps
               if (stop_requested()) return
               call walk(self, cheap, stream, mixture_share, proposed)
            end do
            call accept_exact()
         end do
         if (sample > 0) call advance_progress(int(m, i8))
         do k = 1, m
            i = (k - 1)*n + sample
            if (sample < 1 .or. i > size(chain%log_density)) cycle
            chain%draws(:, i) = walkers%w(:, k)
            chain%log_density(i) = exact(k)
         end do
      end do
      chain%acceptance = chain%acceptance/(m*steps*(n + n/10))

   contains

      !> Accept the points to which the walkers came by the cheap density.
      subroutine accept_exact()
         real(wp) :: exact_there(m)

         call target%evaluate_working(proposed%w, exact_there)
         do k = 1, m
            if (.not. is_accepted(stream, exact_there(k) - proposed%log_density(k), &
               & exact(k) - walkers%log_density(k), 1.0_wp)) then
               cycle
            end if
            call walkers%set(k, proposed, k)
            exact(k) = exact_there(k)
            chain%acceptance = chain%acceptance + 1.0_wp
         end do
      end subroutine accept_exact
   end subroutine walk_from_population

   !> Move all walkers, in place: to independent draws of the mixture, or along differences of
   !> points of the burn-in, which reach tails that the mixture misses.
   subroutine walk(self, target, stream, mixture_share, walkers)
      class(ensemble_sampler_type), intent(in) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> Probability of draws of the mixture.
      real(wp), intent(in) :: mixture_share
      type(points_type), intent(inout) :: walkers
      type(points_type) :: proposed
      real(wp) :: v, log_ratio
      integer :: k

      proposed = walkers
      call stream%uniform(v)
      associate (mixture => self%mixture%mixture, whitening => self%population%whitening)
         do k = 1, size(walkers%log_density)
            if (v < mixture_share) then
               call draw_mixture(mixture, stream, proposed%u(:, k))
            else
               call self%population%propose(stream, walkers%u(:, k), proposed%u(:, k))
            end if
            call whitening%from_white(proposed%u(:, k), proposed%w(:, k))
         end do
         call target%evaluate_working(proposed%w, proposed%log_density)
         do k = 1, size(walkers%log_density)
            log_ratio = 0.0_wp
            if (v < mixture_share) then
               log_ratio = log_mixture(mixture, proposed%u(:, k)) &
                  & - log_mixture(mixture, walkers%u(:, k))
            end if
            if (is_accepted(stream, proposed%log_density(k), walkers%log_density(k) + log_ratio, &
               & 1.0_wp)) then
               call walkers%set(k, proposed, k)
            end if
         end do
      end associate
   end subroutine walk
end module ensemble_sampler
