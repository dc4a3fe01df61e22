!> Operations on analyses: Step 2 of a problem with a surrogate.
module analysis_operations
   use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_value
   use abstract_basis, only: grain_model_type
   use abstract_sampler, only: sampler_type
   use analysis, only: analysis_type
   use analysis_document, only: put_analysis, write_analysis
   use crystal_elasticity, only: path_type
   use exchange, only: exchange_type
   use field_reading, only: choose_field_degree
   use further_measurements, only: suggest_measurements
   use json, only: json_type
   use kinds, only: degree, wp
   use planned_measurements, only: plan_measurements
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type, checkpoint_type, new_sampler, run_settings_type, sample_chains
   use shared_errors, only: add_shared
   use stage_documents, only: end_document
   implicit none
   private
   public :: use_analysis

contains

   subroutine use_analysis(verb, self, x)
      character(len=*), intent(in) :: verb
      type(analysis_type), intent(inout) :: self
      type(exchange_type), intent(inout), target :: x
      type(json_type) :: page
      real(wp), pointer :: points(:, :)

      if (verb == 'next') call self%prepare(x%error)
      if (allocated(x%error)) return
      if (x%in%has('points')) points => x%in%columns('points', self%posterior%dimension)
      select case (verb)
      case ('prepare')
         ! Set up the posterior, or the prior alone.
         call self%prepare(x%error)
         if (allocated(x%error)) return
         self%posterior%prior_only = x%in%logical('prior_only')
         call x%out%put('grains', self%posterior%n_grains)
         call x%out%put('groups', self%posterior%n_groups)
      case ('infer')
         call self%infer(x%error)
         if (allocated(x%error)) return
         call page%begin_object()
         call write_analysis(self, page)
         call put_analysis(self, end_document(page, [self%problem%warnings, self%warnings]), x%out)
      case ('next')
         ! The points are draws, which have the factor on the sds itself, not its logarithm.
         call page%begin_object()
         call suggest_measurements(self, points, page, x%error)
         x%text = end_document(page, [self%problem%warnings, self%warnings])
      case ('plan')
         call page%begin_object()
         call plan_measurements(self, page, x%error)
         x%text = end_document(page, self%problem%warnings)
      case ('sample')
         call sample()
      case ('evaluate')
         call evaluate()
      case ('read_theory')
         ! Read the theory from now on as finely as `infer` does for these points.
         call choose_field_degree(self%posterior, points, x%threads(), x%error)
      case ('moduli')
         call draw_moduli()
      case default
         call x%refuse(verb)
      end select

   contains

      !> Chains by any sampler.
      subroutine sample()
         type(sampler_type) :: sampler
         type(chains_type) :: chains
         type(run_settings_type) :: run

         call new_sampler(x%in%text('method'), x%in%integer('burn_in'), sampler, x%error)
         if (allocated(x%error)) return
         run = run_settings_type(x%in%integer('samples'), x%in%integer('chains'), x%threads(), &
            & x%in%integer('seed'))
         call sample_chains(self%posterior, sampler, run, chains, x%error, checkpoint_type())
         if (allocated(x%error)) return
         call x%out%put_array('draws', chains%draws, shape(chains%draws))
         call x%out%put_array('log_density', chains%log_density, shape(chains%log_density))
         call x%out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
      end subroutine sample

      !> Log density and log likelihood; minus infinity outside the support.
      subroutine evaluate()
         integer :: i

         allocate (x%values(size(points, 2), 2))
         associate (density => self%posterior)
            call density%evaluate(points, x%values(:, 1))
            do i = 1, size(points, 2)
               x%values(i, 2) = x%values(i, 1) - density%log_prior(density%stiffness(points(:, i)))
            end do
         end associate
         where (spread(.not. x%values(:, 1) > -huge(0.0_wp), 2, 2)) x%values = ieee_value(1.0_wp, &
            & ieee_negative_inf)
      end subroutine evaluate

      !> Indentation moduli (GPa) of any grains, with the surrogate's error drawn given the data,
      !> and one plus the calibration error of each group, drawn likewise.
      subroutine draw_moduli()
         type(random_stream_type) :: stream
         class(grain_model_type), allocatable :: grains
         type(path_type), allocatable :: paths(:)
         real(wp), allocatable :: factor(:, :)
         integer :: i

         allocate (paths(size(x%in%columns('euler_deg', 3), 2)))
         associate (density => self%posterior)
            call density%new_grains(degree*x%in%columns('euler_deg', 3), paths, grains, x%error)
            if (allocated(x%error)) return
            allocate (x%values(size(paths), size(points, 2)), &
               & factor(density%n_groups, size(points, 2)))
            stream = new_random_stream(x%in%integer('seed'), 0)
            do i = 1, size(points, 2)
               call grains%evaluate_crystals(reshape(density%stiffness(points(:, i)), [6, 6, 1]), &
                  & x%values(:, i:i))
               call add_shared(density, points(:, i), grains, stream, x%values(:, i), factor(:, i))
            end do
         end associate
         call x%out%put_array('factor', factor, shape(factor))
      end subroutine draw_moduli
   end subroutine use_analysis
end module analysis_operations
