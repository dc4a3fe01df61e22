!> What another language holds of campaigns: the open file, and the rows that it asked for last.
module campaign_handles
   use campaign, only: campaign_type, row_type
   use errors, only: error_type
   use kinds, only: i8
   use object_registry, only: find_object
   implicit none
   private
   public :: held_campaign_type, campaign_of_handle

   type :: held_campaign_type
      type(campaign_type) :: campaign
      type(row_type), allocatable :: rows(:)
   end type held_campaign_type

contains

   subroutine campaign_of_handle(handle, held, error)
      integer(i8), intent(in) :: handle
      type(held_campaign_type), pointer, intent(out) :: held
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      held => null()
      call find_object(handle, 'campaign', object, error)
      if (allocated(error)) return
      select type (object)
      type is (held_campaign_type)
         held => object
      end select
   end subroutine campaign_of_handle
end module campaign_handles
