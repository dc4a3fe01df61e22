!> A surrogate: the posterior of the coefficients of a basis, and what it predicts.
!>
!> All algebra is in y (see `basis`). The predicted modulus is that of the mean of y; its sd is by the delta method, |dM/dy| sd(y), and
!> is that of a simulated modulus: it includes 1/beta.
module surrogate_model
   use abstract_basis, only: basis_type, grain_model_type
   use bases, only: new_basis
   use crystal_class, only: crystal_class_type, general_class
   use crystal_elasticity, only: check_stiffness, is_stable
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, multiply, multiply_by_factor
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: domain_type, new_wide_domain
   use text, only: to_text
   implicit none
   private
   public :: surrogate_type, simulations_type, new_theory_surrogate, predict_crystals, predict, new_grain_model

   !> What a surrogate was trained on.
   type :: simulations_type
      !> Constants of the domain's class (n_constants, n) and moduli (n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
   end type simulations_type

   type :: surrogate_type
      class(basis_type), allocatable :: basis
      !> Posterior mean (n_terms) and covariance (n_terms, n_terms) of the coefficients, in units of y.
      real(wp), allocatable :: coefficients(:), covariance(:, :)
      !> Precision of the prior (of a term of degree 1) and of the noise, in units of y.
      real(wp) :: alpha = 1.0_wp, beta = 1.0_wp
      !> Of the prior's sd of a coefficient: its ratio from degree to degree.
      real(wp) :: decay_rate = 1.0_wp
      !> At the last depth of the simulations, on a half-space, um; 0 where the specimen has no length of its own.
      real(wp) :: contact_radius = 0.0_wp
      type(simulations_type) :: simulations
      !> Where it comes from: a JSON object.
      character(len=:), allocatable :: provenance
      !> Of the file that it was read from or written to, '' if there is none.
      character(len=16) :: checksum = ''
   end type surrogate_type

contains

   !> The exact theory of the half-space, which needs no simulation.
   subroutine new_theory_surrogate(surrogate, error)
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(domain_type) :: domain
      type(surrogate_settings_type) :: settings

      settings%model = 'halfspace'
      call new_wide_domain(general_class, general_class, huge(1.0_wp), [-0.999_wp, 0.499_wp], domain, error)
      if (.not. allocated(error)) call new_basis(domain, settings, surrogate%basis, error)
      allocate (surrogate%coefficients(0), surrogate%covariance(0, 0), surrogate%simulations%constants(21, 0), &
         & surrogate%simulations%euler_deg(3, 0), surrogate%simulations%modulus(0))
      surrogate%beta = huge(1.0_wp)
      surrogate%provenance = '{"model": "exact theory of the half-space"}'
   end subroutine new_theory_surrogate

   !> `predict` for many crystals. Refused are those for which it has no meaning: unstable, or without the symmetry of the surrogate's
   !> class.
   subroutine predict_crystals(surrogate, stiffness, euler, threads, modulus, sd, error)
      type(surrogate_type), intent(in) :: surrogate
      !> In crystal axes, GPa, (6, 6, n); Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler(:, :)
      integer, intent(in) :: threads
      !> GPa, (n).
      real(wp), intent(inout) :: modulus(:), sd(:)
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: at_once = 64
      type(error_type), allocatable :: singular
      real(wp), allocatable :: factor(:, :)
      integer :: first, last, i

      first = huge(first)
      !$omp parallel do num_threads(threads) schedule(static) reduction(min: first)
      do i = 1, size(stiffness, 3)
         associate (c => stiffness(:, :, i))
            if (.not. (is_stable(c) .and. surrogate%basis%domain%is_of_class(c))) first = min(first, i)
         end associate
      end do
      !$omp end parallel do
      if (first < huge(first)) then
         call check_stiffness(stiffness(:, :, first), error)
         if (.not. allocated(error)) call raise(error, 'the stiffness is not that of a '//surrogate%basis%domain%class%name &
            & //' crystal in its axes, for which the surrogate is', exit_bad_input)
         error%message = 'crystal '//to_text(first)//': '//error%message
         return
      end if
      factor = surrogate%covariance
      call cholesky_factor(factor, singular)
      if (allocated(singular)) deallocate (factor)
      !$omp parallel do num_threads(threads) schedule(static) private(last)
      do i = 1, size(stiffness, 3), at_once
         last = min(i + at_once - 1, size(stiffness, 3))
         call predict_side_by_side(surrogate, stiffness(:, :, i:last), euler(:, i:last), modulus(i:last), sd(i:last), factor)
      end do
      !$omp end parallel do
   end subroutine predict_crystals

   !> `predict` for some crystals: the variances by one product of matrices.
   subroutine predict_side_by_side(surrogate, c, euler, modulus, sd, factor)
      type(surrogate_type), intent(in) :: surrogate
      real(wp), intent(in) :: c(:, :, :), euler(:, :)
      real(wp), intent(out) :: modulus(:), sd(:)
      !> Of the covariance, lower, if it has one.
      real(wp), intent(in), allocatable :: factor(:, :)
      real(wp), dimension(surrogate%basis%n_terms, size(modulus)) :: terms, product
      real(wp), dimension(size(modulus)) :: scale, spread, variance
      integer :: i

      call surrogate%basis%evaluate_many(c, euler, terms, scale, spread)
      do i = 1, size(modulus)
         modulus(i) = surrogate%basis%to_modulus(dot_product(surrogate%coefficients, terms(:, i)), scale(i), spread(i))
      end do
      if (allocated(factor)) then
         call multiply_by_factor(factor, terms)
         variance = sum(terms**2, 1)
      else
         call multiply(surrogate%covariance, terms, product)
         variance = max(0.0_wp, sum(terms*product, 1))
      end if
      sd = scale
      if (surrogate%basis%logarithmic) sd = spread*modulus
      if (surrogate%beta < huge(1.0_wp)) variance = variance + 1.0_wp/surrogate%beta
      sd = sd*sqrt(variance)
   end subroutine predict_side_by_side

   !> Mean and sd (GPa) of the simulated indentation modulus of one crystal at one orientation.
   subroutine predict(surrogate, c, euler, modulus, sd)
      type(surrogate_type), intent(in) :: surrogate
      !> Stiffness of a Born-stable crystal in its axes, GPa; Bunge-Euler angles, radians.
      real(wp), intent(in) :: c(6, 6), euler(3)
      real(wp), intent(out) :: modulus, sd
      real(wp), allocatable :: factor(:, :)
      real(wp) :: moduli(1), sds(1)

      call predict_side_by_side(surrogate, reshape(c, [6, 6, 1]), reshape(euler, [3, 1]), moduli, sds, factor)
      modulus = moduli(1)
      sd = sds(1)
   end subroutine predict

   !> The moduli of certain grains as a function of the crystal, and their covariance if that counts.
   subroutine new_grain_model(surrogate, class, euler, with_covariance, model, error)
      type(surrogate_type), intent(in) :: surrogate
      !> Of the crystals that will be asked for.
      type(crystal_class_type), intent(in) :: class
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      !> Whether the covariance counts.
      logical, intent(in) :: with_covariance
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: covariance(:, :)

      allocate (covariance(0, 0))
      if (with_covariance) covariance = surrogate%covariance
      call surrogate%basis%new_grain_model(class, surrogate%coefficients, covariance, model, error)
      if (.not. allocated(error)) call model%set_grains(euler, error)
   end subroutine new_grain_model
end module surrogate_model
