!> The posterior of the elastic constants given indentation moduli measured in grains of known orientation (Eqs. 12 and 13).
!>
!> The model of a measurement is m = f(M) (1 + e) + noise: f maps the indentation modulus M to the kind that was measured, e is a
!> relative error common to all grains (sd `calibration_sd`), and the noise has the grain's sd, or that sd times a common factor that
!> is inferred. The surrogate's own uncertainty is correlated between grains: its covariance is G T(c) Gᵀ with G = (df/dy) K, of the
!> rank of the harmonics. So V = D + U Uᵀ with a thin U, and |V| and V^-1 cost a matrix of the size of U's columns (Woodbury).
module constants_posterior
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr
   use abstract_error_model, only: error_model_type
   use constants_prior, only: prior_type
   use dimensionless_coordinates, only: from_logarithms, log_volume_of, to_logarithms
   use error_models, only: new_error_model
   use errors, only: error_type, exit_bad_input, raise
   use grain_surrogate, only: grain_surrogate_type, new_grain_surrogate
   use kinds, only: i8, wp
   use modulus_kinds, only: modulus_map_type, new_modulus_map
   use random, only: random_stream_type
   use sampling_target, only: target_type
   use small_matrices, only: sum_of_logs
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: posterior_type, new_posterior, likelihood_type
   public :: posterior_to_handle, posterior_from_handle

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
      type(grain_surrogate_type) :: grains
      type(modulus_map_type) :: kind
      class(error_model_type), allocatable :: errors
      !> Errors that the grains share: the surrogate's, one a harmonic, then the calibration's.
      integer, private :: n_shared = 0
      !> Measured values and the scales of their errors, GPa.
      real(wp), allocatable, private :: measured(:), scale(:)
      !> Variance of y that grains do not share, times the square of the errors' scale for an sd of one.
      real(wp), private :: scatter = 0.0_wp
      !> Sum of the logarithms of the scales.
      real(wp), private :: log_scales = 0.0_wp
   contains
      procedure :: admits
      procedure :: log_density
      procedure :: log_likelihood
      procedure :: moduli
      procedure :: draw_moduli
      procedure :: to_working
      procedure :: from_working
      procedure :: log_volume
   end type posterior_type

contains

   !> A posterior of the heap as a 64-bit integer, to cross into Python.
   function posterior_to_handle(posterior) result(handle)
      type(posterior_type), pointer, intent(in) :: posterior
      integer(i8) :: handle

      handle = transfer(c_loc(posterior), handle)
   end function posterior_to_handle

   !> The posterior that a handle stands for.
   function posterior_from_handle(handle) result(posterior)
      integer(i8), intent(in) :: handle
      type(posterior_type), pointer :: posterior
      type(c_ptr) :: address

      address = transfer(handle, address)
      call c_f_pointer(address, posterior)
   end function posterior_from_handle

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
      posterior%scale = posterior%errors%scale*sd
      posterior%log_scales = sum(log(posterior%scale))
      call new_grain_surrogate(surrogate, prior%n_constants, euler, likelihood%surrogate_uncertainty, posterior%grains)
      posterior%scatter = posterior%errors%scale**2*posterior%grains%scatter
      if (likelihood%surrogate_uncertainty) posterior%n_shared = posterior%grains%n_harmonics
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

   pure logical function admits(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      admits = self%prior%admits(x)
      if (admits .and. self%likelihood%infer_scale) then
         admits = x(self%dimension) >= self%lower(self%dimension) .and. x(self%dimension) <= self%upper(self%dimension)
      end if
   end function admits

   pure real(wp) function log_density(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      log_density = self%prior%log_density(x)
      if (.not. self%likelihood%prior_only) log_density = log_density + self%log_likelihood(x)
   end function log_density

   !> Coordinates in which ridges are nearly straight, see `to_logarithms`.
   pure subroutine to_working(self, x, w)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp), intent(out) :: w(:)

      w = x(:self%dimension)
      call to_logarithms(self%prior%class, x(:self%n_constants), w(:self%n_constants))
   end subroutine to_working

   pure subroutine from_working(self, w, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: w(:)
      real(wp), intent(out) :: x(:)

      x = w(:self%dimension)
      call from_logarithms(self%prior%class, w(:self%n_constants), x(:self%n_constants))
   end subroutine from_working

   pure real(wp) function log_volume(self, w)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: w(:)

      log_volume = log_volume_of(self%prior%class, w(:self%n_constants))
   end function log_volume

   !> Indentation moduli (GPa) that the mean surrogate gives the measured grains at a point.
   pure subroutine moduli(self, x, values)
      class(posterior_type), intent(in) :: self
      !> (dimension), (grain).
      real(wp), intent(in) :: x(:)
      real(wp), intent(out), contiguous :: values(:)
      real(wp) :: y(self%grains%n_harmonics), coordinates(self%grains%n_coordinates), scale, slope(self%n_grains)

      call self%grains%evaluate(x, y, scale, coordinates)
      call self%grains%moduli(self%grains%k, y, scale, values, slope)
   end subroutine moduli

   !> Logarithm of Eq. 13 and its extensions, normalised over the measurements.
   pure real(wp) function log_likelihood(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp) :: y(self%grains%n_harmonics), coordinates(self%grains%n_coordinates), scale, factor
      real(wp) :: model(self%n_grains), slope(self%n_grains), scales(self%n_grains)
      real(wp) :: u(self%n_grains, self%n_shared), b(self%n_shared), precision(self%n_shared, self%n_shared)

      call self%grains%evaluate(x, y, scale, coordinates)
      call self%grains%moduli(self%grains%k, y, scale, model, slope)
      call self%kind%apply(model, slope)
      factor = scale_factor(self, x)
      if (self%n_shared == 0) then
         log_likelihood = self%errors%log_density((model - self%measured)/self%scale, factor) - self%log_scales
         return
      end if
      call whiten(self, coordinates, model, slope, factor, scales, u)
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
   pure subroutine whiten(self, coordinates, model, slope, factor, scales, u)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: coordinates(:), model(:), slope(:), factor
      real(wp), intent(out) :: scales(:), u(:, :)
      real(wp) :: lower(self%grains%n_harmonics, self%grains%n_harmonics), ratio(size(scales))
      integer :: h, g

      scales = factor*self%scale
      if (self%scatter > 0.0_wp) scales = sqrt(scales**2 + self%scatter*slope**2)
      if (self%likelihood%surrogate_uncertainty) then
         call self%grains%covariance_factor(coordinates, lower)
         ratio = slope/scales
         do g = 1, self%grains%n_harmonics
            u(:, g) = 0.0_wp
            do h = g, self%grains%n_harmonics
               u(:, g) = u(:, g) + self%grains%k(:, h)*lower(h, g)
            end do
            u(:, g) = u(:, g)*ratio
         end do
      end if
      if (self%likelihood%calibration_sd > 0.0_wp) u(:, self%n_shared) = self%likelihood%calibration_sd*model/scales
   end subroutine whiten

   !> Indentation moduli (GPa) of any grains at a point, with the surrogate's error drawn given the data; `factor` is one plus the
   !> calibration error drawn likewise. Without these uncertainties the moduli are the mean surrogate's and the factor is 1.
   subroutine draw_moduli(self, x, k, stream, values, factor)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      !> Harmonics k(grain, h).
      real(wp), intent(in), contiguous :: k(:, :)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out), contiguous :: values(:)
      real(wp), intent(out) :: factor
      real(wp) :: y(self%grains%n_harmonics), coordinates(self%grains%n_coordinates), scale, value
      real(wp) :: model(self%n_grains), slope(self%n_grains), scales(self%n_grains), new_slope(size(values))
      real(wp) :: u(self%n_grains, self%n_shared), b(self%n_shared), precision(self%n_shared, self%n_shared)
      real(wp) :: z(self%n_shared), lower(self%grains%n_harmonics, self%grains%n_harmonics)
      integer :: j

      factor = 1.0_wp
      call self%grains%evaluate(x, y, scale, coordinates)
      call self%grains%moduli(k, y, scale, values, new_slope)
      if (self%n_shared == 0) return
      call self%grains%moduli(self%grains%k, y, scale, model, slope)
      call self%kind%apply(model, slope)
      call whiten(self, coordinates, model, slope, scale_factor(self, x), scales, u)
      call self%errors%integrate((self%measured - model)/scales, u, b, precision, value)
      do j = 1, self%n_shared
         call stream%normal(z(j))
      end do
      ! b + L^-ᵀ z has the covariance (L Lᵀ)^-1.
      do j = self%n_shared, 1, -1
         z(j) = (z(j) - sum(precision(j + 1:, j)*z(j + 1:)))/precision(j, j)
      end do
      b = b + z
      if (self%likelihood%calibration_sd > 0.0_wp) factor = 1.0_wp + self%likelihood%calibration_sd*b(self%n_shared)
      if (self%likelihood%surrogate_uncertainty) then
         call self%grains%covariance_factor(coordinates, lower)
         values = values + new_slope*matmul(k, matmul(lower, b(:self%grains%n_harmonics)))
      end if
   end subroutine draw_moduli
end module constants_posterior
