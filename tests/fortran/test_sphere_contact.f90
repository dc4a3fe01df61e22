!> The contact of a tip with a half-space: closed forms, and Sneddon's integrals by quadrature.
program test_sphere_contact
   use kinds, only: pi, wp
   use sphere_contact, only: contact_at, contact_type
   use testing, only: check, check_close, finish
   use text, only: to_text
   implicit none

   real(wp), parameter :: modulus = 120.0_wp, radius = 4.5_wp, betas(4) = [0.0_wp, 1.0_wp, 3.0_wp, &
      & -0.8_wp], loads(4) = [0.01_wp, 1.0_wp, 40.0_wp, 200.0_wp], exact = 1.0e-10_wp
   integer :: i, j

   do j = 1, size(loads)
      call test_paraboloid(loads(j))
      do i = 1, size(betas)
         call test_profile(loads(j), betas(i))
      end do
   end do
   call test_sphere()
   call test_flattest()
   call finish()

contains

   !> Hertz.
   subroutine test_paraboloid(load)
      real(wp), intent(in) :: load
      type(contact_type) :: c
      real(wp) :: depth

      c = contact_at(load, modulus, radius, 0.0_wp)
      depth = (0.75_wp*load/(modulus*sqrt(radius)))**(2.0_wp/3.0_wp)
      call check_close('Hertz: depth at '//to_text(load)//' mN', c%depth/depth, 1.0_wp, exact)
      call check_close('Hertz: contact radius', c%radius**2/(radius*depth), 1.0_wp, exact)
      call check_close('Hertz: d ln h/d ln E', c%by_modulus/depth, -2.0_wp/3.0_wp, exact)
      call check_close('Hertz: d ln h/d ln R', c%by_radius/depth, -1.0_wp/3.0_wp, exact)
      ! P = 4/3 E sqrt(R) h^1.5, so that dP/dh = 2 E sqrt(R h).
      call check_close('Hertz: stiffness', 2.0_wp*modulus*c%radius/(1.5_wp*load/depth), &
         & 1.0_wp, exact)
   end subroutine test_paraboloid

   !> Load, depth and stiffness by Sneddon's integrals over the profile; derivatives by differences.
   subroutine test_profile(load, beta)
      real(wp), intent(in) :: load, beta
      !> Central differences that are exact for polynomials of degree six.
      real(wp), parameter :: weights(3) = [45.0_wp, -9.0_wp, 1.0_wp]/30.0_wp, step = 0.03_wp, &
         & change = 1.0e-5_wp
      type(contact_type) :: c, ahead, behind
      real(wp) :: slope(2)
      character(len=:), allocatable :: name
      integer :: k

      name = to_text(load)//' mN, beta '//to_text(beta)//': '
      c = contact_at(load, modulus, radius, beta)
      call check_close(name//'load', sneddon_load(c%radius, beta)/load, 1.0_wp, exact)
      call check_close(name//'depth', sneddon_depth(c%radius, beta)/c%depth, 1.0_wp, exact)
      slope = 0.0_wp
      do k = 1, 3
         associate (a => c%radius*(1.0_wp + k*step), b => c%radius*(1.0_wp - k*step))
            slope = slope + weights(k)*[sneddon_load(a, beta) - sneddon_load(b, beta), &
               & sneddon_depth(a, beta) - sneddon_depth(b, beta)]
         end associate
      end do
      call check_close(name//'stiffness', 2.0_wp*modulus*c%radius/(slope(1)/slope(2)), &
         & 1.0_wp, exact)
      ahead = contact_at(load, modulus*exp(change), radius, beta)
      behind = contact_at(load, modulus*exp(-change), radius, beta)
      call check_close(name//'by modulus', (ahead%depth - behind%depth)/(2.0_wp*change), &
         & c%by_modulus, 1.0e-8_wp*c%depth)
      ahead = contact_at(load, modulus, radius*exp(change), beta)
      behind = contact_at(load, modulus, radius*exp(-change), beta)
      call check_close(name//'by radius', (ahead%depth - behind%depth)/(2.0_wp*change), &
         & c%by_radius, 1.0e-8_wp*c%depth)
      ahead = contact_at(load, modulus, radius, beta + change)
      behind = contact_at(load, modulus, radius, beta - change)
      call check_close(name//'by beta', (ahead%depth - behind%depth)/(2.0_wp*change), c%by_beta, &
         & 1.0e-8_wp*c%depth)
   end subroutine test_profile

   !> A true sphere in closed form: what beta = 1 leaves out is of the next order, below 0.1 % of
   !> the depth at a contact radius of 0.3 R.
   subroutine test_sphere()
      real(wp) :: off(2), a, logarithm, load
      type(contact_type) :: c
      integer :: k

      do k = 1, 2
         a = 0.3_wp*radius/k
         logarithm = log((radius + a)/(radius - a))
         load = modulus*(0.5_wp*(a**2 + radius**2)*logarithm - a*radius)
         c = contact_at(load, modulus, radius, 1.0_wp)
         off(k) = c%depth/(0.5_wp*a*logarithm) - 1.0_wp
      end do
      call check('sphere: depth', abs(off(1)) < 1.0e-3_wp, to_text(off(1)))
      call check_close('sphere: order of what is left out', log(off(1)/off(2))/log(2.0_wp), &
         & 4.0_wp, 0.2_wp)
   end subroutine test_sphere

   !> A blunt tip has no contact beyond where the load stops to grow.
   subroutine test_flattest()
      real(wp), parameter :: beta = -0.8_wp
      type(contact_type) :: c

      c = contact_at(1.0e6_wp, modulus, radius, beta)
      call check('blunt: bounded', c%radius < radius*sqrt(-1.5_wp/beta), to_text(c%radius))
   end subroutine test_flattest

   !> h = a int_0^(pi/2) f'(a sin t) dt, um, of the profile f(r) = r^2/(2 R) + beta r^4/(8 R^3).
   real(wp) function sneddon_depth(a, beta)
      real(wp), intent(in) :: a, beta

      sneddon_depth = a*integral(a, beta, 0)
   end function sneddon_depth

   !> P = 2 E a^2 int_0^(pi/2) sin^2 t f'(a sin t) dt, mN.
   real(wp) function sneddon_load(a, beta)
      real(wp), intent(in) :: a, beta

      sneddon_load = 2.0_wp*modulus*a**2*integral(a, beta, 2)
   end function sneddon_load

   !> Of sin^power t f'(a sin t), by Simpson's rule.
   real(wp) function integral(a, beta, power)
      real(wp), intent(in) :: a, beta
      integer, intent(in) :: power
      integer, parameter :: n = 2000
      real(wp) :: sine
      integer :: k

      integral = 0.0_wp
      do k = 0, n
         sine = sin(0.5_wp*pi*k/n)
         integral = integral + merge(1, merge(4, 2, mod(k, 2) == 1), &
            & k == 0 .or. k == n)*sine**power*(a*sine/radius + 0.5_wp*beta*(a*sine)**3/radius**3)
      end do
      integral = integral*pi/(6.0_wp*n)
   end function integral
end program test_sphere_contact
