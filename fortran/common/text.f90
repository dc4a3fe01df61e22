!> Conversion of numbers to text and back, for messages and files; lists.
!>
!> Reading is strict: the whole text must be one number, and NaN and Infinity are refused.
!>
!> The lengths of the texts of numbers are expressions: gfortran keeps the length of a
!> deferred-length result in static memory of the caller, where threads overwrite it.
module text
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use kinds, only: i8, wp
   implicit none
   private
   public :: line_type, add_line, newline, lower, join, split_list, quoted, append
   public :: to_text, fixed, number_text, short_text, read_integer, read_real, &
      & number_ok, number_not_finite, number_malformed

   !> Ends a line of a text.
   character, parameter :: newline = achar(10)

   !> Forms of a real: the fewest digits that restore it, ten digits at most for people, a number of
   !> significant digits, a number of decimals.
   integer, parameter :: fewest_digits = 0, few_digits = 1, significant = 2, fixed_point = 3

   !> Outcomes of reading: a finite number; NaN, Infinity or an overflow; not a number.
   integer, parameter :: number_ok = 0, number_not_finite = 1, number_malformed = 2

   !> A text in a list.
   type :: line_type
      character(len=:), allocatable :: text
   end type line_type

   interface to_text
      module procedure integer_to_text, long_to_text, real_to_text, digits_to_text, logical_to_text
   end interface to_text

   interface
      pure subroutine c_write(value, form, n, text, length) bind(c, name='bayesindent_write_real')
         import
         real(c_double), value :: value
         integer(c_int), value :: form, n, length
         ! allow(C072)
         character, intent(out) :: text(*)
      end subroutine c_write
      pure subroutine c_read_real(text, length, value, outcome) &
         & bind(c, name='bayesindent_read_real')
         import
         character, intent(in) :: text(*)
         integer(c_int), value :: length
         real(c_double), intent(out) :: value
         integer(c_int), intent(out) :: outcome
      end subroutine c_read_real
   end interface

contains

   pure function integer_to_text(value) result(string)
      integer, intent(in) :: value
      character(len=decimal_length(int(value, i8))) :: string

      write (string, '(i0)') value
   end function integer_to_text

   pure function long_to_text(value) result(string)
      integer(i8), intent(in) :: value
      character(len=decimal_length(value)) :: string

      write (string, '(i0)') value
   end function long_to_text

   pure integer function decimal_length(value) result(length)
      integer(i8), intent(in) :: value
      integer(i8) :: rest

      length = merge(1, 2, value >= 0_i8)
      rest = value/10_i8
      do while (rest /= 0_i8)
         length = length + 1
         rest = rest/10_i8
      end do
   end function decimal_length

   pure function real_to_text(value) result(string)
      real(wp), intent(in) :: value
      character(len=len_trim(real_text(value, significant, 6))) :: string

      string = real_text(value, significant, 6)
   end function real_to_text

   pure function digits_to_text(value, digits) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: digits
      character(len=len_trim(real_text(value, significant, digits))) :: string

      string = real_text(value, significant, digits)
   end function digits_to_text

   !> A `value` with this number of `decimals`; without decimals it has no point.
   pure function fixed(value, decimals) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      character(len=len_trim(real_text(value, fixed_point, decimals))) :: string

      string = real_text(value, fixed_point, decimals)
   end function fixed

   !> A `value` as text, padded with blanks.
   pure function real_text(value, form, n) result(string)
      real(wp), intent(in) :: value
      !> One of the forms above, and its number of digits or decimals.
      integer, intent(in) :: form, n
      character(len=merge(400, 32, form == fixed_point)) :: string

      call c_write(value, form, n, string, len(string))
   end function real_text

   pure function logical_to_text(value) result(string)
      logical, intent(in) :: value
      character(len=merge(6, 7, value)) :: string

      string = merge('.true. ', '.false.', value)
   end function logical_to_text

   !> `string` in lower case.
   pure function lower(string) result(lowered)
      character(len=*), intent(in) :: string
      character(len=len(string)) :: lowered
      integer :: i, code

      lowered = string
      do i = 1, len(string)
         code = iachar(string(i:i))
         if (code >= iachar('A') .and. code <= iachar('Z')) lowered(i:i) = achar(code + 32)
      end do
   end function lower

   !> Append a text to the `lines`.
   pure subroutine add_line(lines, text)
      type(line_type), allocatable, intent(inout) :: lines(:)
      character(len=*), intent(in) :: text
      type(line_type) :: last

      last%text = text
      if (.not. allocated(lines)) allocate (lines(0))
      lines = [lines, last]
   end subroutine add_line

   !> The trimmed items with `separator` between them.
   pure function join(items, separator) result(string)
      character(len=*), intent(in) :: items(:), separator
      character(len=:), allocatable :: string
      integer :: i

      string = ''
      do i = 1, size(items)
         if (i > 1) string = string//separator
         string = string//trim(items(i))
      end do
   end function join

   !> The items of a `list` 'a, b, c', without blanks around them; a blank text has none.
   pure function split_list(list) result(items)
      character(len=*), intent(in) :: list
      character(len=len(list)), allocatable :: items(:)
      integer :: first, comma

      allocate (items(0))
      first = 1
      do while (first <= len(list))
         comma = index(list(first:), ',')
         if (comma == 0) comma = len(list) - first + 2
         if (len_trim(list(first:first + comma - 2)) > 0) then
            items = [character(len=len(list)) :: items, adjustl(list(first:first + comma - 2))]
         end if
         first = first + comma
      end do
   end function split_list

   !> Append a `piece` to the first `filled` characters of a `page`, which grows if needed.
   pure subroutine append(page, filled, piece)
      character(len=:), allocatable, intent(inout) :: page
      integer(i8), intent(inout) :: filled
      character(len=*), intent(in) :: piece
      integer, parameter :: least_length = 4096
      character(len=:), allocatable :: larger

      if (.not. allocated(page)) allocate (character(len=least_length) :: page)
      if (filled + len(piece) > len(page)) then
         allocate (character(len=2*(filled + len(piece))) :: larger)
         larger(:filled) = page(:filled)
         call move_alloc(larger, page)
      end if
      page(filled + 1:filled + len(piece)) = piece
      filled = filled + len(piece)
   end subroutine append

   !> `string` between two `mark`s; marks within it are doubled.
   pure function quoted(string, mark)
      character(len=*), intent(in) :: string
      character, intent(in) :: mark
      character(len=:), allocatable :: quoted
      integer :: i

      quoted = mark
      do i = 1, len(string)
         quoted = quoted//string(i:i)
         if (string(i:i) == mark) quoted = quoted//mark
      end do
      quoted = quoted//mark
   end function quoted

   !> Read `string` as a decimal integer of the default kind, with an optional sign. Unless
   !> `outcome` is number_ok, `value` is 0.
   pure subroutine read_integer(string, value, outcome)
      character(len=*), intent(in) :: string
      integer, intent(out) :: value, outcome
      integer :: first, status

      value = 0
      outcome = number_malformed
      first = merge(2, 1, scan(string, '+-') == 1)
      if (first > len(string) .or. verify(string(first:), '0123456789') > 0) return
      read (string, *, iostat=status) value
      outcome = merge(number_ok, number_not_finite, status == 0 .and. value >= -huge(value))
      if (outcome /= number_ok) value = 0
   end subroutine read_integer

   !> Read `string` as a real in Fortran or C syntax: 1, 1., .5, 1.0e-3, 1d0. Unless `outcome` is
   !> number_ok, `value` is 0.
   pure subroutine read_real(string, value, outcome)
      character(len=*), intent(in) :: string
      real(wp), intent(out) :: value
      integer, intent(out) :: outcome

      call c_read_real(string, len(string), value, outcome)
   end subroutine read_real

   !> The fewest digits that restore the number, in Python's format: 16.0, 1e-05, 0.1.
   pure function number_text(number) result(string)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: string

      string = trim(real_text(number, fewest_digits, 0))
   end function number_text

   !> A number for people: ten digits at most, empty if it is not finite.
   pure function short_text(number) result(string)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: string

      string = trim(real_text(number, few_digits, 0))
   end function short_text

end module text
