!> What is usual for each technique of measuring a modulus: how the moduli of a laboratory differ
!> from those of the crystal.
!>
!> A measured modulus is f M_ref (M/M_ref)^(1+k). M is the modulus of the crystal in the measured
!> direction, and M_ref the exponential of the mean of ln M over all directions. The factor f
!> contains errors of indenter and frame, pile-up and plasticity; the contrast 1 + k is the
!> anisotropy that is measured over that of the crystal. ln f and ln(1+k) have normal priors.
module techniques
   use kinds, only: wp
   use settings_schema, only: measurements_settings_type
   implicit none
   private
   public :: set_technique, technique_of

   !> A new technique is a row here, and a word of `technique` in docs/namelists.md.
   type, public :: technique_type
      character(len=14) :: name
      !> Mean and sd of ln f, and of ln(1+k).
      real(wp) :: calibration(2), contrast(2)
      !> Greatest part of the sd of ln f that all crystals of a session share. The rest is pile-up,
      !> which differs between crystals.
      real(wp) :: shared_sd
      !> Whether all crystals have the same contrast.
      logical :: shares_contrast
   end type technique_type

   !> Published contrasts of unloading curves of plastic imprints scatter about zero: -0.56
   !> (titanium), -0.23 and +0.5 (copper), 0 (zinc).
   type(technique_type), parameter, public :: known_techniques(3) = [ &
      & technique_type('exact', [0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp], 0.0_wp, .true.), &
      & technique_type('elastic_sphere', [0.0_wp, 0.05_wp], [0.0_wp, 0.05_wp], 1.0_wp, .true.), &
      & technique_type('oliver_pharr', [0.1_wp, 0.15_wp], [-0.15_wp, 0.4_wp], 0.05_wp, .false.)]

   !> Usual relative sd of differences between grains.
   real(wp), parameter :: usual_scatter = 0.01_wp

contains

   !> Set the technique where none is stated, what it says of factor and contrast where they are not
   !> stated, and the scatter of grains.
   pure subroutine set_technique(settings, synthetic)
      type(measurements_settings_type), intent(inout) :: settings
      !> Whether the data are made up, and so without errors of a laboratory.
      logical, intent(in) :: synthetic
      type(technique_type) :: technique

      if (.not. allocated(settings%technique)) then
         settings%technique = trim(merge('exact         ', 'elastic_sphere', synthetic))
      end if
      technique = technique_of(settings%technique)
      call set_default(settings%calibration_mean, technique%calibration(1))
      call set_default(settings%calibration_sd, technique%calibration(2))
      call set_default(settings%contrast_mean, technique%contrast(1))
      call set_default(settings%contrast_sd, technique%contrast(2))
      call set_default(settings%scatter_sd, merge(usual_scatter, 0.0_wp, &
         & settings%scatter == 'inferred'))
   end subroutine set_technique

   !> The technique of this name.
   pure type(technique_type) function technique_of(name)
      character(len=*), intent(in) :: name
      integer :: i

      do i = 1, size(known_techniques)
         if (known_techniques(i)%name == name) technique_of = known_techniques(i)
      end do
   end function technique_of

   pure subroutine set_default(value, default)
      real(wp), allocatable, intent(inout) :: value
      real(wp), intent(in) :: default

      if (.not. allocated(value)) value = default
   end subroutine set_default
end module techniques
