!> Checks of the orientations of measurements, and warnings on what is unusual but may be intended.
module measurement_checks
   use distinct_directions, only: all_alike, angle_between, new_region, region_type
   use errors, only: error_type, refuse
   use files, only: printable
   use kinds, only: degree, wp
   use point_tables, only: angles_look_like_radians, points_type
   use problem, only: problem_type
   use repeated_tests, only: check_scatter
   use statistics, only: median
   use symmetric_harmonics, only: harmonics_type, new_harmonics
   implicit none
   private
   public :: check_measurements, refuse_radians

contains

   !> Refuse angles that are probably in radians: all are below 2 pi, and some are not integers.
   subroutine refuse_radians(points, error)
      type(points_type), intent(in) :: points
      !> Nothing is done after an error.
      type(error_type), allocatable, intent(inout) :: error
      !> Angles of at least this number of grains are not below 2 pi by chance.
      integer, parameter :: least_grains = 3

      if (allocated(error) .or. points%n < least_grains) return
      if (.not. angles_look_like_radians(points)) return
      if (any(abs(points%euler_deg - anint(points%euler_deg)) > 0.0_wp)) then
         call refuse(error, &
            & 'no angle is above 2 pi, so these look like radians, and degrees are needed; if ' &
            & //'they are radians say angles = ''radians'', if degrees add 360 to a phi1')
      end if
   end subroutine refuse_radians

   !> Warn of unusual measurements, and refuse angles in radians unless the settings declare them.
   subroutine check_measurements(problem, error)
      type(problem_type), intent(inout) :: problem
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: subject
      !> Smallest plausible standard deviation of indentation, relative to the modulus.
      real(wp), parameter :: least_relative_sd = 0.003_wp
      logical :: radians
      real(wp) :: relative_sd

      subject = 'the table'
      associate (stated => problem%settings%measurements, measurements => problem%data%measurements)
         if (allocated(stated%file)) subject = subject//' '//printable(stated%file)
         radians = stated%angles == 'degrees' .and. angles_look_like_radians(measurements)
         if (radians) call refuse_radians(measurements, error)
         if (allocated(error)) return
         call check_scatter(measurements, subject, problem)
         if (measurements%n == 1) then
            call problem%warn('one_grain', subject)
         else if (allocated(problem%class%name) .and. .not. radians &
            & .and. stated%orientations == 'known') then
            call check_directions(measurements%directions())
            if (allocated(error)) return
         end if
         if (radians) call problem%warn('angles_like_radians', subject)
         if (any(measurements%sd_gpa > 0.5_wp*measurements%modulus_gpa)) then
            call problem%warn('large_sd', subject)
         end if
         if (measurements%n == 0) return
         relative_sd = median(measurements%n, measurements%sd_gpa/measurements%modulus_gpa)
         if (relative_sd > 0.0_wp .and. relative_sd < least_relative_sd) then
            call problem%warn('small_sds', subject, 100.0_wp*[relative_sd, least_relative_sd])
         end if
      end associate

   contains

      !> Warn if all grains have about the same direction, or if they have fewer different
      !> directions than there are combinations of the constants that indentation determines.
      subroutine check_directions(directions)
         !> In crystal axes, (3, n).
         real(wp), intent(in) :: directions(:, :)
         !> Angle below which two directions count as the same.
         real(wp), parameter :: least_angle = 5.0_wp*degree
         !> Highest degree of the harmonics of a modulus, to first order in the anisotropy.
         integer, parameter :: highest_degree = 4
         type(region_type) :: region
         type(harmonics_type) :: harmonics
         integer :: distinct(size(directions, 2)), n, i, j

         call new_region(problem%class, region)
         if (region%dimension == 0) return
         if (all_alike(region, directions, least_angle)) then
            call problem%warn('orientations_alike', subject)
            return
         end if
         call new_harmonics(problem%class%generators, highest_degree, harmonics, error)
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
         call problem%warn('few_directions', subject, &
            & [real(wp) :: n, harmonics%n, problem%class%n_constants])
      end subroutine check_directions
   end subroutine check_measurements

end module measurement_checks
