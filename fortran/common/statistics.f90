!> Moments and order statistics of samples.
module statistics
   use kinds, only: wp
   use sorting, only: sort_order
   implicit none
   private
   public :: moments, covariance_of, sorted_values, median, flattened, thinned

contains

   !> Mean and sd of each variable; the sd is unbiased, or with weights not.
   pure subroutine moments(draws, mean, sd, weights)
      !> (variable, draw).
      real(wp), intent(in) :: draws(:, :)
      !> (variable).
      real(wp), intent(out) :: mean(:), sd(:)
      !> (draw), not negative; default: all the same.
      real(wp), intent(in), optional :: weights(:)
      real(wp) :: w, total
      integer :: i

      total = size(draws, 2)
      if (present(weights)) total = max(tiny(1.0_wp), sum(weights))
      w = 1.0_wp
      mean = 0.0_wp
      do i = 1, size(draws, 2)
         if (present(weights)) w = weights(i)
         mean = mean + w*draws(:, i)
      end do
      mean = mean/total
      sd = 0.0_wp
      do i = 1, size(draws, 2)
         if (present(weights)) w = weights(i)
         sd = sd + w*(draws(:, i) - mean)**2
      end do
      if (.not. present(weights)) total = max(1.0_wp, total - 1.0_wp)
      sd = sqrt(sd/total)
   end subroutine moments

   !> Unbiased covariance.
   pure function covariance_of(draws) result(covariance)
      !> (variable, draw).
      real(wp), intent(in) :: draws(:, :)
      real(wp) :: covariance(size(draws, 1), size(draws, 1))
      real(wp) :: mean(size(draws, 1)), deviation(size(draws, 1))
      integer :: i, j

      mean = sum(draws, 2)/size(draws, 2)
      covariance = 0.0_wp
      do i = 1, size(draws, 2)
         deviation = draws(:, i) - mean
         do j = 1, size(mean)
            covariance(:, j) = covariance(:, j) + deviation*deviation(j)
         end do
      end do
      covariance = covariance/max(1, size(draws, 2) - 1)
   end function covariance_of

   !> The values in ascending order.
   pure subroutine sorted_values(n, values, sorted)
      !> Number of values.
      integer, intent(in) :: n
      !> Of any rank.
      real(wp), intent(in) :: values(n)
      !> (n).
      real(wp), allocatable, intent(out) :: sorted(:)
      integer, allocatable :: order(:)

      allocate (order(n))
      call sort_order(values, order)
      sorted = values(order)
   end subroutine sorted_values

   !> The middle of the values.
   pure real(wp) function median(n, values)
      !> Number of values.
      integer, intent(in) :: n
      !> Of any rank.
      real(wp), intent(in) :: values(n)
      real(wp), allocatable :: sorted(:)

      call sorted_values(n, values, sorted)
      median = 0.5_wp*(sorted((n + 1)/2) + sorted(n/2 + 1))
   end function median

   !> Draws of chains one after another, (variable, draw).
   pure function flattened(draws) result(flat)
      !> (variable, sample, chain).
      real(wp), intent(in) :: draws(:, :, :)
      real(wp), allocatable :: flat(:, :)

      flat = reshape(draws, [size(draws, 1), size(draws, 2)*size(draws, 3)])
   end function flattened

   !> About so many draws of chains, evenly spaced in each, (variable, sample, chain).
   pure function thinned(draws, most) result(few)
      real(wp), intent(in) :: draws(:, :, :)
      !> Of all chains together.
      integer, intent(in) :: most
      real(wp), allocatable :: few(:, :, :)

      few = draws(:, ::max(1, int(size(draws, 2)*real(size(draws, 3), wp)/most)), :)
   end function thinned
end module statistics
