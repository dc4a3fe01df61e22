!> A surrogate: the posterior of the coefficients of a basis, and what it predicts.
!>
!> All algebra is in y: M = y with box coordinates, M = s exp(y) with dimensionless ones. The predicted modulus is that of
!> the mean of y; its sd is by the delta method, |dM/dy| sd(y), and is that of a simulated modulus: it includes 1/beta.
module surrogate_model
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_null_ptr, c_ptr
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: anisotropy_index, is_stable
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: i8, wp
   use surrogate_basis, only: basis_type, coordinate_count, coordinates_dimensionless, coordinates_from_name, &
      & coordinates_name, evaluate_terms, is_in_ranges, new_basis, truncation_from_name, truncation_name
   use text, only: to_text
   implicit none
   private
   public :: surrogate_type, predict, is_outside, save_surrogate, load_surrogate
   public :: surrogate_to_handle, surrogate_from_handle

   type :: surrogate_type
      type(basis_type) :: basis
      !> Largest anisotropy index (Eq. 14) of the domain.
      real(wp) :: anisotropy_cap = huge(1.0_wp)
      !> Posterior mean A(h, q) and covariance of the terms, in units of y.
      real(wp), allocatable :: coefficients(:, :), covariance(:, :)
      !> Precision of the prior (of a term of weight 1) and of the noise, in units of y.
      real(wp) :: alpha = 1.0_wp, beta = 1.0_wp
      !> Factor on every predicted sd, learnt from crystals left out.
      real(wp) :: sd_inflation = 1.0_wp
   end type surrogate_type

contains

   !> A surrogate as the 64-bit integer under which another language keeps it.
   function surrogate_to_handle(surrogate) result(handle)
      type(surrogate_type), intent(in), pointer :: surrogate
      integer(i8) :: handle

      handle = transfer(c_loc(surrogate), handle)
   end function surrogate_to_handle

   !> The surrogate that a handle stands for.
   function surrogate_from_handle(handle) result(surrogate)
      integer(i8), intent(in) :: handle
      type(surrogate_type), pointer :: surrogate
      type(c_ptr) :: address

      address = c_null_ptr
      address = transfer(handle, address)
      call c_f_pointer(address, surrogate)
   end function surrogate_from_handle

   !> Mean and sd (GPa) of the simulated indentation modulus of one crystal at one orientation.
   pure subroutine predict(surrogate, constants, euler, modulus, sd)
      type(surrogate_type), intent(in) :: surrogate
      !> GPa, of a Born-stable crystal; Bunge-Euler angles, radians.
      real(wp), intent(in) :: constants(:), euler(3)
      real(wp), intent(out) :: modulus, sd
      real(wp) :: terms(surrogate%basis%n_terms), scale, y, variance
      integer :: j, h, n

      n = surrogate%basis%n_harmonics
      call evaluate_terms(surrogate%basis, constants, euler, terms, scale)
      y = 0.0_wp
      do j = 1, surrogate%basis%n_polynomials
         do h = 1, n
            y = y + surrogate%coefficients(h, j)*terms(h + (j - 1)*n)
         end do
      end do
      variance = 0.0_wp
      do j = 1, size(terms)
         variance = variance + terms(j)*(terms(j)*surrogate%covariance(j, j) &
            & + 2.0_wp*dot_product(surrogate%covariance(j + 1:, j), terms(j + 1:)))
      end do
      sd = surrogate%sd_inflation*sqrt(max(0.0_wp, variance) + 1.0_wp/surrogate%beta)
      modulus = y
      if (surrogate%basis%coordinates == coordinates_dimensionless) then
         modulus = scale*exp(y)
         sd = modulus*sd
      end if
   end subroutine predict

   !> Whether a crystal is outside the surrogate's domain: unstable, a coordinate out of its range, or the index beyond the cap.
   pure logical function is_outside(surrogate, constants)
      type(surrogate_type), intent(in) :: surrogate
      real(wp), intent(in) :: constants(:)
      real(wp) :: c(6, 6)

      is_outside = .true.
      c = surrogate%basis%class%stiffness(constants)
      if (.not. is_stable(c)) return
      if (anisotropy_index(c) > surrogate%anisotropy_cap) return
      is_outside = .not. is_in_ranges(surrogate%basis, constants)
   end function is_outside

   !> Write a surrogate as text: two namelist groups, numbers to 17 digits.
   subroutine save_surrogate(surrogate, path, error)
      type(surrogate_type), intent(in) :: surrogate
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      integer :: unit, status, j
      character(len=256) :: reason

      open (newunit=unit, file=path, status='replace', action='write', iostat=status, iomsg=reason)
      if (status /= 0) then
         call raise(error, path//': cannot be written: '//trim(reason))
         return
      end if
      write (unit, '(a)') '! A surrogate for the indentation modulus; see docs/surrogate.md. GPa and radians.', &
         & '&surrogate_model', &
         & '  symmetry = '''//surrogate%basis%class%name//'''', &
         & '  coordinates = '''//coordinates_name(surrogate%basis%coordinates)//'''', &
         & '  truncation = '''//truncation_name(surrogate%basis%truncation)//'''', &
         & '  degree = '//to_text(surrogate%basis%degree), &
         & '  bandlimit = '//to_text(surrogate%basis%bandlimit)
      call write_values(unit, 'lower', surrogate%basis%lower)
      call write_values(unit, 'upper', surrogate%basis%upper)
      call write_values(unit, 'anisotropy_cap', [surrogate%anisotropy_cap])
      call write_values(unit, 'alpha', [surrogate%alpha])
      call write_values(unit, 'beta', [surrogate%beta])
      call write_values(unit, 'sd_inflation', [surrogate%sd_inflation])
      write (unit, '(a)') '/', '&surrogate_posterior'
      call write_values(unit, 'coefficients', reshape(surrogate%coefficients, [size(surrogate%coefficients)]))
      ! The lower triangle, column by column.
      call write_values(unit, 'covariance', [(surrogate%covariance(j:, j), j=1, size(surrogate%covariance, 2))])
      write (unit, '(a)') '/'
      close (unit)
   end subroutine save_surrogate

   subroutine write_values(unit, name, values)
      integer, intent(in) :: unit
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: values(:)

      write (unit, '(3a,*(es24.16e3,:,1x))') '  ', name, ' = ', values(:min(4, size(values)))
      if (size(values) > 4) write (unit, '(4(4x,es24.16e3))') values(5:)
   end subroutine write_values

   !> Read what `save_surrogate` wrote.
   subroutine load_surrogate(path, surrogate, error)
      character(len=*), intent(in) :: path
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      character(len=32) :: symmetry, coordinates, truncation
      character(len=256) :: reason
      integer :: degree, bandlimit, unit, status, n, j, first
      type(crystal_class_type) :: class
      real(wp) :: lower(5), upper(5), anisotropy_cap, alpha, beta, sd_inflation
      real(wp), allocatable :: coefficients(:), covariance(:)
      namelist /surrogate_model/ symmetry, coordinates, truncation, degree, bandlimit, lower, upper, anisotropy_cap, alpha, &
         & beta, sd_inflation
      namelist /surrogate_posterior/ coefficients, covariance

      open (newunit=unit, file=path, status='old', action='read', iostat=status, iomsg=reason)
      if (status /= 0) then
         call raise(error, path//': cannot be read: '//trim(reason), exit_bad_input)
         return
      end if
      lower = 0.0_wp
      upper = 0.0_wp
      degree = -1
      bandlimit = -1
      alpha = 0.0_wp
      beta = 0.0_wp
      anisotropy_cap = huge(1.0_wp)
      sd_inflation = 1.0_wp
      symmetry = ''
      coordinates = ''
      truncation = ''
      n = 0
      allocate (coefficients(0), covariance(0))
      read (unit, nml=surrogate_model, iostat=status, iomsg=reason)
      if (status == 0) then
         call new_crystal_class(symmetry, class, error)
         n = min(5, coordinate_count(class, coordinates_from_name(trim(coordinates))))
         if (.not. allocated(error)) call new_basis(class, coordinates_from_name(trim(coordinates)), &
            & truncation_from_name(trim(truncation)), degree, bandlimit, lower(:n), upper(:n), surrogate%basis, error)
         if (.not. allocated(error) .and. .not. (alpha > 0.0_wp .and. beta > 0.0_wp .and. sd_inflation > 0.0_wp)) then
            call raise(error, 'alpha, beta and sd_inflation must be positive', exit_bad_input)
         end if
         if (allocated(error)) then
            error%message = path//': '//error%message
            close (unit)
            return
         end if
         n = surrogate%basis%n_terms
         ! A value that stays so is missing.
         coefficients = spread(huge(1.0_wp), 1, n)
         covariance = spread(huge(1.0_wp), 1, n*(n + 1)/2)
         read (unit, nml=surrogate_posterior, iostat=status, iomsg=reason)
      end if
      close (unit)
      if (status /= 0) then
         call raise(error, path//': is not a surrogate, or is damaged: '//trim(reason), exit_bad_input)
         return
      end if
      if (.not. (all(abs(coefficients) < huge(1.0_wp)) .and. all(abs(covariance) < huge(1.0_wp)))) then
         call raise(error, path//': a coefficient or covariance is missing or not finite', exit_bad_input)
         return
      end if
      surrogate%anisotropy_cap = anisotropy_cap
      surrogate%alpha = alpha
      surrogate%beta = beta
      surrogate%sd_inflation = sd_inflation
      surrogate%coefficients = reshape(coefficients, [surrogate%basis%n_harmonics, surrogate%basis%n_polynomials])
      allocate (surrogate%covariance(n, n))
      first = 1
      do j = 1, n
         surrogate%covariance(j:, j) = covariance(first:first + n - j)
         surrogate%covariance(j, j:) = covariance(first:first + n - j)
         first = first + n - j + 1
      end do
   end subroutine load_surrogate
end module surrogate_model
