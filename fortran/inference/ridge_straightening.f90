!> Coordinates in which a curved ridge is straight: principal axes, the longest first, then each coordinate less a polynomial of the
!> earlier ones. The map keeps volumes up to a constant.
module ridge_straightening
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: add_gram, cholesky_factor, symmetric_eigen
   implicit none
   private
   public :: straightening_type, no_straightening, fit_straightening

   !> Of the polynomial: so many of the longest axes have cubes and fourth powers too, all have products of two.
   integer, parameter :: n_curved = 3

   type :: straightening_type
      private
      integer :: n = 0
      real(wp), allocatable :: centre(:), forward(:, :), backward(:, :), width(:)
      !> Coefficients of the features of z(1) .. z(j-1), for coordinate j.
      real(wp), allocatable :: bend(:, :)
      !> Range of each z in which the polynomial was fitted; beyond it goes on as at the end.
      real(wp), allocatable :: least(:), greatest(:)
   contains
      procedure :: to_straight
      procedure :: from_straight
   end type straightening_type

contains

   !> Number of features of the first m coordinates: 1, z, products of two, and of three and four of the first ones.
   pure integer function feature_count(m)
      integer, intent(in) :: m
      integer :: h

      h = min(m, n_curved)
      feature_count = 1 + m + m*(m + 1)/2 + h*(h + 1)*(h + 2)/6 + h*(h + 1)*(h + 2)*(h + 3)/24
   end function feature_count

   !> Those of fewer coordinates come first.
   pure subroutine evaluate_features(z, f)
      real(wp), intent(in) :: z(:)
      real(wp), intent(out) :: f(:)
      integer :: i, j, k, l, last

      f(1) = 1.0_wp
      last = 1
      do i = 1, size(z)
         f(last + 1) = z(i)
         f(last + 2:last + 1 + i) = z(i)*z(:i)
         last = last + 1 + i
         if (i > n_curved) cycle
         do j = 1, i
            do k = 1, j
               f(last + 1) = z(i)*z(j)*z(k)
               do l = 1, k
                  f(last + 1 + l) = z(i)*z(j)*z(k)*z(l)
               end do
               last = last + 1 + k
            end do
         end do
      end do
   end subroutine evaluate_features

   !> The map that changes nothing, in n dimensions.
   pure function no_straightening(n) result(straight)
      integer, intent(in) :: n
      type(straightening_type) :: straight
      integer :: j

      straight%n = n
      allocate (straight%centre(n), straight%forward(n, n), straight%bend(feature_count(n - 1), n), source=0.0_wp)
      allocate (straight%width(n), source=1.0_wp)
      do j = 1, n
         straight%forward(j, j) = 1.0_wp
      end do
      straight%backward = straight%forward
      straight%least = spread(-huge(1.0_wp), 1, n)
      straight%greatest = -straight%least
   end function no_straightening

   !> Fit the straightening to points.
   subroutine fit_straightening(points, straight)
      !> (dimension, point).
      real(wp), intent(in) :: points(:, :)
      type(straightening_type), intent(out) :: straight
      type(error_type), allocatable :: error
      real(wp), allocatable :: z(:, :), f(:, :), gram(:, :), rhs(:)
      real(wp) :: axes(size(points, 1), size(points, 1)), values(size(points, 1))
      integer :: n, many, i, j, m

      n = size(points, 1)
      many = size(points, 2)
      straight = no_straightening(n)
      straight%centre = sum(points, 2)/many
      allocate (z(n, many))
      do i = 1, many
         z(:, i) = points(:, i) - straight%centre
      end do
      axes = matmul(z, transpose(z))/many
      call symmetric_eigen(axes, values, error)
      if (allocated(error)) return
      ! The longest axis first, of unit variance.
      values = sqrt(max(values, 1.0e-16_wp*max(values(n), 1.0e-8_wp)))
      do j = 1, n
         straight%forward(j, :) = axes(:, n + 1 - j)/values(n + 1 - j)
         straight%backward(:, j) = axes(:, n + 1 - j)*values(n + 1 - j)
      end do
      z = matmul(straight%forward, z)
      straight%least = minval(z, 2)
      straight%greatest = maxval(z, 2)
      allocate (f(feature_count(n - 1), many), gram(feature_count(n - 1), feature_count(n - 1)))
      do i = 1, many
         call evaluate_features(z(:n - 1, i), f(:, i))
      end do
      gram = 0.0_wp
      call add_gram(f, 1.0_wp, gram, transposed=.false.)
      do i = 1, size(gram, 1)
         gram(i, i) = gram(i, i)*(1.0_wp + 1.0e-6_wp) + 1.0e-6_wp*many
      end do
      ! The features of coordinate j are the first ones, and so is their part of the factor.
      call cholesky_factor(gram, error)
      do j = 1, n
         m = feature_count(j - 1)
         if (.not. allocated(error)) then
            rhs = matmul(f(:m, :), z(j, :))
            call solve_leading(gram, rhs)
            straight%bend(:m, j) = rhs
         end if
         straight%width(j) = max(1.0e-8_wp, sqrt(sum((z(j, :) - matmul(straight%bend(:m, j), f(:m, :)))**2)/many))
      end do
   end subroutine fit_straightening

   !> x of (L Lᵀ) x = b with the leading part of a lower factor L, in place.
   pure subroutine solve_leading(factor, b)
      real(wp), intent(in) :: factor(:, :)
      real(wp), intent(inout) :: b(:)
      integer :: i, m

      m = size(b)
      do i = 1, m
         b(i) = b(i)/factor(i, i)
         b(i + 1:) = b(i + 1:) - factor(i + 1:m, i)*b(i)
      end do
      do i = m, 1, -1
         b(i) = (b(i) - sum(factor(i + 1:m, i)*b(i + 1:)))/factor(i, i)
      end do
   end subroutine solve_leading

   !> From working coordinates `w` to straight ones `u`.
   pure subroutine to_straight(self, w, u)
      class(straightening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: u(:)
      real(wp) :: z(self%n), f(size(self%bend, 1))
      integer :: j, m

      z = matmul(self%forward, w - self%centre)
      call evaluate_features(min(max(z(:self%n - 1), self%least(:self%n - 1)), self%greatest(:self%n - 1)), f)
      do j = 1, self%n
         m = feature_count(j - 1)
         u(j) = (z(j) - sum(self%bend(:m, j)*f(:m)))/self%width(j)
      end do
   end subroutine to_straight

   !> From straight coordinates `u` to working ones `w`.
   pure subroutine from_straight(self, u, w)
      class(straightening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: u(:)
      real(wp), intent(out) :: w(:)
      real(wp) :: z(self%n), within(self%n), f(size(self%bend, 1))
      integer :: j, m

      do j = 1, self%n
         m = feature_count(j - 1)
         call evaluate_features(within(:j - 1), f(:m))
         z(j) = u(j)*self%width(j) + sum(self%bend(:m, j)*f(:m))
         within(j) = min(max(z(j), self%least(j)), self%greatest(j))
      end do
      w = self%centre + matmul(self%backward, z)
   end subroutine from_straight
end module ridge_straightening
