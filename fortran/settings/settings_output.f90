!> The settings as a page of the documentation, as a namelist, and as named values.
module settings_output
   use kinds, only: wp
   use named_values, only: named_values_type
   use settings_schema, only: list_settings, settings_type
   use settings_list, only: allowed_in_words, choice_list_type, is_text, kind_integer, kind_logical, kind_names, kind_source, &
      & settings_list_type, shape_constants, shape_list, shape_one, variable_type
   use text, only: newline, quoted, read_real
   use errors, only: warn, warning_type
   implicit none
   private
   public :: schema_markdown, settings_namelist, put_settings

contains

   !> The variables as a page of the documentation.
   function schema_markdown(choices) result(page)
      !> The words that modules above the settings own.
      type(choice_list_type), intent(in) :: choices(:)
      character(len=:), allocatable :: page
      type(settings_list_type) :: schema
      type(settings_type) :: unset
      integer :: i, j

      schema = list_settings(unset, choices)
      page = '# Namelist groups' //newline//newline &
         & //'Written by `bayesindent-batch --schema`. A file needs `&problem`; the other groups say what is done.' &
         & //newline//'`*` is required, `unset` has no value. Paths are relative to the folder of the file.'//newline
      do i = 1, size(schema%groups)
         page = page//newline//'## `&'//schema%groups(i)%name//'`'//newline//newline//schema%groups(i)%meaning//newline &
            & //newline//'| variable | type | unit | default | allowed | meaning |'//newline//'|---|---|---|---|---|---|'//newline
         do j = 1, size(schema%variables)
            associate (v => schema%variables(j))
               if (v%group_number /= i) cycle
               page = page//'| `'//v%name//'` | '//kind_in_words(v)//' | '//v%unit//' | '//v%default//' | ' &
                  & //allowed_in_words(v)//' | '//v%meaning//' |'//newline
            end associate
         end do
      end do
   end function schema_markdown

   function kind_in_words(v) result(words)
      type(variable_type), intent(in) :: v
      character(len=:), allocatable :: words

      words = trim(kind_names(v%kind))
      if (v%kind == kind_source) words = 'choice or file'
      if (v%shape == shape_constants) words = words//' for each constant'
      if (v%shape == shape_list) words = 'list of '//words//'s'
   end function kind_in_words

   !> The groups that are given, and those of the list `needed`, as namelists; numbers to the last bit.
   function settings_namelist(settings, needed, only_needed) result(page)
      type(settings_type), intent(in) :: settings
      character(len=*), intent(in) :: needed
      !> Without those that are given.
      logical, intent(in), optional :: only_needed
      character(len=:), allocatable :: page
      type(settings_list_type) :: list
      logical :: with_given, written
      integer :: i, j

      with_given = .true.
      if (present(only_needed)) with_given = .not. only_needed
      list = list_settings(settings)
      page = ''
      do i = 1, size(list%groups)
         associate (group => list%groups(i))
            written = (group%given .and. with_given) .or. index(' '//needed//' ', ' '//group%name//' ') > 0
            if (.not. written) cycle
            page = page//newline//'&'//group%name//newline
         end associate
         do j = 1, size(list%variables)
            if (list%variables(j)%group_number == i) page = page//line_of(list%variables(j))//newline
         end do
         page = page//'/'//newline
      end do
   end function settings_namelist

   !> The line of a variable in a namelist.
   function line_of(variable) result(line)
      type(variable_type), intent(in) :: variable
      character(len=:), allocatable :: line
      integer :: i

      if (.not. allocated(variable%values)) then
         line = '  ! '//variable%name//' is unset'
         return
      end if
      line = '  '//variable%name//' = '
      do i = 1, size(variable%values)
         if (i > 1) line = line//', '
         if (is_text(variable)) line = line//quoted(variable%values(i)%text, '''')
         if (.not. is_text(variable)) line = line//variable%values(i)%text
      end do
      if (len(variable%unit) > 0) line = line//' ! '//variable%unit
   end function line_of

   !> Add all settings to named values, 'group.variable', in their own types; what is unset is not there.
   subroutine put_settings(settings, values)
      type(settings_type), intent(in) :: settings
      type(named_values_type), intent(inout) :: values
      type(settings_list_type) :: list
      type(warning_type), allocatable :: texts(:)
      real(wp), allocatable :: reals(:)
      character(len=:), allocatable :: name
      integer :: outcome, i, j

      list = list_settings(settings)
      do i = 1, size(list%groups)
         call values%put(list%groups(i)%name//'.given', list%groups(i)%given)
      end do
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            if (.not. allocated(v%values)) cycle
            name = v%group//'.'//v%name
            if (is_text(v) .and. v%shape == shape_one) then
               call values%put(name, v%values(1)%text)
            else if (is_text(v)) then
               texts = [warning_type ::]
               do j = 1, size(v%values)
                  call warn(texts, v%values(j)%text)
               end do
               call values%put(name, texts)
            else if (v%kind == kind_logical) then
               call values%put(name, v%values(1)%text == '.true.')
            else
               reals = spread(0.0_wp, 1, size(v%values))
               do j = 1, size(reals)
                  call read_real(v%values(j)%text, reals(j), outcome)
               end do
               if (v%kind == kind_integer) then
                  call values%put(name, nint(reals(1)))
               else if (v%shape == shape_one) then
                  call values%put(name, reals(1))
               else
                  call values%put_array(name, reals, shape(reals))
               end if
            end if
         end associate
      end do
   end subroutine put_settings
end module settings_output
