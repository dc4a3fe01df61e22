!> Errors that measurements share (of the surrogate, of each calibration, stated ones, the tilt of
!> the sample), inferred from the data at given constants. They are in units of the sds of their
!> prior.
module shared_errors
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use kinds, only: wp
   use random, only: random_stream_type
   use small_matrices, only: solve_upper
   implicit none
   private
   public :: add_shared, draw_shared, infer_shared

contains

   !> Mean of the shared errors, given the data, and the lower factor of their precision.
   pure subroutine infer_shared(posterior, x, mean, precision)
      type(posterior_type), intent(in) :: posterior
      !> Point, (dimension).
      real(wp), intent(in) :: x(:)
      !> (shared error); (shared error, shared error).
      real(wp), allocatable, intent(out) :: mean(:), precision(:, :)
      real(wp), dimension(posterior%n_grains) :: model, scales
      real(wp), allocatable :: u(:, :)
      real(wp) :: value

      allocate (mean(0), precision(0, 0))
      if (posterior%n_shared == 0) return
      call posterior%predict_measurements(x, posterior%stiffness(x), model, scales, u)
      call posterior%errors%integrate((posterior%data%modulus - model)/scales, u, mean, &
         & precision, value)
   end subroutine infer_shared

   !> Draw shared errors, given the data, from standard normal numbers `z`.
   pure subroutine draw_shared(posterior, x, z, errors, precision, factor)
      type(posterior_type), intent(in) :: posterior
      !> Point, (dimension); standard normal numbers, (shared error).
      real(wp), intent(in) :: x(:), z(:)
      !> (shared error).
      real(wp), intent(out), contiguous :: errors(:)
      !> The lower factor of their precision, (shared error, shared error).
      real(wp), allocatable, intent(out) :: precision(:, :)
      !> The factor of the laboratory, (group).
      real(wp), intent(out) :: factor(:)
      real(wp), allocatable :: mean(:)
      integer :: g

      call infer_shared(posterior, x, mean, precision)
      ! L^-ᵀ z has the covariance (L Lᵀ)^-1.
      errors = z
      call solve_upper(precision, errors)
      errors = mean + errors
      factor = 1.0_wp
      associate (sd => posterior%laboratory%sd)
         if (any(sd > 0.0_wp)) then
            factor = factor &
               & + sd*errors(posterior%grains%n_columns + 1:posterior%n_calibrated)
         end if
      end associate
      factor = factor*[(exp(posterior%log_factor(x, g)), g=1, size(factor))]
   end subroutine draw_shared

   !> Draw the shared errors, given the data, and add the surrogate's to moduli. Without these
   !> uncertainties the moduli stay as they are and the factors are 1.
   subroutine add_shared(posterior, x, grains, stream, moduli, factor)
      type(posterior_type), intent(in) :: posterior
      !> Point, (dimension).
      real(wp), intent(in) :: x(:)
      class(grain_model_type), intent(in) :: grains
      type(random_stream_type), intent(inout) :: stream
      !> Moduli of `grains` at the point, GPa, (grain).
      real(wp), intent(inout), contiguous :: moduli(:)
      !> The factor of the laboratory, (group).
      real(wp), intent(out) :: factor(:)
      real(wp), dimension(posterior%n_shared) :: errors, z
      real(wp), allocatable :: precision(:, :)
      real(wp) :: columns(size(moduli), grains%n_columns)
      real(wp), dimension(size(moduli)) :: values, slope

      call stream%normals(z)
      call draw_shared(posterior, x, z, errors, precision, factor)
      if (grains%n_columns == 0) return
      call grains%evaluate_moduli(posterior%stiffness(x), values, slope, moduli)
      call grains%evaluate_columns(posterior%stiffness(x), columns)
      moduli = moduli + slope*matmul(columns, errors(:grains%n_columns))
   end subroutine add_shared
end module shared_errors
