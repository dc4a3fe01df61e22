!> Densities that the samplers are tried on.
module known_targets
   use kinds, only: wp
   use sampling_target, only: target_type
   implicit none
   private
   public :: banana_type

   !> x is normal within -1.5 .. 2, and y is normal about x² with sd 0.1.
   type, extends(target_type) :: banana_type
   contains
      procedure :: admits
      procedure :: log_density
   end type banana_type

contains

   pure logical function admits(self, x)
      class(banana_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      admits = all(x >= self%lower .and. x <= self%upper)
   end function admits

   pure real(wp) function log_density(self, x)
      class(banana_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      log_density = -0.5_wp*x(1)**2 - 0.5_wp*((x(2) - x(1)**2)/0.1_wp)**2
      if (self%dimension > 2) log_density = log_density - 0.5_wp*sum(x(3:)**2)
   end function log_density
end module known_targets
