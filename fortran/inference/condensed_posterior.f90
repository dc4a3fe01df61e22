!> The same posterior density from its sufficient statistics. Many grains may depend on few
!> coefficients of an expansion. If errors are normal, independent and of known sd, the sum of
!> squares over all grains equals that over as many measurements as there are coefficients, plus a
!> constant.
module condensed_posterior
   use constants_posterior, only: has_own_variance, posterior_type
   use correction_basis, only: correction_grain_model_type
   use kinds, only: pi, wp
   implicit none
   private
   public :: condense

contains

   !> Replace the grains by these measurements where the conditions hold. The density stays the
   !> same. No other result may be computed from the posterior afterwards.
   subroutine condense(posterior)
      type(posterior_type), intent(inout) :: posterior
      real(wp), allocatable :: values(:)
      real(wp) :: rest
      integer :: n

      if (posterior%settings%likelihood /= 'normal' .or. posterior%infers_scale &
         & .or. posterior%n_shared > 0 .or. has_own_variance(posterior) &
         & .or. posterior%observable%compliance > 0.0_wp) then
         return
      end if
      select type (grains => posterior%grains)
      type is (correction_grain_model_type)
         call grains%expansion%condense(posterior%observable%factor/posterior%scale, &
            & posterior%data%modulus/posterior%scale, values, rest)
      end select
      if (.not. allocated(values)) return
      n = size(values)
      posterior%log_scales = posterior%log_scales &
         & + 0.5_wp*(rest + (posterior%n_grains - n)*log(2.0_wp*pi))
      posterior%data%modulus = values*posterior%observable%factor
      posterior%scale = spread(posterior%observable%factor, 1, n)
      posterior%n_grains = n
      posterior%n_moduli = n
      posterior%euler = posterior%euler(:, :n)
      if (allocated(posterior%rough)) deallocate (posterior%rough)
   end subroutine condense
end module condensed_posterior
