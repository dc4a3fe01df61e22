!> The half-space: bricks under the indenter, layers that grow around them, infinite elements outside. It has no length of its own.
module halfspace_specimen
   use abstract_specimen, only: core_of_contact, layers_of_ratio, mesh_plan_type, specimen_type
   use errors, only: error_type
   use kinds, only: wp
   use settings_schema, only: settings_type
   implicit none
   private
   public :: halfspace_specimen_type, halfspace_name

   character(len=*), parameter :: halfspace_name = 'halfspace'

   type, extends(specimen_type) :: halfspace_specimen_type
      !> Where the infinite elements begin, in contact radii, and growth of the layers before them at refine = 1.
      real(wp) :: outer = 0.0_wp, growth = 0.0_wp
   contains
      procedure :: set_up, plan
   end type halfspace_specimen_type

contains

   subroutine set_up(self, settings, error)
      class(halfspace_specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error
      !> Growth of layers that interpolate as displacements decay, and of ordinary ones (docs/simulation.md).
      real(wp), parameter :: decaying = 1.35_wp, ordinary = 1.13_wp

      self%variables = 'outer, growth'
      self%parts = 'the specimen'
      self%has_length = .false.
      self%outer = settings%simulation%outer
      self%growth = merge(ordinary, decaying, self%element == 'c3d8')
      if (allocated(settings%simulation%growth)) self%growth = settings%simulation%growth
   end subroutine set_up

   pure function plan(self, refine)
      class(halfspace_specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine
      type(mesh_plan_type) :: plan

      plan = core_of_contact(refine, self%contact_radius, self%zone)
      plan%stages = [layers_of_ratio(self%outer*self%contact_radius*plan%widening/plan%half_width, self%growth, refine)]
      plan%stages(1)%coarsen = .true.
   end function plan
end module halfspace_specimen
