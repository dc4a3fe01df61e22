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
   use statistics, only: number_equal
   use sequential_design, only: compute_variances, condition_on, design_type, refresh_interval, &
      & set_candidates, update_posterior_mean
   use settings_schema, only: design_settings_type
   use surrogate_model, only: simulations_type, surrogate_type
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
            & known%modulus(0))
         call set_candidates(learner%design, basis, known%constants, known%euler_deg)
      end associate
   end subroutine new_learner

   !> Add simulations to the data. If the design has `chosen` them, the covariance contains them
   !> already, and `update_posterior_mean` follows later. Otherwise the posterior is updated for
   !> each (Eq. 11), or computed once if there are many.
   subroutine add_simulations(learner, constants, euler_deg, modulus, chosen, error)
      type(learner_type), intent(inout) :: learner
      !> Constants (n_constants, n) and moduli (n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :), modulus(:)
      logical, intent(in) :: chosen
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: terms(:, :), scale(:), spread(:)
      integer :: i

      call learner%basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      if (.not. (all(modulus > 0.0_wp) .and. all(modulus < huge(1.0_wp)))) then
         call refuse(error, 'a simulated modulus is not positive and finite')
      else if (.not. all(abs(terms) < huge(1.0_wp))) then
         call refuse(error, 'a training crystal is elastically unstable')
      end if
      if (allocated(error)) return
      associate (known => learner%simulations, regression => learner%design%regression)
         call add_data(regression, terms, learner%basis%to_y(modulus, scale, spread))
         if (.not. chosen) then
            if (size(modulus) <= refresh_interval) then
               do i = regression%n_data - size(modulus) + 1, regression%n_data
                  call condition_on(learner%design, regression%terms(:, i), 1)
               end do
            end if
            call update_posterior_mean(learner%design, size(modulus) > refresh_interval, error)
            if (allocated(error)) return
         end if
         ! An array constructor would be on the stack, and these may be large.
         known%constants = reshape(known%constants, &
            & [size(constants, 1), regression%n_data], constants)
         known%euler_deg = reshape(known%euler_deg, [3, regression%n_data], euler_deg)
         known%modulus = [known%modulus, modulus]
      end associate
   end subroutine add_simulations

   !> Revert to an earlier design; later simulations are dropped.
   subroutine revert(learner, design)
      type(learner_type), intent(inout) :: learner
      type(design_type), intent(in) :: design

      learner%design = design
      associate (n => design%regression%n_data, known => learner%simulations)
         known%constants = known%constants(:, :n)
         known%euler_deg = known%euler_deg(:, :n)
         known%modulus = known%modulus(:n)
      end associate
   end subroutine revert

   !> Maximise the evidence over alpha and beta, and compute the posterior from all simulations and
   !> the variances of all candidates.
   subroutine fit_learner(learner, error)
      type(learner_type), intent(inout) :: learner
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: ratio(learner%basis%n_terms)

      associate (design => learner%design, regression => learner%design%regression)
         ratio = 1.0_wp/regression%prior_width
         call maximise_evidence(regression, error, learner%log_evidence)
         if (allocated(error)) return
         ratio = ratio*regression%prior_width
         call scale_columns(ratio, design%candidates)
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
      surrogate%simulations = learner%simulations
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
      call new_acquisition(settings%variance_of, learning%learner%rule, error)
      if (allocated(error)) return
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
   subroutine learn(learning, constants, euler_deg, modulus, chosen, error)
      type(learning_type), intent(inout) :: learning
      !> Constants of the domain's class (n_constants, n) and moduli (n), GPa; Bunge-Euler angles
      !> (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :), modulus(:)
      logical, intent(in) :: chosen
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: predicted(size(modulus))

      if (size(modulus) == 0) return
      ! Predict with the coefficients of the end of the last batch, so that the errors do not depend
      ! on where in a batch a build was interrupted.
      if (learning%n() >= learning%first) then
         call predict_moduli(learning%learner, learning%last_mean, constants, euler_deg, predicted)
         learning%next_errors = [learning%next_errors, abs(predicted - modulus)]
      end if
      call add_simulations(learning%learner, constants, euler_deg, modulus, chosen, error)
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
      associate (known => learning%learner%simulations)
         call add_simulations(learner, known%constants, known%euler_deg, known%modulus, &
            & .false., error)
      end associate
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
      real(wp), dimension(size(groups)) :: residual, sd, spread, predicted
      integer :: i

      error_gpa = 0.0_wp
      call leave_groups_out(learner%design%regression, groups, residual, sd, error)
      if (allocated(error)) return
      associate (basis => learner%basis, known => learner%simulations, &
         & y => learner%design%regression%targets)
         spread = [(spread_of(basis%noise_growth, &
            & basis%domain%class%stiffness(known%constants(:, i))), i=1, size(groups))]
         predicted = basis%to_modulus(y - residual, 1.0_wp, spread) &
            & /basis%to_modulus(y, 1.0_wp, spread)*known%modulus
         error_gpa = sum(abs(predicted - known%modulus))/size(groups)
      end associate
      if (present(modulus)) modulus = predicted
      if (present(z)) z = -residual/sd
   end subroutine left_out

end module surrogate_learner
