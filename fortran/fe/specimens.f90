!> The specimens there are: their names, and one by its settings.
module specimens
   use block_mesh, only: block_mesh_type
   use errors, only: error_type, exit_bad_input, raise
   use halfspace_mesh, only: halfspace_mesh_type
   use kinds, only: wp
   use settings_groups, only: settings_type
   use specimen_mesh, only: specimen_mesh_type
   implicit none
   private
   public :: geometry_names, new_specimen

   character(len=*), parameter :: geometry_names = 'halfspace, block'

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
         specimen = halfspace_mesh_type(variables='outer growth', outer=settings%simulation%outer, &
            & growth=settings%simulation%growth)
      case ('block')
         specimen = block_mesh_type(default_element='c3d8', has_length=.true., variables='width_um height_um', &
            & width=settings%specimen%width_um, height=settings%specimen%height_um)
      case default
         call raise(error, "geometry: '"//settings%specimen%geometry//"' is unknown; allowed: "//geometry_names, exit_bad_input)
         return
      end select
      call specimen%check(contact_radius, error)
   end subroutine new_specimen
end module specimens
