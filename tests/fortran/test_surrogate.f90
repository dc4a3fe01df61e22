!> Basis and surrogate: orthonormality, symmetry, counts, predictions, the text form.
program test_surrogate
   use crystal_elasticity, only: rotation_matrix, symmetry_cubic, symmetry_hexagonal
   use errors, only: error_type
   use kinds, only: pi, wp
   use random, only: new_random_stream, random_stream_type
   use surrogate_basis, only: basis_type, coordinates_box, coordinates_dimensionless, evaluate_direction, evaluate_harmonics, &
      & evaluate_polynomials, evaluate_terms, new_basis, truncation_tensor, truncation_total
   use surrogate_model, only: is_outside, load_surrogate, predict, save_surrogate, surrogate_type
   use testing, only: check, check_close, check_refused, check_success, finish
   implicit none

   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp]
   real(wp), parameter :: cubic_lower(3) = [50.0_wp, 40.0_wp, 15.0_wp], cubic_upper(3) = [250.0_wp, 150.0_wp, 120.0_wp]
   real(wp), parameter :: hexagonal_lower(5) = [80.0_wp, 40.0_wp, 30.0_wp, 70.0_wp, 40.0_wp]
   real(wp), parameter :: hexagonal_upper(5) = [240.0_wp, 120.0_wp, 90.0_wp, 210.0_wp, 90.0_wp]

   call test_counts()
   call test_orthonormal_harmonics(symmetry_cubic)
   call test_orthonormal_harmonics(symmetry_hexagonal)
   call test_known_harmonics()
   call test_cubic_symmetry()
   call test_polynomials()
   call test_homogeneity()
   call test_prediction()
   call finish()

contains

   subroutine make_basis(symmetry, coordinates, truncation, degree, bandlimit, basis)
      integer, intent(in) :: symmetry, coordinates, truncation, degree, bandlimit
      type(basis_type), intent(out) :: basis
      type(error_type), allocatable :: error

      if (coordinates == coordinates_dimensionless) then
         if (symmetry == symmetry_cubic) then
            call new_basis(symmetry, coordinates, truncation, degree, bandlimit, [0.4_wp, -2.0_wp], [0.95_wp, 2.0_wp], basis, &
               & error)
         else
            call new_basis(symmetry, coordinates, truncation, degree, bandlimit, [-3.0_wp, -2.0_wp, -1.0_wp, -1.0_wp], &
               & [0.0_wp, 2.0_wp, 3.0_wp, 1.0_wp], basis, error)
         end if
      else if (symmetry == symmetry_cubic) then
         call new_basis(symmetry, coordinates, truncation, degree, bandlimit, cubic_lower, cubic_upper, basis, error)
      else
         call new_basis(symmetry, coordinates, truncation, degree, bandlimit, hexagonal_lower, hexagonal_upper, basis, error)
      end if
      if (allocated(error)) call check_success('new_basis', error)
   end subroutine make_basis

   subroutine test_counts()
      type(basis_type) :: basis
      type(error_type), allocatable :: error

      call make_basis(symmetry_cubic, coordinates_box, truncation_tensor, 2, 10, basis)
      call check('paper, cubic: 27 x 5', basis%n_polynomials == 27 .and. basis%n_harmonics == 5 .and. basis%n_terms == 135)
      call make_basis(symmetry_cubic, coordinates_box, truncation_tensor, 2, 12, basis)
      call check('two cubic harmonics of degree 12', basis%n_harmonics == 7)
      call check('degrees of the cubic harmonics', all(basis%harmonic_degrees == [0, 4, 6, 8, 10, 12, 12]))
      call make_basis(symmetry_hexagonal, coordinates_box, truncation_tensor, 2, 4, basis)
      call check('paper, hexagonal: 243 x 3', basis%n_terms == 729)
      call make_basis(symmetry_cubic, coordinates_dimensionless, truncation_total, 3, 6, basis)
      call check('dimensionless cubic D3 L6: 30', basis%n_terms == 30)
      call make_basis(symmetry_hexagonal, coordinates_dimensionless, truncation_total, 2, 4, basis)
      call check('dimensionless hexagonal D2 L4: 45', basis%n_terms == 45)
      call new_basis(symmetry_cubic, coordinates_box, truncation_tensor, 2, 5, cubic_lower, cubic_upper, basis, error)
      call check_refused('an odd bandlimit is refused', error, 'bandlimit = 5')
      call new_basis(symmetry_cubic, coordinates_box, truncation_tensor, 2, 4, cubic_upper, cubic_lower, basis, error)
      call check_refused('an empty range is refused', error, 'empty')
   end subroutine test_counts

   !> The Gram matrix by a product rule: Clenshaw-Curtis in height, midpoints in longitude.
   subroutine test_orthonormal_harmonics(symmetry)
      integer, intent(in) :: symmetry
      type(basis_type) :: basis
      real(wp), allocatable :: gram(:, :), k(:)
      real(wp) :: phi, theta, weight, total
      integer :: i, j, h, n

      call make_basis(symmetry, coordinates_dimensionless, truncation_total, 0, 16, basis)
      n = basis%n_harmonics
      allocate (gram(n, n), k(n))
      gram = 0.0_wp
      total = 0.0_wp
      ! Clenshaw-Curtis in cos(theta), exact to degree 64; 80 longitudes, exact to order 79.
      do i = 0, 64
         theta = pi*i/64
         weight = clenshaw_curtis_weight(i, 64)/(2*80)
         do j = 1, 80
            phi = 2.0_wp*pi*(j - 0.3_wp)/80
            call evaluate_direction(basis, [sin(theta)*cos(phi), sin(theta)*sin(phi), cos(theta)], k)
            total = total + weight
            do h = 1, n
               gram(:, h) = gram(:, h) + weight*k*k(h)
            end do
         end do
      end do
      call check_close('weights of the sphere', total, 1.0_wp, 1.0e-13_wp)
      do h = 1, n
         gram(h, h) = gram(h, h) - 1.0_wp
      end do
      call check_close('orthonormal harmonics to l = 16', maxval(abs(gram)), 0.0_wp, 1.0e-10_wp)
   end subroutine test_orthonormal_harmonics

   pure real(wp) function clenshaw_curtis_weight(i, n) result(weight)
      integer, intent(in) :: i, n
      integer :: k

      weight = 1.0_wp
      do k = 1, n/2
         weight = weight - merge(1.0_wp, 2.0_wp, 2*k == n)*cos(2.0_wp*pi*k*i/n)/(4.0_wp*k*k - 1.0_wp)
      end do
      weight = weight*merge(1.0_wp, 2.0_wp, i == 0 .or. i == n)/n
   end function clenshaw_curtis_weight

   !> The textbook cubic harmonic of degree 4, sqrt(21)/4 (5 I4 - 3) for mean square 1, and zonal ones.
   subroutine test_known_harmonics()
      type(basis_type) :: basis
      real(wp) :: k(7), n(3)

      call make_basis(symmetry_cubic, coordinates_dimensionless, truncation_total, 0, 12, basis)
      n = [2.0_wp, 3.0_wp, 6.0_wp]/7.0_wp
      call evaluate_direction(basis, n, k)
      call check_close('cubic, l = 0', k(1), 1.0_wp, 1.0e-14_wp)
      call check_close('cubic, l = 4', k(2), sqrt(21.0_wp)/4*(5*sum(n**4) - 3), 1.0e-12_wp)
      call check_close('cubic, l = 6', k(3), sqrt(13.0_wp/128)*(462*(n(1)*n(2)*n(3))**2 &
         & + 21*sum(n**4) - 17), 1.0e-12_wp)
      call make_basis(symmetry_hexagonal, coordinates_dimensionless, truncation_total, 0, 4, basis)
      call evaluate_harmonics(basis, [1.0_wp, acos(0.6_wp), 2.0_wp], k(:3))
      call check_close('zonal, l = 2', k(2), sqrt(5.0_wp)*(3*0.36_wp - 1)/2, 1.0e-13_wp)
      call check_close('zonal, l = 4', k(3), 3*(35*0.36_wp**2 - 30*0.36_wp + 3)/8, 1.0e-13_wp)
   end subroutine test_known_harmonics

   !> The 48 operations of the cubic group, and an angle's worth of Bunge's convention.
   subroutine test_cubic_symmetry()
      integer, parameter :: orders(3, 6) = reshape([1, 2, 3, 1, 3, 2, 2, 1, 3, 2, 3, 1, 3, 1, 2, 3, 2, 1], [3, 6])
      type(basis_type) :: basis
      real(wp) :: k(7), turned(7), n(3), g(3, 3), euler(3), worst
      integer :: i, s

      call make_basis(symmetry_cubic, coordinates_dimensionless, truncation_total, 0, 12, basis)
      euler = [0.4_wp, 1.1_wp, 2.3_wp]
      call evaluate_harmonics(basis, euler, k)
      g = rotation_matrix(euler)
      n = matmul(g, [0.0_wp, 0.0_wp, 1.0_wp])
      call evaluate_direction(basis, n, turned)
      call check_close('the direction is g z', maxval(abs(turned - k)), 0.0_wp, 1.0e-13_wp)
      worst = 0.0_wp
      do i = 1, 6
         do s = 0, 7
            call evaluate_direction(basis, n(orders(:, i))*[sign_of(s, 0), sign_of(s, 1), sign_of(s, 2)], turned)
            worst = max(worst, maxval(abs(turned - k)))
         end do
      end do
      call check_close('48 operations leave the harmonics alone', worst, 0.0_wp, 1.0e-12_wp)
   end subroutine test_cubic_symmetry

   pure real(wp) function sign_of(bits, position)
      integer, intent(in) :: bits, position

      sign_of = merge(-1.0_wp, 1.0_wp, btest(bits, position))
   end function sign_of

   subroutine test_polynomials()
      type(basis_type) :: basis
      real(wp), allocatable :: p(:), gram(:, :)
      real(wp) :: scale, x(3), constants(3), weight
      integer :: i, j, k, q

      call make_basis(symmetry_cubic, coordinates_box, truncation_tensor, 2, 0, basis)
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

      call make_basis(symmetry_hexagonal, coordinates_dimensionless, truncation_total, 2, 4, basis)
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

      call make_basis(symmetry_cubic, coordinates_dimensionless, truncation_total, 2, 4, surrogate%basis)
      n = surrogate%basis%n_terms
      surrogate%symmetry = symmetry_cubic
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
