!> A polynomial for the smooth results of a model, between the points where it was evaluated.
!>
!> Chebyshev polynomials of a total degree in the principal coordinates of the points, each scaled to -1 .. 1, by least squares. It says
!> nothing of points out of that range.
!>
!> And coordinates in which a curved ridge is straight: principal axes, the longest first, then each coordinate less a polynomial of the
!> earlier ones. That map keeps volumes up to a constant.
module output_polynomial
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: add_gram, cholesky_factor, cholesky_solve, multiply, symmetric_eigen
   use small_matrices, only: solve_lower, solve_upper
   implicit none
   private
   public :: output_polynomial_type, is_fitted, fit_output_polynomial, polynomial_degree, polynomial_terms, whitening_type, &
      & fit_whitening

   integer, parameter :: highest_degree = 8

   type :: output_polynomial_type
      private
      !> None: there is no polynomial.
      integer :: n_terms = 0
      real(wp), allocatable :: centre(:), forward(:, :)
      !> Term k is the earlier term `parent(k)` times the Chebyshev polynomial of degree `power(k)` of coordinate `axis(k)`.
      integer, allocatable :: parent(:), axis(:), power(:)
      !> (output, term).
      real(wp), allocatable :: coefficients(:, :)
   contains
      procedure :: evaluate
   end type output_polynomial_type

   !> Of a polynomial, by its richness: how many of the longest axes have products of two, of three, of four. All have linear terms.
   integer, parameter :: richest = 5
   integer, parameter :: axes_with(2:4, 0:richest) = reshape([0, 0, 0, 3, 0, 0, 5, 3, 0, 8, 4, 3, 20, 6, 3, 20, 8, 4], &
      & [3, richest + 1])
   !> Points for each term.
   integer, parameter :: points_a_term = 10

   type :: whitening_type
      private
      integer :: n = 0
      real(wp), allocatable :: centre(:), forward(:, :), backward(:, :), width(:)
      !> A feature is a product of coordinates z: feature k is the earlier feature `parent(k)` times the coordinate `axis(k)`, and those of
      !> the first m coordinates are the first `n_features(m)`, m from 0.
      integer, allocatable :: parent(:), axis(:), n_features(:)
      !> Coefficients of the features of z(1) .. z(j-1), for coordinate j.
      real(wp), allocatable :: bend(:, :)
      !> Range of each z in which the polynomial was fitted; beyond it goes on as at the end.
      real(wp), allocatable :: least(:), greatest(:)
   contains
      procedure :: to_white, from_white
   end type whitening_type

contains

   !> The highest degree, up to 8, with no more than `most_terms`; at least 1.
   pure integer function polynomial_degree(n, most_terms) result(degree)
      !> Number of coordinates.
      integer, intent(in) :: n
      integer, intent(in) :: most_terms

      do degree = highest_degree, 2, -1
         if (polynomial_terms(n, degree) <= most_terms) return
      end do
   end function polynomial_degree

   !> Number of terms: binomial of n + degree over degree.
   pure integer function polynomial_terms(n, degree) result(terms)
      !> Number of coordinates.
      integer, intent(in) :: n
      integer, intent(in) :: degree
      integer :: k

      terms = 1
      do k = 1, degree
         terms = terms*(n + k)/k
      end do
   end function polynomial_terms

   !> Whether there is anything to evaluate.
   pure logical function is_fitted(self)
      type(output_polynomial_type), intent(in), optional :: self

      is_fitted = .false.
      if (present(self)) is_fitted = self%n_terms > 0
   end function is_fitted

   !> Fit of a `degree` to the outputs at some points; nothing is fitted if these do not determine it.
   subroutine fit_output_polynomial(points, outputs, degree, polynomial)
      !> (coordinate, point), (output, point).
      real(wp), intent(in) :: points(:, :), outputs(:, :)
      integer, intent(in) :: degree
      type(output_polynomial_type), intent(out) :: polynomial
      !> Of the sum of squares of a term, added.
      real(wp), parameter :: ridge = 1.0e-9_wp
      type(error_type), allocatable :: error
      real(wp) :: axes(size(points, 1), size(points, 1)), widths(size(points, 1))
      real(wp), allocatable :: z(:, :), f(:, :), gram(:, :), rhs(:, :), turned(:, :)
      integer :: n, many, i
      logical :: inside

      n = size(points, 1)
      many = size(points, 2)
      call list_terms(n, degree, polynomial)
      polynomial%centre = sum(points, 2)/many
      z = points - spread(polynomial%centre, 2, many)
      axes = matmul(z, transpose(z))/many
      call symmetric_eigen(axes, widths, error)
      if (allocated(error)) return
      z = matmul(transpose(axes), z)
      ! The ends of the range are -1 and 1.
      widths = 0.5_wp*(maxval(z, 2) - minval(z, 2))
      if (.not. all(widths > 0.0_wp)) return
      polynomial%centre = polynomial%centre + matmul(axes, 0.5_wp*(maxval(z, 2) + minval(z, 2)))
      polynomial%forward = transpose(axes)/spread(widths, 2, n)
      allocate (f(size(polynomial%parent), many), gram(size(polynomial%parent), size(polynomial%parent)), &
         & rhs(size(polynomial%parent), size(outputs, 1)))
      do i = 1, many
         call evaluate_terms(polynomial, points(:, i), f(:, i), inside, huge(1.0_wp))
      end do
      gram = 0.0_wp
      call add_gram(f, 1.0_wp, gram, transposed=.false.)
      do i = 1, size(gram, 1)
         gram(i, i) = gram(i, i)*(1.0_wp + ridge) + ridge
      end do
      call cholesky_factor(gram, error)
      if (allocated(error)) return
      ! As an argument it would be on the stack.
      allocate (turned(many, size(outputs, 1)))
      turned = transpose(outputs)
      call multiply(f, turned, rhs)
      call cholesky_solve(gram, rhs)
      polynomial%coefficients = transpose(rhs)
      polynomial%n_terms = size(gram, 1)
   end subroutine fit_output_polynomial

   !> All products of a total degree, the constant first.
   pure subroutine list_terms(n, degree, polynomial)
      integer, intent(in) :: n, degree
      type(output_polynomial_type), intent(inout) :: polynomial
      integer, allocatable :: total(:)
      integer :: k, axis, power

      allocate (polynomial%parent(1), polynomial%axis(1), polynomial%power(1), total(1), source=0)
      do axis = 1, n
         do k = 1, size(total)
            do power = 1, degree - total(k)
               polynomial%parent = [polynomial%parent, k]
               polynomial%axis = [polynomial%axis, axis]
               polynomial%power = [polynomial%power, power]
               total = [total, total(k) + power]
            end do
         end do
      end do
   end subroutine list_terms

   pure subroutine evaluate_terms(self, w, f, inside, range)
      class(output_polynomial_type), intent(in) :: self
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: f(:)
      !> Whether no coordinate is further out than that; the terms only if so.
      logical, intent(out) :: inside
      real(wp), intent(in) :: range
      real(wp) :: z(size(w)), chebyshev(0:highest_degree, size(w))
      integer :: k

      z = matmul(self%forward, w - self%centre)
      inside = all(abs(z) <= range)
      if (.not. inside) return
      chebyshev(0, :) = 1.0_wp
      chebyshev(1, :) = z
      do k = 2, highest_degree
         chebyshev(k, :) = 2.0_wp*z*chebyshev(k - 1, :) - chebyshev(k - 2, :)
      end do
      f(1) = 1.0_wp
      do k = 2, size(f)
         f(k) = f(self%parent(k))*chebyshev(self%power(k), self%axis(k))
      end do
   end subroutine evaluate_terms

   !> The outputs at a point, if it is inside the range of the points of the fit.
   pure subroutine evaluate(self, w, outputs, inside)
      class(output_polynomial_type), intent(in) :: self
      !> (coordinate).
      real(wp), intent(in) :: w(:)
      !> (output).
      real(wp), intent(out) :: outputs(:)
      logical, intent(out) :: inside
      !> A little further out it still holds.
      real(wp), parameter :: range = 1.05_wp
      real(wp) :: f(self%n_terms)
      integer :: k, last

      call evaluate_terms(self, w, f, inside, range)
      if (.not. inside) return
      last = mod(self%n_terms, 4)
      outputs = 0.0_wp
      do k = 1, last
         outputs = outputs + f(k)*self%coefficients(:, k)
      end do
      do k = last + 1, self%n_terms, 4
         outputs = outputs + (f(k)*self%coefficients(:, k) + f(k + 1)*self%coefficients(:, k + 1)) &
            & + (f(k + 2)*self%coefficients(:, k + 2) + f(k + 3)*self%coefficients(:, k + 3))
      end do
   end subroutine evaluate

   !> The features of m coordinates: of each, after those of the earlier ones, z(i), then its products with itself and these.
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
         do power = 2, 4
            if (i > axes_with(power, richness)) exit
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
   pure subroutine evaluate_features(self, z, first, f)
      type(whitening_type), intent(in) :: self
      real(wp), intent(in) :: z(:)
      integer, intent(in) :: first
      real(wp), intent(inout) :: f(:)
      integer :: k

      do k = first, self%n_features(size(z))
         f(k) = f(self%parent(k))*z(self%axis(k))
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
      real(wp), allocatable :: z(:, :), f(:, :), gram(:, :), rhs(:)
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
      do i = 1, many
         call evaluate_features(whitening, z(:n - 1, i), 2, f(:, i))
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
         whitening%width(j) = max(1.0e-8_wp, sqrt(sum((z(j, :) - matmul(whitening%bend(:m, j), f(:m, :)))**2)/many))
      end do
   end subroutine fit_whitening

   !> From working coordinates `w` to whitened ones `u`.
   pure subroutine to_white(self, w, u)
      class(whitening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: u(:)
      real(wp) :: z(self%n), f(size(self%bend, 1))
      integer :: j, m

      z = matmul(self%forward, w - self%centre)
      f(1) = 1.0_wp
      call evaluate_features(self, min(max(z(:self%n - 1), self%least(:self%n - 1)), self%greatest(:self%n - 1)), 2, f)
      do j = 1, self%n
         m = self%n_features(j - 1)
         u(j) = (z(j) - sum(self%bend(:m, j)*f(:m)))/self%width(j)
      end do
   end subroutine to_white

   !> From whitened coordinates `u` to working ones `w`.
   pure subroutine from_white(self, u, w)
      class(whitening_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: u(:)
      real(wp), intent(out) :: w(:)
      real(wp) :: z(self%n), within(self%n), f(size(self%bend, 1)), bent
      integer :: j, k, m

      f(1) = 1.0_wp
      do j = 1, self%n
         m = self%n_features(j - 1)
         bent = 0.0_wp
         !$omp simd reduction(+:bent)
         do k = 1, m
            bent = bent + self%bend(k, j)*f(k)
         end do
         z(j) = u(j)*self%width(j) + bent
         within(j) = min(max(z(j), self%least(j)), self%greatest(j))
         if (j < self%n) call evaluate_features(self, within(:j), m + 1, f)
      end do
      w = self%centre + matmul(self%backward, z)
   end subroutine from_white

end module output_polynomial
