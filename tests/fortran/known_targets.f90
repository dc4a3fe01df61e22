!> Densities that the samplers are tried on.
module known_targets
   use kinds, only: wp
   use random, only: random_stream_type
   use abstract_sampler, only: chain_type, estimate_type, outside, sampler_type, target_type
   implicit none
   private
   public :: approximated_wavy_type, banana_type, counting_sampler_type, drawn_wavy_type, wavy_type

   !> x is normal within -1.5 .. 2, and y is normal about x² with sd 0.1.
   type, extends(target_type) :: banana_type
      !> Bounds of the parameters, (dimension).
      real(wp), allocatable :: lower(:), upper(:)
   contains
      procedure :: draw_start
      procedure :: evaluate
   end type banana_type

   !> (x1, x2 + 0.8 sin 2 x1, x3 + 0.3 x1², x4, ..) are standard normal, and x1 > -1. No polynomial
   !> makes it straight.
   type, extends(target_type) :: wavy_type
   contains
      procedure :: draw_start => draw_wavy_start
      procedure :: evaluate => evaluate_wavy
      procedure :: straightened
   end type wavy_type

   !> The same density, of which the starts are draws.
   type, extends(wavy_type) :: drawn_wavy_type
   contains
      procedure :: draw_start => draw_wavy
   end type drawn_wavy_type

   !> The same density with an approximation, whose logarithm errs by up to 1.
   type, extends(wavy_type) :: approximated_wavy_type
      logical :: is_coarse = .false.
   contains
      procedure :: evaluate => evaluate_approximated, coarsen
   end type approximated_wavy_type

   !> A sampler that counts its runs, whose estimates can be trusted from an effort on.
   type, extends(sampler_type) :: counting_sampler_type
      integer :: first_good_effort = 1, runs = 0
   contains
      procedure :: run => count_run
   end type counting_sampler_type

contains

   subroutine draw_start(self, stream, x)
      class(banana_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: x(:)
      integer :: i

      do i = 1, size(x)
         call stream%uniform(x(i))
      end do
      x = self%lower + x*(self%upper - self%lower)
   end subroutine draw_start

   pure subroutine evaluate(self, points, log_density)
      class(banana_type), intent(in) :: self
      real(wp), intent(in) :: points(:, :)
      real(wp), intent(out) :: log_density(:)
      integer :: i

      log_density = outside
      do i = 1, size(log_density)
         associate (x => points(:, i))
            if (.not. all(x >= self%lower .and. x <= self%upper)) cycle
            log_density(i) = -0.5_wp*x(1)**2 - 0.5_wp*((x(2) - x(1)**2)/0.1_wp)**2
            if (self%dimension > 2) log_density(i) = log_density(i) - 0.5_wp*sum(x(3:)**2)
         end associate
      end do
   end subroutine evaluate

   subroutine draw_wavy_start(self, stream, x)
      class(wavy_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: x(:)
      integer :: i

      do i = 1, self%dimension
         call stream%uniform(x(i))
      end do
      x = 8.0_wp*x - 4.0_wp
   end subroutine draw_wavy_start

   subroutine draw_wavy(self, stream, x)
      class(drawn_wavy_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(out) :: x(:)

      call stream%normals(x(:self%dimension))
      x(2) = x(2) - 0.8_wp*sin(2.0_wp*x(1))
      x(3) = x(3) - 0.3_wp*x(1)**2
   end subroutine draw_wavy

   !> The coordinates of points that are standard normal, the first one cut.
   pure function straightened(self, points) result(normal)
      class(wavy_type), intent(in) :: self
      !> (parameter, point).
      real(wp), intent(in) :: points(:, :)
      real(wp) :: normal(self%dimension, size(points, 2))

      normal = points
      normal(2, :) = points(2, :) + 0.8_wp*sin(2.0_wp*points(1, :))
      normal(3, :) = points(3, :) + 0.3_wp*points(1, :)**2
   end function straightened

   pure subroutine evaluate_wavy(self, points, log_density)
      class(wavy_type), intent(in) :: self
      real(wp), intent(in) :: points(:, :)
      real(wp), intent(out) :: log_density(:)

      log_density = outside
      where (points(1, :) > -1.0_wp) log_density = -0.5_wp*sum(self%straightened(points)**2, 1)
   end subroutine evaluate_wavy

   pure subroutine evaluate_approximated(self, points, log_density)
      class(approximated_wavy_type), intent(in) :: self
      real(wp), intent(in) :: points(:, :)
      real(wp), intent(out) :: log_density(:)

      call self%wavy_type%evaluate(points, log_density)
      if (.not. self%is_coarse) return
      where (log_density > outside) log_density = log_density + sin(3.0_wp*points(2, :))
   end subroutine evaluate_approximated

   subroutine coarsen(self)
      class(approximated_wavy_type), intent(inout) :: self

      self%is_coarse = .true.
   end subroutine coarsen
   subroutine count_run(self, effort, target, stream, chain)
      class(counting_sampler_type), intent(inout) :: self
      integer, intent(in) :: effort
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      type(chain_type), intent(inout) :: chain
      type(estimate_type) :: estimate

      self%runs = self%runs + 1
      call stream%uniform(chain%acceptance)
      chain%started = .true.
      if (effort < self%first_good_effort) return
      allocate (estimate%mean(target%dimension), estimate%sd(target%dimension), &
         & estimate%mean_error(target%dimension), estimate%sd_error(target%dimension), &
         & source=1.0_wp)
      chain%estimate = estimate
   end subroutine count_run
end module known_targets
