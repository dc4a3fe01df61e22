!> Moduli of very many grains of one crystal from those in a few directions.
!>
!> The modulus depends on the indented direction alone and is smooth: an even function on the sphere with the crystal's symmetry, which few
!> surface harmonics hold. They are found by least squares from the moduli in directions spread over the region of distinct ones; a grain
!> then costs as many products as there are harmonics. Who uses it compares with the theory, see `field_degree`.
module modulus_expansion
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: rotation_matrix
   use distinct_directions, only: new_region, region_type, spread_of_directions
   use errors, only: error_type
   use kinds, only: pi, wp
   use linear_algebra, only: add_gram, cholesky_factor, cholesky_solve
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, largest_degree, new_group_harmonics
   implicit none
   private
   public :: modulus_expansion_type, new_modulus_expansion

   !> Fewer grains are computed each.
   integer, parameter :: many_grains = 500
   !> By how much the degree is above that of the compliance, and directions for each harmonic.
   integer, parameter :: finer = 8
   real(wp), parameter :: oversampling = 2.0_wp

   type :: modulus_expansion_type
      !> Whether there are so many grains that it is worth it; only then there is what follows.
      logical :: pays = .false.
      !> Microseconds of `expand`, about.
      real(wp) :: cost = 0.0_wp
      !> Bunge-Euler angles of the directions that are computed, (3, direction), radians.
      real(wp), allocatable :: euler(:, :)
      !> From their moduli to coefficients, (harmonic, direction), and from these to grains, (grain, harmonic).
      real(wp), allocatable, private :: fit(:, :), reading(:, :)
   contains
      procedure :: expand
   end type modulus_expansion_type

contains

   !> The expansion for some grains.
   subroutine new_modulus_expansion(class, degree, euler, expansion, error)
      type(crystal_class_type), intent(in) :: class
      !> Of the harmonics of the compliance, even.
      integer, intent(in) :: degree
      !> Bunge-Euler angles of the grains, radians (3, n).
      real(wp), intent(in) :: euler(:, :)
      type(modulus_expansion_type), intent(out) :: expansion
      type(error_type), allocatable, intent(out) :: error
      type(harmonics_type) :: harmonics
      type(region_type) :: region
      real(wp), allocatable :: directions(:, :), values(:, :), gram(:, :), of_grain(:)
      real(wp) :: g(3, 3)
      integer :: i, n

      n = size(euler, 2)
      if (n < many_grains) return
      call new_group_harmonics(class%generators, min(largest_degree, degree + finer), harmonics, error)
      if (allocated(error)) return
      call new_region(class, region)
      call spread_of_directions(region, ceiling(oversampling*harmonics%n) + 8, directions)
      expansion%pays = n > 2*size(directions, 2)
      if (.not. expansion%pays) return
      allocate (expansion%euler(3, size(directions, 2)), source=0.0_wp)
      allocate (values(harmonics%n, size(directions, 2)), gram(harmonics%n, harmonics%n), source=0.0_wp)
      do i = 1, size(directions, 2)
         ! The third row of g is not needed: the indented direction is its third column, (sin phi2 sin Phi, cos phi2 sin Phi, cos Phi).
         expansion%euler(2, i) = acos(min(1.0_wp, max(-1.0_wp, directions(3, i))))
         expansion%euler(3, i) = modulo(atan2(directions(1, i), directions(2, i)), 2.0_wp*pi)
         call evaluate_harmonics(harmonics, directions(:, i), values(:, i))
      end do
      call add_gram(values, 1.0_wp, gram, transposed=.false.)
      call cholesky_factor(gram, error)
      if (allocated(error)) return
      call cholesky_solve(gram, values)
      call move_alloc(values, expansion%fit)
      allocate (expansion%reading(n, harmonics%n), of_grain(harmonics%n))
      do i = 1, n
         g = rotation_matrix(euler(:, i))
         call evaluate_harmonics(harmonics, g(:, 3), of_grain)
         expansion%reading(i, :) = of_grain
      end do
      expansion%cost = 0.0007_wp*size(expansion%reading)
   end subroutine new_modulus_expansion

   !> Moduli of the grains from those of the directions, GPa.
   pure subroutine expand(self, of_directions, moduli)
      class(modulus_expansion_type), intent(in) :: self
      !> (direction).
      real(wp), intent(in) :: of_directions(:)
      !> (grain).
      real(wp), intent(out), contiguous :: moduli(:)
      !> Grains at a time.
      integer, parameter :: block = 256
      real(wp) :: coefficients(size(self%fit, 1))
      integer :: first, last, h

      coefficients = matmul(self%fit, of_directions)
      do first = 1, size(moduli), block
         last = min(first + block - 1, size(moduli))
         moduli(first:last) = 0.0_wp
         do h = 1, size(coefficients)
            moduli(first:last) = moduli(first:last) + coefficients(h)*self%reading(first:last, h)
         end do
      end do
   end subroutine expand
end module modulus_expansion
