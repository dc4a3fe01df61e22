!> The generator of homothetic meshes: a uniform box of bricks under the indenter, wrapped in homothetic layers.
!>
!> The box is [-w, w] x [-w, w] x [-d, 0]; material is z < 0. Each layer lies between two copies of the box's surface
!> (without its top) scaled about the contact centre, the origin, so that all elements of a box are equal and those of a
!> block of layers with one growth factor repeat from layer to layer up to scale. Between two blocks the surface may be
!> coarsened 2:1; the nodes that then hang take the mean of their neighbours. Around it all comes either a layer of
!> infinite elements, swept along rays from the origin, or a clamped bottom and free sides.
module fe_mesh
   use errors, only: error_type
   use kinds, only: wp
   use memory, only: check_memory
   use mesh_plan, only: check_plan, count_items, mesh_plan_type
   use text, only: to_text
   implicit none
   private
   public :: mesh_type, new_mesh

   type :: mesh_type
      !> Coordinates of the nodes, um.
      real(wp), allocatable :: x(:, :)
      !> Nodes of each brick, Abaqus' order.
      integer, allocatable :: brick(:, :)
      !> Bricks of a class are equal up to translation and scale: class of each brick, its scale (stiffness is proportional to
      !> it), and a brick of scale 1 for each class.
      integer, allocatable :: class(:), representative(:)
      real(wp), allocatable :: scale(:)
      !> Facets that carry infinite elements.
      integer, allocatable :: facet(:, :)
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
      !> Node of each lattice point of the current surface; 0 inside and where the surface is coarser.
      integer, allocatable :: at(:, :, :)
      !> Coordinates of the lattice points of the box, um (3, lattice).
      real(wp), allocatable :: box(:, :, :, :)
      !> Lattice spacing of the current surface, its scale over the box's, and items made so far.
      integer :: step = 1, nodes = 0, bricks = 0, hanging = 0, classes = 1
      real(wp) :: scale = 1.0_wp
   end type builder_type

   !> Memory of a mesh with its pattern and places of entries, bytes a brick, rounded up from what was measured.
   real(wp), parameter :: bytes_per_brick = 6.0e3_wp

contains

   !> Build the mesh of a plan.
   subroutine new_mesh(plan, mesh, error)
      type(mesh_plan_type), intent(in) :: plan
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(builder_type) :: self
      integer :: nodes, bricks, hanging, classes, block

      call check_plan(plan, error)
      if (allocated(error)) return
      call count_items(plan, nodes, bricks, hanging, classes)
      call check_memory(bytes_per_brick*bricks, 'a mesh of '//to_text(bricks)//' elements', error)
      if (allocated(error)) return
      allocate (mesh%x(3, nodes), mesh%brick(8, bricks), mesh%class(bricks), mesh%scale(bricks))
      allocate (mesh%representative(classes), mesh%hanging(hanging), mesh%masters(hanging), mesh%master(4, hanging))
      call fill_box(plan, self, mesh)
      do block = 1, size(plan%layers)
         if (plan%coarsen(block)) call coarsen(self%at, self%step, mesh, self%hanging)
         call add_layers(plan%layers(block), plan%growth(block), self, mesh)
      end do
      call close_mesh(plan, self, mesh)
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
      allocate (self%at(0:nx, 0:nx, 0:nz), self%box(3, 0:nx, 0:nx, 0:nz))
      associate (at => self%at, box => self%box, nodes => self%nodes, bricks => self%bricks)
         do k = 0, nz
            do j = 0, nx
               do i = 0, nx
                  nodes = nodes + 1
                  at(i, j, k) = nodes
                  box(:, i, j, k) = [(real(i - n, wp)/n)*plan%half_width, (real(j - n, wp)/n)*plan%half_width, &
                     & (real(k - nz, wp)/nz)*plan%depth]
                  mesh%x(:, nodes) = box(:, i, j, k)
               end do
            end do
         end do
         do k = 0, nz - 1
            do j = 0, nx - 1
               do i = 0, nx - 1
                  bricks = bricks + 1
                  mesh%brick(:, bricks) = [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k), &
                     & at(i, j, k + 1), at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)]
               end do
            end do
         end do
         mesh%class(:bricks) = 1
         mesh%scale(:bricks) = 1.0_wp
      end associate
      mesh%representative(1) = 1
      mesh%element_size = plan%half_width/n
      mesh%contact_reach = plan%half_width
      ! A hanging node has no displacement of its own.
      if (plan%coarsen(1)) mesh%contact_reach = plan%half_width - mesh%element_size
      call find_contact(self%at(:, :, nz), mesh)
      self%at(1:nx - 1, 1:nx - 1, 1:nz) = 0
   end subroutine fill_box

   !> A block of layers of bricks around the current surface, each `growth` times as large as the one before.
   subroutine add_layers(layers, growth, self, mesh)
      integer, intent(in) :: layers
      real(wp), intent(in) :: growth
      type(builder_type), intent(inout) :: self
      type(mesh_type), intent(inout) :: mesh
      integer, allocatable :: quad(:, :, :)
      real(wp) :: first_scale
      integer :: layer, facets, f, i, j, k

      call surface_quads(ubound(self%at, 1), ubound(self%at, 3), self%step, quad)
      facets = size(quad, 3)
      first_scale = self%scale
      associate (at => self%at, bricks => self%bricks, nodes => self%nodes, base => self%classes)
         do layer = 1, layers
            do f = 1, facets
               mesh%brick(1:4, bricks + f) = nodes_of(at, quad(:, :, f))
            end do
            self%scale = self%scale*growth
            do k = 0, ubound(at, 3), self%step
               do j = 0, ubound(at, 2), self%step
                  do i = 0, ubound(at, 1), self%step
                     if (at(i, j, k) == 0) cycle
                     nodes = nodes + 1
                     at(i, j, k) = nodes
                     mesh%x(:, nodes) = self%scale*self%box(:, i, j, k)
                  end do
               end do
            end do
            do f = 1, facets
               mesh%brick(5:8, bricks + f) = nodes_of(at, quad(:, :, f))
               mesh%class(bricks + f) = base + f
               if (layer == 1) mesh%representative(base + f) = bricks + f
               mesh%scale(bricks + f) = self%scale/(growth*first_scale)
            end do
            bricks = bricks + facets
         end do
         base = base + facets
      end associate
   end subroutine add_layers

   !> What lies around the last layer.
   subroutine close_mesh(plan, self, mesh)
      type(mesh_plan_type), intent(in) :: plan
      type(builder_type), intent(in) :: self
      type(mesh_type), intent(inout) :: mesh
      integer, allocatable :: quad(:, :, :)
      integer :: f

      if (plan%infinite) then
         call surface_quads(ubound(self%at, 1), ubound(self%at, 3), self%step, quad)
         allocate (mesh%facet(4, size(quad, 3)), mesh%clamped(0))
         do f = 1, size(quad, 3)
            mesh%facet(:, f) = nodes_of(self%at, quad(:, :, f))
         end do
      else
         allocate (mesh%facet(4, 0))
         mesh%clamped = pack(self%at(:, :, 0), self%at(:, :, 0) > 0)
      end if
   end subroutine close_mesh

   !> Nodes of four lattice points.
   pure function nodes_of(at, lattice) result(node)
      integer, intent(in) :: at(0:, 0:, 0:), lattice(3, 4)
      integer :: node(4)
      integer :: a

      do a = 1, 4
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
            if (hypot(mesh%x(1, top(i, j)), mesh%x(2, top(i, j))) > mesh%contact_reach*(1.0_wp + 1.0e-9_wp)) cycle
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
   pure subroutine surface_quads(nx, nz, step, quad)
      integer, intent(in) :: nx, nz, step
      integer, allocatable, intent(out) :: quad(:, :, :)
      integer :: i, j, k, f, ip, jp, kp

      allocate (quad(3, 4, (nx/step)**2 + 4*(nx/step)*(nz/step)))
      f = 0
      do j = 0, nx - step, step
         do i = 0, nx - step, step
            ip = i + step
            jp = j + step
            f = f + 1
            quad(:, :, f) = reshape([i, j, 0, i, jp, 0, ip, jp, 0, ip, j, 0], [3, 4])
         end do
      end do
      do k = 0, nz - step, step
         do i = 0, nx - step, step
            ip = i + step
            kp = k + step
            quad(:, :, f + 1) = reshape([i, 0, k, ip, 0, k, ip, 0, kp, i, 0, kp], [3, 4])
            quad(:, :, f + 2) = reshape([i, nx, k, i, nx, kp, ip, nx, kp, ip, nx, k], [3, 4])
            quad(:, :, f + 3) = reshape([0, i, k, 0, i, kp, 0, ip, kp, 0, ip, k], [3, 4])
            quad(:, :, f + 4) = reshape([nx, i, k, nx, ip, k, nx, ip, kp, nx, i, kp], [3, 4])
            f = f + 4
         end do
      end do
   end subroutine surface_quads
end module fe_mesh
