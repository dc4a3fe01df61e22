!> Measurements whose grain is not known for certain: each is of one of several orientations, with a probability. Its density is the sum
!> over them. Where no orientation is known all measurements have the same ones, evenly over the sphere.
!>
!> Errors that measurements share are integrated numerically, since given them the measurements are independent. In the basis in which these
!> errors are independent and their effects orthogonal, of root sum of squares s in sds of the measurements, the integrand is a sum of
!> normal densities of width (1 + s²)^(-1/2) or more: the trapezoidal rule with a step of 1.4 widths errs by 1e-4 of each. For small s three
!> points are enough (Gauss-Hermite), and what has hardly an effect is added to the measurements' own variances.
module uncertain_grains
   use chain_diagnostics, only: normal_quantile
   use errors, only: error_type, refuse
   use kinds, only: pi, wp
   use linear_algebra, only: exp_all, symmetric_eigen
   use random, only: random_stream_type
   use statistics, only: sort_order
   use text, only: to_text
   implicit none
   private
   public :: uncertain_grains_type, uncertain_draw_type, new_uncertain_grains

   !> Integration over shared errors: s that is added to own variances, s up to which three points are enough, step in widths, reach in sds.
   real(wp), parameter :: negligible = 0.05_wp, few = 0.4_wp, step = 1.4_wp, reach = 4.5_wp
   integer, parameter :: most_nodes = 1000
   !> Moduli of all orientations are gathered in bins of this part of the smallest sd.
   real(wp), parameter :: bin = 0.25_wp

   type :: uncertain_grains_type
      !> Whether all measurements have the same orientations; and the probability of each orientation, (row).
      logical :: all_alike = .false.
      real(wp), allocatable :: probability(:)
      !> The orientations of measurement i are in `list` from `first`(i) to `first`(i + 1) - 1; not allocated if all are alike.
      integer, allocatable, private :: list(:), first(:)
      !> Shared errors at the nodes of integration, in their sds, (error, node), and what they are of a modulus, (measurement, node);
      !> logarithms of the weights; and the relative variance that is added to that of each measurement.
      real(wp), allocatable :: nodes(:, :)
      real(wp), allocatable, private :: relative(:, :), log_weight(:), own(:)
   contains
      procedure :: mixed, log_likelihood, draw
   end type uncertain_grains_type

   !> Of a crystal the log density of each measurement given all others, and its normal score: the distance in sds of a normal error of the
   !> same probability. Drawn: its grain's modulus given the data, and the measurement anew in one of the orientations that it may be of,
   !> (measurement), in its unit; shared errors given the data, in their sds, (error).
   type :: uncertain_draw_type
      real(wp), allocatable :: log_density(:), score(:), modulus(:), replicated(:), shared(:)
   end type uncertain_draw_type

   !> What a measurement may be of: moduli in its unit, their variances and probabilities; and what `compare` finds: the sds of the
   !> measurement about each, the distances in these, and the probability densities.
   type :: choices_type
      real(wp), allocatable :: value(:), variance(:), probability(:), scale(:), distance(:), density(:)
   end type choices_type

contains

   !> Place the nodes of integration; refused if there are too many.
   subroutine new_uncertain_grains(of, probability, relative, size_of_own, self, error)
      !> The measurement that may be of each orientation, 0: every one, (row).
      integer, intent(in) :: of(:)
      !> Of each orientation, (row).
      real(wp), intent(in) :: probability(:)
      !> Relative shared errors of sd 1, (measurement, error), and relative sds of own ones, (measurement).
      real(wp), intent(in) :: relative(:, :), size_of_own(:)
      type(uncertain_grains_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: vectors(size(relative, 2), size(relative, 2)), squares(size(relative, 2)), width
      real(wp), allocatable :: z(:), weight(:), nodes(:, :)
      integer :: i, j, m, n

      n = size(relative, 1)
      self%probability = probability
      self%all_alike = all(of == 0)
      if (.not. self%all_alike) then
         allocate (self%list(size(of)))
         call sort_order(real(of, wp), self%list)
         self%first = [1, (1 + count(of <= i), i=1, n)]
      end if
      vectors = matmul(transpose(relative/spread(size_of_own, 2, size(squares))), relative/spread(size_of_own, 2, size(squares)))
      call symmetric_eigen(vectors, squares, error)
      if (allocated(error)) return
      allocate (self%own(n), source=0.0_wp)
      allocate (self%nodes(size(squares), 1), source=0.0_wp)
      self%log_weight = [0.0_wp]
      do j = 1, size(squares)
         if (squares(j) < negligible**2) then
            self%own = self%own + matmul(relative, vectors(:, j))**2
            cycle
         end if
         width = 1.0_wp/sqrt(1.0_wp + squares(j))
         m = ceiling(reach/(step*width))
         z = [(step*width*i, i=-m, m)]
         weight = exp(-0.5_wp*z**2)
         if (squares(j) < few**2) then
            z = [-sqrt(3.0_wp), 0.0_wp, sqrt(3.0_wp)]
            weight = [1.0_wp, 4.0_wp, 1.0_wp]
         end if
         m = size(self%nodes, 2)
         if (m*size(z) > most_nodes) then
            call refuse(error, 'the errors that measurements share need '//to_text(m*size(z))//' points of integration where ' &
               & //'orientations are not certain; allowed up to '//to_text(most_nodes)//': state fewer or smaller ones ' &
               & //'(calibration_sd, group, shared_errors)')
            return
         end if
         nodes = self%nodes
         self%nodes = reshape([(nodes + spread(z(i)*vectors(:, j), 2, m), i=1, size(z))], [size(squares), m*size(z)])
         self%log_weight = [(self%log_weight + log(weight(i)/sum(weight)), i=1, size(z))]
      end do
      self%relative = matmul(relative, self%nodes)
   end subroutine new_uncertain_grains

   !> The mean of what each measurement may be of.
   pure function mixed(self, values) result(means)
      class(uncertain_grains_type), intent(in) :: self
      !> (row).
      real(wp), intent(in) :: values(:)
      !> (measurement).
      real(wp) :: means(size(self%own))
      integer :: i

      if (self%all_alike) then
         means = dot_product(self%probability, values)
      else
         do i = 1, size(means)
            associate (rows => self%list(self%first(i):self%first(i + 1) - 1))
               means(i) = dot_product(self%probability(rows), values(rows))
            end associate
         end do
      end if
   end function mixed

   !> What a measurement may be of: of very many moduli those of bins, each between its two nearest; the mean stays, and the variance that
   !> this adds is taken off again.
   pure subroutine gather(self, i, model, variance, width, choices)
      class(uncertain_grains_type), intent(in) :: self
      integer, intent(in) :: i
      !> (row), in the unit of the measurement and its square; and of a bin.
      real(wp), intent(in) :: model(:), variance(:), width
      type(choices_type), intent(inout) :: choices
      real(wp) :: low, share
      real(wp), allocatable :: weight(:), sums(:)
      integer :: bins, j, k

      if (.not. self%all_alike) then
         associate (rows => self%list(self%first(i):self%first(i + 1) - 1))
            choices%value = model(rows)
            choices%variance = variance(rows)
            choices%probability = self%probability(rows)
         end associate
         return
      end if
      ! They are those of the measurement before.
      if (i > 1) return
      choices%value = model
      choices%variance = variance
      choices%probability = self%probability
      low = minval(model)
      ! Nor where a crystal of the prior has moduli that are no numbers.
      if (.not. (maxval(model) - low)/width <= 0.5_wp*size(model)) return
      bins = 2 + int((maxval(model) - low)/width)
      allocate (weight(bins), sums(bins), source=0.0_wp)
      do k = 1, size(model)
         j = 1 + int((model(k) - low)/width)
         share = (model(k) - low)/width - (j - 1)
         weight(j:j + 1) = weight(j:j + 1) + self%probability(k)*[1.0_wp - share, share]
         sums(j:j + 1) = sums(j:j + 1) + self%probability(k)*variance(k)*[1.0_wp - share, share]
      end do
      choices%value = pack([(low + width*(j - 1), j=1, bins)], weight > 0.0_wp)
      choices%variance = pack(sums, weight > 0.0_wp)/pack(weight, weight > 0.0_wp) - width**2/6.0_wp
      choices%probability = pack(weight, weight > 0.0_wp)
   end subroutine gather

   !> Compare the value of measurement i with what it may be of, given the shared errors of the node q.
   pure subroutine compare(self, i, q, measured, scale, choices, log_density)
      class(uncertain_grains_type), intent(in) :: self
      integer, intent(in) :: i, q
      !> Of the measurement; sd of its own error.
      real(wp), intent(in) :: measured, scale
      type(choices_type), intent(inout) :: choices
      !> Of all choices together; `density` is that of each up to a factor.
      real(wp), intent(out) :: log_density
      real(wp) :: half(size(choices%value)), least

      choices%scale = sqrt(scale**2 + choices%variance + self%own(i)*choices%value**2)
      choices%distance = (measured - choices%value*(1.0_wp + self%relative(i, q)))/choices%scale
      half = 0.5_wp*choices%distance**2
      least = minval(half)
      choices%density = half
      call exp_all(least - half, choices%density)
      choices%density = choices%density*choices%probability/choices%scale
      log_density = log(sum(choices%density)) - least - 0.5_wp*log(2.0_wp*pi)
   end subroutine compare

   !> Log densities of the measurements given the shared errors of each node.
   pure subroutine find_densities(self, measured, scale, model, variance, logs)
      class(uncertain_grains_type), intent(in) :: self
      !> As in `log_likelihood`.
      real(wp), intent(in) :: measured(:), scale(:), model(:), variance(:)
      !> (node, measurement).
      real(wp), intent(out) :: logs(:, :)
      type(choices_type) :: choices
      integer :: i, q

      do i = 1, size(measured)
         call gather(self, i, model, variance, bin*minval(scale), choices)
         do q = 1, size(logs, 1)
            call compare(self, i, q, measured(i), scale(i), choices, logs(q, i))
         end do
      end do
   end subroutine find_densities

   !> Logarithm of the density of all measurements, normalised.
   pure real(wp) function log_likelihood(self, measured, scale, model, variance)
      class(uncertain_grains_type), intent(in) :: self
      !> Measurements and sds of their own errors, (measurement); what would be measured in each orientation and its variance, (row).
      real(wp), intent(in) :: measured(:), scale(:), model(:), variance(:)
      real(wp) :: logs(size(self%log_weight), size(measured))

      call find_densities(self, measured, scale, model, variance, logs)
      log_likelihood = log_of_sum(self%log_weight + sum(logs, 2))
   end function log_likelihood

   !> See `uncertain_draw_type`.
   subroutine draw(self, stream, measured, scale, model, variance, found)
      class(uncertain_grains_type), intent(in) :: self
      type(random_stream_type), intent(inout) :: stream
      !> As in `log_likelihood`.
      real(wp), intent(in) :: measured(:), scale(:), model(:), variance(:)
      type(uncertain_draw_type), intent(out) :: found
      !> Of a probability.
      real(wp), parameter :: least = 1.0e-15_wp
      real(wp) :: logs(size(self%log_weight), size(measured)), joint(size(self%log_weight)), z
      type(choices_type) :: choices
      integer :: i, k, q

      call find_densities(self, measured, scale, model, variance, logs)
      joint = self%log_weight + sum(logs, 2)
      q = drawn(stream, exp(joint - maxval(joint)))
      found%shared = self%nodes(:, q)
      allocate (found%log_density(size(measured)), found%score(size(measured)), found%modulus(size(measured)), &
         & found%replicated(size(measured)))
      do i = 1, size(measured)
         found%log_density(i) = log_of_sum(joint) - log_of_sum(joint - logs(:, i))
         call gather(self, i, model, variance, bin*minval(scale), choices)
         call compare(self, i, q, measured(i), scale(i), choices, z)
         found%score(i) = choices%distance(1)
         if (size(choices%value) > 1) then
            z = dot_product(choices%probability, 0.5_wp*erfc(-choices%distance/sqrt(2.0_wp)))
            found%score(i) = normal_quantile(min(1.0_wp - least, max(least, z)))
         end if
         found%modulus(i) = choices%value(drawn(stream, choices%density))
         k = drawn(stream, choices%probability)
         call stream%normal(z)
         found%replicated(i) = choices%value(k)*(1.0_wp + self%relative(i, q)) + choices%scale(k)*z
      end do
   end subroutine draw

   !> A number from 1 with these probabilities, up to a factor.
   integer function drawn(stream, probability)
      type(random_stream_type), intent(inout) :: stream
      real(wp), intent(in) :: probability(:)
      real(wp) :: left

      call stream%uniform(left)
      left = left*sum(probability)
      do drawn = 1, size(probability) - 1
         left = left - probability(drawn)
         if (left < 0.0_wp) exit
      end do
   end function drawn

   pure real(wp) function log_of_sum(logs)
      real(wp), intent(in) :: logs(:)

      log_of_sum = maxval(logs) + log(sum(exp(logs - maxval(logs))))
   end function log_of_sum
end module uncertain_grains
