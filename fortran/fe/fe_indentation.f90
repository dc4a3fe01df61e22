!> The simulation of an indentation by finite elements. A model has the meshes and depths of a test.
!> Indenting a crystal with it gives a curve and its modulus.
!>
!> Lengths are in um, forces in mN, stiffnesses in GPa. The indenter moves along -z of the sample.
module fe_indentation
   use indenters, only: indenter_type
   use basic_specimen, only: specimen_type
   use crystal_elasticity, only: bond_matrix, check_stiffness, rotate_stiffness, rotation_matrix
   use errors, only: error_type, locate_error, machine_failure, prefix_error, refuse
   use fe_element, only: brick_full, brick_incompatible, brick_selective
   use fe_grid, only: curve_type, grid_type, indent_grid, new_grid
   use kinds, only: pi, wp
   use omp_lib, only: omp_get_wtime
   use settings_schema, only: settings_type
   use sparse_cholesky, only: free_analysis
   use specimens, only: new_indentation
   use text, only: to_text
   implicit none
   private
   public :: indentation_model_type, indentation_result_type, new_indentation_model, &
      & new_wider_model, free_indentation_model, simulate_indentation, numerics_revision, &
      & least_elements

   !> Revision of the numerics: it increases with every change that alters results, and is part of
   !> the identity of stored results.
   integer, parameter :: numerics_revision = 7

   !> What is indented, with which indenter, and to which depths.
   type :: indentation_type
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen
      !> Formulation of the bricks (`fe_element`).
      integer :: formulation = brick_selective
      !> Elements per contact radius relative to the default, for each mesh.
      real(wp), allocatable :: refine(:)
      !> Whether the second mesh is made only for the crystals that need it.
      logical :: as_needed = .false.
      !> Depths of the curve, and the depths around its last point that give the contact stiffness
      !> (um).
      real(wp), allocatable :: depth(:), window(:)
   end type indentation_type

   !> A test with its meshes. It does not change once made, so threads share it.
   type, extends(indentation_type) :: indentation_model_type
      !> Grids, the finest first.
      type(grid_type), allocatable :: grid(:)
      !> Elements of all meshes.
      integer :: elements = 0
   contains
      final :: free_indentation_model
   end type indentation_model_type

   !> The curve of the finest mesh, its force extrapolated if there are two meshes, and the moduli.
   !> While it is computed, the curve includes the depths of the window.
   type, extends(curve_type) :: indentation_result_type
      !> The estimate of the indentation modulus, GPa, and a diagnostic: from the slope of a line
      !> with intercept.
      real(wp) :: modulus = 0.0_wp, modulus_slope = 0.0_wp
      !> Derivatives of the modulus. A small change dC of the stiffness in crystal axes changes the
      !> modulus by sum(by_stiffness*dC). `by_rotation` is for rotations of the crystal about the
      !> axes of the sample, GPa. All are 0 for estimators other than 'curve'.
      real(wp) :: by_stiffness(6, 6) = 0.0_wp, by_rotation(3) = 0.0_wp
      !> Modulus from each depth alone, GPa; estimate from each mesh alone, GPa, the finest first.
      real(wp), allocatable :: modulus_by_depth(:), modulus_of_mesh(:)
      !> Elements of all solves.
      integer :: elements = 0
      !> Size of the refined zone of the mesh relative to the default (`new_wider_model`); total
      !> wall time, s.
      real(wp) :: zone = 1.0_wp, seconds = 0.0_wp
   end type indentation_result_type

   !> The estimate 'curve' uses a depth if the contact radius spans at least this many elements
   !> (docs/simulation.md).
   real(wp), parameter :: least_elements = 5.0_wp
   !> Contact radii of the window: from 0.84 to 1.16 times the last one, at this number of depths
   !> (docs/simulation.md).
   real(wp), parameter :: window_share = 0.16_wp
   integer, parameter :: window_depths = 25
   integer :: i
   !> Depths of the window, scaled to -1 .. 1.
   real(wp), parameter :: window_position(window_depths) = &
      & [(2.0_wp*(i - 1)/(window_depths - 1) - 1.0_wp, i=1, window_depths)]
   !> Distance, in elements, between the edge of the contact and the edge of the area of its nodes
   !> (half-space; docs/simulation.md).
   real(wp), parameter :: edge_bias = 0.31_wp
   !> The largest refined zone of a mesh relative to the default, and the largest factor of one
   !> widening.
   real(wp), parameter :: widest = 4.0_wp, most_widening = 2.0_wp

contains

   !> Make the meshes that &specimen, &indenter and &simulation define, and analyse their matrices.
   subroutine new_indentation_model(settings, model, error)
      type(settings_type), intent(in) :: settings
      type(indentation_model_type), intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      call new_indentation(settings, model%indenter, model%specimen, error)
      if (allocated(error)) return
      associate (simulation => settings%simulation, indenter => model%indenter)
         model%formulation = merge(brick_full, brick_selective, simulation%integration == 'full')
         if (model%specimen%element == 'c3d8i') model%formulation = brick_incompatible
         model%depth = indenter%depth_of([(indenter%contact_radius*i/simulation%depths, i=1, &
            & simulation%depths)])
         model%depth(simulation%depths) = indenter%depth
         model%window = [real(wp) ::]
         if (model%specimen%estimator /= 'curve') then
            call indenter%check_length('contact_radius_um', &
               & (1.0_wp + window_share)*indenter%contact_radius, error)
            call prefix_error(error, 'with the window of the stiffness ')
            call locate_error(error, '', 'indenter')
            if (allocated(error)) return
            model%window = indenter%depth_of( &
               & indenter%contact_radius*(1.0_wp + window_share*window_position))
         end if
         model%refine = simulation%refine*[1.0_wp, model%specimen%coarse_ratio]
         model%as_needed = .not. allocated(simulation%extrapolate)
         if (allocated(simulation%extrapolate)) then
            model%refine = model%refine(:merge(2, 1, simulation%extrapolate))
         end if
         call make_grids(model, error)
         if (allocated(error)) return
         if (.not. any(is_resolved(model))) then
            call refuse(error, 'the contact radius spans ' &
               & //to_text(indenter%contact_radius/model%grid(1)%mesh%element_size, 3) &
               & //' elements at the last depth, at least '//to_text(least_elements) &
               & //' are needed (refine = '//to_text(simulation%refine)//')')
            call free_indentation_model(model)
         end if
      end associate
   end subroutine new_indentation_model

   !> The same specimen, fineness and depths with a larger refined zone of the meshes.
   subroutine new_wider_model(model, zone, wider, error)
      type(indentation_model_type), intent(in) :: model
      !> Size of the zone relative to the default.
      real(wp), intent(in) :: zone
      type(indentation_model_type), intent(out) :: wider
      type(error_type), allocatable, intent(out) :: error

      wider%indentation_type = model%indentation_type
      wider%specimen%zone = zone
      call wider%specimen%check_sizes(error)
      if (allocated(error)) return
      call make_grids(wider, error)
   end subroutine new_wider_model

   !> Make the meshes of a model and analyse their matrices.
   subroutine make_grids(model, error)
      type(indentation_model_type), intent(inout) :: model
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      allocate (model%grid(merge(1, size(model%refine), model%as_needed)))
      do i = 1, size(model%grid)
         call new_grid(model%specimen, model%indenter, model%refine(i), model%grid(i), error)
         if (allocated(error)) then
            call free_indentation_model(model)
            return
         end if
         associate (mesh => model%grid(i)%mesh)
            model%elements = model%elements + size(mesh%brick, 2) + size(mesh%facet, 2)
         end associate
      end do
   end subroutine make_grids

   !> Whether the contact radius on a half-space spans enough elements for the estimate of the
   !> modulus, at each depth. The modulus of a grain depends on the depths that are used. So a finer
   !> mesh uses the same depths as the default mesh.
   pure function is_resolved(model)
      type(indentation_model_type), intent(in) :: model
      logical :: is_resolved(size(model%depth))
      real(wp) :: contact_radius(size(model%depth))

      contact_radius = model%indenter%contact_radius_of(model%depth)
      is_resolved = contact_radius >= least_elements*max(model%grid(1)%mesh%element_size, &
         & model%specimen%element_size)*(1.0_wp - 1.0e-9_wp)
   end function is_resolved

   !> Release the memory of a model outside Fortran; the model is then empty.
   ! gfortran 12 finalises a dummy argument of intent(out), but does not restore its initial values.
   impure elemental subroutine free_indentation_model(model)
      type(indentation_model_type), intent(inout) :: model
      integer :: i

      model%elements = 0
      if (.not. allocated(model%grid)) return
      do i = 1, size(model%grid)
         call free_analysis(model%grid(i)%cholesky)
      end do
      deallocate (model%grid)
   end subroutine free_indentation_model

   !> Indent a crystal: compute the curve and its modulus, and the displacement at one depth if
   !> `field_step` is present.
   !>
   !> If the contact ellipse is so long that it leaves the refined zone of the mesh, the simulation
   !> is repeated on a mesh with a larger zone. If the error of one mesh may be too large for the
   !> crystal, a coarser mesh is made for it.
   subroutine simulate_indentation(model, stiffness, euler, result, error, field_step)
      type(indentation_model_type), intent(in) :: model
      !> Stiffness in the crystal frame (GPa) and Bunge-Euler angles (radians).
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(indentation_result_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      !> Number of the depth whose displacement is stored.
      integer, intent(in), optional :: field_step
      type(indentation_model_type) :: wider
      type(error_type), allocatable :: obstacle
      real(wp) :: c(6, 6), zone, widening, moduli(2), start, bond(6, 6)
      integer :: elements, step, i
      logical :: two_meshes

      start = omp_get_wtime()
      step = 0
      if (present(field_step)) step = field_step
      call check_stiffness(stiffness, error)
      if (allocated(error)) return
      if (.not. all(abs(euler) <= 1.0e3_wp)) then
         call refuse(error, 'the orientation ('//to_text(euler(1))//', '//to_text(euler(2))//', ' &
            & //to_text(euler(3))//') radians is not finite')
      else if (present(field_step) .and. (step < 1 .or. step > size(model%depth))) then
         call refuse(error, 'depth number '//to_text(step)//' does not exist; allowed: 1 to ' &
            & //to_text(size(model%depth)))
      end if
      if (allocated(error)) return
      c = rotate_stiffness(stiffness, rotation_matrix(euler))
      two_meshes = size(model%refine) == 2
      if (model%as_needed) then
         two_meshes = model%specimen%wants_extrapolation(model%refine(1), stiffness)
      end if
      zone = 1.0_wp
      call simulate_depths(model, c, two_meshes, step, result, error)
      elements = result%elements
      do while (result%left_zone > 0)
         ! The contact was inside the zone at the depth before. From there to the last depth a
         ! circular contact grows by this ratio of radii, and an elliptical one by about as much. A
         ! contact that left at the first depth gives no such estimate.
         widening = most_widening
         associate (radius => model%indenter%contact_radius_of([model%depth, model%window]), &
            & left => result%left_zone)
            if (left > 1) widening = min(widening, maxval(radius)/radius(left - 1))
         end associate
         zone = zone*widening
         if (zone > widest) exit
         call new_wider_model(model, zone, wider, obstacle)
         if (allocated(obstacle)) then
            error%message = error%message//', and no wider zone can be made: '//obstacle%line()
            if (obstacle%status == machine_failure) error%status = machine_failure
            exit
         end if
         call simulate_depths(wider, c, two_meshes, step, result, error)
         elements = elements + result%elements
         call free_indentation_model(wider)
      end do
      if (allocated(error)) return
      result%modulus = modulus_of(model, result%curve_type)
      result%depth = model%depth
      result%force = result%force(:size(model%depth))
      result%contact_radius = result%contact_radius(:size(model%depth))
      moduli = moduli_of(model, result%force)
      result%modulus_slope = moduli(2)
      result%modulus_by_depth = result%force/model%indenter%unit_force(model%depth)
      result%elements = elements
      result%zone = zone
      if (allocated(result%by_material)) then
         associate (by_c => model%specimen%by_crystal(result%by_material, c))
            ! A rotation, whose Bond matrix changes by dM, changes c by dM c + (dM c)ᵀ.
            result%by_rotation = [(2.0_wp*sum(by_c*matmul(rotated_by(i), c)), i=1, 3)]
            bond = bond_matrix(transpose(rotation_matrix(euler)))
            result%by_stiffness = matmul(transpose(bond), matmul(by_c, bond))
         end associate
      end if
      result%seconds = omp_get_wtime() - start
   end subroutine simulate_indentation

   !> Derivative of the Bond matrix of a rotation by its angle about an axis of the sample.
   pure function rotated_by(axis)
      integer, intent(in) :: axis
      real(wp) :: rotated_by(6, 6), turn(3, 3), unit(3, 3)
      integer :: i, j

      i = 1 + mod(axis, 3)
      j = 1 + mod(i, 3)
      unit = rotation_matrix([0.0_wp, 0.0_wp, 0.0_wp])
      turn = 0.0_wp
      turn(j, i) = 1.0_wp
      turn(i, j) = -1.0_wp
      ! The Bond matrix is of degree two in the rotation, so the central difference is exact.
      rotated_by = 0.5_wp*(bond_matrix(unit + turn) - bond_matrix(unit - turn))
   end function rotated_by

   !> Compute the curve, and extrapolate it if two meshes are requested.
   subroutine simulate_depths(model, c, two_meshes, field_step, result, error)
      type(indentation_model_type), intent(in) :: model
      !> Stiffness in the sample frame, GPa.
      real(wp), intent(in) :: c(6, 6)
      logical, intent(in) :: two_meshes
      integer, intent(in) :: field_step
      type(indentation_result_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      type(grid_type) :: coarse

      result%elements = model%elements
      result%depth = [model%depth, model%window]
      if (size(model%window) == 0) then
         result%weight = model%indenter%unit_force(model%depth)
         where (.not. is_resolved(model)) result%weight = 0.0_wp
         result%weight = result%weight/sum(result%weight**2)
      end if
      call indent_grid(model%grid(1), model%formulation, model%specimen%materials(c), field_step, &
         & result%curve_type, error)
      if (allocated(error)) return
      result%modulus_of_mesh = [modulus_of(model, result%curve_type)]
      if (.not. two_meshes) return
      if (size(model%grid) == 2) then
         call extrapolate_curve(model%grid(2))
         return
      end if
      call new_grid(model%specimen, model%indenter, model%refine(2), coarse, error)
      if (allocated(error)) return
      result%elements = result%elements + size(coarse%mesh%brick, 2) + size(coarse%mesh%facet, 2)
      call extrapolate_curve(coarse)
      call free_analysis(coarse%cholesky)

   contains

      !> Extrapolate the curve of the finest mesh with that of a coarser one, on the assumption that
      !> the error falls with the square of the element size.
      subroutine extrapolate_curve(grid)
         type(grid_type), intent(in) :: grid
         type(curve_type) :: other
         real(wp) :: ratio

         other%depth = result%depth
         if (allocated(result%weight)) other%weight = result%weight
         call indent_grid(grid, model%formulation, model%specimen%materials(c), 0, other, error)
         result%left_zone = other%left_zone
         if (allocated(error)) return
         ! Use the contact of the finer mesh.
         other%contact_radius = result%contact_radius
         result%modulus_of_mesh = [result%modulus_of_mesh, modulus_of(model, other)]
         ratio = (grid%mesh%element_size/model%grid(1)%mesh%element_size)**2
         result%force = result%force + (result%force - other%force)/(ratio - 1.0_wp)
         if (allocated(result%weight)) then
            result%by_material = result%by_material &
               & + (result%by_material - other%by_material)/(ratio - 1.0_wp)
         end if
         result%seconds_factor = result%seconds_factor + other%seconds_factor
         result%contact_residual = max(result%contact_residual, other%contact_residual)
         result%equilibrium_residual = max(result%equilibrium_residual, other%equilibrium_residual)
      end subroutine extrapolate_curve
   end subroutine simulate_depths

   !> The modulus by the estimator of the specimen, GPa (docs/simulation.md).
   !>
   !> Without a window it is the fit of `moduli_of`. With a window it is S/(2 a), as an instrument
   !> computes it. On a half-space the unit force U has the slope dU/dh = 2 a_H with the contact
   !> radius a_H, so S/(2 a_H) = dP/dU. This is the slope at the last depth of a parabola over the
   !> window. A discrete contact grows in steps. Weights that decrease towards both ends smooth the
   !> steps.
   pure real(wp) function modulus_of(model, curve) result(modulus)
      type(indentation_model_type), intent(in) :: model
      type(curve_type), intent(in) :: curve
      real(wp), dimension(window_depths) :: u, linear, square, weight, area
      real(wp) :: moduli(2), mixed
      integer :: n

      n = size(model%depth)
      if (size(model%window) == 0) then
         moduli = moduli_of(model, curve%force(:n))
         modulus = moduli(1)
         return
      end if
      weight = cos(0.5_wp*pi*window_position*(window_depths - 1)/(window_depths + 1))**2
      weight = weight/sum(weight)
      u = model%indenter%unit_force(model%window) - model%indenter%unit_force(model%depth(n))
      ! Polynomials of u of degree 1 and 2, orthogonal under the weights. At the last depth, u = 0,
      ! their slopes are 1 and -mixed.
      linear = u - sum(weight*u)
      mixed = sum(weight*u**2*linear)/sum(weight*linear**2)
      square = u**2 - sum(weight*u**2) - mixed*linear
      modulus = sum(weight*linear*curve%force(n + 1:))/sum(weight*linear**2) &
         & - mixed*sum(weight*square*curve%force(n + 1:))/sum(weight*square**2)
      if (model%specimen%estimator == 'stiffness_hertz') return
      ! The contact radius is that at the last depth of a line through the areas over the window.
      area = (curve%contact_radius(n + 1:) - edge_bias*model%grid(1)%mesh%element_size)**2
      u = model%window - model%depth(n)
      linear = u - sum(weight*u)
      modulus = modulus*model%indenter%contact_radius/sqrt(sum(weight*area) &
         & - sum(weight*u)*sum(weight*linear*area)/sum(weight*linear**2))
   end function modulus_of

   !> Moduli of a curve, GPa: from least squares through the origin over the resolved depths, and
   !> from the slope of a line with intercept.
   pure function moduli_of(model, force) result(moduli)
      type(indentation_model_type), intent(in) :: model
      !> mN (depths).
      real(wp), intent(in) :: force(:)
      real(wp) :: moduli(2)
      real(wp), dimension(size(force)) :: unit_force, x, y
      logical :: resolved(size(force))

      unit_force = model%indenter%unit_force(model%depth)
      resolved = is_resolved(model)
      moduli = sum(force*unit_force, mask=resolved)/sum(unit_force**2, mask=resolved)
      if (count(resolved) < 2) return
      x = unit_force - sum(unit_force, mask=resolved)/count(resolved)
      y = force - sum(force, mask=resolved)/count(resolved)
      moduli(2) = sum(x*y, mask=resolved)/sum(x**2, mask=resolved)
   end function moduli_of
end module fe_indentation
