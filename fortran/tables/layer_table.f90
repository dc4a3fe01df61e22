!> Layers of a film from the surface downwards, one of which is the crystal that is indented. The
!> CSV has the columns `layer` and `thickness_um`. The row `crystal` has no elastic constants; the
!> others have `young_gpa` and `nu`, or `symmetry`, the constants of the class, and angles if the
!> crystal is turned. A last row without a thickness is the half-space; else the base is rigid.
module layer_table
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: check_stiffness, isotropic_stiffness, rotate_stiffness, &
      & rotation_matrix
   use errors, only: error_type, prefix_error, refuse
   use kinds, only: degree, wp
   use table_columns, only: angle_columns, find_column
   use tables, only: read_table, table_type
   use text, only: to_text
   implicit none
   private
   public :: layer_table_type, read_layers

   type :: layer_table_type
      type(table_type) :: table
      !> um, of all rows but the half-space.
      real(wp), allocatable :: thickness(:)
      !> In sample axes, GPa, (6, 6, row); 0 for the crystal.
      real(wp), allocatable :: stiffness(:, :, :)
      !> Row of the crystal.
      integer :: crystal = 0
   end type layer_table_type

   !> Allowed thicknesses, um.
   real(wp), parameter :: thinnest = 1.0e-6_wp, thickest = 1.0e6_wp

contains

   !> Read the layers of a file.
   subroutine read_layers(path, self, error)
      character(len=*), intent(in) :: path
      type(layer_table_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: name, thickness, i

      call read_table(path, self%table, error)
      call find_column(self%table, 'layer', name, error, .true.)
      call find_column(self%table, 'thickness_um', thickness, error, .true.)
      if (allocated(error)) return
      associate (table => self%table)
         allocate (self%thickness(0), self%stiffness(6, 6, table%rows), source=0.0_wp)
         do i = 1, table%rows
            if (.not. (i == table%rows .and. table%is_empty(thickness, i))) call add_thickness()
            if (allocated(error)) return
            if (table%cell(name, i) /= 'crystal') then
               call read_stiffness()
               call prefix_error(error, 'line '//to_text(table%line(i))//': ')
            else if (self%crystal > 0) then
               call table%refuse(name, i, ' is there twice; one layer is indented', error)
            else if (has_cell('young_gpa') .or. has_cell('symmetry')) then
               call table%refuse(name, i, ' is the layer that is indented; it has no constants', &
                  & error)
            else
               self%crystal = i
            end if
            if (allocated(error)) return
         end do
      end associate
      if (self%crystal == 0) then
         call refuse(error, 'the row ''crystal'' is missing: which layer is the crystal?')
      else if (size(self%thickness) == 0) then
         call refuse(error, &
            & 'there is no layer on the half-space; geometry = ''halfspace'' has none')
      end if

   contains

      !> Append the thickness of row i.
      subroutine add_thickness()
         real(wp) :: value

         call self%table%number(thickness, i, value, error)
         if (allocated(error)) return
         if (.not. (value >= thinnest .and. value <= thickest)) then
            call self%table%refuse(thickness, i, ' um; allowed '//to_text(thinnest)//' to ' &
               & //to_text(thickest)//' um', error)
            return
         end if
         self%thickness = [self%thickness, value]
      end subroutine add_thickness

      !> Read the stiffness of row i, GPa.
      subroutine read_stiffness()
         type(crystal_class_type) :: class
         real(wp), allocatable :: constants(:)
         real(wp) :: young, nu, euler_deg(3)
         integer :: k

         if (has_cell('symmetry') .and. has_cell('young_gpa')) then
            call refuse(error, 'young_gpa and symmetry; one of them is allowed')
            return
         end if
         if (.not. has_cell('symmetry')) then
            call read_cell('young_gpa', young)
            call read_cell('nu', nu)
            if (allocated(error)) return
            if (.not. (young > 0.0_wp .and. nu > -1.0_wp .and. nu < 0.5_wp)) then
               call refuse(error, 'young_gpa = '//to_text(young)//' and nu = '//to_text(nu) &
                  & //'; allowed above 0 GPa, and above -1 to below 0.5')
               return
            end if
            self%stiffness(:, :, i) = isotropic_stiffness(young, nu)
            return
         end if
         call new_crystal_class(self%table%cell(self%table%find('symmetry'), i), class, error)
         if (allocated(error)) return
         allocate (constants(class%n_constants))
         do k = 1, size(constants)
            call read_cell(class%constants(k), constants(k))
         end do
         do k = 1, size(angle_columns)
            euler_deg(k) = 0.0_wp
            if (self%table%find(trim(angle_columns(k)%name)) > 0) then
               call read_cell(trim(angle_columns(k)%name), euler_deg(k))
            end if
         end do
         if (allocated(error)) return
         call check_stiffness(class%stiffness(constants), error)
         self%stiffness(:, :, i) = rotate_stiffness(class%stiffness(constants), &
            & rotation_matrix(degree*euler_deg))
      end subroutine read_stiffness

      !> Whether the table has a column with a cell in row i.
      logical function has_cell(name)
         character(len=*), intent(in) :: name

         has_cell = .not. self%table%is_empty(self%table%find(name), i)
      end function has_cell

      !> Read the number of a column in row i.
      subroutine read_cell(name, value)
         character(len=*), intent(in) :: name
         real(wp), intent(out) :: value
         integer :: column

         value = 0.0_wp
         call find_column(self%table, name, column, error, .true.)
         if (column > 0) call self%table%number(column, i, value, error)
      end subroutine read_cell
   end subroutine read_layers
end module layer_table
