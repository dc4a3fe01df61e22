!> Sensitivity of the results to the prior: how they change if each limit of the prior moves by a
!> tenth, and if the prior is uniform in the other coordinates.
!>
!> A limit that moves inwards removes draws, and other coordinates weight them. Both results are
!> exact up to the number of draws. A limit that moves outwards admits crystals that were not drawn,
!> so the result is extrapolated from the draws. A parabola is fitted to the logarithm of the
!> density over three times the distance, and means continue along the line through those of two
!> strips. Both are exact for a normal distribution.
!>
!> The limits are those of the support of a posterior: stated ones and those of the surrogate's
!> domain, each in the coordinate that it limits. The module also finds the limits that truncate the
!> posterior.
module prior_sensitivity
   use constants_posterior, only: posterior_type
   use constants_prior, only: least_width, prior_type, relative_width
   use crystal_elasticity, only: anisotropy_index, logarithmic_mean
   use errors, only: error_type
   use kinds, only: nan, wp
   use linear_algebra, only: cholesky_factor, cholesky_solve
   use statistics, only: moments
   implicit none
   private
   public :: change_type, measure_sensitivity, limit_type, list_limits, is_truncated

   !> Results with another prior.
   type :: change_type
      !> Name of the coordinate that is limited, see `limit_type`, or 'measure'.
      character(len=26) :: name = ''
      logical :: is_upper = .false.
      !> The limit, GPa or 1, and its new value.
      real(wp) :: from = 0.0_wp, to = 0.0_wp
      !> Whether the result needs no extrapolation.
      logical :: exact = .true.
      !> Effective number of the weighted draws.
      real(wp) :: effective = 0.0_wp
      !> Shift of the mean and new sd of each parameter, in sds. NaN if too few draws remain.
      real(wp), allocatable :: shift(:), sd_ratio(:)
   end type change_type

   !> Part of its value by which a limit moves, and the greatest part of the interval; least
   !> effective number of draws, for means with an error of 0.1 sd.
   real(wp), parameter :: relative_step = 0.1_wp, greatest_step = 0.25_wp
   integer, parameter :: least_draws = 100
   !> Poisson's ratio of an incompressible solid.
   real(wp), parameter :: greatest_poisson = 0.5_wp

   !> A limit beyond this counts as absent.
   real(wp), parameter :: absent = 1.0e6_wp

   type :: limit_type
      !> A constant or 'anisotropy_cap' of &prior; for the surrogate's domain, 'domain.C11' or a
      !> variable of &domain with this prefix.
      character(len=26) :: name = ''
      !> Whether the user stated the limit. A posterior that it truncates is then intended.
      logical :: stated = .false.
      !> Lower and upper limit, in the unit of the coordinate.
      real(wp) :: range(2) = [-absent, absent]
      !> The coordinate of the draws, (draw).
      real(wp), allocatable :: values(:)
      !> At each side, whether the limit truncates the draws, and the share of the draws in the
      !> outermost twentieth of their range.
      logical :: truncates(2) = .false.
      real(wp) :: share(2) = 0.0_wp
   end type limit_type

contains

   !> Move every limit in and out, and change the coordinates of a prior that is uniform.
   subroutine measure_sensitivity(posterior, draws, limits, changes)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> Limits with the coordinates of these draws.
      type(limit_type), intent(in) :: limits(:)
      type(change_type), allocatable, intent(out) :: changes(:)
      real(wp) :: log_weights(size(draws, 2)), mean(size(draws, 1)), sd(size(draws, 1))
      real(wp), allocatable :: standard(:, :)
      integer :: i

      allocate (changes(0))
      log_weights = 0.0_wp
      call moments(draws, mean, sd, exp(log_weights))
      standard = (draws - spread(mean, 2, size(draws, 2)))/spread(max(tiny(1.0_wp), sd), 2, &
         & size(draws, 2))
      do i = 1, size(limits)
         call move_limits(standard, limits(i), changes)
      end do
      if (posterior%prior%has_default) return
      associate (logarithms => posterior%prior%logarithms)
         do i = 1, size(log_weights)
            log_weights(i) &
               & = logarithms%log_volume(logarithms%to_logarithms(posterior%stiffness(draws(:, i))))
         end do
      end associate
      if (.not. posterior%prior%in_logarithms) log_weights = -log_weights
      call add_change(standard, change_type('measure'), &
         & exp(log_weights - maxval(log_weights)), changes)
   end subroutine measure_sensitivity

   !> Move both limits of a coordinate, as far as they exist, in and out.
   subroutine move_limits(draws, limited, changes)
      !> Draws less their means and divided by their sds, (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      type(limit_type), intent(in) :: limited
      type(change_type), allocatable, intent(inout) :: changes(:)
      real(wp) :: limit, inwards, step, distance(size(draws, 2))
      integer :: side

      do side = 1, 2
         limit = limited%range(side)
         if (.not. abs(limit) < absent) cycle
         inwards = merge(1.0_wp, -1.0_wp, side == 1)
         step = min(relative_step*abs(limit), greatest_step*(limited%range(2) - limited%range(1)))
         if (.not. step > 0.0_wp) cycle
         distance = inwards*(limited%values - limit)
         call add_change(draws, change_type(limited%name, side == 2, limit, limit + inwards*step), &
            & merge(1.0_wp, 0.0_wp, distance >= step), changes)
         if (side == 2 .and. limited%name == 'domain.poisson') then
            step = min(step, greatest_poisson - limit)
         end if
         call add_beyond(draws, change_type(limited%name, side == 2, limit, limit - inwards*step, &
            & exact=.false.), distance, step, changes)
      end do
   end subroutine move_limits

   !> Add the change that weights of the draws make.
   subroutine add_change(draws, about, weights, changes)
      !> See `move_limits`.
      real(wp), intent(in) :: draws(:, :)
      !> What is changed; its results are not set.
      type(change_type), intent(in) :: about
      !> Weight of each draw, (draw).
      real(wp), intent(in) :: weights(:)
      type(change_type), allocatable, intent(inout) :: changes(:)
      real(wp), dimension(size(draws, 1)) :: mean, sd

      call moments(draws, mean, sd, weights)
      call add_moments(about, sum(weights)**2/max(tiny(1.0_wp), sum(weights**2)), mean, sd, changes)
   end subroutine add_change

   !> Add the change by the crystals that a limit admits when it moves outwards by `step`.
   subroutine add_beyond(draws, about, distance, step, changes)
      !> See `move_limits`.
      real(wp), intent(in) :: draws(:, :)
      type(change_type), intent(in) :: about
      !> Distance of the draws from the limit, (draw), and the step of the limit.
      real(wp), intent(in) :: distance(:), step
      type(change_type), allocatable, intent(inout) :: changes(:)
      !> Greatest number of admitted draws, relative to the strip next to the limit: it bounds the
      !> extrapolation.
      real(wp), parameter :: greatest_growth = 1.5_wp
      !> Least number of draws in a strip, for a mean with an error of 0.2 sd.
      integer, parameter :: least_in_strip = 20
      real(wp), dimension(size(draws, 1)) :: mean, sd, inner_mean, inner_sd, outer_mean, outer_sd
      real(wp) :: inner(size(distance)), outer(size(distance)), admitted

      inner = merge(1.0_wp, 0.0_wp, distance <= step)
      outer = merge(1.0_wp, 0.0_wp, distance > step .and. distance <= 2.0_wp*step)
      mean = 0.0_wp
      sd = 1.0_wp
      call moments(draws, inner_mean, inner_sd, inner)
      call moments(draws, outer_mean, outer_sd, outer)
      if (sum(inner) >= least_in_strip) then
         admitted = min(greatest_growth*sum(inner), extrapolated(distance/step))/size(inner)
         if (sum(outer) >= least_in_strip) inner_mean = 2.0_wp*inner_mean - outer_mean
         sd = sqrt((1.0_wp + admitted*inner_sd**2 + admitted/(1.0_wp + admitted)*inner_mean**2) &
            & /(1.0_wp + admitted))
         mean = admitted*inner_mean/(1.0_wp + admitted)
      end if
      call add_moments(about, real(size(distance), wp), mean, sd, changes)
   end subroutine add_beyond

   !> Extrapolated number of draws between -1 and 0, from those between 0 and 3.
   real(wp) function extrapolated(t)
      !> Distances from the limit in steps, (draw).
      real(wp), intent(in) :: t(:)
      integer, parameter :: bins_per_unit = 4, bins = 3*bins_per_unit, least = 5
      integer :: k
      real(wp), parameter :: place(bins) = [((k - 0.5_wp)/bins_per_unit, k=1, bins)]
      !> Terms of the parabola: 1, the place of a bin and its square.
      real(wp), parameter :: terms(bins, 3) = reshape([spread(1.0_wp, 1, bins), place, &
         & place**2], [bins, 3])
      real(wp) :: counts(bins), weighted(bins, 3), normal(3, 3), right(3, 1)
      type(error_type), allocatable :: error

      counts = [(count(int(bins_per_unit*min(3.0_wp, max(0.0_wp, t))) == k - 1), k=1, bins)]
      extrapolated = counts(1)*bins_per_unit
      where (counts < least) counts = 0.0_wp
      weighted = terms*spread(counts, 2, 3)
      normal = matmul(transpose(weighted), terms)
      right(:, 1) = matmul(transpose(weighted), log(max(1.0_wp, counts)))
      ! A parabola needs more than its three bins.
      if (count(counts > 0.0_wp) < 4) return
      call cholesky_factor(normal, error)
      call cholesky_solve(normal, right)
      right(2:, 1) = [-right(2, 1), min(0.0_wp, right(3, 1))]
      extrapolated = sum(exp(min(100.0_wp, matmul(terms(:bins_per_unit, :), right(:, 1)))))
   end function extrapolated

   !> Add a change, given the moments of the draws with it.
   pure subroutine add_moments(about, effective, mean, sd, changes)
      type(change_type), intent(in) :: about
      !> Effective number of draws; mean and sd of each parameter, in sds.
      real(wp), intent(in) :: effective, mean(:), sd(:)
      type(change_type), allocatable, intent(inout) :: changes(:)
      type(change_type) :: change

      change = about
      change%effective = effective
      change%shift = mean
      change%sd_ratio = sd
      if (effective < least_draws) then
         change%shift = nan
         change%sd_ratio = nan
      end if
      changes = [changes, change]
   end subroutine add_moments

   !> List every coordinate that has a limit.
   function list_limits(prior, draws) result(limits)
      type(prior_type), intent(in) :: prior
      !> (parameter, draw); the first parameters are the constants, GPa.
      real(wp), intent(in) :: draws(:, :)
      type(limit_type), allocatable :: limits(:)
      real(wp) :: means(3, size(draws, 2)), anisotropy(size(draws, 2)), range(2), c(6, 6)
      integer :: i, j

      do i = 1, size(draws, 2)
         c = prior%class%stiffness(draws(:prior%n_constants, i))
         call logarithmic_mean(c, means(1, i), means(2, i), means(3, i))
         anisotropy(i) = anisotropy_index(c)
      end do
      allocate (limits(0))
      associate (domain => prior%domain)
         do j = 1, prior%n_constants
            call add_limit(prior%class%constants(j), .true., [prior%lower(j), prior%upper(j)], &
               & draws(j, :))
            if (size(domain%lower) > 0) then
               range = [domain%lower(j), domain%upper(j)]
               if (.not. range(1) > prior%lower(j)) range(1) = -absent
               if (.not. range(2) < prior%upper(j)) range(2) = absent
               call add_limit('domain.'//prior%class%constants(j), .false., range, draws(j, :))
            end if
         end do
         call add_limit('anisotropy_cap', .true., [-absent, prior%anisotropy_cap], anisotropy)
         if (domain%anisotropy_cap < prior%anisotropy_cap) then
            call add_limit('domain.anisotropy_cap', .false., [-absent, domain%anisotropy_cap], &
               & anisotropy)
         end if
         if (size(domain%lower) == 0 .and. domain%log_anisotropy_max < absent) then
            call add_limit('domain.log_anisotropy_max', .false., &
               & [-absent, domain%log_anisotropy_max], means(2, :))
            call add_limit('domain.poisson', .false., domain%poisson, means(1, :))
            if (domain%has_scale()) then
               call add_limit('domain.stiffness_gpa', .false., domain%stiffness, means(3, :))
            end if
         end if
      end associate

   contains

      !> Add a coordinate, unless both limits are absent or fix a constant, where every draw is at
      !> both.
      subroutine add_limit(name, stated, range, values)
         character(len=*), intent(in) :: name
         logical, intent(in) :: stated
         real(wp), intent(in) :: range(2), values(:)
         type(limit_type) :: limit

         if (all(abs(range) >= absent) &
            & .or. range(2) - range(1) < 2.1_wp*max(least_width, relative_width*abs(range(1)))) then
            return
         end if
         limit = limit_type(name, stated, range)
         ! In the constructor gfortran 12 ignores the stride of a section.
         limit%values = values
         call find_truncation(limit)
         limits = [limits, limit]
      end subroutine add_limit
   end function list_limits

   !> Find which limits truncate the draws. The range of the draws is divided into twenty equal
   !> parts. A limit truncates them if the outermost part reaches it, with a density above a third
   !> of the maximum.
   subroutine find_truncation(limit)
      type(limit_type), intent(inout) :: limit
      integer, parameter :: parts = 20
      real(wp), parameter :: least_density = 1.0_wp/3.0_wp
      integer :: counts(parts), k, side
      real(wp) :: inwards, low, width
      real(wp), allocatable :: x(:)

      do side = 1, 2
         inwards = merge(1.0_wp, -1.0_wp, side == 1)
         x = inwards*limit%values
         low = minval(x)
         width = (maxval(x) - low)/parts
         if (abs(limit%range(side)) >= absent .or. .not. width > 0.0_wp) cycle
         counts = [(count(min(parts, 1 + int((x - low)/width)) == k), k=1, parts)]
         limit%share(side) = real(counts(1), wp)/size(x)
         limit%truncates(side) = low - inwards*limit%range(side) < width &
            & .and. counts(1) > least_density*maxval(counts)
      end do
   end subroutine find_truncation

   !> Whether a limit that the user did not state truncates the draws.
   pure logical function is_truncated(limits)
      type(limit_type), intent(in) :: limits(:)
      integer :: i

      is_truncated = any([(.not. limits(i)%stated .and. any(limits(i)%truncates), i=1, &
         & size(limits))])
   end function is_truncated

end module prior_sensitivity
