!> Student's t: errors of which some are far off.
!>
!> For more than two degrees of freedom its standard deviation is that of the measurement, so the scale is sqrt((dof - 2)/dof) of
!> it.
!> With two or fewer the distribution has no standard deviation, and what is stated is its scale.
module student_errors
   use abstract_error_model, only: error_model_type
   use kinds, only: pi, wp
   use small_matrices, only: factor_definite, fit_columns, sum_of_logs, weighted_gram
   implicit none
   private
   public :: student_errors_type, new_student_errors

   type, extends(error_model_type) :: student_errors_type
      !> Degrees of freedom, positive.
      real(wp) :: dof = 4.0_wp
   contains
      procedure :: log_density
      procedure :: integrate
   end type student_errors_type

contains

   pure function new_student_errors(dof) result(self)
      !> Degrees of freedom.
      real(wp), intent(in) :: dof
      type(student_errors_type) :: self

      self%dof = dof
      if (dof > 2.0_wp) self%scale = sqrt((dof - 2.0_wp)/dof)
   end function new_student_errors

   pure real(wp) function log_density(self, r, factor)
      class(student_errors_type), intent(in) :: self
      !> Residuals in units of the scale, and the factor on that.
      real(wp), intent(in) :: r(:), factor

      log_density = size(r)*(log_gamma(0.5_wp*(self%dof + 1.0_wp)) - log_gamma(0.5_wp*self%dof) &
         & - 0.5_wp*log(pi*self%dof) - log(factor)) &
         & - 0.5_wp*(self%dof + 1.0_wp)*sum_of_logs(1.0_wp + (r/factor)**2/self%dof)
   end function log_density

   !> By Laplace's approximation about the mode.
   pure subroutine integrate(self, r, u, b, l, value)
      class(student_errors_type), intent(in) :: self
      !> (measurement), (measurement, shared error).
      real(wp), intent(in) :: r(:), u(:, :)
      !> Mode of b given r, and the lower factor of its precision.
      real(wp), intent(out) :: b(:), l(:, :), value
      real(wp) :: e(size(r)), weight(size(r)), before(size(b)), misfit
      integer :: j, step
      logical :: definite

      b = 0.0_wp
      e = r
      do step = 1, 40
         before = b
         weight = (self%dof + 1.0_wp)/(self%dof + e**2)
         call fit_columns(r, u, weight, b, l, misfit)
         e = r - matmul(u, b)
         if (maxval(abs(b - before)) < 1.0e-9_wp) exit
      end do
      value = self%log_density(e, 1.0_wp) - 0.5_wp*sum(b**2)
      weight = (self%dof + 1.0_wp)*(self%dof - e**2)/(self%dof + e**2)**2
      call weighted_gram(u, weight, l)
      call factor_definite(l, 1.0e-13_wp, definite)
      if (.not. definite) then
         ! Outliers outweigh the rest: the expected curvature of Student's t stands in for the observed one.
         weight = (self%dof + 1.0_wp)/(self%dof + 3.0_wp)
         call fit_columns(e, u, weight, before, l, misfit)
      end if
      do j = 1, size(b)
         value = value - log(l(j, j))
      end do
   end subroutine integrate
end module student_errors
