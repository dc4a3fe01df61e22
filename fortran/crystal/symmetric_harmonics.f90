!> Surface harmonics of even degree that a group of rotations leaves alone: for each degree the kernel of its generators on the
!> real harmonics (all even ones are unchanged by the inversion).
!>
!> They are orthonormal for the mean over the sphere, the first is 1. Within a degree they are Gram-Schmidt vectors of the
!> projector's columns in the order m = 0, cos 1, sin 1, cos 2, ..; the component of that column is positive.
module symmetric_harmonics
   use crystal_class, only: crystal_class_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: pi, wp
   use linear_algebra, only: symmetric_eigen
   use text, only: to_text
   implicit none
   private
   public :: harmonics_type, new_harmonics, new_group_harmonics, evaluate_harmonics, largest_bandlimit, largest_degree

   !> Of a surrogate, and of any expansion.
   integer, parameter :: largest_bandlimit = 20, largest_degree = 32

   type :: harmonics_type
      !> How many there are.
      integer :: n = 0
      !> Degree of each, (n).
      integer, allocatable :: degrees(:)
      !> Highest degree, and highest order that occurs.
      integer, private :: bandlimit = 0, highest_order = 0
      !> Terms of order m are first(m) to first(m + 1) - 1: harmonic `index` gains `weight` times the real harmonic of degree
      !> `degree` with the cosine, or else the sine.
      integer, allocatable, private :: first(:), index(:), degree(:)
      logical, allocatable, private :: cosine(:)
      real(wp), allocatable, private :: weight(:)
      !> Recurrence in the degree of the normalised Legendre functions over sin^m, start(m), upper(l, m), lower(l, m).
      real(wp), allocatable, private :: start(:), upper(:, :), lower(:, :)
   end type harmonics_type

contains

   !> The harmonics of a crystal's stiffness.
   subroutine new_harmonics(class, bandlimit, harmonics, error)
      type(crystal_class_type), intent(in) :: class
      !> Highest degree, even, 0 to `largest_bandlimit`.
      integer, intent(in) :: bandlimit
      type(harmonics_type), intent(out) :: harmonics
      type(error_type), allocatable, intent(out) :: error

      if (bandlimit < 0 .or. bandlimit > largest_bandlimit .or. mod(bandlimit, 2) /= 0) then
         call raise(error, 'bandlimit = '//to_text(bandlimit)//' is not an even number in 0 .. ' &
            & //to_text(largest_bandlimit), exit_bad_input)
         return
      end if
      call new_group_harmonics(class%generators, bandlimit, harmonics, error)
   end subroutine new_harmonics

   !> The harmonics of the group that rotations generate.
   subroutine new_group_harmonics(generators, bandlimit, harmonics, error)
      !> Proper rotations, (3, 3, n).
      real(wp), intent(in) :: generators(:, :, :)
      !> Highest degree, even, 0 to `largest_degree`.
      integer, intent(in) :: bandlimit
      type(harmonics_type), intent(out) :: harmonics
      type(error_type), allocatable, intent(out) :: error
      type(harmonics_type) :: all_of_them
      !> Points of the half sphere, on a spiral with the golden angle between successive ones.
      real(wp) :: points(3, (bandlimit + 1)*(bandlimit + 2)), z
      real(wp), parameter :: turn = pi*(3.0_wp - sqrt(5.0_wp))
      real(wp), allocatable :: here(:, :), there(:, :), change(:, :), values(:), invariant(:, :), combination(:, :)
      integer :: l, a, b, g, i, n, n_points

      n = (bandlimit + 1)*(bandlimit + 2)/2
      n_points = size(points, 2)
      allocate (combination(n, n), change(n, n), here(n, n_points), there(n, n_points), source=0.0_wp)
      do i = 1, n
         combination(i, i) = 1.0_wp
      end do
      call unite(bandlimit, combination, all_of_them)
      do i = 1, n_points
         z = (i - 0.5_wp)/n_points
         points(:, i) = [sqrt(1.0_wp - z**2)*cos(turn*i), sqrt(1.0_wp - z**2)*sin(turn*i), z]
         call evaluate_harmonics(all_of_them, points(:, i), here(:, i))
      end do
      ! Sum over the generators g of |Y(g x) - Y(x)|^2 as a quadratic form of the coefficients: what it does not see is invariant.
      do g = 1, size(generators, 3)
         do i = 1, n_points
            call evaluate_harmonics(all_of_them, matmul(generators(:, :, g), points(:, i)), there(:, i))
         end do
         there = (there - here)/sqrt(real(n_points, wp))
         do l = 0, bandlimit, 2
            a = l*(l - 1)/2 + 1
            b = a + 2*l
            change(a:b, a:b) = change(a:b, a:b) + matmul(there(a:b, :), transpose(there(a:b, :)))
         end do
      end do
      combination = combination(:, :0)
      allocate (values(2*bandlimit + 1))
      do l = 0, bandlimit, 2
         a = l*(l - 1)/2 + 1
         b = a + 2*l
         invariant = change(a:b, a:b)
         call symmetric_eigen(invariant, values(:2*l + 1), error)
         if (allocated(error)) return
         call append_degree(invariant(:, :count(values(:2*l + 1) < 1.0e-8_wp)), a, combination)
      end do
      call unite(bandlimit, combination, harmonics)
   end subroutine new_group_harmonics

   !> Columns for one degree: the Gram-Schmidt vectors of the columns of the projector on the span of `invariant`.
   pure subroutine append_degree(invariant, first, combination)
      !> Orthonormal columns, (2 l + 1, n).
      real(wp), intent(in) :: invariant(:, :)
      !> Place of the degree among all real harmonics.
      integer, intent(in) :: first
      !> Coefficients of the harmonics so far, one a column, on all real harmonics.
      real(wp), allocatable, intent(inout) :: combination(:, :)
      real(wp) :: vector(size(combination, 1)), norm
      integer :: pivot, j, sweep, before, rows

      rows = size(combination, 1)
      before = size(combination, 2)
      do pivot = 1, size(invariant, 1)
         vector = 0.0_wp
         vector(first:first + size(invariant, 1) - 1) = matmul(invariant, invariant(pivot, :))
         do sweep = 1, 2
            do j = before + 1, size(combination, 2)
               vector = vector - dot_product(combination(:, j), vector)*combination(:, j)
            end do
         end do
         norm = norm2(vector)
         ! The squares of what is left of all columns sum to the vectors that are missing: one of them at least is as long as this.
         if (norm**2 < 0.5_wp/size(invariant, 1)) cycle
         where (abs(vector) < 1.0e-12_wp*norm) vector = 0.0_wp
         combination = reshape(combination, [rows, size(combination, 2) + 1], vector/norm)
      end do
   end subroutine append_degree

   !> Harmonics as combinations (columns) of all real harmonics of even degree, degree by degree, m = 0, cos 1, sin 1, ..
   subroutine unite(bandlimit, combination, harmonics)
      integer, intent(in) :: bandlimit
      real(wp), intent(in) :: combination(:, :)
      type(harmonics_type), intent(out) :: harmonics
      integer :: h, l, m, phase, row

      harmonics%bandlimit = bandlimit
      harmonics%n = size(combination, 2)
      allocate (harmonics%degrees(harmonics%n), harmonics%first(0:bandlimit + 1))
      allocate (harmonics%index(0), harmonics%degree(0), harmonics%cosine(0), harmonics%weight(0))
      do m = 0, bandlimit
         harmonics%first(m) = size(harmonics%index) + 1
         do l = m + mod(m, 2), bandlimit, 2
            ! Cosine and sine.
            do phase = 0, min(m, 1)
               row = l*(l - 1)/2 + 1 + max(0, 2*m - 1) + phase
               do h = 1, harmonics%n
                  if (.not. abs(combination(row, h)) > 0.0_wp) cycle
                  harmonics%degrees(h) = l
                  harmonics%index = [harmonics%index, h]
                  harmonics%degree = [harmonics%degree, l]
                  harmonics%cosine = [harmonics%cosine, phase == 0]
                  harmonics%weight = [harmonics%weight, combination(row, h)]
               end do
            end do
         end do
         if (size(harmonics%index) >= harmonics%first(m)) harmonics%highest_order = m
      end do
      harmonics%first(bandlimit + 1) = size(harmonics%index) + 1
      allocate (harmonics%start(0:bandlimit), source=1.0_wp)
      allocate (harmonics%upper(0:bandlimit, 0:bandlimit), harmonics%lower(0:bandlimit, 0:bandlimit), source=0.0_wp)
      do m = 0, bandlimit
         if (m == 1) harmonics%start(1) = sqrt(3.0_wp)
         if (m > 1) harmonics%start(m) = sqrt((2.0_wp*m + 1.0_wp)/(2.0_wp*m))*harmonics%start(m - 1)
         do l = m + 1, bandlimit
            harmonics%upper(l, m) = sqrt((4.0_wp*l**2 - 1.0_wp)/real(l**2 - m**2, wp))
            if (l > m + 1) harmonics%lower(l, m) = sqrt((2.0_wp*l + 1.0_wp)*((l - 1.0_wp)**2 - m**2) &
               & /((2.0_wp*l - 3.0_wp)*real(l**2 - m**2, wp)))
         end do
      end do
   end subroutine unite

   !> All harmonics in one direction.
   pure subroutine evaluate_harmonics(harmonics, direction, k)
      type(harmonics_type), intent(in) :: harmonics
      !> Unit vector in crystal axes.
      real(wp), intent(in) :: direction(3)
      !> (n).
      real(wp), intent(out) :: k(:)
      real(wp) :: legendre(0:harmonics%bandlimit), real_part, imaginary_part, next
      integer :: l, m, i

      k = 0.0_wp
      ! (x + i y)^m = sin^m exp(i m phi).
      real_part = 1.0_wp
      imaginary_part = 0.0_wp
      do m = 0, harmonics%highest_order
         if (harmonics%first(m + 1) > harmonics%first(m)) then
            legendre(m) = harmonics%start(m)
            if (m < harmonics%bandlimit) legendre(m + 1) = harmonics%upper(m + 1, m)*direction(3)*legendre(m)
            do l = m + 2, harmonics%bandlimit
               legendre(l) = harmonics%upper(l, m)*direction(3)*legendre(l - 1) - harmonics%lower(l, m)*legendre(l - 2)
            end do
            do i = harmonics%first(m), harmonics%first(m + 1) - 1
               k(harmonics%index(i)) = k(harmonics%index(i)) + harmonics%weight(i)*legendre(harmonics%degree(i)) &
                                      & *merge(real_part, imaginary_part, harmonics%cosine(i))
            end do
         end if
         next = real_part*direction(1) - imaginary_part*direction(2)
         imaginary_part = real_part*direction(2) + imaginary_part*direction(1)
         real_part = next
      end do
   end subroutine evaluate_harmonics
end module symmetric_harmonics
