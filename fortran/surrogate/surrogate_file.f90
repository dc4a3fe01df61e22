!> The one format of a surrogate: text, one value or block of values a line or more, the first line naming format and version, the
!> last a checksum. GPa, and degrees for the simulations' angles.
module surrogate_file
   use bases, only: allocate_basis
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists, is_folder, read_text_file, replace_file
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use linear_algebra, only: cholesky_factor
   use surrogate_domain, only: exchange_domain
   use surrogate_model, only: simulations_type, surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: save_surrogate, load_surrogate, check_replaceable, check_values, exchange_surrogate

   character(len=*), parameter :: label = 'bayesindent-surrogate'
   integer, parameter :: version = 4, oldest = 3

contains

   !> Write a surrogate, whole or not at all; a file that is not a surrogate is not replaced.
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
         call raise(error, path//': '//file%error%message)
      else
         call replace_file(path, file%content(:file%filled), error)
         surrogate%checksum = last_word(file%content(:file%filled))
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
      if (allocated(error)) then
         error%message = path//': '//error%message
      else if (.not. is_surrogate(path)) then
         call raise(error, path//': is not a surrogate of bayesindent', exit_bad_input)
      else
         call exchange_surrogate(surrogate, file)
         call file%finish()
         if (allocated(file%error)) call raise(error, path//': the surrogate is damaged: '//file%error%message, exit_bad_input)
         surrogate%checksum = last_word(file%content)
      end if
   end subroutine load_surrogate

   !> The checksum, with which a file ends.
   pure function last_word(content)
      character(len=*), intent(in) :: content
      character(len=16) :: last_word

      last_word = content(max(1, len(content) - len(last_word)):len(content) - 1)
   end function last_word

   !> Refuse to write where something is that is not a surrogate.
   subroutine check_replaceable(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error

      if (is_folder(path)) then
         call raise(error, path//': is a folder; the surrogate is a file', exit_bad_input)
      else if (file_exists(path)) then
         if (.not. is_surrogate(path)) call raise(error, path//': is there and is not a surrogate, so it is not replaced; ' &
            & //'give the surrogate another name', exit_bad_input)
      end if
   end subroutine check_replaceable

   !> Whether a file begins as a surrogate does.
   logical function is_surrogate(path)
      character(len=*), intent(in) :: path
      character(len=len(label) + 1) :: start
      integer :: unit, status

      is_surrogate = .false.
      open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=status)
      if (status /= 0) return
      read (unit, iostat=status) start
      is_surrogate = status == 0 .and. start == label//' '
      close (unit)
   end function is_surrogate

   !> All of a surrogate, in the order of the file; what is read is checked.
   subroutine exchange_surrogate(surrogate, file)
      type(surrogate_type), intent(inout) :: surrogate
      type(labelled_values_type), intent(inout) :: file
      type(error_type), allocatable :: error
      character(len=:), allocatable :: name
      integer :: number

      if (.not. file%reading) then
         name = surrogate%basis%settings%model
         number = version
      end if
      call file%integer(label, number)
      if (number < oldest .or. number > version) call file%fail('it has version '//to_text(number)//' of the format; versions ' &
         & //to_text(oldest)//' and '//to_text(version)//' are known')
      call file%text('model', name)
      if (file%reading .and. .not. allocated(file%error)) then
         call allocate_basis(name, surrogate%basis, error)
         if (allocated(error)) call file%fail(error%message)
      end if
      if (allocated(file%error)) return
      call exchange_domain(surrogate%basis%domain, file)
      if (allocated(file%error)) return
      call surrogate%basis%exchange(file)
      if (file%reading .and. .not. allocated(file%error)) then
         call surrogate%basis%set_up(error)
         if (allocated(error)) call file%fail(error%message)
      end if
      surrogate%basis%noise_growth = merge(surrogate%basis%noise_growth, 0.0_wp, number == version)
      if (number == version) call file%real('noise_growth', surrogate%basis%noise_growth)
      call file%real('alpha', surrogate%alpha)
      call file%real('beta', surrogate%beta)
      call file%real('fall', surrogate%decay_rate)
      call file%real('contact_radius_um', surrogate%contact_radius)
      call file%reals('coefficients', surrogate%coefficients)
      call exchange_covariance(surrogate, file)
      call exchange_simulations(surrogate%simulations, surrogate%basis%domain%class%n_constants, file)
      call file%lines('provenance', surrogate%provenance)
      if (file%reading .and. .not. allocated(file%error)) call check_values(surrogate, file%error)
   end subroutine exchange_surrogate

   !> The lower triangle, column by column.
   subroutine exchange_covariance(surrogate, file)
      type(surrogate_type), intent(inout) :: surrogate
      type(labelled_values_type), intent(inout) :: file
      real(wp), allocatable :: packed(:)
      integer :: n, j, first

      n = surrogate%basis%n_terms
      if (.not. file%reading) then
         allocate (packed(n*(n + 1)/2))
         first = 1
         do j = 1, n
            packed(first:first + n - j) = surrogate%covariance(j:, j)
            first = first + n - j + 1
         end do
      end if
      call file%reals('covariance', packed)
      if (allocated(file%error) .or. .not. file%reading) return
      if (size(packed) /= n*(n + 1)/2 .or. size(surrogate%coefficients) /= n) then
         call file%fail('there are '//to_text(size(surrogate%coefficients))//' coefficients and '//to_text(size(packed)) &
            & //' covariances; '//to_text(n)//' and '//to_text(n*(n + 1)/2)//' are needed')
         return
      end if
      allocate (surrogate%covariance(n, n))
      first = 1
      do j = 1, n
         surrogate%covariance(j:, j) = packed(first:first + n - j)
         surrogate%covariance(j, j:) = packed(first:first + n - j)
         first = first + n - j + 1
      end do
   end subroutine exchange_covariance

   subroutine exchange_simulations(simulations, n_constants, file)
      type(simulations_type), intent(inout) :: simulations
      integer, intent(in) :: n_constants
      type(labelled_values_type), intent(inout) :: file
      real(wp), allocatable :: constants(:), euler_deg(:)
      integer :: n

      if (.not. allocated(simulations%modulus)) allocate (simulations%constants(n_constants, 0), simulations%euler_deg(3, 0), &
         & simulations%modulus(0))
      constants = reshape(simulations%constants, [size(simulations%constants)])
      euler_deg = reshape(simulations%euler_deg, [size(simulations%euler_deg)])
      call file%reals('simulated_constants', constants)
      call file%reals('simulated_euler_deg', euler_deg)
      call file%reals('simulated_modulus_gpa', simulations%modulus)
      if (allocated(file%error) .or. .not. file%reading) return
      n = size(simulations%modulus)
      if (size(constants) /= size(simulations%constants, 1)*n .or. size(euler_deg) /= 3*n) then
         call file%fail('the simulations have '//to_text(size(constants))//' constants, '//to_text(size(euler_deg)) &
            & //' angles and '//to_text(n)//' moduli')
         return
      end if
      simulations%constants = reshape(constants, [n_constants, n])
      simulations%euler_deg = reshape(euler_deg, [3, n])
      if (any(simulations%modulus <= 0.0_wp)) call file%fail('a simulated modulus is not positive')
   end subroutine exchange_simulations

   !> Refuse precisions that are not positive and a covariance that is none.
   subroutine check_values(surrogate, error)
      type(surrogate_type), intent(in) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: rounding = 1.0e-6_wp
      real(wp), allocatable :: correlation(:, :), sd(:)
      integer :: i, j, n

      n = surrogate%basis%n_terms
      if (.not. (surrogate%alpha > 0.0_wp .and. surrogate%beta > 0.0_wp .and. surrogate%decay_rate > 0.0_wp)) then
         call raise(error, 'alpha = '//to_text(surrogate%alpha)//', beta = '//to_text(surrogate%beta)//' and fall = ' &
            & //to_text(surrogate%decay_rate)//' must be positive', exit_bad_input)
         return
      end if
      sd = [(surrogate%covariance(i, i), i=1, n)]
      if (.not. all(sd > 0.0_wp)) then
         call raise(error, 'the variance of coefficient '//to_text(findloc(sd > 0.0_wp, .false., dim=1))//' is not positive', &
            & exit_bad_input)
         return
      end if
      sd = sqrt(sd)
      allocate (correlation(n, n))
      do j = 1, n
         correlation(:, j) = surrogate%covariance(:, j)/(sd*sd(j))
         correlation(j, j) = correlation(j, j) + rounding
      end do
      call cholesky_factor(correlation, error)
      if (allocated(error)) error%message = 'the covariance is not one: '//error%message
   end subroutine check_values
end module surrogate_file
