!> What a sampler needs to know of a density.
module sampling_target
   use kinds, only: wp
   use output_polynomial, only: is_fitted, output_polynomial_type
   use random, only: random_stream_type
   implicit none
   private
   public :: target_type, point_type

   !> A point of the support: parameters, coordinates in which the density is smoother, and the logarithms of both densities, up to a
   !> constant.
   type :: point_type
      !> (dimension).
      real(wp), allocatable :: x(:), w(:)
      !> Of x, and of w, which has the volume |dx/dw| in it.
      real(wp) :: log_density = -huge(1.0_wp), log_working = -huge(1.0_wp)
   end type point_type

   type, abstract :: target_type
      !> Number of parameters.
      integer :: dimension = 0
      !> Number of smooth results of the working coordinates, costly to compute, from which the density follows at little cost; 0 if it
      !> is not of this kind.
      integer :: n_outputs = 0
   contains
      !> A point that may be in the support, to begin with: widely spread, and in it often enough.
      procedure(draw_start_interface), deferred :: draw_start
      !> Logarithm of the density of the parameters, up to a constant, and whether they are in the support.
      procedure(evaluate_interface), deferred :: evaluate
      !> Coordinates in which the density is smoother: by default the parameters themselves.
      procedure :: to_working
      procedure :: evaluate_working
      procedure :: evaluate_outputs
   end type target_type

   abstract interface
      subroutine draw_start_interface(self, stream, x)
         import :: random_stream_type, target_type, wp
         class(target_type), intent(in) :: self
         type(random_stream_type), intent(inout) :: stream
         !> (dimension).
         real(wp), intent(out) :: x(:)
      end subroutine draw_start_interface
      !> Threads call it at the same time.
      pure subroutine evaluate_interface(self, x, log_density, admitted)
         import :: target_type, wp
         class(target_type), intent(in) :: self
         !> (dimension).
         real(wp), intent(in) :: x(:)
         !> Only of use where the point is `admitted`.
         real(wp), intent(out) :: log_density
         !> Whether it is in the support.
         logical, intent(out) :: admitted
      end subroutine evaluate_interface
   end interface
contains

   !> Working coordinates `w` of the parameters `x` of a point of the support.
   pure subroutine to_working(self, x, w)
      class(target_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: w(:)

      w = x(:self%dimension)
   end subroutine to_working

   !> All of a point from its working coordinates, which are there; the densities only if it is `admitted`.
   pure subroutine evaluate_working(self, point, admitted, polynomial)
      class(target_type), intent(in) :: self
      type(point_type), intent(inout) :: point
      !> Whether it is in the support.
      logical, intent(out) :: admitted
      !> What takes the place of the costly results, if it is there and fitted.
      type(output_polynomial_type), intent(in), optional :: polynomial

      point%x = point%w
      call self%evaluate(point%x, point%log_density, admitted)
      ! There is none for what has no costly results.
      admitted = admitted .and. .not. is_fitted(polynomial)
      point%log_working = point%log_density
   end subroutine evaluate_working

   !> The costly results at a point, if it is in the support, and coordinates in which they are smooth; there are none by default.
   pure subroutine evaluate_outputs(self, w, arguments, outputs, admitted)
      class(target_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: w(:)
      !> (dimension), (n_outputs).
      real(wp), intent(out) :: arguments(:), outputs(:)
      !> Whether the point is in the support.
      logical, intent(out) :: admitted

      arguments = w
      outputs = 0.0_wp
      admitted = self%n_outputs > 0
   end subroutine evaluate_outputs
end module sampling_target
