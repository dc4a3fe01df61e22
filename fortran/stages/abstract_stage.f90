!> A stage: what one command does with a problem in an output folder, for both programs:
!>
!>     call stage%open(problem, places, error)        ! checks, and reads what the folder holds
!>     do
!>        call stage%want(error)                      ! sets stage%jobs, the simulations to make
!>        if (size(stage%jobs) == 0) exit
!>        (simulate each job, in any order, and give its outcome to stage%take)
!>     end do
!>     call stage%close(document, error)              ! writes the files and the document
!>
!> After an error or an interrupt call stage%campaign%flush instead of stage%close.
!>
!> `take` stores the outcome of a simulation in the campaign, if the stage has one. A modulus that
!> is not a positive number counts as a failure. A simulation that the machine could not perform,
!> for lack of memory, has no outcome: the stage asks for it once more, alone, and a second failure
!> is an error.
module abstract_stage
   use campaign, only: campaign_type, row_type
   use diagnostics, only: diagnosed_type, diagnostics_text
   use errors, only: error_type, machine_failure, raise, refuse
   use json, only: json_type
   use kinds, only: wp
   use problem, only: problem_type
   use simulate, only: outcome_done, outcome_failed, outcome_type, outcome_waiting
   use stage_documents, only: begin_results, inputs_of, write_document
   use surrogate_model, only: places_type
   use text, only: line_type, lower, to_text
   implicit none
   private
   public :: stage_type, job_type

   !> A simulation that the stage asks for.
   type :: job_type
      !> Stiffness in crystal axes, GPa; Bunge-Euler angles, degrees.
      real(wp) :: stiffness(6, 6) = 0.0_wp, euler_deg(3) = 0.0_wp
      !> Number in the batch of the stage, from 1.
      integer :: number = 0
      !> Whether the machine could not perform it once.
      logical :: has_failed = .false.
   end type job_type

   type, abstract, extends(diagnosed_type) :: stage_type
      !> Name of the file of its document; the groups of the namelist that determine its results,
      !> and those that determine a posterior; separated by blanks.
      character(len=:), allocatable :: document_file, groups, groups_of_posterior
      type(problem_type), pointer :: problem => null()
      !> Folder of the results, without a slash at its end.
      character(len=:), allocatable :: output
      !> Folders in which a surrogate is searched.
      type(places_type) :: places
      !> The simulations to make now.
      type(job_type), allocatable :: jobs(:)
      !> Numbers of simulations: made in this run, failed, and still expected.
      integer :: n_new = 0, n_failed = 0, n_expected = 0
      !> One line on what was done, the document unless the stage says more; and further lines.
      character(len=:), allocatable :: done
      type(line_type), allocatable :: more(:)
      !> The simulations of the present batch, and each as a row of the campaign, with its outcome.
      !> The campaign may have had a row before.
      type(job_type), allocatable :: batch(:)
      type(row_type), allocatable :: rows(:)
      !> Open only in stages that simulate.
      type(campaign_type) :: campaign
   contains
      procedure, non_overridable :: open, want, take, close, look_up
      !> Read the results in the folder, refuse what is impossible, and choose the first batch.
      procedure :: begin
      !> Use the batch that was simulated and choose the next one; an empty batch ends the stage.
      procedure :: choose
      !> Write the files, and the document into the object of a `page`.
      procedure(describe), deferred :: finish
   end type stage_type

   abstract interface
      subroutine describe(self, page, error)
         import
         class(stage_type), intent(inout) :: self
         type(json_type), intent(inout) :: page
         type(error_type), allocatable, intent(out) :: error
      end subroutine describe
   end interface

   !> Version of the format of documents; python/bayesindent/stages/results_folder.py compares it.
   integer, parameter :: document_format = 2

contains

   !> Begin the stage in the output folder.
   subroutine open(self, problem, places, error)
      class(stage_type), intent(inout) :: self
      type(problem_type), intent(in), target :: problem
      !> With the folder of the results.
      type(places_type), intent(in) :: places
      type(error_type), allocatable, intent(out) :: error

      self%problem => problem
      self%output = places%output(:len(places%output) - 1)
      self%places = places
      allocate (self%warnings(0), self%more(0))
      call self%begin(error)
      if (.not. allocated(self%batch)) allocate (self%batch(0))
      if (.not. allocated(self%rows)) allocate (self%rows(size(self%batch)))
   end subroutine open

   !> Read the outcomes that the campaign has for the rows of a batch. The positions of the other
   !> rows follow the last row of the campaign. With `in_place` the batch was interrupted before:
   !> its missing rows get the positions that are free within it.
   subroutine look_up(self, in_place, error)
      class(stage_type), intent(inout) :: self
      logical, intent(in) :: in_place
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: stored
      logical :: is_stored(size(self%rows))
      integer :: first(size(self%rows)), next, i

      do i = 1, size(is_stored)
         call self%campaign%find(self%rows(i)%symmetry, self%rows(i)%constants, &
            & self%rows(i)%euler_deg, stored, is_stored(i), error)
         if (allocated(error)) return
         if (is_stored(i)) self%rows(i)%outcome = stored%outcome
         first(i) = stored%position - i + 1
      end do
      call self%campaign%next_position(next, error)
      self%rows%position = next - 1 + [(count(.not. is_stored(:i)), i=1, size(is_stored))]
      if (.not. (in_place .and. any(is_stored))) return
      if (minval(first, is_stored) == maxval(first, is_stored)) then
         self%rows%position = minval(first, is_stored) - 1 + [(i, i=1, size(is_stored))]
      end if
   end subroutine look_up

   !> Set `jobs` to the simulations to make now.
   subroutine want(self, error)
      class(stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (all(self%rows%outcome%status /= outcome_waiting)) then
         call self%campaign%flush(error)
         if (allocated(error)) return
         call self%choose(error)
         if (allocated(error)) return
      end if
      associate (batch => self%batch)
         batch%number = [(i, i=1, size(batch))]
         self%jobs = pack(batch, self%rows(:size(batch))%outcome%status == outcome_waiting)
      end associate
      if (all(self%jobs%has_failed)) then
         self%jobs = self%jobs(:min(1, size(self%jobs)))
      else
         self%jobs = pack(self%jobs, .not. self%jobs%has_failed)
      end if
   end subroutine want

   !> Take the outcome of the job of this number. Only one thread at a time may call it.
   subroutine take(self, number, outcome, error)
      class(stage_type), intent(inout) :: self
      integer, intent(in) :: number
      !> The status `outcome_waiting` means that the machine could not perform the simulation, for
      !> the reason in the message.
      type(outcome_type), intent(in) :: outcome
      type(error_type), allocatable, intent(out) :: error

      if (number < 1 .or. number > size(self%batch)) then
         call refuse(error, 'no such simulation is wanted')
      else if (outcome%status /= outcome_waiting) then
         self%n_new = self%n_new + 1
         self%rows(number)%outcome = outcome
         associate (stored => self%rows(number)%outcome)
            if (stored%status == outcome_done &
               & .and. .not. (stored%modulus > 0.0_wp .and. stored%modulus <= huge(1.0_wp))) then
               stored%status = outcome_failed
               stored%message = 'the modulus is '//lower(to_text(stored%modulus))//' GPa'
            end if
            if (stored%status == outcome_failed) self%n_failed = self%n_failed + 1
         end associate
         if (allocated(self%campaign%path)) call self%campaign%add_soon(self%rows(number), error)
      else if (self%batch(number)%has_failed) then
         call raise(error, outcome%message, machine_failure)
      else
         self%batch(number)%has_failed = .true.
      end if
   end subroutine take

   subroutine begin(self, error)
      class(stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, also_unused => error)
      end associate
   end subroutine begin

   !> End the stage after its first batch.
   subroutine choose(self, error)
      class(stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%batch = [job_type ::]
   end subroutine choose

   !> Write the results and the document into the folder.
   subroutine close(self, document, error)
      class(stage_type), intent(inout) :: self
      !> JSON.
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(json_type) :: page

      call self%campaign%file%close()
      self%done = self%output//'/'//self%document_file
      call page%begin_object('')
      call self%finish(page, error)
      if (allocated(error)) return
      call page%put_json('warnings', diagnostics_text([self%problem%warnings, self%warnings]))
      call page%put('format', document_format)
      call page%put_json('inputs', '{'//inputs_of(self%problem, self%groups, self%places)//'}')
      call page%end_object()
      document = page%text()
      call begin_results(self%problem, self%groups, self%places, error)
      if (allocated(error)) return
      call write_document(self%places%output//self%document_file, document, error)
   end subroutine close
end module abstract_stage
