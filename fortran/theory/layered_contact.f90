!> Indentation of anisotropic layers by a rigid frictionless indenter.
!>
!> The pressure on an elliptical contact is a sum of terms with the transforms 2 pi y_i
!> phi_i(kappa), phi_i = the integral of X_i(t) cos(kappa t) over t = 0 .. 1, kappa = k w, w^2 = a^2
!> cos^2 + b^2 sin^2 of the direction of k from the axes a, b. X_i = (1 - t^2)^i/(2^i i!) is the
!> pressure (1 - rho^2)^(i - 1/2), whose phi_i = j_i(kappa)/kappa^i with the spherical Bessel
!> function; under a cone the last term is X = 1 - t, arcosh(1/rho), which the tip needs.
!>
!> At a depth h the energy of pressures y is W = (h m - g).y - y.A y/2, where A y are the moments of
!> the displacement, m_i is 2 pi times the integral of X_i, and g_i that of X_i(t) d(w t), d(a) the
!> depth at which the indenter's contact on a half-space has the radius a (I. N. Sneddon, Int. J.
!> Engng Sci. 3, 47, 1965). W is stationary over y and over the shape of the ellipse, w^2 = s^2 (1 +
!> alpha cos 2 theta + beta sin 2 theta) (J. R. Willis, J. Mech. Phys. Solids 14, 163, 1966). The
!> force is dW/dh and the stiffness d2W/dh2.
!>
!> With the operator D = w d/dw, D phi_i = phi_(i-1) - (2 i + 1) phi_i; the moments of d obey the
!> same rule. For this reason phi_0 and phi_(-1) = cos(kappa) go before the terms. It follows that
!> dW/d(ln s) is a pressure times the residual of the equation of X_0, the singular pressure at the
!> edge. So that residual is what vanishes: dW/d(ln s) vanishes at another size too, and its second
!> derivative tends to 0 as terms are added.
module layered_contact
   use errors, only: error_type, raise, refuse
   use halfspace_theory, only: cos_2theta, sin_2theta
   use kinds, only: pi, wp
   use layered_compliance, only: clenshaw_curtis, compliance_type, inverse, layers_type, &
      & new_compliance
   use linear_algebra, only: dot
   use small_matrices, only: factor_definite, solve_lower, solve_upper
   use text, only: to_text
   implicit none
   private
   public :: contact_type, indent_layers, profile_type

   !> A rigid axisymmetric indenter.
   type, abstract :: profile_type
      !> Whether it ends in a cone.
      logical :: is_conical = .false.
   contains
      procedure(depth_interface), deferred :: depth_of
   end type profile_type

   abstract interface
      !> Depth at a contact radius on a half-space that is isotropic, um.
      elemental real(wp) function depth_interface(self, length)
         import
         class(profile_type), intent(in) :: self
         !> Contact radius, um.
         real(wp), intent(in) :: length
      end function depth_interface
   end interface

   !> A contact and its errors.
   type :: contact_type
      !> um, mN, mN/um.
      real(wp) :: depth = 0.0_wp, force = 0.0_wp, stiffness = 0.0_wp
      !> Radius of the circle that has the area of the contact, um.
      real(wp) :: radius = 0.0_wp
      !> Estimates of the relative errors of force, stiffness, and stiffness over radius: the sum of
      !> the differences from one term fewer, half the directions, and half the wave numbers.
      real(wp) :: error(3) = 0.0_wp
   end type contact_type

   !> Most terms, directions, wave numbers, and searches that fail.
   integer, parameter :: most_terms = 8, most_directions = 512, most_waves = 1024, most_misses = 3
   !> Change of the compliance at the end of the wave numbers, and error from half the directions or
   !> wave numbers, over the accuracy.
   real(wp), parameter :: resolution = 1.0e-3_wp, share = 0.2_wp
   !> Nodes in t: exact for polynomials of this degree. Terms of a power series.
   integer, parameter :: radial = 32, powers = 24
   !> Largest contact radius, or that on a half-space, in thicknesses of all layers, and a rounding
   !> error.
   real(wp), parameter :: thinnest = 10.0_wp*(1.0_wp + 1.0e-3_wp)
   !> Pairs of the three variables ln s, alpha, beta of the shape.
   integer, parameter :: left(6) = [1, 1, 1, 2, 2, 3], right(6) = [1, 2, 3, 2, 3, 3]

   !> Terms -1 .. n: D of a term is the one before less a factor times itself.
   type :: terms_type
      integer :: n = 0, before(0:most_terms), factor(0:most_terms)
      logical :: is_conical = .false.
      !> Nodes in t, X_i there times the weights, 2 pi times their sums, and integrals of products.
      real(wp) :: t(0:radial), x(0:radial, 0:most_terms), mean(0:most_terms), &
         & gram(0:most_terms, 0:most_terms)
      !> Factors of -kappa^2 by which the terms of the power series of phi_i follow each other.
      real(wp) :: series(powers, 0:most_terms)
   end type terms_type

   !> A, with g as the last row and column, and derivatives by the shape; rows 0 .. n + 1.
   type :: matrices_type
      real(wp), allocatable :: a(:, :), first(:, :, :), second(:, :, :)
   end type matrices_type

contains

   !> Contacts at the depths that have the contact radii `radii` on an isotropic half-space.
   pure subroutine indent_layers(layers, profile, radii, quantity, accuracy, contacts, error)
      !> Of stable materials.
      type(layers_type), intent(in) :: layers
      class(profile_type), intent(in) :: profile
      !> Ascending, um.
      real(wp), intent(in) :: radii(:)
      !> Component of `error` of a contact that is kept below the accuracy.
      integer, intent(in) :: quantity
      !> Largest relative error.
      real(wp), intent(in) :: accuracy
      type(contact_type), intent(out) :: contacts(:)
      type(error_type), allocatable, intent(out) :: error
      type(compliance_type) :: compliance
      type(terms_type) :: terms(most_terms)
      !> ln s, alpha, beta of contacts with 1, 2, .. terms at the depth before.
      real(wp) :: shapes(3, most_terms), errors(3, 3), last_step
      integer :: i, n, known, directions, waves, misses
      logical :: found, accepted, is_thin
      character(len=:), allocatable :: reason

      ! The force is corrected for the last step.
      last_step = merge(0.1_wp*sqrt(accuracy), max(0.1_wp*accuracy, 1.0e-7_wp), quantity == 1)
      terms = [(new_terms(i, profile%is_conical), i=1, most_terms)]
      shapes = 0.0_wp
      shapes(1, :) = log(radii(1))
      known = 0
      n = 2
      directions = 16
      waves = 16
      reason = ''
      call new_compliance(layers, directions, waves, resolution*accuracy, compliance)
      do i = 1, size(radii)
         ! The transforms oscillate over the range of wave numbers.
         waves = max(waves, &
            & 2**ceiling(log(0.35_wp*maxval(compliance%range)*radii(i))/log(2.0_wp)))
         shapes(1, :) = shapes(1, :) + log(radii(i)/radii(max(1, i - 1)))
         misses = 0
         accepted = .false.
         do
            ! Contacts on films stiffer than the base are narrower than on a half-space.
            is_thin = max(0.5_wp*radii(i), min(radii(i), contacts(i)%radius)) &
               & > thinnest*sum(layers%thickness)
            if (is_thin) then
               reason = 'it is wider than '//to_text(thinnest, 3)//' thicknesses'
            else if (n > most_terms) then
               reason = 'its pressure is too uneven for '//to_text(most_terms)//' terms'
            else if (misses > most_misses) then
               reason = 'no elliptical one was found'
            else if (directions > most_directions .or. waves > most_waves) then
               reason = 'it does not converge, as near elastic instability or where layers bend ' &
                  & //'away from the indenter'
            end if
            if (len(reason) > 0) then
               reason = 'the contact of radius '//to_text(radii(i), 3)//' um on layers ' &
                  & //to_text(sum(layers%thickness), 3)//' um thick is beyond the theory: '//reason
               ! The thickness and the indenter are stated; the crystal may be one of many.
               if (is_thin) call refuse(error, reason, 'specimen')
               if (.not. is_thin) call raise(error, reason)
               return
            end if
            if (accepted) exit
            if (directions > size(compliance%short) &
               & .or. waves > ubound(compliance%change, 1)) then
               call new_compliance(layers, directions, waves, resolution*accuracy, compliance)
            end if
            call find_contact(compliance, profile, terms(:n), radii(i), last_step, shapes, known, &
               & contacts(i), errors, found)
            contacts(i)%error = sum(errors, dim=2)
            if (.not. found) then
               misses = misses + 1
               waves = 2*waves
               cycle
            end if
            accepted = contacts(i)%error(quantity) <= accuracy
            if (accepted) cycle
            ! Coarse nodes falsify the pressures too.
            associate (own => errors(quantity, :))
               if (own(1) > own(2) + own(3)) then
                  n = n + 1
               else
                  if (own(2) > share*accuracy) directions = 2*directions
                  if (own(3) > share*accuracy) waves = 2*waves
               end if
            end associate
         end do
      end do
   end subroutine indent_layers

   !> The contact at one depth with its errors.
   pure subroutine find_contact(compliance, profile, terms, radius, last_step, shapes, known, &
      & contact, errors, found)
      type(compliance_type), intent(in) :: compliance
      class(profile_type), intent(in) :: profile
      !> Of 1, 2, .. terms.
      type(terms_type), intent(in) :: terms(:)
      real(wp), intent(in) :: radius, last_step
      !> ln s, alpha, beta for 1, 2, .. terms: guesses on entry, those of the first `known` terms
      !> from a smaller depth.
      real(wp), intent(inout) :: shapes(:, :)
      integer, intent(inout) :: known
      type(contact_type), intent(out) :: contact
      !> Of a quantity from terms, directions, wave numbers.
      real(wp), intent(out) :: errors(3, 3)
      logical, intent(out) :: found
      type(contact_type) :: other
      real(wp) :: shape(3), guess(3), change(3)
      integer :: n, half

      errors = 0.0_wp
      contact%depth = profile%depth_of(radius)
      change = 0.0_wp
      shape = shapes(:, 1)
      associate (last => size(terms))
         do n = max(1, min(known, last - 1)), last
            other = contact
            ! A contact with one term more has changed since the depth before as this one has.
            if (n <= known) shape = shapes(:, n) + change
            ! Half the nodes serve for a start.
            half = merge(2, 1, n < last - 1)
            call continue_contact(compliance, profile, terms(n), half, half, last_step, shape, &
               & contact, found)
            if (.not. found) return
            change = shape - shapes(:, n)
            shapes(:, n) = shape
            known = max(known, n)
         end do
         errors(:, 1) = difference(contact, other)
         do n = 2, 3
            guess = shape
            call continue_contact(compliance, profile, terms(last), merge(2, 1, n == 2), &
               & merge(2, 1, n == 3), huge(1.0_wp), guess, other, found)
            if (.not. found) return
            errors(:, n) = difference(contact, other)
         end do
      end associate
   end subroutine find_contact

   !> Relative differences of force, stiffness, and stiffness over radius.
   pure function difference(contact, other)
      type(contact_type), intent(in) :: contact, other
      real(wp) :: difference(3)

      difference = abs([other%force/contact%force, other%stiffness/contact%stiffness, &
         & other%stiffness/other%radius*contact%radius/contact%stiffness] - 1.0_wp)
      where (.not. difference < 1.0_wp) difference = 1.0_wp
   end function difference

   !> Terms of the pressure.
   pure type(terms_type) function new_terms(n, is_conical) result(terms)
      integer, intent(in) :: n
      logical, intent(in) :: is_conical
      real(wp) :: weight(0:radial)
      integer :: i, k

      terms%n = n
      terms%is_conical = is_conical
      terms%t = [(sin(0.5_wp*pi*k/radial)**2, k=0, radial)]
      terms%x(:, 0) = 1.0_wp
      do i = 0, n
         terms%before(i) = i - 1
         terms%factor(i) = 2*i + 1
         terms%series(:, i) = [(0.5_wp/(k*(2*i + 2*k + 1)), k=1, powers)]
         if (i > 0) terms%x(:, i) = terms%x(:, i - 1)*(1.0_wp - terms%t**2)/(2.0_wp*i)
      end do
      if (is_conical) then
         terms%before(n) = 0
         terms%factor(n) = 2
         terms%x(:, n) = 1.0_wp - terms%t
      end if
      weight = clenshaw_curtis(radial)
      do i = 0, n
         terms%gram(:n, i) = matmul(weight*terms%x(:, i), terms%x(:, :n))
      end do
      do i = 0, n
         terms%x(:, i) = weight*terms%x(:, i)
         terms%mean(i) = 2.0_wp*pi*sum(terms%x(:, i))
      end do
   end function new_terms

   !> Newton's method for the contact with one number of terms.
   pure subroutine continue_contact(compliance, profile, terms, coarse, stride, last_step, shape, &
      & contact, found)
      type(compliance_type), intent(in) :: compliance
      class(profile_type), intent(in) :: profile
      type(terms_type), intent(in) :: terms
      !> 2 for half the directions, 2 for half the wave numbers, else 1.
      integer, intent(in) :: coarse, stride
      !> The first step that is not longer ends the search.
      real(wp), intent(in) :: last_step
      !> ln s, alpha, beta; a guess on entry.
      real(wp), intent(inout) :: shape(3)
      !> Its depth is that of the contact on entry.
      type(contact_type), intent(inout) :: contact
      logical, intent(out) :: found
      !> Longest first step, and largest eccentricity of the ellipse.
      real(wp), parameter :: first_step = 0.3_wp, flattest = 0.95_wp
      integer, parameter :: most_steps = 40
      type(matrices_type) :: matrices
      real(wp) :: residual(3), jacobian(3, 3), drift(3), force(3), step(3), before(3), longest
      integer :: k

      before = 0.0_wp
      longest = first_step
      do k = 1, most_steps
         call integrate(compliance, profile, terms, coarse, stride, shape, matrices)
         call find_equations(contact, residual, jacobian, drift, force, found)
         if (.not. found) return
         jacobian = real(inverse(cmplx(jacobian, kind=wp)))
         contact%stiffness = contact%stiffness - sum(force*matmul(jacobian, drift))
         step = -matmul(jacobian, residual)
         found = all(abs(step) < huge(step))
         if (.not. found) return
         if (sum(step*before) < 0.0_wp) longest = 0.5_wp*min(longest, maxval(abs(before)))
         step = step*min(1.0_wp, longest/maxval(abs(step)))
         do while (norm2(shape(2:) + step(2:)) > flattest)
            step = 0.5_wp*step
         end do
         if (maxval(abs(step)) <= last_step) then
            contact%force = contact%force + sum(force*step)
            call find_radius(contact)
            shape = shape + step
            return
         end if
         shape = shape + step
         before = step
      end do
      found = .false.

   contains

      !> The three equations of the shape, and their derivatives by the shape and by the depth;
      !> force and stiffness at a fixed shape, and derivatives of the force by the shape.
      pure subroutine find_equations(contact, residual, jacobian, drift, force, found)
         type(contact_type), intent(inout) :: contact
         real(wp), intent(out) :: residual(3), jacobian(3, 3), drift(3), force(3)
         !> Whether the compliance is positive.
         logical, intent(out) :: found
         !> Residuals, the product A^-1 of what a name says, and the pressures with a last one of 1.
         real(wp) :: l(terms%n, terms%n), rest(0:terms%n + 1, 3), mean(terms%n), edge(terms%n), &
            & y(0:terms%n + 1)
         integer :: i

         residual = 0.0_wp
         jacobian = 0.0_wp
         drift = 0.0_wp
         force = 0.0_wp
         associate (n => terms%n, a => matrices%a)
            l = a(1:n, 1:n)
            call factor_definite(l, 0.0_wp, found)
            if (.not. found) return
            y(0) = 0.0_wp
            y(1:n) = contact%depth*terms%mean(1:n) - a(1:n, n + 1)
            y(n + 1) = 1.0_wp
            call solve_lower(l, y(1:n))
            call solve_upper(l, y(1:n))
            mean = terms%mean(1:n)
            edge = a(1:n, 0)
            contact%force = sum(mean*y(1:n))
            residual(1) = contact%depth*terms%mean(0) - sum(a(:, 0)*y)
            call solve_lower(l, mean)
            call solve_lower(l, edge)
            do i = 1, 3
               rest(:, i) = -matmul(matrices%first(:, :, i), y)
               if (i > 1) residual(i) = 0.5_wp*sum(rest(:, i)*y)
               call solve_lower(l, rest(1:n, i))
            end do
            contact%stiffness = sum(mean**2)
            force = matmul(mean, rest(1:n, :))
            drift = [terms%mean(0) - sum(edge*mean), force(2:)]
            do i = 1, size(left)
               jacobian(right(i), left(i)) = sum(rest(1:n, left(i))*rest(1:n, right(i))) &
                  & - 0.5_wp*sum(y*matmul(matrices%second(:, :, i), y))
            end do
            jacobian(2, 3) = jacobian(3, 2)
            jacobian(1, :) = rest(0, :) - matmul(edge, rest(1:n, :))
         end associate
      end subroutine find_equations

      !> Radius of a contact. The stiffness of a flat punch that has the shape of the contact is
      !> that of the contact, and of all quantities it depends most on the size.
      pure subroutine find_radius(contact)
         type(contact_type), intent(inout) :: contact
         real(wp), dimension(0:terms%n, 0:terms%n) :: l, slope
         real(wp) :: y(0:terms%n), growth

         associate (n => terms%n)
            l = matrices%a(:n, :n)
            slope = matrices%first(:n, :n, 1)
            call factor_definite(l, 0.0_wp)
            y = terms%mean(:n)
            call solve_lower(l, y)
            call solve_upper(l, y)
            growth = (sum(terms%mean(:n)*y) - contact%stiffness)/sum(y*matmul(slope, y))
            growth = max(-1.0_wp, min(1.0_wp, growth))
            contact%radius = exp(shape(1) + growth)*(1.0_wp - sum(shape(2:)**2))**0.25_wp
         end associate
      end subroutine find_radius
   end subroutine continue_contact

   !> Integrals over directions and wave numbers.
   pure subroutine integrate(compliance, profile, terms, coarse, stride, shape, matrices)
      type(compliance_type), intent(in) :: compliance
      class(profile_type), intent(in) :: profile
      type(terms_type), intent(in) :: terms
      !> See `continue_contact`.
      integer, intent(in) :: coarse, stride
      real(wp), intent(in) :: shape(3)
      type(matrices_type), intent(out) :: matrices
      !> Integrals of products of the transforms, the last row and column the moments of d; D of one
      !> factor, then of it again.
      real(wp), dimension(-1:terms%n + 1, -1:terms%n + 1) :: b, db, ddb
      real(wp), dimension(0:terms%n + 1, 0:terms%n + 1) :: half, first, second
      real(wp) :: phi(0:ubound(compliance%change, 1)/stride, -1:terms%n), &
         & weighted(0:ubound(compliance%change, 1)/stride), angle, v, w, slope(3), bend(3)
      integer :: n, i, j, k, directions

      n = terms%n
      directions = size(compliance%short)/coarse
      angle = 2.0_wp*pi/directions
      allocate (matrices%a(0:n + 1, 0:n + 1), matrices%first(0:n + 1, 0:n + 1, 3), &
         & matrices%second(0:n + 1, 0:n + 1, 6), source=0.0_wp)
      b = 0.0_wp
      db = 0.0_wp
      ddb = 0.0_wp
      half = 0.0_wp
      do j = 1, directions
         v = 1.0_wp + shape(2)*cos_2theta(j) + shape(3)*sin_2theta(j)
         w = exp(shape(1))*sqrt(v)
         ! Derivatives of ln w by the shape; the second ones are -2 bend bend.
         bend = [0.0_wp, 0.5_wp*cos_2theta(j)/v, 0.5_wp*sin_2theta(j)/v]
         slope = bend + [1.0_wp, 0.0_wp, 0.0_wp]
         call transform(terms, w*compliance%wave_number(::stride, j), phi)
         do k = -1, n
            weighted = compliance%weight(::stride, stride)*compliance%change(::stride, j)*phi(:, k)
            do i = k, n
               b(i, k) = angle*compliance%range(j)*dot(weighted, phi(:, i))
               b(k, i) = b(i, k)
            end do
         end do
         b(-1, n + 1) = angle*profile%depth_of(w)
         b(0:n, n + 1) = angle*matmul(profile%depth_of(w*terms%t), terms%x(:, :n))
         b(n + 1, :n) = b(:n, n + 1)
         do i = 0, n
            db(i, :) = b(terms%before(i), :) - terms%factor(i)*b(i, :)
         end do
         do i = 1, n
            ddb(i, :) = db(terms%before(i), :) - terms%factor(i)*db(i, :)
         end do
         half(:n, :n) = 0.5_wp*pi*angle*compliance%short(j)/w*terms%gram(:n, :n)
         first = db(0:, 0:) + transpose(db(0:, 0:)) - half
         second = ddb(0:, 0:) + transpose(ddb(0:, 0:)) + half
         do k = 0, n
            second(:, k) = second(:, k) &
               & + 2.0_wp*(db(0:, terms%before(k)) - terms%factor(k)*db(0:, k))
         end do
         matrices%a = matrices%a + b(0:, 0:) + half
         do i = 1, 3
            matrices%first(:, :, i) = matrices%first(:, :, i) + slope(i)*first
         end do
         do i = 1, size(left)
            matrices%second(:, :, i) = matrices%second(:, :, i) &
               & + slope(left(i))*slope(right(i))*second - 2.0_wp*bend(left(i))*bend(right(i))*first
         end do
      end do
   end subroutine integrate

   !> The transforms phi_(-1), phi_0, .. of the terms.
   pure subroutine transform(terms, kappa, phi)
      type(terms_type), intent(in) :: terms
      !> Ascending from 0.
      real(wp), intent(in), contiguous :: kappa(:)
      !> (wave numbers, -1:terms).
      real(wp), intent(out), contiguous :: phi(:, -1:)
      real(wp) :: square(size(kappa)), inverse(size(kappa))
      integer :: n, i, k, m

      n = terms%n
      square = kappa**2
      phi(:, -1) = cos(kappa)
      ! The last two by their power series, and recurrence downwards.
      k = count(kappa <= n + 1.0_wp)
      phi(:k, n - 1:n) = 1.0_wp
      do m = min(powers, 10 + 2*n), 1, -1
         do i = n - 1, n
            phi(:k, i) = 1.0_wp - terms%series(m, i)*square(:k)*phi(:k, i)
         end do
      end do
      phi(:k, n - 1) = phi(:k, n - 1)/product([(2.0_wp*i + 1.0_wp, i=1, n - 1)])
      phi(:k, n) = phi(:k, n)/product([(2.0_wp*i + 1.0_wp, i=1, n)])
      do i = n - 1, 1, -1
         phi(:k, i - 1) = (2*i + 1)*phi(:k, i) - square(:k)*phi(:k, i + 1)
      end do
      ! Recurrence upwards is stable from there on.
      inverse(k + 1:) = 1.0_wp/square(k + 1:)
      phi(k + 1:, 0) = sin(kappa(k + 1:))/kappa(k + 1:)
      do i = 1, n
         phi(k + 1:, i) = ((2*i - 1)*phi(k + 1:, i - 1) - phi(k + 1:, i - 2))*inverse(k + 1:)
      end do
      if (terms%is_conical) then
         phi(1, n) = 0.5_wp
         phi(2:, n) = 2.0_wp*(sin(0.5_wp*kappa(2:))/kappa(2:))**2
      end if
   end subroutine transform
end module layered_contact
