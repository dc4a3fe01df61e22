!> Columns of tables: their names, and the numbers that they may have. Columns of orientations,
!> waves, grains and constants have other names, too, with a unit in brackets or after a slash.
module table_columns
   use direction_columns, only: ways
   use errors, only: error_type, refuse, suggestion
   use files, only: printable
   use kinds, only: nan, wp
   use observables, only: modulus_kinds
   use tables, only: longest_name, table_type
   use text, only: join, lower, split_list, to_text
   implicit none
   private
   public :: column_type, angle_columns, find_column, find_columns, read_column, read_numbers, &
      & find_modulus, foreign_column

   type :: column_type
      character(len=longest_name) :: name
      !> Least and greatest number; the unit, after a blank, and the words that follow a number
      !> which is not allowed.
      real(wp) :: allowed(2) = [-huge(1.0_wp), huge(1.0_wp)]
      character(len=8) :: unit = ''
      character(len=60) :: refusal = ''
      !> Other names without their units, separated by ', '; the units, each between blanks.
      character(len=90) :: others = ''
      character(len=36) :: units = ''
   end type column_type
   !> Moduli of metals, GPa; depths and sizes of grains, um; speeds of surface waves, m/s;
   !> directions, degrees.
   real(wp), parameter :: moduli(2) = [1.0_wp, 2000.0_wp], lengths(2) = [1.0e-6_wp, 1.0e6_wp], &
      & speeds(2) = [100.0_wp, 30000.0_wp], turns(2) = [-360.0_wp, 360.0_wp], no_less = tiny(1.0_wp)
   real(wp), parameter :: many_turns(2) = 100.0_wp*turns, half_turn(2) = [0.0_wp, 180.0_wp]
   character(len=*), parameter :: degrees = ' deg degrees degree ° ', &
      & angles = degrees//'rad radians ', speed = ' m/s m_s '
   character(len=*), parameter :: modulus_names(4) = [character(len=23) :: 'modulus_gpa', &
      & 'indentation_modulus_gpa', 'effective_modulus_gpa', 'sample_modulus_gpa']
   integer :: i
   type(column_type), parameter :: modulus_columns(4) = [(column_type(modulus_names(i), moduli, &
      & ' GPa', ' is no modulus of a metal'), i=1, size(modulus_names))]
   type(column_type), parameter :: grain_columns(7) = [ &
      & column_type('sd_gpa', [no_less, moduli(2)], ' GPa', &
      & '; a standard deviation is above 0, up to 2000.0 GPa'), &
      & column_type('orientation_sd_deg', [0.0_wp, 20.0_wp], ' degrees'), &
      & column_type('depth_um', lengths, ' um'), column_type('contact_radius_um', lengths, ' um'), &
      & column_type('zero_sd_nm', [0.0_wp, 1000.0_wp], ' nm'), &
      & column_type('grain_radius_um', lengths, ' um'), &
      & column_type('sample_nu', [-0.999_wp, 0.5_wp])]
   type(column_type), parameter :: propagation_column = column_type('propagation_deg', turns, &
      & ' degrees', others='propagation', units=degrees)
   type(column_type), parameter :: speed_columns(2) = [ &
      & column_type('rayleigh_velocity_m_s', speeds, ' m/s', ' is no speed of a wave', &
      & 'rayleigh_velocity, rayleigh_speed, saw_velocity, velocity', speed), &
      & column_type('sd_m_s', [no_less, speeds(2)], ' m/s', &
      & '; a standard deviation is above 0, up to 30000.0 m/s', &
      & 'sd, std, stdev, error, uncertainty, standard_deviation', speed)]
   type(column_type), parameter :: angle_columns(3) = [ &
      & column_type('phi1_deg', many_turns, ' degrees', &
      & '; allowed -36000.0 to 36000.0', 'phi1, phi_1, φ1, euler1, euler_1, euler_angle_1', &
      & angles), &
      & column_type('Phi_deg', half_turn, ' degrees', '; allowed 0.0 to 180.0', &
      & 'phi, φ, Φ, euler2, euler_2, euler_angle_2', angles), &
      & column_type('phi2_deg', many_turns, ' degrees', &
      & '; allowed -36000.0 to 36000.0', 'phi2, phi_2, φ2, euler3, euler_3, euler_angle_3', &
      & angles)]
   type(column_type), parameter :: label_columns(3) = [ &
      & column_type('grain', others='grain_id, grain_number, grain_no'), column_type('test'), &
      & column_type('row')]
   type(column_type), parameter :: drift_column = column_type('drift_nm_s', [-5.0_wp, 5.0_wp], &
      & ' nm/s', ' is no drift of an instrument')
   type(column_type), parameter :: known_columns(*) = [modulus_columns, grain_columns, &
      & propagation_column, speed_columns, angle_columns, label_columns, drift_column]
   !> Further columns of a canonical table of measurements.
   character(len=*), parameter :: further = 'x_um, y_um, group, reference, session, time_s'

contains

   !> Find the `column` of a name, or the only one of its other names; 0 if there is none. A
   !> constant C12 may be C_12, C21 or C_21, too. Nothing is done after an error.
   subroutine find_column(table, name, column, error, needed)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      integer, intent(out) :: column
      type(error_type), allocatable, intent(inout) :: error
      !> Whether a table without the column is refused.
      logical, intent(in) :: needed
      character(len=:), allocatable :: names, others(:), word, unit
      type(column_type) :: known
      integer :: i, j

      column = table%find(name)
      if (allocated(error)) return
      i = findloc(known_columns%name, name, dim=1)
      if (i > 0) known = known_columns(i)
      if (len(name) == 3 .and. name(1:1) == 'C') then
         word = name(2:3)
         unit = name(3:3)//name(2:2)
         known%others = 'c'//word//', c_'//word//', c'//unit//', c_'//unit
         known%units = ' gpa '
      end if
      if (column == 0 .and. len_trim(known%others) > 0) then
         others = split_list(known%others)
         do j = 1, table%columns
            call split_name(table%name(j))
            if (all(others /= word)) cycle
            if (column > 0) then
               call refuse(error, 'the columns '//printable(table%name(column))//' and ' &
                  & //printable(table%name(j))//' are both '//name//'; one of them is allowed, ' &
                  & //'or one that is named '//name)
               return
            else if (len(unit) > 0 .and. index(known%units, ' '//unit//' ') == 0) then
               call refuse(error, 'column '//printable(table%name(j))//': the unit ' &
                  & //printable(unit)//' is not read; allowed'//trim(known%units))
               return
            end if
            column = j
         end do
      end if
      if (column > 0 .or. .not. needed) return
      names = table%names()
      call refuse(error, 'the column '//name//' is missing; the columns are '//names &
         & //suggestion(name, names))

   contains

      !> Word and unit of a header: 'saw_velocity' and 'm/s' of 'SAW velocity (m/s)', 'phi1' and
      !> 'deg' of 'phi1_deg'.
      subroutine split_name(header)
         character(len=*), intent(in) :: header
         character(len=*), parameter :: endings(4) = ['_deg', '_rad', '_m_s', '_gpa']
         integer :: k

         word = lower(header)
         unit = ''
         k = scan(word, '([/')
         if (k > 1) then
            unit = word(k + 1:)
            if (scan(unit, ')]') > 0) unit = unit(:scan(unit, ')]') - 1)
            unit = trim(adjustl(unit))
            word = trim(word(:k - 1))
         end if
         do k = 1, len(word)
            if (scan(word(k:k), ' -.') == 1) word(k:k) = '_'
         end do
         k = len(word) - len(endings)
         if (k < 1 .or. len(unit) > 0) return
         if (all(endings /= word(k + 1:))) return
         unit = word(k + 2:)
         word = word(:k)
      end subroutine split_name
   end subroutine find_column

   !> Find the columns of several names, 0 for a name that is missing. Nothing is done after an
   !> error.
   subroutine find_columns(table, names, needed, columns, error)
      type(table_type), intent(in) :: table
      !> Names separated by ', '.
      character(len=*), intent(in) :: names
      !> Number of the first names that must occur.
      integer, intent(in) :: needed
      integer, allocatable, intent(out) :: columns(:)
      type(error_type), allocatable, intent(inout) :: error
      character(len=longest_name), allocatable :: each(:)
      integer :: j

      each = split_list(names)
      allocate (columns(size(each)))
      do j = 1, size(each)
         call find_column(table, trim(each(j)), columns(j), error, j <= needed)
      end do
   end subroutine find_columns

   !> Read the `values` of one of `known_columns`. An `optional` column may be absent and may have
   !> empty cells, which give NaN. Nothing is done after an error.
   subroutine read_column(table, name, optional, values, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: name
      logical, intent(in) :: optional
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(inout) :: error
      integer :: column

      call find_column(table, name, column, error, .not. optional)
      call read_numbers(table, column, known_columns(findloc(known_columns%name, name, 1)), &
         & optional, values, error)
   end subroutine read_column

   !> Read the `values` of a `column`. They are NaN if the column is 0, and in empty cells, if these
   !> are allowed by `may_be_empty`. Nothing is done after an error.
   subroutine read_numbers(table, column, known, may_be_empty, values, error)
      type(table_type), intent(in) :: table
      integer, intent(in) :: column
      !> The numbers that it may have. The range is added to a refusal without a semicolon.
      type(column_type), intent(in) :: known
      logical, intent(in) :: may_be_empty
      real(wp), allocatable, intent(out) :: values(:)
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: words
      integer :: i

      allocate (values(table%rows), source=nan)
      do i = 1, merge(table%rows, 0, column > 0)
         if (may_be_empty .and. table%is_empty(column, i)) cycle
         call table%number(column, i, values(i), error)
         if (allocated(error)) return
         associate (least => known%allowed(1), most => known%allowed(2))
            if (values(i) >= least .and. values(i) <= most) cycle
            words = trim(known%refusal)
            if (index(words, ';') == 0) then
               if (known%unit == ' GPa' .and. values(i) > most) words = ' looks like MPa'
               words = words//'; allowed '//to_text(least)//' to '//to_text(most)//trim(known%unit)
            end if
         end associate
         call table%refuse(column, i, trim(known%unit)//words, error)
         return
      end do
   end subroutine read_numbers

   !> Find the column of the moduli, and their kind, from its name or as it is stated.
   subroutine find_modulus(table, stated, name, kind, error)
      type(table_type), intent(in) :: table
      !> A kind of modulus, or unallocated.
      character(len=:), allocatable, intent(in) :: stated
      character(len=:), allocatable, intent(out) :: name, kind
      type(error_type), allocatable, intent(out) :: error
      character(len=longest_name), allocatable :: found(:)
      integer :: i

      found = pack(modulus_names, &
         & [(table%find(trim(modulus_names(i))) > 0, i=1, size(modulus_names))])
      if (size(found) /= 1) then
         call refuse(error, trim(merge('no column is a modulus       ', &
            & 'several columns are a modulus', size(found) == 0))//'; allowed ' &
            & //join(modulus_kinds, '_gpa, ')//'_gpa, or modulus_gpa with modulus_kind; ' &
            & //'the columns are '//table%names())
         return
      end if
      name = trim(found(1))
      kind = name(:index(name, '_gpa') - 1)
      if (kind == 'modulus' .and. .not. allocated(stated)) then
         call refuse(error, 'the column modulus_gpa does not say which modulus was measured, nor ' &
            & //'does modulus_kind; allowed '''//join(modulus_kinds, ''', ''') &
            & //''' (effective_modulus: reduced modulus, Er; sample_modulus: EIT, Young''s ' &
            & //'modulus)')
         return
      end if
      if (.not. allocated(stated)) return
      if (kind /= 'modulus' .and. kind /= stated) then
         call refuse(error, 'modulus_kind = '''//stated//''', but the moduli are those of the ' &
            & //'column '//name//'; leave modulus_kind out, or name the column modulus_gpa')
      end if
      kind = stated
   end subroutine find_modulus

   !> Number of the first column that no canonical table of measurements has; 0 if there is none.
   pure integer function foreign_column(table) result(column)
      type(table_type), intent(in) :: table
      character(len=:), allocatable :: names(:), name

      names = split_list(lower(join(known_columns%name, ', '))//', '//further//', ' &
         & //join(ways(:3), ', '))
      do column = 1, table%columns
         name = lower(table%name(column))
         if (len(name) > 0 .and. all(names /= name) .and. index(name, 'shared_') /= 1) return
      end do
      column = 0
   end function foreign_column

end module table_columns
