!> The paper's domain, basis and surrogate: membership, orthonormality, counts, predictions, the
!> model of grains; and the file of any surrogate with all its damages.
program test_surrogate_model
   use abstract_basis, only: basis_type, grain_model_type
   use bases, only: new_basis
   use crystal_elasticity, only: anisotropy_index, is_stable, isotropic_stiffness
   use correction_basis, only: correction_basis_type
   use errors, only: error_type, exit_bad_input
   use files, only: read_text_file
   use kinds, only: degree_unit => degree, pi, wp
   use paper_basis, only: paper_basis_type
   use random, only: new_random_stream, random_stream_type
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, spread_crystals
   use surrogate_model, only: load_surrogate, new_grain_model, new_theory_surrogate, &
      & predict_crystals, save_surrogate, surrogate_type
   use testing, only: check, check_close, check_refused, check_success, clenshaw_curtis_weight, &
      & evaluate_terms, finish, new_domain, new_wide_domain, predict
   implicit none

   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp]
   character(len=*), parameter :: path = 'test_surrogate.txt'
   character, parameter :: newline = achar(10)

   call test_domain()
   call test_counts()
   call test_polynomials()
   call test_prediction('correction')
   call test_prediction('paper')
   call test_grain_model('total', 3, 4)
   call test_grain_model('tensor', 1, 4)
   call test_theory_alone()
   call test_damages()
   call test_many_terms()
   call finish()

contains

   !> Without a correction there are no polynomials to evaluate: the modulus of an isotropic crystal
   !> in two grains is E/(1 - nu^2).
   subroutine test_theory_alone()
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error
      real(wp), parameter :: euler(3, &
         & 2) = reshape([0.1_wp, 0.4_wp, 0.7_wp, 2.0_wp, 1.3_wp, 0.0_wp], [3, 2])
      real(wp) :: modulus(2), sd(2)

      call new_theory_surrogate(surrogate)
      call predict_crystals(surrogate, spread(isotropic_stiffness(210.0_wp, 0.3_wp), 3, 2), euler, &
         & 1, modulus, sd, error)
      call check_success('theory alone', error)
      call check_close('theory alone', maxval(abs(modulus - 210.0_wp/0.91_wp)), 0.0_wp, 1.0e-6_wp)
   end subroutine test_theory_alone

   !> The paper's domain of a class.
   function domain_of(symmetry) result(domain)
      character(len=*), intent(in) :: symmetry
      type(domain_type) :: domain
      type(error_type), allocatable :: error

      if (symmetry == 'cubic') then
         call new_domain(symmetry, [50.0_wp, 40.0_wp, 15.0_wp], [250.0_wp, 150.0_wp, 120.0_wp], &
            & 7.2_wp, domain, error)
      else
         call new_domain(symmetry, [80.0_wp, 40.0_wp, 30.0_wp, 70.0_wp, 40.0_wp], &
            & [240.0_wp, 120.0_wp, 90.0_wp, 210.0_wp, 90.0_wp], 10.0_wp, domain, error)
      end if
      if (allocated(error)) call check_success('new_domain', error)
   end function domain_of

   function basis_of(symmetry, truncation, degree, bandlimit) result(basis)
      character(len=*), intent(in) :: symmetry, truncation
      integer, intent(in) :: degree, bandlimit
      type(paper_basis_type) :: basis
      type(error_type), allocatable :: error

      call make_basis(domain_of(symmetry), truncation, degree, bandlimit, basis, error)
      if (allocated(error)) call check_success('a basis', error)
   end function basis_of

   subroutine make_basis(domain, truncation, degree, bandlimit, basis, error)
      type(domain_type), intent(in) :: domain
      character(len=*), intent(in) :: truncation
      integer, intent(in) :: degree, bandlimit
      type(paper_basis_type), intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      basis%domain = domain
      basis%settings%model = 'paper'
      basis%settings%truncation = truncation
      basis%settings%degree = degree
      basis%settings%bandlimit = bandlimit
      basis%settings%prior_sd = 'equal'
      call basis%set_up(error)
   end subroutine make_basis

   subroutine test_domain()
      type(domain_type) :: domain, none
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler(:, :)
      real(wp) :: mean_cosine, c(6, 6)
      logical :: inside
      integer :: i

      domain = domain_of('cubic')
      call spread_crystals(domain, 4000, 1, constants, euler, error)
      call check_success('4000 crystals of the cubic domain', error)
      inside = .true.
      do i = 1, 4000
         c = domain%class%stiffness(constants(:, i))
         inside = inside .and. is_stable(c) .and. anisotropy_index(c) <= 7.2_wp &
            & .and. domain%admits(c) .and. all(constants(:, i) >= domain%lower) &
            & .and. all(constants(:, i) <= domain%upper)
      end do
      call check('all are admissible', inside)
      ! Uniform on the hemisphere: cos Phi is uniform on 0 .. 1, its mean 1/2 with sd 1/sqrt(12 n)
      ! for independent points.
      mean_cosine = sum(cos(degree_unit*euler(2, :)))/4000
      call check_close('directions are uniform', mean_cosine, 0.5_wp, 3.0_wp/sqrt(12.0_wp*4000))
      call check('copper is admitted', domain%admits(domain%class%stiffness(copper)))
      call check('an unstable crystal is not', &
         & .not. domain%admits(domain%class%stiffness([100.0_wp, 120.0_wp, 50.0_wp])))
      call check('nor one beyond a bound', &
         & .not. domain%admits(domain%class%stiffness([260.0_wp, 121.4_wp, 75.4_wp])))
      call check('nor one beyond the cap', &
         & .not. domain%admits(domain%class%stiffness([100.0_wp, 92.0_wp, 100.0_wp])))
      c = domain%class%stiffness(copper)
      c(1, 1) = 170.0_wp
      call check('nor one that is not cubic', .not. domain%admits(c))
      call new_domain('cubic', [50.0_wp, 60.0_wp, 15.0_wp], [250.0_wp, 60.0_wp, 120.0_wp], 7.2_wp, &
         & none, error)
      call check_refused('equal bounds', error, 'C12 are 60.0 and 60.0')
      call new_domain('cubic', [50.0_wp, 60.0_wp], [250.0_wp, 60.0_wp], 7.2_wp, none, error)
      call check_refused('too few bounds', error, '3 constants, not 2 and 2')
      domain%upper(1) = 51.0_wp
      domain%lower(2) = 149.0_wp
      call spread_crystals(domain, 10, 1, constants, euler, error)
      call check_refused('a domain without stable crystals', error, 'no stable crystal')
   end subroutine test_domain

   subroutine test_counts()
      type(paper_basis_type) :: basis
      type(error_type), allocatable :: error
      class(basis_type), allocatable :: other
      type(domain_type) :: wide

      basis = basis_of('cubic', 'tensor', 2, 10)
      call check('paper, cubic: 27 x 5', basis%polynomials%n_products == 27 &
         & .and. basis%harmonics%n == 5 .and. basis%n_terms == 135)
      call check('degrees of its terms', all(basis%harmonics%degrees == [0, 4, 6, 8, 10]) &
         & .and. all(sum(basis%polynomials%degrees(:, [1, 2, 27]), 1) == [0, 1, 6]))
      basis = basis_of('hexagonal', 'tensor', 2, 4)
      call check('paper, hexagonal: 243 x 3', basis%n_terms == 729)
      call make_basis(domain_of('cubic'), 'tensor', 2, 5, basis, error)
      call check_refused('an odd bandlimit is refused', error, 'bandlimit = 5')
      call make_basis(domain_of('cubic'), 'tensor', 2, 22, basis, error)
      call check_refused('a bandlimit above the largest is refused', error, 'bandlimit = 22')
      call make_basis(domain_of('hexagonal'), 'tensor', 12, 20, basis, error)
      call check_refused('more terms than memory is refused before it is asked for', error, &
         & '4.084E+006 terms; at most 20000')
      call make_basis(domain_of('cubic'), 'round', 2, 4, basis, error)
      call check_refused('an unknown truncation', error, &
         & '''round'' is unknown; allowed: tensor, total')
      call new_wide_domain('cubic', 'cubic', 1.5_wp, [0.05_wp, 0.45_wp], wide, error)
      call make_basis(wide, 'tensor', 2, 4, basis, error)
      call check_refused('no bounds', error, 'needs bounds of all constants')
      call new_basis(domain_of('cubic'), surrogate_settings_type(model='paper', &
         & truncation='total', degree=3, bandlimit=4, file='', scan='', prior_sd='degree'), other, &
         & error)
      call check('as the settings ask for', other%n_terms == 40 &
         & .and. maxval(other%prior_degrees) == 3 .and. all(other%prior_degrees(:3) == [0, 1, 1]))
   end subroutine test_counts

   subroutine test_polynomials()
      type(paper_basis_type) :: basis
      real(wp) :: p(27), gram(27, 27), scale, spread, x(3), constants(3), weight
      integer :: i, j, k, q

      basis = basis_of('cubic', 'tensor', 2, 0)
      gram = 0.0_wp
      associate (domain => basis%domain)
         do k = 0, 8; do j = 0, 8; do i = 0, 8
               weight = clenshaw_curtis_weight(i, 8)*clenshaw_curtis_weight(j, &
                  & 8)*clenshaw_curtis_weight(k, 8)/8
               x = -cos(pi*[i, j, k]/8)
               constants = domain%lower + 0.5_wp*(x + 1)*(domain%upper - domain%lower)
               call evaluate_terms(basis, domain%class%stiffness(constants), &
                  & [0.0_wp, 0.0_wp, 0.0_wp], p, scale, spread)
               do q = 1, 27
                  gram(:, q) = gram(:, q) + weight*p*p(q)
               end do
            end do; end do; end do
         do q = 1, 27
            gram(q, q) = gram(q, q) - 1
         end do
         call check_close('orthonormal polynomials', maxval(abs(gram)), 0.0_wp, 1.0e-12_wp)
         call check_close('the scale of a box is 1', scale, 1.0_wp, 0.0_wp)
         ! Every product is that of its degrees, at the corner x = 1 where each factor is
         ! sqrt(2n+1).
         call evaluate_terms(basis, domain%class%stiffness(domain%upper), &
            & [0.0_wp, 0.0_wp, 0.0_wp], p, scale, spread)
         do q = 1, 27
            p(q) = p(q) - product(sqrt(2.0_wp*basis%polynomials%degrees(:, q) + 1))
         end do
         call check_close('products at a corner', maxval(abs(p)), 0.0_wp, 1.0e-12_wp)
         call check_close('a corner is on the boundary', &
            & domain%normalised_distance(domain%class%stiffness(domain%upper)), 1.0_wp, 1.0e-14_wp)
      end associate
      do q = 2, 27
         if (sum(basis%polynomials%degrees(:, q)) < sum(basis%polynomials%degrees(:, q - 1))) exit
         do k = 1, q - 1
            if (all(basis%polynomials%degrees(:, q) == basis%polynomials%degrees(:, k))) exit
         end do
         if (k < q) exit
      end do
      call check('each product once, those of lower degree first', q == 28)
   end subroutine test_polynomials

   !> A surrogate with a random posterior.
   function random_surrogate(model) result(surrogate)
      character(len=*), intent(in) :: model
      type(surrogate_type) :: surrogate
      type(correction_basis_type) :: correction
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: factor(:, :)
      integer :: i, j, n

      if (model == 'paper') then
         allocate (surrogate%basis, source=basis_of('cubic', 'total', 2, 4))
      else
         correction%domain = domain_of('cubic')
         correction%settings%model = 'correction'
         correction%settings%degree = 2
         call correction%set_up(error)
         if (allocated(error)) call check_success('a correction', error)
         allocate (surrogate%basis, source=correction)
      end if
      n = surrogate%basis%n_terms
      surrogate%alpha = 3.0_wp
      surrogate%beta = 1.0e4_wp
      surrogate%decay_rate = 0.3125_wp
      allocate (surrogate%coefficients(n), factor(n, n))
      stream = new_random_stream(5, 1)
      do j = 1, n
         call stream%normal(surrogate%coefficients(j))
         do i = 1, n
            call stream%normal(factor(i, j))
         end do
      end do
      surrogate%coefficients = 0.1_wp*surrogate%coefficients
      surrogate%covariance = 0.5e-4_wp*matmul(factor, transpose(factor))
      surrogate%covariance = surrogate%covariance + transpose(surrogate%covariance)
      surrogate%simulations%constants = reshape([copper, 2*copper], [3, 2])
      surrogate%simulations%euler_deg = reshape([1.0_wp, 2.0_wp, 3.0_wp, 0.1_wp, 1.0_wp/3, &
         & 0.0_wp], [3, 2])
      surrogate%simulations%modulus = [130.0_wp, 1.0e2_wp/3]
      surrogate%provenance = '{'//newline//' "title": "a title"'//newline//'}'
   end function random_surrogate

   subroutine test_prediction(kind)
      !> 'paper' or 'correction'.
      character(len=*), intent(in) :: kind
      type(surrogate_type) :: surrogate, copy
      type(error_type), allocatable :: error
      class(grain_model_type), allocatable :: model
      real(wp), allocatable :: terms(:, :), columns(:, :)
      real(wp) :: scale, spread, euler(3, 4), modulus, sd, y, variance, again, again_sd, c(6, 6), &
         & moduli(4), slopes(4)
      real(wp) :: expected(4, 4)
      logical :: same
      integer :: i

      surrogate = random_surrogate(kind)
      associate (basis => surrogate%basis)
         c = basis%domain%class%stiffness(copper)
         euler = reshape([0.3_wp, 0.7_wp, 1.9_wp, 0.0_wp, 0.0_wp, 0.0_wp, 2.0_wp, 1.2_wp, 3.0_wp, &
            & 0.2_wp, 0.5_wp, 0.1_wp], [3, 4])
         allocate (terms(basis%n_terms, 4))
         do i = 4, 1, -1
            call evaluate_terms(basis, c, euler(:, i), terms(:, i), scale, spread)
         end do
         call predict(surrogate, c, euler(:, 1), modulus, sd)
         y = dot_product(terms(:, 1), surrogate%coefficients)
         variance = sum(terms(:, 1)*matmul(surrogate%covariance, terms(:, 1))) + 1/surrogate%beta
         if (kind == 'paper') then
            call check_close('modulus is y', modulus, y, 1.0e-10_wp)
            call check_close('its sd', sd, sqrt(variance), 1.0e-9_wp)
         else
            call check_close('modulus is s exp(y)', modulus, scale*exp(y), 1.0e-10_wp)
            call check_close('sd by the delta method', sd, scale*exp(y)*sqrt(variance), 1.0e-9_wp)
         end if
         call check('copper is covered', basis%domain%admits(c))
         call check('an unstable crystal is not', &
            & .not. basis%domain%admits(basis%domain%class%stiffness([100.0_wp, &
            & 120.0_wp, 50.0_wp])))
         call check('nor one with a Zener ratio of 50', &
            & .not. basis%domain%admits(basis%domain%class%stiffness([100.0_wp, 96.0_wp, &
            & 100.0_wp])))
         call check('nor copper three times as stiff', .not. basis%domain%admits(3*c))
         call new_grain_model(surrogate, surrogate%basis%domain%class, euler, .true., model, error)
         call check_success('a model of grains', error)
         ! Theory in full, where there is theory.
         model%full_above = -1.0_wp
         call model%evaluate_moduli(c, moduli, slopes)
         call check_close('its moduli are the predicted ones', moduli(1), modulus, 1.0e-9_wp)
         call check_close('its slopes', slopes(1), &
            & merge(1.0_wp, modulus, kind == 'paper'), 1.0e-9_wp)
         allocate (columns(4, model%n_columns))
         call model%evaluate_columns(c, columns)
         expected = matmul(transpose(terms), matmul(surrogate%covariance, terms))
         ! Of a correction all but a hundredth, on the average over its domain.
         call check_close('its columns are a factor of the covariance', &
            & maxval(abs(matmul(columns, transpose(columns)) - expected)), 0.0_wp, &
            & merge(1.0e-12_wp, 0.1_wp*maxval(expected), kind == 'paper'))
      end associate
      call save_surrogate(surrogate, path, error)
      call check_success('a surrogate is written', error)
      call save_surrogate(surrogate, path, error)
      call check_success('and replaced', error)
      call load_surrogate(path, copy, error)
      call check_success('and read', error)
      if (allocated(error)) return
      call predict(copy, c, euler(:, 1), again, again_sd)
      same = again == modulus .and. again_sd == sd .and. copy%basis%domain%anisotropy_cap &
         & == 7.2_wp .and. all(copy%coefficients == surrogate%coefficients) &
         & .and. all(copy%covariance == surrogate%covariance) .and. copy%alpha == surrogate%alpha &
         & .and. copy%beta == surrogate%beta .and. copy%decay_rate == surrogate%decay_rate &
         & .and. copy%basis%domain%members == 'cubic' &
         & .and. all(copy%basis%domain%poisson == surrogate%basis%domain%poisson) &
         & .and. all(copy%simulations%constants == surrogate%simulations%constants) &
         & .and. all(copy%simulations%euler_deg == surrogate%simulations%euler_deg) &
         & .and. all(copy%simulations%modulus == surrogate%simulations%modulus) &
         & .and. copy%provenance == surrogate%provenance
      call check('to the last bit', same)
      call remove(path)
      call load_surrogate(path, copy, error)
      call check_refused('a missing file is refused', error, path//': the file does not exist')
      call write_file('campaign.sqlite', 'SQLite format 3')
      call save_surrogate(surrogate, 'campaign.sqlite', error)
      call check_refused('a file that is no surrogate is not replaced', error, &
         & 'campaign.sqlite: is there and is not a surrogate')
      call remove('campaign.sqlite')
      call save_surrogate(surrogate, '.', error)
      call check_refused('nor a folder', error, 'is a folder')
   end subroutine test_prediction

   !> The moduli of grains and the factor of their covariance against the terms themselves.
   subroutine test_grain_model(truncation, degree, bandlimit)
      character(len=*), intent(in) :: truncation
      integer, intent(in) :: degree, bandlimit
      type(surrogate_type) :: surrogate
      type(random_stream_type) :: stream
      class(grain_model_type), allocatable :: model
      type(error_type), allocatable :: error
      real(wp), parameter :: crystal(5) = [162.0_wp, 92.0_wp, 47.0_wp, 180.0_wp, 69.0_wp]
      real(wp), allocatable :: terms(:, :), root(:, :), columns(:, :), expected(:, :)
      real(wp) :: euler(3, 5), scale, spread, c(6, 6), moduli(5), slopes(5)
      integer :: i, j, n

      allocate (surrogate%basis, source=basis_of('hexagonal', truncation, degree, bandlimit))
      n = surrogate%basis%n_terms
      allocate (root(n, n), surrogate%coefficients(n), terms(n, 5))
      stream = new_random_stream(3, 1)
      do j = 1, n
         call stream%normal(surrogate%coefficients(j))
         do i = 1, n
            call stream%normal(root(i, j))
         end do
      end do
      surrogate%covariance = matmul(root, transpose(root))
      allocate (surrogate%simulations%constants(5, 0), surrogate%simulations%euler_deg(3, 0), &
         & surrogate%simulations%modulus(0))
      c = surrogate%basis%domain%class%stiffness(crystal)
      do i = 1, 5
         euler(:, i) = [0.1_wp*i, 0.3_wp*i, 0.7_wp]
         call evaluate_terms(surrogate%basis, c, euler(:, i), terms(:, i), scale, spread)
      end do
      call new_grain_model(surrogate, surrogate%basis%domain%class, euler(:, :2), .true., &
         & model, error)
      call model%set_grains(euler, error)
      call check_success(truncation//': a model of grains', error)
      call model%evaluate_moduli(c, moduli, slopes)
      allocate (columns(5, model%n_columns))
      call model%evaluate_columns(c, columns)
      expected = matmul(transpose(terms), matmul(surrogate%covariance, terms))
      call check(truncation//': moduli of grains', &
         & maxval(abs(moduli/surrogate%basis%to_modulus(matmul(surrogate%coefficients, terms), &
         & scale, spread) - 1.0_wp)) < 1.0e-11_wp)
      call check(truncation//': their covariance', maxval(abs(matmul(columns, transpose(columns)) &
         & - expected)) < 1.0e-11_wp*maxval(expected))
      call new_grain_model(surrogate, surrogate%basis%domain%class, euler, .false., model, error)
      call check(truncation//': no columns without covariance', model%n_columns == 0)
   end subroutine test_grain_model

   !> Every truncation, every change of a byte and every wrong value is one line that names the
   !> file.
   subroutine test_damages()
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error
      character(len=:), allocatable :: whole, changed
      logical :: all_refused
      integer :: i, step

      surrogate = random_surrogate('paper')
      call save_surrogate(surrogate, path, error)
      call read_text_file(path, whole, error)
      all_refused = .true.
      step = max(1, len(whole)/97)
      do i = 1, len(whole) - 1, step
         all_refused = all_refused .and. is_refused(whole(:i))
      end do
      call check('truncated', all_refused)
      all_refused = .true.
      do i = 1, len(whole), step
         changed = whole
         changed(i:i) = merge('7', '8', whole(i:i) /= '7')
         all_refused = all_refused .and. is_refused(changed)
         changed(i:i) = newline
         if (whole(i:i) /= newline) all_refused = all_refused .and. is_refused(changed)
      end do
      call check('one byte changed', all_refused)
      call check('a line more', is_refused(whole//'more'//newline))
      call check_damage(whole, 'beta 1', 'beta -1', 'beta = -10000.0', &
         & path//': the surrogate is damaged: ')
      call check_damage(whole, 'alpha 3.0', 'alpha NaN', '''alpha'': ''NaN''', 'line 19: ')
      call check_damage(whole, 'alpha 3.0', 'alpha 1.0E999', 'is not a finite number', 'line 19: ')
      call check_damage(whole, 'fall 0.3125', 'fall 0.0', 'must be positive', '')
      call check_damage(whole, 'coefficients 20', 'coefficients 19', &
         & 'has a line that is too long', '')
      call check_damage(whole, 'coefficients 20', 'coefficients 999999', 'has no 999999 values', '')
      call check_damage(whole, 'covariance 210', 'covariance 7', 'has a line that is too long', '')
      call check_damage(whole, 'covariance 210'//newline, 'covariance 210'//newline//'-', &
         & 'variance of coefficient 1', '')
      call check_damage(whole, 'symmetry cubic', 'symmetry hexagonal', &
         & 'cubic crystals are no hexagonal ones', '')
      call check_damage(whole, 'symmetry cubic', 'symmetry wood', 'wood', '')
      call check_damage(whole, 'bandlimit 4', 'bandlimit 6', &
         & '20 coefficients and 210 covariances', '')
      call check_damage(whole, 'degree 2', 'degree two', 'a whole number', '')
      call check_damage(whole, 'degree 2', 'degre 2', '''degree'' is expected, not ''degre 2''', '')
      call check_damage(whole, 'surrogate 5', 'surrogate 3', 'version 3', 'not 5; build it anew')
      call check_damage(whole, 'model paper', 'model plastic', '''plastic'' is unknown', '')
      call check_damage(whole, 'title', 'tiger', 'checksum', '')
      call check('no surrogate at all', is_refused('phi1_deg, Phi_deg'//newline))
      call check('empty', is_refused(''))
      call remove(path)
      surrogate%covariance(2, 1) = 2*sqrt(surrogate%covariance(1, 1)*surrogate%covariance(2, 2))
      call save_surrogate(surrogate, path, error)
      call load_surrogate(path, surrogate, error)
      call check_refused('a covariance that is not positive', error, 'the covariance is not one')
      call remove(path)
   end subroutine test_damages

   !> A covariance of eight megabytes, as much as the stack, is read.
   subroutine test_many_terms()
      type(surrogate_type) :: surrogate, copy
      type(error_type), allocatable :: error
      integer :: i, n

      surrogate = random_surrogate('paper')
      deallocate (surrogate%basis, surrogate%covariance)
      allocate (surrogate%basis, source=basis_of('cubic', 'tensor', 4, 20))
      n = surrogate%basis%n_terms
      call check('many terms', n > 1024)
      surrogate%coefficients = [(1.0_wp/i, i=1, n)]
      allocate (surrogate%covariance(n, n), source=0.0_wp)
      do i = 1, n
         surrogate%covariance(i, i) = 1.0e-4_wp/i
      end do
      call save_surrogate(surrogate, path, error)
      call check_success('many terms', error)
      call load_surrogate(path, copy, error)
      call check_success('many terms, again', error)
      if (.not. allocated(error)) then
         call check('all terms', all(copy%coefficients == surrogate%coefficients) &
            & .and. all(copy%covariance == surrogate%covariance))
      end if
      call remove(path)
   end subroutine test_many_terms

   !> The refusal of a file with `old` replaced by `new` has both fragments.
   subroutine check_damage(whole, old, new, first, second)
      character(len=*), intent(in) :: whole, old, new, first, second
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error
      integer :: i

      i = index(whole, old)
      call check('there is what is changed to get: '//first, i > 0)
      call write_file(path, whole(:i - 1)//new//whole(i + len(old):))
      call load_surrogate(path, surrogate, error)
      call check_refused('damaged: '//first, error, first)
      call check_refused('damaged: '//first, error, second)
   end subroutine check_damage

   logical function is_refused(content)
      character(len=*), intent(in) :: content
      type(surrogate_type) :: surrogate
      type(error_type), allocatable :: error

      call write_file(path, content)
      call load_surrogate(path, surrogate, error)
      is_refused = .false.
      if (.not. allocated(error)) return
      if (error%status /= exit_bad_input) return
      is_refused = index(error%line(), path//': ') == 1 .and. index(error%line(), newline) == 0
   end function is_refused

   subroutine write_file(name, content)
      character(len=*), intent(in) :: name, content
      integer :: unit

      open (newunit=unit, file=name, access='stream', form='unformatted', status='replace', &
         & action='write')
      write (unit) content
      close (unit)
   end subroutine write_file

   subroutine remove(name)
      character(len=*), intent(in) :: name
      integer :: unit

      open (newunit=unit, file=name, status='old')
      close (unit, status='delete')
   end subroutine remove
end program test_surrogate_model
