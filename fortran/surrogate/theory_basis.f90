!> The exact theory of the half-space as a basis without terms: M = scale exp(0) with the theory's modulus as the scale. It is valid for
!> every stable crystal of every class, and its error is that of the expansion of the surface compliance, see `compliance_field`.
module theory_basis
   use abstract_basis, only: basis_type, grain_model_type
   use compliance_field, only: field_moduli, field_type, new_field
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: log_anisotropy
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   use modulus_expansion, only: modulus_expansion_type, new_modulus_expansion
   implicit none
   private
   public :: theory_basis_type, theory_grain_model_type

   type, extends(basis_type) :: theory_basis_type
   contains
      procedure :: set_up
      procedure :: exchange
      procedure :: evaluate_many
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
      procedure :: evaluate_independent
      procedure :: evaluate_columns
      procedure :: expand
   end type theory_grain_model_type

contains

   subroutine set_up(self, error)
      class(theory_basis_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error

      self%logarithmic = .not. allocated(error)
   end subroutine set_up

   subroutine exchange(self, file)
      class(theory_basis_type), intent(inout) :: self
      type(labelled_values_type), intent(inout) :: file

      self%logarithmic = .not. allocated(file%error)
   end subroutine exchange

   !> The scale alone.
   subroutine evaluate_many(self, c, euler, terms, scale)
      class(theory_basis_type), intent(in) :: self
      real(wp), intent(in) :: c(:, :, :), euler(:, :)
      real(wp), intent(out) :: terms(:, :), scale(:)
      type(halfspace_type) :: theory
      type(error_type), allocatable :: error
      integer :: i

      terms(:self%n_terms, :) = 0.0_wp
      do i = 1, size(scale)
         call halfspace_modulus(c(:, :, i), euler(:, i), theory, error)
         scale(i) = theory%modulus
      end do
   end subroutine evaluate_many

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
