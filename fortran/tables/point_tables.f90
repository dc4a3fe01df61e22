!> The CSV tables that a problem names: crystals with orientations, measurements, candidates.
!> Columns go by name; unknown ones are carried through.
module point_tables
   use files, only: hash_of, printable
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: check_stiffness, path_type, rayleigh, rotation_matrix
   use errors, only: error_type, prefix_error, refuse
   use kinds, only: degree, i8, nan, pi, wp
   use statistics, only: number_equal
   use settings_schema, only: measurements_settings_type
   use direction_columns, only: find_ways, read_directions
   use table_columns, only: find_column, find_modulus, known_columns
   use tables, only: longest_name, read_table, table_type
   use text, only: join, to_text
   implicit none
   private
   public :: points_type, read_crystals, read_measurements, read_orientations, first_rows, &
      & angles_look_like_radians, read_angles, read_groups, read_column

   !> One row a point. What a table has not is NaN.
   type :: points_type
      integer :: n = 0
      !> The cells as written.
      type(table_type) :: table
      !> The crystal classes that rows have, and the number of each row's, (n); none in
      !> measurements.
      type(crystal_class_type), allocatable :: classes(:)
      integer, allocatable :: class(:)
      !> In the order of the class, padded with NaN, GPa, (21, n); crystal frame, GPa, (6, 6, n).
      real(wp), allocatable :: constants(:, :), stiffness(:, :, :)
      !> Bunge-Euler angles, degrees, (3, n); whether the table has them, or only the indented
      !> direction of each.
      real(wp), allocatable :: euler_deg(:, :)
      logical :: has_angles = .true.
      !> Of the waves, which among measurements are the last rows; and how many of these were left
      !> out.
      type(path_type), allocatable :: paths(:)
      integer :: omitted = 0
      !> Of the rows of several tables, (n).
      character(len=longest_name), allocatable :: names(:)
      !> Moduli, or speeds, and their sds, GPa, or m/s, (n).
      real(wp), allocatable :: modulus_gpa(:), sd_gpa(:)
      !> Of measurements: which modulus was measured.
      character(len=:), allocatable :: modulus_kind
      !> Of a measured grain: sd of the tilt of the indented direction per component, degrees; depth
      !> and contact radius of the indentation and radius of the grain, um; and its group, 1, 2, ..,
      !> (n).
      real(wp), allocatable :: orientation_sd_deg(:), depth_um(:), contact_radius_um(:), &
         & grain_radius_um(:)
      integer, allocatable :: group(:)
      !> The column of the points' names, 0 if there is none, and the row of the table that a point
      !> stands for, (n), and the point of each row.
      integer :: named_by = 0
      integer, allocatable :: row(:), of_row(:)
      !> Where a point is several tests combined: their numbers, and the chi-square of each one's
      !> tests about their mean, (n).
      integer, allocatable :: tests(:)
      real(wp), allocatable :: chi_square(:)
   contains
      procedure :: name, directions
   end type points_type

   character(len=*), &
      & parameter :: angle_names(3) = [character(len=8) :: 'phi1_deg', 'Phi_deg', 'phi2_deg']
   !> What a stiffness can be, GPa.
   real(wp), parameter, public :: stiffness_most = 5000.0_wp

contains

   !> Crystals and orientations. `prefix` begins the message of a refusal.
   subroutine read_crystals(path, prefix, default_class, points, error)
      character(len=*), intent(in) :: path, prefix
      !> Of the rows that do not say theirs.
      type(crystal_class_type), intent(in) :: default_class
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: along(:)
      logical :: are_waves
      integer :: column, i

      call read_table(path, points%table, error)
      if (.not. allocated(error)) call read_angles(points, .false., error)
      if (.not. allocated(error)) call read_constants(points, default_class, error)
      if (.not. allocated(error)) then
         call read_column(points%table, trim(merge('modulus_gpa            ', &
            & 'indentation_modulus_gpa', points%table%find('modulus_gpa') > 0)), .true., &
            & points%modulus_gpa, error)
      end if
      if (.not. allocated(error)) then
         call find_column(points%table, 'propagation_deg', column, error)
         are_waves = column > 0
         call read_column(points%table, 'propagation_deg', .not. are_waves, along, error)
         if (are_waves .and. .not. allocated(error)) then
            points%paths = [(path_type(rayleigh, along(i)), i=1, points%n)]
         end if
      end if
      call prefix_error(error, prefix)
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

   !> Orientations with moduli, as `&measurements` says.
   subroutine read_measurements(table, radians, asked, crystal, parameters, points, error)
      type(table_type), intent(in) :: table
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(measurements_settings_type), intent(in) :: asked
      !> Of the grains.
      type(crystal_class_type), intent(in) :: crystal
      !> Of its unit cell, see `new_lattice`; perhaps unallocated.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error
      !> Ten for each of the grains that Step 2 takes.
      integer, parameter :: most_rows = 200000
      character(len=:), allocatable :: name

      if (table%rows > most_rows) then
         call refuse(error, to_text(table%rows)//' rows; allowed up to '//to_text(most_rows))
      end if
      if (allocated(error)) return
      points%table = table
      call read_lines(points%table, error)
      if (allocated(error)) return
      if (asked%orientations == 'unknown') then
         call set_size(points)
         points%euler_deg = 0.0_wp
         points%has_angles = .false.
      else if (.not. allocated(error)) then
         call read_orientations(points, radians, crystal, parameters, error)
      end if
      if (.not. allocated(error)) then
         call find_modulus(points%table, asked%modulus_kind, name, points%modulus_kind, error)
      end if
      if (.not. allocated(error)) then
         call read_column(points%table, name, .false., points%modulus_gpa, error)
      end if
      if (.not. allocated(error)) then
         if (points%table%find('sd_gpa') > 0) then
            call read_column(points%table, 'sd_gpa', .false., points%sd_gpa, error)
         else if (asked%scale /= 'inferred') then
            call refuse(error, 'the column sd_gpa is missing; it may be absent only with scale = ' &
               & //'''inferred''; the columns are '//points%table%names())
         end if
      end if
      call read_column(points%table, 'orientation_sd_deg', .true., points%orientation_sd_deg, error)
      call read_column(points%table, 'depth_um', .true., points%depth_um, error)
      call read_column(points%table, 'contact_radius_um', .true., points%contact_radius_um, error)
      call add_zero_error()
      call read_column(points%table, 'grain_radius_um', .true., points%grain_radius_um, error)
      if (.not. allocated(error)) call read_groups(points)

   contains

      !> Number the lines as the column `row` does, which has those of the file of a laboratory.
      subroutine read_lines(table, error)
         type(table_type), intent(inout) :: table
         type(error_type), allocatable, intent(out) :: error
         integer, parameter :: most_lines = 10**9
         real(wp) :: line
         integer :: column, i

         column = table%find('row')
         do i = 1, merge(table%rows, 0, column > 0)
            call table%number(column, i, line, error)
            if (allocated(error)) return
            if (line >= 0.0_wp .and. line <= most_lines) table%line(i) = nint(line)
         end do
      end subroutine read_lines

      !> Add to the sds what an uncertain zero of the depth does to the modulus of each test, E ~
      !> P/(sqrt(R) h^1.5).
      subroutine add_zero_error()
         real(wp), parameter :: power = 1.5_wp
         real(wp), allocatable :: zero_sd_nm(:)
         integer :: i

         call read_column(points%table, 'zero_sd_nm', .true., zero_sd_nm, error)
         if (allocated(error)) return
         zero_sd_nm = merge(zero_sd_nm, asked%zero_sd_nm, zero_sd_nm >= 0.0_wp)
         i = findloc(zero_sd_nm > 0.0_wp &
            & .and. .not. (points%depth_um > 0.0_wp .and. points%sd_gpa > 0.0_wp), .true., dim=1)
         if (i > 0) then
            call refuse(error, &
               & 'line '//to_text(points%table%line(i))//': zero_sd_nm = '//to_text(zero_sd_nm(i)) &
               & //' nm needs the depth of the test (column depth_um) and its sd_gpa')
         end if
         if (allocated(error)) return
         where (zero_sd_nm > 0.0_wp) points%sd_gpa = sqrt(points%sd_gpa**2 &
            & + (power*1.0e-3_wp*zero_sd_nm/points%depth_um*points%modulus_gpa)**2)
      end subroutine add_zero_error
   end subroutine read_measurements

   !> The angles of every row, or angles for the direction that is stated in another way.
   subroutine read_orientations(points, radians, crystal, parameters, error)
      !> Their table is there.
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(crystal_class_type), intent(in) :: crystal
      !> See `read_measurements`.
      real(wp), allocatable, intent(in) :: parameters(:)
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: columns(:)
      integer :: way, angles(3), j

      call find_ways(points%table, way, columns, error)
      do j = 1, 3
         if (allocated(error)) return
         call find_column(points%table, trim(angle_names(j)), angles(j), error)
      end do
      if (allocated(error)) return
      if (way == 0) then
         call read_angles(points, radians, error)
         if (allocated(error) .and. all(angles == 0)) then
            error%message = error%message//'; instead of angles q0, q1, q2, q3, or u, v, w, or ' &
               & //'h, k, l; if no orientation is known state orientations = ''unknown'''
         end if
      else if (all(angles > 0)) then
         call refuse(error, 'orientations are stated twice, by angles and by ' &
            & //points%table%name(columns(1))//', '//points%table%name(columns(2)) &
            & //', ..; one of them is allowed')
      else
         call set_size(points)
         points%has_angles = .false.
         call read_directions(points%table, way, columns, crystal, parameters, &
            & points%euler_deg, error)
      end if
   end subroutine read_orientations

   !> A point a row; what is not read yet is NaN.
   subroutine set_size(points)
      type(points_type), intent(inout) :: points
      integer :: i

      points%n = points%table%rows
      points%row = [(i, i=1, points%n)]
      points%of_row = points%row
      allocate (points%euler_deg(3, points%n), points%paths(points%n))
      allocate (points%modulus_gpa(points%n), points%sd_gpa(points%n), source=nan)
   end subroutine set_size

   !> The angles of every row.
   subroutine read_angles(points, radians, error)
      type(points_type), intent(inout) :: points
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(error_type), allocatable, intent(out) :: error
      ! Half a turn in radians is a rounded number.
      real(wp), parameter :: largest_turn = 36000.0_wp, rounding = 1.0e-4_wp
      character(len=:), allocatable :: refusal
      real(wp), allocatable :: values(:)
      real(wp) :: allowed(2), unit
      integer :: column, j

      call set_size(points)
      unit = merge(degree, 1.0_wp, radians)
      do j = 1, 3
         call find_column(points%table, trim(angle_names(j)), column, error, needed=.true.)
         if (allocated(error)) return
         allowed = merge([0.0_wp, 180.0_wp], [-largest_turn, largest_turn], j == 2)*unit
         refusal = '; allowed '//to_text(allowed(1))//' to '//to_text(allowed(2))
         call read_numbers(points%table, column, allowed + [0.0_wp, merge(rounding, 0.0_wp, &
            & radians .and. j == 2)], .false., merge(' radians', ' degrees', radians), refusal, &
            & values, error)
         if (allocated(error)) return
         points%euler_deg(j, :) = min(values, allowed(2))/unit
      end do
   end subroutine read_angles

   !> The independent constants of each row, and the stiffness.
   subroutine read_constants(points, default_class, error)
      type(points_type), intent(inout) :: points
      type(crystal_class_type), intent(in) :: default_class
      type(error_type), allocatable, intent(out) :: error
      !> The class whose constants are all entries.
      type(crystal_class_type) :: general
      real(wp), allocatable :: values(:)
      integer :: column(21), i, j

      call new_crystal_class(general_class, general, error)
      if (allocated(error)) return
      allocate (points%constants(21, points%n), source=nan)
      allocate (points%stiffness(6, 6, points%n))
      do j = 1, 21
         column(j) = points%table%find(general%constants(j))
         if (column(j) == 0) cycle
         call read_numbers(points%table, column(j), [-stiffness_most, stiffness_most], .true., &
            & ' GPa', ' looks like MPa; allowed up to '//to_text(stiffness_most)//' GPa', &
            & values, error)
         if (allocated(error)) return
         points%constants(j, :) = values
      end do
      call read_classes()
      if (allocated(error)) return
      do i = 1, points%n
         call take_constants()
         if (allocated(error)) return
      end do

   contains

      !> Of the entries of row i the constants of its class, and the stiffness.
      subroutine take_constants()
         real(wp) :: entries(21), implied(21)
         integer :: k

         entries = points%constants(:, i)
         points%constants(:, i) = nan
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
            end do
            points%stiffness(:, :, i) = class%stiffness(points%constants(:class%n_constants, i))
            ! A constant that does not apply is empty, or what the symmetry makes it.
            implied = general%constants_of(points%stiffness(:, :, i))
            do j = 1, 21
               if (.not. abs(entries(j) - implied(j)) > 1.0e-3_wp*abs(implied(j)) + 1.0e-3_wp) cycle
               call table%refuse(column(j), i, ' GPa does not apply to a '//class%name &
                  & //' crystal, whose '//general%constants(j)//' is '//to_text(implied(j)) &
                  & //' GPa; leave the cell empty', error)
               return
            end do
         end associate
         call check_stiffness(points%stiffness(:, :, i), error)
         call prefix_error(error, 'line '//to_text(points%table%line(i))//': ')
      end subroutine take_constants

      !> The class of each row, which may say it.
      subroutine read_classes()
         type(crystal_class_type) :: class
         integer, allocatable :: first(:)
         character(len=:), allocatable :: cell
         integer :: named, i, j

         named = points%table%find('symmetry')
         first = first_rows(points%table, named)
         allocate (points%classes(0), points%class(points%n))
         do i = 1, points%n
            if (first(i) < i) then
               points%class(i) = points%class(first(i))
               cycle
            end if
            cell = ''
            if (named > 0) cell = points%table%cell(named, i)
            class = default_class
            ! All 21 columns and no word on the symmetry: the crystals are given whole.
            if (all(column > 0) .and. named == 0) class = general
            if (len(cell) > 0) call new_crystal_class(cell, class, error)
            call prefix_error(error, points%table%place(named, i))
            if (allocated(error)) return
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
   end subroutine read_constants

   !> The `values` of one of `known_columns`. An `optional` one may be absent, and its cells may be
   !> empty: NaN there. Nothing is done after an error.
   subroutine read_column(table, name, optional, values, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      logical, intent(in) :: optional
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(inout) :: error
      integer :: column

      if (allocated(error)) return
      call find_column(table, name, column, error, needed=.not. optional)
      if (allocated(error)) return
      associate (known => known_columns(findloc(known_columns%name, name, 1)))
         call read_numbers(table, column, known%allowed, optional, trim(known%unit), &
            & trim(known%refusal), values, error)
      end associate
   end subroutine read_column

   !> The `values` of a `column`, NaN where its cells are empty, if they `may_be_empty`, or where it
   !> is 0.
   subroutine read_numbers(table, column, allowed, may_be_empty, unit, refusal, values, error)
      type(table_type), intent(in) :: table
      integer, intent(in) :: column
      !> The least and the greatest.
      real(wp), intent(in) :: allowed(2)
      logical, intent(in) :: may_be_empty
      !> What follows a cell that is not allowed: its unit, after a blank, and what is wrong, to
      !> which the range is added if it has no semicolon.
      character(len=*), intent(in) :: unit, refusal
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: words
      integer :: i

      allocate (values(table%rows), source=nan)
      do i = 1, merge(table%rows, 0, column > 0)
         if (may_be_empty .and. table%is_empty(column, i)) cycle
         call table%number(column, i, values(i), error)
         if (allocated(error)) return
         if (values(i) >= allowed(1) .and. values(i) <= allowed(2)) cycle
         words = refusal
         if (index(words, ';') == 0) then
            if (unit == ' GPa' .and. values(i) > allowed(2)) words = ' looks like MPa'
            words = words//'; allowed '//to_text(allowed(1))//' to '//to_text(allowed(2))//unit
         end if
         call table%refuse(column, i, unit//words, error)
         return
      end do
   end subroutine read_numbers

   !> Groups are numbered in the order in which their names appear.
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

   !> Of each row the first one that has the same cell in a `column`; the first of all if that is 0.
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

   !> No angle above a full turn in radians, and not all zero.
   pure logical function angles_look_like_radians(points)
      type(points_type), intent(in) :: points

      angles_look_like_radians = points%has_angles .and. any(abs(points%euler_deg) > 0.0_wp) &
         & .and. all(abs(points%euler_deg) <= 2.0_wp*pi + 1.0e-6_wp)
   end function angles_look_like_radians
end module point_tables
