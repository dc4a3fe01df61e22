!> The mesh generator: a uniform box of bricks under the indenter, wrapped in layers.
!>
!> The box is [-w, w] x [-w, w] x [-d, 0]; the material is at z < 0. The surface of the mesh means
!> its sides and its bottom, without the top. A stage of the plan wraps layers of bricks around the
!> surface. From layer to layer the nodes of the surface move on straight lines to their places at
!> the end of the stage, on a surface of the same shape or a hemisphere. On surfaces of the same
!> shape the layers of a stage are equal up to scale, and so are the stiffnesses of their bricks. An
!> interface between materials is the end of a stage. Before a stage the surface may be coarsened
!> 2:1. The nodes that the coarse surface lacks hang: each has the mean displacement of its
!> neighbours. At the end a layer of infinite elements, swept along rays from the origin, surrounds
!> the mesh, or its bottom is clamped.
module fe_mesh
   use errors, only: error_type
   use kinds, only: wp
   use machine, only: check_memory
   use basic_specimen, only: check_plan, mesh_plan_type, mesh_stage_type, surface_facets
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
      !> Hanging nodes. Hanging node j has the mean displacement of two or four nodes, the numbers
      !> above 0 in `master(:, j)`.
      integer, allocatable :: hanging(:), master(:, :)
      !> Surface nodes that may touch the indenter.
      integer, allocatable :: contact(:)
      !> Largest distance of a contact from the centre, and edge of an element there, um.
      real(wp) :: contact_limit = 0.0_wp, element_size = 0.0_wp
   end type mesh_type

   !> A mesh under construction.
   type, extends(mesh_type) :: builder_type
      !> Node of each lattice point of the current surface; 0 for inner points, for points that
      !> coarsening removes, and for clamped points.
      integer, allocatable :: node_at(:, :, :)
      !> Lattice spacing of the current surface; numbers of items made so far.
      integer :: step = 1, nodes = 0, bricks = 0, n_hanging = 0, classes = 0
   end type builder_type

   !> Memory of a mesh and of the sparsity pattern of its stiffness matrix, bytes per brick, rounded
   !> up from a measurement.
   real(wp), parameter :: bytes_per_brick = 6.0e3_wp
   !> Lengths that differ by less than this share are equal.
   real(wp), parameter :: equal = 1.0e-9_wp

contains

   !> Build the mesh of a plan.
   subroutine new_mesh(plan, mesh, error)
      type(mesh_plan_type), intent(in) :: plan
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(builder_type) :: self
      integer :: nodes, bricks, i

      call check_plan(plan, bricks, error)
      if (allocated(error)) return
      call check_memory(bytes_per_brick*bricks, &
         & 'a mesh of '//to_text(bricks)//' elements', error)
      if (allocated(error)) return
      ! An upper bound. The part of `x` that is never written takes no memory.
      nodes = 3*bricks
      allocate (self%x(3, nodes), self%brick(8, bricks), self%material(bricks), &
         & self%class(bricks), self%representative(bricks))
      allocate (self%scale(bricks), self%growth(bricks), source=1.0_wp)
      allocate (self%hanging(nodes), self%master(4, nodes), source=0)
      call fill_box(plan, self)
      do i = 1, size(plan%stages)
         if (plan%stages(i)%coarsen) call coarsen(self)
         call add_layers(plan%stages(i), self)
      end do
      self%x = self%x(:, :self%nodes)
      self%representative = self%representative(:self%classes)
      self%hanging = self%hanging(:self%n_hanging)
      self%master = self%master(:, :self%n_hanging)
      call close_mesh(plan, self)
      mesh = self%mesh_type
   end subroutine new_mesh

   !> Make the box of bricks, and list the nodes of its top that may touch the indenter.
   subroutine fill_box(plan, self)
      type(mesh_plan_type), intent(in) :: plan
      type(builder_type), intent(inout) :: self
      integer, parameter :: corner(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, &
         & 1, 0, 1, 1, 1, 1, 0, 1, 1], [3, 8])
      integer, allocatable :: top(:)
      integer :: n, levels, first, i, j, k

      n = plan%half_cells
      levels = plan%depth_cells
      allocate (self%node_at(0:2*n, 0:2*n, 0:levels))
      do k = 0, levels
         do j = 0, 2*n
            do i = 0, 2*n
               self%nodes = self%nodes + 1
               self%node_at(i, j, k) = self%nodes
               self%x(:, self%nodes) = [(real(i - n, wp)/n)*plan%half_width, &
                  & (real(j - n, wp)/n)*plan%half_width, plan%depth*(k - levels)/levels]
            end do
         end do
      end do
      do k = 0, levels - 1
         do j = 0, 2*n - 1
            do i = 0, 2*n - 1
               self%bricks = self%bricks + 1
               self%brick(:, self%bricks) &
                  & = nodes_of(self%node_at, spread([i, j, k], 2, 8) + corner)
            end do
         end do
      end do
      self%classes = 1
      self%representative(1) = 1
      self%class(:self%bricks) = 1
      self%material(:self%bricks) = 1
      self%element_size = plan%half_width/n
      self%contact_limit = plan%half_width
      ! If the first stage with layers coarsens the surface, nodes at the edge of the top hang. They
      ! have no displacement of their own, so they cannot be in contact.
      first = max(1, findloc(plan%stages%layers > 0, .true., dim=1))
      if (plan%stages(first)%coarsen) then
         self%contact_limit = plan%half_width - self%element_size
      end if
      top = reshape(self%node_at(:, :, levels), [(2*n + 1)**2])
      self%contact = pack(top, norm2(self%x(:2, top), dim=1) <= self%contact_limit*(1.0_wp + equal))
      ! Only the nodes of the sides and of the bottom are part of the surface.
      self%node_at(1:2*n - 1, 1:2*n - 1, 1:levels) = 0
   end subroutine fill_box

   !> Add the layers of a stage around the current surface.
   subroutine add_layers(stage, self)
      type(mesh_stage_type), intent(in) :: stage
      type(builder_type), intent(inout) :: self
      integer, allocatable :: quad(:, :, :), first_class(:)
      real(wp), allocatable :: start(:, :), finish(:, :)
      real(wp) :: share
      integer :: layer, facets, points, f, p

      if (stage%layers == 0) return
      call surface_quads(self, quad)
      facets = size(quad, 3)
      points = count(self%node_at > 0)
      start = self%x(:, pack(self%node_at, self%node_at > 0))
      finish = stage%ratio*start
      if (stage%radius > 0.0_wp) finish = start*spread(stage%radius/norm2(start, 1), 1, 3)
      allocate (first_class(facets))
      do layer = 1, stage%layers
         do f = 1, facets
            self%brick(1:4, self%bricks + f) = nodes_of(self%node_at, quad(:, :, f))
         end do
         ! The share of the way to the end of the stage. Each layer is `growth` times as thick as
         ! the one before.
         share = (stage%growth**layer - 1.0_wp)/(stage%growth**stage%layers - 1.0_wp)
         self%node_at = unpack([(self%nodes + p, p=1, points)], self%node_at > 0, self%node_at)
         self%x(:, self%nodes + 1:self%nodes + points) = start + share*(finish - start)
         self%nodes = self%nodes + points
         do f = 1, facets
            associate (brick => self%bricks + f)
               self%brick(5:8, brick) = nodes_of(self%node_at, quad(:, :, f))
               self%material(brick) = stage%material
               self%growth(brick) = stage%growth
               ! Bricks between surfaces of one shape repeat those of the first layer.
               if (layer == 1 .or. stage%radius > 0.0_wp) then
                  self%classes = self%classes + 1
                  self%representative(self%classes) = brick
                  first_class(f) = self%classes
               else
                  self%scale(brick) = stage%growth**(layer - 1)
               end if
               self%class(brick) = first_class(f)
            end associate
         end do
         self%bricks = self%bricks + facets
      end do
   end subroutine add_layers

   !> Close the mesh by infinite elements, or by clamped nodes at the bottom.
   subroutine close_mesh(plan, self)
      type(mesh_plan_type), intent(in) :: plan
      type(builder_type), intent(inout) :: self
      integer, allocatable :: quad(:, :, :)
      integer :: f, i

      allocate (quad(3, 4, 0))
      self%clamped = [integer ::]
      if (plan%is_clamped) then
         self%clamped = pack([(i, i=1, size(self%x, 2))], &
            & self%x(3, :) <= minval(self%x(3, :))*(1.0_wp - equal))
      else
         call surface_quads(self, quad)
      end if
      allocate (self%facet(4, size(quad, 3)))
      do f = 1, size(quad, 3)
         self%facet(:, f) = nodes_of(self%node_at, quad(:, :, f))
      end do
      self%facet_material = spread(plan%far_material, 1, size(quad, 3))
   end subroutine close_mesh

   !> Nodes at lattice points (3, points).
   pure function nodes_of(node_at, lattice) result(node)
      integer, intent(in) :: node_at(0:, 0:, 0:), lattice(:, :)
      integer :: node(size(lattice, 2)), a

      node = [(node_at(lattice(1, a), lattice(2, a), lattice(3, a)), a=1, size(lattice, 2))]
   end function nodes_of

   !> Retain every other lattice point of the surface. The nodes between them hang on the retained
   !> neighbours: two of a node on an edge of the coarse facets, four of a node inside.
   subroutine coarsen(self)
      type(builder_type), intent(inout) :: self
      !> Distances to the retained neighbours along the axes of the lattice.
      integer :: distance(3)
      integer :: i, j, k, step, corner(3), side(3), m, p
      integer, allocatable :: fine(:, :, :)

      allocate (fine, source=self%node_at)
      step = self%step
      do k = 0, ubound(fine, 3), step
         do j = 0, ubound(fine, 2), step
            do i = 0, ubound(fine, 1), step
               if (fine(i, j, k) == 0) cycle
               distance = merge(step, 0, mod([i, j, k], 2*step) /= 0)
               if (all(distance == 0)) cycle
               self%n_hanging = self%n_hanging + 1
               self%hanging(self%n_hanging) = fine(i, j, k)
               m = 0
               do p = 0, 7
                  ! The bits of p are the sides, -1 or 1. A distance of 0 has one side only.
                  side = [2*iand(p, 1) - 1, iand(p, 2) - 1, iand(p, 4)/2 - 1]
                  if (any(distance == 0 .and. side > 0)) cycle
                  corner = [i, j, k] + side*distance
                  m = m + 1
                  self%master(m, self%n_hanging) = fine(corner(1), corner(2), corner(3))
               end do
               self%node_at(i, j, k) = 0
            end do
         end do
      end do
      self%step = 2*step
   end subroutine coarsen

   !> Lattice points of the four corners of each facet of the surface, counterclockwise seen from
   !> outside.
   subroutine surface_quads(self, quad)
      type(builder_type), intent(in) :: self
      integer, allocatable, intent(out) :: quad(:, :, :)
      integer, parameter :: x(3) = [1, 0, 0], y(3) = [0, 1, 0], z(3) = [0, 0, 1]
      integer :: nx, nz, step, i, j, k, n

      nx = ubound(self%node_at, 1)
      nz = ubound(self%node_at, 3)
      step = self%step
      allocate (quad(3, 4, surface_facets(nx/step, nz/step)))
      n = 0
      do j = 0, nx - step, step
         do i = 0, nx - step, step
            call add([i, j, 0], y, x)
         end do
      end do
      do k = 0, nz - step, step
         do i = 0, nx - step, step
            call add([i, 0, k], x, z)
            call add([i, nx, k], z, x)
            call add([0, i, k], z, y)
            call add([nx, i, k], y, z)
         end do
      end do
      quad = quad(:, :, :n)

   contains

      !> Add the facet that begins at a corner and extends along two axes, unless it is not on the
      !> surface.
      subroutine add(corner, first, second)
         integer, intent(in) :: corner(3), first(3), second(3)
         integer :: points(3, 4)

         points = reshape([corner, corner + step*first, corner + step*(first + second), &
            & corner + step*second], [3, 4])
         if (any(nodes_of(self%node_at, points) == 0)) return
         n = n + 1
         quad(:, :, n) = points
      end subroutine add
   end subroutine surface_quads
end module fe_mesh
