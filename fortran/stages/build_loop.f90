!> The loop of Step 1: choose simulations and train the surrogate on them, until the budget is used.
!> `build_stage` writes the results.
!>
!> All simulations are stored in the campaign. A build that was interrupted, or that has a larger
!> budget now, therefore resumes without repeating a simulation.
module build_loop
   use abstract_basis, only: basis_type
   use bases, only: new_basis
   use abstract_stage, only: job_type, stage_type
   use build_checks, only: basis_of_problem, check_build
   use campaign, only: campaign_name, row_type
   use errors, only: error_type, raise, refuse
   use evidence_regression, only: coefficient_mean
   use kinds, only: wp
   use known_rows, only: known_rows_type, select_rows
   use posterior_focus, only: check_focus, find_focus, focus_type, has_focus, is_accurate, &
      & round_size, simulations_before, tempered
   use sequential_design, only: candidates_type, design_type, initial_set, new_candidates, &
      & set_candidates, update_posterior_mean
   use modulus_slopes, only: takes_slopes
   use simulate, only: derivatives_of, has_derivatives, identity_text, n_derivatives, &
      & outcome_done, outcome_failed, outcome_waiting
   use surrogate_learner, only: add_simulations, batch_end, change_basis, close_batch, learn, &
      & learning_type, new_learning, predict_moduli, refit_all, revert, surrogate_of
   use surrogate_model, only: simulations_type, surrogate_type, values_alone
   use text, only: to_text
   implicit none
   private
   public :: build_type

   !> Phases of the loop: simulations for training, simulations for validation, the end.
   integer, parameter :: training = 1, validating = 2, finished = 3

   type, abstract, extends(stage_type) :: build_type
      type(learning_type) :: learning
      type(candidates_type) :: candidates
      !> The posterior, if the simulations are chosen there; otherwise unallocated.
      type(focus_type), allocatable :: focus
      integer, private :: phase = training
      !> Why the training ended.
      character(len=:), allocatable :: stopped
      !> The simulations for validation: constants, GPa, (n_constants, n), Bunge-Euler angles,
      !> degrees, (3, n), and moduli, GPa, (n).
      real(wp), allocatable :: unseen_constants(:, :), unseen_euler_deg(:, :), unseen_modulus(:)
      !> Candidates of the initial set that were not chosen yet.
      integer, allocatable, private :: initial(:)
      !> Rows of the campaign on which the surrogate is not trained: those of an interrupted batch,
      !> and those beyond the budget.
      type(known_rows_type), private :: rest
      !> The design before the present choice, to which `undo_choice` reverts.
      type(design_type), allocatable, private :: design_before
      !> Numbers of the candidates of the present batch, and whether the variance chose them.
      integer, allocatable, private :: chosen(:)
      logical, private :: by_variance = .false.
   contains
      procedure :: begin, choose, look_ahead
   end type build_type

contains

   !> Refuse a build that is impossible, or whose surrogate cannot be stored; then train on the rows
   !> of the campaign.
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
            & self%candidates%euler_deg, &
            & takes_slopes(basis) .and. has_derivatives(problem%settings))
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
         call self%campaign%rows(rows, error)
         if (allocated(error)) return
         if (size(rows) == 0) then
            call self%campaign%other_physics(others, error)
            if (allocated(error)) return
            if (len(others) > 0) then
               call self%warn('other_physics', self%campaign%path//' holds only simulations of ' &
                  & //'another physics ('//others(:index(others//achar(10), achar(10)) - 1)//')')
            end if
         end if
         call replay()
         self%n_expected = max(0, design%budget + design%validation - self%learning%n())
      end associate

   contains

      !> Train on the rows of the campaign as in the run that made them: in whole batches. The rows
      !> of an interrupted batch stay available to the design, so that the same choice is made
      !> again and their moduli are used in the order of choice; see `match_interrupted`.
      subroutine replay()
         logical, allocatable :: is_trained(:)
         integer :: n_outside

         associate (learner => self%learning%learner, learning => self%learning)
            ! The same posterior chooses the simulations of a round again, and the campaign has
            ! them.
            call select_rows(rows, learner%basis, self%candidates, &
               & self%problem%settings%design%reuse == 'chosen', allocated(self%focus), &
               & self%rest, n_outside, error)
            if (allocated(error)) return
            if (allocated(self%focus)) then
               learning%settings%budget = min(learning%settings%budget, &
                  & max(simulations_before, self%rest%n()))
               learning%first = min(learning%first, learning%settings%budget)
            end if
            if (n_outside > 0) then
               call self%warn('simulations_outside', numbers=[real(n_outside, wp)])
            end if
            self%n_failed = self%rest%failed
            call train_on_rows(self, .true., error)
            if (allocated(error)) return
            call self%rest%divide(is_trained)
            where (is_trained) learner%design%available = .false.
            if (any(self%rest%open)) then
               call update_posterior_mean(learner%design, .true., error)
            else
               call use_all_rows(self, error)
            end if
         end associate
      end subroutine replay
   end subroutine begin

   !> Train on the rows that are left, batch by batch.
   subroutine train_on_rows(build, whole, error)
      class(build_type), intent(inout) :: build
      !> Leave out the rows that do not fill a batch.
      logical, intent(in) :: whole
      type(error_type), allocatable, intent(out) :: error
      integer :: complete, last, i

      associate (rest => build%rest, learning => build%learning)
         do while (rest%n() > 0 .and. learning%n() < learning%settings%budget)
            complete = batch_end(learning)
            if (whole .and. rest%n() < complete - learning%n()) exit
            last = rest%taken + min(rest%n(), complete - learning%n())
            call learn(learning, rest%of_rows([(i, i=rest%taken + 1, last)]), .false., error)
            rest%taken = last
            if (learning%n() == complete .and. .not. allocated(error)) then
               call close_batch(learning, .false., error)
            end if
            if (allocated(error)) return
         end do
      end associate
   end subroutine train_on_rows

   !> Train on the rows that are left, in the order in which they were stored. The design does not
   !> choose them any more.
   subroutine use_all_rows(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error

      where (build%rest%open) build%learning%learner%design%available = .false.
      build%rest%open = .false.
      if (build%phase /= training) return
      call train_on_rows(build, .false., error)
      if (allocated(error)) return
      call update_posterior_mean(build%learning%learner%design, .true., error)
   end subroutine use_all_rows

   !> Restore the design to its state before the present choice.
   subroutine undo_choice(build)
      class(build_type), intent(inout) :: build

      build%chosen = [integer ::]
      call revert(build%learning%learner, build%design_before)
      deallocate (build%design_before)
   end subroutine undo_choice

   !> Train on the batch that was simulated and choose the next one. The batch is empty at the end.
   subroutine choose(self, error)
      class(build_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      do
         if (size(self%chosen) > 0) call close_choice(self, error)
         if (allocated(error)) return
         if (self%phase == training) call choose_training_batch()
         if (self%phase == validating .and. .not. allocated(error)) call choose_validation()
         if (allocated(error)) return
         call set_batch()
         if (self%phase == finished) return
         ! Missing rows of an interrupted batch get the positions that are free within it.
         call self%look_up(any(self%rest%open) .or. allocated(self%focus), error)
         if (.not. allocated(error) .and. any(self%rest%open)) call match_interrupted()
         if (allocated(error) .or. (size(self%chosen) > 0 &
            & .and. any(self%rows%outcome%status == outcome_waiting))) then
            return
         end if
      end do

   contains

      !> Choose the next batch for training, or end the training.
      subroutine choose_training_batch()
         integer :: n_left

         associate (learning => self%learning)
            n_left = count(learning%learner%design%available)
            self%stopped = ''
            if (learning%n() >= learning%settings%budget) self%stopped = 'the budget is used'
            if (len(self%stopped) == 0 .and. n_left == 0) then
               self%stopped = 'no candidate is left'
               call self%warn('no_candidate_left', numbers=[real(learning%n(), wp)])
            end if
            if (allocated(self%focus) .and. len(self%stopped) > 0 .and. learning%n() >= 2) then
               call begin_round(self, error)
               if (allocated(error)) return
               n_left = count(learning%learner%design%available)
            end if
            if (len(self%stopped) == 0) then
               if (any(self%rest%open)) self%design_before = learning%learner%design
               call choose_some(self, min(batch_end(learning) - learning%n(), n_left))
            else if (learning%n() < 2) then
               call raise(error, failures(self))
               if (self%n_failed == 0) then
                  error%message = 'fewer than two simulations; a surrogate needs two'
               end if
            else
               call refit_all(learning, error)
               self%phase = validating
            end if
         end associate
      end subroutine choose_training_batch

      !> Choose the simulations for validation: first the rows beyond the budget, then the
      !> candidates with the largest variance.
      subroutine choose_validation()
         integer :: stored, wanted

         wanted = self%problem%settings%design%validation
         if (allocated(self%unseen_modulus)) wanted = 0
         stored = 0
         if (wanted > 0) then
            associate (rest => self%rest)
               if (.not. any(rest%open)) stored = min(wanted, rest%n())
               self%unseen_constants = rest%constants(:, rest%taken + 1:rest%taken + stored)
               self%unseen_euler_deg = rest%euler_deg(:, rest%taken + 1:rest%taken + stored)
               self%unseen_modulus = rest%modulus(rest%taken + 1:rest%taken + stored)
            end associate
            wanted = min(wanted - stored, count(self%learning%learner%design%available))
         end if
         if (wanted == 0) then
            self%phase = finished
            return
         end if
         self%design_before = self%learning%learner%design
         if (stored > 0) then
            call assume_simulated(self, self%unseen_constants, self%unseen_euler_deg, error)
         end if
         if (allocated(error)) return
         call choose_some(self, wanted)
      end subroutine choose_validation

      !> Make the batch and its rows from the candidates that are chosen.
      subroutine set_batch()
         integer :: i

         deallocate (self%rows)
         allocate (self%rows(size(self%chosen)))
         associate (rows => self%rows, class => self%learning%learner%basis%domain%class)
            rows%symmetry = class%name
            do i = 1, size(rows)
               rows(i)%constants = self%candidates%constants(:, self%chosen(i))
               rows(i)%euler_deg = self%candidates%euler_deg(:, self%chosen(i))
            end do
            self%batch = [(job_type(class%stiffness(rows(i)%constants), rows(i)%euler_deg), i=1, &
               & size(rows))]
         end associate
      end subroutine set_batch

      !> Compare the present choice with the rows of an interrupted batch. If the choice contains
      !> all of these rows, it is that batch, and the build resumes. If it does not, and the choice
      !> has rows that are missing, another &design made the batch: undo the choice and train on the
      !> rows.
      subroutine match_interrupted()
         if (all(self%rows%outcome%status /= outcome_waiting) .or. &
            & count(self%rest%open) == count(self%rest%open(self%chosen))) then
            call self%rest%choose(self%chosen)
            return
         end if
         call undo_choice(self)
         if (allocated(self%unseen_modulus)) deallocate (self%unseen_modulus)
         call use_all_rows(self, error)
      end subroutine match_interrupted
   end subroutine choose

   !> Begin a round at the posterior, whose crystals are the new candidates and define the domain;
   !> or end the training.
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
         call new_basis(focus%domain, build%problem%settings%surrogate, surrogate%basis, error)
         if (allocated(error)) return
         call change_basis(learning, surrogate%basis, error)
         if (allocated(error)) return
         call set_candidates(learning%learner%design, surrogate%basis, build%candidates%constants, &
            & build%candidates%euler_deg, takes_slopes(surrogate%basis) &
            & .and. has_derivatives(build%problem%settings))
         build%stopped = ''
         if (learning%n() >= design%budget) build%stopped = 'the budget is used'
         if (is_accurate(focus)) build%stopped = 'the surrogate is accurate at the posterior'
         build%initial = [(i, i=1, tempered)]
         learning%first = learning%n()
         learning%settings%budget = min(design%budget, learning%n() + round_size)
         learning%settings%batch = round_size
      end associate
   end subroutine begin_round

   !> Choose up to `count` candidates: those of the initial set first.
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
            call learner%rule%choose(learner%design, learner%basis, build%problem%threads(), &
               & build%chosen, variance)
         else
            build%chosen = build%initial(:min(count, size(build%initial)))
            learner%design%available(build%chosen) = .false.
         end if
      end associate
   end subroutine choose_some

   !> Update the variance as if these crystals were simulated. The variance does not depend on their
   !> moduli.
   subroutine assume_simulated(build, constants, euler_deg, error)
      class(build_type), intent(inout) :: build
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: modulus(size(constants, 2))

      associate (learner => build%learning%learner)
         call predict_moduli(learner, coefficient_mean(learner%design%regression), constants, &
            & euler_deg, modulus)
         call add_simulations(learner, values_alone(constants, euler_deg, modulus), .false., error)
         if (.not. allocated(error)) call update_posterior_mean(learner%design, .true., error)
      end associate
   end subroutine assume_simulated

   !> Choose the next `n` candidates without waiting for their moduli.
   subroutine look_ahead(self, n, numbers, error)
      class(build_type), intent(inout) :: self
      integer, intent(in) :: n
      !> Of the candidates, from 1.
      integer, allocatable, intent(out) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: left

      if (any(self%rest%open)) call use_all_rows(self, error)
      if (allocated(error)) return
      if (allocated(self%focus) .and. self%learning%n() >= self%learning%settings%budget) then
         call begin_round(self, error)
      end if
      if (allocated(error)) return
      left = count(self%learning%learner%design%available)
      if (n < 1 .or. n > left) then
         call refuse(error, '--ask '//to_text(n)//': allowed are 1 .. '//to_text(left) &
            & //', the candidates that are left')
         return
      end if
      call choose_some(self, n)
      numbers = self%chosen
      if (size(numbers) < n) then
         ! The initial set is used up. The variance, given that set, chooses the others.
         call assume_simulated(self, self%candidates%constants(:, numbers), &
            & self%candidates%euler_deg(:, numbers), error)
         if (allocated(error)) return
         call choose_some(self, n - size(numbers))
         numbers = [numbers, self%chosen]
      end if
      self%chosen = [integer ::]
   end subroutine look_ahead

   !> Train on the batch, or store it for validation.
   subroutine close_choice(build, error)
      class(build_type), intent(inout) :: build
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: done(:), numbers(:)
      real(wp), allocatable :: modulus(:)
      logical :: exactly
      integer :: complete, i, n

      done = pack([(i, i=1, size(build%rows))], build%rows%outcome%status == outcome_done)
      numbers = build%chosen(done)
      modulus = build%rows(done)%outcome%modulus
      associate (learning => build%learning, constants => build%candidates%constants(:, numbers), &
         & euler_deg => build%candidates%euler_deg(:, numbers), &
         & all_done => size(numbers) == size(build%chosen))
         if (build%phase == validating) then
            n = size(build%unseen_modulus) + size(modulus)
            build%unseen_constants = reshape([build%unseen_constants, constants], &
               & [size(constants, 1), n])
            build%unseen_euler_deg = reshape([build%unseen_euler_deg, euler_deg], [3, n])
            build%unseen_modulus = [build%unseen_modulus, modulus]
            ! The surrogate is not trained on the simulations that validate it.
            call undo_choice(build)
         else
            complete = batch_end(learning)
            call learn(learning, simulations_type(constants, euler_deg, modulus, &
               & reshape([(derivatives_of(build%rows(done(i))%outcome), i=1, size(done))], &
               & [n_derivatives, size(done)])), build%by_variance, error)
            if (allocated(error)) return
            ! A simulation may be without the derivatives that the choice expected.
            exactly = .not. (all_done .and. build%by_variance) &
               & .or. allocated(learning%learner%design%slopes)
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

   !> A message with the number of simulations that failed and the reason of the last failure.
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
      call build%campaign%rows(rows, error)
      if (allocated(error)) return
      last = findloc(rows%outcome%status, outcome_failed, 1, back=.true.)
      if (last > 0) message = message//'; the last: '//rows(last)%outcome%message
   end function failures
end module build_loop
