!> The prior of the constants: one rule for all crystal classes, within the surrogate's domain,
!> times normal factors for what is known.
!>
!> Bounds on all constants are the paper's prior, uniform over the stable crystals within them.
!> Otherwise the default prior applies, which has no edge: in log K the
!> contrast s = log(3K/2G) of the isotropic part is normal, the anisotropic coordinates are jointly
!> Student's t, and the scale tr log K/6 is normal about that of an isotropic solid with the mean
!> measurement. Single bounds and a cap on Eq. 14 truncate the prior.
module constants_prior
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: anisotropy_index, is_stable, kelvin_form
   use errors, only: error_type, refuse
   use kinds, only: pi, wp
   use linear_algebra, only: cholesky_factor
   use logarithmic_coordinates, only: log_coordinates_type, new_log_coordinates
   use quantities, only: evaluate_quantities, quantity_type, typical_crystal
   use random, only: new_random_stream, random_stream_type
   use small_matrices, only: factor_definite, fit_columns, solve_lower
   use surrogate_domain, only: domain_type
   use settings_schema, only: prior_settings_type
   use text, only: to_text
   implicit none
   private
   public :: prior_type, new_prior, knowledge_type, check_knowledge

   !> The default prior: mean and sd of the contrast; degrees of freedom of the k anisotropic
   !> coordinates, and their scale times the root of k; sd of the scale. Metals and minerals from
   !> beryllium (contrast 0.14) to indium (2.6) and graphite (log-anisotropy 5.1) lie within;
   !> docs/verification/inference.md compares other scales.
   real(wp), parameter :: contrast_mean = 1.07_wp, contrast_sd = 0.6_wp, freedom = 3.0_wp, &
      & anisotropy_scale = 0.6_wp, scale_sd = log(5.0_wp)
   !> Greatest log-anisotropy of the support: beyond it, stiffness matrices lose their digits.
   real(wp), parameter :: most_anisotropic = 10.0_wp
   !> Bounds that are absent, GPa, and the ends of the range of those that are stated. There a bound
   !> counts as absent.
   real(wp), parameter :: absent_lower = -1.0e6_wp, absent_upper = 1.0e6_wp, &
      & least_bound = -500.0_wp, greatest_bound = 5000.0_wp
   !> Half the width, in GPa and relative, of the interval about a constant whose bounds are equal.
   !> It is small enough for the constant to count as known, and lets the sampler move in all
   !> directions.
   real(wp), parameter, public :: least_width = 0.01_wp, relative_width = 2.0e-4_wp

   !> Quantities that are known: mean (n) and covariance (n, n), in their units.
   type :: knowledge_type
      type(quantity_type), allocatable :: quantities(:)
      real(wp), allocatable :: mean(:), covariance(:, :)
      !> Whether an sd was below the least one, (n).
      logical, allocatable :: is_sharp(:)
   contains
      procedure :: sd => sd_of_knowledge, widen
   end type knowledge_type

   type :: prior_type
      type(crystal_class_type) :: class
      type(log_coordinates_type) :: logarithms
      integer :: n_constants = 0
      !> Bounds of the constants, GPa; very wide ones for a bound that is not stated.
      real(wp), allocatable :: lower(:), upper(:)
      !> Whether equal bounds state a constant, (n_constants).
      logical, allocatable :: is_stated(:)
      !> Whether the default prior applies: some constant lacks a bound.
      logical :: has_default = .false.
      !> Greatest anisotropy index, Eq. 14.
      real(wp) :: anisotropy_cap = huge(1.0_wp)
      !> Young's modulus of an isotropic solid with the mean measurement, GPa, and the mean of the
      !> scale tr log K/6 in the default prior, K in GPa, which is that of this solid.
      real(wp) :: typical_young = 0.0_wp, typical_scale = 0.0_wp
      !> Factor on the sds of contrast and anisotropy in the default prior.
      real(wp) :: width = 1.0_wp
      !> Whether the density is one of log K, as the default is, and not of the constants.
      logical :: in_logarithms = .false.
      !> Estimated share of the prior, without its normal factors, for which the surrogate is valid,
      !> and share of the crystals from `draw_start` that lie in the support.
      real(wp) :: share_inside = 1.0_wp, share_drawn = 1.0_wp
      type(knowledge_type) :: knowledge
      !> Lower Cholesky factor of the covariance of the knowledge, (n, n).
      real(wp), allocatable, private :: factor(:, :)
      !> The surrogate's domain of validity.
      type(domain_type), allocatable :: domain
   contains
      procedure :: admits, deviations, log_density, log_mass, draw_start, is_drawn, &
         & has_bound, has_lower, has_upper, is_cut, without_limits, set_knowledge, &
         & log_density_of_constants
   end type prior_type

   !> Number of crystals that are drawn to estimate the share of the prior for which the surrogate
   !> is valid: the standard error of the share is below 0.4 %.
   integer, parameter :: trials = 20000

contains

   !> The prior that &prior and the knowledge state, within the surrogate's domain.
   subroutine new_prior(domain, class, stated, typical_young, knowledge, prior, error)
      !> The surrogate's domain of validity.
      type(domain_type), intent(in) :: domain
      type(crystal_class_type), intent(in) :: class
      !> Settings of &prior.
      type(prior_settings_type), intent(in) :: stated
      !> Young's modulus of an isotropic solid with the mean measurement, GPa.
      real(wp), intent(in) :: typical_young
      type(knowledge_type), intent(in) :: knowledge
      type(prior_type), intent(out) :: prior
      type(error_type), allocatable, intent(out) :: error
      !> Poisson's ratio of the isotropic solid.
      real(wp), parameter :: nu = 0.3_wp
      real(wp) :: width(class%n_constants)
      integer :: i

      prior%class = class
      prior%logarithms = new_log_coordinates(class)
      prior%n_constants = class%n_constants
      prior%lower = spread(absent_lower, 1, class%n_constants)
      prior%upper = spread(absent_upper, 1, class%n_constants)
      if (allocated(stated%c_min)) then
         prior%lower = merge(stated%c_min, absent_lower, stated%c_min > least_bound)
      end if
      if (allocated(stated%c_max)) then
         prior%upper = merge(stated%c_max, absent_upper, stated%c_max < greatest_bound)
      end if
      prior%has_default = any(prior%lower <= absent_lower .or. prior%upper >= absent_upper)
      prior%is_stated = spread(.false., 1, class%n_constants)
      if (allocated(stated%c_min) .and. allocated(stated%c_max)) then
         prior%is_stated = stated%c_max <= stated%c_min
      end if
      i = findloc(prior%is_stated, .true., dim=1)
      if (prior%has_default .and. i > 0) then
         call refuse(error, class%constants(i)//' has equal bounds, and another constant has ' &
            & //'none; state what is known in &knowledge: quantity = '''//class%constants(i) &
            & //''', mean, sd')
         return
      end if
      width = merge(max(least_width, relative_width*abs(prior%lower)), 0.0_wp, prior%is_stated)
      prior%lower = prior%lower - width
      prior%upper = prior%upper + width
      prior%typical_young = typical_young
      prior%typical_scale = (log(typical_young/(1.0_wp - 2.0_wp*nu)) &
         & + 5.0_wp*log(typical_young/(1.0_wp + nu)))/6.0_wp
      if (allocated(stated%anisotropy_cap)) prior%anisotropy_cap = stated%anisotropy_cap
      prior%in_logarithms = prior%has_default
      call prior%set_knowledge(knowledge, error)
      if (allocated(error)) return
      call estimate_share(domain, prior, error)
   end subroutine new_prior

   !> Set the normal factor of what is known.
   subroutine set_knowledge(self, knowledge, error)
      class(prior_type), intent(inout) :: self
      type(knowledge_type), intent(in) :: knowledge
      type(error_type), allocatable, intent(out) :: error

      self%knowledge = knowledge
      self%factor = knowledge%covariance
      call cholesky_factor(self%factor, error)
      if (allocated(error)) then
         call refuse(error, 'knowledge needs sds > 0, or a positive definite covariance')
      end if
   end subroutine set_knowledge

   !> Refuse knowledge that no crystal has: the nearest one deviates from it by more than 10 sds or,
   !> if it is at the edge of stability, by more than three.
   !>
   !> The least sum of squared deviations is found by damped Gauss-Newton steps in the coordinates
   !> of log K. A bulk modulus that is not that of a solid deviates, too: it follows from a wrong
   !> unit.
   subroutine check_knowledge(class, knowledge, error)
      type(crystal_class_type), intent(in) :: class
      type(knowledge_type), intent(in) :: knowledge
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: most_sds = 10.0_wp, most_at_edge = 3.0_wp, edge = 7.0_wp
      !> log 3K, K in GPa, of a usual solid, and how far those softer than rubber and stiffer than
      !> diamond are from it; the sd of the rest; and the step of differences.
      real(wp), parameter :: usual = log(300.0_wp), range = 5.0_wp, usual_sd = 0.1_wp, &
         & small = 1.0e-5_wp
      integer, parameter :: most_steps = 200
      type(prior_type) :: prior
      character(len=:), allocatable :: clash
      real(wp), dimension(size(knowledge%mean) + 1) :: r, moved
      real(wp), dimension(class%n_constants) :: w, step
      real(wp) :: slopes(size(r), size(w)), l(size(w), size(w)), values(size(knowledge%mean)), &
         & damping
      integer :: i, j

      call prior%set_knowledge(knowledge, error)
      if (allocated(error) .or. size(values) == 0) return
      prior%logarithms = new_log_coordinates(class)
      w = prior%logarithms%to_logarithms(typical_crystal(class, 0))
      r = residuals(w)
      damping = 1.0_wp
      do i = 1, most_steps
         if (norm2(r) < most_at_edge) return
         do j = 1, size(w)
            step = w
            step(j) = w(j) + small
            slopes(:, j) = (residuals(step) - r)/(small*damping)
         end do
         call fit_columns(-r, slopes, spread(1.0_wp, 1, size(r)), step, l)
         step = w + step/damping
         damping = 4.0_wp*damping
         if (.not. norm2(step(3:)) < most_anisotropic) cycle
         moved = residuals(step)
         if (.not. norm2(moved) < norm2(r)) cycle
         w = step
         r = moved
         damping = damping/16.0_wp
      end do
      if (norm2(r) < merge(most_at_edge, most_sds, norm2(w(3:)) > edge)) return
      call evaluate_quantities(knowledge%quantities, prior%logarithms%from_logarithms(w), values)
      clash = ''
      associate (deviations => abs(values - knowledge%mean)/knowledge%sd())
         do i = 1, size(values)
            if (deviations(i) < 0.5_wp*maxval(deviations)) cycle
            clash = clash//', '//knowledge%quantities(i)%name//' = '//to_text(values(i), 4) &
               & //' instead of '//to_text(knowledge%mean(i))
         end do
      end associate
      call refuse(error, 'no stable solid has this knowledge; the nearest one, by ' &
         & //to_text(nint(norm2(r)))//' sd, has '//clash(3:)//'. Check values and units')

   contains

      !> Deviations of the crystal at w from the knowledge, in sds, uncorrelated; then that of its
      !> bulk modulus from a usual one.
      function residuals(w)
         real(wp), intent(in) :: w(:)
         real(wp) :: residuals(size(knowledge%mean) + 1)

         residuals = [prior%deviations(prior%logarithms%from_logarithms(w)), &
            & max(0.0_wp, abs(w(1) - usual) - range)/usual_sd]
      end function residuals
   end subroutine check_knowledge

   !> Make sds that are very small relative to the values larger: draws would miss the tails of a
   !> density that is so thin.
   pure subroutine widen(self)
      class(knowledge_type), intent(inout) :: self
      real(wp), parameter :: least_sd = 1.0e-3_wp, rounding = 1.0e-9_wp
      integer :: i

      self%is_sharp = self%sd() < (least_sd - rounding)*abs(self%mean)
      do i = 1, size(self%mean)
         if (self%is_sharp(i)) self%covariance(i, i) = (least_sd*self%mean(i))**2
      end do
   end subroutine widen

   !> Standard deviations of the quantities, (n).
   pure function sd_of_knowledge(self) result(sd)
      class(knowledge_type), intent(in) :: self
      real(wp) :: sd(size(self%mean))
      integer :: j

      sd = [(sqrt(self%covariance(j, j)), j=1, size(sd))]
   end function sd_of_knowledge

   !> Truncate the support by the surrogate's domain, and estimate which share of it remains.
   subroutine estimate_share(domain, prior, error)
      type(domain_type), intent(in) :: domain
      type(prior_type), intent(inout) :: prior
      type(error_type), allocatable, intent(out) :: error
      type(random_stream_type) :: stream
      real(wp) :: x(prior%n_constants), c(6, 6)
      integer :: i, n_admitted, n_inside

      ! Without limits only crystals of extreme anisotropy are outside the support: less than 1e-3.
      if (.not. (prior%is_cut() .or. domain%is_limited())) then
         prior%domain = domain
         return
      end if
      stream = new_random_stream(1, 0)
      n_admitted = 0
      n_inside = 0
      do i = 1, trials
         call prior%draw_start(stream, x)
         c = prior%class%stiffness(x)
         if (.not. prior%admits(x, c)) cycle
         n_admitted = n_admitted + 1
         if (domain%admits(c)) n_inside = n_inside + 1
      end do
      prior%domain = domain
      prior%share_inside = real(n_inside, wp)/max(1, n_admitted)
      prior%share_drawn = real(n_inside, wp)/trials
      if (n_admitted == 0) then
         call refuse(error, 'no stable crystal was found within the bounds and limits of the ' &
            & //'prior ('//to_text(trials)//' tried); state narrow ones as &knowledge')
      else if (n_inside == 0) then
         call refuse(error, 'the prior is outside the surrogate''s domain: none of ' &
            & //to_text(n_admitted)//' crystals of it is inside')
      end if
   end subroutine estimate_share

   !> Whether `draw_start` can sample the prior itself: its draws have the density of the prior, and
   !> enough of them lie in the support.
   pure logical function is_drawn(self)
      class(prior_type), intent(in) :: self
      !> 50 draws for each in the support are still cheap.
      real(wp), parameter :: least_share = 0.02_wp

      is_drawn = size(self%knowledge%mean) == 0 .and. self%share_drawn > least_share
   end function is_drawn

   !> Whether at least one bound of the constant j is stated.
   pure logical function has_bound(self, j)
      class(prior_type), intent(in) :: self
      integer, intent(in) :: j

      has_bound = self%has_lower(j) .or. self%has_upper(j)
   end function has_bound

   !> Whether the lower bound of the constant j is stated.
   pure logical function has_lower(self, j)
      class(prior_type), intent(in) :: self
      integer, intent(in) :: j

      has_lower = self%lower(j) > absent_lower
   end function has_lower

   !> Whether the upper bound of the constant j is stated.
   pure logical function has_upper(self, j)
      class(prior_type), intent(in) :: self
      integer, intent(in) :: j

      has_upper = self%upper(j) < absent_upper
   end function has_upper

   !> Whether stated bounds or a cap limit the support.
   pure logical function is_cut(self)
      class(prior_type), intent(in) :: self
      integer :: j

      is_cut = self%anisotropy_cap < huge(1.0_wp) &
         & .or. any([(self%has_bound(j), j=1, self%n_constants)])
   end function is_cut

   !> The default prior with the same knowledge and without stated limits.
   pure type(prior_type) function without_limits(self) result(other)
      class(prior_type), intent(in) :: self

      other = self
      other%lower = absent_lower
      other%upper = absent_upper
      other%anisotropy_cap = huge(1.0_wp)
      other%has_default = .true.
      other%in_logarithms = .true.
      other%share_drawn = 1.0_wp
   end function without_limits

   !> Logarithm of the integral over the working coordinates of the density without the normal
   !> factors of the knowledge, as `log_density` and `log_volume` give it. The evidence of a model
   !> is divided by it.
   pure real(wp) function log_mass(self)
      class(prior_type), intent(in) :: self
      real(wp) :: matrix(self%n_constants, self%n_constants), x(self%n_constants)
      integer :: j, k

      log_mass = log(self%share_drawn)
      if (self%has_default) then
         ! A normal density in contrast and scale, whose Jacobian is 1/sqrt 5, and Student's t.
         k = self%n_constants - 2
         log_mass = log_mass + log(2.0_wp*pi*sqrt(5.0_wp)*contrast_sd*scale_sd) &
            & + (k + 1)*log(self%width)
         if (k > 0) then
            log_mass = log_mass + log_gamma(0.5_wp*freedom) - log_gamma(0.5_wp*(freedom + k)) &
               & + 0.5_wp*k*log(freedom*pi*anisotropy_scale**2/k)
         end if
         return
      end if
      ! The constant that `log_volume` leaves out: at K = 1 the derivative of log K is that of K.
      do k = 1, self%n_constants
         x = 0.0_wp
         x(k) = 1.0_wp
         do j = 1, self%n_constants
            matrix(j, k) = sum(self%logarithms%basis(:, :, j)*kelvin_form(self%class%stiffness(x)))
         end do
      end do
      matrix = matmul(transpose(matrix), matrix)
      call factor_definite(matrix, 0.0_wp)
      x = 0.0_wp
      log_mass = log_mass + sum(log(self%upper - self%lower)) &
         & + sum([(log(matrix(k, k)), k=1, size(x))]) + self%logarithms%log_volume(x)
   end function log_mass

   !> Whether a crystal is in the support.
   pure logical function admits(self, x, c, anisotropy)
      class(prior_type), intent(in) :: self
      !> Constants (n_constants) and stiffness in crystal axes, GPa.
      real(wp), intent(in) :: x(:), c(6, 6)
      !> The log-anisotropy, if the caller has it. It also implies that the crystal is stable.
      real(wp), intent(in), optional :: anisotropy

      admits = .false.
      if (.not. all(x >= self%lower .and. x <= self%upper)) return
      if (present(anisotropy)) then
         if (.not. anisotropy <= most_anisotropic) return
      else
         if (.not. is_stable(c)) return
      end if
      if (self%anisotropy_cap < huge(1.0_wp)) then
         if (.not. anisotropy_index(c) <= self%anisotropy_cap) return
      end if
      admits = .true.
      if (.not. allocated(self%domain)) return
      if (self%domain%is_limited()) admits = self%domain%admits(c)
   end function admits

   !> Logarithm of the density at a crystal of the support, up to a constant: of the default prior
   !> in the coordinates of log K, of others in the constants.
   pure real(wp) function log_density(self, c, w)
      class(prior_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      !> Coordinates of its log K, (n_constants).
      real(wp), intent(in) :: w(:)
      integer :: k

      log_density = 0.0_wp
      if (self%has_default) then
         ! The first two coordinates are log 3K and sqrt(5) log 2G of the isotropic part.
         k = size(w) - 2
         associate (contrast => w(1) - w(2)/sqrt(5.0_wp), &
            & scale => (w(1) + sqrt(5.0_wp)*w(2))/6.0_wp, &
            & squares => sum((w(3:)/(self%width*anisotropy_scale))**2))
            log_density = -0.5_wp*(((contrast - contrast_mean)/(self%width*contrast_sd))**2 &
               & + ((scale - self%typical_scale)/scale_sd)**2) &
               & - 0.5_wp*(freedom + k)*log(1.0_wp + k*squares/freedom)
         end associate
      end if
      if (size(self%knowledge%mean) == 0) return
      log_density = log_density - 0.5_wp*sum(self%deviations(c)**2)
   end function log_density

   !> Logarithm of the density of the constants at a crystal of the support, up to a constant.
   pure real(wp) function log_density_of_constants(self, c) result(log_density)
      class(prior_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)

      associate (w => self%logarithms%to_logarithms(c))
         log_density = self%log_density(c, w)
         if (self%in_logarithms) log_density = log_density - self%logarithms%log_volume(w)
      end associate
   end function log_density_of_constants

   !> Deviations of a crystal from the knowledge, in sds, uncorrelated, (n).
   pure function deviations(self, c)
      class(prior_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: deviations(size(self%knowledge%mean))

      call evaluate_quantities(self%knowledge%quantities, c, deviations)
      deviations = deviations - self%knowledge%mean
      call solve_lower(self%factor, deviations)
   end function deviations

   !> A crystal to start a chain at, in the support or not: uniform between the bounds if all are
   !> stated, else a draw of the default prior.
   subroutine draw_start(self, stream, x)
      class(prior_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> Constants, GPa.
      real(wp), intent(out) :: x(:)
      real(wp) :: z(self%n_constants + int(freedom)), w(self%n_constants), contrast, scale
      integer :: j

      if (.not. self%has_default) then
         do j = 1, self%n_constants
            call stream%uniform(x(j))
         end do
         x = self%lower + x*(self%upper - self%lower)
         return
      end if
      call stream%normals(z)
      contrast = contrast_mean + contrast_sd*z(1)
      scale = self%typical_scale + scale_sd*z(2)
      w(1) = scale + 5.0_wp/6.0_wp*contrast
      w(2) = sqrt(5.0_wp)*(scale - contrast/6.0_wp)
      associate (k => self%n_constants - 2)
         w(3:) = anisotropy_scale/sqrt(real(max(1, k), wp))*z(3:k + 2) &
            & /sqrt(sum(z(k + 3:)**2)/freedom)
      end associate
      x = self%class%constants_of(self%logarithms%from_logarithms(w))
   end subroutine draw_start
end module constants_prior
