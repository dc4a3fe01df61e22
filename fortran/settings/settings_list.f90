!> The variables of the settings, with values as texts of a namelist. In this one form settings are
!> read, listed, written and compared.
!>
!> The build makes `settings_schema` from docs/namelists.md. It lists each group and variable with
!> the components of variable_type, and converts between values and texts.
module settings_list
   use kinds, only: wp
   use namelist_file, only: value_type
   use text, only: number_text, read_real
   implicit none
   private
   public :: settings_list_type, group_type, variable_type, is_text, text_values, real_values, &
      & real_of, name_of, longest_item

   !> Longest text in a list, bytes: the name of a quantity, or of a column with its header.
   integer, parameter :: longest_item = 128

   type :: group_type
      character(len=:), allocatable :: name
      !> Whether the file has the group.
      logical :: given = .false.
   end type group_type

   type :: variable_type
      character(len=:), allocatable :: group, group_meaning, name
      !> Kind of a value: 'integer', 'real', 'logical', 'text', 'choice' of some words, 'file' that
      !> must exist, 'choice or file'.
      character(len=:), allocatable :: kind
      !> 'one' value, one for each of the 'constants', or a 'list'.
      character(len=:), allocatable :: shape, unit
      !> Text of a namelist; '*' if the variable is required; 'unset' if it has no value.
      character(len=:), allocatable :: default
      !> As in messages: '0 to below 1', 'above 0 to 1'; the words of a choice in quotes.
      character(len=:), allocatable :: allowed, meaning
      !> Unallocated if the variable is unset.
      type(value_type), allocatable :: values(:)
   end type variable_type

   type :: settings_list_type
      !> In the order of docs/namelists.md.
      type(group_type), allocatable :: groups(:)
      type(variable_type), allocatable :: variables(:)
   end type settings_list_type

contains

   !> Values of a variable from the texts `names`, without their trailing blanks.
   pure function text_values(names) result(values)
      character(len=*), intent(in) :: names(:)
      type(value_type) :: values(size(names))
      integer :: i

      do i = 1, size(names)
         values(i)%text = trim(names(i))
      end do
   end function text_values

   !> Values of a variable from `numbers`.
   pure function real_values(numbers) result(values)
      real(wp), intent(in) :: numbers(:)
      type(value_type) :: values(size(numbers))
      integer :: i

      do i = 1, size(numbers)
         values(i)%text = number_text(numbers(i))
      end do
   end function real_values

   !> The number of a value.
   elemental real(wp) function real_of(value)
      type(value_type), intent(in) :: value
      integer :: outcome

      call read_real(value%text, real_of, outcome)
   end function real_of

   !> The text of a value of a list.
   elemental character(len=longest_item) function name_of(value)
      type(value_type), intent(in) :: value

      name_of = value%text
   end function name_of

   pure logical function is_text(v)
      type(variable_type), intent(in) :: v

      is_text = all(v%kind /= ['integer', 'logical', 'real   '])
   end function is_text
end module settings_list
