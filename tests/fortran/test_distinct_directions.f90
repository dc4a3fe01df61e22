!> Regions of distinct directions: what they cover, what they hold, and today's points for cubic and
!> hexagonal crystals.
program test_distinct_directions
   use crystal_class, only: crystal_class_names, crystal_class_type
   use distinct_directions, only: all_alike, angle_between, lattice_of_directions, new_region, &
      & region_type, representative, spread_of_directions
   use kinds, only: degree, pi, wp
   use random, only: new_random_stream, random_stream_type
   use testing, only: check, check_close, class_of, finish
   use text, only: split_list, to_text
   implicit none

   call test_area()
   call test_representatives()
   call test_cubic()
   call test_axial()
   call test_angles()
   call test_alike()
   call finish()

contains

   !> A region is one of as many equal parts of the sphere as its group has operations.
   subroutine test_area()
      character(len=*), parameter :: names(8) = [character(len=12) :: 'cubic', 'tetragonal', &
         & '4/m', 'trigonal', '-3', 'orthorhombic', 'monoclinic', 'triclinic']
      integer, parameter :: operations(8) = [48, 16, 8, 12, 6, 8, 4, 2]
      type(region_type) :: region
      real(wp) :: area
      integer :: i, t

      do i = 1, size(names)
         call new_region(class_of(trim(names(i))), region)
         area = 0.0_wp
         do t = 1, size(region%triangles, 3)
            area = area + solid_angle(region%triangles(:, :, t))
         end do
         call check_close('area of '//trim(names(i)), area, 4.0_wp*pi/operations(i), 1.0e-9_wp)
      end do
   end subroutine test_area

   !> Of a spherical triangle (van Oosterom & Strackee, IEEE Trans. Biomed. Eng. 30, 125, 1983).
   pure real(wp) function solid_angle(v)
      real(wp), intent(in) :: v(3, 3)
      real(wp) :: volume

      volume = v(1, 1)*(v(2, 2)*v(3, 3) - v(3, 2)*v(2, 3)) - v(2, &
         & 1)*(v(1, 2)*v(3, 3) - v(3, 2)*v(1, 3)) + v(3, 1)*(v(1, 2)*v(2, 3) - v(2, 2)*v(1, 3))
      solid_angle = 2.0_wp*atan2(abs(volume), 1.0_wp + dot_product(v(:, 1), v(:, 2)) &
         & + dot_product(v(:, 2), v(:, 3)) + dot_product(v(:, 1), v(:, 3)))
   end function solid_angle

   !> The group does not change a representative, which is in a triangle; every direction of the
   !> lattice is its own.
   subroutine test_representatives()
      type(region_type) :: region
      type(crystal_class_type) :: class
      type(random_stream_type) :: stream
      character(len=:), allocatable :: names(:)
      real(wp), allocatable :: lattice(:, :)
      real(wp) :: v(3), best(3), worst
      integer :: i, j, k, g
      logical :: covered

      names = split_list(crystal_class_names())
      stream = new_random_stream(1, 0)
      do i = 1, size(names)
         call new_region(class_of(trim(names(i))), region)
         class = class_of(trim(names(i)))
         worst = 0.0_wp
         covered = .true.
         do j = 1, 200
            do k = 1, 3
               call stream%normal(v(k))
            end do
            v = v/norm2(v)
            best = representative(region, v)
            worst = max(worst, norm2(representative(region, -v) - best), &
               & norm2(representative(region, best) - best), abs(angle_between(region, v, best)))
            do g = 1, size(class%generators, 3)
               worst = max(worst, &
                  & norm2(representative(region, matmul(class%generators(:, :, g), v)) - best))
            end do
            covered = covered .and. (region%dimension < 2 .or. is_inside(region, best))
         end do
         call check_close(trim(names(i))//': one representative of equivalent directions', worst, &
            & 0.0_wp, 1.0e-7_wp)
         call check(trim(names(i))//': it is in the region', covered)
         call lattice_of_directions(region, lattice)
         worst = 0.0_wp
         do j = 1, size(lattice, 2)
            worst = max(worst, norm2(representative(region, lattice(:, j)) - lattice(:, j)))
         end do
         call check_close(trim(names(i))//': the lattice is in the region', worst, &
            & 0.0_wp, 1.0e-7_wp)
      end do
   end subroutine test_representatives

   pure logical function is_inside(region, v)
      type(region_type), intent(in) :: region
      real(wp), intent(in) :: v(3)
      real(wp) :: signs(3)
      integer :: t, i

      is_inside = .false.
      do t = 1, size(region%triangles, 3)
         associate (c => region%triangles(:, :, t))
            signs = [(dot_product(cross(c(:, i), c(:, mod(i, 3) + 1)), v) &
                     & *dot_product(cross(c(:, 1), c(:, 2)), c(:, 3)), i=1, 3)]
         end associate
         is_inside = is_inside .or. all(signs > -1.0e-9_wp)
      end do
   end function is_inside

   pure function cross(a, b) result(c)
      real(wp), intent(in) :: a(3), b(3)
      real(wp) :: c(3)

      c = cshift(a, 1)*cshift(b, 2) - cshift(a, 2)*cshift(b, 1)
   end function cross

   subroutine test_cubic()
      type(region_type) :: region
      real(wp), allocatable :: points(:, :)
      real(wp) :: corners(3, 3)

      call new_region(class_of('cubic'), region)
      corners = reshape([0.0_wp, 0.0_wp, 1.0_wp, sqrt(0.5_wp), 0.0_wp, sqrt(0.5_wp), &
         & sqrt([1.0_wp, 1.0_wp, 1.0_wp]/3.0_wp)], [3, 3])
      call check('cubic: one triangle', size(region%triangles, 3) == 1, &
         & to_text(size(region%triangles, 3)))
      call check_close('001, 101, 111', maxval(abs(region%triangles(:, :, 1) - corners)), &
         & 0.0_wp, 1.0e-15_wp)
      call lattice_of_directions(region, points)
      call check('cubic: shares of sixteenths', size(points, 2) == 17*18/2, &
         & to_text(size(points, 2)))
      call check_close('the lattice begins at 111', maxval(abs(points(:, 1) - corners(:, 3))), &
         & 0.0_wp, 1.0e-15_wp)
      call check_close('and ends at 001', maxval(abs(points(:, size(points, 2)) - corners(:, 1))), &
         & 0.0_wp, 1.0e-15_wp)
      call spread_of_directions(region, 5, points)
      call check_close('the corners first', maxval(abs(points(:, :3) - corners)), &
         & 0.0_wp, 1.0e-15_wp)
      call check('then far from all before', min(angle_between(region, points(:, 4), &
         & points(:, 5)), angle_between(region, points(:, 4), corners(:, 1)), &
         & angle_between(region, points(:, 5), corners(:, 1))) > 15.0_wp*degree)
   end subroutine test_cubic

   subroutine test_axial()
      type(region_type) :: region
      real(wp), allocatable :: points(:, :)

      call new_region(class_of('hexagonal'), region)
      call check('hexagonal: an arc', region%dimension == 1)
      call lattice_of_directions(region, points)
      call check('every two degrees', size(points, 2) == 46)
      call check_close('from 001 to 100', maxval(abs(points(:, [1, 16, 46]) - reshape([0.0_wp, &
         & 0.0_wp, 1.0_wp, 0.5_wp, 0.0_wp, sqrt(0.75_wp), 1.0_wp, 0.0_wp, 0.0_wp], [3, 3]))), &
         & 0.0_wp, 1.0e-15_wp)
      call spread_of_directions(region, 4, points)
      call check_close('equal steps', acos(points(3, 2))/degree, 30.0_wp, 1.0e-12_wp)
      call new_region(class_of('isotropic'), region)
      call lattice_of_directions(region, points)
      call check('isotropic: a point', region%dimension == 0 .and. size(points, 2) == 1)
   end subroutine test_axial

   subroutine test_angles()
      type(region_type) :: region

      call new_region(class_of('hexagonal'), region)
      call check_close('between declinations', angle_between(region, [0.6_wp, 0.0_wp, 0.8_wp], &
         & [0.0_wp, -0.8_wp, 0.6_wp]), acos(0.6_wp) - acos(0.8_wp), 1.0e-12_wp)
      call new_region(class_of('orthorhombic'), region)
      call check_close('between images', angle_between(region, [0.6_wp, 0.0_wp, 0.8_wp], &
         & [-0.8_wp, 0.0_wp, 0.6_wp]), acos(0.96_wp), 1.0e-12_wp)
   end subroutine test_angles

   subroutine test_alike()
      type(region_type) :: region
      real(wp) :: three(3, 3)

      call new_region(class_of('cubic'), region)
      three = reshape([0.0_wp, 0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, sin(4.0_wp*degree), &
         & cos(4.0_wp*degree)], [3, 3])
      call check('all within five degrees', all_alike(region, three, 5.0_wp*degree))
      call check('not all within three', .not. all_alike(region, three, 3.0_wp*degree))
      call new_region(class_of('hexagonal'), region)
      call check('not for a hexagonal crystal', .not. all_alike(region, three, 5.0_wp*degree))
   end subroutine test_alike
end program test_distinct_directions
