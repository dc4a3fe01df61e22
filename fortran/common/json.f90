!> Documents in JavaScript Object Notation (RFC 8259), written from front to back.
!>
!>     call document%begin_object()
!>     call document%put('mean', 168.4_wp)
!>     call document%begin_array('rows')
!>     call document%put('', [1.0_wp, 2.0_wp])
!>     call document%end_array()
!>     call document%end_object()
!>
!> The key is empty for the outermost value and within arrays. A number that is not finite becomes
!> null. Other numbers are written with all digits, so that reading them restores every bit.
module json
   use kinds, only: wp
   use text, only: append, line_type, newline, number_text, split_list, to_text
   implicit none
   private
   public :: json_type, quoted

   integer, parameter :: deepest = 32

   type :: json_type
      private
      character(len=:), allocatable :: page
      integer :: filled = 0, depth = 0
      !> For each depth: whether a value has been written, and the bracket that closes the level.
      logical :: begun(0:deepest) = .false.
      character :: bracket(0:deepest) = ' '
   contains
      procedure :: begin_object, end_object => close_level, begin_array, &
         & end_array => close_level, put_numbers
      !> `put_json` writes a value that is JSON already.
      procedure :: put_json, text => document_text
      procedure, private :: put_text, put_real, put_integer, put_logical, put_reals, &
         & put_matrix, put_lines
      generic :: put => put_text, put_real, put_integer, put_logical, put_reals, &
         & put_matrix, put_lines
   end type json_type

contains

   !> Open an object; `key` is its name in the surrounding object.
   pure subroutine begin_object(self, key)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in), optional :: key

      call open_level(self, '{}', key)
   end subroutine begin_object

   !> Open an array; `key` is its name in the surrounding object.
   pure subroutine begin_array(self, key)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in), optional :: key

      call open_level(self, '[]', key)
   end subroutine begin_array

   !> Write one of the numbers `values` for each name, into the open object or into a new one under
   !> `key`.
   pure subroutine put_numbers(self, names, values, key)
      class(json_type), intent(inout) :: self
      !> Separated by ', '; one value for each name.
      character(len=*), intent(in) :: names
      real(wp), intent(in) :: values(:)
      character(len=*), intent(in), optional :: key
      character(len=:), allocatable :: each(:)
      integer :: i

      allocate (each, source=split_list(names))
      if (present(key)) call self%begin_object(key)
      do i = 1, size(values)
         call self%put(trim(each(i)), values(i))
      end do
      if (present(key)) call self%end_object()
   end subroutine put_numbers

   !> Write `value`, which is JSON already, under `key`.
   pure subroutine put_json(self, key, value)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key, value

      call begin_value(self, key)
      call append(self%page, self%filled, value)
   end subroutine put_json

   !> Write the text `value` under `key`.
   pure subroutine put_text(self, key, value)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key, value

      call self%put_json(key, quoted(value))
   end subroutine put_text

   !> Write the number `value` under `key`, with all digits.
   pure subroutine put_real(self, key, value)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), intent(in) :: value

      call self%put_json(key, number(value))
   end subroutine put_real

   !> Write the integer `value` under `key`.
   pure subroutine put_integer(self, key, value)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key
      integer, intent(in) :: value

      call self%put_json(key, to_text(value))
   end subroutine put_integer

   !> Write the logical `value` under `key`.
   pure subroutine put_logical(self, key, value)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key
      logical, intent(in) :: value

      call self%put_json(key, trim(merge('true ', 'false', value)))
   end subroutine put_logical

   !> Write the numbers `values` under `key` as an array.
   pure subroutine put_reals(self, key, values)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), intent(in) :: values(:)
      integer :: i

      call begin_value(self, key)
      call append(self%page, self%filled, '[')
      do i = 1, size(values)
         if (i > 1) call append(self%page, self%filled, ', ')
         call append(self%page, self%filled, number(values(i)))
      end do
      call append(self%page, self%filled, ']')
   end subroutine put_reals

   !> Write the matrix `values` under `key` as an array of its rows.
   pure subroutine put_matrix(self, key, values)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key
      real(wp), intent(in) :: values(:, :)
      integer :: i

      call self%begin_array(key)
      do i = 1, size(values, 1)
         call self%put('', values(i, :))
      end do
      call self%end_array()
   end subroutine put_matrix

   !> Write the texts `lines` under `key` as an array.
   pure subroutine put_lines(self, key, lines)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key
      type(line_type), intent(in) :: lines(:)
      integer :: i

      call self%begin_array(key)
      do i = 1, size(lines)
         call self%put('', lines(i)%text)
      end do
      call self%end_array()
   end subroutine put_lines

   !> The document, with a newline at its end.
   pure function document_text(self) result(text)
      class(json_type), intent(in) :: self
      character(len=:), allocatable :: text

      text = ''
      if (allocated(self%page)) text = self%page(:self%filled)//newline
   end function document_text

   pure subroutine open_level(self, brackets, key)
      class(json_type), intent(inout) :: self
      character(len=2), intent(in) :: brackets
      character(len=*), intent(in), optional :: key

      call begin_value(self, key)
      call append(self%page, self%filled, brackets(1:1))
      self%depth = self%depth + 1
      self%begun(self%depth) = .false.
      self%bracket(self%depth) = brackets(2:2)
   end subroutine open_level

   !> Close the innermost object or array.
   pure subroutine close_level(self)
      class(json_type), intent(inout) :: self

      if (self%begun(self%depth)) then
         call append(self%page, self%filled, newline//repeat(' ', self%depth - 1))
      end if
      call append(self%page, self%filled, self%bracket(self%depth))
      self%depth = self%depth - 1
   end subroutine close_level

   !> Write the comma, the line break and the key that precede a value.
   pure subroutine begin_value(self, key)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in), optional :: key

      if (self%begun(self%depth)) call append(self%page, self%filled, ',')
      if (self%depth > 0) call append(self%page, self%filled, newline//repeat(' ', self%depth))
      self%begun(self%depth) = .true.
      if (.not. present(key)) return
      if (len(key) > 0) call append(self%page, self%filled, quoted(key)//': ')
   end subroutine begin_value

   pure function number(value) result(string)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: string

      string = 'null'
      if (abs(value) <= huge(value)) string = number_text(value)
   end function number

   !> The text `string` as a JSON literal.
   pure function quoted(string) result(literal)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: literal
      character(len=6) :: escape
      integer :: i

      literal = '"'
      do i = 1, len(string)
         select case (iachar(string(i:i)))
         case (iachar('"'), iachar('\'))
            literal = literal//'\'//string(i:i)
         case (10)
            literal = literal//'\n'
         case (0:9, 11:31)
            write (escape, '(a,z4.4)') '\u', iachar(string(i:i))
            literal = literal//escape
         case default
            literal = literal//string(i:i)
         end select
      end do
      literal = literal//'"'
   end function quoted
end module json
