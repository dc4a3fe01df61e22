!> Stages, see `abstract_stage`: what is to be simulated goes out, what became of it comes in.
module stage_operations
   use abstract_stage, only: stage_type
   use build_stage, only: build_stage_type
   use exchange, only: exchange_type
   use settings_output, only: settings_namelist
   use simulate, only: outcome_type
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
      type(outcome_type) :: outcome
      type(warning_type) :: physics(size(stage%physics))
      integer, allocatable :: numbers(:)
      integer :: i

      select case (verb)
      case ('want')
         ! What is to be simulated now: numbers, stiffness (GPa, crystal axes), angles (degrees), and of each the number from 0 of its
         ! `physics`, the groups of a namelist.
         call stage%want(x%error)
         if (allocated(x%error)) return
         associate (jobs => stage%jobs)
            do i = 1, size(physics)
               physics(i)%text = ''
               if (any(jobs%physics == i)) physics(i)%text = settings_namelist(stage%physics(i), &
                  & 'specimen indenter simulation', .true.)
            end do
            call x%out%put('physics', physics)
            call x%out%put_integers('physics_number', jobs%physics - 1, shape(jobs))
            call x%out%put_integers('number', jobs%number, shape(jobs))
            call x%out%put_array('stiffness', [(jobs(i)%stiffness, i=1, size(jobs))], [6, 6, size(jobs)])
            call x%out%put_array('euler_deg', [(jobs(i)%euler_deg, i=1, size(jobs))], [3, size(jobs)])
         end associate
      case ('take')
         outcome%status = x%in%integer('status')
         outcome%modulus = x%in%real('modulus_gpa')
         outcome%seconds = x%in%real('seconds')
         outcome%elements = x%in%integer('elements')
         outcome%depth = x%in%reals('depth_um')
         outcome%force = x%in%reals('force_mn')
         outcome%message = x%in%text('message')
         call stage%take(x%in%integer('number'), outcome, x%error)
      case ('leave')
         call stage%leave(x%error)
      case ('close')
         call stage%close(x%text, x%error)
      case ('look_ahead')
         ! Of a build the next candidates: names of constants, and rows of these (GPa) and of angles (degrees).
         select type (stage)
         type is (build_stage_type)
            call stage%look_ahead(x%in%integer('count'), numbers, x%error)
            if (allocated(x%error)) return
            call x%out%put('constants', stage%learning%learner%basis%domain%class%constants)
            associate (given => stage%candidates)
               x%values = reshape([(given%constants(:, numbers(i)), given%euler_deg(:, numbers(i)), i=1, size(numbers))], &
                  & [size(given%constants, 1) + 3, size(numbers)])
            end associate
            call x%out%put('warnings', stage%warnings)
         end select
      case default
         call x%refuse(verb)
      end select
   end subroutine use_stage
end module stage_operations
