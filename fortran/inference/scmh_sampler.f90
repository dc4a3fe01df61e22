!> The paper's sampler (section 2.2), single-component Metropolis-Hastings. The parameters take
!> normal steps one after another. The sd of each step is tuned towards an acceptance of 0.23 during
!> the burn-in only. One sample is one sweep over the parameters.
module scmh_sampler
   use progress, only: advance_progress
   use running_command, only: stop_requested
   use kinds, only: i8, wp
   use random, only: random_stream_type
   use abstract_sampler, only: draw_starts, outside, target_type
   implicit none
   private
   public :: run_scmh

   !> Acceptance to which the paper tunes each component.
   real(wp), parameter :: target_acceptance = 0.23_wp

contains

   !> The start is one of the ten best of a hundred points drawn from the support.
   subroutine run_scmh(burn_in, target, stream, draws, log_density, acceptance, started)
      !> Number of sweeps before the first sample.
      integer, intent(in) :: burn_in
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> (parameter, sample), (sample).
      real(wp), intent(out) :: draws(:, :), log_density(:)
      !> Share of accepted steps of single parameters.
      real(wp), intent(out) :: acceptance
      !> Whether a point of the support was found.
      logical, intent(out) :: started
      real(wp) :: starts(target%dimension, 100), start_density(100), x(target%dimension)
      real(wp) :: step(target%dimension), sum_of_logs(target%dimension), range(target%dimension), &
         & proposed(1), current, previous, gain, u, z
      integer :: sweep, j, n_found, accepted, best, pick, samples
      logical :: accept

      samples = size(log_density)
      acceptance = 0.0_wp
      call draw_starts(target, stream, starts, start_density, n_found)
      started = n_found > 0
      if (.not. started) return
      call stream%pick(min(10, n_found), pick)
      best = 1
      do j = 1, pick
         best = maxloc(start_density(:n_found), dim=1)
         if (j < pick) start_density(best) = -huge(1.0_wp)
      end do
      x = starts(:, best)
      current = start_density(best)
      range = maxval(starts(:, :n_found), 2) - minval(starts(:, :n_found), 2)
      where (.not. range > 0.0_wp) range = abs(x)
      step = 0.1_wp*range
      sum_of_logs = 0.0_wp
      accepted = 0
      do sweep = 1 - burn_in, samples
         if (stop_requested()) return
         call advance_progress(1_i8)
         do j = 1, target%dimension
            previous = x(j)
            call stream%normal(z)
            call stream%uniform(u)
            x(j) = previous + step(j)*z
            call target%evaluate(reshape(x, [size(x), 1]), proposed)
            accept = proposed(1) > outside .and. log(u) < proposed(1) - current
            if (accept) then
               current = proposed(1)
               if (sweep > 0) accepted = accepted + 1
            else
               x(j) = previous
            end if
            if (sweep <= 0) then
               ! Robbins-Monro on the logarithm of the step, with a gain that falls during the
               ! burn-in.
               gain = 2.0_wp*(sweep + burn_in + 25)**(-0.5_wp)
               step(j) = min(10.0_wp*range(j), &
                  & step(j)*exp(gain*(merge(1.0_wp, 0.0_wp, accept) - target_acceptance)))
               if (2*sweep > -burn_in) sum_of_logs(j) = sum_of_logs(j) + log(step(j))
            end if
         end do
         ! From here on the steps are fixed at their mean, that of the logarithm, over the second
         ! half of the burn-in, which varies less than the last value.
         if (sweep == 0 .and. burn_in > 1) step = exp(sum_of_logs/((burn_in + 1)/2))
         if (sweep > 0) then
            draws(:, sweep) = x
            log_density(sweep) = current
         end if
      end do
      acceptance = real(accepted, wp)/(real(samples, wp)*target%dimension)
   end subroutine run_scmh
end module scmh_sampler
