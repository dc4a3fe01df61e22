!> The tables of simulated crystals: `moduli.csv` and `curves.csv`, as the Python program writes them.
module batch_tables
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use abstract_observable, only: observable_type
   use campaign, only: row_type
   use errors, only: error_type
   use files, only: new_file_type
   use indenters, only: indenter_type, new_indenter
   use kinds, only: wp
   use numbers, only: short_text
   use observables, only: new_observable, observable_names
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
      class(observable_type), allocatable :: observable
      real(wp), allocatable :: moduli(:, :), slope(:)
      integer :: j

      kinds = split_list(observable_names)
      names = ''
      allocate (moduli(size(rows), size(kinds)), slope(size(rows)))
      associate (measured => self%settings%measurements)
         do j = 1, size(kinds)
            call new_observable(trim(kinds(j)), measured, observable, error)
            if (allocated(error)) return
            names = names//','//trim(kinds(j))//'_gpa'
            moduli(:, j) = rows%outcome%modulus
            slope = 1.0_wp
            call observable%from_simulation(moduli(:, j), slope)
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
      type(indenter_type) :: tip
      integer :: i, j

      call new_indenter(self%settings%indenter, tip, error)
      if (allocated(error)) return
      call file%begin(path)
      call file%add('point,depth_um,force_mn,modulus_gpa'//newline)
      do i = 1, size(rows)
         do j = 1, size(rows(i)%outcome%depth)
            associate (depth => rows(i)%outcome%depth(j), force => rows(i)%outcome%force(j))
               call file%add(to_text(i)//','//short_text(depth)//','//short_text(force)//',' &
                  & //short_text(force/tip%unit_force(depth))//newline)
            end associate
         end do
      end do
      call file%finish(error)
   end subroutine write_curves
end module batch_tables
