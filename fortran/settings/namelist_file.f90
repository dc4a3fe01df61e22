!> The syntax of namelist files. Text becomes a list of (group, variable, values); messages name
!> the line.
!>
!> gfortran's own namelist READ reports a missing group, a missing slash and a wrong type all as end
!> of file, and accepts duplicates and NaN silently. This parser handles syntax only;
!> `settings_schema` defines the meaning of the names.
module namelist_file
   use errors, only: error_type, prefix_error, refuse_input => refuse
   use files, only: printable
   use text, only: line_type, lower, newline, read_integer, to_text
   implicit none
   private
   public :: entry_type, value_type, parse_namelist, find_entry

   !> One value as written: a quoted text without its quotes, or an unquoted word.
   type, extends(line_type) :: value_type
      logical :: quoted = .false.
   end type value_type

   !> `name = values` of a group; names are in lower case. The entry of the group itself, which may
   !> be empty, has the name '' and no values.
   type :: entry_type
      character(len=:), allocatable :: group, name
      integer :: line = 0
      type(value_type), allocatable :: values(:)
   end type entry_type

   !> The entries that have been read, the position of the parser, and its group and variable ('':
   !> none).
   type :: parser_type
      type(entry_type), allocatable :: file(:)
      character(len=:), allocatable :: text, group, name
      integer :: position = 1, line = 1
      type(error_type), allocatable :: error
   end type parser_type

   character(len=*), parameter :: blanks = ' '//achar(9)//achar(13)
   character(len=*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_'
   !> Upper bounds, checked before memory is allocated: more repetitions and values than any array
   !> of the program has elements; more groups and variables than any input has.
   integer, parameter :: most_repeats = 10000, most_values = most_repeats, most_names = 2000

contains

   !> The last index of a variable among entries, or of a group if `name` is ''; 0 if it is missing.
   pure integer function find_entry(entries, group, name) result(i)
      type(entry_type), intent(in) :: entries(:)
      character(len=*), intent(in) :: group, name

      do i = size(entries), 1, -1
         if (entries(i)%group == group .and. entries(i)%name == name) return
      end do
   end function find_entry

   !> Parse the content of a file.
   subroutine parse_namelist(content, file, error)
      character(len=*), intent(in) :: content
      type(entry_type), allocatable, intent(out) :: file(:)
      type(error_type), allocatable, intent(out) :: error
      type(parser_type) :: parser

      parser%text = content//newline
      ! Line ends of old Macintoshes.
      if (index(content, newline) == 0) then
         do while (index(parser%text, achar(13)) > 0)
            parser%text(index(parser%text, achar(13)):index(parser%text, achar(13))) = newline
         end do
      end if
      parser%group = ''
      parser%name = ''
      allocate (parser%file(0))
      do
         call skip_blanks(parser)
         if (allocated(parser%error) .or. peek(parser) == '') exit
         call parse_group(parser)
      end do
      call move_alloc(parser%file, file)
      call move_alloc(parser%error, error)
      if (.not. allocated(error) .and. size(file) == 0) then
         call refuse_input(error, 'the file holds no namelist group, only comments')
      end if
   end subroutine parse_namelist

   subroutine parse_group(parser)
      type(parser_type), intent(inout) :: parser
      character(len=:), allocatable :: name, reason
      type(entry_type) :: entry
      integer :: line

      line = parser%line
      if (peek(parser) /= '&') then
         ! The message does not quote the text: the file may be no namelist, and confidential.
         reason = 'text stands before the first group; a group begins with &name'
         if (len(parser%group) > 0) then
            reason = rest_of_line(parser)//' follows the / that ends the group; &name begins the ' &
               & //'next one (a text that holds / must be in quotes)'
         end if
         call refuse(parser, reason, line)
         return
      end if
      parser%position = parser%position + 1
      parser%group = ''
      call read_name(parser, name)
      if (len(name) == 0) call refuse(parser, '& is not followed by the name of a group', line)
      if (name == 'end') call refuse(parser, '&end without a group to end', line)
      if (allocated(parser%error)) return
      parser%group = name
      entry%group = name
      entry%name = ''
      entry%line = line
      call add_entry(parser, entry)
      if (allocated(parser%error)) return
      if (index(blanks//newline//'/!', peek(parser)) == 0) then
         call refuse(parser, 'a blank must follow the name of a group, not ' &
            & //rest_of_line(parser), line)
      end if
      do while (.not. allocated(parser%error))
         call skip_blanks(parser)
         select case (peek(parser))
         case ('/')
            parser%position = parser%position + 1
            call skip_tail(parser)
            return
         case ('&', '')
            parser%position = parser%position + 1
            call read_name(parser, name)
            if (name == 'end') return
            call refuse(parser, 'the / that ends the group is missing (the group begins on line ' &
               & //to_text(line)//')')
         case (',')
            call refuse(parser, 'a comma where a name must be', parser%line)
         case default
            call parse_entry(parser)
         end select
      end do
   end subroutine parse_group

   !> Skip the text that a blank separates from the / before it, to the end of the line. It must
   !> begin no group and set no variable.
   subroutine skip_tail(parser)
      type(parser_type), intent(inout) :: parser
      character(len=:), allocatable :: rest
      integer :: length

      length = index(parser%text(parser%position:), newline) - 1
      rest = parser%text(parser%position:parser%position + length - 1)
      if (index(blanks, peek(parser)) > 0 .and. scan(rest, '=&') == 0) then
         parser%position = parser%position + length
      end if
   end subroutine skip_tail

   !> Parse `name = value, value ...`, or a part of a list: `name(2) = value`.
   subroutine parse_entry(parser)
      type(parser_type), intent(inout) :: parser
      type(entry_type) :: entry
      character(len=:), allocatable :: rest
      integer :: first, i

      first = 0
      entry%group = parser%group
      entry%line = parser%line
      rest = rest_of_line(parser)
      call read_name(parser, entry%name)
      parser%name = entry%name
      call skip_blanks(parser)
      if (peek(parser) == '(') call read_subscript(parser, entry%line, first)
      if (len(entry%name) == 0) then
         call refuse(parser, rest//' is not understood; name = value is needed', entry%line)
      else if (peek(parser) /= '=') then
         call refuse(parser, &
            & 'no = after the name in '//rest//'; name = value is needed', entry%line)
      end if
      if (allocated(parser%error)) return
      parser%position = parser%position + 1
      call parse_values(parser, entry)
      i = 0
      if (first > 1) i = find_entry(parser%file, entry%group, entry%name)
      if (i > 0) then
         if (first == size(parser%file(i)%values) + 1) then
            parser%file(i)%values = [parser%file(i)%values, entry%values]
         else
            i = 0
         end if
      end if
      if (first > 1 .and. i == 0) then
         call refuse(parser, 'the subscript '//to_text(first)//' does not follow the one before; ' &
            & //'give all values at once: '//printable(entry%name)//' = a, b, c', entry%line)
      end if
      ! A null value leaves the default.
      if (i == 0 .and. size(entry%values) > 0) call add_entry(parser, entry)
      parser%name = ''
   end subroutine parse_entry

   !> Read a subscript, '(2)' or '(2:4)'.
   subroutine read_subscript(parser, line, first)
      type(parser_type), intent(inout) :: parser
      integer, intent(in) :: line
      !> The subscript of the first value.
      integer, intent(out) :: first
      integer :: length, last, outcome

      length = index(parser%text(parser%position:), ')')
      associate (inside => parser%text(parser%position + 1:parser%position + max(1, length) - 2))
         last = index(inside//':', ':') - 1
         call read_integer(trim(adjustl(inside(:last))), first, outcome)
         if (length == 0 .or. first < 1 .or. first > most_values &
            & .or. verify(inside, '0123456789: ') > 0) then
            call refuse(parser, 'the subscript is not understood; (1) or (1:3) is', line)
         end if
      end associate
      parser%position = parser%position + max(1, length)
      call skip_blanks(parser)
   end subroutine read_subscript

   !> Append a group or a variable; refuse one that is there already.
   subroutine add_entry(parser, entry)
      type(parser_type), intent(inout) :: parser
      type(entry_type), intent(in) :: entry
      integer :: i

      i = find_entry(parser%file, entry%group, entry%name)
      if (i > 0) then
         call refuse(parser, 'the '//trim(merge('group   ', 'variable', len(entry%name) == 0)) &
            & //' is there twice, on lines '//to_text(parser%file(i)%line)//' and ' &
            & //to_text(entry%line)//'; once is allowed')
      end if
      if (size(parser%file) == most_names) then
         call refuse(parser, 'more than '//to_text(most_names)//' groups and variables')
      end if
      parser%file = [parser%file, entry]
   end subroutine add_entry

   subroutine parse_values(parser, entry)
      type(parser_type), intent(inout) :: parser
      type(entry_type), intent(inout) :: entry
      type(value_type) :: value
      character :: mark
      integer :: length, repeats, start(2), i
      logical :: needs_value, is_null

      allocate (entry%values(0))
      needs_value = .true.
      is_null = .false.
      do while (.not. allocated(parser%error))
         call skip_blanks(parser)
         mark = peek(parser)
         start = [parser%position, parser%line]
         select case (mark)
         case ('', '/', '&')
            exit
         case (',')
            if (needs_value .and. (is_null .or. size(entry%values) > 0)) then
               call refuse(parser, 'a comma without a value before it', parser%line)
            end if
            is_null = needs_value
            needs_value = .true.
            parser%position = parser%position + 1
            cycle
         case ('=', '(')
            call refuse(parser, mark//' where a value must be', parser%line)
         case ('''', '"')
            repeats = 1
            call read_quoted(parser, value)
         case default
            length = scan(parser%text(parser%position:), blanks//newline//',/!&=(''"') - 1
            value%text = parser%text(parser%position:parser%position + length - 1)
            parser%position = parser%position + length
            ! The word is the name of the next variable if = or a subscript follows it.
            if (index(letters, mark) > 0) call skip_blanks(parser)
            if (index(letters, mark) > 0 .and. index('=(', peek(parser)) > 0) then
               parser%position = start(1)
               parser%line = start(2)
               exit
            end if
            call split_repeats(parser, value, repeats)
         end select
         if (is_null) call refuse(parser, 'a comma without a value before it', start(2))
         if (allocated(parser%error)) return
         if (size(entry%values) + repeats > most_values) then
            call refuse(parser, 'more than '//to_text(most_values)//' values')
         end if
         if (allocated(parser%error)) return
         entry%values = [entry%values, (value, i=1, repeats)]
         needs_value = .false.
      end do
      if (size(entry%values) == 0 .and. .not. is_null) then
         call refuse(parser, 'no value follows the =', entry%line)
      end if
   end subroutine parse_values

   !> Remove the count of `3*1.0` or `2*'a'` from a value.
   subroutine split_repeats(parser, value, repeats)
      type(parser_type), intent(inout) :: parser
      type(value_type), intent(inout) :: value
      integer, intent(out) :: repeats
      character(len=:), allocatable :: count
      integer :: star, outcome

      value%quoted = .false.
      repeats = 1
      star = index(value%text, '*')
      count = value%text(:star - 1)
      if (star < 2 .or. verify(count, '0123456789') > 0) return
      call read_integer(count, repeats, outcome)
      if (repeats < 1 .or. repeats > most_repeats) then
         call refuse(parser, 'the repeat count of '//printable(value%text) &
            & //' is out of range; allowed 1 to '//to_text(most_repeats))
      end if
      if (allocated(parser%error)) return
      value%text = value%text(star + 1:)
      if (len(value%text) > 0) return
      if (scan(peek(parser), '''"') > 0) then
         call read_quoted(parser, value)
      else
         call refuse(parser, 'no value follows the repeat count '//count//'*')
      end if
   end subroutine split_repeats

   !> Read a text in quotes of either kind. A doubled quote inside stands for one.
   subroutine read_quoted(parser, value)
      type(parser_type), intent(inout) :: parser
      type(value_type), intent(inout) :: value
      character :: quote
      integer :: n, i

      quote = peek(parser)
      value%quoted = .true.
      n = parser%position
      i = parser%position + 1
      ! The text is moved to the front, over the quotes.
      do while (parser%text(i:i) /= newline)
         if (parser%text(i:i) == quote) then
            i = i + 1
            if (parser%text(i:i) /= quote) then
               value%text = parser%text(parser%position + 1:n)
               parser%position = i
               return
            end if
         end if
         n = n + 1
         parser%text(n:n) = parser%text(i:i)
         i = i + 1
      end do
      call refuse(parser, 'the closing quote is missing', parser%line)
   end subroutine read_quoted

   !> Read a name in lower case: a letter, then letters, digits and underscores; '' if there is
   !> none.
   subroutine read_name(parser, name)
      type(parser_type), intent(inout) :: parser
      character(len=:), allocatable, intent(out) :: name

      name = ''
      if (index(letters, peek(parser)) == 0) return
      name = lower(parser%text(parser%position:parser%position &
         & + verify(parser%text(parser%position:), letters//'0123456789') - 2))
      parser%position = parser%position + len(name)
   end subroutine read_name

   !> Move past blanks, newlines and comments.
   subroutine skip_blanks(parser)
      type(parser_type), intent(inout) :: parser

      do
         parser%position = parser%position - 1 &
            & + max(1, verify(parser%text(parser%position:), blanks))
         select case (peek(parser))
         case (newline)
            parser%line = parser%line + 1
            parser%position = parser%position + 1
         case ('!')
            parser%position = parser%position + index(parser%text(parser%position:), newline) - 1
         case default
            return
         end select
      end do
   end subroutine skip_blanks

   !> The present character; a blank at the end of the text.
   pure character function peek(parser) result(here)
      type(parser_type), intent(in) :: parser

      here = ' '
      if (parser%position <= len(parser%text)) here = parser%text(parser%position:parser%position)
   end function peek

   !> The rest of the line in quotes, for a message.
   pure function rest_of_line(parser) result(rest)
      type(parser_type), intent(in) :: parser
      character(len=:), allocatable :: rest
      integer :: last

      last = parser%position + index(parser%text(parser%position:), newline) - 2
      rest = trim(parser%text(parser%position:last))
      if (index(rest, achar(13), back=.true.) == len(rest)) rest = trim(rest(:len(rest) - 1))
      rest = ''''//printable(rest)//''''
   end function rest_of_line

   !> Record a refusal, unless there is one already.
   subroutine refuse(parser, message, line)
      type(parser_type), intent(inout) :: parser
      character(len=*), intent(in) :: message
      integer, intent(in), optional :: line

      if (allocated(parser%error)) return
      call refuse_input(parser%error, message, parser%group, parser%name)
      if (present(line)) call prefix_error(parser%error, 'line '//to_text(line)//': ')
   end subroutine refuse
end module namelist_file
