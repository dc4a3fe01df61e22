!> Check whether the orientations explain the moduli, without the crystal's constants, and find the
!> outliers: grains without which the others agree.
!>
!> To first order in the anisotropy a modulus is a sum of the harmonics of the crystal class up to
!> degree 4. Least squares fit the sum, with the errors that measurements share. If the orientations
!> are those of the grains, the misfit is a chi-square. If the rows of the table are in the wrong
!> order, the misfit is that of shuffled rows. The share of shuffles that fit as well is a
!> probability, and the share that the chi-square test detects is the power of the check.
module orientation_check
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: rotation_matrix
   use errors, only: error_type
   use kinds, only: nan, wp
   use random, only: new_random_stream, random_stream_type
   use small_matrices, only: factor_columns, fit_columns, solve_lower
   use statistics, only: chi_square_above
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, new_harmonics
   implicit none
   private
   public :: orientation_check_type, check_orientations

   !> Probability below which a misfit counts: one false alarm in 200 data sets. The orientations
   !> are blamed only if the check has this power.
   real(wp), parameter :: rare = 0.005_wp, enough_power = 0.5_wp
   !> Mistaken axes and their signs. Mistake k exchanges x and y if k is above 3, then reverses x if
   !> k has the bit 1, and y if it has the bit 2.
   character(len=*), parameter :: mistakes(7) = [character(len=35) :: 'x reversed', 'y reversed', &
      & 'x and y reversed', 'x and y exchanged', 'x and y exchanged, then x reversed', &
      & 'x and y exchanged, then y reversed', 'x and y exchanged and reversed']
   integer, parameter :: signs(3, 7) = reshape([-1, 1, 1, 1, -1, 1, -1, -1, 1, 1, 1, 1, -1, 1, 1, &
      & 1, -1, 1, -1, -1, 1], [3, 7])
   !> Other readings of the same table. The last ones are of the map from which the table comes.
   character(len=*), parameter, public :: readings(0:20) = [character(len=57) :: '', &
      & 'rotations from crystal to sample axes (the inverse)', &
      & 'the x axis of the sample as the indented one', &
      & 'the y axis of the sample as the indented one', 'the orientations in reverse order', &
      & 'the orientations one row further down', 'the orientations one row further up', &
      & 'the crystal axes with '//mistakes, 'the map with '//mistakes]
   integer, parameter :: of_map = 14, stream_number = 6000000

   type :: orientation_check_type
      !> Chi-square about one constant modulus, chi-square about the fit, its degrees of freedom and
      !> the probability of a larger one.
      real(wp) :: constant = 0.0_wp, chi_square = 0.0_wp, p = 1.0_wp
      integer :: freedom = 0
      !> Share of shuffles that fit as well, and share that the chi-square test detects.
      real(wp) :: p_shuffled = 1.0_wp, power = 0.0_wp
      !> Number of the reading in `readings` that fits much better than the table as it is; 0: none.
      integer :: better_reading = 0
      !> Grains without which the others agree, the worst first, and the distance of each from what
      !> the others predict, sds.
      integer, allocatable :: outliers(:)
      real(wp), allocatable :: distances(:)
   contains
      procedure :: is_detected
   end type orientation_check_type

   !> A fit of harmonics: moduli and their scales, weights (0 or 1), (grain); columns of the shared
   !> errors and of the whole fit, (grain, column); solution and lower factor of its precision.
   type :: fit_type
      real(wp), allocatable :: values(:), scales(:), weights(:), shared(:, :), columns(:, :), &
         & b(:), l(:, :)
      real(wp) :: chi_square = 0.0_wp
   contains
      procedure :: fit_harmonics
   end type fit_type

contains

   !> Whether the check finds that the orientations are not those of the grains.
   pure logical function is_detected(self)
      class(orientation_check_type), intent(in) :: self

      ! If all orders fit equally well, the check cannot distinguish them.
      is_detected = self%better_reading > 0 .or. (self%p < rare .and. self%power > enough_power &
         & .and. self%p_shuffled > rare .and. self%p_shuffled < 1.0_wp)
   end function is_detected

   !> Fit rows of harmonics, (grain, harmonic), whose coefficients have no prior. Values, scales and
   !> weights of the moduli stay as they are.
   subroutine fit_harmonics(self, rows)
      class(fit_type), intent(inout) :: self
      real(wp), intent(in) :: rows(:, :)
      !> A very large sd of the coefficients, GPa, instead of no prior.
      real(wp), parameter :: free = 1000.0_wp
      integer :: k

      k = size(rows, 2) + size(self%shared, 2)
      self%columns = reshape([free*rows/spread(self%scales, 2, size(rows, 2)), self%shared], &
         & [size(rows, 1), k])
      if (allocated(self%b)) deallocate (self%b, self%l)
      allocate (self%b(k), self%l(k, k))
      call fit_columns(self%values, self%columns, self%weights, self%b, self%l)
      self%chi_square = sum(self%weights*(self%values - matmul(self%columns, self%b))**2) &
         & + sum(self%b**2)
   end subroutine fit_harmonics

   !> Check the orientations of the measured grains.
   subroutine check_orientations(posterior, x, misread, grain, check, error)
      type(posterior_type), intent(in) :: posterior
      !> A point of high posterior density, (dimension).
      real(wp), intent(in) :: x(:)
      !> Indented directions in crystal axes for each mistake of the axes of a map, (3, row,
      !> mistake); unallocated if there is no map.
      real(wp), allocatable, intent(in) :: misread(:, :, :)
      !> Grain of each row of the table; a grain may have several rows.
      integer, intent(in) :: grain(:)
      type(orientation_check_type), intent(out) :: check
      type(error_type), allocatable, intent(out) :: error
      type(harmonics_type) :: harmonics
      type(fit_type) :: fit, about_mean
      real(wp), dimension(posterior%n_grains) :: model, scales
      !> Least pivot of a harmonic that the grains distinguish from those before it; otherwise its
      !> pivot is 1.
      real(wp), parameter :: least_pivot = 10.0_wp
      !> (grain, harmonic, reading).
      real(wp), allocatable :: u(:, :), directions(:, :), rows(:, :, :), values(:)
      real(wp) :: g(3, 3), mistaken(21), threshold
      integer :: i, k, n

      n = posterior%n_moduli
      allocate (check%outliers(0), check%distances(0))
      if (allocated(posterior%unknown)) then
         check = orientation_check_type(nan, nan, nan, 0, nan, nan, 0, check%outliers, &
            & check%distances)
         return
      end if
      call new_harmonics(posterior%prior%class%generators, 4, harmonics, error)
      if (allocated(error) .or. n <= harmonics%n) return
      call posterior%predict_measurements(x, posterior%stiffness(x), model, scales, u)
      ! Shared errors in proportion to the predicted moduli would contain the orientations: they are
      ! taken in proportion to the mean modulus.
      do k = posterior%grains%n_columns + 1, posterior%n_calibrated + size(posterior%data%shared, 2)
         u(:n, k) = u(:n, k)*(sum(model(:n))/n)/model(:n)
      end do
      fit%scales = scales(:n)/posterior%errors%scale
      allocate (fit%weights(n), source=1.0_wp)
      allocate (rows(n, harmonics%n, 0:size(readings) - 1), values(harmonics%n))
      call factor_columns(u(:n, :)*posterior%errors%scale, fit%shared)
      do i = 1, n
         g = rotation_matrix(posterior%euler(:, i))
         mistaken = [(signs(:, k)*g(merge([2, 1, 3], [1, 2, 3], k > 3), 3), k=1, 7)]
         directions = reshape([g(:, 3), g(3, :), g(:, 1), g(:, 2), g(:, [3, 3, 3]), mistaken, &
            & spread(g(:, 3), 2, 7)], [3, size(readings)])
         do k = 1, size(readings)
            call evaluate_harmonics(harmonics, directions(:, k), rows(i, :, k - 1))
         end do
      end do
      ! Average over the tests of a grain, which may lie in several grains of the map: the mean of
      ! their moduli is that of their harmonics.
      if (allocated(misread)) then
         rows(:, :, of_map:) = 0.0_wp
         do i = 1, size(grain)
            do k = of_map, ubound(readings, 1)
               call evaluate_harmonics(harmonics, misread(:, i, k - of_map + 1), values)
               rows(grain(i), :, k) = rows(grain(i), :, k) + values/count(grain == grain(i))
            end do
         end do
      end if
      rows(:, :, 4:6) = reshape([rows(n:1:-1, :, 0), cshift(rows(:, :, 0), -1), &
         & cshift(rows(:, :, 0), 1)], [n, harmonics%n, 3])
      ! Fit the residuals of the crystal, whose moduli bend more than the harmonics do.
      fit%values = (posterior%data%modulus(:n) - model(:n))/fit%scales
      call fit%fit_harmonics(rows(:, :, 0))
      check%chi_square = fit%chi_square
      check%freedom = n - count([(fit%l(i, i) > least_pivot, i=1, harmonics%n)])
      check%p = chi_square_above(check%chi_square, check%freedom)
      ! If the sds are fitted, chi-square is not a test.
      if (posterior%infers_scale) check%p = nan
      ! Noise alone exceeds 5 sds once in two million measurements.
      threshold = 5.0_wp
      if (check%p < rare) call find_outliers(fit, rows(:, :, 0), threshold, check)
      about_mean = fit
      associate (moduli => posterior%data%modulus(:n))
         about_mean%values = (moduli - sum(moduli)/n)/fit%scales
      end associate
      if (check%p < rare .and. size(check%outliers) == 0) then
         ! A bad value may have bent the crystal so far that no grains agree with it. Search again,
         ! about a constant modulus.
         call about_mean%fit_harmonics(rows(:, :, 0))
         call find_outliers(about_mean, rows(:, :, 0), threshold, check)
         fit%weights = about_mean%weights
      end if
      if (harmonics%n > 1) call try_shuffles(about_mean, rows, check)
      if (check%is_detected() .or. size(check%outliers) > 0) return
      ! The orientations are not blamed. Lower the threshold until one of the n grains reaches it by
      ! chance with the probability `rare`.
      do while (n*erfc((threshold - 0.1_wp)/sqrt(2.0_wp)) < rare)
         threshold = threshold - 0.1_wp
      end do
      call find_outliers(fit, rows(:, :, 0), threshold, check)
   end subroutine check_orientations

   !> Leave out the worst grain, then the next, while one is beyond the threshold. They are the
   !> outliers if the others agree without them.
   subroutine find_outliers(fit, rows, threshold, check)
      type(fit_type), intent(inout) :: fit
      !> (grain, harmonic); least distance of an outlier, sds.
      real(wp), intent(in) :: rows(:, :), threshold
      type(orientation_check_type), intent(inout) :: check
      real(wp), allocatable :: distances(:)
      integer :: i, n

      n = size(rows, 1)
      do
         distances = [(distance(i), i=1, n)]
         i = maxloc(fit%weights*abs(distances), dim=1)
         if (fit%weights(i)*abs(distances(i)) < threshold) exit
         if (size(check%outliers) >= max(1, min(20, n/10)) .or. check%freedom == 1) exit
         check%outliers = [check%outliers, i]
         check%freedom = check%freedom - 1
         fit%weights(i) = 0.0_wp
         call fit%fit_harmonics(rows)
      end do
      check%distances = distances(check%outliers)
      if (chi_square_above(fit%chi_square, check%freedom) > rare) return
      check%freedom = check%freedom + size(check%outliers)
      check%outliers = check%outliers(:0)
      check%distances = check%distances(:0)
      fit%weights = 1.0_wp
      call fit%fit_harmonics(rows)

   contains

      !> Distance of a grain from the prediction of the others, without its own weight. For its
      !> variance h of the prediction, in units of the noise, the residual has the variance 1 - h if
      !> the grain is in the fit, and 1 + h if it is left out.
      real(wp) function distance(i)
         integer, intent(in) :: i
         real(wp) :: z(size(fit%b))

         z = fit%columns(i, :)
         call solve_lower(fit%l, z)
         distance = (fit%values(i) - sum(fit%columns(i, :)*fit%b))/sqrt(max(epsilon(threshold), &
            & 1.0_wp + (1.0_wp - 2.0_wp*fit%weights(i))*sum(z**2)))
      end function distance
   end subroutine find_outliers

   !> Fit the measurements to the orientations of other grains, at random, and to those of other
   !> readings of the table.
   subroutine try_shuffles(fit, rows, check)
      !> Fit about a constant modulus.
      type(fit_type), intent(in) :: fit
      !> (grain, harmonic, reading).
      real(wp), intent(in) :: rows(:, :, 0:)
      type(orientation_check_type), intent(inout) :: check
      !> Number of shuffles. For many grains it is lower, so that all fits together take about this
      !> number of multiplications (a second).
      real(wp), parameter :: most = 999.0_wp, fewest = 99.0_wp, multiplications = 2.0e8_wp
      !> Least decrease of chi-square of a better reading. Chance reaches it for right orientations
      !> once in exp(6) readings at most.
      real(wp), parameter :: least_decrease = 12.0_wp
      type(fit_type) :: other
      type(random_stream_type) :: stream
      real(wp) :: as_it_is, best
      !> Chi-square of each shuffle, (shuffle).
      real(wp), allocatable :: shuffled(:)
      integer :: order(size(rows, 1)), i, j, k, shuffles

      other = fit
      call other%fit_harmonics(rows(:, :1, 0))
      check%constant = other%chi_square
      call other%fit_harmonics(rows(:, :, 0))
      as_it_is = other%chi_square
      shuffles = int(max(fewest, min(most, multiplications/size(other%columns)/size(other%b))))
      stream = new_random_stream(0, stream_number)
      order = [(i, i=1, size(order))]
      allocate (shuffled(shuffles))
      do k = 1, shuffles
         do i = size(order), 2, -1
            call stream%pick(i, j)
            order([i, j]) = order([j, i])
         end do
         call other%fit_harmonics(rows(order, :, 0))
         shuffled(k) = other%chi_square
      end do
      check%p_shuffled = (1.0_wp + count(shuffled <= as_it_is))/(shuffles + 1)
      ! The power is NaN if p is: there is no test then, and no reading is better.
      check%power = real(count([(chi_square_above(shuffled(k), check%freedom) < rare, k=1, &
         & shuffles)]), wp)/shuffles + 0.0_wp*check%p
      if (.not. check%p >= 0.0_wp) return
      best = min(as_it_is - least_decrease, minval(shuffled))
      do k = 1, ubound(readings, 1)
         call other%fit_harmonics(rows(:, :, k))
         if (other%chi_square >= best &
            & .or. chi_square_above(other%chi_square, check%freedom) < rare) then
            cycle
         end if
         best = other%chi_square
         check%better_reading = k
      end do
   end subroutine try_shuffles
end module orientation_check
