!> What is measured in a grain: a type between the crystal and the likelihood.
module abstract_observable
   use abstract_basis, only: grain_model_type
   use crystal_class, only: crystal_class_type
   use errors, only: error_type
   use kinds, only: wp
   use surrogate_model, only: surrogate_grains => new_grain_model, surrogate_type
   implicit none
   private
   public :: observable_type

   type, abstract :: observable_type
      !> As `modulus_kind` and, with the unit, a column name it.
      character(len=:), allocatable :: name
   contains
      procedure(from_simulation_interface), deferred :: from_simulation
      procedure(isotropic_modulus_interface), deferred :: isotropic_modulus
      procedure :: new_grain_model, calibration_slope
   end type observable_type

   abstract interface
      !> From what a simulated curve, or the grain model, gives to the values, in place.
      pure subroutine from_simulation_interface(self, values, slopes)
         import :: observable_type, wp
         class(observable_type), intent(in) :: self
         !> Indentation moduli, GPa, and their derivatives with respect to any variable.
         real(wp), intent(inout) :: values(:), slopes(:)
      end subroutine from_simulation_interface

      !> Indentation modulus of the isotropic solid with a value, GPa; very large where there is none.
      pure real(wp) function isotropic_modulus_interface(self, measured)
         import :: observable_type, wp
         class(observable_type), intent(in) :: self
         !> In the unit of the observable.
         real(wp), intent(in) :: measured
      end function isotropic_modulus_interface
   end interface

contains

   !> What it is for a crystal in the orientations of grains, before `from_simulation`: the indentation moduli of a surrogate.
   subroutine new_grain_model(self, surrogate, class, euler, with_covariance, model, error)
      class(observable_type), intent(in) :: self
      type(surrogate_type), intent(in) :: surrogate
      !> Of the crystals that will be asked for.
      type(crystal_class_type), intent(in) :: class
      !> Bunge-Euler angles (3, n), radians.
      real(wp), intent(in) :: euler(:, :)
      !> Whether the surrogate's covariance counts.
      logical, intent(in) :: with_covariance
      class(grain_model_type), allocatable, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error

      call surrogate_grains(surrogate, class, euler, with_covariance, model, error)
   end subroutine new_grain_model

   !> How measurements of a group are correlated: derivatives with respect to their common error, which is relative.
   pure function calibration_slope(self, values) result(slope)
      class(observable_type), intent(in) :: self
      !> (measurement).
      real(wp), intent(in) :: values(:)
      real(wp) :: slope(size(values))

      slope = values
   end function calibration_slope
end module abstract_observable
