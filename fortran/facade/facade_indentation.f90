! Indentation simulations for f2py. A model is kept under a 64-bit handle that a Python object owns and frees.
! status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> Make a model.
!>
!> `counts`: elements of all meshes, depths, meshes, then of the finest mesh: nodes, bricks, infinite elements, contact nodes,
!> unknowns, clamped nodes, hanging nodes. `costs`, summed over the meshes: entries of the factor, operations of one
!> factorisation, bytes of workspace of one simulation; then the last depth (um).
subroutine indentation_new(mesh, element, integration, refine, extrapolate, radius_um, depths, outer, growth, handle, counts, &
   & costs, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t, c_loc
   use errors, only: error_type, error_to_status, exit_bad_input, raise
   use fe_indentation, only: indentation_model_type, new_indentation_model
   use settings_groups, only: simulation_settings_type
   use text, only: to_text
   implicit none
   !f2py threadsafe
   character(len=16), intent(in) :: mesh, element, integration
   real(c_double), intent(in) :: refine, radius_um, outer, growth
   integer(c_int), intent(in) :: extrapolate, depths
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: counts(10)
   real(c_double), intent(out) :: costs(4)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(simulation_settings_type) :: settings
   type(indentation_model_type), pointer :: model
   type(error_type), allocatable :: error

   handle = 0
   counts = 0
   costs = 0.0_c_double
   settings%mesh = trim(mesh)
   settings%element = trim(element)
   settings%integration = trim(integration)
   settings%refine = refine
   settings%extrapolate = extrapolate /= 0
   settings%radius_um = radius_um
   settings%depths = depths
   settings%outer = outer
   settings%growth = growth
   allocate (model)
   call check_settings()
   if (.not. allocated(error)) call new_indentation_model(settings, model, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (model)
      return
   end if
   handle = transfer(c_loc(model), handle)
   associate (grid => model%grid(1))
      counts = [model%elements, size(model%depth), size(model%grid), size(grid%mesh%x, 2), size(grid%mesh%brick, 2), &
         & size(grid%mesh%facet, 2), size(grid%mesh%contact), grid%assembly%unknowns, &
         & size(grid%mesh%clamped), size(grid%mesh%hanging)]
   end associate
   costs = [sum(model%grid%cholesky%entries), sum(model%grid%cholesky%operations), sum(model%grid%cholesky%bytes), &
      & model%depth(size(model%depth))]

contains

   subroutine check_settings()
      if (all(settings%element /= [character(len=5) :: '', 'c3d8', 'c3d8i'])) then
         call raise(error, "element: '"//settings%element//"' is unknown; allowed: 'c3d8', 'c3d8i'", exit_bad_input)
      else if (settings%integration /= 'selective' .and. settings%integration /= 'full') then
         call raise(error, "integration: '"//settings%integration//"' is unknown; allowed: 'selective', 'full'", exit_bad_input)
      else if (.not. (refine >= 0.3_c_double .and. refine <= 4.0_c_double)) then
         call raise(error, 'refine: '//to_text(settings%refine)//' is out of range; allowed: 0.3 to 4', exit_bad_input)
      else if (.not. (radius_um >= 1.0e-3_c_double .and. radius_um <= 1.0e6_c_double)) then
         call raise(error, 'radius_um: '//to_text(settings%radius_um)//' is out of range; allowed: 0.001 to 1e6 um', exit_bad_input)
      else if (.not. (outer >= 2.0_c_double .and. outer <= 100.0_c_double)) then
         call raise(error, 'outer: '//to_text(settings%outer)//' is out of range; allowed: 2 to 100', exit_bad_input)
      else if (.not. (growth >= 1.01_c_double .and. growth <= 2.0_c_double)) then
         call raise(error, 'growth: '//to_text(settings%growth)//' is out of range; allowed: 1.01 to 2', exit_bad_input)
      else if (depths < 1 .or. depths > 1000) then
         call raise(error, 'depths: '//to_text(settings%depths)//' is out of range; allowed: 1 to 1000', exit_bad_input)
      end if
   end subroutine check_settings
end subroutine indentation_new

!> Free a model.
subroutine indentation_free(handle)
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int64_t, c_null_ptr, c_ptr
   use fe_indentation, only: indentation_model_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   type(indentation_model_type), pointer :: model
   type(c_ptr) :: address

   address = transfer(handle, c_null_ptr)
   call c_f_pointer(address, model)
   deallocate (model)
end subroutine indentation_free

!> Indent one crystal: stiffness in the crystal frame (GPa), Bunge-Euler angles (radians). `moduli` (GPa): estimate, slope
!> with intercept, last point, estimates on each mesh. `diagnostics`: wall seconds, seconds of factorisation, contact residual,
!> equilibrium residual. `elements`: of all solves.
subroutine indentation_run(handle, depths, stiffness, euler, depth_um, force_mn, contact_radius_um, moduli, diagnostics, &
   & elements, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr, c_ptr
   use errors, only: error_type, error_to_status
   use fe_indentation, only: indentation_model_type, indentation_result_type, simulate_indentation
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: depths
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: depth_um(depths), force_mn(depths), contact_radius_um(depths), moduli(5), diagnostics(4)
   integer(c_int), intent(out) :: elements, status
   character(len=512), intent(out) :: message
   type(indentation_model_type), pointer :: model
   type(indentation_result_type) :: result
   type(error_type), allocatable :: error
   type(c_ptr) :: address
   integer :: n

   depth_um = 0.0_c_double
   force_mn = 0.0_c_double
   contact_radius_um = 0.0_c_double
   moduli = 0.0_c_double
   diagnostics = 0.0_c_double
   elements = 0
   address = transfer(handle, c_null_ptr)
   call c_f_pointer(address, model)
   call simulate_indentation(model, stiffness, euler, result, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   depth_um = result%depth
   force_mn = result%force
   contact_radius_um = result%contact_radius
   n = size(result%modulus_of_mesh)
   moduli(:3) = [result%modulus, result%modulus_slope, result%modulus_last]
   moduli(4:3 + n) = result%modulus_of_mesh
   elements = result%elements
   diagnostics = [result%seconds, result%seconds_factor, result%contact_residual, result%equilibrium_residual]
end subroutine indentation_run

!> The finest mesh: nodes (um), bricks, infinite elements, contact nodes and the indenter's height above them (um), clamped nodes,
!> and nodes that hang on the mean of up to four others (-1: none). Nodes are numbered from 0.
subroutine indentation_mesh(handle, nodes, bricks, facets, contacts, clamps, hangs, x, brick, facet, contact, gap, clamped, &
   & hanging, master)
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr, c_ptr
   use fe_indentation, only: indentation_model_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: nodes, bricks, facets, contacts, clamps, hangs
   real(c_double), intent(out) :: x(3, nodes), gap(contacts)
   integer(c_int), intent(out) :: brick(8, bricks), facet(4, facets), contact(contacts), clamped(clamps), hanging(hangs)
   integer(c_int), intent(out) :: master(4, hangs)
   type(indentation_model_type), pointer :: model
   type(c_ptr) :: address
   integer :: i

   address = transfer(handle, c_null_ptr)
   call c_f_pointer(address, model)
   associate (mesh => model%grid(1)%mesh)
      x = mesh%x
      brick = mesh%brick - 1
      facet = mesh%facet - 1
      contact = mesh%contact - 1
      gap = model%grid(1)%gap
      clamped = mesh%clamped - 1
      hanging = mesh%hanging - 1
      master = -1
      do i = 1, hangs
         master(:mesh%masters(i), i) = mesh%master(:mesh%masters(i), i) - 1
      end do
   end associate
end subroutine indentation_mesh

!> Displacement of the nodes (um) and mean stress of the bricks (GPa, order 11,22,33,23,13,12) of the finest mesh at depth
!> number `step`.
subroutine indentation_field(handle, step, nodes, bricks, stiffness, euler, displacement, stress, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr, c_ptr
   use errors, only: error_type, error_to_status
   use fe_element, only: brick_stress
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use fe_indentation, only: indentation_model_type, indentation_result_type, simulate_indentation
   use kinds, only: wp
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: step, nodes, bricks
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: displacement(3, nodes), stress(6, bricks)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(indentation_model_type), pointer :: model
   type(error_type), allocatable :: error
   type(c_ptr) :: address
   type(indentation_result_type) :: result
   real(wp) :: c(6, 6)
   integer :: i

   displacement = 0.0_c_double
   stress = 0.0_c_double
   address = transfer(handle, c_null_ptr)
   call c_f_pointer(address, model)
   call simulate_indentation(model, stiffness, euler, result, error, step)
   call error_to_status(error, status, message)
   if (status /= 0) return
   displacement = result%displacement
   c = rotate_stiffness(stiffness, rotation_matrix(euler))
   associate (mesh => model%grid(1)%mesh, u => result%displacement)
      do i = 1, bricks
         call brick_stress(mesh%x(:, mesh%brick(:, i)), c, model%formulation, u(:, mesh%brick(:, i)), stress(:, i))
      end do
   end associate
end subroutine indentation_field

!> Stiffness in the sample frame (GPa), and of each infinite element of the finest mesh (mN/um).
subroutine indentation_stiffness(handle, facets, stiffness, euler, rotated, infinite)
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr, c_ptr
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use fe_element, only: infinite_stiffness
   use fe_indentation, only: indentation_model_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: facets
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: rotated(6, 6), infinite(12, 12, facets)
   type(indentation_model_type), pointer :: model
   type(c_ptr) :: address
   integer :: i

   address = transfer(handle, c_null_ptr)
   call c_f_pointer(address, model)
   rotated = rotate_stiffness(stiffness, rotation_matrix(euler))
   do i = 1, facets
      call infinite_stiffness(model%grid(1)%mesh%x(:, model%grid(1)%mesh%facet(:, i)), rotated, infinite(:, :, i))
   end do
end subroutine indentation_stiffness

!> Revision of the numerics: results of one revision agree with each other.
subroutine indentation_revision(revision)
   use, intrinsic :: iso_c_binding, only: c_int
   use fe_indentation, only: numerics_revision
   implicit none
   !f2py threadsafe
   integer(c_int), intent(out) :: revision

   revision = numerics_revision
end subroutine indentation_revision
