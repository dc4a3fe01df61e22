!> Move of a chain by independent draws of a normal mixture, in whitened coordinates. The mixture is
!> fitted to the points of a population and improved by importance sampling.
module mixture_move
   use abstract_sampler, only: outside, target_type
   use ensemble_evolution, only: population_type
   use gaussian_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture, &
      & widen_mixture
   use moves, only: new_points, points_type
   use running_command, only: stop_requested
   use kinds, only: wp
   use random, only: random_stream_type
   use ridge_coordinates, only: whitening_type
   implicit none
   private
   public :: mixture_move_type

   type :: mixture_move_type
      type(whitening_type), private :: whitening
      type(mixture_type), private :: mixture
      !> Estimated effective share of the draws; 0 if they are useless.
      real(wp) :: quality = 0.0_wp
      !> Draws of the mixture, which do not depend on the state of the chain.
      type(points_type) :: pool
      !> Number of the proposed draw in the pool. No step has used those before it. It is 0 if all
      !> draws of all attempts were outside the support.
      integer :: next = 0
   contains
      procedure :: setup, propose, log_density
      procedure, private :: draw
   end type mixture_move_type

contains

   !> Logarithm of the mixture's density at whitened coordinates `u`.
   pure real(wp) function log_density(self, u)
      class(mixture_move_type), intent(in) :: self
      !> (dimension).
      real(wp), intent(in), contiguous :: u(:)

      log_density = log_mixture(self%mixture, u)
   end function log_density

   !> Propose a draw of the support, `pool` at `next`.
   subroutine propose(self, target, stream)
      class(mixture_move_type), intent(inout) :: self
      class(target_type), intent(in) :: target
      type(random_stream_type), intent(inout) :: stream
      integer, parameter :: at_once = 50, most_attempts = 20
      integer :: attempt, last

      last = self%next - 1
      do attempt = 0, most_attempts
         if (attempt > 0) then
            call self%draw(target, stream, at_once)
            last = at_once
         end if
         self%next = findloc(self%pool%log_density(:last) > outside, .true., dim=1, back=.true.)
         if (self%next > 0) return
      end do
   end subroutine propose

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

   !> Fit the mixture to a population, the archive, then improve it by importance sampling. Draws
   !> outside the support are data as well, so that the mixture does not avoid the bounds. The
   !> archive stays among the data, so that a tail that the mixture lost comes back.
   subroutine setup(self, target, population, samples, stream)
      class(mixture_move_type), intent(inout) :: self
      class(target_type), intent(in) :: target
      type(population_type), intent(in) :: population
      !> Number of samples of the chain. A long search is not worth its time for few of them.
      integer, intent(in) :: samples
      type(random_stream_type), intent(inout) :: stream
      integer, parameter :: components = 16, least_draws = 600, most_draws = 3000, &
         & most_outside = 3000, least_rounds = 4, most_rounds = 12
      !> Weight of the archive among the data, and the effective share of draws below which the
      !> search ends: steps along differences alone do better then.
      real(wp), parameter :: archive_share = 0.3_wp, least_quality = 0.01_wp
      type(mixture_type) :: fitted
      !> (dimension, point), (point), (draw of the support), (dimension, draw outside the support).
      real(wp), allocatable :: points(:, :), weights(:), importance(:), rejected(:, :)
      integer :: i, round, n_archived, n_inside, n_outside, n_rejected, n_draws

      self%whitening = population%whitening
      n_draws = min(most_draws, max(least_draws, samples/3))
      n_archived = size(population%u, 2)
      allocate (weights(n_archived + n_draws + most_outside), source=1.0_wp)
      allocate (points(target%dimension, size(weights)), importance(n_draws), &
         & rejected(target%dimension, most_outside))
      points(:, :n_archived) = population%u
      call new_mixture(population%u, components, fitted)
      call fit_mixture(population%u, weights(:n_archived), 15, fitted)
      do round = 1, most_rounds
         if (stop_requested()) return
         call widen_mixture(fitted, self%mixture)
         n_inside = 0
         n_outside = 0
         do while (n_inside < n_draws .and. n_outside < 10*n_draws)
            call self%draw(target, stream, min(n_draws - n_inside, 10*n_draws - n_outside))
            do i = 1, size(self%pool%log_density)
               associate (u => self%pool%u(:, i), density => self%pool%log_density(i))
                  if (density > outside) then
                     n_inside = n_inside + 1
                     points(:, n_archived + n_inside) = u
                     importance(n_inside) = density - self%log_density(u)
                  else
                     n_outside = n_outside + 1
                     if (n_outside <= most_outside) rejected(:, n_outside) = u
                  end if
               end associate
            end do
         end do
         self%quality = 0.0_wp
         if (n_inside == 0) return
         associate (weight => importance(:n_inside))
            weight = exp(weight - maxval(weight))
            self%quality = sum(weight)**2/sum(weight**2)/n_inside
            ! Stop only after the mixture itself has shown that it is good: its draws may have found
            ! a tail.
            if (round == most_rounds .or. (round >= least_rounds .and. self%quality > 0.5_wp)) return
            if (round >= least_rounds &
               & .and. self%quality*n_inside/(n_inside + n_outside) < least_quality) then
               self%quality = 0.0_wp
               return
            end if
            ! Truncated weights (Ionides, J. Comput. Graph. Stat. 17, 295, 2008) keep one point from
            ! dominating.
            weight = min(weight, sum(weight)/sqrt(real(n_inside, wp)))
            weights(:n_archived) = archive_share*n_inside/n_archived
            weights(n_archived + 1:n_archived + n_inside) &
               & = (1.0_wp - archive_share)*n_inside/sum(weight)*weight
         end associate
         n_rejected = min(n_outside, most_outside)
         i = n_archived + n_inside
         points(:, i + 1:i + n_rejected) = rejected(:, :n_rejected)
         weights(i + 1:i + n_rejected) = real(n_outside, wp)/max(1, n_rejected)
         i = i + n_rejected
         call fit_mixture(points(:, :i), weights(:i), 6, fitted)
      end do
   end subroutine setup
end module mixture_move
