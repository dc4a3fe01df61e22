!> Text to numbers, CSV tables, the syntax of namelists, and the schema's own consistency.
program test_input
   use acquisitions, only: acquisition_names
   use bases, only: basis_names
   use crystal_class, only: crystal_class_names, crystal_class_type
   use error_models, only: likelihood_names
   use errors, only: error_type
   use kinds, only: wp
   use namelist_file, only: entry_type, parse_namelist
   use indenters, only: indenter_names
   use observables, only: modulus_kinds
   use paper_basis, only: truncation_names
   use samplers, only: sampler_names
   use settings_schema, only: settings_type
   use settings_list, only: settings_list_type
   use settings_schema, only: list_settings
   use settings_checks, only: check_settings
   use settings_reader, only: read_settings
   use film_theory, only: film_name
   use specimens, only: geometry_names
   use text, only: join, number_malformed, number_not_finite, number_ok, number_text, &
      & read_integer, read_real, split_list
   use random, only: new_random_stream, random_stream_type
   use tables, only: csv_cell, parse_table, table_type
   use testing, only: check, check_refused, check_success, finish
   implicit none

   character, parameter :: newline = achar(10)

   call test_numbers()
   call test_tables()
   call test_syntax()
   call test_schema()
   call test_settings()
   call finish()

contains

   subroutine test_numbers()
      call check_real('1', 1.0_wp, number_ok)
      call check_real('-1.', -1.0_wp, number_ok)
      call check_real('+.5', 0.5_wp, number_ok)
      call check_real('1d-3', 1.0e-3_wp, number_ok)
      call check_real('1.5E+02', 150.0_wp, number_ok)
      call check_real('1e-400', 0.0_wp, number_ok)
      call check_real('1e400', 0.0_wp, number_not_finite)
      call check_real('-Inf', 0.0_wp, number_not_finite)
      call check_real('nan', 0.0_wp, number_not_finite)
      call check_real('', 0.0_wp, number_malformed)
      call check_real('.', 0.0_wp, number_malformed)
      call check_real('1e', 0.0_wp, number_malformed)
      call check_real('1.0.0', 0.0_wp, number_malformed)
      call check_real('1,5', 0.0_wp, number_malformed)
      call check_real('2*3', 0.0_wp, number_malformed)
      call check_real('0x10', 0.0_wp, number_malformed)
      call check_integer('2147483647', huge(1), number_ok)
      call check_integer('-7', -7, number_ok)
      call check_integer('2147483648', 0, number_not_finite)
      call check_integer('1.0', 0, number_malformed)
      call check_integer('+', 0, number_malformed)
      call test_round_trip()
   end subroutine test_numbers

   !> Text and back, to the last bit, over all magnitudes.
   subroutine test_round_trip()
      type(random_stream_type) :: stream
      real(wp) :: value, again, u
      integer :: i, outcome
      logical :: same

      stream = new_random_stream(1, 1)
      same = .true.
      do i = 1, 2000
         call stream%normal(value)
         call stream%uniform(u)
         value = value*10.0_wp**(600.0_wp*u - 300.0_wp)
         if (mod(i, 2) == 0) value = value*10.0_wp**(-600.0_wp*u + 300.0_wp)
         call read_real(number_text(value), again, outcome)
         same = same .and. outcome == number_ok .and. .not. abs(again - value) > 0.0_wp
      end do
      call check('2000 numbers as text and back', same)
      call check('few digits where few do', number_text(0.1_wp) == '0.1' &
         & .and. number_text(16.0_wp) == '16.0' .and. number_text(225.125_wp) == '225.125')
   end subroutine test_round_trip

   subroutine check_real(string, expected, expected_outcome)
      character(len=*), intent(in) :: string
      real(wp), intent(in) :: expected
      integer, intent(in) :: expected_outcome
      real(wp) :: value
      integer :: outcome

      call read_real(string, value, outcome)
      call check('real '''//string//'''', outcome == expected_outcome &
         & .and. .not. abs(value - expected) > 0.0_wp)
   end subroutine check_real

   subroutine check_integer(string, expected, expected_outcome)
      character(len=*), intent(in) :: string
      integer, intent(in) :: expected, expected_outcome
      integer :: value, outcome

      call read_integer(string, value, outcome)
      call check('integer '''//string//'''', outcome == expected_outcome .and. value == expected)
   end subroutine check_integer

   subroutine test_tables()
      type(table_type) :: table
      type(error_type), allocatable :: error
      real(wp) :: value

      call parse_table('# c'//newline//'a, "b ""c"", d",e'//achar(13)//newline//newline//'1,"2' &
         & //newline//'3",'//newline//' # c'//newline//'4 , 5,"6"', table, error)
      call check_success('a table with quotes, comments and blank lines', error)
      call check('its shape', table%rows == 2 .and. table%columns == 3)
      call check('a quoted name', table%name(2) == 'b "c", d')
      call check('a cell over two lines', table%cell(2, 1) == '2'//newline//'3')
      call check('an empty cell', len(table%cell(3, 1)) == 0)
      call check('the last cell', table%cell(3, 2) == '6')
      call check('the line of a row', table%line(2) == 7)
      call check('a name in another case', table%find('E') == 3 .and. table%find('f') == 0)
      call table%number(1, 2, value, error)
      call check('a number', .not. allocated(error) .and. nint(value) == 4)
      call table%number(3, 1, value, error)
      call check_refused('an empty number', error, 'line 4, column e: the cell is empty')
      call check('a cell as CSV', csv_cell('a "b", c') == '"a ""b"", c"' &
         & .and. csv_cell('a b') == 'a b')
   end subroutine test_tables

   subroutine test_syntax()
      type(entry_type), allocatable :: file(:)
      type(error_type), allocatable :: error

      call parse_namelist('&A x = 2*1.5, ''it''''s'' y = .true. & END &b/', file, error)
      call check_refused('a blank after &', error, '&a: the / that ends the group is missing')
      call parse_namelist('&A x = 2*1.5, ''it''''s'' y = .true. &END &b/', file, error)
      call check_success('two groups on one line', error)
      call check('names in lower case', file(1)%group == 'a' .and. file(3)%name == 'y')
      call check('an empty group', size(file) == 4 .and. len(file(1)%name//file(4)%name) == 0)
      call check('repeated values', size(file(2)%values) == 3 .and. file(2)%values(2)%text == '1.5')
      call check('a doubled quote', file(2)%values(3)%text == 'it''s' &
         & .and. file(2)%values(3)%quoted)
      call parse_namelist('&a x = 10001*1 /', file, error)
      call check_refused('too many repetitions', error, 'repeat count')
      call parse_namelist('&a x = 1 y (2) = 3 /', file, error)
      call check_refused('a subscript', error, '&a y: line 1: the subscript 2')
   end subroutine test_syntax

   !> Every row of the table can be used as the reader uses it.
   subroutine test_schema()
      type(settings_list_type) :: s
      type(settings_type) :: unset
      real(wp) :: low, high
      integer :: i, j, n, outcome(2)

      s = list_settings(unset)
      do i = 1, size(s%variables)
         associate (v => s%variables(i))
            if (v%kind == 'choice') then
               call check('row '//v%group//' '//v%name//' has words', len(v%allowed) > 0)
            end if
            call check('row '//v%group//' '//v%name//' is there once', &
               & count([(s%variables(j)%group == v%group .and. s%variables(j)%name == v%name, j=1, &
               & size(s%variables))]) == 1)
            call check('row '//v%group//' '//v%name//' has a meaning', len(v%meaning) > 0)
            if (v%kind == 'integer' .or. index(v%kind, 'real') > 0) then
               n = index(v%allowed, ' to ')
               call check('row '//v%group//' '//v%name//' has a range', n > 0)
               call read_real(v%allowed(index(v%allowed(:n - 1), ' ') + 1:n - 1), low, outcome(1))
               call read_real(v%allowed(index(v%allowed, ' ', back=.true.) + 1:), high, outcome(2))
               call check('row '//v%group//' '//v%name//' has two ends', &
                  & all(outcome == number_ok) .and. low < high)
            end if
         end associate
      end do
      call check_words(s, 'problem', 'symmetry', crystal_class_names())
      call check_words(s, 'specimen', 'geometry', geometry_names//', '//film_name)
      call check_words(s, 'indenter', 'shape', indenter_names)
      call check_words(s, 'surrogate', 'model', basis_names)
      call check_words(s, 'surrogate', 'truncation', truncation_names)
      call check_words(s, 'design', 'variance_of', acquisition_names)
      call check_words(s, 'measurements', 'modulus_kind', join(modulus_kinds, ', '))
      call check_words(s, 'measurements', 'likelihood', likelihood_names)
      call check_words(s, 'sampler', 'method', sampler_names)
   end subroutine test_schema

   !> The words of a variable are those of the module that owns them, and each is read.
   subroutine check_words(schema, group, name, words)
      type(settings_list_type), intent(in) :: schema
      character(len=*), intent(in) :: group, name, words
      type(entry_type), allocatable :: file(:)
      type(settings_type) :: read
      type(error_type), allocatable :: error
      character(len=:), allocatable :: each(:)
      logical :: known
      integer :: i

      allocate (each, source=split_list(words))
      do i = 1, size(schema%variables)
         if (schema%variables(i)%group == group .and. schema%variables(i)%name == name) exit
      end do
      associate (allowed => schema%variables(i)%allowed)
         call check('the words of '//name, allowed == ''''//join(each, ''', ''')//'''', allowed)
      end associate
      do i = 1, size(each)
         call parse_namelist('&'//group//' '//name//' = '''//trim(each(i))//''' /', &
            & file, error)
         call read_settings(file, '', '', read, error)
         known = .true.
         ! Another variable of the group may be missing.
         if (allocated(error)) known = index(error%line(), 'the variable is missing') > 0
         call check('the word '//trim(each(i)), known)
      end do
      call parse_namelist('&'//group//' '//name//' = ''no_word'' /', file, error)
      call read_settings(file, '', '', read, error)
      call check_refused('no word of '//name, error, 'is not known')
   end subroutine check_words

   !> Values, defaults and what is unset, as components of the types.
   subroutine test_settings()
      type(crystal_class_type) :: class
      type(entry_type), allocatable :: file(:)
      type(settings_type) :: s
      type(error_type), allocatable :: error

      call parse_namelist('&execution /', file, error)
      call read_settings(file, '', '', s, error)
      call check('defaults', s%specimen%geometry == 'halfspace' .and. nint(s%indenter%radius_um) &
         & == 16 .and. .not. s%simulation%given .and. s%design%budget == 40)
      call check('unset without default', .not. allocated(s%prior%c_min) &
         & .and. .not. allocated(s%problem%symmetry))
      call parse_namelist('&problem symmetry = ''Cubic'' / &prior c_max = 3*250 / ' &
         & //'&knowledge quantity = ''C11'', ''C12/C11'' mean = 2*1.5 sd = 1 2 / &simulation vtu ' &
         & //'= t extrapolate = .f. depths = 3 /', file, error)
      call check_success('a file', error)
      call read_settings(file, 'build', 'problem design', s, error)
      call check_success('its settings', error)
      call check('a word in lower case', s%problem%symmetry == 'cubic')
      call check('one bound alone', .not. allocated(s%prior%c_min) .and. size(s%prior%c_max) == 3)
      call check('lists', s%knowledge%quantity(2) == 'C12/C11' .and. size(s%knowledge%mean) == 2 &
         & .and. nint(s%knowledge%sd(2)) == 2)
      call check('numbers and logicals', s%simulation%vtu .and. .not. s%simulation%extrapolate &
         & .and. s%simulation%depths == 3)
      call check('groups that are given', s%simulation%given .and. s%prior%given &
         & .and. .not. s%design%given)
      call read_settings(file, 'extract', 'problem measurements', s, error)
      call check_refused('a group that is needed', error, &
         & '&measurements: the group is missing; extract needs it')
      call parse_namelist('&prior c_max = 3*250 /', file, error)
      call read_settings(file, '', '', s, error)
      call check_settings(s, class, error)
      call check_refused('constants of no class', error, '&problem symmetry')
   end subroutine test_settings
end program test_input
