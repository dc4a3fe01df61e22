!> The table of measured speeds of waves, beside or instead of moduli: a row of each follows the rows of the moduli.
module velocity_tables
   use errors, only: error_type
   use kinds, only: nan, wp
   use point_tables, only: points_type, read_angles, read_column, read_groups
   use table_columns, only: find_column
   use tables, only: table_type
   implicit none
   private
   public :: read_velocities, append_velocities

contains

   !> Orientations, directions of propagation, and speeds with their sds, m/s.
   subroutine read_velocities(table, radians, points, error)
      type(table_type), intent(in) :: table
      !> The unit of the Euler angles in the table.
      logical, intent(in) :: radians
      !> The speeds stand in place of the moduli.
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      points%table = table
      call read_angles(points, radians, error)
      call read_column(table, 'propagation_deg', .false., points%propagation_deg, error)
      call read_column(table, 'rayleigh_velocity_m_s', .false., points%modulus_gpa, error)
      call read_column(table, 'sd_m_s', .false., points%sd_gpa, error)
      call read_column(table, 'orientation_sd_deg', .true., points%orientation_sd_deg, error)
      if (.not. allocated(error)) call find_column(table, 'grain', points%named_by, error)
      if (.not. allocated(error)) call read_groups(points)
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
