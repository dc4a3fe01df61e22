! Basis and surrogates for f2py. A surrogate is kept under a 64-bit handle that a Python object owns and frees.
! status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> Numbers of harmonics, polynomials and coordinates of a basis.
subroutine basis_counts(symmetry, coordinates, truncation, degree, bandlimit, n_harmonics, n_polynomials, n_coordinates, status, &
   & message)
   use, intrinsic :: iso_c_binding, only: c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_to_status, error_type
   use surrogate_basis, only: coordinate_count, polynomial_count
   use symmetric_harmonics, only: harmonics_type, new_harmonics
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, truncation, degree, bandlimit
   integer(c_int), intent(out) :: n_harmonics, n_polynomials, n_coordinates
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(crystal_class_type) :: class
   type(harmonics_type) :: harmonics
   type(error_type), allocatable :: error

   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call new_harmonics(class, bandlimit, harmonics, error)
   call error_to_status(error, status, message)
   n_coordinates = coordinate_count(class, coordinates)
   n_harmonics = harmonics%n
   n_polynomials = polynomial_count(n_coordinates, truncation, degree)
end subroutine basis_counts

!> Raw coordinates of n crystals, and their stiffness scale (GPa).
subroutine basis_coordinates(symmetry, coordinates, k, n, m, constants, raw, scale)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use surrogate_basis, only: raw_coordinates
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, k, n, m
   real(c_double), intent(in) :: constants(k, n)
   real(c_double), intent(out) :: raw(m, n), scale(n)
   integer :: i
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error

   call new_crystal_class(symmetry, class, error)
   do i = 1, n
      call raw_coordinates(class, coordinates, constants(:, i), raw(:, i), scale(i))
   end do
end subroutine basis_coordinates

!> Degrees of the terms: of the harmonic, and of the polynomial in all coordinates together.
subroutine basis_degrees(symmetry, coordinates, truncation, degree, bandlimit, n_terms, harmonic, polynomial, status, message)
   use, intrinsic :: iso_c_binding, only: c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use kinds, only: wp
   use surrogate_basis, only: basis_type, coordinate_count, new_basis
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, truncation, degree, bandlimit, n_terms
   integer(c_int), intent(out) :: harmonic(n_terms), polynomial(n_terms)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(basis_type) :: basis
   type(error_type), allocatable :: error
   integer :: h, q, k, n
   type(crystal_class_type) :: class

   call new_crystal_class(symmetry, class, error)
   n = coordinate_count(class, coordinates)
   if (.not. allocated(error)) call new_basis(class, coordinates, truncation, degree, bandlimit, spread(-1.0_wp, 1, n), &
      & spread(1.0_wp, 1, n), basis, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do q = 1, basis%n_polynomials
      do h = 1, basis%n_harmonics
         k = h + (q - 1)*basis%n_harmonics
         harmonic(k) = basis%harmonics%degrees(h)
         polynomial(k) = sum(basis%degrees(:, q))
      end do
   end do
end subroutine basis_degrees

!> All terms of n crystals (GPa) at n orientations (radians), and their stiffness scales (GPa).
subroutine basis_terms(symmetry, coordinates, truncation, degree, bandlimit, m, lower, upper, k, n, n_terms, constants, euler, &
   & terms, scale, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use surrogate_basis, only: basis_type, evaluate_terms, new_basis
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, truncation, degree, bandlimit, m, k, n, n_terms
   real(c_double), intent(in) :: lower(m), upper(m), constants(k, n), euler(3, n)
   real(c_double), intent(out) :: terms(n_terms, n), scale(n)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(basis_type) :: basis
   type(error_type), allocatable :: error
   integer :: i
   type(crystal_class_type) :: class

   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call new_basis(class, coordinates, truncation, degree, bandlimit, lower, upper, basis, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      call evaluate_terms(basis, constants(:, i), euler(:, i), terms(:, i), scale(i))
   end do
end subroutine basis_terms

!> Harmonics of n unit vectors in crystal axes.
subroutine basis_harmonics(symmetry, bandlimit, n, n_harmonics, directions, values, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_to_status, error_type
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, new_harmonics
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: bandlimit, n, n_harmonics
   real(c_double), intent(in) :: directions(3, n)
   real(c_double), intent(out) :: values(n_harmonics, n)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(crystal_class_type) :: class
   type(harmonics_type) :: harmonics
   type(error_type), allocatable :: error
   integer :: i

   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call new_harmonics(class, bandlimit, harmonics, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      call evaluate_harmonics(harmonics, directions(:, i), values(:, i))
   end do
end subroutine basis_harmonics

!> Keep a surrogate of given posterior; free it with `surrogate_free`.
subroutine surrogate_new(symmetry, coordinates, truncation, degree, bandlimit, m, lower, upper, n_terms, coefficients, &
   & covariance, anisotropy_cap, alpha, beta, sd_inflation, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use surrogate_basis, only: new_basis
   use surrogate_model, only: surrogate_to_handle, surrogate_type
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: coordinates, truncation, degree, bandlimit, m, n_terms
   real(c_double), intent(in) :: lower(m), upper(m), coefficients(n_terms), covariance(n_terms, n_terms)
   real(c_double), intent(in) :: anisotropy_cap, alpha, beta, sd_inflation
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(surrogate_type), pointer :: surrogate
   type(error_type), allocatable :: error
   type(crystal_class_type) :: class

   status = 0
   message = ''
   handle = 0
   allocate (surrogate)
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call new_basis(class, coordinates, truncation, degree, bandlimit, lower, upper, &
      & surrogate%basis, error)
   if (.not. allocated(error)) then
      if (surrogate%basis%n_terms /= n_terms) then
         status = 2
         message = 'the number of coefficients is not that of the basis'
      end if
   else
      status = error%status
      message = error%message
   end if
   if (status /= 0) then
      deallocate (surrogate)
      return
   end if
   surrogate%coefficients = reshape(coefficients, [surrogate%basis%n_harmonics, surrogate%basis%n_polynomials])
   surrogate%covariance = covariance
   surrogate%anisotropy_cap = anisotropy_cap
   surrogate%alpha = alpha
   surrogate%beta = beta
   surrogate%sd_inflation = sd_inflation
   handle = surrogate_to_handle(surrogate)
end subroutine surrogate_new

!> Read the text form of a surrogate.
subroutine surrogate_read(path, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use surrogate_model, only: load_surrogate, surrogate_to_handle, surrogate_type
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: path
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(surrogate_type), pointer :: surrogate
   type(error_type), allocatable :: error

   handle = 0
   allocate (surrogate)
   call load_surrogate(path, surrogate, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (surrogate)
   else
      handle = surrogate_to_handle(surrogate)
   end if
end subroutine surrogate_read

!> Write the text form of a surrogate.
subroutine surrogate_write(handle, path, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use surrogate_model, only: save_surrogate, surrogate_from_handle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: path
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(error_type), allocatable :: error

   call save_surrogate(surrogate_from_handle(handle), path, error)
   call error_to_status(error, status, message)
end subroutine surrogate_write

!> What a surrogate is: its basis, cap and precisions.
subroutine surrogate_header(handle, symmetry, coordinates, truncation, degree, bandlimit, m, n_terms, lower, upper, &
   & anisotropy_cap, alpha, beta, sd_inflation)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use surrogate_model, only: surrogate_from_handle, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   character(len=12), intent(out) :: symmetry
   integer(c_int), intent(out) :: coordinates, truncation, degree, bandlimit, m, n_terms
   real(c_double), intent(out) :: lower(5), upper(5), anisotropy_cap, alpha, beta, sd_inflation
   type(surrogate_type), pointer :: surrogate

   surrogate => surrogate_from_handle(handle)
   symmetry = surrogate%basis%class%name
   coordinates = surrogate%basis%coordinates
   truncation = surrogate%basis%truncation
   degree = surrogate%basis%degree
   bandlimit = surrogate%basis%bandlimit
   m = surrogate%basis%n_coordinates
   n_terms = surrogate%basis%n_terms
   lower = 0
   upper = 0
   lower(:m) = surrogate%basis%lower
   upper(:m) = surrogate%basis%upper
   anisotropy_cap = surrogate%anisotropy_cap
   alpha = surrogate%alpha
   beta = surrogate%beta
   sd_inflation = surrogate%sd_inflation
end subroutine surrogate_header

!> Posterior mean and covariance of the terms of a surrogate.
subroutine surrogate_posterior(handle, n_terms, coefficients, covariance)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use surrogate_model, only: surrogate_from_handle, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n_terms
   real(c_double), intent(out) :: coefficients(n_terms), covariance(n_terms, n_terms)
   type(surrogate_type), pointer :: surrogate

   surrogate => surrogate_from_handle(handle)
   coefficients = reshape(surrogate%coefficients, [n_terms])
   covariance = surrogate%covariance
end subroutine surrogate_posterior

!> Mean and sd (GPa) of the simulated modulus of n crystals (GPa) at n orientations (radians).
subroutine surrogate_predict(handle, k, n, constants, euler, threads, modulus, sd)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use surrogate_model, only: predict, surrogate_from_handle, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: k, n, threads
   real(c_double), intent(in) :: constants(k, n), euler(3, n)
   real(c_double), intent(out) :: modulus(n), sd(n)
   type(surrogate_type), pointer :: surrogate
   integer :: i

   surrogate => surrogate_from_handle(handle)
   !$omp parallel do num_threads(threads) schedule(static)
   do i = 1, n
      call predict(surrogate, constants(:, i), euler(:, i), modulus(i), sd(i))
   end do
   !$omp end parallel do
end subroutine surrogate_predict

!> 1 for each of n crystals that is outside the surrogate's domain, else 0.
subroutine surrogate_outside(handle, k, n, constants, outside)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use surrogate_model, only: is_outside, surrogate_from_handle, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: k, n
   real(c_double), intent(in) :: constants(k, n)
   integer(c_int), intent(out) :: outside(n)
   type(surrogate_type), pointer :: surrogate
   integer :: i

   surrogate => surrogate_from_handle(handle)
   do i = 1, n
      outside(i) = merge(1, 0, is_outside(surrogate, constants(:, i)))
   end do
end subroutine surrogate_outside

!> Give back the memory of a surrogate.
subroutine surrogate_free(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use surrogate_model, only: surrogate_from_handle, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   type(surrogate_type), pointer :: surrogate

   if (handle == 0) return
   surrogate => surrogate_from_handle(handle)
   deallocate (surrogate)
end subroutine surrogate_free
