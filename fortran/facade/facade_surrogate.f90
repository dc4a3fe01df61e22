! Domain, basis and surrogate for f2py; angles in degrees. status: 0 done, 1 failure, 2 bad input; message: the reason, blank on
! success.

!> Keep the basis that &domain and &surrogate of a problem (problem_handle) ask for.
subroutine basis_new(problem_handle, handle, status, message)
   use abstract_basis, only: basis_type
   use build_checks, only: basis_of_problem
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: register_object
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: problem_handle
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: problem
   class(basis_type), allocatable :: basis
   class(*), pointer :: object
   type(error_type), allocatable :: error

   handle = 0
   call problem_of_handle(problem_handle, problem, error)
   if (.not. allocated(error)) call basis_of_problem(problem, basis, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   allocate (object, source=basis)
   call register_object(object, 'basis', handle)
end subroutine basis_new

!> n crystals of a basis' domain, spread by a seed: constants (GPa) of its class, and angles (degrees).
subroutine basis_crystals(handle, seed, k, n, constants, euler_deg, status, message)
   use abstract_basis, only: basis_type
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_domain, only: spread_crystals
   use surrogate_handles, only: find_basis
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: seed, k, n
   real(c_double), intent(out) :: constants(k, n), euler_deg(3, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   class(basis_type), pointer :: basis
   real(c_double), allocatable :: crystals(:, :), angles(:, :)
   type(error_type), allocatable :: error

   constants = 0
   euler_deg = 0
   call find_basis(handle, basis, error)
   if (.not. allocated(error)) call spread_crystals(basis%domain, n, seed, crystals, angles, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   constants = crystals
   euler_deg = angles
end subroutine basis_crystals

!> The n_terms terms of n crystals in n orientations, and the scale (GPa) of each.
subroutine basis_terms(handle, k, n, n_terms, constants, euler_deg, terms, scale, status, message)
   use abstract_basis, only: basis_type
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use kinds, only: degree
   use surrogate_handles, only: find_basis
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: k, n, n_terms
   real(c_double), intent(in) :: constants(k, n), euler_deg(3, n)
   real(c_double), intent(out) :: terms(n_terms, n), scale(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   class(basis_type), pointer :: basis
   type(error_type), allocatable :: error
   integer :: i

   terms = 0
   scale = 0
   call find_basis(handle, basis, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      call basis%evaluate_terms(basis%domain%class%stiffness(constants(:, i)), degree*euler_deg(:, i), terms(:, i), scale(i))
   end do
end subroutine basis_terms

!> Of n crystals (stiffness, GPa): reach, how far out each is, see `surrogate_domain`, covered: 1 if a surrogate with the basis is valid
!> for it, else 0, and the scale, the geometric mean of the eigenvalues of the Kelvin stiffness, GPa, NaN for an unstable one.
subroutine basis_coverage(handle, n, stiffness, reach, covered, scale, status, message)
   use abstract_basis, only: basis_type
   use crystal_elasticity, only: logarithmic_mean
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_basis
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: stiffness(6, 6, n)
   real(c_double), intent(out) :: reach(n), scale(n)
   integer(c_int), intent(out) :: covered(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   class(basis_type), pointer :: basis
   type(error_type), allocatable :: error
   real(c_double) :: poisson, anisotropy
   integer :: i

   reach = 0
   covered = 0
   scale = 0
   call find_basis(handle, basis, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      call logarithmic_mean(stiffness(:, :, i), poisson, anisotropy, scale(i))
      reach(i) = basis%domain%normalised_distance(stiffness(:, :, i))
      covered(i) = merge(1, 0, basis%domain%admits(stiffness(:, :, i)))
   end do
end subroutine basis_coverage

!> Keep the basis of a surrogate (a handle).
subroutine surrogate_basis(surrogate, handle, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: register_object
   use surrogate_handles, only: find_surrogate_object
   use surrogate_model, only: surrogate_type
   implicit none
   integer(c_int64_t), intent(in) :: surrogate
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(surrogate_type), pointer :: found
   class(*), pointer :: object
   type(error_type), allocatable :: error

   handle = 0
   call find_surrogate_object(surrogate, found, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   allocate (object, source=found%basis)
   call register_object(object, 'basis', handle)
end subroutine surrogate_basis

!> Keep a surrogate over a basis (a handle): coefficients and covariance of its n_terms terms; precisions are alpha, beta and the
!> fall of the prior, provenance a JSON object.
subroutine surrogate_new(basis, n_terms, coefficients, covariance, precisions, provenance, handle, status, message)
   use abstract_basis, only: basis_type
   use errors, only: exit_bad_input, raise
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   use surrogate_file, only: check_values
   use surrogate_handles, only: find_basis
   use surrogate_model, only: surrogate_type
   implicit none
   integer(c_int64_t), intent(in) :: basis
   integer(c_int), intent(in) :: n_terms
   real(c_double), intent(in) :: coefficients(n_terms), covariance(n_terms, n_terms), precisions(3)
   character(len=*), intent(in) :: provenance
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   class(basis_type), pointer :: found
   type(surrogate_type), pointer :: surrogate
   type(error_type), allocatable :: error

   allocate (surrogate)
   call find_basis(basis, found, error)
   if (.not. allocated(error)) then
      allocate (surrogate%basis, source=found)
      surrogate%coefficients = coefficients
      surrogate%covariance = covariance
      surrogate%alpha = precisions(1)
      surrogate%beta = precisions(2)
      surrogate%decay_rate = precisions(3)
      surrogate%provenance = provenance
      if (found%n_terms /= n_terms) then
         call raise(error, 'the number of coefficients is not that of the basis', exit_bad_input)
      else
         call check_values(surrogate, error)
      end if
   end if
   call error_to_status(error, status, message)
   call keep_object(surrogate, 'surrogate', error, handle)
end subroutine surrogate_new

!> The path of a surrogate by its name; output, folder, data_folder and shipped as of `surrogate_load`.
subroutine surrogate_path(name, output, folder, data_folder, shipped, path, status, message)
   use interoperation, only: c_int, error_to_status, error_type
   use surrogate_lookup, only: find_surrogate, places_type
   implicit none
   character(len=*), intent(in) :: name, output, folder, data_folder, shipped
   character(len=4096), intent(out) :: path
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   character(len=:), allocatable :: found
   type(error_type), allocatable :: error

   path = ''
   call find_surrogate(name, places_type(output, folder, data_folder, shipped), found, error)
   call error_to_status(error, status, message)
   if (status == 0) path = found
end subroutine surrogate_path

!> Keep a surrogate by its name in the folders of results (output), namelist (folder) and package data (data_folder), where those
!> with the names in `shipped` are; of crystals of a class (symmetry), if that is not blank.
subroutine surrogate_load(name, symmetry, output, folder, data_folder, shipped, handle, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   use surrogate_lookup, only: load_named_surrogate, places_type
   use surrogate_model, only: surrogate_type
   implicit none
   character(len=*), intent(in) :: name, symmetry, output, folder, data_folder, shipped
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(surrogate_type), pointer :: surrogate
   type(error_type), allocatable :: error

   allocate (surrogate)
   call load_named_surrogate(name, symmetry, places_type(output, folder, data_folder, shipped), surrogate, error)
   call error_to_status(error, status, message)
   call keep_object(surrogate, 'surrogate', error, handle)
end subroutine surrogate_load

!> Write a surrogate.
subroutine surrogate_save(handle, path, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use surrogate_file, only: save_surrogate
   use surrogate_handles, only: find_surrogate_object
   use surrogate_model, only: surrogate_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: path
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(surrogate_type), pointer :: surrogate
   type(error_type), allocatable :: error

   call find_surrogate_object(handle, surrogate, error)
   if (.not. allocated(error)) call save_surrogate(surrogate, path, error)
   call error_to_status(error, status, message)
end subroutine surrogate_save

!> Refuse to write a surrogate to a path where something is that is not one.
subroutine surrogate_check_replaceable(path, status, message)
   use interoperation, only: c_int, error_to_status, error_type
   use surrogate_file, only: check_replaceable
   implicit none
   character(len=*), intent(in) :: path
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(error_type), allocatable :: error

   call check_replaceable(path, error)
   call error_to_status(error, status, message)
end subroutine surrogate_check_replaceable

!> modulus and sd (GPa): what the simulation of n crystals (stiffness, GPa) in n orientations (euler, radians) is predicted to give.
subroutine surrogate_predict(handle, n, stiffness, euler, threads, modulus, sd, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use surrogate_handles, only: find_surrogate_object
   use surrogate_model, only: predict_crystals, surrogate_type
   use parallelism, only: thread_count
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n, threads
   real(c_double), intent(in) :: stiffness(6, 6, n), euler(3, n)
   real(c_double), intent(out) :: modulus(n), sd(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(surrogate_type), pointer :: surrogate
   type(error_type), allocatable :: error

   modulus = 0
   sd = 0
   call find_surrogate_object(handle, surrogate, error)
   if (.not. allocated(error)) call predict_crystals(surrogate, stiffness, euler, thread_count(threads), modulus, sd, error)
   call error_to_status(error, status, message)
end subroutine surrogate_predict

!> modulus and sd (GPa) of the n crystals of a problem (problem_handle), which stay where they are; and of each 1 in `covered` if a
!> surrogate over this basis covers it, else its scale (GPa), as of `basis_coverage`.
subroutine surrogate_predict_points(handle, problem_handle, n, threads, modulus, sd, covered, scale, status, message)
   use crystal_elasticity, only: logarithmic_mean
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use kinds, only: degree
   use parallelism, only: thread_count
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use surrogate_handles, only: find_surrogate_object
   use surrogate_model, only: predict_crystals, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle, problem_handle
   integer(c_int), intent(in) :: n, threads
   real(c_double), intent(out) :: modulus(n), sd(n), scale(n)
   integer(c_int), intent(out) :: covered(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(surrogate_type), pointer :: surrogate
   type(problem_type), pointer :: problem
   type(error_type), allocatable :: error
   real(c_double) :: poisson, anisotropy
   integer :: i

   modulus = 0
   sd = 0
   covered = 0
   scale = 0
   call find_surrogate_object(handle, surrogate, error)
   if (.not. allocated(error)) call problem_of_handle(problem_handle, problem, error)
   if (.not. allocated(error)) call predict_crystals(surrogate, problem%crystals%stiffness, degree*problem%crystals%euler_deg, &
      & thread_count(threads), modulus, sd, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   associate (c => problem%crystals%stiffness)
      !$omp parallel do num_threads(thread_count(threads)) schedule(static) private(poisson, anisotropy)
      do i = 1, n
         covered(i) = merge(1, 0, surrogate%basis%domain%admits(c(:, :, i)))
         if (covered(i) == 0) call logarithmic_mean(c(:, :, i), poisson, anisotropy, scale(i))
      end do
      !$omp end parallel do
   end associate
end subroutine surrogate_predict_points
