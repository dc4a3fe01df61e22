!> How an ensemble of points finds a posterior: the burn-in of the ensemble sampler.
!>
!> Rounds that cool, and warm a little for the tails. Between them points are drawn anew by their
!> weights at the next temperature, which is chosen so that enough of them are left (sequential
!> Monte Carlo, Del Moral et al., J. R. Stat. Soc. B 68, 411, 2006): what lags behind goes. Within
!> them there is differential evolution (ter Braak, Stat. Comput. 16, 239, 2006) in the target's
!> working coordinates, whitened round after round: principal axes, and a polynomial of the longer
!> ones taken off the shorter ones.
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

   !> From here on ensembles are larger.
   integer, parameter :: many_dimensions = 6

contains

   !> A population from the target's starts, in rounds that cool, then some at the density itself,
   !> and warmer ones for the tails. The archive is what the last one visited, thinned, in whitened
   !> coordinates.
   subroutine evolve_population(target, evaluations, stream, whitening, step_scale, &
      & archive, started)
      class(target_type), intent(in), target :: target
      !> Of the density, about.
      integer(i8), intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      type(whitening_type), intent(out) :: whitening
      !> Of steps along differences, 1 in coordinates in which the density is normal.
      real(wp), intent(out) :: step_scale
      !> (dimension, point).
      real(wp), allocatable, intent(out) :: archive(:, :)
      !> Whether a point of the support was found; if so, and no stop is requested, there is an
      !> archive.
      logical, intent(out) :: started
      !> Rounds among which the evaluations are divided, those that cool, which are shorter,
      !> counting as five; and most that cool.
      integer, parameter :: rounds = 10, shorter = 4, most_cooling = 40, tail_effort = 20
      class(target_type), allocatable, target :: coarse
      class(target_type), pointer :: other, used
      real(wp), allocatable :: points(:, :), density(:)
      real(wp) :: last_temperatures(5), warm, inverse, next
      integer :: m, cooling, distinct, round, i
      integer(i8) :: generations

      ! Warm enough that a mixture fitted to the last round covers tails as long as those of the
      ! default prior, which a chain may enter once and then not leave; with many constants less,
      ! since ever fewer of its points would be of use.
      warm = min(3.5_wp, max(1.5_wp, 1.0_wp + 10.0_wp/target%dimension))
      last_temperatures = [1.0_wp, 1.0_wp, 1.0_wp, max(1.5_wp, 0.5_wp*(1.0_wp + warm)), warm]
      ! Large ensembles find the tails on the way down.
      if (target%dimension >= many_dimensions) last_temperatures = warm
      step_scale = 1.0_wp
      m = 40*target%dimension
      cooling = merge(m, 4*m, target%dimension >= many_dimensions)
      call draw_population(target, 4*cooling, stream, points, density)
      started = size(density) > 0
      if (.not. started) return
      m = min(m, size(density))
      allocate (coarse, source=target)
      call coarse%coarsen()
      used => target
      other => coarse
      inverse = 0.0_wp
      do round = 1, most_cooling
         next = 1.0_wp/last_temperatures(1)
         if (round < most_cooling) next = min(next, next_inverse(density, inverse))
         call resample(stream, (next - inverse)*density, points, density, distinct)
         inverse = next
         call look_again(target, other, 1.0_wp/inverse, min(distinct, 4*m), stream, points, &
            & density, whitening, used)
         generations = evaluations/(m*rounds)
         call step_population(used, 1.0_wp/inverse, cooling, generations/shorter, stream, &
            & whitening, step_scale, points, density, distinct)
         if (inverse >= 1.0_wp/last_temperatures(1) .or. stop_requested()) exit
      end do
      do round = 1, size(last_temperatures)
         if (stop_requested()) return
         ! Those that cool were half of the evaluations.
         call advance_progress(evaluations/(target%dimension*merge(2, rounds, round == 1)))
         call look_again(target, other, last_temperatures(round), min(distinct, 4*m), stream, &
            & points, density, whitening, used)
         ! The way into a long tail is long.
         generations = evaluations/(m*rounds)*merge(tail_effort/count(last_temperatures > 1.0_wp), &
            & 1, last_temperatures(round) > 1.0_wp)
         call step_population(used, last_temperatures(round), m, generations, stream, whitening, &
            & step_scale, points, density, distinct)
      end do
      ! Its polynomials hold as far as the points go.
      if (target%dimension < many_dimensions) then
         call fit_whitening(points, min(distinct, 4*m), whitening)
      end if
      archive = points
      do i = 1, size(points, 2)
         call whitening%to_white(points(:, i), archive(:, i))
      end do
   end subroutine evolve_population

   !> Points of the support from the target's starts, in working coordinates.
   subroutine draw_population(target, wanted, stream, points, density)
      class(target_type), intent(in) :: target
      integer, intent(in) :: wanted
      type(random_stream_type), intent(inout) :: stream
      !> (dimension, point), and their logarithms of the density; there may be fewer than are
      !> `wanted`.
      real(wp), allocatable, intent(out) :: points(:, :), density(:)
      integer :: found
      real(wp), allocatable :: starts(:, :)

      allocate (starts(target%dimension, wanted), density(wanted))
      call draw_starts(target, stream, starts, density, found)
      allocate (points(target%dimension, found))
      call target%to_working(starts(:, :found), points)
      call target%evaluate_working(points, density)
   end subroutine draw_population

   !> The density that is used and the whitened coordinates from points, and these drawn anew where
   !> that changes their density: where the coarse one was wrong, some have gone astray.
   subroutine look_again(target, coarse, temperature, distinct, stream, points, density, &
      & whitening, used)
      !> The density; and one that costs less, for where it is about the same.
      class(target_type), intent(in), target :: target, coarse
      !> Divides the logarithm of the density.
      real(wp), intent(in) :: temperature
      !> How many of the points are not copies.
      integer, intent(in) :: distinct
      type(random_stream_type), intent(inout) :: stream
      !> Working coordinates (dimension, point), and the logarithms of the density that was used,
      !> then of that which is.
      real(wp), intent(inout) :: points(:, :), density(:)
      type(whitening_type), intent(inout) :: whitening
      !> One of the two.
      class(target_type), pointer, intent(inout) :: used
      real(wp) :: before(size(density))
      integer :: left
      logical :: was_exact

      was_exact = associated(used, target)
      used => target
      if (agree(target, coarse, points, temperature)) used => coarse
      call fit_whitening(points, min(distinct, size(density)), whitening)
      if (was_exact .or. associated(used, coarse)) return
      before = density
      call used%evaluate_working(points, density)
      call resample(stream, (density - before)/temperature, points, density, left)
   end subroutine look_again

   !> Whether the logarithm of another density hardly errs by two temperatures at some of the
   !> points.
   logical function agree(target, other, points, temperature)
      class(target_type), intent(in) :: target, other
      !> (dimension, point).
      real(wp), intent(in) :: points(:, :)
      real(wp), intent(in) :: temperature
      !> Points of the test, and the share of them that agrees.
      integer, parameter :: tests = 50
      real(wp), parameter :: least_good = 0.7_wp
      real(wp) :: w(size(points, 1), tests), exact(tests), near(tests)
      integer :: k

      w = points(:, [(1 + (k - 1)*(size(points, 2) - 1)/tests, k=1, tests)])
      call target%evaluate_working(w, exact)
      call other%evaluate_working(w, near)
      agree = count(abs(exact - near) < 2.0_wp*temperature) >= least_good*tests
   end function agree

   !> Differential evolution of walkers that begin at some of the points; in the end these are what
   !> was visited in the second half.
   subroutine step_population(target, temperature, m, wanted, stream, whitening, step_scale, &
      & points, density, distinct)
      class(target_type), intent(in) :: target
      real(wp), intent(in) :: temperature
      !> Number of walkers.
      integer, intent(in) :: m
      !> Generations, four at least.
      integer(i8), intent(in) :: wanted
      type(random_stream_type), intent(inout) :: stream
      type(whitening_type), intent(in) :: whitening
      real(wp), intent(inout) :: step_scale
      !> Working coordinates (dimension, point), and their logarithms of the density.
      real(wp), allocatable, intent(inout) :: points(:, :), density(:)
      !> How many of the points are not copies, if no walker's are left out.
      integer, intent(out) :: distinct
      !> Points that are kept, about; share of the steps that is aimed at; and how short they may
      !> get.
      integer, parameter :: most = 4000
      real(wp), parameter :: accepted_share = 0.2_wp, least_scale = 0.02_wp
      !> The walkers, in working and whitened coordinates, and what they try, with the logarithms of
      !> their densities.
      real(wp), dimension(target%dimension, m) :: w, u, tried, tried_u
      real(wp) :: own(m), of_tried(m)
      integer :: k, a, b, kept, moved, half, first, last, others
      integer(i8) :: generations, generation, visits, stride, i

      w = points(:, [(1 + int((k - 1)*size(density, kind=i8)/m), k=1, m)])
      call target%evaluate_working(w, own)
      do k = 1, m
         call whitening%to_white(w(:, k), u(:, k))
      end do
      generations = max(4_i8, wanted)
      ! All walkers are to be among the points: no common divisor.
      stride = max(1_i8, ((generations - generations/2)*m + most - 1)/most)
      do while (any([(mod(stride, i) == 0 .and. mod(int(m, i8), i) == 0, i=2, m)]))
         stride = stride + 1
      end do
      visits = (generations - generations/2)*m
      deallocate (points, density)
      allocate (points(target%dimension, (visits + stride - 1)/stride), &
         & density((visits + stride - 1)/stride))
      visits = 0
      kept = 0
      distinct = 0
      do generation = 1, generations
         if (stop_requested()) return
         moved = 0
         ! One half moves along differences of the other: all proposals of a half are known before
         ! any is judged.
         do half = 0, 1
            first = 1 + half*(m/2)
            last = merge(m/2, m, half == 0)
            others = max(1, m - (last - first + 1))
            do k = first, last
               do
                  call stream%pick(others, a)
                  call stream%pick(others, b)
                  if (a /= b .or. others == 1) exit
               end do
               a = mod(last + a - 1, m) + 1
               b = mod(last + b - 1, m) + 1
               call add_difference(stream, u(:, a) - u(:, b), step_scale, u(:, k), tried_u(:, k))
               call whitening%from_white(tried_u(:, k), tried(:, k))
            end do
            call target%evaluate_working(tried(:, first:last), of_tried(first:last))
            do k = first, last
               if (.not. is_accepted(stream, of_tried(k), own(k), temperature)) cycle
               w(:, k) = tried(:, k)
               u(:, k) = tried_u(:, k)
               own(k) = of_tried(k)
               moved = moved + 1
            end do
         end do
         if (2*generation > generations) distinct = distinct + moved
         do k = 1, m
            if (2*generation <= generations) exit
            if (mod(visits, stride) == 0) then
               kept = kept + 1
               points(:, kept) = w(:, k)
               density(kept) = own(k)
            end if
            visits = visits + 1
         end do
         step_scale = min(1.0_wp, &
            & max(least_scale, step_scale*exp(0.5_wp*(real(moved, wp)/m - accepted_share))))
      end do
   end subroutine step_population

   !> The inverse of a temperature, 1 at most, so low that points drawn with another inverse are
   !> still of use when weighted for it.
   pure real(wp) function next_inverse(density, inverse) result(next)
      !> Logarithms.
      real(wp), intent(in) :: density(:)
      real(wp), intent(in) :: inverse
      !> Effective share of the points, copies counted once: those of one point would pass for many,
      !> and it would take over.
      real(wp), parameter :: share = 0.25_wp
      real(wp), dimension(size(density)) :: values, copies, weights
      real(wp) :: least, step
      integer :: order(size(density)), i, n

      call sort_order(density, order)
      n = 0
      do i = 1, size(density)
         if (i == 1 .or. density(order(i)) > density(order(max(1, i - 1)))) then
            n = n + 1
            values(n) = density(order(i))
            copies(n) = 0.0_wp
         end if
         copies(n) = copies(n) + 1.0_wp
      end do
      least = log(1.0e-12_wp)
      step = log(1.0_wp - inverse)
      next = 1.0_wp
      do i = 1, 40
         weights(:n) = copies(:n)*exp((next - inverse)*(values(:n) - values(n)))
         if (sum(weights(:n))**2 >= share*n*sum(weights(:n)**2)) then
            if (i == 1) return
            least = log(next - inverse)
         else
            step = log(next - inverse)
         end if
         next = inverse + exp(0.5_wp*(least + step))
      end do
   end function next_inverse

   !> Points drawn anew by their weights, all at even distances of the sum of weights, in place.
   subroutine resample(stream, log_weights, points, density, distinct)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: log_weights(:)
      !> (dimension, point).
      real(wp), intent(inout) :: points(:, :)
      real(wp), intent(inout) :: density(:)
      !> How many different ones are left.
      integer, intent(out) :: distinct
      real(wp) :: summed(size(density)), v
      integer :: chosen(size(density)), i, k

      summed = exp(log_weights - maxval(log_weights))
      ! Truncated (Ionides, J. Comput. Graph. Stat. 17, 295, 2008), so that a few points do not take
      ! over.
      summed = min(summed, sum(summed)/sqrt(real(size(summed), wp)))
      do i = 2, size(summed)
         summed(i) = summed(i - 1) + summed(i)
      end do
      call stream%uniform(v)
      i = 1
      distinct = 1
      do k = 1, size(chosen)
         do while (i < size(chosen) .and. summed(i) < (k - 1 + v)/size(chosen)*summed(size(summed)))
            i = i + 1
         end do
         chosen(k) = i
         if (k > 1) distinct = distinct + merge(1, 0, chosen(k) > chosen(max(1, k - 1)))
      end do
      points = points(:, chosen)
      density = density(chosen)
   end subroutine resample

   !> Whether a Metropolis step is taken.
   logical function is_accepted(stream, proposed, current, temperature)
      type(random_stream_type), intent(inout) :: stream
      !> Logarithms of the density, and what divides them.
      real(wp), intent(in) :: proposed, current, temperature
      real(wp) :: v

      is_accepted = proposed > outside
      if (.not. is_accepted) return
      call stream%uniform(v)
      is_accepted = log(v) < (proposed - current)/temperature
   end function is_accepted

   !> u plus a factor times a difference of two points, of all coordinates or of some, with a little
   !> noise.
   subroutine add_difference(stream, difference, scale, u, moved)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: difference(:), u(:)
      !> Of the steps, 1 in coordinates in which the density is normal.
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
      ! Ter Braak's factor, now and then one, or shorter.
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
