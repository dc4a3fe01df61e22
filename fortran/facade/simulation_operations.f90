!> Operations on problems (settings and tables of a namelist), their simulators, finite-element
!> models, and stages. Stiffnesses are in crystal axes, GPa; angles in degrees.
!>
!> A stage, see `abstract_stage`, returns the simulations to make, and receives their outcomes.
module simulation_operations
   use abstract_basis, only: basis_type
   use abstract_stage, only: stage_type
   use build_checks, only: basis_of_problem
   use build_stage, only: build_stage_type
   use campaign_import, only: import_table
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use diagnostics, only: diagnostic_type, diagnostics_text
   use exchange, only: exchange_type
   use fe_element, only: brick_stress, infinite_stiffness
   use fe_indentation, only: indentation_model_type, indentation_result_type, &
      & new_indentation_model, new_wider_model, simulate_indentation
   use film_theory, only: film_type, indent_films
   use kinds, only: degree, wp
   use named_values, only: named_values_type
   use point_tables, only: points_type
   use problem, only: problem_type
   use resolved_namelist, only: resolved_text
   use settings_reader, only: put_settings, settings_namelist
   use simulate, only: new_simulator, outcome_type, simulation_error, simulator_type
   use stage_documents, only: begin_results, inputs_of, write_canonical
   use stages, only: check_stages, load_problem, new_stage
   use surrogate_operations, only: give_basis
   use tables, only: write_table
   use text, only: add_line, join, line_type
   implicit none
   private
   public :: run_simulator, use_indentation, use_stage, use_problem

contains

   !> Simulate one crystal, and return the outcome.
   subroutine run_simulator(simulator, x)
      type(simulator_type), intent(in) :: simulator
      type(exchange_type), intent(inout) :: x
      type(outcome_type) :: outcome

      !> simulator.run: stiffness, euler_deg -> status, modulus_gpa, seconds, elements, depth_um,
      !> force_mn, modulus_by_stiffness, message
      call simulator%run(x%in%columns('stiffness', 6), degree*x%in%reals('euler_deg'), &
         & outcome, x%error)
      if (allocated(x%error)) return
      call x%out%put('status', outcome%status)
      call x%out%put('modulus_gpa', outcome%modulus)
      call x%out%put('seconds', outcome%seconds)
      call x%out%put('elements', outcome%elements)
      call x%out%put('depth_um', outcome%depth)
      call x%out%put('force_mn', outcome%force)
      call x%out%put('modulus_by_stiffness', outcome%by_stiffness)
      call x%out%put('message', outcome%message)
   end subroutine run_simulator

   subroutine use_indentation(verb, model, x)
      character(len=*), intent(in) :: verb
      type(indentation_model_type), intent(in) :: model
      type(exchange_type), intent(inout) :: x
      type(indentation_model_type) :: wider
      type(indentation_result_type) :: result

      select case (verb)
      case ('describe')
         !> -> element, parts, elements, depths, depth_max_um, contact_radius_max_um, meshes,
         !> factor_entries, factor_operations, workspace_bytes, unknowns, nodes, bricks,
         !> infinite_elements
         call describe_model(x%out)
      case ('run')
         !> stiffness, euler_deg -> indentation_modulus_gpa, depth_um, force_mn,
         !> modulus_by_depth_gpa, contact_radius_um, elements, seconds, seconds_factor,
         !> modulus_slope_gpa, modulus_last_gpa, modulus_of_mesh_gpa, contact_residual,
         !> equilibrium_residual, modulus_by_stiffness, modulus_by_rotation_gpa
         call simulate_indentation(model, x%in%columns('stiffness', 6), &
            & degree*x%in%reals('euler_deg'), result, x%error)
         if (allocated(x%error)) return
         call x%out%put('indentation_modulus_gpa', result%modulus)
         call x%out%put('depth_um', result%depth)
         call x%out%put('force_mn', result%force)
         call x%out%put('modulus_by_depth_gpa', result%modulus_by_depth)
         call x%out%put('contact_radius_um', result%contact_radius)
         call x%out%put('elements', result%elements)
         call x%out%put('seconds', result%seconds)
         call x%out%put('seconds_factor', result%seconds_factor)
         call x%out%put('modulus_slope_gpa', result%modulus_slope)
         call x%out%put('modulus_last_gpa', result%modulus_by_depth(size(result%depth)))
         call x%out%put('modulus_of_mesh_gpa', result%modulus_of_mesh)
         call x%out%put('contact_residual', result%contact_residual)
         call x%out%put('equilibrium_residual', result%equilibrium_residual)
         call x%out%put('modulus_by_stiffness', result%by_stiffness)
         call x%out%put('modulus_by_rotation_gpa', result%by_rotation)
      case ('fields')
         !> stiffness, euler_deg, step -> x, gap, brick, material, facet, contact, clamped, hanging,
         !> master, displacement_um, materials, infinite, depth_um, values
         call simulate_indentation(model, x%in%columns('stiffness', 6), &
            & degree*x%in%reals('euler_deg'), result, x%error, x%in%integer('step'))
         if (allocated(x%error)) return
         if (result%zone > 1.0_wp) then
            call new_wider_model(model, result%zone, wider, x%error)
            if (.not. allocated(x%error)) call put_fields(wider, result, x)
         else
            call put_fields(model, result, x)
         end if
      case default
         call x%refuse(verb)
      end select

   contains

      !> Put sizes and costs, summed over the meshes, and numbers of nodes and elements of the
      !> finest.
      subroutine describe_model(out)
         type(named_values_type), intent(inout) :: out

         call out%put('element', model%specimen%element)
         call out%put('parts', model%specimen%parts)
         call out%put('elements', model%elements)
         call out%put('depths', size(model%depth))
         call out%put('depth_max_um', model%indenter%depth)
         call out%put('contact_radius_max_um', model%indenter%contact_radius)
         call out%put('meshes', size(model%grid))
         call out%put('factor_entries', sum(model%grid%cholesky%entries))
         call out%put('factor_operations', sum(model%grid%cholesky%operations))
         call out%put('workspace_bytes', sum(model%grid%cholesky%bytes))
         call out%put('unknowns', model%grid(1)%assembly%unknowns)
         associate (mesh => model%grid(1)%mesh)
            call out%put('nodes', size(mesh%x, 2))
            call out%put('bricks', size(mesh%brick, 2))
            call out%put('infinite_elements', size(mesh%facet, 2))
         end associate
      end subroutine describe_model
   end subroutine use_indentation

   !> Put the finest mesh of a simulation, and its fields: displacement of the nodes (um), mean
   !> stress of the bricks (GPa, order 11,22,33,23,13,12), stiffness of the materials in the axes of
   !> the sample (GPa) and of each infinite element (mN/um).
   subroutine put_fields(model, result, x)
      type(indentation_model_type), intent(in) :: model
      type(indentation_result_type), intent(in) :: result
      type(exchange_type), intent(inout) :: x
      real(wp), allocatable :: c(:, :, :), infinite(:, :, :)
      integer :: i

      c = model%specimen%materials(rotate_stiffness(x%in%columns('stiffness', 6), &
         & rotation_matrix(degree*x%in%reals('euler_deg'))))
      call put_mesh(x%out)
      associate (mesh => model%grid(1)%mesh)
         allocate (x%values(6, size(mesh%brick, 2)), infinite(12, 12, size(mesh%facet, 2)))
         do i = 1, size(mesh%brick, 2)
            call brick_stress(mesh%x(:, mesh%brick(:, i)), c(:, :, mesh%material(i)), &
               & model%formulation, mesh%growth(i), result%displacement(:, mesh%brick(:, i)), &
               & x%values(:, i))
         end do
         do i = 1, size(infinite, 3)
            call infinite_stiffness(mesh%x(:, mesh%facet(:, i)), c(:, :, mesh%facet_material(i)), &
               & infinite(:, :, i))
         end do
      end associate
      call x%out%put('displacement_um', result%displacement)
      call x%out%put('materials', c)
      call x%out%put('infinite', infinite)
      call x%out%put('depth_um', result%depth)

   contains

      !> Put the finest mesh: nodes (um), and tables of node numbers, which begin at 0. A hanging
      !> node follows the mean of its masters; unused places of them are -1.
      subroutine put_mesh(out)
         type(named_values_type), intent(inout) :: out

         associate (mesh => model%grid(1)%mesh)
            call out%put('x', mesh%x)
            call out%put_array('gap', model%grid(1)%gap, shape(mesh%contact))
            call out%put_integers('brick', mesh%brick - 1, shape(mesh%brick))
            call out%put_integers('material', mesh%material - 1, shape(mesh%material))
            call out%put_integers('facet', mesh%facet - 1, shape(mesh%facet))
            call out%put_integers('contact', mesh%contact - 1, shape(mesh%contact))
            call out%put_integers('clamped', mesh%clamped - 1, shape(mesh%clamped))
            call out%put_integers('hanging', mesh%hanging - 1, shape(mesh%hanging))
            call out%put_integers('master', mesh%master - 1, shape(mesh%master))
         end associate
      end subroutine put_mesh
   end subroutine put_fields

   subroutine use_stage(verb, stage, x)
      character(len=*), intent(in) :: verb
      class(stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x
      type(outcome_type) :: outcome
      integer, allocatable :: numbers(:)
      integer :: i

      select case (verb)
      case ('want')
         !> -> number, stiffness, euler_deg
         ! Numbers, stiffnesses (GPa, crystal axes) and angles (degrees) of the simulations to make.
         call stage%want(x%error)
         if (allocated(x%error)) return
         associate (jobs => stage%jobs)
            call x%out%put_integers('number', jobs%number, shape(jobs))
            call x%out%put_array('stiffness', [(jobs(i)%stiffness, i=1, size(jobs))], &
               & [6, 6, size(jobs)])
            call x%out%put_array('euler_deg', [(jobs(i)%euler_deg, i=1, size(jobs))], &
               & [3, size(jobs)])
         end associate
      case ('take')
         !> number, status, modulus_gpa, seconds, elements, depth_um, force_mn,
         !> modulus_by_stiffness, message ->
         outcome%status = x%in%integer('status')
         outcome%modulus = x%in%real('modulus_gpa')
         outcome%seconds = x%in%real('seconds')
         outcome%elements = x%in%integer('elements')
         outcome%depth = x%in%reals('depth_um')
         outcome%force = x%in%reals('force_mn')
         outcome%by_stiffness = x%in%reals('modulus_by_stiffness')
         outcome%message = x%in%text('message')
         call stage%take(x%in%integer('number'), outcome, x%error)
      case ('leave')
         !> ->
         call stage%campaign%flush(x%error)
      case ('close')
         !> -> text
         call stage%close(x%text, x%error)
      case ('look_ahead')
         !> count -> constants, values, warnings
         ! Next candidates of a build: names of the constants, and rows of their values (GPa) and
         ! of angles (degrees).
         select type (stage)
         type is (build_stage_type)
            call stage%look_ahead(x%in%integer('count'), numbers, x%error)
            if (allocated(x%error)) return
            call x%out%put('constants', stage%learning%learner%basis%domain%class%constants)
            x%values = reshape([(stage%candidates%constants(:, numbers(i)), &
               & stage%candidates%euler_deg(:, numbers(i)), i=1, size(numbers))], &
               & [size(stage%candidates%constants, 1) + 3, size(numbers)])
            call x%out%put('warnings', diagnostics_text(stage%warnings))
         end select
      case default
         call x%refuse(verb)
      end select
   end subroutine use_stage

   subroutine use_problem(verb, self, x)
      character(len=*), intent(in) :: verb
      type(problem_type), intent(inout), target :: self
      type(exchange_type), intent(inout) :: x
      type(indentation_model_type), pointer :: model
      type(simulator_type), pointer :: simulator
      class(stage_type), allocatable :: new
      class(stage_type), pointer :: stage
      class(basis_type), allocatable :: basis
      type(film_type), allocatable :: films(:)
      type(diagnostic_type), allocatable :: warnings(:)
      real(wp), pointer :: c(:, :, :), euler_deg(:, :)

      select case (verb)
      case ('describe')
         !> -> ..
         call describe_problem()
      case ('table')
         !> table -> ..
         select case (x%in%text('table'))
         case ('crystals')
            call put_table(self%data%crystals, x%out)
         case ('measurements')
            call put_table(self%data%measurements, x%out)
         case ('candidates')
            call put_table(self%data%candidates, x%out)
         case default
            call put_table(self%data%grains, x%out)
         end select
      case ('warn')
         !> code, subject ->
         ! Add a diagnostic of a table that was read in Python.
         call self%warn(x%in%text('code'), x%in%text('subject'))
      case ('load')
         !> misread, .. -> ..
         ! Read the tables that are given as texts, and the files that the namelist names.
         call load_problem(self, x%in, x%error)
         if (allocated(x%error)) return
         if (x%in%has('misread')) then
            self%data%misread = reshape(x%in%columns('misread', 3), &
               & [3, self%data%measurements%table%rows, 7])
         end if
         call describe_problem()
      case ('write_crystals')
         !> path, names, values ->
         ! Write the table of the crystals with additional columns of numbers (n, m).
         call write_table(self%data%crystals%table, x%in%text('path'), x%in%text('names'), &
            & x%in%columns('values', self%data%crystals%n), x%error)
      case ('import')
         !> problem, name, output, folder, data_folder, shipped -> text
         ! Import their moduli into the campaign of another problem.
         call import_table(x%problem, x%places(), self%data%crystals, x%in%text('name'), x%text, &
            & x%error)
      case ('begin_results')
         !> groups, output, folder, data_folder, shipped ->
         call begin_results(self, x%in%text('groups'), x%places(), x%error)
      case ('write_table')
         !> path ->
         call write_canonical(x%in%text('path'), self%data%table_text, x%error)
      case ('inputs')
         !> output, folder, data_folder, shipped -> text
         x%text = '{'//inputs_of(self, self%run%groups, x%places())//'}'
      case ('check_stages')
         !> output, folder, data_folder, shipped ->
         call check_stages(self, x%places(), .true., x%error)
      case ('indentation')
         !> -> handle
         allocate (model)
         call x%give(model, 'indentation')
         call new_indentation_model(self%settings, model, x%error)
         call self%locate('simulation', '', x%error)
      case ('simulator')
         !> -> handle
         allocate (simulator)
         call x%give(simulator, 'simulator')
         call new_simulator(self%settings, simulator, x%error)
         call self%locate('simulation', '', x%error)
      case ('film')
         !> stiffness, euler_deg, problem, threads -> values
         ! Exact moduli of films, GPa.
         c => x%crystals(euler_deg)
         allocate (films(size(c, 3)))
         call indent_films(self, c, euler_deg, x%threads(), films, x%error)
         x%values = reshape(films%modulus, [size(films), 1])
      case ('basis')
         !> -> handle
         call basis_of_problem(self, basis, x%error)
         if (.not. allocated(x%error)) call give_basis(basis, x)
      case ('stage')
         !> name, output, folder, data_folder, shipped -> handle, expected, physics
         call new_stage(x%in%text('name'), new, x%error)
         if (allocated(x%error)) return
         allocate (stage, source=new)
         call x%give(stage, 'stage')
         call stage%open(self, x%places(), x%error)
         call x%out%put('expected', stage%n_expected)
         ! An engine makes the simulator from these groups of a namelist.
         call x%out%put('physics', settings_namelist(self%settings, 'specimen indenter simulation'))
      case ('mesh_error')
         !> stiffness -> values, text
         ! Relative error bounds of the mesh for crystals (stiffness, GPa), and a note on crystals
         ! near instability.
         c => x%in%matrices('stiffness')
         allocate (x%values(size(c, 3), 1))
         call simulation_error(self%settings, c, x%values(:, 1), warnings)
         x%text = ''
         if (size(warnings) > 0) x%text = warnings(1)%message()
      case default
         call x%refuse(verb)
      end select

   contains

      !> Put the settings as texts and resolved, the warnings and the stages.
      subroutine describe_problem()

         call put_settings(self%settings, x%out)
         call x%out%put('resolved', resolved_text(self))
         call x%out%put('warnings', diagnostics_text(self%warnings))
         call x%out%put('stages', join(self%run%stages, ' '))
      end subroutine describe_problem
   end subroutine use_problem

   !> Put the columns of a table, the number of its rows, the kind of its modulus, the names of the
   !> grains, and the classes of the crystals; nothing if the problem does not have it.
   subroutine put_table(points, out)
      type(points_type), allocatable, intent(in) :: points
      type(named_values_type), intent(inout) :: out
      type(line_type), allocatable :: names(:), classes(:)
      integer :: i

      if (.not. allocated(points)) return
      call out%put('n', points%n)
      call out%put('euler_deg', points%euler_deg)
      if (allocated(points%modulus_kind)) call out%put('kind', points%modulus_kind)
      if (allocated(points%modulus_gpa)) call out%put('modulus_gpa', points%modulus_gpa)
      if (allocated(points%sd_gpa)) call out%put('sd_gpa', points%sd_gpa)
      if (points%named_by > 0) then
         allocate (names(points%n))
         do i = 1, points%n
            names(i)%text = points%name(i)
         end do
         call out%put('names', names)
      end if
      if (.not. allocated(points%class)) return
      do i = 1, size(points%classes)
         call add_line(classes, points%classes(i)%name)
      end do
      call out%put('classes', classes)
      call out%put_integers('class', points%class, [points%n])
      call out%put('constants', points%constants)
      call out%put('stiffness', points%stiffness)
   end subroutine put_table

end module simulation_operations
