!> How finely the theory is read in Step 2: the degree of the surface harmonics, chosen by what it changes for the worst grain.
module field_degree
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use kinds, only: wp
   implicit none
   private
   public :: choose_field_degree, largest_field_error, allowed_error

   !> The worst grain may err by this share of its sd.
   real(wp), parameter :: allowed_error = 0.02_wp
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
      call exact_moduli(posterior, draws, exact)
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
         best = posterior%grains
      end do
      call move_alloc(best, posterior%grains)
   end subroutine choose_field_degree

   !> The largest difference of a grain's modulus from the exact theory's, in sds of its measurement.
   real(wp) function largest_field_error(posterior, draws) result(largest)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      real(wp), allocatable :: exact(:, :)

      call exact_moduli(posterior, draws, exact)
      largest = maxval(field_errors(posterior, draws, exact))
   end function largest_field_error

   !> Of each draw, in sds of the measurements: the largest difference from the exact theory.
   function field_errors(posterior, draws, exact) result(errors)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :), exact(:, :)
      real(wp) :: errors(size(draws, 2))
      real(wp), dimension(size(posterior%euler, 2)) :: moduli, slopes
      integer :: i

      do i = 1, size(draws, 2)
         call posterior%grains%evaluate_moduli(posterior%stiffness(draws(:, i)), moduli, slopes)
         slopes = 1.0_wp
         call posterior%kind%apply(moduli, slopes)
         errors(i) = maxval(abs(moduli(:posterior%n_grains) - exact(:, i))/posterior%sd)
      end do
   end function field_errors

   !> What would be measured with theory in full, GPa, (grain, draw).
   subroutine exact_moduli(posterior, draws, exact)
      type(posterior_type), intent(in) :: posterior
      real(wp), intent(in) :: draws(:, :)
      real(wp), allocatable, intent(out) :: exact(:, :)
      class(grain_model_type), allocatable :: in_full
      real(wp), dimension(size(posterior%euler, 2)) :: moduli, slopes
      integer :: i

      allocate (exact(posterior%n_grains, size(draws, 2)))
      allocate (in_full, source=posterior%grains)
      ! No anisotropy is below.
      in_full%full_above = -1.0_wp
      do i = 1, size(draws, 2)
         call in_full%evaluate_moduli(posterior%stiffness(draws(:, i)), moduli, slopes)
         slopes = 1.0_wp
         call posterior%kind%apply(moduli, slopes)
         exact(:, i) = moduli(:posterior%n_grains)
      end do
   end subroutine exact_moduli
end module field_degree
