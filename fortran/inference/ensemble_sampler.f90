!> A sampler made for long ridges cut by bounds.
!>
!> Each chain is on its own. An ensemble of points first finds the posterior by differential evolution (ter Braak, Stat. Comput. 16,
!> 239, 2006) in the target's working coordinates, straightened round after round: principal axes, and a polynomial of the longer ones
!> taken off the shorter ones. A normal mixture is fitted to the straightened points and improved by importance sampling. What follows
!> is a plain Markov chain with a fixed kernel: mostly independent draws from the mixture, redrawn until they are in the support, now and
!> then a step along the difference of two points of the burn-in. One sample is one step, or several where the mixture fits badly.
module ensemble_sampler
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, widen_mixture
   use kinds, only: i8, wp
   use random, only: random_stream_type
   use ridge_straightening, only: fit_straightening, no_straightening, straightening_type
   use abstract_sampler, only: draw_starts, sampler_type
   use sampling_target, only: point_type, target_type
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
      type(point_type) :: current, proposal
      real(wp) :: u(target%dimension), tried(target%dimension), own, other, v, quality, share
      integer :: i, a, b, step, steps, accepted, counted
      logical :: admitted

      acceptance = 0.0_wp
      call evolve_population(target, int(self%burn_in, i8)*target%dimension, stream, straight, archive, started)
      if (.not. started) return
      call fit_proposal(target, straight, archive, stream, mixture, quality)
      ! Where the mixture fits badly, more of the steps are differences, which need no fit.
      share = 0.0_wp
      if (quality > 0.0_wp) share = min(0.85_wp, max(0.2_wp, quality))
      steps = 1 + nint(2.0_wp*target%dimension*max(0.0_wp, 0.8_wp - quality))
      call stream%pick(size(archive, 2), i)
      u = archive(:, i)
      allocate (current%w(target%dimension), proposal%w(target%dimension))
      call straight%from_straight(u, current%w)
      call target%evaluate_working(current, .false., admitted)
      own = log_mixture(mixture, u)
      accepted = 0
      counted = 0
      do i = 1, size(log_density)
         do step = 1, steps
            call stream%uniform(v)
            if (v < share) then
               counted = counted + 1
               call draw_admitted(target, straight, mixture, stream, proposal, tried, admitted)
               if (.not. admitted) cycle
               other = log_mixture(mixture, tried)
               call stream%uniform(v)
               if (log(v) < proposal%log_working - current%log_working + own - other) then
                  current = proposal
                  u = tried
                  own = other
                  accepted = accepted + 1
               end if
            else
               call stream%pick(size(archive, 2), a)
               call stream%pick(size(archive, 2), b)
               call add_difference(stream, archive(:, a) - archive(:, b), u, tried)
               call try_step(target, straight, stream, tried, 1.0_wp, .false., proposal, current, admitted)
               if (.not. admitted) cycle
               u = tried
               own = log_mixture(mixture, u)
            end if
         end do
         draws(:, i) = current%x
         log_density(i) = current%log_density
      end do
      acceptance = real(accepted, wp)/max(1, counted)
   end subroutine run

   !> A Metropolis step from `current` to straight coordinates u.
   subroutine try_step(target, straight, stream, u, temperature, roughly, proposal, current, accepted)
      class(target_type), intent(in) :: target
      type(straightening_type), intent(in) :: straight
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: u(:)
      !> Divides the logarithm of the density.
      real(wp), intent(in) :: temperature
      !> On the way to the posterior: the density may be rough.
      logical, intent(in) :: roughly
      type(point_type), intent(inout) :: proposal, current
      logical, intent(out) :: accepted
      real(wp) :: v

      call straight%from_straight(u, proposal%w)
      call target%evaluate_working(proposal, roughly, accepted)
      if (.not. accepted) return
      call stream%uniform(v)
      accepted = log(v)*temperature < proposal%log_working - current%log_working
      if (accepted) current = proposal
   end subroutine try_step

   !> u plus a factor times a difference of two points, of all coordinates or of some, with a little noise.
   subroutine add_difference(stream, difference, u, moved)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: difference(:), u(:)
      real(wp), intent(out) :: moved(:)
      real(wp), parameter :: noise = 1.0e-5_wp
      real(wp) :: share, v, length, z
      integer :: i, n
      logical :: changed(size(u))

      call stream%uniform(share)
      changed = .true.
      if (share < 0.5_wp) then
         do i = 1, size(u)
            call stream%uniform(v)
            changed(i) = v < 2.0_wp*share
         end do
         if (.not. any(changed)) changed = .true.
      end if
      n = count(changed)
      call step_length(n, stream, length)
      moved = u
      do i = 1, size(u)
         if (.not. changed(i)) cycle
         call stream%normal(z)
         moved(i) = u(i) + length*difference(i) + noise*z
      end do
   end subroutine add_difference

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

   !> A point of the mixture in the support, and u, its straightened coordinates; `admitted` is false if a thousand draws were all
   !> outside.
   subroutine draw_admitted(target, straight, mixture, stream, point, u, admitted)
      class(target_type), intent(in) :: target
      type(straightening_type), intent(in) :: straight
      type(mixture_type), intent(in) :: mixture
      type(random_stream_type), intent(inout) :: stream
      type(point_type), intent(inout) :: point
      real(wp), intent(out) :: u(:)
      logical, intent(out) :: admitted
      integer :: attempt

      do attempt = 1, 1000
         call draw_mixture(mixture, stream, u)
         call straight%from_straight(u, point%w)
         call target%evaluate_working(point, .false., admitted)
         if (admitted) return
      end do
   end subroutine draw_admitted

   !> Differential evolution of a population from the target's starts, in rounds that cool, and warm a little for
   !> the tails: each straightens what the one before has found.
   !> The archive is what the last one visited, thinned, in straight coordinates.
   subroutine evolve_population(target, evaluations, stream, straight, archive, started)
      class(target_type), intent(in) :: target
      integer(i8), intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      type(straightening_type), intent(out) :: straight
      !> (dimension, point).
      real(wp), allocatable, intent(out) :: archive(:, :)
      logical, intent(out) :: started
      integer, parameter :: most = 3000, rounds = 10
      real(wp), parameter :: temperatures(rounds) = [300.0_wp, 100.0_wp, 30.0_wp, 10.0_wp, 3.0_wp, &
         & 1.0_wp, 1.0_wp, 1.0_wp, 1.5_wp, 1.5_wp]
      real(wp), allocatable :: points(:, :), density(:), u(:, :)
      type(point_type), allocatable :: walkers(:)
      type(point_type) :: proposal
      real(wp) :: tried(target%dimension)
      integer :: n, m, found, generations, generation, round, k, a, b, i, kept
      integer(i8) :: visits, stride
      logical :: accepted

      n = target%dimension
      m = max(24, 10*n)
      allocate (points(n, 8*m), density(8*m))
      call draw_starts(target, stream, points, density, found)
      started = found > 0
      if (.not. started) return
      call keep_best(points, density, found, m)
      m = min(m, found)
      allocate (walkers(m), u(n, m))
      do k = 1, m
         allocate (walkers(k)%w(n))
         call target%to_working(points(:, k), walkers(k)%w)
         call target%evaluate_working(walkers(k), .true., accepted)
      end do
      proposal%w = walkers(1)%w
      generations = int(max(4_i8, evaluations/(m*rounds)))
      stride = max(1_i8, (int(generations, i8)*m/2 + most - 1)/most)
      straight = no_straightening(n)
      do round = 1, rounds
         if (round == 1) allocate (archive(n, int(int(generations, i8)*m/stride) + 1))
         do k = 1, m
            call straight%to_straight(walkers(k)%w, u(:, k))
         end do
         kept = 0
         visits = 0
         do generation = 1, generations
            do k = 1, m
               call pick_pair(stream, m, k, a, b)
               call add_difference(stream, u(:, a) - u(:, b), u(:, k), tried)
               call try_step(target, straight, stream, tried, temperatures(round), .true., proposal, &
                  & walkers(k), accepted)
               if (accepted) u(:, k) = tried
               if (2*generation <= generations) cycle
               if (mod(visits, stride) == 0) then
                  kept = kept + 1
                  archive(:, kept) = walkers(k)%w
               end if
               visits = visits + 1
            end do
         end do
         if (round < rounds) call fit_straightening(archive(:, :kept), straight)
      end do
      archive = archive(:, :kept)
      do i = 1, kept
         call straight%to_straight(archive(:, i), tried)
         archive(:, i) = tried
      end do
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
   !> that the mixture has lost comes back. `quality` estimates the effective share of its draws; 0 if they are of no use.
   subroutine fit_proposal(target, straight, archive, stream, mixture, quality)
      class(target_type), intent(in) :: target
      type(straightening_type), intent(in) :: straight
      real(wp), intent(in) :: archive(:, :)
      type(random_stream_type), intent(inout) :: stream
      type(mixture_type), intent(out) :: mixture
      real(wp), intent(out) :: quality
      integer, parameter :: components = 16, draws = 3000, most_outside = 3000, least_rounds = 4, most_rounds = 12
      integer, parameter :: most_tries = 10*draws
      !> A smaller share of good draws is not worth the search: differences alone do better.
      real(wp), parameter :: archive_share = 0.15_wp, hopeless = 0.01_wp
      type(mixture_type) :: fitted
      real(wp), allocatable :: points(:, :), weights(:), log_weights(:), outside(:, :)
      type(point_type) :: point
      real(wp) :: u(target%dimension), cap
      integer :: i, round, kept, inside, out, few
      logical :: admitted, last

      kept = size(archive, 2)
      allocate (point%w(target%dimension))
      allocate (points(kept + draws + most_outside, target%dimension), weights(kept + draws + most_outside))
      allocate (log_weights(draws), outside(most_outside, target%dimension))
      points(:kept, :) = transpose(archive)
      weights = 1.0_wp
      call new_mixture(points(:kept, :), components, fitted)
      call fit_mixture(points(:kept, :), weights(:kept), 15, fitted)
      quality = 0.0_wp
      do round = 1, most_rounds
         last = round == most_rounds .or. (round >= least_rounds .and. quality > 0.5_wp)
         call widen_mixture(fitted, 1.05_wp, 0.1_wp, 0.03_wp, 4.0_wp, mixture)
         inside = 0
         out = 0
         do while (inside < draws .and. out < most_tries)
            call draw_mixture(mixture, stream, u)
            call straight%from_straight(u, point%w)
            call target%evaluate_working(point, .true., admitted)
            if (admitted) then
               inside = inside + 1
               points(kept + inside, :) = u
               log_weights(inside) = point%log_working - log_mixture(mixture, u)
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
         if (round > 1 .and. quality*inside/(inside + out) < hopeless) then
            quality = 0.0_wp
            return
         end if
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
