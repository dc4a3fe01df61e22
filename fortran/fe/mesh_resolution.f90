!> How far a mesh may be wrong near elastic instability, where bricks resolve neither the soft modes nor the far field.
!>
!> Measured on the half-space against the exact theory (docs/simulation.md, `bench simulate soft`): beyond a log-anisotropy of 1.5 the
!> largest error grows with its power 3.5, and falls with the square of the fineness. Films add what `contrast_error` says.
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
   public :: largest_mesh_error, resolution_warning, wants_extrapolation

   !> Largest error at log-anisotropy 1 and the fineness of the study (elements per contact radius), relative.
   real(wp), parameter :: worst_incompatible = 1.0e-3_wp, worst_plain = 1.3e-3_wp, studied_fineness = 9.5_wp
   !> Powers of the log-anisotropy and of the fineness.
   real(wp), parameter :: growth = 3.5_wp, order = 2.0_wp
   !> Extrapolation divides the mean error by some five, but the largest by less than two; of films beside what is unlike by more.
   real(wp), parameter :: extrapolated = 0.7_wp, extrapolated_contrast = 0.45_wp
   !> From this error on a modulus is extrapolated unless the settings say otherwise, and from this one on a result is warned of.
   real(wp), parameter :: limit_of_one_mesh = 0.005_wp, limit = 0.01_wp

contains

   !> About how large, relative, the error of the modulus of a crystal may be. Orientations differ: most are better.
   pure real(wp) function mesh_error(specimen, refine, stiffness, two_meshes)
      class(specimen_type), intent(in) :: specimen
      !> Elements per contact radius relative to the default; GPa.
      real(wp), intent(in) :: refine, stiffness(6, 6)
      !> Whether the modulus is extrapolated from two meshes.
      logical, intent(in) :: two_meshes
      real(wp) :: fineness, instability, contrast

      fineness = refine*specimen%contact_radius/specimen%element_size
      instability = merge(worst_incompatible, worst_plain, specimen%element == 'c3d8i')*log_anisotropy(stiffness)**growth
      contrast = specimen%contrast_error(stiffness)
      if (two_meshes) then
         instability = extrapolated*instability
         contrast = extrapolated_contrast*contrast
      end if
      mesh_error = max(instability, contrast)*(studied_fineness/fineness)**order
   end function mesh_error

   !> Whether one mesh may be too wrong for a crystal; for contact stiffnesses it is. C3D8 is Abaqus' element, and stays alone unless it is
   !> stated otherwise.
   pure logical function wants_extrapolation(specimen, refine, stiffness)
      class(specimen_type), intent(in) :: specimen
      !> As in `mesh_error`.
      real(wp), intent(in) :: refine, stiffness(6, 6)

      wants_extrapolation = specimen%element == 'c3d8i' .and. (specimen%estimator /= 'curve' .or. &
         & mesh_error(specimen, refine, stiffness, .false.) > limit_of_one_mesh)
   end function wants_extrapolation

   !> The error of each crystal as &simulation has it simulated, and which of them are extrapolated without being asked.
   subroutine largest_mesh_error(settings, stiffness, largest, extended)
      type(settings_type), intent(in) :: settings
      !> GPa (6, 6, crystals).
      real(wp), intent(in) :: stiffness(:, :, :)
      !> Relative (crystals).
      real(wp), intent(out) :: largest(:)
      !> (crystals).
      logical, intent(out) :: extended(:)
      type(error_type), allocatable :: error
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen
      logical :: asked
      integer :: i

      largest = 0.0_wp
      extended = .false.
      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error)) return
      associate (simulation => settings%simulation)
         asked = .false.
         if (allocated(simulation%extrapolate)) asked = simulation%extrapolate
         do i = 1, size(largest)
            if (.not. allocated(simulation%extrapolate)) extended(i) = &
               & wants_extrapolation(specimen, simulation%refine, stiffness(:, :, i))
            largest(i) = mesh_error(specimen, simulation%refine, stiffness(:, :, i), asked .or. extended(i))
         end do
      end associate
   end subroutine largest_mesh_error

   !> A warning of crystals whose remaining error is large; '' if there are none. Crystals are counted from 1.
   pure function resolution_warning(largest) result(warning)
      !> The error that remains for each crystal, relative (crystals).
      real(wp), intent(in) :: largest(:)
      character(len=:), allocatable :: warning
      integer :: percent(2)

      warning = ''
      if (.not. any(largest > limit)) return
      percent = nint(100.0_wp*[minval(largest, largest > limit), maxval(largest)])
      warning = 'the crystal is'
      if (size(largest) > 1) warning = to_text(count(largest > limit))//' of '//to_text(size(largest))//' crystals are'
      warning = warning//' so near instability that the error of the mesh may reach about '//to_text(percent(1))
      if (percent(2) > percent(1)) warning = warning//' to '//to_text(percent(2))
      warning = warning//' %: refine, extrapolate, or compare with the theory'//rows_of(largest > limit)
   end function resolution_warning

   !> The numbers of those that are chosen from several, in brackets.
   pure function rows_of(chosen) result(words)
      logical, intent(in) :: chosen(:)
      character(len=:), allocatable :: words
      integer, parameter :: most_listed = 10
      integer, allocatable :: number(:)
      integer :: i

      words = ''
      if (size(chosen) == 1) return
      number = pack([(i, i=1, size(chosen))], chosen)
      do i = 1, min(size(number), most_listed)
         words = words//', '//to_text(number(i))
      end do
      if (size(number) > most_listed) words = words//', ..'
      words = ' (rows '//words(3:)//')'
   end function rows_of
end module mesh_resolution
