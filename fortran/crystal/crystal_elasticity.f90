!> Elastic constants of one crystal: stiffness, rotation, stability, polycrystal averages, anisotropy.
!>
!> Stiffness in GPa, Voigt order 11,22,33,23,13,12 without factors of two. Bunge-Euler angles (phi1, Phi, phi2) in
!> radians; g maps sample to crystal axes, v_crystal = g v_sample.
module crystal_elasticity
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_inverse
   use text, only: to_text
   implicit none
   private
   public :: symmetry_cubic, symmetry_hexagonal, symmetry_triclinic
   public :: symmetry_from_name, symmetry_name, constant_count, constant_names
   public :: new_stiffness, rotation_matrix, rotate_stiffness, stiffness_tensor
   public :: is_stable, check_stiffness, averages_type, polycrystal_averages, anisotropy_index, voigt_index

   !> How many constants describe a crystal: 3, 5 or all 21.
   integer, parameter :: symmetry_cubic = 1, symmetry_hexagonal = 2, symmetry_triclinic = 3

   !> Voigt index of a pair of Cartesian indices.
   integer, parameter :: voigt_index(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])

   !> Polycrystal bounds for a uniform texture, GPa (Hill, Proc. Phys. Soc. A 65, 349, 1952).
   type :: averages_type
      real(wp) :: bulk_voigt, shear_voigt, bulk_reuss, shear_reuss
   end type averages_type

contains

   !> The enumerator of 'cubic', 'hexagonal' or 'triclinic'; 0 for any other name.
   pure integer function symmetry_from_name(name) result(symmetry)
      character(len=*), intent(in) :: name

      select case (name)
      case ('cubic')
         symmetry = symmetry_cubic
      case ('hexagonal')
         symmetry = symmetry_hexagonal
      case ('triclinic')
         symmetry = symmetry_triclinic
      case default
         symmetry = 0
      end select
   end function symmetry_from_name

   pure function symmetry_name(symmetry) result(name)
      integer, intent(in) :: symmetry
      character(len=:), allocatable :: name

      select case (symmetry)
      case (symmetry_cubic)
         name = 'cubic'
      case (symmetry_hexagonal)
         name = 'hexagonal'
      case (symmetry_triclinic)
         name = 'triclinic'
      case default
         name = 'unknown'
      end select
   end function symmetry_name

   pure integer function constant_count(symmetry) result(n)
      integer, intent(in) :: symmetry

      select case (symmetry)
      case (symmetry_cubic)
         n = 3
      case (symmetry_hexagonal)
         n = 5
      case default
         n = 21
      end select
   end function constant_count

   !> Names in the order in which constants are passed: C11, C12, C44; C11, C12, C44, C33, C13; or the upper triangle
   !> row by row, C11, C12, .. C66.
   pure function constant_names(symmetry) result(names)
      integer, intent(in) :: symmetry
      character(len=3), allocatable :: names(:)
      integer :: i, j, k

      select case (symmetry)
      case (symmetry_cubic)
         names = ['C11', 'C12', 'C44']
      case (symmetry_hexagonal)
         names = ['C11', 'C12', 'C44', 'C33', 'C13']
      case default
         allocate (names(21))
         k = 0
         do i = 1, 6
            do j = i, 6
               k = k + 1
               names(k) = 'C'//achar(48 + i)//achar(48 + j)
            end do
         end do
      end select
   end function constant_names

   !> Stiffness in the crystal frame from the independent constants of the symmetry (GPa, order of `constant_names`).
   pure function new_stiffness(symmetry, constants) result(c)
      integer, intent(in) :: symmetry
      real(wp), intent(in) :: constants(:)
      real(wp) :: c(6, 6)
      integer :: i, j, k

      c = 0.0_wp
      select case (symmetry)
      case (symmetry_cubic)
         c(:3, :3) = constants(2)
         do i = 1, 3
            c(i, i) = constants(1)
            c(i + 3, i + 3) = constants(3)
         end do
      case (symmetry_hexagonal)
         c(:3, :3) = constants(5)
         c(1, 1) = constants(1)
         c(2, 2) = constants(1)
         c(3, 3) = constants(4)
         c(1, 2) = constants(2)
         c(2, 1) = constants(2)
         c(4, 4) = constants(3)
         c(5, 5) = constants(3)
         c(6, 6) = 0.5_wp*(constants(1) - constants(2))
      case default
         k = 0
         do i = 1, 6
            do j = i, 6
               k = k + 1
               c(i, j) = constants(k)
               c(j, i) = constants(k)
            end do
         end do
      end select
   end function new_stiffness

   !> Bunge's g from (phi1, Phi, phi2) in radians: v_crystal = g v_sample.
   pure function rotation_matrix(euler) result(g)
      real(wp), intent(in) :: euler(3)
      real(wp) :: g(3, 3)
      real(wp) :: c1, s1, c, s, c2, s2

      c1 = cos(euler(1))
      s1 = sin(euler(1))
      c = cos(euler(2))
      s = sin(euler(2))
      c2 = cos(euler(3))
      s2 = sin(euler(3))
      g(1, :) = [c1*c2 - s1*s2*c, s1*c2 + c1*s2*c, s2*s]
      g(2, :) = [-c1*s2 - s1*c2*c, -s1*s2 + c1*c2*c, c2*s]
      g(3, :) = [s1*s, -c1*s, c]
   end function rotation_matrix

   !> Stiffness in the sample frame of a crystal whose orientation is `g`: C' = M C Mᵀ with Bond's matrix of gᵀ.
   pure function rotate_stiffness(c, g) result(rotated)
      real(wp), intent(in) :: c(6, 6), g(3, 3)
      real(wp) :: rotated(6, 6)
      real(wp) :: bond(6, 6), a(3, 3)
      integer, parameter :: first(3) = [2, 1, 1], second(3) = [3, 3, 2]
      integer :: i, j

      a = transpose(g)
      do j = 1, 3
         do i = 1, 3
            bond(i, j) = a(i, j)**2
            bond(i, j + 3) = 2.0_wp*a(i, first(j))*a(i, second(j))
            bond(i + 3, j) = a(first(i), j)*a(second(i), j)
            bond(i + 3, j + 3) = a(first(i), first(j))*a(second(i), second(j)) &
               & + a(first(i), second(j))*a(second(i), first(j))
         end do
      end do
      rotated = matmul(bond, matmul(c, transpose(bond)))
      rotated = 0.5_wp*(rotated + transpose(rotated))
   end function rotate_stiffness

   !> The fourth-rank tensor C_ijkl of a stiffness matrix.
   pure function stiffness_tensor(c) result(tensor)
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: tensor(3, 3, 3, 3)
      integer :: i, j, k, l

      do l = 1, 3
         do k = 1, 3
            do j = 1, 3
               do i = 1, 3
                  tensor(i, j, k, l) = c(voigt_index(i, j), voigt_index(k, l))
               end do
            end do
         end do
      end do
   end function stiffness_tensor

   !> Born's criterion: the strain energy is positive, that is, the stiffness is positive definite.
   pure logical function is_stable(c)
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: l(6, 6), pivot
      integer :: i, j

      is_stable = .false.
      l = 0.0_wp
      do j = 1, 6
         pivot = c(j, j) - sum(l(j, :j - 1)**2)
         if (.not. pivot > 1.0e-12_wp*abs(c(j, j))) return
         l(j, j) = sqrt(pivot)
         do i = j + 1, 6
            l(i, j) = (c(i, j) - sum(l(i, :j - 1)*l(j, :j - 1)))/l(j, j)
         end do
      end do
      is_stable = .true.
   end function is_stable

   !> Refuse a stiffness that is not finite or not Born-stable.
   pure subroutine check_stiffness(c, error)
      real(wp), intent(in) :: c(6, 6)
      type(error_type), allocatable, intent(out) :: error

      if (.not. all(abs(c) <= huge(1.0_wp))) then
         call raise(error, 'the stiffness holds a value that is not finite', exit_bad_input)
      else if (.not. is_stable(c)) then
         call raise(error, 'the crystal is elastically unstable (C11 = '//to_text(c(1, 1))//', C12 = ' &
            & //to_text(c(1, 2))//', C44 = '//to_text(c(4, 4))//' GPa); the stiffness must be positive definite', &
            & exit_bad_input)
      end if
   end subroutine check_stiffness

   !> Voigt and Reuss averages of a stable crystal.
   subroutine polycrystal_averages(c, averages, error)
      real(wp), intent(in) :: c(6, 6)
      type(averages_type), intent(out) :: averages
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: s(6, 6)

      averages%bulk_voigt = (c(1, 1) + c(2, 2) + c(3, 3) + 2.0_wp*(c(1, 2) + c(2, 3) + c(1, 3)))/9.0_wp
      averages%shear_voigt = (c(1, 1) + c(2, 2) + c(3, 3) - c(1, 2) - c(2, 3) - c(1, 3) &
         & + 3.0_wp*(c(4, 4) + c(5, 5) + c(6, 6)))/15.0_wp
      s = c
      call cholesky_factor(s, error)
      if (allocated(error)) return
      call cholesky_inverse(s)
      averages%bulk_reuss = 1.0_wp/(s(1, 1) + s(2, 2) + s(3, 3) + 2.0_wp*(s(1, 2) + s(2, 3) + s(1, 3)))
      averages%shear_reuss = 15.0_wp/(4.0_wp*(s(1, 1) + s(2, 2) + s(3, 3) - s(1, 2) - s(2, 3) - s(1, 3)) &
         & + 3.0_wp*(s(4, 4) + s(5, 5) + s(6, 6)))
   end subroutine polycrystal_averages

   !> Universal anisotropy index 5 Gv/Gr + Kv/Kr - 6 (paper's Eq. 14; Ranganathan & Ostoja-Starzewski 2008): 0 for an
   !> isotropic crystal, unbounded towards instability.
   pure real(wp) function anisotropy_index(symmetry, constants) result(index)
      integer, intent(in) :: symmetry
      !> Constants in the order of `constant_names`, GPa; cubic or hexagonal, and stable.
      real(wp), intent(in) :: constants(:)
      real(wp) :: kv, gv, kr, gr, c66, shear, basal, det

      select case (symmetry)
      case (symmetry_cubic)
         shear = 0.5_wp*(constants(1) - constants(2))
         gv = (2.0_wp*shear + 3.0_wp*constants(3))/5.0_wp
         gr = 5.0_wp/(2.0_wp/shear + 3.0_wp/constants(3))
         index = 5.0_wp*gv/gr - 5.0_wp
      case (symmetry_hexagonal)
         ! Closed forms of the averages for hexagonal symmetry (Watt & Peselnick, J. Appl. Phys. 51, 1525, 1980).
         c66 = 0.5_wp*(constants(1) - constants(2))
         basal = constants(1) + constants(2)
         det = basal*constants(4) - 2.0_wp*constants(5)**2
         shear = basal + 2.0_wp*constants(4) - 4.0_wp*constants(5)
         kv = (2.0_wp*basal + 4.0_wp*constants(5) + constants(4))/9.0_wp
         gv = (shear + 12.0_wp*constants(3) + 12.0_wp*c66)/30.0_wp
         kr = det/shear
         gr = 2.5_wp*det*constants(3)*c66/(3.0_wp*kv*constants(3)*c66 + det*(constants(3) + c66))
         index = 5.0_wp*gv/gr + kv/kr - 6.0_wp
      case default
         index = -1.0_wp
      end select
   end function anisotropy_index
end module crystal_elasticity
