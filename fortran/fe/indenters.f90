!> The rigid indenters: their shapes, and their closed forms on an isotropic half-space.
!>
!> The force is the plane-strain modulus M times `unit_force`, and d(force)/d(depth) = 2 a M with
!> the contact radius a, for every shape. I. N. Sneddon, Int. J. Engng Sci. 3, 47 (1965).
module indenters
   use errors, only: error_type, refuse
   use kinds, only: degree, pi, wp
   use layered_contact, only: profile_type
   use settings_schema, only: indenter_settings_type
   use text, only: to_text
   implicit none
   private
   public :: indenter_type, indenter_names, new_indenter

   !> A new indenter needs a type that extends `indenter_type`, a name here, and lines in
   !> `new_indenter`.
   character(len=*), parameter :: paraboloid_name = 'paraboloid', cone_name = 'cone', &
      & sphere_name = 'sphere'
   character(len=*), parameter :: indenter_names = paraboloid_name//', '//sphere_name &
      & //', '//cone_name

   !> An indenter whose height above its tip grows as a power of the distance r from the axis:
   !> paraboloid (exponent 2) and cone (exponent 1).
   type, extends(profile_type) :: indenter_type
      !> Names of the variables of &indenter that this indenter reads and some others do not,
      !> separated by ', '.
      character(len=:), allocatable :: variables
      !> Contact radius and depth at the last point of the curve, um; radius of a sphere, which
      !> bounds both, um.
      real(wp) :: contact_radius = 0.0_wp, depth = 0.0_wp, radius = huge(1.0_wp)
      integer, private :: exponent = 2
      !> Height over r**exponent, and depth over (contact radius)**exponent; um**(1 - exponent).
      real(wp), private :: steepness = 0.0_wp, sinking = 0.0_wp
   contains
      procedure :: gap, unit_force, depth_of, contact_radius_of
      procedure, non_overridable :: check_length
   end type indenter_type

   !> A sphere, not approximated by a paraboloid.
   type, extends(indenter_type) :: sphere_indenter_type
   contains
      procedure :: gap => sphere_gap, unit_force => sphere_unit_force, &
         & depth_of => sphere_depth_of, contact_radius_of => sphere_contact_radius_of
   end type sphere_indenter_type

contains

   !> The indenter of &indenter with its last point. The message of an error begins with the
   !> variable.
   subroutine new_indenter(settings, indenter, error)
      type(indenter_settings_type), intent(in) :: settings
      class(indenter_type), allocatable, intent(out) :: indenter
      type(error_type), allocatable, intent(out) :: error

      select case (settings%shape)
      case (paraboloid_name)
         allocate (indenter)
         indenter%steepness = 0.5_wp/settings%radius_um
         indenter%sinking = 2.0_wp*indenter%steepness
         indenter%radius = settings%radius_um
      case (cone_name)
         allocate (indenter)
         indenter%exponent = 1
         indenter%is_conical = .true.
         indenter%steepness = 1.0_wp/tan(settings%half_angle_deg*degree)
         indenter%sinking = 0.5_wp*pi*indenter%steepness
      case (sphere_name)
         allocate (sphere_indenter_type :: indenter)
         indenter%radius = settings%radius_um
      case default
         call refuse(error, ''''//settings%shape//''' is unknown; allowed: '//indenter_names, &
            & variable='shape')
         return
      end select
      indenter%variables = 'radius_um'
      if (settings%shape == cone_name) indenter%variables = 'half_angle_deg'
      if (allocated(settings%depth_um)) then
         call indenter%check_length('depth_um', settings%depth_um, error)
         if (allocated(error)) return
         indenter%depth = settings%depth_um
         indenter%contact_radius = indenter%contact_radius_of(indenter%depth)
      else
         call indenter%check_length('contact_radius_um', settings%contact_radius_um, error)
         if (allocated(error)) return
         indenter%contact_radius = settings%contact_radius_um
         indenter%depth = indenter%depth_of(indenter%contact_radius)
      end if
   end subroutine new_indenter

   !> Height of the indenter above the surface at zero depth, um, at a distance from the axis.
   elemental real(wp) function gap(self, length)
      class(indenter_type), intent(in) :: self
      !> Distance from the axis, um.
      real(wp), intent(in) :: length

      gap = self%steepness*length**self%exponent
   end function gap

   !> Force at a depth, divided by the plane-strain modulus, um2.
   elemental real(wp) function unit_force(self, length)
      class(indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length

      unit_force = 2.0_wp*self%exponent/(self%exponent + 1.0_wp) &
                  & *self%contact_radius_of(length)*length
   end function unit_force

   !> Depth at a contact radius, um.
   elemental real(wp) function depth_of(self, length)
      class(indenter_type), intent(in) :: self
      !> Contact radius, um.
      real(wp), intent(in) :: length

      depth_of = self%sinking*length**self%exponent
   end function depth_of

   !> Contact radius at a depth, um.
   elemental real(wp) function contact_radius_of(self, length) result(contact_radius)
      class(indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length

      contact_radius = (length/self%sinking)**(1.0_wp/self%exponent)
   end function contact_radius_of

   !> Refuse a last point beyond the shape: the contact stays on the lower half of the sphere, whose
   !> tip a paraboloid has.
   subroutine check_length(self, variable, length, error)
      class(indenter_type), intent(in) :: self
      !> Name of the variable that states the length.
      character(len=*), intent(in) :: variable
      !> Its value, um.
      real(wp), intent(in) :: length
      type(error_type), allocatable, intent(out) :: error

      if (.not. length < self%radius) then
         call refuse(error, to_text(length)//' um is beyond the tip; allowed ' &
            & //'below its radius_um of '//to_text(self%radius)//' um', variable=variable)
      end if
   end subroutine check_length

   !> Very large at distances beyond the radius of the sphere.
   elemental real(wp) function sphere_gap(self, length) result(gap)
      class(sphere_indenter_type), intent(in) :: self
      !> Distance from the axis, um.
      real(wp), intent(in) :: length
      !> In radii of the sphere.
      real(wp), parameter :: very_large = 1.0e3_wp

      ! r2/(R + sqrt(R2 - r2)) equals R - sqrt(R2 - r2), without cancellation.
      gap = very_large*self%radius
      if (length < self%radius) gap = length**2/(self%radius + sqrt(self%radius**2 - length**2))
   end function sphere_gap

   !> Force over modulus and R², as a function of t = a/R: (1 + t²) atanh(t) - t.
   elemental real(wp) function sphere_unit_force(self, length) result(unit_force)
      class(sphere_indenter_type), intent(in) :: self
      !> Depth, um.
      real(wp), intent(in) :: length
      !> Below this value the terms cancel, and a series is used instead: ten of its terms leave an
      !> error of 1e-17.
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
   end function sphere_unit_force

   elemental real(wp) function sphere_depth_of(self, length) result(depth_of)
      class(sphere_indenter_type), intent(in) :: self
      !> Contact radius, um.
      real(wp), intent(in) :: length

      depth_of = length*atanh(length/self%radius)
   end function sphere_depth_of

   !> Solve t atanh(t) = h/R for t = a/R, by Newton's method in u = atanh(t), safeguarded by bounds
   !> that close in on the solution.
   elemental real(wp) function sphere_contact_radius_of(self, length) result(contact_radius)
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
   end function sphere_contact_radius_of

end module indenters
