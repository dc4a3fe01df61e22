!> A problem: a checked namelist in which every variable has a value, and the tables that it names.
!>
!> Both programs, and the keywords of Python, make their problems here, so that they report the same
!> errors. A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
module problem
   use crystal_class, only: crystal_class_type, lattice_type, new_crystal_class, new_lattice
   use curve_tables, only: curve_set_type, read_curves, read_tests
   use diagnostics, only: diagnostic, diagnostic_type
   use errors, only: error_type, locate_error, prefix_error, refuse
   use files, only: folder_of, printable, read_text_file, resolve_path
   use kinds, only: wp
   use layer_table, only: layer_table_type, read_layers
   use machine, only: thread_count
   use named_values, only: named_values_reader_type
   use namelist_file, only: entry_type, find_entry
   use measurement_checks, only: check_measurements, refuse_radians
   use point_tables, only: angles_look_like_radians, points_type, read_crystals, &
      & read_measurements, read_orientations, split_references
   use repeated_tests, only: combine_tests, refuse_copied_rows
   use settings_schema, only: settings_type
   use settings_checks, only: check_settings
   use settings_reader, only: read_settings
   use space_groups, only: laue_class
   use stiffness_table, only: new_stiffness_table, stiffness_table_type
   use table_columns, only: find_column, foreign_column, read_column
   use techniques, only: set_technique
   use tables, only: parse_table, read_table, table_type
   use velocity_tables, only: append_velocities, read_velocities
   use text, only: newline, to_text
   implicit none
   private
   public :: problem_type, new_problem, read_shared_errors, table_name, canonical_mark

   type :: problem_type
      !> Path as the user wrote it, or the Python function of the keywords; folder of the file with
      !> a slash, or ''.
      character(len=:), allocatable :: path, folder
      !> Command that reads the file, '' for keywords; groups that the command needs, and groups of
      !> the file, separated by blanks.
      character(len=:), allocatable :: command, needed, groups
      !> Stages that the file requests, in order.
      character(len=8), allocatable :: stages(:)
      type(settings_type) :: settings
      !> Class of &problem symmetry.
      type(crystal_class_type) :: class
      type(diagnostic_type), allocatable :: warnings(:)
      !> Tables that the file names, unallocated if it does not; `velocities` are the speeds as they
      !> were read, and are among the measurements too.
      type(points_type), allocatable :: crystals, measurements, velocities, candidates
      !> Whether the file states &measurements sample_nu, technique and calibration_sd.
      logical :: states_nu = .false., states_technique = .false., states_calibration = .false.
      !> Whether speeds of waves that cannot be detected were left out of the measurements.
      logical :: are_detected = .false.
      !> Grains from which &next chooses; unallocated: all directions.
      type(points_type), allocatable :: grains
      !> Possible orientations of grains of unknown orientation; unallocated: all.
      type(points_type), allocatable :: texture
      !> Text of the canonical table of the measurements, which the folder of results gets.
      character(len=:), allocatable :: table_text
      !> Indented directions in crystal axes for each mistake of the axes of the map, (3,
      !> measurement, mistake); see `order_rivals`.
      real(wp), allocatable :: misread(:, :, :)
      !> Curves of &curves, and crystals of &references.
      type(curve_set_type), allocatable :: curves
      type(points_type), allocatable :: references
      !> Rows of the measurements that are of references, which their names name.
      type(points_type), allocatable :: reference_grains
      !> Relative errors that measurements share: columns of sd 1, (row of the table, error);
      !> unallocated: none.
      real(wp), allocatable :: shared_errors(:, :)
      !> File of the shared errors, unallocated: the table of the measurements; and its checksum.
      character(len=:), allocatable :: shared_file, shared_digest
      !> Why a file of shared errors that Python has read is refused.
      character(len=:), allocatable :: shared_refusal
      !> Stiffness of &knowledge.
      type(stiffness_table_type), allocatable :: stiffness
      !> Layers of &specimen.
      type(layer_table_type), allocatable :: layers
      !> Folder, without its last slash, for finished chains until Step 2 is done; unallocated: they
      !> are not stored.
      character(len=:), allocatable :: kept_in
      !> Whether the batch program has it, which writes the table of draws unless told otherwise.
      logical :: is_of_batch = .false.
   contains
      procedure :: load_tables, locate, locate_curves, refuse => refuse_variable, &
         & refuse_table, take_curve_results, threads
   end type problem_type

   !> Name of the canonical table of the measurements in a folder of results.
   character(len=*), parameter :: table_name = 'table.csv'
   !> The beginning of canonical tables that this program wrote.
   character(len=*), parameter :: canonical_mark = '# Canonical table of bayesindent'
   !> Contact radius of the paper's indentations at the last depth, um.
   real(wp), parameter :: paper_contact = 0.5_wp

contains

   !> Make the problem of a parsed namelist, without the tables that it names.
   subroutine new_problem(path, namelist, command, needed, self, error)
      !> The file, or the origin of keywords.
      character(len=*), intent(in) :: path
      type(entry_type), intent(in) :: namelist(:)
      !> See `problem_type`.
      character(len=*), intent(in) :: command, needed
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      type(entry_type) :: parsed(size(namelist))
      type(lattice_type) :: lattice
      integer :: i

      self%path = path
      self%folder = folder_of(path)
      self%command = command
      self%needed = needed
      allocate (self%stages(0))
      self%groups = ''
      do i = 1, size(namelist)
         if (len(namelist(i)%name) == 0) self%groups = self%groups//namelist(i)%group//' '
      end do
      allocate (self%warnings(0))
      self%states_nu = find_entry(namelist, 'measurements', 'sample_nu') > 0
      self%states_technique = find_entry(namelist, 'measurements', 'technique') > 0
      self%states_calibration = find_entry(namelist, 'measurements', 'calibration_sd') > 0
      parsed = namelist
      i = find_entry(parsed, 'problem', 'symmetry')
      if (i > 0) then
         if (size(parsed(i)%values) == 1) call name_class(parsed(i)%values(1)%text)
      end if
      call read_settings(parsed, command, needed, self%settings, error)
      if (allocated(error)) return
      associate (s => self%settings, last => self%settings%indenter)
         if (len(s%surrogate%file) == 0) then
            s%surrogate%file = trim(merge('surrogate.txt', 'halfspace    ', &
               & s%design%given .or. s%domain%given .or. s%specimen%geometry == 'film'))
         end if
         call set_technique(s%measurements, s%problem%synthetic)
         if (.not. (allocated(last%depth_um) .or. allocated(last%contact_radius_um))) then
            last%contact_radius_um = paper_contact
         end if
      end associate
      if (allocated(self%settings%problem%symmetry)) then
         call new_crystal_class(self%settings%problem%symmetry, self%class, error)
         ! Replace synonyms by the name of the class.
         if (.not. allocated(error)) self%settings%problem%symmetry = self%class%name
         if (allocated(self%settings%problem%lattice) .and. .not. allocated(error)) then
            call new_lattice(self%class, self%settings%problem%lattice, lattice, error)
            call self%locate('problem', 'lattice', error)
         end if
      end if
      if (allocated(error)) return
      call check_settings(self%settings, self%class, error)
      if (allocated(error)) return
      if (len(self%settings%specimen%estimator) == 0) self%settings%specimen%estimator = 'curve'
   end subroutine new_problem

   !> Replace a space group by its Laue class.
   pure subroutine name_class(word)
      character(len=:), allocatable, intent(inout) :: word

      if (len(laue_class(word)) > 0) word = laue_class(word)
   end subroutine name_class

   !> Read the tables that the groups name, or those that are given as texts.
   subroutine load_tables(self, given, error)
      class(problem_type), intent(inout) :: self
      !> Texts of tables that the Python program read, by their names below.
      type(named_values_reader_type), intent(inout) :: given
      type(error_type), allocatable, intent(out) :: error
      logical :: radians

      radians = self%settings%measurements%angles == 'radians'
      associate (s => self%settings)
         ! Python converts the tables of measurements first, so that they are the first here too.
         if (s%curves%given) call load_curves()
         if (.not. allocated(error)) call load_velocities()
         if (allocated(error)) return
         if (allocated(s%measurements%shared_errors) .and. .not. given%has('measurements')) then
            self%shared_file = resolve_path(self%folder, s%measurements%shared_errors)
         end if
         if (given%has('shared_refusal')) self%shared_refusal = given%text('shared_refusal')
         call find_text('measurements', s%measurements%file, self%table_text)
         call locate_table(self, error)
         if (allocated(error)) return
         if (allocated(self%table_text)) then
            call take_measurements(self, self%table_text, error)
         else if (allocated(self%velocities) .and. .not. s%curves%given) then
            call append_velocities(self%measurements, self%velocities)
            s%measurements%modulus_kind = self%measurements%modulus_kind
         end if
         if (.not. allocated(error)) call load_stiffness()
         if (allocated(error)) return
         call load_grains('measurements', 'texture', s%measurements%texture, self%texture)
         if (allocated(error)) return
         call load_grains('next', 'candidates', s%next%candidates, self%grains)
         if (.not. allocated(error)) call load_crystals(self, error)
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
            call read_text_file(resolve_path(self%folder, file), text, error)
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

         associate (stated => self%settings%curves, measured => self%settings%measurements)
            call find_text('curves', stated%file, content)
            if (allocated(content) .and. .not. allocated(error)) then
               allocate (self%curves)
               call read_tests(resolve_path(self%folder, stated%tests), self%curves, error)
               call self%locate('curves', 'tests', error, stated%tests)
               if (allocated(error)) return
               call read_curves(content, self%curves, error)
            end if
            call self%locate_curves(error)
            if (allocated(error) .or. allocated(measured%file)) return
            measured%modulus_kind = 'effective_modulus'
            measured%indenter_modulus_gpa = stated%indenter_modulus_gpa
            measured%indenter_nu = stated%indenter_nu
         end associate
      end subroutine load_curves

      !> Set the known stiffness.
      subroutine load_stiffness()
         character(len=:), allocatable :: content

         associate (stated => self%settings%knowledge)
            call find_text('stiffness', stated%stiffness_file, content)
            if (allocated(content) .and. .not. allocated(error)) then
               allocate (self%stiffness)
               call new_stiffness_table(content, stated%stiffness_relative_sd, self%class, &
                  & self%stiffness, error)
            end if
            call self%locate('knowledge', 'stiffness_file', error, stated%stiffness_file)
         end associate
      end subroutine load_stiffness

      !> Set the speeds.
      subroutine load_velocities()
         type(table_type) :: table

         call find_table('velocities', self%settings%measurements%velocities, table)
         if (.not. allocated(error) .and. table%columns > 0) then
            allocate (self%velocities)
            call read_velocities(table, radians, self%velocities, error)
            if (.not. (allocated(error) .or. radians)) call refuse_radians(self%velocities, error)
         end if
         call self%locate('measurements', 'velocities', error)
      end subroutine load_velocities

      !> Read the grains of a variable, if it is stated.
      subroutine load_grains(group, name, file, grains)
         character(len=*), intent(in) :: group, name
         character(len=:), allocatable, intent(in) :: file
         type(points_type), allocatable, intent(out) :: grains

         if (.not. allocated(file)) return
         allocate (grains)
         call find_table(name, file, grains%table)
         if (.not. allocated(error)) call read_grains(self, radians, grains, error)
         call self%locate(group, name, error, file)
      end subroutine load_grains
   end subroutine load_tables

   !> Read the layers, and the tables of crystals: those to simulate, references, and the candidates
   !> of &design, which must be of the symmetry of &problem.
   subroutine load_crystals(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      associate (s => self%settings)
         if (allocated(s%specimen%layers)) then
            allocate (self%layers)
            call read_layers(resolve_path(self%folder, s%specimen%layers), self%layers, error)
            call self%locate('specimen', 'layers', error, s%specimen%layers)
            if (allocated(error)) return
         end if
         if (allocated(s%crystals%points)) then
            call read_file('crystals', 'points', s%crystals%points, self%crystals)
            if (allocated(error)) return
            if (angles_look_like_radians(self%crystals)) then
               self%warnings = [self%warnings, diagnostic('angles_like_radians', &
                  & 'the table '//printable(s%crystals%points))]
            end if
         end if
         if (allocated(s%references%crystals)) then
            call read_file('references', 'crystals', s%references%crystals, self%references)
            if (allocated(error)) return
            call find_column(self%references%table, 'reference', self%references%named_by, &
               & error, .true.)
            if (allocated(error)) return
         end if
         if (any(['latin    ', 'factorial'] == s%design%candidates)) return
         call read_file('design', 'candidates', s%design%candidates, self%candidates)
      end associate
      if (allocated(error) .or. .not. allocated(self%class%name)) return
      associate (points => self%candidates)
         i = findloc([(points%classes(points%class(i))%name == self%class%name, i=1, points%n)], &
            & .false., 1)
         if (i > 0) then
            call refuse(error, 'line '//to_text(points%table%line(i)) &
               & //': the crystal is not of the symmetry of &problem')
            call self%locate('design', 'candidates', error, self%settings%design%candidates)
         end if
      end associate

   contains

      !> Read crystals from the file of a variable.
      subroutine read_file(group, name, file, crystals)
         character(len=*), intent(in) :: group, name, file
         type(points_type), allocatable, intent(out) :: crystals

         allocate (crystals)
         call read_crystals(resolve_path(self%folder, file), self%class, crystals, error)
         call self%locate(group, name, error, file)
      end subroutine read_file
   end subroutine load_crystals

   !> Read the orientations and names of grains from their table.
   subroutine read_grains(self, radians, grains, error)
      type(problem_type), intent(in) :: self
      !> The unit of the angles in the table.
      logical, intent(in) :: radians
      type(points_type), intent(inout) :: grains
      type(error_type), allocatable, intent(out) :: error
      !> Bound of the memory for the moduli of each grain at 2000 draws.
      integer, parameter :: most_grains = 2000

      call read_orientations(grains, radians, self%class, self%settings%problem%lattice, error)
      if (allocated(error)) return
      call find_column(grains%table, 'grain', grains%named_by, error, .false.)
      if (allocated(error)) return
      if (grains%n > most_grains) then
         call refuse(error, to_text(grains%n)//' grains; allowed up to '//to_text(most_grains))
      else if (.not. radians) then
         call refuse_radians(grains, error)
      end if
   end subroutine read_grains

   !> The number of threads that &execution allows.
   integer function threads(self)
      class(problem_type), intent(in) :: self

      threads = thread_count(self%settings%execution%workers)
   end function threads

   !> Refuse a variable of the namelist.
   pure subroutine refuse_variable(self, group, name, message, error)
      class(problem_type), intent(in) :: self
      !> Group and variable, either may be ''; what is wrong.
      character(len=*), intent(in) :: group, name, message
      type(error_type), allocatable, intent(out) :: error

      call refuse(error, message, group, name)
      call locate_error(error, self%path)
   end subroutine refuse_variable

   !> Say of which group and variable of the namelist an error is, if there is one.
   pure subroutine locate(self, group, name, error, table)
      class(problem_type), intent(in) :: self
      !> Either may be ''.
      character(len=*), intent(in) :: group, name
      type(error_type), allocatable, intent(inout) :: error
      !> File that the variable names, if the error is in it.
      character(len=*), intent(in), optional :: table

      if (present(table)) call locate_error(error, printable(table))
      call locate_error(error, self%path, group, name)
   end subroutine locate

   !> Refuse the table of the measurements, which is not canonical, for a `reason`.
   subroutine refuse_table(self, reason, error)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: reason
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: file

      file = printable(self%settings%measurements%file)
      call self%refuse('measurements', 'file', file//reason//'; the batch program reads ' &
         & //'canonical tables: run ''bayesindent table '//file &
         & //' --output DIR'' and name DIR/table.csv', error)
   end subroutine refuse_table

   !> Say that an error is in the curves.
   pure subroutine locate_curves(self, error)
      class(problem_type), intent(in) :: self
      type(error_type), allocatable, intent(inout) :: error

      associate (stated => self%settings%curves)
         call self%locate('curves', trim(merge('file ', 'files', allocated(stated%file))), error, &
            & stated%file)
      end associate
   end subroutine locate_curves

   !> Read the measurements that were inferred from curves, unless the file names others.
   subroutine take_curve_results(self, folder, error)
      class(problem_type), intent(inout) :: self
      !> Folder of the results.
      character(len=*), intent(in) :: folder
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content

      if (.not. self%settings%curves%given .or. allocated(self%settings%measurements%file) &
         & .or. allocated(self%measurements)) then
         return
      end if
      self%shared_file = folder//'/shared_errors.csv'
      call read_text_file(folder//'/measurements.csv', content, error)
      call locate_table(self, error)
      if (.not. allocated(error)) call take_measurements(self, content, error)
   end subroutine take_curve_results

   !> Set the measurements. The tests of a grain become one measurement.
   subroutine take_measurements(self, content, error)
      type(problem_type), intent(inout) :: self
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
      radians = self%settings%measurements%angles == 'radians' &
         & .and. index(content, canonical_mark) /= 1
      call parse_table(content, table, error)
      if (allocated(self%settings%measurements%file) .and. .not. allocated(error)) then
         column = foreign_column(table)
         name = ''
         if (column > 0) name = printable(table%name(column))
         if (index(name, 'other_') == 1) then
            call refuse(error, 'the column '//name//' is not allowed; leave out the rows with ' &
               & //'other_probability above 0.05, and the columns other_*')
         else if (column > 0 .and. table%columns > 1) then
            call self%refuse_table(' has the column '''//name//'''', error)
         else if (radians) then
            call self%refuse_table(' has angles in radians', error)
         end if
      end if
      if (.not. allocated(error)) call read_tests()
      call locate_table(self, error)
      if (allocated(error)) return
      self%measurements = measurements
      if (allocated(measurements%tests) .and. allocated(self%shared_errors)) then
         do i = 1, measurements%n
            ! The tests of a grain have the weights that they have for its modulus.
            associate (weights => merge(weight, 0.0_wp, measurements%of_row == i))
               self%shared_errors(measurements%row(i), :) &
                  & = matmul(weights, self%shared_errors)/sum(weights)
            end associate
         end do
      end if
      self%settings%measurements%modulus_kind = measurements%modulus_kind
      call check_measurements(self%settings, self%class, self%measurements, self%warnings, error)
      call locate_table(self, error)
      if (allocated(self%velocities)) call append_velocities(self%measurements, self%velocities)

   contains

      !> Read the tests of the grains and their shared errors, and combine the tests of a grain.
      subroutine read_tests()
         associate (stated => self%settings%measurements)
            call split_references(table, radians, stated, self%class, &
               & self%settings%problem%lattice, self%reference_grains, error)
            if (allocated(error)) return
            call read_measurements(table, radians, stated, self%class, &
               & self%settings%problem%lattice, measurements, error)
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
         call combine_tests(self%class, measurements, error)
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
         associate (stated => self%settings%measurements%sample_nu)
            if (.not. self%states_nu) stated = nu(1)
            i = maxloc(abs(nu - stated), 1)
            if (abs(nu(i) - stated) <= tolerance) return
            call refuse(error, 'the columns and &measurements state sample_nu = ' &
               & //to_text(stated)//' and '//to_text(nu(i))//'; one value is allowed')
         end associate
      end subroutine take_nu

      !> Read the relative errors that the rows share.
      subroutine take_shared_errors()
         type(table_type) :: source
         real(wp), allocatable :: values(:, :)

         if (allocated(self%shared_refusal)) call refuse(error, self%shared_refusal)
         if (allocated(error)) return
         source = table
         call read_shared_errors(self%shared_file, table%rows, source, values, error)
         if (allocated(error)) return
         if (size(values) == 0) return
         self%shared_errors = transpose(values)
         self%shared_digest = source%digest()
         ! They contain the error of the indenter.
         if (.not. self%states_calibration) self%settings%measurements%calibration_sd = 0.0_wp
         if (allocated(self%reference_grains)) then
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
   subroutine locate_table(self, error)
      type(problem_type), intent(in) :: self
      type(error_type), allocatable, intent(inout) :: error

      associate (stated => self%settings%measurements)
         call self%locate('measurements', trim(merge('file', '    ', allocated(stated%file))), &
            & error, stated%file)
      end associate
   end subroutine locate_table
end module problem
