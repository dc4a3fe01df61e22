!> The truncations that &surrogate `scan` compares: '1, 2, 3 x 8, 10, 12' is each of these degrees with each of these bandlimits.
module truncation_scan
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use text, only: number_ok, read_integer, split_list
   implicit none
   private
   public :: read_scan

contains

   !> `pairs` (2, n) of degree and bandlimit; none of a blank text.
   pure subroutine read_scan(text, pairs, error)
      character(len=*), intent(in) :: text
      integer, allocatable, intent(out) :: pairs(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: degrees(:), bandlimits(:)
      integer :: i, j, cross

      allocate (pairs(2, 0))
      if (len_trim(text) == 0) return
      cross = scan(text, 'xX')
      if (cross > 0) then
         call read_list(text(:cross - 1), degrees)
         call read_list(text(cross + 1:), bandlimits)
         pairs = reshape([((degrees(i), bandlimits(j), j=1, size(bandlimits)), i=1, size(degrees))], &
            & [2, size(degrees)*size(bandlimits)])
      end if
      if (size(pairs) == 0) call raise(error, ''''//printable(text)//''' is not of the form ''1, 2, 3 x 8, 10, 12'' ' &
         & //'(degrees x bandlimits)', exit_bad_input)
   end subroutine read_scan

   !> The integers of a list; none if one of its items is no integer.
   pure subroutine read_list(text, list)
      character(len=*), intent(in) :: text
      integer, allocatable, intent(out) :: list(:)
      character(len=len(text)), allocatable :: items(:)
      character(len=len(text)) :: commas
      integer :: i, outcome

      commas = text
      do i = 1, len(text)
         if (text(i:i) == ' ') commas(i:i) = ','
      end do
      allocate (items, source=split_list(commas))
      allocate (list(size(items)))
      do i = 1, size(items)
         call read_integer(trim(items(i)), list(i), outcome)
         if (outcome /= number_ok) exit
      end do
      if (i <= size(items)) list = [integer ::]
   end subroutine read_list
end module truncation_scan
