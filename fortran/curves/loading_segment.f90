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
      !> What was taken from the load: its mean before the contact, mN.
      real(wp) :: load_zero = 0.0_wp
      !> Why there is none; empty: there is one.
      character(len=:), allocatable :: refusal
   end type segment_type

   !> Shares of the peak load where the contact begins to count and where loading ends.
   real(wp), parameter :: first_share = 0.004_wp, last_share = 0.995_wp
   !> Points are averaged in blocks until there are no more.
   integer, parameter :: most_points = 400, fewest_points = 12

contains

   !> Cut a curve. Loads before the contact give their zero.
   subroutine take_loading(time, depth, load, stiffness, segment)
      !> s, nm, mN and mN/um, (point); the last may be empty.
      real(wp), intent(in) :: time(:), depth(:), load(:), stiffness(:)
      type(segment_type), intent(out) :: segment
      !> As many points before the contact give a zero.
      integer, parameter :: few = 10
      real(wp) :: peak
      integer :: first, last, block, n

      segment%refusal = ''
      peak = maxval(load)
      last = findloc(load >= last_share*peak, .true., 1)
      first = findloc(load(:last) < first_share*peak, .true., 1, back=.true.) + 1
      if (.not. peak > 0.0_wp) then
         segment%refusal = 'no load is above zero'
         return
      end if
      associate (air => pack(load(:first - 1), load(:first - 1) < first_share*peak))
         if (size(air) > few) segment%load_zero = median(size(air), air)
      end associate
      if (last - first < fewest_points) then
         segment%refusal = 'only '//to_text(last - first)//' points from contact to peak load; 12 are needed'
         return
      end if
      block = 1 + (last - first - 1)/most_points
      n = (last - first)/block
      segment%time = averaged(time)
      segment%depth = averaged(depth)
      segment%load = averaged(load) - segment%load_zero
      segment%stiffness = stiffness(:min(0, size(stiffness)))
      if (size(stiffness) > 0) segment%stiffness = averaged(stiffness)
      associate (kept => segment%load > first_share*peak)
         segment%time = pack(segment%time - segment%time(1), kept)
         segment%depth = pack(segment%depth, kept)
         if (size(stiffness) > 0) segment%stiffness = pack(segment%stiffness, kept)
         segment%load = pack(segment%load, kept)
      end associate
      if (size(segment%load) < fewest_points) segment%refusal = 'only '//to_text(size(segment%load)) &
         & //' points from contact to peak load; 12 are needed'

   contains

      !> Means of blocks of the points of loading.
      function averaged(values) result(means)
         real(wp), intent(in) :: values(:)
         real(wp) :: means(n)

         means = sum(reshape(values(first:first + n*block - 1), [block, n]), 1)/block
      end function averaged
   end subroutine take_loading
end module loading_segment
