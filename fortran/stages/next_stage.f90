!> `next`: the grains to measure next.
module next_stage
   use abstract_stage, only: stage_type
   use analysis, only: analysis_type
   use analysis_document, only: stored_draws
   use errors, only: error_type
   use files, only: file_exists
   use further_measurements, only: suggest_measurements
   use json, only: json_type
   use kinds, only: wp
   use running_command, only: remove_files
   use samplers, only: chain_prefix
   use stage_documents, only: inputs_of
   use statistics, only: flattened
   use surrogate_loading, only: load_analysis
   implicit none
   private
   public :: next_stage_type

   type, extends(stage_type) :: next_stage_type
      type(analysis_type) :: analysis
   contains
      procedure :: begin, finish
   end type next_stage_type

contains

   !> Load the surrogate, and check the posterior.
   subroutine begin(self, error)
      class(next_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call load_analysis(self%problem, self%places, .false., self%analysis, error)
   end subroutine begin

   !> Write the document from the draws that `extract` stored in the folder, or else from new ones.
   subroutine finish(self, page, error)
      class(next_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: draws(:, :)
      logical :: lost

      lost = file_exists(self%output//'/summary.json') &
         & .and. .not. file_exists(self%output//'/posterior.bin')
      call stored_draws(self%output, inputs_of(self%problem, self%groups_of_posterior, &
         & self%places), self%analysis%posterior%dimension, draws, error)
      if (allocated(error)) return
      if (.not. allocated(draws)) then
         self%problem%run%kept_in = self%output
         call self%analysis%infer(error)
         if (allocated(error)) return
         draws = flattened(self%analysis%chains%draws)
         call remove_files(self%output, chain_prefix)
      end if
      call suggest_measurements(self%analysis, draws, page, error)
      self%warnings = self%analysis%warnings
      if (lost) call self%warn('sampled_anew', self%output//'/posterior.bin')
      self%done = self%output//'/next.json'
   end subroutine finish
end module next_stage
