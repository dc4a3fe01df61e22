!> The rules that choose the next simulation, by the variance of M or of log M under the posterior.
module acquisitions
   use abstract_basis, only: basis_type
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_solve, dot, gram_of, multiply
   use sequential_design, only: condition_on_candidate, design_type, quadratic_forms, tie
   implicit none
   private
   public :: acquisition_type, acquisition_names, new_acquisition

   !> Names that &design `variance_of` may state. A new rule needs its name here.
   character(len=*), parameter :: acquisition_names = 'imse, variance'

   !> A rule of &design `variance_of`; a new one needs a component here, its line in
   !> `new_acquisition` and a gain in `choose`. By default the candidate of largest predictive
   !> variance is chosen (paper's section 2.1; active learning, MacKay 1992).
   type :: acquisition_type
      !> Whether the candidate is chosen that most lowers the mean predictive variance over all
      !> candidates: the integrated mean squared error (active learning, Cohn 1996). If the domain
      !> has a range of the scale, the variance is that of log M: otherwise the stiffest crystals
      !> would dominate.
      logical :: lowers_mean = .false.
   contains
      procedure :: choose
   end type acquisition_type

contains

   !> The rule of this name.
   pure type(acquisition_type) function new_acquisition(name) result(rule)
      character(len=*), intent(in) :: name

      rule%lowers_mean = name == 'imse'
   end function new_acquisition

   !> Choose `size(chosen)` of the available candidates, each given all that were chosen before; of
   !> those of equal gain that with the lowest number. As many must be available. The moduli of the
   !> chosen ones are not needed. Afterwards the posterior covariance is that of all data and all
   !> chosen candidates, and these are not available.
   !>
   !> A choice t lowers the variance at r by (t C r)²/(t C t + 1/beta), with C the covariance. So t
   !> reduces the mean by t C G C t over t C t + 1/beta, with G the Gram matrix of all candidates,
   !> weighted by their sensitivities.
   subroutine choose(self, design, basis, threads, chosen, variance)
      class(acquisition_type), intent(in) :: self
      type(design_type), intent(inout) :: design
      class(basis_type), intent(in) :: basis
      integer, intent(in) :: threads
      !> Numbers of the candidates, from 1.
      integer, intent(out) :: chosen(:)
      !> Variance of y at each before it was chosen.
      real(wp), intent(out) :: variance(:)
      real(wp), allocatable :: slope(:), weighted(:, :), gram(:, :), product(:, :), lowered(:, :), &
         & reduction(:), gain(:)
      logical :: relative
      integer :: j, k

      ! |dM/dy| of each candidate, or |d log M/dy|, above 0. Its square times the variance of y is
      ! the variance of M, or of log M.
      relative = self%lowers_mean .and. basis%domain%has_scale()
      slope = merge(design%spread, design%scale, relative)
      if (relative .neqv. basis%logarithmic) then
         slope = matmul(design%regression%mean, design%candidates)
         if (relative) then
            slope = 1.0_wp/max(tiny(1.0_wp), abs(slope))
         else
            slope = basis%to_modulus(slope, design%scale, design%spread)*design%spread
         end if
      end if
      if (self%lowers_mean) then
         weighted = design%candidates
         do j = 1, size(slope)
            weighted(:, j) = slope(j)*weighted(:, j)
         end do
         gram = gram_of(weighted)
         deallocate (weighted)
         allocate (product, lowered, mold=gram)
         reduction = slope
         call find_reductions()
      end if
      do k = 1, size(chosen)
         if (self%lowers_mean .and. allocated(design%slopes)) then
            if (k > 1) call find_reductions()
            gain = slope
            !$omp parallel do num_threads(threads) schedule(static) if(threads > 1)
            do j = 1, size(gain)
               gain(j) = gain_with_slopes(j)
            end do
            !$omp end parallel do
         else if (self%lowers_mean) then
            gain = reduction/(design%variance + 1.0_wp/design%regression%beta)
         else
            gain = slope**2*design%variance
         end if
         chosen(k) = findloc(design%available &
            & .and. gain >= (1.0_wp - tie)*maxval(gain, mask=design%available), .true., 1)
         variance(k) = design%variance(chosen(k))
         design%available(chosen(k)) = .false.
         if (self%lowers_mean .and. k < size(chosen) .and. .not. allocated(design%slopes)) then
            call lower_reductions()
         end if
         call condition_on_candidate(design, chosen(k), threads)
      end do

   contains

      !> Compute C G C and the reductions t C G C t.
      subroutine find_reductions()
         call multiply(gram, design%regression%covariance, product)
         call multiply(design%regression%covariance, product, lowered)
         call quadratic_forms(lowered, design%candidates, threads, reduction)
      end subroutine find_reductions

      !> Reduction of the mean by a candidate and its derivatives T, of equal noise: the trace of
      !> (Tᵀ C T + 1/beta)^-1 Tᵀ C G C T.
      real(wp) function gain_with_slopes(number) result(gain)
         integer, intent(in) :: number
         real(wp) :: t(size(lowered, 1), 1 + size(design%slopes, 2)), part(size(t, 1), size(t, 2))
         real(wp), dimension(size(t, 2), size(t, 2)) :: own, reduced
         type(error_type), allocatable :: error
         integer :: i

         gain = 0.0_wp
         if (.not. design%available(number)) return
         t(:, 1) = design%candidates(:, number)
         t(:, 2:) = design%slopes(:, :, number)/design%regression%slope_noise
         call multiply(design%regression%covariance, t, part)
         call multiply(t, part, own, transposed=.true.)
         call multiply(lowered, t, part)
         call multiply(t, part, reduced, transposed=.true.)
         do i = 1, size(t, 2)
            own(i, i) = own(i, i) + 1.0_wp/design%regression%beta
         end do
         call cholesky_factor(own, error)
         if (allocated(error)) return
         call cholesky_solve(own, reduced)
         gain = sum([(reduced(i, i), i=1, size(t, 2))])
      end function gain_with_slopes

      !> Update C G C and the reductions t C G C t for the choice of s. C falls by v vᵀ with v = C
      !> s/σ and σ² = s C s + 1/beta. C G C falls by v wᵀ + w vᵀ - (v G v) v vᵀ with w = C G v =
      !> (C G C) s/σ.
      subroutine lower_reductions()
         real(wp), dimension(size(lowered, 1)) :: s, v, w
         real(wp) :: own, along
         integer :: j

         s = design%candidates(:, chosen(k))/sqrt(variance(k) + 1.0_wp/design%regression%beta)
         v = matmul(design%regression%covariance, s)
         w = matmul(lowered, s)
         own = dot(s, w)
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
   end subroutine choose
end module acquisitions
