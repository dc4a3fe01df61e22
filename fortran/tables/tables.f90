!> Tables of text cells, read from CSV and written: a header, then rows. Lines that start with # are
!> comments.
!>
!> Commas separate cells, and numbers have decimal points. Cells may be in double quotes (RFC 4180).
!> Blank lines, rows of empty cells and empty cells beyond the header are skipped; CRLF and a byte
!> order mark are accepted.
module tables
   use errors, only: error_type, prefix_error, refuse
   use files, only: checksum, new_file_type, printable, read_text_file
   use text, only: append, lower, newline, number_malformed, number_ok, quoted, read_real, &
      & short_text, split_list, to_text
   use kinds, only: i8, wp
   implicit none
   private
   public :: table_type, read_table, parse_table, write_table, csv_cell, longest_name

   !> Bytes of the longest name of a column.
   integer, parameter :: longest_name = 32
   character, parameter :: tab = achar(9)
   character(len=*), parameter :: blanks = ' '//tab//achar(13)

   type :: table_type
      !> Numbers of rows and columns, without the header.
      integer :: rows = 0, columns = 0
      !> Line of the file on which each row begins, (row).
      integer, allocatable :: line(:)
      !> The text, with the cells unquoted, and the first and last byte of each cell, (2, column,
      !> row); row 0 is the header.
      character(len=:), allocatable, private :: buffer
      integer, allocatable, private :: bounds(:, :, :)
   contains
      procedure :: cell, is_empty, name, names, find, number, numbers, place, &
         & refuse => refuse_cell, digest, rows_of
   end type table_type

contains

   !> Read the table of a file, which has no columns after an error. Messages name the line, but not
   !> the file.
   subroutine read_table(path, table, error)
      character(len=*), intent(in) :: path
      type(table_type), intent(out) :: table
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content

      call read_text_file(path, content, error)
      if (.not. allocated(error)) call parse_table(content, table, error)
      if (allocated(error)) table%columns = 0
   end subroutine read_table

   !> The table of the text `content` of a CSV file. Each row must have as many cells as the header.
   subroutine parse_table(content, table, error)
      character(len=*), intent(in) :: content
      type(table_type), intent(out) :: table
      type(error_type), allocatable, intent(out) :: error
      !> First and last byte of each cell, row by row from the header; line on which each row
      !> begins, that of the header first.
      integer, allocatable :: bounds(:, :), line(:)
      character(len=:), allocatable :: buffer, words
      !> Number of the line at byte `i` of the buffer.
      integer :: number, i
      integer :: cells, above, rows, last

      buffer = content//newline
      cells = 0
      do i = 1, len(buffer)
         if (scan(buffer(i:i), ','//newline) > 0) cells = cells + 1
      end do
      allocate (bounds(2, cells), line(cells))
      cells = 0
      rows = 0
      number = 1
      i = 1
      do while (i <= len(buffer))
         ! Skip comments, whose first sign that is not blank is #, and blank lines, for which both
         ! positions are 0.
         last = i - 2 + index(buffer(i:), newline)
         if (index(buffer(i:last), '#') == verify(buffer(i:last), blanks)) then
            i = last + 2
            number = number + 1
            cycle
         end if
         rows = rows + 1
         line(rows) = number
         above = cells
         do
            cells = cells + 1
            call take_cell(bounds(:, cells))
            call prefix_error(error, 'line '//to_text(line(rows))//': ')
            if (allocated(error)) return
            i = i + 1
            if (buffer(i - 1:i - 1) == newline) exit
         end do
         number = number + 1
         ! Drop empty cells beyond the header, and rows of empty cells.
         do while (cells - above > merge(0, table%columns, rows == 1))
            if (bounds(2, cells) >= bounds(1, cells)) exit
            cells = cells - 1
         end do
         if (all(bounds(2, above + 1:cells) < bounds(1, above + 1:cells))) then
            cells = above
            rows = rows - 1
            cycle
         end if
         if (rows == 1) table%columns = cells
         if (cells - above == table%columns) cycle
         words = ''
         if (table%columns == 1) then
            words = '; commas must separate the cells; if line '//to_text(line(1)) &
               & //' is a title, put # before it'
         end if
         call refuse(error, 'line '//to_text(line(rows))//': '//to_text(cells - above) &
            & //' cells where the header has '//to_text(table%columns)//words)
         return
      end do
      if (rows == 0) call refuse(error, 'the table has no header row')
      if (allocated(error)) return
      call move_alloc(buffer, table%buffer)
      table%rows = rows - 1
      table%line = line(2:rows)
      allocate (table%bounds(2, table%columns, 0:table%rows))
      table%bounds(:, :, :) = reshape(bounds(:, :cells), [2, table%columns, rows])
      call check_header(table, line(1), error)
      if (allocated(error)) return
      if (table%rows == 0) call refuse(error, 'the table is empty: no row follows the header')

   contains

      !> Find the cell at byte `i`, and move `i` to the comma or the end of the line after it. The
      !> text of a quoted cell replaces its quotes.
      subroutine take_cell(own)
         !> First and last byte of the cell.
         integer, intent(out) :: own(2)

         i = i - 1 + verify(buffer(i:), ' '//tab)
         if (buffer(i:i) /= '"') then
            own(1) = i
            i = i - 1 + scan(buffer(i:), ','//newline)
            own(2) = own(1) - 1 + verify(buffer(own(1):i - 1), blanks, back=.true.)
            return
         end if
         own = [i, i - 1]
         do
            i = i + 1
            if (i > len(buffer)) call refuse(error, 'a double quote is not closed')
            if (allocated(error)) return
            if (buffer(i:i) == '"') then
               i = i + 1
               if (buffer(i:i) /= '"') exit
            end if
            if (buffer(i:i) == newline) number = number + 1
            own(2) = own(2) + 1
            buffer(own(2):own(2)) = buffer(i:i)
         end do
         i = i - 1 + verify(buffer(i:), blanks)
         if (scan(buffer(i:i), ','//newline) == 0) then
            call refuse(error, 'text follows a closing double quote')
         end if
      end subroutine take_cell
   end subroutine parse_table

   !> The table with some of its rows.
   pure function rows_of(self, chosen) result(table)
      class(table_type), intent(in) :: self
      !> (row).
      logical, intent(in) :: chosen(:)
      type(table_type) :: table
      integer :: i

      table = self
      table%rows = count(chosen)
      table%line = pack(self%line, chosen)
      deallocate (table%bounds)
      allocate (table%bounds(2, self%columns, 0:table%rows))
      ! Row 0 is the header.
      table%bounds(:, :, :) = self%bounds(:, :, [0, pack([(i, i=1, self%rows)], chosen)])
   end function rows_of

   !> Refuse a header of numbers and a name that occurs twice.
   subroutine check_header(table, line, error)
      type(table_type), intent(in) :: table
      !> That of the header.
      integer, intent(in) :: line
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: value
      integer :: i, j, outcome, numbers

      numbers = 0
      do j = 1, table%columns
         call read_real(table%name(j), value, outcome)
         if (outcome /= number_malformed) numbers = numbers + 1
      end do
      if (numbers > table%columns/2) then
         call refuse(error, 'line '//to_text(line) &
            & //': numbers where the header row with the names of the columns must be')
      end if
      do j = 2, table%columns
         if (allocated(error)) return
         if (len(table%name(j)) > 0 &
            & .and. any([(table%name(i) == table%name(j), i=1, j - 1)])) then
            call refuse(error, 'line '//to_text(line)//': the column ' &
               & //printable(table%name(j))//' is there twice')
         end if
      end do
   end subroutine check_header

   !> The text of the cell in a `column` and `row`; '' if the column is 0.
   pure function cell(self, column, row) result(string)
      class(table_type), intent(in) :: self
      !> From 1; row 0 is the header.
      integer, intent(in) :: column, row
      character(len=:), allocatable :: string

      string = ''
      if (column == 0) return
      string = self%buffer(self%bounds(1, column, row):self%bounds(2, column, row))
   end function cell

   !> Whether the cell in a `column` and `row` is empty.
   pure logical function is_empty(self, column, row)
      class(table_type), intent(in) :: self
      !> As of `cell`.
      integer, intent(in) :: column, row

      is_empty = len(self%cell(column, row)) == 0
   end function is_empty

   !> The name of a `column`.
   pure function name(self, column) result(string)
      class(table_type), intent(in) :: self
      integer, intent(in) :: column
      character(len=:), allocatable :: string

      string = self%cell(column, 0)
   end function name

   !> The names of the columns for a message, at most 30.
   pure function names(self) result(list)
      class(table_type), intent(in) :: self
      character(len=:), allocatable :: list
      integer, parameter :: most = 30
      integer :: j

      list = ''
      do j = 1, min(self%columns, most)
         list = list//', '//printable(self%name(j))
      end do
      list = list(3:)
      ! The file may be none of a table.
      if (self%columns == 1) list = 'one, without a comma; commas must separate the cells'
      if (self%columns > most) list = list//', ...'
   end function names

   !> Number of the column of this name, exactly or else whatever the case; 0 if there is none.
   pure integer function find(self, name)
      class(table_type), intent(in) :: self
      character(len=*), intent(in) :: name
      integer :: j

      find = findloc([(self%name(j) == name, j=1, self%columns)], .true., dim=1)
      if (find == 0) then
         find = findloc([(lower(self%name(j)) == lower(name), j=1, self%columns)], .true., dim=1)
      end if
   end function find

   !> The finite number `value` in a cell; a refusal names line, `column` and value. Nothing is
   !> done after an error.
   subroutine number(self, column, row, value, error)
      class(table_type), intent(in) :: self
      !> Counted from 1.
      integer, intent(in) :: column, row
      real(wp), intent(out) :: value
      type(error_type), allocatable, intent(inout) :: error
      integer :: outcome

      call read_real(self%cell(column, row), value, outcome)
      if (outcome == number_ok .or. allocated(error)) return
      if (self%is_empty(column, row)) then
         call refuse(error, self%place(column, row)//'the cell is empty; a number is needed')
      else if (outcome == number_malformed) then
         call refuse(error, self%place(column, row)//''''//printable(self%cell(column, row)) &
            & //''' is not a number')
      else
         call self%refuse(column, row, ' is not finite; a finite number is needed', error)
      end if
   end subroutine number

   !> The finite numbers in some columns. Nothing is done after an error.
   subroutine numbers(self, columns, values, error)
      class(table_type), intent(in) :: self
      integer, intent(in) :: columns(:)
      !> (column, row).
      real(wp), allocatable, intent(out) :: values(:, :)
      type(error_type), allocatable, intent(inout) :: error
      integer :: i, j

      allocate (values(size(columns), self%rows))
      do i = 1, self%rows
         do j = 1, size(columns)
            call self%number(columns(j), i, values(j, i), error)
         end do
      end do
   end subroutine numbers

   !> 'line 2, column phi1: ', the beginning of a message about a cell.
   pure function place(self, column, row)
      class(table_type), intent(in) :: self
      !> As of `number`.
      integer, intent(in) :: column, row
      character(len=:), allocatable :: place

      place = 'line '//to_text(self%line(row))//', column '//printable(self%name(column))//': '
   end function place

   !> Refuse a cell: its text, then what is wrong with it.
   pure subroutine refuse_cell(self, column, row, message, error)
      class(table_type), intent(in) :: self
      !> As of `number`.
      integer, intent(in) :: column, row
      !> What follows the text of the cell.
      character(len=*), intent(in) :: message
      type(error_type), allocatable, intent(out) :: error

      call refuse(error, self%place(column, row)//printable(self%cell(column, row))//message)
   end subroutine refuse_cell

   !> The cell of a CSV file for a text, `string`: in double quotes if it needs them.
   pure function csv_cell(string) result(cell)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: cell

      cell = string
      if (scan(string, ',"'//achar(10)//achar(13)) > 0 .or. index(string, '#') == 1 &
         & .or. string /= adjustl(string) .or. len(string) /= len_trim(string)) then
         cell = quoted(string, '"')
      end if
   end function csv_cell

   !> Write a table with further columns, `names`, separated by commas. They replace its own columns
   !> of these names.
   subroutine write_table(table, path, names, values, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: path, names
      !> (row, name); cells of numbers that are not finite are empty.
      real(wp), intent(in) :: values(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file
      character(len=:), allocatable :: added(:), line
      logical :: kept(table%columns)
      integer :: i, j

      added = split_list(names)
      kept = [(all(added /= table%name(j)), j=1, table%columns)]
      do i = 0, table%rows
         line = ''
         do j = 1, table%columns
            if (kept(j)) line = line//csv_cell(table%cell(j, i))//','
         end do
         do j = 1, size(added)
            if (i == 0) line = line//trim(added(j))//','
            if (i > 0) line = line//short_text(values(max(i, 1), j))//','
         end do
         line(len(line):) = newline
         call file%add(line)
      end do
      call file%finish(path, error)
   end subroutine write_table

   !> Checksum of all cells.
   function digest(self)
      class(table_type), intent(in) :: self
      character(len=:), allocatable :: digest, joined
      integer(i8) :: filled
      integer :: i, j

      filled = 0
      do i = 0, self%rows
         do j = 1, self%columns
            call append(joined, filled, self%cell(j, i)//tab)
         end do
      end do
      digest = checksum(joined(:filled))
   end function digest
end module tables
