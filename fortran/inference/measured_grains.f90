!> The grains that were measured, and what an uncertain orientation does to a modulus.
!>
!> The tilt of the indented direction is normal in each of two components. Mean and variance of the
!> modulus are those of the product of two three-point rules with steps of sqrt 3 sds
!> (Gauss-Hermite), exact for moments up to degree 5 in each component.
module measured_grains
   use crystal_elasticity, only: euler_angles, no_wave, path_type, rotation_matrix
   use kinds, only: degree, wp
   use observables, only: observable_type
   implicit none
   private
   public :: measured_type, mean_modulus, all_tilts, tilt_moments, n_tilts

   !> What was measured in n grains: moduli, then speeds of waves.
   type :: measured_type
      !> Bunge-Euler angles (3, n) and sds of the tilt of the indented direction, per component,
      !> (n); radians.
      real(wp), allocatable :: euler(:, :), tilt_sd(:)
      !> Allocated, the orientations are those that any measurement may be of, with these
      !> probabilities, (orientation).
      real(wp), allocatable :: probability(:)
      !> GPa, or m/s, (n).
      real(wp), allocatable :: modulus(:), sd(:)
      !> Of the waves, (n); and the density, kg/m3.
      type(path_type), allocatable :: paths(:)
      real(wp) :: density = 1.0_wp
      !> Which calibration error a measurement has, 1, 2, .., (n).
      integer, allocatable :: group(:)
      !> Relative errors of sd 1 times these, (n, error).
      real(wp), allocatable :: shared(:, :)
   end type measured_type

   !> Directions in which a grain is evaluated: the cells of a grid of tilts, itself in the middle,
   !> in their order.
   integer, parameter :: n_tilts = 9, cells(n_tilts) = [5, 1, 2, 3, 4, 6, 7, 8, 9]

contains

   !> Indentation modulus of the isotropic solid with the mean of what was measured times a factor,
   !> GPa: of the moduli, or of speeds alone.
   pure real(wp) function mean_modulus(observable, measured, factor)
      type(observable_type), intent(in) :: observable
      type(measured_type), intent(in) :: measured
      real(wp), intent(in) :: factor
      !> Over rho v^2, with Poisson's ratio 0.3.
      real(wp), parameter :: of_wave = 3.32_wp
      integer :: n

      n = count(measured%paths%wave == no_wave)
      if (n > 0 .or. size(measured%modulus) == 0) then
         mean_modulus = factor*sum(measured%modulus(:n))/max(1, n)
         ! Very large where no solid has it.
         mean_modulus = mean_modulus/max(observable%factor - observable%compliance*mean_modulus, &
            & 1.0e-3_wp)
      else
         mean_modulus = factor*of_wave*1.0e-9_wp*measured%density &
                       & *(sum(measured%modulus)/size(measured%modulus))**2
      end if
   end function mean_modulus

   !> The orientations (3, n n_tilts) of n grains: as they are, then all with the first tilt, and so
   !> on.
   pure function all_tilts(euler, sd) result(others)
      !> Bunge-Euler angles (3, n), and sds of the tilts (n); radians.
      real(wp), intent(in) :: euler(:, :), sd(:)
      real(wp) :: others(3, size(euler, 2)*n_tilts)
      integer :: i, k, n

      n = size(sd)
      do k = 1, n_tilts
         do i = 1, n
            others(:, (k - 1)*n + i) = tilted(euler(:, i), &
               & step_of(sd(i))*[mod(cells(k) - 1, 3) - 1, (cells(k) - 1)/3 - 1])
         end do
      end do
   end function all_tilts

   !> From tilt to tilt; of a grain whose orientation is exact for the slopes alone.
   pure elemental real(wp) function step_of(sd)
      !> Radians.
      real(wp), intent(in) :: sd

      step_of = merge(sqrt(3.0_wp)*sd, 1.0_wp*degree, sd > 0.0_wp)
   end function step_of

   !> The orientation of a grain whose indented direction is tilted: the sample turned about its x
   !> and y.
   pure function tilted(euler, tilt) result(other)
      !> Bunge-Euler angles, and the tilt towards x and y; radians.
      real(wp), intent(in) :: euler(3), tilt(2)
      real(wp) :: other(3), axes(3, 3)

      ! The columns are the new sample axes in the old ones: z tilts, x and y follow.
      axes(:, 3) = [tilt(1), tilt(2), 1.0_wp]
      axes(:, 3) = axes(:, 3)/norm2(axes(:, 3))
      axes(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp] - axes(1, 3)*axes(:, 3)
      axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
      axes(:, 2) = [axes(2, 3)*axes(3, 1) - axes(3, 3)*axes(2, 1), axes(3, 3)*axes(1, 1) - axes(1, &
         & 3)*axes(3, 1), axes(1, 3)*axes(2, 1) - axes(2, 3)*axes(1, 1)]
      other = euler_angles(matmul(rotation_matrix(euler), axes))
   end function tilted

   !> Mean and variance of a modulus of an uncertain tilt, GPa and GPa², and its slope by each
   !> component, GPa/rad.
   pure function tilt_moments(moduli, sd) result(moments)
      !> At the grain's own direction and its tilts, GPa; sd of the tilt per component, radians.
      real(wp), intent(in) :: moduli(n_tilts), sd
      real(wp) :: moments(4)
      real(wp), parameter :: weights(3) = [1.0_wp, 4.0_wp, 1.0_wp]/6.0_wp
      real(wp) :: grid(n_tilts), weight(n_tilts)

      grid(cells) = moduli
      moments = [moduli(1), 0.0_wp, [grid(6) - grid(4), grid(8) - grid(2)]/(2.0_wp*step_of(sd))]
      if (sd <= 0.0_wp) return
      weight = reshape(spread(weights, 2, 3)*spread(weights, 1, 3), [n_tilts])
      moments(1) = dot_product(weight, grid)
      moments(2) = dot_product(weight, (grid - moments(1))**2)
   end function tilt_moments
end module measured_grains
