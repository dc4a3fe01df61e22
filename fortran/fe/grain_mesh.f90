!> A grain among isotropic neighbours: bricks of the grain up to its boundary, a hemisphere or a cylinder, layers and infinite elements of
!> the matrix around it.
module grain_mesh
   use crystal_elasticity, only: polycrystal_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: core_of_contact, graded_layers, layers_of_ratio, mesh_plan_type, mesh_stage_type, to_ball, &
      & to_cylinder
   use specimen_mesh, only: specimen_mesh_type
   use text, only: to_text
   implicit none
   private
   public :: grain_mesh_type

   !> A matrix of no stiffness that is given is the polycrystal of the grain's own crystal.
   type, extends(specimen_mesh_type) :: grain_mesh_type
      !> um; depth 0: a hemisphere, else a cylinder.
      real(wp) :: radius = 0.0_wp, depth = 0.0_wp
   contains
      procedure :: check
      procedure :: make
      procedure :: materials
   end type grain_mesh_type

   !> The boundary is at least so far from the box under the contact, over the box's size.
   real(wp), parameter :: clearance = 1.2_wp
   !> A cylinder is so deep, in radii.
   real(wp), parameter :: flattest = 0.5_wp, deepest = 2.0_wp
   !> From here on (half-width over radius) the layers turn into the shape of the boundary, growing so.
   real(wp), parameter :: turning = 0.45_wp, turning_growth = 1.25_wp
   !> Where the mesh ends, in contact radii and radii of the grain, whichever is farther.
   real(wp), parameter :: outer_contact = 5.0_wp, outer_grain = 2.0_wp

contains

   !> Refuse a grain that does not hold the refined zone of the mesh.
   subroutine check(self, contact_radius, error)
      class(grain_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: contact_radius
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      real(wp) :: corner(3)

      plan = core_of_contact(1.0_wp, contact_radius)
      corner = [plan%half_width, plan%half_width, plan%depth]
      if (self%depth > 0.0_wp) then
         call refuse_below(clearance*plan%depth, 'grain_depth_um', self%depth, contact_radius, error)
         corner(3) = 0.0_wp
      end if
      if (.not. allocated(error)) call refuse_below(clearance*norm2(corner), 'grain_radius_um', self%radius, contact_radius, error)
      if (allocated(error) .or. .not. self%depth > 0.0_wp) return
      if (self%depth < flattest*self%radius .or. self%depth > deepest*self%radius) call raise(error, 'grain_depth_um: ' &
         & //to_text(self%depth)//' um does not go with grain_radius_um = '//to_text(self%radius)//'; allowed ' &
         & //to_text(flattest*self%radius, 3)//' to '//to_text(deepest*self%radius, 3)//' um', exit_bad_input)
   end subroutine check

   subroutine refuse_below(least, name, length, contact_radius, error)
      !> um; the variable with this name, um.
      real(wp), intent(in) :: least, length
      character(len=*), intent(in) :: name
      !> um.
      real(wp), intent(in) :: contact_radius
      type(error_type), allocatable, intent(out) :: error

      if (length < least) call raise(error, name//': '//to_text(length)//' um does not hold the refined zone under a contact of ' &
         & //'radius '//to_text(contact_radius, 3)//' um; allowed from '//to_text(least, 3)//' um, or indent less deeply', &
         & exit_bad_input)
   end subroutine refuse_below

   !> The mesh with `refine` times the default's elements per contact radius, of a contact radius in um.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(grain_mesh_type), intent(in) :: self
      !> Relative to the default; contact radius at the last depth (half-space), um.
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      type(mesh_stage_type) :: turn
      real(wp) :: width

      plan = core_of_contact(refine, contact_radius)
      width = turning*self%radius
      if (self%depth > 0.0_wp) width = min(width, turning*self%depth*plan%half_width/plan%depth)
      width = max(width, plan%half_width)
      plan%stages = graded_layers(plan%half_width, width, contact_radius, refine, 0.0_wp, 1)
      turn = layers_of_ratio(max(self%radius, self%depth*plan%half_width/plan%depth)/width, turning_growth, refine)
      turn%shape = merge(to_cylinder, to_ball, self%depth > 0.0_wp)
      turn%radius = self%radius
      turn%depth = self%depth
      plan%stages = [plan%stages, turn, graded_layers(self%radius, max(outer_contact*contact_radius, outer_grain*self%radius), &
         & contact_radius, refine, 0.0_wp, 2)]
      plan%stages(1)%coarsen = .true.
      plan%far_material = 2
      call new_mesh(plan, mesh, error)
   end subroutine make

   !> The grain and the matrix.
   pure function materials(self, crystal) result(c)
      class(grain_mesh_type), intent(in) :: self
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
end module grain_mesh
