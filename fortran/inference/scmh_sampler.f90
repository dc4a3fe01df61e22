!> The paper's sampler (section 2.2), single-component Metropolis-Hastings. The parameters take
!> normal steps one after another. The sd of each step is tuned towards an acceptance of 0.23 during
!> the burn-in only. One sample is one sweep over the parameters.
module scmh_sampler
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use moves, only: random_walk_type
   use random, only: random_stream_type
   use abstract_sampler, only: chain_type, draw_starts, outside, sampler_type, target_type
   implicit none
   private
   public :: scmh_sampler_type

   type, extends(sampler_type) :: scmh_sampler_type
   contains
      procedure :: run => run_scmh
   end type scmh_sampler_type

contains

   !> The start is one of the ten best of a hundred points drawn from the support.
   subroutine run_scmh(self, effort, target, stream, chain)
      class(scmh_sampler_type), intent(inout) :: self
      !> There is one.
      integer, intent(in) :: effort
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> Its acceptance is the share of accepted steps of single parameters.
      type(chain_type), intent(inout) :: chain
      type(random_walk_type) :: walk
      real(wp) :: starts(target%dimension, 100), start_density(100), x(target%dimension, 1), &
         & proposed(target%dimension, 1), sum_of_logs(target%dimension), range(target%dimension), &
         & density(1), current, u
      integer :: sweep, j, n_found, accepted, best, pick
      logical :: accept

      associate (unused => effort)
      end associate
      call draw_starts(target, stream, starts, start_density, n_found)
      chain%started = n_found > 0
      if (.not. chain%started) return
      call stream%pick(min(10, n_found), pick)
      best = 1
      do j = 1, pick
         best = maxloc(start_density(:n_found), dim=1)
         if (j < pick) start_density(best) = outside
      end do
      current = start_density(best)
      x(:, 1) = starts(:, best)
      range = maxval(starts(:, :n_found), 2) - minval(starts(:, :n_found), 2)
      where (.not. range > 0.0_wp) range = abs(x(:, 1))
      walk = random_walk_type(step=0.1_wp*range, greatest=10.0_wp*range)
      sum_of_logs = 0.0_wp
      accepted = 0
      do sweep = 1 - self%burn_in, size(chain%log_density)
         if (stop_requested()) return
         call advance_progress(1_i8)
         do j = 1, target%dimension
            proposed = x
            call walk%propose(stream, j, proposed(j, 1))
            call stream%uniform(u)
            call target%evaluate(proposed, density)
            accept = density(1) > outside .and. log(u) < density(1) - current
            if (accept) then
               x = proposed
               current = density(1)
               if (sweep > 0) accepted = accepted + 1
            end if
            if (sweep <= 0) call walk%tune(j, accept, sweep + self%burn_in)
         end do
         if (sweep <= 0 .and. 2*sweep > -self%burn_in) sum_of_logs = sum_of_logs + log(walk%step)
         ! From here on the steps are fixed at their mean, that of the logarithm, over the second
         ! half of the burn-in, which varies less than the last value.
         if (sweep == 0 .and. self%burn_in > 1) then
            walk%step = exp(sum_of_logs/((self%burn_in + 1)/2))
         end if
         if (sweep > 0) then
            chain%draws(:, sweep) = x(:, 1)
            chain%log_density(sweep) = current
         end if
      end do
      chain%acceptance = accepted/(real(size(chain%log_density), wp)*target%dimension)
   end subroutine run_scmh
end module scmh_sampler
