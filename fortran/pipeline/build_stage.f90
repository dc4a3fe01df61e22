!> `build`: Step 1, the surrogate that &design asks for.
module build_stage
   use abstract_stage, only: job_type, stage_type
   use build_checks, only: check_build
   use build_document, only: conclude
   use build_loop, only: build_type, look_ahead, open_build
   use errors, only: error_type
   use namelist_file, only: place
   use simulate, only: outcome_type
   use surrogate_file, only: check_replaceable
   use text, only: to_text
   implicit none
   private
   public :: build_stage_type, check_new_surrogate

   type, extends(stage_type) :: build_stage_type
      type(build_type) :: build
   contains
      procedure :: begin
      procedure :: choose
      procedure :: keep
      procedure :: leave
      procedure :: finish
      procedure :: look_ahead => next_candidates
   end type build_stage_type

contains

   !> Refuse a build that could not be, or whose surrogate could not be kept.
   subroutine check_new_surrogate(stage, error)
      class(stage_type), intent(in) :: stage
      type(error_type), allocatable, intent(out) :: error

      call check_build(stage%problem, error)
      if (allocated(error)) return
      call check_replaceable(stage%output//'/'//stage%problem%settings%surrogate%file, error)
      if (allocated(error)) error%message = place(stage%problem%path, 'surrogate', 'file')//error%message
   end subroutine check_new_surrogate

   subroutine begin(self, error)
      class(build_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call check_new_surrogate(self, error)
      if (.not. allocated(error)) call open_build(self%problem, self%output, self%build, error)
      associate (design => self%problem%settings%design)
         if (.not. allocated(error)) self%n_expected = max(0, design%budget + design%validation - self%build%learning%n())
      end associate
   end subroutine begin

   subroutine choose(self, batch, error)
      class(build_stage_type), intent(inout) :: self
      type(job_type), allocatable, intent(inout) :: batch(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call self%build%advance(error)
      if (allocated(error)) return
      batch = [(job_type(self%build%stiffness(i), self%build%euler_deg(i)), i=1, self%build%n_wanted())]
   end subroutine choose

   subroutine keep(self, number, outcome, error)
      class(build_stage_type), intent(inout) :: self
      integer, intent(in) :: number
      type(outcome_type), intent(in) :: outcome
      type(error_type), allocatable, intent(out) :: error

      call self%build%store(number, outcome, error)
   end subroutine keep

   subroutine leave(self, error)
      class(build_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call self%build%store_all(error)
   end subroutine leave

   !> The surrogate's file, and the document.
   subroutine finish(self, document, error)
      class(build_stage_type), intent(inout) :: self
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error

      call conclude(self%build, self%output, document, error)
      if (allocated(error)) return
      self%done = to_text(self%build%learning%n())//' simulations, '//to_text(self%build%n_new)//' new, ' &
         & //to_text(self%build%n_failed)//' failed, '//self%build%stopped//': '//self%output//'/' &
         & //self%problem%settings%surrogate%file
      self%warnings = self%build%warnings
   end subroutine finish

   !> The next `n` candidates, before the moduli of the first of them are known, as rows of a table.
   subroutine next_candidates(self, n, numbers, error)
      class(build_stage_type), intent(inout) :: self
      integer, intent(in) :: n
      !> Of the candidates, from 1.
      integer, allocatable, intent(out) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error

      call look_ahead(self%build, n, numbers, error)
   end subroutine next_candidates
end module build_stage
