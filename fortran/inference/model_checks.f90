!> Whether the model could have given the measurements: for some of the draws of a posterior, what each measurement is worth given all
!> others, and the same grains measured anew.
!>
!> The errors that measurements share (of the surrogate, of each calibration) are drawn given the data, and the measurements anew have
!> them too: the same grains, the same tip, another noise. Residuals are in units of the scale of the noise, less the shared errors.
module model_checks
   use constants_posterior, only: posterior_type
   use kinds, only: wp
   use posterior_summary, only: thinning
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type
   use small_matrices, only: factor_columns, solve_upper
   implicit none
   private
   public :: checks_type, check_model

   type :: checks_type
      integer :: stride = 1
      !> Logarithm of the density of a measurement (1/GPa) given the constants and all other measurements; the measurement anew, GPa;
      !> (grain, draw, chain).
      real(wp), allocatable :: log_likelihood(:, :, :), replicated(:, :, :)
      !> Logarithm of the prior density up to a constant, (draw, chain).
      real(wp), allocatable :: log_prior(:, :)
      !> Mean sum of squared residuals, and how many of the data sets measured anew have a larger one, as a share.
      real(wp) :: chi_square = 0.0_wp, chi_square_p = 0.0_wp
      !> The grain whose mean residual is the largest, that residual, and the share of data sets whose worst grain is further off.
      integer :: extreme_grain = 0
      real(wp) :: extreme_residual = 0.0_wp, extreme_p = 0.0_wp
      !> Mean residual of each, (grain).
      real(wp), allocatable :: residuals(:)
   end type checks_type

   !> What the draws of a chain add up to: squares of residuals, residuals (grain), and how many data sets have larger ones.
   type :: tally_type
      real(wp) :: squares = 0.0_wp
      real(wp), allocatable :: residuals(:)
      integer :: larger = 0, further = 0
   end type tally_type

   !> Random streams (0, first_stream + chain) of the noise, beside those of predictions.
   integer, parameter :: first_stream = 5000000

contains

   !> All of them; the last parameter of a draw may be the logarithm of the factor on the sds.
   subroutine check_model(posterior, chains, threads, checks)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: threads
      type(checks_type), intent(out) :: checks
      type(tally_type) :: tallies(size(chains%draws, 3))
      integer :: n, m, c

      m = posterior%n_grains
      checks%stride = thinning(chains, m)
      n = (size(chains%draws, 2) + checks%stride - 1)/checks%stride
      allocate (checks%log_likelihood(m, n, size(tallies)), checks%replicated(m, n, size(tallies)), &
         & checks%log_prior(n, size(tallies)))
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1)
      do c = 1, size(tallies)
         call check_chain(posterior, chains%draws(:, ::checks%stride, c), first_stream + c, checks%log_likelihood(:, :, c), &
            & checks%replicated(:, :, c), checks%log_prior(:, c), tallies(c))
      end do
      !$omp end parallel do
      n = n*size(tallies)
      allocate (checks%residuals(m), source=0.0_wp)
      do c = 1, size(tallies)
         checks%chi_square = checks%chi_square + tallies(c)%squares/n
         checks%chi_square_p = checks%chi_square_p + real(tallies(c)%larger, wp)/n
         checks%extreme_p = checks%extreme_p + real(tallies(c)%further, wp)/n
         checks%residuals = checks%residuals + tallies(c)%residuals/n
      end do
      if (m == 0) return
      checks%extreme_grain = maxloc(abs(checks%residuals), dim=1)
      checks%extreme_residual = checks%residuals(checks%extreme_grain)
   end subroutine check_model

   !> Of the draws of one chain.
   subroutine check_chain(posterior, draws, stream_number, log_likelihood, replicated, log_prior, tally)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      integer, intent(in) :: stream_number
      !> As in `checks_type`, (grain, draw), (draw).
      real(wp), intent(out) :: log_likelihood(:, :), replicated(:, :), log_prior(:)
      type(tally_type), intent(out) :: tally
      type(random_stream_type) :: stream
      real(wp), allocatable :: u(:, :), fewer(:, :), b(:), z(:), precision(:, :)
      real(wp), dimension(posterior%n_grains) :: model, scales, residuals, shared, noise
      real(wp) :: c(6, 6), value
      integer :: i, g, columns

      columns = min(posterior%n_grains, posterior%n_shared)
      allocate (u(posterior%n_grains, posterior%n_shared), fewer(posterior%n_grains, columns), b(columns), &
         & z(columns), precision(columns, columns))
      stream = new_random_stream(0, stream_number)
      tally%residuals = 0.0_wp*posterior%measured
      do i = 1, size(draws, 2)
         c = posterior%stiffness(draws(:, i))
         log_prior(i) = posterior%log_prior(c)
         call posterior%predict_measurements(draws(:, i), c, model, scales, u)
         residuals = (posterior%measured - model)/scales
         shared = 0.0_wp
         if (columns > 0) then
            call factor_columns(u, fewer)
            call posterior%errors%integrate(residuals, fewer, b, precision, value)
         end if
         call posterior%errors%leave_one_out(residuals, fewer, b, precision, log_likelihood(:, i))
         log_likelihood(:, i) = log_likelihood(:, i) - log(scales)
         if (columns > 0) then
            do g = 1, columns
               call stream%normal(z(g))
            end do
            call solve_upper(precision, z)
            shared = matmul(fewer, b + z)
         end if
         do g = 1, posterior%n_grains
            call posterior%errors%draw(stream, noise(g))
         end do
         residuals = residuals - shared
         replicated(:, i) = model + scales*(shared + noise)
         tally%squares = tally%squares + sum(residuals**2)
         tally%residuals = tally%residuals + residuals
         if (sum(noise**2) > sum(residuals**2)) tally%larger = tally%larger + 1
         if (maxval(abs(noise)) > maxval(abs(residuals))) tally%further = tally%further + 1
      end do
   end subroutine check_chain
end module model_checks
