! The domain of a surrogate and the prior of its coefficients for f2py. status: 0 done, 1 failure, 2 bad input; message: the
! reason, blank on success.

!> Ranges of the m raw coordinates over a domain: bounds of the k constants (GPa) and a cap on the anisotropy index.
subroutine domain_ranges(symmetry, k, c_min, c_max, anisotropy_cap, coordinates, m, lower, upper, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use errors, only: error_type
   use kinds, only: wp
   use surrogate_fit, only: coordinate_ranges, domain_type
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: symmetry, k, coordinates, m
   real(c_double), intent(in) :: c_min(k), c_max(k), anisotropy_cap
   real(c_double), intent(out) :: lower(m), upper(m)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(error_type), allocatable :: error
   real(wp), allocatable :: low(:), high(:)

   status = 0
   message = ''
   lower = 0
   upper = 0
   call coordinate_ranges(domain_type(symmetry, c_min, c_max, anisotropy_cap), coordinates, low, high, error)
   if (allocated(error)) then
      status = error%status
      message = error%message
   else
      lower = low
      upper = high
   end if
end subroutine domain_ranges

!> Weights and mean of the prior of the n coefficients, 1 centred on zero or 2 on the half-space theory over a domain; and the
!> least sd of the noise, in units of y.
subroutine coefficient_prior(symmetry, coordinates, truncation, degree, bandlimit, m, lower, upper, k, c_min, c_max, &
   & anisotropy_cap, prior, n, weights, mean, least_noise, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use errors, only: error_type
   use kinds, only: wp
   use surrogate_basis, only: basis_type, new_basis
   use surrogate_fit, only: domain_type, least_noise_of, prior_theory, prior_weights, theory_coefficients
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: symmetry, coordinates, truncation, degree, bandlimit, m, k, prior, n
   real(c_double), intent(in) :: lower(m), upper(m), c_min(k), c_max(k), anisotropy_cap
   real(c_double), intent(out) :: weights(n), mean(n), least_noise
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(basis_type) :: basis
   type(error_type), allocatable :: error
   real(wp), allocatable :: coefficients(:)

   status = 0
   message = ''
   weights = 1
   mean = 0
   least_noise = least_noise_of(coordinates)
   call new_basis(symmetry, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
   if (.not. allocated(error) .and. prior == prior_theory) then
      call theory_coefficients(basis, domain_type(symmetry, c_min, c_max, anisotropy_cap), coefficients, error)
   end if
   if (allocated(error)) then
      status = error%status
      message = error%message
      return
   end if
   weights = prior_weights(basis, prior)
   if (allocated(coefficients)) mean = coefficients
end subroutine coefficient_prior

!> The factor on every sd with which it covers what truncation alone leaves out (see `truncation_factor`): `mean` are the
!> coefficients of the theory, `covariance` and `beta` the posterior's.
subroutine coefficient_misfit(symmetry, coordinates, truncation, degree, bandlimit, m, lower, upper, k, c_min, c_max, &
   & anisotropy_cap, n, mean, covariance, beta, factor, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use errors, only: error_type
   use surrogate_basis, only: basis_type, new_basis
   use surrogate_fit, only: domain_type, truncation_factor
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: symmetry, coordinates, truncation, degree, bandlimit, m, k, n
   real(c_double), intent(in) :: lower(m), upper(m), c_min(k), c_max(k), anisotropy_cap, mean(n), covariance(n, n), beta
   real(c_double), intent(out) :: factor
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(basis_type) :: basis
   type(error_type), allocatable :: error

   status = 0
   message = ''
   factor = 0
   call new_basis(symmetry, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
   if (.not. allocated(error)) then
      call truncation_factor(basis, domain_type(symmetry, c_min, c_max, anisotropy_cap), mean, covariance, beta, factor, error)
   end if
   if (allocated(error)) then
      status = error%status
      message = error%message
   end if
end subroutine coefficient_misfit
