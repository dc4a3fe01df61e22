! The loop of Step 1 for f2py, see `step_1`: simulations by numbers from 0, GPa, degrees. status: 0 done, 1 failure, 2 bad input, 3 the
! machine's failure; message: the reason, blank on success.

!> Keep the build of a problem (problem_handle) in an output folder: open its campaign and learn what it has.
subroutine build_new(problem_handle, output, handle, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use step_1, only: build_type, open_build
   implicit none
   integer(c_int64_t), intent(in) :: problem_handle
   character(len=*), intent(in) :: output
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: problem
   type(build_type), pointer :: build
   type(error_type), allocatable :: error

   allocate (build)
   call problem_of_handle(problem_handle, problem, error)
   if (.not. allocated(error)) call open_build(problem, output, build, error)
   call error_to_status(error, status, message)
   call keep_object(build, 'build', error, handle)
end subroutine build_new

!> Learn what was stored and choose what to simulate next: the number of simulations that are wanted (0: all is done), those that were
!> learnt from, and validating: 1 if what is wanted is for validation, else 0.
subroutine build_advance(handle, wanted, learnt, validating, status, message)
   use build_handles, only: find_build
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use step_1, only: build_type, teaching
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(out) :: wanted, learnt, validating
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(build_type), pointer :: build
   type(error_type), allocatable :: error

   wanted = 0
   learnt = 0
   validating = 0
   call find_build(handle, build, error)
   if (.not. allocated(error)) call build%advance(error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   wanted = build%n_wanted()
   learnt = build%learning%n()
   validating = merge(0, 1, build%phase == teaching)
end subroutine build_advance

!> The crystals (stiffness) and angles of the n simulations that are wanted.
subroutine build_wanted(handle, n, stiffness, euler_deg, status, message)
   use build_handles, only: find_build
   use errors, only: exit_bad_input, raise
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use step_1, only: build_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n
   real(c_double), intent(out) :: stiffness(6, 6, n), euler_deg(3, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(build_type), pointer :: build
   type(error_type), allocatable :: error
   integer :: i

   stiffness = 0
   euler_deg = 0
   call find_build(handle, build, error)
   if (.not. allocated(error)) then
      if (n /= build%n_wanted()) call raise(error, 'another number of simulations is wanted', exit_bad_input)
   end if
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      stiffness(:, :, i) = build%stiffness(i)
      euler_deg(:, i) = build%euler_deg(i)
   end do
end subroutine build_wanted

!> Keep the outcome of simulation `number`: the numbers are its modulus (0: it failed, with the reason in `why`), seconds, elements and how
!> many rows of the curve (um, mN; n of them, at least 1) are there.
subroutine build_store(handle, number, numbers, n, curve, why, status, message)
   use build_handles, only: find_build
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use simulate, only: outcome_done, outcome_failed, outcome_type
   use step_1, only: build_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: number, n
   real(c_double), intent(in) :: numbers(4), curve(n, 2)
   character(len=*), intent(in) :: why
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(build_type), pointer :: build
   type(outcome_type) :: outcome
   type(error_type), allocatable :: error

   outcome%status = merge(outcome_done, outcome_failed, numbers(1) > 0)
   outcome%modulus = numbers(1)
   outcome%seconds = numbers(2)
   outcome%elements = nint(numbers(3))
   outcome%depth = curve(:nint(numbers(4)), 1)
   outcome%force = curve(:nint(numbers(4)), 2)
   outcome%message = trim(why)
   call find_build(handle, build, error)
   if (.not. allocated(error)) call build%store(number + 1, outcome, error)
   call error_to_status(error, status, message)
end subroutine build_store

!> Write the surrogate into the output folder; the document of `build` is then that of the handle.
subroutine build_conclude(handle, output, status, message)
   use build_document, only: conclude
   use build_handles, only: find_build
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use step_1, only: build_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: output
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(build_type), pointer :: build
   type(error_type), allocatable :: error

   call find_build(handle, build, error)
   if (.not. allocated(error)) call conclude(build, output, build%document, error)
   call error_to_status(error, status, message)
end subroutine build_conclude

!> The next n candidates, before the moduli of the first of them are known: constants of the surrogate's class, k of them, and angles.
subroutine build_ask(handle, k, n, constants, euler_deg, status, message)
   use build_handles, only: find_build
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use step_1, only: build_type, look_ahead
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: k, n
   real(c_double), intent(out) :: constants(k, n), euler_deg(3, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(build_type), pointer :: build
   integer, allocatable :: numbers(:)
   type(error_type), allocatable :: error

   constants = 0
   euler_deg = 0
   call find_build(handle, build, error)
   if (.not. allocated(error)) call look_ahead(build, n, numbers, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   constants = build%candidates%constants(:, numbers)
   euler_deg = build%candidates%euler_deg(:, numbers)
end subroutine build_ask
