!> The loop of Step 1: choose the next simulations, have them performed, store them, learn from them. Both programs run it:
!>
!>     call open_build(problem, output, build, error)
!>     do
!>        call build%advance(error)                  ! learn, and choose what to simulate next
!>        if (build%n_wanted() == 0) exit
!>        (simulate build%stiffness(i) at build%euler_deg(i), i = 1 .. n_wanted, in any order, and give each to build%store)
!>     end do
!>     call conclude(build, document, error)         ! of `build_document`
!>
!> All results go through the campaign, so that an interrupted build goes on where it was, and a larger budget continues it. What is in the
!> campaign is not asked for again.
module step_1
   use abstract_basis, only: basis_type
   use build_candidates, only: candidates_type, initial_set, new_candidates
   use build_checks, only: basis_of_problem
   use campaign, only: campaign_name, campaign_type, row_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, raise
   use kinds, only: wp
   use learning, only: batch_end, close_batch, learn, learning_type, new_learning, refit_all, why_to_stop
   use physics_identity, only: identity_text
   use problem, only: problem_type
   use sequential_design, only: update_posterior_mean
   use simulate, only: outcome_done, outcome_type, outcome_waiting
   use surrogate_learner, only: add_simulations, choose_next, exclude_candidates, predict_moduli, set_learner_candidates
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
      type(learning_type) :: learning
      type(candidates_type) :: candidates
      type(warning_type), allocatable :: warnings(:)
      integer :: phase = teaching
      !> Why the learning ended; the document of `build_document` once there is one.
      character(len=:), allocatable :: stopped, document
      !> Simulations that were performed, and that failed, now or earlier.
      integer :: n_new = 0, n_failed = 0
      !> What to validate with: constants (n_constants, n), angles (3, n), moduli (n).
      real(wp), allocatable :: unseen_constants(:, :), unseen_euler_deg(:, :), unseen_modulus(:)
      !> The rest of the initial set; rows that the budget leaves over.
      integer, allocatable, private :: initial(:)
      type(row_type), allocatable, private :: unused(:)
      !> The candidates of the batch under way and what became of each; which of them must be simulated; whether the variance chose them.
      integer, allocatable, private :: batch(:), wanted(:)
      type(outcome_type), allocatable, private :: outcomes(:)
      logical, private :: by_variance = .false.
      integer, private :: first_position = 0
   contains
      procedure :: advance
      procedure :: n_wanted
      procedure :: row
      procedure :: stiffness => wanted_stiffness
      procedure :: euler_deg => wanted_euler_deg
      procedure :: store
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
         call new_learning(basis, design%initial, design%budget, design%batch, design%refit, build%learning, error)
         if (.not. allocated(error)) call set_learner_candidates(build%learning%learner, build%candidates%constants, &
            & build%candidates%euler_deg, design%variance_of, error)
         if (allocated(error)) return
         call initial_set(build%candidates, basis, design, build%initial)
      end associate
      allocate (build%batch(0), build%wanted(0), build%outcomes(0))
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

   !> Learn from the rows of the campaign as they were learnt from when they were made.
   subroutine replay(build, rows, error)
      type(build_type), intent(inout) :: build
      type(row_type), intent(in) :: rows(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: constants(:, :)
      integer, allocatable :: kept(:)
      integer :: start, end_of_part, i

      call select_rows(build, rows, kept, constants, error)
      if (allocated(error)) return
      start = 1
      do while (start <= size(kept) .and. build%learning%n() < build%learning%budget)
         if (len(why_to_stop_now(build)) > 0) exit
         end_of_part = min(size(kept), start - 1 + batch_end(build%learning) - build%learning%n())
         associate (part => kept(start:end_of_part), complete => batch_end(build%learning))
            call learn(build%learning, constants(:, start:end_of_part), angles_of(rows(part)), &
               & [(rows(part(i))%outcome%modulus, i=1, size(part))], .false., error)
            if (allocated(error)) return
            if (build%learning%n() == complete) call close_batch(build%learning, .false., error)
            if (allocated(error)) return
         end associate
         start = end_of_part + 1
      end do
      call update_posterior_mean(build%learning%learner%design, .true., error)
      build%unused = rows(kept(start:))
      build%unseen_constants = constants(:, start:)
   end subroutine replay

   !> Rows of the campaign that are data from the start, in order of choice, by the constants of the domain's class; all others that are
   !> about candidates are not simulated again.
   subroutine select_rows(build, rows, kept, constants, error)
      type(build_type), intent(inout) :: build
      type(row_type), intent(in) :: rows(:)
      integer, allocatable, intent(out) :: kept(:)
      !> (n_constants, n), GPa.
      real(wp), allocatable, intent(out) :: constants(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      real(wp) :: c(6, 6)
      integer :: i, n, beyond
      logical :: chosen_only

      chosen_only = build%problem%settings%design%reuse == 'chosen'
      beyond = 0
      associate (basis => build%learning%learner%basis)
         n = 0
         allocate (kept(size(rows)), constants(basis%domain%class%n_constants, size(rows)))
         do i = 1, size(rows)
            if (.not. allocated(class%name)) call new_crystal_class(rows(i)%symmetry, class, error)
            if (class%name /= rows(i)%symmetry) call new_crystal_class(rows(i)%symmetry, class, error)
            if (allocated(error)) return
            c = class%stiffness(rows(i)%constants)
            if (.not. basis%domain%is_of_class(c)) cycle
            if (chosen_only .and. .not. rows(i)%imported) cycle
            call exclude_points(build, basis%domain%class%constants_of(c), rows(i)%euler_deg, error)
            if (allocated(error)) return
            if (rows(i)%outcome%status /= outcome_done) then
               build%n_failed = build%n_failed + 1
            else if (basis%covers(c)) then
               n = n + 1
               kept(n) = i
               constants(:, n) = basis%domain%class%constants_of(c)
            else
               beyond = beyond + 1
            end if
         end do
      end associate
      kept = kept(:n)
      constants = constants(:, :n)
      if (beyond > 0) call warn(build%warnings, to_text(beyond)//' simulations of the campaign are outside the surrogate''s ' &
         & //'domain and are not used')
   end subroutine select_rows

   !> Candidates that are this point may not be chosen any more.
   subroutine exclude_points(build, constants, euler_deg, error)
      type(build_type), intent(inout) :: build
      real(wp), intent(in) :: constants(:), euler_deg(3)
      type(error_type), allocatable, intent(out) :: error
      integer :: j

      do j = 1, build%candidates%n()
         if (abs(build%candidates%constants(1, j) - constants(1)) > 0.0_wp) cycle
         if (any(abs(build%candidates%constants(:, j) - constants) > 0.0_wp)) cycle
         if (any(abs(build%candidates%euler_deg(:, j) - euler_deg) > 0.0_wp)) cycle
         call exclude_candidates(build%learning%learner, [j], error)
         if (allocated(error)) return
      end do
   end subroutine exclude_points

   pure function angles_of(rows) result(euler_deg)
      type(row_type), intent(in) :: rows(:)
      real(wp) :: euler_deg(3, size(rows))
      integer :: i

      do i = 1, size(rows)
         euler_deg(:, i) = rows(i)%euler_deg
      end do
   end function angles_of

   !> Why to stop before the budget, or ''.
   function why_to_stop_now(build) result(reason)
      type(build_type), intent(in) :: build
      character(len=:), allocatable :: reason

      associate (design => build%problem%settings%design)
         reason = why_to_stop(build%learning, design%target_gpa, design%patience)
      end associate
   end function why_to_stop_now

   !> Learn the batch that was performed and choose the next; nothing is wanted when all is done.
   subroutine advance(self, error)
      class(build_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      do
         if (self%n_wanted() > 0) then
            call raise(error, 'a simulation that the design chose has no outcome')
            return
         end if
         if (size(self%batch) > 0) call close_choice(self, error)
         if (allocated(error)) return
         if (self%phase == teaching) call choose_lesson(self, error)
         if (self%phase == validating .and. .not. allocated(error)) call choose_unseen(self, error)
         if (allocated(error) .or. self%phase == finished) return
         call find_in_campaign(self, error)
         if (allocated(error) .or. self%n_wanted() > 0) return
      end do
   end subroutine advance

   !> The next batch to learn from, or the end of the learning.
   subroutine choose_lesson(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer :: n_left

      n_left = count(build%learning%learner%design%available)
      build%stopped = why_to_stop_now(build)
      if (len(build%stopped) == 0 .and. build%learning%n() >= build%learning%budget) build%stopped = 'the budget is used'
      if (len(build%stopped) == 0 .and. n_left == 0) then
         build%stopped = 'no candidate is left'
         call warn(build%warnings, 'no candidate is left after '//to_text(build%learning%n())//' simulations; raise &design ' &
            & //'n_candidates to go on')
      end if
      if (len(build%stopped) == 0) then
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
      integer :: stored, wanted, i

      wanted = build%problem%settings%design%validation
      if (allocated(build%unseen_modulus) .or. wanted == 0) then
         build%phase = finished
         return
      end if
      stored = min(wanted, size(build%unused))
      build%unseen_constants = build%unseen_constants(:, :stored)
      build%unseen_euler_deg = angles_of(build%unused(:stored))
      build%unseen_modulus = [(build%unused(i)%outcome%modulus, i=1, stored)]
      wanted = min(wanted - stored, count(build%learning%learner%design%available))
      if (wanted == 0) then
         build%phase = finished
         return
      end if
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

   !> The next `count` candidates, before the moduli of the first of them are known.
   subroutine look_ahead(build, count, numbers, error)
      type(build_type), intent(inout) :: build
      integer, intent(in) :: count
      !> From 1.
      integer, allocatable, intent(out) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error

      call choose(build, count, error)
      if (allocated(error)) return
      numbers = build%batch
      if (size(numbers) < count) then
         ! The initial set is at its end: the variance, given that set, chooses the rest.
         call assume(build, build%candidates%constants(:, numbers), build%candidates%euler_deg(:, numbers), error)
         if (.not. allocated(error)) call choose(build, count - size(numbers), error)
         if (allocated(error)) return
         numbers = [numbers, build%batch]
      end if
      build%batch = [integer ::]
   end subroutine look_ahead

   !> What of the batch the campaign has; the rest is wanted.
   subroutine find_in_campaign(build, error)
      type(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row
      logical :: found
      integer :: i

      deallocate (build%outcomes)
      allocate (build%outcomes(size(build%batch)))
      do i = 1, size(build%batch)
         row = wanted_row(build, build%batch(i))
         call build%campaign%find(row%symmetry, row%constants, row%euler_deg, row, found, error)
         if (allocated(error)) return
         if (found) build%outcomes(i) = row%outcome
      end do
      build%wanted = pack([(i, i=1, size(build%batch))], build%outcomes%status == outcome_waiting)
      call build%campaign%next_position(build%first_position, error)
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

   !> Simulation i as a row of the campaign, without an outcome.
   function row(self, i)
      class(build_type), intent(in) :: self
      integer, intent(in) :: i
      type(row_type) :: row

      row = wanted_row(self, self%batch(self%wanted(i)))
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

   !> Keep what became of simulation i: on return it is in the campaign, if it was not before. One thread at a time.
   subroutine store(self, i, outcome, error)
      class(build_type), intent(inout) :: self
      integer, intent(in) :: i
      type(outcome_type), intent(in) :: outcome
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: row

      row = wanted_row(self, self%batch(self%wanted(i)))
      row%position = self%first_position + i - 1
      row%outcome = outcome
      call self%campaign%add(row, error)
      if (allocated(error)) return
      self%outcomes(self%wanted(i)) = outcome
      self%n_new = self%n_new + 1
      if (outcome%status /= outcome_done) self%n_failed = self%n_failed + 1
   end subroutine store

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
         else
            complete = batch_end(learning)
            call learn(learning, constants, euler_deg, modulus, build%by_variance, error)
            if (allocated(error)) return
            if (learning%n() == complete) then
               call close_batch(learning, .not. (all_done .and. build%by_variance), error)
            else
               call update_posterior_mean(learning%learner%design, .not. (all_done .and. build%by_variance), error)
            end if
            if (.not. all_done .and. build%n_failed > max(10, learning%budget) .and. .not. allocated(error)) then
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
end module step_1
