!> What Step 2 found, as the document of `extract`, with what a person should know of it.
module extraction_document
   use chain_diagnostics, only: diagnostics_type
   use extraction, only: extraction_type
   use json, only: json_type
   use kinds, only: wp
   use posterior_summary, only: combination_type
   use problem, only: problem_type
   use verdicts, only: judge_bound, judge_coverage, judge_grains, judge_mixing, judge_ridges, powers_text
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
      call document%begin_array('predicted')
      do i = 1, found%posterior%n_grains
         call document%begin_object()
         call document%put('mean', found%predicted_mean(i))
         call document%put('sd', found%predicted_sd(i))
         call document%put('measured', found%posterior%measured(i))
         call document%put('measured_sd', found%posterior%sd(i))
         call document%put('euler_deg', problem%measurements%euler_deg(:, i))
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
      call document%end_array()
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
      if (allocated(combination%mean)) then
         call document%put('mean', combination%mean)
      else
         call document%put_null('mean')
      end if
      call document%put('sd', combination%sd)
      call document%put('prior_sd', combination%prior_sd)
      call document%put('contraction', combination%contraction)
      call document%end_object()
   end subroutine write_combination

   !> What a person should know, added to `warnings`.
   subroutine judge_extraction(problem, found, warnings)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp) :: factor
      integer :: i, k

      k = found%posterior%n_constants
      call judge_coverage(found%posterior%prior%share_inside, warnings)
      do i = 1, size(found%names)
         call judge_mixing(trim(found%names(i)), found%parameters(i)%diagnostics, size(found%chains%draws, 3), &
            & problem%settings%sampler%method, warnings)
      end do
      call judge_ridges(found%names(:k), found%correlation, found%combinations, warnings)
      do i = 1, k
         call judge_bound(trim(found%names(i)), found%chains%draws(i, :, :), found%posterior%prior%lower(i), &
            & found%posterior%prior%upper(i), warnings)
      end do
      factor = 1.0_wp
      if (size(found%names) > k) factor = found%parameters(k + 1)%mean
      call judge_grains(found%posterior%measured, found%expected, factor*found%posterior%sd, &
         & problem%settings%measurements%likelihood, warnings)
   end subroutine judge_extraction
end module extraction_document
