!> What a surrogate is linear in: terms of a crystal and its orientation, from which the indentation modulus M follows.
!>
!> y = Σ A_k term_k, and M = scale y or, with a logarithmic basis, M = scale exp(y). A family of bases is a module that extends
!> `basis_type` and `grain_model_type`, and a line in `bases`.
module abstract_basis
   use crystal_class, only: crystal_class_type
   use errors, only: error_type
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use surrogate_domain, only: domain_type
   implicit none
   private
   public :: basis_type, grain_model_type

   type, abstract :: basis_type
      !> The crystals that it was made for.
      type(domain_type) :: domain
      integer :: n_terms = 0
      !> M = scale exp(y), not scale y.
      logical :: logarithmic = .false.
      !> Least sd of the noise that a regression may believe, in units of y.
      real(wp) :: least_noise = 0.0_wp
      !> sds of a coefficient and of the noise before they are learnt, in units of y.
      real(wp) :: first_sds(2) = 1.0_wp
      !> What the prior of the coefficients knows of each term, (n_terms): 0 free, d that it falls with the degree d. Not allocated: all
      !> are alike (Eq. 6).
      integer, allocatable :: prior_degrees(:)
   contains
      procedure(evaluate_terms_interface), deferred :: evaluate_terms
      procedure(reach_interface), deferred :: reach
      procedure(term_degrees_interface), deferred :: term_degrees
      procedure(exchange_interface), deferred :: exchange
      procedure(new_grain_model_interface), deferred :: new_grain_model
      procedure :: evaluate_many
      procedure :: covers
      procedure :: to_y
      procedure :: to_modulus
   end type basis_type

   !> The moduli that a surrogate gives certain grains, as a function of the crystal alone: what depends on the orientations is
   !> computed once.
   type, abstract :: grain_model_type
      !> Of the factor of the covariance of y.
      integer :: n_columns = 0
      !> How many moduli are computed: one a grain, or fewer from which those of all grains follow.
      integer :: n_independent = 0
      !> Degree of the surface harmonics with which the theory is read, where the model has theory in it: even. Set it before the grains.
      integer :: field_degree = 12
      logical :: has_theory = .false.
      !> Crystals of a larger log-anisotropy have theory in full.
      real(wp) :: full_above = huge(1.0_wp)
      !> About what a crystal costs, microseconds, with theory read and with theory in full.
      real(wp) :: field_cost = 0.0_wp, full_cost = 0.0_wp
   contains
      procedure(set_grains_interface), deferred :: set_grains
      procedure(evaluate_moduli_interface), deferred :: evaluate_moduli
      procedure(evaluate_columns_interface), deferred :: evaluate_columns
      procedure :: evaluate_independent
      procedure :: expand
   end type grain_model_type

   abstract interface
      !> The terms of one crystal in one orientation.
      subroutine evaluate_terms_interface(self, c, euler, terms, scale)
         import :: basis_type, wp
         class(basis_type), intent(in) :: self
         !> Stiffness in crystal axes of a stable crystal, GPa; Bunge-Euler angles, radians.
         real(wp), intent(in) :: c(6, 6), euler(3)
         !> (n_terms), and GPa.
         real(wp), intent(out) :: terms(:), scale
      end subroutine evaluate_terms_interface

      !> How far out a stable crystal is: the largest of its coordinates, each relative to its range, 1 on the boundary.
      pure real(wp) function reach_interface(self, c)
         import :: basis_type, wp
         class(basis_type), intent(in) :: self
         !> GPa.
         real(wp), intent(in) :: c(6, 6)
      end function reach_interface

      !> Degrees of each term, in the direction and in the coordinates of the crystal.
      pure subroutine term_degrees_interface(self, directional, polynomial)
         import :: basis_type
         class(basis_type), intent(in) :: self
         !> (n_terms).
         integer, intent(out) :: directional(:), polynomial(:)
      end subroutine term_degrees_interface

      !> Write the parameters of the basis, or make it from what was written; its domain is there.
      subroutine exchange_interface(self, file)
         import :: basis_type, labelled_values_type
         class(basis_type), intent(inout) :: self
         class(labelled_values_type), intent(inout) :: file
      end subroutine exchange_interface

      !> The model of grains, none yet, of a surrogate with this posterior.
      subroutine new_grain_model_interface(self, class, coefficients, covariance, model, error)
         import :: basis_type, crystal_class_type, error_type, grain_model_type, wp
         class(basis_type), intent(in) :: self
         !> Of the crystals that will be asked for.
         type(crystal_class_type), intent(in) :: class
         !> Posterior mean (n_terms); covariance (n_terms, n_terms), of size 0 if it does not count.
         real(wp), intent(in) :: coefficients(:), covariance(:, :)
         class(grain_model_type), allocatable, intent(out) :: model
         type(error_type), allocatable, intent(out) :: error
      end subroutine new_grain_model_interface

      !> The grains from now on.
      subroutine set_grains_interface(self, euler, error)
         import :: error_type, grain_model_type, wp
         class(grain_model_type), intent(inout) :: self
         !> Bunge-Euler angles (3, n), radians.
         real(wp), intent(in) :: euler(:, :)
         type(error_type), allocatable, intent(out) :: error
      end subroutine set_grains_interface

      !> Modulus of each grain and its derivative with respect to y.
      pure subroutine evaluate_moduli_interface(self, c, modulus, slope)
         import :: grain_model_type, wp
         class(grain_model_type), intent(in) :: self
         !> Stiffness in crystal axes of a stable crystal, GPa.
         real(wp), intent(in) :: c(6, 6)
         !> GPa, (n).
         real(wp), intent(out), contiguous :: modulus(:), slope(:)
      end subroutine evaluate_moduli_interface

      !> U with U Uᵀ the covariance of y between the grains, 1/beta not included. Rows of grains that were set at different times
      !> belong together: the same coefficients predict them all.
      pure subroutine evaluate_columns_interface(self, c, columns)
         import :: grain_model_type, wp
         class(grain_model_type), intent(in) :: self
         !> GPa.
         real(wp), intent(in) :: c(6, 6)
         !> (n, n_columns).
         real(wp), intent(out), contiguous :: columns(:, :)
      end subroutine evaluate_columns_interface
   end interface

contains

   !> The terms of many crystals, of which each may have other last bits than alone.
   subroutine evaluate_many(self, c, euler, terms, scale)
      class(basis_type), intent(in) :: self
      !> Stiffness in crystal axes of stable crystals, GPa, (6, 6, n); Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: c(:, :, :), euler(:, :)
      !> (n_terms, n), and GPa.
      real(wp), intent(out) :: terms(:, :), scale(:)
      integer :: i

      do i = 1, size(scale)
         call self%evaluate_terms(c(:, :, i), euler(:, i), terms(:, i), scale(i))
      end do
   end subroutine evaluate_many

   !> The moduli that are computed: those of the grains.
   pure subroutine evaluate_independent(self, c, modulus)
      class(grain_model_type), intent(in) :: self
      !> Stiffness in crystal axes of a stable crystal, GPa.
      real(wp), intent(in) :: c(6, 6)
      !> GPa, (n_independent).
      real(wp), intent(out), contiguous :: modulus(:)
      real(wp) :: slope(size(modulus))

      call self%evaluate_moduli(c, modulus, slope)
   end subroutine evaluate_independent

   !> The moduli of the grains from those that are computed.
   pure subroutine expand(self, independent, modulus)
      class(grain_model_type), intent(in) :: self
      !> GPa, (n_independent).
      real(wp), intent(in), contiguous :: independent(:)
      !> GPa, (n).
      real(wp), intent(out), contiguous :: modulus(:)

      modulus = independent + 0.0_wp*self%n_columns
   end subroutine expand

   !> Whether a surrogate with this basis knows a crystal: of its class, stable, within the limits, no coordinate out of its range.
   pure logical function covers(self, c)
      class(basis_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp), parameter :: rounding = 1.0e-9_wp

      covers = .false.
      if (.not. self%domain%is_of_class(c)) return
      if (.not. self%domain%is_within_limits(c)) return
      covers = self%reach(c) <= 1.0_wp + rounding
   end function covers

   !> y of a modulus.
   pure elemental real(wp) function to_y(self, modulus, scale)
      class(basis_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: modulus, scale

      to_y = modulus/scale
      if (self%logarithmic) to_y = log(to_y)
   end function to_y

   !> Modulus of a y, GPa.
   pure elemental real(wp) function to_modulus(self, y, scale)
      class(basis_type), intent(in) :: self
      real(wp), intent(in) :: y
      !> GPa.
      real(wp), intent(in) :: scale

      to_modulus = scale*y
      if (self%logarithmic) to_modulus = scale*exp(y)
   end function to_modulus
end module abstract_basis
