!> The rigid indenters there are: their shapes, and the closed forms of each on an isotropic half-space.
!>
!> The force is M times `unit_force`, M the plane-strain modulus, and d(force)/d(depth) = 2 a M with a the contact radius, whatever the
!> shape. I. N. Sneddon, Int. J. Engng Sci. 3, 47 (1965).
module indenters
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: degree, pi, wp
   use settings_groups, only: indenter_settings_type
   use text, only: to_text
   implicit none
   private
   public :: indenter_names, indenter_type, new_indenter

   character(len=*), parameter :: indenter_names = 'paraboloid, sphere, cone'

   type :: indenter_type
      !> One of `indenter_names`.
      character(len=10) :: shape = 'paraboloid'
      !> The variable of &indenter that gives its size.
      character(len=14) :: variable = 'radius_um'
      !> Of a sphere, or of the tip of a paraboloid, um; angle between the axis of a cone and its surface, radians.
      real(wp) :: radius = 0.0_wp, half_angle = 0.0_wp
      !> The last point of the curve: contact radius and depth, um.
      real(wp) :: contact_radius = 0.0_wp, depth = 0.0_wp
   contains
      procedure :: gap
      procedure :: unit_force
      procedure :: depth_of
      procedure :: contact_radius_of
   end type indenter_type

contains

   !> The indenter of &indenter with its last point; a message of an error begins with the variable.
   subroutine new_indenter(settings, self, error)
      type(indenter_settings_type), intent(in) :: settings
      type(indenter_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error

      if (index(', '//indenter_names//',', ', '//settings%shape//',') == 0) then
         call raise(error, 'shape: '''//settings%shape//''' is unknown; allowed: '//indenter_names, exit_bad_input)
         return
      end if
      self%shape = settings%shape
      self%radius = settings%radius_um
      self%half_angle = settings%half_angle_deg*degree
      if (self%shape == 'cone') self%variable = 'half_angle_deg'
      if (allocated(settings%depth_um)) then
         call check_reach(self, 'depth_um', settings%depth_um, error)
         if (allocated(error)) return
         self%depth = settings%depth_um
         self%contact_radius = self%contact_radius_of(self%depth)
      else
         call check_reach(self, 'contact_radius_um', settings%contact_radius_um, error)
         if (allocated(error)) return
         self%contact_radius = settings%contact_radius_um
         self%depth = self%depth_of(self%contact_radius)
      end if
   end subroutine new_indenter

   !> Refuse a last point beyond the lower half of a sphere.
   pure subroutine check_reach(self, variable, length, error)
      type(indenter_type), intent(in) :: self
      !> The name of the variable that states it, and its value, um.
      character(len=*), intent(in) :: variable
      real(wp), intent(in) :: length
      type(error_type), allocatable, intent(out) :: error

      if (self%shape == 'sphere' .and. .not. length < self%radius) call raise(error, variable//': '//to_text(length) &
         & //' um is beyond the sphere; allowed below its radius_um of '//to_text(self%radius)//' um', exit_bad_input)
   end subroutine check_reach

   !> Height above a surface point of the tip at zero depth, um; a sphere is out of reach where it has no surface.
   elemental real(wp) function gap(self, r)
      class(indenter_type), intent(in) :: self
      !> Distance of the point from the axis, um.
      real(wp), intent(in) :: r
      !> In radii.
      real(wp), parameter :: out_of_reach = 1.0e3_wp

      select case (self%shape)
      case ('sphere')
         ! r2/(R + sqrt(R2 - r2)) is R - sqrt(R2 - r2) without its cancellation.
         gap = out_of_reach*self%radius
         if (r < self%radius) gap = r**2/(self%radius + sqrt(self%radius**2 - r**2))
      case ('cone')
         gap = r/tan(self%half_angle)
      case default
         gap = 0.5_wp*r**2/self%radius
      end select
   end function gap

   !> Force over plane-strain modulus, um2.
   elemental real(wp) function unit_force(self, depth)
      class(indenter_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: depth
      real(wp) :: a

      select case (self%shape)
      case ('sphere')
         a = self%contact_radius_of(depth)
         unit_force = self%radius**2*sphere_force(a/self%radius)
      case ('cone')
         unit_force = 2.0_wp/pi*tan(self%half_angle)*depth**2
      case default
         unit_force = 4.0_wp/3.0_wp*sqrt(self%radius)*depth**1.5_wp
      end select
   end function unit_force

   !> Depth, um.
   elemental real(wp) function depth_of(self, contact_radius)
      class(indenter_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: contact_radius

      select case (self%shape)
      case ('sphere')
         depth_of = contact_radius*atanh(contact_radius/self%radius)
      case ('cone')
         depth_of = 0.5_wp*pi*contact_radius/tan(self%half_angle)
      case default
         depth_of = contact_radius**2/self%radius
      end select
   end function depth_of

   !> Contact radius, um.
   elemental real(wp) function contact_radius_of(self, depth) result(contact_radius)
      class(indenter_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: depth

      select case (self%shape)
      case ('sphere')
         contact_radius = self%radius*sphere_contact(depth/self%radius)
      case ('cone')
         contact_radius = 2.0_wp/pi*tan(self%half_angle)*depth
      case default
         contact_radius = sqrt(self%radius*depth)
      end select
   end function contact_radius_of

   !> ((1 + t²) ln((1 + t)/(1 - t)) - 2t)/2 of t = a/R: force over modulus and R².
   elemental real(wp) function sphere_force(t)
      !> 0 to below 1.
      real(wp), intent(in) :: t
      !> Below this the terms cancel, and its series serves: ten of its terms leave 1e-17.
      real(wp), parameter :: small = 0.15_wp
      integer :: k

      if (t < small) then
         sphere_force = 0.0_wp
         do k = 10, 1, -1
            sphere_force = (sphere_force + 4.0_wp*k/(4.0_wp*k**2 - 1.0_wp))*t**2
         end do
         sphere_force = t*sphere_force
      else
         sphere_force = (1.0_wp + t**2)*atanh(t) - t
      end if
   end function sphere_force

   !> t = a/R of t atanh(t) = h/R, by Newton's method in u = atanh(t) between bounds that close in on it.
   elemental real(wp) function sphere_contact(depth)
      !> Over the radius, h/R.
      real(wp), intent(in) :: depth
      real(wp) :: low, high, u, step, residual
      integer :: i

      low = max(sqrt(depth), depth)
      high = sqrt(depth) + depth
      u = low
      do i = 1, 100
         residual = u*tanh(u) - depth
         if (residual > 0.0_wp) high = u
         if (residual <= 0.0_wp) low = u
         step = -residual/(tanh(u) + u*(1.0_wp - tanh(u)**2))
         if (.not. (u + step >= low .and. u + step <= high)) step = 0.5_wp*(low + high) - u
         u = u + step
         if (abs(step) <= 2.0_wp*epsilon(u)*u) exit
      end do
      sphere_contact = tanh(u)
   end function sphere_contact
end module indenters
