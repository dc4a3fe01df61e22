!> The largest predictive variance (paper's section 2.1), of the modulus or of its logarithm; or the mean over all candidates. Where the
!> domain spreads crystals over their scale the latter is that of the logarithm: else the stiffest would decide for all.
module variance_acquisition
   use abstract_acquisition, only: acquisition_type
   use abstract_basis, only: basis_type
   use kinds, only: wp
   implicit none
   private
   public :: variance_acquisition_type

   type, extends(acquisition_type) :: variance_acquisition_type
      !> Of log M, not of M.
      logical :: relative = .false.
   contains
      procedure :: importance
      procedure :: needs_prediction
   end type variance_acquisition_type

contains

   !> |dM/dy|, or |d log M/dy|.
   pure elemental real(wp) function importance(self, basis, y, scale)
      class(variance_acquisition_type), intent(in) :: self
      class(basis_type), intent(in) :: basis
      !> Predicted y, 0 if it is not needed; GPa.
      real(wp), intent(in) :: y, scale

      importance = 1.0_wp
      if (.not. is_relative(self, basis)) importance = merge(basis%to_modulus(y, scale), scale, basis%logarithmic)
      if (is_relative(self, basis) .and. .not. basis%logarithmic) importance = 1.0_wp/max(tiny(1.0_wp), abs(y))
   end function importance

   pure logical function needs_prediction(self, basis)
      class(variance_acquisition_type), intent(in) :: self
      class(basis_type), intent(in) :: basis

      needs_prediction = is_relative(self, basis) .neqv. basis%logarithmic
   end function needs_prediction

   !> Whether log M counts.
   pure logical function is_relative(self, basis)
      class(variance_acquisition_type), intent(in) :: self
      class(basis_type), intent(in) :: basis

      is_relative = self%relative .or. (self%for_all .and. basis%domain%has_scale())
   end function is_relative
end module variance_acquisition
