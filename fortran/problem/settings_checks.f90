!> Checks of the settings against each other.
module settings_checks
   use crystal_class, only: crystal_class_names, crystal_class_type
   use crystal_elasticity, only: is_stable
   use errors, only: error_type, refuse
   use kinds, only: wp
   use settings_list, only: settings_list_type
   use settings_schema, only: list_settings, settings_type
   use text, only: join, to_text
   implicit none
   private
   public :: check_settings, check_speeds

contains

   !> Refuse settings that contradict each other.
   subroutine check_settings(settings, class, error)
      type(settings_type), intent(in) :: settings
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      logical :: needs_symmetry

      call check_bounds('domain', settings%domain%c_min, settings%domain%c_max)
      call check_bounds('prior', settings%prior%c_min, settings%prior%c_max)
      call check_count('problem', 'reference_gpa', settings%problem%reference_gpa)
      ! Only a surrogate for all crystal classes needs no symmetry.
      needs_symmetry = settings%measurements%given .or. settings%prior%given &
         & .or. settings%plan%given .or. (settings%surrogate%model == 'paper' &
         & .and. (settings%design%given .or. settings%domain%given))
      call check(error, needs_symmetry .and. .not. allocated(settings%problem%symmetry), &
         & 'problem', 'symmetry', 'the variable is missing; allowed '//crystal_class_names())
      if (settings%plan%given) then
         call check_count('plan', 'constants', settings%plan%constants)
         if (allocated(error)) return
         call check(error, any(abs(settings%plan%grains - anint(settings%plan%grains)) > 0.0_wp), &
            & 'plan', 'grains', 'a number of grains is not an integer; allowed 1 to 10000')
         call check(error, .not. is_stable(class%stiffness(settings%plan%constants)), 'plan', &
            & 'constants', 'the crystal is not elastically stable; the stiffness must be ' &
            & //'positive definite')
      end if
      call check_lists('knowledge', [character(len=8) :: 'quantity', 'mean', 'sd'])
      if (allocated(settings%knowledge%source)) then
         call check_lists('knowledge', [character(len=8) :: 'quantity', 'source'])
      end if
      call check_lists('references', &
         & [character(len=12) :: 'name', 'young_gpa', 'young_sd_gpa', 'nu'])
      if (.not. allocated(error)) call check_combinations(settings, error)

   contains

      !> Refuse bounds unless c_min is below c_max, or equal to it in &prior, and some crystal
      !> between them is stable. Either bound may be absent.
      subroutine check_bounds(group, low, high)
         character(len=*), intent(in) :: group
         !> Bounds of each constant, GPa.
         real(wp), allocatable, intent(in) :: low(:), high(:)
         real(wp), allocatable :: best(:)
         integer :: i

         call check_count(group, 'c_min', low)
         call check_count(group, 'c_max', high)
         if (allocated(error) .or. .not. (allocated(low) .and. allocated(high))) return
         ! A prior whose bounds are equal fixes a constant.
         i = findloc(low > high .or. (group == 'domain' .and. .not. low < high), .true., dim=1)
         if (i > 0) then
            call check(error, .true., group, 'c_min', 'the lower bound of '//class%constants(i) &
               & //', ' //to_text(low(i))//' GPa, is not below the upper one, '//to_text(high(i)) &
               & //' GPa')
            return
         end if
         ! The most stable crystal: large constants on the diagonal, small ones off it.
         best = merge(high, max(low, min(high, 0.0_wp)), &
            & class%constants(:)(2:2) == class%constants(:)(3:3))
         call check(error, .not. is_stable(class%stiffness(best)), group, 'c_max', &
            & 'no crystal between ' &
            & //'c_min and c_max is elastically stable; the stiffness must be positive definite')
      end subroutine check_bounds

      !> Refuse values unless there is one for each constant, or none at all.
      subroutine check_count(group, name, values)
         character(len=*), intent(in) :: group, name
         real(wp), allocatable, intent(in) :: values(:)
         character(len=:), allocatable :: found

         if (.not. allocated(values)) return
         found = to_text(size(values))//' values'
         if (size(values) == 1) found = 'one value'
         if (class%n_constants == 0) then
            call check(error, .true., group, name, &
               & 'a value for each constant is needed, and so &problem symmetry')
         else
            call check(error, size(values) /= size(class%constants), group, name, found//'; ' &
               & //to_text(class%n_constants)//' are needed: '//join(class%constants, ', '))
         end if
      end subroutine check_count

      !> Refuse lists of a group unless all have the same length, or all are absent.
      subroutine check_lists(group, names)
         !> Names of the group and of its variables.
         character(len=*), intent(in) :: group, names(:)
         type(settings_list_type) :: list
         integer :: sizes(size(names)), i, j

         sizes = 0
         list = list_settings(settings)
         do i = 1, size(list%variables)
            associate (v => list%variables(i))
               if (v%group /= group .or. .not. allocated(v%values)) cycle
               where (names == v%name) sizes = size(v%values)
            end associate
         end do
         i = maxloc(sizes, dim=1)
         j = findloc(sizes == sizes(i), .false., dim=1)
         if (j == 0) return
         call check(error, sizes(j) == 0, group, trim(names(j)), 'the variable is missing; ' &
            & //trim(names(i))//' needs it')
         call check(error, .true., group, trim(names(j)), 'the number of values is ' &
            & //to_text(sizes(j))//', that of '//trim(names(i))//' is '//to_text(sizes(i)) &
            & //'; each '//trim(names(1))//' needs '//join(names(2:), ', '))
      end subroutine check_lists
   end subroutine check_settings

   !> Refuse speeds, measured or planned, that cannot be computed.
   subroutine check_speeds(settings, has_velocities, error)
      type(settings_type), intent(in) :: settings
      !> Whether there are measured speeds, in a file or in a table of Python.
      logical, intent(in) :: has_velocities
      type(error_type), allocatable, intent(out) :: error
      !> Variables that need computed speeds, and their groups.
      character(len=*), parameter :: names(3) = [character(len=14) :: 'velocities', &
         & 'velocity_cost', 'velocity_noise'], &
         & groups(3) = [character(len=12) :: 'measurements', 'next', 'plan']
      integer :: k

      k = findloc([has_velocities, allocated(settings%next%velocity_cost), &
         & allocated(settings%plan%velocity_noise)], .true., 1)
      if (k == 0) return
      associate (geometry => settings%specimen%geometry)
         if (has_velocities .and. settings%measurements%orientations == 'unknown') then
            call refuse(error, '''unknown'' cannot be combined with velocities; remove one of ' &
               & //'them', 'measurements', 'orientations')
         else if (geometry /= 'halfspace' .and. geometry /= 'block') then
            call refuse(error, 'speeds are computed for a bulk sample, but geometry is ''' &
               & //geometry//'''; remove '//trim(names(k)) &
               & //', or infer the constants from speeds and moduli of a bulk sample', &
               & trim(groups(k)), trim(names(k)))
         else if (.not. allocated(settings%problem%density_kg_m3)) then
            call refuse(error, 'the variable is missing; &'//trim(groups(k))//' '//trim(names(k)) &
               & //' needs it (allowed 10 to 1e5 kg/m3)', 'problem', 'density_kg_m3')
         end if
      end associate
   end subroutine check_speeds

   !> Refuse variables that contradict each other.
   subroutine check_combinations(settings, error)
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error
      !> Settings that exclude orientations = 'unknown': they need orientations, or have errors that
      !> are not integrated over the orientations; the last is none.
      character(len=*), parameter :: needs_known(6) = [character(len=20) :: 'ebsd', &
         & 'misalignment_sd_deg', 'orientation_sd_deg', 'likelihood', &
         & 'scale = ''inferred''', '']
      integer :: k
      logical :: is_stated(size(needs_known))

      associate (curves => settings%curves, design => settings%design, &
         & indenter => settings%indenter, measured => settings%measurements)
         call check(error, curves%given .and. (allocated(curves%file) .eqv. &
            & allocated(curves%files)), 'curves', 'file', &
            & 'one of file, a CSV of curves, and files, those of an instrument, is needed')
         call check(error, allocated(measured%ebsd_points) .and. .not. allocated(measured%ebsd), &
            & 'measurements', 'ebsd', 'the variable is missing; ebsd_points needs it')
         call check(error, allocated(measured%crystal_axes) .and. .not. allocated(measured%ebsd), &
            & 'measurements', 'crystal_axes', 'is only for ebsd, an orientation map; remove it. ' &
            & //'docs/measurements.md has the axes that the angles of a table refer to')
         call check(error, allocated(measured%texture) .and. measured%orientations /= 'unknown', &
            & 'measurements', 'texture', 'is only for grains of unknown orientation; state ' &
            & //'orientations = ''unknown'', or remove it')
         call check(error, abs(measured%student_dof - 4.0_wp) > 0.0_wp &
            & .and. measured%likelihood /= 'student', 'measurements', 'student_dof', &
            & 'is only for likelihood = ''student''; state that, or remove it')
         ! The first stated variable that needs orientations.
         is_stated(:2) = [allocated(measured%ebsd), measured%misalignment_sd_deg > 0.0_wp]
         is_stated(3:) = [ &
            & measured%orientation_sd_deg > 0.0_wp, measured%likelihood /= 'normal', &
            & measured%scale == 'inferred', .true.]
         k = findloc(is_stated, .true., 1)
         call check(error, measured%orientations == 'unknown' .and. k < size(needs_known), &
            & 'measurements', 'orientations', '''unknown'' cannot be combined with ' &
            & //trim(needs_known(k))//'; remove one of them')
         if (.not. allocated(error)) then
            call check_speeds(settings, allocated(measured%velocities), error)
         end if
         call check(error, allocated(indenter%depth_um) .and. &
            & allocated(indenter%contact_radius_um), 'indenter', 'depth_um', &
            & 'the last point is stated twice, by depth_um and by ' &
            & //'contact_radius_um; one of them is allowed')
         if (.not. allocated(error)) call check_specimen(settings, error)
         call check(error, allocated(settings%knowledge%stiffness_relative_sd) &
            & .and. .not. allocated(settings%knowledge%stiffness_file), 'knowledge', &
            & 'stiffness_relative_sd', 'is only for stiffness_file; state that, or remove it')
         call check(error, design%initial > design%budget, 'design', 'initial', &
            & to_text(design%initial) //' is more than the budget; allowed 0 to ' &
            & //to_text(design%budget))
         call check(error, design%candidates == 'latin' .and. design%n_candidates < design%budget, &
            & 'design', 'budget', to_text(design%budget) &
            & //' is more than n_candidates; allowed 1 to '//to_text(design%n_candidates))
      end associate

   end subroutine check_combinations

   !> Refuse variables that do not go with the geometry of the specimen.
   subroutine check_specimen(settings, error)
      type(settings_type), intent(in) :: settings
      type(error_type), allocatable, intent(out) :: error
      !> Groups of a build.
      character(len=*), parameter :: build_groups(3) = [character(len=9) :: 'design', 'domain', &
         & 'surrogate']
      !> Variables of one geometry alone.
      character(len=*), parameter :: of_geometry(8) = [character(len=19) :: 'grain_radius_um', &
         & 'matrix_young_gpa', 'thickness_um', 'substrate_young_gpa', 'substrate_symmetry', &
         & 'substrate_constants', 'substrate_euler_deg', 'layers']
      character(len=5) :: needed(size(of_geometry))
      logical :: is_stated(size(of_geometry))
      integer :: k

      associate (stated => settings%specimen, geometry => settings%specimen%geometry)
         call check(error, len(stated%estimator) == 0 .and. settings%measurements%given .and. &
            & geometry /= 'halfspace' .and. geometry /= 'block', 'specimen', 'estimator', &
            & 'the variable is missing; how does ' &
            & //'the instrument compute the modulus? Allowed: ''curve'' (fit of force against ' &
            & //'depth^1.5), ''stiffness'' (S/(2 a), S the contact stiffness dP/dh, a the ' &
            & //'true contact radius), ''stiffness_hertz'' (S/(2 a), a = sqrt(R h))')
         needed(:2) = 'grain'
         needed(3:) = 'film'
         is_stated(:3) = [allocated(stated%grain_radius_um), &
            & allocated(stated%matrix_young_gpa), allocated(stated%thickness_um)]
         is_stated(4:6) = [allocated(stated%substrate_young_gpa), &
            & allocated(stated%substrate_symmetry), allocated(stated%substrate_constants)]
         is_stated(7:) = [allocated(stated%substrate_euler_deg), allocated(stated%layers)]
         k = findloc(is_stated .and. needed /= geometry, .true., 1)
         call check(error, k > 0, 'specimen', trim(of_geometry(max(1, k))), &
            & 'is only for geometry = '''//trim(needed(max(1, k)))//'''; state that, or remove it')
         k = findloc([settings%design%given, settings%domain%given, settings%surrogate%given], &
            & .true., 1)
         call check(error, geometry == 'film' .and. k > 0, trim(build_groups(max(1, k))), '', &
            & 'a film needs no simulations and no surrogate of yours: extract computes it by ' &
            & //'theory; remove the group')
         call check(error, settings%surrogate%file == 'halfspace' .and. &
            & (settings%measurements%given .or. settings%plan%given) .and. geometry /= &
            & 'halfspace', 'surrogate', 'file', &
            & '''halfspace'' is the theory of a bulk sample, but geometry ' //'is '''//geometry &
            & //'''; state &design to train a surrogate of it, or the name of one')
      end associate
   end subroutine check_specimen

   !> Refuse the value of a variable if it is `wrong`, unless another one was refused.
   subroutine check(error, wrong, group, name, message)
      type(error_type), allocatable, intent(inout) :: error
      logical, intent(in) :: wrong
      character(len=*), intent(in) :: group, name, message

      if (allocated(error) .or. .not. wrong) return
      call refuse(error, message, group, name)
   end subroutine check
end module settings_checks
