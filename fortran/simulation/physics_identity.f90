!> What makes two simulations the same physics: one line of JSON, keys sorted, under which campaigns store their results.
!>
!> It has the variables of &specimen, &indenter and &simulation that the simulation reads. Stored texts are compared as they are: what
!> changes here orphans every campaign.
module physics_identity
   use abstract_indenter, only: indenter_type
   use abstract_specimen, only: specimen_type
   use errors, only: error_type
   use fe_indentation, only: numerics_revision
   use namelist_file, only: value_type
   use settings_schema, only: list_settings, settings_type
   use settings_list, only: is_text, kind_logical, settings_list_type
   use specimens, only: new_indentation
   use text, only: split_list, to_text
   implicit none
   private
   public :: identity_text

   !> What every simulation by finite elements reads.
   character(len=*), parameter :: common = 'geometry, estimator, shape, depth_um, contact_radius_um, simulator, element, ' &
      & //'integration, refine, extrapolate, depths'

contains

   !> The identity of the physics of a problem.
   function identity_text(settings) result(identity)
      type(settings_type), intent(in) :: settings
      character(len=:), allocatable :: identity
      !> Names that are wanted, separated by ', '; their values as JSON.
      character(len=:), allocatable :: wanted, value
      !> `"name": value`, sorted.
      type(value_type), allocatable :: pairs(:)
      type(settings_list_type) :: list
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen
      type(error_type), allocatable :: error
      logical :: two_meshes
      integer :: i

      allocate (pairs(0))
      wanted = 'simulator'
      if (settings%simulation%simulator == 'fe') then
         call add_pair(pairs, 'numerics', to_text(numerics_revision))
         wanted = common
         call new_indentation(settings, indenter, specimen, error)
         if (allocated(indenter)) wanted = wanted//', '//indenter%variables
         if (allocated(specimen)) then
            wanted = wanted//', '//specimen%variables
            two_meshes = .not. allocated(settings%simulation%extrapolate)
            if (two_meshes) call add_pair(pairs, 'extrapolate', '"as needed"')
            if (.not. two_meshes) two_meshes = settings%simulation%extrapolate
            if (two_meshes) call add_pair(pairs, 'coarse_ratio', to_text(specimen%coarse_ratio))
         end if
      end if
      list = list_settings(settings)
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            if (all(['specimen  ', 'indenter  ', 'simulation'] /= v%group) .or. .not. allocated(v%values)) cycle
            if (all(split_list(wanted) /= v%name)) cycle
            value = v%values(1)%text
            if (is_text(v)) value = '"'//value//'"'
            if (v%kind == kind_logical) value = value(2:len(value) - 1)
            call add_pair(pairs, v%name, value)
         end associate
      end do
      identity = ''
      do i = 1, size(pairs)
         identity = identity//', '//pairs(i)%text
      end do
      identity = '{'//identity(3:)//'}'
   end function identity_text

   !> Put a pair in its place.
   subroutine add_pair(pairs, name, value)
      type(value_type), allocatable, intent(inout) :: pairs(:)
      !> Of the variable; JSON.
      character(len=*), intent(in) :: name, value
      type(value_type) :: pair
      integer :: i

      pair%text = '"'//name//'": '//value
      do i = 1, size(pairs)
         if (pairs(i)%text > pair%text) exit
      end do
      pairs = [pairs(:i - 1), pair, pairs(i:)]
   end subroutine add_pair
end module physics_identity
