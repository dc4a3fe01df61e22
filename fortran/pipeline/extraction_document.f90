!> What Step 2 found, as the document of `extract`, with what a person should know of it.
module extraction_document
   use constants_prior, only: prior_type
   use extraction, only: extraction_type
   use further_knowledge, only: gain_type
   use json, only: json_type
   use model_checks, only: checks_type
   use kinds, only: wp
   use posterior_summary, only: combination_type
   use prior_sensitivity, only: change_type
   use prior_words, only: describe_prior
   use problem, only: problem_type
   use size_verdicts, only: judge_sizes
   use verdicts, only: judge_bound, judge_checks, judge_coverage, judge_grains, judge_knowledge, judge_mixing, judge_open, &
      & judge_ridges, judge_sensitivity, judge_theory, powers_text
   use warning_lists, only: warning_type
   implicit none
   private
   public :: write_extraction, judge_extraction

contains

   !> The document, as JSON.
   function write_extraction(problem, found) result(text)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      character(len=:), allocatable :: text
      type(json_type) :: document
      type(warning_type), allocatable :: warnings(:)
      integer :: i

      call document%begin_object()
      call document%begin_object('parameters')
      do i = 1, size(found%names)
         associate (parameter => found%parameters(i))
            call document%begin_object(trim(found%names(i)))
            call document%put('mean', parameter%mean)
            call document%put('sd', parameter%sd)
            if (found%decided(i)) then
               call document%put('map', found%most_probable(i))
            else
               call document%put_null('map')
            end if
            call document%put('hdi_95', parameter%hdi_95)
            call document%put('ess_bulk', parameter%diagnostics%ess_bulk)
            call document%put('ess_tail', parameter%diagnostics%ess_tail)
            call document%put('r_hat', parameter%diagnostics%r_hat)
            call document%end_object()
         end associate
      end do
      call document%end_object()
      call document%put('correlation', found%correlation)
      if (size(found%theory_mean) > 0) then
         call document%begin_object('theory_alone')
         do i = 1, size(found%theory_mean)
            call document%begin_object(trim(found%names(i)))
            call document%put('mean', found%theory_mean(i))
            call document%put('sd', found%theory_sd(i))
            call document%end_object()
         end do
         call document%end_object()
      end if
      call document%begin_array('predicted')
      do i = 1, found%posterior%n_grains
         call document%begin_object()
         call document%put('mean', found%predicted_mean(i))
         call document%put('sd', found%predicted_sd(i))
         call document%put('measured', found%posterior%measured(i))
         call document%put('measured_sd', found%posterior%sd(i))
         call document%put('euler_deg', problem%measurements%euler_deg(:, i))
         if (problem%measurements%named_by > 0) call document%put('grain', problem%measurements%name(i))
         if (allocated(problem%measurements%tests)) then
            call document%put('tests', problem%measurements%tests(i))
            call document%put('chi_square_of_tests', problem%measurements%chi_square(i))
         end if
         call document%end_object()
      end do
      call document%end_array()
      call document%begin_array('identifiability')
      do i = 1, size(found%combinations)
         call write_combination(document, found%names(:size(found%combinations)), found%combinations(i))
      end do
      do i = 1, size(found%quantities)
         associate (quantity => found%quantities(i), known => found%known(i))
            call document%begin_object()
            call document%put('kind', 'quantity')
            call document%put('name', quantity%name)
            call document%put('unit', quantity%unit)
            call document%put('mean', known%mean)
            call document%put('sd', known%sd)
            call document%put('prior_mean', known%prior_mean)
            call document%put('prior_sd', known%prior_sd)
            call document%put('contraction', known%contraction)
            call document%end_object()
         end associate
      end do
      do i = 1, size(found%gains)
         call write_gain(document, found%names, found%gains(i))
      end do
      call document%end_array()
      call write_prior(document, found)
      call write_checks(document, found%checks)
      if (allocated(found%evidence)) then
         call document%begin_object('evidence')
         call document%put('log_z', found%evidence%log_z)
         call document%put('sd', found%evidence%sd)
         call document%end_object()
      end if
      call document%begin_array('sensitivity')
      do i = 1, size(found%changes)
         call write_change(document, found%names, found%changes(i))
      end do
      call document%end_array()
      if (found%field_degree > 0) then
         call document%begin_object('theory')
         call document%put('degree', found%field_degree)
         call document%put('largest_error_sd', found%field_error)
         call document%end_object()
      end if
      call document%put('acceptance', sum(found%chains%acceptance)/size(found%chains%acceptance))
      call document%put('samples', size(found%chains%draws, 2))
      call document%put('chains', size(found%chains%draws, 3))
      call document%put('method', problem%settings%sampler%method)
      call document%put('seconds', found%seconds)
      warnings = problem%warnings
      call judge_extraction(problem, found, warnings)
      call document%put('warnings', warnings)
      call document%end_object()
      text = document%text()
   end function write_extraction

   subroutine write_combination(document, names, combination)
      type(json_type), intent(inout) :: document
      !> Of the constants.
      character(len=*), intent(in) :: names(:)
      type(combination_type), intent(in) :: combination
      integer :: j

      call document%begin_object()
      call document%put('kind', 'combination')
      call document%put('name', powers_text(names, combination%exponents))
      call document%begin_object('exponents')
      do j = 1, size(names)
         call document%put(trim(names(j)), combination%exponents(j))
      end do
      call document%end_object()
      call document%begin_object('correlations')
      do j = 1, size(names)
         call document%put(trim(names(j)), combination%correlations(j))
      end do
      call document%end_object()
      call document%put('sd', combination%sd)
      call document%put('prior_sd', combination%prior_sd)
      call document%put('contraction', combination%contraction)
      call document%end_object()
   end subroutine write_combination

   !> What the constants would be known to.
   subroutine write_gain(document, names, gain)
      type(json_type), intent(inout) :: document
      !> Of the parameters, constants first.
      character(len=*), intent(in) :: names(:)
      type(gain_type), intent(in) :: gain
      integer :: j

      call document%begin_object()
      call document%put('kind', 'knowledge')
      call document%put('name', trim(gain%name))
      call document%put('relative_sd', gain%relative_sd)
      call document%begin_object('sd_then')
      do j = 1, size(gain%sd_then)
         call document%put(trim(names(j)), gain%sd_then(j))
      end do
      call document%end_object()
      call document%end_object()
   end subroutine write_gain

   !> The prior that was in effect, what was not stated too; null where there is no limit.
   subroutine write_prior(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable :: lines(:)

      call document%begin_object('prior')
      call write_limits(document, found%posterior%prior)
      call write_knowledge(document, found)
      call describe_prior(found, lines)
      call document%put('words', lines)
      call document%end_object()
   end subroutine write_prior

   !> Whether the model could have given the measurements.
   subroutine write_checks(document, checks)
      type(json_type), intent(inout) :: document
      type(checks_type), intent(in) :: checks

      call document%begin_object('checks')
      call document%put('draws', size(checks%log_prior))
      call document%begin_object('chi_square')
      call document%put('mean', checks%chi_square)
      call document%put('p', checks%chi_square_p)
      call document%end_object()
      call document%begin_object('extreme_grain')
      call document%put('grain', checks%extreme_grain)
      call document%put('residual_sd', checks%extreme_residual)
      call document%put('p', checks%extreme_p)
      call document%end_object()
      call document%end_object()
   end subroutine write_checks

   !> What another prior would have said; null where too few draws tell.
   subroutine write_change(document, names, change)
      type(json_type), intent(inout) :: document
      !> Of the parameters.
      character(len=*), intent(in) :: names(:)
      type(change_type), intent(in) :: change
      integer :: j

      call document%begin_object()
      call document%put('name', trim(change%name))
      if (change%name /= 'measure') then
         call document%put('side', merge('upper', 'lower', change%is_upper))
         call document%put('from', change%from)
         call document%put('to', change%to)
      end if
      call document%put('exact', change%exact)
      call document%put('effective_draws', change%effective)
      call document%begin_object('shift_sd')
      do j = 1, size(names)
         call document%put(trim(names(j)), change%shift(j))
      end do
      call document%end_object()
      call document%begin_object('sd_ratio')
      do j = 1, size(names)
         call document%put(trim(names(j)), change%sd_ratio(j))
      end do
      call document%end_object()
      call document%end_object()
   end subroutine write_change

   !> What is known, and by how many sds it is away from what all else says.
   subroutine write_knowledge(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      real(wp) :: sd(size(found%conflict%of_quantity))
      integer :: j

      associate (known => found%posterior%prior%knowledge)
         sd = known%sd()
         call document%begin_array('knowledge')
         do j = 1, size(sd)
            call document%begin_object()
            call document%put('name', known%quantities(j)%name)
            call document%put('unit', known%quantities(j)%unit)
            call document%put('mean', known%mean(j))
            call document%put('sd', sd(j))
            call document%put('conflict_sd', found%conflict%of_quantity(j))
            call document%end_object()
         end do
         call document%end_array()
         call document%put('conflict_sd', found%conflict%sds)
      end associate
   end subroutine write_knowledge

   subroutine write_limits(document, prior)
      type(json_type), intent(inout) :: document
      type(prior_type), intent(in) :: prior
      integer :: j

      call document%put('measure', trim(merge('logarithms', 'constants ', prior%in_logarithms)))
      call document%begin_object('bounds')
      do j = 1, prior%n_constants
         if (prior%is_stated(j)) call document%put(prior%class%constants(j), [prior%lower(j), prior%upper(j)])
      end do
      call document%end_object()
      call put_limit('anisotropy_cap', prior%anisotropy_cap)
      call put_limit('log_anisotropy_max', prior%log_anisotropy_max)
      if (prior%has_box) then
         call document%put_null('poisson')
         call document%put_null('young_gpa')
      else
         call document%put('poisson', prior%poisson)
         call document%put('young_gpa', prior%young)
      end if
      call document%put('share_covered', prior%share_inside)

   contains

      subroutine put_limit(key, limit)
         character(len=*), intent(in) :: key
         real(wp), intent(in) :: limit

         if (limit < huge(limit)) then
            call document%put(key, limit)
         else
            call document%put_null(key)
         end if
      end subroutine put_limit
   end subroutine write_limits

   !> What a person should know, added to `warnings`.
   subroutine judge_extraction(problem, found, warnings)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp) :: factor
      integer :: i, k

      k = found%posterior%n_constants
      call judge_coverage(found%posterior%prior%share_inside, found%posterior%prior%known_scale, warnings)
      call judge_theory(found%field_error, warnings)
      call judge_sizes(problem, found%surrogate_contact_radius, found%surrogate_addition, warnings)
      call judge_knowledge(found%posterior%prior%knowledge, found%conflict, warnings)
      do i = 1, size(found%names)
         call judge_mixing(trim(found%names(i)), found%parameters(i)%diagnostics, size(found%chains%draws, 3), &
            & problem%settings%sampler%method, warnings)
      end do
      call judge_ridges(found%names(:k), found%correlation, found%combinations, warnings)
      call judge_open(found%names(:k), found%combinations, found%gains, warnings)
      associate (prior => found%posterior%prior)
         do i = 1, k
            if (prior%is_stated(i)) call judge_bound(trim(found%names(i)), found%chains%draws(i, :, :), prior%lower(i), &
               & prior%upper(i), warnings)
         end do
      end associate
      call judge_sensitivity(found%names, found%changes, warnings)
      factor = 1.0_wp
      if (size(found%names) > k) factor = found%parameters(k + 1)%mean
      call judge_grains(problem%measurements, found%posterior%measured, found%expected, factor*found%posterior%sd, &
         & problem%settings%measurements%likelihood, warnings)
      call judge_checks(found%checks, problem%measurements, warnings)
   end subroutine judge_extraction
end module extraction_document
