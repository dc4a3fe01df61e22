!> Bases, surrogates, what trains them, and posteriors of the constants with what Step 2 finds. Crystals by the
!> constants of the basis' class (GPa), angles in degrees, candidates by numbers from 0.
module surrogate_operations
   use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_value
   use abstract_basis, only: basis_type, grain_model_type
   use abstract_sampler, only: sampler_type
   use bases, only: describe_basis
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: logarithmic_mean
   use errors, only: warning_type
   use evidence_regression, only: coefficient_covariance, coefficient_mean
   use exchange, only: exchange_type
   use extraction, only: extract, extraction_type
   use extraction_document, only: put_extraction, write_extraction
   use json, only: json_type
   use kinds, only: degree, wp
   use labelled_values, only: labelled_values_type
   use next_stage, only: next_document
   use plan_stage, only: plan_stage_type
   use problem_posterior, only: new_problem_posterior
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type, checkpoint_type, new_sampler, run_settings_type, sample_chains
   use sequential_design, only: update_posterior_mean
   use stage_documents, only: end_document
   use surrogate_domain, only: spread_crystals
   use surrogate_learner, only: add_simulations, fit_learner, learner_type, leave_out, new_learner, &
      & set_learner_candidates, surrogate_of
   use surrogate_model, only: exchange_surrogate, predict_crystals, save_surrogate, surrogate_type
   implicit none
   private
   public :: give_basis, use_basis, use_surrogate, use_learner, new_posterior, use_posterior

contains

   !> Of the problem and a surrogate: the density ('density'), that of its prior ('prior'), or all of Step 2 ('extract').
   subroutine new_posterior(verb, surrogate, x)
      character(len=*), intent(in) :: verb
      type(surrogate_type), intent(in) :: surrogate
      type(exchange_type), intent(inout) :: x
      type(posterior_type), pointer :: density
      type(extraction_type) :: found
      type(json_type) :: page
      type(warning_type), allocatable :: warnings(:), reasons(:)

      allocate (density)
      call x%give(density, 'posterior')
      if (verb == 'extract') then
         call extract(x%problem, surrogate, found, x%error)
         if (allocated(x%error)) return
         density = found%posterior
         call page%begin_object()
         call write_extraction(x%problem, found, page, warnings, reasons)
         call put_extraction(x%problem, found, end_document(page, [x%problem%warnings, warnings]), x%out)
      else
         call new_problem_posterior(x%problem, surrogate, verb == 'prior', density, x%error)
         if (allocated(x%error)) return
      end if
      call x%out%put('grains', density%n_grains)
      call x%out%put('groups', density%n_groups)
   end subroutine new_posterior

   subroutine use_posterior(verb, density, x)
      character(len=*), intent(in) :: verb
      type(posterior_type), intent(inout) :: density
      type(exchange_type), intent(inout) :: x
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains
      type(random_stream_type) :: stream
      class(grain_model_type), allocatable :: grains
      type(json_type) :: page
      type(warning_type), allocatable :: warnings(:)
      real(wp), pointer :: points(:, :)
      real(wp), allocatable :: factor(:, :)
      integer :: i

      if (x%in%has('points')) points => x%in%columns('points', density%dimension)
      select case (verb)
      case ('sample')
         call new_sampler(x%in%text('method'), x%in%integer('burn_in'), sampler, x%error)
         if (.not. allocated(x%error)) call sample_chains(density, sampler, run_settings_type(x%in%integer('samples'), &
            & x%in%integer('chains'), x%threads(), x%in%integer('seed')), chains, x%error, checkpoint_type())
         if (allocated(x%error)) return
         call x%out%put_array('draws', chains%draws, shape(chains%draws))
         call x%out%put_array('log_density', chains%log_density, shape(chains%log_density))
         call x%out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
      case ('evaluate')
         ! Log density and log likelihood; minus infinity outside the support.
         allocate (x%values(size(points, 2), 2))
         call density%evaluate(points, x%values(:, 1))
         do i = 1, size(points, 2)
            x%values(i, 2) = x%values(i, 1) - density%log_prior(density%stiffness(points(:, i)))
         end do
         where (spread(.not. x%values(:, 1) > -huge(0.0_wp), 2, 2)) x%values = ieee_value(1.0_wp, ieee_negative_inf)
      case ('moduli')
         ! Indentation moduli (GPa) of any grains, with the surrogate's error drawn given the data, and one plus the calibration error of
         ! each group, drawn likewise.
         call density%new_grains(degree*x%in%columns('euler_deg', 3), grains, x%error)
         if (allocated(x%error)) return
         allocate (x%values(size(x%in%columns('euler_deg', 3), 2), size(points, 2)), factor(density%n_groups, size(points, 2)))
         stream = new_random_stream(x%in%integer('seed'), 0)
         do i = 1, size(points, 2)
            call density%draw_moduli(points(:, i), grains, stream, x%values(:, i), factor(:, i))
         end do
         call x%out%put_array('factor', factor, shape(factor))
      case ('next')
         ! The points are draws, which have the factor on the sds as it is, not its logarithm.
         call page%begin_object()
         call next_document(x%problem, density, points, page, warnings, x%error)
         x%text = end_document(page, [x%problem%warnings, warnings])
      case default
         call x%refuse(verb)
      end select
   end subroutine use_posterior

   subroutine give_basis(basis, x)
      class(basis_type), intent(in) :: basis
      type(exchange_type), intent(inout) :: x
      class(basis_type), pointer :: held

      allocate (held, source=basis)
      call x%give(held, 'basis')
   end subroutine give_basis

   subroutine use_basis(verb, basis, x)
      character(len=*), intent(in) :: verb
      class(basis_type), intent(inout) :: basis
      type(exchange_type), intent(inout) :: x
      type(learner_type), pointer :: learner
      real(wp), allocatable :: found(:, :), others(:, :), scale(:), spread(:)
      real(wp), pointer :: c(:, :, :)
      real(wp) :: poisson, anisotropy
      integer :: i

      select case (verb)
      case ('describe')
         call describe_basis(basis, x%out)
      case ('crystals')
         ! Some that are spread over the domain by a seed.
         call spread_crystals(basis%domain, x%in%integer('count'), x%in%integer('seed'), found, others, x%error)
         if (allocated(x%error)) return
         call x%out%put_array('constants', found, shape(found))
         call x%out%put_array('euler_deg', others, shape(others))
      case ('terms')
         call basis%evaluate_crystals(x%in%columns('constants', basis%domain%class%n_constants), x%in%columns('euler_deg', 3), &
            & x%values, scale, spread)
         call x%out%put_array('scale', scale, shape(scale))
         do i = 1, size(spread)
            x%values(:, i) = spread(i)*x%values(:, i)
         end do
      case ('validity')
         ! Of crystals (GPa): the normalised distance of each, see `surrogate_domain`, whether a surrogate with the basis is valid for
         ! it, and the scale, the geometric mean of the eigenvalues of the Kelvin stiffness, GPa, NaN for an unstable one.
         c => x%crystals()
         allocate (x%values(size(c, 3), 3))
         !$omp parallel do num_threads(x%threads()) schedule(static) private(poisson, anisotropy)
         do i = 1, size(c, 3)
            call logarithmic_mean(c(:, :, i), poisson, anisotropy, x%values(i, 3))
            x%values(i, 1) = basis%domain%normalised_distance(c(:, :, i))
            x%values(i, 2) = merge(1.0_wp, 0.0_wp, basis%domain%admits(c(:, :, i)))
         end do
         !$omp end parallel do
      case ('learner')
         allocate (learner)
         call x%give(learner, 'learner')
         call new_learner(basis, learner, x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_basis

   subroutine use_surrogate(verb, surrogate, x)
      character(len=*), intent(in) :: verb
      type(surrogate_type), intent(inout) :: surrogate
      type(exchange_type), intent(inout), target :: x
      type(labelled_values_type) :: labels
      type(json_type) :: page
      type(plan_stage_type) :: stage
      real(wp), pointer :: c(:, :, :), euler_deg(:, :)

      select case (verb)
      case ('describe')
         labels%described => x%out
         call exchange_surrogate(surrogate, labels)
      case ('basis')
         call give_basis(surrogate%basis, x)
      case ('density', 'prior', 'extract')
         call new_posterior(verb, surrogate, x)
      case ('plan')
         call page%begin_object()
         stage%problem => x%problem
         stage%surrogate = surrogate
         call stage%finish(page, x%error)
         x%text = end_document(page, x%problem%warnings)
      case ('save')
         call save_surrogate(surrogate, x%in%text('path'), x%error)
      case ('predict')
         ! Modulus and sd, GPa.
         c => x%crystals()
         if (associated(x%problem)) then
            euler_deg => x%problem%crystals%euler_deg
         else
            euler_deg => x%in%columns('euler_deg', 3)
         end if
         allocate (x%values(size(c, 3), 2))
         call predict_crystals(surrogate, c, degree*euler_deg, x%threads(), x%values(:, 1), x%values(:, 2), x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_surrogate

   subroutine use_learner(verb, learner, x)
      character(len=*), intent(in) :: verb
      type(learner_type), intent(inout) :: learner
      type(exchange_type), intent(inout) :: x
      type(surrogate_type), pointer :: surrogate
      real(wp), pointer :: constants(:, :), euler_deg(:, :)
      real(wp), allocatable :: values(:), covariance(:, :)
      integer, allocatable :: numbers(:)

      if (x%in%has('constants')) then
         constants => x%in%columns('constants', learner%basis%domain%class%n_constants)
         euler_deg => x%in%columns('euler_deg', 3)
      end if
      if (x%in%has('numbers')) numbers = nint(x%in%reals('numbers'))
      select case (verb)
      case ('values')
         ! Of the coefficients, and of the candidates where there are some.
         associate (design => learner%design)
            call x%out%put('alpha', design%regression%alpha)
            call x%out%put('beta', design%regression%beta)
            call x%out%put('fall', design%regression%decay_rate)
            call x%out%put('log_evidence', learner%log_evidence)
            call coefficient_covariance(design%regression, covariance)
            call x%out%put_array('covariance', covariance, shape(covariance))
            values = coefficient_mean(design%regression)
            call x%out%put_array('mean', values, shape(values))
            call x%out%put_array('prior_width', design%regression%prior_width, shape(values))
            if (allocated(design%variance)) call x%out%put_array('variances', design%variance, shape(design%variance))
         end associate
      case ('set_candidates')
         call set_learner_candidates(learner, constants, euler_deg, x%in%text('rule'), x%error)
      case ('add')
         call add_simulations(learner, constants, euler_deg, x%in%reals('modulus_gpa'), x%in%logical('chosen'), x%error)
      case ('fit')
         if (x%in%has('alpha')) then
            call fit_learner(learner, x%error, [x%in%real('alpha'), x%in%real('beta')])
         else
            call fit_learner(learner, x%error)
         end if
      case ('choose')
         allocate (numbers(x%in%integer('count')), values(x%in%integer('count')))
         call learner%rule%choose(learner%design, learner%basis, x%threads(), numbers, values)
         call x%out%put_integers('chosen', numbers - 1, shape(numbers))
         call x%out%put_array('variance', values, shape(values))
      case ('update')
         call update_posterior_mean(learner%design, x%in%logical('exactly'), x%error)
      case ('leave_out')
         ! Modulus (GPa) and z.
         allocate (x%values(size(numbers), 2))
         call leave_out(learner, numbers, x%values(:, 1), x%values(:, 2), x%error)
      case ('surrogate')
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         call surrogate_of(learner, x%in%text('provenance'), surrogate, x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_learner

end module surrogate_operations
