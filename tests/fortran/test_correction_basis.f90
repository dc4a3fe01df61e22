!> The specimen correction: coordinates and polynomials about the indenter's axis, the basis, its
!> model of grains, and its file.
program test_correction_basis
   use abstract_basis, only: basis_type, grain_model_type, spread_of
   use axial_polynomials, only: axial_polynomials_type, evaluate_polynomials, greatest_degree, &
      & new_axial_polynomials
   use bases, only: new_basis
   use correction_basis, only: correction_basis_type
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: kelvin_form, logarithmic_mean, rotate_stiffness, rotation_matrix
   use errors, only: error_type
   use kinds, only: degree, pi, wp
   use linear_algebra, only: symmetric_eigen
   use logarithmic_coordinates, only: axial_coordinates_of, kelvin_rotation, log_coordinates_type, &
      & n_axial, n_coordinates, n_pairs, new_log_coordinates, pair_orders
   use random, only: new_random_stream, random_stream_type
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: spread_crystals
   use surrogate_model, only: load_surrogate, new_grain_model, save_surrogate, &
      & surrogate_type
   use testing, only: check, check_close, check_refused, check_success, class_of, evaluate_terms, &
      & finish, new_domain, predict, wide
   implicit none

   !> One of each stiffness.
   character(len=*), &
      & parameter :: classes(10) = [character(len=12) :: 'isotropic', 'cubic', 'hexagonal', &
      & 'tetragonal', '4/m', 'trigonal', '-3', 'orthorhombic', 'monoclinic', 'triclinic']
   !> GPa.
   real(wp), parameter :: any_scale(2) = [30.0_wp, 300.0_wp]
   type(random_stream_type) :: stream

   stream = new_random_stream(11, 1)
   call test_coordinates()
   call test_counts([1, 5, 29, 141, 632])
   call test_counts([1, 6, 35, 176, 808], 0.0_wp)
   call test_polynomials()
   call test_polynomials(0.7_wp)
   call test_invariance()
   call test_invariance(any_scale)
   call test_distance()
   call test_basis()
   call test_grain_models()
   call test_grain_models(any_scale)
   call test_covariance()
   call test_covariance(any_scale)
   call test_file()
   call test_file(any_scale)
   call finish()

contains

   !> A symmetric matrix of normal numbers.
   function random_matrix() result(a)
      real(wp) :: a(6, 6)
      integer :: j

      do j = 1, 6
         call stream%normals(a(:, j))
      end do
      a = 0.5_wp*(a + transpose(a))
   end function random_matrix

   !> A stable crystal of a class, GPa; its log-anisotropy is of order 0.5.
   function random_crystal(name) result(c)
      character(len=*), intent(in) :: name
      real(wp) :: c(6, 6)
      type(log_coordinates_type) :: space
      real(wp) :: w(21)

      space = new_log_coordinates(class_of(trim(name)))
      call stream%normals(w)
      w = 0.5_wp*w/sqrt(1.0_wp + space%n)
      w(1) = w(1) + 5.8_wp
      w(2) = w(2) + 4.7_wp*sqrt(5.0_wp)
      c = space%from_logarithms(w(:space%n))
   end function random_crystal

   function basis_of(degree_of_polynomials, stiffness) result(basis)
      integer, intent(in) :: degree_of_polynomials
      !> The range of the scale, GPa, if they depend on it.
      real(wp), intent(in), optional :: stiffness(2)
      type(correction_basis_type) :: basis
      type(error_type), allocatable :: error

      basis%domain = wide('triclinic', 1.5_wp, [0.05_wp, 0.45_wp], stiffness)
      basis%settings = surrogate_settings_type(model='correction', degree=degree_of_polynomials, &
         & file='', truncation='', scan='')
      call basis%set_up(error)
      if (allocated(error)) call check_success('a correction', error)
   end function basis_of

   !> Coordinates turned by an angle about the axis, as pairs are, and mirrored before.
   pure function turned(x, angle, mirrored) result(y)
      real(wp), intent(in) :: x(n_coordinates), angle
      logical, intent(in) :: mirrored
      real(wp) :: y(n_coordinates)
      complex(wp) :: pairs(n_pairs)

      pairs = cmplx(x(n_axial + 1:n_axial + n_pairs), &
         & x(n_axial + n_pairs + 1:n_axial + 2*n_pairs), wp)
      if (mirrored) pairs = conjg(pairs)
      pairs = pairs*exp(cmplx(0.0_wp, pair_orders*angle, wp))
      y = [x(:n_axial), real(pairs, wp), aimag(pairs), x(n_coordinates)]
   end function turned

   subroutine test_coordinates()
      real(wp) :: a(6, 6), c(6, 6), q(6, 6), r(3, 3), x(n_coordinates), angle
      integer :: i
      logical :: mirrored(6)

      c = random_crystal('triclinic')
      r = rotation_matrix([0.4_wp, 1.1_wp, -0.7_wp])
      q = kelvin_rotation(r)
      a = matmul(q, transpose(q))
      do i = 1, 6
         a(i, i) = a(i, i) - 1.0_wp
      end do
      call check_close('the rotation of Kelvin''s form is orthogonal', maxval(abs(a)), &
         & 0.0_wp, 1.0e-14_wp)
      a = kelvin_form(rotate_stiffness(c, transpose(r))) - matmul(q, &
         & matmul(kelvin_form(c), transpose(q)))
      call check_close('and turns a stiffness as Bond does', maxval(abs(a)), 0.0_wp, &
         & 1.0e-11_wp*maxval(c))
      a = random_matrix()
      x = axial_coordinates_of(a)
      call check_close('orthonormal', sum(x**2), sum(a**2), 1.0e-13_wp*sum(a**2))
      call check_close('the last is the trace''s', x(n_coordinates), &
         & sum([(a(i, i), i=1, 6)])/sqrt(6.0_wp), 1.0e-14_wp)
      c = 0.0_wp
      do i = 1, 6
         c(i, i) = 2.0_wp
      end do
      x(n_coordinates) = x(n_coordinates) + 2.0_wp*sqrt(6.0_wp)
      call check_close('the trace has no part in the others', &
         & maxval(abs(axial_coordinates_of(a + c) - x)), 0.0_wp, 1.0e-14_wp)
      x = axial_coordinates_of(a)
      angle = 0.83_wp
      q = kelvin_rotation(reshape([cos(angle), sin(angle), 0.0_wp, -sin(angle), cos(angle), &
         & 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3]))
      c = matmul(q, matmul(a, transpose(q)))
      call check('a turn about the axis turns each wave by its order', &
         & min(maxval(abs(axial_coordinates_of(c) - turned(x, angle, .false.))), &
         & maxval(abs(axial_coordinates_of(c) - turned(x, -angle, .false.)))) < 1.0e-13_wp)
      ! yz and xy change sign under y -> -y.
      mirrored = [.false., .false., .false., .true., .false., .true.]
      do i = 1, 6
         c(:, i) = merge(-a(:, i), a(:, i), mirrored .neqv. mirrored(i))
      end do
      call check_close('the mirror conjugates the pairs', &
         & maxval(abs(axial_coordinates_of(c) - turned(x, 0.0_wp, .true.))), 0.0_wp, 1.0e-14_wp)
   end subroutine test_coordinates

   !> As many as invariants of the group of turns and mirrors, by Molien's formula.
   subroutine test_counts(counts, centre)
      integer, intent(in) :: counts(0:greatest_degree)
      !> Of the scale, if it counts.
      real(wp), intent(in), optional :: centre
      integer, parameter :: n_angles = 64
      type(axial_polynomials_type) :: polynomials
      real(wp) :: powers(greatest_degree), invariants(0:greatest_degree), &
         & turns(0:greatest_degree), mirrors(0:greatest_degree)
      integer :: d, i, k, n_fixed

      n_fixed = n_axial + merge(1, 0, present(centre))
      do d = 0, greatest_degree
         polynomials = new_axial_polynomials(d, centre)
         call check('polynomials up to degree '//achar(48 + d), polynomials%n == counts(d) &
            & .and. size(polynomials%degrees) == counts(d))
      end do
      ! The traces of powers of a turn and of a mirror, and from them those of the symmetric
      ! products.
      invariants = 0.0_wp
      do i = 0, n_angles - 1
         powers = [(n_fixed + 2.0_wp*sum(cos(2.0_wp*pi*i*k*pair_orders/n_angles)), k=1, &
            & greatest_degree)]
         turns = symmetric_products(powers)
         invariants = invariants + 0.5_wp*turns/n_angles
      end do
      powers = [(merge(n_fixed + 2*n_pairs, n_fixed, mod(k, 2) == 0), k=1, greatest_degree)]
      mirrors = symmetric_products(powers)
      invariants = invariants + 0.5_wp*mirrors
      do d = 0, greatest_degree
         call check_close('invariants of degree '//achar(48 + d), &
            & real(count(polynomials%degrees == d), wp), invariants(d), 1.0e-6_wp)
      end do
   end subroutine test_counts

   !> Traces on the symmetric products of degree 0, 1, .. from the traces of the powers (Newton).
   pure function symmetric_products(powers) result(traces)
      real(wp), intent(in) :: powers(greatest_degree)
      real(wp) :: traces(0:greatest_degree)
      integer :: d, k

      traces(0) = 1.0_wp
      do d = 1, greatest_degree
         traces(d) = sum([(powers(k)*traces(d - k), k=1, d)])/d
      end do
   end function symmetric_products

   !> Those of one degree are an orthonormal basis: their kernel is the mean of the power of the
   !> product of two points over all turns and mirrors. They are independent, too.
   subroutine test_polynomials(centre)
      !> Of the scale, if it counts.
      real(wp), intent(in), optional :: centre
      integer, parameter :: n_angles = 64, n_points = 300
      type(axial_polynomials_type) :: polynomials
      type(error_type), allocatable :: error
      real(wp), allocatable :: p(:, :), gram(:, :), values(:)
      real(wp) :: x(n_coordinates), y(n_coordinates), other(n_coordinates), &
         & points(n_points, n_coordinates)
      real(wp) :: kernel(0:greatest_degree)
      integer :: d, i, k, n

      polynomials = new_axial_polynomials(greatest_degree, centre)
      n = polynomials%n_coordinates
      call check('coordinates that count', n == n_coordinates - merge(0, 1, present(centre)))
      allocate (p(2, polynomials%n))
      call stream%normals(x)
      call stream%normals(y)
      points(1, :) = x
      points(2, :) = y
      call evaluate_polynomials(polynomials, points(:2, :n), p)
      if (present(centre)) then
         x(n) = x(n) - centre
         y(n) = y(n) - centre
      end if
      kernel = 0.0_wp
      do i = 0, n_angles - 1
         do d = 0, greatest_degree
            other = turned(y, 2.0_wp*pi*i/n_angles, .false.)
            kernel(d) = kernel(d) + dot_product(x(:n), other(:n))**d/(2*n_angles)
            other = turned(y, 2.0_wp*pi*i/n_angles, .true.)
            kernel(d) = kernel(d) + dot_product(x(:n), other(:n))**d/(2*n_angles)
         end do
      end do
      do d = 0, greatest_degree
         call check_close('the kernel of degree '//achar(48 + d), sum(p(1, :)*p(2, :), &
            & mask=polynomials%degrees == d), kernel(d), 1.0e-11_wp*max(1.0_wp, abs(kernel(d))))
      end do
      polynomials = new_axial_polynomials(3, centre)
      n = polynomials%n
      deallocate (p)
      allocate (p(n_points, n), values(n))
      do i = 1, n_points
         call stream%normals(points(i, :))
      end do
      call evaluate_polynomials(polynomials, points(:, :polynomials%n_coordinates), p)
      do k = 1, n
         p(:, k) = p(:, k)/norm2(p(:, k))
      end do
      gram = matmul(transpose(p), p)
      call symmetric_eigen(gram, values, error)
      call check('no polynomial is a sum of others', minval(values) > 1.0e-6_wp)
   end subroutine test_polynomials

   !> Terms of a crystal in an orientation do not change when it is turned about the axis or
   !> mirrored, nor with its scale, unless it counts.
   subroutine test_invariance(stiffness)
      !> The range of the scale, if they depend on it.
      real(wp), intent(in), optional :: stiffness(2)
      type(correction_basis_type) :: basis
      real(wp), allocatable :: terms(:), others(:)
      real(wp) :: c(6, 6), seen(6, 6), scale, spread, other, euler(3), origin(3)
      logical :: mirrored(6)
      integer :: i

      basis = basis_of(3, stiffness)
      allocate (terms(basis%n_terms), others(basis%n_terms))
      origin = 0.0_wp
      euler = [0.3_wp, 0.9_wp, 2.1_wp]
      c = random_crystal('triclinic')
      call evaluate_terms(basis, c, euler, terms, scale, spread)
      call evaluate_terms(basis, c, [1.9_wp, euler(2:)], others, other, spread)
      call check_close('phi1 does not matter', maxval(abs(terms - others)), 0.0_wp, 1.0e-9_wp)
      call check_close('nor to the theory', other/scale, 1.0_wp, 1.0e-10_wp)
      call evaluate_terms(basis, c, [euler(1), euler(2) + 0.1_wp, euler(3)], others, other, spread)
      call check('Phi does', maxval(abs(terms - others)) > 1.0e-3_wp)
      seen = rotate_stiffness(c, rotation_matrix(euler))
      call evaluate_terms(basis, seen, origin, others, other, spread)
      call check_close('a crystal in the frame of the sample', maxval(abs(terms - others)), &
         & 0.0_wp, 1.0e-9_wp)
      mirrored = [.false., .false., .false., .true., .false., .true.]
      do i = 1, 6
         seen(:, i) = merge(-seen(:, i), seen(:, i), mirrored .neqv. mirrored(i))
      end do
      call evaluate_terms(basis, seen, origin, others, other, spread)
      call check_close('a mirrored one', maxval(abs(terms - others)), 0.0_wp, 1.0e-9_wp)
      call check_close('is as stiff', other/scale, 1.0_wp, 1.0e-10_wp)
      call evaluate_terms(basis, 7.0_wp*c, euler, others, other, spread)
      if (present(stiffness)) then
         ! The term of degree 1 that is the scale alone is the last of them.
         i = findloc(basis%prior_degrees, 1, 1, back=.true.)
         call check_close('the scale, orthonormal', spread*(others(i) - terms(i)), &
            & sqrt(6.0_wp)*log(7.0_wp), 1.0e-10_wp)
         call check_close('from the middle of its range', spread*others(i), &
            & sqrt(6.0_wp)*(log(scale_of(7.0_wp*c)) - 0.5_wp*sum(log(stiffness))), 1.0e-10_wp)
      else
         call check_close('the scale does not matter', maxval(abs(terms - others)), &
            & 0.0_wp, 1.0e-9_wp)
      end if
      call check_close('to the theory it does', other/scale, 7.0_wp, 1.0e-9_wp)
      ! An isotropic crystal has no pairs.
      c = random_crystal('isotropic')
      call evaluate_terms(basis, c, origin, terms, scale, spread)
      call evaluate_terms(basis, c, euler, others, other, spread)
      call check_close('an isotropic crystal has no orientation', maxval(abs(terms - others)), &
         & 0.0_wp, 1.0e-9_wp)
   end subroutine test_invariance

   !> The geometric mean of the eigenvalues of the Kelvin form, GPa.
   function scale_of(c) result(scale)
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: scale, k(6, 6), values(6)
      type(error_type), allocatable :: error

      k = kelvin_form(c)
      call symmetric_eigen(k, values, error)
      scale = product(values)**(1.0_wp/6.0_wp)
   end function scale_of

   subroutine test_distance()
      type(correction_basis_type) :: basis
      type(error_type), allocatable :: error
      type(crystal_class_type) :: class
      real(wp) :: c(6, 6), poisson, anisotropy

      basis = basis_of(2)
      class = class_of('cubic')
      c = class%stiffness([168.4_wp, 121.4_wp, 75.4_wp])
      call logarithmic_mean(c, poisson, anisotropy)
      call check_close('copper''s log-anisotropy', anisotropy, 1.28_wp, 5.0e-3_wp)
      call check_close('is how far out it is', basis%domain%normalised_distance(c), &
         & anisotropy/1.5_wp, 1.0e-12_wp)
      call check('it is covered', basis%domain%admits(c))
      ! Isotropic, nu = 0.45: at the end of the range.
      c = class%stiffness([0.55_wp, 0.45_wp, 0.05_wp])
      call check_close('an end of the range', basis%domain%normalised_distance(c), &
         & 1.0_wp, 1.0e-10_wp)
      c = class%stiffness([0.54_wp, 0.46_wp, 0.04_wp])
      call check('beyond it', basis%domain%normalised_distance(c) > 1.0_wp &
         & .and. .not. basis%domain%admits(c))
      c = class%stiffness([168.4_wp, 121.4_wp, 75.4_wp])
      basis = basis_of(3, scale_of(c)*[0.1_wp, 10.0_wp])
      call check_close('the scale in its middle', basis%domain%normalised_distance(c), &
         & anisotropy/1.5_wp, 1.0e-12_wp)
      call check_close('at its end', basis%domain%normalised_distance(10.0_wp*c), &
         & 1.0_wp, 1.0e-10_wp)
      call check_close('at the other', basis%domain%normalised_distance(0.1_wp*c), &
         & 1.0_wp, 1.0e-10_wp)
      call check('beyond that', basis%domain%admits(0.101_wp*c) &
         & .and. .not. basis%domain%admits(0.099_wp*c))
      call new_domain('cubic', [50.0_wp, 40.0_wp, 15.0_wp], [250.0_wp, 150.0_wp, 120.0_wp], &
         & 7.2_wp, basis%domain, error)
      call basis%set_up(error)
      call check_success('a correction of one class between bounds', error)
      call check('covers what is between them', basis%domain%admits(c) &
         & .and. .not. basis%domain%admits(2.0_wp*c))
      call new_domain('cubic', [50.0_wp, 40.0_wp, 15.0_wp], [250.0_wp, 150.0_wp, 120.0_wp], &
         & 7.2_wp, basis%domain, error, [1.0_wp, 2.0_wp])
      call basis%set_up(error)
      call check('in a box of which the scale is no limit, but counts', &
         & basis%domain%admits(c) .and. basis%n_terms == 176)
      c = class%stiffness([168.4_wp, 121.4_wp, 120.0_wp])
      call check_close('a bound', basis%domain%normalised_distance(c), 1.0_wp, 1.0e-12_wp)
   end subroutine test_distance

   subroutine test_basis()
      type(correction_basis_type) :: basis
      class(basis_type), allocatable :: other
      type(error_type), allocatable :: error

      basis = basis_of(3)
      associate (degrees => basis%prior_degrees)
         call check('degrees of the terms', size(degrees) == 141 .and. count(degrees == 0) == 1 &
            & .and. count(degrees == 1) == 4 .and. count(degrees == 2) == 24 &
            & .and. count(degrees == 3) == 112)
      end associate
      call check_close('y and modulus', &
         & basis%to_modulus(basis%to_y(9.0_wp, 8.0_wp, 1.7_wp), 8.0_wp, 1.7_wp), 9.0_wp, 1.0e-10_wp)
      basis%settings%degree = 0
      call basis%set_up(error)
      call check_refused('no degree', error, 'degree = 0 is outside 1 .. 4')
      basis%settings%degree = 5
      call basis%set_up(error)
      call check_refused('too high a degree', error, 'degree = 5 is outside 1 .. 4')
      call new_basis(basis%domain, surrogate_settings_type(model='correction', degree=2, file='', &
         & truncation='', scan=''), other, error)
      call check('as the settings ask for', other%n_terms == 29 .and. other%logarithmic)
   end subroutine test_basis

   !> A surrogate of random coefficients that fall with the degree.
   function random_surrogate(stiffness) result(surrogate)
      !> The range of the scale, if it counts.
      real(wp), intent(in), optional :: stiffness(2)
      type(surrogate_type) :: surrogate
      real(wp), allocatable :: factor(:, :), width(:)
      integer :: j, n

      allocate (surrogate%basis, source=basis_of(3, stiffness))
      n = surrogate%basis%n_terms
      allocate (surrogate%coefficients(n), factor(n, n))
      width = 0.05_wp*0.3_wp**surrogate%basis%prior_degrees
      call stream%normals(surrogate%coefficients)
      surrogate%coefficients = width*surrogate%coefficients
      do j = 1, n
         call stream%normals(factor(:, j))
         factor(:, j) = 0.1_wp*width*factor(:, j)
      end do
      surrogate%covariance = matmul(factor, transpose(factor))/n
      surrogate%covariance = 0.5_wp*(surrogate%covariance + transpose(surrogate%covariance))
      allocate (surrogate%simulations%constants(21, 0), surrogate%simulations%euler_deg(3, 0), &
         & surrogate%simulations%modulus(0))
      surrogate%beta = 1.0e6_wp
   end function random_surrogate

   !> The model of grains of each class gives what the surrogate predicts, and the covariance of its
   !> terms but for what does not matter.
   subroutine test_grain_models(stiffness)
      !> The range of the scale, if it counts.
      real(wp), intent(in), optional :: stiffness(2)
      integer, parameter :: n = 4
      type(surrogate_type) :: surrogate
      class(grain_model_type), allocatable :: model
      type(error_type), allocatable :: error
      real(wp) :: euler(3, n), c(6, 6), moduli(n), slopes(n), modulus(n), sd, whole(n, n)
      real(wp), allocatable :: columns(:, :), terms(:, :)
      integer :: i, j

      surrogate = random_surrogate(stiffness)
      euler = reshape([0.1_wp, 0.2_wp, 0.3_wp, 1.0_wp, 1.5_wp, 2.0_wp, 4.0_wp, 0.9_wp, 0.2_wp, &
         & 0.0_wp, 0.0_wp, 0.0_wp], [3, n])
      allocate (terms(surrogate%basis%n_terms, n))
      do j = 1, size(classes)
         call new_grain_model(surrogate, class_of(trim(classes(j))), euler(:, :2), .true., &
            & model, error)
         call model%set_grains(euler, error)
         call check_success('a model of '//trim(classes(j))//' grains', error)
         c = random_crystal(classes(j))
         do i = 1, n
            call predict(surrogate, c, euler(:, i), modulus(i), sd)
         end do
         call model%evaluate_moduli(c, moduli, slopes)
         call check(trim(classes(j))//': its moduli, read from the field of the theory', &
            & maxval(abs(moduli/modulus - 1.0_wp)) < 1.0e-3_wp)
         model%full_above = -1.0_wp
         call model%evaluate_moduli(c, moduli, slopes)
         slopes = slopes/moduli - spread_of(surrogate%basis%noise_growth, c)
         call check(trim(classes(j))//': in full', &
            & maxval(abs(moduli/modulus - 1.0_wp)) < 1.0e-10_wp)
         call check(trim(classes(j))//': its slope', maxval(abs(slopes)) < 1.0e-14_wp)
         do i = 1, n
            call evaluate_terms(surrogate%basis, c, euler(:, i), terms(:, i), modulus(i), slopes(i))
         end do
         whole = matmul(transpose(terms), matmul(surrogate%covariance, terms))
         allocate (columns(n, model%n_columns))
         call model%evaluate_columns(c, columns)
         call check_close(trim(classes(j))//': its covariance', &
            & maxval(abs(matmul(columns, transpose(columns)) - whole))/maxval(whole), &
            & 0.0_wp, 0.006_wp)
         deallocate (columns)
      end do
      call new_grain_model(surrogate, class_of('cubic'), euler, .false., model, error)
      call check('no columns without covariance', model%n_columns == 0)
   end subroutine test_grain_models

   !> The columns leave out a hundredth of the variance at most, on crystals that they were not made
   !> with, and never add to it.
   subroutine test_covariance(stiffness)
      !> The range of the scale, if it counts.
      real(wp), intent(in), optional :: stiffness(2)
      integer, parameter :: n = 300
      type(surrogate_type) :: surrogate
      class(grain_model_type), allocatable :: model
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), columns(:, :), terms(:)
      real(wp) :: c(6, 6), scale, spread, whole(n), kept(n)
      integer :: i

      surrogate = random_surrogate(stiffness)
      call spread_crystals(surrogate%basis%domain, n, 77, constants, euler_deg, error)
      call new_grain_model(surrogate, class_of('triclinic'), degree*euler_deg, .true., model, error)
      allocate (columns(n, model%n_columns), terms(surrogate%basis%n_terms))
      do i = 1, n
         c = surrogate%basis%domain%class%stiffness(constants(:, i))
         call model%set_grains(degree*euler_deg(:, i:i), error)
         call model%evaluate_columns(c, columns(:1, :))
         kept(i) = sum(columns(1, :)**2)
         call evaluate_terms(surrogate%basis, c, degree*euler_deg(:, i), terms, scale, spread)
         whole(i) = sum(terms*matmul(surrogate%covariance, terms))
      end do
      call check('nothing is added', maxval(kept/whole) < 1.0_wp + 1.0e-10_wp)
      call check_close('a hundredth is left out at most', sum(kept)/sum(whole), 1.0_wp, 0.015_wp)
      call check('most columns, too', model%n_columns < surrogate%basis%n_terms/2)
   end subroutine test_covariance

   !> What was written is read to the last bit.
   subroutine test_file(stiffness)
      !> The range of the scale, if it counts.
      real(wp), intent(in), optional :: stiffness(2)
      type(surrogate_type) :: surrogate, copy
      type(error_type), allocatable :: error
      character(len=*), parameter :: path = 'test_correction.txt'
      integer :: unit

      surrogate = random_surrogate(stiffness)
      surrogate%provenance = '{}'
      surrogate%decay_rate = 1.0_wp/3.0_wp
      surrogate%contact_radius = 0.3_wp
      call save_surrogate(surrogate, path, error)
      call check_success('a correction is written', error)
      call load_surrogate(path, copy, error)
      call check_success('and read', error)
      open (newunit=unit, file=path, status='old')
      close (unit, status='delete')
      if (allocated(error)) return
      call check_close('with the contact radius of its simulations', copy%contact_radius, &
         & 0.3_wp, 0.0_wp)
      associate (domain => surrogate%basis%domain, other => copy%basis%domain)
         call check('with its domain', other%class%name == domain%class%name &
            & .and. other%members == domain%members .and. all(abs([other%anisotropy_cap &
            & - domain%anisotropy_cap, other%log_anisotropy_max - domain%log_anisotropy_max, &
            & other%poisson - domain%poisson, other%stiffness - domain%stiffness]) <= 0.0_wp) &
            & .and. size(other%lower) == 0 .and. size(other%upper) == 0)
      end associate
      call check('and its posterior', all(abs(copy%coefficients - surrogate%coefficients) &
         & <= 0.0_wp) .and. all(abs(copy%covariance - surrogate%covariance) <= 0.0_wp) &
         & .and. all(abs([copy%alpha - surrogate%alpha, copy%beta - surrogate%beta]) <= 0.0_wp) &
         & .and. copy%decay_rate == surrogate%decay_rate &
         & .and. copy%basis%n_terms == merge(176, 141, present(stiffness)) &
         & .and. all(copy%basis%prior_degrees == surrogate%basis%prior_degrees))
   end subroutine test_file
end program test_correction_basis
