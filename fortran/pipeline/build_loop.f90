!> The loop of Step 1: choose the next simulations, learn from what became of them, until the budget
!> is used. See `build_stage`.
!>
!> All results go through the campaign, so that an interrupted build goes on where it was, and a
!> larger budget continues it. What is in the campaign is not asked for again.
module build_loop
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use abstract_stage, only: job_type, stage_type
   use build_checks, only: basis_of_problem, check_build
   use campaign, only: campaign_name, row_type
   use errors, only: error_type, raise, refuse, warn
   use evidence_regression, only: coefficient_mean
   use kinds, only: wp
   use known_rows, only: known_rows_type, select_rows
   use machine, only: thread_count
   use posterior_focus, only: check_focus, find_focus, focus_type, has_focus, is_accurate, &
      & round_size, simulations_before, tempered
   use sequential_design, only: candidates_type, design_type, initial_set, new_candidates, &
      & set_candidates, update_posterior_mean
   use simulate, only: identity_text, outcome_done, outcome_failed, outcome_waiting
   use surrogate_learner, only: add_simulations, batch_end, change_basis, close_batch, learn, &
      & learning_type, new_learning, predict_moduli, refit_all, revert, surrogate_of, why_to_stop
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: build_type

   !> What the loop is at: simulations to learn from, those to validate with, nothing more.
   integer, parameter :: teaching = 1, validating = 2, finished = 3

   type, abstract, extends(stage_type) :: build_type
      type(learning_type) :: learning
      type(candidates_type) :: candidates
      !> Where the posterior is, if simulations are to be chosen there.
      type(focus_type), allocatable :: focus
      integer, private :: phase = teaching
      !> Why the learning ended.
      character(len=:), allocatable :: stopped
      !> What to validate with: constants (n_constants, n), angles (3, n), moduli (n).
      real(wp), allocatable :: unseen_constants(:, :), unseen_euler_deg(:, :), unseen_modulus(:)
      !> The rest of the initial set.
      integer, allocatable, private :: initial(:)
      !> Rows of the campaign that are not learnt: of a batch that was interrupted, or what the
      !> budget leaves over.
      type(known_rows_type), private :: unused
      !> The design before the present choice, which may be taken back.
      type(design_type), allocatable, private :: before
      !> The candidates that are chosen, of which the rows are; whether the variance chose them.
      integer, allocatable, private :: chosen(:)
      logical, private :: by_variance = .false.
   contains
      procedure :: begin, choose, look_ahead
   end type build_type

contains

   !> Refuse a build that could not be, or whose surrogate could not be kept; then learn what the
   !> campaign has.
   subroutine begin(self, error)
      class(build_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      class(basis_type), allocatable :: basis
      type(row_type), allocatable :: rows(:)
      character(len=:), allocatable :: others

      allocate (self%chosen(0))
      self%stopped = ''
      associate (problem => self%problem, design => self%problem%settings%design)
         call check_build(problem, error, self%output)
         if (allocated(error)) return
         call basis_of_problem(problem, basis, error)
         if (allocated(error)) return
         call new_candidates(problem, basis, self%candidates, error)
         if (allocated(error)) return
         call new_learning(basis, design, self%learning, error)
         if (allocated(error)) return
         call set_candidates(self%learning%learner%design, basis, self%candidates%constants, &
            & self%candidates%euler_deg)
         if (has_focus(problem)) then
            allocate (self%focus)
            allocate (self%focus%rounds(0))
            self%groups = self%groups//' measurements prior knowledge'
            call check_focus(problem, error)
         end if
         if (allocated(error)) return
         call initial_set(self%candidates, basis, design, self%initial)
         call self%campaign%open(self%output//'/'//campaign_name, &
            & identity_text(problem%settings), error)
         if (allocated(error)) return
         call self%campaign%rows('', rows, error)
         if (allocated(error)) return
         if (size(rows) == 0) then
            call self%campaign%other_physics(others, error)
            if (allocated(error)) return
            if (len(others) > 0) then
               call warn(self%warnings, &
                  & self%campaign%path//' holds only simulations of another physics (' &
                  & //others(:index(others//achar(10), achar(10)) - 1)//'); they are not used here')
            end if
         end if
         call replay(self, rows, error)
         self%n_expected = max(0, design%budget + design%validation - self%learning%n())
      end associate
   end subroutine begin

   !> Learn from the rows of the campaign as they were learnt from when they were made: whole
   !> batches. What is there of a batch that was interrupted may be chosen once more, so that its
   !> moduli are learnt in the order of choice; see `settle`.
   subroutine replay(build, rows, error)
      class(build_type), intent(inout) :: build
      type(row_type), intent(in) :: rows(:)
      type(error_type), allocatable, intent(out) :: error
      logical, allocatable :: taken(:)
      integer :: beyond

      associate (learner => build%learning%learner, learning => build%learning)
         ! The simulations of a round are chosen again by the same posterior, and found in the
         ! campaign.
         call select_rows(rows, learner%basis, build%candidates, &
            & build%problem%settings%design%reuse == 'chosen', allocated(build%focus), &
            & build%unused, beyond, error)
         if (allocated(error)) return
         if (allocated(build%focus)) then
            learning%settings%budget = min(learning%settings%budget, &
               & max(simulations_before, build%unused%n()))
            learning%first = min(learning%first, learning%settings%budget)
         end if
         if (beyond > 0) then
            call warn(build%warnings, to_text(beyond)//' simulations of the campaign are outside ' &
               & //'the surrogate''s domain and are not used')
         end if
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

   !> Learn from the rows that are not learnt yet, batch by batch; `whole`: as long as they fill a
   !> batch.
   subroutine learn_unused(build, whole, error)
      class(build_type), intent(inout) :: build
      logical, intent(in) :: whole
      type(error_type), allocatable, intent(out) :: error
      integer :: complete, last

      associate (unused => build%unused, learning => build%learning)
         do while (unused%n() > 0 .and. learning%n() < learning%settings%budget)
            complete = batch_end(learning)
            if (len(why_to_stop(build%learning)) > 0 &
               & .or. (whole .and. unused%n() < complete - learning%n())) then
               exit
            end if
            last = unused%taken + min(unused%n(), complete - learning%n())
            call learn(learning, unused%constants(:, unused%taken + 1:last), unused%euler_deg(:, &
               & unused%taken + 1:last), unused%modulus(unused%taken + 1:last), .false., error)
            unused%taken = last
            if (learning%n() == complete .and. .not. allocated(error)) then
               call close_batch(learning, .false., error)
            end if
            if (allocated(error)) return
         end do
      end associate
   end subroutine learn_unused

   !> Learn from what is not learnt yet in the order in which it was stored; none of it is chosen
   !> any more.
   subroutine take_unused(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error

      where (build%unused%open) build%learning%learner%design%available = .false.
      build%unused%open = .false.
      if (build%phase /= teaching) return
      call learn_unused(build, .false., error)
      if (allocated(error)) return
      call update_posterior_mean(build%learning%learner%design, .true., error)
   end subroutine take_unused

   !> What of a batch that was interrupted is in the campaign must be in the batch chosen now, which
   !> is then the same one. If something else is there, and something of the batch is not, another
   !> &design chose: the choice is taken back, and the rows are learnt as they are.
   subroutine settle(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error

      if (all(build%rows%outcome%status /= outcome_waiting) .or. &
         & count(build%unused%open) == count(build%unused%open(build%chosen))) then
         call build%unused%choose(build%chosen)
         return
      end if
      call take_back(build)
      if (allocated(build%unseen_modulus)) deallocate (build%unseen_modulus)
      call take_unused(build, error)
   end subroutine settle

   !> Let the design be as it was before the present choice, which ends.
   subroutine take_back(build)
      class(build_type), intent(inout) :: build

      build%chosen = [integer ::]
      call revert(build%learning%learner, build%before)
      deallocate (build%before)
   end subroutine take_back

   !> Learn the batch that was performed and choose the next; nothing is wanted when all is done.
   subroutine choose(self, error)
      class(build_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      do
         if (size(self%chosen) > 0) call close_choice(self, error)
         if (allocated(error)) return
         if (self%phase == teaching) call choose_lesson(self, error)
         if (self%phase == validating .and. .not. allocated(error)) call choose_unseen(self, error)
         if (allocated(error)) return
         call set_batch(self)
         if (self%phase == finished) return
         ! What is missing of a batch that was interrupted takes the places that it left.
         call self%look_up(any(self%unused%open) .or. allocated(self%focus), error)
         if (.not. allocated(error) .and. any(self%unused%open)) call settle(self, error)
         if (allocated(error) .or. (size(self%chosen) > 0 &
            & .and. any(self%rows%outcome%status == outcome_waiting))) then
            return
         end if
      end do
   end subroutine choose

   !> The batch and its rows are the candidates that are chosen.
   subroutine set_batch(build)
      class(build_type), intent(inout) :: build
      integer :: i

      deallocate (build%rows)
      allocate (build%rows(size(build%chosen)))
      associate (class => build%learning%learner%basis%domain%class, candidates => build%candidates)
         build%rows%symmetry = class%name
         do i = 1, size(build%rows)
            build%rows(i)%constants = candidates%constants(:, build%chosen(i))
            build%rows(i)%euler_deg = candidates%euler_deg(:, build%chosen(i))
         end do
         build%batch = [(job_type(class%stiffness(build%rows(i)%constants), &
            & build%rows(i)%euler_deg), i=1, size(build%rows))]
      end associate
   end subroutine set_batch

   !> The next batch to learn from, or the end of the learning.
   subroutine choose_lesson(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer :: n_left

      associate (learning => build%learning)
         n_left = count(learning%learner%design%available)
         build%stopped = why_to_stop(learning)
         if (len(build%stopped) == 0 .and. learning%n() >= learning%settings%budget) then
            build%stopped = 'the budget is used'
         end if
         if (len(build%stopped) == 0 .and. n_left == 0) then
            build%stopped = 'no candidate is left'
            call warn(build%warnings, 'no candidate is left after '//to_text(learning%n()) &
               & //' simulations; raise &design n_candidates to go on')
         end if
         if (allocated(build%focus) .and. len(build%stopped) > 0 .and. learning%n() >= 2) then
            call begin_round(build, error)
            if (allocated(error)) return
            n_left = count(learning%learner%design%available)
         end if
         if (len(build%stopped) == 0) then
            if (any(build%unused%open)) build%before = learning%learner%design
            call choose_some(build, min(batch_end(learning) - learning%n(), n_left))
         else if (learning%n() < 2) then
            call raise(error, failures(build))
            if (build%n_failed == 0) then
               error%message = 'fewer than two simulations; a surrogate needs two'
            end if
         else
            call refit_all(learning, error)
            build%phase = validating
         end if
      end associate
   end subroutine choose_lesson

   !> The candidates and the domain are those of the posterior; or the learning ends.
   subroutine begin_round(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: surrogate
      integer :: i

      associate (learning => build%learning, focus => build%focus, &
         & design => build%problem%settings%design)
         call refit_all(learning, error)
         if (allocated(error)) return
         call surrogate_of(learning%learner, '', surrogate, error)
         if (allocated(error)) return
         call find_focus(build%problem, surrogate, build%candidates, focus, error)
         if (allocated(error)) return
         build%candidates = focus%candidates
         call new_basis(focus%domain, build%problem%settings%surrogate, surrogate%basis, error)
         if (allocated(error)) return
         call change_basis(learning, surrogate%basis, error)
         if (allocated(error)) return
         call set_candidates(learning%learner%design, surrogate%basis, build%candidates%constants, &
            & build%candidates%euler_deg)
         build%stopped = ''
         if (learning%n() >= design%budget) build%stopped = 'the budget is used'
         if (is_accurate(focus)) build%stopped = 'the surrogate is accurate at the posterior'
         build%initial = [(i, i=1, tempered)]
         learning%first = learning%n()
         learning%settings%budget = min(design%budget, learning%n() + round_size)
         learning%settings%batch = round_size
         learning%settings%target_gpa = 0.0_wp
         learning%settings%patience = 0
      end associate
   end subroutine begin_round

   !> What to validate with: rows that the budget left over, then the next points by variance.
   subroutine choose_unseen(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer :: stored, wanted

      wanted = build%problem%settings%design%validation
      if (allocated(build%unseen_modulus)) wanted = 0
      stored = 0
      if (wanted > 0) then
         associate (unused => build%unused)
            if (.not. any(unused%open)) stored = min(wanted, unused%n())
            build%unseen_constants = unused%constants(:, unused%taken + 1:unused%taken + stored)
            build%unseen_euler_deg = unused%euler_deg(:, unused%taken + 1:unused%taken + stored)
            build%unseen_modulus = unused%modulus(unused%taken + 1:unused%taken + stored)
         end associate
         wanted = min(wanted - stored, count(build%learning%learner%design%available))
      end if
      if (wanted == 0) then
         build%phase = finished
         return
      end if
      build%before = build%learning%learner%design
      if (stored > 0) call assume(build, build%unseen_constants, build%unseen_euler_deg, error)
      if (allocated(error)) return
      call choose_some(build, wanted)
   end subroutine choose_unseen

   !> At most `count` candidates: the rest of the initial set comes first.
   subroutine choose_some(build, count)
      class(build_type), intent(inout) :: build
      integer, intent(in) :: count
      real(wp) :: variance(count)

      associate (learner => build%learning%learner)
         build%initial = pack(build%initial, learner%design%available(build%initial))
         build%by_variance = size(build%initial) == 0
         if (build%by_variance) then
            deallocate (build%chosen)
            allocate (build%chosen(count))
            call learner%rule%choose(learner%design, learner%basis, &
               & thread_count(build%problem%settings%execution%workers), build%chosen, variance)
         else
            build%chosen = build%initial(:min(count, size(build%initial)))
            learner%design%available(build%chosen) = .false.
         end if
      end associate
   end subroutine choose_some

   !> Let the variance be that with these crystals simulated; their moduli do not matter.
   subroutine assume(build, constants, euler_deg, error)
      class(build_type), intent(inout) :: build
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: modulus(size(constants, 2))

      associate (learner => build%learning%learner)
         call predict_moduli(learner, coefficient_mean(learner%design%regression), constants, &
            & euler_deg, modulus)
         call add_simulations(learner, constants, euler_deg, modulus, .false., error)
         if (.not. allocated(error)) call update_posterior_mean(learner%design, .true., error)
      end associate
   end subroutine assume

   !> The next `n` candidates, before the moduli of the first of them are known.
   subroutine look_ahead(self, n, numbers, error)
      class(build_type), intent(inout) :: self
      integer, intent(in) :: n
      !> From 1.
      integer, allocatable, intent(out) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: left

      if (any(self%unused%open)) call take_unused(self, error)
      if (allocated(error)) return
      if (allocated(self%focus) .and. self%learning%n() >= self%learning%settings%budget) then
         call begin_round(self, error)
      end if
      if (allocated(error)) return
      left = count(self%learning%learner%design%available)
      if (n < 1 .or. n > left) then
         call refuse(error, '--ask '//to_text(n)//': allowed are 1 .. '//to_text(left) &
            & //', the candidates that are left')
      end if
      if (allocated(error)) return
      call choose_some(self, n)
      numbers = self%chosen
      if (size(numbers) < n) then
         ! The initial set is at its end: the variance, given that set, chooses the rest.
         call assume(self, self%candidates%constants(:, numbers), &
            & self%candidates%euler_deg(:, numbers), error)
         if (allocated(error)) return
         call choose_some(self, n - size(numbers))
         numbers = [numbers, self%chosen]
      end if
      self%chosen = [integer ::]
   end subroutine look_ahead

   !> Learn from the batch, or keep it to validate with.
   subroutine close_choice(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: numbers(:)
      real(wp), allocatable :: modulus(:)
      logical :: exactly
      integer :: complete, n

      numbers = pack(build%chosen, build%rows%outcome%status == outcome_done)
      modulus = pack(build%rows%outcome%modulus, build%rows%outcome%status == outcome_done)
      associate (learning => build%learning, constants => build%candidates%constants(:, numbers), &
         & euler_deg => build%candidates%euler_deg(:, numbers), &
         & all_done => size(numbers) == size(build%chosen))
         if (build%phase == validating) then
            n = size(build%unseen_modulus) + size(modulus)
            build%unseen_constants = reshape([build%unseen_constants, constants], &
               & [size(constants, 1), n])
            build%unseen_euler_deg = reshape([build%unseen_euler_deg, euler_deg], [3, n])
            build%unseen_modulus = [build%unseen_modulus, modulus]
            ! The surrogate has not learnt what it is validated with.
            call take_back(build)
         else
            complete = batch_end(learning)
            call learn(learning, constants, euler_deg, modulus, build%by_variance, error)
            if (allocated(error)) return
            exactly = .not. (all_done .and. build%by_variance)
            if (learning%n() == complete) then
               call close_batch(learning, exactly, error)
            else
               call update_posterior_mean(learning%learner%design, exactly, error)
            end if
            if (.not. (allocated(error) .or. all_done) &
               & .and. build%n_failed > max(10, build%problem%settings%design%budget)) then
               call raise(error, failures(build))
            end if
         end if
      end associate
      build%chosen = [integer ::]
   end subroutine close_choice

   !> How many simulations failed, and why the last did.
   function failures(build) result(message)
      class(build_type), intent(in) :: build
      character(len=:), allocatable :: message
      type(row_type), allocatable :: rows(:)
      type(error_type), allocatable :: error
      integer :: last

      message = 'every simulation failed'
      if (build%learning%n() > 0) then
         message = to_text(build%n_failed)//' simulations failed, more than the budget'
      end if
      call build%campaign%rows('', rows, error)
      if (allocated(error)) return
      last = findloc(rows%outcome%status, outcome_failed, 1, back=.true.)
      if (last > 0) message = message//'; the last: '//rows(last)%outcome%message
   end function failures
end module build_loop
