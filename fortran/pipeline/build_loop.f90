!> The loop of Step 1: choose the next simulations, learn from what became of them, until the budget is used. See `build_stage`.
!>
!> All results go through the campaign, so that an interrupted build goes on where it was, and a larger budget continues it. What is in the
!> campaign is not asked for again.
module build_loop
   use abstract_basis, only: basis_type
   use build_checks, only: basis_of_problem
   use campaign, only: campaign_name, campaign_type, row_type
   use design_candidates, only: candidates_type, initial_set, new_candidates
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use known_rows, only: known_rows_type, select_rows
   use learning, only: batch_end, close_batch, learn, learning_type, new_learning, refit_all, why_to_stop
   use physics_identity, only: identity_text
   use problem, only: problem_type
   use row_buffer, only: row_buffer_type
   use sequential_design, only: design_type, update_posterior_mean
   use simulate, only: outcome_done, outcome_type, outcome_waiting
   use surrogate_learner, only: add_simulations, choose_next, exclude_candidates, predict_moduli, revert, &
      & set_learner_candidates
   use text, only: to_text
   use parallelism, only: thread_count
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: build_type, open_build, look_ahead

   !> What the loop is at: simulations to learn from, those to validate with, nothing more.
   integer, parameter, public :: teaching = 1, validating = 2, finished = 3

   type :: build_type
      type(problem_type) :: problem
      type(campaign_type) :: campaign
      type(row_buffer_type), private :: buffer
      type(learning_type) :: learning
      type(candidates_type) :: candidates
      type(warning_type), allocatable :: warnings(:)
      integer :: phase = teaching
      !> Why the learning ended.
      character(len=:), allocatable :: stopped
      !> Simulations that were performed, and that failed, now or earlier.
      integer :: n_new = 0, n_failed = 0
      !> What to validate with: constants (n_constants, n), angles (3, n), moduli (n).
      real(wp), allocatable :: unseen_constants(:, :), unseen_euler_deg(:, :), unseen_modulus(:)
      !> The rest of the initial set.
      integer, allocatable, private :: initial(:)
      !> Rows of the campaign that are not learnt: of a batch that was interrupted, or what the budget leaves over.
      type(known_rows_type), private :: unused
      !> The design before the present choice, which may be taken back.
      type(design_type), allocatable, private :: before
      !> The candidates of the batch under way and what became of each; which of them must be simulated; whether the variance chose them.
      integer, allocatable, private :: batch(:), wanted(:)
      type(outcome_type), allocatable, private :: outcomes(:)
      logical, private :: by_variance = .false.
      !> In the campaign, of what is wanted.
      integer, allocatable, private :: positions(:)
   contains
      procedure :: advance
      procedure :: n_wanted
      procedure :: row
      procedure :: stiffness => wanted_stiffness
      procedure :: euler_deg => wanted_euler_deg
      procedure :: store
      procedure :: store_all
      procedure :: failures
   end type build_type

contains

   !> Begin, or go on: open the campaign of an output folder and learn what it has.
   subroutine open_build(problem, output, build, error)
      type(problem_type), intent(in) :: problem
      !> Folder of the results.
      character(len=*), intent(in) :: output
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      class(basis_type), allocatable :: basis
      type(row_type), allocatable :: rows(:)
      character(len=:), allocatable :: warning, others

      build%problem = problem
      allocate (build%warnings(0))
      call basis_of_problem(problem, basis, error)
      if (.not. allocated(error)) call new_candidates(problem, basis, build%candidates, warning, error)
      if (allocated(error)) return
      if (len(warning) > 0) call warn(build%warnings, warning)
      associate (design => problem%settings%design)
         call new_learning(basis, design, build%learning, error)
         if (.not. allocated(error)) call set_learner_candidates(build%learning%learner, build%candidates%constants, &
            & build%candidates%euler_deg, design%variance_of, error)
         if (allocated(error)) return
         call initial_set(build%candidates, basis, design, build%initial)
      end associate
      allocate (build%batch(0), build%wanted(0), build%outcomes(0), build%positions(0))
      build%stopped = ''
      call build%campaign%open(output//'/'//campaign_name, identity_text(problem%settings), error)
      if (.not. allocated(error)) call build%campaign%rows('', rows, error)
      if (allocated(error)) return
      if (size(rows) == 0) then
         call build%campaign%other_physics(others, error)
         if (allocated(error)) return
         if (len(others) > 0) call warn(build%warnings, build%campaign%path//' holds only simulations of another physics (' &
            & //others(:index(others//achar(10), achar(10)) - 1)//'); they are not used here')
      end if
      call replay(build, rows, error)
   end subroutine open_build

   !> Learn from the rows of the campaign as they were learnt from when they were made: whole batches. What is there of a batch that was
   !> interrupted may be chosen once more, so that its moduli are learnt in the order of choice; see `settle`.
   subroutine replay(build, rows, error)
      type(build_type), intent(inout) :: build
      type(row_type), intent(in) :: rows(:)
      type(error_type), allocatable, intent(out) :: error
      logical, allocatable :: taken(:)
      integer :: beyond

      associate (learner => build%learning%learner)
         call select_rows(rows, learner%basis, build%candidates, build%problem%settings%design%reuse == 'chosen', build%unused, &
            & beyond, error)
         if (allocated(error)) return
         if (beyond > 0) call warn(build%warnings, to_text(beyond)//' simulations of the campaign are outside the surrogate''s ' &
            & //'domain and are not used')
         build%n_failed = build%unused%failed
         call learn_unused(build, .true., error)
         if (allocated(error)) return
         call build%unused%divide(taken)
         where (taken) learner%design%available = .false.
         if (any(build%unused%open)) then
            call update_posterior_mean(learner%design, .true., error)
         else
            call take_unused(build, error)
         end if
      end associate
   end subroutine replay

   !> Learn from the rows that are not learnt yet, batch by batch; `whole`: as long as they fill a batch.
   subroutine learn_unused(build, whole, error)
      type(build_type), intent(inout) :: build
      logical, intent(in) :: whole
      type(error_type), allocatable, intent(out) :: error
      integer :: complete, last

      associate (unused => build%unused, learning => build%learning)
         do while (unused%n() > 0 .and. learning%n() < learning%settings%budget)
            complete = batch_end(learning)
            if (len(why_to_stop(build%learning)) > 0 .or. (whole .and. unused%n() < complete - learning%n())) exit
            last = unused%taken + min(unused%n(), complete - learning%n())
            call learn(learning, unused%constants(:, unused%taken + 1:last), unused%euler_deg(:, unused%taken + 1:last), &
               & unused%modulus(unused%taken + 1:last), .false., error)
            unused%taken = last
            if (learning%n() == complete .and. .not. allocated(error)) call close_batch(learning, .false., error)
            if (allocated(error)) return
         end do
      end associate
   end subroutine learn_unused

   !> Learn from what is not learnt yet in the order in which it was stored; none of it is chosen any more.
   subroutine take_unused(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error

      where (build%unused%open) build%learning%learner%design%available = .false.
      build%unused%open = .false.
      if (build%phase /= teaching) return
      call learn_unused(build, .false., error)
      if (.not. allocated(error)) call update_posterior_mean(build%learning%learner%design, .true., error)
   end subroutine take_unused

   !> What of a batch that was interrupted is in the campaign must be in the batch chosen now, which is then the same one. If something else
   !> is there, and something of the batch is not, another &design chose: the choice is taken back, and the rows are learnt as they are.
   subroutine settle(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error

      if (build%n_wanted() == 0 .or. count(build%unused%open) == count(build%unused%open(build%batch))) then
         call build%unused%choose(build%batch)
         return
      end if
      call take_back(build)
      if (allocated(build%unseen_modulus)) deallocate (build%unseen_modulus)
      call take_unused(build, error)
   end subroutine settle

   !> Let the design be as it was before the present choice, which ends.
   subroutine take_back(build)
      type(build_type), intent(inout) :: build

      build%batch = [integer ::]
      build%wanted = [integer ::]
      call revert(build%learning%learner, build%before)
      deallocate (build%before)
   end subroutine take_back

   !> Learn the batch that was performed and choose the next; nothing is wanted when all is done.
   subroutine advance(self, error)
      class(build_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      do
         if (self%n_wanted() > 0) then
            call raise(error, 'a simulation that the design chose has no outcome')
            return
         end if
         call self%store_all(error)
         if (size(self%batch) > 0 .and. .not. allocated(error)) call close_choice(self, error)
         if (allocated(error)) return
         if (self%phase == teaching) call choose_lesson(self, error)
         if (self%phase == validating .and. .not. allocated(error)) call choose_unseen(self, error)
         if (allocated(error) .or. self%phase == finished) return
         if (size(self%batch) > 0) call find_in_campaign(self, error)
         if (.not. allocated(error) .and. any(self%unused%open)) call settle(self, error)
         if (allocated(error) .or. self%n_wanted() > 0) return
      end do
   end subroutine advance

   !> The next batch to learn from, or the end of the learning.
   subroutine choose_lesson(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer :: n_left

      n_left = count(build%learning%learner%design%available)
      build%stopped = why_to_stop(build%learning)
      if (len(build%stopped) == 0 .and. build%learning%n() >= build%learning%settings%budget) build%stopped = 'the budget is used'
      if (len(build%stopped) == 0 .and. n_left == 0) then
         build%stopped = 'no candidate is left'
         call warn(build%warnings, 'no candidate is left after '//to_text(build%learning%n())//' simulations; raise &design ' &
            & //'n_candidates to go on')
      end if
      if (len(build%stopped) == 0) then
         if (any(build%unused%open)) build%before = build%learning%learner%design
         call choose(build, min(batch_end(build%learning) - build%learning%n(), n_left), error)
         return
      end if
      if (build%learning%n() < 2) then
         call raise(error, build%failures())
         if (build%n_failed == 0) error%message = 'there are fewer than two simulations to learn from'
         return
      end if
      call refit_all(build%learning, error)
      build%phase = validating
   end subroutine choose_lesson

   !> What to validate with: rows that the budget left over, then the next points by variance.
   subroutine choose_unseen(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer :: stored, wanted

      wanted = build%problem%settings%design%validation
      if (allocated(build%unseen_modulus) .or. wanted == 0) then
         build%phase = finished
         return
      end if
      associate (unused => build%unused)
         stored = merge(0, min(wanted, unused%n()), any(unused%open))
         build%unseen_constants = unused%constants(:, unused%taken + 1:unused%taken + stored)
         build%unseen_euler_deg = unused%euler_deg(:, unused%taken + 1:unused%taken + stored)
         build%unseen_modulus = unused%modulus(unused%taken + 1:unused%taken + stored)
      end associate
      wanted = min(wanted - stored, count(build%learning%learner%design%available))
      if (wanted == 0) then
         build%phase = finished
         return
      end if
      build%before = build%learning%learner%design
      if (stored > 0) call assume(build, build%unseen_constants, build%unseen_euler_deg, error)
      if (.not. allocated(error)) call choose(build, wanted, error)
   end subroutine choose_unseen

   !> At most `count` candidates: the rest of the initial set comes first.
   subroutine choose(build, count, error)
      type(build_type), intent(inout) :: build
      integer, intent(in) :: count
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: variance(:)

      associate (learner => build%learning%learner)
         build%initial = pack(build%initial, learner%design%available(build%initial))
         build%by_variance = size(build%initial) == 0
         if (build%by_variance) then
            deallocate (build%batch)
            allocate (build%batch(count), variance(count))
            call choose_next(learner, thread_count(build%problem%settings%execution%workers), build%batch, variance, error)
         else
            build%batch = build%initial(:min(count, size(build%initial)))
            call exclude_candidates(learner, build%batch, error)
         end if
      end associate
   end subroutine choose

   !> Let the variance be that with these crystals simulated; their moduli do not matter.
   subroutine assume(build, constants, euler_deg, error)
      type(build_type), intent(inout) :: build
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: modulus(size(constants, 2))

      associate (learner => build%learning%learner)
         call predict_moduli(learner, constants, euler_deg, modulus)
         call add_simulations(learner, constants, euler_deg, modulus, .false., error)
         if (.not. allocated(error)) call update_posterior_mean(learner%design, .true., error)
      end associate
   end subroutine assume

   !> The next `n` candidates, before the moduli of the first of them are known.
   subroutine look_ahead(build, n, numbers, error)
      type(build_type), intent(inout) :: build
      integer, intent(in) :: n
      !> From 1.
      integer, allocatable, intent(out) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error

      if (any(build%unused%open)) call take_unused(build, error)
      if (allocated(error)) return
      if (n < 1 .or. n > count(build%learning%learner%design%available)) call raise(error, '--ask '//to_text(n) &
         & //': allowed are 1 .. '//to_text(count(build%learning%learner%design%available))//', the candidates that are left', &
         & exit_bad_input)
      if (.not. allocated(error)) call choose(build, n, error)
      if (allocated(error)) return
      numbers = build%batch
      if (size(numbers) < n) then
         ! The initial set is at its end: the variance, given that set, chooses the rest.
         call assume(build, build%candidates%constants(:, numbers), build%candidates%euler_deg(:, numbers), error)
         if (.not. allocated(error)) call choose(build, n - size(numbers), error)
         if (allocated(error)) return
         numbers = [numbers, build%batch]
      end if
      build%batch = [integer ::]
   end subroutine look_ahead

   !> What of the batch the campaign has; the rest is wanted.
   subroutine find_in_campaign(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: wanted, row
      logical :: found(size(build%batch))
      integer :: first(size(build%batch)), next, i

      deallocate (build%outcomes)
      allocate (build%outcomes(size(build%batch)))
      do i = 1, size(build%batch)
         wanted = wanted_row(build, build%batch(i))
         call build%campaign%find(wanted%symmetry, wanted%constants, wanted%euler_deg, row, found(i), error)
         if (allocated(error)) return
         if (found(i)) build%outcomes(i) = row%outcome
         first(i) = row%position - i + 1
      end do
      build%wanted = pack([(i, i=1, size(build%batch))], build%outcomes%status == outcome_waiting)
      call build%campaign%next_position(next, error)
      build%positions = next - 1 + [(i, i=1, size(build%wanted))]
      ! What is missing of a batch that was interrupted takes the places that it left.
      if (any(build%unused%open) .and. any(found)) then
         if (minval(first, found) == maxval(first, found)) build%positions = minval(first, found) - 1 + build%wanted
      end if
   end subroutine find_in_campaign

   !> A row of the campaign for a candidate, without an outcome.
   function wanted_row(build, number) result(row)
      type(build_type), intent(in) :: build
      integer, intent(in) :: number
      type(row_type) :: row

      row%symmetry = build%learning%learner%basis%domain%class%name
      row%constants = build%candidates%constants(:, number)
      row%euler_deg = build%candidates%euler_deg(:, number)
   end function wanted_row

   !> How many simulations are to be performed.
   pure integer function n_wanted(self)
      class(build_type), intent(in) :: self

      n_wanted = 0
      if (size(self%wanted) > 0) n_wanted = count(self%outcomes(self%wanted)%status == outcome_waiting)
   end function n_wanted

   !> Simulation i as a row of the campaign at its position, without an outcome.
   function row(self, i)
      class(build_type), intent(in) :: self
      integer, intent(in) :: i
      type(row_type) :: row

      row = wanted_row(self, self%batch(self%wanted(i)))
      row%position = self%positions(i)
   end function row

   !> The crystal of simulation i, GPa, in its axes.
   function wanted_stiffness(self, i) result(c)
      class(build_type), intent(in) :: self
      integer, intent(in) :: i
      real(wp) :: c(6, 6)

      associate (class => self%learning%learner%basis%domain%class)
         c = class%stiffness(self%candidates%constants(:, self%batch(self%wanted(i))))
      end associate
   end function wanted_stiffness

   !> Bunge-Euler angles of simulation i, degrees.
   pure function wanted_euler_deg(self, i) result(euler_deg)
      class(build_type), intent(in) :: self
      integer, intent(in) :: i
      real(wp) :: euler_deg(3)

      euler_deg = self%candidates%euler_deg(:, self%batch(self%wanted(i)))
   end function wanted_euler_deg

   !> Keep what became of simulation i: in the campaign, now or soon, if it was not there before. One thread at a time.
   subroutine store(self, i, outcome, error)
      class(build_type), intent(inout) :: self
      integer, intent(in) :: i
      type(outcome_type), intent(in) :: outcome
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row

      row = self%row(i)
      row%outcome = outcome
      call self%buffer%add(self%campaign, row, error)
      if (allocated(error)) return
      self%outcomes(self%wanted(i)) = outcome
      self%n_new = self%n_new + 1
      if (outcome%status /= outcome_done) self%n_failed = self%n_failed + 1
   end subroutine store

   !> Let all that was kept be in the campaign.
   subroutine store_all(self, error)
      class(build_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      call self%buffer%flush(self%campaign, error)
   end subroutine store_all

   !> Learn from the batch, or keep it to validate with.
   subroutine close_choice(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: numbers(:)
      real(wp), allocatable :: modulus(:)
      integer :: complete, n

      numbers = pack(build%batch, build%outcomes%status == outcome_done)
      modulus = pack(build%outcomes%modulus, build%outcomes%status == outcome_done)
      associate (learning => build%learning, constants => build%candidates%constants(:, numbers), &
         & euler_deg => build%candidates%euler_deg(:, numbers), all_done => size(numbers) == size(build%batch))
         if (build%phase == validating) then
            n = size(build%unseen_modulus) + size(modulus)
            build%unseen_constants = reshape([build%unseen_constants, constants], [size(constants, 1), n])
            build%unseen_euler_deg = reshape([build%unseen_euler_deg, euler_deg], [3, n])
            build%unseen_modulus = [build%unseen_modulus, modulus]
            ! The surrogate has not learnt what it is validated with.
            call take_back(build)
         else
            complete = batch_end(learning)
            call learn(learning, constants, euler_deg, modulus, build%by_variance, error)
            if (allocated(error)) return
            if (learning%n() == complete) then
               call close_batch(learning, .not. (all_done .and. build%by_variance), error)
            else
               call update_posterior_mean(learning%learner%design, .not. (all_done .and. build%by_variance), error)
            end if
            if (.not. all_done .and. build%n_failed > max(10, learning%settings%budget) .and. .not. allocated(error)) then
               call raise(error, build%failures())
            end if
         end if
      end associate
      build%batch = [integer ::]
      build%wanted = [integer ::]
   end subroutine close_choice

   !> How many simulations failed, and why the last did.
   function failures(self) result(message)
      class(build_type), intent(inout) :: self
      character(len=:), allocatable :: message
      type(row_type), allocatable :: rows(:)
      type(error_type), allocatable :: error
      integer :: i

      message = 'every simulation failed'
      if (self%learning%n() > 0) message = to_text(self%n_failed)//' simulations failed, more than the budget'
      call self%campaign%rows('', rows, error)
      if (allocated(error)) return
      do i = size(rows), 1, -1
         if (rows(i)%outcome%status == outcome_done) cycle
         message = message//'; the last: '//rows(i)%outcome%message
         return
      end do
   end function failures
end module build_loop
