!> Crystal elasticity and half-space theory against closed forms.
program test_crystal_elasticity
   use crystal_elasticity, only: anisotropy_index, averages_type, check_stiffness, is_stable, &
      & log_anisotropy, polycrystal_averages, rotate_stiffness, rotation_matrix, voigt_index
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: degree, wp
   use testing, only: check, check_close, check_refused, finish, stiffness_of
   implicit none

   real(wp), parameter :: zinc(5) = [161.1_wp, 34.2_wp, 38.3_wp, 61.1_wp, 50.3_wp]
   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp]

   call test_rotation()
   call test_stability()
   call test_averages()
   call test_log_anisotropy()
   call test_theory()
   call finish()

contains

   subroutine test_rotation()
      real(wp) :: g(3, 3), c(6, 6), crystal(3, 3, 3, 3), sample(3, 3, 3, 3), turned(3, 3, 3, 3)
      integer :: i, j, k, l, p, q, r, s

      g = rotation_matrix([15.0_wp, 25.0_wp, 35.0_wp]*degree)
      call check('g is orthogonal', maxval(abs(matmul(g, transpose(g)) - identity())) < 1.0e-15_wp)
      c = stiffness_of('hexagonal', zinc)
      crystal = stiffness_tensor(c)
      sample = stiffness_tensor(rotate_stiffness(c, g))
      turned = 0.0_wp
      do l = 1, 3; do k = 1, 3; do j = 1, 3; do i = 1, 3
            do s = 1, 3; do r = 1, 3; do q = 1, 3; do p = 1, 3
                  turned(i, j, k, l) = turned(i, j, k, l) + g(p, i)*g(q, j)*g(r, k)*g(s, &
                     & l)*crystal(p, q, r, s)
               end do; end do; end do; end do
         end do; end do; end do; end do
      call check('Bond rotation equals the tensor rotation', &
         & maxval(abs(turned - sample)) < 1.0e-12_wp*161.1_wp)
   end subroutine test_rotation

   subroutine test_stability()
      type(error_type), allocatable :: error

      call check('copper is stable', is_stable(stiffness_of('cubic', copper)))
      call check('C11 = C12 is unstable', &
         & .not. is_stable(stiffness_of('cubic', [100.0_wp, 100.0_wp, 50.0_wp])))
      call check('C33 (C11+C12) < 2 C13^2 is unstable', .not. is_stable(stiffness_of('hexagonal', &
         & [100.0_wp, 50.0_wp, 40.0_wp, 70.0_wp, 73.0_wp])))
      call check_stiffness(stiffness_of('cubic', [50.0_wp, 100.0_wp, 50.0_wp]), error)
      call check_refused('an unstable crystal is refused', error, 'unstable')
   end subroutine test_stability

   !> Against the closed forms of cubic and hexagonal crystals (Watt & Peselnick, J. Appl. Phys. 51,
   !> 1525, 1980).
   subroutine test_averages()
      type(averages_type) :: averages
      real(wp) :: c66, det, kv, gv, kr, gr, expected

      averages = polycrystal_averages(stiffness_of('cubic', copper))
      call check_close('cubic bulk modulus', averages%bulk_reuss, &
         & (168.4_wp + 2*121.4_wp)/3, 1.0e-10_wp)
      call check_close('cubic Voigt shear', averages%shear_voigt, &
         & (168.4_wp - 121.4_wp + 3*75.4_wp)/5, 1.0e-10_wp)
      call check_close('cubic Reuss shear', averages%shear_reuss, &
         & 5/(4/(168.4_wp - 121.4_wp) + 3/75.4_wp), 1.0e-10_wp)
      call check_close('Eq. 14 of copper', anisotropy_index(stiffness_of('cubic', copper)), &
         & 1.824218_wp, 1.0e-6_wp)
      associate (c11 => zinc(1), c12 => zinc(2), c44 => zinc(3), c33 => zinc(4), c13 => zinc(5))
         c66 = 0.5_wp*(c11 - c12)
         det = (c11 + c12)*c33 - 2*c13**2
         kv = (2*(c11 + c12) + 4*c13 + c33)/9
         gv = (c11 + c12 + 2*c33 - 4*c13 + 12*c44 + 12*c66)/30
         kr = det/(c11 + c12 + 2*c33 - 4*c13)
         gr = 2.5_wp*det*c44*c66/(3*kv*c44*c66 + det*(c44 + c66))
      end associate
      expected = 5*gv/gr + kv/kr - 6
      call check_close('Eq. 14, hexagonal', anisotropy_index(stiffness_of('hexagonal', zinc)), &
         & expected, 1.0e-12_wp)
      call check_close('Eq. 14, isotropic', &
         & anisotropy_index(stiffness_of('isotropic', [77.39_wp, 15.85_wp])), 0.0_wp, 1.0e-13_wp)
      call check('no index of an unstable crystal', .not. anisotropy_index(stiffness_of('cubic', &
         & [50.0_wp, 100.0_wp, 50.0_wp])) < huge(1.0_wp))
   end subroutine test_averages

   !> The values of the design, rounded to two digits; no rotation changes them, and the isotropic
   !> one is zero.
   subroutine test_log_anisotropy()
      real(wp) :: turned(6, 6)

      call check_log('Ti', 'hexagonal', [162.0_wp, 92.0_wp, 47.0_wp, 180.0_wp, 69.0_wp], 0.42_wp)
      call check_log('forsterite', 'mmm', [328.0_wp, 69.0_wp, 69.0_wp, 200.0_wp, 73.0_wp, &
         & 235.0_wp, 66.7_wp, 81.3_wp, 80.9_wp], 0.47_wp)
      call check_log('quartz', '-3m', &
         & [86.6_wp, 6.7_wp, 12.6_wp, -17.8_wp, 106.1_wp, 57.8_wp], 0.88_wp)
      call check_log('Sn', '4/mmm', [72.3_wp, 59.4_wp, 35.8_wp, 88.4_wp, 22.0_wp, 24.0_wp], 1.18_wp)
      call check_log('Zn', 'hexagonal', zinc, 1.24_wp)
      call check_log('Cu', 'cubic', copper, 1.28_wp)
      call check_log('calcite', '-3m', &
         & [149.0_wp, 57.1_wp, 53.4_wp, -20.5_wp, 85.3_wp, 33.5_wp], 1.28_wp)
      call check_log('albite', '-1', [69.9_wp, 34.0_wp, 30.8_wp, 5.1_wp, -2.4_wp, -0.9_wp, &
         & 183.5_wp, 5.5_wp, -3.9_wp, -7.7_wp, -5.8_wp, 179.5_wp, -8.7_wp, 7.1_wp, -9.8_wp, &
         & 24.9_wp, -2.4_wp, -7.2_wp, 26.8_wp, 0.5_wp, 33.5_wp], 1.34_wp)
      call check_close('log-anisotropy, isotropic', &
         & log_anisotropy(stiffness_of('isotropic', [77.39_wp, 15.85_wp])), 0.0_wp, 1.0e-7_wp)
      turned = rotate_stiffness(stiffness_of('cubic', copper), &
         & rotation_matrix([15.0_wp, 25.0_wp, 35.0_wp]*degree))
      call check_close('log-anisotropy of a turned crystal', log_anisotropy(turned), &
         & log_anisotropy(stiffness_of('cubic', copper)), 1.0e-12_wp)
      call check('no log-anisotropy of an unstable crystal', &
         & .not. log_anisotropy(stiffness_of('cubic', [50.0_wp, 100.0_wp, 50.0_wp])) < huge(1.0_wp))
   end subroutine test_log_anisotropy

   subroutine check_log(crystal, class, constants, expected)
      character(len=*), intent(in) :: crystal, class
      real(wp), intent(in) :: constants(:), expected

      call check_close('log-anisotropy of '//crystal, &
         & log_anisotropy(stiffness_of(class, constants)), expected, 0.005_wp)
   end subroutine check_log

   subroutine test_theory()
      type(halfspace_type) :: result
      type(error_type), allocatable :: error
      real(wp) :: c11, c33, c13, c44, expected, youngs, nu

      youngs = 200.0_wp
      nu = 0.3_wp
      c11 = youngs*(1 - nu)/((1 + nu)*(1 - 2*nu))
      c44 = youngs/(2*(1 + nu))
      call halfspace_modulus(stiffness_of('cubic', [c11, c11 - 2*c44, c44]), &
         & [0.3_wp, 0.4_wp, 0.5_wp], result, error)
      call check_close('isotropic limit E/(1-nu^2)', result%modulus, youngs/(1 - nu**2), 1.0e-6_wp)
      c11 = zinc(1)
      c44 = zinc(3)
      c33 = zinc(4)
      c13 = zinc(5)
      expected = 2.0_wp*sqrt((c11*c33 - c13**2)/c11/(1/c44 + 2/(sqrt(c11*c33) + c13)))
      call halfspace_modulus(stiffness_of('hexagonal', zinc), [0.0_wp, 0.0_wp, 0.0_wp], &
         & result, error)
      call check_close('closed form along c', result%modulus, expected, 1.0e-6_wp)
      call check_close('a circle along c', result%modulus_circular, result%modulus, 1.0e-6_wp)
      call halfspace_modulus(stiffness_of('hexagonal', zinc), [15.0_wp, 25.0_wp, 35.0_wp]*degree, &
         & result, error)
      call check('exact is not below Vlassak-Nix', result%modulus >= result%modulus_circular)
   end subroutine test_theory

   pure function identity() result(i3)
      real(wp) :: i3(3, 3)

      i3 = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
   end function identity

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
end program test_crystal_elasticity
