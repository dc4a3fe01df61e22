!> Text to numbers, strictly: what is read is a whole number or nothing, and never NaN or Infinity. And back, to the last bit.
module numbers
   use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int
   use kinds, only: wp
   use text, only: few_digits, fewest_digits, real_text
   implicit none
   private
   public :: number_text, short_text, read_integer, read_real, number_ok, number_not_finite, number_malformed

   !> What became of a text: a finite number; NaN, Infinity or an overflow; no number at all.
   integer, parameter :: number_ok = 0, number_not_finite = 1, number_malformed = 2

   interface
      pure subroutine c_read_integer(text, length, value, outcome) bind(c, name='bayesindent_read_integer')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: text(*)
         integer(c_int), value :: length
         integer(c_int), intent(out) :: value, outcome
      end subroutine c_read_integer
      pure subroutine c_read_real(text, length, value, outcome) bind(c, name='bayesindent_read_real')
         import :: c_char, c_double, c_int
         character(kind=c_char), intent(in) :: text(*)
         integer(c_int), value :: length
         real(c_double), intent(out) :: value
         integer(c_int), intent(out) :: outcome
      end subroutine c_read_real
   end interface

contains

   !> A decimal integer with an optional sign that fits the default kind.
   !> `value` of `string`, if `outcome` is number_ok; else 0.
   pure subroutine read_integer(string, value, outcome)
      character(len=*), intent(in) :: string
      integer, intent(out) :: value
      integer, intent(out) :: outcome

      call c_read_integer(string, len(string), value, outcome)
   end subroutine read_integer

   !> A real in Fortran or C syntax: 1, 1., .5, 1.0e-3, 1d0.
   !> `value` of `string`, if `outcome` is number_ok; else 0.
   pure subroutine read_real(string, value, outcome)
      character(len=*), intent(in) :: string
      real(wp), intent(out) :: value
      integer, intent(out) :: outcome

      call c_read_real(string, len(string), value, outcome)
   end subroutine read_real

   !> The fewest digits that bring the number back, written as Python does: 16.0, 1e-05, 0.1.
   pure function number_text(number) result(string)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: string

      string = trim(real_text(number, fewest_digits, 0))
   end function number_text

   !> A number for people: ten digits at most, nothing where it is not finite.
   pure function short_text(number) result(string)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: string

      string = trim(real_text(number, few_digits, 0))
   end function short_text
end module numbers
