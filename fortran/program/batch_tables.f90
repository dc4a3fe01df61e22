!> The tables of simulated crystals: `moduli.csv` and `curves.csv`, as the Python program writes them.
module batch_tables
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use abstract_indenter, only: indenter_type
   use campaign, only: row_type
   use errors, only: error_type
   use files, only: new_file_type
   use indenters, only: new_indenter
   use kinds, only: wp
   use modulus_kinds, only: modulus_kind_names, modulus_map_type, new_modulus_map
   use numbers, only: short_text
   use problem, only: problem_type
   use simulate, only: outcome_done
   use table_writer, only: write_table
   use text, only: split_list, to_text
   implicit none
   private
   public :: write_moduli, write_curves

   character, parameter :: newline = achar(10)

contains

   !> The table of the crystals as it was given, with every kind of modulus, GPa; nothing where the simulation failed.
   subroutine write_moduli(self, path, rows, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: path
      type(row_type), intent(in) :: rows(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: kinds(:), names
      type(modulus_map_type) :: map
      real(wp), allocatable :: moduli(:, :), slope(:)
      integer :: j

      kinds = split_list(modulus_kind_names)
      names = ''
      allocate (moduli(size(rows), size(kinds)), slope(size(rows)))
      associate (measured => self%settings%measurements)
         do j = 1, size(kinds)
            call new_modulus_map(trim(kinds(j)), measured%indenter_modulus_gpa, measured%indenter_nu, measured%sample_nu, &
               & map, error)
            if (allocated(error)) return
            names = names//','//trim(kinds(j))//'_gpa'
            moduli(:, j) = rows%outcome%modulus
            slope = 1.0_wp
            call map%apply(moduli(:, j), slope)
            where (rows%outcome%status /= outcome_done) moduli(:, j) = ieee_value(1.0_wp, ieee_quiet_nan)
         end do
      end associate
      call write_table(self%crystals%table, path, names, moduli, error)
   end subroutine write_moduli

   !> Force (mN) over depth (um) of every point, by its row from 1, with the modulus of each depth alone (GPa).
   subroutine write_curves(self, path, rows, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: path
      type(row_type), intent(in) :: rows(:)
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file
      class(indenter_type), allocatable :: indenter
      integer :: i, j

      call new_indenter(self%settings%indenter, indenter, error)
      if (allocated(error)) return
      call file%begin(path)
      call file%add('point,depth_um,force_mn,modulus_gpa'//newline)
      do i = 1, size(rows)
         do j = 1, size(rows(i)%outcome%depth)
            associate (depth => rows(i)%outcome%depth(j), force => rows(i)%outcome%force(j))
               call file%add(to_text(i)//','//short_text(depth)//','//short_text(force)//',' &
                  & //short_text(force/indenter%unit_force(depth))//newline)
            end associate
         end do
      end do
      call file%finish(error)
   end subroutine write_curves
end module batch_tables
