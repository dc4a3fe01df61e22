!> Indentation moduli of many grains of one crystal: the surface compliance in every orientation
!> follows from one field over directions.
!>
!> The matrix B of the half-space theory depends on the direction t in the surface alone, not on the
!> surface. So F(t) = B^-1(t)/(8 pi^2) of a crystal is one even field of symmetric matrices over the
!> directions, with the crystal's symmetry. Every grain needs it along its own great circle:
!> h(theta) = n.F(t(theta)).n, with n its surface normal. The field is expanded in surface harmonics
!> of even degree up to a limit, by least squares over nodes: all images, under the crystal's group,
!> of some directions of its region. Of h the mean and the harmonics 2 and 4 of theta are retained,
!> from degree 24 on also 6, from 32 on also 8: a contact of small eccentricity e weighs the
!> harmonic 2 m with e^m. Everything that depends on the grains alone is computed once. A crystal
!> then costs its nodes, one matrix product, and for each grain a minimum over the shape of the
!> contact ellipse (`contact_ellipse`).
!>
!> The moduli of very many grains follow from those in a few directions. The modulus depends on the
!> indented direction alone and is smooth: an even function on the sphere with the crystal's
!> symmetry, which few surface harmonics represent. Their coefficients follow by least squares from
!> the moduli in directions that are spread over the region of distinct ones. A grain then costs as
!> many products as there are harmonics. `field_reading` compares the moduli with the exact theory.
module compliance_field
   use contact_ellipse, only: highest_mode, minimise_compliance
   use halfspace_theory, only: contraction_maps, inverse_barnett, lanes, plane_products
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: rotation_matrix
   use distinct_directions, only: group_rotations, new_region, region_type, representative, &
      & spread_of_directions
   use errors, only: error_type
   use kinds, only: pi, wp
   use linear_algebra, only: cholesky_factor, cholesky_solve, gram_of, multiply, &
      & multiply_by_factor, transposed_product
   use small_matrices, only: solve_lower
   use symmetric_harmonics, only: evaluate_harmonics, evaluate_real, harmonics_type, &
      & largest_degree, n_real_harmonics, new_harmonics
   implicit none
   private
   public :: field_type, new_field, field_moduli, even_directions, modulus_expansion_type, &
      & new_modulus_expansion

   !> Least number of images of nodes for each coefficient of the expansion.
   real(wp), parameter :: oversampling = 1.4_wp
   !> Least accepted eigenvalue of the mean over the images of the products of two harmonics; over
   !> all directions every eigenvalue is 1.
   real(wp), parameter :: well_determined = 0.03_wp

   type :: field_type
      integer :: n_grains = 0
      !> Directions at which the field is computed, crystal axes (3, nodes).
      real(wp), allocatable :: nodes(:, :)
      !> Products of two directions m and n perpendicular to a node and to each other, in blocks of
      !> nodes: m_k n_l, l fastest, (lanes, 9, blocks), and m_k m_l and n_k n_l for kl = 11, 22, 33,
      !> 23, 13, 12, (lanes, 6, blocks).
      real(wp), allocatable, private :: mn(:, :, :), mm(:, :, :), nn(:, :, :)
      !> Map from F at the nodes (lanes, components 11, 22, 33, 23, 13, 12, blocks) to the modes of
      !> the grains, (6 x nodes, grains x modes).
      real(wp), allocatable, private :: to_modes(:, :)
      !> Greatest degree of the harmonics of the expansion, rotations of the group, (3, 3, m), and
      !> the matrix from values at all images of the nodes to coefficients of the harmonics,
      !> (harmonics, images), the images of a node one after another.
      integer :: degree = 0
      real(wp), allocatable, private :: rotations(:, :, :), fit(:, :)
   contains
      procedure :: set_grains => set_mode_map
   end type field_type

   !> Number of grains from which on an expansion over directions is considered.
   integer, parameter :: many_grains = 60
   !> Degree of this expansion above that of the compliance, which changes moduli by 4e-6 at most
   !> (docs/verification/theory.md); and directions for each harmonic.
   integer, parameter :: finer = 8
   real(wp), parameter :: directions_per_harmonic = 2.0_wp

   type :: modulus_expansion_type
      !> Whether the expansion is cheaper than a modulus for each grain. Only then the other
      !> components are set.
      logical :: is_used = .false.
      !> Degree of the harmonics of the compliance.
      integer :: degree = 0
      !> Approximate time of `expand`, microseconds.
      real(wp) :: cost = 0.0_wp
      type(harmonics_type), private :: harmonics
      !> Bunge-Euler angles of the directions whose moduli are computed, (3, direction), radians.
      real(wp), allocatable :: euler(:, :)
      !> Maps from their moduli to coefficients, (harmonic, direction), and from these to moduli of
      !> the grains, (grain, harmonic).
      real(wp), allocatable, private :: to_coefficients(:, :), to_grains(:, :)
   contains
      procedure :: set_grains, expand, condense
   end type modulus_expansion_type

contains

   !> Set up the field of a crystal class, expanded to a degree, for some grains.
   subroutine new_field(class, degree, euler, field, error)
      type(crystal_class_type), intent(in) :: class
      !> Highest degree of the harmonics, even, up to `largest_degree`.
      integer, intent(in) :: degree
      !> Bunge-Euler angles, radians (3, n).
      real(wp), intent(in) :: euler(:, :)
      type(field_type), intent(out) :: field
      type(error_type), allocatable, intent(out) :: error
      type(region_type) :: region
      real(wp) :: least_nodes
      !> Whether the coefficients are well determined, see `well_determined`.
      logical :: is_good

      call new_region(class, region)
      field%degree = degree
      field%rotations = group_rotations(class, 2*degree + 2)
      least_nodes = oversampling*n_real_harmonics(degree)/size(field%rotations, 3)
      do
         call even_directions(region, degree/2 + 3, least_nodes, field%nodes)
         call fit_images(field%rotations, field%fit)
         if (allocated(error)) return
         if (is_good) exit
         least_nodes = size(field%nodes, 2) + 0.5_wp
      end do
      call set_planes(field)
      call field%set_grains(euler)

   contains

      !> Least squares: the matrix from values at all images of the nodes to coefficients of the
      !> harmonics.
      subroutine fit_images(rotations, fit)
         real(wp), intent(in) :: rotations(:, :, :)
         real(wp), allocatable, intent(out) :: fit(:, :)
         type(error_type), allocatable :: indefinite
         real(wp), allocatable :: gram(:, :), shifted(:, :)
         integer :: g, i, image

         allocate (fit(n_real_harmonics(degree), size(field%nodes, 2)*size(rotations, 3)))
         image = 0
         do i = 1, size(field%nodes, 2)
            do g = 1, size(rotations, 3)
               image = image + 1
               call evaluate_real(degree, matmul(rotations(:, :, g), field%nodes(:, i)), &
                  & fit(:, image))
            end do
         end do
         gram = gram_of(fit)
         ! The shifted matrix is positive definite if the least eigenvalue is above the limit.
         shifted = gram/image
         do i = 1, size(gram, 1)
            shifted(i, i) = shifted(i, i) - well_determined
         end do
         call cholesky_factor(shifted, indefinite)
         is_good = .not. allocated(indefinite)
         if (.not. is_good) return
         call cholesky_factor(gram, error)
         if (allocated(error)) return
         call cholesky_solve(gram, fit)
      end subroutine fit_images
   end subroutine new_field

   !> Set the map from F at the nodes to the modes of each grain: the harmonics of n.F(t).n along
   !> its great circle.
   subroutine set_mode_map(field, euler)
      class(field_type), intent(inout) :: field
      !> Bunge-Euler angles, radians (3, n).
      real(wp), intent(in) :: euler(:, :)
      !> Grains whose weights are computed together.
      integer, parameter :: block = 16
      !> Values of the harmonics on the circle, (harmonic, point); modes of each point, (point,
      !> mode); modes of each harmonic, (harmonic, mode, grain of the block), and of each image.
      real(wp), allocatable :: circle(:, :), waves(:, :), modes(:, :, :), weight(:, :)
      !> What F at each image contributes, (component, rotation), in each grain of the block.
      real(wp) :: squares(6, size(field%rotations, 3), block)
      real(wp) :: g(3, 3), theta(field%degree/2 + 4), turned(3)
      integer :: first, last, grain, i, k, m, n, row, n_points, n_retained, n_rotations, place

      if (allocated(field%to_modes)) deallocate (field%to_modes)
      field%n_grains = size(euler, 2)
      n_retained = 1 + 2*max(2, min(highest_mode, field%degree/8))
      n_rotations = size(field%rotations, 3)
      ! On a circle a polynomial of degree L has L/2 harmonics of 2 theta. This number of points
      ! integrates the modes exactly.
      n_points = size(theta)
      theta = [(pi*(k - 1)/n_points, k=1, n_points)]
      allocate (field%to_modes(size(field%mm), field%n_grains*n_retained), source=0.0_wp)
      allocate (circle(size(field%fit, 1), n_points), waves(n_points, n_retained))
      do k = 1, n_points
         waves(k, :) = [0.5_wp, (cos(2.0_wp*m*theta(k)), sin(2.0_wp*m*theta(k)), &
            & m=1, n_retained/2)]*2.0_wp/n_points
      end do
      allocate (modes(size(field%fit, 1), n_retained, block))
      allocate (weight(size(field%fit, 2), n_retained*block))
      do first = 1, field%n_grains, block
         last = min(field%n_grains, first + block - 1)
         n = last - first + 1
         do grain = first, last
            g = rotation_matrix(euler(:, grain))
            do k = 1, n_points
               call evaluate_real(field%degree, g(:, 1)*cos(theta(k)) + g(:, 2)*sin(theta(k)), &
                  & circle(:, k))
            end do
            call multiply(circle, waves, modes(:, :, grain - first + 1))
            do k = 1, n_rotations
               ! F at an image is R F R^T, so n.(R F R^T).n = (R^T n).F.(R^T n).
               turned = matmul(g(:, 3), field%rotations(:, :, k))
               squares(:, k, grain - first + 1) = [turned**2, 2.0_wp*turned(2)*turned(3), &
                  & 2.0_wp*turned(1)*turned(3), 2.0_wp*turned(1)*turned(2)]
            end do
         end do
         call multiply(field%fit, reshape(modes(:, :, :n), [size(modes, 1), n_retained*n]), &
            & weight(:, :n_retained*n), transposed=.true.)
         do grain = first, last
            do m = 1, n_retained
               row = grain + field%n_grains*(m - 1)
               associate (of_images => weight(:, m + n_retained*(grain - first)))
                  do i = 1, size(field%nodes, 2)
                     place = 1 + mod(i - 1, lanes) + 6*lanes*((i - 1)/lanes)
                     field%to_modes(place:place + 5*lanes:lanes, row) = matmul( &
                        & squares(:, :, grain - first + 1), &
                        & of_images((i - 1)*n_rotations + 1:i*n_rotations))
                  end do
               end associate
            end do
         end do
      end do
   end subroutine set_mode_map

   !> Choose two directions perpendicular to each node and compute their products. The last block
   !> is filled up with its last node.
   pure subroutine set_planes(field)
      type(field_type), intent(inout) :: field
      real(wp) :: t(3), m(3), n(3)
      integer :: n_nodes, n_blocks, block, lane

      n_nodes = size(field%nodes, 2)
      n_blocks = (n_nodes + lanes - 1)/lanes
      allocate (field%mn(lanes, 9, n_blocks), field%mm(lanes, 6, n_blocks), &
         & field%nn(lanes, 6, n_blocks))
      do block = 1, n_blocks
         do lane = 1, lanes
            t = field%nodes(:, min(n_nodes, lanes*(block - 1) + lane))
            ! Start from the coordinate axis that is farthest from t.
            m = 0.0_wp
            m(minloc(abs(t), 1)) = 1.0_wp
            m = m - dot_product(m, t)*t
            m = m/norm2(m)
            n = [t(2)*m(3) - t(3)*m(2), t(3)*m(1) - t(1)*m(3), t(1)*m(2) - t(2)*m(1)]
            call plane_products(m, n, field%mn(lane, :, block), field%mm(lane, :, block), &
               & field%nn(lane, :, block))
         end do
      end do
   end subroutine set_planes

   !> Directions spread evenly over the area of a region. A region that is an arc has them at equal
   !> angles, with none at its ends.
   pure subroutine even_directions(region, on_arc, least, nodes)
      type(region_type), intent(in) :: region
      !> Number of directions on an arc.
      integer, intent(in) :: on_arc
      !> Least number of directions on an area.
      real(wp), intent(in) :: least
      !> Unit vectors in crystal axes, (3, n).
      real(wp), allocatable, intent(out) :: nodes(:, :)
      !> Successive points of the spiral turn by the golden angle.
      real(wp), parameter :: turn = pi*(3.0_wp - sqrt(5.0_wp))
      real(wp) :: x(3), z
      integer :: total, i, n

      if (region%dimension < 2) then
         allocate (nodes(3, on_arc))
         do i = 1, on_arc
            z = 0.5_wp*pi*(i - 0.5_wp)/on_arc
            nodes(:, i) = cos(z)*region%axis + sin(z)*region%equator
         end do
         return
      end if
      total = 16
      do
         total = total + total/8
         n = 0
         nodes = reshape([real(wp) ::], [3, total], [0.0_wp])
         do i = 1, total
            z = 1.0_wp - (2.0_wp*i - 1.0_wp)/total
            x = [sqrt(1.0_wp - z**2)*cos(turn*i), sqrt(1.0_wp - z**2)*sin(turn*i), z]
            if (maxval(abs(representative(region, x) - x)) > 1.0e-6_wp) cycle
            n = n + 1
            nodes(:, n) = x
         end do
         if (n >= least) exit
      end do
      nodes = nodes(:, :n)
   end subroutine even_directions

   !> Indentation moduli (GPa) of all grains, for stable crystals c.
   pure subroutine field_moduli(field, c, moduli)
      type(field_type), intent(in) :: field
      !> Stiffnesses `c` in crystal axes, GPa, (6, 6, crystal).
      real(wp), intent(in), contiguous :: c(:, :, :)
      !> (grain, crystal)
      real(wp), intent(out), contiguous :: moduli(:, :)
      !> Crystals of one block: their values at the nodes and modes fit into the caches.
      integer, parameter :: block_size = 32
      !> Allocatable, since they are too large for the stack of a thread if there are many grains.
      real(wp), allocatable :: f(:, :), modes(:, :)
      integer :: first, n, n_retained, i

      if (field%n_grains == 0) return
      allocate (f(size(field%to_modes, 1), min(block_size, size(c, 3))), &
         & modes(size(field%to_modes, 2), min(block_size, size(c, 3))))
      n_retained = size(modes, 1)/field%n_grains
      do first = 1, size(c, 3), block_size
         n = min(block_size, size(c, 3) - first + 1)
         do i = 1, n
            call evaluate_nodes(field, c(:, :, first + i - 1), f(:, i))
         end do
         if (n > 1) call multiply(field%to_modes, f(:, :n), modes(:, :n), transposed=.true.)
         if (n == 1) then
            call transposed_product(field%to_modes, f(:, 1), modes(:, 1))
         end if
         do i = 1, n
            call minimise_compliance(field%n_grains, n_retained, modes(:, i), &
               & moduli(:, first + i - 1))
         end do
      end do
   end subroutine field_moduli

   !> F at the nodes.
   pure subroutine evaluate_nodes(field, c, f)
      type(field_type), intent(in) :: field
      !> Stiffness in crystal axes, GPa.
      real(wp), intent(in) :: c(6, 6)
      !> In the layout of `to_modes`.
      real(wp), intent(out) :: f(lanes, 6, size(field%mm, 3))
      real(wp) :: map_mn(9, 9), map_mm(6, 6), mm(lanes, 6), mn(lanes, 9), nn(lanes, 6)
      integer :: block

      call contraction_maps(c, map_mn, map_mm)
      do block = 1, size(field%mn, 3)
         mm = product_of(6, field%mm(:, :, block), map_mm)
         mn = product_of(9, field%mn(:, :, block), map_mn)
         nn = product_of(6, field%nn(:, :, block), map_mm)
         call inverse_barnett(mm, mn, nn, f(:, :, block))
      end do

   contains

      !> Product of matrices whose rows are lanes with small square matrices.
      pure function product_of(n, a, b) result(product)
         integer, intent(in) :: n
         real(wp), intent(in) :: a(lanes, n), b(n, n)
         real(wp) :: product(lanes, n)
         integer :: j, k

         do j = 1, n
            product(:, j) = a(:, 1)*b(1, j)
            do k = 2, n
               product(:, j) = product(:, j) + a(:, k)*b(k, j)
            end do
         end do
      end function product_of
   end subroutine evaluate_nodes

   !> Set up the expansion for some grains, if it is cheaper.
   subroutine new_modulus_expansion(class, degree, euler, expansion, error)
      type(crystal_class_type), intent(in) :: class
      !> Degree of the harmonics of the compliance, even.
      integer, intent(in) :: degree
      !> Bunge-Euler angles of the grains, radians (3, n).
      real(wp), intent(in) :: euler(:, :)
      type(modulus_expansion_type), intent(out) :: expansion
      type(error_type), allocatable, intent(out) :: error
      type(region_type) :: region
      real(wp), allocatable :: directions(:, :), values(:, :), gram(:, :)
      integer :: i, n, n_directions

      n = size(euler, 2)
      if (n < many_grains) return
      call new_harmonics(class%generators, min(largest_degree, degree + finer), &
         & expansion%harmonics, error)
      if (allocated(error)) return
      n_directions = ceiling(directions_per_harmonic*expansion%harmonics%n) + 8
      expansion%is_used = n > n_directions
      if (.not. expansion%is_used) return
      call new_region(class, region)
      call spread_of_directions(region, n_directions, directions)
      allocate (expansion%euler(3, size(directions, 2)), source=0.0_wp)
      allocate (values(expansion%harmonics%n, size(directions, 2)))
      do i = 1, size(directions, 2)
         ! phi1 stays 0: the indented direction, the third column of g, is (sin phi2 sin Phi, cos
         ! phi2 sin Phi, cos Phi).
         expansion%euler(2, i) = acos(min(1.0_wp, max(-1.0_wp, directions(3, i))))
         expansion%euler(3, i) = modulo(atan2(directions(1, i), directions(2, i)), 2.0_wp*pi)
         call evaluate_harmonics(expansion%harmonics, directions(:, i), values(:, i))
      end do
      gram = gram_of(values)
      call cholesky_factor(gram, error)
      if (allocated(error)) return
      call cholesky_solve(gram, values)
      call move_alloc(values, expansion%to_coefficients)
      expansion%degree = degree
      call expansion%set_grains(euler)
   end subroutine new_modulus_expansion

   !> Set the map to the moduli of grains.
   subroutine set_grains(self, euler)
      class(modulus_expansion_type), intent(inout) :: self
      !> Bunge-Euler angles of the grains, radians (3, n).
      real(wp), intent(in) :: euler(:, :)
      real(wp) :: g(3, 3)
      integer :: i

      if (allocated(self%to_grains)) deallocate (self%to_grains)
      allocate (self%to_grains(size(euler, 2), self%harmonics%n))
      do i = 1, size(euler, 2)
         g = rotation_matrix(euler(:, i))
         call evaluate_harmonics(self%harmonics, g(:, 3), self%to_grains(i, :))
      end do
      ! 0.2 ns for each multiplication and addition: about 10 Gflop/s.
      self%cost = 0.0002_wp*size(self%to_grains)
   end subroutine set_grains

   !> Replace the values of many grains by few condensed values: |values - W to_grains a|^2 =
   !> |condensed - to_grains' a|^2 + rest for all a, where to_grains' is the new map.
   subroutine condense(self, weights, values, condensed, rest)
      class(modulus_expansion_type), intent(inout) :: self
      !> Diagonal of W, (grain).
      real(wp), intent(in) :: weights(:), values(:)
      !> (harmonic). Unallocated without an expansion, or if the grains do not determine it.
      real(wp), allocatable, intent(out) :: condensed(:)
      real(wp), intent(out) :: rest
      type(error_type), allocatable :: error
      real(wp), allocatable :: weighted(:, :), gram(:, :)
      integer :: j, n

      rest = 0.0_wp
      if (.not. self%is_used) return
      n = size(self%to_grains, 2)
      weighted = self%to_grains*spread(weights, 2, n)
      gram = gram_of(weighted, transposed=.true.)
      call cholesky_factor(gram, error)
      if (allocated(error)) return
      condensed = matmul(values, weighted)
      call solve_lower(gram, condensed)
      rest = sum(values**2) - sum(condensed**2)
      self%to_grains = reshape([1.0_wp, (spread(0.0_wp, 1, n), 1.0_wp, j=2, n)], [n, n])
      call multiply_by_factor(gram, self%to_grains)
   end subroutine condense

   !> Moduli of the grains, or columns of a covariance, from those of the computed directions.
   !> Without an expansion the two are the same.
   pure subroutine expand(self, of_directions, of_grains)
      class(modulus_expansion_type), intent(in) :: self
      !> (direction, n).
      real(wp), intent(in), contiguous :: of_directions(:, :)
      !> (grain, n).
      real(wp), intent(out), contiguous :: of_grains(:, :)
      real(wp), allocatable :: coefficients(:, :)

      if (.not. self%is_used) then
         of_grains = of_directions
         return
      end if
      allocate (coefficients(size(self%to_coefficients, 1), size(of_directions, 2)))
      call multiply(self%to_coefficients, of_directions, coefficients)
      call multiply(self%to_grains, coefficients, of_grains)
   end subroutine expand

end module compliance_field
