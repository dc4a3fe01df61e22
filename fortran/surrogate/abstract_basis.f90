!> Interface of bases. A surrogate is linear in the terms of its basis: functions of a crystal and
!> its orientation from which the indentation modulus M follows.
!>
!> y = Σ A_k term_k, and M = scale y or, with a logarithmic basis, M = scale exp(spread y). The
!> noise of a regression is one number in units of y; in the modulus it grows with the spread of the
!> crystal. A family of bases is a module that extends `basis_type` and `grain_model_type`, and a
!> case in `bases`.
module abstract_basis
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use kinds, only: degree, wp
   use settings_schema, only: surrogate_settings_type
   use surrogate_domain, only: domain_type
   implicit none
   private
   public :: basis_type, grain_model_type, spread_of

   !> Power of the log-anisotropy with which the noise grows; it was chosen on 390 crystals
   !> (docs/verification/surrogate.md).
   integer, parameter, public :: growth_power = 3

   type, abstract :: basis_type
      !> Crystals for which the basis was made, and settings of &surrogate. Everything else follows
      !> from these.
      type(domain_type) :: domain
      type(surrogate_settings_type) :: settings
      integer :: n_terms = 0
      !> Whether M = scale exp(spread y) rather than scale y.
      logical :: logarithmic = .false.
      !> Least sd of the noise in a regression, in units of y.
      real(wp) :: least_noise = 0.0_wp
      !> Growth of the noise with the crystal's anisotropy, see `spread_of`.
      real(wp) :: noise_growth = 0.0_wp
      !> sds of a coefficient and of the noise before the first regression, in units of y.
      real(wp) :: first_sds(2) = 1.0_wp
      !> Degree of each term, (n_terms), from which the prior sd of its coefficient follows: 0 is
      !> almost free, and above 1 the sd decays from degree to degree. Unallocated if all have the
      !> same sd (Eq. 6).
      integer, allocatable :: prior_degrees(:)
   contains
      procedure(set_up_interface), deferred :: set_up
      procedure(evaluate_many_interface), deferred :: evaluate_many
      procedure(new_grain_model_interface), deferred :: new_grain_model
      procedure :: evaluate_crystals, to_y, to_modulus
   end type basis_type

   !> Moduli of certain grains by a surrogate, as a function of the crystal alone. What depends on
   !> the orientations is computed once.
   type, abstract :: grain_model_type
      !> Number of columns of the factor of the covariance of y.
      integer :: n_columns = 0
      !> Degree of the surface harmonics of the compliance field, even, where the model contains the
      !> theory. Set it before the grains.
      integer :: field_degree = 12
      logical :: has_theory = .false.
      !> Growth of the noise with the crystal's anisotropy, see `spread_of`.
      real(wp) :: noise_growth = 0.0_wp
      !> Log-anisotropy above which a crystal has moduli of the exact theory rather than of the
      !> field.
      real(wp) :: full_above = huge(1.0_wp)
      !> Approximate times of one crystal, microseconds: by the field, and by the exact theory.
      real(wp) :: field_cost = 0.0_wp, full_cost = 0.0_wp
   contains
      procedure(set_grains_interface), deferred :: set_grains
      procedure(evaluate_crystals_interface), deferred :: evaluate_crystals
      procedure(evaluate_columns_interface), deferred :: evaluate_columns
      procedure :: evaluate_moduli, use_field_up_to
   end type grain_model_type

   abstract interface
      !> Compute what follows from `domain` and `settings`.
      subroutine set_up_interface(self, error)
         import
         class(basis_type), intent(inout) :: self
         type(error_type), allocatable, intent(out) :: error
      end subroutine set_up_interface

      !> Terms of many crystals. The last bits may differ from those of each crystal alone.
      subroutine evaluate_many_interface(self, c, euler, terms, scale, spread)
         import
         class(basis_type), intent(in) :: self
         !> Stiffness in crystal axes of stable crystals, GPa, (6, 6, n); Bunge-Euler angles,
         !> radians, (3, n).
         real(wp), intent(in) :: c(:, :, :), euler(:, :)
         !> (n_terms, n); GPa, (n); relative, (n).
         real(wp), intent(out) :: terms(:, :), scale(:), spread(:)
      end subroutine evaluate_many_interface

      !> Make a grain model, without grains yet, of a surrogate with this posterior.
      subroutine new_grain_model_interface(self, class, coefficients, covariance, trained, &
         & trained_euler_deg, model, error)
         import
         class(basis_type), intent(in) :: self
         !> Class of the crystals that will be evaluated.
         type(crystal_class_type), intent(in) :: class
         !> Posterior mean (n_terms); covariance (n_terms, n_terms), or of size 0 if it is left out.
         real(wp), intent(in) :: coefficients(:), covariance(:, :)
         !> Crystals on which the surrogate was trained: constants of the domain's class, GPa,
         !> (n_constants, n), and Bunge-Euler angles, degrees, (3, n).
         real(wp), intent(in) :: trained(:, :), trained_euler_deg(:, :)
         class(grain_model_type), allocatable, intent(out) :: model
         type(error_type), allocatable, intent(out) :: error
      end subroutine new_grain_model_interface

      !> Set the grains, in place of earlier ones.
      subroutine set_grains_interface(self, euler, error)
         import
         class(grain_model_type), intent(inout) :: self
         !> Bunge-Euler angles (3, n), radians.
         real(wp), intent(in) :: euler(:, :)
         type(error_type), allocatable, intent(out) :: error
      end subroutine set_grains_interface

      !> Moduli of the grains for some crystals.
      pure subroutine evaluate_crystals_interface(self, c, modulus)
         import
         class(grain_model_type), intent(in) :: self
         !> Stiffness in crystal axes of stable crystals, GPa, (6, 6, crystal).
         real(wp), intent(in), contiguous :: c(:, :, :)
         !> GPa, (n, crystal).
         real(wp), intent(out), contiguous :: modulus(:, :)
      end subroutine evaluate_crystals_interface

      !> U with U Uᵀ the covariance of y between the grains, without 1/beta. Rows of grains that
      !> were set at different times can be combined: the same coefficients predict them all.
      pure subroutine evaluate_columns_interface(self, c, columns)
         import
         class(grain_model_type), intent(in) :: self
         !> GPa.
         real(wp), intent(in) :: c(6, 6)
         !> (n, n_columns).
         real(wp), intent(out), contiguous :: columns(:, :)
      end subroutine evaluate_columns_interface
   end interface

contains

   !> The spread of a crystal, 1 or more: sd of the part of y that the terms cannot express,
   !> relative to that of a nearly isotropic crystal.
   pure real(wp) function spread_of(growth, c)
      !> Growth of the noise per power of the log-anisotropy; stiffness of a stable crystal, GPa.
      real(wp), intent(in) :: growth, c(6, 6)

      spread_of = 1.0_wp
      if (growth > 0.0_wp) spread_of = spread_of + growth*log_anisotropy(c)**growth_power
   end function spread_of

   !> Terms of crystals of the domain's class, one crystal after another, so that those of each do
   !> not depend on the others.
   subroutine evaluate_crystals(self, constants, euler_deg, terms, scale, spread)
      class(basis_type), intent(in) :: self
      !> Constants (n_constants, n), GPa; Bunge-Euler angles (3, n), degrees.
      real(wp), intent(in) :: constants(:, :), euler_deg(:, :)
      !> (n_terms, n); GPa, (n); relative, (n).
      real(wp), allocatable, intent(out) :: terms(:, :), scale(:), spread(:)
      integer :: i

      allocate (terms(self%n_terms, size(constants, 2)), scale(size(constants, 2)), &
         & spread(size(constants, 2)))
      do i = 1, size(scale)
         call self%evaluate_many(reshape(self%domain%class%stiffness(constants(:, i)), [6, 6, 1]), &
            & degree*euler_deg(:, i:i), terms(:, i:i), scale(i:i), spread(i:i))
      end do
   end subroutine evaluate_crystals

   !> Modulus of each grain and its derivative with respect to y.
   pure subroutine evaluate_moduli(self, c, modulus, slope, known)
      class(grain_model_type), intent(in) :: self
      !> Stiffness in crystal axes of a stable crystal, GPa.
      real(wp), intent(in) :: c(6, 6)
      !> GPa, (n).
      real(wp), intent(out), contiguous :: modulus(:), slope(:)
      !> The moduli, if they are known already.
      real(wp), intent(in), optional :: known(size(modulus))
      real(wp), allocatable :: moduli(:, :)

      if (present(known)) then
         modulus = known
      else
         allocate (moduli(size(modulus), 1))
         call self%evaluate_crystals(reshape(c, [6, 6, 1]), moduli)
         modulus = moduli(:, 1)
      end if
      ! y is a logarithm where the model contains the theory.
      slope = merge(modulus, 1.0_wp, self%has_theory)*spread_of(self%noise_growth, c)
   end subroutine evaluate_moduli

   !> Use the field up to a log-anisotropy, and the exact theory above it.
   subroutine use_field_up_to(self, anisotropy)
      class(grain_model_type), intent(inout) :: self
      real(wp), intent(in) :: anisotropy

      self%full_above = anisotropy
   end subroutine use_field_up_to

   !> y of a modulus.
   pure elemental real(wp) function to_y(self, modulus, scale, spread)
      class(basis_type), intent(in) :: self
      !> GPa, and relative.
      real(wp), intent(in) :: modulus, scale, spread

      to_y = modulus/scale
      if (self%logarithmic) to_y = log(to_y)/spread
   end function to_y

   !> Modulus of a y, GPa.
   pure elemental real(wp) function to_modulus(self, y, scale, spread)
      class(basis_type), intent(in) :: self
      real(wp), intent(in) :: y
      !> GPa, and relative.
      real(wp), intent(in) :: scale, spread

      to_modulus = scale*y
      if (self%logarithmic) to_modulus = scale*exp(spread*y)
   end function to_modulus
end module abstract_basis
