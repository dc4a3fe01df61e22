!> Whether the model could have given the measurements: for some of the draws of a posterior, what
!> each measurement is worth given all others, and the same grains measured anew.
!>
!> The errors that measurements share (of the surrogate, of each calibration) are drawn given the
!> data, and the measurements anew have them too: the same grains, the same tip, another noise.
!> Residuals are in units of the scale of the noise, less the shared errors.
!>
!> The evidence is the probability density of the measurements under a model and its prior, from
!> draws of both densities.
!>
!> The integral of a density that is known up to a constant, by bridge sampling (Meng and Wong,
!> Stat. Sin. 6, 831, 1996): a normal mixture with heavy tails is fitted to the first halves of the
!> chains, and the second halves and draws of the mixture tell each other's constants. The evidence
!> is the integral of prior times likelihood over that of the prior, which has no closed form either
!> where stability and limits of averages cut it. Coordinates are those of log K, which are
!> smoother, less their mean and over the factor of their covariance.
module model_checks
   use abstract_sampler, only: outside
   use chain_diagnostics, only: diagnose_chains, diagnostics_type
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, &
      & widen_mixture
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use posterior_summary, only: thinning
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type
   use small_matrices, only: factor_columns, solve_lower, solve_upper
   use statistics, only: covariance_of, flattened
   implicit none
   private
   public :: checks_type, check_model, evidence_type, estimate_evidence

   type :: checks_type
      !> Logarithm of the density of a measurement (1/GPa) given the constants and all other
      !> measurements; the measurement anew, GPa; (grain, draw, chain).
      real(wp), allocatable :: log_likelihood(:, :, :), replicated(:, :, :)
      !> Logarithm of the prior density up to a constant, (draw, chain).
      real(wp), allocatable :: log_prior(:, :)
      !> Mean sum of squared residuals, and how many of the data sets measured anew have a larger
      !> one, as a share.
      real(wp) :: chi_square = 0.0_wp, chi_square_p = 0.0_wp
      !> The grain whose mean residual is the largest, that residual, and the share of data sets
      !> whose worst grain is further off.
      integer :: extreme_grain = 0
      real(wp) :: extreme_residual = 0.0_wp, extreme_p = 0.0_wp
      !> Mean residual of each, (grain).
      real(wp), allocatable :: residuals(:)
   end type checks_type

   !> Random streams (0, first_stream + chain) of the noise, beside those of predictions.
   integer, parameter :: first_stream = 5000000

   type :: evidence_type
      !> Natural logarithm of the evidence, in GPa to the minus number of grains, and its standard
      !> error.
      real(wp) :: log_z = 0.0_wp, sd = 0.0_wp
   end type evidence_type

   !> Draws that a mixture is fitted to, as many that it is compared with, and as many of its own,
   !> at most.
   integer, parameter :: most_draws = 8000
   !> Draws of the mixture come in so many blocks, each from a random stream of its own.
   integer, parameter :: blocks = 16, evidence_stream = 6000000

contains

   !> All of them; the last parameter of a draw may be the logarithm of the factor on the sds.
   subroutine check_model(posterior, chains, threads, checks)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: threads
      type(checks_type), intent(out) :: checks
      real(wp) :: sums(posterior%n_grains + 3, size(chains%draws, 3)), means(posterior%n_grains + 3)
      integer :: n, m, c, stride

      m = posterior%n_grains
      stride = thinning(chains, m)
      n = (size(chains%draws, 2) + stride - 1)/stride
      allocate (checks%log_likelihood(m, n, size(sums, 2)), &
         & checks%replicated(m, n, size(sums, 2)), checks%log_prior(n, size(sums, 2)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1)
      do c = 1, size(sums, 2)
         call check_chain(posterior, chains%draws(:, ::stride, c), first_stream + c, &
            & checks%log_likelihood(:, :, c), checks%replicated(:, :, c), &
            & checks%log_prior(:, c), sums(:, c))
      end do
      !$omp end parallel do
      means = sum(sums, 2)/size(checks%log_prior)
      checks%residuals = means(:m)
      checks%chi_square = means(m + 1)
      checks%chi_square_p = means(m + 2)
      checks%extreme_p = means(m + 3)
      if (m == 0) return
      checks%extreme_grain = maxloc(abs(checks%residuals), dim=1)
      checks%extreme_residual = checks%residuals(checks%extreme_grain)
   end subroutine check_model

   !> Of the draws of one chain.
   subroutine check_chain(posterior, draws, stream_number, log_likelihood, replicated, &
      & log_prior, sums)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      integer, intent(in) :: stream_number
      !> As in `checks_type`, (grain, draw), (draw).
      real(wp), intent(out) :: log_likelihood(:, :), replicated(:, :), log_prior(:)
      !> Over the draws: residuals of the grains, sums of their squares, and how many data sets
      !> measured anew have a larger one, and a worst grain that is further off.
      real(wp), intent(out) :: sums(:)
      type(random_stream_type) :: stream
      !> Crystals at once.
      integer, parameter :: at_once = 16
      real(wp), allocatable :: moduli(:, :), u(:, :), fewer(:, :), b(:), z(:), precision(:, :)
      real(wp), dimension(posterior%n_grains) :: model, scales, residuals, shared, noise
      real(wp) :: c(6, 6), value
      integer :: i, g

      allocate (u(posterior%n_grains, posterior%n_shared))
      stream = new_random_stream(0, stream_number)
      sums = 0.0_wp
      do i = 1, size(draws, 2)
         c = posterior%stiffness(draws(:, i))
         log_prior(i) = posterior%log_prior(c)
         if (mod(i, at_once) == 1) then
            moduli = posterior%moduli_at(draws(:, i:min(size(draws, 2), i + at_once - 1)))
         end if
         call posterior%predict_measurements(draws(:, i), c, model, scales, u, &
            & moduli(:, 1 + mod(i - 1, at_once)))
         residuals = (posterior%data%modulus - model)/scales
         call factor_columns(u, fewer)
         ! Sizes: their rank is that of the point.
         b = fewer(1, :)
         z = b
         precision = fewer(:size(b), :)
         call posterior%errors%integrate(residuals, fewer, b, precision, value)
         call posterior%errors%leave_one_out(residuals, fewer, b, precision, log_likelihood(:, i))
         log_likelihood(:, i) = log_likelihood(:, i) - log(scales)
         call stream%normals(z)
         call solve_upper(precision, z)
         shared = matmul(fewer, b + z)
         do g = 1, posterior%n_grains
            call posterior%errors%draw(stream, noise(g))
         end do
         residuals = residuals - shared
         replicated(:, i) = model + scales*(shared + noise)
         sums = sums + [residuals, sum(residuals**2), &
            & merge(1.0_wp, 0.0_wp, sum(noise**2) > sum(residuals**2)), &
            & merge(1.0_wp, 0.0_wp, maxval(abs(noise)) > maxval(abs(residuals)))]
      end do
   end subroutine check_chain

   !> From chains of the posterior and of the same without its data; the last parameter may be the
   !> logarithm of the factor on the sds.
   subroutine estimate_evidence(posterior, chains, prior, prior_chains, threads, evidence, error)
      type(posterior_type), intent(in) :: posterior, prior
      type(chains_type), intent(in) :: chains, prior_chains
      integer, intent(in) :: threads
      type(evidence_type), intent(out) :: evidence
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: both(2), variances(2)

      call log_integral(posterior, chains, 0, threads, both(1), variances(1), error)
      if (.not. allocated(error)) then
         call log_integral(prior, prior_chains, blocks, threads, both(2), variances(2), error)
      end if
      if (allocated(error)) return
      evidence%log_z = both(1) - both(2)
      evidence%sd = sqrt(sum(variances))
   end subroutine estimate_evidence

   !> Logarithm of the integral of the density of working coordinates, and the variance of that.
   subroutine log_integral(density, chains, stream_offset, threads, value, variance, error)
      type(posterior_type), intent(in) :: density
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: stream_offset, threads
      real(wp), intent(out) :: value, variance
      type(error_type), allocatable, intent(out) :: error
      type(mixture_type) :: fitted, mixture
      real(wp), allocatable :: u(:, :, :), log_density(:, :), first(:, :), of_draws(:, :), &
         & of_proposals(:)
      real(wp) :: mean(density%dimension), factor(density%dimension, density%dimension), log_factor
      integer :: i, j, c, d, n, half, stride

      stride = max(1, int(size(chains%draws, 2)*real(size(chains%draws, 3), wp)/(2*most_draws)))
      log_density = chains%log_density(::stride, :)
      half = size(log_density, 1)/2
      allocate (u(density%dimension, size(log_density, 1), size(log_density, 2)))
      do c = 1, size(u, 3)
         call density%to_working(chains%draws(:, ::stride, c), u(:, :, c))
      end do
      ! The first halves are fitted.
      first = flattened(u(:, :half, :))
      d = size(first, 1)
      n = size(first, 2)
      mean = sum(first, 2)/n
      factor = covariance_of(first)*(n - 1)/n
      do j = 1, d
         factor(j, j) = factor(j, j)*(1.0_wp + 1.0e-9_wp) + 1.0e-14_wp
      end do
      call cholesky_factor(factor, error)
      if (allocated(error)) return
      log_factor = sum([(log(factor(j, j)), j=1, d)])
      do concurrent(i=1:size(u, 2), c=1:size(u, 3))
         log_density(i, c) = log_density(i, &
            & c) + density%prior%logarithms%log_volume_at(u(:density%n_constants, i, c))
         u(:, i, c) = u(:, i, c) - mean
         call solve_lower(factor, u(:, i, c))
      end do
      first = flattened(u(:, :half, :))
      call new_mixture(first, max(1, min(16, n/(5*d*(d + 3)))), fitted)
      call fit_mixture(first, spread(1.0_wp, 1, n), 20, fitted)
      call widen_mixture(fitted, mixture)
      ! The second halves are compared with.
      of_draws = log_density(half + 1:, :) + log_factor
      do concurrent(i=1:size(of_draws, 1), c=1:size(u, 3))
         of_draws(i, c) = of_draws(i, c) - log_mixture(mixture, u(:, half + i, c))
      end do
      allocate (of_proposals(blocks*(most_draws/blocks)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1)
      do i = 1, blocks
         call weigh_block(density, mixture, mean, factor, evidence_stream + stream_offset + i, &
            & of_proposals((i - 1)*(most_draws/blocks) + 1:i*(most_draws/blocks)))
      end do
      !$omp end parallel do
      where (of_proposals > outside) of_proposals = of_proposals + log_factor
      call bridge(of_draws, of_proposals, value, variance)
   end subroutine log_integral

   !> Draws of the mixture: the logarithm of the density over the mixture's, but for the volume of
   !> the coordinates; `outside` the support.
   subroutine weigh_block(density, mixture, mean, factor, stream_number, values)
      type(posterior_type), intent(in) :: density
      type(mixture_type), intent(in) :: mixture
      !> Of the coordinates, (dimension), and the lower factor of their covariance.
      real(wp), intent(in) :: mean(:), factor(:, :)
      integer, intent(in) :: stream_number
      !> (draw).
      real(wp), intent(out) :: values(:)
      type(random_stream_type) :: stream
      real(wp), dimension(size(mean), size(values)) :: u, w
      integer :: i, j

      stream = new_random_stream(0, stream_number)
      do i = 1, size(values)
         call draw_mixture(mixture, stream, u(:, i))
         do j = 1, size(mean)
            w(j, i) = mean(j) + sum(factor(j, :j)*u(:j, i))
         end do
      end do
      call density%evaluate_working(w, values)
      do i = 1, size(values)
         if (values(i) > outside) values(i) = values(i) - log_mixture(mixture, u(:, i))
      end do
   end subroutine weigh_block

   !> The integral, from logarithms of density over mixture at draws of the one and of the other;
   !> its relative variance by that of the two means (Frühwirth-Schnatter, Econom. J. 7, 143, 2004),
   !> the draws worth as many as are effective.
   subroutine bridge(of_draws, of_proposals, value, variance)
      !> (sample, chain); (proposal).
      real(wp), intent(in) :: of_draws(:, :), of_proposals(:)
      real(wp), intent(out) :: value, variance
      integer, parameter :: most_steps = 200
      real(wp) :: above(size(of_proposals)), below(size(of_draws, 1), size(of_draws, 2)), share, &
         & top, r, before, m, effective
      type(diagnostics_type) :: diagnostics
      integer :: step

      m = size(of_draws)
      top = maxval(of_draws)
      diagnostics = diagnose_chains(of_draws)
      effective = m
      ! Draws that are all alike have no effective size.
      if (diagnostics%ess_bulk > 0.0_wp) effective = min(m, diagnostics%ess_bulk)
      share = effective/(effective + size(of_proposals))
      r = 1.0_wp
      do step = 1, most_steps
         before = r
         above = 0.0_wp
         where (of_proposals > outside) above = 1.0_wp/(share &
            & + (1.0_wp - share)*r*exp(min(600.0_wp, top - of_proposals)))
         below = 1.0_wp/(share*exp(of_draws - top) + (1.0_wp - share)*r)
         r = (sum(above)/size(above))/(sum(below)/m)
         if (abs(r - before) < 1.0e-10_wp*r) exit
      end do
      value = top + log(r)
      variance = relative_variance(size(above), &
         & above)/size(above) + relative_variance(size(below), below)/effective
   end subroutine bridge

   pure real(wp) function relative_variance(n, values)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      real(wp) :: mean

      mean = sum(values)/n
      relative_variance = sum((values - mean)**2)/n/mean**2
   end function relative_variance

end module model_checks
