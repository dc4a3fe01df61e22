!> What is known of the constants before the measurements: one rule for all classes, bounds, stability, limits of anisotropy, what the
!> surrogate covers, and normal knowledge.
!>
!> The support holds the Born-stable crystals whose Poisson's ratio (Hill) is that of a metal or mineral, whose log-anisotropy is not
!> beyond what is known of crystals, and whose Young's modulus (Hill) is within a factor of what the mean measurement would be on an
!> isotropic solid. What is stated replaces its part: bounds of all constants on both sides the two limits of the averages, a cap on
!> Eq. 14 the limit of the log-anisotropy. On the support the density is uniform in the constants or in log K, times the normal factor
!> of what is known.
module constants_prior
   use abstract_basis, only: basis_type
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: anisotropy_of_averages, averages_type, hill_young_poisson, log_anisotropy, polycrystal_averages
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use logarithmic_coordinates, only: log_coordinates_type, log_frame_type, new_log_coordinates
   use quantities, only: evaluate_quantities, quantity_type
   use random, only: new_random_stream, random_stream_type
   use small_matrices, only: solve_lower
   use settings_schema, only: prior_settings_type
   use text, only: to_text
   implicit none
   private
   public :: prior_type, new_prior, knowledge_type

   !> Limits where nothing is stated.
   real(wp), parameter :: least_poisson = 0.05_wp, greatest_poisson = 0.48_wp, greatest_log_anisotropy = 2.5_wp, &
      & young_factor = 3.0_wp
   !> GPa; what is not within is no bound.
   real(wp), parameter :: no_lower = -1.0e6_wp, no_upper = 1.0e6_wp

   !> Quantities of which mean (n) and covariance (n, n) are known, in their units.
   type :: knowledge_type
      type(quantity_type), allocatable :: quantities(:)
      real(wp), allocatable :: mean(:), covariance(:, :)
   contains
      procedure :: sd => sd_of_knowledge
   end type knowledge_type

   type :: prior_type
      type(crystal_class_type) :: class
      type(log_coordinates_type) :: logarithms
      integer :: n_constants = 0
      !> Bounds of the constants, GPa; where none is stated these are wide.
      real(wp), allocatable :: lower(:), upper(:)
      !> Whether both bounds of all constants are stated.
      logical :: has_box = .false.
      !> On Eq. 14, and on the norm of the anisotropic part of log K.
      real(wp) :: anisotropy_cap = huge(1.0_wp), log_anisotropy_max = huge(1.0_wp)
      !> Of Hill's averages; Young's modulus in GPa.
      real(wp) :: poisson(2) = [-1.0_wp, 0.5_wp], young(2) = [0.0_wp, huge(1.0_wp)]
      !> Uniform in log K, not in the constants.
      logical :: in_logarithms = .false.
      !> Share of the prior, without its normal factors, that the surrogate covers, estimated.
      real(wp) :: share_inside = 1.0_wp
      !> The range of the scale (geometric mean of the eigenvalues of the Kelvin stiffness, GPa) to which the surrogate is limited.
      real(wp) :: known_scale(2) = [0.0_wp, huge(1.0_wp)]
      type(knowledge_type) :: knowledge
      !> Lower Cholesky factor of the covariance of what is known, (n, n).
      real(wp), allocatable, private :: factor(:, :)
      !> Of the surrogate: it says which crystals are covered.
      class(basis_type), allocatable, private :: basis
      !> GPa: middle of the range of Young's modulus from which starts are drawn.
      real(wp), private :: typical_young = 100.0_wp
   contains
      procedure :: admits
      procedure :: log_density
      procedure :: draw_start
      procedure :: is_stated
      procedure :: set_knowledge
   end type prior_type

   !> Points of the stated domain that are tried to see how much of it the surrogate covers.
   integer, parameter :: trials = 20000

contains

   !> The prior that is stated, over what a surrogate covers.
   subroutine new_prior(basis, class, stated, typical_young, knowledge, prior, error)
      class(basis_type), intent(in) :: basis
      type(crystal_class_type), intent(in) :: class
      !> Of &prior.
      type(prior_settings_type), intent(in) :: stated
      !> Young's modulus of an isotropic solid with the mean measurement, GPa.
      real(wp), intent(in) :: typical_young
      type(knowledge_type), intent(in) :: knowledge
      type(prior_type), intent(out) :: prior
      type(error_type), allocatable, intent(out) :: error
      !> On both sides of a constant whose bounds are equal: it is known, and the sampler moves in all directions. GPa, and relative.
      real(wp), parameter :: least_width = 0.01_wp, relative_width = 2.0e-4_wp
      real(wp) :: width(class%n_constants)

      prior%class = class
      prior%logarithms = new_log_coordinates(class)
      prior%n_constants = class%n_constants
      prior%lower = spread(no_lower, 1, class%n_constants)
      prior%upper = spread(no_upper, 1, class%n_constants)
      if (allocated(stated%c_min)) prior%lower = stated%c_min
      if (allocated(stated%c_max)) prior%upper = stated%c_max
      prior%has_box = all(prior%lower > no_lower) .and. all(prior%upper < no_upper)
      width = merge(0.0_wp, max(least_width, relative_width*abs(prior%lower)), prior%upper > prior%lower)
      prior%lower = prior%lower - width
      prior%upper = prior%upper + width
      prior%typical_young = typical_young
      if (.not. prior%has_box) then
         prior%poisson = [least_poisson, greatest_poisson]
         prior%young = typical_young*[1.0_wp/young_factor, young_factor]
      end if
      if (allocated(stated%anisotropy_cap)) then
         prior%anisotropy_cap = stated%anisotropy_cap
      else
         prior%log_anisotropy_max = greatest_log_anisotropy
      end if
      prior%in_logarithms = stated%measure == 'logarithms'
      call prior%set_knowledge(knowledge, error)
      if (.not. allocated(error)) call estimate_share(basis, prior, error)
   end subroutine new_prior

   !> Multiply the uniform density by another normal factor.
   subroutine set_knowledge(self, knowledge, error)
      class(prior_type), intent(inout) :: self
      type(knowledge_type), intent(in) :: knowledge
      type(error_type), allocatable, intent(out) :: error

      self%knowledge = knowledge
      self%factor = knowledge%covariance
      call cholesky_factor(self%factor, error)
      if (allocated(error)) call raise(error, 'knowledge needs sds > 0, or a positive definite covariance', exit_bad_input)
   end subroutine set_knowledge

   !> sds of what is known, (n).
   pure function sd_of_knowledge(self) result(sd)
      class(knowledge_type), intent(in) :: self
      real(wp) :: sd(size(self%mean))
      integer :: j

      sd = [(sqrt(self%covariance(j, j)), j=1, size(sd))]
   end function sd_of_knowledge

   !> Cut the support to what the surrogate covers, and estimate how much of it is left.
   subroutine estimate_share(basis, prior, error)
      class(basis_type), intent(in) :: basis
      type(prior_type), intent(inout) :: prior
      type(error_type), allocatable, intent(out) :: error
      type(random_stream_type) :: stream
      real(wp) :: x(prior%n_constants), c(6, 6), log_weights(trials), weights(trials)
      logical :: inside(trials)
      integer :: i, n

      stream = new_random_stream(1, 0)
      n = 0
      do i = 1, trials
         call prior%draw_start(stream, x, log_weights(n + 1))
         c = prior%class%stiffness(x)
         if (.not. prior%admits(x, c)) cycle
         n = n + 1
         associate (logarithms => prior%logarithms)
            if (prior%in_logarithms .eqv. prior%has_box) log_weights(n) = log_weights(n) &
               & + merge(-1.0_wp, 1.0_wp, prior%has_box)*logarithms%log_volume_at(logarithms%to_logarithms(c))
         end associate
         inside(n) = basis%domain%admits(c)
      end do
      allocate (prior%basis, source=basis)
      if (size(basis%domain%lower) == 0) prior%known_scale = basis%domain%stiffness
      if (n == 0) then
         call raise(error, 'no stable crystal was found within the bounds and limits of the prior ('//to_text(trials)//' tried)', &
            & exit_bad_input)
         return
      end if
      weights(:n) = exp(log_weights(:n) - maxval(log_weights(:n)))
      prior%share_inside = sum(pack(weights(:n), inside(:n)))/sum(weights(:n))
      if (.not. any(inside(:n))) call raise(error, 'the prior is outside the surrogate''s domain: none of '//to_text(n) &
         & //' crystals of it is inside', exit_bad_input)
   end subroutine estimate_share

   !> Whether the constant j has a bound.
   pure logical function is_stated(self, j)
      class(prior_type), intent(in) :: self
      integer, intent(in) :: j

      is_stated = self%lower(j) > no_lower .or. self%upper(j) < no_upper
   end function is_stated

   !> Whether a crystal is in the support.
   pure logical function admits(self, x, c, anisotropy)
      class(prior_type), intent(in) :: self
      !> Constants (n_constants) and stiffness in crystal axes, GPa.
      real(wp), intent(in) :: x(:), c(6, 6)
      !> The log-anisotropy, if it is known.
      real(wp), intent(in), optional :: anisotropy
      type(averages_type) :: averages
      real(wp) :: young, poisson
      integer :: j

      admits = .false.
      do j = 1, self%n_constants
         if (.not. (x(j) >= self%lower(j) .and. x(j) <= self%upper(j))) return
      end do
      averages = polycrystal_averages(c)
      ! The averages of an unstable crystal are NaN.
      if (.not. anisotropy_of_averages(averages) <= self%anisotropy_cap) return
      if (.not. self%has_box) then
         call hill_young_poisson(averages, young, poisson)
         if (.not. (young >= self%young(1) .and. young <= self%young(2))) return
         if (.not. (poisson >= self%poisson(1) .and. poisson <= self%poisson(2))) return
      end if
      if (self%log_anisotropy_max < huge(1.0_wp)) then
         if (present(anisotropy)) then
            if (.not. anisotropy <= self%log_anisotropy_max) return
         else
            if (.not. log_anisotropy(c) <= self%log_anisotropy_max) return
         end if
      end if
      admits = .true.
      if (allocated(self%basis)) admits = self%basis%domain%admits(c)
   end function admits

   !> Logarithm of the normal factor at a crystal `c` (GPa) of the support; the uniform part is left out.
   pure real(wp) function log_density(self, c)
      class(prior_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: values(size(self%knowledge%mean))

      log_density = 0.0_wp
      if (size(values) == 0) return
      call evaluate_quantities(self%knowledge%quantities, c, values)
      values = values - self%knowledge%mean
      call solve_lower(self%factor, values)
      log_density = -0.5_wp*sum(values**2)
   end function log_density

   !> A crystal to begin with, in the support or not: uniform in the box if there is one, else an isotropic one with anisotropy added,
   !> uniform in the ball of log-anisotropies that are allowed.
   subroutine draw_start(self, stream, x, log_weight)
      class(prior_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> Constants, GPa.
      real(wp), intent(out) :: x(:)
      !> What the density of the draws lacks to be uniform, in the constants with a box and in log K without.
      real(wp), intent(out) :: log_weight
      real(wp), parameter :: wider = 1.3_wp
      type(log_frame_type) :: frame
      real(wp) :: u, young, nu, w(self%n_constants), c(6, 6), radius
      integer :: j, free

      log_weight = 0.0_wp
      if (self%has_box) then
         do j = 1, self%n_constants
            call stream%uniform(u)
            x(j) = self%lower(j) + u*(self%upper(j) - self%lower(j))
         end do
         return
      end if
      call stream%uniform(u)
      young = self%typical_young*(young_factor*wider)**(2.0_wp*u - 1.0_wp)
      call stream%uniform(u)
      nu = 0.02_wp + 0.47_wp*u
      ! Coordinates along unit matrices of multiplicity one and five.
      w(1) = log(young/(1.0_wp - 2.0_wp*nu))
      w(2) = sqrt(5.0_wp)*log(young/(1.0_wp + nu))
      log_weight = log(1.0_wp/(1.0_wp + nu) + 2.0_wp/(1.0_wp - 2.0_wp*nu))
      free = self%n_constants - 2
      if (free > 0) then
         do j = 3, self%n_constants
            call stream%normal(w(j))
         end do
         call stream%uniform(u)
         radius = min(self%log_anisotropy_max, 2.0_wp*greatest_log_anisotropy)*u**(1.0_wp/free)
         w(3:) = radius*w(3:)/norm2(w(3:))
      end if
      call self%logarithms%from_logarithms(w, c, frame)
      x = self%class%constants_of(c)
   end subroutine draw_start
end module constants_prior
