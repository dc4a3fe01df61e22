!> What is known of the constants before the measurements: bounds, stability, a cap on the anisotropy, the surrogate's domain,
!> and normal knowledge of single constants, of quantities derived from them, or of ratios.
!>
!> The support is the box of the stated bounds cut by Born's criterion, by the cap on Eq. 14 and by the surrogate's domain.
!> On it the density is uniform in the constants, times one normal factor for each piece of normal knowledge.
module constants_prior
   use abstract_basis, only: basis_type
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: anisotropy_index
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use quantities, only: evaluate_quantities, quantity_type
   use random, only: new_random_stream, random_stream_type
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: prior_type, new_prior, default_bounds, knowledge_type

   !> A quantity, known as mean ± sd in its unit.
   type :: knowledge_type
      type(quantity_type) :: quantity
      real(wp) :: mean = 0.0_wp, sd = 1.0_wp
   end type knowledge_type

   type :: prior_type
      type(crystal_class_type) :: class
      integer :: n_constants = 0
      !> Bounds of the constants, GPa: the stated ones, cut to the surrogate's where its coordinates are the constants.
      real(wp), allocatable :: lower(:), upper(:)
      real(wp) :: anisotropy_cap = huge(1.0_wp)
      !> Share of the stated domain that the surrogate's domain leaves, estimated.
      real(wp) :: share_inside = 1.0_wp
      type(quantity_type), allocatable, private :: known(:)
      real(wp), allocatable, private :: known_mean(:), known_sd(:)
      !> Of the surrogate: it says which crystals are covered.
      class(basis_type), allocatable, private :: basis
   contains
      procedure :: admits
      procedure :: log_density
   end type prior_type

   !> Points of the stated domain that are tried to see how much of it the surrogate covers.
   integer, parameter :: trials = 20000

contains

   !> Bounds `lower` and `upper` (GPa) where the user states none: the surrogate's box of constants, else wide enough for any metal.
   pure subroutine default_bounds(surrogate, lower, upper)
      type(surrogate_type), intent(in) :: surrogate
      real(wp), allocatable, intent(out) :: lower(:), upper(:)
      integer :: j

      if (.not. surrogate%basis%logarithmic) then
         lower = surrogate%basis%domain%lower
         upper = surrogate%basis%domain%upper
         return
      end if
      associate (names => surrogate%basis%domain%class%constants)
         lower = [(merge(10.0_wp, 1.0_wp, any(names(j) == [character(len=3) :: 'C11', 'C22', 'C33'])), j=1, size(names))]
         upper = [(merge(1000.0_wp, 600.0_wp, any(names(j) == [character(len=3) :: 'C11', 'C22', 'C33'])), j=1, size(names))]
      end associate
   end subroutine default_bounds

   !> The prior on `lower` .. `upper` (GPa) with the cap `anisotropy_cap` on Eq. 14, cut to the surrogate's domain.
   !>
   !> Bounds that the surrogate's domain does not meet at all are refused.
   subroutine new_prior(surrogate, lower, upper, anisotropy_cap, knowledge, prior, error)
      type(surrogate_type), intent(in) :: surrogate
      real(wp), intent(in) :: lower(:), upper(:), anisotropy_cap
      type(knowledge_type), intent(in) :: knowledge(:)
      type(prior_type), intent(out) :: prior
      type(error_type), allocatable, intent(out) :: error
      character(len=3), allocatable :: names(:)
      integer :: k, j

      k = surrogate%basis%domain%class%n_constants
      names = surrogate%basis%domain%class%constants
      if (size(lower) /= k .or. size(upper) /= k) then
         call raise(error, 'bounds are needed for each of '//to_text(k)//' constants, not '//to_text(size(lower)), &
            & exit_bad_input)
         return
      end if
      do j = 1, k
         if (.not. (upper(j) > lower(j) .and. upper(j) - lower(j) < huge(1.0_wp))) then
            call raise(error, names(j)//': the bounds '//to_text(lower(j))//' .. '//to_text(upper(j)) &
               & //' GPa are not an interval', exit_bad_input)
            return
         end if
      end do
      if (.not. anisotropy_cap > 0.0_wp) then
         call raise(error, 'anisotropy_cap = '//to_text(anisotropy_cap)//' must be positive', exit_bad_input)
         return
      end if
      do j = 1, size(knowledge)
         if (.not. (knowledge(j)%sd > 0.0_wp .and. abs(knowledge(j)%mean) < huge(1.0_wp))) then
            call raise(error, knowledge(j)%quantity%name//': a finite mean and an sd > 0 are needed, not ' &
               & //to_text(knowledge(j)%mean)//' and '//to_text(knowledge(j)%sd), exit_bad_input)
            return
         end if
      end do
      prior%class = surrogate%basis%domain%class
      prior%n_constants = k
      prior%lower = lower
      prior%upper = upper
      prior%anisotropy_cap = anisotropy_cap
      allocate (prior%known(size(knowledge)))
      do j = 1, size(knowledge)
         prior%known(j) = knowledge(j)%quantity
      end do
      prior%known_mean = knowledge%mean
      prior%known_sd = knowledge%sd
      allocate (prior%basis, source=surrogate%basis)
      call cut_to_surrogate(surrogate, prior, error)
   end subroutine new_prior

   !> Refuse bounds outside the box of a surrogate, cut the support to what it knows, and estimate how much of it is left.
   subroutine cut_to_surrogate(surrogate, prior, error)
      type(surrogate_type), intent(in) :: surrogate
      type(prior_type), intent(inout) :: prior
      type(error_type), allocatable, intent(out) :: error
      character(len=3), allocatable :: names(:)
      type(random_stream_type) :: stream
      real(wp) :: c(prior%n_constants), u, stated_cap
      integer :: i, j, stated, inside

      names = prior%class%constants
      stated_cap = prior%anisotropy_cap
      prior%anisotropy_cap = min(prior%anisotropy_cap, surrogate%basis%domain%anisotropy_cap)
      if (.not. prior%basis%logarithmic) then
         do j = 1, prior%n_constants
            if (prior%lower(j) < prior%basis%domain%lower(j) .or. prior%upper(j) > prior%basis%domain%upper(j)) then
               call raise(error, names(j)//': the bounds '//to_text(prior%lower(j))//' .. '//to_text(prior%upper(j)) &
                  & //' GPa are outside the surrogate''s domain; allowed: '//to_text(prior%basis%domain%lower(j))//' .. ' &
                  & //to_text(prior%basis%domain%upper(j))//' GPa, or a surrogate in dimensionless coordinates', exit_bad_input)
               return
            end if
         end do
      end if
      stream = new_random_stream(1, 0)
      stated = 0
      inside = 0
      do i = 1, trials
         do j = 1, prior%n_constants
            call stream%uniform(u)
            c(j) = prior%lower(j) + u*(prior%upper(j) - prior%lower(j))
         end do
         if (.not. anisotropy_index(prior%class%stiffness(c)) <= stated_cap) cycle
         stated = stated + 1
         if (prior%admits(c)) inside = inside + 1
      end do
      if (stated == 0) then
         call raise(error, 'no stable crystal was found within the bounds and the anisotropy cap '//to_text(stated_cap) &
            & //' ('//to_text(trials)//' tried)', exit_bad_input)
      else if (inside == 0) then
         call raise(error, 'the bounds are outside the surrogate''s domain: none of '//to_text(stated) &
            & //' stable crystals within them is inside it', exit_bad_input)
      else
         prior%share_inside = real(inside, wp)/stated
      end if
   end subroutine cut_to_surrogate

   !> Whether a crystal `c` (GPa) is in the support.
   pure logical function admits(self, c)
      class(prior_type), intent(in) :: self
      real(wp), intent(in) :: c(:)
      real(wp) :: stiffness(6, 6)
      integer :: j

      admits = .false.
      do j = 1, self%n_constants
         if (.not. (c(j) >= self%lower(j) .and. c(j) <= self%upper(j))) return
      end do
      stiffness = self%class%stiffness(c(:self%n_constants))
      if (self%anisotropy_cap < self%basis%domain%anisotropy_cap) then
         if (.not. anisotropy_index(stiffness) <= self%anisotropy_cap) return
      end if
      admits = self%basis%covers(stiffness)
   end function admits

   !> Logarithm of the normal factors at a crystal `c` (GPa) of the support; the constant of the uniform part is left out.
   pure real(wp) function log_density(self, c)
      class(prior_type), intent(in) :: self
      real(wp), intent(in) :: c(:)
      real(wp) :: values(size(self%known))

      log_density = 0.0_wp
      if (size(values) == 0) return
      call evaluate_quantities(self%known, self%class%stiffness(c(:self%n_constants)), values)
      log_density = -0.5_wp*sum(((values - self%known_mean)/self%known_sd)**2)
   end function log_density
end module constants_prior
