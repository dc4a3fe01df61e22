!> `tensor`: a calculated stiffness against the measurements.
module tensor_stage
   use abstract_stage, only: stage_type
   use analysis, only: analysis_type
   use errors, only: error_type
   use json, only: json_type
   use surrogate_loading, only: load_analysis
   use tensor_comparison, only: compare_tensor
   implicit none
   private
   public :: tensor_stage_type

   type, extends(stage_type) :: tensor_stage_type
      type(analysis_type) :: analysis
   contains
      procedure :: begin, finish
   end type tensor_stage_type

contains

   !> Load the surrogate, and check the posterior.
   subroutine begin(self, error)
      class(tensor_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call load_analysis(self%problem, self%places, .false., self%analysis, error)
   end subroutine begin

   subroutine finish(self, page, error)
      class(tensor_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error

      self%done = self%output//'/tensor.json'
      call compare_tensor(self%analysis, page, error)
   end subroutine finish
end module tensor_stage
