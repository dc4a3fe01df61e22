!> Coordinates in which a curved ridge is straight: principal axes, then each coordinate less a quadratic function of the
!> earlier ones. The map keeps volumes up to a constant.
module ridge_straightening
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_solve, symmetric_eigen
   implicit none
   private
   public :: straightening_type, fit_straightening

   type :: straightening_type
      private
      integer :: n = 0
      real(wp), allocatable :: centre(:), forward(:, :), backward(:, :), width(:)
      !> Coefficients of the features of z(1) .. z(j-1), for coordinate j.
      real(wp), allocatable :: bend(:, :)
   contains
      procedure :: to_straight
      procedure :: from_straight
   end type straightening_type

contains

   !> Number of features of the first m coordinates: 1, z, and products of two.
   pure integer function feature_count(m)
      integer, intent(in) :: m

      feature_count = 1 + m + m*(m + 1)/2
   end function feature_count

   pure subroutine evaluate_features(z, f)
      real(wp), intent(in) :: z(:)
      real(wp), intent(out) :: f(:)
      integer :: i, j, k

      f(1) = 1.0_wp
      f(2:1 + size(z)) = z
      k = 1 + size(z)
      do i = 1, size(z)
         do j = 1, i
            k = k + 1
            f(k) = z(i)*z(j)
         end do
      end do
   end subroutine evaluate_features

   !> Fit the straightening to points.
   subroutine fit_straightening(points, straight)
      real(wp), intent(in) :: points(:, :)
      type(straightening_type), intent(out) :: straight
      type(error_type), allocatable :: error
      real(wp), allocatable :: z(:, :), gram(:, :), rhs(:, :), f(:)
      real(wp) :: covariance(size(points, 1), size(points, 1)), values(size(points, 1)), spread(size(points, 1)), variance
      integer :: n, many, i, j, m

      n = size(points, 1)
      many = size(points, 2)
      straight%n = n
      straight%centre = sum(points, 2)/many
      do i = 1, n
         spread(i) = max(sqrt(sum((points(i, :) - straight%centre(i))**2)/many), 1.0e-12_wp)
      end do
      do j = 1, n
         do i = 1, n
            covariance(i, j) = sum((points(i, :) - straight%centre(i))*(points(j, :) - straight%centre(j))) &
               & /(many*spread(i)*spread(j))
         end do
         covariance(j, j) = covariance(j, j) + 1.0e-12_wp
      end do
      call symmetric_eigen(covariance, values, error)
      if (allocated(error)) then
         covariance = 0.0_wp
         do j = 1, n
            covariance(j, j) = 1.0_wp
         end do
         values = 1.0_wp
         deallocate (error)
      end if
      ! The longest axis first, of unit variance.
      values = sqrt(max(values, 1.0e-12_wp))
      allocate (straight%forward(n, n), straight%backward(n, n), straight%bend(feature_count(n - 1), n), straight%width(n))
      do j = 1, n
         straight%forward(j, :) = covariance(:, n + 1 - j)/(values(n + 1 - j)*spread)
         straight%backward(:, j) = covariance(:, n + 1 - j)*values(n + 1 - j)*spread
      end do
      allocate (z(n, many))
      do i = 1, many
         z(:, i) = matmul(straight%forward, points(:, i) - straight%centre)
      end do
      straight%bend = 0.0_wp
      do j = 1, n
         m = feature_count(j - 1)
         allocate (gram(m, m), rhs(m, 1), f(m))
         gram = 0.0_wp
         rhs = 0.0_wp
         do i = 1, many
            call evaluate_features(z(:j - 1, i), f)
            rhs(:, 1) = rhs(:, 1) + f*z(j, i)
            gram = gram + spread_product(f)
         end do
         do i = 1, m
            gram(i, i) = gram(i, i)*(1.0_wp + 1.0e-9_wp) + 1.0e-9_wp*many
         end do
         call cholesky_factor(gram, error)
         if (.not. allocated(error)) then
            call cholesky_solve(gram, rhs)
            straight%bend(:m, j) = rhs(:, 1)
         end if
         variance = 0.0_wp
         do i = 1, many
            call evaluate_features(z(:j - 1, i), f)
            variance = variance + (z(j, i) - sum(straight%bend(:m, j)*f))**2
         end do
         straight%width(j) = sqrt(max(variance/many, 1.0e-16_wp))
         deallocate (gram, rhs, f)
      end do
   end subroutine fit_straightening

   pure function spread_product(f) result(outer)
      real(wp), intent(in) :: f(:)
      real(wp) :: outer(size(f), size(f))
      integer :: i

      do i = 1, size(f)
         outer(:, i) = f*f(i)
      end do
   end function spread_product

   !> From working coordinates `w` to straight ones `u`.
   pure subroutine to_straight(self, w, u)
      class(straightening_type), intent(in) :: self
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: u(:)
      real(wp) :: z(self%n), f(feature_count(self%n - 1))
      integer :: j, m

      z = matmul(self%forward, w - self%centre)
      do j = 1, self%n
         m = feature_count(j - 1)
         call evaluate_features(z(:j - 1), f(:m))
         u(j) = (z(j) - sum(self%bend(:m, j)*f(:m)))/self%width(j)
      end do
   end subroutine to_straight

   !> From straight coordinates `u` to working ones `w`.
   pure subroutine from_straight(self, u, w)
      class(straightening_type), intent(in) :: self
      real(wp), intent(in) :: u(:)
      real(wp), intent(out) :: w(:)
      real(wp) :: z(self%n), f(feature_count(self%n - 1))
      integer :: j, m

      do j = 1, self%n
         m = feature_count(j - 1)
         call evaluate_features(z(:j - 1), f(:m))
         z(j) = u(j)*self%width(j) + sum(self%bend(:m, j)*f(:m))
      end do
      w = self%centre + matmul(self%backward, z)
   end subroutine from_straight
end module ridge_straightening
