!> Surface harmonics of even degree that are invariant under a group of rotations: for each degree
!> the common kernel of Y(g x) - Y(x) for the generators g. (The inversion leaves all even harmonics
!> unchanged.)
!>
!> They are orthonormal for the mean over the sphere, the first is 1. Within a degree they are
!> Gram-Schmidt vectors of the projector's columns in the order m = 0, cos 1, sin 1, cos 2, ..; the
!> component of that column is positive.
module symmetric_harmonics
   use errors, only: error_type
   use kinds, only: pi, wp
   use linear_algebra, only: symmetric_eigen
   implicit none
   private
   public :: harmonics_type, new_harmonics, evaluate_harmonics, evaluate_real, n_real_harmonics, &
      & largest_degree

   integer, parameter :: largest_degree = 32

   type :: harmonics_type
      !> Number of harmonics.
      integer :: n = 0
      !> Degree of each, (n).
      integer, allocatable :: degrees(:)
      !> Coefficients of each in the real harmonics of its degree, m = 0, cos 1, sin 1, .., (2
      !> highest degree + 1, n).
      real(wp), allocatable, private :: combination(:, :)
   end type harmonics_type

contains

   !> The harmonics of the group that rotations generate, such as the group of a crystal's
   !> stiffness.
   subroutine new_harmonics(generators, bandlimit, harmonics, error)
      !> Proper rotations, (3, 3, n).
      real(wp), intent(in) :: generators(:, :, :)
      !> Highest degree, even, 0 to `largest_degree`.
      integer, intent(in) :: bandlimit
      type(harmonics_type), intent(out) :: harmonics
      type(error_type), allocatable, intent(out) :: error
      !> Points of the half sphere, on a spiral with the golden angle between successive points.
      real(wp) :: points(3, (bandlimit + 1)*(bandlimit + 2)), z
      real(wp), parameter :: turn = pi*(3.0_wp - sqrt(5.0_wp))
      real(wp), allocatable :: reference(:), change(:, :, :), invariant(:, :), values(:)
      integer :: l, a, g, i, n, n_points

      n_points = size(points, 2)
      n = n_points/2
      allocate (reference(n), change(n, n_points, size(generators, 3)), values(2*bandlimit + 1))
      do i = 1, n_points
         z = (i - 0.5_wp)/n_points
         points(:, i) = [sqrt(1.0_wp - z**2)*cos(turn*i), sqrt(1.0_wp - z**2)*sin(turn*i), z]
         call evaluate_real(bandlimit, points(:, i), reference)
         do g = 1, size(generators, 3)
            call evaluate_real(bandlimit, matmul(generators(:, :, g), points(:, i)), &
               & change(:, i, g))
            change(:, i, g) = (change(:, i, g) - reference)/sqrt(real(n_points, wp))
         end do
      end do
      allocate (harmonics%degrees(0), harmonics%combination(2*bandlimit + 1, 0))
      do l = 0, bandlimit, 2
         a = l*(l - 1)/2
         ! The sum over the generators g of |Y(g x) - Y(x)|^2 as a quadratic form of the
         ! coefficients: its kernel is invariant.
         invariant = reshape(change(a + 1:a + 2*l + 1, :, :), [2*l + 1, size(change)/n])
         invariant = matmul(invariant, transpose(invariant))
         call symmetric_eigen(invariant, values(:2*l + 1), error)
         if (allocated(error)) return
         invariant = invariant(:, :count(values(:2*l + 1) < 1.0e-8_wp))
         call append_degree()
      end do
      harmonics%n = size(harmonics%degrees)

   contains

      !> Append the harmonics of degree l: the Gram-Schmidt vectors of the columns of the projector
      !> onto the span of the orthonormal columns of `invariant`, (2 l + 1, n).
      subroutine append_degree()
         real(wp) :: vector(size(harmonics%combination, 1)), norm
         integer :: pivot, j, sweep, before

         before = size(harmonics%degrees)
         do pivot = 1, size(invariant, 1)
            vector = 0.0_wp
            vector(:size(invariant, 1)) = matmul(invariant, invariant(pivot, :))
            do sweep = 1, 2
               do j = before + 1, size(harmonics%degrees)
                  associate (unit => harmonics%combination(:, j))
                     vector = vector - dot_product(unit, vector)*unit
                  end associate
               end do
            end do
            norm = norm2(vector)
            ! The squared norms of the remainders of all columns sum to the number of missing
            ! vectors, so at least one of them is as long as this.
            if (norm**2 < 0.5_wp/size(invariant, 1)) cycle
            where (abs(vector) < 1.0e-12_wp*norm) vector = 0.0_wp
            harmonics%degrees = [harmonics%degrees, l]
            harmonics%combination = reshape(harmonics%combination, &
               & [size(vector), size(harmonics%degrees)], vector/norm)
         end do
      end subroutine append_degree
   end subroutine new_harmonics

   !> Number of all real harmonics of even degree.
   pure integer function n_real_harmonics(bandlimit)
      !> Highest degree, even.
      integer, intent(in) :: bandlimit

      n_real_harmonics = (bandlimit + 1)*(bandlimit + 2)/2
   end function n_real_harmonics

   !> All real harmonics of even degree, degree by degree, m = 0, cos 1, sin 1, .., by the
   !> recurrence in the degree of the normalised Legendre functions over sin^m.
   pure subroutine evaluate_real(bandlimit, direction, values)
      !> Highest degree, even.
      integer, intent(in) :: bandlimit
      !> Unit vector.
      real(wp), intent(in) :: direction(3)
      !> ((bandlimit + 1) (bandlimit + 2)/2).
      real(wp), intent(out) :: values(:)
      real(wp) :: legendre, before, ratio
      complex(wp) :: turning
      integer :: l, m, place

      ! (x + i y)^m = sin^m exp(i m phi), normalised.
      turning = 1.0_wp
      do m = 0, bandlimit
         before = 0.0_wp
         legendre = 1.0_wp
         do l = m, bandlimit
            if (mod(l, 2) == 0) then
               place = l*(l - 1)/2 + max(1, 2*m)
               values(place) = legendre*real(turning, wp)
               if (m > 0) values(place + 1) = legendre*aimag(turning)
            end if
            ratio = sqrt((2.0_wp*l + 1.0_wp)*(2.0_wp*l + 3.0_wp)/((l + 1.0_wp)**2 - m**2))
            associate (next => ratio*(direction(3)*legendre - before))
               before = legendre/ratio
               legendre = next
            end associate
         end do
         turning = turning*cmplx(direction(1), direction(2), wp) &
                  & *sqrt((2.0_wp*m + 3.0_wp)/merge(2.0_wp*m + 2.0_wp, 1.0_wp, m > 0))
      end do
   end subroutine evaluate_real

   !> All harmonics in one direction.
   pure subroutine evaluate_harmonics(harmonics, direction, k)
      type(harmonics_type), intent(in) :: harmonics
      !> Unit vector in crystal axes.
      real(wp), intent(in) :: direction(3)
      !> (n).
      real(wp), intent(out) :: k(:)
      real(wp) :: values((size(harmonics%combination, 1) + 1) &
                        & *(size(harmonics%combination, 1) + 3)/8)
      integer :: h

      call evaluate_real(size(harmonics%combination, 1)/2, direction, values)
      do h = 1, harmonics%n
         associate (l => harmonics%degrees(h))
            k(h) = dot_product(harmonics%combination(:2*l + 1, h), &
               & values(l*(l - 1)/2 + 1:l*(l - 1)/2 + 2*l + 1))
         end associate
      end do
   end subroutine evaluate_harmonics
end module symmetric_harmonics
