!> The variables of the settings with their values as a namelist has them: read, listed, written and compared in this one form.
!>
!> `settings_schema`, which is made of docs/namelists.md, adds each group and variable, with what variable_type says of `kind`, `shape`,
!> `default`, `allowed`, `unit` and `meaning`; then it calls one of the typed procedures for the component (`value`) of each variable in
!> turn: they turn it into texts, or, of a list that is `giving`, the texts into it.
module settings_list
   use kinds, only: wp
   use namelist_file, only: value_type
   use text, only: number_text, read_integer, read_real, to_text
   implicit none
   private
   public :: settings_list_type, group_type, variable_type, is_text
   public :: kind_integer, kind_real, kind_logical, kind_text, kind_choice, kind_file, kind_source, kind_names
   public :: shape_one, shape_constants, shape_list, longest_item

   !> Bytes of a text in a list: the name of a quantity, or of a column with its header.
   integer, parameter :: longest_item = 128

   !> A whole number; a real; .true. or .false.; any text; one of some words; a CSV that must exist; a word or a CSV.
   integer, parameter :: kind_integer = 1, kind_real = 2, kind_logical = 3, kind_text = 4, kind_choice = 5, &
      & kind_file = 6, kind_source = 7
   character(len=*), parameter :: kind_names(7) = [character(len=7) :: &
      & 'integer', 'real', 'logical', 'text', 'choice', 'file', 'source']

   !> One value; one for each constant of the crystal class; any number of them.
   integer, parameter :: shape_one = 1, shape_constants = 2, shape_list = 3

   type :: group_type
      character(len=:), allocatable :: name, meaning
      !> The file has it.
      logical :: given = .false.
   end type group_type

   type :: variable_type
      character(len=:), allocatable :: group, name
      !> The number of its group.
      integer :: group_number = 0
      integer :: kind = kind_text, shape = shape_one
      !> Namelist text; '*' is required; 'unset' has no value.
      character(len=:), allocatable :: default
      !> As messages say it: '0 to below 1', 'above 0 to 1'; the words of a choice in quotes.
      character(len=:), allocatable :: allowed
      character(len=:), allocatable :: unit, meaning
      !> Unallocated: unset.
      type(value_type), allocatable :: values(:)
   end type variable_type

   type :: settings_list_type
      !> In order.
      type(group_type), allocatable :: groups(:)
      type(variable_type), allocatable :: variables(:)
      !> Of groups and variables, how many were added, or visited.
      integer :: n_groups = 0, n_variables = 0
      !> The values of the list go into the settings; else it takes them from there.
      logical :: giving = .false.
   contains
      procedure :: add_group, add, group, integer => visit_integer, logical => visit_logical, text => visit_text, &
         & texts => visit_texts, real => visit_real, optional_logical => visit_optional_logical, &
         & optional_real => visit_optional_real, reals => visit_reals
   end type settings_list_type

contains

   !> The variables that are added next are of this group.
   subroutine add_group(self, name, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, meaning

      self%n_groups = self%n_groups + 1
      self%groups(self%n_groups)%name = name
      self%groups(self%n_groups)%meaning = meaning
   end subroutine add_group

   subroutine add(self, name, kind, shape, default, allowed, unit, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, allowed, unit, meaning
      integer, intent(in) :: kind, shape

      self%n_variables = self%n_variables + 1
      associate (v => self%variables(self%n_variables))
         v%group_number = self%n_groups
         v%group = self%groups(self%n_groups)%name
         v%name = name
         v%kind = kind
         v%shape = shape
         v%default = default
         v%allowed = allowed
         v%unit = unit
         v%meaning = meaning
      end associate
   end subroutine add

   !> Whether the next group is `given`.
   subroutine group(self, given)
      class(settings_list_type), intent(inout) :: self
      logical, intent(inout) :: given

      self%n_groups = self%n_groups + 1
      if (self%giving) given = self%groups(self%n_groups)%given
      self%groups(self%n_groups)%given = given
   end subroutine group

   subroutine visit_integer(self, value)
      class(settings_list_type), intent(inout) :: self
      integer, intent(inout) :: value
      character(len=:), allocatable :: text
      integer :: outcome

      text = to_text(value)
      call self%text(text)
      if (allocated(text)) call read_integer(text, value, outcome)
   end subroutine visit_integer

   subroutine visit_logical(self, value)
      class(settings_list_type), intent(inout) :: self
      logical, intent(inout) :: value
      character(len=:), allocatable :: text

      text = to_text(value)
      call self%text(text)
      if (allocated(text)) value = text == '.true.'
   end subroutine visit_logical

   !> Unallocated: unset.
   subroutine visit_optional_logical(self, value)
      class(settings_list_type), intent(inout) :: self
      logical, allocatable, intent(inout) :: value
      character(len=:), allocatable :: text

      if (allocated(value)) then
         text = to_text(value)
         deallocate (value)
      end if
      call self%text(text)
      if (allocated(text)) value = text == '.true.'
   end subroutine visit_optional_logical

   !> The text of a namelist; unallocated: unset.
   subroutine visit_text(self, value)
      class(settings_list_type), intent(inout) :: self
      character(len=:), allocatable, intent(inout) :: value
      type(value_type), allocatable :: values(:)

      if (allocated(value)) then
         allocate (values(1))
         call move_alloc(value, values(1)%text)
      end if
      call visit(self, values)
      if (allocated(values)) value = values(1)%text
   end subroutine visit_text

   !> A list of texts.
   subroutine visit_texts(self, value)
      class(settings_list_type), intent(inout) :: self
      character(len=longest_item), allocatable, intent(inout) :: value(:)
      type(value_type), allocatable :: values(:)
      integer :: i

      if (allocated(value)) then
         allocate (values(size(value)))
         do i = 1, size(value)
            values(i)%text = trim(value(i))
         end do
         deallocate (value)
      end if
      call visit(self, values)
      if (.not. allocated(values)) return
      allocate (value(size(values)))
      do i = 1, size(values)
         value(i) = values(i)%text
      end do
   end subroutine visit_texts

   subroutine visit_real(self, value)
      class(settings_list_type), intent(inout) :: self
      real(wp), intent(inout) :: value
      real(wp), allocatable :: values(:)

      values = [value]
      call self%reals(values)
      if (allocated(values)) value = values(1)
   end subroutine visit_real

   !> A real that may be unset, and is by default.
   subroutine visit_optional_real(self, value)
      class(settings_list_type), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: value
      real(wp), allocatable :: values(:)

      if (allocated(value)) then
         values = [value]
         deallocate (value)
      end if
      call self%reals(values)
      if (allocated(values)) value = values(1)
   end subroutine visit_optional_real

   !> Reals; unallocated: unset.
   subroutine visit_reals(self, value)
      class(settings_list_type), intent(inout) :: self
      real(wp), allocatable, intent(inout) :: value(:)
      type(value_type), allocatable :: values(:)
      integer :: i, outcome

      if (allocated(value)) then
         allocate (values(size(value)))
         do i = 1, size(value)
            values(i)%text = number_text(value(i))
         end do
         deallocate (value)
      end if
      call visit(self, values)
      if (.not. allocated(values)) return
      allocate (value(size(values)))
      do i = 1, size(values)
         call read_real(values(i)%text, value(i), outcome)
      end do
   end subroutine visit_reals

   !> Take the values of the variable that comes next, or give them.
   subroutine visit(self, values)
      class(settings_list_type), intent(inout) :: self
      type(value_type), allocatable, intent(inout) :: values(:)

      self%n_variables = self%n_variables + 1
      associate (v => self%variables(self%n_variables))
         if (self%giving .and. allocated(values)) deallocate (values)
         if (self%giving .and. allocated(v%values)) values = v%values
         if (.not. self%giving .and. allocated(values)) v%values = values
      end associate
   end subroutine visit

   pure logical function is_text(v)
      type(variable_type), intent(in) :: v

      is_text = any(v%kind == [kind_text, kind_choice, kind_file, kind_source])
   end function is_text
end module settings_list
