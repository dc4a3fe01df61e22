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
   public :: halfspace_type, halfspace_modulus, inverse_barnett

   !> What the theory says of one crystal under the indenter.
   type :: halfspace_type
      !> Exact (elliptical contact) and circular-contact (Vlassak-Nix) modulus, GPa.
      real(wp) :: modulus = 0.0_wp, modulus_circular = 0.0_wp
      !> The contact's minor over major axis, and the direction of the major axis from sample x, radians in [0, pi).
      real(wp) :: axis_ratio = 1.0_wp, major_axis = 0.0_wp
   end type halfspace_type

   !> Relative change on doubling an angular grid below which the finer one is accepted. The trapezoid rule converges
   !> exponentially on these periodic integrands, so that the error left is about the square of the change.
   real(wp), parameter :: tolerance = 1.0e-5_wp
   integer, parameter :: coarsest = 16, finest = 4096

   integer :: k
   !> Cosines and sines of the angles pi k/16 (first column) and those half-way between, which suffice for most crystals.
   real(wp), parameter :: cosines(coarsest, 2) = &
      & reshape([(cos(pi*k/coarsest), k=0, coarsest - 1), (cos(pi*(k + 0.5_wp)/coarsest), k=0, coarsest - 1)], [coarsest, 2])
   real(wp), parameter :: sines(coarsest, 2) = &
      & reshape([(sin(pi*k/coarsest), k=0, coarsest - 1), (sin(pi*(k + 0.5_wp)/coarsest), k=0, coarsest - 1)], [coarsest, 2])

   !> The contractions (ab)_ij = a_k C_kijl b_l of a stiffness with the sample axes.
   type :: contractions_type
      real(wp) :: xx(3, 3), xy(3, 3), yy(3, 3), zx(3, 3), zy(3, 3), zz(3, 3)
   end type contractions_type

contains

   !> Indentation modulus along sample -z of the crystal `c` (GPa, crystal frame) at Bunge-Euler angles `euler` (radians).
   pure subroutine halfspace_modulus(c, euler, result, error)
      real(wp), intent(in) :: c(6, 6), euler(3)
      type(halfspace_type), intent(out) :: result
      type(error_type), allocatable, intent(out) :: error
      type(contractions_type) :: contractions
      real(wp) :: previous, compliance(finest)
      integer :: n, i

      call check_stiffness(c, error)
      if (allocated(error)) return
      contractions = new_contractions(rotate_stiffness(c, rotation_matrix(euler)))
      n = coarsest
      do i = 1, n
         compliance(i) = surface_compliance(contractions, pi*(i - 1)/n)
      end do
      call fit_contact_ellipse(compliance(:n), result)
      do while (2*n <= finest)
         previous = result%modulus
         ! Old points become the odd ones of the finer grid.
         do i = n, 1, -1
            compliance(2*i - 1) = compliance(i)
         end do
         n = 2*n
         do i = 2, n, 2
            compliance(i) = surface_compliance(contractions, pi*(i - 1)/n)
         end do
         call fit_contact_ellipse(compliance(:n), result)
         if (abs(result%modulus - previous) <= tolerance*result%modulus) return
      end do
      call raise(error, 'the surface Green''s function of a nearly unstable crystal did not converge on ' &
         & //to_text(finest)//' directions')
   end subroutine halfspace_modulus

   !> h(theta) of u_z = h/r for a unit normal point force, 1/GPa; theta is the direction from sample x in the surface.
   pure real(wp) function surface_compliance(c, theta) result(h)
      type(contractions_type), intent(in) :: c
      real(wp), intent(in) :: theta
      real(wp) :: ze(3, 3), ee(3, 3), total(6), e(2), before
      real(wp), allocatable :: phi(:)
      integer :: n, i

      ! m and n turn in the plane perpendicular to t = (cos theta, sin theta, 0), which z and e = (sin, -cos, 0) span.
      e = [sin(theta), -cos(theta)]
      ze = c%zx*e(1) + c%zy*e(2)
      ee = c%xx*e(1)**2 + (c%xy + transpose(c%xy))*(e(1)*e(2)) + c%yy*e(2)**2
      ! The integrand repeats after pi.
      n = coarsest
      total = integrand_sum(c%zz, ze, ee, cosines(:, 1), sines(:, 1))
      h = inverse_zz(total, n)
      do while (2*n <= finest)
         if (n == coarsest) then
            total = total + integrand_sum(c%zz, ze, ee, cosines(:, 2), sines(:, 2))
         else
            phi = pi*([(i, i=1, n)] - 0.5_wp)/n
            total = total + integrand_sum(c%zz, ze, ee, cos(phi), sin(phi))
         end if
         n = 2*n
         before = h
         h = inverse_zz(total, n)
         if (abs(h - before) <= tolerance*h) exit
      end do
   end function surface_compliance

   !> B^-1(t)/(8 pi^2) of a crystal, 1/GPa, components 11, 22, 33, 23, 13, 12 in crystal axes.
   pure function inverse_barnett(c, t) result(f)
      !> Stiffness in crystal axes, GPa; unit vector in crystal axes.
      real(wp), intent(in) :: c(6, 6), t(3)
      real(wp) :: f(6)
      real(wp) :: first(3), second(3), mm(3, 3), mn(3, 3), nn(3, 3), left(6, 3), right(6, 3), half(6, 3)
      real(wp) :: total(6), before(6), minor(6), determinant
      real(wp), allocatable :: phi(:)
      integer :: n, i

      ! Two unit vectors perpendicular to t, from the coordinate axis that is farthest from it.
      first = 0.0_wp
      first(minloc(abs(t), 1)) = 1.0_wp
      first = first - dot_product(first, t)*t
      first = first/norm2(first)
      second = [t(2)*first(3) - t(3)*first(2), t(3)*first(1) - t(1)*first(3), t(1)*first(2) - t(2)*first(1)]
      left = contraction_matrix(first)
      right = contraction_matrix(second)
      half = matmul(c, right)
      mn = matmul(transpose(left), half)
      nn = matmul(transpose(right), half)
      mm = matmul(transpose(left), matmul(c, left))
      n = coarsest
      total = integrand_sum(mm, mn, nn, cosines(:, 1), sines(:, 1))
      do while (2*n <= finest)
         before = total/n
         if (n == coarsest) then
            total = total + integrand_sum(mm, mn, nn, cosines(:, 2), sines(:, 2))
         else
            phi = pi*([(i, i=1, n)] - 0.5_wp)/n
            total = total + integrand_sum(mm, mn, nn, cos(phi), sin(phi))
         end if
         n = 2*n
         if (all(abs(total/n - before) <= tolerance*maxval(abs(before)))) exit
      end do
      minor = [total(2)*total(3) - total(4)**2, total(1)*total(3) - total(5)**2, total(1)*total(2) - total(6)**2, &
         & total(6)*total(5) - total(1)*total(4), total(6)*total(4) - total(2)*total(5), total(4)*total(5) - total(6)*total(3)]
      determinant = total(1)*minor(1) + total(6)*minor(6) + total(5)*minor(5)
      f = minor/determinant*n/(2.0_wp*pi)
   end function inverse_barnett

   !> The 6 x 3 matrix A of a direction a such that the contraction (ab) is A(a)^T C A(b).
   pure function contraction_matrix(a) result(matrix)
      real(wp), intent(in) :: a(3)
      real(wp) :: matrix(6, 3)

      matrix = reshape([a(1), 0.0_wp, 0.0_wp, 0.0_wp, a(3), a(2), 0.0_wp, a(2), 0.0_wp, a(3), 0.0_wp, a(1), &
         & 0.0_wp, 0.0_wp, a(3), a(2), a(1), 0.0_wp], [6, 3])
   end function contraction_matrix

   !> [B^-1]_zz/(8 pi^2), with B the mean of the integrand over a full turn, divided by 4 pi; `total` holds the sum of the
   !> components 11, 22, 33, 23, 13, 12 over n angles.
   pure real(wp) function inverse_zz(total, n) result(h)
      real(wp), intent(in) :: total(6)
      integer, intent(in) :: n
      real(wp) :: minor, determinant

      minor = total(1)*total(2) - total(6)**2
      determinant = minor*total(3) - total(1)*total(4)**2 - total(2)*total(5)**2 + 2.0_wp*total(4)*total(5)*total(6)
      h = minor/determinant*n/(2.0_wp*pi)
   end function inverse_zz

   pure function new_contractions(c) result(self)
      !> Stiffness in the sample frame, GPa.
      real(wp), intent(in) :: c(6, 6)
      type(contractions_type) :: self

      self%xx = contraction(c, 1, 1)
      self%xy = contraction(c, 1, 2)
      self%yy = contraction(c, 2, 2)
      self%zx = contraction(c, 3, 1)
      self%zy = contraction(c, 3, 2)
      self%zz = contraction(c, 3, 3)
   end function new_contractions

   pure function contraction(c, a, b) result(ab)
      real(wp), intent(in) :: c(6, 6)
      integer, intent(in) :: a, b
      real(wp) :: ab(3, 3)
      integer :: i, j

      do j = 1, 3
         do i = 1, 3
            ab(i, j) = c(voigt_index(a, i), voigt_index(j, b))
         end do
      end do
   end function contraction

   !> Sum of (mm) - (mn)(nn)^-1(nm), components 11, 22, 33, 23, 13, 12, over angles of m from z given by their
   !> cosines and sines. Written out by components, so that the angles fill the vector units.
   pure function integrand_sum(zz, ze, ee, c, s) result(total)
      real(wp), intent(in) :: zz(3, 3), ze(3, 3), ee(3, 3)
      real(wp), intent(in), contiguous :: c(:), s(:)
      real(wp) :: total(6)
      real(wp) :: both(3, 3), difference(3, 3), cc, cs, ss, determinant
      real(wp) :: n11, n22, n33, n23, n13, n12, i11, i22, i33, i23, i13, i12
      real(wp) :: a11, a12, a13, a21, a22, a23, a31, a32, a33, b11, b12, b13, b21, b22, b23, b31, b32, b33
      real(wp) :: t11, t22, t33, t23, t13, t12
      integer :: i

      both = ze + transpose(ze)
      difference = ee - zz
      t11 = 0.0_wp
      t22 = 0.0_wp
      t33 = 0.0_wp
      t23 = 0.0_wp
      t13 = 0.0_wp
      t12 = 0.0_wp
      !$omp simd reduction(+: t11, t22, t33, t23, t13, t12)
      do i = 1, size(c)
         cc = c(i)*c(i)
         cs = c(i)*s(i)
         ss = s(i)*s(i)
         ! (nn) and the adjugate of it.
         n11 = ss*zz(1, 1) - cs*both(1, 1) + cc*ee(1, 1)
         n22 = ss*zz(2, 2) - cs*both(2, 2) + cc*ee(2, 2)
         n33 = ss*zz(3, 3) - cs*both(3, 3) + cc*ee(3, 3)
         n23 = ss*zz(2, 3) - cs*both(2, 3) + cc*ee(2, 3)
         n13 = ss*zz(1, 3) - cs*both(1, 3) + cc*ee(1, 3)
         n12 = ss*zz(1, 2) - cs*both(1, 2) + cc*ee(1, 2)
         i11 = n22*n33 - n23*n23
         i22 = n11*n33 - n13*n13
         i33 = n11*n22 - n12*n12
         i12 = n13*n23 - n12*n33
         i13 = n12*n23 - n13*n22
         i23 = n12*n13 - n11*n23
         determinant = 1.0_wp/(n11*i11 + n12*i12 + n13*i13)
         ! a = (mn), b = (mn)(nn)^-1.
         a11 = cs*difference(1, 1) + cc*ze(1, 1) - ss*ze(1, 1)
         a12 = cs*difference(1, 2) + cc*ze(1, 2) - ss*ze(2, 1)
         a13 = cs*difference(1, 3) + cc*ze(1, 3) - ss*ze(3, 1)
         a21 = cs*difference(2, 1) + cc*ze(2, 1) - ss*ze(1, 2)
         a22 = cs*difference(2, 2) + cc*ze(2, 2) - ss*ze(2, 2)
         a23 = cs*difference(2, 3) + cc*ze(2, 3) - ss*ze(3, 2)
         a31 = cs*difference(3, 1) + cc*ze(3, 1) - ss*ze(1, 3)
         a32 = cs*difference(3, 2) + cc*ze(3, 2) - ss*ze(2, 3)
         a33 = cs*difference(3, 3) + cc*ze(3, 3) - ss*ze(3, 3)
         b11 = determinant*(a11*i11 + a12*i12 + a13*i13)
         b12 = determinant*(a11*i12 + a12*i22 + a13*i23)
         b13 = determinant*(a11*i13 + a12*i23 + a13*i33)
         b21 = determinant*(a21*i11 + a22*i12 + a23*i13)
         b22 = determinant*(a21*i12 + a22*i22 + a23*i23)
         b23 = determinant*(a21*i13 + a22*i23 + a23*i33)
         b31 = determinant*(a31*i11 + a32*i12 + a33*i13)
         b32 = determinant*(a31*i12 + a32*i22 + a33*i23)
         b33 = determinant*(a31*i13 + a32*i23 + a33*i33)
         t11 = t11 + cc*zz(1, 1) + cs*both(1, 1) + ss*ee(1, 1) - (b11*a11 + b12*a12 + b13*a13)
         t22 = t22 + cc*zz(2, 2) + cs*both(2, 2) + ss*ee(2, 2) - (b21*a21 + b22*a22 + b23*a23)
         t33 = t33 + cc*zz(3, 3) + cs*both(3, 3) + ss*ee(3, 3) - (b31*a31 + b32*a32 + b33*a33)
         t23 = t23 + cc*zz(2, 3) + cs*both(2, 3) + ss*ee(2, 3) - (b21*a31 + b22*a32 + b23*a33)
         t13 = t13 + cc*zz(1, 3) + cs*both(1, 3) + ss*ee(1, 3) - (b11*a31 + b12*a32 + b13*a33)
         t12 = t12 + cc*zz(1, 2) + cs*both(1, 2) + ss*ee(1, 2) - (b11*a21 + b12*a22 + b13*a23)
      end do
      total = [t11, t22, t33, t23, t13, t12]
   end function integrand_sum

   !> Minimise the convex compliance over the shape (a, b) of the contact ellipse by Newton's method.
   pure subroutine fit_contact_ellipse(h, result)
      !> h at n equally spaced directions in [0, pi).
      real(wp), intent(in) :: h(:)
      type(halfspace_type), intent(out) :: result
      real(wp) :: cosine(size(h)), sine(size(h)), r(size(h)), x(2), step(2), gradient(2), hessian(2, 2)
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
         r = 1.0_wp/sqrt(1.0_wp + x(1)*cosine + x(2)*sine)
         gradient(1) = -0.5_wp*weight*sum(h*cosine*r**3)
         gradient(2) = -0.5_wp*weight*sum(h*sine*r**3)
         hessian(1, 1) = 0.75_wp*weight*sum(h*cosine**2*r**5)
         hessian(1, 2) = 0.75_wp*weight*sum(h*cosine*sine*r**5)
         hessian(2, 2) = 0.75_wp*weight*sum(h*sine**2*r**5)
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
