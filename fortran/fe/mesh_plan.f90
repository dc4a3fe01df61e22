!> What the mesh generator is asked for: a box of bricks under the indenter, and stages of layers around it, from the inside out.
module mesh_plan
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use text, only: to_text
   implicit none
   private
   public :: mesh_plan_type, mesh_stage_type, core_of_contact, finest_edge, layers_of_ratio, graded_layers, check_plan, &
      & count_items, surface_facets
   public :: growing, to_ball, to_cylinder, closed_by_infinite, clamped_bottom, clamped_around

   !> What the surface becomes over a stage: `ratio` times as large, a hemisphere, or a cylinder.
   integer, parameter :: growing = 1, to_ball = 2, to_cylinder = 3
   !> What lies around the last layer: infinite elements; a clamped bottom and free sides; or both clamped.
   integer, parameter :: closed_by_infinite = 1, clamped_bottom = 2, clamped_around = 3

   !> Layers around the current surface. What lies above the depth `plane` keeps its depth while it grows sideways, and its material.
   type :: mesh_stage_type
      !> The surface is coarsened 2:1 first; then levels of bricks are put under its bottom, as wide as that and so deep in all (um).
      logical :: coarsen = .false.
      integer :: floor_levels = 0
      real(wp) :: floor_depth = 0.0_wp
      !> Layers, and growth of their thickness from one to the next (> 1).
      integer :: layers = 0
      real(wp) :: growth = 0.0_wp
      integer :: shape = growing
      !> In all, of a growing surface; radius of the ball or cylinder and depth of the cylinder, um.
      real(wp) :: ratio = 1.0_wp, radius = 0.0_wp, depth = 0.0_wp
      !> um; and the material of what lies below it.
      real(wp) :: plane = 0.0_wp
      integer :: material = 1
   end type mesh_stage_type

   type :: mesh_plan_type
      !> Cells of the box per half-width and over its depth; it is of material 1.
      integer :: half_cells = 0, depth_cells = 0
      !> Half-width and depth of the box, um.
      real(wp) :: half_width = 0.0_wp, depth = 0.0_wp
      !> Its half-width over that of the default's box.
      real(wp) :: widening = 1.0_wp
      type(mesh_stage_type), allocatable :: stages(:)
      integer :: closing = closed_by_infinite
      !> The bottom of the box and of the layers is clamped where this depth (um) is reached: layers go on sideways only. 0: nowhere.
      real(wp) :: clamped_depth = 0.0_wp
      !> Materials of the infinite elements below the last stage's plane, and above it.
      integer :: far_material(2) = 1
   end type mesh_plan_type

   !> Elements per contact radius at refine = 1 where there is no block.
   real(wp), parameter :: fineness = 9.5_wp
   !> Bricks of the largest mesh.
   integer, parameter :: most_bricks = 400000

contains

   !> Edge of the elements under a contact at refine = 1, um.
   pure real(wp) function finest_edge(contact_radius)
      !> um.
      real(wp), intent(in) :: contact_radius

      finest_edge = contact_radius/fineness
   end function finest_edge

   !> The box under a contact: nothing around it yet.
   pure function core_of_contact(refine, contact_radius, zone) result(plan)
      !> Relative to the default; contact radius, um; size of the refined zone relative to the default.
      real(wp), intent(in) :: refine, contact_radius, zone
      type(mesh_plan_type) :: plan
      !> Depth of the box in contact radii.
      real(wp), parameter :: depth = 1.1_wp
      real(wp) :: across

      across = fineness*refine
      ! Room for an elliptical contact, and for the ring of nodes around it that must stay free.
      plan%half_cells = max(4, nint(1.25_wp*across*zone) + 2)
      plan%widening = plan%half_cells/real(max(4, nint(1.25_wp*across) + 2), wp)
      plan%depth_cells = max(2, 2*nint(0.5_wp*depth*across))
      plan%half_width = contact_radius*plan%half_cells/across
      plan%depth = contact_radius*plan%depth_cells/across
   end function core_of_contact

   !> Layers that make the surface `ratio` times as large, each about `growth` times as thick as the one before at refine = 1.
   pure function layers_of_ratio(ratio, growth, refine) result(stage)
      real(wp), intent(in) :: ratio, growth, refine
      type(mesh_stage_type) :: stage
      !> What rounding may take from a number of layers that ends in a half.
      real(wp), parameter :: rounding = 1.0e-9_wp

      stage%ratio = ratio
      stage%layers = max(1, nint(log(ratio)/log(growth)*refine + rounding))
      stage%growth = ratio**(1.0_wp/stage%layers)
   end function layers_of_ratio

   !> Layers from one half-width to another (um), which grow faster from some contact radii on.
   pure function graded_layers(from, to, contact_radius, refine, plane, material) result(stages)
      !> um.
      real(wp), intent(in) :: from, to, contact_radius
      !> Layers relative to the default.
      real(wp), intent(in) :: refine
      !> Of the stages, um.
      real(wp), intent(in) :: plane
      !> Below the plane.
      integer, intent(in) :: material
      type(mesh_stage_type), allocatable :: stages(:)
      !> Growth at refine = 1, and up to which distance (contact radii).
      real(wp), parameter :: growth(3) = [1.2_wp, 1.3_wp, 1.5_wp], limit(3) = [5.0_wp, 12.0_wp, huge(1.0_wp)]
      type(mesh_stage_type) :: stage
      real(wp) :: width, goal
      integer :: i

      allocate (stages(0))
      width = from
      do i = 1, size(growth)
         goal = min(to, limit(i)*contact_radius)
         ! No layer that is much thinner than the others.
         if (to < 1.1_wp*goal) goal = to
         if (goal < 1.05_wp*width) cycle
         stage = layers_of_ratio(goal/width, growth(i), refine)
         stage%plane = plane
         stage%material = material
         stages = [stages, stage]
         width = goal
      end do
   end function graded_layers

   !> Refuse a plan whose mesh cannot be made.
   subroutine check_plan(plan, error)
      type(mesh_plan_type), intent(in) :: plan
      type(error_type), allocatable, intent(out) :: error
      integer :: i, step, levels, nodes, bricks, hanging

      if (plan%half_cells < 2 .or. plan%depth_cells < 2 .or. plan%half_cells > 200 .or. plan%depth_cells > 400) then
         call raise(error, 'a mesh of '//to_text(plan%half_cells)//' elements per half-width and '// &
            & to_text(plan%depth_cells)//' over the depth of its core cannot be made; allowed: 2 to 200, and 2 to 400', &
            & exit_bad_input)
         return
      end if
      if (.not. (plan%half_width > 0.0_wp .and. plan%depth > 0.0_wp .and. plan%half_width <= huge(1.0_wp) &
         & .and. plan%depth <= huge(1.0_wp))) then
         call raise(error, 'the core of the mesh has half-width '//to_text(plan%half_width)//' um and depth '// &
            & to_text(plan%depth)//' um; both must be positive', exit_bad_input)
         return
      end if
      step = 1
      levels = plan%depth_cells
      do i = 1, size(plan%stages)
         associate (stage => plan%stages(i))
            if (stage%coarsen) step = 2*step
            if (mod(levels, step) /= 0 .or. mod(2*plan%half_cells, step) /= 0) then
               call raise(error, 'the core of the mesh has '//to_text(2*plan%half_cells)//' x '//to_text(levels) &
                  & //' elements, not multiples of '//to_text(step), exit_bad_input)
               return
            end if
            levels = levels + step*stage%floor_levels
            if (stage%layers < 0 .or. .not. stage%growth > 1.0_wp .or. .not. stage%growth < 10.0_wp) then
               call raise(error, to_text(stage%layers)//' layers growing by '//to_text(stage%growth) &
                  & //' cannot be made; allowed: at least none, and 1 to 10', exit_bad_input)
               return
            end if
         end associate
      end do
      call count_items(plan, nodes, bricks, hanging)
      if (bricks > most_bricks) call raise(error, 'a mesh of '//to_text(bricks)//' elements is too large; allowed: up to ' &
         & //to_text(most_bricks), exit_bad_input)
   end subroutine check_plan

   !> How many nodes, bricks and hanging nodes the mesh of a plan will have.
   pure subroutine count_items(plan, nodes, bricks, hanging)
      type(mesh_plan_type), intent(in) :: plan
      integer, intent(out) :: nodes, bricks, hanging
      integer :: i, step, nx, nz

      nx = 2*plan%half_cells
      nz = plan%depth_cells
      nodes = (nx + 1)**2*(nz + 1)
      bricks = nx**2*nz
      hanging = 0
      step = 1
      do i = 1, size(plan%stages)
         associate (stage => plan%stages(i))
            if (stage%coarsen) then
               hanging = hanging + surface_nodes(nx, nz) - surface_nodes(nx/2, nz/2)
               nx = nx/2
               nz = nz/2
            end if
            nodes = nodes + stage%floor_levels*(nx + 1)**2
            bricks = bricks + stage%floor_levels*nx**2
            nz = nz + stage%floor_levels
            nodes = nodes + stage%layers*surface_nodes(nx, nz)
            bricks = bricks + stage%layers*surface_facets(nx, nz)
         end associate
      end do
   end subroutine count_items

   !> Nodes of the sides and the bottom of a lattice, at most.
   pure integer function surface_nodes(nx, nz)
      integer, intent(in) :: nx, nz

      surface_nodes = (nx + 1)**2 + 4*nx*nz
   end function surface_nodes

   !> Facets of the sides and the bottom of a lattice.
   pure integer function surface_facets(nx, nz)
      !> Cells along x and y, and along z.
      integer, intent(in) :: nx, nz

      surface_facets = nx**2 + 4*nx*nz
   end function surface_facets
end module mesh_plan
