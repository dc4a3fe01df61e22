! Problems for Python: a handle holds one while its parts are fetched, then `problem_free` ends it.

!> Read the namelist file `path` for `command`. handle: 0 if refused.
subroutine problem_read(path, command, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_loc, c_ptr
   use errors, only: error_type, error_to_status
   use problem, only: new_problem, problem_type
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: path, command
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error
   type(c_ptr) :: address

   handle = 0
   allocate (self)
   call new_problem(path, command, self, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (self)
      return
   end if
   address = c_loc(self)
   handle = transfer(address, handle)
end subroutine problem_read

!> A table of crystals alone, as `crystals` of a problem; symmetry: that of the rows that do not say theirs.
subroutine problem_read_crystals(path, symmetry, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_loc, c_ptr
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use point_tables, only: read_crystals
   use problem, only: problem_type
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: path
   character(len=*), intent(in) :: symmetry
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error
   type(c_ptr) :: address
   type(crystal_class_type) :: class

   handle = 0
   allocate (self)
   allocate (self%crystals)
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call read_crystals(path, path//': ', class, self%crystals, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (self)
      return
   end if
   address = c_loc(self)
   handle = transfer(address, handle)
end subroutine problem_read_crystals

!> A table of measurements alone, as `measurements` of a problem; sd_optional: 1 if the column sd_gpa may be absent.
subroutine problem_read_measurements(path, sd_optional, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t, c_loc, c_ptr
   use errors, only: error_type, error_to_status
   use point_tables, only: read_measurements
   use problem, only: problem_type
   implicit none
   !f2py threadsafe
   character(len=*), intent(in) :: path
   integer(c_int), intent(in) :: sd_optional
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error
   type(c_ptr) :: address

   handle = 0
   allocate (self)
   allocate (self%measurements)
   call read_measurements(path, path//': ', sd_optional == 1, self%measurements, error)
   call error_to_status(error, status, message)
   if (status /= 0) then
      deallocate (self)
      return
   end if
   address = c_loc(self)
   handle = transfer(address, handle)
end subroutine problem_read_measurements

!> Release what a handle holds.
subroutine problem_free(handle)
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int64_t, c_null_ptr
   use problem, only: problem_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   type(problem_type), pointer :: self

   call c_f_pointer(transfer(handle, c_null_ptr), self)
   deallocate (self)
end subroutine problem_free

!> Bytes of a text of the problem: 1 the resolved namelist, 2 the warnings, 3 the groups of the file, 4 the stages of `run`;
!> 11, 12, 13 the cells of crystals, measurements, candidates, header first. Lists are separated as `problem_text` says.
subroutine problem_text_length(handle, item, length)
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int, c_int64_t, c_null_ptr
   use problem, only: problem_type
   use problem_texts, only: text_of
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: item
   integer(c_int), intent(out) :: length
   type(problem_type), pointer :: self

   call c_f_pointer(transfer(handle, c_null_ptr), self)
   length = len(text_of(self, item))
end subroutine problem_text_length

!> The text itself. Items end with the byte 31, rows of a table with the byte 30.
subroutine problem_text(handle, item, length, text)
   use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_int64_t, c_null_ptr
   use problem, only: problem_type
   use problem_texts, only: text_of
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: item, length
   character(kind=c_char, len=1), intent(out) :: text(length)
   type(problem_type), pointer :: self
   character(len=:), allocatable :: whole
   integer :: i

   call c_f_pointer(transfer(handle, c_null_ptr), self)
   whole = text_of(self, item)
   do i = 1, length
      text(i) = whole(i:i)
   end do
end subroutine problem_text

!> Rows of table 1 crystals, 2 measurements, 3 candidates; -1 if the file names none.
subroutine problem_table_rows(handle, table, n)
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int, c_int64_t, c_null_ptr
   use problem, only: problem_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: table
   integer(c_int), intent(out) :: n
   type(problem_type), pointer :: self

   call c_f_pointer(transfer(handle, c_null_ptr), self)
   n = -1
   select case (table)
   case (1)
      if (allocated(self%crystals)) n = self%crystals%n
   case (2)
      if (allocated(self%measurements)) n = self%measurements%n
   case default
      if (allocated(self%candidates)) n = self%candidates%n
   end select
end subroutine problem_table_rows

!> Numbers of a table: angles in degrees, GPa, NaN where the table has none. symmetry: the class of each row, twelve
!> characters; blank in measurements, whose constants and stiffness are zero.
subroutine problem_table(handle, table, n, symmetry, constants, stiffness, euler_deg, modulus_gpa, sd_gpa)
   use, intrinsic :: iso_c_binding, only: c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr
   use point_tables, only: points_type
   use problem, only: problem_type
   implicit none
   !f2py threadsafe
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: table, n
   character(len=1), intent(out) :: symmetry(12, n)
   real(c_double), intent(out) :: constants(21, n), stiffness(6, 6, n), euler_deg(3, n), modulus_gpa(n), sd_gpa(n)
   type(problem_type), pointer :: self
   type(points_type), pointer :: points
   integer :: i, j

   call c_f_pointer(transfer(handle, c_null_ptr), self)
   select case (table)
   case (1)
      points => self%crystals
   case (2)
      points => self%measurements
   case default
      points => self%candidates
   end select
   symmetry = ' '
   if (allocated(points%class)) then
      do i = 1, n
         do j = 1, len(points%class(i)%name)
            symmetry(j, i) = points%class(i)%name(j:j)
         end do
      end do
   end if
   constants = 0
   stiffness = 0
   if (allocated(points%constants)) then
      constants = points%constants
      stiffness = points%stiffness
   end if
   euler_deg = points%euler_deg
   modulus_gpa = points%modulus_gpa
   sd_gpa = points%sd_gpa
end subroutine problem_table

!> Bytes of the schema: rows of group, meaning of the group, variable, type, 1 if for each constant, unit, default,
!> allowed, meaning.
subroutine schema_text_length(length)
   use, intrinsic :: iso_c_binding, only: c_int
   use problem_texts, only: schema_rows
   implicit none
   !f2py threadsafe
   integer(c_int), intent(out) :: length

   length = len(schema_rows())
end subroutine schema_text_length

!> The rows, separated as in `problem_text`.
subroutine schema_text(length, text)
   use, intrinsic :: iso_c_binding, only: c_char, c_int
   use problem_texts, only: schema_rows
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: length
   character(kind=c_char, len=1), intent(out) :: text(length)
   character(len=:), allocatable :: whole
   integer :: i

   whole = schema_rows()
   do i = 1, length
      text(i) = whole(i:i)
   end do
end subroutine schema_text
