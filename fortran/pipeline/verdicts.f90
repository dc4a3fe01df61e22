!> What a person should know of a posterior before believing it, in plain words. Nothing is withheld because of them.
module verdicts
   use chain_diagnostics, only: diagnostics_type
   use constants_prior, only: knowledge_type
   use field_degree, only: allowed_error
   use files, only: printable
   use further_knowledge, only: gain_type
   use kinds, only: wp
   use knowledge_conflict, only: conflict_type
   use point_tables, only: points_type
   use model_checks, only: checks_type
   use prior_sensitivity, only: change_type
   use posterior_summary, only: combination_type, decided_by_data, left_open
   use text, only: fixed, to_text
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: judge_coverage, judge_mixing, judge_ridges, judge_open, judge_theory, judge_bound, judge_grains
   public :: judge_checks, judge_sensitivity, judge_knowledge, known_text, powers_text

   !> Chains have mixed if R-hat is below and the effective sample sizes of a parameter are above this for each chain (Vehtari et
   !> al., Bayesian Anal. 16, 667, 2021).
   real(wp), parameter :: greatest_r_hat = 1.01_wp
   integer, parameter :: least_size = 100

contains

   !> A surrogate that knows only a part of the prior.
   subroutine judge_coverage(share_inside, known_scale, warnings)
      !> Share of the stated crystals that are in the surrogate's domain.
      real(wp), intent(in) :: share_inside
      !> Of a prior, see `constants_prior`.
      real(wp), intent(in) :: known_scale(2)
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      character(len=:), allocatable :: scale

      scale = ''
      if (known_scale(2) < huge(1.0_wp)) scale = ' (a scale, the geometric mean of the stiffness'' eigenvalues, of ' &
         & //fixed(known_scale(1), 1)//' to '//fixed(known_scale(2), 1)//' GPa)'
      if (share_inside < 0.99_wp) call warn(warnings, 'the surrogate knows '//fixed(100.0_wp*share_inside, 0)//' % of the ' &
         & //'crystals within the stated bounds'//scale//'; the posterior is cut to these')
   end subroutine judge_coverage

   !> Theory that was read too roughly, after all attempts.
   subroutine judge_theory(largest_error, warnings)
      !> Of a grain's modulus, in sds of its measurement.
      real(wp), intent(in) :: largest_error
      type(warning_type), allocatable, intent(inout) :: warnings(:)

      if (largest_error > allowed_error) call warn(warnings, 'the expansion of the theory errs by ' &
         & //fixed(100.0_wp*largest_error, 0)//' % of the sd of a grain at one of the draws; the aim is ' &
         & //fixed(100.0_wp*allowed_error, 0)//' %')
   end subroutine judge_theory

   !> Poor R-hat and effective sample sizes of the parameter `name` over all `chains`; NaN has not mixed.
   subroutine judge_mixing(name, diagnostics, chains, method, warnings)
      character(len=*), intent(in) :: name
      type(diagnostics_type), intent(in) :: diagnostics
      integer, intent(in) :: chains
      !> Of the sampler.
      character(len=*), intent(in) :: method
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      character(len=:), allocatable :: said, remedy
      real(wp) :: size

      size = min(diagnostics%ess_bulk, diagnostics%ess_tail)
      if ((diagnostics%r_hat < greatest_r_hat .or. chains == 1) .and. size > least_size*chains) return
      said = 'there is one chain'
      if (chains > 1) said = 'R-hat is '//fixed(diagnostics%r_hat, 3)//' (below '//to_text(greatest_r_hat)//' is well)'
      remedy = 'take more samples'
      if (method /= 'ensemble') remedy = remedy//', or method ''ensemble'''
      call warn(warnings, 'the chains of '//name//' have not mixed: '//said//', and they are worth '//fixed(size, 0) &
         & //' independent samples; '//remedy)
   end subroutine judge_mixing

   !> The constants that trade off, with what the data decided and what the prior did.
   subroutine judge_ridges(names, correlation, combinations, warnings)
      !> Of the constants.
      character(len=*), intent(in) :: names(:)
      !> (constant, constant).
      real(wp), intent(in) :: correlation(:, :)
      type(combination_type), intent(in) :: combinations(:)
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: strong = 0.7_wp
      character(len=:), allocatable :: pairs, known, hidden, words
      !> More are not read.
      integer, parameter :: most = 3
      integer :: i, j, found

      pairs = ''
      known = ''
      hidden = ''
      found = 0
      do i = 1, size(combinations)
         words = powers_text(names, combinations(i)%exponents)
         if (combinations(i)%contraction > decided_by_data .and. i <= most) known = listed(known, words)
         if (combinations(i)%contraction < left_open .and. size(combinations) - i < most) hidden = listed(hidden, words)
      end do
      if (len(hidden) == 0) return
      do i = 1, size(names)
         do j = 1, i - 1
            if (.not. abs(correlation(i, j)) > strong) cycle
            found = found + 1
            if (found <= most) pairs = pairs//trim(names(i))//' and '//trim(names(j)) &
               & //' trade off (correlation '//fixed(correlation(i, j), 2)//'); '
         end do
      end do
      if (found > most) pairs = pairs//'so do '//to_text(found - most)//' other pairs; '
      if (len(known) == 0) known = 'no combination by themselves'
      call warn(warnings, pairs//'the data decided '//known//'; the prior decided '//hidden)
   end subroutine judge_ridges

   !> How many combinations indentation alone leaves open, which constants that is mostly, and what would close them.
   subroutine judge_open(names, combinations, gains, warnings)
      !> Of the constants.
      character(len=*), intent(in) :: names(:)
      type(combination_type), intent(in) :: combinations(:)
      type(gain_type), intent(in) :: gains(:)
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      !> Share of a constant's variance that is the open combinations', and of its sd that knowledge leaves, to be named.
      real(wp), parameter :: mostly = 0.8_wp, worth_it = 0.7_wp
      character(len=:), allocatable :: which, advice
      real(wp) :: share(size(names)), ratio(size(names))
      integer :: i, j, open

      open = 0
      share = 0.0_wp
      do i = 1, size(combinations)
         if (combinations(i)%contraction >= left_open) cycle
         open = open + 1
         share = share + combinations(i)%correlations**2
      end do
      if (open == 0) return
      which = ''
      do j = 1, size(names)
         if (share(j) >= mostly*maxval(share)) which = listed(which, trim(names(j)))
      end do
      advice = ''
      do i = 1, size(gains)
         ratio = gains(i)%sd_then/gains(i)%sd_now
         j = minloc(ratio, dim=1)
         if (ratio(j) > worth_it) cycle
         if (len(advice) > 0) advice = advice//'; '
         advice = advice//trim(gains(i)%name)//' to '//fixed(100.0_wp*gains(i)%relative_sd, 0)//' % would bring the sd of ' &
            & //trim(names(j))//' from '//short(gains(i)%sd_now(j))//' to '//short(gains(i)%sd_then(j))//' GPa'
      end do
      if (len(advice) > 0) advice = '. Say in &knowledge what else is known: '//advice
      call warn(warnings, 'the data leave '//to_text(open)//' of '//to_text(size(names))//' combinations open (' &
         & //which//', mostly)'//advice)
   end subroutine judge_open

   !> What is said in &knowledge and cannot be brought together with all else.
   subroutine judge_knowledge(knowledge, conflict, warnings)
      type(knowledge_type), intent(in) :: knowledge
      type(conflict_type), intent(in) :: conflict
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: far = 3.0_wp
      integer :: j

      do j = 1, size(knowledge%mean)
         ! Of correlated ones the worst takes the others with it.
         if (any(abs(knowledge%covariance(:, j)) > 0.0_wp .and. conflict%of_quantity > conflict%of_quantity(j))) cycle
         if (conflict%of_quantity(j) > far) call warn(warnings, 'what is said of '//known_text(knowledge, j) &
            & //' contradicts all else that is known or measured by '//fixed(conflict%of_quantity(j), 1)//' sd')
      end do
      if (conflict%sds > far .and. .not. any(conflict%of_quantity > far)) call warn(warnings, 'what is known contradicts the ' &
         & //'measurements, or itself, by '//fixed(conflict%sds, 1)//' sd: with it the least misfit grows by ' &
         & //fixed(conflict%growth, 1)//' for '//to_text(size(knowledge%mean))//' quantities')
   end subroutine judge_knowledge

   !> 'bulk_modulus = 165 ± 3.3 GPa', of the quantity j of what is known.
   function known_text(knowledge, j) result(words)
      type(knowledge_type), intent(in) :: knowledge
      integer, intent(in) :: j
      character(len=:), allocatable :: words
      real(wp) :: sd(size(knowledge%mean))

      sd = knowledge%sd()
      words = knowledge%quantities(j)%name//' = '//with_sd(knowledge%mean(j), sd(j), knowledge%quantities(j)%unit)
   end function known_text

   function with_sd(mean, sd, unit) result(words)
      real(wp), intent(in) :: mean, sd
      character(len=*), intent(in) :: unit
      character(len=:), allocatable :: words

      words = to_text(mean, 4)//' ± '//short(sd)
      if (unit /= '1') words = words//' '//unit
   end function with_sd

   !> Two digits, or as many as there are before the point.
   pure function short(value) result(words)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: words

      if (abs(value) < 10.0_wp) then
         words = to_text(value, 2)
      else
         words = fixed(value, 0)
      end if
   end function short

   !> 'C11^1.00 C12^-0.30' of constants with these `names` and `exponents`; powers that hardly count are left out.
   pure function powers_text(names, exponents) result(words)
      character(len=*), intent(in) :: names(:)
      real(wp), intent(in) :: exponents(:)
      character(len=:), allocatable :: words
      real(wp), parameter :: least = 0.05_wp
      integer :: i

      words = ''
      do i = 1, size(names)
         if (abs(exponents(i)) >= least) words = words//' '//trim(names(i))//'^'//fixed(exponents(i), 2)
      end do
      words = words(2:)
   end function powers_text

   pure function listed(list, item) result(longer)
      character(len=*), intent(in) :: list, item
      character(len=:), allocatable :: longer

      longer = item
      if (len(list) > 0) longer = list//', '//item
   end function listed

   !> Draws of the constant `name` that crowd at a bound: the last of twenty bins ends there and is not empty.
   subroutine judge_bound(name, draws, lower, upper, warnings)
      character(len=*), intent(in) :: name
      !> (sample, chain), and the bounds, GPa.
      real(wp), intent(in) :: draws(:, :), lower, upper
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      integer, parameter :: bins = 20
      real(wp), parameter :: crowded = 0.35_wp, at_bound = 0.01_wp
      integer :: counts(bins), i, j, k
      real(wp) :: low, high

      low = minval(draws)
      high = maxval(draws)
      if (.not. high > low) return
      counts = 0
      do j = 1, size(draws, 2)
         do i = 1, size(draws, 1)
            k = min(bins, 1 + int(bins*((draws(i, j) - low)/(high - low))))
            counts(k) = counts(k) + 1
         end do
      end do
      if (low - lower < at_bound*(high - low) .and. counts(1) > crowded*maxval(counts)) call tell(lower, 'lower')
      if (upper - high < at_bound*(high - low) .and. counts(bins) > crowded*maxval(counts)) call tell(upper, 'upper')

   contains

      subroutine tell(bound, word)
         real(wp), intent(in) :: bound
         character(len=*), intent(in) :: word

         call warn(warnings, name//' piles up at its bound of '//to_text(bound)//' GPa: the '//word &
            & //' bound, not the data, ends its distribution there')
      end subroutine tell
   end subroutine judge_bound

   !> Grains whose modulus disagrees with all others; the `likelihood` may take that into account.
   subroutine judge_grains(points, measured, predicted, scale, likelihood, warnings)
      type(points_type), intent(in) :: points
      !> Measured moduli, means of what is predicted, and the errors' sds; GPa, (grain).
      real(wp), intent(in) :: measured(:), predicted(:), scale(:)
      character(len=*), intent(in) :: likelihood
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      !> Beyond 3 sd; among very many grains so far that chance leaves fewer there than among the first hundred, and most that are named.
      real(wp), parameter :: least_far = 3.0_wp, by_chance = 0.27_wp
      integer, parameter :: most_named = 20
      character(len=:), allocatable :: advice
      real(wp) :: residual, far
      integer :: named, i

      far = least_far
      do while (size(measured)*erfc(far/sqrt(2.0_wp)) > by_chance)
         far = far + 0.01_wp
      end do
      named = 0
      advice = '; likelihood ''student'' gives such grains less weight'
      if (likelihood == 'student') advice = ''
      do i = 1, size(measured)
         residual = (measured(i) - predicted(i))/scale(i)
         if (.not. abs(residual) > far) cycle
         named = named + 1
         if (named > most_named) cycle
         call warn(warnings, 'grain '//printable(points%name(i))//' disagrees with the others: its modulus is ' &
            & //fixed(abs(residual), 1)//' sd '//trim(merge('above', 'below', residual > 0.0_wp)) &
            & //' what all grains together predict'//advice)
      end do
      if (named > most_named) call warn(warnings, to_text(named - most_named)//' more grains disagree with the others')
   end subroutine judge_grains

   !> Measurements that the model could hardly have given.
   subroutine judge_checks(checks, points, warnings)
      type(checks_type), intent(in) :: checks
      !> The measurements, for the names of the grains.
      type(points_type), intent(in) :: points
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: rare = 0.01_wp
      character(len=:), allocatable :: size_of_it

      size_of_it = 'chi-square of the residuals is '//to_text(checks%chi_square, 3)//' for ' &
         & //to_text(size(checks%log_likelihood, 1))//' grains; '
      if (checks%chi_square_p < rare) then
         call warn(warnings, 'the grains scatter more than their sds say: '//size_of_it//share(checks%chi_square_p) &
            & //' of data sets drawn from the posterior scatter more; the sds are too small, or grains differ in more than their ' &
            & //'orientation (scatter_sd, scale = ''inferred'', likelihood = ''student'')')
      else if (checks%chi_square_p > 1.0_wp - rare) then
         call warn(warnings, 'the grains scatter less than their sds say: '//size_of_it//share(1.0_wp - checks%chi_square_p) &
            & //' of data sets drawn from the posterior scatter less; the sds are too large, or have an error in them that all ' &
            & //'grains share (calibration_sd)')
      end if
      if (checks%extreme_p < rare) call warn(warnings, 'the worst grain, '//printable(points%name(checks%extreme_grain))//', is ' &
         & //fixed(abs(checks%extreme_residual), 1)//' sd off: the worst grain is further off in '//share(checks%extreme_p) &
         & //' of data sets drawn from the posterior')

   contains

      pure function share(p) result(words)
         real(wp), intent(in) :: p
         character(len=:), allocatable :: words

         words = fixed(100.0_wp*p, 1)//' %'
         if (.not. p > 0.0_wp) words = 'none'
      end function share
   end subroutine judge_checks

   !> Results that lean on a limit of the prior or on its measure: of each the parameter that moves most.
   subroutine judge_sensitivity(names, changes, warnings)
      !> Of the parameters.
      character(len=*), intent(in) :: names(:)
      type(change_type), intent(in) :: changes(:)
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp), parameter :: matters = 0.1_wp
      !> More are not read.
      integer, parameter :: most = 3
      real(wp) :: largest(size(changes))
      character(len=:), allocatable :: told
      integer :: i, j, round

      do i = 1, size(changes)
         largest(i) = 0.0_wp
         do j = 1, size(names)
            ! What is not a number is not larger.
            if (abs(changes(i)%shift(j)) > largest(i)) largest(i) = abs(changes(i)%shift(j))
         end do
      end do
      told = ''
      do round = 1, most
         i = maxloc(largest, dim=1)
         if (.not. largest(i) > matters) exit
         if (len(told) > 0) told = told//'; '
         told = told//words_of(changes(i))
         ! In or out, the same limit is told of once.
         where (changes%name == changes(i)%name .and. (changes%is_upper .eqv. changes(i)%is_upper)) largest = 0.0_wp
      end do
      if (len(told) > 0) call warn(warnings, 'the prior has a say: '//told)

   contains

      function words_of(change) result(words)
         type(change_type), intent(in) :: change
         character(len=:), allocatable :: words
         integer :: worst

         worst = maxloc(abs(change%shift), dim=1)
         words = trim(names(worst))//' would be '//fixed(abs(change%shift(worst)), 1)//' sd ' &
            & //trim(merge('higher', 'lower ', change%shift(worst) > 0.0_wp))
         if (change%name == 'measure') then
            words = words//' with the other measure of the prior'
         else
            words = words//' with the '//trim(merge('upper', 'lower', change%is_upper))//' limit of '//trim(change%name)//' at ' &
               & //to_text(change%to, 4)//' instead of '//to_text(change%from, 4)
            if (.not. change%exact) words = words//' (estimated)'
         end if
      end function words_of
   end subroutine judge_sensitivity
end module verdicts
