!> Lists and tables of a problem as one text each, for callers of another language: items end with byte 31, rows with byte 30.
module problem_texts
   use namelist_schema, only: allowed_in_words, kind_names, new_schema, schema_type
   use point_tables, only: points_type
   use problem, only: problem_type
   implicit none
   private
   public :: text_of, schema_rows

   character, parameter :: item_end = achar(31), row_end = achar(30)

contains

   !> 1 resolved namelist, 2 warnings, 3 groups of the file, 4 stages; 11, 12, 13 cells of the tables, header first.
   function text_of(self, item) result(text)
      type(problem_type), intent(in) :: self
      integer, intent(in) :: item
      character(len=:), allocatable :: text
      integer :: i

      select case (item)
      case (1)
         text = self%resolved_text()
      case (2)
         text = ''
         do i = 1, size(self%warnings)
            text = text//self%warnings(i)%text//item_end
         end do
      case (3)
         text = ''
         do i = 1, size(self%schema%groups)
            if (self%has_group(self%schema%groups(i)%name)) text = text//self%schema%groups(i)%name//item_end
         end do
      case (4)
         text = self%stages
      case (11)
         text = cells(self%crystals)
      case (12)
         text = cells(self%measurements)
      case (13)
         text = cells(self%candidates)
      case default
         text = ''
      end select
   end function text_of

   function cells(points) result(text)
      type(points_type), intent(in) :: points
      character(len=:), allocatable :: text
      character(len=:), allocatable :: cell
      integer :: i, j, length

      length = 0
      do i = 0, points%n
         do j = 1, points%table%columns
            length = length + len(points%table%cell(j, i)) + 1
         end do
         length = length + 1
      end do
      allocate (character(len=length) :: text)
      length = 0
      do i = 0, points%n
         do j = 1, points%table%columns
            cell = points%table%cell(j, i)
            text(length + 1:length + len(cell) + 1) = cell//item_end
            length = length + len(cell) + 1
         end do
         length = length + 1
         text(length:length) = row_end
      end do
   end function cells

   !> The schema: group, meaning of the group, variable, type, 1 if for each constant, unit, default, allowed, meaning.
   function schema_rows() result(text)
      character(len=:), allocatable :: text
      type(schema_type) :: s
      integer :: i

      s = new_schema()
      text = ''
      do i = 1, size(s%variables)
         associate (v => s%variables(i))
            text = text//v%group//item_end//s%groups(s%find_group(v%group))%meaning//item_end//v%name//item_end &
               & //trim(kind_names(v%kind))//item_end//merge('1', '0', v%per_constant)//item_end//v%unit//item_end &
               & //v%default//item_end//allowed_in_words(v)//item_end//v%meaning//item_end//row_end
         end associate
      end do
   end function schema_rows
end module problem_texts
