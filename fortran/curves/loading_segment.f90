!> The part of a curve that is evaluated: its first loading, from the contact to the peak load.
module loading_segment
   use kinds, only: wp
   use statistics, only: median
   use text, only: to_text
   implicit none
   private
   public :: segment_type, take_loading

   type :: segment_type
      !> Time, s, depth, nm, load, mN, and, if the curve has it, contact stiffness, mN/um; (point).
      real(wp), allocatable :: time(:), depth(:), load(:), stiffness(:)
      !> Why the segment cannot be used; empty if it can.
      character(len=:), allocatable :: refusal
   end type segment_type

   !> Loads at which the contact begins and at which loading ends, as shares of the peak load.
   real(wp), parameter :: first_share = 0.004_wp, last_share = 0.995_wp
   !> Points are averaged in blocks if there are more than this; fewer points than the second number
   !> are refused.
   integer, parameter :: most_points = 400, fewest_points = 12

contains

   !> Cut the loading segment out of a curve. The loads before the contact define the zero of the
   !> load.
   subroutine take_loading(points, drift, segment)
      !> Time, s, depth, nm, load, mN, and perhaps stiffness, N/m; (quantity, point). Drift that is
      !> subtracted from the depth, nm/s.
      real(wp), intent(in) :: points(:, :), drift
      type(segment_type), intent(out) :: segment
      !> Fewest points before the contact that define the zero of the load.
      integer, parameter :: fewest_for_zero = 10
      !> Least depth of an approach relative to that of the curve. At the preload of a contact the
      !> depth hardly grows before the load does.
      real(wp), parameter :: least_approach = 0.05_wp
      real(wp), allocatable :: means(:, :), loads_before(:)
      real(wp) :: peak, zero
      integer :: first, last, block, n, i

      segment%refusal = ''
      associate (load => points(3, :))
         peak = maxval(load)
         if (.not. peak > 0.0_wp) then
            segment%refusal = 'no load is above zero'
            return
         end if
         last = findloc(load >= last_share*peak, .true., 1)
         ! The first loads are about the zero if the depth grows without them: in an approach.
         n = min(last, fewest_for_zero)
         loads_before = load(:n)
         zero = median(n, loads_before)
         first = contact_at(zero)
         associate (depth => points(2, :))
            if (maxval(abs(load(:first - 1) - zero)) > 2.0_wp*first_share*peak .or. &
               & depth(min(first, last)) - depth(1) <= least_approach*(depth(last) - depth(1))) then
               zero = 0.0_wp
            end if
         end associate
         first = contact_at(zero)
         block = 1 + max(0, last - first - 1)/most_points
         n = (last - first)/block
         loads_before = pack(load(:first - 1), load(:first - 1) - zero < first_share*peak)
      end associate
      means = sum(reshape(points(:, first:first + n*block - 1), [size(points, 1), block, n]), &
         & 2)/block
      if (size(loads_before) > fewest_for_zero) then
         means(3, :) = means(3, :) - median(size(loads_before), loads_before)
      end if
      ! Points without a positive contact stiffness are removed.
      means = means(:, &
         & pack([(i, i=1, n)], means(3, :) > first_share*peak .and. all(means(4:, :) > 0.0_wp, 1)))
      n = size(means, 2)
      if (n < fewest_points) then
         segment%refusal = 'only '//to_text(n)//' points from contact to peak load; 12 are needed'
         return
      end if
      segment%time = means(1, :) - means(1, 1)
      segment%depth = means(2, :) - drift*segment%time
      segment%load = means(3, :)
      segment%stiffness = 1.0e-3_wp*pack(means(4:, :), .true.)

   contains

      !> Number of the first point after which the loads are above a zero.
      integer function contact_at(zero)
         real(wp), intent(in) :: zero

         contact_at = 1 + findloc(points(3, :last) - zero < first_share*peak, .true., 1, &
            & back=.true.)
      end function contact_at
   end subroutine take_loading
end module loading_segment
