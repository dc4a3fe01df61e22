!> The table of measured speeds of waves, beside or instead of moduli: a row of each follows the rows of the moduli.
module velocity_tables
   use errors, only: error_type
   use kinds, only: nan, wp
   use point_tables, only: points_type, read_angles, read_column, read_groups
   use table_columns, only: find_column
   use tables, only: table_type
   use text, only: join, lower
   implicit none
   private
   public :: read_velocities, append_velocities, wave_kind, wave_names

   !> Kinds of waves, from 0 on; those after the third are bulk waves along the normal in place of the direction of propagation, which has
   !> two whole turns more for each kind.
   character(len=*), parameter :: wave_names(0:3) = [character(len=12) :: 'rayleigh', 'longitudinal', 'shear_slow', 'shear_fast']

contains

   !> The kind of wave that a direction of propagation, in turns, means.
   elemental integer function wave_kind(turns)
      real(wp), intent(in) :: turns

      wave_kind = int(0.5_wp*turns + 0.25_wp)
   end function wave_kind

   !> Orientations, directions of propagation, which waves, and speeds with their sds, m/s.
   subroutine read_velocities(table, radians, points, error)
      type(table_type), intent(in) :: table
      !> The unit of the Euler angles in the table.
      logical, intent(in) :: radians
      !> The speeds stand in place of the moduli.
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      integer :: column, kind, i

      column = table%find('wave')
      points%table = table
      call read_angles(points, radians, error)
      call read_column(table, 'propagation_deg', column > 0, points%propagation_deg, error)
      call read_column(table, 'rayleigh_velocity_m_s', .false., points%modulus_gpa, error)
      call read_column(table, 'sd_m_s', .false., points%sd_gpa, error)
      call read_column(table, 'orientation_sd_deg', .true., points%orientation_sd_deg, error)
      if (.not. allocated(error)) call find_column(table, 'grain', points%named_by, error)
      if (allocated(error)) return
      call read_groups(points)
      do i = 1, merge(points%n, 0, column > 0)
         kind = findloc(wave_names, lower(table%cell(column, i)), dim=1) - 1
         associate (along => points%propagation_deg(i))
            if (kind < 0) then
               call table%refuse(column, i, ' is no wave; allowed '//join(wave_names, ', '), error)
            else if (kind == 0 .and. .not. abs(along) <= huge(along)) then
               call table%refuse(column, i, ': propagation_deg is missing, the direction of the wave in the surface', error)
            else if (kind > 0) then
               if (.not. abs(along) <= huge(along)) kind = kind + 3
               along = 720.0_wp*kind + merge(modulo(along, 360.0_wp), 0.0_wp, kind <= 3)
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine read_velocities

   !> Let rows of speeds follow the moduli, with groups of their own, in place of those that are there; without moduli they are all.
   subroutine append_velocities(points, velocities, kept)
      type(points_type), allocatable, intent(inout) :: points
      type(points_type), intent(in) :: velocities
      !> Which of them, all without it; the others are counted.
      logical, intent(in), optional :: kept(:)
      integer, allocatable :: rows(:)
      integer :: i, n

      rows = [(i, i=1, velocities%n)]
      if (present(kept)) rows = pack(rows, kept)
      if (.not. allocated(points)) then
         points = velocities
         points%n = 0
         points%modulus_kind = 'indentation_modulus'
      end if
      if (.not. allocated(points%wave_names)) points%n_moduli = points%n
      n = points%n_moduli
      points%n = n + size(rows)
      points%omitted = velocities%n - size(rows)
      points%euler_deg = reshape([points%euler_deg(:, :n), velocities%euler_deg(:, rows)], [3, points%n])
      points%modulus_gpa = [points%modulus_gpa(:n), velocities%modulus_gpa(rows)]
      points%sd_gpa = [points%sd_gpa(:n), velocities%sd_gpa(rows)]
      points%orientation_sd_deg = [points%orientation_sd_deg(:n), velocities%orientation_sd_deg(rows)]
      points%group = [points%group(:n), maxval([0, points%group(:n)]) + velocities%group(rows)]
      points%row = [points%row(:n), velocities%row(rows)]
      points%propagation_deg = [(nan, i=1, n), velocities%propagation_deg(rows)]
      if (allocated(points%wave_names)) deallocate (points%wave_names)
      allocate (points%wave_names(size(rows)))
      do i = 1, size(rows)
         points%wave_names(i) = velocities%name(rows(i))
      end do
   end subroutine append_velocities
end module velocity_tables
