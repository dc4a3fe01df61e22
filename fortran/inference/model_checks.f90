!> Checks of the model against the measurements: for a part of the posterior's draws, the density of
!> each measurement given all others, and replicated data.
!>
!> Errors that measurements share (of the surrogate, of each calibration) are drawn given the data.
!> The replicated data have the same shared errors, as they are of the same grains and the same
!> indenter, and new noise. Residuals are in units of the scale of the noise, less the shared
!> errors.
!>
!> The evidence is the probability density of the measurements under a model and its prior. It needs
!> draws of the posterior and of the prior.
!>
!> The integral of a density that is known up to a constant is computed by bridge sampling (Meng and
!> Wong, Stat. Sin. 6, 831, 1996). A normal mixture with heavy tails is fitted to the first halves
!> of the chains. The second halves are then compared with draws of the mixture. The evidence is the
!> integral of prior times likelihood over that of the prior, which has no closed form either,
!> because of stability and limits of averages. The coordinates are those of log K, in which
!> densities are smoother, less their mean and divided by the factor of their covariance.
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
   public :: checks_type, check_model, evidence_type, estimate_evidence, log_integral

   type :: checks_type
      !> Logarithm of the density of a measurement (1/GPa) given the constants and all other
      !> measurements, and the replicated measurement, GPa; (grain, draw, chain).
      real(wp), allocatable :: log_likelihood(:, :, :), replicated(:, :, :)
      !> Logarithm of the prior density, up to a constant, (draw, chain).
      real(wp), allocatable :: log_prior(:, :)
      !> Mean sum of squared residuals, and the share of replicated data sets that have a larger
      !> one.
      real(wp) :: chi_square = 0.0_wp, chi_square_p = 0.0_wp
      !> The grain with the largest mean residual, that residual, and the share of replicated data
      !> sets whose largest residual is larger.
      integer :: extreme_grain = 0
      real(wp) :: extreme_residual = 0.0_wp, extreme_p = 0.0_wp
      !> Mean residual of each grain, (grain).
      real(wp), allocatable :: residuals(:)
   end type checks_type

   !> Random streams (0, first_stream + chain) draw the noise. Predictions use others.
   integer, parameter :: first_stream = 5000000

   type :: evidence_type
      !> Natural logarithm of the evidence, whose unit is GPa to the minus number of grains, and its
      !> standard error.
      real(wp) :: log_z = 0.0_wp, sd = 0.0_wp
   end type evidence_type

   !> Greatest number of draws to which a mixture is fitted, with which it is compared, and which
   !> are drawn from it.
   integer, parameter :: most_draws = 8000
   !> The mixture is drawn from in this many blocks, each with a random stream of its own, so that
   !> the result does not depend on the number of threads.
   integer, parameter :: blocks = 16, evidence_stream = 6000000

contains

   !> Compute all checks. The last parameter of a draw may be the logarithm of the factor on the
   !> sds.
   subroutine check_model(posterior, chains, threads, checks)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: threads
      type(checks_type), intent(out) :: checks
      real(wp), allocatable :: draws(:, :, :)
      !> Sums over the draws of a chain, (.., chain): residuals of the grains, their sums of
      !> squares, the number of replicated data sets with a larger sum of squares, and that with a
      !> larger greatest residual.
      real(wp) :: sums(posterior%n_grains + 3, size(chains%draws, 3)), means(posterior%n_grains + 3)
      integer :: n, m, c

      m = posterior%n_grains
      draws = chains%draws(:, ::thinning(chains, m), :)
      n = size(draws, 2)
      allocate (checks%log_likelihood(m, n, size(sums, 2)), &
         & checks%replicated(m, n, size(sums, 2)), checks%log_prior(n, size(sums, 2)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1)
      do c = 1, size(sums, 2)
         call check_chain(c)
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

   contains

      !> Compute the checks for the draws of one chain.
      subroutine check_chain(c)
         integer, intent(in) :: c
         type(random_stream_type) :: stream
         !> Number of crystals that are computed together.
         integer, parameter :: block = 16
         real(wp), allocatable :: moduli(:, :), u(:, :), reduced(:, :), mean(:), z(:), &
            & precision(:, :)
         real(wp), dimension(posterior%n_grains) :: model, scales, residuals, shared, noise
         real(wp) :: stiffness(6, 6), value
         integer :: i, g

         stream = new_random_stream(0, first_stream + c)
         sums(:, c) = 0.0_wp
         do i = 1, n
            stiffness = posterior%stiffness(draws(:, i, c))
            checks%log_prior(i, c) = posterior%log_prior(stiffness)
            if (mod(i, block) == 1) then
               moduli = posterior%moduli_at(draws(:, i:min(n, i + block - 1), c))
            end if
            call posterior%predict_measurements(draws(:, i, c), stiffness, model, scales, u, &
               & moduli(:, 1 + mod(i - 1, block)))
            residuals = (posterior%data%modulus - model)/scales
            call factor_columns(u, reduced)
            call posterior%errors%integrate(residuals, reduced, mean, precision, value)
            call posterior%errors%leave_one_out(residuals, reduced, mean, precision, &
               & checks%log_likelihood(:, i, c))
            checks%log_likelihood(:, i, c) = checks%log_likelihood(:, i, c) - log(scales)
            z = mean
            call stream%normals(z)
            call solve_upper(precision, z)
            shared = matmul(reduced, mean + z)
            do g = 1, posterior%n_grains
               call posterior%errors%draw(stream, noise(g))
            end do
            residuals = residuals - shared
            checks%replicated(:, i, c) = model + scales*(shared + noise)
            sums(:, c) = sums(:, c) + [residuals, sum(residuals**2), &
               & merge(1.0_wp, 0.0_wp, sum(noise**2) > sum(residuals**2)), &
               & merge(1.0_wp, 0.0_wp, maxval(abs(noise)) > maxval(abs(residuals)))]
         end do
      end subroutine check_chain
   end subroutine check_model

   !> Estimate the evidence from chains of the posterior and of the same density without its data.
   !> The last parameter may be the logarithm of the factor on the sds.
   subroutine estimate_evidence(posterior, chains, prior, prior_chains, threads, evidence, error)
      type(posterior_type), intent(in) :: posterior, prior
      type(chains_type), intent(in) :: chains, prior_chains
      integer, intent(in) :: threads
      type(evidence_type), intent(out) :: evidence
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: log_integrals(2), variances(2)

      call log_integral(posterior, chains, 0, threads, log_integrals(1), variances(1), error)
      if (allocated(error)) return
      call log_integral(prior, prior_chains, blocks, threads, log_integrals(2), variances(2), &
         & error)
      if (allocated(error)) return
      evidence%log_z = log_integrals(1) - log_integrals(2)
      evidence%sd = sqrt(sum(variances))
   end subroutine estimate_evidence

   !> Logarithm of the integral of a density over the working coordinates, and its variance.
   subroutine log_integral(density, chains, stream_offset, threads, value, variance, error)
      type(posterior_type), intent(in) :: density
      type(chains_type), intent(in) :: chains
      !> Added to the numbers of the random streams; OpenMP threads.
      integer, intent(in) :: stream_offset, threads
      !> The logarithm, and its variance.
      real(wp), intent(out) :: value, variance
      type(error_type), allocatable, intent(out) :: error
      type(mixture_type) :: fitted, mixture
      real(wp), allocatable :: u(:, :, :), log_density(:, :), first(:, :), chain_ratios(:, :), &
         & mixture_ratios(:)
      real(wp) :: mean(density%dimension), factor(density%dimension, density%dimension), log_factor
      integer :: i, j, c, d, n, half, stride

      stride = max(1, int(size(chains%draws, 2)*real(size(chains%draws, 3), wp)/(2*most_draws)))
      log_density = chains%log_density(::stride, :)
      half = size(log_density, 1)/2
      allocate (u(density%dimension, size(log_density, 1), size(log_density, 2)))
      do c = 1, size(u, 3)
         call density%to_working(chains%draws(:, ::stride, c), u(:, :, c))
      end do
      ! Fit a mixture to the first halves.
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
         log_density(i, c) = log_density(i, c) &
            & + density%prior%logarithms%log_volume(u(:density%n_constants, i, c))
         u(:, i, c) = u(:, i, c) - mean
         call solve_lower(factor, u(:, i, c))
      end do
      first = flattened(u(:, :half, :))
      call new_mixture(first, max(1, min(16, n/(5*d*(d + 3)))), fitted)
      call fit_mixture(first, spread(1.0_wp, 1, n), 20, fitted)
      call widen_mixture(fitted, mixture)
      ! Compare the second halves with the mixture.
      chain_ratios = log_density(half + 1:, :) + log_factor
      do concurrent(i=1:size(chain_ratios, 1), c=1:size(u, 3))
         chain_ratios(i, c) = chain_ratios(i, c) - log_mixture(mixture, u(:, half + i, c))
      end do
      allocate (mixture_ratios(blocks*(most_draws/blocks)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1)
      do i = 1, blocks
         call weigh_block(i, mixture_ratios((i - 1)*(most_draws/blocks) + 1:i*(most_draws/blocks)))
      end do
      !$omp end parallel do
      where (mixture_ratios > outside) mixture_ratios = mixture_ratios + log_factor
      call bridge(chain_ratios, mixture_ratios, value, variance)

   contains

      !> Draw from the mixture, and compute the logarithm of the density over that of the mixture,
      !> up to the volume of the coordinates; `outside` if a draw is not in the support.
      subroutine weigh_block(number, values)
         !> Number of the block.
         integer, intent(in) :: number
         !> (draw).
         real(wp), intent(out) :: values(:)
         type(random_stream_type) :: stream
         real(wp), dimension(size(mean), size(values)) :: u, w
         integer :: i, j

         stream = new_random_stream(0, evidence_stream + stream_offset + number)
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
   end subroutine log_integral

   !> Logarithm of the integral, from logarithms of the ratio of density and mixture at draws of
   !> both. Its relative variance is that of the two means (Frühwirth-Schnatter, Econom. J. 7, 143,
   !> 2004), with the effective number of the chains' draws.
   subroutine bridge(chain_ratios, mixture_ratios, value, variance)
      !> At draws of the chains, (sample, chain), and of the mixture, (draw).
      real(wp), intent(in) :: chain_ratios(:, :), mixture_ratios(:)
      real(wp), intent(out) :: value, variance
      integer, parameter :: most_steps = 200
      real(wp) :: numerators(size(mixture_ratios)), share, greatest, ratio, previous, n_draws, &
         & effective
      real(wp) :: denominators(size(chain_ratios, 1), size(chain_ratios, 2))
      type(diagnostics_type) :: diagnostics
      integer :: step

      n_draws = size(chain_ratios)
      greatest = maxval(chain_ratios)
      diagnostics = diagnose_chains(chain_ratios)
      effective = n_draws
      ! Identical draws have no effective size.
      if (diagnostics%ess_bulk > 0.0_wp) effective = min(n_draws, diagnostics%ess_bulk)
      share = effective/(effective + size(mixture_ratios))
      ratio = 1.0_wp
      do step = 1, most_steps
         previous = ratio
         numerators = 0.0_wp
         where (mixture_ratios > outside) numerators = 1.0_wp/(share &
            & + (1.0_wp - share)*ratio*exp(min(600.0_wp, greatest - mixture_ratios)))
         denominators = 1.0_wp/(share*exp(chain_ratios - greatest) + (1.0_wp - share)*ratio)
         ratio = (sum(numerators)/size(numerators))/(sum(denominators)/n_draws)
         if (abs(ratio - previous) < 1.0e-10_wp*ratio) exit
      end do
      value = greatest + log(ratio)
      variance = relative_variance(size(numerators), numerators)/size(numerators) &
         & + relative_variance(size(denominators), denominators)/effective
   end subroutine bridge

   pure real(wp) function relative_variance(n, values)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      real(wp) :: mean

      mean = sum(values)/n
      relative_variance = sum((values - mean)**2)/n/mean**2
   end function relative_variance

end module model_checks
