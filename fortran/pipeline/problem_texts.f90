!> Lists and tables as one text each, for callers of another language: items end with byte 31, rows with byte 30.
module problem_texts
   use choices, only: all_choices
   use errors, only: error_type
   use point_tables, only: points_type
   use problem, only: problem_type
   use settings_lists, only: new_schema, schema_type, settings_namelist
   use settings_visitor, only: allowed_in_words, kind_names
   use stages, only: all_stages, run_command, stage_type
   use text, only: to_text
   use truncation_scan, only: read_scan
   implicit none
   private
   public :: text_of, static_text

   character, parameter :: item_end = achar(31), row_end = achar(30)

contains

   !> 1 resolved namelist, 2 the same with every group, 3 warnings, 4 groups of the file, 5 stages, 6 pairs of `scan`; 11, 12, 13
   !> cells of the tables, header first.
   !> The number is `item`.
   function text_of(self, item) result(text)
      type(problem_type), intent(in) :: self
      integer, intent(in) :: item
      character(len=:), allocatable :: text
      type(schema_type) :: schema
      type(error_type), allocatable :: error
      integer, allocatable :: pairs(:, :)
      integer :: i

      text = ''
      select case (item)
      case (1)
         text = self%resolved_text()
      case (2)
         schema = new_schema(all_choices())
         do i = 1, size(schema%groups)
            text = text//' '//schema%groups(i)%name
         end do
         text = settings_namelist(self%settings, text)
      case (3)
         do i = 1, size(self%warnings)
            text = text//self%warnings(i)%text//item_end
         end do
      case (4)
         text = self%groups
      case (5)
         text = self%stages
      case (6)
         call read_scan(self%settings%surrogate%scan, pairs, error)
         do i = 1, size(pairs, 2)
            text = text//to_text(pairs(1, i))//item_end//to_text(pairs(2, i))//item_end//row_end
         end do
      case (11)
         text = cells(self%crystals)
      case (12)
         text = cells(self%measurements)
      case (13)
         text = cells(self%candidates)
      case default
         continue
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

   !> Texts without a problem: 1 the schema: group, meaning of the group, variable, type, number of values ('one', 'constants',
   !> 'list'), unit, default, allowed, meaning; 2 the commands: name, groups, summary, description.
   !> The number is `item`.
   function static_text(item) result(text)
      integer, intent(in) :: item
      character(len=:), allocatable :: text
      character(len=9), parameter :: shapes(3) = [character(len=9) :: 'one', 'constants', 'list']
      type(schema_type) :: s
      integer :: i

      text = ''
      if (item == 1) then
         s = new_schema(all_choices())
         do i = 1, size(s%variables)
            associate (v => s%variables(i))
               text = text//v%group//item_end//s%groups(s%find_group(v%group))%meaning//item_end//v%name//item_end &
                  & //trim(kind_names(v%kind))//item_end//trim(shapes(v%shape))//item_end//v%unit//item_end &
                  & //v%default//item_end//allowed_in_words(v)//item_end//v%meaning//item_end//row_end
            end associate
         end do
      else
         text = row_of(run_command)
         do i = 1, size(all_stages)
            text = text//row_of(all_stages(i))
         end do
      end if

   contains

      function row_of(stage) result(row)
         type(stage_type), intent(in) :: stage
         character(len=:), allocatable :: row

         row = trim(stage%name)//item_end//trim(stage%groups)//item_end//trim(stage%document)//item_end//trim(stage%summary) &
            & //item_end//trim(stage%description)//item_end//row_end
      end function row_of
   end function static_text
end module problem_texts
