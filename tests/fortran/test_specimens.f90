!> Specimens by name: what any of them obeys, and the sizes of blocks.
program test_specimens
   use basic_specimen, only: mesh_plan_type, specimen_type
   use crystal_elasticity, only: isotropic_stiffness, rotate_stiffness, rotation_matrix
   use errors, only: error_type
   use fe_indentation, only: free_indentation_model, indentation_model_type, &
      & indentation_result_type, new_indentation_model, simulate_indentation
   use fe_mesh, only: mesh_type, new_mesh
   use indenters, only: indenter_type
   use kinds, only: wp
   use linear_algebra, only: symmetric_eigen
   use namelist_file, only: entry_type, parse_namelist
   use settings_list, only: settings_list_type, variable_type
   use settings_reader, only: read_settings
   use settings_schema, only: list_settings, settings_type
   use specimens, only: geometry_names, new_indentation
   use testing, only: check, check_close, check_refused, check_success, default_settings, finish, &
      & stiffness_of
   use text, only: number_ok, read_real, split_list, to_text
   implicit none

   !> Parts of a namelist: the end of &specimen and the size of the contact; few depths.
   character(len=*), parameter :: contact = ' / &indenter contact_radius_um = 2 /'
   character(len=*), parameter :: few = ' &simulation depths = 3, extrapolate = f /'

   call test_specimens_by_name()
   call test_blocks()
   call finish()

contains

   !> The list comes from the module, and the choices of each specimen from the schema.
   subroutine test_specimens_by_name()
      character(len=len(geometry_names)), allocatable :: names(:)
      character(len=:), allocatable :: words(:), group
      class(specimen_type), allocatable :: specimen
      class(indenter_type), allocatable :: indenter
      type(settings_list_type) :: schema
      type(settings_type) :: settings
      type(error_type), allocatable :: error
      integer :: i, j, k

      allocate (names, source=split_list(geometry_names))
      do i = 1, size(names)
         group = "&specimen estimator = 'curve', geometry = '"//trim(names(i))//"'"
         call test_any_specimen(group)
         call read_complete(group, contact, settings)
         call new_indentation(settings, indenter, specimen, error)
         schema = list_settings(settings)
         do j = 1, size(schema%variables)
            associate (v => schema%variables(j))
               if (v%group /= 'specimen' .or. v%kind /= 'choice') cycle
               if (.not. is_named(specimen, v%name)) cycle
               allocate (words, source=split_list(v%allowed))
               do k = 1, size(words)
                  if (trim(words(k)) == "'"//v%default//"'") cycle
                  call test_any_specimen(group//', '//v%name//' = '//trim(words(k)))
               end do
               deallocate (words)
            end associate
         end do
      end do
      settings%specimen%geometry = 'dome'
      call new_indentation(settings, indenter, specimen, error)
      call check_refused('an unknown specimen', error, &
         & "geometry: 'dome' has no mesh; allowed: "//geometry_names)
   end subroutine test_specimens_by_name

   !> What any specimen does, for each word of the choices that it reads. Nodes lie under the
   !> contact, and either infinite elements or clamped nodes hold the mesh. A simulation that runs
   !> twice gives the same bits. The force grows with the depth. An isotropic crystal has one
   !> modulus in every orientation. Four times the stiffness of all materials is four times the
   !> modulus and the forces. The derivatives of the modulus by the stiffness of each material,
   !> contracted with that stiffness, add up to the modulus. If no material has a stiffness of its
   !> own, the derivative by the crystal alone does so; else it gives a part. This derivative is the
   !> change of the modulus with the crystal, and a stiffer crystal does not lower the modulus. The
   !> modulus depends on the size of the contact only if the specimen has a length of its own.
   subroutine test_any_specimen(group)
      !> The beginning of &specimen.
      character(len=*), intent(in) :: group
      real(wp), parameter :: euler(3) = [0.3_wp, 0.7_wp, 1.9_wp], step = 5.0e-3_wp, &
         & turned(3) = [2.0_wp, 1.2_wp, 0.4_wp]
      !> The factor of the matrix is in single precision; powers of 4 do not change its rounding.
      real(wp), parameter :: rounding = 1.0e-5_wp
      type(settings_type) :: settings
      type(indentation_model_type) :: model
      type(indentation_result_type) :: base, other, near(2)
      type(error_type), allocatable :: error
      real(wp) :: crystal(6, 6), change(6, 6), values(6), part
      character(len=:), allocatable :: name
      integer :: i

      name = 'any '//group(index(group, 'geometry'):)//': '
      crystal = stiffness_of('cubic', [168.4_wp, 121.4_wp, 75.4_wp])
      call read_complete(group, contact//few, settings)
      call coarsen(settings)
      call new_indentation_model(settings, model, error)
      call check_success(name//'a model', error)
      if (allocated(error)) return
      associate (mesh => model%grid(1)%mesh)
         call check(name//'nodes under the contact, and something that holds the mesh', &
            & size(mesh%contact) > 50 &
            & .and. (size(mesh%facet, 2) > 0 .neqv. size(mesh%clamped) > 0))
      end associate
      call run(model, crystal, euler, base)
      call run(model, crystal, euler, other)
      call check(name//'the same bits', all(base%force == other%force) &
         & .and. base%modulus == other%modulus .and. all(base%by_stiffness == other%by_stiffness))
      call check(name//'the force grows with the depth', base%force(1) > 0.0_wp &
         & .and. all(base%force(2:) > base%force(:size(base%force) - 1)))
      do i = 1, 2
         call run(model, isotropic_stiffness(150.0_wp, 0.3_wp), &
            & merge(euler, turned, i == 1), near(i))
      end do
      call check_close(name//'an isotropic crystal has no orientation', &
         & near(2)%modulus/near(1)%modulus, 1.0_wp, rounding)
      call check_close(name//'the derivatives add up to the modulus', sum(base%by_material &
         & *model%specimen%materials(rotate_stiffness(crystal, rotation_matrix(euler)))) &
         & /base%modulus, 1.0_wp, 1.0e-10_wp)
      part = sum(base%by_stiffness*crystal)/base%modulus
      if (model%specimen%young > 0.0_wp) then
         call check(name//'the crystal has a part of the modulus', part > 0.1_wp &
            & .and. part < 0.999_wp, to_text(part))
      else
         call check_close(name//'so does the derivative by the crystal', part, 1.0_wp, 1.0e-10_wp)
      end if
      change = reshape([(sin(1.7_wp*i), i=1, 36)], [6, 6])
      change = step*norm2(crystal)*(change + transpose(change))
      do i = 1, 2
         call run(model, crystal + (2*i - 3)*change, euler, near(i))
      end do
      part = sum(base%by_stiffness*change)
      ! The derivative is that with the same nodes in contact.
      call check_close(name//'the derivative is the change', &
         & 0.5_wp*(near(2)%modulus - near(1)%modulus)/part, 1.0_wp, 0.06_wp)
      change = 0.5_wp*(base%by_stiffness + transpose(base%by_stiffness))
      call symmetric_eigen(change, values, error)
      call check(name//'a stiffer crystal does not lower the modulus', &
         & values(1) > -1.0e-9_wp*values(6), to_text(values(1)))
      model%specimen%young = 4.0_wp*model%specimen%young
      call run(model, 4.0_wp*crystal, euler, other)
      call check_close(name//'four times the modulus', other%modulus/base%modulus, 4.0_wp, &
         & 1.0e-10_wp)
      call check_close(name//'four times the forces', &
         & maxval(abs(other%force/base%force - 4.0_wp)), 0.0_wp, 1.0e-10_wp)
      call free_indentation_model(model)
      call read_complete(group, &
         & ' / &indenter radius_um = 4, contact_radius_um = 0.5 /'//few, settings)
      call coarsen(settings)
      call new_indentation_model(settings, model, error)
      call check_success(name//'a smaller contact', error)
      call run(model, crystal, euler, other)
      call check(name//'the size of the contact counts if there is a length', &
         & abs(other%modulus/base%modulus - 1.0_wp) > 1.0e-9_wp &
         & .eqv. model%specimen%has_length, to_text(other%modulus/base%modulus, 15))
      call free_indentation_model(model)
      call test_names_of_variables(group, name)
   end subroutine test_any_specimen

   !> Use the coarsest mesh that is allowed: of 5 elements over the contact radius.
   subroutine coarsen(settings)
      type(settings_type), intent(inout) :: settings
      class(specimen_type), allocatable :: specimen
      class(indenter_type), allocatable :: indenter
      type(error_type), allocatable :: error

      call new_indentation(settings, indenter, specimen, error)
      if (allocated(error)) return
      settings%simulation%refine = 5.05_wp*specimen%element_size/specimen%contact_radius
   end subroutine coarsen

   !> Indent a crystal.
   subroutine run(model, stiffness, euler, result)
      type(indentation_model_type), intent(in) :: model
      !> GPa, and radians.
      real(wp), intent(in) :: stiffness(6, 6), euler(3)
      type(indentation_result_type), intent(out) :: result
      type(error_type), allocatable :: error

      call simulate_indentation(model, stiffness, euler, result, error)
      if (allocated(error)) call check_success('a simulation', error)
   end subroutine run

   !> The numbers of &specimen and &simulation that change the mesh or the materials of a specimen
   !> are those that it names: otherwise different simulations would have the same identity.
   subroutine test_names_of_variables(group, name)
      !> The beginning of &specimen, and of the messages.
      character(len=*), intent(in) :: group, name
      class(specimen_type), allocatable :: specimen, other
      class(indenter_type), allocatable :: indenter
      type(settings_list_type) :: schema
      type(settings_type) :: settings
      type(error_type), allocatable :: error
      character(len=:), allocatable :: stated
      integer :: i

      call read_complete(group, contact, settings)
      call new_indentation(settings, indenter, specimen, error)
      schema = list_settings(settings)
      do i = 1, size(schema%variables)
         associate (v => schema%variables(i))
            if (v%kind /= 'real' .or. v%shape /= 'one' .or. v%name == 'refine' &
               & .or. all(['specimen  ', 'simulation'] /= v%group)) cycle
            stated = v%name//' = '//to_text(changed(v))
            if (v%group == 'specimen') then
               call read_complete(group//', '//stated, contact, settings)
            else
               call read_complete(group, contact//' &simulation '//stated//' /', settings)
            end if
            call new_indentation(settings, indenter, other, error)
            call check_success(name//v%name, error)
            call check(name//v%name//' is named if it counts', is_named(specimen, v%name) .eqv. &
               & differ(specimen, other))
         end associate
      end do
   end subroutine test_names_of_variables

   !> A value other than the default.
   real(wp) function changed(variable)
      type(variable_type), intent(in) :: variable
      integer :: outcome

      call read_real(variable%default, changed, outcome)
      if (outcome /= number_ok) changed = value_for(variable)
      changed = 1.2_wp*changed
   end function changed

   !> A value of a variable that suits a contact of radius 2 um.
   real(wp) function value_for(variable)
      type(variable_type), intent(in) :: variable
      real(wp) :: low, high
      integer :: outcome(2)

      select case (variable%unit)
      case ('um')
         value_for = 8.0_wp
      case ('GPa')
         value_for = 100.0_wp
      case default
         ! 'LOW to HIGH'.
         associate (allowed => variable%allowed)
            call read_real(allowed(:index(allowed, ' ') - 1), low, outcome(1))
            call read_real(allowed(index(allowed, ' ', back=.true.) + 1:), high, outcome(2))
         end associate
         value_for = 0.25_wp
         if (all(outcome == number_ok)) value_for = low + 0.25_wp*(high - low)
      end select
   end function value_for

   !> Whether mesh or materials of two specimens differ.
   logical function differ(first, second)
      class(specimen_type), intent(in) :: first, second
      type(mesh_plan_type) :: plans(2)
      real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp]

      plans(1) = first%plan(1.0_wp)
      plans(2) = second%plan(1.0_wp)
      differ = size(plans(1)%stages) /= size(plans(2)%stages) &
         & .or. plans(1)%half_cells /= plans(2)%half_cells &
         & .or. plans(1)%depth_cells /= plans(2)%depth_cells
      if (differ) return
      differ = any(plans(1)%stages%layers /= plans(2)%stages%layers) &
         & .or. any(abs(plans(1)%stages%growth - plans(2)%stages%growth) > 0.0_wp) &
         & .or. any(abs(plans(1)%stages%ratio - plans(2)%stages%ratio) > 0.0_wp) &
         & .or. any(abs(plans(1)%stages%radius - plans(2)%stages%radius) > 0.0_wp) &
         & .or. abs(plans(1)%half_width - plans(2)%half_width) > 0.0_wp &
         & .or. abs(plans(1)%depth - plans(2)%depth) > 0.0_wp &
         & .or. any(abs(first%materials(stiffness_of('cubic', copper)) &
         & - second%materials(stiffness_of('cubic', copper))) > 0.0_wp)
   end function differ

   !> Whether a specimen names a variable as its own.
   logical function is_named(specimen, variable)
      class(specimen_type), intent(in) :: specimen
      character(len=*), intent(in) :: variable

      is_named = index(', '//specimen%variables//',', ', '//variable//',') > 0
   end function is_named

   !> Settings of a namelist, with values for what the specimen misses.
   subroutine read_complete(group, rest, settings)
      !> The beginning of &specimen, and the end of the namelist from its end on.
      character(len=*), intent(in) :: group, rest
      type(settings_type), intent(out) :: settings
      class(specimen_type), allocatable :: specimen
      class(indenter_type), allocatable :: indenter
      type(entry_type), allocatable :: file(:)
      type(settings_list_type) :: schema
      type(error_type), allocatable :: error
      character(len=:), allocatable :: more
      integer :: i

      more = ''
      do
         call parse_namelist(group//more//rest, file, error)
         if (.not. allocated(error)) call read_settings(file, '', '', settings, error)
         if (allocated(error)) call check_success(group//more//rest, error)
         call new_indentation(settings, indenter, specimen, error)
         if (.not. allocated(error)) return
         if (index(error%message, 'the variable is missing') == 0) return
         schema = list_settings(settings)
         do i = 1, size(schema%variables)
            associate (v => schema%variables(i))
               if (v%group == error%group .and. v%name == error%variable) then
                  more = more//', '//v%name//' = '//to_text(value_for(v))
               end if
            end associate
         end do
      end do
   end subroutine read_complete

   !> The default block is the paper's; others have their size, bricks of nearly equal edges under
   !> the contact, and layers that grow alike.
   subroutine test_blocks()
      !> Width, height, contact radius, um, and bricks.
      real(wp), parameter :: blocks(4, &
         & 4) = reshape([9.6_wp, 4.8_wp, 0.5_wp, 12400.0_wp, 9.6_wp, 19.2_wp, 0.5_wp, 41200.0_wp, &
         & 100.0_wp, 25.0_wp, 2.0_wp, 10000.0_wp, 4.0_wp, 2.0_wp, 1.0_wp, 6400.0_wp], [4, 4])
      class(specimen_type), allocatable :: specimen
      class(indenter_type), allocatable :: indenter
      type(settings_type) :: settings
      type(mesh_type) :: mesh
      type(error_type), allocatable :: error
      integer :: i

      settings = default_settings()
      settings%specimen%geometry = 'block'
      do i = 1, size(blocks, 2)
         settings%specimen%width_um = blocks(1, i)
         settings%specimen%height_um = blocks(2, i)
         settings%indenter%contact_radius_um = blocks(3, i)
         call new_indentation(settings, indenter, specimen, error)
         call check_success('block', error)
         call check('it has a length', specimen%has_length)
         call new_mesh(specimen%plan(1.0_wp), mesh, error)
         call check_success('its mesh', error)
         associate (x => mesh%x, first => mesh%brick(:, 1))
            call check_close('its width', maxval(x(1, :)) - minval(x(2, :)), blocks(1, i), &
               & 1.0e-12_wp*blocks(1, i))
            call check_close('its height', maxval(x(3, :)) - minval(x(3, :)), blocks(2, i), &
               & 1.0e-12_wp*blocks(2, i))
            call check_close('bricks as high as wide', &
               & (x(3, first(5)) - x(3, first(1)))/mesh%element_size, 1.0_wp, 1.0e-9_wp)
            call check('clamped at the bottom', &
               & all(abs(x(3, mesh%clamped) + blocks(2, i)) < 1.0e-9_wp))
         end associate
         call check_close('elements to the contact radius', blocks(3, i)/mesh%element_size, &
            & 1.0_wp/0.13_wp, 1.0e-9_wp)
         call check('bricks', size(mesh%brick, 2) == nint(blocks(4, i)), &
            & to_text(size(mesh%brick, 2)))
      end do
      settings%indenter%contact_radius_um = 1.1_wp
      call new_indentation(settings, indenter, specimen, error)
      call check_refused('a contact too large for the block', error, &
         & 'width_um: 4.0 um is too narrow for a contact radius of 1.1 um; allowed from 4.4 um')
      settings%specimen%height_um = 8.1_wp
      settings%indenter%contact_radius_um = 0.5_wp
      call new_indentation(settings, indenter, specimen, error)
      call check_refused('a pillar', error, &
         & 'height_um: 8.1 um does not go with width_um = 4.0; allowed 0.5 to 8.0 um')
   end subroutine test_blocks
end program test_specimens
