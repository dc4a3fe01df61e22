!> Exact indentation modulus of an anisotropic half-space under a frictionless rigid sphere.
!>
!> The surface Green's function is that of Barnett & Lothe; the contact ellipse minimises the
!> compliance (Willis, J. Mech. Phys. Solids 14, 163, 1966). With a circle instead of the ellipse
!> the modulus is that of Vlassak & Nix (J. Mech. Phys. Solids 42, 1223, 1994), which is never
!> larger.
!>
!> The Barnett-Lothe tensor L is inverted for several directions of a crystal at once. B of the
!> half-space theory is L/(4 pi). -L is the lower left block of the mean, over the turn of m and n
!> about t, of Stroh's matrix N = [A, D; E, A^T] with A = -(nn)^-1 (nm), D = (nn)^-1, E =
!> (mn)(nn)^-1 (nm) - (mm) (Barnett & Lothe, Phys. Norvegica 7, 13, 1973). A turn by phi maps N as
!> it maps the cotangent of an angle: N(phi) = (N cos phi - sin phi)(cos phi + N sin phi)^-1. So the
!> trapezoid rule F over n equally spaced angles of half a turn obeys F_2n = (F_n - F_n^-1)/2, the
!> rule of cot 2 x. One inverse of a 6 x 6 matrix doubles the angles, where the sum would need n
!> inverses of (nn). F_n^-1 has the blocks of N too. D is positive and E negative definite in both,
!> being means of (nn)^-1, so that the 3 x 3 inverses below need no pivots.
module halfspace_theory
   use crystal_elasticity, only: check_stiffness, rotate_stiffness, rotation_matrix, voigt_index
   use errors, only: error_type, prefix_error, raise
   use kinds, only: degree, pi, wp
   use text, only: to_text
   implicit none
   private
   public :: halfspace_type, halfspace_modulus, halfspace_moduli, lanes, contraction_maps, &
      & inverse_barnett, plane_products, double_angles, invert, multiply, &
      & multiply_transposed, transposed
   public :: barnett_blocks, cos_2theta, finest, sin_2theta, surface_contractions

   !> Moduli of one crystal under the indenter.
   type :: halfspace_type
      !> Exact (elliptical contact) and circular-contact (Vlassak-Nix) modulus, GPa.
      real(wp) :: modulus = 0.0_wp, modulus_circular = 0.0_wp
   end type halfspace_type

   !> Directions of one block: eight numbers fill a vector register.
   integer, parameter :: lanes = 8
   !> Number of directions of the coarsest grid that is accepted, and of the finest grid.
   integer, parameter :: coarsest = 2*lanes, finest = 4096
   !> Largest accepted amplitude, relative to the mean, of the harmonic of h at 3/4 of what a grid
   !> resolves. A harmonic may vanish on a grid by its phase, so that doubling the grid changes
   !> little; this limit prevents that.
   real(wp), parameter :: allowed_tail = 3.0e-4_wp

   integer :: k
   !> cos theta and sin theta of directions in half a turn. The first n = 8, 16, 32, .. are equally
   !> spaced: after the first eight, those that double a grid are half way between its own. Each
   !> element is an expression of its number, since gfortran needs half a minute for cos(array).
   real(wp), parameter :: cos_theta(finest) = [(cos(pi*(k/real(lanes, wp))), k=0, lanes - 1), &
      & (cos(pi*((k + 0.5_wp)/2**int(log(k + 0.5_wp)/log(2.0_wp)) - 1.0_wp)), k=lanes, finest - 1)]
   real(wp), parameter :: sin_theta(finest) = [(sin(pi*(k/real(lanes, wp))), k=0, lanes - 1), &
      & (sin(pi*((k + 0.5_wp)/2**int(log(k + 0.5_wp)/log(2.0_wp)) - 1.0_wp)), k=lanes, finest - 1)]
   !> cos 2 theta and sin 2 theta.
   real(wp), parameter :: cos_2theta(finest) = 2.0_wp*cos_theta**2 - 1.0_wp, &
      & sin_2theta(finest) = 2.0_wp*sin_theta*cos_theta

   !> Relative change of the modulus on doubling the directions below which the finer grid is
   !> accepted. The rule converges exponentially on these periodic integrands, so that the error
   !> left is about the square of the change.
   real(wp), parameter :: tolerance = 2.0e-5_wp
   !> Change of A on doubling the angles below which they are accepted, and most doublings.
   real(wp), parameter :: angle_tolerance = 4.0e-5_wp
   integer, parameter :: most_doublings = 14
   !> First and second index of the components 11, 22, 33, 23, 13, 12.
   integer, parameter :: first(6) = [1, 2, 3, 2, 1, 1], second(6) = [1, 2, 3, 3, 3, 2]
   !> Places, by columns, of the elements of a transposed matrix.
   integer, parameter :: transposed(9) = [1, 4, 7, 2, 5, 8, 3, 6, 9]

contains

   !> Indentation modulus along sample -z of the crystal `c` (GPa, crystal frame) at Bunge-Euler
   !> angles `euler` (radians).
   pure subroutine halfspace_modulus(c, euler, result, error)
      real(wp), intent(in) :: c(6, 6), euler(3)
      type(halfspace_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: turned(6, 6), shape(2), change, mm(lanes, 6), mn(lanes, 9), nn(lanes, 6), &
         & f(lanes, 6)
      !> h(theta) of the displacement u_z = h/r by a unit normal point force, 1/GPa. theta is
      !> measured from sample x in the surface.
      real(wp) :: h(finest)
      integer :: done, n

      call check_stiffness(c, error)
      if (allocated(error)) return
      turned = rotate_stiffness(c, rotation_matrix(euler))
      done = 0
      shape = 0.0_wp
      n = coarsest
      do while (n <= finest)
         do done = done, n - lanes, lanes
            call surface_contractions(turned, done, mm, mn, nn)
            call inverse_barnett(mm, mn, nn, f)
            h(done + 1:done + lanes) = f(:, 3)
         end do
         call fit_contact_ellipse(h(:n), shape, result, change)
         if (change <= tolerance .and. tail(h(:n)) <= allowed_tail) return
         n = 2*n
      end do
      call raise(error, 'the surface Green''s function of a nearly unstable crystal did not ' &
         & //'converge on '//to_text(finest)//' directions')
   end subroutine halfspace_modulus

   !> Moduli of many crystals on `threads` threads. The error is that of the first crystal that has
   !> one.
   subroutine halfspace_moduli(stiffness, euler_deg, threads, modulus, error, circular)
      !> GPa, (6, 6, n); Bunge-Euler angles in degrees, (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler_deg(:, :)
      integer, intent(in) :: threads
      !> GPa, (n).
      real(wp), intent(out) :: modulus(:)
      type(error_type), allocatable, intent(out) :: error
      !> Of a circular contact, GPa, (n).
      real(wp), intent(out), optional :: circular(:)
      type(halfspace_type) :: result
      type(error_type), allocatable :: own_error
      logical :: failed(size(modulus))
      integer :: i

      !$omp parallel do num_threads(threads) schedule(dynamic, 16) private(result, own_error)
      do i = 1, size(modulus)
         call halfspace_modulus(stiffness(:, :, i), degree*euler_deg(:, i), result, own_error)
         modulus(i) = result%modulus
         if (present(circular)) circular(i) = result%modulus_circular
         failed(i) = allocated(own_error)
      end do
      !$omp end parallel do
      i = findloc(failed, .true., dim=1)
      if (i == 0) return
      call halfspace_modulus(stiffness(:, :, i), degree*euler_deg(:, i), result, error)
      call prefix_error(error, 'crystal '//to_text(i)//': ')
   end subroutine halfspace_moduli

   !> The contractions (mm), (mn) and (nn) of the directions after the first `done`: n is z, and m,
   !> in the surface, is perpendicular to the direction.
   pure subroutine surface_contractions(c, done, mm, mn, nn)
      !> Stiffness in sample axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      !> A multiple of `lanes`.
      integer, intent(in) :: done
      !> GPa, as `inverse_barnett` takes them.
      real(wp), intent(out) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      real(wp) :: x(lanes), y(lanes)
      integer :: i, j

      x = sin_theta(done + 1:done + lanes)
      y = -cos_theta(done + 1:done + lanes)
      do j = 1, 3
         do i = 1, 3
            mn(:, i + 3*(j - 1)) = x*c(voigt_index(1, i), voigt_index(j, 3)) &
               & + y*c(voigt_index(2, i), voigt_index(j, 3))
         end do
      end do
      do i = 1, 6
         associate (left => voigt_index(:, first(i)), right => voigt_index(:, second(i)))
            mm(:, i) = x**2*c(left(1), right(1)) &
               & + x*y*(c(left(1), right(2)) + c(left(2), right(1))) + y**2*c(left(2), right(2))
            nn(:, i) = c(left(3), right(3))
         end associate
      end do
   end subroutine surface_contractions

   !> Amplitude of the harmonic 2 (3 n/8) of theta in h on n = 16, 32, .. directions, relative to
   !> the mean. n/8 is a power of two; with the factor 3 this is a harmonic that every rotational
   !> symmetry of the surface about its normal allows.
   pure real(wp) function tail(h)
      real(wp), intent(in), contiguous :: h(:)
      real(wp) :: c(size(h)), s(size(h))
      integer :: n

      n = size(h)
      c = cos_2theta(:n)*(4.0_wp*cos_2theta(:n)**2 - 3.0_wp)
      s = sin_2theta(:n)*(3.0_wp - 4.0_wp*sin_2theta(:n)**2)
      do while (n > 8)
         s = 2.0_wp*s*c
         c = 2.0_wp*c**2 - 1.0_wp
         n = n/2
      end do
      tail = 2.0_wp*sqrt(sum(h*c)**2 + sum(h*s)**2)/sum(h)
   end function tail

   !> Minimise the convex compliance over the shape (a, b) of the contact ellipse by Newton's
   !> method.
   pure subroutine fit_contact_ellipse(h, shape, result, change)
      !> h in n equally spaced directions, of which the first half are equally spaced too.
      real(wp), intent(in), contiguous :: h(:)
      !> (a, b): a guess, or 0, on entry.
      real(wp), intent(inout) :: shape(2)
      type(halfspace_type), intent(out) :: result
      !> Relative change of the modulus if the second half is left out.
      real(wp), intent(out) :: change
      !> Last step. A step d leaves an error of the order d^2 of the shape, and d^4 of the modulus.
      real(wp), parameter :: last_step = 1.0e-3_wp
      !> Eccentricity and step below which Newton's method needs no line search.
      real(wp), parameter :: safe_shape = 0.7_wp, safe_step = 0.1_wp
      real(wp) :: step(2), gradient(2), hessian(3), value, half, determinant, length
      integer :: n, iteration

      n = size(h)
      ! Start from the quadratic expansion about a circle.
      if (.not. any(abs(shape) > 0.0_wp)) then
         shape = 4.0_wp/3.0_wp*[sum(h*cos_2theta(:n)), sum(h*sin_2theta(:n))]/sum(h)
      end if
      do iteration = 1, 50
         call differentiate(h, shape, gradient, hessian)
         determinant = hessian(1)*hessian(3) - hessian(2)**2
         step(1) = (hessian(2)*gradient(2) - hessian(3)*gradient(1))/determinant
         step(2) = (hessian(2)*gradient(1) - hessian(1)*gradient(2))/determinant
         length = 1.0_wp
         if (sum((shape + step)**2) > safe_shape**2 .or. sum(step**2) > safe_step**2) then
            value = total_compliance(h, shape)
            do
               if (sum((shape + length*step)**2) < 1.0_wp) then
                  if (total_compliance(h, shape + length*step) <= value*(1.0_wp + 1.0e-15_wp)) exit
               end if
               length = 0.5_wp*length
               if (length < 1.0e-10_wp) exit
            end do
            if (length < 1.0e-10_wp) exit
         end if
         shape = shape + length*step
         if (sum(step**2) < last_step**2) exit
      end do
      half = total_compliance(h(:n/2), shape)
      value = total_compliance(h, shape)
      change = abs(2.0_wp*half/value - 1.0_wp)
      result%modulus = n/(pi*value)
      result%modulus_circular = n/(pi*sum(h))
   end subroutine fit_contact_ellipse

   !> Sum of h (1 + a cos 2 theta + b sin 2 theta)^-1/2.
   pure real(wp) function total_compliance(h, shape) result(total)
      real(wp), intent(in), contiguous :: h(:)
      real(wp), intent(in) :: shape(2)
      integer :: i

      total = 0.0_wp
      !$omp simd reduction(+: total)
      do i = 1, size(h)
         total = total + h(i)/sqrt(1.0_wp + shape(1)*cos_2theta(i) + shape(2)*sin_2theta(i))
      end do
   end function total_compliance

   !> Gradient of the total compliance, and its second derivatives aa, ab, bb.
   pure subroutine differentiate(h, shape, gradient, hessian)
      real(wp), intent(in), contiguous :: h(:)
      real(wp), intent(in) :: shape(2)
      real(wp), intent(out) :: gradient(2), hessian(3)
      real(wp) :: r, w, a, b, aa, ab, bb
      integer :: i

      a = 0.0_wp
      b = 0.0_wp
      aa = 0.0_wp
      ab = 0.0_wp
      bb = 0.0_wp
      !$omp simd private(r, w) reduction(+: a, b, aa, ab, bb)
      do i = 1, size(h)
         r = 1.0_wp/(1.0_wp + shape(1)*cos_2theta(i) + shape(2)*sin_2theta(i))
         w = 0.5_wp*h(i)*r*sqrt(r)
         a = a - w*cos_2theta(i)
         b = b - w*sin_2theta(i)
         w = 1.5_wp*w*r
         aa = aa + w*cos_2theta(i)*cos_2theta(i)
         ab = ab + w*cos_2theta(i)*sin_2theta(i)
         bb = bb + w*sin_2theta(i)*sin_2theta(i)
      end do
      gradient = [a, b]
      hessian = [aa, ab, bb]
   end subroutine differentiate

   !> The contractions (ab)_ij = a_k C_kijl b_l of a stiffness as linear functions of the products
   !> a_k b_l.
   pure subroutine contraction_maps(c, map_mn, map_mm)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      !> Map from a_k b_l, l fastest, to (ab) by columns.
      real(wp), intent(out) :: map_mn(9, 9)
      !> Map from a_k a_l to (aa), both by the components 11, 22, 33, 23, 13, 12.
      real(wp), intent(out) :: map_mm(6, 6)
      integer :: i, j, k, l

      do concurrent(i=1:3, j=1:3, k=1:3, l=1:3)
         map_mn(l + 3*(k - 1), i + 3*(j - 1)) = c(voigt_index(k, i), voigt_index(j, l))
      end do
      do concurrent(i=1:6, j=1:6)
         map_mm(i, j) = c(voigt_index(first(i), first(j)), voigt_index(second(j), second(i)))
         if (i > 3) then
            map_mm(i, j) = map_mm(i, j) + c(voigt_index(second(i), first(j)), &
               & voigt_index(second(j), first(i)))
         end if
      end do
   end subroutine contraction_maps

   !> Products of two directions, to which the maps apply: `mn` is m_k n_l, l fastest; `mm` and `nn`
   !> are m_k m_l and n_k n_l, kl = 11, 22, 33, 23, 13, 12.
   pure subroutine plane_products(m, n, mn, mm, nn)
      !> Unit vectors.
      real(wp), intent(in) :: m(3), n(3)
      real(wp), intent(out) :: mn(9), mm(6), nn(6)

      mn = [m(1)*n, m(2)*n, m(3)*n]
      mm = [m**2, m(2)*m(3), m(1)*m(3), m(1)*m(2)]
      nn = [n**2, n(2)*n(3), n(1)*n(3), n(1)*n(2)]
   end subroutine plane_products

   !> B^-1/(8 pi^2) = L^-1/(2 pi), 1/GPa: components 11, 22, 33, 23, 13, 12.
   pure subroutine inverse_barnett(mm, mn, nn, f)
      !> Contractions (ab)_ij = a_k C_kijl b_l with two directions perpendicular to t and to each
      !> other, GPa: the six components of (mm) and (nn), and (mn) by columns.
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      !> Components of B^-1/(8 pi^2) in the axes of the contractions.
      real(wp), intent(out) :: f(lanes, 6)
      real(wp) :: a(lanes, 9), d(lanes, 6), e(lanes, 6)

      call barnett_blocks(mm, mn, nn, a, d, e)
      call invert(e, f)
      f = f*(-0.5_wp/pi)
   end subroutine inverse_barnett

   !> The mean of Stroh's matrix N over the turn of m and n.
   pure subroutine barnett_blocks(mm, mn, nn, a, d, e)
      !> As in `inverse_barnett`.
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      !> Its blocks: A by columns, D (1/GPa) and E = -L (GPa) by components.
      real(wp), intent(out) :: a(lanes, 9), d(lanes, 6), e(lanes, 6)
      real(wp) :: f(lanes, 6), t(lanes, 6), x(lanes, 9), change
      integer :: k

      ! The mean of N over two angles, m, n and n, -m.
      x = mn(:, transposed)
      call invert(nn, d)
      call multiply(d, x, a)
      call multiply_transposed(a, x, e)
      call invert(mm, t)
      call multiply(t, mn, x)
      call multiply_transposed(x, mn, f)
      a = 0.5_wp*(x - a)
      d = 0.5_wp*(d + t)
      e = 0.5_wp*(e + f - mm - nn)
      do k = 1, most_doublings
         call double_angles(a, d, e, change)
         if (change <= angle_tolerance) exit
      end do
   end subroutine barnett_blocks

   !> Double the number of angles of F.
   pure subroutine double_angles(a, d, e, change)
      !> The blocks of F: A by columns, D and E by components.
      real(wp), intent(inout) :: a(lanes, 9), d(lanes, 6), e(lanes, 6)
      !> Largest change of an element of A, which has no unit.
      real(wp), intent(out) :: change
      real(wp) :: p1, p2, p3, p4, p5, p6, k11, k21, k31, k12, k22, k32, k13, k23, k33, s1, s2, s3, &
         & s4, s5, s6, t1, t2, t3, t4, t5, t6, w11, w21, w31, w12, w22, w32, w13, w23, w33, scale
      integer :: i

      ! K = D^-1 A, S = E - A^T K, and its inverse T, the upper right block of F^-1; W = T K^T: F^-1
      ! = [-W, T; D^-1 + W^T K^T, -W^T]. Scalars stay in registers.
      change = 0.0_wp
      !$omp simd simdlen(8) reduction(max: change)
      do i = 1, lanes
         p1 = d(i, 2)*d(i, 3) - d(i, 4)*d(i, 4)
         p2 = d(i, 1)*d(i, 3) - d(i, 5)*d(i, 5)
         p3 = d(i, 1)*d(i, 2) - d(i, 6)*d(i, 6)
         p4 = d(i, 6)*d(i, 5) - d(i, 1)*d(i, 4)
         p5 = d(i, 6)*d(i, 4) - d(i, 2)*d(i, 5)
         p6 = d(i, 4)*d(i, 5) - d(i, 6)*d(i, 3)
         scale = 1.0_wp/(d(i, 1)*p1 + d(i, 6)*p6 + d(i, 5)*p5)
         p1 = p1*scale
         p2 = p2*scale
         p3 = p3*scale
         p4 = p4*scale
         p5 = p5*scale
         p6 = p6*scale
         k11 = p1*a(i, 1) + p6*a(i, 2) + p5*a(i, 3)
         k21 = p6*a(i, 1) + p2*a(i, 2) + p4*a(i, 3)
         k31 = p5*a(i, 1) + p4*a(i, 2) + p3*a(i, 3)
         k12 = p1*a(i, 4) + p6*a(i, 5) + p5*a(i, 6)
         k22 = p6*a(i, 4) + p2*a(i, 5) + p4*a(i, 6)
         k32 = p5*a(i, 4) + p4*a(i, 5) + p3*a(i, 6)
         k13 = p1*a(i, 7) + p6*a(i, 8) + p5*a(i, 9)
         k23 = p6*a(i, 7) + p2*a(i, 8) + p4*a(i, 9)
         k33 = p5*a(i, 7) + p4*a(i, 8) + p3*a(i, 9)
         s1 = e(i, 1) - (a(i, 1)*k11 + a(i, 2)*k21 + a(i, 3)*k31)
         s2 = e(i, 2) - (a(i, 4)*k12 + a(i, 5)*k22 + a(i, 6)*k32)
         s3 = e(i, 3) - (a(i, 7)*k13 + a(i, 8)*k23 + a(i, 9)*k33)
         s4 = e(i, 4) - (a(i, 4)*k13 + a(i, 5)*k23 + a(i, 6)*k33)
         s5 = e(i, 5) - (a(i, 1)*k13 + a(i, 2)*k23 + a(i, 3)*k33)
         s6 = e(i, 6) - (a(i, 1)*k12 + a(i, 2)*k22 + a(i, 3)*k32)
         t1 = s2*s3 - s4*s4
         t2 = s1*s3 - s5*s5
         t3 = s1*s2 - s6*s6
         t4 = s6*s5 - s1*s4
         t5 = s6*s4 - s2*s5
         t6 = s4*s5 - s6*s3
         scale = 0.5_wp/(s1*t1 + s6*t6 + s5*t5)
         t1 = t1*scale
         t2 = t2*scale
         t3 = t3*scale
         t4 = t4*scale
         t5 = t5*scale
         t6 = t6*scale
         ! From here on T and W are halved.
         w11 = t1*k11 + t6*k12 + t5*k13
         w21 = t6*k11 + t2*k12 + t4*k13
         w31 = t5*k11 + t4*k12 + t3*k13
         w12 = t1*k21 + t6*k22 + t5*k23
         w22 = t6*k21 + t2*k22 + t4*k23
         w32 = t5*k21 + t4*k22 + t3*k23
         w13 = t1*k31 + t6*k32 + t5*k33
         w23 = t6*k31 + t2*k32 + t4*k33
         w33 = t5*k31 + t4*k32 + t3*k33
         d(i, 1) = 0.5_wp*d(i, 1) - t1
         d(i, 2) = 0.5_wp*d(i, 2) - t2
         d(i, 3) = 0.5_wp*d(i, 3) - t3
         d(i, 4) = 0.5_wp*d(i, 4) - t4
         d(i, 5) = 0.5_wp*d(i, 5) - t5
         d(i, 6) = 0.5_wp*d(i, 6) - t6
         e(i, 1) = 0.5_wp*(e(i, 1) - p1) - (w11*k11 + w21*k12 + w31*k13)
         e(i, 2) = 0.5_wp*(e(i, 2) - p2) - (w12*k21 + w22*k22 + w32*k23)
         e(i, 3) = 0.5_wp*(e(i, 3) - p3) - (w13*k31 + w23*k32 + w33*k33)
         e(i, 4) = 0.5_wp*(e(i, 4) - p4) - (w12*k31 + w22*k32 + w32*k33)
         e(i, 5) = 0.5_wp*(e(i, 5) - p5) - (w11*k31 + w21*k32 + w31*k33)
         e(i, 6) = 0.5_wp*(e(i, 6) - p6) - (w11*k21 + w21*k22 + w31*k23)
         w11 = w11 - 0.5_wp*a(i, 1)
         w21 = w21 - 0.5_wp*a(i, 2)
         w31 = w31 - 0.5_wp*a(i, 3)
         w12 = w12 - 0.5_wp*a(i, 4)
         w22 = w22 - 0.5_wp*a(i, 5)
         w32 = w32 - 0.5_wp*a(i, 6)
         w13 = w13 - 0.5_wp*a(i, 7)
         w23 = w23 - 0.5_wp*a(i, 8)
         w33 = w33 - 0.5_wp*a(i, 9)
         change = max(change, abs(w11), abs(w21), abs(w31), abs(w12), abs(w22), abs(w32), &
            & abs(w13), abs(w23), abs(w33))
         a(i, 1) = a(i, 1) + w11
         a(i, 2) = a(i, 2) + w21
         a(i, 3) = a(i, 3) + w31
         a(i, 4) = a(i, 4) + w12
         a(i, 5) = a(i, 5) + w22
         a(i, 6) = a(i, 6) + w32
         a(i, 7) = a(i, 7) + w13
         a(i, 8) = a(i, 8) + w23
         a(i, 9) = a(i, 9) + w33
      end do
   end subroutine double_angles

   !> Set `inverse` to the inverses of symmetric matrices `a`, by the components 11, 22, 33, 23,
   !> 13, 12.
   pure subroutine invert(a, inverse)
      real(wp), intent(in) :: a(lanes, 6)
      real(wp), intent(out) :: inverse(lanes, 6)
      real(wp) :: scale(lanes)
      integer :: k

      inverse(:, 1) = a(:, 2)*a(:, 3) - a(:, 4)*a(:, 4)
      inverse(:, 2) = a(:, 1)*a(:, 3) - a(:, 5)*a(:, 5)
      inverse(:, 3) = a(:, 1)*a(:, 2) - a(:, 6)*a(:, 6)
      inverse(:, 4) = a(:, 6)*a(:, 5) - a(:, 1)*a(:, 4)
      inverse(:, 5) = a(:, 6)*a(:, 4) - a(:, 2)*a(:, 5)
      inverse(:, 6) = a(:, 4)*a(:, 5) - a(:, 6)*a(:, 3)
      scale = 1.0_wp/(a(:, 1)*inverse(:, 1) + a(:, 6)*inverse(:, 6) + a(:, 5)*inverse(:, 5))
      do k = 1, 6
         inverse(:, k) = inverse(:, k)*scale
      end do
   end subroutine invert

   !> Set `product` to S A for symmetric matrices `s`, by components, and `a`, by columns.
   pure subroutine multiply(s, a, product)
      real(wp), intent(in) :: s(lanes, 6), a(lanes, 9)
      real(wp), intent(out) :: product(lanes, 9)
      integer :: j

      do j = 0, 6, 3
         product(:, j + 1) = s(:, 1)*a(:, j + 1) + s(:, 6)*a(:, j + 2) + s(:, 5)*a(:, j + 3)
         product(:, j + 2) = s(:, 6)*a(:, j + 1) + s(:, 2)*a(:, j + 2) + s(:, 4)*a(:, j + 3)
         product(:, j + 3) = s(:, 5)*a(:, j + 1) + s(:, 4)*a(:, j + 2) + s(:, 3)*a(:, j + 3)
      end do
   end subroutine multiply

   !> Set `product` to A^T B where that is symmetric, for `a` and `b` by columns.
   pure subroutine multiply_transposed(a, b, product)
      real(wp), intent(in) :: a(lanes, 9), b(lanes, 9)
      real(wp), intent(out) :: product(lanes, 6)
      !> Where the columns of A and of B of a component begin, less 1.
      integer, parameter :: left(6) = [0, 3, 6, 3, 0, 0], right(6) = [0, 3, 6, 6, 6, 3]
      integer :: k

      do k = 1, 6
         product(:, k) = a(:, left(k) + 1)*b(:, right(k) + 1) &
            & + a(:, left(k) + 2)*b(:, right(k) + 2) + a(:, left(k) + 3)*b(:, right(k) + 3)
      end do
   end subroutine multiply_transposed

end module halfspace_theory
