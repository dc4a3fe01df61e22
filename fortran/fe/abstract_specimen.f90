!> What is indented, as the simulation sees it: a specimen plans its own mesh, for any fineness.
module abstract_specimen
   use crystal_elasticity, only: isotropic_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: mesh_plan_type
   use settings_schema, only: settings_type
   implicit none
   private
   public :: specimen_type, require

   type, abstract :: specimen_type
      !> Names of the variables that only some specimens read, those that this one reads, separated by ', '.
      character(len=:), allocatable :: variables
      !> What its materials are, separated by ', '.
      character(len=:), allocatable :: parts
      !> How its modulus is read (`&specimen estimator`).
      character(len=:), allocatable :: estimator
      !> Brick element, 'c3d8' or 'c3d8i': as asked for, or the specimen's own.
      character(len=:), allocatable :: element
      !> Whether it has a length of its own: then its modulus depends on the depth, and theory, which is of the half-space, does not hold.
      logical :: has_length = .true.
      !> Contact radius at the last depth (half-space), and edge of the bricks under the contact at refine = 1, um.
      real(wp) :: contact_radius = 0.0_wp, element_size = 0.0_wp
      !> How far the refined zone of the mesh reaches, relative to the default: an elliptical contact may be longer than that.
      real(wp) :: zone = 1.0_wp
      !> Young's modulus (GPa) and Poisson's ratio of what is given beside the crystal; 0: nothing is.
      real(wp) :: young = 0.0_wp, poisson = 0.0_wp
      !> Elements per contact radius of the coarser mesh of an extrapolation, relative to the finer.
      real(wp) :: coarse_ratio = 2.0_wp/3.0_wp
   contains
      procedure(take_settings), deferred :: set_up
      procedure(plan_mesh), deferred :: plan
      procedure :: check_sizes, materials, contrast_error
      procedure, non_overridable :: make, own_stiffness
   end type specimen_type

   abstract interface
      !> Its own variables.
      subroutine take_settings(self, settings, error)
         import :: error_type, settings_type, specimen_type
         !> With its contact radius and element size, and the element that was asked for, or ''.
         class(specimen_type), intent(inout) :: self
         type(settings_type), intent(in) :: settings
         type(error_type), allocatable, intent(out) :: error
      end subroutine take_settings

      !> The mesh with `refine` times the default's elements per contact radius.
      pure function plan_mesh(self, refine) result(plan)
         import :: mesh_plan_type, specimen_type, wp
         class(specimen_type), intent(in) :: self
         real(wp), intent(in) :: refine
         type(mesh_plan_type) :: plan
      end function plan_mesh
   end interface

contains

   subroutine make(self, refine, mesh, error)
      class(specimen_type), intent(in) :: self
      !> Elements per contact radius relative to the default.
      real(wp), intent(in) :: refine
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error

      call new_mesh(self%plan(refine), mesh, error)
   end subroutine make

   !> Refuse sizes that cannot be meshed, in a message that begins with the variable; by default there are none.
   subroutine check_sizes(self, error)
      class(specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self)
      end associate
   end subroutine check_sizes

   !> Stiffness of each material of the mesh, sample frame, GPa (6, 6, materials): the crystal alone, unless a specimen has more.
   pure function materials(self, crystal) result(c)
      class(specimen_type), intent(in) :: self
      !> Sample frame, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      real(wp), allocatable :: c(:, :, :)

      associate (unused => self)
      end associate
      c = spread(crystal, 3, 1)
   end function materials

   !> About how large the error of the mesh at refine = 1 may be, relative, by what the crystal is joined with; by default it is small.
   pure real(wp) function contrast_error(self, crystal)
      class(specimen_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: crystal(6, 6)

      associate (unused => self, unused_crystal => crystal)
      end associate
      contrast_error = 0.0_wp
   end function contrast_error

   !> Stiffness of what is given beside the crystal, GPa; zero where there is nothing, so that the crystal's scale changes the moduli by a
   !> factor only.
   pure function own_stiffness(self) result(c)
      class(specimen_type), intent(in) :: self
      real(wp) :: c(6, 6)

      c = 0.0_wp
      if (self%young > 0.0_wp) c = isotropic_stiffness(self%young, self%poisson)
   end function own_stiffness

   !> Take over a variable that a geometry needs.
   subroutine require(geometry, name, stated, value, error)
      !> Names of the specimen and of the variable.
      character(len=*), intent(in) :: geometry, name
      !> As in the settings.
      real(wp), intent(in), optional :: stated
      !> Where it goes.
      real(wp), intent(inout) :: value
      type(error_type), allocatable, intent(inout) :: error

      if (allocated(error)) return
      if (present(stated)) then
         value = stated
      else
         call raise(error, name//": the variable is missing; geometry = '"//geometry//"' needs it", exit_bad_input)
      end if
   end subroutine require
end module abstract_specimen
