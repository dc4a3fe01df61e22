!> Indenters, Hertz' solution, what a model states of its accuracy, and what is refused; the
!> identity of a physics.
program test_indentation
   use diagnostics, only: diagnostic_type
   use errors, only: error_type, machine_failure
   use fe_indentation, only: free_indentation_model, indentation_model_type, &
      & indentation_result_type, new_indentation_model, simulate_indentation
   use indenters, only: indenter_names, indenter_type, new_indenter
   use kinds, only: pi, wp
   use machine, only: check_memory, free_memory, memory_text
   use namelist_file, only: entry_type, parse_namelist
   use settings_list, only: settings_list_type
   use settings_reader, only: read_settings
   use settings_schema, only: list_settings, settings_type
   use simulate, only: identity_text, new_simulator, outcome_done, outcome_failed, outcome_type, &
      & simulation_error, simulator_type
   use specimens, only: geometry_names
   use testing, only: check, check_close, check_refused, check_success, clenshaw_curtis_weight, &
      & default_settings, finish, stiffness_of
   use text, only: split_list, to_text
   implicit none

   call test_indenters()
   call test_sneddon()
   call test_hertz()
   call test_resolution()
   call test_memory()
   call test_identity()
   call test_identity_is_complete()
   call test_simulators()
   call test_refusals()
   call finish()

contains

   !> The list comes from the module.
   subroutine test_indenters()
      character(len=len(indenter_names)), allocatable :: names(:)
      integer :: i

      allocate (names, source=split_list(indenter_names))
      do i = 1, size(names)
         call test_any_indenter(trim(names(i)))
      end do
      call test_shapes()
   end subroutine test_indenters

   !> What any indenter does. Its gap is zero at the apex, grows with the distance from the axis,
   !> and is convex and smooth. Depth and force at a contact radius on the isotropic half-space are
   !> the integrals of Galin and Sneddon over the slope of the gap. The contact radius is the
   !> inverse of the depth, and the contact stiffness is 2 a M (Sneddon). A last point that is
   !> stated by its depth is that of its contact radius. The numbers of &indenter that change the
   !> gap are those that the indenter names.
   subroutine test_any_indenter(name)
      character(len=*), intent(in) :: name
      integer, parameter :: many = 200
      real(wp), parameter :: radii(7) = [1.0e-5_wp, 0.01_wp, 0.5_wp, 2.3_wp, 2.5_wp, 9.0_wp, &
         & 15.5_wp]
      type(settings_type) :: settings
      class(indenter_type), allocatable :: indenter, other
      type(error_type), allocatable :: error
      real(wp) :: h, dh, slope, gap(0:many), slopes(many), integrals(2), sine
      integer :: i, j

      settings = default_settings()
      settings%indenter%shape = name
      call new_indenter(settings%indenter, indenter, error)
      call check_success('any '//name, error)
      do j = 1, size(radii)
         gap = indenter%gap([(radii(j)*i/many, i=0, many)])
         slopes = gap(1:) - gap(:many - 1)
         call check('any '//name//': zero at the apex', abs(gap(0)) <= 0.0_wp)
         call check('any '//name//': convex and growing', all(slopes > 0.0_wp) &
            & .and. all(slopes(2:) >= slopes(:many - 1)*(1.0_wp - 1.0e-11_wp)))
         ! The slope has no jump.
         call check('any '//name//': smooth', all(abs(slopes(3:) - 2.0_wp*slopes(2:many - 1) &
            & + slopes(:many - 2)) < 0.02_wp*slopes(3:)))
         h = indenter%depth_of(radii(j))
         integrals = [0.0_wp, 0.0_wp]
         do i = 0, many
            sine = sin(0.25_wp*pi*(1.0_wp - cos(pi*i/many)))
            slope = clenshaw_curtis_weight(i, many) &
                   & *slope_of(indenter, radii(j)*max(sine, 1.0e-7_wp))
            integrals = integrals + 0.5_wp*pi*radii(j)*slope*[0.5_wp, radii(j)*sine**2]
         end do
         call check_close('any '//name//': depth by the slope of the gap', integrals(1)/h, 1.0_wp, &
            & 1.0e-7_wp)
         call check_close('any '//name//': force by the slope of the gap', &
            & integrals(2)/indenter%unit_force(h), 1.0_wp, 1.0e-7_wp)
         call check_close('any '//name//': contact radius of the depth of a contact radius', &
            & indenter%contact_radius_of(h)/radii(j), 1.0_wp, 1.0e-12_wp)
         dh = 1.0e-3_wp*h
         slope = (8.0_wp*(indenter%unit_force(h + dh) - indenter%unit_force(h - dh)) &
            & - indenter%unit_force(h + 2.0_wp*dh) + indenter%unit_force(h - 2.0_wp*dh)) &
            & /(12.0_wp*dh)
         call check_close('any '//name//': stiffness of the contact', slope/(2.0_wp*radii(j)), &
            & 1.0_wp, 1.0e-9_wp)
      end do
      call check_close('any '//name//': the last point', indenter%contact_radius, 0.5_wp, &
         & 1.0e-15_wp)
      settings%indenter%depth_um = indenter%depth
      deallocate (settings%indenter%contact_radius_um)
      call new_indenter(settings%indenter, other, error)
      call check_close('any '//name//': stated by its depth', other%contact_radius, 0.5_wp, &
         & 1.0e-13_wp)
      call test_names_of_variables(name, indenter)
   end subroutine test_any_indenter

   !> Derivative of the gap at a distance from the axis, by differences.
   pure real(wp) function slope_of(indenter, r)
      class(indenter_type), intent(in) :: indenter
      real(wp), intent(in) :: r
      real(wp) :: step

      step = 1.0e-4_wp*r
      slope_of = (8.0_wp*(indenter%gap(r + step) - indenter%gap(r - step)) &
         & - indenter%gap(r + 2.0_wp*step) + indenter%gap(r - 2.0_wp*step))/(12.0_wp*step)
   end function slope_of

   !> Change each number of &indenter, and see whether the gap changes.
   subroutine test_names_of_variables(name, indenter)
      character(len=*), intent(in) :: name
      class(indenter_type), intent(in) :: indenter
      class(indenter_type), allocatable :: other
      type(settings_list_type) :: schema
      type(settings_type) :: settings, changed
      type(entry_type), allocatable :: file(:)
      type(error_type), allocatable :: error
      integer :: i

      settings = default_settings()
      schema = list_settings(settings)
      do i = 1, size(schema%variables)
         associate (v => schema%variables(i))
            if (v%group /= 'indenter' .or. v%kind /= 'real' .or. v%name == 'depth_um' &
               & .or. v%name == 'contact_radius_um') cycle
            call parse_namelist("&indenter contact_radius_um = 0.5, shape = '"//name//"', " &
               & //v%name//' = 30 /', file, error)
            call read_settings(file, '', '', changed, error)
            if (.not. allocated(error)) call new_indenter(changed%indenter, other, error)
            call check_success('any '//name//': '//v%name, error)
            if (allocated(error)) cycle
            call check('any '//name//': '//v%name//' is named if it counts', &
               & abs(other%gap(0.4_wp) - indenter%gap(0.4_wp)) > 0.0_wp &
               & .eqv. index(', '//indenter%variables//',', ', '//v%name//',') > 0)
         end associate
      end do
   end subroutine test_names_of_variables

   !> Gaps and forces of each shape; a small sphere is a paraboloid.
   subroutine test_shapes()
      type(settings_type) :: settings
      class(indenter_type), allocatable :: paraboloid, sphere, cone
      type(error_type), allocatable :: error
      real(wp), parameter :: a = 8.0_wp

      settings = default_settings()
      call new_indenter(settings%indenter, paraboloid, error)
      settings%indenter%shape = 'sphere'
      call new_indenter(settings%indenter, sphere, error)
      settings%indenter%shape = 'cone'
      settings%indenter%half_angle_deg = 60.0_wp
      call new_indenter(settings%indenter, cone, error)
      call check_close('gap of a paraboloid', paraboloid%gap(a), 2.0_wp, 1.0e-14_wp)
      call check_close('gap of a sphere', sphere%gap(a), 16.0_wp - sqrt(192.0_wp), 1.0e-14_wp)
      call check('no sphere beyond its radius', sphere%gap(16.0_wp) > 100.0_wp &
         & .and. sphere%gap(40.0_wp) > 100.0_wp)
      call check_close('gap of a cone', cone%gap(a), a/sqrt(3.0_wp), 1.0e-14_wp)
      ! a = R/2: h = (R/4) ln 3, P/M = (R2/8) (5 ln 3 - 4).
      call check_close('depth of a sphere', sphere%depth_of(a), 4.0_wp*log(3.0_wp), 1.0e-14_wp)
      call check_close('force under a sphere', sphere%unit_force(4.0_wp*log(3.0_wp)), &
         & 32.0_wp*(5.0_wp*log(3.0_wp) - 4.0_wp), 1.0e-12_wp)
      call check_close('force under a cone', cone%unit_force(1.0_wp), &
         & 2.0_wp*sqrt(3.0_wp)/pi, 1.0e-14_wp)
      ! P = 4/3 sqrt(R) h^1.5 (1 - (1/10) h/R ..): the series of both in a/R, to second order.
      call check_close('a small sphere is a paraboloid', sphere%unit_force(1.6e-3_wp) &
         & /paraboloid%unit_force(1.6e-3_wp), 1.0_wp - 1.0e-5_wp, 1.0e-8_wp)
      settings = default_settings()
      settings%indenter%shape = 'sphere'
      settings%indenter%contact_radius_um = 16.0_wp
      call new_indenter(settings%indenter, sphere, error)
      call check_refused('a contact as wide as the sphere', error, &
         & 'contact_radius_um: 16.0 um is beyond the tip; allowed below')
      settings%indenter%shape = 'pyramid'
      call new_indenter(settings%indenter, sphere, error)
      call check_refused('an unknown shape', error, &
         & "shape: 'pyramid' is unknown; allowed: "//indenter_names)
   end subroutine test_shapes

   !> True sphere and cone on an isotropic half-space: force at each resolved depth, contact radius,
   !> and the modulus by depth.
   subroutine test_sneddon()
      character(len=6), parameter :: shapes(3) = ['sphere', 'sphere', 'cone  ']
      !> Radius of the indenter over the last contact radius; relative errors allowed.
      real(wp), parameter :: radius(3) = [5.0_wp, 1.0_wp/0.6_wp, 16.0_wp], &
         & tolerance(3) = [5.0e-3_wp, 5.0e-3_wp, 1.0e-2_wp]
      type(settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: result
      type(error_type), allocatable :: error
      real(wp) :: exact, worst
      integer :: i

      exact = 168.0_wp
      do i = 1, 3
         settings = default_settings()
         settings%indenter%shape = trim(shapes(i))
         settings%indenter%radius_um = radius(i)
         call new_indentation_model(settings, model, error)
         call check_success('a model', error)
         call simulate_indentation(model, stiffness_of('cubic', [200.0_wp, 80.0_wp, 60.0_wp]), &
            & [0.1_wp, 0.2_wp, 0.3_wp], result, error)
         call check_success('its simulation', error)
         if (allocated(error)) return
         associate (indenter => model%indenter)
            worst = maxval(abs(result%force(6:)/(exact*indenter%unit_force(result%depth(6:))) &
               & - 1.0_wp))
            call check('force by Sneddon: '//shapes(i), worst < tolerance(i), to_text(worst))
            call check_close('modulus', result%modulus/exact, 1.0_wp, tolerance(i))
            call check_close('modulus of the last depth', result%modulus_by_depth(10), &
               & result%force(10)/indenter%unit_force(result%depth(10)), 1.0e-9_wp)
            worst = maxval(abs(result%contact_radius - indenter%contact_radius_of(result%depth)))
            call check('contact radius within one element: '//shapes(i), &
               & worst < model%grid(1)%mesh%element_size, to_text(worst))
         end associate
         call free_indentation_model(model)
      end do
   end subroutine test_sneddon

   !> An isotropic half-space: close to E/(1-nu2), and the error of C3D8 falls with the square of
   !> the element size.
   subroutine test_hertz()
      real(wp), parameter :: refine(3) = [1.0_wp, 0.6_wp, 1.0_wp]
      character(len=5), parameter :: element(3) = ['c3d8i', 'c3d8 ', 'c3d8 ']
      type(settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: result
      type(error_type), allocatable :: error
      real(wp) :: errors(3), exact
      integer :: i

      ! C11 = 200, C12 = 80, C44 = 60 GPa is isotropic: E/(1-nu2) = (C11 - C12)(C11 + C12)/C11.
      exact = 168.0_wp
      settings = default_settings()
      do i = 1, 3
         settings%simulation%refine = refine(i)
         settings%simulation%element = trim(element(i))
         call new_indentation_model(settings, model, error)
         call check_success('a model of the half-space', error)
         if (allocated(error)) return
         call simulate_indentation(model, stiffness_of('cubic', [200.0_wp, 80.0_wp, 60.0_wp]), &
            & [0.1_wp, 0.2_wp, 0.3_wp], result, error)
         call check_success('indentation of an isotropic half-space', error)
         if (allocated(error)) return
         errors(i) = abs(result%modulus/exact - 1.0_wp)
         call check('contact conditions hold', result%contact_residual <= 1.0e-10_wp, &
            & to_text(result%contact_residual))
         call check('reactions balance the force', result%equilibrium_residual <= 1.0e-8_wp, &
            & to_text(result%equilibrium_residual))
         call free_indentation_model(model)
      end do
      call check('Hertz within 0.2 %', errors(1) < 0.002_wp, to_text(errors(1)))
      ! The edge of the contact lies between nodes, which adds a noise of 0.05 % to errors of 0.6
      ! and 0.2 %.
      call check_close('observed order against Hertz', &
         & log(errors(2)/errors(3))/log(1.0_wp/0.6_wp), 2.0_wp, 0.5_wp)
   end subroutine test_hertz

   !> The stated error grows towards instability and falls with the mesh; an ordinary crystal has no
   !> warning.
   subroutine test_resolution()
      type(settings_type) :: settings
      type(indentation_model_type) :: model
      type(error_type), allocatable :: error
      real(wp) :: pair(6, 6, 2), coarse(2), fine(2), extrapolated(2), automatic(2), block(2)
      type(diagnostic_type), allocatable :: warning(:)

      pair(:, :, 1) = stiffness_of('cubic', [168.4_wp, 121.4_wp, 75.4_wp])
      pair(:, :, 2) = stiffness_of('cubic', [130.0_wp, 125.0_wp, 100.0_wp])
      settings = default_settings()
      call simulation_error(settings, pair, coarse, warning)
      settings%simulation%refine = 2.0_wp
      call simulation_error(settings, pair, fine, warning)
      settings%simulation%refine = 1.0_wp
      settings%simulation%extrapolate = .true.
      call simulation_error(settings, pair, extrapolated, warning)
      deallocate (settings%simulation%extrapolate)
      call simulation_error(settings, pair, automatic, warning)
      call check('what is not stated is as needed', .not. any(abs(automatic &
         & - [coarse(1), extrapolated(2)]) > 0.0_wp) .and. extrapolated(1) < coarse(1))
      call check('what remains is warned of', is_of(warning, 'mesh_error', [1.0_wp, 2.0_wp]) &
         & .and. nint(warning(1)%numbers(4)) == 2)
      settings%simulation%extrapolate = .false.
      settings%specimen%geometry = 'block'
      call simulation_error(settings, pair, block, warning)
      call check('copper within 0.3 %, the other beyond 2 %', coarse(1) < 0.003_wp &
         & .and. coarse(2) > 0.02_wp, to_text(coarse(1))//' '//to_text(coarse(2)))
      call check('a finer mesh, extrapolation and the better element promise less', fine(2) &
         & < 0.5_wp*coarse(2) .and. extrapolated(2) < coarse(2) .and. block(2) > 1.5_wp*coarse(2))
      call simulation_error(settings, pair(:, :, :1), block(:1), warning)
      call check('C3D8 on a block are 2.5 % too stiff', is_of(warning, 'layers_error', [2.5_wp]) &
         & .and. block(1) < 0.006_wp)
      settings%simulation%element = 'c3d8i'
      call simulation_error(settings, pair(:, :, :1), block(:1), warning)
      call check('no warning for copper with C3D8I', size(warning) == 0)
      call simulation_error(settings, pair, block, warning)
      call check('a warning for the other', is_of(warning, 'mesh_error', [1.0_wp, 2.0_wp]) &
         & .and. nint(warning(1)%numbers(4)) == 2)
      settings%simulation%element = 'c3d8'
      settings%simulation%extrapolate = .true.
      call new_indentation_model(settings, model, error)
      call check_refused('C3D8 on a block are not extrapolated', error, 'use element = ''c3d8i''')
   end subroutine test_resolution

   !> Whether there is one diagnostic of this code, whose first numbers are these.
   logical function is_of(list, code, numbers)
      type(diagnostic_type), intent(in) :: list(:)
      character(len=*), intent(in) :: code
      real(wp), intent(in) :: numbers(:)

      is_of = size(list) == 1
      if (.not. is_of) return
      is_of = list(1)%code == code &
         & .and. all(abs(list(1)%numbers(:size(numbers)) - numbers) < 1.0e-9_wp)
   end function is_of

   !> What the machine cannot hold is an error of the machine, not of the input.
   subroutine test_memory()
      type(error_type), allocatable :: error

      call check('some memory is free', free_memory() > 1.0e6_wp, memory_text(free_memory()))
      call check_memory(1.0e6_wp, 'a megabyte', error)
      call check_success('a megabyte', error)
      call check_memory(1.0e18_wp, 'a mesh', error)
      call check_refused('more than any machine has', error, &
         & 'too little memory for a mesh: 1.00E+009 GB are needed')
      if (allocated(error)) then
         call check('it is the machine''s fault', error%status == machine_failure)
      end if
   end subroutine test_memory

   subroutine test_refusals()
      type(settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: result
      type(error_type), allocatable :: error

      settings = default_settings()
      settings%simulation%refine = 0.7_wp
      settings%specimen%geometry = 'grain'
      settings%specimen%grain_radius_um = 1.5_wp
      call new_indentation_model(settings, model, error)
      call check_success('a coarse model', error)
      call simulate_indentation(model, stiffness_of('cubic', [100.0_wp, 120.0_wp, 60.0_wp]), &
         & [0.0_wp, 0.0_wp, 0.0_wp], result, error)
      call check_refused('an unstable crystal', error, 'unstable')
      ! Nearly unstable: the contact is an ellipse longer than the small grain holds.
      call simulate_indentation(model, stiffness_of('hexagonal', [100.0_wp, 99.9_wp, 50.0_wp, &
         & 100.0_wp, 50.0_wp]), [0.0_wp, 0.5_wp*pi, 0.0_wp], result, error)
      call check_refused('contact beyond the refined zone', error, &
         & 'and no wider zone can be made: grain_radius_um: 1.5 um does not hold')
      call free_indentation_model(model)
      settings%specimen%geometry = 'halfspace'
      settings%simulation%refine = 0.3_wp
      call new_indentation_model(settings, model, error)
      call check_refused('too coarse a mesh', error, 'elements at the last depth')
      settings%simulation%refine = 4.0_wp
      call new_indentation_model(settings, model, error)
      call check_refused('too fine a mesh', error, 'elements is too large; allowed: up to 400000')
   end subroutine test_refusals

   !> The texts under which campaigns were stored, to the letter.
   subroutine test_identity()
      type(settings_type) :: settings

      settings = default_settings()
      call check('of the half-space', identity_text(settings) == '{"contact_radius_um": ' &
         & //'0.5, "depths": 10, "element": "", "estimator": "curve", "extrapolate": ' &
         & //'false, "geometry": "halfspace", "growth": ' &
         & //'1.13, "integration": "selective", "numerics": 7, "outer": 5.0, "radius_um": ' &
         & //'16.0, "refine": 1.0, "shape": "paraboloid", "simulator": "fe"}', &
         & identity_text(settings))
      settings%specimen%geometry = 'block'
      settings%indenter%shape = 'cone'
      settings%indenter%depth_um = 0.25_wp
      deallocate (settings%indenter%contact_radius_um)
      call check('of a block', identity_text(settings) == '{"depth_um": ' &
         & //'0.25, "depths": 10, "element": "", "estimator": "curve", "extrapolate": ' &
         & //'false, "geometry": "block", "half_angle_deg": 70.3, "height_um": ' &
         & //'4.8, "integration": "selective", "numerics": 7, "refine": ' &
         & //'1.0, "shape": "cone", "simulator": "fe", "width_um": 9.6}', identity_text(settings))
      settings%simulation%simulator = 'theory'
      call check('of the theory', identity_text(settings) == '{"simulator": "theory"}', &
         & identity_text(settings))
   end subroutine test_identity

   !> Every variable of the three groups is in the identity of some specimen and indenter, but for
   !> those of films, which are not simulated, and those that change no result.
   subroutine test_identity_is_complete()
      character(len=19), parameter :: change_nothing(10) = [character(len=19) :: 'vtu', 'inp', &
         & 'thickness_um', 'substrate', 'substrate_young_gpa', 'substrate_nu', &
         & 'substrate_symmetry', 'substrate_constants', 'substrate_euler_deg', 'layers']
      character(len=len(geometry_names)), allocatable :: geometries(:)
      character(len=len(indenter_names)), allocatable :: shapes(:)
      character(len=:), allocatable :: identities
      type(settings_list_type) :: schema
      type(settings_type) :: settings
      integer :: i, j

      settings = default_settings()
      settings%specimen%matrix = 'isotropic'
      settings%specimen%grain_radius_um = 2.0_wp
      settings%specimen%matrix_young_gpa = 100.0_wp
      settings%indenter%depth_um = 0.01_wp
      allocate (geometries, source=split_list(geometry_names))
      allocate (shapes, source=split_list(indenter_names))
      identities = ''
      do i = 1, size(geometries)
         do j = 1, size(shapes)
            settings%specimen%geometry = trim(geometries(i))
            settings%indenter%shape = trim(shapes(j))
            identities = identities//identity_text(settings)
         end do
      end do
      schema = list_settings(settings)
      do i = 1, size(schema%variables)
         associate (group => schema%variables(i)%group, name => schema%variables(i)%name)
            if (all(['specimen  ', 'indenter  ', 'simulation'] /= group)) cycle
            call check(name//' is part of the identity, or changes no result', index(identities, &
               & '"'//name//'": ') > 0 .neqv. any(change_nothing == name), identities)
         end associate
      end do
   end subroutine test_identity_is_complete

   !> Each simulator in its place: results, failures of the crystal, and errors that are none.
   subroutine test_simulators()
      real(wp), parameter :: euler(3) = [0.1_wp, 0.5_wp*pi, 0.0_wp]
      type(settings_type) :: settings
      type(simulator_type) :: simulator
      type(outcome_type) :: outcome
      type(error_type), allocatable :: error
      real(wp) :: copper(6, 6)

      copper = stiffness_of('cubic', [168.4_wp, 121.4_wp, 75.4_wp])
      settings = default_settings()
      settings%simulation%refine = 0.7_wp
      settings%simulation%simulator = 'theory'
      call new_simulator(settings, simulator, error)
      call simulator%run(copper, euler, outcome, error)
      call check('theory gives a modulus and no curve', outcome%status == outcome_done &
         & .and. outcome%modulus > 100.0_wp .and. size(outcome%depth) == 0)
      settings%simulation%simulator = 'import'
      call new_simulator(settings, simulator, error)
      call check_refused('import simulates nothing', error, "'import' cannot simulate")
      settings%simulation%simulator = 'fe'
      call new_simulator(settings, simulator, error)
      call check_success('finite elements', error)
      call simulator%run(copper, euler, outcome, error)
      call check('a modulus and a curve', outcome%status == outcome_done &
         & .and. size(outcome%force) == 10 .and. outcome%elements > 3000)
      settings%specimen%geometry = 'grain'
      settings%specimen%grain_radius_um = 1.5_wp
      call new_simulator(settings, simulator, error)
      call simulator%run(stiffness_of('hexagonal', &
         & [100.0_wp, 99.9_wp, 50.0_wp, 100.0_wp, 50.0_wp]), euler, outcome, error)
      call check_success('a crystal that cannot be simulated is an outcome', error)
      call check('with its message', outcome%status == outcome_failed &
         & .and. index(outcome%message, 'refined zone') > 0, outcome%message)
      call simulator%run(stiffness_of('cubic', [100.0_wp, 120.0_wp, 60.0_wp]), euler, &
         & outcome, error)
      call check_refused('an unstable crystal is bad input', error, 'unstable')
   end subroutine test_simulators
end program test_indentation
