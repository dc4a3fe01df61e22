!> A block, bottom clamped and sides free: the paper's, of 9.6 x 9.6 x 4.8 um, where nothing else is stated.
module block_mesh
   use errors, only: error_type, exit_bad_input, raise
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: clamped_bottom, layers_of_ratio, mesh_plan_type
   use specimen_mesh, only: specimen_mesh_type
   use text, only: to_text
   implicit none
   private
   public :: block_mesh_type

   type, extends(specimen_mesh_type) :: block_mesh_type
      !> Its edges along x and y, and along z, um.
      real(wp) :: width = 0.0_wp, height = 0.0_wp
   contains
      procedure :: check
      procedure :: element_size
      procedure :: make
   end type block_mesh_type

   !> Half-width of the box of bricks under the contact in contact radii, and cells across it at refine = 1.
   real(wp), parameter :: box_width = 1.3_wp, box_cells = 10.0_wp
   !> Layers around the box at refine = 1, and the size of the block over that of its box, of the paper's block.
   real(wp), parameter :: paper_layers = 7.0_wp, paper_ratio = 4.8_wp/0.65_wp
   !> The block is this many contact radii wide, and as high as these shares of half its width.
   real(wp), parameter :: least_width = 4.0_wp, lowest = 0.25_wp, highest = 4.0_wp

contains

   !> Refuse a block that is too small for its contact, or that is no block.
   subroutine check(self, contact_radius, error)
      class(block_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: contact_radius
      type(error_type), allocatable, intent(out) :: error

      associate (half => 0.5_wp*self%width)
         if (self%width < least_width*contact_radius) then
            call raise(error, 'width_um: '//to_text(self%width)//' um is too narrow for a contact radius of ' &
               & //to_text(contact_radius, 3)//' um; allowed from '//to_text(least_width*contact_radius, 3)//' um', exit_bad_input)
         else if (self%height < lowest*half .or. self%height > highest*half) then
            call raise(error, 'height_um: '//to_text(self%height)//' um does not go with width_um = '//to_text(self%width) &
               & //'; allowed '//to_text(lowest*half)//' to '//to_text(highest*half)//' um', exit_bad_input)
         end if
      end associate
   end subroutine check

   !> 7.7 elements to the contact radius.
   pure real(wp) function element_size(self, contact_radius)
      class(block_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: contact_radius

      associate (unused => self)
      end associate
      element_size = box_width*contact_radius/box_cells
   end function element_size

   !> The mesh with `refine` times the default's elements: the box under the contact has the proportions of the block.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(block_mesh_type), intent(in) :: self
      !> Relative to the default; contact radius at the last depth, um.
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      real(wp) :: proportion, ratio

      proportion = self%height/(0.5_wp*self%width)
      plan%half_cells = max(2, nint(box_cells*refine))
      plan%depth_cells = max(2, nint(proportion*plan%half_cells))
      plan%half_width = box_width*contact_radius
      plan%depth = proportion*plan%half_width
      ratio = 0.5_wp*self%width/plan%half_width
      plan%stages = [layers_of_ratio(ratio, exp(log(paper_ratio)/paper_layers), refine)]
      plan%closing = clamped_bottom
      call new_mesh(plan, mesh, error)
   end subroutine make
end module block_mesh
