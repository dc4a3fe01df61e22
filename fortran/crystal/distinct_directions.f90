!> Directions that differ for a crystal. The group of a crystal, the inversion included, maps
!> directions onto equivalent ones; one direction of each such set represents it.
!>
!> The representative is the direction that is largest in z, then in x, then in y. For a finite
!> group the representatives fill a few spherical triangles (cubic: 001, 101, 111). With one axis of
!> infinite order they fill an arc from that axis, with two axes they are a point.
module distinct_directions
   use crystal_class, only: crystal_class_type, rotation_about
   use kinds, only: degree, pi, wp
   implicit none
   private
   public :: region_type, new_region, representative, angle_between, all_alike, &
      & lattice_of_directions, spread_of_directions, group_rotations

   !> Components of unit vectors that differ by less are equal.
   real(wp), parameter :: tolerance = 1.0e-9_wp
   !> Step of the lattice over an arc, and largest step along the sides of a triangle, in degrees:
   !> 16 steps along the longest side of the cubic triangle, which has 54.7 degrees.
   real(wp), parameter :: arc_step = 2.0_wp, triangle_step = 3.43_wp
   !> Most corners of an octant that is cut to the region.
   integer, parameter :: most_corners = 12
   !> Components in the order in which directions are compared.
   integer, parameter :: z_x_y(3) = [3, 1, 2]

   type :: region_type
      !> Dimension of the region: 2 for triangles, 1 for an arc, 0 for a point.
      integer :: dimension = 2
      !> Corners of the triangles, unit vectors (3, 3, n); none for an arc or a point.
      real(wp), allocatable :: triangles(:, :, :)
      !> Beginning of the arc, the axis of infinite order, and its end.
      real(wp) :: axis(3) = [0, 0, 1], equator(3) = [1, 0, 0]
      !> The finite group with the inversion, (3, 3, n).
      real(wp), allocatable, private :: group(:, :, :)
   end type region_type

contains

   !> The region of a class.
   subroutine new_region(class, region)
      type(crystal_class_type), intent(in) :: class
      type(region_type), intent(out) :: region
      !> Unit vectors (3, n), in order around a polygon.
      real(wp), allocatable :: corners(:, :)
      integer :: i, n

      region%dimension = max(0, 2 - count(class%folds == 0))
      allocate (region%triangles(3, 3, 0))
      region%group = group_rotations(class, 1)
      n = size(region%group, 3)
      ! Append each rotation with the inversion.
      region%group = reshape(region%group, [3, 3, 2*n], -region%group)
      if (region%dimension == 1) then
         ! The axis is one of x, y and z, and so the shifted vector is normal to it.
         region%axis = abs(axis_of(class%generators(:, :, findloc(class%folds, 0, dim=1))))
         region%axis = region%axis/norm2(region%axis)
         region%equator = cshift(region%axis, -1)
      end if
      if (region%dimension < 2) return
      do i = 0, 7
         ! Cut an octant of the sphere. The bits of i are the signs of z, x and y.
         corners = real(reshape([0, 0, 1 - 2*ibits(i, 2, 1), 1 - 2*ibits(i, 1, 1), 0, 0, 0, &
            & 1 - 2*ibits(i, 0, 1), 0], [3, 3]), wp)
         call cut_to_region()
         do n = 3, size(corners, 2)
            region%triangles = reshape(region%triangles, [3, 3, size(region%triangles, 3) + 1], &
               & reshape(corners(:, [1, n - 1, n]), [9]))
         end do
      end do

   contains

      !> Cut the convex spherical polygon of the `corners` to the region, one plane after the other.
      !> There are no corners if nothing remains.
      !>
      !> A direction v of the region is not smaller than its image by any element of the group. If
      !> g is the inverse of the element, this is v.n >= 0 with n = z - gz, or n = x - gx if z = gz,
      !> or else n = y - gy.
      subroutine cut_to_region()
         !> Corners of the polygon that remains, and distances of the old ones from the plane.
         real(wp) :: cut(3, most_corners), height(most_corners), normal(3), unit(3)
         integer :: g, i, j, n, m

         do g = 1, size(region%group, 3)
            do i = 1, 3
               unit = 0.0_wp
               unit(z_x_y(i)) = 1.0_wp
               normal = unit - region%group(:, z_x_y(i), g)
               if (norm2(normal) > tolerance) exit
            end do
            ! The identity cuts nothing.
            if (i > 3) cycle
            n = size(corners, 2)
            height(:n) = matmul(normal, corners)
            where (abs(height(:n)) < tolerance) height(:n) = 0.0_wp
            m = 0
            do i = 1, n
               j = mod(i, n) + 1
               if (height(i) >= 0.0_wp) then
                  m = m + 1
                  cut(:, m) = corners(:, i)
               end if
               if (height(i)*height(j) < 0.0_wp) then
                  ! The plane cuts the side from i to j.
                  m = m + 1
                  cut(:, m) = corners(:, i)*abs(height(j)) + corners(:, j)*abs(height(i))
                  cut(:, m) = cut(:, m)/norm2(cut(:, m))
               end if
            end do
            ! Only a corner or a side of the polygon is left.
            if (m < 3 .or. all(height(:n) <= 0.0_wp)) m = 0
            corners = cut(:, :m)
            if (m == 0) return
         end do
      end subroutine cut_to_region
   end subroutine new_region

   !> Proper rotations of a class's group, (3, 3, n). An axis of infinite order is replaced by one
   !> of this `order`; a second such axis is omitted.
   function group_rotations(class, order) result(rotations)
      type(crystal_class_type), intent(in) :: class
      integer, intent(in) :: order
      real(wp), allocatable :: rotations(:, :, :), generators(:, :, :)
      real(wp) :: product(3, 3)
      logical, allocatable :: retained(:)
      integer :: g, i, k, infinite

      generators = class%generators
      infinite = findloc(class%folds, 0, dim=1)
      retained = class%folds > 0
      if (infinite > 0) then
         retained(infinite) = .true.
         generators(:, :, infinite) = rotation_about(axis_of(generators(:, :, infinite)), &
            & 2.0_wp*pi/order)
      end if
      generators = generators(:, :, pack([(g, g=1, size(retained))], retained))
      ! Multiply every rotation by every generator until there are no new products.
      rotations = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1]*1.0_wp, [3, 3, 1])
      i = 0
      do while (i < size(rotations, 3))
         i = i + 1
         do g = 1, size(generators, 3)
            product = matmul(generators(:, :, g), rotations(:, :, i))
            do k = 1, size(rotations, 3)
               if (all(abs(rotations(:, :, k) - product) < tolerance)) exit
            end do
            if (k <= size(rotations, 3)) cycle
            rotations = reshape(rotations, [3, 3, k], reshape(product, [9]))
         end do
      end do
   end function group_rotations

   !> The axis of a rotation, of no particular length.
   pure function axis_of(r) result(axis)
      real(wp), intent(in) :: r(3, 3)
      real(wp) :: axis(3)

      axis = [r(3, 2) - r(2, 3), r(1, 3) - r(3, 1), r(2, 1) - r(1, 2)]
   end function axis_of

   !> The direction of the region that is equivalent to a direction.
   pure function representative(region, direction) result(best)
      type(region_type), intent(in) :: region
      !> Unit vector in crystal axes.
      real(wp), intent(in) :: direction(3)
      real(wp) :: best(3), image(3), height
      integer :: g, i

      select case (region%dimension)
      case (0)
         best = region%axis
      case (1)
         height = min(1.0_wp, abs(dot_product(region%axis, direction)))
         best = height*region%axis + sqrt(1.0_wp - height**2)*region%equator
      case default
         best = direction
         do g = 1, size(region%group, 3)
            image = matmul(region%group(:, :, g), direction)
            ! The first component that differs decides which one is larger.
            i = findloc(abs(image(z_x_y) - best(z_x_y)) >= tolerance, .true., dim=1)
            if (i == 0) cycle
            if (image(z_x_y(i)) > best(z_x_y(i))) best = image
         end do
      end select
   end function representative

   !> Smallest angle (radians) between a direction and those equivalent to another one.
   pure real(wp) function angle_between(region, first, second) result(angle)
      type(region_type), intent(in) :: region
      !> Unit vectors in crystal axes.
      real(wp), intent(in) :: first(3), second(3)
      integer :: g

      select case (region%dimension)
      case (0)
         angle = 0.0_wp
      case (1)
         angle = abs(acos(min(1.0_wp, abs(dot_product(region%axis, first)))) &
            & - acos(min(1.0_wp, abs(dot_product(region%axis, second)))))
      case default
         angle = acos(min(1.0_wp, maxval([(dot_product(first, &
            & matmul(region%group(:, :, g), second)), g=1, size(region%group, 3))])))
      end select
   end function angle_between

   !> Whether all directions are within an angle of one of them.
   pure logical function all_alike(region, directions, angle)
      type(region_type), intent(in) :: region
      !> Unit vectors in crystal axes, (3, n).
      real(wp), intent(in) :: directions(:, :)
      !> Radians.
      real(wp), intent(in) :: angle
      real(wp) :: apart(size(directions, 2))
      integer :: i, j

      all_alike = .true.
      do i = 1, size(apart)
         apart = [(angle_between(region, directions(:, i), directions(:, j)), j=1, size(apart))]
         all_alike = all(apart <= angle)
         ! If two directions are more than twice the angle apart, none is within the angle of both.
         if (all_alike .or. any(apart > 2.0_wp*angle)) return
      end do
   end function all_alike

   !> Directions that cover the region evenly, its corners and edges included: equal steps over an
   !> arc, the points of `divide` over the triangles.
   pure subroutine lattice_of_directions(region, directions)
      type(region_type), intent(in) :: region
      !> Unit vectors (3, n).
      real(wp), allocatable, intent(out) :: directions(:, :)
      real(wp) :: angle

      if (region%dimension < 2) then
         directions = arc(region, merge(nint(90.0_wp/arc_step) + 1, 1, region%dimension == 1))
      else
         ! The longest side of a triangle.
         angle = acos(minval(sum(region%triangles*cshift(region%triangles, 1, 2), 1)))
         call divide(region, ceiling(angle/(triangle_step*degree)), directions)
      end if
   end subroutine lattice_of_directions

   !> n directions that spread over the region: equal steps over an arc; for triangles the corners
   !> first, then repeatedly the direction of a fine grid that is farthest from those chosen before.
   pure subroutine spread_of_directions(region, n, directions)
      type(region_type), intent(in) :: region
      integer, intent(in) :: n
      !> Unit vectors (3, n).
      real(wp), allocatable, intent(out) :: directions(:, :)
      !> Divisions of a triangle's sides for the fine grid.
      integer, parameter :: divisions = 60
      !> Cosines are compared in units of 1e-12: the first of equal ones is chosen in spite of
      !> rounding errors.
      real(wp), parameter :: digits = 1.0e12_wp
      !> Points of the region, and the cosine of the angle from each to the nearest direction.
      real(wp), allocatable :: grid(:, :), corners(:, :), cosine(:)
      real(wp) :: image(3)
      integer :: g, k

      if (region%dimension < 2) then
         directions = arc(region, n)
         return
      end if
      call divide(region, 1, corners)
      ! `divide` begins with the last corner.
      corners = corners(:, size(corners, 2):1:-1)
      call divide(region, divisions, grid)
      allocate (cosine(size(grid, 2)), source=-1.0_wp)
      allocate (directions(3, n))
      do k = 1, n
         if (k <= size(corners, 2)) then
            directions(:, k) = corners(:, k)
         else
            directions(:, k) = grid(:, minloc(anint(cosine*digits), dim=1))
         end if
         do g = 1, size(region%group, 3)
            image = matmul(directions(:, k), region%group(:, :, g))
            cosine = max(cosine, image(1)*grid(1, :) + image(2)*grid(2, :) + image(3)*grid(3, :))
         end do
      end do
   end subroutine spread_of_directions

   !> n directions at equal angles over the arc; n times the axis if the region is a point.
   pure function arc(region, n) result(directions)
      type(region_type), intent(in) :: region
      integer, intent(in) :: n
      real(wp) :: directions(3, n), angle
      integer :: i

      do i = 1, n
         angle = merge(0.0_wp, 0.5_wp*pi*(i - 1)/max(1, n - 1), region%dimension == 0)
         directions(:, i) = cos(angle)*region%axis + sin(angle)*region%equator
      end do
   end function arc

   !> Grid over the triangles: the directions of the sums of the corners with the weights i/n, j/n
   !> and (n-i-j)/n. Each distinct direction is listed once.
   pure subroutine divide(region, n, directions)
      type(region_type), intent(in) :: region
      integer, intent(in) :: n
      !> (3, m).
      real(wp), allocatable, intent(out) :: directions(:, :)
      real(wp) :: distinct(3, size(region%triangles, 3)*(n + 1)*(n + 2)/2), v(3)
      integer :: t, i, j, k, m

      m = 0
      do t = 1, size(region%triangles, 3)
         do i = 0, n
            do j = 0, n - i
               v = matmul(region%triangles(:, :, t), &
                  & [real(i, wp)/n, real(j, wp)/n, real(n - i - j, wp)/n])
               v = v/norm2(v)
               ! An equivalent direction on another edge represents this one.
               if (any(abs(representative(region, v) - v) > tolerance)) cycle
               ! Triangles share directions on their edges only.
               if (i*j*(n - i - j) == 0) then
                  do k = 1, m
                     if (all(abs(distinct(:, k) - v) < tolerance)) exit
                  end do
                  if (k <= m) cycle
               end if
               m = m + 1
               distinct(:, m) = v
            end do
         end do
      end do
      directions = distinct(:, :m)
   end subroutine divide
end module distinct_directions
