!> The syntax of namelist files. Text becomes a list of (group, variable, values); messages name
!> file, group and line.
!>
!> gfortran's own namelist READ reports a missing group, a missing slash and a wrong type all as end
!> of file, and accepts duplicates and NaN silently. This parser handles syntax only;
!> `settings_schema` defines the meaning of the names.
module namelist_file
   use errors, only: error_type, exit_bad_input, prefix_error, raise, warning_type
   use files, only: printable, read_text_file
   use text, only: lower, newline, read_integer, to_text
   implicit none
   private
   public :: entry_type, value_type, read_namelist_file, replace_entries, parse_namelist, &
      & find_entry, place

   !> One value as written: a quoted text without its quotes, or an unquoted word.
   type, extends(warning_type) :: value_type
      logical :: quoted = .false.
   end type value_type

   !> `name = values` of a group; names are in lower case. The entry of the group itself, which may
   !> be empty, has the name '' and no values.
   type :: entry_type
      character(len=:), allocatable :: group, name
      integer :: line = 0
      type(value_type), allocatable :: values(:)
   end type entry_type

   character(len=*), parameter :: blanks = ' '//achar(9)//achar(13)
   character(len=*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_'
   !> Upper bounds, checked before memory is allocated: more repetitions and values than any array
   !> of the program has elements; more groups and variables than any input has.
   integer, parameter :: most_repeats = 10000, most_values = most_repeats, most_names = 2000

contains

   !> 'FILE: &group name: ', the beginning of every message about an input. Group and name may be
   !> ''.
   pure function place(path, group, name) result(prefix)
      character(len=*), intent(in) :: path, group, name
      character(len=:), allocatable :: prefix

      prefix = path//': '
      if (len(group) == 0) return
      prefix = prefix//'&'//printable(group)
      if (len(name) > 0) prefix = prefix//' '//printable(name)
      prefix = prefix//': '
   end function place

   subroutine read_namelist_file(path, file, error)
      character(len=*), intent(in) :: path
      type(entry_type), allocatable, intent(out) :: file(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content

      call read_text_file(path, content, error)
      call prefix_error(error, path//': ')
      if (allocated(error)) return
      call parse_namelist(path, content, file, error)
   end subroutine read_namelist_file

   !> Put the `stated` groups and variables into a file; they replace its own.
   subroutine replace_entries(file, stated)
      type(entry_type), allocatable, intent(inout) :: file(:)
      type(entry_type), intent(in) :: stated(:)
      integer :: i, k

      do i = 1, size(stated)
         k = find_entry(file, stated(i)%group, stated(i)%name)
         if (k > 0) file(k) = stated(i)
         if (k == 0) file = [file, stated(i)]
      end do
   end subroutine replace_entries

   !> The index of a variable among entries, or of a group if `name` is ''; 0 if it is missing.
   pure integer function find_entry(entries, group, name) result(i)
      type(entry_type), intent(in) :: entries(:)
      character(len=*), intent(in) :: group, name

      do i = size(entries), 1, -1
         if (entries(i)%group == group .and. entries(i)%name == name) return
      end do
   end function find_entry

   !> Parse the content of a file; `path` is for messages.
   subroutine parse_namelist(path, content, file, error)
      character(len=*), intent(in) :: path, content
      type(entry_type), allocatable, intent(out) :: file(:)
      type(error_type), allocatable, intent(out) :: error
      !> The content with a newline at its end; the present group and variable, '' for none.
      character(len=:), allocatable :: text, group, variable
      integer :: position, line

      text = content//newline
      group = ''
      variable = ''
      position = 1
      line = 1
      allocate (file(0))
      do
         call skip_blanks()
         if (allocated(error) .or. peek() == '') exit
         call parse_group()
      end do
      if (.not. allocated(error) .and. size(file) == 0) then
         call raise(error, path//': the file holds no namelist group, only comments', &
            & exit_bad_input)
      end if

   contains

      subroutine parse_group()
         character(len=:), allocatable :: name, reason
         type(entry_type) :: entry
         integer :: begin

         begin = line
         if (peek() /= '&') then
            ! The message does not quote the text: the file may be no namelist, and confidential.
            reason = 'text stands before the first group; a group begins with &name'
            if (len(group) > 0) then
               reason = rest_of_line()//' follows the / that ends the group; &name begins the ' &
                  & //'next one (a text that holds / must be in quotes)'
            end if
            call refuse(reason, begin)
            return
         end if
         position = position + 1
         group = ''
         call read_name(name)
         if (len(name) == 0) call refuse('& is not followed by the name of a group', begin)
         if (name == 'end') call refuse('&end without a group to end', begin)
         if (allocated(error)) return
         group = name
         entry%group = name
         entry%name = ''
         entry%line = begin
         call add_entry(entry)
         if (allocated(error)) return
         if (index(blanks//newline//'/!', peek()) == 0) then
            call refuse('a blank must follow the name of a group, not '//rest_of_line(), begin)
         end if
         do while (.not. allocated(error))
            call skip_blanks()
            select case (peek())
            case ('/')
               position = position + 1
               return
            case ('&', '')
               position = position + 1
               call read_name(name)
               if (name == 'end') return
               call refuse('the / that ends the group is missing (the group begins on line ' &
                  & //to_text(begin)//')')
            case (',')
               call refuse('a comma where a name must be', line)
            case default
               call parse_entry()
            end select
         end do
      end subroutine parse_group

      !> Parse `name = value, value ...`
      subroutine parse_entry()
         type(entry_type) :: entry
         character(len=:), allocatable :: rest

         entry%group = group
         entry%line = line
         rest = rest_of_line()
         call read_name(entry%name)
         variable = entry%name
         call skip_blanks()
         if (len(entry%name) == 0) then
            call refuse(rest//' is not understood; name = value is needed', entry%line)
         else if (scan(peek(), '(%') > 0) then
            call refuse('parts of a variable cannot be set; give all its values: ' &
               & //printable(entry%name)//' = a, b, c', entry%line)
         else if (peek() /= '=') then
            call refuse('no = after the name in '//rest//'; name = value is needed', entry%line)
         end if
         if (allocated(error)) return
         position = position + 1
         call parse_values(entry)
         call add_entry(entry)
         variable = ''
      end subroutine parse_entry

      !> Append a group or a variable; refuse one that is there already.
      subroutine add_entry(entry)
         type(entry_type), intent(in) :: entry
         integer :: i

         i = find_entry(file, entry%group, entry%name)
         if (i > 0) then
            call refuse('the '//trim(merge('group   ', 'variable', len(entry%name) == 0)) &
               & //' is there twice, on lines '//to_text(file(i)%line)//' and ' &
               & //to_text(entry%line)//'; once is allowed')
         end if
         if (size(file) == most_names) then
            call refuse('more than '//to_text(most_names)//' groups and variables')
         end if
         file = [file, entry]
      end subroutine add_entry

      subroutine parse_values(entry)
         type(entry_type), intent(inout) :: entry
         type(value_type) :: value
         character :: mark
         integer :: length, repeats, start(2), i
         logical :: needs_value

         allocate (entry%values(0))
         needs_value = .true.
         do while (.not. allocated(error))
            call skip_blanks()
            mark = peek()
            start = [position, line]
            select case (mark)
            case ('', '/', '&')
               exit
            case (',')
               if (needs_value) call refuse('a comma without a value before it', line)
               needs_value = .true.
               position = position + 1
               cycle
            case ('=')
               call refuse('= where a value must be', line)
            case ('''', '"')
               repeats = 1
               call read_quoted(value)
            case default
               length = scan(text(position:), blanks//newline//',/!&=''"') - 1
               value%text = text(position:position + length - 1)
               position = position + length
               ! The word is the name of the next variable if = or a subscript follows it.
               if (index(letters, mark) > 0) call skip_blanks()
               if (index(letters, mark) > 0 .and. index('=(', peek()) > 0) then
                  position = start(1)
                  line = start(2)
                  exit
               end if
               call split_repeats(value, repeats)
            end select
            if (allocated(error)) return
            if (size(entry%values) + repeats > most_values) then
               call refuse('more than '//to_text(most_values)//' values')
            end if
            if (allocated(error)) return
            entry%values = [entry%values, (value, i=1, repeats)]
            needs_value = .false.
         end do
         if (size(entry%values) == 0) call refuse('no value follows the =', entry%line)
      end subroutine parse_values

      !> Remove the count of `3*1.0` or `2*'a'` from a value.
      subroutine split_repeats(value, repeats)
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
            call refuse('the repeat count of '//printable(value%text) &
               & //' is out of range; allowed 1 to '//to_text(most_repeats))
         end if
         if (allocated(error)) return
         value%text = value%text(star + 1:)
         if (len(value%text) > 0) return
         if (scan(peek(), '''"') > 0) then
            call read_quoted(value)
         else
            call refuse('no value follows the repeat count '//count//'*')
         end if
      end subroutine split_repeats

      !> Read a text in quotes of either kind. A doubled quote inside stands for one.
      subroutine read_quoted(value)
         type(value_type), intent(inout) :: value
         character :: quote
         integer :: n, i

         quote = peek()
         value%quoted = .true.
         n = position
         i = position + 1
         ! The text is moved to the front, over the quotes.
         do while (text(i:i) /= newline)
            if (text(i:i) == quote) then
               i = i + 1
               if (text(i:i) /= quote) then
                  value%text = text(position + 1:n)
                  position = i
                  return
               end if
            end if
            n = n + 1
            text(n:n) = text(i:i)
            i = i + 1
         end do
         call refuse('the closing quote is missing', line)
      end subroutine read_quoted

      !> Read a name in lower case: a letter, then letters, digits and underscores; '' if there is
      !> none.
      subroutine read_name(name)
         character(len=:), allocatable, intent(out) :: name

         name = ''
         if (index(letters, peek()) == 0) return
         name = lower(text(position:position - 2 + verify(text(position:), letters//'0123456789')))
         position = position + len(name)
      end subroutine read_name

      !> Move past blanks, newlines and comments.
      subroutine skip_blanks()

         do
            position = position - 1 + max(1, verify(text(position:), blanks))
            select case (peek())
            case (newline)
               line = line + 1
               position = position + 1
            case ('!')
               position = position + index(text(position:), newline) - 1
            case default
               return
            end select
         end do
      end subroutine skip_blanks

      !> The present character; a blank at the end of the text.
      pure character function peek() result(here)

         here = ' '
         if (position <= len(text)) here = text(position:position)
      end function peek

      !> The rest of the line in quotes, for a message.
      pure function rest_of_line() result(rest)
         character(len=:), allocatable :: rest
         integer :: last

         last = position + index(text(position:), newline) - 2
         rest = trim(text(position:last))
         if (index(rest, achar(13), back=.true.) == len(rest)) rest = trim(rest(:len(rest) - 1))
         rest = ''''//printable(rest)//''''
      end function rest_of_line

      !> Record a refusal, unless there is one already.
      subroutine refuse(message, line)
         character(len=*), intent(in) :: message
         integer, intent(in), optional :: line
         character(len=:), allocatable :: prefix

         if (allocated(error)) return
         prefix = place(path, group, variable)
         if (present(line)) prefix = prefix//'line '//to_text(line)//': '
         call raise(error, prefix//message, exit_bad_input)
      end subroutine refuse
   end subroutine parse_namelist
end module namelist_file
