!> A problem from a namelist file, or from a text made of the keywords of a Python function: same checks, same words.
module problem_input
   use build_checks, only: check_build, question_candidates
   use errors, only: error_type, refuse
   use namelist_file, only: namelist_file_type, parse_namelist, place, read_namelist_file, replace_entries
   use problem, only: new_problem, problem_type
   use problem_posterior, only: check_step_2, check_target
   use simulate, only: check_simulation
   use stages, only: plan_stages
   use machine, only: blas_bytes, check_memory
   implicit none
   private
   public :: read_problem, problem_of_text

contains

   !> Read the file `path` for a stage or for 'run'.
   subroutine read_problem(path, command, changes, self, error)
      !> A file; a stage, or 'run'; a namelist whose variables take the place of the file's, or ''.
      character(len=*), intent(in) :: path, command, changes
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      type(namelist_file_type) :: namelist, stated
      character(len=:), allocatable :: groups
      character(len=8), allocatable :: names(:)

      call check_memory(blas_bytes, 'linear algebra', error)
      if (.not. allocated(error)) call read_namelist_file(path, namelist, error)
      if (len(changes) > 0 .and. .not. allocated(error)) then
         call parse_namelist(path, changes, stated, error)
         if (.not. allocated(error)) call replace_entries(namelist, stated)
      end if
      if (.not. allocated(error)) call plan_stages(namelist, command, names, groups, error)
      if (.not. allocated(error)) call new_problem(path, namelist, command, groups, self, error)
      if (allocated(error)) return
      if (size(names) == 0) then
         call refuse(error, place(path, 'problem', '')//'nothing to do; &crystals asks for simulations, &design for a surrogate, ' &
            & //'&curves for moduli, &measurements for the constants')
         return
      end if
      self%stages = names
      call check_problem(self, error)
   end subroutine read_problem

   !> The problem of a namelist's text, `content`, only for what it has; `origin` takes the place of the file in messages.
   subroutine problem_of_text(origin, content, self, error)
      character(len=*), intent(in) :: origin, content
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      type(namelist_file_type) :: namelist

      call parse_namelist(origin, content, namelist, error)
      if (.not. allocated(error)) call new_problem(origin, namelist, '', '', self, error)
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
