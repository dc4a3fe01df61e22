!> `build`: Step 1, the surrogate that &design asks for. The loop of `build_loop` trains it; this
!> module writes its file and the document.
module build_stage
   use bases, only: new_basis
   use abstract_basis, only: basis_type
   use build_loop, only: build_type
   use diagnostics, only: diagnostic_type
   use errors, only: error_type
   use halfspace_theory, only: halfspace_moduli
   use json, only: json_type
   use kinds, only: degree, nan, wp
   use posterior_focus, only: accurate_share, accurate_z
   use settings_reader, only: settings_namelist
   use settings_schema, only: surrogate_settings_type
   use simulate, only: identity_text, simulation_error, specimen_contact_radius
   use surrogate_learner, only: add_simulations, fit_learner, history_type, learner_type, &
      & learning_type, left_out, new_learner, surrogate_of
   use surrogate_model, only: predict_crystals, save_surrogate, surrogate_type
   use text, only: join, to_text
   use build_checks, only: read_scan
   implicit none
   private
   public :: build_stage_type

   type, extends(build_type) :: build_stage_type
   contains
      procedure :: finish
   end type build_stage_type

contains

   !> Write the surrogate into the output folder, and its errors into the document.
   subroutine finish(self, page, error)
      class(build_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: surrogate
      character(len=:), allocatable :: file
      type(diagnostic_type), allocatable :: warnings(:)
      real(wp), allocatable :: stiffness(:, :, :), largest(:), theory(:)
      integer :: i, n_simulations

      associate (learning => self%learning, settings => self%problem%settings, &
         & known => self%learning%learner%simulations)
         call surrogate_of(learning%learner, provenance(self), surrogate, error)
         if (allocated(error)) return
         surrogate%contact_radius = specimen_contact_radius(settings)
         file = self%output//'/'//settings%surrogate%file
         call save_surrogate(surrogate, file, error)
         if (allocated(error)) return
         stiffness = surrogate%basis%domain%class%stiffnesses(known%constants)
         allocate (largest(learning%n()))
         call simulation_error(settings, stiffness, largest, warnings)
         self%warnings = [self%warnings, warnings]
         n_simulations = learning%n() + self%n_failed
         if (allocated(self%unseen_modulus)) then
            n_simulations = n_simulations + size(self%unseen_modulus)
         end if
         if (100*self%n_failed > n_simulations) then
            call self%warn('simulations_failed', numbers=[real(wp) :: self%n_failed, n_simulations])
         end if
         call page%put('simulations', learning%n())
         call page%put('new_simulations', self%n_new)
         call page%put('failed', self%n_failed)
         call page%put('terms', surrogate%basis%n_terms)
         call put_state(page, learning%history(size(learning%history)))
         call page%put('stopped', self%stopped)
         allocate (theory(learning%n()))
         call halfspace_moduli(stiffness, known%euler_deg, 1, theory, error)
         if (allocated(error)) return
         ! Mean absolute errors, on the same simulations, of the half-space theory and of the theory
         ! times the geometric mean of simulated modulus/theory.
         associate (ratio => exp(sum(log(known%modulus/theory))/learning%n()))
            call page%put_numbers('theory_gpa, ratio, theory_times_ratio_gpa', &
               & [sum(abs(theory - known%modulus))/learning%n(), ratio, &
               & sum(abs(ratio*theory - known%modulus))/learning%n()], 'baselines')
         end associate
         call put_domain()
         if (allocated(error)) return
         if (allocated(self%focus)) call put_focus()
         call page%begin_array('history')
         do i = 1, size(learning%history)
            call page%begin_object('')
            call page%put('simulations', learning%history(i)%simulations)
            call put_state(page, learning%history(i))
            call page%end_object()
         end do
         call page%end_array()
         call put_scan(page, settings%surrogate, learning, error)
         if (allocated(error)) return
         if (allocated(self%unseen_modulus)) call put_validation(page, self, surrogate, error)
         if (allocated(error)) return
         call page%put('file', file)
         self%done = to_text(learning%n())//' simulations, '//to_text(self%n_new)//' new, ' &
            & //to_text(self%n_failed)//' failed, '//self%stopped//': '//file
      end associate

   contains

      !> Write the accuracy at the beginning of each round at the posterior. Warn if the last one is
      !> not accurate enough.
      subroutine put_focus()
         real(wp) :: budget
         integer :: k, worst

         budget = self%problem%settings%design%budget
         call page%begin_array('focus')
         do k = 1, size(self%focus%rounds)
            associate (round => self%focus%rounds(k), names => self%problem%class%constants)
               call page%begin_object('')
               call page%put('simulations', round%simulations)
               call page%put_numbers(join(names, ', '), round%share, 'surrogate_share')
               call page%put('rms_z', merge(round%z, nan, round%z >= 0.0_wp))
               call page%put('truncated', round%truncated)
               call page%end_object()
               if (k < size(self%focus%rounds)) cycle
               worst = maxloc(round%share, 1)
               if (round%share(worst) > accurate_share) then
                  call self%warn('surrogate_error', trim(names(worst)), &
                     & [100.0_wp*round%share(worst), 100.0_wp*accurate_share, budget])
               end if
               if (round%z > accurate_z) then
                  call self%warn('surrogate_deviates', numbers=[round%z, accurate_z, budget])
               end if
            end associate
         end do
         call page%end_array()
      end subroutine put_focus

      !> Write the sd of the predictions at the candidates, which sample the domain.
      subroutine put_domain()
         real(wp), dimension(size(self%candidates%euler_deg, 2)) :: relative_sd, modulus, sd
         character(len=:), allocatable :: where

         where = 'in the domain'
         if (allocated(self%focus)) where = 'at the posterior'
         call predict_crystals(surrogate, &
            & surrogate%basis%domain%class%stiffnesses(self%candidates%constants), &
            & degree*self%candidates%euler_deg, 1, modulus, sd, error)
         if (allocated(error)) return
         relative_sd = sd/modulus
         call page%begin_object('domain')
         call page%put_numbers('mean_relative_sd, largest_relative_sd', &
            & [sum(relative_sd)/size(relative_sd), maxval(relative_sd)])
         call page%put('words', 'the sd of a modulus '//where//' is ' &
            & //to_text(100.0_wp*sum(relative_sd)/size(relative_sd), 2)//' % on average, ' &
            & //to_text(100.0_wp*maxval(relative_sd), 2)//' % at most')
         call page%end_object()
      end subroutine put_domain
   end subroutine finish

   !> The origin of the surrogate, which its file contains: a JSON object.
   function provenance(build) result(text)
      class(build_type), intent(in) :: build
      character(len=:), allocatable :: text
      type(json_type) :: page

      associate (last => build%learning%history(size(build%learning%history)))
         call page%begin_object('')
         call page%put('title', 'surrogate of the indentation modulus of ' &
            & //build%learning%learner%basis%domain%members//' crystals')
         call page%put('physics', identity_text(build%problem%settings))
         call page%put('simulations', build%learning%n())
         call page%put('seed', build%problem%settings%problem%seed)
         call page%put_numbers('loocv_gpa, leave_crystal_out_gpa', &
            & [last%loocv, last%leave_crystal_out])
         ! The groups that determine the surrogate are the same for every command.
         call page%put('namelist', settings_namelist(build%problem%settings, build%groups))
         call page%end_object()
      end associate
      text = page%text()
   end function provenance

   !> Write an entry of the history into the open object.
   subroutine put_state(page, state)
      type(json_type), intent(inout) :: page
      type(history_type), intent(in) :: state

      call page%put_numbers('loocv_gpa, leave_crystal_out_gpa, next_gpa', [state%loocv, &
         & state%leave_crystal_out, merge(state%next, nan, state%next >= 0.0_wp)])
      call page%put_numbers('alpha, beta, fall, log_evidence, norm, angle_deg', [state%alpha, &
         & state%beta, state%decay_rate, state%log_evidence, state%norm, state%angle_deg])
   end subroutine put_state

   !> Write the evidence and the leave-one-out errors of other truncations for increasing numbers of
   !> simulations (Figs. 1 and 6).
   subroutine put_scan(page, stated, learning, error)
      type(json_type), intent(inout) :: page
      type(surrogate_settings_type), intent(in) :: stated
      type(learning_type), intent(in) :: learning
      type(error_type), allocatable, intent(out) :: error
      !> Numbers of simulations at which the error is computed.
      integer, parameter :: n_counts = 6
      type(surrogate_settings_type) :: settings
      type(learner_type) :: learner
      class(basis_type), allocatable :: basis
      integer, allocatable :: pairs(:, :)
      real(wp) :: errors(n_counts)
      integer :: counts(0:n_counts), i, j, k

      settings = stated
      call read_scan(settings%scan, pairs, error)
      if (allocated(error) .or. size(pairs) == 0) return
      counts = [0, (learning%first + ((i - 1)*(learning%n() - learning%first))/(n_counts - 1), &
         & i=1, n_counts)]
      call page%begin_array('scan')
      do k = 1, size(pairs, 2)
         settings%degree = pairs(1, k)
         settings%bandlimit = pairs(2, k)
         call new_basis(learning%learner%basis%domain, settings, basis, error)
         if (allocated(error)) return
         call new_learner(basis, learner, error)
         if (allocated(error)) return
         do i = 1, n_counts
            call add_simulations(learner, &
               & learning%learner%simulations%of_rows([(j, j=counts(i - 1) + 1, counts(i))]), &
               & .true., error)
            if (allocated(error)) return
            call fit_learner(learner, error)
            if (allocated(error)) return
            call left_out(learner, [(j, j=1, counts(i))], errors(i), error)
            if (allocated(error)) return
         end do
         call page%begin_object('')
         call page%put('degree', settings%degree)
         call page%put('bandlimit', settings%bandlimit)
         call page%put('terms', basis%n_terms)
         call page%put_numbers('alpha, beta, log_evidence, loocv_gpa', &
            & [learner%design%regression%alpha, learner%design%regression%beta, &
            & learner%log_evidence, errors(n_counts)])
         call page%begin_object('curve')
         call page%put('simulations', real(counts(1:), wp))
         call page%put('loocv_gpa', errors)
         call page%end_object()
         call page%end_object()
      end do
      call page%end_array()
   end subroutine put_scan

   !> Write the errors of the surrogate at simulations that are not in its training.
   subroutine put_validation(page, build, surrogate, error)
      type(json_type), intent(inout) :: page
      class(build_type), intent(in) :: build
      type(surrogate_type), intent(in) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(build%unseen_modulus)) :: mean, sd, deviation
      call predict_crystals(surrogate, &
         & surrogate%basis%domain%class%stiffnesses(build%unseen_constants), &
         & degree*build%unseen_euler_deg, 1, mean, sd, error)
      deviation = abs(mean - build%unseen_modulus)
      call page%begin_object('validation')
      call page%put('points', size(mean))
      call page%put('constants', transpose(build%unseen_constants))
      call page%put('euler_deg', transpose(build%unseen_euler_deg))
      call page%put_numbers('mean_absolute_gpa, within_1_sd, within_2_sd', [sum(deviation), &
         & real(count(deviation <= sd), wp), real(count(deviation <= 2*sd), wp)]/max(1, size(mean)))
      call page%put('simulated', build%unseen_modulus)
      call page%put('predicted', mean)
      call page%put('sd', sd)
      call page%end_object()
   end subroutine put_validation
end module build_stage
