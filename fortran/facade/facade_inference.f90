! Step 2 for f2py: posteriors of the constants, the chains, what follows from them. A posterior is kept under a 64-bit handle
! that a Python object owns and frees. status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> Names of the quantities of a symmetry, 20 characters each, the constants first; count says how many.
subroutine quantity_list(symmetry, count, names, units)
   use, intrinsic :: iso_c_binding, only: c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use derived_quantities, only: quantity_count, quantity_names, quantity_units
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(out) :: count
   character(len=520), intent(out) :: names
   character(len=78), intent(out) :: units
   character(len=20) :: all_names(26)
   character(len=3) :: all_units(26)
   integer :: i
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error

   call new_crystal_class(symmetry, class, error)
   count = quantity_count(class)
   all_names(:count) = quantity_names(class)
   all_units(:count) = quantity_units(class)
   names = ''
   units = ''
   do i = 1, count
      names(20*i - 19:20*i) = all_names(i)
      units(3*i - 2:3*i) = all_units(i)
   end do
end subroutine quantity_list

!> All m quantities of n stable crystals (GPa).
subroutine quantity_values(symmetry, k, n, m, constants, values)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use derived_quantities, only: evaluate_quantities
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: k, n, m
   real(c_double), intent(in) :: constants(k, n)
   real(c_double), intent(out) :: values(m, n)
   integer :: i
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error

   call new_crystal_class(symmetry, class, error)
   do i = 1, n
      call evaluate_quantities(class, constants(:, i), values(:, i))
   end do
end subroutine quantity_values

!> Bounds (GPa) of the k constants of a surrogate where the user states none.
subroutine prior_default_bounds(surrogate, k, lower, upper)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use constants_prior, only: default_bounds
   use kinds, only: wp
   use surrogate_model, only: surrogate_from_handle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: surrogate
   integer(c_int), intent(in) :: k
   real(c_double), intent(out) :: lower(k), upper(k)
   real(wp), allocatable :: low(:), high(:)

   call default_bounds(surrogate_from_handle(surrogate), low, high)
   lower = low
   upper = high
end subroutine prior_default_bounds

!> Keep the posterior of a surrogate's constants for n grains; free it with `calibration_free`.
!>
!> normals: numerator and denominator (0: none) of the quantities that are known as normal, by number; mean and sd of each;
!> columns with numerator 0 are skipped, since f2py passes no empty array.
!> euler in radians, measured and sd in GPa; switches: infer the scale of the sds, count the surrogate's uncertainty, leave the
!> data out. Given back: number of parameters, share of the stated domain that the surrogate covers, the bounds in use.
subroutine calibration_new(surrogate, k, lower, upper, anisotropy_cap, n_normals, normals, normal_values, modulus_kind, &
   & indenter_modulus, indenter_nu, sample_nu, calibration_sd, error_model, student_dof, infer_scale, surrogate_uncertainty, &
   & prior_only, n, euler, measured, sd, handle, parameters, share_inside, used_lower, used_upper, used_cap, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use constants_posterior, only: likelihood_type, new_posterior, posterior_to_handle, posterior_type
   use constants_prior, only: new_prior, normal_knowledge_type, prior_type
   use errors, only: error_type, error_to_status
   use surrogate_model, only: surrogate_from_handle, surrogate_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: surrogate
   integer(c_int), intent(in) :: k, n_normals, n, normals(2, n_normals), infer_scale, surrogate_uncertainty
   integer(c_int), intent(in) :: prior_only
   real(c_double), intent(in) :: lower(k), upper(k), anisotropy_cap, normal_values(2, n_normals)
   real(c_double), intent(in) :: indenter_modulus, indenter_nu, sample_nu, calibration_sd, student_dof
   character(len=*), intent(in) :: modulus_kind, error_model
   real(c_double), intent(in) :: euler(3, n), measured(n), sd(n)
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: parameters
   real(c_double), intent(out) :: share_inside, used_lower(k), used_upper(k), used_cap
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(surrogate_type), pointer :: model
   type(posterior_type), pointer :: posterior
   type(prior_type) :: prior
   type(likelihood_type) :: likelihood
   type(normal_knowledge_type) :: knowledge(n_normals)
   type(error_type), allocatable :: error
   integer :: i

   handle = 0
   parameters = 0
   share_inside = 0
   used_lower = lower
   used_upper = upper
   used_cap = anisotropy_cap
   model => surrogate_from_handle(surrogate)
   do i = 1, n_normals
      knowledge(i) = normal_knowledge_type(normals(1, i), normals(2, i), normal_values(1, i), normal_values(2, i))
   end do
   likelihood%modulus_kind = trim(modulus_kind)
   likelihood%indenter_modulus = indenter_modulus
   likelihood%indenter_nu = indenter_nu
   likelihood%sample_nu = sample_nu
   likelihood%calibration_sd = calibration_sd
   likelihood%errors = trim(error_model)
   likelihood%student_dof = student_dof
   likelihood%infer_scale = infer_scale /= 0
   likelihood%surrogate_uncertainty = surrogate_uncertainty /= 0
   likelihood%prior_only = prior_only /= 0
   allocate (posterior)
   call new_prior(model, lower, upper, anisotropy_cap, pack(knowledge, normals(1, :) /= 0), prior, error)
   if (.not. allocated(error)) call new_posterior(model, prior, likelihood, euler, measured, sd, posterior, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (posterior)
      return
   end if
   parameters = posterior%dimension
   share_inside = prior%share_inside
   used_lower = prior%lower
   used_upper = prior%upper
   used_cap = prior%anisotropy_cap
   handle = posterior_to_handle(posterior)
end subroutine calibration_new

!> Run the chains of a sampler.
subroutine calibration_sample(handle, parameters, method, samples, burn_in, chains, threads, seed, draws, log_density, &
   & acceptance, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use constants_posterior, only: posterior_from_handle
   use errors, only: error_type, error_to_status
   use abstract_sampler, only: sampler_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: parameters, samples, burn_in, chains, threads, seed
   character(len=*), intent(in) :: method
   real(c_double), intent(out) :: draws(parameters, samples, chains), log_density(samples, chains), acceptance(chains)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   class(sampler_type), allocatable :: sampler
   type(chains_type) :: result
   type(error_type), allocatable :: error

   call new_sampler(method, burn_in, sampler, error)
   if (.not. allocated(error)) call sample_chains(posterior_from_handle(handle), sampler, &
      & run_settings_type(samples, chains, threads, seed), result, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   draws = result%draws
   log_density = result%log_density
   acceptance = result%acceptance
end subroutine calibration_sample

!> Log density and log likelihood at n points, and 1 where the point is in the support (elsewhere the rest is not computed).
subroutine calibration_evaluate(handle, parameters, n, x, log_density, log_likelihood, inside)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use constants_posterior, only: posterior_from_handle, posterior_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: parameters, n
   real(c_double), intent(in) :: x(parameters, n)
   real(c_double), intent(out) :: log_density(n), log_likelihood(n)
   integer(c_int), intent(out) :: inside(n)
   type(posterior_type), pointer :: posterior
   integer :: i

   posterior => posterior_from_handle(handle)
   log_density = -huge(log_density)
   log_likelihood = -huge(log_density)
   inside = 0
   do i = 1, n
      if (.not. posterior%admits(x(:, i))) cycle
      inside(i) = 1
      log_likelihood(i) = 0
      if (.not. posterior%likelihood%prior_only) log_likelihood(i) = posterior%log_likelihood(x(:, i))
      log_density(i) = posterior%prior%log_density(x(:, i)) + log_likelihood(i)
   end do
end subroutine calibration_evaluate

!> Indentation moduli (GPa) of any m grains (radians) at n points, with the surrogate's error drawn given the data, and one plus
!> the calibration error drawn likewise.
subroutine calibration_moduli(handle, parameters, n, x, m, euler, seed, moduli, factor)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use constants_posterior, only: posterior_from_handle, posterior_type
   use random, only: new_random_stream, random_stream_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: parameters, n, m, seed
   real(c_double), intent(in) :: x(parameters, n), euler(3, m)
   real(c_double), intent(out) :: moduli(m, n), factor(n)
   type(posterior_type), pointer :: posterior
   type(random_stream_type) :: stream
   real(c_double), allocatable :: harmonics(:, :)
   integer :: i

   posterior => posterior_from_handle(handle)
   harmonics = posterior%grains%harmonics(euler)
   stream = new_random_stream(seed, 0)
   do i = 1, n
      call posterior%draw_moduli(x(:, i), harmonics, stream, moduli(:, i), factor(i))
   end do
end subroutine calibration_moduli

!> n indentation moduli (GPa) as the kind of modulus that was measured.
subroutine calibration_map(handle, n, modulus, value)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use constants_posterior, only: posterior_from_handle, posterior_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: modulus(n)
   real(c_double), intent(out) :: value(n)
   real(c_double), allocatable :: slope(:)
   type(posterior_type), pointer :: posterior

   posterior => posterior_from_handle(handle)
   allocate (slope(n))
   slope = 1
   value = modulus
   call posterior%kind%apply(value, slope)
end subroutine calibration_map

!> Give back the memory of a posterior.
subroutine calibration_free(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use constants_posterior, only: posterior_from_handle, posterior_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   type(posterior_type), pointer :: posterior

   if (handle == 0) return
   posterior => posterior_from_handle(handle)
   deallocate (posterior)
end subroutine calibration_free

!> Choose n_chosen of m candidates for the next measurements, each given those before it, from d draws of the posterior.
!>
!> predicted: what each draw predicts at each candidate (GPa); directions: unit vectors of the candidates in crystal axes;
!> target: values of what is to be known, ignored with use_target 0, when it is the information about everything; separation in
!> radians, between directions that a crystal of this symmetry can tell apart. chosen is 0 where no candidate was left.
subroutine next_choice(d, m, n_chosen, predicted, directions, sd, use_target, target, separation, symmetry, scenarios, seed, &
   & threads, chosen, gains, first_gains, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use distinct_directions, only: new_region, region_type
   use errors, only: error_type, error_to_status
   use next_measurement, only: choose_measurements
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: d, m, n_chosen, use_target, scenarios, seed, threads
   character(len=*), intent(in) :: symmetry
   real(c_double), intent(in) :: predicted(d, m), directions(3, m), sd, target(d), separation
   integer(c_int), intent(out) :: chosen(n_chosen)
   real(c_double), intent(out) :: gains(n_chosen), first_gains(m)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(error_type), allocatable :: error
   type(crystal_class_type) :: class
   type(region_type) :: region

   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) then
      call new_region(class, region)
      call choose_measurements(predicted, directions, sd, target(:merge(d, 0, use_target /= 0)), separation, region, scenarios, &
         & seed, threads, chosen, gains, first_gains, error)
   end if
   call error_to_status(error, status, message)
end subroutine next_choice
