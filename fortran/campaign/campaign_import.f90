!> `build --tell`: import moduli that other programs computed into the campaign of a folder.
module campaign_import
   use campaign, only: campaign_name, campaign_type, row_type
   use campaign_file, only: begin_transaction, end_transaction
   use crystal_class, only: crystal_class_type
   use errors, only: error_type, prefix_error, refuse
   use files, only: printable
   use json, only: json_type
   use kinds, only: wp
   use point_tables, only: points_type
   use problem, only: problem_type
   use simulate, only: identity_text, outcome_done, outcome_failed
   use surrogate_model, only: places_type
   use text, only: line_type, to_text
   implicit none
   private
   public :: import_table, import_points

   !> Relative difference of two moduli below which they count as equal.
   real(wp), parameter :: tolerance = 1.0e-6_wp

contains

   !> Import the rows of a table that has modulus_gpa. The document has the number of new rows, that
   !> of all simulations, and that of failures.
   subroutine import_table(problem, places, points, name, document, error)
      type(problem_type), intent(in) :: problem
      !> With the folder of the results.
      type(places_type), intent(in) :: places
      type(points_type), intent(in) :: points
      !> Name of the table in messages.
      character(len=*), intent(in) :: name
      !> JSON.
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(campaign_type) :: campaign
      type(row_type), allocatable :: rows(:)
      type(json_type) :: page
      character(len=len(rows%symmetry)), allocatable :: names(:)
      integer :: k, n_new

      allocate (names(size(points%classes)))
      do k = 1, size(names)
         names(k) = points%classes(k)%name
      end do
      if (.not. any(points%modulus_gpa > 0.0_wp) .and. points%table%find('reason') == 0) then
         call refuse(error, name//': there must be a column modulus_gpa (GPa) with a value, or a ' &
            & //'column reason with the cause of each failure')
      else if (allocated(problem%class%name) .and. allocated(problem%settings%domain%c_min)) then
         if (any(names /= problem%class%name)) then
            call refuse(error, name//': there are crystals that are not '//problem%class%name &
               & //', which is the symmetry of '//problem%run%path)
         end if
      end if
      if (allocated(error)) return
      call campaign%open(places%output//campaign_name, identity_text(problem%settings), error)
      if (allocated(error)) return
      call import_points(campaign, points, n_new, error)
      call prefix_error(error, name//': ')
      if (allocated(error)) return
      call campaign%rows(rows, error)
      if (allocated(error)) return
      rows = pack(rows, [(any(rows(k)%symmetry == names), k=1, size(rows))])
      call page%begin_object('')
      call page%put('imported', n_new)
      call page%put('simulations', count(rows%outcome%status == outcome_done))
      call page%put('failed', count(rows%outcome%status == outcome_failed))
      call page%put('warnings', [line_type ::])
      call page%end_object()
      document = page%text()
   end subroutine import_table

   !> Import results. A row without a modulus is a failure if its column `reason` has the cause, and
   !> has no result yet otherwise. Rows that are stored already with the same outcome are skipped.
   !> If a row contradicts another one or a stored one, it is refused and nothing is stored.
   subroutine import_points(self, points, n_new, error)
      type(campaign_type), intent(inout) :: self
      !> Crystals with moduli.
      type(points_type), intent(in) :: points
      !> Number of rows that were not stored before.
      integer, intent(out) :: n_new
      type(error_type), allocatable, intent(out) :: error
      !> Why the simulation of the row failed, or ''.
      character(len=:), allocatable :: failure
      !> Position of the first new row; column of the reasons.
      integer :: first, reason, i

      n_new = 0
      reason = points%table%find('reason')
      call self%file%run(begin_transaction, error)
      call self%next_position(first, error)
      do i = 1, points%n
         if (allocated(error)) exit
         failure = ''
         if (.not. points%modulus_gpa(i) > 0.0_wp) then
            if (reason > 0) failure = printable(points%table%cell(reason, i))
            if (len(failure) == 0) cycle
         end if
         associate (class => points%classes(points%class(i)))
            call import_row(class, points%constants(:class%n_constants, i), &
               & points%euler_deg(:, i), points%modulus_gpa(i))
         end associate
      end do
      call end_transaction(self%file, error)

   contains

      !> Import one result.
      subroutine import_row(class, constants, euler_deg, modulus)
         type(crystal_class_type), intent(in) :: class
         real(wp), intent(in) :: constants(:), euler_deg(:), modulus
         type(row_type) :: row
         character(len=:), allocatable :: crystal
         logical :: found
         integer :: k

         call self%find(class%name, constants, euler_deg, row, found, error)
         if (allocated(error)) return
         if (.not. found) then
            row%position = first + n_new
            n_new = n_new + 1
            row%symmetry = class%name
            row%constants = constants
            row%euler_deg = euler_deg
            row%imported = .true.
            row%outcome%status = merge(outcome_done, outcome_failed, len(failure) == 0)
            row%outcome%modulus = modulus
            row%outcome%message = failure
            call self%add(row, error)
            return
         end if
         crystal = ''
         do k = 1, class%n_constants
            crystal = crystal//', '//class%constants(k)//' '//to_text(constants(k))
         end do
         crystal = 'row '//to_text(i)//' ('//crystal(3:)//'): '
         if (row%outcome%status == outcome_failed) then
            if (len(failure) > 0) return
            call refuse(error, crystal//'the campaign has this point as failed (' &
               & //row%outcome%message//'); a stored row is never changed: leave the row out, or ' &
               & //'import into a new campaign')
         else if (.not. abs(row%outcome%modulus - modulus) <= tolerance*modulus) then
            call refuse(error, crystal//'modulus_gpa is '//to_text(modulus) &
               & //', but the same point has '//to_text(row%outcome%modulus)//' GPa ' &
               & //trim(merge('in an earlier row', 'in the campaign  ', row%position >= first)) &
               & //'; one of them is wrong or of another physics: leave one out, or import into ' &
               & //'a new campaign')
         end if
      end subroutine import_row
   end subroutine import_points
end module campaign_import
