! Evidence regression and sequential design for f2py, over arrays of terms. A design is kept under a 64-bit handle that a
! Python object owns and frees. status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> A design without data; `weights` and `prior_mean` of the n terms, least sd of the noise in units of y.
subroutine design_new(n, weights, prior_mean, least_noise, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use sequential_design, only: design_to_handle, design_type, new_design
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: weights(n), prior_mean(n), least_noise
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(error_type), allocatable :: error

   handle = 0
   allocate (design)
   call new_design(weights, prior_mean, least_noise, design, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (design)
   else
      handle = design_to_handle(design)
   end if
end subroutine design_new

!> Give back the memory of a design.
subroutine design_free(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use sequential_design, only: design_from_handle, design_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   type(design_type), pointer :: design

   if (handle == 0) return
   design => design_from_handle(handle)
   deallocate (design)
end subroutine design_free

!> Terms (n, m) of the candidates.
subroutine design_candidates(handle, n, m, terms)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use sequential_design, only: design_from_handle, design_type, set_candidates
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n, m
   real(c_double), intent(in) :: terms(n, m)
   type(design_type), pointer :: design

   design => design_from_handle(handle)
   call set_candidates(design, terms)
end subroutine design_candidates

!> Candidates (numbers from 0) that may not be chosen any more.
subroutine design_exclude(handle, m, numbers)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use sequential_design, only: design_from_handle, design_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: m
   integer(c_int), intent(in) :: numbers(m)
   type(design_type), pointer :: design
   integer :: i

   design => design_from_handle(handle)
   do i = 1, m
      design%available(numbers(i) + 1) = .false.
   end do
end subroutine design_exclude

!> Append m observations: their terms and y.
subroutine design_add(handle, n, m, terms, y)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use evidence_regression, only: add_data
   use sequential_design, only: design_from_handle, design_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n, m
   real(c_double), intent(in) :: terms(n, m), y(m)
   type(design_type), pointer :: design

   design => design_from_handle(handle)
   call add_data(design%regression, terms, y)
end subroutine design_add

!> Posterior from all data. alpha = 0 on entry: alpha and beta maximise the evidence; else they are set to what is given.
subroutine design_fit(handle, alpha_in, beta_in, alpha, beta, evidence, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use evidence_regression, only: compute_spectrum, log_evidence, maximise_evidence, set_precisions, spectrum_type
   use sequential_design, only: compute_variances, design_from_handle, design_type, take_in_choices
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   real(c_double), intent(in) :: alpha_in, beta_in
   real(c_double), intent(out) :: alpha, beta, evidence
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(spectrum_type) :: spectrum
   type(error_type), allocatable :: error

   evidence = 0
   design => design_from_handle(handle)
   call take_in_choices(design)
   if (alpha_in > 0) then
      call set_precisions(design%regression, alpha_in, beta_in, error)
   else
      call maximise_evidence(design%regression, error)
   end if
   if (.not. allocated(error)) then
      call compute_variances(design)
      call compute_spectrum(design%regression, spectrum, error)
   end if
   alpha = design%regression%alpha
   beta = design%regression%beta
   call error_to_status(error, status, message)
   if (status == 0) then
      evidence = log_evidence(spectrum, alpha, beta)
   end if
end subroutine design_fit

!> ln evidence of the data at m pairs of alpha and beta.
subroutine design_evidence(handle, m, alpha, beta, evidence, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use evidence_regression, only: compute_spectrum, log_evidence, spectrum_type
   use sequential_design, only: design_from_handle, design_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: m
   real(c_double), intent(in) :: alpha(m), beta(m)
   real(c_double), intent(out) :: evidence(m)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(spectrum_type) :: spectrum
   type(error_type), allocatable :: error
   integer :: i

   design => design_from_handle(handle)
   call compute_spectrum(design%regression, spectrum, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, m
      evidence(i) = log_evidence(spectrum, alpha(i), beta(i))
   end do
end subroutine design_evidence

!> One observation more at frozen alpha, beta.
subroutine design_update(handle, n, term, y, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use evidence_regression, only: update_posterior
   use sequential_design, only: design_from_handle, design_type, take_in_choices
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: term(n), y
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(error_type), allocatable :: error

   design => design_from_handle(handle)
   call take_in_choices(design)
   call update_posterior(design%regression, term, y, error)
   call error_to_status(error, status, message)
end subroutine design_update

!> The next `count` candidates (numbers from 0) and the variance of y at each; see `choose_candidates`.
subroutine design_choose(handle, m, importance, count, threads, chosen, variance, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use sequential_design, only: choose_candidates, design_from_handle, design_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: m, count, threads
   real(c_double), intent(in) :: importance(m)
   integer(c_int), intent(out) :: chosen(count)
   real(c_double), intent(out) :: variance(count)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(error_type), allocatable :: error

   chosen = 0
   variance = 0
   design => design_from_handle(handle)
   call choose_candidates(design, importance, chosen, variance, threads, error)
   chosen = chosen - 1
   call error_to_status(error, status, message)
end subroutine design_choose

!> Posterior mean after the chosen candidates' values were added; `exactly` /= 0: everything afresh.
subroutine design_settle(handle, exactly, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use sequential_design, only: design_from_handle, design_type, settle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: exactly
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(error_type), allocatable :: error

   design => design_from_handle(handle)
   call settle(design, exactly /= 0, error)
   call error_to_status(error, status, message)
end subroutine design_settle

!> Posterior mean of the n coefficients.
subroutine design_mean(handle, n, mean)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use evidence_regression, only: coefficient_mean
   use sequential_design, only: design_from_handle, design_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(out) :: mean(n)
   type(design_type), pointer :: design

   design => design_from_handle(handle)
   mean = coefficient_mean(design%regression)
end subroutine design_mean

!> Posterior covariance of the n coefficients.
subroutine design_covariance(handle, n, covariance)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use evidence_regression, only: coefficient_covariance
   use sequential_design, only: design_from_handle, design_type, take_in_choices
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(out) :: covariance(n, n)
   type(design_type), pointer :: design

   design => design_from_handle(handle)
   call take_in_choices(design)
   call coefficient_covariance(design%regression, covariance)
end subroutine design_covariance

!> Variance of y at each of the m candidates, noise not included.
subroutine design_variances(handle, m, variance)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use sequential_design, only: design_from_handle, design_type, take_in_choices
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: m
   real(c_double), intent(out) :: variance(m)
   type(design_type), pointer :: design

   design => design_from_handle(handle)
   call take_in_choices(design)
   variance = design%variance
end subroutine design_variances

!> Residual and sd of y of each of the m observations with its group left out.
subroutine design_leave_out(handle, m, groups, residual, sd, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use evidence_regression, only: leave_groups_out
   use sequential_design, only: design_from_handle, design_type, take_in_choices
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: m
   integer(c_int), intent(in) :: groups(m)
   real(c_double), intent(out) :: residual(m), sd(m)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(design_type), pointer :: design
   type(error_type), allocatable :: error

   design => design_from_handle(handle)
   call take_in_choices(design)
   call leave_groups_out(design%regression, groups, residual, sd, error)
   call error_to_status(error, status, message)
end subroutine design_leave_out
