!> From element stiffness to the sparse matrix of a mesh: unknowns, pattern and scatter maps once, values per crystal.
module fe_assembly
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, raise
   use fe_element, only: brick_stiffness, infinite_stiffness
   use fe_mesh, only: mesh_type
   use kinds, only: wp
   use memory, only: raise_no_memory
   use sorting, only: sort_order
   use text, only: to_text
   implicit none
   private
   public :: assembly_type, new_assembly, assemble, expand_displacement, product_with, reaction

   !> Read-only once made. Unknowns are three displacements a free node; those normal to the contact surface come last.
   type :: assembly_type
      integer :: unknowns = 0, kept = 0
      !> Unknown of each displacement component of each node; 0 where clamped or hanging.
      integer, allocatable :: unknown(:, :)
      !> Lower triangle in compressed columns, 1-based, rows ascending.
      integer, allocatable :: column_start(:), row(:)
      !> Node of each unknown, numbered by first use.
      integer, allocatable :: group(:)
      !> Elements are the bricks, then the infinite elements. Entries of element e: `entry_start(e)` to `entry_start(e+1)-1`.
      integer, allocatable :: entry_start(:)
      !> Place in the values of each entry of an element's packed lower triangle; 0: dropped.
      integer, allocatable :: place(:)
      !> Bricks with hanging nodes have their own nodes and weights: `special(e)` is 0 for the others.
      integer, allocatable :: special(:)
      integer, allocatable :: special_node(:, :), special_count(:)
      real(wp), allocatable :: weight(:, :, :)
   end type assembly_type

   !> A brick with hanging nodes spans at most this many nodes.
   integer, parameter :: most_nodes = 20

contains

   subroutine new_assembly(mesh, assembly, error)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(out) :: assembly
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: hanging_index(:)
      integer :: i

      allocate (hanging_index(size(mesh%x, 2)), source=0)
      do i = 1, size(mesh%hanging)
         hanging_index(mesh%hanging(i)) = i
      end do
      call number_unknowns(mesh, hanging_index, assembly)
      call find_special(mesh, hanging_index, assembly)
      call build_pattern(mesh, assembly, error)
   end subroutine new_assembly

   subroutine number_unknowns(mesh, hanging_index, assembly)
      type(mesh_type), intent(in) :: mesh
      integer, intent(in) :: hanging_index(:)
      type(assembly_type), intent(inout) :: assembly
      logical, allocatable :: free(:)
      integer :: i, j, n, groups
      integer, allocatable :: node_group(:)

      allocate (free(size(mesh%x, 2)))
      free = hanging_index == 0
      free(mesh%clamped) = .false.
      allocate (assembly%unknown(3, size(free)), source=0)
      assembly%kept = size(mesh%contact)
      assembly%unknown(3, mesh%contact) = -1
      n = 0
      do i = 1, size(free)
         if (.not. free(i)) cycle
         do j = 1, 3
            if (assembly%unknown(j, i) < 0) cycle
            n = n + 1
            assembly%unknown(j, i) = n
         end do
      end do
      do i = 1, size(mesh%contact)
         n = n + 1
         assembly%unknown(3, mesh%contact(i)) = n
      end do
      assembly%unknowns = n
      allocate (assembly%group(n), node_group(size(free)))
      groups = 0
      do i = 1, size(free)
         if (.not. free(i)) cycle
         groups = groups + 1
         assembly%group(assembly%unknown(:, i)) = groups
      end do
   end subroutine number_unknowns

   !> Express each brick that has hanging nodes in the nodes they hang on.
   subroutine find_special(mesh, hanging_index, assembly)
      type(mesh_type), intent(in) :: mesh
      integer, intent(in) :: hanging_index(:)
      type(assembly_type), intent(inout) :: assembly
      integer :: e, a, m, h, count, found

      allocate (assembly%special(size(mesh%brick, 2)), source=0)
      count = 0
      do e = 1, size(mesh%brick, 2)
         if (all(hanging_index(mesh%brick(:, e)) == 0)) cycle
         count = count + 1
         assembly%special(e) = count
      end do
      allocate (assembly%special_node(most_nodes, count), assembly%special_count(count))
      allocate (assembly%weight(8, most_nodes, count), source=0.0_wp)
      do e = 1, size(mesh%brick, 2)
         if (assembly%special(e) == 0) cycle
         count = assembly%special(e)
         found = 0
         do a = 1, 8
            h = hanging_index(mesh%brick(a, e))
            if (h == 0) then
               call add(mesh%brick(a, e), a, 1.0_wp)
            else
               do m = 1, mesh%masters(h)
                  call add(mesh%master(m, h), a, 1.0_wp/mesh%masters(h))
               end do
            end if
         end do
         assembly%special_count(count) = found
      end do

   contains

      subroutine add(node, a, w)
         integer, intent(in) :: node, a
         real(wp), intent(in) :: w
         integer :: k

         do k = 1, found
            if (assembly%special_node(k, count) == node) exit
         end do
         if (k > found) found = k
         assembly%special_node(k, count) = node
         assembly%weight(a, k, count) = assembly%weight(a, k, count) + w
      end subroutine add
   end subroutine find_special

   !> Nodes of element e: bricks first, then infinite elements.
   pure subroutine element_nodes(mesh, assembly, e, node, count)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(in) :: assembly
      integer, intent(in) :: e
      integer, intent(out) :: node(most_nodes), count
      integer :: s

      if (e > size(mesh%brick, 2)) then
         count = 4
         node(:4) = mesh%facet(:, e - size(mesh%brick, 2))
         return
      end if
      s = assembly%special(e)
      if (s == 0) then
         count = 8
         node(:8) = mesh%brick(:, e)
      else
         count = assembly%special_count(s)
         node(:count) = assembly%special_node(:count, s)
      end if
   end subroutine element_nodes

   subroutine build_pattern(mesh, assembly, error)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(inout) :: assembly
      type(error_type), allocatable, intent(out) :: error
      integer, allocatable :: touching_start(:), touching(:), next(:), mark(:), rows(:), order(:), owner(:), filled(:)
      integer :: elements, nodes, e, a, b, i, j, count, node(most_nodes), column, found, p, t, r
      integer :: dof(3*most_nodes), total, status

      elements = size(mesh%brick, 2) + size(mesh%facet, 2)
      nodes = size(mesh%x, 2)
      allocate (touching_start(nodes + 1), source=0)
      do e = 1, elements
         call element_nodes(mesh, assembly, e, node, count)
         touching_start(node(:count) + 1) = touching_start(node(:count) + 1) + 1
      end do
      touching_start(1) = 1
      do i = 1, nodes
         touching_start(i + 1) = touching_start(i + 1) + touching_start(i)
      end do
      allocate (touching(touching_start(nodes + 1) - 1))
      next = touching_start(:nodes)
      do e = 1, elements
         call element_nodes(mesh, assembly, e, node, count)
         touching(next(node(:count))) = e
         next(node(:count)) = next(node(:count)) + 1
      end do

      allocate (assembly%entry_start(elements + 1))
      assembly%entry_start(1) = 1
      do e = 1, elements
         call element_nodes(mesh, assembly, e, node, count)
         assembly%entry_start(e + 1) = assembly%entry_start(e) + (3*count*(3*count + 1))/2
      end do
      total = assembly%entry_start(elements + 1) - 1
      ! Elements share entries: they fill less than that.
      allocate (assembly%place(total), filled(total), source=0, stat=status)
      if (status /= 0) then
         call raise_no_memory('the entries of '//to_text(elements)//' elements', error)
         return
      end if

      allocate (mark(assembly%unknowns), owner(assembly%unknowns), source=0)
      allocate (rows(3*most_nodes*64), order(3*most_nodes*64), assembly%column_start(assembly%unknowns + 1))
      do i = 1, nodes
         owner(pack(assembly%unknown(:, i), assembly%unknown(:, i) > 0)) = i
      end do
      assembly%column_start(1) = 1
      do column = 1, assembly%unknowns
         found = 0
         do t = touching_start(owner(column)), touching_start(owner(column) + 1) - 1
            call element_nodes(mesh, assembly, touching(t), node, count)
            do a = 1, count
               do b = 1, 3
                  r = assembly%unknown(b, node(a))
                  if (r < column) cycle
                  if (mark(r) == column) cycle
                  mark(r) = column
                  found = found + 1
                  rows(found) = r
               end do
            end do
         end do
         call sort_order(real(rows(:found), wp), order(:found))
         p = assembly%column_start(column)
         filled(p:p + found - 1) = rows(order(:found))
         assembly%column_start(column + 1) = p + found
      end do
      assembly%row = filled(:assembly%column_start(assembly%unknowns + 1) - 1)

      do e = 1, elements
         call element_nodes(mesh, assembly, e, node, count)
         do a = 1, count
            dof(3*a - 2:3*a) = assembly%unknown(:, node(a))
         end do
         p = assembly%entry_start(e)
         do j = 1, 3*count
            do i = j, 3*count
               if (dof(i) > 0 .and. dof(j) > 0) assembly%place(p) = find(max(dof(i), dof(j)), min(dof(i), dof(j)))
               p = p + 1
            end do
         end do
      end do

   contains

      !> Place of (row r, column c) by bisection.
      pure integer function find(r, c)
         integer, intent(in) :: r, c
         integer :: low, high

         low = assembly%column_start(c)
         high = assembly%column_start(c + 1) - 1
         do while (low < high)
            find = (low + high)/2
            if (assembly%row(find) < r) then
               low = find + 1
            else
               high = find
            end if
         end do
         find = low
      end function find
   end subroutine build_pattern

   !> Values of the matrix, in mN/um, where the materials have the stiffnesses `c`.
   subroutine assemble(mesh, assembly, formulation, c, values, error)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(in) :: assembly
      !> Of the bricks (`fe_element`).
      integer, intent(in) :: formulation
      !> Sample frame, GPa (6, 6, materials).
      real(wp), intent(in) :: c(:, :, :)
      !> In the order of `assembly%row`.
      real(wp), intent(out) :: values(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: class_stiffness(:, :)
      real(wp) :: k(24, 24), small(12, 12), expanded(3*most_nodes, 3*most_nodes), half(24, 3*most_nodes)
      real(wp) :: packed(3*most_nodes*(3*most_nodes + 1)/2)
      logical :: valid
      integer :: e, i, p, s, m, bricks, status

      values = 0.0_wp
      do i = 1, size(c, 3)
         call check_stiffness(c(:, :, i), error)
         if (allocated(error)) return
      end do
      allocate (class_stiffness(300, size(mesh%representative)), stat=status)
      if (status /= 0) then
         call raise_no_memory('the stiffness of '//to_text(size(mesh%representative))//' elements', error)
         return
      end if
      do i = 1, size(mesh%representative)
         e = mesh%representative(i)
         call brick_stiffness(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), formulation, mesh%growth(e), k, valid)
         if (.not. valid) then
            call raise(error, 'element '//to_text(e)//' of the mesh is turned inside out')
            return
         end if
         call pack_lower(k, 24, class_stiffness(:, i))
      end do
      bricks = size(mesh%brick, 2)
      do e = 1, bricks
         s = assembly%special(e)
         p = assembly%entry_start(e)
         if (s == 0) then
            call scatter(class_stiffness(:, mesh%class(e)), mesh%scale(e), assembly%place(p:p + 299), values)
         else
            m = assembly%special_count(s)
            call brick_stiffness(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), formulation, mesh%growth(e), k, valid)
            call expand(k, assembly%weight(:, :m, s), m, half, expanded)
            call pack_lower(expanded(:3*m, :3*m), 3*m, packed)
            call scatter(packed, 1.0_wp, assembly%place(p:p + (3*m*(3*m + 1))/2 - 1), values)
         end if
      end do
      do e = 1, size(mesh%facet, 2)
         call infinite_stiffness(mesh%x(:, mesh%facet(:, e)), c(:, :, mesh%facet_material(e)), small)
         call pack_lower(small, 12, packed)
         p = assembly%entry_start(bricks + e)
         call scatter(packed, 1.0_wp, assembly%place(p:p + 77), values)
      end do
   end subroutine assemble

   pure subroutine scatter(packed, scale, place, values)
      real(wp), intent(in) :: packed(:), scale
      integer, intent(in) :: place(:)
      real(wp), intent(inout) :: values(:)
      integer :: i

      do i = 1, size(place)
         if (place(i) > 0) values(place(i)) = values(place(i)) + scale*packed(i)
      end do
   end subroutine scatter

   pure subroutine pack_lower(k, n, packed)
      integer, intent(in) :: n
      real(wp), intent(in) :: k(n, n)
      real(wp), intent(inout) :: packed(:)
      integer :: j, p

      p = 0
      do j = 1, n
         packed(p + 1:p + n - j + 1) = k(j:, j)
         p = p + n - j + 1
      end do
   end subroutine pack_lower

   !> Tᵀ k T, where each node of the brick is a weighted mean of the m nodes of the expanded element.
   pure subroutine expand(k, weight, m, half, expanded)
      integer, intent(in) :: m
      real(wp), intent(in) :: k(24, 24), weight(8, m)
      real(wp), intent(out) :: half(24, 3*most_nodes), expanded(3*most_nodes, 3*most_nodes)
      integer :: a, b

      half = 0.0_wp
      expanded = 0.0_wp
      do b = 1, m
         do a = 1, 8
            if (weight(a, b) > 0.0_wp) half(:, 3*b - 2:3*b) = half(:, 3*b - 2:3*b) + weight(a, b)*k(:, 3*a - 2:3*a)
         end do
      end do
      do b = 1, m
         do a = 1, 8
            if (weight(a, b) > 0.0_wp) expanded(3*b - 2:3*b, :3*m) = expanded(3*b - 2:3*b, :3*m) &
               & + weight(a, b)*half(3*a - 2:3*a, :3*m)
         end do
      end do
   end subroutine expand

   !> The matrix with these values times x.
   pure function product_with(assembly, values, x) result(y)
      type(assembly_type), intent(in) :: assembly
      !> mN/um, in the order of `assembly%row`.
      real(wp), intent(in) :: values(:)
      !> (unknowns).
      real(wp), intent(in) :: x(:)
      real(wp) :: y(size(x))
      integer :: i, j, p

      y = 0.0_wp
      do j = 1, size(x)
         p = assembly%column_start(j)
         y(j) = y(j) + values(p)*x(j)
         do p = p + 1, assembly%column_start(j + 1) - 1
            i = assembly%row(p)
            y(i) = y(i) + values(p)*x(j)
            y(j) = y(j) + values(p)*x(i)
         end do
      end do
   end function product_with

   !> Displacement (um) of every node from the unknowns.
   pure subroutine expand_displacement(mesh, assembly, solution, u)
      type(mesh_type), intent(in) :: mesh
      type(assembly_type), intent(in) :: assembly
      !> Displacement of each unknown, um.
      real(wp), intent(in) :: solution(:)
      !> (3, nodes).
      real(wp), intent(out) :: u(:, :)
      integer :: i, j, m

      do i = 1, size(u, 2)
         do j = 1, 3
            u(j, i) = 0.0_wp
            if (assembly%unknown(j, i) > 0) u(j, i) = solution(assembly%unknown(j, i))
         end do
      end do
      do i = 1, size(mesh%hanging)
         m = mesh%masters(i)
         do j = 1, 3
            u(j, mesh%hanging(i)) = sum(u(j, mesh%master(:m, i)))/m
         end do
      end do
   end subroutine expand_displacement

   !> Force (mN) with which the surroundings hold the mesh: clamped nodes, or the infinite elements.
   subroutine reaction(mesh, formulation, c, u, force)
      type(mesh_type), intent(in) :: mesh
      !> Of the bricks (`fe_element`).
      integer, intent(in) :: formulation
      !> Stiffness of the materials in the sample frame (GPa), displacement of the nodes (um).
      real(wp), intent(in) :: c(:, :, :), u(:, :)
      real(wp), intent(out) :: force(3)
      logical, allocatable :: clamped(:)
      real(wp) :: k(24, 24), small(12, 12), f(24)
      logical :: valid
      integer :: e, a

      force = 0.0_wp
      do e = 1, size(mesh%facet, 2)
         call infinite_stiffness(mesh%x(:, mesh%facet(:, e)), c(:, :, mesh%facet_material(e)), small)
         f(:12) = matmul(small, reshape(u(:, mesh%facet(:, e)), [12]))
         force = force - sum(reshape(f(:12), [3, 4]), dim=2)
      end do
      if (size(mesh%clamped) == 0) return
      allocate (clamped(size(mesh%x, 2)), source=.false.)
      clamped(mesh%clamped) = .true.
      do e = 1, size(mesh%brick, 2)
         if (.not. any(clamped(mesh%brick(:, e)))) cycle
         call brick_stiffness(mesh%x(:, mesh%brick(:, e)), c(:, :, mesh%material(e)), formulation, mesh%growth(e), k, valid)
         f = matmul(k, reshape(u(:, mesh%brick(:, e)), [24]))
         do a = 1, 8
            if (clamped(mesh%brick(a, e))) force = force + f(3*a - 2:3*a)
         end do
      end do
   end subroutine reaction
end module fe_assembly
