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

   !> All given the sds of the tests' factors: log evidence; change of the shared unknowns, and its covariance; of the materials about
   !> their prior means the mean, its derivatives by the shared unknowns, (shared, material), and the variance given these.
   type :: conditional_type
      real(wp) :: density = 0.0_wp
      real(wp), allocatable :: s(:), covariance(:, :), mean(:), slope(:, :), variance(:)
   end type conditional_type

   !> Sd of a test's factor: about one per cent, a factor of e for one sd; that of grains and of references agree within a factor 1.6.
   real(wp), parameter :: usual_repeat = 0.01_wp, repeat_spread = 1.0_wp, repeat_ratio = 0.5_wp, least = 0.002_wp, greatest = 0.2_wp
   integer, parameter :: n_grid = 16

contains

   !> Posterior about the present `shared%mean` and `test%ln_modulus`; both move to it.
   subroutine infer_shared(tests, materials, shared, error)
      type(test_type), intent(inout) :: tests(:)
      type(material_type), intent(inout) :: materials(:)
      type(shared_type), intent(inout) :: shared
      type(error_type), allocatable, intent(out) :: error
      type(conditional_type) :: given
      real(wp) :: sd(2), density(n_grid, n_grid), before(n_shared), total(size(shared%mean))
      real(wp), dimension(size(shared%mean), size(shared%mean)) :: squares, precision
      real(wp), dimension(size(shared%mean), size(materials)) :: crossed
      real(wp), dimension(size(materials)) :: mean, all_means, all_squares
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
               if (pass == 2 .and. density(i, j) < 1.0e-6_wp) cycle
               sd = least*(greatest/least)**(real([i, j] - 1, wp)/(n_grid - 1))
               call solve_given(tests, materials, shared, sd, given, error)
               if (allocated(error)) return
               if (pass == 1) then
                  density(i, j) = given%density - 0.5_wp*(log(sd(1)/usual_repeat)/repeat_spread)**2 &
                     & - 0.5_wp*(log(sd(2)/sd(1))/repeat_ratio)**2
                  cycle
               end if
               associate (share => density(i, j), s => given%s)
                  mean = given%mean + matmul(s, given%slope)
                  total = total + share*s
                  squares = squares + share*(given%covariance + outer(s, s))
                  crossed = crossed + share*(matmul(given%covariance, given%slope) + outer(s, mean))
                  all_means = all_means + share*mean
                  all_squares = all_squares + share*(mean**2 + given%variance &
                     & + sum(given%slope*matmul(given%covariance, given%slope), 1))
                  shared%repeat_sd = shared%repeat_sd + share*sd**2
               end associate
            end do
         end do
         if (pass == 1) density = exp(density - maxval(density))/sum(exp(density - maxval(density)))
      end do
      shared%repeat_sd = sqrt(shared%repeat_sd)
      shared%covariance = squares - outer(total, total)
      crossed = crossed - outer(total, all_means)
      precision = shared%covariance
      call cholesky_factor(precision, error)
      if (allocated(error)) return
      call cholesky_inverse(precision)
      do k = 1, size(materials)
         associate (m => materials(k))
            m%ln_modulus = m%prior_mean + all_means(k)
            m%sd = sqrt(all_squares(k) - all_means(k)**2)
            m%by_shared = matmul(precision, crossed(:, k))
            m%own_sd = sqrt(max(1.0e-8_wp, m%sd**2 - sum(m%by_shared*crossed(:, k))))
         end associate
      end do
      before = shared%mean(:n_shared)
      shared%mean = shared%mean + total
      do i = 1, size(tests)
         tests(i)%ln_modulus = tests(i)%ln_modulus + tests(i)%shift + sum(tests(i)%slope*(shared%mean(:n_shared) - before))
      end do
   end subroutine infer_shared

   pure function outer(a, b)
      real(wp), intent(in) :: a(:), b(:)
      real(wp) :: outer(size(a), size(b))

      outer = spread(a, 2, size(b))*spread(b, 1, size(a))
   end function outer

   !> All given the sds of the tests' factors.
   subroutine solve_given(tests, materials, shared, sd, given, error)
      type(test_type), intent(in) :: tests(:)
      type(material_type), intent(in) :: materials(:)
      type(shared_type), intent(in) :: shared
      !> Of references and of grains.
      real(wp), intent(in) :: sd(2)
      type(conditional_type), intent(out) :: given
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: precision, z
      real(wp), dimension(size(shared%mean)) :: x, right
      integer :: i, k, n

      n = size(x)
      allocate (given%covariance(n, n), given%slope(n, size(materials)), given%mean(size(materials)), source=0.0_wp)
      do k = 1, n
         given%covariance(k, k) = 1.0_wp/shared%prior_sd(k)**2
      end do
      right = (shared%prior_mean - shared%mean)/shared%prior_sd**2
      given%variance = 1.0_wp/materials%prior_sd**2
      do i = 1, size(tests)
         if (.not. tests(i)%used) cycle
         associate (k => tests(i)%material, session => n_shared + tests(i)%session)
            precision = 1.0_wp/(tests(i)%variance + sd(merge(1, 2, materials(k)%reference))**2)
            x = 0.0_wp
            x(:n_shared) = -tests(i)%slope
            x(session) = 1.0_wp
            z = tests(i)%ln_modulus + tests(i)%shift - materials(k)%prior_mean - shared%mean(session)
            given%mean(k) = given%mean(k) + precision*z
            given%slope(:, k) = given%slope(:, k) - precision*x
            given%variance(k) = given%variance(k) + precision
         end associate
         given%density = given%density + 0.5_wp*(log(precision) - precision*z**2)
         right = right + precision*z*x
         given%covariance = given%covariance + precision*outer(x, x)
      end do
      do k = 1, size(materials)
         associate (mean => given%mean(k), slope => given%slope(:, k), variance => given%variance(k))
            given%density = given%density + 0.5_wp*(mean**2/variance - log(variance*materials(k)%prior_sd**2))
            right = right + mean*slope/variance
            given%covariance = given%covariance - outer(slope, slope)/variance
            mean = mean/variance
            slope = slope/variance
            variance = 1.0_wp/variance
         end associate
      end do
      call cholesky_factor(given%covariance, error)
      if (allocated(error)) return
      do k = 1, n
         given%density = given%density - log(given%covariance(k, k))
      end do
      call cholesky_inverse(given%covariance)
      given%s = matmul(given%covariance, right)
      given%density = given%density + 0.5_wp*sum(given%s*right)
   end subroutine solve_given
end module shared_posterior
