!> The syntax of namelist files: text to a list of (group, variable, values), with refusals that name file, group and line.
!>
!> gfortran's own namelist READ reports a missing group, a missing slash and a wrong type all as end of file, and passes
!> duplicates and NaN in silence. This parser knows syntax alone; what the names mean is in `namelist_schema`.
module namelist_file
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable, read_text_file
   use numbers, only: read_integer
   use text, only: lower, to_text
   implicit none
   private
   public :: namelist_file_type, entry_type, value_type, read_namelist_file, parse_namelist, place

   !> One value as written: a quoted text without its quotes, or a bare word.
   type :: value_type
      character(len=:), allocatable :: text
      logical :: quoted = .false.
   end type value_type

   !> `name = values` of a group; names in lower case.
   type :: entry_type
      character(len=:), allocatable :: group, name
      integer :: line = 0
      type(value_type), allocatable :: values(:)
   end type entry_type

   type :: name_type
      character(len=:), allocatable :: text
      integer :: line = 0
   end type name_type

   type :: namelist_file_type
      type(entry_type), allocatable :: entries(:)
      !> The groups that are there, empty ones included, in lower case and in the order of the file.
      type(name_type), allocatable :: groups(:)
   end type namelist_file_type

   !> Where the parser stands.
   type :: scanner_type
      character(len=:), allocatable :: path, text
      integer :: at = 1, line = 1
   end type scanner_type

   character, parameter :: newline = achar(10)
   character(len=*), parameter :: blanks = ' '//achar(9)//achar(13)
   character(len=*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_'
   !> More repetitions than any array of ours has elements are refused before they are made.
   integer, parameter :: most_repeats = 10000
   !> Of groups, and of variables: more are no input of ours.
   integer, parameter :: most_names = 2000

contains

   !> 'FILE: &group name: ', the beginning of every message about an input; group and name may be ''.
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
      type(namelist_file_type), intent(out) :: file
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content

      call read_text_file(path, content, error)
      if (allocated(error)) then
         error%message = path//': '//error%message
         return
      end if
      call parse_namelist(path, content, file, error)
   end subroutine read_namelist_file

   !> Parse the content of a file; `path` is for messages.
   subroutine parse_namelist(path, content, file, error)
      character(len=*), intent(in) :: path, content
      type(namelist_file_type), intent(out) :: file
      type(error_type), allocatable, intent(out) :: error
      type(scanner_type) :: scanner
      integer :: entries, groups

      scanner%path = path
      scanner%text = content
      entries = 0
      groups = 0
      allocate (file%entries(32), file%groups(16))
      do
         call skip_blanks(scanner)
         if (peek(scanner) == '') exit
         if (peek(scanner) /= '&') then
            if (groups == 0) then
               call raise(error, path//': line '//to_text(scanner%line)//': '''//printable(rest_of_line(scanner)) &
                  & //''' stands before the first group; a group begins with &name', exit_bad_input)
            else
               call fault(scanner, file%groups(groups)%text, '', 'line '//to_text(scanner%line)//': ''' &
                  & //printable(rest_of_line(scanner))//''' follows the / that ends the group; &name begins the next one' &
                  & //' (a text that holds / must be in quotes)', error)
            end if
            return
         end if
         call parse_group(scanner, file, entries, groups, error)
         if (allocated(error)) return
      end do
      if (groups == 0) then
         call raise(error, path//': the file holds no namelist group, only comments', exit_bad_input)
         return
      end if
      file%entries = file%entries(:entries)
      file%groups = file%groups(:groups)
   end subroutine parse_namelist

   subroutine parse_group(scanner, file, entries, groups, error)
      type(scanner_type), intent(inout) :: scanner
      type(namelist_file_type), intent(inout) :: file
      integer, intent(inout) :: entries, groups
      type(error_type), allocatable, intent(out) :: error
      type(name_type), allocatable :: grown(:)
      character(len=:), allocatable :: group, word
      integer :: line, i

      line = scanner%line
      scanner%at = scanner%at + 1
      call take_name(scanner, group)
      if (len(group) == 0) then
         call raise(error, scanner%path//': line '//to_text(line)//': & is not followed by the name of a group', &
            & exit_bad_input)
         return
      end if
      if (group == 'end') then
         call raise(error, scanner%path//': line '//to_text(line)//': &end without a group to end', exit_bad_input)
         return
      end if
      do i = 1, groups
         if (file%groups(i)%text == group) then
            call fault(scanner, group, '', 'the group is there twice, on lines '//to_text(file%groups(i)%line)//' and ' &
               & //to_text(line)//'; once is allowed', error)
            return
         end if
      end do
      if (groups == most_names) then
         call fault(scanner, group, '', 'more than '//to_text(most_names)//' groups', error)
         return
      end if
      if (groups == size(file%groups)) then
         allocate (grown(2*groups))
         grown(:groups) = file%groups
         call move_alloc(grown, file%groups)
      end if
      groups = groups + 1
      file%groups(groups)%text = group
      file%groups(groups)%line = line
      if (index(blanks//newline//'/!', peek(scanner)) == 0 .and. peek(scanner) /= '') then
         call fault(scanner, group, '', 'line '//to_text(line)//': a blank must follow the name of a group, not ''' &
            & //printable(rest_of_line(scanner))//'''', error)
         return
      end if
      do
         call skip_blanks(scanner)
         select case (peek(scanner))
         case ('')
            call fault_open(scanner, group, line, error)
            return
         case ('/')
            scanner%at = scanner%at + 1
            return
         case ('&')
            i = scanner%at
            scanner%at = scanner%at + 1
            call take_name(scanner, word)
            if (word == 'end') return
            scanner%at = i
            call fault_open(scanner, group, line, error)
            return
         case (',')
            call fault(scanner, group, '', 'line '//to_text(scanner%line)//': a comma where a name must be', error)
            return
         case default
            call parse_entry(scanner, group, file, entries, error)
            if (allocated(error)) return
         end select
      end do
   end subroutine parse_group

   !> `name = value, value ...`
   subroutine parse_entry(scanner, group, file, entries, error)
      type(scanner_type), intent(inout) :: scanner
      character(len=*), intent(in) :: group
      type(namelist_file_type), intent(inout) :: file
      integer, intent(inout) :: entries
      type(error_type), allocatable, intent(out) :: error
      type(entry_type) :: entry
      type(entry_type), allocatable :: grown(:)
      character(len=:), allocatable :: here
      integer :: i

      entry%group = group
      entry%line = scanner%line
      here = printable(rest_of_line(scanner))
      call take_name(scanner, entry%name)
      if (len(entry%name) == 0) then
         call fault(scanner, group, '', 'line '//to_text(entry%line)//': ''' &
            & //here//''' is not understood; name = value is needed', error)
         return
      end if
      call skip_blanks(scanner)
      select case (peek(scanner))
      case ('=')
         scanner%at = scanner%at + 1
      case ('(', '%')
         call fault(scanner, group, entry%name, 'line '//to_text(entry%line)//': parts of a variable cannot be set; ' &
            & //'give all its values: '//printable(entry%name)//' = a, b, c', error)
         return
      case default
         call fault(scanner, group, entry%name, 'line '//to_text(entry%line)//': no = after the name in ''' &
            & //here//'''; name = value is needed', error)
         return
      end select
      do i = 1, entries
         if (file%entries(i)%group == group .and. file%entries(i)%name == entry%name) then
            call fault(scanner, group, entry%name, 'the variable is there twice, on lines ' &
               & //to_text(file%entries(i)%line)//' and '//to_text(entry%line)//'; once is allowed', error)
            return
         end if
      end do
      if (entries == most_names) then
         call fault(scanner, group, entry%name, 'more than '//to_text(most_names)//' variables', error)
         return
      end if
      call parse_values(scanner, entry, error)
      if (allocated(error)) return
      if (entries == size(file%entries)) then
         allocate (grown(2*entries))
         grown(:entries) = file%entries
         call move_alloc(grown, file%entries)
      end if
      entries = entries + 1
      file%entries(entries) = entry
   end subroutine parse_entry

   subroutine parse_values(scanner, entry, error)
      type(scanner_type), intent(inout) :: scanner
      type(entry_type), intent(inout) :: entry
      type(error_type), allocatable, intent(out) :: error
      type(value_type), allocatable :: found(:), grown(:)
      type(value_type) :: value
      character :: mark
      integer :: n, repeats, start(2)
      logical :: after_comma

      allocate (found(8))
      n = 0
      after_comma = .false.
      values: do
         call skip_blanks(scanner)
         mark = peek(scanner)
         select case (mark)
         case ('', '/', '&')
            exit values
         case (',')
            if (n == 0 .or. after_comma) then
               call fault(scanner, entry%group, entry%name, 'line '//to_text(scanner%line)//': a comma without a value ' &
                  & //'before it', error)
               return
            end if
            after_comma = .true.
            scanner%at = scanner%at + 1
            cycle values
         case ('=')
            call fault(scanner, entry%group, entry%name, 'line '//to_text(scanner%line)//': = where a value must be', error)
            return
         case default
            start = [scanner%at, scanner%line]
         end select
         repeats = 1
         value%quoted = .false.
         if (mark == '''' .or. mark == '"') then
            call take_quoted(scanner, entry, value, error)
            if (allocated(error)) return
         else
            call take_word(scanner, value%text)
            if (is_next_name(scanner, value%text)) then
               scanner%at = start(1)
               scanner%line = start(2)
               exit values
            end if
            call take_repeats(scanner, entry, value, repeats, error)
            if (allocated(error)) return
         end if
         do while (n + repeats > size(found))
            allocate (grown(2*size(found)))
            grown(:n) = found(:n)
            call move_alloc(grown, found)
         end do
         found(n + 1:n + repeats) = value
         n = n + repeats
         after_comma = .false.
      end do values
      if (n == 0) then
         call fault(scanner, entry%group, entry%name, 'line '//to_text(entry%line)//': no value follows the =', error)
         return
      end if
      entry%values = found(:n)
   end subroutine parse_values

   !> A word is the name of the next variable if = (or a subscript and =) follows it.
   logical function is_next_name(scanner, word)
      type(scanner_type), intent(inout) :: scanner
      character(len=*), intent(in) :: word
      integer :: at, line

      is_next_name = .false.
      if (len(word) == 0) return
      if (index(letters, word(1:1)) == 0) return
      at = scanner%at
      line = scanner%line
      call skip_blanks(scanner)
      is_next_name = peek(scanner) == '=' .or. peek(scanner) == '('
      scanner%at = at
      scanner%line = line
   end function is_next_name

   !> Split `3*1.0` or `2*'a'` into count and value.
   subroutine take_repeats(scanner, entry, value, repeats, error)
      type(scanner_type), intent(inout) :: scanner
      type(entry_type), intent(in) :: entry
      type(value_type), intent(inout) :: value
      integer, intent(out) :: repeats
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: count
      integer :: star, outcome

      repeats = 1
      star = index(value%text, '*')
      if (star < 2) return
      count = value%text(:star - 1)
      if (verify(count, '0123456789') > 0) return
      call read_integer(count, repeats, outcome)
      if (repeats < 1 .or. repeats > most_repeats) then
         call fault(scanner, entry%group, entry%name, 'the repeat count of '//printable(value%text) &
            & //' is out of range; allowed 1 to '//to_text(most_repeats), error)
         return
      end if
      value%text = value%text(star + 1:)
      if (len(value%text) > 0) return
      if (peek(scanner) == '''' .or. peek(scanner) == '"') then
         call take_quoted(scanner, entry, value, error)
      else
         call fault(scanner, entry%group, entry%name, 'no value follows the repeat count '//count//'*', error)
      end if
   end subroutine take_repeats

   !> A text in quotes of either kind, doubled inside to stand for one.
   subroutine take_quoted(scanner, entry, value, error)
      type(scanner_type), intent(inout) :: scanner
      type(entry_type), intent(in) :: entry
      type(value_type), intent(inout) :: value
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: rest, text
      character :: quote
      integer :: i, n

      quote = peek(scanner)
      rest = rest_of_line(scanner)
      allocate (character(len=len(rest)) :: text)
      value%quoted = .true.
      n = 0
      i = 2
      do while (i <= len(rest))
         if (rest(i:i) == quote) then
            if (rest(i + 1:min(i + 1, len(rest))) /= quote) then
               value%text = text(:n)
               scanner%at = scanner%at + i
               return
            end if
            i = i + 1
         end if
         n = n + 1
         text(n:n) = rest(i:i)
         i = i + 1
      end do
      call fault(scanner, entry%group, entry%name, 'line '//to_text(scanner%line)//': the closing quote is missing', error)
   end subroutine take_quoted

   !> Everything up to a blank, a comma, an end, a comment, = or a quote.
   subroutine take_word(scanner, word)
      type(scanner_type), intent(inout) :: scanner
      character(len=:), allocatable, intent(out) :: word
      integer :: n

      n = scan(scanner%text(scanner%at:), blanks//newline//',/!&=''"') - 1
      if (n < 0) n = len(scanner%text) - scanner%at + 1
      word = scanner%text(scanner%at:scanner%at + n - 1)
      scanner%at = scanner%at + n
   end subroutine take_word

   !> A name in lower case: a letter, then letters, digits and underscores; '' if none is here.
   subroutine take_name(scanner, name)
      type(scanner_type), intent(inout) :: scanner
      character(len=:), allocatable, intent(out) :: name
      integer :: n

      name = ''
      if (index(letters, peek(scanner)) == 0 .or. peek(scanner) == '') return
      n = verify(scanner%text(scanner%at:), letters//'0123456789') - 1
      if (n < 0) n = len(scanner%text) - scanner%at + 1
      name = lower(scanner%text(scanner%at:scanner%at + n - 1))
      scanner%at = scanner%at + n
   end subroutine take_name

   !> Move past blanks, newlines and comments.
   subroutine skip_blanks(scanner)
      type(scanner_type), intent(inout) :: scanner
      logical :: comment

      comment = .false.
      do while (scanner%at <= len(scanner%text))
         associate (here => scanner%text(scanner%at:scanner%at))
            if (here == newline) then
               comment = .false.
               scanner%line = scanner%line + 1
            else if (here == '!') then
               comment = .true.
            else if (.not. comment .and. index(blanks, here) == 0) then
               return
            end if
         end associate
         scanner%at = scanner%at + 1
      end do
   end subroutine skip_blanks

   !> The character here, or '' (which equals a blank) at the end of the text; call it after `skip_blanks`, or beware of blanks.
   pure function peek(scanner) result(here)
      type(scanner_type), intent(in) :: scanner
      character :: here

      here = ' '
      if (scanner%at <= len(scanner%text)) here = scanner%text(scanner%at:scanner%at)
   end function peek

   pure function rest_of_line(scanner) result(rest)
      type(scanner_type), intent(in) :: scanner
      character(len=:), allocatable :: rest
      integer :: n

      n = index(scanner%text(scanner%at:), newline) - 1
      if (n < 0) n = len(scanner%text) - scanner%at + 1
      rest = trim(scanner%text(scanner%at:scanner%at + n - 1))
      if (len(rest) > 0) then
         if (rest(len(rest):) == achar(13)) rest = trim(rest(:len(rest) - 1))
      end if
   end function rest_of_line

   subroutine fault(scanner, group, name, message, error)
      type(scanner_type), intent(in) :: scanner
      character(len=*), intent(in) :: group, name, message
      type(error_type), allocatable, intent(out) :: error

      call raise(error, place(scanner%path, group, name)//message, exit_bad_input)
   end subroutine fault

   !> The group has no end.
   subroutine fault_open(scanner, group, line, error)
      type(scanner_type), intent(in) :: scanner
      character(len=*), intent(in) :: group
      integer, intent(in) :: line
      type(error_type), allocatable, intent(out) :: error

      call fault(scanner, group, '', 'the / that ends the group is missing (the group begins on line '//to_text(line)//')', &
         & error)
   end subroutine fault_open
end module namelist_file
