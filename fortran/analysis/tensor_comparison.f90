!> A calculated stiffness, the tensor, against the measurements.
!>
!> The tensor is a normal factor on all constants. Its predictive p is that of chi-square at the
!> maximum of the posterior: the squares of the residuals, of the shared errors and of the
!> deviations from the tensor and from other knowledge. With normal errors it has as many degrees of
!> freedom as there are measurements and further quantities. The log odds compare the evidence of
!> the measurements for this crystal with that for any crystal of the prior.
module tensor_comparison
   use analysis, only: analysis_type
   use constants_posterior, only: posterior_type
   use detected_speeds, only: omit_undetected
   use errors, only: error_type
   use field_reading, only: choose_field_degree
   use further_measurements, only: add_moduli, predict_candidates, write_suggestions
   use json, only: json_type
   use kinds, only: nan, wp
   use model_evidence, only: fit_model, fit_type
   use next_measurement, only: candidates_type, suggestions_type
   use rivals, only: constants_at
   use statement_rivals, only: part_of
   use statistics, only: chi_square_above, median, moments
   use text, only: to_text
   implicit none
   private
   public :: compare_tensor

   !> Every fifth draw is used for the degree of the harmonics.
   integer, parameter :: degree_stride = 5

contains

   !> Write the document of `tensor` into the object of a `page`.
   subroutine compare_tensor(analysis, page, error)
      type(analysis_type), intent(inout) :: analysis
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      !> The tensor without and with the measurements, and any crystal with them.
      type(posterior_type) :: tensor, free
      type(fit_type) :: alone, stated, other
      real(wp), allocatable :: draws(:, :)
      real(wp) :: crystal(6, 6)
      logical, allocatable :: is_tensor(:)
      integer :: i

      call omit_undetected(analysis%problem, analysis%surrogate, error)
      if (.not. allocated(error)) call analysis%prepare(error)
      if (allocated(error)) return
      associate (posterior => analysis%posterior, problem => analysis%problem)
         if (.not. allocated(problem%data%stiffness)) then
            call problem%refuse('knowledge', 'stiffness_file', 'the variable is missing; it is ' &
               & //'the calculated stiffness', error)
            return
         end if
         crystal = posterior%stiffness(problem%data%stiffness%mean)
         tensor = posterior
         tensor%prior_only = .true.
         associate (known => posterior%prior%knowledge)
            is_tensor = [(i > size(known%mean) - posterior%n_constants, i=1, size(known%mean))]
            call tensor%prior%set_knowledge(part_of(known, is_tensor), error)
            if (allocated(error)) return
            call fit_model(tensor, crystal, .true., .false., alone)
            if (.not. alone%found) then
               call problem%refuse('knowledge', 'stiffness_file', 'the prior excludes it', error)
               return
            end if
            draws = draws_of(tensor, alone)
            if (posterior%grains%has_theory) then
               call choose_field_degree(posterior, draws(:, ::degree_stride), problem%threads(), &
                  & error)
               if (allocated(error)) return
            end if
            call write_grains(analysis, draws, page, error)
            if (allocated(error)) return
            free = posterior
            call free%prior%set_knowledge(part_of(known, .not. is_tensor), error)
            if (allocated(error)) return
         end associate
         call fit_model(posterior, crystal, .true., .false., stated)
         call fit_model(free, crystal, .true., .false., other)
         call write_misfit(constants_at(posterior, stated%maximum))
         call page%put('log_odds', merge(stated%log_z - alone%log_z - other%log_z, nan, &
            & stated%found .and. other%found))
         if (stated%found .and. other%found) call suggest_direction()
      end associate

   contains

      !> Write the direction whose modulus would refute the tensor soonest, if it is wrong: the
      !> expected growth of the log odds by its measurement, with normal predictions.
      subroutine suggest_direction()
         type(candidates_type) :: candidates(2)
         type(suggestions_type) :: suggestions
         real(wp), allocatable :: mean(:, :), sd(:, :)
         real(wp) :: noise(2)

         associate (problem => analysis%problem, posterior => analysis%posterior, &
            & m => analysis%posterior%n_moduli)
            noise = [problem%settings%next%sd_gpa, 0.0_wp]
            if (.not. noise(1) > 0.0_wp .and. m > 0) noise(1) = median(m, posterior%data%sd(:m))
            if (.not. noise(1) > 0.0_wp) return
            call add_moduli(problem, problem%class, candidates(1))
            candidates(2) = candidates(1)
            call predict_candidates(problem, posterior, draws_of(posterior, stated), noise, &
               & candidates(1), error)
            if (allocated(error)) return
            call predict_candidates(problem, free, draws_of(free, other), noise, candidates(2), &
               & error)
            if (allocated(error)) return
            allocate (mean(size(candidates(1)%cost), 2), sd(size(candidates(1)%cost), 2))
            do i = 1, 2
               call moments(transpose(candidates(i)%predicted), mean(:, i), sd(:, i))
               sd(:, i) = hypot(sd(:, i), candidates(i)%sd)
            end do
            suggestions%first_gains = log(sd(:, 1)/sd(:, 2)) + 0.5_wp*((sd(:, 2)**2 &
               & + (mean(:, 2) - mean(:, 1))**2)/sd(:, 1)**2 - 1.0_wp)
            suggestions%chosen = [maxloc(suggestions%first_gains, dim=1)]
            suggestions%gains = suggestions%first_gains(suggestions%chosen)
            suggestions%within = [0.0_wp]
            call write_suggestions(page, problem, candidates(1), suggestions, noise)
         end associate
      end subroutine suggest_direction

      !> Write chi-square at a point, and its probability, which normal errors of stated sds have.
      subroutine write_misfit(x)
         real(wp), intent(in) :: x(:)
         real(wp), dimension(analysis%posterior%n_grains) :: model, scales, residuals
         real(wp), allocatable :: u(:, :), b(:), l(:, :)
         real(wp) :: chi_square, log_likelihood
         integer :: freedom

         associate (posterior => analysis%posterior, nuisances => analysis%posterior%nuisances, &
            & n => analysis%posterior%n_constants)
            freedom = posterior%n_grains + size(posterior%prior%knowledge%mean) - n
            call posterior%predict_measurements(x, posterior%stiffness(x), model, scales, u)
            residuals = (posterior%data%modulus - model)/scales
            call posterior%errors%integrate(residuals, u, b, l, log_likelihood)
            chi_square = sum((residuals - matmul(u, b))**2) + sum(b**2) &
               & + sum(posterior%prior%deviations(posterior%stiffness(x))**2)
            chi_square = chi_square &
               & + sum(((x(n + 1:) - nuisances%prior(1))/nuisances%prior(2))**2)
            if (posterior%infers_scale .or. posterior%settings%likelihood /= 'normal') then
               chi_square = nan
            end if
         end associate
         call page%put_numbers('predictive_p, chi_square, freedom', &
            & [chi_square_above(chi_square, freedom), chi_square, real(freedom, wp)])
      end subroutine write_misfit
   end subroutine compare_tensor

   !> As many draws of equal weight as a fit has weighted ones, as the sampler has them, (parameter,
   !> draw).
   function draws_of(posterior, fit) result(draws)
      type(posterior_type), intent(in) :: posterior
      type(fit_type), intent(in) :: fit
      real(wp), allocatable :: draws(:, :)
      real(wp) :: total
      integer :: i, j

      draws = fit%draws
      j = 1
      total = 0.0_wp
      do i = 1, size(fit%weights)
         total = total + 1.0_wp/size(fit%weights)
         do while (total > sum(fit%weights(:j)) .and. j < size(fit%weights))
            j = j + 1
         end do
         draws(:, i) = constants_at(posterior, fit%draws(:, j))
      end do
   end function draws_of

   !> Write each measurement beside what the tensor predicts from these draws.
   subroutine write_grains(analysis, draws, page, error)
      type(analysis_type), intent(in) :: analysis
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      !> A ratio of the tensor to the measurements from which the unit is in doubt.
      real(wp), parameter :: doubtful = 5.0_wp
      real(wp) :: predicted(analysis%posterior%n_grains, size(draws, 2))
      real(wp), dimension(analysis%posterior%n_grains) :: mean, sd, scales, variance
      real(wp), allocatable :: u(:, :)
      integer :: i

      associate (posterior => analysis%posterior, table => analysis%problem%data%measurements)
         variance = 0.0_wp
         do i = 1, size(draws, 2)
            call posterior%predict_measurements(draws(:, i), posterior%stiffness(draws(:, i)), &
               & predicted(:, i), scales, u)
            variance = variance + scales**2*(1.0_wp + sum(u**2, 2))/size(draws, 2)
         end do
         call moments(predicted, mean, sd)
         sd = sqrt(sd**2 + variance)
         associate (ratio => median(size(mean), mean/posterior%data%modulus))
            if (ratio > doubtful) then
               call analysis%problem%refuse('knowledge', 'stiffness_file', 'its moduli are ' &
                  & //to_text(ratio, 3)//' times the measured ones; GPa are needed, 10 kBar = ' &
                  & //'1 GPa', error)
            end if
         end associate
         call page%begin_array('predicted')
         do i = 1, size(mean)
            call page%begin_object('')
            if (table%named_by > 0) call page%put('grain', table%name(i))
            call page%put('euler_deg', table%euler_deg(:, i))
            call page%put_numbers('measured, mean, sd, deviation', [posterior%data%modulus(i), &
               & mean(i), sd(i), (posterior%data%modulus(i) - mean(i))/sd(i)])
            call page%end_object()
         end do
         call page%end_array()
      end associate
   end subroutine write_grains

end module tensor_comparison
