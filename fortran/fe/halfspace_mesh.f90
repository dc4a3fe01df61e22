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
      procedure :: element_size
      procedure :: make
   end type halfspace_mesh_type

   !> Elements per contact radius at refine = 1.
   real(wp), parameter :: fineness = 9.5_wp

contains

   pure real(wp) function element_size(self, contact_radius)
      class(halfspace_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: contact_radius

      associate (unused => self)
      end associate
      element_size = contact_radius/fineness
   end function element_size

   !> The mesh with `refine` times the default's elements per contact radius, of a contact radius in um.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(halfspace_mesh_type), intent(in) :: self
      !> Relative to the default; contact radius at the last depth, um.
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      !> Depth of the core in contact radii.
      real(wp), parameter :: depth = 1.1_wp
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
