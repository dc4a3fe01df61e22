!> A sampler made for long ridges cut by bounds.
!>
!> Each chain is on its own. An ensemble of points first finds the posterior (`ensemble_evolution`). A normal mixture is fitted to what it
!> has visited, in the coordinates in which that is straight, and improved by importance sampling.
!>
!> What follows is a plain Markov chain with a fixed kernel: independent draws from the mixture, redrawn until they are in the support,
!> and steps along the difference of two points of the burn-in. One sample is two steps, or more where the mixture fits badly; or such steps
!> in a near density, as one proposal.
module ensemble_sampler
   use abstract_sampler, only: outside, sampler_type, target_type
   use ensemble_evolution, only: add_difference, evolve_population, is_accepted
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, widen_mixture
   use running_command, only: advance_progress, stop_requested
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
      !> The near density is no lower than the mixture times this, of which it is the logarithm: where it is far too low, chains would
      !> hardly leave.
      real(wp) :: floor = outside
   end type kernel_type

   !> Draws of the mixture in the support that no step has used yet: they do not depend on where the chain is.
   type :: pool_type
      !> Working and whitened coordinates, (dimension, point), and the logarithms of the density.
      real(wp), allocatable :: w(:, :), u(:, :), log_density(:)
      integer :: left = 0
      !> Of all draws that a chain tried how many it accepted.
      integer :: drawn = 0, accepted = 0
   end type pool_type

   !> Where a chain is.
   type :: state_type
      !> Whitened coordinates, (dimension); working ones, (dimension, 1).
      real(wp), allocatable :: u(:), w(:, :)
      !> Logarithms of the density and of the one that is near it, (1).
      real(wp) :: density(1), near(1)
   end type state_type

   !> Samples that are proposed in advance.
   integer, parameter :: most_ahead = 8
   !> Least part of the mixture in the near density.
   real(wp), parameter :: defence = 0.05_wp

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
      class(target_type), allocatable :: near
      type(kernel_type) :: kernel, own
      type(pool_type) :: pool, own_pool
      type(state_type) :: state
      real(wp) :: quality, log_volume
      integer :: i, ahead, done

      acceptance = 0.0_wp
      call evolve_population(target, int(self%burn_in, i8)*target%dimension, stream, kernel%whitening, &
         & kernel%step_scale, kernel%archive, near, started)
      if (.not. started .or. stop_requested()) return
      call fit_proposal(near, kernel%whitening, kernel%archive, size(log_density), stream, kernel%mixture, quality, log_volume)
      if (near%is_near .and. quality > 0.0_wp) then
         call correct(near, kernel, stream)
         call fit_proposal(near, kernel%whitening, kernel%archive, size(log_density), stream, kernel%mixture, quality, log_volume)
      end if
      ! Where the near one is wrong, it may have one draw that outweighs all others.
      if (near%is_near .and. .not. quality > 0.0_wp) call fit_proposal(target, kernel%whitening, kernel%archive, &
         & size(log_density), stream, kernel%mixture, quality, log_volume)
      if (stop_requested()) return
      ! Differences lead along tails that the mixture leaves out; where it fits badly, more of the steps are such.
      if (quality > 0.0_wp) kernel%share = min(0.6_wp, max(0.2_wp, quality))
      own = kernel
      own%steps = 2
      if (near%is_near .and. quality > 0.0_wp) kernel%floor = log(defence) + log_volume
      kernel%steps = 2 + nint(2.0_wp*target%dimension*max(0.0_wp, 0.7_wp - quality))
      call stream%pick(size(kernel%archive, 2), i)
      state%u = kernel%archive(:, i)
      allocate (state%w(target%dimension, 1))
      call kernel%whitening%from_white(state%u, state%w(:, 1))
      call target%evaluate_working(state%w, state%density)
      i = 0
      ahead = 1
      do while (i < size(log_density) .and. .not. stop_requested())
         if (.not. near%is_near) then
            call walk(target, kernel, pool, stream, state)
            draws(:, i + 1) = state%w(:, 1)
            log_density(i + 1) = state%density(1)
            done = 1
         else
            if (mod(i, most_ahead) == 0) then
               ! Of its own steps, so that it leaves tails where the near one is wrong.
               call walk(target, own, own_pool, stream, state)
               call near%evaluate_working(state%w, state%near)
               if (state%near(1) > outside) state%near = max(state%near, kernel%floor + log_mixture(kernel%mixture, state%u))
            end if
            done = min(ahead, most_ahead - mod(i, most_ahead), size(log_density) - i)
            call walk_ahead(target, near, kernel, pool, stream, state, draws(:, i + 1:i + done), log_density(i + 1:i + done), done)
            ahead = min(2*done, most_ahead)
         end if
         i = i + done
         call advance_progress(int(done, i8))
      end do
      if (stop_requested()) return
      call target%from_working(draws, log_density)
      acceptance = real(pool%accepted, wp)/max(1, pool%drawn)
   end subroutine run

   !> Samples, each of which is some steps of a chain of the near density, taken as a whole or not by how both densities changed (the
   !> surrogate transition method, Liu, Monte Carlo Strategies in Scientific Computing, Springer 2001, section 9.4.3). Almost all
   !> are taken, so that those to come are proposed in advance and evaluated at once; what follows one that is not taken is void.
   subroutine walk_ahead(target, near, kernel, pool, stream, state, draws, log_density, done)
      class(target_type), intent(in) :: target, near
      type(kernel_type), intent(in) :: kernel
      type(pool_type), intent(inout) :: pool
      type(random_stream_type), intent(inout) :: stream
      type(state_type), intent(inout) :: state
      !> Working coordinates, (dimension, sample), (sample).
      real(wp), intent(inout) :: draws(:, :), log_density(:)
      !> How many samples there are.
      integer, intent(out) :: done
      type(state_type) :: ahead(size(log_density))
      real(wp) :: w(target%dimension, size(log_density)), density(size(log_density))
      logical :: is_taken
      integer :: k

      do k = 1, size(ahead)
         ahead(k) = state
         if (k > 1) ahead(k) = ahead(k - 1)
         ahead(k)%density = ahead(k)%near
         call walk(near, kernel, pool, stream, ahead(k))
         ahead(k)%near = ahead(k)%density
         w(:, k) = ahead(k)%w(:, 1)
      end do
      call target%evaluate_working(w, density)
      do k = 1, size(ahead)
         done = k
         is_taken = is_accepted(stream, density(k) - ahead(k)%near(1), state%density(1) - state%near(1), 1.0_wp)
         if (is_taken) then
            state = ahead(k)
            state%density = density(k)
         end if
         draws(:, k) = state%w(:, 1)
         log_density(k) = state%density(1)
         if (.not. is_taken) return
      end do
   end subroutine walk_ahead

   !> Some steps of a chain.
   subroutine walk(target, kernel, pool, stream, state)
      class(target_type), intent(in) :: target
      type(kernel_type), intent(in) :: kernel
      type(pool_type), intent(inout) :: pool
      type(random_stream_type), intent(inout) :: stream
      type(state_type), intent(inout) :: state
      real(wp) :: u(target%dimension), w(target%dimension, 1), density(1), own, other, v
      integer :: step, a, b
      logical :: is_draw

      own = log_mixture(kernel%mixture, state%u)
      do step = 1, kernel%steps
         call stream%uniform(v)
         is_draw = v < kernel%share
         if (is_draw) then
            pool%drawn = pool%drawn + 1
            if (pool%left == 0) call fill(target, kernel%whitening, kernel%mixture, stream, pool)
            if (pool%left == 0) cycle
            u = pool%u(:, pool%left)
            w(:, 1) = pool%w(:, pool%left)
            density = pool%log_density(pool%left)
            pool%left = pool%left - 1
         else
            ! Along the difference of two points of the burn-in.
            call stream%pick(size(kernel%archive, 2), a)
            call stream%pick(size(kernel%archive, 2), b)
            call add_difference(stream, kernel%archive(:, a) - kernel%archive(:, b), kernel%step_scale, state%u, u)
            call kernel%whitening%from_white(u, w(:, 1))
            call target%evaluate_working(w, density)
         end if
         other = log_mixture(kernel%mixture, u)
         if (density(1) > outside) density = max(density, kernel%floor + other)
         if (.not. is_accepted(stream, density(1) - merge(other, 0.0_wp, is_draw), &
            & state%density(1) - merge(own, 0.0_wp, is_draw), 1.0_wp)) cycle
         if (is_draw) pool%accepted = pool%accepted + 1
         state%u = u
         state%w = w
         state%density = density
         own = other
      end do
   end subroutine walk

   !> A near density from draws of the mixture too, some of which are where it was far too high.
   subroutine correct(near, kernel, stream)
      class(target_type), intent(inout) :: near
      type(kernel_type), intent(in) :: kernel
      type(random_stream_type), intent(inout) :: stream
      integer, parameter :: draws = 2000
      real(wp), dimension(near%dimension, draws + size(kernel%archive, 2)) :: u, w
      real(wp) :: density(size(u, 2))
      integer :: i

      call draw_points(near, kernel%whitening, kernel%mixture, stream, u(:, :draws), w(:, :draws), density(:draws))
      density(draws + 1:) = 0.0_wp
      do i = draws + 1, size(u, 2)
         call kernel%whitening%from_white(kernel%archive(:, i - draws), w(:, i))
      end do
      call near%become_near(w(:, pack([(i, i=1, size(density))], density > outside)))
   end subroutine correct

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
         if (any(log_density > outside)) exit
      end do
      associate (inside => pack([(i, i=1, at_once)], log_density > outside))
         pool%left = size(inside)
         pool%u = u(:, inside)
         pool%w = w(:, inside)
         pool%log_density = log_density(inside)
      end associate
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

   !> Fit the mixture to the archive, then improve it by importance sampling. Points that the mixture puts outside the support
   !> count as data of their own, so that it does not shy away from the bounds; the archive stays among the data, so that a tail
   !> that the mixture has lost comes back. `quality` estimates the effective share of its draws; 0 if they are of no use.
   subroutine fit_proposal(target, whitening, archive, samples, stream, mixture, quality, log_volume)
      class(target_type), intent(in) :: target
      type(whitening_type), intent(in) :: whitening
      real(wp), intent(in), contiguous :: archive(:, :)
      !> That are wanted of the chain: for few a search as long as for many does not pay.
      integer, intent(in) :: samples
      type(random_stream_type), intent(inout) :: stream
      type(mixture_type), intent(out) :: mixture
      real(wp), intent(out) :: quality
      !> Logarithm of the integral of the density over whitened coordinates, if there is a quality.
      real(wp), intent(out) :: log_volume
      integer, parameter :: components = 16, least_draws = 600, most_draws = 3000, most_outside = 3000, least_rounds = 4, &
         & most_rounds = 12
      !> A smaller share of good draws is not worth the search: differences alone do better.
      real(wp), parameter :: archive_share = 0.3_wp, hopeless = 0.01_wp
      type(mixture_type) :: fitted
      real(wp), allocatable :: points(:, :), weights(:), log_weights(:), beyond(:, :), u(:, :), w(:, :), log_density(:)
      integer :: i, round, archived, inside, out, few, draws

      draws = min(most_draws, max(least_draws, samples/3))
      archived = size(archive, 2)
      allocate (points(target%dimension, archived + draws + most_outside), weights(archived + draws + most_outside))
      allocate (log_weights(draws), beyond(target%dimension, most_outside))
      allocate (u(target%dimension, draws), w(target%dimension, draws), log_density(draws))
      points(:, :archived) = archive
      weights = 1.0_wp
      call new_mixture(archive, components, fitted)
      call fit_mixture(archive, weights(:archived), 15, fitted)
      quality = 0.0_wp
      log_volume = 0.0_wp
      do round = 1, most_rounds
         if (stop_requested()) return
         call widen_mixture(fitted, mixture)
         inside = 0
         out = 0
         do while (inside < draws .and. out < 10*draws)
            few = min(draws - inside, 10*draws - out)
            call draw_points(target, whitening, mixture, stream, u(:, :few), w(:, :few), log_density(:few))
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
         log_volume = maxval(log_weights(:inside))
         log_weights(:inside) = exp(log_weights(:inside) - log_volume)
         log_volume = log_volume + log(sum(log_weights(:inside))/(inside + out))
         quality = sum(log_weights(:inside))**2/sum(log_weights(:inside)**2)/inside
         ! Not before the mixture that is kept has shown that it is good: its draws may have found a tail.
         if (round == most_rounds .or. (round >= least_rounds .and. quality > 0.5_wp)) exit
         if (round >= least_rounds .and. quality*inside/(inside + out) < hopeless) then
            quality = 0.0_wp
            return
         end if
         ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep one point from taking over.
         log_weights(:inside) = min(log_weights(:inside), sum(log_weights(:inside))/sqrt(real(inside, wp)))
         weights(:archived) = archive_share*inside/archived
         weights(archived + 1:archived + inside) = (1.0_wp - archive_share)*inside/sum(log_weights(:inside))*log_weights(:inside)
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
