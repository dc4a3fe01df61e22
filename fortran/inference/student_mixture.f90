!> Mixtures of Student's t densities, whose tails are longer than those of a posterior: evaluate,
!> draw, and fit to weighted points by expectation-maximisation.
!>
!> The density of a component is c q^-m with q = 1 + z²/f and m = (f + n)/2, where z is the distance
!> from its mean in sds, f are the degrees of freedom and n is the dimension.
module student_mixture
   use kinds, only: pi, wp
   use linear_algebra, only: multiply
   use random, only: random_stream_type
   use small_matrices, only: factor_definite, solve_lower
   use statistics, only: sort_order
   implicit none
   private
   public :: mixture_type, new_mixture, log_mixture, draw_mixture, fit_mixture, widen_mixture

   type :: mixture_type
      !> Dimension, number of components, and degrees of freedom of each: 4 or 5, so that `power`,
      !> the m above, is a whole number.
      integer :: n = 0, components = 0, freedom = 0, power = 0
      !> Means, mean(component, i). The component is the innermost index of the loops that evaluate
      !> a point.
      real(wp), allocatable :: weight(:), mean(:, :)
      !> Lower Cholesky factor of the scale matrix of each component, factor(i, j, component), and
      !> its inverse, inverse(component, j, i).
      real(wp), allocatable :: factor(:, :, :), inverse(:, :, :)
      !> The c of each component times its weight.
      real(wp), allocatable :: height(:)
   end type mixture_type

contains

   !> Start with one component for each of `components` runs of points, sorted by their first
   !> coordinate.
   subroutine new_mixture(points, components, mixture)
      !> (n, n_points).
      real(wp), intent(in), contiguous :: points(:, :)
      integer, intent(in) :: components
      type(mixture_type), intent(out) :: mixture
      real(wp), allocatable :: responsibility(:, :)
      integer :: order(size(points, 2)), i, n_points

      n_points = size(points, 2)
      mixture = allocated_mixture(size(points, 1), components)
      call sort_order(points(1, :), order)
      allocate (responsibility(components, n_points), source=0.0_wp)
      do i = 1, n_points
         responsibility(1 + (i - 1)*components/n_points, order(i)) = 1.0_wp
      end do
      call maximise(products_of(points), responsibility, sum(responsibility, 2), mixture)
   end subroutine new_mixture

   pure type(mixture_type) function allocated_mixture(n, components) result(mixture)
      integer, intent(in) :: n, components

      mixture%n = n
      mixture%components = components
      mixture%freedom = 4 + mod(n, 2)
      mixture%power = (mixture%freedom + n)/2
      allocate (mixture%weight(components), source=1.0_wp/components)
      allocate (mixture%height(components), source=0.0_wp)
      allocate (mixture%mean(components, n), mixture%factor(n, n, components), &
         & mixture%inverse(components, n, n), source=0.0_wp)
   end function allocated_mixture

   !> Each component's share of the density at u, and its q.
   pure subroutine evaluate_components(mixture, u, shares, q)
      type(mixture_type), intent(in) :: mixture
      real(wp), intent(in) :: u(mixture%n)
      real(wp), intent(out) :: shares(mixture%components), q(mixture%components)
      real(wp) :: z(mixture%components)
      integer :: i, j

      q = 0.0_wp
      do i = 1, mixture%n
         z = 0.0_wp
         do j = 1, i
            z = z + mixture%inverse(:, j, i)*(u(j) - mixture%mean(:, j))
         end do
         q = q + z*z
      end do
      q = 1.0_wp + q/mixture%freedom
      z = 1.0_wp/q
      shares = mixture%height
      do i = 1, mixture%power
         shares = shares*z
      end do
   end subroutine evaluate_components

   !> Logarithm of the density at `u`.
   pure real(wp) function log_mixture(mixture, u) result(value)
      type(mixture_type), intent(in) :: mixture
      real(wp), intent(in), contiguous :: u(:)
      real(wp), dimension(mixture%components) :: shares, q

      call evaluate_components(mixture, u, shares, q)
      value = log(max(sum(shares), tiny(1.0_wp)))
   end function log_mixture

   !> A point `u` of the mixture.
   subroutine draw_mixture(mixture, stream, u)
      type(mixture_type), intent(in) :: mixture
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: u(:)
      real(wp) :: z(mixture%n), g(mixture%freedom), v, sum_of_weights
      integer :: m, i

      call stream%uniform(v)
      sum_of_weights = 0.0_wp
      do m = 1, mixture%components - 1
         sum_of_weights = sum_of_weights + mixture%weight(m)
         if (v < sum_of_weights) exit
      end do
      call stream%normals(z)
      call stream%normals(g)
      z = z/sqrt(sum(g**2)/mixture%freedom)
      do i = 1, mixture%n
         u(i) = mixture%mean(m, i) + sum(mixture%factor(i, :i, m)*z(:i))
      end do
   end subroutine draw_mixture

   !> Make some steps of expectation-maximisation. In the means and scale matrices a point counts
   !> less the farther it is (Kent, Tyler & Vardi, Communications in Statistics 23, 441, 1994).
   subroutine fit_mixture(points, weights, steps, mixture)
      !> (n, n_points), (n_points).
      real(wp), intent(in), contiguous :: points(:, :), weights(:)
      integer, intent(in) :: steps
      type(mixture_type), intent(inout) :: mixture
      real(wp), allocatable :: responsibility(:, :), products(:, :)
      real(wp), dimension(mixture%components) :: shares, q, of_component
      integer :: step, p

      products = products_of(points)
      allocate (responsibility(mixture%components, size(weights)))
      do step = 1, steps
         of_component = 0.0_wp
         do p = 1, size(weights)
            call evaluate_components(mixture, points(:, p), shares, q)
            shares = weights(p)/max(sum(shares), tiny(1.0_wp))*shares
            of_component = of_component + shares
            responsibility(:, p) = shares/q
         end do
         call maximise(products, responsibility, of_component, mixture)
      end do
   end subroutine fit_mixture

   !> The number 1, the coordinates and their products of each point, (point, product). Weights,
   !> means and covariances follow from their sums.
   pure function products_of(points) result(products)
      !> (n, n_points).
      real(wp), intent(in) :: points(:, :)
      real(wp), allocatable :: products(:, :)
      integer :: i, j, n

      n = size(points, 1)
      allocate (products(size(points, 2), (n + 1)*(n + 2)/2))
      products(:, 1) = 1.0_wp
      products(:, 2:n + 1) = transpose(points)
      do concurrent(i=1:n, j=1:n, i <= j)
         products(:, 1 + n + (j - 1)*j/2 + i) = products(:, 1 + i)*products(:, 1 + j)
      end do
   end function products_of

   !> Compute weights, means and scale matrices from weighted responsibilities. A component with
   !> less than a thousandth of the weight is left out for good.
   subroutine maximise(products, responsibility, of_component, mixture)
      !> (n_points, product), (component, n_points).
      real(wp), intent(in), contiguous :: products(:, :), responsibility(:, :)
      !> Sum of the weights of each component's points, (component).
      real(wp), intent(in) :: of_component(:)
      type(mixture_type), intent(inout) :: mixture
      real(wp), parameter :: floor_variance = 1.0e-6_wp
      real(wp) :: sums(mixture%components, size(products, 2)), covariance(mixture%n, mixture%n)
      integer :: m, j, last

      call multiply(responsibility, products, sums)
      mixture%weight = of_component/sum(of_component)
      do m = 1, mixture%components
         if (mixture%weight(m) < 1.0e-3_wp) then
            mixture%weight(m) = 0.0_wp
            mixture%height(m) = 0.0_wp
            cycle
         end if
         sums(m, 2:) = sums(m, 2:)/sums(m, 1)
         mixture%mean(m, :) = sums(m, 2:mixture%n + 1)
         do j = 1, mixture%n
            last = 1 + mixture%n + (j - 1)*j/2
            covariance(j, :j) = sums(m, last + 1:last + j) - mixture%mean(m, j)*mixture%mean(m, :j)
            covariance(j, j) = max(0.0_wp, covariance(j, j))*(1.0_wp + 1.0e-6_wp) + floor_variance
         end do
         call set_factor(mixture, m, factor_of(covariance))
      end do
   end subroutine maximise

   !> The lower factor of a covariance that is positive definite to rounding, with zeros above.
   pure function factor_of(covariance) result(factor)
      real(wp), intent(in) :: covariance(:, :)
      real(wp) :: factor(size(covariance, 1), size(covariance, 1))
      integer :: j

      factor = covariance
      call factor_definite(factor, 0.0_wp)
      do j = 2, size(factor, 1)
         factor(:j - 1, j) = 0.0_wp
      end do
   end function factor_of

   !> Set the factor of the scale matrix of component m, its inverse and its height.
   pure subroutine set_factor(mixture, m, factor)
      type(mixture_type), intent(inout) :: mixture
      integer, intent(in) :: m
      real(wp), intent(in) :: factor(:, :)
      real(wp) :: column(mixture%n)
      integer :: j

      mixture%factor(:, :, m) = factor
      associate (f => real(mixture%freedom, wp), n => mixture%n)
         mixture%height(m) = mixture%weight(m)*gamma(0.5_wp*(f + n))/gamma(0.5_wp*f) &
            & /(f*pi)**(0.5_wp*n)
      end associate
      do j = 1, mixture%n
         column = 0.0_wp
         column(j) = 1.0_wp
         call solve_lower(factor, column)
         mixture%inverse(m, j, :) = column
         mixture%height(m) = mixture%height(m)/factor(j, j)
      end do
   end subroutine set_factor

   !> The mixture with a further component of the weight `whole`, that has the mean of all and
   !> `wider` times their covariance.
   subroutine widen_mixture(mixture, wide)
      type(mixture_type), intent(in) :: mixture
      type(mixture_type), intent(out) :: wide
      real(wp), parameter :: whole = 0.05_wp, wider = 3.0_wp
      real(wp) :: covariance(mixture%n, mixture%n), mean(mixture%n), d(mixture%n)
      integer :: m, n

      n = count(mixture%weight > 0.0_wp)
      wide = allocated_mixture(mixture%n, n + 1)
      mean = matmul(mixture%weight, mixture%mean)
      covariance = 0.0_wp
      n = 0
      do m = 1, mixture%components
         if (.not. mixture%weight(m) > 0.0_wp) cycle
         n = n + 1
         wide%weight(n) = (1.0_wp - whole)*mixture%weight(m)
         wide%mean(n, :) = mixture%mean(m, :)
         call set_factor(wide, n, mixture%factor(:, :, m))
         d = mixture%mean(m, :) - mean
         covariance = covariance + mixture%weight(m)*(matmul(mixture%factor(:, :, m), &
            & transpose(mixture%factor(:, :, m))) + spread(d, 1, mixture%n)*spread(d, 2, mixture%n))
      end do
      wide%weight(n + 1) = whole
      wide%mean(n + 1, :) = mean
      call set_factor(wide, n + 1, sqrt(wider)*factor_of(covariance))
   end subroutine widen_mixture
end module student_mixture
