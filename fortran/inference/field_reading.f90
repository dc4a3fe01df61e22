!> The degree of the surface harmonics that represent the half-space theory in a posterior. It is
!> chosen by the error of the worst grain.
module field_reading
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use kinds, only: wp
   use statistics, only: median
   implicit none
   private
   public :: choose_field_degree, find_field_error, allowed_error

   !> Allowed error of the worst grain, in its sds.
   real(wp), parameter :: allowed_error = 0.02_wp
   !> Allowed error of all grains together, the root of the sum of squares in their sds. An equal
   !> error of all grains would shift the posterior by as many of its sds.
   real(wp), parameter :: allowed_together = 0.2_wp
   !> Greatest number of grains that are checked.
   integer, parameter :: most_checked = 50
   !> Degrees that are compared.
   integer, parameter :: degrees(*) = [6, 8, 10, 12, 14, 16, 20, 24, 28], hopeless_degree = 20

contains

   !> Choose the cheapest degree, and the log-anisotropy above which the theory is computed without
   !> harmonics, for which the errors at some draws are allowed. If there is none, the last degree
   !> is used without an `error`.
   subroutine choose_field_degree(posterior, draws, threads, error, is_hopeless)
      type(posterior_type), intent(inout) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      type(error_type), allocatable, intent(out) :: error
      !> Whether no draw explains the measurements. Harmonics then represent the theory of every
      !> crystal: the constants are not used, and the exact theory of the extremely anisotropic
      !> crystals to which a wrong statement leads would take hours.
      logical, intent(out), optional :: is_hopeless
      !> Stride of the draws that show the error of an expansion over directions.
      integer, parameter :: some = 10
      !> Factor on the allowed error, since the draws of the chains differ from these. Factor for
      !> the grains with which proposals are found, and the share of draws that must satisfy it.
      real(wp), parameter :: reserve = 0.3_wp, rough_errors = 5.0_wp, most_draws = 0.8_wp
      real(wp) :: anisotropy(size(draws, 2)), errors(size(draws, 2)), cost, least_cost, least_wrong
      real(wp), allocatable :: exact(:, :)
      class(grain_model_type), allocatable :: best
      integer :: i

      anisotropy = [(log_anisotropy(posterior%stiffness(draws(:, i))), i=1, size(draws, 2))]
      call exact_moduli(posterior, draws, threads, exact, error)
      if (allocated(error)) return
      if (present(is_hopeless)) then
         is_hopeless = all([(explains_nothing(i), i=1, size(draws, 2))])
         if (is_hopeless) call posterior%set_field_degree(hopeless_degree, error)
         if (is_hopeless) return
      end if
      least_cost = huge(least_cost)
      if (allocated(posterior%rough)) deallocate (posterior%rough)
      do i = 1, size(degrees)
         call posterior%set_field_degree(degrees(i), error)
         if (allocated(error)) return
         associate (grains => posterior%grains)
            ! Higher degrees cost more than the best one so far.
            if (grains%field_cost >= least_cost) exit
            call grains%use_field_up_to(huge(least_cost))
            errors = field_errors(posterior, draws, exact, threads)
            if (.not. allocated(posterior%rough) &
               & .and. count(errors < rough_errors*allowed_error) > most_draws*size(errors)) then
               allocate (posterior%rough, source=grains)
            end if
            if (any(errors > reserve*allowed_error)) then
               least_wrong = minval(anisotropy, mask=errors > reserve*allowed_error)
               ! If the errors of all draws are too large, harmonics are not used at all.
               call grains%use_field_up_to(merge(0.98_wp*least_wrong, 0.0_wp, &
                  & any(anisotropy < least_wrong)))
               ! For many grains an expansion over directions remains. Some draws show its error.
               if (any(field_errors(posterior, draws(:, ::some), exact(:, ::some), threads) &
                  & > reserve*allowed_error) .and. i < size(degrees)) then
                  cycle
               end if
            end if
            cost = grains%field_cost &
               & + grains%full_cost*count(anisotropy > grains%full_above)/size(anisotropy)
         end associate
         if (cost >= least_cost) cycle
         least_cost = cost
         ! An assignment would leak the old components of `best`.
         if (allocated(best)) deallocate (best)
         allocate (best, source=posterior%grains)
      end do
      call move_alloc(best, posterior%grains)

   contains

      !> Whether stated limits or knowledge keep half of the moduli of a draw far from the measured
      !> ones, whatever the factor of the laboratory.
      pure logical function explains_nothing(draw)
         integer, intent(in) :: draw
         !> Residual, and range of the factor, in sds.
         real(wp), parameter :: far = 2.5_wp, greatest_factor = 3.0_wp
         integer :: rows(size(exact, 1))
         real(wp) :: deviation(size(rows)), factor

         rows = checked_grains(size(posterior%data%euler, 2))
         explains_nothing = (posterior%prior%is_cut() &
            & .or. size(posterior%prior%knowledge%mean) > 0) &
            & .and. .not. (posterior%infers_scale .or. allocated(posterior%unknown))
         if (.not. explains_nothing) return
         associate (measured => posterior%data%modulus(rows), sd => posterior%data%sd(rows), &
            & mean => posterior%laboratory%mean(1), &
            & range => greatest_factor*posterior%laboratory%sd(1))
            factor = log(median(size(rows), measured/exact(:, draw)))
            factor = exp(min(mean + range, max(mean - range, factor)))
            deviation = (measured - factor*exact(:, draw))/sd
         end associate
         explains_nothing = median(size(rows), abs(deviation)) > far
      end function explains_nothing
   end subroutine choose_field_degree

   !> Find the largest error at some draws, see `field_errors`.
   subroutine find_field_error(posterior, draws, threads, largest, error)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      real(wp), intent(out) :: largest
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: exact(:, :)

      largest = 0.0_wp
      call exact_moduli(posterior, draws, threads, exact, error)
      if (allocated(error)) return
      largest = maxval(field_errors(posterior, draws, exact, threads))
   end subroutine find_field_error

   !> The error of each draw: the largest difference of a grain from the exact theory, in the sd of
   !> its measurement, or the error of all grains together, scaled to the same limit, if that is
   !> more.
   function field_errors(posterior, draws, exact, threads) result(errors)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :), exact(:, :)
      integer, intent(in) :: threads
      real(wp) :: errors(size(draws, 2))
      real(wp), allocatable :: moduli(:, :), e(:), sd(:)
      integer :: checked(size(exact, 1)), i

      checked = checked_grains(size(posterior%data%euler, 2))
      sd = posterior%data%sd(min(checked, posterior%n_grains))
      if (allocated(posterior%unknown)) sd = minval(posterior%data%sd)
      allocate (moduli(size(posterior%euler, 2), size(draws, 2)))
      call observe(posterior, posterior%grains, draws, threads, moduli)
      do i = 1, size(draws, 2)
         e = (moduli(checked, i) - exact(:, i))/sd
         errors(i) = max(maxval(abs(e)), &
            & allowed_error/allowed_together*sqrt(sum(e**2)/size(e)*posterior%n_grains))
      end do
   end function field_errors

   !> Compute the measured quantity of grains at some draws.
   subroutine observe(posterior, grains, draws, threads, values)
      type(posterior_type), intent(in) :: posterior
      class(grain_model_type), intent(in) :: grains
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      !> In the unit of the observable, (grain, draw).
      real(wp), intent(out), contiguous :: values(:, :)
      !> Number of draws in one call of the model.
      integer, parameter :: at_once = 16
      integer :: i, j, last

      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic) private(last, j)
      do i = 1, size(draws, 2), at_once
         last = min(size(draws, 2), i + at_once - 1)
         call grains%evaluate_crystals(posterior%prior%class%stiffnesses(draws(:, i:last)), &
            & values(:, i:last))
         do j = i, last
            call posterior%observable%to_measured(values(:, j))
         end do
      end do
      !$omp end parallel do
   end subroutine observe

   !> Numbers of the grains that are checked, evenly over a table of n.
   pure function checked_grains(n) result(checked)
      integer, intent(in) :: n
      integer :: checked(min(n, most_checked)), i

      checked = [(1 + int(real(i - 1, wp)*n/size(checked)), i=1, size(checked))]
   end function checked_grains

   !> Compute the measured quantity of the checked grains by the theory without harmonics, in the
   !> unit of the observable, (checked grain, draw).
   subroutine exact_moduli(posterior, draws, threads, exact, error)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :)
      integer, intent(in) :: threads
      real(wp), allocatable, intent(out) :: exact(:, :)
      type(error_type), allocatable, intent(out) :: error
      class(grain_model_type), allocatable :: exact_grains

      associate (checked => checked_grains(size(posterior%data%euler, 2)))
         allocate (exact(size(checked), size(draws, 2)))
         call posterior%new_grains(posterior%euler(:, checked), posterior%data%paths(min(checked, &
            & posterior%n_grains)), exact_grains, error, compute_all=.true.)
      end associate
      if (allocated(error)) return
      call observe(posterior, exact_grains, draws, threads, exact)
   end subroutine exact_moduli
end module field_reading
