!> Parameters of a posterior beside the constants. Each is the logarithm of a positive number, with
!> a prior of its own.
module nuisances
   use kinds, only: pi, wp
   use random, only: random_stream_type
   use settings_schema, only: measurements_settings_type
   implicit none
   private
   public :: nuisance_type, new_nuisances, log_prior_of, draw_nuisances

   type :: nuisance_type
      !> Of the number itself, as the results have it.
      character(len=9) :: name = ''
      !> Mean and sd of a normal prior of the logarithm; or its bounds, between which it is uniform.
      real(wp) :: prior(2) = 0.0_wp
      logical :: is_normal = .true.
   end type nuisance_type

   !> Bounds of the common factor on the sds.
   real(wp), parameter :: factor_bounds(2) = [0.05_wp, 50.0_wp]
   !> The sd of the logarithm of the scatter of grains.
   real(wp), parameter :: log_scatter_sd = log(3.0_wp)

contains

   !> What is inferred beside the constants: the contrast of the laboratory, the scatter of grains,
   !> and a common factor on the sds, in this order.
   pure function new_nuisances(settings, contrast) result(nuisances)
      type(measurements_settings_type), intent(in) :: settings
      !> Mean and sd of the logarithm of the contrast.
      real(wp), intent(in) :: contrast(2)
      type(nuisance_type), allocatable :: nuisances(:)
      real(wp) :: scatter(2)

      scatter = [log(max(settings%scatter_sd, tiny(1.0_wp))), log_scatter_sd]
      nuisances = pack([nuisance_type('contrast', contrast), nuisance_type('scatter', scatter), &
         & nuisance_type('sd_factor', log(factor_bounds), .false.)], &
         & [contrast(2) > 0.0_wp, settings%scatter == 'inferred', settings%scale == 'inferred'])
   end function new_nuisances

   !> Logarithm of the prior density of all nuisances, up to a constant.
   pure real(wp) function log_prior_of(nuisances, x, outside) result(log_density)
      type(nuisance_type), intent(in) :: nuisances(:)
      !> Logarithms, (nuisance), and the value outside the support.
      real(wp), intent(in) :: x(:), outside
      integer :: i

      log_density = 0.0_wp
      do i = 1, size(nuisances)
         associate (prior => nuisances(i)%prior)
            if (nuisances(i)%is_normal) then
               log_density = log_density - 0.5_wp*((x(i) - prior(1))/prior(2))**2 &
                  & - log(prior(2)*sqrt(2.0_wp*pi))
            else if (x(i) < prior(1) .or. x(i) > prior(2)) then
               log_density = outside
               return
            end if
         end associate
      end do
   end function log_prior_of

   !> Draw nuisances from their priors.
   subroutine draw_nuisances(nuisances, stream, x)
      type(nuisance_type), intent(in) :: nuisances(:)
      type(random_stream_type), intent(inout) :: stream
      !> Logarithms, (nuisance).
      real(wp), intent(out) :: x(:)
      integer :: i

      do i = 1, size(nuisances)
         associate (prior => nuisances(i)%prior)
            if (nuisances(i)%is_normal) then
               call stream%normal(x(i))
               x(i) = prior(1) + prior(2)*x(i)
            else
               call stream%uniform(x(i))
               x(i) = prior(1) + x(i)*(prior(2) - prior(1))
            end if
         end associate
      end do
   end subroutine draw_nuisances
end module nuisances
