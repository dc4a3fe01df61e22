!> The meshes there are: their names, and one by its name.
module meshes
   use block_mesh, only: block_mesh_type
   use errors, only: error_type, exit_bad_input, raise
   use halfspace_mesh, only: halfspace_mesh_type
   use settings_groups, only: simulation_settings_type
   use specimen_mesh, only: specimen_mesh_type
   use text, only: split_list
   implicit none
   private
   public :: mesh_names, new_specimen_mesh, other_mesh

   character(len=*), parameter :: mesh_names = 'halfspace, paper'

contains

   !> The specimen that &simulation names.
   subroutine new_specimen_mesh(settings, specimen, error)
      type(simulation_settings_type), intent(in) :: settings
      class(specimen_mesh_type), allocatable, intent(out) :: specimen
      type(error_type), allocatable, intent(out) :: error

      select case (settings%mesh)
      case ('halfspace')
         specimen = halfspace_mesh_type(outer=settings%outer, growth=settings%growth)
      case ('paper')
         specimen = block_mesh_type(default_element='c3d8')
      case default
         call raise(error, "mesh: '"//settings%mesh//"' is unknown; allowed: "//mesh_names, exit_bad_input)
      end select
   end subroutine new_specimen_mesh

   !> The mesh to compare the one of this name with: the next of the list.
   pure function other_mesh(name) result(other)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: other
      character(len=len(mesh_names)), allocatable :: names(:)
      integer :: i

      allocate (names, source=split_list(mesh_names))
      do i = 1, size(names)
         if (names(i) == name) exit
      end do
      other = trim(names(modulo(i, size(names)) + 1))
   end function other_mesh
end module meshes
