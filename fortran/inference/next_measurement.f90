!> Expected gain from one more measurement, from draws of the posterior and their predictions at
!> each candidate.
!>
!> A measurement v at a candidate has the density p(v) = sum_s w_s N(v; m_s, sd²) over the draws s.
!> The predictions m_s include the errors that measurements share (of calibration, of the
!> surrogate), drawn with the constants. The expected information on the constants alone is the
!> entropy of p less that of v at known constants, which is due to the noise and the shared errors
!> together. The expected variance of a target after the measurement is the integral of p(v) times
!> the variance under the weights w_s N(v; m_s, sd²). Both are integrals over the one variable v,
!> computed on a grid, without a normal approximation of the posterior and without Monte Carlo
!> noise.
!>
!> A kernel narrower than the distance between draws would resolve single draws and not their
!> density, so its sd is at least a share of the spread of the predictions. The entropy of the noise
!> is that of the true sd. This bounds the cost, and the gain of precise measurements.
!>
!> Several measurements are chosen one after another. The results of the earlier ones are not known
!> yet, so the gain is averaged over scenarios: a draw serves as the truth, noise is added, and the
!> draws are weighted by the result of that scenario.
module next_measurement
   use observables, only: path_type
   use kinds, only: pi, wp
   use random, only: new_random_stream, random_stream_type
   implicit none
   private
   public :: candidates_type, suggestions_type, expected_gains, choose_measurements

   !> Bins of the draws and points of the integral per sd of the kernel, and half the width of the
   !> kernel in sds.
   integer, parameter :: bins_per_sd = 10, points_per_sd = 2, half_width = 6
   integer, parameter :: step = bins_per_sd/points_per_sd, half_bins = half_width*bins_per_sd
   !> Least share of the largest gain that counts as alike: the region of such directions helps to
   !> find a grain.
   real(wp), parameter :: alike = 0.9_wp
   !> Least sd of the kernel, as a share of the sd of the predictions: 2000 draws are dense enough
   !> for it.
   real(wp), parameter :: least_kernel = 0.02_wp

   type :: candidates_type
      !> Candidates, first moduli, then speeds: Bunge-Euler angles, degrees, (3, candidate), and
      !> costs, (candidate).
      real(wp), allocatable :: euler_deg(:, :), cost(:)
      !> Path of the wave of each candidate, and the number of its grain, or 0, (candidate).
      type(path_type), allocatable :: paths(:)
      integer, allocatable :: grain(:)
      !> Prediction of each draw, GPa or m/s, and its variance at known constants; (draw,
      !> candidate).
      real(wp), allocatable :: predicted(:, :), shared_variance(:, :)
      !> Standard deviation of the measurement's own error, (candidate).
      real(wp), allocatable :: sd(:)
      !> Quantity that the measurements are to determine, (draw). If empty, they determine all
      !> constants.
      real(wp), allocatable :: target(:)
      !> Angle between any two of the first candidates, and the angle below which two of them are
      !> too close for both to be measured; radians.
      real(wp), allocatable :: angle(:, :)
      real(wp) :: least_angle = 0.0_wp
   end type candidates_type

   type :: suggestions_type
      !> Numbers of the chosen candidates, the best first, and the gain of each given those before
      !> it.
      integer, allocatable :: chosen(:)
      real(wp), allocatable :: gains(:)
      !> Radius of the region about each in which all candidates have gains alike, radians; 0 if
      !> there is none.
      real(wp), allocatable :: within(:)
      !> Gain of every candidate as the first measurement.
      real(wp), allocatable :: first_gains(:)
   end type suggestions_type

contains

   !> Gain of a measurement at a candidate: nats, or with a target the decrease of its variance, in
   !> its squared unit.
   pure real(wp) function gain_of_candidate(candidates, c, weights) result(gain)
      type(candidates_type), intent(in) :: candidates
      integer, intent(in) :: c
      !> Weights of the draws, of sum 1.
      real(wp), intent(in), contiguous :: weights(:)
      real(wp), allocatable :: bins(:, :), deviation(:)
      real(wp) :: kernel(2*half_bins + 1), width, low, position, powers(3), entropy, &
         & variance_left, sd
      integer :: s, k, n, i

      deviation = deviations(candidates%target, weights)
      associate (predicted => candidates%predicted(:, c))
         sd = kernel_sd(candidates, c)
         width = sd/bins_per_sd
         low = minval(predicted)
         n = int((maxval(predicted) - low)/width) + 2
         allocate (bins(3, -2*half_bins:n + 2*half_bins), source=0.0_wp)
         do s = 1, size(predicted)
            position = (predicted(s) - low)/width
            k = int(position)
            powers = weights(s)*[1.0_wp, deviation(s), deviation(s)**2]
            bins(:, k) = bins(:, k) + (1.0_wp - (position - k))*powers
            bins(:, k + 1) = bins(:, k + 1) + (position - k)*powers
         end do
      end associate
      kernel = [(exp(-0.5_wp*(real(i, wp)/bins_per_sd)**2)/(sqrt(2.0_wp*pi)*sd), &
         & i=-half_bins, half_bins)]
      entropy = 0.0_wp
      variance_left = 0.0_wp
      do k = -half_bins, n + half_bins, step
         powers = matmul(bins(:, k - half_bins:k + half_bins), kernel)
         if (powers(1) <= 1.0e-30_wp/sd) cycle
         entropy = entropy - powers(1)*log(powers(1))*step*width
         variance_left = variance_left + (powers(3) - powers(2)**2/powers(1))*step*width
      end do
      gain = sum(weights*deviation**2) - variance_left
      if (size(candidates%target) == 0) then
         associate (variance => candidates%sd(c)**2 + candidates%shared_variance(:, c))
            gain = entropy - 0.5_wp*sum(weights*log(2.0_wp*pi*exp(1.0_wp)*variance))
         end associate
      end if
   end function gain_of_candidate

   !> Deviation of each draw's target from the mean; 0 without a target.
   pure function deviations(target, weights)
      !> Target, (draw) or empty; weights of sum 1, (draw).
      real(wp), intent(in) :: target(:), weights(:)
      real(wp) :: deviations(size(weights))

      deviations = 0.0_wp
      if (size(target) > 0) deviations = target - sum(weights*target)
   end function deviations

   !> Standard deviation of a measurement, or a larger one if the draws cannot resolve it.
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

   !> Gain of every candidate, averaged over scenarios: nats, or the relative decrease of the
   !> target's expected variance.
   subroutine expected_gains(candidates, weights, threads, gains)
      type(candidates_type), intent(in) :: candidates
      !> Weights, (draw, scenario), each scenario of sum 1.
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

   !> Choose candidates one after another, each of the largest gain over cost given those before it.
   !> The gain is averaged over `scenarios` of the results of the earlier ones. No two are too close
   !> to each other. Fewer than `count` are chosen if no more remain.
   subroutine choose_measurements(candidates, count, scenarios, seed, threads, suggestions)
      type(candidates_type), intent(in) :: candidates
      integer, intent(in) :: count, scenarios, seed, threads
      type(suggestions_type), intent(out) :: suggestions
      !> Number of the random stream for the scenarios' noise. Chains and predictions use others.
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
            ! The truths are spread evenly over the draws, and are the same in every round.
            measured = candidates%predicted(1 + int((r - 0.5_wp)/size(weights, 2)*draws), c) + sd*z
            weights(:, r) &
               & = weights(:, r)*exp(-0.5_wp*((measured - candidates%predicted(:, c))/sd)**2)
            weights(:, r) = weights(:, r)/sum(weights(:, r))
         end do
      end do
   end subroutine choose_measurements
end module next_measurement
