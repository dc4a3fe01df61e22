!> The samplers by name, and the loop over chains.
!>
!> Chain k draws from the random stream (seed, first_stream + k - 1), whatever thread runs it.
module samplers
   use ensemble_sampler, only: ensemble_sampler_type
   use errors, only: error_type, exit_bad_input, raise
   use interruption, only: listen, stop_listening, stop_requested
   use chain_checkpoints, only: checkpoint_type
   use kinds, only: i8, wp
   use memory, only: raise_no_memory
   use running_command, only: advance_progress, begin_progress, end_progress
   use random, only: new_random_stream, random_stream_type
   use abstract_sampler, only: sampler_type
   use sampling_target, only: target_type
   use scmh_sampler, only: scmh_sampler_type
   use text, only: to_text
   implicit none
   private
   public :: sampler_names, new_sampler, run_settings_type, chains_type, sample_chains

   !> A new sampler: its file, its name here, and its line in `new_sampler`.
   character(len=*), parameter :: sampler_names = 'ensemble, scmh'

   type :: run_settings_type
      !> Kept per chain, after the sampler's burn-in.
      integer :: samples = 10000
      integer :: chains = 4, threads = 1, seed = 0, first_stream = 1
   end type run_settings_type

   type :: chains_type
      !> draws(parameter, sample, chain).
      real(wp), allocatable :: draws(:, :, :)
      !> log_density(sample, chain), acceptance(chain).
      real(wp), allocatable :: log_density(:, :), acceptance(:)
   contains
      procedure :: best_draw
   end type chains_type

contains

   !> The sampler of a name.
   subroutine new_sampler(name, burn_in, sampler, error)
      character(len=*), intent(in) :: name
      !> Sweeps before the samples that are kept.
      integer, intent(in) :: burn_in
      class(sampler_type), allocatable, intent(out) :: sampler
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('ensemble')
         allocate (ensemble_sampler_type :: sampler)
      case ('scmh')
         allocate (scmh_sampler_type :: sampler)
      case default
         call raise(error, 'method: '''//name//''' is unknown; allowed: '//sampler_names, exit_bad_input)
         return
      end select
      sampler%burn_in = burn_in
   end subroutine new_sampler

   !> The draw of largest density.
   pure function best_draw(self) result(point)
      class(chains_type), intent(in) :: self
      real(wp) :: point(size(self%draws, 1))

      associate (best => maxloc(self%log_density))
         point = self%draws(:, best(1), best(2))
      end associate
   end function best_draw

   !> Run all chains but those that are kept.
   subroutine sample_chains(target, sampler, settings, chains, error, checkpoint)
      class(target_type), intent(in) :: target
      class(sampler_type), intent(in) :: sampler
      type(run_settings_type), intent(in) :: settings
      type(chains_type), intent(out) :: chains
      type(error_type), allocatable, intent(out) :: error
      !> Where each chain is kept as soon as it is finished; default: nowhere.
      type(checkpoint_type), intent(in), optional :: checkpoint
      type(random_stream_type) :: stream
      logical, allocatable :: started(:)
      integer :: k, number, stat
      logical :: interrupted

      if (settings%samples < 1 .or. sampler%burn_in < 0 .or. settings%chains < 1) then
         call raise(error, 'samples = '//to_text(settings%samples)//' and chains = '//to_text(settings%chains) &
            & //' must be at least 1, burn_in = '//to_text(sampler%burn_in)//' at least 0', exit_bad_input)
         return
      end if
      allocate (chains%draws(target%dimension, settings%samples, settings%chains), &
         & chains%log_density(settings%samples, settings%chains), chains%acceptance(settings%chains), &
         & started(settings%chains), stat=stat)
      if (stat /= 0) then
         call raise_no_memory(to_text(settings%chains)//' chains of '//to_text(settings%samples)//' samples', error)
         return
      end if
      chains%draws = 0.0_wp
      chains%log_density = 0.0_wp
      chains%acceptance = 0.0_wp
      call listen()
      call begin_progress('sampling', int(settings%chains, i8)*(sampler%burn_in + settings%samples))
      !$omp parallel do num_threads(max(1, settings%threads)) schedule(dynamic, 1) private(stream, number)
      do k = 1, settings%chains
         started(k) = .false.
         number = settings%first_stream + k - 1
         if (present(checkpoint)) then
            !$omp critical (chain_files)
            call checkpoint%restore(number, chains%draws(:, :, k), chains%log_density(:, k), chains%acceptance(k), started(k))
            !$omp end critical (chain_files)
         end if
         if (started(k)) call advance_progress(int(sampler%burn_in + settings%samples, i8))
         if (started(k)) cycle
         stream = new_random_stream(settings%seed, number)
         call sampler%run(target, stream, chains%draws(:, :, k), chains%log_density(:, k), chains%acceptance(k), started(k))
         if (.not. (present(checkpoint) .and. started(k)) .or. stop_requested()) cycle
         !$omp critical (chain_files)
         call checkpoint%store(number, chains%draws(:, :, k), chains%log_density(:, k), chains%acceptance(k))
         !$omp end critical (chain_files)
      end do
      !$omp end parallel do
      interrupted = stop_requested()
      call stop_listening()
      call end_progress()
      if (interrupted) then
         call raise(error, 'interrupted')
         return
      end if
      k = findloc(started, .false., dim=1)
      if (k > 0) call raise(error, 'chain '//to_text(k)//': no admissible point with a finite density was found within the ' &
         & //'bounds')
   end subroutine sample_chains
end module samplers
