!> The half-space theory, in full and read from a field, and the coordinates of Step 2.
program test_halfspace_theory
   use compliance_field, only: field_moduli, field_type, new_field
   use crystal_class, only: crystal_class_type, new_crystal_class
   use crystal_elasticity, only: anisotropy_index, is_stable, log_anisotropy, voigt_index
   use errors, only: error_type
   use halfspace_theory, only: halfspace_modulus, halfspace_type, inverse_barnett, lanes
   use observables, only: path_type, surface_path
   use kinds, only: pi, wp
   use logarithmic_coordinates, only: log_coordinates_type, new_log_coordinates
   use rayleigh_wave, only: rayleigh_waves, surface_type, surface_waves, new_surface, &
      & wave_speed, wave_type
   use random, only: new_random_stream, random_stream_type
   use testing, only: check, check_close, check_success, finish
   implicit none

   character(len=12), &
      & parameter :: classes(10) = [character(len=12) :: 'isotropic', 'cubic', 'hexagonal', &
      & 'tetragonal', '4/m', 'trigonal', '-3', 'orthorhombic', 'monoclinic', 'triclinic']
   integer :: k

   do k = 1, size(classes)
      call test_coordinates(trim(classes(k)))
      call test_field(trim(classes(k)))
   end do
   call test_doubling()
   call test_hexagonal_axis()
   call test_turn_about_normal()
   call test_isotropic_wave()
   call test_silicon_wave()
   call finish()

contains

   !> Rayleigh's cubic for v^2 over that of shear waves, and the displacement of its root, in any
   !> orientation.
   subroutine test_isotropic_wave()
      real(wp), parameter :: shear = 80.0_wp, longitudinal(3) = shear*[1.6_wp, 3.5_wp, 30.0_wp]
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error
      type(wave_type) :: waves(3)
      real(wp) :: c(6, 6, 3), low, high, x, a, b
      integer :: i, step

      call new_crystal_class('isotropic', class, error)
      do i = 1, 3
         c(:, :, i) = class%stiffness([longitudinal(i), longitudinal(i) - 2.0_wp*shear])
      end do
      call rayleigh_waves(c, reshape([0.0_wp, 0.0_wp, 0.0_wp, 10.0_wp, 50.0_wp, 70.0_wp, 200.0_wp, &
         & 90.0_wp, 5.0_wp], [3, 3]), [path_type(surface_path), path_type(surface_path, 33.0_wp), &
         & path_type(surface_path, 90.0_wp)], waves, error)
      call check_success('waves of isotropic solids', error)
      do i = 1, 3
         low = 0.0_wp
         high = 1.0_wp
         do step = 1, 60
            x = 0.5_wp*(low + high)
            if (rayleigh_cubic(x, shear/longitudinal(i)) < 0.0_wp) low = x
            if (rayleigh_cubic(x, shear/longitudinal(i)) >= 0.0_wp) high = x
         end do
         call check_close('Rayleigh''s speed', waves(i)%modulus, shear*x, 1.0e-9_wp)
         call check_close('the shear wave', waves(i)%bulk, shear, 1.0e-7_wp*shear)
         ! |u_z/u_x|^2 = sqrt((1 - x k)/(1 - x)).
         a = sqrt(1.0_wp - x*shear/longitudinal(i))
         b = sqrt(1.0_wp - x)
         call check_close('the normal displacement', waves(i)%normal_share, a/(a + b), 1.0e-7_wp)
         call check('it is detected', waves(i)%is_detected())
      end do
   end subroutine test_isotropic_wave

   !> x^3 - 8 x^2 + (24 - 16 k) x - 16 (1 - k).
   pure real(wp) function rayleigh_cubic(x, k)
      real(wp), intent(in) :: x, k

      rayleigh_cubic = x**3 - 8.0_wp*x**2 + (24.0_wp - 16.0_wp*k)*x - 16.0_wp*(1.0_wp - k)
   end function rayleigh_cubic

   !> Silicon (001)[100] by Stoneley's secular equation of a symmetric cut, and many directions at
   !> once as one by one.
   subroutine test_silicon_wave()
      real(wp), parameter :: c11 = 165.7_wp, c12 = 63.9_wp, c44 = 79.6_wp
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error
      type(surface_type) :: surface
      type(wave_type) :: wave(1), waves(11), one(1)
      type(path_type) :: paths(11)
      real(wp) :: euler(3, 11), low, high, x
      integer :: i

      call new_crystal_class('cubic', class, error)
      associate (c => class%stiffness([c11, c12, c44]))
         call rayleigh_waves(reshape(c, [6, 6, 1]), reshape([0.0_wp, 0.0_wp, 0.0_wp], [3, 1]), &
            & [path_type(surface_path)], wave, error)
         low = 0.0_wp
         high = c44
         do i = 1, 60
            x = 0.5_wp*(low + high)
            if (c11*c44*x**2*(c11 - x) < (c44 - x)*(c11*(c11 - x) - c12**2)**2) then
               low = x
            else
               high = x
            end if
         end do
         call check_close('Stoneley''s secular equation', wave(1)%modulus, x, 1.0e-9_wp)
         call check_close('silicon (001)[100], literature 4921 m/s', &
            & wave_speed(wave(1)%modulus, 2330.0_wp), 4919.0_wp, 3.0_wp)
         euler = reshape([(0.7_wp*i, i=1, 33)], [3, 11])
         paths = [(path_type(surface_path, 20.0_wp*i), i=1, 11)]
         call new_surface(euler, paths, surface)
         call surface_waves(surface, reshape(c, [6, 6, 1]), waves)
         do i = 1, 11
            call new_surface(euler(:, i:i), paths(i:i), surface)
            call surface_waves(surface, reshape(c, [6, 6, 1]), one)
            call check_close('a direction alone', waves(i)%modulus, one(1)%modulus, 1.0e-12_wp)
         end do
      end associate
   end subroutine test_silicon_wave

   !> Doubled angles against the trapezoid rule written out, for directions of a crystal without
   !> symmetry.
   subroutine test_doubling()
      integer, parameter :: n_angles = 512
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: w(:)
      real(wp) :: c(6, 6), t(3), first(3), second(3), b(3, 3), m(3), n(3), expected(3, 3), phi
      real(wp) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6), f(lanes, 6), product(3, 3)
      integer :: lane, i, j

      call new_crystal_class('triclinic', class, error)
      stream = new_random_stream(7, 0)
      call make_crystal(class, stream, w, c)
      do lane = 1, lanes
         do i = 1, 3
            call stream%normal(t(i))
            call stream%normal(first(i))
         end do
         t = t/norm2(t)
         first = first - dot_product(first, t)*t
         first = first/norm2(first)
         second = [t(2)*first(3) - t(3)*first(2), t(3)*first(1) - t(1)*first(3), &
            & t(1)*first(2) - t(2)*first(1)]
         mm(lane, :) = components(contraction(c, first, first))
         mn(lane, :) = reshape(contraction(c, first, second), [9])
         nn(lane, :) = components(contraction(c, second, second))
      end do
      call inverse_barnett(mm, mn, nn, f)
      ! Of the last direction, whose axes are still there.
      b = 0.0_wp
      do i = 1, n_angles
         phi = 2.0_wp*pi*i/n_angles
         m = cos(phi)*first + sin(phi)*second
         n = cos(phi)*second - sin(phi)*first
         product = contraction(c, m, n)
         b = b + contraction(c, m, m) - matmul(product, &
            & matmul(inverse_of(contraction(c, n, n)), transpose(product)))
      end do
      ! B = sum 2 pi/n / (8 pi^2), and f = B^-1/(8 pi^2).
      expected = inverse_of(b*2.0_wp*pi/n_angles/(8.0_wp*pi**2))/(8.0_wp*pi**2)
      do j = 1, 6
         call check('an inverse of the matrix doubles the angles', &
            & abs(f(lanes, j) - component(expected, j)) < 1.0e-9_wp*maxval(abs(expected)))
      end do
   end subroutine test_doubling

   !> Along the axis of a hexagonal crystal the modulus has a closed form, however anisotropic the
   !> crystal.
   subroutine test_hexagonal_axis()
      real(wp), parameter :: c11 = 300.0_wp, c12 = 120.0_wp, c13(3) = [60.0_wp, 20.0_wp, 12.0_wp]
      real(wp), parameter :: c33(3) = [150.0_wp, 30.0_wp, 6.0_wp], &
         & c44(3) = [60.0_wp, 6.0_wp, 1.5_wp]
      type(crystal_class_type) :: class
      type(halfspace_type) :: found
      type(error_type), allocatable :: error
      real(wp) :: c(6, 6), expected
      integer :: i

      call new_crystal_class('hexagonal', class, error)
      do i = 1, 3
         c = class%stiffness([c11, c12, c44(i), c33(i), c13(i)])
         expected = 2.0_wp*sqrt((c11*c33(i) - c13(i)**2)/c11 &
            & /(1.0_wp/c44(i) + 2.0_wp/(sqrt(c11*c33(i)) + c13(i))))
         call halfspace_modulus(c, [0.3_wp, 0.0_wp, 0.0_wp], found, error)
         call check_success('along the axis', error)
         call check_close('along the axis of a hexagonal crystal', found%modulus, expected, &
            & 1.0e-8_wp*expected)
      end do
      call check('the last of these is very anisotropic', anisotropy_index(c) > 66.0_wp)
   end subroutine test_hexagonal_axis

   !> The modulus does not change as the crystal turns about the surface's normal: the grids are
   !> accepted for what they resolve, not because a harmonic happens to vanish on them.
   subroutine test_turn_about_normal()
      integer, parameter :: turns = 400
      type(crystal_class_type) :: class
      type(halfspace_type) :: found
      type(error_type), allocatable :: error
      real(wp) :: c(6, 6), moduli(turns)
      integer :: i, tilted

      call new_crystal_class('cubic', class, error)
      c = class%stiffness([129.1_wp, 109.7_wp, 82.4_wp])
      do tilted = 0, 1
         do i = 1, turns
            call halfspace_modulus(c, [pi*i/turns, 0.5_wp*tilted, 0.2_wp*tilted], found, error)
            moduli(i) = found%modulus
         end do
         call check('a turn about the normal changes nothing', &
            & maxval(moduli) - minval(moduli) < 1.0e-7_wp*minval(moduli))
      end do
   end subroutine test_turn_about_normal

   !> (ab)_ij = a_k C_kijl b_l.
   function contraction(c, a, b) result(ab)
      real(wp), intent(in) :: c(6, 6), a(3), b(3)
      real(wp) :: ab(3, 3)
      integer :: i, j, p, q

      ab = 0.0_wp
      do j = 1, 3
         do i = 1, 3
            do q = 1, 3
               do p = 1, 3
                  ab(i, j) = ab(i, j) + a(p)*c(voigt_index(p, i), voigt_index(j, q))*b(q)
               end do
            end do
         end do
      end do
   end function contraction

   function components(a) result(six)
      real(wp), intent(in) :: a(3, 3)
      real(wp) :: six(6)
      integer :: j

      six = [(component(a, j), j=1, 6)]
   end function components

   !> Component j of 11, 22, 33, 23, 13, 12.
   real(wp) function component(a, j)
      real(wp), intent(in) :: a(3, 3)
      integer, intent(in) :: j
      integer, parameter :: row(6) = [1, 2, 3, 2, 1, 1], column(6) = [1, 2, 3, 3, 3, 2]

      component = a(row(j), column(j))
   end function component

   !> By Cramer's rule.
   function inverse_of(a) result(inverse)
      real(wp), intent(in) :: a(3, 3)
      real(wp) :: inverse(3, 3)
      integer :: i, j, p, q, r, s

      do j = 1, 3
         p = 1 + mod(j, 3)
         q = 1 + mod(j + 1, 3)
         do i = 1, 3
            r = 1 + mod(i, 3)
            s = 1 + mod(i + 1, 3)
            inverse(i, j) = a(p, r)*a(q, s) - a(p, s)*a(q, r)
         end do
      end do
      inverse = inverse/dot_product(a(1, :), inverse(:, 1))
   end function inverse_of

   !> A crystal of a class near steel's stiffness, of log-anisotropy about 0.8.
   subroutine make_crystal(class, stream, w, c)
      type(crystal_class_type), intent(in) :: class
      type(random_stream_type), intent(inout) :: stream
      real(wp), allocatable, intent(out) :: w(:)
      real(wp), intent(out) :: c(6, 6)
      type(log_coordinates_type) :: coordinates
      integer :: j

      coordinates = new_log_coordinates(class)
      allocate (w(class%n_constants))
      do j = 1, size(w)
         call stream%normal(w(j))
      end do
      if (size(w) > 2) w(3:) = 0.8_wp*w(3:)/norm2(w(3:))
      w(1) = log(500.0_wp) + 0.1_wp*w(1)
      w(2) = sqrt(5.0_wp)*log(160.0_wp) + 0.1_wp*w(2)
      c = coordinates%from_logarithms(w)
   end subroutine make_crystal

   !> There and back, the norm that is the log-anisotropy, and the volume against the determinant of
   !> differences.
   subroutine test_coordinates(name)
      character(len=*), intent(in) :: name
      type(crystal_class_type) :: class
      type(log_coordinates_type) :: coordinates
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      real(wp), allocatable :: w(:), shifted(:), jacobian(:, :)
      real(wp) :: c(6, 6), up(6, 6), down(6, 6), volume(2), found(2)
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
         call check(name//': there and back', &
            & maxval(abs(coordinates%to_logarithms(c) - w)) < 1.0e-9_wp)
         call check(name//': of the class', &
            & maxval(abs(class%stiffness(class%constants_of(c)) - c)) < 1.0e-9_wp)
         call check_close(name//': the norm is the log-anisotropy', norm2(w(3:)), &
            & log_anisotropy(c), 1.0e-6_wp)
         volume(i) = coordinates%log_volume(w)
         if (allocated(jacobian)) deallocate (jacobian)
         allocate (jacobian(size(w), size(w)))
         do j = 1, size(w)
            shifted = w
            shifted(j) = w(j) + step
            up = coordinates%from_logarithms(shifted)
            shifted(j) = w(j) - step
            down = coordinates%from_logarithms(shifted)
            jacobian(:, j) = (class%constants_of(up) - class%constants_of(down))/(2.0_wp*step)
         end do
         found(i) = log_determinant(jacobian)
      end do
      ! Differences of second order: errors of step^2 in each of up to 21 columns.
      call check_close(name//': the volume, up to a constant', volume(2) - volume(1), &
         & found(2) - found(1), 1.0e-7_wp)
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
         rest(i + 1:, :) = rest(i + 1:, :) - spread(rest(i + 1:, i)/row(i), 2, &
            & size(row))*spread(row, 1, size(row) - i)
      end do
   end function log_determinant

   !> Moduli of random directions against the quadrature: the error falls with the degree, and is
   !> small where Step 2 wants it.
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
      real(wp) :: c(6, 6), euler(3, n), moduli(n, 1), largest(3), u
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
         call field_moduli(field, reshape(c, [6, 6, 1]), moduli)
         largest(j) = maxval(abs(moduli(:, 1)/exact%modulus - 1.0_wp))
      end do
      call check(name//': moduli', all(largest < allowed))
      call check(name//': better with every degree', &
         & all(largest(2:) < 0.5_wp*largest(:2) .or. largest(2:) < 1.0e-7_wp))
   end subroutine test_field
end program test_halfspace_theory
