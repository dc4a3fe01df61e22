!> Crystal directions and planes in crystal axes: the edges of the unit cell of a crystal class.
!>
!> z is along c and y along b*, the normal of the plane of a and c, as in the IEEE standard 176. So a of hexagonal, trigonal and tetragonal
!> crystals is along x. Trigonal crystals have hexagonal cells.
module crystal_lattice
   use crystal_class, only: crystal_class_type
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: degree, wp
   use numbers, only: read_real
   use text, only: join, lower, split_list, to_text
   implicit none
   private
   public :: lattice_type, new_lattice, lattice_parameters

   type :: lattice_type
      !> The edges a, b, c in crystal axes, columns, and the normals of the planes 100, 010, 001, (3, 3); in the units of the parameters.
      real(wp) :: edges(3, 3) = 0.0_wp, normals(3, 3) = 0.0_wp
      !> Angle between a and b is 120 degrees by symmetry: indices may be four.
      logical :: is_hexagonal = .false.
   contains
      procedure :: nearest
   end type lattice_type

contains

   !> The parameters that a class leaves open, 'a, c'; nothing where directions do not depend on them.
   pure function lattice_parameters(class) result(list)
      type(crystal_class_type), intent(in) :: class
      character(len=:), allocatable :: list
      character(len=len(class%cell)) :: fields(6)
      integer :: i

      fields = split_list(class%cell)
      list = ''
      do i = 1, 6
         if (scan(fields(i)(1:1), '0123456789') > 0 .or. any(fields(:i - 1) == fields(i))) cycle
         list = list//', '//trim(fields(i))
      end do
      list = list(3:)
      if (list == 'a') list = ''
   end function lattice_parameters

   !> The cell of a class with these parameters.
   subroutine new_lattice(class, values, lattice, error)
      type(crystal_class_type), intent(in) :: class
      !> As `lattice_parameters` lists them: lengths in any unit, angles in degrees.
      real(wp), intent(in) :: values(:)
      type(lattice_type), intent(out) :: lattice
      type(error_type), allocatable, intent(out) :: error
      character(len=len(class%cell)), allocatable :: fields(:), names(:)
      character(len=24) :: stated(6)
      real(wp) :: cell(6), cosine(3), height
      integer :: i, k, outcome

      fields = split_list(class%cell)
      names = split_list(lattice_parameters(class))
      if (size(values) > 0 .and. size(names) == 0) then
         call raise(error, 'the number of values is '//to_text(size(values))//'; a '//class%name//' crystal needs none: its ' &
            & //'directions do not depend on the cell', exit_bad_input)
      else if (size(values) /= size(names)) then
         call raise(error, 'the number of values is '//to_text(size(values))//'; a '//class%name//' crystal needs ' &
            & //to_text(size(names))//': '//lattice_parameters(class)//' (lengths in any unit, angles in degrees)', exit_bad_input)
      end if
      if (allocated(error)) return
      cell = 1.0_wp
      do i = 1, 6
         k = findloc(names, fields(i), dim=1)
         if (k > 0) then
            cell(i) = values(k)
         else if (i > 3) then
            call read_real(trim(fields(i)), cell(i), outcome)
         end if
      end do
      cosine = cos(cell(4:)*degree)
      where (abs(cell(4:) - 90.0_wp) <= 0.0_wp) cosine = 0.0_wp
      associate (sine => sqrt(1.0_wp - cosine(2)**2), cross => cosine(3) - cosine(1)*cosine(2))
         height = 1.0_wp - cosine(1)**2 - (cross/sine)**2
         if (any(cell <= 0.0_wp) .or. any(cell(4:) >= 180.0_wp) .or. .not. height > 0.0_wp) then
            do i = 1, size(values)
               stated(i) = to_text(values(i))
            end do
            call raise(error, 'lattice parameters '//join(stated(:size(values)), ', ')//' are no cell; ' &
               & //lattice_parameters(class)//': lengths are positive, angles those of a solid', exit_bad_input)
            return
         end if
         lattice%edges(:, 1) = cell(1)*[sine, 0.0_wp, cosine(2)]
         lattice%edges(:, 2) = cell(2)*[cross/sine, sqrt(height), cosine(1)]
         lattice%edges(:, 3) = cell(3)*[0.0_wp, 0.0_wp, 1.0_wp]
      end associate
      do i = 1, 3
         associate (p => lattice%edges(:, modulo(i, 3) + 1), q => lattice%edges(:, modulo(i + 1, 3) + 1))
            lattice%normals(:, i) = [p(2)*q(3) - p(3)*q(2), p(3)*q(1) - p(1)*q(3), p(1)*q(2) - p(2)*q(1)]
         end associate
      end do
      lattice%is_hexagonal = fields(6) == '120'
   end subroutine new_lattice

   !> '[1 -1 2]': the smallest indices of a direction to 2 degrees, or else the nearest up to 9.
   function nearest(self, v) result(text)
      class(lattice_type), intent(in) :: self
      !> Unit vector in crystal axes.
      real(wp), intent(in) :: v(3)
      character(len=:), allocatable :: text
      integer, parameter :: most = 9
      real(wp), parameter :: near = cos(2.0_wp*degree)
      real(wp) :: along(3), cosine, largest
      integer :: best(3), m, i, j, k

      largest = -1.0_wp
      best = 0
      do m = 1, most
         do k = m, -m, -1
            do j = m, -m, -1
               do i = m, -m, -1
                  if (max(abs(i), abs(j), abs(k)) /= m) cycle
                  along = matmul(self%edges, real([i, j, k], wp))
                  cosine = dot_product(along/norm2(along), v)
                  if (cosine <= largest + 1.0e-12_wp) cycle
                  largest = cosine
                  best = [i, j, k]
               end do
            end do
         end do
         if (largest > near) exit
      end do
      text = '['//to_text(best(1))//' '//to_text(best(2))//' '//to_text(best(3))//']'
   end function nearest
end module crystal_lattice
