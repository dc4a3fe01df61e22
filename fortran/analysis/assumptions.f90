!> Assumptions that no measurement can refute: how far each constant moves if one is wrong by its
!> usual size.
!>
!> If the measurements change by d, the posterior mean of a constant c changes by wᵀ d to first
!> order. Here w = Cov(c, s) is the covariance over the draws of c and the score of each
!> measurement, see `variance_shares`. For an assumption d is what the measurements would have been
!> without the error, minus the measurements of the table. For a known value w follows from its
!> covariance with c.
module assumptions
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use kinds, only: wp
   use measured_grains, only: spread_orientations
   use observables, only: modulus_kinds, new_observable, observable_type, path_type
   use text, only: fixed, to_text
   use variance_shares, only: shares_type
   implicit none
   private
   public :: assumption_type, list_assumptions

   type :: assumption_type
      !> Name, and what is true if the assumption is wrong: the words after 'If' in the report.
      character(len=:), allocatable :: name, condition
      !> Usual size of the error: relative; for a layer its compliance, 1/GPa; for a known quantity
      !> its sd; 0 for a kind of modulus.
      real(wp) :: size = 0.0_wp
      !> Whether the sds of the constants already contain the error.
      logical :: included = .false.
      !> Change of each constant, GPa, (constant).
      real(wp), allocatable :: shift(:)
   end type assumption_type

   !> Usual errors: of factor and contrast, if the stated sds are not greater; the compliance of a
   !> layer, 1/GPa; of the modulus of the tip.
   real(wp), parameter :: usual_error = 0.05_wp, layer_compliance = 1.0_wp/2000.0_wp, &
      & tip_error = 0.1_wp
   !> Share of the contrast that neighbours at ten contact radii take away: the exponent 0.95 a/R of
   !> docs/verification/films.md, rounded.
   real(wp), parameter :: pull = 0.1_wp

contains

   !> List all assumptions of a posterior.
   subroutine list_assumptions(posterior, mean, shares, list, error)
      type(posterior_type), intent(in) :: posterior
      !> Mean of each constant, GPa, and its shares.
      real(wp), intent(in) :: mean(:)
      type(shares_type), intent(in) :: shares(:)
      type(assumption_type), allocatable, intent(out) :: list(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: name
      real(wp) :: sd
      integer :: i, j

      allocate (list(0))
      if (posterior%n_moduli > 0) call add_assumptions_of_moduli()
      if (allocated(error)) return
      associate (known => posterior%prior%knowledge)
         do j = 1, size(known%mean)
            name = known%quantities(j)%name
            sd = sqrt(known%covariance(j, j))
            list = [list, assumption_type('known: '//name, &
               & name//' is '//to_text(known%mean(j) + sd, 4), sd, .true., &
               & [(sd*shares(i)%by_known_value(j), i=1, size(mean))])]
         end do
      end associate

   contains

      !> List the assumptions on the measured moduli m.
      subroutine add_assumptions_of_moduli()
         type(observable_type) :: other
         real(wp), dimension(posterior%n_moduli) :: m, contrast
         real(wp) :: greatest(2)

         m = posterior%data%modulus(:size(m))
         call find_contrast(contrast)
         if (allocated(error)) return
         associate (settings => posterior%settings, own => posterior%observable)
            do i = 1, size(modulus_kinds)
               call new_observable(trim(modulus_kinds(i)), settings, other, error)
               if (allocated(error)) return
               if (other%name == own%name) cycle
               call add('kind: '//other%name, 'these are moduli of the kind '//other%name, 0.0_wp, &
                  & .false., as_stated(other) - m)
            end do
            greatest = max(usual_error, [settings%calibration_sd, settings%contrast_sd])
            call add('factor', 'the moduli are '//percent(greatest(1))//' too high', greatest(1), &
               & settings%calibration_sd > 0.0_wp .or. size(posterior%data%shared) > 0, &
               & m*(exp(-greatest(1)) - 1.0_wp))
            call add('contrast', 'their anisotropy is '//percent(greatest(2))//' too low', &
               & greatest(2), posterior%infers_contrast, m*(exp(greatest(2)*contrast) - 1.0_wp))
            if (own%compliance > 0.0_wp) then
               other = own
               other%compliance = own%compliance/(1.0_wp - tip_error)
               call add('tip material', 'the modulus of the tip is '//percent(tip_error) &
                  & //' lower', tip_error, .false., as_stated(other) - m)
            end if
            other = own
            other%compliance = own%compliance + layer_compliance
            call add('added layer', 'a layer adds a compliance of 1/2000 per GPa', &
               & layer_compliance, .false., as_stated(other) - m)
            call add('neighbours', 'neighbours pull the moduli to their mean by '//percent(pull), &
               & pull, posterior%infers_contrast, m*(exp(-log(1.0_wp - pull)*contrast) - 1.0_wp))
         end associate
      end subroutine add_assumptions_of_moduli

      !> The moduli of the table, converted to the stated kind of modulus from the kind `other`.
      pure function as_stated(other) result(values)
         type(observable_type), intent(in) :: other
         real(wp) :: values(posterior%n_moduli)

         values = posterior%data%modulus(:posterior%n_moduli)
         values = values/max(other%factor - other%compliance*values, tiny(1.0_wp))
         call posterior%observable%to_measured(values)
      end function as_stated

      !> Add an assumption. If it is wrong, the moduli change by `change`, GPa.
      subroutine add(name, condition, size_of, included, change)
         character(len=*), intent(in) :: name, condition
         real(wp), intent(in) :: size_of, change(:)
         logical, intent(in) :: included

         list = [list, assumption_type(name, condition, size_of, included, &
            & [(sum(shares(j)%by_measurement(:posterior%n_moduli)*change), j=1, size(mean))])]
      end subroutine add

      !> For the crystal with the mean constants, the logarithm of each modulus minus its mean over
      !> all directions. It is 0 for grains of unknown orientation.
      subroutine find_contrast(contrast)
         !> (modulus).
         real(wp), intent(out) :: contrast(:)
         !> Least number of the directions of the mean.
         integer, parameter :: directions = 12
         class(grain_model_type), allocatable :: grains
         real(wp), allocatable :: euler(:, :), weights(:), moduli(:, :)
         type(path_type), allocatable :: paths(:)
         integer :: n

         n = size(contrast)
         contrast = 0.0_wp
         if (allocated(posterior%unknown)) return
         call spread_orientations(posterior%prior%class, directions, euler, weights)
         allocate (paths(n + size(weights)), moduli(n + size(weights), 1))
         call posterior%new_grains(reshape([posterior%euler(:, :n), euler], [3, size(paths)]), &
            & paths, grains, error)
         if (allocated(error)) return
         call grains%evaluate_crystals(reshape(posterior%stiffness(mean), [6, 6, 1]), moduli)
         moduli = log(moduli)
         contrast = moduli(:n, 1) - dot_product(weights, moduli(n + 1:, 1))
      end subroutine find_contrast
   end subroutine list_assumptions

   !> A share as a text in per cent.
   pure function percent(share) result(text)
      real(wp), intent(in) :: share
      character(len=:), allocatable :: text

      text = fixed(100.0_wp*share, 0)//' %'
   end function percent
end module assumptions
