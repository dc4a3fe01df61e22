!> Problems: namelists, their settings and tables; and what there is to be set.
module problem_operations
   use abstract_basis, only: basis_type
   use build_checks, only: basis_of_problem
   use campaign_import, only: import_table
   use choices, only: all_choices
   use errors, only: error_type
   use exchange, only: exchange_type
   use fe_indentation, only: indentation_model_type, new_indentation_model
   use kinds, only: wp
   use named_values, only: named_values_type
   use namelist_file, only: place
   use physics_identity, only: identity_text
   use point_tables, only: points_type
   use problem, only: problem_type
   use settings_schema, only: listed_settings => list_settings, settings_type
   use settings_list, only: allowed_in_words, kind_names, settings_list_type
   use settings_output, only: put_settings
   use simulate, only: new_simulator, simulation_error
   use simulation_operations, only: held_simulator_type
   use stage_documents, only: begin_results, inputs_of
   use stage_operations, only: held_stage_type
   use stages, only: all_stages, check_simulator, check_stages, new_stage, run_command, stage_row_type
   use surrogate_operations, only: give_basis
   use tables, only: table_type, write_table
   use text, only: join
   use truncation_scan, only: read_scan
   use warning_lists, only: warn, warning_type
   implicit none
   private
   public :: list_settings, use_problem

contains

   subroutine use_problem(verb, self, x)
      character(len=*), intent(in) :: verb
      type(problem_type), intent(inout), target :: self
      type(exchange_type), intent(inout) :: x
      type(indentation_model_type), pointer :: model
      type(held_simulator_type), pointer :: simulator
      type(held_stage_type), pointer :: stage
      class(basis_type), allocatable :: basis
      real(wp), pointer :: c(:, :, :)

      select case (verb)
      case ('describe')
         call describe_problem(self, x%out)
      case ('column')
         call give_column(points_of(self, x%in%text('table')), x%in%text('column'), x%out)
      case ('set_table')
         ! A table that is no file: a page of CSV.
         call self%set_table(x%in%text('table'), x%in%text('page'), x%error)
      case ('write_crystals')
         ! The table of the crystals with columns of numbers (n, m) added.
         call write_table(self%crystals%table, x%in%text('path'), x%in%text('names'), &
            & x%in%columns('values', self%crystals%n), x%error)
      case ('import')
         ! Their moduli, into the campaign of another problem.
         call import_table(x%problem, x%places(), self%crystals, x%in%text('name'), x%text, x%error)
      case ('begin_results')
         call begin_results(self, x%in%text('groups'), x%places(), x%error)
      case ('inputs')
         x%text = '{'//inputs_of(self, self%groups, x%places())//'}'
      case ('check_stages')
         call check_stages(self, x%places(), x%error)
         if (.not. allocated(x%error)) call check_simulator(self, x%error)
      case ('indentation')
         allocate (model)
         call x%give(model, 'indentation')
         call new_indentation_model(self%settings, model, x%error)
         if (allocated(x%error)) x%error%message = place(self%path, 'simulation', '')//x%error%message
      case ('simulator')
         allocate (simulator)
         call x%give(simulator, 'simulator')
         call new_simulator(self%settings, simulator%simulator, x%error)
         if (allocated(x%error)) x%error%message = place(self%path, 'simulation', '')//x%error%message
      case ('basis')
         call basis_of_problem(self, basis, x%error)
         if (.not. allocated(x%error)) call give_basis(basis, x)
      case ('stage')
         allocate (stage)
         call x%give(stage, 'stage')
         call new_stage(x%in%text('name'), stage%stage, x%error)
         if (.not. allocated(x%error)) call stage%stage%open(self, x%places(), x%error)
         if (.not. allocated(x%error)) call x%out%put('expected', stage%stage%n_expected)
      case ('mesh_error')
         ! How large the error of the mesh may be, relative, for crystals (stiffness, GPa), and what is to be said of those near
         ! instability.
         c => x%in%matrices('stiffness')
         allocate (x%values(size(c, 3), 1))
         call simulation_error(self%settings, c, x%values(:, 1), x%text)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_problem

   !> The settings, resolved and in their types, the identity of the physics, and what tables there are; of a table alone that.
   subroutine describe_problem(self, out)
      type(problem_type), intent(in) :: self
      type(named_values_type), intent(inout) :: out
      character(len=12), parameter :: tables(4) = [character(len=12) :: 'crystals', 'measurements', 'candidates', 'grains']
      type(error_type), allocatable :: error
      type(points_type), pointer :: points
      type(warning_type), allocatable :: list(:), classes(:), names(:)
      character(len=:), allocatable :: name
      integer, allocatable :: pairs(:, :)
      integer :: i, j

      if (allocated(self%path)) then
         call put_settings(self%settings, out)
         call out%put('resolved', self%resolved_text())
         call out%put('warnings', self%warnings)
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
      ! How many rows a table has, their kind of modulus, the classes of its crystals, and the names of its grains.
      do i = 1, size(tables)
         points => points_of(self, tables(i))
         if (.not. associated(points)) cycle
         name = trim(tables(i))
         call out%put(name//'.n', points%n)
         if (allocated(points%modulus_kind)) call out%put(name//'.modulus_kind', points%modulus_kind)
         allocate (classes(0), names(0))
         if (allocated(points%class)) then
            do j = 1, size(points%classes)
               call warn(classes, points%classes(j)%name)
            end do
         end if
         call out%put(name//'.classes', classes)
         if (points%named_by > 0) then
            do j = 1, points%n
               call warn(names, points%name(j))
            end do
            call out%put(name//'.names', names)
         end if
         deallocate (classes, names)
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

   !> The numbers of a column of a table, or its 'cells'.
   subroutine give_column(points, name, out)
      type(points_type), intent(in) :: points
      character(len=*), intent(in) :: name
      type(named_values_type), intent(inout) :: out

      select case (name)
      case ('cells')
         call put_cells('cells', points%table, out)
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
      type(stage_row_type), parameter :: rows(*) = [run_command, all_stages]
      type(settings_list_type) :: schema
      type(settings_type) :: unset
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
      call out%put('stages', [character(len=len(rows%description)) :: (rows(i)%name, rows(i)%groups, rows(i)%document, &
         & rows(i)%summary, rows(i)%description, i=1, size(rows))])
   end subroutine list_settings
end module problem_operations
