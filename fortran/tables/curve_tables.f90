!> Curves of indentation tests, all in one CSV, and the table of the tests.
module curve_tables
   use errors, only: error_type, refuse
   use files, only: checksum, printable
   use kinds, only: wp
   use table_columns, only: find_columns, read_column
   use tables, only: parse_table, read_table, table_type
   use text, only: to_text
   implicit none
   private
   public :: curve_type, curve_set_type, read_curves, read_tests

   !> A test with its curve.
   type :: curve_type
      character(len=:), allocatable :: name, material, session
      !> Whether the material is a reference; it is a grain otherwise.
      logical :: reference = .false.
      !> First line of the test in the file of the curves.
      integer :: line = 0
      !> Drift of the instrument, nm/s.
      real(wp) :: drift = 0.0_wp
      !> Time, s, depth, nm, load, mN, and, if the file has it, contact stiffness, N/m; (quantity,
      !> point).
      real(wp), allocatable :: points(:, :)
   end type curve_type

   type :: curve_set_type
      !> Table of the tests; each row is a curve.
      type(table_type) :: tests
      type(curve_type), allocatable :: curves(:)
      !> Checksum of the file of curves.
      character(len=:), allocatable :: digest
   end type curve_set_type

   !> Larger numbers are missing values: instruments write 1.797e308.
   real(wp), parameter :: no_value = 1.0e300_wp
   character(len=*), parameter :: of_tests = 'test, grain, reference, session', &
      & of_curves = 'test, time_s, depth_nm, load_mn, stiffness_n_m'

contains

   !> Read the table of the tests.
   subroutine read_tests(path, set, error)
      character(len=*), intent(in) :: path
      type(curve_set_type), intent(out) :: set
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: column(:)
      real(wp), allocatable :: drift(:)
      character(len=:), allocatable :: reference, place
      integer :: i, j

      call read_table(path, set%tests, error)
      call find_columns(set%tests, of_tests, 1, column, error)
      if (allocated(error)) return
      allocate (set%curves(set%tests%rows))
      do i = 1, size(set%curves)
         associate (c => set%curves(i))
            c%name = set%tests%cell(column(1), i)
            c%material = set%tests%cell(column(2), i)
            reference = set%tests%cell(column(3), i)
            c%session = set%tests%cell(column(4), i)
            c%reference = len(reference) > 0
            place = 'line '//to_text(set%tests%line(i))//': test '//printable(c%name)
            if (c%reference .eqv. len(c%material) > 0) then
               call refuse(error, place//' has '//trim(merge('both', 'none', c%reference)) &
                  & //' of grain and reference; one of the two columns is needed')
            end if
            if (any([(set%curves(j)%name == c%name, j=1, i - 1)])) then
               call refuse(error, place//' is there twice; each test has one row')
            end if
            if (allocated(error)) return
            if (c%reference) c%material = reference
         end associate
      end do
      call read_column(set%tests, 'drift_nm_s', .true., drift, error)
      if (.not. allocated(error)) set%curves%drift = merge(drift, 0.0_wp, abs(drift) >= 0.0_wp)
   end subroutine read_tests

   !> Read the curves of tests that are known.
   subroutine read_curves(content, set, error)
      !> CSV.
      character(len=*), intent(in) :: content
      type(curve_set_type), intent(inout) :: set
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table

      set%digest = checksum(content)
      call parse_table(content, table, error)
      if (.not. allocated(error)) call take_points()

   contains

      !> Set the points of each test; rows with missing values are left out.
      subroutine take_points()
         integer, allocatable :: column(:), rows(:)
         integer :: owner(table%rows), i, j, k
         real(wp), allocatable :: values(:, :)

         call find_columns(table, of_curves, 4, column, error)
         if (allocated(error)) return
         column = pack(column, column > 0)
         allocate (values(size(column) - 1, table%rows))
         k = 1
         do i = 1, table%rows
            if (set%curves(k)%name /= table%cell(column(1), i)) then
               k = findloc([(set%curves(j)%name == table%cell(column(1), i), &
                  & j=1, size(set%curves))], .true., 1)
            end if
            if (k == 0) then
               call table%refuse(column(1), i, &
                  & ' is no test of the table of tests; each test needs a row there', error)
               return
            end if
            owner(i) = k
            do j = 2, size(column)
               call table%number(column(j), i, values(j - 1, i), error)
               if (.not. allocated(error)) cycle
               error%message = 'test '//printable(set%curves(k)%name)//', '//error%message
               ! Rounded by an instrument, the largest number may be too large to be read.
               if (index(table%cell(column(j), i), '1.797') == 0) return
               deallocate (error)
               values(j - 1, i) = huge(1.0_wp)
            end do
         end do
         do k = 1, size(set%curves)
            associate (c => set%curves(k), place => 'test '//printable(set%curves(k)%name))
               c%line = table%line(max(1, findloc(owner, k, 1)))
               rows = pack([(i, i=1, table%rows)], owner == k .and. all(abs(values) < no_value, 1))
               c%points = values(:, rows)
               i = findloc(c%points(1, 2:) < c%points(1, :size(rows) - 1), .true., 1)
               if (size(rows) == 0) then
                  call refuse(error, place//' of the table of tests has no points; give them, or ' &
                     & //'leave its row out')
                  return
               else if (i > 0) then
                  call refuse(error, place//', line '//to_text(table%line(rows(i + 1))) &
                     & //': the time runs backwards, '//to_text(c%points(1, i + 1))//' s after ' &
                     & //to_text(c%points(1, i))//' s; the points of a test are in the order of ' &
                     & //'time')
                  return
               else if (.not. any(c%points(1, 2:) > c%points(1, 1))) then
                  call refuse(error, place//': all times are equal, so no drift can be corrected')
                  return
               end if
            end associate
         end do
      end subroutine take_points
   end subroutine read_curves
end module curve_tables
