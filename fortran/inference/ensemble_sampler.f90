!> A sampler made for long ridges cut by bounds.
!>
!> Each chain is on its own. An ensemble of points first finds the posterior by differential evolution (ter Braak, Stat. Comput. 16,
!> 239, 2006) in the target's working coordinates. Principal axes and quadratic regressions straighten what is left of a ridge's
!> curvature, and a normal mixture is fitted to the straightened points and improved by importance sampling. What follows is a plain
!> Markov chain with a fixed kernel: mostly independent draws from the mixture, redrawn until they are in the support, now and then
!> a step along the difference of two points of the burn-in. One sample is one step.
module ensemble_sampler
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, widen_mixture
   use kinds, only: i8, wp
   use random, only: random_stream_type
   use ridge_straightening, only: fit_straightening, straightening_type
   use abstract_sampler, only: draw_uniform, sampler_type
   use sampling_target, only: target_type
   implicit none
   private
   public :: ensemble_sampler_type

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
      real(wp), allocatable :: archive(:, :)
      type(straightening_type) :: straight
      type(mixture_type) :: mixture
      real(wp) :: w(target%dimension), u(target%dimension), proposal(target%dimension), current, proposed
      real(wp) :: own, other, v, quality, share
      integer :: i, a, b, accepted, counted
      logical :: admitted

      acceptance = 0.0_wp
      call evolve_population(target, int(self%burn_in, i8)*target%dimension, stream, archive, started)
      if (.not. started) return
      call fit_straightening(archive, straight)
      call fit_proposal(target, straight, archive, stream, mixture, quality)
      ! Where the mixture fits badly, more of the steps are differences, which need no fit.
      share = min(0.85_wp, max(0.2_wp, quality))
      call stream%pick(size(archive, 2), i)
      w = archive(:, i)
      call evaluate(target, w, draws(:, 1), current, admitted)
      call straight%to_straight(w, u)
      own = log_mixture(mixture, u)
      accepted = 0
      counted = 0
      do i = 1, size(log_density)
         if (i > 1) draws(:, i) = draws(:, i - 1)
         call stream%uniform(v)
         if (v < share) then
            counted = counted + 1
            call draw_admitted(target, straight, mixture, stream, proposal, u, proposed, admitted)
            if (admitted) then
               other = log_mixture(mixture, u)
               call stream%uniform(v)
               if (log(v) < proposed - current + own - other) then
                  w = proposal
                  call target%from_working(w, draws(:, i))
                  current = proposed
                  own = other
                  accepted = accepted + 1
               end if
            end if
         else
            call stream%pick(size(archive, 2), a)
            call stream%pick(size(archive, 2), b)
            call step_length(target%dimension, stream, v)
            proposal = w + v*(archive(:, a) - archive(:, b))
            call try_step(target, stream, proposal, current, w, draws(:, i), admitted)
            if (admitted) then
               call straight%to_straight(w, u)
               own = log_mixture(mixture, u)
            end if
         end if
         log_density(i) = current - target%log_volume(w)
      end do
      acceptance = real(accepted, wp)/max(1, counted)
   end subroutine run

   !> The parameters at working coordinates and the log density there (of the working coordinates), if they are in the support.
   subroutine evaluate(target, w, x, density, admitted)
      class(target_type), intent(in) :: target
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: x(:), density
      logical, intent(out) :: admitted

      call target%from_working(w, x)
      density = -huge(1.0_wp)
      admitted = target%admits(x)
      if (admitted) density = target%log_density(x) + target%log_volume(w)
   end subroutine evaluate

   !> A Metropolis step from `w` to `proposal`; `x` and `current` follow if it is `accepted`.
   subroutine try_step(target, stream, proposal, current, w, x, accepted)
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: proposal(:)
      real(wp), intent(inout) :: current, w(:), x(:)
      logical, intent(out) :: accepted
      real(wp) :: proposed, v, there(target%dimension)

      call evaluate(target, proposal, there, proposed, accepted)
      if (.not. accepted) return
      call stream%uniform(v)
      accepted = log(v) < proposed - current
      if (.not. accepted) return
      w = proposal
      x = there
      current = proposed
   end subroutine try_step

   !> Factor of a difference of two points: ter Braak's, now and then one, or shorter.
   subroutine step_length(n, stream, length)
      integer, intent(in) :: n
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: length
      real(wp) :: v

      call stream%uniform(v)
      length = 2.38_wp/sqrt(2.0_wp*n)
      if (v < 0.15_wp) length = 1.0_wp
      if (v > 0.75_wp) length = 0.35_wp*length
   end subroutine step_length

   !> A point of the mixture in the support, with its log density; `admitted` is false if a thousand draws were all outside.
   subroutine draw_admitted(target, straight, mixture, stream, w, u, density, admitted)
      class(target_type), intent(in) :: target
      type(straightening_type), intent(in) :: straight
      type(mixture_type), intent(in) :: mixture
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: w(:), u(:), density
      logical, intent(out) :: admitted
      real(wp) :: x(target%dimension)
      integer :: attempt

      do attempt = 1, 1000
         call draw_mixture(mixture, stream, u)
         call straight%from_straight(u, w)
         call evaluate(target, w, x, density, admitted)
         if (admitted) return
      end do
   end subroutine draw_admitted

   !> Differential evolution of a population from uniform points; the archive is its second half, thinned.
   subroutine evolve_population(target, evaluations, stream, archive, started)
      class(target_type), intent(in) :: target
      integer(i8), intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      real(wp), allocatable, intent(out) :: archive(:, :)
      logical, intent(out) :: started
      integer, parameter :: most = 3000
      real(wp), allocatable :: points(:, :), density(:)
      real(wp) :: proposal(target%dimension), x(target%dimension), length, z, spread(target%dimension)
      integer :: n, walkers, found, generations, generation, first, k, a, b, i, kept, stride
      logical :: accepted

      n = target%dimension
      walkers = max(24, 10*n)
      allocate (points(n, 8*walkers), density(8*walkers))
      call draw_uniform(target, stream, points, density, found)
      started = found > 0
      if (.not. started) return
      call keep_best(points, density, found, walkers)
      walkers = min(walkers, found)
      do k = 1, walkers
         x = points(:, k)
         call target%to_working(x, points(:, k))
         density(k) = density(k) + target%log_volume(points(:, k))
      end do
      do i = 1, n
         spread(i) = maxval(points(i, :walkers)) - minval(points(i, :walkers))
      end do
      generations = int(max(20_i8, evaluations/walkers))
      first = generations/2
      stride = int(max(1_i8, (int(generations - first, i8)*walkers + most - 1)/most))
      allocate (archive(n, (int(generations - first, i8)*walkers)/stride + 1))
      kept = 0
      do generation = 1, generations
         do k = 1, walkers
            call pick_pair(stream, walkers, k, a, b)
            call step_length(n, stream, length)
            proposal = points(:, k) + length*(points(:, a) - points(:, b))
            do i = 1, n
               call stream%normal(z)
               proposal(i) = proposal(i) + 1.0e-5_wp*spread(i)*z
            end do
            call try_step(target, stream, proposal, density(k), points(:, k), x, accepted)
            if (generation > first) then
               if (mod(int(generation - first - 1, i8)*walkers + k - 1, int(stride, i8)) == 0) then
                  kept = kept + 1
                  archive(:, kept) = points(:, k)
               end if
            end if
         end do
      end do
      archive = archive(:, :kept)
   end subroutine evolve_population

   !> Two members of a population, different from each other and from `w` where there are enough.
   subroutine pick_pair(stream, walkers, w, a, b)
      type(random_stream_type), intent(inout) :: stream
      integer, intent(in) :: walkers, w
      integer, intent(out) :: a, b

      do
         call stream%pick(walkers, a)
         call stream%pick(walkers, b)
         if (walkers < 3 .or. (a /= b .and. a /= w .and. b /= w)) exit
      end do
   end subroutine pick_pair

   !> Move the `wanted` points of highest density to the front.
   pure subroutine keep_best(points, density, found, wanted)
      real(wp), intent(inout) :: points(:, :), density(:)
      integer, intent(in) :: found, wanted
      real(wp) :: point(size(points, 1)), value
      integer :: i, best

      do i = 1, min(wanted, found)
         best = i - 1 + maxloc(density(i:found), dim=1)
         point = points(:, best)
         value = density(best)
         points(:, best) = points(:, i)
         density(best) = density(i)
         points(:, i) = point
         density(i) = value
      end do
   end subroutine keep_best

   !> Fit the mixture to the archive, then improve it by importance sampling. Points that the mixture puts outside the support
   !> count as data of their own, so that it does not shy away from the bounds; the archive stays among the data, so that a tail
   !> that the mixture has lost comes back. `quality` estimates the effective share of its draws.
   subroutine fit_proposal(target, straight, archive, stream, mixture, quality)
      class(target_type), intent(in) :: target
      type(straightening_type), intent(in) :: straight
      real(wp), intent(in) :: archive(:, :)
      type(random_stream_type), intent(inout) :: stream
      type(mixture_type), intent(out) :: mixture
      real(wp), intent(out) :: quality
      integer, parameter :: components = 16, draws = 3000, most_outside = 3000, least_rounds = 4, most_rounds = 12
      real(wp), parameter :: archive_share = 0.15_wp
      type(mixture_type) :: fitted
      real(wp), allocatable :: points(:, :), weights(:), log_weights(:), outside(:, :)
      real(wp) :: x(target%dimension), w(target%dimension), u(target%dimension), density, cap
      integer :: i, round, kept, inside, out, few
      logical :: admitted, last

      kept = size(archive, 2)
      allocate (points(kept + draws + most_outside, target%dimension), weights(kept + draws + most_outside))
      allocate (log_weights(draws), outside(most_outside, target%dimension))
      do i = 1, kept
         call straight%to_straight(archive(:, i), u)
         points(i, :) = u
      end do
      weights = 1.0_wp
      call new_mixture(points(:kept, :), components, fitted)
      call fit_mixture(points(:kept, :), weights(:kept), 15, fitted)
      quality = 0.0_wp
      do round = 1, most_rounds
         last = round == most_rounds .or. (round >= least_rounds .and. quality > 0.5_wp)
         call widen_mixture(fitted, 1.05_wp, 0.1_wp, 0.03_wp, 4.0_wp, mixture)
         inside = 0
         out = 0
         do while (inside < draws .and. out < 50*draws)
            call draw_mixture(mixture, stream, u)
            call straight%from_straight(u, w)
            call evaluate(target, w, x, density, admitted)
            if (admitted) then
               inside = inside + 1
               points(kept + inside, :) = u
               log_weights(inside) = density - log_mixture(mixture, u)
            else
               out = out + 1
               if (out <= most_outside) outside(out, :) = u
            end if
         end do
         quality = 0.0_wp
         if (inside == 0) return
         log_weights(:inside) = exp(log_weights(:inside) - maxval(log_weights(:inside)))
         quality = sum(log_weights(:inside))**2/sum(log_weights(:inside)**2)/inside
         if (last) exit
         ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep one point from taking over.
         cap = sum(log_weights(:inside))/sqrt(real(inside, wp))
         log_weights(:inside) = min(log_weights(:inside), cap)
         weights(:kept) = archive_share*inside/kept
         weights(kept + 1:kept + inside) = (1.0_wp - archive_share)*inside/sum(log_weights(:inside))*log_weights(:inside)
         few = min(out, most_outside)
         i = kept + inside
         if (few > 0) then
            points(i + 1:i + few, :) = outside(:few, :)
            weights(i + 1:i + few) = real(out, wp)/few
         end if
         call fit_mixture(points(:i + few, :), weights(:i + few), 6, fitted)
      end do
   end subroutine fit_proposal
end module ensemble_sampler
