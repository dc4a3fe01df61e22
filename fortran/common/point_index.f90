!> Points to the last bit among many: a hash table of their bits, so that a look-up does not depend on how many there are.
module point_index
   use kinds, only: i8, wp
   implicit none
   private
   public :: point_index_type, new_point_index, number_equal

   type :: point_index_type
      private
      !> (coordinate, point).
      real(wp), allocatable :: points(:, :)
      !> Numbers of points, 0 where a place is free; a point is in the first free place from that of its hash on.
      integer, allocatable :: places(:)
      !> The next point that is the same as each, 0 where there is none.
      integer, allocatable :: next(:)
   contains
      procedure :: find
   end type point_index_type

contains

   !> The index of `points`, which may be there more than once.
   pure subroutine new_point_index(points, index)
      !> (coordinate, point).
      real(wp), intent(in) :: points(:, :)
      type(point_index_type), intent(out) :: index
      integer :: last(size(points, 2)), j, k

      index%points = points
      allocate (index%places(0:2*size(points, 2)), index%next(size(points, 2)), source=0)
      do j = 1, size(points, 2)
         k = place_of(index, points(:, j))
         if (index%places(k) == 0) then
            index%places(k) = j
         else
            index%next(last(index%places(k))) = j
         end if
         last(index%places(k)) = j
      end do
   end subroutine new_point_index

   !> The same number for equal `points`: that of the first.
   pure function number_equal(points) result(numbers)
      !> (coordinate, point).
      real(wp), intent(in) :: points(:, :)
      integer :: numbers(size(points, 2))
      type(point_index_type) :: index
      integer :: j

      call new_point_index(points, index)
      numbers = [(index%places(place_of(index, points(:, j))), j=1, size(points, 2))]
   end function number_equal

   !> The numbers of all that are this `point`, none if there is none.
   pure subroutine find(self, point, numbers)
      class(point_index_type), intent(in) :: self
      !> (coordinate).
      real(wp), intent(in) :: point(:)
      integer, allocatable, intent(out) :: numbers(:)
      integer :: j

      allocate (numbers(0))
      j = self%places(place_of(self, point))
      do while (j > 0)
         numbers = [numbers, j]
         j = self%next(j)
      end do
   end subroutine find

   !> The place of a point, or the free one where it would be: from that of its hash on (Fowler, Noll and Vo's over numbers, its high bits
   !> mixed into the low ones; products wrap around).
   pure integer function place_of(self, point) result(place)
      type(point_index_type), intent(in) :: self
      real(wp), intent(in) :: point(:)
      integer(i8), parameter :: prime = 1099511628211_i8, basis = -3750763034362895579_i8
      integer(i8) :: hash
      integer :: i

      hash = basis
      do i = 1, size(point)
         ! Both zeros are the same.
         hash = ieor(hash, merge(transfer(point(i), hash), 0_i8, abs(point(i)) > 0.0_wp))*prime
         hash = ieor(hash, ishft(hash, -32))
      end do
      place = int(modulo(hash, size(self%places, kind=i8)))
      do while (self%places(place) > 0)
         if (.not. any(abs(self%points(:, self%places(place)) - point) > 0.0_wp)) return
         place = modulo(place + 1, size(self%places))
      end do
   end function place_of
end module point_index
