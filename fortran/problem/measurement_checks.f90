!> Checks of the orientations of measurements, and warnings on what is unusual but may be intended.
module measurement_checks
   use crystal_class, only: crystal_class_type
   use diagnostics, only: diagnostic, diagnostic_type
   use distinct_directions, only: all_alike, angle_between, new_region, region_type
   use errors, only: error_type, refuse
   use files, only: printable
   use kinds, only: degree, wp
   use point_tables, only: angles_look_like_radians, points_type
   use repeated_tests, only: check_scatter
   use settings_schema, only: settings_type
   use statistics, only: median
   use symmetric_harmonics, only: harmonics_type, new_harmonics
   implicit none
   private
   public :: check_measurements, refuse_radians

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

   !> Warn of unusual measurements, and refuse angles in radians unless the settings declare them.
   subroutine check_measurements(settings, class, measurements, warnings, error)
      type(settings_type), intent(in) :: settings
      type(crystal_class_type), intent(in) :: class
      type(points_type), intent(in) :: measurements
      type(diagnostic_type), allocatable, intent(inout) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: subject
      !> Smallest plausible standard deviation of indentation, relative to the modulus.
      real(wp), parameter :: least_relative_sd = 0.003_wp
      logical :: radians
      real(wp) :: relative_sd

      subject = 'the table'
      if (allocated(settings%measurements%file)) then
         subject = subject//' '//printable(settings%measurements%file)
      end if
      radians = settings%measurements%angles == 'degrees' &
         & .and. angles_look_like_radians(measurements)
      if (radians) call refuse_radians(measurements, error)
      if (allocated(error)) return
      call check_scatter(measurements, subject, warnings)
      if (measurements%n == 1) then
         call warn('one_grain')
      else if (allocated(class%name) .and. .not. radians &
         & .and. settings%measurements%orientations == 'known') then
         call check_directions()
         if (allocated(error)) return
      end if
      if (radians) call warn('angles_like_radians')
      if (any(measurements%sd_gpa > 0.5_wp*measurements%modulus_gpa)) then
         call warn('large_sd')
      end if
      if (measurements%n == 0) return
      relative_sd = median(measurements%n, measurements%sd_gpa/measurements%modulus_gpa)
      if (relative_sd > 0.0_wp .and. relative_sd < least_relative_sd) then
         call warn('small_sds', 100.0_wp*[relative_sd, least_relative_sd])
      end if

   contains

      !> Append a diagnostic of the table.
      subroutine warn(code, numbers)
         !> See `diagnostics`.
         character(len=*), intent(in) :: code
         real(wp), intent(in), optional :: numbers(:)

         warnings = [warnings, diagnostic(code, subject, numbers)]
      end subroutine warn

      !> Warn if all grains have about the same direction, or if they have fewer different
      !> directions than there are combinations of the constants that indentation determines.
      subroutine check_directions()
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
            call warn('orientations_alike')
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
         call warn('few_directions', [real(wp) :: n, harmonics%n, class%n_constants])
      end subroutine check_directions
   end subroutine check_measurements

end module measurement_checks
