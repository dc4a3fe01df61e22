!> Markov chains: the paper's single-component Metropolis-Hastings, and a sampler made for long ridges cut by bounds.
!>
!> `method_scmh` (paper, section 2.2): one parameter after another takes a normal step; the sd of each is tuned towards an
!> acceptance of 0.23 during burn-in only. One sample is one sweep over the parameters.
!>
!> `method_ensemble`: each chain is on its own. An ensemble of points first finds the posterior by differential evolution (ter
!> Braak, Stat. Comput. 16, 239, 2006) in the target's working coordinates. Principal axes and quadratic regressions straighten
!> what is left of a ridge's curvature, and a normal mixture is fitted to the straightened points and improved by importance
!> sampling. What follows is a plain Markov chain with a fixed kernel: mostly independent draws from the mixture, redrawn until
!> they are in the support, now and then a step along the difference of two points of the burn-in. One sample is one step.
!>
!> Chain k uses the random stream (seed, k), whatever thread runs it.
module samplers
   use errors, only: error_type, raise
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, widen_mixture
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_solve, symmetric_eigen
   use random, only: new_random_stream, random_stream_type
   use sampling_target, only: target_type
   use text, only: to_text
   implicit none
   private
   public :: sampler_type, chains_type, sample_chains
   public :: method_ensemble, method_scmh, method_from_name

   integer, parameter :: method_ensemble = 1, method_scmh = 2
   !> Acceptance that the paper tunes each component to.
   real(wp), parameter :: wanted_acceptance = 0.23_wp

   type :: sampler_type
      integer :: method = method_ensemble
      !> Kept per chain; before them, sweeps: as many evaluations of the density as there are parameters.
      integer :: samples = 10000, burn_in = 20000
      integer :: chains = 4, threads = 1, seed = 0
   end type sampler_type

   type :: chains_type
      !> draws(parameter, sample, chain).
      real(wp), allocatable :: draws(:, :, :), log_density(:, :), acceptance(:)
   end type chains_type

   !> Coordinates in which a curved ridge is straight: principal axes, then each coordinate less a quadratic function of those
   !> before it. The map keeps volumes up to a constant.
   type :: straightening_type
      integer :: n = 0
      real(wp), allocatable :: centre(:), forward(:, :), backward(:, :), width(:)
      !> Coefficients of the features of z(1) .. z(j-1), for coordinate j.
      real(wp), allocatable :: bend(:, :)
   end type straightening_type

contains

   pure integer function method_from_name(name) result(method)
      character(len=*), intent(in) :: name

      method = 0
      if (name == 'ensemble') method = method_ensemble
      if (name == 'scmh') method = method_scmh
   end function method_from_name

   !> Run all chains.
   subroutine sample_chains(target, sampler, chains, error)
      class(target_type), intent(in) :: target
      type(sampler_type), intent(in) :: sampler
      type(chains_type), intent(out) :: chains
      type(error_type), allocatable, intent(out) :: error
      type(random_stream_type) :: stream
      integer :: status(sampler%chains), k

      if (sampler%samples < 1 .or. sampler%burn_in < 0 .or. sampler%chains < 1) then
         call raise(error, 'samples and chains must be at least 1, burn_in at least 0')
         return
      end if
      allocate (chains%draws(target%dimension, sampler%samples, sampler%chains))
      allocate (chains%log_density(sampler%samples, sampler%chains), chains%acceptance(sampler%chains))
      chains%draws = 0.0_wp
      chains%log_density = 0.0_wp
      chains%acceptance = 0.0_wp
      !$omp parallel do num_threads(max(1, sampler%threads)) schedule(dynamic, 1) private(stream)
      do k = 1, sampler%chains
         stream = new_random_stream(sampler%seed, k)
         if (sampler%method == method_scmh) then
            call run_scmh(target, sampler, stream, chains%draws(:, :, k), chains%log_density(:, k), chains%acceptance(k), &
               & status(k))
         else
            call run_ensemble(target, sampler, stream, chains%draws(:, :, k), chains%log_density(:, k), chains%acceptance(k), &
               & status(k))
         end if
      end do
      !$omp end parallel do
      k = findloc(status > 0, .true., dim=1)
      if (k > 0) call raise(error, 'chain '//to_text(k)//': no admissible point with a finite density was found within the ' &
         & //'bounds')
   end subroutine sample_chains

   !> Points uniform in the support, with their log densities; `found` may be fewer than asked for.
   subroutine draw_uniform(target, stream, points, density, found)
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: points(:, :), density(:)
      integer, intent(out) :: found
      real(wp) :: x(target%dimension), u
      integer :: i, attempt

      found = 0
      do attempt = 1, 20000*size(density)
         do i = 1, target%dimension
            call stream%uniform(u)
            x(i) = target%lower(i) + u*(target%upper(i) - target%lower(i))
         end do
         if (.not. target%admits(x)) cycle
         found = found + 1
         points(:, found) = x
         density(found) = target%log_density(x)
         if (.not. density(found) > -huge(1.0_wp)) found = found - 1
         if (found == size(density)) exit
      end do
   end subroutine draw_uniform

   !> Single-component Metropolis-Hastings. The start is one of the ten best of a hundred points drawn from the support.
   subroutine run_scmh(target, sampler, stream, draws, density, acceptance, status)
      class(target_type), intent(in) :: target
      type(sampler_type), intent(in) :: sampler
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: draws(:, :), density(:), acceptance
      integer, intent(out) :: status
      real(wp) :: starts(target%dimension, 100), start_density(100), x(target%dimension)
      real(wp) :: step(target%dimension), total(target%dimension)
      real(wp) :: proposed, current, kept, u, z
      integer :: sweep, j, found, accepted, best, pick
      logical :: accept

      call draw_uniform(target, stream, starts, start_density, found)
      status = merge(1, 0, found == 0)
      if (found == 0) return
      call stream%pick(min(10, found), pick)
      best = 1
      do j = 1, pick
         best = maxloc(start_density(:found), dim=1)
         if (j < pick) start_density(best) = -huge(1.0_wp)
      end do
      x = starts(:, best)
      current = start_density(best)
      step = 0.1_wp*(target%upper - target%lower)
      total = 0.0_wp
      accepted = 0
      do sweep = 1 - sampler%burn_in, sampler%samples
         do j = 1, target%dimension
            kept = x(j)
            call stream%normal(z)
            call stream%uniform(u)
            x(j) = kept + step(j)*z
            accept = .false.
            if (target%admits(x)) then
               proposed = target%log_density(x)
               accept = log(u) < proposed - current
            end if
            if (accept) then
               current = proposed
               if (sweep > 0) accepted = accepted + 1
            else
               x(j) = kept
            end if
            if (sweep <= 0) then
               ! Robbins-Monro on the logarithm of the step; it becomes finer as the burn-in goes on.
               u = 2.0_wp*(sweep + sampler%burn_in + 25)**(-0.5_wp)
               step(j) = step(j)*exp(u*(merge(1.0_wp, 0.0_wp, accept) - wanted_acceptance))
               step(j) = min(step(j), 10.0_wp*(target%upper(j) - target%lower(j)))
               if (2*sweep > -sampler%burn_in) total(j) = total(j) + log(step(j))
            end if
         end do
         ! The chain keeps the mean over the second half, which wanders less than the last value.
         if (sweep == 0 .and. sampler%burn_in > 1) step = exp(total/((sampler%burn_in + 1)/2))
         if (sweep > 0) then
            draws(:, sweep) = x
            density(sweep) = current
         end if
      end do
      acceptance = real(accepted, wp)/(real(sampler%samples, wp)*target%dimension)
   end subroutine run_scmh

   !> A chain of the ensemble sampler, in working coordinates w.
   subroutine run_ensemble(target, sampler, stream, draws, density, acceptance, status)
      class(target_type), intent(in) :: target
      type(sampler_type), intent(in) :: sampler
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: draws(:, :), density(:), acceptance
      integer, intent(out) :: status
      real(wp), allocatable :: archive(:, :)
      type(straightening_type) :: straight
      type(mixture_type) :: mixture
      real(wp) :: w(target%dimension), u(target%dimension), proposal(target%dimension), current, proposed
      real(wp) :: own, other, v, quality, share
      integer :: i, a, b, accepted, counted
      logical :: admitted

      call evolve_population(target, sampler%burn_in*target%dimension, stream, archive, status)
      if (status /= 0) return
      call fit_straightening(archive, straight)
      call fit_proposal(target, straight, archive, stream, mixture, quality)
      ! Where the mixture fits badly, more of the steps are differences, which need no fit.
      share = min(0.85_wp, max(0.2_wp, quality))
      call stream%pick(size(archive, 2), i)
      w = archive(:, i)
      call evaluate(target, w, draws(:, 1), current, admitted)
      call to_straight(straight, w, u)
      own = log_mixture(mixture, u)
      accepted = 0
      counted = 0
      do i = 1, sampler%samples
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
               call to_straight(straight, w, u)
               own = log_mixture(mixture, u)
            end if
         end if
         density(i) = current - target%log_volume(w)
      end do
      acceptance = real(accepted, wp)/max(1, counted)
   end subroutine run_ensemble

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
         call from_straight(straight, u, w)
         call evaluate(target, w, x, density, admitted)
         if (admitted) return
      end do
   end subroutine draw_admitted

   !> Differential evolution of a population from uniform points; the archive is its second half, thinned.
   subroutine evolve_population(target, evaluations, stream, archive, status)
      class(target_type), intent(in) :: target
      integer, intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      real(wp), allocatable, intent(out) :: archive(:, :)
      integer, intent(out) :: status
      integer, parameter :: most = 3000
      real(wp), allocatable :: points(:, :), density(:)
      real(wp) :: proposal(target%dimension), x(target%dimension), length, z, spread(target%dimension)
      integer :: n, walkers, found, generations, generation, first, k, a, b, i, kept, stride
      logical :: accepted

      n = target%dimension
      walkers = max(24, 10*n)
      allocate (points(n, 8*walkers), density(8*walkers))
      call draw_uniform(target, stream, points, density, found)
      status = merge(1, 0, found == 0)
      if (found == 0) return
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
      generations = max(20, evaluations/walkers)
      first = generations/2
      stride = max(1, ((generations - first)*walkers + most - 1)/most)
      allocate (archive(n, ((generations - first)*walkers)/stride + 1))
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
               if (mod((generation - first - 1)*walkers + k - 1, stride) == 0) then
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

   !> Number of features of the first m coordinates: 1, z, and products of two.
   pure integer function feature_count(m)
      integer, intent(in) :: m

      feature_count = 1 + m + m*(m + 1)/2
   end function feature_count

   pure subroutine evaluate_features(z, f)
      real(wp), intent(in) :: z(:)
      real(wp), intent(out) :: f(:)
      integer :: i, j, k

      f(1) = 1.0_wp
      f(2:1 + size(z)) = z
      k = 1 + size(z)
      do i = 1, size(z)
         do j = 1, i
            k = k + 1
            f(k) = z(i)*z(j)
         end do
      end do
   end subroutine evaluate_features

   !> Fit the straightening to points.
   subroutine fit_straightening(points, straight)
      real(wp), intent(in) :: points(:, :)
      type(straightening_type), intent(out) :: straight
      type(error_type), allocatable :: error
      real(wp), allocatable :: z(:, :), gram(:, :), rhs(:, :), f(:)
      real(wp) :: covariance(size(points, 1), size(points, 1)), values(size(points, 1)), spread(size(points, 1)), variance
      integer :: n, many, i, j, m

      n = size(points, 1)
      many = size(points, 2)
      straight%n = n
      straight%centre = sum(points, 2)/many
      do i = 1, n
         spread(i) = max(sqrt(sum((points(i, :) - straight%centre(i))**2)/many), 1.0e-12_wp)
      end do
      do j = 1, n
         do i = 1, n
            covariance(i, j) = sum((points(i, :) - straight%centre(i))*(points(j, :) - straight%centre(j))) &
               & /(many*spread(i)*spread(j))
         end do
         covariance(j, j) = covariance(j, j) + 1.0e-12_wp
      end do
      call symmetric_eigen(covariance, values, error)
      if (allocated(error)) then
         covariance = 0.0_wp
         do j = 1, n
            covariance(j, j) = 1.0_wp
         end do
         values = 1.0_wp
         deallocate (error)
      end if
      ! The longest axis first, of unit variance.
      values = sqrt(max(values, 1.0e-12_wp))
      allocate (straight%forward(n, n), straight%backward(n, n), straight%bend(feature_count(n - 1), n), straight%width(n))
      do j = 1, n
         straight%forward(j, :) = covariance(:, n + 1 - j)/(values(n + 1 - j)*spread)
         straight%backward(:, j) = covariance(:, n + 1 - j)*values(n + 1 - j)*spread
      end do
      allocate (z(n, many))
      do i = 1, many
         z(:, i) = matmul(straight%forward, points(:, i) - straight%centre)
      end do
      straight%bend = 0.0_wp
      do j = 1, n
         m = feature_count(j - 1)
         allocate (gram(m, m), rhs(m, 1), f(m))
         gram = 0.0_wp
         rhs = 0.0_wp
         do i = 1, many
            call evaluate_features(z(:j - 1, i), f)
            rhs(:, 1) = rhs(:, 1) + f*z(j, i)
            gram = gram + spread_product(f)
         end do
         do i = 1, m
            gram(i, i) = gram(i, i)*(1.0_wp + 1.0e-9_wp) + 1.0e-9_wp*many
         end do
         call cholesky_factor(gram, error)
         if (.not. allocated(error)) then
            call cholesky_solve(gram, rhs)
            straight%bend(:m, j) = rhs(:, 1)
         end if
         variance = 0.0_wp
         do i = 1, many
            call evaluate_features(z(:j - 1, i), f)
            variance = variance + (z(j, i) - sum(straight%bend(:m, j)*f))**2
         end do
         straight%width(j) = sqrt(max(variance/many, 1.0e-16_wp))
         deallocate (gram, rhs, f)
      end do
   end subroutine fit_straightening

   pure function spread_product(f) result(outer)
      real(wp), intent(in) :: f(:)
      real(wp) :: outer(size(f), size(f))
      integer :: i

      do i = 1, size(f)
         outer(:, i) = f*f(i)
      end do
   end function spread_product

   !> From working to straight coordinates.
   pure subroutine to_straight(straight, w, u)
      type(straightening_type), intent(in) :: straight
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: u(:)
      real(wp) :: z(straight%n), f(feature_count(straight%n - 1))
      integer :: j, m

      z = matmul(straight%forward, w - straight%centre)
      do j = 1, straight%n
         m = feature_count(j - 1)
         call evaluate_features(z(:j - 1), f(:m))
         u(j) = (z(j) - sum(straight%bend(:m, j)*f(:m)))/straight%width(j)
      end do
   end subroutine to_straight

   !> And back.
   pure subroutine from_straight(straight, u, w)
      type(straightening_type), intent(in) :: straight
      real(wp), intent(in) :: u(:)
      real(wp), intent(out) :: w(:)
      real(wp) :: z(straight%n), f(feature_count(straight%n - 1))
      integer :: j, m

      do j = 1, straight%n
         m = feature_count(j - 1)
         call evaluate_features(z(:j - 1), f(:m))
         z(j) = u(j)*straight%width(j) + sum(straight%bend(:m, j)*f(:m))
      end do
      w = straight%centre + matmul(straight%backward, z)
   end subroutine from_straight

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
         call to_straight(straight, archive(:, i), u)
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
            call from_straight(straight, u, w)
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
end module samplers
