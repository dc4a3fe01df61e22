!> Indentation of anisotropic layers by a rigid frictionless indenter.
!>
!> The pressure on an elliptical contact is a sum of terms with the transforms 2 pi y_i phi_i(kappa),
!> phi_i = the integral of X_i(t) cos(kappa t) over t = 0 .. 1, kappa = k w, w^2 = a^2 cos^2 + b^2
!> sin^2 of the direction of k from the axes a, b. X_i = (1 - t^2)^i/(2^i i!) is the pressure
!> (1 - rho^2)^(i - 1/2), whose phi_i = j_i(kappa)/kappa^i with the spherical Bessel function; under
!> a cone the last term is X = 1 - t, arcosh(1/rho), which the tip needs.
!>
!> At a depth h the energy of pressures y is W = g.y - y.A y/2, where A y are the mean displacements
!> and g those of the indenter: its moments are those of X_i(t) (h - d(w t)), d(a) the depth at which
!> its contact on a half-space has the radius a (I. N. Sneddon, Int. J. Engng Sci. 3, 47, 1965). W is
!> a maximum over y. Over the shape of the ellipse, w^2 = s^2 (1 + alpha cos 2 theta + beta sin 2
!> theta), it is a maximum for one term, which turns into an inflection as terms are added (J. R.
!> Willis, J. Mech. Phys. Solids 14, 163, 1966; for one term). So the stationary point is followed
!> from one term on, by Newton's method for log W. The force is dW/dh and the stiffness d2W/dh2.
!>
!> With the operator D = w d/dw, D phi_i = phi_(i-1) - (2 i + 1) phi_i; the moments of d obey the
!> same rule. For this reason phi_0 and phi_(-1) = cos(kappa) go before the terms.
module layered_contact
   use errors, only: error_type, raise, refuse
   use halfspace_theory, only: cos_2theta, sin_2theta
   use kinds, only: pi, wp
   use layered_compliance, only: clenshaw_curtis, compliance_type, layers_type, new_compliance
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
         import :: profile_type, wp
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

   !> Most terms, directions and wave numbers; first directions; most searches that fail.
   integer, parameter :: most_terms = 8, most_directions = 512, most_waves = 1024, &
      & first_directions = 16, most_misses = 3
   !> Change of the compliance at the end of the wave numbers, over the accuracy.
   real(wp), parameter :: resolution = 1.0e-3_wp
   !> Nodes in t: exact for polynomials of this degree. Terms of a power series.
   integer, parameter :: radial = 32, powers = 24
   !> Largest contact radius, or that on a half-space, in thicknesses of all layers, and a rounding
   !> error.
   real(wp), parameter :: thinnest = 10.0_wp*(1.0_wp + 1.0e-3_wp)
   !> Pairs of the three variables ln s, alpha, beta of the shape.
   integer, parameter :: left(6) = [1, 1, 1, 2, 2, 3], right(6) = [1, 2, 3, 2, 3, 3]

   !> Terms -1 .. n: D of a term is the one before less a factor times itself.
   type :: terms_type
      integer :: n = 0, before(-1:most_terms), factor(-1:most_terms)
      logical :: is_conical = .false.
      !> Nodes in t, X_i there times the weights, and integrals of products.
      real(wp) :: t(0:radial), x(0:radial, 0:most_terms), gram(0:most_terms, 0:most_terms)
      !> Factors of -kappa^2 by which the terms of the power series of phi_i follow each other.
      real(wp) :: series(powers, 0:most_terms)
   end type terms_type

   !> Integrals of the energy, with their derivatives by the shape.
   type :: integrals_type
      real(wp) :: a(0:most_terms, 0:most_terms) = 0.0_wp, &
         & a1(0:most_terms, 0:most_terms, 3) = 0.0_wp, a2(0:most_terms, 0:most_terms, 6) = 0.0_wp
      real(wp) :: g(0:most_terms) = 0.0_wp, g1(0:most_terms, 3) = 0.0_wp, &
         & g2(0:most_terms, 6) = 0.0_wp
   end type integrals_type

   !> Terms of the pressure, directions and wave numbers in use.
   type :: fineness_type
      integer :: terms = 2, directions = first_directions, waves = 16
   end type fineness_type

   !> Contacts with 1, 2, .. terms to continue from: ln s less that on a half-space, alpha, beta.
   type :: history_type
      integer :: known = 0
      real(wp) :: shape(3, most_terms) = 0.0_wp
   end type history_type

contains

   !> Contacts at the depths that have the contact radii `radii` on an isotropic half-space.
   pure subroutine indent_layers(layers, profile, radii, quantity, accuracy, contacts, error)
      !> Of stable materials.
      type(layers_type), intent(in) :: layers
      class(profile_type), intent(in) :: profile
      !> Ascending, um.
      real(wp), intent(in) :: radii(:)
      !> Largest accepted error of this component of `error`.
      integer, intent(in) :: quantity
      real(wp), intent(in) :: accuracy
      type(contact_type), intent(out) :: contacts(:)
      type(error_type), allocatable, intent(out) :: error
      type(compliance_type) :: compliance
      type(fineness_type) :: fine
      type(terms_type) :: terms(most_terms)
      type(history_type) :: history
      real(wp) :: errors(3, 3), last_step
      integer :: i, misses
      logical :: found

      last_step = max(0.1_wp*accuracy, 1.0e-7_wp)
      ! The force is corrected for the last step.
      if (quantity == 1) last_step = 0.1_wp*sqrt(accuracy)
      terms = [(new_terms(i, profile%is_conical), i=1, most_terms)]
      ! Contacts on films stiffer than the base are narrower than on a half-space.
      call check_thickness(layers, 0.5_wp*maxval(radii), error)
      if (allocated(error)) return
      call new_compliance(layers, fine%directions, 2*fine%waves, resolution*accuracy, compliance)
      do i = 1, size(radii)
         ! The transforms oscillate over the range of wave numbers.
         fine%waves = max(fine%waves, &
            & 2**ceiling(log(0.35_wp*maxval(compliance%range)*radii(i))/log(2.0_wp)))
         misses = 0
         do
            if (fine%directions > most_directions .or. fine%waves > most_waves &
               & .or. fine%terms > most_terms .or. misses > most_misses) then
               call raise_inaccurate(layers, radii(i), fine, misses, error)
               return
            end if
            if (fine%directions > size(compliance%short) &
               & .or. fine%waves > ubound(compliance%change, 1)) then
               call new_compliance(layers, max(fine%directions, size(compliance%short)), &
                  & max(fine%waves, ubound(compliance%change, 1)), resolution*accuracy, compliance)
            end if
            call find_contact(compliance, profile, terms, radii(i), last_step, fine, history, &
               & contacts(i), errors, found)
            contacts(i)%error = sum(errors, dim=2)
            associate (own => errors(quantity, :))
               if (found .and. sum(own) <= accuracy) exit
               if (own(1) > accuracy/3.0_wp) fine%terms = fine%terms + 1
               if (own(2) > accuracy/3.0_wp) fine%directions = 2*fine%directions
               if (.not. found .or. own(3) > accuracy/3.0_wp) fine%waves = 2*fine%waves
               if (.not. found) misses = misses + 1
            end associate
         end do
         call check_thickness(layers, min(radii(i), contacts(i)%radius), error)
         if (allocated(error)) return
      end do
   end subroutine indent_layers

   !> Refuse a contact of a `radius` (um) that is too large for the layers.
   pure subroutine check_thickness(layers, radius, error)
      type(layers_type), intent(in) :: layers
      real(wp), intent(in) :: radius
      type(error_type), allocatable, intent(out) :: error

      associate (thickness => sum(layers%thickness))
         if (radius > thinnest*thickness) then
            call refuse(error, 'a contact of radius '//to_text(radius, 3)//' um on layers ' &
               & //to_text(thickness, 3)//' um thick is beyond the theory, which is accurate up to ' &
               & //to_text(thinnest, 3)//' thicknesses; indent less deeply')
         end if
      end associate
   end subroutine check_thickness

   !> Say why a contact is not known.
   pure subroutine raise_inaccurate(layers, radius, fine, misses, error)
      type(layers_type), intent(in) :: layers
      !> On a half-space, um.
      real(wp), intent(in) :: radius
      type(fineness_type), intent(in) :: fine
      !> Searches without a contact.
      integer, intent(in) :: misses
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: reason

      if (misses > most_misses) then
         reason = 'no elliptical contact was found; the layers may bend away from the indenter'
      else if (fine%terms > most_terms) then
         reason = 'the pressure is too uneven for '//to_text(most_terms)//' terms'
      else
         reason = 'deformations decay too slowly with the depth, as near elastic instability'
      end if
      call raise(error, 'theory of layers, '//to_text(sum(layers%thickness), 3)//' um thick, at a ' &
         & //'nominal contact radius of '//to_text(radius, 3)//' um: '//reason)
   end subroutine raise_inaccurate

   !> The contact at one depth with its errors from terms, directions and wave numbers.
   pure subroutine find_contact(compliance, profile, terms, radius, last_step, fine, &
      & history, contact, errors, found)
      type(compliance_type), intent(in) :: compliance
      class(profile_type), intent(in) :: profile
      !> Of 1, 2, .. terms.
      type(terms_type), intent(in) :: terms(:)
      real(wp), intent(in) :: radius, last_step
      type(fineness_type), intent(in) :: fine
      !> Of a smaller depth on entry.
      type(history_type), intent(inout) :: history
      type(contact_type), intent(out) :: contact
      !> Of a quantity from terms, directions, wave numbers.
      real(wp), intent(out) :: errors(3, 3)
      logical, intent(out) :: found
      type(contact_type) :: fewer, other
      type(fineness_type) :: coarse
      real(wp) :: shape(3), guess(3), scale(3), change(3)
      integer :: n

      errors = 0.0_wp
      contact%depth = profile%depth_of(radius)
      scale = [log(radius), 0.0_wp, 0.0_wp]
      change = 0.0_wp
      shape = scale
      do n = max(1, min(history%known, fine%terms - 1)), fine%terms
         fewer = contact
         ! Few nodes serve for a start.
         coarse = fine
         if (n < fine%terms - 1) coarse = fineness_type(n, fine%directions/2, fine%waves/2)
         ! A contact with one term more at a smaller depth has changed since then as this one has.
         if (n <= history%known) shape = scale + history%shape(:, n) + change
         call continue_contact(compliance, profile, terms(n), coarse, last_step, shape, contact, &
            & found)
         if (.not. found) return
         change = shape - scale - history%shape(:, n)
         history%shape(:, n) = shape - scale
         history%known = max(history%known, n)
      end do
      errors(:, 1) = difference(contact, fewer)
      do n = 2, 3
         coarse = fine
         if (n == 2) coarse%directions = fine%directions/2
         if (n == 3) coarse%waves = fine%waves/2
         other = contact
         guess = shape
         call continue_contact(compliance, profile, terms(fine%terms), coarse, huge(1.0_wp), guess, &
            & other, found)
         if (.not. found) return
         errors(:, n) = difference(contact, other)
      end do
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
      terms%before = [(i - 1, i=-1, most_terms)]
      terms%factor = [(2*i + 1, i=-1, most_terms)]
      terms%t = [(sin(0.5_wp*pi*k/radial)**2, k=0, radial)]
      weight = clenshaw_curtis(radial)
      terms%x(:, 0) = 1.0_wp
      do i = 1, n
         terms%x(:, i) = terms%x(:, i - 1)*(1.0_wp - terms%t**2)/(2.0_wp*i)
      end do
      if (is_conical) then
         terms%is_conical = .true.
         terms%before(n) = 0
         terms%factor(n) = 2
         terms%x(:, n) = 1.0_wp - terms%t
      end if
      do i = 0, most_terms
         terms%series(:, i) = [(0.5_wp/(k*(2*i + 2*k + 1)), k=1, powers)]
      end do
      do i = 0, n
         do k = 0, n
            terms%gram(i, k) = sum(weight*terms%x(:, i)*terms%x(:, k))
         end do
      end do
      do i = 0, n
         terms%x(:, i) = weight*terms%x(:, i)
      end do
   end function new_terms

   !> Newton's method to the stationary point of the energy for one number of terms.
   pure subroutine continue_contact(compliance, profile, terms, fine, last_step, shape, contact, &
      & found)
      type(compliance_type), intent(in) :: compliance
      class(profile_type), intent(in) :: profile
      type(terms_type), intent(in) :: terms
      type(fineness_type), intent(in) :: fine
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
      type(integrals_type) :: integrals
      real(wp) :: residual(3), jacobian(3, 3), drift(3), force(3), step(3), before(3), longest
      integer :: k

      before = 0.0_wp
      longest = first_step
      do k = 1, most_steps
         call integrate(compliance, profile, terms, fine, shape, integrals)
         call differentiate_energy(terms, integrals, contact, residual, jacobian, drift, force, found)
         if (.not. found) return
         contact%stiffness = contact%stiffness - sum(force*solution(jacobian, drift))
         step = -solution(jacobian, residual)
         found = all(abs(step) < huge(step))
         if (.not. found) return
         if (sum(step*before) < 0.0_wp) longest = 0.5_wp*min(longest, maxval(abs(before)))
         step = step*min(1.0_wp, longest/maxval(abs(step)))
         do while (norm2(shape(2:) + step(2:)) > flattest)
            step = 0.5_wp*step
         end do
         if (maxval(abs(step)) <= last_step) then
            contact%force = contact%force + sum(force*step)
            call find_radius(terms, integrals, shape, contact)
            shape = shape + step
            return
         end if
         shape = shape + step
         before = step
      end do
      found = .false.
   end subroutine continue_contact

   !> Solution of three equations.
   pure function solution(matrix, right_side) result(x)
      real(wp), intent(in) :: matrix(3, 3), right_side(3)
      real(wp) :: x(3), minors(3, 3)
      integer :: i, j, k

      do i = 1, 3
         j = mod(i, 3) + 1
         k = mod(j, 3) + 1
         minors(:, i) = cshift(matrix(:, j), 1)*cshift(matrix(:, k), 2) &
            & - cshift(matrix(:, j), 2)*cshift(matrix(:, k), 1)
      end do
      x = matmul(right_side, minors)/sum(matrix(:, 1)*minors(:, 1))
   end function solution

   !> The three equations of the shape, and their derivatives by the shape and by the depth; force
   !> and stiffness at a fixed shape, and derivatives of the force by the shape.
   pure subroutine differentiate_energy(terms, integrals, contact, residual, jacobian, drift, force, &
      & found)
      type(terms_type), intent(in) :: terms
      type(integrals_type), intent(in) :: integrals
      type(contact_type), intent(inout) :: contact
      real(wp), intent(out) :: residual(3), jacobian(3, 3), drift(3), force(3)
      !> Whether the compliance is positive.
      logical, intent(out) :: found
      real(wp) :: l(terms%n, terms%n), rest(0:terms%n, 3), mean(0:terms%n), y(terms%n)
      real(wp) :: edge(terms%n), slope(3)
      integer :: i

      residual = 0.0_wp
      associate (n => terms%n, a => integrals%a, a1 => integrals%a1, a2 => integrals%a2, &
         & g => integrals%g, g1 => integrals%g1, g2 => integrals%g2)
         l = a(1:n, 1:n)
         call factor_definite(l, 0.0_wp, found)
         if (.not. found) return
         mean = 2.0_wp*pi*sum(terms%x(:, 0:n), dim=1)
         y = contact%depth*mean(1:) - g(1:n)
         call solve_lower(l, y)
         call solve_upper(l, y)
         contact%force = sum(mean(1:)*y)
         do i = 1, 3
            rest(:, i) = -matmul(a1(0:n, 1:n, i), y)
            slope(i) = sum((0.5_wp*rest(1:, i) - g1(1:n, i))*y)
            rest(:, i) = rest(:, i) - g1(0:n, i)
            call solve_lower(l, rest(1:, i))
         end do
         edge = a(1:n, 0)
         call solve_lower(l, edge)
         residual(1) = contact%depth*mean(0) - g(0) - sum(a(1:n, 0)*y)
         call solve_lower(l, mean(1:))
         contact%stiffness = sum(mean(1:)**2)
         force = matmul(mean(1:), rest(1:, :))
         drift = [mean(0) - sum(edge*mean(1:)), force(2:)]
         jacobian(1, :) = rest(0, :) - matmul(edge, rest(1:, :))
         do i = 1, size(left)
            if (right(i) > 1) jacobian(right(i), left(i)) = sum(rest(1:, left(i)) &
               & *rest(1:, right(i))) - sum(y*(g2(1:n, i) + 0.5_wp*matmul(a2(1:n, 1:n, i), y)))
         end do
         jacobian(2, 3) = jacobian(3, 2)
         residual(2:) = slope(2:)
      end associate
   end subroutine differentiate_energy

   !> Radius of a contact. The stiffness of a flat punch that has the shape of the contact is that of
   !> the contact, and of all quantities it depends most on the size.
   pure subroutine find_radius(terms, integrals, shape, contact)
      type(terms_type), intent(in) :: terms
      type(integrals_type), intent(in) :: integrals
      real(wp), intent(in) :: shape(3)
      type(contact_type), intent(inout) :: contact
      real(wp) :: l(0:terms%n, 0:terms%n), mean(0:terms%n), y(0:terms%n), punch

      associate (n => terms%n)
         l = integrals%a(0:n, 0:n)
         call factor_definite(l, 0.0_wp)
         mean = 2.0_wp*pi*sum(terms%x(:, 0:n), dim=1)
         y = mean
         call solve_lower(l, y)
         call solve_upper(l, y)
         punch = sum(mean*y)
         contact%radius = exp(shape(1) + (punch - contact%stiffness) &
            & /sum(y*matmul(integrals%a1(0:n, 0:n, 1), y)))*(1.0_wp - sum(shape(2:)**2))**0.25_wp
      end associate
   end subroutine find_radius

   !> Integrals over directions and wave numbers.
   pure subroutine integrate(compliance, profile, terms, fine, shape, integrals)
      type(compliance_type), intent(in) :: compliance
      class(profile_type), intent(in) :: profile
      type(terms_type), intent(in) :: terms
      type(fineness_type), intent(in) :: fine
      real(wp), intent(in) :: shape(3)
      type(integrals_type), intent(out) :: integrals
      !> Products of the transforms, and D of one and of both factors; moments of the indenter.
      real(wp), dimension(-1:terms%n, -1:terms%n) :: b, db, ddb
      real(wp), dimension(-1:terms%n) :: g, dg, ddg
      real(wp), dimension(0:terms%n, 0:terms%n) :: half, first, second
      real(wp) :: phi(0:fine%waves, -1:terms%n), weighted(0:fine%waves), v, w, slope(3), bend(3)
      integer :: n, level, stride, i, j, k

      n = terms%n
      stride = ubound(compliance%change, 1)/fine%waves
      level = nint(log(real(stride, wp))/log(2.0_wp))
      do j = 1, fine%directions
         v = 1.0_wp + shape(2)*cos_2theta(j) + shape(3)*sin_2theta(j)
         w = exp(shape(1))*sqrt(v)
         ! Derivatives of ln w by the shape; the second ones are -2 bend bend.
         bend = [0.0_wp, 0.5_wp*cos_2theta(j)/v, 0.5_wp*sin_2theta(j)/v]
         slope = bend + [1.0_wp, 0.0_wp, 0.0_wp]
         call transform(terms, w*compliance%wave_number(::stride, j), phi)
         do k = -1, n
            weighted = compliance%range(j)*compliance%weight(::stride, level) &
               & *compliance%change(::stride, j)*phi(:, k)
            do i = k, n
               b(i, k) = dot(weighted, phi(:, i))
               b(k, i) = b(i, k)
            end do
         end do
         g(-1) = profile%depth_of(w)
         g(0:) = matmul(profile%depth_of(w*terms%t), terms%x(:, 0:n))
         db(-1, :) = 0.0_wp
         ddb = 0.0_wp
         dg(-1) = 0.0_wp
         ddg = 0.0_wp
         do i = 0, n
            db(i, :) = b(terms%before(i), :) - terms%factor(i)*b(i, :)
            dg(i) = g(terms%before(i)) - terms%factor(i)*g(i)
         end do
         do i = 1, n
            ddb(i, :) = db(terms%before(i), :) - terms%factor(i)*db(i, :)
            ddg(i) = dg(terms%before(i)) - terms%factor(i)*dg(i)
         end do
         half = 0.5_wp*pi*compliance%short(j)/w*terms%gram(0:n, 0:n)
         first = db(0:, 0:) + transpose(db(0:, 0:)) - half
         do k = 0, n
            second(:, k) = ddb(0:, k) + ddb(k, 0:) + half(:, k) &
               & + 2.0_wp*(db(0:, terms%before(k)) - terms%factor(k)*db(0:, k))
         end do
         integrals%a(0:n, 0:n) = integrals%a(0:n, 0:n) + b(0:, 0:) + half
         integrals%g(0:n) = integrals%g(0:n) + g(0:)
         do i = 1, 3
            integrals%a1(0:n, 0:n, i) = integrals%a1(0:n, 0:n, i) + slope(i)*first
            integrals%g1(0:n, i) = integrals%g1(0:n, i) + slope(i)*dg(0:)
         end do
         do i = 1, size(left)
            associate (ss => slope(left(i))*slope(right(i)), bb => 2.0_wp*bend(left(i)) &
               & *bend(right(i)))
               integrals%a2(0:n, 0:n, i) = integrals%a2(0:n, 0:n, i) + ss*second - bb*first
               integrals%g2(0:n, i) = integrals%g2(0:n, i) + ss*ddg(0:) - bb*dg(0:)
            end associate
         end do
      end do
      associate (share => 2.0_wp*pi/fine%directions)
         integrals%a = share*integrals%a
         integrals%a1 = share*integrals%a1
         integrals%a2 = share*integrals%a2
         integrals%g = share*integrals%g
         integrals%g1 = share*integrals%g1
         integrals%g2 = share*integrals%g2
      end associate
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
      k = count(kappa <= n + 2.0_wp)
      phi(:k, n - 1:n) = 1.0_wp
      do m = size(terms%series, 1), 1, -1
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
