!> Rivals of the stated model: other models, each with one thing changed, that are compared with it
!> by their evidence on the same measurements.
!>
!> Posterior odds follow from evidence and prior weights. All rivals together weigh as much as the
!> stated model, each group as much as another, and the rivals of a group share its weight. Rivals
!> with equal predictions are one, with the weights of both.
module rivals
   use class_rivals, only: make_class
   use constants_posterior, only: posterior_type
   use drift_rivals, only: make_drift, make_session
   use errors, only: error_type
   use further_knowledge, only: without_knowledge
   use kinds, only: nan, wp
   use model_evidence, only: fit_model, fit_type
   use noise_rivals, only: make_outliers, make_phases, make_scale, make_scatter, name_outliers
   use order_rivals, only: make_any_order, make_reading
   use problem, only: problem_type
   use rival_cases, only: case_type, new_case, rival_type, set_up
   use statement_rivals, only: make_kind, make_knowledge, make_limits
   use statistics, only: chi_square_above, moments, sort_order
   use surrogate_model, only: surrogate_type
   use symmetric_harmonics, only: harmonics_type, new_harmonics
   implicit none
   private
   public :: explanation_type, diagnosis_type, compare_rivals, constants_at

   abstract interface
      !> Change the rival k of a row, k = 1, 2, .., which is the stated model on entry. Without an
      !> explanation there are no more.
      subroutine make_interface(case, k, rival)
         import
         type(case_type), intent(in) :: case
         integer, intent(in) :: k
         type(rival_type), intent(inout) :: rival
      end subroutine make_interface
   end interface

   type :: row_type
      character(len=12) :: group = ''
      procedure(make_interface), pointer, nopass :: make => null()
      !> Whether the rivals are values of one unknown number, and so one explanation; and whether
      !> their densities may have several maxima.
      logical :: is_one = .false., is_rough = .false.
   end type row_type

   type :: explanation_type
      character(len=:), allocatable :: explanation, group, remedy
      !> Logarithm of the posterior odds over the stated model.
      real(wp) :: log_odds = 0.0_wp
      !> Names of the constants, their means and sds, GPa; NaN where they are not computed.
      character(len=3), allocatable :: names(:)
      real(wp), allocatable :: mean(:), sd(:)
      type(fit_type) :: fit
      !> Row of the list and number there; number of rivals with equal predictions.
      integer, private :: row = 0, number = 0, merged = 1
      !> Moduli that it predicts for the stated crystal, GPa, (row, 1).
      real(wp), allocatable, private :: moduli(:, :)
   end type explanation_type

   type :: diagnosis_type
      !> Models that are compared, the best first; and the stated one.
      type(explanation_type), allocatable :: rivals(:)
      type(explanation_type) :: stated
      !> Chi-square of the moduli about those that they determine, its degrees of freedom, the
      !> probability of a larger one, and the factor on the sds that would mend it. NaN where the
      !> sds are not stated.
      real(wp) :: chi_square = nan, freedom = nan, p = nan, factor = nan
      !> Log evidence of the orientations in any order over that of the stated order; NaN if it is
      !> not known. Whether the moduli follow the stated order more closely than a random one, with
      !> whatever sds.
      real(wp) :: order_odds = nan
      logical :: follows_order = .false.
      !> Share of each constant's distribution that each of the stated bounds admits, the smaller of
      !> both, if the measurements alone determine the constant, (n_constants); else 1.
      real(wp), allocatable :: share_within(:)
   end type diagnosis_type

   integer, parameter :: n_groups = 5
   !> Rivals are refined if their log odds are above the first value and at most the second below
   !> the best; number of those that are listed.
   real(wp), parameter :: least_odds = -1.0_wp, near = 6.0_wp
   integer, parameter :: most_refined = 5, most_listed = 12
   !> Log odds that a rival needs where measurements rarely tell, so that it is else an assumption.
   real(wp), parameter :: needed = 3.0_wp

contains

   !> All rivals, a row for each kind.
   function all_rows() result(rows)
      type(row_type), allocatable :: rows(:)

      rows = [row_type('symmetry', make_class), &
         & row_type('orientations', make_reading), &
         & row_type('orientations', make_any_order), &
         & row_type('time', make_drift), &
         & row_type('time', make_session, is_one=.true.), &
         & row_type('noise', make_scale)]
      rows = [rows, row_type('noise', make_scatter, is_one=.true.), &
         & row_type('noise', make_outliers, is_one=.true., is_rough=.true.), &
         & row_type('noise', make_phases, is_one=.true., is_rough=.true.)]
      rows = [rows, row_type('statements', make_kind), &
         & row_type('statements', make_knowledge), &
         & row_type('statements', make_limits)]
   end function all_rows

   !> Compare all rivals with the stated model.
   subroutine compare_rivals(problem, surrogate, posterior, best, diagnosis, error)
      type(problem_type), intent(in), target :: problem
      type(surrogate_type), intent(in), target :: surrogate
      type(posterior_type), intent(in) :: posterior
      !> A point of high posterior density, (dimension).
      real(wp), intent(in) :: best(:)
      type(diagnosis_type), intent(out) :: diagnosis
      type(error_type), allocatable, intent(out) :: error
      type(case_type) :: case
      type(row_type), allocatable :: rows(:)
      !> Residuals less the shared errors, in sds, and these, GPa.
      real(wp), dimension(posterior%n_grains) :: residuals, scales
      !> Logarithm of the greatest density of the measurements, and by how much for each parameter
      !> their evidence may be below it.
      real(wp) :: greatest
      real(wp), parameter :: most_below = 15.0_wp
      integer :: i

      allocate (diagnosis%rivals(0))
      diagnosis%share_within = spread(1.0_wp, 1, posterior%n_constants)
      if (posterior%n_moduli == 0 .or. allocated(posterior%unknown)) return
      call set_misfit()
      if (allocated(error)) return
      call new_case(problem, surrogate, posterior, residuals(:posterior%n_moduli), case, error)
      if (allocated(error)) return
      case%crystal = posterior%stiffness(best)
      case%moduli = case%stated%moduli_at(reshape(best, [size(best), 1]))
      case%scales = scales(case%points)/posterior%errors%scale
      if (posterior%prior%is_cut()) then
         call find_cuts()
         if (allocated(error)) return
      end if
      associate (fit => diagnosis%stated%fit)
         call fit_model(case%stated, case%crystal, .true., .false., fit)
         ! Of many constants the draws may be too few. Laplace's approximation remains.
         if (.not. fit%found) call fit_model(case%stated, case%crystal, .false., .false., fit)
         ! The integral may not be found in the corner of narrow limits, or elsewhere than where the
         ! density is. It is below its maximum.
         if (size(case%points) == posterior%n_grains) then
            if (fit%log_z < greatest - most_below*case%stated%dimension) fit%found = .false.
            if (.not. fit%found) fit%log_z = greatest
         else if (.not. fit%found) then
            return
         end if
      end associate
      rows = all_rows()
      do i = 1, size(rows)
         call add_row(case, rows(i), i, diagnosis, error)
         if (allocated(error)) return
      end do
      call weigh(diagnosis)
      call refine(case, rows, diagnosis, error)
      if (allocated(error)) return
      call weigh(diagnosis)
      associate (listed => diagnosis%rivals%log_odds > needed &
         & .or. [(diagnosis%rivals(i)%group /= 'statements', i=1, size(diagnosis%rivals))])
         diagnosis%rivals = pack(diagnosis%rivals, listed)
      end associate
      diagnosis%rivals = diagnosis%rivals(:min(most_listed, size(diagnosis%rivals)))

   contains

      !> Set chi-square at the point of high density, with the errors that the moduli share.
      subroutine set_misfit()
         type(harmonics_type) :: harmonics
         real(wp) :: model(posterior%n_grains)
         real(wp), allocatable :: u(:, :), b(:), l(:, :)

         call posterior%predict_measurements(best, posterior%stiffness(best), model, scales, u)
         residuals = (posterior%data%modulus - model)/scales
         call posterior%errors%integrate(residuals, u, b, l, greatest)
         greatest = greatest - sum(log(scales)) &
            & - 0.5_wp*sum(posterior%prior%deviations(posterior%stiffness(best))**2)
         residuals = residuals - matmul(u, b)
         ! Indentation determines as many combinations of constants as there are harmonics.
         call new_harmonics(posterior%prior%class%generators, 4, harmonics, error)
         if (allocated(error)) return
         if (posterior%infers_scale .or. posterior%settings%likelihood /= 'normal' &
            & .or. posterior%n_moduli <= harmonics%n) then
            return
         end if
         associate (n => posterior%n_moduli, chi_square => diagnosis%chi_square, &
            & freedom => diagnosis%freedom)
            chi_square = sum(residuals(:n)**2) + sum(b**2)
            freedom = n - harmonics%n
            diagnosis%p = chi_square_above(chi_square, nint(freedom))
            diagnosis%factor = sqrt(chi_square/freedom)
            diagnosis%follows_order = explains_more(model(:n) + scales(:n)*residuals(:n), &
               & scales(:n), residuals(:n), harmonics%n)
         end associate
      end subroutine set_misfit

      !> Find how much of what the measurements determine without the limits is within the bounds.
      subroutine find_cuts()
         !> Relative sd of a constant that the measurements determine.
         real(wp), parameter :: determined = 0.15_wp
         type(posterior_type) :: free
         type(explanation_type) :: found
         real(wp), allocatable :: x(:, :)
         integer :: i, j

         ! Knowledge may contradict the measurements by itself.
         call without_knowledge(case%stated, free, error)
         if (allocated(error)) return
         free%prior = free%prior%without_limits()
         call fit_model(free, case%crystal, .true., .false., found%fit)
         if (.not. found%fit%found) return
         call set_moments(free, found)
         allocate (x(free%dimension, size(found%fit%weights)))
         do i = 1, size(x, 2)
            x(:, i) = constants_at(free, found%fit%draws(:, i))
         end do
         do j = 1, size(found%mean)
            if (found%sd(j) > determined*abs(found%mean(j))) cycle
            associate (prior => case%stated%prior)
               diagnosis%share_within(j) = min( &
                  & sum(found%fit%weights, mask=x(j, :) >= prior%lower(j)), &
                  & sum(found%fit%weights, mask=x(j, :) <= prior%upper(j)))
            end associate
         end do
      end subroutine find_cuts
   end subroutine compare_rivals

   !> Whether a model explains a larger share of the scatter of some values than it would of values
   !> in random order, of which the share has a beta distribution: its mean and four sds.
   pure logical function explains_more(values, sds, residuals, n_parameters)
      !> The values and their sds; what the model leaves, in sds, (n).
      real(wp), intent(in) :: values(:), sds(:), residuals(:)
      !> Number of parameters of the model, one of which is a constant.
      integer, intent(in) :: n_parameters
      real(wp) :: mean, expected, sd, k, n

      n = size(values) - 1.0_wp
      k = n_parameters - 1.0_wp
      mean = sum(values/sds**2)/sum(1.0_wp/sds**2)
      expected = k/n
      sd = sqrt(2.0_wp*expected*(1.0_wp - expected)/(n + 2.0_wp))
      explains_more = 1.0_wp - sum(residuals**2)/sum(((values - mean)/sds)**2) &
         & > expected + 4.0_wp*sd
   end function explains_more

   !> Turn evidences into posterior odds, and sort them.
   subroutine weigh(diagnosis)
      type(diagnosis_type), intent(inout) :: diagnosis
      !> Rivals of the same group, those that were merged counted each.
      integer :: order(size(diagnosis%rivals)), in_group, i, k

      associate (rivals => diagnosis%rivals)
         do k = 1, size(rivals)
            in_group = sum([(merge(rivals(i)%merged, 0, rivals(i)%group == rivals(k)%group), &
               & i=1, size(rivals))])
            rivals(k)%log_odds = rivals(k)%fit%log_z - diagnosis%stated%fit%log_z &
               & - log(n_groups*in_group/real(rivals(k)%merged, wp))
         end do
         call sort_order(-rivals%log_odds, order)
      end associate
      diagnosis%rivals = diagnosis%rivals(order)
   end subroutine weigh

   !> Refine the evidence of the best rivals, and set their constants.
   subroutine refine(case, rows, diagnosis, error)
      type(case_type), intent(in) :: case
      type(row_type), intent(in) :: rows(:)
      type(diagnosis_type), intent(inout) :: diagnosis
      type(error_type), allocatable, intent(out) :: error
      type(rival_type) :: rival
      type(fit_type) :: fit
      real(wp) :: rough
      integer :: i

      do i = 1, min(most_refined, size(diagnosis%rivals))
         associate (found => diagnosis%rivals(i), row => rows(diagnosis%rivals(i)%row))
            if (found%log_odds < max(least_odds, diagnosis%rivals(1)%log_odds - near)) exit
            call make_rival(case, row, found%number, rival, error)
            if (allocated(error)) return
            rough = found%fit%rough_log_z
            associate (prior => rival%posterior%prior)
               call fit_model(rival%posterior, prior%logarithms%from_logarithms( &
                  & found%fit%maximum(:prior%n_constants)), .true., row%is_rough, fit, found%fit)
            end associate
            if (.not. fit%found) cycle
            fit%log_z = found%fit%log_z + fit%log_z - rough
            ! Only approximations of the same kind are compared.
            if (.not. allocated(diagnosis%stated%fit%draws)) fit%log_z = found%fit%log_z
            found%fit = fit
            call set_moments(rival%posterior, found)
         end associate
      end do
   end subroutine refine

   !> Make the rival k of a row.
   subroutine make_rival(case, row, k, rival, error)
      type(case_type), intent(in) :: case
      type(row_type), intent(in) :: row
      integer, intent(in) :: k
      type(rival_type), intent(out) :: rival
      type(error_type), allocatable, intent(out) :: error

      rival%remedy = ''
      rival%data = case%stated%data
      rival%settings = case%stated%settings
      call row%make(case, k, rival)
      call set_up(case, rival, error)
   end subroutine make_rival

   !> Fit all rivals of a row.
   subroutine add_row(case, row, place, diagnosis, error)
      type(case_type), intent(in) :: case
      type(row_type), intent(in) :: row
      !> Number of the row.
      integer, intent(in) :: place
      type(diagnosis_type), intent(inout) :: diagnosis
      type(error_type), allocatable, intent(out) :: error
      type(rival_type) :: rival
      type(explanation_type) :: new, best
      type(fit_type), allocatable :: near
      real(wp) :: total
      integer :: k, members

      if (row%group /= 'symmetry') near = diagnosis%stated%fit
      members = 0
      total = 0.0_wp
      do k = 1, huge(k) - 1
         call make_rival(case, row, k, rival, error)
         if (allocated(error) .or. .not. allocated(rival%explanation)) exit
         if (.not. allocated(rival%posterior)) cycle
         if (is_equal()) cycle
         members = members + 1
         new%row = place
         new%number = k
         new%group = trim(row%group)
         new%remedy = rival%remedy
         call fit_model(rival%posterior, case%crystal, .false., row%is_rough, new%fit, near)
         if (.not. new%fit%found) cycle
         if (allocated(rival%posterior%unknown)) then
            diagnosis%order_odds = new%fit%log_z - diagnosis%stated%fit%log_z
         end if
         call name_outliers(case, rival, constants_at(rival%posterior, new%fit%maximum))
         new%explanation = rival%explanation
         new%fit%log_z = new%fit%log_z + rival%log_rest
         new%names = rival%posterior%prior%class%constants
         new%mean = spread(nan, 1, size(new%names))
         new%sd = new%mean
         if (.not. row%is_one) then
            diagnosis%rivals = [diagnosis%rivals, new]
         else
            if (.not. allocated(best%explanation)) best = new
            total = total*exp(min(0.0_wp, best%fit%log_z - new%fit%log_z)) &
               & + exp(min(0.0_wp, new%fit%log_z - best%fit%log_z))
            if (new%fit%log_z > best%fit%log_z) best = new
         end if
      end do
      if (.not. allocated(best%explanation)) return
      best%fit%log_z = best%fit%log_z + log(total/members)
      diagnosis%rivals = [diagnosis%rivals, best]

   contains

      !> Whether other orientations predict the same moduli as the stated ones, or as those of an
      !> earlier rival, which then is both. Those of `new` are set.
      logical function is_equal()
         integer :: i

         is_equal = .false.
         if (row%group /= 'orientations' .or. allocated(rival%posterior%unknown)) return
         new%moduli = rival%posterior%moduli_at(reshape(case%stated%prior%class%constants_of( &
            & case%crystal), [case%stated%n_constants, 1]))
         is_equal = are_alike(new%moduli, case%moduli)
         if (is_equal) return
         do i = 1, size(diagnosis%rivals)
            associate (other => diagnosis%rivals(i))
               if (.not. allocated(other%moduli)) cycle
               if (.not. are_alike(new%moduli, other%moduli)) cycle
               is_equal = .true.
               other%explanation = other%explanation//', or '//rival%explanation
               other%merged = other%merged + 1
               return
            end associate
         end do
      end function is_equal
   end subroutine add_row

   pure logical function are_alike(a, b)
      real(wp), intent(in) :: a(:, :), b(:, :)
      real(wp), parameter :: rounding = 1.0e-6_wp

      are_alike = all(abs(a - b) < rounding*b)
   end function are_alike

   !> Parameters at the working coordinates `w`.
   pure function constants_at(posterior, w) result(x)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: w(:)
      real(wp) :: x(size(w))

      x = w
      associate (k => posterior%n_constants, prior => posterior%prior)
         x(:k) = prior%class%constants_of(prior%logarithms%from_logarithms(w(:k)))
      end associate
   end function constants_at

   !> Set the means and sds of the constants.
   subroutine set_moments(posterior, found)
      type(posterior_type), intent(in) :: posterior
      type(explanation_type), intent(inout) :: found
      real(wp) :: x(posterior%dimension, size(found%fit%weights))
      integer :: i

      do i = 1, size(x, 2)
         x(:, i) = constants_at(posterior, found%fit%draws(:, i))
      end do
      found%mean = spread(nan, 1, posterior%n_constants)
      found%sd = found%mean
      call moments(x(:posterior%n_constants, :), found%mean, found%sd, found%fit%weights)
   end subroutine set_moments

end module rivals
