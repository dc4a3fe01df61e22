!> Basis and surrogate: orthonormality, symmetry, counts, predictions, the text form.
program test_surrogate
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: rotation_matrix
   use errors, only: error_type
   use kinds, only: pi, wp
   use random, only: new_random_stream, random_stream_type
   use surrogate_basis, only: basis_type, coordinates_box, coordinates_dimensionless, evaluate_harmonics, &
      & evaluate_polynomials, evaluate_terms, new_basis, truncation_tensor, truncation_total
   use surrogate_model, only: is_outside, load_surrogate, predict, save_surrogate, surrogate_type
   use symmetric_harmonics, only: harmonics_of => evaluate_harmonics
   use testing, only: check, check_close, check_refused, check_success, class_of, clenshaw_curtis_weight, finish
   implicit none

   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp]
   real(wp), parameter :: cubic_lower(3) = [50.0_wp, 40.0_wp, 15.0_wp], cubic_upper(3) = [250.0_wp, 150.0_wp, 120.0_wp]
   real(wp), parameter :: hexagonal_lower(5) = [80.0_wp, 40.0_wp, 30.0_wp, 70.0_wp, 40.0_wp]
   real(wp), parameter :: hexagonal_upper(5) = [240.0_wp, 120.0_wp, 90.0_wp, 210.0_wp, 90.0_wp]

   call test_counts()
   call test_direction()
   call test_polynomials()
   call test_homogeneity()
   call test_prediction()
   call finish()

contains

   subroutine make_basis(symmetry, coordinates, truncation, degree, bandlimit, basis)
      character(len=*), intent(in) :: symmetry
      integer, intent(in) :: coordinates, truncation, degree, bandlimit
      type(basis_type), intent(out) :: basis
      type(error_type), allocatable :: error
      type(crystal_class_type) :: crystal

      crystal = class_of(symmetry)
      if (coordinates == coordinates_dimensionless) then
         if (symmetry == 'cubic') then
            call new_basis(crystal, coordinates, truncation, degree, bandlimit, [0.4_wp, -2.0_wp], [0.95_wp, 2.0_wp], basis, &
               & error)
         else
            call new_basis(crystal, coordinates, truncation, degree, bandlimit, [-3.0_wp, -2.0_wp, -1.0_wp, -1.0_wp], &
               & [0.0_wp, 2.0_wp, 3.0_wp, 1.0_wp], basis, error)
         end if
      else if (symmetry == 'cubic') then
         call new_basis(crystal, coordinates, truncation, degree, bandlimit, cubic_lower, cubic_upper, basis, error)
      else
         call new_basis(crystal, coordinates, truncation, degree, bandlimit, hexagonal_lower, hexagonal_upper, basis, error)
      end if
      if (allocated(error)) call check_success('new_basis', error)
   end subroutine make_basis

   subroutine test_counts()
      type(basis_type) :: basis
      type(error_type), allocatable :: error

      call make_basis('cubic', coordinates_box, truncation_tensor, 2, 10, basis)
      call check('paper, cubic: 27 x 5', basis%n_polynomials == 27 .and. basis%n_harmonics == 5 .and. basis%n_terms == 135)
      call make_basis('cubic', coordinates_box, truncation_tensor, 2, 12, basis)
      call check('two cubic harmonics of degree 12', basis%n_harmonics == 7)
      call check('degrees of the cubic harmonics', all(basis%harmonics%degrees == [0, 4, 6, 8, 10, 12, 12]))
      call make_basis('hexagonal', coordinates_box, truncation_tensor, 2, 4, basis)
      call check('paper, hexagonal: 243 x 3', basis%n_terms == 729)
      call make_basis('cubic', coordinates_dimensionless, truncation_total, 3, 6, basis)
      call check('dimensionless cubic D3 L6: 30', basis%n_terms == 30)
      call make_basis('hexagonal', coordinates_dimensionless, truncation_total, 2, 4, basis)
      call check('dimensionless hexagonal D2 L4: 45', basis%n_terms == 45)
      call new_basis(class_of('cubic'), coordinates_box, truncation_tensor, 2, 5, cubic_lower, cubic_upper, basis, error)
      call check_refused('an odd bandlimit is refused', error, 'bandlimit = 5')
      call new_basis(class_of('cubic'), coordinates_box, truncation_tensor, 2, 4, cubic_upper, cubic_lower, basis, error)
      call check_refused('an empty range is refused', error, 'empty')
   end subroutine test_counts

   !> The indentation direction of a grain is sample z in crystal axes, g z.
   subroutine test_direction()
      type(basis_type) :: basis
      real(wp) :: k(7), turned(7), g(3, 3), euler(3)

      euler = [0.3_wp, 1.1_wp, 2.2_wp]
      g = rotation_matrix(euler)
      call make_basis('cubic', coordinates_dimensionless, truncation_total, 0, 12, basis)
      call evaluate_harmonics(basis, euler, k)
      call harmonics_of(basis%harmonics, g(:, 3), turned)
      call check_close('harmonics of the direction g z', maxval(abs(k - turned)), 0.0_wp, 1.0e-12_wp)
   end subroutine test_direction

   subroutine test_polynomials()
      type(basis_type) :: basis
      real(wp), allocatable :: p(:), gram(:, :)
      real(wp) :: scale, x(3), constants(3), weight
      integer :: i, j, k, q

      call make_basis('cubic', coordinates_box, truncation_tensor, 2, 0, basis)
      allocate (p(27), gram(27, 27))
      gram = 0.0_wp
      do k = 0, 8; do j = 0, 8; do i = 0, 8
            weight = clenshaw_curtis_weight(i, 8)*clenshaw_curtis_weight(j, 8)*clenshaw_curtis_weight(k, 8)/8
            x = -cos(pi*[i, j, k]/8)
            constants = cubic_lower + 0.5_wp*(x + 1)*(cubic_upper - cubic_lower)
            call evaluate_polynomials(basis, constants, p, scale)
            do q = 1, 27
               gram(:, q) = gram(:, q) + weight*p*p(q)
            end do
         end do; end do; end do
      do q = 1, 27
         gram(q, q) = gram(q, q) - 1
      end do
      call check_close('orthonormal polynomials', maxval(abs(gram)), 0.0_wp, 1.0e-12_wp)
      call check_close('the scale of a box is 1', scale, 1.0_wp, 0.0_wp)
      ! Every product is that of its degrees, at the corner x = 1 where each factor is sqrt(2n+1).
      call evaluate_polynomials(basis, cubic_upper, p, scale)
      do q = 1, 27
         p(q) = p(q) - product(sqrt(2.0_wp*basis%degrees(:, q) + 1))
      end do
      call check_close('products at a corner', maxval(abs(p)), 0.0_wp, 1.0e-12_wp)
   end subroutine test_polynomials

   subroutine test_homogeneity()
      type(basis_type) :: basis
      real(wp) :: p(15), larger(15), scale, larger_scale
      real(wp), parameter :: zinc(5) = [161.1_wp, 34.2_wp, 38.3_wp, 61.1_wp, 50.3_wp]

      call make_basis('hexagonal', coordinates_dimensionless, truncation_total, 2, 4, basis)
      call evaluate_polynomials(basis, zinc, p, scale)
      call evaluate_polynomials(basis, 7*zinc, larger, larger_scale)
      call check_close('ratios do not change with the scale', maxval(abs(p - larger)), 0.0_wp, 1.0e-12_wp)
      call check_close('the scale is of degree one', larger_scale/scale, 7.0_wp, 1.0e-12_wp)
   end subroutine test_homogeneity

   subroutine test_prediction()
      type(surrogate_type) :: surrogate, copy
      type(random_stream_type) :: stream
      type(error_type), allocatable :: error
      real(wp), allocatable :: terms(:), factor(:, :)
      real(wp) :: scale, euler(3), modulus, sd, y, variance, again, again_sd, u
      integer :: i, j, n, unit

      call make_basis('cubic', coordinates_dimensionless, truncation_total, 2, 4, surrogate%basis)
      n = surrogate%basis%n_terms
      surrogate%anisotropy_cap = 10.0_wp
      surrogate%alpha = 3.0_wp
      surrogate%beta = 1.0e4_wp
      surrogate%sd_inflation = 1.25_wp
      allocate (surrogate%coefficients(surrogate%basis%n_harmonics, surrogate%basis%n_polynomials), factor(n, n), terms(n))
      stream = new_random_stream(5, 1)
      do j = 1, n
         call stream%normal(u)
         surrogate%coefficients(1 + mod(j - 1, 2), 1 + (j - 1)/2) = 0.1_wp*u
         do i = 1, n
            call stream%normal(factor(i, j))
         end do
      end do
      surrogate%covariance = 1.0e-4_wp*matmul(factor, transpose(factor))
      euler = [0.3_wp, 0.7_wp, 1.9_wp]
      call predict(surrogate, copper, euler, modulus, sd)
      call evaluate_terms(surrogate%basis, copper, euler, terms, scale)
      y = sum(terms*reshape(surrogate%coefficients, [n]))
      variance = sum(terms*matmul(surrogate%covariance, terms)) + 1/surrogate%beta
      call check_close('modulus is s exp(y)', modulus, scale*exp(y), 1.0e-10_wp)
      call check_close('sd by the delta method', sd, 1.25_wp*scale*exp(y)*sqrt(variance), 1.0e-9_wp)
      call check('copper is inside', .not. is_outside(surrogate, copper))
      call check('an unstable crystal is outside', is_outside(surrogate, [100.0_wp, 120.0_wp, 50.0_wp]))
      call check('a Zener ratio of 50 is outside', is_outside(surrogate, [100.0_wp, 96.0_wp, 100.0_wp]))
      call save_surrogate(surrogate, 'test_surrogate.nml', error)
      call check_success('a surrogate is written', error)
      call load_surrogate('test_surrogate.nml', copy, error)
      call check_success('and read', error)
      call predict(copy, copper, euler, again, again_sd)
      call check('to the last bit', again == modulus .and. again_sd == sd .and. copy%anisotropy_cap == surrogate%anisotropy_cap)
      open (newunit=unit, file='test_surrogate.nml', status='old', action='write')
      write (unit, '(a)') '&surrogate_model', '  symmetry = ''cubic''', '  degree = 2'
      close (unit)
      call load_surrogate('test_surrogate.nml', copy, error)
      call check_refused('a damaged file is refused', error, 'damaged')
      open (newunit=unit, file='test_surrogate.nml', status='old')
      close (unit, status='delete')
      call load_surrogate('test_surrogate.nml', copy, error)
      call check_refused('a missing file is refused', error, 'cannot be read')
   end subroutine test_prediction
end program test_surrogate
