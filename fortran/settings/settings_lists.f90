!> The variables of the settings as a list, as a page of the documentation, and with their values as a namelist.
module settings_lists
   use namelist_file, only: value_type
   use settings_groups, only: settings_type
   use settings_schema, only: visit_settings
   use settings_visitor, only: allowed_in_words, choice_list_type, is_text, kind_names, kind_source, settings_visitor_type, &
      & shape_constants, shape_list, variable_type
   use text, only: quoted
   implicit none
   private
   public :: schema_type, group_type, new_schema, schema_markdown, settings_namelist

   type :: group_type
      character(len=:), allocatable :: name, meaning
   end type group_type

   type :: schema_type
      type(group_type), allocatable :: groups(:)
      type(variable_type), allocatable :: variables(:)
   contains
      procedure :: find_group
   end type schema_type

   type, extends(settings_visitor_type) :: lister_type
      type(schema_type) :: schema
   contains
      procedure :: begin_group => list_group
      procedure :: visit => list_variable
   end type lister_type

   type, extends(settings_visitor_type) :: writer_type
      !> Groups to write beside those that are given, each with a blank before and after it.
      character(len=:), allocatable :: needed
      character(len=:), allocatable :: page
      logical :: writing = .false., only_needed = .false.
   contains
      procedure :: begin_group => write_group
      procedure :: visit => write_variable
   end type writer_type

   character, parameter :: newline = achar(10)

contains

   !> All groups and variables, in order; `choices`: the words that modules above the settings own.
   function new_schema(choices) result(schema)
      type(choice_list_type), intent(in) :: choices(:)
      type(schema_type) :: schema
      type(lister_type) :: lister
      type(settings_type) :: settings

      lister%choices = choices
      allocate (lister%schema%groups(0), lister%schema%variables(0))
      call visit_settings(lister, settings)
      schema = lister%schema
   end function new_schema

   subroutine list_group(self, given)
      class(lister_type), intent(inout) :: self
      logical, intent(inout) :: given
      type(group_type) :: group

      given = .false.
      group%name = self%group_name
      group%meaning = self%group_meaning
      self%schema%groups = [self%schema%groups, group]
   end subroutine list_group

   subroutine list_variable(self, variable, values)
      class(lister_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(inout) :: values(:)

      if (allocated(values)) deallocate (values)
      self%schema%variables = [self%schema%variables, variable]
   end subroutine list_variable

   !> Number of a group, 0 if there is none of this name.
   pure integer function find_group(self, name) result(i)
      class(schema_type), intent(in) :: self
      character(len=*), intent(in) :: name

      do i = size(self%groups), 1, -1
         if (self%groups(i)%name == name) return
      end do
   end function find_group

   !> The variables as a page of the documentation.
   function schema_markdown(schema) result(page)
      type(schema_type), intent(in) :: schema
      character(len=:), allocatable :: page
      integer :: i, j

      page = '# Namelist groups' //newline//newline &
         & //'Written by `bayesindent-batch --schema`. A file needs `&problem`; the other groups say what is done.' &
         & //newline//'`*` is required, `unset` has no value. Paths are relative to the folder of the file.'//newline
      do i = 1, size(schema%groups)
         page = page//newline//'## `&'//schema%groups(i)%name//'`'//newline//newline//schema%groups(i)%meaning//newline &
            & //newline//'| variable | type | unit | default | allowed | meaning |'//newline//'|---|---|---|---|---|---|'//newline
         do j = 1, size(schema%variables)
            associate (v => schema%variables(j))
               if (v%group /= schema%groups(i)%name) cycle
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
      type(writer_type) :: writer
      type(settings_type) :: copy

      copy = settings
      allocate (writer%choices(0))
      writer%needed = ' '//needed//' '
      if (present(only_needed)) writer%only_needed = only_needed
      writer%page = ''
      call visit_settings(writer, copy)
      page = writer%page
      if (writer%writing) page = page//'/'//newline
   end function settings_namelist

   subroutine write_group(self, given)
      class(writer_type), intent(inout) :: self
      logical, intent(inout) :: given

      if (self%writing) self%page = self%page//'/'//newline
      self%writing = (given .and. .not. self%only_needed) .or. index(self%needed, ' '//self%group_name//' ') > 0
      if (self%writing) self%page = self%page//newline//'&'//self%group_name//newline
   end subroutine write_group

   !> One line of a variable.
   subroutine write_variable(self, variable, values)
      class(writer_type), intent(inout) :: self
      type(variable_type), intent(in) :: variable
      type(value_type), allocatable, intent(inout) :: values(:)
      character(len=:), allocatable :: list
      integer :: i

      if (.not. self%writing) return
      if (.not. allocated(values)) then
         self%page = self%page//'  ! '//variable%name//' is unset'//newline
         return
      end if
      list = ''
      do i = 1, size(values)
         if (is_text(variable)) list = list//', '//quoted(values(i)%text, '''')
         if (.not. is_text(variable)) list = list//', '//values(i)%text
      end do
      self%page = self%page//'  '//variable%name//' = '//list(3:)
      if (len(variable%unit) > 0) self%page = self%page//' ! '//variable%unit
      self%page = self%page//newline
   end subroutine write_variable
end module settings_lists
