!> A problem: a checked namelist in which every variable has a value, and the tables that it names.
!>
!> Both programs, and the keywords of Python, make their problems here, so that they report the same
!> errors. A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
module problem
   use crystal_class, only: crystal_class_type, lattice_type, new_crystal_class, new_lattice
   use curve_tables, only: curve_set_type, read_curves
   use errors, only: error_type, prefix_error, refuse, warn, warning_type
   use files, only: folder_of, printable, read_text_file, resolve_path
   use kinds, only: wp
   use namelist_file, only: entry_type, place
   use measurement_checks, only: like_radians, check_measurements
   use direction_checks, only: refuse_radians
   use point_tables, only: angles_look_like_radians, points_type, read_column, read_crystals, &
      & read_measurements, read_orientations
   use repeated_tests, only: combine_tests, refuse_copied_rows
   use settings_schema, only: settings_type
   use settings_checks, only: check_settings
   use settings_reader, only: read_settings, settings_namelist
   use shared_error_tables, only: read_shared_errors
   use stiffness_table, only: new_stiffness_table, stiffness_table_type
   use table_columns, only: find_column, name_columns
   use tables, only: parse_table, read_table, table_type
   use velocity_tables, only: append_velocities, read_velocities
   use text, only: lower, newline, to_text
   implicit none
   private
   public :: problem_type, new_problem

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
      type(warning_type), allocatable :: warnings(:)
      !> Tables that the file names, unallocated if it does not; `velocities` are the speeds as they
      !> were read, and are among the measurements too.
      type(points_type), allocatable :: crystals, measurements, velocities, candidates
      !> Whether speeds of waves that cannot be detected were left out of the measurements.
      logical :: are_detected = .false.
      !> Grains from which &next chooses; unallocated: all directions.
      type(points_type), allocatable :: grains
      !> Possible orientations of grains of unknown orientation; unallocated: all.
      type(points_type), allocatable :: texture
      !> File of measurements that Python converts to a plain table (see `set_table`): any file if
      !> Python reads the problem, else a spreadsheet.
      character(len=:), allocatable :: table_file
      !> Measurements whose orientations Python will read from a map, the paths of the map and of
      !> its homologous points, and the positions, um, (n, 2).
      type(table_type), allocatable :: indents
      character(len=:), allocatable :: map, map_points
      real(wp), allocatable :: positions(:, :)
      !> Rows that `retain_indents` retains; unallocated: all.
      integer, allocatable :: retained(:)
      !> Indented directions in crystal axes for each mistake of the axes of the map, (3,
      !> measurement, mistake); see `orientation_check`.
      real(wp), allocatable :: misread(:, :, :)
      !> Curves of &curves, and crystals of &references.
      type(curve_set_type), allocatable :: curves
      type(points_type), allocatable :: references
      !> Relative errors that measurements share: columns of sd 1, (row of the table, error);
      !> unallocated: none.
      real(wp), allocatable :: shared_errors(:, :)
      !> File of the shared errors, unallocated: the table of the measurements; and its checksum.
      character(len=:), allocatable :: shared_file, shared_digest
      !> Stiffness of &knowledge.
      type(stiffness_table_type), allocatable :: stiffness
      !> Folder, without its last slash, for finished chains until Step 2 is done; unallocated: they
      !> are not stored.
      character(len=:), allocatable :: kept_in
   contains
      procedure :: curves_place, resolved_text, set_table, take_curves, take_curve_results
      procedure :: retain_indents
   end type problem_type

   !> Contact radius of the paper's indentations at the last depth, um.
   real(wp), parameter :: paper_contact = 0.5_wp

contains

   !> Make the problem of a parsed namelist, and read the tables that it names.
   subroutine new_problem(path, namelist, command, needed, from_python, self, error)
      !> The file, or the origin of keywords.
      character(len=*), intent(in) :: path
      type(entry_type), intent(in) :: namelist(:)
      !> See `problem_type`.
      character(len=*), intent(in) :: command, needed
      !> Whether Python reads the file of the measurements.
      logical, intent(in) :: from_python
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
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
      call read_settings(path, namelist, command, needed, self%settings, error)
      if (allocated(error)) return
      associate (s => self%settings, last => self%settings%indenter)
         if (len(s%surrogate%file) == 0) then
            s%surrogate%file = trim(merge('surrogate.txt', 'halfspace    ', &
               & s%design%given .or. s%domain%given))
         end if
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
            call prefix_error(error, place(path, 'problem', 'lattice'))
         end if
      end if
      if (allocated(error)) return
      call check_settings(path, self%settings, self%class, error)
      if (allocated(error)) return
      if (len(self%settings%specimen%estimator) == 0) self%settings%specimen%estimator = 'curve'
      call load_tables(self, from_python, error)
   end subroutine new_problem

   !> Read the tables that the groups name.
   subroutine load_tables(self, from_python, error)
      type(problem_type), intent(inout) :: self
      logical, intent(in) :: from_python
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table
      character(len=:), allocatable :: content, file, prefix

      associate (s => self%settings)
         if (allocated(s%crystals%points)) then
            allocate (self%crystals)
            prefix = place(self%path, 'crystals', 'points')//printable(s%crystals%points)
            call read_crystals(resolve_path(self%folder, s%crystals%points), prefix//': ', &
               & self%class, self%crystals, error)
            if (allocated(error)) return
            if (angles_look_like_radians(self%crystals)) then
               call warn(self%warnings, prefix//like_radians)
            end if
         end if
         if (s%curves%given) then
            if (allocated(s%curves%file)) then
               call read_text_file(resolve_path(self%folder, s%curves%file), content, error)
               call prefix_error(error, self%curves_place())
               if (allocated(error)) return
               call self%take_curves(content, error)
               if (allocated(error)) return
            end if
            if (.not. allocated(s%measurements%file)) then
               s%measurements%modulus_kind = 'effective_modulus'
               s%measurements%indenter_modulus_gpa = s%curves%indenter_modulus_gpa
               s%measurements%indenter_nu = s%curves%indenter_nu
            end if
         end if
         if (allocated(s%references%crystals)) then
            allocate (self%references)
            call read_crystals(resolve_path(self%folder, s%references%crystals), &
               & place(self%path, 'references', 'crystals')//printable(s%references%crystals) &
               & //': ', self%class, self%references, error)
            if (allocated(error)) return
            call find_column(self%references%table, 'reference', self%references%named_by, &
               & error, .true.)
            if (allocated(error)) return
         end if
         if (allocated(s%measurements%velocities)) then
            call read_table(resolve_path(self%folder, s%measurements%velocities), table, error)
            call take_velocities(self, table, error)
         end if
         if (allocated(s%measurements%shared_errors)) then
            self%shared_file = resolve_path(self%folder, s%measurements%shared_errors)
         end if
         if (allocated(s%measurements%ebsd)) then
            self%map = resolve_path(self%folder, s%measurements%ebsd)
         end if
         if (allocated(s%measurements%ebsd_points)) then
            self%map_points = resolve_path(self%folder, s%measurements%ebsd_points)
         end if
         if (allocated(s%measurements%file) .and. .not. allocated(error)) then
            file = resolve_path(self%folder, s%measurements%file)
            if (from_python .or. any(lower(file(max(1, len(file) - 4):)) &
               & == [character(len=5) :: '.xlsx', '.xlsm'])) then
               self%table_file = file
            else
               call read_table(file, table, error)
               call take_measurements(self, table, error)
            end if
         end if
         if (.not. allocated(error) .and. allocated(s%knowledge%stiffness_file)) then
            call read_table(resolve_path(self%folder, s%knowledge%stiffness_file), table, error)
            call take_stiffness(self, table, place(self%path, 'knowledge', 'stiffness_file') &
               & //printable(s%knowledge%stiffness_file)//': ', error)
         end if
         if (.not. allocated(error) .and. allocated(s%measurements%texture)) then
            call load_grains(self, place(self%path, 'measurements', 'texture'), &
               & s%measurements%texture, error)
            call move_alloc(self%grains, self%texture)
         end if
         if (.not. allocated(error) .and. allocated(s%next%candidates)) then
            call load_grains(self, place(self%path, 'next', 'candidates'), s%next%candidates, error)
         end if
         if (allocated(error) .or. any(['latin    ', 'factorial'] == s%design%candidates)) return
         call load_candidates(self, s%design%candidates, error)
      end associate
   end subroutine load_tables

   !> Read curves, and the table of tests that the namelist names.
   subroutine take_curves(self, content, error)
      class(problem_type), intent(inout) :: self
      !> CSV of the curves.
      character(len=*), intent(in) :: content
      type(error_type), allocatable, intent(out) :: error

      allocate (self%curves)
      associate (tests => self%settings%curves%tests)
         call read_curves(content, resolve_path(self%folder, tests), self%curves_place(), &
            & place(self%path, 'curves', 'tests')//printable(tests)//': ', self%curves, error)
      end associate
   end subroutine take_curves

   !> Beginning of the messages on curves.
   pure function curves_place(self) result(prefix)
      class(problem_type), intent(in) :: self
      character(len=:), allocatable :: prefix

      if (allocated(self%settings%curves%file)) then
         prefix = place(self%path, 'curves', 'file')//printable(self%settings%curves%file)//': '
      else
         prefix = place(self%path, 'curves', 'files')
      end if
   end function curves_place

   !> Read the measurements that were inferred from curves, unless the file names others.
   subroutine take_curve_results(self, folder, error)
      class(problem_type), intent(inout) :: self
      !> Folder of the results.
      character(len=*), intent(in) :: folder
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table

      if (.not. self%settings%curves%given .or. allocated(self%settings%measurements%file) &
         & .or. allocated(self%measurements)) then
         return
      end if
      self%shared_file = folder//'/shared_errors.csv'
      call read_table(folder//'/measurements.csv', table, error)
      call take_measurements(self, table, error)
   end subroutine take_curve_results

   !> Retain only the indents of these `rows`. Call it before `set_table` with 'ebsd'.
   subroutine retain_indents(self, rows)
      class(problem_type), intent(inout) :: self
      !> Ascending, from 1.
      integer, intent(in) :: rows(:)

      self%retained = rows
      call self%indents%retain(rows)
   end subroutine retain_indents

   !> Set a table that is not a file. For 'measurements' in a file it is the plain table that Python
   !> made of it, or empty if the file is plain; 'ebsd' has a row for each retained indent.
   subroutine set_table(self, table, page, error)
      class(problem_type), intent(inout) :: self
      !> 'measurements', 'curves', 'velocities', 'ebsd' or 'stiffness', and the CSV; or 'warning'
      !> and the line of a warning about a table.
      character(len=*), intent(in) :: table, page
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: parsed
      integer :: i

      if (table == 'warning') then
         call warn(self%warnings, page)
         return
      end if
      if (table == 'measurements' .and. len(page) == 0) then
         call read_table(self%table_file, parsed, error)
      else if (table /= 'curves') then
         call parse_table(page, parsed, error)
      end if
      select case (table)
      case ('curves')
         call self%take_curves(page, error)
      case ('stiffness')
         call take_stiffness(self, parsed, place(self%path, 'knowledge', 'stiffness'), error)
      case ('velocities')
         call take_velocities(self, parsed, error)
      case ('ebsd')
         if (.not. allocated(error)) call self%indents%join(parsed, error)
         call set_measurements(self, self%indents, error)
      case default
         ! If there is no file, messages count rows from 1, without the header.
         if (.not. allocated(self%table_file)) parsed%line = [(i, i=1, parsed%rows)]
         call take_measurements(self, parsed, error)
      end select
   end subroutine set_table

   !> Set the known stiffness, unless its reading raised an `error`.
   subroutine take_stiffness(self, table, prefix, error)
      type(problem_type), intent(inout) :: self
      type(table_type), intent(in) :: table
      !> Beginning of messages.
      character(len=*), intent(in) :: prefix
      type(error_type), allocatable, intent(inout) :: error
      type(stiffness_table_type) :: stiffness

      if (.not. allocated(error)) call new_stiffness_table(table, self%class, stiffness, error)
      call prefix_error(error, prefix)
      if (allocated(error)) return
      self%stiffness = stiffness
   end subroutine take_stiffness

   !> Set the speeds, unless their reading raised an `error`. They are all the measurements if no
   !> moduli follow.
   subroutine take_velocities(self, table, error)
      type(problem_type), intent(inout) :: self
      type(table_type), intent(in) :: table
      type(error_type), allocatable, intent(inout) :: error

      allocate (self%velocities)
      associate (stated => self%settings%measurements)
         if (.not. allocated(error)) then
            call read_velocities(table, stated%angles == 'radians', self%velocities, error)
         end if
         if (.not. allocated(error) .and. stated%angles == 'degrees') then
            call refuse_radians(self%velocities, error)
         end if
         if (allocated(error)) then
            error%message = place(self%path, 'measurements', 'velocities')//error%message
         else if (.not. (allocated(stated%file) .or. self%settings%curves%given)) then
            call append_velocities(self%measurements, self%velocities)
            stated%modulus_kind = self%measurements%modulus_kind
         end if
      end associate
   end subroutine take_velocities

   !> Set the measurements, unless their reading raised an `error`. If their orientations are in a
   !> map, only the indents are set.
   subroutine take_measurements(self, table, error)
      type(problem_type), intent(inout) :: self
      type(table_type), intent(in) :: table
      type(error_type), allocatable, intent(inout) :: error
      real(wp), allocatable :: x(:), y(:)

      if (.not. allocated(self%map)) then
         call set_measurements(self, table, error)
         return
      end if
      self%indents = table
      if (.not. allocated(error)) then
         call name_columns(self%indents, self%settings%measurements%columns, error)
      end if
      call read_column(self%indents, 'x_um', .false., x, error)
      call read_column(self%indents, 'y_um', .false., y, error)
      if (.not. allocated(error)) self%positions = reshape([x, y], [table%rows, 2])
      call prefix_error(error, prefix_of_table(self))
   end subroutine take_measurements

   !> Set the measurements, which have their orientations, unless their reading raised an `error`.
   !> The tests of a grain become one measurement.
   subroutine set_measurements(self, table, error)
      type(problem_type), intent(inout) :: self
      type(table_type), intent(in) :: table
      type(error_type), allocatable, intent(inout) :: error
      type(points_type) :: measurements
      real(wp), allocatable :: weight(:)
      integer :: i

      if (.not. allocated(error)) then
         call read_measurements(table, self%settings%measurements, self%class, &
            & self%settings%problem%lattice, measurements, error)
      end if
      if (.not. (allocated(error) .or. measurements%has_angles) &
         & .and. self%settings%measurements%misalignment_sd_deg > 0.0_wp) then
         call refuse(error, &
            & 'misalignment_sd_deg = '//to_text(self%settings%measurements%misalignment_sd_deg) &
            & //' needs Euler angles: directions alone do not say how a turn of the sample moves ' &
            & //'them. Or state orientation_sd_deg')
      end if
      if (.not. allocated(error)) then
         call read_shared_errors(measurements%table, self%shared_file, self%retained, &
            & self%positions, self%shared_errors, self%shared_digest, error)
      end if
      if (.not. allocated(error)) call refuse_copied_rows(measurements, error)
      if (.not. allocated(error)) then
         weight = 1.0_wp/measurements%sd_gpa**2
         call combine_tests(self%class, measurements, error)
      end if
      if (allocated(error)) then
         error%message = prefix_of_table(self)//error%message
      else
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
         call check_measurements(self%path, self%settings, self%class, allocated(self%map), &
            & self%measurements, self%warnings, error)
         if (allocated(self%velocities)) call append_velocities(self%measurements, self%velocities)
      end if
   end subroutine set_measurements

   !> Beginning of the messages on the measurements.
   function prefix_of_table(self) result(prefix)
      type(problem_type), intent(in) :: self
      character(len=:), allocatable :: prefix

      prefix = place(self%path, 'measurements', '')
      if (allocated(self%settings%measurements%file)) then
         prefix = place(self%path, 'measurements', 'file') &
            & //printable(self%settings%measurements%file)//': '
      end if
   end function prefix_of_table

   !> Read the candidates of &design, which must be of the symmetry of &problem.
   subroutine load_candidates(self, name, error)
      type(problem_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: prefix
      integer :: i

      prefix = place(self%path, 'design', 'candidates')//printable(name)//': '
      allocate (self%candidates)
      call read_crystals(resolve_path(self%folder, name), prefix, self%class, &
         & self%candidates, error)
      if (allocated(error) .or. .not. allocated(self%class%name)) return
      i = findloc([(self%candidates%classes(self%candidates%class(i))%name == self%class%name, &
         & i=1, self%candidates%n)], .false., 1)
      if (i > 0) then
         call refuse(error, prefix//'line '//to_text(self%candidates%table%line(i)) &
            & //': the crystal is not of the symmetry of &problem')
      end if
   end subroutine load_candidates

   !> Read the grains of a file; `prefix` begins the messages.
   subroutine load_grains(self, prefix, name, error)
      type(problem_type), intent(inout) :: self
      character(len=*), intent(in) :: prefix, name
      type(error_type), allocatable, intent(out) :: error
      !> Bound of the memory for the moduli of each grain at 2000 draws.
      integer, parameter :: most_grains = 2000
      logical :: radians

      radians = self%settings%measurements%angles == 'radians'
      allocate (self%grains)
      call read_table(resolve_path(self%folder, name), self%grains%table, error)
      if (.not. allocated(error)) then
         call read_orientations(self%grains, radians, self%class, &
            & self%settings%problem%lattice, error)
      end if
      if (.not. allocated(error)) then
         call find_column(self%grains%table, 'grain', self%grains%named_by, error)
      end if
      if (.not. allocated(error) .and. self%grains%n > most_grains) then
         call refuse(error, to_text(self%grains%n)//' grains; allowed up to '//to_text(most_grains))
      else if (.not. (allocated(error) .or. radians)) then
         call refuse_radians(self%grains, error)
      end if
      call prefix_error(error, prefix//printable(name)//': ')
   end subroutine load_grains

   !> Text of the resolved namelist: stated and needed groups, every variable with its value.
   function resolved_text(self) result(page)
      class(problem_type), intent(in) :: self
      character(len=:), allocatable :: page

      page = '! Every value of '//printable(self%path) &
         & //', defaults included; paths are relative to the folder of that file.'//newline &
         & //settings_namelist(self%settings, self%needed//' '//self%groups)
   end function resolved_text
end module problem
