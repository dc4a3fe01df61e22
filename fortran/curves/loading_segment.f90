!> The part of a curve that is scored: its first loading, from the contact to the peak of the load.
module loading_segment
   use kinds, only: wp
   use statistics, only: median
   use text, only: to_text
   implicit none
   private
   public :: segment_type, take_loading

   type :: segment_type
      !> s, nm, mN, and, where the curve has it, mN/um; (point).
      real(wp), allocatable :: time(:), depth(:), load(:), stiffness(:)
      !> Why there is none; empty: there is one.
      character(len=:), allocatable :: refusal
   end type segment_type

   !> Shares of the peak load where the contact begins to count and where loading ends.
   real(wp), parameter :: first_share = 0.004_wp, last_share = 0.995_wp
   !> Points are averaged in blocks until there are no more.
   integer, parameter :: most_points = 400, fewest_points = 12

contains

   !> Cut a curve. Loads before the contact give their zero.
   subroutine take_loading(points, drift, segment)
      !> s, nm, mN, and perhaps N/m; (quantity, point). What is still in the depth, nm/s.
      real(wp), intent(in) :: points(:, :), drift
      type(segment_type), intent(out) :: segment
      !> As many points before the contact give a zero.
      integer, parameter :: few = 10
      real(wp), allocatable :: means(:, :), air(:)
      real(wp) :: peak
      integer :: first, last, block, n, i

      segment%refusal = ''
      associate (load => points(3, :))
         peak = maxval(load)
         if (.not. peak > 0.0_wp) segment%refusal = 'no load is above zero'
         if (len(segment%refusal) > 0) return
         last = findloc(load >= last_share*peak, .true., 1)
         first = findloc(load(:last) < first_share*peak, .true., 1, back=.true.) + 1
         block = 1 + max(0, last - first - 1)/most_points
         n = (last - first)/block
         air = pack(load(:first - 1), load(:first - 1) < first_share*peak)
      end associate
      means = sum(reshape(points(:, first:first + n*block - 1), [size(points, 1), block, n]), &
         & 2)/block
      if (size(air) > few) means(3, :) = means(3, :) - median(size(air), air)
      ! A contact stiffness that is not positive is none.
      means = means(:, &
         & pack([(i, i=1, n)], means(3, :) > first_share*peak .and. all(means(4:, :) > 0.0_wp, 1)))
      n = size(means, 2)
      if (n < fewest_points) then
         segment%refusal = 'only '//to_text(n)//' points from contact to peak load; 12 are needed'
      end if
      if (len(segment%refusal) > 0) return
      segment%time = means(1, :) - means(1, 1)
      segment%depth = means(2, :) - drift*segment%time
      segment%load = means(3, :)
      segment%stiffness = 1.0e-3_wp*pack(means(4:, :), .true.)
   end subroutine take_loading
end module loading_segment
