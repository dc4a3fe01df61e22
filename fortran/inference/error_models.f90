!> The likelihoods by name, and what is to be said of one.
module error_models
   use abstract_error_model, only: error_model_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use normal_errors, only: normal_errors_type
   use student_errors, only: new_student_errors
   use text, only: to_text
   implicit none
   private
   public :: likelihood_names, likelihood_type, new_error_model

   !> A new likelihood: its file, its name here, and its lines in `new_error_model`.
   character(len=*), parameter :: likelihood_names = 'normal, student'

   type :: likelihood_type
      !> One of `modulus_kind_names`.
      character(len=:), allocatable :: modulus_kind
      !> Of the indenter (GPa) and of the sample, for the kinds that need them.
      real(wp) :: indenter_modulus = 1140.0_wp, indenter_nu = 0.07_wp, sample_nu = 0.3_wp
      !> Relative sd of an error common to all grains of a group.
      real(wp) :: calibration_sd = 0.0_wp
      !> Relative sd of what differs from grain to grain beside the errors of measurement.
      real(wp) :: scatter_sd = 0.0_wp
      !> One of `likelihood_names`, and the degrees of freedom of Student's t.
      character(len=:), allocatable :: errors
      real(wp) :: student_dof = 4.0_wp
      !> Infer a common factor on the sds: one more parameter, its logarithm.
      logical :: infer_scale = .false.
      !> Count the surrogate's uncertainty.
      logical :: surrogate_uncertainty = .true.
      !> Leave the data out: the prior alone.
      logical :: prior_only = .false.
   end type likelihood_type

contains

   !> The errors of a likelihood.
   subroutine new_error_model(likelihood, model, error)
      type(likelihood_type), intent(in) :: likelihood
      class(error_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error

      if (.not. (likelihood%calibration_sd >= 0.0_wp .and. likelihood%calibration_sd < 1.0_wp)) then
         call raise(error, 'calibration_sd = '//to_text(likelihood%calibration_sd)//' is relative: 0 <= calibration_sd < 1', &
            & exit_bad_input)
         return
      end if
      select case (likelihood%errors)
      case ('normal')
         allocate (normal_errors_type :: model)
      case ('student')
         if (.not. (likelihood%student_dof > 0.0_wp .and. likelihood%student_dof < huge(1.0_wp))) then
            call raise(error, 'student_dof = '//to_text(likelihood%student_dof)//' must be positive', exit_bad_input)
            return
         end if
         allocate (model, source=new_student_errors(likelihood%student_dof))
      case default
         call raise(error, 'likelihood: '''//likelihood%errors//''' is unknown; allowed: '//likelihood_names, exit_bad_input)
      end select
   end subroutine new_error_model
end module error_models
