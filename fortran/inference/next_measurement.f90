!> What one more measurement is expected to teach, from draws of the posterior and what each predicts at each candidate.
!>
!> A measurement v at a candidate has the density p(v) = sum_s w_s N(v; m_s, sd²) over the draws s. Its expected information gain
!> about the draws is the entropy of p less that of the noise; the variance of a target that is left is the integral of p(v) times
!> the variance under the weights w_s N(v; m_s, sd²). Both are integrals over the one variable v, done on a grid: no normal
!> approximation of the posterior and no noise of a simulation.
!>
!> Several measurements are chosen one after another. What the earlier ones will say is not known, so it is averaged over scenarios:
!> a draw taken as the truth, noise added, and the draws weighted by what was measured in that scenario.
module next_measurement
   use distinct_directions, only: angle_between, region_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: pi, wp
   use random, only: new_random_stream, random_stream_type
   implicit none
   private
   public :: expected_gains, choose_measurements

   !> Bins of the draws and points of the integral per sd of the noise, and half the width of its kernel in sds.
   integer, parameter :: bins_per_sd = 10, points_per_sd = 2, reach = 6
   integer, parameter :: step = bins_per_sd/points_per_sd

contains

   !> Gain of a measurement with noise `sd` whose value the draws predict as `predicted`.
   !>
   !> With a target: the share of its variance (`left` of it remains, in units of its square) that goes; else nats.
   pure subroutine gain_of_candidate(predicted, weights, sd, target, gain, left)
      real(wp), intent(in), contiguous :: predicted(:), weights(:)
      real(wp), intent(in) :: sd
      !> Empty for the information gain.
      real(wp), intent(in), contiguous :: target(:)
      real(wp), intent(out) :: gain, left
      real(wp), allocatable :: bins(:, :)
      real(wp) :: kernel(-reach*bins_per_sd:reach*bins_per_sd), low, width, place, share, p, first, second, mean, variance
      integer :: s, k, n, i, margin

      margin = 2*reach*bins_per_sd
      width = sd/bins_per_sd
      low = minval(predicted)
      n = int((maxval(predicted) - low)/width) + 2
      allocate (bins(3, -margin:n + margin))
      bins = 0.0_wp
      mean = 0.0_wp
      if (size(target) > 0) mean = sum(weights*target)
      variance = 0.0_wp
      do s = 1, size(predicted)
         place = (predicted(s) - low)/width
         k = int(place)
         share = (place - k)*weights(s)
         bins(1, k) = bins(1, k) + weights(s) - share
         bins(1, k + 1) = bins(1, k + 1) + share
         if (size(target) == 0) cycle
         variance = variance + weights(s)*(target(s) - mean)**2
         bins(2, k) = bins(2, k) + (weights(s) - share)*(target(s) - mean)
         bins(2, k + 1) = bins(2, k + 1) + share*(target(s) - mean)
         bins(3, k) = bins(3, k) + (weights(s) - share)*(target(s) - mean)**2
         bins(3, k + 1) = bins(3, k + 1) + share*(target(s) - mean)**2
      end do
      do i = lbound(kernel, 1), ubound(kernel, 1)
         kernel(i) = exp(-0.5_wp*(real(i, wp)/bins_per_sd)**2)/(sqrt(2.0_wp*pi)*sd)
      end do
      gain = 0.0_wp
      left = 0.0_wp
      do k = -reach*bins_per_sd, n + reach*bins_per_sd, step
         p = 0.0_wp
         first = 0.0_wp
         second = 0.0_wp
         do i = -reach*bins_per_sd, reach*bins_per_sd
            p = p + kernel(i)*bins(1, k + i)
            first = first + kernel(i)*bins(2, k + i)
            second = second + kernel(i)*bins(3, k + i)
         end do
         if (p <= 1.0e-30_wp/sd) cycle
         gain = gain - p*log(p)*step*width
         left = left + (second - first**2/p)*step*width
      end do
      if (size(target) > 0) then
         gain = 0.0_wp
         if (variance > 0.0_wp) gain = 1.0_wp - left/variance
      else
         gain = gain - 0.5_wp*log(2.0_wp*pi*exp(1.0_wp)*sd**2)
      end if
   end subroutine gain_of_candidate

   !> Gain of every candidate, averaged over scenarios: nats, or the share of the target's expected variance that goes.
   subroutine expected_gains(predicted, weights, sd, target, threads, gains)
      !> predicted(draw, candidate), GPa; weights(draw, scenario), each of sum 1.
      real(wp), intent(in), contiguous :: predicted(:, :), weights(:, :)
      real(wp), intent(in) :: sd
      real(wp), intent(in), contiguous :: target(:)
      integer, intent(in) :: threads
      real(wp), intent(out) :: gains(:)
      real(wp) :: gain, left, before, remaining, mean
      integer :: c, r

      before = 0.0_wp
      do r = 1, size(weights, 2)
         if (size(target) == 0) exit
         mean = sum(weights(:, r)*target)
         before = before + sum(weights(:, r)*(target - mean)**2)
      end do
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 4) private(r, gain, left, remaining)
      do c = 1, size(gains)
         gains(c) = 0.0_wp
         remaining = 0.0_wp
         do r = 1, size(weights, 2)
            call gain_of_candidate(predicted(:, c), weights(:, r), sd, target, gain, left)
            gains(c) = gains(c) + gain/size(weights, 2)
            remaining = remaining + left
         end do
         if (size(target) > 0) gains(c) = merge(1.0_wp - remaining/before, 0.0_wp, before > 0.0_wp)
      end do
      !$omp end parallel do
   end subroutine expected_gains

   !> Choose `chosen` candidates one after another, each given those before it; no two of them less than `separation` apart.
   subroutine choose_measurements(predicted, directions, sd, target, separation, region, scenarios, seed, threads, chosen, gains, &
      & first_gains, error)
      real(wp), intent(in), contiguous :: predicted(:, :)
      !> Unit vectors (3, candidate) in crystal axes.
      real(wp), intent(in), contiguous :: directions(:, :)
      real(wp), intent(in) :: sd
      real(wp), intent(in), contiguous :: target(:)
      !> Radians, between directions that the crystal of `region` can tell apart.
      real(wp), intent(in) :: separation
      type(region_type), intent(in) :: region
      integer, intent(in) :: scenarios, seed, threads
      !> Numbers of candidates, 0 where none is left; their gains, and the gain of every candidate as the first.
      integer, intent(out) :: chosen(:)
      real(wp), intent(out) :: gains(:), first_gains(:)
      type(error_type), allocatable, intent(out) :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: weights(:, :), values(:)
      real(wp) :: z, measured
      logical :: free(size(predicted, 2))
      integer :: i, r, c, draws

      draws = size(predicted, 1)
      chosen = 0
      gains = 0.0_wp
      if (.not. sd > 0.0_wp) then
         call raise(error, 'the sd of the next measurement must be positive', exit_bad_input)
         return
      end if
      allocate (values(size(free)), weights(draws, 1))
      weights = 1.0_wp/draws
      free = .true.
      stream = new_random_stream(seed, 0)
      do i = 1, size(chosen)
         call expected_gains(predicted, weights, sd, target, threads, values)
         if (i == 1) first_gains = values
         if (.not. any(free)) return
         c = maxloc(values, dim=1, mask=free)
         chosen(i) = c
         gains(i) = values(c)
         do r = 1, size(free)
            if (angle_between(region, directions(:, r), directions(:, c)) < separation) free(r) = .false.
         end do
         free(c) = .false.
         if (i == 1 .and. size(chosen) > 1) then
            deallocate (weights)
            allocate (weights(draws, max(1, scenarios)))
            weights = 1.0_wp/draws
         end if
         do r = 1, size(weights, 2)
            call stream%normal(z)
            ! Truths are spread evenly over the draws, the same in every round.
            measured = predicted(1 + int((r - 0.5_wp)/size(weights, 2)*draws), c) + sd*z
            weights(:, r) = weights(:, r)*exp(-0.5_wp*((measured - predicted(:, c))/sd)**2)
            weights(:, r) = weights(:, r)/sum(weights(:, r))
         end do
      end do
   end subroutine choose_measurements
end module next_measurement
