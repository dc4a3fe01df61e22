!> Warnings on measurements that are unusual but may be intended.
module measurement_checks
   use crystal_class, only: crystal_class_type
   use errors, only: error_type, prefix_error, warn, warning_type
   use files, only: printable
   use kinds, only: wp
   use namelist_file, only: place
   use direction_checks, only: check_directions, refuse_radians
   use point_tables, only: angles_look_like_radians, points_type
   use repeated_tests, only: check_scatter
   use settings_schema, only: settings_type
   use statistics, only: median
   use text, only: to_text
   implicit none
   private
   public :: check_measurements

   !> Warning on Euler angles that look like radians; the name of their table precedes it.
   character(len=*), parameter, public :: like_radians = &
      & ': no angle is above 2 pi; angles are in degrees, and these look like radians'

contains

   !> Warn of unusual measurements, and refuse angles in radians unless the settings declare them.
   subroutine check_measurements(path, settings, class, measurements, warnings, error)
      !> The namelist, or the origin of keywords.
      character(len=*), intent(in) :: path
      type(settings_type), intent(in) :: settings
      type(crystal_class_type), intent(in) :: class
      type(points_type), intent(in) :: measurements
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: prefix, hint
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
      radians = settings%measurements%angles == 'degrees' &
         & .and. angles_look_like_radians(measurements)
      if (radians) call refuse_radians(measurements, error)
      call prefix_error(error, prefix//': ')
      if (allocated(error)) return
      call check_scatter(measurements, prefix, warnings)
      if (measurements%n == 1) then
         call warn(warnings, &
            & prefix//' has one grain; one modulus cannot determine the constants')
      else if (allocated(class%name) .and. .not. radians &
         & .and. settings%measurements%orientations == 'known') then
         hint = ''
         if (allocated(settings%measurements%ebsd)) then
            hint = '. If the positions all lie in one grain of the map, check the unit and the ' &
               & //'origin of x_um and y_um'
         end if
         call check_directions(measurements, class, prefix, hint, warnings, error)
         if (allocated(error)) return
      end if
      if (radians) call warn(warnings, prefix//like_radians)
      if (any(measurements%sd_gpa > 0.5_wp*measurements%modulus_gpa)) then
         call warn(warnings, prefix//': an sd_gpa is more than half of its modulus_gpa')
      end if
      if (measurements%n == 0) return
      relative_sd = median(measurements%n, measurements%sd_gpa/measurements%modulus_gpa)
      if (relative_sd > 0.0_wp .and. relative_sd < least_relative_sd) then
         call warn(warnings, prefix//': the sds are '//to_text(100.0_wp*relative_sd, 2) &
            & //' % of the moduli (median); indentation rarely does better than ' &
            & //to_text(100.0_wp*least_relative_sd, 1) &
            & //' %. sd_gpa is in GPa: if these are fractions, multiply them by the moduli')
      end if
   end subroutine check_measurements

end module measurement_checks
