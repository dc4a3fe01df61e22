!> Whether the orientations explain the moduli, found without the crystal's constants.
!>
!> To first order in the anisotropy a modulus is a sum of the harmonics of the crystal class up to degree 4. Least
!> squares fit them, with the errors that measurements share. If the orientations are those of the grains, what is left is a chi-square.
!> If the orientations are shuffled, chi-square is that of shuffled moduli: how many shuffles fit as well is the probability of
!> the measurements without any orientation, and how many are noticed the power of the check.
module orientation_check
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: rotation_matrix
   use errors, only: error_type
   use kinds, only: wp
   use random, only: new_random_stream, random_stream_type
   use small_matrices, only: factor_columns, fit_columns, solve_lower
   use statistics, only: chi_square_above
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, new_harmonics
   implicit none
   private
   public :: orientation_check_type, check_orientations, rare

   !> A probability that is noticed, and the power that a remark on orientations needs.
   real(wp), parameter :: rare = 0.01_wp, enough_power = 0.5_wp
   !> Other readings of the same table.
   character(len=*), parameter, public :: readings(0:6) = [character(len=52) :: '', &
      & 'rotations from crystal to sample axes (the inverse)', &
      & 'the x axis of the sample as the indented one', 'the y axis of the sample as the indented one', &
      & 'the orientations in reverse order', 'the orientations one row further down', 'the orientations one row further up']
   !> Of the first readings and the table as it is; of the shuffles.
   integer, parameter :: n_directions = 4, stream_number = 6000000

   type :: orientation_check_type
      !> Chi-square about one constant modulus and about the fit, its degrees of freedom and the probability of a larger one.
      real(wp) :: constant = 0.0_wp, chi_square = 0.0_wp, p = 1.0_wp
      integer :: freedom = 0
      !> Of shuffles the share that fits as well, and the share that is noticed.
      real(wp) :: p_shuffled = 1.0_wp, power = 0.0_wp
      !> Which of the `readings` fits while the table as it is does not; 0: none.
      integer :: better = 0
      !> Grains without which the others agree, the first the worst, and how far each is from what the others predict, sds.
      integer, allocatable :: outliers(:)
      real(wp), allocatable :: distances(:)
   contains
      procedure :: is_noticed
   end type orientation_check_type

   !> Moduli over their sds, their weights (0 or 1), the shared errors, and their fit.
   type :: fit_type
      real(wp), allocatable :: values(:), scales(:), weights(:), shared(:, :), columns(:, :), b(:), l(:, :)
      real(wp) :: chi_square = 0.0_wp
   contains
      procedure :: to_rows
   end type fit_type

contains

   !> Whether the orientations are not those of the grains.
   pure logical function is_noticed(self)
      class(orientation_check_type), intent(in) :: self

      is_noticed = self%p < rare .and. self%power > enough_power .and. (self%p_shuffled > rare .or. self%better > 0)
   end function is_noticed

   !> Fit `rows` of harmonics (grain, harmonic), whose coefficients have no prior; all else stays with the measurement.
   subroutine to_rows(self, rows)
      class(fit_type), intent(inout) :: self
      real(wp), intent(in) :: rows(:, :)
      !> A very large sd of the coefficients, GPa.
      real(wp), parameter :: free = 1000.0_wp
      integer :: k

      self%columns = reshape([free*rows/spread(self%scales, 2, size(rows, 2)), self%shared], [size(rows, 1), size(rows, 2) &
         & + size(self%shared, 2)])
      k = size(self%columns, 2)
      if (allocated(self%b)) deallocate (self%b, self%l)
      allocate (self%b(k), self%l(k, k))
      call fit_columns(self%values, self%columns, self%weights, self%b, self%l)
      self%chi_square = sum(self%weights*(self%values - matmul(self%columns, self%b))**2) + sum(self%b**2)
   end subroutine to_rows

   !> How far grain i is from what the others say, sds, itself left out.
   real(wp) function distance(self, i)
      class(fit_type), intent(in) :: self
      integer, intent(in) :: i
      real(wp) :: z(size(self%b))

      z = self%columns(i, :)
      call solve_lower(self%l, z)
      distance = (self%values(i) - sum(self%columns(i, :)*self%b))/sqrt(max(epsilon(1.0_wp), 1.0_wp &
         & + (1.0_wp - 2.0_wp*self%weights(i))*sum(z**2)))
   end function distance

   !> Check the orientations of the measured grains.
   subroutine check_orientations(posterior, x, check, error)
      type(posterior_type), intent(in) :: posterior
      !> A probable point, (dimension), whose errors are taken.
      real(wp), intent(in) :: x(:)
      type(orientation_check_type), intent(out) :: check
      type(error_type), allocatable, intent(out) :: error
      type(harmonics_type) :: harmonics
      type(fit_type) :: fit
      real(wp), dimension(posterior%n_grains) :: model, scales
      real(wp) :: u(posterior%n_grains, posterior%n_shared), g(3, 3), directions(3, n_directions)
      real(wp), allocatable :: rows(:, :, :)
      integer :: i, k, n

      n = posterior%n_grains
      allocate (check%outliers(0), check%distances(0))
      call new_harmonics(posterior%prior%class, 4, harmonics, error)
      if (allocated(error)) return
      check%freedom = n - harmonics%n
      if (check%freedom < 1 .or. harmonics%n == 1) return
      call posterior%predict_measurements(x, posterior%stiffness(x), model, scales, u)
      fit%scales = scales/posterior%errors%scale
      allocate (fit%weights(n), source=1.0_wp)
      allocate (fit%shared(n, min(n, posterior%n_shared)))
      call factor_columns(u*posterior%errors%scale, fit%shared)
      allocate (rows(n, harmonics%n, n_directions))
      do i = 1, n
         g = rotation_matrix(posterior%euler(:, i))
         directions = reshape([g(:, 3), g(3, :), g(:, 1), g(:, 2)], [3, n_directions])
         do k = 1, n_directions
            call evaluate_harmonics(harmonics, directions(:, k), rows(i, :, k))
         end do
      end do
      ! The crystal bends more than the harmonics do, but may not be the best one.
      fit%values = (posterior%measured - model)/fit%scales
      call fit%to_rows(rows(:, :0, 1))
      check%chi_square = fit%chi_square
      fit%values = (posterior%measured - sum(posterior%measured)/n)/fit%scales
      call fit%to_rows(rows(:, :1, 1))
      check%constant = fit%chi_square
      call fit%to_rows(rows(:, :, 1))
      check%chi_square = min(check%chi_square, fit%chi_square)
      check%p = chi_square_above(check%chi_square, check%freedom)
      ! With sds that were fitted chi-square says nothing.
      if (posterior%infers_scale) check%p = ieee_value(1.0_wp, ieee_quiet_nan)
      if (check%p < rare) call find_outliers(fit, rows(:, :, 1), check)
      call try_shuffles(fit, rows, check)
      check%power = check%power + 0.0_wp*check%p
   end subroutine check_orientations

   !> Leave out the worst grain, if it is far off, then the next, till the others agree; if that takes too many, none is to blame.
   subroutine find_outliers(fit, rows, check)
      type(fit_type), intent(inout) :: fit
      !> (grain, harmonic).
      real(wp), intent(in) :: rows(:, :)
      type(orientation_check_type), intent(inout) :: check
      real(wp), parameter :: far = 5.0_wp, most = 0.1_wp
      real(wp), allocatable :: distances(:)
      integer :: i, n

      n = size(rows, 1)
      do
         distances = [(fit%weights(i)*distance(fit, i), i=1, n)]
         i = maxloc(abs(distances), dim=1)
         if (abs(distances(i)) < far .or. size(check%outliers) >= max(1.0_wp, most*n) .or. check%freedom == 1) exit
         check%outliers = [check%outliers, i]
         check%freedom = check%freedom - 1
         fit%weights(i) = 0.0_wp
         call fit%to_rows(rows)
         if (chi_square_above(fit%chi_square, check%freedom) < rare) cycle
         check%distances = [(distance(fit, check%outliers(i)), i=1, size(check%outliers))]
         return
      end do
      check%freedom = check%freedom + size(check%outliers)
      deallocate (check%outliers)
      allocate (check%outliers(0))
      fit%weights = 1.0_wp
      call fit%to_rows(rows)
   end subroutine find_outliers

   !> Fit the orientations of other grains, at random, and those of other readings of the table.
   subroutine try_shuffles(fit, rows, check)
      type(fit_type), intent(inout) :: fit
      !> (grain, harmonic, direction).
      real(wp), intent(in) :: rows(:, :, :)
      type(orientation_check_type), intent(inout) :: check
      !> Shuffles, and of many grains multiplications in all.
      real(wp), parameter :: most = 999.0_wp, fewest = 99.0_wp, multiplications = 2.0e8_wp
      type(random_stream_type) :: stream
      real(wp) :: here, best
      integer :: order(size(rows, 1)), i, j, k, n, shuffles, as_well, noticed

      n = size(order)
      here = fit%chi_square
      best = here
      shuffles = int(max(fewest, min(most, multiplications/size(fit%columns)/size(fit%b))))
      stream = new_random_stream(0, stream_number)
      order = [(i, i=1, n)]
      as_well = 1
      noticed = 0
      do k = 1, shuffles
         do i = n, 2, -1
            call stream%pick(i, j)
            order([i, j]) = order([j, i])
         end do
         call fit%to_rows(rows(order, :, 1))
         best = min(best, fit%chi_square)
         if (fit%chi_square <= here) as_well = as_well + 1
         if (chi_square_above(fit%chi_square, check%freedom) < rare) noticed = noticed + 1
      end do
      check%p_shuffled = real(as_well, wp)/(shuffles + 1)
      check%power = real(noticed, wp)/shuffles
      if (.not. check%p < rare) return
      order = [(i, i=1, n)]
      do k = 1, ubound(readings, 1)
         if (k <= 3) call fit%to_rows(rows(:, :, k + 1))
         if (k == 4) call fit%to_rows(rows(n:1:-1, :, 1))
         if (k > 4) call fit%to_rows(rows(cshift(order, 2*k - 11), :, 1))
         if (fit%chi_square >= best .or. chi_square_above(fit%chi_square, check%freedom) < rare) cycle
         best = fit%chi_square
         check%better = k
      end do
   end subroutine try_shuffles
end module orientation_check
