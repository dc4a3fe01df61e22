!> From element stiffnesses to the sparse matrix of a mesh. The unknowns, the pattern and the places
!> of the entries are found once for a mesh, the values for each crystal.
module fe_assembly
   use errors, only: error_type, raise
   use fe_element, only: brick_own_strain, brick_stiffness, infinite_own_strain, infinite_stiffness
   use fe_mesh, only: mesh_type
   use kinds, only: wp
   use linear_algebra, only: multiply
   use statistics, only: sort_order
   use text, only: to_text
   implicit none
   private
   public :: assembly_type, new_assembly, assemble, expand_displacement, product_with, reaction, &
      & energy_by_stiffness

   !> The structure of the matrix. It does not change once made, so threads share it. Each free node
   !> has three unknowns, its displacements; the displacements normal to the contact surface come
   !> last.
   type :: assembly_type
      integer :: unknowns = 0, n_contact = 0
      !> Number of the unknown of each displacement component of each node, (3, nodes); 0 for
      !> clamped and hanging nodes.
      integer, allocatable :: unknown(:, :)
      !> Pattern of the lower triangle in compressed columns, 1-based; the rows of a column are not
      !> sorted.
      integer, allocatable :: column_start(:), row(:)
      !> Number of the free node of each unknown.
      integer, allocatable :: group(:)
      !> Elements are the bricks, then the infinite elements. The unknowns of element e are
      !> `dof_start(e)` to `dof_start(e+1)-1` of `dof`. `place` is the place of each entry of the
      !> elements' packed lower triangles among the values of the matrix; 0: the entry is dropped.
      integer, allocatable :: dof_start(:), dof(:), place(:)
      !> Number of each brick among those with hanging nodes, 0 for the others. Such a brick is
      !> expanded to the nodes on which its hanging nodes depend, with these weights (8, nodes of
      !> the expanded brick, brick).
      integer, allocatable :: constrained(:)
      real(wp), allocatable :: weight(:, :, :)
   end type assembly_type

   !> Most nodes of an expanded brick.
   integer, parameter :: most_nodes = 20
   integer :: r, c
   logical, parameter :: lower(3*most_nodes, 3*most_nodes) = &
      & reshape([((r >= c, r=1, 3*most_nodes), c=1, 3*most_nodes)], [3*most_nodes, 3*most_nodes])

contains

   subroutine new_assembly(mesh, assembly)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(out) :: assembly
      integer, allocatable :: hanging_index(:)
      logical, allocatable :: free(:)
      integer :: i, j, n, groups

      allocate (hanging_index(size(mesh%x, 2)), source=0)
      hanging_index(mesh%hanging) = [(i, i=1, size(mesh%hanging))]
      free = hanging_index == 0
      free(mesh%clamped) = .false.
      assembly%unknowns = 3*count(free)
      assembly%n_contact = size(mesh%contact)
      allocate (assembly%unknown(3, size(free)), assembly%group(assembly%unknowns), source=0)
      n = assembly%unknowns - assembly%n_contact
      assembly%unknown(3, mesh%contact) = [(n + i, i=1, assembly%n_contact)]
      n = 0
      groups = 0
      do i = 1, size(free)
         if (.not. free(i)) cycle
         do j = 1, 3
            if (assembly%unknown(j, i) > 0) cycle
            n = n + 1
            assembly%unknown(j, i) = n
         end do
         groups = groups + 1
         assembly%group(assembly%unknown(:, i)) = groups
      end do
      call list_dofs()
      call build_pattern(assembly)

   contains

      !> List the unknowns of each element. Bricks with hanging nodes are expanded to the nodes on
      !> which these depend.
      subroutine list_dofs()
         logical, allocatable :: has_hanging(:)
         integer, allocatable :: masters(:)
         integer :: e, a, m, k, h, n_bricks, n, node(most_nodes)

         n_bricks = size(mesh%brick, 2)
         has_hanging = [(any(hanging_index(mesh%brick(:, e)) > 0), e=1, n_bricks)]
         assembly%constrained = unpack([(e, e=1, count(has_hanging))], has_hanging, 0)
         allocate (assembly%weight(8, most_nodes, count(has_hanging)), source=0.0_wp)
         allocate (assembly%dof_start(n_bricks + size(mesh%facet, 2) + 1))
         allocate (assembly%dof(24*n_bricks + 12*size(mesh%facet, 2) &
            & + 3*(most_nodes - 8)*count(has_hanging)))
         assembly%dof_start(1) = 1
         do e = 1, size(assembly%dof_start) - 1
            n = 0
            if (e > n_bricks) then
               n = 4
               node(:4) = mesh%facet(:, e - n_bricks)
            else if (.not. has_hanging(e)) then
               n = 8
               node(:8) = mesh%brick(:, e)
            else
               do a = 1, 8
                  masters = mesh%brick(a:a, e)
                  h = hanging_index(mesh%brick(a, e))
                  if (h > 0) masters = pack(mesh%master(:, h), mesh%master(:, h) > 0)
                  do m = 1, size(masters)
                     do k = 1, n
                        if (node(k) == masters(m)) exit
                     end do
                     n = max(n, k)
                     node(k) = masters(m)
                     associate (weight => assembly%weight(a, k, assembly%constrained(e)))
                        weight = weight + 1.0_wp/size(masters)
                     end associate
                  end do
               end do
            end if
            assembly%dof_start(e + 1) = assembly%dof_start(e) + 3*n
            m = assembly%dof_start(e)
            assembly%dof(m:m + 3*n - 1) = reshape(assembly%unknown(:, node(:n)), [3*n])
         end do
      end subroutine list_dofs
   end subroutine new_assembly

   !> Find the rows of each column, and the places of the elements' entries.
   subroutine build_pattern(assembly)
      type(assembly_type), intent(inout) :: assembly
      !> The last place of each unknown in the list of dofs; for each place, the one before it of
      !> the same unknown (0: none); the element of each place.
      integer, allocatable :: last(:), previous(:), owner(:)
      !> Number of entries before those of each element; the entry of each row in the latest
      !> column that has one; rows of the entries.
      integer, allocatable :: entry_start(:), position(:), rows(:)
      integer :: elements, e, i, j, n, column, next, p, t

      elements = size(assembly%dof_start) - 1
      allocate (last(0:assembly%unknowns), entry_start(elements + 1), &
         & position(assembly%unknowns), source=0)
      allocate (previous(size(assembly%dof)), owner(size(assembly%dof)), &
         & assembly%column_start(assembly%unknowns + 1))
      do e = 1, elements
         do p = assembly%dof_start(e), assembly%dof_start(e + 1) - 1
            owner(p) = e
            previous(p) = last(assembly%dof(p))
            last(assembly%dof(p)) = p
         end do
         n = assembly%dof_start(e + 1) - assembly%dof_start(e)
         entry_start(e + 1) = entry_start(e) + (n*(n + 1))/2
      end do
      ! Upper bound: elements share entries.
      allocate (assembly%place(entry_start(elements + 1)), &
         & rows(entry_start(elements + 1)), source=0)
      next = 1
      do column = 1, assembly%unknowns
         assembly%column_start(column) = next
         t = last(column)
         do while (t > 0)
            e = owner(t)
            associate (dof => assembly%dof(assembly%dof_start(e):assembly%dof_start(e + 1) - 1))
               n = size(dof)
               j = t - assembly%dof_start(e) + 1
               do i = 1, n
                  if (dof(i) < column) cycle
                  if (position(dof(i)) < assembly%column_start(column)) then
                     position(dof(i)) = next
                     rows(next) = dof(i)
                     next = next + 1
                  end if
                  p = min(i, j)
                  p = entry_start(e) + ((p - 1)*(2*n - p))/2 + max(i, j)
                  assembly%place(p) = position(dof(i))
               end do
            end associate
            t = previous(t)
         end do
      end do
      assembly%column_start(assembly%unknowns + 1) = next
      assembly%row = rows(:next - 1)
   end subroutine build_pattern

   !> Compute the values of the matrix, in mN/um, for materials of stiffness `c`.
   subroutine assemble(mesh, assembly, formulation, c, values, error)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(in) :: assembly
      !> Formulation of the bricks (`fe_element`).
      integer, intent(in) :: formulation
      !> In the sample frame, GPa (6, 6, materials).
      real(wp), intent(in) :: c(:, :, :)
      !> In the order of `assembly%row`.
      real(wp), intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      !> Lower triangles, packed, of the bricks that represent a class, and of an element.
      real(wp), allocatable :: class_stiffness(:, :), packed(:)
      real(wp) :: k(24, 24), small(12, 12), scale
      logical :: valid
      integer :: e, i, n, p, n_bricks

      values = 0.0_wp
      allocate (class_stiffness(300, size(mesh%representative)))
      do i = 1, size(mesh%representative)
         e = mesh%representative(i)
         call brick_stiffness(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), formulation, &
            & mesh%growth(e), k, valid)
         if (.not. valid) then
            call raise(error, 'element '//to_text(e)//' of the mesh is turned inside out')
            return
         end if
         class_stiffness(:, i) = pack(k, lower(:24, :24))
      end do
      n_bricks = size(mesh%brick, 2)
      p = 0
      do e = 1, n_bricks + size(mesh%facet, 2)
         n = assembly%dof_start(e + 1) - assembly%dof_start(e)
         scale = 1.0_wp
         if (e > n_bricks) then
            i = e - n_bricks
            call infinite_stiffness(mesh%x(:, mesh%facet(:, i)), &
               & c(:, :, mesh%facet_material(i)), small)
            packed = pack(small, lower(:12, :12))
         else if (assembly%constrained(e) == 0) then
            packed = class_stiffness(:, mesh%class(e))
            scale = mesh%scale(e)
         else
            call brick_stiffness(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), &
               & formulation, mesh%growth(e), k, valid)
            packed = pack(expanded(k, assembly%weight(:, :n/3, assembly%constrained(e))), &
               & lower(:n, :n))
         end if
         do i = 1, size(packed)
            p = p + 1
            associate (place => assembly%place(p))
               if (place > 0) values(place) = values(place) + scale*packed(i)
            end associate
         end do
      end do
   end subroutine assemble

   !> Tᵀ k T, where T expresses each node of the brick as a weighted mean of the m nodes of the
   !> expanded element.
   pure function expanded(k, weight)
      !> Weights of the nodes of the expanded element at each node of the brick, (8, m).
      real(wp), intent(in) :: k(24, 24), weight(:, :)
      real(wp) :: expanded(3*size(weight, 2), 3*size(weight, 2)), t(24, 3*size(weight, 2))
      integer :: i

      t = 0.0_wp
      do i = 1, 3
         t(i::3, i::3) = weight
      end do
      expanded = matmul(transpose(t), matmul(k, t))
   end function expanded

   !> Product of the matrix with x.
   pure function product_with(assembly, values, x) result(y)
      type(assembly_type), intent(in) :: assembly
      !> Values of the matrix, mN/um, in the order of `assembly%row`; (unknowns).
      real(wp), intent(in) :: values(:), x(:)
      real(wp) :: y(size(x))
      integer :: i, j, p

      y = 0.0_wp
      do j = 1, size(x)
         do p = assembly%column_start(j), assembly%column_start(j + 1) - 1
            i = assembly%row(p)
            y(i) = y(i) + values(p)*x(j)
            if (i > j) y(j) = y(j) + values(p)*x(i)
         end do
      end do
   end function product_with

   !> Displacement (um) of every node, from the unknowns.
   pure subroutine expand_displacement(mesh, assembly, solution, u)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(in) :: assembly
      !> Displacement of each unknown, um.
      real(wp), intent(in) :: solution(:)
      !> (3, nodes).
      real(wp), intent(out) :: u(:, :)
      integer :: i, m

      do i = 1, size(u, 2)
         u(:, i) = merge(solution(max(1, assembly%unknown(:, i))), 0.0_wp, &
            & assembly%unknown(:, i) > 0)
      end do
      do i = 1, size(mesh%hanging)
         m = count(mesh%master(:, i) > 0)
         u(:, mesh%hanging(i)) = sum(u(:, mesh%master(:m, i)), dim=2)/m
      end do
   end subroutine expand_displacement

   !> Derivatives of the sum of uᵀ K v by the stiffness of each material, um3: for small changes of
   !> `c` it changes by the sum of their products with `by`.
   subroutine energy_by_stiffness(mesh, formulation, c, u, v, by)
      type(mesh_type), intent(in) :: mesh
      !> Formulation of the bricks (`fe_element`).
      integer, intent(in) :: formulation
      !> In the sample frame, GPa (6, 6, materials); pairs of displacements, um, (3, nodes, pairs).
      real(wp), intent(in) :: c(:, :, :), u(:, :, :), v(:, :, :)
      real(wp), intent(out) :: by(:, :, :)
      !> Bricks that are added together: their numbers fit into a cache.
      integer, parameter :: some = 64
      !> Strain of the points of an element by its displacements, and their volumes.
      real(wp) :: strain(48, 24), volume(8), far_strain(24, 12), far_volume(4)
      !> Bricks in the order of their classes.
      integer :: order(size(mesh%brick, 2)), first, last, e, i, k

      call sort_order(real(mesh%class, wp), order)
      by = 0.0_wp
      last = 0
      do i = 1, size(mesh%representative)
         first = last + 1
         do last = first, size(order) - 1
            if (mesh%class(order(last + 1)) > i) exit
         end do
         e = mesh%representative(i)
         call brick_own_strain(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), &
            & formulation, mesh%growth(e), strain, volume)
         do k = first, last, some
            associate (members => order(k:min(k + some - 1, last)))
               call add_elements(mesh%brick(:, members), mesh%scale(members), strain, volume, &
                  & by(:, :, mesh%material(e)))
            end associate
         end do
      end do
      do e = 1, size(mesh%facet, 2)
         associate (material => mesh%facet_material(e))
            call infinite_own_strain(mesh%x(:, mesh%facet(:, e)), c(:, :, material), far_strain, &
               & far_volume)
            call add_elements(mesh%facet(:, e:e), [1.0_wp], far_strain, far_volume, &
               & by(:, :, material))
         end associate
      end do
      do i = 1, size(by, 3)
         by(:, :, i) = 0.5_wp*(by(:, :, i) + transpose(by(:, :, i)))
      end do

   contains

      !> Add the strains of equal elements, whose energy is proportional to their scale.
      subroutine add_elements(nodes, scale, strain, volume, total)
         !> (node, element); (element).
         integer, intent(in) :: nodes(:, :)
         real(wp), intent(in) :: scale(:), strain(:, :), volume(:)
         real(wp), intent(inout) :: total(6, 6)
         !> Displacements and strains of each pair, element by element, those of `v` last.
         real(wp) :: both(size(strain, 2), 2*size(scale)*size(u, 3)), &
            & strains(size(strain, 1), size(both, 2))
         integer :: i, j, k, n, m

         n = size(scale)
         m = n*size(u, 3)
         do k = 1, n
            both(:, k:m:n) = reshape(u(:, nodes(:, k), :), [size(both, 1), size(u, 3)])
            both(:, m + k::n) = scale(k)*reshape(v(:, nodes(:, k), :), [size(both, 1), size(u, 3)])
         end do
         call multiply(strain, both, strains)
         do k = 1, m
            do i = 1, size(volume)
               associate (one => strains(6*i - 5:6*i, k), other => strains(6*i - 5:6*i, m + k))
                  do j = 1, 6
                     total(:, j) = total(:, j) + (volume(i)*other(j))*one
                  end do
               end associate
            end do
         end do
      end subroutine add_elements
   end subroutine energy_by_stiffness

   !> Force (mN) that the surroundings exert on the mesh, through the infinite elements or the
   !> clamped nodes.
   subroutine reaction(mesh, formulation, c, u, force)
      type(mesh_type), intent(in) :: mesh
      !> Formulation of the bricks (`fe_element`).
      integer, intent(in) :: formulation
      !> Stiffness of the materials in the sample frame (GPa, (6, 6, materials)), displacement of
      !> the nodes (um, (3, nodes)).
      real(wp), intent(in) :: c(:, :, :), u(:, :)
      real(wp), intent(out) :: force(3)
      logical, allocatable :: clamped(:)
      real(wp) :: k(24, 24), small(12, 12), f(24)
      logical :: valid
      integer :: e, a

      force = 0.0_wp
      do e = 1, size(mesh%facet, 2)
         call infinite_stiffness(mesh%x(:, mesh%facet(:, e)), &
            & c(:, :, mesh%facet_material(e)), small)
         f(:12) = matmul(small, reshape(u(:, mesh%facet(:, e)), [12]))
         force = force - sum(reshape(f(:12), [3, 4]), dim=2)
      end do
      if (size(mesh%clamped) == 0) return
      allocate (clamped(size(mesh%x, 2)), source=.false.)
      clamped(mesh%clamped) = .true.
      do e = 1, size(mesh%brick, 2)
         if (.not. any(clamped(mesh%brick(:, e)))) cycle
         call brick_stiffness(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), formulation, &
            & mesh%growth(e), k, valid)
         f = matmul(k, reshape(u(:, mesh%brick(:, e)), [24]))
         do a = 1, 8
            if (clamped(mesh%brick(a, e))) force = force + f(3*a - 2:3*a)
         end do
      end do
   end subroutine reaction
end module fe_assembly
