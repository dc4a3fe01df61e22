!> What chains say: of each parameter, of the moduli of the grains, and what the data decided and what the prior did.
module posterior_summary
   use chain_diagnostics, only: diagnose_chains, diagnostics_type
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, symmetric_eigen
   use quantities, only: evaluate_quantities, quantity_type
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type
   use simplex_search, only: climb
   use sorting, only: sort_order
   implicit none
   private
   public :: parameter_type, combination_type, known_quantity_type, predictions_type
   public :: summarise_parameters, correlate, find_combinations, compare_quantities, predict_grains, most_probable_point
   public :: decided_by_data, decided_by_prior

   !> A combination is decided by the data above, by the prior below this contraction.
   real(wp), parameter :: decided_by_data = 0.9_wp, decided_by_prior = 0.5_wp
   !> Draws for derived quantities and predictions; more say nothing new.
   integer, parameter :: most_draws = 4000

   type :: parameter_type
      real(wp) :: mean = 0.0_wp, sd = 0.0_wp
      !> Narrowest interval that holds 95 % of the draws.
      real(wp) :: hdi_95(2) = 0.0_wp
      type(diagnostics_type) :: diagnostics
   end type parameter_type

   !> A product of powers of the constants whose variance relative to the prior's is extreme.
   type :: combination_type
      !> (constant): powers, the largest 1, and correlations of its logarithm with the constants'.
      real(wp), allocatable :: exponents(:), correlations(:)
      !> Value at the mean logarithm; not there where a constant may vanish.
      real(wp), allocatable :: mean
      !> Of the logarithm, in the posterior and in the prior, and one minus the ratio of variances.
      real(wp) :: sd = 0.0_wp, prior_sd = 0.0_wp, contraction = 0.0_wp
   end type combination_type

   type :: known_quantity_type
      real(wp) :: mean = 0.0_wp, sd = 0.0_wp, prior_mean = 0.0_wp, prior_sd = 0.0_wp, contraction = 0.0_wp
   end type known_quantity_type

   !> For some of the draws, evenly spaced in each chain.
   type :: predictions_type
      integer :: stride = 1
      !> Modulus of each grain, of the kind that was measured, GPa, (grain, draw, chain); one plus the calibration error, (draw,
      !> chain).
      real(wp), allocatable :: moduli(:, :, :), factor(:, :)
      !> Values of the quantities that were asked for, (quantity, draw, chain).
      real(wp), allocatable :: quantities(:, :, :)
   end type predictions_type

contains

   !> Mean, sd, interval and diagnostics of each parameter.
   subroutine summarise_parameters(chains, threads, parameters)
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: threads
      type(parameter_type), allocatable, intent(out) :: parameters(:)
      real(wp), allocatable :: values(:, :)
      integer :: j

      allocate (parameters(size(chains%draws, 1)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1) private(values)
      do j = 1, size(parameters)
         values = chains%draws(j, :, :)
         parameters(j)%diagnostics = diagnose_chains(values)
         call moments(size(values), values, parameters(j)%mean, parameters(j)%sd)
         parameters(j)%hdi_95 = narrowest_interval(size(values), values, 0.95_wp)
      end do
      !$omp end parallel do
   end subroutine summarise_parameters

   !> Mean and unbiased sd.
   pure subroutine moments(n, values, mean, sd)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)
      real(wp), intent(out) :: mean, sd

      mean = sum(values)/n
      sd = sqrt(sum((values - mean)**2)/max(1, n - 1))
   end subroutine moments

   !> The narrowest interval between two of the values that holds a share of them, by the definition of ArviZ.
   pure function narrowest_interval(n, values, share) result(interval)
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n), share
      real(wp) :: interval(2)
      integer, allocatable :: order(:)
      integer :: i, held, best

      allocate (order(n))
      call sort_order(values, order)
      held = min(n - 1, int(share*n))
      best = 1
      do i = 2, n - held
         if (values(order(i + held)) - values(order(i)) < values(order(best + held)) - values(order(best))) best = i
      end do
      interval = values(order([best, best + held]))
   end function narrowest_interval

   !> The point of largest density: the best draw, then uphill.
   subroutine most_probable_point(posterior, chains, sd, point)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      !> Of the parameters.
      real(wp), intent(in) :: sd(:)
      real(wp), allocatable, intent(out) :: point(:)
      integer :: best(2)

      best = maxloc(chains%log_density)
      point = chains%draws(:, best(1), best(2))
      call climb(posterior, 0.1_wp*sd, point)
   end subroutine most_probable_point

   !> Correlations of the first k parameters.
   pure function correlate(chains, k) result(correlation)
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: k
      real(wp) :: correlation(k, k)
      real(wp) :: sd(k)
      integer :: j

      correlation = covariance_of(chains%draws, k, .false.)
      sd = [(sqrt(correlation(j, j)), j=1, k)]
      do j = 1, k
         correlation(:, j) = correlation(:, j)/(sd*sd(j))
      end do
   end function correlate

   !> Unbiased covariance of the first k parameters, or of their logarithms.
   pure function covariance_of(draws, k, logarithms) result(covariance)
      !> (parameter, sample, chain).
      real(wp), intent(in) :: draws(:, :, :)
      integer, intent(in) :: k
      logical, intent(in) :: logarithms
      real(wp) :: covariance(k, k)
      real(wp) :: mean(k), deviation(k)
      integer :: pass, i, c, j

      mean = 0.0_wp
      covariance = 0.0_wp
      do pass = 1, 2
         do c = 1, size(draws, 3)
            do i = 1, size(draws, 2)
               deviation = draws(:k, i, c)
               if (logarithms) deviation = log(deviation)
               if (pass == 1) then
                  mean = mean + deviation
               else
                  deviation = deviation - mean
                  do j = 1, k
                     covariance(:, j) = covariance(:, j) + deviation*deviation(j)
                  end do
               end if
            end do
         end do
         if (pass == 1) mean = mean/(size(draws, 2)*real(size(draws, 3), wp))
      end do
      covariance = covariance/max(1.0_wp, size(draws, 2)*real(size(draws, 3), wp) - 1.0_wp)
   end function covariance_of

   !> Combinations of the constants from the best to the worst identified: the eigenvectors of the posterior's covariance of the
   !> logarithms of the constants against the prior's. They are uncorrelated in both.
   subroutine find_combinations(draws, prior_draws, k, combinations, error)
      !> (parameter, sample, chain), the first `k` parameters constants.
      real(wp), intent(in) :: draws(:, :, :), prior_draws(:, :, :)
      !> Number of the constants.
      integer, intent(in) :: k
      type(combination_type), allocatable, intent(out) :: combinations(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: after(k, k), before(k, k), prior(k, k), whitened(k, k), scale(k), values(k), vector(k), covariance(k)
      logical :: positive
      integer :: i, j

      positive = minval(draws(:k, :, :)) > 0.0_wp .and. minval(prior_draws(:k, :, :)) > 0.0_wp
      after = covariance_of(draws, k, positive)
      before = covariance_of(prior_draws, k, positive)
      if (.not. positive) then
         ! A constant that may vanish has no logarithm: deviations relative to the mean stand in.
         scale = sum(sum(draws(:k, :, :), 3), 2)/(size(draws, 2)*real(size(draws, 3), wp))
         do j = 1, k
            after(:, j) = after(:, j)/(scale*scale(j))
            before(:, j) = before(:, j)/(scale*scale(j))
         end do
      end if
      prior = before
      call cholesky_factor(before, error)
      if (allocated(error)) then
         ! A prior without a spread of its own has no combinations.
         deallocate (error)
         allocate (combinations(0))
         return
      end if
      ! L^-1 A L^-ᵀ, whose eigenvectors u are L^-ᵀ times those that are wanted.
      whitened = after
      call solve_lower(whitened)
      whitened = transpose(whitened)
      call solve_lower(whitened)
      call symmetric_eigen(whitened, values, error)
      if (allocated(error)) return
      allocate (combinations(k))
      do i = 1, k
         vector = whitened(:, i)
         do j = k, 1, -1
            vector(j) = (vector(j) - sum(before(j + 1:, j)*vector(j + 1:)))/before(j, j)
         end do
         vector = vector/vector(maxloc(abs(vector), dim=1))
         covariance = matmul(after, vector)
         associate (one => combinations(i))
            one%exponents = vector
            one%sd = sqrt(max(0.0_wp, sum(vector*covariance)))
            one%correlations = covariance/(one%sd*[(sqrt(after(j, j)), j=1, k)])
            one%prior_sd = sqrt(sum(vector*matmul(prior, vector)))
            one%contraction = 1.0_wp - (one%sd/one%prior_sd)**2
            if (positive) one%mean = exp(mean_logarithm(vector))
         end associate
      end do

   contains

      pure subroutine solve_lower(columns)
         real(wp), intent(inout) :: columns(k, k)
         integer :: row

         do row = 1, k
            columns(row, :) = (columns(row, :) - matmul(before(row, :row - 1), columns(:row - 1, :)))/before(row, row)
         end do
      end subroutine solve_lower

      pure real(wp) function mean_logarithm(powers)
         real(wp), intent(in) :: powers(k)
         integer :: s, c

         mean_logarithm = 0.0_wp
         do c = 1, size(draws, 3)
            do s = 1, size(draws, 2)
               mean_logarithm = mean_logarithm + sum(powers*log(draws(:k, s, c)))
            end do
         end do
         mean_logarithm = mean_logarithm/(size(draws, 2)*real(size(draws, 3), wp))
      end function mean_logarithm
   end subroutine find_combinations

   !> Quantities in the posterior and in the prior.
   subroutine compare_quantities(values, prior_values, known)
      !> (quantity, draw, chain).
      real(wp), intent(in) :: values(:, :, :), prior_values(:, :, :)
      type(known_quantity_type), allocatable, intent(out) :: known(:)
      real(wp), allocatable :: one(:, :)
      integer :: q

      allocate (known(size(values, 1)))
      do q = 1, size(known)
         one = values(q, :, :)
         call moments(size(one), one, known(q)%mean, known(q)%sd)
         one = prior_values(q, :, :)
         call moments(size(one), one, known(q)%prior_mean, known(q)%prior_sd)
         known(q)%contraction = 1.0_wp - (known(q)%sd/known(q)%prior_sd)**2
      end do
   end subroutine compare_quantities

   !> The moduli of the measured grains, and quantities of the crystal, for some of the draws.
   subroutine predict_grains(posterior, chains, quantities, predictions)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      type(quantity_type), intent(in) :: quantities(:)
      type(predictions_type), intent(out) :: predictions
      type(random_stream_type) :: stream
      real(wp) :: slope(posterior%n_grains)
      integer :: samples, n, i, c, s

      samples = size(chains%draws, 2)
      predictions%stride = int(max(1.0_wp, real(samples, wp)*size(chains%draws, 3)/most_draws))
      n = (samples + predictions%stride - 1)/predictions%stride
      allocate (predictions%moduli(posterior%n_grains, n, size(chains%draws, 3)), predictions%factor(n, size(chains%draws, 3)))
      allocate (predictions%quantities(size(quantities), n, size(chains%draws, 3)))
      stream = new_random_stream(0, 0)
      do c = 1, size(chains%draws, 3)
         do i = 1, n
            s = 1 + (i - 1)*predictions%stride
            call posterior%draw_moduli(chains%draws(:, s, c), posterior%grains, stream, predictions%moduli(:, i, c), &
               & predictions%factor(i, c))
            slope = 1.0_wp
            call posterior%kind%apply(predictions%moduli(:, i, c), slope)
            call evaluate_quantities(quantities, posterior%stiffness(chains%draws(:, s, c)), predictions%quantities(:, i, c))
         end do
      end do
   end subroutine predict_grains
end module posterior_summary
