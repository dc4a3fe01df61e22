!> How the stages of an analysis begin: they load its surrogate. This is the one that &surrogate
!> names, or, for a film, a correction that is trained on exact values. The folder of results keeps
!> it for the same inputs.
module surrogate_loading
   use abstract_stage, only: stage_type
   use analysis, only: analysis_type
   use errors, only: error_type
   use film_theory, only: film_name
   use film_training, only: train_film
   use problem, only: problem_type
   use problem_tables, only: take_curve_results
   use stage_documents, only: inputs_of
   use surrogate_model, only: load_named_surrogate, load_surrogate, places_type, save_surrogate
   implicit none
   private
   public :: load_analysis, analysis_stage_type

   !> A stage of an analysis of the measurements.
   type, abstract, extends(stage_type) :: analysis_stage_type
      type(analysis_type) :: analysis
   contains
      procedure :: begin
   end type analysis_stage_type

contains

   !> Load the surrogate, and check the posterior.
   subroutine begin(self, error)
      class(analysis_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call load_analysis(self%problem, self%places, .false., self%analysis, error)
   end subroutine begin

   !> Begin the analysis of a problem, for crystals of its class. Without a plan its posterior is
   !> prepared, too.
   subroutine load_analysis(problem, places, is_plan, self, error)
      type(problem_type), intent(inout), target :: problem
      type(places_type), intent(in) :: places
      !> Whether the measurements are those of &plan.
      logical, intent(in) :: is_plan
      type(analysis_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: class

      if (.not. is_plan) call take_curve_results(problem, places%output, error)
      if (allocated(error)) return
      self%problem => problem
      class = ''
      if (allocated(problem%class%name)) class = problem%class%name
      if (problem%settings%specimen%geometry == film_name) then
         call load_film()
      else
         call load_named_surrogate(problem%settings%surrogate%file, class, places, &
            & self%surrogate, error)
      end if
      call problem%locate('surrogate', 'file', error)
      if (.not. (is_plan .or. allocated(error))) call self%prepare(error)

   contains

      !> Load the correction of the film if its inputs are the present ones, else train it.
      subroutine load_film()
         character(len=*), parameter :: groups &
            & = 'problem specimen indenter simulation measurements prior knowledge'
         character(len=:), allocatable :: path, inputs
         type(error_type), allocatable :: failure

         if (is_plan) then
            call train_film(problem, .true., self%surrogate, error)
            return
         end if
         path = places%output//problem%settings%surrogate%file
         inputs = '{'//inputs_of(problem, groups, places)//'}'
         call load_surrogate(path, self%surrogate, failure)
         if (.not. allocated(failure)) then
            self%surrogate%basis%domain%is_extended = .true.
            if (self%surrogate%provenance == inputs) return
         end if
         call train_film(problem, .false., self%surrogate, error)
         if (allocated(error)) return
         self%surrogate%provenance = inputs
         call save_surrogate(self%surrogate, path, error)
      end subroutine load_film
   end subroutine load_analysis
end module surrogate_loading
