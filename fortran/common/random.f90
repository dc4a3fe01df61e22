!> Reproducible random streams: xoshiro256++ (Blackman & Vigna, ACM TOMS 47, 36, 2021), seeded by
!> SplitMix64.
!>
!> A stream is a function of (seed, stream) alone, so that chain k draws the same numbers whatever
!> thread runs it. The arithmetic wraps modulo 2^64; the build passes -fwrapv.
module random
   use kinds, only: wp, i8
   implicit none
   private
   public :: random_stream_type, new_random_stream

   !> 2^64 divided by the golden ratio, made odd: z'9E3779B97F4A7C15'.
   integer(i8), parameter :: golden = -7046029254386353131_i8

   type :: random_stream_type
      private
      integer(i8) :: s(4) = 0_i8
      logical :: has_spare = .false.
      real(wp) :: spare = 0.0_wp
   contains
      !> `uniform` draws from the open interval (0, 1).
      procedure :: uniform
      !> `normal` draws a standard normal number (polar method).
      procedure :: normal
      !> `normals` fills an array with standard normal numbers.
      procedure :: normals
      !> `pick` draws an integer from 1..n.
      procedure :: pick
   end type random_stream_type

contains

   !> The stream number `stream` of `seed`; different pairs give unrelated streams.
   pure type(random_stream_type) function new_random_stream(seed, stream) result(self)
      integer, intent(in) :: seed, stream
      integer(i8) :: state
      integer :: i

      state = mixed(ieor(int(seed, i8), ishft(int(stream, i8), 32)) + golden)
      do i = 1, 4
         state = state + golden
         self%s(i) = mixed(state)
      end do
   end function new_random_stream

   pure integer(i8) function mixed(state)
      integer(i8), intent(in) :: state
      integer(i8) :: z

      z = ieor(state, ishft(state, -30))*ior(ishft(int(z'BF58476D', i8), 32), int(z'1CE4E5B9', i8))
      z = ieor(z, ishft(z, -27))*ior(ishft(int(z'94D049BB', i8), 32), int(z'133111EB', i8))
      mixed = ieor(z, ishft(z, -31))
   end function mixed

   pure subroutine advance(self, bits)
      class(random_stream_type), intent(inout) :: self
      integer(i8), intent(out) :: bits
      integer(i8) :: t

      bits = ishftc(self%s(1) + self%s(4), 23) + self%s(1)
      t = ishft(self%s(2), 17)
      self%s(3) = ieor(self%s(3), self%s(1))
      self%s(4) = ieor(self%s(4), self%s(2))
      self%s(2) = ieor(self%s(2), self%s(3))
      self%s(1) = ieor(self%s(1), self%s(4))
      self%s(3) = ieor(self%s(3), t)
      self%s(4) = ishftc(self%s(4), 45)
   end subroutine advance

   !> Draw `u`, uniform on the open interval (0, 1).
   subroutine uniform(self, u)
      class(random_stream_type), intent(inout) :: self
      real(wp), intent(out) :: u
      integer(i8) :: bits

      call advance(self, bits)
      u = (real(ishft(bits, -11), wp) + 0.5_wp)*2.0_wp**(-53)
   end subroutine uniform

   !> Draw `z`, standard normal (Marsaglia's polar method, which gives two numbers at a time).
   subroutine normal(self, z)
      class(random_stream_type), intent(inout) :: self
      real(wp), intent(out) :: z
      real(wp) :: u, v, r

      if (self%has_spare) then
         z = self%spare
         self%has_spare = .false.
         return
      end if
      do
         call self%uniform(u)
         call self%uniform(v)
         u = 2.0_wp*u - 1.0_wp
         v = 2.0_wp*v - 1.0_wp
         r = u*u + v*v
         if (r < 1.0_wp) exit
      end do
      r = sqrt(-2.0_wp*log(r)/r)
      z = u*r
      self%spare = v*r
      self%has_spare = .true.
   end subroutine normal

   !> Draw each element of `z` from the standard normal distribution, in order.
   subroutine normals(self, z)
      class(random_stream_type), intent(inout) :: self
      real(wp), intent(out) :: z(:)
      integer :: i

      do i = 1, size(z)
         call self%normal(z(i))
      end do
   end subroutine normals

   !> Draw `k`, uniform on the integers 1..n.
   subroutine pick(self, n, k)
      class(random_stream_type), intent(inout) :: self
      integer, intent(in) :: n
      integer, intent(out) :: k
      real(wp) :: u

      call self%uniform(u)
      k = min(n, 1 + int(u*n))
   end subroutine pick
end module random
