!> Simulations where the posterior of the measurements is: the crystals that the next ones of a
!> surrogate are chosen from, the domain that holds them, and whether the surrogate is accurate
!> enough there.
!>
!> The posterior is sampled with the present surrogate, its uncertainty included, and over a wider
!> domain than the one it was trained for. Choosing simulations there does not bias the surrogate:
!> given the model, what was chosen for known reasons is ignorable.
module posterior_focus
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: logarithmic_mean
   use sequential_design, only: candidates_type
   use errors, only: error_type
   use kinds, only: degree, wp
   use machine, only: thread_count
   use problem, only: problem_type
   use problem_posterior, only: draw_aside, focus_run, new_problem_posterior, stiffnesses
   use prior_sensitivity, only: is_truncated, list_limits
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

   !> Simulations over the domain before the posterior chooses; of each round those at draws of the
   !> theory alone, and all.
   integer, parameter, public :: simulations_before = 15, tempered = 2, round_size = 7
   !> Of the variance of each constant the surrogate's part, and what its errors may change, is at
   !> most this, and the root mean square of the errors of new simulations over their sds at most
   !> that.
   real(wp), parameter, public :: accurate_share = 0.10_wp, accurate_z = 1.5_wp

   !> What a round began with.
   type :: round_type
      integer :: simulations = 0
      !> The surrogate's part of the variance of each constant, or what its errors may change of it
      !> if that is more, (n_constants).
      real(wp), allocatable :: share(:)
      !> Root mean square of (simulated - predicted)/sd over the posterior's crystals of the round
      !> before; below 0: there is none.
      real(wp) :: z = -1.0_wp
      !> Whether a limit of the surrogate's domain ends the draws.
      logical :: truncated = .false.
   end type round_type

   type :: focus_type
      !> The first `tempered` are of the theory alone, whose errors may be large; the others are
      !> crystals of the posterior. The directions are those of the grains.
      type(candidates_type) :: candidates
      !> That holds them all.
      type(domain_type) :: domain
      !> Of which this is the posterior.
      type(surrogate_type) :: surrogate
      !> The last is the present one.
      type(round_type), allocatable :: rounds(:)
      !> Crystals that the theory alone explains the measurements with, roughly; stiffnesses, GPa,
      !> (6, 6, n).
      real(wp), allocatable, private :: rough(:, :, :)
   end type focus_type

   !> What the theory of the half-space is loosened by, where the specimen is another: relative sds
   !> of an error that all grains share, and of one of each grain.
   real(wp), parameter :: loose_common = 0.2_wp, loose_grain = 0.03_wp
   !> Candidates that are crystals of the posterior.
   integer, parameter :: n_candidates = 400
   !> How much farther than its domain a surrogate is used to sample in: factors on the
   !> log-anisotropy and on the scale, and the share of the way of Poisson's ratio to its limits.
   real(wp), parameter :: wider = 1.25_wp, wider_scale = 2.0_wp, wider_poisson = 0.5_wp
   !> Beyond the farthest draw the domain goes on for this share of their range.
   real(wp), parameter :: margin = 0.1_wp

contains

   !> Whether a problem's simulations are to be chosen at the posterior: `focus` asks for it, there
   !> are measurements, and the surrogate is a correction, of crystals of every kind.
   pure logical function has_focus(problem)
      type(problem_type), intent(in) :: problem

      has_focus = problem%settings%design%focus == 'posterior' &
         & .and. problem%settings%surrogate%model == 'correction' &
         & .and. allocated(problem%measurements) &
         & .and. problem%settings%measurements%orientations == 'known'
   end function has_focus

   !> Refuse what Step 2 would refuse.
   subroutine check_focus(problem, error)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: theory
      type(posterior_type) :: posterior

      call new_theory_surrogate(theory, error)
      if (allocated(error)) return
      call new_problem_posterior(problem, theory, posterior, error)
   end subroutine check_focus

   !> Begin a round.
   subroutine find_focus(problem, surrogate, candidates, focus, error)
      type(problem_type), intent(in) :: problem
      !> Of all simulations so far.
      type(surrogate_type), intent(in) :: surrogate
      !> Those that these were chosen from.
      type(candidates_type), intent(in) :: candidates
      !> The round before on entry.
      type(focus_type), intent(inout) :: focus
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: wide
      type(posterior_type) :: posterior
      type(round_type) :: round
      real(wp), allocatable :: draws(:, :), crystals(:, :, :)
      type(shares_type), allocatable :: shares(:)
      integer :: i

      if (.not. allocated(focus%rough)) call draw_roughly(problem, focus%rough, error)
      if (allocated(error)) return
      round%simulations = size(surrogate%simulations%modulus)
      round%z = error_of_predictions(focus, surrogate)
      wide = surrogate
      call drop_bounds(wide%basis%domain, &
         & stiffnesses(surrogate%basis%domain%class, candidates%constants))
      focus%domain = wide%basis%domain
      call widen(wide%basis%domain)
      call draw_aside(problem, problem%settings%measurements, wide, focus_run, posterior, draws, &
         & error)
      if (allocated(error)) return
      call find_shares(posterior, draws, draws(:posterior%n_constants, :), real(size(draws, 2), &
         & wp), thread_count(problem%settings%execution%workers), shares, error)
      if (allocated(error)) return
      round%share = [(shares(i)%by_source(from_surrogate), i=1, size(shares))]
      ! In the tails of the draws the surrogate may err where its part of the variance, a mean over
      ! all of them, is small.
      round%share = max(round%share, changes_of_variance(posterior, draws, size(shares), &
         & thread_count(problem%settings%execution%workers)))
      round%truncated = is_truncated(list_limits(posterior%prior, draws))
      crystals = stiffnesses(problem%class, draws)
      call hold(focus%domain, crystals)
      ! Of the rough ones others in each round.
      associate (stride => size(focus%rough, 3)/tempered)
         i = 1 + modulo(round%simulations, stride)
         associate (rough => focus%rough(:, :, i::stride), &
            & others => crystals(:, :, spread_out(draws(:posterior%n_constants, :))))
            focus%candidates = candidates_of(problem, focus%domain, reshape([rough, others], &
               & [6, 6, size(rough, 3) + size(others, 3)]))
         end associate
      end associate
      focus%surrogate = surrogate
      focus%rounds = [focus%rounds, round]
   end subroutine find_focus

   !> By how much a better surrogate is likely to change the variance of each constant: relative
   !> root mean square over surrogates that are drawn from what simulations and measurements leave
   !> open, or the change if this one were exact, where that is more. The weight of a draw is the
   !> density of that surrogate's errors there, given the data.
   function changes_of_variance(posterior, draws, n_constants, threads) result(change)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      integer, intent(in) :: n_constants, threads
      real(wp) :: change(n_constants)
      integer, parameter :: n_surrogates = 30
      !> Errors of surrogates, in sds, and logarithms of weights; the first is exact.
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
               ! A constant that is fixed has rounding alone.
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
         real(wp), dimension(posterior%n_shared, posterior%n_shared) :: precision, inverse
         real(wp) :: all_means(posterior%n_shared)
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

   !> Numbers of draws that are candidates: as many of the middle as of the tails, where squared
   !> deviations are large.
   function spread_out(draws) result(numbers)
      !> (constant, draw).
      real(wp), intent(in) :: draws(:, :)
      integer :: numbers(n_candidates), i, j
      real(wp) :: squares(size(draws, 1), size(draws, 2)), weight(size(draws, 2)), total

      squares = (draws - spread(sum(draws, 2)/size(draws, 2), 2, size(draws, 2)))**2
      ! One on average.
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
   end function spread_out

   !> Crystals by the theory of the half-space, loosened where the specimen is another.
   subroutine draw_roughly(problem, crystals, error)
      type(problem_type), intent(in) :: problem
      !> Stiffnesses, GPa, (6, 6, n).
      real(wp), allocatable, intent(out) :: crystals(:, :, :)
      type(error_type), allocatable, intent(out) :: error
      type(measurements_settings_type) :: loose
      type(surrogate_type) :: theory
      type(posterior_type) :: posterior
      real(wp), allocatable :: draws(:, :)

      loose = problem%settings%measurements
      loose%calibration_sd = max(loose_common, loose%calibration_sd)
      loose%scatter_sd = max(loose_grain, loose%scatter_sd)
      call new_theory_surrogate(theory, error)
      if (allocated(error)) return
      call draw_aside(problem, loose, theory, focus_run, posterior, draws, error)
      if (allocated(error)) return
      crystals = stiffnesses(problem%class, draws)
   end subroutine draw_roughly

   !> Root mean square of the errors, over their sds, with which the round's surrogate predicts the
   !> simulations since, those of the theory alone left out; below 0: there are none.
   real(wp) function error_of_predictions(focus, surrogate) result(z)
      type(focus_type), intent(in) :: focus
      !> With these simulations.
      type(surrogate_type), intent(in) :: surrogate
      real(wp), dimension(size(surrogate%simulations%modulus)) :: mean, sd
      type(error_type), allocatable :: error
      integer :: first

      z = -1.0_wp
      if (size(focus%rounds) == 0) return
      first = focus%rounds(size(focus%rounds))%simulations + tempered + 1
      associate (known => surrogate%simulations, class => surrogate%basis%domain%class)
         if (first > size(mean)) return
         call predict_crystals(focus%surrogate, stiffnesses(class, known%constants(:, first:)), &
            & degree*known%euler_deg(:, first:), 1, mean(first:), sd(first:), error)
         if (.not. allocated(error)) then
            z = norm2((known%modulus(first:) - mean(first:))/sd(first:)) &
               & /sqrt(real(size(mean) - first + 1, wp))
         end if
      end associate
   end function error_of_predictions

   !> Whether the surrogate with which the round begins is accurate enough: then the round is not
   !> needed.
   pure logical function is_accurate(focus)
      type(focus_type), intent(in) :: focus

      associate (round => focus%rounds(size(focus%rounds)))
         is_accurate = all(round%share <= accurate_share) .and. round%z >= 0.0_wp &
            & .and. round%z <= accurate_z .and. .not. round%truncated
      end associate
   end function is_accurate

   !> The domain in which the posterior is sampled.
   pure subroutine widen(domain)
      type(domain_type), intent(inout) :: domain

      domain%log_anisotropy_max = wider*domain%log_anisotropy_max
      domain%poisson = domain%poisson + wider_poisson*([-1.0_wp, 0.5_wp] - domain%poisson)
      if (domain%has_scale()) domain%stiffness = domain%stiffness*[1.0_wp/wider_scale, wider_scale]
   end subroutine widen

   !> Limit a domain by its log-anisotropy, Poisson's ratio and scale, where bounds of the constants
   !> limit it.
   pure subroutine drop_bounds(domain, stiffness)
      type(domain_type), intent(inout) :: domain
      !> Crystals that are spread over it, GPa, (6, 6, n).
      real(wp), intent(in) :: stiffness(:, :, :)

      if (size(domain%lower) == 0) return
      deallocate (domain%lower, domain%upper)
      allocate (domain%lower(0), domain%upper(0))
      domain%anisotropy_cap = huge(1.0_wp)
      domain%log_anisotropy_max = 0.0_wp
      domain%poisson = [0.5_wp, -1.0_wp]
      call hold(domain, stiffness)
   end subroutine drop_bounds

   !> Let a domain hold crystals, and some more on each side.
   pure subroutine hold(domain, stiffness)
      type(domain_type), intent(inout) :: domain
      !> GPa, (6, 6, n).
      real(wp), intent(in) :: stiffness(:, :, :)
      real(wp), dimension(size(stiffness, 3)) :: poisson, anisotropy, scale
      real(wp) :: range(2)
      integer :: i

      do i = 1, size(scale)
         call logarithmic_mean(stiffness(:, :, i), poisson(i), anisotropy(i), scale(i))
      end do
      domain%log_anisotropy_max = max(domain%log_anisotropy_max, maxval(held(anisotropy)))
      ! In the contrast, log(3K/2G), which has no limits.
      range = exp(held(log((1.0_wp + poisson)/(1.0_wp - 2.0_wp*poisson))))
      range = (range - 1.0_wp)/(2.0_wp*range + 1.0_wp)
      domain%poisson = [min(domain%poisson(1), range(1)), max(domain%poisson(2), range(2))]
      range = exp(held(log(scale)))
      if (domain%has_scale()) then
         domain%stiffness = [min(domain%stiffness(1), range(1)), max(domain%stiffness(2), range(2))]
      end if
   end subroutine hold

   !> The range of values, with a margin.
   pure function held(values) result(range)
      real(wp), intent(in) :: values(:)
      real(wp) :: range(2)

      range = [minval(values), maxval(values)]
      range = range + margin*(range(2) - range(1))*[-1.0_wp, 1.0_wp]
   end function held

   !> Crystals in the directions of the grains, which take turns.
   type(candidates_type) function candidates_of(problem, domain, stiffness) result(found)
      type(problem_type), intent(in) :: problem
      type(domain_type), intent(in) :: domain
      !> GPa, (6, 6, n).
      real(wp), intent(in) :: stiffness(:, :, :)
      integer :: i, n

      n = size(stiffness, 3)
      allocate (found%constants(domain%class%n_constants, n), found%euler_deg(3, n))
      do i = 1, n
         found%constants(:, i) = domain%class%constants_of(stiffness(:, :, i))
         found%euler_deg(:, i) = problem%measurements%euler_deg(:, &
            & modulo(i - 1, problem%measurements%n) + 1)
      end do
   end function candidates_of
end module posterior_focus
