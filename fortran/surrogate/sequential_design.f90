!> Which simulation to do next: the candidate of largest predictive variance (paper's section 2.1).
!>
!> The variance does not depend on the values to come, so that a batch is chosen one after another as if each were already
!> simulated, exactly, at frozen alpha and beta. Every choice costs O(candidates x terms).
module sequential_design
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_null_ptr, c_ptr
   use errors, only: error_type, raise
   use evidence_regression, only: compute_posterior, new_regression, refresh_interval, regression_type, subtract_outer, &
      & symmetric_product, whiten
   use kinds, only: i8, wp
   use linear_algebra, only: multiply
   implicit none
   private
   public :: design_type, new_design, set_candidates, compute_variances, choose_candidates, settle, design_to_handle, &
      & design_from_handle

   type :: design_type
      type(regression_type) :: regression
      !> Whitened terms of the candidates (n_terms, n), and variance of y at each, noise not included.
      real(wp), allocatable :: candidates(:, :), variance(:)
      !> Candidates that may still be chosen.
      logical, allocatable :: available(:)
      !> Choices since the last exact variances; the regression's covariance already includes them.
      integer :: n_choices = 0
   end type design_type

contains

   function design_to_handle(design) result(handle)
      type(design_type), intent(in), pointer :: design
      integer(i8) :: handle

      handle = transfer(c_loc(design), handle)
   end function design_to_handle

   function design_from_handle(handle) result(design)
      integer(i8), intent(in) :: handle
      type(design_type), pointer :: design
      type(c_ptr) :: address

      address = c_null_ptr
      address = transfer(handle, address)
      call c_f_pointer(address, design)
   end function design_from_handle

   !> A design without candidates and without data; arguments as of `new_regression`.
   subroutine new_design(weights, prior_mean, least_noise, design, error)
      real(wp), intent(in) :: weights(:), prior_mean(:), least_noise
      type(design_type), intent(out) :: design
      type(error_type), allocatable, intent(out) :: error

      call new_regression(weights, prior_mean, least_noise, design%regression, error)
      allocate (design%candidates(size(weights), 0), design%variance(0), design%available(0))
   end subroutine new_design

   !> Give the candidates' terms (n_terms, n), all of them available.
   subroutine set_candidates(design, terms)
      type(design_type), intent(inout) :: design
      real(wp), intent(in) :: terms(:, :)
      integer :: n

      n = size(terms, 2)
      deallocate (design%candidates, design%variance, design%available)
      allocate (design%candidates(size(terms, 1), n), design%variance(n), design%available(n))
      call whiten(design%regression, terms, design%candidates)
      design%available = .true.
      call compute_variances(design)
   end subroutine set_candidates

   !> Variances of all candidates from the posterior covariance.
   subroutine compute_variances(design)
      type(design_type), intent(inout) :: design
      integer, parameter :: block_size = 256
      real(wp), allocatable :: product(:, :)
      integer :: first, last, j

      do first = 1, size(design%variance), block_size
         last = min(first + block_size - 1, size(design%variance))
         allocate (product(size(design%candidates, 1), last - first + 1))
         call multiply(design%regression%covariance, design%candidates(:, first:last), product)
         do j = first, last
            design%variance(j) = dot(design%candidates(:, j), product(:, j - first + 1))
         end do
         deallocate (product)
      end do
      design%n_choices = 0
   end subroutine compute_variances

   !> Choose `size(chosen)` candidates, each of the largest importance^2 x (variance of y) given all chosen before; the lowest
   !> index of equals. Their values are not needed: afterwards covariance and variances are those of all data and all chosen.
   subroutine choose_candidates(design, importance, chosen, variance, threads, error)
      type(design_type), intent(inout) :: design
      !> |dM/dy| of each candidate for the variance of M, 1 for that of y.
      real(wp), intent(in) :: importance(:)
      integer, intent(out) :: chosen(:)
      !> Variance of y at each choice before it was made.
      real(wp), intent(out) :: variance(:)
      integer, intent(in) :: threads
      type(error_type), allocatable, intent(out) :: error
      integer :: k, j, best
      real(wp) :: largest

      do k = 1, size(chosen)
         best = 0
         largest = -1.0_wp
         do j = 1, size(design%variance)
            if (.not. design%available(j)) cycle
            if (importance(j)**2*design%variance(j) > largest) then
               largest = importance(j)**2*design%variance(j)
               best = j
            end if
         end do
         if (best == 0) then
            call raise(error, 'no candidate is left to choose')
            return
         end if
         chosen(k) = best
         variance(k) = design%variance(best)
         call condition_on(design, best, threads)
      end do
   end subroutine choose_candidates

   !> Covariance and variances as if candidate `chosen` were simulated.
   subroutine condition_on(design, chosen, threads)
      type(design_type), intent(inout) :: design
      integer, intent(in) :: chosen, threads
      real(wp), allocatable :: gain(:)
      real(wp) :: factor
      integer :: j

      design%available(chosen) = .false.
      allocate (gain(design%regression%n_terms))
      call symmetric_product(design%regression%covariance, design%candidates(:, chosen), gain)
      factor = 1.0_wp/(1.0_wp/design%regression%beta + dot(design%candidates(:, chosen), gain))
      !$omp parallel do num_threads(threads) schedule(static) if(threads > 1)
      do j = 1, size(design%variance)
         design%variance(j) = max(0.0_wp, design%variance(j) - factor*dot(design%candidates(:, j), gain)**2)
      end do
      !$omp end parallel do
      call subtract_outer(design%regression%covariance, gain, factor)
      design%n_choices = design%n_choices + 1
   end subroutine condition_on

   !> After the values of all chosen candidates were added as data: the posterior mean. From time to time, and always if
   !> `exactly` (a choice that failed and gave no value), everything is computed afresh.
   subroutine settle(design, exactly, error)
      type(design_type), intent(inout) :: design
      logical, intent(in) :: exactly
      type(error_type), allocatable, intent(out) :: error

      if (exactly .or. design%n_choices >= refresh_interval) then
         call compute_posterior(design%regression, error)
         if (.not. allocated(error)) call compute_variances(design)
      else
         call symmetric_product(design%regression%covariance, design%regression%beta*design%regression%moment, &
            & design%regression%mean)
      end if
   end subroutine settle

   pure real(wp) function dot(a, b)
      real(wp), intent(in), contiguous :: a(:), b(:)
      integer :: i

      dot = 0.0_wp
      !$omp simd reduction(+:dot)
      do i = 1, size(a)
         dot = dot + a(i)*b(i)
      end do
   end function dot
end module sequential_design
