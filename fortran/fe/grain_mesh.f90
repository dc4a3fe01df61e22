!> A grain among isotropic neighbours: bricks of the grain up to its boundary, a hemisphere or a cylinder, layers and infinite elements of the
!> matrix around it.
module grain_mesh
   use crystal_elasticity, only: isotropic_stiffness, polycrystal_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: wp
   use mesh_plan, only: core_of_contact, finest_edge, graded_layers, mesh_plan_type, mesh_stage_type, layers_of_ratio, to_ball, to_cylinder
   use specimen_mesh, only: specimen_mesh_type
   use text, only: to_text
   implicit none
   private
   public :: grain_mesh_type

   type, extends(specimen_mesh_type) :: grain_mesh_type
      !> um; depth 0: a hemisphere, else a cylinder.
      real(wp) :: radius = 0.0_wp, depth = 0.0_wp
      !> Of an isotropic matrix: Young's modulus (GPa) and Poisson's ratio; 0: the polycrystal of the grain's own crystal.
      real(wp) :: young = 0.0_wp, poisson = 0.0_wp
   contains
      procedure :: check
      procedure :: element_size
      procedure :: make
      procedure :: materials
      procedure :: own_stiffness
   end type grain_mesh_type

   !> The boundary is at least so far from the box under the contact, over the box's size.
   real(wp), parameter :: clearance = 1.2_wp
   !> From here on (half-width over radius) the layers turn into the shape of the boundary.
   real(wp), parameter :: turning = 0.45_wp
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
      real(wp) :: least

      plan = core_of_contact(1.0_wp, contact_radius)
      least = clearance*norm2([plan%half_width, plan%half_width, plan%depth])
      if (self%depth > 0.0_wp) least = clearance*norm2([plan%half_width, plan%half_width])
      if (self%radius < least) then
         call raise(error, 'grain_radius_um: '//to_text(self%radius)//' um does not hold the refined zone under a contact of radius ' &
            & //to_text(contact_radius, 3)//' um; allowed from '//to_text(least, 3)//' um, or indent less deeply', exit_bad_input)
      else if (self%depth > 0.0_wp .and. self%depth < clearance*plan%depth) then
         call raise(error, 'grain_depth_um: '//to_text(self%depth)//' um does not hold the refined zone under a contact of radius ' &
            & //to_text(contact_radius, 3)//' um; allowed from '//to_text(clearance*plan%depth, 3)//' um, or indent less deeply', &
            & exit_bad_input)
      end if
   end subroutine check

   pure real(wp) function element_size(self, contact_radius)
      class(grain_mesh_type), intent(in) :: self
      !> um.
      real(wp), intent(in) :: contact_radius

      associate (unused => self)
      end associate
      element_size = finest_edge(contact_radius)
   end function element_size

   !> The mesh with `refine` times the default's elements per contact radius, of a contact radius in um.
   subroutine make(self, refine, contact_radius, mesh, error)
      class(grain_mesh_type), intent(in) :: self
      !> Relative to the default; contact radius at the last depth (half-space), um.
      real(wp), intent(in) :: refine, contact_radius
      type(mesh_type), intent(out) :: mesh
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      type(mesh_stage_type), allocatable :: turn(:)
      real(wp) :: inner, width
      integer :: i

      plan = core_of_contact(refine, contact_radius)
      inner = turning*self%radius
      if (self%depth > 0.0_wp) inner = min(inner, turning*self%depth*plan%half_width/plan%depth)
      allocate (plan%stages(0))
      width = plan%half_width
      if (inner > 1.2_wp*width) then
         plan%stages = graded_layers(width, inner, contact_radius, refine, 0.0_wp, 1)
         width = inner
      end if
      turn = graded_layers(width, max(self%radius, 1.2_wp*width), contact_radius, refine, 0.0_wp, 1)
      ! One stage for the turn, with as many layers.
      i = sum(turn%layers)
      turn = [layers_of_ratio(max(self%radius/width, 1.2_wp), 1.2_wp, refine)]
      turn(1)%layers = i
      turn(1)%growth = turn(1)%ratio**(1.0_wp/i)
      turn(1)%shape = merge(to_cylinder, to_ball, self%depth > 0.0_wp)
      turn(1)%radius = self%radius
      turn(1)%depth = self%depth
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
         c(:, :, 2) = isotropic_stiffness(self%young, self%poisson)
      else
         c(:, :, 2) = polycrystal_stiffness(crystal)
      end if
   end function materials

   !> That of the matrix, GPa; zero where it is the crystal's own.
   pure function own_stiffness(self) result(c)
      class(grain_mesh_type), intent(in) :: self
      real(wp) :: c(6, 6)

      c = 0.0_wp
      if (self%young > 0.0_wp) c = isotropic_stiffness(self%young, self%poisson)
   end function own_stiffness
end module grain_mesh
