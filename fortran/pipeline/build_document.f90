!> What a build has come to: the surrogate in its file, and the document of `build`.
module build_document
   use bases, only: new_basis
   use abstract_basis, only: basis_type
   use crystal_elasticity, only: logarithmic_mean
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use json, only: json_type
   use kinds, only: degree, wp
   use learning, only: history_type, left_out, learning_type
   use physics_identity, only: identity_text
   use settings_groups, only: surrogate_settings_type
   use simulate, only: simulation_error, specimen_contact_radius
   use build_loop, only: build_type
   use surrogate_file, only: save_surrogate
   use surrogate_learner, only: add_simulations, fit_learner, learner_type, new_learner, surrogate_of
   use surrogate_model, only: predict, surrogate_type
   use text, only: fixed, to_text
   use truncation_scan, only: read_scan
   use warning_lists, only: warn
   implicit none
   private
   public :: conclude

contains

   !> Write the surrogate into the output folder, and say how good it is.
   subroutine conclude(build, output, document, error)
      type(build_type), intent(inout) :: build
      !> Folder of the results.
      character(len=*), intent(in) :: output
      !> JSON.
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: surrogate
      type(json_type) :: page
      character(len=:), allocatable :: file, words
      real(wp), allocatable :: stiffness(:, :, :), largest(:)
      integer :: i

      associate (learning => build%learning, problem => build%problem, known => build%learning%learner%simulations)
         call surrogate_of(learning%learner, provenance(build), surrogate, error)
         if (allocated(error)) return
         surrogate%contact_radius = specimen_contact_radius(problem%settings)
         file = output//'/'//problem%settings%surrogate%file
         call save_surrogate(surrogate, file, error)
         if (allocated(error)) return
         allocate (stiffness(6, 6, learning%n()), largest(learning%n()))
         do i = 1, learning%n()
            stiffness(:, :, i) = surrogate%basis%domain%class%stiffness(known%constants(:, i))
         end do
         call simulation_error(problem%settings, stiffness, largest, words)
         if (len(words) > 0) call warn(build%warnings, problem%path//': &simulation: '//words)
         call page%begin_object()
         call page%put('simulations', learning%n())
         call page%put('new_simulations', build%n_new)
         call page%put('failed', build%n_failed)
         call page%put('terms', surrogate%basis%n_terms)
         call put_state(page, learning%history(size(learning%history)))
         call page%put('stopped', build%stopped)
         call put_baselines(page, stiffness, known%euler_deg, known%modulus, error)
         if (allocated(error)) return
         call put_domain(page, build, surrogate, stiffness)
         call page%begin_array('history')
         do i = 1, size(learning%history)
            call page%begin_object()
            call page%put('simulations', learning%history(i)%simulations)
            call put_state(page, learning%history(i))
            call page%end_object()
         end do
         call page%end_array()
         call put_scan(page, build, error)
         if (allocated(error)) return
         if (allocated(build%unseen_modulus)) call put_validation(page, build, surrogate)
         call page%put('file', file)
         call page%put('warnings', build%warnings)
         call page%end_object()
         document = page%text()
      end associate
   end subroutine conclude

   !> Where the surrogate comes from: a JSON object.
   function provenance(build) result(text)
      type(build_type), intent(in) :: build
      character(len=:), allocatable :: text
      type(json_type) :: page

      associate (learning => build%learning, problem => build%problem)
         call page%begin_object()
         call page%put('title', 'surrogate of the indentation modulus of '//learning%learner%basis%domain%members//' crystals')
         call page%put('physics', identity_text(problem%settings))
         call page%put('simulations', learning%n())
         call page%put('seed', problem%settings%problem%seed)
         associate (last => learning%history(size(learning%history)))
            call page%put('loocv_gpa', last%loocv)
            call page%put('leave_crystal_out_gpa', last%leave_crystal_out)
         end associate
         ! A surrogate travels between machines: the file by its name alone.
         call page%put('namelist', problem%resolved_text(problem%path(len(problem%folder) + 1:)))
         call page%end_object()
      end associate
      text = page%text()
   end function provenance

   !> An entry of the history, in the object that is open.
   subroutine put_state(page, state)
      type(json_type), intent(inout) :: page
      type(history_type), intent(in) :: state

      call page%put('loocv_gpa', state%loocv)
      call page%put('leave_crystal_out_gpa', state%leave_crystal_out)
      if (state%next >= 0.0_wp) then
         call page%put('next_gpa', state%next)
      else
         call page%put_null('next_gpa')
      end if
      call page%put('alpha', state%alpha)
      call page%put('beta', state%beta)
      call page%put('fall', state%decay_rate)
      call page%put('log_evidence', state%log_evidence)
      call page%put('norm', state%norm)
      call page%put('angle_deg', state%angle_deg)
   end subroutine put_state

   !> Mean absolute errors on the same simulations of the theory alone and of the theory times one ratio.
   subroutine put_baselines(page, stiffness, euler_deg, modulus, error)
      type(json_type), intent(inout) :: page
      !> GPa (6, 6, n), degrees (3, n), GPa (n).
      real(wp), intent(in) :: stiffness(:, :, :), euler_deg(:, :), modulus(:)
      type(error_type), allocatable, intent(out) :: error
      type(halfspace_type) :: theory
      real(wp) :: moduli(size(modulus)), ratio
      integer :: i

      do i = 1, size(modulus)
         call halfspace_modulus(stiffness(:, :, i), degree*euler_deg(:, i), theory, error)
         if (allocated(error)) return
         moduli(i) = theory%modulus
      end do
      ratio = exp(sum(log(modulus/moduli))/size(modulus))
      call page%begin_object('baselines')
      call page%put('theory_gpa', sum(abs(moduli - modulus))/size(modulus))
      call page%put('ratio', ratio)
      call page%put('theory_times_ratio_gpa', sum(abs(ratio*moduli - modulus))/size(modulus))
      call page%end_object()
   end subroutine put_baselines

   !> How well the candidates, which stand for the domain, are predicted; and in words what of it no simulation has come near.
   subroutine put_domain(page, build, surrogate, stiffness)
      type(json_type), intent(inout) :: page
      type(build_type), intent(inout) :: build
      type(surrogate_type), intent(in) :: surrogate
      !> Of the simulations, GPa (6, 6, n).
      real(wp), intent(in) :: stiffness(:, :, :)
      real(wp), parameter :: near = 0.9_wp
      real(wp), dimension(size(stiffness, 3)) :: poisson, anisotropy, scale
      real(wp) :: relative(size(build%candidates%euler_deg, 2)), modulus, sd
      character(len=:), allocatable :: words
      integer :: i, worst

      associate (domain => surrogate%basis%domain, candidates => build%candidates)
         do i = 1, size(relative)
            call predict(surrogate, domain%class%stiffness(candidates%constants(:, i)), degree*candidates%euler_deg(:, i), &
               & modulus, sd)
            relative(i) = sd/modulus
         end do
         worst = maxloc(relative, 1)
         call logarithmic_mean(domain%class%stiffness(candidates%constants(:, worst)), poisson(1), anisotropy(1), scale(1))
         words = ' and Poisson''s ratio of '//to_text(poisson(1), 3)
         if (domain%has_scale()) words = ','//words(5:)//' and a scale of '//fixed(scale(1), 1)//' GPa'
         call page%begin_object('domain')
         call page%put('mean_relative_sd', sum(relative)/size(relative))
         call page%put('largest_relative_sd', relative(worst))
         call page%put('words', 'the sd of a modulus in the domain is '//to_text(100.0_wp*sum(relative)/size(relative), 2) &
            & //' % on average, '//to_text(100.0_wp*relative(worst), 2)//' % at most, at a log-anisotropy of ' &
            & //to_text(anisotropy(1), 3)//words)
         call page%end_object()
         if (domain%log_anisotropy_max >= huge(1.0_wp)) return
         do i = 1, size(stiffness, 3)
            call logarithmic_mean(stiffness(:, :, i), poisson(i), anisotropy(i), scale(i))
         end do
         if (maxval(anisotropy) < near*domain%log_anisotropy_max) call warn(build%warnings, 'no crystal above a ' &
            & //'log-anisotropy of '//to_text(maxval(anisotropy), 3)//' was simulated; the domain reaches ' &
            & //to_text(domain%log_anisotropy_max, 3))
         if (maxval(poisson) - minval(poisson) < near*(domain%poisson(2) - domain%poisson(1))) call warn(build%warnings, &
            & 'only crystals with Poisson''s ratios from '//to_text(minval(poisson), 2)//' to '//to_text(maxval(poisson), 2) &
            & //' were simulated; the domain reaches from '//to_text(domain%poisson(1), 2)//' to '//to_text(domain%poisson(2), 2))
         if (.not. domain%has_scale()) return
         if (log(maxval(scale)/minval(scale)) < near*log(domain%stiffness(2)/domain%stiffness(1))) call warn(build%warnings, &
            & 'only crystals of a scale (geometric mean of the stiffness'' eigenvalues) from '//fixed(minval(scale), 1)//' to ' &
            & //fixed(maxval(scale), 1)//' GPa were simulated; the domain reaches from '//to_text(domain%stiffness(1))//' to ' &
            & //to_text(domain%stiffness(2))//' GPa')
      end associate
   end subroutine put_domain

   !> Evidence and leave-one-out errors of other truncations as the number of simulations grows (Figs. 1 and 6).
   subroutine put_scan(page, build, error)
      type(json_type), intent(inout) :: page
      type(build_type), intent(in) :: build
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_settings_type) :: settings
      integer, allocatable :: pairs(:, :)
      integer :: i

      settings = build%problem%settings%surrogate
      call read_scan(settings%scan, pairs, error)
      if (allocated(error) .or. size(pairs) == 0) return
      call page%begin_array('scan')
      do i = 1, size(pairs, 2)
         settings%degree = pairs(1, i)
         settings%bandlimit = pairs(2, i)
         call put_truncation(page, build%learning, settings, error)
         if (allocated(error)) return
      end do
      call page%end_array()
   end subroutine put_scan

   subroutine put_truncation(page, learning, settings, error)
      type(json_type), intent(inout) :: page
      type(learning_type), intent(in) :: learning
      type(surrogate_settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error
      !> Numbers of simulations at which the error is computed.
      integer, parameter :: n_counts = 6
      type(learner_type) :: learner
      class(basis_type), allocatable :: basis
      real(wp) :: errors(n_counts)
      integer :: counts(0:n_counts), i, j

      call new_basis(learning%learner%basis%domain, settings, basis, error)
      if (.not. allocated(error)) call new_learner(basis, learner, error)
      if (allocated(error)) return
      counts = [0, (learning%first + ((i - 1)*(learning%n() - learning%first))/(n_counts - 1), i=1, n_counts)]
      do i = 1, n_counts
         associate (known => learning%learner%simulations, first => counts(i - 1) + 1, last => counts(i))
            call add_simulations(learner, known%constants(:, first:last), known%euler_deg(:, first:last), &
               & known%modulus(first:last), .true., error)
            if (.not. allocated(error)) call fit_learner(learner, error)
            if (.not. allocated(error)) call left_out(learner, [(j, j=1, last)], errors(i), error)
            if (allocated(error)) return
         end associate
      end do
      call page%begin_object()
      call page%put('degree', settings%degree)
      call page%put('bandlimit', settings%bandlimit)
      call page%put('terms', basis%n_terms)
      call page%put('alpha', learner%design%regression%alpha)
      call page%put('beta', learner%design%regression%beta)
      call page%put('log_evidence', learner%log_evidence)
      call page%put('loocv_gpa', errors(n_counts))
      call page%begin_object('curve')
      call page%put('simulations', real(counts(1:), wp))
      call page%put('loocv_gpa', errors)
      call page%end_object()
      call page%end_object()
   end subroutine put_truncation

   !> The surrogate on simulations that it has not seen.
   subroutine put_validation(page, build, surrogate)
      type(json_type), intent(inout) :: page
      type(build_type), intent(in) :: build
      type(surrogate_type), intent(in) :: surrogate
      real(wp), dimension(size(build%unseen_modulus)) :: mean, sd, miss
      integer :: i, n

      n = size(mean)
      do i = 1, n
         call predict(surrogate, surrogate%basis%domain%class%stiffness(build%unseen_constants(:, i)), &
            & degree*build%unseen_euler_deg(:, i), mean(i), sd(i))
      end do
      miss = abs(mean - build%unseen_modulus)
      call page%begin_object('validation')
      call page%put('points', n)
      call page%put('constants', transpose(build%unseen_constants))
      call page%put('euler_deg', transpose(build%unseen_euler_deg))
      call page%put('mean_absolute_gpa', sum(miss)/max(1, n))
      call page%put('within_1_sd', real(count(miss <= sd), wp)/max(1, n))
      call page%put('within_2_sd', real(count(miss <= 2*sd), wp)/max(1, n))
      call page%put('simulated', build%unseen_modulus)
      call page%put('predicted', mean)
      call page%put('sd', sd)
      call page%end_object()
   end subroutine put_validation
end module build_document
