!> What may stand in a namelist. A type for each group has a component for each variable, named as the variable; numbers are zero until
!> they are read, and an allocatable component that is not allocated is unset. One call a variable names it, binds its component, and says
!> default, range or words, unit and meaning: reading and its checks, `resolved.nml`, help, docs/namelists.md and Python's settings come
!> from this table and from nothing else.
module settings_schema
   use kinds, only: wp
   use settings_list, only: choice_list_type, kind_choice, kind_file, kind_source, kind_text, longest_item, &
      & settings_list_type, shape_constants, shape_list
   implicit none
   private
   public :: list_settings, set_settings, candidate_sources
   public :: problem_settings_type, crystals_settings_type, curves_settings_type, references_settings_type, &
      & specimen_settings_type, indenter_settings_type, &
      & simulation_settings_type, domain_settings_type, surrogate_settings_type, design_settings_type, &
      & measurements_settings_type, prior_settings_type, knowledge_settings_type, sampler_settings_type, next_settings_type, &
      & execution_settings_type, settings_type

   !> What `&design candidates` knows beside the name of a CSV file.
   character(len=*), parameter :: candidate_sources = 'latin, factorial'

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
      real(wp), allocatable :: density_kg_m3
      real(wp) :: density_sd_kg_m3 = 0.0_wp
   end type problem_settings_type

   type, extends(group_settings_type) :: crystals_settings_type
      character(len=:), allocatable :: points
   end type crystals_settings_type

   type, extends(group_settings_type) :: specimen_settings_type
      character(len=:), allocatable :: geometry, estimator, substrate, matrix
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
      logical, allocatable :: extrapolate
      logical :: vtu = .false., inp = .false.
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
      character(len=:), allocatable :: candidates, initial_set, orientations, variance_of, focus, reuse
      integer :: n_candidates = 0, initial = 0, n_directions = 0, budget = 0, batch = 0, refit = 0, patience = 0, validation = 0
      real(wp) :: target_gpa = 0.0_wp
   end type design_settings_type

   type, extends(group_settings_type) :: measurements_settings_type
      character(len=:), allocatable :: file, sheet, ebsd, modulus_kind, angles, scale, likelihood, shared_errors, velocities
      character(len=longest_item), allocatable :: columns(:)
      real(wp) :: indenter_modulus_gpa = 0.0_wp, indenter_nu = 0.0_wp, sample_nu = 0.0_wp, calibration_sd = 0.0_wp, &
         & orientation_sd_deg = 0.0_wp, misalignment_sd_deg = 0.0_wp, scatter_sd = 0.0_wp, student_dof = 0.0_wp, &
         & zero_sd_nm = 0.0_wp, yield_gpa = 0.0_wp, velocity_calibration_sd = 0.0_wp
   end type measurements_settings_type

   type, extends(group_settings_type) :: curves_settings_type
      character(len=:), allocatable :: file, tests
      real(wp) :: indenter_modulus_gpa = 0.0_wp, indenter_nu = 0.0_wp, radius_um = 0.0_wp, tip_beta = 0.0_wp, &
         & tip_beta_sd = 0.0_wp, compliance_sd_nm_mn = 0.0_wp, drift_sd_nm_s = 0.0_wp, load_sd_mn = 0.0_wp, session_sd = 0.0_wp
      real(wp), allocatable :: radius_sd_um
      logical :: drift_removed = .true.
   end type curves_settings_type

   type, extends(group_settings_type) :: references_settings_type
      !> Of equal length: the names of isotropic references, Young's moduli with their sds, Poisson's ratios.
      character(len=longest_item), allocatable :: name(:)
      real(wp), allocatable :: young_gpa(:), young_sd_gpa(:), nu(:)
      character(len=:), allocatable :: crystals
      real(wp) :: crystal_sd = 0.0_wp
   end type references_settings_type

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
      type(curves_settings_type) :: curves
      type(references_settings_type) :: references
      type(measurements_settings_type) :: measurements
      type(prior_settings_type) :: prior
      type(knowledge_settings_type) :: knowledge
      type(sampler_settings_type) :: sampler
      type(next_settings_type) :: next
      type(execution_settings_type) :: execution
   end type settings_type

contains

   !> All groups and variables, in order, with the values of `settings`; `choices`: the words that modules above the settings own.
   type(settings_list_type) function list_settings(settings, choices) result(list)
      type(settings_type), intent(in) :: settings
      type(choice_list_type), intent(in), optional :: choices(:)
      type(settings_type) :: copy

      copy = settings
      allocate (list%choices(0))
      if (present(choices)) list%choices = choices
      call visit_settings(list, copy)
      allocate (list%groups(list%n_groups), list%variables(list%n_variables))
      call visit_settings(list, copy)
   end function list_settings

   !> Let settings have the values of a list.
   subroutine set_settings(list, settings)
      type(settings_list_type), intent(inout) :: list
      type(settings_type), intent(inout) :: settings

      list%giving = .true.
      call visit_settings(list, settings)
   end subroutine set_settings

   !> Default: namelist text; '*' is required, 'unset' has no value. `words`: of a choice that a module above the settings owns.
   subroutine visit_settings(v, s)
      type(settings_list_type), intent(inout) :: v
      type(settings_type), intent(inout) :: s

      v%n_groups = 0
      v%n_variables = 0
      call v%group('problem', s%problem%given, 'What the file is about.')
      call v%text('symmetry', s%problem%symmetry, kind_choice, 'unset', v%words('symmetry'), &
         & 'crystal class of the material; may be absent where only a correction for all classes is built')
      call v%reals('lattice', s%problem%lattice, shape_list, 'unset', '(0, 1e4]', '', &
         & 'unit cell, for orientations that are indices of directions or planes: those of the lengths a, b, c (any unit) and ' &
         & //'angles alpha, beta, gamma (degrees) that the symmetry leaves free, such as a, c; of a cubic crystal none')
      call v%text('title', s%problem%title, kind_text, '', '', 'a title for the report')
      call v%logical('synthetic', s%problem%synthetic, '.false.', 'whether the data are made up; every figure then says so')
      call v%integer('seed', s%problem%seed, '1', '[0, 2147483647]', 'seed of all random numbers; same seed, same results')
      call v%optional_real('density_kg_m3', s%problem%density_kg_m3, '[10, 1e5]', 'kg/m3', 'density; speeds of waves need it')
      call v%real('density_sd_kg_m3', s%problem%density_sd_kg_m3, '0.0', '[0, 1e4]', 'kg/m3', 'its sd, which all speeds share')

      call v%group('crystals', s%crystals%given, 'The crystals that `simulate` and `theory` indent.')
      call v%text('points', s%crystals%points, kind_file, '*', '', &
         & 'CSV of elastic constants (GPa) and Bunge-Euler angles, one indentation a row')

      call v%group('specimen', s%specimen%given, 'What is indented.')
      call v%text('geometry', s%specimen%geometry, kind_choice, 'halfspace', v%words('geometry'), &
         & 'a half-space, that is a bulk sample; a block with clamped bottom and free sides; a film; a grain in a polycrystal')
      call v%text('estimator', s%specimen%estimator, kind_choice, '', 'curve, stiffness, stiffness_hertz', &
         & 'how M follows from a test: curve, from force against depth^1.5; stiffness, S/(2 a) of the contact stiffness S and ' &
         & //'the true contact radius a; stiffness_hertz, with a = sqrt(R h). Required for measured films and grains; else curve')
      call v%real('width_um', s%specimen%width_um, '9.6', '[0.001, 1e6]', 'um', 'block: its edges along x and y')
      call v%real('height_um', s%specimen%height_um, '4.8', '[0.001, 1e6]', 'um', 'block: its edge along z')

      call v%optional_real('thickness_um', s%specimen%thickness_um, '[1e-6, 1e6]', 'um', 'film: its thickness')
      call v%text('substrate', s%specimen%substrate, kind_choice, 'isotropic', 'isotropic, rigid', 'film: what it is bonded to')
      call v%optional_real('substrate_young_gpa', s%specimen%substrate_young_gpa, '(0, 1e5]', 'GPa', &
         & 'film: Young''s modulus of an isotropic substrate')
      call v%real('substrate_nu', s%specimen%substrate_nu, '0.3', '(-1, 0.5)', '', 'film: Poisson''s ratio of the substrate')
      call v%optional_real('grain_radius_um', s%specimen%grain_radius_um, '[1e-6, 1e6]', 'um', &
         & 'grain: radius of the hemisphere, or of a cylinder')
      call v%optional_real('grain_depth_um', s%specimen%grain_depth_um, '[1e-6, 1e6]', 'um', &
         & 'grain: depth of a cylinder; unset: a hemisphere')
      call v%text('matrix', s%specimen%matrix, kind_choice, 'self', 'self, isotropic', &
         & 'grain: what is around it: self, the Hill average of a polycrystal of its own crystal; or an isotropic matrix')
      call v%optional_real('matrix_young_gpa', s%specimen%matrix_young_gpa, '(0, 1e5]', 'GPa', &
         & 'grain: Young''s modulus of an isotropic matrix')
      call v%real('matrix_nu', s%specimen%matrix_nu, '0.3', '(-1, 0.5)', '', 'grain: Poisson''s ratio of an isotropic matrix')

      call v%group('indenter', s%indenter%given, 'The rigid, frictionless indenter, and how far it goes.')
      call v%text('shape', s%indenter%shape, kind_choice, 'paraboloid', v%words('shape'), &
         & 'a paraboloid, which is Hertz'' sphere; a true sphere; or a cone')
      call v%real('radius_um', s%indenter%radius_um, '16.0', '[0.001, 1e6]', 'um', &
         & 'sphere: its radius; paraboloid: the radius of its tip')
      call v%real('half_angle_deg', s%indenter%half_angle_deg, '70.3', '[5, 89]', 'degrees', &
         & 'cone: the angle between axis and surface; 70.3 has the area of a Berkovich tip at each depth')
      call v%optional_real('depth_um', s%indenter%depth_um, '[1e-9, 1e6]', 'um', 'depth of the last point of the load-depth curve')
      call v%optional_real('contact_radius_um', s%indenter%contact_radius_um, '[1e-6, 1e6]', 'um', &
         & 'in place of depth_um, the contact radius that an isotropic half-space has there; 0.5 where neither is stated')

      call v%group('simulation', s%simulation%given, 'The indentation simulation.')
      call v%text('simulator', s%simulation%simulator, kind_choice, 'fe', 'fe, theory, import', &
         & 'finite elements; the exact theory of the half-space; or no simulation, only moduli that `build --tell` imports')
      call v%text('element', s%simulation%element, kind_choice, '', 'c3d8, c3d8i', &
         & 'the brick element; empty: the one for which the mesh of the geometry was designed')
      call v%text('integration', s%simulation%integration, kind_choice, 'selective', 'selective, full', &
         & 'averaged volumetric strain as in Abaqus, or full integration as in CalculiX')
      call v%real('refine', s%simulation%refine, '1.0', '[0.3, 4]', '', 'elements per contact radius, in units of the default mesh')
      call v%optional_logical('extrapolate', s%simulation%extrapolate, 'whether to solve on a second, coarser mesh too and ' &
         & //'extrapolate in element size; unset: only for crystals whose error on one mesh of C3D8I may exceed 0.5 %')
      call v%real('outer', s%simulation%outer, '5.0', '[2, 100]', '', &
         & 'half-space, for studies: where the infinite elements begin, in contact radii')
      call v%optional_real('growth', s%simulation%growth, '[1.01, 2]', '', &
         & 'half-space, for studies: growth of the layers of bricks before them; unset: 1.35 with c3d8i, 1.13 with c3d8')
      call v%integer('depths', s%simulation%depths, '10', '[1, 1000]', 'points of the load-depth curve')
      call v%logical('vtu', s%simulation%vtu, '.false.', 'write displacement and stress for ParaView')
      call v%logical('inp', s%simulation%inp, '.false.', 'write the same problem as an Abaqus/CalculiX deck')

      call v%group('domain', s%domain%given, 'The crystals for which the surrogate is valid.')
      call v%names('classes', s%domain%classes, 'unset', &
         & 'correction: classes of the training crystals; unset: triclinic, which include all classes')
      call v%real('log_anisotropy_max', s%domain%log_anisotropy_max, '1.5', '(0, 5]', '', &
         & 'correction: largest log-anisotropy, the norm of the anisotropic part of log stiffness (titanium 0.42, copper 1.28)')
      call v%real('poisson_min', s%domain%poisson_min, '0.05', '(-1, 0.5)', '', &
         & 'correction: smallest Poisson''s ratio of the isotropic part')
      call v%real('poisson_max', s%domain%poisson_max, '0.45', '(-1, 0.5)', '', &
         & 'correction: largest Poisson''s ratio of the isotropic part')
      call v%optional_real('stiffness_min_gpa', s%domain%stiffness_min_gpa, '[0.1, 1e4]', 'GPa', &
         & 'correction: smallest scale, the geometric mean of the Kelvin eigenvalues (187 for a Young''s modulus 200, Poisson''s ' &
         & //'ratio 0.3). With both scales stated the correction depends on the scale, as it does for a film on a substrate')
      call v%optional_real('stiffness_max_gpa', s%domain%stiffness_max_gpa, '[0.1, 1e4]', 'GPa', 'correction: largest scale')
      call v%reals('c_min', s%domain%c_min, shape_constants, 'unset', '[-500, 5000]', 'GPa', &
         & 'lower bounds of the constants; the surrogate is then for &problem symmetry alone (model = ''paper'' needs bounds)')
      call v%reals('c_max', s%domain%c_max, shape_constants, 'unset', '[-500, 5000]', 'GPa', 'upper bounds of the constants')
      call v%optional_real('anisotropy_cap', s%domain%anisotropy_cap, '(0, 1e6]', '', &
         & 'largest universal anisotropy index (Eq. 14) within the bounds')

      call v%group('surrogate', s%surrogate%given, 'The surrogate model of the indentation modulus (Step 1).')
      call v%text('file', s%surrogate%file, kind_text, '', '', 'halfspace: the exact theory of a bulk sample; block: comes with ' &
         & //'the package; or the name of a file; empty: surrogate.txt if there is a &design or &domain, else halfspace')
      call v%text('model', s%surrogate%model, kind_choice, 'correction', v%words('basis'), &
         & 'a factor on the exact theory, for crystals of all classes; or the paper''s polynomial in the constants of one class')
      call v%integer('degree', s%surrogate%degree, '3', '[0, 12]', &
         & 'degree of the polynomials: of log stiffness (1 to 4), or of the constants (the paper''s Q)')
      call v%integer('bandlimit', s%surrogate%bandlimit, '8', '[0, 20]', &
         & 'paper: highest degree of the surface harmonics in the orientation (L)')
      call v%text('truncation', s%surrogate%truncation, kind_choice, 'tensor', v%words('truncation'), &
         & 'paper: whether `degree` limits each factor of a product, or the sum of their degrees')
      call v%text('scan', s%surrogate%scan, kind_text, '', '', &
         & 'paper: other truncations to compare on the same simulations, degrees x bandlimits, such as 1, 2, 3 x 8, 10, 12')

      call v%group('design', s%design%given, 'Which simulations are made, and how many.')
      call v%text('candidates', s%design%candidates, kind_source, 'latin', candidate_sources, &
         & 'crystals and orientations to choose from: a Latin hypercube; all pairs of constants and directions; or a CSV')
      call v%integer('n_candidates', s%design%n_candidates, '2000', '[1, 1000000]', 'how many candidates are made')
      call v%integer('initial', s%design%initial, '0', '[0, 100000]', &
         & 'simulations before variance_of chooses the next ones; 0: as many as the basis needs')
      call v%text('initial_set', s%design%initial_set, kind_choice, 'variance', 'variance, latin, boundary', &
         & 'how the first ones are chosen: by largest variance too, as a Latin hypercube, or by largest coordinate')
      call v%text('orientations', s%design%orientations, kind_choice, 'sphere', 'sphere, declination', &
         & 'directions of latin candidates: uniform on the sphere, or Phi uniform in 0 .. 90 degrees')
      call v%integer('n_directions', s%design%n_directions, '9', '[1, 10000]', 'directions of each crystal of factorial candidates')
      call v%text('variance_of', s%design%variance_of, kind_choice, 'imse', v%words('acquisition'), &
         & 'which candidate is simulated next: the one that leaves the least mean variance (imse; older name: all_moduli), or ' &
         & //'that of largest variance of M (variance, the paper; older: modulus) or log M (relative_variance; older: log_modulus)')
      call v%text('focus', s%design%focus, kind_choice, 'posterior', 'posterior, domain', &
         & 'where simulations are chosen: posterior, after the first 15 where the &measurements leave the crystal, until the ' &
         & //'surrogate is accurate there (only model = ''correction'' with measurements); domain, over the whole domain')
      call v%integer('budget', s%design%budget, '40', '[1, 1000000]', 'simulations in all, those already done included')
      call v%integer('batch', s%design%batch, '1', '[1, 10000]', 'simulations chosen at a time')
      call v%integer('refit', s%design%refit, '1', '[1, 100000]', 'simulations between two maximisations of the evidence')
      call v%real('target_gpa', s%design%target_gpa, '0.0', '[0, 1000]', 'GPa', &
         & 'stop when the error on unseen crystals is below this; 0: only at the budget')
      call v%integer('patience', s%design%patience, '0', '[0, 1000000]', &
         & 'stop when the error falls by less than 2 % over so many simulations; 0: only at the budget')
      call v%integer('validation', s%design%validation, '0', '[0, 1000000]', &
         & 'further simulations to test the surrogate, which is not trained on them')
      call v%text('reuse', s%design%reuse, kind_choice, 'all', 'all, chosen', &
         & 'which stored simulations train the surrogate: all, or only those that this file chooses, and imported ones')

      call visit_curves(v, s%curves, s%references)
      call v%group('measurements', s%measurements%given, 'The measured moduli (Step 2).')
      call v%text('velocities', s%measurements%velocities, kind_file, 'unset', '', 'CSV of angles, propagation_deg (in the ' &
         & //'surface, from x), rayleigh_velocity_m_s and sd_m_s; with it file may be absent')
      call v%real('velocity_calibration_sd', s%measurements%velocity_calibration_sd, '0.0', '[0, 0.5]', '', &
         & 'relative sd of a calibration factor that all speeds of a group share (column group; without it, all)')
      call v%text('file', s%measurements%file, kind_file, '*', '', &
         & 'table of the grains, CSV or .xlsx: Bunge-Euler angles, a modulus and its standard deviation; &curves need none')
      call v%text('shared_errors', s%measurements%shared_errors, kind_file, 'unset', '', &
         & 'CSV with a row for each of the file: every column is an independent relative error of sd 1 times its numbers')
      call v%names('columns', s%measurements%columns, 'unset', 'names of columns whose headers the program does not read: ' &
         & //'''name = header'', such as ''modulus_gpa = E (raw)''; unset: all columns go by their headers')
      call v%text('sheet', s%measurements%sheet, kind_text, '', '', 'name of the sheet of an .xlsx file; empty: the first one')
      call v%text('ebsd', s%measurements%ebsd, kind_file, 'unset', '', &
         & 'orientation map (.ang, .ctf, .h5): it gives the orientations at the positions in the columns x_um, y_um')
      call v%text('modulus_kind', s%measurements%modulus_kind, kind_choice, 'unset', v%words('modulus_kind'), &
         & 'which modulus was measured; unset: by the name of its column (effective_modulus_gpa, Er, ..)')
      call v%text('angles', s%measurements%angles, kind_choice, 'degrees', 'degrees, radians', &
         & 'unit of the angles in the file, which overrides the names of its columns')
      call v%real('indenter_modulus_gpa', s%measurements%indenter_modulus_gpa, '1140.0', '(0, 1e5]', 'GPa', &
         & 'Young''s modulus of the indenter, for effective_modulus')
      call v%real('indenter_nu', s%measurements%indenter_nu, '0.07', '(-1, 0.5]', '', &
         & 'Poisson''s ratio of the indenter, for effective_modulus')
      call v%real('sample_nu', s%measurements%sample_nu, '0.3', '(-1, 0.5]', '', &
         & 'Poisson''s ratio that the instrument assumed for the sample, for sample_modulus')
      call v%real('calibration_sd', s%measurements%calibration_sd, '0.0', '[0, 0.5]', '', &
         & 'relative sd of a calibration factor that all measurements of a group share (column group; without it, all)')
      call v%real('orientation_sd_deg', s%measurements%orientation_sd_deg, '0.0', '[0, 20]', 'degrees', &
         & 'sd of the indented direction about each of two axes in the surface; a column of this name takes precedence')
      call v%real('misalignment_sd_deg', s%measurements%misalignment_sd_deg, '0.0', '[0, 20]', 'degrees', &
         & 'sd, about each axis, of a rotation that all orientations share, as of a sample that was remounted after the map')
      call v%real('zero_sd_nm', s%measurements%zero_sd_nm, '0.0', '[0, 1000]', 'nm', &
         & 'sd of the depth of first contact, which adds 1.5 zero_sd_nm/depth_nm of the modulus; a column takes precedence')
      call v%real('yield_gpa', s%measurements%yield_gpa, '0.0', '[0, 1000]', 'GPa', &
         & 'yield stress of the grains, to warn of contacts that yield; 0: warn where the pressure is above 3 % of the modulus')
      call v%real('scatter_sd', s%measurements%scatter_sd, '0.0', '[0, 0.5]', '', &
         & 'relative sd of differences between grains, in addition to the errors of measurement')
      call v%text('scale', s%measurements%scale, kind_choice, 'given', 'given, inferred', &
         & 'whether sd_gpa is taken as given, or times a common factor that is inferred (the column may then be absent)')
      call v%text('likelihood', s%measurements%likelihood, kind_choice, 'normal', v%words('likelihood'), &
         & 'distribution of the errors; student, which is Student''s t, admits outliers')
      call v%real('student_dof', s%measurements%student_dof, '4.0', '[1, 1000]', '', &
         & 'degrees of freedom of Student''s t, for likelihood = ''student''')

      call v%group('prior', s%prior%given, 'Limits of the constants before the measurements (Step 2); none are needed.')
      call v%reals('c_min', s%prior%c_min, shape_constants, 'unset', '[-500, 5000]', 'GPa', &
         & 'lower bounds of the constants; unset: none')
      call v%reals('c_max', s%prior%c_max, shape_constants, 'unset', '[-500, 5000]', 'GPa', &
         & 'upper bounds of the constants; unset: none; equal to the lower one: the constant is known')
      call v%optional_real('anisotropy_cap', s%prior%anisotropy_cap, '(0, 1e6]', '', &
         & 'largest universal anisotropy index (Eq. 14); unset: no limit')
      call v%text('measure', s%prior%measure, kind_choice, 'constants', 'constants, logarithms', &
         & 'with bounds on all constants: a prior uniform in the constants (the paper), or in the logarithm of the stiffness')

      call v%group('knowledge', s%knowledge%given, 'What else is known of the crystal (Step 2): lists of equal length, or a file.')
      call v%names('quantity', s%knowledge%quantity, 'unset', &
         & 'what is known: constants such as ''C11'', ratios such as ''C33/C11'', ''bulk_modulus'', ..')
      call v%reals('mean', s%knowledge%mean, shape_list, 'unset', '[-1e6, 1e6]', '', 'mean of each, GPa (compressibility: 1/TPa)')
      call v%reals('sd', s%knowledge%sd, shape_list, 'unset', '(0, 1e6]', '', 'standard deviation of each, in the same unit')
      call v%text('stiffness_file', s%knowledge%stiffness_file, kind_file, 'unset', '', &
         & 'CSV of the means (GPa) and the covariance (GPa^2) of all constants, as from density functional theory')

      call v%group('sampler', s%sampler%given, 'How the posterior is sampled.')
      call v%text('method', s%sampler%method, kind_choice, 'ensemble', v%words('sampler'), &
         & 'an ensemble sampler, which mixes along ridges; or the paper''s single-component Metropolis-Hastings')
      call v%integer('samples', s%sampler%samples, '10000', '[10, 100000000]', 'samples kept of each chain, after burn-in')
      call v%integer('burn_in', s%sampler%burn_in, '6000', '[0, 100000000]', &
         & 'sweeps before the samples of each chain; a sweep tries as many points as there are parameters')
      call v%integer('chains', s%sampler%chains, '4', '[1, 1000]', 'independent chains')
      call v%text('surrogate_variance', s%sampler%surrogate_variance, kind_choice, 'full', 'full, none', &
         & 'full: the likelihood includes the uncertainty of the surrogate; none: it does not (the paper)')
      call v%logical('evidence', s%sampler%evidence, '.false.', &
         & 'estimate the evidence log Z, to compare classes and models of the same data; it depends on the bounds of the prior')

      call v%group('next', s%next%given, 'Which grain to measure next.')
      call v%real('sd_gpa', s%next%sd_gpa, '0.0', '[0, 1000]', 'GPa', 'sd of the next measurement; 0: the median of the present')
      call v%text('target', s%next%target, kind_text, 'all', '', &
         & 'what to determine: all constants, a quantity such as C44 or bulk_modulus, or a product of powers such as C33/C11')
      call v%text('candidates', s%next%candidates, kind_file, 'unset', '', 'CSV of the grains to choose from: orientations as in ' &
         & //'&measurements, names in the column grain; unset: all directions')
      call v%integer('count', s%next%count, '5', '[1, 1000]', 'how many orientations to suggest')
      call visit_execution(v, s%execution)
   end subroutine visit_settings

   !> The groups of Step 0.
   subroutine visit_curves(v, curves, references)
      type(settings_list_type), intent(inout) :: v
      type(curves_settings_type), intent(inout) :: curves
      type(references_settings_type), intent(inout) :: references

      call v%group('curves', curves%given, 'Measured curves of load and depth (Step 0).')
      call v%text('file', curves%file, kind_file, '*', '', &
         & 'CSV of the columns test, time_s, depth_nm, load_mn and, if measured, stiffness_n_m: a point a row')
      call v%text('tests', curves%tests, kind_file, '*', '', &
         & 'CSV of the tests: test, grain or reference, and optional session, drift_nm_s and the orientation of the grain')
      call v%real('radius_um', curves%radius_um, '*', '[0.001, 1e6]', 'um', 'radius of the tip, as its maker states it')
      call v%optional_real('radius_sd_um', curves%radius_sd_um, '(0, 1e6]', 'um', 'its sd before the references; unset: 30 %')
      call v%real('tip_beta', curves%tip_beta, '1.0', '[-2, 20]', '', 'shape of the tip, r^2/(2 R) + beta r^4/(8 R^3): 1 a ' &
         & //'sphere, 0 a paraboloid, above 1 sharper, below 0 blunter')
      call v%real('tip_beta_sd', curves%tip_beta_sd, '1.0', '(0, 20]', '', 'its sd before the references')
      call v%real('compliance_sd_nm_mn', curves%compliance_sd_nm_mn, '0.02', '(0, 10]', 'nm/mN', &
         & 'sd of the compliance of the frame that is still in the depths')
      call v%logical('drift_removed', curves%drift_removed, '.true.', 'the depths have the drift_nm_s of the tests removed')
      call v%real('drift_sd_nm_s', curves%drift_sd_nm_s, '0.1', '(0, 5]', 'nm/s', 'sd of the drift that is left in a test')
      call v%real('load_sd_mn', curves%load_sd_mn, '0.02', '(0, 100]', 'mN', 'sd of the zero of the load in a test')
      call v%real('session_sd', curves%session_sd, '0.01', '(0, 0.5]', '', &
         & 'relative sd of a factor that the tests of a session share')
      call v%real('indenter_modulus_gpa', curves%indenter_modulus_gpa, '1140.0', '(0, 1e5]', 'GPa', &
         & 'Young''s modulus of the indenter')
      call v%real('indenter_nu', curves%indenter_nu, '0.07', '(-1, 0.5]', '', 'Poisson''s ratio of the indenter')

      call v%group('references', references%given, 'Materials of known modulus among the tests of &curves.')
      call v%names('name', references%name, 'unset', 'isotropic references, as the column reference of the tests names them')
      call v%reals('young_gpa', references%young_gpa, shape_list, 'unset', '(0, 5000]', 'GPa', 'Young''s modulus of each')
      call v%reals('young_sd_gpa', references%young_sd_gpa, shape_list, 'unset', '(0, 1000]', 'GPa', 'its sd')
      call v%reals('nu', references%nu, shape_list, 'unset', '(-1, 0.5)', '', 'Poisson''s ratio of each')
      call v%text('crystals', references%crystals, kind_file, 'unset', '', 'CSV of references that are crystals: reference, ' &
         & //'elastic constants (GPa), Bunge-Euler angles of the indented surface, and symmetry, unless it is that of &problem')
      call v%real('crystal_sd', references%crystal_sd, '0.01', '(0, 0.5]', '', 'relative sd of the moduli of these crystals')
   end subroutine visit_curves

   !> The machine.
   subroutine visit_execution(v, execution)
      type(settings_list_type), intent(inout) :: v
      type(execution_settings_type), intent(inout) :: execution

      call v%group('execution', execution%given, 'The machine.')
      call v%integer('workers', execution%workers, '0', '[0, 4096]', 'threads; 0: all cores. Results do not depend on it')
      call v%text('engine', execution%engine, kind_choice, 'local', 'local, dask', &
         & 'where simulations run: threads of this process, or workers of Dask (bayesindent; the batch program has threads)')
      call v%text('scheduler', execution%scheduler, kind_text, 'local', '', &
         & 'of Dask: local (processes of this machine), slurm, or an address such as tcp://head:8786')
   end subroutine visit_execution
end module settings_schema
