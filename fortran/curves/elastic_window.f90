!> One test given the shared unknowns: the logarithm of its modulus, summed over where the contact
!> is elastic.
!>
!> Recorded is depth = h0 + d t + C P + h(P) + load zero dh/dP + transient exp(-t/tau) + noise, h(P)
!> of `sphere_contact`. The noise is autoregressive of first order; its correlation from point to
!> point is chosen by the evidence. All but the modulus and the shared unknowns is linear with
!> normal priors, and integrated out by recursive least squares, one pass for each first point of
!> the window, which gives all last points. What is outside of the window has an excess over the
!> elastic curve whose increments have a broad density: a trend that follows them, and jumps, after
!> the window to greater depth alone. Every step from point to point is scored once, by the window
!> or by that density.
module elastic_window
   use kinds, only: pi, wp
   use loading_segment, only: segment_type
   use small_matrices, only: factor_definite, solve_lower, solve_upper
   use sphere_contact, only: contact_at, contact_type
   use statistics, only: median
   use text, only: fixed
   implicit none
   private
   public :: test_type, begin_test, score_test, leave_out, n_shared

   !> Of a test: ln modulus; then the shared ln R, beta and compliance; then h0, drift, load zero
   !> and transient.
   integer, parameter :: n_columns = 8, n_shared = 3, i_radius = 1, i_beta = 2, i_compliance = 3, &
      & own = 1 + n_shared
   !> Correlations of the noise from point to point; 1: a random walk.
   real(wp), parameter :: correlations(7) = [0.0_wp, 0.5_wp, 0.8_wp, 0.9_wp, 0.95_wp, &
      & 0.98_wp, 1.0_wp]
   !> Shares of the last load where a window may begin.
   real(wp), parameter :: beginnings(8) = [0.0_wp, 0.01_wp, 0.02_wp, 0.03_wp, 0.045_wp, 0.07_wp, &
      & 0.1_wp, 0.15_wp]
   !> A window has so many steps, or a third of those of a curve of few points, but no less than the
   !> first; it spans loads of this ratio.
   integer, parameter :: fewest_steps(2) = [5, 7]
   real(wp), parameter :: least_span = 4.0_wp
   !> Windows of a smaller share of the probability do not count.
   real(wp), parameter :: negligible = 1.0e-3_wp

   type :: test_type
      type(segment_type) :: curve
      !> The numbers of its material and its session.
      integer :: material = 0, session = 0
      !> Whether it counts, and why not.
      logical :: used = .true.
      character(len=:), allocatable :: reason
      !> ln of the modulus in GPa about which all is linear; of the modulus given shared unknowns
      !> that differ by s from those: ln_modulus + shift + slope . s, with this variance.
      real(wp) :: ln_modulus = 0.0_wp, shift = 0.0_wp, slope(n_shared) = 0.0_wp, variance = 0.0_wp
      !> Means over windows: first and last load, mN; drift and its sd, nm/s; recorded depth of the
      !> surface, nm.
      real(wp) :: from_load = 0.0_wp, to_load = 0.0_wp, drift = 0.0_wp, drift_sd = 0.0_wp, &
         & zero = 0.0_wp
      !> Share of `variance` that comes from the drift; of the noise: correlation, and sd of the
      !> steps, nm.
      real(wp) :: drift_share = 0.0_wp, correlation = 0.0_wp, noise = 0.0_wp
      !> Depth of the elastic curve, nm, and probability that the contact is elastic there, (point).
      real(wp), allocatable :: fit(:), elastic(:)
      !> Sds of the steps for each correlation.
      real(wp), private :: sigma(size(correlations)) = 0.0_wp
   end type test_type

   !> A test about present values: load, mN, residual and elastic depth, nm, (point), the
   !> derivatives of the depth by all unknowns, (unknown, point), and the prior variances of these.
   type :: linear_type
      real(wp), allocatable :: load(:), residual(:), depth(:), columns(:, :)
      real(wp) :: variances(n_columns) = 0.0_wp
   end type linear_type

   !> An elastic window: its points, its log evidence, and what it says on the unknowns of the test.
   type :: window_type
      integer :: first = 0, last = 0
      real(wp) :: score = -huge(1.0_wp), mean(n_columns) = 0.0_wp, &
         & covariance(n_columns, n_columns) = 0.0_wp
   end type window_type

contains

   !> First values: Hertz through the lower loads, and the noise of second differences.
   subroutine begin_test(test, radius)
      type(test_type), intent(inout) :: test
      !> um.
      real(wp), intent(in) :: radius
      !> sd of a second difference of white noise and of a random walk, in between.
      real(wp), parameter :: spread = 1.6_wp, normal = 1.4826_wp, least = 0.01_wp
      real(wp), allocatable :: x(:), bend(:)
      logical, allocatable :: low(:)
      real(wp) :: slope
      integer :: n

      associate (c => test%curve)
         n = size(c%load)
         x = c%load**(2.0_wp/3.0_wp)
         low = c%load < 0.3_wp*c%load(n) .and. c%load > 0.02_wp*c%load(n)
         if (count(low) < 4) low = c%load > 0.0_wp
         associate (u => pack(x, low), y => pack(c%depth, low))
            slope = sum((u - sum(u)/size(u))*y)/sum((u - sum(u)/size(u))**2)
         end associate
         bend = c%depth - slope*x
         bend = abs(bend(3:) - 2.0_wp*bend(2:n - 1) + bend(:n - 2))
         test%sigma = max(least, normal*median(n - 2, bend)/spread)
      end associate
      if (.not. slope > 0.0_wp) then
         call leave_out(test, 'no elastic part: the depth does not grow with the load')
      end if
      if (test%used) test%ln_modulus = log(0.75_wp/sqrt(radius)*(1.0e3_wp/slope)**1.5_wp)
   end subroutine begin_test

   !> The test about shared unknowns `s` with prior sds `sds`.
   subroutine score_test(test, s, sds, transient)
      type(test_type), intent(inout) :: test
      !> ln R (um), beta, compliance (nm/mN); of these, then of what each test has of its own: h0,
      !> nm, drift, nm/s, load zero, mN, transient, nm; and the time in which the transient decays,
      !> s.
      real(wp), intent(in) :: s(n_shared), sds(n_columns - 1), transient
      !> The elastic curve misses the first contact by so much of the depth.
      real(wp), parameter :: farthest = 0.15_wp
      real(wp) :: evidence, best, off
      real(wp), allocatable :: before(:), after(:), score(:, :), weight(:, :), r(:)
      type(linear_type) :: l
      type(window_type) :: window
      real(wp) :: variances(n_columns, 2*size(beginnings))
      integer :: first(2*size(beginnings)), n, i, k, chosen

      n = size(test%curve%load)
      call linearise(test, s, transient, l)
      first = [((findloc(test%curve%load >= beginnings(k)*test%curve%load(n), .true., 1), k=1, &
         & size(beginnings)), i=1, 2)]
      ! The second half of the windows has no transient.
      variances = spread([1.0_wp, sds**2], 2, size(first))
      variances(n_columns, size(beginnings) + 1:) = 0.0_wp
      associate (steps => l%residual(2:) - l%residual(:n - 1), &
         & rise => l%depth(2:) - l%depth(:n - 1), sigma => test%sigma(size(correlations)))
         before = excess_scores(steps, rise, sigma, .false.)
         after = excess_scores(steps(n - 1:1:-1), rise(n - 1:1:-1), sigma, .true.)
      end associate
      after = after(n:1:-1)
      allocate (score(n, size(first)), weight(n, size(first)))
      best = -huge(1.0_wp)
      chosen = 0
      do i = 1, size(correlations)
         score = -huge(1.0_wp)
         window = window_type()
         do k = 1, size(first)
            if (any(first(:k - 1) == first(k) &
               & .and. variances(n_columns, :k - 1) == variances(n_columns, k))) then
               cycle
            end if
            l%variances = variances(:, k)
            call score_windows(l, correlations(i), test%sigma(i), first(k), &
               & before(first(k)) + after, score(:, k), window)
         end do
         if (window%last == 0) cycle
         evidence = window%score + log(sum(exp(score - window%score)))
         ! The sd of the steps in the windows, drawn to what it was by the weight of two points.
         r = l%residual - matmul(window%mean, l%columns)
         associate (e => r(window%first + 1:window%last) &
            & - correlations(i)*r(window%first:window%last - 1), sigma => test%sigma(i))
            sigma = sqrt((sum(e**2) + 2.0_wp*sigma**2)/(max(1, size(e) - 3) + 2))
         end associate
         if (evidence <= best) cycle
         best = evidence
         chosen = i
         weight = exp(score - evidence)
      end do
      if (chosen == 0) then
         call leave_out(test, 'no elastic part: too few points')
         return
      end if
      test%correlation = correlations(chosen)
      test%noise = test%sigma(chosen)
      call sum_windows(test, s, l, first, variances, weight)
      off = abs(test%curve%depth(1) - test%fit(1))
      if (off > farthest*maxval(l%depth, test%elastic >= 0.5_wp*maxval(test%elastic))) then
         call leave_out(test, 'no elastic part: the contact begins '//fixed(off, 1) &
            & //' nm away from the elastic curve through loads of '//fixed(test%from_load, 1) &
            & //' to '//fixed(test%to_load, 1)//' mN')
      end if
   end subroutine score_test

   !> A test that does not count, and the `reason` why.
   subroutine leave_out(test, reason)
      type(test_type), intent(inout) :: test
      character(len=*), intent(in) :: reason

      test%used = .false.
      test%reason = reason
   end subroutine leave_out

   !> The test about its modulus and the shared unknowns `s`.
   subroutine linearise(test, s, transient, l)
      !> Its `zero` is taken from the residuals.
      type(test_type), intent(inout) :: test
      real(wp), intent(in) :: s(n_shared), transient
      type(linear_type), intent(out) :: l
      type(contact_type), allocatable :: contact(:)
      real(wp) :: modulus

      modulus = exp(test%ln_modulus)
      associate (c => test%curve, n => size(test%curve%load))
         allocate (contact(n), source=contact_at(c%load, modulus, exp(s(i_radius)), s(i_beta)))
         l%load = c%load
         l%depth = 1.0e3_wp*contact%depth
         l%columns = transpose(reshape([1.0e3_wp*contact%by_modulus, 1.0e3_wp*contact%by_radius, &
            & 1.0e3_wp*contact%by_beta, c%load, spread(1.0_wp, 1, n), c%time - sum(c%time)/n, &
            & 1.0e3_wp/(2.0_wp*modulus*contact%radius), exp(-c%time/transient)], [n, n_columns]))
         l%residual = c%depth - l%depth - s(i_compliance)*c%load
         test%zero = l%residual(1)
         l%residual = l%residual - test%zero
      end associate
   end subroutine linearise

   !> Log densities of steps outside of the window, summed from the start: entry k is that of the
   !> first k - 1 steps.
   pure function excess_scores(steps, rise, sigma, jumps_forward) result(total)
      !> Of the residual and of the elastic depth, nm, (step).
      real(wp), intent(in) :: steps(:), rise(:), sigma
      !> Only jumps to greater depth are likely.
      logical, intent(in) :: jumps_forward
      real(wp) :: total(size(steps) + 1)
      real(wp), parameter :: share_of_jumps = 0.2_wp, wider = 1.5_wp, memory = 0.3_wp, &
         & share_of_rise = 0.1_wp, most = 3.0_wp
      real(wp) :: trend, scale, tail, jump, regular
      integer :: i

      trend = 0.0_wp
      total(1) = 0.0_wp
      do i = 1, size(steps)
         scale = wider*sigma
         tail = scale + share_of_rise*abs(rise(i))
         jump = tail/pi/(tail**2 + steps(i)**2)
         if (jumps_forward) jump = jump*merge(1.9_wp, 0.1_wp, steps(i) > 0.0_wp)
         regular = (1.0_wp - share_of_jumps)*exp(-0.5_wp*((steps(i) - trend)/scale)**2) &
            & /(scale*sqrt(2.0_wp*pi))
         total(i + 1) = total(i) + log(regular + share_of_jumps*jump)
         trend = trend + memory*max(-most*sigma, min(most*sigma, steps(i) - trend))
      end do
   end function excess_scores

   !> Log evidences of the windows from a first point to all last ones.
   subroutine score_windows(l, correlation, sigma, first, outside, score, best, windows)
      type(linear_type), intent(in) :: l
      !> Of the noise.
      real(wp), intent(in) :: correlation, sigma
      integer, intent(in) :: first
      !> Log density of the steps that the window to a point leaves out, (point).
      real(wp), intent(in) :: outside(:)
      !> (point); not touched where there is no window.
      real(wp), intent(inout) :: score(:)
      !> Replaced by the first window that is better.
      type(window_type), intent(inout) :: best
      !> All of them, (point).
      type(window_type), intent(out), optional :: windows(:)
      type(window_type) :: now
      real(wp) :: density
      integer :: i, fewest

      fewest = max(fewest_steps(1), min(fewest_steps(2), size(l%load)/3))
      now%first = first
      do i = 1, n_columns
         now%covariance(i, i) = l%variances(i)
      end do
      ! The first point ties h0 to the noise, and is no step.
      if (correlation < 1.0_wp) then
         call learn(l%residual(first), l%columns(:, first), sigma**2/(1.0_wp - correlation**2))
      end if
      density = 0.0_wp
      do i = first + 1, size(l%load)
         call learn(l%residual(i) - correlation*l%residual(i - 1), &
            & l%columns(:, i) - correlation*l%columns(:, i - 1), sigma**2)
         if (i - first < fewest .or. l%load(i) <= least_span*l%load(first)) cycle
         score(i) = density + outside(i)
         now%last = i
         now%score = score(i)
         if (score(i) > best%score) best = now
         if (present(windows)) windows(i) = now
      end do

   contains

      subroutine learn(y, x, noise)
         real(wp), intent(in) :: y, x(:), noise
         real(wp) :: gain(n_columns), total, error
         integer :: k

         associate (mean => now%mean, covariance => now%covariance)
            gain = matmul(x, covariance)
            total = noise + sum(gain*x)
            error = y - sum(mean*x)
            density = density - 0.5_wp*(log(2.0_wp*pi*total) + error**2/total)
            mean = mean + gain*(error/total)
            do k = 1, n_columns
               covariance(:, k) = covariance(:, k) - gain*(gain(k)/total)
            end do
         end associate
      end subroutine learn
   end subroutine score_windows

   !> Means over the windows, and the modulus given the shared unknowns.
   subroutine sum_windows(test, s, l, first, variances, weight)
      type(test_type), intent(inout) :: test
      real(wp), intent(in) :: s(n_shared)
      type(linear_type), intent(inout) :: l
      integer, intent(in) :: first(:)
      !> Of the unknowns, (unknown, beginning), and (last point, beginning).
      real(wp), intent(in) :: variances(:, :), weight(:, :)
      !> Of a test its modulus and its drift.
      integer, parameter :: told(2) = [1, own + 2]
      type(window_type) :: windows(size(l%load)), best
      real(wp) :: slope(n_shared), unknowns(n_columns), squares(2), ends(2), share, free
      real(wp), dimension(size(l%load)) :: score, r
      integer :: i, k

      unknowns = 0.0_wp
      squares = 0.0_wp
      ends = 0.0_wp
      test%slope = 0.0_wp
      test%drift_share = 0.0_wp
      test%elastic = 0.0_wp*l%load
      do k = 1, size(first)
         if (all(weight(:, k) <= negligible)) cycle
         l%variances = variances(:, k)
         call score_windows(l, test%correlation, test%noise, first(k), 0.0_wp*l%load, score, &
            & best, windows)
         do i = 1, size(l%load)
            if (weight(i, k) <= negligible) cycle
            share = weight(i, k)/sum(weight, weight > negligible)
            associate (mean => windows(i)%mean, c => windows(i)%covariance)
               ! The drift trades with what is shared, above all the compliance.
               free = c(told(2), told(2))
               call give_shared(mean, c, slope)
               if (size(test%curve%stiffness) > 0) call add_stiffness(test, s, windows(i), slope)
               test%slope = test%slope + share*slope
               unknowns = unknowns + share*mean
               squares = squares + share*([c(1, 1), free] + mean(told)**2)
               ends = ends + share*l%load([first(k), i])
               test%drift_share = test%drift_share + share*c(1, &
                  & told(2))**2/(c(1, 1)*c(told(2), told(2)))
            end associate
            test%elastic(first(k):i) = test%elastic(first(k):i) + share
         end do
      end do
      test%shift = unknowns(1)
      test%variance = squares(1) - test%shift**2
      test%from_load = ends(1)
      test%to_load = ends(2)
      test%drift = unknowns(told(2))
      test%drift_sd = sqrt(squares(2) - test%drift**2)
      ! A random walk leaves the zero to the window's mean.
      r = l%residual - matmul(unknowns, l%columns)
      r = r - sum(r*test%elastic)/sum(test%elastic)
      test%fit = test%curve%depth - r
      test%zero = test%zero + l%residual(1) - r(1) - sum(unknowns*l%columns(:, 1)) &
         & + unknowns(own + 1)
   end subroutine sum_windows

   !> Mean and covariance of the unknowns given that the shared ones are as they were taken, and the
   !> slope of the modulus by these.
   pure subroutine give_shared(mean, covariance, slope)
      !> (unknown), (unknown, unknown).
      real(wp), intent(inout) :: mean(n_columns), covariance(n_columns, n_columns)
      real(wp), intent(out) :: slope(n_shared)
      real(wp) :: factor(n_shared, n_shared), whitened(n_shared, n_columns), off(n_shared)
      integer :: j

      factor = covariance(2:own, 2:own)
      call factor_definite(factor, 1.0e-13_wp)
      whitened = covariance(2:own, :)
      do j = 1, n_columns
         call solve_lower(factor, whitened(:, j))
      end do
      off = mean(2:own)
      call solve_lower(factor, off)
      mean = mean - matmul(off, whitened)
      covariance = covariance - matmul(transpose(whitened), whitened)
      slope = whitened(:, 1)
      call solve_upper(factor, slope)
   end subroutine give_shared

   !> The contact stiffness of a curve as a second equation: its mean ratio to 2 E a in a window,
   !> 1/S + C as recorded.
   subroutine add_stiffness(test, s, window, slope)
      type(test_type), intent(in) :: test
      real(wp), intent(in) :: s(n_shared)
      !> Given the shared unknowns, as is the slope of the modulus by these.
      type(window_type), intent(inout) :: window
      real(wp), intent(inout) :: slope(n_shared)
      real(wp), parameter :: step = 1.0e-4_wp, most_correlated = 0.95_wp, accuracy = 1.0e-3_wp
      real(wp) :: x(own), by(own), ratio(window%last - window%first + 1), centre, correlation, &
         & variance, gain(n_columns)
      integer :: j, n

      n = size(ratio)
      ratio = log(test%curve%stiffness(window%first:window%last)) - model([test%ln_modulus, s])
      do j = 1, own
         x = [test%ln_modulus, s]
         x(j) = x(j) + step
         by(j) = sum(model(x) - model([test%ln_modulus, s]))/(n*step)
      end do
      centre = sum(ratio)/n
      ratio = ratio - centre
      correlation = max(0.0_wp, &
         & min(most_correlated, sum(ratio(2:)*ratio(:n - 1))/max(tiny(1.0_wp), sum(ratio**2))))
      variance = (sum(ratio**2)/max(1, n - 1) + accuracy**2)/n*(1.0_wp + correlation)/(1.0_wp &
         & - correlation)/by(1)**2
      associate (mean => window%mean, covariance => window%covariance)
         gain = covariance(:, 1)/(covariance(1, 1) + variance)
         mean = mean + gain*(centre/by(1) - mean(1))
         slope = slope - gain(1)*(by(2:)/by(1) + slope)
         covariance = covariance - spread(gain, 2, n_columns)*spread(covariance(1, :), 1, n_columns)
      end associate

   contains

      !> Logarithm of the recorded stiffness, mN/um.
      pure function model(x) result(stiffness)
         real(wp), intent(in) :: x(own)
         real(wp) :: stiffness(n)
         type(contact_type) :: contact(n)

         contact = contact_at(test%curve%load(window%first:window%last), exp(x(1)), &
            & exp(x(1 + i_radius)), x(1 + i_beta))
         stiffness = -log(0.5_wp*exp(-x(1))/contact%radius + 1.0e-3_wp*x(1 + i_compliance))
      end function model
   end subroutine add_stiffness
end module elastic_window
