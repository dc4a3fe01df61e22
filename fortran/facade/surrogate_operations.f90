!> Operations on bases and surrogates. Crystals are stated by the
!> constants of the basis' class (GPa), angles in degrees.
module surrogate_operations
   use abstract_basis, only: basis_type
   use analysis, only: analysis_type
   use bases, only: describe_basis
   use crystal_elasticity, only: logarithmic_mean
   use exchange, only: exchange_type
   use kinds, only: degree, wp
   use labelled_values, only: labelled_values_type
   use surrogate_learner, only: add_simulations, fit_learner, learner_type, left_out, new_learner, &
      & surrogate_of
   use surrogate_model, only: exchange_surrogate, predict_crystals, save_surrogate, surrogate_type
   implicit none
   private
   public :: give_basis, use_basis, use_surrogate

contains

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
      type(learner_type) :: learner
      type(surrogate_type), pointer :: surrogate
      real(wp), pointer :: c(:, :, :)
      integer, allocatable :: groups(:)
      real(wp) :: poisson, anisotropy, error_gpa
      integer :: i

      select case (verb)
      case ('describe')
         !> -> ..
         call describe_basis(basis, x%out)
      case ('validity')
         !> stiffness, euler_deg, problem, threads -> values
         ! For each crystal (GPa): its normalised distance, see `surrogate_domain`; whether a
         ! surrogate with the basis is valid for it; and its scale, the geometric mean of the
         ! eigenvalues of the Kelvin stiffness, GPa, NaN for an unstable crystal.
         c => x%crystals()
         allocate (x%values(size(c, 3), 3))
         !$omp parallel do num_threads(x%threads()) schedule(static) private(poisson, anisotropy)
         do i = 1, size(c, 3)
            call logarithmic_mean(c(:, :, i), poisson, anisotropy, x%values(i, 3))
            x%values(i, 1) = basis%domain%normalised_distance(c(:, :, i))
            x%values(i, 2) = merge(1.0_wp, 0.0_wp, basis%domain%admits(c(:, :, i)))
         end do
         !$omp end parallel do
      case ('fit', 'leave_out')
         !> constants, euler_deg, modulus_gpa, by_stiffness, groups -> handle, values
         ! Fit the moduli (GPa) of crystals; or predict each of them from those of other groups,
         ! with the error over its sd.
         call new_learner(basis, learner, x%error)
         if (.not. allocated(x%error)) then
            call add_simulations(learner, x%simulations(basis%domain%class%n_constants), .true., &
               & x%error)
         end if
         if (.not. allocated(x%error)) call fit_learner(learner, x%error)
         if (allocated(x%error)) return
         if (verb == 'fit') then
            allocate (surrogate)
            call x%give(surrogate, 'surrogate')
            call surrogate_of(learner, '{}', surrogate, x%error)
         else
            groups = nint(x%in%reals('groups'))
            allocate (x%values(size(groups), 2))
            call left_out(learner, groups, error_gpa, x%error, x%values(:, 1), x%values(:, 2))
         end if
      case default
         call x%refuse(verb)
      end select
   end subroutine use_basis

   subroutine use_surrogate(verb, surrogate, x)
      character(len=*), intent(in) :: verb
      type(surrogate_type), intent(inout) :: surrogate
      type(exchange_type), intent(inout), target :: x
      type(labelled_values_type) :: labels
      type(analysis_type), pointer :: analysis
      real(wp), pointer :: c(:, :, :), euler_deg(:, :)

      select case (verb)
      case ('describe')
         !> -> ..
         labels%described => x%out
         call exchange_surrogate(surrogate, labels)
      case ('basis')
         !> -> handle
         call give_basis(surrogate%basis, x)
      case ('analysis')
         !> problem -> handle
         ! An analysis of the problem with this surrogate.
         allocate (analysis)
         call x%give(analysis, 'analysis')
         analysis%problem => x%problem
         analysis%surrogate = surrogate
      case ('save')
         !> path ->
         call save_surrogate(surrogate, x%in%text('path'), x%error)
      case ('predict')
         !> stiffness, euler_deg, problem, threads -> values
         ! Moduli and their sds, GPa.
         c => x%crystals(euler_deg)
         allocate (x%values(size(c, 3), 2))
         call predict_crystals(surrogate, c, degree*euler_deg, x%threads(), x%values(:, 1), &
            & x%values(:, 2), x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_surrogate

end module surrogate_operations
