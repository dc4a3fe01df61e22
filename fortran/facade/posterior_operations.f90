!> Posteriors of the constants: their density, chains of it, and what Step 2 finds.
module posterior_operations
   use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_value
   use abstract_basis, only: grain_model_type
   use abstract_sampler, only: sampler_type
   use constants_posterior, only: posterior_type
   use exchange, only: exchange_type
   use extraction, only: extract, extraction_type
   use extraction_document, only: write_extraction
   use extraction_values, only: put_extraction
   use kinds, only: degree, wp
   use next_grains, only: next_document
   use problem_posterior, only: new_problem_posterior
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   use warning_lists, only: warning_type
   implicit none
   private
   public :: new_posterior, use_posterior

contains

   !> By the `operation` the density of a problem and a surrogate, of its prior, or that of all of Step 2, with what that finds.
   subroutine new_posterior(operation, x)
      character(len=*), intent(in) :: operation
      type(exchange_type), intent(inout) :: x
      type(posterior_type), pointer :: density
      type(extraction_type) :: found

      allocate (density)
      call x%give(density, 'posterior')
      if (operation == 'posterior.extract') then
         call extract(x%problem, x%surrogate, found, x%error)
         if (allocated(x%error)) return
         density = found%posterior
         call put_extraction(x%problem, found, write_extraction(x%problem, found), x%out)
      else
         call new_problem_posterior(x%problem, x%surrogate, operation == 'posterior.prior', density, x%error)
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
      type(warning_type), allocatable :: warnings(:)
      real(wp), pointer :: points(:, :)

      if (x%in%has('points')) points => x%in%columns('points', density%dimension)
      select case (verb)
      case ('sample')
         call sample(density, x)
      case ('evaluate')
         ! Log density and log likelihood; minus infinity outside the support.
         allocate (x%values(size(points, 2), 2))
         call density%evaluate_parts(points, x%values(:, 1), x%values(:, 2))
         where (spread(.not. x%values(:, 1) > -huge(0.0_wp), 2, 2)) x%values = ieee_value(1.0_wp, ieee_negative_inf)
      case ('moduli')
         call draw_moduli(density, points, degree*x%in%columns('euler_deg', 3), x)
      case ('next')
         ! The points are draws, which have the factor on the sds as it is, not its logarithm.
         call next_document(x%problem, density, points, x%text, warnings, x%error)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_posterior

   !> Chains of a sampler.
   subroutine sample(density, x)
      type(posterior_type), intent(in) :: density
      type(exchange_type), intent(inout) :: x
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains

      call new_sampler(x%in%text('method'), x%in%integer('burn_in'), sampler, x%error)
      if (.not. allocated(x%error)) call sample_chains(density, sampler, run_settings_type(x%in%integer('samples'), &
         & x%in%integer('chains'), x%threads(), x%in%integer('seed')), chains, x%error)
      if (allocated(x%error)) return
      call x%out%put_array('draws', chains%draws, shape(chains%draws))
      call x%out%put_array('log_density', chains%log_density, shape(chains%log_density))
      call x%out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
   end subroutine sample

   !> At points the indentation moduli (GPa) of any grains (radians), with the surrogate's error drawn given the data, and one plus the
   !> calibration error of each group, drawn likewise.
   subroutine draw_moduli(density, points, euler, x)
      type(posterior_type), intent(in) :: density
      real(wp), intent(in) :: points(:, :), euler(:, :)
      type(exchange_type), intent(inout) :: x
      type(random_stream_type) :: stream
      class(grain_model_type), allocatable :: grains
      real(wp) :: moduli(size(euler, 2), size(points, 2)), factor(density%n_groups, size(points, 2))
      integer :: i

      call density%new_grains(euler, grains, x%error)
      if (allocated(x%error)) return
      stream = new_random_stream(x%in%integer('seed'), 0)
      do i = 1, size(points, 2)
         call density%draw_moduli(points(:, i), grains, stream, moduli(:, i), factor(:, i))
      end do
      call x%out%put_array('moduli', moduli, shape(moduli))
      call x%out%put_array('factor', factor, shape(factor))
   end subroutine draw_moduli
end module posterior_operations
