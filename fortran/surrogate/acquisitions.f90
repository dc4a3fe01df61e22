!> The rules by which the next simulation may be chosen.
module acquisitions
   use abstract_acquisition, only: acquisition_type
   use errors, only: error_type, exit_bad_input, raise
   use variance_acquisition, only: variance_acquisition_type
   implicit none
   private
   public :: acquisition_names, new_acquisition

   character(len=*), parameter :: acquisition_names = 'all_moduli, modulus, log_modulus'

contains

   !> The rule of this name.
   subroutine new_acquisition(name, rule, error)
      character(len=*), intent(in) :: name
      class(acquisition_type), allocatable, intent(out) :: rule
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('all_moduli')
         rule = variance_acquisition_type(for_all=.true., relative=.false.)
      case ('modulus')
         rule = variance_acquisition_type(relative=.false.)
      case ('log_modulus')
         rule = variance_acquisition_type(relative=.true.)
      case default
         call raise(error, 'variance_of: '''//name//''' is unknown; allowed: '//acquisition_names, exit_bad_input)
      end select
   end subroutine new_acquisition
end module acquisitions
