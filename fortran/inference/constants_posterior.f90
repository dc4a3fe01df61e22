!> The posterior of the elastic constants given measurements in grains of known orientation (Eqs. 12
!> and 13).
!>
!> A measurement is m = f g(M') + noise. M' is the indentation modulus with the contrast of the
!> laboratory, g maps it to the kind that was measured, and f is the factor of the laboratory, see
!> `laboratory`. The noise has the grain's sd, or that sd times an inferred common factor, and the
!> scatter of the grains. The surrogate's own
!> uncertainty is correlated between grains: its covariance is G T(c) Gᵀ with G = (df/dy) K, of the
!> rank of the harmonics. So V = D + U Uᵀ with a thin U, and Woodbury's formula reduces |V| and V^-1
!> to a matrix of the size of U's columns.
module constants_posterior
   use abstract_basis, only: grain_model_type
   use constants_prior, only: prior_type
   use error_models, only: error_model_type, new_error_model
   use errors, only: error_type, refuse
   use kinds, only: degree, wp
   use laboratory, only: change_contrast, laboratory_type, new_laboratory
   use measured_grains, only: all_tilts, measured_type, n_tilts, spread_orientations, tilt_moments
   use nuisances, only: draw_nuisances, log_prior_of, new_nuisances, nuisance_type
   use observables, only: new_observable, observable_type, path_type
   use random, only: random_stream_type
   use abstract_sampler, only: outside, target_type
   use settings_schema, only: measurements_settings_type
   use small_matrices, only: factor_columns, sum_of_logs
   use surrogate_model, only: new_grain_model, surrogate_type
   use text, only: to_text
   use unknown_orientations, only: unknown_orientations_type
   use wave_grains, only: add_waves, wave_grains_type
   implicit none
   private
   public :: posterior_type, new_posterior

   !> Least number of directions over which the mean of the logarithm of a modulus is taken. An
   !> error of the mean is one of the factor, so few are enough.
   integer, parameter :: mean_directions = 12

   type, extends(target_type) :: posterior_type
      type(prior_type) :: prior
      type(measurements_settings_type) :: settings
      !> Parameters beside the constants, whose logarithms follow these. The contrast is the first,
      !> a common factor on the sds the last.
      type(nuisance_type), allocatable :: nuisances(:)
      logical :: infers_contrast = .false., infers_scatter = .false., infers_scale = .false.
      type(laboratory_type) :: laboratory
      !> Whether the data are left out.
      logical :: prior_only = .false.
      integer :: n_grains = 0, n_constants = 0, n_groups = 1
      !> Number of the measurements that are moduli. They precede those that are speeds.
      integer :: n_moduli = 0
      !> Directions in which each grain is evaluated: 1, or `n_tilts`.
      integer, private :: n_directions = 1
      !> Model of the measured grains. Its rows are the grains as they are, then the same grains
      !> with each further tilt. If the orientations are unknown, its rows are all directions. The
      !> last rows are the directions of `mean_weights`.
      class(grain_model_type), allocatable :: grains
      !> The same model with the theory read more coarsely, allocated if that is accurate enough for
      !> proposals.
      class(grain_model_type), allocatable :: rough
      type(observable_type) :: observable
      class(error_model_type), allocatable :: errors
      !> Number of errors that grains share, in this order: those of the surrogate, one for the
      !> calibration of each group if these have an sd, the relative ones that the user stated, and
      !> two tilts of the sample. The first two kinds are `n_calibrated`.
      integer :: n_shared = 0, n_calibrated = 0
      type(measured_type) :: data
      !> Effect of one sd of a calibration or stated error, relative to the measurement, (grain,
      !> error).
      real(wp), allocatable, private :: relative(:, :)
      !> Allocated if the orientations of the measured grains are unknown.
      type(unknown_orientations_type), allocatable :: unknown
      !> Weights of the directions in the mean of ln M, (direction); none without a contrast.
      real(wp), allocatable :: mean_weights(:)
      !> Whether a row before these is a modulus, (row).
      logical, allocatable, private :: are_moduli(:)
      !> Bunge-Euler angles of the rows of `grains`, radians.
      real(wp), allocatable :: euler(:, :)
      !> Scales of the errors of the measurements, GPa or m/s, (grain), and the sum of their
      !> logarithms.
      real(wp), allocatable :: scale(:)
      real(wp) :: log_scales = 0.0_wp
      !> Variance of the surrogate's y that grains do not share.
      real(wp) :: scatter = 0.0_wp
   contains
      procedure :: evaluate, evaluate_working, to_working, from_working, coarsen, draw_start
      procedure :: set_field_degree, moduli_at, predict_measurements, evaluate_grains, stiffness, &
         & new_grains
      procedure :: has_own_variance, scale_factor, grain_scatter, log_contrast, set_contrast, &
         & log_factor, mean_factors
   end type posterior_type

contains

   !> Set up the posterior of the constants given measurements.
   subroutine new_posterior(surrogate, prior, settings, with_covariance, measured, posterior, &
      & error, known)
      type(surrogate_type), intent(in) :: surrogate
      type(prior_type), intent(in) :: prior
      type(measurements_settings_type), intent(in) :: settings
      !> Whether the surrogate's uncertainty counts.
      logical, intent(in) :: with_covariance
      type(measured_type), intent(in) :: measured
      type(posterior_type), intent(out) :: posterior
      type(error_type), allocatable, intent(out) :: error
      !> A posterior of this surrogate, with or without covariance as here: the theory is read from
      !> harmonics of the same degree, and the model of the grains is used again if the class is the
      !> same.
      type(posterior_type), intent(in), optional :: known
      !> A variance of y that is this small counts as zero.
      real(wp), parameter :: negligible = 1.0e-20_wp
      !> Work arrays of this length fit on the stack of a thread.
      integer, parameter :: most_grains = 20000
      type(path_type), allocatable :: paths(:)
      real(wp), allocatable :: directions(:, :)
      integer :: n_calibrations, g, n_rows

      call new_observable(settings%modulus_kind, settings, posterior%observable, error)
      if (.not. allocated(error)) call new_error_model(settings, posterior%errors, error)
      if (size(measured%modulus) > most_grains) then
         call refuse(error, to_text(size(measured%modulus))//' grains are more than the ' &
            & //to_text(most_grains)//' that are allowed')
      end if
      if (allocated(error)) return
      posterior%prior = prior
      posterior%settings = settings
      posterior%n_grains = size(measured%modulus)
      posterior%n_constants = prior%n_constants
      posterior%data = measured
      posterior%n_groups = max(1, maxval(measured%group))
      posterior%n_moduli = count(.not. measured%paths%is_speed())
      posterior%laboratory = new_laboratory(settings, posterior%n_groups, &
         & maxval([0, measured%group(:posterior%n_moduli)]))
      if (allocated(measured%references)) then
         call posterior%laboratory%update(settings, measured%references, error)
         if (allocated(error)) return
      end if
      posterior%nuisances = new_nuisances(settings, posterior%laboratory%contrast)
      posterior%infers_contrast = any(posterior%nuisances%name == 'contrast')
      posterior%infers_scatter = any(posterior%nuisances%name == 'scatter')
      posterior%infers_scale = any(posterior%nuisances%name == 'sd_factor')
      posterior%scale = posterior%errors%scale*measured%sd
      posterior%log_scales = sum(log(posterior%scale))
      posterior%n_directions = merge(n_tilts, 1, settings%misalignment_sd_deg > 0.0_wp &
         & .or. any(measured%tilt_sd > 0.0_wp))
      posterior%euler = measured%euler
      if (posterior%n_directions > 1) posterior%euler = all_tilts(measured%euler, measured%tilt_sd)
      n_rows = size(posterior%euler, 2)
      allocate (posterior%mean_weights(0))
      paths = [(measured%paths(modulo(g - 1, size(measured%paths)) + 1), g=1, n_rows)]
      posterior%are_moduli = .not. paths%is_speed()
      if (posterior%laboratory%has_contrast()) then
         call spread_orientations(prior%class, mean_directions, directions, posterior%mean_weights)
         posterior%euler = reshape([posterior%euler, directions], [3, n_rows + size(directions, 2)])
         paths = [paths, spread(path_type(), 1, size(directions, 2))]
      end if
      call set_model()
      if (allocated(error)) return
      if (with_covariance .and. negligible*surrogate%beta <= 1.0_wp) then
         posterior%scatter = 1.0_wp/surrogate%beta
      end if
      n_calibrations = merge(posterior%n_groups, 0, any(posterior%laboratory%sd > 0.0_wp))
      posterior%n_calibrated = posterior%grains%n_columns + n_calibrations
      posterior%n_shared = posterior%n_calibrated + size(measured%shared, 2) + merge(2, 0, &
         & settings%misalignment_sd_deg > 0.0_wp)
      posterior%dimension = prior%n_constants + size(posterior%nuisances)
      allocate (posterior%relative(posterior%n_grains, n_calibrations + size(measured%shared, 2)))
      do g = 1, n_calibrations
         posterior%relative(:, g) = merge(posterior%laboratory%sd(g), 0.0_wp, &
            & measured%group == g)
      end do
      posterior%relative(:, n_calibrations + 1:) = measured%shared
      if (.not. allocated(measured%probability)) return
      if (posterior%scatter > 0.0_wp) then
         call refuse(error, &
            & 'orientations = ''unknown'' needs &sampler surrogate_variance = ''none''')
      else
         posterior%unknown = unknown_orientations_type(measured%probability, measured%modulus, &
            & measured%sd, posterior%observable)
         call posterior%unknown%set_nodes(posterior%relative, error)
      end if

   contains

      !> Set the model of the grains.
      subroutine set_model()
         integer, allocatable :: degree

         if (present(known)) then
            degree = known%grains%field_degree
            if (known%prior%class%name == prior%class%name) then
               call use_grains_of(known)
               return
            end if
         end if
         call new_grain_model(surrogate, prior%class, posterior%euler, with_covariance, &
            & posterior%grains, error, degree)
         if (.not. allocated(error) .and. posterior%n_moduli < posterior%n_grains) then
            call add_waves(paths, measured%density, posterior%euler, posterior%grains, error)
         end if
      end subroutine set_model

      !> Use the model of another posterior, if need be for other grains.
      subroutine use_grains_of(other)
         type(posterior_type), intent(in) :: other

         if (other%n_grains == posterior%n_grains &
            & .and. size(other%euler) == size(posterior%euler)) then
            if (all(abs(other%euler - posterior%euler) <= 0.0_wp)) posterior%grains = other%grains
         end if
         if (.not. allocated(posterior%grains)) then
            call other%new_grains(posterior%euler, paths, posterior%grains, error)
         end if
      end subroutine use_grains_of
   end subroutine new_posterior

   !> Change the degree of the surface harmonics from which the theory is read.
   subroutine set_field_degree(self, degree, error)
      class(posterior_type), intent(inout) :: self
      !> An even number.
      integer, intent(in) :: degree
      type(error_type), allocatable, intent(out) :: error

      self%grains%field_degree = degree
      call self%grains%set_grains(self%euler, error)
   end subroutine set_field_degree

   !> Use the coarser model, if there is one, and read the theory of every crystal from a field.
   subroutine coarsen(self)
      class(posterior_type), intent(inout) :: self

      if (allocated(self%rough)) call move_alloc(self%rough, self%grains)
      call self%grains%use_field_up_to(huge(1.0_wp))
   end subroutine coarsen

   pure subroutine evaluate(self, points, log_density)
      class(posterior_type), intent(in) :: self
      !> (dimension, point).
      real(wp), intent(in) :: points(:, :)
      real(wp), intent(out) :: log_density(:)
      real(wp) :: c(6, 6), of_nuisances
      integer :: i

      log_density = outside
      do i = 1, size(log_density)
         c = self%stiffness(points(:, i))
         of_nuisances = log_prior_of(self%nuisances, points(self%n_constants + 1:, i), outside)
         if (.not. (self%prior%admits(points(:self%n_constants, i), c) &
            & .and. of_nuisances > outside)) then
            cycle
         end if
         log_density(i) = self%prior%log_density_of_constants(c) + of_nuisances
         if (self%prior_only) cycle
         log_density(i) = log_density(i) + likelihood_of_crystal(self, points(:, i), c, &
            & reshape(self%moduli_at(points(:, i:i)), [size(self%euler, 2)]))
      end do
   end subroutine evaluate

   pure recursive subroutine evaluate_working(self, w, log_density)
      class(posterior_type), intent(in) :: self
      !> (dimension, point), (point).
      real(wp), intent(in), contiguous :: w(:, :)
      real(wp), intent(out) :: log_density(:)
      !> Number of points whose moduli are computed together.
      integer, parameter :: block = 64
      real(wp) :: c(6, 6, block), of_nuisances
      !> Allocated, because many grains would overflow the stack of a thread.
      real(wp), allocatable :: moduli(:, :)
      integer :: in_support(block), n, i, k

      if (size(w, 2) > block) then
         do i = 1, size(w, 2), block
            k = min(i + block - 1, size(w, 2))
            call self%evaluate_working(w(:, i:k), log_density(i:k))
         end do
         return
      end if
      log_density = outside
      k = self%n_constants
      n = 0
      do i = 1, size(w, 2)
         associate (crystal => c(:, :, n + 1), logarithms => self%prior%logarithms)
            crystal = logarithms%from_logarithms(w(:k, i))
            of_nuisances = log_prior_of(self%nuisances, w(k + 1:, i), outside)
            if (.not. (self%prior%admits(self%prior%class%constants_of(crystal), crystal, &
               & norm2(w(3:k, i))) .and. of_nuisances > outside)) then
               cycle
            end if
            ! Nuisances need no Jacobian: their logarithms are coordinates of both.
            log_density(i) = self%prior%log_density(crystal, w(:k, i)) + of_nuisances
            if (.not. self%prior%in_logarithms) then
               log_density(i) = log_density(i) + logarithms%log_volume(w(:k, i))
            end if
         end associate
         n = n + 1
         in_support(n) = i
      end do
      if (.not. self%prior_only) then
         allocate (moduli(size(self%euler, 2), n))
         call self%grains%evaluate_crystals(c(:, :, :n), moduli)
         do k = 1, n
            i = in_support(k)
            log_density(i) = log_density(i) &
               & + likelihood_of_crystal(self, w(:, i), c(:, :, k), moduli(:, k))
         end do
      end if
      where (.not. log_density > outside) log_density = outside
   end subroutine evaluate_working

   pure subroutine from_working(self, points, log_density)
      class(posterior_type), intent(in) :: self
      !> (dimension, point), (point).
      real(wp), intent(inout) :: points(:, :), log_density(:)
      integer :: i

      do i = 1, size(points, 2)
         associate (prior => self%prior, w => points(:self%n_constants, i))
            log_density(i) = log_density(i) - prior%logarithms%log_volume(w)
            w = prior%class%constants_of(prior%logarithms%from_logarithms(w))
         end associate
      end do
   end subroutine from_working

   subroutine draw_start(self, stream, x)
      class(posterior_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> (dimension).
      real(wp), intent(out) :: x(:)

      call self%prior%draw_start(stream, x(:self%n_constants))
      call draw_nuisances(self%nuisances, stream, x(self%n_constants + 1:))
   end subroutine draw_start

   !> Stiffness of the crystal at a point `x`, in crystal axes, GPa.
   pure function stiffness(self, x) result(c)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp) :: c(6, 6)

      c = self%prior%class%stiffness(x(:self%n_constants))
   end function stiffness

   !> The working coordinates: log K of the crystal replaces its constants.
   pure subroutine to_working(self, x, w)
      class(posterior_type), intent(in) :: self
      !> (dimension, point).
      real(wp), intent(in) :: x(:, :)
      real(wp), intent(out) :: w(:, :)
      integer :: i

      w = x(:self%dimension, :)
      do i = 1, size(w, 2)
         w(:self%n_constants, i) = self%prior%logarithms%to_logarithms(self%stiffness(x(:, i)))
      end do
   end subroutine to_working

   !> Logarithm of Eq. 13 and its extensions at a point, normalised over the measurements.
   pure real(wp) function likelihood_of_crystal(self, x, c, moduli) result(log_likelihood)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:), c(6, 6)
      !> The grain model's rows for this crystal, GPa.
      real(wp), intent(in), contiguous :: moduli(:)
      real(wp), dimension(self%n_grains) :: model, scales
      real(wp), allocatable :: u(:, :), reduced(:, :), shared(:), precision(:, :), rows(:)

      if (allocated(self%unknown)) then
         rows = moduli
         call self%set_contrast(x, self%are_moduli, rows)
         log_likelihood = self%unknown%log_likelihood(rows(:size(self%unknown%probability)), &
            & self%grain_scatter(x), exp(self%log_factor(x, 1)))
      else if (self%n_shared == 0 .and. .not. (self%has_own_variance() &
         & .or. self%laboratory%changes_moduli())) then
         model = moduli
         call self%observable%to_measured(model(:self%n_moduli))
         log_likelihood = self%errors%log_density((self%data%modulus - model)/self%scale, &
            & scale_factor(self, x)) - self%log_scales
      else
         call self%predict_measurements(x, c, model, scales, u, moduli)
         call factor_columns(u, reduced)
         call self%errors%integrate((self%data%modulus - model)/scales, reduced, shared, &
            & precision, log_likelihood)
         log_likelihood = log_likelihood - sum_of_logs(scales)
      end if
   end function likelihood_of_crystal

   !> Whether errors that grains do not share have further sources beside the measurement: the
   !> surrogate, the orientation, or differences between grains.
   pure logical function has_own_variance(self)
      class(posterior_type), intent(in) :: self

      has_own_variance = self%scatter > 0.0_wp .or. self%n_directions > 1 &
         & .or. self%settings%scatter_sd > 0.0_wp .or. allocated(self%unknown)
   end function has_own_variance

   !> ln(1+k) at a point.
   pure real(wp) function log_contrast(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      log_contrast = self%laboratory%contrast(1)
      if (self%infers_contrast) log_contrast = x(self%n_constants + 1)
   end function log_contrast

   !> Mean of ln f at a point.
   pure real(wp) function log_factor(self, x, group)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      integer, intent(in) :: group

      log_factor = self%laboratory%log_factor(group, self%log_contrast(x))
   end function log_factor

   !> The mean factor of each measurement at a point, (grain).
   pure function mean_factors(self, x) result(factors)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      real(wp) :: factors(self%n_grains)

      factors = exp(self%laboratory%log_factor(self%data%group, self%log_contrast(x)))
   end function mean_factors

   !> Give moduli of the crystal the contrast at a point.
   pure subroutine set_contrast(self, x, are_moduli, values, slopes)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)
      !> See `change_contrast`.
      logical, intent(in) :: are_moduli(:)
      real(wp), intent(inout) :: values(:)
      real(wp), intent(inout), optional :: slopes(:)

      if (size(self%mean_weights) == 0) return
      call change_contrast(self%log_contrast(x), self%mean_weights, are_moduli, values, slopes)
   end subroutine set_contrast

   !> Relative sd of differences between grains at a point.
   pure real(wp) function grain_scatter(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      grain_scatter = self%settings%scatter_sd
      if (self%infers_scatter) then
         grain_scatter = exp(x(self%n_constants + merge(2, 1, self%infers_contrast)))
      end if
   end function grain_scatter

   !> Factor on the sds at a point, 1 unless it is inferred.
   pure real(wp) function scale_factor(self, x)
      class(posterior_type), intent(in) :: self
      real(wp), intent(in) :: x(:)

      scale_factor = 1.0_wp
      if (self%infers_scale) scale_factor = exp(x(self%dimension))
   end function scale_factor

   !> Mean modulus of each measured grain with the contrast, its derivative with respect to y, and
   !> the variance that the grain does not share: the surrogate's, its orientation's, and that of
   !> differences between grains. For unknown orientations the moments are those over all
   !> directions.
   pure subroutine evaluate_grains(self, x, c, modulus, slope, own_variance, tilt_slopes, moduli)
      class(posterior_type), intent(in) :: self
      !> Point, (dimension), and its stiffness, GPa.
      real(wp), intent(in) :: x(:), c(6, 6)
      !> GPa, GPa and GPa², (grain).
      real(wp), intent(out), contiguous :: modulus(:), slope(:), own_variance(:)
      !> Derivatives with respect to the tilts of the sample, GPa/rad, (grain, 2). They are set only
      !> if grains are evaluated in several directions.
      real(wp), intent(out) :: tilt_slopes(:, :)
      real(wp), intent(in), optional :: moduli(size(self%euler, 2))
      real(wp) :: rows(size(self%euler, 2)), slopes(size(self%euler, 2)), moments(4), scatter_sd
      integer :: g

      call self%grains%evaluate_moduli(c, rows, slopes, moduli)
      call self%set_contrast(x, self%are_moduli, rows, slopes)
      scatter_sd = self%grain_scatter(x)
      if (allocated(self%unknown)) then
         associate (probability => self%unknown%probability, n => size(self%unknown%probability))
            modulus = dot_product(probability, rows(:n))
            slope = dot_product(probability, slopes(:n))
            own_variance = dot_product(probability, rows(:n)**2) - modulus**2 &
               & + (scatter_sd*modulus)**2
         end associate
         tilt_slopes = 0.0_wp
         return
      end if
      modulus = rows(:self%n_grains)
      slope = slopes(:self%n_grains)
      own_variance = self%scatter*slope**2 + (scatter_sd*modulus)**2
      ! Speeds follow from the theory alone.
      slope(self%n_moduli + 1:) = 0.0_wp
      own_variance(self%n_moduli + 1:) = 0.0_wp
      if (self%n_directions == 1) return
      do g = 1, self%n_grains
         moments = tilt_moments(rows(g:size(self%are_moduli):self%n_grains), self%data%tilt_sd(g))
         modulus(g) = moments(1)
         own_variance(g) = own_variance(g) + moments(2)
         tilt_slopes(g, :) = moments(3:)
      end do
   end subroutine evaluate_grains

   !> Predictions of the measurements at a point: their mean, `model`, the scales of the errors that
   !> grains do not share, and the columns of U divided by these scales.
   pure subroutine predict_measurements(self, x, c, model, scales, u, moduli)
      class(posterior_type), intent(in) :: self
      !> Point, (dimension), and its stiffness, GPa.
      real(wp), intent(in) :: x(:), c(6, 6)
      !> In the unit of the observable, (grain).
      real(wp), intent(out), contiguous :: model(:), scales(:)
      !> (grain, shared error).
      real(wp), allocatable, intent(out) :: u(:, :)
      !> The grain model's rows for this crystal, if the caller has them, GPa.
      real(wp), intent(in), optional :: moduli(size(self%euler, 2))
      real(wp), dimension(self%n_grains) :: slope, own_variance, map_slope
      real(wp) :: tilt_slopes(self%n_grains, 2)
      real(wp), allocatable :: columns(:, :)
      integer :: g, n

      allocate (u(self%n_grains, self%n_shared))
      call evaluate_grains(self, x, c, model, slope, own_variance, tilt_slopes, moduli)
      map_slope = 1.0_wp
      call self%observable%to_measured(model(:self%n_moduli), map_slope(:self%n_moduli))
      if (self%laboratory%changes_moduli()) then
         map_slope = map_slope*self%mean_factors(x)
         model = model*self%mean_factors(x)
      end if
      scales = scale_factor(self, x)*self%scale
      if (self%has_own_variance()) then
         scales = sqrt(scales**2 + own_variance*(self%errors%scale*map_slope)**2)
      end if
      if (self%grains%n_columns > 0) then
         allocate (columns(size(self%euler, 2), self%grains%n_columns))
         call self%grains%evaluate_columns(c, columns)
         slope = slope*map_slope/scales
         do g = 1, self%grains%n_columns
            u(:, g) = columns(:self%n_grains, g)*slope
         end do
      end if
      n = self%grains%n_columns + size(self%relative, 2)
      do g = self%grains%n_columns + 1, n
         u(:, g) = self%relative(:, g - self%grains%n_columns)*model/scales
      end do
      do g = n + 1, self%n_shared
         u(:, g) = self%settings%misalignment_sd_deg*degree*tilt_slopes(:, g - n)*map_slope/scales
      end do
   end subroutine predict_measurements

   !> A model of other grains, for predictions of their moduli and measurements.
   subroutine new_grains(self, euler, paths, grains, error, compute_all, with_mean)
      class(posterior_type), intent(in) :: self
      !> Bunge-Euler angles (radians), (3, n).
      real(wp), intent(in) :: euler(:, :)
      !> Path of the wave of each measurement, (n).
      type(path_type), intent(in) :: paths(:)
      class(grain_model_type), allocatable, intent(out) :: grains
      type(error_type), allocatable, intent(out) :: error
      !> Compute the theory of every crystal and grain in full: read none from a field, and
      !> interpolate none from other grains.
      logical, intent(in), optional :: compute_all
      !> Append the directions of `mean_weights`; absent: do not.
      logical, intent(in), optional :: with_mean
      type(path_type), allocatable :: all_paths(:)
      real(wp), allocatable :: all_euler(:, :)
      integer :: n

      n = 0
      if (present(with_mean)) n = size(self%mean_weights)
      all_paths = [paths, spread(path_type(), 1, n)]
      all_euler = reshape([euler, self%euler(:, size(self%euler, 2) - n + 1:)], &
         & [3, size(all_paths)])
      allocate (grains, source=self%grains)
      ! Every log-anisotropy is above -1.
      if (present(compute_all)) call grains%use_field_up_to(-1.0_wp)
      select type (grains)
      type is (wave_grains_type)
         grains%paths = all_paths
         call grains%set_grains(all_euler, error)
      class default
         call add_waves(all_paths, self%data%density, all_euler, grains, error)
      end select
   end subroutine new_grains

   !> Rows of the grain model at some points, GPa, (row, point).
   pure function moduli_at(self, points) result(moduli)
      class(posterior_type), intent(in) :: self
      !> (parameter, point).
      real(wp), intent(in) :: points(:, :)
      real(wp), allocatable :: moduli(:, :)

      allocate (moduli(size(self%euler, 2), size(points, 2)))
      call self%grains%evaluate_crystals(self%prior%class%stiffnesses(points), moduli)
   end function moduli_at
end module constants_posterior
