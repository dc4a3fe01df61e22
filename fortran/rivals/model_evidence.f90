!> The evidence of a model: the probability density of the measurements, with the constants and all
!> other unknowns integrated out under their prior.
!>
!> Newton's method finds the maximum of the posterior in the working coordinates, and Laplace's
!> approximation about it gives the evidence. Along combinations that the measurements do not
!> determine the posterior is a long, curved ridge, perhaps truncated by bounds. There the
!> approximation is improved by importance sampling: points are drawn along the long axes, each is
!> moved along the short axes to the ridge, and draws about it are weighted by the density.
module model_evidence
   use abstract_sampler, only: target_type
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use kinds, only: pi, wp
   use linear_algebra, only: symmetric_eigen
   use small_matrices, only: factor_definite
   use random, only: new_random_stream, random_stream_type
   implicit none
   private
   public :: fit_type, fit_model, log_mass

   !> Coordinates z: w = maximum + axes z.
   type :: fit_type
      !> Whether the evidence is known.
      logical :: found = .false.
      !> Logarithm of the integral of the density over the working coordinates.
      real(wp) :: log_integral = 0.0_wp
      !> Logarithm of the evidence, and Laplace's approximation of it.
      real(wp) :: log_z = -huge(1.0_wp), rough_log_z = -huge(1.0_wp)
      !> The maximum, (dimension), and the principal axes of the curvature there, an sd long, one a
      !> column, (dimension, dimension).
      real(wp), allocatable :: maximum(:), axes(:, :)
      !> Draws in the working coordinates, (dimension, draw), and their weights, whose sum is one.
      real(wp), allocatable :: draws(:, :), weights(:)
   end type fit_type

   !> Longest axis, in log K; an axis beyond the second length is that of a ridge.
   real(wp), parameter :: longest = 1.0_wp, long_axis = 0.05_wp
   !> Step of the differences, in sds: it measures the curvature on the scale of the posterior.
   real(wp), parameter :: step = 0.5_wp
   !> Logarithm of a density that is outside the support, in differences.
   real(wp), parameter :: far_below = -1.0e8_wp

contains

   !> Find the evidence of a model.
   subroutine fit_model(posterior, crystal, is_precise, is_rough, fit, near)
      type(posterior_type), intent(in) :: posterior
      !> Where the search starts, GPa.
      real(wp), intent(in) :: crystal(6, 6)
      !> Whether importance sampling improves Laplace's approximation, as it always does where
      !> limits truncate the posterior.
      logical, intent(in) :: is_precise
      !> Whether the density may have several maxima. The search then begins with larger sds.
      logical, intent(in) :: is_rough
      type(fit_type), intent(out) :: fit
      !> Fit of a model of the same class. If it has as many parameters, the search begins with its
      !> axes.
      type(fit_type), intent(in), optional :: near
      real(wp), parameter :: first_axis = 0.05_wp, widenings(2) = [8.0_wp, 2.5_wp]
      type(posterior_type) :: limited, smooth
      real(wp) :: rough_integral, start(posterior%dimension)
      integer :: i, n

      n = posterior%dimension
      allocate (fit%maximum(n), fit%axes(n, n), source=0.0_wp)
      associate (k => posterior%n_constants)
         fit%maximum(:k) = posterior%prior%logarithms%to_logarithms(crystal)
         do i = k + 1, n
            associate (nuisance => posterior%nuisances(i - k))
               if (nuisance%is_normal) fit%maximum(i) = nuisance%prior(1)
            end associate
         end do
      end associate
      start = fit%maximum
      do i = 1, n
         fit%axes(i, i) = first_axis
      end do
      if (present(near)) then
         if (near%found .and. size(near%maximum) == n) fit%axes = near%axes
      end if
      smooth = posterior
      ! The exact theory of extremely anisotropic crystals would take most of the time.
      call smooth%grains%use_field_up_to(huge(1.0_wp))
      limited = smooth
      if (posterior%prior%is_cut()) smooth%prior = posterior%prior%without_limits()
      do i = 1, merge(size(widenings), 0, is_rough)
         smooth%scale = widenings(i)*posterior%scale
         call climb(smooth, fit)
      end do
      smooth%scale = posterior%scale
      call climb(smooth, fit)
      rough_integral = fit%log_integral
      if (.not. posterior%prior%is_cut()) start = fit%maximum
      if (posterior%prior%is_cut() .or. is_precise) call integrate(limited, smooth, start, fit)
      if (posterior%prior%is_cut()) rough_integral = fit%log_integral
      if (.not. fit%found) return
      fit%log_z = fit%log_integral - log_mass(posterior)
      fit%rough_log_z = rough_integral - log_mass(posterior)
   end subroutine fit_model

   !> Logarithm of the integral of the prior over the working coordinates.
   real(wp) function log_mass(posterior)
      type(posterior_type), intent(in) :: posterior
      integer :: i

      log_mass = posterior%prior%log_mass()
      ! Normal priors of nuisances are normalised in the density.
      do i = 1, size(posterior%nuisances)
         associate (nuisance => posterior%nuisances(i))
            if (nuisance%is_normal) cycle
            log_mass = log_mass + log(nuisance%prior(2) - nuisance%prior(1))
         end associate
      end do
   end function log_mass

   !> Find the maximum, starting from the point and the axes of `fit`, and Laplace's approximation.
   subroutine climb(density, fit)
      class(target_type), intent(in) :: density
      type(fit_type), intent(inout) :: fit
      integer, parameter :: most_steps = 30
      !> Gain of a step in log density that ends the search; that ends it where no step gains; and
      !> the greatest one at a maximum.
      real(wp), parameter :: negligible = 0.01_wp, least_gain = 0.5_wp, most_gain = 10.0_wp
      !> Factor on axes along which the density does not rise as its slope tells.
      real(wp), parameter :: shorter = 0.2_wp
      !> Lengths of the steps that are tried.
      real(wp), parameter :: lengths(7) = [1.0_wp, 0.6_wp, 0.3_wp, 0.1_wp, 0.03_wp, 0.01_wp, 1.5_wp]
      real(wp), dimension(density%dimension) :: gradient, values, slopes, direction
      real(wp), dimension(density%dimension, density%dimension) :: hessian, axes
      real(wp) :: height, gain, growth
      real(wp) :: tried(density%dimension, size(lengths)), heights(size(lengths))
      type(error_type), allocatable :: error
      logical :: is_settled
      integer :: i, k, n

      n = density%dimension
      fit%found = .false.
      do i = 1, most_steps
         call differentiate()
         if (.not. height > far_below) return
         call symmetric_eigen(hessian, values, error)
         if (allocated(error)) return
         ! Where the density is not concave, its slope leads, over a similar distance.
         slopes = matmul(gradient, hessian)
         axes = matmul(fit%axes, hessian)
         do k = 1, n
            growth = 1.0_wp/sqrt(max(abs(values(k)), 1.0e-4_wp))
            growth = min(growth, longest/norm2(axes(:, k)))
            axes(:, k) = growth*axes(:, k)
            slopes(k) = growth*slopes(k)
         end do
         direction = matmul(axes, slopes)
         gain = 0.5_wp*sum(slopes**2)
         fit%log_integral = height + gain + 0.5_wp*n*log(2.0_wp*pi) + log_volume_of(axes)
         fit%found = all(values > 0.0_wp) .and. gain < most_gain
         ! The axes are as long as sds once the curvature along each is about one.
         is_settled = gain < negligible .and. all(abs(log(max(abs(values), 1.0e-4_wp))) &
            & < 0.4_wp .or. norm2(axes, dim=1) > 0.9_wp*longest)
         ! Principal axes, the longest first.
         hessian = matmul(axes, transpose(axes))
         call symmetric_eigen(hessian, values, error)
         if (allocated(error)) return
         fit%axes = hessian(:, n:1:-1)*spread(sqrt(max(values(n:1:-1), tiny(1.0_wp))), 1, n)
         if (is_settled) exit
         do k = 1, size(lengths)
            tried(:, k) = fit%maximum + lengths(k)*direction
         end do
         call density%evaluate_working(tried, heights)
         k = maxloc(heights, dim=1)
         if (heights(k) > height) then
            fit%maximum = tried(:, k)
         else
            if (gain < least_gain) exit
            ! Far from the maximum the density is parabolic on a smaller scale.
            fit%axes = shorter*fit%axes
         end if
      end do

   contains

      !> Set density, gradient, and minus the matrix of second derivatives with respect to z at the
      !> point of the fit, by central differences.
      subroutine differentiate()
         real(wp), allocatable :: points(:, :), heights(:)
         integer :: i, j, k

         allocate (points(n, 1 + n + n**2), heights(1 + n + n**2))
         points = spread(fit%maximum, 2, size(heights))
         k = 1
         do j = 1, n
            do i = 1, j
               points(:, k + 1) = points(:, k + 1) + step*displacement(i, j)
               points(:, k + 2) = points(:, k + 2) - step*displacement(i, j)
               k = k + 2
            end do
         end do
         call density%evaluate_working(points, heights)
         heights = max(heights, far_below)
         height = heights(1)
         k = 1
         do j = 1, n
            do i = 1, j
               hessian(i, j) = -(heights(k + 1) + heights(k + 2) - 2.0_wp*height)/step**2
               if (i == j) gradient(j) = (heights(k + 1) - heights(k + 2))/(2.0_wp*step)
               k = k + 2
            end do
         end do
         do j = 1, n
            do i = 1, j - 1
               hessian(i, j) = 0.5_wp*(hessian(i, j) - hessian(i, i) - hessian(j, j))
               hessian(j, i) = hessian(i, j)
            end do
         end do
      end subroutine differentiate

      !> Along both axes, or along one.
      pure function displacement(i, j) result(d)
         integer, intent(in) :: i, j
         real(wp) :: d(size(fit%maximum))

         d = fit%axes(:, j)
         if (i /= j) d = d + fit%axes(:, i)
      end function displacement
   end subroutine climb

   !> Logarithm of the volume that orthogonal or other axes span.
   pure real(wp) function log_volume_of(axes)
      real(wp), intent(in) :: axes(:, :)
      real(wp) :: rest(size(axes, 1), size(axes, 1)), length
      integer :: j, k

      rest = axes
      log_volume_of = 0.0_wp
      do j = 1, size(axes, 1)
         length = norm2(rest(:, j))
         log_volume_of = log_volume_of + log(length)
         rest(:, j) = rest(:, j)/length
         do k = j + 1, size(axes, 1)
            rest(:, k) = rest(:, k) - dot_product(rest(:, j), rest(:, k))*rest(:, j)
         end do
      end do
   end function log_volume_of

   !> Improve the integral of a fit by importance sampling. The weights of a first round tell where
   !> along the ridge a second one draws.
   subroutine integrate(density, smooth, start, fit)
      class(target_type), intent(in) :: density
      !> A density whose ridge is near that of the first: the same without its limits.
      class(target_type), intent(in) :: smooth
      !> A point, about which the first round draws: within limits it is nearer than the maximum.
      real(wp), intent(in) :: start(:)
      !> Fit of `smooth`, in place of which that of `density` is returned.
      type(fit_type), intent(inout) :: fit
      !> Points along the ridge, and draws about each; degrees of freedom of Student's t; least
      !> effective number of points along the ridge.
      integer, parameter :: nodes = 64, draws = 6, freedom = 6, most_rounds = 8
      real(wp), parameter :: widening = 1.15_wp, least_effective = 6.0_wp, enough = 20.0_wp
      type(random_stream_type) :: stream
      real(wp), allocatable :: z(:, :), centre(:, :), log_q(:), heights(:), mean(:), factor(:, :)
      integer :: n, n_long, j, m, round
      real(wp) :: top, node_weights(nodes), effective, height(1)

      n = size(fit%maximum)
      call density%evaluate_working(reshape(start, [n, 1]), height)
      n_long = count(norm2(fit%axes, dim=1) > long_axis)
      stream = new_random_stream(1, 2)
      allocate (z(n, nodes*draws), centre(n, nodes), log_q(nodes*draws), heights(nodes*draws))
      allocate (mean(n_long), factor(n_long, n_long), source=0.0_wp)
      do j = 1, n_long
         factor(j, j) = 1.0_wp
         mean(j) = dot_product(fit%axes(:, j), start - fit%maximum)/sum(fit%axes(:, j)**2)
      end do
      do round = 1, most_rounds
         centre = 0.0_wp
         do j = 1, nodes
            call draw_student(centre(:n_long, j), top)
            centre(:n_long, j) = mean + matmul(factor, centre(:n_long, j))
            log_q((j - 1)*draws + 1:j*draws) = top - log_volume_of(factor)
         end do
         if (n_long > 0 .and. n_long < n) call move_to_ridge(smooth, fit, n_long, centre)
         do j = 1, size(log_q)
            m = 1 + (j - 1)/draws
            call draw_student(z(n_long + 1:, j), top)
            z(:n_long, j) = centre(:n_long, m)
            z(n_long + 1:, j) = z(n_long + 1:, j) + centre(n_long + 1:, m)
            log_q(j) = log_q(j) + top
         end do
         fit%draws = spread(fit%maximum, 2, size(log_q)) + matmul(fit%axes, z)
         call density%evaluate_working(fit%draws, heights)
         fit%weights = max(heights, far_below) - log_q
         top = maxval(fit%weights)
         fit%found = top > 0.5_wp*far_below
         if (.not. fit%found) then
            factor = 0.5_wp*factor
            cycle
         end if
         fit%weights = exp(max(-700.0_wp, fit%weights - top))
         fit%log_integral = top + log(sum(fit%weights)/size(log_q)) + log_volume_of(fit%axes)
         fit%weights = fit%weights/sum(fit%weights)
         node_weights = sum(reshape(fit%weights, [draws, nodes]), 1)
         effective = 1.0_wp/sum(node_weights**2)
         ! Draws that are all far below a known point have missed the ridge.
         fit%found = effective > least_effective .and. maxval(heights) > height(1) - n
         if (n_long == 0 .or. (round > 1 .and. effective > enough)) exit
         call adapt()
      end do

   contains

      !> Set mean and factor of the proposal along the ridge to those of the weighted points. Few
      !> effective points leave a part of the first covariance.
      subroutine adapt()
         real(wp) :: covariance(n_long, n_long), prior_share
         integer :: i

         mean = matmul(centre(:n_long, :), node_weights)
         covariance = 0.0_wp
         do i = 1, nodes
            associate (d => centre(:n_long, i) - mean)
               covariance = covariance + node_weights(i)*spread(d, 1, n_long)*spread(d, 2, n_long)
            end associate
         end do
         prior_share = sum(node_weights**2)
         factor = (1.0_wp - prior_share)*covariance + prior_share*matmul(factor, transpose(factor))
         call factor_definite(factor, 0.0_wp)
         do i = 2, n_long
            factor(:i - 1, i) = 0.0_wp
         end do
      end subroutine adapt

      !> Draw Student's t in as many coordinates as `x` has, and the logarithm of its density.
      subroutine draw_student(x, log_density)
         real(wp), intent(out) :: x(:)
         real(wp), intent(out) :: log_density
         real(wp) :: g(freedom)
         integer :: k

         k = size(x)
         log_density = 0.0_wp
         if (k == 0) return
         call stream%normals(x)
         call stream%normals(g)
         x = widening*x/sqrt(sum(g**2)/freedom)
         log_density = log_gamma(0.5_wp*(freedom + k)) - log_gamma(0.5_wp*freedom) &
            & - k*(0.5_wp*log(freedom*pi) + log(widening)) &
            & - 0.5_wp*(freedom + k)*log(1.0_wp + sum((x/widening)**2)/freedom)
      end subroutine draw_student
   end subroutine integrate

   !> Move points along the short axes to the ridge of a density.
   subroutine move_to_ridge(density, fit, n_long, z)
      class(target_type), intent(in) :: density
      type(fit_type), intent(in) :: fit
      integer, intent(in) :: n_long
      !> (dimension, point).
      real(wp), intent(inout) :: z(:, :)
      integer, parameter :: most_steps = 6
      !> Density at each point, then beside it along each short axis, (1 + 2 axis, point).
      real(wp), allocatable :: heights(:, :), values(:), points(:, :, :)
      real(wp) :: curvature
      integer :: i, j, k, n

      n = size(z, 1)
      allocate (heights(1 + 2*(n - n_long), size(z, 2)))
      allocate (values(size(heights)), points(n, size(heights, 1), size(heights, 2)))
      do i = 1, most_steps
         do j = 1, size(z, 2)
            points(:, :, j) = spread(z(:, j), 2, size(heights, 1))
            do k = n_long + 1, n
               associate (first => 2*(k - n_long))
                  points(k, first, j) = points(k, first, j) + step
                  points(k, first + 1, j) = points(k, first + 1, j) - step
               end associate
            end do
         end do
         call density%evaluate_working(spread(fit%maximum, 2, size(heights)) &
            & + matmul(fit%axes, reshape(points, [n, size(heights)])), values)
         heights = reshape(max(values, far_below), shape(heights))
         do j = 1, size(z, 2)
            do k = n_long + 1, n
               associate (first => 2*(k - n_long))
                  curvature = (2.0_wp*heights(1, j) - heights(first, j) - heights(first + 1, j)) &
                     & /step**2
                  z(k, j) = z(k, j) + (heights(first, j) - heights(first + 1, j))/(2.0_wp*step) &
                     & /max(0.3_wp, abs(curvature))
               end associate
            end do
         end do
      end do
   end subroutine move_to_ridge

end module model_evidence
