!> Moduli of some grains and speeds of surface waves on others, as one grain model.
module wave_grains
   use abstract_basis, only: grain_model_type
   use crystal_elasticity, only: no_wave, path_type
   use errors, only: error_type
   use kinds, only: wp
   use rayleigh_wave, only: new_surface, surface_type, surface_waves, wave_speed, wave_type
   implicit none
   private
   public :: wave_grains_type, add_waves

   type, extends(grain_model_type) :: wave_grains_type
      !> What the surrogate gives the moduli.
      class(grain_model_type), allocatable :: moduli
      !> kg/m3.
      real(wp) :: density = 1.0_wp
      !> Of each measurement; of more grains they take turns. Set it before the grains.
      type(path_type), allocatable :: paths(:)
      integer, allocatable, private :: of_moduli(:), of_waves(:)
      type(surface_type), private :: surface
   contains
      procedure :: set_grains, evaluate_crystals, evaluate_columns, read_up_to
   end type wave_grains_type

contains

   !> Let a grain model have waves too.
   subroutine add_waves(paths, density, euler, grains, error)
      !> (n).
      type(path_type), intent(in) :: paths(:)
      !> kg/m3; Bunge-Euler angles, radians, (3, n), and of tilted ones in turn.
      real(wp), intent(in) :: density, euler(:, :)
      !> Of moduli on entry.
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
      self%of_waves = pack([(i, i=1, size(paths))], paths%wave /= no_wave)
      self%of_moduli = pack([(i, i=1, size(paths))], paths%wave == no_wave)
      self%moduli%field_degree = self%field_degree
      call self%moduli%set_grains(euler(:, self%of_moduli), error)
      call new_surface(euler(:, self%of_waves), paths(self%of_waves), self%surface)
      self%n_columns = self%moduli%n_columns
      self%has_theory = self%moduli%has_theory
      self%noise_growth = self%moduli%noise_growth
      self%field_cost = self%moduli%field_cost
      self%full_cost = self%moduli%full_cost
   end subroutine set_grains

   !> Moduli, GPa, and speeds, m/s.
   pure subroutine evaluate_crystals(self, c, modulus)
      class(wave_grains_type), intent(in) :: self
      real(wp), intent(in), contiguous :: c(:, :, :)
      real(wp), intent(out), contiguous :: modulus(:, :)
      real(wp) :: moduli(size(self%of_moduli), size(c, 3))
      type(wave_type) :: waves(self%surface%n)
      integer :: i

      call self%moduli%evaluate_crystals(c, moduli)
      modulus(self%of_moduli, :) = moduli
      do i = 1, size(c, 3)
         call surface_waves(self%surface, c(:, :, i:i), waves)
         modulus(self%of_waves, i) = wave_speed(waves%modulus, self%density)
      end do
   end subroutine evaluate_crystals

   !> Speeds are none of the surrogate's.
   pure subroutine evaluate_columns(self, c, columns)
      class(wave_grains_type), intent(in) :: self
      real(wp), intent(in) :: c(6, 6)
      real(wp), intent(out), contiguous :: columns(:, :)
      real(wp) :: of_moduli(size(self%of_moduli), self%n_columns)

      call self%moduli%evaluate_columns(c, of_moduli)
      columns = 0.0_wp
      columns(self%of_moduli, :) = of_moduli
   end subroutine evaluate_columns

   subroutine read_up_to(self, anisotropy)
      class(wave_grains_type), intent(inout) :: self
      real(wp), intent(in) :: anisotropy

      self%full_above = anisotropy
      call self%moduli%read_up_to(anisotropy)
   end subroutine read_up_to
end module wave_grains
