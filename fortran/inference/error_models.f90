!> The likelihoods by name, and what is to be said of one.
module error_models
   use abstract_error_model, only: error_model_type
   use errors, only: error_type, exit_bad_input, raise
   use normal_errors, only: normal_errors_type
   use settings_schema, only: measurements_settings_type
   use student_errors, only: new_student_errors
   implicit none
   private
   public :: likelihood_names, new_error_model

   !> A new likelihood: its file, its name here, and its lines in `new_error_model`.
   character(len=*), parameter :: likelihood_names = 'normal, student'

contains

   !> The errors that &measurements has.
   subroutine new_error_model(settings, model, error)
      type(measurements_settings_type), intent(in) :: settings
      class(error_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error

      select case (settings%likelihood)
      case ('normal')
         allocate (normal_errors_type :: model)
      case ('student')
         allocate (model, source=new_student_errors(settings%student_dof))
      case default
         call raise(error, 'likelihood: '''//settings%likelihood//''' is unknown; allowed: '//likelihood_names, exit_bad_input)
      end select
   end subroutine new_error_model
end module error_models
