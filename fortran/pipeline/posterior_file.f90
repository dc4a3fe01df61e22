!> posterior.bin: all numbers of Step 2, see `extraction_values`, as named values with a checksum of all before it at the end.
module posterior_file
   use, intrinsic :: iso_c_binding, only: c_char
   use checksums, only: checksum
   use errors, only: error_type, exit_bad_input, raise
   use extraction, only: extraction_type
   use extraction_values, only: put_extraction
   use files, only: file_exists, read_bytes, replace_file
   use kinds, only: wp
   use named_values, only: named_values_reader_type, named_values_type
   use problem, only: problem_type
   implicit none
   private
   public :: save_posterior, read_posterior, stored_draws

   character(len=*), parameter :: name = '/posterior.bin'
   integer, parameter :: digits = 16

contains

   !> Write the numbers into a `folder`, with the `inputs` that they follow from.
   subroutine save_posterior(problem, found, document, folder, inputs, error)
      type(problem_type), intent(in) :: problem
      type(extraction_type), intent(in) :: found
      character(len=*), intent(in) :: document, folder, inputs
      type(error_type), allocatable, intent(out) :: error
      type(named_values_type) :: values

      call values%put('inputs', inputs)
      call put_extraction(problem, found, document, values)
      associate (content => values%bytes(:values%filled))
         call replace_file(folder//name, content//checksum(content), error)
      end associate
   end subroutine save_posterior

   !> The named values of a folder, as bytes (`content`); refused if they were changed.
   subroutine read_posterior(folder, content, error)
      character(len=*), intent(in) :: folder
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      integer :: n

      call read_bytes(folder//name, content, error)
      if (allocated(error)) return
      n = len(content) - digits
      if (n > 0) then
         if (content(n + 1:) == checksum(content(:n))) then
            content = content(:n)
            return
         end if
      end if
      call raise(error, folder//name//': is damaged, or was changed since it was written; run the command that wrote it again', &
         & exit_bad_input)
   end subroutine read_posterior

   !> The draws (parameter, draw) that were left in a folder, if they follow from these inputs; else none.
   subroutine stored_draws(folder, inputs, dimension, draws)
      character(len=*), intent(in) :: folder, inputs
      !> How many parameters there are.
      integer, intent(in) :: dimension
      real(wp), allocatable, intent(out) :: draws(:, :)
      type(error_type), allocatable :: error
      type(named_values_reader_type) :: values
      character(kind=c_char, len=:), allocatable, target :: content
      real(wp), pointer :: found(:, :)

      if (.not. file_exists(folder//name)) return
      call read_posterior(folder, content, error)
      if (allocated(error)) return
      call values%look_at(content)
      if (values%text('inputs') /= inputs) return
      found => values%columns('draws', dimension)
      draws = found
   end subroutine stored_draws
end module posterior_file
