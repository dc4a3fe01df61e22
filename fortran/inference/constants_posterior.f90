!> The posterior of the elastic constants given indentation moduli measured in grains of known orientation (Eqs. 12 and 13).
!>
!> The model of a measurement is m = f(M) (1 + e) + noise: f maps the indentation modulus M to the kind that was measured, e is a
!> relative error common to all grains (sd `calibration_sd`), and the noise has the grain's sd, or that sd times a common factor that
!> is inferred. The surrogate's own uncertainty is correlated between grains: its covariance is G T(c) Gᵀ with G = (df/dy) K, of the
!> rank of the harmonics. So V = D + U Uᵀ with a thin U, and |V| and V^-1 cost a matrix of the size of U's columns (Woodbury).
module constants_posterior
   use abstract_basis, only: grain_model_type
   use abstract_error_model, only: error_model_type
   use constants_prior, only: prior_type
   use dimensionless_coordinates, only: from_logarithms, log_volume_of, to_logarithms
   use error_models, only: new_error_model
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use modulus_kinds, only: modulus_map_type, new_modulus_map
   use random, only: random_stream_type
   use sampling_target, only: target_type
   use small_matrices, only: sum_of_logs
   use surrogate_model, only: new_grain_model, surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: posterior_type, new_posterior, likelihood_type

   !> Bounds of the common factor on the sds where it is inferred; its logarithm is uniform between them.
   real(wp), parameter :: least_factor = 0.05_wp, greatest_factor = 50.0_wp

   !> More, in GPa, is taken for MPa.
   real(wp), parameter :: greatest_modulus = 2000.0_wp
   !> Work arrays of a thread are on its stack.
   integer, parameter :: most_grains = 5000

   type :: likelihood_type
      !> One of `modulus_kind_names`.
      character(len=:), allocatable :: modulus_kind
      !> Of the indenter (GPa) and of the sample, for the kinds that need them.
      real(wp) :: indenter_modulus = 1140.0_wp, indenter_nu = 0.07_wp, sample_nu = 0.3_wp
      !> Relative sd of an error common to all grains.
      real(wp) :: calibration_sd = 0.0_wp
      !> One of `likelihood_names`, and the degrees of freedom of Student's t.
      character(len=:), allocatable :: errors
      real(wp) :: student_dof = 4.0_wp
      !> Infer a common factor on the sds: one more parameter, its logarithm.
      logical :: infer_scale = .false.
      !> Count the surrogate's uncertainty.
      logical :: surrogate_uncertainty = .true.
      !> Leave the data out: the prior alone.
      logical :: prior_only = .false.
   end type likelihood_type

   type, extends(target_type) :: posterior_type
      type(prior_type) :: prior
      type(likelihood_type) :: likelihood
      integer :: n_grains = 0, n_constants = 0
      !> What the surrogate gives the measured grains.
      class(grain_model_type), allocatable :: grains
      type(modulus_map_type) :: kind
      class(error_model_type), allocatable :: errors
      !> Errors that the grains share: the surrogate's, then the calibration's.
      integer, private :: n_shared = 0
      !> Measured values and their sds, GPa.
      real(wp), allocatable :: measured(:), sd(:)
      !> Scales of their errors, GPa.
      real(wp), allocatable, private :: scale(:)
      !> Variance of y that grains do not share.
      real(wp), private :: scatter = 0.0_wp
      !> Sum of the logarithms of the scales.
      real(wp), private :: log_scales = 0.0_wp
   contains
      procedure :: admits
      procedure :: log_density
      procedure :: log_likelihood
      procedure :: moduli
      procedure :: draw_moduli
      procedure :: draw_measurements
      procedure :: stiffness
      procedure :: new_grains
      procedure :: to_working
      procedure :: from_working
      procedure :: log_volume
   end type posterior_type

contains

   !> The posterior for n grains.
   subroutine new_posterior(surrogate, prior, likelihood, euler, measured, sd, posterior, error)
      type(surrogate_type), intent(in) :: surrogate
      type(prior_type), intent(in) :: prior
      type(likelihood_type), intent(in) :: likelihood
      !> Bunge-Euler angles (radians), (3, n).
      real(wp), intent(in) :: euler(:, :)
      !> Measured values and their standard errors, GPa, (n).
      real(wp), intent(in) :: measured(:), sd(:)
      type(posterior_type), intent(out) :: posterior
      type(error_type), allocatable, intent(out) :: error

      call check_measurements(euler, measured, sd, likelihood%prior_only, error)
      if (allocated(error)) return
      if (.not. (likelihood%calibration_sd >= 0.0_wp .and. likelihood%calibration_sd < 1.0_wp)) then
         call raise(error, 'calibration_sd = '//to_text(likelihood%calibration_sd)//' is relative: 0 <= calibration_sd < 1', &
            & exit_bad_input)
         return
      end if
      call new_modulus_map(likelihood%modulus_kind, likelihood%indenter_modulus, likelihood%indenter_nu, likelihood%sample_nu, &
         & posterior%kind, error)
      if (.not. allocated(error)) call new_error_model(likelihood%errors, likelihood%student_dof, posterior%errors, error)
      if (allocated(error)) return
      posterior%prior = prior
      posterior%likelihood = likelihood
      posterior%n_grains = size(measured)
      posterior%n_constants = prior%n_constants
      posterior%measured = measured
      posterior%sd = sd
      posterior%scale = posterior%errors%scale*sd
      posterior%log_scales = sum(log(posterior%scale))
      call new_grain_model(surrogate, euler, likelihood%surrogate_uncertainty, posterior%grains, error)
      if (allocated(error)) return
      if (likelihood%surrogate_uncertainty) posterior%scatter = surrogate%sd_inflation**2/surrogate%beta
      posterior%n_shared = posterior%grains%n_columns
      if (likelihood%calibration_sd > 0.0_wp) posterior%n_shared = posterior%n_shared + 1
      posterior%dimension = prior%n_constants
      posterior%lower = prior%lower
      posterior%upper = prior%upper
      if (likelihood%infer_scale) then
         posterior%dimension = posterior%dimension + 1
         posterior%lower = [posterior%lower, log(least_factor)]
         posterior%upper = [posterior%upper, log(greatest_factor)]
      end if
   end subroutine new_posterior

   !> Refuse what cannot be a table of measurements.
   subroutine check_measurements(euler, measured, sd, may_be_empty, error)
      real(wp), intent(in) :: euler(:, :), measured(:), sd(:)
      logical, intent(in) :: may_be_empty
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = size(measured)
      if (size(euler, 2) /= n .or. size(sd) /= n) then
         call raise(error, 'angles, moduli and sds are needed for the same number of grains', exit_bad_input)
      else if (n == 0 .and. .not. may_be_empty) then
         call raise(error, 'there are no measurements: at least one grain is needed', exit_bad_input)
      else if (n > most_grains) then
         call raise(error, to_text(n)//' grains are more than the '//to_text(most_grains)//' that are allowed', exit_bad_input)
      else if (.not. (all(measured > 0.0_wp .and. measured < huge(1.0_wp)) .and. all(abs(euler) < huge(1.0_wp)))) then
         call raise(error, 'a measured modulus is not positive, or a value is not finite', exit_bad_input)
      else if (any(measured > greatest_modulus)) then
         call raise(error, 'a measured modulus of '//to_text(maxval(measured))//' GPa looks like MPa; allowed up to ' &
            & //to_text(greatest_modulus)//' GPa', exit_bad_input)
      else if (.not. all(sd > 0.0_wp .and. sd < huge(1.0_wp))) then
         call raise(error, 'the sd of a measurement must be positive and finite', exit_bad_input)
      end if
   end subroutine check_measurements

   !> Whether a point `x` is in the support.
   pure logical function admits(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      admits = self%prior%admits(x)
      if (admits .and. self%likelihood%infer_scale) then
         admits = x(self%dimension) >= self%lower(self%dimension) .and. x(self%dimension) <= self%upper(self%dimension)
      end if
   end function admits

   !> Logarithm of the density at a point `x` of the support, up to a constant.
   pure real(wp) function log_density(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      log_density = self%prior%log_density(x)
      if (.not. self%likelihood%prior_only) log_density = log_density + self%log_likelihood(x)
   end function log_density

   !> Stiffness of the crystal at a point, in its axes, GPa.
   pure function stiffness(self, x) result(c)
      class(posterior_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: x(:)
      real(wp) :: c(6, 6)

      c = self%prior%class%stiffness(x(:self%n_constants))
   end function stiffness

   !> Coordinates `w` of a point `x`, in which ridges are nearly straight, see `to_logarithms`.
   pure subroutine to_working(self, x, w)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: w(:)

      w = x(:self%dimension)
      call to_logarithms(self%prior%class, x(:self%n_constants), w(:self%n_constants))
   end subroutine to_working

   !> The point `x` at coordinates `w`.
   pure subroutine from_working(self, w, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: x(:)

      x = w(:self%dimension)
      call from_logarithms(self%prior%class, w(:self%n_constants), x(:self%n_constants))
   end subroutine from_working

   !> log |dx/dw| at coordinates `w`, up to a constant.
   pure real(wp) function log_volume(self, w)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: w(:)

      log_volume = log_volume_of(self%prior%class, w(:self%n_constants))
   end function log_volume

   !> Indentation moduli, `values` (GPa), that the mean surrogate gives the measured grains at a point.
   pure subroutine moduli(self, x, values)
      class(posterior_type), intent(in) :: self
      !> (dimension), (grain).
      real(wp), intent(in) :: x(:)
      real(wp), intent(out), contiguous :: values(:)
      real(wp) :: slope(self%n_grains)

      call self%grains%evaluate_moduli(self%stiffness(x), values, slope)
   end subroutine moduli

   !> Logarithm of Eq. 13 and its extensions at a point `x`, normalised over the measurements.
   pure real(wp) function log_likelihood(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp) :: c(6, 6), factor
      real(wp) :: model(self%n_grains), slope(self%n_grains), scales(self%n_grains)
      real(wp) :: u(self%n_grains, self%n_shared), b(self%n_shared), precision(self%n_shared, self%n_shared)

      c = self%stiffness(x)
      call self%grains%evaluate_moduli(c, model, slope)
      call self%kind%apply(model, slope)
      factor = scale_factor(self, x)
      if (self%n_shared == 0) then
         log_likelihood = self%errors%log_density((model - self%measured)/self%scale, factor) - self%log_scales
         return
      end if
      call whiten(self, c, model, slope, factor, scales, u)
      call self%errors%integrate((self%measured - model)/scales, u, b, precision, log_likelihood)
      log_likelihood = log_likelihood - sum_of_logs(scales)
   end function log_likelihood

   !> The factor on the sds at a point.
   pure real(wp) function scale_factor(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      scale_factor = 1.0_wp
      if (self%likelihood%infer_scale) scale_factor = exp(x(self%dimension))
   end function scale_factor

   !> Scales of the errors that grains do not share, and over them the columns of U: the surrogate's shared errors, the calibration's.
   pure subroutine whiten(self, c, model, slope, factor, scales, u)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6), model(:), slope(:), factor
      real(wp), intent(out) :: scales(:), u(:, :)
      real(wp) :: ratio(size(scales))
      integer :: g

      scales = factor*self%scale
      if (self%scatter > 0.0_wp) scales = sqrt(scales**2 + self%scatter*(self%errors%scale*slope)**2)
      if (self%grains%n_columns > 0) then
         call self%grains%evaluate_columns(c, u(:, :self%grains%n_columns))
         ratio = slope/scales
         do g = 1, self%grains%n_columns
            u(:, g) = u(:, g)*ratio
         end do
      end if
      if (self%likelihood%calibration_sd > 0.0_wp) u(:, self%n_shared) = self%likelihood%calibration_sd*model/scales
   end subroutine whiten

   !> The errors that measurements share, given the data and the constants: mean and the lower factor of the precision.
   pure subroutine infer_shared(self, x, b, precision)
      class(posterior_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: x(:)
      !> (shared error), in sds of the prior.
      real(wp), intent(out) :: b(:), precision(:, :)
      real(wp) :: c(6, 6), value
      real(wp) :: model(self%n_grains), slope(self%n_grains), scales(self%n_grains), u(self%n_grains, self%n_shared)

      if (self%n_shared == 0) return
      c = self%stiffness(x)
      call self%grains%evaluate_moduli(c, model, slope)
      call self%kind%apply(model, slope)
      call whiten(self, c, model, slope, scale_factor(self, x), scales, u)
      call self%errors%integrate((self%measured - model)/scales, u, b, precision, value)
   end subroutine infer_shared

   !> What the surrogate gives other grains, for `draw_moduli` and `draw_measurements`.
   subroutine new_grains(self, euler, grains)
      class(posterior_type), intent(in) :: self
      !> Bunge-Euler angles (radians), (3, n).
      real(wp), intent(in) :: euler(:, :)
      class(grain_model_type), allocatable, intent(out) :: grains

      allocate (grains, source=self%grains)
      call grains%set_grains(euler)
   end subroutine new_grains

   !> Indentation moduli (GPa) of any grains at a point, with the surrogate's error drawn given the data; `factor` is one plus the
   !> calibration error drawn likewise. Without these uncertainties the moduli are the mean surrogate's and the factor is 1.
   subroutine draw_moduli(self, x, grains, stream, values, factor)
      class(posterior_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: x(:)
      class(grain_model_type), intent(in) :: grains
      type(random_stream_type), intent(inout) :: stream
      !> (grain).
      real(wp), intent(out), contiguous :: values(:)
      real(wp), intent(out) :: factor
      real(wp) :: c(6, 6), slope(size(values)), columns(size(values), grains%n_columns)
      real(wp) :: b(self%n_shared), precision(self%n_shared, self%n_shared)

      c = self%stiffness(x)
      call infer_shared(self, x, b, precision)
      call grains%evaluate_moduli(c, values, slope)
      call draw_shared(self, stream, b, precision, factor)
      if (grains%n_columns == 0) return
      call grains%evaluate_columns(c, columns)
      values = values + slope*matmul(columns, b(:grains%n_columns))
   end subroutine draw_moduli

   !> Shared errors from their mean and precision, in place, and one plus the calibration error.
   subroutine draw_shared(self, stream, b, precision, factor)
      class(posterior_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(inout) :: b(:)
      real(wp), intent(in) :: precision(:, :)
      real(wp), intent(out) :: factor
      real(wp) :: z(size(b))
      integer :: j

      do j = 1, size(b)
         call stream%normal(z(j))
      end do
      ! b + L^-ᵀ z has the covariance (L Lᵀ)^-1.
      do j = size(b), 1, -1
         z(j) = (z(j) - sum(precision(j + 1:, j)*z(j + 1:)))/precision(j, j)
      end do
      b = b + z
      factor = 1.0_wp
      if (self%likelihood%calibration_sd > 0.0_wp) factor = factor + self%likelihood%calibration_sd*b(size(b))
   end subroutine draw_shared

   !> What a further measurement of any grains would give at a point, of the kind that was measured, without its own error.
   subroutine draw_measurements(self, x, grains, stream, values, shared_variance, own_variance)
      class(posterior_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in) :: x(:)
      class(grain_model_type), intent(in) :: grains
      type(random_stream_type), intent(inout) :: stream
      !> GPa, (grain), the shared errors drawn given the data.
      real(wp), intent(out), contiguous :: values(:)
      !> GPa², (grain): of the shared errors given the data and the constants, and of the surrogate's that grains do not share.
      real(wp), intent(out), contiguous :: shared_variance(:), own_variance(:)
      real(wp) :: c(6, 6), slope(size(values)), influence(size(values), grains%n_columns)
      real(wp) :: b(self%n_shared), precision(self%n_shared, self%n_shared), columns(size(values), self%n_shared), factor
      real(wp) :: mean(size(values)), mean_slope(size(values))
      integer :: i, j

      c = self%stiffness(x)
      call infer_shared(self, x, b, precision)
      call grains%evaluate_moduli(c, values, slope)
      mean = values
      mean_slope = slope
      call self%kind%apply(mean, mean_slope)
      if (self%likelihood%calibration_sd > 0.0_wp) columns(:, self%n_shared) = self%likelihood%calibration_sd*mean
      call draw_shared(self, stream, b, precision, factor)
      if (grains%n_columns > 0) then
         call grains%evaluate_columns(c, influence)
         values = values + slope*matmul(influence, b(:grains%n_columns))
         do i = 1, grains%n_columns
            columns(:, i) = mean_slope*influence(:, i)
         end do
      end if
      call self%kind%apply(values, slope)
      values = factor*values
      shared_variance = 0.0_wp
      do j = 1, self%n_shared
         ! The next entry of L^-1 times the columns.
         do i = 1, j - 1
            columns(:, j) = columns(:, j) - precision(j, i)*columns(:, i)
         end do
         columns(:, j) = columns(:, j)/precision(j, j)
         shared_variance = shared_variance + columns(:, j)**2
      end do
      own_variance = self%scatter*mean_slope**2
   end subroutine draw_measurements
end module constants_posterior
