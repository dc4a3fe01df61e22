!> The Laue class of a space group, by its number or its Hermann-Mauguin symbol: '225' and 'Fm-3m'
!> are of m-3m (International Tables for Crystallography A). Numbers that are symbols of point
!> groups too, such as 222, are refused.
module space_groups
   use text, only: lower, number_ok, read_integer
   implicit none
   private
   public :: laue_class

   !> Names of the Laue classes, and the greatest number of the space groups of each.
   character(len=*), parameter :: names(11) = [character(len=5) :: '-1', '2/m', 'mmm', '4/m', &
      & '4/mmm', '-3', '-3m', '6/m', '6/mmm', 'm-3', 'm-3m']
   integer, parameter :: last(11) = [2, 15, 74, 88, 142, 148, 167, 176, 194, 206, 230]
   !> Numbers that are symbols of other point groups.
   integer, parameter :: ambiguous(7) = [2, 3, 4, 6, 23, 32, 222]
   !> Symbols of cubic groups without a -3.
   character(len=*), parameter :: cubic(8) = [character(len=4) :: '432', '4132', '4232', '4332', &
      & '-43m', '-43n', '-43c', '-43d']

contains

   !> The Laue class, or '' of what is no space group.
   pure function laue_class(word) result(name)
      !> A number or a symbol.
      character(len=*), intent(in) :: word
      character(len=:), allocatable :: name, symbol, rest
      integer :: number, outcome, i

      name = ''
      call read_integer(word, number, outcome)
      if (outcome == number_ok) then
         if (number < 1 .or. number > 230 .or. any(ambiguous == number)) return
         name = trim(names(findloc(number <= last, .true., 1)))
         return
      end if
      symbol = ''
      do i = 2, len_trim(word)
         if (scan(word(i:i), ' _') == 0) symbol = symbol//lower(word(i:i))
      end do
      if (len(symbol) == 0 .or. scan(word(:1), 'PABCFIRHpabcfirh') == 0 &
         & .or. verify(symbol, '-0123456/mabcdne') > 0) then
         return
      end if
      ! 'P 1 21/c 1' is 'P21/c'.
      i = len(symbol)
      if (i > 2 .and. symbol(1:1) == '1' .and. symbol(i:i) == '1') symbol = symbol(2:i - 1)
      rest = symbol(verify(symbol, '-') + 1:)
      i = index(symbol, '-3')
      if (i > 1) then
         name = trim(merge('m-3 ', 'm-3m', i + 1 == len(symbol)))
      else if (symbol == '23' .or. symbol == '213') then
         name = 'm-3'
      else if (any(cubic == symbol)) then
         name = 'm-3m'
      else if (symbol == '1' .or. symbol == '-1') then
         name = '-1'
      else if (scan(symbol(verify(symbol, '-'):), '46') == 1) then
         ! What follows the axis, its screw and the plane normal to it.
         if (scan(rest, '12345') == 1) rest = rest(2:)
         if (index(rest, '/') == 1) rest = rest(3:)
         name = symbol(verify(symbol, '-'):verify(symbol, '-'))//trim(merge('/m  ', '/mmm', &
            & len(rest) == 0))
      else if (scan(symbol(verify(symbol, '-'):), '3') == 1) then
         if (scan(rest, '12') == 1 .and. scan(word(:1), 'RrHh') == 0) rest = rest(2:)
         name = trim(merge('-3 ', '-3m', len(rest) == 0))
      else if (len(symbol) == 1 .or. symbol == '21' .or. index(symbol, '/') > 0) then
         name = '2/m'
      else if (len(symbol) > 2) then
         name = 'mmm'
      end if
   end function laue_class
end module space_groups
