!> What a sampler needs to know of a density.
module sampling_target
   use kinds, only: wp
   implicit none
   private
   public :: target_type

   type, abstract :: target_type
      !> Number of parameters, and a box that holds the support.
      integer :: dimension = 0
      real(wp), allocatable :: lower(:), upper(:)
   contains
      !> Whether a point is in the support; cheap.
      procedure(admits_interface), deferred :: admits
      !> Logarithm of the density at a point of the support, up to a constant. Threads call it at the same time.
      procedure(log_density_interface), deferred :: log_density
   end type target_type

   abstract interface
      pure logical function admits_interface(self, x)
         import :: target_type, wp
         class(target_type), intent(in) :: self
         real(wp), intent(in) :: x(:)
      end function admits_interface
      pure real(wp) function log_density_interface(self, x)
         import :: target_type, wp
         class(target_type), intent(in) :: self
         real(wp), intent(in) :: x(:)
      end function log_density_interface
   end interface
end module sampling_target
