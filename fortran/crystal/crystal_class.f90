!> The crystal classes with different forms of the stiffness. One row of a table defines a class;
!> all other properties follow from it by averaging over its group, here the linear map from the
!> constants to the stiffness.
!>
!> Crystal axes are those of the IEEE standard 176. Voigt order 11,22,33,23,13,12 without factors of
!> two, GPa.
!>
!> Crystal directions and planes refer to the edges of the unit cell of a class: z is along c, and y
!> along b*, the normal of the plane of a and c. The edge a of hexagonal, trigonal and tetragonal
!> crystals is therefore along x. Trigonal crystals have hexagonal cells.
module crystal_class
   use crystal_elasticity, only: rotate_stiffness
   use errors, only: error_type, refuse
   use kinds, only: degree, pi, wp
   use small_matrices, only: factor_definite, solve_lower, solve_upper
   use space_groups, only: laue_class
   use text, only: join, lower, read_real, split_list, to_text
   implicit none
   private
   public :: crystal_class_type, new_crystal_class, crystal_class_names, general_class, &
      & rotation_about, rotations_about, lattice_type, new_lattice, lattice_parameters

   type :: row_type
      !> The name and its synonyms.
      character(len=28) :: names
      !> Proper rotations that, with the inversion, generate the group of the stiffness: 'fold
      !> axis'; fold 0 is an axis of infinite order.
      character(len=12) :: generators
      !> The unit cell: edges a, b, c and angles alpha, beta, gamma in degrees. A name is a free
      !> parameter; the same name stands for the same value.
      character(len=29) :: cell
      !> The independent entries of the stiffness, in the order of the arguments.
      character(len=83) :: constants
   end type row_type

   type(row_type), parameter :: classes_of_high_symmetry(*) = [ &
      & row_type('isotropic', '0 z, 0 x', 'a, a, a, 90, 90, 90', 'C11 C12'), &
      & row_type('cubic, m-3m, m-3, fcc, bcc', '4 z, 3 xyz', 'a, a, a, 90, 90, 90', &
      & 'C11 C12 C44'), &
      & row_type('hexagonal, 6/mmm, 6/m, hcp', '0 z', 'a, a, c, 90, 90, 120', &
      & 'C11 C12 C44 C33 C13'), &
      & row_type('tetragonal, 4/mmm', '4 z, 2 x', 'a, a, c, 90, 90, 90', &
      & 'C11 C12 C13 C33 C44 C66'), &
      & row_type('4/m', '4 z', 'a, a, c, 90, 90, 90', 'C11 C12 C13 C33 C44 C66 C16')]
   type(row_type), parameter :: classes_of_low_symmetry(*) = [ &
      & row_type('trigonal, -3m', '3 z, 2 x', 'a, a, c, 90, 90, 120', 'C11 C12 C13 C14 C33 C44'), &
      & row_type('-3', '3 z', 'a, a, c, 90, 90, 120', 'C11 C12 C13 C14 C33 C44 C15'), &
      & row_type('orthorhombic, mmm', '2 z, 2 x', 'a, b, c, 90, 90, 90', &
      & 'C11 C12 C13 C22 C23 C33 C44 C55 C66'), &
      & row_type('monoclinic, 2/m', '2 y', 'a, b, c, 90, beta, 90', &
      & 'C11 C12 C13 C15 C22 C23 C25 C33 C35 C44 C46 C55 C66'), &
      & row_type('triclinic, -1', '', 'a, b, c, alpha, beta, gamma', &
      & 'C11 C12 C13 C14 C15 C16 C22 C23 C24 C25 C26 C33 C34 C35 C36 C44 C45 C46 C55 C56 C66')]
   type(row_type), parameter :: table(*) = [classes_of_high_symmetry, classes_of_low_symmetry]

   !> The class without symmetry, whose constants are all 21 entries row by row.
   character(len=*), parameter :: general_class = 'triclinic'

   type :: crystal_class_type
      character(len=:), allocatable :: name
      !> Edges a, b, c and angles alpha, beta, gamma of the unit cell, separated by ', '.
      character(len=:), allocatable :: cell
      !> Names of the independent constants, (n_constants), and the row and column of each, (2,
      !> n_constants).
      character(len=3), allocatable :: constants(:)
      integer, allocatable, private :: entry(:, :)
      integer :: n_constants = 0
      !> Proper rotations that generate the group, (3, 3, n); an axis of infinite order is given by
      !> a rotation through 1 radian.
      real(wp), allocatable :: generators(:, :, :)
      !> Fold of each generator, 0 for infinite order, (n).
      integer, allocatable :: folds(:)
      !> The linear map from the constants to the upper triangle of the stiffness, where it is not
      !> zero: the entry (row, column) is a sum of factors times constants.
      integer, allocatable :: row(:), column(:), constant(:)
      real(wp), allocatable :: factor(:)
   contains
      procedure :: stiffness, stiffnesses, constants_of, includes
   end type crystal_class_type

   type :: lattice_type
      !> The edges a, b, c in crystal axes, one a column, and the normals of the planes 100, 010,
      !> 001, (3, 3); in the units of the parameters.
      real(wp) :: edges(3, 3) = 0.0_wp, normals(3, 3) = 0.0_wp
      !> Whether the angle between a and b is 120 degrees by symmetry, so that directions may have
      !> four indices.
      logical :: is_hexagonal = .false.
   contains
      procedure :: nearest
   end type lattice_type

contains

   !> The class of a name or synonym, in upper or lower case, or of a space group.
   subroutine new_crystal_class(name, class, error)
      character(len=*), intent(in) :: name
      type(crystal_class_type), intent(out) :: class
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: word
      integer :: i, j, k

      word = lower(adjustl(name))
      if (index(', '//crystal_class_names()//',', ', '//trim(word)//',') == 0) then
         word = laue_class(word)
      end if
      do i = 1, size(table)
         if (any(split_list(table(i)%names) == word)) exit
      end do
      if (i > size(table)) then
         call refuse(error, ''''//trim(name)//''' is no crystal class; allowed ' &
            & //crystal_class_names())
         return
      end if
      class%name = table(i)%names(:scan(table(i)%names, ', ') - 1)
      class%cell = trim(table(i)%cell)
      class%n_constants = (len_trim(table(i)%constants) + 1)/4
      class%constants = [(table(i)%constants(4*k - 3:4*k - 1), k=1, class%n_constants)]
      class%entry = reshape([((iachar(class%constants(k)(j:j)) - iachar('0'), j=2, 3), k=1, &
         & class%n_constants)], [2, class%n_constants])
      call rotations_about(table(i)%generators, class%generators, class%folds)
      call derive_map(class)
   end subroutine new_crystal_class

   !> Every name and synonym: 'isotropic, cubic, m-3m, ..'.
   function crystal_class_names() result(names)
      character(len=:), allocatable :: names

      names = join(table%names, ', ')
   end function crystal_class_names

   !> The proper rotations of a list 'fold axis, ..': folds are 0 (a rotation through 1 radian), 2,
   !> 3, 4, 6; the axis is a sum of x, y, z.
   pure subroutine rotations_about(list, rotations, folds)
      character(len=*), intent(in) :: list
      !> Rotation matrices.
      real(wp), allocatable, intent(out) :: rotations(:, :, :)
      !> Fold of each rotation.
      integer, allocatable, intent(out) :: folds(:)
      character(len=:), allocatable :: items(:)
      real(wp) :: u(3), angle
      integer :: i, j

      items = split_list(list)
      allocate (rotations(3, 3, size(items)), folds(size(items)))
      do i = 1, size(items)
         folds(i) = iachar(items(i)(1:1)) - iachar('0')
         angle = 1.0_wp
         if (folds(i) > 0) angle = 2.0_wp*pi/folds(i)
         u = [(merge(1.0_wp, 0.0_wp, scan(items(i), 'xyz' (j:j)) > 0), j=1, 3)]
         rotations(:, :, i) = rotation_about(u, angle)
         ! Make zeros, halves and ones exact.
         associate (r => rotations(:, :, i))
            where (abs(r - snapped(r)) < 1.0e-12_wp) r = snapped(r)
         end associate
      end do
   end subroutine rotations_about

   !> The rotation through an angle about an axis.
   pure function rotation_about(axis, angle) result(rotation)
      !> An axis of any length; radians.
      real(wp), intent(in) :: axis(3), angle
      real(wp) :: rotation(3, 3), u(3), cross(3, 3)

      u = axis/norm2(axis)
      cross = reshape([0.0_wp, u(3), -u(2), -u(3), 0.0_wp, u(1), u(2), -u(1), 0.0_wp], [3, 3])
      rotation = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3]) &
         & + sin(angle)*cross + (1.0_wp - cos(angle))*matmul(cross, cross)
   end function rotation_about

   pure elemental real(wp) function snapped(x)
      real(wp), intent(in) :: x

      snapped = 0.5_wp*anint(2.0_wp*x)
   end function snapped

   !> Express the stiffnesses that every generator leaves unchanged as linear maps of the named
   !> constants. The equations C(g) = C for the 21 entries are solved by least squares for the
   !> entries that are not constants. The factors of the map are halves of integers in every class.
   pure subroutine derive_map(self)
      type(crystal_class_type), intent(inout) :: self
      integer :: g, i, j, k, named(self%n_constants)
      !> Rows and columns of the 21 entries of the upper triangle, row by row.
      integer, parameter :: first(21) = [([(i, j=i, 6)], i=1, 6)], &
         & second(21) = [([(j, j=i, 6)], i=1, 6)]
      real(wp) :: equations(21*size(self%generators, 3), 21), unit(6, 6), change(6, 6), &
         & map(21, self%n_constants)
      real(wp), allocatable :: gram(:, :), solution(:, :)
      integer, allocatable :: other(:)

      named = [(findloc(first == self%entry(1, k) .and. second == self%entry(2, k), .true., &
         & dim=1), k=1, self%n_constants)]
      other = pack([(k, k=1, 21)], [(all(named /= k), k=1, 21)])
      do k = 1, 21
         unit = 0.0_wp
         unit(first(k), second(k)) = 1.0_wp
         unit(second(k), first(k)) = 1.0_wp
         do g = 1, size(self%generators, 3)
            change = rotate_stiffness(unit, self%generators(:, :, g)) - unit
            equations(21*g - 20:21*g, k) = [(change(first(i), second(i)), i=1, 21)]
         end do
      end do
      solution = -matmul(transpose(equations(:, other)), equations(:, named))
      gram = matmul(transpose(equations(:, other)), equations(:, other))
      ! LAPACK is avoided, because OpenBLAS waits for ever for memory that is limited.
      call factor_definite(gram, 1.0e-9_wp)
      do k = 1, size(solution, 2)
         call solve_lower(gram, solution(:, k))
         call solve_upper(gram, solution(:, k))
      end do
      map = 0.0_wp
      map(other, :) = snapped(solution)
      do i = 1, self%n_constants
         map(named(i), i) = 1.0_wp
      end do
      associate (n => self%n_constants, not_zero => abs(map) > 0.0_wp)
         self%row = pack(spread(first, 2, n), not_zero)
         self%column = pack(spread(second, 2, n), not_zero)
         self%constant = pack(spread([(i, i=1, n)], 1, 21), not_zero)
         self%factor = pack(map, not_zero)
      end associate
   end subroutine derive_map

   !> Stiffness in crystal axes, GPa.
   pure function stiffness(self, constants) result(c)
      class(crystal_class_type), intent(in) :: self
      !> GPa, (n_constants).
      real(wp), intent(in) :: constants(:)
      real(wp) :: c(6, 6)
      integer :: k

      c = 0.0_wp
      do k = 1, size(self%factor)
         associate (i => self%row(k), j => self%column(k))
            c(i, j) = c(i, j) + self%factor(k)*constants(self%constant(k))
            c(j, i) = c(i, j)
         end associate
      end do
   end function stiffness

   !> Stiffnesses of crystals in crystal axes, GPa, (6, 6, n).
   pure function stiffnesses(self, constants) result(c)
      class(crystal_class_type), intent(in) :: self
      !> GPa, and perhaps more parameters, (parameter, n).
      real(wp), intent(in) :: constants(:, :)
      real(wp), allocatable :: c(:, :, :)
      integer :: i

      allocate (c(6, 6, size(constants, 2)))
      do i = 1, size(constants, 2)
         c(:, :, i) = self%stiffness(constants(:self%n_constants, i))
      end do
   end function stiffnesses

   !> The constants of a stiffness in crystal axes, GPa.
   pure function constants_of(self, c) result(constants)
      class(crystal_class_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: constants(self%n_constants)
      integer :: k

      constants = [(c(self%entry(1, k), self%entry(2, k)), k=1, self%n_constants)]
   end function constants_of

   !> Whether every stiffness of another class, in the same axes, also has the symmetry of this
   !> class.
   pure logical function includes(self, other)
      class(crystal_class_type), intent(in) :: self
      type(crystal_class_type), intent(in) :: other
      real(wp) :: unit(other%n_constants), c(6, 6)
      integer :: k

      includes = .true.
      do k = 1, other%n_constants
         unit = 0.0_wp
         unit(k) = 1.0_wp
         c = other%stiffness(unit)
         includes = includes .and. maxval(abs(c - self%stiffness(self%constants_of(c)))) < 1.0e-9_wp
      end do
   end function includes

   !> The free lattice parameters of a class, 'a, c'; empty if crystal directions do not depend on
   !> them.
   pure function lattice_parameters(class) result(list)
      type(crystal_class_type), intent(in) :: class
      character(len=:), allocatable :: list
      character(len=len(class%cell)) :: fields(6)
      integer :: i

      fields = split_list(class%cell)
      list = join(pack(fields, [(scan(fields(i)(1:1), '0123456789') == 0 &
         & .and. all(fields(:i - 1) /= fields(i)), i=1, 6)]), ', ')
      if (list == 'a') list = ''
   end function lattice_parameters

   !> The cell of a class with these parameters.
   subroutine new_lattice(class, values, lattice, error)
      type(crystal_class_type), intent(in) :: class
      !> In the order of `lattice_parameters`: lengths in any unit, angles in degrees.
      real(wp), intent(in) :: values(:)
      type(lattice_type), intent(out) :: lattice
      type(error_type), allocatable, intent(out) :: error
      character(len=len(class%cell)), allocatable :: fields(:), names(:)
      character(len=:), allocatable :: needed
      character(len=24) :: stated(6)
      real(wp) :: cell(6), cosine(3), height
      integer :: i, k, outcome

      fields = split_list(class%cell)
      names = split_list(lattice_parameters(class))
      needed = to_text(size(names))//': '//lattice_parameters(class) &
         & //' (lengths in any unit, angles in degrees)'
      if (size(names) == 0) needed = 'none: its directions do not depend on the cell'
      if (size(values) /= size(names)) then
         call refuse(error, 'the number of values is '//to_text(size(values))//'; a '//class%name &
            & //' crystal needs '//needed)
         return
      end if
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
            call refuse(error, &
               & 'lattice parameters '//join(stated(:size(values)), ', ')//' are no cell; ' &
               & //lattice_parameters(class)//': lengths are positive, angles those of a solid')
            return
         end if
         lattice%edges(:, 1) = cell(1)*[sine, 0.0_wp, cosine(2)]
         lattice%edges(:, 2) = cell(2)*[cross/sine, sqrt(height), cosine(1)]
         lattice%edges(:, 3) = cell(3)*[0.0_wp, 0.0_wp, 1.0_wp]
      end associate
      do i = 1, 3
         associate (p => lattice%edges(:, modulo(i, 3) + 1), &
            & q => lattice%edges(:, modulo(i + 1, 3) + 1))
            lattice%normals(:, i) = [p(2)*q(3) - p(3)*q(2), p(3)*q(1) - p(1)*q(3), &
               & p(1)*q(2) - p(2)*q(1)]
         end associate
      end do
      lattice%is_hexagonal = fields(6) == '120'
   end subroutine new_lattice

   !> The smallest indices, as '[1 -1 2]', of a direction within 2 degrees, or else the nearest
   !> direction with indices up to 9.
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

end module crystal_class
