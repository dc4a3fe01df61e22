!> The checksum of files and rows, by which a change is seen.
module checksums
   use kinds, only: i8
   implicit none
   private
   public :: checksum

contains

   !> Fowler, Noll and Vo's hash of 64 bits (FNV-1a) of some bytes, in hexadecimal digits; products wrap around.
   pure function checksum(bytes) result(digits)
      !> Of any number.
      character(len=*), intent(in) :: bytes
      character(len=16) :: digits
      integer(i8), parameter :: prime = 1099511628211_i8, basis = -3750763034362895579_i8
      integer(i8) :: hash
      integer :: i

      hash = basis
      do i = 1, len(bytes)
         hash = ieor(hash, int(iachar(bytes(i:i)), i8))*prime
      end do
      write (digits, '(z16.16)') hash
   end function checksum
end module checksums
