!> Warnings on measurements that are unusual but may be intended.
module measurement_checks
   use crystal_class, only: crystal_class_type
   use diagnostics, only: diagnostic, diagnostic_type
   use errors, only: error_type, prefix_error
   use files, only: printable
   use kinds, only: wp
   use namelist_file, only: place
   use direction_checks, only: check_directions, refuse_radians
   use point_tables, only: angles_look_like_radians, points_type
   use repeated_tests, only: check_scatter
   use settings_schema, only: settings_type
   use statistics, only: median
   implicit none
   private
   public :: check_measurements


contains

   !> Warn of unusual measurements, and refuse angles in radians unless the settings declare them.
   subroutine check_measurements(path, settings, class, are_radians, measurements, warnings, error)
      !> The namelist, or the origin of keywords.
      character(len=*), intent(in) :: path
      type(settings_type), intent(in) :: settings
      type(crystal_class_type), intent(in) :: class
      !> Whether the angles of the table were in radians.
      logical, intent(in) :: are_radians
      type(points_type), intent(in) :: measurements
      type(diagnostic_type), allocatable, intent(inout) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: prefix
      !> Smallest plausible standard deviation of indentation, relative to the modulus.
      real(wp), parameter :: least_relative_sd = 0.003_wp
      logical :: radians
      real(wp) :: relative_sd
      integer :: i

      prefix = 'the table'
      if (allocated(settings%measurements%file)) then
         prefix = printable(settings%measurements%file)
      end if
      prefix = place(path, 'measurements', 'file')//prefix
      radians = .not. are_radians .and. angles_look_like_radians(measurements)
      if (radians) call refuse_radians(measurements, error)
      call prefix_error(error, prefix//': ')
      if (allocated(error)) return
      call check_scatter(measurements, prefix, warnings)
      if (measurements%n == 1) then
         warnings = [warnings, diagnostic('one_grain', prefix)]
      else if (allocated(class%name) .and. .not. radians &
         & .and. settings%measurements%orientations == 'known') then
         call check_directions(measurements, class, prefix, warnings, error)
         if (allocated(error)) return
      end if
      if (radians) warnings = [warnings, diagnostic('angles_like_radians', prefix)]
      if (any(measurements%sd_gpa > 0.5_wp*measurements%modulus_gpa)) then
         warnings = [warnings, diagnostic('large_sd', prefix)]
      end if
      if (measurements%n == 0) return
      relative_sd = median(measurements%n, measurements%sd_gpa/measurements%modulus_gpa)
      if (relative_sd > 0.0_wp .and. relative_sd < least_relative_sd) then
         warnings = [warnings, &
            & diagnostic('small_sds', prefix, 100.0_wp*[relative_sd, least_relative_sd])]
      end if
   end subroutine check_measurements

end module measurement_checks
