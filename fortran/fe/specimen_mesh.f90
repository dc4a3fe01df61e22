!> What is indented, as the simulation sees it: a specimen makes its own mesh, for any fineness and contact radius.
module specimen_mesh
   use crystal_elasticity, only: isotropic_stiffness
   use errors, only: error_type
   use fe_mesh, only: mesh_type
   use kinds, only: wp
   use mesh_plan, only: finest_edge
   implicit none
   private
   public :: specimen_mesh_type

   type, abstract :: specimen_mesh_type
      !> Element that the mesh was made for: 'c3d8' or 'c3d8i'.
      character(len=5) :: default_element = 'c3d8i'
      !> Whether it has a length of its own: then its modulus depends on the depth, and theory, which is of the half-space, does not hold.
      logical :: has_length = .false.
      !> Names of the variables that only this specimen reads, separated by blanks.
      character(len=80) :: variables = ''
      !> Young's modulus (GPa) and Poisson's ratio of what is given beside the crystal; 0: nothing is.
      real(wp) :: young = 0.0_wp, poisson = 0.0_wp
      !> Elements per contact radius of the coarser mesh of an extrapolation, relative to the finer.
      real(wp) :: coarse_ratio = 2.0_wp/3.0_wp
   contains
      procedure :: check
      procedure :: materials
      procedure :: element_size
      procedure(make_mesh), deferred :: make
      procedure, non_overridable :: own_stiffness
      procedure, non_overridable :: element_of
   end type specimen_mesh_type

   abstract interface
      !> The mesh with `refine` times the default's elements per contact radius.
      subroutine make_mesh(self, refine, contact_radius, mesh, error)
         import :: error_type, mesh_type, specimen_mesh_type, wp
         class(specimen_mesh_type), intent(in) :: self
         real(wp), intent(in) :: refine
         !> At the last depth (half-space), um.
         real(wp), intent(in) :: contact_radius
         type(mesh_type), intent(out) :: mesh
         type(error_type), allocatable, intent(out) :: error
      end subroutine make_mesh
   end interface

contains

   !> Refuse sizes that cannot be meshed, in a message that begins with the variable; without sizes there are none.
   subroutine check(self, contact_radius, error)
      class(specimen_mesh_type), intent(in) :: self
      !> At the last depth (half-space), um.
      real(wp), intent(in) :: contact_radius
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, also_unused => contact_radius)
      end associate
   end subroutine check

   !> Edge of the bricks under the contact at refine = 1; um.
   pure real(wp) function element_size(self, contact_radius)
      class(specimen_mesh_type), intent(in) :: self
      !> At the last depth (half-space), um.
      real(wp), intent(in) :: contact_radius

      associate (unused => self)
      end associate
      element_size = finest_edge(contact_radius)
   end function element_size

   !> Stiffness of each material of the mesh, sample frame, GPa (6, 6, materials): the crystal alone, unless a specimen has more.
   pure function materials(self, crystal) result(c)
      class(specimen_mesh_type), intent(in) :: self
      !> Sample frame, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      real(wp), allocatable :: c(:, :, :)

      associate (unused => self)
      end associate
      c = spread(crystal, 3, 1)
   end function materials

   !> Stiffness of what is given beside the crystal, GPa; zero where there is nothing, so that the crystal's scale changes the moduli by a
   !> factor only.
   pure function own_stiffness(self) result(c)
      class(specimen_mesh_type), intent(in) :: self
      real(wp) :: c(6, 6)

      c = 0.0_wp
      if (self%young > 0.0_wp) c = isotropic_stiffness(self%young, self%poisson)
   end function own_stiffness

   !> Name of the brick element: as asked for, or the specimen's own where the word is empty.
   pure function element_of(self, word) result(name)
      class(specimen_mesh_type), intent(in) :: self
      character(len=*), intent(in) :: word
      character(len=:), allocatable :: name

      name = word
      if (len(word) == 0) name = trim(self%default_element)
   end function element_of
end module specimen_mesh
