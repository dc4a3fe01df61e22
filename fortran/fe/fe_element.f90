!> Element kernels: eight-node bricks and the infinite element that closes a half-space.
!>
!> Lengths are in um and stiffnesses in GPa, so forces are in mN. Voigt order 11,22,33,23,13,12 with
!> engineering shear strains. Nodes of a brick are in Abaqus' order: 1-4 counterclockwise seen from
!> face 5-8, then 5-8 above them.
module fe_element
   use kinds, only: wp
   use linear_algebra, only: multiply
   implicit none
   private
   public :: brick_full, brick_selective, brick_incompatible, brick_stiffness, brick_strain, &
      & brick_stress, infinite_stiffness, brick_own_strain, infinite_own_strain

   !> Formulations: full 2 x 2 x 2 integration (CalculiX' C3D8); volumetric strain averaged over the
   !> element (Abaqus' C3D8); nine incompatible modes (C3D8I: Wilson et al. 1973, with Taylor's
   !> correction of 1976, which makes it pass the patch test).
   integer, parameter :: brick_full = 1, brick_selective = 2, brick_incompatible = 3

   !> Corners of the reference cube.
   real(wp), parameter :: corner(3, 8) = 1.0_wp*reshape([-1, -1, -1, 1, -1, -1, 1, 1, -1, &
      & -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1], [3, 8])
   real(wp), parameter :: gauss = 0.577350269189625764509148780502_wp

contains

   !> Stiffness (mN/um) of a brick with nodes `x` (um) and stiffness `c` (GPa) in the axes of `x`.
   !> The result is zero unless `valid`.
   pure subroutine brick_stiffness(x, c, formulation, growth, k, valid)
      !> `growth` is that of the layer: see `brick_strain`.
      real(wp), intent(in) :: x(3, 8), c(6, 6), growth
      !> One of the formulations above.
      integer, intent(in) :: formulation
      !> mN/um.
      real(wp), intent(out) :: k(24, 24)
      !> Whether the Jacobian is positive at all integration points.
      logical, intent(out) :: valid
      real(wp) :: b(6, 33, 8), volume(8), cb(48, 33), bb(48, 33), total(33, 33)
      integer :: n, q

      n = unknowns_of(formulation, growth)
      call brick_strain(x, formulation, growth, b, volume)
      valid = all(volume > 0.0_wp)
      k = 0.0_wp
      if (.not. valid) return
      do q = 1, 8
         bb(6*q - 5:6*q, :n) = b(:, :n, q)
         cb(6*q - 5:6*q, :n) = volume(q)*matmul(c, b(:, :n, q))
      end do
      total(:n, :n) = matmul(transpose(bb(:, :n)), cb(:, :n))
      call eliminate_modes(total(:n, :n), 24)
      k = 0.5_wp*(total(:24, :24) + transpose(total(:24, :24)))
   end subroutine brick_stiffness

   !> Number of nodal displacements and incompatible modes.
   pure integer function unknowns_of(formulation, growth)
      integer, intent(in) :: formulation
      real(wp), intent(in) :: growth

      unknowns_of = 24
      if (formulation == brick_incompatible) unknowns_of = merge(30, 33, growth > 1.0_wp)
   end function unknowns_of

   !> Strain (1/um) at the integration points of a brick for unit nodal displacements, the
   !> incompatible modes following them, and the volumes of the points (um3).
   pure subroutine brick_own_strain(x, c, formulation, growth, strain, volume)
      !> As in `brick_stiffness`.
      real(wp), intent(in) :: x(3, 8), c(6, 6), growth
      !> One of the formulations above.
      integer, intent(in) :: formulation
      !> (strain of each point in turn, displacement); (point).
      real(wp), intent(out) :: strain(48, 24), volume(8)
      real(wp) :: b(6, 33, 8)

      call brick_strain(x, formulation, growth, b, volume)
      call follow_displacements(b(:, :unknowns_of(formulation, growth), :), c, volume, strain)
   end subroutine brick_own_strain

   !> The same of the infinite element over a facet.
   pure subroutine infinite_own_strain(x, c, strain, volume)
      !> Nodes, um; stiffness, GPa.
      real(wp), intent(in) :: x(3, 4), c(6, 6)
      !> (strain of each point in turn, displacement); (point).
      real(wp), intent(out) :: strain(24, 12), volume(4)
      real(wp) :: b(6, 18, 4)

      call infinite_strain(x, b, volume)
      call follow_displacements(b, c, volume, strain)
   end subroutine infinite_own_strain

   !> Strain for unit displacements, the modes having their values of least energy.
   pure subroutine follow_displacements(b, c, volume, strain)
      !> Strain by displacements and modes, (6, unknowns, points); GPa; um3.
      real(wp), intent(in) :: b(:, :, :), c(6, 6), volume(:)
      !> (6 points, displacements).
      real(wp), intent(out) :: strain(:, :)
      real(wp) :: forces(size(b, 2) - size(strain, 2), size(b, 2)), &
         & by(size(strain, 1), size(b, 2)), stress(size(strain, 1), size(forces, 1)), ratio
      integer :: j, n, p, q

      n = size(strain, 2)
      do q = 1, size(b, 3)
         by(6*q - 5:6*q, :) = b(:, :, q)
         stress(6*q - 5:6*q, :) = volume(q)*matmul(c, b(:, n + 1:, q))
      end do
      call multiply(stress, by, forces, transposed=.true.)
      do p = size(forces, 1), 1, -1
         do j = 1, n + p - 1
            ratio = forces(p, j)/forces(p, n + p)
            by(:, j) = by(:, j) - ratio*by(:, n + p)
            forces(:p - 1, j) = forces(:p - 1, j) - ratio*forces(:p - 1, n + p)
         end do
      end do
      strain = by(:, :n)
   end subroutine follow_displacements

   !> Mean stress (GPa) of a brick with nodal displacements `u` (um).
   pure subroutine brick_stress(x, c, formulation, growth, u, stress)
      !> Nodes (um), stiffness in the axes of the nodes (GPa), growth of the layer (see
      !> `brick_strain`), nodal displacements (um).
      real(wp), intent(in) :: x(3, 8), c(6, 6), growth, u(3, 8)
      !> One of the formulations above.
      integer, intent(in) :: formulation
      real(wp), intent(out) :: stress(6)
      real(wp) :: b(6, 33, 8), volume(8), strain(6, 8)
      integer :: q

      call brick_strain(x, formulation, growth, b, volume)
      ! The mean strain of an incompatible mode is zero.
      strain = reshape([(matmul(b(:, :24, q), reshape(u, [24])), q=1, 8)], [6, 8])
      stress = matmul(c, matmul(strain, volume))/sum(volume)
   end subroutine brick_stress

   !> Strain at the eight integration points for unit degrees of freedom, and the volumes of the
   !> points (um3).
   !>
   !> Columns 1-24 are for the three displacements of each node, the others for the incompatible
   !> modes. The outer face (nodes 5-8) of a brick in a layer is `growth` times as far out as the
   !> inner one. In a layer, bricks with incompatible modes interpolate from face to face by 1 and
   !> 1/rho, rho = 1 to `growth`, because the displacements under a force decay like this. They have
   !> no mode in that direction. A growth of 1 gives an ordinary brick.
   pure subroutine brick_strain(x, formulation, growth, b, volume)
      !> Nodes, um; growth of the layer, 1 outside layers.
      real(wp), intent(in) :: x(3, 8), growth
      !> One of the formulations above.
      integer, intent(in) :: formulation
      !> Strain by degrees of freedom (1/um) and volume (um3) of each integration point.
      real(wp), intent(out) :: b(6, 33, 8), volume(8)
      real(wp) :: natural(3, 8), jacobian(3, 3), inverse(3, 3), determinant, centre_inverse(3, 3), &
         & centre_determinant
      real(wp) :: gradient(3, 8, 8), mean(24), mode(3), xi(3), weight, rho
      logical :: decays
      integer :: a, i, q

      b = 0.0_wp
      decays = formulation == brick_incompatible .and. growth > 1.0_wp
      do q = 1, 8
         xi = gauss*corner(:, q)
         weight = 1.0_wp
         if (decays) then
            ! Integration points in 1/rho, which are exact for the energy of decaying displacements.
            rho = 2.0_wp*growth/(growth + 1.0_wp - (growth - 1.0_wp)*xi(3))
            xi(3) = 2.0_wp*(rho - 1.0_wp)/(growth - 1.0_wp) - 1.0_wp
            weight = rho**2/growth
         end if
         natural = natural_gradient(xi, 1.0_wp)
         jacobian = matmul(x, transpose(natural))
         call invert(jacobian, inverse, determinant)
         volume(q) = weight*determinant
         if (decays) natural = natural_gradient(xi, growth)
         gradient(:, :, q) = matmul(transpose(inverse), natural)
         do a = 1, 8
            b(:, 3*a - 2:3*a, q) = strain_of(gradient(:, a, q))
         end do
      end do
      if (formulation == brick_selective) then
         mean = matmul(reshape(gradient, [24, 8]), volume)/sum(volume)
         do q = 1, 8
            b(:3, :24, q) = b(:3, :24, q) &
               & + spread((mean - reshape(gradient(:, :, q), [24]))/3.0_wp, 1, 3)
         end do
      else if (formulation == brick_incompatible) then
         natural = natural_gradient([0.0_wp, 0.0_wp, 0.0_wp], 1.0_wp)
         jacobian = matmul(x, transpose(natural))
         call invert(jacobian, centre_inverse, centre_determinant)
         do q = 1, 8
            do i = 1, unknowns_of(formulation, growth)/3 - 8
               ! The mode 1 - xi_i^2. Its gradient is mapped by the Jacobian of the centre and
               ! scaled, so that it does no work on constant stress.
               mode = -2.0_wp*gauss*corner(i, q)*centre_inverse(i, :)*(centre_determinant/volume(q))
               b(:, 22 + 3*i:24 + 3*i, q) = strain_of(mode)
            end do
         end do
      end if
   end subroutine brick_strain

   !> Stiffness (mN/um) of the infinite element over a facet with nodes `x` (um).
   !>
   !> The element is swept from the facet along rays from the origin to infinity, x = rho X with rho
   !> ≥ 1. Displacements decay as u = N_a u_a / rho, like those of a point load. The energy is
   !> integrated in closed form in rho. Six incompatible modes, (1/3 - s2)/rho and (1/3 - t2)/rho,
   !> let displacements bend across the facet as those of the bricks do. Their mean is zero and
   !> their gradients are mapped by the Jacobian of the centre, so they do no work on a uniform
   !> stress.
   pure subroutine infinite_stiffness(x, c, k)
      real(wp), intent(in) :: x(3, 4), c(6, 6)
      !> mN/um.
      real(wp), intent(out) :: k(12, 12)
      real(wp) :: b(6, 18, 4), volume(4), total(18, 18)
      integer :: q

      call infinite_strain(x, b, volume)
      total = 0.0_wp
      do q = 1, 4
         total = total + volume(q)*matmul(transpose(b(:, :, q)), matmul(c, b(:, :, q)))
      end do
      call eliminate_modes(total, 12)
      k = 0.5_wp*(total(:12, :12) + transpose(total(:12, :12)))
   end subroutine infinite_stiffness

   !> Strain at the four integration points of an infinite element for unit degrees of freedom, and
   !> their volumes; see `infinite_stiffness`.
   pure subroutine infinite_strain(x, b, volume)
      real(wp), intent(in) :: x(3, 4)
      !> (strain, displacements and modes, point), 1/um; um3.
      real(wp), intent(out) :: b(6, 18, 4), volume(4)
      real(wp), parameter :: sign_s(4) = [-1.0_wp, 1.0_wp, 1.0_wp, -1.0_wp], &
         & sign_t(4) = [-1.0_wp, -1.0_wp, 1.0_wp, 1.0_wp]
      real(wp) :: shape(4), along_s(4), along_t(4), jacobian(3, 3), inverse(3, 3), determinant, &
         & natural(3, 4)
      real(wp) :: s, t, gradient(3, 4), centre_inverse(3, 3), centre_determinant, scale
      integer :: a, q

      jacobian(:, 1) = 0.25_wp*sum(x, dim=2)
      jacobian(:, 2) = 0.25_wp*matmul(x, sign_s)
      jacobian(:, 3) = 0.25_wp*matmul(x, sign_t)
      call invert(jacobian, centre_inverse, centre_determinant)
      do q = 1, 4
         s = gauss*sign_s(q)
         t = gauss*sign_t(q)
         shape = 0.25_wp*(1.0_wp + s*sign_s)*(1.0_wp + t*sign_t)
         along_s = 0.25_wp*sign_s*(1.0_wp + t*sign_t)
         along_t = 0.25_wp*sign_t*(1.0_wp + s*sign_s)
         jacobian(:, 1) = matmul(x, shape)
         jacobian(:, 2) = matmul(x, along_s)
         jacobian(:, 3) = matmul(x, along_t)
         call invert(jacobian, inverse, determinant)
         natural(1, :) = -shape
         natural(2, :) = along_s
         natural(3, :) = along_t
         gradient = matmul(transpose(inverse), natural)
         do a = 1, 4
            b(:, 3*a - 2:3*a, q) = strain_of(gradient(:, a))
         end do
         ! At the integration points s2 = t2 = 1/3, so the modes themselves vanish there.
         scale = centre_determinant/determinant
         b(:, 13:15, q) = strain_of(-2.0_wp*s*scale*centre_inverse(2, :))
         b(:, 16:18, q) = strain_of(-2.0_wp*t*scale*centre_inverse(3, :))
         volume(q) = abs(determinant)
      end do
   end subroutine infinite_strain

   !> Eliminate all unknowns but the first `n` from `k` (static condensation).
   pure subroutine eliminate_modes(k, n)
      real(wp), intent(inout) :: k(:, :)
      integer, intent(in) :: n
      integer :: p, j

      do p = size(k, 2), n + 1, -1
         do j = 1, p - 1
            k(:p - 1, j) = k(:p - 1, j) - k(:p - 1, p)*(k(p, j)/k(p, p))
         end do
      end do
   end subroutine eliminate_modes

   !> Derivatives of the eight shape functions by the natural coordinates. With a growth above 1 the
   !> functions decay from face to face of a layer (`brick_strain`), else they are linear.
   pure function natural_gradient(xi, growth) result(g)
      real(wp), intent(in) :: xi(3), growth
      real(wp) :: g(3, 8)
      !> Weights of the inner and the outer face.
      real(wp) :: share(2), f1, f2, rho, slope
      integer :: a

      share = [0.5_wp*(1.0_wp - xi(3)), 0.5_wp*(1.0_wp + xi(3))]
      slope = 0.5_wp
      if (growth > 1.0_wp) then
         rho = 1.0_wp + 0.5_wp*(growth - 1.0_wp)*(1.0_wp + xi(3))
         share(1) = (growth - rho)/(rho*(growth - 1.0_wp))
         share(2) = 1.0_wp - share(1)
         slope = 0.5_wp*growth/rho**2
      end if
      do a = 1, 8
         f1 = 1.0_wp + xi(1)*corner(1, a)
         f2 = 1.0_wp + xi(2)*corner(2, a)
         g(1, a) = 0.25_wp*corner(1, a)*f2*share((a + 3)/4)
         g(2, a) = 0.25_wp*corner(2, a)*f1*share((a + 3)/4)
         g(3, a) = 0.25_wp*corner(3, a)*f1*f2*slope
      end do
   end function natural_gradient

   !> Strain of three unit displacements that have the same gradient `g`.
   pure function strain_of(g) result(b)
      real(wp), intent(in) :: g(3)
      real(wp) :: b(6, 3)

      b(:, 1) = [g(1), 0.0_wp, 0.0_wp, 0.0_wp, g(3), g(2)]
      b(:, 2) = [0.0_wp, g(2), 0.0_wp, g(3), 0.0_wp, g(1)]
      b(:, 3) = [0.0_wp, 0.0_wp, g(3), g(2), g(1), 0.0_wp]
   end function strain_of

   !> Inverse and determinant of the Jacobian J(i, j) = dx_i/dxi_j.
   pure subroutine invert(j, inverse, determinant)
      real(wp), intent(in) :: j(3, 3)
      real(wp), intent(out) :: inverse(3, 3), determinant
      integer :: i

      do i = 1, 3
         associate (p => j(:, modulo(i, 3) + 1), q => j(:, modulo(i + 1, 3) + 1))
            inverse(i, :) = [p(2)*q(3) - p(3)*q(2), p(3)*q(1) - p(1)*q(3), p(1)*q(2) - p(2)*q(1)]
         end associate
      end do
      determinant = dot_product(j(1, :), inverse(:, 1))
      if (abs(determinant) > 0.0_wp) inverse = inverse/determinant
   end subroutine invert
end module fe_element
