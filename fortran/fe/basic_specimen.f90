!> The specimen as the simulation sees it. A specimen plans its own mesh, for any fineness. The
!> basic one is the half-space: bricks under the indenter, growing layers around them, infinite
!> elements outside. The other specimens extend it.
!>
!> The mesh generator executes the plan: a box of bricks under the indenter, and stages of layers
!> around it, from the inside out.
module basic_specimen
   use crystal_elasticity, only: isotropic_stiffness, log_anisotropy
   use errors, only: error_type, refuse
   use kinds, only: wp
   use settings_schema, only: settings_type
   use text, only: to_text
   implicit none
   private
   public :: specimen_type, halfspace_name, require, mesh_plan_type, mesh_stage_type, check_plan
   public :: core_of_contact, fineness, layers_of_ratio, graded_layers, surface_facets

   character(len=*), parameter :: halfspace_name = 'halfspace'

   !> A stage of layers around the current surface.
   type :: mesh_stage_type
      !> Whether the surface is coarsened 2:1 first.
      logical :: coarsen = .false.
      !> Number of layers, and ratio of the thicknesses of successive layers (> 1).
      integer :: layers = 0
      real(wp) :: growth = 0.0_wp
      !> Growth of the surface over the whole stage; or, above 0, radius of the hemisphere in which
      !> the stage ends, um.
      real(wp) :: ratio = 1.0_wp, radius = 0.0_wp
      integer :: material = 1
   end type mesh_stage_type

   type :: mesh_plan_type
      !> Cells of the box per half-width and over its depth; the box is of material 1.
      integer :: half_cells = 0, depth_cells = 0
      !> Half-width and depth of the box, um; its half-width relative to that of the default box.
      real(wp) :: half_width = 0.0_wp, depth = 0.0_wp, widening = 1.0_wp
      type(mesh_stage_type), allocatable :: stages(:)
      !> Whether a clamped bottom and free sides end the mesh, in place of infinite elements.
      logical :: is_clamped = .false.
      !> Material of the infinite elements.
      integer :: far_material = 1
   end type mesh_plan_type

   !> Elements per contact radius at refine = 1, for all specimens but the block.
   real(wp), parameter :: fineness = 9.5_wp
   !> Bricks of the largest mesh that is allowed.
   integer, parameter :: most_bricks = 400000

   !> Largest relative error at log-anisotropy 1 and at the fineness of the study (elements per
   !> contact radius), of bricks with and without incompatible modes.
   real(wp), parameter :: worst_incompatible = 1.0e-3_wp, worst_plain = 1.3e-3_wp, &
      & studied_fineness = 9.5_wp
   !> Exponents of the log-anisotropy and of the fineness in the error.
   real(wp), parameter :: power_of_anisotropy = 3.5_wp, order = 2.0_wp
   !> Factor by which extrapolation lowers the largest error. It divides the mean error by about
   !> five, but the largest by less than two.
   real(wp), parameter :: extrapolated = 0.7_wp
   !> A modulus is extrapolated from this relative error on, unless the settings say otherwise.
   real(wp), parameter :: limit_of_one_mesh = 0.005_wp

   type :: specimen_type
      !> Names, separated by ', ', of the variables that this specimen reads and some others do not,
      !> and of the materials.
      character(len=:), allocatable :: variables, parts
      !> How the modulus is computed (`&specimen estimator`); the brick element, 'c3d8' or 'c3d8i',
      !> from the settings or the specimen's default.
      character(len=:), allocatable :: estimator, element
      !> Whether the specimen has a length of its own. If so, its modulus depends on the depth, and
      !> the theory of the half-space is not valid.
      logical :: has_length = .true.
      !> Contact radius at the last depth (half-space), and edge of the bricks under the contact at
      !> refine = 1, um.
      real(wp) :: contact_radius = 0.0_wp, element_size = 0.0_wp
      !> Size of the refined zone of the mesh relative to the default; a long elliptical contact
      !> needs a larger one.
      real(wp) :: zone = 1.0_wp
      !> Young's modulus (GPa) and Poisson's ratio of the other material, which the user states; 0
      !> if none is stated.
      real(wp) :: young = 0.0_wp, poisson = 0.0_wp
      !> Elements per contact radius of the coarser mesh of an extrapolation, relative to the finer
      !> one.
      real(wp) :: coarse_ratio = 2.0_wp/3.0_wp
      !> Relative error at refine = 1 of layers that grow faster than the bricks can follow. It is
      !> that of any crystal, falls with the square of the fineness, and `mesh_error` leaves it out.
      real(wp) :: layers_error = 0.0_wp
      !> For the half-space: distance of the infinite elements in contact radii, and growth of the
      !> layers before them at refine = 1.
      real(wp), private :: outer = 0.0_wp, growth = 0.0_wp
   contains
      procedure :: set_up, plan, check_sizes, materials, by_crystal
      procedure, non_overridable :: own_stiffness, mesh_error, wants_extrapolation
   end type specimen_type

contains

   !> The box under a contact, without any stages.
   pure type(mesh_plan_type) function core_of_contact(refine, contact_radius, zone) result(plan)
      !> Fineness relative to the default; contact radius, um; size of the refined zone relative to
      !> the default.
      real(wp), intent(in) :: refine, contact_radius, zone
      !> Depth of the box in contact radii.
      real(wp), parameter :: depth = 1.1_wp
      real(wp) :: across

      across = fineness*refine
      ! The box has room for an elliptical contact and for the ring of free nodes around it.
      plan%half_cells = max(4, nint(1.25_wp*across*zone) + 2)
      plan%widening = plan%half_cells/real(max(4, nint(1.25_wp*across) + 2), wp)
      plan%depth_cells = max(2, 2*nint(0.5_wp*depth*across))
      plan%half_width = contact_radius*plan%half_cells/across
      plan%depth = contact_radius*plan%depth_cells/across
   end function core_of_contact

   !> Layers that make the surface `ratio` times as large. At refine = 1 each is about `growth`
   !> times as thick as the one before.
   pure type(mesh_stage_type) function layers_of_ratio(ratio, growth, refine) result(stage)
      real(wp), intent(in) :: ratio, growth, refine
      !> Tolerance of rounding in a number of layers that ends in a half.
      real(wp), parameter :: rounding = 1.0e-9_wp

      stage%ratio = ratio
      stage%layers = max(1, nint(log(ratio)/log(growth)*refine + rounding))
      stage%growth = ratio**(1.0_wp/stage%layers)
   end function layers_of_ratio

   !> Layers from one half-width to another (um); layers farther from the contact grow faster.
   pure function graded_layers(from, to, contact_radius, refine, material) result(stages)
      !> Half-widths at both ends and contact radius, um; `refine`: number of layers relative to the
      !> default.
      real(wp), intent(in) :: from, to, contact_radius, refine
      !> Its number.
      integer, intent(in) :: material
      type(mesh_stage_type), allocatable :: stages(:)
      !> Growth at refine = 1, and the distance up to which it holds (contact radii).
      real(wp), parameter :: growth(3) = [1.2_wp, 1.3_wp, 1.5_wp], &
         & limit(3) = [5.0_wp, 12.0_wp, huge(1.0_wp)]
      type(mesh_stage_type) :: stage
      real(wp) :: width, goal
      integer :: i

      allocate (stages(0))
      width = from
      do i = 1, size(growth)
         goal = min(to, limit(i)*contact_radius)
         ! Avoid a layer that is much thinner than the others.
         if (to < 1.1_wp*goal) goal = to
         if (goal < 1.05_wp*width) cycle
         stage = layers_of_ratio(goal/width, growth(i), refine)
         stage%material = material
         stages = [stages, stage]
         width = goal
      end do
   end function graded_layers

   !> Read the specimen's own variables.
   subroutine set_up(self, settings, error)
      !> Its contact radius and element size are set, and its element is that of the settings, or
      !> empty.
      class(specimen_type), intent(inout) :: self
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error
      !> Growth of layers whose shape functions decay as displacements do, and of ordinary layers
      !> (docs/simulation.md).
      real(wp), parameter :: decaying = 1.35_wp, ordinary = 1.13_wp

      self%variables = 'outer, growth'
      self%parts = 'the specimen'
      self%has_length = .false.
      self%outer = settings%simulation%outer
      self%growth = merge(ordinary, decaying, self%element == 'c3d8')
      if (allocated(settings%simulation%growth)) self%growth = settings%simulation%growth
   end subroutine set_up

   !> The plan of a mesh with `refine` times the default number of elements per contact radius.
   pure type(mesh_plan_type) function plan(self, refine)
      class(specimen_type), intent(in) :: self
      real(wp), intent(in) :: refine

      plan = core_of_contact(refine, self%contact_radius, self%zone)
      plan%stages = [layers_of_ratio(self%outer*self%contact_radius*plan%widening/plan%half_width, &
         & self%growth, refine)]
      plan%stages(1)%coarsen = .true.
   end function plan

   !> Count the bricks of the mesh of a plan; refuse a mesh that cannot be made or is too large.
   subroutine check_plan(plan, bricks, error)
      type(mesh_plan_type), intent(in) :: plan
      integer, intent(out) :: bricks
      type(error_type), allocatable, intent(out) :: error
      integer :: i, nx, nz

      nx = 2*plan%half_cells
      nz = plan%depth_cells
      bricks = nx**2*nz
      do i = 1, size(plan%stages)
         associate (stage => plan%stages(i))
            if (.not. (stage%growth > 1.0_wp .and. stage%growth < 10.0_wp)) then
               call refuse(error, to_text(stage%layers)//' layers growing by ' &
                  & //to_text(stage%growth)//' cannot be made; allowed: at least none, and 1 to 10')
               return
            end if
            if (stage%coarsen) then
               nx = nx/2
               nz = nz/2
            end if
            bricks = bricks + stage%layers*surface_facets(nx, nz)
         end associate
      end do
      if (bricks > most_bricks) then
         call refuse(error, 'a mesh of '//to_text(bricks) &
            & //' elements is too large; allowed: up to '//to_text(most_bricks))
      end if
   end subroutine check_plan

   !> The number of facets of the sides and the bottom of a lattice.
   pure integer function surface_facets(nx, nz)
      !> Cells along x and y, and along z.
      integer, intent(in) :: nx, nz

      surface_facets = nx**2 + 4*nx*nz
   end function surface_facets

   !> Refuse sizes that cannot be meshed; the message begins with the variable. The half-space has
   !> none.
   subroutine check_sizes(self, error)
      class(specimen_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
   end subroutine check_sizes

   !> Stiffness of each material of the mesh in the sample frame, GPa (6, 6, materials). The
   !> half-space consists of the crystal alone.
   pure function materials(self, crystal) result(c)
      class(specimen_type), intent(in) :: self
      !> Sample frame, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      real(wp), allocatable :: c(:, :, :)

      c = spread(crystal, 3, 1)
   end function materials

   !> Derivative of a modulus by the stiffness of the crystal.
   pure function by_crystal(self, by_material, crystal) result(by)
      class(specimen_type), intent(in) :: self
      !> Its derivatives by that of each material (6, 6, materials); sample frame, GPa.
      real(wp), intent(in) :: by_material(:, :, :), crystal(6, 6)
      real(wp) :: by(6, 6)

      by = by_material(:, :, 1)
   end function by_crystal

   !> Approximate largest relative error of the modulus of a crystal over all orientations; for most
   !> orientations the error is smaller.
   !>
   !> Near elastic instability bricks resolve neither the soft modes nor the far field. The
   !> constants are measured on the half-space against the exact theory
   !> (docs/verification/simulation.md, `bench simulate soft`): beyond a log-anisotropy of 1.5 the
   !> largest error grows with its power 3.5, and falls with the square of the fineness.
   pure real(wp) function mesh_error(self, refine, stiffness, two_meshes)
      class(specimen_type), intent(in) :: self
      !> Elements per contact radius relative to the default; GPa.
      real(wp), intent(in) :: refine, stiffness(6, 6)
      !> Whether the modulus is extrapolated from two meshes.
      logical, intent(in) :: two_meshes
      real(wp) :: fineness, instability

      instability = merge(worst_incompatible, worst_plain, self%element == 'c3d8i')
      instability = instability*log_anisotropy(stiffness)**power_of_anisotropy
      if (two_meshes) instability = extrapolated*instability
      fineness = refine*self%contact_radius/self%element_size
      mesh_error = instability*(studied_fineness/fineness)**order
   end function mesh_error

   !> Whether the error of one mesh may be too large for a crystal; contact stiffnesses always need
   !> two meshes. C3D8, Abaqus' element, is not extrapolated unless the settings ask for it.
   pure logical function wants_extrapolation(self, refine, stiffness)
      class(specimen_type), intent(in) :: self
      !> As in `mesh_error`.
      real(wp), intent(in) :: refine, stiffness(6, 6)

      wants_extrapolation = self%element == 'c3d8i' .and. (self%estimator /= 'curve' .or. &
         & self%mesh_error(refine, stiffness, .false.) > limit_of_one_mesh)
   end function wants_extrapolation

   !> Stiffness of the other material, GPa. It is zero if none is stated; then scaling the crystal's
   !> stiffness scales the moduli by the same factor.
   pure function own_stiffness(self) result(c)
      class(specimen_type), intent(in) :: self
      real(wp) :: c(6, 6)

      c = 0.0_wp
      if (self%young > 0.0_wp) c = isotropic_stiffness(self%young, self%poisson)
   end function own_stiffness

   !> Copy the value of a variable that a geometry needs; refuse its absence.
   subroutine require(geometry, name, stated, value, error)
      !> Names of the specimen and of the variable.
      character(len=*), intent(in) :: geometry, name
      !> The value in the settings.
      real(wp), intent(in), optional :: stated
      !> The component of the specimen.
      real(wp), intent(inout) :: value
      type(error_type), allocatable, intent(inout) :: error

      if (allocated(error)) return
      if (present(stated)) value = stated
      if (.not. present(stated)) then
         call refuse(error, "the variable is missing; geometry = '"//geometry//"' needs it", &
            & variable=name)
      end if
   end subroutine require

end module basic_specimen
