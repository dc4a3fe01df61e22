!> Coordinates in which a curved ridge is straight: principal axes, the longest first, then each
!> coordinate less a polynomial of the earlier ones. The map keeps volumes up to a constant.
module ridge_coordinates
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: add_gram, cholesky_factor, symmetric_eigen
   use small_matrices, only: solve_lower, solve_upper
   implicit none
   private
   public :: whitening_type, fit_whitening

   !> Of a polynomial, by its richness: how many of the longest axes have products of two, of three
   !> and so on. All have linear terms.
   integer, parameter :: richest = 6, most_factors = 8
   integer, parameter :: axes_with(2:most_factors, 0:richest) = reshape([0, 0, 0, 0, 0, 0, 0, 3, &
      & 0, 0, 0, 0, 0, 0, 5, 3, 0, 0, 0, 0, 0, 8, 4, 3, 1, 0, 0, 0, 20, 6, 3, 1, 1, 0, 0, 20, 8, &
      & 4, 2, 1, 1, 1, 20, 8, 4, 2, 2, 2, 1], [most_factors - 1, richest + 1])
   !> From so many axes on, the last one not counted, products of more than four and the tangents
   !> beyond the points would be noise.
   integer, parameter :: many_axes = 5
   !> Points for each term.
   integer, parameter :: points_a_term = 10

   type :: whitening_type
      private
      integer :: n = 0
      real(wp), allocatable :: centre(:), forward(:, :), backward(:, :), width(:)
      !> A feature is a product of coordinates z: feature k is the earlier feature `parent(k)` times
      !> the coordinate `axis(k)`, and those of the first m coordinates are the first
      !> `n_features(m)`, m from 0.
      integer, allocatable :: parent(:), axis(:), n_features(:)
      !> Coefficients of the features of z(1) .. z(j-1), for coordinate j.
      real(wp), allocatable :: bend(:, :)
      !> Range of each z in which the polynomial was fitted; beyond it goes on along its tangent for
      !> 12 % of the range, then as it is there.
      real(wp), allocatable :: least(:), greatest(:)
   contains
      procedure :: to_white, from_white
   end type whitening_type

contains

   !> The features of m coordinates: of each, after those of the earlier ones, z(i), then its
   !> products with itself and these.
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
            if (i > axes_with(power, richness) .or. (power > 4 .and. m >= many_axes)) exit
            last = size(whitening%axis)
            do k = first, last
               whitening%parent = [whitening%parent, spread(k, 1, whitening%axis(k))]
               whitening%axis = [whitening%axis, (j, j=1, whitening%axis(k))]
            end do
            first = last + 1
         end do
         whitening%n_features(i) = size(whitening%axis)
      end do
   end subroutine list_features

   !> The features of coordinates from the number `first` on, those before it being there.
   pure subroutine evaluate_features(self, z, first, f, tangent)
      type(whitening_type), intent(in) :: self
      real(wp), intent(in), contiguous :: z(:)
      integer, intent(in) :: first
      !> Features at the nearest point of the range, and what the tangent there adds to them.
      real(wp), intent(inout) :: f(:), tangent(:)
      real(wp), dimension(size(z)) :: within, further
      integer :: k

      within = min(max(z, self%least(:size(z))), self%greatest(:size(z)))
      further = merge(0.12_wp, 0.0_wp, &
         & self%n <= many_axes)*(self%greatest(:size(z)) - self%least(:size(z)))
      further = min(max(z - within, -further), further)
      do k = first, self%n_features(size(z))
         f(k) = f(self%parent(k))*within(self%axis(k))
         tangent(k) = tangent(self%parent(k))*within(self%axis(k)) &
            & + f(self%parent(k))*further(self%axis(k))
      end do
   end subroutine evaluate_features

   !> Fit the whitening to points.
   subroutine fit_whitening(points, distinct, whitening)
      !> (dimension, point).
      real(wp), intent(in) :: points(:, :)
      !> How many of the points are not copies.
      integer, intent(in) :: distinct
      type(whitening_type), intent(out) :: whitening
      type(error_type), allocatable :: error
      real(wp), allocatable :: z(:, :), f(:, :), gram(:, :), rhs(:), tangent(:)
      real(wp) :: axes(size(points, 1), size(points, 1)), values(size(points, 1))
      integer :: n, many, i, j, m, richness

      n = size(points, 1)
      many = size(points, 2)
      whitening%n = n
      do richness = richest, 0, -1
         call list_features(n - 1, richness, whitening)
         m = size(whitening%axis)
         if (points_a_term*m <= distinct) exit
      end do
      allocate (whitening%bend(m, n), source=0.0_wp)
      allocate (whitening%width(n))
      whitening%centre = sum(points, 2)/many
      z = points - spread(whitening%centre, 2, many)
      axes = matmul(z, transpose(z))/many
      call symmetric_eigen(axes, values, error)
      if (allocated(error)) then
         values = 1.0_wp
         axes = reshape([1.0_wp, (spread(0.0_wp, 1, n), 1.0_wp, j=2, n)], [n, n])
      end if
      ! The longest axis first, of unit variance.
      values = sqrt(max(values(n:1:-1), 1.0e-16_wp*max(values(n), 1.0e-8_wp)))
      axes = axes(:, n:1:-1)
      whitening%forward = transpose(axes/spread(values, 1, n))
      whitening%backward = axes*spread(values, 1, n)
      z = matmul(whitening%forward, z)
      whitening%least = minval(z, 2)
      whitening%greatest = maxval(z, 2)
      allocate (f(m, many), source=1.0_wp)
      allocate (tangent(m), source=0.0_wp)
      do i = 1, many
         call evaluate_features(whitening, z(:n - 1, i), 2, f(:, i), tangent)
      end do
      allocate (gram(m, m), source=0.0_wp)
      call add_gram(f, 1.0_wp, gram, transposed=.false.)
      do i = 1, size(gram, 1)
         gram(i, i) = gram(i, i)*(1.0_wp + 1.0e-6_wp) + 1.0e-6_wp*many
      end do
      ! The features of coordinate j are the first ones, and so is their part of the factor.
      call cholesky_factor(gram, error)
      do j = 1, n
         m = whitening%n_features(j - 1)
         if (.not. allocated(error)) then
            rhs = matmul(f(:m, :), z(j, :))
            call solve_lower(gram, rhs)
            call solve_upper(gram, rhs)
            whitening%bend(:m, j) = rhs
         end if
         whitening%width(j) = max(1.0e-8_wp, &
            & sqrt(sum((z(j, :) - matmul(whitening%bend(:m, j), f(:m, :)))**2)/many))
      end do
   end subroutine fit_whitening

   !> From working coordinates `w` to whitened ones `u`.
   pure subroutine to_white(self, w, u)
      class(whitening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in), contiguous :: w(:)
      real(wp), intent(out), contiguous :: u(:)
      real(wp) :: z(self%n), f(size(self%bend, 1)), tangent(size(f))
      integer :: j, m

      z = matmul(self%forward, w - self%centre)
      f(1) = 1.0_wp
      tangent(1) = 0.0_wp
      call evaluate_features(self, z(:self%n - 1), 2, f, tangent)
      do j = 1, self%n
         m = self%n_features(j - 1)
         u(j) = (z(j) - sum(self%bend(:m, j)*(f(:m) + tangent(:m))))/self%width(j)
      end do
   end subroutine to_white

   !> From whitened coordinates `u` to working ones `w`.
   pure subroutine from_white(self, u, w)
      class(whitening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in), contiguous :: u(:)
      real(wp), intent(out), contiguous :: w(:)
      real(wp) :: z(self%n), f(size(self%bend, 1)), tangent(size(f)), bent
      integer :: j, k, m

      f(1) = 1.0_wp
      tangent(1) = 0.0_wp
      do j = 1, self%n
         m = self%n_features(j - 1)
         bent = 0.0_wp
         !$omp simd reduction(+:bent)
         do k = 1, m
            bent = bent + self%bend(k, j)*(f(k) + tangent(k))
         end do
         z(j) = u(j)*self%width(j) + bent
         if (j < self%n) call evaluate_features(self, z(:j), m + 1, f, tangent)
      end do
      w = self%centre + matmul(self%backward, z)
   end subroutine from_white

end module ridge_coordinates
