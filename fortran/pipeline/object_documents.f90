!> What another language is told of the objects that it holds: a JSON document of each, arrays by their lengths, and one array in full.
module object_documents
   use build_handles, only: find_build
   use choices, only: all_choices
   use described_values, only: described_values_type
   use errors, only: error_type
   use fe_indentation, only: indentation_model_type
   use json, only: json_type
   use kinds, only: i8, wp
   use observables, only: observable_names
   use physics_identity, only: identity_text
   use point_tables, only: points_type
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use settings_lists, only: new_schema, schema_type, settings_namelist
   use step_1, only: build_type
   use settings_visitor, only: allowed_in_words, kind_names
   use simulation_handles, only: model_of_handle
   use stages, only: all_stages, run_command, stage_type
   use surrogate_handles, only: describe_surrogate_object => describe_object
   use tables, only: table_type
   use truncation_scan, only: read_scan
   implicit none
   private
   public :: describe_object

contains

   !> The numbers and texts of an object.
   subroutine describe_object(handle, kind, visitor, error)
      integer(i8), intent(in) :: handle
      !> 'basis', 'surrogate', 'learner', 'build', 'problem', 'indentation'; 'crystals', 'measurements', 'candidates' or 'grains', the cells
      !> of this table of a problem, the header first; or 'settings', which has no handle: what namelists may hold.
      character(len=*), intent(in) :: kind
      type(described_values_type), intent(inout) :: visitor
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: problem
      type(indentation_model_type), pointer :: model
      type(build_type), pointer :: build

      select case (kind)
      case ('settings')
         call describe_settings(visitor%document)
      case ('problem')
         call problem_of_handle(handle, problem, error)
         if (.not. allocated(error)) call describe_problem(problem, visitor)
      case ('crystals', 'measurements', 'candidates', 'grains')
         call problem_of_handle(handle, problem, error)
         if (.not. allocated(error)) call describe_cells(problem, kind, visitor%document)
      case ('build')
         call find_build(handle, build, error)
         if (.not. allocated(error)) call describe_build(build, visitor%document)
      case ('indentation')
         call model_of_handle(handle, model, error)
         if (.not. allocated(error)) call describe_model(model, visitor)
      case default
         call describe_surrogate_object(handle, kind, visitor, error)
      end select
   end subroutine describe_object

   !> The document of a build that was concluded, else what is to be said of it so far.
   subroutine describe_build(build, document)
      type(build_type), intent(in) :: build
      type(json_type), intent(inout) :: document

      if (allocated(build%document)) then
         call document%put_json('', build%document)
      else
         call document%begin_object()
         call document%put('warnings', build%warnings)
         call document%end_object()
      end if
   end subroutine describe_build

   !> `schema`, the variables: group, its meaning, name, type, number of values, unit, default, allowed, meaning; and `stages`, the
   !> commands: name, groups, file of its document, summary, description; and `modulus_kinds`, the names.
   subroutine describe_settings(document)
      type(json_type), intent(inout) :: document
      character(len=9), parameter :: shapes(3) = [character(len=9) :: 'one', 'constants', 'list']
      type(schema_type) :: schema
      integer :: i

      schema = new_schema(all_choices())
      call document%begin_object()
      call document%begin_array('schema')
      do i = 1, size(schema%variables)
         associate (v => schema%variables(i))
            call document%begin_array()
            call document%put('', v%group)
            call document%put('', schema%groups(schema%find_group(v%group))%meaning)
            call document%put('', v%name)
            call document%put('', trim(kind_names(v%kind)))
            call document%put('', trim(shapes(v%shape)))
            call document%put('', v%unit)
            call document%put('', v%default)
            call document%put('', allowed_in_words(v))
            call document%put('', v%meaning)
            call document%end_array()
         end associate
      end do
      call document%end_array()
      call document%put('modulus_kinds', observable_names)
      call document%begin_array('stages')
      call put_stage(run_command)
      do i = 1, size(all_stages)
         call put_stage(all_stages(i))
      end do
      call document%end_array()
      call document%end_object()

   contains

      subroutine put_stage(stage)
         type(stage_type), intent(in) :: stage

         call document%begin_array()
         call document%put('', trim(stage%name))
         call document%put('', trim(stage%groups))
         call document%put('', trim(stage%document))
         call document%put('', trim(stage%summary))
         call document%put('', trim(stage%description))
         call document%end_array()
      end subroutine put_stage
   end subroutine describe_settings

   !> The settings, resolved and with every group as `values`, the identity of the physics, and the tables; of a table alone that.
   subroutine describe_problem(self, visitor)
      type(problem_type), intent(in) :: self
      type(described_values_type), intent(inout) :: visitor
      type(schema_type) :: schema
      type(error_type), allocatable :: error
      character(len=:), allocatable :: groups
      integer, allocatable :: pairs(:, :)
      integer :: i

      call visitor%document%begin_object()
      if (allocated(self%path) .and. .not. allocated(visitor%wanted)) then
         schema = new_schema(all_choices())
         groups = ''
         do i = 1, size(schema%groups)
            groups = groups//' '//schema%groups(i)%name
         end do
         call visitor%document%put('resolved', self%resolved_text())
         call visitor%document%put('values', settings_namelist(self%settings, groups))
         call visitor%document%put('warnings', self%warnings)
         call visitor%document%put('groups', self%groups)
         call visitor%document%put('stages', self%stages)
         call read_scan(self%settings%surrogate%scan, pairs, error)
         call visitor%document%put('scan', transpose(real(pairs, wp)))
         call visitor%document%put_json('physics', identity_text(self%settings))
      end if
      if (allocated(self%spreadsheet)) call visitor%document%put('spreadsheet', self%spreadsheet)
      if (allocated(self%indents)) then
         call visitor%document%put('map', self%map)
         call visitor%array('indents_um', size(self%positions), self%positions)
         if (.not. allocated(visitor%wanted)) then
            call visitor%document%begin_array('indents_columns')
            do i = 1, self%indents%columns
               call visitor%document%put('', self%indents%called(i))
            end do
            call visitor%document%end_array()
         end if
      end if
      call describe_points('crystals', self%crystals, visitor)
      call describe_points('measurements', self%measurements, visitor)
      call describe_points('candidates', self%candidates, visitor)
      call describe_points('grains', self%grains, visitor)
      if (allocated(self%stiffness) .and. .not. allocated(visitor%wanted)) call put_cells('stiffness', self%stiffness%table, &
         & visitor%document)
      call visitor%document%end_object()
   end subroutine describe_problem

   !> The numbers of a table; the classes of its rows, and which each row has.
   subroutine describe_points(name, points, visitor)
      character(len=*), intent(in) :: name
      type(points_type), allocatable, intent(in) :: points
      type(described_values_type), intent(inout) :: visitor
      integer :: i

      if (.not. allocated(points)) return
      call visitor%array(name//'_euler_deg', size(points%euler_deg), points%euler_deg)
      call visitor%array(name//'_modulus_gpa', points%n, points%modulus_gpa)
      call visitor%array(name//'_sd_gpa', points%n, points%sd_gpa)
      if (allocated(points%constants)) then
         call visitor%array(name//'_constants', size(points%constants), points%constants)
         call visitor%array(name//'_stiffness', size(points%stiffness), points%stiffness)
      end if
      if (allocated(points%class)) call visitor%array(name//'_class', points%n, real(points%class, wp))
      if (allocated(visitor%wanted)) return
      if (allocated(points%modulus_kind)) call visitor%document%put(name//'_modulus_kind', points%modulus_kind)
      call visitor%document%begin_array(name//'_classes')
      if (allocated(points%class)) then
         do i = 1, size(points%classes)
            call visitor%document%put('', points%classes(i)%name)
         end do
      end if
      call visitor%document%end_array()
      if (points%named_by > 0) then
         call visitor%document%begin_array(name//'_names')
         do i = 1, points%n
            call visitor%document%put('', points%name(i))
         end do
         call visitor%document%end_array()
      end if
   end subroutine describe_points

   !> The cells of a table of a problem: 'crystals', 'measurements', 'candidates' or 'grains'.
   subroutine describe_cells(self, name, document)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: name
      type(json_type), intent(inout) :: document

      select case (name)
      case ('crystals')
         call put_cells('', self%crystals%table, document)
      case ('measurements')
         call put_cells('', self%measurements%table, document)
      case ('grains')
         call put_cells('', self%grains%table, document)
      case default
         call put_cells('', self%candidates%table, document)
      end select
   end subroutine describe_cells

   !> The cells of a table as rows, the header first.
   subroutine put_cells(name, table, document)
      character(len=*), intent(in) :: name
      type(table_type), intent(in) :: table
      type(json_type), intent(inout) :: document
      integer :: i, j

      call document%begin_array(name)
      do i = 0, table%rows
         call document%begin_array()
         do j = 1, table%columns
            call document%put('', table%cell(j, i))
         end do
         call document%end_array()
      end do
      call document%end_array()
   end subroutine put_cells

   !> Sizes and costs, summed over the meshes; of the finest mesh the nodes (um), and tables of nodes counted from 1.
   subroutine describe_model(model, visitor)
      type(indentation_model_type), intent(in) :: model
      type(described_values_type), intent(inout) :: visitor

      call visitor%document%begin_object()
      call visitor%document%put('element', model%element)
      call visitor%document%put('elements', model%elements)
      call visitor%document%put('depths', size(model%depth))
      call visitor%document%put('depth_max_um', model%indenter%depth)
      call visitor%document%put('contact_radius_max_um', model%indenter%contact_radius)
      call visitor%document%put('meshes', size(model%grid))
      call visitor%document%put('factor_entries', sum(model%grid%cholesky%entries))
      call visitor%document%put('factor_operations', sum(model%grid%cholesky%operations))
      call visitor%document%put('workspace_bytes', sum(model%grid%cholesky%bytes))
      call visitor%document%put('unknowns', model%grid(1)%assembly%unknowns)
      associate (mesh => model%grid(1)%mesh)
         call visitor%document%put('nodes', size(mesh%x, 2))
         call visitor%document%put('bricks', size(mesh%brick, 2))
         call visitor%document%put('infinite_elements', size(mesh%facet, 2))
         call visitor%document%put('materials', max(maxval(mesh%material), maxval([1, mesh%facet_material])))
         call visitor%document%put('contact_nodes', size(mesh%contact))
         call visitor%array('x', size(mesh%x), mesh%x)
         call visitor%array('gap', size(mesh%contact), model%grid(1)%gap)
         call visitor%array('brick', size(mesh%brick), real(mesh%brick, wp))
         call visitor%array('material', size(mesh%material), real(mesh%material, wp))
         call visitor%array('facet', size(mesh%facet), real(mesh%facet, wp))
         call visitor%array('contact', size(mesh%contact), real(mesh%contact, wp))
         call visitor%array('clamped', size(mesh%clamped), real(mesh%clamped, wp))
         call visitor%array('hanging', size(mesh%hanging), real(mesh%hanging, wp))
         call visitor%array('masters', size(mesh%hanging), real(mesh%masters, wp))
         call visitor%array('master', size(mesh%master), real(mesh%master, wp))
      end associate
      call visitor%document%end_object()
   end subroutine describe_model
end module object_documents
