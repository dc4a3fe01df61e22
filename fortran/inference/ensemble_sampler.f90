!> A sampler made for long ridges cut by bounds.
!>
!> Each chain is on its own. An ensemble of points first finds the posterior (`ensemble_evolution`).
!> A normal mixture is fitted to what it has visited, in the coordinates in which that is straight,
!> and improved by importance sampling.
!>
!> What follows is a plain Markov chain with a fixed kernel: independent draws from the mixture,
!> redrawn until they are in the support, and steps along the difference of two points of the
!> burn-in. One sample is two steps, or more where the mixture fits badly.
module ensemble_sampler
   use abstract_sampler, only: outside, sampler_type, target_type
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
   public :: ensemble_sampler_type

   !> What is fixed after the burn-in.
   type :: kernel_type
      type(whitening_type) :: whitening
      !> Of steps along differences, 1 in coordinates in which the density is normal.
      real(wp) :: step_scale = 1.0_wp
      type(mixture_type) :: mixture
      !> Points of the burn-in in whitened coordinates, (dimension, point).
      real(wp), allocatable :: archive(:, :)
      !> Of the steps that are draws of the mixture, and steps for a sample.
      real(wp) :: share = 0.0_wp
      integer :: steps = 1
   end type kernel_type

   !> Draws of the mixture in the support that no step has used yet: they do not depend on where the
   !> chain is.
   type :: pool_type
      !> Working and whitened coordinates, (dimension, point), and the logarithms of the density.
      real(wp), allocatable :: w(:, :), u(:, :), log_density(:)
      integer :: left = 0
   end type pool_type

   type, extends(sampler_type) :: ensemble_sampler_type
   contains
      procedure :: run
   end type ensemble_sampler_type

contains

   !> One chain, in working coordinates w.
   subroutine run(self, target, stream, draws, log_density, acceptance, started)
      class(ensemble_sampler_type), intent(in) :: self
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
      call evolve_population(target, int(self%burn_in, i8)*target%dimension, stream, &
         & kernel%whitening, kernel%step_scale, kernel%archive, started)
      if (.not. started .or. stop_requested()) return
      call fit_proposal(target, kernel%whitening, kernel%archive, size(log_density), stream, &
         & kernel%mixture, quality)
      if (stop_requested()) return
      ! Differences lead along tails that the mixture leaves out; where it fits badly, more of the
      ! steps are such.
      if (quality > 0.0_wp) kernel%share = min(0.6_wp, max(0.2_wp, quality))
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
   end subroutine run

   !> Some steps of the chain, from u in place.
   subroutine walk(target, kernel, pool, stream, u, w, density, drawn, accepted)
      class(target_type), intent(in) :: target
      type(kernel_type), intent(in) :: kernel
      type(pool_type), intent(inout) :: pool
      type(random_stream_type), intent(inout) :: stream
      !> Whitened coordinates, (dimension); working ones, (dimension, 1), and the logarithm of their
      !> density, (1).
      real(wp), intent(inout) :: u(:), w(:, :), density(:)
      !> Draws of the mixture, and how many were accepted.
      integer, intent(out) :: drawn, accepted
      real(wp) :: tried(target%dimension), tried_w(target%dimension, 1), of_tried(1), own, other, v
      integer :: step, a, b

      own = log_mixture(kernel%mixture, u)
      drawn = 0
      accepted = 0
      do step = 1, kernel%steps
         call stream%uniform(v)
         if (v < kernel%share) then
            drawn = drawn + 1
            if (pool%left == 0) call fill(target, kernel%whitening, kernel%mixture, stream, pool)
            if (pool%left == 0) cycle
            tried = pool%u(:, pool%left)
            pool%left = pool%left - 1
            tried_w(:, 1) = pool%w(:, pool%left + 1)
            of_tried = pool%log_density(pool%left + 1)
            other = log_mixture(kernel%mixture, tried)
            if (.not. is_accepted(stream, of_tried(1) - other, density(1) - own, 1.0_wp)) cycle
            accepted = accepted + 1
         else
            ! Along the difference of two points of the burn-in.
            call stream%pick(size(kernel%archive, 2), a)
            call stream%pick(size(kernel%archive, 2), b)
            call add_difference(stream, kernel%archive(:, a) - kernel%archive(:, b), &
               & kernel%step_scale, u, tried)
            call kernel%whitening%from_white(tried, tried_w(:, 1))
            call target%evaluate_working(tried_w, of_tried)
            if (.not. is_accepted(stream, of_tried(1), density(1), 1.0_wp)) cycle
            other = log_mixture(kernel%mixture, tried)
         end if
         u = tried
         w = tried_w
         density = of_tried
         own = other
      end do
   end subroutine walk

   !> Draw points of the mixture in the support; none are left if a thousand were all outside.
   subroutine fill(target, whitening, mixture, stream, pool)
      class(target_type), intent(in) :: target
      type(whitening_type), intent(in) :: whitening
      type(mixture_type), intent(in) :: mixture
      type(random_stream_type), intent(inout) :: stream
      type(pool_type), intent(inout) :: pool
      integer, parameter :: at_once = 50, most_attempts = 20
      real(wp) :: u(target%dimension, at_once), w(target%dimension, at_once), log_density(at_once)
      integer :: attempt, i

      do attempt = 1, most_attempts
         call draw_points(target, whitening, mixture, stream, u, w, log_density)
         associate (inside => pack([(i, i=1, at_once)], log_density > outside))
            pool%left = size(inside)
            if (pool%left == 0) cycle
            pool%u = u(:, inside)
            pool%w = w(:, inside)
            pool%log_density = log_density(inside)
         end associate
         return
      end do
   end subroutine fill

   !> Points of the mixture, evaluated.
   subroutine draw_points(target, whitening, mixture, stream, u, w, log_density)
      class(target_type), intent(in) :: target
      type(whitening_type), intent(in) :: whitening
      type(mixture_type), intent(in) :: mixture
      type(random_stream_type), intent(inout) :: stream
      !> Whitened and working coordinates, (dimension, point), and the logarithms of the density.
      real(wp), intent(out) :: u(:, :), w(:, :), log_density(:)
      integer :: i

      do i = 1, size(u, 2)
         call draw_mixture(mixture, stream, u(:, i))
         call whitening%from_white(u(:, i), w(:, i))
      end do
      call target%evaluate_working(w, log_density)
   end subroutine draw_points

   !> Fit the mixture to the archive, then improve it by importance sampling. Points that the
   !> mixture puts outside the support count as data of their own, so that it does not shy away from
   !> the bounds; the archive stays among the data, so that a tail that the mixture has lost comes
   !> back. `quality` estimates the effective share of its draws; 0 if they are of no use.
   subroutine fit_proposal(target, whitening, archive, samples, stream, mixture, quality)
      class(target_type), intent(in) :: target
      type(whitening_type), intent(in) :: whitening
      real(wp), intent(in), contiguous :: archive(:, :)
      !> That are wanted of the chain: for few a search as long as for many does not pay.
      integer, intent(in) :: samples
      type(random_stream_type), intent(inout) :: stream
      type(mixture_type), intent(out) :: mixture
      real(wp), intent(out) :: quality
      integer, parameter :: components = 16, least_draws = 600, most_draws = 3000, &
         & most_outside = 3000, least_rounds = 4, most_rounds = 12
      !> A smaller share of good draws is not worth the search: differences alone do better.
      real(wp), parameter :: archive_share = 0.3_wp, hopeless = 0.01_wp
      type(mixture_type) :: fitted
      real(wp), allocatable :: points(:, :), weights(:), log_weights(:), beyond(:, :), u(:, :), &
         & w(:, :), log_density(:)
      integer :: i, round, archived, inside, out, few, draws

      draws = min(most_draws, max(least_draws, samples/3))
      archived = size(archive, 2)
      allocate (points(target%dimension, archived + draws + most_outside), &
         & weights(archived + draws + most_outside))
      allocate (log_weights(draws), beyond(target%dimension, most_outside))
      allocate (u(target%dimension, draws), w(target%dimension, draws), log_density(draws))
      points(:, :archived) = archive
      weights = 1.0_wp
      call new_mixture(archive, components, fitted)
      call fit_mixture(archive, weights(:archived), 15, fitted)
      quality = 0.0_wp
      do round = 1, most_rounds
         if (stop_requested()) return
         call widen_mixture(fitted, mixture)
         inside = 0
         out = 0
         do while (inside < draws .and. out < 10*draws)
            few = min(draws - inside, 10*draws - out)
            call draw_points(target, whitening, mixture, stream, u(:, :few), w(:, :few), &
               & log_density(:few))
            do i = 1, few
               if (log_density(i) > outside) then
                  inside = inside + 1
                  points(:, archived + inside) = u(:, i)
                  log_weights(inside) = log_density(i) - log_mixture(mixture, u(:, i))
               else
                  out = out + 1
                  if (out <= most_outside) beyond(:, out) = u(:, i)
               end if
            end do
         end do
         quality = 0.0_wp
         if (inside == 0) return
         log_weights(:inside) = exp(log_weights(:inside) - maxval(log_weights(:inside)))
         quality = sum(log_weights(:inside))**2/sum(log_weights(:inside)**2)/inside
         ! Not before the mixture that is kept has shown that it is good: its draws may have found a
         ! tail.
         if (round == most_rounds .or. (round >= least_rounds .and. quality > 0.5_wp)) exit
         if (round >= least_rounds .and. quality*inside/(inside + out) < hopeless) then
            quality = 0.0_wp
            return
         end if
         ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep one point from
         ! taking over.
         log_weights(:inside) = min(log_weights(:inside), &
            & sum(log_weights(:inside))/sqrt(real(inside, wp)))
         weights(:archived) = archive_share*inside/archived
         weights(archived + 1:archived + inside) = (1.0_wp - archive_share)*inside &
            & /sum(log_weights(:inside))*log_weights(:inside)
         few = min(out, most_outside)
         i = archived + inside
         if (few > 0) then
            points(:, i + 1:i + few) = beyond(:, :few)
            weights(i + 1:i + few) = real(out, wp)/few
         end if
         call fit_mixture(points(:, :i + few), weights(:i + few), 6, fitted)
      end do
   end subroutine fit_proposal
end module ensemble_sampler
