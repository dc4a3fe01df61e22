!> `simulate`: simulate every crystal of &crystals. The campaign of the output folder stores each
!> simulation as soon as it is done.
module simulate_stage
   use abstract_stage, only: job_type, stage_type
   use campaign, only: campaign_name, row_type
   use stage_documents, only: begin_crystal, cells_of_numbers, write_moduli
   use diagnostics, only: diagnostic_type
   use errors, only: error_type, raise
   use files, only: new_file_type
   use indenters, only: indenter_type, new_indenter
   use json, only: json_type
   use kinds, only: nan, pi, wp
   use statistics, only: number_equal
   use simulate, only: identity_text, outcome_done, outcome_failed, outcome_waiting, &
      & simulation_error
   use text, only: newline, to_text
   implicit none
   private
   public :: simulate_stage_type

   type, extends(stage_type) :: simulate_stage_type
      private
      !> Number of each crystal in the batch, which has equal crystals in equal orientations once.
      integer, allocatable :: place(:)
   contains
      procedure :: begin, finish
   end type simulate_stage_type

contains

   !> Put every distinct crystal into the batch.
   subroutine begin(self, error)
      class(simulate_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: rows(self%problem%data%crystals%n)
      !> Class, angles and constants of each crystal; the first crystal that has the same ones.
      real(wp) :: keys(4 + size(self%problem%data%crystals%constants, 1), size(rows))
      integer :: first(size(rows)), i

      associate (points => self%problem%data%crystals)
         do i = 1, size(rows)
            associate (row => rows(i), class => points%classes(points%class(i)))
               row%symmetry = class%name
               row%constants = points%constants(:class%n_constants, i)
               row%euler_deg = points%euler_deg(:, i)
            end associate
         end do
         keys(1, :) = points%class
         keys(2:4, :) = points%euler_deg
         keys(5:, :) = points%constants
         first = number_equal(keys)
         associate (chosen => pack([(i, i=1, size(rows))], first == [(i, i=1, size(rows))]))
            self%place = [(findloc(chosen, first(i), 1), i=1, size(rows))]
            self%rows = rows(chosen)
            self%batch = [(job_type(points%stiffness(:, :, chosen(i)), &
               & points%euler_deg(:, chosen(i))), i=1, size(chosen))]
         end associate
      end associate
      call self%campaign%open(self%output//'/'//campaign_name, &
         & identity_text(self%problem%settings), error)
      if (.not. allocated(error)) call self%look_up(.false., error)
      self%n_expected = count(self%rows%outcome%status == outcome_waiting)
   end subroutine begin

   !> Write moduli.csv, curves.csv and the document.
   subroutine finish(self, page, error)
      class(simulate_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      class(indenter_type), allocatable :: indenter
      type(diagnostic_type), allocatable :: warnings(:)
      real(wp), dimension(size(self%place)) :: largest, modulus
      type(row_type) :: rows(size(self%place))
      !> Relative error above which a modulus counts as a failure. The campaign stores it.
      real(wp), parameter :: most_error = 0.05_wp
      integer :: i, failed

      rows = self%rows(self%place)
      call simulation_error(self%problem%settings, self%problem%data%crystals%stiffness, &
         & largest, warnings)
      do i = 1, size(rows)
         if (largest(i) <= most_error .or. rows(i)%outcome%status == outcome_failed) cycle
         rows(i)%outcome%status = outcome_failed
         rows(i)%outcome%message = 'its modulus may err by more than 5 %; refine the mesh'
         rows(i)%outcome%depth = [real(wp) ::]
         rows(i)%outcome%force = rows(i)%outcome%depth
      end do
      modulus = merge(rows%outcome%modulus, nan, rows%outcome%status == outcome_done)
      call write_moduli(self%problem, self%output//'/moduli.csv', modulus, error)
      if (.not. allocated(error)) call new_indenter(self%problem%settings%indenter, indenter, error)
      if (.not. allocated(error)) call write_curves()
      failed = count(rows%outcome%status == outcome_failed)
      if (failed == size(rows) .and. .not. allocated(error)) then
         call raise(error, 'every simulation failed: crystal 1 could not be simulated: ' &
            & //rows(1)%outcome%message)
      end if
      if (allocated(error)) return
      call page%begin_array('results')
      do i = 1, size(rows)
         call begin_crystal(page, self%problem%data%crystals, i)
         call page%put('indentation_modulus_gpa', modulus(i))
         associate (outcome => rows(i)%outcome)
            if (outcome%elements > 0) call page%put('elements', outcome%elements)
            if (outcome%elements == 0) call page%put_json('elements', 'null')
            call page%put('seconds', merge(outcome%seconds, nan, outcome%seconds > 0.0_wp))
            call page%put('depth_um', outcome%depth)
            call page%put('force_mn', outcome%force)
            call page%put('modulus_by_depth_gpa', outcome%force/indenter%unit_force(outcome%depth))
            ! The mean pressure is 4/(3 pi) M a/R under a paraboloid.
            call page%put('mean_pressure_gpa', &
               & modulus(i)*indenter%unit_force(indenter%depth)/(pi*indenter%contact_radius**2))
            if (outcome%status == outcome_failed) then
               call self%warn('simulation_failed', outcome%message, [real(i, wp)])
            end if
         end associate
         call page%end_object()
      end do
      call page%end_array()
      call page%put('new_simulations', self%n_new)
      call page%put('failed', failed)
      self%warnings = [self%warnings, warnings]
      self%done = to_text(size(rows))//' crystals, '//to_text(self%n_new)//' new, ' &
         & //to_text(failed)//' failed: '//self%output//'/moduli.csv'

   contains

      !> Write force (mN) and modulus (GPa) at each depth (um) of every crystal, numbered from 1.
      subroutine write_curves()
         type(new_file_type) :: file
         integer :: i, j

         call file%add('point,depth_um,force_mn,modulus_gpa'//newline)
         do i = 1, size(rows)
            do j = 1, size(rows(i)%outcome%depth)
               associate (depth => rows(i)%outcome%depth(j), force => rows(i)%outcome%force(j))
                  call file%add(to_text(i) &
                     & //cells_of_numbers([depth, force, force/indenter%unit_force(depth)]))
               end associate
            end do
         end do
         call file%finish(self%output//'/curves.csv', error)
      end subroutine write_curves
   end subroutine finish
end module simulate_stage
