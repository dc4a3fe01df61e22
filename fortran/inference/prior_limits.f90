!> The limits of the support of a posterior, stated ones and those of the surrogate's domain, each
!> in the coordinate that it limits; and whether they truncate the draws.
module prior_limits
   use constants_prior, only: least_width, prior_type, relative_width
   use crystal_elasticity, only: anisotropy_index, logarithmic_mean
   use kinds, only: wp
   implicit none
   private
   public :: limit_type, list_limits, is_truncated

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
      !> At each side, whether the limit truncates the draws, and the share of the draws in the
      !> outermost twentieth of their range.
      logical :: truncates(2) = .false.
      real(wp) :: share(2) = 0.0_wp
   end type limit_type

contains

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
         call find_truncation(limit, values)
         limits = [limits, limit]
      end subroutine add_limit
   end function list_limits

   !> Find which limits truncate the draws. The range of the draws is divided into twenty equal
   !> parts. A limit truncates them if the outermost part reaches it, with a density above a third
   !> of the maximum.
   subroutine find_truncation(limit, values)
      type(limit_type), intent(inout) :: limit
      !> The coordinate of the draws, (draw).
      real(wp), intent(in) :: values(:)
      integer, parameter :: parts = 20
      real(wp), parameter :: least_density = 1.0_wp/3.0_wp
      integer :: counts(parts), k, side
      real(wp) :: inwards, low, width
      real(wp), allocatable :: x(:)

      do side = 1, 2
         inwards = merge(1.0_wp, -1.0_wp, side == 1)
         x = inwards*values
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

end module prior_limits
