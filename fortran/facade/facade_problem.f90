! Problems for Python, under handles of the kind 'problem'.

!> Read the namelist file `path` for a `command`: a stage, or 'run'. handle: 0 if refused.
subroutine problem_read(path, command, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use problem, only: problem_type
   use problem_handles, only: register_problem
   use problem_input, only: read_problem
   implicit none
   character(len=*), intent(in) :: path, command
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   allocate (self)
   call read_problem(path, command, self, error)
   call register_problem(self, error, handle)
   call error_to_status(error, status, message)
end subroutine problem_read

!> The problem of a namelist's text, `content`, made of keywords of the Python function `origin`. handle: 0 if refused.
subroutine problem_from_text(origin, content, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use problem, only: problem_type
   use problem_handles, only: register_problem
   use problem_input, only: problem_of_text
   implicit none
   character(len=*), intent(in) :: origin, content
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   allocate (self)
   call problem_of_text(origin, content, self, error)
   call register_problem(self, error, handle)
   call error_to_status(error, status, message)
end subroutine problem_from_text

!> A table alone, as `crystals` (symmetry: of the rows that do not say theirs) or, if symmetry is blank, `measurements` of a
!> problem; sd_optional: 1 if the column sd_gpa may be absent.
subroutine problem_of_table(path, symmetry, sd_optional, handle, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, error_to_status
   use point_tables, only: read_crystals, read_measurements
   use problem, only: problem_type
   use problem_handles, only: register_problem
   implicit none
   character(len=*), intent(in) :: path, symmetry
   integer(c_int), intent(in) :: sd_optional
   integer(c_int64_t), intent(out) :: handle
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error

   allocate (self)
   if (len_trim(symmetry) > 0) then
      allocate (self%crystals)
      call new_crystal_class(symmetry, class, error)
      if (.not. allocated(error)) call read_crystals(path, path//': ', class, self%crystals, error)
   else
      allocate (self%measurements)
      call read_measurements(path, path//': ', sd_optional == 1, self%measurements, error)
   end if
   call register_problem(self, error, handle)
   call error_to_status(error, status, message)
end subroutine problem_of_table

!> The measurements of a problem that come as arrays: euler_deg in degrees, modulus_gpa and sd_gpa; n_sd is n, or 0 if the sds are
!> to be inferred.
subroutine problem_set_measurements(handle, n, n_sd, euler_deg, modulus_gpa, sd_gpa, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: n, n_sd
   real(c_double), intent(in) :: euler_deg(3, n), modulus_gpa(n), sd_gpa(n_sd)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(problem_type), pointer :: self
   type(error_type), allocatable :: error

   call problem_of_handle(handle, self, error)
   if (.not. allocated(error)) call self%set_measurements(euler_deg, modulus_gpa, sd_gpa, error)
   call error_to_status(error, status, message)
end subroutine problem_set_measurements

!> `length` in bytes of the text number `item`: see `problem_texts`; handle 0: of the texts without a problem.
subroutine problem_text_length(handle, item, length, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use problem_handles, only: text_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: item
   integer(c_int), intent(out) :: length, status
   character(len=4096), intent(out) :: message
   character(len=:), allocatable :: whole
   type(error_type), allocatable :: error

   call text_of_handle(handle, item, whole, error)
   call error_to_status(error, status, message)
   length = len(whole)
end subroutine problem_text_length

!> The text number `item` itself, `length` bytes. Items end with the byte 31, rows of a table with the byte 30.
subroutine problem_text(handle, item, length, text, status, message)
   use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use problem_handles, only: text_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: item, length
   character(kind=c_char, len=1), intent(out) :: text(length)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   character(len=:), allocatable :: whole
   type(error_type), allocatable :: error
   integer :: i

   call text_of_handle(handle, item, whole, error)
   call error_to_status(error, status, message)
   do i = 1, min(length, len(whole))
      text(i) = whole(i:i)
   end do
end subroutine problem_text

!> The number n of rows of table 1 crystals, 2 measurements, 3 candidates; -1 if the file names none.
subroutine problem_table_rows(handle, table, n, status, message)
   use, intrinsic :: iso_c_binding, only: c_int, c_int64_t
   use errors, only: error_type, error_to_status
   use point_tables, only: points_type
   use problem_handles, only: table_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: table
   integer(c_int), intent(out) :: n, status
   character(len=4096), intent(out) :: message
   type(points_type), pointer :: points
   type(error_type), allocatable :: error

   call table_of_handle(handle, table, points, error)
   call error_to_status(error, status, message)
   n = -1
   if (associated(points)) n = points%n
end subroutine problem_table_rows

!> Numbers of a table of n rows: angles in degrees, constants, stiffness, modulus_gpa and sd_gpa in GPa, NaN where the table has
!> none. symmetry: the class of each row, twelve characters; blank in measurements, whose constants and stiffness are zero.
subroutine problem_table(handle, table, n, symmetry, constants, stiffness, euler_deg, modulus_gpa, sd_gpa)
   use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
   use errors, only: error_type
   use point_tables, only: points_type
   use problem_handles, only: table_of_handle
   implicit none
   integer(c_int64_t), intent(in) :: handle
   integer(c_int), intent(in) :: table, n
   character(len=1), intent(out) :: symmetry(12, n)
   real(c_double), intent(out) :: constants(21, n), stiffness(6, 6, n), euler_deg(3, n), modulus_gpa(n), sd_gpa(n)
   type(points_type), pointer :: points
   type(error_type), allocatable :: error
   integer :: i, j

   symmetry = ' '
   constants = 0
   stiffness = 0
   call table_of_handle(handle, table, points, error)
   if (.not. associated(points)) return
   if (allocated(points%class)) then
      do i = 1, n
         do j = 1, len(points%class(i)%name)
            symmetry(j, i) = points%class(i)%name(j:j)
         end do
      end do
   end if
   if (allocated(points%constants)) then
      constants = points%constants
      stiffness = points%stiffness
   end if
   euler_deg = points%euler_deg
   modulus_gpa = points%modulus_gpa
   sd_gpa = points%sd_gpa
end subroutine problem_table
