!> A grain model of two kinds of measurement: moduli of some grains and speeds of surface waves on
!> others.
module wave_grains
   use abstract_basis, only: grain_model_type
   use errors, only: error_type
   use kinds, only: wp
   use observables, only: path_type
   use rayleigh_wave, only: new_surface, surface_type, surface_waves, wave_speed, wave_type
   implicit none
   private
   public :: wave_grains_type, add_waves

   type, extends(grain_model_type) :: wave_grains_type
      !> The surrogate's model of the measurements that are moduli.
      class(grain_model_type), allocatable :: moduli
      !> Mass density, kg/m3.
      real(wp) :: density = 1.0_wp
      !> Path of the wave of each measurement, (measurement). The grains repeat it in turn if they
      !> are more, as tilted ones are. Set it before the grains.
      type(path_type), allocatable :: paths(:)
      !> Rows of the grains that are moduli, and of those that are speeds.
      integer, allocatable, private :: modulus_rows(:), wave_rows(:)
      type(surface_type), private :: surface
   contains
      procedure :: set_grains, evaluate_crystals, evaluate_columns, use_field_up_to
   end type wave_grains_type

contains

   !> Extend a grain model of moduli by surface waves.
   subroutine add_waves(paths, density, euler, grains, error)
      !> Path of each measurement, (n).
      type(path_type), intent(in) :: paths(:)
      !> Mass density, kg/m3. Bunge-Euler angles, radians, (3, n), or those of all tilts, one tilt
      !> after another.
      real(wp), intent(in) :: density, euler(:, :)
      !> A model of moduli on entry, of moduli and waves on return.
      class(grain_model_type), allocatable, intent(inout) :: grains
      type(error_type), allocatable, intent(out) :: error
      type(wave_grains_type) :: waves

      call move_alloc(grains, waves%moduli)
      waves%field_degree = waves%moduli%field_degree
      waves%density = density
      waves%paths = paths
      call waves%set_grains(euler, error)
      allocate (grains, source=waves)
   end subroutine add_waves

   subroutine set_grains(self, euler, error)
      class(wave_grains_type), intent(inout) :: self
      real(wp), intent(in) :: euler(:, :)
      type(error_type), allocatable, intent(out) :: error
      type(path_type) :: paths(size(euler, 2))
      integer :: i

      paths = [(self%paths(modulo(i - 1, size(self%paths)) + 1), i=1, size(paths))]
      self%wave_rows = pack([(i, i=1, size(paths))], paths%is_speed())
      self%modulus_rows = pack([(i, i=1, size(paths))], .not. paths%is_speed())
      self%moduli%field_degree = self%field_degree
      call self%moduli%set_grains(euler(:, self%modulus_rows), error)
      call new_surface(euler(:, self%wave_rows), paths(self%wave_rows), self%surface)
      self%n_columns = self%moduli%n_columns
      self%has_theory = self%moduli%has_theory
      self%noise_growth = self%moduli%noise_growth
      self%field_cost = self%moduli%field_cost
      self%full_cost = self%moduli%full_cost
   end subroutine set_grains

   !> Moduli, GPa, and speeds of waves, m/s.
   pure subroutine evaluate_crystals(self, c, modulus)
      class(wave_grains_type), intent(in) :: self
      real(wp), intent(in), contiguous :: c(:, :, :)
      real(wp), intent(out), contiguous :: modulus(:, :)
      real(wp) :: moduli(size(self%modulus_rows), size(c, 3))
      type(wave_type) :: waves(self%surface%n)
      integer :: i

      call self%moduli%evaluate_crystals(c, moduli)
      modulus(self%modulus_rows, :) = moduli
      do i = 1, size(c, 3)
         call surface_waves(self%surface, c(:, :, i:i), waves)
         modulus(self%wave_rows, i) = wave_speed(waves%modulus, self%density)
      end do
   end subroutine evaluate_crystals

   !> The columns are zero for speeds, which do not depend on the surrogate.
   pure subroutine evaluate_columns(self, c, columns)
      class(wave_grains_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      real(wp), intent(out), contiguous :: columns(:, :)
      real(wp) :: modulus_columns(size(self%modulus_rows), self%n_columns)

      call self%moduli%evaluate_columns(c, modulus_columns)
      columns = 0.0_wp
      columns(self%modulus_rows, :) = modulus_columns
   end subroutine evaluate_columns

   subroutine use_field_up_to(self, anisotropy)
      class(wave_grains_type), intent(inout) :: self
      real(wp), intent(in) :: anisotropy

      self%full_above = anisotropy
      call self%moduli%use_field_up_to(anisotropy)
   end subroutine use_field_up_to
end module wave_grains
