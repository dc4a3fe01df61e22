!> Crystal elasticity and half-space theory against closed forms.
program test_crystal
   use crystal_elasticity, only: anisotropy_index, averages_type, check_stiffness, is_stable, new_stiffness, &
      & polycrystal_averages, rotate_stiffness, rotation_matrix, stiffness_tensor, symmetry_cubic, symmetry_hexagonal
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: degree, wp
   use testing, only: check, check_close, check_refused, check_success, finish
   implicit none

   real(wp), parameter :: zinc(5) = [161.1_wp, 34.2_wp, 38.3_wp, 61.1_wp, 50.3_wp]
   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp]

   call test_rotation()
   call test_stability()
   call test_averages()
   call test_theory()
   call finish()

contains

   subroutine test_rotation()
      real(wp) :: g(3, 3), c(6, 6), crystal(3, 3, 3, 3), sample(3, 3, 3, 3), turned(3, 3, 3, 3)
      integer :: i, j, k, l, p, q, r, s

      g = rotation_matrix([15.0_wp, 25.0_wp, 35.0_wp]*degree)
      call check('g is orthogonal', maxval(abs(matmul(g, transpose(g)) - identity())) < 1.0e-15_wp)
      c = new_stiffness(symmetry_hexagonal, zinc)
      crystal = stiffness_tensor(c)
      sample = stiffness_tensor(rotate_stiffness(c, g))
      turned = 0.0_wp
      do l = 1, 3; do k = 1, 3; do j = 1, 3; do i = 1, 3
            do s = 1, 3; do r = 1, 3; do q = 1, 3; do p = 1, 3
                  turned(i, j, k, l) = turned(i, j, k, l) + g(p, i)*g(q, j)*g(r, k)*g(s, l)*crystal(p, q, r, s)
               end do; end do; end do; end do
         end do; end do; end do; end do
      call check('Bond rotation equals the tensor rotation', maxval(abs(turned - sample)) < 1.0e-12_wp*161.1_wp)
   end subroutine test_rotation

   subroutine test_stability()
      type(error_type), allocatable :: error

      call check('copper is stable', is_stable(new_stiffness(symmetry_cubic, copper)))
      call check('C11 = C12 is unstable', .not. is_stable(new_stiffness(symmetry_cubic, [100.0_wp, 100.0_wp, 50.0_wp])))
      call check('C33 (C11+C12) < 2 C13^2 is unstable', &
         & .not. is_stable(new_stiffness(symmetry_hexagonal, [100.0_wp, 50.0_wp, 40.0_wp, 70.0_wp, 73.0_wp])))
      call check_stiffness(new_stiffness(symmetry_cubic, [50.0_wp, 100.0_wp, 50.0_wp]), error)
      call check_refused('an unstable crystal is refused', error, 'unstable')
   end subroutine test_stability

   subroutine test_averages()
      type(averages_type) :: averages
      type(error_type), allocatable :: error
      real(wp) :: expected

      call polycrystal_averages(new_stiffness(symmetry_cubic, copper), averages, error)
      call check_success('averages of copper', error)
      call check_close('cubic bulk modulus', averages%bulk_reuss, (168.4_wp + 2*121.4_wp)/3, 1.0e-10_wp)
      call check_close('cubic Voigt shear', averages%shear_voigt, (168.4_wp - 121.4_wp + 3*75.4_wp)/5, 1.0e-10_wp)
      expected = 5.0_wp*averages%shear_voigt/averages%shear_reuss + averages%bulk_voigt/averages%bulk_reuss - 6.0_wp
      call check_close('Eq. 14, cubic', anisotropy_index(symmetry_cubic, copper), expected, 1.0e-10_wp)
      call check_close('Eq. 14 of copper', expected, 1.824218_wp, 1.0e-6_wp)
      call polycrystal_averages(new_stiffness(symmetry_hexagonal, zinc), averages, error)
      expected = 5.0_wp*averages%shear_voigt/averages%shear_reuss + averages%bulk_voigt/averages%bulk_reuss - 6.0_wp
      call check_close('Eq. 14, hexagonal', anisotropy_index(symmetry_hexagonal, zinc), expected, 1.0e-10_wp)
   end subroutine test_averages

   subroutine test_theory()
      type(halfspace_type) :: result
      type(error_type), allocatable :: error
      real(wp) :: c11, c33, c13, c44, expected, youngs, nu

      youngs = 200.0_wp
      nu = 0.3_wp
      c11 = youngs*(1 - nu)/((1 + nu)*(1 - 2*nu))
      c44 = youngs/(2*(1 + nu))
      call halfspace_modulus(new_stiffness(symmetry_cubic, [c11, c11 - 2*c44, c44]), [0.3_wp, 0.4_wp, 0.5_wp], result, error)
      call check_close('isotropic limit E/(1-nu^2)', result%modulus, youngs/(1 - nu**2), 1.0e-6_wp)
      c11 = zinc(1)
      c44 = zinc(3)
      c33 = zinc(4)
      c13 = zinc(5)
      expected = 2.0_wp*sqrt((c11*c33 - c13**2)/c11/(1/c44 + 2/(sqrt(c11*c33) + c13)))
      call halfspace_modulus(new_stiffness(symmetry_hexagonal, zinc), [0.0_wp, 0.0_wp, 0.0_wp], result, error)
      call check_close('closed form along c', result%modulus, expected, 1.0e-6_wp)
      call check_close('a circle along c', result%axis_ratio, 1.0_wp, 1.0e-6_wp)
      call halfspace_modulus(new_stiffness(symmetry_hexagonal, zinc), [15.0_wp, 25.0_wp, 35.0_wp]*degree, result, error)
      call check_close('zinc, contact ellipse', result%axis_ratio, 0.96392831_wp, 1.0e-5_wp)
      call check_close('zinc, major axis', result%major_axis/degree, 105.0_wp, 1.0e-3_wp)
      call check('exact is not below Vlassak-Nix', result%modulus >= result%modulus_circular)
   end subroutine test_theory

   pure function identity() result(i3)
      real(wp) :: i3(3, 3)

      i3 = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1], [3, 3])
   end function identity
end program test_crystal
