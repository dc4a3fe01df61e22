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

   !> Bytes that are handed on at once.
   integer, parameter :: page_size = 65536

   !> What waits to be written.
   type :: page_type
      character(len=:), allocatable :: text
      integer :: filled = 0
   end type page_type

contains

   !> Write a table with the columns `names`, separated by commas; its own of these names are left out.
   subroutine write_table(table, path, names, values, error)
      type(table_type), intent(in) :: table
      character(len=*), intent(in) :: path, names
      !> Of each row and each name; what is not finite is an empty cell.
      real(wp), intent(in) :: values(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file
      type(page_type) :: page
      character(len=:), allocatable :: added(:)
      logical :: kept(table%columns)
      integer :: i, j

      allocate (added, source=split_list(names))
      kept = [(all(added /= table%name(j)), j=1, table%columns)]
      allocate (character(len=page_size) :: page%text)
      call file%begin(path)
      do i = 0, table%rows
         do j = 1, table%columns
            if (kept(j)) call put(file, page, csv_cell(table%cell(j, i))//',')
         end do
         do j = 1, size(added)
            if (i == 0) call put(file, page, trim(added(j)))
            if (i > 0) call put(file, page, short_text(values(max(i, 1), j)))
            call put(file, page, merge(newline, ',', j == size(added)))
         end do
      end do
      call file%add(page%text(:page%filled))
      call file%finish(error)
   end subroutine write_table

   !> Let a piece follow.
   subroutine put(file, page, piece)
      type(new_file_type), intent(inout) :: file
      type(page_type), intent(inout) :: page
      character(len=*), intent(in) :: piece

      if (page%filled + len(piece) > page_size) then
         call file%add(page%text(:page%filled))
         page%filled = 0
      end if
      if (len(piece) > page_size) then
         call file%add(piece)
      else
         page%text(page%filled + 1:page%filled + len(piece)) = piece
         page%filled = page%filled + len(piece)
      end if
   end subroutine put
end module table_writer
