!> Bases, surrogates, and what trains them. Crystals by the constants of the basis' class (GPa), angles in degrees, candidates by
!> numbers from 0.
module surrogate_operations
   use abstract_basis, only: basis_type
   use bases, only: describe_basis
   use build_checks, only: basis_of_problem
   use crystal_elasticity, only: logarithmic_mean
   use errors, only: error_type, exit_bad_input, raise
   use exchange, only: exchange_type
   use labelled_values, only: labelled_values_type
   use kinds, only: degree, wp
   use parallelism, only: thread_count
   use problem, only: problem_type
   use sequential_design, only: update_posterior_mean
   use surrogate_domain, only: spread_crystals
   use surrogate_file, only: check_values, exchange_surrogate, save_surrogate
   use surrogate_learner, only: add_simulations, choose_next, describe_learner, evaluate_evidence, exclude_candidates, &
      & fit_learner, leave_out, learner_type, learner_values, new_learner, predict_moduli, set_learner_candidates, surrogate_of
   use surrogate_lookup, only: load_named_surrogate, places_type
   use surrogate_model, only: predict_crystals, surrogate_type
   implicit none
   private
   public :: perform_surrogate, places_of

contains

   subroutine perform_surrogate(verb, object, x, error)
      character(len=*), intent(in) :: verb
      !> A basis, a surrogate, a learner; not associated: one is to be made.
      class(*), pointer, intent(in) :: object
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      class(basis_type), allocatable :: basis
      class(*), pointer :: made
      type(surrogate_type), pointer :: surrogate
      type(problem_type), pointer :: problem

      if (associated(object)) then
         select type (object)
         class is (basis_type)
            call use_basis(verb, object, x, error)
         type is (surrogate_type)
            call use_surrogate(verb, object, x, error)
         type is (learner_type)
            call use_learner(verb, object, x, error)
         end select
      else if (verb == 'load') then
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         call load_named_surrogate(x%in%text('name'), x%in%text('symmetry'), places_of(x), surrogate, error)
      else
         problem => x%problem(error)
         if (.not. allocated(error)) call basis_of_problem(problem, basis, error)
         if (.not. allocated(error)) call give_basis(basis, x)
      end if
   end subroutine perform_surrogate

   !> Where surrogates are looked for.
   function places_of(x) result(places)
      type(exchange_type), intent(inout) :: x
      type(places_type) :: places

      ! A function of deferred length in a structure constructor makes gfortran 12 allocate one byte for it.
      places%output = x%in%text('output')
      places%folder = x%in%text('folder')
      places%data_folder = x%in%text('data_folder')
      places%shipped = x%in%text('shipped')
   end function places_of

   subroutine give_basis(basis, x)
      class(basis_type), intent(in) :: basis
      type(exchange_type), intent(inout) :: x
      class(basis_type), pointer :: held

      allocate (held, source=basis)
      call x%give(held, 'basis')
   end subroutine give_basis

   subroutine use_basis(verb, basis, x, error)
      character(len=*), intent(in) :: verb
      class(basis_type), intent(inout) :: basis
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type), pointer :: surrogate
      type(learner_type), pointer :: learner
      real(wp), pointer :: constants(:, :), euler_deg(:, :)
      real(wp), allocatable :: crystals(:, :), angles(:, :), scale(:)

      select case (verb)
      case ('describe')
         call describe_basis(basis, x%out)
      case ('crystals')
         ! Some that are spread over the domain by a seed.
         call spread_crystals(basis%domain, int(x%in%integer('count')), int(x%in%integer('seed')), crystals, angles, error)
         if (allocated(error)) return
         call x%out%put_array('constants', crystals, shape(crystals))
         call x%out%put_array('euler_deg', angles, shape(angles))
      case ('terms')
         constants => x%in%columns('constants', basis%domain%class%n_constants)
         euler_deg => x%in%columns('euler_deg', 3)
         call basis%evaluate_crystals(constants, euler_deg, crystals, scale)
         call x%out%put_array('terms', crystals, shape(crystals))
         call x%out%put_array('scale', scale, shape(scale))
      case ('validity')
         call give_validity(basis, x)
      case ('surrogate')
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         allocate (surrogate%basis, source=basis)
         surrogate%coefficients = x%in%reals('coefficients')
         surrogate%covariance = x%in%columns('covariance', max(1, basis%n_terms))
         surrogate%alpha = x%in%real('alpha')
         surrogate%beta = x%in%real('beta')
         surrogate%decay_rate = x%in%real('fall')
         surrogate%provenance = x%in%text('provenance')
         if (size(surrogate%coefficients) == basis%n_terms) then
            call check_values(surrogate, error)
         else
            call raise(error, 'the number of coefficients is not that of the basis', exit_bad_input)
         end if
      case ('learner')
         allocate (learner)
         call x%give(learner, 'learner')
         call new_learner(basis, learner, error)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine use_basis

   !> Of crystals (stiffness, GPa): the normalised distance of each, see `surrogate_domain`, whether a surrogate with the basis is valid
   !> for it, and the scale, the geometric mean of the eigenvalues of the Kelvin stiffness, GPa, NaN for an unstable one.
   subroutine give_validity(basis, x)
      class(basis_type), intent(in) :: basis
      type(exchange_type), intent(inout) :: x
      real(wp), pointer :: c(:, :, :)
      real(wp), allocatable :: found(:, :)
      real(wp) :: poisson, anisotropy
      integer :: i

      c => x%in%matrices('stiffness')
      allocate (found(size(c, 3), 3))
      do i = 1, size(c, 3)
         call logarithmic_mean(c(:, :, i), poisson, anisotropy, found(i, 3))
         found(i, 1) = basis%domain%normalised_distance(c(:, :, i))
         found(i, 2) = merge(1.0_wp, 0.0_wp, basis%domain%admits(c(:, :, i)))
      end do
      call x%out%put_array('values', found, shape(found))
   end subroutine give_validity

   subroutine use_surrogate(verb, surrogate, x, error)
      character(len=*), intent(in) :: verb
      type(surrogate_type), intent(inout) :: surrogate
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: problem
      type(labelled_values_type) :: list
      real(wp), pointer :: c(:, :, :)
      real(wp), allocatable :: found(:, :)

      select case (verb)
      case ('describe')
         allocate (list%named, source=x%out)
         call exchange_surrogate(surrogate, list)
         x%out = list%named
      case ('basis')
         call give_basis(surrogate%basis, x)
      case ('save')
         call save_surrogate(surrogate, x%in%text('path'), error)
      case ('predict')
         c => x%in%matrices('stiffness')
         allocate (found(size(c, 3), 2))
         call predict_crystals(surrogate, c, degree*x%in%columns('euler_deg', 3), x%threads(), found(:, 1), found(:, 2), error)
         call x%out%put_array('values', found, shape(found))
      case ('predict_table')
         problem => x%problem(error)
         if (.not. allocated(error)) call predict_table(surrogate, problem, x, error)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine use_surrogate

   !> Modulus and sd (GPa) of the crystals of a problem, which stay where they are; of each whether the surrogate is valid for it, and its
   !> scale (GPa) if not.
   subroutine predict_table(surrogate, problem, x, error)
      type(surrogate_type), intent(in) :: surrogate
      type(problem_type), intent(in) :: problem
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: poisson, anisotropy
      real(wp), allocatable :: found(:, :)
      integer :: i

      associate (c => problem%crystals%stiffness)
         allocate (found(size(c, 3), 4), source=0.0_wp)
         call predict_crystals(surrogate, c, degree*problem%crystals%euler_deg, x%threads(), found(:, 1), found(:, 2), error)
         if (allocated(error)) return
         !$omp parallel do num_threads(thread_count(0)) schedule(static) private(poisson, anisotropy)
         do i = 1, size(c, 3)
            found(i, 3) = merge(1.0_wp, 0.0_wp, surrogate%basis%domain%admits(c(:, :, i)))
            if (.not. found(i, 3) > 0.0_wp) call logarithmic_mean(c(:, :, i), poisson, anisotropy, found(i, 4))
         end do
         !$omp end parallel do
      end associate
      call x%out%put_array('values', found, shape(found))
   end subroutine predict_table

   subroutine use_learner(verb, learner, x, error)
      character(len=*), intent(in) :: verb
      type(learner_type), intent(inout) :: learner
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type), pointer :: surrogate
      real(wp), pointer :: constants(:, :), euler_deg(:, :)
      real(wp), allocatable :: values(:), others(:), evidence(:)
      integer, allocatable :: numbers(:)

      if (x%in%has('constants')) then
         constants => x%in%columns('constants', learner%basis%domain%class%n_constants)
         euler_deg => x%in%columns('euler_deg', 3)
      end if
      if (x%in%has('numbers')) numbers = nint(x%in%reals('numbers'))
      if (x%in%has('alpha')) then
         values = x%in%reals('alpha')
         others = x%in%reals('beta')
      end if
      select case (verb)
      case ('describe')
         call describe_learner(learner, x%out)
      case ('values')
         call learner_values(learner, x%in%text('name'), values)
         call x%out%put_array('values', values, shape(values))
      case ('set_candidates')
         call set_learner_candidates(learner, constants, euler_deg, x%in%text('rule'), error)
      case ('exclude')
         call exclude_candidates(learner, numbers + 1, error)
      case ('add')
         call add_simulations(learner, constants, euler_deg, x%in%reals('modulus_gpa'), x%in%logical('chosen'), error)
      case ('fit')
         if (values(1) > 0.0_wp) then
            call fit_learner(learner, error, [values(1), others(1)])
         else
            call fit_learner(learner, error)
         end if
      case ('evidence')
         allocate (evidence, mold=values)
         call evaluate_evidence(learner, values, others, evidence, error)
         call x%out%put_array('values', evidence, shape(evidence))
      case ('choose')
         allocate (numbers(x%in%integer('count')), values(x%in%integer('count')))
         call choose_next(learner, x%threads(), numbers, values, error)
         call x%out%put_integers('chosen', numbers - 1, shape(numbers))
         call x%out%put_array('variance', values, shape(values))
      case ('update')
         call update_posterior_mean(learner%design, x%in%logical('exactly'), error)
      case ('predict')
         allocate (values(size(euler_deg, 2)))
         call predict_moduli(learner, constants, euler_deg, values)
         call x%out%put_array('values', values, shape(values))
      case ('leave_out')
         allocate (values(size(numbers)), others(size(numbers)))
         call leave_out(learner, numbers, values, others, error)
         call x%out%put_array('modulus', values, shape(values))
         call x%out%put_array('z', others, shape(others))
      case ('surrogate')
         allocate (surrogate)
         call x%give(surrogate, 'surrogate')
         call surrogate_of(learner, x%in%text('provenance'), surrogate, error)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine use_learner
end module surrogate_operations
