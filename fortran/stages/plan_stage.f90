!> `plan`: the sd that each constant is expected to have.
module plan_stage
   use errors, only: error_type
   use json, only: json_type
   use planned_measurements, only: check_plan, plan_measurements
   use surrogate_loading, only: analysis_stage_type, load_analysis
   implicit none
   private
   public :: plan_stage_type

   type, extends(analysis_stage_type) :: plan_stage_type
   contains
      procedure :: begin, finish
   end type plan_stage_type

contains

   !> Load the surrogate, and refuse a plan that cannot be performed.
   subroutine begin(self, error)
      class(plan_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call load_analysis(self, .true., error)
      if (.not. allocated(error)) call check_plan(self%analysis, error)
   end subroutine begin

   subroutine finish(self, page, error)
      class(plan_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error

      call plan_measurements(self%analysis, page, error)
   end subroutine finish
end module plan_stage
