!> How far a mesh may be wrong near elastic instability, where bricks resolve neither the soft modes nor the far field.
!>
!> Measured on the half-space against the exact theory (docs/simulation.md, `bench simulate soft`): beyond a log-anisotropy of 1.5 the
!> largest error grows with its power 3.5, and falls with the square of the fineness.
module mesh_resolution
   use abstract_indenter, only: indenter_type
   use abstract_specimen, only: specimen_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use kinds, only: wp
   use settings_schema, only: settings_type
   use specimens, only: new_indentation
   use text, only: to_text
   implicit none
   private
   public :: largest_mesh_error, resolution_warning

   !> Largest error at log-anisotropy 1 and the fineness of the study (elements per contact radius), relative.
   real(wp), parameter :: worst_incompatible = 1.0e-3_wp, worst_plain = 1.3e-3_wp, studied_fineness = 9.5_wp
   !> Powers of the log-anisotropy and of the fineness.
   real(wp), parameter :: growth = 3.5_wp, order = 2.0_wp
   !> Extrapolation divides the mean error by some five, but the largest by less than two.
   real(wp), parameter :: extrapolated = 0.7_wp
   !> From this error on a result is warned of.
   real(wp), parameter :: limit = 0.01_wp

contains

   !> About how large, relative, the error of the modulus of a crystal may be on the mesh of &simulation. Orientations differ: most
   !> are better.
   function largest_mesh_error(settings, stiffness) result(largest)
      type(settings_type), intent(in) :: settings
      !> GPa (6, 6, crystals).
      real(wp), intent(in) :: stiffness(:, :, :)
      real(wp) :: largest(size(stiffness, 3))
      type(error_type), allocatable :: error
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen
      real(wp) :: fineness, scale
      integer :: i

      largest = 0.0_wp
      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error)) return
      fineness = settings%simulation%refine*specimen%contact_radius/specimen%element_size
      scale = merge(worst_incompatible, worst_plain, specimen%element == 'c3d8i')
      if (settings%simulation%extrapolate) scale = extrapolated*scale
      scale = scale*(studied_fineness/fineness)**order
      do i = 1, size(largest)
         largest(i) = scale*log_anisotropy(stiffness(:, :, i))**growth
      end do
   end function largest_mesh_error

   !> What is to be said of crystals that the mesh resolves badly; '' if there are none. Crystals are counted from 1.
   pure function resolution_warning(largest) result(warning)
      !> The error that the mesh may have for each crystal, relative (crystals).
      real(wp), intent(in) :: largest(:)
      character(len=:), allocatable :: warning
      integer, allocatable :: bad(:)
      integer, parameter :: most_listed = 10
      integer :: i, percent(2)

      warning = ''
      bad = pack([(i, i=1, size(largest))], largest > limit)
      if (size(bad) == 0) return
      percent = nint(100.0_wp*[minval(largest(bad)), maxval(largest)])
      warning = 'the crystal is'
      if (size(largest) > 1) warning = to_text(size(bad))//' of '//to_text(size(largest))//' crystals are'
      warning = warning//' so near instability that the error of the mesh may reach about '//to_text(percent(1))
      if (percent(2) > percent(1)) warning = warning//' to '//to_text(percent(2))
      warning = warning//' %: refine, extrapolate, or compare with the theory'
      if (size(largest) == 1) return
      do i = 1, min(size(bad), most_listed)
         if (i == 1) warning = warning//' (rows '//to_text(bad(i))
         if (i > 1) warning = warning//', '//to_text(bad(i))
      end do
      if (size(bad) > most_listed) warning = warning//', ..'
      warning = warning//')'
   end function resolution_warning
end module mesh_resolution
