!> Simulation of one crystal as &specimen, &indenter and &simulation define it: the crystal is the
!> input, its indentation modulus and its curve are the outcome.
!>
!> A crystal that cannot be simulated is an outcome with a message. Wrong input and failures of the
!> machine are errors: they say nothing about the crystal.
!>
!> The identity of the physics is one line of JSON with sorted keys, under which campaigns store
!> their results. It has the variables of &specimen, &indenter and &simulation that the simulation
!> reads. Stored texts are compared literally: if this line changes, all stored campaigns become
!> invalid.
module simulate
   use indenters, only: indenter_type
   use basic_specimen, only: specimen_type
   use crystal_elasticity, only: logarithmic_mean
   use diagnostics, only: diagnostic, diagnostic_type
   use errors, only: error_type, exit_failure, refuse
   use fe_indentation, only: indentation_model_type, indentation_result_type, &
      & new_indentation_model, numerics_revision, simulate_indentation
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use omp_lib, only: omp_get_wtime
   use namelist_file, only: value_type
   use settings_list, only: is_text, settings_list_type
   use settings_schema, only: list_settings, settings_type
   use specimens, only: new_indentation
   use text, only: split_list, to_text
   implicit none
   private
   public :: outcome_type, simulator_type, new_simulator, check_simulation, simulation_error, &
      & specimen_stiffness, specimen_contact_radius, derivatives_of, has_derivatives, identity_text

   !> Status of the simulation of a crystal.
   integer, parameter, public :: outcome_waiting = 0, outcome_done = 1, outcome_failed = 2
   !> Number of derivatives by the stiffness, where there are any.
   integer, parameter, public :: n_derivatives = 21

   type :: outcome_type
      integer :: status = outcome_waiting
      !> Indentation modulus, GPa, and wall time, s.
      real(wp) :: modulus = 0.0_wp, seconds = 0.0_wp
      !> Finite elements of all solves; 0 for the theory.
      integer :: elements = 0
      !> The curve, um and mN; empty for the theory.
      real(wp), allocatable :: depth(:), force(:)
      !> Derivatives of the modulus by C11, C12, .. C66 in crystal axes, the 21 of a triclinic
      !> crystal; empty if they are unknown.
      real(wp), allocatable :: by_stiffness(:)
      !> Why the simulation failed.
      character(len=:), allocatable :: message
   end type outcome_type

   !> A finite-element model, or else the theory of the half-space. It does not change once made, so
   !> threads share it.
   type :: simulator_type
      type(indentation_model_type), allocatable :: model
   contains
      procedure :: run
   end type simulator_type

   !> Variables that every finite-element simulation reads.
   character(len=*), parameter :: common = 'geometry, estimator, shape, depth_um, ' &
      & //'contact_radius_um, simulator, element, integration, refine, extrapolate, depths'

contains

   !> The derivatives of an outcome by the stiffness, (21); 0 if they are unknown.
   pure function derivatives_of(outcome) result(derivatives)
      type(outcome_type), intent(in) :: outcome
      real(wp) :: derivatives(n_derivatives)

      derivatives = 0.0_wp
      if (size(outcome%by_stiffness) > 0) derivatives = outcome%by_stiffness
   end function derivatives_of

   !> Refuse a specimen or an indenter that cannot be simulated, before a mesh is made.
   subroutine check_simulation(settings, has_theory, error)
      type(settings_type), intent(in) :: settings
      !> Whether the specimen is the half-space, for which the theory is exact.
      logical, intent(out) :: has_theory
      type(error_type), allocatable, intent(out) :: error
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen

      has_theory = .false.
      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error)) return
      has_theory = .not. specimen%has_length
   end subroutine check_simulation

   !> Stiffness of the other material of a specimen: the geometric mean of the eigenvalues of its
   !> Kelvin form, GPa. It is 0 if scaling the crystal's stiffness scales the moduli by the same
   !> factor.
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

   !> Contact radius (half-space) at the last simulated depth, um, of a specimen with a length of
   !> its own; 0 for the half-space.
   real(wp) function specimen_contact_radius(settings) result(radius)
      type(settings_type), intent(in) :: settings
      class(specimen_type), allocatable :: specimen

      radius = 0.0_wp
      call find_specimen(settings, specimen)
      if (.not. allocated(specimen)) return
      if (specimen%has_length) radius = specimen%contact_radius
   end function specimen_contact_radius

   !> Whether the simulations have derivatives.
   logical function has_derivatives(settings)
      type(settings_type), intent(in) :: settings

      has_derivatives = settings%simulation%simulator == 'fe' &
         & .and. settings%specimen%estimator == 'curve'
   end function has_derivatives

   !> The specimen that finite elements indent, in this program or elsewhere; not allocated if the
   !> theory is used or the settings are wrong.
   subroutine find_specimen(settings, specimen)
      type(settings_type), intent(in) :: settings
      class(specimen_type), allocatable, intent(out) :: specimen
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error

      if (settings%simulation%simulator == 'theory') return
      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error) .and. allocated(specimen)) deallocate (specimen)
   end subroutine find_specimen

   !> The simulator that the settings define, with its meshes.
   subroutine new_simulator(settings, simulator, error)
      type(settings_type), intent(in) :: settings
      type(simulator_type), intent(out) :: simulator
      type(error_type), allocatable, intent(out) :: error

      select case (settings%simulation%simulator)
      case ('fe')
         allocate (simulator%model)
         call new_indentation_model(settings, simulator%model, error)
      case ('theory')
         ! The simulator is the theory unless it has a model.
      case default
         call refuse(error, "simulator '"//settings%simulation%simulator &
            & //"' cannot simulate: print the next points with 'build --ask', import their " &
            & //"moduli with 'build --tell', or lower &design budget")
      end select
   end subroutine new_simulator

   !> Simulate a crystal and measure the time.
   subroutine run(self, stiffness, euler, outcome, error)
      class(simulator_type), intent(in) :: self
      !> Stiffness in the crystal frame (GPa) and Bunge-Euler angles (radians).
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(outcome_type), intent(out) :: outcome
      !> An error of the input or of the machine; then there is no outcome.
      type(error_type), allocatable, intent(out) :: error
      type(indentation_result_type) :: result
      type(halfspace_type) :: theory
      real(wp) :: start
      integer :: i, j

      start = omp_get_wtime()
      outcome%depth = [real(wp) ::]
      outcome%force = [real(wp) ::]
      outcome%by_stiffness = [real(wp) ::]
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
            if (allocated(result%by_material)) then
               outcome%by_stiffness = [((merge(1.0_wp, 2.0_wp, i == j)*result%by_stiffness(i, j), &
                  & j=i, 6), i=1, 6)]
            end if
         end if
      end if
      outcome%seconds = omp_get_wtime() - start
      outcome%status = outcome_done
      if (.not. allocated(error)) return
      outcome%status = outcome_waiting
      if (error%status /= exit_failure) return
      outcome%status = outcome_failed
      outcome%message = error%message
      deallocate (error)
   end subroutine run

   !> Approximate largest error of the simulation for each crystal, and a diagnostic if it is large.
   subroutine simulation_error(settings, stiffness, largest, warnings)
      type(settings_type), intent(in) :: settings
      !> GPa (6, 6, crystals).
      real(wp), intent(in) :: stiffness(:, :, :)
      !> Relative error (crystals), without that of a block's layers, which all crystals share.
      real(wp), intent(out) :: largest(:)
      !> One, or none.
      type(diagnostic_type), allocatable, intent(out) :: warnings(:)
      !> Relative error from which on there is a warning. Error of infinite elements about the
      !> half-space nearer than by default: it grows with the cube (`bench simulate convergence`).
      real(wp), parameter :: limit = 0.01_wp, usual_outer = 5.0_wp, outer_error = 0.0025_wp
      class(specimen_type), allocatable :: specimen
      character(len=:), allocatable :: cause
      logical :: two_meshes
      integer :: i
      real(wp) :: layers, greatest

      largest = 0.0_wp
      allocate (warnings(0))
      if (settings%simulation%simulator /= 'fe') return
      call find_specimen(settings, specimen)
      if (.not. allocated(specimen)) return
      cause = 'instability'
      associate (simulation => settings%simulation)
         do i = 1, size(largest)
            two_meshes = specimen%wants_extrapolation(simulation%refine, stiffness(:, :, i))
            if (allocated(simulation%extrapolate)) two_meshes = simulation%extrapolate
            largest(i) = specimen%mesh_error(simulation%refine, stiffness(:, :, i), two_meshes)
         end do
         if (simulation%outer < usual_outer .and. .not. specimen%has_length) then
            cause = 'the infinite elements (outer)'
            largest = largest + outer_error*((usual_outer/simulation%outer)**3 - 1.0_wp)
         end if
         layers = specimen%layers_error/simulation%refine**2
      end associate
      greatest = layers + maxval(largest)
      if (greatest <= limit) return
      if (layers > 0.0_wp) then
         warnings = diagnostic('layers_error', numbers=100.0_wp*[layers, greatest])
      else
         warnings = diagnostic('mesh_error', cause, [real(wp) :: count(largest > limit), &
            & size(largest), 100.0_wp*greatest, maxloc(largest)])
      end if
   end subroutine simulation_error

   !> The identity of the physics of a problem.
   function identity_text(settings) result(identity)
      type(settings_type), intent(in) :: settings
      character(len=:), allocatable :: identity
      !> Names of the variables, separated by ', '; the value of a variable as JSON.
      character(len=:), allocatable :: names, value
      !> `"name": value`, sorted.
      type(value_type), allocatable :: pairs(:)
      type(settings_list_type) :: list
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen
      type(error_type), allocatable :: error
      logical :: is_fe, two_meshes
      integer :: i

      allocate (pairs(0))
      names = 'simulator'
      is_fe = settings%simulation%simulator == 'fe'
      ! Imported moduli also belong to a specimen and an indenter.
      if (is_fe .or. settings%simulation%simulator == 'import') then
         if (is_fe) call add_pair('numerics', to_text(numerics_revision))
         names = common
         call new_indentation(settings, indenter, specimen, error)
         if (allocated(indenter)) names = names//', '//indenter%variables
         if (allocated(specimen)) names = names//', '//specimen%variables
         if (allocated(specimen) .and. is_fe) then
            two_meshes = .not. allocated(settings%simulation%extrapolate)
            if (two_meshes) call add_pair('extrapolate', '"as needed"')
            if (.not. two_meshes) two_meshes = settings%simulation%extrapolate
            if (two_meshes) call add_pair('coarse_ratio', to_text(specimen%coarse_ratio))
         end if
      end if
      list = list_settings(settings)
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            if (all(['specimen  ', 'indenter  ', 'simulation'] /= v%group) &
               & .or. .not. allocated(v%values)) then
               cycle
            end if
            if (all(split_list(names) /= v%name)) cycle
            value = v%values(1)%text
            if (is_text(v)) value = '"'//value//'"'
            if (v%kind == 'logical') value = value(2:len(value) - 1)
            call add_pair(v%name, value)
         end associate
      end do
      identity = ''
      do i = 1, size(pairs)
         identity = identity//', '//pairs(i)%text
      end do
      identity = '{'//identity(3:)//'}'

   contains

      !> Insert a pair in sorted order.
      subroutine add_pair(name, value)
         !> Name of the variable; its value as JSON.
         character(len=*), intent(in) :: name, value
         type(value_type) :: pair
         integer :: i

         pair%text = '"'//name//'": '//value
         do i = 1, size(pairs)
            if (pairs(i)%text > pair%text) exit
         end do
         pairs = [pairs(:i - 1), pair, pairs(i:)]
      end subroutine add_pair
   end function identity_text
end module simulate
