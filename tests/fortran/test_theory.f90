!> The half-space theory read from a field, and the coordinates of Step 2.
program test_theory
   use compliance_field, only: field_moduli, field_type, new_field
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: log_anisotropy, is_stable
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type
   use kinds, only: pi, wp
   use logarithmic_coordinates, only: log_coordinates_type, new_log_coordinates
   use random, only: new_random_stream, random_stream_type
   use testing, only: check, check_close, check_success, finish
   implicit none

   character(len=12), parameter :: classes(10) = [character(len=12) :: 'isotropic', 'cubic', 'hexagonal', 'tetragonal', '4/m', &
      & 'trigonal', '-3', 'orthorhombic', 'monoclinic', 'triclinic']
   integer :: k

   do k = 1, size(classes)
      call test_coordinates(trim(classes(k)))
      call test_field(trim(classes(k)))
   end do
   call finish()

contains

   !> A crystal of a class near steel's stiffness, of log-anisotropy about 0.8.
   subroutine make_crystal(class, stream, w, c)
      type(crystal_class_type), intent(in) :: class
      type(random_stream_type), intent(inout) :: stream
      real(wp), allocatable, intent(out) :: w(:)
      real(wp), intent(out) :: c(6, 6)
      type(log_coordinates_type) :: coordinates
      real(wp) :: log_volume
      integer :: j

      coordinates = new_log_coordinates(class)
      allocate (w(class%n_constants))
      do j = 1, size(w)
         call stream%normal(w(j))
      end do
      if (size(w) > 2) w(3:) = 0.8_wp*w(3:)/norm2(w(3:))
      w(1) = log(500.0_wp) + 0.1_wp*w(1)
      w(2) = sqrt(5.0_wp)*log(160.0_wp) + 0.1_wp*w(2)
      call coordinates%from_logarithms(w, c, log_volume)
   end subroutine make_crystal

   !> There and back, the norm that is the log-anisotropy, and the volume against the determinant of differences.
   subroutine test_coordinates(name)
      character(len=*), intent(in) :: name
      type(crystal_class_type) :: class
      type(log_coordinates_type) :: coordinates
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: w(:), shifted(:), jacobian(:, :)
      real(wp) :: c(6, 6), up(6, 6), down(6, 6), volume(2), unused, found(2)
      real(wp), parameter :: step = 1.0e-5_wp
      integer :: i, j

      call new_crystal_class(name, class, error)
      call check_success(name, error)
      coordinates = new_log_coordinates(class)
      call check(name//': as many coordinates as constants', coordinates%n == class%n_constants)
      stream = new_random_stream(3, 0)
      do i = 1, 2
         call make_crystal(class, stream, w, c)
         call check(name//': stable', is_stable(c))
         call check(name//': there and back', maxval(abs(coordinates%to_logarithms(c) - w)) < 1.0e-9_wp)
         call check(name//': of the class', maxval(abs(class%stiffness(class%constants_of(c)) - c)) < 1.0e-9_wp)
         call check_close(name//': the norm is the log-anisotropy', norm2(w(3:)), log_anisotropy(c), 1.0e-6_wp)
         call coordinates%from_logarithms(w, c, volume(i))
         if (allocated(jacobian)) deallocate (jacobian)
         allocate (jacobian(size(w), size(w)))
         do j = 1, size(w)
            shifted = w
            shifted(j) = w(j) + step
            call coordinates%from_logarithms(shifted, up, unused)
            shifted(j) = w(j) - step
            call coordinates%from_logarithms(shifted, down, unused)
            jacobian(:, j) = (class%constants_of(up) - class%constants_of(down))/(2.0_wp*step)
         end do
         found(i) = log_determinant(jacobian)
      end do
      ! Differences of second order: errors of step^2 in each of up to 21 columns.
      call check_close(name//': the volume, up to a constant', volume(2) - volume(1), found(2) - found(1), 1.0e-7_wp)
   end subroutine test_coordinates

   !> log |det a| by elimination.
   real(wp) function log_determinant(a)
      real(wp), intent(in) :: a(:, :)
      real(wp) :: rest(size(a, 1), size(a, 1)), row(size(a, 1))
      integer :: i, pivot

      rest = a
      log_determinant = 0.0_wp
      do i = 1, size(a, 1)
         pivot = i - 1 + maxloc(abs(rest(i:, i)), dim=1)
         row = rest(pivot, :)
         rest(pivot, :) = rest(i, :)
         rest(i, :) = row
         log_determinant = log_determinant + log(abs(row(i)))
         rest(i + 1:, :) = rest(i + 1:, :) - spread(rest(i + 1:, i)/row(i), 2, size(row))*spread(row, 1, size(row) - i)
      end do
   end function log_determinant

   !> Moduli of random directions against the quadrature: the error falls with the degree, and is small where Step 2 wants it.
   subroutine test_field(name)
      character(len=*), intent(in) :: name
      integer, parameter :: n = 15, degrees(3) = [8, 12, 16]
      real(wp), parameter :: allowed(3) = [8.0e-3_wp, 2.0e-3_wp, 5.0e-4_wp]
      type(crystal_class_type) :: class
      type(field_type) :: field
      type(halfspace_type) :: exact(n)
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: w(:)
      real(wp) :: c(6, 6), euler(3, n), moduli(n), largest(3), u
      integer :: i, j

      call new_crystal_class(name, class, error)
      stream = new_random_stream(5, 0)
      call make_crystal(class, stream, w, c)
      do i = 1, n
         do j = 1, 3
            call stream%uniform(u)
            euler(j, i) = 2.0_wp*pi*u
         end do
         euler(2, i) = acos(1.0_wp - euler(2, i)/pi)
         call halfspace_modulus(c, euler(:, i), exact(i), error)
      end do
      do j = 1, 3
         call new_field(class, degrees(j), euler, field, error)
         call check_success(name//': a field', error)
         call field_moduli(field, c, moduli)
         largest(j) = maxval(abs(moduli/exact%modulus - 1.0_wp))
      end do
      call check(name//': moduli', all(largest < allowed))
      call check(name//': better with every degree', all(largest(2:) < 0.5_wp*largest(:2) .or. largest(2:) < 1.0e-7_wp))
   end subroutine test_field
end program test_theory
