! Campaigns for Python, under handles of the kind 'campaign'; `object_release` closes them. A point is the constants of a crystal (GPa)
! and Bunge's angles (degrees), one after the other.

!> Open the campaign file `path` for the physics of an `identity`.
subroutine campaign_open(path, identity, handle, status, message)
   use campaign_handles, only: held_campaign_type
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   implicit none
   character(len=*), intent(in) :: path, identity
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(held_campaign_type), pointer :: held
   type(error_type), allocatable :: error

   allocate (held)
   call held%campaign%open(path, identity, error)
   call keep_object(held, 'campaign', error, handle)
   call error_to_status(error, status, message)
end subroutine campaign_open

!> Read the rows of a symmetry, or of all if it is blank, or of one `point` (n), which is empty if all are wanted. `sizes`: how many
!> rows, numbers and bytes of text `campaign_selected` gives of them.
subroutine campaign_select(handle, symmetry, n, point, sizes, status, message)
   use campaign, only: row_type
   use campaign_handles, only: campaign_of_handle, held_campaign_type
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: point(n)
   integer(c_int), intent(out) :: sizes(3), status
   character(len=4096), intent(out) :: message
   type(held_campaign_type), pointer :: held
   type(error_type), allocatable :: error
   type(row_type) :: row
   logical :: found
   integer :: i

   sizes = 0
   call campaign_of_handle(handle, held, error)
   if (.not. allocated(error)) then
      if (n == 0) then
         call held%campaign%rows(symmetry, held%rows, error)
      else
         call held%campaign%find(symmetry, point(:n - 3), point(n - 2:), row, found, error)
         if (allocated(held%rows)) deallocate (held%rows)
         allocate (held%rows(merge(1, 0, found)))
         if (found) held%rows(1) = row
      end if
   end if
   call error_to_status(error, status, message)
   if (status /= 0) return
   sizes(1) = size(held%rows)
   do i = 1, size(held%rows)
      associate (next => held%rows(i))
         sizes(2) = sizes(2) + size(next%constants) + size(next%outcome%depth) + size(next%outcome%force)
         sizes(3) = sizes(3) + len_trim(next%symmetry) + len(next%outcome%message) + 2
      end associate
   end do
end subroutine campaign_select

!> The rows that were read, with `n_values` numbers and `n_text` bytes of text. Of each there is a column of `numbers`, which are
!> position, 1 if imported, 1 if failed, modulus (GPa), seconds, elements, Bunge's angles (degrees), and how many of `values` are
!> constants (GPa), depths (um) and forces (mN); and in `text` symmetry and message, each ended by a zero.
subroutine campaign_selected(handle, rows, n_values, n_text, numbers, values, text, status, message)
   use campaign_handles, only: campaign_of_handle, held_campaign_type
   use interoperation, only: c_char, c_double, c_int, c_int64_t, error_to_status, error_type
   use simulate, only: outcome_failed
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: rows, n_values, n_text
   real(c_double), intent(out) :: numbers(12, rows), values(n_values)
   character(kind=c_char, len=1), intent(out) :: text(n_text)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(held_campaign_type), pointer :: held
   type(error_type), allocatable :: error
   integer :: i, v, t

   numbers = 0.0_c_double
   values = 0.0_c_double
   text = achar(0)
   call campaign_of_handle(handle, held, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   v = 0
   t = 0
   do i = 1, rows
      associate (row => held%rows(i), outcome => held%rows(i)%outcome)
         numbers(:, i) = [real(row%position, c_double), merge(1.0_c_double, 0.0_c_double, row%imported), &
            & merge(1.0_c_double, 0.0_c_double, outcome%status == outcome_failed), outcome%modulus, outcome%seconds, &
            & real(outcome%elements, c_double), row%euler_deg, real(size(row%constants), c_double), &
            & real(size(outcome%depth), c_double), real(size(outcome%force), c_double)]
         call put_values(row%constants)
         call put_values(outcome%depth)
         call put_values(outcome%force)
         call put_text(trim(row%symmetry))
         call put_text(outcome%message)
      end associate
   end do

contains

   !> Append a `list` to the values.
   subroutine put_values(list)
      real(c_double), intent(in) :: list(:)

      values(v + 1:v + size(list)) = list
      v = v + size(list)
   end subroutine put_values

   !> Append a `string` to the text.
   subroutine put_text(string)
      character(len=*), intent(in) :: string

      text(t + 1:t + len(string)) = transfer(string, text, len(string))
      t = t + len(string) + 1
   end subroutine put_text
end subroutine campaign_selected

!> Store one result of a `point` (n) of a `symmetry`. `numbers`: position or -1 for the next, 1 if it failed, modulus (GPa), seconds,
!> elements; `curve`: depth (um), force (mN), of so many `points`; `reason`: why it failed.
subroutine campaign_add(handle, symmetry, n, point, numbers, points, curve, reason, status, message)
   use campaign, only: row_type
   use campaign_handles, only: campaign_of_handle, held_campaign_type
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use simulate, only: outcome_done, outcome_failed
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: symmetry, reason
   integer(c_int), intent(in) :: n, points
   real(c_double), intent(in) :: point(n), numbers(5), curve(points, 2)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(held_campaign_type), pointer :: held
   type(error_type), allocatable :: error
   type(row_type) :: row

   row%position = nint(numbers(1))
   row%symmetry = symmetry
   row%constants = point(:n - 3)
   row%euler_deg = point(n - 2:)
   row%outcome%status = merge(outcome_failed, outcome_done, nint(numbers(2)) == 1)
   row%outcome%modulus = numbers(3)
   row%outcome%seconds = numbers(4)
   row%outcome%elements = nint(numbers(5))
   row%outcome%depth = curve(:, 1)
   row%outcome%force = curve(:, 2)
   row%outcome%message = reason
   call campaign_of_handle(handle, held, error)
   if (.not. allocated(error)) call held%campaign%add(row, error)
   call error_to_status(error, status, message)
end subroutine campaign_add

!> Import results of others, `moduli` (GPa), of n crystals of a symmetry; `n_new` were not there.
subroutine campaign_import(handle, symmetry, k, n, constants, euler_deg, moduli, n_new, status, message)
   use campaign_handles, only: campaign_of_handle, held_campaign_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: k, n
   real(c_double), intent(in) :: constants(k, n), euler_deg(3, n), moduli(n)
   integer(c_int), intent(out) :: n_new, status
   character(len=4096), intent(out) :: message
   type(held_campaign_type), pointer :: held
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error

   n_new = 0
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call campaign_of_handle(handle, held, error)
   if (.not. allocated(error)) call held%campaign%import_rows(class, constants, euler_deg, moduli, n_new, error)
   call error_to_status(error, status, message)
end subroutine campaign_import

!> The `position` of a row to come, and the `identities` of other physics that have rows, one a line.
subroutine campaign_facts(handle, position, identities, status, message)
   use campaign_handles, only: campaign_of_handle, held_campaign_type
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(out) :: position
   character(len=65536), intent(out) :: identities
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(held_campaign_type), pointer :: held
   type(error_type), allocatable :: error
   character(len=:), allocatable :: lines

   position = 0
   identities = ''
   call campaign_of_handle(handle, held, error)
   if (.not. allocated(error)) call held%campaign%next_position(position, error)
   if (.not. allocated(error)) call held%campaign%other_physics(lines, error)
   if (.not. allocated(error)) identities = lines
   call error_to_status(error, status, message)
end subroutine campaign_facts
