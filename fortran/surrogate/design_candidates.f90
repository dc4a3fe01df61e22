!> The crystals and orientations that a design chooses from, and those that it begins with.
module design_candidates
   use abstract_basis, only: basis_type
   use distinct_directions, only: new_region, region_type, spread_of_directions
   use errors, only: error_type
   use kinds, only: degree, wp
   use point_index, only: number_equal
   use problem, only: problem_type
   use settings_schema, only: design_settings_type
   use statistics, only: sort_order
   use surrogate_domain, only: domain_type, spread_crystals
   use text, only: to_text
   implicit none
   private
   public :: candidates_type, new_candidates, initial_set

   type :: candidates_type
      !> Constants of the domain's class (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), allocatable :: constants(:, :), euler_deg(:, :)
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
            call take_table(problem, basis%domain, candidates, warning)
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

   !> The rows of the user's table that are in the domain.
   subroutine take_table(problem, domain, candidates, warning)
      type(problem_type), intent(in) :: problem
      type(domain_type), intent(in) :: domain
      type(candidates_type), intent(out) :: candidates
      character(len=:), allocatable, intent(inout) :: warning
      integer, allocatable :: rows(:)
      integer :: i

      associate (table => problem%candidates)
         rows = pack([(i, i=1, table%n)], [(domain%admits(table%stiffness(:, :, i)), i=1, table%n)])
         allocate (candidates%constants(domain%class%n_constants, size(rows)))
         do i = 1, size(rows)
            candidates%constants(:, i) = domain%class%constants_of(table%stiffness(:, :, rows(i)))
         end do
         candidates%euler_deg = table%euler_deg(:, rows)
         if (size(rows) < table%n) warning = to_text(table%n - size(rows))//' of '//to_text(table%n) &
            & //' candidates are outside the domain and are left out'
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
      integer, allocatable :: order(:), crystal(:), firsts(:), members(:)
      integer :: i, j, n, round, wanted

      n = size(candidates%euler_deg, 2)
      wanted = min(design%initial, n)
      allocate (numbers(0))
      if (design%initial_set == 'latin') numbers = [(i, i=1, wanted)]
      if (design%initial_set /= 'boundary') return
      allocate (order(n))
      associate (domain => basis%domain, constants => candidates%constants)
         call sort_order([(-domain%normalised_distance(domain%class%stiffness(constants(:, i))), i=1, n)], order)
      end associate
      crystal = number_equal(candidates%constants(:, order))
      firsts = pack(crystal, crystal == [(i, i=1, n)])
      round = 0
      do while (size(numbers) < wanted)
         do j = 1, size(firsts)
            members = pack(order, crystal == firsts(j))
            if (round < size(members)) numbers = [numbers, members(1 + mod(j - 1 + round, size(members)))]
         end do
         round = round + 1
      end do
      numbers = numbers(:wanted)
   end subroutine initial_set
end module design_candidates
