!> The rules by which the next simulation may be chosen.
module acquisitions
   use abstract_acquisition, only: acquisition_type
   use errors, only: error_type, exit_bad_input, raise
   use imse_acquisition, only: imse_acquisition_type, imse_names
   use settings_groups, only: design_settings_type
   use text, only: split_list
   use variance_acquisition, only: new_variance_acquisition, variance_names
   implicit none
   private
   public :: acquisition_names, new_acquisition

   character(len=*), parameter :: acquisition_names = imse_names//', '//variance_names

contains

   !> The rule that &design asks for.
   subroutine new_acquisition(settings, rule, error)
      type(design_settings_type), intent(in) :: settings
      class(acquisition_type), allocatable, intent(out) :: rule
      type(error_type), allocatable, intent(out) :: error

      if (any(split_list(imse_names) == settings%variance_of)) then
         allocate (imse_acquisition_type :: rule)
      else if (any(split_list(variance_names) == settings%variance_of)) then
         allocate (rule, source=new_variance_acquisition(settings))
      else
         call raise(error, 'variance_of: '''//settings%variance_of//''' is unknown; allowed: '//acquisition_names, exit_bad_input)
      end if
   end subroutine new_acquisition
end module acquisitions
