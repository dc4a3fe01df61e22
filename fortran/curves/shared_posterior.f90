!> The moduli of all materials and what their tests share: radius and shape of the tip, compliance of the frame, a factor of each session.
!>
!> ln E of a test = ln E of its material + session + a normal factor of its own, whose sd is inferred, one for references and one for
!> grains. Given these two sds all is normal; the materials are eliminated one by one, as they are independent given what is shared.
!> The sds are summed over a grid. The shape of a single curve says nothing on the shared unknowns here: there a nanometre that the model
!> lacks would outweigh the references.
module shared_posterior
   use elastic_window, only: n_shared, test_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_inverse
   use errors, only: error_type
   implicit none
   private
   public :: material_type, shared_type, infer_shared

   !> A reference or a grain.
   type :: material_type
      character(len=:), allocatable :: name
      logical :: reference = .false.
      !> Of a reference what is known, of others a broad prior: ln of the effective modulus in GPa, and its sd.
      real(wp) :: prior_mean = 0.0_wp, prior_sd = 10.0_wp
      !> Posterior mean of ln E, its sd, and the part of it that no other material shares.
      real(wp) :: ln_modulus = 0.0_wp, sd = 0.0_wp, own_sd = 0.0_wp
      !> Derivatives of ln E by the shared unknowns.
      real(wp), allocatable :: by_shared(:)
   end type material_type

   !> ln R, beta, compliance, then the logarithm of each session's factor.
   type :: shared_type
      real(wp), allocatable :: prior_mean(:), prior_sd(:), mean(:), covariance(:, :)
      !> Relative sds from test to test, of references and of grains.
      real(wp) :: repeat_sd(2) = 0.0_wp
   end type shared_type

   !> Sd of a test's factor: about one per cent, a factor of e for one sd; that of grains and of references agree within a factor 1.6.
   real(wp), parameter :: usual_repeat = 0.01_wp, repeat_spread = 1.0_wp, repeat_ratio = 0.5_wp, least = 0.002_wp, greatest = 0.2_wp
   integer, parameter :: n_grid = 16

contains

   !> Posterior about the present `shared%mean` and `test%ln_modulus`; both move to it.
   subroutine infer_shared(tests, material, session, materials, shared, error)
      type(test_type), intent(inout) :: tests(:)
      !> Of each test, (test).
      integer, intent(in) :: material(:), session(:)
      type(material_type), intent(inout) :: materials(:)
      type(shared_type), intent(inout) :: shared
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: sd(2), density(n_grid, n_grid), share, before(n_shared)
      real(wp), dimension(size(shared%mean)) :: s, total
      real(wp), dimension(size(shared%mean), size(shared%mean)) :: covariance, squares
      real(wp), dimension(size(shared%mean), size(materials)) :: slope, crossed
      real(wp), dimension(size(materials)) :: mean, variance, all_means, all_squares
      integer :: i, j, k, pass

      total = 0.0_wp
      squares = 0.0_wp
      crossed = 0.0_wp
      all_means = 0.0_wp
      all_squares = 0.0_wp
      shared%repeat_sd = 0.0_wp
      do pass = 1, 2
         do j = 1, n_grid
            do i = 1, n_grid
               share = density(i, j)
               if (pass == 2 .and. share < 1.0e-6_wp) cycle
               sd = least*(greatest/least)**(real([i, j] - 1, wp)/(n_grid - 1))
               call solve_given(tests, material, session, materials, shared, sd, density(i, j), s, covariance, mean, slope, &
                  & variance, &
                  & error)
               if (allocated(error)) return
               density(i, j) = density(i, j) - 0.5_wp*(log(sd(1)/usual_repeat)/repeat_spread)**2 &
                  & - 0.5_wp*(log(sd(2)/sd(1))/repeat_ratio)**2
               if (pass == 1) cycle
               density(i, j) = share
               total = total + share*s
               mean = mean + matmul(s, slope)
               all_means = all_means + share*mean
               all_squares = all_squares + share*(mean**2 + variance)
               shared%repeat_sd = shared%repeat_sd + share*sd**2
               do k = 1, size(s)
                  squares(:, k) = squares(:, k) + share*(covariance(:, k) + s*s(k))
               end do
               crossed = crossed + share*(matmul(covariance, slope) + spread(s, 2, size(mean))*spread(mean, 1, size(s)))
               do k = 1, size(mean)
                  all_squares(k) = all_squares(k) + share*sum(slope(:, k)*matmul(covariance, slope(:, k)))
               end do
            end do
         end do
         if (pass == 1) density = exp(density - maxval(density))/sum(exp(density - maxval(density)))
      end do
      shared%repeat_sd = sqrt(shared%repeat_sd)
      before = shared%mean(:n_shared)
      shared%covariance = squares - spread(total, 2, size(s))*spread(total, 1, size(s))
      covariance = shared%covariance
      call cholesky_factor(covariance, error)
      if (allocated(error)) return
      call cholesky_inverse(covariance)
      do k = 1, size(materials)
         associate (m => materials(k))
            m%ln_modulus = m%prior_mean + all_means(k)
            m%sd = sqrt(all_squares(k) - all_means(k)**2)
            m%by_shared = matmul(covariance, crossed(:, k) - total*all_means(k))
            m%own_sd = sqrt(max(1.0e-8_wp, m%sd**2 - sum(m%by_shared*(crossed(:, k) - total*all_means(k)))))
         end associate
      end do
      shared%mean = shared%mean + total
      do i = 1, size(tests)
         tests(i)%ln_modulus = tests(i)%ln_modulus + tests(i)%shift + sum(tests(i)%slope*(shared%mean(:n_shared) - before))
      end do
   end subroutine infer_shared

   !> All given the sds of the tests' factors. The mean of a material is `mean` + `slope` . s, s the change of the shared unknowns.
   subroutine solve_given(tests, material, session, materials, shared, sd, density, s, covariance, mean, slope, variance, error)
      type(test_type), intent(in) :: tests(:)
      integer, intent(in) :: material(:), session(:)
      type(material_type), intent(in) :: materials(:)
      type(shared_type), intent(in) :: shared
      !> Of references and of grains.
      real(wp), intent(in) :: sd(2)
      !> Logarithm of the evidence.
      real(wp), intent(out) :: density, s(:), covariance(:, :)
      !> About the prior mean, (material); (shared, material); (material).
      real(wp), intent(out) :: mean(:), slope(:, :), variance(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: precision, x(size(s)), z, right(size(s))
      integer :: i, k

      density = 0.0_wp
      mean = 0.0_wp
      slope = 0.0_wp
      covariance = 0.0_wp
      do k = 1, size(s)
         covariance(k, k) = 1.0_wp/shared%prior_sd(k)**2
      end do
      right = (shared%prior_mean - shared%mean)/shared%prior_sd**2
      variance = 1.0_wp/materials%prior_sd**2
      do i = 1, size(tests)
         if (.not. tests(i)%used) cycle
         k = material(i)
         precision = 1.0_wp/(tests(i)%variance + sd(merge(1, 2, materials(k)%reference))**2)
         x = 0.0_wp
         x(:n_shared) = -tests(i)%slope
         x(n_shared + session(i)) = 1.0_wp
         z = tests(i)%ln_modulus + tests(i)%shift - materials(k)%prior_mean - shared%mean(n_shared + session(i))
         density = density + 0.5_wp*(log(precision) - precision*z**2)
         mean(k) = mean(k) + precision*z
         slope(:, k) = slope(:, k) - precision*x
         variance(k) = variance(k) + precision
         right = right + precision*z*x
         call add_product(precision, x)
      end do
      do k = 1, size(materials)
         density = density + 0.5_wp*(mean(k)**2/variance(k) - log(variance(k)*materials(k)%prior_sd**2))
         right = right + mean(k)*slope(:, k)/variance(k)
         call add_product(-1.0_wp/variance(k), slope(:, k))
      end do
      call cholesky_factor(covariance, error)
      if (allocated(error)) return
      do k = 1, size(s)
         density = density - log(covariance(k, k))
      end do
      call cholesky_inverse(covariance)
      s = matmul(covariance, right)
      density = density + 0.5_wp*sum(s*right)
      mean = mean/variance
      slope = slope/spread(variance, 1, size(s))
      variance = 1.0_wp/variance

   contains

      subroutine add_product(factor, x)
         real(wp), intent(in) :: factor, x(:)
         integer :: j

         do j = 1, size(x)
            covariance(:, j) = covariance(:, j) + factor*x(j)*x
         end do
      end subroutine add_product
   end subroutine solve_given
end module shared_posterior
