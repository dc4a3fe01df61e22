!> Elements, mesh, sparse solver and contact against what they must reproduce exactly.
program test_fe
   use, intrinsic :: iso_c_binding, only: c_ptr
   use errors, only: error_type
   use fe_assembly, only: assemble, assembly_type, new_assembly
   use fe_grid, only: contact_residual, solve_contact
   use fe_element, only: brick_full, brick_incompatible, brick_selective, brick_stiffness, &
      & brick_strain, infinite_stiffness
   use fe_mesh, only: mesh_type, new_mesh
   use kinds, only: pi, wp
   use linear_algebra, only: cholesky_factor, symmetric_eigen
   use basic_specimen, only: layers_of_ratio, mesh_plan_type, mesh_stage_type
   use random, only: new_random_stream, random_stream_type
   use sparse_cholesky, only: acquire_factor, analyse_pattern, cholesky_type, factorise, &
      & free_analysis, release_factor, retained_factor, solve_factored
   use testing, only: check, check_close, check_refused, check_success, finish, stiffness_of
   use text, only: to_text
   implicit none

   integer, parameter :: formulations(3) = [brick_full, brick_selective, brick_incompatible]
   character(len=*), &
      & parameter :: names(3) = ['c3d8, full     ', 'c3d8, selective', 'c3d8i          ']
   real(wp), parameter :: cube(3, 8) = reshape([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, &
      & 1, 1, 1, 1, 0, 1, 1], [3, 8])
   !> An isotropic half-space under a point load.
   real(wp), parameter :: mu = 60.0_wp, nu = 0.3_wp, load = 1.0_wp

   call test_brick()
   call test_mesh_patch()
   call test_infinite()
   call test_cholesky()
   call test_contact()
   call finish()

contains

   !> A positive definite stiffness without any symmetry, GPa.
   function triclinic() result(c)
      real(wp) :: c(6, 6)
      type(random_stream_type) :: stream
      real(wp) :: a(6, 6)
      integer :: i, j

      stream = new_random_stream(3, 1)
      do j = 1, 6
         do i = 1, 6
            call stream%normal(a(i, j))
         end do
      end do
      c = 10.0_wp*matmul(a, transpose(a))
      do i = 1, 6
         c(i, i) = c(i, i) + 50.0_wp
      end do
   end function triclinic

   function distorted() result(x)
      real(wp) :: x(3, 8)
      type(random_stream_type) :: stream
      real(wp) :: shift
      integer :: i, a

      stream = new_random_stream(5, 1)
      do a = 1, 8
         do i = 1, 3
            call stream%uniform(shift)
            x(i, a) = 1.5_wp*cube(i, a) + 0.5_wp*(shift - 0.5_wp)
         end do
      end do
   end function distorted

   !> Exact on linear displacement, six rigid modes and no more, positive semidefinite.
   subroutine test_brick()
      real(wp) :: x(3, 8), c(6, 6), k(24, 24), u(3, 8), gradient(3, 3), strain(6), stress(6), &
         & f(24), values(24)
      real(wp) :: b(6, 33, 8), volume(8), expected(24), modes(24, 24)
      type(error_type), allocatable :: error
      logical :: valid
      integer :: i, q

      x = distorted()
      c = triclinic()
      gradient = reshape([0.3_wp, -0.2_wp, 0.5_wp, 0.1_wp, 0.7_wp, -0.4_wp, 0.2_wp, 0.6_wp, &
         & -0.1_wp], [3, 3])
      u = matmul(gradient, x)
      strain = [gradient(1, 1), gradient(2, 2), gradient(3, 3), gradient(2, 3) + gradient(3, 2), &
         & gradient(1, 3) + gradient(3, 1), gradient(1, 2) + gradient(2, 1)]
      stress = matmul(c, strain)
      call brick_strain(x, brick_full, 1.0_wp, b, volume)
      expected = 0.0_wp
      do q = 1, 8
         expected = expected + volume(q)*matmul(transpose(b(:, :24, q)), stress)
      end do
      do i = 1, 3
         call brick_stiffness(x, c, formulations(i), 1.0_wp, k, valid)
         call check('a distorted brick is valid: '//names(i), valid)
         f = matmul(k, reshape(u, [24]))
         ! Rounding: 24 products of stiffness 1e2 GPa times size.
         call check('patch test of one distorted brick: '//names(i), &
            & maxval(abs(f - expected)) < 1.0e-11_wp, to_text(maxval(abs(f - expected))))
         modes = k
         call symmetric_eigen(modes, values, error)
         call check('six rigid modes: '//names(i), all(abs(values(:6)) < 1.0e-10_wp*values(24)) &
            & .and. values(7) > 1.0e-4_wp*values(24), to_text(values(6))//' '//to_text(values(7)))
      end do
      x(:, 7) = [-1.0_wp, -1.0_wp, -1.0_wp]
      call brick_stiffness(x, c, brick_full, 1.0_wp, k, valid)
      call check('a brick turned inside out is not valid', .not. valid)
   end subroutine test_brick

   !> Small plans that take in all that the generator can do: layers and a coarser surface; a grain
   !> that is a ball.
   function small_plan(kind) result(plan)
      character(len=*), intent(in) :: kind
      type(mesh_plan_type) :: plan
      type(mesh_stage_type) :: stage

      plan%half_cells = 2
      plan%depth_cells = 2
      plan%half_width = 1.0_wp
      plan%depth = 0.9_wp
      plan%is_clamped = .true.
      stage = layers_of_ratio(1.69_wp, 1.3_wp, 1.0_wp)
      select case (kind)
      case ('layers')
         plan%stages = [stage, layers_of_ratio(1.6_wp, 1.6_wp, 1.0_wp)]
         plan%stages(2)%coarsen = .true.
      case default
         plan%stages = [stage, layers_of_ratio(1.6_wp, 1.6_wp, 1.0_wp)]
         plan%stages(1)%radius = 3.0_wp
         plan%stages(2)%material = 2
      end select
   end function small_plan

   !> Linear displacement is in equilibrium at all inner nodes of the meshes, hanging ones included,
   !> and materials fill what they should.
   subroutine test_mesh_patch()
      character(len=*), parameter :: kinds(2) = ['layers', 'ball  ']
      !> Of materials 1 and 2, um3.
      real(wp) :: expected(2)
      integer :: i

      do i = 1, size(kinds)
         select case (kinds(i))
         case ('layers')
            expected = [4.0_wp*0.9_wp*(1.69_wp*1.6_wp)**3, 0.0_wp]
         case default
            ! Of many flat facets it would be 2/3 pi R3.
            expected = 2.0_wp/3.0_wp*pi*27.0_wp*[1.0_wp, 1.6_wp**3 - 1.0_wp]
         end select
         call test_patch_of(trim(kinds(i)), expected)
      end do
   end subroutine test_mesh_patch

   subroutine test_patch_of(kind, expected)
      character(len=*), intent(in) :: kind
      real(wp), intent(in) :: expected(2)
      type(mesh_type) :: mesh
      type(assembly_type) :: assembly
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:), u(:), f(:)
      real(wp) :: gradient(3, 3), c(6, 6, 2), b(6, 33, 8), corner_volume(8), volume(2), &
         & worst, tolerance
      integer :: i, j, p, e, r
      logical, allocatable :: outside(:)

      call new_mesh(small_plan(kind), mesh, error)
      call check_success('a mesh with hanging nodes: '//kind, error)
      deallocate (mesh%clamped)
      allocate (mesh%clamped(0))
      volume = 0.0_wp
      do e = 1, size(mesh%brick, 2)
         call brick_strain(mesh%x(:, mesh%brick(:, e)), brick_full, 1.0_wp, b, corner_volume)
         volume(mesh%material(e)) = volume(mesh%material(e)) + sum(corner_volume)
      end do
      tolerance = 1.0e-12_wp
      if (kind == 'ball') tolerance = 0.12_wp
      call check('bricks fill the volumes of the materials: '//kind, &
         & all(abs(volume - expected) <= tolerance*(1.0_wp + expected)), to_text(volume(1))//' ' &
         & //to_text(volume(2))//' for '//to_text(expected(1))//' '//to_text(expected(2)))
      call new_assembly(mesh, assembly)
      c = spread(triclinic(), 3, 2)
      gradient = reshape([0.3_wp, -0.2_wp, 0.5_wp, 0.1_wp, 0.7_wp, -0.4_wp, 0.2_wp, 0.6_wp, &
         & -0.1_wp], [3, 3])
      allocate (u(assembly%unknowns), f(assembly%unknowns), outside(assembly%unknowns))
      outside = .false.
      do i = 1, size(mesh%x, 2)
         do j = 1, 3
            r = assembly%unknown(j, i)
            if (r == 0) cycle
            u(r) = sum(gradient(j, :)*mesh%x(:, i))
            outside(r) = mesh%x(3, i) > -1.0e-12_wp .or. any(i == outermost(mesh))
         end do
      end do
      ! Layers that interpolate by 1/rho carry the field of a force, not a uniform one.
      mesh%growth = 1.0_wp
      do p = 1, 3
         values = 0.0_wp*assembly%row
         call assemble(mesh, assembly, formulations(p), c, values, error)
         call check_success('values: '//names(p), error)
         f = 0.0_wp
         do j = 1, assembly%unknowns
            do i = assembly%column_start(j), assembly%column_start(j + 1) - 1
               r = assembly%row(i)
               f(r) = f(r) + values(i)*u(j)
               if (r /= j) f(j) = f(j) + values(i)*u(r)
            end do
         end do
         worst = maxval(abs(f), mask=.not. outside)/maxval(abs(f))
         call check('patch test of the mesh: '//kind//', '//names(p), &
            & worst < 1.0e-13_wp .and. count(.not. outside) > 30, to_text(worst))
      end do
   end subroutine test_patch_of

   !> Nodes of the outer faces of the last layer, which has as many facets as the last bricks have
   !> in common with no other.
   function outermost(mesh) result(node)
      type(mesh_type), intent(in) :: mesh
      integer, allocatable :: node(:)
      logical :: inner(size(mesh%x, 2)), outer(size(mesh%x, 2))
      integer :: e, i

      inner = .false.
      outer = .false.
      do e = 1, size(mesh%brick, 2)
         inner(mesh%brick(:4, e)) = .true.
         if (mesh%growth(e) > 1.0_wp) outer(mesh%brick(5:, e)) = .true.
      end do
      node = pack([(i, i=1, size(outer))], outer .and. .not. inner)
   end function outermost

   !> The energy outside a hemisphere under a point load on an isotropic half-space (Boussinesq's
   !> field, exactly 1/r), with the infinite elements carrying its nodal values.
   subroutine test_infinite()
      real(wp) :: c(6, 6), errors(2), exact
      integer :: i

      c = stiffness_of('cubic', &
         & 2.0_wp*mu*[(1.0_wp - nu)/(1.0_wp - 2.0_wp*nu), nu/(1.0_wp - 2.0_wp*nu), 0.5_wp])
      exact = exterior_energy()
      do i = 1, 2
         errors(i) = abs(infinite_energy(12*i, c)/exact - 1.0_wp)
      end do
      call check('infinite elements carry the field of a point load', errors(2) < 0.01_wp, &
         & to_text(errors(2)))
      call check_close('their error falls with the square of the facet', &
         & log(errors(1)/errors(2))/log(2.0_wp), 2.0_wp, 0.2_wp)
      do i = 1, 2
         errors(i) = abs(layer_energy(12*i, 1.5_wp, c)/(exact*(1.0_wp - 1.0_wp/1.5_wp)) - 1.0_wp)
      end do
      call check('so do bricks of a layer', errors(2) < 0.01_wp, to_text(errors(2)))
      call check_close('and so does theirs', log(errors(1)/errors(2))/log(2.0_wp), 2.0_wp, 0.2_wp)
   end subroutine test_infinite

   !> Displacement at x, |x| > 0, for a force `load` into the material; material at z < 0.
   pure function boussinesq(x) result(u)
      real(wp), intent(in) :: x(3)
      real(wp) :: u(3)
      real(wp) :: r, z

      r = norm2(x)
      z = -x(3)
      u(1:2) = load/(4.0_wp*pi*mu)*x(1:2)*(z/r**3 - (1.0_wp - 2.0_wp*nu)/(r*(r + z)))
      u(3) = -load/(4.0_wp*pi*mu)*(z**2/r**3 + 2.0_wp*(1.0_wp - nu)/r)
   end function boussinesq

   !> Twice the strain energy outside the unit hemisphere: the work of tractions -sigma_rr, which
   !> are radial under a point load, integrated with Gauss-like midpoints in cos(theta).
   real(wp) function exterior_energy()
      integer, parameter :: n = 4000
      real(wp) :: z, x(3)
      integer :: i

      exterior_energy = 0.0_wp
      do i = 1, n
         z = (i - 0.5_wp)/n
         x = [sqrt(1.0_wp - z*z), 0.0_wp, -z]
         exterior_energy = exterior_energy + 2.0_wp*pi/n*dot_product(traction(x), boussinesq(x))
      end do
   end function exterior_energy

   !> Traction on the sphere from inside, by differences of the displacement.
   function traction(x) result(t)
      real(wp), intent(in) :: x(3)
      real(wp) :: t(3), gradient(3, 3), sigma(3, 3), step, lambda
      integer :: j
      real(wp) :: e(3)

      step = 1.0e-5_wp
      do j = 1, 3
         e = 0.0_wp
         e(j) = step
         gradient(:, j) = (boussinesq(x + e) - boussinesq(x - e))/(2.0_wp*step)
      end do
      lambda = 2.0_wp*mu*nu/(1.0_wp - 2.0_wp*nu)
      sigma = mu*(gradient + transpose(gradient))
      do j = 1, 3
         sigma(j, j) = sigma(j, j) + lambda*(gradient(1, 1) + gradient(2, 2) + gradient(3, 3))
      end do
      t = -matmul(sigma, x)
   end function traction

   !> uᵀ K u of infinite elements on a hemisphere of n x 2n facets, nodes at the exact displacement.
   real(wp) function infinite_energy(n, c) result(energy)
      integer, intent(in) :: n
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: x(3, 4), k(12, 12), u(12)
      integer :: i, j, a

      energy = 0.0_wp
      do j = 1, 4*n
         do i = 1, n
            x(:, 1) = point(i - 1, j - 1, n)
            x(:, 2) = point(i, j - 1, n)
            x(:, 3) = point(i, j, n)
            x(:, 4) = point(i - 1, j, n)
            call infinite_stiffness(x, c, k)
            do a = 1, 4
               u(3*a - 2:3*a) = boussinesq(x(:, a))
            end do
            energy = energy + dot_product(u, matmul(k, u))
         end do
      end do
   end function infinite_energy

   !> uᵀ K u of bricks between that hemisphere and one `growth` times as large, nodes at the exact
   !> displacement.
   real(wp) function layer_energy(n, growth, c) result(energy)
      integer, intent(in) :: n
      real(wp), intent(in) :: growth, c(6, 6)
      real(wp) :: x(3, 8), k(24, 24), u(24)
      logical :: valid
      integer :: i, j, a

      energy = 0.0_wp
      do j = 1, 4*n
         do i = 1, n
            x(:, 1) = point(i - 1, j - 1, n)
            x(:, 2) = point(i - 1, j, n)
            x(:, 3) = point(i, j, n)
            x(:, 4) = point(i, j - 1, n)
            x(:, 5:) = growth*x(:, :4)
            call brick_stiffness(x, c, brick_incompatible, growth, k, valid)
            do a = 1, 8
               u(3*a - 2:3*a) = boussinesq(x(:, a))
            end do
            energy = energy + dot_product(u, matmul(k, u))
         end do
      end do
   end function layer_energy

   pure function point(i, j, n) result(x)
      integer, intent(in) :: i, j, n
      real(wp) :: x(3)
      real(wp) :: theta, phi

      theta = 0.5_wp*pi*i/n
      phi = 0.5_wp*pi*j/n
      x = [sin(theta)*cos(phi), sin(theta)*sin(phi), -cos(theta)]
   end function point

   !> Factor, solution and Schur complement of a random sparse matrix against dense LAPACK; an
   !> indefinite one is refused.
   subroutine test_cholesky()
      integer, parameter :: n = 240, retained = 17
      real(wp) :: dense(n, n), lower(n, n), x(n, 2), b(n, 2), schur(retained, retained), value
      integer :: start(n + 1), group(n), i, j, p
      integer, allocatable :: row(:)
      real(wp), allocatable :: values(:)
      type(cholesky_type) :: cholesky
      type(c_ptr) :: factor
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream

      stream = new_random_stream(7, 1)
      dense = 0.0_wp
      do j = 1, n
         do i = j + 1, n
            call stream%uniform(value)
            if (value > 0.03_wp .and. i - j > 2) cycle
            call stream%normal(dense(i, j))
            dense(j, i) = dense(i, j)
         end do
      end do
      do i = 1, n
         dense(i, i) = 1.0_wp + sum(abs(dense(:, i)))
      end do
      allocate (row(0), values(0))
      do j = 1, n
         start(j) = size(row) + 1
         do i = j, n
            if (abs(dense(i, j)) > 0.0_wp) then
               row = [row, i]
               values = [values, dense(i, j)]
            end if
         end do
         group(j) = (j + 2)/3
      end do
      start(n + 1) = size(row) + 1
      call analyse_pattern(start, row, group, retained, cholesky, error)
      call check_success('analysis of a random pattern', error)
      call acquire_factor(cholesky, factor, error)
      call factorise(cholesky, factor, values, error)
      call check_success('factorisation', error)
      do j = 1, 2
         do i = 1, n
            call stream%normal(x(i, j))
         end do
      end do
      b = matmul(dense, x)
      call solve_factored(cholesky%handle, factor, 2, b)
      ! The factor is of single precision.
      call check('solution of two right-hand sides', maxval(abs(b - x)) < 1.0e-5_wp, &
         & to_text(maxval(abs(b - x))))
      call retained_factor(cholesky%handle, factor, schur)
      lower = dense
      call cholesky_factor(lower, error)
      do j = 1, retained
         do i = 1, j - 1
            lower(n - retained + i, n - retained + j) = 0.0_wp
         end do
      end do
      value = maxval(abs(schur - lower(n - retained + 1:, n - retained + 1:)))
      call check('factor of the Schur complement of the retained unknowns', &
         & value < 1.0e-5_wp*maxval(dense), to_text(value))
      p = start(100)
      values(p) = -1.0_wp
      call factorise(cholesky, factor, values, error)
      call check_refused('an indefinite matrix', error, &
         & 'not positive definite (unknown 100 of 240)')
      values(p) = dense(100, 100)
      call factorise(cholesky, factor, values, error)
      call check_success('the workspace is good again after a refusal', error)
      values(start(50)) = sqrt(-abs(values(start(50))))
      call factorise(cholesky, factor, values, error)
      call check_refused('a matrix with NaN', error, 'not positive definite')
      call release_factor(cholesky%handle, factor)
      call free_analysis(cholesky)
   end subroutine test_cholesky

   !> A random complementarity problem against its definition.
   subroutine test_contact()
      integer, parameter :: n = 60
      real(wp) :: a(n, n), f(n, n), gap(n), force(n)
      logical :: active(n)
      type(error_type), allocatable :: error
      type(random_stream_type) :: stream
      integer :: i, j

      stream = new_random_stream(11, 1)
      do j = 1, n
         call stream%uniform(gap(j))
         do i = 1, n
            call stream%normal(a(i, j))
         end do
      end do
      f = matmul(a, transpose(a))
      active = .true.
      call solve_contact(f, gap, 0.5_wp, active, force, error)
      call check_success('contact with a random compliance', error)
      call check('contact conditions', contact_residual(f, gap, 0.5_wp, force) < 1.0e-10_wp, &
         & to_text(contact_residual(f, gap, 0.5_wp, force)))
      call check('some nodes touch', count(force > 0.0_wp) > 5 .and. count(force > 0.0_wp) < n)
   end subroutine test_contact

end program test_fe
