!> Relative errors that measurements share, such as the calibration of the instrument.
module shared_error_tables
   use errors, only: error_type, prefix_error, refuse
   use files, only: printable
   use kinds, only: wp
   use tables, only: read_table, table_type
   use text, only: to_text
   implicit none
   private
   public :: read_shared_errors

contains

   !> Read the shared errors of the rows of a table of measurements: from the file `path`, which has
   !> one row for each measurement, or from the columns shared_1, shared_2, .. of the table itself.
   subroutine read_shared_errors(table, path, shared_errors, digest, error)
      !> The measurements.
      type(table_type), intent(in) :: table
      !> Unallocated: the table itself has the columns.
      character(len=:), allocatable, intent(in) :: path
      !> (row of the table, error), of standard deviation 1; unchanged if no columns have them.
      real(wp), allocatable, intent(inout) :: shared_errors(:, :)
      !> Checksum of the table that has them.
      character(len=:), allocatable, intent(inout) :: digest
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: source
      logical, allocatable :: chosen(:)
      real(wp), allocatable :: values(:, :)
      integer :: j

      source = table
      if (allocated(path)) call read_table(path, source, error)
      if (.not. allocated(error) .and. source%rows /= table%rows) then
         call refuse(error, to_text(source%rows)//' rows for '//to_text(table%rows) &
            & //' of the measurements; each row has the errors of one of them')
      end if
      if (allocated(error)) source%columns = 0
      chosen = [(index(source%name(j), 'shared_') == 1 &
         & .or. (allocated(path) .and. source%name(j) /= 'grain'), j=1, source%columns)]
      if (any(chosen)) then
         call source%numbers(pack([(j, j=1, source%columns)], chosen), values, error)
         shared_errors = transpose(values)
         digest = source%digest()
      end if
      if (allocated(path)) call prefix_error(error, 'shared_errors: '//printable(path)//': ')
   end subroutine read_shared_errors

end module shared_error_tables
