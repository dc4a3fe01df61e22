!> The contact ellipse of many grains at once, from harmonics of their surface compliance.
!>
!> 1/M = min over the ellipse's shape (a, b) of the integral of h(theta)/sqrt(1 + a cos 2 theta + b sin 2 theta) over half a turn
!> (Willis, J. Mech. Phys. Solids 14, 163, 1966): Newton's method from the minimum for a small anisotropy.
module contact_ellipse
   use kinds, only: pi, wp
   implicit none
   private
   public :: minimise_compliance, highest_mode, most_modes

   !> Coefficients of h(theta) = m1 + m2 cos 2 theta + m3 sin 2 theta + .. + m9 sin 8 theta.
   integer, parameter :: highest_mode = 4, most_modes = 1 + 2*highest_mode

contains

   !> Moduli of n grains from the modes of h, GPa.
   pure subroutine minimise_compliance(n, n_modes, modes, moduli)
      !> Grains, and modes of each, odd.
      integer, intent(in) :: n, n_modes
      !> 1/GPa.
      real(wp), intent(in) :: modes(n, n_modes)
      real(wp), intent(out) :: moduli(n)
      integer, parameter :: most_steps = 8
      !> A step leaves an error of the order of its square, and the modulus is stationary: an error of its fourth power.
      real(wp), parameter :: largest = 0.95_wp, smallest = 1.0e-2_wp
      !> Up to this squared size of a shape the series in it is used.
      real(wp), parameter :: oval = 0.1_wp
      !> The mean, then its derivatives a, b, aa, ab, bb.
      real(wp) :: means(n, 6)
      real(wp), dimension(n) :: a, b, determinant, shrink, da, db
      integer :: step

      ! The quadratic expansion about a circle: h0 (1 + 3/16 e^2) - (a h1 + b h2)/4.
      a = 2.0_wp/3.0_wp*modes(:, 2)/modes(:, 1)
      b = 2.0_wp/3.0_wp*modes(:, 3)/modes(:, 1)
      do step = 1, most_steps
         if (all(a**2 + b**2 <= oval)) then
            call expand_means(n, n_modes, modes, a, b, means)
         else
            call sum_means(n, n_modes, modes, a, b, means)
         end if
         determinant = means(:, 4)*means(:, 6) - means(:, 5)**2
         da = (means(:, 5)*means(:, 3) - means(:, 6)*means(:, 2))/determinant
         db = (means(:, 5)*means(:, 2) - means(:, 4)*means(:, 3))/determinant
         a = a + da
         b = b + db
         shrink = min(1.0_wp, largest/sqrt(max(a**2 + b**2, tiny(1.0_wp))))
         a = a*shrink
         b = b*shrink
         if (all(da**2 + db**2 <= smallest**2)) exit
      end do
      ! Along the last step the mean is a parabola.
      moduli = 1.0_wp/(pi*(means(:, 1) + 0.5_wp*(means(:, 2)*da + means(:, 3)*db)))
   end subroutine minimise_compliance

   !> Sums over angles.
   pure subroutine sum_means(n, n_modes, modes, a, b, means)
      integer, intent(in) :: n, n_modes
      real(wp), intent(in) :: modes(n, n_modes), a(n), b(n)
      real(wp), intent(out) :: means(n, 6)
      integer, parameter :: n_angles = 24
      integer :: k
      real(wp), parameter :: cosine(n_angles) = [(cos(2.0_wp*pi*k/n_angles), k=0, n_angles - 1)]
      real(wp), parameter :: sine(n_angles) = [(sin(2.0_wp*pi*k/n_angles), k=0, n_angles - 1)]
      real(wp) :: h(n), r, w
      integer :: j, m

      means = 0.0_wp
      do k = 1, n_angles
         h = modes(:, 1)
         do m = 1, n_modes/2
            h = h + modes(:, 2*m)*cosine(1 + mod(m*(k - 1), n_angles)) + modes(:, 2*m + 1)*sine(1 + mod(m*(k - 1), n_angles))
         end do
         !$omp simd private(r, w)
         do j = 1, n
            r = 1.0_wp/(1.0_wp + a(j)*cosine(k) + b(j)*sine(k))
            w = h(j)*sqrt(r)/n_angles
            means(j, 1) = means(j, 1) + w
            w = 0.5_wp*w*r
            means(j, 2) = means(j, 2) - w*cosine(k)
            means(j, 3) = means(j, 3) - w*sine(k)
            w = 1.5_wp*w*r
            means(j, 4) = means(j, 4) + w*cosine(k)**2
            means(j, 5) = means(j, 5) + w*cosine(k)*sine(k)
            means(j, 6) = means(j, 6) + w*sine(k)**2
         end do
      end do
   end subroutine sum_means

   !> Series in s = a^2 + b^2: with z = a + i b and the harmonic p cos 2 m theta + q sin 2 m theta of h the mean is the sum over m of
   !> d_m(s) Re((p - i q) z^m), and d_m follows from the binomial series of the root.
   pure subroutine expand_means(n, n_modes, modes, a, b, means)
      integer, intent(in) :: n, n_modes
      real(wp), intent(in) :: modes(n, n_modes), a(n), b(n)
      real(wp), intent(out) :: means(n, 6)
      !> Powers of s: the next one is below 1e-8 of the mean at s = 0.1.
      integer, parameter :: last = 6
      integer :: k, m
      !> Of s^k in d_m: (-1)^m (2 j)!/(8^j j! k! (m + k)!), j = m + 2 k.
      real(wp), parameter :: series(0:last, 0:highest_mode) = reshape([(((-1)**m*gamma(2.0_wp*m + 4.0_wp*k + 1.0_wp) &
         & /(8.0_wp**(m + 2*k)*gamma(m + 2.0_wp*k + 1.0_wp)*gamma(k + 1.0_wp)*gamma(m + k + 1.0_wp)), k=0, last), &
         & m=0, highest_mode)], [last + 1, highest_mode + 1])
      !> Real and imaginary part of z^m and of the two powers before; and the sums with the first derivative of d_m, with its
      !> derivatives a and b, and with the second derivative.
      real(wp) :: power(n, 2), before(n, 2), earlier(n, 2), first(n, 3), second(n)
      real(wp) :: s, d, d1, d2, l, p, q
      integer :: j

      means = 0.0_wp
      first = 0.0_wp
      second = 0.0_wp
      before = 0.0_wp
      earlier = 0.0_wp
      power(:, 1) = 1.0_wp
      power(:, 2) = 0.0_wp
      do m = 0, n_modes/2
         !$omp simd private(s, d, d1, d2, l, p, q)
         do j = 1, n
            ! Of the mean, m = 0, there is no q: what stands for it is multiplied by zero.
            p = modes(j, max(1, 2*m))
            q = modes(j, 2*m + 1)
            s = a(j)**2 + b(j)**2
            d2 = 0.0_wp
            d1 = 0.0_wp
            d = series(last, m)
            do k = last - 1, 0, -1
               d2 = d2*s + d1
               d1 = d1*s + d
               d = d*s + series(k, m)
            end do
            l = p*power(j, 1) + q*power(j, 2)
            means(j, 1) = means(j, 1) + d*l
            first(j, 1) = first(j, 1) + d1*l
            second(j) = second(j) + 2.0_wp*d2*l
            l = m*(p*before(j, 1) + q*before(j, 2))
            means(j, 2) = means(j, 2) + d*l
            first(j, 2) = first(j, 2) + d1*l
            l = m*(q*before(j, 1) - p*before(j, 2))
            means(j, 3) = means(j, 3) + d*l
            first(j, 3) = first(j, 3) + d1*l
            d = m*(m - 1)*d
            means(j, 4) = means(j, 4) + d*(p*earlier(j, 1) + q*earlier(j, 2))
            means(j, 5) = means(j, 5) + d*(q*earlier(j, 1) - p*earlier(j, 2))
         end do
         earlier = before
         before = power
         power(:, 1) = a*before(:, 1) - b*before(:, 2)
         power(:, 2) = b*before(:, 1) + a*before(:, 2)
      end do
      means(:, 2) = means(:, 2) + 2.0_wp*a*first(:, 1)
      means(:, 3) = means(:, 3) + 2.0_wp*b*first(:, 1)
      means(:, 6) = -means(:, 4) + 4.0_wp*b*first(:, 3) + 2.0_wp*first(:, 1) + 4.0_wp*b**2*second
      means(:, 4) = means(:, 4) + 4.0_wp*a*first(:, 2) + 2.0_wp*first(:, 1) + 4.0_wp*a**2*second
      means(:, 5) = means(:, 5) + 2.0_wp*(b*first(:, 2) + a*first(:, 3)) + 4.0_wp*a*b*second
   end subroutine expand_means
end module contact_ellipse
