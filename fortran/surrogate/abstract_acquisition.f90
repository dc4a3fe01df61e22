!> Which candidates are worth simulating next, by the variance of M or of log M that the posterior leaves.
!>
!> A new rule is its module and its lines in `acquisitions`.
module abstract_acquisition
   use abstract_basis, only: basis_type
   use kinds, only: wp
   use sequential_design, only: design_type
   implicit none
   private
   public :: acquisition_type, sensitivity

   type, abstract :: acquisition_type
      !> The variance of log M counts, not that of M.
      logical :: relative = .false.
   contains
      procedure(choose_interface), deferred :: choose
   end type acquisition_type

   abstract interface
      !> Choose `size(chosen)` available candidates, of which there are so many, each given all chosen before; the lowest number of
      !> equals. Their moduli are not needed: afterwards the posterior's covariance is that of all data and all chosen.
      subroutine choose_interface(self, design, basis, scale, spread, threads, chosen, variance)
         import :: acquisition_type, basis_type, design_type, wp
         class(acquisition_type), intent(in) :: self
         type(design_type), intent(inout) :: design
         class(basis_type), intent(in) :: basis
         !> Of each candidate, GPa, and its spread.
         real(wp), intent(in) :: scale(:), spread(:)
         integer, intent(in) :: threads
         !> Numbers of the candidates, from 1.
         integer, intent(out) :: chosen(:)
         !> Variance of y at each before it was chosen.
         real(wp), intent(out) :: variance(:)
      end subroutine choose_interface
   end interface

contains

   !> |dM/dy| of each candidate, or |d log M/dy|, above 0: its square times the variance of y is the variance of M, or of log M.
   function sensitivity(design, basis, scale, spread, relative) result(slope)
      type(design_type), intent(in) :: design
      class(basis_type), intent(in) :: basis
      !> Of each candidate, GPa, and its spread.
      real(wp), intent(in) :: scale(:), spread(:)
      !> Of log M.
      logical, intent(in) :: relative
      real(wp), allocatable :: slope(:)

      if (relative .neqv. basis%logarithmic) then
         slope = matmul(design%regression%mean, design%candidates)
         if (relative) then
            slope = 1.0_wp/max(tiny(1.0_wp), abs(slope))
         else
            slope = basis%to_modulus(slope, scale, spread)*spread
         end if
      else
         slope = merge(spread, scale, relative)
      end if
   end function sensitivity
end module abstract_acquisition
