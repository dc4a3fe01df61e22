!> The observables by name.
module observables
   use abstract_observable, only: observable_type
   use errors, only: error_type, exit_bad_input, raise
   use indentation_modulus, only: indentation_modulus_type
   use kinds, only: wp
   use settings_schema, only: measurements_settings_type
   use text, only: to_text
   implicit none
   private
   public :: observable_names, moduli_of_indentation, new_observable

   !> What every indentation gives.
   character(len=*), parameter :: moduli_of_indentation = 'indentation_modulus, effective_modulus, sample_modulus'
   !> A new observable: its file, its name here, and its line in `new_observable`.
   character(len=*), parameter :: observable_names = moduli_of_indentation

contains

   !> The observable of a name, with the numbers of &measurements that it needs.
   subroutine new_observable(name, settings, observable, error)
      character(len=*), intent(in) :: name
      type(measurements_settings_type), intent(in) :: settings
      class(observable_type), allocatable, intent(out) :: observable
      type(error_type), allocatable, intent(out) :: error

      associate (young => settings%indenter_modulus_gpa, nu => settings%indenter_nu, sample_nu => settings%sample_nu)
         if (.not. (young > 0.0_wp .and. abs(nu) < 1.0_wp .and. abs(sample_nu) < 1.0_wp)) then
            call raise(error, 'the indenter''s modulus ('//to_text(young)//' GPa) must be positive, Poisson''s ratios (' &
               & //to_text(nu)//', '//to_text(sample_nu)//') within -1 .. 1', exit_bad_input)
            return
         end if
         select case (name)
         case ('indentation_modulus')
            allocate (observable, source=indentation_modulus_type())
         case ('effective_modulus')
            allocate (observable, source=indentation_modulus_type(compliance=(1.0_wp - nu**2)/young))
         case ('sample_modulus')
            allocate (observable, source=indentation_modulus_type(factor=1.0_wp - sample_nu**2))
         case default
            call raise(error, 'modulus_kind: '''//name//''' is unknown; allowed: '//observable_names, exit_bad_input)
            return
         end select
      end associate
      observable%name = name
   end subroutine new_observable
end module observables
