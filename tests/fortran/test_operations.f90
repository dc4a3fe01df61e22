!> Operations that tests alone need: the training of a surrogate step by step, the density of a
!> posterior point by point, and a diagnostic with its numbers. They are those of a core of its
!> own, beside the one that is tested; see tests/support/testing_core.py.
module test_operations
   use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_value
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_loc
   use abstract_basis, only: basis_type, grain_model_type
   use abstract_sampler, only: sampler_type
   use acquisitions, only: new_acquisition
   use analysis, only: analysis_type
   use diagnostics, only: diagnostic, diagnostics_text
   use evidence_regression, only: coefficient_covariance, coefficient_mean, compute_posterior, &
      & leave_groups_out
   use exchange, only: exchange_type, find_object, register_object, release_object
   use field_reading, only: choose_field_degree
   use nuisances, only: nuisance_type
   use observables, only: path_type
   use kinds, only: degree, wp
   use operations, only: perform
   use problem_posterior, only: run_type, sample_aside
   use random, only: new_random_stream, random_stream_type
   use rivals, only: compare_rivals, diagnosis_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   use sequential_design, only: compute_variances, set_candidates, update_posterior_mean
   use shared_errors, only: add_shared
   use surrogate_domain, only: spread_crystals
   use surrogate_learner, only: add_simulations, fit_learner, learner_type, left_out, &
      & new_learner, surrogate_of
   use surrogate_model, only: surrogate_type
   use text, only: join
   implicit none
   private
   public :: test_do, test_release

contains

   !> Do an operation, of these or of the core; see `core_do`.
   subroutine test_do(operation, length, handle, n, request, reply, address, words, status) &
      & bind(c, name='bayesindent_test_do')
      integer(c_int64_t), intent(in), value :: length, handle, n
      character(kind=c_char), intent(in) :: operation(length)
      integer(c_int64_t), intent(in), target :: request(n)
      integer(c_int64_t), intent(out) :: reply, address, words
      integer(c_int), intent(out) :: status
      type(exchange_type), pointer :: x
      class(*), pointer :: object
      character(len=:), allocatable :: name, kind
      logical :: known
      integer :: i

      allocate (character(len=length) :: name)
      do i = 1, int(length)
         name(i:i) = operation(i)
      end do
      kind = name(:index(name, '.') - 1)
      allocate (x)
      call x%open(request)
      if (.not. allocated(x%error)) call find_object(handle, kind, object, x%error)
      known = name == 'test.diagnostic'
      if (known) then
         ! As in a document; the core's own operation takes no numbers.
         if (allocated(x%error)) deallocate (x%error)
         x%text = diagnostics_text(diagnostic(x%in%text('code'), x%in%text('subject'), &
            & [x%in%columns('numbers', 1)]))
      else if (.not. allocated(x%error)) then
         known = .true.
         select type (object)
         class is (basis_type)
            call use_basis(name, object, x, known)
         type is (analysis_type)
            call use_analysis(name, object, x, known)
         type is (learner_type)
            call use_learner(name, object, x)
         class default
            known = .false.
         end select
      end if
      if (.not. known) then
         deallocate (x)
         call perform(name, handle, request, reply, address, words, status)
         return
      end if
      call x%close(status)
      if (x%out%filled == 0) call x%out%put('', 0)
      words = x%out%filled/8
      address = transfer(c_loc(x%out%bytes), address)
      object => x
      call register_object(object, 'reply', reply)
   end subroutine test_do

   !> Give back an object.
   subroutine test_release(handle) bind(c, name='bayesindent_test_release')
      integer(c_int64_t), intent(in), value :: handle

      call release_object(handle)
   end subroutine test_release

   !> Use the posterior of an analysis point by point.
   subroutine use_analysis(name, self, x, known)
      character(len=*), intent(in) :: name
      type(analysis_type), intent(inout) :: self
      type(exchange_type), intent(inout), target :: x
      logical, intent(out) :: known
      real(wp), pointer :: points(:, :)

      known = .true.
      if (x%in%has('points')) points => x%in%columns('points', self%posterior%dimension)
      select case (name)
      case ('analysis.prepare')
         ! Set up the posterior, or the prior alone.
         call self%prepare(x%error)
         if (allocated(x%error)) return
         self%posterior%prior_only = x%in%logical('prior_only')
         call x%out%put('grains', self%posterior%n_grains)
         call x%out%put('groups', self%posterior%n_groups)
         call put_nuisances(self%posterior%nuisances, x)
      case ('analysis.sample')
         call sample()
      case ('analysis.evaluate')
         call evaluate()
      case ('analysis.read_theory')
         ! Read the theory from now on as finely as `infer` does for these points.
         call choose_field_degree(self%posterior, points, x%threads(), x%error)
      case ('analysis.diagnose')
         call diagnose()
      case ('analysis.moduli')
         call draw_moduli()
      case default
         known = .false.
      end select

   contains

      !> Chains by any sampler.
      subroutine sample()
         class(sampler_type), allocatable :: sampler
         type(chains_type) :: chains
         type(run_settings_type) :: run

         call new_sampler(x%in%text('method'), x%in%integer('burn_in'), sampler, x%error)
         if (allocated(x%error)) return
         run = run_settings_type(x%in%integer('samples'), x%in%integer('chains'), x%threads(), &
            & x%in%integer('seed'))
         call sample_chains(self%posterior, sampler, run, chains, x%error)
         if (allocated(x%error)) return
         call x%out%put('draws', chains%draws)
         call x%out%put('log_density', chains%log_density)
         call x%out%put('acceptance', chains%acceptance)
      end subroutine sample

      !> Log density and log likelihood; minus infinity outside the support.
      subroutine evaluate()
         integer :: i

         allocate (x%values(size(points, 2), 2))
         associate (density => self%posterior)
            call density%evaluate(points, x%values(:, 1))
            do i = 1, size(points, 2)
               x%values(i, 2) = x%values(i, 1) &
                  & - density%prior%log_density_of_constants(density%stiffness(points(:, i)))
            end do
         end associate
         where (spread(.not. x%values(:, 1) > -huge(0.0_wp), 2, 2)) x%values = ieee_value(1.0_wp, &
            & ieee_negative_inf)
      end subroutine evaluate

      !> Other models of the measurements, compared at the maximum near a short chain.
      subroutine diagnose()
         integer, parameter :: degree = 16
         type(chains_type) :: chains
         type(diagnosis_type) :: found
         character(len=:), allocatable :: names
         integer :: i

         call self%prepare(x%error)
         if (allocated(x%error)) return
         call sample_aside(self%problem, self%posterior, run_type(1000, 50, 1, 1, .false.), &
            & chains, x%error)
         if (allocated(x%error)) return
         call self%posterior%set_field_degree(degree, x%error)
         if (allocated(x%error)) return
         call compare_rivals(self%problem, self%surrogate, self%posterior, chains%best_draw(), &
            & found, x%error)
         if (allocated(x%error)) return
         names = ''
         do i = 1, size(found%rivals)
            names = names//found%rivals(i)%group//': '//found%rivals(i)%explanation//new_line('a')
         end do
         call x%out%put('rivals', names)
         call x%out%put('log_odds', found%rivals%log_odds)
         call x%out%put('log_z', found%stated%fit%log_z)
         call x%out%put('p', found%p)
         call x%out%put('factor', found%factor)
         call x%out%put('order_odds', found%order_odds)
      end subroutine diagnose

      !> Indentation moduli (GPa) of any grains, with the surrogate's error drawn given the data,
      !> and one plus the calibration error of each group, drawn likewise.
      subroutine draw_moduli()
         type(random_stream_type) :: stream
         class(grain_model_type), allocatable :: grains
         type(path_type), allocatable :: paths(:)
         real(wp), allocatable :: factor(:, :)
         integer :: i

         allocate (paths(size(x%in%columns('euler_deg', 3), 2)))
         associate (density => self%posterior)
            call density%new_grains(degree*x%in%columns('euler_deg', 3), paths, grains, x%error)
            if (allocated(x%error)) return
            allocate (x%values(size(paths), size(points, 2)), &
               & factor(density%n_groups, size(points, 2)))
            stream = new_random_stream(x%in%integer('seed'), 0)
            do i = 1, size(points, 2)
               call grains%evaluate_crystals(reshape(density%stiffness(points(:, i)), [6, 6, 1]), &
                  & x%values(:, i:i))
               call add_shared(density, points(:, i), grains, stream, x%values(:, i), factor(:, i))
            end do
         end associate
         call x%out%put('factor', factor)
      end subroutine draw_moduli
   end subroutine use_analysis

   !> Give the names and the priors of what is inferred beside the constants.
   subroutine put_nuisances(nuisances, x)
      type(nuisance_type), intent(in) :: nuisances(:)
      type(exchange_type), intent(inout) :: x
      integer :: i

      call x%out%put('nuisances', join(nuisances%name, ' '))
      call x%out%put('are_normal', join(merge('normal ', 'uniform', nuisances%is_normal), ' '))
      allocate (x%values(2, size(nuisances)))
      do i = 1, size(nuisances)
         x%values(:, i) = nuisances(i)%prior
      end do
   end subroutine put_nuisances

   subroutine use_basis(name, basis, x, known)
      character(len=*), intent(in) :: name
      class(basis_type), intent(in) :: basis
      type(exchange_type), intent(inout) :: x
      logical, intent(out) :: known
      type(learner_type), pointer :: learner
      real(wp), allocatable :: found(:, :), others(:, :), scale(:), spread(:)
      integer :: i

      known = .true.
      select case (name)
      case ('basis.crystals')
         ! Some that are spread over the domain by a seed.
         call spread_crystals(basis%domain, x%in%integer('count'), x%in%integer('seed'), found, &
            & others, x%error)
         if (allocated(x%error)) return
         call x%out%put_array('constants', found, shape(found))
         call x%out%put_array('euler_deg', others, shape(others))
      case ('basis.terms')
         call basis%evaluate_crystals(x%in%columns('constants', basis%domain%class%n_constants), &
            & x%in%columns('euler_deg', 3), x%values, scale, spread)
         call x%out%put_array('scale', scale, shape(scale))
         do i = 1, size(spread)
            x%values(:, i) = spread(i)*x%values(:, i)
         end do
      case ('basis.learner')
         allocate (learner)
         call x%give(learner, 'learner')
         call new_learner(basis, learner, x%error)
      case default
         known = .false.
      end select
   end subroutine use_basis

   subroutine use_learner(name, learner, x)
      character(len=*), intent(in) :: name
      type(learner_type), intent(inout) :: learner
      type(exchange_type), intent(inout) :: x
      type(surrogate_type), pointer :: surrogate
      real(wp), pointer :: constants(:, :), euler_deg(:, :)
      real(wp), allocatable :: values(:), covariance(:, :)
      real(wp) :: mean_error
      integer, allocatable :: numbers(:)
      integer :: i

      if (x%in%has('constants')) then
         constants => x%in%columns('constants', learner%basis%domain%class%n_constants)
         euler_deg => x%in%columns('euler_deg', 3)
      end if
      if (x%in%has('numbers')) numbers = nint(x%in%reals('numbers'))
      select case (name)
      case ('learner.values')
         ! Of the coefficients, and of the candidates where there are some.
         associate (design => learner%design)
            call x%out%put('alpha', design%regression%alpha)
            call x%out%put('beta', design%regression%beta)
            call x%out%put('fall', design%regression%decay_rate)
            call x%out%put('slope_noise', design%regression%slope_noise)
            call x%out%put('log_evidence', learner%log_evidence)
            call coefficient_covariance(design%regression, covariance)
            call x%out%put_array('covariance', covariance, shape(covariance))
            values = coefficient_mean(design%regression)
            call x%out%put_array('mean', values, shape(values))
            call x%out%put_array('prior_width', design%regression%prior_width, shape(values))
            if (allocated(design%variance)) then
               call x%out%put_array('variances', design%variance, shape(design%variance))
            end if
         end associate
      case ('learner.set_candidates')
         learner%rule = new_acquisition(x%in%text('rule'))
         if (.not. allocated(x%error)) then
            call set_candidates(learner%design, learner%basis, constants, euler_deg, &
               & x%in%logical('with_slopes'))
         end if
      case ('learner.add')
         call add_simulations(learner, x%simulations(learner%basis%domain%class%n_constants), &
            & x%in%logical('chosen'), x%error)
      case ('learner.fit')
         if (x%in%has('alpha')) then
            learner%design%regression%alpha = x%in%real('alpha')
            learner%design%regression%beta = x%in%real('beta')
            call compute_posterior(learner%design%regression, x%error)
            call compute_variances(learner%design)
         else
            call fit_learner(learner, x%error)
         end if
      case ('learner.choose')
         allocate (numbers(x%in%integer('count')), values(x%in%integer('count')))
         call learner%rule%choose(learner%design, learner%basis, x%threads(), numbers, values)
         call x%out%put_integers('chosen', numbers - 1, shape(numbers))
         call x%out%put_array('variance', values, shape(values))
      case ('learner.update')
         call update_posterior_mean(learner%design, x%in%logical('exactly'), x%error)
      case ('learner.leave_out')
         ! y, and its error over its sd; and the mean absolute error of the modulus, GPa.
         allocate (x%values(size(numbers), 2), values(size(numbers)))
         associate (regression => learner%design%regression)
            allocate (covariance(regression%n_data, 2))
            call leave_groups_out(regression, [(numbers(count(.not. regression%is_slope(:i))), &
               & i=1, regression%n_data)], covariance(:, 1), covariance(:, 2), x%error)
            x%values(:, 1) = pack(regression%targets - covariance(:, 1), .not. regression%is_slope)
            x%values(:, 2) = pack(covariance(:, 1)/covariance(:, 2), .not. regression%is_slope)
         end associate
         if (.not. allocated(x%error)) call left_out(learner, numbers, mean_error, x%error)
         call x%out%put('error_gpa', mean_error)
      case ('learner.surrogate')
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         call surrogate_of(learner, x%in%text('provenance'), surrogate, x%error)
      case default
         call x%refuse(name)
      end select
   end subroutine use_learner
end module test_operations
