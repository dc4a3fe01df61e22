!> The rules that choose the next simulation, by the variance of M or of log M under the posterior.
module acquisitions
   use abstract_basis, only: basis_type
   use errors, only: error_type, refuse
   use kinds, only: wp
   use linear_algebra, only: add_gram, dot, multiply
   use sequential_design, only: condition_on, design_type, quadratic_forms, tie
   implicit none
   private
   public :: acquisition_type, acquisition_names, new_acquisition

   !> Names of the rules, of which the second, fourth and sixth are older ones. A new rule needs a
   !> type that extends `acquisition_type`, its name here and a case in `new_acquisition`.
   character(len=*), parameter :: acquisition_names = 'imse, all_moduli, variance, modulus, ' &
      & //'relative_variance, log_modulus'

   !> Choose the candidate of largest predictive variance (paper's section 2.1; active learning,
   !> MacKay 1992), of the modulus or of its logarithm.
   type :: acquisition_type
      !> Whether the variance of log M counts, not that of M.
      logical :: relative = .false.
   contains
      procedure :: choose
   end type acquisition_type

   !> Choose the candidate that most lowers the mean predictive variance over all candidates: the
   !> integrated mean squared error (active learning, Cohn 1996). If the domain has a range of the
   !> scale, the variance is that of log M: otherwise the stiffest crystals would dominate.
   type, extends(acquisition_type) :: imse_acquisition_type
   contains
      procedure :: choose => choose_for_mean
   end type imse_acquisition_type

contains

   !> Make a rule by its name.
   subroutine new_acquisition(name, rule, error)
      character(len=*), intent(in) :: name
      class(acquisition_type), allocatable, intent(out) :: rule
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('imse', 'all_moduli')
         allocate (imse_acquisition_type :: rule)
      case ('variance', 'modulus')
         allocate (rule)
      case ('relative_variance', 'log_modulus')
         allocate (rule, source=acquisition_type(relative=.true.))
      case default
         call refuse(error, 'variance_of: '''//name//''' is unknown; allowed: '//acquisition_names)
      end select
   end subroutine new_acquisition

   !> Choose `size(chosen)` of the available candidates, each given all that were chosen before; of
   !> equal ones that with the lowest number. As many must be available. The moduli of the chosen
   !> ones are not needed. Afterwards the posterior covariance is that of all data and all chosen
   !> candidates.
   subroutine choose(self, design, basis, threads, chosen, variance)
      class(acquisition_type), intent(in) :: self
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      integer, intent(in) :: threads
      !> Numbers of the candidates, from 1.
      integer, intent(out) :: chosen(:)
      !> Variance of y at each before it was chosen.
      real(wp), intent(out) :: variance(:)
      real(wp), allocatable :: factor(:)
      integer :: k

      factor = sensitivity(design, basis, self%relative)**2
      do k = 1, size(chosen)
         call take_largest(design, factor*design%variance, chosen(k), variance(k))
         call condition_on(design, design%candidates(:, chosen(k)), threads)
      end do
   end subroutine choose

   !> Choose the available candidate of largest gain, of equal ones that with the lowest number, and
   !> mark it as not available.
   subroutine take_largest(design, gain, chosen, variance)
      type(design_type), intent(inout) :: design
      !> Of each candidate.
      real(wp), intent(in) :: gain(:)
      !> Number of the chosen candidate, and variance of y there.
      integer, intent(out) :: chosen
      real(wp), intent(out) :: variance

      chosen = findloc(design%available &
         & .and. gain >= (1.0_wp - tie)*maxval(gain, mask=design%available), .true., 1)
      variance = design%variance(chosen)
      design%available(chosen) = .false.
   end subroutine take_largest

   !> Choose by the mean variance. A choice t lowers the variance at r by (t C r)²/(t C t + 1/beta),
   !> with C the covariance.
   subroutine choose_for_mean(self, design, basis, threads, chosen, variance)
      class(imse_acquisition_type), intent(in) :: self
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      integer, intent(in) :: threads
      integer, intent(out) :: chosen(:)
      real(wp), intent(out) :: variance(:)
      real(wp), allocatable :: slope(:), weighted(:, :), gram(:, :), product(:, :), lowered(:, :), &
         & reduction(:)
      integer :: j, k, n

      slope = sensitivity(design, basis, self%relative .or. basis%domain%has_scale())
      n = design%regression%n_terms
      weighted = design%candidates
      do j = 1, size(slope)
         weighted(:, j) = slope(j)*weighted(:, j)
      end do
      allocate (gram(n, n), product(n, n), lowered(n, n), reduction(size(slope)), source=0.0_wp)
      call add_gram(weighted, 1.0_wp, gram, transposed=.false.)
      deallocate (weighted)
      ! The reduction by a choice t is t C G C t over t C t + 1/beta, with G the Gram matrix of all
      ! candidates, weighted by their sensitivities.
      call multiply(gram, design%regression%covariance, product)
      call multiply(design%regression%covariance, product, lowered)
      call quadratic_forms(lowered, design%candidates, threads, reduction)
      do k = 1, size(chosen)
         call take_largest(design, reduction/(design%variance + 1.0_wp/design%regression%beta), &
            & chosen(k), variance(k))
         if (k < size(chosen)) then
            call lower_reductions(design, chosen(k), variance(k), threads, lowered, reduction)
         end if
         call condition_on(design, design%candidates(:, chosen(k)), threads)
      end do
   end subroutine choose_for_mean

   !> Update C G C and the reductions t C G C t for the choice of s. C falls by v vᵀ with v = C s/σ
   !> and σ² = s C s + 1/beta. C G C falls by v wᵀ + w vᵀ - (v G v) v vᵀ with w = C G v = (C G C)
   !> s/σ.
   subroutine lower_reductions(design, chosen, variance, threads, lowered, reduction)
      type(design_type), intent(in) :: design
      !> The candidate s, and s C s.
      integer, intent(in) :: chosen
      real(wp), intent(in) :: variance
      integer, intent(in) :: threads
      !> C G C, (n_terms, n_terms), and the reduction of each candidate.
      real(wp), intent(inout), contiguous :: lowered(:, :), reduction(:)
      real(wp), dimension(size(lowered, 1)) :: v, w
      real(wp) :: own, along
      integer :: j

      associate (s => design%candidates(:, chosen)/sqrt(variance + 1.0_wp/design%regression%beta))
         v = matmul(design%regression%covariance, s)
         w = matmul(lowered, s)
         own = dot(s, w)
      end associate
      !$omp parallel do num_threads(threads) private(along) schedule(static) if(threads > 1)
      do j = 1, size(reduction)
         along = dot(design%candidates(:, j), v)
         reduction(j) = max(0.0_wp, &
            & reduction(j) - along*(2.0_wp*dot(design%candidates(:, j), w) - own*along))
      end do
      !$omp end parallel do
      w = w - 0.5_wp*own*v
      do j = 1, size(w)
         lowered(:, j) = lowered(:, j) - v*w(j) - w*v(j)
      end do
   end subroutine lower_reductions

   !> |dM/dy| of each candidate, or |d log M/dy|, above 0. Its square times the variance of y is the
   !> variance of M, or of log M.
   function sensitivity(design, basis, relative) result(slope)
      type(design_type), intent(in) :: design
      class(basis_type), intent(in) :: basis
      !> Whether log M counts, not M.
      logical, intent(in) :: relative
      real(wp), allocatable :: slope(:)

      if (relative .neqv. basis%logarithmic) then
         slope = matmul(design%regression%mean, design%candidates)
         if (relative) slope = 1.0_wp/max(tiny(1.0_wp), abs(slope))
         if (.not. relative) then
            slope = basis%to_modulus(slope, design%scale, design%spread)*design%spread
         end if
      else
         slope = merge(design%spread, design%scale, relative)
      end if
   end function sensitivity

end module acquisitions
