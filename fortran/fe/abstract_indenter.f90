!> A rigid indenter: its shape, and its closed forms on an isotropic half-space.
!>
!> The force is M times `unit_force`, M the plane-strain modulus, and d(force)/d(depth) = 2 a M with a the contact radius, whatever the
!> shape. I. N. Sneddon, Int. J. Engng Sci. 3, 47 (1965).
module abstract_indenter
   use errors, only: error_type
   use kinds, only: wp
   use settings_schema, only: indenter_settings_type
   implicit none
   private
   public :: indenter_type

   type, abstract :: indenter_type
      !> Names of the variables of &indenter that only some indenters read, separated by ', '.
      character(len=:), allocatable :: variables
      !> The last point of the curve: contact radius and depth, um.
      real(wp) :: contact_radius = 0.0_wp, depth = 0.0_wp
   contains
      procedure(take_settings), deferred :: set_up
      !> Height above a surface point of the indenter at zero depth, um, at a distance from the axis, um.
      procedure(closed_form), deferred :: gap
      !> Force over plane-strain modulus, um2, at a depth, um.
      procedure(closed_form), deferred :: unit_force
      !> Depth and contact radius, um, of each other.
      procedure(closed_form), deferred :: depth_of, contact_radius_of
      procedure :: check_length
   end type indenter_type

   abstract interface
      !> Its shape.
      subroutine take_settings(self, settings)
         import :: indenter_settings_type, indenter_type
         class(indenter_type), intent(inout) :: self
         type(indenter_settings_type), intent(in) :: settings
      end subroutine take_settings

      elemental real(wp) function closed_form(self, length)
         import :: indenter_type, wp
         class(indenter_type), intent(in) :: self
         !> um.
         real(wp), intent(in) :: length
      end function closed_form
   end interface

contains

   !> Refuse a last point that the shape does not reach; by default there is none.
   subroutine check_length(self, variable, length, error)
      class(indenter_type), intent(in) :: self
      !> The name of the variable that states it.
      character(len=*), intent(in) :: variable
      !> Its value, um.
      real(wp), intent(in) :: length
      type(error_type), allocatable, intent(out) :: error

      associate (unused => self, unused_name => variable, unused_length => length)
      end associate
   end subroutine check_length
end module abstract_indenter
