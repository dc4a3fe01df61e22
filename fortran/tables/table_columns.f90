!> Which column of a table is which quantity: the names that tables have, whatever the case, with
!> their units in brackets, after a slash, as the last word or in a row of their own.
module table_columns
   use direction_columns, only: ways
   use errors, only: error_type, refuse, suggestion
   use files, only: printable
   use kinds, only: wp
   use tables, only: longest_name, table_type
   use text, only: join, lower, split_list, to_text
   implicit none
   private
   public :: known_columns, refused_column, find_column, find_modulus, standard_name
   public :: column_list, nearest_to, check_unit, column_hint, name_columns, degrees

   !> A column, other names that it may have without their unit, the words for its unit, each
   !> between blanks, and what its numbers can be.
   type :: column_type
      character(len=longest_name) :: name
      !> Separated by ', '.
      character(len=176) :: others
      character(len=36) :: units
      !> The least and the greatest; the unit as messages have it, after a blank; and what is said
      !> of other numbers.
      real(wp) :: allowed(2) = [-huge(1.0_wp), huge(1.0_wp)]
      character(len=8) :: unit = ''
      character(len=60) :: refusal = ''
   end type column_type
   character(len=*), parameter :: degrees = ' deg degrees degree ° ', &
      & angle_units = degrees//'rad radians ', gpa = ' gpa ', um = ' um µm μm ', &
      & speed = ' m/s m_s ', no_modulus = ' is no modulus of a metal'
   !> What a modulus of a metal can be, GPa; a depth or the size of a grain, um; the speed of a
   !> surface wave, m/s; and a direction, degrees.
   real(wp), parameter :: moduli(2) = [1.0_wp, 2000.0_wp], lengths(2) = [1.0e-6_wp, 1.0e6_wp], &
      & speeds(2) = [100.0_wp, 30000.0_wp], turns(2) = [-360.0_wp, 360.0_wp], no_less = tiny(1.0_wp)
   !> The columns of an indent that may lie in another grain. Measurements with one are refused.
   character(len=*), parameter :: refused_column = 'other_probability'
   type(column_type), parameter :: angle_columns(3) = [ &
      & column_type('phi1_deg', 'phi1, phi_1, φ1, euler1, euler_1, euler_angle_1', angle_units), &
      & column_type('Phi_deg', 'phi, φ, Φ, euler2, euler_2, euler_angle_2', angle_units), &
      & column_type('phi2_deg', 'phi2, phi_2, φ2, euler3, euler_3, euler_angle_3', angle_units)]
   !> The name of each modulus, and its other names.
   character(len=176), parameter :: modulus_names(2, 4) = reshape([character(len=176) :: &
      & 'modulus_gpa', 'modulus, e, youngs_modulus, young_modulus, elastic_modulus', &
      & 'indentation_modulus_gpa', 'indentation_modulus, plane_strain_modulus, m', &
      & 'effective_modulus_gpa', 'effective_modulus, reduced_modulus, er, e_r, eeff, e_eff, e*, ' &
      & //'ereduced, e_reduced', &
      & 'sample_modulus_gpa', 'sample_modulus, es, e_s, eit, e_it'], [2, 4])
   integer :: i
   type(column_type), parameter :: modulus_columns(4) = [(column_type(modulus_names(1, i), &
      & modulus_names(2, i), gpa, moduli, ' GPa', no_modulus), i=1, 4)]
   type(column_type), parameter :: sd_columns(2) = [ &
      & column_type('sd_gpa', 'sd, std, stdev, st_dev, std_dev, stddev, error, err, uncertainty, ' &
      & //'standard_deviation, standard_error, std_error, std_err, se, sem, sigma, ±', gpa, &
      & [no_less, moduli(2)], ' GPa', '; a standard deviation is above 0, up to 2000.0 GPa'), &
      & column_type('orientation_sd_deg', 'orientation_sd', degrees, [0.0_wp, 20.0_wp], ' degrees')]
   type(column_type), parameter :: indent_columns(3) = [ &
      & column_type(refused_column, 'other_phi1, other_phi, other_phi2', degrees), &
      & column_type('depth_um', 'depth', um, lengths, ' um'), &
      & column_type('depth_nm', 'depth', ' nm ', 1.0e3_wp*lengths, ' nm')]
   type(column_type), parameter :: size_columns(3) = [ &
      & column_type('contact_radius_um', '', um, lengths, ' um'), &
      & column_type('zero_sd_nm', '', ' nm ', [0.0_wp, 1000.0_wp], ' nm'), &
      & column_type('grain_radius_um', '', um, lengths, ' um')]
   type(column_type), parameter :: wave_columns(3) = [ &
      & column_type('propagation_deg', 'propagation', degrees, turns, ' degrees'), &
      & column_type('rayleigh_velocity_m_s', &
      & 'rayleigh_velocity, rayleigh_speed, saw_velocity, velocity, velocity_m_s', &
      & speed, speeds, ' m/s', ' is no speed of a wave'), &
      & column_type('sd_m_s', 'sd, std, stdev, error, uncertainty, standard_deviation', speed, &
      & [no_less, speeds(2)], ' m/s', '; a standard deviation is above 0, up to 30000.0 m/s')]
   type(column_type), parameter :: map_columns(2) = [ &
      & column_type('x_um', 'x', um), column_type('y_um', 'y', um)]
   type(column_type), parameter :: label_columns(5) = [ &
      & column_type('group', '', ''), &
      & column_type('grain', 'grain_id, grain_number, grain_no', ''), &
      & column_type('test', 'test_id, test_number', ''), &
      & column_type('reference', '', ''), column_type('session', '', '')]
   type(column_type), parameter :: curve_columns(4) = [ &
      & column_type('time_s', 'time', ' s '), column_type('load_mn', 'load, force', ' mn '), &
      & column_type('stiffness_n_m', 'stiffness', ' n/m n_m '), &
      & column_type('drift_nm_s', 'drift', ' nm/s nm_s ', [-5.0_wp, 5.0_wp], ' nm/s', &
      & ' is no drift of an instrument')]
   type(column_type), parameter :: known_columns(*) = [angle_columns, modulus_columns, sd_columns, &
      & indent_columns, size_columns, wave_columns, map_columns, label_columns, curve_columns]
   !> The rows of the moduli; all but the first name their kind, and then the unit.
   integer, parameter :: plain = 4, last_modulus = 7
   character(len=*), parameter :: modulus_unit = '_gpa'
   !> What may be a unit in a name.
   character(len=*), &
      & parameter :: unit_words = ' deg degrees degree rad radians gpa mpa kpa pa um nm mm % mn un '
   !> Fewer letters are near to everything.
   integer, parameter :: shortest_misspelt = 4

contains

   !> A column by its name or by another one; 0 where there is none.
   subroutine find_column(table, name, column, error, needed)
      type(table_type), intent(in) :: table
      !> Of `known_columns`.
      character(len=*), intent(in) :: name
      integer, intent(out) :: column
      type(error_type), allocatable, intent(out) :: error
      !> It must be there.
      logical, intent(in), optional :: needed
      integer, allocatable :: found(:)
      integer :: i, j

      i = findloc(known_columns%name, name, dim=1)
      found = pack([(j, j=1, table%columns)], &
         & [(is_other_name(table%called(j), i), j=1, table%columns)])
      column = table%find(name)
      if (column == 0 .and. size(found) > 1) then
         call refuse(error, 'the columns '//printable(table%name(found(1))) &
            & //' and '//printable(table%name(found(2)))//' are both '//name &
            & //'; one of them is allowed, or one that is named '//name)
      end if
      if (allocated(error)) return
      if (column == 0 .and. size(found) == 1) column = found(1)
      if (column > 0) call check_unit(table, column, known_columns(i)%units, error)
      if (.not. present(needed)) return
      if (needed .and. column == 0) then
         call refuse(error, 'the column '//name//' is missing; the columns are ' &
            & //column_list(table)//nearest_to(table, name))
      end if
   end subroutine find_column

   !> Whether a name is another one of row `i` of `known_columns`, whatever its unit; of a depth the
   !> unit decides. That of an sd may begin with the name of a modulus.
   pure logical function is_other_name(name, i)
      character(len=*), intent(in) :: name
      integer, intent(in) :: i
      character(len=:), allocatable :: word, unit
      integer :: j, k

      call split_name(name, word, unit)
      if (known_columns(i)%name == 'sd_gpa') then
         do k = 2, len(word) - 1
            if (word(k:k) /= '_') cycle
            if (.not. any([(any(split_list(known_columns(j)%others) == word(:k - 1)), j=plain, &
               & last_modulus)])) then
               cycle
            end if
            word = word(k + 1:)
            exit
         end do
      end if
      is_other_name = any(split_list(known_columns(i)%others) == word)
      if (word == 'depth') then
         is_other_name = is_other_name .and. index(known_columns(i)%units, ' '//unit//' ') > 0
      end if
   end function is_other_name

   !> What a header means: one of `known_columns` or of the ways to state directions; '' is nothing
   !> that is read.
   pure function standard_name(header) result(name)
      character(len=*), intent(in) :: header
      character(len=longest_name) :: name
      integer :: i

      name = lower(header)
      if (all(split_list(join(ways(:3), ', ')) /= name)) name = ''
      do i = size(known_columns), 1, -1
         if (is_other_name(header, i) .or. lower(known_columns(i)%name) == lower(header)) then
            name = known_columns(i)%name
         end if
      end do
   end function standard_name

   !> The unit that a column's name or the row of units says, if any, is one of `units`.
   subroutine check_unit(table, column, units, error)
      type(table_type), intent(in) :: table
      !> Its number.
      integer, intent(in) :: column
      !> Words, each between blanks.
      character(len=*), intent(in) :: units
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: word, unit, allowed
      integer :: i

      call split_name(table%name(column), word, unit)
      do i = 1, 2
         if (i == 2) unit = trim(table%units(column))
         if (len(unit) == 0 .or. index(units, ' '//unit//' ') > 0) cycle
         ! Of a column that the user names, other words in brackets are no unit.
         if (table%called(column) /= table%name(column) &
            & .and. index(unit_words, ' '//unit//' ') == 0) then
            cycle
         end if
         allowed = 'allowed'//trim(units)
         if (len_trim(units) == 0) allowed = 'this column has none'
         call refuse(error, 'column '//printable(table%name(column))//': the unit ' &
            & //printable(unit)//' is not read; '//allowed)
         return
      end do
   end subroutine check_unit

   !> 'reduced_modulus' and 'gpa' of 'Reduced modulus (GPa)', 'reduced-modulus / GPa' or
   !> 'reduced_modulus_GPa'.
   pure subroutine split_name(name, word, unit)
      character(len=*), intent(in) :: name
      character(len=:), allocatable, intent(out) :: word, unit
      integer :: k

      word = lower(name)
      unit = ''
      k = scan(word, '([/', back=.true.)
      if (k > 0) then
         unit = word(k + 1:)
         word = word(:k - 1)
         k = scan(unit, ')]')
         ! Such as sd in 'Er (GPa) sd'.
         if (k > 0) then
            word = trim(word)//unit(k + 1:)
            unit = unit(:k - 1)
         end if
         unit = trim(adjustl(unit))
      end if
      word = trim(word)
      do k = 1, len(word)
         if (scan(word(k:k), ' -.') == 1) word(k:k) = '_'
      end do
      k = index(word, '''')
      if (k > 0) word = word(:k - 1)//word(k + 1:)
      do while (index(word//' ', '__') + index(word//' ', '_ ') > 1)
         k = max(index(word//' ', '__'), index(word//' ', '_ '))
         word = word(:k - 1)//word(k + 1:)
      end do
      k = index(word, '_', back=.true.)
      if (k > 1 .and. len(unit) == 0) then
         if (index(unit_words, ' '//word(k + 1:)//' ') > 0) then
            unit = word(k + 1:)
            word = word(:k - 1)
         end if
      end if
   end subroutine split_name

   !> Which of `known_columns` the moduli are in, and their kind from its name or as stated.
   subroutine find_modulus(table, stated, name, kind, error)
      type(table_type), intent(in) :: table
      !> A kind of modulus, or unallocated.
      character(len=:), allocatable, intent(in) :: stated
      character(len=:), allocatable, intent(out) :: name, kind
      type(error_type), allocatable, intent(out) :: error
      character(len=longest_name) :: names(plain:last_modulus), kinds(plain:last_modulus)
      character(len=:), allocatable :: choices, found
      integer :: columns(plain:last_modulus), i, own

      names = known_columns(plain:last_modulus)%name
      found = ''
      own = 0
      do i = plain, last_modulus
         kinds(i) = names(i)(:index(names(i), modulus_unit) - 1)
         call find_column(table, trim(names(i)), columns(i), error)
         if (allocated(error)) return
         if (columns(i) == 0) cycle
         found = found//' and '//printable(table%name(columns(i)))
         if (i > plain .and. .not. allocated(stated)) own = i
         if (i > plain .and. allocated(stated)) own = merge(i, own, stated == kinds(i))
      end do
      choices = ''''//join(kinds(plain + 1:), ''', ''')//''''
      name = trim(names(plain))
      if (allocated(stated)) kind = stated
      if (len(found) == 0) then
         call refuse(error, 'no column is a modulus; allowed '//join(names(plain + 1:), ', ') &
            & //', or modulus_gpa with modulus_kind. If another one is, state columns = ''' &
            & //trim(names(last_modulus - 1))//' = its header''; the columns are ' &
            & //column_list(table)//nearest_to(table, join(names, ', ')))
      else if (allocated(stated) .and. own == 0 .and. columns(plain) == 0) then
         call refuse(error, 'modulus_kind = '''//stated//''', but the moduli are those of the ' &
            & //'column '//found(6:)//'; leave modulus_kind out, or name the column modulus_gpa')
      else if (.not. allocated(stated) .and. count(columns > 0) > 1) then
         call refuse(error, &
            & 'the columns '//found(6:)//' are moduli; state modulus_kind to take one: '//choices)
      else if (.not. allocated(stated) .and. columns(plain) > 0) then
         call refuse(error, 'the column '//found(6:)//' does not say which ' &
            & //'modulus was measured, nor does modulus_kind; allowed '//choices &
            & //' (effective_modulus: reduced modulus, Er; sample_modulus: EIT, Young''s modulus)')
      else if (own > 0) then
         name = trim(names(own))
         kind = trim(kinds(own))
      end if
   end subroutine find_modulus

   !> '; X: did you mean Y?' of the column that is nearest to one of `names` (separated by ', ') or
   !> their other names; or nothing.
   function nearest_to(table, names) result(words)
      type(table_type), intent(in) :: table
      !> Of `known_columns`.
      character(len=*), intent(in) :: names
      character(len=:), allocatable :: words, allowed, near
      integer :: j

      allowed = names
      do j = 1, size(known_columns)
         if (any(split_list(names) == known_columns(j)%name)) then
            allowed = allowed//', '//trim(known_columns(j)%others)
         end if
      end do
      words = ''
      do j = 1, table%columns
         near = column_hint(table, j, allowed)
         if (len(near) == 0) cycle
         words = '; '//printable(table%name(j))//':'//near(2:)
         return
      end do
   end function nearest_to

   !> ', did you mean X?' of a `column` whose name nobody knows but which is near to one that is
   !> known; else nothing.
   function column_hint(table, column, allowed) result(words)
      type(table_type), intent(in) :: table
      !> Its number.
      integer, intent(in) :: column
      !> What is known, where that is not all names, separated by ', '.
      character(len=*), intent(in), optional :: allowed
      character(len=:), allocatable :: words

      words = ''
      if (len(table%name(column)) < shortest_misspelt &
         & .or. len_trim(standard_name(table%called(column))) > 0) then
         return
      end if
      if (present(allowed)) words = suggestion(table%name(column), allowed)
      if (.not. present(allowed)) then
         words = suggestion(table%name(column), join(known_columns%name, ', '))
      end if
   end function column_hint

   function column_list(table) result(list)
      type(table_type), intent(in) :: table
      character(len=:), allocatable :: list
      integer, parameter :: most = 30
      integer :: j

      list = ''
      do j = 1, min(table%columns, most)
         list = list//', '//printable(table%name(j))
      end do
      list = list(3:)
      ! Or the file is none of a table.
      if (table%columns == 1) list = 'one, without a comma, semicolon or tab'
      if (table%columns > most) list = list//', ...'
   end function column_list

   !> Give columns the names that `said` has for them; their units stay those of the header.
   subroutine name_columns(table, said, error)
      type(table_type), intent(inout) :: table
      !> Of each a name, = and the header of its column; unallocated: nothing is said.
      character(len=*), allocatable, intent(in) :: said(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=longest_name) :: given(table%columns)
      character(len=:), allocatable :: names, known(:), name, header, place
      integer :: equals, column, i, k

      if (.not. allocated(said)) return
      names = join(known_columns%name, ', ')//', '//join(ways(:3), ', ')
      known = split_list(names)
      given = ''
      table%given_names = ''
      do i = 1, size(said)
         equals = index(said(i), '=')
         name = trim(adjustl(said(i)(:max(1, equals) - 1)))
         header = trim(adjustl(said(i)(equals + 1:)))
         place = 'columns: '''//printable(trim(said(i)))//''': '
         k = findloc([(lower(known(k)) == lower(name), k=1, size(known))], .true., dim=1)
         column = table%find(header)
         if (len(name) == 0 .or. len(header) == 0) then
            call refuse(error, place//'a name, = and the header of its column are needed, ' &
               & //'such as ''modulus_gpa = E (raw)''')
         else if (k == 0) then
            call refuse(error, place//'no column '//printable(name)//' is read' &
               & //suggestion(name, names)//'; allowed '//names)
         else if (column == 0) then
            call refuse(error, place//'the table has no column '//printable(header) &
               & //suggestion(header, column_list(table))//'; the columns are '//column_list(table))
         else if (any(given == known(k)) .or. len_trim(given(column)) > 0) then
            call refuse(error, place//'the name or the column is there twice; each is allowed once')
         end if
         if (allocated(error)) return
         given(column) = known(k)
      end do
      table%given_names = given
   end subroutine name_columns

end module table_columns
