!> A problem from a namelist file, or from a text made of the keywords of a Python function: same checks, same words.
!> And the words that may stand in it for things that vary, from the modules that own them.
module problem_input
   use acquisitions, only: acquisition_names
   use bases, only: basis_names
   use build_checks, only: check_build, question_candidates
   use crystal_class, only: crystal_class_names
   use error_models, only: likelihood_names
   use errors, only: error_type, refuse
   use indenters, only: indenter_names
   use namelist_file, only: namelist_file_type, parse_namelist, place, read_namelist_file, replace_entries
   use observables, only: observable_names
   use paper_basis, only: truncation_names
   use problem, only: new_problem, problem_type
   use problem_posterior, only: check_step_2, check_target
   use samplers, only: sampler_names
   use settings_list, only: choice_list_type
   use simulate, only: check_simulation
   use specimens, only: geometry_names
   use stages, only: plan_stages
   use machine, only: blas_bytes, check_memory
   implicit none
   private
   public :: read_problem, problem_of_text, all_choices

contains

   !> A list of words for each key that `settings_schema` asks for.
   function all_choices() result(lists)
      type(choice_list_type), allocatable :: lists(:)

      allocate (lists(9))
      lists(1) = choice_list_type('geometry', geometry_names)
      lists(2) = choice_list_type('modulus_kind', observable_names)
      lists(3) = choice_list_type('likelihood', likelihood_names)
      lists(4) = choice_list_type('sampler', sampler_names)
      lists(5) = choice_list_type('basis', basis_names)
      lists(6) = choice_list_type('truncation', truncation_names)
      lists(7) = choice_list_type('acquisition', acquisition_names)
      lists(8) = choice_list_type('shape', indenter_names)
      lists(9)%key = 'symmetry'
      lists(9)%words = crystal_class_names()
   end function all_choices

   !> Read the file `path` for a stage or for 'run'.
   subroutine read_problem(path, command, self, error, changes)
      !> A file; a stage, or 'run'.
      character(len=*), intent(in) :: path, command
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> A namelist whose variables take the place of the file's; of Python, which then reads the measurements.
      character(len=*), intent(in), optional :: changes
      type(namelist_file_type) :: namelist
      character(len=:), allocatable :: groups
      character(len=8), allocatable :: names(:)

      call check_memory(blas_bytes, 'linear algebra', error)
      if (.not. allocated(error)) call read_namelist_file(path, namelist, error)
      if (present(changes) .and. .not. allocated(error)) call change_entries(path, changes, namelist, error)
      if (.not. allocated(error)) call plan_stages(namelist, command, names, groups, error)
      if (.not. allocated(error)) call new_problem(path, namelist, command, groups, all_choices(), present(changes), self, error)
      if (allocated(error)) return
      if (size(names) == 0) then
         call refuse(error, place(path, 'problem', '')//'nothing to do; &crystals asks for simulations, &design for a surrogate, ' &
            & //'&curves for moduli, &measurements for the constants')
         return
      end if
      self%stages = names
      call check_problem(self, error)
   end subroutine read_problem

   !> Let the variables of a namelist's text `changes`, if there is any, take the place of those of `namelist`.
   subroutine change_entries(path, changes, namelist, error)
      character(len=*), intent(in) :: path, changes
      type(namelist_file_type), intent(inout) :: namelist
      type(error_type), allocatable, intent(out) :: error
      type(namelist_file_type) :: stated

      if (len_trim(changes) == 0) return
      call parse_namelist(path, changes, stated, error)
      if (.not. allocated(error)) call replace_entries(namelist, stated)
   end subroutine change_entries

   !> The problem of a namelist's text, `content`, only for what it has, for Python; `origin` takes the place of the file in messages.
   subroutine problem_of_text(origin, content, self, error)
      character(len=*), intent(in) :: origin, content
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      type(namelist_file_type) :: namelist

      call parse_namelist(origin, content, namelist, error)
      if (.not. allocated(error)) call new_problem(origin, namelist, '', '', all_choices(), .true., self, error)
      if (.not. allocated(error)) call check_problem(self, error)
   end subroutine problem_of_text

   !> Refuse what a stage would refuse before its first simulation or sample.
   subroutine check_problem(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      logical :: has_theory

      call check_simulation(self%path, self%settings, has_theory, error)
      if (allocated(error)) return
      if (.not. has_theory) call do_without_theory(self, error)
      if (allocated(error)) return
      if (self%settings%simulation%simulator == 'import' .and. any(self%stages == 'simulate')) then
         call refuse(error, place(self%path, 'simulation', 'simulator')//'''import'' cannot indent the &crystals; allowed ' &
            & //'''fe'', ''theory''')
      else if (any(self%stages == 'build')) then
         call check_build(self, error)
      end if
      if (.not. allocated(error) .and. any(self%stages == 'extract' .or. self%stages == 'next')) call check_step_2(self, error)
      if (.not. allocated(error) .and. any(self%stages == 'next')) call check_target(self, error)
      if (.not. allocated(error) .and. allocated(self%candidates)) call question_candidates(self, error)
   end subroutine check_problem

   !> Of a specimen that theory does not know `run` leaves out its stage; who asks for it by name is refused.
   subroutine do_without_theory(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      if (self%command == 'run') self%stages = pack(self%stages, self%stages /= 'theory')
      if (any(self%stages == 'theory') .or. self%settings%simulation%simulator == 'theory') call refuse(error, place(self%path, &
         & 'specimen', 'geometry')//''''//self%settings%specimen%geometry//''' has no exact theory; allowed ''halfspace''')
   end subroutine do_without_theory

end module problem_input
