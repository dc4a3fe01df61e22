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
   use abstract_sampler, only: draw_starts, target_type
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use moves, only: difference_move_type, is_accepted, new_points, points_type
   use random, only: random_stream_type
   use ridge_coordinates, only: fit_whitening, whitening_type
   use statistics, only: sort_order
   implicit none
   private
   public :: population_type, evolve_population, many_dimensions, next_inverse

   !> Points that walkers visited. Their whitened coordinates are set when the evolution ends.
   type, extends(points_type) :: population_type
      !> Number of distinct points before thinning.
      integer :: distinct = 0
      !> Number of walkers of the last rounds.
      integer :: walkers = 1
      type(whitening_type) :: whitening
      !> Move of the walkers in whitened coordinates.
      type(difference_move_type) :: move
      !> It divides the logarithm of the density.
      real(wp) :: temperature = 1.0_wp
      !> The exact density; and a cheaper one, nearly equal where the density is high, and whether
      !> it is used.
      class(target_type), pointer, private :: exact => null()
      class(target_type), allocatable, private :: coarse
      logical :: is_coarse = .false.
   contains
      procedure :: start_walkers, propose => propose_along
      procedure, private :: start, whiten, choose_density, evaluate, step, move_walkers, resample
   end type population_type

   !> Number of parameters from which on ensembles are larger.
   integer, parameter :: many_dimensions = 6

contains

   !> Evolve a population from the target's starts: rounds of falling temperature, rounds at the
   !> density itself, and warmer rounds for the tails. The population is then that of the last
   !> round, thinned.
   subroutine evolve_population(target, evaluations, stream, population)
      class(target_type), intent(in), target :: target
      !> Approximate number of evaluations of the density.
      integer(i8), intent(in) :: evaluations
      type(random_stream_type), intent(inout) :: stream
      !> It has no points if none of the support was found, and is complete if no stop is requested.
      type(population_type), intent(out) :: population
      !> The evaluations are divided by `rounds`: all cooling rounds together count as five. A
      !> cooling round has a share smaller by `cooling_divisor`; there are at most `most_cooling` of
      !> them. All warm rounds together have `tail_effort` shares.
      integer, parameter :: rounds = 10, cooling_divisor = 4, most_cooling = 40, tail_effort = 20
      real(wp) :: last_temperatures(5), warm, inverse, next
      integer :: cooling_walkers, round, i
      integer(i8) :: generations

      ! At the warm temperature a mixture fitted to the last round covers tails as long as those of
      ! the default prior. Otherwise a chain may enter such a tail once and not leave it. With many
      ! parameters the temperature is lower, since fewer of the points would be useful.
      warm = min(3.5_wp, max(1.5_wp, 1.0_wp + 10.0_wp/target%dimension))
      last_temperatures = [1.0_wp, 1.0_wp, 1.0_wp, max(1.5_wp, 0.5_wp*(1.0_wp + warm)), warm]
      ! Large ensembles find the tails while they cool.
      if (target%dimension >= many_dimensions) last_temperatures = warm
      ! More walkers while cooling.
      population%walkers = 40*target%dimension
      cooling_walkers = population%walkers
      if (target%dimension < many_dimensions) cooling_walkers = 2*cooling_walkers
      call population%start(target, stream, 4*cooling_walkers)
      if (size(population%log_density) == 0) return
      generations = evaluations/(population%walkers*rounds)
      inverse = 0.0_wp
      do round = 1, most_cooling
         next = 1.0_wp/last_temperatures(1)
         if (round < most_cooling) next = min(next, next_inverse(population%log_density, inverse))
         call population%resample(stream, (next - inverse)*population%log_density)
         inverse = next
         population%temperature = 1.0_wp/inverse
         call population%choose_density(stream)
         call population%step(cooling_walkers, generations/cooling_divisor, stream)
         if (inverse >= 1.0_wp/last_temperatures(1) .or. stop_requested()) exit
      end do
      do round = 1, size(last_temperatures)
         if (stop_requested()) return
         ! The cooling rounds were half of the evaluations.
         call advance_progress(evaluations/(target%dimension*merge(2, rounds, round == 1)))
         population%temperature = last_temperatures(round)
         call population%choose_density(stream)
         ! Walkers need many steps to reach the end of a long tail.
         call population%step(population%walkers, generations*merge(tail_effort &
            & /count(last_temperatures > 1.0_wp), 1, population%temperature > 1.0_wp), stream)
      end do
      deallocate (population%coarse)
      ! The polynomials of the whitening hold only over the range of the points: fit them to the
      ! last ones.
      if (target%dimension < many_dimensions) call population%whiten()
      do i = 1, size(population%u, 2)
         call population%whitening%to_white(population%w(:, i), population%u(:, i))
      end do
   end subroutine evolve_population

   !> Draw points from the target's starts.
   subroutine start(self, target, stream, n)
      class(population_type), intent(inout) :: self
      class(target_type), intent(in), target :: target
      type(random_stream_type), intent(inout) :: stream
      !> Number of points that are asked for.
      integer, intent(in) :: n
      real(wp), allocatable :: starts(:, :)
      integer :: n_found

      allocate (self%w(target%dimension, n), self%log_density(n))
      call draw_starts(target, stream, self%w, self%log_density, n_found)
      starts = self%w(:, :n_found)
      self%w = starts
      self%log_density = self%log_density(:n_found)
      if (n_found == 0) return
      self%exact => target
      allocate (self%coarse, source=target)
      call self%coarse%coarsen()
      call target%to_working(starts, self%w)
      call target%evaluate_working(self%w, self%log_density)
      self%walkers = min(self%walkers, n_found)
   end subroutine start

   !> Fit the whitening to the points.
   subroutine whiten(self)
      class(population_type), intent(inout) :: self

      call fit_whitening(self%w, min(self%distinct, 4*self%walkers, size(self%log_density)), &
         & self%whitening)
   end subroutine whiten

   !> Choose between the exact and the coarse density, and fit the whitening. Where the exact
   !> density replaces the coarse one, resample the points: the coarse one may have led some astray.
   subroutine choose_density(self, stream)
      class(population_type), intent(inout) :: self
      type(random_stream_type), intent(inout) :: stream
      !> Number of test points, and the share of them at which the logarithm of the coarse density
      !> must err by less than two temperatures.
      integer, parameter :: n_tests = 50
      real(wp), parameter :: least_share = 0.7_wp
      real(wp) :: old_density(size(self%log_density)), w(size(self%w, 1), n_tests), &
         & exact(n_tests), approximate(n_tests)
      integer :: k
      logical :: was_coarse

      was_coarse = self%is_coarse
      w = self%w(:, [(1 + (k - 1)*(size(self%w, 2) - 1)/n_tests, k=1, n_tests)])
      call self%exact%evaluate_working(w, exact)
      call self%coarse%evaluate_working(w, approximate)
      self%is_coarse &
         & = count(abs(exact - approximate) < 2.0_wp*self%temperature) >= least_share*n_tests
      call self%whiten()
      if (self%is_coarse .or. .not. was_coarse) return
      old_density = self%log_density
      call self%exact%evaluate_working(self%w, self%log_density)
      call self%resample(stream, (self%log_density - old_density)/self%temperature)
   end subroutine choose_density

   !> Logarithm of the density that is used.
   subroutine evaluate(self, w, log_density)
      class(population_type), intent(in) :: self
      !> Working coordinates, (dimension, point).
      real(wp), intent(in), contiguous :: w(:, :)
      real(wp), intent(out) :: log_density(:)

      if (self%is_coarse) then
         call self%coarse%evaluate_working(w, log_density)
      else
         call self%exact%evaluate_working(w, log_density)
      end if
   end subroutine evaluate

   !> Move walkers that start from some of the points by differential evolution. The points are then
   !> those visited in the second half of the generations.
   subroutine step(self, m, wanted, stream)
      class(population_type), intent(inout) :: self
      !> Number of walkers.
      integer, intent(in) :: m
      !> Number of generations; at least four are made.
      integer(i8), intent(in) :: wanted
      type(random_stream_type), intent(inout) :: stream
      !> Approximate number of retained points.
      integer, parameter :: most_points = 4000
      type(points_type) :: walkers, retained
      integer :: k, n_retained, accepted
      integer(i8) :: generations, generation, visits, stride, i

      walkers = new_points(size(self%w, 1), m)
      do k = 1, m
         walkers%w(:, k) = self%w(:, 1 + int((k - 1)*size(self%log_density, kind=i8)/m))
         call self%whitening%to_white(walkers%w(:, k), walkers%u(:, k))
      end do
      call self%evaluate(walkers%w, walkers%log_density)
      generations = max(4_i8, wanted)
      ! The stride has no common divisor with the number of walkers, so that every walker is among
      ! the points.
      visits = (generations - generations/2)*m
      stride = max(1_i8, (visits + most_points - 1)/most_points)
      do while (any([(mod(stride, i) == 0 .and. mod(int(m, i8), i) == 0, i=2, m)]))
         stride = stride + 1
      end do
      retained = new_points(size(self%w, 1), int((visits + stride - 1)/stride))
      visits = 0
      n_retained = 0
      self%distinct = 0
      do generation = 1, generations
         if (stop_requested()) return
         accepted = 0
         call self%move_walkers(1, m/2, stream, walkers, accepted)
         call self%move_walkers(m/2 + 1, m, stream, walkers, accepted)
         if (2*generation > generations) then
            self%distinct = self%distinct + accepted
            do k = 1, m
               if (mod(visits, stride) == 0) then
                  n_retained = n_retained + 1
                  call retained%set(n_retained, walkers, k)
               end if
               visits = visits + 1
            end do
         end if
         call self%move%tune(real(accepted, wp)/m)
      end do
      self%points_type = retained
   end subroutine step

   !> Move half of the walkers along differences of the other half, so that all proposals are
   !> evaluated in one call before any of them is accepted.
   subroutine move_walkers(self, first, last, stream, walkers, accepted)
      class(population_type), intent(in) :: self
      !> Numbers of the first and the last walker of the half.
      integer, intent(in) :: first, last
      type(random_stream_type), intent(inout) :: stream
      type(points_type), intent(inout) :: walkers
      !> It grows by the number of accepted moves.
      integer, intent(inout) :: accepted
      type(points_type) :: proposed
      integer :: k, a, b, m, n_others

      proposed = walkers
      m = size(walkers%log_density)
      n_others = max(1, m - (last - first + 1))
      do k = first, last
         do
            call stream%pick(n_others, a)
            call stream%pick(n_others, b)
            if (a /= b .or. n_others == 1) exit
         end do
         a = mod(last + a - 1, m) + 1
         b = mod(last + b - 1, m) + 1
         call self%move%propose(stream, walkers%u(:, a) - walkers%u(:, b), walkers%u(:, k), &
            & proposed%u(:, k))
         call self%whitening%from_white(proposed%u(:, k), proposed%w(:, k))
      end do
      call self%evaluate(proposed%w(:, first:last), proposed%log_density(first:last))
      do k = first, last
         if (.not. is_accepted(stream, proposed%log_density(k), walkers%log_density(k), &
            & self%temperature)) then
            cycle
         end if
         call walkers%set(k, proposed, k)
         accepted = accepted + 1
      end do
   end subroutine move_walkers

   !> Start walkers at points that are drawn by their weights at the temperature 1.
   subroutine start_walkers(self, stream, walkers)
      class(population_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> Their densities are not set.
      type(points_type), intent(inout) :: walkers
      type(population_type) :: cold
      integer :: k

      cold = self
      call cold%resample(stream, (1.0_wp - 1.0_wp/self%temperature)*self%log_density)
      do k = 1, size(walkers%w, 2)
         walkers%w(:, k) = cold%w(:, 1 + (k - 1)*size(cold%w, 2)/size(walkers%w, 2))
         call self%whitening%to_white(walkers%w(:, k), walkers%u(:, k))
      end do
   end subroutine start_walkers

   !> Move a point along the difference of two others, in whitened coordinates.
   subroutine propose_along(self, stream, u, moved)
      class(population_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> (dimension).
      real(wp), intent(in) :: u(:)
      real(wp), intent(out) :: moved(:)
      integer :: a, b

      call stream%pick(size(self%u, 2), a)
      call stream%pick(size(self%u, 2), b)
      call self%move%propose(stream, self%u(:, a) - self%u(:, b), u, moved)
   end subroutine propose_along

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
   subroutine resample(self, stream, log_weights)
      class(population_type), intent(inout) :: self
      type(random_stream_type), intent(inout) :: stream
      !> (point).
      real(wp), intent(in) :: log_weights(:)
      real(wp) :: cumulated(size(log_weights)), v
      integer :: chosen(size(log_weights)), i, k

      cumulated = exp(log_weights - maxval(log_weights))
      ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep a few points from
      ! dominating.
      cumulated = min(cumulated, sum(cumulated)/sqrt(real(size(cumulated), wp)))
      do i = 2, size(cumulated)
         cumulated(i) = cumulated(i - 1) + cumulated(i)
      end do
      call stream%uniform(v)
      i = 1
      self%distinct = 1
      do k = 1, size(chosen)
         do while (i < size(chosen) &
            & .and. cumulated(i) < (k - 1 + v)/size(chosen)*cumulated(size(cumulated)))
            i = i + 1
         end do
         chosen(k) = i
         if (chosen(k) > chosen(max(1, k - 1))) self%distinct = self%distinct + 1
      end do
      self%w = self%w(:, chosen)
      self%log_density = self%log_density(chosen)
   end subroutine resample
end module ensemble_evolution
