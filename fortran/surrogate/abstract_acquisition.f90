!> Which candidate is worth simulating next: the one of largest importance² x variance of y, or the one that lowers the mean of that over
!> all candidates most.
!>
!> The variance does not depend on moduli to come, and only falls as simulations are added: `sequential_design` relies on both. So a
!> rule says how much the variance of y matters at a candidate. A new rule is its module and a line in `acquisitions`.
module abstract_acquisition
   use abstract_basis, only: basis_type
   use kinds, only: wp
   implicit none
   private
   public :: acquisition_type

   type, abstract :: acquisition_type
      !> The mean over all candidates counts, not the largest.
      logical :: for_all = .false.
   contains
      procedure(importance_interface), deferred :: importance
      procedure(needs_prediction_interface), deferred :: needs_prediction
   end type acquisition_type

   abstract interface
      !> The importance of a candidate, above 0.
      pure elemental real(wp) function importance_interface(self, basis, y, scale)
         import :: acquisition_type, basis_type, wp
         class(acquisition_type), intent(in) :: self
         class(basis_type), intent(in) :: basis
         !> Predicted y, 0 if it is not needed; GPa.
         real(wp), intent(in) :: y, scale
      end function importance_interface

      !> Whether the predicted y matters.
      pure logical function needs_prediction_interface(self, basis)
         import :: acquisition_type, basis_type
         class(acquisition_type), intent(in) :: self
         class(basis_type), intent(in) :: basis
      end function needs_prediction_interface
   end interface
end module abstract_acquisition
