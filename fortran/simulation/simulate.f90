!> What &specimen, &indenter and &simulation ask for, behind one interface: one crystal in, its indentation modulus and curve out.
!>
!> A crystal that cannot be simulated is an outcome with its message. Bad input, and what the machine could not do, are errors: they
!> say nothing about the crystal.
module simulate
   use abstract_indenter, only: indenter_type
   use abstract_specimen, only: specimen_type
   use crystal_elasticity, only: logarithmic_mean
   use errors, only: error_type, exit_failure, refuse
   use fe_indentation, only: indentation_model_type, indentation_result_type, new_indentation_model, simulate_indentation
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: i8, wp
   use mesh_resolution, only: largest_mesh_error, resolution_warning
   use namelist_file, only: place
   use settings_schema, only: settings_type
   use specimens, only: new_indentation
   implicit none
   private
   public :: outcome_type, simulator_type, new_simulator, check_simulation, simulation_error
   public :: specimen_stiffness, specimen_contact_radius
   public :: outcome_waiting, outcome_done, outcome_failed

   !> What became of a crystal.
   integer, parameter :: outcome_waiting = 0, outcome_done = 1, outcome_failed = 2

   type :: outcome_type
      integer :: status = outcome_waiting
      !> Indentation modulus, GPa, and wall time, s.
      real(wp) :: modulus = 0.0_wp, seconds = 0.0_wp
      !> Finite elements of all solves; 0 without any.
      integer :: elements = 0
      !> The curve, um and mN; empty without finite elements.
      real(wp), allocatable :: depth(:), force(:)
      !> Why it failed.
      character(len=:), allocatable :: message
   end type outcome_type

   !> Read-only once made, so that threads share it: a model of finite elements, or without one the theory.
   type :: simulator_type
      type(indentation_model_type), allocatable :: model
   contains
      procedure :: run
   end type simulator_type

contains

   !> Refuse a specimen or an indenter that cannot be simulated, before a mesh is made.
   subroutine check_simulation(path, settings, has_theory, error)
      !> Begins the message.
      character(len=*), intent(in) :: path
      type(settings_type), intent(in) :: settings
      !> Whether the specimen is the half-space, which theory knows.
      logical, intent(out) :: has_theory
      type(error_type), allocatable, intent(out) :: error
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen

      has_theory = .false.
      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error)) then
         error%message = place(path, '', '')//error%message
      else
         has_theory = .not. specimen%has_length
      end if
   end subroutine check_simulation

   !> The scale of what a specimen has beside the crystal, the geometric mean of the eigenvalues of its Kelvin stiffness, GPa; 0 where the
   !> crystal's own scale changes moduli by a factor only.
   real(wp) function specimen_stiffness(settings) result(scale)
      type(settings_type), intent(in) :: settings
      class(specimen_type), allocatable :: specimen
      real(wp) :: poisson, anisotropy, own(6, 6)

      scale = 0.0_wp
      call find_specimen(settings, specimen)
      if (.not. allocated(specimen)) return
      own = specimen%own_stiffness()
      if (maxval(own) > 0.0_wp) call logarithmic_mean(own, poisson, anisotropy, scale)
   end function specimen_stiffness

   !> Contact radius (half-space) at the last depth of simulations of a specimen with a length of its own, um; 0 of one without.
   real(wp) function specimen_contact_radius(settings) result(radius)
      type(settings_type), intent(in) :: settings
      class(specimen_type), allocatable :: specimen

      radius = 0.0_wp
      call find_specimen(settings, specimen)
      if (.not. allocated(specimen)) return
      if (specimen%has_length) radius = specimen%contact_radius
   end function specimen_contact_radius

   !> What finite elements, ours or others', indent; not allocated where theory takes their place, or it cannot be.
   subroutine find_specimen(settings, specimen)
      type(settings_type), intent(in) :: settings
      class(specimen_type), allocatable, intent(out) :: specimen
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error

      if (settings%simulation%simulator == 'theory') return
      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error) .and. allocated(specimen)) deallocate (specimen)
   end subroutine find_specimen

   !> The simulator that the settings ask for; for finite elements the meshes are made.
   subroutine new_simulator(settings, simulator, error)
      type(settings_type), intent(in) :: settings
      type(simulator_type), allocatable, intent(out) :: simulator
      type(error_type), allocatable, intent(out) :: error

      allocate (simulator)
      select case (settings%simulation%simulator)
      case ('fe')
         allocate (simulator%model)
         call new_indentation_model(settings, simulator%model, error)
      case ('theory')
      case default
         call refuse(error, "simulator '"//settings%simulation%simulator//"' cannot simulate: print the next points with " &
            & //"'build --ask', import their moduli with 'build --tell', or lower &design budget")
      end select
   end subroutine new_simulator

   !> Simulate a crystal and take the time.
   subroutine run(self, stiffness, euler, outcome, error)
      class(simulator_type), intent(in) :: self
      !> Stiffness in the crystal frame (GPa) and Bunge-Euler angles (radians).
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(outcome_type), intent(out) :: outcome
      !> Of the input or the machine: there is no outcome.
      type(error_type), allocatable, intent(out) :: error
      type(indentation_result_type) :: result
      type(halfspace_type) :: theory
      integer(i8) :: start, finish, rate

      call system_clock(start, rate)
      outcome%depth = [real(wp) ::]
      outcome%force = [real(wp) ::]
      outcome%message = ''
      if (.not. allocated(self%model)) then
         call halfspace_modulus(stiffness, euler, theory, error)
         outcome%modulus = theory%modulus
      else
         call simulate_indentation(self%model, stiffness, euler, result, error)
         if (.not. allocated(error)) then
            outcome%modulus = result%modulus
            outcome%elements = result%elements
            outcome%depth = result%depth
            outcome%force = result%force
         end if
      end if
      call system_clock(finish)
      outcome%seconds = real(finish - start, wp)/real(rate, wp)
      outcome%status = outcome_done
      if (.not. allocated(error)) return
      outcome%status = outcome_waiting
      if (error%status /= exit_failure) return
      outcome%status = outcome_failed
      outcome%message = error%message
      deallocate (error)
   end subroutine run

   !> How large the error of the simulation may be for each crystal, and what is to be said of it, '' if nothing.
   subroutine simulation_error(settings, stiffness, largest, warning)
      type(settings_type), intent(in) :: settings
      !> GPa (6, 6, crystals).
      real(wp), intent(in) :: stiffness(:, :, :)
      !> Relative (crystals).
      real(wp), intent(out) :: largest(:)
      !> One line.
      character(len=:), allocatable, intent(out) :: warning

      logical :: extended(size(largest))

      largest = 0.0_wp
      warning = ''
      if (settings%simulation%simulator /= 'fe') return
      call largest_mesh_error(settings, stiffness, largest, extended)
      warning = resolution_warning(largest)
   end subroutine simulation_error
end module simulate
