!> Summaries of the chains: of each parameter, of combinations of the constants, and of the moduli
!> of the measured grains.
!>
!> The maximum of the density is found by the simplex of Nelder and Mead (Comput. J. 7, 308, 1965),
!> which needs no derivatives and copes with bounds.
module posterior_summary
   use abstract_basis, only: grain_model_type
   use abstract_sampler, only: target_type
   use chain_diagnostics, only: diagnose_chains, diagnostics_type
   use constants_posterior, only: posterior_type
   use constants_prior, only: prior_type
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, symmetric_eigen
   use quantities, only: evaluate_quantities, quantity_type
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type
   use shared_errors, only: add_shared
   use small_matrices, only: solve_lower, solve_upper
   use statistics, only: covariance_of, flattened, moments, sort_order, sorted_values
   implicit none
   private
   public :: parameter_type, combination_type, predictions_type, summarise_parameters, &
      & correlate, find_combinations, predict_grains, thinning, find_maximum

   !> Numbers of draws for derived quantities and predictions. With 4000 independent draws the error
   !> of a mean is 2 % of an sd. For many grains fewer draws are used, so that the predictions take
   !> about 80 MB at most.
   integer, parameter :: most_draws = 4000, fewest_draws = 400
   real(wp), parameter :: most_predictions = 1.0e7_wp

   type :: parameter_type
      real(wp) :: mean = 0.0_wp, sd = 0.0_wp
      !> Narrowest interval that holds 95 % of the draws.
      real(wp) :: hdi_95(2) = 0.0_wp
      !> Values below which 2.5, 16, 50, 84 and 97.5 % of the draws lie.
      real(wp) :: quantiles(5) = 0.0_wp
      type(diagnostics_type) :: diagnostics
   end type parameter_type

   !> A product of powers of the constants: one that the measurements determine best, worst or in
   !> between, by its variance relative to the prior's.
   type :: combination_type
      !> Powers of the constants at the mean crystal, the largest 1.
      real(wp), allocatable :: exponents(:)
      !> Standard deviations of the logarithm in the posterior and in the prior.
      real(wp) :: sd = 0.0_wp, prior_sd = 0.0_wp
   end type combination_type

   !> Predictions for a part of the draws, evenly spaced in each chain.
   type :: predictions_type
      integer :: stride = 1
      !> Modulus of each grain, of the kind that was measured and with the contrast, GPa, (grain,
      !> draw, chain); the factor of the laboratory, (group, draw, chain).
      real(wp), allocatable :: moduli(:, :, :), factor(:, :, :)
      !> Values of the requested quantities, (quantity, draw, chain).
      real(wp), allocatable :: quantities(:, :, :)
   end type predictions_type

   !> The simplex stops when its corners agree within these limits, in parameters (GPa) and in log
   !> density, or after this number of evaluations.
   real(wp), parameter :: point_tolerance = 1.0e-3_wp, density_tolerance = 1.0e-4_wp
   integer, parameter :: most_evaluations = 1000

contains

   !> Mean, sd, interval and diagnostics of each parameter.
   subroutine summarise_parameters(chains, threads, parameters)
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: threads
      type(parameter_type), allocatable, intent(out) :: parameters(:)
      real(wp), allocatable :: values(:, :)
      integer :: j

      allocate (parameters(size(chains%draws, 1)))
      call moments(flattened(chains%draws), parameters%mean, parameters%sd)
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1) private(values)
      do j = 1, size(parameters)
         values = chains%draws(j, :, :)
         parameters(j)%diagnostics = diagnose_chains(values)
         parameters(j)%hdi_95 = narrowest_interval(size(values), values)
         parameters(j)%quantiles = quantiles_of(size(values), values)
      end do
      !$omp end parallel do
   end subroutine summarise_parameters

   !> Quantiles at `levels`, interpolated between the values.
   pure function quantiles_of(n, values) result(quantiles)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      real(wp), parameter :: levels(5) = [0.025_wp, 0.16_wp, 0.5_wp, 0.84_wp, 0.975_wp]
      real(wp) :: quantiles(size(levels)), place
      real(wp), allocatable :: sorted(:)
      integer :: i, k

      call sorted_values(n, values, sorted)
      do i = 1, size(levels)
         place = 1.0_wp + levels(i)*(n - 1)
         k = min(n - 1, int(place))
         quantiles(i) = sorted(k) + (place - k)*(sorted(k + 1) - sorted(k))
      end do
   end function quantiles_of

   !> Narrowest interval between two of the values that holds 95 % of them, as ArviZ defines it.
   pure function narrowest_interval(n, values) result(interval)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      real(wp) :: interval(2)
      real(wp), allocatable :: sorted(:)
      integer :: i, n_inside, best

      call sorted_values(n, values, sorted)
      n_inside = min(n - 1, int(0.95_wp*n))
      best = 1
      do i = 2, n - n_inside
         if (sorted(i + n_inside) - sorted(i) < sorted(best + n_inside) - sorted(best)) best = i
      end do
      interval = sorted([best, best + n_inside])
   end function narrowest_interval

   !> Correlations of the first k parameters.
   pure function correlate(chains, k) result(correlation)
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: k
      real(wp) :: correlation(k, k), sd(k)
      integer :: j

      correlation = covariance_of(flattened(chains%draws(:k, :, :)))
      sd = [(sqrt(correlation(j, j)), j=1, k)]
      correlation = correlation/(spread(sd, 2, k)*spread(sd, 1, k))
   end function correlate

   !> Combinations of the constants, from the best to the worst determined: the eigenvectors of the
   !> posterior's covariance of log K relative to the prior's. They are uncorrelated in both.
   subroutine find_combinations(prior, draws, prior_draws, combinations, values, error)
      type(prior_type), intent(in) :: prior
      !> (parameter, draw); the first parameters are the constants, GPa.
      real(wp), intent(in) :: draws(:, :), prior_draws(:, :)
      type(combination_type), allocatable, intent(out) :: combinations(:)
      !> Logarithms of the combinations, (combination, draw).
      real(wp), allocatable, intent(out) :: values(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: extended(:, :)
      real(wp), dimension(prior%n_constants, prior%n_constants) :: posterior_covariance, &
         & prior_covariance, factor, whitened
      real(wp), dimension(prior%n_constants) :: vector, constants, gradient, ratios
      real(wp) :: joint(2*prior%n_constants, 2*prior%n_constants), largest
      integer :: i, j, k

      k = prior%n_constants
      joint = covariance_of(with_logarithms(prior, prior_draws))
      prior_covariance = joint(k + 1:, k + 1:)
      extended = with_logarithms(prior, draws)
      joint = covariance_of(extended)
      posterior_covariance = joint(k + 1:, k + 1:)
      constants = sum(extended(:k, :), 2)/size(extended, 2)
      factor = prior_covariance
      call cholesky_factor(factor, error)
      if (allocated(error)) then
         ! No combination exists if the prior fixes a coordinate.
         deallocate (error)
         allocate (combinations(0), values(0, size(draws, 2)))
         return
      end if
      ! The eigenvectors u of L^-1 A L^-ᵀ give the combinations L^-ᵀ u.
      whitened = posterior_covariance
      do i = 1, 2
         do j = 1, k
            call solve_lower(factor, whitened(:, j))
         end do
         whitened = transpose(whitened)
      end do
      call symmetric_eigen(whitened, ratios, error)
      if (allocated(error)) return
      allocate (combinations(k), values(k, size(draws, 2)))
      do i = 1, k
         vector = whitened(:, i)
         call solve_upper(factor, vector)
         gradient = logarithmic_gradient()
         largest = gradient(maxloc(abs(gradient), dim=1))
         vector = vector/largest
         associate (combination => combinations(i))
            combination%exponents = gradient/largest
            combination%sd = sqrt(max(0.0_wp, sum(vector*matmul(posterior_covariance, vector))))
            combination%prior_sd = sqrt(sum(vector*matmul(prior_covariance, vector)))
         end associate
         values(i, :) = matmul(vector, extended(k + 1:, :))
      end do

   contains

      !> Derivatives of the combination `vector` of log K with respect to the logarithms of the
      !> constants, at `constants`, by central differences.
      pure function logarithmic_gradient() result(gradient)
         real(wp) :: gradient(size(constants))
         real(wp), parameter :: step = 1.0e-4_wp
         real(wp) :: shifted(size(constants)), above, below
         integer :: j

         do j = 1, size(constants)
            shifted = constants
            shifted(j) = constants(j)*(1.0_wp + step)
            above = sum(vector*prior%logarithms%to_logarithms(prior%class%stiffness(shifted)))
            shifted(j) = constants(j)*(1.0_wp - step)
            below = sum(vector*prior%logarithms%to_logarithms(prior%class%stiffness(shifted)))
            gradient(j) = (above - below)/(2.0_wp*step)
         end do
      end function logarithmic_gradient
   end subroutine find_combinations

   !> Constants of the draws, and below them their log K.
   pure function with_logarithms(prior, draws) result(extended)
      type(prior_type), intent(in) :: prior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> (2 n_constants, draw).
      real(wp) :: extended(2*prior%n_constants, size(draws, 2))
      integer :: i, k

      k = prior%n_constants
      extended(:k, :) = draws(:k, :)
      do i = 1, size(draws, 2)
         extended(k + 1:, i) = prior%logarithms%to_logarithms(prior%class%stiffness(draws(:k, i)))
      end do
   end function with_logarithms

   !> Stride of the draws for results that have a number for each grain: it leaves enough draws for
   !> accurate results, and few enough for the memory.
   pure integer function thinning(chains, n_grains)
      type(chains_type), intent(in) :: chains
      !> Numbers for each draw.
      integer, intent(in) :: n_grains
      real(wp) :: wanted

      wanted = min(real(most_draws, wp), &
         & max(real(fewest_draws, wp), most_predictions/max(1, n_grains)))
      thinning = int(max(1.0_wp, real(size(chains%draws, 2), wp)*size(chains%draws, 3)/wanted))
   end function thinning

   !> Predict the moduli of the measured grains, and quantities of the crystal, for a part of the
   !> draws.
   subroutine predict_grains(posterior, chains, threads, quantities, predictions, error)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      type(quantity_type), intent(in) :: quantities(:)
      type(predictions_type), intent(out) :: predictions
      type(error_type), allocatable, intent(out) :: error
      !> Number of crystals that are computed together.
      integer, parameter :: block = 16
      type(random_stream_type) :: stream
      class(grain_model_type), allocatable :: grains
      real(wp), allocatable :: draws(:, :, :), moduli(:, :, :)
      real(wp), dimension(posterior%n_grains) :: slope, variance
      real(wp) :: tilt_slopes(posterior%n_grains, 2), stiffness(6, 6)
      integer :: n, n_chains, i, last, c

      predictions%stride = thinning(chains, posterior%n_grains)
      draws = chains%draws(:, ::predictions%stride, :)
      n = size(draws, 2)
      n_chains = size(draws, 3)
      allocate (predictions%moduli(posterior%n_grains, n, n_chains), &
         & predictions%factor(posterior%n_groups, n, n_chains), &
         & predictions%quantities(size(quantities), n, n_chains))
      call posterior%new_grains(posterior%euler(:, :posterior%n_grains), posterior%data%paths, &
         & grains, error, with_mean=.true.)
      if (allocated(error)) return
      allocate (moduli(posterior%n_grains + size(posterior%mean_weights), n, n_chains))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic) collapse(2) private(last)
      do c = 1, n_chains
         do i = 1, n, block
            last = min(n, i + block - 1)
            call grains%evaluate_crystals(posterior%prior%class%stiffnesses(draws(:, i:last, c)), &
               & moduli(:, i:last, c))
         end do
      end do
      !$omp end parallel do
      stream = new_random_stream(0, 0)
      do c = 1, n_chains
         do i = 1, n
            stiffness = posterior%stiffness(draws(:, i, c))
            call add_shared(posterior, draws(:, i, c), grains, stream, moduli(:, i, c), &
               & predictions%factor(:, i, c))
            call posterior%set_contrast(draws(:, i, c), .not. posterior%data%paths%is_speed(), &
               & moduli(:, i, c))
            predictions%moduli(:, i, c) = moduli(:posterior%n_grains, i, c)
            if (allocated(posterior%unknown)) then
               call posterior%evaluate_grains(draws(:, i, c), stiffness, &
                  & predictions%moduli(:, i, c), slope, variance, tilt_slopes)
            end if
            call posterior%observable%to_measured(predictions%moduli(:posterior%n_moduli, i, c))
            call evaluate_quantities(quantities, stiffness, predictions%quantities(:, i, c))
         end do
      end do
   end subroutine predict_grains

   !> Move a point `x` of the support to a maximum of the density nearby. The corners of the first
   !> simplex are a tenth of an sd of the chains apart in each parameter.
   subroutine find_maximum(target, chains, x)
      class(target_type), intent(in) :: target
      type(chains_type), intent(in) :: chains
      real(wp), intent(inout) :: x(:)
      real(wp) :: corner(size(x), size(x) + 1), depth(size(x) + 1), centre(size(x)), sd(size(x)), &
         & trial(size(x)), second(size(x))
      real(wp) :: trial_depth, second_depth
      integer :: n, j, evaluations, order(size(x) + 1)

      call moments(flattened(chains%draws), centre, sd)
      n = size(x)
      evaluations = 0
      do j = 1, n + 1
         corner(:, j) = x
         if (j > 1) corner(j - 1, j) = x(j - 1) + 0.1_wp*sd(j - 1)
         depth(j) = depth_at(corner(:, j))
      end do
      do
         call sort_order(depth, order)
         depth = depth(order)
         corner = corner(:, order)
         if (evaluations >= most_evaluations) exit
         if (maxval(abs(corner(:, 2:) - spread(corner(:, 1), 2, n))) <= point_tolerance &
            & .and. depth(n + 1) - depth(1) <= density_tolerance) then
            exit
         end if
         centre = sum(corner(:, :n), 2)/n
         trial = 2.0_wp*centre - corner(:, n + 1)
         trial_depth = depth_at(trial)
         if (trial_depth < depth(1)) then
            second = 3.0_wp*centre - 2.0_wp*corner(:, n + 1)
            second_depth = depth_at(second)
            if (second_depth < trial_depth) then
               trial = second
               trial_depth = second_depth
            end if
         else if (trial_depth >= depth(n)) then
            second = 0.5_wp*(centre + corner(:, n + 1))
            if (trial_depth < depth(n + 1)) second = 0.5_wp*(centre + trial)
            second_depth = depth_at(second)
            if (second_depth < min(trial_depth, depth(n + 1))) then
               trial = second
               trial_depth = second_depth
            else
               do j = 2, n + 1
                  corner(:, j) = 0.5_wp*(corner(:, 1) + corner(:, j))
                  depth(j) = depth_at(corner(:, j))
               end do
               cycle
            end if
         end if
         corner(:, n + 1) = trial
         depth(n + 1) = trial_depth
      end do
      x = corner(:, 1)

   contains

      !> Minus the log density; very large outside the support.
      real(wp) function depth_at(point)
         real(wp), intent(in) :: point(:)
         real(wp) :: log_density(1)

         evaluations = evaluations + 1
         call target%evaluate(reshape(point, [size(point), 1]), log_density)
         depth_at = min(1.0e300_wp, -log_density(1))
      end function depth_at
   end subroutine find_maximum

end module posterior_summary
