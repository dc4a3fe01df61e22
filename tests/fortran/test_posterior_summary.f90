!> What chains say: intervals, combinations, the point of largest density, and the gain of a further
!> measurement.
program test_posterior_summary
   use constants_prior, only: prior_type
   use crystal_class, only: new_crystal_class
   use errors, only: error_type
   use kinds, only: wp
   use known_targets, only: banana_type
   use logarithmic_coordinates, only: new_log_coordinates
   use next_measurement, only: candidates_type, choose_measurements, expected_gains, &
      & suggestions_type
   use posterior_summary, only: find_maximum, combination_type, correlate, find_combinations, &
      & parameter_type, summarise_parameters
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type
   use statistics, only: flattened
   use testing, only: check, check_close, check_refused, check_success, finish
   implicit none

   call test_parameters()
   call test_combinations()
   call test_simplex()
   call test_gains()
   call test_precise_measurements()
   call test_shared_errors()
   call finish()

contains

   !> Draws of a sawtooth, whose interval and moments are known.
   subroutine test_parameters()
      type(chains_type) :: chains
      type(parameter_type), allocatable :: parameters(:)
      integer :: i

      allocate (chains%draws(2, 500, 2), chains%log_density(500, 2), chains%acceptance(2))
      ! The numbers 1 to 1000, and their squares, in an order without trend.
      do i = 0, 999
         chains%draws(1, 1 + i/2, 1 + mod(i, 2)) = real(1 + mod(619*i, 1000), wp)
         chains%draws(2, 1 + i/2, 1 + mod(i, 2)) = real(1 + mod(619*i, 1000), wp)**2
      end do
      call summarise_parameters(chains, 2, parameters)
      call check_close('mean', parameters(1)%mean, 500.5_wp, 1.0e-10_wp)
      call check_close('unbiased sd', parameters(1)%sd, &
         & sqrt((1000.0_wp**2 - 1.0_wp)/12.0_wp*1000.0_wp/999.0_wp), 1.0e-10_wp)
      call check_close('interval of equal steps: the first', parameters(1)%hdi_95(1), &
         & 1.0_wp, 0.0_wp)
      call check_close('of 951 values', parameters(1)%hdi_95(2), 951.0_wp, 0.0_wp)
      call check_close('the narrowest is at the dense end', parameters(2)%hdi_95(2), &
         & 951.0_wp**2, 0.0_wp)
      call check('a sawtooth mixes', parameters(1)%diagnostics%r_hat < 1.01_wp &
         & .and. parameters(1)%diagnostics%ess_bulk > 500.0_wp)
   end subroutine test_parameters

   !> Normal logarithms whose covariances are known.
   subroutine test_combinations()
      integer, parameter :: samples = 20000
      type(chains_type) :: posterior, prior
      type(combination_type), allocatable :: found(:)
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      type(prior_type) :: about
      real(wp) :: z(2), mean(2), correlation(2, 2)
      real(wp), allocatable :: values(:, :)
      integer :: i, k

      call new_crystal_class('isotropic', about%class, error)
      about%n_constants = 2
      about%logarithms = new_log_coordinates(about%class)
      allocate (posterior%draws(2, samples, 1), prior%draws(2, samples, 1))
      stream = new_random_stream(4, 1)
      do i = 1, samples
         do k = 1, 2
            call stream%normal(z(k))
         end do
         prior%draws(:, i, 1) = constants_at(about, [6.0_wp, 11.0_wp] + 0.2_wp*z)
         ! log 3 K is known to 0.004, log 2 G as well as before.
         do k = 1, 2
            call stream%normal(z(k))
         end do
         posterior%draws(:, i, 1) = constants_at(about, [6.0_wp, 11.0_wp] + [0.004_wp, 0.2_wp]*z)
      end do
      correlation = correlate(posterior, 2)
      call check('the two trade off', correlation(1, 2) < -0.8_wp &
         & .and. abs(correlation(1, 1) - 1.0_wp) < 1.0e-12_wp)
      call find_combinations(about, flattened(posterior%draws), flattened(prior%draws), found, &
         & values, error)
      call check_success('combinations', error)
      mean = sum(posterior%draws(:, :, 1), 2)/samples
      ! Four standard errors of a variance of 4000 draws are 9 %.
      call check_close('the bulk modulus is known', (found(1)%sd/found(1)%prior_sd)**2, &
         & 0.02_wp**2, 0.13_wp*0.02_wp**2)
      call check_close('with the powers that C11 + 2 C12 has', &
         & found(1)%exponents(2)/found(1)%exponents(1), 2.0_wp*mean(2)/mean(1), 0.01_wp)
      call check_close('to its sd', found(1)%sd*maxval([mean(1), 2.0_wp*mean(2)]) &
         & /(mean(1) + 2.0_wp*mean(2)), 0.004_wp, 3.0e-4_wp)
      call check_close('the shear modulus is not', (found(2)%sd/found(2)%prior_sd)**2, &
         & 1.0_wp, 0.13_wp)
      call check('it goes with C12 as one goes down', &
         & found(2)%exponents(1)*found(2)%exponents(2) < 0.0_wp)
   end subroutine test_combinations

   function constants_at(about, w) result(constants)
      type(prior_type), intent(in) :: about
      real(wp), intent(in) :: w(2)
      real(wp) :: constants(2)

      constants = about%class%constants_of(about%logarithms%from_logarithms(w))
   end function constants_at

   subroutine test_simplex()
      type(banana_type) :: banana
      type(chains_type) :: chains
      real(wp) :: x(3)

      ! Parameters of sd 1.
      chains%draws = reshape(spread([-1.0_wp, 0.0_wp, 1.0_wp], 1, 3), [3, 3, 1])
      banana%dimension = 3
      banana%lower = [-1.5_wp, -10.0_wp, -5.0_wp]
      banana%upper = [2.0_wp, 10.0_wp, 5.0_wp]
      x = [1.2_wp, 1.3_wp, 0.5_wp]
      call find_maximum(banana, chains, x)
      call check('uphill along a ridge', maxval(abs(x)) < 0.02_wp)
      banana%lower(1) = 0.7_wp
      x = [1.2_wp, 1.3_wp, 0.5_wp]
      call find_maximum(banana, chains, x)
      call check_close('to a bound', x(1), 0.7_wp, 0.01_wp)
      call check('and not across it', x(1) >= 0.7_wp)
   end subroutine test_simplex

   !> Normal predictions with a target that is correlated with them.
   subroutine normal_case(draws, sd, candidates)
      integer, intent(in) :: draws
      real(wp), intent(in) :: sd
      type(candidates_type), intent(out) :: candidates
      type(random_stream_type) :: stream
      real(wp) :: z
      integer :: i

      allocate (candidates%predicted(draws, 1), candidates%shared_variance(draws, 1), &
         & candidates%target(draws), candidates%angle(1, 1), source=0.0_wp)
      candidates%least_angle = 0.1_wp
      candidates%shared_variance = 0.0_wp
      candidates%sd = [sd]
      candidates%cost = [1.0_wp]
      stream = new_random_stream(9, 1)
      do i = 1, draws
         call stream%normal(z)
         candidates%predicted(i, 1) = 200.0_wp + 3.0_wp*z
         candidates%target(i) = 5.0_wp*z
         call stream%normal(z)
         candidates%target(i) = candidates%target(i) + 4.0_wp*z
      end do
   end subroutine normal_case

   real(wp) function gain_of(candidates) result(gain)
      type(candidates_type), intent(in) :: candidates
      real(wp), allocatable :: weights(:, :)
      real(wp) :: gains(1)

      allocate (weights(size(candidates%predicted, 1), 1))
      weights = 1.0_wp/size(weights)
      call expected_gains(candidates, weights, 1, gains)
      gain = gains(1)
   end function gain_of

   pure real(wp) function variance(values)
      real(wp), intent(in) :: values(:)

      variance = sum((values - sum(values)/size(values))**2)/size(values)
   end function variance

   !> Normal predictions have closed forms: 0.5 log(1 + V/sd²) nats, and V r²/(V + sd²) of a
   !> target's variance.
   subroutine test_gains()
      real(wp), parameter :: sd = 2.0_wp
      type(candidates_type) :: candidates
      real(wp) :: v, r

      call normal_case(40000, sd, candidates)
      v = variance(candidates%predicted(:, 1))
      r = (sum(candidates%predicted(:, 1)*candidates%target)/40000 - sum(candidates%predicted(:, &
         & 1))/40000*sum(candidates%target)/40000)**2/(v*variance(candidates%target))
      call check_close('share of a normal target''s variance', gain_of(candidates), &
         & r*v/(v + sd**2), 0.01_wp)
      candidates%target = [real(wp) ::]
      call check_close('information of a normal prediction', gain_of(candidates), &
         & 0.5_wp*log(1.0_wp + v/sd**2), 0.01_wp)
   end subroutine test_gains

   !> The cost of a measurement however precise is bounded, and its gain is that of the limit.
   subroutine test_precise_measurements()
      type(candidates_type) :: candidates
      type(suggestions_type) :: suggestions
      real(wp) :: v, r, sd
      integer :: k

      do k = 3, 12, 3
         sd = 10.0_wp**(-k)
         call normal_case(4000, sd, candidates)
         v = variance(candidates%predicted(:, 1))
         r = 25.0_wp/41.0_wp
         ! 4000 draws, 100 or more within a kernel: the variance that is left is known to a few per
         ! cent of itself.
         call check_close('all that a value can tell of the target', &
            & gain_of(candidates), r, 0.03_wp)
         call choose_measurements(candidates, 1, 48, 1, 1, suggestions)
         call check('a precise measurement is chosen', all(suggestions%chosen == [1]))
         candidates%target = [real(wp) ::]
         call check_close('its information', gain_of(candidates), 0.5_wp*log(v/sd**2), 0.03_wp)
      end do
      candidates%predicted = 200.0_wp
      call check_close('of what is known already', gain_of(candidates), 0.0_wp, 1.0e-3_wp)
   end subroutine test_precise_measurements

   !> What a measurement says of errors that measurements share is not about the constants: 0.5
   !> log(1 + V/(S + sd²)) nats.
   subroutine test_shared_errors()
      real(wp), parameter :: sd = 1.0_wp, shared = 4.0_wp
      type(candidates_type) :: candidates
      type(random_stream_type) :: stream
      real(wp) :: v, z
      integer :: i

      call normal_case(40000, sd, candidates)
      candidates%target = [real(wp) ::]
      candidates%shared_variance = shared
      v = variance(candidates%predicted(:, 1))
      stream = new_random_stream(10, 1)
      do i = 1, size(candidates%predicted, 1)
         call stream%normal(z)
         candidates%predicted(i, 1) = candidates%predicted(i, 1) + sqrt(shared)*z
      end do
      call check_close('information about the constants alone', gain_of(candidates), &
         & 0.5_wp*log(1.0_wp + v/(shared + sd**2)), 0.02_wp)
   end subroutine test_shared_errors
end program test_posterior_summary
