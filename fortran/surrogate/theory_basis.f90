!> The exact theory of the half-space as a basis without terms: M = scale exp(0) with the theory's modulus as the scale. It knows every
!> stable crystal of every class, and its error is that of the expansion of the surface compliance, see `compliance_field`.
module theory_basis
   use abstract_basis, only: basis_type, grain_model_type
   use compliance_field, only: field_moduli, field_type, new_field
   use crystal_class, only: crystal_class_type, general_class
   use crystal_elasticity, only: is_stable, log_anisotropy
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use modulus_expansion, only: modulus_expansion_type, new_modulus_expansion
   use surrogate_domain, only: new_wide_domain
   implicit none
   private
   public :: theory_basis_type, new_theory_basis, theory_grain_model_type

   type, extends(basis_type) :: theory_basis_type
   contains
      procedure :: evaluate_terms
      procedure :: reach
      procedure :: covers
      procedure :: term_degrees
      procedure :: exchange
      procedure :: new_grain_model
   end type theory_basis_type

   type, extends(grain_model_type) :: theory_grain_model_type
      type(crystal_class_type) :: class
      !> Of the grains, or of the directions of their expansion if that pays.
      type(field_type), private :: field
      type(modulus_expansion_type) :: expansion
      !> Bunge-Euler angles of the moduli that are computed, (3, n_independent), radians.
      real(wp), allocatable :: euler(:, :)
   contains
      procedure :: set_grains
      procedure :: evaluate_moduli
      procedure :: evaluate_columns
      procedure :: evaluate_independent
      procedure :: expand
   end type theory_grain_model_type

contains

   subroutine new_theory_basis(basis, error)
      type(theory_basis_type), intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error

      basis%logarithmic = .true.
      call new_wide_domain(general_class, general_class, huge(1.0_wp), [-0.999_wp, 0.499_wp], basis%domain, error)
   end subroutine new_theory_basis

   subroutine evaluate_terms(self, c, euler, terms, scale)
      class(theory_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6), euler(3)
      !> None; GPa.
      real(wp), intent(out) :: terms(:), scale
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error

      terms = 0.0_wp*self%n_terms
      call halfspace_modulus(c, euler, theory, error)
      scale = theory%modulus
   end subroutine evaluate_terms

   pure real(wp) function reach(self, c)
      class(theory_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)

      reach = 0.0_wp*c(1, 1)*self%n_terms
   end function reach

   pure logical function covers(self, c)
      class(theory_basis_type), intent(in) :: self
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)

      covers = self%n_terms == 0 .and. is_stable(c)
   end function covers

   pure subroutine term_degrees(self, directional, polynomial)
      class(theory_basis_type), intent(in) :: self
      !> None.
      integer, intent(out) :: directional(:), polynomial(:)

      directional = self%n_terms
      polynomial = self%n_terms
   end subroutine term_degrees

   subroutine exchange(self, file)
      class(theory_basis_type), intent(inout) :: self
      class(labelled_values_type), intent(inout) :: file

      self%logarithmic = .true.
      if (allocated(file%error)) return
   end subroutine exchange

   subroutine new_grain_model(self, class, coefficients, covariance, model, error)
      class(theory_basis_type), intent(in) :: self
      type(crystal_class_type), intent(in) :: class
      !> None.
      real(wp), intent(in) :: coefficients(:), covariance(:, :)
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      type(theory_grain_model_type), allocatable :: new

      allocate (new)
      new%class = class
      new%has_theory = .true.
      new%n_columns = 0*(self%n_terms + size(coefficients) + size(covariance))
      call move_alloc(new, model)
   end subroutine new_grain_model

   subroutine set_grains(self, euler, error)
      class(theory_grain_model_type), intent(inout) :: self
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      type(error_type), allocatable, intent(out) :: error

      call new_modulus_expansion(self%class, self%field_degree, euler, self%expansion, error)
      if (allocated(error)) return
      self%euler = euler
      self%field_cost = 0.0_wp
      if (self%expansion%pays) then
         self%euler = self%expansion%euler
         self%field_cost = self%expansion%cost()
      end if
      self%n_independent = size(self%euler, 2)
      call new_field(self%class, self%field_degree, self%euler, self%field, error)
      if (allocated(error)) return
      self%full_cost = self%field_cost + 2.6_wp*self%n_independent
      self%field_cost = self%field_cost + size(self%field%nodes, 2)*(0.09_wp + 0.004_wp*self%n_independent) &
         & + 0.07_wp*self%n_independent
   end subroutine set_grains

   pure subroutine evaluate_moduli(self, c, modulus, slope)
      class(theory_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> GPa, (n).
      real(wp), intent(out), contiguous :: modulus(:), slope(:)
      real(wp) :: independent(self%n_independent)

      call self%evaluate_independent(c, independent)
      call self%expand(independent, modulus)
      slope = modulus
   end subroutine evaluate_moduli

   pure subroutine evaluate_independent(self, c, modulus)
      class(theory_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      real(wp), intent(out), contiguous :: modulus(:)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      integer :: i
      logical :: in_full

      in_full = self%full_above < huge(1.0_wp)
      if (in_full) in_full = log_anisotropy(c) > self%full_above
      if (.not. in_full) then
         call field_moduli(self%field, c, modulus)
         return
      end if
      do i = 1, size(modulus)
         call halfspace_modulus(c, self%euler(:, i), theory, error)
         modulus(i) = theory%modulus
      end do
   end subroutine evaluate_independent

   pure subroutine expand(self, independent, modulus)
      class(theory_grain_model_type), intent(in) :: self
      real(wp), intent(in), contiguous :: independent(:)
      real(wp), intent(out), contiguous :: modulus(:)

      if (self%expansion%pays) then
         call self%expansion%expand(independent, modulus)
      else
         modulus = independent
      end if
   end subroutine expand

   pure subroutine evaluate_columns(self, c, columns)
      class(theory_grain_model_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      !> (n, 0).
      real(wp), intent(out), contiguous :: columns(:, :)

      columns = 0.0_wp*c(1, 1)*self%n_columns
   end subroutine evaluate_columns
end module theory_basis
