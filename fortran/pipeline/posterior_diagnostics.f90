!> What a person should know of a posterior before using it: reasons for which it cannot be used,
!> and warnings, by consequence.
module posterior_diagnostics
   use constants_prior, only: knowledge_type
   use errors, only: error_type, warn, warning_type
   use extraction, only: extraction_type, unmixed
   use field_reading, only: allowed_error
   use files, only: printable
   use indenters, only: indenter_type, new_indenter
   use kinds, only: pi, wp
   use prior_sensitivity, only: change_type, is_truncated
   use orientation_check, only: readings
   use problem, only: problem_type
   use statistics, only: chi_square_above
   use text, only: fixed, to_text
   implicit none
   private
   public :: check_extraction, find_reasons, known_text, powers_text

   !> Chains have mixed if R-hat is below and the effective sample sizes of a parameter are above
   !> this for each chain (Vehtari et al., Bayesian Anal. 16, 667, 2021).
   real(wp), parameter :: greatest_r_hat = 1.01_wp
   integer, parameter :: least_size = 100
   !> Knowledge that is further off, sds, belongs to another crystal or is in another unit.
   real(wp), parameter :: furthest = 10.0_wp
   !> A bias is small, and two contact radii are alike, below these.
   real(wp), parameter :: small_bias = 0.01_wp, alike = 0.05_wp
   !> Mean contact pressure over the modulus that is taken for elastic: a/R up to 0.08.
   real(wp), parameter :: elastic_pressure = 1.0_wp/30.0_wp
   !> A grain whose neighbours are x times as stiff, x about 1, has x**(slope a/R) times its
   !> modulus: 0.86 to 1.04 for hemispheres of 10 and 20 contact radii among neighbours 0.8 and 1.25
   !> times as stiff (docs/verification/films.md).
   real(wp), parameter :: slope = 0.95_wp

contains

   !> What a person should know, added to `warnings`.
   subroutine check_extraction(problem, found, warnings)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      type(warning_type), allocatable :: reasons(:)
      logical :: blamed

      allocate (reasons(0))
      call check_table(problem, found, warnings, blamed)
      call check_limits(found, .true., warnings)
      if (problem%measurements%omitted > 0) then
         call warn(warnings, &
            & to_text(problem%measurements%omitted)//' of '//to_text(problem%velocities%n) &
            & //' velocities are left out: at crystals of the posterior their wave is within 3 % ' &
            & //'of the slowest bulk wave, or hardly moves along the normal. What is measured ' &
            & //'there is the pseudo-surface wave. Choose other directions')
      end if
      call check_sizes(problem, found, warnings)
      blamed = blamed .or. is_truncated(found%limits)
      if (.not. blamed) call check_knowledge(found, warnings)
      call check_mixing(found, unmixed, 1, reasons)
      if (size(reasons) == 0) then
         call check_mixing(found, greatest_r_hat, size(found%chains%draws, 3), warnings)
      end if
      call check_determined(found, warnings)
      call check_sensitivity(found, warnings)
      if (all(problem%measurements%sd_gpa > 0.0_wp)) call check_scale(found, warnings)
      if (.not. blamed) call check_residuals(found, warnings)
   end subroutine check_extraction

   !> Why the result cannot be used, each with what to do: none, it can be used.
   subroutine find_reasons(found, reasons)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(out) :: reasons(:)
      integer :: j

      allocate (reasons(0))
      call check_limits(found, .false., reasons)
      if (found%orientations%better_reading > 0) then
         call warn(reasons, misread_text(found, 'What explains them: ' &
            & //trim(readings(found%orientations%better_reading)) &
            & //'. Correct the table or the map'))
      end if
      associate (knowledge => found%posterior%prior%knowledge, &
         & conflict => found%conflict%of_quantity)
         do j = 1, merge(size(conflict), 0, size(reasons) == 0)
            if (conflict(j) > furthest) then
               call warn(reasons, known_text(knowledge, j)//' is '//fixed(conflict(j), 0) &
                  & //' sd away from what all else gives (allowed up to '//fixed(furthest, 0) &
                  & //'). Check its value and unit in &knowledge, and modulus_kind')
            end if
         end do
      end associate
      call check_mixing(found, unmixed, 1, reasons)
      ! After all attempts.
      if (size(reasons) == 0 .and. found%field_error > allowed_error) then
         call warn(reasons, 'theory was read too roughly: it errs by ' &
            & //fixed(100.0_wp*found%field_error, 0)//' % of the sd of a grain, or in all grains ' &
            & //'as badly (allowed up to '//fixed(100.0_wp*allowed_error, 0) &
            & //' %). Combine grains of like orientation, or state bounds in &prior')
      end if
   end subroutine find_reasons

   !> The limits that end the draws, either the stated ones or the others.
   subroutine check_limits(found, stated, warnings)
      type(extraction_type), intent(in) :: found
      logical, intent(in) :: stated
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      character(len=:), allocatable :: name, remedy
      integer :: i, side

      do i = 1, size(found%limits)
         associate (limit => found%limits(i))
            if (limit%stated .neqv. stated) cycle
            name = trim(limit%name)
            remedy = '. It is stated in &prior: widen it there if it is not meant'
            if (.not. stated) then
               name = name(index(name, '.') + 1:)//' in the domain of the surrogate'
               remedy = '. Build the surrogate for a wider &domain'
            end if
            do side = 1, 2
               if (limit%truncates(side)) then
                  call warn(warnings, 'the posterior is truncated by the ' &
                     & //merge('upper', 'lower', side == 2)//' limit of '//name//', ' &
                     & //to_text(limit%range(side), 4)//' ('//fixed(100.0_wp*limit%share(side), 0) &
                     & //' % of the draws lie next to it)'//remedy)
               end if
            end do
         end associate
      end do
   end subroutine check_limits

   !> sds that had to be more than doubled.
   subroutine check_scale(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: greatest = 2.0_wp
      integer :: n

      n = size(found%names)
      if (.not. (found%posterior%infers_scale .and. found%parameters(n)%mean > greatest &
         & .and. found%parameters(n)%hdi_95(1) > 1.0_wp)) then
         return
      end if
      call warn(warnings, 'the residuals are '//to_text(found%parameters(n)%mean, 2) &
         & //' times as large as the stated standard deviations (chi-square ' &
         & //fixed(sum((found%checks%residuals*found%parameters(n)%mean)**2), 0)//' for ' &
         & //to_text(found%posterior%n_grains)//' grains with them). An inferred scale hides ' &
         & //'errors of the model: check orientations, modulus_kind and &specimen')
   end subroutine check_scale

   !> The parameter with the worst R-hat over all chains, or else that with the fewest effective
   !> samples; NaN has not mixed.
   subroutine check_mixing(found, greatest, sizes, warnings)
      type(extraction_type), intent(in) :: found
      !> R-hat that is allowed; how many times `least_size` is needed.
      real(wp), intent(in) :: greatest
      integer, intent(in) :: sizes
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp) :: effective(size(found%parameters))
      integer :: i

      associate (worst => found%parameters%diagnostics)
         effective = min(worst%ess_bulk, worst%ess_tail)
         ! One chain has no R-hat.
         if (size(found%chains%draws, 3) > 1 .and. any(.not. worst%r_hat <= greatest)) then
            i = max(1, maxloc(worst%r_hat, dim=1))
            call warn(warnings, trim(found%names(i))//': the chains have not mixed, R-hat is ' &
               & //fixed(worst(i)%r_hat, 4)//' (allowed up to '//to_text(greatest) &
               & //'). Increase samples and burn_in, or state what else is known in &knowledge; ' &
               & //'the default method, ''ensemble'', mixes best')
         else if (any(.not. effective >= least_size*sizes)) then
            i = max(1, minloc(effective, dim=1))
            call warn(warnings, &
               & trim(found%names(i))//': only '//fixed(effective(i), 0)//' effective samples (' &
               & //to_text(least_size*sizes)//' are needed). Increase samples')
         end if
      end associate
   end subroutine check_mixing

   !> The constants that are not determined, and what would determine them.
   subroutine check_determined(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      !> Share of the sd that knowledge leaves, to be named.
      real(wp), parameter :: worth_it = 0.7_wp
      character(len=:), allocatable :: names, advice, precision
      integer :: i, j

      names = ''
      do i = 1, found%posterior%n_constants
         if (found%verdict(i) /= 'not_determined') cycle
         names = names//', '//trim(found%names(i))
         associate (prior => found%parameter_shares(i)%prior, constant => found%parameters(i))
            if (prior >= 0.5_wp) names = names//' (prior '//fixed(100.0_wp*prior, 0)//' %)'
            if (prior < 0.5_wp) then
               names = names//' (sd '//fixed(100.0_wp*abs(constant%sd/constant%mean), 0)//' %)'
            end if
         end associate
      end do
      if (len(names) == 0) return
      advice = ''
      do i = 1, size(found%gains)
         associate (gain => found%gains(i))
            j = minloc(gain%sd_then/gain%sd_now, dim=1)
            if (gain%sd_then(j)/gain%sd_now(j) > worth_it) cycle
            precision = fixed(100.0_wp*gain%relative_sd, 0)//' %'
            if (gain%known_sd > 0.0_wp) precision = '± '//short(gain%known_sd)//' GPa'
            advice = advice//'; '//trim(gain%name)//' to '//precision//' would reduce the sd of ' &
               & //trim(found%names(j))//' from '//short(gain%sd_now(j))//' to ' &
               & //short(gain%sd_then(j))//' GPa'
         end associate
      end do
      if (len(advice) > 0) advice = '. State in &knowledge what else is known: '//advice(3:)
      if (len(advice) == 0) advice = '. Measure more grains, or more precisely'
      call warn(warnings, 'not determined by the measurements: '//names(3:)//advice)
   end subroutine check_determined

   !> Values of &knowledge that contradict the measurements and the rest of the knowledge.
   subroutine check_knowledge(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: far = 3.0_wp
      integer :: j

      associate (knowledge => found%posterior%prior%knowledge, conflict => found%conflict)
         do j = 1, size(knowledge%mean)
            ! Of correlated ones the worst takes the others with it.
            if (any(abs(knowledge%covariance(:, j)) > 0.0_wp &
               & .and. conflict%of_quantity > conflict%of_quantity(j))) then
               cycle
            end if
            if (conflict%of_quantity(j) > far) then
               call warn(warnings, 'the stated '//known_text(knowledge, j) &
                  & //' contradicts all else that is known or measured by ' &
                  & //fixed(conflict%of_quantity(j), 1)//' sd')
            end if
         end do
         if (conflict%sds > far .and. .not. any(conflict%of_quantity > far)) then
            call warn(warnings, '&knowledge contradicts the measurements, or itself, by ' &
               & //fixed(conflict%sds, 1)//' sd: with it the least misfit grows by ' &
               & //fixed(conflict%growth, 1)//' for '//to_text(size(knowledge%mean))//' quantities')
         end if
      end associate
   end subroutine check_knowledge

   !> 'bulk_modulus = 165 ± 3.3 GPa', of the quantity j of what is known.
   function known_text(knowledge, j) result(text)
      type(knowledge_type), intent(in) :: knowledge
      integer, intent(in) :: j
      character(len=:), allocatable :: text

      text = knowledge%quantities(j)%name//' = '//to_text(knowledge%mean(j), 4)//' ± ' &
         & //short(sqrt(knowledge%covariance(j, j)))
      if (knowledge%quantities(j)%unit /= '1') text = text//' '//knowledge%quantities(j)%unit
   end function known_text

   !> Two digits, or as many as there are before the point.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text

      text = fixed(value, 0)
      if (abs(value) < 10.0_wp) text = to_text(value, 2)
   end function short

   !> 'C11^1.00 C12^-0.30' of constants with these `names` and `exponents`; powers that hardly count
   !> are left out.
   pure function powers_text(names, exponents) result(text)
      character(len=*), intent(in) :: names(:)
      real(wp), intent(in) :: exponents(:)
      character(len=:), allocatable :: text
      real(wp), parameter :: least = 0.05_wp
      integer :: i

      text = ''
      do i = 1, size(names)
         if (abs(exponents(i)) >= least) then
            text = text//' '//trim(names(i))//'^'//fixed(exponents(i), 2)
         end if
      end do
      text = text(2:)
   end function powers_text

   !> Orientations that are not those of the grains, or else grains without which the others agree:
   !> `blamed` for all residuals.
   subroutine check_table(problem, found, warnings, blamed)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      logical, intent(out) :: blamed
      character(len=:), allocatable :: distance, advice
      integer :: i

      associate (check => found%orientations, &
         & likelihood => problem%settings%measurements%likelihood)
         blamed = check%is_detected() .or. size(check%outliers) > 0
         if (check%is_detected()) then
            if (check%better_reading == 0) then
               call warn(warnings, misread_text(found, 'Check the order of the rows, whether the ' &
                  & //'map is flipped, and the convention of the angles (Bunge, from sample to ' &
                  & //'crystal axes); or whether the sds are too small'))
            end if
            return
         end if
         do i = 1, size(check%outliers)
            distance = fixed(abs(check%distances(i)), 1)//' sd ' &
               & //trim(merge('above', 'below', check%distances(i) > 0.0_wp))
            advice = ''
            if (likelihood /= 'student') advice = '; likelihood = ''student'' admits outliers'
            call warn(warnings, 'grain '//printable(problem%measurements%name(check%outliers(i))) &
               & //' disagrees with the others: its modulus is '//distance &
               & //' what they predict, and without it they agree. Check its value (' &
               & //to_text(found%posterior%data%modulus(check%outliers(i)), 4) &
               & //' GPa) and orientation, or remove it'//advice)
         end do
      end associate
   end subroutine check_table

   !> That the orientations do not explain the moduli, and what to do.
   function misread_text(found, advice) result(text)
      type(extraction_type), intent(in) :: found
      character(len=*), intent(in) :: advice
      character(len=:), allocatable :: text

      associate (check => found%orientations)
         text = 'the orientations do not explain the moduli: chi-square is ' &
            & //fixed(check%chi_square, 0)//' for '//to_text(found%posterior%n_grains) &
            & //' grains, '//fixed(check%constant, 0)//' without orientations; '//fixed(100.0_wp &
            & *check%p_shuffled, 1)//' % of random orders of the grains fit as well. '//advice
      end associate
   end function misread_text

   !> Measurements that the model could hardly have given.
   subroutine check_residuals(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: rare = 0.01_wp, rare_below = 0.05_wp
      real(wp) :: least, below
      integer :: freedom

      ! About the mean prediction; the mean over all draws is larger by the number of parameters
      ! that the measurements determine, which leaves as many degrees of freedom less. These are
      ! rounded up from 3/4 on.
      least = sum(found%checks%residuals**2)
      freedom = int(found%posterior%n_grains - found%checks%chi_square + least + 0.25_wp)
      below = 1.0_wp - chi_square_above(least, max(1, freedom))
      if (found%checks%chi_square_p <= rare) then
         call warn(warnings, 'the residuals are larger than the stated sds: chi-square is ' &
            & //to_text(found%checks%chi_square, 3)//' for '//to_text(found%posterior%n_grains) &
            & //' grains; '//fixed(100.0_wp*found%checks%chi_square_p, 1) &
            & //' % of data sets drawn from the posterior have a larger one; the sds are too ' &
            & //'small, some orientations are wrong, or grains differ in more than their ' &
            & //'orientation (scatter_sd, scale = ''inferred'', likelihood = ''student'')')
      else if (freedom > 0 .and. below < rare_below) then
         call warn(warnings, 'the residuals are smaller than the stated sds: chi-square ' &
            & //'about the mean prediction is '//to_text(least, 3)//' for ' &
            & //to_text(freedom)//' degrees of freedom; '//fixed(100.0_wp*below, 1) &
            & //' % of data sets have a smaller one; the sds are too large, or have an error in ' &
            & //'them that all grains share (calibration_sd)')
      end if
   end subroutine check_residuals

   !> Results that depend on a limit of the prior or on its measure: of each the parameter that
   !> moves most.
   subroutine check_sensitivity(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: matters = 0.1_wp
      !> More are not read.
      integer, parameter :: most = 3
      real(wp) :: largest(size(found%changes))
      character(len=:), allocatable :: line
      integer :: i, round

      associate (changes => found%changes)
         ! What is not a number is not larger. There may be none at all.
         largest = [(maxval(abs(changes(i)%shift), mask=abs(changes(i)%shift) > 0.0_wp), i=1, &
            & size(changes))]
         line = ''
         do round = 1, min(most, size(largest))
            i = maxloc(largest, dim=1)
            if (.not. largest(i) > matters) exit
            line = line//'; '//change_text(changes(i))
            ! In or out, the same limit is named once.
            where (changes%name == changes(i)%name &
               & .and. (changes%is_upper .eqv. changes(i)%is_upper)) largest = 0.0_wp
         end do
      end associate
      if (len(line) > 0) call warn(warnings, 'the result depends on the prior: '//line(3:))

   contains

      function change_text(change) result(text)
         type(change_type), intent(in) :: change
         character(len=:), allocatable :: text
         integer :: worst

         worst = maxloc(abs(change%shift), dim=1)
         text = trim(found%names(worst))//' would be '//fixed(abs(change%shift(worst)), 1)//' sd ' &
            & //trim(merge('higher', 'lower ', change%shift(worst) > 0.0_wp))
         if (change%name == 'measure') then
            text = text//' with the other measure of the prior'
         else
            text = text//' with the '//trim(merge('upper', 'lower', change%is_upper)) &
               & //' limit of '//trim(change%name(index(change%name, '.') + 1:)) &
               & //trim(merge(' of &domain', '           ', index(change%name, '.') > 0))//' at ' &
               & //to_text(change%to, 4)//' instead of '//to_text(change%from, 4)
            if (.not. change%exact) text = text//' (estimated)'
         end if
      end function change_text
   end subroutine check_sensitivity

   !> Warnings of the depth of the measurements and of the columns depth_um, contact_radius_um and
   !> grain_radius_um.
   subroutine check_sizes(problem, found, warnings)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error
      real(wp), dimension(found%posterior%n_moduli) :: contact_radius, pressure, allowed, bias
      character(len=:), allocatable :: limit, range
      real(wp) :: ratio
      integer :: worst, biased, n

      call new_indenter(problem%settings%indenter, indenter, error)
      n = found%posterior%n_moduli
      if (allocated(error) .or. n == 0) return
      associate (measured => problem%measurements, trained => found%surrogate_contact_radius, &
         & addition => found%surrogate_correction)
         associate (modulus => measured%modulus_gpa(:n), depth => measured%depth_um(:n), &
            & measured_radius => measured%contact_radius_um(:n), &
            & radius => measured%grain_radius_um(:n))
            contact_radius = indenter%contact_radius
            where (depth > 0.0_wp) contact_radius = indenter%contact_radius_of(depth)
            where (measured_radius > 0.0_wp) contact_radius = measured_radius
            pressure = indenter%unit_force(indenter%depth_of(contact_radius))/(pi*contact_radius**2)
            allowed = elastic_pressure*modulus
            limit = 'few metals are elastic above 3 % of the modulus'
            if (problem%settings%measurements%yield_gpa > 0.0_wp) then
               ! First yield below a sphere (Johnson, Contact Mechanics, 1985, Eq. 4.45 with
               ! Tresca's criterion).
               allowed = 1.07_wp*problem%settings%measurements%yield_gpa
               limit = 'a contact yields above '//to_text(allowed(1), 3) &
                  & //' GPa, 1.07 times the yield stress'
            end if
            worst = maxloc(merge(pressure*modulus, 0.0_wp, pressure*modulus > allowed), 1)
            if (pressure(worst)*modulus(worst) > allowed(worst)) then
               call warn(warnings, 'the mean contact pressure is up to '//to_text(pressure(worst) &
                  & *modulus(worst), 3)//' GPa, '//to_text(100.0_wp*pressure(worst), 2) &
                  & //' % of the modulus: '//limit//'; use shallower indentations or a blunter tip')
            end if
            if (trained > 0.0_wp) then
               ! What a film, say, adds to the theory grows with the contact radius.
               ratio = maxval(abs(contact_radius/trained - 1.0_wp))
               if (any(depth > 0.0_wp .or. measured_radius > 0.0_wp) .and. ratio > alike) then
                  range = to_text(minval(contact_radius), 3)//' to ' &
                     & //to_text(maxval(contact_radius), 3)
                  call warn(warnings, 'the measurements have contact radii of '//range &
                     & //' um, the surrogate is of '//to_text(trained, 3)//' um: the specimen ' &
                     & //'correction, '//fixed(100.0_wp*addition, 1)//' % on average, grows ' &
                     & //'about as the contact radius, so moduli may be off by up to ' &
                     & //fixed(100.0_wp*addition*ratio, 1)//' %; build one at this depth')
               end if
            else
               ! Neighbours are taken to be as stiff as the mean measurement.
               bias = 0.0_wp
               where (radius > 0.0_wp)
                  bias = (sum(modulus)/size(modulus)/modulus)**(slope*contact_radius/radius)
                  bias = bias - 1.0_wp
               end where
               biased = count(abs(bias) > small_bias)
               worst = maxloc(abs(bias), dim=1)
               if (biased > 0) then
                  call warn(warnings, to_text(biased)//' of '//to_text(size(bias)) &
                     & //' grains are so small that their neighbours are expected to change the ' &
                     & //'modulus by more than 1 % (grain '//printable(measured%name(worst))//': ' &
                     & //fixed(100.0_wp*bias(worst), 1)//' %): see the table of sizes in ' &
                     & //'docs/limits.md, or build a correction with geometry = ''grain''')
               end if
            end if
         end associate
      end associate
   end subroutine check_sizes
end module posterior_diagnostics
