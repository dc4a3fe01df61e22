!> The CSV tables that a problem names: crystals with orientations, measurements, candidates. Columns go by name; unknown
!> ones are carried through.
module point_tables
   use crystal_elasticity, only: constant_count, constant_names, is_stable, new_stiffness, symmetry_from_name, &
      & symmetry_name, symmetry_triclinic
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use kinds, only: pi, wp
   use tables, only: read_table, table_type
   use text, only: join, lower, to_text
   implicit none
   private
   public :: points_type, read_crystals, read_measurements, angles_look_like_radians

   !> One row a point. What a table has not is NaN.
   type :: points_type
      integer :: n = 0
      !> The cells as written.
      type(table_type) :: table
      !> Enumerators of `crystal_elasticity`, (n); 0 in measurements.
      integer, allocatable :: symmetry(:)
      !> In the order of `constant_names`, padded with NaN, GPa, (21, n).
      real(wp), allocatable :: constants(:, :)
      !> Crystal frame, GPa, (6, 6, n).
      real(wp), allocatable :: stiffness(:, :, :)
      !> Bunge-Euler angles, degrees, (3, n).
      real(wp), allocatable :: euler_deg(:, :)
      !> Moduli and their sds, GPa, (n).
      real(wp), allocatable :: modulus_gpa(:), sd_gpa(:)
   end type points_type

   character(len=*), parameter :: angle_names(3) = [character(len=8) :: 'phi1_deg', 'Phi_deg', 'phi2_deg']
   !> What a modulus of a metal, and a stiffness, can be, GPa.
   real(wp), parameter :: modulus_least = 1.0_wp, modulus_most = 2000.0_wp, stiffness_most = 5000.0_wp

contains

   !> Crystals and orientations. `prefix` begins the message of a refusal.
   subroutine read_crystals(path, prefix, default_symmetry, points, error)
      character(len=*), intent(in) :: path, prefix
      !> Symmetry of the rows that do not say theirs.
      integer, intent(in) :: default_symmetry
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      call read_points(path, points, error)
      if (.not. allocated(error)) call read_constants(points, default_symmetry, error)
      if (.not. allocated(error)) call read_moduli(points, .false., error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_crystals

   !> Orientations with moduli; the column of the sds may be absent if `sd_optional`.
   subroutine read_measurements(path, prefix, sd_optional, points, error)
      character(len=*), intent(in) :: path, prefix
      logical, intent(in) :: sd_optional
      type(points_type), intent(out) :: points
      type(error_type), allocatable, intent(out) :: error

      call read_points(path, points, error)
      if (.not. allocated(error)) call read_moduli(points, .true., error)
      if (.not. allocated(error)) call read_sds(points, sd_optional, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_measurements

   !> The table and its angles.
   subroutine read_points(path, points, error)
      character(len=*), intent(in) :: path
      type(points_type), intent(inout) :: points
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: largest_turn = 36000.0_wp
      real(wp) :: nan, most
      integer :: column(3), i, j

      call read_table(path, points%table, error)
      if (allocated(error)) return
      points%n = points%table%rows
      nan = not_a_number()
      allocate (points%symmetry(points%n), source=0)
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
            most = merge(180.0_wp, largest_turn, j == 2)
            if (abs(points%euler_deg(j, i)) > most .or. (j == 2 .and. points%euler_deg(j, i) < 0.0_wp)) then
               call refuse_cell(points%table, column(j), i, ' degrees; allowed ' &
                  & //to_text(merge(0.0_wp, -largest_turn, j == 2))//' to '//to_text(most), error)
               return
            end if
         end do
      end do
   end subroutine read_points

   !> The independent constants of each row, and the stiffness.
   subroutine read_constants(points, default_symmetry, error)
      type(points_type), intent(inout) :: points
      integer, intent(in) :: default_symmetry
      type(error_type), allocatable, intent(out) :: error
      character(len=3), allocatable :: names(:), needed(:)
      integer :: column(21), symmetry_column, usual, i, j, k, n
      real(wp) :: value, implied
      character(len=:), allocatable :: cell

      allocate (points%constants(21, points%n), source=not_a_number())
      allocate (points%stiffness(6, 6, points%n))
      names = constant_names(symmetry_triclinic)
      do j = 1, 21
         column(j) = points%table%find(names(j))
      end do
      symmetry_column = points%table%find('symmetry')
      ! All 21 columns and no word on the symmetry: the crystals are given whole.
      usual = default_symmetry
      if (all(column > 0)) usual = symmetry_triclinic
      do i = 1, points%n
         points%symmetry(i) = usual
         if (symmetry_column > 0) then
            cell = points%table%cell(symmetry_column, i)
            if (len(cell) > 0) then
               points%symmetry(i) = symmetry_from_name(lower(cell))
               if (points%symmetry(i) == 0) then
                  call refuse_cell(points%table, symmetry_column, i, ' is no symmetry; allowed ''cubic'', ''hexagonal'', ' &
                     & //'''triclinic''', error)
                  return
               end if
            else
               points%symmetry(i) = default_symmetry
            end if
         end if
         needed = constant_names(points%symmetry(i))
         n = constant_count(points%symmetry(i))
         do k = 1, n
            j = findloc(names == needed(k), .true., dim=1)
            if (column(j) == 0) then
               call raise(error, 'the column '//needed(k)//' is missing; a '//symmetry_name(points%symmetry(i)) &
                  & //' crystal has '//join(needed, ', '), exit_bad_input)
               return
            end if
            call points%table%number(column(j), i, value, error)
            if (allocated(error)) return
            if (abs(value) > stiffness_most) then
               call refuse_cell(points%table, column(j), i, ' GPa looks like MPa; allowed up to ' &
                  & //to_text(stiffness_most)//' GPa', error)
               return
            end if
            points%constants(k, i) = value
         end do
         points%stiffness(:, :, i) = new_stiffness(points%symmetry(i), points%constants(:n, i))
         ! A constant that does not apply is empty, or what the symmetry makes it.
         do j = 1, 21
            if (column(j) == 0 .or. any(needed == names(j))) cycle
            if (len(points%table%cell(column(j), i)) == 0) cycle
            call points%table%number(column(j), i, value, error)
            if (allocated(error)) return
            implied = points%stiffness(iachar(names(j)(2:2)) - 48, iachar(names(j)(3:3)) - 48, i)
            if (abs(value - implied) > 1.0e-3_wp*abs(implied) + 1.0e-3_wp) then
               call refuse_cell(points%table, column(j), i, ' GPa does not apply to a ' &
                  & //symmetry_name(points%symmetry(i))//' crystal, whose '//names(j)//' is '//to_text(implied) &
                  & //' GPa; leave the cell empty', error)
               return
            end if
         end do
         if (.not. is_stable(points%stiffness(:, :, i))) then
            call raise(error, 'line '//to_text(points%table%line(i))//': the crystal is elastically unstable (' &
               & //constants_in_words(needed, points%constants(:n, i))//' GPa); the stiffness must be positive definite', &
               & exit_bad_input)
            return
         end if
      end do
   end subroutine read_constants

   !> 'C11 = 168.4, C12 = ...'; all 21 would not fit a line, so the diagonal stands for them.
   pure function constants_in_words(names, values) result(words)
      character(len=*), intent(in) :: names(:)
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: words
      integer :: i

      words = ''
      do i = 1, size(values)
         if (size(values) == 21 .and. names(i)(2:2) /= names(i)(3:3)) cycle
         if (i > 1) words = words//', '
         words = words//trim(names(i))//' = '//to_text(values(i))
      end do
   end function constants_in_words

   subroutine read_moduli(points, required, error)
      type(points_type), intent(inout) :: points
      logical, intent(in) :: required
      type(error_type), allocatable, intent(out) :: error
      integer :: column, i

      column = points%table%find('modulus_gpa')
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

      column = points%table%find('sd_gpa')
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

   subroutine need_column(table, name, column, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      integer, intent(out) :: column
      type(error_type), allocatable, intent(out) :: error

      column = table%find(name)
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
