! Indentation models for Python, under handles of the kind 'indentation'; `object_release` frees them.

!> Indent one crystal: stiffness in the crystal frame (GPa), Bunge-Euler angles (radians). `depths`: of the model. `curve`: depth
!> (um), force (mN), contact radius (um), modulus of
!> that depth alone (GPa). `moduli` (GPa): estimate, slope with intercept, last point, estimates on each mesh. `diagnostics`: wall seconds,
!> seconds of factorisation, contact residual, equilibrium residual, elements of all solves.
subroutine indentation_run(handle, depths, stiffness, euler, curve, moduli, diagnostics, status, message)
   use fe_indentation, only: indentation_model_type, indentation_result_type, simulate_indentation
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use simulation_handles, only: model_of_handle
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: depths
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: curve(depths, 4), moduli(5), diagnostics(5)
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(indentation_model_type), pointer :: model
   type(indentation_result_type) :: result
   type(error_type), allocatable :: error

   curve = 0.0_c_double
   moduli = 0.0_c_double
   diagnostics = 0.0_c_double
   call model_of_handle(handle, model, error)
   if (.not. allocated(error)) call simulate_indentation(model, stiffness, euler, result, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   curve(:, 1) = result%depth
   curve(:, 2) = result%force
   curve(:, 3) = result%contact_radius
   curve(:, 4) = result%modulus_by_depth
   moduli(:3) = [result%modulus, result%modulus_slope, result%modulus_last]
   moduli(4:3 + size(result%modulus_of_mesh)) = result%modulus_of_mesh
   diagnostics = [result%seconds, result%seconds_factor, result%contact_residual, result%equilibrium_residual, &
      & real(result%elements, c_double)]
end subroutine indentation_run

!> Displacement of the nodes (um) and mean stress of the bricks (GPa, order 11,22,33,23,13,12) of the finest mesh at depth
!> number `step`, of one crystal: stiffness in the crystal frame (GPa), Bunge-Euler angles (radians).
subroutine indentation_field(handle, step, nodes, bricks, stiffness, euler, displacement, stress, status, message)
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use fe_element, only: brick_stress
   use fe_indentation, only: indentation_model_type, indentation_result_type, simulate_indentation
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use simulation_handles, only: model_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: step, nodes, bricks
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: displacement(3, nodes), stress(6, bricks)
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(indentation_model_type), pointer :: model
   type(indentation_result_type) :: result
   type(error_type), allocatable :: error
   real(c_double), allocatable :: c(:, :, :)
   integer :: i

   displacement = 0.0_c_double
   stress = 0.0_c_double
   call model_of_handle(handle, model, error)
   if (.not. allocated(error)) call simulate_indentation(model, stiffness, euler, result, error, step)
   call error_to_status(error, status, message)
   if (status /= 0) return
   displacement = result%displacement
   c = model%specimen%materials(rotate_stiffness(stiffness, rotation_matrix(euler)))
   associate (mesh => model%grid(1)%mesh, u => result%displacement)
      do i = 1, bricks
         call brick_stress(mesh%x(:, mesh%brick(:, i)), c(:, :, mesh%material(i)), model%formulation, mesh%growth(i), &
            & u(:, mesh%brick(:, i)), stress(:, i))
      end do
   end associate
end subroutine indentation_field

!> Stiffness of each of the mesh's `materials` in the sample frame, `rotated` (GPa), and of each infinite element of the finest mesh, one a
!> facet of `facets` (mN/um).
subroutine indentation_stiffness(handle, materials, facets, stiffness, euler, rotated, infinite, status, message)
   use crystal_elasticity, only: rotate_stiffness, rotation_matrix
   use fe_element, only: infinite_stiffness
   use fe_indentation, only: indentation_model_type
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use simulation_handles, only: model_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: materials, facets
   real(c_double), intent(in) :: stiffness(6, 6), euler(3)
   real(c_double), intent(out) :: rotated(6, 6, materials), infinite(12, 12, facets)
   integer(c_int), intent(out) :: status
   character(len=1024), intent(out) :: message
   type(indentation_model_type), pointer :: model
   type(error_type), allocatable :: error
   integer :: i

   rotated = 0.0_c_double
   infinite = 0.0_c_double
   call model_of_handle(handle, model, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   rotated = model%specimen%materials(rotate_stiffness(stiffness, rotation_matrix(euler)))
   associate (mesh => model%grid(1)%mesh)
      do i = 1, facets
         call infinite_stiffness(mesh%x(:, mesh%facet(:, i)), rotated(:, :, mesh%facet_material(i)), infinite(:, :, i))
      end do
   end associate
end subroutine indentation_stiffness
