!> The likelihoods by name.
module error_models
   use abstract_error_model, only: error_model_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use normal_errors, only: normal_errors_type
   use student_errors, only: new_student_errors
   use text, only: to_text
   implicit none
   private
   public :: likelihood_names, new_error_model

   !> A new likelihood: its file, its name here, and its lines in `new_error_model`.
   character(len=*), parameter :: likelihood_names = 'normal, student'

contains

   !> The likelihood of a name.
   subroutine new_error_model(name, student_dof, model, error)
      character(len=*), intent(in) :: name
      !> Degrees of freedom of Student's t.
      real(wp), intent(in) :: student_dof
      class(error_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('normal')
         allocate (normal_errors_type :: model)
      case ('student')
         if (.not. (student_dof > 0.0_wp .and. student_dof < huge(1.0_wp))) then
            call raise(error, 'student_dof = '//to_text(student_dof)//' must be positive', exit_bad_input)
            return
         end if
         allocate (model, source=new_student_errors(student_dof))
      case default
         call raise(error, 'likelihood: '''//name//''' is unknown; allowed: '//likelihood_names, exit_bad_input)
      end select
   end subroutine new_error_model
end module error_models
