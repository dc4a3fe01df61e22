!> Posteriors of the constants: their density, chains of it, and what Step 2 finds.
module posterior_operations
   use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_value
   use abstract_basis, only: grain_model_type
   use abstract_sampler, only: sampler_type
   use constants_posterior, only: posterior_type
   use exchange, only: exchange_type
   use extraction, only: extract, extraction_type
   use extraction_document, only: write_extraction
   use posterior_file, only: put_extraction
   use kinds, only: degree, wp
   use next_grains, only: next_document
   use problem_posterior, only: new_problem_posterior
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   use surrogate_model, only: surrogate_type
   use warning_lists, only: warning_type
   implicit none
   private
   public :: new_posterior, use_posterior

contains

   !> Of the problem and a surrogate: the density ('density'), that of its prior ('prior'), or all of Step 2 ('extract').
   subroutine new_posterior(verb, surrogate, x)
      character(len=*), intent(in) :: verb
      type(surrogate_type), intent(in) :: surrogate
      type(exchange_type), intent(inout) :: x
      type(posterior_type), pointer :: density
      type(extraction_type) :: found

      allocate (density)
      call x%give(density, 'posterior')
      if (verb == 'extract') then
         call extract(x%problem, surrogate, found, x%error)
         if (allocated(x%error)) return
         density = found%posterior
         call put_extraction(x%problem, found, write_extraction(x%problem, found), x%out)
      else
         call new_problem_posterior(x%problem, surrogate, verb == 'prior', density, x%error)
         if (allocated(x%error)) return
      end if
      call x%out%put('dimension', density%dimension)
      call x%out%put('grains', density%n_grains)
      call x%out%put('groups', density%n_groups)
      call x%out%put('share_inside', density%prior%share_inside)
      call x%out%put_array('lower', density%prior%lower, shape(density%prior%lower))
      call x%out%put_array('upper', density%prior%upper, shape(density%prior%upper))
   end subroutine new_posterior

   subroutine use_posterior(verb, density, x)
      character(len=*), intent(in) :: verb
      type(posterior_type), intent(inout) :: density
      type(exchange_type), intent(inout) :: x
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains
      type(random_stream_type) :: stream
      class(grain_model_type), allocatable :: grains
      type(warning_type), allocatable :: warnings(:)
      real(wp), pointer :: points(:, :)
      real(wp), allocatable :: factor(:, :)
      integer :: i

      if (x%in%has('points')) points => x%in%columns('points', density%dimension)
      select case (verb)
      case ('sample')
         call new_sampler(x%in%text('method'), x%in%integer('burn_in'), sampler, x%error)
         if (.not. allocated(x%error)) call sample_chains(density, sampler, run_settings_type(x%in%integer('samples'), &
            & x%in%integer('chains'), x%threads(), x%in%integer('seed')), chains, x%error)
         if (allocated(x%error)) return
         call x%out%put_array('draws', chains%draws, shape(chains%draws))
         call x%out%put_array('log_density', chains%log_density, shape(chains%log_density))
         call x%out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
      case ('evaluate')
         ! Log density and log likelihood; minus infinity outside the support.
         allocate (x%values(size(points, 2), 2))
         call density%evaluate_parts(points, x%values(:, 1), x%values(:, 2))
         where (spread(.not. x%values(:, 1) > -huge(0.0_wp), 2, 2)) x%values = ieee_value(1.0_wp, ieee_negative_inf)
      case ('moduli')
         ! Indentation moduli (GPa) of any grains, with the surrogate's error drawn given the data, and one plus the calibration error of
         ! each group, drawn likewise.
         call density%new_grains(degree*x%in%columns('euler_deg', 3), grains, x%error)
         if (allocated(x%error)) return
         allocate (x%values(size(x%in%columns('euler_deg', 3), 2), size(points, 2)), factor(density%n_groups, size(points, 2)))
         stream = new_random_stream(x%in%integer('seed'), 0)
         do i = 1, size(points, 2)
            call density%draw_moduli(points(:, i), grains, stream, x%values(:, i), factor(:, i))
         end do
         call x%out%put_array('factor', factor, shape(factor))
      case ('next')
         ! The points are draws, which have the factor on the sds as it is, not its logarithm.
         call next_document(x%problem, density, points, x%text, warnings, x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_posterior
end module posterior_operations
