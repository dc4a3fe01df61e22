!> A stage: what one command does with a problem in an output folder, for both programs:
!>
!>     call stage%open(problem, places, error)        ! checks, and what is there already
!>     do
!>        call stage%want(error)                      ! stage%jobs: the simulations to be made now
!>        if (size(stage%jobs) == 0) exit
!>        (simulate each, in any order, and give what became of it to stage%take)
!>     end do
!> call stage%close(document, error)              ! files, and the document; after an error or an
!> interrupt stage%campaign%flush
!>
!> What became of a simulation is stored by `take`, of a stage that has a campaign; a modulus that
!> is none is a failure. What the machine could not do (memory) is no result: it is wanted once
!> more, alone, and is an error if that fails too.
module abstract_stage
   use campaign, only: campaign_type, row_type
   use errors, only: error_type, machine_failure, raise, refuse, warning_type
   use json, only: json_type
   use kinds, only: wp
   use problem, only: problem_type
   use simulate, only: outcome_done, outcome_failed, outcome_type, outcome_waiting
   use stage_documents, only: begin_results, inputs_of, write_document
   use surrogate_model, only: places_type
   use text, only: lower, to_text
   implicit none
   private
   public :: stage_type, job_type

   !> A simulation that is wanted.
   type :: job_type
      !> Stiffness in crystal axes, GPa; Bunge-Euler angles, degrees.
      real(wp) :: stiffness(6, 6) = 0.0_wp, euler_deg(3) = 0.0_wp
      !> Its number in the batch that the stage chose.
      integer :: number = 0
   end type job_type

   type, abstract :: stage_type
      !> Of the command, and of the file of its document; the groups of the namelist that its
      !> results follow from, and those of a posterior.
      character(len=:), allocatable :: name, document_file, groups, groups_of_posterior
      type(problem_type), pointer :: problem => null()
      !> Folder of the results, without a slash at its end; and where surrogates are looked for.
      character(len=:), allocatable :: output
      type(places_type) :: places
      !> What a person should know; why its result cannot be used, none: it can.
      type(warning_type), allocatable :: warnings(:), reasons(:)
      !> What is to be simulated now.
      type(job_type), allocatable :: jobs(:)
      !> Simulations that were made in this run, those that failed, and those that are still
      !> expected.
      integer :: n_new = 0, n_failed = 0, n_expected = 0
      !> One line on what was done, and perhaps more.
      character(len=:), allocatable :: done
      type(warning_type), allocatable :: more(:)
      !> The batch that was chosen, what became of each, as a row of the campaign, which may have
      !> had it already, and its state.
      type(job_type), allocatable :: batch(:)
      type(row_type), allocatable :: rows(:)
      integer, allocatable, private :: state(:)
      !> Of stages that open it.
      type(campaign_type) :: campaign
   contains
      procedure, non_overridable :: open, want, take, close, look_up
      !> Look at what is there, refuse what cannot be, and choose the first batch.
      procedure :: begin
      !> Learn from the batch that was simulated, and choose the next; none: all is done.
      procedure :: choose
      !> Write the files, and the document into the object of a `page`.
      procedure(describe), deferred :: finish
   end type stage_type

   abstract interface
      subroutine describe(self, page, error)
         import :: error_type, json_type, stage_type
         class(stage_type), intent(inout) :: self
         type(json_type), intent(inout) :: page
         type(error_type), allocatable, intent(out) :: error
      end subroutine describe
   end interface

   !> A job is to be made, to be made once more, or made.
   integer, parameter :: waiting = 0, again = 1, made = 2

contains

   !> Begin in an output folder.
   subroutine open(self, problem, places, error)
      class(stage_type), intent(inout) :: self
      type(problem_type), intent(in), target :: problem
      !> The folder of the results among them.
      type(places_type), intent(in) :: places
      type(error_type), allocatable, intent(out) :: error

      self%problem => problem
      self%output = places%output(:len(places%output) - 1)
      self%places = places
      self%done = ''
      allocate (self%warnings(0), self%reasons(0), self%more(0))
      call self%begin(error)
      if (.not. allocated(self%batch)) allocate (self%batch(0))
      if (.not. allocated(self%rows)) allocate (self%rows(size(self%batch)))
      call begin_batch(self)
   end subroutine open

   !> All of the batch is to be made but what the campaign had.
   subroutine begin_batch(self)
      class(stage_type), intent(inout) :: self
      integer :: i

      self%batch%number = [(i, i=1, size(self%batch))]
      self%state = merge(waiting, made, &
         & self%rows(:size(self%batch))%outcome%status == outcome_waiting)
   end subroutine begin_batch

   !> What the campaign has of the rows of a batch. The others are to follow all that is there; or
   !> those `in_place`, of a batch that was interrupted, to take the places that they left in it.
   subroutine look_up(self, in_place, error)
      class(stage_type), intent(inout) :: self
      logical, intent(in) :: in_place
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: stored
      logical :: found(size(self%rows))
      integer :: first(size(self%rows)), next, i

      do i = 1, size(found)
         call self%campaign%find(self%rows(i)%symmetry, self%rows(i)%constants, &
            & self%rows(i)%euler_deg, stored, found(i), error)
         if (allocated(error)) return
         if (found(i)) self%rows(i)%outcome = stored%outcome
         first(i) = stored%position - i + 1
      end do
      call self%campaign%next_position(next, error)
      self%rows%position = next - 1 + [(count(.not. found(:i)), i=1, size(found))]
      if (.not. (in_place .and. any(found))) return
      if (minval(first, found) == maxval(first, found)) then
         self%rows%position = minval(first, found) - 1 + [(i, i=1, size(found))]
      end if
   end subroutine look_up

   !> Let `jobs` be what is to be simulated now.
   subroutine want(self, error)
      class(stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      if (all(self%state == made)) then
         call self%campaign%flush(error)
         if (allocated(error)) return
         call self%choose(error)
         if (allocated(error)) return
         call begin_batch(self)
      end if
      if (any(self%state == waiting) .or. size(self%state) == 0) then
         self%jobs = pack(self%batch, self%state == waiting)
      else
         self%jobs = [self%batch(findloc(self%state, again, 1))]
      end if
   end subroutine want

   !> What became of the job of this number. One thread at a time.
   subroutine take(self, number, outcome, error)
      class(stage_type), intent(inout) :: self
      integer, intent(in) :: number
      !> Waiting: the machine could not do it, for the reason in its message.
      type(outcome_type), intent(in) :: outcome
      type(error_type), allocatable, intent(out) :: error

      if (number < 1 .or. number > size(self%state)) then
         call refuse(error, 'no such simulation is wanted')
      else if (outcome%status /= outcome_waiting) then
         self%state(number) = made
         self%n_new = self%n_new + 1
         self%rows(number)%outcome = outcome
         associate (kept => self%rows(number)%outcome)
            if (kept%status == outcome_done &
               & .and. .not. (kept%modulus > 0.0_wp .and. kept%modulus <= huge(1.0_wp))) then
               kept%status = outcome_failed
               kept%message = 'the modulus is '//lower(to_text(kept%modulus))//' GPa'
            end if
            if (kept%status == outcome_failed) self%n_failed = self%n_failed + 1
         end associate
         if (allocated(self%campaign%path)) call self%campaign%add_soon(self%rows(number), error)
      else if (self%state(number) == again) then
         call raise(error, outcome%message, machine_failure)
      else
         self%state(number) = again
      end if
   end subroutine take

   subroutine begin(self, error)
      class(stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, also_unused => error)
      end associate
   end subroutine begin

   !> Nothing more is to be simulated.
   subroutine choose(self, error)
      class(stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%batch = [job_type ::]
   end subroutine choose

   !> Write the results, and keep the document in the folder.
   subroutine close(self, document, error)
      class(stage_type), intent(inout) :: self
      !> JSON.
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(json_type) :: page

      call self%campaign%file%close()
      call page%begin_object()
      call self%finish(page, error)
      if (allocated(error)) return
      call page%put('warnings', [self%problem%warnings, self%warnings])
      call page%put_json('inputs', '{'//inputs_of(self%problem, self%groups, self%places)//'}')
      call page%end_object()
      document = page%text()
      call begin_results(self%problem, self%groups, self%places, error)
      if (allocated(error)) return
      call write_document(self%places%output//self%document_file, document, error)
   end subroutine close
end module abstract_stage
