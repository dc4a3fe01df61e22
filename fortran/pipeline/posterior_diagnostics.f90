!> Diagnostics of a posterior: reasons for which it cannot be used, and warnings, the most important
!> first.
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

   !> Chains have mixed if R-hat is at most this, and if each effective sample size is at least this
   !> times the number of chains (Vehtari et al., Bayesian Anal. 16, 667, 2021).
   real(wp), parameter :: greatest_r_hat = 1.01_wp
   integer, parameter :: least_size = 100
   !> Knowledge with a greater conflict, in sds, is of another crystal or in another unit.
   real(wp), parameter :: greatest_conflict = 10.0_wp
   !> Relative bias of a modulus, and relative difference of contact radii, that need no warning.
   real(wp), parameter :: small_bias = 0.01_wp, small_difference = 0.05_wp
   !> Greatest elastic mean contact pressure over the modulus: a/R up to 0.08.
   real(wp), parameter :: elastic_pressure = 1.0_wp/30.0_wp
   !> Neighbours that are x times as stiff as a grain multiply its modulus by x**(slope a/R), for x
   !> about 1 and a grain of radius R. The slope is 0.86 to 1.04 for hemispheres of 10 and 20
   !> contact radii among neighbours 0.8 and 1.25 times as stiff (docs/verification/films.md).
   real(wp), parameter :: slope = 0.95_wp

contains

   !> Add all warnings.
   subroutine check_extraction(problem, found, warnings)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      type(warning_type), allocatable :: reasons(:)
      logical :: blamed

      allocate (reasons(0))
      call check_table()
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
      if (.not. blamed) call check_knowledge()
      call check_mixing(found, unmixed, 1, reasons)
      if (size(reasons) == 0) then
         call check_mixing(found, greatest_r_hat, size(found%chains%draws, 3), warnings)
      end if
      call check_determined(found, warnings)
      call check_sensitivity(found, warnings)
      if (all(problem%measurements%sd_gpa > 0.0_wp)) call check_scale()
      if (.not. blamed) call check_residuals(found, warnings)

   contains

      !> Warn of orientations that are not those of the grains, or else of outliers. Either is
      !> `blamed` for all residuals.
      subroutine check_table()
         character(len=:), allocatable :: advice
         integer :: i

         associate (check => found%orientations, &
            & likelihood => problem%settings%measurements%likelihood)
            blamed = check%is_detected() .or. size(check%outliers) > 0
            if (check%is_detected()) then
               if (check%better_reading == 0) then
                  call warn(warnings, misread_text(found, 'Check the order of the rows, whether ' &
                     & //'the map is flipped, and the convention of the angles (Bunge, from ' &
                     & //'sample to crystal axes); or whether the sds are too small'))
               end if
               return
            end if
            do i = 1, size(check%outliers)
               advice = ''
               if (likelihood /= 'student') advice = '; likelihood = ''student'' admits outliers'
               associate (grain => check%outliers(i), distance => check%distances(i), &
                  & side => merge('above', 'below', check%distances(i) > 0.0_wp))
                  call warn(warnings, 'grain '//printable(problem%measurements%name(grain)) &
                     & //' disagrees with the others: its modulus is '//fixed(abs(distance), 1) &
                     & //' sd '//side//' what they predict, and without it they agree. Check its ' &
                     & //'value ('//to_text(found%posterior%data%modulus(grain), 4) &
                     & //' GPa) and orientation, or remove it'//advice)
               end associate
            end do
         end associate
      end subroutine check_table

      !> Warn of values of &knowledge that contradict the measurements or the rest of the knowledge.
      subroutine check_knowledge()
         !> Conflict that needs a warning, in sds.
         real(wp), parameter :: far = 3.0_wp
         integer :: j

         associate (knowledge => found%posterior%prior%knowledge, conflict => found%conflict)
            do j = 1, size(knowledge%mean)
               ! Of correlated quantities only the one with the greatest conflict is named.
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
                  & //fixed(conflict%growth, 1)//' for '//to_text(size(knowledge%mean)) &
                  & //' quantities')
            end if
         end associate
      end subroutine check_knowledge

      !> Warn of an inferred factor on the sds above two.
      subroutine check_scale()
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
   end subroutine check_extraction

   !> Find the reasons for which the result cannot be used, each with its remedy.
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
            if (conflict(j) > greatest_conflict) then
               call warn(reasons, known_text(knowledge, j)//' is '//fixed(conflict(j), 0) &
                  & //' sd away from what all else gives (allowed up to ' &
                  & //fixed(greatest_conflict, 0)//'). Check its value and unit ' &
                  & //'in &knowledge, and modulus_kind')
            end if
         end do
      end associate
      call check_mixing(found, unmixed, 1, reasons)
      ! All attempts to find a sufficient degree have failed.
      if (size(reasons) == 0 .and. found%field_error > allowed_error) then
         call warn(reasons, 'theory was read too roughly: it errs by ' &
            & //fixed(100.0_wp*found%field_error, 0)//' % of the sd of a grain, or in all grains ' &
            & //'as badly (allowed up to '//fixed(100.0_wp*allowed_error, 0) &
            & //' %). Combine grains of like orientation, or state bounds in &prior')
      end if
   end subroutine find_reasons

   !> Report the limits that truncate the posterior, either the stated ones or the others.
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

   !> Report the parameter with the greatest R-hat, or else that with the smallest effective sample
   !> size. With NaN the chains have not mixed.
   subroutine check_mixing(found, greatest, sizes, warnings)
      type(extraction_type), intent(in) :: found
      !> Allowed R-hat; required effective sample size in units of `least_size`.
      real(wp), intent(in) :: greatest
      integer, intent(in) :: sizes
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp) :: effective(size(found%parameters))
      integer :: i

      associate (diagnostics => found%parameters%diagnostics)
         effective = min(diagnostics%ess_bulk, diagnostics%ess_tail)
         ! One chain has no R-hat.
         if (size(found%chains%draws, 3) > 1 .and. any(.not. diagnostics%r_hat <= greatest)) then
            i = max(1, maxloc(diagnostics%r_hat, dim=1))
            call warn(warnings, trim(found%names(i))//': the chains have not mixed, R-hat is ' &
               & //fixed(diagnostics(i)%r_hat, 4)//' (allowed up to '//to_text(greatest) &
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

   !> Warn of constants that are not determined, and name knowledge that would determine them.
   subroutine check_determined(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      !> Knowledge is named if it would reduce an sd to this share.
      real(wp), parameter :: reduced_share = 0.7_wp
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
            if (gain%sd_then(j)/gain%sd_now(j) > reduced_share) cycle
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

   !> The known quantity j, for example 'bulk_modulus = 165 ± 3.3 GPa'.
   function known_text(knowledge, j) result(text)
      type(knowledge_type), intent(in) :: knowledge
      integer, intent(in) :: j
      character(len=:), allocatable :: text

      text = knowledge%quantities(j)%name//' = '//to_text(knowledge%mean(j), 4)//' ± ' &
         & //short(sqrt(knowledge%covariance(j, j)))
      if (knowledge%quantities(j)%unit /= '1') text = text//' '//knowledge%quantities(j)%unit
   end function known_text

   !> A value with two digits, or with all digits before the point.
   pure function short(value) result(text)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: text

      text = fixed(value, 0)
      if (abs(value) < 10.0_wp) text = to_text(value, 2)
   end function short

   !> A product of powers of constants with these `names`, for example 'C11^1.00 C12^-0.30'. Small
   !> `exponents` are left out.
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

   !> The message that the orientations do not explain the moduli, with its remedy.
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

   !> Warn of residuals that are improbably large or small.
   subroutine check_residuals(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: rare = 0.01_wp, rare_below = 0.05_wp
      real(wp) :: least, below
      integer :: freedom

      ! Chi-square about the mean prediction. The mean chi-square of the draws is larger by the
      ! number of parameters that the measurements determine. The degrees of freedom, less by that
      ! number, are rounded up from 3/4 on.
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

   !> Warn of results that depend on a limit of the prior or on its measure, with the parameter that
   !> moves most.
   subroutine check_sensitivity(found, warnings)
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      !> Shift that needs a warning, in sds; and the greatest number of shifts that are listed.
      real(wp), parameter :: least_shift = 0.1_wp
      integer, parameter :: most = 3
      real(wp) :: largest(size(found%changes))
      character(len=:), allocatable :: line
      integer :: i, round

      associate (changes => found%changes)
         ! NaN is left out, and there may be no other shift.
         largest = [(maxval(abs(changes(i)%shift), mask=abs(changes(i)%shift) > 0.0_wp), i=1, &
            & size(changes))]
         line = ''
         do round = 1, min(most, size(largest))
            i = maxloc(largest, dim=1)
            if (.not. largest(i) > least_shift) exit
            line = line//'; '//change_text(changes(i))
            ! A limit that moves in and out is named once.
            where (changes%name == changes(i)%name &
               & .and. (changes%is_upper .eqv. changes(i)%is_upper)) largest = 0.0_wp
         end do
      end associate
      if (len(line) > 0) call warn(warnings, 'the result depends on the prior: '//line(3:))

   contains

      function change_text(change) result(text)
         type(change_type), intent(in) :: change
         character(len=:), allocatable :: text
         integer :: worst, point

         worst = maxloc(abs(change%shift), dim=1)
         text = trim(found%names(worst))//' would be '//fixed(abs(change%shift(worst)), 1)//' sd ' &
            & //trim(merge('higher', 'lower ', change%shift(worst) > 0.0_wp))
         if (change%name == 'measure') then
            text = text//' with the other measure of the prior'
         else
            point = index(change%name, '.')
            text = text//' with the '//merge('upper', 'lower', change%is_upper)//' limit of ' &
               & //trim(change%name(point + 1:))
            if (point > 0) text = text//' of &domain'
            text = text//' at '//to_text(change%to, 4)//' instead of '//to_text(change%from, 4)
            if (.not. change%exact) text = text//' (estimated)'
         end if
      end function change_text
   end subroutine check_sensitivity

   !> Warn of too high contact pressures, of contact radii that differ from the surrogate's, and of
   !> too small grains, by the columns depth_um, contact_radius_um and grain_radius_um.
   subroutine check_sizes(problem, found, warnings)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error
      real(wp), dimension(found%posterior%n_moduli) :: contact_radius, pressure, allowed, bias
      character(len=:), allocatable :: limit, range
      real(wp) :: difference
      integer :: worst, biased, n

      call new_indenter(problem%settings%indenter, indenter, error)
      n = found%posterior%n_moduli
      if (allocated(error) .or. n == 0) return
      associate (measured => problem%measurements, &
         & trained_radius => found%surrogate_contact_radius, &
         & correction => found%surrogate_correction)
         associate (modulus => measured%modulus_gpa(:n), depth => measured%depth_um(:n), &
            & measured_radius => measured%contact_radius_um(:n), &
            & grain_radius => measured%grain_radius_um(:n))
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
            if (trained_radius > 0.0_wp) then
               ! The correction for a film, for example, grows with the contact radius.
               difference = maxval(abs(contact_radius/trained_radius - 1.0_wp))
               if (any(depth > 0.0_wp .or. measured_radius > 0.0_wp) &
                  & .and. difference > small_difference) then
                  range = to_text(minval(contact_radius), 3)//' to ' &
                     & //to_text(maxval(contact_radius), 3)
                  call warn(warnings, 'the measurements have contact radii of '//range &
                     & //' um, the surrogate is of '//to_text(trained_radius, 3)//' um: the ' &
                     & //'specimen correction, '//fixed(100.0_wp*correction, 1) &
                     & //' % on average, grows about as the contact radius, so moduli may be ' &
                     & //'off by up to ' &
                     & //fixed(100.0_wp*correction*difference, 1)//' %; build one at this depth')
               end if
            else
               ! Neighbours are assumed to be as stiff as the mean measurement.
               bias = 0.0_wp
               where (grain_radius > 0.0_wp)
                  bias = (sum(modulus)/size(modulus)/modulus)**(slope*contact_radius/grain_radius)
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
