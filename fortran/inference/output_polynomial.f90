!> A polynomial for the smooth results of a model, between the points where it was evaluated.
!>
!> Chebyshev polynomials of a total degree in the principal coordinates of the points, each scaled to -1 .. 1, by least squares. It says
!> nothing of points out of that range.
module output_polynomial
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: add_gram, cholesky_factor, cholesky_solve, multiply, symmetric_eigen
   implicit none
   private
   public :: output_polynomial_type, is_fitted, fit_output_polynomial, polynomial_degree, polynomial_terms

   integer, parameter :: highest_degree = 8

   type :: output_polynomial_type
      private
      !> Numbers of coordinates and of terms; no terms, no polynomial.
      integer :: n = 0, n_terms = 0
      real(wp), allocatable :: centre(:), forward(:, :)
      !> Term k is the earlier term `parent(k)` times the Chebyshev polynomial of degree `power(k)` of coordinate `axis(k)`.
      integer, allocatable :: parent(:), axis(:), power(:)
      !> (output, term).
      real(wp), allocatable :: coefficients(:, :)
   contains
      procedure :: evaluate
   end type output_polynomial_type

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
      polynomial%n = n
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
      allocate (polynomial%coefficients(size(rhs, 2), size(rhs, 1)))
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
      real(wp) :: z(self%n), chebyshev(0:highest_degree, self%n)
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
end module output_polynomial
