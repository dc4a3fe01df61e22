!> Densities that the samplers are tried on.
module known_targets
   use kinds, only: wp
   use random, only: random_stream_type
   use sampling_target, only: target_type
   implicit none
   private
   public :: banana_type

   !> x is normal within -1.5 .. 2, and y is normal about x² with sd 0.1.
   type, extends(target_type) :: banana_type
      !> Bounds of the parameters, (dimension).
      real(wp), allocatable :: lower(:), upper(:)
   contains
      procedure :: draw_start
      procedure :: evaluate
   end type banana_type

contains

   subroutine draw_start(self, stream, x)
      class(banana_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: x(:)
      integer :: i

      do i = 1, size(x)
         call stream%uniform(x(i))
      end do
      x = self%lower + x*(self%upper - self%lower)
   end subroutine draw_start

   pure subroutine evaluate(self, x, log_density, admitted)
      class(banana_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: log_density
      logical, intent(out) :: admitted

      admitted = all(x >= self%lower .and. x <= self%upper)
      log_density = -0.5_wp*x(1)**2 - 0.5_wp*((x(2) - x(1)**2)/0.1_wp)**2
      if (self%dimension > 2) log_density = log_density - 0.5_wp*sum(x(3:)**2)
   end subroutine evaluate
end module known_targets
