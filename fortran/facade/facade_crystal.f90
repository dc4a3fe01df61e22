! status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success. The Python module `core` raises it.

!> A crystal class by `symmetry`, a name or synonym: its name, the count of its constants, and their names, three characters each.
subroutine crystal_class_of(symmetry, name, count, constants, status, message)
   use crystal_class, only: crystal_class_type, new_crystal_class
   use interoperation, only: c_int, error_to_status, error_type
   implicit none
   character(len=*), intent(in) :: symmetry
   character(len=12), intent(out) :: name
   integer(c_int), intent(out) :: count
   character(len=63), intent(out) :: constants
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error
   integer :: i

   name = ''
   count = 0
   constants = ''
   call new_crystal_class(symmetry, class, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   name = class%name
   count = class%n_constants
   do i = 1, count
      constants(3*i - 2:3*i) = class%constants(i)
   end do
end subroutine crystal_class_of

!> Stiffness matrices (GPa, crystal frame) of n crystals of one `symmetry` from their k constants (GPa).
subroutine crystal_stiffness(symmetry, k, n, constants, stiffness, status, message)
   use crystal_class, only: crystal_class_type, new_crystal_class
   use interoperation, only: c_double, c_int, error_to_status, error_type
   implicit none
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: k, n
   real(c_double), intent(in) :: constants(k, n)
   real(c_double), intent(out) :: stiffness(6, 6, n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(crystal_class_type) :: class
   type(error_type), allocatable :: error
   integer :: i

   stiffness = 0
   call new_crystal_class(symmetry, class, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   do i = 1, n
      stiffness(:, :, i) = class%stiffness(constants(:, i))
   end do
end subroutine crystal_stiffness

!> Of n stiffness matrices (GPa): anisotropy index (Eq. 14) and log_index, the log-anisotropy, NaN where the crystal is not
!> Born-stable, and averages: Voigt's bulk and shear modulus, then Reuss's (GPa).
subroutine crystal_averages(n, stiffness, index, log_index, averages)
   use, intrinsic :: iso_c_binding, only: c_double, c_int
   use crystal_elasticity, only: anisotropy_index, averages_type, log_anisotropy, polycrystal_averages
   implicit none
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: stiffness(6, 6, n)
   real(c_double), intent(out) :: index(n), log_index(n), averages(4, n)
   type(averages_type) :: found
   integer :: i

   do i = 1, n
      index(i) = anisotropy_index(stiffness(:, :, i))
      log_index(i) = log_anisotropy(stiffness(:, :, i))
      found = polycrystal_averages(stiffness(:, :, i))
      averages(:, i) = [found%bulk_voigt, found%shear_voigt, found%bulk_reuss, found%shear_reuss]
   end do
end subroutine crystal_averages

!> Directions over the region of a valid symmetry, (3, count) of which the first `most` are given: with spread > 0 so many that are
!> far apart, else an even lattice.
subroutine region_directions(symmetry, spread, most, count, directions)
   use crystal_class, only: crystal_class_type, new_crystal_class
   use distinct_directions, only: lattice_of_directions, new_region, region_type, spread_of_directions
   use interoperation, only: c_double, c_int, error_type
   use kinds, only: wp
   implicit none
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: spread, most
   integer(c_int), intent(out) :: count
   real(c_double), intent(out) :: directions(3, most)
   type(crystal_class_type) :: class
   type(region_type) :: region
   type(error_type), allocatable :: error
   real(wp), allocatable :: found(:, :)

   call new_crystal_class(symmetry, class, error)
   call new_region(class, region)
   if (spread > 0) then
      call spread_of_directions(region, spread, found)
   else
      call lattice_of_directions(region, found)
   end if
   count = size(found, 2)
   directions = 0
   directions(:, :min(most, count)) = found(:, :min(most, count))
end subroutine region_directions

!> Of n directions, unit vectors in crystal axes, the images in the region that a crystal of a valid symmetry cannot tell from them;
!> alike: 1 if one of them has all others within `angle` (radians), else 0.
subroutine region_representatives(symmetry, n, directions, angle, images, alike)
   use crystal_class, only: crystal_class_type, new_crystal_class
   use distinct_directions, only: all_alike, new_region, region_type, representative
   use interoperation, only: c_double, c_int, error_type
   implicit none
   character(len=*), intent(in) :: symmetry
   integer(c_int), intent(in) :: n
   real(c_double), intent(in) :: directions(3, n), angle
   real(c_double), intent(out) :: images(3, n)
   integer(c_int), intent(out) :: alike
   type(crystal_class_type) :: class
   type(region_type) :: region
   type(error_type), allocatable :: error
   integer :: i

   call new_crystal_class(symmetry, class, error)
   call new_region(class, region)
   do i = 1, n
      images(:, i) = representative(region, directions(:, i))
   end do
   alike = merge(1, 0, all_alike(region, directions, angle))
end subroutine region_representatives

!> Indentation modulus (GPa), exact and of a circular contact, of n crystals of given stiffness (GPa) at n Euler angles `euler`
!> (radians), on `threads` threads.
subroutine theory_moduli(n, stiffness, euler, threads, modulus, circular, status, message)
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use interoperation, only: c_double, c_int, error_type
   use parallelism, only: thread_count
   use text, only: to_text
   implicit none
   !f2py threadsafe
   integer(c_int), intent(in) :: n, threads
   real(c_double), intent(in) :: stiffness(6, 6, n), euler(3, n)
   real(c_double), intent(out) :: modulus(n), circular(n)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(halfspace_type) :: result
   type(error_type), allocatable :: error
   integer :: i, first

   status = 0
   message = ''
   first = n + 1
   !$omp parallel do num_threads(thread_count(threads)) schedule(dynamic, 16) private(result, error)
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
