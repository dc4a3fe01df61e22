!> The indented direction of grains from columns that state it without Euler angles: by unit
!> quaternions, or by the crystal direction or plane normal along the indenter.
!>
!> The modulus of a half-space depends only on that direction in crystal axes. The rotation about it
!> is free, so each direction becomes angles (0, Phi, phi2) whose g takes the sample's z to it.
module direction_columns
   use crystal_class, only: crystal_class_type, lattice_parameters, lattice_type, new_lattice
   use errors, only: error_type, refuse
   use kinds, only: degree, pi, wp
   use tables, only: table_type
   use text, only: split_list, to_text
   implicit none
   private
   public :: ways, read_directions, angles_of_direction

   !> The columns of each way to state a direction. The first three ways contain all names.
   integer, parameter :: quaternions = 1, four_directions = 2, four_planes = 3, &
      & directions = 4, planes = 5
   character(len=14), parameter :: ways(5) = [ &
      & 'q0, q1, q2, q3', 'u, v, t, w    ', 'h, k, i, l    ', 'u, v, w       ', 'h, k, l       ']
   !> Relative rounding of numbers in files.
   real(wp), parameter :: rounding = 1.0e-2_wp

contains

   !> Read the directions of all rows as Bunge-Euler angles, degrees, if the table states them.
   subroutine read_directions(table, has_angles, class, parameters, euler_deg, error)
      type(table_type), intent(in) :: table
      !> Whether the table has Euler angles; directions beside them are refused.
      logical, intent(in) :: has_angles
      type(crystal_class_type), intent(in) :: class
      !> Parameters of the unit cell; may be unallocated.
      real(wp), allocatable, intent(in) :: parameters(:)
      !> (3, n); unallocated if the table states no directions.
      real(wp), allocatable, intent(out) :: euler_deg(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(lattice_type) :: lattice
      real(wp), allocatable :: indices(:, :), row(:)
      real(wp) :: v(3)
      integer, allocatable :: columns(:)
      integer :: way, i

      call find_way()
      if (allocated(error) .or. way == 0) return
      if (has_angles) then
         call refuse(error, 'orientations are stated twice, by angles and by ' &
            & //table%name(columns(1))//', '//table%name(columns(2)) &
            & //', ..; one of them is allowed')
      else if (way /= quaternions) then
         call find_lattice()
      end if
      if (allocated(error)) return
      call table%numbers(columns, indices, error)
      if (allocated(error)) return
      allocate (euler_deg(3, table%rows))
      do i = 1, table%rows
         row = indices(:, i)
         if (way == quaternions) then
            if (abs(norm2(row) - 1.0_wp) > rounding) then
               call table%refuse(columns(1), i, ' is of no unit quaternion: q0^2 + q1^2 + q2^2 + ' &
                  & //'q3^2 = '//to_text(sum(row**2))//', and 1 is needed', error)
            end if
            ! The normal z of the sample in crystal axes: the third column of the matrix that
            ! rotates from sample to crystal axes.
            associate (q => row/norm2(row))
               v = [2.0_wp*(q(2)*q(4) + q(1)*q(3)), 2.0_wp*(q(3)*q(4) - q(1)*q(2)), &
                  & q(1)**2 - q(2)**2 - q(3)**2 + q(4)**2]
            end associate
         else
            if (maxval(abs(row)) <= 0.0_wp) then
               call table%refuse(columns(1), i, ' and all other indices are 0: no direction', error)
            end if
            if (size(columns) == 4) then
               if (abs(sum(row(:3))) > rounding*maxval(abs(row))) then
                  call table%refuse(columns(3), i, ': the first three of four indices have ' &
                     & //'the sum '//to_text(sum(row(:3)))//', and 0 is needed', error)
               end if
               if (way == four_directions) row(:2) = row(:2) - row(3)
               row(3) = row(4)
            end if
            v = matmul(lattice%normals, row(:3))
            if (way == directions .or. way == four_directions) v = matmul(lattice%edges, row(:3))
         end if
         if (allocated(error)) return
         euler_deg(:, i) = angles_of_direction(v/norm2(v))
      end do

   contains

      !> Find the way in which the table states directions, 0 if it does not, and its columns. Two
      !> ways are refused.
      subroutine find_way()
         character(len=len(ways)), allocatable :: names(:)
         integer, allocatable :: own(:)
         integer :: i, j

         way = 0
         allocate (columns(0))
         do i = 1, size(ways)
            names = split_list(ways(i))
            own = [(table%find(trim(names(j))), j=1, size(names))]
            if (any(own == 0)) cycle
            ! Three of four indices are not another way.
            if ((way == four_directions .and. i == directions) &
               & .or. (way == four_planes .and. i == planes)) then
               cycle
            end if
            if (way > 0) then
               call refuse(error, 'orientations are stated twice, by '//trim(ways(way)) &
                  & //' and by '//trim(ways(i))//'; one of them is allowed')
               return
            end if
            way = i
            columns = own
         end do
      end subroutine find_way

      !> Find the unit cell to which indices refer.
      subroutine find_lattice()
         character(len=:), allocatable :: open

         open = lattice_parameters(class)
         if (allocated(parameters)) then
            call new_lattice(class, parameters, lattice, error)
         else if (len(open) == 0) then
            call new_lattice(class, [real(wp) ::], lattice, error)
         else
            call refuse(error, 'the columns '//trim(ways(way))//' are indices of a '//class%name &
               & //' crystal, whose directions depend on its cell: &problem lattice = '//open &
               & //' (lengths in any unit, angles in degrees) is needed')
         end if
         if (.not. allocated(error) .and. size(columns) == 4 .and. .not. lattice%is_hexagonal) then
            call refuse(error, 'the columns '//trim(ways(way)) &
               & //' are four indices, which only cells with 120 degrees between a and b have; a ' &
               & //class%name//' crystal has three')
         end if
      end subroutine find_lattice
   end subroutine read_directions

   !> Bunge-Euler angles, degrees, whose g rotates the sample's z to a direction.
   pure function angles_of_direction(v) result(euler_deg)
      !> Unit vector in crystal axes.
      real(wp), intent(in) :: v(3)
      real(wp) :: euler_deg(3)

      euler_deg = [0.0_wp, acos(max(-1.0_wp, min(1.0_wp, v(3)))), &
         & modulo(atan2(v(1), v(2)), 2.0_wp*pi)]/degree
   end function angles_of_direction

end module direction_columns
