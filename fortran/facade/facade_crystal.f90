! The flat procedures that f2py wraps: explicit shapes, literal kinds, no derived types, `threadsafe` on each.
! status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success. The Python module `core` raises it.

!> Stiffness matrices (GPa, crystal frame) of n crystals from their independent constants.
subroutine crystal_stiffness(symmetry, k, n, constants, stiffness)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_elasticity, only: new_stiffness
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: symmetry, k, n
   real(c_double), intent(in) :: constants(k, n)
   real(c_double), intent(out) :: stiffness(6, 6, n)
   integer :: i

   do i = 1, n
      stiffness(:, :, i) = new_stiffness(symmetry, constants(:, i))
   end do
end subroutine crystal_stiffness

!> Anisotropy index (Eq. 14) of n cubic or hexagonal crystals, and 1 where the crystal is Born-stable, else 0.
subroutine crystal_anisotropy(symmetry, k, n, constants, index, stable)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_elasticity, only: anisotropy_index, is_stable, new_stiffness
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: symmetry, k, n
   real(c_double), intent(in) :: constants(k, n)
   real(c_double), intent(out) :: index(n)
   integer(c_int), intent(out) :: stable(n)
   integer :: i

   do i = 1, n
      index(i) = anisotropy_index(symmetry, constants(:, i))
      stable(i) = merge(1, 0, is_stable(new_stiffness(symmetry, constants(:, i))))
   end do
end subroutine crystal_anisotropy

!> Exact and circular-contact indentation moduli (GPa) of n crystals (GPa) at n orientations (radians), on `threads` threads.
subroutine theory_moduli(n, stiffness, euler, threads, modulus, circular, status, message)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use text, only: to_text
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: n, threads
   real(c_double), intent(in) :: stiffness(6, 6, n), euler(3, n)
   real(c_double), intent(out) :: modulus(n), circular(n)
   integer(c_int), intent(out) :: status
   character(len=512), intent(out) :: message
   type(halfspace_type) :: result
   type(error_type), allocatable :: error
   integer :: i, first

   status = 0
   message = ''
   first = n + 1
   !$omp parallel do num_threads(threads) schedule(dynamic, 16) private(result, error)
   do i = 1, n
      call halfspace_modulus(stiffness(:, :, i), euler(:, i), result, error)
      if (allocated(error)) then
         !$omp critical (theory_moduli_error)
         if (i < first) then
            first = i
            status = error%status
            message = 'crystal '//to_text(i)//': '//error%message
         end if
         !$omp end critical (theory_moduli_error)
      else
         modulus(i) = result%modulus
         circular(i) = result%modulus_circular
      end if
   end do
   !$omp end parallel do
end subroutine theory_moduli
