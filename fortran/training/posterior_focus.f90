!> Training of a surrogate at the posterior of the measurements: the candidates for the next
!> simulations, the domain that contains them, and whether the surrogate is accurate enough there.
!>
!> The posterior is sampled with the present surrogate, including its uncertainty, over a wider
!> domain than that of its training. The choice of simulations there does not bias the surrogate:
!> given the model, a choice that depends only on the data is ignorable.
module posterior_focus
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: logarithmic_mean
   use sequential_design, only: candidates_type
   use errors, only: error_type
   use kinds, only: degree, wp
   use problem, only: problem_type
   use detected_speeds, only: draw_aside
   use problem_posterior, only: focus_run, new_table_posterior
   use prior_limits, only: is_truncated, list_limits
   use random, only: new_random_stream, random_stream_type
   use settings_schema, only: measurements_settings_type
   use shared_errors, only: infer_shared
   use small_matrices, only: factor_definite, solve_lower
   use surrogate_domain, only: domain_type
   use surrogate_model, only: new_theory_surrogate, predict_crystals, surrogate_type
   use variance_shares, only: find_shares, from_surrogate, shares_type
   implicit none
   private
   public :: focus_type, has_focus, check_focus, find_focus, is_accurate
   public :: extend

   !> Number of simulations over the domain before the first round; in each round, number of those
   !> at the posterior by the theory alone, and of all.
   integer, parameter, public :: simulations_before = 15, tempered = 2, round_size = 7
   !> A surrogate is accurate if its share of the variance of each constant, and the change that its
   !> errors may make, are at most the first, and the root mean square of (simulated - predicted)/sd
   !> of new simulations is at most the second.
   real(wp), parameter, public :: accurate_share = 0.10_wp, accurate_z = 1.5_wp

   !> The accuracy at the beginning of a round.
   type :: round_type
      integer :: simulations = 0
      !> Share of the surrogate in the variance of each constant, or the relative change of the
      !> variance that its errors may make if that is more, (n_constants).
      real(wp), allocatable :: share(:)
      !> Root mean square of (simulated - predicted)/sd over the crystals of the posterior in the
      !> previous round; below 0: there is none.
      real(wp) :: z = -1.0_wp
      !> Whether a limit of the surrogate's domain truncates the posterior.
      logical :: truncated = .false.
   end type round_type

   type :: focus_type
      !> Contains all candidates.
      type(domain_type) :: domain
      !> The surrogate with which the posterior was sampled.
      type(surrogate_type) :: surrogate
      !> The last one is the present round.
      type(round_type), allocatable :: rounds(:)
      !> Crystals of the posterior by the theory alone; stiffnesses, GPa, (6, 6, n).
      real(wp), allocatable, private :: theory_crystals(:, :, :)
   end type focus_type

   !> Relative sds of the errors of the half-space theory for another specimen: of an error that all
   !> grains share, and of one of each grain.
   real(wp), parameter :: common_error = 0.2_wp, grain_error = 0.03_wp
   !> Number of candidates that are crystals of the posterior.
   integer, parameter :: n_candidates = 400
   !> Extension of the domain for sampling: factors on the log-anisotropy and on the scale, and the
   !> part of the distance of Poisson's ratio from its limits.
   real(wp), parameter :: wider = 1.25_wp, wider_scale = 2.0_wp, wider_poisson = 0.5_wp
   !> Margin of the domain beyond the outermost draw, as a part of the range of the draws.
   real(wp), parameter :: margin = 0.1_wp

contains

   !> Whether a problem's simulations are chosen at the posterior: `focus` asks for it, measurements
   !> of known orientations exist, and the surrogate is a correction.
   pure logical function has_focus(problem)
      type(problem_type), intent(in) :: problem

      has_focus = problem%settings%design%focus == 'posterior' &
         & .and. problem%settings%surrogate%model == 'correction' &
         & .and. allocated(problem%data%measurements) &
         & .and. problem%settings%measurements%orientations == 'known'
   end function has_focus

   !> Refuse a problem that Step 2 would refuse.
   subroutine check_focus(problem, error)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: theory
      type(posterior_type) :: posterior

      call new_theory_surrogate(theory)
      call new_table_posterior(problem, problem%settings%measurements, problem%data%measurements, &
         & theory, posterior, error)
   end subroutine check_focus

   !> Begin a round.
   subroutine find_focus(problem, surrogate, candidates, focus, error)
      type(problem_type), intent(in) :: problem
      !> Trained on all simulations so far.
      type(surrogate_type), intent(in) :: surrogate
      !> On entry, the candidates of these simulations. On return, the first `tempered` crystals are
      !> of the posterior by the theory alone, whose errors may be large. The others are of the
      !> posterior. The directions are those of the grains.
      type(candidates_type), intent(inout) :: candidates
      !> On entry, the previous round.
      type(focus_type), intent(inout) :: focus
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: wide
      type(posterior_type) :: posterior
      type(round_type) :: round
      real(wp), allocatable :: draws(:, :), crystals(:, :, :)
      type(shares_type), allocatable :: shares(:)
      integer :: i, threads

      threads = problem%threads()
      if (.not. allocated(focus%theory_crystals)) then
         call draw_by_theory()
         if (allocated(error)) return
      end if
      round%simulations = size(surrogate%simulations%modulus)
      call check_predictions()
      wide = surrogate
      call drop_bounds(wide%basis%domain, &
         & surrogate%basis%domain%class%stiffnesses(candidates%constants))
      focus%domain = wide%basis%domain
      ! The posterior is sampled in a wider domain.
      associate (domain => wide%basis%domain)
         domain%log_anisotropy_max = wider*domain%log_anisotropy_max
         domain%poisson = domain%poisson + wider_poisson*([-1.0_wp, 0.5_wp] - domain%poisson)
         if (domain%has_scale()) then
            domain%stiffness = domain%stiffness*[1.0_wp/wider_scale, wider_scale]
         end if
      end associate
      call draw_aside(problem, problem%settings%measurements, wide, focus_run, posterior, draws, &
         & error)
      if (allocated(error)) return
      call find_shares(posterior, draws, draws(:posterior%n_constants, :), &
         & real(size(draws, 2), wp), threads, shares, error)
      if (allocated(error)) return
      round%share = [(shares(i)%by_source(from_surrogate), i=1, size(shares))]
      ! The share of the variance is a mean over all draws. The surrogate may be wrong in their
      ! tails although it is small.
      round%share = max(round%share, &
         & changes_of_variance(posterior, draws, size(shares), threads))
      round%truncated = is_truncated(list_limits(posterior%prior, draws))
      crystals = problem%class%stiffnesses(draws)
      call extend(focus%domain, crystals)
      ! Each round has other crystals of the theory.
      associate (stride => size(focus%theory_crystals, 3)/tempered)
         i = 1 + modulo(round%simulations, stride)
         associate (by_theory => focus%theory_crystals(:, :, i::stride), &
            & at_posterior => crystals(:, :, select_draws(draws(:posterior%n_constants, :))))
            call make_candidates(reshape([by_theory, at_posterior], &
               & [6, 6, size(by_theory, 3) + size(at_posterior, 3)]))
         end associate
      end associate
      focus%surrogate = surrogate
      focus%rounds = [focus%rounds, round]

   contains

      !> Draw crystals of the posterior by the half-space theory with errors for another specimen.
      subroutine draw_by_theory()
         type(measurements_settings_type) :: loose
         type(surrogate_type) :: theory

         loose = problem%settings%measurements
         loose%calibration_sd = max(common_error, loose%calibration_sd)
         loose%scatter_sd = max(grain_error, loose%scatter_sd)
         call new_theory_surrogate(theory)
         call draw_aside(problem, loose, theory, focus_run, posterior, draws, error)
         if (allocated(error)) return
         focus%theory_crystals = problem%class%stiffnesses(draws)
      end subroutine draw_by_theory

      !> Set the candidates: each crystal in the direction of one grain, in turn.
      subroutine make_candidates(stiffness)
         !> GPa, (6, 6, n).
         real(wp), intent(in) :: stiffness(:, :, :)
         integer :: n

         n = size(stiffness, 3)
         candidates%constants = &
            & reshape([(focus%domain%class%constants_of(stiffness(:, :, i)), i=1, n)], &
            & [focus%domain%class%n_constants, n])
         candidates%euler_deg = problem%data%measurements%euler_deg(:, &
            & [(modulo(i, problem%data%measurements%n) + 1, i=0, n - 1)])
      end subroutine make_candidates

      !> Set the root mean square of (simulated - predicted)/sd, with the surrogate of the previous
      !> round, over the later simulations without those of the theory alone, if there are any.
      subroutine check_predictions()
         real(wp), dimension(size(surrogate%simulations%modulus)) :: mean, sd
         type(error_type), allocatable :: failure
         integer :: first

         if (size(focus%rounds) == 0) return
         first = focus%rounds(size(focus%rounds))%simulations + tempered + 1
         if (first > size(mean)) return
         associate (known => surrogate%simulations)
            call predict_crystals(focus%surrogate, &
               & surrogate%basis%domain%class%stiffnesses(known%constants(:, first:)), &
               & degree*known%euler_deg(:, first:), 1, mean(first:), sd(first:), failure)
            if (.not. allocated(failure)) then
               round%z = norm2((known%modulus(first:) - mean(first:))/sd(first:)) &
                  & /sqrt(real(size(mean) - first + 1, wp))
            end if
         end associate
      end subroutine check_predictions
   end subroutine find_focus

   !> Relative change of the variance of each constant that a better surrogate is likely to make:
   !> root mean square over surrogates that are drawn given simulations and measurements, or the
   !> change if this one were exact, if that is more. The weight of a draw of the posterior is the
   !> density of the drawn surrogate's errors there, given the data.
   function changes_of_variance(posterior, draws, n_constants, threads) result(change)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> Number of constants, the first parameters.
      integer, intent(in) :: n_constants
      integer, intent(in) :: threads
      real(wp) :: change(n_constants)
      integer, parameter :: n_surrogates = 30
      !> Errors of the surrogates, in sds, and weights of the draws; surrogate 0 is exact.
      real(wp) :: errors(posterior%grains%n_columns, 0:n_surrogates), &
         & weight(size(draws, 2), 0:n_surrogates)
      real(wp) :: z(size(errors, 1)), mean(size(errors, 1)), &
         & factor(size(errors, 1), size(errors, 1))
      real(wp) :: relative(n_constants, 0:n_surrogates)
      type(random_stream_type) :: stream
      integer :: i, j, k

      stream = new_random_stream(1, 0)
      errors = 0.0_wp
      do j = 1, n_surrogates
         call errors_at(draws(:, 1 + (j - 1)*size(draws, 2)/n_surrogates), mean, factor)
         call stream%normals(z)
         errors(:, j) = mean + [(sum(factor(i, :i)*z(:i)), i=1, size(z))]
      end do
      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic) private(mean, factor, z, &
      !$omp & j, k)
      do i = 1, size(draws, 2)
         call errors_at(draws(:, i), mean, factor)
         do j = 0, n_surrogates
            z = errors(:, j) - mean
            call solve_lower(factor, z)
            weight(i, j) = -0.5_wp*sum(z**2) - sum([(log(factor(k, k)), k=1, size(z))])
         end do
      end do
      !$omp end parallel do
      do j = 0, n_surrogates
         weight(:, j) = exp(weight(:, j) - maxval(weight(:, j)))
         weight(:, j) = weight(:, j)/sum(weight(:, j))
         do i = 1, n_constants
            associate (x => draws(i, :) - sum(draws(i, :))/size(draws, 2))
               ! The variance of a fixed constant is rounding.
               relative(i, j) = (size(x)*(sum(weight(:, j)*x**2) - sum(weight(:, j)*x)**2) &
                  & - sum(x**2))/max(sum(x**2), size(x)*(1.0e-9_wp*maxval(abs(draws(i, :))))**2)
            end associate
         end do
      end do
      change = max(abs(relative(:, 0)), norm2(relative(:, 1:), 2)/sqrt(real(n_surrogates, wp)))

   contains

      !> Mean and lower factor of the covariance of the surrogate's errors at a point, given the
      !> data.
      pure subroutine errors_at(x, mean, factor)
         real(wp), intent(in) :: x(:)
         real(wp), intent(out) :: mean(:), factor(:, :)
         real(wp) :: inverse(posterior%n_shared, posterior%n_shared)
         real(wp), allocatable :: all_means(:), precision(:, :)
         integer :: i

         call infer_shared(posterior, x, all_means, precision)
         mean = all_means(:size(mean))
         inverse = 0.0_wp
         do i = 1, size(mean)
            inverse(i, i) = 1.0_wp
            call solve_lower(precision, inverse(:, i))
         end do
         factor = matmul(transpose(inverse(:, :size(mean))), inverse(:, :size(mean)))
         call factor_definite(factor, epsilon(1.0_wp))
      end subroutine errors_at
   end function changes_of_variance

   !> Numbers of the draws that are candidates: half of them evenly over the draws, half in
   !> proportion to the squared deviations, which are large in the tails.
   function select_draws(draws) result(numbers)
      !> (constant, draw).
      real(wp), intent(in) :: draws(:, :)
      integer :: numbers(n_candidates), i, j
      real(wp) :: squares(size(draws, 1), size(draws, 2)), weight(size(draws, 2)), total

      squares = (draws - spread(sum(draws, 2)/size(draws, 2), 2, size(draws, 2)))**2
      ! The mean weight is one.
      weight = 0.5_wp + 0.5_wp*size(draws, 2)/size(draws, &
         & 1)*matmul(1.0_wp/max(tiny(1.0_wp), sum(squares, 2)), squares)
      j = 0
      total = 0.0_wp
      do i = 1, n_candidates
         do while (total < (i - 0.5_wp)*size(draws, 2)/n_candidates .and. j < size(draws, 2))
            j = j + 1
            total = total + weight(j)
         end do
         numbers(i) = j
      end do
   end function select_draws

   !> Whether the surrogate at the beginning of the round is accurate. The round is then not needed.
   pure logical function is_accurate(focus)
      type(focus_type), intent(in) :: focus

      associate (round => focus%rounds(size(focus%rounds)))
         is_accurate = all(round%share <= accurate_share) .and. round%z >= 0.0_wp &
            & .and. round%z <= accurate_z .and. .not. round%truncated
      end associate
   end function is_accurate

   !> Replace bounds of the constants, if a domain has them, by limits of log-anisotropy, Poisson's
   !> ratio and scale.
   pure subroutine drop_bounds(domain, stiffness)
      type(domain_type), intent(inout) :: domain
      !> Crystals that sample the domain, GPa, (6, 6, n).
      real(wp), intent(in) :: stiffness(:, :, :)

      if (size(domain%lower) == 0) return
      deallocate (domain%lower, domain%upper)
      allocate (domain%lower(0), domain%upper(0))
      domain%anisotropy_cap = huge(1.0_wp)
      domain%log_anisotropy_max = 0.0_wp
      domain%poisson = [0.5_wp, -1.0_wp]
      call extend(domain, stiffness)
   end subroutine drop_bounds

   !> Extend a domain so that it contains crystals with a margin on each side.
   pure subroutine extend(domain, stiffness)
      type(domain_type), intent(inout) :: domain
      !> GPa, (6, 6, n).
      real(wp), intent(in) :: stiffness(:, :, :)
      real(wp), dimension(size(stiffness, 3)) :: poisson, anisotropy, scale
      real(wp) :: range(2)
      integer :: i

      do i = 1, size(scale)
         call logarithmic_mean(stiffness(:, :, i), poisson(i), anisotropy(i), scale(i))
      end do
      domain%log_anisotropy_max = max(domain%log_anisotropy_max, maxval(with_margin(anisotropy)))
      ! The margin is in the contrast, log(3K/2G), which has no limits.
      range = exp(with_margin(log((1.0_wp + poisson)/(1.0_wp - 2.0_wp*poisson))))
      range = (range - 1.0_wp)/(2.0_wp*range + 1.0_wp)
      domain%poisson = [min(domain%poisson(1), range(1)), max(domain%poisson(2), range(2))]
      range = exp(with_margin(log(scale)))
      if (domain%has_scale()) then
         domain%stiffness = [min(domain%stiffness(1), range(1)), max(domain%stiffness(2), range(2))]
      end if
   end subroutine extend

   !> The range of values, with a margin.
   pure function with_margin(values) result(range)
      real(wp), intent(in) :: values(:)
      real(wp) :: range(2)

      range = [minval(values), maxval(values)]
      range = range + margin*(range(2) - range(1))*[-1.0_wp, 1.0_wp]
   end function with_margin

end module posterior_focus
