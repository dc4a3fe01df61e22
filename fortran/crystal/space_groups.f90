!> The Laue class of a space group, by its number or its Hermann-Mauguin symbol: '225' and 'Fm-3m'
!> are of m-3m (International Tables for Crystallography A). Numbers that are symbols of point
!> groups too, such as 222, are refused.
module space_groups
   use text, only: lower, number_ok, read_integer
   implicit none
   private
   public :: laue_class

   !> Names of the Laue classes, and the number of the last space group of each.
   character(len=*), parameter :: names(11) = [character(len=5) :: '-1', '2/m', 'mmm', '4/m', &
      & '4/mmm', '-3', '-3m', '6/m', '6/mmm', 'm-3', 'm-3m']
   integer, parameter :: last(11) = [2, 15, 74, 88, 142, 148, 167, 176, 194, 206, 230]
   !> Numbers that are symbols of point groups as well, of another class than the space group.
   integer, parameter :: ambiguous(7) = [2, 3, 4, 6, 23, 32, 222]
   !> Symbols, without the letter of the lattice, of the cubic groups of class m-3m without a -3.
   character(len=*), parameter :: cubic(8) = [character(len=4) :: '432', '4132', '4232', '4332', &
      & '-43m', '-43n', '-43c', '-43d']

contains

   !> The Laue class of a space group; '' if the word is none.
   pure function laue_class(word) result(name)
      !> A number or a symbol.
      character(len=*), intent(in) :: word
      character(len=:), allocatable :: name, symbol, rest
      !> Position of the main axis in the symbol, after the minus of a rotoinversion.
      integer :: axis
      integer :: number, outcome, i

      name = ''
      call read_integer(word, number, outcome)
      if (outcome == number_ok) then
         if (number < 1 .or. number > 230 .or. any(ambiguous == number)) return
         name = trim(names(findloc(number <= last, .true., 1)))
         return
      end if
      ! The first character is the letter of the lattice.
      symbol = ''
      do i = 2, len_trim(word)
         if (scan(word(i:i), ' _') == 0) symbol = symbol//lower(word(i:i))
      end do
      if (len(symbol) == 0 .or. scan(word(:1), 'PABCFIRHpabcfirh') == 0 &
         & .or. verify(symbol, '-0123456/mabcdne') > 0 .or. index(symbol//'-', '--') > 0) then
         return
      end if
      ! The full symbol 'P 1 21/c 1' is 'P21/c'.
      i = len(symbol)
      if (i > 2 .and. symbol(1:1) == '1' .and. symbol(i:i) == '1') symbol = symbol(2:i - 1)
      ! Older symbols of cubic groups have no minus: 'Fm3m', 'F43m'.
      if (index(symbol, '3') == 2 .and. scan(symbol(1:1), 'mnad') == 1) then
         symbol = symbol(1:1)//'-'//symbol(2:)
      end if
      axis = verify(symbol, '-')
      rest = symbol(axis + 1:)
      i = index(symbol, '-3')
      if (i > 1) then
         ! A -3 after the first axis is that of a cubic group.
         name = trim(merge('m-3 ', 'm-3m', i + 1 == len(symbol)))
      else if (symbol == '23' .or. symbol == '213') then
         name = 'm-3'
      else if (any(cubic == symbol .or. cubic == '-'//symbol)) then
         name = 'm-3m'
      else if (symbol == '1' .or. symbol == '-1') then
         name = '-1'
      else if (scan(symbol(axis:axis), '46') == 1) then
         ! Remove the screw of the axis, then the plane normal to it. Further elements are of the
         ! higher class.
         if (scan(rest, '12345') == 1) rest = rest(2:)
         if (index(rest, '/') == 1) rest = rest(3:)
         name = symbol(axis:axis)//trim(merge('/m  ', '/mmm', len(rest) == 0))
      else if (symbol(axis:axis) == '3') then
         ! A 1 or 2 after the axis is its screw, except in R32.
         if (scan(rest, '12') == 1 .and. scan(word(:1), 'RrHh') == 0) rest = rest(2:)
         name = trim(merge('-3 ', '-3m', len(rest) == 0))
      else if (index(symbol, '11') > 0) then
         ! The unique axis is not y.
         return
      else if (len(symbol) == 1 .or. symbol == '21' .or. index(symbol, '/') > 0) then
         ! A glide along b, or a cell centred in the plane of a and c: the unique axis is not y.
         if (scan(symbol, 'b') == 0 .and. scan(word(:1), 'Bb') == 0) name = '2/m'
      else if (len(symbol) > 2) then
         name = 'mmm'
      end if
   end function laue_class
end module space_groups
