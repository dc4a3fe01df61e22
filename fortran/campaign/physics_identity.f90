!> What makes two simulations the same physics: one line of JSON, keys sorted, under which campaigns store their results.
!>
!> It has the variables of &specimen, &indenter and &simulation that the simulation reads. Stored texts are compared as they are: what
!> changes here orphans every campaign.
module physics_identity
   use errors, only: error_type
   use fe_indentation, only: numerics_revision
   use indenters, only: indenter_type, new_indenter
   use namelist_file, only: value_type
   use settings_groups, only: settings_type
   use settings_schema, only: visit_settings
   use settings_visitor, only: is_text, kind_logical, settings_visitor_type, variable_type
   use specimen_mesh, only: specimen_mesh_type
   use specimens, only: new_specimen
   use text, only: to_text
   implicit none
   private
   public :: identity_text

   !> Collects variables by name.
   type, extends(settings_visitor_type) :: collector_type
      !> Names that are wanted, each between blanks.
      character(len=:), allocatable :: wanted
      !> `"name": value`, sorted.
      type(value_type), allocatable :: pairs(:)
   contains
      procedure :: begin_group
      procedure :: visit
   end type collector_type

   !> What every specimen and indenter has.
   character(len=*), parameter :: common = ' geometry shape depth_um contact_radius_um simulator element integration refine ' &
      & //'extrapolate depths '

contains

   !> The identity of the physics of a problem.
   function identity_text(settings) result(identity)
      type(settings_type), intent(in) :: settings
      character(len=:), allocatable :: identity
      type(collector_type) :: collector
      type(settings_type) :: copy
      type(indenter_type) :: tip
      class(specimen_mesh_type), allocatable :: specimen
      type(error_type), allocatable :: error
      integer :: i

      allocate (collector%pairs(0), collector%choices(0))
      collector%wanted = ' simulator '
      if (settings%simulation%simulator == 'fe') then
         call new_indenter(settings%indenter, tip, error)
         if (.not. allocated(error)) call new_specimen(settings, tip%contact_radius, specimen, error)
         collector%wanted = common//trim(tip%variable)//' '
         if (allocated(specimen)) collector%wanted = collector%wanted//trim(specimen%variables)//' '
         call add_pair(collector, 'estimator', '"least squares through the origin"')
         call add_pair(collector, 'numerics', to_text(numerics_revision))
         if (allocated(specimen) .and. settings%simulation%extrapolate) then
            call add_pair(collector, 'coarse_ratio', to_text(specimen%coarse_ratio))
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

      if (index(' specimen indenter simulation ', ' '//variable%group//' ') == 0) return
      if (index(self%wanted, ' '//variable%name//' ') == 0 .or. .not. allocated(values)) return
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
