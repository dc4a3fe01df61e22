!> What the mesh generator is asked for: a box of bricks under the indenter and homothetic layers around it.
module mesh_plan
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use text, only: to_text
   implicit none
   private
   public :: mesh_plan_type, check_plan, count_items

   type :: mesh_plan_type
      !> Cells of the box per half-width and over its depth.
      integer :: half_cells = 0, depth_cells = 0
      !> Half-width and depth of the box, um.
      real(wp) :: half_width = 0.0_wp, depth = 0.0_wp
      !> Blocks of layers from the inside out: number of layers, growth factor from layer to layer (> 1), and whether the
      !> surface is coarsened 2:1 before the block.
      integer, allocatable :: layers(:)
      real(wp), allocatable :: growth(:)
      logical, allocatable :: coarsen(:)
      !> Infinite elements outside; else the bottom is clamped and the sides are free.
      logical :: infinite = .true.
   end type mesh_plan_type

   !> Bricks of the largest mesh.
   integer, parameter :: most_bricks = 400000

contains

   !> Refuse a plan whose mesh cannot be made.
   subroutine check_plan(plan, error)
      type(mesh_plan_type), intent(in) :: plan
      type(error_type), allocatable, intent(out) :: error
      integer :: block, step, nodes, bricks, hanging, classes

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
      do block = 1, size(plan%layers)
         if (plan%coarsen(block)) step = 2*step
         if (plan%layers(block) < 1 .or. .not. plan%growth(block) > 1.0_wp .or. .not. plan%growth(block) < 10.0_wp) then
            call raise(error, 'a block of '//to_text(plan%layers(block))//' layers growing by ' &
               & //to_text(plan%growth(block))//' cannot be made; allowed: at least 1, and 1 to 10', exit_bad_input)
            return
         end if
      end do
      if (mod(plan%depth_cells, step) /= 0 .or. mod(2*plan%half_cells, step) /= 0) call raise(error, &
         & 'the core of the mesh has '//to_text(2*plan%half_cells)//' x '//to_text(plan%depth_cells) &
         & //' elements, not multiples of '//to_text(step), exit_bad_input)
      if (allocated(error)) return
      call count_items(plan, nodes, bricks, hanging, classes)
      if (bricks > most_bricks) call raise(error, 'a mesh of '//to_text(bricks)//' elements is too large; allowed: up to ' &
         & //to_text(most_bricks), exit_bad_input)
   end subroutine check_plan

   !> How many nodes, bricks, hanging nodes and classes of bricks the mesh of a plan will have.
   pure subroutine count_items(plan, nodes, bricks, hanging, classes)
      type(mesh_plan_type), intent(in) :: plan
      integer, intent(out) :: nodes, bricks, hanging, classes
      integer :: block, step, nx, nz, facets, surface

      nx = 2*plan%half_cells
      nz = plan%depth_cells
      nodes = (nx + 1)**2*(nz + 1)
      bricks = nx**2*nz
      hanging = 0
      classes = 1
      step = 1
      do block = 1, size(plan%layers)
         if (plan%coarsen(block)) then
            hanging = hanging + surface_nodes(nx/step, nz/step) - surface_nodes(nx/(2*step), nz/(2*step))
            step = 2*step
         end if
         surface = surface_nodes(nx/step, nz/step)
         facets = (nx/step)**2 + 4*(nx/step)*(nz/step)
         nodes = nodes + plan%layers(block)*surface
         bricks = bricks + plan%layers(block)*facets
         classes = classes + facets
      end do
   end subroutine count_items

   pure integer function surface_nodes(nx, nz)
      integer, intent(in) :: nx, nz

      surface_nodes = (nx + 1)**2 + 4*nx*nz
   end function surface_nodes
end module mesh_plan
