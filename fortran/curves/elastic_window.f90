!> One test given the shared unknowns: the logarithm of its modulus, summed over where the contact is elastic.
!>
!> Recorded is depth = h0 + d t + C P + h(P) + load zero dh/dP + noise, h(P) of `sphere_contact`. The noise is autoregressive of first
!> order; its correlation from point to point is chosen by the evidence. All but the modulus and the shared unknowns is linear with normal
!> priors, and integrated out by recursive least squares, one pass for each first point of the window, which gives all last points.
!> What is outside of the window has an excess over the elastic curve whose increments have a broad density: a trend that follows them, and
!> jumps, after the window to greater depth alone. Every step from point to point is scored once, by the window or by that density.
module elastic_window
   use kinds, only: pi, wp
   use loading_segment, only: segment_type
   use small_matrices, only: factor_definite, solve_lower, solve_upper
   use sphere_contact, only: contact_at, contact_type
   use statistics, only: median
   use text, only: fixed
   implicit none
   private
   public :: test_type, nuisances_type, begin_test, score_test, n_shared, i_radius, i_beta, i_compliance

   !> Of a test: ln modulus; then the shared ln R, beta and compliance; then h0, drift and load zero.
   integer, parameter :: n_columns = 7, n_shared = 3, i_radius = 1, i_beta = 2, i_compliance = 3, own = 1 + n_shared
   !> Correlations of the noise from point to point; 1: a random walk.
   real(wp), parameter :: correlations(7) = [0.0_wp, 0.5_wp, 0.8_wp, 0.9_wp, 0.95_wp, 0.98_wp, 1.0_wp]
   !> Shares of the last load where a window may begin.
   real(wp), parameter :: beginnings(8) = [0.0_wp, 0.01_wp, 0.02_wp, 0.03_wp, 0.045_wp, 0.07_wp, 0.1_wp, 0.15_wp]
   !> A window has so many steps, and spans loads of this ratio.
   integer, parameter :: fewest_steps = 7
   real(wp), parameter :: least_span = 1.5_wp
   !> Windows of a smaller share of the probability do not count.
   real(wp), parameter :: negligible = 1.0e-3_wp

   !> Prior sds of what each test has of its own: h0, nm, drift, nm/s, load zero, mN.
   type :: nuisances_type
      real(wp) :: zero = 1.0e4_wp, drift = 0.1_wp, load = 0.02_wp
   end type nuisances_type

   type :: test_type
      type(segment_type) :: curve
      !> The numbers of its material and its session.
      integer :: material = 0, session = 0
      !> Whether it counts, and why not.
      logical :: used = .true.
      character(len=:), allocatable :: reason
      !> ln of the modulus in GPa about which all is linear; of the modulus given shared unknowns that differ by s from those:
      !> ln_modulus + shift + slope . s, with this variance.
      real(wp) :: ln_modulus = 0.0_wp, shift = 0.0_wp, slope(n_shared) = 0.0_wp, variance = 0.0_wp
      !> Means over windows: first and last load, mN; drift and its sd, nm/s; recorded depth of the surface, nm.
      real(wp) :: from_load = 0.0_wp, to_load = 0.0_wp, drift = 0.0_wp, drift_sd = 0.0_wp, zero = 0.0_wp
      !> Share of `variance` that comes from the drift.
      real(wp) :: drift_share = 0.0_wp
      !> Of the noise: correlation, and sd of the steps, nm.
      real(wp) :: correlation = 0.0_wp, noise = 0.0_wp
      !> Depth of the elastic curve, nm, and probability that the contact is elastic there, (point).
      real(wp), allocatable :: fit(:), elastic(:)
      !> Sds of the steps for each correlation.
      real(wp), private :: sigma(size(correlations)) = 0.0_wp
   end type test_type

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
         test%used = .false.
         test%reason = 'no elastic part: the depth does not grow with the load'
         return
      end if
      test%ln_modulus = log(0.75_wp/sqrt(radius)*(1.0e3_wp/slope)**1.5_wp)

   end subroutine begin_test

   !> The test about shared unknowns `s` with prior sds `sds`.
   subroutine score_test(test, s, sds, nuisances)
      type(test_type), intent(inout) :: test
      !> ln R (um), beta, compliance (nm/mN).
      real(wp), intent(in) :: s(n_shared), sds(n_shared)
      type(nuisances_type), intent(in) :: nuisances
      real(wp) :: variances(n_columns), evidence, best
      real(wp), allocatable :: residual(:), columns(:, :), depth(:), before(:), after(:), score(:, :), weight(:, :)
      integer :: first(size(beginnings)), n, i, k, chosen
      !> The elastic curve misses the first contact by so much of the depth.
      real(wp), parameter :: farthest = 0.15_wp
      real(wp) :: off

      n = size(test%curve%load)
      variances = [1.0_wp, sds**2, nuisances%zero**2, nuisances%drift**2, nuisances%load**2]
      call linearise(test, s, residual, columns, depth)
      first = 0
      do k = 1, size(beginnings)
         i = findloc(test%curve%load >= beginnings(k)*test%curve%load(n), .true., 1)
         if (all(first /= i)) first(k) = i
      end do
      associate (steps => residual(2:) - residual(:n - 1), rise => depth(2:) - depth(:n - 1), sigma => test%sigma)
         before = excess_scores(steps, rise, sigma(size(sigma)), .false.)
         after = excess_scores(steps(n - 1:1:-1), rise(n - 1:1:-1), sigma(size(sigma)), .true.)
      end associate
      after = after(n:1:-1)
      allocate (score(n, size(beginnings)), weight(n, size(beginnings)))
      best = -huge(1.0_wp)
      chosen = 0
      do i = 1, size(correlations)
         score = -huge(1.0_wp)
         do k = 1, size(beginnings)
            if (first(k) > 0) call score_windows(test%curve%load, residual, columns, variances, correlations(i), test%sigma(i), &
               & first(k), before(first(k)) + after, score(:, k))
         end do
         if (maxval(score) <= -huge(1.0_wp)) cycle
         evidence = maxval(score) + log(sum(exp(score - maxval(score))))
         call renew_noise(residual, columns, variances, correlations(i), first(maxloc(maxval(score, 1), 1)), &
            & maxloc(maxval(score, 2), 1), test%sigma(i))
         if (evidence <= best) cycle
         best = evidence
         chosen = i
         weight = exp(score - evidence)
      end do
      if (chosen == 0) then
         test%used = .false.
         test%reason = 'no elastic part: too few points'
         return
      end if
      test%correlation = correlations(chosen)
      test%noise = test%sigma(chosen)
      call sum_windows(test, s, residual, columns, variances, first, weight)
      off = test%curve%depth(1) - test%fit(1)
      if (abs(off) > farthest*maxval(depth, test%elastic >= 0.5_wp*maxval(test%elastic))) then
         test%used = .false.
         test%reason = 'no elastic part: the contact begins '//fixed(abs(off), &
            & 1)//' nm away from the elastic curve through loads of ' &
            & //fixed(test%from_load, 1)//' to '//fixed(test%to_load, 1)//' mN'
      end if
   end subroutine score_test

   !> Residuals of the curve about the present values, and the derivatives of the depth by all unknowns, nm.
   subroutine linearise(test, s, residual, columns, depth)
      !> Its `zero` is taken from the residuals.
      type(test_type), intent(inout) :: test
      real(wp), intent(in) :: s(n_shared)
      !> (point), (unknown, point), and the elastic depth, (point).
      real(wp), allocatable, intent(out) :: residual(:), columns(:, :), depth(:)
      type(contact_type), allocatable :: contact(:)
      real(wp) :: modulus
      integer :: n

      n = size(test%curve%load)
      modulus = exp(test%ln_modulus)
      allocate (contact(n), source=contact_at(test%curve%load, modulus, exp(s(i_radius)), s(i_beta)))
      depth = 1.0e3_wp*contact%depth
      allocate (columns(n_columns, n))
      columns(1, :) = 1.0e3_wp*contact%by_modulus
      columns(2, :) = 1.0e3_wp*contact%by_radius
      columns(3, :) = 1.0e3_wp*contact%by_beta
      columns(4, :) = test%curve%load
      columns(5, :) = 1.0_wp
      columns(6, :) = test%curve%time - sum(test%curve%time)/n
      columns(7, :) = 1.0e3_wp/(2.0_wp*modulus*contact%radius)
      residual = test%curve%depth - depth - s(i_compliance)*test%curve%load
      test%zero = residual(1)
      residual = residual - test%zero
   end subroutine linearise

   !> Log densities of steps outside of the window, summed from the start: entry k is that of the first k - 1 steps.
   pure function excess_scores(steps, rise, sigma, jumps_forward) result(total)
      !> Of the residual and of the elastic depth, nm, (step).
      real(wp), intent(in) :: steps(:), rise(:), sigma
      !> Only jumps to greater depth are likely.
      logical, intent(in) :: jumps_forward
      real(wp) :: total(size(steps) + 1)
      real(wp), parameter :: share_of_jumps = 0.2_wp, wider = 1.5_wp, memory = 0.3_wp, share_of_rise = 0.1_wp, most = 3.0_wp
      real(wp) :: trend, scale, tail, jump
      integer :: i

      trend = 0.0_wp
      total(1) = 0.0_wp
      do i = 1, size(steps)
         scale = wider*sigma
         tail = scale + share_of_rise*abs(rise(i))
         jump = tail/pi/(tail**2 + steps(i)**2)
         if (jumps_forward) jump = jump*merge(1.9_wp, 0.1_wp, steps(i) > 0.0_wp)
         total(i + 1) = total(i) + log((1.0_wp - share_of_jumps)*exp(-0.5_wp*((steps(i) - trend)/scale)**2) &
            & /(scale*sqrt(2.0_wp*pi)) + share_of_jumps*jump)
         trend = trend + memory*max(-most*sigma, min(most*sigma, steps(i) - trend))
      end do
   end function excess_scores

   !> Log evidences of the windows from a first point to all last ones.
   subroutine score_windows(load, residual, columns, variances, correlation, sigma, first, outside, score)
      !> mN, nm, (unknown, point), and the prior of the unknowns.
      real(wp), intent(in) :: load(:), residual(:), columns(:, :), variances(:), correlation, sigma
      integer, intent(in) :: first
      !> Log density of the steps that the window to a point leaves out, (point).
      real(wp), intent(in) :: outside(:)
      !> (point); not touched where there is no window.
      real(wp), intent(inout) :: score(:)
      real(wp) :: mean(n_columns), covariance(n_columns, n_columns), density
      integer :: i, j

      mean = 0.0_wp
      covariance = 0.0_wp
      do j = 1, n_columns
         covariance(j, j) = variances(j)
      end do
      density = 0.0_wp
      ! The first point ties h0 to the noise, and is no step.
      if (correlation < 1.0_wp) call learn(residual(first), columns(:, first), sigma**2/(1.0_wp - correlation**2))
      density = 0.0_wp
      do i = first + 1, size(load)
         call learn(residual(i) - correlation*residual(i - 1), columns(:, i) - correlation*columns(:, i - 1), sigma**2)
         if (i - first >= fewest_steps .and. load(i) > least_span*load(first)) score(i) = density + outside(i)
      end do

   contains

      subroutine learn(y, x, noise)
         real(wp), intent(in) :: y, x(:), noise
         real(wp) :: gain(n_columns), total, error
         integer :: k

         do k = 1, n_columns
            gain(k) = sum(covariance(:, k)*x)
         end do
         total = noise + sum(gain*x)
         error = y - sum(mean*x)
         density = density - 0.5_wp*(log(2.0_wp*pi*total) + error**2/total)
         mean = mean + gain*(error/total)
         do k = 1, n_columns
            covariance(:, k) = covariance(:, k) - gain*(gain(k)/total)
         end do
      end subroutine learn
   end subroutine score_windows

   !> Precision and right-hand side of the unknowns from the points of a window.
   pure subroutine window_equations(residual, columns, correlation, sigma, window, a, b)
      real(wp), intent(in) :: residual(:), columns(:, :), correlation, sigma
      !> First and last point.
      integer, intent(in) :: window(2)
      !> (unknown, unknown), (unknown); without the prior.
      real(wp), intent(out) :: a(n_columns, n_columns), b(n_columns)
      real(wp) :: x(n_columns), y
      integer :: i, j

      a = 0.0_wp
      b = 0.0_wp
      do i = window(1), window(2)
         if (i == window(1)) then
            x = columns(:, i)*sqrt(1.0_wp - correlation**2)/sigma
            y = residual(i)*sqrt(1.0_wp - correlation**2)/sigma
         else
            x = (columns(:, i) - correlation*columns(:, i - 1))/sigma
            y = (residual(i) - correlation*residual(i - 1))/sigma
         end if
         b = b + x*y
         do j = 1, n_columns
            a(:, j) = a(:, j) + x*x(j)
         end do
      end do
   end subroutine window_equations

   !> The sd of the steps in the most probable window, drawn to what it was by the weight of two points.
   pure subroutine renew_noise(residual, columns, variances, correlation, first, last, sigma)
      real(wp), intent(in) :: residual(:), columns(:, :), variances(:), correlation
      integer, intent(in) :: first, last
      real(wp), intent(inout) :: sigma
      real(wp) :: a(n_columns, n_columns), b(n_columns), r(size(residual))
      integer :: j
      logical :: definite

      call window_equations(residual, columns, correlation, sigma, [first, last], a, b)
      do j = 1, n_columns
         a(j, j) = a(j, j) + 1.0_wp/variances(j)
      end do
      call factor_definite(a, 1.0e-14_wp, definite)
      if (.not. definite) return
      call solve_lower(a, b)
      call solve_upper(a, b)
      r = residual - matmul(b, columns)
      associate (e => r(first + 1:last) - correlation*r(first:last - 1))
         sigma = sqrt((sum(e**2) + 2.0_wp*sigma**2)/(max(1, size(e) - 3) + 2))
      end associate
   end subroutine renew_noise

   !> Means over the windows, and the modulus given the shared unknowns.
   subroutine sum_windows(test, s, residual, columns, variances, first, weight)
      type(test_type), intent(inout) :: test
      real(wp), intent(in) :: s(n_shared), residual(:), columns(:, :), variances(:)
      integer, intent(in) :: first(:)
      !> (last point, beginning).
      real(wp), intent(in) :: weight(:, :)
      real(wp) :: a(n_columns, n_columns), b(n_columns), own_part(n_columns - own, own + 1), shift, variance, slope(n_shared), &
         & squares(2), share, total, unknowns(n_columns), drift(n_columns - own)
      real(wp), allocatable :: r(:)
      integer :: i, j, k
      logical :: definite

      total = sum(weight, weight > negligible)
      test%shift = 0.0_wp
      test%slope = 0.0_wp
      test%variance = 0.0_wp
      test%from_load = 0.0_wp
      test%to_load = 0.0_wp
      test%drift_share = 0.0_wp
      squares = 0.0_wp
      unknowns = 0.0_wp
      test%elastic = spread(0.0_wp, 1, size(residual))
      do k = 1, size(first)
         do i = 1, size(residual)
            if (weight(i, k) <= negligible) cycle
            share = weight(i, k)/total
            call window_equations(residual, columns, test%correlation, test%noise, [first(k), i], a, b)
            do j = own + 1, n_columns
               a(j, j) = a(j, j) + 1.0_wp/variances(j)
            end do
            call factor_definite(a(own + 1:, own + 1:), 1.0e-14_wp, definite)
            own_part(:, :own) = a(own + 1:, :own)
            own_part(:, own + 1) = b(own + 1:)
            do j = 1, own + 1
               call solve_lower(a(own + 1:, own + 1:), own_part(:, j))
            end do
            variance = 1.0_wp/(a(1, 1) - sum(own_part(:, 1)**2))
            shift = variance*(b(1) - sum(own_part(:, 1)*own_part(:, own + 1)))
            do j = 1, n_shared
               slope(j) = -variance*(a(1, 1 + j) - sum(own_part(:, 1)*own_part(:, 1 + j)))
            end do
            call add_stiffness(test, s, [first(k), i], shift, slope, variance)
            ! What the test has of its own, at the present shared unknowns.
            b(own + 1:) = own_part(:, own + 1) - own_part(:, 1)*shift
            call solve_upper(a(own + 1:, own + 1:), b(own + 1:))
            unknowns = unknowns + share*[shift, 0.0_wp, 0.0_wp, 0.0_wp, b(own + 1:)]
            drift = [0.0_wp, 1.0_wp, 0.0_wp]
            call solve_lower(a(own + 1:, own + 1:), drift)
            squares = squares + share*[shift**2, b(own + 2)**2 + sum(drift**2)]
            ! Their covariance over the variance of the drift.
            call solve_upper(a(own + 1:, own + 1:), own_part(:, 1))
            test%drift_share = test%drift_share + share*variance*own_part(2, 1)**2/(sum(drift**2) + variance*own_part(2, 1)**2)
            test%shift = test%shift + share*shift
            test%variance = test%variance + share*variance
            test%slope = test%slope + share*slope
            test%from_load = test%from_load + share*test%curve%load(first(k))
            test%to_load = test%to_load + share*test%curve%load(i)
            test%elastic(first(k):i) = test%elastic(first(k):i) + share
         end do
      end do
      test%variance = test%variance + max(0.0_wp, squares(1) - test%shift**2)
      test%drift = unknowns(own + 2)
      test%drift_sd = sqrt(max(0.0_wp, squares(2) - test%drift**2))
      ! A random walk leaves the zero to the window's mean.
      r = residual - matmul(unknowns, columns)
      r = r - sum(r*test%elastic)/sum(test%elastic)
      test%fit = test%curve%depth - r
      test%zero = test%zero + residual(1) - r(1) - sum(unknowns*columns(:, 1)) + unknowns(own + 1)
   end subroutine sum_windows

   !> The contact stiffness, where the curve has it, as a second equation: its mean ratio to 2 E a in a window, 1/S + C as recorded.
   subroutine add_stiffness(test, s, window, shift, slope, variance)
      type(test_type), intent(in) :: test
      real(wp), intent(in) :: s(n_shared)
      integer, intent(in) :: window(2)
      !> Of ln modulus given the shared unknowns.
      real(wp), intent(inout) :: shift, slope(n_shared), variance
      real(wp), parameter :: step = 1.0e-4_wp
      real(wp) :: x(own), by(own), ratio(window(2) - window(1) + 1), mean, correlation, own_variance, share
      integer :: j, n

      if (size(test%curve%stiffness) == 0) return
      n = size(ratio)
      ratio = log(test%curve%stiffness(window(1):window(2))) - model([test%ln_modulus, s])
      mean = sum(ratio)/n
      do j = 1, own
         x = [test%ln_modulus, s]
         x(j) = x(j) + step
         by(j) = sum(model(x) - model([test%ln_modulus, s]))/(n*step)
      end do
      ratio = ratio - mean
      correlation = max(0.0_wp, min(0.95_wp, sum(ratio(2:)*ratio(:n - 1))/max(tiny(1.0_wp), sum(ratio**2))))
      own_variance = (sum(ratio**2)/max(1, n - 1) + 1.0e-6_wp)/n*(1.0_wp + correlation)/(1.0_wp - correlation)/by(1)**2
      share = variance/(variance + own_variance)
      shift = shift + share*(mean/by(1) - shift)
      slope = slope + share*(-by(2:)/by(1) - slope)
      variance = variance*(1.0_wp - share)

   contains

      !> Logarithm of the recorded stiffness, mN/um.
      pure function model(x) result(stiffness)
         real(wp), intent(in) :: x(own)
         real(wp) :: stiffness(n)
         type(contact_type) :: contact(n)

         contact = contact_at(test%curve%load(window(1):window(2)), exp(x(1)), exp(x(1 + i_radius)), x(1 + i_beta))
         stiffness = -log(0.5_wp*exp(-x(1))/contact%radius + 1.0e-3_wp*x(1 + i_compliance))
      end function model
   end subroutine add_stiffness
end module elastic_window
