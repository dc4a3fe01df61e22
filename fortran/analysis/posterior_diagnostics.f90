!> Diagnostics of a posterior, the most important first. Each check warns of what it finds; its
!> sentences are in docs/diagnostics.md. A new check is a row there and a call in `check_analysis`.
module posterior_diagnostics
   use constants_prior, only: knowledge_type
   use diagnostics, only: diagnostic_type, is_usable
   use errors, only: error_type
   use analysis, only: analysis_type, greatest_p
   use field_reading, only: allowed_error
   use files, only: printable
   use indenters, only: indenter_type, new_indenter
   use kinds, only: pi, wp
   use prior_limits, only: is_truncated
   use rivals, only: explanation_type
   use text, only: fixed, to_text
   use variance_shares, only: verdict_of
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
   !> Probability of a misfit that makes the result unusable, and least share of a distribution
   !> within stated bounds.
   real(wp), parameter :: unusable_p = 1.0e-6_wp, least_within = 0.05_wp
   !> Relative bias of a modulus, and relative difference of contact radii, that need no warning.
   real(wp), parameter :: small_bias = 0.01_wp, small_difference = 0.05_wp
   !> Greatest elastic mean contact pressure over the modulus: a/R up to 0.08.
   real(wp), parameter :: elastic_pressure = 1.0_wp/30.0_wp
   !> Neighbours that are x times as stiff as a grain multiply its modulus by x**(slope a/R), for x
   !> about 1 and a grain of radius R. The slope is 0.86 to 1.04 for hemispheres of 10 and 20
   !> contact radii among neighbours 0.8 and 1.25 times as stiff (docs/verification/films.md).
   real(wp), parameter :: slope = 0.95_wp

contains

   !> Set all warnings. Another model and limits explain residuals and conflicts,
   !> which are then not reported as well.
   subroutine check_analysis(found)
      type(analysis_type), intent(inout) :: found
      logical :: is_explained
      integer :: n

      found%warnings = [diagnostic_type ::]
      if (.not. (found%problem%states_technique .or. found%problem%settings%problem%synthetic) &
         & .and. found%posterior%n_moduli > 0) then
         call found%warn('technique_assumed')
      end if
      call check_limits(found, .false.)
      call check_cuts()
      n = size(found%warnings)
      call check_rivals()
      is_explained = size(found%warnings) > n
      call check_limits(found, .true.)
      ! Speeds are left out if their waves cannot be detected.
      associate (omitted => found%problem%data%measurements%omitted)
         if (omitted > 0) then
            call found%warn('velocities_left_out', &
               & numbers=real([omitted, found%problem%data%velocities%n], wp))
         end if
      end associate
      call check_contacts(found)
      call check_knowledge(found, is_explained .or. is_truncated(found%limits))
      call check_mixing(found)
      ! All attempts to find a sufficient degree for the theory have failed.
      if (is_usable(found%warnings) .and. found%field_error > allowed_error) then
         call found%warn('theory_rough', numbers=100.0_wp*[found%field_error, allowed_error])
      end if
      n = size(found%warnings)
      call check_determined()
      if (size(found%warnings) > n) call check_gains(found)
      if (.not. (is_explained .or. is_truncated(found%limits))) call check_residuals(found)

   contains

      !> Other models that explain the measurements better. The result cannot be used if the best
      !> one changes a constant that the measurements seem to determine.
      subroutine check_rivals()
         !> Log odds of a model that is preferred, and of one that is named.
         real(wp), parameter :: preferred = 7.0_wp, notable = 3.0_wp

         associate (diagnosis => found%diagnosis)
            if (size(diagnosis%rivals) > 0) then
               associate (best => diagnosis%rivals(1))
                  if (best%log_odds > preferred .and. (changes_result(best) &
                     & .or. found%is_misfit(unusable_p))) then
                     call found%warn('other_model', explained_text(diagnosis%rivals), &
                        & [best%log_odds])
                  else if (best%log_odds > notable) then
                     call found%warn('other_model_likely', explained_text(diagnosis%rivals), &
                        & [best%log_odds])
                  end if
               end associate
            end if
            if (diagnosis%order_odds > 0.0_wp .and. .not. diagnosis%follows_order &
               & .and. found%is_misfit(greatest_p)) then
               call found%warn('unexplained', numbers=[diagnosis%chi_square, diagnosis%freedom, &
                  & diagnosis%order_odds])
            end if
            if (found%is_misfit(unusable_p)) then
               call found%warn('residuals_wrong', numbers=[diagnosis%factor, diagnosis%chi_square, &
                  & diagnosis%freedom])
            end if
         end associate
      end subroutine check_rivals

      !> Whether another model moves a determined constant by more than an sd, or has an sd that is
      !> more than half as large again. Smaller ones matter less: the stated sds are then cautious.
      logical function changes_result(other)
         type(explanation_type), intent(in) :: other
         real(wp), parameter :: greatest_change = 1.5_wp
         integer :: i, j

         changes_result = .false.
         do i = 1, found%posterior%n_constants
            if (verdict_of(found%parameters(i)%mean, found%parameters(i)%sd, found%least_value(), &
               & found%parameter_shares(i)) /= 'determined') then
               cycle
            end if
            j = findloc(other%names == found%names(i), .true., dim=1)
            if (j == 0) cycle
            associate (stated => found%parameters(i))
               changes_result = changes_result .or. .not. (abs(other%mean(j) - stated%mean) &
                  & < stated%sd .and. other%sd(j) < greatest_change*stated%sd)
            end associate
         end do
      end function changes_result

      !> Bounds that exclude most of what the measurements determine without them.
      subroutine check_cuts()
         integer :: i

         do i = 1, found%posterior%n_constants
            associate (share => found%diagnosis%share_within(i))
               if (share < least_within) then
                  call found%warn('limit_excludes', trim(found%names(i)), &
                     & [100.0_wp*(1.0_wp - share)])
               end if
            end associate
         end do
      end subroutine check_cuts

      !> Constants that are not determined.
      subroutine check_determined()
         character(len=:), allocatable :: names
         integer :: i

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
         if (len(names) > 0) call found%warn('not_determined', names(3:))
      end subroutine check_determined
   end subroutine check_analysis

   !> The best explanation, others of its group that are nearly as good, and its remedy.
   function explained_text(rivals) result(text)
      type(explanation_type), intent(in) :: rivals(:)
      character(len=:), allocatable :: text
      !> Log odds within which explanations of a group cannot be told apart.
      real(wp), parameter :: alike = 3.0_wp
      integer :: i

      text = rivals(1)%explanation
      do i = 2, size(rivals)
         if (rivals(i)%group == rivals(1)%group &
            & .and. rivals(1)%log_odds - rivals(i)%log_odds < alike) then
            text = text//'; or '//rivals(i)%explanation
         end if
      end do
      if (len(rivals(1)%remedy) > 0) text = text//' ('//rivals(1)%remedy//')'
   end function explained_text

   !> Limits that truncate the posterior, either the stated ones or those of the surrogate.
   subroutine check_limits(found, stated)
      type(analysis_type), intent(inout) :: found
      logical, intent(in) :: stated
      character(len=:), allocatable :: name
      integer :: i, side

      do i = 1, size(found%limits)
         associate (limit => found%limits(i))
            if (limit%stated .neqv. stated) cycle
            name = trim(limit%name)
            if (.not. stated) name = name(index(name, '.') + 1:)
            do side = 1, 2
               if (.not. limit%truncates(side)) cycle
               call found%warn(trim(merge('truncated        ', 'outside_surrogate', stated)), &
                  & merge('upper', 'lower', side == 2)//' limit of '//name, &
                  & [limit%range(side), 100.0_wp*limit%share(side)])
            end do
         end associate
      end do
   end subroutine check_limits

   !> Values of &knowledge that contradict the measurements or the rest of the knowledge. Of
   !> correlated quantities only the one with the greatest conflict is reported.
   subroutine check_knowledge(found, is_explained)
      type(analysis_type), intent(inout) :: found
      !> Whether something else explains conflicts.
      logical, intent(in) :: is_explained
      logical :: usable
      integer :: j

      usable = is_usable(found%warnings)
      associate (knowledge => found%posterior%prior%knowledge, &
         & conflict => found%conflict%of_quantity)
         j = findloc(knowledge%is_sharp, .true., dim=1)
         if (j > 0) call found%warn('knowledge_sharp', known_text(knowledge, j))
         do j = 1, size(conflict)
            if (any(abs(knowledge%covariance(:, j)) > 0.0_wp .and. conflict > conflict(j))) cycle
            if (usable .and. conflict(j) > greatest_conflict) then
               call found%warn('knowledge_wrong', known_text(knowledge, j), &
                  & [conflict(j), greatest_conflict])
            else if (conflict(j) > far .and. .not. is_explained) then
               call found%warn('knowledge_contradicts', known_text(knowledge, j), &
                  & [conflict(j)])
            end if
         end do
         if (usable .and. found%conflict%sds > greatest_conflict &
            & .and. .not. any(conflict > greatest_conflict)) then
            call found%warn('knowledge_together', numbers=[found%conflict%sds, greatest_conflict])
         else if (found%conflict%sds > far .and. .not. (any(conflict > far) .or. is_explained)) then
            call found%warn('knowledge_conflict', numbers=[found%conflict%sds, &
               & found%conflict%growth, real(size(conflict), wp)])
         end if
      end associate
   end subroutine check_knowledge

   !> The parameter with the greatest R-hat, or else that with the smallest effective sample size.
   !> With NaN the chains have not mixed.
   subroutine check_mixing(found)
      type(analysis_type), intent(inout) :: found
      real(wp) :: effective(size(found%parameters)), greatest
      integer :: n_chains, level, i

      n_chains = size(found%chains%draws, 3)
      associate (diagnostics => found%parameters%diagnostics)
         effective = min(diagnostics%ess_bulk, diagnostics%ess_tail)
         ! The first level makes a result unusable.
         do level = 1, 2
            greatest = merge(found%most_r_hat(), greatest_r_hat, level == 1)
            ! One chain has no R-hat.
            if (n_chains > 1 .and. any(.not. diagnostics%r_hat <= greatest)) then
               i = max(1, maxloc(diagnostics%r_hat, dim=1))
               call found%warn(trim(merge('not_mixed   ', 'poorly_mixed', level == 1)), &
                  & trim(found%names(i)), [diagnostics(i)%r_hat, greatest])
               return
            end if
            associate (needed => least_size*merge(1, n_chains, level == 1))
               if (any(.not. effective >= needed)) then
                  i = max(1, minloc(effective, dim=1))
                  call found%warn(trim(merge('too_few_draws', 'few_draws    ', level == 1)), &
                     & trim(found%names(i)), [effective(i), real(needed, wp)])
                  return
               end if
            end associate
         end do
      end associate
   end subroutine check_mixing

   !> Knowledge that would reduce the sd of constants that are not determined.
   subroutine check_gains(found)
      type(analysis_type), intent(inout) :: found
      !> Knowledge is named if it would reduce an sd to this share.
      real(wp), parameter :: reduced_share = 0.7_wp
      character(len=:), allocatable :: precision
      integer :: i, j

      do i = 1, size(found%gains)
         associate (gain => found%gains(i))
            j = minloc(gain%sd_then/gain%sd_now, dim=1)
            if (gain%sd_then(j)/gain%sd_now(j) > reduced_share) cycle
            precision = fixed(100.0_wp*gain%relative_sd, 0)//' %'
            if (gain%known_sd > 0.0_wp) precision = '± '//short(gain%known_sd)//' GPa'
            call found%warn('knowledge_helps', trim(gain%name)//' to '//precision &
               & //' would reduce the sd of '//trim(found%names(j)), &
               & [gain%sd_now(j), gain%sd_then(j)])
         end associate
      end do
   end subroutine check_gains

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

   !> Residuals that are improbably large or small.
   subroutine check_residuals(found)
      type(analysis_type), intent(inout) :: found
      real(wp), parameter :: rare = 0.01_wp, rare_below = 0.05_wp

      associate (numbers => [found%diagnosis%chi_square, found%diagnosis%freedom], &
         & p => found%diagnosis%p)
         if (p < rare) then
            call found%warn('residuals_large', numbers=[numbers, 100.0_wp*p])
         else if (p > 1.0_wp - rare_below) then
            call found%warn('residuals_small', numbers=[numbers, 100.0_wp*(1.0_wp - p)])
         end if
      end associate
   end subroutine check_residuals

   !> Contact pressures that are too high, contact radii that differ from the surrogate's, and
   !> grains that are too small, by the columns depth_um, contact_radius_um and grain_radius_um.
   subroutine check_contacts(found)
      type(analysis_type), intent(inout) :: found
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error
      real(wp), dimension(found%posterior%n_moduli) :: contact_radius, pressure, allowed, bias
      character(len=:), allocatable :: code
      real(wp) :: difference
      integer :: worst, n

      call new_indenter(found%problem%settings%indenter, indenter, error)
      n = found%posterior%n_moduli
      if (allocated(error) .or. n == 0) return
      associate (measured => found%problem%data%measurements, &
         & trained_radius => found%surrogate%contact_radius, &
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
               call found%warn(code, numbers=[pressure(worst), &
                  & 100.0_wp*pressure(worst)/modulus(worst), allowed(worst)])
            end if
            if (trained_radius > 0.0_wp) then
               ! The correction for a film, for example, grows with the contact radius.
               difference = maxval(abs(contact_radius/trained_radius - 1.0_wp))
               if (any(depth > 0.0_wp .or. measured_radius > 0.0_wp) &
                  & .and. difference > small_difference) then
                  call found%warn('other_contact', &
                     & numbers=[minval(contact_radius), maxval(contact_radius), trained_radius, &
                     & correction, correction*difference])
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
               call found%warn('small_grains', printable(measured%name(worst)), &
                  & [real(count(abs(bias) > small_bias), wp), real(n, wp), 100.0_wp*bias(worst)])
            end if
         end associate
      end associate
   end subroutine check_contacts
end module posterior_diagnostics
