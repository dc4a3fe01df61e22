!> The moduli of all materials and the unknowns that their tests share: radius and shape of the tip,
!> compliance of the frame, a factor of each session.
!>
!> ln E of a test is the sum of ln E of its material, the logarithm of the session's factor, and a
!> normal deviation of the test. The standard deviation of the latter is inferred, separately for
!> references and for grains. Given these two standard deviations the model is normal; a grid sums
!> over them. The shape of a single curve does not inform the shared unknowns, because there a model
!> error of a nanometre would outweigh the references.
module shared_posterior
   use elastic_window, only: n_shared, test_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_inverse
   use errors, only: error_type
   use small_matrices, only: solve_lower
   use text, only: line_type
   implicit none
   private
   public :: material_type, curves_posterior_type

   !> A reference or a grain.
   type :: material_type
      character(len=:), allocatable :: name
      logical :: reference = .false.
      !> Prior of ln of the effective modulus in GPa: mean and standard deviation. It is known for a
      !> reference and broad for a grain.
      real(wp) :: prior_mean = 0.0_wp, prior_sd = 10.0_wp
      !> Posterior mean of ln E, its standard deviation, and the part of the latter that no other
      !> material shares.
      real(wp) :: ln_modulus = 0.0_wp, sd = 0.0_wp, own_sd = 0.0_wp
      !> Derivatives of ln E with respect to the shared unknowns.
      real(wp), allocatable :: by_shared(:)
   end type material_type

   type :: curves_posterior_type
      type(test_type), allocatable :: tests(:)
      type(material_type), allocatable :: materials(:)
      !> Names of the sessions.
      type(line_type), allocatable :: sessions(:)
      !> Shared unknowns: ln R, beta, compliance, then the logarithm of each session's factor.
      real(wp), allocatable :: prior_mean(:), prior_sd(:), mean(:), covariance(:, :)
      !> Relative standard deviations from test to test, of references and of grains; prior standard
      !> deviation of the drift of each test, nm/s.
      real(wp) :: repeat_sd(2) = 0.0_wp, drift_prior_sd = 0.0_wp
   contains
      procedure :: infer_shared, grains
   end type curves_posterior_type

   !> Prior of the standard deviation from test to test: log-normal about one per cent, with a
   !> factor of e for one standard deviation; the values of grains and references agree within a
   !> factor of 1.6. Bounds of the grid.
   real(wp), parameter :: usual_repeat = 0.01_wp, repeat_spread = 1.0_wp, repeat_ratio = 0.5_wp, &
      & least = 0.002_wp, greatest = 0.2_wp
   integer, parameter :: n_grid = 16
   !> Points of the grid with a smaller share of the probability are neglected.
   real(wp), parameter :: negligible = 1.0e-6_wp

contains

   !> Numbers of the grains that have a test in use.
   pure function grains(self)
      class(curves_posterior_type), intent(in) :: self
      integer, allocatable :: grains(:)
      integer :: k

      grains = pack([(k, k=1, size(self%materials))], [(.not. self%materials(k)%reference &
         & .and. any(self%tests%material == k .and. self%tests%used), k=1, size(self%materials))])
   end function grains

   !> Compute the posterior, linearised about the present `mean` and the moduli of the tests; both
   !> move to the new posterior mean.
   subroutine infer_shared(self, error)
      class(curves_posterior_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(self%mean) + size(self%materials)) :: mean, total
      real(wp), dimension(size(self%mean) + size(self%materials), &
         & size(self%mean) + size(self%materials)) :: covariance, squares
      !> Standard deviation of references and of grains.
      real(wp) :: sd(2)
      real(wp) :: density(n_grid, n_grid), precision(size(self%mean), size(self%mean))
      integer :: i, j, k, n, pass

      n = size(self%mean)
      total = 0.0_wp
      squares = 0.0_wp
      self%repeat_sd = 0.0_wp
      density = 1.0_wp
      do pass = 1, 2
         do j = 1, n_grid
            do i = 1, n_grid
               if (density(i, j) < negligible) cycle
               sd = least*(greatest/least)**(real([i, j] - 1, wp)/(n_grid - 1))
               call solve_given(density(i, j))
               if (allocated(error)) return
               if (pass == 1) cycle
               total = total + density(i, j)*mean
               squares = squares + density(i, j)*(covariance + outer(mean, mean))
               self%repeat_sd = self%repeat_sd + density(i, j)*sd**2
            end do
         end do
         if (pass == 1) density = exp(density - maxval(density))/sum(exp(density - maxval(density)))
      end do
      self%repeat_sd = sqrt(self%repeat_sd)
      squares = squares - outer(total, total)
      self%covariance = squares(:n, :n)
      precision = self%covariance
      call cholesky_factor(precision, error)
      if (allocated(error)) return
      call cholesky_inverse(precision)
      do k = 1, size(self%materials)
         associate (m => self%materials(k), own => squares(:, n + k))
            m%ln_modulus = m%prior_mean + total(n + k)
            m%sd = sqrt(own(n + k))
            m%by_shared = matmul(precision, own(:n))
            m%own_sd = sqrt(max(1.0e-8_wp, own(n + k) - sum(m%by_shared*own(:n))))
         end associate
      end do
      self%mean = self%mean + total(:n)
      do i = 1, size(self%tests)
         self%tests(i)%ln_modulus = self%tests(i)%ln_modulus + self%tests(i)%shift &
            & + sum(self%tests(i)%slope*total(:n_shared))
      end do

   contains

      !> Solve the model for given standard deviations of the tests' deviations: a normal
      !> distribution of the change of the shared unknowns and of ln E of the materials relative to
      !> their prior means.
      subroutine solve_given(density)
         !> Log density of the standard deviations, computed in the first pass. Mean and covariance
         !> are computed in the second one.
         real(wp), intent(inout) :: density
         real(wp) :: weight, z, x(n_shared + 2), prior_sd(size(mean)), white(size(mean))
         integer :: i, j, touched(n_shared + 2)

         prior_sd = [self%prior_sd, self%materials%prior_sd]
         covariance = 0.0_wp
         do i = 1, size(mean)
            covariance(i, i) = 1.0_wp/prior_sd(i)**2
         end do
         mean = 0.0_wp
         mean(:n) = (self%prior_mean - self%mean)/self%prior_sd**2
         if (pass == 1) then
            density = -0.5_wp*((log(sd(1)/usual_repeat)/repeat_spread)**2 &
               & + (log(sd(2)/sd(1))/repeat_ratio)**2)
         end if
         do i = 1, size(self%tests)
            associate (t => self%tests(i), m => self%materials(self%tests(i)%material))
               if (.not. t%used) cycle
               weight = 1.0_wp/(t%variance + sd(merge(1, 2, m%reference))**2)
               touched = [(j, j=1, n_shared), n_shared + t%session, n + t%material]
               x = [-t%slope, 1.0_wp, 1.0_wp]
               z = t%ln_modulus + t%shift - m%prior_mean - self%mean(n_shared + t%session)
            end associate
            if (pass == 1) density = density + 0.5_wp*(log(weight) - weight*z**2)
            mean(touched) = mean(touched) + weight*z*x
            covariance(touched, touched) = covariance(touched, touched) + weight*outer(x, x)
         end do
         call cholesky_factor(covariance, error)
         if (allocated(error)) return
         white = mean
         if (pass == 2) then
            call cholesky_inverse(covariance)
            mean = matmul(covariance, white)
         else
            call solve_lower(covariance, white)
            density = density + 0.5_wp*sum(white**2) &
               & - sum([(log(covariance(i, i)), i=1, size(mean))])
         end if
      end subroutine solve_given
   end subroutine infer_shared

   pure function outer(a, b)
      real(wp), intent(in) :: a(:), b(:)
      real(wp) :: outer(size(a), size(b))

      outer = spread(a, 2, size(b))*spread(b, 1, size(a))
   end function outer

end module shared_posterior
