!> Mixtures of normal densities: evaluate, draw, and fit to weighted points by expectation-maximisation.
module gaussian_mixture
   use kinds, only: pi, wp
   use random, only: random_stream_type
   use statistics, only: sort_order
   use linear_algebra, only: dot, exp_all
   implicit none
   private
   public :: mixture_type, new_mixture, log_mixture, draw_mixture, fit_mixture, widen_mixture

   type :: mixture_type
      integer :: n = 0, components = 0
      real(wp), allocatable :: weight(:), mean(:, :)
      !> Lower Cholesky factor of each covariance, factor(i, j, component), and its inverse, inverse(component, j, i).
      real(wp), allocatable :: factor(:, :, :), inverse(:, :, :)
      !> Means once more, centre(component, i): components are the innermost index where one point is evaluated.
      real(wp), allocatable, private :: centre(:, :)
      !> log of weight / (sqrt(2 pi)^n |factor|).
      real(wp), allocatable :: log_norm(:)
   end type mixture_type

contains

   !> One component for each of `components` runs of points in the order of their first coordinate.
   subroutine new_mixture(points, components, mixture)
      !> points(many, n).
      real(wp), intent(in), contiguous :: points(:, :)
      integer, intent(in) :: components
      type(mixture_type), intent(out) :: mixture
      real(wp), allocatable :: responsibility(:, :)
      integer :: order(size(points, 1)), i, many

      many = size(points, 1)
      call allocate_mixture(mixture, size(points, 2), components)
      call sort_order(points(:, 1), order)
      allocate (responsibility(many, components), source=0.0_wp)
      do i = 1, many
         responsibility(order(i), 1 + (i - 1)*components/many) = 1.0_wp
      end do
      call maximise(points, responsibility, mixture)
   end subroutine new_mixture

   pure subroutine allocate_mixture(mixture, n, components)
      type(mixture_type), intent(inout) :: mixture
      integer, intent(in) :: n, components

      mixture%n = n
      mixture%components = components
      allocate (mixture%weight(components), source=1.0_wp/components)
      allocate (mixture%log_norm(components), source=-1.0e30_wp)
      allocate (mixture%mean(n, components), mixture%centre(components, n), mixture%factor(n, n, components), &
         & mixture%inverse(components, n, n), source=0.0_wp)
   end subroutine allocate_mixture

   !> The logarithm of each component's share of the density at u.
   pure subroutine log_terms(n, components, centre, inverse, log_norm, u, terms)
      integer, intent(in) :: n, components
      real(wp), intent(in) :: centre(components, n), inverse(components, n, n), log_norm(components), u(n)
      real(wp), intent(out) :: terms(components)
      real(wp) :: z(components)
      integer :: m, i, j

      terms = log_norm
      do i = 1, n
         z = 0.0_wp
         do j = 1, i
            !$omp simd
            do m = 1, components
               z(m) = z(m) + inverse(m, j, i)*(u(j) - centre(m, j))
            end do
         end do
         !$omp simd
         do m = 1, components
            terms(m) = terms(m) - 0.5_wp*z(m)*z(m)
         end do
      end do
   end subroutine log_terms

   !> Logarithm of the density at `u`.
   pure real(wp) function log_mixture(mixture, u) result(value)
      type(mixture_type), intent(in) :: mixture
      real(wp), intent(in) :: u(:)
      real(wp) :: terms(mixture%components), shares(mixture%components), top

      call log_terms(mixture%n, mixture%components, mixture%centre, mixture%inverse, mixture%log_norm, u, terms)
      top = maxval(terms)
      terms = terms - top
      call exp_all(terms, shares)
      value = top + log(sum(shares))
   end function log_mixture

   !> A point `u` of the mixture.
   subroutine draw_mixture(mixture, stream, u)
      type(mixture_type), intent(in) :: mixture
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: u(:)
      real(wp) :: z(mixture%n), v, sum_of_weights
      integer :: m, i

      call stream%uniform(v)
      sum_of_weights = 0.0_wp
      do m = 1, mixture%components - 1
         sum_of_weights = sum_of_weights + mixture%weight(m)
         if (v < sum_of_weights) exit
      end do
      do i = 1, mixture%n
         call stream%normal(z(i))
      end do
      do i = 1, mixture%n
         u(i) = mixture%mean(i, m) + sum(mixture%factor(i, :i, m)*z(:i))
      end do
   end subroutine draw_mixture

   !> Some steps of expectation-maximisation on weighted points, points(many, n) with `weights` (many).
   subroutine fit_mixture(points, weights, steps, mixture)
      real(wp), intent(in), contiguous :: points(:, :), weights(:)
      integer, intent(in) :: steps
      type(mixture_type), intent(inout) :: mixture
      real(wp), allocatable :: responsibility(:, :), top(:), total(:), share(:)
      integer :: step, m, many

      many = size(points, 1)
      allocate (responsibility(many, mixture%components), top(many), total(many), share(many))
      do step = 1, steps
         top = -huge(1.0_wp)
         do m = 1, mixture%components
            call component_terms(many, mixture%n, points, mixture%mean(:, m), mixture%inverse(m, :, :), mixture%log_norm(m), &
               & responsibility(:, m))
            top = max(top, responsibility(:, m))
         end do
         total = 0.0_wp
         do m = 1, mixture%components
            responsibility(:, m) = responsibility(:, m) - top
            call exp_all(responsibility(:, m), share)
            responsibility(:, m) = share
            total = total + responsibility(:, m)
         end do
         total = weights/total
         do m = 1, mixture%components
            responsibility(:, m) = responsibility(:, m)*total
         end do
         call maximise(points, responsibility, mixture)
      end do
   end subroutine fit_mixture

   !> Logarithm of one component's share of the density at many points.
   pure subroutine component_terms(many, n, points, mean, inverse, log_norm, terms)
      integer, intent(in) :: many, n
      real(wp), intent(in) :: points(many, n), mean(n), inverse(n, n), log_norm
      real(wp), intent(out) :: terms(many)
      real(wp) :: z, quadratic
      integer :: p, i, j

      !$omp simd private(z, quadratic, i, j)
      do p = 1, many
         quadratic = 0.0_wp
         do i = 1, n
            z = 0.0_wp
            do j = 1, i
               z = z + inverse(j, i)*(points(p, j) - mean(j))
            end do
            quadratic = quadratic + z*z
         end do
         terms(p) = log_norm - 0.5_wp*quadratic
      end do
   end subroutine component_terms

   !> Weights, means and covariances from weighted responsibilities; a component that has lost its points is left out for good.
   subroutine maximise(points, responsibility, mixture)
      real(wp), intent(in), contiguous :: points(:, :), responsibility(:, :)
      type(mixture_type), intent(inout) :: mixture
      real(wp), parameter :: floor_variance = 1.0e-6_wp
      real(wp) :: totals(mixture%components), mean(mixture%n), covariance(mixture%n, mixture%n), total
      real(wp) :: weighted(size(points, 1))
      integer :: m, i, j, p

      do m = 1, mixture%components
         totals(m) = plain_sum(responsibility(:, m))
      end do
      mixture%weight = totals/sum(totals)
      do m = 1, mixture%components
         if (mixture%weight(m) < 1.0e-3_wp) then
            mixture%weight(m) = 0.0_wp
            mixture%log_norm(m) = -1.0e30_wp
            cycle
         end if
         do j = 1, mixture%n
            mean(j) = dot(responsibility(:, m), points(:, j))/totals(m)
         end do
         do j = 1, mixture%n
            !$omp simd
            do p = 1, size(weighted)
               weighted(p) = responsibility(p, m)*(points(p, j) - mean(j))
            end do
            do i = j, mixture%n
               total = 0.0_wp
               !$omp simd reduction(+:total)
               do p = 1, size(weighted)
                  total = total + weighted(p)*(points(p, i) - mean(i))
               end do
               covariance(i, j) = total/totals(m)
            end do
            covariance(j, j) = covariance(j, j)*(1.0_wp + 1.0e-6_wp) + floor_variance
         end do
         mixture%mean(:, m) = mean
         call set_covariance(mixture, m, covariance)
      end do
   end subroutine maximise

   pure real(wp) function plain_sum(a)
      real(wp), intent(in), contiguous :: a(:)
      integer :: i

      plain_sum = 0.0_wp
      !$omp simd reduction(+:plain_sum)
      do i = 1, size(a)
         plain_sum = plain_sum + a(i)
      end do
   end function plain_sum

   !> Factor the covariance (lower triangle) of a component.
   pure subroutine set_covariance(mixture, m, covariance)
      type(mixture_type), intent(inout) :: mixture
      integer, intent(in) :: m
      real(wp), intent(in) :: covariance(:, :)
      real(wp) :: l(mixture%n, mixture%n), inverse(mixture%n, mixture%n)
      integer :: i, j, n

      n = mixture%n
      l = 0.0_wp
      inverse = 0.0_wp
      do j = 1, n
         l(j, j) = sqrt(max(covariance(j, j) - sum(l(j, :j - 1)**2), 1.0e-12_wp))
         do i = j + 1, n
            l(i, j) = (covariance(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j)
         end do
      end do
      do j = 1, n
         inverse(j, j) = 1.0_wp/l(j, j)
         do i = j + 1, n
            inverse(i, j) = -sum(l(i, j:i - 1)*inverse(j:i - 1, j))/l(i, i)
         end do
      end do
      mixture%factor(:, :, m) = l
      mixture%inverse(m, :, :) = transpose(inverse)
      mixture%centre(m, :) = mixture%mean(:, m)
      mixture%log_norm(m) = log(max(mixture%weight(m), 1.0e-300_wp)) - 0.5_wp*n*log(2.0_wp*pi)
      do j = 1, n
         mixture%log_norm(m) = mixture%log_norm(m) - log(l(j, j))
      end do
   end subroutine set_covariance

   !> The mixture with heavier tails: a share `tails` of each component has `spread` times its covariance, the rest `inflation`
   !> times, and a share `whole` of all has the mean of the mixture and `spread` times its covariance.
   subroutine widen_mixture(mixture, wide)
      type(mixture_type), intent(in) :: mixture
      type(mixture_type), intent(out) :: wide
      real(wp), parameter :: inflation = 1.05_wp, tails = 0.1_wp, whole = 0.03_wp, spread = 4.0_wp
      real(wp) :: covariance(mixture%n, mixture%n), own(mixture%n, mixture%n), mean(mixture%n), d(mixture%n)
      integer :: m, j, n

      n = count(mixture%weight > 0.0_wp)
      call allocate_mixture(wide, mixture%n, 2*n + 1)
      mean = matmul(mixture%mean, mixture%weight)
      covariance = 0.0_wp
      n = 0
      do m = 1, mixture%components
         if (.not. mixture%weight(m) > 0.0_wp) cycle
         own = matmul(mixture%factor(:, :, m), transpose(mixture%factor(:, :, m)))
         wide%weight(n + 1) = (1.0_wp - whole)*(1.0_wp - tails)*mixture%weight(m)
         wide%weight(n + 2) = (1.0_wp - whole)*tails*mixture%weight(m)
         do j = 1, 2
            n = n + 1
            wide%mean(:, n) = mixture%mean(:, m)
            call set_covariance(wide, n, merge(inflation, spread, j == 1)*own)
         end do
         d = mixture%mean(:, m) - mean
         do j = 1, mixture%n
            covariance(:, j) = covariance(:, j) + mixture%weight(m)*(own(:, j) + d(j)*d)
         end do
      end do
      wide%weight(n + 1) = whole
      wide%mean(:, n + 1) = mean
      call set_covariance(wide, n + 1, spread*covariance)
   end subroutine widen_mixture
end module gaussian_mixture
