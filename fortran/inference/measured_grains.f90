!> The measured grains, and the effect of an uncertain orientation on a modulus.
!>
!> The tilt of the indented direction is normal in each of two components. Mean and variance of the
!> modulus follow from the product of two three-point rules with steps of sqrt 3 sds
!> (Gauss-Hermite), which are exact for moments up to degree 5 in each component.
module measured_grains
   use compliance_field, only: even_directions
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: euler_angles, rotation_matrix
   use direction_columns, only: angles_of_direction
   use distinct_directions, only: new_region, region_type
   use kinds, only: degree, wp
   use observables, only: observable_type, path_type
   implicit none
   private
   public :: measured_type, reference_rows_type, mean_modulus, spread_orientations, all_tilts, &
      & tilt_moments, n_tilts

   !> Measured moduli of n reference grains, whose crystals are known.
   type :: reference_rows_type
      !> Logarithm of each modulus over its prediction with the mean contrast, the relative sd of
      !> its error, and the derivative of the predicted logarithm with respect to ln(1+k), (n).
      real(wp), allocatable :: deviation(:), sd(:), slope(:)
      !> Relative sd of the moduli of the known crystal, (n), and its number; number of the group.
      real(wp), allocatable :: crystal_sd(:)
      integer, allocatable :: crystal(:), group(:)
   end type reference_rows_type

   !> Measurements in n grains: first the moduli, then the speeds of waves.
   type :: measured_type
      !> Bunge-Euler angles, (3, n), and sds of the tilt of the indented direction, per component,
      !> (n); radians.
      real(wp), allocatable :: euler(:, :), tilt_sd(:)
      !> Allocated if the orientations of the grains are unknown: `euler` then has all possible
      !> ones, and these are their probabilities, (orientation).
      real(wp), allocatable :: probability(:)
      !> Value and sd of each measurement, GPa or m/s, (n).
      real(wp), allocatable :: modulus(:), sd(:)
      !> Path of the wave of each measurement, (n), and the mass density, kg/m3.
      type(path_type), allocatable :: paths(:)
      real(wp) :: density = 1.0_wp
      !> Number of the calibration error of each measurement, 1, 2, .., (n).
      integer, allocatable :: group(:)
      !> Effect of one sd of each relative error that the user stated, (n, error).
      real(wp), allocatable :: shared(:, :)
      !> Unallocated if no references were measured.
      type(reference_rows_type), allocatable :: references
   end type measured_type

   !> Directions in which a grain is evaluated: the cells of a 3 x 3 grid of tilts, in the order of
   !> the rows of a grain model. The first is the middle cell, the grain without a tilt.
   integer, parameter :: n_tilts = 9, cells(n_tilts) = [5, 1, 2, 3, 4, 6, 7, 8, 9]

contains

   !> Indentation modulus of the isotropic solid that has the mean measurement, GPa: the mean of the
   !> moduli, or of the speeds if there are no moduli.
   pure real(wp) function mean_modulus(observable, measured)
      type(observable_type), intent(in) :: observable
      type(measured_type), intent(in) :: measured
      !> Indentation modulus over rho v^2 for Poisson's ratio 0.3.
      real(wp), parameter :: modulus_over_acoustic = 3.32_wp
      integer :: n

      n = count(.not. measured%paths%is_speed())
      if (n > 0 .or. size(measured%modulus) == 0) then
         mean_modulus = sum(measured%modulus(:n))/max(1, n)
         ! Very large if no solid has this value.
         mean_modulus = mean_modulus/max(observable%factor - observable%compliance*mean_modulus, &
            & 1.0e-3_wp)
      else
         mean_modulus = modulus_over_acoustic*1.0e-9_wp*measured%density &
                       & *(sum(measured%modulus)/size(measured%modulus))**2
      end if
   end function mean_modulus

   !> Orientations whose indented directions are spread evenly over the distinct ones of a class.
   subroutine spread_orientations(class, least, euler, probability)
      type(crystal_class_type), intent(in) :: class
      !> Least number of them.
      integer, intent(in) :: least
      !> Bunge-Euler angles, (3, n), radians, and share of all directions that each represents, (n).
      real(wp), allocatable, intent(out) :: euler(:, :), probability(:)
      type(region_type) :: region
      real(wp), allocatable :: directions(:, :)
      integer :: i, n

      call new_region(class, region)
      call even_directions(region, least, real(least, wp), directions)
      n = size(directions, 2)
      euler = reshape([(angles_of_direction(directions(:, i))*degree, i=1, n)], [3, n])
      probability = spread(1.0_wp, 1, n)
      ! Over an arc angles are even, areas are not.
      if (region%dimension == 1) probability = sqrt(1.0_wp - matmul(region%axis, directions)**2)
      probability = probability/sum(probability)
   end subroutine spread_orientations

   !> Orientations of n grains with all tilts, (3, n n_tilts): the grains as they are, then all with
   !> the first tilt, and so on.
   pure function all_tilts(euler, sd) result(orientations)
      !> Bunge-Euler angles (3, n), and sds of the tilts (n); radians.
      real(wp), intent(in) :: euler(:, :), sd(:)
      real(wp) :: orientations(3, size(euler, 2)*n_tilts)
      integer :: i, k, n

      n = size(sd)
      do k = 1, n_tilts
         do i = 1, n
            orientations(:, (k - 1)*n + i) = tilted(euler(:, i), &
               & tilt_step(sd(i))*[mod(cells(k) - 1, 3) - 1, (cells(k) - 1)/3 - 1])
         end do
      end do
   end function all_tilts

   !> Angle between neighbouring tilts, radians. For an exact orientation it only serves to
   !> differentiate.
   pure elemental real(wp) function tilt_step(sd)
      !> Of the tilt per component, radians.
      real(wp), intent(in) :: sd

      tilt_step = merge(sqrt(3.0_wp)*sd, 1.0_wp*degree, sd > 0.0_wp)
   end function tilt_step

   !> Orientation of a grain whose indented direction is tilted: the sample turns about its x and y
   !> axes.
   pure function tilted(euler, tilt) result(orientation)
      !> Bunge-Euler angles, and the tilt towards x and y; radians.
      real(wp), intent(in) :: euler(3), tilt(2)
      real(wp) :: orientation(3), axes(3, 3)

      ! The columns are the new sample axes in the old ones: z tilts, x and y follow.
      axes(:, 3) = [tilt(1), tilt(2), 1.0_wp]
      axes(:, 3) = axes(:, 3)/norm2(axes(:, 3))
      axes(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp] - axes(1, 3)*axes(:, 3)
      axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
      associate (x => axes(:, 1), z => axes(:, 3))
         axes(:, 2) = [z(2)*x(3) - z(3)*x(2), z(3)*x(1) - z(1)*x(3), z(1)*x(2) - z(2)*x(1)]
      end associate
      orientation = euler_angles(matmul(rotation_matrix(euler), axes))
   end function tilted

   !> Mean and variance of a modulus whose tilt is uncertain, GPa and GPa², and its slopes with
   !> respect to both components, GPa/rad.
   pure function tilt_moments(moduli, sd) result(moments)
      !> Moduli without a tilt and with each, GPa; sd of the tilt per component, radians.
      real(wp), intent(in) :: moduli(n_tilts), sd
      real(wp) :: moments(4)
      real(wp), parameter :: weights(3) = [1.0_wp, 4.0_wp, 1.0_wp]/6.0_wp
      real(wp) :: grid(n_tilts), weight(n_tilts)

      grid(cells) = moduli
      moments = [moduli(1), 0.0_wp, [grid(6) - grid(4), grid(8) - grid(2)]/(2.0_wp*tilt_step(sd))]
      if (sd <= 0.0_wp) return
      weight = reshape(spread(weights, 2, 3)*spread(weights, 1, 3), [n_tilts])
      moments(1) = dot_product(weight, grid)
      moments(2) = dot_product(weight, (grid - moments(1))**2)
   end function tilt_moments
end module measured_grains
