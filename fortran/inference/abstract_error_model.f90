!> What a likelihood is: the distribution of the errors of independent measurements, with or without errors that they share.
module abstract_error_model
   use kinds, only: wp
   use random, only: random_stream_type
   implicit none
   private
   public :: error_model_type

   type, abstract :: error_model_type
      !> The scale of the density for a standard deviation of one: residuals come in units of it.
      real(wp) :: scale = 1.0_wp
   contains
      procedure(density_interface), deferred :: log_density
      procedure(integrate_interface), deferred :: integrate
      procedure(leave_one_out_interface), deferred :: leave_one_out
      procedure(draw_interface), deferred :: draw
   end type error_model_type

   abstract interface
      !> Logarithm of the density of residuals `r` whose scales are all `factor`, their units.
      pure real(wp) function density_interface(self, r, factor)
         import :: error_model_type, wp
         class(error_model_type), intent(in) :: self
         !> (measurement).
         real(wp), intent(in) :: r(:), factor
      end function density_interface
      !> Logarithm of the integral over b of the density of r - U b, of scale one, times N(b; 0, 1).
      pure subroutine integrate_interface(self, r, u, b, l, value)
         import :: error_model_type, wp
         class(error_model_type), intent(in) :: self
         !> (measurement), (measurement, shared error).
         real(wp), intent(in) :: r(:), u(:, :)
         !> Mean, or mode, of b given r, and the lower factor of its precision.
         real(wp), intent(out) :: b(:), l(:, :), value
      end subroutine integrate_interface
      !> Logarithm of the density of each residual given all others, of scale one.
      pure subroutine leave_one_out_interface(self, r, u, b, l, values)
         import :: error_model_type, wp
         class(error_model_type), intent(in) :: self
         !> (measurement), (measurement, shared error).
         real(wp), intent(in) :: r(:), u(:, :)
         !> What `integrate` gave of them.
         real(wp), intent(in) :: b(:), l(:, :)
         !> (measurement).
         real(wp), intent(out) :: values(:)
      end subroutine leave_one_out_interface
      !> An error `e` of scale one.
      subroutine draw_interface(self, stream, e)
         import :: error_model_type, random_stream_type, wp
         class(error_model_type), intent(in) :: self
         type(random_stream_type), intent(inout) :: stream
         real(wp), intent(out) :: e
      end subroutine draw_interface
   end interface
end module abstract_error_model
