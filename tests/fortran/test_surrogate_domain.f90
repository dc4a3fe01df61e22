!> The domain of a correction: its limits, and crystals spread over it.
program test_surrogate_domain
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: kelvin_form, logarithmic_mean
   use errors, only: error_type
   use kinds, only: degree, wp
   use linear_algebra, only: symmetric_eigen
   use surrogate_domain, only: domain_type, spread_crystals
   use testing, only: check, check_close, check_refused, check_success, class_of, finish, &
      & new_domain, new_wide_domain, wide
   implicit none

   call test_limits()
   call test_scale()
   call test_hypercube()
   call finish()

contains

   subroutine test_limits()
      type(domain_type) :: domain
      type(error_type), allocatable :: error
      type(crystal_class_type) :: class
      real(wp) :: copper(6, 6), lead(6, 6)

      class = class_of('cubic')
      copper = class%stiffness([168.4_wp, 121.4_wp, 75.4_wp])
      ! Its log(3K/2G) is 2.1, its Poisson's ratio 0.414; its log-anisotropy 1.56.
      lead = class%stiffness([49.5_wp, 42.3_wp, 14.9_wp])
      domain = wide('triclinic', 1.5_wp, [0.05_wp, 0.45_wp])
      call check('copper is admitted', domain%admits(copper))
      call check('at any scale', domain%admits(100.0_wp*copper))
      domain = wide('triclinic', 1.27_wp, [0.05_wp, 0.45_wp])
      call check('not below its log-anisotropy of 1.28', .not. domain%admits(copper))
      domain = wide('triclinic', 1.6_wp, [0.05_wp, 0.41_wp])
      call check('lead is beyond a Poisson''s ratio of 0.41', .not. domain%admits(lead))
      domain = wide('triclinic', 1.6_wp, [0.05_wp, 0.42_wp])
      call check('but below 0.42', domain%admits(lead))
      call check('an unstable crystal is not', &
         & .not. domain%admits(class%stiffness([100.0_wp, 120.0_wp, 50.0_wp])))
      call new_wide_domain('cubic', 'cubic', 1.5_wp, [0.05_wp, 0.45_wp], domain, error)
      copper(1, 1) = 170.0_wp
      call check('nor one of another class', .not. domain%admits(copper))
      call new_wide_domain('triclinic', 'cubic, wood', 1.5_wp, [0.05_wp, 0.45_wp], domain, error)
      call check_refused('an unknown class', error, '''wood'' is no crystal class')
      call new_wide_domain('cubic', 'hexagonal', 1.5_wp, [0.05_wp, 0.45_wp], domain, error)
      call check_refused('a class that the other does not hold', error, &
         & 'hexagonal crystals are no cubic ones')
      call new_wide_domain('triclinic', 'triclinic', 0.0_wp, [0.05_wp, 0.45_wp], domain, error)
      call check_refused('no anisotropy', error, 'log_anisotropy_max = 0.0 must be positive')
      call new_wide_domain('triclinic', 'triclinic', 1.5_wp, [0.45_wp, 0.05_wp], domain, error)
      call check_refused('an empty range', error, 'Poisson''s ratios from 0.45 to 0.05')
      call new_wide_domain('triclinic', 'triclinic', 1.5_wp, [0.05_wp, 0.5_wp], domain, error)
      call check_refused('an incompressible crystal', error, 'no range within -1 .. 0.5')
   end subroutine test_limits

   !> The scale of isotropic crystals: (3K)^(1/6) (2G)^(5/6).
   subroutine test_scale()
      type(domain_type) :: domain
      type(error_type), allocatable :: error
      type(crystal_class_type) :: class
      real(wp), parameter :: young = 200.0_wp, nu = 0.3_wp, sixth = 1.0_wp/6.0_wp
      real(wp) :: steel(6, 6), poisson, anisotropy, scale, found

      class = class_of('isotropic')
      associate (shear => 0.5_wp*young/(1.0_wp + nu), &
         & lame => young*nu/((1.0_wp + nu)*(1.0_wp - 2.0_wp*nu)))
         steel = class%stiffness([lame + 2.0_wp*shear, lame])
      end associate
      scale = (young/(1.0_wp - 2.0_wp*nu))**sixth*(young/(1.0_wp + nu))**(5.0_wp*sixth)
      call logarithmic_mean(steel, poisson, anisotropy, found)
      call check_close('the scale of steel', found, scale, 1.0e-10_wp)
      call check_close('is near its Young''s modulus', found, 187.0_wp, 0.5_wp)
      domain = wide('triclinic', 1.5_wp, [0.05_wp, 0.45_wp])
      call check('no scale is no limit', .not. domain%has_scale() &
         & .and. domain%admits(1000.0_wp*steel))
      domain = wide('triclinic', 1.5_wp, [0.05_wp, 0.45_wp], [scale/2.0_wp, 3.0_wp*scale])
      call check('a range of the scale', domain%has_scale() .and. domain%admits(steel))
      call check('its ends', domain%admits(0.501_wp*steel) .and. domain%admits(2.999_wp*steel))
      call check('beyond them', .not. domain%admits(0.499_wp*steel) &
         & .and. .not. domain%admits(3.001_wp*steel))
      call new_domain('isotropic', [10.0_wp, 10.0_wp], [2000.0_wp, 1000.0_wp], 1.0_wp, domain, &
         & error, [1.0_wp, 2.0_wp])
      call check_success('a range of the scale and bounds of the constants', error)
      call check('of which the bounds count', domain%has_scale() .and. domain%admits(steel) &
         & .and. .not. domain%admits(10.0_wp*steel))
      call new_wide_domain('triclinic', 'triclinic', 1.5_wp, [0.05_wp, 0.45_wp], domain, error, &
         & [50.0_wp, 50.0_wp])
      call check_refused('a range without a width', error, &
         & 'stiffnesses from 50.0 to 50.0 GPa are no range')
      call new_wide_domain('triclinic', 'triclinic', 1.5_wp, [0.05_wp, 0.45_wp], domain, error, &
         & [0.0_wp, 50.0_wp])
      call check_refused('one from nothing', error, 'stiffnesses from 0.0 to 50.0 GPa are no range')
      call new_wide_domain('triclinic', 'triclinic', 1.5_wp, [0.05_wp, 0.45_wp], domain, error, &
         & [50.0_wp, huge(1.0_wp)])
      call check_refused('one without an end', error, 'are no range')
   end subroutine test_scale

   !> Each of the five numbers that are spread, and of six with the scale, has one crystal in each
   !> of n equal parts of its range.
   subroutine test_hypercube()
      integer, parameter :: n = 400
      type(domain_type) :: domain
      type(error_type), allocatable :: error
      type(crystal_class_type) :: cubic
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), again(:, :), angles(:, :), &
         & at_100(:, :), angles_at_100(:, :)
      real(wp) :: unit(6, n), c(6, 6), poisson, anisotropy, ends(2), values(6), scale
      logical :: inside, taken
      integer :: i, j

      domain = wide('triclinic', 1.3_wp, [0.1_wp, 0.4_wp])
      call spread_crystals(domain, n, 5, constants, euler_deg, error)
      call check_success('crystals of a wide domain', error)
      ends = log((1.0_wp + domain%poisson)/(1.0_wp - 2.0_wp*domain%poisson))
      inside = .true.
      do i = 1, n
         c = domain%class%stiffness(constants(:, i))
         inside = inside .and. domain%admits(c)
         call logarithmic_mean(c, poisson, anisotropy)
         unit(1, &
            & i) = (log((1.0_wp + poisson)/(1.0_wp - 2.0_wp*poisson)) - ends(1))/(ends(2) - ends(1))
         unit(2, i) = anisotropy/1.3_wp
         unit(3:5, i) = [euler_deg(1, i)/360.0_wp, 1.0_wp - cos(euler_deg(2, i)*degree), &
            & euler_deg(3, i)/360.0_wp]
         if (i == 1) then
            c = kelvin_form(c)
            call symmetric_eigen(c, values, error)
            call check_close('the mean of log K is that of 100 GPa', sum(log(values))/6.0_wp, &
               & log(100.0_wp), 1.0e-12_wp)
         end if
      end do
      call check('all are admitted', inside)
      do j = 1, 5
         taken = all([(count(int(n*unit(j, :)) == i) == 1, i=0, n - 1)])
         call check('one in each part of range '//achar(48 + j), taken)
      end do
      call spread_crystals(domain, n, 5, again, angles, error)
      call check('the same of the same seed', all(abs(again - constants) <= 0.0_wp) &
         & .and. all(abs(angles - euler_deg) <= 0.0_wp))
      at_100 = constants
      angles_at_100 = euler_deg
      call spread_crystals(domain, n, 6, again, angles, error)
      call check('others of another', minval(maxval(abs(again - constants), 1)) > 0.0_wp)
      domain = wide('triclinic', 1.3_wp, [0.1_wp, 0.4_wp], [20.0_wp, 500.0_wp])
      call spread_crystals(domain, n, 5, constants, euler_deg, error)
      inside = .true.
      taken = .true.
      do i = 1, n
         c = domain%class%stiffness(constants(:, i))
         inside = inside .and. domain%admits(c)
         call logarithmic_mean(c, poisson, anisotropy, scale)
         unit(6, i) = log(scale/20.0_wp)/log(25.0_wp)
         taken = taken .and. maxval(abs(100.0_wp/scale*constants(:, i) - at_100(:, i))) &
            & < 1.0e-5_wp*maxval(at_100(:, i))
      end do
      call check('all within the scale are admitted', inside)
      call check('one in each part of the scale', &
         & all([(count(int(n*unit(6, :)) == i) == 1, i=0, n - 1)]))
      call check('they are else as without it', &
         & taken .and. all(abs(euler_deg - angles_at_100) <= 0.0_wp))
      domain = wide('cubic, hexagonal', 1.3_wp, [0.1_wp, 0.4_wp])
      call spread_crystals(domain, n, 5, constants, euler_deg, error)
      cubic = class_of('cubic')
      taken = .true.
      do i = 1, n
         c = domain%class%stiffness(constants(:, i))
         inside = maxval(abs(c - cubic%stiffness(cubic%constants_of(c)))) < 1.0e-9_wp*maxval(c)
         taken = taken .and. (inside .eqv. mod(i, 2) == 1) .and. domain%admits(c)
      end do
      call check('classes take turns', taken)
   end subroutine test_hypercube
end program test_surrogate_domain
