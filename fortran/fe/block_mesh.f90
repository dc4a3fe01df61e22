!> The paper's block of 9.6 x 9.6 x 4.8 um, bottom clamped and sides free; 12,400 elements at refine = 1.
module block_mesh
   use errors, only: error_type
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: mesh_plan_type
   use specimen_mesh, only: specimen_mesh_type
   implicit none
   private
   public :: block_mesh_type

   type, extends(specimen_mesh_type) :: block_mesh_type
   contains
      procedure :: contact_radius
      procedure :: element_size
      procedure :: make
   end type block_mesh_type

   !> Half-width and depth of the block, and the paper's contact radius, um.
   real(wp), parameter :: block_size = 4.8_wp, paper_contact = 0.5_wp
   !> Half-width of the box of bricks under the contact (um), and cells across it at refine = 1.
   real(wp), parameter :: box_width = 1.3_wp*paper_contact, box_cells = 10.0_wp

contains

   pure real(wp) function contact_radius(self, radius_um)
      class(block_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: radius_um

      associate (unused => self)
      end associate
      contact_radius = min(paper_contact, radius_um/8.0_wp)
   end function contact_radius

   !> 7.7 elements to the paper's contact radius.
   pure real(wp) function element_size(self, radius_um)
      class(block_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: radius_um

      associate (unused => self, also_unused => radius_um)
      end associate
      element_size = box_width/box_cells
   end function element_size

   !> The mesh with `refine` times the default's elements, whatever the contact radius (um) is.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(block_mesh_type), intent(in) :: self
      !> Relative to the default; largest contact radius (Hertz), um.
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan

      associate (unused => self, also_unused => contact_radius)
      end associate
      plan%half_cells = max(2, nint(box_cells*refine))
      plan%depth_cells = plan%half_cells
      plan%half_width = box_width
      plan%depth = plan%half_width
      plan%layers = [max(1, nint(7.0_wp*refine))]
      plan%growth = [(block_size/plan%half_width)**(1.0_wp/plan%layers(1))]
      plan%coarsen = [.false.]
      plan%infinite = .false.
      call new_mesh(plan, mesh, error)
   end subroutine make
end module block_mesh
