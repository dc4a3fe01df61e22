!> How the stages of an analysis begin: they load its surrogate. This is the one that &surrogate
!> names, or, for a film, a correction that is trained on exact values. The folder of results keeps
!> it for the same inputs.
module surrogate_loading
   use abstract_stage, only: stage_type
   use analysis, only: analysis_type
   use errors, only: error_type
   use film_theory, only: film_name
   use film_training, only: train_film
   use problem_tables, only: take_curve_results
   use stage_documents, only: inputs_of
   use surrogate_model, only: load_named_surrogate, load_surrogate, save_surrogate
   implicit none
   private
   public :: load_analysis, analysis_stage_type

   !> A stage of an analysis.
   type, abstract, extends(stage_type) :: analysis_stage_type
      type(analysis_type) :: analysis
   contains
      procedure :: begin
   end type analysis_stage_type

contains

   !> Load the surrogate, and check the posterior of the measurements.
   subroutine begin(self, error)
      class(analysis_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call take_curve_results(self%problem, self%places%output, error)
      if (.not. allocated(error)) call load_analysis(self, .false., error)
      if (.not. allocated(error)) call self%analysis%prepare(error)
   end subroutine begin

   !> Load the surrogate of the analysis, for crystals of the problem's class.
   subroutine load_analysis(self, is_plan, error)
      class(analysis_stage_type), intent(inout) :: self
      !> Whether the measurements are those of &plan.
      logical, intent(in) :: is_plan
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: class

      self%analysis%problem => self%problem
      associate (problem => self%problem, surrogate => self%analysis%surrogate)
         class = ''
         if (allocated(problem%class%name)) class = problem%class%name
         if (problem%settings%specimen%geometry /= film_name) then
            call load_named_surrogate(problem%settings%surrogate%file, class, self%places, &
               & surrogate, error)
         else if (is_plan) then
            call train_film(problem, .true., surrogate, error)
         else
            call load_film()
         end if
         call problem%locate('surrogate', 'file', error)
      end associate

   contains

      !> Load the correction of the film if its inputs are the present ones, else train it.
      subroutine load_film()
         character(len=*), parameter :: groups &
            & = 'problem specimen indenter simulation measurements prior knowledge'
         character(len=:), allocatable :: path, inputs
         type(error_type), allocatable :: failure

         path = self%places%output//self%problem%settings%surrogate%file
         inputs = '{'//inputs_of(self%problem, groups, self%places)//'}'
         associate (surrogate => self%analysis%surrogate)
            call load_surrogate(path, surrogate, failure)
            if (.not. allocated(failure)) then
               surrogate%basis%domain%is_extended = .true.
               if (surrogate%provenance == inputs) return
            end if
            call train_film(self%problem, .false., surrogate, error)
            if (allocated(error)) return
            surrogate%provenance = inputs
            call save_surrogate(surrogate, path, error)
         end associate
      end subroutine load_film
   end subroutine load_analysis
end module surrogate_loading
