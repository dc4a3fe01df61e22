!> The tables of simulated crystals: `moduli.csv` and `curves.csv`, as the Python program writes them.
module batch_tables
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
   use campaign, only: row_type
   use errors, only: error_type
   use files, only: new_file_type
   use indenters, only: indenter_type, new_indenter
   use kinds, only: wp
   use modulus_kinds, only: modulus_kind_names, modulus_map_type, new_modulus_map
   use numbers, only: number_text
   use problem, only: problem_type
   use simulate, only: outcome_done
   use tables, only: csv_cell
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
      character(len=:), allocatable :: kinds(:), line
      type(modulus_map_type) :: map
      type(new_file_type) :: file
      real(wp), allocatable :: moduli(:, :), slope(:)
      logical :: kept(self%crystals%table%columns)
      integer :: i, j, k

      kinds = split_list(modulus_kind_names)
      allocate (moduli(size(rows), size(kinds)), slope(size(rows)))
      associate (measured => self%settings%measurements)
         do j = 1, size(kinds)
            call new_modulus_map(trim(kinds(j)), measured%indenter_modulus_gpa, measured%indenter_nu, measured%sample_nu, &
               & map, error)
            if (allocated(error)) return
            moduli(:, j) = rows%outcome%modulus
            slope = 1.0_wp
            call map%apply(moduli(:, j), slope)
            where (rows%outcome%status /= outcome_done) moduli(:, j) = ieee_value(1.0_wp, ieee_quiet_nan)
         end do
      end associate
      associate (table => self%crystals%table)
         do j = 1, table%columns
            kept(j) = .not. any([(table%cell(j, 0) == trim(kinds(k))//'_gpa', k=1, size(kinds))])
         end do
         call file%begin(path)
         do i = 0, size(rows)
            line = ''
            do j = 1, table%columns
               if (kept(j)) line = line//csv_cell(table%cell(j, i))//','
            end do
            do j = 1, size(kinds)
               if (i == 0) line = line//trim(kinds(j))//'_gpa,'
               if (i > 0) line = line//short_text(moduli(max(i, 1), j))//','
            end do
            call file%add(line(:len(line) - 1)//newline)
         end do
         call file%finish(error)
      end associate
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

   !> A number for people: ten digits at most, nothing where it is not finite.
   function short_text(number) result(text)
      real(wp), intent(in) :: number
      character(len=:), allocatable :: text
      character(len=24) :: digits
      real(wp) :: rounded

      text = ''
      if (.not. ieee_is_finite(number)) return
      write (digits, '(es24.9e3)') number
      read (digits, '(es24.0)') rounded
      text = number_text(rounded)
      if (index(text, '.0') == len(text) - 1) text = text(:len(text) - 2)
   end function short_text
end module batch_tables
