!> Surface compliance of anisotropic layers on an anisotropic half-space or on a rigid base.
!>
!> A pressure exp(i k m.x) on the surface, m a direction in it, moves the surface by f/k along the
!> normal. In each material the displacement u and the traction t = i k psi of planes of constant
!> depth obey (u, psi)' = i k N (u, psi) with Stroh's matrix N; its mean over the turn, S = [A, D;
!> E, A^T], has S^2 = -1 and is i on decaying and -i on growing solutions. So a decaying solution
!> has t = -k Z u with the impedance Z = D^-1 (1 + i A) and u' = k M u; of growing ones both follow
!> by complex conjugation. A layer holds a decaying and a growing solution, both written with
!> exponentials that decay (K. A. Ingebrigtsen & A. Tonning, Phys. Rev. 184, 942, 1969). Layers are
!> joined from the base upwards by the compliance G of what lies below, u = -G t/k.
!>
!> exp(M s) is a polynomial of degree 2 in M, by the theorem of Cayley and Hamilton. The
!> polynomials are multiplied modulo the characteristic one, so that scaling and squaring needs
!> neither eigenvectors nor distinct eigenvalues.
module layered_compliance
   use halfspace_theory, only: barnett_blocks, invert, lanes, multiply, surface_contractions, &
      & transposed
   use kinds, only: pi, wp
   implicit none
   private
   public :: clenshaw_curtis, compliance_type, inverse, layers_type, new_compliance

   !> Layers bonded to a half-space.
   type :: layers_type
      !> Stiffness in sample axes, GPa, from the surface downwards (6, 6, layers); one more is the
      !> half-space, without which the base is rigid.
      real(wp), allocatable :: c(:, :, :)
      !> um, from the surface downwards (layers).
      real(wp), allocatable :: thickness(:)
   end type layers_type

   !> f of directions m and wave numbers k.
   type :: compliance_type
      !> f of infinitely short waves, 1/GPa (directions).
      real(wp), allocatable :: short(:)
      !> f less that limit, 1/GPa (0:n, directions), at wave numbers (0:n, directions), 1/um.
      real(wp), allocatable :: change(:, :), wave_number(:, :)
      !> Largest wave number, 1/um (directions).
      real(wp), allocatable :: range(:)
      !> Weights of wave numbers over the largest one, (0:n, 2): of all, and of every second alone.
      real(wp), allocatable :: weight(:, :)
   end type compliance_type

   !> One material in one direction. The eigenvalues of M are `mean` plus the roots of x^3 + e2 x -
   !> e3, the characteristic polynomial of `deviator`; these are below `size`.
   type :: medium_type
      complex(wp) :: z(3, 3), deviator(3, 3), square(3, 3), mean, e2, e3
      real(wp) :: size
   end type medium_type

   complex(wp), parameter :: one = (1.0_wp, 0.0_wp), i_unit = (0.0_wp, 1.0_wp)
   complex(wp), parameter :: identity(3, 3) = reshape([one, 0*one, 0*one, 0*one, one, 0*one, &
      & 0*one, 0*one, one], [3, 3])

contains

   !> Compliance of layers on the grid of `directions` of the half-space theory (perpendicular to
   !> these) and `n` wave numbers k = range x^2, x the nodes of Clenshaw and Curtis in 0 .. 1.
   pure subroutine new_compliance(layers, directions, n, precision, compliance)
      type(layers_type), intent(in) :: layers
      !> 8 or 16 or 32, ..; a power of two.
      integer, intent(in) :: directions, n
      !> Relative size of the change of f at the end of the range.
      real(wp), intent(in) :: precision
      type(compliance_type), intent(out) :: compliance
      !> Decays of the mean solution by which the slowest one is found.
      real(wp), parameter :: many = 60.0_wp
      type(medium_type), allocatable :: media(:, :)
      real(wp) :: x(0:n), s
      complex(wp) :: base(3, 3)
      integer :: i, j

      allocate (media(directions, size(layers%c, 3)))
      do i = 1, size(media, 2)
         call find_media(layers%c(:, :, i), media(:, i))
      end do
      x = [(sin(0.5_wp*pi*i/n)**2, i=0, n)]
      allocate (compliance%change(0:n, directions), compliance%wave_number(0:n, directions), &
         & compliance%short(directions), compliance%range(directions), &
         & compliance%weight(0:n, 2))
      do i = 1, 2
         compliance%weight(::i, i) = 2.0_wp*x(::i)*clenshaw_curtis(n/i)
      end do
      do j = 1, directions
         ! The decay of the slowest solution per wave number and depth, from the size of exp(M s) at
         ! a large s, is at most a tenth too small.
         s = -many/real(media(j, 1)%mean)
         compliance%range(j) = -0.5_wp*log(precision) &
            & /(-log(maxval(abs(exponential(media(j, 1), s))))/s*layers%thickness(1))
         compliance%wave_number(:, j) = compliance%range(j)*x**2
         base = 0.0_wp
         if (size(media, 2) > size(layers%thickness)) base = inverse(media(j, size(media, 2))%z)
         call join_layers(media(j, :), compliance%wave_number(:, j), compliance%short(j), &
            & compliance%change(:, j))
      end do

   contains

      !> f of the layers in one direction.
      pure subroutine join_layers(media, wave_number, short, change)
         type(medium_type), intent(in) :: media(:)
         real(wp), intent(in) :: wave_number(0:)
         real(wp), intent(out) :: short, change(0:)
         complex(wp), dimension(3, 3) :: below, reflection, bottom, returned, e, y, outer
         integer :: k, layer

         y = inverse(media(1)%z)
         short = real(y(3, 3))
         outer = identity + matmul(y, conjg(media(1)%z))
         associate (thickness => layers%thickness)
            bottom = reflect(media(size(thickness))%z, base)
            do k = 0, n
               below = base
               do layer = size(thickness), 1, -1
                  associate (z => media(layer)%z)
                     reflection = bottom
                     if (layer < size(thickness)) reflection = reflect(z, below)
                     e = exponential(media(layer), wave_number(k)*thickness(layer))
                     returned = matmul(conjg(e), matmul(reflection, e))
                     y = inverse(z - matmul(conjg(z), returned))
                     if (layer > 1) below = matmul(identity + returned, y)
                  end associate
               end do
               change(k) = real(sum(matmul(outer(3, :), returned)*y(:, 3)))
            end do
         end associate
      end subroutine join_layers
   end subroutine new_compliance

   !> Weights of Clenshaw and Curtis on 0 .. 1, exact for polynomials of degree n, of the nodes
   !> sin^2(pi i/(2 n)), i = 0 .. n.
   pure function clenshaw_curtis(n) result(weight)
      !> Even.
      integer, intent(in) :: n
      real(wp) :: weight(0:n), cosine(0:n)
      integer :: i, k

      cosine = [(cos(2.0_wp*pi*i/n), i=0, n)]
      do i = 0, n
         weight(i) = 1.0_wp - cosine(mod(n/2*i, n))/(n**2 - 1.0_wp)
         do k = 1, n/2 - 1
            weight(i) = weight(i) - 2.0_wp*cosine(mod(k*i, n))/(4.0_wp*k**2 - 1.0_wp)
         end do
      end do
      weight(1:n - 1) = 2.0_wp*weight(1:n - 1)
      weight = weight/(2.0_wp*n)
   end function clenshaw_curtis

   !> Impedance and decay of a material in the directions of the grid.
   pure subroutine find_media(c, media)
      real(wp), intent(in) :: c(6, 6)
      type(medium_type), intent(out) :: media(:)
      !> Component of a symmetric matrix at each place.
      integer, parameter :: component(9) = [1, 6, 5, 6, 2, 4, 5, 4, 3]
      real(wp), dimension(lanes, 6) :: mm, nn, d, e, stroh_d, inverse_d
      real(wp), dimension(lanes, 9) :: mn, a, stroh_a
      complex(wp) :: m(3, 3)
      integer :: done, i

      do done = 0, size(media) - lanes, lanes
         call surface_contractions(c, done, mm, mn, nn)
         call barnett_blocks(mm, mn, nn, a, d, e)
         call invert(d, inverse_d)
         call invert(nn, stroh_d)
         call multiply(stroh_d, mn(:, transposed), stroh_a)
         do i = 1, lanes
            associate (medium => media(done + i))
               medium%z = matmul(reshape(inverse_d(i, component), [3, 3]), &
                  & identity + i_unit*reshape(a(i, :), [3, 3]))
               medium%z = 0.5_wp*(medium%z + conjg(transpose(medium%z)))
               m = -matmul(reshape(stroh_d(i, component), [3, 3]), medium%z) &
                  & - i_unit*reshape(stroh_a(i, :), [3, 3])
               medium%mean = (m(1, 1) + m(2, 2) + m(3, 3))/3.0_wp
               m = m - medium%mean*identity
               medium%deviator = m
               medium%square = matmul(m, m)
               medium%e2 = -0.5_wp*(medium%square(1, 1) + medium%square(2, 2) &
                  & + medium%square(3, 3))
               medium%e3 = sum(m*transpose(medium%square))/3.0_wp
               medium%size = 1.33_wp*max(sqrt(abs(medium%e2)), abs(medium%e3)**(1.0_wp/3.0_wp))
            end associate
         end do
      end do
   end subroutine find_media

   !> Growing displacement at the bottom of a layer from the decaying one.
   pure function reflect(z, compliance) result(reflection)
      complex(wp), intent(in) :: z(3, 3), compliance(3, 3)
      complex(wp) :: reflection(3, 3), sum_inverse(3, 3)

      sum_inverse = inverse(identity + matmul(compliance, conjg(z)))
      reflection = matmul(sum_inverse, matmul(compliance, z)) - sum_inverse
   end function reflect

   !> exp(M s).
   pure function exponential(medium, s) result(e)
      type(medium_type), intent(in) :: medium
      real(wp), intent(in) :: s
      complex(wp) :: e(3, 3)
      !> Terms of the series where the roots are below 1; the first neglected one is 1e-15.
      integer, parameter :: terms = 17
      complex(wp) :: p(0:2), x(0:2), high
      real(wp) :: z, factor
      integer :: k, doublings

      doublings = max(0, exponent(s*medium%size))
      z = s/2.0_wp**doublings
      p = [one, z*one, 0.5_wp*z**2*one]
      x = [0*one, 0*one, one]
      factor = 0.5_wp*z**2
      do k = 3, terms
         x = [medium%e3*x(2), x(0) - medium%e2*x(2), x(1)]
         factor = factor*z/k
         p = p + factor*x
      end do
      p = exp(medium%mean*z)*p
      do k = 1, doublings
         high = 2.0_wp*p(1)*p(2)
         x = [p(0)**2, 2.0_wp*p(0)*p(1), 2.0_wp*p(0)*p(2) + p(1)**2]
         p = [x(0) + medium%e3*high, x(1) - medium%e2*high + medium%e3*p(2)**2, &
            & x(2) - medium%e2*p(2)**2]
      end do
      e = p(0)*identity + p(1)*medium%deviator + p(2)*medium%square
   end function exponential

   !> Inverse of a matrix `m` of three rows, by cross products of them.
   pure function inverse(m)
      complex(wp), intent(in) :: m(3, 3)
      complex(wp) :: inverse(3, 3)
      integer, parameter :: next(3) = [2, 3, 1], last(3) = [3, 1, 2]
      integer :: i

      do i = 1, 3
         inverse(:, i) = m(next(i), next)*m(last(i), last) - m(next(i), last)*m(last(i), next)
      end do
      inverse = inverse/sum(m(1, :)*inverse(:, 1))
   end function inverse
end module layered_compliance
