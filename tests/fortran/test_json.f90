!> JSON documents, to the byte, and their numbers.
program test_json
   use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
   use json, only: json_type
   use kinds, only: wp
   use text, only: number_malformed, number_not_finite, number_ok, number_text, read_real
   use testing, only: check, finish
   implicit none

   character, parameter :: newline = achar(10)
   type(json_type) :: document
   real(wp) :: tiny_value
   integer :: i

   call check('nothing written', document%text() == '')
   call document%begin_object('')
   call document%put('text', 'a "b" \ c'//newline//achar(1))
   call document%put('real', -0.1_wp)
   call document%put('large', 1.0e22_wp)
   call document%put('integer', 7)
   call document%put('logical', .false.)
   call document%put('nan', ieee_value(1.0_wp, ieee_quiet_nan))
   call document%put_json('none', 'null')
   call document%begin_array('rows')
   call document%put('', [1.0_wp, ieee_value(1.0_wp, ieee_positive_inf)])
   call document%begin_object('')
   call document%end_object()
   call document%end_array()
   call document%put('matrix', reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], [2, 2]))
   call document%put('empty', [real(wp) ::])
   call document%end_object()
   call check('every kind of value', &
      & document%text() == '{'//newline//' "text": "a \"b\" \\ c\n\u0001",'//newline &
      & //' "real": -0.1,'//newline//' "large": 1e+22,'//newline//' "integer": 7,'//newline &
      & //' "logical": false,'//newline//' "nan": null,'//newline//' "none": null,'//newline &
      & //' "rows": ['//newline//'  [1.0, null],'//newline//'  {}'//newline//' ],'//newline &
      & //' "matrix": ['//newline//'  [1.0, 3.0],'//newline//'  [2.0, 4.0]'//newline//' ],' &
      & //newline//' "empty": []'//newline//'}'//newline, document%text())

   ! As Python's repr writes them: stored identities of physics depend on it.
   call check('numbers as Python writes them', &
      & number_text(16.0_wp)//' '//number_text(0.1_wp)//' '//number_text(1.0e-5_wp)//' ' &
      & //number_text(1.0e15_wp)//' '//number_text(1.5e16_wp)//' '//number_text(-0.0625_wp)//' ' &
      & //number_text(1.0_wp/3.0_wp)//' '//number_text(123456.789_wp)//' '//number_text(0.0_wp) &
      & //' '//number_text(2.5e-4_wp) == '16.0 0.1 1e-05 1000000000000000.0 1.5e+16 -0.0625 ' &
      & //'0.3333333333333333 123456.789 0.0 0.00025')
   call check('at powers of two, at the end of the range, below nothing', &
      & number_text(2.0_wp**(-44))//' '//number_text(tiny(1.0_wp)/2.0_wp**52) &
      & //' '//number_text(huge(1.0_wp))//' ' &
      & //number_text(-0.0_wp) == '5.684341886080802e-14 5e-324 1.7976931348623157e+308 -0.0')

   ! Out of range is also what has no exponent, or one that does not decide alone.
   call check('too large', all([outcome_of('1d400'), outcome_of(repeat('1', 400)//'e-5'), &
      & outcome_of('-inf')] == number_not_finite))
   call check('too small', &
      & all([outcome_of('1e-400'), outcome_of('0.'//repeat('0', 400)//'1e5')] == number_ok))
   call read_real('1d-400', tiny_value, i)
   call check('too small is zero', i == number_ok .and. .not. abs(tiny_value) > 0.0_wp)
   call check('no number', all([outcome_of('+-1'), outcome_of('1e'), outcome_of('.'), &
      & outcome_of('')] == number_malformed))

   document = json_type()
   call document%begin_array('')
   do i = 1, 2000
      call document%put('', 'a text that makes the page grow')
   end do
   call document%end_array()
   call check('a long document', len(document%text()) == 2 + 2000*36 + 1)
   call finish()

contains

   integer function outcome_of(string)
      character(len=*), intent(in) :: string
      real(wp) :: value

      call read_real(string, value, outcome_of)
   end function outcome_of
end program test_json
