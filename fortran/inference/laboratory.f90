!> How the measured moduli of a laboratory differ from those of the crystal: the factor f of each
!> group of measurements and the contrast 1 + k, see `techniques`.
!>
!> f of a group is exp(mean + slope (ln(1+k) - its mean)) (1 + sd b) with a standard normal b. The
!> slope is zero unless reference grains have determined both.
!>
!> References change the prior of both by a linear update. The part of ln f that is not shared
!> between crystals, its contrast unless that is shared, and the error of its stated modulus are
!> errors of each reference crystal. Factors of different groups are taken as independent, given the
!> contrast.
module laboratory
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_solve
   use measured_grains, only: reference_rows_type
   use settings_schema, only: measurements_settings_type
   use techniques, only: technique_of, technique_type
   implicit none
   private
   public :: laboratory_type, new_laboratory, change_contrast

   type :: laboratory_type
      !> Mean and sd of ln(1+k).
      real(wp) :: contrast(2) = 0.0_wp
      !> Of f, (group).
      real(wp), allocatable :: mean(:), slope(:), sd(:)
   contains
      procedure :: has_contrast, changes_moduli, log_factor, update
   end type laboratory_type

contains

   !> The laboratory that &measurements states.
   pure type(laboratory_type) function new_laboratory(settings, n_groups, n_of_moduli) &
      & result(laboratory)
      type(measurements_settings_type), intent(in) :: settings
      !> Numbers of groups, and of those that have moduli, which precede those of speeds.
      integer, intent(in) :: n_groups, n_of_moduli

      laboratory%contrast = [settings%contrast_mean, settings%contrast_sd]
      allocate (laboratory%mean(n_groups), laboratory%slope(n_groups), source=0.0_wp)
      allocate (laboratory%sd(n_groups), source=settings%velocity_calibration_sd)
      laboratory%mean(:n_of_moduli) = settings%calibration_mean
      laboratory%sd(:n_of_moduli) = settings%calibration_sd
   end function new_laboratory

   !> Update the prior by measured references.
   subroutine update(self, settings, references, error)
      class(laboratory_type), intent(inout) :: self
      type(measurements_settings_type), intent(in) :: settings
      type(reference_rows_type), intent(in) :: references
      type(error_type), allocatable, intent(out) :: error
      type(technique_type) :: technique
      !> Of the unknowns: the shared part of ln f of each group, and ln(1+k).
      real(wp), dimension(size(self%mean) + 1) :: variance, mean
      real(wp), dimension(size(self%mean) + 1, size(self%mean) + 1) :: covariance
      real(wp) :: effect(size(references%sd), size(self%mean) + 1), shared, own, of_contrast
      real(wp), dimension(size(references%sd), size(references%sd)) :: errors
      real(wp), allocatable :: gain(:, :)
      integer :: i, j, n, k

      technique = technique_of(settings%technique)
      n = size(references%sd)
      k = size(mean)
      shared = min(settings%calibration_sd, technique%shared_sd)**2
      own = settings%calibration_sd**2 - shared
      of_contrast = self%contrast(2)**2
      variance(:k - 1) = merge(shared, 0.0_wp, self%sd > 0.0_wp)
      variance(k) = merge(of_contrast, 0.0_wp, technique%shares_contrast)
      effect = 0.0_wp
      errors = 0.0_wp
      do i = 1, n
         effect(i, references%group(i)) = 1.0_wp
         effect(i, k) = references%slope(i)
         do j = 1, n
            if (references%crystal(i) /= references%crystal(j)) cycle
            errors(i, j) = own + references%crystal_sd(i)**2 &
               & + (of_contrast - variance(k))*references%slope(i)*references%slope(j)
         end do
         errors(i, i) = errors(i, i) + references%sd(i)**2
      end do
      gain = effect*spread(variance, 1, n)
      errors = errors + matmul(gain, transpose(effect))
      call cholesky_factor(errors, error)
      if (allocated(error)) return
      covariance = -matmul(transpose(gain), solved(gain))
      do i = 1, k
         covariance(i, i) = covariance(i, i) + variance(i)
      end do
      mean = matmul(references%deviation - settings%calibration_mean, solved(gain))
      if (technique%shares_contrast .and. of_contrast > 0.0_wp) then
         self%contrast = [self%contrast(1) + mean(k), sqrt(covariance(k, k))]
         self%slope = covariance(:k - 1, k)/covariance(k, k)
      end if
      do i = 1, k - 1
         if (.not. self%sd(i) > 0.0_wp) cycle
         self%mean(i) = self%mean(i) + mean(i)
         self%sd(i) = sqrt(own + covariance(i, i) - self%slope(i)*covariance(i, k))
      end do

   contains

      !> The inverse of `errors` times columns.
      function solved(columns) result(x)
         real(wp), intent(in) :: columns(:, :)
         real(wp), allocatable :: x(:, :)

         x = columns
         call cholesky_solve(errors, x)
      end function solved
   end subroutine update

   !> Whether the contrast can differ from 1.
   pure logical function has_contrast(self)
      class(laboratory_type), intent(in) :: self

      has_contrast = any(abs(self%contrast) > 0.0_wp)
   end function has_contrast

   !> Whether contrast or mean factor can differ from 1.
   pure logical function changes_moduli(self)
      class(laboratory_type), intent(in) :: self

      changes_moduli = self%has_contrast() .or. any(abs(self%mean) > 0.0_wp)
   end function changes_moduli

   !> Mean of ln f of a group at a contrast.
   pure elemental real(wp) function log_factor(self, group, log_contrast)
      class(laboratory_type), intent(in) :: self
      integer, intent(in) :: group
      real(wp), intent(in) :: log_contrast

      log_factor = self%mean(group) + self%slope(group)*(log_contrast - self%contrast(1))
   end function log_factor

   !> Change the contrast of moduli about their mean over all directions.
   pure subroutine change_contrast(log_contrast, weights, are_moduli, values, slopes)
      !> ln(1+k), and the weight of each direction in the mean, (direction).
      real(wp), intent(in) :: log_contrast, weights(:)
      !> Whether a value is a modulus, (value).
      logical, intent(in) :: are_moduli(:)
      !> First the values, then the moduli of all directions, (value and direction), and derivatives
      !> of these.
      real(wp), intent(inout) :: values(:)
      real(wp), intent(inout), optional :: slopes(:)
      real(wp) :: mean, k, ratio
      integer :: i, n

      n = size(are_moduli)
      mean = sum(weights*log(values(n + 1:)))
      k = exp(log_contrast) - 1.0_wp
      do i = 1, n
         if (.not. are_moduli(i)) cycle
         ratio = exp(k*(log(values(i)) - mean))
         values(i) = values(i)*ratio
         if (present(slopes)) slopes(i) = slopes(i)*(1.0_wp + k)*ratio
      end do
   end subroutine change_contrast
end module laboratory
