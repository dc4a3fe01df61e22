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
   use abstract_sampler, only: outside, target_type
   use ensemble_evolution, only: add_difference, evolve_population, is_accepted
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, &
      & widen_mixture
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use random, only: random_stream_type
   use ridge_coordinates, only: whitening_type
   implicit none
   private
   public :: run_ensemble

   !> Kernel of the chain, which is fixed after the burn-in.
   type :: kernel_type
      type(whitening_type) :: whitening
      !> Factor of the steps along differences; 1 suits coordinates in which the density is normal.
      real(wp) :: step_scale = 1.0_wp
      type(mixture_type) :: mixture
      !> Points of the burn-in in whitened coordinates, (dimension, point).
      real(wp), allocatable :: archive(:, :)
      !> Share of the steps that are draws of the mixture, and number of steps for a sample.
      real(wp) :: mixture_share = 0.0_wp
      integer :: steps = 1
   end type kernel_type

   !> Draws of the mixture in the support that no step has used yet. They do not depend on the state
   !> of the chain.
   type :: pool_type
      !> Working and whitened coordinates, (dimension, point), and the logarithms of the density.
      real(wp), allocatable :: w(:, :), u(:, :), log_density(:)
      integer :: left = 0
   end type pool_type

contains

   !> Run one chain, in working coordinates w.
   subroutine run_ensemble(burn_in, target, stream, draws, log_density, acceptance, started)
      !> Number of sweeps before the first sample.
      integer, intent(in) :: burn_in
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> (parameter, sample), (sample).
      real(wp), intent(out) :: draws(:, :), log_density(:)
      !> Share of accepted draws of the mixture.
      real(wp), intent(out) :: acceptance
      !> Whether a point of the support was found.
      logical, intent(out) :: started
      type(kernel_type) :: kernel
      type(pool_type) :: pool
      real(wp) :: u(target%dimension), w(target%dimension, 1), current(1), quality
      integer :: i, drawn, accepted, accepted_in_all, drawn_in_all

      acceptance = 0.0_wp
      call evolve_population(target, int(burn_in, i8)*target%dimension, stream, &
         & kernel%whitening, kernel%step_scale, kernel%archive, started)
      if (.not. started .or. stop_requested()) return
      call fit_proposal(target, size(log_density), stream, kernel, quality)
      if (stop_requested()) return
      ! Steps along differences reach tails that the mixture misses. Where it fits badly, more of
      ! the steps are of this kind.
      if (quality > 0.0_wp) kernel%mixture_share = min(0.6_wp, max(0.2_wp, quality))
      kernel%steps = 2 + nint(2.0_wp*target%dimension*max(0.0_wp, 0.7_wp - quality))
      call stream%pick(size(kernel%archive, 2), i)
      u = kernel%archive(:, i)
      call kernel%whitening%from_white(u, w(:, 1))
      call target%evaluate_working(w, current)
      accepted_in_all = 0
      drawn_in_all = 0
      do i = 1, size(log_density)
         if (stop_requested()) return
         call advance_progress(1_i8)
         call walk(target, kernel, pool, stream, u, w, current, drawn, accepted)
         drawn_in_all = drawn_in_all + drawn
         accepted_in_all = accepted_in_all + accepted
         draws(:, i) = w(:, 1)
         log_density(i) = current(1)
      end do
      call target%from_working(draws, log_density)
      acceptance = real(accepted_in_all, wp)/max(1, drawn_in_all)
   end subroutine run_ensemble

   !> Make the steps of one sample, in place. log_q is the logarithm of the mixture's density.
   subroutine walk(target, kernel, pool, stream, u, w, density, drawn, accepted)
      class(target_type), intent(in) :: target
      type(kernel_type), intent(in) :: kernel
      type(pool_type), intent(inout) :: pool
      type(random_stream_type), intent(inout) :: stream
      !> Whitened coordinates, (dimension); working coordinates, (dimension, 1); and the logarithm
      !> of their density, (1).
      real(wp), intent(inout) :: u(:), w(:, :), density(:)
      !> Number of draws of the mixture, and of the accepted ones.
      integer, intent(out) :: drawn, accepted
      real(wp) :: proposed(target%dimension), proposed_w(target%dimension, 1), &
         & proposed_density(1), log_q, proposed_log_q, v
      integer :: step, a, b

      log_q = log_mixture(kernel%mixture, u)
      drawn = 0
      accepted = 0
      do step = 1, kernel%steps
         call stream%uniform(v)
         if (v < kernel%mixture_share) then
            drawn = drawn + 1
            if (pool%left == 0) call fill_pool(target, kernel, stream, pool)
            if (pool%left == 0) cycle
            proposed = pool%u(:, pool%left)
            proposed_w(:, 1) = pool%w(:, pool%left)
            proposed_density = pool%log_density(pool%left)
            pool%left = pool%left - 1
            proposed_log_q = log_mixture(kernel%mixture, proposed)
            if (.not. is_accepted(stream, proposed_density(1) - proposed_log_q, &
               & density(1) - log_q, 1.0_wp)) then
               cycle
            end if
            accepted = accepted + 1
         else
            ! Along the difference of two points of the burn-in.
            call stream%pick(size(kernel%archive, 2), a)
            call stream%pick(size(kernel%archive, 2), b)
            call add_difference(stream, kernel%archive(:, a) - kernel%archive(:, b), &
               & kernel%step_scale, u, proposed)
            call kernel%whitening%from_white(proposed, proposed_w(:, 1))
            call target%evaluate_working(proposed_w, proposed_density)
            if (.not. is_accepted(stream, proposed_density(1), density(1), 1.0_wp)) cycle
            proposed_log_q = log_mixture(kernel%mixture, proposed)
         end if
         u = proposed
         w = proposed_w
         density = proposed_density
         log_q = proposed_log_q
      end do
   end subroutine walk

   !> Fill the pool with draws of the mixture in the support. It stays empty if all draws of all
   !> attempts are outside.
   subroutine fill_pool(target, kernel, stream, pool)
      class(target_type), intent(in) :: target
      type(kernel_type), intent(in) :: kernel
      type(random_stream_type), intent(inout) :: stream
      type(pool_type), intent(inout) :: pool
      integer, parameter :: at_once = 50, most_attempts = 20
      real(wp) :: u(target%dimension, at_once), w(target%dimension, at_once), log_density(at_once)
      integer :: attempt, i

      do attempt = 1, most_attempts
         call draw_points(target, kernel, stream, u, w, log_density)
         associate (inside => pack([(i, i=1, at_once)], log_density > outside))
            pool%left = size(inside)
            if (pool%left == 0) cycle
            pool%u = u(:, inside)
            pool%w = w(:, inside)
            pool%log_density = log_density(inside)
         end associate
         return
      end do
   end subroutine fill_pool

   !> Draw points of the mixture and evaluate the density there.
   subroutine draw_points(target, kernel, stream, u, w, log_density)
      class(target_type), intent(in) :: target
      type(kernel_type), intent(in) :: kernel
      type(random_stream_type), intent(inout) :: stream
      !> Whitened and working coordinates, (dimension, point), and the logarithms of the density.
      real(wp), intent(out) :: u(:, :), w(:, :), log_density(:)
      integer :: i

      do i = 1, size(u, 2)
         call draw_mixture(kernel%mixture, stream, u(:, i))
         call kernel%whitening%from_white(u(:, i), w(:, i))
      end do
      call target%evaluate_working(w, log_density)
   end subroutine draw_points

   !> Fit the mixture to the archive, then improve it by importance sampling. Draws outside the
   !> support are data as well, so that the mixture does not avoid the bounds. The archive stays
   !> among the data, so that a tail that the mixture lost comes back. `quality` estimates the
   !> effective share of the mixture's draws; it is 0 if they are useless.
   subroutine fit_proposal(target, samples, stream, kernel, quality)
      class(target_type), intent(in) :: target
      !> Number of samples of the chain. A long search is not worth its time for few of them.
      integer, intent(in) :: samples
      type(random_stream_type), intent(inout) :: stream
      !> The mixture is set; the whitening and the archive are given.
      type(kernel_type), intent(inout) :: kernel
      real(wp), intent(out) :: quality
      integer, parameter :: components = 16, least_draws = 600, most_draws = 3000, &
         & most_outside = 3000, least_rounds = 4, most_rounds = 12
      !> Weight of the archive among the data, and the effective share of draws below which the
      !> search ends: steps along differences alone do better then.
      real(wp), parameter :: archive_share = 0.3_wp, least_quality = 0.01_wp
      type(mixture_type) :: fitted
      real(wp), allocatable :: points(:, :), weights(:), log_weights(:), rejected(:, :), u(:, :), &
         & w(:, :), log_density(:)
      integer :: i, round, n_archived, n_inside, n_outside, n_batch, n_rejected, n_draws

      n_draws = min(most_draws, max(least_draws, samples/3))
      n_archived = size(kernel%archive, 2)
      allocate (weights(n_archived + n_draws + most_outside), source=1.0_wp)
      allocate (points(target%dimension, size(weights)), log_weights(n_draws), &
         & rejected(target%dimension, most_outside), u(target%dimension, n_draws), &
         & w(target%dimension, n_draws), log_density(n_draws))
      points(:, :n_archived) = kernel%archive
      call new_mixture(kernel%archive, components, fitted)
      call fit_mixture(kernel%archive, weights(:n_archived), 15, fitted)
      quality = 0.0_wp
      do round = 1, most_rounds
         if (stop_requested()) return
         call widen_mixture(fitted, kernel%mixture)
         n_inside = 0
         n_outside = 0
         do while (n_inside < n_draws .and. n_outside < 10*n_draws)
            n_batch = min(n_draws - n_inside, 10*n_draws - n_outside)
            call draw_points(target, kernel, stream, u(:, :n_batch), w(:, :n_batch), &
               & log_density(:n_batch))
            do i = 1, n_batch
               if (log_density(i) > outside) then
                  n_inside = n_inside + 1
                  points(:, n_archived + n_inside) = u(:, i)
                  log_weights(n_inside) = log_density(i) - log_mixture(kernel%mixture, u(:, i))
               else
                  n_outside = n_outside + 1
                  if (n_outside <= most_outside) rejected(:, n_outside) = u(:, i)
               end if
            end do
         end do
         quality = 0.0_wp
         if (n_inside == 0) return
         log_weights(:n_inside) = exp(log_weights(:n_inside) - maxval(log_weights(:n_inside)))
         quality = sum(log_weights(:n_inside))**2/sum(log_weights(:n_inside)**2)/n_inside
         ! Stop only after the returned mixture itself has shown that it is good: its draws may have
         ! found a tail.
         if (round == most_rounds .or. (round >= least_rounds .and. quality > 0.5_wp)) exit
         if (round >= least_rounds &
            & .and. quality*n_inside/(n_inside + n_outside) < least_quality) then
            quality = 0.0_wp
            return
         end if
         ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep one point from
         ! dominating.
         log_weights(:n_inside) = min(log_weights(:n_inside), &
            & sum(log_weights(:n_inside))/sqrt(real(n_inside, wp)))
         weights(:n_archived) = archive_share*n_inside/n_archived
         weights(n_archived + 1:n_archived + n_inside) = (1.0_wp - archive_share)*n_inside &
            & /sum(log_weights(:n_inside))*log_weights(:n_inside)
         n_rejected = min(n_outside, most_outside)
         i = n_archived + n_inside
         points(:, i + 1:i + n_rejected) = rejected(:, :n_rejected)
         weights(i + 1:i + n_rejected) = real(n_outside, wp)/max(1, n_rejected)
         i = i + n_rejected
         call fit_mixture(points(:, :i), weights(:i), 6, fitted)
      end do
   end subroutine fit_proposal
end module ensemble_sampler
