!> The values of the settings: those of a namelist, checked one by one, or the defaults.
!>
!> A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
module settings_reader
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use kinds, only: wp
   use namelist_file, only: namelist_file_type, place, value_type
   use numbers, only: number_malformed, number_ok, read_real
   use settings_groups, only: longest_item, settings_type
   use settings_lists, only: new_schema, schema_type
   use settings_schema, only: visit_settings
   use settings_visitor, only: allowed_in_words, choice_list_type, is_text, kind_choice, kind_file, kind_integer, &
      & kind_logical, kind_source, settings_visitor_type, shape_list, shape_one, variable_type
   use spelling, only: suggestion
   use text, only: lower, to_text
   implicit none
   private
   public :: read_settings

   type, extends(settings_visitor_type) :: reader_type
      !> For messages: the path of the file, or the Python function whose keywords these are.
      character(len=:), allocatable :: path
      type(namelist_file_type) :: namelist
      !> What the settings are for, '' if only for what is given; the groups that this needs, each between blanks.
      character(len=:), allocatable :: command, needed
      logical :: given = .false.
      type(error_type), allocatable :: error, missing
   contains
      procedure :: begin_group => begin_group
      procedure :: visit => read_variable
   end type reader_type

   !> Longest text, bytes.
   integer, parameter :: longest_text = 512
   !> Of an integer, a real, a logical.
   character(len=10), parameter :: nouns(3) = [character(len=10) :: 'an integer', 'a number', 'a logical']

contains

   !> Read the settings of a namelist. `needed`: groups that are as if given, separated by blanks, because of `command`, which is ''
   !> where tables come as arrays, so that no file is required.
   subroutine read_settings(path, file, command, needed, choices, settings, error)
      character(len=*), intent(in) :: path
      type(namelist_file_type), intent(in) :: file
      character(len=*), intent(in) :: command, needed
      type(choice_list_type), intent(in) :: choices(:)
      type(settings_type), intent(out) :: settings
      type(error_type), allocatable, intent(out) :: error
      type(reader_type) :: reader

      call check_names(path, file, new_schema(choices), error)
      if (allocated(error)) return
      reader%path = path
      reader%namelist = file
      reader%command = command
      reader%needed = ' '//needed//' '
      reader%choices = choices
      call visit_settings(reader, settings)
      if (.not. allocated(reader%error)) call move_alloc(reader%missing, reader%error)
      call move_alloc(reader%error, error)
   end subroutine read_settings

   !> Every group and variable of the file is in the schema; else what was probably meant.
   subroutine check_names(path, file, schema, error)
      !> For messages.
      character(len=*), intent(in) :: path
      type(namelist_file_type), intent(in) :: file
      type(schema_type), intent(in) :: schema
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: names, near
      integer :: i, j

      do i = 1, size(file%groups)
         if (schema%find_group(file%groups(i)%text) > 0) cycle
         names = ''
         do j = 1, size(schema%groups)
            names = names//', &'//schema%groups(j)%name
         end do
         call raise(error, place(path, file%groups(i)%text, '')//'unknown group' &
            & //suggestion('&'//file%groups(i)%text, names(3:))//'; allowed: '//names(3:), exit_bad_input)
         return
      end do
      do i = 1, size(file%entries)
         associate (entry => file%entries(i))
            names = ''
            near = ''
            do j = 1, size(schema%variables)
               associate (v => schema%variables(j))
                  if (v%group == entry%group .and. v%name == entry%name) exit
                  if (v%group == entry%group) names = names//', '//v%name
                  if (v%name == entry%name .and. len(near) == 0) near = ', did you mean '//v%name//' of &'//v%group//'?'
               end associate
            end do
            if (j <= size(schema%variables)) cycle
            if (len(suggestion(entry%name, names(3:))) > 0) near = suggestion(entry%name, names(3:))
            call raise(error, place(path, entry%group, entry%name)//'unknown variable'//near//'; allowed: '//names(3:), &
               & exit_bad_input)
            return
         end associate
      end do
   end subroutine check_names

   subroutine begin_group(self, given)
      class(reader_type), intent(inout) :: self
      logical, intent(inout) :: given
      integer :: i

      self%given = any([(self%namelist%groups(i)%text == self%group_name, i=1, size(self%namelist%groups))])
      given = self%given
   end subroutine begin_group

   !> The values of the file, checked, or the default; unallocated: unset, or refused.
   subroutine read_variable(self, variable, values)
      class(reader_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(inout) :: values(:)
      character(len=:), allocatable :: message
      integer :: i, j

      if (allocated(values)) deallocate (values)
      if (allocated(self%error)) return
      do i = 1, size(self%namelist%entries)
         associate (entry => self%namelist%entries(i))
            if (entry%group /= variable%group .or. entry%name /= variable%name) cycle
            values = entry%values
         end associate
         message = ''
         if (variable%shape == shape_one .and. size(values) > 1) message = to_text(size(values))//' values; one is needed' &
            & //allowed_part(variable)
         do j = 1, size(values)
            if (len(message) > 0) exit
            if (is_text(variable)) then
               call check_text(variable, values(j), message)
            else
               call check_number(variable, values(j), message)
            end if
         end do
         if (len(message) == 0) return
         call raise(self%error, place(self%path, variable%group, variable%name)//message, exit_bad_input)
         deallocate (values)
         return
      end do
      if (variable%default == '*') then
         call note_missing(self, variable)
      else if (variable%default /= 'unset') then
         allocate (values(1))
         values(1)%text = variable%default
      end if
   end subroutine read_variable

   !> What is there and wrong comes before what is not there.
   subroutine note_missing(self, variable)
      class(reader_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      character(len=:), allocatable :: reason

      if (allocated(self%missing) .or. (len(self%command) == 0 .and. variable%kind == kind_file)) return
      if (self%given) then
         call raise(self%missing, place(self%path, variable%group, variable%name)//'the variable is missing; ' &
            & //variable%meaning//allowed_part(variable), exit_bad_input)
      else if (index(self%needed, ' '//variable%group//' ') > 0) then
         reason = self%command
         if (variable%group == 'problem') reason = 'every file'
         call raise(self%missing, place(self%path, variable%group, '')//'the group is missing; '//reason//' needs it', &
            & exit_bad_input)
      end if
   end subroutine note_missing

   !> A text in quotes; words in lower case.
   subroutine check_text(v, value, message)
      type(variable_type), intent(in) :: v
      type(value_type), intent(inout) :: value
      character(len=:), allocatable, intent(inout) :: message
      integer :: i, longest

      longest = merge(longest_item, longest_text, v%shape == shape_list)
      associate (string => value%text)
         if (.not. value%quoted) then
            message = printable(string)//' is not in quotes; a text is needed'//allowed_part(v)
         else if (len(string) > longest) then
            message = 'the text has '//to_text(len(string))//' bytes ('''//printable(string)//'''); at most ' &
               & //to_text(longest)//' are allowed'
         else if (any([(iachar(string(i:i)) < 32, i=1, len(string))])) then
            message = ''''//printable(string)//''' holds a control character; plain text is allowed'
         else if (v%kind == kind_file .and. len_trim(string) == 0) then
            message = 'the name of the file is empty'
         else if (any(v%kind == [kind_choice, kind_source]) .and. string /= v%default) then
            if (index(', '//v%allowed//',', ', '//lower(string)//',') > 0) then
               string = lower(string)
            else if (v%kind == kind_choice .or. index(string, '.') == 0) then
               message = ''''//printable(string)//''' is not known'//allowed_part(v)
            end if
         end if
      end associate
   end subroutine check_text

   !> A finite number in its range; a logical as .true. or .false.
   subroutine check_number(v, value, message)
      type(variable_type), intent(in) :: v
      type(value_type), intent(inout) :: value
      character(len=:), allocatable, intent(inout) :: message
      real(wp) :: number
      integer :: outcome
      logical :: whole

      if (value%quoted) then
         message = 'the text '''//printable(value%text)//''' stands where '//trim(nouns(v%kind))//' is needed'//allowed_part(v)
         return
      end if
      if (v%kind == kind_logical) then
         select case (lower(value%text))
         case ('.true.', '.t.', 'true', 't')
            value%text = '.true.'
         case ('.false.', '.f.', 'false', 'f')
            value%text = '.false.'
         case default
            message = printable(value%text)//' is not a logical'//allowed_part(v)
         end select
         return
      end if
      call read_real(value%text, number, outcome)
      whole = verify(value%text, '+-0123456789') == 0
      if (outcome == number_malformed .or. (outcome == number_ok .and. v%kind == kind_integer .and. .not. whole)) then
         message = printable(value%text)//' is not '//trim(nouns(v%kind))//allowed_part(v)
      else if (outcome /= number_ok .and. .not. whole) then
         message = printable(value%text)//' is not a finite number'//allowed_part(v)
      else if (outcome /= number_ok .or. .not. in_interval(number, v%allowed)) then
         message = printable(value%text)//' is out of range'//allowed_part(v)
      end if
   end subroutine check_number

   function allowed_part(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      words = allowed_in_words(v)
      if (len(words) == 0) return
      words = '; allowed '//words
      if (len(v%unit) > 0) words = words//' '//v%unit
   end function allowed_part

   !> Whether `number` is in an interval such as '[0, 1)'.
   pure logical function in_interval(number, interval)
      real(wp), intent(in) :: number
      character(len=*), intent(in) :: interval
      real(wp) :: low, high
      integer :: comma, n, outcome

      comma = index(interval, ',')
      n = len(interval)
      call read_real(interval(2:comma - 1), low, outcome)
      call read_real(trim(adjustl(interval(comma + 1:n - 1))), high, outcome)
      in_interval = (number > low .or. (interval(1:1) == '[' .and. .not. number < low)) &
         & .and. (number < high .or. (interval(n:) == ']' .and. .not. number > high))
   end function in_interval
end module settings_reader
