!> For a part of the posterior's draws, the density of each measurement given all others, and
!> replicated data.
!>
!> Errors that measurements share (of the surrogate, of each calibration) are drawn given the data.
!> The replicated data have the same shared errors, as they are of the same grains and the same
!> indenter, and new noise.
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
      !> Logarithm of the density of a measurement (1/GPa) given the constants and all other
      !> measurements, and the replicated measurement, GPa; (grain, draw, chain).
      real(wp), allocatable :: log_likelihood(:, :, :), replicated(:, :, :)
      !> Logarithm of the prior density, up to a constant, (draw, chain).
      real(wp), allocatable :: log_prior(:, :)
   end type checks_type

   !> Random streams (0, first_stream + chain) draw the noise. Predictions use others.
   integer, parameter :: first_stream = 5000000

contains

   !> Compute all checks. The last parameter of a draw may be the logarithm of the factor on the
   !> sds.
   subroutine check_model(posterior, chains, threads, checks)
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: threads
      type(checks_type), intent(out) :: checks
      real(wp), allocatable :: draws(:, :, :)
      integer :: n, c

      draws = chains%draws(:, ::thinning(chains, posterior%n_grains), :)
      n = size(draws, 2)
      allocate (checks%log_likelihood(posterior%n_grains, n, size(draws, 3)), &
         & checks%log_prior(n, size(draws, 3)))
      checks%replicated = checks%log_likelihood
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic, 1)
      do c = 1, size(draws, 3)
         call check_chain(c)
      end do
      !$omp end parallel do

   contains

      !> Compute the checks for the draws of one chain.
      subroutine check_chain(c)
         integer, intent(in) :: c
         type(random_stream_type) :: stream
         !> Number of crystals that are computed together.
         integer, parameter :: block = 16
         real(wp), allocatable :: moduli(:, :), u(:, :), reduced(:, :), mean(:), z(:), &
            & precision(:, :)
         real(wp), dimension(posterior%n_grains) :: model, scales, residuals, noise
         real(wp) :: stiffness(6, 6), value
         integer :: i, g

         stream = new_random_stream(0, first_stream + c)
         do i = 1, n
            stiffness = posterior%stiffness(draws(:, i, c))
            checks%log_prior(i, c) = posterior%prior%log_density_of_constants(stiffness)
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
            do g = 1, posterior%n_grains
               call posterior%errors%draw(stream, noise(g))
            end do
            checks%replicated(:, i, c) = model + scales*(matmul(reduced, mean + z) + noise)
         end do
      end subroutine check_chain
   end subroutine check_model
end module model_checks
