!> Posteriors of the constants: their density, chains of it, and what Step 2 finds.
module posterior_operations
   use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_value
   use abstract_basis, only: grain_model_type
   use abstract_sampler, only: sampler_type
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use exchange, only: exchange_type
   use extraction, only: extract, extraction_type
   use extraction_document, only: write_extraction
   use posterior_file, only: put_extraction
   use interruption, only: listen, stop_listening
   use kinds, only: degree, wp
   use next_grains, only: next_document
   use problem, only: problem_type
   use problem_posterior, only: new_problem_posterior
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   use surrogate_model, only: surrogate_type
   use warning_lists, only: warning_type
   implicit none
   private
   public :: perform_posterior

contains

   subroutine perform_posterior(verb, object, x, error)
      character(len=*), intent(in) :: verb
      !> A density; not associated: one is to be made, or a problem's Step 2 done.
      class(*), pointer, intent(in) :: object
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: problem
      type(surrogate_type), pointer :: surrogate
      type(posterior_type), pointer :: density
      class(*), pointer :: made

      call listen()
      if (associated(object)) then
         select type (object)
         type is (posterior_type)
            call use_posterior(verb, object, x, error)
         end select
      else
         problem => x%problem(error)
         if (.not. allocated(error)) surrogate => x%surrogate(error)
         if (.not. allocated(error)) then
            allocate (density)
            call x%give(density, 'posterior')
            select case (verb)
            case ('extract')
               call infer(problem, surrogate, density, x, error)
            case ('density', 'prior')
               call new_problem_posterior(problem, surrogate, verb == 'prior', density, error)
            case default
               call x%refuse(verb, error)
            end select
            if (.not. allocated(error)) call describe(density, x)
         end if
      end if
      call stop_listening()
   end subroutine perform_posterior

   !> All of Step 2.
   subroutine infer(problem, surrogate, density, x, error)
      type(problem_type), intent(in) :: problem
      type(surrogate_type), intent(in) :: surrogate
      type(posterior_type), intent(inout) :: density
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(extraction_type) :: found

      call extract(problem, surrogate, found, error)
      if (allocated(error)) return
      density = found%posterior
      call put_extraction(problem, found, write_extraction(problem, found), x%out)
   end subroutine infer

   subroutine describe(density, x)
      type(posterior_type), intent(in) :: density
      type(exchange_type), intent(inout) :: x

      call x%out%put('dimension', density%dimension)
      call x%out%put('grains', density%n_grains)
      call x%out%put('groups', density%n_groups)
      call x%out%put('share_inside', density%prior%share_inside)
      call x%out%put_array('lower', density%prior%lower, shape(density%prior%lower))
      call x%out%put_array('upper', density%prior%upper, shape(density%prior%upper))
   end subroutine describe

   subroutine use_posterior(verb, density, x, error)
      character(len=*), intent(in) :: verb
      type(posterior_type), intent(inout) :: density
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: problem
      type(warning_type), allocatable :: warnings(:)
      character(len=:), allocatable :: document

      select case (verb)
      case ('sample')
         call sample(density, x, error)
      case ('evaluate')
         call evaluate(density, x%in%columns('points', density%dimension), x)
      case ('moduli')
         call draw_moduli(density, x%in%columns('points', density%dimension), degree*x%in%columns('euler_deg', 3), x, error)
      case ('next')
         ! The draws have the factor on the sds as it is, not its logarithm.
         problem => x%problem(error)
         if (.not. allocated(error)) call next_document(problem, density, x%in%columns('draws', density%dimension), document, &
            & warnings, error)
         if (.not. allocated(error)) call x%out%put('document', document)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine use_posterior

   !> Chains of a sampler.
   subroutine sample(density, x, error)
      type(posterior_type), intent(in) :: density
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains

      call new_sampler(x%in%text('method'), int(x%in%integer('burn_in')), sampler, error)
      if (.not. allocated(error)) call sample_chains(density, sampler, run_settings_type(int(x%in%integer('samples')), &
         & int(x%in%integer('chains')), x%threads(), int(x%in%integer('seed'))), chains, error)
      if (allocated(error)) return
      call x%out%put_array('draws', chains%draws, shape(chains%draws))
      call x%out%put_array('log_density', chains%log_density, shape(chains%log_density))
      call x%out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
   end subroutine sample

   !> Log density and log likelihood at points; minus infinity outside the support.
   subroutine evaluate(density, points, x)
      type(posterior_type), intent(in) :: density
      real(wp), intent(in) :: points(:, :)
      type(exchange_type), intent(inout) :: x
      real(wp) :: values(size(points, 2), 2)

      call density%evaluate_parts(points, values(:, 1), values(:, 2))
      where (spread(.not. values(:, 1) > -huge(values), 2, 2)) values = ieee_value(1.0_wp, ieee_negative_inf)
      call x%out%put_array('values', values, shape(values))
   end subroutine evaluate

   !> At points the indentation moduli (GPa) of any grains (radians), with the surrogate's error drawn given the data, and one plus the
   !> calibration error of each group, drawn likewise.
   subroutine draw_moduli(density, points, euler, x, error)
      type(posterior_type), intent(in) :: density
      real(wp), intent(in) :: points(:, :), euler(:, :)
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(random_stream_type) :: stream
      class(grain_model_type), allocatable :: grains
      real(wp) :: moduli(size(euler, 2), size(points, 2)), factor(density%n_groups, size(points, 2))
      integer :: i

      call density%new_grains(euler, grains, error)
      if (allocated(error)) return
      stream = new_random_stream(int(x%in%integer('seed')), 0)
      do i = 1, size(points, 2)
         call density%draw_moduli(points(:, i), grains, stream, moduli(:, i), factor(:, i))
      end do
      call x%out%put_array('moduli', moduli, shape(moduli))
      call x%out%put_array('factor', factor, shape(factor))
   end subroutine draw_moduli
end module posterior_operations
