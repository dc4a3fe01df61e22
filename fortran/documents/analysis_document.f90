!> The results of Step 2: the document of `extract`, with warnings; and posterior.bin, which has all
!> numbers by name, see `put_analysis`.
module analysis_document
   use constants_prior, only: prior_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use diagnostics, only: is_usable
   use errors, only: error_type, refuse
   use analysis, only: analysis_type
   use files, only: file_exists
   use json, only: json_type
   use kinds, only: i8, nan, wp
   use resolved_namelist, only: resolved_text
   use model_evidence, only: log_mass
   use named_values, only: named_values_reader_type, named_values_type, restore
   use observables, only: path_names, surface_path
   use posterior_diagnostics, only: known_text, powers_text
   use posterior_summary, only: correlate
   use statistics, only: flattened, moments
   use text, only: add_line, fixed, join, line_type, to_text
   use variance_shares, only: error_sources, shares_type, verdict_of
   implicit none
   private
   public :: write_analysis, describe_prior, put_analysis, save_posterior, read_posterior, &
      & stored_draws

   character(len=*), parameter :: posterior_file = '/posterior.bin'
   !> Version of the format of posterior.bin, and its values with their axes, see `restore`. Values
   !> with the axis 'kept' are those of every draw in 'stride'.
   integer, parameter :: posterior_format = 2
   character(len=*), parameter :: posterior_forms(*) = [character(len=36) :: 'format, i', &
      & 'inputs, t', 'document, t', 'resolved, t', 'symmetry, t', 'title, t', 'modulus_kind, t', &
      & 'euler_deg, n, angle, grain', 'modulus_gpa, r, grain', 'sd_gpa, n, grain', 'n_moduli, i', &
      & 'draws, r, parameter, sample, chain', 'log_density, r, sample, chain', &
      & 'acceptance, r, chain', 'prior_draws, r, parameter, draw, run', &
      & 'predicted, r, grain, kept, chain', 'factor, r, group, kept, chain', &
      & 'quantities, r, quantity, kept, chain', 'stride, i', &
      & 'log_likelihood, r, grain, kept, chain', 'replicated, r, grain, kept, chain', &
      & 'log_prior, r, kept, chain', 'most_probable, n, parameter', 'lower, n, constant', &
      & 'upper, n, constant', 'anisotropy_cap, r', 'share_inside, r']

contains

   !> Write the document into the object of a `page`.
   subroutine write_analysis(found, page)
      type(analysis_type), intent(inout) :: found
      type(json_type), intent(inout) :: page
      integer :: i

      call page%put('usable', is_usable(found%warnings))
      call page%begin_array('reasons')
      do i = 1, size(found%warnings)
         if (found%warnings(i)%severity() == 'unusable') then
            call page%put('', found%warnings(i)%message())
         end if
      end do
      call page%end_array()
      call write_parameters(page, found)
      call page%put('correlation', correlate(found%chains, found%posterior%n_constants))
      if (allocated(found%theory_mean)) then
         call page%begin_object('theory_alone')
         do i = 1, size(found%theory_mean)
            call page%put_numbers('mean, sd', [found%theory_mean(i), found%theory_sd(i)], &
               & trim(found%names(i)))
         end do
         call page%end_object()
      end if
      call write_laboratory(page, found)
      call write_assumptions()
      call write_predicted(page, found)
      call write_identifiability(page, found)
      call write_prior(page, found)
      call page%begin_object('checks')
      associate (diagnosis => found%diagnosis)
         call page%put_numbers('chi_square, freedom, p, factor, order_log_odds, log_z', &
            & [diagnosis%chi_square, diagnosis%freedom, diagnosis%p, diagnosis%factor, &
            & diagnosis%order_odds, diagnosis%stated%fit%log_z], 'misfit')
      end associate
      call page%end_object()
      call write_diagnosis()
      if (found%field_degree > 0) then
         call page%begin_object('theory')
         call page%put('degree', found%field_degree)
         call page%put('largest_error_sd', found%field_error)
         call page%end_object()
      end if
      if (allocated(found%problem%data%velocities)) then
         call page%put('velocities_left_out', found%problem%data%measurements%omitted)
      end if
      call page%put('acceptance', sum(found%chains%acceptance)/size(found%chains%acceptance))
      call page%put('samples', size(found%chains%draws, 2))
      call page%put('chains', size(found%chains%draws, 3))
      call page%put('method', found%problem%settings%sampler%method)
      if (allocated(found%chains%estimates)) then
         associate (estimates => found%chains%estimates)
            call page%put_numbers('pareto_k, log_evidence, log_evidence_sd', &
               & [maxval(estimates%pareto_k), &
               & sum(estimates%log_integral)/size(estimates) - log_mass(found%posterior), &
               & norm2(estimates%log_integral_error)/size(estimates)], 'independent_draws')
         end associate
      end if
      call page%put('seconds', found%seconds)

   contains

      !> Write the assumptions that no measurement can refute. The text names the constant that
      !> would change most, relative to its sd.
      subroutine write_assumptions()
         integer :: i, k, digits

         call page%begin_array('assumptions')
         do i = 1, size(found%assumptions)
            associate (assumption => found%assumptions(i), constants => found%parameters)
               call page%begin_object('')
               call page%put('assumption', assumption%name)
               if (assumption%size > 0.0_wp) call page%put('size', assumption%size)
               call page%put_numbers(join(found%names(:size(assumption%shift)), ', '), &
                  & assumption%shift, 'shift')
               call page%put('included', assumption%included)
               k = maxloc(abs(assumption%shift)/constants(:size(assumption%shift))%sd, dim=1)
               if (k > 0) then
                  digits = merge(0, 1, abs(assumption%shift(k)) >= 1.0_wp)
                  call page%put('text', 'If '//assumption%condition//', '//trim(found%names(k))// &
                     & ' is '//fixed(constants(k)%mean + assumption%shift(k), digits)//', not ' &
                     & //fixed(constants(k)%mean, digits)//' GPa.')
               end if
               call page%end_object()
            end associate
         end do
         call page%end_array()
      end subroutine write_assumptions

      !> Write the other explanations of the measurements, the most probable first.
      subroutine write_diagnosis()
         integer :: i, j

         call page%begin_array('diagnosis')
         do i = 1, size(found%diagnosis%rivals)
            associate (rival => found%diagnosis%rivals(i))
               call page%begin_object('')
               call page%put('explanation', rival%explanation)
               call page%put('group', rival%group)
               call page%put('log_odds', rival%log_odds)
               call page%begin_object('constants')
               do j = 1, size(rival%mean)
                  call page%put_numbers('mean, sd', [rival%mean(j), rival%sd(j)], rival%names(j))
               end do
               call page%end_object()
               call page%put('remedy', rival%remedy)
               call page%end_object()
            end associate
         end do
         call page%end_array()
      end subroutine write_diagnosis
   end subroutine write_analysis

   !> Write the parameters, and the part of each source in the variance of each parameter. The known
   !> quantities are sources, too.
   subroutine write_parameters(page, found)
      type(json_type), intent(inout) :: page
      type(analysis_type), intent(in) :: found
      logical, allocatable :: same(:)
      integer :: i, j, k

      call page%begin_object('parameters')
      do i = 1, size(found%names)
         associate (parameter => found%parameters(i), d => found%parameters(i)%diagnostics)
            call page%begin_object(trim(found%names(i)))
            call page%put_numbers('mean, sd, map', &
               & [parameter%mean, parameter%sd, found%most_probable(i)])
            call page%put('hdi_95', parameter%hdi_95)
            call page%put('median', parameter%quantiles(3))
            call page%put('quantiles', parameter%quantiles)
            call page%put_numbers('ess_bulk, ess_tail, r_hat', [d%ess_bulk, d%ess_tail, d%r_hat])
            call write_share(page, found%parameter_shares(i), found%verdict(i))
            call page%end_object()
         end associate
      end do
      call page%end_object()
      call page%begin_object('error_budget')
      do i = 1, size(found%names)
         associate (share => found%parameter_shares(i), &
            & known => found%posterior%prior%knowledge%quantities)
            call page%begin_object(trim(found%names(i)))
            call page%put_numbers(join(error_sources, ', '), share%by_source)
            do j = 1, size(known)
               ! The list of &knowledge and its file may name the same quantity: add both parts.
               same = [(known(k)%name == known(j)%name, k=1, size(known))]
               if (findloc(same, .true., 1) == j) then
                  call page%put(known(j)%name, sum(share%by_quantity, mask=same))
               end if
            end do
            if (found%posterior%infers_contrast) call page%put('contrast', share%contrast)
            call page%put('prior', share%prior - share%contrast)
            call page%end_object()
         end associate
      end do
      call page%end_object()
   end subroutine write_parameters

   !> Write mean and sd of factor and contrast of the laboratory, in the posterior and in the prior.
   subroutine write_laboratory(page, found)
      type(json_type), intent(inout) :: page
      type(analysis_type), intent(in) :: found
      real(wp), dimension(found%posterior%n_groups) :: mean, sd
      real(wp), dimension(1) :: contrast_mean, contrast_sd
      integer :: i, k

      k = found%posterior%n_constants
      call page%begin_object('laboratory')
      call page%put('technique', found%posterior%settings%technique)
      associate (laboratory => found%posterior%laboratory)
         call moments(log(flattened(found%predictions%factor)), mean, sd)
         call page%begin_array('log_factor')
         do i = 1, size(mean)
            call page%put_numbers('mean, sd, prior_mean, prior_sd', [mean(i), sd(i), &
               & laboratory%mean(i), laboratory%sd(i)], '')
         end do
         call page%end_array()
         contrast_mean = laboratory%contrast(1)
         contrast_sd = laboratory%contrast(2)
         if (found%posterior%infers_contrast) then
            ! It is the parameter after the constants.
            call moments(log(flattened(found%chains%draws(k + 1:k + 1, :, :))), contrast_mean, &
               & contrast_sd)
         end if
         call page%put_numbers('mean, sd, prior_mean, prior_sd', [contrast_mean, contrast_sd, &
            & laboratory%contrast], 'log_contrast')
      end associate
      call page%end_object()
   end subroutine write_laboratory

   !> Write the shares in the variance of a quantity, and the verdict: whether it is determined.
   subroutine write_share(page, share, verdict)
      type(json_type), intent(inout) :: page
      type(shares_type), intent(in) :: share
      character(len=*), intent(in) :: verdict

      call page%put_numbers('measurements, knowledge, prior', &
         & [share%measurements, share%knowledge, share%prior], 'share')
      call page%put('verdict', verdict)
   end subroutine write_share

   !> Write the measurements and their predictions.
   subroutine write_predicted(page, found)
      type(json_type), intent(inout) :: page
      type(analysis_type), intent(in) :: found
      real(wp), dimension(found%posterior%n_grains) :: mean, sd
      integer :: i

      call moments(flattened(found%predictions%moduli), mean, sd)
      call page%begin_array('predicted')
      associate (table => found%problem%data%measurements)
         do i = 1, found%posterior%n_grains
            call page%begin_object('')
            call page%put_numbers('mean, sd, measured, measured_sd', &
               & [mean(i), sd(i), found%posterior%data%modulus(i), &
               & merge(table%sd_gpa(i), nan, table%sd_gpa(i) > 0.0_wp)])
            if (.not. allocated(found%posterior%unknown)) then
               call page%put('euler_deg', table%euler_deg(:, i))
            end if
            associate (path => table%paths(i))
               if (path%is_speed()) call page%put('propagation_deg', path%propagation_deg)
               if (path%kind > surface_path) call page%put('wave', trim(path_names(path%kind)))
               if (path%inclination_deg > 0.0_wp) then
                  call page%put('inclination_deg', path%inclination_deg)
               end if
            end associate
            if (table%named_by > 0) call page%put('grain', table%name(i))
            if (allocated(table%tests) .and. i <= found%posterior%n_moduli) then
               call page%put('tests', table%tests(i))
               call page%put('chi_square_of_tests', table%chi_square(i))
            end if
            call page%end_object()
         end do
      end associate
      call page%end_array()
   end subroutine write_predicted

   !> Write combinations of the constants, quantities in the posterior and in the prior, and the
   !> expected gains from further knowledge.
   subroutine write_identifiability(page, found)
      type(json_type), intent(inout) :: page
      type(analysis_type), intent(in) :: found
      character(len=:), allocatable :: names
      integer :: i

      names = join(found%names, ', ')
      call page%begin_array('identifiability')
      do i = 1, size(found%combinations)
         associate (combination => found%combinations(i), share => found%combination_shares(i))
            call begin('combination', &
               & powers_text(found%names(:size(found%combinations)), combination%exponents))
            call page%put_numbers(names, combination%exponents, 'exponents')
            call page%put_numbers('sd, prior_sd', [combination%sd, combination%prior_sd])
            ! This sd is that of a logarithm, and so relative.
            call write_share(page, share, verdict_of(1.0_wp, combination%sd, 1.0_wp, share))
            call page%end_object()
         end associate
      end do
      do i = 1, size(found%quantities)
         ! Posterior mean and sd, prior mean and sd.
         associate (summary => found%quantity_moments(:, i))
            call begin('quantity', found%quantities(i)%name)
            call page%put('unit', found%quantities(i)%unit)
            call page%put_numbers('mean, sd, prior_mean, prior_sd', summary)
            call write_share(page, found%quantity_shares(i), verdict_of(summary(1), summary(2), &
               & merge(found%least_value(), 0.0_wp, found%quantities(i)%unit == 'GPa'), &
               & found%quantity_shares(i)))
            call page%end_object()
         end associate
      end do
      do i = 1, size(found%gains)
         associate (gain => found%gains(i))
            call begin('knowledge', trim(gain%name))
            call page%put('relative_sd', gain%relative_sd)
            if (gain%known_sd > 0.0_wp) call page%put('known_sd', gain%known_sd)
            call page%put_numbers(names, gain%sd_then, 'sd_then')
            call page%end_object()
         end associate
      end do
      call page%end_array()

   contains

      !> Begin an object of the array.
      subroutine begin(kind, name)
         character(len=*), intent(in) :: kind, name

         call page%begin_object('')
         call page%put('kind', kind)
         call page%put('name', name)
      end subroutine begin
   end subroutine write_identifiability

   !> Write the prior with its defaults, and the knowledge: each known quantity, and its conflict in
   !> sds with all other information.
   subroutine write_prior(page, found)
      type(json_type), intent(inout) :: page
      type(analysis_type), intent(in) :: found
      type(line_type), allocatable :: lines(:)
      real(wp) :: sd(size(found%conflict%of_quantity))
      integer :: j

      call page%begin_object('prior')
      call page%put('share_covered', found%posterior%prior%share_inside)
      associate (known => found%posterior%prior%knowledge)
         call page%begin_array('knowledge')
         sd = known%sd()
         do j = 1, size(sd)
            call page%begin_object('')
            call page%put('name', known%quantities(j)%name)
            call page%put('unit', known%quantities(j)%unit)
            call page%put_numbers('mean, sd, conflict_sd', &
               & [known%mean(j), sd(j), found%conflict%of_quantity(j)])
            call page%end_object()
         end do
         call page%end_array()
      end associate
      call page%put('conflict_sd', found%conflict%sds)
      call page%put('density', density_lines(found%posterior%prior))
      call page%put('surrogate', surrogate_text(found))
      call describe_prior(found, lines)
      call page%put('words', lines)
      call page%end_object()
   end subroutine write_prior

   !> Describe in a few lines what determines the result: the measurements, the density and the
   !> limits of the prior, its bounds, the knowledge, and the surrogate.
   subroutine describe_prior(found, lines)
      type(analysis_type), intent(in) :: found
      type(line_type), allocatable, intent(out) :: lines(:)
      character(len=:), allocatable :: line
      integer :: j

      allocate (lines(0))
      associate (posterior => found%posterior, prior => found%posterior%prior)
         line = ''
         if (allocated(posterior%unknown)) line = ' of unknown orientation'
         if (posterior%n_moduli > 0) then
            call add_line(lines, 'measured: '//posterior%observable%name//' of ' &
               & //to_text(posterior%n_moduli)//' grains'//line//', technique ' &
               & //posterior%settings%technique)
         end if
         if (posterior%n_moduli < posterior%n_grains) then
            call add_line(lines, 'measured: speeds of waves in ' &
               & //to_text(posterior%n_grains - posterior%n_moduli)//' directions')
         end if
         lines = [lines, density_lines(prior)]
         line = ''
         do j = 1, size(prior%knowledge%mean)
            line = line//', '//known_text(prior%knowledge, j)
         end do
         if (len(line) > 0) call add_line(lines, 'known: '//line(3:))
      end associate
      call add_line(lines, 'surrogate: '//surrogate_text(found))
   end subroutine describe_prior

   !> The density of the prior with its limits, and its bounds, if it has any.
   function density_lines(prior) result(lines)
      type(prior_type), intent(in) :: prior
      type(line_type), allocatable :: lines(:)
      character(len=:), allocatable :: line
      integer :: j

      if (prior%has_default) then
         line = 'the default prior of crystals: log(3K/2G) is 1.07 ± 0.6, the anisotropy ' &
            & //'follows Student''s t, and the scale is that of the mean measurement within a ' &
            & //'factor of 5'
      else
         line = 'uniform in '//trim(merge('log K        ', 'the constants', &
            & prior%in_logarithms))//' over stable crystals'
      end if
      if (prior%anisotropy_cap < huge(prior%anisotropy_cap)) then
         line = line//', anisotropy index (Eq. 14) up to '//to_text(prior%anisotropy_cap)
      end if
      allocate (lines(0))
      call add_line(lines, line)
      line = ''
      do j = 1, prior%n_constants
         if (.not. prior%has_bound(j)) cycle
         line = line//', '//prior%class%constants(j)//' '
         if (.not. prior%has_lower(j)) then
            line = line//'up to '//to_text(prior%upper(j))
         else if (.not. prior%has_upper(j)) then
            line = line//'above '//to_text(prior%lower(j))
         else
            line = line//to_text(prior%lower(j))//' .. '//to_text(prior%upper(j))
         end if
      end do
      if (len(line) > 0) call add_line(lines, 'bounds in GPa: '//line(3:))
   end function density_lines

   !> The theory and the simulations on which the predictions are based.
   function surrogate_text(found) result(line)
      type(analysis_type), intent(in) :: found
      character(len=:), allocatable :: line
      integer :: simulations

      line = ''
      simulations = size(found%surrogate%simulations%modulus)
      if (found%field_degree > 0) then
         line = 'the exact theory of the half-space, harmonics to degree ' &
            & //to_text(found%field_degree)//', the worst grain off by ' &
            & //fixed(100.0_wp*found%field_error, 1)//' % of its sd'
      end if
      if (simulations == 0) return
      if (len(line) > 0) line = line//'; times a correction trained on '
      line = line//to_text(simulations)//' simulations'
      associate (checksum => found%surrogate%checksum)
         if (len_trim(checksum) > 0) line = line//', checksum '//checksum
      end associate
      line = line//', sd '//fixed(found%surrogate_sd, 2) &
         & //' GPa in the mean grain; it is valid for ' &
         & //fixed(100.0_wp*found%posterior%prior%share_inside, 0)//' % of the prior'
   end function surrogate_text

   !> Put the `document`, the problem and all numbers, see `posterior_forms` for their axes. In
   !> 'most_probable' a parameter is NaN outside its interval of 95 %. 'predicted' and 'replicated'
   !> are values of the measurements, 'lower' and 'upper' are bounds of the prior.
   subroutine put_analysis(found, document, out)
      type(analysis_type), intent(in) :: found
      !> JSON.
      character(len=*), intent(in) :: document
      type(named_values_type), intent(inout) :: out

      call out%put('document', document)
      call out%put('resolved', resolved_text(found%problem))
      call out%put('symmetry', trim(found%problem%class%name))
      call out%put('title', found%problem%settings%problem%title)
      call out%put('modulus_kind', found%problem%settings%measurements%modulus_kind)
      associate (measured => found%problem%data%measurements)
         call out%put('euler_deg', merge(nan, measured%euler_deg, &
            & allocated(found%posterior%unknown)))
         call out%put('modulus_gpa', measured%modulus_gpa)
         call out%put('sd_gpa', measured%sd_gpa)
         call out%put('n_moduli', found%posterior%n_moduli)
      end associate
      associate (chains => found%chains, checks => found%checks, predictions => found%predictions, &
         & prior => found%posterior%prior)
         call out%put('draws', chains%draws)
         call out%put('log_density', chains%log_density)
         call out%put('acceptance', chains%acceptance)
         call out%put('prior_draws', found%prior_chains%draws)
         call out%put('predicted', predictions%moduli)
         call out%put('factor', predictions%factor)
         call out%put('quantities', predictions%quantities)
         call out%put('stride', predictions%stride)
         call out%put('log_likelihood', checks%log_likelihood)
         call out%put('replicated', checks%replicated)
         call out%put('log_prior', checks%log_prior)
         call out%put('most_probable', found%most_probable)
         call out%put('lower', prior%lower)
         call out%put('upper', prior%upper)
         call out%put('anisotropy_cap', prior%anisotropy_cap)
         call out%put('share_inside', prior%share_inside)
      end associate
   end subroutine put_analysis

   !> Write posterior.bin into a `folder`, with the `inputs` from which the results were computed.
   subroutine save_posterior(found, document, folder, inputs, error)
      type(analysis_type), intent(in) :: found
      character(len=*), intent(in) :: document, folder, inputs
      type(error_type), allocatable, intent(out) :: error
      type(named_values_type) :: values

      call values%put('format', posterior_format)
      call values%put('inputs', inputs)
      call put_analysis(found, document, values)
      call values%store(folder//posterior_file, error)
   end subroutine save_posterior

   !> Read the `content` of posterior.bin in a folder, without the checksum at its end, and refuse
   !> sizes that contradict each other. See `restore`.
   subroutine read_posterior(folder, content, error)
      character(len=*), intent(in) :: folder
      character(len=:), allocatable, target, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: remedy = 'run bayesindent extract or bayesindent run again'
      type(named_values_reader_type) :: values
      type(crystal_class_type) :: class
      integer :: n_chains, n_samples, n_kept

      call restore(folder//posterior_file, posterior_format, posterior_forms, remedy, content, &
         & error)
      if (allocated(error)) return
      call values%look_at(content)
      call new_crystal_class(values%text('symmetry'), class, error)
      n_chains = max(1, size(values%reals('acceptance')))
      n_samples = size(values%reals('log_density'))/n_chains
      n_kept = size(values%reals('log_prior'))/n_chains
      ! Every draw in `stride` is kept: n_samples/stride of a chain, rounded up.
      associate (n => class%n_constants, stride => int(values%integer('stride'), i8))
         if (allocated(error) .or. n /= size(values%reals('lower')) .or. n_samples == 0 &
            & .or. size(values%reals('most_probable')) < n .or. n_samples > n_kept*stride &
            & .or. n_samples <= (n_kept - 1)*stride) then
            call refuse(error, folder//posterior_file//': is damaged (its sizes contradict each ' &
               & //'other); '//remedy)
         end if
      end associate
   end subroutine read_posterior

   !> Read the draws (parameter, draw) in a folder if they were computed from these inputs. A
   !> damaged file is refused.
   subroutine stored_draws(folder, inputs, dimension, draws, error)
      character(len=*), intent(in) :: folder, inputs
      !> Number of parameters.
      integer, intent(in) :: dimension
      real(wp), allocatable, intent(out) :: draws(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(named_values_reader_type) :: values
      character(len=:), allocatable, target :: content

      if (.not. file_exists(folder//posterior_file)) return
      call read_posterior(folder, content, error)
      if (allocated(error)) return
      call values%look_at(content)
      if (values%text('inputs') == inputs) draws = values%columns('draws', dimension)
   end subroutine stored_draws

end module analysis_document
