! Learning a surrogate for f2py: crystals by the constants of the basis' class (GPa), angles in degrees, candidates by numbers from 0.
! status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> Keep a learner over a basis (a handle), without simulations and candidates.
subroutine learner_new(basis, handle, status, message)
   use abstract_basis, only: basis_type
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   use surrogate_handles, only: find_basis
   use surrogate_learner, only: learner_type, new_learner
   implicit none
   integer(c_int64_t), intent(in) :: basis
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   class(basis_type), pointer :: found
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   allocate (learner)
   call find_basis(basis, found, error)
   if (.not. allocated(error)) call new_learner(found, learner, error)
   call error_to_status(error, status, message)
   call keep_object(learner, 'learner', error, handle)
end subroutine learner_new

!> Give the n candidates, all of them available, and the rule of the choice.
subroutine learner_candidates(handle, rule, k, n, constants, euler_deg, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use settings_groups, only: design_settings_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: learner_type, set_learner_candidates
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: rule
   integer(c_int), intent(in) :: k, n
   real(c_double), intent(in) :: constants(k, n), euler_deg(3, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(design_settings_type) :: settings
   type(error_type), allocatable :: error

   settings%variance_of = rule
   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call set_learner_candidates(learner, constants, euler_deg, settings, error)
   call error_to_status(error, status, message)
end subroutine learner_candidates

!> The numbers of n candidates that may not be chosen any more.
subroutine learner_exclude(handle, n, numbers, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: exclude_candidates, learner_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   integer(c_int), intent(in) :: numbers(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call exclude_candidates(learner, numbers + 1, error)
   call error_to_status(error, status, message)
end subroutine learner_exclude

!> Learn the modulus (GPa) of n crystals; `chosen` /= 0 if the design has chosen them, see `add_simulations`.
subroutine learner_add(handle, k, n, constants, euler_deg, modulus, chosen, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: add_simulations, learner_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: k, n, chosen
   real(c_double), intent(in) :: constants(k, n), euler_deg(3, n), modulus(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call add_simulations(learner, constants, euler_deg, modulus, chosen /= 0, error)
   call error_to_status(error, status, message)
end subroutine learner_add

!> Posterior from all simulations at alpha and beta, or at those of largest evidence if alpha is 0.
subroutine learner_fit(handle, alpha, beta, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: fit_learner, learner_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   real(c_double), intent(in) :: alpha, beta
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   call find_learner(handle, learner, error)
   if (.not. allocated(error)) then
      if (alpha > 0) then
         call fit_learner(learner, error, [alpha, beta])
      else
         call fit_learner(learner, error)
      end if
   end if
   call error_to_status(error, status, message)
end subroutine learner_fit

!> ln evidence of the simulations at n pairs of alpha and beta.
subroutine learner_evidence(handle, n, alpha, beta, evidence, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: evaluate_evidence, learner_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: alpha(n), beta(n)
   real(c_double), intent(out) :: evidence(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   evidence = 0
   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call evaluate_evidence(learner, alpha, beta, evidence, error)
   call error_to_status(error, status, message)
end subroutine learner_evidence

!> The next `count` candidates, as `chosen`, and the variance of y at each.
subroutine learner_choose(handle, count, threads, chosen, variance, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use parallelism, only: thread_count
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: choose_next, learner_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: count, threads
   integer(c_int), intent(out) :: chosen(count)
   real(c_double), intent(out) :: variance(count)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   chosen = 0
   variance = 0
   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call choose_next(learner, thread_count(threads), chosen, variance, error)
   chosen = chosen - 1
   call error_to_status(error, status, message)
end subroutine learner_choose

!> Posterior mean once the moduli of all choices were added; `exactly` /= 0: everything afresh.
subroutine learner_update(handle, exactly, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use sequential_design, only: update_posterior_mean
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: learner_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: exactly
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call update_posterior_mean(learner%design, exactly /= 0, error)
   call error_to_status(error, status, message)
end subroutine learner_update

!> The modulus (GPa) of n crystals by the posterior mean.
subroutine learner_predict(handle, k, n, constants, euler_deg, modulus, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: learner_type, predict_moduli
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: k, n
   real(c_double), intent(in) :: constants(k, n), euler_deg(3, n)
   real(c_double), intent(out) :: modulus(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   modulus = 0
   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call predict_moduli(learner, constants, euler_deg, modulus)
   call error_to_status(error, status, message)
end subroutine learner_predict

!> Modulus (GPa) of each of the n simulations predicted with its group left out (`groups`, any numbers), and z, the error of y over its sd.
subroutine learner_leave_out(handle, n, groups, modulus, z, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: learner_type, leave_out
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   integer(c_int), intent(in) :: groups(n)
   real(c_double), intent(out) :: modulus(n), z(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(error_type), allocatable :: error

   modulus = 0
   z = 0
   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call leave_out(learner, groups, modulus, z, error)
   call error_to_status(error, status, message)
end subroutine learner_leave_out

!> Keep the surrogate of what was learnt; `provenance` is a JSON object.
subroutine learner_surrogate(handle, provenance, surrogate, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   use surrogate_handles, only: find_learner
   use surrogate_learner, only: learner_type, surrogate_of
   use surrogate_model, only: surrogate_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: provenance
   integer(c_int64_t), intent(out) :: surrogate
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(learner_type), pointer :: learner
   type(surrogate_type), pointer :: made
   type(error_type), allocatable :: error

   allocate (made)
   call find_learner(handle, learner, error)
   if (.not. allocated(error)) call surrogate_of(learner, provenance, made, error)
   call error_to_status(error, status, message)
   call keep_object(made, 'surrogate', error, surrogate)
end subroutine learner_surrogate
