!> The burn-in of the ensemble sampler: an ensemble of points finds the posterior.
!>
!> The temperature falls from round to round. At the end it rises a little, so that the tails are
!> visited. Between rounds the points are resampled by their weights at the next temperature, which
!> removes points that lag behind (sequential Monte Carlo, Del Moral et al., J. R. Stat. Soc. B 68,
!> 411, 2006). The next temperature is chosen so that enough effective points are left. Within a
!> round walkers move by differential evolution (ter Braak, Stat. Comput. 16, 239, 2006) in the
!> target's working coordinates. These are whitened in every round: principal axes, and for each
!> shorter axis a polynomial of the longer ones is subtracted.
module ensemble_evolution
   use abstract_sampler, only: draw_starts, outside, target_type
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use random, only: random_stream_type
   use ridge_coordinates, only: fit_whitening, whitening_type
   use statistics, only: sort_order
   implicit none
   private
   public :: evolve_population, is_accepted, add_difference, next_inverse

   !> Number of parameters from which on ensembles are larger.
   integer, parameter :: many_dimensions = 6

contains

   !> Evolve a population from the target's starts: rounds of falling temperature, rounds at the
   !> density itself, and warmer rounds for the tails. The archive holds the points of the last
   !> round, thinned, in whitened coordinates.
   subroutine evolve_population(target, evaluations, stream, whitening, step_scale, &
      & archive, started)
      class(target_type), intent(in), target :: target
      !> Approximate number of evaluations of the density.
      integer(i8), intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      type(whitening_type), intent(out) :: whitening
      !> Factor of the steps along differences; 1 suits coordinates in which the density is normal.
      real(wp), intent(out) :: step_scale
      !> (dimension, point).
      real(wp), allocatable, intent(out) :: archive(:, :)
      !> Whether a point of the support was found. If so, and if no stop is requested, the archive
      !> is allocated.
      logical, intent(out) :: started
      !> The evaluations are divided by `rounds`: all cooling rounds together count as five. A
      !> cooling round has a share smaller by `cooling_divisor`; there are at most `most_cooling` of
      !> them. All warm rounds together have `tail_effort` shares.
      integer, parameter :: rounds = 10, cooling_divisor = 4, most_cooling = 40, tail_effort = 20
      class(target_type), allocatable, target :: coarse
      class(target_type), pointer :: used
      !> Points in working coordinates, (dimension, point), and the logarithms of their density.
      real(wp), allocatable :: points(:, :), density(:)
      real(wp), allocatable :: starts(:, :)
      real(wp) :: last_temperatures(5), warm, inverse, next
      integer :: m, cooling_walkers, n_found, distinct, round, i
      integer(i8) :: generations

      ! At the warm temperature a mixture fitted to the last round covers tails as long as those of
      ! the default prior. Otherwise a chain may enter such a tail once and not leave it. With many
      ! parameters the temperature is lower, since fewer of the points would be useful.
      warm = min(3.5_wp, max(1.5_wp, 1.0_wp + 10.0_wp/target%dimension))
      last_temperatures = [1.0_wp, 1.0_wp, 1.0_wp, max(1.5_wp, 0.5_wp*(1.0_wp + warm)), warm]
      ! Large ensembles find the tails while they cool.
      if (target%dimension >= many_dimensions) last_temperatures = warm
      step_scale = 1.0_wp
      ! Numbers of walkers; more while cooling.
      m = 40*target%dimension
      cooling_walkers = merge(m, 4*m, target%dimension >= many_dimensions)
      allocate (starts(target%dimension, 4*cooling_walkers), density(4*cooling_walkers))
      call draw_starts(target, stream, starts, density, n_found)
      started = n_found > 0
      if (.not. started) return
      density = density(:n_found)
      allocate (points(target%dimension, n_found))
      call target%to_working(starts(:, :n_found), points)
      call target%evaluate_working(points, density)
      m = min(m, size(density))
      allocate (coarse, source=target)
      call coarse%coarsen()
      used => target
      inverse = 0.0_wp
      do round = 1, most_cooling
         next = 1.0_wp/last_temperatures(1)
         if (round < most_cooling) next = min(next, next_inverse(density, inverse))
         call resample(stream, (next - inverse)*density, points, density, distinct)
         inverse = next
         call choose_density(target, coarse, 1.0_wp/inverse, min(distinct, 4*m), stream, points, &
            & density, whitening, used)
         generations = evaluations/(m*rounds)
         call step_population(used, 1.0_wp/inverse, cooling_walkers, generations/cooling_divisor, &
            & stream, whitening, step_scale, points, density, distinct)
         if (inverse >= 1.0_wp/last_temperatures(1) .or. stop_requested()) exit
      end do
      do round = 1, size(last_temperatures)
         if (stop_requested()) return
         ! The cooling rounds were half of the evaluations.
         call advance_progress(evaluations/(target%dimension*merge(2, rounds, round == 1)))
         call choose_density(target, coarse, last_temperatures(round), min(distinct, 4*m), stream, &
            & points, density, whitening, used)
         ! Walkers need many steps to reach the end of a long tail.
         generations = evaluations/(m*rounds)*merge(tail_effort/count(last_temperatures > 1.0_wp), &
            & 1, last_temperatures(round) > 1.0_wp)
         call step_population(used, last_temperatures(round), m, generations, stream, whitening, &
            & step_scale, points, density, distinct)
      end do
      ! The polynomials of the whitening hold only over the range of the points: fit them to the
      ! last ones.
      if (target%dimension < many_dimensions) then
         call fit_whitening(points, min(distinct, 4*m), whitening)
      end if
      archive = points
      do i = 1, size(points, 2)
         call whitening%to_white(points(:, i), archive(:, i))
      end do
   end subroutine evolve_population

   !> Choose between the exact and the coarse density, and fit the whitening to the points. Where
   !> the exact density replaces the coarse one, resample the points: the coarse one may have led
   !> some astray.
   subroutine choose_density(target, coarse, temperature, distinct, stream, points, density, &
      & whitening, used)
      !> The exact density; and a cheaper one, nearly equal where the density is high.
      class(target_type), intent(in), target :: target, coarse
      !> Temperature, which divides the logarithm of the density.
      real(wp), intent(in) :: temperature
      !> Number of distinct points.
      integer, intent(in) :: distinct
      type(random_stream_type), intent(inout) :: stream
      !> Working coordinates, (dimension, point), and the logarithms of the density: of the one used
      !> before on entry, of the chosen one on return.
      real(wp), intent(inout) :: points(:, :), density(:)
      type(whitening_type), intent(inout) :: whitening
      !> The chosen density, one of the two.
      class(target_type), pointer, intent(inout) :: used
      !> Number of test points, and the share of them at which the logarithm of the coarse density
      !> must err by less than two temperatures.
      integer, parameter :: n_tests = 50
      real(wp), parameter :: least_share = 0.7_wp
      real(wp) :: old_density(size(density)), w(size(points, 1), n_tests), exact(n_tests), &
         & approximate(n_tests)
      integer :: n_distinct, k
      logical :: was_exact

      was_exact = associated(used, target)
      used => target
      w = points(:, [(1 + (k - 1)*(size(points, 2) - 1)/n_tests, k=1, n_tests)])
      call target%evaluate_working(w, exact)
      call coarse%evaluate_working(w, approximate)
      if (count(abs(exact - approximate) < 2.0_wp*temperature) >= least_share*n_tests) then
         used => coarse
      end if
      call fit_whitening(points, min(distinct, size(density)), whitening)
      if (was_exact .or. associated(used, coarse)) return
      old_density = density
      call used%evaluate_working(points, density)
      call resample(stream, (density - old_density)/temperature, points, density, n_distinct)
   end subroutine choose_density

   !> Differential evolution of walkers that start from some of the points. On return the points are
   !> those visited in the second half of the generations.
   subroutine step_population(target, temperature, m, wanted, stream, whitening, step_scale, &
      & points, density, distinct)
      class(target_type), intent(in) :: target
      real(wp), intent(in) :: temperature
      !> Number of walkers.
      integer, intent(in) :: m
      !> Number of generations; at least four are made.
      integer(i8), intent(in) :: wanted
      type(random_stream_type), intent(inout) :: stream
      type(whitening_type), intent(in) :: whitening
      real(wp), intent(inout) :: step_scale
      !> Working coordinates, (dimension, point), and the logarithms of their density.
      real(wp), allocatable, intent(inout) :: points(:, :), density(:)
      !> Number of accepted moves in the second half: the number of distinct points before thinning.
      integer, intent(out) :: distinct
      !> Approximate number of retained points, acceptance to which the steps are tuned, and the
      !> least factor of the steps.
      integer, parameter :: most_points = 4000
      real(wp), parameter :: target_acceptance = 0.2_wp, least_scale = 0.02_wp
      !> Walkers and proposals, in working and whitened coordinates; below, the logarithms of their
      !> densities.
      real(wp), dimension(target%dimension, m) :: w, u, proposed, proposed_u
      real(wp) :: current(m), proposed_density(m)
      integer :: k, a, b, retained, accepted, half, first, last, n_others
      integer(i8) :: generations, generation, visits, stride, i

      w = points(:, [(1 + int((k - 1)*size(density, kind=i8)/m), k=1, m)])
      call target%evaluate_working(w, current)
      do k = 1, m
         call whitening%to_white(w(:, k), u(:, k))
      end do
      generations = max(4_i8, wanted)
      ! The stride has no common divisor with the number of walkers, so that every walker is among
      ! the points.
      visits = (generations - generations/2)*m
      stride = max(1_i8, (visits + most_points - 1)/most_points)
      do while (any([(mod(stride, i) == 0 .and. mod(int(m, i8), i) == 0, i=2, m)]))
         stride = stride + 1
      end do
      deallocate (points, density)
      allocate (points(target%dimension, (visits + stride - 1)/stride), &
         & density((visits + stride - 1)/stride))
      visits = 0
      retained = 0
      distinct = 0
      do generation = 1, generations
         if (stop_requested()) return
         accepted = 0
         ! Each half of the walkers moves along differences of the other half. So all proposals of a
         ! half are evaluated in one call before any of them is accepted.
         do half = 0, 1
            first = 1 + half*(m/2)
            last = merge(m/2, m, half == 0)
            n_others = max(1, m - (last - first + 1))
            do k = first, last
               do
                  call stream%pick(n_others, a)
                  call stream%pick(n_others, b)
                  if (a /= b .or. n_others == 1) exit
               end do
               a = mod(last + a - 1, m) + 1
               b = mod(last + b - 1, m) + 1
               call add_difference(stream, u(:, a) - u(:, b), step_scale, u(:, k), proposed_u(:, k))
               call whitening%from_white(proposed_u(:, k), proposed(:, k))
            end do
            call target%evaluate_working(proposed(:, first:last), proposed_density(first:last))
            do k = first, last
               if (.not. is_accepted(stream, proposed_density(k), current(k), temperature)) cycle
               w(:, k) = proposed(:, k)
               u(:, k) = proposed_u(:, k)
               current(k) = proposed_density(k)
               accepted = accepted + 1
            end do
         end do
         if (2*generation > generations) then
            distinct = distinct + accepted
            do k = 1, m
               if (mod(visits, stride) == 0) then
                  retained = retained + 1
                  points(:, retained) = w(:, k)
                  density(retained) = current(k)
               end if
               visits = visits + 1
            end do
         end if
         step_scale = min(1.0_wp, &
            & max(least_scale, step_scale*exp(0.5_wp*(real(accepted, wp)/m - target_acceptance))))
      end do
   end subroutine step_population

   !> The next inverse temperature, at most 1: the largest one at which the points of the present
   !> one, weighted for it, still have the effective share below.
   pure real(wp) function next_inverse(density, inverse) result(next)
      !> Logarithms of the density of the points, and the present inverse temperature.
      real(wp), intent(in) :: density(:), inverse
      !> Effective share of the points, copies merged into one: otherwise the copies of one point
      !> would count as many, and that point would dominate. A larger share cools more slowly.
      real(wp), parameter :: share = 0.25_wp
      real(wp), dimension(size(density)) :: values, n_copies, weights
      real(wp) :: log_low, log_high
      integer :: order(size(density)), i, n

      call sort_order(density, order)
      n = 0
      do i = 1, size(density)
         if (i == 1 .or. density(order(i)) > density(order(max(1, i - 1)))) then
            n = n + 1
            values(n) = density(order(i))
            n_copies(n) = 0.0_wp
         end if
         n_copies(n) = n_copies(n) + 1.0_wp
      end do
      ! Bisection of the logarithm of the increase.
      log_low = log(1.0e-12_wp)
      log_high = log(1.0_wp - inverse)
      next = 1.0_wp
      do i = 1, 40
         weights(:n) = n_copies(:n)*exp((next - inverse)*(values(:n) - values(n)))
         if (sum(weights(:n))**2 >= share*n*sum(weights(:n)**2)) then
            if (i == 1) return
            log_low = log(next - inverse)
         else
            log_high = log(next - inverse)
         end if
         next = inverse + exp(0.5_wp*(log_low + log_high))
      end do
   end function next_inverse

   !> Resample points by their weights, in place: at equal distances of the cumulated weight.
   subroutine resample(stream, log_weights, points, density, distinct)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: log_weights(:)
      !> (dimension, point).
      real(wp), intent(inout) :: points(:, :)
      real(wp), intent(inout) :: density(:)
      !> Number of distinct points that are left.
      integer, intent(out) :: distinct
      real(wp) :: cumulated(size(density)), v
      integer :: chosen(size(density)), i, k

      cumulated = exp(log_weights - maxval(log_weights))
      ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep a few points from
      ! dominating.
      cumulated = min(cumulated, sum(cumulated)/sqrt(real(size(cumulated), wp)))
      do i = 2, size(cumulated)
         cumulated(i) = cumulated(i - 1) + cumulated(i)
      end do
      call stream%uniform(v)
      i = 1
      distinct = 1
      do k = 1, size(chosen)
         do while (i < size(chosen) &
            & .and. cumulated(i) < (k - 1 + v)/size(chosen)*cumulated(size(cumulated)))
            i = i + 1
         end do
         chosen(k) = i
         if (k > 1) distinct = distinct + merge(1, 0, chosen(k) > chosen(max(1, k - 1)))
      end do
      points = points(:, chosen)
      density = density(chosen)
   end subroutine resample

   !> Whether a Metropolis step is accepted.
   logical function is_accepted(stream, proposed, current, temperature)
      type(random_stream_type), intent(inout) :: stream
      !> Logarithms of the density, and the temperature that divides them.
      real(wp), intent(in) :: proposed, current, temperature
      real(wp) :: v

      is_accepted = proposed > outside
      if (.not. is_accepted) return
      call stream%uniform(v)
      is_accepted = log(v) < (proposed - current)/temperature
   end function is_accepted

   !> Move a point u along a difference of two points, in all coordinates or in some, with a little
   !> noise.
   subroutine add_difference(stream, difference, scale, u, moved)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: difference(:), u(:)
      !> Factor of the step; 1 suits coordinates in which the density is normal.
      real(wp), intent(in) :: scale
      !> (dimension).
      real(wp), intent(out) :: moved(:)
      real(wp), parameter :: noise = 1.0e-5_wp
      real(wp) :: share, v, length, z
      integer :: i
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
      ! The factor is ter Braak's 2.38/sqrt(2 d) for d coordinates. In 15 % of the steps it is 1,
      ! which leads from mode to mode; in 25 % the step is shorter.
      call stream%uniform(v)
      length = scale*2.38_wp/sqrt(2.0_wp*count(changed))
      if (v < 0.15_wp) length = 1.0_wp
      if (v > 0.75_wp) length = 0.35_wp*length
      moved = u
      do i = 1, size(u)
         if (.not. changed(i)) cycle
         call stream%normal(z)
         moved(i) = u(i) + length*difference(i) + noise*z
      end do
   end subroutine add_difference

end module ensemble_evolution
