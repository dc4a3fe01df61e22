!> Frictionless contact of a rigid indenter with nodes whose normal compliance is known: a linear complementarity problem.
!>
!> With nodal pressures forces f ≥ 0 (mN, into the material), compliance F (um/mN) and the indenter's height above the
!> undeformed surface g - d, the clearance is w = g - d + F f ≥ 0, and f w = 0 node by node.
module fe_contact
   use errors, only: error_type, raise
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor, cholesky_solve
   use memory, only: raise_no_memory
   use text, only: to_text
   implicit none
   private
   public :: solve_contact, contact_residual

   !> Newton steps on the active set before it is changed one node at a time, and steps in all.
   integer, parameter :: most_block_steps = 40, most_steps = 2000

contains

   !> Nodal forces at one depth by the primal-dual active set method, starting from `active`.
   subroutine solve_contact(compliance, gap, depth, active, force, error)
      !> Normal displacement of the nodes by their normal forces, um/mN.
      real(wp), intent(in) :: compliance(:, :)
      !> Height of the indenter above each node at zero depth, and its depth, um.
      real(wp), intent(in) :: gap(:), depth
      !> In: a guess; out: the nodes in contact.
      logical, intent(inout) :: active(:)
      !> Into the material, mN.
      real(wp), intent(out) :: force(:)
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: a(:, :), b(:, :), clearance(:)
      integer, allocatable :: set(:)
      logical, allocatable :: wrong(:)
      integer :: n, step, i, j, status

      n = size(gap)
      allocate (clearance(n), wrong(n))
      do step = 1, most_steps
         set = pack([(i, i=1, n)], active)
         force = 0.0_wp
         if (size(set) > 0) then
            allocate (a(size(set), size(set)), b(size(set), 1), stat=status)
            if (status /= 0) then
               call raise_no_memory('the contact of '//to_text(size(set))//' nodes', error)
               return
            end if
            do j = 1, size(set)
               a(:, j) = compliance(set, set(j))
            end do
            b(:, 1) = depth - gap(set)
            call cholesky_factor(a, error)
            if (allocated(error)) return
            call cholesky_solve(a, b)
            force(set) = b(:, 1)
            deallocate (a, b)
         end if
         clearance = gap - depth
         do j = 1, size(set)
            clearance = clearance + compliance(:, set(j))*force(set(j))
         end do
         wrong = (active .and. force < 0.0_wp) .or. (.not. active .and. clearance < -1.0e-13_wp*depth)
         if (.not. any(wrong)) return
         if (step <= most_block_steps) then
            active = active .neqv. wrong
         else
            ! Murty's rule cannot cycle: exchange the last of the wrong nodes only.
            i = findloc(wrong, .true., dim=1, back=.true.)
            active(i) = .not. active(i)
         end if
      end do
      call raise(error, 'the contact of '//to_text(n)//' nodes at depth '//to_text(depth)//' um was not found in ' &
         & //to_text(most_steps)//' steps')
   end subroutine solve_contact

   !> Largest violation of the contact conditions: tension and complementarity relative to the largest nodal force,
   !> penetration and complementarity relative to the depth.
   pure real(wp) function contact_residual(compliance, gap, depth, force) result(residual)
      !> As in `solve_contact`.
      real(wp), intent(in) :: compliance(:, :), gap(:), depth, force(:)
      real(wp), allocatable :: clearance(:), relative(:)

      clearance = (gap - depth + matmul(compliance, force))/depth
      relative = force/max(maxval(abs(force)), tiny(1.0_wp))
      residual = max(maxval(-relative), maxval(-clearance), maxval(abs(relative*clearance)), 0.0_wp)
   end function contact_residual
end module fe_contact
