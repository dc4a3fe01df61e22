!> `next`: the grains to measure next.
module next_stage
   use analysis_document, only: stored_draws
   use errors, only: error_type
   use files, only: file_exists
   use further_measurements, only: suggest_measurements
   use json, only: json_type
   use kinds, only: wp
   use stage_documents, only: inputs_of
   use statistics, only: flattened
   use surrogate_loading, only: analysis_stage_type
   implicit none
   private
   public :: next_stage_type

   type, extends(analysis_stage_type) :: next_stage_type
   contains
      procedure :: finish
   end type next_stage_type

contains

   !> Write the document from the draws that `extract` stored in the folder, or else from new ones.
   subroutine finish(self, page, error)
      class(next_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: draws(:, :)

      call stored_draws(self%output, inputs_of(self%problem, self%groups_of_posterior, &
         & self%places), self%analysis%posterior%dimension, draws, error)
      if (allocated(error)) return
      if (.not. allocated(draws)) then
         call self%analysis%infer(error)
         if (allocated(error)) return
         draws = flattened(self%analysis%chains%draws)
      end if
      call suggest_measurements(self%analysis, draws, page, error)
      self%warnings = self%analysis%warnings
      if (file_exists(self%output//'/summary.json') &
         & .and. .not. file_exists(self%output//'/posterior.bin')) then
         call self%warn('sampled_anew', self%output//'/posterior.bin')
      end if
   end subroutine finish
end module next_stage
