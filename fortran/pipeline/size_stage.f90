!> `size`: how thick a film, or how large a grain, must be for its modulus to be that of a half-space.
!>
!> The crystals of &crystals are simulated in specimens of growing size, in the surroundings of &specimen and in softer and stiffer ones.
module size_stage
   use abstract_stage, only: job_type, stage_type
   use crystal_elasticity, only: hill_young_poisson, polycrystal_averages
   use stage_documents, only: begin_crystal
   use errors, only: error_type, refuse, warn
   use indenters, only: indenter_type, new_indenter
   use json, only: json_type
   use kinds, only: nan, wp
   use namelist_file, only: place
   use settings_schema, only: specimen_settings_type
   use simulate, only: outcome_done
   use text, only: to_text
   implicit none
   private
   public :: size_stage_type

   !> The bias of the modulus that is small enough.
   real(wp), parameter :: limit = 0.01_wp
   !> The sizes, in contact radii: thickness of a film, radius of a grain.
   integer, parameter :: n_sizes = 7
   real(wp), parameter :: film_sizes(n_sizes) = [1.0_wp, 2.0_wp, 4.0_wp, 8.0_wp, 16.0_wp, 32.0_wp, 64.0_wp]
   real(wp), parameter :: grain_sizes(n_sizes) = [3.0_wp, 5.0_wp, 8.0_wp, 13.0_wp, 20.0_wp, 40.0_wp, 80.0_wp]
   !> The surroundings that are compared, Young's modulus over what is stated.
   character(len=9), parameter :: names(3) = [character(len=9) :: 'softer', 'as stated', 'stiffer']
   real(wp), parameter :: factors(3) = [0.5_wp, 1.0_wp, 2.0_wp]

   !> A crystal in some surroundings.
   type :: case_type
      integer :: crystal = 0
      character(len=9) :: name = 'rigid'
      !> Of what is around, GPa; 0 where it is not stated.
      real(wp) :: young = 0.0_wp
   end type case_type

   type, extends(stage_type) :: size_stage_type
      private
      real(wp) :: contact_radius = 0.0_wp, sizes(n_sizes) = 0.0_wp
      type(case_type), allocatable :: cases(:)
   contains
      procedure :: begin, finish
   end type size_stage_type

contains

   !> All is to be simulated at once: the half-space of each crystal, then each size of each case.
   subroutine begin(self, error)
      class(size_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      class(indenter_type), allocatable :: indenter
      integer :: i, k, ways, number
      logical :: rigid

      associate (stated => self%problem%settings%specimen, points => self%problem%crystals)
         if (stated%geometry /= 'film' .and. stated%geometry /= 'grain') call refuse(error, place(self%problem%path, 'specimen', &
            & 'geometry')//'a '''//stated%geometry//''' has no neighbours; allowed: film, grain')
         if (.not. allocated(error)) call new_indenter(self%problem%settings%indenter, indenter, error)
         if (allocated(error)) return
         self%contact_radius = indenter%contact_radius
         self%sizes = self%contact_radius*merge(film_sizes, grain_sizes, stated%geometry == 'film')
         rigid = stated%geometry == 'film' .and. stated%substrate == 'rigid'
         ways = merge(1, size(factors), rigid)
         deallocate (self%physics)
         allocate (self%cases(points%n*ways), self%physics(1 + points%n*ways*n_sizes))
         self%physics = self%problem%settings
         self%physics(1)%specimen%geometry = 'halfspace'
         self%n_expected = points%n + size(self%cases)*n_sizes
         allocate (self%batch(self%n_expected))
         self%batch(:points%n) = [(job_type(points%stiffness(:, :, i), points%euler_deg(:, i), 1), i=1, points%n)]
         do i = 1, size(self%cases)
            associate (one => self%cases(i), specimens => self%physics(2 + (i - 1)*n_sizes:1 + i*n_sizes)%specimen)
               one%crystal = 1 + (i - 1)/ways
               if (.not. rigid) one%name = names(1 + mod(i - 1, ways))
               do k = 1, n_sizes
                  call surround(specimens(k), points%stiffness(:, :, one%crystal), factors(1 + mod(i - 1, ways)), self%sizes(k), &
                     & one%young)
                  number = (i - 1)*n_sizes + k
                  self%batch(points%n + number) = job_type(points%stiffness(:, :, one%crystal), &
                     & points%euler_deg(:, one%crystal), 1 + number)
               end do
            end associate
         end do
      end associate
   end subroutine begin

   !> Let a crystal be of a `size`, um, and let what is around it have `factor` times the Young's modulus that is stated: then it is
   !> `young`, GPa; 0 where none is stated.
   subroutine surround(specimen, stiffness, factor, size, young)
      type(specimen_settings_type), intent(inout) :: specimen
      !> Of the crystal, GPa.
      real(wp), intent(in) :: stiffness(6, 6), factor, size
      real(wp), intent(out) :: young

      young = 0.0_wp
      if (specimen%geometry == 'film') then
         specimen%thickness_um = size
         if (specimen%substrate == 'rigid') return
         specimen%substrate_young_gpa = factor*specimen%substrate_young_gpa
         young = specimen%substrate_young_gpa
         return
      end if
      ! A cylinder keeps its proportions.
      if (allocated(specimen%grain_depth_um)) specimen%grain_depth_um = size*specimen%grain_depth_um/specimen%grain_radius_um
      specimen%grain_radius_um = size
      if (specimen%matrix == 'self') then
         ! As it is stated it stays the average.
         if (.not. abs(factor - 1.0_wp) > 0.0_wp) return
         specimen%matrix = 'isotropic'
         call hill_young_poisson(polycrystal_averages(stiffness), young, specimen%matrix_nu)
         specimen%matrix_young_gpa = young
      end if
      specimen%matrix_young_gpa = factor*specimen%matrix_young_gpa
      young = specimen%matrix_young_gpa
   end subroutine surround

   !> The document: of each case the bias against the half-space by the size, and from what size on it is within the limit.
   subroutine finish(self, page, error)
      class(size_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      !> GPa, 0 where there is none.
      real(wp) :: all_moduli(size(self%rows)), bias(n_sizes)
      logical :: known(n_sizes)
      integer :: i, lacking

      all_moduli = merge(self%rows%outcome%modulus, 0.0_wp, self%rows%outcome%status == outcome_done)
      lacking = 0
      call page%put('variable', trim(merge('thickness_um   ', 'grain_radius_um', &
         & self%problem%settings%specimen%geometry == 'film')))
      call page%put_numbers('contact_radius_um, limit', [self%contact_radius, limit])
      call page%begin_array('results')
      do i = 1, size(self%cases)
         associate (one => self%cases(i), moduli => all_moduli(self%problem%crystals%n + (i - 1)*n_sizes + 1: &
            & self%problem%crystals%n + i*n_sizes), ideal => all_moduli(self%cases(i)%crystal))
            known = moduli > 0.0_wp .and. ideal > 0.0_wp
            bias = 0.0_wp
            where (known) bias = moduli/ideal - 1.0_wp
            if (.not. all(known)) lacking = lacking + 1
            call begin_crystal(page, self%problem%crystals, one%crystal)
            call page%put('surroundings', trim(one%name))
            call page%put('young_gpa', merge(one%young, nan, one%young > 0.0_wp))
            call page%put('halfspace_gpa', merge(ideal, nan, ideal > 0.0_wp))
            call page%put('size_um', pack(self%sizes, known))
            call page%put('bias', pack(bias, known))
            call page%put('smallest_um', merge(smallest_size(pack(self%sizes, known), pack(bias, known)), nan, any(known)))
            call page%end_object()
         end associate
      end do
      call page%end_array()
      if (lacking > 0) call warn(self%warnings, to_text(lacking)//' curves lack sizes at which the contact left the refined zone ' &
         & //'of the mesh')
      self%done = to_text(size(self%cases))//' cases: '//self%output//'/size.json'
   end subroutine finish

   !> From where on the bias stays within the limit, um: on a power law between the last size that is beyond and the next, else the least
   !> size; beyond the largest the bias falls with the size.
   pure real(wp) function smallest_size(sizes, bias) result(smallest)
      !> um, growing.
      real(wp), intent(in) :: sizes(:), bias(:)
      integer :: i, n

      n = size(sizes)
      smallest = 0.0_wp
      if (n == 0) return
      i = findloc(abs(bias) > limit, .true., 1, back=.true.)
      if (i == 0) then
         smallest = sizes(1)
      else if (i == n) then
         smallest = sizes(n)*abs(bias(n))/limit
      else
         smallest = sizes(i)*(sizes(i + 1)/sizes(i))**(log(abs(bias(i))/limit)/log(abs(bias(i))/max(abs(bias(i + 1)), 1.0e-9_wp)))
      end if
   end function smallest_size
end module size_stage
