!> Whether the orientations explain the moduli, found without the crystal's constants.
!>
!> To first order in the anisotropy a modulus is a sum of the harmonics of the crystal class up to
!> degree 4, which least squares fit, with the errors that measurements share. If the orientations
!> are those of the grains, a chi-square is left. If the rows are in disorder, it is that of
!> shuffled rows: the share of shuffles that fit as well is a probability, the share that is noticed
!> the power of the check.
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

   !> A probability that is noticed, and the power that a remark on orientations needs.
   real(wp), parameter :: rare = 0.005_wp, enough_power = 0.5_wp
   !> The ways to mistake two axes: way k exchanges them if k is above 3, then reverses x if it has
   !> the bit 1, and y if it has 2; the signs.
   character(len=*), parameter :: mistakes(7) = [character(len=35) :: 'x reversed', 'y reversed', &
      & 'x and y reversed', 'x and y exchanged', 'x and y exchanged, then x reversed', &
      & 'x and y exchanged, then y reversed', 'x and y exchanged and reversed']
   integer, parameter :: signs(3, 7) = reshape([-1, 1, 1, 1, -1, 1, -1, -1, 1, 1, 1, 1, -1, 1, 1, &
      & 1, -1, 1, -1, -1, 1], [3, 7])
   !> Other readings of the same table; the last ones are of the map that it comes from.
   character(len=*), parameter, public :: readings(0:20) = [character(len=57) :: '', &
      & 'rotations from crystal to sample axes (the inverse)', &
      & 'the x axis of the sample as the indented one', &
      & 'the y axis of the sample as the indented one', 'the orientations in reverse order', &
      & 'the orientations one row further down', 'the orientations one row further up', &
      & 'the crystal axes with '//mistakes, 'the map with '//mistakes]
   integer, parameter :: of_map = 14, stream_number = 6000000

   type :: orientation_check_type
      !> Chi-square about one constant modulus and about the fit, its degrees of freedom and the
      !> probability of a larger one.
      real(wp) :: constant = 0.0_wp, chi_square = 0.0_wp, p = 1.0_wp
      integer :: freedom = 0
      !> Of shuffles the share that fits as well, and the share that is noticed.
      real(wp) :: p_shuffled = 1.0_wp, power = 0.0_wp
      !> Which of the `readings` fits much better than the table as it is; 0: none.
      integer :: better_reading = 0
      !> Grains without which the others agree, the worst first, and how far each is from what the
      !> others predict, sds.
      integer, allocatable :: outliers(:)
      real(wp), allocatable :: distances(:)
   contains
      procedure :: is_noticed
   end type orientation_check_type

   !> Moduli over their scales, their weights (0 or 1), the shared errors, and their fit.
   type :: fit_type
      real(wp), allocatable :: values(:), scales(:), weights(:), shared(:, :), columns(:, :), &
         & b(:), l(:, :)
      real(wp) :: chi_square = 0.0_wp
   contains
      procedure :: to_rows
   end type fit_type

contains

   !> Whether the orientations are not those of the grains.
   pure logical function is_noticed(self)
      class(orientation_check_type), intent(in) :: self

      ! Where all orders fit alike, they are alike.
      is_noticed = self%better_reading > 0 .or. (self%p < rare .and. self%power > enough_power &
         & .and. self%p_shuffled > rare .and. self%p_shuffled < 1.0_wp)
   end function is_noticed

   !> Fit `rows` of harmonics (grain, harmonic), whose coefficients have no prior; all else stays
   !> with the measurement.
   subroutine to_rows(self, rows)
      class(fit_type), intent(inout) :: self
      real(wp), intent(in) :: rows(:, :)
      !> A very large sd of the coefficients, GPa.
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
   end subroutine to_rows

   !> Check the orientations of the measured grains.
   subroutine check_orientations(posterior, x, misread, grain, check, error)
      type(posterior_type), intent(in) :: posterior
      !> A probable point, (dimension).
      real(wp), intent(in) :: x(:)
      !> Indented directions in crystal axes by the ways to mistake the axes of a map, (3, row,
      !> way); unallocated: there is no map.
      real(wp), allocatable, intent(in) :: misread(:, :, :)
      !> Of each row of the table the grain, of which it is one of the tests.
      integer, intent(in) :: grain(:)
      type(orientation_check_type), intent(out) :: check
      type(error_type), allocatable, intent(out) :: error
      type(harmonics_type) :: harmonics
      type(fit_type) :: fit, straight
      real(wp), dimension(posterior%n_grains) :: model, scales
      real(wp), parameter :: seen = 10.0_wp
      !> (grain, harmonic, reading).
      real(wp), allocatable :: u(:, :), directions(:, :), rows(:, :, :), values(:)
      real(wp) :: g(3, 3), far
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
      allocate (u(posterior%n_grains, posterior%n_shared))
      call posterior%predict_measurements(x, posterior%stiffness(x), model, scales, u)
      fit%scales = scales(:n)/posterior%errors%scale
      allocate (fit%weights(n), source=1.0_wp)
      allocate (rows(n, harmonics%n, 0:size(readings) - 1), values(harmonics%n))
      call factor_columns(u(:n, :)*posterior%errors%scale, fit%shared)
      do i = 1, n
         g = rotation_matrix(posterior%euler(:, i))
         directions = reshape([g(:, 3), g(3, :), g(:, 1), g(:, 2), g(:, [3, 3, 3]), &
            & [(signs(:, k)*g(merge([2, 1, 3], [1, 2, 3], k > 3), 3), k=1, 7)], &
            & spread(g(:, 3), 2, 7)], [3, size(readings)])
         do k = 1, size(readings)
            call evaluate_harmonics(harmonics, directions(:, k), rows(i, :, k - 1))
         end do
      end do
      ! Tests of a grain may lie in several: the mean of their moduli is that of their harmonics.
      if (allocated(misread)) rows(:, :, of_map:) = 0.0_wp
      do i = 1, merge(size(grain), 0, allocated(misread))
         do k = of_map, ubound(readings, 1)
            call evaluate_harmonics(harmonics, misread(:, i, k - of_map + 1), values)
            rows(grain(i), :, k) = rows(grain(i), :, k) + values/count(grain == grain(i))
         end do
      end do
      rows(:, :, 4:6) = reshape([rows(n:1:-1, :, 0), cshift(rows(:, :, 0), -1), &
         & cshift(rows(:, :, 0), 1)], [n, harmonics%n, 3])
      ! What the crystal leaves: it bends more than the harmonics do.
      fit%values = (posterior%data%modulus(:n) - model(:n))/fit%scales
      call fit%to_rows(rows(:, :, 0))
      check%chi_square = fit%chi_square
      ! A harmonic that the grains do not tell from those before it has the pivot 1.
      check%freedom = n - count([(fit%l(i, i) > seen, i=1, harmonics%n)])
      check%p = chi_square_above(check%chi_square, check%freedom)
      ! With sds that were fitted chi-square says nothing.
      if (posterior%infers_scale) check%p = nan
      far = 5.0_wp
      if (check%p < rare) call find_outliers(fit, rows(:, :, 0), far, check)
      straight = fit
      straight%values = (posterior%data%modulus(:n) - sum(posterior%data%modulus(:n))/n)/fit%scales
      if (check%p < rare .and. size(check%outliers) == 0) then
         ! A bad value may have bent the crystal so far that no grains agree about it: once more
         ! about one modulus.
         call straight%to_rows(rows(:, :, 0))
         call find_outliers(straight, rows(:, :, 0), far, check)
         fit%weights = straight%weights
      end if
      if (harmonics%n > 1) call try_shuffles(straight, rows, check)
      if (check%is_noticed() .or. size(check%outliers) > 0) return
      ! Now the orientations are above suspicion: as far as one grain of so many is by chance.
      do while (n*erfc((far - 0.1_wp)/sqrt(2.0_wp)) < rare)
         far = far - 0.1_wp
      end do
      call find_outliers(fit, rows(:, :, 0), far, check)
   end subroutine check_orientations

   !> Leave out the worst grain, then the next, while one is `far` off. If the others agree then,
   !> these are the outliers.
   subroutine find_outliers(fit, rows, far, check)
      type(fit_type), intent(inout) :: fit
      !> (grain, harmonic); sds.
      real(wp), intent(in) :: rows(:, :), far
      type(orientation_check_type), intent(inout) :: check
      real(wp), allocatable :: distances(:)
      integer :: i, n

      n = size(rows, 1)
      do
         distances = [(distance(i), i=1, n)]
         i = maxloc(fit%weights*abs(distances), dim=1)
         if (fit%weights(i)*abs(distances(i)) < far) exit
         if (size(check%outliers) >= max(1, min(20, n/10)) .or. check%freedom == 1) exit
         check%outliers = [check%outliers, i]
         check%freedom = check%freedom - 1
         fit%weights(i) = 0.0_wp
         call fit%to_rows(rows)
      end do
      check%distances = distances(check%outliers)
      if (chi_square_above(fit%chi_square, check%freedom) > rare) return
      check%freedom = check%freedom + size(check%outliers)
      check%outliers = check%outliers(:0)
      check%distances = check%distances(:0)
      fit%weights = 1.0_wp
      call fit%to_rows(rows)

   contains

      !> From what the others predict, its own weight taken out.
      real(wp) function distance(i)
         integer, intent(in) :: i
         real(wp) :: z(size(fit%b))

         z = fit%columns(i, :)
         call solve_lower(fit%l, z)
         distance = (fit%values(i) - sum(fit%columns(i, :)*fit%b))/sqrt(max(epsilon(far), &
            & 1.0_wp + (1.0_wp - 2.0_wp*fit%weights(i))*sum(z**2)))
      end function distance
   end subroutine find_outliers

   !> Fit measurements to the orientations of other grains, at random, and to those of other
   !> readings of the table.
   subroutine try_shuffles(fit, rows, check)
      !> About one modulus.
      type(fit_type), intent(in) :: fit
      !> (grain, harmonic, reading).
      real(wp), intent(in) :: rows(:, :, 0:)
      type(orientation_check_type), intent(inout) :: check
      !> Shuffles, and of many grains multiplications in all.
      real(wp), parameter :: most = 999.0_wp, fewest = 99.0_wp, multiplications = 2.0e8_wp
      !> By how much chi-square is lower: chance does this to right orientations once in exp(6)
      !> readings at most.
      real(wp), parameter :: clearly = 12.0_wp
      type(fit_type) :: other
      type(random_stream_type) :: stream
      real(wp) :: here, best
      !> Of the shuffles, chi-square.
      real(wp), allocatable :: found(:)
      integer :: order(size(rows, 1)), i, j, k, shuffles

      other = fit
      call other%to_rows(rows(:, :1, 0))
      check%constant = other%chi_square
      call other%to_rows(rows(:, :, 0))
      here = other%chi_square
      shuffles = int(max(fewest, min(most, multiplications/size(other%columns)/size(other%b))))
      stream = new_random_stream(0, stream_number)
      order = [(i, i=1, size(order))]
      allocate (found(shuffles))
      do k = 1, shuffles
         do i = size(order), 2, -1
            call stream%pick(i, j)
            order([i, j]) = order([j, i])
         end do
         call other%to_rows(rows(order, :, 0))
         found(k) = other%chi_square
      end do
      check%p_shuffled = (1.0_wp + count(found <= here))/(shuffles + 1)
      check%power = real(count([(chi_square_above(found(k), check%freedom) < rare, k=1, &
         & shuffles)]), wp)/shuffles + 0.0_wp*check%p
      if (.not. check%p >= 0.0_wp) return
      best = min(here - clearly, minval(found))
      do k = 1, ubound(readings, 1)
         call other%to_rows(rows(:, :, k))
         if (other%chi_square >= best &
            & .or. chi_square_above(other%chi_square, check%freedom) < rare) then
            cycle
         end if
         best = other%chi_square
         check%better_reading = k
      end do
   end subroutine try_shuffles
end module orientation_check
