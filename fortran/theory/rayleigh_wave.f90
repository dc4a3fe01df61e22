!> Surface (Rayleigh) waves of an anisotropic half-space: speed, and the displacement of the
!> surface.
!>
!> Below the limiting speed the impedance Z = D^-1 (1 + i A) is Hermitian (Lothe & Barnett, J. Appl.
!> Phys. 47, 428, 1976). D and A are the blocks of the mean of Stroh's matrix (see
!> `halfspace_theory`), in which rho v^2 is subtracted from (mm). Z is positive definite up to the
!> speed of the surface wave, where its smallest eigenvalue is zero (Fu & Mielke, Proc. R. Soc. A
!> 458, 2523, 2002). With P = D^-1 and w the vector of the antisymmetric P A: det Z = det P - w.P.w.
!> Its root is sought over s = sqrt(1 - (v/v_limiting)^2), in which it is smooth. At the root Z has
!> one null vector a, and |n.a|^2/|a|^2 follows from the adjugate of Z, whose real part is adj P - w
!> w^T.
!>
!> In strongly anisotropic crystals the surface wave may be just slower than the slowest bulk wave
!> of its direction, or may hardly move along the normal. Then it is neither excited nor detected,
!> and a measurement shows the pseudo-surface wave, which is faster. (Nearness to the limiting speed
!> is no such sign: most waves of copper are within 3 % of it, and well excited.)
!>
!> The "modulus" of a wave is rho v^2. That of a bulk wave is an eigenvalue of the acoustic
!> (Christoffel) tensor of the direction.
module rayleigh_wave
   use crystal_elasticity, only: check_stiffness, rotation_matrix
   use errors, only: error_type
   use halfspace_theory, only: contraction_maps, double_angles, invert, lanes, multiply, &
      & multiply_transposed, plane_products, transposed
   use kinds, only: degree, pi, wp
   use observables, only: longitudinal_path, path_type, surface_path
   use text, only: to_text
   implicit none
   private
   public :: wave_type, surface_type, new_surface, surface_waves, rayleigh_waves, wave_speed

   type :: wave_type
      !> rho v^2 of the surface wave, and of the slowest bulk wave in the same direction, GPa.
      real(wp) :: modulus = 0.0_wp, bulk = 0.0_wp
      !> Share of the component along the normal in the squared displacement at the surface.
      real(wp) :: normal_share = 0.0_wp
   contains
      procedure :: is_detected
   end type wave_type

   !> Directions of propagation on surfaces, a block of `lanes` at a time: products of the direction
   !> m and the normal n, see `halfspace_theory`, and the normals; crystal axes. The last block is
   !> filled up with the last direction.
   type :: surface_type
      integer :: n = 0
      integer, allocatable, private :: wave(:)
      real(wp), allocatable, private :: mn(:, :, :), mm(:, :, :), nn(:, :, :), normal(:, :, :)
   end type surface_type

   !> Greatest speed relative to the bulk wave, and least share of the normal displacement, of a
   !> wave that is detected.
   real(wp), parameter :: greatest_ratio = 0.97_wp, least_share = 0.2_wp
   !> Least s that is tried, and change of s below which the root is accepted.
   real(wp), parameter :: least_s = 1.0e-3_wp, root_tolerance = 1.0e-8_wp

contains

   !> Whether a measurement shows this wave.
   elemental logical function is_detected(self)
      class(wave_type), intent(in) :: self

      is_detected = self%modulus < greatest_ratio**2*self%bulk .and. self%normal_share > least_share
   end function is_detected

   !> Speed of a wave of modulus rho v^2, m/s.
   elemental real(wp) function wave_speed(modulus, density)
      !> GPa, kg/m3.
      real(wp), intent(in) :: modulus, density

      wave_speed = sqrt(1.0e9_wp*modulus/density)
   end function wave_speed

   !> Set up the directions of propagation of grains.
   pure subroutine new_surface(euler, paths, surface)
      !> Bunge-Euler angles, radians, (3, n).
      real(wp), intent(in) :: euler(:, :)
      !> Path of each wave, (n).
      type(path_type), intent(in) :: paths(:)
      type(surface_type), intent(out) :: surface
      real(wp) :: g(3, 3), along(3), angle, tilt
      integer :: blocks, block, lane, i

      surface%n = size(paths)
      surface%wave = paths%kind
      blocks = (surface%n + lanes - 1)/lanes
      allocate (surface%mn(lanes, 9, blocks), surface%mm(lanes, 6, blocks), &
         & surface%nn(lanes, 6, blocks), surface%normal(lanes, 3, blocks))
      do block = 1, blocks
         do lane = 1, lanes
            i = min(surface%n, lanes*(block - 1) + lane)
            g = rotation_matrix(euler(:, i))
            surface%normal(lane, :, block) = g(:, 3)
            angle = paths(i)%propagation_deg*degree
            tilt = paths(i)%inclination_deg*degree
            along = cos(angle)*g(:, 1) + sin(angle)*g(:, 2)
            call plane_products(cos(tilt)*along + sin(tilt)*g(:, 3), &
               & cos(tilt)*g(:, 3) - sin(tilt)*along, surface%mn(lane, :, block), &
               & surface%mm(lane, :, block), surface%nn(lane, :, block))
         end do
      end do
   end subroutine new_surface

   !> Waves in all directions, of one stable crystal or of a crystal for each direction.
   pure subroutine surface_waves(surface, c, waves)
      type(surface_type), intent(in) :: surface
      !> (6, 6, 1 or n), GPa.
      real(wp), intent(in) :: c(:, :, :)
      !> (n).
      type(wave_type), intent(out) :: waves(:)
      type(wave_type) :: in_block(lanes)
      real(wp) :: map_mn(9, 9), map_mm(6, 6), mm(lanes, 6), mn(lanes, 9), nn(lanes, 6), bulk(lanes)
      integer :: block, first, lane, wave

      call contraction_maps(c(:, :, 1), map_mn, map_mm)
      do block = 1, size(surface%mn, 3)
         first = lanes*(block - 1)
         mm = matmul(surface%mm(:, :, block), map_mm)
         mn = matmul(surface%mn(:, :, block), map_mn)
         nn = matmul(surface%nn(:, :, block), map_mm)
         do lane = 1, lanes
            if (size(c, 3) == 1) exit
            call contraction_maps(c(:, :, min(surface%n, first + lane)), map_mn, map_mm)
            mm(lane, :) = matmul(surface%mm(lane, :, block), map_mm)
            mn(lane, :) = matmul(surface%mn(lane, :, block), map_mn)
            nn(lane, :) = matmul(surface%nn(lane, :, block), map_mm)
         end do
         call find_waves(mm, mn, nn, surface%normal(:, :, block), in_block)
         do lane = 1, min(lanes, surface%n - first)
            wave = surface%wave(first + lane)
            if (wave > surface_path) then
               bulk = eigenvalues(mm, wave - longitudinal_path)
               in_block(lane) = wave_type(bulk(lane), huge(1.0_wp), 1.0_wp)
            end if
         end do
         waves(first + 1:min(first + lanes, surface%n)) = in_block(:min(lanes, surface%n - first))
      end do
   end subroutine surface_waves

   !> Wave of each of many crystals in one direction. The error is that of the first crystal that
   !> has one.
   subroutine rayleigh_waves(stiffness, euler_deg, paths, waves, error)
      !> GPa, (6, 6, n); Bunge-Euler angles, degrees, (3, n).
      real(wp), intent(in) :: stiffness(:, :, :), euler_deg(:, :)
      !> (n).
      type(path_type), intent(in) :: paths(:)
      !> (n).
      type(wave_type), intent(out) :: waves(:)
      type(error_type), allocatable, intent(out) :: error
      type(surface_type) :: surface
      integer :: i

      do i = 1, size(waves)
         call check_stiffness(stiffness(:, :, i), error)
         if (allocated(error)) then
            error%message = 'crystal '//to_text(i)//': '//error%message
            return
         end if
      end do
      call new_surface(degree*euler_deg, paths, surface)
      call surface_waves(surface, stiffness, waves)
   end subroutine rayleigh_waves

   !> Find the roots by secants, which stay between a point below the root and one above it.
   pure subroutine find_waves(mm, mn, nn, normal, waves)
      !> Contractions, GPa, see `inverse_barnett`; (lanes, 3).
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6), normal(lanes, 3)
      type(wave_type), intent(out) :: waves(lanes)
      !> Isotropic solids have roots between 0.3 and 0.5.
      real(wp), parameter :: guesses(2) = [0.35_wp, 0.45_wp]
      integer, parameter :: most_steps = 60
      real(wp), dimension(lanes) :: low, high, s, previous, value, previous_value, next, limiting
      real(wp) :: a(lanes, 9), d(lanes, 6), e(lanes, 6), rise
      integer :: i, step

      call bulk_moduli(mm, mn, nn, limiting, waves%bulk)
      call invert(nn, d)
      call multiply(d, mn(:, transposed), a)
      call multiply_transposed(a, mn(:, transposed), e)
      a = -a
      e = e - mm
      low = least_s
      high = 1.0_wp
      s = guesses(1)
      do step = 0, most_steps
         call determinant(s, value)
         high = merge(min(high, s), high, value > 0.0_wp)
         low = merge(low, max(low, s), value > 0.0_wp)
         if (step == 0) then
            previous = s
            previous_value = value
            s = guesses(2)
            cycle
         end if
         do i = 1, lanes
            if (abs(s(i) - previous(i)) < root_tolerance) cycle
            rise = value(i) - previous_value(i)
            next(i) = s(i) - value(i)*(s(i) - previous(i))/sign(max(abs(rise), tiny(1.0_wp)), rise)
            if (.not. (next(i) > low(i) .and. next(i) < high(i))) then
               next(i) = sqrt(low(i)*high(i))
            end if
            previous(i) = s(i)
            previous_value(i) = value(i)
            s(i) = next(i)
         end do
         if (all(abs(s - previous) < root_tolerance)) exit
      end do
      call determinant(s, value, waves%normal_share)
      waves%modulus = limiting*(1.0_wp - s**2)
      waves%normal_share = max(0.0_wp, min(1.0_wp, waves%normal_share))

   contains

      !> det Z, and the share of the adjugate along the normal.
      pure subroutine determinant(trial_s, det, normal_share)
         !> Trial values of s.
         real(wp), intent(in) :: trial_s(lanes)
         real(wp), intent(out) :: det(lanes)
         real(wp), intent(out), optional :: normal_share(lanes)
         !> The error that is left is about the square of the change.
         real(wp), parameter :: tolerance = 1.0e-7_wp
         integer, parameter :: most_doublings = 40
         real(wp) :: turned_a(lanes, 9), turned_d(lanes, 6), turned_e(lanes, 6), p(lanes, 6), &
            & x(lanes, 9), w(lanes, 3), change
         integer :: k

         turned_a = a
         turned_d = d
         turned_e = e
         do k = 1, 3
            turned_e(:, k) = e(:, k) + limiting*(1.0_wp - trial_s**2)
         end do
         do k = 1, most_doublings
            call double_angles(turned_a, turned_d, turned_e, change)
            if (change <= tolerance) exit
         end do
         call invert(turned_d, p)
         call multiply(p, turned_a, x)
         w = 0.5_wp*(x(:, [6, 7, 2]) - x(:, [8, 3, 4]))
         ! The adjugate of P is D det P.
         x(:, 1) = p(:, 1)*(p(:, 2)*p(:, 3) - p(:, 4)**2) &
            & - p(:, 6)*(p(:, 6)*p(:, 3) - p(:, 4)*p(:, 5)) &
            & + p(:, 5)*(p(:, 6)*p(:, 4) - p(:, 2)*p(:, 5))
         det = x(:, 1) - along(p, w)
         if (present(normal_share)) then
            normal_share = (x(:, 1)*along(turned_d, normal) - sum(w*normal, 2)**2) &
               & /(x(:, 1)*sum(turned_d(:, :3), 2) - sum(w**2, 2))
         end if
      end subroutine determinant

      !> x.S.x of symmetric matrices S.
      pure function along(matrix, x)
         real(wp), intent(in) :: matrix(lanes, 6), x(lanes, 3)
         real(wp) :: along(lanes)

         along = sum(matrix(:, :3)*x**2, 2) + 2.0_wp*(matrix(:, 4)*x(:, 2)*x(:, 3) &
            & + matrix(:, 5)*x(:, 1)*x(:, 3) + matrix(:, 6)*x(:, 1)*x(:, 2))
      end function along
   end subroutine find_waves

   !> Moduli of bulk waves, GPa: that of the slowest along m, and the limiting one. The limiting
   !> modulus is the minimum, over directions of slope p to m in the plane of m and n, of the least
   !> eigenvalue of the acoustic tensor times 1 + p^2.
   pure subroutine bulk_moduli(mm, mn, nn, limiting, along)
      !> As in `find_waves`.
      real(wp), intent(in) :: mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      real(wp), intent(out) :: limiting(lanes), along(lanes)
      !> Number of angles that are tried. Each minimum among them is refined by parabolas of falling
      !> width.
      integer, parameter :: n = 30, refinements = 4
      real(wp), parameter :: step = pi/n, shrink = 0.1_wp
      integer :: i, k, start(lanes)
      real(wp), parameter :: slopes(0:n - 1) = [(tan(step*(k + 0.5_wp) - 0.5_wp*pi), k=0, n - 1)]
      real(wp) :: values(lanes, -1:n), mn_nm(lanes, 6)
      real(wp), dimension(lanes) :: p, width, value, left, right, bend
      logical :: minima(0:n - 1, lanes)

      mn_nm = mn(:, [1, 5, 9, 6, 3, 2]) + mn(:, [1, 5, 9, 8, 7, 4])
      values = huge(1.0_wp)
      p = 0.0_wp
      along = least_eigenvalues(p)
      limiting = along
      do k = 0, n - 1
         p = slopes(k)
         values(:, k) = least_eigenvalues(p)
         limiting = min(limiting, values(:, k))
      end do
      do k = 0, n - 1
         minima(k, :) = .not. values(:, k) > min(values(:, k - 1), values(:, k + 1))
      end do
      ! Refine the first minima of all lanes, then the second ones, and so on. A lane without
      ! another minimum repeats its last one.
      do while (any(minima))
         do i = 1, lanes
            k = findloc(minima(:, i), .true., dim=1) - 1
            if (k >= 0) start(i) = k
            minima(start(i), i) = .false.
            p(i) = slopes(start(i))
            value(i) = values(i, start(i))
         end do
         width = step*(1.0_wp + p**2)
         do i = 1, refinements
            left = least_eigenvalues(p - width)
            right = least_eigenvalues(p + width)
            bend = max(left + right - 2.0_wp*value, tiny(1.0_wp))
            p = p - width*max(-1.0_wp, min(1.0_wp, 0.5_wp*(right - left)/bend))
            value = least_eigenvalues(p)
            limiting = min(limiting, value, left, right)
            width = shrink*width
         end do
      end do

   contains

      !> Least eigenvalues of (mm) + p ((mn) + (nm)) + p^2 (nn).
      pure function least_eigenvalues(p)
         real(wp), intent(in) :: p(lanes)
         real(wp) :: least_eigenvalues(lanes), matrix(lanes, 6)
         integer :: i

         do i = 1, 6
            matrix(:, i) = mm(:, i) + p*(mn_nm(:, i) + p*nn(:, i))
         end do
         least_eigenvalues = eigenvalues(matrix, 1)
      end function least_eigenvalues
   end subroutine bulk_moduli

   !> The greatest (0), the least (1) or the middle (2) eigenvalues of symmetric matrices, in the
   !> order of `path_names`. The greatest is mean + 2 r cos(alpha/3). Here r is the length of the
   !> deviator over sqrt 6, and cos(alpha) is half the determinant of the deviator over r^3. The
   !> least is that of the negative matrix. Vector units have no arc cosine: y = cos(acos(x)/3) is a
   !> root of (2 y - 1) sqrt((1 + y)/2) = sqrt((1 + x)/2).
   pure recursive function eigenvalues(matrix, which) result(values)
      !> Components 11, 22, 33, 23, 13, 12.
      real(wp), intent(in) :: matrix(lanes, 6)
      integer, intent(in) :: which
      real(wp) :: values(lanes), side, mean, r, x1, x2, x3, x4, x5, x6, right_side, y
      integer :: i, k

      if (which == 2) then
         values = matrix(:, 1) + matrix(:, 2) + matrix(:, 3) &
            & - eigenvalues(matrix, 0) - eigenvalues(matrix, 1)
         return
      end if
      side = merge(1.0_wp, -1.0_wp, which == 0)
      !$omp simd simdlen(8)
      do i = 1, lanes
         mean = (matrix(i, 1) + matrix(i, 2) + matrix(i, 3))/3.0_wp
         x1 = matrix(i, 1) - mean
         x2 = matrix(i, 2) - mean
         x3 = matrix(i, 3) - mean
         x4 = matrix(i, 4)
         x5 = matrix(i, 5)
         x6 = matrix(i, 6)
         r = sqrt((x1**2 + x2**2 + x3**2 + 2.0_wp*(x4**2 + x5**2 + x6**2))/6.0_wp)
         y = 0.5_wp*(x1*(x2*x3 - x4**2) - x6*(x6*x3 - x4*x5) + x5*(x6*x4 - x2*x5))/max(r, &
            & tiny(1.0_wp)**0.25_wp)**3
         right_side = sqrt(0.5_wp*(1.0_wp + max(-1.0_wp, min(1.0_wp, side*y))))
         ! Start near the root, then two steps of Newton's method.
         y = 0.5_wp + right_side*(0.56416_wp - 0.06416_wp*right_side)
         do k = 1, 2
            y = y - (2.0_wp*(1.0_wp + y)*(2.0_wp*y - 1.0_wp) &
               & - 4.0_wp*right_side*sqrt(0.5_wp*(1.0_wp + y)))/(6.0_wp*y + 3.0_wp)
         end do
         values(i) = mean + side*2.0_wp*r*y
      end do
   end function eigenvalues
end module rayleigh_wave
