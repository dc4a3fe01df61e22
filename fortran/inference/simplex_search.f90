!> The maximum of a density by Nelder and Mead's simplex (Comput. J. 7, 308, 1965), which needs no derivative and does not mind
!> bounds.
module simplex_search
   use kinds, only: wp
   use abstract_sampler, only: target_type
   use statistics, only: sort_order
   implicit none
   private
   public :: climb

   !> It ends where the corners are this near each other, in parameters and in log density, or after so many evaluations.
   real(wp), parameter :: near = 1.0e-3_wp, level = 1.0e-4_wp
   integer, parameter :: most_evaluations = 1000

contains

   !> From a point `x` of the support to a maximum of the density nearby.
   subroutine climb(target, steps, x)
      class(target_type), intent(in) :: target
      !> Steps from the first corner of the simplex to the others, (parameter).
      real(wp), intent(in) :: steps(:)
      real(wp), intent(inout) :: x(:)
      real(wp) :: corner(size(x), size(x) + 1), depth(size(x) + 1), centre(size(x)), tried(size(x)), further(size(x))
      real(wp) :: tried_depth, further_depth
      integer :: n, j, evaluations, order(size(x) + 1)

      n = size(x)
      evaluations = 0
      do j = 1, n + 1
         corner(:, j) = x
         if (j > 1) corner(j - 1, j) = x(j - 1) + steps(j - 1)
         depth(j) = depth_at(corner(:, j))
      end do
      do
         call sort_order(depth, order)
         depth = depth(order)
         corner = corner(:, order)
         if (evaluations >= most_evaluations) exit
         if (maxval(abs(corner(:, 2:) - spread(corner(:, 1), 2, n))) <= near .and. depth(n + 1) - depth(1) <= level) exit
         centre = sum(corner(:, :n), 2)/n
         tried = 2.0_wp*centre - corner(:, n + 1)
         tried_depth = depth_at(tried)
         if (tried_depth < depth(1)) then
            further = 3.0_wp*centre - 2.0_wp*corner(:, n + 1)
            further_depth = depth_at(further)
            if (further_depth < tried_depth) then
               tried = further
               tried_depth = further_depth
            end if
         else if (tried_depth >= depth(n)) then
            further = 0.5_wp*(centre + corner(:, n + 1))
            if (tried_depth < depth(n + 1)) further = 0.5_wp*(centre + tried)
            further_depth = depth_at(further)
            if (further_depth < min(tried_depth, depth(n + 1))) then
               tried = further
               tried_depth = further_depth
            else
               do j = 2, n + 1
                  corner(:, j) = 0.5_wp*(corner(:, 1) + corner(:, j))
                  depth(j) = depth_at(corner(:, j))
               end do
               cycle
            end if
         end if
         corner(:, n + 1) = tried
         depth(n + 1) = tried_depth
      end do
      x = corner(:, 1)

   contains

      !> Minus the log density; very large outside the support.
      real(wp) function depth_at(point)
         real(wp), intent(in) :: point(:)
         real(wp) :: log_density(1)

         evaluations = evaluations + 1
         call target%evaluate(reshape(point, [size(point), 1]), log_density)
         depth_at = min(1.0e300_wp, -log_density(1))
      end function depth_at
   end subroutine climb
end module simplex_search
