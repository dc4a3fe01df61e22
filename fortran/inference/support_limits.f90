!> The limits of the support of a posterior, stated ones and those of the surrogate's domain, each in the coordinate that it limits; and
!> where the draws end at one.
module support_limits
   use constants_prior, only: least_width, prior_type, relative_width
   use crystal_elasticity, only: anisotropy_index, logarithmic_mean
   use kinds, only: wp
   implicit none
   private
   public :: limit_type, list_limits, no_limit

   !> What is not within is no limit.
   real(wp), parameter :: no_limit = 1.0e6_wp

   type :: limit_type
      !> A constant or 'anisotropy_cap' of &prior; or of the surrogate's domain, 'domain.C11' or the variables of &domain.
      character(len=26) :: name = ''
      !> By the user: a posterior that ends there is what was asked for.
      logical :: stated = .false.
      !> The lower and the upper, in the unit of the coordinate.
      real(wp) :: range(2) = [-no_limit, no_limit]
      !> The coordinate, (draw).
      real(wp), allocatable :: values(:)
      !> Whether the draws end at it, and the share of the draws in the outermost twentieth of their range, at each side.
      logical :: ends(2) = .false.
      real(wp) :: share(2) = 0.0_wp
   end type limit_type

contains

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
      associate (domain => prior%basis%domain)
         do j = 1, prior%n_constants
            call add(prior%class%constants(j), .true., [prior%lower(j), prior%upper(j)], draws(j, :))
            if (size(domain%lower) > 0) call add('domain.'//prior%class%constants(j), .false., &
               & [merge(domain%lower(j), -no_limit, domain%lower(j) > prior%lower(j)), &
               & merge(domain%upper(j), no_limit, domain%upper(j) < prior%upper(j))], draws(j, :))
         end do
         call add('anisotropy_cap', .true., [-no_limit, prior%anisotropy_cap], index)
         if (domain%anisotropy_cap < prior%anisotropy_cap) call add('domain.anisotropy_cap', .false., &
            & [-no_limit, domain%anisotropy_cap], index)
         if (size(domain%lower) == 0 .and. domain%log_anisotropy_max < no_limit) then
            call add('domain.log_anisotropy_max', .false., [-no_limit, domain%log_anisotropy_max], means(2, :))
            call add('domain.poisson', .false., domain%poisson, means(1, :))
            if (domain%has_scale()) call add('domain.stiffness_gpa', .false., domain%stiffness, means(3, :))
         end if
      end associate

   contains

      subroutine add(name, stated, range, values)
         character(len=*), intent(in) :: name
         logical, intent(in) :: stated
         real(wp), intent(in) :: range(2), values(:)
         type(limit_type) :: one

         ! No limits, or bounds that fix a constant, where every draw is at both.
         if (all(abs(range) >= no_limit) .or. range(2) - range(1) < 2.1_wp*max(least_width, relative_width*abs(range(1)))) return
         one = limit_type(name, stated, range)
         ! In the constructor gfortran 12 ignores the stride of a section.
         one%values = values
         call find_end(one, 1)
         call find_end(one, 2)
         limits = [limits, one]
      end subroutine add
   end function list_limits

   !> Whether the draws end at the lower (1) or the upper (2) limit: in the outermost of twenty equal parts of their range, which
   !> reaches the limit, their density has not fallen to a third of its maximum.
   subroutine find_end(limit, side)
      type(limit_type), intent(inout) :: limit
      integer, intent(in) :: side
      integer, parameter :: parts = 20
      real(wp), parameter :: fallen = 1.0_wp/3.0_wp
      integer :: counts(parts), i, k
      real(wp) :: low, width, gap

      low = minval(limit%values)
      width = (maxval(limit%values) - low)/parts
      if (abs(limit%range(side)) >= no_limit .or. .not. width > 0.0_wp) return
      counts = 0
      do i = 1, size(limit%values)
         k = min(parts, 1 + int((limit%values(i) - low)/width))
         counts(k) = counts(k) + 1
      end do
      if (side == 1) then
         gap = low - limit%range(1)
         k = counts(1)
      else
         gap = limit%range(2) - maxval(limit%values)
         k = counts(parts)
      end if
      limit%share(side) = real(k, wp)/size(limit%values)
      limit%ends(side) = gap < width .and. k > fallen*maxval(counts)
   end subroutine find_end
end module support_limits
