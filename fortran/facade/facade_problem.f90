! Problems for Python, under handles of the kind 'problem'.

!> The problem of the namelist file `path` for a `command`, a stage or 'run'; or without a command that of a namelist's text, `content`,
!> made of keywords of the Python function `path`. handle: 0 if refused.
subroutine problem_new(path, command, content, handle, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use object_registry, only: keep_object
   use problem, only: problem_type
   use problem_input, only: problem_of_text, read_problem
   implicit none
   character(len=*), intent(in) :: path, command, content
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   allocate (self)
   if (len(command) > 0) then
      call read_problem(path, command, self, error)
   else
      call problem_of_text(path, content, self, error)
   end if
   call keep_object(self, 'problem', error, handle)
   call error_to_status(error, status, message)
end subroutine problem_new

!> The `crystals` of a table alone, which has no settings; symmetry: of the rows that do not say theirs.
subroutine problem_of_table(path, symmetry, handle, status, message)
   use crystal_class, only: crystal_class_type, new_crystal_class
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use point_tables, only: read_crystals
   use object_registry, only: keep_object
   use problem, only: problem_type
   implicit none
   character(len=*), intent(in) :: path, symmetry
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error

   allocate (self)
   allocate (self%crystals)
   call new_crystal_class(symmetry, class, error)
   if (.not. allocated(error)) call read_crystals(path, path//': ', class, self%crystals, error)
   call keep_object(self, 'problem', error, handle)
   call error_to_status(error, status, message)
end subroutine problem_of_table

!> A table of a problem that is no file, 'measurements' or 'stiffness': a page of CSV, in UTF-8.
subroutine problem_set_table(handle, table, page, status, message)
   use interoperation, only: c_int, c_int64_t, error_to_status, error_type
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: table, page
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   call problem_of_handle(handle, self, error)
   if (.not. allocated(error)) call self%set_table(table, page, error)
   call error_to_status(error, status, message)
end subroutine problem_set_table

!> Write the crystals of a problem, n of them, as the table that they came from with m columns of numbers: `names`, separated by
!> commas, and `values`.
subroutine problem_write_crystals(handle, path, names, n, m, values, status, message)
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use tables, only: write_table
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: path, names
   integer(c_int), intent(in) :: n, m
   real(c_double), intent(in) :: values(n, m)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   call problem_of_handle(handle, self, error)
   if (.not. allocated(error)) call write_table(self%crystals%table, path, names, values, error)
   call error_to_status(error, status, message)
end subroutine problem_write_crystals
