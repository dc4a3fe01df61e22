!> Symmetrised harmonics: counts of the eleven Laue groups, invariance, orthonormality, known
!> functions.
program test_symmetric_harmonics
   use crystal_class, only: crystal_class_names, crystal_class_type, rotations_about
   use errors, only: error_type
   use kinds, only: pi, wp
   use symmetric_harmonics, only: evaluate_harmonics, harmonics_type, new_harmonics
   use testing, only: check, check_close, check_success, class_of, clenshaw_curtis_weight, finish
   use text, only: split_list, to_text
   implicit none

   character(len=*), parameter :: laue_groups(11) = [character(len=5) :: '-1', '2/m', 'mmm', &
      & '4/m', '4/mmm', '-3', '-3m', '6/m', '6/mmm', 'm-3', 'm-3m']
   character(len=*), parameter :: generators(11) = [character(len=10) :: '', '2 y', '2 z, 2 x', &
      & '4 z', '4 z, 2 x', '3 z', '3 z, 2 x', '6 z', '6 z, 2 x', '2 z, 3 xyz', '4 z, 3 xyz']
   !> How many have a degree up to 10.
   integer, parameter :: totals(11) = [66, 36, 21, 18, 12, 22, 14, 12, 9, 7, 5]

   call test_laue_groups()
   call test_classes()
   call test_known()
   call test_signs()
   call finish()

contains

   subroutine test_laue_groups()
      type(harmonics_type) :: harmonics
      type(error_type), allocatable :: error
      real(wp), allocatable :: rotations(:, :, :)
      integer, allocatable :: folds(:)
      integer :: i, l
      logical :: right

      do i = 1, size(laue_groups)
         call rotations_about(generators(i), rotations, folds)
         call new_harmonics(rotations, 16, harmonics, error)
         call check_success(laue_groups(i), error)
         right = .true.
         do l = 0, 16, 2
            right = right &
               & .and. count(harmonics%degrees == l) == expected_count(trim(laue_groups(i)), l)
         end do
         call check(trim(laue_groups(i))//', counts of each degree', right)
         call check(trim(laue_groups(i))//', total to degree 10', &
            & count(harmonics%degrees <= 10) == totals(i), to_text(count(harmonics%degrees <= 10)))
         call check_invariance(trim(laue_groups(i)), harmonics, rotations)
         call check_orthonormality(trim(laue_groups(i)), harmonics)
      end do
   end subroutine test_laue_groups

   pure integer function expected_count(group, l) result(n)
      character(len=*), intent(in) :: group
      integer, intent(in) :: l
      integer, parameter :: tetrahedral(0:8) = [1, 0, 1, 2, 1, 2, 3, 2, 3], &
         & octahedral(0:8) = [1, 0, 1, 1, 1, 1, 2, 1, 2]

      select case (group)
      case ('-1')
         n = 2*l + 1
      case ('2/m')
         n = l + 1
      case ('mmm')
         n = l/2 + 1
      case ('4/m')
         n = 2*(l/4) + 1
      case ('-3')
         n = 2*(l/3) + 1
      case ('6/m')
         n = 2*(l/6) + 1
      case ('4/mmm')
         n = l/4 + 1
      case ('-3m')
         n = l/3 + 1
      case ('6/mmm')
         n = l/6 + 1
      case ('m-3')
         n = tetrahedral(l/2)
      case default
         n = octahedral(l/2)
      end select
   end function expected_count

   !> Those of the stiffness of each class, to the highest degree.
   subroutine test_classes()
      type(harmonics_type) :: harmonics
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error
      character(len=:), allocatable :: names(:)
      integer :: i

      names = split_list(crystal_class_names())
      do i = 1, size(names)
         class = class_of(trim(names(i)))
         call new_harmonics(class%generators, 20, harmonics, error)
         call check_success('harmonics of '//trim(names(i)), error)
         call check_invariance(trim(names(i)), harmonics, class%generators)
         call check_orthonormality(trim(names(i)), harmonics)
      end do
      call harmonics_of('hexagonal', 20, harmonics)
      call check('an axis of infinite order: one of each even degree', harmonics%n == 11)
      call harmonics_of('isotropic', 20, harmonics)
      call check('isotropic: the constant alone', harmonics%n == 1)
   end subroutine test_classes

   subroutine check_invariance(name, harmonics, rotations)
      character(len=*), intent(in) :: name
      type(harmonics_type), intent(in) :: harmonics
      real(wp), intent(in) :: rotations(:, :, :)
      real(wp) :: k(harmonics%n), turned(harmonics%n), n(3), worst
      integer :: g

      n = [2.0_wp, -3.0_wp, 6.0_wp]/7.0_wp
      call evaluate_harmonics(harmonics, n, k)
      call evaluate_harmonics(harmonics, -n, turned)
      worst = maxval(abs(turned - k))
      do g = 1, size(rotations, 3)
         call evaluate_harmonics(harmonics, matmul(rotations(:, :, g), n), turned)
         worst = max(worst, maxval(abs(turned - k)))
      end do
      call check_close(name//', unchanged by the group', worst, 0.0_wp, 1.0e-10_wp)
   end subroutine check_invariance

   !> The Gram matrix by a product rule: Clenshaw-Curtis in height (exact to degree 64), 80
   !> longitudes.
   subroutine check_orthonormality(name, harmonics)
      character(len=*), intent(in) :: name
      type(harmonics_type), intent(in) :: harmonics
      real(wp) :: gram(harmonics%n, harmonics%n), k(harmonics%n), phi, theta, weight
      integer :: i, j, h

      gram = 0.0_wp
      do i = 0, 64
         theta = pi*i/64
         weight = clenshaw_curtis_weight(i, 64)/(2*80)
         do j = 1, 80
            phi = 2.0_wp*pi*(j - 0.3_wp)/80
            call evaluate_harmonics(harmonics, &
               & [sin(theta)*cos(phi), sin(theta)*sin(phi), cos(theta)], k)
            do h = 1, harmonics%n
               gram(:, h) = gram(:, h) + weight*k*k(h)
            end do
         end do
      end do
      do h = 1, harmonics%n
         gram(h, h) = gram(h, h) - 1.0_wp
      end do
      call check_close(name//', orthonormal', maxval(abs(gram)), 0.0_wp, 1.0e-11_wp)
      call check_close(name//', the first is 1', k(1), 1.0_wp, 1.0e-13_wp)
   end subroutine check_orthonormality

   !> Textbook cubic harmonics of degree 4 and 6 for mean square 1, and zonal ones.
   subroutine test_known()
      type(harmonics_type) :: harmonics
      real(wp) :: k(7), n(3)

      n = [2.0_wp, 3.0_wp, 6.0_wp]/7.0_wp
      call harmonics_of('cubic', 12, harmonics)
      call check('degrees of the cubic harmonics', &
         & all(harmonics%degrees == [0, 4, 6, 8, 10, 12, 12]))
      call evaluate_harmonics(harmonics, n, k)
      call check_close('cubic, l = 4', k(2), sqrt(21.0_wp)/4*(5*sum(n**4) - 3), 1.0e-12_wp)
      call check_close('cubic, l = 6', k(3), &
         & sqrt(13.0_wp/128)*(462*(n(1)*n(2)*n(3))**2 + 21*sum(n**4) - 17), 1.0e-12_wp)
      call harmonics_of('hexagonal', 4, harmonics)
      call evaluate_harmonics(harmonics, [0.48_wp, -0.64_wp, 0.6_wp], k(:3))
      call check_close('zonal, l = 2', k(2), sqrt(5.0_wp)*(3*0.36_wp - 1)/2, 1.0e-13_wp)
      call check_close('zonal, l = 4', k(3), 3*(35*0.36_wp**2 - 30*0.36_wp + 3)/8, 1.0e-13_wp)
   end subroutine test_known

   !> Stored coefficients rely on it: what is not zero at the pole is positive there.
   subroutine test_signs()
      type(harmonics_type) :: harmonics
      real(wp) :: cubic(5), zonal(11)

      call harmonics_of('cubic', 10, harmonics)
      call evaluate_harmonics(harmonics, [0.0_wp, 0.0_wp, 1.0_wp], cubic)
      call check('cubic harmonics are positive at the pole', all(cubic > 0.0_wp))
      call harmonics_of('hexagonal', 20, harmonics)
      call evaluate_harmonics(harmonics, [0.0_wp, 0.0_wp, 1.0_wp], zonal)
      call check('zonal harmonics are positive at the pole', all(zonal > 0.0_wp))
   end subroutine test_signs

   !> The harmonics of a class.
   subroutine harmonics_of(name, bandlimit, harmonics)
      character(len=*), intent(in) :: name
      integer, intent(in) :: bandlimit
      type(harmonics_type), intent(out) :: harmonics
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error

      class = class_of(name)
      call new_harmonics(class%generators, bandlimit, harmonics, error)
   end subroutine harmonics_of
end program test_symmetric_harmonics
