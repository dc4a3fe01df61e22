!> The domain, the ranges of its coordinates, the prior from the theory, and the fit of a surrogate.
program test_fit
   use crystal_elasticity, only: anisotropy_index, is_stable
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use surrogate_basis, only: basis_type, coordinates_box, coordinates_dimensionless, new_basis, truncation_tensor, &
      & truncation_total
   use surrogate_fit, only: coordinate_ranges, domain_type, fit_options_type, fit_surrogate, learn_inflation, &
      & number_crystals, prior_theory, prior_weights, prior_zero, spread_crystals
   use surrogate_model, only: is_outside, predict, surrogate_type
   use testing, only: check, check_close, check_refused, check_success, class_of, finish, stiffness_of
   implicit none

   call test_spread()
   call test_prior()
   call test_fits(cubic(), fit_options_type(coordinates_dimensionless, truncation_total, 3, 6, prior_zero), 80, 0.5_wp)
   call test_fits(cubic(), fit_options_type(coordinates_dimensionless, truncation_total, 2, 4, prior_theory), 12, 1.5_wp)
   call test_fits(cubic(), fit_options_type(coordinates_box, truncation_tensor, 2, 4, prior_zero), 200, 6.0_wp)
   call test_fits(hexagonal(), fit_options_type(coordinates_dimensionless, truncation_total, 3, 4, prior_theory), 30, 2.0_wp)
   call finish()

contains

   function cubic() result(domain)
      type(domain_type) :: domain

      domain = domain_type(class_of('cubic'), [50.0_wp, 40.0_wp, 15.0_wp], [250.0_wp, 150.0_wp, 120.0_wp], 7.2_wp)
   end function cubic

   function hexagonal() result(domain)
      type(domain_type) :: domain

      domain = domain_type(class_of('hexagonal'), [80.0_wp, 40.0_wp, 30.0_wp, 70.0_wp, 40.0_wp], &
         & [240.0_wp, 120.0_wp, 90.0_wp, 210.0_wp, 90.0_wp], 10.0_wp)
   end function hexagonal

   subroutine test_spread()
      type(domain_type) :: domain
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler(:, :), lower(:), upper(:)
      real(wp) :: mean_cosine
      logical :: inside
      integer :: i

      domain = cubic()
      call spread_crystals(domain, 4000, constants, euler, error)
      call check_success('4000 crystals of the cubic domain', error)
      inside = .true.
      do i = 1, 4000
         inside = inside .and. is_stable(stiffness_of('cubic', constants(:, i))) &
            & .and. anisotropy_index(stiffness_of('cubic', constants(:, i))) <= 7.2_wp &
            & .and. all(constants(:, i) >= domain%lower) .and. all(constants(:, i) <= domain%upper)
      end do
      call check('all are admissible', inside)
      ! Uniform on the hemisphere: cos Phi is uniform on 0 .. 1, its mean 1/2 with sd 1/sqrt(12 n) for independent points.
      mean_cosine = sum(cos(euler(2, :)))/4000
      call check_close('directions are uniform', mean_cosine, 0.5_wp, 3.0_wp/sqrt(12.0_wp*4000))
      call coordinate_ranges(domain, coordinates_dimensionless, lower, upper, error)
      call check('the ranges hold the Zener ratios that the cap allows', upper(2) > 2.0_wp .and. upper(2) < 2.3_wp)
      domain%lower(1) = 50.0_wp
      domain%upper(1) = 51.0_wp
      domain%lower(2) = 149.0_wp
      call spread_crystals(domain, 10, constants, euler, error)
      call check_refused('a domain without stable crystals', error, 'no stable crystal')
      call check('equal crystals have one number', all(number_crystals(reshape([1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp, 1.0_wp, &
         & 2.0_wp], [2, 3])) == [1, 2, 1]))
      call check_close('errors as large as their sds', learn_inflation(spread(1.0_wp, 1, 9)), 1.0_wp, 1.0e-12_wp)
      call check_close('few crystals move the factor a little', learn_inflation(spread(3.0_wp, 1, 5)), sqrt(2.6_wp), 1.0e-12_wp)
      call check_close('many decide it', learn_inflation(spread(0.5_wp, 1, 100000)), 0.5_wp, 1.0e-3_wp)
      call check_close('the factor is bounded', learn_inflation(spread(99.0_wp, 1, 9)), 3.0_wp, 1.0e-12_wp)
   end subroutine test_spread

   subroutine test_prior()
      type(basis_type) :: basis
      type(error_type), allocatable :: error
      real(wp), allocatable :: weights(:)

      call new_basis(class_of('cubic'), coordinates_dimensionless, truncation_total, 2, 4, [-1.0_wp, -1.0_wp], [1.0_wp, 1.0_wp], &
         & basis, error)
      weights = prior_weights(basis, prior_theory)
      call check('the constant term is almost free', weights(1) < 0.01_wp*minval(weights(2:)))
      call check_close('eightfold per degree, l = 4 as one degree', maxval(weights), 512.0_wp, 1.0e-12_wp)
      call check('Eq. 6', all(abs(prior_weights(basis, prior_zero) - 1.0_wp) <= 0.0_wp))
   end subroutine test_prior

   !> Fit n crystals that the theory simulates, and meet others within `limit` GPa on the average.
   subroutine test_fits(domain, options, n, limit)
      type(domain_type), intent(in) :: domain
      type(fit_options_type), intent(in) :: options
      integer, intent(in) :: n
      real(wp), intent(in) :: limit
      integer, parameter :: unseen = 200
      type(surrogate_type) :: surrogate
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      real(wp), allocatable :: constants(:, :), euler(:, :), modulus(:), difference(:)
      real(wp) :: mean, sd
      integer :: i

      call spread_crystals(domain, n + unseen, constants, euler, error)
      allocate (modulus(n + unseen), difference(unseen))
      do i = 1, n + unseen
         call halfspace_modulus(domain%class%stiffness(constants(:, i)), euler(:, i), theory, error)
         modulus(i) = theory%modulus
      end do
      call fit_surrogate(domain, options, constants(:, :n), euler(:, :n), modulus(:n), surrogate, error)
      call check_success('a fit', error)
      do i = 1, unseen
         call predict(surrogate, constants(:, n + i), euler(:, n + i), mean, sd)
         difference(i) = abs(mean - modulus(n + i))
      end do
      call check_close('mean absolute error on unseen crystals', sum(difference)/unseen, 0.0_wp, limit)
      call check('no crystal of the domain is outside', .not. any([(is_outside(surrogate, constants(:, i)), i=1, unseen)]))
      call fit_surrogate(domain, options, constants(:, :1), euler(:, :1), modulus(:1), surrogate, error)
      call check_refused('one simulation', error, 'at least 2')
   end subroutine test_fits
end program test_fit
