!> A surrogate: the posterior of the coefficients of a basis, and what it predicts.
!>
!> The regression is in y (see `abstract_basis`). The predicted modulus is that of the mean of y.
!> Its sd follows from the delta method, |dM/dy| sd(y), and is that of a simulated modulus: it
!> includes 1/beta.
!>
!> The file is text: a value or an array after each label. The first line names format and version,
!> the last line is a checksum. Moduli are in GPa, the angles of the simulations in degrees. This
!> module also finds named surrogates and checks the names of new ones, for both programs.
module surrogate_model
   use abstract_basis, only: basis_type, grain_model_type
   use bases, only: allocate_basis, exchange_settings, new_basis
   use crystal_class, only: crystal_class_type, general_class, new_crystal_class
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, locate_error, prefix_error, raise, refuse
   use evidence_regression, only: factored_forms
   use files, only: file_exists, is_folder, printable, read_bytes, read_text_file, replace_file, &
      & resolve_path
   use kinds, only: wp
   use simulate, only: n_derivatives
   use labelled_values, only: labelled_values_type
   use linear_algebra, only: cholesky_factor
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, complete_domain, exchange_domain
   use text, only: to_text
   implicit none
   private
   public :: surrogate_type, simulations_type, values_alone, new_theory_surrogate, predict_crystals
   public :: new_grain_model, save_surrogate, load_surrogate, check_replaceable, exchange_surrogate
   public :: places_type, find_surrogate, load_named_surrogate, check_new_name

   !> Simulations on which a surrogate was trained.
   type :: simulations_type
      !> Constants of the domain's class (n_constants, n) and moduli (n), GPa; Bunge-Euler angles
      !> (3, n), degrees.
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
      !> Derivatives of each modulus by C11, C12, .. C66 in crystal axes, (21, n); 0 where they are
      !> unknown. Files of surrogates do not have them.
      real(wp), allocatable :: by_stiffness(:, :)
   contains
      procedure :: of_rows, append
   end type simulations_type

   type :: surrogate_type
      class(basis_type), allocatable :: basis
      !> Posterior mean (n_terms) and covariance (n_terms, n_terms) of the coefficients, in units of
      !> y.
      real(wp), allocatable :: coefficients(:), covariance(:, :)
      !> Precision of the prior (of a term of degree 1) and of the noise, in units of y.
      real(wp) :: alpha = 1.0_wp, beta = 1.0_wp
      !> Decay rate of the prior's sd of a coefficient: its ratio from degree to degree.
      real(wp) :: decay_rate = 1.0_wp
      !> Contact radius at the last depth of the simulations, on a half-space, um; 0 if the specimen
      !> has no length.
      real(wp) :: contact_radius = 0.0_wp
      type(simulations_type) :: simulations
      !> Origin of the surrogate: a JSON object.
      character(len=:), allocatable :: provenance
      !> Checksum of the file that it was read from or written to, '' if there is none.
      character(len=16) :: checksum = ''
   end type surrogate_type

   character(len=*), parameter :: label = 'bayesindent-surrogate'
   integer, parameter :: version = 5

   !> The surrogate that needs no simulation and no file.
   character(len=*), parameter :: theory_name = 'halfspace'

   character(len=*), parameter :: extension = '.txt'

   !> Folders in which surrogates are looked for. Each is '' or ends in a slash.
   type :: places_type
      !> Folders of the results and of the namelist.
      character(len=:), allocatable :: output, folder
      !> Folder of the package's data, and the names of the surrogates in it, separated by ', '.
      character(len=:), allocatable :: data_folder, shipped
   end type places_type

contains

   !> Simulations without derivatives.
   pure type(simulations_type) function values_alone(constants, euler_deg, modulus) result(values)
      !> As in `simulations_type`.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :), modulus(:)

      values = simulations_type(constants, euler_deg, modulus)
      allocate (values%by_stiffness(n_derivatives, size(modulus)), source=0.0_wp)
   end function values_alone

   !> The simulations of the numbers `rows`.
   pure type(simulations_type) function of_rows(self, rows) result(some)
      class(simulations_type), intent(in) :: self
      integer, intent(in) :: rows(:)

      some%constants = self%constants(:, rows)
      some%euler_deg = self%euler_deg(:, rows)
      some%modulus = self%modulus(rows)
      some%by_stiffness = self%by_stiffness(:, rows)
   end function of_rows

   !> Append others.
   subroutine append(self, others)
      class(simulations_type), intent(inout) :: self
      type(simulations_type), intent(in) :: others
      integer :: n

      self%modulus = [self%modulus, others%modulus]
      n = size(self%modulus)
      ! Array constructors would be on the stack, and these may be large.
      self%constants = reshape(self%constants, [size(self%constants, 1), n], others%constants)
      self%euler_deg = reshape(self%euler_deg, [3, n], others%euler_deg)
      self%by_stiffness = reshape(self%by_stiffness, [size(self%by_stiffness, 1), n], &
         & others%by_stiffness)
   end subroutine append

   !> The exact theory of the half-space, which needs no simulation.
   subroutine new_theory_surrogate(surrogate)
      type(surrogate_type), intent(out) :: surrogate
      !> Never allocated: the class exists, and the model has no settings.
      type(error_type), allocatable :: error
      type(domain_type) :: domain
      type(surrogate_settings_type) :: settings

      settings%model = 'halfspace'
      domain%poisson = [-0.999_wp, 0.499_wp]
      call complete_domain(general_class, domain, error)
      call new_basis(domain, settings, surrogate%basis, error)
      allocate (surrogate%coefficients(0), surrogate%covariance(0, 0), &
         & surrogate%simulations%constants(21, 0), surrogate%simulations%euler_deg(3, 0), &
         & surrogate%simulations%modulus(0))
      surrogate%beta = huge(1.0_wp)
      surrogate%provenance = '{"model": "exact theory of the half-space"}'
   end subroutine new_theory_surrogate

   !> Mean and sd (GPa) of the simulated indentation modulus of crystals. Unstable crystals, and
   !> crystals without the symmetry of the surrogate's class, are refused.
   subroutine predict_crystals(surrogate, stiffness, euler, threads, modulus, sd, error)
      type(surrogate_type), intent(in) :: surrogate
      !> In crystal axes, GPa, (6, 6, n); Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler(:, :)
      integer, intent(in) :: threads
      !> GPa, (n).
      real(wp), intent(inout) :: modulus(:), sd(:)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: block_size = 64
      type(error_type), allocatable :: singular
      !> Lower factor of the covariance, if it has one.
      real(wp), allocatable :: factor(:, :)
      integer :: i

      associate (domain => surrogate%basis%domain)
         do i = 1, size(stiffness, 3)
            call check_stiffness(stiffness(:, :, i), error)
            if (.not. (allocated(error) .or. domain%is_of_class(stiffness(:, :, i)))) then
               call refuse(error, 'the stiffness is not that of a '//domain%class%name &
                  & //' crystal in its axes, for which the surrogate is')
            end if
            call prefix_error(error, 'crystal '//to_text(i)//': ')
            if (allocated(error)) return
         end do
      end associate
      factor = surrogate%covariance
      call cholesky_factor(factor, singular)
      if (allocated(singular)) deallocate (factor)
      !$omp parallel do num_threads(threads) schedule(static)
      do i = 1, size(stiffness, 3), block_size
         call predict_block(i, min(i + block_size - 1, size(stiffness, 3)))
      end do
      !$omp end parallel do

   contains

      !> Mean and sd of the crystals `first` to `last`, whose variances follow from one product of
      !> matrices.
      subroutine predict_block(first, last)
         integer, intent(in) :: first, last
         real(wp) :: terms(surrogate%basis%n_terms, first:last)
         real(wp), dimension(first:last) :: scale, spread, variance
         integer :: k

         associate (basis => surrogate%basis)
            call basis%evaluate_many(stiffness(:, :, first:last), euler(:, first:last), terms, &
               & scale, spread)
            do k = first, last
               modulus(k) = basis%to_modulus(dot_product(surrogate%coefficients, terms(:, k)), &
                  & scale(k), spread(k))
            end do
            call factored_forms(surrogate%covariance, factor, terms, variance)
            if (basis%logarithmic) scale = spread*modulus(first:last)
         end associate
         if (surrogate%beta < huge(1.0_wp)) variance = variance + 1.0_wp/surrogate%beta
         sd(first:last) = scale*sqrt(variance)
      end subroutine predict_block
   end subroutine predict_crystals

   !> Moduli of certain grains as a function of the crystal, and their covariance on request.
   subroutine new_grain_model(surrogate, class, euler, with_covariance, model, error, field_degree)
      type(surrogate_type), intent(in) :: surrogate
      !> Class of the crystals that will be evaluated.
      type(crystal_class_type), intent(in) :: class
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      !> Whether the model includes the covariance.
      logical, intent(in) :: with_covariance
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      !> Degree of the harmonics from which the theory is read; absent: that of a new model.
      integer, intent(in), optional :: field_degree
      !> Number of the latest crystals that represent those of the training.
      integer, parameter :: most_trained = 500
      real(wp), allocatable :: covariance(:, :)

      allocate (covariance(0, 0))
      if (with_covariance) covariance = surrogate%covariance
      associate (known => surrogate%simulations, &
         & first => max(1, size(surrogate%simulations%modulus) + 1 - most_trained))
         call surrogate%basis%new_grain_model(class, surrogate%coefficients, covariance, &
            & known%constants(:, first:), known%euler_deg(:, first:), model, error)
      end associate
      if (allocated(error)) return
      if (present(field_degree)) model%field_degree = field_degree
      call model%set_grains(euler, error)
   end subroutine new_grain_model

   !> Write a surrogate. An incomplete file is never left, and a file that is not a surrogate is not
   !> replaced.
   subroutine save_surrogate(surrogate, path, error)
      type(surrogate_type), intent(inout) :: surrogate
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      type(labelled_values_type) :: file

      call check_replaceable(path, error)
      if (allocated(error)) return
      call exchange_surrogate(surrogate, file)
      call file%finish()
      if (allocated(file%error)) then
         call raise(error, file%error%message)
         call locate_error(error, path)
      else
         call replace_file(path, file%content(:file%filled), error)
         surrogate%checksum = checksum_in(file%content(:file%filled))
      end if
   end subroutine save_surrogate

   !> Read what `save_surrogate` wrote.
   subroutine load_surrogate(path, surrogate, error)
      character(len=*), intent(in) :: path
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(labelled_values_type) :: file

      file%reading = .true.
      call read_text_file(path, file%content, error)
      if (.not. allocated(error)) then
         if (index(file%content, label//' ') /= 1) then
            call refuse(error, 'is not a surrogate of bayesindent')
         else
            call exchange_surrogate(surrogate, file)
            call file%finish()
            if (allocated(file%error)) then
               call refuse(error, 'the surrogate is damaged: '//file%error%message)
            end if
            surrogate%checksum = checksum_in(file%content)
         end if
      end if
      call locate_error(error, path)
   end subroutine load_surrogate

   !> The checksum at the end of a file.
   pure function checksum_in(content)
      character(len=*), intent(in) :: content
      character(len=16) :: checksum_in

      checksum_in = content(max(1, len(content) - len(checksum_in)):len(content) - 1)
   end function checksum_in

   !> Refuse to replace something that is not a surrogate.
   subroutine check_replaceable(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content
      type(error_type), allocatable :: unreadable

      if (is_folder(path)) then
         call refuse(error, 'is a folder; the surrogate is a file')
      else if (file_exists(path)) then
         call read_bytes(path, content, unreadable)
         if (index(content, label//' ') /= 1) then
            call refuse(error, 'is there and is not a surrogate, so it is not replaced; give the ' &
               & //'surrogate another name')
         end if
      end if
      call locate_error(error, path)
   end subroutine check_replaceable

   !> Write a surrogate in the order of the file, or read and check it.
   subroutine exchange_surrogate(surrogate, file)
      type(surrogate_type), intent(inout) :: surrogate
      type(labelled_values_type), intent(inout) :: file
      type(error_type), allocatable :: error
      character(len=:), allocatable :: name
      integer :: number

      if (.not. file%reading) name = surrogate%basis%settings%model
      number = version
      call file%integer(label, number)
      if (number /= version) then
         call file%fail('it has version '//to_text(number)//' of the format, not ' &
            & //to_text(version)//'; build it anew')
      end if
      call file%text('model', name)
      if (file%reading .and. .not. allocated(file%error)) then
         call allocate_basis(name, surrogate%basis, error)
         if (allocated(error)) call file%fail(error%message)
      end if
      if (allocated(file%error)) return
      call exchange_domain(surrogate%basis%domain, file)
      if (allocated(file%error)) return
      call exchange_settings(surrogate%basis%settings, file)
      if (file%reading .and. .not. allocated(file%error)) then
         call surrogate%basis%set_up(error)
         if (allocated(error)) call file%fail(error%message)
      end if
      call file%real('noise_growth', surrogate%basis%noise_growth)
      call file%real('alpha', surrogate%alpha)
      call file%real('beta', surrogate%beta)
      call file%real('fall', surrogate%decay_rate)
      call file%real('contact_radius_um', surrogate%contact_radius)
      call file%reals('coefficients', surrogate%coefficients)
      call exchange_covariance()
      call exchange_simulations(surrogate%simulations, &
         & surrogate%basis%domain%class%n_constants, file)
      call file%lines('provenance', surrogate%provenance)
      if (file%reading .and. .not. allocated(file%error)) call check_values(file%error)

   contains

      !> Write or read the lower triangle of the covariance, column by column.
      subroutine exchange_covariance()
         real(wp), allocatable :: packed(:)
         logical, allocatable :: lower(:, :)
         integer :: n, i, j, first

         n = surrogate%basis%n_terms
         allocate (lower(n, n))
         do j = 1, n
            lower(:, j) = [(i >= j, i=1, n)]
         end do
         if (.not. file%reading) packed = pack(surrogate%covariance, lower)
         call file%reals('covariance', packed)
         if (allocated(file%error) .or. .not. file%reading) return
         if (size(packed) /= n*(n + 1)/2 .or. size(surrogate%coefficients) /= n) then
            call file%fail('there are '//to_text(size(surrogate%coefficients)) &
               & //' coefficients and '//to_text(size(packed))//' covariances; '//to_text(n) &
               & //' and '//to_text(n*(n + 1)/2)//' are needed')
            return
         end if
         ! A temporary matrix would be too large for the stack.
         if (allocated(surrogate%covariance)) deallocate (surrogate%covariance)
         allocate (surrogate%covariance(n, n))
         first = 1
         do j = 1, n
            surrogate%covariance(j:, j) = packed(first:first + n - j)
            surrogate%covariance(j, j:) = packed(first:first + n - j)
            first = first + n - j + 1
         end do
      end subroutine exchange_covariance

      !> Refuse precisions that are not positive and a covariance that is not positive definite.
      subroutine check_values(error)
         type(error_type), allocatable, intent(out) :: error
         real(wp), parameter :: rounding = 1.0e-6_wp
         real(wp), allocatable :: correlation(:, :), sd(:)
         integer :: i, j, n

         n = surrogate%basis%n_terms
         sd = [(surrogate%covariance(i, i), i=1, n)]
         if (.not. (surrogate%alpha > 0.0_wp .and. surrogate%beta > 0.0_wp &
            & .and. surrogate%decay_rate > 0.0_wp)) then
            call refuse(error, 'alpha = '//to_text(surrogate%alpha)//', beta = ' &
               & //to_text(surrogate%beta)//' and fall = '//to_text(surrogate%decay_rate) &
               & //' must be positive')
         else if (.not. all(sd > 0.0_wp)) then
            call refuse(error, 'the variance of coefficient ' &
               & //to_text(findloc(sd > 0.0_wp, .false., dim=1))//' is not positive')
         end if
         if (allocated(error)) return
         sd = sqrt(sd)
         allocate (correlation(n, n))
         do j = 1, n
            correlation(:, j) = surrogate%covariance(:, j)/(sd*sd(j))
            correlation(j, j) = correlation(j, j) + rounding
         end do
         call cholesky_factor(correlation, error)
         call prefix_error(error, 'the covariance is not one: ')
      end subroutine check_values
   end subroutine exchange_surrogate

   !> Write or read the simulations of a surrogate.
   subroutine exchange_simulations(simulations, n_constants, file)
      type(simulations_type), intent(inout) :: simulations
      !> Of the class of the crystals.
      integer, intent(in) :: n_constants
      type(labelled_values_type), intent(inout) :: file
      real(wp), allocatable :: constants(:), euler_deg(:), by_stiffness(:)
      integer :: n

      allocate (by_stiffness(0))
      if (.not. file%reading) then
         constants = reshape(simulations%constants, [size(simulations%constants)])
         euler_deg = reshape(simulations%euler_deg, [size(simulations%euler_deg)])
         if (allocated(simulations%by_stiffness)) then
            by_stiffness = reshape(simulations%by_stiffness, [size(simulations%by_stiffness)])
         end if
      end if
      call file%reals('simulated_constants', constants)
      call file%reals('simulated_euler_deg', euler_deg)
      call file%reals('simulated_modulus_gpa', simulations%modulus)
      call file%reals('simulated_by_stiffness', by_stiffness)
      if (allocated(file%error) .or. .not. file%reading) return
      n = size(simulations%modulus)
      if (any([size(constants), size(euler_deg)] /= [n_constants, 3]*n)) then
         call file%fail('the simulations have '//to_text(size(constants))//' constants, ' &
            & //to_text(size(euler_deg))//' angles and '//to_text(n)//' moduli')
         return
      end if
      if (all([0, n_derivatives*n] /= size(by_stiffness))) then
         call file%fail('there are '//to_text(size(by_stiffness))//' derivatives of ' &
            & //to_text(n)//' moduli')
         return
      end if
      simulations%by_stiffness = reshape(by_stiffness, [n_derivatives, n], [0.0_wp])
      simulations%constants = reshape(constants, [n_constants, n])
      simulations%euler_deg = reshape(euler_deg, [3, n])
      if (any(simulations%modulus <= 0.0_wp)) then
         call file%fail('a simulated modulus is not positive')
      end if
   end subroutine exchange_simulations

   !> Find the path of a surrogate, '' for the theory: a file of the output folder, of the
   !> namelist's folder, or one that comes with the package.
   subroutine find_surrogate(name, places, path, error)
      !> A shipped name, or the name of a file.
      character(len=*), intent(in) :: name
      type(places_type), intent(in) :: places
      character(len=:), allocatable, intent(out) :: path
      type(error_type), allocatable, intent(out) :: error

      path = ''
      if (name == theory_name) return
      path = resolve_path(places%output, name)
      if (file_exists(path)) return
      path = resolve_path(places%folder, name)
      if (file_exists(path)) return
      path = places%data_folder//name//extension
      if (index(', '//places%shipped//',', ', '//name//',') > 0 .and. file_exists(path)) return
      call refuse(error, ''''//printable(name)//''': there is no such surrogate; run build ' &
         & //'first, or state a file in the output folder or beside the namelist, '//theory_name &
         & //', '//places%shipped)
   end subroutine find_surrogate

   !> Load a surrogate of crystals of a class.
   subroutine load_named_surrogate(name, class, places, surrogate, error)
      !> A shipped name, or the name of a file.
      character(len=*), intent(in) :: name
      !> Name or synonym of a crystal class whose crystals it must be valid for, or ''.
      character(len=*), intent(in) :: class
      type(places_type), intent(in) :: places
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path
      type(crystal_class_type) :: crystal

      if (name == theory_name) then
         call new_theory_surrogate(surrogate)
         return
      end if
      call find_surrogate(name, places, path, error)
      if (.not. allocated(error)) call load_surrogate(path, surrogate, error)
      if (allocated(error) .or. len(class) == 0) return
      call new_crystal_class(class, crystal, error)
      if (allocated(error)) return
      associate (own => surrogate%basis%domain%class)
         if (.not. own%includes(crystal)) then
            call refuse(error, path//' is for '//own%name//' crystals, not '//crystal%name//' ones')
         end if
      end associate
   end subroutine load_named_surrogate

   !> Refuse a name that a new surrogate in the output folder cannot have.
   subroutine check_new_name(name, error)
      !> Name of the file.
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: allowed = '; allowed: a name that ends in '//extension &
         & //', for example surrogate'//extension
      integer :: stem

      stem = len(name) - len(extension)
      if (index(name, '/') > 0) then
         call refuse(error, &
            & ''''//printable(name)//''': a new surrogate is kept in the output folder'//allowed)
      else if (index(name, extension, back=.true.) /= stem + 1 .or. stem < 1) then
         call refuse(error, ''''//printable(name)//''' is no name of a new surrogate'//allowed)
      end if
   end subroutine check_new_name

end module surrogate_model
