!> Text to numbers, strictly: what is read is a whole number or nothing, and never NaN or Infinity. And back, to the last bit.
module numbers
   use kinds, only: i8, wp
   use text, only: lower, to_text
   implicit none
   private
   public :: number_text, read_integer, read_real, number_ok, number_not_finite, number_malformed

   !> What became of a text: a finite number; NaN, Infinity or an overflow; no number at all.
   integer, parameter :: number_ok = 0, number_not_finite = 1, number_malformed = 2

contains

   !> A decimal integer with an optional sign that fits the default kind.
   !> `value` of `string`, if `outcome` is number_ok.
   pure subroutine read_integer(string, value, outcome)
      character(len=*), intent(in) :: string
      integer, intent(out) :: value
      integer, intent(out) :: outcome
      integer(i8) :: total
      integer :: first, i

      value = 0
      outcome = number_malformed
      first = 1
      if (len(string) > 0) then
         if (scan(string(1:1), '+-') == 1) first = 2
      end if
      if (first > len(string)) return
      if (verify(string(first:), '0123456789') > 0) return
      outcome = number_not_finite
      total = 0_i8
      do i = first, len(string)
         total = 10_i8*total + (iachar(string(i:i)) - iachar('0'))
         if (total > int(huge(value), i8)) return
      end do
      value = int(total)
      if (string(1:1) == '-') value = -value
      outcome = number_ok
   end subroutine read_integer

   !> A real in Fortran or C syntax: 1, 1., .5, 1.0e-3, 1d0.
   !> `value` of `string`, if `outcome` is number_ok.
   pure subroutine read_real(string, value, outcome)
      character(len=*), intent(in) :: string
      real(wp), intent(out) :: value
      integer, intent(out) :: outcome
      character(len=:), allocatable :: rest
      integer :: digits, status

      value = 0.0_wp
      outcome = number_malformed
      rest = lower(string)
      if (len(rest) > 0) then
         if (scan(rest(1:1), '+-') == 1) rest = rest(2:)
      end if
      if (rest == 'nan' .or. rest == 'inf' .or. rest == 'infinity' .or. index(rest, 'nan(') == 1) then
         outcome = number_not_finite
         return
      end if
      digits = 0
      call skip_digits(rest, digits)
      if (len(rest) > 0) then
         if (rest(1:1) == '.') then
            rest = rest(2:)
            call skip_digits(rest, digits)
         end if
      end if
      if (digits == 0) return
      if (len(rest) > 0) then
         if (scan(rest(1:1), 'ed') /= 1) return
         rest = rest(2:)
         if (len(rest) > 0) then
            if (scan(rest(1:1), '+-') == 1) rest = rest(2:)
         end if
         digits = 0
         call skip_digits(rest, digits)
         if (digits == 0 .or. len(rest) > 0) return
      end if
      outcome = number_not_finite
      read (string, *, iostat=status) value
      if (status /= 0 .or. .not. abs(value) <= huge(value)) then
         value = 0.0_wp
      else
         outcome = number_ok
      end if
   end subroutine read_real

   !> Take the leading digits off `string` and add their number to `count`.
   pure subroutine skip_digits(string, count)
      character(len=:), allocatable, intent(inout) :: string
      integer, intent(inout) :: count
      integer :: n

      n = verify(string, '0123456789') - 1
      if (n < 0) n = len(string)
      count = count + n
      string = string(n + 1:)
   end subroutine skip_digits

   !> The fewest digits that bring the number back, written as Python does: 16.0, 1e-05, 0.1.
   pure function number_text(number) result(string)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: string
      character(len=:), allocatable :: digits
      character(len=32) :: buffer
      character(len=2), parameter :: roundings(2) = ['rn', 'ru']
      character(len=14) :: layout
      real(wp) :: again
      integer :: n, k, exponent, mark

      if (.not. abs(number) <= huge(number)) then
         string = to_text(number)
         return
      end if
      ! Fewer than 15 digits, but for zeros at the end, are enough only below the normal numbers. The numbers below a power of two are
      ! closer than those above, so that rounding up may save a digit.
      search: do n = merge(15, 1, .not. abs(number) < tiny(number)), 17
         do k = 1, merge(2, 1, fraction(abs(number)) <= 0.5_wp)
            layout = '('//roundings(k)//',es32.'//achar(48 + (n - 1)/10)//achar(48 + mod(n - 1, 10))//'e3)'
            write (buffer, layout) abs(number)
            read (buffer, '(es32.0)') again
            if (.not. abs(again - abs(number)) > 0.0_wp) exit search
         end do
      end do search
      buffer = adjustl(buffer)
      mark = index(buffer, 'E')
      read (buffer(mark + 1:), *) exponent
      digits = buffer(1:1)//buffer(3:mark - 1)
      digits = digits(:max(1, verify(digits, '0', back=.true.)))
      n = len(digits)
      if (exponent < -4 .or. exponent >= 16) then
         write (buffer, '(sp,i0.2)') exponent
         string = digits(1:1)
         if (n > 1) string = string//'.'//digits(2:)
         string = string//'e'//trim(buffer)
      else if (exponent < 0) then
         string = '0.'//repeat('0', -exponent - 1)//digits
      else if (n <= exponent + 1) then
         string = digits//repeat('0', exponent + 1 - n)//'.0'
      else
         string = digits(:exponent + 1)//'.'//digits(exponent + 2:)
      end if
      if (sign(1.0_wp, number) < 0.0_wp) string = '-'//string
   end function number_text
end module numbers
