!> The stages of a namelist: one table, a row a stage. Each is a command of its own; `run` makes those whose group is there, in
!> order.
module stages
   use abstract_stage, only: stage_type
   use build_stage, only: build_stage_type, check_new_surrogate
   use errors, only: error_type, exit_bad_input, raise
   use extract_stage, only: extract_stage_type
   use files, only: printable
   use namelist_file, only: namelist_file_type
   use next_stage, only: next_stage_type
   use problem, only: problem_type
   use simulate_stage, only: simulate_stage_type
   use size_stage, only: size_stage_type
   use surrogate_lookup, only: places_type
   use theory_stage, only: theory_stage_type
   implicit none
   private
   public :: stage_row_type, all_stages, run_command, plan_stages, groups_of, new_stage, check_stages

   type :: stage_row_type
      character(len=8) :: name
      !> The group of the namelist that makes `run` do it.
      character(len=12) :: trigger
      !> The groups that it needs, with defaults where the file has them not.
      character(len=80) :: groups
      !> The file of its document in the output folder.
      character(len=16) :: document
      !> For help: one line, then more.
      character(len=80) :: summary
      character(len=320) :: description
   end type stage_row_type

   type(stage_row_type), parameter :: all_stages(6) = [ &
      & stage_row_type('simulate', 'crystals', 'problem crystals specimen indenter simulation execution', 'simulate.json', &
      & 'finite element indentation of the crystals in a namelist', &
      & 'Writes moduli.csv (the three kinds of modulus), curves.csv (force and modulus by depth), and with vtu or inp the fields ' &
      & //'for ParaView or the same problem as a deck for Abaqus or CalculiX. Crystals that are done already are not simulated ' &
      & //'again.'), &
      & stage_row_type('theory', 'crystals', 'problem crystals specimen execution', 'theory.json', &
      & 'exact half-space theory of the same crystals', &
      & 'Willis'' elliptical contact on the anisotropic half-space. Writes theory.csv.'), &
      & stage_row_type('size', '', 'problem crystals specimen indenter simulation execution', 'size.json', &
      & 'how thick a film, or how large a grain, must be', &
      & 'Simulates the crystals in films or grains of growing size, in the surroundings of &specimen and in softer and stiffer ' &
      & //'ones, and says from which size on their modulus is that of a half-space within 1 %. Writes size.png.'), &
      & stage_row_type('build', 'design', 'problem specimen indenter simulation domain surrogate design execution', 'build.json', &
      & 'step 1: a surrogate, taught by simulations chosen one after another', &
      & 'Writes the surrogate. Every simulation is kept in campaign.sqlite as soon as it is done, so that the command may be ' &
      & //'interrupted and run again, with a larger budget too. With --ask it only prints the next crystals; --tell takes ' &
      & //'their moduli.'), &
      & stage_row_type('extract', 'measurements', 'problem surrogate indenter measurements prior knowledge sampler execution', &
      & 'summary.json', &
      & 'step 2: the constants behind measured moduli', &
      & 'Writes posterior.nc and summary.json, and says what the data decided and what the prior did. Needs no simulation: ' &
      & //'the exact theory, the correction that comes with the package (''block'') or one made by build serves.'), &
      & stage_row_type('next', 'next', 'problem surrogate indenter measurements prior knowledge sampler next execution', &
      & 'next.json', &
      & 'the grain orientations worth measuring next', &
      & 'Ranks orientations by what one more measurement there is expected to teach, given the posterior of extract.')]

   !> All stages that a file asks for.
   type(stage_row_type), parameter :: run_command = stage_row_type('run', '', 'problem execution', '', &
      & 'all that the groups of a namelist ask for, in order, resuming what is done', &
      & '&crystals asks for simulate and theory, &design for build, &measurements for extract, &next for next; a report ends ' &
      & //'it. Nothing that is already in the output folder is simulated again.')

contains

   !> The `names` of the stages of a command and the `groups` that they need, both separated by blanks; none if a file asks `run`
   !> for nothing.
   subroutine plan_stages(namelist, command, names, groups, error)
      type(namelist_file_type), intent(in) :: namelist
      !> A stage, or 'run'.
      character(len=*), intent(in) :: command
      character(len=:), allocatable, intent(out) :: names, groups
      type(error_type), allocatable, intent(out) :: error
      type(stage_row_type) :: stage
      character(len=:), allocatable :: allowed
      integer :: i, j

      names = ''
      groups = trim(run_command%groups)
      allowed = 'run'
      do i = 1, size(all_stages)
         stage = all_stages(i)
         allowed = allowed//', '//trim(stage%name)
         if (command == 'run') then
            if (.not. any([(namelist%groups(j)%text == stage%trigger, j=1, size(namelist%groups))])) cycle
         else if (command /= stage%name) then
            cycle
         end if
         if (len(names) > 0) names = names//' '
         names = names//trim(stage%name)
         groups = groups//' '//trim(stage%groups)
      end do
      if (len(names) == 0 .and. command /= 'run') call raise(error, 'no command is named '''//printable(command) &
         & //'''; allowed: '//allowed, exit_bad_input)
   end subroutine plan_stages

   !> The groups of the namelist that stages need, separated by blanks.
   function groups_of(names) result(groups)
      !> Separated by blanks.
      character(len=*), intent(in) :: names
      character(len=:), allocatable :: groups
      integer :: i

      groups = ''
      do i = 1, size(all_stages)
         if (index(' '//names//' ', ' '//trim(all_stages(i)%name)//' ') > 0) groups = groups//' '//trim(all_stages(i)%groups)
      end do
      groups = adjustl(groups)
   end function groups_of

   !> Refuse what the stages of a problem would refuse before their first simulation or sample, as far as no stage before makes what it
   !> is about.
   subroutine check_stages(problem, places, error)
      type(problem_type), intent(in), target :: problem
      type(places_type), intent(in) :: places
      type(error_type), allocatable, intent(out) :: error
      type(build_stage_type) :: build
      type(extract_stage_type) :: extract

      if (index(' '//problem%stages//' ', ' build ') > 0) then
         build%problem => problem
         build%output = places%output(:len(places%output) - 1)
         call check_new_surrogate(build, error)
      else if (index(' '//problem%stages//' ', ' extract ') > 0 .or. index(' '//problem%stages//' ', ' next ') > 0) then
         call extract%open(problem, places, error)
      end if
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
      case ('size')
         allocate (size_stage_type :: stage)
      case ('build')
         allocate (build_stage_type :: stage)
      case ('extract')
         allocate (extract_stage_type :: stage)
      case ('next')
         allocate (next_stage_type :: stage)
      case default
         call raise(error, 'no stage is named '//printable(name), exit_bad_input)
         return
      end select
      do i = 1, size(all_stages)
         if (all_stages(i)%name == name) then
            stage%groups = trim(all_stages(i)%groups)
            stage%document_file = trim(all_stages(i)%document)
         end if
         if (all_stages(i)%name == 'extract') stage%groups_of_posterior = trim(all_stages(i)%groups)
      end do
      stage%name = name
   end subroutine new_stage
end module stages
