!> The mesh generator: a uniform box of bricks under the indenter, wrapped in layers.
!>
!> The box is [-w, w] x [-w, w] x [-d, 0]; material is z < 0. A stage of the plan wraps layers of bricks around the surface of what there
!> is (without its top), whose nodes move on straight lines to where the stage ends: a surface of the same shape, a hemisphere, a
!> cylinder. Where the shape stays the same bricks repeat from layer to layer up to scale, and so do their stiffnesses. An interface that is
!> a hemisphere or a cylinder is where a stage ends. One that is a plane is reached by the bottom of a stage: then bricks are put
!> under that bottom, and the layers go on around both, above the plane sideways only.
!> Before a stage the surface may be coarsened 2:1; the nodes that then hang take the mean of their neighbours.
!> Around it all comes either a layer of infinite elements, swept along rays from the origin, or what is clamped.
module fe_mesh
   use errors, only: error_type
   use kinds, only: wp
   use memory, only: check_memory
   use mesh_plan, only: check_plan, clamped_around, closed_by_infinite, count_items, growing, mesh_plan_type, mesh_stage_type, &
      & surface_facets, to_ball, to_cylinder
   use text, only: to_text
   implicit none
   private
   public :: mesh_type, new_mesh

   type :: mesh_type
      !> Coordinates of the nodes, um.
      real(wp), allocatable :: x(:, :)
      !> Nodes of each brick, Abaqus' order, and its material.
      integer, allocatable :: brick(:, :), material(:)
      !> Bricks of a class are of one material and equal up to translation and scale: class of each brick, its scale (stiffness is
      !> proportional to it), and a brick of scale 1 for each class.
      integer, allocatable :: class(:), representative(:)
      real(wp), allocatable :: scale(:)
      !> Growth of the layer that each brick belongs to; 1 in boxes.
      real(wp), allocatable :: growth(:)
      !> Facets that carry infinite elements, and their materials.
      integer, allocatable :: facet(:, :), facet_material(:)
      !> Clamped nodes.
      integer, allocatable :: clamped(:)
      !> Hanging nodes: the mean of the first `masters(j)` of `master(:, j)`.
      integer, allocatable :: hanging(:), masters(:), master(:, :)
      !> Surface nodes that may touch the indenter.
      integer, allocatable :: contact(:)
      !> Contact may reach this far from the centre, and edge of an element there, um.
      real(wp) :: contact_reach = 0.0_wp, element_size = 0.0_wp
   end type mesh_type

   !> A mesh under construction.
   type :: builder_type
      !> Node of each lattice point of the current surface; 0 inside, where the surface is coarser, and where it is clamped.
      integer, allocatable :: at(:, :, :)
      !> Lattice spacing of the current surface, and items made so far.
      integer :: step = 1, nodes = 0, bricks = 0, hanging = 0, classes = 0
   end type builder_type

   !> Memory of a mesh with its pattern and places of entries, bytes a brick, rounded up from what was measured.
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
      integer :: nodes, bricks, hanging, i

      call check_plan(plan, error)
      if (allocated(error)) return
      call count_items(plan, nodes, bricks, hanging)
      call check_memory(bytes_per_brick*bricks, 'a mesh of '//to_text(bricks)//' elements', error)
      if (allocated(error)) return
      allocate (mesh%x(3, nodes), mesh%brick(8, bricks), mesh%material(bricks), mesh%class(bricks), mesh%scale(bricks))
      allocate (mesh%growth(bricks), source=1.0_wp)
      allocate (mesh%representative(bricks), mesh%hanging(hanging), mesh%masters(hanging), mesh%master(4, hanging))
      call fill_box(plan, self, mesh)
      do i = 1, size(plan%stages)
         if (plan%stages(i)%coarsen) call coarsen(self%at, self%step, mesh, self%hanging)
         if (plan%stages(i)%floor_levels > 0) call add_floor(plan%stages(i), self, mesh)
         if (plan%clamped_depth > 0.0_wp) call drop_clamped_bottom(plan%clamped_depth, mesh, self%at)
         call add_layers(plan%stages(i), self, mesh)
      end do
      call close_mesh(plan, self, mesh)
      mesh%x = mesh%x(:, :self%nodes)
      mesh%brick = mesh%brick(:, :self%bricks)
      mesh%material = mesh%material(:self%bricks)
      mesh%class = mesh%class(:self%bricks)
      mesh%scale = mesh%scale(:self%bricks)
      mesh%growth = mesh%growth(:self%bricks)
      mesh%representative = mesh%representative(:self%classes)
      mesh%hanging = mesh%hanging(:self%hanging)
      mesh%masters = mesh%masters(:self%hanging)
      mesh%master = mesh%master(:, :self%hanging)
      call find_clamped(plan, mesh)
   end subroutine new_mesh

   !> The box of bricks, and the nodes that may touch the indenter.
   subroutine fill_box(plan, self, mesh)
      type(mesh_plan_type), intent(in) :: plan
      type(builder_type), intent(inout) :: self
      type(mesh_type), intent(inout) :: mesh
      integer :: n, nx, nz, i, j, k

      n = plan%half_cells
      nx = 2*n
      nz = plan%depth_cells
      allocate (self%at(0:nx, 0:nx, 0:nz))
      do k = 0, nz
         do j = 0, nx
            do i = 0, nx
               self%nodes = self%nodes + 1
               self%at(i, j, k) = self%nodes
               mesh%x(:, self%nodes) = [(real(i - n, wp)/n)*plan%half_width, (real(j - n, wp)/n)*plan%half_width, &
                  & (real(k - nz, wp)/nz)*plan%depth]
            end do
         end do
      end do
      call add_bricks_of_lattice(1, nz, 1, self, mesh)
      mesh%element_size = plan%half_width/n
      mesh%contact_reach = plan%half_width
      ! A hanging node has no displacement of its own.
      if (plan%stages(first_of(plan))%coarsen) mesh%contact_reach = plan%half_width - mesh%element_size
      call find_contact(self%at(:, :, nz), mesh)
      self%at(1:nx - 1, 1:nx - 1, 1:nz) = 0
   end subroutine fill_box

   !> The first stage that has layers, else the first.
   pure integer function first_of(plan)
      type(mesh_plan_type), intent(in) :: plan

      do first_of = 1, size(plan%stages)
         if (plan%stages(first_of)%layers > 0) return
      end do
      first_of = 1
   end function first_of

   !> Equal bricks of one class between the levels 0 and `top` of the lattice.
   pure subroutine add_bricks_of_lattice(material, top, step, self, mesh)
      integer, intent(in) :: material, top, step
      type(builder_type), intent(inout) :: self
      type(mesh_type), intent(inout) :: mesh
      integer :: i, j, k, first

      first = self%bricks + 1
      do k = 0, top - step, step
         do j = 0, ubound(self%at, 2) - step, step
            do i = 0, ubound(self%at, 1) - step, step
               self%bricks = self%bricks + 1
               mesh%brick(:4, self%bricks) = around(self%at(:, :, k), i, j, step)
               mesh%brick(5:, self%bricks) = around(self%at(:, :, k + step), i, j, step)
            end do
         end do
      end do
      self%classes = self%classes + 1
      mesh%representative(self%classes) = first
      mesh%class(first:self%bricks) = self%classes
      mesh%scale(first:self%bricks) = 1.0_wp
      mesh%material(first:self%bricks) = material
   end subroutine add_bricks_of_lattice

   !> The corners of a cell of one level, counterclockwise.
   pure function around(level, i, j, step) result(node)
      integer, intent(in) :: level(0:, 0:), i, j, step
      integer :: node(4)

      node = [level(i, j), level(i + step, j), level(i + step, j + step), level(i, j + step)]
   end function around

   !> Levels of bricks under the bottom of the surface, which is flat and uniform.
   subroutine add_floor(stage, self, mesh)
      type(mesh_stage_type), intent(in) :: stage
      type(builder_type), intent(inout) :: self
      type(mesh_type), intent(inout) :: mesh
      integer, allocatable :: at(:, :, :)
      integer :: nx, levels, i, j, k

      nx = ubound(self%at, 1)
      levels = stage%floor_levels*self%step
      allocate (at(0:nx, 0:nx, 0:ubound(self%at, 3) + levels), source=0)
      at(:, :, levels:) = self%at
      do k = 0, stage%floor_levels - 1
         do j = 0, nx, self%step
            do i = 0, nx, self%step
               self%nodes = self%nodes + 1
               at(i, j, k*self%step) = self%nodes
               mesh%x(:, self%nodes) = mesh%x(:, at(i, j, levels)) &
                  & - [0.0_wp, 0.0_wp, stage%floor_depth*(stage%floor_levels - k)/stage%floor_levels]
            end do
         end do
      end do
      call move_alloc(at, self%at)
      call add_bricks_of_lattice(stage%material, levels, self%step, self, mesh)
      self%at(1:nx - 1, 1:nx - 1, 1:levels) = 0
   end subroutine add_floor

   !> Where the bottom of the surface is clamped nothing goes on below it.
   pure subroutine drop_clamped_bottom(depth, mesh, at)
      !> um.
      real(wp), intent(in) :: depth
      type(mesh_type), intent(in) :: mesh
      integer, intent(inout) :: at(0:, 0:, 0:)
      integer :: nx

      if (mesh%x(3, at(0, 0, 0)) > -depth*(1.0_wp - equal)) return
      nx = ubound(at, 1)
      at(1:nx - 1, 1:nx - 1, 0) = 0
   end subroutine drop_clamped_bottom

   !> The layers of a stage around the current surface.
   subroutine add_layers(stage, self, mesh)
      type(mesh_stage_type), intent(in) :: stage
      type(builder_type), intent(inout) :: self
      type(mesh_type), intent(inout) :: mesh
      integer, allocatable :: quad(:, :, :), first_class(:), points(:, :)
      logical, allocatable :: similar(:)
      real(wp), allocatable :: start(:, :), finish(:, :)
      real(wp) :: share
      integer :: layer, facets, f, p

      if (stage%layers == 0) return
      call surface_quads(self, quad)
      facets = size(quad, 3)
      call surface_points(self%at, points)
      start = mesh%x(:, nodes_of(self%at, points))
      finish = stage_end(stage, start)
      allocate (first_class(facets), similar(facets))
      do f = 1, facets
         similar(f) = stage%shape == growing .and. .not. is_above(stage, mesh, nodes_of(self%at, quad(:, :, f)))
      end do
      do layer = 1, stage%layers
         do f = 1, facets
            mesh%brick(1:4, self%bricks + f) = nodes_of(self%at, quad(:, :, f))
         end do
         share = (stage%growth**layer - 1.0_wp)/(stage%growth**stage%layers - 1.0_wp)
         do p = 1, size(points, 2)
            self%nodes = self%nodes + 1
            self%at(points(1, p), points(2, p), points(3, p)) = self%nodes
            mesh%x(:, self%nodes) = start(:, p) + share*(finish(:, p) - start(:, p))
         end do
         do f = 1, facets
            associate (brick => self%bricks + f)
               mesh%brick(5:8, brick) = nodes_of(self%at, quad(:, :, f))
               mesh%material(brick) = merge(1, stage%material, is_above(stage, mesh, mesh%brick(:, brick)))
               mesh%scale(brick) = 1.0_wp
               mesh%growth(brick) = stage%growth
               if (layer == 1 .or. .not. similar(f)) then
                  self%classes = self%classes + 1
                  mesh%representative(self%classes) = brick
                  first_class(f) = self%classes
               else
                  mesh%scale(brick) = stage%growth**(layer - 1)
               end if
               mesh%class(brick) = first_class(f)
            end associate
         end do
         self%bricks = self%bricks + facets
      end do
   end subroutine add_layers

   !> Whether nodes lie above the plane of a stage that has one.
   pure logical function is_above(stage, mesh, node)
      type(mesh_stage_type), intent(in) :: stage
      type(mesh_type), intent(in) :: mesh
      integer, intent(in) :: node(:)

      is_above = stage%plane > 0.0_wp .and. all(mesh%x(3, node) >= -stage%plane*(1.0_wp + equal))
   end function is_above

   !> Where the points of a surface are at the end of a stage, um.
   pure function stage_end(stage, start) result(finish)
      type(mesh_stage_type), intent(in) :: stage
      !> um (3, points).
      real(wp), intent(in) :: start(:, :)
      real(wp) :: finish(3, size(start, 2))
      real(wp) :: half_width, depth, square
      integer :: p

      half_width = maxval(abs(start(1, :)))
      depth = -minval(start(3, :))
      do p = 1, size(start, 2)
         select case (stage%shape)
         case (to_ball)
            finish(:, p) = start(:, p)*(stage%radius/norm2(start(:, p)))
         case (to_cylinder)
            ! Squares become circles.
            square = maxval(abs(start(:2, p)))
            finish(:2, p) = start(:2, p)*(stage%radius/half_width)
            if (square > 0.0_wp) finish(:2, p) = finish(:2, p)*(square/norm2(start(:2, p)))
            finish(3, p) = start(3, p)*(stage%depth/depth)
         case default
            finish(:2, p) = stage%ratio*start(:2, p)
            finish(3, p) = start(3, p)
            if (start(3, p) < -stage%plane*(1.0_wp + equal)) finish(3, p) = stage%ratio*(start(3, p) + stage%plane) - stage%plane
         end select
      end do
   end function stage_end

   !> What lies around the last layer.
   subroutine close_mesh(plan, self, mesh)
      type(mesh_plan_type), intent(in) :: plan
      type(builder_type), intent(in) :: self
      type(mesh_type), intent(inout) :: mesh
      integer, allocatable :: quad(:, :, :)
      integer :: f

      allocate (quad(3, 4, 0))
      if (plan%closing == closed_by_infinite) call surface_quads(self, quad)
      allocate (mesh%facet(4, size(quad, 3)), mesh%facet_material(size(quad, 3)))
      do f = 1, size(quad, 3)
         mesh%facet(:, f) = nodes_of(self%at, quad(:, :, f))
         mesh%facet_material(f) = plan%far_material(merge(2, 1, &
            & is_above(plan%stages(size(plan%stages)), mesh, mesh%facet(:, f))))
      end do
   end subroutine close_mesh

   !> The nodes at the bottom, and at the sides, where they are clamped.
   subroutine find_clamped(plan, mesh)
      type(mesh_plan_type), intent(in) :: plan
      type(mesh_type), intent(inout) :: mesh
      logical :: clamped(size(mesh%x, 2))
      integer :: i

      clamped = .false.
      if (plan%closing /= closed_by_infinite) clamped = mesh%x(3, :) <= minval(mesh%x(3, :))*(1.0_wp - equal)
      if (plan%closing == clamped_around) clamped = clamped .or. maxval(abs(mesh%x(:2, :)), dim=1) >= &
         & maxval(mesh%x(1, :))*(1.0_wp - equal)
      mesh%clamped = pack([(i, i=1, size(clamped))], clamped)
   end subroutine find_clamped

   !> Nodes of lattice points (3, points).
   pure function nodes_of(at, lattice) result(node)
      integer, intent(in) :: at(0:, 0:, 0:), lattice(:, :)
      integer :: node(size(lattice, 2))
      integer :: a

      do a = 1, size(lattice, 2)
         node(a) = at(lattice(1, a), lattice(2, a), lattice(3, a))
      end do
   end function nodes_of

   !> Nodes of the top of the box inside the circle of contact.
   subroutine find_contact(top, mesh)
      integer, intent(in) :: top(0:, 0:)
      type(mesh_type), intent(inout) :: mesh
      integer, allocatable :: found(:)
      integer :: i, j, count

      allocate (found(size(top)))
      count = 0
      do j = 0, ubound(top, 2)
         do i = 0, ubound(top, 1)
            if (hypot(mesh%x(1, top(i, j)), mesh%x(2, top(i, j))) > mesh%contact_reach*(1.0_wp + equal)) cycle
            count = count + 1
            found(count) = top(i, j)
         end do
      end do
      mesh%contact = found(:count)
   end subroutine find_contact

   !> Keep every other lattice point of the surface; the others hang on their neighbours.
   subroutine coarsen(at, step, mesh, hanging)
      integer, intent(inout) :: at(0:, 0:, 0:)
      integer, intent(inout) :: step, hanging
      type(mesh_type), intent(inout) :: mesh
      integer :: i, j, k, odd(3), corner(3), offset(3), m, p
      integer, allocatable :: fine(:, :, :)

      allocate (fine(0:ubound(at, 1), 0:ubound(at, 2), 0:ubound(at, 3)), source=at)
      do k = 0, ubound(at, 3), step
         do j = 0, ubound(at, 2), step
            do i = 0, ubound(at, 1), step
               if (fine(i, j, k) == 0) cycle
               odd = merge(step, 0, mod([i, j, k], 2*step) /= 0)
               if (all(odd == 0)) cycle
               hanging = hanging + 1
               mesh%hanging(hanging) = at(i, j, k)
               m = 0
               do p = 0, 7
                  offset = [2*iand(p, 1) - 1, iand(p, 2) - 1, iand(p, 4)/2 - 1]
                  if (any(odd == 0 .and. offset > 0)) cycle
                  corner = [i, j, k] + offset*odd
                  m = m + 1
                  mesh%master(m, hanging) = fine(corner(1), corner(2), corner(3))
               end do
               mesh%masters(hanging) = m
               at(i, j, k) = 0
            end do
         end do
      end do
      step = 2*step
   end subroutine coarsen

   !> Lattice points of the four corners of each facet of the surface, counterclockwise seen from outside.
   pure subroutine surface_quads(self, quad)
      type(builder_type), intent(in) :: self
      integer, allocatable, intent(out) :: quad(:, :, :)
      integer :: nx, nz, step, i, j, k, f, ip, jp, kp
      integer, allocatable :: all_quads(:, :, :)
      logical, allocatable :: free(:)

      nx = ubound(self%at, 1)
      nz = ubound(self%at, 3)
      step = self%step
      allocate (all_quads(3, 4, surface_facets(nx/step, nz/step)))
      f = 0
      do j = 0, nx - step, step
         do i = 0, nx - step, step
            ip = i + step
            jp = j + step
            f = f + 1
            all_quads(:, :, f) = reshape([i, j, 0, i, jp, 0, ip, jp, 0, ip, j, 0], [3, 4])
         end do
      end do
      do k = 0, nz - step, step
         do i = 0, nx - step, step
            ip = i + step
            kp = k + step
            all_quads(:, :, f + 1) = reshape([i, 0, k, ip, 0, k, ip, 0, kp, i, 0, kp], [3, 4])
            all_quads(:, :, f + 2) = reshape([i, nx, k, i, nx, kp, ip, nx, kp, ip, nx, k], [3, 4])
            all_quads(:, :, f + 3) = reshape([0, i, k, 0, i, kp, 0, ip, kp, 0, ip, k], [3, 4])
            all_quads(:, :, f + 4) = reshape([nx, i, k, nx, ip, k, nx, ip, kp, nx, i, kp], [3, 4])
            f = f + 4
         end do
      end do
      allocate (free(f))
      do i = 1, f
         free(i) = all(nodes_of(self%at, all_quads(:, :, i)) > 0)
      end do
      quad = all_quads(:, :, pack([(i, i=1, f)], free))
   end subroutine surface_quads

   !> The lattice points of the surface.
   pure subroutine surface_points(at, points)
      integer, intent(in) :: at(0:, 0:, 0:)
      integer, allocatable, intent(out) :: points(:, :)
      integer :: i, j, k, n

      allocate (points(3, count(at > 0)))
      n = 0
      do k = 0, ubound(at, 3)
         do j = 0, ubound(at, 2)
            do i = 0, ubound(at, 1)
               if (at(i, j, k) == 0) cycle
               n = n + 1
               points(:, n) = [i, j, k]
            end do
         end do
      end do
   end subroutine surface_points
end module fe_mesh
