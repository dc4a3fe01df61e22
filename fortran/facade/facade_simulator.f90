! Simulators for Python, under handles of the kind 'simulator', and what is known of a simulation without making it.

!> Make what a problem asks for, of a kind: 'indentation' or 'simulator'.
subroutine simulation_new(problem, kind, handle, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use simulation_handles, only: new_simulation_handle
   implicit none
   integer(c_int64_t), intent(in) :: problem
   character(len=*), intent(in) :: kind
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(error_type), allocatable :: error

   call new_simulation_handle(problem, kind, handle, error)
   call error_to_status(error, status, message)
end subroutine simulation_new

!> Simulate one crystal: stiffness in the crystal frame (GPa), Bunge-Euler angles (radians). `depths`: of the simulator. `numbers`:
!> indentation modulus (GPa),
!> seconds, elements, points of the curve, and 1 if it failed, with the reason in `message`; `curve`: depth (um), force (mN).
subroutine simulator_run(handle, depths, stiffness, euler, curve, numbers, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use simulate, only: outcome_failed, outcome_type, simulator_type
   use simulation_handles, only: simulator_of_handle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: depths
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: curve(depths, 2), numbers(5)
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(simulator_type), pointer :: simulator
   type(outcome_type) :: outcome
   type(error_type), allocatable :: error
   integer :: n

   curve = 0.0_c_double
   numbers = 0.0_c_double
   call simulator_of_handle(handle, simulator, error)
   if (.not. allocated(error)) call simulator%run(stiffness, euler, outcome, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   n = size(outcome%depth)
   curve(:n, 1) = outcome%depth
   curve(:n, 2) = outcome%force
   numbers = [outcome%modulus, outcome%seconds, real(outcome%elements, c_double), real(n, c_double), 0.0_c_double]
   if (outcome%status /= outcome_failed) return
   numbers(5) = 1.0_c_double
   message = outcome%message
end subroutine simulator_run

!> How large the error of the mesh of a problem may be at the `largest`, relative, for n crystals (stiffness in GPa). `warning`: what is
!> to be said of those near instability, blank if there are none.
subroutine simulation_resolution(problem, n, stiffness, largest, warning, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use simulate, only: simulation_error
   implicit none
   integer(c_int64_t), intent(in) :: problem
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: stiffness(6, 6, n)
   real(c_double), intent(out) :: largest(n)
   character(len=1024), intent(out) :: warning
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(error_type), allocatable :: error
   type(problem_type), pointer :: self
   character(len=:), allocatable :: words

   largest = 0.0_c_double
   warning = ''
   call problem_of_handle(problem, self, error)
   if (.not. allocated(error)) then
      call simulation_error(self%settings, stiffness, largest, words)
      warning = words
   end if
   call error_to_status(error, status, message)
end subroutine simulation_resolution

!> Force over modulus, `unit_force` (um2), of the isotropic half-space at each `depth` (um) of n, under the indenter of a problem.
subroutine simulation_unit_force(problem, n, depth, unit_force, status, message)
   use abstract_indenter, only: indenter_type
   use indenters, only: new_indenter
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: problem
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: depth(n)
   real(c_double), intent(out) :: unit_force(n)
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(error_type), allocatable :: error
   type(problem_type), pointer :: self
   class(indenter_type), allocatable :: indenter

   unit_force = 0.0_c_double
   call problem_of_handle(problem, self, error)
   if (.not. allocated(error)) call new_indenter(self%settings%indenter, indenter, error)
   if (.not. allocated(error)) unit_force = indenter%unit_force(depth)
   call error_to_status(error, status, message)
end subroutine simulation_unit_force
