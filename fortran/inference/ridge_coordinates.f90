!> Coordinates in which a curved ridge is straight. They are the principal axes, the longest first.
!> A polynomial of the earlier coordinates is subtracted from each. The map keeps volumes up to a
!> constant factor.
module ridge_coordinates
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, gram_of, symmetric_eigen
   use small_matrices, only: solve_lower, solve_upper
   implicit none
   private
   public :: whitening_type, fit_whitening

   !> Number of the longest axes that have products of 2, 3, .. 8 factors in a polynomial, for each
   !> richness 0 .. 6. All axes have linear terms.
   integer, parameter :: richest = 6, most_factors = 8
   integer, parameter :: axes_with(2:most_factors, 0:richest) = reshape([ &
      & 0, 0, 0, 0, 0, 0, 0, &
      & 3, 0, 0, 0, 0, 0, 0, &
      & 5, 3, 0, 0, 0, 0, 0, &
      & 8, 4, 3, 1, 0, 0, 0, &
      & 20, 6, 3, 1, 1, 0, 0, &
      & 20, 8, 4, 2, 1, 1, 1, &
      & 20, 8, 4, 2, 2, 2, 1], [most_factors - 1, richest + 1])
   !> Most dimensions with products of more than four factors, and with tangents beyond the points.
   !> For more dimensions they would only fit noise.
   integer, parameter :: few_dimensions = 5
   !> A polynomial continues along its tangent over this share of its range.
   real(wp), parameter :: tangent_share = 0.12_wp
   !> Distinct points needed for each term of a polynomial.
   integer, parameter :: points_a_term = 10

   type :: whitening_type
      !> Logarithm of the ratio of a volume in working coordinates to that in whitened ones.
      real(wp) :: log_volume = 0.0_wp
      integer, private :: n = 0
      !> Mean of the points; maps to their principal axes z, which have unit variance, and back; sd
      !> of z minus its polynomial, for each axis.
      real(wp), allocatable, private :: centre(:), forward(:, :), backward(:, :), width(:)
      !> A feature is a product of coordinates z. The first is 1. Feature k is the earlier feature
      !> `parent(k)` times the coordinate `axis(k)`. The features of the first m coordinates are the
      !> first `n_features(m)`, m from 0.
      integer, allocatable, private :: parent(:), axis(:), n_features(:)
      !> Coefficients of the features of z(1) .. z(j-1), for coordinate j.
      real(wp), allocatable, private :: coefficients(:, :)
      !> Range of each z in which the polynomial was fitted. Beyond it the polynomial continues
      !> along its tangent, see `tangent_share`, and is constant from there on.
      real(wp), allocatable, private :: least(:), greatest(:)
   contains
      procedure :: to_white, from_white
   end type whitening_type

contains

   !> List the features of m coordinates. Those of z(i) follow those of the earlier coordinates:
   !> z(i) itself, then its products with itself and with the earlier ones.
   pure subroutine list_features(m, richness, whitening)
      integer, intent(in) :: m
      !> 0 to `richest`.
      integer, intent(in) :: richness
      type(whitening_type), intent(inout) :: whitening
      integer :: i, j, k, power, first, last

      whitening%parent = [0]
      whitening%axis = [0]
      if (allocated(whitening%n_features)) deallocate (whitening%n_features)
      allocate (whitening%n_features(0:m), source=1)
      do i = 1, m
         whitening%parent = [whitening%parent, 1]
         whitening%axis = [whitening%axis, i]
         first = size(whitening%axis)
         do power = 2, most_factors
            if (i > axes_with(power, richness)) exit
            ! The last dimension has no features.
            if (power > 4 .and. m + 1 > few_dimensions) exit
            last = size(whitening%axis)
            do k = first, last
               whitening%parent = [whitening%parent, spread(k, 1, whitening%axis(k))]
               whitening%axis = [whitening%axis, (j, j=1, whitening%axis(k))]
            end do
            ! The next products are those with one factor more.
            first = last + 1
         end do
         whitening%n_features(i) = size(whitening%axis)
      end do
   end subroutine list_features

   !> Evaluate the features of coordinates from feature `first` on. The earlier features are given.
   pure subroutine evaluate_features(self, z, first, f, tangent)
      type(whitening_type), intent(in) :: self
      real(wp), intent(in), contiguous :: z(:)
      integer, intent(in) :: first
      !> Features at the nearest point of the range, and their changes along the tangent there.
      real(wp), intent(inout) :: f(:), tangent(:)
      real(wp), dimension(size(z)) :: nearest, excess
      integer :: k

      nearest = min(max(z, self%least(:size(z))), self%greatest(:size(z)))
      excess = merge(tangent_share, 0.0_wp, self%n <= few_dimensions)*(self%greatest(:size(z)) &
         & - self%least(:size(z)))
      excess = min(max(z - nearest, -excess), excess)
      do k = first, self%n_features(size(z))
         f(k) = f(self%parent(k))*nearest(self%axis(k))
         tangent(k) = tangent(self%parent(k))*nearest(self%axis(k)) &
            & + f(self%parent(k))*excess(self%axis(k))
      end do
   end subroutine evaluate_features

   !> Fit the whitening to points.
   subroutine fit_whitening(points, distinct, whitening)
      !> (dimension, point).
      real(wp), intent(in) :: points(:, :)
      !> Number of distinct points.
      integer, intent(in) :: distinct
      type(whitening_type), intent(out) :: whitening
      type(error_type), allocatable :: error
      real(wp), allocatable :: z(:, :), f(:, :), gram(:, :), rhs(:), tangent(:)
      real(wp) :: axes(size(points, 1), size(points, 1)), values(size(points, 1))
      integer :: n, n_points, i, j, m, richness

      n = size(points, 1)
      n_points = size(points, 2)
      whitening%n = n
      do richness = richest, 0, -1
         call list_features(n - 1, richness, whitening)
         m = size(whitening%axis)
         if (points_a_term*m <= distinct) exit
      end do
      allocate (whitening%coefficients(m, n), source=0.0_wp)
      allocate (whitening%width(n))
      whitening%centre = sum(points, 2)/n_points
      z = points - spread(whitening%centre, 2, n_points)
      axes = matmul(z, transpose(z))/n_points
      call symmetric_eigen(axes, values, error)
      ! Sort the axes, the longest first, and scale them to unit variance. No axis is
      ! shorter than 1e-8 of the longest one.
      values = sqrt(max(values(n:1:-1), 1.0e-16_wp*max(values(n), 1.0e-8_wp)))
      axes = axes(:, n:1:-1)
      whitening%forward = transpose(axes/spread(values, 1, n))
      whitening%backward = axes*spread(values, 1, n)
      z = matmul(whitening%forward, z)
      whitening%least = minval(z, 2)
      whitening%greatest = maxval(z, 2)
      allocate (f(m, n_points), source=1.0_wp)
      allocate (tangent(m), source=0.0_wp)
      do i = 1, n_points
         call evaluate_features(whitening, z(:n - 1, i), 2, f(:, i), tangent)
      end do
      gram = gram_of(f)
      ! A small ridge term for features that depend on each other.
      do i = 1, size(gram, 1)
         gram(i, i) = gram(i, i)*(1.0_wp + 1.0e-6_wp) + 1.0e-6_wp*n_points
      end do
      ! Coordinate j depends on the first m features only, and the factor of their Gram matrix is
      ! the leading block of the whole one. Without a factor the polynomials are 0.
      call cholesky_factor(gram, error)
      do j = 1, n
         m = whitening%n_features(j - 1)
         if (.not. allocated(error)) then
            rhs = matmul(f(:m, :), z(j, :))
            call solve_lower(gram, rhs)
            call solve_upper(gram, rhs)
            whitening%coefficients(:m, j) = rhs
         end if
         whitening%width(j) = max(1.0e-8_wp, &
            & sqrt(sum((z(j, :) - matmul(whitening%coefficients(:m, j), f(:m, :)))**2)/n_points))
      end do
      whitening%log_volume = sum(log(values)) + sum(log(whitening%width))
   end subroutine fit_whitening

   !> From working coordinates `w` to whitened ones `u`.
   pure subroutine to_white(self, w, u)
      class(whitening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in), contiguous :: w(:)
      real(wp), intent(out), contiguous :: u(:)
      real(wp) :: z(self%n), f(size(self%coefficients, 1)), tangent(size(f))
      integer :: j, m

      z = matmul(self%forward, w - self%centre)
      f(1) = 1.0_wp
      tangent(1) = 0.0_wp
      call evaluate_features(self, z(:self%n - 1), 2, f, tangent)
      do j = 1, self%n
         m = self%n_features(j - 1)
         u(j) = (z(j) - sum(self%coefficients(:m, j)*(f(:m) + tangent(:m))))/self%width(j)
      end do
   end subroutine to_white

   !> From whitened coordinates `u` to working ones `w`.
   pure subroutine from_white(self, u, w)
      class(whitening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in), contiguous :: u(:)
      real(wp), intent(out), contiguous :: w(:)
      real(wp) :: z(self%n), f(size(self%coefficients, 1)), tangent(size(f)), shift
      integer :: j, k, m

      f(1) = 1.0_wp
      tangent(1) = 0.0_wp
      do j = 1, self%n
         m = self%n_features(j - 1)
         shift = 0.0_wp
         !$omp simd reduction(+:shift)
         do k = 1, m
            shift = shift + self%coefficients(k, j)*(f(k) + tangent(k))
         end do
         z(j) = u(j)*self%width(j) + shift
         if (j < self%n) call evaluate_features(self, z(:j), m + 1, f, tangent)
      end do
      w = self%centre + matmul(self%backward, z)
   end subroutine from_white

end module ridge_coordinates
