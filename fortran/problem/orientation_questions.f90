!> What is odd about the orientations of measurements.
module orientation_questions
   use crystal_class, only: crystal_class_type
   use distinct_directions, only: all_alike, angle_between, new_region, region_type
   use errors, only: error_type, refuse, warn, warning_type
   use kinds, only: degree, wp
   use point_tables, only: angles_look_like_radians, points_type
   use symmetric_harmonics, only: harmonics_type, new_harmonics
   use text, only: to_text
   implicit none
   private
   public :: question_directions, refuse_radians

contains

   !> As many angles below a full turn in radians, not all of them whole, are no chance.
   subroutine refuse_radians(points, error)
      type(points_type), intent(in) :: points
      type(error_type), allocatable, intent(out) :: error
      !> As many angles below 2 pi are no chance.
      integer, parameter :: few_grains = 3

      if (points%n < few_grains .or. .not. angles_look_like_radians(points)) return
      if (any(abs(points%euler_deg - anint(points%euler_deg)) > 0.0_wp)) then
         call refuse(error, &
            & 'no angle is above 2 pi, so these look like radians, and degrees are needed; if ' &
            & //'they are radians say angles = ''radians'', if degrees add 360 to a phi1')
      end if
   end subroutine refuse_radians

   !> Grains that are all alike, or in fewer different directions than there are combinations of the
   !> constants that indentation sees.
   subroutine question_directions(measurements, class, prefix, map_hint, warnings, error)
      type(points_type), intent(in) :: measurements
      type(crystal_class_type), intent(in) :: class
      !> What the warning begins with; what it ends with where all lie in one grain.
      character(len=*), intent(in) :: prefix, map_hint
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      !> Two directions are the same below so many degrees.
      real(wp), parameter :: alike = 5.0_wp
      !> To first order in the anisotropy a modulus has no harmonics of higher degree.
      integer, parameter :: degree_seen = 4
      type(region_type) :: region
      type(harmonics_type) :: harmonics
      real(wp) :: directions(3, measurements%n)
      integer :: kept(measurements%n), n, i, j

      call new_region(class, region)
      if (region%dimension == 0) return
      directions = measurements%directions()
      if (all_alike(region, directions, alike*degree)) then
         call warn(warnings, prefix//': the orientations are all alike (within 5 degrees of ' &
            & //'one): how the modulus depends on orientation is not determined'//map_hint)
         return
      end if
      call new_harmonics(class%generators, degree_seen, harmonics, error)
      if (allocated(error)) return
      n = 0
      do i = 1, size(directions, 2)
         if (any([(angle_between(region, directions(:, i), directions(:, kept(j))) < alike*degree, &
            & j=1, n)])) then
            cycle
         end if
         n = n + 1
         kept(n) = i
         if (n == harmonics%n) return
      end do
      call warn(warnings, prefix//': grains in '//to_text(n)//' different directions; at least ' &
         & //to_text(harmonics%n)//' are needed for the combinations of the ' &
         & //to_text(class%n_constants)//' constants that indentation determines')
   end subroutine question_directions

end module orientation_questions
