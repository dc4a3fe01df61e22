!> The candidates for the next simulations, and the variance of y at each (paper's section 2.1).
!>
!> The variance does not depend on the values to come, so that a batch is chosen one after another as if each were already
!> simulated, exactly, at frozen alpha and beta.
!>
!> A choice changes the covariance by one outer product and every variance by one square; done at once, both are limited by the
!> memory they touch. So a few choices are deferred: kept as vectors, and absorbed together by matrix products. Until then the
!> variances that lack them are upper bounds, since variances only fall.
module sequential_design
   use errors, only: error_type
   use evidence_regression, only: compute_posterior, regression_type, scale_columns, symmetric_product
   use kinds, only: wp
   use linear_algebra, only: add_gram, cholesky_factor, multiply, multiply_by_factor
   use vector_math, only: dot
   implicit none
   private
   public :: design_type, set_candidates, compute_variances, quadratic_forms, condition_on, update_variance, &
      & absorb_choices, update_posterior_mean

   !> Choices that are deferred before they are absorbed together.
   integer, parameter :: max_deferred = 8
   !> Candidates of one matrix product.
   integer, parameter :: block_size = 256
   !> Choices after which all is computed afresh, so that rounding does not build up.
   integer, parameter, public :: refresh_interval = 500
   !> Values closer than this share are equal: rounding does not decide between them.
   real(wp), parameter, public :: tie = 1.0e-10_wp

   type :: design_type
      type(regression_type) :: regression
      !> Whitened terms of the candidates (n_terms, n), and variance of y at each, noise not included.
      real(wp), allocatable :: candidates(:, :), variance(:)
      !> Candidates that may still be chosen.
      logical, allocatable :: available(:)
      !> Choices since the last exact variances.
      integer :: n_choices = 0
      !> The last `n_deferred` choices, which the regression's covariance lacks: it is -Σ v vᵀ short, v the columns
      !> (n_terms, max_deferred).
      integer :: n_deferred = 0
      real(wp), allocatable :: deferred(:, :)
      !> How many of them the variance of each candidate has already.
      integer, allocatable :: included(:)
   end type design_type

contains

   !> Give the candidates' terms (n_terms, n), all of them available.
   subroutine set_candidates(design, terms)
      type(design_type), intent(inout) :: design
      real(wp), intent(in) :: terms(:, :)

      call absorb_choices(design)
      design%candidates = terms
      call scale_columns(design%regression%prior_width, design%candidates)
      if (allocated(design%variance)) deallocate (design%variance, design%included, design%available, design%deferred)
      allocate (design%variance(size(terms, 2)), design%included(size(terms, 2)), design%deferred(size(terms, 1), max_deferred))
      allocate (design%available(size(terms, 2)), source=.true.)
      call compute_variances(design)
   end subroutine set_candidates

   !> Variances of all candidates from the regression's covariance, which must lack no choice.
   subroutine compute_variances(design)
      type(design_type), intent(inout) :: design

      call quadratic_forms(design%regression%covariance, design%candidates, 1, design%variance)
      design%n_choices = 0
      design%n_deferred = 0
      design%included = 0
   end subroutine compute_variances

   !> xᵀ S x of each vector x: |Lᵀ x|² with S = L Lᵀ, or, where S is singular to rounding, as it stands. The values do not depend on the
   !> number of threads.
   subroutine quadratic_forms(matrix, vectors, threads, values)
      !> S, symmetric and not negative, (n, n); (n, m).
      real(wp), intent(in), contiguous :: matrix(:, :), vectors(:, :)
      integer, intent(in) :: threads
      !> (m).
      real(wp), intent(out) :: values(:)
      type(error_type), allocatable :: error
      real(wp), allocatable :: factor(:, :), product(:, :)
      logical :: factored
      integer :: first, last, j

      factor = matrix
      call cholesky_factor(factor, error)
      factored = .not. allocated(error)
      !$omp parallel do num_threads(threads) private(last, j, product) schedule(static) if(threads > 1)
      do first = 1, size(values), block_size
         last = min(first + block_size - 1, size(values))
         product = vectors(:, first:last)
         if (factored) then
            call multiply_by_factor(factor, product)
         else
            call multiply(matrix, vectors(:, first:last), product)
         end if
         do j = first, last
            if (factored) then
               values(j) = dot(product(:, j - first + 1), product(:, j - first + 1))
            else
               values(j) = dot(vectors(:, j), product(:, j - first + 1))
            end if
         end do
      end do
      !$omp end parallel do
   end subroutine quadratic_forms

   !> The variance of one candidate with all choices so far.
   subroutine update_variance(design, candidate)
      type(design_type), intent(inout) :: design
      !> Its number.
      integer, intent(in) :: candidate
      integer :: k

      do k = design%included(candidate) + 1, design%n_deferred
         design%variance(candidate) = max(0.0_wp, design%variance(candidate) &
            & - dot(design%candidates(:, candidate), design%deferred(:, k))**2)
      end do
      design%included(candidate) = design%n_deferred
   end subroutine update_variance

   !> As if a simulation with these whitened terms were in the data: one vector more that is deferred.
   subroutine condition_on(design, terms, threads)
      type(design_type), intent(inout) :: design
      !> (n_terms).
      real(wp), intent(in), contiguous :: terms(:)
      integer, intent(in) :: threads
      integer :: n

      if (design%n_deferred == max_deferred) call absorb_choices(design, threads)
      n = design%n_deferred + 1
      call present_product(design, terms, design%deferred(:, n))
      design%deferred(:, n) = design%deferred(:, n)/sqrt(1.0_wp/design%regression%beta + dot(terms, design%deferred(:, n)))
      design%n_deferred = n
      design%n_choices = design%n_choices + 1
   end subroutine condition_on

   !> product = (covariance given all choices) vector.
   subroutine present_product(design, vector, product)
      type(design_type), intent(in) :: design
      real(wp), intent(in), contiguous :: vector(:)
      real(wp), intent(out), contiguous :: product(:)
      integer :: k

      call symmetric_product(design%regression%covariance, vector, product)
      do k = 1, design%n_deferred
         product = product - dot(design%deferred(:, k), vector)*design%deferred(:, k)
      end do
   end subroutine present_product

   !> Bring the regression's covariance and the variances of all candidates up to date with all choices. The result does not
   !> depend on the number of threads (1 unless stated).
   subroutine absorb_choices(design, threads)
      type(design_type), intent(inout) :: design
      integer, intent(in), optional :: threads
      real(wp) :: vectors(design%n_deferred, design%regression%n_terms), product(design%n_deferred, block_size)
      integer :: n, first, last, j, n_threads

      n = design%n_deferred
      if (n == 0) return
      n_threads = 1
      if (present(threads)) n_threads = threads
      vectors = transpose(design%deferred(:, :n))
      !$omp parallel do num_threads(n_threads) private(last, j, product) schedule(static) if(n_threads > 1)
      do first = 1, size(design%variance), block_size
         last = min(first + block_size - 1, size(design%variance))
         call multiply(vectors, design%candidates(:, first:last), product(:, :last - first + 1))
         do j = first, last
            design%variance(j) = max(0.0_wp, design%variance(j) - sum(product(design%included(j) + 1:, j - first + 1)**2))
         end do
      end do
      !$omp end parallel do
      call add_gram(design%deferred(:, :n), -1.0_wp, design%regression%covariance, transposed=.false.)
      design%n_deferred = 0
      design%included = 0
   end subroutine absorb_choices

   !> After the values of all chosen candidates were added as data: the posterior mean. From time to time, and always if
   !> `exactly` (a choice that failed and gave no value), everything is computed afresh.
   subroutine update_posterior_mean(design, exactly, error)
      type(design_type), intent(inout) :: design
      logical, intent(in) :: exactly
      type(error_type), allocatable, intent(out) :: error

      if (exactly .or. design%n_choices >= refresh_interval) then
         call compute_posterior(design%regression, error)
         if (.not. allocated(error)) call compute_variances(design)
      else
         call present_product(design, design%regression%beta*design%regression%moment, design%regression%mean)
      end if
   end subroutine update_posterior_mean
end module sequential_design
