!> What a likelihood is: the distribution of the errors of independent measurements, with or without errors that they share.
module abstract_error_model
   use kinds, only: pi, wp
   use random, only: random_stream_type
   use small_matrices, only: factor_definite, fit_columns, solve_lower, weighted_gram
   implicit none
   private
   public :: error_model_type

   type, abstract :: error_model_type
      !> The scale of the density for a standard deviation of one: residuals come in units of it.
      real(wp) :: scale = 1.0_wp
   contains
      procedure(log_density_interface), deferred :: log_density
      procedure(weigh_interface), deferred :: weigh
      procedure(as_normals_interface), deferred :: as_normals
      procedure(draw_interface), deferred :: draw
      procedure :: integrate, leave_one_out
   end type error_model_type

   abstract interface
      !> Logarithm of the density of residuals `r` whose scales are all `factor`, their units.
      pure real(wp) function log_density_interface(self, r, factor)
         import :: error_model_type, wp
         class(error_model_type), intent(in) :: self
         !> (measurement).
         real(wp), intent(in) :: r(:), factor
      end function log_density_interface
      !> Minus the first derivative of the log density of scale one over the residual, minus the second, and the one that is expected.
      pure subroutine weigh_interface(self, e, weight, curvature, expected)
         import :: error_model_type, wp
         class(error_model_type), intent(in) :: self
         !> Residuals in units of the scale, (measurement).
         real(wp), intent(in) :: e(:)
         !> In the order above, (measurement).
         real(wp), intent(out) :: weight(:)
         !> (measurement), likewise.
         real(wp), intent(out), optional :: curvature(:), expected(:)
      end subroutine weigh_interface
      !> The density of scale one as a mixture of normal ones.
      pure subroutine as_normals_interface(self, variance, share)
         import :: error_model_type, wp
         class(error_model_type), intent(in) :: self
         !> (component).
         real(wp), allocatable, intent(out) :: variance(:), share(:)
      end subroutine as_normals_interface
      !> An error `e` of scale one.
      subroutine draw_interface(self, stream, e)
         import :: error_model_type, random_stream_type, wp
         class(error_model_type), intent(in) :: self
         type(random_stream_type), intent(inout) :: stream
         real(wp), intent(out) :: e
      end subroutine draw_interface
   end interface

   !> A pivot of the precision that is a smaller share of its entry has lost its digits.
   real(wp), parameter :: resolution = 1.0e-13_wp

contains

   !> Logarithm of the integral over b of the density of r - U b, of scale one, times N(b; 0, 1): by Laplace's approximation about the mode,
   !> which is exact for normal errors.
   pure subroutine integrate(self, r, u, b, l, value)
      class(error_model_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode of b given r, and the lower factor of its precision.
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp), dimension(size(r)) :: e, weight, used, curvature, expected
      real(wp) :: before(size(b))
      integer :: j, step
      logical :: definite

      b = 0.0_wp
      call self%weigh(r, weight)
      do step = 1, 40
         before = b
         used = weight
         call fit_columns(r, u, used, b, l)
         e = r - matmul(u, b)
         call self%weigh(e, weight)
         if (maxval(abs(b - before)) < 1.0e-9_wp .or. maxval(abs(weight - used)) <= 0.0_wp) exit
      end do
      call self%weigh(e, weight, curvature, expected)
      value = self%log_density(e, 1.0_wp) - 0.5_wp*sum(b**2)
      if (maxval(abs(curvature - used)) > 0.0_wp) then
         call weighted_gram(u, curvature, l)
         call factor_definite(l, resolution, definite)
         ! Outliers outweigh the rest: the expected curvature stands in for the observed one.
         if (.not. definite) call fit_columns(e, u, expected, before, l)
      end if
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate

   !> Logarithm of the density of each residual given all others, of scale one: without shared errors the density itself. Else b given the
   !> others is taken as normal: curvature of the log density at the mode less that of residual i, where convex, and one step of Newton's
   !> from there. The integral over that is one over the variances of the normal errors of which the density is a mixture; it is exact for
   !> normal errors (Bürkner, Gabry and Vehtari, Comput. Stat. 36, 1243, 2021).
   pure subroutine leave_one_out(self, r, u, b, l, values)
      class(error_model_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> What `integrate` gave of them.
      real(wp), intent(in) :: b(:), l(:, :)
      !> (measurement).
      real(wp), intent(out) :: values(:)
      real(wp), allocatable :: variance(:), share(:), terms(:)
      real(wp), dimension(size(r)) :: e, weight, curvature
      real(wp) :: factor(size(b), size(b)), z(size(b)), h, spread
      logical :: definite
      integer :: i

      if (size(b) == 0) then
         do i = 1, size(r)
            values(i) = self%log_density(r(i:i), 1.0_wp)
         end do
         return
      end if
      e = r - matmul(u, b)
      call self%weigh(e, weight, curvature)
      curvature = max(0.0_wp, curvature)
      call weighted_gram(u, curvature, factor)
      call factor_definite(factor, resolution, definite)
      if (.not. definite) factor = l
      call self%as_normals(variance, share)
      do i = 1, size(r)
         z = u(i, :)
         call solve_lower(factor, z)
         ! Of u b: the variance without i, and what the pull of i on the mode was.
         h = sum(z**2)
         spread = h/max(1.0e-6_wp, 1.0_wp - curvature(i)*h)
         terms = log(share) - 0.5_wp*(e(i)*(1.0_wp + spread*weight(i)))**2/(variance + spread) &
            & - 0.5_wp*log(2.0_wp*pi*(variance + spread))
         values(i) = maxval(terms) + log(sum(exp(terms - maxval(terms))))
      end do
   end subroutine leave_one_out
end module abstract_error_model
