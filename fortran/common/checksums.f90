!> The checksum of files and rows, by which a change is seen.
module checksums
   use kinds, only: i8
   implicit none
   private
   public :: checksum, hash_of

contains

   !> Fowler, Noll and Vo's hash of 64 bits (FNV-1a) of some bytes, in hexadecimal digits; products wrap around.
   pure function checksum(bytes) result(digits)
      !> Of any number.
      character(len=*), intent(in) :: bytes
      character(len=16) :: digits

      write (digits, '(z16.16)') hash_of(bytes)
   end function checksum

   !> The same as a number.
   pure integer(i8) function hash_of(bytes) result(hash)
      !> Of any number.
      character(len=*), intent(in) :: bytes
      integer(i8), parameter :: prime = 1099511628211_i8, basis = -3750763034362895579_i8
      integer :: i

      hash = basis
      do i = 1, len(bytes)
         hash = ieor(hash, int(iachar(bytes(i:i)), i8))*prime
      end do
   end function hash_of
end module checksums
