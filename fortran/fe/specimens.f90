!> The specimens other than the half-space, the names of all, and the specimen that the settings
!> define.
!>
!> A new specimen needs a type that extends `specimen_type`, a name here, and lines in
!> `new_indentation`.
module specimens
   use basic_specimen, only: core_of_contact, fineness, graded_layers, halfspace_name, &
      & layers_of_ratio, mesh_plan_type, mesh_stage_type, require, specimen_type
   use crystal_elasticity, only: averages_type, compliance, isotropic_stiffness, &
      & polycrystal_averages
   use errors, only: error_type, locate_error, refuse
   use indenters, only: indenter_type, new_indenter
   use kinds, only: wp
   use settings_schema, only: settings_type
   use text, only: to_text
   implicit none
   private
   public :: geometry_names, new_indentation

   character(len=*), parameter :: block_name = 'block', grain_name = 'grain'
   character(len=*), parameter :: geometry_names = halfspace_name//', '//block_name//', ' &
      & //grain_name

   !> A block with a clamped bottom and free sides; by default that of the paper, 9.6 x 9.6 x 4.8
   !> um.
   type, extends(specimen_type) :: block_specimen_type
      !> Edge along x and y, and edge along z, um.
      real(wp) :: width = 0.0_wp, height = 0.0_wp
   contains
      procedure :: set_up => block_set_up, check_sizes => block_check_sizes, plan => block_plan
   end type block_specimen_type

   !> Half-width of the box of bricks under the contact in contact radii, and cells over the
   !> half-width at refine = 1.
   real(wp), parameter :: box_width = 1.3_wp, box_cells = 10.0_wp
   !> Of the paper's block: layers around the box at refine = 1, and size of the block relative to
   !> the box.
   real(wp), parameter :: paper_layers = 7.0_wp, paper_ratio = 4.8_wp/0.65_wp
   !> Relative error of C3D8 in these layers at refine = 1 (docs/verification/paper.md).
   real(wp), parameter :: paper_layers_error = 0.025_wp
   !> Least width of a block in contact radii; least and largest height relative to half the width;
   !> least half-width relative to that of the box under the contact.
   real(wp), parameter :: least_width = 4.0_wp, lowest = 0.25_wp, highest = 4.0_wp, &
      & least_ratio = 1.2_wp

   !> A grain among isotropic neighbours: bricks of the grain up to its boundary, a hemisphere,
   !> surrounded by layers and infinite elements of the matrix.
   !>
   !> A matrix without a stated stiffness is the polycrystal of the grain's own crystal.
   type, extends(specimen_type) :: grain_specimen_type
      !> um.
      real(wp) :: radius = 0.0_wp
   contains
      procedure :: set_up => grain_set_up, check_sizes => grain_check_sizes, plan => grain_plan, &
         & materials => grain_materials, by_crystal => grain_by_crystal
   end type grain_specimen_type

   !> Least size of the boundary relative to the box under the contact.
   real(wp), parameter :: clearance = 1.2_wp
   !> From this half-width on, relative to the radius, layers of this growth turn into the shape of
   !> the boundary.
   real(wp), parameter :: turning = 0.45_wp, turning_growth = 1.25_wp
   !> Size of the mesh in contact radii and in radii of a grain; the larger size is used.
   real(wp), parameter :: outer_contact = 5.0_wp, outer_grain = 2.0_wp

contains

   !> The indenter and the specimen of the settings. An error has the group and the variable.
   subroutine new_indentation(settings, indenter, specimen, error)
      type(settings_type), intent(in) :: settings
      class(indenter_type), allocatable, intent(out) :: indenter
      class(specimen_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error

      call new_indenter(settings%indenter, indenter, error)
      call locate_error(error, '', 'indenter')
      if (allocated(error)) return
      select case (settings%specimen%geometry)
      case (halfspace_name)
         allocate (specimen)
      case (block_name)
         allocate (block_specimen_type :: specimen)
      case (grain_name)
         allocate (grain_specimen_type :: specimen)
      case default
         call refuse(error, "'"//settings%specimen%geometry//"' has no mesh; allowed: " &
            & //geometry_names//'; films are computed by theory', group='specimen', &
            & variable='geometry')
         return
      end select
      specimen%contact_radius = indenter%contact_radius
      specimen%element_size = specimen%contact_radius/fineness
      specimen%element = settings%simulation%element
      specimen%estimator = settings%specimen%estimator
      call specimen%set_up(settings, error)
      ! Theory needs no mesh.
      if (.not. allocated(error) .and. settings%simulation%simulator /= 'theory') then
         call specimen%check_sizes(error)
      end if
      call locate_error(error, '', 'specimen')
      if (len(specimen%element) == 0) specimen%element = 'c3d8i'
   end subroutine new_indentation

   subroutine block_set_up(self, settings, error)
      class(block_specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error

      self%variables = 'width_um, height_um'
      self%parts = 'the specimen'
      if (len(self%element) == 0) self%element = 'c3d8'
      if (self%element == 'c3d8') then
         self%layers_error = paper_layers_error
         if (allocated(settings%simulation%extrapolate)) then
            if (settings%simulation%extrapolate) then
               call refuse(error, 'C3D8 on a block are not extrapolated: their error follows ' &
                  & //'from the layers, not from the size of the elements; use element = ' &
                  & //'''c3d8i''', group='simulation', variable='extrapolate')
            end if
         end if
      end if
      self%element_size = box_width*self%contact_radius/box_cells
      self%width = settings%specimen%width_um
      self%height = settings%specimen%height_um
   end subroutine block_set_up

   !> Refuse a block that is too small for its contact, or whose height does not suit its width.
   subroutine block_check_sizes(self, error)
      class(block_specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error

      associate (half => 0.5_wp*self%width, narrowest => max(least_width, &
         & 2.0_wp*least_ratio*box_width*self%zone)*self%contact_radius)
         if (self%width < narrowest) then
            call refuse(error, to_text(self%width) &
               & //' um is too narrow for a contact radius of '//to_text(self%contact_radius, 3) &
               & //' um; allowed from '//to_text(narrowest, 3)//' um', variable='width_um')
         else if (self%height < lowest*half .or. self%height > highest*half) then
            call refuse(error, to_text(self%height) &
               & //' um does not go with width_um = '//to_text(self%width)//'; allowed ' &
               & //to_text(lowest*half)//' to '//to_text(highest*half)//' um', &
               & variable='height_um')
         end if
      end associate
   end subroutine block_check_sizes

   !> Plan a box under the contact that has the proportions of the block.
   pure type(mesh_plan_type) function block_plan(self, refine) result(plan)
      class(block_specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine
      real(wp) :: proportion
      integer :: default_cells

      proportion = self%height/(0.5_wp*self%width)
      default_cells = max(2, nint(box_cells*refine))
      plan%half_cells = nint(default_cells*self%zone)
      plan%depth_cells = max(2, nint(proportion*plan%half_cells))
      plan%half_width = box_width*self%contact_radius*(real(plan%half_cells, wp)/default_cells)
      plan%depth = proportion*plan%half_width
      plan%stages = [layers_of_ratio(0.5_wp*self%width/plan%half_width, &
         & exp(log(paper_ratio)/paper_layers), refine)]
      plan%is_clamped = .true.
   end function block_plan

   subroutine grain_set_up(self, settings, error)
      class(grain_specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error

      self%variables = 'grain_radius_um, matrix'
      self%parts = 'the grain, the matrix around it'
      ! With this ratio the few layers that turn into the boundary have similar proportions on both
      ! meshes (docs/verification/simulation.md).
      self%coarse_ratio = 0.75_wp
      associate (stated => settings%specimen)
         call require(grain_name, 'grain_radius_um', stated%grain_radius_um, self%radius, error)
         if (stated%matrix /= 'self') then
            self%variables = self%variables//', matrix_young_gpa, matrix_nu'
            call require(grain_name, 'matrix_young_gpa', stated%matrix_young_gpa, self%young, error)
            self%poisson = stated%matrix_nu
         end if
      end associate
   end subroutine grain_set_up

   !> Refuse a grain that is smaller than the refined zone of the mesh.
   subroutine grain_check_sizes(self, error)
      class(grain_specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      type(mesh_plan_type) :: plan
      real(wp) :: least

      plan = core_of_contact(1.0_wp, self%contact_radius, self%zone)
      least = clearance*norm2([plan%half_width, plan%half_width, plan%depth])
      if (self%radius < least) then
         call refuse(error, to_text(self%radius)//' um does not hold the refined zone under a ' &
            & //'contact of radius '//to_text(self%contact_radius, 3)//' um; allowed from ' &
            & //to_text(least, 3)//' um, or indent less deeply', variable='grain_radius_um')
      end if
   end subroutine grain_check_sizes

   pure type(mesh_plan_type) function grain_plan(self, refine) result(plan)
      class(grain_specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine
      type(mesh_stage_type) :: turn
      real(wp) :: width, outer

      plan = core_of_contact(refine, self%contact_radius, self%zone)
      width = max(turning*self%radius, plan%half_width)
      plan%stages = graded_layers(plan%half_width, width, self%contact_radius*plan%widening, &
         & refine, 1)
      turn = layers_of_ratio(self%radius/width, turning_growth, refine)
      turn%radius = self%radius
      outer = max(outer_contact*self%contact_radius, outer_grain*self%radius)
      plan%stages = [plan%stages, turn, &
         & graded_layers(self%radius, outer, self%contact_radius, refine, 2)]
      plan%stages(1)%coarsen = .true.
      plan%far_material = 2
   end function grain_plan

   !> Grain and matrix.
   pure function grain_materials(self, crystal) result(c)
      class(grain_specimen_type), intent(in) :: self
      !> Stiffness of the grain in the sample frame, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      real(wp), allocatable :: c(:, :, :)
      type(averages_type) :: matrix

      c = spread(crystal, 3, 2)
      c(:, :, 2) = self%own_stiffness()
      if (self%young > 0.0_wp) return
      matrix = polycrystal_averages(crystal)
      c(:, :, 2) = isotropic_stiffness(matrix%young, matrix%poisson)
   end function grain_materials

   !> The stiffness of the polycrystal follows that of the grain.
   pure function grain_by_crystal(self, by_material, crystal) result(by)
      class(grain_specimen_type), intent(in) :: self
      !> As in `by_crystal` of the basic specimen.
      real(wp), intent(in) :: by_material(:, :, :), crystal(6, 6)
      !> Stiffnesses of unit bulk modulus and of unit shear modulus, and the mean over both of
      !> Voigt's and Reuss' derivative of these moduli (see `polycrystal_averages`).
      real(wp), dimension(6, 6) :: by, s, volume, shape, bulk, shear
      integer :: i

      by = by_material(:, :, 1)
      if (self%young > 0.0_wp) return
      volume = 0.0_wp
      volume(:3, :3) = 1.0_wp
      shape = -2.0_wp/3.0_wp*volume
      do i = 1, 3
         shape(i, i) = 4.0_wp/3.0_wp
         shape(i + 3, i + 3) = 1.0_wp
      end do
      s = compliance(crystal)
      bulk = matmul(s, matmul(volume, s))/sum(volume*s)**2 + volume/9.0_wp
      shear = 5.0_wp*matmul(s, matmul(shape, s))/sum(shape*s)**2 + shape/20.0_wp
      do i = 4, 6
         shear(i, i) = shear(i, i) + 0.15_wp
      end do
      by = by + 0.5_wp*(bulk*sum(by_material(:, :, 2)*volume) &
         & + shear*sum(by_material(:, :, 2)*shape))
   end function grain_by_crystal
end module specimens
