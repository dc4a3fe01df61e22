!> Moves of chains and ensembles: along the difference of two points, by independent draws of a
!> mixture, and by a random walk of one parameter. Each is a type with a procedure that proposes a
!> point, and with procedures that set it up or tune it. Whoever moves accepts, by `is_accepted`.
module moves
   use abstract_sampler, only: outside, target_type
   use student_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, &
      & widen_mixture
   use kinds, only: wp
   use random, only: random_stream_type
   use ridge_coordinates, only: whitening_type
   use running_command, only: stop_requested
   implicit none
   private
   public :: points_type, new_points, is_accepted, difference_move_type, mixture_move_type, &
      & random_walk_type

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
      procedure :: propose => propose_difference, tune => tune_difference
   end type difference_move_type

   !> Independent draws of a normal mixture, in whitened coordinates.
   type :: mixture_move_type
      type(whitening_type) :: whitening
      type(mixture_type) :: mixture
      !> Draws of the mixture.
      type(points_type) :: pool
      !> Of the last `draw_inside`: the logarithms of the weights of the pool's draws, which are the
      !> ratios of the density to that of the mixture in whitened coordinates; the effective share
      !> of these draws, 0 if they are useless; and the share of all draws in the support.
      real(wp), allocatable :: log_weights(:)
      real(wp) :: quality = 0.0_wp, share_inside = 0.0_wp
      !> Some of its draws outside the support, (dimension, draw), and their number.
      real(wp), allocatable, private :: outer(:, :)
      integer, private :: n_outer = 0
      !> What the mixture was fitted to, before it was widened: the archive and draws, (dimension,
      !> point), and the weights of the draws.
      type(mixture_type), private :: fitted
      real(wp), allocatable, private :: points(:, :), weights(:)
      !> Number of rounds of draws from which it has learned.
      integer :: rounds = 0
   contains
      procedure :: setup => fit_to_archive, draw_inside, learn, fits_badly
      procedure, private :: draw
   end type mixture_move_type

   !> Random walk of one parameter at a time.
   type :: random_walk_type
      !> Sd of the steps of each parameter, and the greatest one, (dimension).
      real(wp), allocatable :: step(:), greatest(:)
   contains
      procedure :: propose => propose_step, tune => tune_step
   end type random_walk_type

contains

   pure type(points_type) function new_points(dimension, n) result(points)
      !> Number of parameters and of points.
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

   !> Move a point u along a difference of two points, in all coordinates or in some, with a little
   !> noise.
   subroutine propose_difference(self, stream, difference, u, moved)
      class(difference_move_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> (dimension).
      real(wp), intent(in) :: difference(:), u(:)
      !> (dimension).
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
      ! For a normal density in many dimensions d, 2.38/sqrt(d) sds are the best step of a random
      ! walk (Gelman, Roberts & Gilks, Bayesian Statistics 5, 599, 1996), and a difference has twice
      ! the variance of a point. In 15 % of the steps the factor is 1, which leads from mode to mode
      ! (ter Braak: 10 %); in 25 % the step is shorter.
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
   end subroutine propose_difference

   !> Tune the steps towards an acceptance of a fifth, near the best one of normal densities of many
   !> dimensions (0.234; Gelman, Roberts & Gilks).
   subroutine tune_difference(self, acceptance)
      class(difference_move_type), intent(inout) :: self
      !> Share of accepted steps.
      real(wp), intent(in) :: acceptance
      real(wp), parameter :: target_acceptance = 0.2_wp, least_scale = 0.02_wp

      self%scale = min(1.0_wp, &
         & max(least_scale, self%scale*exp(0.5_wp*(acceptance - target_acceptance))))
   end subroutine tune_difference

   !> Draw n points of the mixture into the pool.
   subroutine draw(self, target, stream, n)
      class(mixture_move_type), intent(inout) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      integer, intent(in) :: n
      integer :: i

      self%pool = new_points(target%dimension, n)
      do i = 1, n
         call draw_mixture(self%mixture, stream, self%pool%u(:, i))
         call self%whitening%from_white(self%pool%u(:, i), self%pool%w(:, i))
      end do
      call target%evaluate_working(self%pool%w, self%pool%log_density)
   end subroutine draw

   !> Fit the mixture to an archive.
   subroutine fit_to_archive(self, archive, whitening)
      class(mixture_move_type), intent(inout) :: self
      class(points_type), intent(in) :: archive
      type(whitening_type), intent(in) :: whitening
      integer, parameter :: components = 16, steps = 15

      self%whitening = whitening
      self%points = archive%u
      self%weights = [real(wp) ::]
      self%rounds = 0
      call new_mixture(archive%u, components, self%fitted)
      call fit_mixture(archive%u, spread(1.0_wp, 1, size(archive%u, 2)), steps, self%fitted)
      call widen_mixture(self%fitted, self%mixture)
   end subroutine fit_to_archive

   !> Draw points until enough are in the support.
   subroutine draw_inside(self, target, stream, n)
      class(mixture_move_type), intent(inout) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      !> Number of points. There are fewer if most draws are outside the support.
      integer, intent(in) :: n
      integer, parameter :: at_once = 512, tries = 10, most_outside = 3000
      type(points_type) :: found
      real(wp), allocatable :: log_weights(:)
      integer :: i, n_inside, n_outside

      found = new_points(target%dimension, n)
      allocate (log_weights(n))
      if (.not. allocated(self%outer)) allocate (self%outer(target%dimension, most_outside))
      n_inside = 0
      n_outside = 0
      do while (n_inside < n .and. n_outside < tries*n .and. .not. stop_requested())
         call self%draw(target, stream, min(at_once, n - n_inside))
         do i = 1, size(self%pool%log_density)
            associate (u => self%pool%u(:, i), density => self%pool%log_density(i))
               if (density > outside) then
                  n_inside = n_inside + 1
                  call found%set(n_inside, self%pool, i)
                  log_weights(n_inside) = density - log_mixture(self%mixture, u)
               else
                  n_outside = n_outside + 1
                  if (n_outside <= most_outside) self%outer(:, n_outside) = u
               end if
            end associate
         end do
      end do
      self%pool%w = found%w(:, :n_inside)
      self%pool%u = found%u(:, :n_inside)
      self%pool%log_density = found%log_density(:n_inside)
      self%log_weights = log_weights(:n_inside)
      self%n_outer = min(n_outside, most_outside)
      self%share_inside = real(n_inside, wp)/max(1, n_inside + n_outside)
      self%quality = 0.0_wp
      if (n_inside == 0) return
      log_weights = exp(self%log_weights - maxval(self%log_weights))
      self%quality = sum(log_weights)**2/sum(log_weights**2)/n_inside
   end subroutine draw_inside

   !> Whether so few draws are effective ones that a Markov chain is the better way.
   pure logical function fits_badly(self)
      class(mixture_move_type), intent(in) :: self
      real(wp), parameter :: least_quality = 0.1_wp

      fits_badly = self%quality < least_quality
   end function fits_badly

   !> Fit the mixture to the archive and to all draws by their weights. Draws outside the support
   !> are data as well, so that the mixture does not avoid the bounds. The archive stays among the
   !> data, so that a tail that the mixture lost comes back.
   subroutine learn(self)
      class(mixture_move_type), intent(inout) :: self
      !> Weight of the archive among the data inside the support.
      real(wp), parameter :: archive_share = 0.3_wp
      integer, parameter :: steps = 6
      !> All points, (dimension, point), and their weights; the archive, the earlier draws, the last
      !> ones, and those outside the support.
      real(wp), allocatable :: points(:, :), weights(:)
      integer :: n_archived, n_before, n

      self%rounds = self%rounds + 1
      n_before = size(self%points, 2)
      n_archived = n_before - size(self%weights)
      n = n_before + size(self%log_weights)
      allocate (points(size(self%points, 1), n + self%n_outer), weights(n + self%n_outer))
      points(:, :n_before) = self%points
      points(:, n_before + 1:n) = self%pool%u
      points(:, n + 1:) = self%outer(:, :self%n_outer)
      weights(n_archived + 1:n_before) = self%weights
      ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep one point from
      ! dominating. Those of a round of draws sum to their effective number.
      associate (last => weights(n_before + 1:n))
         last = exp(self%log_weights - maxval(self%log_weights))
         last = min(last, sum(last)/sqrt(real(size(last), wp)))
         last = last*(sum(last)/sum(last**2))
      end associate
      self%points = points(:, :n)
      self%weights = weights(n_archived + 1:n)
      associate (n_draws => n - n_archived)
         weights(:n_archived) = archive_share*n_draws/n_archived
         weights(n_archived + 1:n) = (1.0_wp - archive_share)*n_draws/sum(self%weights)*self%weights
         weights(n + 1:) = (1.0_wp/self%share_inside - 1.0_wp)*n_draws/max(1, self%n_outer)
      end associate
      call fit_mixture(points, weights, steps, self%fitted)
      call widen_mixture(self%fitted, self%mixture)
   end subroutine learn

   !> Move the parameter j, in place.
   subroutine propose_step(self, stream, j, parameter)
      class(random_walk_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      integer, intent(in) :: j
      real(wp), intent(inout) :: parameter
      real(wp) :: z

      call stream%normal(z)
      parameter = parameter + self%step(j)*z
   end subroutine propose_step

   !> Robbins-Monro on the logarithm of a step (Andrieu & Thoms, Stat. Comput. 18, 343, 2008). The
   !> gain falls with the root of the sweep, so that the step both settles and leaves a bad start
   !> behind. With the 25 the first sweep changes a step by a factor of 1.35 at most.
   subroutine tune_step(self, j, accepted, sweep)
      class(random_walk_type), intent(inout) :: self
      !> Number of the parameter.
      integer, intent(in) :: j
      !> Whether its last step was accepted.
      logical, intent(in) :: accepted
      !> Number of the sweep of the burn-in, from 1.
      integer, intent(in) :: sweep
      !> As in the paper.
      real(wp), parameter :: target_acceptance = 0.23_wp

      associate (gain => 2.0_wp*(sweep + 25)**(-0.5_wp))
         self%step(j) = min(self%greatest(j), &
            & self%step(j)*exp(gain*(merge(1.0_wp, 0.0_wp, accepted) - target_acceptance)))
      end associate
   end subroutine tune_step
end module moves
