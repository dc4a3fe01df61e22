!> A test harness of a few lines: each check prints one line of the Test Anything Protocol.
module testing
   use abstract_basis, only: basis_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use kinds, only: pi, wp
   use settings_schema, only: settings_type
   use surrogate_domain, only: complete_domain, domain_type
   use surrogate_model, only: predict_crystals, surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: check, check_close, check_success, check_refused, class_of, stiffness_of, &
      & default_settings, wide, finish
   public :: clenshaw_curtis_weight, evaluate_terms, long_cases, predict, new_domain, &
      & new_wide_domain

   integer :: count = 0, failures = 0

contains

   !> Mean and sd (GPa) of the modulus of one crystal.
   subroutine predict(surrogate, c, euler, modulus, sd)
      type(surrogate_type), intent(in) :: surrogate
      !> Stiffness of a Born-stable crystal in its axes, GPa; Bunge-Euler angles, radians.
      real(wp), intent(in) :: c(6, 6), euler(3)
      real(wp), intent(out) :: modulus, sd
      type(error_type), allocatable :: error
      real(wp) :: moduli(1), sds(1)

      call predict_crystals(surrogate, reshape(c, [6, 6, 1]), reshape(euler, [3, 1]), 1, &
         & moduli, sds, error)
      if (allocated(error)) call check_success('a prediction', error)
      modulus = moduli(1)
      sd = sds(1)
   end subroutine predict

   !> Whether the long cases are asked for, in place of the others.
   logical function long_cases()
      character(len=4) :: word

      call get_command_argument(2, word)
      long_cases = word == 'long'
   end function long_cases

   !> Record whether `condition` holds; `detail` is printed when it does not.
   subroutine check(name, condition, detail)
      character(len=*), intent(in) :: name
      logical, intent(in) :: condition
      character(len=*), intent(in), optional :: detail

      count = count + 1
      if (condition) then
         print '(a,i0,2a)', 'ok ', count, ' - ', name
      else
         failures = failures + 1
         print '(a,i0,2a)', 'not ok ', count, ' - ', name
         if (present(detail)) print '(2a)', '# ', detail
      end if
   end subroutine check

   !> |actual - expected| <= tolerance, absolute.
   subroutine check_close(name, actual, expected, tolerance)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: actual, expected, tolerance

      call check(name, abs(actual - expected) <= tolerance, to_text(actual, 15)//' is not within ' &
         & //to_text(tolerance)//' of '//to_text(expected, 15))
   end subroutine check_close

   subroutine check_success(name, error)
      character(len=*), intent(in) :: name
      type(error_type), intent(in), allocatable :: error

      if (allocated(error)) then
         call check(name, .false., error%line())
      else
         call check(name, .true.)
      end if
   end subroutine check_success

   !> An error is there, and its message holds `fragment`.
   subroutine check_refused(name, error, fragment)
      character(len=*), intent(in) :: name, fragment
      type(error_type), intent(in), allocatable :: error

      if (allocated(error)) then
         call check(name, index(error%line(), fragment) > 0, 'the message is: '//error%line())
      else
         call check(name, .false., 'no error was raised')
      end if
   end subroutine check_refused

   !> A crystal class that exists.
   function class_of(name) result(class)
      character(len=*), intent(in) :: name
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error

      call new_crystal_class(name, class, error)
      if (allocated(error)) call check_success('class_of '//name, error)
   end function class_of

   !> Settings with nothing stated.
   function default_settings() result(settings)
      type(settings_type) :: settings

      settings%specimen%geometry = 'halfspace'
      settings%specimen%width_um = 9.6_wp
      settings%specimen%estimator = 'curve'
      settings%specimen%substrate = 'isotropic'
      settings%specimen%matrix = 'self'
      settings%specimen%height_um = 4.8_wp
      settings%indenter%shape = 'paraboloid'
      settings%indenter%radius_um = 16.0_wp
      settings%indenter%half_angle_deg = 70.3_wp
      settings%indenter%contact_radius_um = 0.5_wp
      settings%simulation%simulator = 'fe'
      settings%simulation%element = ''
      settings%simulation%integration = 'selective'
      settings%simulation%refine = 1.0_wp
      settings%simulation%outer = 5.0_wp
      settings%simulation%growth = 1.13_wp
      settings%simulation%depths = 10
      settings%simulation%extrapolate = .false.
   end function default_settings

   !> The domain of a class between bounds (GPa) below a cap, of any scale or within the range
   !> `stiffness`, GPa.
   subroutine new_domain(class, lower, upper, anisotropy_cap, domain, error, stiffness)
      character(len=*), intent(in) :: class
      real(wp), intent(in) :: lower(:), upper(:), anisotropy_cap
      type(domain_type), intent(out) :: domain
      type(error_type), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: stiffness(2)

      domain%lower = lower
      domain%upper = upper
      domain%anisotropy_cap = anisotropy_cap
      if (present(stiffness)) domain%stiffness = stiffness
      call complete_domain(class, domain, error)
   end subroutine new_domain

   !> The domain of all crystals of a class up to a log-anisotropy, between two Poisson's ratios, of
   !> `members`.
   subroutine new_wide_domain(class, members, log_anisotropy_max, poisson, domain, error, stiffness)
      character(len=*), intent(in) :: class, members
      real(wp), intent(in) :: log_anisotropy_max, poisson(2)
      type(domain_type), intent(out) :: domain
      type(error_type), allocatable, intent(out) :: error
      real(wp), intent(in), optional :: stiffness(2)

      domain%members = members
      domain%log_anisotropy_max = log_anisotropy_max
      domain%poisson = poisson
      if (present(stiffness)) domain%stiffness = stiffness
      call complete_domain(class, domain, error)
   end subroutine new_wide_domain

   !> The terms of one crystal in one orientation (radians).
   subroutine evaluate_terms(basis, c, euler, terms, scale, spread)
      class(basis_type), intent(in) :: basis
      real(wp), intent(in) :: c(6, 6), euler(3)
      real(wp), intent(out) :: terms(:), scale, spread
      real(wp) :: column(basis%n_terms, 1), one(1), other(1)

      call basis%evaluate_many(reshape(c, [6, 6, 1]), reshape(euler, [3, 1]), column, one, other)
      terms = column(:, 1)
      scale = one(1)
      spread = other(1)
   end subroutine evaluate_terms

   !> The domain of all crystals of the classes, of any scale or within the range `stiffness`, GPa.
   function wide(members, anisotropy, poisson, stiffness) result(domain)
      character(len=*), intent(in) :: members
      real(wp), intent(in) :: anisotropy, poisson(2)
      real(wp), intent(in), optional :: stiffness(2)
      type(domain_type) :: domain
      type(error_type), allocatable :: error

      call new_wide_domain('triclinic', members, anisotropy, poisson, domain, error, stiffness)
      if (allocated(error)) call check_success('new_wide_domain', error)
   end function wide

   !> Stiffness (GPa) of a class from its constants (GPa).
   function stiffness_of(name, constants) result(c)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: constants(:)
      real(wp) :: c(6, 6)
      type(crystal_class_type) :: found

      found = class_of(name)
      c = found%stiffness(constants)
   end function stiffness_of

   !> Weight of node cos(pi i/n), 0 <= i <= n, of the rule that integrates polynomials of degree n
   !> over [-1, 1]; n is even.
   pure real(wp) function clenshaw_curtis_weight(i, n) result(weight)
      integer, intent(in) :: i, n
      integer :: k

      weight = 1.0_wp
      do k = 1, n/2
         weight = weight - merge(1.0_wp, 2.0_wp, &
            & 2*k == n)*cos(2.0_wp*pi*k*i/n)/(4.0_wp*k*k - 1.0_wp)
      end do
      weight = weight*merge(1.0_wp, 2.0_wp, i == 0 .or. i == n)/n
   end function clenshaw_curtis_weight

   !> Print the plan; the process ends with status 1 if anything failed.
   subroutine finish()
      print '(a,i0)', '1..', count
      if (failures > 0) error stop 1
   end subroutine finish
end module testing
