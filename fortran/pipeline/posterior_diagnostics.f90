!> Diagnostics of a posterior, the most important first. Each check is a function that returns what
!> it finds; its sentences are in docs/diagnostics.md. A new check is a row there and a function in
!> the list of `check_analysis`.
module posterior_diagnostics
   use constants_prior, only: knowledge_type
   use diagnostics, only: diagnostic, diagnostic_type, is_usable
   use errors, only: error_type
   use analysis, only: analysis_type, unmixed
   use field_reading, only: allowed_error
   use files, only: printable
   use indenters, only: indenter_type, new_indenter
   use kinds, only: pi, wp
   use prior_sensitivity, only: change_type, is_truncated
   use orientation_check, only: readings
   use statistics, only: chi_square_above
   use text, only: fixed, to_text
   implicit none
   private
   public :: check_analysis, known_text, powers_text

   !> Chains have mixed if R-hat is at most this, and if each effective sample size is at least this
   !> times the number of chains (Vehtari et al., Bayesian Anal. 16, 667, 2021).
   real(wp), parameter :: greatest_r_hat = 1.01_wp
   integer, parameter :: least_size = 100
   !> Conflict of knowledge that needs a warning, and the greatest one, in sds: beyond it the value
   !> is of another crystal or in another unit.
   real(wp), parameter :: far = 3.0_wp, greatest_conflict = 10.0_wp
   !> Relative bias of a modulus, and relative difference of contact radii, that need no warning.
   real(wp), parameter :: small_bias = 0.01_wp, small_difference = 0.05_wp
   !> Greatest elastic mean contact pressure over the modulus: a/R up to 0.08.
   real(wp), parameter :: elastic_pressure = 1.0_wp/30.0_wp
   !> Neighbours that are x times as stiff as a grain multiply its modulus by x**(slope a/R), for x
   !> about 1 and a grain of radius R. The slope is 0.86 to 1.04 for hemispheres of 10 and 20
   !> contact radii among neighbours 0.8 and 1.25 times as stiff (docs/verification/films.md).
   real(wp), parameter :: slope = 0.95_wp

contains

   !> All diagnostics. Wrong orientations, outliers and limits explain residuals and conflicts,
   !> which are then not reported as well.
   function check_analysis(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      logical :: is_explained
      integer :: n

      list = check_limits(found, .false.)
      call add(check_orientations(found))
      is_explained = found%orientations%is_detected() .or. size(found%orientations%outliers) > 0
      call add(check_limits(found, .true.))
      call add(check_waves(found))
      call add(check_contacts(found))
      call add(check_knowledge(found, is_usable(list), &
         & is_explained .or. is_truncated(found%limits)))
      call add(check_mixing(found))
      if (is_usable(list)) call add(check_theory(found))
      n = size(list)
      call add(check_determined(found))
      if (size(list) > n) call add(check_gains(found))
      call add(check_prior(found))
      if (all(found%problem%measurements%sd_gpa > 0.0_wp)) call add(check_scale(found))
      if (.not. (is_explained .or. is_truncated(found%limits))) call add(check_residuals(found))

   contains

      subroutine add(more)
         type(diagnostic_type), intent(in) :: more(:)

         list = [list, more]
      end subroutine add
   end function check_analysis

   !> Orientations that are not those of the grains, or else outliers.
   function check_orientations(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      real(wp) :: numbers(4)
      integer :: i

      allocate (list(0))
      associate (check => found%orientations, data => found%posterior%data)
         numbers = [check%chi_square, real(found%posterior%n_grains, wp), check%constant, &
            & 100.0_wp*check%p_shuffled]
         if (check%better_reading > 0) then
            list = diagnostic('misread', trim(readings(check%better_reading)), numbers)
         else if (check%is_detected()) then
            list = diagnostic('unexplained', numbers=numbers)
         else
            do i = 1, size(check%outliers)
               associate (grain => check%outliers(i))
                  list = [list, diagnostic('outlier', &
                     & printable(found%problem%measurements%name(grain)), &
                     & [check%distances(i), data%modulus(grain)])]
               end associate
            end do
         end if
      end associate
   end function check_orientations

   !> Limits that truncate the posterior, either the stated ones or those of the surrogate.
   function check_limits(found, stated) result(list)
      type(analysis_type), intent(in) :: found
      logical, intent(in) :: stated
      type(diagnostic_type), allocatable :: list(:)
      character(len=:), allocatable :: name, code
      integer :: i, side

      allocate (list(0))
      code = trim(merge('truncated        ', 'outside_surrogate', stated))
      do i = 1, size(found%limits)
         associate (limit => found%limits(i))
            if (limit%stated .neqv. stated) cycle
            name = trim(limit%name)
            if (.not. stated) name = name(index(name, '.') + 1:)
            do side = 1, 2
               if (.not. limit%truncates(side)) cycle
               list = [list, diagnostic(code, merge('upper', 'lower', side == 2)//' limit of ' &
                  & //name, [limit%range(side), 100.0_wp*limit%share(side)])]
            end do
         end associate
      end do
   end function check_limits

   !> Speeds that are left out, since their waves cannot be detected.
   function check_waves(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)

      allocate (list(0))
      if (found%problem%measurements%omitted == 0) return
      list = diagnostic('velocities_left_out', &
         & numbers=real([found%problem%measurements%omitted, found%problem%velocities%n], wp))
   end function check_waves

   !> Values of &knowledge that contradict the measurements or the rest of the knowledge. Of
   !> correlated quantities only the one with the greatest conflict is reported.
   function check_knowledge(found, usable, is_explained) result(list)
      type(analysis_type), intent(in) :: found
      !> Whether the result can be used so far, and whether something else explains conflicts.
      logical, intent(in) :: usable, is_explained
      type(diagnostic_type), allocatable :: list(:)
      integer :: j

      allocate (list(0))
      associate (knowledge => found%posterior%prior%knowledge, &
         & conflict => found%conflict%of_quantity)
         do j = 1, size(conflict)
            if (any(abs(knowledge%covariance(:, j)) > 0.0_wp .and. conflict > conflict(j))) cycle
            if (usable .and. conflict(j) > greatest_conflict) then
               list = [list, diagnostic('knowledge_wrong', known_text(knowledge, j), &
                  & [conflict(j), greatest_conflict])]
            else if (conflict(j) > far .and. .not. is_explained) then
               list = [list, diagnostic('knowledge_contradicts', known_text(knowledge, j), &
                  & [conflict(j)])]
            end if
         end do
         if (found%conflict%sds > far .and. .not. (any(conflict > far) .or. is_explained)) then
            list = [list, diagnostic('knowledge_conflict', numbers=[found%conflict%sds, &
               & found%conflict%growth, real(size(conflict), wp)])]
         end if
      end associate
   end function check_knowledge

   !> The parameter with the greatest R-hat, or else that with the smallest effective sample size.
   !> With NaN the chains have not mixed.
   function check_mixing(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      real(wp) :: effective(size(found%parameters)), greatest
      integer :: n_chains, level, i

      allocate (list(0))
      n_chains = size(found%chains%draws, 3)
      associate (diagnostics => found%parameters%diagnostics)
         effective = min(diagnostics%ess_bulk, diagnostics%ess_tail)
         ! The first level makes a result unusable.
         do level = 1, 2
            greatest = merge(unmixed, greatest_r_hat, level == 1)
            ! One chain has no R-hat.
            if (n_chains > 1 .and. any(.not. diagnostics%r_hat <= greatest)) then
               i = max(1, maxloc(diagnostics%r_hat, dim=1))
               list = diagnostic(trim(merge('not_mixed   ', 'poorly_mixed', level == 1)), &
                  & trim(found%names(i)), [diagnostics(i)%r_hat, greatest])
               return
            end if
            associate (needed => least_size*merge(1, n_chains, level == 1))
               if (any(.not. effective >= needed)) then
                  i = max(1, minloc(effective, dim=1))
                  list = diagnostic(trim(merge('too_few_draws', 'few_draws    ', level == 1)), &
                     & trim(found%names(i)), [effective(i), real(needed, wp)])
                  return
               end if
            end associate
         end do
      end associate
   end function check_mixing

   !> Theory that is read too roughly: all attempts to find a sufficient degree have failed.
   function check_theory(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)

      allocate (list(0))
      if (found%field_error > allowed_error) then
         list = diagnostic('theory_rough', numbers=100.0_wp*[found%field_error, allowed_error])
      end if
   end function check_theory

   !> Constants that are not determined.
   function check_determined(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      character(len=:), allocatable :: names
      integer :: i

      allocate (list(0))
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
      if (len(names) > 0) list = diagnostic('not_determined', names(3:))
   end function check_determined

   !> Knowledge that would reduce the sd of constants that are not determined.
   function check_gains(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      !> Knowledge is named if it would reduce an sd to this share.
      real(wp), parameter :: reduced_share = 0.7_wp
      character(len=:), allocatable :: precision
      integer :: i, j

      allocate (list(0))
      do i = 1, size(found%gains)
         associate (gain => found%gains(i))
            j = minloc(gain%sd_then/gain%sd_now, dim=1)
            if (gain%sd_then(j)/gain%sd_now(j) > reduced_share) cycle
            precision = fixed(100.0_wp*gain%relative_sd, 0)//' %'
            if (gain%known_sd > 0.0_wp) precision = '± '//short(gain%known_sd)//' GPa'
            list = [list, diagnostic('knowledge_helps', trim(gain%name)//' to '//precision &
               & //' would reduce the sd of '//trim(found%names(j)), &
               & [gain%sd_now(j), gain%sd_then(j)])]
         end associate
      end do
   end function check_gains

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

   !> An inferred factor on the sds above two.
   function check_scale(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      real(wp), parameter :: greatest = 2.0_wp

      allocate (list(0))
      associate (scale => found%parameters(size(found%names)))
         if (found%posterior%infers_scale .and. scale%mean > greatest &
            & .and. scale%hdi_95(1) > 1.0_wp) then
            list = diagnostic('scale_hides', numbers=[scale%mean, &
               & sum((found%checks%residuals*scale%mean)**2), real(found%posterior%n_grains, wp)])
         end if
      end associate
   end function check_scale

   !> Residuals that are improbably large or small.
   function check_residuals(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      real(wp), parameter :: rare = 0.01_wp, rare_below = 0.05_wp
      real(wp) :: least, below
      integer :: freedom

      allocate (list(0))
      ! Chi-square about the mean prediction. The mean chi-square of the draws is larger by the
      ! number of parameters that the measurements determine. The degrees of freedom, less by that
      ! number, are rounded up from 3/4 on.
      associate (checks => found%checks, n_grains => found%posterior%n_grains)
         least = sum(checks%residuals**2)
         freedom = int(n_grains - checks%chi_square + least + 0.25_wp)
         below = 1.0_wp - chi_square_above(least, max(1, freedom))
         if (checks%chi_square_p <= rare) then
            list = diagnostic('residuals_large', numbers=[checks%chi_square, &
               & real(n_grains, wp), 100.0_wp*checks%chi_square_p])
         else if (freedom > 0 .and. below < rare_below) then
            list = diagnostic('residuals_small', &
               & numbers=[least, real(freedom, wp), 100.0_wp*below])
         end if
      end associate
   end function check_residuals

   !> Limits of the prior, or its measure, on which the result depends, each with the parameter that
   !> moves most.
   function check_prior(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      !> Shift that needs a warning, in sds; and the greatest number of shifts that are listed.
      real(wp), parameter :: least_shift = 0.1_wp
      integer, parameter :: most = 3
      real(wp) :: largest(size(found%changes))
      integer :: i, round

      allocate (list(0))
      associate (changes => found%changes)
         ! NaN is left out, and there may be no other shift.
         largest = [(maxval(abs(changes(i)%shift), mask=abs(changes(i)%shift) > 0.0_wp), i=1, &
            & size(changes))]
         do round = 1, min(most, size(largest))
            i = maxloc(largest, dim=1)
            if (.not. largest(i) > least_shift) exit
            list = [list, diagnostic_of_change(found%names, changes(i))]
            ! A limit that moves in and out is named once.
            where (changes%name == changes(i)%name &
               & .and. (changes%is_upper .eqv. changes(i)%is_upper)) largest = 0.0_wp
         end do
      end associate
   end function check_prior

   function diagnostic_of_change(names, change) result(list)
      character(len=*), intent(in) :: names(:)
      type(change_type), intent(in) :: change
      type(diagnostic_type) :: list(1)
      character(len=:), allocatable :: limit
      integer :: worst, point

      worst = maxloc(abs(change%shift), dim=1)
      if (change%name == 'measure') then
         list = diagnostic('measure_matters', trim(names(worst)), [change%shift(worst)])
         return
      end if
      point = index(change%name, '.')
      limit = trim(change%name(point + 1:))
      if (point > 0) limit = limit//' of &domain'
      list = diagnostic('prior_matters', trim(names(worst))//' with the ' &
         & //merge('upper', 'lower', change%is_upper)//' limit of '//limit, &
         & [change%shift(worst), change%from, change%to])
   end function diagnostic_of_change

   !> Contact pressures that are too high, contact radii that differ from the surrogate's, and
   !> grains that are too small, by the columns depth_um, contact_radius_um and grain_radius_um.
   function check_contacts(found) result(list)
      type(analysis_type), intent(in) :: found
      type(diagnostic_type), allocatable :: list(:)
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error
      real(wp), dimension(found%posterior%n_moduli) :: contact_radius, pressure, allowed, bias
      character(len=:), allocatable :: code
      real(wp) :: difference
      integer :: worst, n

      allocate (list(0))
      call new_indenter(found%problem%settings%indenter, indenter, error)
      n = found%posterior%n_moduli
      if (allocated(error) .or. n == 0) return
      associate (measured => found%problem%measurements, &
         & trained_radius => found%surrogate_contact_radius, &
         & correction => 100.0_wp*found%surrogate_correction)
         associate (modulus => measured%modulus_gpa(:n), depth => measured%depth_um(:n), &
            & measured_radius => measured%contact_radius_um(:n), &
            & grain_radius => measured%grain_radius_um(:n))
            contact_radius = indenter%contact_radius
            where (depth > 0.0_wp) contact_radius = indenter%contact_radius_of(depth)
            where (measured_radius > 0.0_wp) contact_radius = measured_radius
            pressure = indenter%unit_force(indenter%depth_of(contact_radius)) &
               & /(pi*contact_radius**2)*modulus
            allowed = elastic_pressure*modulus
            code = 'plastic_contact'
            if (found%problem%settings%measurements%yield_gpa > 0.0_wp) then
               ! First yield below a sphere (Johnson, Contact Mechanics, 1985, Eq. 4.45 with
               ! Tresca's criterion).
               allowed = 1.07_wp*found%problem%settings%measurements%yield_gpa
               code = 'yielding_contact'
            end if
            worst = maxloc(pressure, dim=1, mask=pressure > allowed)
            if (worst > 0) then
               list = diagnostic(code, numbers=[pressure(worst), &
                  & 100.0_wp*pressure(worst)/modulus(worst), allowed(worst)])
            end if
            if (trained_radius > 0.0_wp) then
               ! The correction for a film, for example, grows with the contact radius.
               difference = maxval(abs(contact_radius/trained_radius - 1.0_wp))
               if (any(depth > 0.0_wp .or. measured_radius > 0.0_wp) &
                  & .and. difference > small_difference) then
                  list = [list, diagnostic('other_contact', &
                     & numbers=[minval(contact_radius), maxval(contact_radius), trained_radius, &
                     & correction, correction*difference])]
               end if
               return
            end if
            ! Neighbours are assumed to be as stiff as the mean measurement.
            bias = 0.0_wp
            where (grain_radius > 0.0_wp)
               bias = (sum(modulus)/n/modulus)**(slope*contact_radius/grain_radius) - 1.0_wp
            end where
            if (any(abs(bias) > small_bias)) then
               worst = maxloc(abs(bias), dim=1)
               list = [list, diagnostic('small_grains', printable(measured%name(worst)), &
                  & [real(count(abs(bias) > small_bias), wp), real(n, wp), 100.0_wp*bias(worst)])]
            end if
         end associate
      end associate
   end function check_contacts
end module posterior_diagnostics
