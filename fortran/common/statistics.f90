!> Order, moments and order statistics of samples; the distribution of chi-square; and the detection
!> of equal points.
module statistics
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use kinds, only: wp
   implicit none
   private
   public :: moments, covariance_of, sorted_values, median, flattened, thinned, chi_square_above, &
      & sort_order, number_equal

   interface
      pure subroutine c_sort_order(n, values, order) bind(c, name='bayesindent_sort_order')
         import
         integer(c_int), value :: n
         real(c_double), intent(in) :: values(*)
         integer(c_int), intent(out) :: order(*)
      end subroutine c_sort_order
      pure subroutine c_number_equal(coordinates, n, points, numbers) &
         & bind(c, name='bayesindent_number_equal')
         import
         integer(c_int), value :: coordinates, n
         real(c_double), intent(in) :: points(*)
         integer(c_int), intent(out) :: numbers(*)
      end subroutine c_number_equal
   end interface

contains

   !> Indices that sort the values, ascending; equal values keep their order.
   pure subroutine sort_order(values, order)
      real(wp), intent(in) :: values(:)
      integer, intent(out) :: order(:)

      call c_sort_order(size(values), values, order)
   end subroutine sort_order

   !> Mean and sd of each variable. The variance is unbiased if there are no weights.
   pure subroutine moments(draws, mean, sd, weights)
      !> (variable, draw).
      real(wp), intent(in) :: draws(:, :)
      !> (variable).
      real(wp), intent(out) :: mean(:), sd(:)
      !> (draw), not negative; default: equal weights.
      real(wp), intent(in), optional :: weights(:)
      real(wp) :: w(size(draws, 2)), total, deviations(size(draws, 1), size(draws, 2))

      w = 1.0_wp
      if (present(weights)) w = weights
      total = max(tiny(1.0_wp), sum(w))
      mean = matmul(draws, w)/total
      deviations = draws - spread(mean, 2, size(w))
      sd = matmul(deviations**2, w)
      if (.not. present(weights)) total = max(1.0_wp, total - 1.0_wp)
      sd = sqrt(sd/total)
   end subroutine moments

   !> Unbiased covariance.
   pure function covariance_of(draws) result(covariance)
      !> (variable, draw).
      real(wp), intent(in) :: draws(:, :)
      real(wp) :: covariance(size(draws, 1), size(draws, 1)), &
         & deviations(size(draws, 1), size(draws, 2))

      deviations = draws - spread(sum(draws, 2)/size(draws, 2), 2, size(draws, 2))
      covariance = matmul(deviations, transpose(deviations))/max(1, size(draws, 2) - 1)
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

   !> Median of the values.
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

   !> Draws that are evenly spaced in each chain, (variable, draw).
   pure function thinned(draws, most) result(few)
      !> (variable, sample, chain).
      real(wp), intent(in) :: draws(:, :, :)
      !> Approximate number of draws, of all chains together.
      integer, intent(in) :: most
      real(wp), allocatable :: few(:, :)

      few = flattened(draws(:, ::max(1, int(size(draws, 2)*real(size(draws, 3), wp)/most)), :))
   end function thinned

   !> Probability that chi-square with `freedom` degrees of freedom is above `value`. For a whole
   !> number of them the incomplete gamma function is a finite sum (Abramowitz and Stegun 26.4.4,
   !> 26.4.5).
   pure real(wp) function chi_square_above(value, freedom) result(share)
      real(wp), intent(in) :: value
      !> At least 1.
      integer, intent(in) :: freedom
      real(wp) :: x, odd
      integer :: i

      x = max(0.5_wp*value, tiny(1.0_wp))
      odd = 0.5_wp*mod(freedom, 2)
      share = sum([(exp((i + odd)*log(x) - x - log_gamma(i + odd + 1.0_wp)), i=0, freedom/2 - 1)])
      if (odd > 0.0_wp) share = share + erfc(sqrt(x))
   end function chi_square_above

   !> For each of the `points`, the index of the first equal one. 0 equals -0, and NaN equals 0.
   pure function number_equal(points) result(numbers)
      !> (coordinate, point).
      real(wp), intent(in) :: points(:, :)
      integer :: numbers(size(points, 2))

      call c_number_equal(size(points, 1), size(points, 2), &
         & merge(points, 0.0_wp, abs(points) > 0.0_wp), numbers)
   end function number_equal

end module statistics
