!> The groups of a namelist as types: one component a variable, named as the variable. Units, defaults, ranges and meanings are
!> in `settings_schema`, which alone gives them their values. An allocatable component that is not allocated is unset.
module settings_groups
   use kinds, only: wp
   implicit none
   private
   public :: problem_settings_type, crystals_settings_type, simulation_settings_type, domain_settings_type, &
      & surrogate_settings_type, design_settings_type, measurements_settings_type, prior_settings_type, &
      & knowledge_settings_type, sampler_settings_type, next_settings_type, execution_settings_type, settings_type, &
      & longest_quantity

   !> Bytes of the name of a quantity.
   integer, parameter :: longest_quantity = 64

   type :: problem_settings_type
      character(len=:), allocatable :: symmetry, title
      logical :: synthetic
      integer :: seed
   end type problem_settings_type

   type :: crystals_settings_type
      character(len=:), allocatable :: points
   end type crystals_settings_type

   type :: simulation_settings_type
      character(len=:), allocatable :: simulator, mesh, element, integration
      real(wp) :: refine, radius_um, outer, growth
      integer :: depths
      logical :: extrapolate, both_meshes, vtu, inp
   end type simulation_settings_type

   type :: domain_settings_type
      !> One for each constant of the crystal class, GPa.
      real(wp), allocatable :: c_min(:), c_max(:)
      real(wp), allocatable :: anisotropy_cap
   end type domain_settings_type

   type :: surrogate_settings_type
      character(len=:), allocatable :: file, coordinates, truncation, prior, scan
      integer :: degree, bandlimit
   end type surrogate_settings_type

   type :: design_settings_type
      character(len=:), allocatable :: candidates, initial_set, orientations, variance_of, reuse
      integer :: n_candidates, initial, n_directions, budget, batch, refit, patience, validation
      real(wp) :: target_gpa
   end type design_settings_type

   type :: measurements_settings_type
      character(len=:), allocatable :: file, modulus_kind, scale, likelihood
      real(wp) :: indenter_modulus_gpa, indenter_nu, sample_nu, calibration_sd, student_dof
   end type measurements_settings_type

   type :: prior_settings_type
      !> One for each constant of the crystal class, GPa.
      real(wp), allocatable :: c_min(:), c_max(:)
      real(wp), allocatable :: anisotropy_cap
   end type prior_settings_type

   type :: knowledge_settings_type
      !> Of equal length: what is known, its mean and its sd.
      character(len=longest_quantity), allocatable :: quantity(:)
      real(wp), allocatable :: mean(:), sd(:)
   end type knowledge_settings_type

   type :: sampler_settings_type
      character(len=:), allocatable :: method, surrogate_variance
      integer :: samples, burn_in, chains
   end type sampler_settings_type

   type :: next_settings_type
      character(len=:), allocatable :: target
      real(wp) :: sd_gpa
      integer :: count
   end type next_settings_type

   type :: execution_settings_type
      character(len=:), allocatable :: engine
      integer :: workers
   end type execution_settings_type

   type :: settings_type
      type(problem_settings_type) :: problem
      type(crystals_settings_type) :: crystals
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
