!> The candidate that lowers the mean predictive variance over all candidates most: the integrated mean squared error (active learning,
!> Cohn 1996). Where the domain spreads crystals over their scale it is the variance of log M: else the stiffest would decide for all.
module imse_acquisition
   use abstract_acquisition, only: acquisition_type, sensitivity
   use abstract_basis, only: basis_type
   use evidence_regression, only: symmetric_product
   use kinds, only: wp
   use linear_algebra, only: add_gram, multiply
   use sequential_design, only: absorb_choices, condition_on, design_type, quadratic_forms, tie
   use vector_math, only: dot
   implicit none
   private
   public :: imse_acquisition_type

   type, extends(acquisition_type) :: imse_acquisition_type
   contains
      procedure :: choose
   end type imse_acquisition_type

contains

   !> A choice t lowers the variance at r by (t C r)²/(t C t + 1/beta), C the covariance.
   subroutine choose(self, design, basis, scale, spread, threads, chosen, variance)
      class(imse_acquisition_type), intent(in) :: self
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      real(wp), intent(in) :: scale(:), spread(:)
      integer, intent(in) :: threads
      integer, intent(out) :: chosen(:)
      real(wp), intent(out) :: variance(:)
      real(wp), allocatable :: slope(:), weighted(:, :), gram(:, :), product(:, :), lowered(:, :), reduction(:), gain(:)
      integer :: j, k, n

      slope = sensitivity(design, basis, scale, spread, self%relative .or. basis%domain%has_scale())
      n = design%regression%n_terms
      weighted = design%candidates
      do j = 1, size(slope)
         weighted(:, j) = slope(j)*weighted(:, j)
      end do
      allocate (gram(n, n), product(n, n), lowered(n, n), reduction(size(slope)))
      gram = 0.0_wp
      call add_gram(weighted, 1.0_wp, gram, transposed=.false.)
      deallocate (weighted)
      call absorb_choices(design, threads)
      ! With G the Gram matrix of all candidates by their sensitivity: t C G C t.
      call multiply(gram, design%regression%covariance, product)
      call multiply(design%regression%covariance, product, lowered)
      call quadratic_forms(lowered, design%candidates, threads, reduction)
      do k = 1, size(chosen)
         gain = reduction/(design%variance + 1.0_wp/design%regression%beta)
         chosen(k) = findloc(design%available .and. gain >= (1.0_wp - tie)*maxval(gain, mask=design%available), .true., 1)
         variance(k) = design%variance(chosen(k))
         design%available(chosen(k)) = .false.
         call condition_on(design, design%candidates(:, chosen(k)), threads)
         if (k < size(chosen)) call lower_reductions(design, chosen(k), variance(k), threads, lowered, reduction)
         call absorb_choices(design, threads)
      end do
   end subroutine choose

   !> C G C and the reductions t C G C t after the choice s that was the last to be deferred: C falls by v vᵀ, v = C s/σ,
   !> σ² = s C s + 1/beta, and C G C by v wᵀ + w vᵀ - (v G v) v vᵀ with w = C G v = (C G C) s/σ.
   subroutine lower_reductions(design, chosen, variance, threads, lowered, reduction)
      type(design_type), intent(in) :: design
      !> The candidate s, and s C s.
      integer, intent(in) :: chosen
      real(wp), intent(in) :: variance
      integer, intent(in) :: threads
      !> C G C (n_terms, n_terms); of each candidate.
      real(wp), intent(inout), contiguous :: lowered(:, :), reduction(:)
      real(wp), dimension(size(lowered, 1)) :: v, w
      real(wp) :: own, along
      integer :: j

      v = design%deferred(:, design%n_deferred)
      call symmetric_product(lowered, design%candidates(:, chosen), w)
      w = w/sqrt(variance + 1.0_wp/design%regression%beta)
      own = dot(design%candidates(:, chosen), w)/sqrt(variance + 1.0_wp/design%regression%beta)
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
end module imse_acquisition
