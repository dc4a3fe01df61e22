!> What any basis of surrogates obeys, for every crystal class.
program test_bases
   use abstract_basis, only: basis_type, grain_model_type
   use bases, only: basis_names, new_basis
   use crystal_class, only: crystal_class_names, crystal_class_type, general_class
   use crystal_elasticity, only: euler_angles, isotropic_stiffness, rotation_matrix
   use distinct_directions, only: group_rotations
   use errors, only: error_type
   use kinds, only: degree, wp
   use logarithmic_coordinates, only: log_coordinates_type, new_log_coordinates
   use modulus_slopes, only: count_slopes, evaluate_slopes
   use namelist_file, only: entry_type, parse_namelist
   use random, only: new_random_stream, random_stream_type
   use settings_reader, only: read_settings
   use settings_schema, only: settings_type
   use surrogate_domain, only: domain_type, spread_crystals
   use surrogate_model, only: load_surrogate, new_grain_model, save_surrogate, surrogate_type
   use testing, only: check, check_close, check_success, class_of, finish, new_domain, predict
   use text, only: split_list
   implicit none

   !> Crystals of each class.
   integer, parameter :: n = 3

   call test_bases_by_name()
   call finish()

contains

   !> The lists come from the modules.
   subroutine test_bases_by_name()
      character(len=:), allocatable :: names(:), classes(:)
      type(crystal_class_type) :: class
      integer :: i, j

      allocate (names, source=split_list(basis_names))
      allocate (classes, source=split_list(crystal_class_names()))
      do i = 1, size(names)
         do j = 1, size(classes)
            class = class_of(trim(classes(j)))
            ! Not for its synonyms.
            if (class%name == classes(j)) call test_any_basis(trim(names(i)), class)
         end do
      end do
   end subroutine test_bases_by_name

   !> What any basis does. The numbers of terms and of their degrees are those that it states.
   !> Terms, scale and spread are finite, and those of a crystal alone are those among others. They
   !> do not change when a rotation of the crystal's group turns the crystal. y and the modulus are
   !> inverse functions of each other. A surrogate that is written and read has the same terms and
   !> predicts the same modulus, to the bit. Moduli and covariances of its model of grains are
   !> those of its terms. The derivatives with which it is trained are the change of terms and y
   !> with the crystal.
   subroutine test_any_basis(name, class)
      character(len=*), intent(in) :: name
      type(crystal_class_type), intent(in) :: class
      class(basis_type), allocatable :: basis
      type(error_type), allocatable :: error
      real(wp), allocatable, dimension(:, :) :: constants, euler_deg, terms, others
      real(wp), allocatable :: rotations(:, :, :), scale(:), spread(:), scales(:), spreads(:)
      real(wp) :: c(6, 6, n), euler(3, n), moduli(n), worst
      character(len=:), allocatable :: title
      integer :: i, k

      title = 'any '//name//', '//class%name//': '
      call make_basis(name, class, basis)
      call check(title//'terms', basis%n_terms > 0 .and. basis%least_noise > 0.0_wp &
         & .and. all(basis%first_sds > 0.0_wp))
      if (allocated(basis%prior_degrees)) then
         call check(title//'degrees of the terms', size(basis%prior_degrees) == basis%n_terms &
            & .and. minval(basis%prior_degrees) == 0)
      end if
      call spread_crystals(basis%domain, n, 5, constants, euler_deg, error)
      call check_success(title//'crystals', error)
      call basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      call check(title//'finite terms', all(abs(terms) < huge(1.0_wp)) &
         & .and. all(scale > 0.0_wp .and. scale < huge(1.0_wp)) .and. all(spread >= 1.0_wp &
         & .and. spread < huge(1.0_wp)) .and. all(shape(terms) == [basis%n_terms, n]))
      c = class%stiffnesses(constants)
      allocate (others, mold=terms)
      allocate (scales, spreads, mold=scale)
      call basis%evaluate_many(c, degree*euler_deg, others, scales, spreads)
      worst = maxval(abs(others - terms))/maxval(abs(terms)) + maxval(abs(scales/scale - 1.0_wp)) &
         & + maxval(abs(spreads/spread - 1.0_wp))
      call check_close(title//'many at once', worst, 0.0_wp, 1.0e-12_wp)
      allocate (rotations, source=group_rotations(class, 5))
      worst = 0.0_wp
      do k = 1, size(rotations, 3)
         do i = 1, n
            euler(:, i) = euler_angles(matmul(rotations(:, :, k), &
               & rotation_matrix(degree*euler_deg(:, i))))
         end do
         call basis%evaluate_many(c, euler, others, scales, spreads)
         worst = max(worst, maxval(abs(others - terms))/maxval(abs(terms)), &
            & maxval(abs(scales/scale - 1.0_wp)), maxval(abs(spreads/spread - 1.0_wp)))
      end do
      call check_close(title//'the group of the crystal', worst, 0.0_wp, 1.0e-8_wp)
      moduli = [60.0_wp, 150.0_wp, 400.0_wp]
      call check_close(title//'y and the modulus', maxval(abs(basis%to_modulus(basis%to_y(moduli, &
         & scale, spread), scale, spread)/moduli - 1.0_wp)), 0.0_wp, 1.0e-13_wp)
      call test_surrogate(title, basis, constants, euler_deg)
      call test_slopes(title, basis, constants(:, 1), euler_deg(:, 1))
   end subroutine test_any_basis

   !> A basis over crystals near an isotropic one.
   subroutine make_basis(name, class, basis)
      character(len=*), intent(in) :: name
      type(crystal_class_type), intent(in) :: class
      class(basis_type), allocatable, intent(out) :: basis
      type(domain_type) :: domain
      type(settings_type) :: settings
      type(entry_type), allocatable :: file(:)
      type(error_type), allocatable :: error
      character :: degree_of_terms

      ! Fewer terms where there are many constants.
      degree_of_terms = merge('2', '1', class%n_constants <= 7)
      associate (middle => class%constants_of(isotropic_stiffness(150.0_wp, 0.3_wp)))
         call new_domain(class%name, middle - 10.0_wp, middle + 10.0_wp, 10.0_wp, domain, error)
      end associate
      ! With it the noise may grow with the anisotropy.
      domain%log_anisotropy_max = 1.0_wp
      if (.not. allocated(error)) then
         call parse_namelist("&surrogate bandlimit = 4, truncation = 'total', degree = " &
            & //degree_of_terms//", model = '"//name//"' /", file, error)
      end if
      if (.not. allocated(error)) call read_settings(file, '', '', settings, error)
      if (.not. allocated(error)) call new_basis(domain, settings%surrogate, basis, error)
      if (allocated(error)) call check_success('any '//name//', '//class%name, error)
   end subroutine make_basis

   !> The file of a surrogate of the basis, and its model of grains.
   subroutine test_surrogate(title, basis, constants, euler_deg)
      character(len=*), intent(in) :: title
      class(basis_type), intent(in) :: basis
      !> GPa and degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      character(len=*), parameter :: path = 'test_bases.txt'
      type(surrogate_type) :: surrogate, copy
      class(grain_model_type), allocatable :: model
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: terms(:, :), others(:, :), scale(:), spread(:), scales(:), &
         & spreads(:), factor(:, :), columns(:, :), covariance(:, :)
      real(wp) :: c(6, 6), modulus(2), sd(2), moduli(n), slopes(n), expected(n), step(n)
      integer :: i, unit

      associate (m => basis%n_terms)
         allocate (surrogate%basis, source=basis)
         allocate (surrogate%coefficients(m), factor(m, 3), covariance(m, m))
         stream = new_random_stream(7, 1)
         call stream%normals(surrogate%coefficients)
         surrogate%coefficients = 0.02_wp*surrogate%coefficients
         ! A positive modulus.
         if (.not. basis%logarithmic) surrogate%coefficients(1) = 150.0_wp
         do i = 1, 3
            call stream%normals(factor(:, i))
         end do
         covariance = 1.0e-4_wp*matmul(factor, transpose(factor))
         do i = 1, m
            covariance(i, i) = covariance(i, i) + 1.0e-8_wp
         end do
      end associate
      surrogate%covariance = covariance
      surrogate%beta = 1.0e4_wp
      surrogate%simulations%constants = constants
      surrogate%simulations%euler_deg = euler_deg
      surrogate%simulations%modulus = spread_of_moduli()
      surrogate%provenance = '{}'
      call save_surrogate(surrogate, path, error)
      call check_success(title//'written', error)
      call load_surrogate(path, copy, error)
      call check_success(title//'read', error)
      if (allocated(error)) return
      open (newunit=unit, file=path, status='old')
      close (unit, status='delete')
      call basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      call copy%basis%evaluate_crystals(constants, euler_deg, others, scales, spreads)
      c = basis%domain%class%stiffness(constants(:, 1))
      call predict(surrogate, c, degree*euler_deg(:, 1), modulus(1), sd(1))
      call predict(copy, c, degree*euler_deg(:, 1), modulus(2), sd(2))
      call check(title//'the same number of terms', all(shape(others) == shape(terms)))
      if (all(shape(others) == shape(terms))) then
         call check(title//'the same bits of terms and moduli', all(others == terms) &
            & .and. all(scales == scale) .and. all(spreads == spread) &
            & .and. modulus(1) == modulus(2) .and. sd(1) == sd(2))
      end if
      call new_grain_model(surrogate, basis%domain%class, degree*euler_deg, .true., model, error)
      call check_success(title//'a model of grains', error)
      ! Theory in full, where there is theory.
      model%full_above = -1.0_wp
      call model%set_grains(degree*euler_deg, error)
      call model%evaluate_moduli(c, moduli, slopes)
      call basis%evaluate_crystals(spread_out(constants(:, 1)), euler_deg, terms, scale, spread)
      associate (y => matmul(surrogate%coefficients, terms))
         expected = basis%to_modulus(y, scale, spread)
         step = basis%to_modulus(y + 1.0e-5_wp, scale, spread) &
            & - basis%to_modulus(y - 1.0e-5_wp, scale, spread)
      end associate
      call check_close(title//'moduli of grains', maxval(abs(moduli/expected - 1.0_wp)), 0.0_wp, &
         & 1.0e-9_wp)
      call check_close(title//'their slopes', maxval(abs(slopes/step*2.0e-5_wp - 1.0_wp)), &
         & 0.0_wp, 1.0e-6_wp)
      allocate (columns(n, model%n_columns))
      call model%evaluate_columns(c, columns)
      factor = matmul(transpose(terms), matmul(covariance, terms))
      ! A basis may leave out directions that hardly matter.
      call check_close(title//'their covariance', maxval(abs(matmul(columns, &
         & transpose(columns)) - factor))/maxval(factor), 0.0_wp, 0.1_wp)
   end subroutine test_surrogate

   !> Any moduli, GPa.
   pure function spread_of_moduli() result(moduli)
      real(wp) :: moduli(n)
      integer :: i

      moduli = [(100.0_wp + i/3.0_wp, i=1, n)]
   end function spread_of_moduli

   !> The same crystal for every grain.
   pure function spread_out(constants) result(copies)
      real(wp), intent(in) :: constants(:)
      real(wp) :: copies(size(constants), n)

      copies = spread(constants, 2, n)
   end function spread_out

   !> Derivatives by the coordinates of the crystal, times the change of these, against differences.
   subroutine test_slopes(title, basis, constants, euler_deg)
      character(len=*), intent(in) :: title
      class(basis_type), intent(in) :: basis
      !> GPa and degrees.
      real(wp), intent(in) :: constants(:), euler_deg(3)
      real(wp), parameter :: step = 1.0e-3_wp
      type(log_coordinates_type) :: logarithms
      real(wp), allocatable :: slopes(:, :), y(:), near(:, :), scale(:), spread(:), w(:, :)
      real(wp) :: points(size(constants), 3), by_stiffness(21), values(3), c(6, 6, 3), middle
      real(wp), allocatable :: change(:)
      integer :: i, j, k, m

      m = count_slopes(basis)
      allocate (slopes(basis%n_terms, m), y(m), change(m))
      do k = 1, 3
         points(:, k) = constants + (k - 2)*step*[(sin(2.0_wp*i), i=1, size(constants))]
      end do
      c = basis%domain%class%stiffnesses(points)
      ! A modulus that is linear in the stiffness.
      by_stiffness = [(0.1_wp + 0.02_wp*cos(3.0_wp*i), i=1, 21)]
      do k = 1, 3
         values(k) = dot_product(by_stiffness, [((c(i, j, k), j=i, 6), i=1, 6)])
      end do
      call evaluate_slopes(basis, constants, euler_deg, slopes, y, values(2), by_stiffness)
      logarithms = new_log_coordinates(basis%domain%class)
      if (basis%logarithmic) logarithms = new_log_coordinates(class_of(general_class))
      allocate (w(logarithms%n, 3))
      do k = 1, 3
         w(:, k) = logarithms%to_logarithms(c(:, :, k))
      end do
      ! What follows the coordinates of the crystal are angles, which do not change.
      change = 0.0_wp
      change(:logarithms%n) = w(:, 3) - w(:, 1)
      call basis%evaluate_crystals(points, reshape([euler_deg, euler_deg, euler_deg], [3, 3]), &
         & near, scale, spread)
      values = spread*basis%to_y(values, scale, spread)
      middle = spread(2)
      do k = 1, 3
         near(:, k) = spread(k)*near(:, k)/middle
      end do
      near(:, 1) = near(:, 3) - near(:, 1)
      call check_close(title//'derivatives of the terms', maxval(abs(matmul(slopes, change) &
         & - near(:, 1)))/maxval(abs(near(:, 1))), 0.0_wp, 1.0e-5_wp)
      call check_close(title//'derivatives of y', dot_product(y, change)*middle &
         & /(values(3) - values(1)), 1.0_wp, 1.0e-5_wp)
   end subroutine test_slopes
end program test_bases
