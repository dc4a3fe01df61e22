!> What every rival begins with: the stated model of the compared measurements. A rival is this
!> model with one thing changed.
module rival_cases
   use constants_posterior, only: new_posterior, posterior_type
   use error_models, only: error_model_type
   use errors, only: error_type, machine_failure
   use kinds, only: wp
   use measured_grains, only: measured_type
   use problem, only: problem_type
   use settings_schema, only: measurements_settings_type
   use statistics, only: median
   use surrogate_model, only: surrogate_type
   implicit none
   private
   public :: case_type, new_case, rival_type, set_up

   !> Measurements of more grains are compared on some of them, evenly over the rows, so that the
   !> time is bounded, and on as many at most that are far off.
   integer, parameter :: most_grains = 200, most_far = 50

   type :: case_type
      type(problem_type), pointer :: problem => null()
      type(surrogate_type), pointer :: surrogate => null()
      !> The stated model of the compared grains, which are these points of the problem.
      type(posterior_type) :: stated
      integer, allocatable :: points(:)
      !> Moduli that it predicts at its maximum, GPa, (row).
      real(wp), allocatable :: moduli(:, :)
      !> Standard deviations of the moduli there, from all sources, GPa, (point).
      real(wp), allocatable :: scales(:)
      !> The crystal at its maximum, GPa.
      real(wp) :: crystal(6, 6) = 0.0_wp
   end type case_type

   type :: rival_type
      !> What would have to be true, and the line of the namelist that states it, or ''.
      character(len=:), allocatable :: explanation, remedy
      !> Whether it has other data, settings or errors than the stated model.
      logical :: differs = .false.
      type(measured_type) :: data
      type(measurements_settings_type) :: settings
      !> In place of those that the settings define, if allocated.
      class(error_model_type), allocatable :: errors
      !> Unallocated if the rival makes no difference, or cannot be evaluated.
      type(posterior_type), allocatable :: posterior
      type(error_type), allocatable :: error
      !> Logarithm of the density of what the rival's posterior leaves out.
      real(wp) :: log_rest = 0.0_wp
   end type rival_type

contains

   !> The stated model of the compared grains, without speeds.
   subroutine new_case(problem, surrogate, posterior, residuals, case, error)
      type(problem_type), intent(in), target :: problem
      type(surrogate_type), intent(in), target :: surrogate
      type(posterior_type), intent(in) :: posterior
      !> Of the moduli, in their sds, (modulus).
      real(wp), intent(in) :: residuals(:)
      type(case_type), intent(out) :: case
      type(error_type), allocatable, intent(out) :: error
      !> A residual that a clean table of ten thousand grains does not have, in sds, or in those of
      !> a normal distribution with the median of the table.
      real(wp), parameter :: far = 5.0_wp, sd_over_median = 1.48_wp
      type(measured_type) :: measured
      integer, allocatable :: others(:)
      integer :: i, n

      case%problem => problem
      case%surrogate => surrogate
      n = min(most_grains, posterior%n_moduli)
      case%points = [(1 + ((i - 1)*posterior%n_moduli)/max(1, n), i=1, n)]
      others = pack([(i, i=1, posterior%n_moduli)], abs(residuals) &
         & > far*max(1.0_wp, sd_over_median*median(size(residuals), abs(residuals))))
      do i = 1, min(most_far, size(others))
         if (any(case%points == others(i))) cycle
         case%points = [case%points, others(i)]
      end do
      case%stated = posterior
      ! All models are compared with the same, cheaper theory.
      call case%stated%coarsen()
      if (size(case%points) == posterior%n_grains) return
      measured = posterior%data
      associate (points => case%points, all => posterior%data)
         measured%euler = all%euler(:, points)
         measured%tilt_sd = all%tilt_sd(points)
         measured%modulus = all%modulus(points)
         measured%sd = all%sd(points)
         measured%paths = all%paths(points)
         measured%group = all%group(points)
         measured%shared = all%shared(points, :)
      end associate
      call make_posterior(case, measured, posterior%settings, case%stated, error)
   end subroutine new_case

   !> Set the posterior of a rival that differs. A model that is refused is no rival.
   subroutine set_up(case, rival, error)
      type(case_type), intent(in) :: case
      type(rival_type), intent(inout) :: rival
      !> Of the machine.
      type(error_type), allocatable, intent(out) :: error

      if (rival%differs) then
         allocate (rival%posterior)
         call make_posterior(case, rival%data, rival%settings, rival%posterior, rival%error)
         if (allocated(rival%errors)) call move_alloc(rival%errors, rival%posterior%errors)
      end if
      if (.not. allocated(rival%error)) return
      if (allocated(rival%posterior)) deallocate (rival%posterior)
      if (rival%error%status == machine_failure) call move_alloc(rival%error, error)
   end subroutine set_up

   subroutine make_posterior(case, measured, settings, posterior, error)
      type(case_type), intent(in) :: case
      type(measured_type), intent(in) :: measured
      type(measurements_settings_type), intent(in) :: settings
      type(posterior_type), intent(inout) :: posterior
      type(error_type), allocatable, intent(out) :: error
      type(posterior_type) :: new

      call new_posterior(case%surrogate, case%stated%prior, settings, &
         & case%problem%settings%sampler%surrogate_variance == 'full', measured, new, error, &
         & case%stated)
      if (.not. allocated(error)) posterior = new
   end subroutine make_posterior

end module rival_cases
