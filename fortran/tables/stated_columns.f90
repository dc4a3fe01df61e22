!> Which column of a table is which quantity where the user says so: `columns = 'modulus_gpa = E (raw)', ..`.
module stated_columns
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use orientation_columns, only: direction_names
   use spelling, only: suggestion
   use table_columns, only: column_list, known_names
   use tables, only: longest_name, table_type
   use text, only: lower, split_list
   implicit none
   private
   public :: name_columns

contains

   !> Give columns the names that `said` has for them; their units stay those of the header.
   subroutine name_columns(table, said, error)
      type(table_type), intent(inout) :: table
      !> Of each a name, = and the header of its column; unallocated: nothing is said.
      character(len=*), allocatable, intent(in) :: said(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=longest_name) :: given(table%columns)
      character(len=:), allocatable :: names, known(:), name, header, place
      integer :: equals, column, i, j, k

      if (.not. allocated(said)) return
      names = known_names()//', '//direction_names()
      known = split_list(names)
      given = ''
      do i = 1, size(said)
         equals = index(said(i), '=')
         name = trim(adjustl(said(i)(:max(1, equals) - 1)))
         header = trim(adjustl(said(i)(equals + 1:)))
         place = 'columns: '''//printable(trim(said(i)))//''': '
         if (len(name) == 0 .or. len(header) == 0) then
            call raise(error, place//'a name, = and the header of its column are needed, such as ''modulus_gpa = E (raw)''', &
               & exit_bad_input)
            return
         end if
         do k = 1, size(known)
            if (lower(known(k)) == lower(name)) exit
         end do
         if (k > size(known)) then
            call raise(error, place//'no column '//printable(name)//' is read'//suggestion(name, names)//'; allowed '//names, &
               & exit_bad_input)
            return
         end if
         column = 0
         do j = 1, table%columns
            if (table%name(j) == header .or. (column == 0 .and. lower(table%name(j)) == lower(header))) column = j
         end do
         if (column == 0) then
            call raise(error, place//'the table has no column '//printable(header)//suggestion(header, column_list(table)) &
               & //'; the columns are '//column_list(table), exit_bad_input)
         else if (any(given == known(k)) .or. len_trim(given(column)) > 0) then
            call raise(error, place//'the name or the column is there twice; each is allowed once', exit_bad_input)
         end if
         if (allocated(error)) return
         given(column) = known(k)
      end do
      table%given_names = given
   end subroutine name_columns
end module stated_columns
