!> A block, bottom clamped and sides free: the paper's, of 9.6 x 9.6 x 4.8 um, where nothing else is stated.
module block_specimen
   use basic_specimen, only: clamped_bottom, layers_of_ratio, mesh_plan_type, specimen_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use settings_schema, only: settings_type
   use text, only: to_text
   implicit none
   private
   public :: block_specimen_type, block_name

   character(len=*), parameter :: block_name = 'block'

   type, extends(specimen_type) :: block_specimen_type
      !> Its edges along x and y, and along z, um.
      real(wp) :: width = 0.0_wp, height = 0.0_wp
   contains
      procedure :: set_up, check_sizes, plan
   end type block_specimen_type

   !> Half-width of the box of bricks under the contact in contact radii, and cells across it at refine = 1.
   real(wp), parameter :: box_width = 1.3_wp, box_cells = 10.0_wp
   !> Layers around the box at refine = 1, and the size of the block over that of its box, of the paper's block.
   real(wp), parameter :: paper_layers = 7.0_wp, paper_ratio = 4.8_wp/0.65_wp
   !> The block is this many contact radii wide, and as high as these shares of half its width.
   real(wp), parameter :: least_width = 4.0_wp, lowest = 0.25_wp, highest = 4.0_wp
   !> Its half-width over that of the box under the contact, at least.
   real(wp), parameter :: least_ratio = 1.2_wp

contains

   subroutine set_up(self, settings, error)
      class(block_specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error

      self%variables = 'width_um, height_um'
      self%parts = 'the specimen'
      if (len(self%element) == 0) self%element = 'c3d8'
      self%element_size = box_width*self%contact_radius/box_cells
      self%width = settings%specimen%width_um
      self%height = settings%specimen%height_um
   end subroutine set_up

   !> Refuse a block that is too small for its contact, or that is no block.
   subroutine check_sizes(self, error)
      class(block_specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      associate (half => 0.5_wp*self%width, narrowest => max(least_width, 2.0_wp*least_ratio*box_width*self%zone) &
                & *self%contact_radius)
         if (self%width < narrowest) then
            call raise(error, 'width_um: '//to_text(self%width)//' um is too narrow for a contact radius of ' &
               & //to_text(self%contact_radius, 3)//' um; allowed from '//to_text(narrowest, 3)//' um', exit_bad_input)
         else if (self%height < lowest*half .or. self%height > highest*half) then
            call raise(error, 'height_um: '//to_text(self%height)//' um does not go with width_um = '//to_text(self%width) &
               & //'; allowed '//to_text(lowest*half)//' to '//to_text(highest*half)//' um', exit_bad_input)
         end if
      end associate
   end subroutine check_sizes

   !> The box under the contact has the proportions of the block.
   pure function plan(self, refine)
      class(block_specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine
      type(mesh_plan_type) :: plan
      real(wp) :: proportion, ratio
      integer :: default_cells

      proportion = self%height/(0.5_wp*self%width)
      default_cells = max(2, nint(box_cells*refine))
      plan%half_cells = nint(default_cells*self%zone)
      plan%depth_cells = max(2, nint(proportion*plan%half_cells))
      plan%half_width = box_width*self%contact_radius*(real(plan%half_cells, wp)/default_cells)
      plan%depth = proportion*plan%half_width
      ratio = 0.5_wp*self%width/plan%half_width
      plan%stages = [layers_of_ratio(ratio, exp(log(paper_ratio)/paper_layers), refine)]
      plan%closing = clamped_bottom
   end function plan
end module block_specimen
