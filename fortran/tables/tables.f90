!> Tables of text cells from CSV: a header row, then rows; lines that start with # are comments.
!>
!> Cells are separated by commas, semicolons or tabs, whichever the header has most of; if not by commas, numbers may have decimal ones.
!> Cells may be in double quotes (RFC 4180); blank lines, rows of empty cells and empty cells beyond the header are skipped; CRLF and a byte
!> order mark are accepted. A row of units may follow the header.
module tables
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable, read_text_file
   use numbers, only: number_malformed, number_ok, read_real
   use text, only: lower, quoted, to_text
   use kinds, only: wp
   implicit none
   private
   public :: table_type, read_table, parse_table, csv_cell, longest_name

   !> Bytes of a name that a program gives to a column.
   integer, parameter :: longest_name = 23

   type :: table_type
      !> Rows and columns, the header not counted.
      integer :: rows = 0, columns = 0
      !> Line of the file on which each row begins, (rows).
      integer, allocatable :: line(:)
      !> The name that stands for that of the header, (columns), empty where there is none; unallocated: nowhere is one.
      character(len=longest_name), allocatable :: given_names(:)
      !> Every cell, unquoted, one after the other, row by row from the header, which is row 0: cell (j, i) is buffer(first(k):last(k)),
      !> k = position_of(j, i).
      character(len=:), allocatable, private :: buffer
      integer, allocatable, private :: first(:), last(:)
      logical, private :: decimal_comma = .false.
      !> A row of units follows the header; it is none of `rows`.
      logical, private :: has_units = .false.
   contains
      procedure :: cell
      procedure :: name
      procedure :: called
      procedure :: unit
      procedure :: find
      procedure :: number
      procedure :: join
   end type table_type

contains

   !> Read the table of a file. The message of a refusal does not name the file, only the line.
   subroutine read_table(path, table, error)
      character(len=*), intent(in) :: path
      type(table_type), intent(out) :: table
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content

      call read_text_file(path, content, error)
      if (allocated(error)) return
      call parse_table(content, table, error)
   end subroutine read_table

   !> The table of the text `content` of a CSV file.
   subroutine parse_table(content, table, error)
      character(len=*), intent(in) :: content
      type(table_type), intent(out) :: table
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: line(:), counts(:)
      integer :: cells, rows, i
      character :: delimiter
      character(len=:), allocatable :: words

      delimiter = delimiter_of(content)
      table%decimal_comma = delimiter /= ','
      call split(content, delimiter, table%buffer, table%first, table%last, cells, line, counts, rows, error)
      if (allocated(error)) return
      if (rows == 0) then
         call raise(error, 'the table has no header row', exit_bad_input)
         return
      end if
      table%columns = counts(1)
      table%rows = rows - 1
      do i = 2, rows
         if (counts(i) /= counts(1)) then
            words = ''
            if (delimiter == ',' .and. counts(i) > counts(1)) words = '; if commas are decimal, separate the cells by semicolons'
            if (counts(1) == 1) words = '; if line '//to_text(line(1))//' is a title, put # before it'
            call raise(error, 'line '//to_text(line(i))//': '//to_text(counts(i))//' cells where the header has ' &
               & //to_text(counts(1))//words, exit_bad_input)
            return
         end if
      end do
      if (rows > 1) table%has_units = are_units(table, counts(1))
      if (table%has_units) table%rows = table%rows - 1
      table%line = line(rows - table%rows + 1:rows)
      call check_header(table, line(1), error)
      if (allocated(error)) return
      if (table%rows == 0) call raise(error, 'the table is empty: no row follows the header', exit_bad_input)
   end subroutine parse_table

   !> Whether the cells below the header are units and nothing else.
   pure logical function are_units(table, columns)
      type(table_type), intent(in) :: table
      integer, intent(in) :: columns
      character(len=*), parameter :: known = ' deg degrees degree ° rad radians gpa mpa kpa pa um µm μm nm mm n mn % - '
      character(len=:), allocatable :: word
      integer :: k

      are_units = .false.
      do k = columns + 1, 2*columns
         word = bare_unit(table%buffer(table%first(k):table%last(k)))
         if (len(word) == 0) cycle
         are_units = index(known, ' '//word//' ') > 0
         if (.not. are_units) return
      end do
   end function are_units

   !> 'gpa' of '[GPa]'.
   pure function bare_unit(string) result(word)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: word

      word = lower(string)
      if (scan(word, '([') == 1 .and. scan(word, ')]') == len(word)) word = word(2:len(word) - 1)
      word = trim(adjustl(word))
   end function bare_unit

   !> Names must be names, and each of its own.
   subroutine check_header(table, line, error)
      type(table_type), intent(in) :: table
      integer, intent(in) :: line
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: value
      integer :: i, j, outcome
      logical :: numeric

      numeric = .true.
      do j = 1, table%columns
         call read_real(table%name(j), value, outcome)
         if (outcome == number_malformed) numeric = .false.
      end do
      if (numeric) then
         call raise(error, 'line '//to_text(line)//': numbers where the header row with the names of the columns must be', &
            & exit_bad_input)
         return
      end if
      do j = 2, table%columns
         do i = 1, j - 1
            if (len(table%name(j)) > 0 .and. table%name(i) == table%name(j)) then
               call raise(error, 'line '//to_text(line)//': the column '//printable(table%name(j)) &
                  & //' is there twice', exit_bad_input)
               return
            end if
         end do
      end do
   end subroutine check_header

   !> What separates the cells: of comma, semicolon and tab that which the header has most of, outside quotes.
   pure character function delimiter_of(content)
      character(len=*), intent(in) :: content
      character(len=*), parameter :: candidates = ',;'//achar(9)
      integer :: i, k, last, counts(len(candidates))
      logical :: quoted

      i = 1
      last = 0
      do while (i <= len(content))
         call end_of_line(content, i, last)
         if (.not. is_skipped(content(i:last))) exit
         i = last + 2
      end do
      counts = 0
      quoted = .false.
      do i = i, last
         if (content(i:i) == '"') quoted = .not. quoted
         k = index(candidates, content(i:i))
         if (k > 0 .and. .not. quoted) counts(k) = counts(k) + 1
      end do
      k = maxloc(counts, dim=1)
      delimiter_of = candidates(k:k)
   end function delimiter_of

   !> Cut the text into cells; quotes are taken off on the way.
   subroutine split(content, delimiter, buffer, first, last, cells, line, counts, rows, error)
      character(len=*), intent(in) :: content
      character, intent(in) :: delimiter
      character(len=:), allocatable, intent(out) :: buffer
      integer, allocatable, intent(out) :: first(:), last(:), line(:), counts(:)
      integer, intent(out) :: cells, rows
      type(error_type), allocatable, intent(out) :: error
      character, parameter :: newline = achar(10), return = achar(13)
      integer :: i, n, number, most_cells, most_rows, filled, row_line
      character(len=:), allocatable :: blanks
      logical :: quoted

      n = len(content)
      blanks = ' '
      if (delimiter /= achar(9)) blanks = ' '//achar(9)
      most_cells = 1
      most_rows = 1
      do i = 1, n
         if (content(i:i) == delimiter) most_cells = most_cells + 1
         if (content(i:i) == newline) most_rows = most_rows + 1
      end do
      most_cells = most_cells + most_rows
      allocate (character(len=n) :: buffer)
      allocate (first(most_cells), last(most_cells), line(most_rows), counts(most_rows))
      cells = 0
      rows = 0
      filled = 0
      number = 1
      i = 1
      do while (i <= n)
         ! At the start of a line: skip it if blank or a comment.
         call end_of_line(content, i, filled)
         if (is_skipped(content(i:filled))) then
            i = filled + 2
            number = number + 1
            cycle
         end if
         filled = 0
         if (cells > 0) filled = last(cells)
         rows = rows + 1
         row_line = number
         line(rows) = number
         counts(rows) = 0
         row: do
            cells = cells + 1
            counts(rows) = counts(rows) + 1
            first(cells) = filled + 1
            do while (i <= n)
               if (index(blanks, content(i:i)) == 0) exit
               i = i + 1
            end do
            quoted = .false.
            if (i <= n) quoted = content(i:i) == '"'
            if (quoted) then
               i = i + 1
               do
                  if (i > n) then
                     call raise(error, 'line '//to_text(row_line)//': a double quote is not closed', exit_bad_input)
                     return
                  end if
                  if (content(i:i) == '"') then
                     if (i == n) exit
                     if (content(i + 1:i + 1) /= '"') exit
                     i = i + 1
                  end if
                  if (content(i:i) == newline) number = number + 1
                  filled = filled + 1
                  buffer(filled:filled) = content(i:i)
                  i = i + 1
               end do
               last(cells) = filled
               i = i + 1
               do while (i <= n)
                  if (scan(content(i:i), blanks//return) == 0) exit
                  i = i + 1
               end do
               if (i <= n) then
                  if (content(i:i) /= delimiter .and. content(i:i) /= newline) then
                     call raise(error, 'line '//to_text(row_line)//': text follows a closing double quote', exit_bad_input)
                     return
                  end if
               end if
            else
               do while (i <= n)
                  if (content(i:i) == delimiter .or. content(i:i) == newline) exit
                  filled = filled + 1
                  buffer(filled:filled) = content(i:i)
                  i = i + 1
               end do
               do while (filled >= first(cells))
                  if (scan(buffer(filled:filled), ' '//achar(9)//return) == 0) exit
                  filled = filled - 1
               end do
               last(cells) = filled
            end if
            if (i > n) exit row
            if (content(i:i) == newline) exit row
            i = i + 1
         end do row
         ! Empty cells beyond the header, and rows of nothing else, are none.
         do while (counts(rows) > merge(0, counts(1), rows == 1))
            if (last(cells) >= first(cells)) exit
            cells = cells - 1
            counts(rows) = counts(rows) - 1
         end do
         if (all(last(cells - counts(rows) + 1:cells) < first(cells - counts(rows) + 1:cells))) then
            cells = cells - counts(rows)
            rows = rows - 1
         end if
         i = i + 1
         number = number + 1
      end do
   end subroutine split

   !> Position of the last character of the line that holds position `i`, the newline not counted.
   pure subroutine end_of_line(content, i, last)
      character(len=*), intent(in) :: content
      integer, intent(in) :: i
      integer, intent(out) :: last
      integer :: length

      length = index(content(i:), achar(10))
      last = len(content)
      if (length > 0) last = i + length - 2
   end subroutine end_of_line

   pure logical function is_skipped(line)
      character(len=*), intent(in) :: line
      integer :: i

      i = verify(line, ' '//achar(9)//achar(13))
      is_skipped = i == 0
      if (i > 0) is_skipped = line(i:i) == '#'
   end function is_skipped

   !> The cell in a `column` and `row`.
   pure function cell(self, column, row) result(string)
      class(table_type), intent(in) :: self
      integer, intent(in) :: column
      !> 0 is the header.
      integer, intent(in) :: row
      character(len=:), allocatable :: string

      integer :: k

      k = position_of(self, column, row)
      string = self%buffer(self%first(k):self%last(k))
   end function cell

   !> Let the columns of another table with as many rows follow; it has no row of units.
   subroutine join(self, other, error)
      class(table_type), intent(inout) :: self
      type(table_type), intent(in) :: other
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: first(:, :), last(:, :)
      integer :: above, rows, j

      do j = 1, other%columns
         if (self%find(other%name(j)) == 0) cycle
         call raise(error, 'the column '//printable(self%name(self%find(other%name(j))))//' is there, and follows from the other ' &
            & //'table; leave it out', exit_bad_input)
         return
      end do
      above = 1
      if (self%has_units) above = 2
      rows = self%rows + above
      allocate (first(self%columns + other%columns, rows), last(self%columns + other%columns, rows))
      first(:self%columns, :) = reshape(self%first(:self%columns*rows), [self%columns, rows])
      last(:self%columns, :) = reshape(self%last(:self%columns*rows), [self%columns, rows])
      first(self%columns + 1:, :) = 1
      last(self%columns + 1:, :) = 0
      first(self%columns + 1:, 1) = len(self%buffer) + other%first(:other%columns)
      last(self%columns + 1:, 1) = len(self%buffer) + other%last(:other%columns)
      first(self%columns + 1:, above + 1:) = len(self%buffer) + reshape(other%first(other%columns + 1:), [other%columns, self%rows])
      last(self%columns + 1:, above + 1:) = len(self%buffer) + reshape(other%last(other%columns + 1:), [other%columns, self%rows])
      self%buffer = self%buffer//other%buffer
      if (allocated(self%given_names)) self%given_names = [self%given_names, [(repeat(' ', longest_name), j=1, other%columns)]]
      self%columns = self%columns + other%columns
      self%first = reshape(first, [size(first)])
      self%last = reshape(last, [size(last)])
   end subroutine join

   !> Where a cell is among all cells of the file.
   pure integer function position_of(self, column, row) result(k)
      type(table_type), intent(in) :: self
      !> As of `cell`.
      integer, intent(in) :: column, row

      k = row*self%columns + column
      if (self%has_units .and. row > 0) k = k + self%columns
   end function position_of

   !> The name of a `column`.
   pure function name(self, column) result(string)
      class(table_type), intent(in) :: self
      integer, intent(in) :: column
      character(len=:), allocatable :: string

      string = self%cell(column, 0)
   end function name

   !> What a `column` is known as: the name that was given to it, or that of the header.
   pure function called(self, column) result(string)
      class(table_type), intent(in) :: self
      integer, intent(in) :: column
      character(len=:), allocatable :: string

      string = ''
      if (allocated(self%given_names)) string = trim(self%given_names(column))
      if (len(string) == 0) string = self%name(column)
   end function called

   !> What a row of units says of a `column`, in lower case; empty if nothing.
   pure function unit(self, column) result(word)
      class(table_type), intent(in) :: self
      integer, intent(in) :: column
      character(len=:), allocatable :: word

      word = ''
      associate (k => self%columns + column)
         if (self%has_units) word = bare_unit(self%buffer(self%first(k):self%last(k)))
      end associate
      if (word == '-') word = ''
   end function unit

   !> Number of the column that was given this name, or has it, exactly or else whatever the case; 0 if there is none.
   pure integer function find(self, name)
      class(table_type), intent(in) :: self
      character(len=*), intent(in) :: name
      integer :: j

      find = 0
      if (allocated(self%given_names)) find = findloc(self%given_names, name, dim=1)
      if (find > 0) return
      do j = 1, self%columns
         if (self%called(j) == name) then
            find = j
            return
         end if
      end do
      do j = 1, self%columns
         if (lower(self%called(j)) == lower(name)) then
            find = j
            return
         end if
      end do
   end function find

   !> The finite number `value` in a cell; a refusal names line, `column` and value.
   subroutine number(self, column, row, value, error)
      class(table_type), intent(in) :: self
      !> Counted from 1.
      integer, intent(in) :: column, row
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(out) :: error
      integer :: outcome
      character(len=:), allocatable :: string, place, words

      associate (k => position_of(self, column, row))
         call read_real(self%buffer(self%first(k):self%last(k)), value, outcome)
      end associate
      if (outcome == number_ok) return
      words = ''
      string = self%cell(column, row)
      if (.not. self%decimal_comma .and. index(string, ',') > 0) words = '; decimal commas are read where semicolons or tabs ' &
         & //'separate the cells'
      if (self%decimal_comma .and. index(string, '.') == 0 .and. index(string, ',') == index(string, ',', back=.true.)) then
         if (index(string, ',') > 0) string(index(string, ','):index(string, ',')) = '.'
      end if
      call read_real(string, value, outcome)
      if (outcome == number_ok) return
      place = 'line '//to_text(self%line(row))//', column '//printable(self%name(column))//': '
      if (len(string) == 0) then
         call raise(error, place//'the cell is empty; a number is needed', exit_bad_input)
      else if (outcome == number_malformed) then
         call raise(error, place//''''//printable(string)//''' is not a number'//words, exit_bad_input)
      else
         call raise(error, place//printable(string)//' is not finite; a finite number is needed', exit_bad_input)
      end if
   end subroutine number

   !> A text, `string`, as a cell of a CSV file: in double quotes if it must be.
   pure function csv_cell(string) result(cell)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: cell

      cell = string
      if (scan(string, ',"'//achar(10)//achar(13)) > 0 .or. index(string, '#') == 1 &
         & .or. string /= adjustl(string) .or. len(string) /= len_trim(string)) cell = quoted(string, '"')
   end function csv_cell
end module tables
