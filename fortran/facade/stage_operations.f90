!> Stages, see `abstract_stage`: what is to be simulated goes out, what became of it comes in.
module stage_operations
   use abstract_stage, only: stage_type
   use build_stage, only: build_stage_type
   use exchange, only: exchange_type
   use kinds, only: wp
   use settings_lists, only: settings_namelist
   use simulate, only: outcome_done, outcome_failed, outcome_type
   use warning_lists, only: warning_type
   implicit none
   private
   public :: held_stage_type, use_stage

   type :: held_stage_type
      class(stage_type), allocatable :: stage
   end type held_stage_type

contains

   subroutine use_stage(verb, stage, x)
      character(len=*), intent(in) :: verb
      class(stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x

      select case (verb)
      case ('want')
         call stage%want(x%error)
         if (.not. allocated(x%error)) call put_jobs(stage, x)
      case ('take')
         call take(stage, x)
      case ('leave')
         call stage%leave(x%error)
      case ('close')
         call stage%close(x%text, x%error)
      case ('look_ahead')
         select type (stage)
         type is (build_stage_type)
            call look_ahead(stage, x)
         end select
      case default
         call x%refuse(verb)
      end select
   end subroutine use_stage

   !> What is to be simulated now: numbers, stiffness (GPa, crystal axes), angles (degrees), and of each the number from 0 of its
   !> `physics`, the groups of a namelist.
   subroutine put_jobs(stage, x)
      class(stage_type), intent(in) :: stage
      type(exchange_type), intent(inout) :: x
      type(warning_type) :: physics(size(stage%physics))
      integer :: i

      associate (jobs => stage%jobs)
         do i = 1, size(physics)
            physics(i)%text = ''
            if (any(jobs%physics == i)) physics(i)%text = settings_namelist(stage%physics(i), 'specimen indenter simulation', &
               & .true.)
         end do
         call x%out%put('physics', physics)
         call x%out%put_integers('physics_number', jobs%physics - 1, shape(jobs))
         call x%out%put_integers('number', jobs%number, shape(jobs))
         call x%out%put_array('stiffness', [(jobs(i)%stiffness, i=1, size(jobs))], [6, 6, size(jobs)])
         call x%out%put_array('euler_deg', [(jobs(i)%euler_deg, i=1, size(jobs))], [3, size(jobs)])
      end associate
   end subroutine put_jobs

   !> What became of a simulation: its modulus (GPa), or the reason why there is none; `machine`: the machine could not make it.
   subroutine take(stage, x)
      class(stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x
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
         outcome%elements = x%in%integer('elements')
         outcome%depth = x%in%reals('depth_um')
         outcome%force = x%in%reals('force_mn')
      end if
      call stage%take(x%in%integer('number'), outcome, x%error)
   end subroutine take

   !> The next candidates: names of constants, and rows of these (GPa) and of angles (degrees).
   subroutine look_ahead(stage, x)
      type(build_stage_type), intent(inout) :: stage
      type(exchange_type), intent(inout) :: x
      integer, allocatable :: numbers(:)
      integer :: i

      call stage%look_ahead(x%in%integer('count'), numbers, x%error)
      if (allocated(x%error)) return
      call x%out%put('constants', stage%build%learning%learner%basis%domain%class%constants)
      associate (candidates => stage%build%candidates)
         x%values = reshape([(candidates%constants(:, numbers(i)), candidates%euler_deg(:, numbers(i)), i=1, size(numbers))], &
            & [size(candidates%constants, 1) + 3, size(numbers)])
      end associate
      call x%out%put('warnings', stage%build%warnings)
   end subroutine look_ahead
end module stage_operations
