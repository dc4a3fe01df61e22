!> Exact indentation modulus of an anisotropic half-space under a frictionless rigid sphere.
!>
!> The surface Green's function is that of Barnett & Lothe; the contact ellipse minimises the compliance (Willis, J. Mech.
!> Phys. Solids 14, 163, 1966). With a circle instead of the ellipse the modulus is that of Vlassak & Nix (J. Mech. Phys.
!> Solids 42, 1223, 1994), which is never larger.
module halfspace_theory
   use crystal_elasticity, only: check_stiffness, rotate_stiffness, rotation_matrix, voigt_index
   use errors, only: error_type, raise
   use kinds, only: pi, wp
   use text, only: to_text
   implicit none
   private
   public :: halfspace_type, halfspace_modulus, surface_compliance

   !> What the theory says of one crystal under the indenter.
   type :: halfspace_type
      !> Exact (elliptical contact) and circular-contact (Vlassak-Nix) modulus, GPa.
      real(wp) :: modulus = 0.0_wp, modulus_circular = 0.0_wp
      !> The contact's minor over major axis, and the direction of the major axis from sample x, radians in [0, pi).
      real(wp) :: axis_ratio = 1.0_wp, major_axis = 0.0_wp
   end type halfspace_type

   !> Relative change of the modulus below which a finer angular grid is not tried, and the finest grid.
   real(wp), parameter :: tolerance = 1.0e-7_wp
   integer, parameter :: coarsest = 16, finest = 4096

contains

   !> Indentation modulus along sample -z of the crystal `c` (GPa, crystal frame) at Bunge-Euler angles `euler` (radians).
   subroutine halfspace_modulus(c, euler, result, error)
      real(wp), intent(in) :: c(6, 6), euler(3)
      type(halfspace_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: rotated(6, 6), previous, compliance(finest)
      integer :: n, stride, i

      call check_stiffness(c, error)
      if (allocated(error)) return
      rotated = rotate_stiffness(c, rotation_matrix(euler))
      n = coarsest
      do i = 1, n
         compliance(i) = surface_compliance(rotated, pi*(i - 1)/n)
      end do
      call fit_contact_ellipse(compliance(:n), result)
      do while (2*n <= finest)
         previous = result%modulus
         ! Old points become the odd ones of the finer grid.
         do i = n, 1, -1
            compliance(2*i - 1) = compliance(i)
         end do
         stride = 2*n
         do i = 2, stride, 2
            compliance(i) = surface_compliance(rotated, pi*(i - 1)/stride)
         end do
         n = stride
         call fit_contact_ellipse(compliance(:n), result)
         if (abs(result%modulus - previous) <= tolerance*result%modulus) return
      end do
      call raise(error, 'the surface Green''s function of a nearly unstable crystal did not converge on ' &
         & //to_text(finest)//' directions')
   end subroutine halfspace_modulus

   !> h(theta) of u_z = h/r for a unit normal point force, 1/GPa, of the stiffness `c` in the sample frame; theta is the
   !> direction from sample x in the surface.
   pure real(wp) function surface_compliance(c, theta) result(h)
      real(wp), intent(in) :: c(6, 6), theta
      real(wp) :: zz(3, 3), ze(3, 3), ee(3, 3), total(3, 3), refined(3, 3), e(3), before
      integer :: n, i

      ! m and n turn in the plane perpendicular to t = (cos theta, sin theta, 0), which z and e = (sin, -cos, 0) span.
      e = [sin(theta), -cos(theta), 0.0_wp]
      zz = contraction(c, [0.0_wp, 0.0_wp, 1.0_wp], [0.0_wp, 0.0_wp, 1.0_wp])
      ze = contraction(c, [0.0_wp, 0.0_wp, 1.0_wp], e)
      ee = contraction(c, e, e)
      ! The integrand repeats after pi; the trapezoid rule on a periodic function converges exponentially.
      n = coarsest
      total = 0.0_wp
      do i = 0, n - 1
         total = total + integrand(zz, ze, ee, pi*i/n)
      end do
      h = inverse_zz(total, n)
      do while (2*n <= finest)
         refined = 0.0_wp
         do i = 0, n - 1
            refined = refined + integrand(zz, ze, ee, pi*(i + 0.5_wp)/n)
         end do
         total = total + refined
         n = 2*n
         before = h
         h = inverse_zz(total, n)
         if (abs(h - before) <= 0.1_wp*tolerance*h) exit
      end do
   end function surface_compliance

   !> [B^-1]_zz/(8 pi^2) with B = total/(4 pi n), the mean of the integrand over a full turn divided by 4 pi.
   pure real(wp) function inverse_zz(total, n) result(h)
      real(wp), intent(in) :: total(3, 3)
      integer, intent(in) :: n
      real(wp) :: minor, determinant

      minor = total(1, 1)*total(2, 2) - total(1, 2)*total(2, 1)
      determinant = minor*total(3, 3) - total(1, 1)*total(2, 3)*total(3, 2) - total(2, 2)*total(1, 3)*total(3, 1) &
         & + total(1, 2)*total(2, 3)*total(3, 1) + total(2, 1)*total(3, 2)*total(1, 3)
      h = minor/determinant*(4.0_wp*pi*n)/(8.0_wp*pi**2)
   end function inverse_zz

   !> (ab)_ij = a_k C_kijl b_l.
   pure function contraction(c, a, b) result(ab)
      real(wp), intent(in) :: c(6, 6), a(3), b(3)
      real(wp) :: ab(3, 3)
      integer :: i, j, k, l

      ab = 0.0_wp
      do l = 1, 3
         do j = 1, 3
            do i = 1, 3
               do k = 1, 3
                  ab(i, j) = ab(i, j) + a(k)*c(voigt_index(k, i), voigt_index(j, l))*b(l)
               end do
            end do
         end do
      end do
   end function contraction

   !> (mm) - (mn)(nn)^-1(nm) at the angle phi of m from z.
   pure function integrand(zz, ze, ee, phi) result(f)
      real(wp), intent(in) :: zz(3, 3), ze(3, 3), ee(3, 3), phi
      real(wp) :: f(3, 3)
      real(wp) :: c, s, mm(3, 3), mn(3, 3), nn(3, 3), both(3, 3), inverse(3, 3), determinant

      c = cos(phi)
      s = sin(phi)
      both = ze + transpose(ze)
      mm = c*c*zz + s*c*both + s*s*ee
      nn = s*s*zz - s*c*both + c*c*ee
      mn = s*c*(ee - zz) + c*c*ze - s*s*transpose(ze)
      inverse(1, 1) = nn(2, 2)*nn(3, 3) - nn(2, 3)**2
      inverse(2, 2) = nn(1, 1)*nn(3, 3) - nn(1, 3)**2
      inverse(3, 3) = nn(1, 1)*nn(2, 2) - nn(1, 2)**2
      inverse(1, 2) = nn(1, 3)*nn(2, 3) - nn(1, 2)*nn(3, 3)
      inverse(1, 3) = nn(1, 2)*nn(2, 3) - nn(1, 3)*nn(2, 2)
      inverse(2, 3) = nn(1, 2)*nn(1, 3) - nn(1, 1)*nn(2, 3)
      inverse(2, 1) = inverse(1, 2)
      inverse(3, 1) = inverse(1, 3)
      inverse(3, 2) = inverse(2, 3)
      determinant = nn(1, 1)*inverse(1, 1) + nn(1, 2)*inverse(1, 2) + nn(1, 3)*inverse(1, 3)
      f = mm - matmul(mn, matmul(inverse, transpose(mn)))/determinant
   end function integrand

   !> Minimise the convex compliance over the shape (a, b) of the contact ellipse by Newton's method.
   pure subroutine fit_contact_ellipse(h, result)
      !> h at n equally spaced directions in [0, pi).
      real(wp), intent(in) :: h(:)
      type(halfspace_type), intent(out) :: result
      real(wp) :: cosine(size(h)), sine(size(h)), q(size(h)), x(2), step(2), gradient(2), hessian(2, 2)
      real(wp) :: value, trial, determinant, weight, length
      integer :: i, iteration

      weight = pi/size(h)
      do i = 1, size(h)
         cosine(i) = cos(2.0_wp*pi*(i - 1)/size(h))
         sine(i) = sin(2.0_wp*pi*(i - 1)/size(h))
      end do
      x = 0.0_wp
      value = weight*sum(h)
      result%modulus_circular = 1.0_wp/value
      do iteration = 1, 50
         q = 1.0_wp + x(1)*cosine + x(2)*sine
         gradient(1) = -0.5_wp*weight*sum(h*cosine*q**(-1.5_wp))
         gradient(2) = -0.5_wp*weight*sum(h*sine*q**(-1.5_wp))
         hessian(1, 1) = 0.75_wp*weight*sum(h*cosine**2*q**(-2.5_wp))
         hessian(1, 2) = 0.75_wp*weight*sum(h*cosine*sine*q**(-2.5_wp))
         hessian(2, 2) = 0.75_wp*weight*sum(h*sine**2*q**(-2.5_wp))
         determinant = hessian(1, 1)*hessian(2, 2) - hessian(1, 2)**2
         step(1) = -(hessian(2, 2)*gradient(1) - hessian(1, 2)*gradient(2))/determinant
         step(2) = -(hessian(1, 1)*gradient(2) - hessian(1, 2)*gradient(1))/determinant
         if (sum(step**2) < 1.0e-20_wp) exit
         length = 1.0_wp
         do
            if (sum((x + length*step)**2) < 1.0_wp) then
               trial = weight*sum(h/sqrt(1.0_wp + (x(1) + length*step(1))*cosine + (x(2) + length*step(2))*sine))
               if (trial <= value*(1.0_wp + 1.0e-15_wp)) exit
            end if
            length = 0.5_wp*length
            if (length < 1.0e-10_wp) exit
         end do
         if (length < 1.0e-10_wp) exit
         x = x + length*step
         value = trial
      end do
      result%modulus = 1.0_wp/value
      length = sqrt(sum(x**2))
      result%axis_ratio = sqrt((1.0_wp - length)/(1.0_wp + length))
      ! The weight is largest where the contact is narrowest.
      result%major_axis = modulo(0.5_wp*atan2(x(2), x(1)) + 0.5_wp*pi, pi)
   end subroutine fit_contact_ellipse
end module halfspace_theory
