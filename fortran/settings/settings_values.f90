!> The settings as named values, 'group.variable', in their own types; what is unset is not there.
module settings_values
   use kinds, only: wp
   use named_values, only: named_values_type
   use namelist_file, only: value_type
   use numbers, only: read_real
   use settings_groups, only: settings_type
   use settings_schema, only: visit_settings
   use settings_visitor, only: is_text, kind_integer, kind_logical, settings_visitor_type, shape_one, variable_type
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: put_settings

   type, extends(settings_visitor_type) :: exporter_type
      type(named_values_type) :: values
   contains
      procedure :: begin_group
      procedure :: visit
   end type exporter_type

contains

   !> Add all settings to `values`.
   subroutine put_settings(settings, values)
      type(settings_type), intent(in) :: settings
      type(named_values_type), intent(inout) :: values
      type(exporter_type) :: exporter
      type(settings_type) :: copy

      copy = settings
      allocate (exporter%choices(0))
      exporter%values = values
      call visit_settings(exporter, copy)
      values = exporter%values
   end subroutine put_settings

   !> Whether the file has the group.
   subroutine begin_group(self, given)
      class(exporter_type), intent(inout) :: self
      logical, intent(inout) :: given

      call self%values%put(self%group_name//'.given', given)
   end subroutine begin_group

   subroutine visit(self, variable, values)
      class(exporter_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(inout) :: values(:)
      type(warning_type), allocatable :: texts(:)
      real(wp), allocatable :: reals(:)
      character(len=:), allocatable :: name
      integer :: outcome, i

      if (.not. allocated(values)) return
      name = variable%group//'.'//variable%name
      if (is_text(variable)) then
         allocate (texts(0))
         do i = 1, size(values)
            call warn(texts, values(i)%text)
         end do
         if (variable%shape == shape_one) call self%values%put(name, values(1)%text)
         if (variable%shape /= shape_one) call self%values%put(name, texts)
         return
      end if
      allocate (reals(size(values)))
      do i = 1, size(values)
         call read_real(values(i)%text, reals(i), outcome)
      end do
      if (variable%kind == kind_logical) then
         call self%values%put(name, values(1)%text == '.true.')
      else if (variable%kind == kind_integer) then
         call self%values%put(name, nint(reals(1)))
      else if (variable%shape == shape_one) then
         call self%values%put(name, reals(1))
      else
         call self%values%put_array(name, reals, shape(reals))
      end if
   end subroutine visit
end module settings_values
