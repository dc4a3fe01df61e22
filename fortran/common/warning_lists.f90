!> What may be meant, but should be known: lists of lines.
module warning_lists
   implicit none
   private
   public :: warning_type, warn

   type :: warning_type
      character(len=:), allocatable :: text
   end type warning_type

contains

   !> Add a line.
   pure subroutine warn(warnings, text)
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      character(len=*), intent(in) :: text
      type(warning_type), allocatable :: longer(:)
      integer :: n, i

      n = 0
      if (allocated(warnings)) n = size(warnings)
      allocate (longer(n + 1))
      do i = 1, n
         call move_alloc(warnings(i)%text, longer(i)%text)
      end do
      longer(n + 1)%text = text
      call move_alloc(longer, warnings)
   end subroutine warn
end module warning_lists
