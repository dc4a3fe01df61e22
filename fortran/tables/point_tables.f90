!> The CSV tables that a problem names: crystals with orientations, measurements, candidates. Columns go by name; unknown
!> ones are carried through.
module point_tables
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: degree, pi, wp
   use orientation_columns, only: find_ways, read_directions
   use settings_groups, only: measurements_settings_type
   use stated_columns, only: name_columns
   use table_columns, only: check_unit, column_list, find_column, find_modulus, nearest_to, need_column, refuse_cell, &
      & says_radians
   use tables, only: read_table, table_type
   use text, only: join, to_text
   implicit none
   private
   public :: points_type, read_crystals, read_grains, read_measurements, measurements_of_table, read_positions, &
      & angles_look_like_radians

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
      !> Bunge-Euler angles, degrees, (3, n); whether the table has them, or only the indented direction of each.
      real(wp), allocatable :: euler_deg(:, :)
      logical :: has_angles = .true.
      !> Moduli and their sds, GPa, (n).
      real(wp), allocatable :: modulus_gpa(:), sd_gpa(:)
      !> Of measurements: which modulus was measured.
      character(len=:), allocatable :: modulus_kind
      !> Of a measured grain: sd of the tilt of the indented direction per component, degrees; depth of the indentation and radius of the
      !> grain, um; and its group, 1, 2, .., (n).
      real(wp), allocatable :: orientation_sd_deg(:), depth_um(:), grain_radius_um(:)
      integer, allocatable :: group(:)
      !> The column of the points' names, 0 if there is none, and the row of the table that a point stands for, (n).
      integer :: named_by = 0
      integer, allocatable :: row(:)
      !> Where a point is several tests combined: their numbers, and the chi-square of each one's tests about their mean, (n).
      integer, allocatable :: tests(:)
      real(wp), allocatable :: chi_square(:)
   contains
      procedure :: name
   end type points_type

   character(len=*), parameter :: angle_names(3) = [character(len=8) :: 'phi1_deg', 'Phi_deg', 'phi2_deg']
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
      integer :: column

      call read_table(path, points%table, error)
      if (.not. allocated(error)) call read_angles(points, .false., error)
      if (.not. allocated(error)) call read_constants(points, default_class, error)
      if (.not. allocated(error)) call find_column(points%table, 'modulus_gpa', column, error)
      if (.not. allocated(error) .and. column == 0) call find_column(points%table, 'indentation_modulus_gpa', column, error)
      if (.not. allocated(error)) call read_moduli(points, column, .false., error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_crystals

   !> The name of point `i`, or its number.
   function name(self, i)
      class(points_type), intent(in) :: self
      !> 1, 2, ..
      integer, intent(in) :: i
      character(len=:), allocatable :: name

      if (self%named_by > 0) then
         name = self%table%cell(self%named_by, self%row(i))
      else
         name = to_text(i)
      end if
   end function name

   !> Orientations with moduli, as `&measurements` says. Messages begin with `prefix`.
   subroutine read_measurements(path, prefix, asked, crystal, parameters, points, error)
      character(len=*), intent(in) :: path, prefix
      type(measurements_settings_type), intent(in) :: asked
      !> Of the grains.
      type(crystal_class_type), intent(in) :: crystal
      !> Of its unit cell, see `new_lattice`; perhaps unallocated.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      call read_table(path, points%table, error)
      if (.not. allocated(error)) call read_measured(points, asked, crystal, parameters, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_measurements

   !> The same from a table.
   subroutine measurements_of_table(table, prefix, asked, crystal, parameters, points, error)
      type(table_type), intent(in) :: table
      !> With which messages begin.
      character(len=*), intent(in) :: prefix
      type(measurements_settings_type), intent(in) :: asked
      !> See `read_measurements`.
      type(crystal_class_type), intent(in) :: crystal
      !> Of its unit cell.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      points%table = table
      call read_measured(points, asked, crystal, parameters, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine measurements_of_table

   !> The columns x_um and y_um.
   subroutine read_positions(table, positions, error)
      type(table_type), intent(in) :: table
      !> um, (n, 2).
      real(wp), allocatable, intent(out) :: positions(:, :)
      type(error_type), allocatable, intent(out) :: error
      character(len=4), parameter :: names(2) = ['x_um', 'y_um']
      integer :: column, i, j

      allocate (positions(table%rows, 2))
      do j = 1, 2
         call need_column(table, names(j), column, error)
         if (allocated(error)) return
         do i = 1, table%rows
            call table%number(column, i, positions(i, j), error)
            if (allocated(error)) return
         end do
      end do
   end subroutine read_positions

   !> Orientations of grains that may be measured, with their names. Messages begin with `prefix`.
   subroutine read_grains(path, prefix, radians, crystal, parameters, points, error)
      character(len=*), intent(in) :: path, prefix
      !> The unit of the angles in the file.
      logical, intent(in) :: radians
      type(crystal_class_type), intent(in) :: crystal
      !> See `read_measurements`.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      call read_table(path, points%table, error)
      if (.not. allocated(error)) call read_orientations(points, radians, crystal, parameters, error)
      if (.not. allocated(error)) call find_column(points%table, 'grain', points%named_by, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_grains

   subroutine read_measured(points, asked, crystal, parameters, error)
      type(points_type), intent(inout) :: points
      type(measurements_settings_type), intent(in) :: asked
      type(crystal_class_type), intent(in) :: crystal
      real(wp), allocatable, intent(in) :: parameters(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: column

      call name_columns(points%table, asked%columns, error)
      if (.not. allocated(error)) call read_orientations(points, asked%angles == 'radians', crystal, parameters, error)
      if (.not. allocated(error)) call find_modulus(points%table, asked%modulus_kind, column, points%modulus_kind, error)
      if (.not. allocated(error)) call read_moduli(points, column, .true., error)
      if (.not. allocated(error)) call read_sds(points, asked%scale == 'inferred', error)
      if (.not. allocated(error)) call read_optional(points, 'orientation_sd_deg', [0.0_wp, 20.0_wp], ' degrees', &
         & points%orientation_sd_deg, error)
      if (.not. allocated(error)) call read_optional(points, 'depth_um', lengths_allowed, ' um', points%depth_um, error)
      if (.not. allocated(error)) call read_optional(points, 'grain_radius_um', lengths_allowed, ' um', points%grain_radius_um, &
         & error)
      if (.not. allocated(error)) call read_groups(points)
   end subroutine read_measured

   !> The angles of every row, or angles for the direction that is stated in another way.
   subroutine read_orientations(points, radians, crystal, parameters, error)
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(crystal_class_type), intent(in) :: crystal
      real(wp), allocatable, intent(in) :: parameters(:)
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: columns(:)
      integer :: way, column, angles, j

      call find_ways(points%table, way, columns, error)
      angles = 0
      do j = 1, 3
         if (allocated(error)) return
         call find_column(points%table, trim(angle_names(j)), column, error)
         if (column > 0) angles = angles + 1
      end do
      if (allocated(error)) return
      if (way == 0 .or. angles == 3) call read_angles(points, radians, error)
      if (allocated(error)) then
         if (angles == 0) error%message = error%message//'; instead of angles q0, q1, q2, q3, or u, v, w, or h, k, l'
      else if (way > 0 .and. angles == 3) then
         call raise(error, 'orientations are stated twice, by angles and by '//points%table%name(columns(1))//', '&
            & //points%table%name(columns(2))//', ..; one of them is allowed', exit_bad_input)
      else if (way > 0) then
         call set_size(points)
         points%has_angles = .false.
         call read_directions(points%table, way, columns, crystal, parameters, points%euler_deg, error)
      end if
   end subroutine read_orientations

   !> A point a row; what is not read yet is NaN.
   subroutine set_size(points)
      type(points_type), intent(inout) :: points
      integer :: i

      points%n = points%table%rows
      points%row = [(i, i=1, points%n)]
      allocate (points%euler_deg(3, points%n))
      allocate (points%modulus_gpa(points%n), points%sd_gpa(points%n), source=not_a_number())
   end subroutine set_size

   !> The angles of every row.
   subroutine read_angles(points, radians, error)
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: largest_turn = 36000.0_wp, rounding = 1.0e-4_wp
      real(wp) :: most, unit
      character(len=:), allocatable :: unit_name
      integer :: column(3), i, j

      call set_size(points)
      unit = 1.0_wp
      unit_name = ' degrees'
      if (radians) then
         unit = degree
         unit_name = ' radians'
      end if
      do j = 1, 3
         call need_column(points%table, trim(angle_names(j)), column(j), error)
         if (allocated(error)) return
         if (.not. radians .and. says_radians(points%table, column(j))) then
            call raise(error, 'column '//points%table%name(column(j))//' is in radians; degrees are needed, or of measurements ' &
               & //'angles = ''radians''', exit_bad_input)
            return
         end if
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
         if (column(j) > 0) call check_unit(points%table, column(j), ' gpa ', error)
         if (allocated(error)) return
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

   !> The moduli of a `column`; 0 leaves them NaN.
   subroutine read_moduli(points, column, required, error)
      type(points_type), intent(inout) :: points
      integer, intent(in) :: column
      !> No cell may be empty.
      logical, intent(in) :: required
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (column == 0) return
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
            & //'scale = ''inferred''; the columns are '//column_list(points%table) &
            & //nearest_to(points%table, 'sd_gpa'), exit_bad_input)
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
      call find_column(points%table, name, column, error)
      if (allocated(error) .or. column == 0) return
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
