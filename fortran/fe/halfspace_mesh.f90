!> The half-space: bricks under the indenter, layers that grow around them, infinite elements outside. It has no length of its own.
module halfspace_mesh
   use errors, only: error_type
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: mesh_plan_type
   use specimen_mesh, only: specimen_mesh_type
   implicit none
   private
   public :: halfspace_mesh_type

   type, extends(specimen_mesh_type) :: halfspace_mesh_type
      !> Where the infinite elements begin, in contact radii, and growth of the layers before them at refine = 1.
      real(wp) :: outer = 0.0_wp, growth = 0.0_wp
   contains
      procedure :: contact_radius
      procedure :: make
   end type halfspace_mesh_type

contains

   pure function contact_radius(self, radius_um)
      class(halfspace_mesh_type), intent(in) :: self
      real(wp), intent(in) :: radius_um
      real(wp) :: contact_radius

      associate (unused => self)
      end associate
      contact_radius = radius_um/32.0_wp
   end function contact_radius

   !> 9.5 elements to the contact radius at refine = 1.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(halfspace_mesh_type), intent(in) :: self
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      !> Elements per contact radius, and depth of the core in contact radii.
      real(wp), parameter :: fineness = 9.5_wp, depth = 1.1_wp
      type(mesh_plan_type) :: plan
      real(wp) :: across, ratio

      across = fineness*refine
      ! Room for an elliptical contact, and for the ring of nodes around it that must stay free.
      plan%half_cells = max(4, nint(1.25_wp*across) + 2)
      plan%depth_cells = max(2, 2*nint(0.5_wp*depth*across))
      plan%half_width = contact_radius*plan%half_cells/across
      plan%depth = contact_radius*plan%depth_cells/across
      ratio = self%outer*contact_radius/plan%half_width
      plan%layers = [max(1, nint(log(ratio)/log(self%growth)*refine))]
      plan%growth = [ratio**(1.0_wp/plan%layers(1))]
      plan%coarsen = [.true.]
      plan%infinite = .true.
      call new_mesh(plan, mesh, error)
   end subroutine make
end module halfspace_mesh
