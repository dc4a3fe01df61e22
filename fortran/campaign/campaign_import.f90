!> `build --tell`: moduli of crystals that others computed, into the campaign of an output folder.
module campaign_import
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use campaign, only: campaign_name, campaign_type, row_type
   use crystal_class, only: crystal_class_type
   use errors, only: error_type, exit_bad_input, refuse, warning_type
   use json, only: json_type
   use kinds, only: wp
   use point_tables, only: points_type
   use problem, only: problem_type
   use simulate, only: identity_text, outcome_done, outcome_failed
   use surrogate_model, only: places_type
   use text, only: lower, to_text
   implicit none
   private
   public :: import_table, import_rows

   !> Relative difference of two moduli below which an imported row says the same as a stored one.
   real(wp), parameter :: same = 1.0e-6_wp

contains

   !> Import the rows of a table with modulus_gpa, which errors call `name`; the document says how many were new, and how many there are.
   subroutine import_table(problem, places, points, name, document, error)
      type(problem_type), intent(in) :: problem
      !> The folder of the results among them.
      type(places_type), intent(in) :: places
      type(points_type), intent(in) :: points
      character(len=*), intent(in) :: name
      !> JSON.
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(campaign_type) :: campaign
      type(row_type), allocatable :: rows(:)
      type(json_type) :: page
      integer, allocatable :: own(:)
      integer :: i, k, new, imported, simulations

      if (.not. all(ieee_is_finite(points%modulus_gpa))) then
         call refuse(error, name//': there must be a column modulus_gpa (GPa) with a value in every row')
         return
      end if
      if (allocated(problem%class%name) .and. allocated(problem%settings%domain%c_min)) then
         if (any([(points%classes(k)%name /= problem%class%name, k=1, size(points%classes))])) then
            call refuse(error, name//': there are crystals that are not '//problem%class%name//', which is the symmetry of ' &
               & //problem%path)
            return
         end if
      end if
      call campaign%open(places%output//campaign_name, identity_text(problem%settings), error)
      imported = 0
      simulations = 0
      do k = 1, size(points%classes)
         if (allocated(error)) return
         own = pack([(i, i=1, points%n)], points%class == k)
         associate (class => points%classes(k))
            call import_rows(campaign, class, points%constants(:class%n_constants, own), points%euler_deg(:, own), &
               & points%modulus_gpa(own), new, error)
            if (allocated(error)) error%message = name//': '//error%message
            imported = imported + new
            if (.not. allocated(error)) call campaign%rows(class%name, rows, error)
         end associate
         if (.not. allocated(error)) simulations = simulations + count(rows%outcome%status == outcome_done)
      end do
      if (allocated(error)) return
      call page%begin_object()
      call page%put('imported', imported)
      call page%put('simulations', simulations)
      call page%put('warnings', [warning_type ::])
      call page%end_object()
      document = page%text()
   end subroutine import_table

   !> Import results of others, of crystals of one class. Rows that are there already with the same modulus are skipped. Rows that
   !> contradict each other or a stored row are refused: then nothing is stored.
   subroutine import_rows(self, class, constants, euler_deg, modulus, n_new, error)
      type(campaign_type), intent(inout) :: self
      type(crystal_class_type), intent(in) :: class
      !> Of n crystals, GPa (k, n), and of n grains, degrees (3, n).
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      !> GPa (n).
      real(wp), intent(in) :: modulus(:)
      !> How many were not there.
      integer, intent(out) :: n_new
      type(error_type), allocatable, intent(out) :: error
      !> The position of the first that is new.
      integer :: first
      integer :: i

      n_new = 0
      call self%begin_change(error)
      if (.not. allocated(error)) call self%next_position(first, error)
      do i = 1, size(modulus)
         if (allocated(error)) exit
         call import_row(constants(:, i), euler_deg(:, i), modulus(i))
         if (.not. allocated(error)) cycle
         if (error%status == exit_bad_input) error%message = 'row '//to_text(i)//error%message
      end do
      call self%end_change(error)
      if (allocated(error)) n_new = 0

   contains

      !> Import one result.
      subroutine import_row(constants, euler_deg, modulus)
         real(wp), intent(in) :: constants(:), euler_deg(:), modulus
         type(row_type) :: row
         character(len=:), allocatable :: crystal
         logical :: found
         integer :: k

         if (.not. (ieee_is_finite(modulus) .and. modulus > 0.0_wp)) then
            call refuse(error, ': modulus_gpa is '//lower(to_text(modulus))//'; it must be positive')
            return
         end if
         call self%find(class%name, constants, euler_deg, row, found, error)
         if (allocated(error)) return
         if (.not. found) then
            row%position = first + n_new
            n_new = n_new + 1
            row%symmetry = class%name
            row%constants = constants
            row%euler_deg = euler_deg
            row%imported = .true.
            row%outcome%status = outcome_done
            row%outcome%modulus = modulus
            call self%add(row, error)
            return
         end if
         crystal = ''
         do k = 1, class%n_constants
            crystal = crystal//', '//class%constants(k)//' '//to_text(constants(k))
         end do
         crystal = ' ('//crystal(3:)//'): '
         if (row%outcome%status == outcome_failed) then
            call refuse(error, crystal//'the campaign has this point as failed ('//row%outcome%message//'); a stored row is ' &
               & //'never changed: leave the row out, or import into a new campaign')
         else if (abs(row%outcome%modulus - modulus) > same*modulus) then
            call refuse(error, crystal//'modulus_gpa is '//to_text(modulus)//', but the same point has ' &
               & //to_text(row%outcome%modulus)//' GPa '//trim(merge('in an earlier row', 'in the campaign  ', &
               & row%position >= first))//'; one of them is wrong or of another physics: leave one out, or import ' &
               & //'into a new campaign')
         end if
      end subroutine import_row
   end subroutine import_rows
end module campaign_import
