!> The specimens there are: their names, and one by its settings.
module specimens
   use basic_specimen, only: finest_edge, halfspace_name, specimen_type
   use block_specimen, only: block_name, block_specimen_type
   use errors, only: error_type, exit_bad_input, raise
   use film_specimen, only: film_name, film_specimen_type
   use grain_specimen, only: grain_name, grain_specimen_type
   use indenters, only: indenter_type, new_indenter
   use kinds, only: wp
   use settings_schema, only: settings_type
   implicit none
   private
   public :: geometry_names, new_specimen, new_indentation

   character(len=*), parameter :: geometry_names = halfspace_name//', '//block_name//', '//film_name//', '//grain_name

contains

   !> The specimen of &specimen; a message of an error begins with the variable.
   subroutine new_specimen(settings, contact_radius, specimen, error)
      type(settings_type), intent(in) :: settings
      !> At the last depth (half-space), um.
      real(wp), intent(in) :: contact_radius
      class(specimen_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error

      select case (settings%specimen%geometry)
      case (halfspace_name)
         allocate (specimen)
      case (block_name)
         allocate (block_specimen_type :: specimen)
      case (film_name)
         allocate (film_specimen_type :: specimen)
      case (grain_name)
         allocate (grain_specimen_type :: specimen)
      case default
         call raise(error, "geometry: '"//settings%specimen%geometry//"' is unknown; allowed: "//geometry_names, exit_bad_input)
         return
      end select
      specimen%contact_radius = contact_radius
      specimen%element_size = finest_edge(contact_radius)
      specimen%element = settings%simulation%element
      specimen%estimator = settings%specimen%estimator
      call specimen%set_up(settings, error)
      if (.not. allocated(error)) call specimen%check_sizes(error)
      if (len(specimen%element) == 0) specimen%element = 'c3d8i'
   end subroutine new_specimen

   !> The indenter and the specimen of the settings; a message of an error begins with the group and the variable.
   subroutine new_indentation(settings, indenter, specimen, error)
      type(settings_type), intent(in) :: settings
      class(indenter_type), allocatable, intent(out) :: indenter
      class(specimen_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error

      call new_indenter(settings%indenter, indenter, error)
      if (allocated(error)) then
         error%message = '&indenter '//error%message
         return
      end if
      call new_specimen(settings, indenter%contact_radius, specimen, error)
      if (allocated(error)) error%message = '&specimen '//error%message
   end subroutine new_indentation
end module specimens
