!> Tables as they were given, with columns of numbers added, as CSV.
module table_writer
   use errors, only: error_type
   use files, only: new_file_type
   use kinds, only: wp
   use numbers, only: short_text
   use tables, only: csv_cell, table_type
   use text, only: split_list
   implicit none
   private
   public :: write_table

   character, parameter :: newline = achar(10)

contains

   !> Write a table with the columns `names`, separated by commas; its own of these names are left out.
   subroutine write_table(table, path, names, values, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: path, names
      !> Of each row and each name; what is not finite is an empty cell.
      real(wp), intent(in) :: values(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file
      character(len=:), allocatable :: added(:), line
      logical :: kept(table%columns)
      integer :: i, j

      allocate (added, source=split_list(names))
      kept = [(all(added /= table%name(j)), j=1, table%columns)]
      call file%begin(path)
      do i = 0, table%rows
         line = ''
         do j = 1, table%columns
            if (kept(j)) line = line//csv_cell(table%cell(j, i))//','
         end do
         do j = 1, size(added)
            if (i == 0) line = line//trim(added(j))//','
            if (i > 0) line = line//short_text(values(max(i, 1), j))//','
         end do
         line(len(line):) = newline
         call file%add(line)
      end do
      call file%finish(error)
   end subroutine write_table
end module table_writer
