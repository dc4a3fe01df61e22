!> Working precision and the few constants that every module shares.
module kinds
   use, intrinsic :: iso_fortran_env, only: int64, real64
   implicit none
   private
   public :: wp, i8, pi, degree, nan

   integer, parameter :: wp = real64, i8 = int64
   !> Pi, and one degree in radians.
   real(wp), parameter :: pi = 3.141592653589793238462643383279503_wp, degree = pi/180.0_wp
   !> Quiet NaN, for values that are not known. (The function of the intrinsic module would save the
   !> state of the processor at each call.)
   real(wp), parameter :: nan = transfer(int(z'7FF8000000000000', i8), 1.0_wp)
end module kinds
