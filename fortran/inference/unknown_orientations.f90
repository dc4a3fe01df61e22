!> Likelihood of measurements in grains of unknown orientation: the density of each is its mean over
!> all directions.
!>
!> Errors that measurements share are integrated numerically, since the measurements are independent
!> given these errors. Consider the basis in which the errors are independent and their effects
!> orthogonal, with a root sum of squares s in sds of the measurements. There the integrand is a sum
!> of normal densities of width (1 + s²)^(-1/2) or more. The trapezoidal rule with a step of 1.4
!> widths has an error of 1e-4 of each.
!>
!> Diagnostics and predictions use the mean and the variance of the moduli over all directions, see
!> `evaluate_grains`.
module unknown_orientations
   use errors, only: error_type, refuse
   use kinds, only: pi, wp
   use linear_algebra, only: exp_all, symmetric_eigen
   use observables, only: observable_type
   use text, only: to_text
   implicit none
   private
   public :: unknown_orientations_type

   !> Integration over shared errors: greatest s that is left out, step in widths of the integrand,
   !> half the range in sds.
   real(wp), parameter :: negligible = 0.05_wp, step = 1.4_wp, half_range = 4.5_wp
   integer, parameter :: most_nodes = 1000
   !> The moduli of all directions are gathered in bins of this width, as a part of the smallest sd,
   !> or in this number of wider ones.
   real(wp), parameter :: bin_width = 0.25_wp, most_bins = 500.0_wp

   type :: unknown_orientations_type
      !> Probability of each direction, (direction).
      real(wp), allocatable :: probability(:)
      !> Measurements and the sds of their own errors, (measurement).
      real(wp), allocatable :: measured(:), sd(:)
      type(observable_type) :: observable
      !> Shared errors at the nodes of integration, relative to a modulus, (measurement, node), and
      !> logarithms of the weights, (node).
      real(wp), allocatable :: relative(:, :), log_weight(:)
   contains
      procedure :: set_nodes, log_likelihood
   end type unknown_orientations_type

contains

   !> Place the nodes of integration; refuse if there are too many.
   subroutine set_nodes(self, relative, error)
      class(unknown_orientations_type), intent(inout) :: self
      !> Effect of one sd of each shared error relative to a modulus, (measurement, error).
      real(wp), intent(in) :: relative(:, :)
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: scaled(size(relative, 1), size(relative, 2)), &
         & vectors(size(relative, 2), size(relative, 2))
      real(wp) :: squares(size(relative, 2)), width
      real(wp), allocatable :: z(:)
      integer :: i, j, m

      scaled = relative*spread(self%measured/self%sd, 2, size(squares))
      vectors = matmul(transpose(scaled), scaled)
      call symmetric_eigen(vectors, squares, error)
      if (allocated(error)) return
      allocate (self%relative(size(relative, 1), 1), self%log_weight(1), source=0.0_wp)
      scaled = matmul(relative, vectors)
      do j = 1, size(squares)
         if (squares(j) < negligible**2) cycle
         width = step/sqrt(1.0_wp + squares(j))
         z = [(width*i, i=-ceiling(half_range/width), ceiling(half_range/width))]
         m = size(self%log_weight)
         if (m*size(z) > most_nodes) then
            call refuse(error, 'the errors that grains of unknown orientation share need ' &
               & //to_text(m*size(z))//' points of integration; allowed '//to_text(most_nodes) &
               & //': state fewer or smaller ones (calibration_sd, shared_errors)')
            return
         end if
         self%relative = reshape([(self%relative + spread(z(i)*scaled(:, j), 2, m), i=1, &
            & size(z))], [size(scaled, 1), m*size(z)])
         self%log_weight = [(self%log_weight - 0.5_wp*z(i)**2, i=1, size(z))]
      end do
      self%log_weight = self%log_weight - log_of_sum(self%log_weight)
   end subroutine set_nodes

   !> Logarithm of the density of all measurements, normalised.
   pure real(wp) function log_likelihood(self, moduli, scatter_sd, factor)
      class(unknown_orientations_type), intent(in) :: self
      !> Moduli of all directions, GPa, (direction).
      real(wp), intent(in) :: moduli(:)
      !> Relative sd of differences between grains, and factor of the laboratory.
      real(wp), intent(in) :: scatter_sd, factor
      !> Value and variance in the unit of the measurements and its square, and probability, (bin).
      real(wp), allocatable, dimension(:) :: value, variance, probability
      real(wp), allocatable, dimension(:) :: slope, scale, misfit, density
      real(wp) :: joint(size(self%log_weight)), low, width, share
      integer :: bins, i, j, q

      ! Bin the moduli of all directions, converted to the kind that was measured. Each modulus is
      ! shared between the two nearest of equidistant values. This keeps the mean, and the variance
      ! that it adds is subtracted.
      low = minval(moduli)
      width = max(bin_width*minval(self%sd), (maxval(moduli) - low)/most_bins)
      bins = 2 + int(min(most_bins, (maxval(moduli) - low)/width))
      allocate (probability(bins), source=0.0_wp)
      do i = 1, size(moduli)
         share = (moduli(i) - low)/width
         ! A crystal of the prior may have moduli that are not numbers.
         j = max(1, min(bins - 1, 1 + int(share)))
         share = share - (j - 1)
         probability(j:j + 1) = probability(j:j + 1) + self%probability(i)*[1.0_wp - share, share]
      end do
      value = [(low + width*(j - 1), j=1, bins)]
      variance = (scatter_sd*value)**2 - width**2/6.0_wp
      slope = spread(1.0_wp, 1, bins)
      call self%observable%to_measured(value, slope)
      value = factor*value
      variance = variance*(factor*slope)**2
      density = value
      joint = self%log_weight - 0.5_wp*size(self%measured)*log(2.0_wp*pi)
      do i = 1, size(self%measured)
         scale = sqrt(max(0.5_wp*self%sd(i)**2, self%sd(i)**2 + variance))
         do q = 1, size(joint)
            misfit = 0.5_wp*((self%measured(i) - value*(1.0_wp + self%relative(i, q)))/scale)**2
            call exp_all(minval(misfit) - misfit, density)
            joint(q) = joint(q) + log(sum(density*probability/scale)) - minval(misfit)
         end do
      end do
      log_likelihood = log_of_sum(joint)
   end function log_likelihood

   pure real(wp) function log_of_sum(logs)
      real(wp), intent(in) :: logs(:)

      log_of_sum = maxval(logs) + log(sum(exp(logs - maxval(logs))))
   end function log_of_sum
end module unknown_orientations
