!> `next`: the grains worth measuring next.
module next_stage
   use errors, only: error_type
   use extract_stage, only: extract_stage_type
   use extraction, only: extract, extraction_type
   use chain_checkpoints, only: chain_prefix
   use kinds, only: wp
   use next_grains, only: next_document
   use posterior_file, only: stored_draws
   use running_command, only: remove_files
   use stage_documents, only: inputs_of
   use statistics, only: flattened
   implicit none
   private
   public :: next_stage_type

   type, extends(extract_stage_type) :: next_stage_type
   contains
      procedure :: finish
   end type next_stage_type

contains

   !> The document, from the draws that `extract` left in the folder, or from new ones.
   subroutine finish(self, document, error)
      class(next_stage_type), intent(inout) :: self
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(extraction_type) :: found
      real(wp), allocatable :: draws(:, :)

      call stored_draws(self%output, inputs_of(self%problem, self%groups_of_posterior, self%places), self%posterior%dimension, &
         & draws, error)
      if (allocated(error)) return
      if (.not. allocated(draws)) then
         self%problem%kept_in = self%output
         call extract(self%problem, self%surrogate, found, error)
         if (allocated(error)) return
         draws = flattened(found%chains%draws)
         call remove_files(self%output, chain_prefix)
      end if
      call next_document(self%problem, self%posterior, draws, document, self%warnings, error)
      self%done = self%output//'/next.json'
   end subroutine finish
end module next_stage
