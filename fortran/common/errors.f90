!> How a procedure of the library reports that it could not do its work.
!>
!> The last argument is `type(error_type), allocatable, intent(out) :: error`; unallocated means
!> success. The caller returns at once if it is allocated. Nothing in the library stops the process.
module errors
   use text, only: split_list
   implicit none
   private
   public :: error_type, locate_error, prefix_error, raise, refuse, exit_failure, exit_bad_input, &
      & exit_unusable, machine_failure, suggestion

   !> Exit statuses of the programs (see the README). With `exit_unusable` the program finished, but
   !> its result cannot be used.
   integer, parameter :: exit_failure = 1, exit_bad_input = 2, exit_unusable = 3

   !> The machine could not do the work (memory, disk), which says nothing about the crystal.
   !> Programs end with `exit_failure`.
   integer, parameter :: machine_failure = 3

   type :: error_type
      !> `exit_bad_input` if the user's input is wrong, `machine_failure` if the machine could not
      !> do the work, `exit_failure` otherwise.
      integer :: status = exit_failure
      !> Where the input is: group and variable of a namelist, and its file, or the function of
      !> Python that it was given to; '' for what is not known.
      character(len=100) :: group = '', variable = ''
      character(len=:), allocatable :: file
      !> What is wrong, the value, what is allowed.
      character(len=:), allocatable :: message
   contains
      procedure :: line
   end type error_type

contains

   !> Set `error` to a failure with this message; the default of `status` is `exit_failure`.
   pure subroutine raise(error, message, status)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in) :: message
      integer, intent(in), optional :: status

      allocate (error)
      error%message = message
      error%file = ''
      if (present(status)) error%status = status
   end subroutine raise

   !> Set `error` to the refusal of a user's input, with this `message` on `group` and
   !> `variable` of a namelist.
   pure subroutine refuse(error, message, group, variable)
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in) :: message
      character(len=*), intent(in), optional :: group, variable

      call raise(error, message, exit_bad_input)
      call locate_error(error, '', group, variable)
   end subroutine refuse

   !> Say where an input is, if there is an error whose file and group are not both known. A file
   !> alone is one that this input names: it begins the message.
   pure subroutine locate_error(error, file, group, variable)
      type(error_type), allocatable, intent(inout) :: error
      !> See `error_type`.
      character(len=*), intent(in) :: file
      !> Likewise.
      character(len=*), intent(in), optional :: group, variable

      if (.not. allocated(error)) return
      if (len(error%file) > 0) then
         if (error%group /= '') return
         error%message = error%file//': '//error%message
      end if
      error%file = file
      if (present(group) .and. error%group == '') error%group = group
      if (present(variable) .and. error%variable == '') error%variable = variable
   end subroutine locate_error

   !> Put a text before the message of an error, if there is one.
   pure subroutine prefix_error(error, text)
      type(error_type), allocatable, intent(inout) :: error
      character(len=*), intent(in) :: text

      if (allocated(error)) error%message = text//error%message
   end subroutine prefix_error

   !> The line that programs print: `FILE: &group variable: message`.
   pure function line(self)
      class(error_type), intent(in) :: self
      character(len=:), allocatable :: line

      line = trim(self%variable)
      if (self%group /= '') line = trim('&'//trim(self%group)//' '//line)
      if (len(line) > 0) line = line//': '
      line = line//self%message
      if (len(self%file) > 0) line = self%file//': '//line
   end function line

   !> ', did you mean X?' with the nearest of the allowed names; empty if no name is near.
   pure function suggestion(written, allowed) result(hint)
      !> The unknown name; the allowed names, separated by ', '.
      character(len=*), intent(in) :: written, allowed
      character(len=:), allocatable :: hint, names(:)
      integer :: i, nearest

      hint = ''
      names = split_list(allowed)
      if (size(names) == 0) return
      associate (distances => [(edit_distance(trim(names(i)), written), i=1, size(names))])
         nearest = minloc(distances, dim=1)
         if (distances(nearest) <= max(1, len_trim(names(nearest))/3)) then
            hint = ', did you mean '//trim(names(nearest))//'?'
         end if
      end associate
   end function suggestion

   !> Levenshtein's distance between two texts.
   pure integer function edit_distance(a, b) result(distance)
      character(len=*), intent(in) :: a, b
      integer :: previous(0:len(b)), current(0:len(b)), i, j

      previous = [(j, j=0, len(b))]
      do i = 1, len(a)
         current(0) = i
         do j = 1, len(b)
            current(j) = min(previous(j) + 1, current(j - 1) + 1, &
               & previous(j - 1) + merge(0, 1, a(i:i) == b(j:j)))
         end do
         previous = current
      end do
      distance = previous(len(b))
   end function edit_distance
end module errors
