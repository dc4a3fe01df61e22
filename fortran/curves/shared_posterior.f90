!> The moduli of all materials and what their tests share: radius and shape of the tip, compliance
!> of the frame, a factor of each session.
!>
!> ln E of a test = ln E of its material + session + a normal factor of its own, whose sd is
!> inferred, one for references and one for grains. Given these two sds all is normal; the sds are
!> summed over a grid. The shape of a single curve says nothing on the shared unknowns here: there a
!> nanometre that the model lacks would outweigh the references.
module shared_posterior
   use elastic_window, only: n_shared, test_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_inverse
   use errors, only: error_type, warning_type
   use small_matrices, only: solve_lower
   implicit none
   private
   public :: material_type, curves_posterior_type

   !> A reference or a grain.
   type :: material_type
      character(len=:), allocatable :: name
      logical :: reference = .false.
      !> Of a reference what is known, of others a broad prior: ln of the effective modulus in GPa,
      !> and its sd.
      real(wp) :: prior_mean = 0.0_wp, prior_sd = 10.0_wp
      !> Posterior mean of ln E, its sd, and the part of it that no other material shares.
      real(wp) :: ln_modulus = 0.0_wp, sd = 0.0_wp, own_sd = 0.0_wp
      !> Derivatives of ln E by the shared unknowns.
      real(wp), allocatable :: by_shared(:)
   end type material_type

   type :: curves_posterior_type
      type(test_type), allocatable :: tests(:)
      type(material_type), allocatable :: materials(:)
      !> Names.
      type(warning_type), allocatable :: sessions(:)
      !> Shared: ln R, beta, compliance, then the logarithm of each session's factor.
      real(wp), allocatable :: prior_mean(:), prior_sd(:), mean(:), covariance(:, :)
      !> Relative sds from test to test, of references and of grains; and of the drift of each test,
      !> nm/s.
      real(wp) :: repeat_sd(2) = 0.0_wp, drift_prior_sd = 0.0_wp
   contains
      procedure :: infer_shared, grains
   end type curves_posterior_type

   !> Sd of a test's factor: about one per cent, a factor of e for one sd; that of grains and of
   !> references agree within a factor 1.6.
   real(wp), parameter :: usual_repeat = 0.01_wp, repeat_spread = 1.0_wp, repeat_ratio = 0.5_wp, &
      & least = 0.002_wp, greatest = 0.2_wp
   integer, parameter :: n_grid = 16
   !> Points of the grid of a smaller share do not count.
   real(wp), parameter :: negligible = 1.0e-6_wp

contains

   !> The materials that are grains of which a test was used.
   pure function grains(self)
      class(curves_posterior_type), intent(in) :: self
      integer, allocatable :: grains(:)
      integer :: k

      grains = pack([(k, k=1, size(self%materials))], [(.not. self%materials(k)%reference &
         & .and. any(self%tests%material == k .and. self%tests%used), k=1, size(self%materials))])
   end function grains

   !> Posterior about the present `mean` and the moduli of the tests; both move to it.
   subroutine infer_shared(self, error)
      class(curves_posterior_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(self%mean) + size(self%materials)) :: mean, total
      real(wp), dimension(size(mean), size(mean)) :: covariance, squares
      real(wp) :: density(n_grid, n_grid), sd(2), precision(size(self%mean), size(self%mean))
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
               call solve_given(self, sd, pass == 2, density(i, j), mean, covariance, error)
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
   end subroutine infer_shared

   pure function outer(a, b)
      real(wp), intent(in) :: a(:), b(:)
      real(wp) :: outer(size(a), size(b))

      outer = spread(a, 2, size(b))*spread(b, 1, size(a))
   end function outer

   !> All given the sds of the tests' factors: a normal distribution of the change of the shared
   !> unknowns and of ln E of the materials about their prior means.
   subroutine solve_given(self, sd, final, density, mean, covariance, error)
      type(curves_posterior_type), intent(in) :: self
      !> Of references and of grains.
      real(wp), intent(in) :: sd(2)
      !> Then mean and covariance are wanted; else the log of the density of the sds.
      logical, intent(in) :: final
      real(wp), intent(inout) :: density
      real(wp), intent(out) :: mean(:), covariance(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: weight, z, x(n_shared + 2), prior_sd(size(mean)), white(size(mean))
      integer :: i, j, touched(n_shared + 2), n

      n = size(self%mean)
      prior_sd = [self%prior_sd, self%materials%prior_sd]
      covariance = 0.0_wp
      do i = 1, size(mean)
         covariance(i, i) = 1.0_wp/prior_sd(i)**2
      end do
      mean = 0.0_wp
      mean(:n) = (self%prior_mean - self%mean)/self%prior_sd**2
      if (.not. final) then
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
         if (.not. final) density = density + 0.5_wp*(log(weight) - weight*z**2)
         mean(touched) = mean(touched) + weight*z*x
         covariance(touched, touched) = covariance(touched, touched) + weight*outer(x, x)
      end do
      call cholesky_factor(covariance, error)
      if (allocated(error)) return
      if (final) then
         call cholesky_inverse(covariance)
         mean = matmul(covariance, mean)
      else
         white = mean
         call solve_lower(covariance, white)
         density = density + 0.5_wp*sum(white**2) - sum([(log(covariance(i, i)), i=1, size(mean))])
      end if
   end subroutine solve_given
end module shared_posterior
