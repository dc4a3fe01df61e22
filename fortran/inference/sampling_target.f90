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
      !> Coordinates in which the density is smoother, and back: by default the parameters themselves.
      procedure :: to_working
      procedure :: from_working
      !> log |dx/dw| at working coordinates w, up to a constant.
      procedure :: log_volume
   end type target_type

   abstract interface
      !> Whether `x` is in the support.
      pure logical function admits_interface(self, x)
         import :: target_type, wp
         class(target_type), intent(in) :: self
         real(wp), intent(in) :: x(:)
      end function admits_interface
      !> Log density at `x`.
      pure real(wp) function log_density_interface(self, x)
         import :: target_type, wp
         class(target_type), intent(in) :: self
         real(wp), intent(in) :: x(:)
      end function log_density_interface
   end interface
contains

   !> Working coordinates `w` of the parameters `x`.
   pure subroutine to_working(self, x, w)
      class(target_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: w(:)

      w = x(:self%dimension)
   end subroutine to_working

   !> Parameters `x` at working coordinates `w`.
   pure subroutine from_working(self, w, x)
      class(target_type), intent(in) :: self
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: x(:)

      x = w(:self%dimension)
   end subroutine from_working

   !> log |dx/dw| at working coordinates `w`, up to a constant.
   pure real(wp) function log_volume(self, w)
      class(target_type), intent(in) :: self
      real(wp), intent(in) :: w(:)

      log_volume = 0.0_wp*size(w)*self%dimension
   end function log_volume
end module sampling_target
