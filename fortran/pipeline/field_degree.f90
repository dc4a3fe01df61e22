!> How finely the theory is read in Step 2: the degree of the surface harmonics, chosen by what it changes for the worst grain.
module field_degree
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use kinds, only: wp
   implicit none
   private
   public :: choose_field_degree, find_field_error, allowed_error

   !> The worst grain may err by this share of its sd.
   real(wp), parameter :: allowed_error = 0.02_wp
   !> And all grains together by this, the root of their sum of squares, in their sds: if they all erred alike, so many sds of the
   !> posterior would it move.
   real(wp), parameter :: allowed_together = 0.2_wp
   !> Grains that are looked at, at most.
   integer, parameter :: most_checked = 200
   !> Degrees that are tried.
   integer, parameter :: degrees(*) = [6, 8, 10, 12, 14, 16, 20, 24, 28]

contains

   !> The degree, and the log-anisotropy above which theory is computed in full, with which no grain errs by more than is allowed at
   !> some draws: of those that do, what is cheapest. `error` is not about the choice.
   subroutine choose_field_degree(posterior, draws, error)
      type(posterior_type), intent(inout) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      type(error_type), allocatable, intent(out) :: error
      !> The draws that follow are others.
      real(wp), parameter :: reserve = 0.5_wp
      real(wp) :: anisotropy(size(draws, 2)), errors(size(draws, 2)), cost, least
      real(wp), allocatable :: exact(:, :)
      class(grain_model_type), allocatable :: best
      integer :: i

      anisotropy = [(log_anisotropy(posterior%stiffness(draws(:, i))), i=1, size(draws, 2))]
      call exact_moduli(posterior, draws, exact, error)
      if (allocated(error)) return
      least = huge(least)
      do i = 1, size(degrees)
         call posterior%set_field_degree(degrees(i), error)
         if (allocated(error)) return
         associate (grains => posterior%grains)
            ! What follows costs more than the best so far.
            if (grains%field_cost >= least) exit
            grains%full_above = huge(least)
            errors = field_errors(posterior, draws, exact)
            if (any(errors > reserve*allowed_error)) then
               grains%full_above = 0.98_wp*minval(anisotropy, mask=errors > reserve*allowed_error)
            end if
            cost = grains%field_cost + grains%full_cost*count(anisotropy > grains%full_above)/size(anisotropy)
         end associate
         if (cost >= least) cycle
         least = cost
         ! An assignment would leave the old components of `best` to nobody.
         if (allocated(best)) deallocate (best)
         allocate (best, source=posterior%grains)
      end do
      call move_alloc(best, posterior%grains)
      if (posterior%n_outputs > 0) posterior%n_outputs = posterior%grains%n_independent
   end subroutine choose_field_degree

   !> The largest difference of a grain's modulus from the exact theory's, in sds of its measurement.
   subroutine find_field_error(posterior, draws, largest, error)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> A share, see `field_errors`.
      real(wp), intent(out) :: largest
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: exact(:, :)

      largest = 0.0_wp
      call exact_moduli(posterior, draws, exact, error)
      if (.not. allocated(error)) largest = maxval(field_errors(posterior, draws, exact))
   end subroutine find_field_error

   !> Of each draw the largest difference from the exact theory, in sds of the measurements; or, where there are so many grains that it is
   !> more, that of all together, as a share of what is allowed.
   function field_errors(posterior, draws, exact) result(errors)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :), exact(:, :)
      real(wp) :: errors(size(draws, 2))
      real(wp), allocatable :: moduli(:), e(:)
      integer :: checked(size(exact, 1)), i

      checked = checked_grains(posterior%n_grains)
      allocate (moduli(size(posterior%euler, 2)))
      do i = 1, size(draws, 2)
         call observe(posterior, posterior%grains, draws(:, i), moduli)
         e = (moduli(checked) - exact(:, i))/posterior%sd(checked)
         errors(i) = max(maxval(abs(e)), allowed_error/allowed_together*sqrt(sum(e**2)/size(e)*posterior%n_grains))
      end do
   end function field_errors

   !> What would be measured in grains at a point.
   subroutine observe(posterior, grains, x, values)
      type(posterior_type), intent(in) :: posterior
      class(grain_model_type), intent(in) :: grains
      real(wp), intent(in) :: x(:)
      !> In the unit of the observable, (grain).
      real(wp), intent(out), contiguous :: values(:)
      real(wp) :: slopes(size(values))

      call grains%evaluate_moduli(posterior%stiffness(x), values, slopes)
      call posterior%observable%from_simulation(values, slopes)
   end subroutine observe

   !> Some of n grains, evenly over the table.
   pure function checked_grains(n) result(checked)
      integer, intent(in) :: n
      integer :: checked(min(n, most_checked))
      integer :: i

      checked = [(1 + int(real(i - 1, wp)*n/size(checked)), i=1, size(checked))]
   end function checked_grains

   !> What would be measured with theory in full, GPa, (grain that is checked, draw).
   subroutine exact_moduli(posterior, draws, exact, error)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :)
      real(wp), allocatable, intent(out) :: exact(:, :)
      type(error_type), allocatable, intent(out) :: error
      class(grain_model_type), allocatable :: in_full
      integer :: i

      associate (checked => checked_grains(posterior%n_grains))
         allocate (exact(size(checked), size(draws, 2)))
         call posterior%new_grains(posterior%euler(:, checked), in_full, error)
      end associate
      if (allocated(error)) return
      ! No anisotropy is below.
      in_full%full_above = -1.0_wp
      do i = 1, size(draws, 2)
         call observe(posterior, in_full, draws(:, i), exact(:, i))
      end do
   end subroutine exact_moduli
end module field_degree
