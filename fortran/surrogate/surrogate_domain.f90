!> Which crystals a surrogate is taught, and points spread over them.
module surrogate_domain
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: anisotropy_index
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: pi, wp
   use labelled_values, only: labelled_values_type
   use text, only: to_text
   implicit none
   private
   public :: domain_type, new_domain, exchange_domain, spread_crystals

   !> Born-stable crystals of a class between bounds of its constants whose anisotropy index (Eq. 14) does not exceed a cap.
   type :: domain_type
      type(crystal_class_type) :: class
      !> GPa, (n_constants).
      real(wp), allocatable :: lower(:), upper(:)
      real(wp) :: anisotropy_cap = huge(1.0_wp)
   contains
      procedure :: admits
      procedure :: is_of_class
      procedure :: is_within_cap
   end type domain_type

contains

   !> The domain of a class between bounds below a cap.
   subroutine new_domain(class, lower, upper, anisotropy_cap, domain, error)
      !> Name or synonym of the crystal class.
      character(len=*), intent(in) :: class
      !> GPa, (n_constants).
      real(wp), intent(in) :: lower(:), upper(:)
      !> Above 0.
      real(wp), intent(in) :: anisotropy_cap
      type(domain_type), intent(out) :: domain
      type(error_type), allocatable, intent(out) :: error
      integer :: j

      call new_crystal_class(class, domain%class, error)
      if (allocated(error)) return
      associate (n => domain%class%n_constants, names => domain%class%constants)
         if (size(lower) /= n .or. size(upper) /= n) then
            call raise(error, 'the domain of '//domain%class%name//' crystals has bounds for each of '//to_text(n) &
               & //' constants, not '//to_text(size(lower))//' and '//to_text(size(upper)), exit_bad_input)
            return
         end if
         do j = 1, n
            if (upper(j) - lower(j) > 0.0_wp .and. upper(j) - lower(j) < huge(1.0_wp)) cycle
            call raise(error, 'the bounds of '//names(j)//' are '//to_text(lower(j))//' and '//to_text(upper(j)) &
               & //' GPa; the lower must be below the upper', exit_bad_input)
            return
         end do
      end associate
      if (.not. (anisotropy_cap > 0.0_wp .and. anisotropy_cap <= huge(1.0_wp))) then
         call raise(error, 'anisotropy_cap = '//to_text(anisotropy_cap)//' must be positive', exit_bad_input)
         return
      end if
      domain%lower = lower
      domain%upper = upper
      domain%anisotropy_cap = anisotropy_cap
   end subroutine new_domain

   !> Write a domain, or read what was written.
   subroutine exchange_domain(domain, file)
      type(domain_type), intent(inout) :: domain
      class(labelled_values_type), intent(inout) :: file
      type(error_type), allocatable :: error
      character(len=:), allocatable :: name
      real(wp), allocatable :: lower(:), upper(:)
      real(wp) :: anisotropy_cap

      if (.not. file%reading) then
         name = domain%class%name
         lower = domain%lower
         upper = domain%upper
         anisotropy_cap = domain%anisotropy_cap
      end if
      call file%text('symmetry', name)
      call file%reals('c_min', lower)
      call file%reals('c_max', upper)
      call file%real('anisotropy_cap', anisotropy_cap)
      if (allocated(file%error) .or. .not. file%reading) return
      call new_domain(name, lower, upper, anisotropy_cap, domain, error)
      if (allocated(error)) call file%fail(error%message)
   end subroutine exchange_domain

   !> Whether a crystal is in the domain.
   pure logical function admits(self, c)
      class(domain_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: constants(self%class%n_constants)

      constants = self%class%constants_of(c)
      admits = all(constants >= self%lower) .and. all(constants <= self%upper) .and. self%is_of_class(c) &
         & .and. self%is_within_cap(c)
   end function admits

   !> Whether a stiffness has the symmetry of the class in its axes.
   pure logical function is_of_class(self, c)
      class(domain_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp), parameter :: rounding = 1.0e-9_wp

      is_of_class = maxval(abs(c - self%class%stiffness(self%class%constants_of(c)))) <= rounding*maxval(abs(c))
   end function is_of_class

   !> Whether a crystal is stable and no more anisotropic than the cap.
   pure logical function is_within_cap(self, c)
      class(domain_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: c(6, 6)

      ! The index of an unstable crystal is NaN.
      is_within_cap = anisotropy_index(c) <= self%anisotropy_cap
   end function is_within_cap

   !> The first n crystals of the domain in a Halton sequence, with indentation directions uniform on the sphere.
   subroutine spread_crystals(domain, n, constants, euler, error)
      type(domain_type), intent(in) :: domain
      integer, intent(in) :: n
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), radians.
      real(wp), allocatable, intent(out) :: constants(:, :), euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: primes(24) = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, &
         & 83, 89]
      !> An empty domain shows after this many points.
      integer, parameter :: most_trials = 20000000, least_share = 10000
      real(wp) :: u(24)
      integer :: found, trial, k, j

      k = domain%class%n_constants
      allocate (constants(k, n), euler(3, n))
      found = 0
      do trial = 1, most_trials
         if (found == n) return
         if (trial > 1000000 .and. found < trial/least_share) exit
         do j = 1, k + 3
            u(j) = radical_inverse(trial, primes(j))
         end do
         constants(:, found + 1) = domain%lower + u(:k)*(domain%upper - domain%lower)
         if (.not. domain%admits(domain%class%stiffness(constants(:, found + 1)))) cycle
         found = found + 1
         ! Phi within 0..90 degrees: a direction and its opposite are the same indentation.
         euler(:, found) = [2.0_wp*pi*u(k + 1), acos(1.0_wp - u(k + 2)), 2.0_wp*pi*u(k + 3)]
      end do
      if (found < n) call raise(error, 'the domain holds (almost) no stable crystal below its anisotropy cap of ' &
         & //to_text(domain%anisotropy_cap), exit_bad_input)
   end subroutine spread_crystals

   !> Van der Corput's sequence: the digits of i in a base, mirrored at the point.
   pure real(wp) function radical_inverse(i, base) result(u)
      integer, intent(in) :: i, base
      integer :: rest
      real(wp) :: unit

      u = 0.0_wp
      unit = 1.0_wp/base
      rest = i
      do while (rest > 0)
         u = u + unit*mod(rest, base)
         rest = rest/base
         unit = unit/base
      end do
   end function radical_inverse
end module surrogate_domain
