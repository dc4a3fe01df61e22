!> The grains that were measured, and what an uncertain orientation does to a modulus.
!>
!> The tilt of the indented direction is normal in each of two components. The modulus, quadratic in the tilt, then has the mean
!> M + sd² tr H / 2 and the variance sd² |s|² + sd⁴ |H|² / 2 with slope s and curvature H, taken from six neighbouring directions.
module measured_grains
   use crystal_elasticity, only: euler_angles, rotation_matrix
   use kinds, only: degree, wp
   implicit none
   private
   public :: measured_type, all_tilts, tilt_moments, n_tilts

   !> What was measured in n grains.
   type :: measured_type
      !> Bunge-Euler angles (3, n) and sds of the tilt of the indented direction, per component, (n); radians.
      real(wp), allocatable :: euler(:, :), tilt_sd(:)
      !> GPa, (n).
      real(wp), allocatable :: modulus(:), sd(:)
      !> Which calibration error a measurement has, 1, 2, .., (n).
      integer, allocatable :: group(:)
   end type measured_type

   !> Directions in which a grain is evaluated for its slope and curvature: itself, and six tilts along two axes.
   integer, parameter :: n_tilts = 7
   real(wp), parameter :: tilt_step = 1.0_wp*degree
   real(wp), parameter :: tilts(2, n_tilts) = reshape(tilt_step*[0, 0, 1, 0, -1, 0, 0, 1, 0, -1, 1, 1, -1, -1], [2, n_tilts])

contains

   !> The orientations (3, n n_tilts) of n grains: as they are, then all with the first tilt, and so on.
   pure function all_tilts(euler) result(others)
      !> Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: euler(:, :)
      real(wp) :: others(3, size(euler, 2)*n_tilts)
      integer :: i, k, n

      n = size(euler, 2)
      others(:, :n) = euler
      do k = 2, n_tilts
         do i = 1, n
            others(:, (k - 1)*n + i) = tilted(euler(:, i), tilts(:, k))
         end do
      end do
   end function all_tilts

   !> The orientation of a grain whose indented direction is tilted: the sample turned about its x and y.
   pure function tilted(euler, tilt) result(other)
      !> Bunge-Euler angles, and the tilt towards x and y; radians.
      real(wp), intent(in) :: euler(3), tilt(2)
      real(wp) :: other(3)
      real(wp) :: axes(3, 3), g(3, 3)

      ! The columns are the new sample axes in the old ones: z tilts, x and y follow.
      axes(:, 3) = [tilt(1), tilt(2), 1.0_wp]
      axes(:, 3) = axes(:, 3)/norm2(axes(:, 3))
      axes(:, 1) = [1.0_wp, 0.0_wp, 0.0_wp] - axes(1, 3)*axes(:, 3)
      axes(:, 1) = axes(:, 1)/norm2(axes(:, 1))
      axes(:, 2) = [axes(2, 3)*axes(3, 1) - axes(3, 3)*axes(2, 1), axes(3, 3)*axes(1, 1) - axes(1, 3)*axes(3, 1), &
         & axes(1, 3)*axes(2, 1) - axes(2, 3)*axes(1, 1)]
      g = matmul(rotation_matrix(euler), axes)
      other = euler_angles(g)
   end function tilted

   !> Shift of the mean modulus and variance, GPa and GPa², for an uncertain tilt.
   pure subroutine tilt_moments(moduli, sd, shift, variance, slopes)
      !> At the grain's own direction and its tilts, GPa; sd of the tilt per component, radians.
      real(wp), intent(in) :: moduli(n_tilts), sd
      real(wp), intent(out) :: shift, variance
      !> GPa/rad, of each component.
      real(wp), intent(out) :: slopes(2)
      real(wp) :: second(3)

      associate (m => moduli)
         slopes = (m([2, 4]) - m([3, 5]))/(2.0_wp*tilt_step)
         second(:2) = (m([2, 4]) + m([3, 5]) - 2.0_wp*m(1))/tilt_step**2
         second(3) = ((m(6) + m(7) - 2.0_wp*m(1))/tilt_step**2 - second(1) - second(2))/2.0_wp
      end associate
      shift = 0.5_wp*sd**2*(second(1) + second(2))
      variance = sd**2*sum(slopes**2) + 0.5_wp*sd**4*(second(1)**2 + second(2)**2 + 2.0_wp*second(3)**2)
   end subroutine tilt_moments
end module measured_grains
