!> The regression of a surrogate: the posterior of a basis' coefficients given the simulations so
!> far, and the candidates for the next.
!>
!> It is trained batch by batch: the simulations, the posterior of the coefficients, and the history
!> of its errors.
module surrogate_learner
   use abstract_basis, only: basis_type, spread_of
   use acquisitions, only: acquisition_type, new_acquisition
   use errors, only: error_type, refuse
   use evidence_regression, only: add_data, coefficient_covariance, coefficient_mean, &
      & leave_groups_out, maximise_evidence, new_regression, scale_columns
   use kinds, only: degree, wp
   use modulus_slopes, only: count_slopes, evaluate_slopes, takes_slopes
   use simulate, only: n_derivatives
   use statistics, only: number_equal
   use sequential_design, only: compute_variances, condition_on, design_type, refresh_interval, &
      & set_candidates, update_posterior_mean
   use settings_schema, only: design_settings_type
   use surrogate_model, only: simulations_type, surrogate_type, values_alone
   use text, only: to_text
   implicit none
   private
   public :: learner_type, new_learner, add_simulations, revert, fit_learner, predict_moduli
   public :: learning_type, history_type, new_learning, batch_end, learn, close_batch
   public :: surrogate_of, refit_all, change_basis, left_out

   type :: learner_type
      class(basis_type), allocatable :: basis
      type(design_type) :: design
      type(acquisition_type) :: rule
      !> Data of the regression.
      type(simulations_type) :: simulations
      !> ln evidence at the last maximisation.
      real(wp) :: log_evidence = 0.0_wp
   end type learner_type

   !> Least number of points before alpha and beta are first computed, with an informative prior.
   integer, parameter :: fewest_points = 8
   !> Number of latest points over which the error of the next points is averaged.
   integer, parameter :: window = 20

   !> The state after a maximisation of the evidence.
   type :: history_type
      integer :: simulations = 0
      !> Mean absolute errors, GPa: of each simulation left out, of each with all of its crystal
      !> left out, and of the next points before they were data; the last is negative if there are
      !> none.
      real(wp) :: loocv = 0.0_wp, leave_crystal_out = 0.0_wp, next = -1.0_wp
      real(wp) :: alpha = 0.0_wp, beta = 0.0_wp, decay_rate = 0.0_wp, log_evidence = 0.0_wp
      !> Norm of the coefficients, and their angle to those of the batch before, degrees.
      real(wp) :: norm = 0.0_wp, angle_deg = 0.0_wp
   end type history_type

   type :: learning_type
      type(learner_type) :: learner
      type(design_settings_type) :: settings
      !> Number of points before alpha and beta are first computed.
      integer :: first = 0
      !> Number of simulations at the last maximisation of the evidence.
      integer :: last_refit = 0
      type(history_type), allocatable :: history(:)
      !> Coefficients at the end of the last batch; error of each point before it was data, GPa.
      real(wp), allocatable :: last_mean(:), next_errors(:)
   contains
      procedure :: n => count_simulations
   end type learning_type

contains

   !> Make a learner without simulations and candidates.
   subroutine new_learner(basis, learner, error)
      class(basis_type), intent(in) :: basis
      type(learner_type), intent(out) :: learner
      type(error_type), allocatable, intent(out) :: error
      integer :: degrees(basis%n_terms)

      degrees = 1
      if (allocated(basis%prior_degrees)) degrees = basis%prior_degrees
      call new_regression(degrees, basis%first_sds, basis%least_noise, &
         & learner%design%regression, error)
      if (allocated(error)) return
      allocate (learner%basis, source=basis)
      associate (known => learner%simulations)
         allocate (known%constants(basis%domain%class%n_constants, 0), known%euler_deg(3, 0), &
            & known%modulus(0), known%by_stiffness(n_derivatives, 0))
         call set_candidates(learner%design, basis, known%constants, known%euler_deg, .false.)
      end associate
   end subroutine new_learner

   !> Add simulations to the data. If the design has `chosen` them, the covariance contains them
   !> already, and `update_posterior_mean` follows later. Otherwise the posterior is updated for
   !> each (Eq. 11), or computed once if there are many.
   subroutine add_simulations(learner, simulations, chosen, error)
      type(learner_type), intent(inout) :: learner
      type(simulations_type), intent(in) :: simulations
      logical, intent(in) :: chosen
      type(error_type), allocatable, intent(out) :: error
      !> Observations: each simulation, followed by its derivatives, if they are known and used.
      real(wp), allocatable :: terms(:, :), scale(:), spread(:), rows(:, :), y(:)
      logical, allocatable :: is_slope(:)
      integer :: n_slopes(size(simulations%modulus)), i, first

      associate (regression => learner%design%regression, basis => learner%basis, &
         & constants => simulations%constants, euler_deg => simulations%euler_deg, &
         & modulus => simulations%modulus)
         call basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
         if (.not. (all(modulus > 0.0_wp) .and. all(modulus < huge(1.0_wp)))) then
            call refuse(error, 'a simulated modulus is not positive and finite')
         else if (.not. all(abs(terms) < huge(1.0_wp))) then
            call refuse(error, 'a training crystal is elastically unstable')
         end if
         if (allocated(error)) return
         n_slopes = 0
         if (takes_slopes(basis)) then
            n_slopes = merge(count_slopes(basis), 0, any(abs(simulations%by_stiffness) > 0.0_wp, 1))
         end if
         allocate (y(size(modulus) + sum(n_slopes)))
         allocate (rows(basis%n_terms, size(y)))
         allocate (is_slope(size(y)), source=.true.)
         first = 1
         do i = 1, size(modulus)
            rows(:, first) = terms(:, i)
            y(first) = basis%to_y(modulus(i), scale(i), spread(i))
            is_slope(first) = .false.
            associate (last => first + n_slopes(i))
               if (last > first) then
                  call evaluate_slopes(basis, constants(:, i), euler_deg(:, i), &
                     & rows(:, first + 1:last), y(first + 1:last), modulus(i), &
                     & simulations%by_stiffness(:, i))
               end if
               first = last + 1
            end associate
         end do
         call add_data(regression, rows, y, is_slope)
         if (.not. chosen) then
            if (size(y) <= refresh_interval) then
               do i = regression%n_data - size(y) + 1, regression%n_data
                  call condition_on(learner%design, regression%terms(:, i), 1)
               end do
            end if
            call update_posterior_mean(learner%design, size(y) > refresh_interval, error)
            if (allocated(error)) return
         end if
         call learner%simulations%append(simulations)
      end associate
   end subroutine add_simulations

   !> Revert to an earlier design; later simulations are dropped.
   subroutine revert(learner, design)
      type(learner_type), intent(inout) :: learner
      type(design_type), intent(in) :: design
      integer :: i

      learner%design = design
      learner%simulations = learner%simulations%of_rows([(i, i=1, &
         & count(.not. design%regression%is_slope))])
   end subroutine revert

   !> Maximise the evidence over alpha and beta, and compute the posterior from all simulations and
   !> the variances of all candidates.
   subroutine fit_learner(learner, error)
      type(learner_type), intent(inout) :: learner
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: ratio(learner%basis%n_terms)
      integer :: i

      associate (design => learner%design, regression => learner%design%regression)
         ratio = 1.0_wp/regression%prior_width
         call maximise_evidence(regression, error, learner%log_evidence)
         if (allocated(error)) return
         ratio = ratio*regression%prior_width
         call scale_columns(ratio, design%candidates)
         if (allocated(design%slopes)) then
            do i = 1, size(design%slopes, 3)
               call scale_columns(ratio, design%slopes(:, :, i))
            end do
         end if
         call compute_variances(design)
      end associate
   end subroutine fit_learner

   !> Moduli (GPa) of crystals by coefficients, such as the posterior mean.
   subroutine predict_moduli(learner, coefficients, constants, euler_deg, modulus)
      type(learner_type), intent(in) :: learner
      !> (n_terms).
      real(wp), intent(in) :: coefficients(:)
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      !> (n).
      real(wp), intent(out) :: modulus(:)
      real(wp), allocatable :: terms(:, :), scale(:), spread(:)

      call learner%basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      modulus = learner%basis%to_modulus(matmul(coefficients, terms), scale, spread)
   end subroutine predict_moduli

   !> Make the surrogate from these simulations.
   subroutine surrogate_of(learner, provenance, surrogate, error)
      type(learner_type), intent(inout) :: learner
      !> Where it comes from: a JSON object.
      character(len=*), intent(in) :: provenance
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = size(learner%simulations%modulus)
      if (n < 2) then
         call refuse(error, &
            & 'there are '//to_text(n)//' training simulations; at least 2 are needed')
         return
      end if
      allocate (surrogate%basis, source=learner%basis)
      associate (regression => learner%design%regression)
         surrogate%alpha = regression%alpha
         surrogate%beta = regression%beta
         surrogate%decay_rate = regression%decay_rate
         surrogate%coefficients = coefficient_mean(regression)
         call coefficient_covariance(regression, surrogate%covariance)
      end associate
      associate (known => learner%simulations)
         surrogate%simulations = values_alone(known%constants, known%euler_deg, known%modulus)
         if (any(learner%design%regression%is_slope)) surrogate%simulations = known
      end associate
      surrogate%provenance = provenance
   end subroutine surrogate_of

   !> Start the training, without data. The evidence is first maximised after `initial` points; 0
   !> stands for as many as the basis needs.
   subroutine new_learning(basis, settings, learning, error)
      class(basis_type), intent(in) :: basis
      type(design_settings_type), intent(in) :: settings
      type(learning_type), intent(out) :: learning
      type(error_type), allocatable, intent(out) :: error

      call new_learner(basis, learning%learner, error)
      if (allocated(error)) return
      learning%learner%rule = new_acquisition(settings%variance_of)
      learning%settings = settings
      learning%first = fewest_points
      if (.not. allocated(basis%prior_degrees)) learning%first = basis%n_terms
      if (settings%initial > 0) learning%first = settings%initial
      learning%first = min(max(learning%first, 2), settings%budget)
      learning%last_mean = coefficient_mean(learning%learner%design%regression)
      allocate (learning%history(0), learning%next_errors(0))
   end subroutine new_learning

   !> Number of simulations so far.
   pure integer function count_simulations(self)
      class(learning_type), intent(in) :: self

      count_simulations = size(self%learner%simulations%modulus)
   end function count_simulations

   !> Number of points at the end of the present batch.
   pure integer function batch_end(learning)
      type(learning_type), intent(in) :: learning

      batch_end = learning%first
      if (learning%n() >= learning%first) then
         batch_end = min(learning%settings%budget, learning%first + learning%settings%batch &
                        & *((learning%n() - learning%first)/learning%settings%batch + 1))
      end if
   end function batch_end

   !> Add observations to the training. If the design has `chosen` them, the covariance contains
   !> them already.
   subroutine learn(learning, simulations, chosen, error)
      type(learning_type), intent(inout) :: learning
      type(simulations_type), intent(in) :: simulations
      logical, intent(in) :: chosen
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: predicted(size(simulations%modulus))

      if (size(predicted) == 0) return
      ! Predict with the coefficients of the end of the last batch, so that the errors do not depend
      ! on where in a batch a build was interrupted.
      if (learning%n() >= learning%first) then
         call predict_moduli(learning%learner, learning%last_mean, &
            & simulations%constants, simulations%euler_deg, predicted)
         learning%next_errors = [learning%next_errors, abs(predicted - simulations%modulus)]
      end if
      call add_simulations(learning%learner, simulations, chosen, error)
   end subroutine learn

   !> End a batch: compute the posterior, with new alpha and beta if it is time for them.
   subroutine close_batch(learning, exactly, error)
      type(learning_type), intent(inout) :: learning
      !> Whether to compute everything anew.
      logical, intent(in) :: exactly
      type(error_type), allocatable, intent(out) :: error

      associate (n => learning%n(), before => learning%last_refit)
         if (n > before .and. n >= learning%first .and. (before < learning%first &
            & .or. n - before >= learning%settings%refit .or. n >= learning%settings%budget)) then
            call refit_all(learning, error)
         else
            call update_posterior_mean(learning%learner%design, exactly, error)
         end if
      end associate
      learning%last_mean = coefficient_mean(learning%learner%design%regression)
   end subroutine close_batch

   !> Maximise the evidence and append an entry to the history, unless both were done with these
   !> simulations.
   subroutine refit_all(learning, error)
      type(learning_type), intent(inout) :: learning
      type(error_type), allocatable, intent(out) :: error
      type(history_type) :: entry
      real(wp), allocatable :: mean(:)
      real(wp) :: cosine
      integer :: i

      if (learning%n() == learning%last_refit) return
      call fit_learner(learning%learner, error)
      if (allocated(error)) return
      entry%simulations = learning%n()
      call left_out(learning%learner, [(i, i=1, learning%n())], entry%loocv, error)
      if (allocated(error)) return
      call left_out(learning%learner, number_equal(learning%learner%simulations%constants), &
         & entry%leave_crystal_out, error)
      if (allocated(error)) return
      associate (errors => learning%next_errors, regression => learning%learner%design%regression)
         if (size(errors) > 0) then
            i = min(window, size(errors))
            entry%next = sum(errors(size(errors) - i + 1:))/i
         end if
         entry%alpha = regression%alpha
         entry%beta = regression%beta
         entry%decay_rate = regression%decay_rate
         mean = coefficient_mean(regression)
      end associate
      entry%log_evidence = learning%learner%log_evidence
      entry%norm = norm2(mean)
      cosine = dot_product(mean, learning%last_mean)/max(entry%norm*norm2(learning%last_mean), &
         & tiny(1.0_wp))
      entry%angle_deg = acos(min(1.0_wp, max(-1.0_wp, cosine)))/degree
      learning%history = [learning%history, entry]
      learning%last_refit = entry%simulations
   end subroutine refit_all

   !> Train another basis on the same simulations, without candidates.
   subroutine change_basis(learning, basis, error)
      type(learning_type), intent(inout) :: learning
      class(basis_type), intent(in) :: basis
      type(error_type), allocatable, intent(out) :: error
      type(learner_type) :: learner

      call new_learner(basis, learner, error)
      if (allocated(error)) return
      call add_simulations(learner, learning%learner%simulations, .false., error)
      if (allocated(error)) return
      call fit_learner(learner, error)
      if (allocated(error)) return
      learner%rule = learning%learner%rule
      learning%learner = learner
      learning%last_mean = coefficient_mean(learner%design%regression)
   end subroutine change_basis

   !> Mean absolute error of each simulation predicted with its whole group left out, GPa.
   subroutine left_out(learner, groups, error_gpa, error, modulus, z)
      type(learner_type), intent(in) :: learner
      !> Group number of each simulation, any numbers.
      integer, intent(in) :: groups(:)
      !> GPa.
      real(wp), intent(out) :: error_gpa
      type(error_type), allocatable, intent(out) :: error
      !> Modulus (GPa) of each simulation as predicted without its group, and the error of the
      !> prediction in units of its sd.
      real(wp), dimension(:), intent(out), optional :: modulus, z
      real(wp), dimension(learner%design%regression%n_data) :: residual, sd
      real(wp), dimension(size(groups)) :: y, spread, predicted
      integer :: i

      error_gpa = 0.0_wp
      associate (basis => learner%basis, known => learner%simulations, &
         & regression => learner%design%regression)
         ! A simulation is left out with its derivatives, which follow it.
         call leave_groups_out(regression, [(groups(count(.not. regression%is_slope(:i))), i=1, &
            & size(sd))], residual, sd, error)
         if (allocated(error)) return
         y = pack(regression%targets, .not. regression%is_slope)
         residual(:size(groups)) = pack(residual, .not. regression%is_slope)
         sd(:size(groups)) = pack(sd, .not. regression%is_slope)
         spread = [(spread_of(basis%noise_growth, &
            & basis%domain%class%stiffness(known%constants(:, i))), i=1, size(groups))]
         predicted = basis%to_modulus(y - residual(:size(groups)), 1.0_wp, spread) &
            & /basis%to_modulus(y, 1.0_wp, spread)*known%modulus
         error_gpa = sum(abs(predicted - known%modulus))/size(groups)
      end associate
      if (present(modulus)) modulus = predicted
      if (present(z)) z = -residual(:size(groups))/sd(:size(groups))
   end subroutine left_out

end module surrogate_learner
