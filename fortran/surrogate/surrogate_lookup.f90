!> Where a named surrogate is, and what a new one may be named: the same for both programs.
module surrogate_lookup
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists, printable, resolve_path
   use surrogate_file, only: load_surrogate
   use surrogate_model, only: new_theory_surrogate, surrogate_type
   implicit none
   private
   public :: theory_name, places_type, find_surrogate, load_named_surrogate, check_new_name

   !> The surrogate that needs no simulation and no file.
   character(len=*), parameter :: theory_name = 'halfspace'

   character(len=*), parameter :: extension = '.txt'

   !> Where surrogates are looked for. Folders are '' or have a slash at their ends.
   type :: places_type
      !> Of the results, and of the namelist.
      character(len=:), allocatable :: output, folder
      !> Of the package's data, and the names of the surrogates in it, separated by ', '.
      character(len=:), allocatable :: data_folder, shipped
   end type places_type

contains

   !> The path of a surrogate, '' of the theory: a file of the output folder, of the namelist's folder, or one that comes with the package.
   subroutine find_surrogate(name, places, path, error)
      !> A shipped name, or the name of a file.
      character(len=*), intent(in) :: name
      type(places_type), intent(in) :: places
      character(len=:), allocatable, intent(out) :: path
      type(error_type), allocatable, intent(out) :: error

      path = ''
      if (name == theory_name) return
      path = resolve_path(places%output, name)
      if (file_exists(path)) return
      path = resolve_path(places%folder, name)
      if (file_exists(path)) return
      path = places%data_folder//name//extension
      if (index(', '//places%shipped//',', ', '//name//',') > 0 .and. file_exists(path)) return
      call raise(error, ''''//printable(name)//''': there is no such surrogate; run build first, or state a file in the ' &
         & //'output folder or beside the namelist, '//theory_name//', '//places%shipped, exit_bad_input)
   end subroutine find_surrogate

   !> Load a surrogate of crystals of a class.
   subroutine load_named_surrogate(name, class, places, surrogate, error)
      !> A shipped name, or the name of a file.
      character(len=*), intent(in) :: name
      !> Name or synonym of the crystal class that it must be for, or ''.
      character(len=*), intent(in) :: class
      type(places_type), intent(in) :: places
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path
      type(crystal_class_type) :: wanted

      if (name == theory_name) then
         call new_theory_surrogate(surrogate, error)
         return
      end if
      call find_surrogate(name, places, path, error)
      if (.not. allocated(error)) call load_surrogate(path, surrogate, error)
      if (allocated(error) .or. len(class) == 0) return
      call new_crystal_class(class, wanted, error)
      if (allocated(error)) return
      associate (own => surrogate%basis%domain%class)
         if (.not. own%includes(wanted)) call raise(error, path//' is for '//own%name//' crystals, not '//wanted%name//' ones', &
            & exit_bad_input)
      end associate
   end subroutine load_named_surrogate

   !> Refuse a name under which a new surrogate cannot be kept in the output folder.
   subroutine check_new_name(name, error)
      !> Of the file.
      character(len=*), intent(in) :: name
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: allowed = '; allowed: a name that ends in '//extension//', for example surrogate'//extension
      integer :: stem

      stem = len(name) - len(extension)
      if (index(name, '/') > 0) then
         call raise(error, ''''//printable(name)//''': a new surrogate is kept in the output folder'//allowed, exit_bad_input)
      else if (index(name, extension, back=.true.) /= stem + 1 .or. stem < 1) then
         call raise(error, ''''//printable(name)//''' is no name of a new surrogate'//allowed, exit_bad_input)
      end if
   end subroutine check_new_name
end module surrogate_lookup
