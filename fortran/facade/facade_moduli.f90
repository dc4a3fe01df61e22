! Kinds of modulus for f2py. status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> `values`: n indentation moduli (GPa) as another kind (GPa), of an indenter's Young's `modulus` (`indenter_modulus`, GPa) and
!> Poisson's ratio (`indenter_nu`), and the Poisson's ratio that was assumed of the sample (`sample_nu`).
subroutine moduli_of_kind(kind, indenter_modulus, indenter_nu, sample_nu, n, moduli, values, status, message)
   use abstract_observable, only: observable_type
   use interoperation, only: c_double, c_int, error_to_status, error_type
   use observables, only: new_observable
   use settings_groups, only: measurements_settings_type
   implicit none
   character(len=*), intent(in) :: kind
   real(c_double), intent(in) :: indenter_modulus, indenter_nu, sample_nu
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: moduli(n)
   real(c_double), intent(out) :: values(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   real(c_double) :: slope(n)
   class(observable_type), allocatable :: observable
   type(error_type), allocatable :: error

   values = moduli
   slope = 1
   call new_observable(kind, measurements_settings_type(indenter_modulus_gpa=indenter_modulus, indenter_nu=indenter_nu, &
      & sample_nu=sample_nu), observable, error)
   call error_to_status(error, status, message)
   if (status == 0) call observable%from_simulation(values, slope)
end subroutine moduli_of_kind
