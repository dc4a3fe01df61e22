!> The rigid indenters there are: their names, and one by its settings.
module indenters
   use abstract_indenter, only: indenter_type
   use errors, only: error_type, exit_bad_input, raise
   use power_indenter, only: cone_name, paraboloid_name, power_indenter_type
   use settings_schema, only: indenter_settings_type
   use sphere_indenter, only: sphere_indenter_type, sphere_name
   implicit none
   private
   public :: indenter_names, new_indenter

   character(len=*), parameter :: indenter_names = paraboloid_name//', '//sphere_name//', '//cone_name

contains

   !> The indenter of &indenter with its last point; a message of an error begins with the variable.
   subroutine new_indenter(settings, indenter, error)
      type(indenter_settings_type), intent(in) :: settings
      class(indenter_type), allocatable, intent(out) :: indenter
      type(error_type), allocatable, intent(out) :: error

      select case (settings%shape)
      case (paraboloid_name, cone_name)
         allocate (power_indenter_type :: indenter)
      case (sphere_name)
         allocate (sphere_indenter_type :: indenter)
      case default
         call raise(error, 'shape: '''//settings%shape//''' is unknown; allowed: '//indenter_names, exit_bad_input)
         return
      end select
      call indenter%set_up(settings)
      if (allocated(settings%depth_um)) then
         call indenter%check_length('depth_um', settings%depth_um, error)
         if (allocated(error)) return
         indenter%depth = settings%depth_um
         indenter%contact_radius = indenter%contact_radius_of(indenter%depth)
      else
         call indenter%check_length('contact_radius_um', settings%contact_radius_um, error)
         if (allocated(error)) return
         indenter%contact_radius = settings%contact_radius_um
         indenter%depth = indenter%depth_of(indenter%contact_radius)
      end if
   end subroutine new_indenter
end module indenters
