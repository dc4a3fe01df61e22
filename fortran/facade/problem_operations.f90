!> Problems: namelists, their settings and tables; and what there is to be set.
module problem_operations
   use choices, only: all_choices
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use exchange, only: exchange_type
   use kinds, only: wp
   use named_values, only: named_values_type
   use namelist_file, only: namelist_file_type, parse_namelist
   use physics_identity, only: identity_text
   use point_tables, only: points_type, read_crystals
   use problem, only: problem_type
   use problem_input, only: problem_of_text, read_problem
   use settings_groups, only: settings_type
   use settings_output, only: put_settings
   use settings_reader, only: read_settings
   use settings_schema, only: listed_settings => list_settings
   use settings_list, only: allowed_in_words, kind_names, settings_list_type
   use simulate, only: simulation_error
   use stages, only: all_stages, run_command, stage_row_type
   use tables, only: table_type, write_table
   use text, only: join
   use truncation_scan, only: read_scan
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: perform_problem

contains

   subroutine perform_problem(verb, object, x, error)
      character(len=*), intent(in) :: verb
      !> A problem; not associated: one is to be made, or all settings are wanted.
      class(*), pointer, intent(in) :: object
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: self
      class(*), pointer :: made

      if (associated(object)) then
         select type (object)
         type is (problem_type)
            call use_problem(verb, object, x, error)
         end select
         return
      else if (verb == 'list') then
         call list_settings(x%out)
         return
      else if (verb == 'values') then
         call read_values(x, error)
         return
      end if
      allocate (self)
      call x%give(self, 'problem')
      select case (verb)
      case ('read')
         call read_problem(x%in%text('path'), x%in%text('command'), self, error)
      case ('parse')
         call problem_of_text(x%in%text('path'), x%in%text('content'), self, error)
      case ('table')
         call read_table_alone(self, x, error)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine perform_problem

   !> The settings of a namelist's text, without the tables that it names.
   subroutine read_values(x, error)
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(namelist_file_type) :: namelist
      type(settings_type) :: settings

      call parse_namelist(x%in%text('path'), x%in%text('content'), namelist, error)
      if (.not. allocated(error)) call read_settings(x%in%text('path'), namelist, '', '', all_choices(), settings, error)
      if (.not. allocated(error)) call put_settings(settings, x%out)
   end subroutine read_values

   !> The crystals of a table alone, which has no settings; `symmetry`: of the rows that do not say theirs.
   subroutine read_table_alone(self, x, error)
      type(problem_type), intent(inout) :: self
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      character(len=:), allocatable :: path

      path = x%in%text('path')
      allocate (self%crystals)
      call new_crystal_class(x%in%text('symmetry'), class, error)
      if (.not. allocated(error)) call read_crystals(path, path//': ', class, self%crystals, error)
   end subroutine read_table_alone

   subroutine use_problem(verb, self, x, error)
      character(len=*), intent(in) :: verb
      type(problem_type), intent(inout) :: self
      type(exchange_type), intent(inout) :: x
      type(error_type), allocatable, intent(out) :: error
      real(wp), pointer :: c(:, :, :)
      real(wp), allocatable :: values(:)
      character(len=:), allocatable :: warning

      select case (verb)
      case ('describe')
         call describe_problem(self, x%out)
      case ('column')
         call give_column(points_of(self, x%in%text('table')), x%in%text('column'), x%out)
      case ('cells')
         call give_cells(self, x%in%text('table'), x%out)
      case ('set_table')
         ! A table that is no file: a page of CSV.
         call self%set_table(x%in%text('table'), x%in%text('page'), error)
      case ('write_crystals')
         ! The table of the crystals with columns of numbers (n, m) added.
         call write_table(self%crystals%table, x%in%text('path'), x%in%text('names'), &
            & x%in%columns('values', self%crystals%n), error)
      case ('mesh_error')
         ! How large the error of the mesh may be, relative, for crystals (stiffness, GPa), and what is to be said of those near
         ! instability.
         c => x%in%matrices('stiffness')
         allocate (values(size(c, 3)))
         call simulation_error(self%settings, c, values, warning)
         call x%out%put_array('largest', values, shape(values))
         call x%out%put('warning', warning)
      case default
         call x%refuse(verb, error)
      end select
   end subroutine use_problem

   !> The settings, resolved and in their types, the identity of the physics, and what tables there are; of a table alone that.
   subroutine describe_problem(self, out)
      type(problem_type), intent(in) :: self
      type(named_values_type), intent(inout) :: out
      character(len=12), parameter :: tables(4) = [character(len=12) :: 'crystals', 'measurements', 'candidates', 'grains']
      type(error_type), allocatable :: error
      type(warning_type), allocatable :: list(:)
      integer, allocatable :: pairs(:, :)
      integer :: i

      if (allocated(self%path)) then
         call put_settings(self%settings, out)
         call out%put('resolved', self%resolved_text())
         call out%put('warnings', self%warnings)
         call out%put('groups', self%groups)
         call out%put('stages', join(self%stages, ' '))
         call read_scan(self%settings%surrogate%scan, pairs, error)
         call out%put_integers('scan', pairs, shape(pairs))
         call out%put('physics', identity_text(self%settings))
      end if
      if (allocated(self%spreadsheet)) call out%put('spreadsheet', self%spreadsheet)
      if (allocated(self%indents)) then
         call out%put('map', self%map)
         call out%put_array('indents_um', self%positions, shape(self%positions))
         allocate (list(0))
         do i = 1, self%indents%columns
            call warn(list, self%indents%called(i))
         end do
         call out%put('indents_columns', list)
      end if
      do i = 1, size(tables)
         call describe_points(trim(tables(i)), points_of(self, tables(i)), out)
      end do
      if (allocated(self%stiffness)) call put_cells('stiffness', self%stiffness%table, out)
   end subroutine describe_problem

   !> A table of a problem by its name, not associated where there is none.
   function points_of(self, name) result(points)
      type(problem_type), intent(in), target :: self
      character(len=*), intent(in) :: name
      type(points_type), pointer :: points

      points => null()
      select case (name)
      case ('crystals')
         if (allocated(self%crystals)) points => self%crystals
      case ('measurements')
         if (allocated(self%measurements)) points => self%measurements
      case ('candidates')
         if (allocated(self%candidates)) points => self%candidates
      case default
         if (allocated(self%grains)) points => self%grains
      end select
   end function points_of

   !> How many rows a table has, their kind of modulus, the classes of its crystals, and the names of its grains.
   subroutine describe_points(name, points, out)
      character(len=*), intent(in) :: name
      type(points_type), pointer, intent(in) :: points
      type(named_values_type), intent(inout) :: out
      type(warning_type), allocatable :: classes(:), names(:)
      integer :: i

      if (.not. associated(points)) return
      call out%put(name//'.n', points%n)
      if (allocated(points%modulus_kind)) call out%put(name//'.modulus_kind', points%modulus_kind)
      allocate (classes(0), names(points%n))
      if (allocated(points%class)) then
         do i = 1, size(points%classes)
            call warn(classes, points%classes(i)%name)
         end do
      end if
      call out%put(name//'.classes', classes)
      if (.not. points%named_by > 0) return
      do i = 1, points%n
         names(i)%text = points%name(i)
      end do
      call out%put(name//'.names', names)
   end subroutine describe_points

   !> The numbers of a column of a table.
   subroutine give_column(points, name, out)
      type(points_type), intent(in) :: points
      character(len=*), intent(in) :: name
      type(named_values_type), intent(inout) :: out

      select case (name)
      case ('euler_deg')
         call out%put_array('values', points%euler_deg, shape(points%euler_deg))
      case ('modulus_gpa')
         call out%put_array('values', points%modulus_gpa, [points%n])
      case ('sd_gpa')
         call out%put_array('values', points%sd_gpa, [points%n])
      case ('constants')
         call out%put_array('values', points%constants, shape(points%constants))
      case ('stiffness')
         call out%put_array('values', points%stiffness, shape(points%stiffness))
      case default
         call out%put_integers('values', points%class, [points%n])
      end select
   end subroutine give_column

   !> The cells of a table of a problem.
   subroutine give_cells(self, name, out)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: name
      type(named_values_type), intent(inout) :: out
      type(points_type), pointer :: points

      points => points_of(self, name)
      call put_cells('cells', points%table, out)
   end subroutine give_cells

   !> The cells of a table row by row, the header first.
   subroutine put_cells(name, table, out)
      character(len=*), intent(in) :: name
      type(table_type), intent(in) :: table
      type(named_values_type), intent(inout) :: out
      type(warning_type), allocatable :: cells(:)
      integer :: i, j

      allocate (cells(table%columns*(table%rows + 1)))
      do i = 0, table%rows
         do j = 1, table%columns
            cells(i*table%columns + j)%text = table%cell(j, i)
         end do
      end do
      call out%put(name, cells)
      call out%put(name//'.columns', table%columns)
   end subroutine put_cells

   !> `schema`, the variables: group, its meaning, name, type, number of values, unit, default, allowed, meaning of each; `stages`: name,
   !> groups, file of its document, summary, description of each.
   subroutine list_settings(out)
      type(named_values_type), intent(inout) :: out
      character(len=9), parameter :: shapes(3) = [character(len=9) :: 'one', 'constants', 'list']
      type(settings_list_type) :: schema
      type(settings_type) :: unset
      type(stage_row_type) :: stage
      type(warning_type), allocatable :: list(:)
      integer :: i

      schema = listed_settings(unset, all_choices())
      allocate (list(9*size(schema%variables)))
      do i = 1, size(schema%variables)
         associate (v => schema%variables(i), row => list(9*i - 8:9*i))
            row(1)%text = v%group
            row(2)%text = schema%groups(v%group_number)%meaning
            row(3)%text = v%name
            row(4)%text = trim(kind_names(v%kind))
            row(5)%text = trim(shapes(v%shape))
            row(6)%text = v%unit
            row(7)%text = v%default
            row(8)%text = allowed_in_words(v)
            row(9)%text = v%meaning
         end associate
      end do
      call out%put('schema', list)
      deallocate (list)
      do i = 0, size(all_stages)
         stage = run_command
         if (i > 0) stage = all_stages(i)
         call warn(list, trim(stage%name))
         call warn(list, trim(stage%groups))
         call warn(list, trim(stage%document))
         call warn(list, trim(stage%summary))
         call warn(list, trim(stage%description))
      end do
      call out%put('stages', list)
   end subroutine list_settings
end module problem_operations
