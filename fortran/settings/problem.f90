!> A namelist file read, checked and resolved: every variable has its value, every table it names is loaded.
!>
!> Both programs read files here and nowhere else, so that they give the same verdict. A message is one line:
!> `FILE: &group name: what is wrong, the value, what is allowed`.
module problem
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: anisotropy_index, is_stable, rotation_matrix
   use distinct_directions, only: all_alike, new_region, region_type
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists, folder_of, printable, resolve_path
   use kinds, only: degree, wp
   use namelist_file, only: entry_type, namelist_file_type, parse_namelist, place, read_namelist_file, value_type
   use namelist_schema, only: allowed_in_words, commands, groups_of_command, kind_choice, kind_file, kind_integer, &
      & kind_logical, kind_real, kind_source, kind_text, new_schema, schema_type, variable_type
   use numbers, only: number_malformed, number_not_finite, number_ok, number_text, read_integer, read_real
   use point_tables, only: angles_look_like_radians, points_type, read_crystals, read_measurements
   use text, only: join, lower, to_text
   implicit none
   private
   public :: problem_type, warning_type, new_problem

   !> A resolved variable: numbers (logicals as 0 and 1) or a text.
   type :: setting_type
      !> The file says it; it has a value.
      logical :: given = .false., set = .false.
      real(wp), allocatable :: number(:)
      character(len=:), allocatable :: text
   end type setting_type

   type :: warning_type
      character(len=:), allocatable :: text
   end type warning_type

   type :: problem_type
      !> As the user wrote it; its folder with a slash, or ''.
      character(len=:), allocatable :: path, folder
      character(len=:), allocatable :: command
      !> What `run` would do, in order: words of 'simulate theory build extract next'.
      character(len=:), allocatable :: stages
      type(crystal_class_type) :: class
      type(warning_type), allocatable :: warnings(:)
      !> The tables that the file names, unallocated if it names none.
      type(points_type), allocatable :: crystals, measurements, candidates
      type(schema_type) :: schema
      type(setting_type), allocatable, private :: settings(:)
      !> By group of the schema: the file has it; it is resolved.
      logical, allocatable, private :: present(:), resolved(:)
   contains
      procedure :: has_group
      procedure :: is_set
      procedure :: resolved_text
      procedure, private :: get_integer
      procedure, private :: get_real
      procedure, private :: get_reals
      procedure, private :: get_logical
      procedure, private :: get_text
      !> `call problem%get('design', 'budget', n)`: the resolved value. Of a variable that has none: NaN, -huge or ''.
      generic :: get => get_integer, get_real, get_reals, get_logical, get_text
   end type problem_type

   !> Longest text, bytes.
   integer, parameter :: longest_text = 512
   character, parameter :: newline = achar(10)

contains

   !> Read `path` for `command`, one of `namelist_schema`'s.
   subroutine new_problem(path, command, self, error)
      character(len=*), intent(in) :: path, command
      type(problem_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      type(namelist_file_type) :: file
      integer :: i

      self%path = path
      self%folder = folder_of(path)
      self%command = command
      self%schema = new_schema()
      allocate (self%settings(size(self%schema%variables)), self%warnings(0))
      if (.not. any(commands == command)) then
         call raise(error, 'no command is named '''//printable(command)//'''; allowed: '//join(commands, ', '), &
            & exit_bad_input)
         return
      end if
      call read_namelist_file(path, file, error)
      if (allocated(error)) return
      call check_names(self, file, error)
      if (allocated(error)) return
      call find_symmetry(self, file, error)
      if (allocated(error)) return
      call choose_groups(self, error)
      if (allocated(error)) return
      do i = 1, size(self%schema%variables)
         if (.not. self%resolved(self%schema%find_group(self%schema%variables(i)%group))) cycle
         call resolve_variable(self, i, file, error)
         if (allocated(error)) return
      end do
      call check_together(self, error)
      if (allocated(error)) return
      call load_tables(self, error)
   end subroutine new_problem

   !> Every group and variable of the file is in the schema.
   subroutine check_names(self, file, error)
      type(problem_type), intent(inout) :: self
      type(namelist_file_type), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: names, nearest
      integer :: i, j, best, distance

      allocate (self%present(size(self%schema%groups)), self%resolved(size(self%schema%groups)), source=.false.)
      do i = 1, size(file%groups)
         j = self%schema%find_group(file%groups(i)%text)
         if (j > 0) then
            self%present(j) = .true.
            cycle
         end if
         names = ''
         nearest = ''
         best = huge(best)
         do j = 1, size(self%schema%groups)
            associate (name => self%schema%groups(j)%name)
               names = names//' &'//name
               distance = edit_distance(name, file%groups(i)%text)
               if (distance < best) then
                  best = distance
                  nearest = name
               end if
            end associate
         end do
         call raise(error, place(self%path, file%groups(i)%text, '')//'unknown group' &
            & //suggestion('&'//nearest, best, len(nearest))//'; allowed:'//names, exit_bad_input)
         return
      end do
      do i = 1, size(file%entries)
         associate (entry => file%entries(i))
            if (self%schema%find(entry%group, entry%name) > 0) cycle
            names = ''
            nearest = ''
            best = huge(best)
            do j = 1, size(self%schema%variables)
               associate (v => self%schema%variables(j))
                  if (v%group == entry%group) then
                     names = names//' '//v%name
                     distance = edit_distance(v%name, entry%name)
                     if (distance < best) then
                        best = distance
                        nearest = v%name
                     end if
                  end if
               end associate
            end do
            if (best > 2) then
               do j = 1, size(self%schema%variables)
                  if (self%schema%variables(j)%name == entry%name) then
                     nearest = entry%name//' of &'//self%schema%variables(j)%group
                     best = 0
                     exit
                  end if
               end do
            end if
            call raise(error, place(self%path, entry%group, entry%name)//'unknown variable' &
               & //suggestion(nearest, best, len(nearest))//'; allowed:'//names, exit_bad_input)
            return
         end associate
      end do
   end subroutine check_names

   pure function suggestion(nearest, distance, length) result(words)
      character(len=*), intent(in) :: nearest
      integer, intent(in) :: distance, length
      character(len=:), allocatable :: words

      words = ''
      if (distance <= max(1, length/3)) words = ', did you mean '//nearest//'?'
   end function suggestion

   !> Levenshtein's distance.
   pure integer function edit_distance(a, b) result(distance)
      character(len=*), intent(in) :: a, b
      integer :: previous(0:len(b)), current(0:len(b))
      integer :: i, j

      previous = [(j, j=0, len(b))]
      do i = 1, len(a)
         current(0) = i
         do j = 1, len(b)
            current(j) = min(previous(j) + 1, current(j - 1) + 1, previous(j - 1) + merge(0, 1, a(i:i) == b(j:j)))
         end do
         previous = current
      end do
      distance = previous(len(b))
   end function edit_distance

   !> The symmetry comes first: defaults and array sizes depend on it.
   subroutine find_symmetry(self, file, error)
      type(problem_type), intent(inout) :: self
      type(namelist_file_type), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (.not. self%present(self%schema%find_group('problem'))) then
         call raise(error, place(self%path, 'problem', '')//'the group is missing; every file needs it', exit_bad_input)
         return
      end if
      i = self%schema%find('problem', 'symmetry')
      call resolve_variable(self, i, file, error)
      if (allocated(error)) return
      call new_crystal_class(self%settings(i)%text, self%class, error)
   end subroutine find_symmetry

   !> The groups that the file has and that the command needs.
   subroutine choose_groups(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: needed, name
      integer :: i, blank

      self%stages = ''
      if (self%has_group('crystals')) call add_stage('simulate')
      if (self%has_group('design')) call add_stage('build')
      if (self%has_group('measurements')) call add_stage('extract')
      if (self%has_group('next')) call add_stage('next')
      if (self%command /= 'run') then
         needed = groups_of_command(self%command)
      else
         needed = 'problem execution'
         if (self%has_group('crystals')) needed = needed//' '//groups_of_command('simulate')
         if (self%has_group('design')) needed = needed//' '//groups_of_command('build')
         if (self%has_group('surrogate')) needed = needed//' domain'
         if (self%has_group('measurements')) needed = needed//' '//groups_of_command('extract')
         if (self%has_group('next')) needed = needed//' '//groups_of_command('next')
         if (len(self%stages) == 0) then
            call raise(error, place(self%path, 'problem', '')//'nothing to do; &crystals asks for simulations, &design ' &
               & //'for a surrogate, &measurements for the constants', exit_bad_input)
            return
         end if
      end if
      self%resolved = self%present
      needed = needed//' '
      do while (len(needed) > 0)
         blank = index(needed, ' ')
         name = needed(:blank - 1)
         needed = needed(blank + 1:)
         i = self%schema%find_group(name)
         if (.not. self%present(i) .and. any_required(self%schema, name)) then
            call raise(error, place(self%path, name, '')//'the group is missing; '//self%command//' needs it', exit_bad_input)
            return
         end if
         self%resolved(i) = .true.
      end do

   contains

      subroutine add_stage(stage)
         character(len=*), intent(in) :: stage

         if (len(self%stages) > 0) self%stages = self%stages//' '
         self%stages = self%stages//stage
      end subroutine add_stage
   end subroutine choose_groups

   pure logical function any_required(schema, group)
      type(schema_type), intent(in) :: schema
      character(len=*), intent(in) :: group
      integer :: i

      any_required = .false.
      do i = 1, size(schema%variables)
         if (schema%variables(i)%group == group .and. schema%variables(i)%default == '*') any_required = .true.
      end do
   end function any_required

   !> The value of variable number `i`: that of the file, or the default.
   subroutine resolve_variable(self, i, file, error)
      type(problem_type), intent(inout) :: self
      integer, intent(in) :: i
      type(namelist_file_type), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      type(setting_type) :: setting
      character(len=:), allocatable :: default
      type(value_type), allocatable :: values(:)
      integer :: j

      associate (v => self%schema%variables(i))
         do j = 1, size(file%entries)
            if (file%entries(j)%group /= v%group .or. file%entries(j)%name /= v%name) cycle
            setting%given = .true.
            call read_values(self, v, file%entries(j)%values, setting, error)
            if (allocated(error)) return
         end do
         if (.not. setting%given) then
            default = default_of(v, self%class%name)
            if (default == '*') then
               call raise(error, place(self%path, v%group, v%name)//'the variable is missing; '//v%meaning &
                  & //allowed_part(v), exit_bad_input)
               return
            end if
            if (default /= 'unset') then
               call split_default(v, default, values)
               call read_values(self, v, values, setting, error)
               if (allocated(error)) return
            end if
         end if
      end associate
      self%settings(i) = setting
   end subroutine resolve_variable

   !> The part of a default that is for this crystal class; a class that it does not name has none.
   pure function default_of(v, class) result(default)
      type(variable_type), intent(in) :: v
      character(len=*), intent(in) :: class
      character(len=:), allocatable :: default
      integer :: colon

      default = v%default
      if (index(default, ': ') == 0) return
      colon = index('; '//default, '; '//class//': ')
      if (colon == 0) then
         default = '*'
      else
         default = default(colon + len(class) + 2:)//';'
         default = default(:index(default, ';') - 1)
      end if
   end function default_of

   subroutine split_default(v, default, values)
      type(variable_type), intent(in) :: v
      character(len=*), intent(in) :: default
      type(value_type), allocatable, intent(out) :: values(:)
      integer :: n, first, comma, i

      n = 1
      if (v%per_constant) n = 1 + count([(default(i:i) == ',', i=1, len(default))])
      allocate (values(n))
      first = 1
      do i = 1, n
         comma = index(default(first:), ',')
         if (comma == 0 .or. n == 1) comma = len(default) - first + 2
         values(i)%text = trim(adjustl(default(first:first + comma - 2)))
         values(i)%quoted = is_text(v)
         first = first + comma
      end do
   end subroutine split_default

   pure logical function is_text(v)
      type(variable_type), intent(in) :: v

      is_text = any(v%kind == [kind_text, kind_choice, kind_file, kind_source])
   end function is_text

   !> Type, number of values, range.
   subroutine read_values(self, v, values, setting, error)
      type(problem_type), intent(in) :: self
      type(variable_type), intent(in) :: v
      type(value_type), intent(in) :: values(:)
      type(setting_type), intent(inout) :: setting
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: message
      integer :: n, i

      setting%set = .true.
      n = 1
      if (v%per_constant) n = self%class%n_constants
      message = ''
      if (v%only /= '' .and. v%only /= self%class%name) then
         message = 'the variable is for '//trim(v%only)//' crystals; &problem says '//self%class%name
      else if (size(values) /= n) then
         message = to_text(size(values))//' values; '
         if (size(values) == 1) message = 'one value; '
         if (v%per_constant) then
            message = message//to_text(n)//' are needed: '//join(self%class%constants, ', ')
         else
            message = message//'one is needed'//allowed_part(v)
         end if
      else if (is_text(v)) then
         call read_text(v, values(1), setting%text, message)
      else
         allocate (setting%number(n))
         do i = 1, n
            call read_number(v, values(i), setting%number(i), message)
            if (len(message) > 0) exit
         end do
      end if
      if (len(message) > 0) call raise(error, place(self%path, v%group, v%name)//message, exit_bad_input)
   end subroutine read_values

   subroutine read_text(v, value, string, message)
      type(variable_type), intent(in) :: v
      type(value_type), intent(in) :: value
      character(len=:), allocatable, intent(out) :: string
      character(len=:), allocatable, intent(inout) :: message
      integer :: i

      string = value%text
      if (.not. value%quoted) then
         message = printable(value%text)//' is not in quotes; a text is needed'//allowed_part(v)
      else if (len(string) > longest_text) then
         message = 'the text has '//to_text(len(string))//' bytes ('''//printable(string)//'''); at most ' &
            & //to_text(longest_text)//' are allowed'
      else if (any([(iachar(string(i:i)) < 32, i=1, len(string))])) then
         message = ''''//printable(string)//''' holds a control character; plain text is allowed'
      else if (v%kind == kind_choice .or. v%kind == kind_source) then
         if (.not. (len(string) == 0 .and. v%default == '')) then
            if (index(', '//v%allowed//',', ', '//lower(string)//',') > 0) then
               string = lower(string)
            else if (v%kind == kind_choice) then
               message = ''''//printable(string)//''' is not known'//allowed_part(v)
            end if
         end if
      end if
      if (len(message) == 0 .and. len_trim(string) == 0 .and. v%kind == kind_file) then
         message = 'the name of the file is empty'
      end if
   end subroutine read_text

   subroutine read_number(v, value, number, message)
      type(variable_type), intent(in) :: v
      type(value_type), intent(in) :: value
      real(wp), intent(out) :: number
      character(len=:), allocatable, intent(inout) :: message
      integer :: whole, outcome, other

      number = 0.0_wp
      if (value%quoted) then
         message = 'the text '''//printable(value%text)//''' stands where '//noun(v)//' is needed'//allowed_part(v)
         return
      end if
      select case (v%kind)
      case (kind_logical)
         select case (lower(value%text))
         case ('.true.', '.t.', 'true', 't')
            number = 1.0_wp
         case ('.false.', '.f.', 'false', 'f')
            number = 0.0_wp
         case default
            message = printable(value%text)//' is not a logical'//allowed_part(v)
         end select
         return
      case (kind_integer)
         call read_integer(value%text, whole, outcome)
         number = whole
         if (outcome == number_malformed) then
            call read_real(value%text, number, other)
            if (other == number_not_finite) outcome = number_not_finite
         end if
      case default
         call read_real(value%text, number, outcome)
      end select
      if (outcome == number_malformed) then
         message = printable(value%text)//' is not '//noun(v)//allowed_part(v)
      else if (outcome /= number_ok .and. verify(value%text, '+-0123456789') == 0) then
         message = printable(value%text)//' is out of range'//allowed_part(v)
      else if (outcome /= number_ok) then
         message = printable(value%text)//' is not a finite number'//allowed_part(v)
      else if (.not. in_interval(number, v%allowed)) then
         message = printable(value%text)//' is out of range'//allowed_part(v)
      end if
   end subroutine read_number

   pure function noun(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      select case (v%kind)
      case (kind_integer)
         words = 'an integer'
      case (kind_logical)
         words = 'a logical'
      case default
         words = 'a number'
      end select
   end function noun

   function allowed_part(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      words = allowed_in_words(v)
      if (len(words) == 0) return
      words = '; allowed '//words
      if (len(v%unit) > 0) words = words//' '//v%unit
   end function allowed_part

   !> Whether `number` is in an interval such as '[0, 1)' or '(0, *)'; an empty text admits all.
   pure logical function in_interval(number, interval)
      real(wp), intent(in) :: number
      character(len=*), intent(in) :: interval
      real(wp) :: bound
      integer :: comma, n, outcome

      in_interval = .true.
      n = len(interval)
      if (n == 0) return
      comma = index(interval, ',')
      call read_real(trim(adjustl(interval(2:comma - 1))), bound, outcome)
      if (outcome == number_ok) in_interval = number > bound .or. (interval(1:1) == '[' .and. .not. number < bound)
      call read_real(trim(adjustl(interval(comma + 1:n - 1))), bound, outcome)
      if (outcome == number_ok) in_interval = in_interval &
         & .and. (number < bound .or. (interval(n:n) == ']' .and. .not. number > bound))
   end function in_interval

   !> What one variable alone cannot show.
   subroutine check_together(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: budget, n, initial
      character(len=:), allocatable :: candidates, simulator, file

      call check_bounds(self, 'domain', error)
      if (.not. allocated(error)) call check_bounds(self, 'prior', error)
      if (.not. allocated(error)) call check_pairs(self, error)
      if (allocated(error)) return
      call self%get('simulation', 'simulator', simulator)
      if (simulator == 'import' .and. self%has_group('crystals') .and. self%command /= 'theory') then
         call raise(error, place(self%path, 'simulation', 'simulator')//'''import'' cannot indent the &crystals; allowed ' &
            & //'''fe'', ''theory''', exit_bad_input)
         return
      end if
      call self%get('surrogate', 'file', file)
      if (any([character(len=9) :: 'cubic', 'hexagonal'] == file) .and. (self%command == 'build' &
         & .or. (self%command == 'run' .and. self%has_group('design')))) then
         call raise(error, place(self%path, 'surrogate', 'file')//''''//file//''' is a surrogate that comes with the package; ' &
            & //'build writes its own file, for example surrogate.nc', exit_bad_input)
         return
      end if
      if (self%is_set('design', 'budget')) then
         call self%get('design', 'budget', budget)
         call self%get('design', 'n_candidates', n)
         call self%get('design', 'initial', initial)
         call self%get('design', 'candidates', candidates)
         if (initial > budget) then
            call raise(error, place(self%path, 'design', 'initial')//to_text(initial)//' is more than the budget; allowed ' &
               & //'0 to '//to_text(budget), exit_bad_input)
         else if (candidates == 'latin' .and. n < budget) then
            call raise(error, place(self%path, 'design', 'budget')//to_text(budget)//' is more than n_candidates; ' &
               & //'allowed 1 to '//to_text(n), exit_bad_input)
         end if
      end if
   end subroutine check_together

   !> c_min below c_max, and a stable crystal between them.
   subroutine check_bounds(self, group, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: low(:), high(:), best(:)
      character(len=3), allocatable :: names(:)
      integer :: i

      if (.not. (self%is_set(group, 'c_min') .and. self%is_set(group, 'c_max'))) return
      call self%get(group, 'c_min', low)
      call self%get(group, 'c_max', high)
      names = self%class%constants
      do i = 1, size(low)
         if (.not. low(i) < high(i)) then
            call raise(error, place(self%path, group, 'c_min')//names(i)//' = '//to_text(low(i))//' GPa is not below ' &
               & //'its c_max of '//to_text(high(i))//' GPa', exit_bad_input)
            return
         end if
      end do
      ! The most stable crystal of the box: large on the diagonal, small off it.
      best = high
      do i = 1, size(best)
         if (names(i)(2:2) /= names(i)(3:3)) best(i) = max(low(i), min(high(i), 0.0_wp))
      end do
      if (.not. is_stable(self%class%stiffness(best))) call raise(error, place(self%path, group, 'c_max') &
         & //'no crystal between c_min and c_max is elastically stable; the stiffness must be positive definite', exit_bad_input)
   end subroutine check_bounds

   !> A mean needs an sd, and an sd a mean: the variables of &prior whose names differ in these words.
   subroutine check_pairs(self, error)
      type(problem_type), intent(in) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      do i = 1, size(self%schema%variables)
         associate (name => self%schema%variables(i)%name)
            if (self%schema%variables(i)%group /= 'prior' .or. .not. self%settings(i)%set) cycle
            call need_partner('_mean', '_sd')
            if (.not. allocated(error)) call need_partner('_sd', '_mean')
            if (allocated(error)) return
         end associate
      end do

   contains

      subroutine need_partner(ending, other)
         character(len=*), intent(in) :: ending, other
         character(len=:), allocatable :: partner
         integer :: at

         associate (name => self%schema%variables(i)%name)
            at = index(name, ending)
            if (at == 0) return
            partner = name(:at - 1)//other//name(at + len(ending):)
            if (self%schema%find('prior', partner) > 0 .and. .not. self%is_set('prior', partner)) then
               call raise(error, place(self%path, 'prior', partner)//'the variable is missing; '//name//' needs it', &
                  & exit_bad_input)
            end if
         end associate
      end subroutine need_partner
   end subroutine check_pairs

   !> Read the CSV files that the groups name.
   subroutine load_tables(self, error)
      type(problem_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: name, scale

      if (self%is_set('crystals', 'points')) then
         call self%get('crystals', 'points', name)
         allocate (self%crystals)
         call read_crystals(resolve_path(self%folder, name), place(self%path, 'crystals', 'points')//printable(name)//': ', &
            & self%class, self%crystals, error)
         if (allocated(error)) return
         if (angles_look_like_radians(self%crystals)) call warn_radians(self, 'crystals', 'points', name)
      end if
      if (self%is_set('measurements', 'file')) then
         call self%get('measurements', 'file', name)
         call self%get('measurements', 'scale', scale)
         allocate (self%measurements)
         call read_measurements(resolve_path(self%folder, name), place(self%path, 'measurements', 'file')//printable(name) &
            & //': ', scale == 'inferred', self%measurements, error)
         if (allocated(error)) return
         call question_measurements(self, name)
      end if
      if (self%is_set('design', 'candidates')) then
         call self%get('design', 'candidates', name)
         if (name /= 'latin' .and. name /= 'factorial') call load_candidates(self, name, error)
      end if
   end subroutine load_tables

   subroutine load_candidates(self, name, error)
      type(problem_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: prefix
      real(wp), allocatable :: low(:), high(:)
      real(wp) :: cap
      integer :: i, n, outside

      prefix = place(self%path, 'design', 'candidates')
      if (index(name, '.') == 0 .and. .not. file_exists(resolve_path(self%folder, name))) then
         call raise(error, prefix//''''//printable(name)//''' is not known; allowed ''latin'', ''factorial'', or the name ' &
            & //'of a CSV file', exit_bad_input)
         return
      end if
      allocate (self%candidates)
      call read_crystals(resolve_path(self%folder, name), prefix//printable(name)//': ', self%class, self%candidates, error)
      if (allocated(error)) return
      outside = 0
      if (self%is_set('domain', 'c_min')) then
         call self%get('domain', 'c_min', low)
         call self%get('domain', 'c_max', high)
         call self%get('domain', 'anisotropy_cap', cap)
      end if
      n = self%class%n_constants
      do i = 1, self%candidates%n
         if (self%candidates%class(i)%name /= self%class%name) then
            call raise(error, prefix//printable(name)//': line '//to_text(self%candidates%table%line(i)) &
               & //': the crystal is not of the symmetry of &problem', exit_bad_input)
            return
         end if
         if (.not. allocated(low)) cycle
         associate (c => self%candidates%constants(:n, i))
            if (any(c < low .or. c > high) .or. anisotropy_index(self%class%stiffness(c)) > cap) outside = outside + 1
         end associate
      end do
      if (outside > 0) call warn(self, prefix//to_text(outside)//' of '//to_text(self%candidates%n)//' rows of ' &
         & //printable(name)//' lie outside &domain')
   end subroutine load_candidates

   !> What is odd about measurements, but may be meant.
   subroutine question_measurements(self, name)
      type(problem_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      !> Degrees.
      real(wp), parameter :: alike = 5.0_wp
      character(len=:), allocatable :: prefix
      type(region_type) :: region
      real(wp) :: directions(3, self%measurements%n), g(3, 3)
      integer :: i

      prefix = place(self%path, 'measurements', 'file')//printable(name)
      associate (euler => self%measurements%euler_deg)
         if (self%measurements%n == 1) then
            call warn(self, prefix//' has one grain; one modulus cannot decide the constants')
         else
            do i = 1, self%measurements%n
               g = rotation_matrix(euler(:, i)*degree)
               directions(:, i) = g(:, 3)
            end do
            call new_region(self%class, region)
            if (.not. angles_look_like_radians(self%measurements) .and. all_alike(region, directions, alike*degree)) then
               call warn(self, prefix//': the orientations are all alike (within 5 degrees of one): they cannot tell how the ' &
                  & //'modulus depends on orientation')
            end if
         end if
      end associate
      if (angles_look_like_radians(self%measurements)) call warn_radians(self, 'measurements', 'file', name)
      if (any(self%measurements%sd_gpa > 0.5_wp*self%measurements%modulus_gpa)) call warn(self, prefix &
         & //': an sd_gpa is more than half of its modulus_gpa')
   end subroutine question_measurements

   subroutine warn_radians(self, group, variable, name)
      type(problem_type), intent(inout) :: self
      character(len=*), intent(in) :: group, variable, name

      call warn(self, place(self%path, group, variable)//printable(name) &
         & //': no angle is above 2 pi; angles are in degrees, and these look like radians')
   end subroutine warn_radians

   subroutine warn(self, message)
      type(problem_type), intent(inout) :: self
      character(len=*), intent(in) :: message
      type(warning_type), allocatable :: grown(:)
      integer :: n

      n = size(self%warnings)
      allocate (grown(n + 1))
      grown(:n) = self%warnings
      grown(n + 1)%text = message
      call move_alloc(grown, self%warnings)
   end subroutine warn

   !> The file has this group.
   pure logical function has_group(self, name)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: name
      integer :: i

      i = self%schema%find_group(name)
      has_group = .false.
      if (i > 0) has_group = self%present(i)
   end function has_group

   !> The variable has a value.
   pure logical function is_set(self, group, name)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group, name
      integer :: i

      i = self%schema%find(group, name)
      is_set = .false.
      if (i > 0) is_set = self%settings(i)%set
   end function is_set

   subroutine get_integer(self, group, name, value)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group, name
      integer, intent(out) :: value
      integer :: i

      value = -huge(value)
      i = self%schema%find(group, name)
      if (i == 0) return
      if (allocated(self%settings(i)%number)) value = nint(self%settings(i)%number(1))
   end subroutine get_integer

   subroutine get_real(self, group, name, value)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group, name
      real(wp), intent(out) :: value
      real(wp), allocatable :: values(:)

      call self%get_reals(group, name, values)
      value = values(1)
   end subroutine get_real

   subroutine get_reals(self, group, name, value)
      use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group, name
      real(wp), allocatable, intent(out) :: value(:)
      integer :: i

      i = self%schema%find(group, name)
      if (i > 0) then
         if (allocated(self%settings(i)%number)) value = self%settings(i)%number
      end if
      if (.not. allocated(value)) value = [ieee_value(1.0_wp, ieee_quiet_nan)]
   end subroutine get_reals

   subroutine get_logical(self, group, name, value)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group, name
      logical, intent(out) :: value
      integer :: number

      call self%get_integer(group, name, number)
      value = number == 1
   end subroutine get_logical

   subroutine get_text(self, group, name, value)
      class(problem_type), intent(in) :: self
      character(len=*), intent(in) :: group, name
      character(len=:), allocatable, intent(out) :: value
      integer :: i

      value = ''
      i = self%schema%find(group, name)
      if (i == 0) return
      if (allocated(self%settings(i)%text)) value = self%settings(i)%text
   end subroutine get_text

   !> The resolved namelists: the groups that are there or needed, every variable with its value.
   function resolved_text(self) result(page)
      class(problem_type), intent(in) :: self
      character(len=:), allocatable :: page
      integer :: i, j

      page = '! Every value of '//printable(self%path)//', defaults included; paths are relative to the folder of that file.' &
         & //newline
      do i = 1, size(self%schema%groups)
         if (.not. self%resolved(i)) cycle
         page = page//newline//'&'//self%schema%groups(i)%name//newline
         do j = 1, size(self%schema%variables)
            associate (v => self%schema%variables(j), setting => self%settings(j))
               if (v%group /= self%schema%groups(i)%name) cycle
               if (setting%set) then
                  page = page//'  '//v%name//' = '//setting_text(v, setting)
                  if (len(v%unit) > 0) page = page//' ! '//v%unit
                  page = page//newline
               else
                  page = page//'  ! '//v%name//' is unset'//newline
               end if
            end associate
         end do
         page = page//'/'//newline
      end do
   end function resolved_text

   function setting_text(v, setting) result(string)
      type(variable_type), intent(in) :: v
      type(setting_type), intent(in) :: setting
      character(len=:), allocatable :: string
      integer :: i

      string = ''
      if (is_text(v)) then
         string = ''''
         do i = 1, len(setting%text)
            if (setting%text(i:i) == '''') string = string//''''
            string = string//setting%text(i:i)
         end do
         string = string//''''
         return
      end if
      do i = 1, size(setting%number)
         if (i > 1) string = string//', '
         select case (v%kind)
         case (kind_integer)
            string = string//to_text(nint(setting%number(i)))
         case (kind_logical)
            string = string//to_text(setting%number(i) > 0.5_wp)
         case default
            string = string//number_text(setting%number(i))
         end select
      end do
   end function setting_text
end module problem
