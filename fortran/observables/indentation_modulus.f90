!> The kinds of indentation modulus, as functions of the modulus M of the half-space: all are a M/(1 + d M).
!>
!> M itself; E_eff of the contact with an elastic indenter, 1/E_eff = 1/M + (1-nu_i²)/E_i; E_s = (1-nu_s²) M of a sample whose
!> Poisson's ratio is assumed.
module indentation_modulus
   use abstract_observable, only: observable_type
   use kinds, only: wp
   implicit none
   private
   public :: indentation_modulus_type

   type, extends(observable_type) :: indentation_modulus_type
      !> a; d in 1/GPa.
      real(wp) :: factor = 1.0_wp, compliance = 0.0_wp
   contains
      procedure :: from_simulation, isotropic_modulus
   end type indentation_modulus_type

contains

   pure subroutine from_simulation(self, values, slopes)
      class(indentation_modulus_type), intent(in) :: self
      !> GPa.
      real(wp), intent(inout) :: values(:), slopes(:)

      if (self%compliance > 0.0_wp) then
         slopes = slopes/(1.0_wp + self%compliance*values)**2
         values = values/(1.0_wp + self%compliance*values)
      end if
      slopes = slopes*self%factor
      values = values*self%factor
   end subroutine from_simulation

   pure real(wp) function isotropic_modulus(self, measured)
      class(indentation_modulus_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: measured

      isotropic_modulus = measured/max(self%factor - self%compliance*measured, 1.0e-3_wp)
   end function isotropic_modulus
end module indentation_modulus
