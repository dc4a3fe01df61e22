!> Points of ensembles and chains, their move along differences, and the Metropolis rule.
module moves
   use abstract_sampler, only: outside
   use kinds, only: wp
   use random, only: random_stream_type
   implicit none
   private
   public :: points_type, new_points, difference_move_type, is_accepted

   type :: points_type
      !> Working and whitened coordinates, (dimension, point), and the logarithms of the density of
      !> the working ones, (point).
      real(wp), allocatable :: w(:, :), u(:, :), log_density(:)
   contains
      procedure :: set
   end type points_type

   !> Differential evolution (ter Braak, Stat. Comput. 16, 239, 2006).
   type :: difference_move_type
      !> Factor of the steps; 1 suits coordinates in which the density is normal.
      real(wp) :: scale = 1.0_wp
   contains
      procedure :: propose, tune
   end type difference_move_type

contains

   pure type(points_type) function new_points(dimension, n) result(points)
      integer, intent(in) :: dimension, n

      allocate (points%w(dimension, n), points%u(dimension, n), points%log_density(n))
   end function new_points

   !> Set point i to the point j of others.
   pure subroutine set(self, i, others, j)
      class(points_type), intent(inout) :: self
      integer, intent(in) :: i, j
      class(points_type), intent(in) :: others

      self%w(:, i) = others%w(:, j)
      self%u(:, i) = others%u(:, j)
      self%log_density(i) = others%log_density(j)
   end subroutine set

   !> Move a point u along a difference of two points, in all coordinates or in some, with a little
   !> noise.
   subroutine propose(self, stream, difference, u, moved)
      class(difference_move_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> (dimension).
      real(wp), intent(in) :: difference(:), u(:)
      real(wp), intent(out) :: moved(:)
      !> So small that it only keeps the chain from staying on a grid (ter Braak's b).
      real(wp), parameter :: noise = 1.0e-5_wp
      real(wp) :: share, v, length, z
      integer :: i
      logical :: changed(size(u))

      ! In half of the steps some coordinates change: crossover, whose probability is uniform.
      call stream%uniform(share)
      changed = .true.
      if (share < 0.5_wp) then
         do i = 1, size(u)
            call stream%uniform(v)
            changed(i) = v < 2.0_wp*share
         end do
         if (.not. any(changed)) changed = .true.
      end if
      ! For a normal density in many dimensions d, 2.38/sqrt(d) sds are the best step of a random walk
      ! (Gelman, Roberts & Gilks, Bayesian Statistics 5, 599, 1996), and a difference has twice the
      ! variance of a point. In 15 % of the steps the factor is 1, which leads from mode to mode (ter
      ! Braak: 10 %); in 25 % the step is shorter.
      call stream%uniform(v)
      length = self%scale*2.38_wp/sqrt(2.0_wp*count(changed))
      if (v < 0.15_wp) length = 1.0_wp
      if (v > 0.75_wp) length = 0.35_wp*length
      moved = u
      do i = 1, size(u)
         if (.not. changed(i)) cycle
         call stream%normal(z)
         moved(i) = u(i) + length*difference(i) + noise*z
      end do
   end subroutine propose

   !> Tune the steps towards an acceptance of a fifth, near the best one of normal densities of many
   !> dimensions (0.234; Gelman, Roberts & Gilks).
   subroutine tune(self, acceptance)
      class(difference_move_type), intent(inout) :: self
      !> Share of accepted steps.
      real(wp), intent(in) :: acceptance
      real(wp), parameter :: target_acceptance = 0.2_wp, least_scale = 0.02_wp

      self%scale = min(1.0_wp, &
         & max(least_scale, self%scale*exp(0.5_wp*(acceptance - target_acceptance))))
   end subroutine tune

   !> Whether a Metropolis step is accepted.
   logical function is_accepted(stream, proposed, current, temperature)
      type(random_stream_type), intent(inout) :: stream
      !> Logarithms of the density, and the temperature that divides them.
      real(wp), intent(in) :: proposed, current, temperature
      real(wp) :: v

      is_accepted = proposed > outside
      if (.not. is_accepted) return
      call stream%uniform(v)
      is_accepted = log(v) < (proposed - current)/temperature
   end function is_accepted
end module moves
