!> What is indented, as the simulation sees it: a specimen makes its own mesh, for any fineness and contact radius.
module specimen_mesh
   use errors, only: error_type
   use fe_mesh, only: mesh_type
   use kinds, only: wp
   implicit none
   private
   public :: specimen_mesh_type

   type, abstract :: specimen_mesh_type
      !> Element that the mesh was made for: 'c3d8' or 'c3d8i'.
      character(len=5) :: default_element = 'c3d8i'
   contains
      procedure(contact_radius_of), deferred :: contact_radius
      procedure(make_mesh), deferred :: make
   end type specimen_mesh_type

   abstract interface
      !> Contact radius (Hertz) at the last depth, um.
      pure function contact_radius_of(self, radius_um) result(contact_radius)
         import :: specimen_mesh_type, wp
         class(specimen_mesh_type), intent(in) :: self
         !> Radius of the indenter, um.
         real(wp), intent(in) :: radius_um
         real(wp) :: contact_radius
      end function contact_radius_of

      !> The mesh with `refine` times the default's elements per contact radius.
      subroutine make_mesh(self, refine, contact_radius, mesh, error)
         import :: error_type, mesh_type, specimen_mesh_type, wp
         class(specimen_mesh_type), intent(in) :: self
         real(wp), intent(in) :: refine
         !> Largest contact radius (Hertz), um.
         real(wp), intent(in) :: contact_radius
         type(mesh_type), intent(out) :: mesh
         type(error_type), allocatable, intent(out) :: error
      end subroutine make_mesh
   end interface
end module specimen_mesh
