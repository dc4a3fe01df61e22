!> Frictionless elastic contact with an axisymmetric tip of profile r²/(2R) + beta r⁴/(8R³):
!> Sneddon, Int. J. Eng. Sci. 3, 47 (1965).
!>
!> With the contact radius a, x = a/R and the effective modulus E: h/R = x² + beta x⁴/3, P/(E R²) =
!> 4x³/3 + 8 beta x⁵/15, dP/dh = 2 E a. beta = 0 is a paraboloid (Hertz), beta = 1 a sphere to the
!> next order, and a negative beta a blunter tip.
module sphere_contact
   use kinds, only: wp
   implicit none
   private
   public :: contact_type, contact_at

   !> Depth and contact radius at a load, um, and the derivatives of the depth with respect to ln E,
   !> ln R and beta at that load, um.
   type :: contact_type
      real(wp) :: depth, radius, by_modulus, by_radius, by_beta
   end type contact_type

contains

   !> The contact at a `load`, mN. For negative beta the contact radius is limited to values at
   !> which the load still grows with it.
   pure elemental type(contact_type) function contact_at(load, modulus, radius, &
      & beta) result(contact)
      !> mN; GPa; um; dimensionless.
      real(wp), intent(in) :: load, modulus, radius, beta
      integer, parameter :: most_steps = 60
      real(wp) :: scaled_load, x, slope, depth_slope, limit, step
      integer :: i

      scaled_load = load/(modulus*radius**2)
      x = (0.75_wp*scaled_load)**(1.0_wp/3.0_wp)
      limit = huge(1.0_wp)
      if (beta < 0.0_wp) limit = 0.95_wp*sqrt(-1.5_wp/beta)
      do i = 1, most_steps
         x = min(x, limit)
         step = (4.0_wp/3.0_wp*x**3 + 8.0_wp/15.0_wp*beta*x**5 - scaled_load)/slope_of(x)
         x = max(x - step, 0.5_wp*x)
         if (abs(step) < 1.0e-14_wp*x) exit
      end do
      x = min(x, limit)
      slope = slope_of(x)
      depth_slope = 2.0_wp*x + 4.0_wp/3.0_wp*beta*x**3
      contact%depth = radius*(x**2 + beta*x**4/3.0_wp)
      contact%radius = radius*x
      contact%by_modulus = -radius*depth_slope*scaled_load/slope
      contact%by_radius = contact%depth + 2.0_wp*contact%by_modulus
      contact%by_beta = radius*(x**4/3.0_wp - depth_slope*8.0_wp/15.0_wp*x**5/slope)

   contains

      pure real(wp) function slope_of(x)
         real(wp), intent(in) :: x

         slope_of = 4.0_wp*x**2 + 8.0_wp/3.0_wp*beta*x**4
      end function slope_of
   end function contact_at
end module sphere_contact
