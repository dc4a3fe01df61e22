!> Order of values.
module sorting
   use kinds, only: wp
   implicit none
   private
   public :: sort_order

contains

   !> Indices that sort the values, ascending; equal values keep their order (merge sort).
   pure subroutine sort_order(values, order)
      real(wp), intent(in) :: values(:)
      integer, intent(out) :: order(:)
      integer :: merged(size(values)), width, first, middle, last, i, j, k, n
      logical :: right

      n = size(values)
      order = [(i, i=1, n)]
      width = 1
      do while (width < n)
         do first = 1, n, 2*width
            middle = min(first + width, n + 1)
            last = min(first + 2*width, n + 1)
            i = first
            j = middle
            do k = first, last - 1
               right = j < last
               if (right .and. i < middle) right = values(order(j)) < values(order(i))
               if (right) then
                  merged(k) = order(j)
                  j = j + 1
               else
                  merged(k) = order(i)
                  i = i + 1
               end if
            end do
         end do
         order = merged
         width = 2*width
      end do
   end subroutine sort_order
end module sorting
