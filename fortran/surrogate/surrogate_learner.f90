!> The regression of a surrogate: the posterior of a basis' coefficients given the simulations so far, and the candidates for the next.
module surrogate_learner
   use abstract_acquisition, only: acquisition_type
   use acquisitions, only: new_acquisition
   use abstract_basis, only: basis_type, spread_of
   use errors, only: error_type, exit_bad_input, raise
   use evidence_regression, only: add_data, coefficient_covariance, coefficient_mean, compute_spectrum, &
      & leave_groups_out, log_evidence, maximise_evidence, new_regression, scale_columns, set_precisions, spectrum_type
   use kinds, only: wp
   use sequential_design, only: absorb_choices, compute_variances, condition_on, design_type, refresh_interval, set_candidates, &
      & update_posterior_mean
   use surrogate_model, only: simulations_type, surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: learner_type, new_learner, set_learner_candidates, exclude_candidates, add_simulations, revert, fit_learner, &
      & evaluate_evidence, choose_next, predict_moduli, leave_out, surrogate_of

   type :: learner_type
      class(basis_type), allocatable :: basis
      type(design_type) :: design
      class(acquisition_type), allocatable :: rule
      !> Scale of each candidate, GPa, and its spread.
      real(wp), allocatable :: candidate_scale(:), candidate_spread(:)
      !> The data of the regression.
      type(simulations_type) :: simulations
      !> ln evidence when it was last maximised.
      real(wp) :: log_evidence = 0.0_wp
   end type learner_type

contains

   !> A learner without simulations and candidates.
   subroutine new_learner(basis, learner, error)
      class(basis_type), intent(in) :: basis
      type(learner_type), intent(out) :: learner
      type(error_type), allocatable, intent(out) :: error
      integer :: degrees(basis%n_terms)

      degrees = 1
      if (allocated(basis%prior_degrees)) degrees = basis%prior_degrees
      call new_regression(degrees, basis%first_sds, basis%least_noise, learner%design%regression, error)
      if (allocated(error)) return
      call set_candidates(learner%design, reshape([real(wp) ::], [basis%n_terms, 0]))
      allocate (learner%basis, source=basis)
      allocate (learner%simulations%constants(basis%domain%class%n_constants, 0), learner%simulations%euler_deg(3, 0), &
         & learner%simulations%modulus(0), learner%candidate_scale(0), learner%candidate_spread(0))
   end subroutine new_learner

   !> Give the candidates, all of them available, and the name of the rule by which they are chosen.
   subroutine set_learner_candidates(learner, constants, euler_deg, rule, error)
      type(learner_type), intent(inout) :: learner
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      !> See `acquisitions`.
      character(len=*), intent(in) :: rule
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: terms(:, :)

      call new_acquisition(rule, learner%rule, error)
      if (allocated(error)) return
      call learner%basis%evaluate_crystals(constants, euler_deg, terms, learner%candidate_scale, learner%candidate_spread)
      call set_candidates(learner%design, terms)
   end subroutine set_learner_candidates

   !> Candidates that may not be chosen any more.
   subroutine exclude_candidates(learner, numbers, error)
      type(learner_type), intent(inout) :: learner
      !> From 1.
      integer, intent(in) :: numbers(:)
      type(error_type), allocatable, intent(out) :: error

      if (any(numbers < 1 .or. numbers > size(learner%design%available))) then
         call raise(error, 'a candidate''s number is outside 1 .. '//to_text(size(learner%design%available)), exit_bad_input)
      else
         learner%design%available(numbers) = .false.
      end if
   end subroutine exclude_candidates

   !> Add simulations to the data. If the design has `chosen` them, it expects them and the posterior mean follows with
   !> `update_posterior_mean`; else each is an update of the posterior (Eq. 11), or all at once are where there are many.
   subroutine add_simulations(learner, constants, euler_deg, modulus, chosen, error)
      type(learner_type), intent(inout) :: learner
      !> Constants (n_constants, n) and moduli (n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :), modulus(:)
      logical, intent(in) :: chosen
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: terms(:, :), scale(:), spread(:)
      integer :: i

      if (.not. (all(modulus > 0.0_wp) .and. all(modulus < huge(1.0_wp)))) then
         call raise(error, 'a simulated modulus is not positive and finite', exit_bad_input)
         return
      end if
      call learner%basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      if (.not. all(abs(terms) < huge(1.0_wp))) then
         call raise(error, 'a training crystal is elastically unstable', exit_bad_input)
         return
      end if
      associate (regression => learner%design%regression)
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
      end associate
      associate (known => learner%simulations)
         call append_columns(known%constants, constants)
         call append_columns(known%euler_deg, euler_deg)
         known%modulus = [known%modulus, modulus]
      end associate
   end subroutine add_simulations

   !> Columns after others. An array constructor would be on the stack, and these may be large.
   subroutine append_columns(columns, more)
      real(wp), allocatable, intent(inout) :: columns(:, :)
      !> As long.
      real(wp), intent(in) :: more(:, :)
      real(wp), allocatable :: longer(:, :)
      integer :: n

      n = size(columns, 2)
      allocate (longer(size(columns, 1), n + size(more, 2)))
      longer(:, :n) = columns
      longer(:, n + 1:) = more
      call move_alloc(longer, columns)
   end subroutine append_columns

   !> Revert to an earlier design; simulations that it does not have are dropped.
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

   !> Posterior from all simulations, and the variances of all candidates, at alpha and beta of largest evidence or as given.
   subroutine fit_learner(learner, error, precisions)
      type(learner_type), intent(inout) :: learner
      type(error_type), allocatable, intent(out) :: error
      !> alpha and beta, in units of y.
      real(wp), intent(in), optional :: precisions(2)
      real(wp) :: ratio(learner%basis%n_terms)

      associate (design => learner%design, regression => learner%design%regression)
         call absorb_choices(design)
         ratio = 1.0_wp/regression%prior_width
         if (present(precisions)) then
            call set_precisions(regression, precisions(1), precisions(2), error)
         else
            call maximise_evidence(regression, error, learner%log_evidence)
         end if
         if (allocated(error)) return
         ratio = ratio*regression%prior_width
         if (any(abs(ratio - 1.0_wp) > 0.0_wp)) call scale_columns(ratio, design%candidates)
         call compute_variances(design)
      end associate
   end subroutine fit_learner

   !> ln evidence of all simulations at pairs of alpha and beta.
   subroutine evaluate_evidence(learner, alpha, beta, values, error)
      type(learner_type), intent(in) :: learner
      !> In units of y, (n).
      real(wp), intent(in) :: alpha(:), beta(:)
      !> (n).
      real(wp), intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      type(spectrum_type) :: spectrum

      values = 0.0_wp
      call compute_spectrum(learner%design%regression, spectrum, error)
      if (.not. allocated(error)) values = log_evidence(spectrum, alpha, beta)
   end subroutine evaluate_evidence

   !> The next candidates by the rule, each given all chosen before.
   subroutine choose_next(learner, threads, chosen, variance, error)
      type(learner_type), intent(inout) :: learner
      integer, intent(in) :: threads
      !> Numbers of the candidates, from 1.
      integer, intent(out) :: chosen(:)
      !> Variance of y at each before it was chosen.
      real(wp), intent(out) :: variance(:)
      type(error_type), allocatable, intent(out) :: error

      if (.not. allocated(learner%rule)) then
         call raise(error, 'there are no candidates to choose from')
      else if (count(learner%design%available) < size(chosen)) then
         call raise(error, 'no candidate is left to choose')
      else
         call learner%rule%choose(learner%design, learner%basis, learner%candidate_scale, learner%candidate_spread, &
            & threads, chosen, variance)
      end if
   end subroutine choose_next

   !> Moduli (GPa) of crystals by the posterior mean, or by other coefficients.
   subroutine predict_moduli(learner, constants, euler_deg, modulus, coefficients)
      type(learner_type), intent(in) :: learner
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      !> (n).
      real(wp), intent(out) :: modulus(:)
      !> (n_terms).
      real(wp), intent(in), optional :: coefficients(:)
      real(wp), allocatable :: terms(:, :), scale(:), spread(:), mean(:)

      mean = coefficient_mean(learner%design%regression)
      if (present(coefficients)) mean = coefficients
      call learner%basis%evaluate_crystals(constants, euler_deg, terms, scale, spread)
      modulus = learner%basis%to_modulus(matmul(mean, terms), scale, spread)
   end subroutine predict_moduli

   !> Each simulation predicted with its whole group left out: modulus (GPa), and the error of y over its sd.
   subroutine leave_out(learner, groups, modulus, z, error)
      type(learner_type), intent(inout) :: learner
      !> Group of each simulation, any numbers.
      integer, intent(in) :: groups(:)
      !> (n).
      real(wp), intent(out) :: modulus(:), z(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), dimension(size(groups)) :: residual, sd, spread
      integer :: i

      if (size(groups) /= size(learner%simulations%modulus)) then
         call raise(error, 'a group is needed for each of '//to_text(size(learner%simulations%modulus))//' simulations', &
            & exit_bad_input)
         return
      end if
      call absorb_choices(learner%design)
      call leave_groups_out(learner%design%regression, groups, residual, sd, error)
      if (allocated(error)) return
      associate (basis => learner%basis, known => learner%simulations, y => learner%design%regression%targets(:size(groups)))
         spread = [(spread_of(basis%noise_growth, basis%domain%class%stiffness(known%constants(:, i))), i=1, size(groups))]
         modulus = known%modulus*(basis%to_modulus(y - residual, 1.0_wp, spread)/basis%to_modulus(y, 1.0_wp, spread))
      end associate
      z = residual/sd
   end subroutine leave_out

   !> The surrogate from these simulations.
   subroutine surrogate_of(learner, provenance, surrogate, error)
      type(learner_type), intent(inout) :: learner
      !> Where it comes from: a JSON object.
      character(len=*), intent(in) :: provenance
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      n = size(learner%simulations%modulus)
      if (n < 2) then
         call raise(error, 'there are '//to_text(n)//' training simulations; at least 2 are needed', exit_bad_input)
         return
      end if
      call absorb_choices(learner%design)
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
end module surrogate_learner
