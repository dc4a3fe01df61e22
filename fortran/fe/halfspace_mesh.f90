!> The half-space: bricks under the indenter, layers that grow around them, infinite elements outside. It has no length of its own.
module halfspace_mesh
   use errors, only: error_type
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: core_of_contact, layers_of_ratio, mesh_plan_type
   use specimen_mesh, only: specimen_mesh_type
   implicit none
   private
   public :: halfspace_mesh_type

   type, extends(specimen_mesh_type) :: halfspace_mesh_type
      !> Where the infinite elements begin, in contact radii, and growth of the layers before them at refine = 1.
      real(wp) :: outer = 0.0_wp, growth = 0.0_wp
   contains
      procedure :: make
   end type halfspace_mesh_type

contains

   !> The mesh with `refine` times the default's elements per contact radius, of a contact radius in um.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(halfspace_mesh_type), intent(in) :: self
      !> Relative to the default; contact radius at the last depth, um.
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      real(wp) :: ratio

      plan = core_of_contact(refine, contact_radius)
      ratio = self%outer*contact_radius/plan%half_width
      plan%stages = [layers_of_ratio(ratio, self%growth, refine)]
      plan%stages(1)%coarsen = .true.
      call new_mesh(plan, mesh, error)
   end subroutine make
end module halfspace_mesh
