!> The variables of the settings with their values as a namelist has them: read, listed, written and compared in this one form.
!>
!> `settings_schema` calls one of the typed procedures for each variable; they turn its component into texts, or, of a list that is
!> `giving`, the texts into its component. Each takes `name`, the component (`value`), and what variable_type says of
!> `kind`, `shape`, `default`, `allowed`, `unit` and `meaning`; a group also whether it is `given`.
module settings_list
   use kinds, only: wp
   use namelist_file, only: value_type
   use text, only: join, number_text, read_integer, read_real, split_list, to_text
   implicit none
   private
   public :: settings_list_type, group_type, variable_type, choice_list_type, is_text, allowed_in_words
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

   !> Words of a choice that a module above the settings owns, under a key.
   type :: choice_list_type
      character(len=:), allocatable :: key
      !> Separated by ', '.
      character(len=:), allocatable :: words
   end type choice_list_type

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
      !> An interval, '[0, 1)'; or the words of a choice, separated by ', '.
      character(len=:), allocatable :: allowed
      character(len=:), allocatable :: unit, meaning
      !> Unallocated: unset.
      type(value_type), allocatable :: values(:)
   end type variable_type

   type :: settings_list_type
      type(choice_list_type), allocatable :: choices(:)
      !> In order; what is not allocated yet is only counted.
      type(group_type), allocatable :: groups(:)
      type(variable_type), allocatable :: variables(:)
      !> Of groups and variables.
      integer :: n_groups = 0, n_variables = 0
      !> The values of the list go into the settings; else it takes them from there.
      logical :: giving = .false.
   contains
      procedure :: words, group, integer => visit_integer, logical => visit_logical, text => visit_text, names => visit_names, &
         & real => visit_real, optional_logical => visit_optional_logical, optional_real => visit_optional_real, &
         & reals => visit_reals
   end type settings_list_type

contains

   !> The words of a key of `all_choices`.
   pure function words(self, key) result(list)
      class(settings_list_type), intent(in) :: self
      character(len=*), intent(in) :: key
      character(len=:), allocatable :: list
      integer :: i

      list = ''
      do i = 1, size(self%choices)
         if (self%choices(i)%key == key) list = self%choices(i)%words
      end do
   end function words

   !> The variables that follow are of this group.
   subroutine group(self, name, given, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, meaning
      logical, intent(inout) :: given

      self%n_groups = self%n_groups + 1
      if (.not. allocated(self%groups)) return
      associate (group => self%groups(self%n_groups))
         if (self%giving) then
            given = group%given
         else
            group%name = name
            group%meaning = meaning
            group%given = given
         end if
      end associate
   end subroutine group

   subroutine visit_integer(self, name, value, default, allowed, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, allowed, meaning
      integer, intent(inout) :: value
      character(len=:), allocatable :: text
      integer :: outcome

      text = to_text(value)
      call self%text(name, text, kind_integer, default, allowed, meaning)
      if (allocated(text)) call read_integer(text, value, outcome)
   end subroutine visit_integer

   subroutine visit_logical(self, name, value, default, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, meaning
      logical, intent(inout) :: value
      character(len=:), allocatable :: text

      text = to_text(value)
      call self%text(name, text, kind_logical, default, '', meaning)
      if (allocated(text)) value = text == '.true.'
   end subroutine visit_logical

   !> Unallocated: unset.
   subroutine visit_optional_logical(self, name, value, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, meaning
      logical, allocatable, intent(inout) :: value
      character(len=:), allocatable :: text

      if (allocated(value)) then
         text = to_text(value)
         deallocate (value)
      end if
      call self%text(name, text, kind_logical, 'unset', '', meaning)
      if (allocated(text)) value = text == '.true.'
   end subroutine visit_optional_logical

   !> A value without a unit as the text of a namelist; unallocated: unset.
   subroutine visit_text(self, name, value, kind, default, allowed, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, allowed, meaning
      character(len=:), allocatable, intent(inout) :: value
      integer, intent(in) :: kind
      type(value_type), allocatable :: values(:)

      if (allocated(value)) then
         allocate (values(1))
         call move_alloc(value, values(1)%text)
      end if
      call visit(self, name, kind, shape_one, default, allowed, '', meaning, values)
      if (allocated(values)) value = values(1)%text
   end subroutine visit_text

   !> A list of texts.
   subroutine visit_names(self, name, value, default, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, meaning
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
      call visit(self, name, kind_text, shape_list, default, '', '', meaning, values)
      if (.not. allocated(values)) return
      allocate (value(size(values)))
      do i = 1, size(values)
         value(i) = values(i)%text
      end do
   end subroutine visit_names

   subroutine visit_real(self, name, value, default, allowed, unit, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, allowed, unit, meaning
      real(wp), intent(inout) :: value
      real(wp), allocatable :: values(:)

      values = [value]
      call self%reals(name, values, shape_one, default, allowed, unit, meaning)
      if (allocated(values)) value = values(1)
   end subroutine visit_real

   !> A real that may be unset, and is by default.
   subroutine visit_optional_real(self, name, value, allowed, unit, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, allowed, unit, meaning
      real(wp), allocatable, intent(inout) :: value
      real(wp), allocatable :: values(:)

      if (allocated(value)) then
         values = [value]
         deallocate (value)
      end if
      call self%reals(name, values, shape_one, 'unset', allowed, unit, meaning)
      if (allocated(values)) value = values(1)
   end subroutine visit_optional_real

   !> Reals; unallocated: unset.
   subroutine visit_reals(self, name, value, shape, default, allowed, unit, meaning)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, allowed, unit, meaning
      real(wp), allocatable, intent(inout) :: value(:)
      integer, intent(in) :: shape
      type(value_type), allocatable :: values(:)
      integer :: i, outcome

      if (allocated(value)) then
         allocate (values(size(value)))
         do i = 1, size(value)
            values(i)%text = number_text(value(i))
         end do
         deallocate (value)
      end if
      call visit(self, name, kind_real, shape, default, allowed, unit, meaning, values)
      if (.not. allocated(values)) return
      allocate (value(size(values)))
      do i = 1, size(values)
         call read_real(values(i)%text, value(i), outcome)
      end do
   end subroutine visit_reals

   !> Take the values of the variable that comes next, or give them.
   subroutine visit(self, name, kind, shape, default, allowed, unit, meaning, values)
      class(settings_list_type), intent(inout) :: self
      character(len=*), intent(in) :: name, default, allowed, unit, meaning
      integer, intent(in) :: kind, shape
      type(value_type), allocatable, intent(inout) :: values(:)

      self%n_variables = self%n_variables + 1
      if (.not. allocated(self%variables)) return
      associate (v => self%variables(self%n_variables))
         if (self%giving) then
            if (allocated(values)) deallocate (values)
            if (allocated(v%values)) values = v%values
            return
         end if
         v%group_number = self%n_groups
         v%group = self%groups(self%n_groups)%name
         v%name = name
         v%kind = kind
         v%shape = shape
         v%default = default
         v%allowed = allowed
         v%unit = unit
         v%meaning = meaning
         if (allocated(values)) v%values = values
      end associate
   end subroutine visit

   pure logical function is_text(v)
      type(variable_type), intent(in) :: v

      is_text = any(v%kind == [kind_text, kind_choice, kind_file, kind_source])
   end function is_text

   !> What is allowed, as a message says it: '0 to below 1', 'above 0 to 1', ''cubic', 'hexagonal'', or ''.
   function allowed_in_words(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words
      character(len=:), allocatable :: ends(:)

      words = ''
      select case (v%kind)
      case (kind_integer, kind_real)
         allocate (ends, source=split_list(v%allowed(2:len(v%allowed) - 1)))
         if (v%allowed(1:1) == '(') words = 'above '
         words = words//trim(ends(1))//' to '
         if (v%allowed(len(v%allowed):) == ')') words = words//'below '
         words = words//trim(ends(2))
      case (kind_choice, kind_source)
         words = ''''//join(split_list(v%allowed), ''', ''')//''''
         if (v%kind == kind_source) words = words//', or the name of a CSV file'
      case (kind_logical)
         words = '.true., .false.'
      case default
         continue
      end select
   end function allowed_in_words
end module settings_list
