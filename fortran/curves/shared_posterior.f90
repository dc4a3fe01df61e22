!> The moduli of all materials and the unknowns that their tests share: radius and shape of the tip,
!> compliance of the frame, a factor of each session.
!>
!> ln E of a test is the sum of ln E of its material, the logarithm of the session's factor, and a
!> normal deviation of the test. The standard deviation of these deviations is inferred, separately
!> for references and for grains. Given the two standard deviations the model is normal. The
!> posterior is its mean over a grid of them. The shape of a single curve does not inform the shared
!> unknowns, because there a model error of a nanometre would outweigh the references.
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

   !> Priors of the standard deviations from test to test: that of references is log-normal about
   !> `usual_repeat`, and the ratio of that of grains to it is log-normal about 1. The widths are
   !> those of the logarithms: a factor of 2.7 and of 1.6.
   real(wp), parameter :: usual_repeat = 0.01_wp, repeat_width = 1.0_wp, ratio_width = 0.5_wp
   !> Bounds of the grid of standard deviations, and number of its values, in equal ratios.
   real(wp), parameter :: least = 0.002_wp, greatest = 0.2_wp
   integer, parameter :: n_grid = 16
   !> Points of the grid with a smaller share of the probability are neglected.
   real(wp), parameter :: negligible = 1.0e-6_wp

contains

   !> Numbers of the materials that are grains with a test in use.
   pure function grains(self)
      class(curves_posterior_type), intent(in) :: self
      integer, allocatable :: grains(:)
      integer :: k

      grains = pack([(k, k=1, size(self%materials))], .not. self%materials%reference .and. &
         & [(any(self%tests%material == k .and. self%tests%used), k=1, size(self%materials))])
   end function grains

   !> Compute the posterior, linearised about the present `mean` and the moduli of the tests; both
   !> move to the new posterior mean.
   subroutine infer_shared(self, error)
      class(curves_posterior_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(self%mean) + size(self%materials)) :: mean, total
      real(wp), dimension(size(self%mean) + size(self%materials), &
         & size(self%mean) + size(self%materials)) :: covariance, squares
      !> Standard deviations from test to test, of references and of grains.
      real(wp) :: sd(2)
      !> Log density and probability of each point of the grid.
      real(wp), dimension(n_grid, n_grid) :: log_density, probability
      real(wp) :: precision(size(self%mean), size(self%mean))
      integer :: i, j, k, n, pass

      n = size(self%mean)
      total = 0.0_wp
      squares = 0.0_wp
      self%repeat_sd = 0.0_wp
      ! The first pass computes the log densities of all points.
      probability = 1.0_wp
      do pass = 1, 2
         do j = 1, n_grid
            do i = 1, n_grid
               if (probability(i, j) < negligible) cycle
               sd = least*(greatest/least)**(real([i, j] - 1, wp)/(n_grid - 1))
               call solve_given(log_density(i, j))
               if (allocated(error)) return
               if (pass == 1) cycle
               total = total + probability(i, j)*mean
               squares = squares + probability(i, j)*(covariance + outer(mean, mean))
               self%repeat_sd = self%repeat_sd + probability(i, j)*sd**2
            end do
         end do
         if (pass == 2) exit
         probability = exp(log_density - maxval(log_density))
         probability = probability/sum(probability)
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
            ! At least 0.01 %, in spite of rounding errors.
            m%own_sd = sqrt(max(1.0e-8_wp, own(n + k) - sum(m%by_shared*own(:n))))
         end associate
      end do
      self%mean = self%mean + total(:n)
      ! The moduli of the tests follow the shared unknowns.
      do i = 1, size(self%tests)
         self%tests(i)%ln_modulus = self%tests(i)%ln_modulus + self%tests(i)%shift &
            & + sum(self%tests(i)%slope*total(:n_shared))
      end do

   contains

      !> Solve the model for given standard deviations of the tests' deviations: a normal
      !> distribution of the change of the shared unknowns and of ln E of the materials relative to
      !> their prior means.
      subroutine solve_given(density)
         !> Log density of the standard deviations, which the first pass computes. The second pass
         !> computes mean and covariance.
         real(wp), intent(inout) :: density
         real(wp) :: weight, z, x(n_shared + 2), prior_sd(size(mean)), rhs(size(mean))
         !> Numbers of the unknowns that a test informs.
         integer :: informed(n_shared + 2)
         integer :: i, j

         ! `covariance` is the precision, and `mean` the precision times the mean, until both are
         ! solved for.
         prior_sd = [self%prior_sd, self%materials%prior_sd]
         covariance = 0.0_wp
         do i = 1, size(mean)
            covariance(i, i) = 1.0_wp/prior_sd(i)**2
         end do
         mean = 0.0_wp
         mean(:n) = (self%prior_mean - self%mean)/self%prior_sd**2
         if (pass == 1) then
            density = -0.5_wp*((log(sd(1)/usual_repeat)/repeat_width)**2 &
               & + (log(sd(2)/sd(1))/ratio_width)**2)
         end if
         do i = 1, size(self%tests)
            associate (t => self%tests(i), m => self%materials(self%tests(i)%material))
               if (.not. t%used) cycle
               ! The test measures z = x.u, where u is the change of the shared unknowns, of the
               ! logarithm of the session's factor, and of ln E.
               weight = 1.0_wp/(t%variance + sd(merge(1, 2, m%reference))**2)
               informed = [(j, j=1, n_shared), n_shared + t%session, n + t%material]
               x = [-t%slope, 1.0_wp, 1.0_wp]
               z = t%ln_modulus + t%shift - m%prior_mean - self%mean(n_shared + t%session)
            end associate
            if (pass == 1) density = density + 0.5_wp*(log(weight) - weight*z**2)
            mean(informed) = mean(informed) + weight*z*x
            covariance(informed, informed) = covariance(informed, informed) + weight*outer(x, x)
         end do
         call cholesky_factor(covariance, error)
         if (allocated(error)) return
         rhs = mean
         if (pass == 2) then
            call cholesky_inverse(covariance)
            mean = matmul(covariance, rhs)
         else
            call solve_lower(covariance, rhs)
            density = density + 0.5_wp*sum(rhs**2) &
               & - sum([(log(covariance(i, i)), i=1, size(mean))])
         end if
      end subroutine solve_given
   end subroutine infer_shared

   !> The outer product of two vectors.
   pure function outer(a, b)
      real(wp), intent(in) :: a(:), b(:)
      real(wp) :: outer(size(a), size(b))

      outer = spread(a, 2, size(b))*spread(b, 1, size(a))
   end function outer

end module shared_posterior
