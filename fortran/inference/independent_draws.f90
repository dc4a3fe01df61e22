!> Independent draws of a mixture as a chain of a density, and the estimates of their weights.
!>
!> Each draw is weighted by the ratio of the density to that of the mixture. As proposals of
!> Metropolis and Hastings the draws make a chain of the density itself. The weights also give the
!> integral of the density. They can be trusted if the tail of their distribution, fitted by a
!> generalised Pareto distribution, has a shape k below 0.7 (Vehtari et al., J. Mach. Learn. Res.
!> 25, 72, 2024).
module independent_draws
   use abstract_sampler, only: chain_type, estimate_type, target_type
   use kinds, only: i8, wp
   use moves, only: mixture_move_type, points_type
   use random, only: random_stream_type
   use running_command, only: stop_requested
   use statistics, only: sorted_values
   implicit none
   private
   public :: draw_independently, agree, pareto_shape

contains

   !> Make a chain, in working coordinates, whose proposals are draws of a mixture, which is first
   !> improved by importance sampling. The chain has an estimate if its weights can be trusted.
   subroutine draw_independently(mixture, target, stream, least_draws, chain, is_made)
      !> On entry it is fitted to the points of the burn-in.
      type(mixture_move_type), intent(inout) :: mixture
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> Least number of proposals.
      integer, intent(in) :: least_draws
      type(chain_type), intent(inout) :: chain
      !> Whether there is a chain: the mixture fits well enough.
      logical, intent(out) :: is_made
      !> Rounds of draws that improve the mixture, and of those that are proposals. A longer search
      !> would cost more than the draws that it saves.
      integer, parameter :: least_rounds = 4, most_rounds = 12, most_finals = 3, &
         & least_in_round = 600, most_in_round = 1200
      !> Effective share of the draws from which on they are proposals.
      real(wp), parameter :: good_quality = 0.5_wp
      type(estimate_type) :: estimate
      integer :: round, n, finals

      is_made = .false.
      if (allocated(chain%estimate)) deallocate (chain%estimate)
      do round = 1, most_rounds
         call mixture%draw_inside(target, stream, min(most_in_round, &
            & max(least_in_round, size(chain%log_density)/2)))
         if (stop_requested() .or. size(mixture%log_weights) == 0) return
         call mixture%learn()
         ! The mixture must have shown that it is good: its draws may have found a tail.
         if (mixture%rounds >= least_rounds .and. mixture%quality > good_quality) exit
      end do
      do finals = 1, most_finals
         if (mixture%fits_badly()) return
         n = max(least_draws, size(chain%log_density), &
            & ceiling(proposals_of(mixture%quality)*size(chain%log_density)))
         call mixture%draw_inside(target, stream, n)
         if (stop_requested() .or. size(mixture%log_weights) < n) return
         estimate = estimate_of(mixture%pool%w, mixture%log_weights)
         if (estimate%is_reliable .or. finals == most_finals) exit
         call mixture%learn()
      end do
      is_made = .true.
      call propose_all(mixture%pool, mixture%log_weights, stream, chain)
      if (.not. estimate%is_reliable) return
      ! The mixture is a density in whitened coordinates.
      estimate%log_integral = estimate%log_integral + log(mixture%share_inside) &
         & + mixture%whitening%log_volume
      chain%estimate = estimate
   end subroutine draw_independently

   !> Number of proposals for a sample of the chain, with which about half of the samples are
   !> effective ones.
   pure real(wp) function proposals_of(quality)
      !> Effective share of the draws.
      real(wp), intent(in) :: quality

      proposals_of = 0.5_wp*(2.0_wp - quality)/quality
   end function proposals_of

   !> The chain of Metropolis and Hastings with some proposals. It starts at one that is drawn by
   !> the weights.
   subroutine propose_all(points, log_weights, stream, chain)
      class(points_type), intent(in) :: points
      real(wp), intent(in) :: log_weights(:)
      type(random_stream_type), intent(inout) :: stream
      type(chain_type), intent(inout) :: chain
      real(wp) :: v, cumulated, greatest
      integer :: i, k, n_samples, present_one, accepted

      greatest = maxval(log_weights)
      call stream%uniform(v)
      v = v*sum(exp(log_weights - greatest))
      cumulated = 0.0_wp
      do present_one = 1, size(log_weights) - 1
         cumulated = cumulated + exp(log_weights(present_one) - greatest)
         if (v < cumulated) exit
      end do
      accepted = 0
      k = 0
      n_samples = size(chain%log_density)
      do i = 1, size(log_weights)
         call stream%uniform(v)
         if (log(v) < log_weights(i) - log_weights(present_one)) then
            present_one = i
            accepted = accepted + 1
         end if
         ! Samples are at equal distances.
         if (int(i, i8)*n_samples/size(log_weights) == k) cycle
         k = k + 1
         chain%draws(:, k) = points%w(:, present_one)
         chain%log_density(k) = points%log_density(present_one)
      end do
      chain%acceptance = real(accepted, wp)/size(log_weights)
   end subroutine propose_all

   !> Integral, means and sds by weighted draws.
   pure type(estimate_type) function estimate_of(w, log_weights) result(estimate)
      !> Working coordinates, (dimension, draw), and logarithms of the weights, (draw).
      real(wp), intent(in) :: w(:, :), log_weights(:)
      !> Greatest k; and greatest weight, in mean weights, and share in all weights of one draw: the
      !> chain stays at it for about as many proposals, and this share of its samples. Of many draws
      !> the greatest weight may be larger, if its share is small.
      real(wp), parameter :: most_k = 0.7_wp, most_weight = 25.0_wp, most_share = 0.02_wp, &
         & small_share = 0.0005_wp
      real(wp), allocatable :: weights(:), squares(:)
      integer :: j, n

      n = size(log_weights)
      weights = exp(log_weights - maxval(log_weights))
      estimate%log_integral = maxval(log_weights) + log(sum(weights)/n)
      weights = weights/sum(weights)
      estimate%log_integral_error = sqrt(max(0.0_wp, sum(weights**2) - 1.0_wp/n))
      estimate%pareto_k = pareto_shape(weights)
      estimate%mean = matmul(w, weights)
      estimate%sd = estimate%mean
      estimate%mean_error = estimate%mean
      estimate%sd_error = estimate%mean
      do j = 1, size(w, 1)
         squares = (w(j, :) - estimate%mean(j))**2
         associate (variance => sum(weights*squares))
            estimate%sd(j) = sqrt(variance)
            estimate%mean_error(j) = sqrt(sum(weights**2*squares))
            estimate%sd_error(j) = sqrt(sum((weights*(squares - variance))**2)/(4.0_wp*variance))
         end associate
         squares = weights*squares
         estimate%pareto_k = max(estimate%pareto_k, pareto_shape(squares))
      end do
      estimate%is_reliable = estimate%pareto_k < most_k &
         & .and. maxval(weights) < min(most_share, max(most_weight/n, small_share))
   end function estimate_of

   !> Whether two estimates agree within three standard errors and these tolerances: 0.02 of the
   !> logarithm of the integral, a tenth of an sd of the means, and 5 % of the sds.
   pure logical function agree(a, b)
      type(estimate_type), intent(in) :: a, b
      real(wp), parameter :: of_integral = 0.02_wp, of_mean = 0.1_wp, of_sd = 0.05_wp
      real(wp) :: sd(size(a%sd))

      sd = 0.5_wp*(a%sd + b%sd)
      agree = is_near(a%log_integral - b%log_integral, of_integral, a%log_integral_error, &
         & b%log_integral_error)
      agree = agree .and. all(is_near(a%mean - b%mean, of_mean*sd, a%mean_error, b%mean_error)) &
         & .and. all(is_near(a%sd - b%sd, of_sd*sd, a%sd_error, b%sd_error))
   end function agree

   !> Whether a difference is within the sum of a tolerance and three standard errors.
   elemental logical function is_near(difference, tolerance, error_a, error_b)
      real(wp), intent(in) :: difference, tolerance
      !> Standard errors of both values.
      real(wp), intent(in) :: error_a, error_b

      is_near = abs(difference) < tolerance + 3.0_wp*hypot(error_a, error_b)
   end function is_near

   !> Shape k of a generalised Pareto distribution that is fitted to the greatest of some positive
   !> values: the estimate of Zhang & Stephens (Technometrics 51, 316, 2009), with a weak prior
   !> about 0.5 that is worth ten values. As many values as Vehtari et al. take are the tail. It is
   !> huge for fewer than 25 values.
   pure real(wp) function pareto_shape(values) result(k)
      real(wp), intent(in) :: values(:)
      real(wp), parameter :: prior_k = 0.5_wp, prior_size = 10.0_wp
      real(wp), allocatable :: sorted(:), x(:), theta(:), shapes(:), heights(:)
      real(wp) :: quartile
      integer :: n, m, j

      k = huge(1.0_wp)
      n = min(size(values)/5, ceiling(3.0_wp*sqrt(real(size(values), wp))))
      if (n < 5) return
      call sorted_values(size(values), values, sorted)
      x = sorted(size(sorted) - n + 1:) - sorted(size(sorted) - n)
      if (.not. x(n) > 0.0_wp) then
         ! The greatest values are equal.
         k = 0.0_wp
         return
      end if
      quartile = max(x(nint(n/4.0_wp)), 1.0e-10_wp*x(n))
      m = 30 + int(sqrt(real(n, wp)))
      theta = [(1.0_wp/x(n) + (1.0_wp - sqrt(m/(j - 0.5_wp)))/(3.0_wp*quartile), j=1, m)]
      allocate (shapes(m), heights(m))
      do j = 1, m
         shapes(j) = sum(log(1.0_wp - theta(j)*x))/n
         heights(j) = n*(log(-theta(j)/shapes(j)) - shapes(j) - 1.0_wp)
      end do
      heights = exp(heights - maxval(heights))
      associate (best => sum(heights*theta)/sum(heights))
         k = (sum(log(1.0_wp - best*x)) + prior_size*prior_k)/(n + prior_size)
      end associate
   end function pareto_shape
end module independent_draws
