!> Rivals of the noise: sds that are wrong by a common factor, grains that differ in more than their
!> orientation, outliers, and grains of a second phase.
module noise_rivals
   use error_models, only: error_model_type
   use files, only: printable
   use kinds, only: pi, wp
   use rival_cases, only: case_type, rival_type
   use text, only: fixed, to_text
   implicit none
   private
   public :: make_scale, make_scatter, make_outliers, make_phases, name_outliers

   !> Errors of which a share is of another distribution.
   type, abstract, extends(error_model_type) :: mixture_errors_type
      !> The share, and the relative width of the other distribution, in sds for outliers.
      real(wp) :: share = 0.1_wp, width = 10.0_wp
   contains
      procedure :: log_density => mixture_log_density
      procedure(weigh_parts_interface), deferred :: weigh_parts
   end type mixture_errors_type

   abstract interface
      !> Logarithm of the density of the other distribution over that of the first, weighted by
      !> their shares.
      pure subroutine weigh_parts_interface(self, r, log_ratio)
         import
         class(mixture_errors_type), intent(in) :: self
         !> Residuals in units of the scale, (measurement).
         real(wp), intent(in) :: r(:)
         !> (measurement).
         real(wp), intent(out) :: log_ratio(:)
      end subroutine weigh_parts_interface
   end interface

   !> Outliers, whose distribution is wider.
   type, extends(mixture_errors_type) :: outlier_errors_type
   contains
      procedure :: weigh_parts => outlier_parts, weigh => outlier_weigh
   end type outlier_errors_type

   !> Grains of a second phase.
   type, extends(mixture_errors_type) :: phase_errors_type
      !> Moduli of the second phase relative to those of the first; measurements in units of their
      !> scales, (grain).
      real(wp) :: ratio = 1.0_wp
      real(wp), allocatable :: measured(:)
   contains
      procedure :: weigh_parts => phase_parts
   end type phase_errors_type

   real(wp), parameter :: scatters(5) = [0.01_wp, 0.02_wp, 0.04_wp, 0.08_wp, 0.16_wp]
   real(wp), parameter :: shares(4) = [0.01_wp, 0.05_wp, 0.15_wp, 0.4_wp]
   !> Share of the grains of a second phase, and the relative sd of their moduli.
   real(wp), parameter :: phase_share = 0.3_wp, phase_width = 0.05_wp
   !> sd of an outlier, relative to the mean modulus.
   real(wp), parameter :: outlier_sd = 0.4_wp
   real(wp), parameter :: ratios(8) = [0.5_wp, 0.6_wp, 0.7_wp, 0.8_wp, 1.25_wp, 1.43_wp, 1.67_wp, &
      & 2.0_wp]

contains

   !> The sds times an inferred factor.
   subroutine make_scale(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival

      if (k > 1) return
      rival%explanation = 'sds that are wrong by a common factor'
      rival%remedy = 'scale = ''inferred'''
      rival%settings%scale = 'inferred'
      rival%differs = .not. case%stated%infers_scale
   end subroutine make_scale

   !> A scatter k between grains.
   subroutine make_scatter(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival

      if (k > size(scatters)) return
      rival%explanation = 'grains that differ by about '//fixed(100.0_wp*scatters(k), 0) &
         & //' % beyond their orientation'
      rival%remedy = 'scatter_sd = '//to_text(scatters(k), 2)
      rival%settings%scatter_sd = scatters(k)
      rival%differs = case%stated%settings%scatter_sd < scatters(k)
   end subroutine make_scatter

   !> Outliers with the share k.
   subroutine make_outliers(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival

      if (k > size(shares)) return
      rival%explanation = 'outliers'
      rival%remedy = 'likelihood = ''student'''
      if (case%stated%settings%likelihood == 'student') rival%remedy = 'look at these tests'
      rival%settings%likelihood = 'normal'
      associate (data => case%stated%data)
         allocate (rival%errors, source=outlier_errors_type(share=shares(k), &
            & width=outlier_sd*sum(data%modulus)/sum(data%sd)))
      end associate
      rival%differs = .true.
   end subroutine make_outliers

   !> A second phase with the ratio k.
   subroutine make_phases(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival

      if (k > size(ratios)) return
      rival%explanation = 'grains of a second phase, about '//fixed(ratios(k), 1) &
         & //' times as stiff'
      rival%settings%likelihood = 'normal'
      allocate (rival%errors, source=phase_errors_type(share=phase_share, &
         & width=phase_width, ratio=ratios(k), &
         & measured=case%stated%data%modulus/case%scales))
      rival%differs = .not. (case%stated%n_shared > 0 .or. case%stated%infers_scale)
   end subroutine make_phases

   !> Name the outliers, or the grains of the second phase, in the explanation of a rival, given the
   !> point of its maximum: those that are more probably of the other distribution than not.
   subroutine name_outliers(case, rival, x)
      type(case_type), intent(in) :: case
      type(rival_type), intent(inout) :: rival
      !> (dimension).
      real(wp), intent(in) :: x(:)
      real(wp), dimension(rival%posterior%n_grains) :: model, scales, log_ratio
      real(wp), allocatable :: u(:, :)
      logical :: is_other(rival%posterior%n_grains)
      character(len=:), allocatable :: names
      integer :: i

      select type (errors => rival%posterior%errors)
      class is (mixture_errors_type)
         call rival%posterior%predict_measurements(x, rival%posterior%stiffness(x), model, &
            & scales, u)
         call errors%weigh_parts((case%stated%data%modulus - model)/scales, log_ratio)
         is_other = log_ratio > 0.0_wp
         names = ''
         do i = 1, size(model)
            if (.not. is_other(i)) cycle
            names = names//', '//printable(case%problem%data%measurements%name(case%points(i)))
         end do
         if (any(is_other)) rival%explanation = rival%explanation//': '//names(3:)
      end select
   end subroutine name_outliers

   pure real(wp) function mixture_log_density(self, r, factor) result(log_density)
      class(mixture_errors_type), intent(in) :: self
      real(wp), intent(in) :: r(:), factor
      real(wp) :: ratio(size(r))

      call self%weigh_parts(r/factor, ratio)
      log_density = -0.5_wp*sum(r**2)/factor**2 + sum(max(ratio, 0.0_wp) &
         & + log(1.0_wp + exp(-abs(ratio)))) &
         & + size(r)*(log((1.0_wp - self%share)/factor) - 0.5_wp*log(2.0_wp*pi))
   end function mixture_log_density

   pure subroutine outlier_parts(self, r, log_ratio)
      class(outlier_errors_type), intent(in) :: self
      real(wp), intent(in) :: r(:)
      real(wp), intent(out) :: log_ratio(:)

      log_ratio = log(self%share/(1.0_wp - self%share)/self%width) &
         & + 0.5_wp*r**2*(1.0_wp - 1.0_wp/self%width**2)
   end subroutine outlier_parts

   pure subroutine outlier_weigh(self, e, weight, curvature, expected)
      class(outlier_errors_type), intent(in) :: self
      real(wp), intent(in) :: e(:)
      real(wp), intent(out) :: weight(:), curvature(:), expected(:)
      real(wp) :: log_ratio(size(e)), p(size(e)), narrow

      call self%weigh_parts(e, log_ratio)
      p = 1.0_wp/(1.0_wp + exp(-log_ratio))
      narrow = 1.0_wp - 1.0_wp/self%width**2
      weight = 1.0_wp - p*narrow
      curvature = weight - e**2*p*(1.0_wp - p)*narrow**2
      expected = 1.0_wp - self%share
   end subroutine outlier_weigh

   !> The second phase has moduli that vary by `width`.
   pure subroutine phase_parts(self, r, log_ratio)
      class(phase_errors_type), intent(in) :: self
      real(wp), intent(in) :: r(:)
      real(wp), intent(out) :: log_ratio(:)
      real(wp), dimension(size(r)) :: model, variance

      model = self%ratio*(self%measured - r)
      variance = 1.0_wp + (self%width*model)**2
      log_ratio = log(self%share/(1.0_wp - self%share)) - 0.5_wp*log(variance) &
         & + 0.5_wp*(r**2 - (self%measured - model)**2/variance)
   end subroutine phase_parts

end module noise_rivals
