!> The contact ellipse of many grains at once, from harmonics of their surface compliance.
!>
!> 1/M = min over the ellipse's shape (a, b) of the integral of h(theta)/sqrt(1 + a cos 2 theta + b
!> sin 2 theta) over half a turn (Willis, J. Mech. Phys. Solids 14, 163, 1966). The minimum is found
!> by Newton's method from that for a small anisotropy.
module contact_ellipse
   use kinds, only: pi, wp
   implicit none
   private
   public :: minimise_compliance, highest_mode

   !> Greatest m of the harmonics 2 m of theta, and number of coefficients of h(theta) = m1 + m2 cos
   !> 2 theta + m3 sin 2 theta + .. + m9 sin 8 theta.
   integer, parameter :: highest_mode = 4, most_modes = 1 + 2*highest_mode

contains

   !> Moduli of n grains from the modes of h, GPa.
   pure subroutine minimise_compliance(n, n_modes, modes, moduli)
      !> Number of grains, and of modes of each, odd.
      integer, intent(in) :: n, n_modes
      !> 1/GPa.
      real(wp), intent(in) :: modes(n, n_modes)
      real(wp), intent(out) :: moduli(n)
      integer, parameter :: most_steps = 8
      !> Largest eccentricity and last step. A step d leaves an error of the order d^2 of the shape.
      !> The modulus is stationary there, and its error is of the order d^4.
      real(wp), parameter :: largest_shape = 0.95_wp, last_step = 1.0e-2_wp
      !> The mean compliance, then its derivatives a, b, aa, ab, bb.
      real(wp) :: means(n, 6)
      real(wp), dimension(n) :: a, b, determinant, shrink, da, db
      integer :: step

      ! Start from the quadratic expansion about a circle: h0 (1 + 3/16 e^2) - (a h1 + b h2)/4.
      a = 2.0_wp/3.0_wp*modes(:, 2)/modes(:, 1)
      b = 2.0_wp/3.0_wp*modes(:, 3)/modes(:, 1)
      do step = 1, most_steps
         shrink = min(1.0_wp, largest_shape/sqrt(max(a**2 + b**2, tiny(1.0_wp))))
         a = a*shrink
         b = b*shrink
         call expand_means(n, n_modes, modes, a, b, means)
         determinant = means(:, 4)*means(:, 6) - means(:, 5)**2
         da = (means(:, 5)*means(:, 3) - means(:, 6)*means(:, 2))/determinant
         db = (means(:, 5)*means(:, 2) - means(:, 4)*means(:, 3))/determinant
         a = a + da
         b = b + db
         if (all(da**2 + db**2 <= last_step**2)) exit
      end do
      ! The mean is a parabola along the last step.
      moduli = 1.0_wp/(pi*(means(:, 1) + 0.5_wp*(means(:, 2)*da + means(:, 3)*db)))
   end subroutine minimise_compliance

   !> Expand the means in powers of s = a^2 + b^2: with z = a + i b and the harmonic p cos 2 m theta
   !> + q sin 2 m theta of h the mean is the sum over m of d_m(s) Re((p - i q) z^m), where d_m
   !> follows from the binomial series of the root.
   pure subroutine expand_means(n, n_modes, modes, a, b, means)
      integer, intent(in) :: n, n_modes
      real(wp), intent(in) :: modes(n, n_modes), a(n), b(n)
      real(wp), intent(out) :: means(n, 6)
      !> Logarithm of the relative size of the first power of s that is left out.
      real(wp), parameter :: log_precision = -16.0_wp
      integer, parameter :: last = 160
      integer :: j, k, m, terms
      !> Coefficients of s^k in d_m: (-1)^m (2 j)!/(8^j j! k! (m + k)!), j = m + 2 k; before them
      !> the logarithms of (2 j)!/(8^j j!).
      real(wp), parameter :: log_j(0:*) = [(log_gamma(2.0_wp*j + 1.0_wp) - j*log(8.0_wp) &
         & - log_gamma(j + 1.0_wp), j=0, highest_mode + 2*last)]
      real(wp), parameter :: series(0:*, 0:*) = reshape([(((-1)**m*exp(log_j(m + 2*k) &
         & - log_gamma(k + 1.0_wp) - log_gamma(m + k + 1.0_wp)), k=0, last), m=0, highest_mode)], &
         & [last + 1, highest_mode + 1])
      !> Real and imaginary part of z^m and of the two powers before it; and the sums with the first
      !> derivative of d_m, with its derivatives a and b, and with the second derivative.
      real(wp) :: power(n, 2), before(n, 2), earlier(n, 2), first(n, 4)
      real(wp) :: s(n), d(n), d1(n), d2(n), l, p, q, f

      means = 0.0_wp
      first = 0.0_wp
      before = 0.0_wp
      earlier = 0.0_wp
      power(:, 1) = 1.0_wp
      power(:, 2) = 0.0_wp
      s = a**2 + b**2
      terms = min(last, max(2, ceiling(log_precision/log(max(tiny(1.0_wp), maxval(s))))))
      do m = 0, n_modes/2
         d2 = 0.0_wp
         d1 = 0.0_wp
         d = series(terms, m)
         do k = terms - 1, 0, -1
            d2 = d2*s + d1
            d1 = d1*s + d
            d = d*s + series(k, m)
         end do
         !$omp simd private(l, p, q, f)
         do j = 1, n
            ! The mean, m = 0, has no q: the value in its place is multiplied by zero.
            p = modes(j, max(1, 2*m))
            q = modes(j, 2*m + 1)
            l = p*power(j, 1) + q*power(j, 2)
            means(j, 1) = means(j, 1) + d(j)*l
            first(j, 1) = first(j, 1) + d1(j)*l
            first(j, 4) = first(j, 4) + 2.0_wp*d2(j)*l
            l = m*(p*before(j, 1) + q*before(j, 2))
            means(j, 2) = means(j, 2) + d(j)*l
            first(j, 2) = first(j, 2) + d1(j)*l
            l = m*(q*before(j, 1) - p*before(j, 2))
            means(j, 3) = means(j, 3) + d(j)*l
            first(j, 3) = first(j, 3) + d1(j)*l
            f = m*(m - 1)*d(j)
            means(j, 4) = means(j, 4) + f*(p*earlier(j, 1) + q*earlier(j, 2))
            means(j, 5) = means(j, 5) + f*(q*earlier(j, 1) - p*earlier(j, 2))
         end do
         earlier = before
         before = power
         power(:, 1) = a*before(:, 1) - b*before(:, 2)
         power(:, 2) = b*before(:, 1) + a*before(:, 2)
      end do
      means(:, 2) = means(:, 2) + 2.0_wp*a*first(:, 1)
      means(:, 3) = means(:, 3) + 2.0_wp*b*first(:, 1)
      means(:, 6) = -means(:, 4) + 4.0_wp*b*first(:, 3) + 2.0_wp*first(:, 1) &
         & + 4.0_wp*b**2*first(:, 4)
      means(:, 4) = means(:, 4) + 4.0_wp*a*first(:, 2) + 2.0_wp*first(:, 1) &
         & + 4.0_wp*a**2*first(:, 4)
      means(:, 5) = means(:, 5) + 2.0_wp*(b*first(:, 2) + a*first(:, 3)) + 4.0_wp*a*b*first(:, 4)
   end subroutine expand_means
end module contact_ellipse
