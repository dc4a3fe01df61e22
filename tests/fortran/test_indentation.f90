!> Meshes by name, Hertz' solution, what a model states of its accuracy, and what is refused; the identity of a physics.
program test_indentation
   use errors, only: error_type, machine_failure
   use fe_indentation, only: free_indentation_model, indentation_model_type, indentation_result_type, new_indentation_model, &
      & simulate_indentation
   use fe_mesh, only: mesh_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: pi, wp
   use memory, only: check_memory, free_memory, memory_text
   use mesh_resolution, only: largest_mesh_error, resolution_warning
   use meshes, only: mesh_names, new_specimen_mesh, other_mesh
   use physics_identity, only: identity_text
   use settings_groups, only: simulation_settings_type
   use simulate, only: new_simulator, outcome_done, outcome_failed, outcome_type, simulator_type
   use specimen_mesh, only: specimen_mesh_type
   use testing, only: check, check_close, check_refused, check_success, finish, stiffness_of
   use text, only: split_list, to_text
   implicit none

   call test_meshes()
   call test_hertz()
   call test_resolution()
   call test_memory()
   call test_identity()
   call test_simulators()
   call test_refusals()
   call finish()

contains

   !> &simulation with nothing stated.
   function default_settings() result(settings)
      type(simulation_settings_type) :: settings

      settings%mesh = 'halfspace'
      settings%element = ''
      settings%integration = 'selective'
      settings%refine = 1.0_wp
      settings%radius_um = 16.0_wp
      settings%outer = 5.0_wp
      settings%growth = 1.13_wp
      settings%depths = 10
      settings%extrapolate = .false.
   end function default_settings

   !> Every mesh of the list can be made; another name is refused; each has another to compare with.
   subroutine test_meshes()
      character(len=len(mesh_names)), allocatable :: names(:)
      class(specimen_mesh_type), allocatable :: specimen
      type(simulation_settings_type) :: settings
      type(mesh_type) :: mesh
      type(error_type), allocatable :: error
      integer :: i

      settings = default_settings()
      allocate (names, source=split_list(mesh_names))
      do i = 1, size(names)
         settings%mesh = trim(names(i))
         call new_specimen_mesh(settings, specimen, error)
         call check_success('specimen '//names(i), error)
         call specimen%make(0.6_wp, specimen%contact_radius(16.0_wp), mesh, error)
         call check_success('mesh '//names(i), error)
         call check('contact nodes, and something that holds the mesh: '//names(i), size(mesh%contact) > 50 &
            & .and. (size(mesh%facet, 2) > 0 .neqv. size(mesh%clamped) > 0))
         call check('another mesh than '//names(i), other_mesh(settings%mesh) /= settings%mesh &
            & .and. any(names == other_mesh(settings%mesh)))
      end do
      settings%mesh = 'dome'
      call new_specimen_mesh(settings, specimen, error)
      call check_refused('an unknown mesh', error, "mesh: 'dome' is unknown; allowed: "//mesh_names)
   end subroutine test_meshes

   !> An isotropic half-space: close to E/(1-nu2), and the error of C3D8 falls with the square of the element size.
   subroutine test_hertz()
      real(wp), parameter :: refine(3) = [1.0_wp, 0.6_wp, 1.0_wp]
      character(len=5), parameter :: element(3) = ['c3d8i', 'c3d8 ', 'c3d8 ']
      type(simulation_settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: result
      type(error_type), allocatable :: error
      real(wp) :: errors(3), exact
      integer :: i

      ! C11 = 200, C12 = 80, C44 = 60 GPa is isotropic: E/(1-nu2) = (C11 - C12)(C11 + C12)/C11.
      exact = 168.0_wp
      settings = default_settings()
      do i = 1, 3
         settings%refine = refine(i)
         settings%element = trim(element(i))
         call new_indentation_model(settings, model, error)
         call check_success('a model of the half-space', error)
         if (allocated(error)) return
         call simulate_indentation(model, stiffness_of('cubic', [200.0_wp, 80.0_wp, 60.0_wp]), &
            & [0.1_wp, 0.2_wp, 0.3_wp], result, error)
         call check_success('indentation of an isotropic half-space', error)
         if (allocated(error)) return
         errors(i) = abs(result%modulus/exact - 1.0_wp)
         call check('contact conditions hold', result%contact_residual <= 1.0e-10_wp, to_text(result%contact_residual))
         call check('reactions balance the force', result%equilibrium_residual <= 1.0e-8_wp, &
            & to_text(result%equilibrium_residual))
         call free_indentation_model(model)
      end do
      call check('Hertz within 0.2 %', errors(1) < 0.002_wp, to_text(errors(1)))
      ! The edge of the contact lies between nodes, which adds a noise of 0.05 % to errors of 0.6 and 0.2 %.
      call check_close('observed order against Hertz', log(errors(2)/errors(3))/log(1.0_wp/0.6_wp), 2.0_wp, 0.5_wp)
   end subroutine test_hertz

   !> The stated error grows towards instability and falls with the mesh; an ordinary crystal has no warning.
   subroutine test_resolution()
      type(simulation_settings_type) :: settings
      real(wp) :: pair(6, 6, 2), coarse(2), fine(2), extrapolated(2), block(2)

      pair(:, :, 1) = stiffness_of('cubic', [168.4_wp, 121.4_wp, 75.4_wp])
      pair(:, :, 2) = stiffness_of('cubic', [130.0_wp, 125.0_wp, 100.0_wp])
      settings = default_settings()
      coarse = largest_mesh_error(settings, pair)
      settings%refine = 2.0_wp
      fine = largest_mesh_error(settings, pair)
      settings%refine = 1.0_wp
      settings%extrapolate = .true.
      extrapolated = largest_mesh_error(settings, pair)
      settings%extrapolate = .false.
      settings%mesh = 'paper'
      block = largest_mesh_error(settings, pair)
      call check('copper within 0.3 %, the other beyond 2 %', coarse(1) < 0.003_wp .and. coarse(2) > 0.02_wp, &
         & to_text(coarse(1))//' '//to_text(coarse(2)))
      call check('a finer mesh, extrapolation and the better element promise less', fine(2) < 0.5_wp*coarse(2) &
         & .and. extrapolated(2) < coarse(2) .and. block(2) > 2.0_wp*coarse(2))
      call check('no warning for copper', resolution_warning(coarse(:1)) == '')
      call check('a warning for the other', index(resolution_warning(coarse), '1 of 2 crystals are so near instability') &
         & == 1 .and. index(resolution_warning(coarse), '(rows 2)') > 0, resolution_warning(coarse))
   end subroutine test_resolution

   !> What the machine cannot hold is an error of the machine, not of the input.
   subroutine test_memory()
      type(error_type), allocatable :: error

      call check('some memory is free', free_memory() > 1.0e6_wp, memory_text(free_memory()))
      call check_memory(1.0e6_wp, 'a megabyte', error)
      call check_success('a megabyte', error)
      call check_memory(1.0e18_wp, 'a mesh', error)
      call check_refused('more than any machine has', error, 'too little memory for a mesh: 1000000 TB are needed')
      if (allocated(error)) call check('it is the machine''s fault', error%status == machine_failure)
   end subroutine test_memory

   subroutine test_refusals()
      type(simulation_settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: result
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp) :: elongated(6, 6)

      settings = default_settings()
      settings%refine = 0.6_wp
      call new_indentation_model(settings, model, error)
      call check_success('a coarse model', error)
      call simulate_indentation(model, stiffness_of('cubic', [100.0_wp, 120.0_wp, 60.0_wp]), [0.0_wp, 0.0_wp, 0.0_wp], &
         & result, error)
      call check_refused('an unstable crystal', error, 'unstable')
      ! Nearly unstable: the contact is a long ellipse.
      call simulate_indentation(model, stiffness_of('hexagonal', [100.0_wp, 99.9_wp, 50.0_wp, 100.0_wp, 50.0_wp]), &
         & [0.0_wp, 0.5_wp*pi, 0.0_wp], result, error)
      call check_refused('contact beyond the refined zone', error, 'the contact leaves the refined zone')
      ! A long ellipse that fits once the depths shrink.
      settings%refine = 1.0_wp
      call free_indentation_model(model)
      call new_indentation_model(settings, model, error)
      elongated = stiffness_of('hexagonal', [88.0_wp, 84.0_wp, 35.0_wp, 208.0_wp, 80.0_wp])
      call simulate_indentation(model, elongated, [270.0_wp, 80.0_wp, 0.0_wp]*pi/180.0_wp, result, error)
      call check_success('a long contact ellipse', error)
      call check('its depths have shrunk, and both solves count', result%depth(10) < 0.9_wp*model%depth(10) &
         & .and. result%elements == 2*model%elements)
      call halfspace_modulus(elongated, [270.0_wp, 80.0_wp, 0.0_wp]*pi/180.0_wp, theory, error)
      call check_close('its modulus', result%modulus/theory%modulus, 1.0_wp, 0.01_wp)
      call free_indentation_model(model)
      settings%refine = 0.3_wp
      call new_indentation_model(settings, model, error)
      call check_refused('too coarse a mesh', error, 'elements at the last depth')
      settings%refine = 4.0_wp
      call new_indentation_model(settings, model, error)
      call check_refused('too fine a mesh', error, 'elements is too large; allowed: up to 400000')
   end subroutine test_refusals

   !> The texts under which campaigns were stored, to the letter.
   subroutine test_identity()
      type(simulation_settings_type) :: settings

      settings = default_settings()
      settings%simulator = 'fe'
      call check('of finite elements', identity_text(settings) == '{"depths": 10, "element": "", "estimator": ' &
         & //'"least squares through the origin", "extrapolate": false, "integration": "selective", "mesh": "halfspace", ' &
         & //'"numerics": 3, "radius_um": 16.0, "refine": 1.0, "simulator": "fe"}', identity_text(settings))
      settings%outer = 8.0_wp
      settings%growth = 1.05_wp
      settings%radius_um = 1.0e-5_wp
      call check('of a study', index(identity_text(settings), '"growth": 1.05, "integration"') > 0 &
         & .and. index(identity_text(settings), '"outer": 8.0, "radius_um": 1e-05, ') > 0, identity_text(settings))
      settings%simulator = 'theory'
      call check('of the theory', identity_text(settings) == '{"simulator": "theory"}', identity_text(settings))
   end subroutine test_identity

   !> Each simulator in its place: results, failures of the crystal, and errors that are none.
   subroutine test_simulators()
      real(wp), parameter :: euler(3) = [0.1_wp, 0.5_wp*pi, 0.0_wp]
      type(simulation_settings_type) :: settings
      class(simulator_type), allocatable :: simulator
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error
      real(wp) :: copper(6, 6)

      copper = stiffness_of('cubic', [168.4_wp, 121.4_wp, 75.4_wp])
      settings = default_settings()
      settings%refine = 0.6_wp
      settings%simulator = 'theory'
      call new_simulator(settings, simulator, error)
      call simulator%run(copper, euler, outcome, error)
      call check('theory gives a modulus and no curve', outcome%status == outcome_done .and. outcome%modulus > 100.0_wp &
         & .and. size(outcome%depth) == 0)
      settings%simulator = 'import'
      call new_simulator(settings, simulator, error)
      call check_refused('import simulates nothing', error, "'import' cannot simulate")
      settings%simulator = 'fe'
      call new_simulator(settings, simulator, error)
      call check_success('finite elements', error)
      call simulator%run(copper, euler, outcome, error)
      call check('a modulus and a curve', outcome%status == outcome_done .and. size(outcome%force) == 10 &
         & .and. outcome%elements > 3000)
      call simulator%run(stiffness_of('hexagonal', [100.0_wp, 99.9_wp, 50.0_wp, 100.0_wp, 50.0_wp]), euler, outcome, error)
      call check_success('a crystal that cannot be simulated is an outcome', error)
      call check('with its message', outcome%status == outcome_failed .and. index(outcome%message, 'refined zone') > 0, &
         & outcome%message)
      call simulator%run(stiffness_of('cubic', [100.0_wp, 120.0_wp, 60.0_wp]), euler, outcome, error)
      call check_refused('an unstable crystal is bad input', error, 'unstable')
   end subroutine test_simulators
end program test_indentation
