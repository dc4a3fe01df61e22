!> The mesh generator: a uniform box of bricks under the indenter, wrapped in layers.
!>
!> The box is [-w, w] x [-w, w] x [-d, 0]; material is z < 0. A stage of the plan wraps layers of
!> bricks around the present surface (without its top). The nodes of the surface move on straight
!> lines to their places at the end of the stage, on a surface of the same shape, a hemisphere or a
!> cylinder. If the shape stays the same, bricks repeat from layer to layer up to scale, and so do
!> their stiffnesses. An interface that is a hemisphere or a cylinder is the end of a stage. A plane
!> interface is reached by the bottom of a stage. Bricks are then added under that bottom, and
!> layers continue around both; above the plane they grow sideways only. Before a stage the surface
!> may be coarsened 2:1; a node that then hangs takes the mean of its neighbours. Either a layer of
!> infinite elements, swept along rays from the origin, or clamped nodes surround the whole.
module fe_mesh
   use errors, only: error_type
   use kinds, only: wp
   use machine, only: check_memory
   use basic_specimen, only: check_plan, clamped_around, closed_by_infinite, growing, &
      & mesh_plan_type, mesh_stage_type, surface_facets, to_ball, to_cylinder
   use text, only: to_text
   implicit none
   private
   public :: mesh_type, new_mesh

   type :: mesh_type
      !> Coordinates of the nodes, um (3, nodes).
      real(wp), allocatable :: x(:, :)
      !> Nodes of each brick in Abaqus' order (8, bricks), and its material.
      integer, allocatable :: brick(:, :), material(:)
      !> Bricks of a class have the same material and are equal up to translation and scale. For
      !> each brick: its class and its scale, to which the stiffness is proportional; for each
      !> class: a brick of scale 1.
      integer, allocatable :: class(:), representative(:)
      real(wp), allocatable :: scale(:)
      !> Growth of the layer that contains each brick; 1 in boxes.
      real(wp), allocatable :: growth(:)
      !> Nodes of the facets that carry infinite elements (4, facets), and their materials.
      integer, allocatable :: facet(:, :), facet_material(:)
      !> Clamped nodes.
      integer, allocatable :: clamped(:)
      !> Hanging nodes. Hanging node j is the mean of the two or four nodes `master(:, j)`, which
      !> zeros follow.
      integer, allocatable :: hanging(:), master(:, :)
      !> Surface nodes that may touch the indenter.
      integer, allocatable :: contact(:)
      !> Largest distance of a contact from the centre, and edge of an element there, um.
      real(wp) :: contact_limit = 0.0_wp, element_size = 0.0_wp
   end type mesh_type

   !> Memory of a mesh with its pattern and the places of its entries, bytes per brick, rounded up
   !> from a measurement.
   real(wp), parameter :: bytes_per_brick = 6.0e3_wp
   !> Lengths that differ by less than this share are equal.
   real(wp), parameter :: equal = 1.0e-9_wp

contains

   !> Build the mesh of a plan.
   subroutine new_mesh(plan, mesh, error)
      type(mesh_plan_type), intent(in) :: plan
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      !> Node of each lattice point of the current surface; 0 for inner points, for points that
      !> coarsening removes, and for clamped points.
      integer, allocatable :: node_at(:, :, :)
      !> Lattice points of the four corners of each facet of the surface, counterclockwise seen from
      !> outside, (3, corner, facet).
      integer, allocatable :: quad(:, :, :)
      !> Lattice spacing of the current surface; numbers of its facets and of items made so far.
      integer :: step, n_facets, n_nodes, n_bricks, n_classes
      integer :: nodes, bricks, nx, i

      call check_plan(plan, bricks, error)
      if (allocated(error)) return
      call check_memory(bytes_per_brick*bricks, &
         & 'a mesh of '//to_text(bricks)//' elements', error)
      if (allocated(error)) return
      ! An upper bound: memory that is never written is never used.
      nodes = 3*bricks
      allocate (mesh%x(3, nodes), mesh%brick(8, bricks), mesh%material(bricks), &
         & mesh%class(bricks), mesh%representative(bricks))
      allocate (mesh%scale(bricks), mesh%growth(bricks), source=1.0_wp)
      allocate (mesh%hanging(0), mesh%master(4, 0))
      step = 1
      n_bricks = 0
      n_classes = 0
      call fill_box()
      do i = 1, size(plan%stages)
         if (plan%stages(i)%coarsen) call coarsen()
         if (plan%stages(i)%floor_levels > 0) call add_floor(plan%stages(i))
         ! If the bottom of the surface is clamped, no layers continue below it.
         nx = ubound(node_at, 1)
         if (plan%clamped_depth > 0.0_wp &
            & .and. mesh%x(3, node_at(0, 0, 0)) <= -plan%clamped_depth*(1.0_wp - equal)) then
            node_at(1:nx - 1, 1:nx - 1, 0) = 0
         end if
         call add_layers(plan%stages(i))
      end do
      mesh%x = mesh%x(:, :n_nodes)
      mesh%brick = mesh%brick(:, :n_bricks)
      mesh%material = mesh%material(:n_bricks)
      mesh%class = mesh%class(:n_bricks)
      mesh%scale = mesh%scale(:n_bricks)
      mesh%growth = mesh%growth(:n_bricks)
      mesh%representative = mesh%representative(:n_classes)
      call close_mesh()

   contains

      !> Make the box of bricks, and list the nodes of its top that may touch the indenter.
      subroutine fill_box()
         integer, allocatable :: top(:)
         integer :: n, i, j

         n = plan%half_cells
         allocate (node_at(0:2*n, 0:2*n, 0:0))
         ! The nodes of the levels below come first.
         n_nodes = plan%depth_cells*(2*n + 1)**2
         do j = -n, n
            do i = -n, n
               n_nodes = n_nodes + 1
               node_at(i + n, j + n, 0) = n_nodes
               mesh%x(:, n_nodes) = [(real(i, wp)/n)*plan%half_width, &
                  & (real(j, wp)/n)*plan%half_width, 0.0_wp]
            end do
         end do
         mesh%element_size = plan%half_width/n
         mesh%contact_limit = plan%half_width
         ! A hanging node has no displacement of its own, so it cannot be in contact.
         if (plan%stages(max(1, findloc(plan%stages%layers > 0, .true., dim=1)))%coarsen) then
            mesh%contact_limit = plan%half_width - mesh%element_size
         end if
         top = reshape(node_at, [size(node_at)])
         mesh%contact = pack(top, &
            & norm2(mesh%x(:2, top), dim=1) <= mesh%contact_limit*(1.0_wp + equal))
         n_nodes = 0
         call add_floor(mesh_stage_type(floor_levels=plan%depth_cells, floor_depth=plan%depth))
         n_nodes = maxval(top)
      end subroutine fill_box

      !> Add levels of equal bricks under the bottom of the surface, which is flat and uniform.
      subroutine add_floor(stage)
         type(mesh_stage_type), intent(in) :: stage
         integer, parameter :: corner(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, &
            & 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
         integer, allocatable :: extended(:, :, :)
         integer :: nx, levels, first, i, j, k

         nx = ubound(node_at, 1)
         levels = stage%floor_levels*step
         allocate (extended(0:nx, 0:nx, 0:ubound(node_at, 3) + levels), source=0)
         extended(:, :, levels:) = node_at
         do k = 0, stage%floor_levels - 1
            do j = 0, nx, step
               do i = 0, nx, step
                  n_nodes = n_nodes + 1
                  extended(i, j, k*step) = n_nodes
                  mesh%x(:, n_nodes) = mesh%x(:, extended(i, j, levels)) - [0.0_wp, 0.0_wp, &
                     & stage%floor_depth*(stage%floor_levels - k)/stage%floor_levels]
               end do
            end do
         end do
         first = n_bricks + 1
         do k = 0, levels - step, step
            do j = 0, nx - step, step
               do i = 0, nx - step, step
                  n_bricks = n_bricks + 1
                  mesh%brick(:, n_bricks) = &
                     & nodes_of(extended, spread([i, j, k], 2, 8) + step*corner)
               end do
            end do
         end do
         n_classes = n_classes + 1
         mesh%representative(n_classes) = first
         mesh%class(first:n_bricks) = n_classes
         mesh%material(first:n_bricks) = stage%material
         extended(1:nx - 1, 1:nx - 1, 1:levels) = 0
         call move_alloc(extended, node_at)
      end subroutine add_floor

      !> Add the layers of a stage around the current surface.
      subroutine add_layers(stage)
         type(mesh_stage_type), intent(in) :: stage
         integer, allocatable :: first_class(:)
         real(wp), allocatable :: start(:, :), finish(:, :)
         real(wp) :: share
         integer :: layer, points, f, p
         logical :: above

         if (stage%layers == 0) return
         call surface_quads()
         points = count(node_at > 0)
         start = mesh%x(:, pack(node_at, node_at > 0))
         finish = stage_end(stage, start)
         allocate (first_class(n_facets))
         do layer = 1, stage%layers
            do f = 1, n_facets
               mesh%brick(1:4, n_bricks + f) = nodes_of(node_at, quad(:, :, f))
            end do
            share = (stage%growth**layer - 1.0_wp)/(stage%growth**stage%layers - 1.0_wp)
            node_at = unpack([(n_nodes + p, p=1, points)], node_at > 0, node_at)
            mesh%x(:, n_nodes + 1:n_nodes + points) = start + share*(finish - start)
            n_nodes = n_nodes + points
            do f = 1, n_facets
               associate (brick => n_bricks + f)
                  mesh%brick(5:8, brick) = nodes_of(node_at, quad(:, :, f))
                  above = is_above(stage, mesh%brick(:, brick))
                  mesh%material(brick) = merge(1, stage%material, above)
                  mesh%growth(brick) = stage%growth
                  if (layer == 1 .or. above .or. stage%shape /= growing) then
                     n_classes = n_classes + 1
                     mesh%representative(n_classes) = brick
                     first_class(f) = n_classes
                  else
                     mesh%scale(brick) = stage%growth**(layer - 1)
                  end if
                  mesh%class(brick) = first_class(f)
               end associate
            end do
            n_bricks = n_bricks + n_facets
         end do
      end subroutine add_layers

      !> Whether nodes lie above the plane of a stage that has a plane.
      pure logical function is_above(stage, node)
         type(mesh_stage_type), intent(in) :: stage
         integer, intent(in) :: node(:)

         is_above = stage%plane > 0.0_wp .and. all(mesh%x(3, node) >= -stage%plane*(1.0_wp + equal))
      end function is_above

      !> Close the mesh by infinite elements, or by clamped nodes at the bottom and perhaps at the
      !> sides.
      subroutine close_mesh()
         logical :: clamped(n_nodes)
         integer :: f, i

         n_facets = 0
         if (plan%closing == closed_by_infinite) call surface_quads()
         allocate (mesh%facet(4, n_facets), mesh%facet_material(n_facets))
         do f = 1, n_facets
            mesh%facet(:, f) = nodes_of(node_at, quad(:, :, f))
            mesh%facet_material(f) = plan%far_material(merge(2, 1, &
               & is_above(plan%stages(size(plan%stages)), mesh%facet(:, f))))
         end do
         clamped = .false.
         if (plan%closing /= closed_by_infinite) then
            clamped = mesh%x(3, :) <= minval(mesh%x(3, :))*(1.0_wp - equal)
         end if
         if (plan%closing == clamped_around) then
            clamped = clamped &
               & .or. maxval(abs(mesh%x(:2, :)), dim=1) >= maxval(mesh%x(1, :))*(1.0_wp - equal)
         end if
         mesh%clamped = pack([(i, i=1, size(clamped))], clamped)
      end subroutine close_mesh

      !> Retain every other lattice point of the surface; the nodes between them hang on their
      !> neighbours.
      subroutine coarsen()
         integer :: i, j, k, odd(3), corner(3), offset(3), masters(4), m, p
         integer, allocatable :: fine(:, :, :)

         allocate (fine, source=node_at)
         do k = 0, ubound(fine, 3), step
            do j = 0, ubound(fine, 2), step
               do i = 0, ubound(fine, 1), step
                  if (fine(i, j, k) == 0) cycle
                  odd = merge(step, 0, mod([i, j, k], 2*step) /= 0)
                  if (all(odd == 0)) cycle
                  mesh%hanging = [mesh%hanging, fine(i, j, k)]
                  masters = 0
                  m = 0
                  do p = 0, 7
                     offset = [2*iand(p, 1) - 1, iand(p, 2) - 1, iand(p, 4)/2 - 1]
                     if (any(odd == 0 .and. offset > 0)) cycle
                     corner = [i, j, k] + offset*odd
                     m = m + 1
                     masters(m) = fine(corner(1), corner(2), corner(3))
                  end do
                  mesh%master = reshape(mesh%master, [4, size(mesh%hanging)], masters)
                  node_at(i, j, k) = 0
               end do
            end do
         end do
         step = 2*step
      end subroutine coarsen

      !> Lattice points of the four corners of each facet of the surface, counterclockwise seen from
      !> outside.
      subroutine surface_quads()
         integer, parameter :: x(3) = [1, 0, 0], y(3) = [0, 1, 0], z(3) = [0, 0, 1]
         integer :: nz, i, j, k

         nx = ubound(node_at, 1)
         nz = ubound(node_at, 3)
         if (allocated(quad)) deallocate (quad)
         allocate (quad(3, 4, surface_facets(nx/step, nz/step)))
         n_facets = 0
         do j = 0, nx - step, step
            do i = 0, nx - step, step
               call add_facet([i, j, 0], y, x)
            end do
         end do
         do k = 0, nz - step, step
            do i = 0, nx - step, step
               call add_facet([i, 0, k], x, z)
               call add_facet([i, nx, k], z, x)
               call add_facet([0, i, k], z, y)
               call add_facet([nx, i, k], y, z)
            end do
         end do
      end subroutine surface_quads

      !> Add the facet that begins at a corner and extends along two axes, unless it is not on the
      !> surface.
      subroutine add_facet(corner, first, second)
         integer, intent(in) :: corner(3), first(3), second(3)
         integer :: points(3, 4)

         points = reshape([corner, corner + step*first, corner + step*(first + second), &
            & corner + step*second], [3, 4])
         if (any(nodes_of(node_at, points) == 0)) return
         n_facets = n_facets + 1
         quad(:, :, n_facets) = points
      end subroutine add_facet
   end subroutine new_mesh

   !> Positions of the points of a surface at the end of a stage, um.
   pure function stage_end(stage, start) result(finish)
      type(mesh_stage_type), intent(in) :: stage
      !> Positions at the beginning of the stage, um (3, points).
      real(wp), intent(in) :: start(:, :)
      real(wp) :: finish(3, size(start, 2)), half_width, depth, square
      integer :: p

      half_width = maxval(abs(start(1, :)))
      depth = -minval(start(3, :))
      do p = 1, size(start, 2)
         select case (stage%shape)
         case (to_ball)
            finish(:, p) = start(:, p)*(stage%radius/norm2(start(:, p)))
         case (to_cylinder)
            ! Squares around the axis become circles.
            square = maxval(abs(start(:2, p)))
            finish(:2, p) = start(:2, p)*(stage%radius/half_width)
            if (square > 0.0_wp) finish(:2, p) = finish(:2, p)*(square/norm2(start(:2, p)))
            finish(3, p) = start(3, p)*(stage%depth/depth)
         case default
            finish(:2, p) = stage%ratio*start(:2, p)
            finish(3, p) = start(3, p)
            if (start(3, p) < -stage%plane*(1.0_wp + equal)) then
               finish(3, p) = stage%ratio*(start(3, p) + stage%plane) - stage%plane
            end if
         end select
      end do
   end function stage_end

   !> Nodes at lattice points (3, points).
   pure function nodes_of(node_at, lattice) result(node)
      integer, intent(in) :: node_at(0:, 0:, 0:), lattice(:, :)
      integer :: node(size(lattice, 2)), a

      node = [(node_at(lattice(1, a), lattice(2, a), lattice(3, a)), a=1, size(lattice, 2))]
   end function nodes_of

end module fe_mesh
