!> A problem: a checked namelist in which every variable has a value, and the tables that it names.
!>
!> Both programs, and the keywords of Python, make their problems here, so that they report the same
!> errors. A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
module problem
   use crystal_class, only: crystal_class_type, lattice_type, new_crystal_class, new_lattice
   use curve_tables, only: curve_set_type, read_curves
   use errors, only: error_type, prefix_error, refuse, warn, warning_type
   use files, only: file_exists, folder_of, full_path, printable, read_text_file, resolve_path
   use kinds, only: wp
   use machine, only: thread_count
   use namelist_file, only: entry_type, place
   use measurement_checks, only: like_radians, check_measurements
   use direction_checks, only: refuse_radians
   use point_tables, only: angles_look_like_radians, points_type, read_crystals, &
      & read_measurements, read_orientations
   use repeated_tests, only: combine_tests, refuse_copied_rows
   use settings_schema, only: settings_type
   use settings_checks, only: check_settings
   use settings_reader, only: read_settings, settings_namelist
   use shared_error_tables, only: read_shared_errors
   use stiffness_table, only: new_stiffness_table, stiffness_table_type
   use table_columns, only: find_column, foreign_column
   use tables, only: parse_table, read_table, table_type
   use velocity_tables, only: append_velocities, read_velocities
   use text, only: newline, to_text
   implicit none
   private
   public :: problem_type, new_problem, table_name, canonical_mark, only_canonical

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
      !> Text of the canonical table of the measurements, which the folder of results gets.
      character(len=:), allocatable :: table_text
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
      procedure :: curves_place, load_tables, locate, refuse => refuse_variable, resolved_text, &
         & take_curve_results, threads
   end type problem_type

   !> Texts of tables that the Python program read, each unallocated if the namelist names a file
   !> that is read here, or none.
   type, public :: table_texts_type
      character(len=:), allocatable :: measurements, curves, velocities, stiffness
   end type table_texts_type

   !> What a message says of other tables than canonical ones, before the name of the table.
   character(len=*), parameter :: only_canonical = '; the batch program reads canonical tables: ' &
      & //'run ''bayesindent table '
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
   end subroutine new_problem

   !> Read the tables that the groups name, or those that are given as texts.
   subroutine load_tables(self, given, error)
      class(problem_type), intent(inout) :: self
      type(table_texts_type), intent(in) :: given
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: content, prefix

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
            call find_text(given%curves, s%curves%file, content)
            call prefix_error(error, self%curves_place())
            if (allocated(error)) return
            if (allocated(content)) call take_curves(self, content, error)
            if (allocated(error)) return
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
         call find_text(given%velocities, s%measurements%velocities, content)
         if (allocated(content) .and. .not. allocated(error)) then
            call take_velocities(self, content, allocated(given%measurements), error)
         end if
         call prefix_error(error, place(self%path, 'measurements', 'velocities'))
         if (allocated(error)) return
         if (allocated(s%measurements%shared_errors) .and. .not. allocated(given%measurements)) then
            self%shared_file = resolve_path(self%folder, s%measurements%shared_errors)
         end if
         call find_text(given%measurements, s%measurements%file, self%table_text)
         call prefix_error(error, prefix_of_table(self))
         if (allocated(error)) return
         if (allocated(self%table_text)) call take_measurements(self, self%table_text, error)
         if (allocated(error)) return
         prefix = place(self%path, 'knowledge', 'stiffness')
         if (allocated(s%knowledge%stiffness_file)) then
            prefix = place(self%path, 'knowledge', 'stiffness_file') &
               & //printable(s%knowledge%stiffness_file)//': '
         end if
         call find_text(given%stiffness, s%knowledge%stiffness_file, content)
         if (allocated(content) .and. .not. allocated(error)) then
            call take_stiffness(self, content, error)
         end if
         call prefix_error(error, prefix)
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

   contains

      !> Find the text of a table: as given, or of a file; unallocated if there is neither.
      subroutine find_text(stated, name, text)
         character(len=:), allocatable, intent(in) :: stated, name
         character(len=:), allocatable, intent(out) :: text

         if (allocated(stated)) then
            text = stated
         else if (allocated(name)) then
            call read_text_file(resolve_path(self%folder, name), text, error)
         end if
      end subroutine find_text
   end subroutine load_tables

   !> Read curves, and the table of tests that the namelist names.
   subroutine take_curves(self, content, error)
      type(problem_type), intent(inout) :: self
      !> CSV of the curves.
      character(len=*), intent(in) :: content
      type(error_type), allocatable, intent(out) :: error

      allocate (self%curves)
      associate (tests => self%settings%curves%tests)
         call read_curves(content, resolve_path(self%folder, tests), self%curves_place(), &
            & place(self%path, 'curves', 'tests')//printable(tests)//': ', self%curves, error)
      end associate
   end subroutine take_curves

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

      call refuse(error, place(self%path, group, name)//message)
   end subroutine refuse_variable

   !> Put a group and a variable of the namelist before the message of an error, if there is one.
   pure subroutine locate(self, group, name, error)
      class(problem_type), intent(in) :: self
      !> Either may be ''.
      character(len=*), intent(in) :: group, name
      type(error_type), allocatable, intent(inout) :: error

      call prefix_error(error, place(self%path, group, name))
   end subroutine locate

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
      character(len=:), allocatable :: content

      if (.not. self%settings%curves%given .or. allocated(self%settings%measurements%file) &
         & .or. allocated(self%measurements)) then
         return
      end if
      self%shared_file = folder//'/shared_errors.csv'
      call read_text_file(folder//'/measurements.csv', content, error)
      call prefix_error(error, prefix_of_table(self))
      if (.not. allocated(error)) call take_measurements(self, content, error)
   end subroutine take_curve_results

   !> Set the known stiffness.
   subroutine take_stiffness(self, content, error)
      type(problem_type), intent(inout) :: self
      !> CSV.
      character(len=*), intent(in) :: content
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table

      call parse_table(content, table, error)
      if (allocated(error)) return
      allocate (self%stiffness)
      call new_stiffness_table(table, self%class, self%stiffness, error)
   end subroutine take_stiffness

   !> Set the speeds. They are all the measurements if no moduli follow.
   subroutine take_velocities(self, content, moduli_follow, error)
      type(problem_type), intent(inout) :: self
      !> CSV.
      character(len=*), intent(in) :: content
      logical, intent(in) :: moduli_follow
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table

      allocate (self%velocities)
      associate (stated => self%settings%measurements)
         call parse_table(content, table, error)
         if (allocated(error)) return
         call read_velocities(table, stated%angles == 'radians', self%velocities, error)
         if (allocated(error)) return
         if (stated%angles == 'degrees') call refuse_radians(self%velocities, error)
         if (allocated(error) .or. moduli_follow) return
         if (allocated(stated%file) .or. self%settings%curves%given) return
         call append_velocities(self%measurements, self%velocities)
         stated%modulus_kind = self%measurements%modulus_kind
      end associate
   end subroutine take_velocities

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

      associate (stated => self%settings%measurements)
         ! Tables that this program wrote are in degrees; those of curves have the unit of tests.
         radians = stated%angles == 'radians' .and. index(content, canonical_mark) /= 1
         call parse_table(content, table, error)
         if (.not. allocated(error) .and. allocated(stated%file)) then
            column = foreign_column(table)
            if (column > 0 .and. table%columns > 1) then
               name = printable(table%name(column))
               if (index(name, 'other_') == 1) then
                  call refuse(error, prefix_of_table(self)//'the column '//name//' is not ' &
                     & //'allowed; leave out the rows with other_probability above 0.05, and ' &
                     & //'the columns other_*')
               else
                  call refuse(error, place(self%path, 'measurements', 'file') &
                     & //printable(stated%file)//' has the column '''//name//''''//only_canonical &
                     & //printable(stated%file)//' --output DIR'' and name DIR/table.csv')
               end if
               return
            end if
         end if
         if (radians .and. allocated(stated%file) .and. .not. allocated(error)) then
            call refuse(error, place(self%path, 'measurements', 'file')//printable(stated%file) &
               & //' has angles in radians'//only_canonical//printable(stated%file) &
               & //' --output DIR'' and name DIR/table.csv')
            return
         end if
         if (.not. allocated(error)) then
            call read_measurements(table, radians, stated, self%class, &
               & self%settings%problem%lattice, measurements, error)
         end if
         if (.not. (allocated(error) .or. measurements%has_angles) &
            & .and. stated%misalignment_sd_deg > 0.0_wp) then
            call refuse(error, 'misalignment_sd_deg = '//to_text(stated%misalignment_sd_deg) &
               & //' needs Euler angles: directions alone do not say how a turn of the sample ' &
               & //'moves them. Or state orientation_sd_deg')
         end if
      end associate
      if (.not. allocated(error)) then
         call read_shared_errors(measurements%table, self%shared_file, self%shared_errors, &
            & self%shared_digest, error)
      end if
      if (.not. allocated(error)) call refuse_copied_rows(measurements, error)
      if (.not. allocated(error)) then
         weight = 1.0_wp/measurements%sd_gpa**2
         call combine_tests(self%class, measurements, error)
      end if
      call prefix_error(error, prefix_of_table(self))
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
      call check_measurements(self%path, self%settings, self%class, radians, &
         & self%measurements, self%warnings, error)
      if (allocated(self%velocities)) call append_velocities(self%measurements, self%velocities)
   end subroutine take_measurements

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
         call find_column(self%grains%table, 'grain', self%grains%named_by, error, .false.)
      end if
      if (.not. allocated(error) .and. self%grains%n > most_grains) then
         call refuse(error, to_text(self%grains%n)//' grains; allowed up to '//to_text(most_grains))
      else if (.not. (allocated(error) .or. radians)) then
         call refuse_radians(self%grains, error)
      end if
      call prefix_error(error, prefix//printable(name)//': ')
   end subroutine load_grains

   !> Text of the resolved namelist for the folder of results: stated and needed groups, every
   !> variable with its value. The table of the measurements is the one in that folder.
   function resolved_text(self) result(page)
      class(problem_type), intent(in) :: self
      character(len=:), allocatable :: page
      type(settings_type) :: settings

      settings = self%settings
      associate (s => settings%measurements)
         if (allocated(self%table_text)) then
            s%file = table_name
            s%sheet = ''
            if (allocated(s%columns)) deallocate (s%columns)
            if (allocated(s%ebsd)) deallocate (s%ebsd)
            if (allocated(s%ebsd_points)) deallocate (s%ebsd_points)
            if (allocated(s%shared_errors) .and. .not. allocated(self%shared_file)) then
               deallocate (s%shared_errors)
            end if
         end if
         call make_absolute(self%folder, s%shared_errors)
         call make_absolute(self%folder, s%velocities)
         call make_absolute(self%folder, s%texture)
      end associate
      call make_absolute(self%folder, settings%crystals%points)
      call make_absolute(self%folder, settings%curves%file)
      call make_absolute(self%folder, settings%curves%tests)
      call make_absolute(self%folder, settings%references%crystals)
      call make_absolute(self%folder, settings%knowledge%stiffness_file)
      call make_absolute(self%folder, settings%design%candidates)
      call make_absolute(self%folder, settings%next%candidates)
      call make_absolute(self%folder, settings%surrogate%file)
      page = '! Every value of '//printable(self%path) &
         & //', defaults included; paths are absolute, or relative to this folder.'//newline &
         & //settings_namelist(settings, self%needed//' '//self%groups)
   end function resolved_text

   !> Make the name of a file in a folder absolute, if there is such a file.
   subroutine make_absolute(folder, name)
      character(len=*), intent(in) :: folder
      character(len=:), allocatable, intent(inout) :: name

      if (.not. allocated(name)) return
      if (file_exists(resolve_path(folder, name))) name = full_path(resolve_path(folder, name))
   end subroutine make_absolute
end module problem
