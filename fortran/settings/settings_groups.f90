!> The groups of a namelist as types: one component a variable, named as the variable. Units, defaults, ranges and meanings are
!> in `settings_schema`, which alone gives them their values; numbers are zero until then. An allocatable component that is not
!> allocated is unset.
module settings_groups
   use kinds, only: wp
   implicit none
   private
   public :: problem_settings_type, crystals_settings_type, specimen_settings_type, indenter_settings_type, &
      & simulation_settings_type, domain_settings_type, surrogate_settings_type, design_settings_type, &
      & measurements_settings_type, prior_settings_type, knowledge_settings_type, sampler_settings_type, next_settings_type, &
      & execution_settings_type, settings_type, longest_item

   !> Bytes of a text in a list: the name of a quantity, or of a column with its header.
   integer, parameter :: longest_item = 128

   type :: group_settings_type
      !> The file has the group.
      logical :: given = .false.
   end type group_settings_type

   type, extends(group_settings_type) :: problem_settings_type
      character(len=:), allocatable :: symmetry, title
      !> Lengths in any unit, angles in degrees.
      real(wp), allocatable :: lattice(:)
      logical :: synthetic = .false.
      integer :: seed = 0
   end type problem_settings_type

   type, extends(group_settings_type) :: crystals_settings_type
      character(len=:), allocatable :: points
   end type crystals_settings_type

   type, extends(group_settings_type) :: specimen_settings_type
      character(len=:), allocatable :: geometry, substrate, matrix
      real(wp) :: width_um = 0.0_wp, height_um = 0.0_wp, substrate_nu = 0.0_wp, matrix_nu = 0.0_wp
      real(wp), allocatable :: thickness_um, substrate_young_gpa, grain_radius_um, grain_depth_um, matrix_young_gpa
   end type specimen_settings_type

   type, extends(group_settings_type) :: indenter_settings_type
      character(len=:), allocatable :: shape
      real(wp) :: radius_um = 0.0_wp, half_angle_deg = 0.0_wp
      !> The last point of the curve: one of the two is allocated in a resolved problem.
      real(wp), allocatable :: depth_um, contact_radius_um
   end type indenter_settings_type

   type, extends(group_settings_type) :: simulation_settings_type
      character(len=:), allocatable :: simulator, element, integration
      real(wp) :: refine = 0.0_wp, outer = 0.0_wp
      real(wp), allocatable :: growth
      integer :: depths = 0
      logical :: extrapolate = .false., vtu = .false., inp = .false.
   end type simulation_settings_type

   type, extends(group_settings_type) :: domain_settings_type
      character(len=longest_item), allocatable :: classes(:)
      !> One for each constant of the crystal class, GPa.
      real(wp), allocatable :: c_min(:), c_max(:)
      real(wp), allocatable :: anisotropy_cap
      real(wp) :: log_anisotropy_max = 0.0_wp, poisson_min = 0.0_wp, poisson_max = 0.0_wp
      !> GPa.
      real(wp), allocatable :: stiffness_min_gpa, stiffness_max_gpa
   end type domain_settings_type

   type, extends(group_settings_type) :: surrogate_settings_type
      character(len=:), allocatable :: file, model, truncation, scan
      integer :: degree = 0, bandlimit = 0
   end type surrogate_settings_type

   type, extends(group_settings_type) :: design_settings_type
      character(len=:), allocatable :: candidates, initial_set, orientations, variance_of, reuse
      integer :: n_candidates = 0, initial = 0, n_directions = 0, budget = 0, batch = 0, refit = 0, patience = 0, validation = 0
      real(wp) :: target_gpa = 0.0_wp
   end type design_settings_type

   type, extends(group_settings_type) :: measurements_settings_type
      character(len=:), allocatable :: file, sheet, ebsd, modulus_kind, angles, scale, likelihood
      character(len=longest_item), allocatable :: columns(:)
      real(wp) :: indenter_modulus_gpa = 0.0_wp, indenter_nu = 0.0_wp, sample_nu = 0.0_wp, calibration_sd = 0.0_wp, &
         & orientation_sd_deg = 0.0_wp, scatter_sd = 0.0_wp, student_dof = 0.0_wp
   end type measurements_settings_type

   type, extends(group_settings_type) :: prior_settings_type
      !> One for each constant of the crystal class, GPa.
      real(wp), allocatable :: c_min(:), c_max(:)
      real(wp), allocatable :: anisotropy_cap
      character(len=:), allocatable :: measure
   end type prior_settings_type

   type, extends(group_settings_type) :: knowledge_settings_type
      !> Of equal length: what is known, its mean and its sd.
      character(len=longest_item), allocatable :: quantity(:)
      real(wp), allocatable :: mean(:), sd(:)
      character(len=:), allocatable :: stiffness_file
   end type knowledge_settings_type

   type, extends(group_settings_type) :: sampler_settings_type
      character(len=:), allocatable :: method, surrogate_variance
      integer :: samples = 0, burn_in = 0, chains = 0
      logical :: evidence = .false.
   end type sampler_settings_type

   type, extends(group_settings_type) :: next_settings_type
      character(len=:), allocatable :: target, candidates
      real(wp) :: sd_gpa = 0.0_wp
      integer :: count = 0
   end type next_settings_type

   type, extends(group_settings_type) :: execution_settings_type
      character(len=:), allocatable :: engine, scheduler
      integer :: workers = 0
   end type execution_settings_type

   type :: settings_type
      type(problem_settings_type) :: problem
      type(crystals_settings_type) :: crystals
      type(specimen_settings_type) :: specimen
      type(indenter_settings_type) :: indenter
      type(simulation_settings_type) :: simulation
      type(domain_settings_type) :: domain
      type(surrogate_settings_type) :: surrogate
      type(design_settings_type) :: design
      type(measurements_settings_type) :: measurements
      type(prior_settings_type) :: prior
      type(knowledge_settings_type) :: knowledge
      type(sampler_settings_type) :: sampler
      type(next_settings_type) :: next
      type(execution_settings_type) :: execution
   end type settings_type
end module settings_groups
