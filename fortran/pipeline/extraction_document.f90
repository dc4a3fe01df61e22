!> What Step 2 found, as the document of `extract`, with what a person should know of it.
!>
!> And posterior.bin: all numbers of Step 2 by their names, see `put_extraction`, with a checksum of all before it at the end.
module extraction_document
   use, intrinsic :: iso_c_binding, only: c_char
   use constants_prior, only: prior_type
   use errors, only: error_type, refuse, warn, warning_type
   use extraction, only: extraction_type
   use files, only: checksum, file_exists, read_bytes, replace_file
   use json, only: json_type
   use kinds, only: wp
   use named_values, only: named_values_reader_type, named_values_type
   use orientation_check, only: readings
   use posterior_diagnostics, only: check_extraction, find_reasons, known_text, powers_text
   use problem, only: problem_type
   use text, only: fixed, join, to_text
   use variance_shares, only: error_sources, shares_type, verdict_of
   implicit none
   private
   public :: write_extraction, describe_prior, put_extraction, save_posterior, read_posterior, stored_draws

   character(len=*), parameter :: name = '/posterior.bin'
   integer, parameter :: digits = 16

contains

   !> The document, as JSON.
   function write_extraction(problem, found) result(text)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      character(len=:), allocatable :: text
      type(json_type) :: document
      type(warning_type), allocatable :: warnings(:), lines(:), reasons(:)
      integer :: i

      call find_reasons(found, reasons)
      call document%begin_object()
      call document%put('usable', size(reasons) == 0)
      call document%put('reasons', reasons)
      call write_parameters(document, found)
      call write_budget(document, found)
      call write_ends(document, found)
      call document%put('correlation', found%correlation)
      if (size(found%theory_mean) > 0) then
         call document%begin_object('theory_alone')
         do i = 1, size(found%theory_mean)
            call document%put_numbers('mean, sd', [found%theory_mean(i), found%theory_sd(i)], trim(found%names(i)))
         end do
         call document%end_object()
      end if
      call write_predicted(document, problem, found)
      call write_identifiability(document, found)
      call document%begin_object('prior')
      call write_limits(document, found%posterior%prior)
      call write_knowledge(document, found)
      call describe_prior(found, lines)
      call document%put('words', lines)
      call document%end_object()
      call document%begin_object('checks')
      associate (checks => found%checks)
         call document%put('draws', size(checks%log_prior))
         call document%put_numbers('mean, p', [checks%chi_square, checks%chi_square_p], 'chi_square')
         call document%begin_object('extreme_grain')
         call document%put('grain', checks%extreme_grain)
         call document%put_numbers('residual_sd, p', [checks%extreme_residual, checks%extreme_p])
         call document%end_object()
      end associate
      associate (check => found%orientations)
         call document%begin_object('orientations')
         call document%put_numbers('constant_chi_square, chi_square, freedom, p, p_shuffled, power', [check%constant, &
            & check%chi_square, real(check%freedom, wp), check%p, check%p_shuffled, check%power])
         call document%put('better_reading', trim(readings(check%better)))
         call document%put('outliers', real(check%outliers, wp))
         call document%put('distances_sd', check%distances)
         call document%end_object()
      end associate
      call document%end_object()
      if (allocated(found%evidence)) call document%put_numbers('log_z, sd', [found%evidence%log_z, found%evidence%sd], 'evidence')
      call write_changes(document, found)
      if (found%field_degree > 0) then
         call document%begin_object('theory')
         call document%put('degree', found%field_degree)
         call document%put('largest_error_sd', found%field_error)
         call document%end_object()
      end if
      if (allocated(problem%velocities)) call document%put('velocities_left_out', problem%measurements%omitted)
      call document%put('acceptance', sum(found%chains%acceptance)/size(found%chains%acceptance))
      call document%put('samples', size(found%chains%draws, 2))
      call document%put('chains', size(found%chains%draws, 3))
      call document%put('method', problem%settings%sampler%method)
      call document%put('seconds', found%seconds)
      warnings = problem%warnings
      call check_extraction(problem, found, warnings)
      call document%put('warnings', warnings)
      call document%end_object()
      text = document%text()
   end function write_extraction

   subroutine write_parameters(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      integer :: i

      call document%begin_object('parameters')
      do i = 1, size(found%names)
         associate (parameter => found%parameters(i), d => found%parameters(i)%diagnostics)
            call document%begin_object(trim(found%names(i)))
            call document%put_numbers('mean, sd, map', [parameter%mean, parameter%sd, found%most_probable(i)])
            call document%put('hdi_95', parameter%hdi_95)
            call document%put_numbers('ess_bulk, ess_tail, r_hat', [d%ess_bulk, d%ess_tail, d%r_hat])
            call write_share(document, found%parameter_shares(i), found%verdict(i))
            call document%end_object()
         end associate
      end do
      call document%end_object()
   end subroutine write_parameters

   !> Who decided a quantity, and whether it is determined.
   subroutine write_share(document, share, verdict)
      type(json_type), intent(inout) :: document
      type(shares_type), intent(in) :: share
      character(len=*), intent(in) :: verdict

      call document%put_numbers('measurements, knowledge, prior', [share%measurements, share%knowledge, share%prior], 'share')
      call document%put('verdict', verdict)
   end subroutine write_share

   !> The parts of the variance of each parameter, by source; of what is known each quantity is one.
   subroutine write_budget(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      integer :: i, j

      call document%begin_object('error_budget')
      do i = 1, size(found%names)
         associate (share => found%parameter_shares(i), known => found%posterior%prior%knowledge%quantities)
            call document%begin_object(trim(found%names(i)))
            do j = 1, size(error_sources)
               call document%put(trim(error_sources(j)), share%by_source(j))
            end do
            do j = 1, size(known)
               call document%put(known(j)%name, share%by_quantity(j))
            end do
            call document%put('prior', share%prior)
            call document%end_object()
         end associate
      end do
      call document%end_object()
   end subroutine write_budget

   !> The limits that end the draws.
   subroutine write_ends(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      integer :: i, side

      call document%begin_array('limits')
      do i = 1, size(found%limits)
         associate (limit => found%limits(i))
            do side = 1, 2
               if (.not. limit%ends(side)) cycle
               call document%begin_object()
               call document%put('name', trim(limit%name))
               call document%put('side', merge('upper', 'lower', side == 2))
               call document%put('stated', limit%stated)
               call document%put_numbers('value, share', [limit%range(side), limit%share(side)])
               call document%end_object()
            end do
         end associate
      end do
      call document%end_array()
   end subroutine write_ends

   subroutine write_predicted(document, problem, found)
      type(json_type), intent(inout) :: document
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      integer :: i

      call document%begin_array('predicted')
      associate (table => problem%measurements)
         do i = 1, found%posterior%n_grains
            call document%begin_object()
            call document%put_numbers('mean, sd, measured, measured_sd', [found%predicted_mean(i), found%predicted_sd(i), &
               & found%posterior%data%modulus(i), found%posterior%data%sd(i)])
            call document%put('euler_deg', table%euler_deg(:, i))
            if (i > found%posterior%n_moduli) call document%put('propagation_deg', table%propagation_deg(i))
            if (table%named_by > 0) call document%put('grain', table%name(i))
            if (allocated(table%tests) .and. i <= found%posterior%n_moduli) then
               call document%put('tests', table%tests(i))
               call document%put('chi_square_of_tests', table%chi_square(i))
            end if
            call document%end_object()
         end do
      end associate
      call document%end_array()
   end subroutine write_predicted

   !> Combinations of the constants, quantities in the posterior and in the prior, and what further knowledge would bring.
   subroutine write_identifiability(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      !> Of a quantity, and some of a combination.
      character(len=:), allocatable :: names
      integer :: i

      names = join(found%names, ', ')
      call document%begin_array('identifiability')
      do i = 1, size(found%combinations)
         associate (combination => found%combinations(i), share => found%combination_shares(i))
            call begin('combination', powers_text(found%names(:size(found%combinations)), combination%exponents))
            call document%put_numbers(names, combination%exponents, 'exponents')
            call document%put_numbers(names, combination%correlations, 'correlations')
            call document%put_numbers('sd, prior_sd', [combination%sd, combination%prior_sd])
            call write_share(document, share, verdict_of(1.0_wp, combination%sd, 1.0_wp, share))
            call document%end_object()
         end associate
      end do
      do i = 1, size(found%quantities)
         associate (known => found%known(:, i))
            call begin('quantity', found%quantities(i)%name)
            call document%put('unit', found%quantities(i)%unit)
            call document%put_numbers('mean, sd, prior_mean, prior_sd', known)
            call write_share(document, found%quantity_shares(i), verdict_of(known(1), known(2), &
               & merge(found%least_value(), 0.0_wp, found%quantities(i)%unit == 'GPa'), found%quantity_shares(i)))
            call document%end_object()
         end associate
      end do
      do i = 1, size(found%gains)
         call begin('knowledge', trim(found%gains(i)%name))
         call document%put('relative_sd', found%gains(i)%relative_sd)
         call document%put_numbers(names, found%gains(i)%sd_then, 'sd_then')
         call document%end_object()
      end do
      call document%end_array()

   contains

      subroutine begin(kind, name)
         character(len=*), intent(in) :: kind, name

         call document%begin_object()
         call document%put('kind', kind)
         call document%put('name', name)
      end subroutine begin
   end subroutine write_identifiability

   !> What other priors would have said; null where too few draws tell.
   subroutine write_changes(document, found)
      type(json_type), intent(inout) :: document
      type(extraction_type), intent(in) :: found
      integer :: i

      call document%begin_array('sensitivity')
      do i = 1, size(found%changes)
         associate (change => found%changes(i))
            call document%begin_object()
            call document%put('name', trim(change%name))
            if (change%name /= 'measure') then
               call document%put('side', merge('upper', 'lower', change%is_upper))
               call document%put_numbers('from, to', [change%from, change%to])
            end if
            call document%put('exact', change%exact)
            call document%put('effective_draws', change%effective)
            call document%put_numbers(join(found%names, ', '), change%shift, 'shift_sd')
            call document%put_numbers(join(found%names, ', '), change%sd_ratio, 'sd_ratio')
            call document%end_object()
         end associate
      end do
      call document%end_array()
   end subroutine write_changes

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
            call document%put_numbers('mean, sd, conflict_sd', [known%mean(j), sd(j), found%conflict%of_quantity(j)])
            call document%end_object()
         end do
         call document%end_array()
         call document%put('conflict_sd', found%conflict%sds)
      end associate
   end subroutine write_knowledge

   !> The prior that was in effect, what was not stated too; null where there is no limit.
   subroutine write_limits(document, prior)
      type(json_type), intent(inout) :: document
      type(prior_type), intent(in) :: prior
      integer :: j

      call document%put('measure', prior%measure())
      call document%begin_object('bounds')
      do j = 1, prior%n_constants
         if (prior%is_stated(j)) call document%put(prior%class%constants(j), [prior%lower(j), prior%upper(j)])
      end do
      call document%end_object()
      call document%put_if(prior%anisotropy_cap < huge(1.0_wp), 'anisotropy_cap', prior%anisotropy_cap)
      call document%put('share_covered', prior%share_inside)
   end subroutine write_limits

   !> What the result follows from, in a few lines for people: the measurements; measure and limits of the prior; bounds; what is known;
   !> the surrogate; the evidence, which depends on all of these.
   subroutine describe_prior(found, lines)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(out) :: lines(:)
      character(len=:), allocatable :: line
      integer :: j

      allocate (lines(0))
      call warn(lines, 'measured: '//found%posterior%observable%name//' of '//to_text(found%posterior%n_moduli)//' grains')
      if (found%posterior%n_moduli < found%posterior%n_grains) call warn(lines, 'measured: Rayleigh velocity in ' &
         & //to_text(found%posterior%n_grains - found%posterior%n_moduli)//' directions')
      associate (prior => found%posterior%prior)
         if (prior%has_default) then
            line = 'the default prior of crystals: log(3K/2G) is 1.07 ± 0.6, the anisotropy follows Student''s t, and the ' &
               & //'scale is that of the mean measurement within a factor of 5'
         else
            line = 'uniform in '//trim(merge('log K        ', 'the constants', prior%in_logarithms))//' over stable crystals'
         end if
         if (prior%anisotropy_cap < huge(prior%anisotropy_cap)) line = line//', anisotropy index (Eq. 14) up to ' &
            & //to_text(prior%anisotropy_cap)
         call warn(lines, line)
         line = ''
         do j = 1, prior%n_constants
            if (prior%is_stated(j)) line = line//', '//prior%class%constants(j)//' '//to_text(prior%lower(j))//' .. ' &
               & //to_text(prior%upper(j))
         end do
         if (len(line) > 0) call warn(lines, 'bounds in GPa: '//line(3:))
         line = ''
         do j = 1, size(prior%knowledge%mean)
            line = line//', '//known_text(prior%knowledge, j)
         end do
         if (len(line) > 0) call warn(lines, 'known: '//line(3:))
      end associate
      call warn(lines, 'surrogate: '//surrogate_text(found))
      if (allocated(found%evidence)) call warn(lines, 'evidence: log Z = '//fixed(found%evidence%log_z, 2)//' ± ' &
         & //fixed(found%evidence%sd, 2)//', to compare with other models of the same data. It depends on the limits above: ' &
         & //'where the measurements determine the constants, a prior twice as wide has a log Z that is lower by 0.69')
   end subroutine describe_prior

   function surrogate_text(found) result(text)
      type(extraction_type), intent(in) :: found
      character(len=:), allocatable :: text

      text = ''
      if (found%field_degree > 0) text = 'the exact theory of the half-space, harmonics to degree '//to_text(found%field_degree) &
         & //', the worst grain off by '//fixed(100.0_wp*found%field_error, 1)//' % of its sd'
      if (found%simulations == 0) return
      if (len(text) > 0) text = text//'; times a correction trained on '
      text = text//to_text(found%simulations)//' simulations'
      if (len_trim(found%checksum) > 0) text = text//', checksum '//found%checksum
      text = text//', sd '//fixed(found%surrogate_sd, 2)//' GPa in the mean grain; it is valid for ' &
         & //fixed(100.0_wp*found%posterior%prior%share_inside, 0)//' % of the prior'
   end function surrogate_text

   !> The `document`, what it is about, and numbers. Chains: 'draws' (parameter, sample, chain), 'log_density' (sample, chain),
   !> 'acceptance' (chain), 'prior_draws'; of some draws, 'stride'
   !> apart, 'predicted', 'log_likelihood', 'replicated' (grain, draw, chain), 'factor' (group, draw, chain), 'quantities' (quantity, draw,
   !> chain), 'log_prior' (draw, chain); of each parameter 'most_probable', NaN where it is outside the interval; and the prior's limits.
   subroutine put_extraction(problem, found, document, out)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      !> JSON.
      character(len=*), intent(in) :: document
      type(named_values_type), intent(inout) :: out

      call out%put('document', document)
      call out%put('resolved', problem%resolved_text())
      call out%put('symmetry', trim(problem%class%name))
      call out%put('title', problem%settings%problem%title)
      call out%put('modulus_kind', problem%settings%measurements%modulus_kind)
      associate (measured => problem%measurements)
         call out%put_array('euler_deg', measured%euler_deg, shape(measured%euler_deg))
         call out%put_array('modulus_gpa', measured%modulus_gpa, [measured%n])
         call out%put_array('sd_gpa', measured%sd_gpa, [measured%n])
         call out%put('n_moduli', found%posterior%n_moduli)
      end associate
      associate (chains => found%chains, checks => found%checks, predictions => found%predictions, prior => found%posterior%prior)
         call out%put_array('draws', chains%draws, shape(chains%draws))
         call out%put_array('log_density', chains%log_density, shape(chains%log_density))
         call out%put_array('acceptance', chains%acceptance, shape(chains%acceptance))
         call out%put_array('prior_draws', found%prior_chains%draws, shape(found%prior_chains%draws))
         call out%put_array('predicted', predictions%moduli, shape(predictions%moduli))
         call out%put_array('factor', predictions%factor, shape(predictions%factor))
         call out%put_array('quantities', predictions%quantities, shape(predictions%quantities))
         call out%put('stride', predictions%stride)
         call out%put_array('log_likelihood', checks%log_likelihood, shape(checks%log_likelihood))
         call out%put_array('replicated', checks%replicated, shape(checks%replicated))
         call out%put_array('log_prior', checks%log_prior, shape(checks%log_prior))
         call out%put_array('most_probable', found%most_probable, shape(found%most_probable))
         call out%put_array('lower', prior%lower, shape(prior%lower))
         call out%put_array('upper', prior%upper, shape(prior%upper))
         call out%put('anisotropy_cap', prior%anisotropy_cap)
         call out%put('share_inside', prior%share_inside)
      end associate
   end subroutine put_extraction
   !> Write the numbers into a `folder`, with the `inputs` that they follow from.
   subroutine save_posterior(problem, found, document, folder, inputs, error)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      character(len=*), intent(in) :: document, folder, inputs
      type(error_type), allocatable, intent(out) :: error
      type(named_values_type) :: values

      call values%put('inputs', inputs)
      call put_extraction(problem, found, document, values)
      associate (content => values%bytes(:values%filled))
         call replace_file(folder//name, content//checksum(content), error)
      end associate
   end subroutine save_posterior

   !> The named values of a folder, as bytes (`content`); refused if they were changed.
   subroutine read_posterior(folder, content, error)
      character(len=*), intent(in) :: folder
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      call read_bytes(folder//name, content, error)
      if (allocated(error)) return
      n = len(content) - digits
      if (n > 0) then
         if (content(n + 1:) == checksum(content(:n))) then
            content = content(:n)
            return
         end if
      end if
      call refuse(error, folder//name//': is damaged, or was changed since it was written; run the command that wrote it again')
   end subroutine read_posterior

   !> The draws (parameter, draw) that were left in a folder, if they follow from these inputs; else none. A damaged file is refused.
   subroutine stored_draws(folder, inputs, dimension, draws, error)
      character(len=*), intent(in) :: folder, inputs
      !> How many parameters there are.
      integer, intent(in) :: dimension
      real(wp), allocatable, intent(out) :: draws(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(named_values_reader_type) :: values
      character(kind=c_char, len=:), allocatable, target :: content
      real(wp), pointer :: found(:, :)

      if (.not. file_exists(folder//name)) return
      call read_posterior(folder, content, error)
      if (allocated(error)) return
      call values%look_at(content)
      if (values%text('inputs') /= inputs) return
      found => values%columns('draws', dimension)
      draws = found
   end subroutine stored_draws

end module extraction_document
