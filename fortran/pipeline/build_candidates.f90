!> The crystals and orientations that a design chooses from, and those that it begins with.
module build_candidates
   use abstract_basis, only: basis_type
   use distinct_directions, only: new_region, region_type, spread_of_directions
   use errors, only: error_type
   use kinds, only: degree, wp
   use problem, only: problem_type
   use settings_groups, only: design_settings_type
   use sorting, only: sort_order
   use surrogate_domain, only: domain_type, spread_crystals
   use text, only: to_text
   implicit none
   private
   public :: candidates_type, new_candidates, initial_set

   type :: candidates_type
      !> Constants of the domain's class (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), allocatable :: constants(:, :), euler_deg(:, :)
   contains
      procedure :: n => count_candidates
   end type candidates_type

   !> Between the seeds of the two blocks of a Latin hypercube.
   integer, parameter :: seed_step = 1000003

contains

   !> The candidates that &design asks for.
   subroutine new_candidates(problem, basis, candidates, warning, error)
      type(problem_type), intent(in) :: problem
      class(basis_type), intent(in) :: basis
      type(candidates_type), intent(out) :: candidates
      !> '' if there is none.
      character(len=:), allocatable, intent(out) :: warning
      type(error_type), allocatable, intent(out) :: error
      integer :: first, seed
      real(wp), allocatable :: constants(:, :), euler_deg(:, :)

      warning = ''
      seed = problem%settings%problem%seed
      associate (design => problem%settings%design)
         if (allocated(problem%candidates)) then
            call take_table(problem, basis, candidates, warning)
         else if (design%candidates == 'factorial') then
            call factorial(basis%domain, design, seed, candidates, error)
         else
            ! The initial set is a hypercube of its own.
            first = merge(min(design%initial, design%n_candidates), 0, design%initial_set == 'latin')
            call spread_crystals(basis%domain, first, seed, candidates%constants, candidates%euler_deg, error)
            if (.not. allocated(error)) call spread_crystals(basis%domain, design%n_candidates - first, &
               & modulo(seed + seed_step, huge(seed)), constants, euler_deg, error)
            if (allocated(error)) return
            candidates%constants = reshape([candidates%constants, constants], [size(constants, 1), design%n_candidates])
            candidates%euler_deg = reshape([candidates%euler_deg, euler_deg], [3, design%n_candidates])
            if (design%orientations == 'declination') then
               ! Of a uniform direction the declination's cosine is uniform.
               candidates%euler_deg(2, :) = 90.0_wp*(1.0_wp - cos(degree*candidates%euler_deg(2, :)))
               candidates%euler_deg([1, 3], :) = 0.0_wp
            end if
         end if
      end associate
   end subroutine new_candidates

   pure integer function count_candidates(self)
      class(candidates_type), intent(in) :: self

      count_candidates = size(self%euler_deg, 2)
   end function count_candidates

   !> The rows of the user's table that the basis covers.
   subroutine take_table(problem, basis, candidates, warning)
      type(problem_type), intent(in) :: problem
      class(basis_type), intent(in) :: basis
      type(candidates_type), intent(out) :: candidates
      character(len=:), allocatable, intent(inout) :: warning
      logical, allocatable :: kept(:)
      integer :: i, j

      associate (table => problem%candidates, class => basis%domain%class)
         kept = [(basis%domain%admits(table%stiffness(:, :, i)), i=1, table%n)]
         allocate (candidates%constants(class%n_constants, count(kept)), candidates%euler_deg(3, count(kept)))
         j = 0
         do i = 1, table%n
            if (.not. kept(i)) cycle
            j = j + 1
            candidates%constants(:, j) = class%constants_of(table%stiffness(:, :, i))
            candidates%euler_deg(:, j) = table%euler_deg(:, i)
         end do
         if (j < table%n) warning = to_text(table%n - j)//' of '//to_text(table%n)//' candidates are outside the domain and are ' &
            & //'left out'
      end associate
   end subroutine take_table

   !> Crystals of a Latin hypercube, each in the same directions.
   subroutine factorial(domain, design, seed, candidates, error)
      type(domain_type), intent(in) :: domain
      type(design_settings_type), intent(in) :: design
      integer, intent(in) :: seed
      type(candidates_type), intent(out) :: candidates
      type(error_type), allocatable, intent(out) :: error
      type(region_type) :: region
      real(wp), allocatable :: crystals(:, :), unused(:, :), directions(:, :)
      integer :: i, j, k, m

      m = design%n_directions
      call spread_crystals(domain, max(1, design%n_candidates/m), seed, crystals, unused, error)
      if (allocated(error)) return
      call new_region(domain%class, region)
      call spread_of_directions(region, m, directions)
      allocate (candidates%constants(size(crystals, 1), size(crystals, 2)*m), candidates%euler_deg(3, size(crystals, 2)*m))
      do i = 1, size(crystals, 2)
         do j = 1, m
            k = (i - 1)*m + j
            candidates%constants(:, k) = crystals(:, i)
            candidates%euler_deg(:, k) = [0.0_wp, acos(min(1.0_wp, max(-1.0_wp, directions(3, j))))/degree, &
               & modulo(atan2(directions(1, j), directions(2, j))/degree, 360.0_wp)]
         end do
      end do
   end subroutine factorial

   !> Candidates that are simulated before the variance chooses: 'latin', the first; 'boundary', those at the ends of the ranges, each
   !> crystal once, in directions that take turns.
   subroutine initial_set(candidates, basis, design, numbers)
      type(candidates_type), intent(in) :: candidates
      class(basis_type), intent(in) :: basis
      type(design_settings_type), intent(in) :: design
      !> From 1.
      integer, allocatable, intent(out) :: numbers(:)
      real(wp), allocatable :: reach(:)
      integer, allocatable :: order(:), crystal(:), members(:)
      integer :: i, j, n_crystals, round, rounds, wanted

      wanted = min(design%initial, candidates%n())
      if (design%initial_set == 'latin') numbers = [(i, i=1, wanted)]
      if (.not. allocated(numbers)) allocate (numbers(0))
      if (design%initial_set /= 'boundary') return
      reach = [(basis%domain%normalised_distance(basis%domain%class%stiffness(candidates%constants(:, i))), i=1, candidates%n())]
      allocate (order(size(reach)), crystal(size(reach)))
      call sort_order(-reach, order)
      n_crystals = 0
      do i = 1, size(order)
         crystal(i) = 0
         do j = i - 1, 1, -1
            if (any(abs(candidates%constants(:, order(i)) - candidates%constants(:, order(j))) > 0.0_wp)) cycle
            crystal(i) = crystal(j)
            exit
         end do
         if (crystal(i) > 0) cycle
         n_crystals = n_crystals + 1
         crystal(i) = n_crystals
      end do
      rounds = maxval([(count(crystal == j), j=1, n_crystals)])
      do round = 0, rounds - 1
         do j = 1, n_crystals
            if (size(numbers) == wanted) return
            members = pack(order, crystal == j)
            if (round < size(members)) numbers = [numbers, members(1 + mod(j - 1 + round, size(members)))]
         end do
      end do
   end subroutine initial_set
end module build_candidates
