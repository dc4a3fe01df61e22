!> Numbers to text, for messages and result files.
module text
   use kinds, only: wp, i8
   implicit none
   private
   public :: to_text, fixed, lower, join, split_list

   interface to_text
      module procedure integer_to_text
      module procedure long_to_text
      module procedure real_to_text
      module procedure logical_to_text
   end interface to_text

contains

   pure function integer_to_text(value) result(string)
      integer, intent(in) :: value
      character(len=:), allocatable :: string
      character(len=24) :: buffer

      write (buffer, '(i0)') value
      string = trim(buffer)
   end function integer_to_text

   pure function long_to_text(value) result(string)
      integer(i8), intent(in) :: value
      character(len=:), allocatable :: string
      character(len=24) :: buffer

      write (buffer, '(i0)') value
      string = trim(buffer)
   end function long_to_text

   !> `digits` significant digits (default 6, without trailing zeros; 17 round-trips a double).
   pure function real_to_text(value, digits) result(string)
      real(wp), intent(in) :: value
      integer, intent(in), optional :: digits
      character(len=:), allocatable :: string
      character(len=40) :: buffer, layout
      integer :: n, e, last

      n = 6
      if (present(digits)) n = digits
      if (value /= value) then
         string = 'NaN'
         return
      end if
      if (abs(value) > huge(value)) then
         string = merge('Infinity ', '-Infinity', value > 0.0_wp)
         string = trim(string)
         return
      end if
      write (layout, '(a,i0,a,i0,a)') '(es', n + 9, '.', n - 1, 'e3)'
      write (buffer, layout) value
      buffer = adjustl(buffer)
      e = index(buffer, 'E')
      read (buffer(e + 1:), *) last
      if (last >= -4 .and. last < n) then
         write (layout, '(a,i0,a)') '(f40.', n - 1 - last, ')'
         write (buffer, layout) value
         buffer = adjustl(buffer)
         string = trim(buffer)
         if (index(string, '.') > 0) then
            last = len(string)
            do while (string(last:last) == '0')
               last = last - 1
            end do
            if (string(last:last) == '.') last = last + 1
            if (last > len(string)) then
               string = string//'0'
            else
               string = string(:last)
            end if
         end if
         if (string(1:1) == '.') string = '0'//string
         if (len(string) > 1) then
            if (string(1:2) == '-.') string = '-0.'//string(3:)
         end if
      else
         string = trim(buffer)
      end if
   end function real_to_text

   !> A `value` with so many `decimals` after the point, and no point without them.
   pure function fixed(value, decimals) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      character(len=:), allocatable :: string
      character(len=340) :: buffer, layout

      if (.not. abs(value) <= huge(value)) then
         string = real_to_text(value)
         return
      end if
      write (layout, '(a,i0,a)') '(f340.', decimals, ')'
      write (buffer, layout) value
      string = trim(adjustl(buffer))
      if (decimals == 0) string = string(:len(string) - 1)
      if (string(1:1) == '.') string = '0'//string
      if (index(string, '-.') == 1) string = '-0'//string(2:)
   end function fixed

   pure function logical_to_text(value) result(string)
      logical, intent(in) :: value
      character(len=:), allocatable :: string

      if (value) then
         string = '.true.'
      else
         string = '.false.'
      end if
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
end module text
