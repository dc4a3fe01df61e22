!> The values of the settings: those of a namelist, checked one by one, or the defaults.
!>
!> A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
module settings_reader
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use kinds, only: wp
   use namelist_file, only: namelist_file_type, place, value_type
   use numbers, only: number_malformed, number_not_finite, number_ok, read_integer, read_real
   use settings_groups, only: longest_item, settings_type
   use settings_lists, only: new_schema
   use settings_names, only: check_names
   use settings_schema, only: visit_settings
   use settings_visitor, only: allowed_in_words, choice_list_type, is_text, kind_choice, kind_file, kind_integer, &
      & kind_logical, kind_source, settings_visitor_type, shape_constants, shape_list, shape_one, variable_type
   use text, only: join, lower, to_text
   implicit none
   private
   public :: read_settings

   type, extends(settings_visitor_type) :: reader_type
      !> For messages: the path of the file, or the Python function whose keywords these are.
      character(len=:), allocatable :: path
      type(namelist_file_type) :: namelist
      !> What the settings are for, '' if only for what is given; the groups that this needs, each between blanks.
      character(len=:), allocatable :: command, needed
      !> Of the crystals, once its name is read.
      type(crystal_class_type) :: class
      logical :: given = .false.
      type(error_type), allocatable :: error, missing
   contains
      procedure :: begin_group => begin_group
      procedure :: visit => read_variable
      procedure, private :: find_values
      procedure, private :: refuse
   end type reader_type

   !> Longest text, bytes.
   integer, parameter :: longest_text = 512

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

   subroutine begin_group(self, given)
      class(reader_type), intent(inout) :: self
      logical, intent(inout) :: given
      integer :: i

      given = .false.
      do i = 1, size(self%namelist%groups)
         given = given .or. self%namelist%groups(i)%text == self%group_name
      end do
      self%given = given
   end subroutine begin_group

   !> The values of the file, checked one by one, or the default.
   subroutine read_variable(self, variable, values)
      class(reader_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(inout) :: values(:)
      character(len=:), allocatable :: message
      integer :: i

      call self%find_values(variable, values)
      if (.not. allocated(values)) return
      message = ''
      do i = 1, size(values)
         if (is_text(variable)) then
            call check_text(variable, values(i), message)
         else
            call check_number(variable, values(i), message)
         end if
         if (len(message) == 0) cycle
         call self%refuse(variable, message)
         return
      end do
      if (variable%group /= 'problem' .or. variable%name /= 'symmetry') return
      call new_crystal_class(values(1)%text, self%class, self%error)
      ! One name for its synonyms.
      if (.not. allocated(self%error)) values(1)%text = self%class%name
   end subroutine read_variable

   !> The values as written, as many as there must be, or those of the default; unallocated: unset, or refused.
   subroutine find_values(self, variable, values)
      class(reader_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(out) :: values(:)
      character(len=:), allocatable :: reason
      integer :: i

      if (allocated(self%error)) return
      do i = 1, size(self%namelist%entries)
         if (self%namelist%entries(i)%group /= variable%group .or. self%namelist%entries(i)%name /= variable%name) cycle
         values = self%namelist%entries(i)%values
         call check_count(self, variable, values)
         if (allocated(self%error)) deallocate (values)
         return
      end do
      if (variable%default == '*') then
         if (len(self%command) == 0 .and. variable%kind == kind_file) return
         ! What is there and wrong comes before what is not there.
         if (allocated(self%missing)) return
         if (self%given) then
            call raise(self%missing, place(self%path, variable%group, variable%name)//'the variable is missing; ' &
               & //variable%meaning//allowed_part(variable), exit_bad_input)
         else if (index(self%needed, ' '//variable%group//' ') > 0) then
            reason = self%command
            if (variable%group == 'problem') reason = 'every file'
            call raise(self%missing, place(self%path, variable%group, '')//'the group is missing; '//reason//' needs it', &
               & exit_bad_input)
         end if
      else if (variable%default /= 'unset') then
         allocate (values(1))
         values(1)%text = variable%default
         values(1)%quoted = is_text(variable)
      end if
   end subroutine find_values

   !> One value, one for each constant, or any number.
   subroutine check_count(self, variable, values)
      class(reader_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), intent(in) :: values(:)
      character(len=:), allocatable :: found

      found = to_text(size(values))//' values; '
      if (size(values) == 1) found = 'one value; '
      select case (variable%shape)
      case (shape_one)
         if (size(values) /= 1) call self%refuse(variable, found//'one is needed'//allowed_part(variable))
      case (shape_constants)
         if (self%class%n_constants == 0) then
            call self%refuse(variable, 'a value for each constant is needed, and so &problem symmetry')
         else if (size(values) /= size(self%class%constants)) then
            call self%refuse(variable, found//to_text(self%class%n_constants)//' are needed: ' &
               & //join(self%class%constants, ', '))
         end if
      case default
         continue
      end select
   end subroutine check_count

   subroutine refuse(self, variable, message)
      class(reader_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      character(len=*), intent(in) :: message

      call raise(self%error, place(self%path, variable%group, variable%name)//message, exit_bad_input)
   end subroutine refuse

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
      integer :: whole, outcome, other

      if (value%quoted) then
         message = 'the text '''//printable(value%text)//''' stands where '//noun(v)//' is needed'//allowed_part(v)
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
      if (v%kind == kind_integer) then
         other = outcome
         call read_integer(value%text, whole, outcome)
         number = whole
         if (outcome == number_malformed .and. other == number_not_finite) outcome = number_not_finite
      end if
      if (outcome == number_malformed) then
         message = printable(value%text)//' is not '//noun(v)//allowed_part(v)
      else if (outcome /= number_ok .and. verify(value%text, '+-0123456789') > 0) then
         message = printable(value%text)//' is not a finite number'//allowed_part(v)
      else if (outcome /= number_ok .or. .not. in_interval(number, v%allowed)) then
         message = printable(value%text)//' is out of range'//allowed_part(v)
      end if
   end subroutine check_number

   pure function noun(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      select case (v%kind)
      case (kind_integer)
         words = 'an integer'
      case (kind_logical)
         words = 'a logical'
      case default
         words = 'a number'
      end select
   end function noun

   function allowed_part(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      words = allowed_in_words(v)
      if (len(words) == 0) return
      words = '; allowed '//words
      if (len(v%unit) > 0) words = words//' '//v%unit
   end function allowed_part

   !> Whether `number` is in an interval such as '[0, 1)' or '(0, *)'; an empty text admits all.
   pure logical function in_interval(number, interval)
      real(wp), intent(in) :: number
      character(len=*), intent(in) :: interval
      real(wp) :: bound
      integer :: comma, n, outcome

      in_interval = .true.
      n = len(interval)
      if (n == 0) return
      comma = index(interval, ',')
      call read_real(trim(adjustl(interval(2:comma - 1))), bound, outcome)
      if (outcome == number_ok) in_interval = number > bound .or. (interval(1:1) == '[' .and. .not. number < bound)
      call read_real(trim(adjustl(interval(comma + 1:n - 1))), bound, outcome)
      if (outcome == number_ok) in_interval = in_interval &
         & .and. (number < bound .or. (interval(n:n) == ']' .and. .not. number > bound))
   end function in_interval
end module settings_reader
