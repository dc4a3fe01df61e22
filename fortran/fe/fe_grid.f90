!> One mesh with its matrix and contact nodes. It gives the load-depth curve of a crystal.
!>
!> The contact of a rigid, frictionless indenter with nodes of known normal compliance is a linear
!> complementarity problem. With nodal forces f ≥ 0 (mN, into the material), compliance F (um/mN)
!> and the height g - d of the indenter above the undeformed surface, the clearance is w = g - d + F
!> f ≥ 0, and f w = 0 at each node.
module fe_grid
   use, intrinsic :: iso_c_binding, only: c_ptr
   use indenters, only: indenter_type
   use basic_specimen, only: specimen_type
   use errors, only: error_type, raise
   use fe_assembly, only: assemble, assembly_type, energy_by_stiffness, expand_displacement, &
      & new_assembly, product_with, reaction
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: pi, wp
   use omp_lib, only: omp_get_wtime
   use linear_algebra, only: cholesky_factor, cholesky_inverse, cholesky_solve
   use machine, only: check_memory
   use sparse_cholesky, only: acquire_factor, analyse_pattern, cholesky_type, factorise, &
      & release_factor, retained_factor, solve_factored
   use text, only: to_text
   implicit none
   private
   public :: grid_type, curve_type, new_grid, indent_grid, solve_contact, contact_residual

   !> Newton steps on the active set before it is changed one node at a time, and steps in all.
   integer, parameter :: most_block_steps = 40, most_steps = 2000

   !> Does not change once made, so threads share it.
   type :: grid_type
      type(mesh_type) :: mesh
      type(assembly_type) :: assembly
      type(cholesky_type) :: cholesky
      !> Height of the indenter above each contact node at zero depth, um.
      real(wp), allocatable :: gap(:)
   end type grid_type

   type :: curve_type
      !> Depths (um), force (mN), and radius (um) of the circle whose area is that of the touching
      !> nodes.
      real(wp), allocatable :: depth(:), force(:), contact_radius(:)
      !> Wall time of the numeric factorisation, s.
      real(wp) :: seconds_factor = 0.0_wp
      !> Largest relative violation of the contact conditions, and relative imbalance of indenter
      !> force and reactions.
      real(wp) :: contact_residual = 0.0_wp, equilibrium_residual = 0.0_wp
      !> Number of the depth at which the contact left the refined zone of the mesh; 0 if it did
      !> not.
      integer :: left_zone = 0
      !> Displacement (um) of the nodes at the requested depth (3, nodes).
      real(wp), allocatable :: displacement(:, :)
      !> A modulus is a sum of the forces with these weights, 1/(um mN), (depths), if they are
      !> allocated. Its derivative by the stiffness of each material: for small changes of these
      !> (6, 6, materials) it changes by the sum of their products.
      real(wp), allocatable :: weight(:), by_material(:, :, :)
   end type curve_type

contains

   !> Nodal forces at one depth, by the primal-dual active set method that starts from `active`.
   subroutine solve_contact(compliance, gap, depth, active, force, error, rate)
      !> Normal displacements of the nodes by unit normal forces, um/mN; height of the indenter
      !> above each node at zero depth, and its depth, um.
      real(wp), intent(in) :: compliance(:, :), gap(:), depth
      !> In: a guess of the nodes in contact; out: the nodes in contact.
      logical, intent(inout) :: active(:)
      !> Forces into the material, mN.
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error
      !> Derivatives of the forces by the depth, mN/um.
      real(wp), intent(out), optional :: rate(:)
      real(wp), allocatable :: a(:, :), b(:, :), clearance(:)
      integer, allocatable :: set(:)
      logical, allocatable :: wrong(:)
      integer :: n, step, i

      n = size(gap)
      do step = 1, most_steps
         set = pack([(i, i=1, n)], active)
         force = 0.0_wp
         if (size(set) > 0) then
            a = compliance(set, set)
            b = reshape(depth - gap(set), [size(set), 2], [1.0_wp])
            call cholesky_factor(a, error)
            if (allocated(error)) return
            call cholesky_solve(a, b)
            force(set) = b(:, 1)
            if (present(rate)) then
               rate = 0.0_wp
               rate(set) = b(:, 2)
            end if
         end if
         clearance = gap - depth + matmul(compliance(:, set), force(set))
         wrong = (active .and. force < 0.0_wp) &
            & .or. (.not. active .and. clearance < -1.0e-13_wp*depth)
         if (.not. any(wrong)) return
         if (step <= most_block_steps) then
            active = active .neqv. wrong
         else
            ! Murty's rule cannot cycle: only the last of the wrong nodes changes.
            i = findloc(wrong, .true., dim=1, back=.true.)
            active(i) = .not. active(i)
         end if
      end do
      call raise(error, 'the contact of '//to_text(n)//' nodes at depth '//to_text(depth) &
         & //' um was not found in '//to_text(most_steps)//' steps')
   end subroutine solve_contact

   !> Largest violation of the contact conditions. Forces are relative to the largest nodal force,
   !> clearances relative to the depth.
   pure real(wp) function contact_residual(compliance, gap, depth, force) result(residual)
      !> As in `solve_contact`.
      real(wp), intent(in) :: compliance(:, :), gap(:), depth, force(:)
      real(wp), allocatable :: clearance(:), relative(:)

      clearance = (gap - depth + matmul(compliance, force))/depth
      relative = force/max(maxval(abs(force)), tiny(1.0_wp))
      residual = max(maxval(-relative), maxval(-clearance), maxval(abs(relative*clearance)), 0.0_wp)
   end function contact_residual

   !> The mesh of a specimen with its analysed matrix, ready to be indented.
   subroutine new_grid(specimen, indenter, refine, grid, error)
      class(specimen_type), intent(in) :: specimen
      class(indenter_type), intent(in) :: indenter
      !> Elements per contact radius relative to the specimen's default.
      real(wp), intent(in) :: refine
      type(grid_type), intent(out) :: grid
      type(error_type), allocatable, intent(out) :: error

      call new_mesh(specimen%plan(refine), grid%mesh, error)
      if (allocated(error)) return
      call new_assembly(grid%mesh, grid%assembly)
      associate (x => grid%mesh%x(:, grid%mesh%contact), a => grid%assembly)
         grid%gap = indenter%gap(sqrt(x(1, :)**2 + x(2, :)**2))
         call analyse_pattern(a%column_start, a%row, a%group, a%n_contact, grid%cholesky, error)
      end associate
   end subroutine new_grid

   !> Compute the curve at its given depths: factor the matrix, solve the contact at every depth,
   !> and compare force and reactions at the last one.
   subroutine indent_grid(grid, formulation, c, field_step, curve, error)
      type(grid_type), intent(in) :: grid
      !> Formulation of the bricks (`fe_element`); number of the depth whose displacement is stored,
      !> 0: none.
      integer, intent(in) :: formulation, field_step
      !> Stiffness of the materials in the sample frame, GPa (6, 6, materials).
      real(wp), intent(in) :: c(:, :, :)
      !> Only its depths are read.
      type(curve_type), intent(inout) :: curve
      type(error_type), allocatable, intent(out) :: error
      type(c_ptr) :: factor
      !> Normal displacements of the contact nodes by unit normal forces, um/mN; nodal forces into
      !> the material, mN (contact nodes, depths); values of the matrix, mN/um; displacement of
      !> every node, um (3, nodes).
      real(wp), allocatable :: compliance(:, :), forces(:, :), rates(:, :), values(:), u(:, :, :)
      real(wp) :: reaction_force(3), total, start
      integer :: n, depths

      call acquire_factor(grid%cholesky, factor, error)
      if (allocated(error)) return
      n = grid%assembly%n_contact
      depths = size(curve%depth)
      solve: block
         call check_memory(8.0_wp &
            & *(size(grid%assembly%row) + 300.0_wp*size(grid%mesh%representative) + 2.0_wp*n**2), &
            & 'the matrix of '//to_text(grid%assembly%unknowns)//' unknowns', error)
         if (allocated(error)) exit solve
         allocate (values(size(grid%assembly%row)), compliance(n, n), forces(n, depths), &
            & rates(n, depths))
         call assemble(grid%mesh, grid%assembly, formulation, c, values, error)
         if (allocated(error)) exit solve
         start = omp_get_wtime()
         call factorise(grid%cholesky, factor, values, error)
         if (allocated(error)) exit solve
         curve%seconds_factor = omp_get_wtime() - start
         call retained_factor(grid%cholesky%handle, factor, compliance)
         call cholesky_inverse(compliance)
         call solve_depths()
         if (allocated(error)) exit solve
         if (field_step > 0) then
            call solve_displacements(grid, factor, values, forces(:, field_step:field_step), 3, u)
            curve%displacement = u(:, :, 1)
         end if
         call solve_displacements(grid, factor, values, forces(:, depths:), 3, u)
         call reaction(grid%mesh, formulation, c, u(:, :, 1), reaction_force)
         if (allocated(curve%weight)) call differentiate()
         total = sum(forces(:, depths))
         curve%equilibrium_residual = maxval(abs(reaction_force - [0.0_wp, 0.0_wp, total]))/total
      end block solve
      call release_factor(grid%cholesky%handle, factor)

   contains

      !> Solve the contact at every depth; each solution starts from that of the depth before.
      subroutine solve_depths()
         logical, allocatable :: active(:), at_edge(:)
         integer :: i

         associate (x => grid%mesh%x(:, grid%mesh%contact))
            at_edge = hypot(x(1, :), x(2, :)) > grid%mesh%contact_limit - grid%mesh%element_size
         end associate
         curve%force = 0.0_wp*curve%depth
         curve%contact_radius = curve%force
         active = grid%gap < 0.5_wp*curve%depth(1)
         do i = 1, size(curve%depth)
            call solve_contact(compliance, grid%gap, curve%depth(i), active, forces(:, i), error, &
               & rates(:, i))
            if (allocated(error)) return
            if (any(active .and. at_edge)) then
               curve%left_zone = i
               call raise(error, 'the contact leaves the refined zone of the mesh at depth ' &
                  & //to_text(curve%depth(i))//' um (it may reach ' &
                  & //to_text(grid%mesh%contact_limit - grid%mesh%element_size)//' um)')
               return
            end if
            curve%force(i) = sum(forces(:, i))
            curve%contact_radius(i) = sqrt(count(forces(:, i) > 0.0_wp)/pi)*grid%mesh%element_size
            curve%contact_residual = max(curve%contact_residual, &
               & contact_residual(compliance, grid%gap, curve%depth(i), forces(:, i)))
         end do
      end subroutine solve_depths

      !> Derivative of the modulus, by the adjoint of the contact. For a change dF of the compliance
      !> the forces f change by -F⁻¹ dF f, and their sum by -rᵀ dF f, r the rate of f by the depth:
      !> by uᵀ dK v with the displacements u and v under r and f. Nodes at the edge have no force,
      !> so those that come into contact do not count.
      subroutine differentiate()
         real(wp), allocatable :: v(:, :, :)
         real(wp) :: factor_error
         integer, allocatable :: used(:)
         integer :: i

         used = pack([(i, i=1, depths)], abs(curve%weight) > 0.0_wp)
         call solve_displacements(grid, factor, values, rates(:, used), 0, u)
         call solve_displacements(grid, factor, values, forces(:, used), 0, v)
         do i = 1, size(used)
            v(:, :, i) = curve%weight(used(i))*v(:, :, i)
         end do
         allocate (curve%by_material, mold=c)
         call energy_by_stiffness(grid%mesh, formulation, c, u, v, curve%by_material)
         ! The forces of the contact have the precision of the factor. This factor, nearly 1, makes
         ! the derivative exact where all stiffnesses change alike.
         factor_error = dot_product(curve%weight, curve%force)/sum(curve%by_material*c)
         curve%by_material = factor_error*curve%by_material
      end subroutine differentiate
   end subroutine indent_grid

   !> Displacements of every node under forces of the contact nodes. The factor is of single
   !> precision; up to `most_refinements` times the solutions are refined, until the residuals
   !> are a small share of the largest force.
   subroutine solve_displacements(grid, factor, values, force, most_refinements, u)
      type(grid_type), intent(in) :: grid
      !> Workspace with the factor; values of the matrix, mN/um.
      type(c_ptr), intent(in) :: factor
      real(wp), intent(in) :: values(:)
      !> Forces into the material, mN (contact nodes, cases); um (3, nodes, cases).
      real(wp), intent(in) :: force(:, :)
      integer, intent(in) :: most_refinements
      real(wp), allocatable, intent(out) :: u(:, :, :)
      real(wp), parameter :: small_share = 1.0e-9_wp
      real(wp), allocatable :: x(:, :), residual(:, :)
      integer :: i, j

      allocate (x(grid%assembly%unknowns, size(force, 2)), source=0.0_wp)
      allocate (residual, source=x)
      do i = 0, most_refinements
         do j = 1, size(force, 2)
            if (i > 0) residual(:, j) = -product_with(grid%assembly, values, x(:, j))
         end do
         associate (normal => residual(size(x, 1) - size(force, 1) + 1:, :))
            normal = normal - force
         end associate
         if (maxval(abs(residual)) <= small_share*maxval(abs(force))) exit
         call solve_factored(grid%cholesky%handle, factor, size(force, 2), residual)
         x = x + residual
      end do
      allocate (u(3, size(grid%mesh%x, 2), size(force, 2)))
      do j = 1, size(force, 2)
         call expand_displacement(grid%mesh, grid%assembly, x(:, j), u(:, :, j))
      end do
   end subroutine solve_displacements

end module fe_grid
