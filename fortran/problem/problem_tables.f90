!> The tables that a namelist names, which become the data of its problem.
module problem_tables
   use curve_tables, only: read_curves, read_tests
   use errors, only: error_type, prefix_error, refuse
   use files, only: printable, read_text_file, resolve_path
   use kinds, only: wp
   use layer_table, only: read_layers
   use measurement_checks, only: check_measurements, refuse_radians
   use named_values, only: named_values_reader_type
   use point_tables, only: angles_look_like_radians, points_type, read_crystals, &
      & read_measurements, read_orientations, split_references
   use problem, only: canonical_mark, problem_type
   use repeated_tests, only: combine_tests, refuse_copied_rows
   use settings_checks, only: check_speeds
   use stiffness_table, only: new_stiffness_table
   use table_columns, only: find_column, foreign_column, read_column
   use tables, only: parse_table, read_table, table_type
   use text, only: to_text
   use velocity_tables, only: append_velocities, read_velocities
   implicit none
   private
   public :: load_tables, read_shared_errors, take_curve_results

contains

   !> Read the tables that the groups name, or those that are given as texts.
   subroutine load_tables(problem, given, error)
      type(problem_type), intent(inout) :: problem
      !> Texts of tables that the Python program read, by their names below.
      type(named_values_reader_type), intent(inout) :: given
      type(error_type), allocatable, intent(out) :: error

      associate (s => problem%settings)
         ! Python converts the tables of measurements first, so that they are the first here too.
         if (s%curves%given) call load_curves()
         if (.not. allocated(error)) call load_velocities()
         if (allocated(error)) return
         if (allocated(s%measurements%shared_errors) .and. .not. given%has('measurements')) then
            problem%data%shared_file = resolve_path(problem%run%folder, &
               & s%measurements%shared_errors)
         end if
         call find_text('measurements', s%measurements%file, problem%data%table_text)
         call locate_table(problem, error)
         if (allocated(error)) return
         if (allocated(problem%data%table_text)) then
            call take_measurements(problem, problem%data%table_text, error)
         else if (allocated(problem%data%velocities) .and. .not. s%curves%given) then
            call append_velocities(problem%data%measurements, problem%data%velocities)
            s%measurements%modulus_kind = problem%data%measurements%modulus_kind
         end if
         if (.not. allocated(error)) call load_stiffness()
         call load_grains('measurements', 'texture', s%measurements%texture, problem%data%texture)
         call load_grains('next', 'candidates', s%next%candidates, problem%data%grains)
         if (.not. allocated(error)) call load_crystals(problem, error)
      end associate

   contains

      !> Find the text of a table: as given, or of a file; unallocated if there is neither.
      subroutine find_text(name, file, text)
         character(len=*), intent(in) :: name
         character(len=:), allocatable, intent(in) :: file
         character(len=:), allocatable, intent(out) :: text

         if (given%has(name)) then
            text = given%text(name)
         else if (allocated(file)) then
            call read_text_file(resolve_path(problem%run%folder, file), text, error)
         end if
      end subroutine find_text

      !> Find the table of a variable, without columns if there is none.
      subroutine find_table(name, file, table)
         character(len=*), intent(in) :: name
         character(len=:), allocatable, intent(in) :: file
         type(table_type), intent(out) :: table
         character(len=:), allocatable :: text

         call find_text(name, file, text)
         if (allocated(text) .and. .not. allocated(error)) call parse_table(text, table, error)
      end subroutine find_table

      !> Read curves, and the table of tests that the namelist names.
      subroutine load_curves()
         character(len=:), allocatable :: content

         associate (stated => problem%settings%curves, measured => problem%settings%measurements)
            call find_text('curves', stated%file, content)
            if (allocated(content) .and. .not. allocated(error)) then
               allocate (problem%data%curves)
               call read_tests(resolve_path(problem%run%folder, stated%tests), &
                  & problem%data%curves, error)
               call problem%locate('curves', 'tests', error, stated%tests)
               if (allocated(error)) return
               call read_curves(content, problem%data%curves, error)
            end if
            call problem%locate_curves(error)
            if (allocated(error) .or. allocated(measured%file)) return
            measured%modulus_kind = 'effective_modulus'
            measured%indenter_modulus_gpa = stated%indenter_modulus_gpa
            measured%indenter_nu = stated%indenter_nu
         end associate
      end subroutine load_curves

      !> Set the known stiffness.
      subroutine load_stiffness()
         character(len=:), allocatable :: content

         associate (stated => problem%settings%knowledge)
            call find_text('stiffness', stated%stiffness_file, content)
            if (allocated(content) .and. .not. allocated(error)) then
               allocate (problem%data%stiffness)
               if (allocated(stated%stiffness_relative_sd) .and. .not. given%has('stiffness')) then
                  call refuse(error, 'a matrix is read by bayesindent, not by bayesindent-batch, ' &
                     & //'which needs the table of means and covariance')
               else
                  call new_stiffness_table(content, problem%class, problem%data%stiffness, error)
               end if
            end if
            call problem%locate('knowledge', 'stiffness_file', error, stated%stiffness_file)
         end associate
      end subroutine load_stiffness

      !> Set the speeds.
      subroutine load_velocities()
         type(table_type) :: table

         call find_table('velocities', problem%settings%measurements%velocities, table)
         if (.not. allocated(error) .and. table%columns > 0) then
            allocate (problem%data%velocities)
            call check_speeds(problem%settings, .true., error)
            call read_velocities(table, in_radians(problem), problem%data%velocities, error)
            if (.not. in_radians(problem)) call refuse_radians(problem%data%velocities, error)
         end if
         call problem%locate('measurements', 'velocities', error)
      end subroutine load_velocities

      !> Read the grains of a variable, if it is stated and no error was met.
      subroutine load_grains(group, name, file, grains)
         character(len=*), intent(in) :: group, name
         character(len=:), allocatable, intent(in) :: file
         type(points_type), allocatable, intent(out) :: grains

         if (allocated(error) .or. .not. allocated(file)) return
         allocate (grains)
         call find_table(name, file, grains%table)
         if (.not. allocated(error)) call read_grains(problem, grains, error)
         call problem%locate(group, name, error, file)
      end subroutine load_grains
   end subroutine load_tables

   !> Whether the angles of tables are stated in radians.
   pure logical function in_radians(problem)
      type(problem_type), intent(in) :: problem

      in_radians = problem%settings%measurements%angles == 'radians'
   end function in_radians

   !> Read the layers, and the tables of crystals: those to simulate, references, and the candidates
   !> of &design, which must be of the symmetry of &problem.
   subroutine load_crystals(problem, error)
      type(problem_type), intent(inout) :: problem
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      associate (s => problem%settings)
         if (allocated(s%specimen%layers)) then
            allocate (problem%data%layers)
            call read_layers(resolve_path(problem%run%folder, s%specimen%layers), &
               & problem%data%layers, error)
            call problem%locate('specimen', 'layers', error, s%specimen%layers)
            if (allocated(error)) return
         end if
         if (allocated(s%crystals%points)) then
            call read_file('crystals', 'points', s%crystals%points, problem%data%crystals)
            if (allocated(error)) return
            if (angles_look_like_radians(problem%data%crystals)) then
               call problem%warn('angles_like_radians', &
                  & 'the table '//printable(s%crystals%points))
            end if
         end if
         if (allocated(s%references%crystals)) then
            call read_file('references', 'crystals', s%references%crystals, problem%data%references)
            if (allocated(error)) return
            call find_column(problem%data%references%table, 'reference', &
               & problem%data%references%named_by, error, .true.)
            if (allocated(error)) return
         end if
         if (any(['latin    ', 'factorial'] == s%design%candidates)) return
         call read_file('design', 'candidates', s%design%candidates, problem%data%candidates)
      end associate
      if (allocated(error) .or. .not. allocated(problem%class%name)) return
      associate (points => problem%data%candidates)
         i = findloc([(points%classes(points%class(i))%name == problem%class%name, &
            & i=1, points%n)], .false., 1)
         if (i > 0) then
            call refuse(error, 'line '//to_text(points%table%line(i)) &
               & //': the crystal is not of the symmetry of &problem')
            call problem%locate('design', 'candidates', error, problem%settings%design%candidates)
         end if
      end associate

   contains

      !> Read crystals from the file of a variable.
      subroutine read_file(group, name, file, crystals)
         character(len=*), intent(in) :: group, name, file
         type(points_type), allocatable, intent(out) :: crystals

         allocate (crystals)
         call read_crystals(resolve_path(problem%run%folder, file), problem%class, crystals, error)
         call problem%locate(group, name, error, file)
      end subroutine read_file
   end subroutine load_crystals

   !> Read the orientations and names of grains from their table.
   subroutine read_grains(problem, grains, error)
      type(problem_type), intent(in) :: problem
      type(points_type), intent(inout) :: grains
      type(error_type), allocatable, intent(out) :: error
      !> Bound of the memory for the moduli of each grain at 2000 draws.
      integer, parameter :: most_grains = 2000

      call read_orientations(grains, in_radians(problem), problem%class, &
         & problem%settings%problem%lattice, error)
      if (allocated(error)) return
      call find_column(grains%table, 'grain', grains%named_by, error, .false.)
      if (allocated(error)) return
      if (grains%n > most_grains) then
         call refuse(error, to_text(grains%n)//' grains; allowed up to '//to_text(most_grains))
      else if (.not. in_radians(problem)) then
         call refuse_radians(grains, error)
      end if
   end subroutine read_grains

   !> Read the measurements that were inferred from curves, unless the file names others.
   subroutine take_curve_results(problem, folder, error)
      type(problem_type), intent(inout) :: problem
      !> Folder of the results, with a slash.
      character(len=*), intent(in) :: folder
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content

      if (.not. problem%settings%curves%given .or. allocated(problem%settings%measurements%file) &
         & .or. allocated(problem%data%measurements)) then
         return
      end if
      problem%data%shared_file = folder//'shared_errors.csv'
      call read_text_file(folder//'measurements.csv', content, error)
      call prefix_error(error, folder//'measurements.csv, which the command curves writes: ')
      call locate_table(problem, error)
      if (.not. allocated(error)) call take_measurements(problem, content, error)
   end subroutine take_curve_results

   !> Set the measurements. The tests of a grain become one measurement.
   subroutine take_measurements(problem, content, error)
      type(problem_type), intent(inout) :: problem
      !> CSV, a canonical table.
      character(len=*), intent(in) :: content
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table
      type(points_type) :: measurements
      real(wp), allocatable :: weight(:)
      character(len=:), allocatable :: name
      logical :: radians
      integer :: column, i

      ! Tables that this program wrote are in degrees; those of curves have the unit of tests.
      radians = in_radians(problem) .and. index(content, canonical_mark) /= 1
      call parse_table(content, table, error)
      if (allocated(problem%settings%measurements%file) .and. .not. allocated(error)) then
         column = foreign_column(table)
         name = ''
         if (column > 0) name = printable(table%name(column))
         if (index(name, 'other_') == 1) then
            call refuse(error, 'the column '//name//' is not allowed; leave out the rows with ' &
               & //'other_probability above 0.05, and the columns other_*')
         else if (column > 0 .and. table%columns > 1) then
            call problem%refuse_table(' has the column '''//name//'''', error)
         else if (radians) then
            call problem%refuse_table(' has angles in radians', error)
         end if
      end if
      if (.not. allocated(error)) call read_tests()
      call locate_table(problem, error)
      if (allocated(error)) return
      problem%data%measurements = measurements
      if (allocated(measurements%tests) .and. allocated(problem%data%shared_errors)) then
         do i = 1, measurements%n
            ! The tests of a grain have the weights that they have for its modulus.
            associate (weights => merge(weight, 0.0_wp, measurements%of_row == i))
               problem%data%shared_errors(measurements%row(i), :) &
                  & = matmul(weights, problem%data%shared_errors)/sum(weights)
            end associate
         end do
      end if
      problem%settings%measurements%modulus_kind = measurements%modulus_kind
      call check_measurements(problem, error)
      call locate_table(problem, error)
      if (allocated(problem%data%velocities)) then
         call append_velocities(problem%data%measurements, problem%data%velocities)
      end if

   contains

      !> Read the tests of the grains and their shared errors, and combine the tests of a grain.
      subroutine read_tests()
         associate (stated => problem%settings%measurements)
            call split_references(table, radians, stated, problem%class, &
               & problem%settings%problem%lattice, problem%data%reference_grains, error)
            if (allocated(error)) return
            call read_measurements(table, radians, stated, problem%class, &
               & problem%settings%problem%lattice, measurements, error)
            if (allocated(error)) return
            if (stated%misalignment_sd_deg > 0.0_wp .and. .not. measurements%has_angles) then
               call refuse(error, 'misalignment_sd_deg = '//to_text(stated%misalignment_sd_deg) &
                  & //' needs Euler angles: directions alone do not say how a turn of the sample ' &
                  & //'moves them. Or state orientation_sd_deg')
               return
            end if
         end associate
         call take_shared_errors()
         if (.not. allocated(error)) call take_nu()
         if (.not. allocated(error)) call refuse_copied_rows(measurements, error)
         if (allocated(error)) return
         weight = 1.0_wp/measurements%sd_gpa**2
         call combine_tests(problem%class, measurements, error)
      end subroutine read_tests

      !> Use the Poisson's ratio with which the instrument made the moduli of the table, if it has
      !> a column of it.
      subroutine take_nu()
         real(wp), parameter :: tolerance = 1.0e-6_wp
         real(wp), allocatable :: nu(:)

         if (measurements%modulus_kind /= 'sample_modulus') return
         call read_column(table, 'sample_nu', table%find('sample_nu') == 0, nu, error)
         if (allocated(error)) return
         if (.not. nu(1) > -1.0_wp) return
         associate (stated => problem%settings%measurements%sample_nu)
            if (.not. problem%states_nu) stated = nu(1)
            i = maxloc(abs(nu - stated), 1)
            if (abs(nu(i) - stated) <= tolerance) return
            call refuse(error, 'the columns and &measurements state sample_nu = ' &
               & //to_text(stated)//' and '//to_text(nu(i))//'; one value is allowed')
         end associate
      end subroutine take_nu

      !> Set the relative errors that the rows of the measurements share.
      subroutine take_shared_errors()
         type(table_type) :: source
         real(wp), allocatable :: values(:, :)

         source = table
         call read_shared_errors(problem%data%shared_file, table%rows, source, values, error)
         if (allocated(error)) return
         if (size(values) == 0) return
         problem%data%shared_errors = transpose(values)
         problem%data%shared_digest = source%digest()
         ! They contain the error of the indenter.
         if (.not. problem%states_calibration) problem%settings%measurements%calibration_sd = 0.0_wp
         if (allocated(problem%data%reference_grains)) then
            call refuse(error, 'rows with a reference are not allowed beside shared errors')
         end if
      end subroutine take_shared_errors
   end subroutine take_measurements

   !> Read relative errors that rows share, such as the calibration of the instrument: all columns
   !> of a file but that of the grains, or the columns shared_1, shared_2, .. of a table.
   subroutine read_shared_errors(path, rows, table, values, error)
      !> Unallocated: the errors are those of the `table`, which is that of the file otherwise.
      character(len=:), allocatable, intent(in) :: path
      !> Rows of the measurements.
      integer, intent(in) :: rows
      type(table_type), intent(inout) :: table
      !> (error, row).
      real(wp), allocatable, intent(out) :: values(:, :)
      type(error_type), allocatable, intent(out) :: error
      integer :: j

      if (allocated(path)) call read_table(path, table, error)
      if (.not. allocated(error) .and. table%rows /= rows) then
         call refuse(error, to_text(table%rows)//' rows for '//to_text(rows) &
            & //' of the measurements; each row has the errors of one of them')
      end if
      if (.not. allocated(error)) then
         call table%numbers(pack([(j, j=1, table%columns)], [(index(table%name(j), 'shared_') == 1 &
            & .or. (allocated(path) .and. table%name(j) /= 'grain'), j=1, table%columns)]), &
            & values, error)
      end if
      if (allocated(path)) call prefix_error(error, 'shared_errors: '//printable(path)//': ')
   end subroutine read_shared_errors

   !> Say that an error is in the table of the measurements.
   subroutine locate_table(problem, error)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(inout) :: error

      call problem%locate('measurements', &
         & trim(merge('file', '    ', allocated(problem%settings%measurements%file))), error, &
         & problem%settings%measurements%file)
   end subroutine locate_table
end module problem_tables
