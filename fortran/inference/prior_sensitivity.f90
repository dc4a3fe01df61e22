!> How the results lean on the prior: what they would be with each of its limits moved by a tenth, and with its other measure.
!>
!> A limit that moves in takes draws away, and another measure weights them: both are exact but for the number of draws. What a limit that
!> moves out lets in was not drawn: it is estimated from what is within. A parabola is fitted to the logarithm of the density over three
!> times the distance and continued, and means go on along the line of those of two strips: both hold for a normal distribution.
module prior_sensitivity
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_solve
   use statistics, only: moments
   use support_limits, only: limit_type, no_limit
   implicit none
   private
   public :: change_type, measure_sensitivity

   !> What another prior would have said.
   type :: change_type
      !> What is limited, see `limit_type`; or 'measure'.
      character(len=26) :: name = ''
      logical :: is_upper = .false.
      !> The limit, GPa or 1, and where it is put.
      real(wp) :: from = 0.0_wp, to = 0.0_wp
      !> Whether nothing was estimated beyond what was drawn.
      logical :: exact = .true.
      !> How many draws are left, by their weights.
      real(wp) :: effective = 0.0_wp
      !> Of each parameter the shift of its mean in sds, and its sd in sds; NaN where too few draws are left.
      real(wp), allocatable :: shift(:), sd_ratio(:)
   end type change_type

   !> Share of its value by which a limit moves, but no more than the second of the interval; and draws that say something.
   real(wp), parameter :: relative_step = 0.1_wp, greatest_step = 0.25_wp
   integer, parameter :: least_draws = 100
   !> Poisson's ratio of what is incompressible.
   real(wp), parameter :: greatest_poisson = 0.5_wp

contains

   !> Every limit that there is moved in and out; and the other measure, where the prior is uniform.
   subroutine measure_sensitivity(posterior, draws, limits, changes)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> Of these draws.
      type(limit_type), intent(in) :: limits(:)
      type(change_type), allocatable, intent(out) :: changes(:)
      real(wp) :: log_weights(size(draws, 2))
      integer :: i

      allocate (changes(0))
      do i = 1, size(limits)
         call move_limits(draws, limits(i), changes)
      end do
      if (posterior%prior%has_default) return
      associate (logarithms => posterior%prior%logarithms)
         do i = 1, size(log_weights)
            log_weights(i) = logarithms%log_volume_at(logarithms%to_logarithms(posterior%stiffness(draws(:, i))))
         end do
      end associate
      if (.not. posterior%prior%in_logarithms) log_weights = -log_weights
      call add_change(draws, change_type('measure'), exp(log_weights - maxval(log_weights)), changes)
   end subroutine measure_sensitivity

   !> Both limits of a coordinate, where they are any, in and out.
   subroutine move_limits(draws, about, changes)
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      type(limit_type), intent(in) :: about
      type(change_type), allocatable, intent(inout) :: changes(:)
      real(wp) :: limit, inwards, step, distance(size(draws, 2))
      integer :: side

      do side = 1, 2
         limit = about%range(side)
         if (.not. abs(limit) < no_limit) cycle
         inwards = merge(1.0_wp, -1.0_wp, side == 1)
         step = min(relative_step*abs(limit), greatest_step*(about%range(2) - about%range(1)))
         if (.not. step > 0.0_wp) cycle
         distance = inwards*(about%values - limit)
         call add_change(draws, change_type(about%name, side == 2, limit, limit + inwards*step), &
            & merge(1.0_wp, 0.0_wp, distance >= step), changes)
         if (side == 2 .and. about%name == 'domain.poisson') step = min(step, greatest_poisson - limit)
         call add_beyond(draws, change_type(about%name, side == 2, limit, limit - inwards*step, exact=.false.), distance, step, &
            & changes)
      end do
   end subroutine move_limits

   !> The draws with weights.
   subroutine add_change(draws, about, weights, changes)
      real(wp), intent(in) :: draws(:, :)
      !> What is changed.
      type(change_type), intent(in) :: about
      !> (draw).
      real(wp), intent(in) :: weights(:)
      type(change_type), allocatable, intent(inout) :: changes(:)
      real(wp), dimension(size(draws, 1)) :: mean, sd, new_mean, new_sd

      call moments(draws, mean, sd, spread(1.0_wp, 1, size(draws, 2)))
      call moments(draws, new_mean, new_sd, weights)
      call compare(about, sum(weights)**2/max(tiny(1.0_wp), sum(weights**2)), mean, sd, new_mean, new_sd, changes)
   end subroutine add_change

   !> The draws and those that a limit which moves by `step` lets in.
   subroutine add_beyond(draws, about, distance, step, changes)
      real(wp), intent(in) :: draws(:, :)
      type(change_type), intent(in) :: about
      !> From the limit, (draw), and by how much it moves.
      real(wp), intent(in) :: distance(:), step
      type(change_type), allocatable, intent(inout) :: changes(:)
      !> The most that is let in, in what the strip next to it has, and draws of a strip that say something.
      real(wp), parameter :: greatest_growth = 1.5_wp
      integer, parameter :: least_in_strip = 20
      real(wp), dimension(size(draws, 1)) :: mean, sd, near_mean, near_sd, far_mean, far_sd
      real(wp) :: near(size(distance)), far(size(distance)), beyond

      near = merge(1.0_wp, 0.0_wp, distance <= step)
      far = merge(1.0_wp, 0.0_wp, distance > step .and. distance <= 2.0_wp*step)
      call moments(draws, mean, sd, spread(1.0_wp, 1, size(draws, 2)))
      call moments(draws, near_mean, near_sd, near)
      call moments(draws, far_mean, far_sd, far)
      if (sum(near) < least_in_strip) then
         call compare(about, real(size(distance), wp), mean, sd, mean, sd, changes)
      else
         beyond = min(greatest_growth*sum(near), continued(distance/step))/size(near)
         if (sum(far) >= least_in_strip) near_mean = 2.0_wp*near_mean - far_mean
         far_mean = (mean + beyond*near_mean)/(1.0_wp + beyond)
         far_sd = sqrt((sd**2 + beyond*near_sd**2 + beyond/(1.0_wp + beyond)*(near_mean - mean)**2)/(1.0_wp + beyond))
         call compare(about, real(size(distance), wp), mean, sd, far_mean, far_sd, changes)
      end if
   end subroutine add_beyond

   !> How many draws would lie between -1 and 0, of those that lie between 0 and 3.
   real(wp) function continued(t)
      !> (draw).
      real(wp), intent(in) :: t(:)
      integer, parameter :: bins_per_unit = 4, bins = 3*bins_per_unit, least = 5
      real(wp) :: counts(bins), normal(3, 3), right(3, 1), terms(3)
      type(error_type), allocatable :: error
      integer :: i, j, k

      counts = 0.0_wp
      do i = 1, size(t)
         k = 1 + int(bins_per_unit*min(3.0_wp, max(0.0_wp, t(i))))
         if (k <= bins) counts(k) = counts(k) + 1.0_wp
      end do
      normal = 0.0_wp
      right = 0.0_wp
      do k = 1, bins
         if (counts(k) < least) cycle
         terms = powers(k - 0.5_wp)
         do j = 1, 3
            normal(:, j) = normal(:, j) + counts(k)*terms*terms(j)
         end do
         right(:, 1) = right(:, 1) + counts(k)*log(counts(k))*terms
      end do
      continued = counts(1)*bins_per_unit
      ! Draws in a few bins alone have no parabola.
      if (count(counts >= least) < 4) return
      call cholesky_factor(normal, error)
      if (allocated(error)) return
      call cholesky_solve(normal, right)
      right(3, 1) = min(0.0_wp, right(3, 1))
      continued = 0.0_wp
      do k = 1, bins_per_unit
         continued = continued + exp(min(100.0_wp, sum(right(:, 1)*powers(0.5_wp - k))))
      end do

   contains

      pure function powers(place)
         real(wp), intent(in) :: place
         real(wp) :: powers(3)

         powers = [1.0_wp, place/bins_per_unit, (place/bins_per_unit)**2]
      end function powers
   end function continued

   !> Add a change from the moments without and with it.
   pure subroutine compare(about, effective, mean, sd, new_mean, new_sd, changes)
      type(change_type), intent(in) :: about
      real(wp), intent(in) :: effective, mean(:), sd(:), new_mean(:), new_sd(:)
      type(change_type), allocatable, intent(inout) :: changes(:)
      type(change_type) :: change

      change = about
      change%effective = effective
      change%shift = (new_mean - mean)/max(tiny(1.0_wp), sd)
      change%sd_ratio = new_sd/max(tiny(1.0_wp), sd)
      if (effective < least_draws) then
         change%shift = ieee_value(1.0_wp, ieee_quiet_nan)
         change%sd_ratio = change%shift
      end if
      changes = [changes, change]
   end subroutine compare
end module prior_sensitivity
