!> The namelist of a problem with every value, for its folder of results.
module resolved_namelist
   use files, only: make_absolute, printable
   use problem, only: problem_type, table_name
   use settings_list, only: settings_list_type
   use settings_reader, only: settings_namelist
   use settings_schema, only: list_settings, set_settings, settings_type
   use text, only: newline
   implicit none
   private
   public :: resolved_text

contains

   !> Text of the resolved namelist for the folder of results: stated and needed groups, every
   !> variable with its value. The table of the measurements is the one in that folder.
   function resolved_text(problem) result(page)
      type(problem_type), intent(in) :: problem
      character(len=:), allocatable :: page
      type(settings_list_type) :: list
      type(settings_type) :: settings
      integer :: i

      list = list_settings(problem%settings)
      do i = 1, size(list%variables)
         associate (v => list%variables(i))
            if (.not. allocated(v%values) .or. index(v%kind, 'file') == 0) cycle
            call make_absolute(problem%run%folder, v%values(1)%text)
         end associate
      end do
      call set_settings(list, settings)
      call make_absolute(problem%run%folder, settings%surrogate%file)
      associate (s => settings%measurements)
         if (allocated(problem%data%table_text)) then
            s%file = table_name
            s%sheet = ''
            if (allocated(s%columns)) deallocate (s%columns)
            if (allocated(s%orientations_file)) deallocate (s%orientations_file)
            if (allocated(s%ebsd)) deallocate (s%ebsd)
            if (allocated(s%ebsd_points)) deallocate (s%ebsd_points)
            if (allocated(s%shared_errors) .and. .not. allocated(problem%data%shared_file)) then
               deallocate (s%shared_errors)
            end if
         end if
      end associate
      page = '! Every value of '//printable(problem%run%path) &
         & //', defaults included; paths are absolute, or relative to this folder.'//newline &
         & //settings_namelist(settings, problem%run%needed//' '//problem%run%groups)
   end function resolved_text
end module resolved_namelist
