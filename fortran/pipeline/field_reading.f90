!> How finely a posterior reads the theory of the half-space: the degree of the surface harmonics,
!> chosen by what it changes for the worst grain.
module field_reading
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use kinds, only: wp
   use problem_posterior, only: stiffnesses
   implicit none
   private
   public :: choose_field_degree, find_field_error, allowed_error

   !> The worst grain may err by this share of its sd.
   real(wp), parameter :: allowed_error = 0.02_wp
   !> And all grains together by this, the root of their sum of squares, in their sds: if they all
   !> erred alike, so many sds of the posterior would it move.
   real(wp), parameter :: allowed_together = 0.2_wp
   !> Grains that are looked at, at most.
   integer, parameter :: most_checked = 200
   !> Degrees that are tried.
   integer, parameter :: degrees(*) = [6, 8, 10, 12, 14, 16, 20, 24, 28]

contains

   !> The degree, and the log-anisotropy above which theory is computed in full, with which no grain
   !> errs by more than is allowed at some draws: of those that do, what is cheapest. `error` is not
   !> about the choice.
   subroutine choose_field_degree(posterior, draws, threads, error)
      type(posterior_type), intent(inout) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      type(error_type), allocatable, intent(out) :: error
      !> The draws that follow are others. To find proposals so much more may err, but for some
      !> draws.
      real(wp), parameter :: reserve = 0.3_wp, rough_errors = 5.0_wp, most_draws = 0.8_wp
      real(wp) :: anisotropy(size(draws, 2)), errors(size(draws, 2)), cost, least, wrong
      real(wp), allocatable :: exact(:, :)
      class(grain_model_type), allocatable :: best
      integer :: i

      anisotropy = [(log_anisotropy(posterior%stiffness(draws(:, i))), i=1, size(draws, 2))]
      call exact_moduli(posterior, draws, threads, exact, error)
      if (allocated(error)) return
      least = huge(least)
      if (allocated(posterior%rough)) deallocate (posterior%rough)
      do i = 1, size(degrees)
         call posterior%set_field_degree(degrees(i), error)
         if (allocated(error)) return
         associate (grains => posterior%grains)
            ! What follows costs more than the best so far.
            if (grains%field_cost >= least) exit
            call grains%use_field_up_to(huge(least))
            errors = field_errors(posterior, draws, exact, threads)
            if (.not. allocated(posterior%rough) &
               & .and. count(errors < rough_errors*allowed_error) > most_draws*size(errors)) then
               allocate (posterior%rough, source=grains)
            end if
            if (any(errors > reserve*allowed_error)) then
               wrong = minval(anisotropy, mask=errors > reserve*allowed_error)
               ! Where every draw errs, nothing shows that others may be read.
               call grains%use_field_up_to(merge(0.98_wp*wrong, 0.0_wp, any(anisotropy < wrong)))
               ! Of many grains an expansion over directions is left.
               errors = field_errors(posterior, draws, exact, threads)
               if (any(errors > reserve*allowed_error) .and. i < size(degrees)) cycle
            end if
            cost = grains%field_cost &
               & + grains%full_cost*count(anisotropy > grains%full_above)/size(anisotropy)
         end associate
         if (cost >= least) cycle
         least = cost
         ! An assignment would leave the old components of `best` to nobody.
         if (allocated(best)) deallocate (best)
         allocate (best, source=posterior%grains)
      end do
      call move_alloc(best, posterior%grains)
   end subroutine choose_field_degree

   !> The largest difference of a grain's modulus from the exact theory's, in sds of its
   !> measurement.
   subroutine find_field_error(posterior, draws, threads, largest, error)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      !> A share, see `field_errors`.
      real(wp), intent(out) :: largest
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: exact(:, :)

      largest = 0.0_wp
      call exact_moduli(posterior, draws, threads, exact, error)
      if (allocated(error)) return
      largest = maxval(field_errors(posterior, draws, exact, threads))
   end subroutine find_field_error

   !> Of each draw the largest difference from the exact theory, in sds of the measurements; or,
   !> where there are so many grains that it is more, that of all together, as a share of what is
   !> allowed.
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

   !> What would be measured in grains at some points.
   subroutine observe(posterior, grains, draws, threads, values)
      type(posterior_type), intent(in) :: posterior
      class(grain_model_type), intent(in) :: grains
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> OpenMP threads at most.
      integer, intent(in) :: threads
      !> In the unit of the observable, (grain, draw).
      real(wp), intent(out), contiguous :: values(:, :)
      integer, parameter :: at_once = 16
      integer :: i, j, last

      !$omp parallel do num_threads(max(1, threads)) schedule(dynamic) private(last, j)
      do i = 1, size(draws, 2), at_once
         last = min(size(draws, 2), i + at_once - 1)
         call grains%evaluate_crystals(stiffnesses(posterior%prior%class, draws(:, i:last)), &
            & values(:, i:last))
         do j = i, last
            call posterior%observable%to_measured(values(:, j))
         end do
      end do
      !$omp end parallel do
   end subroutine observe

   !> Some of n grains, evenly over the table.
   pure function checked_grains(n) result(checked)
      integer, intent(in) :: n
      integer :: checked(min(n, most_checked)), i

      checked = [(1 + int(real(i - 1, wp)*n/size(checked)), i=1, size(checked))]
   end function checked_grains

   !> What would be measured with theory in full, GPa, (grain that is checked, draw).
   subroutine exact_moduli(posterior, draws, threads, exact, error)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :)
      integer, intent(in) :: threads
      real(wp), allocatable, intent(out) :: exact(:, :)
      type(error_type), allocatable, intent(out) :: error
      class(grain_model_type), allocatable :: in_full

      associate (checked => checked_grains(size(posterior%data%euler, 2)))
         allocate (exact(size(checked), size(draws, 2)))
         call posterior%new_grains(posterior%euler(:, checked), posterior%data%paths(min(checked, &
            & posterior%n_grains)), in_full, error, compute_all=.true.)
      end associate
      if (allocated(error)) return
      call observe(posterior, in_full, draws, threads, exact)
   end subroutine exact_moduli

end module field_reading
