!> The CSV tables that a problem names: crystals with orientations, measurements, candidates. Columns go by name; unknown
!> ones are carried through.
module point_tables
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use kinds, only: degree, pi, wp
   use tables, only: parse_table, read_table, table_type
   use text, only: join, lower, to_text
   implicit none
   private
   public :: points_type, read_crystals, read_measurements, measurements_of_text, angles_look_like_radians

   !> One row a point. What a table has not is NaN.
   type :: points_type
      integer :: n = 0
      !> The cells as written.
      type(table_type) :: table
      !> The crystal classes that rows have, and the number of each row's, (n); none in measurements.
      type(crystal_class_type), allocatable :: classes(:)
      integer, allocatable :: class(:)
      !> In the order of the class, padded with NaN, GPa, (21, n).
      real(wp), allocatable :: constants(:, :)
      !> Crystal frame, GPa, (6, 6, n).
      real(wp), allocatable :: stiffness(:, :, :)
      !> Bunge-Euler angles, degrees, (3, n).
      real(wp), allocatable :: euler_deg(:, :)
      !> Moduli and their sds, GPa, (n).
      real(wp), allocatable :: modulus_gpa(:), sd_gpa(:)
      !> Of a measured grain: sd of the tilt of the indented direction per component, degrees; depth of the indentation and radius of the
      !> grain, um; and its group, 1, 2, .., (n).
      real(wp), allocatable :: orientation_sd_deg(:), depth_um(:), grain_radius_um(:)
      integer, allocatable :: group(:)
   end type points_type

   character(len=*), parameter :: angle_names(3) = [character(len=8) :: 'phi1_deg', 'Phi_deg', 'phi2_deg']
   !> A column, other names that it may have without their unit, and the words for its unit, each between blanks.
   type :: column_type
      character(len=12) :: name
      character(len=60) :: others
      character(len=30) :: units
   end type column_type
   type(column_type), parameter :: known_columns(*) = [ &
      & column_type('phi1_deg', ' phi1 phi_1 euler1 euler_1 ', ' deg degrees degree ° rad radians '), &
      & column_type('Phi_deg', ' phi euler2 euler_2 ', ' deg degrees degree ° rad radians '), &
      & column_type('phi2_deg', ' phi2 phi_2 euler3 euler_3 ', ' deg degrees degree ° rad radians '), &
      & column_type('modulus_gpa', ' modulus ', ' gpa '), &
      & column_type('sd_gpa', ' sd std stdev error standard_deviation ', ' gpa ')]
   !> Of depths and grains, um.
   real(wp), parameter :: lengths_allowed(2) = [1.0e-6_wp, 1.0e6_wp]
   !> What a modulus of a metal, and a stiffness, can be, GPa.
   real(wp), parameter :: modulus_least = 1.0_wp, modulus_most = 2000.0_wp, stiffness_most = 5000.0_wp

contains

   !> Crystals and orientations. `prefix` begins the message of a refusal.
   subroutine read_crystals(path, prefix, default_class, points, error)
      character(len=*), intent(in) :: path, prefix
      !> Of the rows that do not say theirs.
      type(crystal_class_type), intent(in) :: default_class
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      call read_table(path, points%table, error)
      if (.not. allocated(error)) call read_angles(points, .false., error)
      if (.not. allocated(error)) call read_constants(points, default_class, error)
      if (.not. allocated(error)) call read_moduli(points, .false., error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_crystals

   !> Orientations with moduli; the column of the sds may be absent if `sd_optional`. Messages begin with `prefix`.
   subroutine read_measurements(path, prefix, sd_optional, radians, points, error)
      character(len=*), intent(in) :: path, prefix
      !> `radians`: the unit of the angles in the file.
      logical, intent(in) :: sd_optional, radians
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      call read_table(path, points%table, error)
      if (.not. allocated(error)) call read_measured(points, sd_optional, radians, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_measurements

   !> The same from a text that is no file: its rows are counted from 1, without the header.
   subroutine measurements_of_text(page, prefix, sd_optional, radians, points, error)
      !> Header and rows.
      character(len=*), intent(in) :: page
      !> With which messages begin.
      character(len=*), intent(in) :: prefix
      !> The column of the sds may be absent; the unit of the angles.
      logical, intent(in) :: sd_optional, radians
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call parse_table(page, points%table, error)
      if (.not. allocated(error)) then
         points%table%line = [(i, i=1, points%table%rows)]
         call read_measured(points, sd_optional, radians, error)
      end if
      if (allocated(error)) error%message = prefix//error%message
   end subroutine measurements_of_text

   subroutine read_measured(points, sd_optional, radians, error)
      type(points_type), intent(inout) :: points
      logical, intent(in) :: sd_optional, radians
      type(error_type), allocatable, intent(out) :: error

      call read_angles(points, radians, error)
      if (.not. allocated(error)) call read_moduli(points, .true., error)
      if (.not. allocated(error)) call read_sds(points, sd_optional, error)
      if (.not. allocated(error)) call read_optional(points, 'orientation_sd_deg', [0.0_wp, 20.0_wp], ' degrees', &
         & points%orientation_sd_deg, error)
      if (.not. allocated(error)) call read_optional(points, 'depth_um', lengths_allowed, ' um', points%depth_um, error)
      if (.not. allocated(error)) call read_optional(points, 'grain_radius_um', lengths_allowed, ' um', points%grain_radius_um, &
         & error)
      if (.not. allocated(error)) call read_groups(points)
   end subroutine read_measured

   !> The angles of every row; what comes later is NaN.
   subroutine read_angles(points, radians, error)
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: largest_turn = 36000.0_wp, rounding = 1.0e-4_wp
      real(wp) :: nan, most, unit
      character(len=:), allocatable :: unit_name
      integer :: column(3), i, j

      points%n = points%table%rows
      nan = not_a_number()
      unit = 1.0_wp
      unit_name = ' degrees'
      if (radians) then
         unit = degree
         unit_name = ' radians'
      end if
      allocate (points%euler_deg(3, points%n))
      allocate (points%modulus_gpa(points%n), points%sd_gpa(points%n), source=nan)
      do j = 1, 3
         call need_column(points%table, trim(angle_names(j)), column(j), error)
         if (allocated(error)) return
      end do
      do i = 1, points%n
         do j = 1, 3
            call points%table%number(column(j), i, points%euler_deg(j, i), error)
            if (allocated(error)) return
            points%euler_deg(j, i) = points%euler_deg(j, i)/unit
            most = merge(180.0_wp, largest_turn, j == 2)
            ! Half a turn in radians is a rounded number.
            if (radians .and. j == 2 .and. points%euler_deg(j, i) < most + rounding/unit) then
               points%euler_deg(j, i) = min(points%euler_deg(j, i), most)
            end if
            if (abs(points%euler_deg(j, i)) > most .or. (j == 2 .and. points%euler_deg(j, i) < 0.0_wp)) then
               call refuse_cell(points%table, column(j), i, unit_name//'; allowed ' &
                  & //to_text(merge(0.0_wp, -largest_turn, j == 2)*unit)//' to '//to_text(most*unit), error)
               return
            end if
         end do
      end do
   end subroutine read_angles

   !> The independent constants of each row, and the stiffness.
   subroutine read_constants(points, default_class, error)
      type(points_type), intent(inout) :: points
      type(crystal_class_type), intent(in) :: default_class
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: general, usual, class
      character(len=3), allocatable :: names(:)
      integer :: column(21), symmetry_column, i, j
      integer, allocatable :: others(:)
      logical :: same
      character(len=:), allocatable :: cell

      allocate (points%constants(21, points%n), source=not_a_number())
      allocate (points%stiffness(6, 6, points%n), points%class(points%n), points%classes(0))
      call new_crystal_class(general_class, general, error)
      if (allocated(error)) return
      names = general%constants
      do j = 1, 21
         column(j) = points%table%find(names(j))
      end do
      symmetry_column = points%table%find('symmetry')
      ! All 21 columns and no word on the symmetry: the crystals are given whole.
      usual = default_class
      if (all(column > 0) .and. symmetry_column == 0) usual = general
      points%class = 0
      do i = 1, points%n
         cell = ''
         if (symmetry_column > 0) cell = points%table%cell(symmetry_column, i)
         if (i > 1) then
            same = symmetry_column == 0
            if (.not. same) same = cell == points%table%cell(symmetry_column, i - 1)
            if (same) points%class(i) = points%class(i - 1)
         end if
         if (points%class(i) == 0) then
            class = usual
            if (len(cell) > 0) call new_crystal_class(cell, class, error)
            if (allocated(error)) then
               error%message = 'line '//to_text(points%table%line(i))//', column symmetry: '//error%message
               return
            end if
            do j = 1, size(points%classes)
               if (points%classes(j)%name == class%name) exit
            end do
            if (j > size(points%classes)) points%classes = [points%classes, class]
            points%class(i) = j
         end if
         same = i > 1
         if (same) same = points%class(i) == points%class(i - 1)
         if (.not. same) then
            associate (own => points%classes(points%class(i))%constants)
               others = pack([(j, j=1, 21)], column > 0 .and. [(all(own /= names(j)), j=1, 21)])
            end associate
         end if
         call read_row(points, i, names, column, others, error)
         if (allocated(error)) return
      end do
   end subroutine read_constants

   !> The crystal of row i: its constants, and what else the row says about the stiffness.
   subroutine read_row(points, i, names, column, others, error)
      type(points_type), intent(inout) :: points
      integer, intent(in) :: i
      !> All 21 entries, and their columns or 0.
      character(len=3), intent(in) :: names(21)
      integer, intent(in) :: column(21)
      !> Of the entries those that have a column but are no constants of the class.
      integer, intent(in) :: others(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: value, implied(21)
      integer :: j, k, n

      associate (class => points%classes(points%class(i)))
         do k = 1, class%n_constants
            do j = 1, 21
               if (names(j) == class%constants(k)) exit
            end do
            if (column(j) == 0) then
               call raise(error, 'the column '//names(j)//' is missing; a '//class%name//' crystal has ' &
                  & //join(class%constants, ', '), exit_bad_input)
               return
            end if
            call points%table%number(column(j), i, points%constants(k, i), error)
            if (allocated(error)) return
            if (abs(points%constants(k, i)) > stiffness_most) then
               call refuse_cell(points%table, column(j), i, ' GPa looks like MPa; allowed up to ' &
                  & //to_text(stiffness_most)//' GPa', error)
               return
            end if
         end do
         points%stiffness(:, :, i) = class%stiffness(points%constants(:class%n_constants, i))
         ! A constant that does not apply is empty, or what the symmetry makes it.
         if (size(others) > 0) implied = [(points%stiffness(j, j:, i), j=1, 6)]
         do n = 1, size(others)
            j = others(n)
            if (len(points%table%cell(column(j), i)) == 0) cycle
            call points%table%number(column(j), i, value, error)
            if (allocated(error)) return
            if (abs(value - implied(j)) > 1.0e-3_wp*abs(implied(j)) + 1.0e-3_wp) then
               call refuse_cell(points%table, column(j), i, ' GPa does not apply to a '//class%name//' crystal, whose ' &
                  & //names(j)//' is '//to_text(implied(j))//' GPa; leave the cell empty', error)
               return
            end if
         end do
      end associate
      call check_stiffness(points%stiffness(:, :, i), error)
      if (allocated(error)) error%message = 'line '//to_text(points%table%line(i))//': '//error%message
   end subroutine read_row

   subroutine read_moduli(points, required, error)
      type(points_type), intent(inout) :: points
      logical, intent(in) :: required
      type(error_type), allocatable, intent(out) :: error
      integer :: column, i

      call find_column(points%table, 'modulus_gpa', column, error)
      if (allocated(error)) return
      if (column == 0 .and. .not. required) column = points%table%find('indentation_modulus_gpa')
      if (column == 0) then
         if (required) call need_column(points%table, 'modulus_gpa', column, error)
         return
      end if
      do i = 1, points%n
         if (.not. required .and. len(points%table%cell(column, i)) == 0) cycle
         call points%table%number(column, i, points%modulus_gpa(i), error)
         if (allocated(error)) return
         associate (value => points%modulus_gpa(i))
            if (value > modulus_most) then
               call refuse_cell(points%table, column, i, ' GPa looks like MPa; allowed ' &
                  & //to_text(modulus_least)//' to '//to_text(modulus_most)//' GPa', error)
            else if (value < modulus_least) then
               call refuse_cell(points%table, column, i, ' GPa is no modulus of a metal; allowed ' &
                  & //to_text(modulus_least)//' to '//to_text(modulus_most)//' GPa', error)
            end if
         end associate
         if (allocated(error)) return
      end do
   end subroutine read_moduli

   subroutine read_sds(points, optional_column, error)
      type(points_type), intent(inout) :: points
      logical, intent(in) :: optional_column
      type(error_type), allocatable, intent(out) :: error
      integer :: column, i

      call find_column(points%table, 'sd_gpa', column, error)
      if (allocated(error)) return
      if (column == 0) then
         if (.not. optional_column) call raise(error, 'the column sd_gpa is missing; it may be absent only with ' &
            & //'scale = ''inferred''; the columns are '//column_list(points%table), exit_bad_input)
         return
      end if
      do i = 1, points%n
         call points%table%number(column, i, points%sd_gpa(i), error)
         if (allocated(error)) return
         if (points%sd_gpa(i) <= 0.0_wp .or. points%sd_gpa(i) > modulus_most) then
            call refuse_cell(points%table, column, i, ' GPa; a standard deviation is above 0' &
               & //', up to '//to_text(modulus_most)//' GPa', error)
            return
         end if
      end do
   end subroutine read_sds

   !> A column that may be absent, and whose cells may be empty: NaN there.
   subroutine read_optional(points, name, allowed, unit, values, error)
      type(points_type), intent(in) :: points
      character(len=*), intent(in) :: name
      !> The least and the greatest.
      real(wp), intent(in) :: allowed(2)
      !> After a blank.
      character(len=*), intent(in) :: unit
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: column, i

      allocate (values(points%n), source=not_a_number())
      column = points%table%find(name)
      if (column == 0) return
      do i = 1, points%n
         if (len_trim(points%table%cell(column, i)) == 0) cycle
         call points%table%number(column, i, values(i), error)
         if (allocated(error)) return
         if (values(i) >= allowed(1) .and. values(i) <= allowed(2)) cycle
         call refuse_cell(points%table, column, i, unit//'; allowed '//to_text(allowed(1))//' to '//to_text(allowed(2)), error)
         return
      end do
   end subroutine read_optional

   !> Groups are numbered in the order in which their names appear.
   subroutine read_groups(points)
      type(points_type), intent(inout) :: points
      integer :: column, i, j, last
      integer :: first(points%n)

      allocate (points%group(points%n), source=1)
      column = points%table%find('group')
      if (column == 0) return
      last = 0
      do i = 1, points%n
         do j = last, 1, -1
            if (points%table%cell(column, i) == points%table%cell(column, first(j))) exit
         end do
         if (j == 0) then
            last = last + 1
            first(last) = i
            j = last
         end if
         points%group(i) = j
      end do
   end subroutine read_groups

   !> A column by its name or, without regard to case, by another one, perhaps with its unit: 'Euler1 (deg)'; 0 where there is none.
   subroutine find_column(table, name, column, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      integer, intent(out) :: column
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: word, unit
      integer :: i, j, k

      column = table%find(name)
      i = findloc(known_columns%name, name, dim=1)
      if (column > 0 .or. i == 0) return
      do j = 1, table%columns
         word = lower(table%name(j))
         unit = ''
         k = scan(word, '([')
         if (k > 0) then
            unit = word(k + 1:)
            if (scan(unit, ')]') > 0) unit = unit(:scan(unit, ')]') - 1)
            word = word(:k - 1)
         end if
         word = trim(word)
         do k = 1, len(word)
            if (scan(word(k:k), ' -') == 1) word(k:k) = '_'
         end do
         if (index(known_columns(i)%others, ' '//word//' ') == 0) cycle
         if (len(unit) > 0 .and. index(known_columns(i)%units, ' '//trim(adjustl(unit))//' ') == 0) then
            call raise(error, 'column '//printable(table%name(j))//': the unit '//printable(unit)//' is not read; allowed' &
               & //trim(known_columns(i)%units), exit_bad_input)
            return
         end if
         column = j
         return
      end do
   end subroutine find_column

   subroutine need_column(table, name, column, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      integer, intent(out) :: column
      type(error_type), allocatable, intent(out) :: error

      call find_column(table, name, column, error)
      if (allocated(error)) return
      if (column == 0) call raise(error, 'the column '//name//' is missing; the columns are '//column_list(table), &
         & exit_bad_input)
   end subroutine need_column

   function column_list(table) result(list)
      type(table_type), intent(in) :: table
      character(len=:), allocatable :: list
      integer, parameter :: most = 30
      integer :: j

      list = ''
      do j = 1, min(table%columns, most)
         if (j > 1) list = list//', '
         list = list//printable(table%name(j))
      end do
      if (table%columns > most) list = list//', ...'
   end function column_list

   !> Refuse a cell: its text, then what is wrong with it.
   subroutine refuse_cell(table, column, row, message, error)
      type(table_type), intent(in) :: table
      integer, intent(in) :: column, row
      character(len=*), intent(in) :: message
      type(error_type), allocatable, intent(out) :: error

      call raise(error, 'line '//to_text(table%line(row))//', column '//printable(table%name(column))//': ' &
         & //printable(table%cell(column, row))//message, exit_bad_input)
   end subroutine refuse_cell

   !> No angle above a full turn in radians, and not all zero.
   pure logical function angles_look_like_radians(points)
      type(points_type), intent(in) :: points
      real(wp) :: largest

      largest = maxval(abs(points%euler_deg))
      angles_look_like_radians = largest > 0.0_wp .and. largest <= 2.0_wp*pi + 1.0e-6_wp
   end function angles_look_like_radians

   pure real(wp) function not_a_number()
      use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value

      not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
   end function not_a_number
end module point_tables
