!> The specimens there are: their names, and one by its settings.
module specimens
   use block_mesh, only: block_mesh_type
   use errors, only: error_type, exit_bad_input, raise
   use film_mesh, only: film_mesh_type
   use grain_mesh, only: grain_mesh_type
   use halfspace_mesh, only: halfspace_mesh_type
   use kinds, only: wp
   use settings_groups, only: settings_type, simulation_settings_type, specimen_settings_type
   use specimen_mesh, only: specimen_mesh_type
   implicit none
   private
   public :: geometry_names, new_specimen

   character(len=*), parameter :: geometry_names = 'halfspace, block, film, grain'

contains

   !> The specimen of &specimen; a message of an error begins with the variable.
   subroutine new_specimen(settings, contact_radius, specimen, error)
      type(settings_type), intent(in) :: settings
      !> At the last depth (half-space), um.
      real(wp), intent(in) :: contact_radius
      class(specimen_mesh_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error

      select case (settings%specimen%geometry)
      case ('halfspace')
         specimen = new_halfspace(settings%simulation)
      case ('block')
         specimen = block_mesh_type(default_element='c3d8', has_length=.true., variables='width_um height_um', &
            & width=settings%specimen%width_um, height=settings%specimen%height_um)
      case ('film')
         call new_film(settings%specimen, specimen, error)
      case ('grain')
         call new_grain(settings%specimen, specimen, error)
      case default
         call raise(error, "geometry: '"//settings%specimen%geometry//"' is unknown; allowed: "//geometry_names, exit_bad_input)
         return
      end select
      if (.not. allocated(error)) call specimen%check(contact_radius, error)
   end subroutine new_specimen

   pure function new_halfspace(settings) result(specimen)
      type(simulation_settings_type), intent(in) :: settings
      type(halfspace_mesh_type) :: specimen
      !> Growth of layers that interpolate as displacements decay, and of ordinary ones (docs/simulation.md).
      real(wp), parameter :: decaying = 1.35_wp, ordinary = 1.13_wp

      specimen%variables = 'outer growth'
      specimen%outer = settings%outer
      specimen%growth = merge(decaying, ordinary, specimen%element_of(settings%element) == 'c3d8i')
      if (allocated(settings%growth)) specimen%growth = settings%growth
   end function new_halfspace

   subroutine new_film(settings, specimen, error)
      type(specimen_settings_type), intent(in) :: settings
      class(specimen_mesh_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error
      type(film_mesh_type) :: film

      film%has_length = .true.
      film%variables = 'thickness_um substrate'
      call require('film', 'thickness_um', settings%thickness_um, film%thickness, error)
      if (settings%substrate /= 'rigid') then
         film%variables = trim(film%variables)//' substrate_young_gpa substrate_nu'
         if (.not. allocated(error)) call require('film', 'substrate_young_gpa', settings%substrate_young_gpa, film%young, error)
         film%poisson = settings%substrate_nu
      end if
      specimen = film
   end subroutine new_film

   subroutine new_grain(settings, specimen, error)
      type(specimen_settings_type), intent(in) :: settings
      class(specimen_mesh_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error
      type(grain_mesh_type) :: grain

      grain%has_length = .true.
      ! So the few layers that turn into its boundary are about in proportion on both meshes (docs/simulation.md).
      grain%coarse_ratio = 0.75_wp
      grain%variables = 'grain_radius_um grain_depth_um matrix'
      call require('grain', 'grain_radius_um', settings%grain_radius_um, grain%radius, error)
      if (allocated(settings%grain_depth_um)) grain%depth = settings%grain_depth_um
      if (settings%matrix /= 'self') then
         grain%variables = trim(grain%variables)//' matrix_young_gpa matrix_nu'
         if (.not. allocated(error)) call require('grain', 'matrix_young_gpa', settings%matrix_young_gpa, grain%young, error)
         grain%poisson = settings%matrix_nu
      end if
      specimen = grain
   end subroutine new_grain

   !> Take over a variable that a geometry needs.
   subroutine require(geometry, name, stated, value, error)
      character(len=*), intent(in) :: geometry, name
      !> As in the settings.
      real(wp), intent(in), optional :: stated
      real(wp), intent(inout) :: value
      type(error_type), allocatable, intent(out) :: error

      if (present(stated)) then
         value = stated
      else
         call raise(error, name//": the variable is missing; geometry = '"//geometry//"' needs it", exit_bad_input)
      end if
   end subroutine require
end module specimens
