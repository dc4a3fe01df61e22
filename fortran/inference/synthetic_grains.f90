!> Synthetic measurements: what an experiment on grains of a stated crystal would give. The
!> orientations are random, and the errors are normal.
module synthetic_grains
   use errors, only: error_type
   use kinds, only: degree, wp
   use measured_grains, only: measured_type
   use observables, only: observable_type, path_type, surface_path
   use random, only: new_random_stream, random_stream_type
   use rayleigh_wave, only: rayleigh_waves, wave_speed, wave_type
   use surrogate_model, only: predict_crystals, surrogate_type
   implicit none
   private
   public :: experiment_type, measure_grains

   type :: experiment_type
      integer :: n_grains = 1
      !> Relative sd of the stated error of a modulus, and of the scatter of grains, which the
      !> stated error does not contain.
      real(wp) :: noise = 0.0_wp, scatter_sd = 0.0_wp
      !> Relative sd of the speed of a surface wave; below 0 no speeds are measured.
      real(wp) :: velocity_noise = -1.0_wp
      !> Mass density, kg/m3.
      real(wp) :: density = 1.0_wp
      !> Sd of the tilt of the indented direction, per component, degrees.
      real(wp) :: orientation_sd_deg = 0.0_wp
      !> Seed of the random numbers, and the streams of the moduli and of the speeds.
      integer :: seed = 0, streams(2) = [1, 2]
   end type experiment_type

contains

   !> Measure a modulus and, if the experiment has speeds, the speed of one surface wave in each
   !> grain. Speeds of waves that a measurement does not show are left out. Experiments that
   !> differ in their noise have the same orientations, and an experiment with fewer grains has
   !> the first ones of a larger experiment.
   subroutine measure_grains(experiment, surrogate, observable, stiffness, measured, error)
      type(experiment_type), intent(in) :: experiment
      !> The moduli without their errors.
      type(surrogate_type), intent(in) :: surrogate
      type(observable_type), intent(in) :: observable
      !> Of the crystal, in crystal axes, GPa.
      real(wp), intent(in) :: stiffness(6, 6)
      !> Without `shared`.
      type(measured_type), intent(out) :: measured
      type(error_type), allocatable, intent(out) :: error
      type(random_stream_type) :: of_moduli, of_speeds
      type(path_type), allocatable :: paths(:)
      type(wave_type), allocatable :: waves(:)
      real(wp), allocatable :: z(:, :), crystals(:, :, :), euler_deg(:, :), modulus(:), sd(:)
      integer, allocatable :: detected(:)
      integer :: i, j, n

      n = experiment%n_grains
      allocate (z(6, n), modulus(n), sd(n), paths(n), waves(n))
      crystals = spread(stiffness, 3, n)
      of_moduli = new_random_stream(experiment%seed, experiment%streams(1))
      of_speeds = new_random_stream(experiment%seed, experiment%streams(2))
      do i = 1, n
         do j = 1, 3
            call of_moduli%uniform(z(j, i))
         end do
         call of_moduli%normal(z(4, i))
         call of_speeds%uniform(z(5, i))
         call of_speeds%normal(z(6, i))
      end do
      euler_deg = reshape([(360.0_wp*z(1, i), acos(2.0_wp*z(2, i) - 1.0_wp)/degree, &
         & 360.0_wp*z(3, i), i=1, n)], [3, n])
      measured%euler = euler_deg*degree
      call predict_crystals(surrogate, crystals, measured%euler, 1, modulus, sd, error)
      if (allocated(error)) return
      call observable%to_measured(modulus)
      measured%sd = experiment%noise*modulus
      measured%modulus = modulus &
                        & *(1.0_wp + hypot(experiment%noise, experiment%scatter_sd)*z(4, :))
      measured%paths = paths
      measured%group = spread(1, 1, n)
      measured%density = experiment%density
      if (experiment%velocity_noise >= 0.0_wp) then
         paths = [(path_type(surface_path, 180.0_wp*z(5, i)), i=1, n)]
         call rayleigh_waves(crystals, euler_deg, paths, waves, error)
         if (allocated(error)) return
         modulus = wave_speed(waves%modulus, experiment%density)
         sd = experiment%velocity_noise*modulus
         modulus = modulus*(1.0_wp + experiment%velocity_noise*z(6, :))
         detected = pack([(i, i=1, n)], waves%is_detected())
         measured%euler = reshape([measured%euler, euler_deg(:, detected)*degree], &
            & [3, n + size(detected)])
         measured%sd = [measured%sd, sd(detected)]
         measured%modulus = [measured%modulus, modulus(detected)]
         measured%paths = [measured%paths, paths(detected)]
         measured%group = [measured%group, spread(2, 1, size(detected))]
      end if
      measured%tilt_sd = spread(experiment%orientation_sd_deg*degree, 1, size(measured%modulus))
   end subroutine measure_grains
end module synthetic_grains
