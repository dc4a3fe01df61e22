!> What is written of crystals that were simulated, or given to the theory: tables, and their rows in a document.
module crystal_tables
   use campaign, only: row_type
   use errors, only: error_type
   use files, only: new_file_type
   use abstract_indenter, only: indenter_type
   use abstract_observable, only: observable_type
   use indenters, only: new_indenter
   use json, only: json_type
   use kinds, only: pi, wp
   use observables, only: moduli_of_indentation, new_observable
   use point_tables, only: points_type
   use problem, only: problem_type
   use simulate, only: outcome_done
   use tables, only: write_table
   use text, only: newline, short_text, split_list, to_text
   implicit none
   private
   public :: write_moduli, write_curves, begin_crystal, put_outcome

contains

   !> The table of the crystals as it was given, with every kind of modulus, GPa; nothing where there is none.
   subroutine write_moduli(problem, path, modulus, error)
      type(problem_type), intent(in) :: problem
      character(len=*), intent(in) :: path
      !> Indentation moduli, GPa; NaN: none.
      real(wp), intent(in) :: modulus(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: kinds(:), names
      class(observable_type), allocatable :: observable
      real(wp), allocatable :: moduli(:, :)
      real(wp) :: slope(size(modulus))
      integer :: j

      allocate (kinds, source=split_list(moduli_of_indentation))
      allocate (moduli(size(modulus), size(kinds)))
      names = ''
      associate (measured => problem%settings%measurements)
         do j = 1, size(kinds)
            call new_observable(trim(kinds(j)), measured, observable, error)
            if (allocated(error)) return
            names = names//','//trim(kinds(j))//'_gpa'
            moduli(:, j) = modulus
            slope = 1.0_wp
            call observable%from_simulation(moduli(:, j), slope)
         end do
      end associate
      call write_table(problem%crystals%table, path, names, moduli, error)
   end subroutine write_moduli

   !> Force (mN) over depth (um) of every crystal, by its row from 1, with the modulus of each depth alone (GPa).
   subroutine write_curves(problem, path, rows, error)
      type(problem_type), intent(in) :: problem
      character(len=*), intent(in) :: path
      type(row_type), intent(in) :: rows(:)
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file
      class(indenter_type), allocatable :: indenter
      integer :: i, j

      call new_indenter(problem%settings%indenter, indenter, error)
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

   !> Begin the object of the crystal of a `row`: its constants by name, GPa, and its angles, degrees.
   subroutine begin_crystal(page, points, row)
      type(json_type), intent(inout) :: page
      type(points_type), intent(in) :: points
      integer, intent(in) :: row
      integer :: j

      call page%begin_object()
      call page%begin_object('constants')
      associate (class => points%classes(points%class(row)))
         do j = 1, class%n_constants
            call page%put(class%constants(j), points%constants(j, row))
         end do
      end associate
      call page%end_object()
      call page%put('euler_deg', points%euler_deg(:, row))
   end subroutine begin_crystal

   !> What became of its simulation.
   subroutine put_outcome(page, row, indenter)
      type(json_type), intent(inout) :: page
      type(row_type), intent(in) :: row
      class(indenter_type), intent(in) :: indenter

      associate (outcome => row%outcome)
         call page%put_if(outcome%status == outcome_done, 'indentation_modulus_gpa', outcome%modulus)
         if (outcome%elements > 0) call page%put('elements', outcome%elements)
         if (outcome%elements == 0) call page%put_null('elements')
         call page%put_if(outcome%seconds > 0.0_wp, 'seconds', outcome%seconds)
         call page%put('depth_um', outcome%depth)
         call page%put('force_mn', outcome%force)
         call page%put('modulus_by_depth_gpa', outcome%force/indenter%unit_force(outcome%depth))
         ! 4/(3 pi) M a/R under a paraboloid.
         call page%put_if(outcome%status == outcome_done, 'mean_pressure_gpa', &
            & outcome%modulus*indenter%unit_force(indenter%depth)/(pi*indenter%contact_radius**2))
      end associate
   end subroutine put_outcome
end module crystal_tables
