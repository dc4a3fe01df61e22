!> A surrogate at fixed orientations, prepared for millions of crystals: what it predicts, and how its errors are shared.
!>
!> One set of coefficients predicts all grains, so their errors are correlated: the covariance of y between grains is K T(c) Kᵀ with K
!> the harmonics of the grains and T(c) a polynomial of the crystal's coordinates.
module grain_surrogate
   use kinds, only: wp
   use polynomial_products, only: covariance_polynomial, evaluate_products, new_products, products_type
   use small_matrices, only: factor_semidefinite
   use surrogate_basis, only: basis_type, coordinates_dimensionless, evaluate_harmonics, raw_coordinates
   use surrogate_model, only: surrogate_type
   use vector_math, only: exp_all, transposed_product
   implicit none
   private
   public :: grain_surrogate_type, new_grain_surrogate

   type :: grain_surrogate_type
      integer :: n_harmonics = 0, n_coordinates = 0
      !> Harmonics K(grain, harmonic) of the measured grains.
      real(wp), allocatable :: k(:, :)
      !> Variance of y that grains do not share.
      real(wp) :: scatter = 0.0_wp
      integer, private :: n_constants = 0
      logical, private :: dimensionless = .false.
      type(basis_type), private :: basis
      type(products_type), private :: terms, squares
      !> Coefficients A(q, h), and those of T(c).
      real(wp), allocatable, private :: coefficients(:, :), covariance(:, :)
   contains
      procedure :: harmonics
      procedure :: evaluate
      procedure :: moduli
      procedure :: covariance_factor
   end type grain_surrogate_type

contains

   !> The surrogate at n orientations.
   subroutine new_grain_surrogate(surrogate, n_constants, euler, uncertain, self)
      type(surrogate_type), intent(in) :: surrogate
      integer, intent(in) :: n_constants
      !> Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: euler(:, :)
      !> Prepare its covariance too.
      logical, intent(in) :: uncertain
      type(grain_surrogate_type), intent(out) :: self

      self%n_constants = n_constants
      self%basis = surrogate%basis
      self%n_harmonics = surrogate%basis%n_harmonics
      self%n_coordinates = surrogate%basis%n_coordinates
      self%dimensionless = surrogate%basis%coordinates == coordinates_dimensionless
      self%k = self%harmonics(euler)
      self%terms = new_products(surrogate%basis%degrees)
      self%coefficients = transpose(surrogate%coefficients)
      if (.not. uncertain) return
      self%scatter = surrogate%sd_inflation**2/surrogate%beta
      call covariance_polynomial(surrogate%basis, surrogate%sd_inflation**2*surrogate%covariance, self%squares, self%covariance)
   end subroutine new_grain_surrogate

   !> Harmonics (grain, harmonic) of any orientations.
   pure function harmonics(self, euler) result(k)
      class(grain_surrogate_type), intent(in) :: self
      !> Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: euler(:, :)
      real(wp), allocatable :: k(:, :)
      integer :: i

      allocate (k(size(euler, 2), self%n_harmonics))
      do i = 1, size(euler, 2)
         call evaluate_harmonics(self%basis, euler(:, i), k(i, :))
      end do
   end function harmonics

   !> y(h) = sum over q of A(h, q) P_q at a crystal, its scale s, and its coordinates in [-1, 1].
   pure subroutine evaluate(self, c, y, scale, x)
      class(grain_surrogate_type), intent(in) :: self
      !> GPa, (constant); more is ignored.
      real(wp), intent(in) :: c(:)
      !> (harmonic), GPa, (coordinate).
      real(wp), intent(out) :: y(:), scale, x(:)
      real(wp) :: p(self%terms%n_products)

      call raw_coordinates(self%basis%class, self%basis%coordinates, c(:self%n_constants), x, scale)
      x = (2.0_wp*x - self%basis%lower - self%basis%upper)/(self%basis%upper - self%basis%lower)
      call evaluate_products(self%terms, x, p)
      call transposed_product(self%terms%n_products, self%n_harmonics, self%coefficients, p, y)
   end subroutine evaluate

   !> Indentation modulus of grains, and its slope dM/dy, GPa.
   pure subroutine moduli(self, k, y, scale, modulus, slope)
      class(grain_surrogate_type), intent(in) :: self
      !> Harmonics of the grains, (grain, harmonic).
      real(wp), intent(in), contiguous :: k(:, :)
      !> Of `evaluate`.
      real(wp), intent(in) :: y(:), scale
      real(wp), intent(out), contiguous :: modulus(:), slope(:)
      integer :: i, h

      slope = 0.0_wp
      do h = 1, self%n_harmonics
         !$omp simd
         do i = 1, size(slope)
            slope(i) = slope(i) + k(i, h)*y(h)
         end do
      end do
      if (self%dimensionless) then
         call exp_all(slope, modulus)
         modulus = scale*modulus
         slope = modulus
      else
         modulus = slope
         slope = 1.0_wp
      end if
   end subroutine moduli

   !> Lower factor of T(c).
   pure subroutine covariance_factor(self, x, factor)
      class(grain_surrogate_type), intent(in) :: self
      !> Coordinates of the crystal, from `evaluate`.
      real(wp), intent(in) :: x(:)
      !> (harmonic, harmonic).
      real(wp), intent(out) :: factor(:, :)
      real(wp) :: p(self%squares%n_products), pairs(size(self%covariance, 2))
      integer :: g, first, n

      call evaluate_products(self%squares, x, p)
      call transposed_product(size(p), size(pairs), self%covariance, p, pairs)
      n = self%n_harmonics
      factor = 0.0_wp
      first = 1
      do g = 1, n
         factor(g:, g) = pairs(first:first + n - g)
         first = first + n - g + 1
      end do
      call factor_semidefinite(factor)
   end subroutine covariance_factor
end module grain_surrogate
