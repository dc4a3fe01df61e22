!> Groups and variables of a namelist that nobody knows, with what was probably meant.
module settings_names
   use errors, only: error_type, exit_bad_input, raise
   use namelist_file, only: namelist_file_type, place
   use settings_lists, only: schema_type
   use spelling, only: suggestion
   implicit none
   private
   public :: check_names

contains

   !> Every group and variable of the file is in the schema.
   subroutine check_names(path, file, schema, error)
      !> For messages.
      character(len=*), intent(in) :: path
      type(namelist_file_type), intent(in) :: file
      type(schema_type), intent(in) :: schema
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: names, near
      integer :: i, j

      do i = 1, size(file%groups)
         if (schema%find_group(file%groups(i)%text) > 0) cycle
         names = ''
         do j = 1, size(schema%groups)
            names = names//', &'//schema%groups(j)%name
         end do
         call raise(error, place(path, file%groups(i)%text, '')//'unknown group'//suggestion('&'//file%groups(i)%text, names(3:)) &
            & //'; allowed: '//names(3:), exit_bad_input)
         return
      end do
      do i = 1, size(file%entries)
         associate (entry => file%entries(i))
            if (schema%find(entry%group, entry%name) > 0) cycle
            names = ''
            do j = 1, size(schema%variables)
               if (schema%variables(j)%group == entry%group) names = names//', '//schema%variables(j)%name
            end do
            near = suggestion(entry%name, names(3:))
            do j = 1, size(schema%variables)
               if (len(near) > 0 .or. schema%variables(j)%name /= entry%name) cycle
               near = ', did you mean '//entry%name//' of &'//schema%variables(j)%group//'?'
            end do
            call raise(error, place(path, entry%group, entry%name)//'unknown variable'//near//'; allowed: '//names(3:), &
               & exit_bad_input)
            return
         end associate
      end do
   end subroutine check_names
end module settings_names
