!> How an ensemble of points finds a posterior: the burn-in of the ensemble sampler.
!>
!> Differential evolution (ter Braak, Stat. Comput. 16, 239, 2006) in rounds that cool, and warm a little for the tails, in the target's
!> working coordinates, straightened round after round: principal axes, and a polynomial of the longer ones taken off the shorter ones.
!> Where the density follows from costly results of a model, a polynomial fitted to these about the points of the round before stands for
!> them, and many more steps are taken.
module ensemble_evolution
   use abstract_sampler, only: draw_starts
   use kinds, only: i8, wp
   use output_polynomial, only: fit_output_polynomial, is_fitted, output_polynomial_type, polynomial_degree, polynomial_terms
   use random, only: random_stream_type
   use ridge_straightening, only: fit_straightening, no_straightening, straightening_type
   use sampling_target, only: point_type, target_type
   use sorting, only: sort_order
   implicit none
   private
   public :: view_type, evolve_population, try_step, add_difference

   !> How the target is looked at: straight coordinates, and what stands for its costly results, if anything.
   type :: view_type
      type(straightening_type) :: straight
      type(output_polynomial_type) :: polynomial
      !> Of steps along differences, 1 in coordinates in which the density is normal.
      real(wp) :: reach = 1.0_wp
   end type view_type

   !> From here on ensembles are larger, and a polynomial pays.
   integer, parameter :: many_dimensions = 6

contains

   !> Differential evolution of a population from the target's starts, in rounds that cool, and warm a little for
   !> the tails: each straightens what the one before has found.
   !> The archive is what the last one visited, thinned, in straight coordinates.
   subroutine evolve_population(target, evaluations, stream, view, archive, started)
      class(target_type), intent(in) :: target
      !> Of the density, about.
      integer(i8), intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      type(view_type), intent(out) :: view
      !> (dimension, point).
      real(wp), allocatable, intent(out) :: archive(:, :)
      !> Whether a point of the support was found.
      logical, intent(out) :: started
      integer, parameter :: rounds = 10, most = 4000
      real(wp), parameter :: accepted_share = 0.2_wp, least_reach = 0.02_wp, on_the_way = 0.5_wp, at_the_end = 0.8_wp
      real(wp), parameter :: temperatures(rounds) = [300.0_wp, 100.0_wp, 30.0_wp, 10.0_wp, 3.0_wp, &
         & 1.0_wp, 1.0_wp, 1.0_wp, 1.5_wp, 1.5_wp]
      real(wp), allocatable :: points(:, :), density(:), u(:, :)
      type(point_type), allocatable :: walkers(:)
      type(point_type) :: proposal
      real(wp) :: tried(target%dimension)
      integer :: n, m, found, generations, generation, round, k, a, b, i, kept, moved, distinct
      integer(i8) :: visits, stride, effort
      logical :: accepted

      n = target%dimension
      m = max(24, merge(40, 10, n >= many_dimensions)*n)
      allocate (points(n, 4*m), density(4*m))
      call draw_starts(target, stream, points, density, found)
      started = found > 0
      if (.not. started) return
      call keep_best(points, density, found, m)
      do k = 1, found
         call target%to_working(points(:, k), tried)
         points(:, k) = tried
      end do
      m = min(m, found)
      effort = 1
      if (target%n_outputs > 0) effort = merge(10, 1, n >= many_dimensions)
      allocate (walkers(m), u(n, m), archive(n, most + m))
      do k = 1, m
         walkers(k)%w = points(:, k)
      end do
      proposal%w = points(:, 1)
      view%straight = no_straightening(n)
      call fit_outputs(target, points(:, :found), temperatures(1), on_the_way, stream, view)
      do round = 1, rounds
         do k = 1, m
            call view%straight%to_straight(walkers(k)%w, u(:, k))
            call target%evaluate_working(walkers(k), accepted, view%polynomial)
         end do
         generations = int(max(4_i8, merge(effort, min(effort, 2_i8), is_fitted(view%polynomial))*evaluations/(m*rounds)))
         ! All walkers are to be in the archive: no common divisor.
         stride = max(1_i8, (int(generations, i8)*m/2 + most - 1)/most)
         do while (any([(mod(stride, int(i, i8)) == 0 .and. mod(m, i) == 0, i=2, m)]))
            stride = stride + 1
         end do
         kept = 0
         visits = 0
         distinct = 0
         do generation = 1, generations
            moved = 0
            do k = 1, m
               call pick_pair(stream, m, k, a, b)
               call add_difference(stream, u(:, a) - u(:, b), view%reach, u(:, k), tried)
               call try_step(target, view, stream, tried, temperatures(round), proposal, walkers(k), accepted)
               if (accepted) then
                  u(:, k) = tried
                  moved = moved + 1
               end if
               if (2*generation <= generations) cycle
               if (mod(visits, stride) == 0) then
                  kept = kept + 1
                  archive(:, kept) = walkers(k)%w
               end if
               visits = visits + 1
            end do
            view%reach = min(1.0_wp, max(least_reach, view%reach*exp(0.5_wp*(real(moved, wp)/m - accepted_share))))
            if (2*generation > generations) distinct = distinct + moved
         end do
         call fit_outputs(target, archive(:, :kept), temperatures(min(round + 1, rounds)), &
            & merge(on_the_way, at_the_end, round < rounds), stream, view)
         call drop_astray(target, view, temperatures(round), stream, walkers, archive, kept)
         if (round < rounds) call fit_straightening(archive(:, :kept), min(kept, distinct, 4*m), view%straight)
      end do
      archive = archive(:, :kept)
      do i = 1, kept
         call view%straight%to_straight(archive(:, i), tried)
         archive(:, i) = tried
      end do
   end subroutine evolve_population

   !> The polynomial for the costly results of a target, if it has such, from some of the points; none if it errs at others.
   subroutine fit_outputs(target, points, temperature, least_good, stream, view)
      class(target_type), intent(in) :: target
      !> Of the support, working coordinates (dimension, point).
      real(wp), intent(in) :: points(:, :)
      !> Divides the logarithm of the density where the polynomial will be used.
      real(wp), intent(in) :: temperature
      !> Share of the points of the test at which it must not err by more than two temperatures.
      real(wp), intent(in) :: least_good
      type(random_stream_type), intent(inout) :: stream
      type(view_type), intent(inout) :: view
      !> Points for each term, points of the test, and terms where it is still hot and then.
      integer, parameter :: surplus = 4, tests = 50, few_terms = 300, many_terms = 800
      real(wp), allocatable :: outputs(:, :), arguments(:, :)
      type(point_type) :: exact, near
      real(wp), dimension(target%dimension) :: u, from, to, tried
      integer :: degree, many, a, k, good, attempt
      logical :: admitted

      call view%polynomial%clear()
      if (target%n_outputs == 0 .or. target%dimension < many_dimensions) return
      degree = polynomial_degree(target%dimension, merge(few_terms, many_terms, temperature > 5.0_wp))
      many = surplus*polynomial_terms(target%dimension, degree)
      allocate (outputs(target%n_outputs, many), arguments(target%dimension, many))
      allocate (near%w(target%dimension))
      k = 1
      do attempt = 1, 20*many
         ! Where steps from the points lead, accepted or not: these are more different, and reach a little further.
         call view%straight%to_straight(points(:, 1 + mod(k*(size(points, 2)/many + 1), size(points, 2))), u)
         call stream%pick(size(points, 2), a)
         call view%straight%to_straight(points(:, a), from)
         call stream%pick(size(points, 2), a)
         call view%straight%to_straight(points(:, a), to)
         call add_difference(stream, to - from, max(0.3_wp, view%reach), u, tried)
         call view%straight%from_straight(tried, near%w)
         call target%evaluate_outputs(near%w, arguments(:, k), outputs(:, k), admitted)
         if (.not. admitted) cycle
         if (k == many) exit
         k = k + 1
      end do
      if (k < many) return
      call fit_output_polynomial(arguments, outputs, degree, view%polynomial)
      if (.not. is_fitted(view%polynomial)) return
      good = 0
      do k = 1, tests
         exact%w = points(:, 1 + (k - 1)*(size(points, 2) - 1)/tests)
         near = exact
         call target%evaluate_working(exact, admitted)
         call target%evaluate_working(near, admitted, view%polynomial)
         if (abs(exact%log_working - near%log_working) < 2.0_wp*temperature) good = good + 1
      end do
      if (good < least_good*tests) call view%polynomial%clear()
   end subroutine fit_outputs

   !> Where an earlier polynomial was wrong, walkers may have gone astray: what is far below the best by the present one is dropped
   !> from the archive, and walkers that are go back to points of it.
   subroutine drop_astray(target, view, temperature, stream, walkers, archive, kept)
      class(target_type), intent(in) :: target
      type(view_type), intent(in) :: view
      real(wp), intent(in) :: temperature
      type(random_stream_type), intent(inout) :: stream
      type(point_type), intent(inout) :: walkers(:)
      !> Working coordinates (dimension, point), the first `kept` of them.
      real(wp), intent(inout) :: archive(:, :)
      integer, intent(inout) :: kept
      type(point_type) :: point
      real(wp) :: density(kept), n, least
      integer :: order(kept), i, k, last
      logical :: admitted

      if (.not. is_fitted(view%polynomial)) return
      allocate (point%w(target%dimension))
      do i = 1, kept
         point%w = archive(:, i)
         call target%evaluate_working(point, admitted, view%polynomial)
         density(i) = -huge(1.0_wp)
         if (admitted) density(i) = point%log_working/temperature
      end do
      ! With n normal or exponential coordinates the logarithm of the density is about n below its best, or less, give or take a root.
      ! The very best may be an error of the polynomial. Half of the points stay at least.
      n = real(target%dimension, wp)
      call sort_order(density, order)
      least = min(density(order(1 + kept/2)), density(order(1 + (9*kept)/10)) - (n + 4.0_wp*sqrt(n) + 6.0_wp))
      last = kept
      kept = 0
      do i = 1, last
         if (density(i) < least) cycle
         kept = kept + 1
         archive(:, kept) = archive(:, i)
      end do
      do k = 1, size(walkers)
         call target%evaluate_working(walkers(k), admitted, view%polynomial)
         if (admitted .and. walkers(k)%log_working/temperature >= least) cycle
         call stream%pick(kept, i)
         walkers(k)%w = archive(:, i)
      end do
   end subroutine drop_astray

   !> A Metropolis step from `current` to straight coordinates u.
   subroutine try_step(target, view, stream, u, temperature, proposal, current, accepted)
      class(target_type), intent(in) :: target
      type(view_type), intent(in) :: view
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: u(:)
      !> Divides the logarithm of the density.
      real(wp), intent(in) :: temperature
      type(point_type), intent(inout) :: proposal, current
      !> Whether `current` is now the proposal.
      logical, intent(out) :: accepted
      real(wp) :: v

      call view%straight%from_straight(u, proposal%w)
      call target%evaluate_working(proposal, accepted, view%polynomial)
      if (.not. accepted) return
      call stream%uniform(v)
      accepted = log(v) < (proposal%log_working - current%log_working)/temperature
      if (accepted) current = proposal
   end subroutine try_step

   !> u plus a factor times a difference of two points, of all coordinates or of some, with a little noise.
   subroutine add_difference(stream, difference, reach, u, moved)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: difference(:), u(:)
      !> Of the steps, 1 in coordinates in which the density is normal.
      real(wp), intent(in) :: reach
      !> (dimension).
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
      call step_length(n, reach, stream, length)
      moved = u
      do i = 1, size(u)
         if (.not. changed(i)) cycle
         call stream%normal(z)
         moved(i) = u(i) + length*difference(i) + noise*z
      end do
   end subroutine add_difference

   !> Factor of a difference of two points: ter Braak's, now and then one, or shorter.
   subroutine step_length(n, reach, stream, length)
      integer, intent(in) :: n
      real(wp), intent(in) :: reach
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: length
      real(wp) :: v

      call stream%uniform(v)
      length = reach*2.38_wp/sqrt(2.0_wp*n)
      if (v < 0.15_wp) length = 1.0_wp
      if (v > 0.75_wp) length = 0.35_wp*length
   end subroutine step_length

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
end module ensemble_evolution
