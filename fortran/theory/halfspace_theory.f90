!> Exact indentation modulus of an anisotropic half-space under a frictionless rigid sphere.
!>
!> The surface Green's function is that of Barnett & Lothe; the contact ellipse minimises the compliance (Willis, J. Mech.
!> Phys. Solids 14, 163, 1966). With a circle instead of the ellipse the modulus is that of Vlassak & Nix (J. Mech. Phys.
!> Solids 42, 1223, 1994), which is never larger.
module halfspace_theory
   use barnett_lothe, only: contraction_maps, inverse_barnett, lanes, tolerance
   use crystal_elasticity, only: check_stiffness, rotate_stiffness, rotation_matrix
   use errors, only: error_type, raise
   use kinds, only: degree, pi, wp
   use text, only: to_text
   implicit none
   private
   public :: halfspace_type, halfspace_modulus, halfspace_moduli

   !> What the theory says of one crystal under the indenter.
   type :: halfspace_type
      !> Exact (elliptical contact) and circular-contact (Vlassak-Nix) modulus, GPa.
      real(wp) :: modulus = 0.0_wp, modulus_circular = 0.0_wp
      !> The contact's minor over major axis, and the direction of the major axis from sample x, radians in [0, pi).
      real(wp) :: axis_ratio = 1.0_wp, major_axis = 0.0_wp
   end type halfspace_type

   !> Directions of the coarsest grid that is accepted, of those in the table below, and of the finest grid.
   integer, parameter :: coarsest = 2*lanes, tabulated = 4*lanes, finest = 4096
   !> Of the harmonic of h at 3/4 of what a grid resolves, relative to the mean. With the doubling of the grid it guards against a
   !> change that is small by the phase of a harmonic alone.
   real(wp), parameter :: allowed_tail = 3.0e-4_wp

   integer :: k
   !> Directions in half a turn, radians, such that the first n = 8, 16, 32 are equally spaced; those of finer grids follow alike.
   real(wp), parameter :: directions(tabulated) = pi*[[(k/real(lanes, wp), k=0, lanes - 1)], &
      & [((k + 0.5_wp)/lanes, k=0, lanes - 1)], [((k + 0.5_wp)/(2*lanes), k=0, 2*lanes - 1)]]
   real(wp), parameter :: cosines(tabulated) = cos(directions), sines(tabulated) = sin(directions)

contains

   !> Indentation modulus along sample -z of the crystal `c` (GPa, crystal frame) at Bunge-Euler angles `euler` (radians).
   pure subroutine halfspace_modulus(c, euler, result, error)
      real(wp), intent(in) :: c(6, 6), euler(3)
      type(halfspace_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: one(9, 9), both(6, 6), h(finest), cosine(finest), sine(finest), shape(2), change
      integer :: done, n

      call check_stiffness(c, error)
      if (allocated(error)) return
      call contraction_maps(rotate_stiffness(c, rotation_matrix(euler)), one, both)
      done = 0
      shape = 0.0_wp
      n = coarsest
      do while (n <= finest)
         call extend_grid(one, both, done, n, h, cosine, sine)
         done = n
         call fit_contact_ellipse(h(:n), cosine(:n), sine(:n), shape, result, change)
         if (change <= tolerance .and. tail(h(:n), cosine(:n), sine(:n)) <= allowed_tail) return
         n = 2*n
      end do
      call raise(error, 'the surface Green''s function of a nearly unstable crystal did not converge on ' &
         & //to_text(finest)//' directions')
   end subroutine halfspace_modulus

   !> The moduli of many crystals on `threads` threads; the error is that of the first that has one.
   subroutine halfspace_moduli(stiffness, euler_deg, threads, modulus, circular, error)
      !> GPa (6, 6, n), Bunge-Euler angles in degrees (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler_deg(:, :)
      integer, intent(in) :: threads
      !> Exact, and of a circular contact, GPa (n).
      real(wp), intent(out) :: modulus(:), circular(:)
      type(error_type), allocatable, intent(out) :: error
      type(halfspace_type) :: result
      type(error_type), allocatable :: own
      integer :: i, first

      first = size(modulus) + 1
      !$omp parallel do num_threads(threads) schedule(dynamic, 16) private(result, own)
      do i = 1, size(modulus)
         call halfspace_modulus(stiffness(:, :, i), degree*euler_deg(:, i), result, own)
         modulus(i) = result%modulus
         circular(i) = result%modulus_circular
         if (.not. allocated(own)) cycle
         !$omp critical (halfspace_moduli_error)
         if (i < first) then
            first = i
            call raise(error, 'crystal '//to_text(i)//': '//own%message, own%status)
         end if
         !$omp end critical (halfspace_moduli_error)
      end do
      !$omp end parallel do
   end subroutine halfspace_moduli

   !> h(theta) of u_z = h/r for a unit normal point force, 1/GPa, and the cosine and sine of 2 theta, in the directions after the first
   !> `done` up to the `n`-th; theta is counted from sample x in the surface.
   pure subroutine extend_grid(one, both, done, n, h, cosine, sine)
      real(wp), intent(in) :: one(9, 9), both(6, 6)
      integer, intent(in) :: done, n
      real(wp), intent(inout) :: h(finest), cosine(finest), sine(finest)
      real(wp) :: c(lanes), s(lanes), mm(lanes, 6), mn(lanes, 9), nn(lanes, 6), f(lanes, 6), theta
      integer :: first, i

      do first = done, n - lanes, lanes
         if (first < tabulated) then
            c = cosines(first + 1:first + lanes)
            s = sines(first + 1:first + lanes)
         else
            do i = 1, lanes
               theta = pi*(first + i - done - 0.5_wp)/done
               c(i) = cos(theta)
               s(i) = sin(theta)
            end do
         end if
         cosine(first + 1:first + lanes) = c**2 - s**2
         sine(first + 1:first + lanes) = 2.0_wp*c*s
         ! m = (sin theta, -cos theta, 0) and n = z are perpendicular to t.
         do i = 1, 9
            mn(:, i) = s*one(3, i) - c*one(6, i)
         end do
         do i = 1, 6
            mm(:, i) = s**2*both(1, i) - s*c*both(6, i) + c**2*both(2, i)
            nn(:, i) = both(3, i)
         end do
         call inverse_barnett(mm, mn, nn, f)
         h(first + 1:first + lanes) = f(:, 3)
      end do
   end subroutine extend_grid

   !> Amplitude of the harmonic 2 (3 n/8) of theta in h on n = 16, 32, .. directions, relative to the mean: n/8 is a power of two, and
   !> with the cube of exp(2 i theta) any symmetry of the surface about its normal has that harmonic.
   pure real(wp) function tail(h, cosine, sine)
      real(wp), intent(in), contiguous :: h(:), cosine(:), sine(:)
      complex(wp) :: z, total
      integer :: i, j, squarings

      squarings = nint(log(size(h)/8.0_wp)/log(2.0_wp))
      total = 0.0_wp
      do i = 1, size(h)
         z = cmplx(cosine(i), sine(i), wp)
         z = z*z*z
         do j = 1, squarings
            z = z*z
         end do
         total = total + h(i)*z
      end do
      tail = 2.0_wp*abs(total)/sum(h)
   end function tail

   !> Minimise the convex compliance over the shape (a, b) of the contact ellipse by Newton's method.
   pure subroutine fit_contact_ellipse(h, cosine, sine, shape, result, change)
      !> h, and the cosine and sine of 2 theta, in n equally spaced directions, of which the first half are equally spaced too.
      real(wp), intent(in), contiguous :: h(:), cosine(:), sine(:)
      !> (a, b): a guess, or 0, on entry.
      real(wp), intent(inout) :: shape(2)
      type(halfspace_type), intent(out) :: result
      !> Of the modulus on leaving the second half out, relative.
      real(wp), intent(out) :: change
      !> Steps of less leave an error of the order of their square, and of its square in the modulus.
      real(wp), parameter :: smallest = 1.0e-5_wp
      !> Shapes and steps for which Newton's method needs no watching.
      real(wp), parameter :: safe_shape = 0.7_wp, safe_step = 0.1_wp
      real(wp) :: step(2), gradient(2), hessian(3), value, half, determinant, length
      integer :: n, iteration

      n = size(h)
      do iteration = 1, 50
         call differentiate(h, cosine, sine, shape, gradient, hessian)
         determinant = hessian(1)*hessian(3) - hessian(2)**2
         step(1) = (hessian(2)*gradient(2) - hessian(3)*gradient(1))/determinant
         step(2) = (hessian(2)*gradient(1) - hessian(1)*gradient(2))/determinant
         length = 1.0_wp
         if (sum((shape + step)**2) > safe_shape**2 .or. sum(step**2) > safe_step**2) then
            value = total_compliance(h, cosine, sine, shape)
            do
               if (sum((shape + length*step)**2) < 1.0_wp) then
                  if (total_compliance(h, cosine, sine, shape + length*step) <= value*(1.0_wp + 1.0e-15_wp)) exit
               end if
               length = 0.5_wp*length
               if (length < 1.0e-10_wp) exit
            end do
            if (length < 1.0e-10_wp) exit
         end if
         shape = shape + length*step
         if (sum(step**2) < smallest**2) exit
      end do
      half = total_compliance(h(:n/2), cosine(:n/2), sine(:n/2), shape)
      value = half + total_compliance(h(n/2 + 1:), cosine(n/2 + 1:), sine(n/2 + 1:), shape)
      change = abs(2.0_wp*half/value - 1.0_wp)
      result%modulus = n/(pi*value)
      result%modulus_circular = n/(pi*sum(h))
      length = norm2(shape)
      result%axis_ratio = sqrt((1.0_wp - length)/(1.0_wp + length))
      ! The weight is largest where the contact is narrowest.
      result%major_axis = modulo(0.5_wp*atan2(shape(2), shape(1)) + 0.5_wp*pi, pi)
   end subroutine fit_contact_ellipse

   !> Sum of h (1 + a cos 2 theta + b sin 2 theta)^-1/2.
   pure real(wp) function total_compliance(h, cosine, sine, shape) result(total)
      real(wp), intent(in), contiguous :: h(:), cosine(:), sine(:)
      real(wp), intent(in) :: shape(2)
      integer :: i

      total = 0.0_wp
      !$omp simd reduction(+: total)
      do i = 1, size(h)
         total = total + h(i)/sqrt(1.0_wp + shape(1)*cosine(i) + shape(2)*sine(i))
      end do
   end function total_compliance

   !> Its gradient and its second derivatives aa, ab, bb.
   pure subroutine differentiate(h, cosine, sine, shape, gradient, hessian)
      real(wp), intent(in), contiguous :: h(:), cosine(:), sine(:)
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
         r = 1.0_wp/(1.0_wp + shape(1)*cosine(i) + shape(2)*sine(i))
         w = 0.5_wp*h(i)*r*sqrt(r)
         a = a - w*cosine(i)
         b = b - w*sine(i)
         w = 1.5_wp*w*r
         aa = aa + w*cosine(i)*cosine(i)
         ab = ab + w*cosine(i)*sine(i)
         bb = bb + w*sine(i)*sine(i)
      end do
      gradient = [a, b]
      hessian = [aa, ab, bb]
   end subroutine differentiate
end module halfspace_theory
