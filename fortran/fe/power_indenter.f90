!> Indenters whose height above their end grows as a power of the distance r from the axis: paraboloid (2) and cone (1).
module power_indenter
   use abstract_indenter, only: indenter_type
   use kinds, only: degree, pi, wp
   use settings_schema, only: indenter_settings_type
   implicit none
   private
   public :: power_indenter_type, paraboloid_name, cone_name

   character(len=*), parameter :: paraboloid_name = 'paraboloid', cone_name = 'cone'

   type, extends(indenter_type) :: power_indenter_type
      integer :: exponent = 2
      !> Height over r**exponent, and depth over (contact radius)**exponent; um**(1 - exponent).
      real(wp) :: steepness = 0.0_wp, sinking = 0.0_wp
   contains
      procedure :: set_up, gap, unit_force, depth_of, contact_radius_of
   end type power_indenter_type

contains

   subroutine set_up(self, settings)
      class(power_indenter_type), intent(inout) :: self
      type(indenter_settings_type), intent(in) :: settings

      if (settings%shape == cone_name) then
         self%variables = 'half_angle_deg'
         self%exponent = 1
         self%steepness = 1.0_wp/tan(settings%half_angle_deg*degree)
         self%sinking = 0.5_wp*pi*self%steepness
      else
         self%variables = 'radius_um'
         self%exponent = 2
         self%steepness = 0.5_wp/settings%radius_um
         self%sinking = 2.0_wp*self%steepness
      end if
   end subroutine set_up

   elemental real(wp) function gap(self, length)
      class(power_indenter_type), intent(in) :: self
      !> Distance from the axis, um.
      real(wp), intent(in) :: length

      gap = self%steepness*length**self%exponent
   end function gap

   elemental real(wp) function unit_force(self, length)
      class(power_indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length

      unit_force = 2.0_wp*self%exponent/(self%exponent + 1.0_wp)*self%contact_radius_of(length)*length
   end function unit_force

   elemental real(wp) function depth_of(self, length)
      class(power_indenter_type), intent(in) :: self
      !> Contact radius, um.
      real(wp), intent(in) :: length

      depth_of = self%sinking*length**self%exponent
   end function depth_of

   elemental real(wp) function contact_radius_of(self, length) result(contact_radius)
      class(power_indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length

      contact_radius = (length/self%sinking)**(1.0_wp/self%exponent)
   end function contact_radius_of
end module power_indenter
