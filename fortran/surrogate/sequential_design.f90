!> Which simulation to do next: the candidate of largest predictive variance (paper's section 2.1).
!>
!> The variance does not depend on the values to come, so that a batch is chosen one after another as if each were already
!> simulated, exactly, at frozen alpha and beta.
!>
!> A choice changes the covariance by one outer product and every variance by one square; done at once, both are limited by the
!> memory they touch. So a few choices are deferred: kept as vectors, and absorbed together by matrix products. Until then the
!> variances that lack them are upper bounds, since variances only fall: only candidates that might still be the largest are
!> brought up to date, and the choice is that of the full computation.
module sequential_design
   use errors, only: error_type, raise
   use evidence_regression, only: compute_posterior, maximise_evidence, new_regression, &
      & refresh_interval, regression_type, symmetric_product, whiten
   use kinds, only: wp
   use linear_algebra, only: add_gram, cholesky_factor, multiply, multiply_by_factor
   use vector_math, only: dot
   implicit none
   private
   public :: design_type, new_design, set_candidates, refit, compute_variances, choose_candidates, choose_for_all, absorb_choices, &
      & update_posterior_mean

   !> Choices that are deferred before they are absorbed together.
   integer, parameter :: max_deferred = 8
   !> Candidates of one matrix product.
   integer, parameter :: block_size = 256
   !> Values closer than this share are equal: rounding does not decide between them.
   real(wp), parameter :: tie = 1.0e-10_wp

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

   !> A design without candidates and without data: the arguments are those of `new_regression`.
   subroutine new_design(degrees, first_sds, least_noise, design, error)
      !> (n_terms).
      integer, intent(in) :: degrees(:)
      !> In units of y.
      real(wp), intent(in) :: first_sds(2), least_noise
      type(design_type), intent(out) :: design
      type(error_type), allocatable, intent(out) :: error

      call new_regression(degrees, first_sds, least_noise, design%regression, error)
      allocate (design%candidates(size(degrees), 0), design%variance(0), design%available(0), design%included(0))
      allocate (design%deferred(size(degrees), max_deferred))
   end subroutine new_design

   !> Give the candidates' terms (n_terms, n), all of them available.
   subroutine set_candidates(design, terms)
      type(design_type), intent(inout) :: design
      real(wp), intent(in) :: terms(:, :)
      integer :: n

      call absorb_choices(design)
      n = size(terms, 2)
      deallocate (design%candidates, design%variance, design%available, design%included)
      allocate (design%candidates(size(terms, 1), n), design%variance(n), design%available(n), design%included(n))
      call whiten(design%regression, terms, design%candidates)
      design%available = .true.
      call compute_variances(design)
   end subroutine set_candidates

   !> Precisions and fall of largest evidence, and the variances that follow.
   subroutine refit(design, evidence, error)
      type(design_type), intent(inout) :: design
      !> ln evidence.
      real(wp), intent(out) :: evidence
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: ratio(design%regression%n_terms)
      integer :: j

      ratio = 1.0_wp/design%regression%prior_width
      call maximise_evidence(design%regression, error, evidence)
      if (allocated(error)) return
      ratio = ratio*design%regression%prior_width
      if (any(abs(ratio - 1.0_wp) > 0.0_wp)) then
         do j = 1, size(design%candidates, 2)
            design%candidates(:, j) = design%candidates(:, j)*ratio
         end do
      end if
      call compute_variances(design)
   end subroutine refit

   !> Variances of all candidates from the regression's covariance, which must lack no choice.
   subroutine compute_variances(design)
      type(design_type), intent(inout) :: design

      call quadratic_forms(design%regression%covariance, design%candidates, 1, design%variance)
      design%n_choices = 0
      design%n_deferred = 0
      design%included = 0
   end subroutine compute_variances

   !> xᵀ S x of each vector x: |Lᵀ x|² with S = L Lᵀ, or, where S is singular to rounding, as it stands.
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

   !> Choose `size(chosen)` candidates, each of the largest importance^2 x (variance of y) given all chosen before; the lowest
   !> index of equals. Their values are not needed: afterwards the posterior's covariance is that of all data and all chosen.
   subroutine choose_candidates(design, importance, chosen, variance, threads, error)
      type(design_type), intent(inout) :: design
      !> |dM/dy| of each candidate for the variance of M, 1 for that of y.
      real(wp), intent(in) :: importance(:)
      integer, intent(out) :: chosen(:)
      !> Variance of y at each choice before it was made.
      real(wp), intent(out) :: variance(:)
      integer, intent(in) :: threads
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: squared(size(importance))
      integer :: k

      squared = importance**2
      do k = 1, size(chosen)
         if (design%n_deferred == max_deferred) call absorb_choices(design, threads)
         chosen(k) = most_uncertain(design, squared)
         if (chosen(k) == 0) then
            call raise(error, 'no candidate is left to choose')
            return
         end if
         variance(k) = design%variance(chosen(k))
         call condition_on(design, chosen(k))
      end do
   end subroutine choose_candidates

   !> Choose candidates, each of the one that lowers the mean of importance^2 x (variance of y) over all candidates most, given all
   !> chosen before; the lowest index of equals. A choice t lowers the variance at r by (t C r)²/(t C t + 1/beta).
   subroutine choose_for_all(design, importance, chosen, variance, threads, error)
      type(design_type), intent(inout) :: design
      !> |dM/dy| of each candidate for the variance of M, 1 for that of y.
      real(wp), intent(in) :: importance(:)
      integer, intent(out) :: chosen(:)
      !> Variance of y at each choice before it was made.
      real(wp), intent(out) :: variance(:)
      integer, intent(in) :: threads
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: weighted(:, :), gram(:, :), product(:, :), lowered(:, :), reduction(:), gain(:)
      integer :: j, k, n

      n = design%regression%n_terms
      weighted = design%candidates
      do j = 1, size(importance)
         weighted(:, j) = importance(j)*weighted(:, j)
      end do
      allocate (gram(n, n), product(n, n), lowered(n, n), reduction(size(importance)))
      gram = 0.0_wp
      call add_gram(weighted, 1.0_wp, gram, transposed=.false.)
      deallocate (weighted)
      call absorb_choices(design, threads)
      ! With C the covariance and G the Gram matrix of all candidates by their importance: t C G C t.
      call multiply(gram, design%regression%covariance, product)
      call multiply(design%regression%covariance, product, lowered)
      call quadratic_forms(lowered, design%candidates, threads, reduction)
      do k = 1, size(chosen)
         gain = reduction/(design%variance + 1.0_wp/design%regression%beta)
         if (.not. any(design%available)) then
            call raise(error, 'no candidate is left to choose')
            return
         end if
         chosen(k) = findloc(design%available .and. gain >= (1.0_wp - tie)*maxval(gain, mask=design%available), .true., 1)
         variance(k) = design%variance(chosen(k))
         call condition_on(design, chosen(k))
         if (k < size(chosen)) call lower_reductions(design, chosen(k), variance(k), threads, lowered, reduction)
         call absorb_choices(design, threads)
      end do
   end subroutine choose_for_all

   !> C G C and the reductions t C G C t of `choose_for_all` after the choice s that was the last to be deferred: C falls by v vᵀ,
   !> v = C s/σ, σ² = s C s + 1/beta, and C G C by v wᵀ + w vᵀ - (v G v) v vᵀ with w = C G v = (C G C) s/σ.
   subroutine lower_reductions(design, chosen, variance, threads, lowered, reduction)
      type(design_type), intent(in) :: design
      !> The candidate s, and s C s.
      integer, intent(in) :: chosen
      real(wp), intent(in) :: variance
      integer, intent(in) :: threads
      !> C G C (n_terms, n_terms); of each candidate.
      real(wp), intent(inout), contiguous :: lowered(:, :), reduction(:)
      real(wp), allocatable :: v(:), w(:)
      real(wp) :: sigma, own, along
      integer :: j

      sigma = sqrt(variance + 1.0_wp/design%regression%beta)
      v = design%deferred(:, design%n_deferred)
      allocate (w(size(v)))
      call symmetric_product(lowered, design%candidates(:, chosen), w)
      w = w/sigma
      own = dot(design%candidates(:, chosen), w)/sigma
      !$omp parallel do num_threads(threads) private(along) schedule(static) if(threads > 1)
      do j = 1, size(reduction)
         along = dot(design%candidates(:, j), v)
         reduction(j) = max(0.0_wp, reduction(j) - along*(2.0_wp*dot(design%candidates(:, j), w) - own*along))
      end do
      !$omp end parallel do
      w = w - 0.5_wp*own*v
      do j = 1, size(w)
         lowered(:, j) = lowered(:, j) - v*w(j) - w*v(j)
      end do
   end subroutine lower_reductions

   !> The available candidate of largest factor x variance, the lowest index of equals; 0 if there is none.
   integer function most_uncertain(design, factor) result(best)
      type(design_type), intent(inout) :: design
      real(wp), intent(in) :: factor(:)
      real(wp) :: threshold
      integer :: j

      ! The candidate of largest upper bound gives a threshold below which no other need be looked at.
      best = maxloc(factor*design%variance, 1, mask=design%available)
      if (best == 0) return
      call bring_up_to_date(design, best)
      threshold = (1.0_wp - tie)*factor(best)*design%variance(best)
      do j = 1, size(design%variance)
         if (.not. design%available(j) .or. factor(j)*design%variance(j) < threshold) cycle
         call bring_up_to_date(design, j)
         threshold = max(threshold, (1.0_wp - tie)*factor(j)*design%variance(j))
      end do
      ! All that reach the last threshold are up to date.
      do j = 1, size(design%variance)
         if (design%available(j) .and. factor(j)*design%variance(j) >= threshold) then
            best = j
            return
         end if
      end do
   end function most_uncertain

   !> The variance of one candidate with all choices so far.
   subroutine bring_up_to_date(design, candidate)
      type(design_type), intent(inout) :: design
      integer, intent(in) :: candidate
      integer :: k

      do k = design%included(candidate) + 1, design%n_deferred
         design%variance(candidate) = max(0.0_wp, design%variance(candidate) &
            & - dot(design%candidates(:, candidate), design%deferred(:, k))**2)
      end do
      design%included(candidate) = design%n_deferred
   end subroutine bring_up_to_date

   !> As if candidate `chosen` were simulated: one vector more that is deferred.
   subroutine condition_on(design, chosen)
      type(design_type), intent(inout) :: design
      integer, intent(in) :: chosen
      integer :: n

      design%available(chosen) = .false.
      n = design%n_deferred + 1
      call present_product(design, design%candidates(:, chosen), design%deferred(:, n))
      design%deferred(:, n) = design%deferred(:, n) &
         & /sqrt(1.0_wp/design%regression%beta + dot(design%candidates(:, chosen), design%deferred(:, n)))
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
