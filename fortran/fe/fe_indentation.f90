!> The indentation simulation: meshes, solver and contact behind one model, and the modulus that a simulated curve gives.
!>
!> Lengths in um, forces in mN, stiffness in GPa. The indenter moves along -z of the sample.
module fe_indentation
   use crystal_elasticity, only: check_stiffness, rotate_stiffness, rotation_matrix
   use errors, only: error_type, exit_bad_input, raise
   use fe_assembly, only: assemble, assembly_type, expand_displacement, new_assembly, reaction
   use fe_contact, only: contact_residual, solve_contact
   use fe_element, only: brick_full, brick_incompatible, brick_selective
   use fe_mesh, only: mesh_plan_type, mesh_type, new_mesh
   use kinds, only: i8, wp
   use linear_algebra, only: cholesky_inverse
   use sparse_cholesky, only: acquire_factor, analyse_pattern, cholesky_type, factor_type, factorise, free_analysis, &
      & kept_factor, release_factor, solve_factored
   use text, only: to_text
   implicit none
   private
   public :: indentation_options_type, indentation_model_type, indentation_result_type, grid_type
   public :: new_indentation_model, free_indentation_model, simulate_indentation, indentation_fields
   public :: estimate_modulus, default_element, numerics_revision

   !> Counts changes of the numerics that change results; part of the identity of stored results.
   integer, parameter :: numerics_revision = 3

   type :: indentation_options_type
      !> 'halfspace': infinite elements close the mesh; 'paper': the block of 9.6 x 9.6 x 4.8 um, bottom clamped.
      character(len=16) :: mesh = 'halfspace'
      !> 'c3d8' or 'c3d8i'; blank: `default_element` of the mesh.
      character(len=16) :: element = ''
      !> 'selective' (Abaqus) or 'full' (CalculiX) integration of c3d8; c3d8i is integrated fully.
      character(len=16) :: integration = 'selective'
      !> Elements per contact radius relative to the default, 0.3 to 4.
      real(wp) :: refine = 1.0_wp
      !> Extrapolate in mesh size from a second, coarser mesh.
      logical :: extrapolate = .false.
      !> Radius of the indenter, um.
      real(wp) :: radius_um = 16.0_wp
      !> Depths of the curve, equally spaced in contact radius.
      integer :: depths = 10
      !> Of the half-space, for studies of convergence: distance of the infinite elements in contact radii, 2 to 100, and
      !> growth of the layers of bricks before them at refine = 1, 1.01 to 2.
      real(wp) :: outer = 5.0_wp, growth = 1.13_wp
   end type indentation_options_type

   !> One mesh with all that depends on it alone.
   type :: grid_type
      type(mesh_type) :: mesh
      type(assembly_type) :: assembly
      type(cholesky_type) :: cholesky
      !> Height of the indenter above each contact node at zero depth, um.
      real(wp), allocatable :: gap(:)
   end type grid_type

   !> Read-only once made, so that threads share it.
   type :: indentation_model_type
      type(indentation_options_type) :: options
      integer :: formulation = brick_selective
      !> The finest first.
      type(grid_type), allocatable :: grid(:)
      !> Largest contact radius (Hertz), um.
      real(wp) :: contact_radius = 0.0_wp
      !> Depths of the curve (um); see `simulate_indentation` for crystals with a very long contact ellipse.
      real(wp), allocatable :: depth(:)
      !> Elements of all meshes.
      integer :: elements = 0
   end type indentation_model_type

   type :: indentation_result_type
      !> The estimate of the indentation modulus, GPa, and two diagnostics: slope with intercept, and last point.
      real(wp) :: modulus = 0.0_wp, modulus_slope = 0.0_wp, modulus_last = 0.0_wp
      !> The estimate on each mesh alone, GPa, the finest first.
      real(wp), allocatable :: modulus_of_mesh(:)
      real(wp), allocatable :: depth(:), force(:)
      !> Equivalent radius of the touching nodes' area, um.
      real(wp), allocatable :: contact_radius(:)
      integer :: elements = 0
      !> Wall time in all, and of the numeric factorisations, s.
      real(wp) :: seconds = 0.0_wp, seconds_factor = 0.0_wp
      !> Largest violation of the contact conditions, relative.
      real(wp) :: contact_residual = 0.0_wp
      !> Imbalance of indenter force and reactions, relative.
      real(wp) :: equilibrium_residual = 0.0_wp
      !> The contact left the refined zone of the mesh.
      logical :: left_zone = .false.
   end type indentation_result_type

   !> Contact radius over indenter radius at the last depth.
   real(wp), parameter :: contact_ratio = 1.0_wp/32.0_wp
   !> The paper's block: half-width and depth, and largest contact radius, um.
   real(wp), parameter :: block_size = 4.8_wp, block_contact = 0.5_wp
   !> A depth counts for the modulus from this many elements per contact radius on.
   real(wp), parameter :: least_elements = 5.0_wp
   !> Contact radii are multiplied by this where the contact leaves the refined zone.
   real(wp), parameter :: shrink = 0.85_wp

contains

   pure function default_element(mesh) result(element)
      character(len=*), intent(in) :: mesh
      character(len=:), allocatable :: element

      if (mesh == 'paper') then
         element = 'c3d8'
      else
         element = 'c3d8i'
      end if
   end function default_element

   !> Make the meshes and analyse their matrices.
   subroutine new_indentation_model(options, model, error)
      type(indentation_options_type), intent(in) :: options
      type(indentation_model_type), intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call check_options(options, error)
      if (allocated(error)) return
      model%options = options
      if (len_trim(options%element) == 0) model%options%element = default_element(trim(options%mesh))
      if (model%options%element == 'c3d8i') then
         model%formulation = brick_incompatible
      else if (options%integration == 'full') then
         model%formulation = brick_full
      else
         model%formulation = brick_selective
      end if
      model%contact_radius = contact_ratio*options%radius_um
      if (options%mesh == 'paper') model%contact_radius = min(block_contact, options%radius_um/8.0_wp)
      model%depth = [((model%contact_radius*i/options%depths)**2/options%radius_um, i=1, options%depths)]

      allocate (model%grid(merge(2, 1, options%extrapolate)))
      do i = 1, size(model%grid)
         call new_grid(model, merge(1.0_wp, coarse_ratio(), i == 1), model%grid(i), error)
         if (allocated(error)) then
            call free_indentation_model(model)
            return
         end if
         model%elements = model%elements + size(model%grid(i)%mesh%brick, 2) + size(model%grid(i)%mesh%facet, 2)
      end do
      if (.not. any(is_resolved(model, model%depth))) then
         call raise(error, 'the contact radius spans '//to_text(model%contact_radius/model%grid(1)%mesh%element_size, 3) &
            & //' elements at the last depth, at least '//to_text(least_elements)//' are needed (refine = ' &
            & //to_text(options%refine)//', radius_um = '//to_text(options%radius_um)//')', exit_bad_input)
         call free_indentation_model(model)
      end if
   end subroutine new_indentation_model

   !> Whether the contact radius (Hertz) at each depth spans enough elements for the estimate of the modulus.
   pure function is_resolved(model, depth)
      type(indentation_model_type), intent(in) :: model
      real(wp), intent(in) :: depth(:)
      logical :: is_resolved(size(depth))

      is_resolved = sqrt(model%options%radius_um*depth) &
         & >= least_elements*model%grid(1)%mesh%element_size*(1.0_wp - 1.0e-9_wp)
   end function is_resolved

   !> Elements per contact radius of the coarser mesh of an extrapolation, relative to the finer.
   pure real(wp) function coarse_ratio()
      coarse_ratio = 2.0_wp/3.0_wp
   end function coarse_ratio

   subroutine check_options(options, error)
      type(indentation_options_type), intent(in) :: options
      type(error_type), allocatable, intent(out) :: error

      if (options%mesh /= 'halfspace' .and. options%mesh /= 'paper') then
         call raise(error, "mesh: '"//trim(options%mesh)//"' is unknown; allowed: 'halfspace', 'paper'", exit_bad_input)
      else if (options%element /= '' .and. options%element /= 'c3d8' .and. options%element /= 'c3d8i') then
         call raise(error, "element: '"//trim(options%element)//"' is unknown; allowed: 'c3d8', 'c3d8i'", exit_bad_input)
      else if (options%integration /= 'selective' .and. options%integration /= 'full') then
         call raise(error, "integration: '"//trim(options%integration)//"' is unknown; allowed: 'selective', 'full'", &
            & exit_bad_input)
      else if (.not. (options%refine >= 0.3_wp .and. options%refine <= 4.0_wp)) then
         call raise(error, 'refine: '//to_text(options%refine)//' is out of range; allowed: 0.3 to 4', exit_bad_input)
      else if (.not. (options%radius_um >= 1.0e-3_wp .and. options%radius_um <= 1.0e6_wp)) then
         call raise(error, 'radius_um: '//to_text(options%radius_um)//' is out of range; allowed: 0.001 to 1e6 um', &
            & exit_bad_input)
      else if (.not. (options%outer >= 2.0_wp .and. options%outer <= 100.0_wp)) then
         call raise(error, 'outer: '//to_text(options%outer)//' is out of range; allowed: 2 to 100', exit_bad_input)
      else if (.not. (options%growth >= 1.01_wp .and. options%growth <= 2.0_wp)) then
         call raise(error, 'growth: '//to_text(options%growth)//' is out of range; allowed: 1.01 to 2', exit_bad_input)
      else if (options%depths < 1 .or. options%depths > 1000) then
         call raise(error, 'depths: '//to_text(options%depths)//' is out of range; allowed: 1 to 1000', exit_bad_input)
      end if
   end subroutine check_options

   !> The mesh with `ratio` times the elements per contact radius that the options ask for, ready to use.
   subroutine new_grid(model, ratio, grid, error)
      type(indentation_model_type), intent(in) :: model
      real(wp), intent(in) :: ratio
      type(grid_type), intent(out) :: grid
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan

      if (model%options%mesh == 'paper') then
         plan = block_plan(ratio*model%options%refine)
      else
         plan = halfspace_plan(ratio*model%options%refine, model%contact_radius, model%options%outer, model%options%growth)
      end if
      call new_mesh(plan, grid%mesh, error)
      if (allocated(error)) return
      call new_assembly(grid%mesh, grid%assembly, error)
      if (allocated(error)) return
      associate (x => grid%mesh%x(:, grid%mesh%contact), radius => model%options%radius_um)
         ! r2/(R + sqrt(R2 - r2)) is R - sqrt(R2 - r2) without its cancellation.
         grid%gap = (x(1, :)**2 + x(2, :)**2)/(radius + sqrt(radius**2 - x(1, :)**2 - x(2, :)**2))
      end associate
      associate (a => grid%assembly)
         call analyse_pattern(a%column_start, a%row, a%group, a%kept, grid%cholesky, error)
      end associate
   end subroutine new_grid

   !> The half-space: 9.5 elements to the contact radius at refine = 1.
   pure function halfspace_plan(refine, contact_radius, outer, growth) result(plan)
      real(wp), intent(in) :: refine, contact_radius, outer, growth
      type(mesh_plan_type) :: plan
      !> Elements per contact radius, and depth of the core in contact radii.
      real(wp), parameter :: fineness = 9.5_wp, depth = 1.1_wp
      real(wp) :: across, ratio

      across = fineness*refine
      ! Room for an elliptical contact, and for the ring of nodes around it that must stay free.
      plan%half_cells = max(4, nint(1.25_wp*across) + 2)
      plan%depth_cells = max(2, 2*nint(0.5_wp*depth*across))
      plan%half_width = contact_radius*plan%half_cells/across
      plan%depth = contact_radius*plan%depth_cells/across
      ratio = outer*contact_radius/plan%half_width
      allocate (plan%layers(1), plan%growth(1), plan%coarsen(1))
      plan%layers = max(1, nint(log(ratio)/log(growth)*refine))
      plan%growth = ratio**(1.0_wp/plan%layers(1))
      plan%coarsen = .true.
      plan%infinite = .true.
   end function halfspace_plan

   !> The paper's block; 12,400 elements at refine = 1.
   pure function block_plan(refine) result(plan)
      real(wp), intent(in) :: refine
      type(mesh_plan_type) :: plan

      plan%half_cells = max(2, nint(10.0_wp*refine))
      plan%depth_cells = plan%half_cells
      plan%half_width = 1.3_wp*block_contact
      plan%depth = plan%half_width
      allocate (plan%layers(1), plan%growth(1), plan%coarsen(1))
      plan%layers = max(1, nint(7.0_wp*refine))
      plan%growth = (block_size/plan%half_width)**(1.0_wp/plan%layers(1))
      plan%coarsen = .false.
      plan%infinite = .false.
   end function block_plan

   subroutine free_indentation_model(model)
      type(indentation_model_type), intent(inout) :: model
      integer :: i

      if (.not. allocated(model%grid)) return
      do i = 1, size(model%grid)
         call free_analysis(model%grid(i)%cholesky)
      end do
      deallocate (model%grid)
   end subroutine free_indentation_model

   !> Indent a crystal: the whole curve and its modulus.
   !>
   !> Where the contact ellipse is so long that it leaves the refined zone of the mesh, the depths shrink until it fits, as long
   !> as the last one is resolved.
   subroutine simulate_indentation(model, stiffness, euler, result, error)
      type(indentation_model_type), intent(in) :: model
      !> Stiffness in the crystal frame (GPa) and Bunge-Euler angles (radians).
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(indentation_result_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: c(6, 6), depth(size(model%depth))
      integer(i8) :: start, finish, rate
      integer :: solves

      call system_clock(start, rate)
      call check_crystal(stiffness, euler, error)
      if (allocated(error)) return
      c = rotate_stiffness(stiffness, rotation_matrix(euler))
      depth = model%depth
      do solves = 1, huge(solves)
         call simulate_depths(model, c, depth, result, error)
         if (.not. result%left_zone) exit
         if (.not. any(is_resolved(model, shrink**2*depth))) exit
         depth = shrink**2*depth
      end do
      if (allocated(error)) return
      call estimate_modulus(model%options%radius_um, result%depth, result%force, is_resolved(model, depth), result%modulus, &
         & result%modulus_slope, result%modulus_last)
      result%elements = solves*model%elements
      call system_clock(finish)
      result%seconds = real(finish - start, wp)/real(rate, wp)
   end subroutine simulate_indentation

   !> The curve at given depths, extrapolated where the model has a second mesh.
   subroutine simulate_depths(model, c, depth, result, error)
      type(indentation_model_type), intent(in) :: model
      !> Stiffness in the sample frame, GPa; um.
      real(wp), intent(in) :: c(6, 6), depth(:)
      type(indentation_result_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      type(indentation_result_type) :: coarse
      real(wp) :: ratio

      result%depth = depth
      call indent_grid(model, model%grid(1), c, result, error)
      if (allocated(error)) return
      result%modulus_of_mesh = [modulus_of(model, result)]
      if (size(model%grid) == 1) return
      coarse%depth = depth
      call indent_grid(model, model%grid(2), c, coarse, error)
      result%left_zone = coarse%left_zone
      if (allocated(error)) return
      result%modulus_of_mesh = [result%modulus_of_mesh, modulus_of(model, coarse)]
      ! The error of both meshes falls with the square of the element size.
      ratio = (model%grid(2)%mesh%element_size/model%grid(1)%mesh%element_size)**2
      result%force = result%force + (result%force - coarse%force)/(ratio - 1.0_wp)
      result%seconds_factor = result%seconds_factor + coarse%seconds_factor
      result%contact_residual = max(result%contact_residual, coarse%contact_residual)
      result%equilibrium_residual = max(result%equilibrium_residual, coarse%equilibrium_residual)
   end subroutine simulate_depths

   pure subroutine check_crystal(stiffness, euler, error)
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(error_type), allocatable, intent(out) :: error

      call check_stiffness(stiffness, error)
      if (allocated(error)) return
      if (.not. all(abs(euler) <= 1.0e3_wp)) call raise(error, 'the orientation ('//to_text(euler(1))//', ' &
         & //to_text(euler(2))//', '//to_text(euler(3))//') radians is not finite', exit_bad_input)
   end subroutine check_crystal

   pure real(wp) function modulus_of(model, result)
      type(indentation_model_type), intent(in) :: model
      type(indentation_result_type), intent(in) :: result
      real(wp) :: slope, last

      call estimate_modulus(model%options%radius_um, result%depth, result%force, is_resolved(model, result%depth), modulus_of, &
         & slope, last)
   end function modulus_of

   !> The modulus of a curve: least squares through the origin over the depths that are used.
   pure subroutine estimate_modulus(radius, depth, force, used, modulus, slope, last)
      real(wp), intent(in) :: radius, depth(:), force(:)
      logical, intent(in) :: used(:)
      !> GPa: the estimate, the slope of a line with intercept, and the last point alone.
      real(wp), intent(out) :: modulus, slope, last
      real(wp) :: factor, x, y
      integer :: n, m

      n = size(depth)
      m = count(used)
      factor = 0.75_wp/sqrt(radius)
      modulus = factor*sum(force*depth**1.5_wp, mask=used)/sum(depth**3, mask=used)
      last = factor*force(n)/depth(n)**1.5_wp
      slope = modulus
      if (m < 2) return
      x = sum(depth**1.5_wp, mask=used)/m
      y = sum(force, mask=used)/m
      slope = factor*sum((depth**1.5_wp - x)*(force - y), mask=used)/sum((depth**1.5_wp - x)**2, mask=used)
   end subroutine estimate_modulus

   !> The curve of one mesh.
   subroutine indent_grid(model, grid, c, result, error)
      type(indentation_model_type), intent(in) :: model
      type(grid_type), intent(in) :: grid
      !> Stiffness in the sample frame, GPa.
      real(wp), intent(in) :: c(6, 6)
      !> In: its depths, um.
      type(indentation_result_type), intent(inout) :: result
      type(error_type), allocatable, intent(out) :: error
      type(factor_type) :: factor
      real(wp), allocatable :: forces(:, :)
      real(wp), allocatable :: u(:, :)
      real(wp) :: held(3), total

      call acquire_factor(grid%cholesky, factor, error)
      if (allocated(error)) return
      call solve_curve(model, grid, c, factor, forces, result, error)
      if (.not. allocated(error)) then
         call solve_displacement(grid, factor, forces(:, size(result%depth)), u)
         call reaction(grid%mesh, model%formulation, c, u, held)
         total = sum(forces(:, size(result%depth)))
         result%equilibrium_residual = maxval(abs(held - [0.0_wp, 0.0_wp, total]))/total
      end if
      call release_factor(grid%cholesky, factor)
   end subroutine indent_grid

   !> Factor the matrix and solve the contact at every depth.
   subroutine solve_curve(model, grid, c, factor, forces, result, error)
      type(indentation_model_type), intent(in) :: model
      type(grid_type), intent(in) :: grid
      real(wp), intent(in) :: c(6, 6)
      type(factor_type), intent(inout) :: factor
      !> Nodal forces into the material, mN (contact nodes, depths).
      real(wp), allocatable, intent(out) :: forces(:, :)
      !> In: its depths, um.
      type(indentation_result_type), intent(inout) :: result
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: values(:), compliance(:, :)
      logical, allocatable :: active(:), edge(:)
      integer(i8) :: start, finish, rate
      integer :: i, n

      call assemble(grid%mesh, grid%assembly, model%formulation, c, values, error)
      if (allocated(error)) return
      call system_clock(start, rate)
      call factorise(grid%cholesky, factor, values, error)
      call system_clock(finish)
      if (allocated(error)) return
      result%seconds_factor = real(finish - start, wp)/real(rate, wp)
      n = grid%assembly%kept
      allocate (compliance(n, n))
      call kept_factor(grid%cholesky, factor, compliance)
      call cholesky_inverse(compliance)

      associate (x => grid%mesh%x(:, grid%mesh%contact))
         edge = hypot(x(1, :), x(2, :)) > grid%mesh%contact_reach - grid%mesh%element_size
      end associate
      allocate (forces(n, size(result%depth)), active(n), result%force(size(result%depth)))
      if (.not. allocated(result%contact_radius)) allocate (result%contact_radius(size(result%depth)))
      active = grid%gap < 0.5_wp*result%depth(1)
      do i = 1, size(result%depth)
         call solve_contact(compliance, grid%gap, result%depth(i), active, forces(:, i), error)
         if (allocated(error)) return
         result%left_zone = any(active .and. edge)
         if (result%left_zone) then
            call raise(error, 'the contact leaves the refined zone of the mesh at depth '//to_text(result%depth(i)) &
               & //' um (it may reach '//to_text(grid%mesh%contact_reach - grid%mesh%element_size)//' um)')
            return
         end if
         result%force(i) = sum(forces(:, i))
         result%contact_radius(i) = sqrt(count(forces(:, i) > 0.0_wp)/acos(-1.0_wp))*grid%mesh%element_size
         result%contact_residual = max(result%contact_residual, &
            & contact_residual(compliance, grid%gap, result%depth(i), forces(:, i)))
      end do
   end subroutine solve_curve

   !> Displacement (um) of every node under the nodal forces of the contact nodes.
   subroutine solve_displacement(grid, factor, force, u)
      type(grid_type), intent(in) :: grid
      type(factor_type), intent(inout) :: factor
      real(wp), intent(in) :: force(:)
      real(wp), allocatable, intent(out) :: u(:, :)
      real(wp), allocatable :: x(:)

      allocate (x(grid%assembly%unknowns), source=0.0_wp)
      x(grid%assembly%unknowns - grid%assembly%kept + 1:) = -force
      call solve_factored(grid%cholesky, factor, x)
      allocate (u(3, size(grid%mesh%x, 2)))
      call expand_displacement(grid%mesh, grid%assembly, x, u)
   end subroutine solve_displacement

   !> Displacement of the nodes of the finest mesh at one depth.
   subroutine indentation_fields(model, stiffness, euler, step, u, c, error)
      type(indentation_model_type), intent(in) :: model
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      !> Which depth.
      integer, intent(in) :: step
      !> (3, nodes), um.
      real(wp), allocatable, intent(out) :: u(:, :)
      !> Stiffness in the sample frame, GPa.
      real(wp), intent(out) :: c(6, 6)
      type(error_type), allocatable, intent(out) :: error
      type(indentation_result_type) :: result, curve
      type(factor_type) :: factor
      real(wp), allocatable :: forces(:, :)

      c = 0.0_wp
      call check_crystal(stiffness, euler, error)
      if (allocated(error)) return
      if (step < 1 .or. step > size(model%depth)) then
         call raise(error, 'depth number '//to_text(step)//' does not exist; allowed: 1 to '//to_text(size(model%depth)), &
            & exit_bad_input)
         return
      end if
      c = rotate_stiffness(stiffness, rotation_matrix(euler))
      ! The simulation finds the depths that fit this crystal.
      call simulate_indentation(model, stiffness, euler, result, error)
      if (allocated(error)) return
      curve%depth = result%depth
      call acquire_factor(model%grid(1)%cholesky, factor, error)
      if (allocated(error)) return
      call solve_curve(model, model%grid(1), c, factor, forces, curve, error)
      if (.not. allocated(error)) call solve_displacement(model%grid(1), factor, forces(:, step), u)
      call release_factor(model%grid(1)%cholesky, factor)
   end subroutine indentation_fields
end module fe_indentation
