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
   use settings_groups, only: settings_type
   use settings_schema, only: visit_settings
   use settings_visitor, only: is_text, kind_logical, settings_visitor_type, variable_type
   use specimens, only: new_indentation
   use text, only: split_list, to_text
   implicit none
   private
   public :: identity_text

   !> Collects variables by name.
   type, extends(settings_visitor_type) :: collector_type
      !> Names that are wanted, separated by ', '.
      character(len=:), allocatable :: wanted
      !> `"name": value`, sorted.
      type(value_type), allocatable :: pairs(:)
   contains
      procedure :: begin_group
      procedure :: visit
   end type collector_type

   !> What every simulation by finite elements reads.
   character(len=*), parameter :: common = 'geometry, shape, depth_um, contact_radius_um, simulator, element, integration, ' &
      & //'refine, extrapolate, depths'

contains

   !> The identity of the physics of a problem.
   function identity_text(settings) result(identity)
      type(settings_type), intent(in) :: settings
      character(len=:), allocatable :: identity
      type(collector_type) :: collector
      type(settings_type) :: copy
      class(indenter_type), allocatable :: indenter
      class(specimen_type), allocatable :: specimen
      type(error_type), allocatable :: error
      integer :: i

      allocate (collector%pairs(0), collector%choices(0))
      collector%wanted = 'simulator'
      if (settings%simulation%simulator == 'fe') then
         call add_pair(collector, 'estimator', '"least squares through the origin"')
         call add_pair(collector, 'numerics', to_text(numerics_revision))
         collector%wanted = common
         call new_indentation(settings, indenter, specimen, error)
         if (allocated(indenter)) collector%wanted = collector%wanted//', '//indenter%variables
         if (allocated(specimen)) then
            collector%wanted = collector%wanted//', '//specimen%variables
            if (settings%simulation%extrapolate) call add_pair(collector, 'coarse_ratio', to_text(specimen%coarse_ratio))
         end if
      end if
      copy = settings
      call visit_settings(collector, copy)
      identity = ''
      do i = 1, size(collector%pairs)
         identity = identity//', '//collector%pairs(i)%text
      end do
      identity = '{'//identity(3:)//'}'
   end function identity_text

   subroutine begin_group(self, given)
      class(collector_type), intent(inout) :: self
      logical, intent(inout) :: given

      associate (unused => self, also_unused => given)
      end associate
   end subroutine begin_group

   !> Keep what is wanted, as JSON.
   subroutine visit(self, variable, values)
      class(collector_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(inout) :: values(:)
      character(len=:), allocatable :: value

      if (all(['specimen  ', 'indenter  ', 'simulation'] /= variable%group) .or. .not. allocated(values)) return
      if (all(split_list(self%wanted) /= variable%name)) return
      value = values(1)%text
      if (is_text(variable)) value = '"'//value//'"'
      if (variable%kind == kind_logical) value = value(2:len(value) - 1)
      call add_pair(self, variable%name, value)
   end subroutine visit

   !> Put a pair in its place.
   subroutine add_pair(self, name, value)
      class(collector_type), intent(inout) :: self
      !> Of the variable; JSON.
      character(len=*), intent(in) :: name, value
      type(value_type) :: pair
      integer :: i

      pair%text = '"'//name//'": '//value
      do i = 1, size(self%pairs)
         if (self%pairs(i)%text > pair%text) exit
      end do
      self%pairs = [self%pairs(:i - 1), pair, self%pairs(i:)]
   end subroutine add_pair
end module physics_identity
