! Step 2 for Python: posteriors of the constants under handles of the kind 'posterior', their chains, and what follows from them.
! status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> Names and units of the quantities that are reported of the crystal class `symmetry`, one on a line, name and unit apart by byte
!> 31.
subroutine quantity_list(symmetry, names, status, message)
   use, intrinsic :: iso_c_binding, only: c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_to_status, error_type
   use quantities, only: quantity_type, reported_quantities
   implicit none
   character(len=*), intent(in) :: symmetry
   character(len=2048), intent(out) :: names
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(crystal_class_type) :: class
   type(quantity_type), allocatable :: list(:)
   type(error_type), allocatable :: error
   integer :: i

   names = ''
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call reported_quantities(class, list, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, size(list)
      names = trim(names)//list(i)%name//achar(31)//list(i)%unit//achar(10)
   end do
end subroutine quantity_list

!> The values of m quantities of n stable crystals of the class `symmetry` with k constants (GPa); names: one on a line.
subroutine quantity_values(symmetry, names, m, k, n, constants, values, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_to_status, error_type, exit_bad_input, raise
   use quantities, only: evaluate_quantities, new_quantity, quantity_type
   use text, only: to_text
   implicit none
   character(len=*), intent(in) :: symmetry, names
   integer(c_int), intent(in) :: m, k, n
   real(c_double), intent(in) :: constants(k, n)
   real(c_double), intent(out) :: values(m, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(crystal_class_type) :: class
   type(quantity_type) :: list(m)
   type(error_type), allocatable :: error
   integer :: i, first, length

   values = 0
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error) .and. class%n_constants /= k) call raise(error, 'a '//class%name//' crystal has ' &
      & //to_text(class%n_constants)//' constants, not '//to_text(k), exit_bad_input)
   first = 1
   do i = 1, m
      if (allocated(error)) exit
      length = index(names(first:)//achar(10), achar(10)) - 1
      call new_quantity(names(first:first + length - 1), list(i), error)
      first = first + length + 1
   end do
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      call evaluate_quantities(list, class%stiffness(constants(:, i)), values(:, i))
   end do
end subroutine quantity_values

!> The posterior of a problem over a surrogate. what: 0 the density, 1 the prior alone, 2 all of Step 2. handle: 0 if refused.
!> Given back: counts of parameters, grains, groups.
subroutine posterior_new(problem, surrogate, what, handle, counts, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_to_status, error_type
   use posterior_objects, only: posterior_object_type, posterior_of_handle, register_posterior
   implicit none
   integer(c_int64_t), intent(in) :: problem, surrogate
   integer(c_int), intent(in) :: what
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: counts(3), status
   character(len=4096), intent(out) :: message
   type(posterior_object_type), pointer :: self
   type(error_type), allocatable :: error

   counts = 0
   call register_posterior(problem, surrogate, what, handle, error)
   if (.not. allocated(error)) call posterior_of_handle(handle, self, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   counts = [self%density%dimension, self%density%n_grains, self%density%n_groups]
end subroutine posterior_new

!> Run chains of the sampler `method` with so many samples each after burn_in, which the posterior keeps.
subroutine posterior_sample(handle, method, burn_in, samples, chains, threads, seed, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use abstract_sampler, only: sampler_type
   use errors, only: error_to_status, error_type
   use parallelism, only: thread_count
   use posterior_objects, only: posterior_object_type, posterior_of_handle
   use samplers, only: new_sampler, run_settings_type, sample_chains
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: method
   integer(c_int), intent(in) :: burn_in, samples, chains, threads, seed
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   class(sampler_type), allocatable :: sampler
   type(posterior_object_type), pointer :: self
   type(error_type), allocatable :: error

   call posterior_of_handle(handle, self, error)
   if (.not. allocated(error)) call new_sampler(method, burn_in, sampler, error)
   if (.not. allocated(error)) call sample_chains(self%density, sampler, &
      & run_settings_type(samples, chains, thread_count(threads), seed), self%chains, error)
   call error_to_status(error, status, message)
end subroutine posterior_sample

!> log_density and log_likelihood at n points x of so many parameters; inside is 1 where the point is in the support (elsewhere the
!> rest is not computed).
subroutine posterior_evaluate(handle, parameters, n, x, log_density, log_likelihood, inside, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_to_status, error_type
   use posterior_objects, only: posterior_object_type, posterior_of_handle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: parameters, n
   real(c_double), intent(in) :: x(parameters, n)
   real(c_double), intent(out) :: log_density(n), log_likelihood(n)
   integer(c_int), intent(out) :: inside(n), status
   character(len=4096), intent(out) :: message
   type(posterior_object_type), pointer :: self
   type(error_type), allocatable :: error

   log_density = -huge(log_density)
   log_likelihood = -huge(log_density)
   inside = 0
   call posterior_of_handle(handle, self, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   call self%density%evaluate_parts(x, log_density, log_likelihood)
   where (log_density > -huge(log_density)) inside = 1
end subroutine posterior_evaluate

!> At n points x of so many parameters values: the indentation moduli (GPa) of any m grains (euler, radians), with the surrogate's error
!> drawn given the data, and below them one plus the calibration error of each of the groups, drawn likewise. status: 0, or not
!> for want of a model.
subroutine posterior_moduli(handle, parameters, groups, n, x, m, euler, seed, values, status)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use abstract_basis, only: grain_model_type
   use errors, only: error_type
   use posterior_objects, only: posterior_object_type, posterior_of_handle
   use random, only: new_random_stream, random_stream_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: parameters, groups, n, m, seed
   real(c_double), intent(in) :: x(parameters, n), euler(3, m)
   real(c_double), intent(out) :: values(m + groups, n)
   integer(c_int), intent(out) :: status
   type(posterior_object_type), pointer :: self
   type(random_stream_type) :: stream
   type(error_type), allocatable :: error
   class(grain_model_type), allocatable :: grains
   integer :: i

   values = 0
   call posterior_of_handle(handle, self, error)
   if (.not. allocated(error)) call self%density%new_grains(euler, grains, error)
   status = merge(1, 0, allocated(error))
   if (status /= 0) return
   stream = new_random_stream(seed, 0)
   do i = 1, n
      call self%density%draw_moduli(x(:, i), grains, stream, values(:m, i), values(m + 1:, i))
   end do
end subroutine posterior_moduli

!> What to measure next, by the problem's &next, from n draws of so many parameters of the posterior (the factor on the sds as it
!> is, not its logarithm).
subroutine posterior_next(problem, handle, parameters, n, draws, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_to_status, error_type
   use next_grains, only: next_document
   use posterior_objects, only: posterior_object_type, posterior_of_handle
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: problem, handle
   integer(c_int), intent(in) :: parameters, n
   real(c_double), intent(in) :: draws(parameters, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(posterior_object_type), pointer :: self
   type(problem_type), pointer :: asked
   type(error_type), allocatable :: error

   call problem_of_handle(problem, asked, error)
   if (.not. allocated(error)) call posterior_of_handle(handle, self, error)
   if (.not. allocated(error)) call next_document(asked, self%density, draws, self%next, error)
   call error_to_status(error, status, message)
end subroutine posterior_next

!> Numbers of a posterior by their `label`, see `posterior_objects`; sizes: of the array, 0 beyond its dimensions.
subroutine posterior_sizes(handle, label, sizes, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_to_status, error_type
   use posterior_objects, only: labelled_values_of
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: label
   integer(c_int), intent(out) :: sizes(3), status
   character(len=4096), intent(out) :: message
   type(error_type), allocatable :: error

   call labelled_values_of(handle, label, sizes, error)
   call error_to_status(error, status, message)
end subroutine posterior_sizes

!> The n values of a `label` themselves, in Fortran's order.
subroutine posterior_values(handle, label, n, values, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_to_status, error_type
   use posterior_objects, only: labelled_values_of
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: label
   integer(c_int64_t), intent(in) :: n
   real(c_double), intent(out) :: values(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   integer(c_int) :: sizes(3)
   type(error_type), allocatable :: error

   values = 0
   call labelled_values_of(handle, label, sizes, error, values)
   call error_to_status(error, status, message)
end subroutine posterior_values

!> The text of a document of a posterior, JSON: its label is 'extract' or 'next'. A length of 0 asks for its full_length alone.
subroutine posterior_document(handle, label, length, text, full_length, status, message)
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t
   use errors, only: error_to_status, error_type
   use posterior_objects, only: document_of
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: label
   integer(c_int), intent(in) :: length
   character(kind=c_char, len=1), intent(out) :: text(length)
   integer(c_int), intent(out) :: full_length, status
   character(len=4096), intent(out) :: message
   character(len=:), allocatable :: document
   type(error_type), allocatable :: error
   integer :: i

   text = ' '
   full_length = 0
   call document_of(handle, label, document, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   full_length = len(document)
   do i = 1, min(length, full_length)
      text(i) = document(i:i)
   end do
end subroutine posterior_document
