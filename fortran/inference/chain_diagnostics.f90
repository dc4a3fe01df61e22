!> Convergence diagnostics of chains: effective sample sizes and R-hat of rank-normalised split
!> chains (Vehtari et al., Bayesian Anal. 16, 667, 2021), by the definitions of ArviZ' ess (bulk,
!> tail) and rhat (rank).
!>
!> The sums of autocovariances over lags end where Geyer's sequence ends. Mixed chains need a few
!> lags, stuck ones up to samples²/8 products for each half. Long arrays are allocatable, since
!> other arrays would be on a thread's stack.
module chain_diagnostics
   use kinds, only: nan, pi, wp
   use linear_algebra, only: dot
   use statistics, only: median, sort_order, sorted_values
   implicit none
   private
   public :: diagnostics_type, diagnose_chains, normal_quantile

   type :: diagnostics_type
      !> Effective sample size for the centre, and for the 5 % and 95 % quantiles (the lesser).
      real(wp) :: ess_bulk = 0.0_wp, ess_tail = 0.0_wp
      !> Potential scale reduction, of the values or of their distance from the median (the larger).
      real(wp) :: r_hat = 0.0_wp
   end type diagnostics_type

   !> A chain of fewer samples has no diagnostics.
   integer, parameter :: least_samples = 4
   real(wp), parameter :: tail = 0.05_wp
   !> Values with a smaller range count as constant.
   real(wp), parameter :: resolution = 1.0e-15_wp

contains

   !> Diagnostics of one parameter. They are NaN for fewer than four samples; R-hat is also NaN for
   !> one chain and for constant values.
   pure type(diagnostics_type) function diagnose_chains(draws) result(diagnostics)
      !> (sample, chain), finite.
      real(wp), intent(in), contiguous :: draws(:, :)
      real(wp), allocatable :: halves(:, :), work(:, :), sorted(:)
      real(wp) :: folded
      integer :: n, j

      diagnostics = diagnostics_type(nan, nan, nan)
      if (size(draws, 1) < least_samples) return
      ! The first and the last half of each chain; a sample in the middle is left out.
      n = size(draws, 1)/2
      allocate (halves(n, 2*size(draws, 2)))
      do j = 1, size(draws, 2)
         halves(:, 2*j - 1) = draws(:n, j)
         halves(:, 2*j) = draws(size(draws, 1) - n + 1:, j)
      end do
      call sorted_values(size(draws), draws, sorted)
      ! The effective sample size of a quantile is that of whether a draw is at or below it.
      work = merge(1.0_wp, 0.0_wp, halves <= quantile(sorted, tail))
      diagnostics%ess_tail = effective_size(work)
      work = merge(1.0_wp, 0.0_wp, halves <= quantile(sorted, 1.0_wp - tail))
      diagnostics%ess_tail = min(diagnostics%ess_tail, effective_size(work))
      call normal_scores(size(halves), halves, work)
      diagnostics%ess_bulk = effective_size(work)
      if (size(draws, 2) > 1) then
         diagnostics%r_hat = scale_reduction(work)
         halves = abs(halves - median(size(halves), halves))
         call normal_scores(size(halves), halves, work)
         folded = scale_reduction(work)
         if (folded > diagnostics%r_hat) diagnostics%r_hat = folded
      end if
   end function diagnose_chains

   !> Normal quantiles of the ranks (Blom, 1958), equal values at their mean rank.
   pure subroutine normal_scores(n, values, scores)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      real(wp), intent(out) :: scores(n)
      integer, allocatable :: order(:)
      integer :: first, last

      allocate (order(n))
      call sort_order(values, order)
      first = 1
      do while (first <= n)
         last = first
         do while (last < n)
            if (values(order(last + 1)) > values(order(first))) exit
            last = last + 1
         end do
         scores(order(first:last)) = normal_quantile((0.5_wp*(first + last) - 0.375_wp) &
            & /(n + 0.25_wp))
         first = last + 1
      end do
   end subroutine normal_scores

   !> Quantile `p` of two or more sorted values, linear between neighbours (type 7 of Hyndman & Fan,
   !> Am. Stat. 50, 361, 1996).
   !>
   !> The order of operations is that of ArviZ: where neighbours are equal, the last bit decides
   !> whether they are below the quantile. The parentheses prevent fused operations.
   pure real(wp) function quantile(sorted, p)
      real(wp), intent(in) :: sorted(:), p
      real(wp) :: position, share
      integer :: k

      position = (size(sorted)*p) + (1.0_wp - p)
      k = max(1, min(size(sorted) - 1, floor(position)))
      share = max(0.0_wp, min(1.0_wp, position - k))
      quantile = ((1.0_wp - share)*sorted(k)) + (share*sorted(k + 1))
   end function quantile

   !> Number of independent draws with the same variance of the mean, by Geyer's initial monotone
   !> positive sequence of autocorrelations (Geyer, Stat. Sci. 7, 473, 1992) over all chains.
   pure real(wp) function effective_size(chains) result(ess)
      !> (sample, chain), two chains or more of two samples or more.
      real(wp), intent(in), contiguous :: chains(:, :)
      real(wp), allocatable :: x(:, :), mean(:), rho(:)
      real(wp) :: within, total, even, odd, tau
      integer :: n, t, last

      n = size(chains, 1)
      ess = size(chains)
      if (maxval(chains) - minval(chains) < resolution) return
      mean = sum(chains, 1)/n
      x = chains - spread(mean, 1, n)
      within = autocovariance(x, 0)
      total = within + variance(mean)
      within = within*n/(n - 1.0_wp)
      allocate (rho(0:n - 1), source=0.0_wp)
      even = 1.0_wp
      odd = 1.0_wp - (within - autocovariance(x, 1))/total
      rho(0) = even
      rho(1) = odd
      t = 1
      do while (t < n - 3 .and. even + odd > 0.0_wp)
         even = 1.0_wp - (within - autocovariance(x, t + 1))/total
         odd = 1.0_wp - (within - autocovariance(x, t + 2))/total
         if (even + odd >= 0.0_wp) rho(t + 1:t + 2) = [even, odd]
         t = t + 2
      end do
      last = t - 2
      ! The last even term lowers the variance of the estimate for antithetic chains, as in ArviZ.
      if (even > 0.0_wp) rho(last + 1) = even
      do t = 1, last - 2, 2
         if (rho(t + 1) + rho(t + 2) > rho(t - 1) + rho(t)) then
            rho(t + 1:t + 2) = 0.5_wp*(rho(t - 1) + rho(t))
         end if
      end do
      tau = -1.0_wp + 2.0_wp*sum(rho(0:last)) + rho(last + 1)
      ess = ess/max(tau, 1.0_wp/log10(ess))
   end function effective_size

   !> Autocovariance at lag `t`, the mean over the chains.
   pure real(wp) function autocovariance(x, t)
      !> (sample, chain), each chain of mean zero.
      real(wp), intent(in), contiguous :: x(:, :)
      integer, intent(in) :: t
      integer :: j

      autocovariance = sum([(dot(x(:size(x, 1) - t, j), x(t + 1:, j)), j=1, size(x, 2))])/size(x)
   end function autocovariance

   !> Square root of the variance over all chains divided by that within them (Gelman et al.,
   !> Bayesian Data Analysis, 3rd ed., 11.4). It is NaN for constant values.
   pure real(wp) function scale_reduction(chains)
      !> (sample, chain)
      real(wp), intent(in), contiguous :: chains(:, :)
      real(wp) :: mean(size(chains, 2)), within
      integer :: n, i

      scale_reduction = nan
      if (maxval(chains) - minval(chains) < resolution) return
      n = size(chains, 1)
      mean = sum(chains, 1)/n
      within = sum([(variance(chains(:, i)), i=1, size(chains, 2))])/size(chains, 2)
      scale_reduction = sqrt((n*variance(mean)/within + n - 1.0_wp)/n)
   end function scale_reduction

   !> Unbiased variance.
   pure real(wp) function variance(values)
      real(wp), intent(in), contiguous :: values(:)

      variance = sum((values - sum(values)/size(values))**2)/(size(values) - 1)
   end function variance

   !> Quantile `p` of the standard normal distribution, 0 < p < 1.
   !>
   !> Abramowitz & Stegun 26.2.23 has an error below 4.5e-4; each step of Halley's method cubes it.
   pure real(wp) function normal_quantile(p) result(x)
      real(wp), intent(in) :: p
      real(wp) :: lower, t, step
      integer :: i

      lower = min(p, 1.0_wp - p)
      t = sqrt(-2.0_wp*log(lower))
      x = (2.515517_wp + t*(0.802853_wp + t*0.010328_wp))/(1.0_wp &
         & + t*(1.432788_wp + t*(0.189269_wp + t*0.001308_wp))) - t
      do i = 1, 2
         step = (0.5_wp*erfc(-x/sqrt(2.0_wp)) - lower)*sqrt(2.0_wp*pi)*exp(0.5_wp*x**2)
         x = x - step/(1.0_wp + 0.5_wp*x*step)
      end do
      if (p > 0.5_wp) x = -x
   end function normal_quantile
end module chain_diagnostics
