!> Curves of indentation tests, in a long CSV, and the table that says what was tested.
module curve_tables
   use errors, only: error_type, refuse
   use files, only: checksum, printable, read_text_file
   use kinds, only: wp
   use table_columns, only: find_column
   use tables, only: parse_table, read_table, table_type
   use text, only: lower, to_text
   implicit none
   private
   public :: curve_type, curve_set_type, read_curves

   !> A test: s, nm, mN, and, where the file has it, the contact stiffness, mN/um; (point).
   type :: curve_type
      character(len=:), allocatable :: name, material, session
      !> Whether the material is a reference, or a grain; its number among all.
      logical :: reference = .false.
      !> Its first line in the file of the curves, and its row in the table of tests.
      integer :: line = 0, row = 0
      !> nm/s.
      real(wp) :: drift = 0.0_wp
      real(wp), allocatable :: time(:), depth(:), load(:), stiffness(:)
   end type curve_type

   type :: curve_set_type
      !> The table of tests, whose rows are the curves.
      type(table_type) :: tests
      type(curve_type), allocatable :: curves(:)
      !> Of the file of curves.
      character(len=:), allocatable :: digest
   end type curve_set_type

   !> Beyond this a number is none: instruments write 1.797e308.
   real(wp), parameter :: no_value = 1.0e300_wp
   !> nm/s.
   real(wp), parameter :: largest_drift = 5.0_wp
   character(len=*), parameter :: required(3) = [character(len=8) :: 'time_s', 'depth_nm', 'load_mn']

contains

   !> Read both files, `path` and `tests_path`; `prefix` and `tests_prefix` begin the messages on them.
   subroutine read_curves(path, tests_path, prefix, tests_prefix, set, error)
      character(len=*), intent(in) :: path, tests_path, prefix, tests_prefix
      type(curve_set_type), intent(out) :: set
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table
      character(len=:), allocatable :: content

      call read_table(tests_path, set%tests, error)
      if (.not. allocated(error)) call read_tests(set, error)
      if (allocated(error)) then
         error%message = tests_prefix//error%message
         return
      end if
      call read_text_file(path, content, error)
      if (.not. allocated(error)) then
         set%digest = checksum(content)
         call parse_table(content, table, error)
         deallocate (content)
      end if
      if (.not. allocated(error)) call take_points(table, set, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_curves

   !> What each row of the table of tests says.
   subroutine read_tests(set, error)
      type(curve_set_type), intent(inout) :: set
      type(error_type), allocatable, intent(out) :: error
      integer :: column(5), i, j

      call find_column(set%tests, 'test', column(1), error, needed=.true.)
      if (.not. allocated(error)) call find_column(set%tests, 'grain', column(2), error)
      if (.not. allocated(error)) call find_column(set%tests, 'reference', column(3), error)
      if (.not. allocated(error)) call find_column(set%tests, 'session', column(4), error)
      if (.not. allocated(error)) call find_column(set%tests, 'drift_nm_s', column(5), error)
      if (allocated(error)) return
      allocate (set%curves(set%tests%rows))
      do i = 1, size(set%curves)
         associate (c => set%curves(i))
            c%row = i
            c%name = text_of(column(1), i)
            c%material = text_of(column(2), i)
            c%session = text_of(column(4), i)
            c%reference = len(text_of(column(3), i)) > 0
            if (c%reference .eqv. len(c%material) > 0) then
               call refuse(error, 'line '//to_text(set%tests%line(i))//': test '//printable(c%name)//' has ' &
                  & //trim(merge('both', 'none', c%reference))//' of grain and reference; one of the two columns is needed')
               return
            end if
            if (c%reference) c%material = text_of(column(3), i)
            do j = 1, i - 1
               if (set%curves(j)%name == c%name) call refuse(error, 'line '//to_text(set%tests%line(i))//': test ' &
                  & //printable(c%name)//' is there twice; each test has one row')
            end do
            if (column(5) > 0) then
               if (.not. set%tests%is_empty(column(5), i)) call set%tests%number(column(5), i, c%drift, error)
            end if
            if (allocated(error)) return
            if (abs(c%drift) > largest_drift) call set%tests%refuse(column(5), i, ' nm/s is no drift of an instrument; allowed ' &
               & //'-5 to 5 nm/s', error)
            if (allocated(error)) return
         end associate
      end do

   contains

      function text_of(column, row)
         integer, intent(in) :: column, row
         character(len=:), allocatable :: text_of

         text_of = ''
         if (column > 0) text_of = set%tests%cell(column, row)
      end function text_of
   end subroutine read_tests

   !> Give each test its points; rows with a number that is no value are left out.
   subroutine take_points(table, set, error)
      type(table_type), intent(in) :: table
      type(curve_set_type), intent(inout) :: set
      type(error_type), allocatable, intent(out) :: error
      integer :: column(5), owner(table%rows), filled(size(set%curves)), i, j, k
      real(wp) :: values(4)

      call find_column(table, 'test', column(1), error, needed=.true.)
      do j = 1, 3
         if (.not. allocated(error)) call find_column(table, trim(required(j)), column(1 + j), error, needed=.true.)
      end do
      if (.not. allocated(error)) call find_column(table, 'stiffness_n_m', column(5), error)
      if (.not. allocated(error)) call find_owners(table, column(1), set, owner, error)
      if (allocated(error)) return
      do k = 1, size(set%curves)
         associate (c => set%curves(k), n => count(owner == k))
            allocate (c%time(n), c%depth(n), c%load(n), c%stiffness(merge(n, 0, column(5) > 0)))
         end associate
      end do
      filled = 0
      do i = 1, table%rows
         associate (c => set%curves(owner(i)), n => filled(owner(i)))
            do j = 1, merge(4, 3, column(5) > 0)
               values(j) = number_of(column(1 + j), i)
               if (allocated(error)) then
                  error%message = 'test '//printable(c%name)//', '//error%message
                  return
               end if
            end do
            if (n == 0) c%line = table%line(i)
            if (any(abs(values(:merge(4, 3, column(5) > 0))) > no_value)) cycle
            if (n > 0) then
               if (values(1) < c%time(n)) then
                  call refuse(error, 'test '//printable(c%name)//', line '//to_text(table%line(i))//': the time runs backwards, ' &
                     & //to_text(values(1))//' s after '//to_text(c%time(n))//' s; the points of a test are in the order of time')
                  return
               end if
            end if
            n = n + 1
            c%time(n) = values(1)
            c%depth(n) = values(2)
            c%load(n) = values(3)
            if (column(5) > 0) c%stiffness(n) = 1.0e-3_wp*values(4)
         end associate
      end do
      do k = 1, size(set%curves)
         associate (c => set%curves(k), n => filled(k))
            if (n == 0) then
               call refuse(error, 'test '//printable(c%name)//' of the table of tests has no points')
               return
            end if
            c%time = c%time(:n)
            c%depth = c%depth(:n)
            c%load = c%load(:n)
            if (column(5) > 0) c%stiffness = c%stiffness(:n)
         end associate
      end do

   contains

      !> A number, huge where an instrument says that there is none.
      function number_of(column, row) result(value)
         integer, intent(in) :: column, row
         real(wp) :: value

         call table%number(column, row, value, error)
         if (.not. allocated(error)) return
         if (index(lower(table%cell(column, row)), '1.797') == 0) return
         deallocate (error)
         value = huge(1.0_wp)
      end function number_of
   end subroutine take_points

   !> The curve that each row belongs to.
   subroutine find_owners(table, column, set, owner, error)
      type(table_type), intent(in) :: table
      integer, intent(in) :: column
      type(curve_set_type), intent(in) :: set
      integer, intent(out) :: owner(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: name
      integer :: i, k

      k = 1
      do i = 1, table%rows
         name = table%cell(column, i)
         if (set%curves(k)%name /= name) then
            do k = 1, size(set%curves)
               if (set%curves(k)%name == name) exit
            end do
         end if
         if (k > size(set%curves)) then
            call table%refuse(column, i, ' is no test of the table of tests; each test needs a row there', error)
            return
         end if
         owner(i) = k
      end do
   end subroutine find_owners
end module curve_tables
