!> Checks of the orientations of measurements: their unit, and how many directions differ.
module direction_checks
   use crystal_class, only: crystal_class_type
   use diagnostics, only: diagnostic, diagnostic_type
   use distinct_directions, only: all_alike, angle_between, new_region, region_type
   use errors, only: error_type, refuse
   use kinds, only: degree, wp
   use point_tables, only: angles_look_like_radians, points_type
   use symmetric_harmonics, only: harmonics_type, new_harmonics
   implicit none
   private
   public :: check_directions, refuse_radians

contains

   !> Refuse angles that are probably in radians: all are below 2 pi, and some are not integers.
   subroutine refuse_radians(points, error)
      type(points_type), intent(in) :: points
      type(error_type), allocatable, intent(out) :: error
      !> Angles of at least this number of grains are not below 2 pi by chance.
      integer, parameter :: least_grains = 3

      if (points%n < least_grains .or. .not. angles_look_like_radians(points)) return
      if (any(abs(points%euler_deg - anint(points%euler_deg)) > 0.0_wp)) then
         call refuse(error, &
            & 'no angle is above 2 pi, so these look like radians, and degrees are needed; if ' &
            & //'they are radians say angles = ''radians'', if degrees add 360 to a phi1')
      end if
   end subroutine refuse_radians

   !> Warn if all grains have about the same direction, or if they have fewer different directions
   !> than there are combinations of the constants that indentation determines.
   subroutine check_directions(measurements, class, prefix, warnings, error)
      type(points_type), intent(in) :: measurements
      type(crystal_class_type), intent(in) :: class
      !> Subject of the diagnostics.
      character(len=*), intent(in) :: prefix
      type(diagnostic_type), allocatable, intent(inout) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      !> Angle below which two directions count as the same.
      real(wp), parameter :: least_angle = 5.0_wp*degree
      !> Highest degree of the harmonics of a modulus, to first order in the anisotropy.
      integer, parameter :: highest_degree = 4
      type(region_type) :: region
      type(harmonics_type) :: harmonics
      real(wp) :: directions(3, measurements%n)
      integer :: distinct(measurements%n), n, i, j

      call new_region(class, region)
      if (region%dimension == 0) return
      directions = measurements%directions()
      if (all_alike(region, directions, least_angle)) then
         warnings = [warnings, diagnostic('orientations_alike', prefix)]
         return
      end if
      call new_harmonics(class%generators, highest_degree, harmonics, error)
      if (allocated(error)) return
      n = 0
      do i = 1, size(directions, 2)
         if (any([(angle_between(region, directions(:, i), directions(:, distinct(j))) &
            & < least_angle, j=1, n)])) then
            cycle
         end if
         n = n + 1
         distinct(n) = i
         if (n == harmonics%n) return
      end do
      warnings = [warnings, diagnostic('few_directions', prefix, &
         & [real(wp) :: n, harmonics%n, class%n_constants])]
   end subroutine check_directions

end module direction_checks
