!> A true sphere.
module sphere_indenter
   use abstract_indenter, only: indenter_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use settings_schema, only: indenter_settings_type
   use text, only: to_text
   implicit none
   private
   public :: sphere_indenter_type, sphere_name

   character(len=*), parameter :: sphere_name = 'sphere'

   type, extends(indenter_type) :: sphere_indenter_type
      !> um.
      real(wp) :: radius = 0.0_wp
   contains
      procedure :: set_up, check_length, gap, unit_force, depth_of, contact_radius_of
   end type sphere_indenter_type

contains

   subroutine set_up(self, settings)
      class(sphere_indenter_type), intent(inout) :: self
      type(indenter_settings_type), intent(in) :: settings

      self%variables = 'radius_um'
      self%radius = settings%radius_um
   end subroutine set_up

   !> Refuse a last point beyond the lower half.
   subroutine check_length(self, variable, length, error)
      class(sphere_indenter_type), intent(in) :: self
      !> The name of the variable that states it.
      character(len=*), intent(in) :: variable
      !> Its value, um.
      real(wp), intent(in) :: length
      type(error_type), allocatable, intent(out) :: error

      if (.not. length < self%radius) call raise(error, variable//': '//to_text(length) &
         & //' um is beyond the sphere; allowed below its radius_um of '//to_text(self%radius)//' um', exit_bad_input)
   end subroutine check_length

   !> Very large where the sphere has no surface.
   elemental real(wp) function gap(self, length)
      class(sphere_indenter_type), intent(in) :: self
      !> Distance from the axis, um.
      real(wp), intent(in) :: length
      !> In radii.
      real(wp), parameter :: very_large = 1.0e3_wp

      ! r2/(R + sqrt(R2 - r2)) is R - sqrt(R2 - r2) without its cancellation.
      gap = very_large*self%radius
      if (length < self%radius) gap = length**2/(self%radius + sqrt(self%radius**2 - length**2))
   end function gap

   !> Force over modulus and R², of t = a/R: (1 + t²) atanh(t) - t.
   elemental real(wp) function unit_force(self, length)
      class(sphere_indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length
      !> Below this the terms cancel, and the series serves: ten of its terms leave 1e-17.
      real(wp), parameter :: small = 0.15_wp
      real(wp) :: t
      integer :: k

      t = self%contact_radius_of(length)/self%radius
      if (t < small) then
         unit_force = t*sum([(4.0_wp*k/(4.0_wp*k**2 - 1.0_wp)*t**(2*k), k=10, 1, -1)])
      else
         unit_force = (1.0_wp + t**2)*atanh(t) - t
      end if
      unit_force = self%radius**2*unit_force
   end function unit_force

   elemental real(wp) function depth_of(self, length)
      class(sphere_indenter_type), intent(in) :: self
      !> Contact radius, um.
      real(wp), intent(in) :: length

      depth_of = length*atanh(length/self%radius)
   end function depth_of

   !> t = a/R of t atanh(t) = h/R, by Newton's method in u = atanh(t) between bounds that close in on it.
   elemental real(wp) function contact_radius_of(self, length) result(contact_radius)
      class(sphere_indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length
      real(wp) :: depth, low, high, u, step, residual
      integer :: i

      depth = length/self%radius
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
      contact_radius = self%radius*tanh(u)
   end function contact_radius_of
end module sphere_indenter
