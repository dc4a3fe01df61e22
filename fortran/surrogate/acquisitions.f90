!> The rules by which the next simulation may be chosen.
module acquisitions
   use abstract_acquisition, only: acquisition_type
   use errors, only: error_type, exit_bad_input, raise
   use imse_acquisition, only: imse_acquisition_type
   use variance_acquisition, only: variance_acquisition_type
   implicit none
   private
   public :: acquisition_names, new_acquisition

   !> A new rule: its file, its name here, and its line in `new_acquisition`. All but the first, the third and the fifth are older names.
   character(len=*), parameter :: acquisition_names = 'imse, all_moduli, variance, modulus, relative_variance, log_modulus'

contains

   !> The rule of a name.
   subroutine new_acquisition(name, rule, error)
      character(len=*), intent(in) :: name
      class(acquisition_type), allocatable, intent(out) :: rule
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('imse', 'all_moduli')
         allocate (imse_acquisition_type :: rule)
      case ('variance', 'modulus')
         allocate (variance_acquisition_type :: rule)
      case ('relative_variance', 'log_modulus')
         allocate (rule, source=variance_acquisition_type(relative=.true.))
      case default
         call raise(error, 'variance_of: '''//name//''' is unknown; allowed: '//acquisition_names, exit_bad_input)
      end select
   end subroutine new_acquisition
end module acquisitions
