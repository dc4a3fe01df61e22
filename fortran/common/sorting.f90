!> Order of values.
module sorting
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use kinds, only: wp
   implicit none
   private
   public :: sort_order

   interface
      pure subroutine c_sort_order(n, values, order) bind(c, name='bayesindent_sort_order')
         import :: c_double, c_int
         integer(c_int), value :: n
         real(c_double), intent(in) :: values(*)
         integer(c_int), intent(out) :: order(*)
      end subroutine c_sort_order
   end interface

contains

   !> Indices that sort the values, ascending; equal values keep their order.
   pure subroutine sort_order(values, order)
      real(wp), intent(in) :: values(:)
      integer, intent(out) :: order(:)

      call c_sort_order(size(values), values, order)
   end subroutine sort_order
end module sorting
