!> The rules by which the next simulation may be chosen, by the variance of M or of log M that the posterior leaves.
module acquisitions
   use abstract_basis, only: basis_type
   use errors, only: error_type, exit_bad_input, raise
   use evidence_regression, only: symmetric_product
   use kinds, only: wp
   use linear_algebra, only: add_gram, dot, multiply
   use sequential_design, only: condition_on, design_type, quadratic_forms, tie
   implicit none
   private
   public :: acquisition_type, acquisition_names, new_acquisition

   !> A new rule: its type, which extends `acquisition_type`, its name here, and its line in `new_acquisition`. All but the first, the third
   !> and the fifth are older names.
   character(len=*), parameter :: acquisition_names = 'imse, all_moduli, variance, modulus, relative_variance, log_modulus'

   !> The candidate of largest predictive variance (paper's section 2.1; active learning, MacKay 1992), of the modulus or of its logarithm.
   !> Or the one that lowers the mean predictive variance over all candidates most: the integrated mean squared error (active learning,
   !> Cohn 1996). Where the domain spreads crystals over their scale it is the variance of log M: else the stiffest would decide for all.
   type :: acquisition_type
      !> The variance of log M counts, not that of M; the mean over all candidates.
      logical :: relative = .false., integrated = .false.
   contains
      procedure :: choose
   end type acquisition_type

contains

   !> The rule of a name.
   subroutine new_acquisition(name, rule, error)
      character(len=*), intent(in) :: name
      class(acquisition_type), allocatable, intent(out) :: rule
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('imse', 'all_moduli')
         allocate (rule, source=acquisition_type(integrated=.true.))
      case ('variance', 'modulus')
         allocate (rule)
      case ('relative_variance', 'log_modulus')
         allocate (rule, source=acquisition_type(relative=.true.))
      case default
         call raise(error, 'variance_of: '''//name//''' is unknown; allowed: '//acquisition_names, exit_bad_input)
      end select
   end subroutine new_acquisition

   !> Choose `size(chosen)` available candidates, of which there are so many, each given all chosen before; the lowest number of
   !> equals. Their moduli are not needed: afterwards the posterior's covariance is that of all data and all chosen.
   subroutine choose(self, design, basis, scale, spread, threads, chosen, variance)
      class(acquisition_type), intent(in) :: self
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      !> Of each candidate, GPa, and its spread.
      real(wp), intent(in) :: scale(:), spread(:)
      integer, intent(in) :: threads
      !> Numbers of the candidates, from 1.
      integer, intent(out) :: chosen(:)
      !> Variance of y at each before it was chosen.
      real(wp), intent(out) :: variance(:)
      real(wp), allocatable :: slope(:), lowered(:, :), reduction(:), gain(:), along(:)
      real(wp) :: v(basis%n_terms)
      integer :: k

      slope = sensitivity(design, basis, scale, spread, self%relative .or. (self%integrated .and. basis%domain%has_scale()))
      allocate (along, reduction, mold=slope)
      if (self%integrated) call find_reductions(design, slope, threads, lowered, reduction)
      do k = 1, size(chosen)
         if (self%integrated) then
            gain = reduction/(design%variance + 1.0_wp/design%regression%beta)
         else
            gain = slope**2*design%variance
         end if
         ! The lowest number of equals.
         chosen(k) = findloc(design%available .and. gain >= (1.0_wp - tie)*maxval(gain, mask=design%available), .true., 1)
         variance(k) = design%variance(chosen(k))
         design%available(chosen(k)) = .false.
         call condition_on(design, design%candidates(:, chosen(k)), threads, v, along)
         if (self%integrated .and. k < size(chosen)) call lower_reductions(design, chosen(k), variance(k), v, along, threads, &
            & lowered, reduction)
      end do
   end subroutine choose

   !> C G C, with C the covariance and G the Gram matrix of all candidates by their sensitivity, and by how much a choice t lowers the sum
   !> of the variances, but for the factor 1/(t C t + 1/beta): t C G C t.
   subroutine find_reductions(design, slope, threads, lowered, reduction)
      type(design_type), intent(in) :: design
      !> See `sensitivity`, (candidate).
      real(wp), intent(in) :: slope(:)
      integer, intent(in) :: threads
      !> (n_terms, n_terms); (candidate).
      real(wp), allocatable, intent(out) :: lowered(:, :)
      real(wp), intent(out) :: reduction(:)
      real(wp), allocatable :: weighted(:, :), gram(:, :), product(:, :)
      integer :: j, n

      n = design%regression%n_terms
      weighted = design%candidates
      do j = 1, size(slope)
         weighted(:, j) = slope(j)*weighted(:, j)
      end do
      allocate (gram(n, n), source=0.0_wp)
      allocate (product(n, n), lowered(n, n))
      call add_gram(weighted, 1.0_wp, gram, transposed=.false.)
      deallocate (weighted)
      call multiply(gram, design%regression%covariance, product)
      call multiply(design%regression%covariance, product, lowered)
      call quadratic_forms(lowered, design%candidates, threads, reduction)
   end subroutine find_reductions

   !> C G C and the reductions t C G C t after the choice s: C falls by v vᵀ, v = C s/σ,
   !> σ² = s C s + 1/beta, and C G C by v wᵀ + w vᵀ - (v G v) v vᵀ with w = C G v = (C G C) s/σ.
   subroutine lower_reductions(design, chosen, variance, v, along, threads, lowered, reduction)
      type(design_type), intent(in) :: design
      !> The candidate s; s C s, v, (n_terms), and its product with each candidate.
      integer, intent(in) :: chosen
      real(wp), intent(in) :: variance, v(:), along(:)
      integer, intent(in) :: threads
      !> C G C (n_terms, n_terms); of each candidate.
      real(wp), intent(inout), contiguous :: lowered(:, :), reduction(:)
      real(wp) :: w(size(v))
      real(wp) :: own
      integer :: j

      call symmetric_product(lowered, design%candidates(:, chosen), w)
      w = w/sqrt(variance + 1.0_wp/design%regression%beta)
      own = dot(design%candidates(:, chosen), w)/sqrt(variance + 1.0_wp/design%regression%beta)
      !$omp parallel do num_threads(threads) schedule(static) if(threads > 1)
      do j = 1, size(reduction)
         reduction(j) = max(0.0_wp, reduction(j) - along(j)*(2.0_wp*dot(design%candidates(:, j), w) - own*along(j)))
      end do
      !$omp end parallel do
      w = w - 0.5_wp*own*v
      do j = 1, size(w)
         lowered(:, j) = lowered(:, j) - v*w(j) - w*v(j)
      end do
   end subroutine lower_reductions

   !> |dM/dy| of each candidate, or |d log M/dy|, above 0: its square times the variance of y is the variance of M, or of log M.
   function sensitivity(design, basis, scale, spread, relative) result(slope)
      type(design_type), intent(in) :: design
      class(basis_type), intent(in) :: basis
      !> Of each candidate, GPa, and its spread.
      real(wp), intent(in) :: scale(:), spread(:)
      !> Of log M.
      logical, intent(in) :: relative
      real(wp), allocatable :: slope(:)

      if (relative .neqv. basis%logarithmic) then
         slope = matmul(design%regression%mean, design%candidates)
         if (relative) then
            slope = 1.0_wp/max(tiny(1.0_wp), abs(slope))
         else
            slope = basis%to_modulus(slope, scale, spread)*spread
         end if
      else
         slope = merge(spread, scale, relative)
      end if
   end function sensitivity

end module acquisitions
