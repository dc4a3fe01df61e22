!> Measured speeds of waves, in addition to moduli or alone. Among the measurements they follow the
!> moduli.
module velocity_tables
   use errors, only: error_type
   use kinds, only: wp
   use observables, only: path_names, path_type, surface_path
   use point_tables, only: points_type, read_angles, read_groups
   use table_columns, only: find_column, read_column
   use tables, only: longest_name, table_type
   use text, only: join, lower
   implicit none
   private
   public :: read_velocities, append_velocities

contains

   !> Read orientations, kinds and directions of waves, and speeds with their sds, m/s.
   subroutine read_velocities(table, radians, points, error)
      type(table_type), intent(in) :: table
      !> The unit of the Euler angles in the table.
      logical, intent(in) :: radians
      !> With the speeds in place of moduli.
      type(points_type), intent(out) :: points
      !> Nothing is read after an error.
      type(error_type), allocatable, intent(inout) :: error
      real(wp), allocatable :: along(:)
      logical :: has_direction
      integer :: column, i

      column = table%find('wave')
      points%table = table
      call read_angles(points, radians, error)
      call read_column(table, 'propagation_deg', column > 0, along, error)
      call read_column(table, 'rayleigh_velocity_m_s', .false., points%modulus_gpa, error)
      call read_column(table, 'sd_m_s', .false., points%sd_gpa, error)
      call read_column(table, 'orientation_sd_deg', .true., points%orientation_sd_deg, error)
      call find_column(table, 'grain', points%named_by, error, .false.)
      if (allocated(error)) return
      call read_groups(points)
      points%paths = [(path_type(surface_path, along(i)), i=1, points%n)]
      do i = 1, merge(points%n, 0, column > 0)
         associate (path => points%paths(i))
            path%kind = findloc(path_names, lower(table%cell(column, i)), dim=1)
            has_direction = abs(along(i)) <= huge(1.0_wp)
            if (.not. path%is_speed()) then
               call table%refuse(column, i, ' is no wave; allowed '//join(path_names, ', '), error)
            else if (path%kind == surface_path .and. .not. has_direction) then
               call table%refuse(column, i, &
                  & ': propagation_deg is missing, the direction of the wave in the surface', error)
            else if (.not. has_direction) then
               path = path_type(path%kind, inclination_deg=90.0_wp)
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine read_velocities

   !> Append speeds to the moduli, in groups of their own; they replace those that are there.
   !> Without moduli they are all points.
   subroutine append_velocities(points, velocities, kept)
      type(points_type), allocatable, intent(inout) :: points
      type(points_type), intent(in) :: velocities
      !> The speeds to append, all by default; the others are counted.
      logical, intent(in), optional :: kept(:)
      integer, allocatable :: rows(:)
      integer :: i, n

      rows = [(i, i=1, velocities%n)]
      if (present(kept)) rows = pack(rows, kept)
      if (.not. allocated(points)) then
         points = velocities
         points%modulus_kind = 'indentation_modulus'
      end if
      n = count(.not. points%paths%is_speed())
      points%names = [character(len=longest_name) :: (points%name(i), i=1, n), &
         & (velocities%name(rows(i)), i=1, size(rows))]
      points%n = n + size(rows)
      points%omitted = velocities%n - size(rows)
      points%euler_deg = reshape([points%euler_deg(:, :n), velocities%euler_deg(:, rows)], &
         & [3, points%n])
      points%modulus_gpa = [points%modulus_gpa(:n), velocities%modulus_gpa(rows)]
      points%sd_gpa = [points%sd_gpa(:n), velocities%sd_gpa(rows)]
      points%orientation_sd_deg = [points%orientation_sd_deg(:n), &
         & velocities%orientation_sd_deg(rows)]
      points%group = [points%group(:n), maxval([0, points%group(:n)]) + velocities%group(rows)]
      points%row = [points%row(:n), velocities%row(rows)]
      points%paths = [points%paths(:n), velocities%paths(rows)]
   end subroutine append_velocities
end module velocity_tables
