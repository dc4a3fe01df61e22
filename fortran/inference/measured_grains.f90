!> The grains that were measured, and what an uncertain orientation does to a modulus.
!>
!> The tilt of the indented direction is normal in each of two components. The modulus, quadratic in the tilt, then has the mean
!> M + sd² tr H / 2 and the variance sd² |s|² + sd⁴ |H|² / 2 with slope s and curvature H, taken from six neighbouring directions.
module measured_grains
   use abstract_observable, only: observable_type
   use crystal_elasticity, only: euler_angles, rotation_matrix
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: degree, wp
   use text, only: to_text
   implicit none
   private
   public :: measured_type, check_measurements, all_tilts, tilt_moments, n_tilts

   !> Work arrays of a thread are on its stack.
   integer, parameter :: most_grains = 20000

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

   !> Refuse what cannot be a table of measurements.
   subroutine check_measurements(self, observable, may_be_empty, error)
      type(measured_type), intent(in) :: self
      class(observable_type), intent(in) :: observable
      !> No grains are allowed.
      logical, intent(in) :: may_be_empty
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = size(self%modulus)
      if (size(self%euler, 2) /= n .or. size(self%sd) /= n) then
         call raise(error, 'angles, moduli and sds are needed for the same number of grains', exit_bad_input)
      else if (n == 0 .and. .not. may_be_empty) then
         call raise(error, 'there are no measurements: at least one grain is needed', exit_bad_input)
      else if (n > most_grains) then
         call raise(error, to_text(n)//' grains are more than the '//to_text(most_grains)//' that are allowed', exit_bad_input)
      else if (.not. (all(self%modulus > 0.0_wp .and. self%modulus < huge(1.0_wp)) .and. all(abs(self%euler) < huge(1.0_wp)))) then
         call raise(error, 'a measured modulus is not positive, or a value is not finite', exit_bad_input)
      else if (any(self%modulus > observable%greatest_plausible)) then
         call raise(error, 'a measured modulus of '//to_text(maxval(self%modulus))//' '//observable%unit//' looks like ' &
            & //observable%mistaken_unit//'; allowed up to '//to_text(observable%greatest_plausible)//' ' &
            & //observable%unit, exit_bad_input)
      else if (.not. all(self%sd > 0.0_wp .and. self%sd < huge(1.0_wp))) then
         call raise(error, 'the sd of a measurement must be positive and finite', exit_bad_input)
      end if
   end subroutine check_measurements

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
   pure subroutine tilt_moments(moduli, sd, shift, variance)
      !> At the grain's own direction and its tilts, GPa; sd of the tilt per component, radians.
      real(wp), intent(in) :: moduli(n_tilts), sd
      real(wp), intent(out) :: shift, variance
      real(wp) :: first(2), second(3)

      associate (m => moduli)
         first = (m([2, 4]) - m([3, 5]))/(2.0_wp*tilt_step)
         second(:2) = (m([2, 4]) + m([3, 5]) - 2.0_wp*m(1))/tilt_step**2
         second(3) = ((m(6) + m(7) - 2.0_wp*m(1))/tilt_step**2 - second(1) - second(2))/2.0_wp
      end associate
      shift = 0.5_wp*sd**2*(second(1) + second(2))
      variance = sd**2*sum(first**2) + 0.5_wp*sd**4*(second(1)**2 + second(2)**2 + 2.0_wp*second(3)**2)
   end subroutine tilt_moments
end module measured_grains
