!> Elasticity of one crystal of any class: rotation, stability, polycrystal averages and anisotropy
!> of a general stiffness.
!>
!> Stiffness in GPa, Voigt order 11,22,33,23,13,12 without factors of two. Bunge-Euler angles (phi1,
!> Phi, phi2) in radians; g maps sample to crystal axes, v_crystal = g v_sample.
module crystal_elasticity
   use errors, only: error_type, refuse
   use kinds, only: nan, wp
   use small_matrices, only: factor_definite, solve_lower, solve_upper
   use text, only: to_text
   implicit none
   private
   public :: rotation_matrix, euler_angles, rotate_stiffness, bond_matrix, voigt_index
   public :: is_stable, check_stiffness, compliance, averages_type, polycrystal_averages, &
      & anisotropy_index, log_anisotropy, logarithmic_mean
   public :: kelvin_form, stiffness_of_kelvin, diagonalise, isotropic_stiffness

   !> Smallest pivot of a stable crystal's stiffness, relative to its diagonal entry; below are
   !> rounding errors.
   real(wp), parameter :: resolution = 1.0e-12_wp
   !> Voigt index of a pair of Cartesian indices.
   integer, parameter :: voigt_index(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])

   !> Polycrystal bounds for a uniform texture, GPa (Hill, Proc. Phys. Soc. A 65, 349, 1952).
   type :: averages_type
      real(wp) :: bulk_voigt, shear_voigt, bulk_reuss, shear_reuss
      !> Hill's averages: the means of the bounds, with their Young's modulus, GPa, and Poisson's
      !> ratio.
      real(wp) :: bulk, shear, young, poisson
      !> Compliance of the crystal, 1/GPa.
      real(wp) :: compliance(6, 6)
   end type averages_type

contains

   !> Bunge's g from (phi1, Phi, phi2) in radians: v_crystal = g v_sample.
   pure function rotation_matrix(euler) result(g)
      real(wp), intent(in) :: euler(3)
      real(wp) :: g(3, 3), c1, s1, c, s, c2, s2

      c1 = cos(euler(1))
      s1 = sin(euler(1))
      c = cos(euler(2))
      s = sin(euler(2))
      c2 = cos(euler(3))
      s2 = sin(euler(3))
      g(1, :) = [c1*c2 - s1*s2*c, s1*c2 + c1*s2*c, s2*s]
      g(2, :) = [-c1*s2 - s1*c2*c, -s1*s2 + c1*c2*c, c2*s]
      g(3, :) = [s1*s, -c1*s, c]
   end function rotation_matrix

   !> Bunge-Euler angles, radians, of a rotation matrix g; phi2 is 0 where Phi is 0 or pi.
   pure function euler_angles(g) result(euler)
      real(wp), intent(in) :: g(3, 3)
      real(wp) :: euler(3)
      real(wp), parameter :: aligned = 1.0e-12_wp

      euler(2) = atan2(norm2(g(3, :2)), g(3, 3))
      if (norm2(g(3, :2)) > aligned) then
         euler(1) = atan2(g(3, 1), -g(3, 2))
         euler(3) = atan2(g(1, 3), g(2, 3))
      else
         euler(1) = atan2(g(1, 2), g(1, 1))
         euler(3) = 0.0_wp
      end if
   end function euler_angles

   !> Stiffness in the sample frame of a crystal of orientation `g`: C' = M C Mᵀ with Bond's matrix
   !> of gᵀ.
   pure function rotate_stiffness(c, g) result(rotated)
      real(wp), intent(in) :: c(6, 6), g(3, 3)
      real(wp) :: rotated(6, 6)
      !> Matrices with two additional rows of zeros. The products are written out over columns of
      !> eight numbers, which fill the vector units.
      real(wp), dimension(8, 6) :: padded, bond, half, turned
      integer :: j

      bond(:6, :) = bond_matrix(transpose(g))
      padded(:6, :) = c
      bond(7:, :) = 0.0_wp
      padded(7:, :) = 0.0_wp
      do j = 1, 6
         half(:, j) = padded(:, 1)*bond(j, 1) + padded(:, 2)*bond(j, 2) + padded(:, 3)*bond(j, 3) &
            & + padded(:, 4)*bond(j, 4) + padded(:, 5)*bond(j, 5) + padded(:, 6)*bond(j, 6)
      end do
      do j = 1, 6
         turned(:, j) = bond(:, 1)*half(1, j) + bond(:, 2)*half(2, j) + bond(:, 3)*half(3, j) &
            & + bond(:, 4)*half(4, j) + bond(:, 5)*half(5, j) + bond(:, 6)*half(6, j)
      end do
      ! Exactly symmetric in spite of rounding errors.
      rotated = 0.5_wp*(turned(:6, :) + transpose(turned(:6, :)))
   end function rotate_stiffness

   !> Bond's matrix, which rotates stresses in Voigt's order.
   pure function bond_matrix(a) result(bond)
      !> A rotation of vectors.
      real(wp), intent(in) :: a(3, 3)
      real(wp) :: bond(6, 6)
      !> Cartesian indices of the Voigt indices 4, 5 and 6.
      integer, parameter :: first(3) = [2, 1, 1], second(3) = [3, 3, 2]
      integer :: i, j

      do j = 1, 3
         do i = 1, 3
            bond(i, j) = a(i, j)**2
            bond(i, j + 3) = 2.0_wp*a(i, first(j))*a(i, second(j))
            bond(i + 3, j) = a(first(i), j)*a(second(i), j)
            bond(i + 3, j + 3) = a(first(i), first(j))*a(second(i), second(j)) &
               & + a(first(i), second(j))*a(second(i), first(j))
         end do
      end do
   end function bond_matrix

   !> Born's criterion: the strain energy is positive, that is, the stiffness is positive definite.
   pure logical function is_stable(c)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: factor(6, 6)

      factor = c
      call factor_definite(factor, resolution, is_stable)
   end function is_stable

   !> Compliance of a stable crystal, 1/GPa, in Voigt's order with its factors of two and four; NaN
   !> for an unstable crystal.
   pure function compliance(c) result(s)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: s(6, 6), factor(6, 6)
      integer :: j
      logical :: stable

      factor = c
      call factor_definite(factor, resolution, stable)
      s = nan
      if (.not. stable) return
      s = 0.0_wp
      do j = 1, 6
         s(j, j) = 1.0_wp
         call solve_lower(factor, s(:, j))
         call solve_upper(factor, s(:, j))
      end do
   end function compliance

   !> Refuse a stiffness that is not finite or not Born-stable.
   pure subroutine check_stiffness(c, error)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: values(6), vectors(6, 6)

      if (.not. all(abs(c) <= huge(1.0_wp))) then
         call refuse(error, 'the stiffness holds a value that is not finite')
      else if (.not. is_stable(c)) then
         call diagonalise(kelvin_form(c), values, vectors)
         call refuse(error, &
            & 'the crystal is elastically unstable: the smallest eigenvalue of its stiffness is ' &
            & //to_text(minval(values), 3)//' GPa; the stiffness must be positive definite')
      end if
   end subroutine check_stiffness

   !> Voigt, Reuss and Hill averages; all but Voigt's are NaN for an unstable crystal.
   pure type(averages_type) function polycrystal_averages(c) result(averages)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)

      averages%compliance = compliance(c)
      averages%bulk_voigt = sum(c(:3, :3))/9.0_wp
      averages%shear_voigt = (c(1, 1) + c(2, 2) + c(3, 3) - c(1, 2) - c(2, 3) - c(1, 3) &
         & + 3.0_wp*(c(4, 4) + c(5, 5) + c(6, 6)))/15.0_wp
      associate (s => averages%compliance)
         averages%bulk_reuss = 1.0_wp/sum(s(:3, :3))
         averages%shear_reuss = 15.0_wp/(4.0_wp*(s(1, 1) + s(2, 2) + s(3, 3) - s(1, 2) - s(2, 3) &
            & - s(1, 3)) + 3.0_wp*(s(4, 4) + s(5, 5) + s(6, 6)))
      end associate
      associate (bulk => averages%bulk, shear => averages%shear)
         bulk = 0.5_wp*(averages%bulk_voigt + averages%bulk_reuss)
         shear = 0.5_wp*(averages%shear_voigt + averages%shear_reuss)
         averages%young = 9.0_wp*bulk*shear/(3.0_wp*bulk + shear)
         averages%poisson = (3.0_wp*bulk - 2.0_wp*shear)/(6.0_wp*bulk + 2.0_wp*shear)
      end associate
   end function polycrystal_averages

   !> Universal anisotropy index 5 Gv/Gr + Kv/Kr - 6 (paper's Eq. 14; Ranganathan &
   !> Ostoja-Starzewski 2008): 0 for an isotropic crystal, unbounded towards instability, NaN for an
   !> unstable crystal.
   pure real(wp) function anisotropy_index(c) result(index)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)

      associate (averages => polycrystal_averages(c))
         index = 5.0_wp*averages%shear_voigt/averages%shear_reuss &
            & + averages%bulk_voigt/averages%bulk_reuss - 6.0_wp
      end associate
   end function anisotropy_index

   !> Stiffness of an isotropic solid, GPa.
   pure function isotropic_stiffness(young, poisson) result(c)
      !> GPa, and Poisson's ratio.
      real(wp), intent(in) :: young, poisson
      real(wp) :: c(6, 6), shear, lame
      integer :: i

      shear = young/(2.0_wp*(1.0_wp + poisson))
      lame = 2.0_wp*shear*poisson/(1.0_wp - 2.0_wp*poisson)
      c = 0.0_wp
      c(:3, :3) = lame
      do i = 1, 3
         c(i, i) = lame + 2.0_wp*shear
         c(i + 3, i + 3) = shear
      end do
   end function isotropic_stiffness

   !> Log-anisotropy: Frobenius norm of the anisotropic part of log K, with the Kelvin form K; NaN
   !> for an unstable crystal.
   pure real(wp) function log_anisotropy(c)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: poisson

      call logarithmic_mean(c, poisson, log_anisotropy)
   end function log_anisotropy

   !> Poisson's ratio of the isotropic part of log K, the norm of its anisotropic part (the
   !> log-anisotropy), and the geometric mean of the eigenvalues of K; NaN for an unstable crystal.
   pure subroutine logarithmic_mean(c, poisson, anisotropy, stiffness)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      !> Dimensionless.
      real(wp), intent(out) :: poisson, anisotropy
      !> GPa.
      real(wp), intent(out), optional :: stiffness
      real(wp) :: values(6), vectors(6, 6), logs(6), bulk, shear

      call diagonalise(kelvin_form(c), values, vectors)
      ! NaN is not above 0 either.
      if (.not. minval(values) > 0.0_wp) then
         poisson = nan
         anisotropy = poisson
         if (present(stiffness)) stiffness = poisson
         return
      end if
      logs = log(values)
      ! The isotropic part of log K has the eigenvalue `bulk`, log 3K, on the dilatation and
      ! `shear`, log 2G, on the five deviators.
      bulk = sum(logs*sum(vectors(:3, :), 1)**2)/3.0_wp
      shear = (sum(logs) - bulk)/5.0_wp
      anisotropy = sqrt(max(0.0_wp, sum(logs**2) - bulk**2 - 5.0_wp*shear**2))
      poisson = (exp(bulk - shear) - 1.0_wp)/(2.0_wp*exp(bulk - shear) + 1.0_wp)
      if (present(stiffness)) stiffness = exp(sum(logs)/6.0_wp)
   end subroutine logarithmic_mean

   !> The stiffness as a tensor of rank two in six dimensions: rows and columns 4 to 6 are
   !> multiplied by sqrt 2.
   pure function kelvin_form(c) result(k)
      !> GPa.
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: k(6, 6)

      k = c
      k(4:, :) = sqrt(2.0_wp)*k(4:, :)
      k(:, 4:) = sqrt(2.0_wp)*k(:, 4:)
   end function kelvin_form

   !> The stiffness, GPa, of a Kelvin form.
   pure function stiffness_of_kelvin(k) result(c)
      !> GPa.
      real(wp), intent(in) :: k(6, 6)
      real(wp) :: c(6, 6)

      c = k
      c(4:, :) = sqrt(0.5_wp)*c(4:, :)
      c(:, 4:) = sqrt(0.5_wp)*c(:, 4:)
   end function stiffness_of_kelvin

   !> Eigenvalues and eigenvectors of a symmetric 6 x 6 matrix by cyclic Jacobi rotations.
   pure subroutine diagonalise(matrix, values, vectors)
      real(wp), intent(in) :: matrix(6, 6)
      !> Unsorted eigenvalues; eigenvectors, one a column.
      real(wp), intent(out) :: values(6), vectors(6, 6)
      real(wp) :: a(6, 6), t, cosine, sine, old(6)
      integer :: i, p, q, sweep
      integer, parameter :: most_sweeps = 50

      a = matrix
      vectors = 0.0_wp
      do i = 1, 6
         vectors(i, i) = 1.0_wp
      end do
      do sweep = 1, most_sweeps
         values = [(a(i, i), i=1, 6)]
         ! The entries beside the diagonal are rounding errors.
         if (sum([(sum(a(:q - 1, q)**2), q=2, 6)]) <= 0.5e-30_wp*sum(values**2)) exit
         do q = 2, 6
            do p = 1, q - 1
               if (abs(a(p, q)) <= 1.0e-17_wp*(abs(a(p, p)) + abs(a(q, q)))) cycle
               ! The tangent of the smaller angle of rotation.
               t = (a(q, q) - a(p, p))/(2.0_wp*a(p, q))
               t = sign(1.0_wp, t)/(abs(t) + sqrt(t**2 + 1.0_wp))
               cosine = 1.0_wp/sqrt(t**2 + 1.0_wp)
               sine = t*cosine
               old = a(:, p)
               a(:, p) = cosine*old - sine*a(:, q)
               a(:, q) = sine*old + cosine*a(:, q)
               old = a(p, :)
               a(p, :) = cosine*old - sine*a(q, :)
               a(q, :) = sine*old + cosine*a(q, :)
               old = vectors(:, p)
               vectors(:, p) = cosine*old - sine*vectors(:, q)
               vectors(:, q) = sine*old + cosine*vectors(:, q)
            end do
         end do
      end do
   end subroutine diagonalise
end module crystal_elasticity
