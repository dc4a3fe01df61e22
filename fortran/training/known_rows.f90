!> The rows of a campaign that a build may use: with the constants of the domain's class, in order
!> of choice, and with the candidate of each.
module known_rows
   use abstract_basis, only: basis_type
   use campaign, only: row_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use sequential_design, only: candidates_type
   use errors, only: error_type
   use kinds, only: wp
   use statistics, only: number_equal
   use simulate, only: derivatives_of, n_derivatives, outcome_done
   use surrogate_model, only: simulations_type
   implicit none
   private
   public :: known_rows_type, select_rows

   !> Rows that may train a surrogate. The first `taken` are in the regression.
   type, extends(simulations_type) :: known_rows_type
      integer :: taken = 0
      !> Number of failed simulations.
      integer :: failed = 0
      !> The candidate of each row, 0: none. Number of usable rows before that of each candidate,
      !> which is done or failed; -1: the candidate has no row.
      integer, allocatable, private :: candidate(:), earlier(:)
      !> Whether a candidate may be chosen although it has a row: the row is not taken.
      logical, allocatable :: open(:)
   contains
      procedure :: n => count_left, divide, choose
   end type known_rows_type

contains

   !> Select the rows of a campaign that a build may use.
   subroutine select_rows(rows, basis, candidates, chosen_only, candidates_only, known, &
      & beyond, error)
      !> All rows, in order of choice.
      type(row_type), intent(in) :: rows(:)
      class(basis_type), intent(in) :: basis
      type(candidates_type), intent(in) :: candidates
      !> Leave out rows that were not imported: all, until the design chooses them again, or those
      !> that are not candidates.
      logical, intent(in) :: chosen_only, candidates_only
      type(known_rows_type), intent(out) :: known
      !> Number of rows outside the domain.
      integer, intent(out) :: beyond
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      integer, allocatable :: first_equal(:), same(:)
      !> Constants and angles of the candidates, then of the rows; stiffnesses of the rows, GPa.
      real(wp), allocatable :: points(:, :), stiffness(:, :, :)
      integer :: i, j, n_constants, n_candidates, n

      beyond = 0
      n = 0
      n_constants = basis%domain%class%n_constants
      allocate (known%constants(n_constants, size(rows)), known%euler_deg(3, size(rows)), &
         & known%modulus(size(rows)), known%by_stiffness(n_derivatives, size(rows)))
      n_candidates = size(candidates%euler_deg, 2)
      allocate (known%candidate(size(rows)), known%earlier(n_candidates))
      known%earlier = -1
      allocate (known%open(n_candidates), source=.false.)
      allocate (points(n_constants + 3, n_candidates + size(rows)), stiffness(6, 6, size(rows)))
      points(:n_constants, :n_candidates) = candidates%constants
      points(n_constants + 1:, :n_candidates) = candidates%euler_deg
      class = basis%domain%class
      do i = 1, size(rows)
         if (class%name /= rows(i)%symmetry) call new_crystal_class(rows(i)%symmetry, class, error)
         if (allocated(error)) return
         stiffness(:, :, i) = class%stiffness(rows(i)%constants)
         points(:, n_candidates + i) = &
            & [basis%domain%class%constants_of(stiffness(:, :, i)), rows(i)%euler_deg]
      end do
      first_equal = number_equal(points)
      do i = 1, size(rows)
         if (.not. basis%domain%is_of_class(stiffness(:, :, i)) &
            & .or. (chosen_only .and. .not. rows(i)%imported)) then
            cycle
         end if
         same = pack([(j, j=1, n_candidates)], &
            & first_equal(:n_candidates) == first_equal(n_candidates + i))
         if (candidates_only .and. size(same) == 0 .and. .not. rows(i)%imported) cycle
         known%earlier(same) = n
         if (rows(i)%outcome%status /= outcome_done) then
            known%failed = known%failed + 1
         else if (basis%domain%admits(stiffness(:, :, i))) then
            n = n + 1
            known%constants(:, n) = points(:n_constants, n_candidates + i)
            known%euler_deg(:, n) = rows(i)%euler_deg
            known%modulus(n) = rows(i)%outcome%modulus
            known%by_stiffness(:, n) = derivatives_of(rows(i)%outcome)
            known%candidate(n) = maxval([0, same])
         else
            beyond = beyond + 1
         end if
      end do
      call keep(known, [(i, i=1, n)])
   end subroutine select_rows

   !> Keep only these rows.
   subroutine keep(known, rows)
      type(known_rows_type), intent(inout) :: known
      integer, intent(in) :: rows(:)

      known%simulations_type = known%of_rows(rows)
      known%candidate = known%candidate(rows)
   end subroutine keep

   !> Number of rows that are not taken.
   pure integer function count_left(self)
      class(known_rows_type), intent(in) :: self

      count_left = size(self%modulus) - self%taken
   end function count_left

   !> Divide the candidates that have a row. A candidate is open if its row comes after those that
   !> are taken, and if all these later rows are of candidates. The others are `taken`.
   pure subroutine divide(self, taken)
      class(known_rows_type), intent(inout) :: self
      !> (candidate).
      logical, allocatable, intent(out) :: taken(:)

      self%open = self%earlier >= self%taken .and. all(self%candidate(self%taken + 1:) > 0)
      taken = self%earlier >= 0 .and. .not. self%open
   end subroutine divide

   !> Choose the candidates with these `numbers`: remove their rows that are not taken.
   subroutine choose(self, numbers)
      class(known_rows_type), intent(inout) :: self
      integer, intent(in) :: numbers(:)
      integer :: i

      self%open(numbers) = .false.
      call keep(self, pack([(i, i=1, size(self%modulus))], &
         & [(i <= self%taken .or. all(self%candidate(i) /= numbers), i=1, size(self%modulus))]))
   end subroutine choose
end module known_rows
