!> Tables that a namelist names: crystals with orientations, measurements, candidates. Columns are
!> found by their names.
module point_tables
   use files, only: hash_of
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: check_stiffness, rotation_matrix
   use errors, only: error_type, prefix_error, refuse
   use kinds, only: degree, i8, nan, pi, wp
   use observables, only: path_type, surface_path
   use statistics, only: number_equal
   use settings_schema, only: measurements_settings_type
   use direction_columns, only: read_directions
   use table_columns, only: angle_columns, column_type, find_column, find_columns, find_modulus, &
      & read_column, read_numbers
   use tables, only: longest_name, read_table, table_type
   use text, only: join, lower, to_text
   implicit none
   private
   public :: points_type, read_crystals, read_measurements, split_references, &
      & read_orientations, first_rows, angles_look_like_radians, read_angles, read_groups

   !> Points, one for each row of a table. Values that the table does not have are NaN.
   type :: points_type
      integer :: n = 0
      !> The table as it was written.
      type(table_type) :: table
      !> Crystal classes of the rows, and the index of the class of each row, (n). Measurements have
      !> none.
      type(crystal_class_type), allocatable :: classes(:)
      integer, allocatable :: class(:)
      !> Constants in the order of the class, padded with NaN, GPa, (21, n); stiffness in the
      !> crystal frame, GPa, (6, 6, n).
      real(wp), allocatable :: constants(:, :), stiffness(:, :, :)
      !> Bunge-Euler angles, degrees, (3, n); whether the table has them, or only the indented
      !> directions.
      real(wp), allocatable :: euler_deg(:, :)
      logical :: has_angles = .true.
      !> Directions of waves, whose speeds follow the moduli of measurements, (n); number of waves
      !> that were left out.
      type(path_type), allocatable :: paths(:)
      integer :: omitted = 0
      !> Names of points from several tables, (n).
      character(len=longest_name), allocatable :: names(:)
      !> Moduli and their sds, GPa, or speeds and their sds, m/s, (n).
      real(wp), allocatable :: modulus_gpa(:), sd_gpa(:)
      !> Kind of modulus that was measured.
      character(len=:), allocatable :: modulus_kind
      !> Measured grains: sd of the tilt of the indented direction per component, degrees; depth and
      !> contact radius of the indentation, and radius of the grain, um; number of the group, from
      !> 1, (n).
      real(wp), allocatable :: orientation_sd_deg(:), depth_um(:), contact_radius_um(:), &
         & grain_radius_um(:)
      integer, allocatable :: group(:)
      !> Column of the names, 0 if there is none; the first row of the table for each point, (n);
      !> and the point of each row.
      integer :: named_by = 0
      integer, allocatable :: row(:), of_row(:)
      !> Number of tests that are combined in each point, and their chi-square about the mean, (n).
      integer, allocatable :: tests(:)
      real(wp), allocatable :: chi_square(:)
   contains
      procedure :: name, directions
   end type points_type

   !> Largest plausible stiffness, GPa.
   real(wp), parameter :: stiffness_most = 5000.0_wp
   !> What the columns of elastic constants may have.
   type(column_type), parameter :: constant_column = column_type('', &
      & [-stiffness_most, stiffness_most], ' GPa', ' looks like MPa; allowed up to 5000.0 GPa')

contains

   !> Read crystals and orientations.
   subroutine read_crystals(path, default_class, points, error)
      character(len=*), intent(in) :: path
      !> Class of the rows that do not state one.
      type(crystal_class_type), intent(in) :: default_class
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      !> The class whose constants are all entries, and their columns.
      type(crystal_class_type) :: general
      integer :: column(21), along_column, i
      real(wp), allocatable :: along(:)

      call read_table(path, points%table, error)
      call read_angles(points, .false., error)
      if (.not. allocated(error)) call read_constants()
      call read_column(points%table, trim(merge('modulus_gpa            ', &
         & 'indentation_modulus_gpa', points%table%find('modulus_gpa') > 0)), .true., &
         & points%modulus_gpa, error)
      call find_column(points%table, 'propagation_deg', along_column, error, .false.)
      call read_column(points%table, 'propagation_deg', along_column == 0, along, error)
      if (allocated(error) .or. along_column == 0) return
      points%paths = [(path_type(surface_path, along(i)), i=1, points%n)]

   contains

      !> Read the independent constants of each row, and set the stiffness.
      subroutine read_constants()
         real(wp), allocatable :: values(:)

         call new_crystal_class(general_class, general, error)
         if (allocated(error)) return
         allocate (points%constants(21, points%n), points%stiffness(6, 6, points%n))
         do i = 1, 21
            call find_column(points%table, general%constants(i), column(i), error, .false.)
            call read_numbers(points%table, column(i), constant_column, .true., values, error)
            points%constants(i, :) = values
         end do
         if (.not. allocated(error)) call read_classes()
         do i = 1, points%n
            if (allocated(error)) return
            call take_constants()
         end do
      end subroutine read_constants

      !> Take the constants of the class from the entries of row i, and set the stiffness.
      subroutine take_constants()
         real(wp) :: entries(21), implied(21), unit, beyond
         integer :: j, k

         entries = points%constants(:, i)
         points%constants(:, i) = nan
         unit = 0.0_wp
         associate (class => points%classes(points%class(i)), table => points%table)
            do k = 1, class%n_constants
               j = findloc(general%constants, class%constants(k), dim=1)
               if (column(j) == 0) then
                  call refuse(error, 'the column '//class%constants(k)//' is missing; a ' &
                     & //class%name//' crystal has '//join(class%constants, ', '))
               else if (.not. abs(entries(j)) <= stiffness_most) then
                  call table%number(column(j), i, entries(j), error)
               end if
               if (allocated(error)) return
               points%constants(k, i) = entries(j)
               unit = max(unit, last_digit(table%cell(column(j), i)))
            end do
            points%stiffness(:, :, i) = class%stiffness(points%constants(:class%n_constants, i))
            ! The cell of a dependent constant is empty, or has the value that follows by symmetry
            ! from the others, within the rounding of all of them.
            implied = general%constants_of(points%stiffness(:, :, i))
            do j = 1, 21
               beyond = abs(entries(j) - implied(j)) - 1.0e-3_wp*(1.0_wp + abs(implied(j)))
               if (.not. beyond > unit) cycle
               if (beyond <= last_digit(table%cell(column(j), i))) cycle
               call table%refuse(column(j), i, ' GPa does not apply to a '//class%name &
                  & //' crystal, whose '//general%constants(j)//' is '//to_text(implied(j)) &
                  & //' GPa; leave the cell empty', error)
               return
            end do
         end associate
         call check_stiffness(points%stiffness(:, :, i), error)
         call prefix_error(error, 'line '//to_text(points%table%line(i))//': ')
      end subroutine take_constants

      !> A unit of the last decimal of a number.
      pure real(wp) function last_digit(cell)
         character(len=*), intent(in) :: cell

         last_digit = 10.0_wp**merge(index(cell, '.') - len(cell), 0, index(cell, '.') > 0)
      end function last_digit

      !> Set the class of each row, from the column `symmetry` if there is one.
      subroutine read_classes()
         type(crystal_class_type) :: class
         integer, allocatable :: first(:)
         character(len=:), allocatable :: cell
         integer :: named, j

         named = points%table%find('symmetry')
         first = first_rows(points%table, named)
         allocate (points%classes(0), points%class(points%n))
         do i = 1, points%n
            if (first(i) < i) then
               points%class(i) = points%class(first(i))
               cycle
            end if
            cell = points%table%cell(named, i)
            class = default_class
            ! A table of all 21 constants without a class has triclinic crystals.
            if (all(column > 0) .and. named == 0) class = general
            if (len(cell) > 0) then
               call new_crystal_class(cell, class, error)
               call prefix_error(error, points%table%place(named, i))
               if (allocated(error)) return
            end if
            if (class%n_constants == 0) then
               call refuse(error, 'the class of the crystals is missing; state &problem ' &
                  & //'symmetry, or add a column symmetry')
               return
            end if
            j = findloc([(points%classes(j)%name == class%name, j=1, size(points%classes))], &
               & .true., dim=1)
            if (j == 0) points%classes = [points%classes, class]
            points%class(i) = merge(size(points%classes), j, j == 0)
         end do
      end subroutine read_classes
   end subroutine read_crystals

   !> The name of point `i`, or its number.
   function name(self, i)
      class(points_type), intent(in) :: self
      !> 1, 2, ..
      integer, intent(in) :: i
      character(len=:), allocatable :: name

      if (allocated(self%names)) then
         name = trim(self%names(i))
      else if (self%named_by > 0) then
         name = self%table%cell(self%named_by, self%row(i))
      else
         name = to_text(i)
      end if
   end function name

   !> The indented direction of each point in crystal axes, (3, n).
   pure function directions(self)
      class(points_type), intent(in) :: self
      real(wp) :: directions(3, self%n), g(3, 3)
      integer :: i

      do i = 1, self%n
         g = rotation_matrix(self%euler_deg(:, i)*degree)
         directions(:, i) = g(:, 3)
      end do
   end function directions

   !> Read orientations and moduli with the settings of `&measurements`.
   subroutine read_measurements(table, radians, settings, crystal, parameters, points, error)
      type(table_type), intent(in) :: table
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(measurements_settings_type), intent(in) :: settings
      !> Class of the grains.
      type(crystal_class_type), intent(in) :: crystal
      !> Parameters of the unit cell, see `new_lattice`; may be unallocated.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      !> Ten tests for each of the grains that Step 2 accepts.
      integer, parameter :: most_rows = 200000, most_lines = 10**9
      character(len=:), allocatable :: name
      real(wp), allocatable :: line(:)

      if (table%rows > most_rows) then
         call refuse(error, to_text(table%rows)//' rows; allowed up to '//to_text(most_rows))
         return
      end if
      points%table = table
      ! The numbers of the lines are those in the file of the laboratory, if the table has them.
      call read_column(table, 'row', table%find('row') == 0, line, error)
      where (line >= 0.0_wp .and. line <= most_lines) points%table%line = nint(line)
      if (settings%orientations == 'unknown') then
         call set_size(points)
         points%euler_deg = 0.0_wp
         points%has_angles = .false.
      else if (.not. allocated(error)) then
         call read_orientations(points, radians, crystal, parameters, error)
      end if
      if (allocated(error)) return
      call find_modulus(points%table, settings%modulus_kind, name, points%modulus_kind, error)
      if (allocated(error)) return
      call read_column(points%table, name, .false., points%modulus_gpa, error)
      if (table%find('sd_gpa') == 0 .and. settings%scale /= 'inferred') then
         call refuse(error, 'the column sd_gpa is missing; it may be absent only with scale = ' &
            & //'''inferred''; the columns are '//table%names())
      end if
      call read_column(points%table, 'sd_gpa', table%find('sd_gpa') == 0, points%sd_gpa, error)
      call read_column(points%table, 'orientation_sd_deg', .true., points%orientation_sd_deg, error)
      call read_column(points%table, 'depth_um', .true., points%depth_um, error)
      call read_column(points%table, 'contact_radius_um', .true., points%contact_radius_um, error)
      call add_zero_error()
      call read_column(points%table, 'grain_radius_um', .true., points%grain_radius_um, error)
      if (.not. allocated(error)) call read_groups(points)

   contains

      !> Add the error of the modulus by an uncertain zero of the depth to the sds; the modulus is
      !> proportional to P/(sqrt(R) h^1.5).
      subroutine add_zero_error()
         real(wp), parameter :: power = 1.5_wp
         real(wp), allocatable :: zero_sd_nm(:)
         integer :: i

         call read_column(points%table, 'zero_sd_nm', .true., zero_sd_nm, error)
         if (allocated(error)) return
         zero_sd_nm = merge(zero_sd_nm, settings%zero_sd_nm, zero_sd_nm >= 0.0_wp)
         i = findloc(zero_sd_nm > 0.0_wp &
            & .and. .not. (points%depth_um > 0.0_wp .and. points%sd_gpa > 0.0_wp), .true., dim=1)
         if (i > 0) then
            call refuse(error, &
               & 'line '//to_text(points%table%line(i))//': zero_sd_nm = '//to_text(zero_sd_nm(i)) &
               & //' nm needs the depth of the test (column depth_um) and its sd_gpa')
            return
         end if
         where (zero_sd_nm > 0.0_wp) points%sd_gpa = sqrt(points%sd_gpa**2 &
            & + (power*1.0e-3_wp*zero_sd_nm/points%depth_um*points%modulus_gpa)**2)
      end subroutine add_zero_error
   end subroutine read_measurements

   !> Read the rows of a table that name a reference, and leave the others in the table.
   subroutine split_references(table, radians, settings, crystal, parameters, references, error)
      type(table_type), intent(inout) :: table
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(measurements_settings_type), intent(in) :: settings
      type(crystal_class_type), intent(in) :: crystal
      !> See `read_measurements`.
      real(wp), allocatable, intent(in) :: parameters(:)
      !> Unallocated if there are none.
      type(points_type), allocatable, intent(out) :: references
      type(error_type), allocatable, intent(out) :: error
      logical :: is_reference(table%rows)
      integer :: column, i

      column = table%find('reference')
      is_reference = [(.not. table%is_empty(column, i), i=1, table%rows)]
      if (.not. any(is_reference) .or. all(is_reference)) return
      allocate (references)
      call read_measurements(table%rows_of(is_reference), radians, settings, crystal, parameters, &
         & references, error)
      references%named_by = column
      table = table%rows_of(.not. is_reference)
   end subroutine split_references

   !> Set the angles of each row, which follow from the direction if the table states that.
   subroutine read_orientations(points, radians, crystal, parameters, error)
      !> With their table.
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(crystal_class_type), intent(in) :: crystal
      !> See `read_measurements`.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: angles(:)
      real(wp), allocatable :: euler_deg(:, :)

      call find_columns(points%table, join(angle_columns%name, ', '), 0, angles, error)
      if (allocated(error)) return
      call read_directions(points%table, all(angles > 0), crystal, parameters, euler_deg, error)
      if (allocated(error)) return
      if (allocated(euler_deg)) then
         call set_size(points)
         points%has_angles = .false.
         points%euler_deg = euler_deg
         return
      end if
      call read_angles(points, radians, error)
      if (allocated(error) .and. all(angles == 0)) then
         error%message = error%message//'; instead of angles q0, q1, q2, q3, or u, v, w, or ' &
            & //'h, k, l; if no orientation is known state orientations = ''unknown'''
      end if
   end subroutine read_orientations

   !> Make a point for each row, with NaN for the values that are not read yet.
   subroutine set_size(points)
      type(points_type), intent(inout) :: points
      integer :: i

      points%n = points%table%rows
      points%row = [(i, i=1, points%n)]
      points%of_row = points%row
      allocate (points%euler_deg(3, points%n), points%paths(points%n))
      allocate (points%modulus_gpa(points%n), points%sd_gpa(points%n), source=nan)
   end subroutine set_size

   !> Read the angles of each row. Nothing is done after an error.
   subroutine read_angles(points, radians, error)
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(error_type), allocatable, intent(inout) :: error
      ! In radians half a turn may be rounded up.
      real(wp), parameter :: rounding = 1.0e-4_wp
      type(column_type) :: known
      real(wp), allocatable :: values(:)
      real(wp) :: unit
      integer :: column, j

      call set_size(points)
      unit = merge(degree, 1.0_wp, radians)
      do j = 1, 3
         known = angle_columns(j)
         call find_column(points%table, trim(known%name), column, error, .true.)
         if (allocated(error)) return
         if (radians) then
            known = column_type('', known%allowed*degree + [0.0_wp, rounding], ' radians')
         else if (index(lower(points%table%name(column)), 'rad') > 0) then
            call refuse(error, 'column '//points%table%name(column) &
               & //' is in radians; degrees are needed, or &measurements angles = ''radians''')
            return
         end if
         call read_numbers(points%table, column, known, .false., values, error)
         if (allocated(error)) return
         points%euler_deg(j, :) = min(values/unit, angle_columns(j)%allowed(2))
      end do
   end subroutine read_angles

   !> Number the groups in the order in which their names occur.
   subroutine read_groups(points)
      type(points_type), intent(inout) :: points
      integer, allocatable :: first(:)
      integer :: last, i

      first = first_rows(points%table, points%table%find('group'))
      allocate (points%group(points%n))
      last = 0
      do i = 1, points%n
         if (first(i) == i) last = last + 1
         points%group(i) = last
         if (first(i) < i) points%group(i) = points%group(first(i))
      end do
   end subroutine read_groups

   !> For each row the first row with the same cell in a `column`; row 1 if the column is 0.
   function first_rows(table, column) result(first)
      type(table_type), intent(in) :: table
      integer, intent(in) :: column
      integer, allocatable :: first(:)
      real(wp), allocatable :: key(:, :)
      integer(i8) :: hash
      integer :: i

      allocate (key(2, table%rows), source=0.0_wp)
      do i = 1, merge(table%rows, 0, column > 0)
         hash = hash_of(table%cell(column, i))
         key(:, i) = real([ibits(hash, 0, 32), ibits(hash, 32, 32)], wp)
      end do
      first = number_equal(key)
   end function first_rows

   !> Whether no angle exceeds a full turn in radians, and not all are zero.
   pure logical function angles_look_like_radians(points)
      type(points_type), intent(in) :: points

      angles_look_like_radians = points%has_angles .and. any(abs(points%euler_deg) > 0.0_wp) &
         & .and. all(abs(points%euler_deg) <= 2.0_wp*pi + 1.0e-6_wp)
   end function angles_look_like_radians
end module point_tables
