!> What a campaign has for a build: its rows by the constants of the domain's class, in order of
!> choice, and which candidates they are.
module known_rows
   use abstract_basis, only: basis_type
   use campaign, only: row_type
   use crystal_class, only: crystal_class_type, new_crystal_class
   use sequential_design, only: candidates_type
   use errors, only: error_type
   use kinds, only: wp
   use statistics, only: number_equal
   use simulate, only: outcome_done
   implicit none
   private
   public :: known_rows_type, select_rows

   !> Rows that are data, of which the first `taken` are in the regression.
   type :: known_rows_type
      integer :: taken = 0
      !> Constants (n_constants, n) and moduli (n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), allocatable :: constants(:, :), euler_deg(:, :), modulus(:)
      !> Simulations that failed.
      integer :: failed = 0
      !> The candidate that a row is, 0: none; how many rows were stored before that of each
      !> candidate, done or failed, below 0: it has none.
      integer, allocatable, private :: candidate(:), earlier(:)
      !> Candidates that have a row which is not taken, and may be chosen once more.
      logical, allocatable :: open(:)
   contains
      procedure :: n => count_left, divide, choose
   end type known_rows_type

contains

   !> The rows of a campaign that are data from the start.
   subroutine select_rows(rows, basis, candidates, chosen_only, candidates_only, known, &
      & beyond, error)
      !> All rows, in order of choice.
      type(row_type), intent(in) :: rows(:)
      class(basis_type), intent(in) :: basis
      type(candidates_type), intent(in) :: candidates
      !> Of what was simulated here only what the design chooses again; or only what is a candidate.
      logical, intent(in) :: chosen_only, candidates_only
      type(known_rows_type), intent(out) :: known
      !> How many are outside the domain.
      integer, intent(out) :: beyond
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      integer, allocatable :: first(:), same(:)
      !> Of the candidates, then of the rows: constants and angles.
      real(wp), allocatable :: points(:, :), c(:, :, :)
      integer :: i, j, k, m, n

      beyond = 0
      n = 0
      k = basis%domain%class%n_constants
      allocate (known%constants(k, size(rows)), known%euler_deg(3, size(rows)), &
         & known%modulus(size(rows)))
      m = size(candidates%euler_deg, 2)
      allocate (known%candidate(size(rows)), known%earlier(m))
      known%earlier = -1
      allocate (known%open(m), source=.false.)
      allocate (points(k + 3, m + size(rows)), c(6, 6, size(rows)))
      points(:k, :m) = candidates%constants
      points(k + 1:, :m) = candidates%euler_deg
      class = basis%domain%class
      do i = 1, size(rows)
         if (class%name /= rows(i)%symmetry) call new_crystal_class(rows(i)%symmetry, class, error)
         if (allocated(error)) return
         c(:, :, i) = class%stiffness(rows(i)%constants)
         points(:, m + i) = [basis%domain%class%constants_of(c(:, :, i)), rows(i)%euler_deg]
      end do
      first = number_equal(points)
      do i = 1, size(rows)
         if (.not. basis%domain%is_of_class(c(:, :, i)) &
            & .or. (chosen_only .and. .not. rows(i)%imported)) then
            cycle
         end if
         same = pack([(j, j=1, m)], first(:m) == first(m + i))
         if (candidates_only .and. size(same) == 0 .and. .not. rows(i)%imported) cycle
         known%earlier(same) = n
         if (rows(i)%outcome%status /= outcome_done) then
            known%failed = known%failed + 1
         else if (basis%domain%admits(c(:, :, i))) then
            n = n + 1
            known%constants(:, n) = points(:k, m + i)
            known%euler_deg(:, n) = rows(i)%euler_deg
            known%modulus(n) = rows(i)%outcome%modulus
            known%candidate(n) = maxval([0, same])
         else
            beyond = beyond + 1
         end if
      end do
      call keep(known, [(i, i=1, n)])
   end subroutine select_rows

   !> Keep these rows alone.
   subroutine keep(known, rows)
      type(known_rows_type), intent(inout) :: known
      integer, intent(in) :: rows(:)

      known%constants = known%constants(:, rows)
      known%euler_deg = known%euler_deg(:, rows)
      known%modulus = known%modulus(rows)
      known%candidate = known%candidate(rows)
   end subroutine keep

   !> Rows that are not taken.
   pure integer function count_left(self)
      class(known_rows_type), intent(in) :: self

      count_left = size(self%modulus) - self%taken
   end function count_left

   !> Divide the candidates that are in the campaign: those stored before the last row that is
   !> `taken`, and those that may be chosen once more, if all rows that are left are candidates.
   pure subroutine divide(self, taken)
      class(known_rows_type), intent(inout) :: self
      !> Of each candidate.
      logical, allocatable, intent(out) :: taken(:)

      self%open = self%earlier >= self%taken .and. all(self%candidate(self%taken + 1:) > 0)
      taken = self%earlier >= 0 .and. .not. self%open
   end subroutine divide

   !> The candidates with these `numbers` are chosen: their rows are not left over.
   subroutine choose(self, numbers)
      class(known_rows_type), intent(inout) :: self
      integer, intent(in) :: numbers(:)
      integer :: i

      self%open(numbers) = .false.
      call keep(self, pack([(i, i=1, size(self%modulus))], &
         & [(i <= self%taken .or. all(self%candidate(i) /= numbers), i=1, size(self%modulus))]))
   end subroutine choose
end module known_rows
