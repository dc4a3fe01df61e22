!> `tensor`: a calculated stiffness against the measurements.
module tensor_stage
   use errors, only: error_type
   use json, only: json_type
   use surrogate_loading, only: analysis_stage_type
   use tensor_comparison, only: compare_tensor
   implicit none
   private
   public :: tensor_stage_type

   type, extends(analysis_stage_type) :: tensor_stage_type
   contains
      procedure :: finish
   end type tensor_stage_type

contains

   subroutine finish(self, page, error)
      class(tensor_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error

      call compare_tensor(self%analysis, page, error)
   end subroutine finish
end module tensor_stage
