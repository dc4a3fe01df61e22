!> `build --tell`: moduli of crystals that others computed, into the campaign of an output folder.
module campaign_import
   use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
   use campaign, only: campaign_name, campaign_type, row_type
   use errors, only: error_type, exit_bad_input, raise
   use json, only: json_type
   use physics_identity, only: identity_text
   use point_tables, only: points_type
   use problem, only: problem_type
   use simulate, only: outcome_done
   use surrogate_lookup, only: places_type
   use warning_lists, only: warning_type
   implicit none
   private
   public :: import_table

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
         call raise(error, name//': there must be a column modulus_gpa (GPa) with a value in every row', exit_bad_input)
         return
      end if
      if (allocated(problem%class%name) .and. allocated(problem%settings%domain%c_min)) then
         if (any([(points%classes(k)%name /= problem%class%name, k=1, size(points%classes))])) then
            call raise(error, name//': there are crystals that are not '//problem%class%name//', which is the symmetry of ' &
               & //problem%path, exit_bad_input)
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
            call campaign%import_rows(class, points%constants(:class%n_constants, own), points%euler_deg(:, own), &
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
end module campaign_import
