!> A film on a substrate: bricks of the film down to the interface, layers that go on around both, infinite elements of the substrate.
!>
!> A thin film ends inside the box under the indenter, a thick one where layers around the box reach the interface. Below begins a box of
!> the substrate's bricks, and the further layers are homothetic about the point of the interface under the contact; in the film they
!> go on sideways. A rigid substrate is a clamped bottom, and the sides are clamped some thicknesses away, where nothing moves.
module film_specimen
   use basic_specimen, only: clamped_around, core_of_contact, graded_layers, mesh_plan_type, mesh_stage_type, require, &
      & specimen_type
   use crystal_elasticity, only: hill_young_poisson, polycrystal_averages
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use settings_schema, only: settings_type
   use text, only: to_text
   implicit none
   private
   public :: film_specimen_type, film_name

   character(len=*), parameter :: film_name = 'film'

   !> A substrate of no stiffness that is given is rigid.
   type, extends(specimen_type) :: film_specimen_type
      !> um.
      real(wp) :: thickness = 0.0_wp
   contains
      procedure :: set_up, check_sizes, plan, materials, contrast_error
   end type film_specimen_type

   !> A film up to this thickness, in depths of the box of a half-space, ends inside the box.
   real(wp), parameter :: thick = 1.25_wp
   !> Depth of the substrate's box over half its width, and edge of a thin film's bricks there, vertical over horizontal.
   real(wp), parameter :: floor_proportion = 0.7_wp, flat = 1.5_wp
   !> Where the mesh ends, in contact radii and thicknesses, whichever is farther.
   real(wp), parameter :: outer_contact = 5.0_wp, outer_thickness = 10.0_wp

contains

   subroutine set_up(self, settings, error)
      class(film_specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error

      self%variables = 'thickness_um, substrate'
      self%parts = 'the film, the substrate'
      associate (stated => settings%specimen)
         call require(film_name, 'thickness_um', stated%thickness_um, self%thickness, error)
         if (stated%substrate /= 'rigid') then
            self%variables = self%variables//', substrate_young_gpa, substrate_nu'
            call require(film_name, 'substrate_young_gpa', stated%substrate_young_gpa, self%young, error)
            self%poisson = stated%substrate_nu
         end if
      end associate
   end subroutine set_up

   !> Refuse a film thinner than two elements.
   subroutine check_sizes(self, error)
      class(film_specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      if (self%thickness < 2.0_wp*self%element_size) call raise(error, 'thickness_um: ' &
         & //to_text(self%thickness)//' um is less than two elements of '//to_text(self%element_size, 3) &
         & //' um under a contact of radius '//to_text(self%contact_radius, 3)//' um; allowed from ' &
         & //to_text(2.0_wp*self%element_size, 3)//' um, or indent less deeply', exit_bad_input)
   end subroutine check_sizes

   pure function plan(self, refine)
      class(film_specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine
      type(mesh_plan_type) :: plan
      type(mesh_stage_type) :: box
      real(wp) :: edge, width, cell, contact_radius
      logical :: thin

      plan = core_of_contact(refine, self%contact_radius, self%zone)
      ! A wider zone is wider everywhere, and no deeper.
      contact_radius = self%contact_radius*plan%widening
      edge = plan%half_width/plan%half_cells
      width = plan%half_width
      thin = self%thickness <= thick*plan%depth
      box = mesh_stage_type(growth=2.0_wp, material=2)
      allocate (plan%stages(0))
      if (thin) then
         box%floor_depth = max(plan%depth - self%thickness, floor_proportion*width/plan%widening)
         box%floor_levels = max(2, 2*nint(0.5_wp*box%floor_depth/(flat*edge)))
         plan%depth = self%thickness
         plan%depth_cells = max(2, 2*nint(0.5_wp*self%thickness/edge))
      else
         ! The proportions of the box stay.
         width = plan%half_width*self%thickness/plan%depth
         plan%stages = graded_layers(plan%half_width, width, contact_radius, refine, 0.0_wp, 1)
         plan%stages(1)%coarsen = .true.
         cell = 2.0_wp*edge*self%thickness/plan%depth
         box%floor_levels = max(2, nint(floor_proportion*width/plan%widening/cell))
         box%floor_depth = box%floor_levels*cell
      end if
      if (self%young > 0.0_wp) then
         plan%stages = [plan%stages, box]
         plan%far_material = [2, 3]
      else
         plan%clamped_depth = self%thickness
         plan%closing = clamped_around
      end if
      plan%stages = [plan%stages, graded_layers(width, max(outer_contact*contact_radius, outer_thickness*self%thickness), &
         & contact_radius, refine, self%thickness, 2)]
      if (thin) plan%stages(findloc(plan%stages%layers > 0, .true., dim=1))%coarsen = .true.
   end function plan

   !> The film, the substrate, and their mean: beyond the mesh an infinite element makes a wedge of what is a film, with twice its energy,
   !> since strains decay as the square of the distance.
   pure function materials(self, crystal) result(c)
      class(film_specimen_type), intent(in) :: self
      !> Sample frame, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      real(wp), allocatable :: c(:, :, :)

      c = spread(crystal, 3, 3)
      if (.not. self%young > 0.0_wp) return
      c(:, :, 2) = self%own_stiffness()
      c(:, :, 3) = 0.5_wp*(c(:, :, 1) + c(:, :, 2))
   end function materials

   !> A film that is stiffer than its substrate is resolved worse (docs/simulation.md, `bench simulate pairs`).
   pure real(wp) function contrast_error(self, crystal)
      class(film_specimen_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: crystal(6, 6)
      !> Of what is alike, and by the logarithm of the ratio of Young's moduli.
      real(wp), parameter :: alike = 0.0015_wp, slope = 0.0055_wp
      real(wp) :: young, poisson

      contrast_error = alike
      if (.not. self%young > 0.0_wp) return
      call hill_young_poisson(polycrystal_averages(crystal), young, poisson)
      contrast_error = alike + slope*max(0.0_wp, log(young/self%young))
   end function contrast_error
end module film_specimen
