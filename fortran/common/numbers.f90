!> Text to numbers, strictly: what is read is a whole number or nothing, and never NaN or Infinity. And back, to the last bit.
module numbers
   use, intrinsic :: iso_c_binding, only: c_char, c_double, c_null_char, c_null_ptr, c_ptr
   use kinds, only: i8, wp
   use text, only: lower, to_text
   implicit none
   private
   public :: number_text, short_text, read_integer, read_real, number_ok, number_not_finite, number_malformed

   !> What became of a text: a finite number; NaN, Infinity or an overflow; no number at all.
   integer, parameter :: number_ok = 0, number_not_finite = 1, number_malformed = 2

   !> Exact.
   real(wp), parameter :: powers_of_ten(0:15) = [1.0e0_wp, 1.0e1_wp, 1.0e2_wp, 1.0e3_wp, 1.0e4_wp, 1.0e5_wp, 1.0e6_wp, 1.0e7_wp, &
      & 1.0e8_wp, 1.0e9_wp, 1.0e10_wp, 1.0e11_wp, 1.0e12_wp, 1.0e13_wp, 1.0e14_wp, 1.0e15_wp]

   interface
      pure real(c_double) function c_strtod(string, end) bind(c, name='strtod')
         import :: c_char, c_double, c_ptr
         character(kind=c_char), intent(in) :: string(*)
         type(c_ptr), value :: end
      end function c_strtod
   end interface

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

      call read_short(string, value, outcome)
      if (outcome == number_ok) return
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

   !> The number of a usual text, without the library of Fortran, which takes ten times as long. Up to 15 digits are an integer that binary
   !> numbers hold, and it is divided by a power of ten that they hold too: one rounding, as in reading. More are for `strtod`, without
   !> a point, which depends on the country that is set. What is long, large, small or malformed is left as malformed.
   pure subroutine read_short(string, value, outcome)
      character(len=*), intent(in) :: string
      real(wp), intent(out) :: value
      integer, intent(out) :: outcome
      integer, parameter :: most_digits = 15, longest = 40
      character(len=longest + 16) :: digits
      integer :: n, decimals, exponent, sign_of_exponent, digit, i, first
      integer(i8) :: whole
      logical :: after_point

      value = 0.0_wp
      outcome = number_malformed
      first = 1
      if (len(string) > 1) first = 1 + scan(string(1:1), '+-')
      whole = 0
      n = 0
      decimals = 0
      after_point = .false.
      do i = first, len(string)
         digit = iachar(string(i:i)) - iachar('0')
         if (digit >= 0 .and. digit <= 9) then
            if (n == longest) return
            n = n + 1
            digits(n:n) = string(i:i)
            if (n <= most_digits) whole = 10*whole + digit
            if (after_point) decimals = decimals + 1
         else if (string(i:i) == '.' .and. .not. after_point) then
            after_point = .true.
         else
            exit
         end if
      end do
      if (n == 0) return
      exponent = 0
      if (i <= len(string)) then
         if (scan(string(i:i), 'eEdD') == 0 .or. i == len(string)) return
         i = i + 1
         sign_of_exponent = merge(-1, 1, string(i:i) == '-')
         if (scan(string(i:i), '+-') == 1) i = i + 1
         if (i > len(string) .or. len(string) > i + 2) return
         do i = i, len(string)
            digit = iachar(string(i:i)) - iachar('0')
            if (digit < 0 .or. digit > 9) return
            exponent = 10*exponent + digit
         end do
         exponent = sign_of_exponent*exponent
      end if
      if (n <= most_digits .and. exponent == 0) then
         value = real(whole, wp)/powers_of_ten(decimals)
      else
         exponent = exponent - decimals
         if (abs(exponent) > 999) return
         digits(n + 1:n + 2) = merge('e-', 'e+', exponent < 0)
         do i = n + 5, n + 3, -1
            digits(i:i) = achar(iachar('0') + mod(abs(exponent)/10**(n + 5 - i), 10))
         end do
         digits(n + 6:n + 6) = c_null_char
         value = c_strtod(digits, c_null_ptr)
         if (.not. (abs(value) <= huge(value) .and. (abs(value) >= tiny(value) .or. verify(digits(:n), '0') == 0))) then
            value = 0.0_wp
            return
         end if
      end if
      if (string(1:1) == '-') value = -value
      outcome = number_ok
   end subroutine read_short

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
      character(len=32) :: buffer
      character(len=2), parameter :: roundings(2) = ['rn', 'ru']
      character(len=14) :: layout
      real(wp) :: again
      integer :: n, k, outcome

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
            call read_short(trim(adjustl(buffer)), again, outcome)
            if (outcome /= number_ok) read (buffer, '(es32.0)') again
            if (.not. abs(again - abs(number)) > 0.0_wp) exit search
         end do
      end do search
      string = spelled(buffer, number)
   end function number_text

   !> The digits of a `number` in Fortran's exponential form as Python writes them, without zeros at their end.
   pure function spelled(exponential, number) result(string)
      character(len=*), intent(in) :: exponential
      real(wp), intent(in) :: number
      character(len=:), allocatable :: string
      character(len=:), allocatable :: digits
      character(len=32) :: buffer
      integer :: n, exponent, mark

      buffer = adjustl(exponential)
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
   end function spelled

   !> A number for people: ten digits at most, nothing where it is not finite.
   pure function short_text(number) result(text)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: text
      character(len=24) :: digits
      integer :: n

      text = ''
      if (.not. abs(number) <= huge(number)) return
      call write_short(number, digits, n)
      if (abs(number) < tiny(number)) then
         text = '0'
      else if (n > 0) then
         text = digits(:n)
      else
         write (digits, '(es24.9e3)') abs(number)
         text = spelled(digits, number)
         if (index(text, '.0') == len(text) - 1) text = text(:len(text) - 2)
      end if
   end function short_text

   !> The `n` ten digits at most of the usual number, without those of the library, which take twenty times as long; n = 0 for a number
   !> that is very large or small, or so near the middle of two that a product in binary could be rounded to the wrong one.
   pure subroutine write_short(number, digits, n)
      real(wp), intent(in) :: number
      character(len=24), intent(out) :: digits
      integer, intent(out) :: n
      integer, parameter :: most_digits = 10
      real(wp), parameter :: least = 1.0e-4_wp, near = 1.0e-4_wp
      real(wp) :: scaled
      integer(i8) :: whole, part
      integer :: decimals, i

      n = 0
      if (.not. (abs(number) >= least .and. abs(number) < powers_of_ten(most_digits - 1))) return
      decimals = most_digits - 1
      do while (abs(number) >= powers_of_ten(most_digits - decimals))
         decimals = decimals - 1
      end do
      do while (abs(number)*powers_of_ten(decimals) < powers_of_ten(most_digits - 1))
         decimals = decimals + 1
      end do
      scaled = abs(number)*powers_of_ten(decimals)
      whole = nint(scaled, i8)
      if (abs(abs(scaled - real(whole, wp)) - 0.5_wp) < near) return
      do while (decimals > 0 .and. mod(whole, 10_i8) == 0)
         whole = whole/10
         decimals = decimals - 1
      end do
      ! Written from the last digit.
      part = whole
      i = len(digits)
      do
         digits(i:i) = achar(iachar('0') + int(mod(part, 10_i8)))
         part = part/10
         i = i - 1
         n = n + 1
         if (n == decimals) then
            digits(i:i) = '.'
            i = i - 1
         end if
         if (part == 0 .and. n > decimals) exit
      end do
      if (number < 0.0_wp) then
         digits(i:i) = '-'
         i = i - 1
      end if
      n = len(digits) - i
      digits(:n) = digits(i + 1:)
   end subroutine write_short
end module numbers
