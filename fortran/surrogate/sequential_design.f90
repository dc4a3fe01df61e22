!> The crystals and orientations that a design chooses from, those that it starts with, and the
!> variance of y at each (paper's section 2.1).
!>
!> The variance does not depend on the moduli that simulations will have. So a batch is chosen one
!> candidate after another, as if each were already simulated; this is exact at fixed alpha and
!> beta.
!>
!> A choice changes the covariance by one outer product and every variance by one square (Eq. 11).
module sequential_design
   use abstract_basis, only: basis_type
   use distinct_directions, only: new_region, region_type, spread_of_directions
   use errors, only: error_type
   use evidence_regression, only: compute_posterior, factored_forms, regression_type, scale_columns
   use kinds, only: degree, wp
   use linear_algebra, only: cholesky_factor, dot
   use modulus_slopes, only: count_slopes, evaluate_slopes
   use problem, only: problem_type
   use settings_schema, only: design_settings_type
   use statistics, only: number_equal, sort_order
   use surrogate_domain, only: spread_crystals
   implicit none
   private
   public :: design_type, set_candidates, compute_variances, quadratic_forms, condition_on, &
      & condition_on_candidate, &
      & update_posterior_mean, candidates_type, new_candidates, initial_set

   !> Number of candidates in one matrix product.
   integer, parameter :: block_size = 256
   !> Number of choices after which everything is computed anew, so that rounding errors do not
   !> accumulate.
   integer, parameter, public :: refresh_interval = 500
   !> Relative difference below which values are equal: rounding must not decide between them.
   real(wp), parameter, public :: tie = 1.0e-10_wp

   type :: design_type
      type(regression_type) :: regression
      !> Whitened terms of the candidates (n_terms, n), and variance of y at each, without noise.
      real(wp), allocatable :: candidates(:, :), variance(:)
      !> Scale of each candidate, GPa, and its spread.
      real(wp), allocatable :: scale(:), spread(:)
      !> Whitened terms of the derivatives of each candidate, (n_terms, derivative, n), allocated if
      !> simulations are expected to have derivatives.
      real(wp), allocatable :: slopes(:, :, :)
      !> Whether each candidate may still be chosen.
      logical, allocatable :: available(:)
      !> Number of choices since the variances were computed anew.
      integer :: n_choices = 0
   end type design_type

   type :: candidates_type
      !> Constants of the domain's class (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), allocatable :: constants(:, :), euler_deg(:, :)
   end type candidates_type

   !> Difference of the seeds of the two blocks of a Latin hypercube.
   integer, parameter :: seed_step = 1000003

contains

   !> Set the candidates, all of them available.
   subroutine set_candidates(design, basis, constants, euler_deg, with_slopes)
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      !> Whether their simulations are expected to have derivatives.
      logical, intent(in) :: with_slopes
      integer :: i

      call basis%evaluate_crystals(constants, euler_deg, design%candidates, design%scale, &
         & design%spread)
      call scale_columns(design%regression%prior_width, design%candidates)
      design%variance = design%scale
      design%available = spread(.true., 1, size(design%scale))
      if (allocated(design%slopes)) deallocate (design%slopes)
      if (with_slopes) then
         ! Derivatives determine the terms so well that little noise is left.
         if (design%regression%n_data == 0) design%regression%beta = basis%least_noise**(-2)
         allocate (design%slopes(basis%n_terms, count_slopes(basis), size(design%scale)))
         do i = 1, size(design%scale)
            call evaluate_slopes(basis, constants(:, i), euler_deg(:, i), design%slopes(:, :, i))
            call scale_columns(design%regression%prior_width, design%slopes(:, :, i))
         end do
      end if
      call compute_variances(design)
   end subroutine set_candidates

   !> Compute the variances of all candidates from the regression's covariance.
   subroutine compute_variances(design)
      type(design_type), intent(inout) :: design

      call quadratic_forms(design%regression%covariance, design%candidates, 1, design%variance)
      design%n_choices = 0
   end subroutine compute_variances

   !> xᵀ S x of each vector x. The values do not depend on the number of threads.
   subroutine quadratic_forms(matrix, vectors, threads, values)
      !> S, symmetric and not negative, (n, n); vectors, (n, m).
      real(wp), intent(in), contiguous :: matrix(:, :), vectors(:, :)
      integer, intent(in) :: threads
      !> (m).
      real(wp), intent(out) :: values(:)
      type(error_type), allocatable :: error
      real(wp), allocatable :: factor(:, :)
      integer :: first, last

      factor = matrix
      call cholesky_factor(factor, error)
      if (allocated(error)) deallocate (factor)
      !$omp parallel do num_threads(threads) private(last) schedule(static) if(threads > 1)
      do first = 1, size(values), block_size
         last = min(first + block_size - 1, size(values))
         call factored_forms(matrix, factor, vectors(:, first:last), values(first:last))
      end do
      !$omp end parallel do
   end subroutine quadratic_forms

   !> Update the covariance and the variances as if a simulation with these whitened terms were in
   !> the data. The values do not depend on the number of threads.
   subroutine condition_on(design, terms, threads)
      type(design_type), intent(inout) :: design
      !> (n_terms).
      real(wp), intent(in), contiguous :: terms(:)
      integer, intent(in) :: threads
      real(wp) :: change(size(terms))
      integer :: j

      associate (regression => design%regression)
         change = matmul(regression%covariance, terms)
         change = change/sqrt(1.0_wp/regression%beta + dot(terms, change))
         do j = 1, size(change)
            regression%covariance(:, j) = regression%covariance(:, j) - change(j)*change
         end do
      end associate
      !$omp parallel do num_threads(threads) schedule(static) if(threads > 1)
      do j = 1, size(design%variance)
         design%variance(j) = max(0.0_wp, &
            & design%variance(j) - dot(design%candidates(:, j), change)**2)
      end do
      !$omp end parallel do
      design%n_choices = design%n_choices + 1
   end subroutine condition_on

   !> Update them as if the candidate of this `number` were simulated.
   subroutine condition_on_candidate(design, number, threads)
      type(design_type), intent(inout) :: design
      integer, intent(in) :: number, threads
      integer :: k

      call condition_on(design, design%candidates(:, number), threads)
      if (.not. allocated(design%slopes)) return
      do k = 1, size(design%slopes, 2)
         call condition_on(design, &
            & design%slopes(:, k, number)/design%regression%slope_noise, threads)
      end do
   end subroutine condition_on_candidate

   !> Update the posterior mean after the moduli of all chosen candidates were added as data.
   !> Everything is computed anew after `refresh_interval` choices, and if `exactly`: a chosen
   !> candidate that failed has no modulus.
   subroutine update_posterior_mean(design, exactly, error)
      type(design_type), intent(inout) :: design
      logical, intent(in) :: exactly
      type(error_type), allocatable, intent(out) :: error

      if (exactly .or. design%n_choices >= refresh_interval) then
         call compute_posterior(design%regression, error)
         if (.not. allocated(error)) call compute_variances(design)
      else
         design%regression%mean = matmul(design%regression%covariance, &
            & design%regression%beta*design%regression%moment)
      end if
   end subroutine update_posterior_mean

   !> The candidates that &design states.
   subroutine new_candidates(problem, basis, candidates, error)
      type(problem_type), intent(in) :: problem
      class(basis_type), intent(in) :: basis
      type(candidates_type), intent(out) :: candidates
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: rows(:)
      integer :: first, seed, i
      real(wp), allocatable :: constants(:, :), euler_deg(:, :)

      seed = problem%settings%problem%seed
      associate (design => problem%settings%design)
         if (allocated(problem%data%candidates)) then
            ! The rows of the user's table that are in the domain.
            associate (table => problem%data%candidates, domain => basis%domain)
               rows = pack([(i, i=1, table%n)], &
                  & [(domain%admits(table%stiffness(:, :, i)), i=1, table%n)])
               allocate (candidates%constants(domain%class%n_constants, size(rows)))
               do i = 1, size(rows)
                  candidates%constants(:, i) &
                     & = domain%class%constants_of(table%stiffness(:, :, rows(i)))
               end do
               candidates%euler_deg = table%euler_deg(:, rows)
            end associate
         else if (design%candidates == 'factorial') then
            call factorial()
         else
            ! The initial set is a Latin hypercube of its own.
            first = merge(min(design%initial, design%n_candidates), 0, &
               & design%initial_set == 'latin')
            call spread_crystals(basis%domain, first, seed, candidates%constants, &
               & candidates%euler_deg, error)
            if (allocated(error)) return
            call spread_crystals(basis%domain, design%n_candidates - first, &
               & modulo(seed + seed_step, huge(seed)), constants, euler_deg, error)
            if (allocated(error)) return
            candidates%constants = reshape([candidates%constants, constants], &
               & [size(constants, 1), design%n_candidates])
            candidates%euler_deg = reshape([candidates%euler_deg, euler_deg], &
               & [3, design%n_candidates])
            if (design%orientations == 'declination') then
               ! The cosine of a uniform direction's declination is uniform.
               candidates%euler_deg(2, :) = 90.0_wp*(1.0_wp &
                  & - cos(degree*candidates%euler_deg(2, :)))
               candidates%euler_deg([1, 3], :) = 0.0_wp
            end if
         end if
      end associate

   contains

      !> Crystals of a Latin hypercube, all in the same directions.
      subroutine factorial()
         type(region_type) :: region
         real(wp), allocatable :: directions(:, :)
         integer :: i, j, k, m

         m = problem%settings%design%n_directions
         call spread_crystals(basis%domain, max(1, problem%settings%design%n_candidates/m), seed, &
            & constants, euler_deg, error)
         if (allocated(error)) return
         call new_region(basis%domain%class, region)
         call spread_of_directions(region, m, directions)
         allocate (candidates%constants(size(constants, 1), size(constants, 2)*m), &
            & candidates%euler_deg(3, size(constants, 2)*m))
         do i = 1, size(constants, 2)
            do j = 1, m
               k = (i - 1)*m + j
               candidates%constants(:, k) = constants(:, i)
               candidates%euler_deg(:, k) = [0.0_wp, &
                  & acos(min(1.0_wp, max(-1.0_wp, directions(3, j))))/degree, &
                  & modulo(atan2(directions(1, j), directions(2, j))/degree, 360.0_wp)]
            end do
         end do
      end subroutine factorial
   end subroutine new_candidates

   !> Candidates that are simulated before the variance chooses. 'latin': the first ones.
   !> 'boundary': those farthest out in the domain, each crystal once, in alternating directions.
   subroutine initial_set(candidates, basis, design, numbers)
      type(candidates_type), intent(in) :: candidates
      class(basis_type), intent(in) :: basis
      type(design_settings_type), intent(in) :: design
      !> Numbers of the candidates, from 1.
      integer, allocatable, intent(out) :: numbers(:)
      integer, allocatable :: order(:), crystal(:), firsts(:), members(:)
      integer :: i, j, n, round, wanted

      n = size(candidates%euler_deg, 2)
      wanted = min(design%initial, n)
      allocate (numbers(0))
      if (design%initial_set == 'latin') numbers = [(i, i=1, wanted)]
      if (design%initial_set /= 'boundary') return
      allocate (order(n))
      call sort_order([(-basis%domain%normalised_distance( &
         & basis%domain%class%stiffness(candidates%constants(:, i))), i=1, n)], order)
      crystal = number_equal(candidates%constants(:, order))
      firsts = pack(crystal, crystal == [(i, i=1, n)])
      round = 0
      do while (size(numbers) < wanted)
         do j = 1, size(firsts)
            members = pack(order, crystal == firsts(j))
            if (round < size(members)) then
               numbers = [numbers, members(1 + mod(j - 1 + round, size(members)))]
            end if
         end do
         round = round + 1
      end do
      numbers = numbers(:wanted)
   end subroutine initial_set

end module sequential_design
