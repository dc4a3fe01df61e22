!> What a person should know of measurements whose depths, or whose grains' sizes, are given: by how much moduli are expected to be off.
module size_diagnostics
   use abstract_indenter, only: indenter_type
   use errors, only: error_type
   use files, only: printable
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use indenters, only: new_indenter
   use kinds, only: degree, wp
   use point_tables, only: points_type
   use problem, only: problem_type
   use surrogate_model, only: surrogate_type
   use text, only: fixed, to_text
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: check_sizes, mean_correction

   !> A bias is small, and two contact radii are alike, below these.
   real(wp), parameter :: small_bias = 0.01_wp, alike = 0.05_wp
   !> A grain whose neighbours are x times as stiff, x about 1, has x**(slope a/R) times its modulus: 0.86 to 1.04 for hemispheres of 10
   !> and 20 contact radii among neighbours 0.8 and 1.25 times as stiff (docs/case_studies/films.md).
   real(wp), parameter :: slope = 0.95_wp

contains

   !> Warnings of the columns depth_um and grain_radius_um.
   subroutine check_sizes(problem, trained_radius, addition, warnings)
      type(problem_type), intent(in) :: problem
      !> Contact radius of the surrogate's simulations, um, 0 of a half-space; how far they are from the theory on average, relative.
      real(wp), intent(in) :: trained_radius, addition
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error
      real(wp), allocatable :: contact_radius(:)

      call new_indenter(problem%settings%indenter, indenter, error)
      if (allocated(error)) return
      associate (measured => problem%measurements)
         allocate (contact_radius(measured%n), source=indenter%contact_radius)
         where (measured%depth_um > 0.0_wp) contact_radius = indenter%contact_radius_of(measured%depth_um)
         if (trained_radius > 0.0_wp) then
            if (any(measured%depth_um > 0.0_wp)) call check_depths(contact_radius, trained_radius, addition, warnings)
         else if (any(measured%grain_radius_um > 0.0_wp)) then
            call check_grain_radii(measured, contact_radius, warnings)
         end if
      end associate
   end subroutine check_sizes

   !> What a film, say, adds to the theory grows with the contact radius.
   subroutine check_depths(contact_radius, trained_radius, addition, warnings)
      !> Of each grain, um, and as in `check_sizes`.
      real(wp), intent(in) :: contact_radius(:), trained_radius, addition
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp) :: ratio

      ratio = maxval(abs(contact_radius/trained_radius - 1.0_wp))
      if (ratio <= alike) return
      call warn(warnings, 'the measurements have contact radii of '//to_text(minval(contact_radius), 3)//' to ' &
         & //to_text(maxval(contact_radius), 3)//' um, the surrogate is of '//to_text(trained_radius, 3)//' um: what its ' &
         & //'specimen adds to the theory, '//fixed(100.0_wp*addition, 1)//' % on average, grows about as the contact radius, ' &
         & //'so that moduli are expected to be off by up to '//fixed(100.0_wp*addition*ratio, 1)//' %; build one at this depth')
   end subroutine check_depths

   !> How far the simulations of a surrogate are from the theory on average, relative.
   real(wp) function mean_correction(surrogate)
      type(surrogate_type), intent(in) :: surrogate
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      integer :: i, n

      mean_correction = 0.0_wp
      n = size(surrogate%simulations%modulus)
      do i = 1, n
         associate (simulations => surrogate%simulations)
            call halfspace_modulus(surrogate%basis%domain%class%stiffness(simulations%constants(:, i)), &
               & simulations%euler_deg(:, i)*degree, theory, error)
            if (allocated(error)) cycle
            mean_correction = mean_correction + abs(simulations%modulus(i)/theory%modulus - 1.0_wp)/n
         end associate
      end do
   end function mean_correction

   !> Neighbours are taken to be as stiff as the mean measurement.
   subroutine check_grain_radii(measured, contact_radius, warnings)
      type(points_type), intent(in) :: measured
      !> Of each grain, um.
      real(wp), intent(in) :: contact_radius(:)
      type(warning_type), allocatable, intent(inout) :: warnings(:)
      real(wp) :: bias(measured%n)
      integer :: worst

      bias = 0.0_wp
      associate (modulus => measured%modulus_gpa, radius => measured%grain_radius_um)
         where (radius > 0.0_wp) bias = (sum(modulus)/size(modulus)/modulus)**(slope*contact_radius/radius) - 1.0_wp
      end associate
      if (count(abs(bias) > small_bias) == 0) return
      worst = maxloc(abs(bias), dim=1)
      call warn(warnings, to_text(count(abs(bias) > small_bias))//' of '//to_text(size(bias))//' grains are so small that their ' &
         & //'neighbours are expected to change the modulus by more than 1 % (grain '//printable(measured%name(worst))//': ' &
         & //fixed(100.0_wp*bias(worst), 1)//' %): see the command size, or build a correction with geometry = ''grain''')
   end subroutine check_grain_radii
end module size_diagnostics
