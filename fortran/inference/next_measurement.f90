!> What one more measurement is expected to teach, from draws of the posterior and what each
!> predicts at each candidate.
!>
!> A measurement v at a candidate has the density p(v) = sum_s w_s N(v; m_s, sd²) over the draws s,
!> whose predictions m_s have the errors that measurements share (of calibration, of the surrogate)
!> drawn with the constants. What it is expected to say of the constants alone is the entropy of p
!> less that of v where the constants are known: of the noise and the shared errors together. The
!> variance of a target that is left is the integral of p(v) times the variance under the weights
!> w_s N(v; m_s, sd²). Both are integrals over the one variable v, done on a grid: no normal
!> approximation of the posterior and no noise of a simulation.
!>
!> A kernel narrower than the draws are dense would see single draws and not their density, so it
!> has at least a share of the spread of the predictions; the entropy of the noise is that of the
!> true sd. So the cost is bounded, and precise measurements have their limit.
!>
!> Several measurements are chosen one after another. What the earlier ones will say is not known,
!> so it is averaged over scenarios: a draw taken as the truth, noise added, and the draws weighted
!> by what was measured in that scenario.
module next_measurement
   use crystal_elasticity, only: path_type
   use kinds, only: pi, wp
   use random, only: new_random_stream, random_stream_type
   implicit none
   private
   public :: candidates_type, suggestions_type, expected_gains, choose_measurements

   !> Bins of the draws and points of the integral per sd of the kernel, and half the width of the
   !> kernel in sds.
   integer, parameter :: bins_per_sd = 10, points_per_sd = 2, half_width = 6
   integer, parameter :: step = bins_per_sd/points_per_sd, half_bins = half_width*bins_per_sd
   !> Gains are alike that are at least this share of the largest.
   real(wp), parameter :: alike = 0.9_wp
   !> Least sd of the kernel, as a share of the sd of the predictions.
   real(wp), parameter :: least_kernel = 0.02_wp

   type :: candidates_type
      !> Of moduli, then of speeds: Bunge-Euler angles, degrees, (3, candidate), the paths of the
      !> waves, the number of the grain, or 0, and what it costs, (candidate).
      real(wp), allocatable :: euler_deg(:, :), cost(:)
      type(path_type), allocatable :: paths(:)
      integer, allocatable :: grain(:)
      !> What each draw predicts, GPa or m/s, and the variance of that where the constants are
      !> known; (draw, candidate).
      real(wp), allocatable :: predicted(:, :), shared_variance(:, :)
      !> Of a measurement's own error, (candidate).
      real(wp), allocatable :: sd(:)
      !> What is to be known, (draw); empty: all about the constants.
      real(wp), allocatable :: target(:)
      !> Between two of the first candidates, and below which two are too near each other for both
      !> to be measured; radians.
      real(wp), allocatable :: angle(:, :)
      real(wp) :: least_angle = 0.0_wp
   end type candidates_type

   type :: suggestions_type
      !> Numbers of candidates, the best first, and their gains given those before them.
      integer, allocatable :: chosen(:)
      real(wp), allocatable :: gains(:)
      !> Radius of the region about each in which all candidates have gains alike, radians, 0 where
      !> there are none.
      real(wp), allocatable :: within(:)
      !> Gain of every candidate as the first.
      real(wp), allocatable :: first_gains(:)
   end type suggestions_type

contains

   !> Gain of a measurement at a candidate, nats; with a target by how much its variance falls, in
   !> units of its square.
   pure real(wp) function gain_of_candidate(candidates, c, weights) result(gain)
      type(candidates_type), intent(in) :: candidates
      integer, intent(in) :: c
      !> Of the draws, of sum 1.
      real(wp), intent(in), contiguous :: weights(:)
      real(wp), allocatable :: bins(:, :), deviation(:)
      real(wp) :: kernel(2*half_bins + 1), width, low, place, powers(3), entropy, left, sd
      integer :: s, k, n, i

      deviation = deviations(candidates%target, weights)
      associate (predicted => candidates%predicted(:, c))
         sd = kernel_sd(candidates, c)
         width = sd/bins_per_sd
         low = minval(predicted)
         n = int((maxval(predicted) - low)/width) + 2
         allocate (bins(3, -2*half_bins:n + 2*half_bins), source=0.0_wp)
         do s = 1, size(predicted)
            place = (predicted(s) - low)/width
            k = int(place)
            powers = weights(s)*[1.0_wp, deviation(s), deviation(s)**2]
            bins(:, k) = bins(:, k) + (1.0_wp - (place - k))*powers
            bins(:, k + 1) = bins(:, k + 1) + (place - k)*powers
         end do
      end associate
      kernel = [(exp(-0.5_wp*(real(i, wp)/bins_per_sd)**2)/(sqrt(2.0_wp*pi)*sd), &
         & i=-half_bins, half_bins)]
      entropy = 0.0_wp
      left = 0.0_wp
      do k = -half_bins, n + half_bins, step
         powers = matmul(bins(:, k - half_bins:k + half_bins), kernel)
         if (powers(1) <= 1.0e-30_wp/sd) cycle
         entropy = entropy - powers(1)*log(powers(1))*step*width
         left = left + (powers(3) - powers(2)**2/powers(1))*step*width
      end do
      gain = sum(weights*deviation**2) - left
      if (size(candidates%target) == 0) then
         gain = entropy - 0.5_wp*sum(weights &
             & *log(2.0_wp*pi*exp(1.0_wp)*(candidates%sd(c)**2 + candidates%shared_variance(:, c))))
      end if
   end function gain_of_candidate

   !> The target of each draw less its mean; 0 without a target.
   pure function deviations(target, weights)
      !> (draw), or empty; (draw), of sum 1.
      real(wp), intent(in) :: target(:), weights(:)
      real(wp) :: deviations(size(weights))

      deviations = 0.0_wp
      if (size(target) > 0) deviations = target - sum(weights*target)
   end function deviations

   !> The sd of a measurement, or more where the draws cannot resolve it.
   pure real(wp) function kernel_sd(candidates, c)
      type(candidates_type), intent(in) :: candidates
      integer, intent(in) :: c
      real(wp) :: mean

      associate (predicted => candidates%predicted(:, c))
         mean = sum(predicted)/size(predicted)
         kernel_sd = max(candidates%sd(c), &
            & least_kernel*sqrt(sum((predicted - mean)**2)/size(predicted)))
      end associate
   end function kernel_sd

   !> Gain of every candidate, averaged over scenarios: nats, or the share of the target's expected
   !> variance that goes.
   subroutine expected_gains(candidates, weights, threads, gains)
      type(candidates_type), intent(in) :: candidates
      !> weights(draw, scenario), each of sum 1.
      real(wp), intent(in), contiguous :: weights(:, :)
      integer, intent(in) :: threads
      !> (candidate).
      real(wp), intent(out) :: gains(:)
      real(wp) :: before
      integer :: c, r

      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 4) private(r)
      do c = 1, size(gains)
         gains(c) = sum([(gain_of_candidate(candidates, c, weights(:, r)), r=1, size(weights, 2))])
      end do
      !$omp end parallel do
      before = size(weights, 2)
      if (size(candidates%target) > 0) then
         before = sum([(sum(weights(:, r)*deviations(candidates%target, weights(:, r))**2), r=1, &
            & size(weights, 2))])
      end if
      gains = gains/max(tiny(1.0_wp), before)
   end subroutine expected_gains

   !> Choose candidates of the largest gain over cost one after another, averaged over `scenarios`
   !> of what the earlier ones say, each given those before it, no two of them near each other;
   !> fewer than `count` where no more are left.
   subroutine choose_measurements(candidates, count, scenarios, seed, threads, suggestions)
      type(candidates_type), intent(in) :: candidates
      integer, intent(in) :: count, scenarios, seed, threads
      type(suggestions_type), intent(out) :: suggestions
      !> Of the random stream of the scenarios' noise, beside those of chains and predictions.
      integer, parameter :: stream_number = -1
      type(random_stream_type) :: stream
      real(wp), allocatable :: weights(:, :), values(:)
      real(wp) :: z, measured, sd
      logical, allocatable :: free(:)
      integer :: i, r, c, n, draws

      draws = size(candidates%predicted, 1)
      allocate (values(size(candidates%predicted, 2)), weights(draws, 1), suggestions%chosen(0), &
         & suggestions%gains(0), suggestions%within(0))
      weights = 1.0_wp/draws
      free = spread(.true., 1, size(values))
      stream = new_random_stream(seed, stream_number)
      do i = 1, count
         if (.not. any(free)) exit
         call expected_gains(candidates, weights, threads, values)
         if (i == 1) suggestions%first_gains = values
         c = maxloc(values/candidates%cost, dim=1, mask=free)
         suggestions%chosen = [suggestions%chosen, c]
         suggestions%gains = [suggestions%gains, values(c)]
         suggestions%within = [suggestions%within, 0.0_wp]
         free(c) = .false.
         n = size(candidates%angle, 1)
         if (c <= n) then
            associate (angle => candidates%angle(:, c))
               suggestions%within(i) = maxval(angle, &
                  & mask=angle < minval(angle, mask=values(:n) < alike*values(c)))
               where (angle < candidates%least_angle) free(:n) = .false.
            end associate
         end if
         if (i == 1 .and. count > 1) weights = spread(weights(:, 1), 2, max(1, scenarios))
         sd = kernel_sd(candidates, c)
         do r = 1, size(weights, 2)
            call stream%normal(z)
            ! Truths are spread evenly over the draws, the same in every round.
            measured = candidates%predicted(1 + int((r - 0.5_wp)/size(weights, 2)*draws), c) + sd*z
            weights(:, r) = weights(:, &
               & r)*exp(-0.5_wp*((measured - candidates%predicted(:, c))/sd)**2)
            weights(:, r) = weights(:, r)/sum(weights(:, r))
         end do
      end do
   end subroutine choose_measurements
end module next_measurement
