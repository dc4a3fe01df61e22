!> Order, moments and order statistics of samples; the distribution of chi-square; and points to the last bit among many: a hash table of
!> their bits, so that a look-up does not depend on how many there are.
module statistics
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use kinds, only: i8, wp
   implicit none
   private
   public :: moments, covariance_of, sorted_values, median, flattened, thinned, chi_square_above, sort_order, point_index_type, &
      & new_point_index, number_equal

   interface
      pure subroutine c_sort_order(n, values, order) bind(c, name='bayesindent_sort_order')
         import :: c_double, c_int
         integer(c_int), value :: n
         real(c_double), intent(in) :: values(*)
         integer(c_int), intent(out) :: order(*)
      end subroutine c_sort_order
   end interface

   type :: point_index_type
      private
      !> (coordinate, point).
      real(wp), allocatable :: points(:, :)
      !> Numbers of points, 0 where a place is free; a point is in the first free place from that of its hash on.
      integer, allocatable :: places(:)
      !> The next point that is the same as each, 0 where there is none.
      integer, allocatable :: next(:)
   contains
      procedure :: find
   end type point_index_type

contains

   !> Indices that sort the values, ascending; equal values keep their order.
   pure subroutine sort_order(values, order)
      real(wp), intent(in) :: values(:)
      integer, intent(out) :: order(:)

      call c_sort_order(size(values), values, order)
   end subroutine sort_order

   !> Mean and sd of each variable; the sd is unbiased, or with weights not.
   pure subroutine moments(draws, mean, sd, weights)
      !> (variable, draw).
      real(wp), intent(in) :: draws(:, :)
      !> (variable).
      real(wp), intent(out) :: mean(:), sd(:)
      !> (draw), not negative; default: all the same.
      real(wp), intent(in), optional :: weights(:)
      real(wp) :: w(size(draws, 2)), total
      integer :: i

      w = 1.0_wp
      if (present(weights)) w = weights
      total = max(tiny(1.0_wp), sum(w))
      mean = 0.0_wp
      do i = 1, size(draws, 2)
         mean = mean + w(i)*draws(:, i)
      end do
      mean = mean/total
      sd = 0.0_wp
      do i = 1, size(draws, 2)
         sd = sd + w(i)*(draws(:, i) - mean)**2
      end do
      if (.not. present(weights)) total = max(1.0_wp, total - 1.0_wp)
      sd = sqrt(sd/total)
   end subroutine moments

   !> Unbiased covariance.
   pure function covariance_of(draws) result(covariance)
      !> (variable, draw).
      real(wp), intent(in) :: draws(:, :)
      real(wp) :: covariance(size(draws, 1), size(draws, 1)), mean(size(draws, 1)), deviation(size(draws, 1))
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

   !> The probability that chi-square with `freedom` degrees of freedom is above `value`: the incomplete gamma function Q(k/2, x/2), by its
   !> series below the mean and by its continued fraction above (Abramowitz and Stegun 6.5.29, 6.5.31).
   pure real(wp) function chi_square_above(value, freedom) result(share)
      real(wp), intent(in) :: value
      !> At least 1.
      integer, intent(in) :: freedom
      integer, parameter :: most_terms = 100000
      real(wp) :: a, x, term, total, b, c, d
      integer :: i

      a = 0.5_wp*freedom
      x = 0.5_wp*value
      if (x <= 0.0_wp) then
         share = 1.0_wp
      else if (x < a + 1.0_wp) then
         term = 1.0_wp/a
         total = term
         do i = 1, most_terms
            term = term*x/(a + i)
            total = total + term
            if (term < epsilon(total)*total) exit
         end do
         share = 1.0_wp - total*exp(a*log(x) - x - log_gamma(a))
      else
         b = x + 1.0_wp - a
         c = 1.0_wp/tiny(c)
         d = 1.0_wp/b
         total = d
         do i = 1, most_terms
            b = b + 2.0_wp
            term = -i*(i - a)
            d = 1.0_wp/(term*d + b)
            c = b + term/c
            total = total*d*c
            if (abs(d*c - 1.0_wp) < epsilon(total)) exit
         end do
         share = total*exp(a*log(x) - x - log_gamma(a))
      end if
   end function chi_square_above

   !> The index of `points`, which may be there more than once.
   pure subroutine new_point_index(points, index)
      !> (coordinate, point).
      real(wp), intent(in) :: points(:, :)
      type(point_index_type), intent(out) :: index
      integer :: last(size(points, 2)), j, k

      index%points = points
      allocate (index%places(0:2*size(points, 2)), index%next(size(points, 2)), source=0)
      do j = 1, size(points, 2)
         k = place_of(index, points(:, j))
         if (index%places(k) == 0) then
            index%places(k) = j
         else
            index%next(last(index%places(k))) = j
         end if
         last(index%places(k)) = j
      end do
   end subroutine new_point_index

   !> The same number for equal `points`: that of the first.
   pure function number_equal(points) result(numbers)
      !> (coordinate, point).
      real(wp), intent(in) :: points(:, :)
      integer :: numbers(size(points, 2))
      type(point_index_type) :: index
      integer :: j

      call new_point_index(points, index)
      numbers = [(index%places(place_of(index, points(:, j))), j=1, size(points, 2))]
   end function number_equal

   !> The numbers of all that are this `point`, none if there is none.
   pure subroutine find(self, point, numbers)
      class(point_index_type), intent(in) :: self
      !> (coordinate).
      real(wp), intent(in) :: point(:)
      integer, allocatable, intent(out) :: numbers(:)
      integer :: j

      allocate (numbers(0))
      j = self%places(place_of(self, point))
      do while (j > 0)
         numbers = [numbers, j]
         j = self%next(j)
      end do
   end subroutine find

   !> The place of a point, or the free one where it would be: from that of its hash on (Fowler, Noll and Vo's over numbers, its high bits
   !> mixed into the low ones; products wrap around).
   pure integer function place_of(self, point) result(place)
      type(point_index_type), intent(in) :: self
      real(wp), intent(in) :: point(:)
      integer(i8), parameter :: prime = 1099511628211_i8, basis = -3750763034362895579_i8
      integer(i8) :: hash
      integer :: i

      hash = basis
      do i = 1, size(point)
         ! Both zeros are the same.
         hash = ieor(hash, merge(transfer(point(i), hash), 0_i8, abs(point(i)) > 0.0_wp))*prime
         hash = ieor(hash, ishft(hash, -32))
      end do
      place = int(modulo(hash, size(self%places, kind=i8)))
      do while (self%places(place) > 0)
         if (.not. any(abs(self%points(:, self%places(place)) - point) > 0.0_wp)) return
         place = modulo(place + 1, size(self%places))
      end do
   end function place_of

end module statistics
