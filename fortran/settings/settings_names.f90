!> Groups and variables of a namelist that nobody knows, with what was probably meant.
module settings_names
   use errors, only: error_type, exit_bad_input, raise
   use namelist_file, only: namelist_file_type, place
   use settings_lists, only: schema_type
   implicit none
   private
   public :: check_names

   !> The best match so far of a name.
   type :: match_type
      character(len=:), allocatable :: name
      integer :: distance = huge(1)
   end type match_type

contains

   !> Every group and variable of the file is in the schema.
   subroutine check_names(path, file, schema, error)
      !> For messages.
      character(len=*), intent(in) :: path
      type(namelist_file_type), intent(in) :: file
      type(schema_type), intent(in) :: schema
      type(error_type), allocatable, intent(out) :: error
      type(match_type) :: match
      character(len=:), allocatable :: names
      integer :: i, j

      do i = 1, size(file%groups)
         if (schema%find_group(file%groups(i)%text) > 0) cycle
         names = ''
         call restart(match)
         do j = 1, size(schema%groups)
            names = names//' &'//schema%groups(j)%name
            call compare(match, schema%groups(j)%name, file%groups(i)%text)
         end do
         match%name = '&'//match%name
         call raise(error, place(path, file%groups(i)%text, '')//'unknown group'//suggestion(match)//'; allowed:'//names, &
            & exit_bad_input)
         return
      end do
      do i = 1, size(file%entries)
         associate (entry => file%entries(i))
            if (schema%find(entry%group, entry%name) > 0) cycle
            names = ''
            call restart(match)
            do j = 1, size(schema%variables)
               if (schema%variables(j)%group /= entry%group) cycle
               names = names//' '//schema%variables(j)%name
               call compare(match, schema%variables(j)%name, entry%name)
            end do
            do j = 1, size(schema%variables)
               if (match%distance <= 2 .or. schema%variables(j)%name /= entry%name) cycle
               match%name = entry%name//' of &'//schema%variables(j)%group
               match%distance = 0
            end do
            call raise(error, place(path, entry%group, entry%name)//'unknown variable'//suggestion(match)//'; allowed:'//names, &
               & exit_bad_input)
            return
         end associate
      end do
   end subroutine check_names

   subroutine restart(match)
      type(match_type), intent(out) :: match

      match%name = ''
   end subroutine restart

   subroutine compare(match, name, written)
      type(match_type), intent(inout) :: match
      character(len=*), intent(in) :: name, written
      integer :: distance

      distance = edit_distance(name, written)
      if (distance >= match%distance) return
      match%name = name
      match%distance = distance
   end subroutine compare

   pure function suggestion(match) result(words)
      type(match_type), intent(in) :: match
      character(len=:), allocatable :: words

      words = ''
      if (match%distance <= max(1, len(match%name)/3)) words = ', did you mean '//match%name//'?'
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
end module settings_names
