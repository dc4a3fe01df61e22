!> The samplers by name, and the loop over chains.
!>
!> Chain k draws from the random stream (seed, first_stream + k - 1), whatever thread runs it.
module samplers
   use abstract_sampler, only: chain_type, draw_starts, estimate_type, sampler_type, target_type
   use ensemble_sampler, only: ensemble_sampler_type, most_efforts
   use errors, only: error_type, raise, refuse
   use independent_draws, only: agree
   use kinds, only: i8, wp
   use machine, only: raise_no_memory
   use random, only: new_random_stream, random_stream_type
   use progress, only: advance_progress, begin_progress, end_progress
   use running_command, only: listen, stop_listening, stop_requested
   use scmh_sampler, only: scmh_sampler_type
   use text, only: join, to_text
   implicit none
   private
   public :: new_sampler, run_settings_type, chains_type, sample_chains

   !> Names that the user may choose.
   character(len=*), parameter, public :: sampler_names = 'ensemble, scmh'

   !> Independent draws of a target whose starts have its density.
   type, extends(sampler_type) :: direct_sampler_type
   contains
      procedure :: run => run_direct
   end type direct_sampler_type

   type :: run_settings_type
      !> Number of samples of each chain after the burn-in.
      integer :: samples = 2500
      integer :: chains = 4, threads = 1, seed = 0, first_stream = 1
   end type run_settings_type

   type :: chains_type
      !> draws(parameter, sample, chain).
      real(wp), allocatable :: draws(:, :, :)
      !> log_density(sample, chain), acceptance(chain).
      real(wp), allocatable :: log_density(:, :), acceptance(:)
      !> Estimates of the runs; allocated if the draws are independent and these agree.
      type(estimate_type), allocatable :: estimates(:)
      !> The samplers of the runs, as the chains left them.
      class(sampler_type), allocatable :: samplers(:)
   contains
      procedure :: best_draw
   end type chains_type

contains

   !> Make a sampler by its name: a new one needs a module, a name in the list and a line here. The
   !> user may choose those of the list.
   subroutine new_sampler(name, burn_in, sampler, error)
      character(len=*), intent(in) :: name
      !> Number of sweeps before the first retained sample.
      integer, intent(in) :: burn_in
      class(sampler_type), allocatable, intent(out) :: sampler
      type(error_type), allocatable, intent(out) :: error

      select case (name)
      case ('ensemble')
         allocate (ensemble_sampler_type :: sampler)
         sampler%efforts = most_efforts
         sampler%most_runs = 2
      case ('scmh')
         allocate (scmh_sampler_type :: sampler)
      case ('direct')
         allocate (direct_sampler_type :: sampler)
      case default
         call refuse(error, 'method: '''//name//''' is unknown; allowed: '//sampler_names)
         return
      end select
      sampler%name = name
      sampler%burn_in = burn_in
   end subroutine new_sampler

   !> Draw independently from a target whose starts are distributed by its density, such as a prior
   !> without knowledge. Every draw is accepted.
   subroutine run_direct(self, effort, target, stream, chain)
      class(direct_sampler_type), intent(inout) :: self
      !> There is one.
      integer, intent(in) :: effort
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> It is started if enough points of the support were found.
      type(chain_type), intent(inout) :: chain
      integer :: n_found

      associate (unused => effort)
      end associate
      call draw_starts(target, stream, chain%draws, chain%log_density, n_found)
      chain%acceptance = 1.0_wp
      chain%started = n_found == size(chain%log_density)
      call advance_progress(int(self%burn_in + size(chain%log_density), i8))
   end subroutine run_direct

   !> The draw of highest density.
   pure function best_draw(self) result(point)
      class(chains_type), intent(in) :: self
      real(wp) :: point(size(self%draws, 1))

      associate (best => maxloc(self%log_density))
         point = self%draws(:, best(1), best(2))
      end associate
   end function best_draw

   !> Run all chains.
   subroutine sample_chains(target, sampler, settings, chains, error)
      class(target_type), intent(in) :: target
      class(sampler_type), intent(in) :: sampler
      type(run_settings_type), intent(in) :: settings
      !> On entry it may have the samplers of a similar target, which then begin where they are.
      type(chains_type), intent(inout), target :: chains
      type(error_type), allocatable, intent(out) :: error
      type(chain_type), allocatable :: each(:)
      integer :: effort, k, n, last, length, stat
      logical :: interrupted

      n = settings%chains
      if (n > sampler%most_runs .and. mod(n, sampler%most_runs) == 0) n = sampler%most_runs
      call begin_chains(sampler, n, chains)
      allocate (chains%draws(target%dimension, settings%samples, settings%chains), &
         & chains%log_density(settings%samples, settings%chains), source=0.0_wp, stat=stat)
      if (stat /= 0) then
         call raise_no_memory(to_text(settings%chains)//' chains of '//to_text(settings%samples) &
            & //' samples', error)
         return
      end if
      allocate (each(n))
      do k = 1, n
         last = k*(settings%chains/n)
         length = settings%samples*(settings%chains/n)
         associate (first => last - settings%chains/n + 1)
            each(k)%draws(1:target%dimension, 1:length) => chains%draws(:, :, first:last)
            each(k)%log_density(1:length) => chains%log_density(:, first:last)
         end associate
      end do
      call listen()
      do effort = 1, sampler%efforts
         call run_each()
         if (stop_requested() .or. .not. all(each%started)) exit
         if (are_reliable(each)) exit
      end do
      interrupted = stop_requested()
      call stop_listening()
      k = findloc(each%started, .false., dim=1)
      if (interrupted) then
         call raise(error, 'interrupted')
      else if (k > 0) then
         call raise(error, 'chain '//to_text(k) &
            & //': no admissible point with a finite density was found within the bounds')
      end if
      if (allocated(error)) return
      chains%acceptance = [(each(1 + (k - 1)/(settings%chains/n))%acceptance, k=1, settings%chains)]
      if (are_reliable(each)) chains%estimates = [(each(k)%estimate, k=1, n)]

   contains

      !> Run the samplers of the chains: before the last effort, only those that have no estimate
      !> yet, unless all have one.
      subroutine run_each()
         type(random_stream_type) :: stream
         logical :: has_estimate(n)
         integer :: i

         has_estimate = [(allocated(each(i)%estimate), i=1, n)]
         if (all(has_estimate) .or. effort == sampler%efforts) has_estimate = .false.
         i = count(.not. has_estimate)
         call begin_progress('sampling', int(i, i8)*(sampler%burn_in + length))
         !$omp parallel do num_threads(max(1, settings%threads)) schedule(dynamic, 1) &
         !$omp & private(stream)
         do i = 1, n
            if (has_estimate(i)) cycle
            stream = new_random_stream(settings%seed, settings%first_stream + i - 1)
            call chains%samplers(i)%run(effort, target, stream, each(i))
         end do
         !$omp end parallel do
         call end_progress()
      end subroutine run_each
   end subroutine sample_chains

   !> Set up the samplers of some runs, if there are none of this kind yet.
   subroutine begin_chains(sampler, n, chains)
      class(sampler_type), intent(in) :: sampler
      integer, intent(in) :: n
      type(chains_type), intent(inout) :: chains
      integer :: i

      if (allocated(chains%draws)) deallocate (chains%draws, chains%log_density)
      if (allocated(chains%estimates)) deallocate (chains%estimates)
      if (allocated(chains%samplers)) then
         if (size(chains%samplers) /= n .or. chains%samplers(1)%name /= sampler%name) then
            deallocate (chains%samplers)
         end if
      end if
      if (.not. allocated(chains%samplers)) allocate (chains%samplers(n), source=sampler)
      do i = 1, n
         chains%samplers(i)%burn_in = sampler%burn_in
         chains%samplers(i)%efforts = sampler%efforts
      end do
   end subroutine begin_chains

   !> Whether all chains have estimates that agree.
   pure logical function are_reliable(each)
      type(chain_type), intent(in) :: each(:)
      integer :: k

      are_reliable = all([(allocated(each(k)%estimate), k=1, size(each))])
      do k = 2, size(each)
         if (are_reliable) are_reliable = agree(each(1)%estimate, each(k)%estimate)
      end do
   end function are_reliable

end module samplers
