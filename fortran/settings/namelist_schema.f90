!> What may stand in a namelist file: one table, a row a variable. Checks, `resolved.nml`, help and docs/namelists.md
!> come from it and from nothing else; a new variable is a new row.
module namelist_schema
   use crystal_class, only: crystal_class_names
   use text, only: split_list
   implicit none
   private
   public :: schema_type, variable_type, group_type, new_schema, groups_of_command, commands, schema_markdown, &
      & allowed_in_words, kind_names
   public :: kind_integer, kind_real, kind_logical, kind_text, kind_choice, kind_file, kind_source

   !> A whole number; a real; .true. or .false.; any text; one of some words; a CSV that must exist; a word or a CSV.
   integer, parameter :: kind_integer = 1, kind_real = 2, kind_logical = 3, kind_text = 4, kind_choice = 5, &
      & kind_file = 6, kind_source = 7
   character(len=*), parameter :: kind_names(7) = [character(len=12) :: &
      & 'integer', 'real', 'logical', 'text', 'choice', 'file', 'source']

   !> What programs do with a file. `check` only reads it.
   character(len=*), parameter :: commands(7) = [character(len=8) :: &
      & 'run', 'simulate', 'theory', 'build', 'extract', 'next', 'check']

   type :: variable_type
      character(len=:), allocatable :: group, name
      integer :: kind = kind_text
      !> A value for each constant of the crystal class, in its order.
      logical :: per_constant = .false.
      !> '' where a number has none.
      character(len=:), allocatable :: unit
      !> Namelist text; '*' is required; 'unset' has no value; 'class: ..; class: ..' depends on the crystal class.
      character(len=:), allocatable :: default
      !> An interval, '[0, 1)', with '*' for no end; or the words of a choice, separated by commas.
      character(len=:), allocatable :: allowed
      character(len=:), allocatable :: meaning
      !> The one crystal class that has the variable, blank for all: a meaning that begins with 'class: ' says it.
      character(len=:), allocatable :: only
   end type variable_type

   type :: group_type
      character(len=:), allocatable :: name, meaning
   end type group_type

   type :: schema_type
      type(group_type), allocatable :: groups(:)
      type(variable_type), allocatable :: variables(:)
   contains
      procedure :: find_group
      procedure :: find
   end type schema_type

contains

   !> The table. Kinds: integer, real, logical, text, choice, file, source; `real*` has a value for each constant.
   function new_schema() result(s)
      type(schema_type) :: s

      allocate (s%groups(0), s%variables(0))

      call add_group(s, 'problem', 'What the file is about.')
      call add(s, 'symmetry', 'choice', '', '*', crystal_class_names(), 'crystal symmetry of the metal')
      call add(s, 'title', 'text', '', '', '', 'a title for the report')
      call add(s, 'synthetic', 'logical', '', '.false.', '', 'the data are made up: every figure says so')
      call add(s, 'seed', 'integer', '', '1', '[0, 2147483647]', 'seed of all random numbers; same seed, same results')

      call add_group(s, 'crystals', 'The crystals that `simulate` and `theory` indent.')
      call add(s, 'points', 'file', '', '*', '', 'CSV of elastic constants (GPa) and Bunge-Euler angles, one indentation a row')

      call add_group(s, 'simulation', 'The indentation simulation.')
      call add(s, 'simulator', 'choice', '', 'fe', 'fe, theory, import', &
         & 'finite elements, the exact half-space theory in their place, or only results that `build --tell` imports')
      call add(s, 'mesh', 'choice', '', 'halfspace', 'halfspace, paper', &
         & 'bricks and infinite elements that make a half-space, or the block of the paper')
      call add(s, 'element', 'choice', '', '', 'c3d8, c3d8i', 'the brick element; empty: the one the mesh was made for')
      call add(s, 'integration', 'choice', '', 'selective', 'selective, full', &
         & 'averaged volumetric strain as in Abaqus, or full integration as in CalculiX')
      call add(s, 'refine', 'real', '', '1.0', '[0.3, 4]', 'elements per contact radius, relative to the default mesh')
      call add(s, 'extrapolate', 'logical', '', '.false.', '', 'solve on a second, coarser mesh too and extrapolate in mesh size')
      call add(s, 'radius_um', 'real', 'um', '16.0', '[0.001, 1e6]', 'radius of the indenter')
      call add(s, 'depths', 'integer', '', '10', '[1, 1000]', 'points of the load-depth curve')
      call add(s, 'both_meshes', 'logical', '', '.false.', '', 'simulate the crystals on the other mesh too, for comparison')
      call add(s, 'vtu', 'logical', '', '.false.', '', 'write displacement and stress for ParaView')
      call add(s, 'inp', 'logical', '', '.false.', '', 'write the same problem as an Abaqus/CalculiX deck')

      call add_group(s, 'domain', 'The crystals that the surrogate covers.')
      call add(s, 'c_min', 'real*', 'GPa', 'cubic: 50, 40, 15; hexagonal: 80, 40, 30, 70, 40', '[-500, 5000]', &
         & 'lower bounds of the constants')
      call add(s, 'c_max', 'real*', 'GPa', 'cubic: 250, 150, 120; hexagonal: 240, 120, 90, 210, 90', '[-500, 5000]', &
         & 'upper bounds of the constants')
      call add(s, 'anisotropy_cap', 'real', '', 'cubic: 7.2; hexagonal: 66.2', '(0, 1e6]', &
         & 'largest universal anisotropy index (Eq. 14)')

      call add_group(s, 'surrogate', 'The surrogate model of the indentation modulus (Step 1).')
      call add(s, 'file', 'text', '', 'surrogate.nc', '', 'its file in the output folder, or the name of a shipped model')
      call add(s, 'coordinates', 'choice', '', 'dimensionless', 'box, dimensionless', &
         & 'the constants scaled to their bounds (the paper), or dimensionless ratios of them')
      call add(s, 'truncation', 'choice', '', 'total', 'tensor, total', &
         & '`degree` limits each factor of a product (the paper), or their sum')
      call add(s, 'degree', 'integer', '', '4', '[0, 12]', 'degree of the Legendre products in the constants (Q)')
      call add(s, 'bandlimit', 'integer', '', '8', '[0, 20]', 'highest degree of the surface harmonics in the orientation (L)')
      call add(s, 'prior', 'choice', '', 'theory', 'zero, theory', &
         & 'centre of the prior of the coefficients: zero (Eq. 6), or those of the half-space theory')
      call add(s, 'scan', 'text', '', '', '', &
         & 'other truncations to compare on the same simulations, degrees x bandlimits, such as 1, 2, 3 x 8, 10, 12')

      call add_group(s, 'design', 'Which simulations are made, and how many.')
      call add(s, 'candidates', 'source', '', 'latin', 'latin, factorial', &
         & 'the points to choose from: a Latin hypercube, constants x orientations, or a CSV')
      call add(s, 'n_candidates', 'integer', '', '2000', '[1, 1000000]', 'how many candidates are made')
      call add(s, 'initial', 'integer', '', '0', '[0, 100000]', 'simulations before the variance chooses; 0: as the basis needs')
      call add(s, 'initial_set', 'choice', '', 'variance', 'variance, latin, boundary', &
         & 'these first: of largest variance too, a Latin hypercube of their own, or of largest coordinate')
      call add(s, 'orientations', 'choice', '', 'sphere', 'sphere, declination', &
         & 'directions of latin candidates: uniform on the sphere, or Phi uniform in 0 .. 90 degrees')
      call add(s, 'n_directions', 'integer', '', '9', '[1, 10000]', 'directions of each crystal of factorial candidates')
      call add(s, 'variance_of', 'choice', '', 'modulus', 'modulus, log_modulus', &
         & 'whose variance chooses with dimensionless coordinates (a box: always the modulus)')
      call add(s, 'budget', 'integer', '', '40', '[1, 1000000]', 'simulations in all, those already done included')
      call add(s, 'batch', 'integer', '', '1', '[1, 10000]', 'simulations chosen at a time')
      call add(s, 'refit', 'integer', '', '1', '[1, 100000]', 'simulations between two maximisations of the evidence')
      call add(s, 'target_gpa', 'real', 'GPa', '0.0', '[0, 1000]', 'stop at this error on unseen crystals; 0: at the budget')
      call add(s, 'patience', 'integer', '', '0', '[0, 1000000]', &
         & 'stop if the error does not fall by 2 % over so many simulations; 0: at the budget')
      call add(s, 'validation', 'integer', '', '0', '[0, 1000000]', &
         & 'simulations chosen and made after the last one, to compare with the surrogate that has not seen them')
      call add(s, 'reuse', 'choice', '', 'all', 'all, chosen', &
         & 'which rows of the campaign are data: all, or only those that this file would choose (and imported ones)')

      call add_group(s, 'measurements', 'The measured moduli (Step 2).')
      call add(s, 'file', 'file', '', '*', '', 'CSV of Bunge-Euler angles, modulus_gpa and sd_gpa, one grain a row')
      call add(s, 'modulus_kind', 'choice', '', 'indentation_modulus', 'indentation_modulus, effective_modulus, sample_modulus', &
         & 'which modulus was measured')
      call add(s, 'indenter_modulus_gpa', 'real', 'GPa', '1140.0', '(0, 1e5]', &
         & 'Young''s modulus of the indenter (effective_modulus)')
      call add(s, 'indenter_nu', 'real', '', '0.07', '(-1, 0.5]', 'Poisson''s ratio of the indenter (effective_modulus)')
      call add(s, 'sample_nu', 'real', '', '0.3', '(-1, 0.5]', 'Poisson''s ratio that was assumed of the sample (sample_modulus)')
      call add(s, 'calibration_sd', 'real', '', '0.0', '[0, 0.5]', 'relative sd of a factor common to all measurements')
      call add(s, 'scale', 'choice', '', 'given', 'given, inferred', &
         & 'sd_gpa as given, or times a common factor that is inferred (then the column may be absent)')
      call add(s, 'likelihood', 'choice', '', 'normal', 'normal, student', 'distribution of the errors; student admits outliers')
      call add(s, 'student_dof', 'real', '', '4.0', '[1, 1000]', 'degrees of freedom of Student''s t (likelihood = ''student'')')

      call add_group(s, 'prior', 'What is known of the constants before the measurements (Step 2).')
      call add(s, 'c_min', 'real*', 'GPa', 'unset', '[-500, 5000]', 'lower bounds of the constants; unset: those of the surrogate')
      call add(s, 'c_max', 'real*', 'GPa', 'unset', '[-500, 5000]', 'upper bounds of the constants; unset: those of the surrogate')
      call add(s, 'anisotropy_cap', 'real', '', 'unset', '(0, 1e6]', 'largest anisotropy index; unset: that of the surrogate')
      call add(s, 'c_mean', 'real*', 'GPa', 'unset', '[-500, 5000]', 'means of normal priors of the constants')
      call add(s, 'c_sd', 'real*', 'GPa', 'unset', '[0, 5000]', 'sds of normal priors of the constants; 0: uniform')
      call add(s, 'bulk_mean_gpa', 'real', 'GPa', 'unset', '(0, 5000]', 'mean of a normal prior of the bulk modulus')
      call add(s, 'bulk_sd_gpa', 'real', 'GPa', 'unset', '(0, 5000]', 'its sd')
      call add(s, 'young_mean_gpa', 'real', 'GPa', 'unset', '(0, 5000]', &
         & 'mean of a normal prior of the polycrystal''s Young''s modulus (Hill)')
      call add(s, 'young_sd_gpa', 'real', 'GPa', 'unset', '(0, 5000]', 'its sd')
      call add(s, 'nu_mean', 'real', '', 'unset', '(-1, 0.5)', &
         & 'mean of a normal prior of the polycrystal''s Poisson''s ratio (Hill)')
      call add(s, 'nu_sd', 'real', '', 'unset', '(0, 1]', 'its sd')
      call add(s, 'zener_mean', 'real', '', 'unset', '(0, 1000]', 'cubic: mean of a normal prior of 2 C44/(C11 - C12)')
      call add(s, 'zener_sd', 'real', '', 'unset', '(0, 1000]', 'cubic: its sd')
      call add(s, 'c12_c11_mean', 'real', '', 'unset', '[-10, 10]', 'mean of a normal prior of C12/C11')
      call add(s, 'c12_c11_sd', 'real', '', 'unset', '(0, 100]', 'its sd')
      call add(s, 'c33_c11_mean', 'real', '', 'unset', '(0, 100]', 'hexagonal: mean of a normal prior of C33/C11')
      call add(s, 'c33_c11_sd', 'real', '', 'unset', '(0, 100]', 'hexagonal: its sd')
      call add(s, 'c13_c12_mean', 'real', '', 'unset', '[-100, 100]', 'hexagonal: mean of a normal prior of C13/C12')
      call add(s, 'c13_c12_sd', 'real', '', 'unset', '(0, 100]', 'hexagonal: its sd')
      call add(s, 'c44_c66_mean', 'real', '', 'unset', '(0, 100]', 'hexagonal: mean of a normal prior of 2 C44/(C11 - C12)')
      call add(s, 'c44_c66_sd', 'real', '', 'unset', '(0, 100]', 'hexagonal: its sd')

      call add_group(s, 'sampler', 'How the posterior is sampled.')
      call add(s, 'method', 'choice', '', 'ensemble', 'ensemble, scmh', &
         & 'an ensemble that mixes along ridges, or the paper''s single-component Metropolis-Hastings')
      call add(s, 'samples', 'integer', '', '10000', '[10, 100000000]', 'samples kept of each chain, after burn-in')
      call add(s, 'burn_in', 'integer', '', '20000', '[0, 100000000]', &
         & 'sweeps before the samples of each chain; a sweep tries as many points as there are parameters')
      call add(s, 'chains', 'integer', '', '4', '[1, 1000]', 'independent chains')
      call add(s, 'surrogate_variance', 'choice', '', 'full', 'full, none', &
         & 'whether the likelihood has the uncertainty of the surrogate (none is the paper)')

      call add_group(s, 'next', 'Which grain to measure next.')
      call add(s, 'sd_gpa', 'real', 'GPa', '0.0', '[0, 1000]', 'sd of the next measurement; 0: the median of those made')
      call add(s, 'target', 'text', '', 'all', '', &
         & 'what to learn about: all, a quantity such as C44 or bulk_modulus, or a product of powers such as C33/C11')
      call add(s, 'count', 'integer', '', '5', '[1, 1000]', 'how many orientations to suggest')

      call add_group(s, 'execution', 'The machine.')
      call add(s, 'workers', 'integer', '', '0', '[0, 4096]', 'threads; 0: all cores. Results do not depend on it')
      call add(s, 'engine', 'choice', '', 'local', 'local', 'where simulations run')
   end function new_schema

   !> The groups that a command needs, with defaults if the file has them not; `run` needs what the file asks for.
   pure function groups_of_command(command) result(names)
      character(len=*), intent(in) :: command
      character(len=:), allocatable :: names

      select case (command)
      case ('simulate')
         names = 'problem crystals simulation execution'
      case ('theory')
         names = 'problem crystals execution'
      case ('build')
         names = 'problem simulation domain surrogate design execution'
      case ('extract')
         names = 'problem surrogate measurements prior sampler execution'
      case ('next')
         names = 'problem surrogate measurements prior sampler next execution'
      case default
         names = 'problem execution'
      end select
   end function groups_of_command

   subroutine add_group(s, name, meaning)
      type(schema_type), intent(inout) :: s
      character(len=*), intent(in) :: name, meaning
      type(group_type), allocatable :: grown(:)
      integer :: n

      n = size(s%groups)
      allocate (grown(n + 1))
      grown(:n) = s%groups
      grown(n + 1)%name = name
      grown(n + 1)%meaning = meaning
      call move_alloc(grown, s%groups)
   end subroutine add_group

   !> A variable of the group that was added last.
   subroutine add(s, name, kind, unit, default, allowed, meaning)
      type(schema_type), intent(inout) :: s
      character(len=*), intent(in) :: name, kind, unit, default, allowed, meaning
      type(variable_type), allocatable :: grown(:)
      integer :: n, star

      n = size(s%variables)
      allocate (grown(n + 1))
      grown(:n) = s%variables
      star = index(kind, '*')
      associate (v => grown(n + 1))
         v%group = s%groups(size(s%groups))%name
         v%name = name
         v%per_constant = star > 0
         if (star == 0) star = len(kind) + 1
         v%kind = findloc(kind_names == kind(:star - 1), .true., dim=1)
         v%unit = unit
         v%default = default
         v%allowed = allowed
         v%meaning = meaning
         v%only = ''
         if (index(meaning, ': ') > 0) v%only = meaning(:index(meaning, ': ') - 1)
         if (.not. any(split_list(crystal_class_names()) == v%only)) v%only = ''
      end associate
      call move_alloc(grown, s%variables)
   end subroutine add

   !> Number of a group, 0 if there is none of this name.
   pure integer function find_group(self, name) result(i)
      class(schema_type), intent(in) :: self
      character(len=*), intent(in) :: name

      do i = size(self%groups), 1, -1
         if (self%groups(i)%name == name) return
      end do
   end function find_group

   !> Number of a variable, 0 if the group has none of this name.
   pure integer function find(self, group, name) result(i)
      class(schema_type), intent(in) :: self
      character(len=*), intent(in) :: group, name

      do i = size(self%variables), 1, -1
         if (self%variables(i)%group == group .and. self%variables(i)%name == name) return
      end do
   end function find

   !> The table as a page of the documentation.
   function schema_markdown() result(page)
      character(len=:), allocatable :: page
      type(schema_type) :: s
      character, parameter :: newline = achar(10)
      integer :: i, j

      s = new_schema()
      page = '# Namelist groups' //newline//newline &
         & //'Written by `bayesindent-batch --schema`. A file needs `&problem`; the other groups say what is done.' &
         & //newline//'`*` is required, `unset` has no value. Paths are relative to the folder of the file.'//newline
      do i = 1, size(s%groups)
         page = page//newline//'## `&'//s%groups(i)%name//'`'//newline//newline//s%groups(i)%meaning//newline//newline &
            & //'| variable | type | unit | default | allowed | meaning |'//newline//'|---|---|---|---|---|---|'//newline
         do j = 1, size(s%variables)
            associate (v => s%variables(j))
               if (v%group /= s%groups(i)%name) cycle
               page = page//'| `'//v%name//'` | '//kind_in_words(v)//' | '//v%unit//' | '//v%default//' | ' &
                  & //allowed_in_words(v)//' | '//v%meaning//' |'//newline
            end associate
         end do
      end do
   end function schema_markdown

   function kind_in_words(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      select case (v%kind)
      case (kind_source)
         words = 'choice or file'
      case default
         words = trim(kind_names(v%kind))
      end select
      if (v%per_constant) words = words//' for each constant'
   end function kind_in_words

   !> What is allowed, as a message says it: 'from 0 to below 1', 'above 0', ''cubic', 'hexagonal'', or ''.
   function allowed_in_words(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words
      character(len=:), allocatable :: low, high, list
      integer :: comma

      select case (v%kind)
      case (kind_integer, kind_real)
         words = ''
         if (len(v%allowed) == 0) return
         comma = index(v%allowed, ',')
         low = trim(adjustl(v%allowed(2:comma - 1)))
         high = trim(adjustl(v%allowed(comma + 1:len(v%allowed) - 1)))
         if (v%allowed(1:1) == '[') then
            words = low
         else
            words = 'above '//low
         end if
         if (high == '*') then
            if (v%allowed(1:1) == '[') words = words//' or more'
         else if (v%allowed(len(v%allowed):) == ']') then
            words = words//' to '//high
         else
            words = words//' to below '//high
         end if
      case (kind_choice, kind_source)
         words = ''
         list = v%allowed
         do
            comma = index(list, ',')
            if (comma == 0) exit
            words = words//''''//list(:comma - 1)//''', '
            list = adjustl(list(comma + 1:))
            list = trim(list)
         end do
         words = words//''''//list//''''
         if (v%kind == kind_source) words = words//', or the name of a CSV file'
      case (kind_logical)
         words = '.true., .false.'
      case default
         words = ''
      end select
   end function allowed_in_words
end module namelist_schema
