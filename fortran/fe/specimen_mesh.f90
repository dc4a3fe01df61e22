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
      procedure(length_of_contact), deferred :: contact_radius
      procedure(length_of_contact), deferred :: element_size
      procedure(make_mesh), deferred :: make
      procedure, non_overridable :: element_of
   end type specimen_mesh_type

   abstract interface
      !> Contact radius (Hertz) at the last depth, or edge of the bricks under it at refine = 1; um.
      pure real(wp) function length_of_contact(self, radius_um)
         import :: specimen_mesh_type, wp
         class(specimen_mesh_type), intent(in) :: self
         !> Radius of the indenter, um.
         real(wp), intent(in) :: radius_um
      end function length_of_contact

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

contains

   !> Name of the brick element: as asked for, or the specimen's own where the word is empty.
   pure function element_of(self, word) result(name)
      class(specimen_mesh_type), intent(in) :: self
      character(len=*), intent(in) :: word
      character(len=:), allocatable :: name

      name = word
      if (len(word) == 0) name = trim(self%default_element)
   end function element_of
end module specimen_mesh
