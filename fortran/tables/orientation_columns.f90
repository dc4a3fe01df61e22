!> The indented direction of grains, from columns that state it otherwise than by Euler angles: unit quaternions, or the crystal direction
!> or plane normal along the indenter.
!>
!> Of a half-space only that direction matters, in crystal axes; a turn about it is free. So these become angles (0, Phi, phi2) whose g
!> takes the sample's z to it.
module orientation_columns
   use crystal_class, only: crystal_class_type
   use crystal_lattice, only: lattice_parameters, lattice_type, new_lattice
   use errors, only: error_type, refuse
   use kinds, only: degree, pi, wp
   use tables, only: table_type
   use text, only: join, to_text
   implicit none
   private
   public :: find_ways, read_directions, angles_of_direction, direction_names

   !> A way to state a direction: the names of its columns.
   type :: way_type
      integer :: n
      character(len=2) :: names(4)
   end type way_type
   integer, parameter :: quaternions = 1, four_directions = 2, four_planes = 3, directions = 4, planes = 5
   type(way_type), parameter :: ways(5) = [way_type(4, ['q0', 'q1', 'q2', 'q3']), way_type(4, ['u ', 'v ', 't ', 'w ']), &
      & way_type(4, ['h ', 'k ', 'i ', 'l ']), way_type(3, ['u ', 'v ', 'w ', '  ']), way_type(3, ['h ', 'k ', 'l ', '  '])]
   !> What is rounded away in a file, relative.
   real(wp), parameter :: rounding = 1.0e-2_wp

contains

   !> The number of the way in which a table states directions, and its columns; 0 if it does in none. Two are refused.
   subroutine find_ways(table, way, columns, error)
      type(table_type), intent(in) :: table
      integer, intent(out) :: way
      integer, allocatable, intent(out) :: columns(:)
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: own(:)
      integer :: i, j

      way = 0
      allocate (columns(0))
      do i = 1, size(ways)
         own = [(table%find(trim(ways(i)%names(j))), j=1, ways(i)%n)]
         if (any(own == 0)) cycle
         ! Three of four indices are no way of their own.
         if ((way == four_directions .and. i == directions) .or. (way == four_planes .and. i == planes)) cycle
         if (way > 0) then
            call refuse(error, 'orientations are stated twice, by '//join(ways(way)%names(:ways(way)%n), ', ')//' and by ' &
               & //join(ways(i)%names(:ways(i)%n), ', ')//'; one of them is allowed')
            return
         end if
         way = i
         columns = own
      end do
   end subroutine find_ways

   !> The names of the columns of all ways, separated by ', '.
   pure function direction_names() result(names)
      character(len=:), allocatable :: names

      names = join([ways(quaternions)%names, ways(four_directions)%names, ways(four_planes)%names], ', ')
   end function direction_names

   !> Bunge-Euler angles of every row, degrees.
   subroutine read_directions(table, way, columns, class, parameters, euler_deg, error)
      type(table_type), intent(in) :: table
      !> As `find_ways` gives them.
      integer, intent(in) :: way, columns(:)
      type(crystal_class_type), intent(in) :: class
      !> Of the lattice, perhaps unallocated.
      real(wp), allocatable, intent(in) :: parameters(:)
      !> (3, n).
      real(wp), intent(out) :: euler_deg(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(lattice_type) :: lattice
      real(wp) :: row(4), v(3)
      integer :: i, j

      if (way /= quaternions) then
         call lattice_of(class, parameters, ways(way), lattice, error)
         if (allocated(error)) return
      end if
      do i = 1, table%rows
         row = 0.0_wp
         do j = 1, size(columns)
            call table%number(columns(j), i, row(j), error)
            if (allocated(error)) return
         end do
         if (way == quaternions) then
            if (abs(norm2(row) - 1.0_wp) > rounding) call table%refuse(columns(1), i, ' is of no unit quaternion: q0^2 + q1^2 + ' &
               & //'q2^2 + q3^2 = '//to_text(sum(row**2))//', and 1 is needed', error)
            v = direction_of_quaternion(row/norm2(row))
         else
            if (maxval(abs(row)) <= 0.0_wp) call table%refuse(columns(1), i, ' and all other indices are 0: no direction', error)
            if (size(columns) == 4) then
               if (abs(sum(row(:3))) > rounding*maxval(abs(row))) call table%refuse(columns(3), i, ': the first three of four ' &
                  & //'indices have the sum '//to_text(sum(row(:3)))//', and 0 is needed', error)
               if (way == four_directions) row(:2) = row(:2) - row(3)
               row(3) = row(4)
            end if
            if (way == directions .or. way == four_directions) then
               v = matmul(lattice%edges, row(:3))
            else
               v = matmul(lattice%normals, row(:3))
            end if
         end if
         if (allocated(error)) return
         euler_deg(:, i) = angles_of_direction(v/norm2(v))
      end do
   end subroutine read_directions

   !> The cell to which indices refer.
   subroutine lattice_of(class, parameters, way, lattice, error)
      type(crystal_class_type), intent(in) :: class
      real(wp), allocatable, intent(in) :: parameters(:)
      type(way_type), intent(in) :: way
      type(lattice_type), intent(out) :: lattice
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: open

      open = lattice_parameters(class)
      if (allocated(parameters)) then
         call new_lattice(class, parameters, lattice, error)
      else if (len(open) == 0) then
         call new_lattice(class, [real(wp) ::], lattice, error)
      else
         call refuse(error, 'the columns '//join(way%names(:way%n), ', ')//' are indices of a '//class%name//' crystal, whose ' &
            & //'directions depend on its cell: &problem lattice = '//open//' (lengths in any unit, angles in degrees) is needed')
      end if
      if (.not. allocated(error) .and. way%n == 4 .and. .not. lattice%is_hexagonal) call refuse(error, 'the columns ' &
         & //join(way%names, ', ')//' are four indices, which only cells with 120 degrees between a and b have; a '//class%name &
         & //' crystal has three')
   end subroutine lattice_of

   !> The sample's z in crystal axes: the third column of the matrix of the rotation from sample to crystal axes.
   pure function direction_of_quaternion(q) result(v)
      !> Of norm 1, the scalar first.
      real(wp), intent(in) :: q(4)
      real(wp) :: v(3)

      v = [2.0_wp*(q(2)*q(4) + q(1)*q(3)), 2.0_wp*(q(3)*q(4) - q(1)*q(2)), q(1)**2 - q(2)**2 - q(3)**2 + q(4)**2]
   end function direction_of_quaternion

   !> Bunge-Euler angles, degrees, whose g takes the sample's z to a direction.
   pure function angles_of_direction(v) result(euler_deg)
      !> Unit vector in crystal axes.
      real(wp), intent(in) :: v(3)
      real(wp) :: euler_deg(3)

      euler_deg = [0.0_wp, acos(max(-1.0_wp, min(1.0_wp, v(3)))), modulo(atan2(v(1), v(2)), 2.0_wp*pi)]/degree
   end function angles_of_direction
end module orientation_columns
