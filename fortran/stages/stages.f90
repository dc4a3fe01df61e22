!> The table of the stages. Each stage is a command. The command `run` performs, in order, the
!> stages whose group the namelist has.
!>
!> The module also makes the problem of a stage from a namelist file, or from a text of the keywords
!> of a Python function, with the same checks and messages.
module stages
   use abstract_stage, only: stage_type
   use build_checks, only: check_build, question_candidates
   use build_stage, only: build_stage_type
   use curves_stage, only: curves_stage_type
   use errors, only: error_type, locate_error, refuse
   use extract_stage, only: extract_stage_type
   use files, only: printable, read_text_file
   use film_theory, only: check_film, film_name
   use machine, only: raise_no_memory, reserve_blas
   use namelist_file, only: entry_type, find_entry, parse_namelist
   use next_stage, only: next_stage_type
   use plan_stage, only: plan_stage_type
   use posterior_focus, only: check_focus
   use named_values, only: named_values_reader_type
   use problem, only: new_problem, problem_type
   use problem_tables, only: load_tables
   use problem_posterior, only: check_step_2, check_target
   use simulate, only: check_simulation, new_simulator, simulator_type
   use simulate_stage, only: simulate_stage_type
   use surrogate_model, only: places_type
   use tensor_stage, only: tensor_stage_type
   use text, only: join
   use theory_stage, only: theory_stage_type
   implicit none
   private
   public :: stage_row_type, all_stages, run_command, load_problem, read_problem, &
      & groups_of, new_stage, check_stages

   type :: stage_row_type
      character(len=8) :: name
      !> The group of the namelist with which `run` performs the stage; '-': it does not.
      character(len=12) :: trigger
      !> The groups that the stage needs. Defaults replace missing ones.
      character(len=80) :: groups
      !> The file of its document in the output folder.
      character(len=16) :: document
   end type stage_row_type

   type(stage_row_type), parameter :: all_stages(8) = [ &
      & stage_row_type('simulate', 'crystals', &
      & 'problem crystals specimen indenter simulation execution', 'simulate.json'), &
      & stage_row_type('theory', 'crystals', &
      & 'problem crystals specimen indenter simulation execution', 'theory.json'), &
      & stage_row_type('build', 'design', &
      & 'problem specimen indenter simulation domain surrogate design execution', 'build.json'), &
      & stage_row_type('plan', 'plan', &
      & 'problem surrogate plan measurements prior knowledge sampler execution', 'plan.json'), &
      & stage_row_type('curves', 'curves', 'problem curves references execution', 'curves.json'), &
      & stage_row_type('extract', 'measurements', &
      & 'problem surrogate indenter measurements prior knowledge sampler execution', &
      & 'summary.json'), &
      & stage_row_type('next', 'next', &
      & 'problem surrogate indenter measurements prior knowledge sampler next execution', &
      & 'next.json'), &
      & stage_row_type('tensor', '-', &
      & 'problem surrogate indenter measurements prior knowledge sampler next execution', &
      & 'tensor.json')]

   !> The command for all stages that a file asks for.
   type(stage_row_type), &
      & parameter :: run_command = stage_row_type('run', '', 'problem execution', '')

contains

   !> The groups of the namelist that stages need, separated by blanks.
   pure function groups_of(names) result(groups)
      !> Names of the stages.
      character(len=*), intent(in) :: names(:)
      character(len=:), allocatable :: groups
      integer :: i

      groups = join(pack(all_stages%groups, &
         & [(any(names == all_stages(i)%name), i=1, size(all_stages))]), ' ')
   end function groups_of

   !> Refuse a problem that a stage would refuse before its first simulation or sample. Stages that
   !> need the results of an earlier stage are not checked.
   subroutine check_stages(problem, places, completely, error)
      type(problem_type), intent(in), target :: problem
      type(places_type), intent(in) :: places
      !> Refuse also impossible simulations: with a mesh that is too large, or too coarse, or that
      !> does not fit into memory.
      logical, intent(in) :: completely
      type(error_type), allocatable, intent(out) :: error
      type(extract_stage_type) :: extract
      type(plan_stage_type) :: plan
      type(simulator_type) :: simulator

      associate (stages => problem%run%stages)
         if (any(stages == 'build')) then
            call check_build(problem, error, places%output(:len(places%output) - 1))
         else if (problem%settings%specimen%geometry == film_name) then
            ! The stage itself trains the correction.
            if (allocated(problem%data%measurements)) call check_focus(problem, error)
         else
            if (any(stages == 'plan')) call plan%open(problem, places, error)
            if (allocated(error)) return
            if (all(stages /= 'curves') .and. any(stages == 'extract' .or. stages == 'next')) then
               call extract%open(problem, places, error)
            end if
         end if
         if (allocated(error) .or. .not. completely &
            & .or. problem%settings%simulation%simulator /= 'fe') then
            return
         end if
         if (.not. any(stages == 'simulate' .or. stages == 'build')) return
      end associate
      call new_simulator(problem%settings, simulator, error)
      call problem%locate('simulation', '', error)
   end subroutine check_stages

   !> The stage of this name.
   subroutine new_stage(name, stage, error)
      character(len=*), intent(in) :: name
      class(stage_type), allocatable, intent(out) :: stage
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      select case (name)
      case ('simulate')
         allocate (simulate_stage_type :: stage)
      case ('theory')
         allocate (theory_stage_type :: stage)
      case ('build')
         allocate (build_stage_type :: stage)
      case ('curves')
         allocate (curves_stage_type :: stage)
      case ('extract')
         allocate (extract_stage_type :: stage)
      case ('next')
         allocate (next_stage_type :: stage)
      case ('plan')
         allocate (plan_stage_type :: stage)
      case ('tensor')
         allocate (tensor_stage_type :: stage)
      case default
         call refuse(error, 'no stage is named '//printable(name))
         return
      end select
      i = findloc(all_stages%name, name, 1)
      stage%groups = trim(all_stages(i)%groups)
      stage%groups_of_posterior = groups_of(['extract'])
      stage%document_file = trim(all_stages(i)%document)
   end subroutine new_stage

   !> Read a namelist without the tables that it names: a file for a stage or for 'run', or the
   !> keywords of a function of Python, for no command.
   subroutine read_problem(path, command, changes, self, error, keywords)
      !> Path of the file, or the function; a stage, 'run' or ''; a namelist whose variables replace
      !> those of the file, or ''.
      character(len=*), intent(in) :: path, command, changes
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> A namelist.
      character(len=*), intent(in), optional :: keywords
      type(entry_type), allocatable :: namelist(:), stated(:)
      character(len=8), allocatable :: names(:)
      character(len=:), allocatable :: content, needed
      logical :: asked(size(all_stages))
      integer :: i

      if (reserve_blas(1) < 1) call raise_no_memory('linear algebra', error)
      if (allocated(error)) return
      if (present(keywords)) then
         content = keywords
      else
         call read_text_file(path, content, error, comment='!')
      end if
      if (.not. allocated(error)) call parse_namelist(content, namelist, error)
      if (.not. allocated(error) .and. len(changes) > 0) then
         call parse_namelist(changes, stated, error)
         ! The last of two entries applies.
         if (.not. allocated(error)) namelist = [namelist, stated]
      end if
      call locate_error(error, path)
      if (allocated(error)) return
      asked = all_stages%name == command
      if (command == 'run') then
         asked = [(find_entry(namelist, all_stages(i)%trigger, '') > 0, i=1, size(all_stages))]
         ! The next grains follow from the constants.
         if (find_entry(namelist, 'next', '') > 0) asked = asked .or. all_stages%name == 'extract'
      end if
      names = pack(all_stages%name, asked)
      if (size(names) == 0 .and. command /= 'run' .and. .not. present(keywords)) then
         call refuse(error, 'no command is named '''//printable(command)//'''; allowed: run, ' &
            & //join(all_stages%name, ', '))
         return
      end if
      needed = ''
      if (len(command) > 0) needed = trim(run_command%groups)//' '//groups_of(names)
      call new_problem(path, namelist, command, needed, self, error)
      call locate_error(error, path)
      if (allocated(error)) return
      if (size(names) == 0 .and. len(command) > 0) then
         call self%refuse('problem', '', 'nothing to do; &crystals asks for simulations, &design ' &
            & //'for a surrogate, &plan for expected sds, &curves for moduli, &measurements for ' &
            & //'the constants', error)
      end if
      self%run%stages = names
   end subroutine read_problem

   !> Read the tables of a problem, and refuse it if one of its stages would refuse it before its
   !> first simulation or sample.
   subroutine load_problem(self, given, error)
      type(problem_type), intent(inout) :: self
      !> Texts of tables, see `load_tables`.
      type(named_values_reader_type), intent(inout) :: given
      type(error_type), allocatable, intent(out) :: error
      character(len=8), allocatable :: stages(:)
      logical :: has_theory

      call load_tables(self, given, error)
      if (allocated(error)) return
      stages = self%run%stages
      has_theory = self%settings%specimen%geometry == film_name
      if (has_theory) then
         call check_film(self, error)
         if (self%run%command == 'run') stages = pack(stages, stages /= 'simulate')
         if (any(stages == 'simulate') .and. .not. allocated(error)) then
            call self%refuse('specimen', 'geometry', 'a film needs no simulations; use the ' &
               & //'command theory', error)
         end if
      else
         call check_simulation(self%settings, has_theory, error)
      end if
      call self%locate('', '', error)
      if (allocated(error)) return
      associate (settings => self%settings)
         if (self%run%command == 'run') then
            ! `run` leaves out the theory if it does not exist for the specimen. The command
            ! `theory` is refused.
            if (.not. has_theory) stages = pack(stages, stages /= 'theory')
            ! A plan may state errors of measurements that are still to be made.
            if (settings%plan%given .and. .not. (settings%curves%given &
               & .or. allocated(settings%measurements%file) &
               & .or. allocated(settings%measurements%velocities))) then
               stages = pack(stages, stages /= 'extract')
            end if
         end if
         if (.not. has_theory .and. (any(stages == 'theory') &
            & .or. settings%simulation%simulator == 'theory')) then
            call self%refuse('specimen', 'geometry', ''''//settings%specimen%geometry &
               & //''' has no exact theory; allowed ''halfspace'', ''film''', error)
         else if (settings%simulation%simulator == 'import' .and. any(stages == 'simulate')) then
            call self%refuse('simulation', 'simulator', &
               & '''import'' cannot indent the &crystals; allowed ''fe'', ''theory''', error)
         else if (settings%measurements%orientations == 'unknown' &
            & .and. any(stages == 'next' .or. stages == 'plan' .or. stages == 'tensor')) then
            call self%refuse('measurements', 'orientations', '''unknown'' cannot be combined ' &
               & //'with next, plan or tensor, which compare orientations; remove one of ' &
               & //'them', error)
         else if (any(stages == 'build')) then
            call check_build(self, error)
         end if
      end associate
      if (allocated(error)) return
      self%run%stages = stages
      if (any(stages == 'extract' .or. stages == 'next' .or. stages == 'tensor')) then
         call check_step_2(self, error)
      end if
      if (allocated(error)) return
      if (any(stages == 'next')) call check_target(self, error)
      if (allocated(error)) return
      if (allocated(self%data%candidates)) call question_candidates(self, error)
   end subroutine load_problem
end module stages
