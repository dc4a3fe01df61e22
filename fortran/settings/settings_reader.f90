!> The values of the settings: those of a namelist, checked one by one, or the defaults.
!>
!> A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
!>
!> The module also writes the settings as a namelist and as named values.
module settings_reader
   use errors, only: error_type, refuse, suggestion
   use files, only: printable
   use kinds, only: wp
   use named_values, only: named_values_type
   use namelist_file, only: entry_type, find_entry, value_type
   use settings_list, only: is_text, longest_item, settings_list_type, text_values, variable_type
   use settings_schema, only: list_settings, set_settings, settings_type
   use text, only: lower, newline, number_malformed, number_ok, quoted, read_real, to_text
   implicit none
   private
   public :: read_settings, settings_namelist, put_settings, put_variables, variables_text

   !> Longest text, bytes.
   integer, parameter :: longest_text = 512

contains

   !> Read the settings of a namelist. `needed` lists the groups, separated by blanks, that
   !> `command` needs. `command` is '' if tables are passed as arrays; then no file is required.
   subroutine read_settings(file, command, needed, settings, error)
      type(entry_type), intent(in) :: file(:)
      character(len=*), intent(in) :: command, needed
      type(settings_type), intent(out) :: settings
      type(error_type), allocatable, intent(out) :: error
      type(settings_list_type) :: list
      type(error_type), allocatable :: missing
      character(len=:), allocatable :: reason
      integer :: i

      list = list_settings(settings)
      call check_names()
      if (allocated(error)) return
      list%groups%given = [(find_entry(file, list%groups(i)%name, '') > 0, i=1, size(list%groups))]
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            call read_variable(file, v, error)
            if (allocated(error)) return
            ! Report wrong values before missing ones.
            if (allocated(v%values) .or. allocated(missing) .or. v%default /= '*') cycle
            if (len(command) == 0 .and. v%kind == 'file') cycle
            ! Measurements may be missing: curves give them, a plan invents them, and speeds replace
            ! them.
            if (v%group == 'measurements' .and. find_entry(file, 'curves', '') + find_entry(file, &
               & 'plan', '') + find_entry(file, 'measurements', 'velocities') > 0) then
               cycle
            end if
            if (find_entry(file, v%group, '') > 0) then
               call refuse(missing, 'the variable is missing; '//v%meaning//allowed_part(v), &
                  & v%group, v%name)
            else if (index(' '//needed//' ', ' '//v%group//' ') > 0) then
               reason = command
               if (v%group == 'problem') reason = 'every file'
               call refuse(missing, 'the group is missing; '//reason//' needs it', v%group)
            end if
         end associate
      end do
      call move_alloc(missing, error)
      call set_settings(list, settings)

   contains

      !> Refuse unknown groups and variables, and suggest the name that was probably meant.
      subroutine check_names()
         character(len=:), allocatable :: names, hint
         integer :: i, j

         names = ''
         do j = 1, size(list%groups)
            names = names//', &'//list%groups(j)%name
         end do
         do i = 1, size(file)
            if (index(names//',', ', &'//file(i)%group//',') > 0) cycle
            call refuse(error, 'unknown group'//suggestion('&'//file(i)%group, names(3:)) &
               & //'; allowed: '//names(3:), file(i)%group)
            return
         end do
         do i = 1, size(file)
            associate (entry => file(i))
               names = ''
               hint = ''
               do j = size(list%variables), 1, -1
                  associate (v => list%variables(j))
                     if (v%group == entry%group) names = ', '//v%name//names
                     if (v%name /= entry%name) cycle
                     hint = ', did you mean '//v%name//' of &'//v%group//'?'
                  end associate
               end do
               if (len(entry%name) == 0 .or. index(names//',', ', '//entry%name//',') > 0) cycle
               if (len(suggestion(entry%name, names(3:))) > 0) then
                  hint = suggestion(entry%name, names(3:))
               end if
               call refuse(error, 'unknown variable'//hint//'; allowed: '//names(3:), &
                  & entry%group, entry%name)
               return
            end associate
         end do
      end subroutine check_names
   end subroutine read_settings

   !> Take the values of the file, checked, or the default; unallocated if the variable is unset.
   subroutine read_variable(file, v, error)
      type(entry_type), intent(in) :: file(:)
      type(variable_type), intent(inout) :: v
      type(error_type), allocatable, intent(out) :: error
      !> What is wrong, '' for nothing.
      character(len=:), allocatable :: message
      integer :: i, j

      if (allocated(v%values)) deallocate (v%values)
      i = find_entry(file, v%group, v%name)
      if (i == 0) then
         if (v%default /= '*' .and. v%default /= 'unset') then
            v%values = text_values([v%default])
         end if
         return
      end if
      v%values = file(i)%values
      message = ''
      if (v%shape == 'one' .and. size(v%values) > 1) then
         message = to_text(size(v%values))//' values; one is needed' &
            & //allowed_part(v)
      end if
      do j = 1, size(v%values)
         if (len(message) > 0) exit
         if (is_text(v)) then
            call check_text(v%values(j))
         else
            call check_number(v%values(j))
         end if
      end do
      if (len(message) == 0) return
      call refuse(error, message, v%group, v%name)

   contains

      !> Check a text in quotes; the words of a choice become lower case.
      subroutine check_text(value)
         type(value_type), intent(inout) :: value
         integer :: i, longest

         longest = merge(longest_item, longest_text, v%shape == 'list')
         associate (string => value%text)
            if (.not. value%quoted) then
               message = printable(string)//' is not in quotes; a text is needed'//allowed_part(v)
               ! The first bytes of these signs in UTF-8.
               if (index(string, char(226)//char(128)) == 1) then
                  message = 'curly quotes stand around '//printable(string) &
                     & //'; straight quotes are needed, ''..'''
               end if
            else if (len(string) > longest) then
               message = 'the text has '//to_text(len(string))//' bytes ('''//printable(string) &
                  & //'''); at most '//to_text(longest)//' are allowed'
            else if (any([(iachar(string(i:i)) < 32, i=1, len(string))])) then
               message = ''''//printable(string)//''' holds a control character; plain text is ' &
                  & //'allowed'
            else if (v%kind == 'file' .and. len_trim(string) == 0) then
               message = 'the name of the file is empty'
            else if (index(v%kind, 'choice') > 0 .and. string /= v%default) then
               if (index(v%allowed, ''''//lower(string)//'''') > 0) then
                  string = lower(string)
               else if (v%kind == 'choice' .or. index(string, '.') == 0) then
                  message = ''''//printable(string)//''' is not known'//allowed_part(v)
               end if
            end if
         end associate
      end subroutine check_text

      !> Check that a number is finite and in its range; a logical becomes .true. or .false.
      subroutine check_number(value)
         type(value_type), intent(inout) :: value
         character(len=:), allocatable :: noun
         real(wp) :: number
         integer :: outcome

         noun = trim(merge('an integer', merge('a logical ', 'a number  ', v%kind == 'logical'), &
            & v%kind == 'integer'))
         if (value%quoted) then
            message = 'the text '''//printable(value%text)//''' stands where '//noun//' is needed'
         else if (v%kind == 'logical') then
            select case (lower(value%text))
            case ('.true.', '.t.', 'true', 't')
               value%text = '.true.'
            case ('.false.', '.f.', 'false', 'f')
               value%text = '.false.'
            case default
               message = printable(value%text)//' is not '//noun
            end select
         else
            call read_real(value%text, number, outcome)
            if (outcome == number_malformed &
               & .or. (v%kind == 'integer' .and. abs(number - anint(number)) > 0.0_wp)) then
               message = printable(value%text)//' is not '//noun
            else if (outcome /= number_ok .and. verify(value%text, '+-0123456789') > 0) then
               message = printable(value%text)//' is not a finite number'
            else if (outcome /= number_ok .or. .not. in_range(number, v%allowed)) then
               message = printable(value%text)//' is out of range'
            else if (v%kind == 'integer') then
               value%text = to_text(nint(number))
            end if
         end if
         if (len(message) > 0) message = message//allowed_part(v)
      end subroutine check_number
   end subroutine read_variable

   pure function allowed_part(v) result(allowed)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: allowed

      allowed = ''
      if (len(v%allowed) > 0) allowed = '; allowed '//v%allowed
      if (len(allowed) > 0 .and. len(v%unit) > 0) allowed = allowed//' '//v%unit
   end function allowed_part

   !> Whether `number` is in a range such as '0 to below 1'.
   pure logical function in_range(number, range)
      real(wp), intent(in) :: number
      character(len=*), intent(in) :: range
      real(wp) :: low, high
      integer :: middle, outcome

      middle = index(range, ' to ')
      call read_real(range(index(range(:middle - 1), ' ') + 1:middle - 1), low, outcome)
      call read_real(range(index(range, ' ', back=.true.) + 1:), high, outcome)
      in_range = (number > low .or. (index(range, 'above') == 0 .and. .not. number < low)) &
         & .and. (number < high .or. (index(range, 'below') == 0 .and. .not. number > high))
   end function in_range

   !> The groups of the list `needed`, separated by blanks, as namelists; numbers have all digits.
   function settings_namelist(settings, needed) result(page)
      type(settings_type), intent(in) :: settings
      character(len=*), intent(in) :: needed
      character(len=:), allocatable :: page
      type(settings_list_type) :: list
      integer :: i, j

      list = list_settings(settings)
      page = ''
      do i = 1, size(list%groups)
         if (index(' '//needed//' ', ' '//list%groups(i)%name//' ') == 0) cycle
         page = page//newline//'&'//list%groups(i)%name//newline
         do j = 1, size(list%variables)
            if (list%variables(j)%group == list%groups(i)%name) then
               page = page//line_of(list%variables(j))//newline
            end if
         end do
         page = page//'/'//newline
      end do
   end function settings_namelist

   !> The line of a variable in a namelist.
   function line_of(variable) result(line)
      type(variable_type), intent(in) :: variable
      character(len=:), allocatable :: line
      integer :: i

      if (.not. allocated(variable%values)) then
         line = '  ! '//variable%name//' is unset'
         return
      end if
      line = '  '//variable%name//' = '
      do i = 1, size(variable%values)
         if (i > 1) line = line//', '
         if (is_text(variable)) line = line//quoted(variable%values(i)%text, '''')
         if (.not. is_text(variable)) line = line//variable%values(i)%text
      end do
      if (len(variable%unit) > 0) line = line//' ! '//variable%unit
   end function line_of

   !> Add all settings to named values, as 'group.variable', each a list of texts; unset variables
   !> are omitted.
   subroutine put_settings(settings, values)
      type(settings_type), intent(in) :: settings
      type(named_values_type), intent(inout) :: values
      type(settings_list_type) :: list
      integer :: i

      list = list_settings(settings)
      do i = 1, size(list%groups)
         call values%put(list%groups(i)%name//'.given', list%groups(i)%given)
      end do
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            if (allocated(v%values)) call values%put(v%group//'.'//v%name, v%values%line_type)
         end associate
      end do
   end subroutine put_settings

   !> Add each property of all variables to named values, as a list of texts, one a variable.
   subroutine put_variables(values)
      type(named_values_type), intent(inout) :: values
      character(len=*), parameter :: properties(*) = [character(len=13) :: 'group', &
         & 'group_meaning', 'name', 'kind', 'shape', 'unit', 'default', 'allowed', 'meaning']
      integer, parameter :: longest = 1024
      character(len=longest), allocatable :: texts(:, :)
      type(settings_type) :: unset
      type(settings_list_type) :: list
      integer :: i

      list = list_settings(unset)
      allocate (texts(size(list%variables), size(properties)))
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            texts(i, :) = [character(len=longest) :: v%group, v%group_meaning, v%name, v%kind, &
               & v%shape, v%unit, v%default, v%allowed, v%meaning]
         end associate
      end do
      do i = 1, size(properties)
         call values%put(trim(properties(i)), texts(:, i))
      end do
   end subroutine put_variables

   !> All variables, a line each: group, name, default, kind and meaning.
   function variables_text() result(page)
      character(len=:), allocatable :: page
      type(settings_type) :: unset
      type(settings_list_type) :: list
      integer :: i

      list = list_settings(unset)
      page = ''
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            page = page//newline//'&'//v%group//' '//v%name//' = '//v%default//' ('//v%kind &
               & //'): '//v%meaning
         end associate
      end do
      page = page(2:)
   end function variables_text

end module settings_reader
