!> Numbers to text, for messages and result files.
!>
!> The lengths of numbers' texts are expressions: gfortran keeps the length of a deferred-length result in static memory of the
!> caller, where threads overwrite each other's.
module text
   use kinds, only: wp, i8
   implicit none
   private
   public :: to_text, fixed, lower, join, split_list, quoted

   interface to_text
      module procedure integer_to_text
      module procedure long_to_text
      module procedure real_to_text
      module procedure digits_to_text
      module procedure logical_to_text
   end interface to_text

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
      character(len=24) :: buffer

      write (buffer, '(i0)') value
      length = len_trim(buffer)
   end function decimal_length

   pure function real_to_text(value) result(string)
      real(wp), intent(in) :: value
      character(len=len_trim(significant(value, 6))) :: string

      string = significant(value, 6)
   end function real_to_text

   pure function digits_to_text(value, digits) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: digits
      character(len=len_trim(significant(value, digits))) :: string

      string = significant(value, digits)
   end function digits_to_text

   !> A `value` with `n` significant digits, without trailing zeros; 17 round-trip a double.
   pure function significant(value, n) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: n
      character(len=40) :: string
      character(len=40) :: layout
      integer :: last

      if (.not. abs(value) <= huge(value)) then
         string = not_finite(value)
         return
      end if
      write (layout, '(a,i0,a,i0,a)') '(es', n + 9, '.', n - 1, 'e3)'
      write (string, layout) value
      read (string(index(string, 'E') + 1:), *) last
      if (last >= -4 .and. last < n) then
         write (layout, '(a,i0,a)') '(f40.', n - 1 - last, ')'
         write (string, layout) value
         last = verify(string, '0', back=.true.)
         if (index(string, '.') > 0) string = string(:min(len(string), merge(last + 1, last, string(last:last) == '.')))//' '
      end if
      string = with_leading_zero(string)
   end function significant

   !> A `value` with so many `decimals` after the point, and no point without them.
   pure function fixed(value, decimals) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      character(len=len_trim(with_decimals(value, decimals))) :: string

      string = with_decimals(value, decimals)
   end function fixed

   pure function with_decimals(value, decimals) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      character(len=340) :: string
      character(len=12) :: layout

      if (.not. abs(value) <= huge(value)) then
         string = not_finite(value)
         return
      end if
      write (layout, '(a,i0,a)') '(f340.', decimals, ')'
      write (string, layout) value
      if (decimals == 0) string(len(string):) = ' '
      string = with_leading_zero(string)
   end function with_decimals

   pure function not_finite(value) result(string)
      real(wp), intent(in) :: value
      character(len=9) :: string

      string = 'NaN'
      if (value > huge(value)) string = 'Infinity'
      if (value < -huge(value)) string = '-Infinity'
   end function not_finite

   !> '0.5' for ' .5', without blanks before it.
   pure function with_leading_zero(number) result(string)
      character(len=*), intent(in) :: number
      character(len=len(number)) :: string

      string = adjustl(number)
      if (string(1:1) == '.') string = '0'//string
      if (string(1:2) == '-.') string = '-0'//string(2:)
   end function with_leading_zero

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

   !> The trimmed items with `separator` between them.
   pure function join(items, separator) result(string)
      character(len=*), intent(in) :: items(:)
      character(len=*), intent(in) :: separator
      character(len=:), allocatable :: string
      integer :: i

      string = ''
      do i = 1, size(items)
         if (i > 1) string = string//separator
         string = string//trim(items(i))
      end do
   end function join

   !> The items of a `list` 'a, b, c', without blanks around them; none of a blank text.
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

   !> `string` between two `mark`s, those within it doubled.
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
end module text
