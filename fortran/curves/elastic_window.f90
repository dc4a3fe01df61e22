!> One test, given the shared unknowns: the logarithm of its modulus, averaged over the windows in
!> which the contact may be elastic.
!>
!> The recorded depth is h0 + d t + C P + h(P) + load zero dh/dP + transient exp(-t/tau) + noise,
!> with h(P) of `sphere_contact`. The noise is autoregressive of first order; the evidence chooses
!> its correlation from point to point. All unknowns but the modulus and the shared ones are linear
!> with normal priors. Recursive least squares integrates them out: one pass for each first point of
!> the window gives all last points.
!>
!> Outside the window the depth exceeds the elastic curve, and the increments of this excess have a
!> broad density: a trend that follows them, and jumps, which after the window go to greater depth
!> only. Every step from point to point is scored once, by the window or by that density.
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

   !> Unknowns of a test: ln modulus; the shared ln R, beta and compliance; its own h0, drift, load
   !> zero and transient.
   integer, parameter :: n_columns = 8, n_shared = 3, i_radius = 1, i_beta = 2, i_compliance = 3, &
      & own = 1 + n_shared
   !> Correlations of the noise from point to point; 1 is a random walk.
   real(wp), parameter :: correlations(7) = [0.0_wp, 0.5_wp, 0.8_wp, 0.9_wp, 0.95_wp, &
      & 0.98_wp, 1.0_wp]
   !> Loads at which a window may begin, as shares of the last load.
   real(wp), parameter :: beginnings(8) = [0.0_wp, 0.01_wp, 0.02_wp, 0.03_wp, 0.045_wp, 0.07_wp, &
      & 0.1_wp, 0.15_wp]
   !> Fewest steps of a window: a third of the steps of the curve, within these bounds. Least ratio
   !> of the last load of a window to the first.
   integer, parameter :: fewest_steps(2) = [5, 7]
   real(wp), parameter :: least_span = 4.0_wp
   !> Windows of a smaller share of the probability are neglected.
   real(wp), parameter :: negligible = 1.0e-3_wp

   type :: test_type
      type(segment_type) :: curve
      !> Numbers of its material and its session.
      integer :: material = 0, session = 0
      !> Whether the test is used; if not, the reason.
      logical :: used = .true.
      character(len=:), allocatable :: reason
      !> ln of the modulus (GPa) about which the model is linear. If the shared unknowns differ by s
      !> from those of the linearisation, ln modulus has the mean ln_modulus + shift + slope . s and
      !> this variance.
      real(wp) :: ln_modulus = 0.0_wp, shift = 0.0_wp, slope(n_shared) = 0.0_wp, variance = 0.0_wp
      !> Means over windows: first and last load, mN; drift and its standard deviation, nm/s;
      !> recorded depth of the surface, nm.
      real(wp) :: from_load = 0.0_wp, to_load = 0.0_wp, drift = 0.0_wp, drift_sd = 0.0_wp, &
         & zero = 0.0_wp
      !> Share of `variance` that the drift causes; correlation of the noise from step to step; its
      !> standard deviation, nm.
      real(wp) :: drift_share = 0.0_wp, correlation = 0.0_wp, noise = 0.0_wp
      !> Depth of the elastic curve, nm, and probability that the contact is elastic there, (point).
      real(wp), allocatable :: fit(:), elastic(:)
      !> Standard deviation of the steps for each correlation, nm.
      real(wp), private :: sigma(size(correlations)) = 0.0_wp
   end type test_type

   !> A test, linearised about the present unknowns: load, mN, residual and elastic depth, nm,
   !> (point); derivatives of the depth by all unknowns, (unknown, point), and prior variances of
   !> the unknowns.
   type :: linear_type
      real(wp), allocatable :: load(:), residual(:), depth(:), columns(:, :)
      real(wp) :: variances(n_columns) = 0.0_wp
   end type linear_type

   !> An elastic window: its points, its log evidence, and the posterior of the unknowns of the
   !> test.
   type :: window_type
      integer :: first = 0, last = 0
      real(wp) :: score = -huge(1.0_wp), mean(n_columns) = 0.0_wp, &
         & covariance(n_columns, n_columns) = 0.0_wp
   end type window_type

contains

   !> Start values: Hertz's solution through the lower loads, and the noise from second differences.
   subroutine begin_test(test, radius)
      type(test_type), intent(inout) :: test
      !> Radius of the sphere, um.
      real(wp), intent(in) :: radius
      !> Standard deviation of a second difference: between that of white noise and that of a random
      !> walk of unit steps. Ratio of the standard deviation to the median deviation of a normal
      !> distribution. Least noise, nm.
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
      if (slope > 0.0_wp) then
         test%ln_modulus = log(0.75_wp/sqrt(radius)*(1.0e3_wp/slope)**1.5_wp)
      else
         call leave_out(test, 'no elastic part: the depth does not grow with the load')
      end if
   end subroutine begin_test

   !> Score the test at shared unknowns `s`, with the prior standard deviations `sds`.
   subroutine score_test(test, s, sds, transient)
      type(test_type), intent(inout) :: test
      !> Shared unknowns ln R (um), beta, compliance (nm/mN). Standard deviations of these, then of
      !> each test's own h0, nm, drift, nm/s, load zero, mN, and transient, nm. Decay time of the
      !> transient, s.
      real(wp), intent(in) :: s(n_shared), sds(n_columns - 1), transient
      !> Largest distance of the first point from the elastic curve, as a share of the depth.
      real(wp), parameter :: farthest = 0.15_wp
      real(wp) :: evidence, best, distance, depth
      real(wp), allocatable :: before(:), after(:), score(:, :), weight(:, :), r(:)
      type(linear_type) :: linear
      type(window_type) :: window
      real(wp) :: variances(n_columns, 2*size(beginnings))
      integer :: first(2*size(beginnings)), n, i, k, chosen

      n = size(test%curve%load)
      call linearise()
      first = [((findloc(test%curve%load >= beginnings(k)*test%curve%load(n), .true., 1), k=1, &
         & size(beginnings)), i=1, 2)]
      ! The second half of the windows has no transient.
      variances = spread([1.0_wp, sds**2], 2, size(first))
      variances(n_columns, size(beginnings) + 1:) = 0.0_wp
      associate (steps => linear%residual(2:) - linear%residual(:n - 1), &
         & rise => linear%depth(2:) - linear%depth(:n - 1), sigma => test%sigma(size(correlations)))
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
            linear%variances = variances(:, k)
            call score_windows(linear, correlations(i), test%sigma(i), first(k), &
               & before(first(k)) + after, score(:, k), window)
         end do
         if (window%last == 0) cycle
         evidence = window%score + log(sum(exp(score - window%score)))
         ! The standard deviation of the steps in the windows; the previous value has the weight of
         ! two steps.
         r = linear%residual - matmul(window%mean, linear%columns)
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
      call sum_windows(test, s, linear, first, variances, weight)
      distance = abs(test%curve%depth(1) - test%fit(1))
      depth = maxval(linear%depth, test%elastic >= 0.5_wp*maxval(test%elastic))
      if (distance > farthest*depth) then
         call leave_out(test, 'no elastic part: the contact begins '//fixed(distance, 1) &
            & //' nm away from the elastic curve through loads of '//fixed(test%from_load, 1) &
            & //' to '//fixed(test%to_load, 1)//' mN')
      end if

   contains

      !> Linearise the test about its modulus and the shared unknowns `s`. Its `zero` is the first
      !> residual, which is subtracted from all.
      subroutine linearise()
         type(contact_type), allocatable :: contact(:)
         real(wp) :: modulus

         modulus = exp(test%ln_modulus)
         associate (c => test%curve)
            allocate (contact(n), source=contact_at(c%load, modulus, exp(s(i_radius)), s(i_beta)))
            linear%load = c%load
            linear%depth = 1.0e3_wp*contact%depth
            allocate (linear%columns(n_columns, n))
            linear%columns(1, :) = 1.0e3_wp*contact%by_modulus
            linear%columns(1 + i_radius, :) = 1.0e3_wp*contact%by_radius
            linear%columns(1 + i_beta, :) = 1.0e3_wp*contact%by_beta
            linear%columns(1 + i_compliance, :) = c%load
            linear%columns(own + 1, :) = 1.0_wp
            linear%columns(own + 2, :) = c%time - sum(c%time)/n
            linear%columns(own + 3, :) = 1.0e3_wp/(2.0_wp*modulus*contact%radius)
            linear%columns(own + 4, :) = exp(-c%time/transient)
            linear%residual = c%depth - linear%depth - s(i_compliance)*c%load
            test%zero = linear%residual(1)
            linear%residual = linear%residual - test%zero
         end associate
      end subroutine linearise
   end subroutine score_test

   !> Exclude a test, for this `reason`.
   subroutine leave_out(test, reason)
      type(test_type), intent(inout) :: test
      character(len=*), intent(in) :: reason

      test%used = .false.
      test%reason = reason
   end subroutine leave_out

   !> Log densities of steps outside of the window, summed from the start: entry k is the sum of the
   !> first k - 1 steps.
   pure function excess_scores(steps, rise, sigma, jumps_forward) result(total)
      !> Steps of the residual and of the elastic depth, nm, (step); standard deviation of the
      !> noise, nm.
      real(wp), intent(in) :: steps(:), rise(:), sigma
      !> Whether jumps to greater depth are far more likely than others.
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

   !> Log evidences of the windows from one first point to all last points.
   subroutine score_windows(linear, correlation, sigma, first, outside, score, best, windows)
      type(linear_type), intent(in) :: linear
      !> Correlation and standard deviation of the noise.
      real(wp), intent(in) :: correlation, sigma
      integer, intent(in) :: first
      !> Log density of the steps outside the window that ends at a point, (point).
      real(wp), intent(in) :: outside(:)
      !> (point); unchanged where there is no window.
      real(wp), intent(inout) :: score(:)
      !> Replaced by any window with a larger score.
      type(window_type), intent(inout) :: best
      !> All windows, (last point).
      type(window_type), intent(out), optional :: windows(:)
      type(window_type) :: window
      real(wp) :: density
      integer :: i, fewest

      fewest = max(fewest_steps(1), min(fewest_steps(2), size(linear%load)/3))
      window%first = first
      do i = 1, n_columns
         window%covariance(i, i) = linear%variances(i)
      end do
      ! The first point relates h0 to the noise; it is not a step.
      if (correlation < 1.0_wp) then
         call update(linear%residual(first), linear%columns(:, first), &
            & sigma**2/(1.0_wp - correlation**2))
      end if
      density = 0.0_wp
      do i = first + 1, size(linear%load)
         call update(linear%residual(i) - correlation*linear%residual(i - 1), &
            & linear%columns(:, i) - correlation*linear%columns(:, i - 1), sigma**2)
         if (i - first < fewest .or. linear%load(i) <= least_span*linear%load(first)) cycle
         score(i) = density + outside(i)
         window%last = i
         window%score = score(i)
         if (score(i) > best%score) best = window
         if (present(windows)) windows(i) = window
      end do

   contains

      subroutine update(y, x, noise)
         real(wp), intent(in) :: y, x(:), noise
         real(wp) :: gain(n_columns), total, error
         integer :: k

         associate (mean => window%mean, covariance => window%covariance)
            gain = matmul(x, covariance)
            total = noise + sum(gain*x)
            error = y - sum(mean*x)
            density = density - 0.5_wp*(log(2.0_wp*pi*total) + error**2/total)
            mean = mean + gain*(error/total)
            do k = 1, n_columns
               covariance(:, k) = covariance(:, k) - gain*(gain(k)/total)
            end do
         end associate
      end subroutine update
   end subroutine score_windows

   !> Average over the windows, and compute the modulus given the shared unknowns.
   subroutine sum_windows(test, s, linear, first, variances, weight)
      type(test_type), intent(inout) :: test
      real(wp), intent(in) :: s(n_shared)
      type(linear_type), intent(inout) :: linear
      integer, intent(in) :: first(:)
      !> Variances of the unknowns, (unknown, beginning); weights of the windows, (last point,
      !> beginning).
      real(wp), intent(in) :: variances(:, :), weight(:, :)
      !> The unknowns that are reported: modulus and drift.
      integer, parameter :: reported(2) = [1, own + 2]
      type(window_type) :: windows(size(linear%load)), best
      real(wp) :: slope(n_shared), unknowns(n_columns), squares(2), loads(2), share, drift_variance
      real(wp), dimension(size(linear%load)) :: score, r
      integer :: i, k

      unknowns = 0.0_wp
      squares = 0.0_wp
      loads = 0.0_wp
      test%slope = 0.0_wp
      test%drift_share = 0.0_wp
      test%elastic = 0.0_wp*linear%load
      do k = 1, size(first)
         if (all(weight(:, k) <= negligible)) cycle
         linear%variances = variances(:, k)
         call score_windows(linear, test%correlation, test%noise, first(k), 0.0_wp*linear%load, &
            & score, best, windows)
         do i = 1, size(linear%load)
            if (weight(i, k) <= negligible) cycle
            share = weight(i, k)/sum(weight, weight > negligible)
            associate (mean => windows(i)%mean, c => windows(i)%covariance)
               ! Before conditioning: the drift is correlated with the shared unknowns, above all
               ! with the compliance.
               drift_variance = c(reported(2), reported(2))
               call give_shared(mean, c, slope)
               if (size(test%curve%stiffness) > 0) call add_stiffness(test, s, windows(i), slope)
               test%slope = test%slope + share*slope
               unknowns = unknowns + share*mean
               squares = squares + share*([c(1, 1), drift_variance] + mean(reported)**2)
               loads = loads + share*linear%load([first(k), i])
               test%drift_share = test%drift_share + share*c(1, &
                  & reported(2))**2/(c(1, 1)*c(reported(2), reported(2)))
            end associate
            test%elastic(first(k):i) = test%elastic(first(k):i) + share
         end do
      end do
      test%shift = unknowns(1)
      test%variance = squares(1) - test%shift**2
      test%from_load = loads(1)
      test%to_load = loads(2)
      test%drift = unknowns(reported(2))
      test%drift_sd = sqrt(squares(2) - test%drift**2)
      ! A random walk does not determine the zero; use the mean residual in the window.
      r = linear%residual - matmul(unknowns, linear%columns)
      r = r - sum(r*test%elastic)/sum(test%elastic)
      test%fit = test%curve%depth - r
      test%zero = test%zero + linear%residual(1) - r(1) - sum(unknowns*linear%columns(:, 1)) &
         & + unknowns(own + 1)
   end subroutine sum_windows

   !> Condition mean and covariance of the unknowns on the shared ones, and give the slope of the
   !> modulus with respect to these.
   pure subroutine give_shared(mean, covariance, slope)
      !> (unknown), (unknown, unknown).
      real(wp), intent(inout) :: mean(n_columns), covariance(n_columns, n_columns)
      real(wp), intent(out) :: slope(n_shared)
      real(wp) :: factor(n_shared, n_shared), whitened(n_shared, n_columns), offset(n_shared)
      integer :: j

      factor = covariance(2:own, 2:own)
      call factor_definite(factor, 1.0e-13_wp)
      whitened = covariance(2:own, :)
      do j = 1, n_columns
         call solve_lower(factor, whitened(:, j))
      end do
      offset = mean(2:own)
      call solve_lower(factor, offset)
      mean = mean - matmul(offset, whitened)
      covariance = covariance - matmul(transpose(whitened), whitened)
      slope = whitened(:, 1)
      call solve_upper(factor, slope)
   end subroutine give_shared

   !> Use the contact stiffness of a curve as a second equation: the mean ratio of the recorded
   !> stiffness to the model's in a window, where 1/S + C is recorded and S = 2 E a.
   subroutine add_stiffness(test, s, window, slope)
      type(test_type), intent(in) :: test
      real(wp), intent(in) :: s(n_shared)
      !> Mean and covariance given the shared unknowns; slope of the modulus with respect to these.
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

      !> Logarithm of the modelled stiffness, mN/um, as it would be recorded.
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
