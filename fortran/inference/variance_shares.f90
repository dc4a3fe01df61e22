!> Shares of the measurements, of the knowledge and of the prior in the variance of a quantity, and
!> the part of each source of error in it.
!>
!> Let s_i be the derivative of the log likelihood with respect to the measurement i. Then w_i =
!> Cov(c, s_i) over the draws is the derivative of the posterior mean of c with respect to that
!> measurement. The errors of the measurements, of covariance V, give c the variance wᵀ V w. For
!> normal errors of constant V this is aᵀ V⁻¹ a with a_i = Cov(c, M_i). The knowledge is treated
!> alike. The rest is the prior's: bounds, the default prior, the surrogate's domain. Covariances
!> need no slopes, so the shares are valid on a ridge. They are not for a posterior with several
!> modes, and are then NaN.
module variance_shares
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use kinds, only: nan, wp
   use linear_algebra, only: cholesky_factor, cholesky_solve
   use quantities, only: evaluate_draws
   use small_matrices, only: factor_columns
   implicit none
   private
   public :: shares_type, find_shares, verdict_of, error_sources, from_surrogate

   !> Sources of the errors of measurements: first those of each measurement alone, then those that
   !> measurements share. For speeds, all but the orientation count as 'velocities'.
   integer, parameter :: n_error_sources = 6
   character(len=*), parameter :: error_sources(n_error_sources) = [character(len=11) :: 'noise', &
      & 'surrogate', 'grains', 'orientation', 'calibration', 'velocities']
   integer, parameter :: from_noise = 1, from_surrogate = 2, from_grains = 3, &
      & from_orientation = 4, from_calibration = 5, from_velocities = 6

   type :: shares_type
      !> The shares sum to one, or are NaN.
      real(wp) :: measurements = 0.0_wp, knowledge = 0.0_wp, prior = 1.0_wp
      !> Parts of the variance, by `error_sources`, and by each known quantity.
      real(wp), allocatable :: by_source(:), by_quantity(:)
      !> Part of the prior's share that is that of the contrast of the laboratory.
      real(wp) :: contrast = 0.0_wp
      !> Derivatives of the mean with respect to each measurement, and to each known value.
      real(wp), allocatable :: by_measurement(:), by_known_value(:)
   end type shares_type

   !> Greatest sum of the shares of measurements and knowledge, and the number of its Monte Carlo
   !> errors by which it may be above that. Beyond, covariances do not describe the draws.
   real(wp), parameter :: greatest_sum = 1.05_wp, errors_above = 2.0_wp
   !> A quantity is determined if its relative sd and the prior's share are below this pair. It is
   !> not determined if either is above the second pair.
   real(wp), parameter :: determined(2) = [0.10_wp, 0.20_wp], not_determined(2) = [0.30_wp, 0.80_wp]

contains

   !> Compute the shares of quantities from draws.
   subroutine find_shares(posterior, draws, values, effective, threads, shares, error)
      type(posterior_type), intent(in) :: posterior
      !> Draws, (parameter, draw), and values of the quantities, (quantity, draw).
      real(wp), intent(in) :: draws(:, :), values(:, :)
      !> Effective number of the draws, 0 if the chains have not mixed.
      real(wp), intent(in) :: effective
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      type(shares_type), allocatable, intent(out) :: shares(:)
      type(error_type), allocatable, intent(out) :: error
      !> Number of draws for the variances of the errors, which hardly vary.
      integer, parameter :: few_draws = 200, block = 16
      real(wp), allocatable, dimension(:, :) :: moduli, shared, scores, known_values, centred, &
         & weights, parts, covariances, derivatives, factor
      real(wp), dimension(size(values, 1)) :: variance, total, of_contrast
      real(wp), dimension(posterior%n_grains) :: scales, residual, weight
      real(wp) :: greatest, unit
      integer :: i, j, n, q

      n = size(draws, 2)
      allocate (scores(posterior%n_grains, n), parts(n_error_sources, size(values, 1)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic) private(scales, shared, &
      !$omp & residual, weight, moduli, j)
      do i = 1, n, block
         moduli = posterior%moduli_at(draws(:, i:min(n, i + block - 1)))
         do j = 1, size(moduli, 2)
            call find_residuals(posterior, draws(:, i + j - 1), moduli(:, j), scales, shared, &
               & residual, weight)
            ! Derivatives of the log likelihood with respect to the measurements, 1/GPa.
            scores(:, i + j - 1) = -weight*residual/scales
         end do
      end do
      !$omp end parallel do
      call evaluate_draws(posterior%prior%knowledge%quantities, posterior%prior%class, draws, &
         & known_values)
      centred = values - spread(sum(values, 2)/n, 2, n)
      variance = max(tiny(1.0_wp), sum(centred**2, 2)/n)
      weights = matmul(scores, transpose(centred))/n
      call add_up_sources(posterior, draws(:, ::max(1, n/few_draws)), weights, parts)
      covariances = matmul(known_values, transpose(centred))/n
      factor = posterior%prior%knowledge%covariance
      derivatives = covariances
      call cholesky_factor(factor, error)
      if (allocated(error)) return
      call cholesky_solve(factor, derivatives)
      of_contrast = 0.0_wp
      if (posterior%infers_contrast) then
         i = posterior%n_constants + 1
         of_contrast = (matmul(centred, draws(i, :))/n/posterior%laboratory%contrast(2))**2
      end if
      allocate (shares(size(values, 1)))
      total = (sum(parts, 1) + sum(covariances*derivatives, 1))/variance
      ! A share is the square of a covariance over a variance. For normal draws its relative error
      ! is that of a variance.
      greatest = greatest_sum + errors_above*sqrt(2.0_wp/max(1.0_wp, effective))
      do q = 1, size(shares)
         ! A sum slightly above one is noise of the draws.
         unit = variance(q)*max(1.0_wp, total(q))
         if (.not. (effective > 0.0_wp .and. total(q) <= greatest)) unit = nan
         associate (share => shares(q))
            share%by_source = parts(:, q)/unit
            share%by_quantity = covariances(:, q)*derivatives(:, q)/unit
            share%measurements = sum(share%by_source)
            share%knowledge = sum(share%by_quantity)
            share%prior = max(0.0_wp, 1.0_wp - total(q)) + 0.0_wp*share%measurements
            share%contrast = min(share%prior, of_contrast(q)/unit)
            share%by_measurement = weights(:, q) + 0.0_wp*unit
            share%by_known_value = derivatives(:, q) + 0.0_wp*unit
         end associate
      end do
   end subroutine find_shares

   !> Variance that each source of error gives each quantity, wᵀ V_s w.
   subroutine add_up_sources(posterior, draws, weights, parts)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> Derivatives of the quantities with respect to the measurements, (measurement, quantity).
      real(wp), intent(in) :: weights(:, :)
      !> (source, quantity).
      real(wp), intent(out) :: parts(:, :)
      real(wp), dimension(posterior%n_grains, n_error_sources) :: own, own_mean
      real(wp), dimension(posterior%n_grains) :: precision, precision_mean, scales, modulus, &
         & slope, variance, value, map_slope
      real(wp), allocatable :: shared(:, :), effect(:, :), moduli(:, :)
      real(wp) :: tilt_slopes(posterior%n_grains, 2)
      integer :: i, j, n_moduli, n_untilted, source

      n_moduli = posterior%n_moduli
      n_untilted = posterior%n_calibrated + size(posterior%data%shared, 2)
      own_mean = 0.0_wp
      precision_mean = 0.0_wp
      parts = 0.0_wp
      do i = 1, size(draws, 2)
         moduli = posterior%moduli_at(draws(:, i:i))
         call find_residuals(posterior, draws(:, i), moduli(:, 1), scales, shared, value, precision)
         precision_mean = precision_mean + precision/scales**2/size(draws, 2)
         effect = matmul(transpose(shared*spread(scales, 2, posterior%n_shared)), weights)
         do j = 1, posterior%n_shared
            source = from_surrogate
            if (j > posterior%grains%n_columns) source = from_calibration
            if (source == from_calibration .and. all(abs(shared(:n_moduli, j)) <= 0.0_wp)) then
               source = from_velocities
            end if
            if (j > n_untilted) source = from_orientation
            parts(source, :) = parts(source, :) + effect(j, :)**2/size(draws, 2)
         end do
         ! Variances of the errors that grains do not share.
         call posterior%evaluate_grains(draws(:, i), posterior%stiffness(draws(:, i)), modulus, &
            & slope, variance, tilt_slopes, moduli(:, 1))
         value = modulus
         map_slope = 1.0_wp
         call posterior%observable%to_measured(value(:n_moduli), map_slope(:n_moduli))
         map_slope = map_slope*posterior%mean_factors(draws(:, i))
         own = 0.0_wp
         own(:, from_noise) = (posterior%scale_factor(draws(:, i))*posterior%data%sd)**2
         own(:, from_surrogate) = posterior%scatter*(slope*map_slope)**2
         own(:n_moduli, from_grains) &
            & = (posterior%grain_scatter(draws(:, i))*modulus(:n_moduli)*map_slope(:n_moduli))**2
         own(:, from_orientation) = max(0.0_wp, &
            & variance*map_slope**2 - own(:, from_surrogate) - own(:, from_grains))
         own(n_moduli + 1:, from_velocities) = own(n_moduli + 1:, from_noise)
         own(n_moduli + 1:, from_noise) = 0.0_wp
         own_mean = own_mean + own/size(draws, 2)
      end do
      ! A measurement counts by its mean precision, which for Student's t is less than one over the
      ! variance.
      own_mean = own_mean/spread(precision_mean*sum(own_mean, 2), 2, n_error_sources)
      parts = parts + matmul(transpose(own_mean), weights**2)
   end subroutine add_up_sources

   !> Residuals at a point in units of their scales, less the mean of the shared errors given the
   !> data, and the weight that the likelihood gives each.
   subroutine find_residuals(posterior, x, moduli, scales, shared, residual, weight)
      type(posterior_type), intent(in) :: posterior
      !> Point, (dimension), and the rows of the grain model there, GPa.
      real(wp), intent(in) :: x(:), moduli(:)
      !> Scales, GPa, (grain).
      real(wp), intent(out), contiguous :: scales(:)
      !> Columns of the shared errors in these units, (grain, shared error).
      real(wp), allocatable, intent(out) :: shared(:, :)
      !> (grain).
      real(wp), intent(out) :: residual(:), weight(:)
      real(wp), allocatable :: reduced(:, :), mean(:), precision(:, :)
      real(wp), dimension(size(scales)) :: model, curvature, expected
      real(wp) :: value

      call posterior%predict_measurements(x, posterior%stiffness(x), model, scales, shared, moduli)
      residual = (posterior%data%modulus - model)/scales
      call factor_columns(shared, reduced)
      call posterior%errors%integrate(residual, reduced, mean, precision, value)
      residual = residual - matmul(reduced, mean)
      call posterior%errors%weigh(residual, weight, curvature, expected)
   end subroutine find_residuals

   !> Whether a quantity is 'determined', 'weak' or 'not_determined', from its mean, its sd and its
   !> shares.
   pure function verdict_of(mean, sd, least_value, share) result(verdict)
      real(wp), intent(in) :: mean, sd
      !> Least value with which the sd is compared: a constant may be zero.
      real(wp), intent(in) :: least_value
      type(shares_type), intent(in) :: share
      character(len=:), allocatable :: verdict
      real(wp) :: relative

      relative = sd/max(abs(mean), least_value)
      verdict = 'weak'
      if (relative < determined(1) .and. share%prior < determined(2)) verdict = 'determined'
      if (relative > not_determined(1) .or. share%prior > not_determined(2)) then
         verdict = 'not_determined'
      end if
   end function verdict_of
end module variance_shares
