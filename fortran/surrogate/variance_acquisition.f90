!> The candidate of largest predictive variance (paper's section 2.1; active learning, MacKay 1992), of the modulus or of its logarithm.
module variance_acquisition
   use abstract_acquisition, only: acquisition_type, sensitivity
   use abstract_basis, only: basis_type
   use kinds, only: wp
   use sequential_design, only: condition_on, design_type, tie, update_variance
   implicit none
   private
   public :: variance_acquisition_type

   type, extends(acquisition_type) :: variance_acquisition_type
   contains
      procedure :: choose
   end type variance_acquisition_type

contains

   subroutine choose(self, design, basis, scale, spread, threads, chosen, variance)
      class(variance_acquisition_type), intent(in) :: self
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      real(wp), intent(in) :: scale(:), spread(:)
      integer, intent(in) :: threads
      integer, intent(out) :: chosen(:)
      real(wp), intent(out) :: variance(:)
      real(wp), allocatable :: factor(:)
      integer :: k

      factor = sensitivity(design, basis, scale, spread, self%relative)**2
      do k = 1, size(chosen)
         chosen(k) = most_uncertain(design, factor)
         variance(k) = design%variance(chosen(k))
         design%available(chosen(k)) = .false.
         call condition_on(design, design%candidates(:, chosen(k)), threads)
      end do
   end subroutine choose

   !> The available candidate of largest factor x variance, the lowest number of equals. A variance that lacks deferred
   !> choices is an upper bound: only candidates that might still be the largest are updated.
   integer function most_uncertain(design, factor) result(best)
      type(design_type), intent(inout) :: design
      real(wp), intent(in) :: factor(:)
      real(wp) :: threshold
      integer :: j

      best = maxloc(factor*design%variance, 1, mask=design%available)
      call update_variance(design, best)
      threshold = (1.0_wp - tie)*factor(best)*design%variance(best)
      do j = 1, size(design%variance)
         if (.not. design%available(j) .or. factor(j)*design%variance(j) < threshold) cycle
         call update_variance(design, j)
         threshold = max(threshold, (1.0_wp - tie)*factor(j)*design%variance(j))
      end do
      ! All that reach the last threshold are up to date.
      best = findloc(design%available .and. factor*design%variance >= threshold, .true., 1)
   end function most_uncertain
end module variance_acquisition
