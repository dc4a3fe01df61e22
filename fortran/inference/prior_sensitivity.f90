!> How the results lean on the prior: what they would be with each of its limits moved by a tenth,
!> and with its other measure.
!>
!> A limit that moves in takes draws away, and another measure weights them: both are exact but for
!> the number of draws. What a limit that moves out lets in was not drawn: it is estimated from what
!> is within. A parabola is fitted to the logarithm of the density over three times the distance and
!> continued, and means go on along the line of those of two strips: both hold for a normal
!> distribution.
!>
!> The limits are those of the support of a posterior, stated ones and those of the surrogate's
!> domain, each in the coordinate that it limits; and where the draws end at one is said, too.
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
      !> Of each parameter the shift of its mean in sds, and its sd in sds; NaN where too few draws
      !> are left.
      real(wp), allocatable :: shift(:), sd_ratio(:)
   end type change_type

   !> Share of its value by which a limit moves, but no more than the second of the interval; and
   !> draws that say something.
   real(wp), parameter :: relative_step = 0.1_wp, greatest_step = 0.25_wp
   integer, parameter :: least_draws = 100
   !> Poisson's ratio of what is incompressible.
   real(wp), parameter :: greatest_poisson = 0.5_wp

   !> What is not within is no limit.
   real(wp), parameter :: no_limit = 1.0e6_wp

   type :: limit_type
      !> A constant or 'anisotropy_cap' of &prior; or of the surrogate's domain, 'domain.C11' or the
      !> variables of &domain.
      character(len=26) :: name = ''
      !> By the user: a posterior that ends there is what was asked for.
      logical :: stated = .false.
      !> The lower and the upper, in the unit of the coordinate.
      real(wp) :: range(2) = [-no_limit, no_limit]
      !> The coordinate, (draw).
      real(wp), allocatable :: values(:)
      !> Whether the draws end at it, and the share of the draws in the outermost twentieth of their
      !> range, at each side.
      logical :: truncates(2) = .false.
      real(wp) :: share(2) = 0.0_wp
   end type limit_type

contains

   !> Every limit that there is moved in and out; and the other measure, where the prior is uniform.
   subroutine measure_sensitivity(posterior, draws, limits, changes)
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw).
      real(wp), intent(in) :: draws(:, :)
      !> Of these draws.
      type(limit_type), intent(in) :: limits(:)
      type(change_type), allocatable, intent(out) :: changes(:)
      real(wp) :: log_weights(size(draws, 2)), mean(size(draws, 1)), sd(size(draws, 1))
      real(wp), allocatable :: standard(:, :), coordinates(:)
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
            coordinates = logarithms%to_logarithms(posterior%stiffness(draws(:, i)))
            log_weights(i) = logarithms%log_volume_at(coordinates)
         end do
      end associate
      if (.not. posterior%prior%in_logarithms) log_weights = -log_weights
      call add_change(standard, change_type('measure'), &
         & exp(log_weights - maxval(log_weights)), changes)
   end subroutine measure_sensitivity

   !> Both limits of a coordinate, where they are any, in and out.
   subroutine move_limits(draws, about, changes)
      !> Less their means, over their sds, (parameter, draw).
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
         if (side == 2 .and. about%name == 'domain.poisson') then
            step = min(step, greatest_poisson - limit)
         end if
         call add_beyond(draws, change_type(about%name, side == 2, limit, limit - inwards*step, &
            & exact=.false.), distance, step, changes)
      end do
   end subroutine move_limits

   !> The draws with weights.
   subroutine add_change(draws, about, weights, changes)
      !> See `move_limits`.
      real(wp), intent(in) :: draws(:, :)
      !> What is changed.
      type(change_type), intent(in) :: about
      !> (draw).
      real(wp), intent(in) :: weights(:)
      type(change_type), allocatable, intent(inout) :: changes(:)
      real(wp), dimension(size(draws, 1)) :: mean, sd

      call moments(draws, mean, sd, weights)
      call add_moments(about, sum(weights)**2/max(tiny(1.0_wp), sum(weights**2)), mean, sd, changes)
   end subroutine add_change

   !> The draws and those that a limit which moves by `step` lets in.
   subroutine add_beyond(draws, about, distance, step, changes)
      !> See `move_limits`.
      real(wp), intent(in) :: draws(:, :)
      type(change_type), intent(in) :: about
      !> From the limit, (draw), and by how much it moves.
      real(wp), intent(in) :: distance(:), step
      type(change_type), allocatable, intent(inout) :: changes(:)
      !> The most that is let in, in what the strip next to it has, and draws of a strip that say
      !> something.
      real(wp), parameter :: greatest_growth = 1.5_wp
      integer, parameter :: least_in_strip = 20
      real(wp), dimension(size(draws, 1)) :: mean, sd, near_mean, near_sd, far_mean, far_sd
      real(wp) :: near(size(distance)), far(size(distance)), beyond

      near = merge(1.0_wp, 0.0_wp, distance <= step)
      far = merge(1.0_wp, 0.0_wp, distance > step .and. distance <= 2.0_wp*step)
      mean = 0.0_wp
      sd = 1.0_wp
      call moments(draws, near_mean, near_sd, near)
      call moments(draws, far_mean, far_sd, far)
      if (sum(near) >= least_in_strip) then
         beyond = min(greatest_growth*sum(near), continued(distance/step))/size(near)
         if (sum(far) >= least_in_strip) near_mean = 2.0_wp*near_mean - far_mean
         sd = sqrt((1.0_wp + beyond*near_sd**2 + beyond/(1.0_wp + beyond)*near_mean**2) &
            & /(1.0_wp + beyond))
         mean = beyond*near_mean/(1.0_wp + beyond)
      end if
      call add_moments(about, real(size(distance), wp), mean, sd, changes)
   end subroutine add_beyond

   !> How many draws would lie between -1 and 0, of those that lie between 0 and 3.
   real(wp) function continued(t)
      !> (draw).
      real(wp), intent(in) :: t(:)
      integer, parameter :: bins_per_unit = 4, bins = 3*bins_per_unit, least = 5
      integer :: i, k
      real(wp), parameter :: place(bins) = [((k - 0.5_wp)/bins_per_unit, k=1, bins)]
      !> 1, the place and its square.
      real(wp), parameter :: terms(bins, &
         & 3) = reshape([spread(1.0_wp, 1, bins), place, place**2], [bins, 3])
      real(wp) :: counts(bins), weighted(bins, 3), normal(3, 3), right(3, 1)
      type(error_type), allocatable :: error

      counts = 0.0_wp
      do i = 1, size(t)
         k = 1 + int(bins_per_unit*min(3.0_wp, max(0.0_wp, t(i))))
         if (k <= bins) counts(k) = counts(k) + 1.0_wp
      end do
      continued = counts(1)*bins_per_unit
      where (counts < least) counts = 0.0_wp
      weighted = terms*spread(counts, 2, 3)
      normal = matmul(transpose(weighted), terms)
      right(:, 1) = matmul(transpose(weighted), log(max(1.0_wp, counts)))
      ! Draws in a few bins alone have no parabola.
      if (count(counts > 0.0_wp) < 4) return
      call cholesky_factor(normal, error)
      if (allocated(error)) return
      call cholesky_solve(normal, right)
      right(2:, 1) = [-right(2, 1), min(0.0_wp, right(3, 1))]
      continued = sum(exp(min(100.0_wp, matmul(terms(:bins_per_unit, :), right(:, 1)))))
   end function continued

   !> Add a change from the moments that the draws have with it.
   pure subroutine add_moments(about, effective, mean, sd, changes)
      type(change_type), intent(in) :: about
      !> Draws that are left; mean and sd of each parameter, in sds.
      real(wp), intent(in) :: effective, mean(:), sd(:)
      type(change_type), allocatable, intent(inout) :: changes(:)
      type(change_type) :: change

      change = about
      change%effective = effective
      change%shift = mean
      change%sd_ratio = sd
      if (effective < least_draws) change%shift = nan
      if (effective < least_draws) change%sd_ratio = nan
      changes = [changes, change]
   end subroutine add_moments

   !> Every coordinate with a limit.
   function list_limits(prior, draws) result(limits)
      type(prior_type), intent(in) :: prior
      !> (parameter, draw), the first parameters constants.
      real(wp), intent(in) :: draws(:, :)
      type(limit_type), allocatable :: limits(:)
      real(wp) :: means(3, size(draws, 2)), index(size(draws, 2)), c(6, 6)
      integer :: i, j

      do i = 1, size(draws, 2)
         c = prior%class%stiffness(draws(:prior%n_constants, i))
         call logarithmic_mean(c, means(1, i), means(2, i), means(3, i))
         index(i) = anisotropy_index(c)
      end do
      allocate (limits(0))
      associate (domain => prior%domain)
         do j = 1, prior%n_constants
            call add(prior%class%constants(j), .true., [prior%lower(j), prior%upper(j)], &
               & draws(j, :))
            if (size(domain%lower) > 0) then
               call add('domain.'//prior%class%constants(j), .false., &
                  & [merge(domain%lower(j), -no_limit, domain%lower(j) > prior%lower(j)), &
                  & merge(domain%upper(j), no_limit, domain%upper(j) < prior%upper(j))], &
                  & draws(j, :))
            end if
         end do
         call add('anisotropy_cap', .true., [-no_limit, prior%anisotropy_cap], index)
         if (domain%anisotropy_cap < prior%anisotropy_cap) then
            call add('domain.anisotropy_cap', .false., [-no_limit, domain%anisotropy_cap], index)
         end if
         if (size(domain%lower) == 0 .and. domain%log_anisotropy_max < no_limit) then
            call add('domain.log_anisotropy_max', .false., [-no_limit, domain%log_anisotropy_max], &
               & means(2, :))
            call add('domain.poisson', .false., domain%poisson, means(1, :))
            if (domain%has_scale()) then
               call add('domain.stiffness_gpa', .false., domain%stiffness, means(3, :))
            end if
         end if
      end associate

   contains

      subroutine add(name, stated, range, values)
         character(len=*), intent(in) :: name
         logical, intent(in) :: stated
         real(wp), intent(in) :: range(2), values(:)
         type(limit_type) :: one

         ! No limits, or bounds that fix a constant, where every draw is at both.
         if (all(abs(range) >= no_limit) &
            & .or. range(2) - range(1) < 2.1_wp*max(least_width, relative_width*abs(range(1)))) then
            return
         end if
         one = limit_type(name, stated, range)
         ! In the constructor gfortran 12 ignores the stride of a section.
         one%values = values
         call find_end(one, 1)
         call find_end(one, 2)
         limits = [limits, one]
      end subroutine add
   end function list_limits

   !> Whether the draws end at the lower (1) or the upper (2) limit: in the outermost of twenty
   !> equal parts of their range, which reaches the limit, their density has not fallen to a third
   !> of its maximum.
   subroutine find_end(limit, side)
      type(limit_type), intent(inout) :: limit
      integer, intent(in) :: side
      integer, parameter :: parts = 20
      real(wp), parameter :: fallen = 1.0_wp/3.0_wp
      integer :: counts(parts), i, k
      real(wp) :: inwards, low, width
      real(wp), allocatable :: x(:)

      inwards = merge(1.0_wp, -1.0_wp, side == 1)
      x = inwards*limit%values
      low = minval(x)
      width = (maxval(x) - low)/parts
      if (abs(limit%range(side)) >= no_limit .or. .not. width > 0.0_wp) return
      counts = 0
      do i = 1, size(x)
         k = min(parts, 1 + int((x(i) - low)/width))
         counts(k) = counts(k) + 1
      end do
      limit%share(side) = real(counts(1), wp)/size(x)
      limit%truncates(side) = low - inwards*limit%range(side) < width &
         & .and. counts(1) > fallen*maxval(counts)
   end subroutine find_end

   !> Whether a limit that nobody stated ends the draws.
   pure logical function is_truncated(limits)
      type(limit_type), intent(in) :: limits(:)
      integer :: i

      is_truncated = any([(.not. limits(i)%stated .and. any(limits(i)%truncates), i=1, size(limits))])
   end function is_truncated

end module prior_sensitivity
