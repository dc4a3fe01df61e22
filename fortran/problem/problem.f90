!> A problem: a checked namelist in which every variable has a value, the tables that it names, and
!> the run of the program that reads it.
!>
!> Both programs, and the keywords of Python, make their problems here, so that they report the same
!> errors. A message is one line: `ORIGIN: &group name: what is wrong, the value, what is allowed`.
module problem
   use crystal_class, only: crystal_class_type, lattice_type, new_crystal_class, new_lattice
   use curve_tables, only: curve_set_type
   use diagnostics, only: diagnosed_type
   use errors, only: error_type, locate_error, refuse
   use files, only: folder_of, printable
   use kinds, only: wp
   use layer_table, only: layer_table_type
   use machine, only: thread_count
   use namelist_file, only: entry_type, find_entry
   use point_tables, only: points_type
   use settings_schema, only: settings_type
   use settings_checks, only: check_settings
   use settings_reader, only: read_settings
   use space_groups, only: laue_class
   use stiffness_table, only: stiffness_table_type
   use techniques, only: set_technique
   implicit none
   private
   public :: problem_type, new_problem, table_name, canonical_mark

   !> The tables that a namelist names; those that it does not name are not allocated.
   type :: data_type
      !> Velocities are the speeds as they were read, and are among the measurements too.
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
      !> Stiffness of &knowledge.
      type(stiffness_table_type), allocatable :: stiffness
      !> Layers of &specimen.
      type(layer_table_type), allocatable :: layers
   end type data_type

   !> What one run of a program does with a namelist.
   type :: run_type
      !> Path as the user wrote it, or the Python function of the keywords; folder of the file with
      !> a slash, or ''.
      character(len=:), allocatable :: path, folder
      !> Command that reads the file, '' for keywords; groups that the command needs, and groups of
      !> the file, separated by blanks.
      character(len=:), allocatable :: command, needed, groups
      !> Stages that the file requests, in order.
      character(len=8), allocatable :: stages(:)
      !> Whether the batch program has it, which writes the table of draws unless told otherwise.
      logical :: is_of_batch = .false.
   end type run_type

   type, extends(diagnosed_type) :: problem_type
      type(settings_type) :: settings
      !> Whether the file states &measurements sample_nu, technique and calibration_sd.
      logical :: states_nu = .false., states_technique = .false., states_calibration = .false.
      !> Class of &problem symmetry.
      type(crystal_class_type) :: class
      type(data_type) :: data
      type(run_type) :: run
   contains
      procedure :: locate, locate_curves, refuse => refuse_variable, refuse_table, threads
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
      character(len=:), allocatable :: word
      integer :: i

      self%run%path = path
      self%run%folder = folder_of(path)
      self%run%command = command
      self%run%needed = needed
      allocate (self%run%stages(0))
      self%run%groups = ''
      do i = 1, size(namelist)
         if (len(namelist(i)%name) == 0) self%run%groups = self%run%groups//namelist(i)%group//' '
      end do
      allocate (self%warnings(0))
      self%states_nu = find_entry(namelist, 'measurements', 'sample_nu') > 0
      self%states_technique = find_entry(namelist, 'measurements', 'technique') > 0
      self%states_calibration = find_entry(namelist, 'measurements', 'calibration_sd') > 0
      parsed = namelist
      i = find_entry(parsed, 'problem', 'symmetry')
      if (i > 0) then
         if (size(parsed(i)%values) == 1) then
            ! Replace a space group by its Laue class.
            word = laue_class(parsed(i)%values(1)%text)
            if (len(word) > 0) parsed(i)%values(1)%text = word
         end if
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
      call locate_error(error, self%run%path)
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
      call locate_error(error, self%run%path, group, name)
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

      call self%locate('curves', &
         & trim(merge('file ', 'files', allocated(self%settings%curves%file))), error, &
         & self%settings%curves%file)
   end subroutine locate_curves

end module problem
