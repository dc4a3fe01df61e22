!> Stages, see `abstract_stage`: what is to be simulated goes out, what became of it comes in.
module stage_operations
   use abstract_stage, only: stage_type
   use build_stage, only: build_stage_type
   use campaign_import, only: import_table
   use errors, only: error_type
   use exchange, only: exchange_type
   use interruption, only: listen, stop_listening
   use kinds, only: wp
   use problem, only: problem_type
   use settings_output, only: settings_namelist
   use simulate, only: outcome_done, outcome_failed, outcome_type
   use stages, only: new_stage
   use surrogate_operations, only: places_of
   use text, only: to_text
   use warning_lists, only: warning_type
   implicit none
   private
   public :: perform_stage

   type :: held_stage_type
      class(stage_type), allocatable :: stage
   end type held_stage_type

contains

   subroutine perform_stage(verb, object, x, error)
      character(len=*), intent(in) :: verb
      !> A stage; not associated: one is to be opened, or the moduli of others imported.
      class(*), pointer, intent(in) :: object
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(held_stage_type), pointer :: held
      type(problem_type), pointer :: problem, points
      character(len=:), allocatable :: document

      if (associated(object)) then
         select type (object)
         type is (held_stage_type)
            call use_stage(verb, object%stage, x, error)
         end select
         return
      end if
      problem => x%problem(error)
      if (allocated(error)) return
      if (verb == 'open') then
         allocate (held)
         call x%give(held, 'stage')
         call new_stage(x%in%text('name'), held%stage, error)
         if (.not. allocated(error)) call held%stage%open(problem, places_of(x), error)
         if (allocated(error)) return
         call x%out%put('expected', held%stage%n_expected)
      else
         points => x%problem(error, 'points')
         if (.not. allocated(error)) call import_table(problem, places_of(x), points%crystals, x%in%text('name'), document, error)
         if (.not. allocated(error)) call x%out%put('document', document)
      end if
   end subroutine perform_stage

   subroutine use_stage(verb, stage, x, error)
      character(len=*), intent(in) :: verb
      class(stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: document

      select case (verb)
      case ('want')
         call stage%want(error)
         if (.not. allocated(error)) call put_jobs(stage, x)
      case ('take')
         call take(stage, x, error)
      case ('leave')
         call stage%leave(error)
      case ('close')
         call listen()
         call stage%close(document, error)
         call stop_listening()
         if (.not. allocated(error)) call x%out%put('document', document)
      case ('look_ahead')
         select type (stage)
         type is (build_stage_type)
            call look_ahead(stage, x, error)
         end select
      case default
         call x%refuse(verb, error)
      end select
   end subroutine use_stage

   !> What is to be simulated now: numbers, stiffness (GPa, crystal axes), angles (degrees), and of each the number from 0 of its
   !> `physics`, the
   !> groups of a namelist.
   subroutine put_jobs(stage, x)
      class(stage_type), intent(in) :: stage
      type(exchange_type), intent(inout) :: x
      type(warning_type) :: physics(size(stage%physics))
      real(wp), allocatable :: stiffness(:, :, :), euler_deg(:, :)
      integer :: i

      associate (jobs => stage%jobs)
         do i = 1, size(physics)
            physics(i)%text = ''
            if (any(jobs%physics == i)) physics(i)%text = settings_namelist(stage%physics(i), 'specimen indenter simulation', &
               & .true.)
         end do
         allocate (stiffness(6, 6, size(jobs)), euler_deg(3, size(jobs)))
         do i = 1, size(jobs)
            stiffness(:, :, i) = jobs(i)%stiffness
            euler_deg(:, i) = jobs(i)%euler_deg
         end do
         call x%out%put('physics', physics)
         call x%out%put_integers('physics_number', jobs%physics - 1, shape(jobs))
         call x%out%put_integers('number', jobs%number, shape(jobs))
         call x%out%put_array('stiffness', stiffness, shape(stiffness))
         call x%out%put_array('euler_deg', euler_deg, shape(euler_deg))
      end associate
   end subroutine put_jobs

   !> What became of a simulation: its modulus (GPa), or the reason why there is none; `machine`: the machine could not make it.
   subroutine take(stage, x, error)
      class(stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(outcome_type) :: outcome

      allocate (outcome%depth(0), outcome%force(0))
      outcome%message = ''
      if (x%in%has('message')) outcome%message = x%in%text('message')
      if (x%in%has('seconds')) outcome%seconds = x%in%real('seconds')
      if (x%in%has('modulus_gpa')) then
         outcome%status = outcome_done
         outcome%modulus = x%in%real('modulus_gpa')
      else if (.not. x%in%has('machine')) then
         outcome%status = outcome_failed
      end if
      if (x%in%has('elements')) then
         outcome%elements = int(x%in%integer('elements'))
         outcome%depth = x%in%reals('depth_um')
         outcome%force = x%in%reals('force_mn')
      end if
      call stage%take(int(x%in%integer('number')), outcome, error)
   end subroutine take

   !> The next candidates: names of columns, and rows of constants (GPa) and angles (degrees).
   subroutine look_ahead(stage, x, error)
      type(build_stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: numbers(:)
      type(warning_type), allocatable :: names(:)
      real(wp), allocatable :: rows(:, :)
      integer :: i

      call stage%look_ahead(int(x%in%integer('count')), numbers, error)
      if (allocated(error)) return
      associate (class => stage%learning%learner%basis%domain%class, candidates => stage%candidates)
         allocate (names(class%n_constants), rows(class%n_constants + 3, size(numbers)))
         do i = 1, size(names)
            names(i)%text = trim(class%constants(i))
         end do
         rows(:size(names), :) = candidates%constants(:, numbers)
         rows(size(names) + 1:, :) = candidates%euler_deg(:, numbers)
      end associate
      call x%out%put('constants', names)
      call x%out%put_array('rows', rows, shape(rows))
      call x%out%put('warnings', stage%warnings)
   end subroutine look_ahead
end module stage_operations
