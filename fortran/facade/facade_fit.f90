! The domain of a surrogate and the prior of its coefficients for f2py. status: 0 done, 1 failure, 2 bad input; message: the
! reason, blank on success.

!> Ranges of the m raw coordinates over a domain: bounds of the k constants (GPa) and a cap on the anisotropy index.
subroutine domain_ranges(symmetry, k, c_min, c_max, anisotropy_cap, coordinates, m, lower, upper, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use kinds, only: wp
   use surrogate_fit, only: coordinate_ranges, domain_type
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: k, coordinates, m
   real(c_double), intent(in) :: c_min(k), c_max(k), anisotropy_cap
   real(c_double), intent(out) :: lower(m), upper(m)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(error_type), allocatable :: error
   real(wp), allocatable :: low(:), high(:)
   type(crystal_class_type) :: class

   lower = 0
   upper = 0
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call coordinate_ranges(domain_type(class, c_min, c_max, anisotropy_cap), coordinates, low, high, &
      & error)
   call error_to_status(error, status, message)
   if (status == 0) then
      lower = low
      upper = high
   end if
end subroutine domain_ranges

!> Weights and mean of the prior of the n coefficients, 1 centred on zero or 2 on the half-space theory over a domain; and the
!> least sd of the noise, in units of y.
subroutine coefficient_prior(symmetry, coordinates, truncation, degree, bandlimit, m, lower, upper, k, c_min, c_max, &
   & anisotropy_cap, prior, n, weights, mean, least_noise, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use kinds, only: wp
   use surrogate_basis, only: basis_type, new_basis
   use surrogate_fit, only: domain_type, least_noise_of, prior_theory, prior_weights, theory_coefficients
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, truncation, degree, bandlimit, m, k, prior, n
   real(c_double), intent(in) :: lower(m), upper(m), c_min(k), c_max(k), anisotropy_cap
   real(c_double), intent(out) :: weights(n), mean(n), least_noise
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(basis_type) :: basis
   type(error_type), allocatable :: error
   real(wp), allocatable :: coefficients(:)
   type(crystal_class_type) :: class

   call new_crystal_class(symmetry, class, error)
   weights = 1
   mean = 0
   least_noise = least_noise_of(coordinates)
   if (.not. allocated(error)) call new_basis(class, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
   if (.not. allocated(error) .and. prior == prior_theory) then
      call theory_coefficients(basis, domain_type(class, c_min, c_max, anisotropy_cap), coefficients, error)
   end if
   call error_to_status(error, status, message)
   if (status /= 0) return
   weights = prior_weights(basis, prior)
   if (allocated(coefficients)) mean = coefficients
end subroutine coefficient_prior

!> The factor on every sd of a surrogate (see `inflation_of`): `mean` are the prior's coefficients, `covariance` and `beta` the
!> posterior's, `z` the errors of the l simulations over their sds with their crystals left out.
subroutine surrogate_inflation(symmetry, coordinates, truncation, degree, bandlimit, m, lower, upper, k, c_min, c_max, &
   & anisotropy_cap, prior, n, mean, covariance, beta, l, z, factor, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use surrogate_basis, only: basis_type, new_basis
   use surrogate_fit, only: domain_type, inflation_of
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, truncation, degree, bandlimit, m, k, prior, n, l
   real(c_double), intent(in) :: lower(m), upper(m), c_min(k), c_max(k), anisotropy_cap, mean(n), covariance(n, n), beta, z(l)
   real(c_double), intent(out) :: factor
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(basis_type) :: basis
   type(error_type), allocatable :: error
   type(crystal_class_type) :: class

   call new_crystal_class(symmetry, class, error)
   factor = 0
   if (.not. allocated(error)) call new_basis(class, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
   if (.not. allocated(error)) then
      call inflation_of(basis, domain_type(class, c_min, c_max, anisotropy_cap), prior, mean, covariance, beta, z, factor, error)
   end if
   call error_to_status(error, status, message)
end subroutine surrogate_inflation
