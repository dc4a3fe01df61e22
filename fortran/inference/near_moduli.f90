!> Moduli of the measured grains near some crystals: their inverse as polynomials of the crystal's compliances, by least squares over these
!> crystals. An inverse modulus is of the first order in the compliances, so that the polynomials hold beyond the crystals too: towards
!> stiffer ones compliances hardly change. To find proposals they are good enough, at a small part of what the moduli themselves cost.
module near_moduli
   use abstract_basis, only: grain_model_type
   use errors, only: error_type
   use kinds, only: wp
   use legendre_products, only: count_products, evaluate_products, legendre_products_type, new_legendre_products
   use linear_algebra, only: add_gram, cholesky_factor, cholesky_solve, multiply
   use logarithmic_coordinates, only: log_coordinates_type, log_frame_type
   use small_matrices, only: solve_lower
   implicit none
   private
   public :: near_moduli_type, new_near_moduli

   type :: near_moduli_type
      private
      type(legendre_products_type) :: products
      !> Of compliances s the coordinates in [-1, 1] are `to_cube` (s - centre).
      real(wp), allocatable :: centre(:), to_cube(:, :)
      !> Of the inverse moduli, or of the moduli if some are negative, (product, row of the grain model).
      real(wp), allocatable :: coefficients(:, :)
      !> The columns of the grain model at the crystal in the middle, (row, column).
      real(wp), allocatable, public :: columns(:, :)
      logical :: are_inverse = .false.
   contains
      procedure :: evaluate
   end type near_moduli_type

contains

   !> The richest polynomials that some crystals determine; `error` if there are none.
   subroutine new_near_moduli(grains, n_rows, logarithms, points, near, error)
      class(grain_model_type), intent(in) :: grains
      !> Moduli that it gives.
      integer, intent(in) :: n_rows
      type(log_coordinates_type), intent(in) :: logarithms
      !> Crystals in coordinates of log K, of which some are taken, (dimension, point).
      real(wp), intent(in), contiguous :: points(:, :)
      type(near_moduli_type), intent(out) :: near
      type(error_type), allocatable, intent(out) :: error
      !> Points for each product, those that must be there and those that are taken.
      integer, parameter :: highest = 8, most = 260, least_points = 4, enough_points = 12
      !> Of the diagonal, so that rounding does not matter.
      real(wp), parameter :: ridge = 1.0e-11_wp
      type(log_frame_type) :: frame
      real(wp), allocatable :: p(:, :), gram(:, :), moduli(:, :), x(:, :), c(:, :, :)
      real(wp) :: covariance(size(points, 1), size(points, 1))
      integer :: i, n, m

      m = size(points, 1)
      n = min(most, size(points, 2)/least_points)
      near%products = new_legendre_products(m, count([(count_products(m, i, .true.) <= n, i=1, highest)]), .true.)
      n = min(size(points, 2), enough_points*near%products%n_products)
      allocate (x(m, n), c(6, 6, n), moduli(n_rows, n), p(near%products%n_products, n))
      do i = 1, n
         call logarithms%from_logarithms(points(:, 1 + int((i - 1)*real(size(points, 2), wp)/n)), c(:, :, i), frame)
         x(:, i) = logarithms%compliances(frame)
      end do
      call grains%evaluate_crystals(c, moduli)
      allocate (near%columns(n_rows, grains%n_columns))
      call logarithms%from_logarithms(sum(points, 2)/size(points, 2), c(:, :, 1), frame)
      if (grains%n_columns > 0) call grains%evaluate_columns(c(:, :, 1), near%columns)
      near%are_inverse = all(moduli > 0.0_wp)
      if (near%are_inverse) moduli = 1.0_wp/moduli
      near%centre = sum(x, 2)/n
      x = x - spread(near%centre, 2, n)
      covariance = matmul(x, transpose(x))/n
      call cholesky_factor(covariance, error)
      if (allocated(error)) return
      near%to_cube = reshape([real(wp) ::], [m, m], [0.0_wp])
      do i = 1, m
         near%to_cube(i, i) = 1.0_wp
         call solve_lower(covariance, near%to_cube(:, i))
      end do
      near%to_cube = near%to_cube/spread(maxval(abs(matmul(near%to_cube, x)), 2), 2, m)
      do i = 1, n
         call evaluate_products(near%products, matmul(near%to_cube, x(:, i)), p(:, i))
      end do
      allocate (gram(size(p, 1), size(p, 1)), source=0.0_wp)
      call add_gram(p, 1.0_wp, gram, transposed=.false.)
      do i = 1, size(gram, 1)
         gram(i, i) = gram(i, i)*(1.0_wp + ridge)
      end do
      call cholesky_factor(gram, error)
      near%coefficients = matmul(p, transpose(moduli))
      if (.not. allocated(error)) call cholesky_solve(gram, near%coefficients)
   end subroutine new_near_moduli

   !> The moduli of some crystals.
   pure subroutine evaluate(self, compliances, moduli)
      class(near_moduli_type), intent(in) :: self
      !> As `log_coordinates_type` gives them, (dimension, crystal).
      real(wp), intent(in) :: compliances(:, :)
      !> GPa, (row of the grain model, crystal).
      real(wp), intent(out), contiguous :: moduli(:, :)
      real(wp) :: p(self%products%n_products, size(compliances, 2))
      integer :: i

      do i = 1, size(compliances, 2)
         call evaluate_products(self%products, matmul(self%to_cube, compliances(:, i) - self%centre), p(:, i))
      end do
      call multiply(self%coefficients, p, moduli, transposed=.true.)
      if (self%are_inverse) moduli = 1.0_wp/moduli
   end subroutine evaluate
end module near_moduli
