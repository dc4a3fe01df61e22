!> A grain among isotropic neighbours: bricks of the grain up to its boundary, a hemisphere or a cylinder, layers and infinite elements of
!> the matrix around it.
module grain_specimen
   use basic_specimen, only: core_of_contact, graded_layers, layers_of_ratio, mesh_plan_type, mesh_stage_type, require, &
      & specimen_type, to_ball, to_cylinder
   use crystal_elasticity, only: polycrystal_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use settings_schema, only: settings_type
   use text, only: to_text
   implicit none
   private
   public :: grain_specimen_type, grain_name

   character(len=*), parameter :: grain_name = 'grain'

   !> A matrix of no stiffness that is given is the polycrystal of the grain's own crystal.
   type, extends(specimen_type) :: grain_specimen_type
      !> um; depth 0: a hemisphere, else a cylinder.
      real(wp) :: radius = 0.0_wp, depth = 0.0_wp
   contains
      procedure :: set_up, check_sizes, plan, materials
   end type grain_specimen_type

   !> The boundary is at least so far from the box under the contact, over the box's size.
   real(wp), parameter :: clearance = 1.2_wp
   !> A cylinder is so deep, in radii.
   real(wp), parameter :: flattest = 0.5_wp, deepest = 2.0_wp
   !> From here on (half-width over radius) the layers turn into the shape of the boundary, growing so.
   real(wp), parameter :: turning = 0.45_wp, turning_growth = 1.25_wp
   !> Where the mesh ends, in contact radii and radii of the grain, whichever is farther.
   real(wp), parameter :: outer_contact = 5.0_wp, outer_grain = 2.0_wp

contains

   subroutine set_up(self, settings, error)
      class(grain_specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error

      self%variables = 'grain_radius_um, grain_depth_um, matrix'
      self%parts = 'the grain, the matrix around it'
      ! So the few layers that turn into its boundary are about in proportion on both meshes (docs/simulation.md).
      self%coarse_ratio = 0.75_wp
      associate (stated => settings%specimen)
         call require(grain_name, 'grain_radius_um', stated%grain_radius_um, self%radius, error)
         if (allocated(stated%grain_depth_um)) self%depth = stated%grain_depth_um
         if (stated%matrix /= 'self') then
            self%variables = self%variables//', matrix_young_gpa, matrix_nu'
            call require(grain_name, 'matrix_young_gpa', stated%matrix_young_gpa, self%young, error)
            self%poisson = stated%matrix_nu
         end if
      end associate
   end subroutine set_up

   !> Refuse a grain that does not hold the refined zone of the mesh.
   subroutine check_sizes(self, error)
      class(grain_specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      real(wp) :: corner(3)

      plan = core_of_contact(1.0_wp, self%contact_radius, self%zone)
      corner = [plan%half_width, plan%half_width, plan%depth]
      if (self%depth > 0.0_wp) then
         call refuse_below(clearance*plan%depth, 'grain_depth_um', self%depth)
         corner(3) = 0.0_wp
      end if
      if (.not. allocated(error)) call refuse_below(clearance*norm2(corner), 'grain_radius_um', self%radius)
      if (allocated(error) .or. .not. self%depth > 0.0_wp) return
      if (self%depth < flattest*self%radius .or. self%depth > deepest*self%radius) call raise(error, 'grain_depth_um: ' &
         & //to_text(self%depth)//' um does not go with grain_radius_um = '//to_text(self%radius)//'; allowed ' &
         & //to_text(flattest*self%radius, 3)//' to '//to_text(deepest*self%radius, 3)//' um', exit_bad_input)

   contains

      subroutine refuse_below(least, name, length)
         real(wp), intent(in) :: least, length
         character(len=*), intent(in) :: name

         if (length < least) call raise(error, name//': '//to_text(length)//' um does not hold the refined zone under a contact ' &
            & //'of radius '//to_text(self%contact_radius, 3)//' um; allowed from '//to_text(least, 3) &
            & //' um, or indent less deeply', exit_bad_input)
      end subroutine refuse_below
   end subroutine check_sizes

   pure function plan(self, refine)
      class(grain_specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine
      type(mesh_plan_type) :: plan
      type(mesh_stage_type) :: turn
      real(wp) :: width

      plan = core_of_contact(refine, self%contact_radius, self%zone)
      width = turning*self%radius
      if (self%depth > 0.0_wp) width = min(width, turning*self%depth*plan%half_width/plan%depth)
      width = max(width, plan%half_width)
      plan%stages = graded_layers(plan%half_width, width, self%contact_radius*plan%widening, refine, 0.0_wp, 1)
      turn = layers_of_ratio(max(self%radius, self%depth*plan%half_width/plan%depth)/width, turning_growth, refine)
      turn%shape = merge(to_cylinder, to_ball, self%depth > 0.0_wp)
      turn%radius = self%radius
      turn%depth = self%depth
      plan%stages = [plan%stages, turn, graded_layers(self%radius, max(outer_contact*self%contact_radius, &
         & outer_grain*self%radius), self%contact_radius, refine, 0.0_wp, 2)]
      plan%stages(1)%coarsen = .true.
      plan%far_material = 2
   end function plan

   !> The grain and the matrix.
   pure function materials(self, crystal) result(c)
      class(grain_specimen_type), intent(in) :: self
      !> Sample frame, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      real(wp), allocatable :: c(:, :, :)

      c = spread(crystal, 3, 2)
      if (self%young > 0.0_wp) then
         c(:, :, 2) = self%own_stiffness()
      else
         c(:, :, 2) = polycrystal_stiffness(crystal)
      end if
   end function materials
end module grain_specimen
