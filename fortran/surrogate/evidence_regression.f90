!> Bayesian linear regression with maximised evidence (paper's Eq. 3-11).
!>
!> y = Φ A + noise of variance 1/beta; A ~ N(0, W²/alpha), W diagonal. With W = 1 the prior is the
!> paper's Eq. 6. Where the terms have degrees, the widths W decay with them: 1 at degree 1, f at
!> degree 2, f² at degree 3; a term of degree 0 is almost free. The decay rate f is chosen by the
!> evidence, as alpha and beta are. The regression works with the whitened coefficients z = A/W,
!> whose prior is N(0, 1/alpha).
!>
!> Observations may be of derivatives. The sd of their noise is a multiple of that of values, chosen
!> by the evidence too; terms and targets are stored divided by it.
module evidence_regression
   use errors, only: error_type
   use kinds, only: pi, wp
   use linear_algebra, only: cholesky_factor, cholesky_inverse, cholesky_solve, gram_of, multiply, &
      & multiply_by_factor, symmetric_eigen
   implicit none
   private
   public :: regression_type, new_regression, add_data, maximise_evidence, compute_posterior
   public :: log_evidence, leave_groups_out, coefficient_mean, coefficient_covariance, &
      & scale_columns, factored_forms

   type :: regression_type
      integer :: n_terms = 0, n_data = 0
      !> Degree of each term, (n_terms); all are 1 where the widths do not depend on degrees.
      integer, allocatable :: degrees(:)
      !> W, and its decay rate: the ratio of the widths of a degree and of the one before. It starts
      !> near the centre of its prior.
      real(wp), allocatable :: prior_width(:)
      real(wp) :: decay_rate = 0.4_wp
      !> Terms (n_terms, n_data) and y, and the same whitened: times W, and divided by the noise.
      real(wp), allocatable, private :: plain_terms(:, :), plain_targets(:)
      real(wp), allocatable :: terms(:, :), targets(:)
      !> Whether each observation is of a derivative, (n_data), and the noise of these relative to
      !> that of values.
      logical, allocatable :: is_slope(:)
      real(wp) :: slope_noise = exp(0.5_wp)
      !> Smallest standard deviation of the noise, in units of y.
      real(wp) :: least_noise = 0.0_wp
      real(wp) :: alpha = 1.0_wp, beta = 1.0_wp
      !> Posterior mean and covariance of z, and the right-hand side Σ terms y of the normal
      !> equations.
      real(wp), allocatable :: mean(:), covariance(:, :), moment(:)
   end type regression_type

   !> Spectrum of the data. The covariance of y is 1/beta + values/alpha along some directions, and
   !> 1/beta in all others. `squares` are the squared components of y along those directions.
   type :: spectrum_type
      integer :: n_data = 0
      real(wp), allocatable :: values(:), squares(:)
      !> Squared length of y outside those directions.
      real(wp) :: rest = 0.0_wp
      !> Gram matrix over terms, (n_terms, n_terms), allocated if the spectrum is its own.
      real(wp), allocatable :: gram(:, :)
   end type spectrum_type

contains

   !> A regression without data.
   subroutine new_regression(degrees, first_sds, least_noise, regression, error)
      !> Degree of each term, (n_terms), not negative.
      integer, intent(in) :: degrees(:)
      !> sds of a coefficient of degree 1 and of the noise until the evidence is maximised, and
      !> least sd of the noise, in units of y; above 0.
      real(wp), intent(in) :: first_sds(2), least_noise
      type(regression_type), intent(out) :: regression
      type(error_type), allocatable, intent(out) :: error

      regression%n_terms = size(degrees)
      allocate (regression%terms(size(degrees), 0), regression%targets(0), regression%is_slope(0))
      regression%plain_terms = regression%terms
      regression%plain_targets = regression%targets
      regression%moment = spread(0.0_wp, 1, size(degrees))
      regression%prior_width = regression%moment + 1.0_wp
      regression%degrees = degrees
      regression%least_noise = least_noise
      call set_decay_rate(regression, regression%decay_rate)
      regression%alpha = first_sds(1)**(-2)
      regression%beta = max(first_sds(2), least_noise)**(-2)
      call compute_posterior(regression, error)
   end subroutine new_regression

   !> Change the decay rate of the prior's widths. The posterior is not computed anew.
   pure subroutine set_decay_rate(regression, decay_rate)
      type(regression_type), intent(inout) :: regression
      real(wp), intent(in) :: decay_rate
      !> Width of a term of degree 0.
      real(wp), parameter :: free = 100.0_wp

      regression%prior_width = merge(decay_rate**max(0, regression%degrees - 1), free, &
         & regression%degrees > 0)
      regression%decay_rate = decay_rate
      call whiten(regression)
   end subroutine set_decay_rate

   !> Whiten all data. The bits do not depend on earlier widths and noises.
   pure subroutine whiten(regression)
      type(regression_type), intent(inout) :: regression
      real(wp) :: noise
      integer :: j

      regression%moment = 0.0_wp
      do j = 1, regression%n_data
         noise = merge(regression%slope_noise, 1.0_wp, regression%is_slope(j))
         regression%targets(j) = regression%plain_targets(j)/noise
         regression%terms(:, j) = regression%prior_width*regression%plain_terms(:, j)/noise
         regression%moment = regression%moment + regression%targets(j)*regression%terms(:, j)
      end do
   end subroutine whiten

   !> Multiply each column of a matrix (n, m) by factors (n), such as the prior's widths.
   pure subroutine scale_columns(factors, matrix)
      real(wp), intent(in) :: factors(:)
      real(wp), intent(inout) :: matrix(:, :)
      integer :: j

      do j = 1, size(matrix, 2)
         matrix(:, j) = factors*matrix(:, j)
      end do
   end subroutine scale_columns

   !> Append observations: terms (n_terms, m) and y (m). The posterior is not computed anew.
   subroutine add_data(regression, terms, y, are_slopes)
      type(regression_type), intent(inout) :: regression
      real(wp), intent(in) :: terms(:, :), y(:)
      !> Whether each is a derivative.
      logical, intent(in) :: are_slopes(:)
      real(wp), allocatable :: larger(:, :)
      integer :: n

      n = regression%n_data
      regression%n_data = n + size(y)
      regression%plain_targets = [regression%plain_targets, y]
      regression%targets = regression%plain_targets
      regression%is_slope = [regression%is_slope, are_slopes]
      ! A function's result would be on the stack, and this array may be large.
      allocate (larger(regression%n_terms, regression%n_data))
      larger(:, :n) = regression%plain_terms
      larger(:, n + 1:) = terms
      call move_alloc(larger, regression%plain_terms)
      deallocate (regression%terms)
      allocate (regression%terms(regression%n_terms, regression%n_data))
      call whiten(regression)
   end subroutine add_data

   !> ln p(y | alpha, beta) of Eq. 8.
   pure elemental real(wp) function log_evidence(spectrum, alpha, beta) result(value)
      type(spectrum_type), intent(in) :: spectrum
      real(wp), intent(in) :: alpha, beta

      value = -0.5_wp*(spectrum%n_data*log(2.0_wp*pi/beta) &
         & + sum(log(1.0_wp + spectrum%values*(beta/alpha))) &
         & + beta*(sum(spectrum%squares/(1.0_wp + spectrum%values*(beta/alpha))) + spectrum%rest))
   end function log_evidence

   !> Noise precision of largest evidence at a given ratio alpha/beta.
   pure real(wp) function best_beta(spectrum, ratio, least_noise) result(beta)
      type(spectrum_type), intent(in) :: spectrum
      real(wp), intent(in) :: ratio, least_noise

      beta = 1.0_wp/max((sum(spectrum%squares/(1.0_wp + spectrum%values/ratio)) &
         & + spectrum%rest)/spectrum%n_data, least_noise**2)
   end function best_beta

   !> Set alpha, beta and decay rate of largest evidence, with 1/beta >= least_noise^2. The decay
   !> rate has a prior from experience.
   subroutine maximise_evidence(regression, error, evidence)
      type(regression_type), intent(inout) :: regression
      type(error_type), allocatable, intent(out) :: error
      !> ln evidence there.
      real(wp), intent(out) :: evidence
      !> Logarithms of the decay rates that are tried, and mean and sd of the prior of the logarithm
      !> (docs/verification/surrogate.md).
      integer, parameter :: n_rates = 14
      real(wp), parameter :: least = -2.1_wp, step = 0.15_wp, typical = -0.9_wp, sd = 0.12_wp
      !> The same of the noise of derivatives.
      integer, parameter :: n_noises = 11
      real(wp), parameter :: least_log_noise = -1.0_wp, log_noise_step = 0.5_wp
      type(spectrum_type) :: spectrum, best
      !> alpha/beta of largest evidence at a decay rate, and ln evidence there.
      real(wp) :: ratio, value, log_rate, best_rate, best_ratio, best_noise
      logical :: decays
      integer :: i

      evidence = 0.0_wp
      if (regression%n_data == 0) return
      evidence = -huge(1.0_wp)
      best_ratio = 1.0_wp
      best_rate = typical
      best_noise = regression%slope_noise
      decays = maxval(regression%degrees) > 1
      do i = 1, merge(n_rates, 1, decays)
         log_rate = least + step*(i - 1)
         if (decays) call set_decay_rate(regression, exp(log_rate))
         call try_present()
         if (allocated(error)) return
      end do
      if (decays) call set_decay_rate(regression, exp(best_rate))
      do i = 1, merge(n_noises, 0, any(regression%is_slope))
         log_rate = best_rate
         regression%slope_noise = exp(least_log_noise + log_noise_step*(i - 1))
         call whiten(regression)
         call try_present()
         if (allocated(error)) return
      end do
      regression%slope_noise = best_noise
      call whiten(regression)
      regression%beta = best_beta(best, best_ratio, regression%least_noise)
      regression%alpha = best_ratio*regression%beta
      call compute_posterior(regression, error, best%gram)

   contains

      !> Compare the evidence at the present decay rate and noise of derivatives with the best.
      subroutine try_present()
         call compute_spectrum(regression, spectrum, error)
         if (allocated(error)) return
         call maximise_over_ratio()
         if (decays) value = value - 0.5_wp*((log_rate - typical)/sd)**2
         value = value - count(regression%is_slope)*log(regression%slope_noise)
         if (value <= evidence) return
         evidence = value
         best_ratio = ratio
         best_rate = log_rate
         best_noise = regression%slope_noise
         best = spectrum
      end subroutine try_present

      !> alpha/beta of largest evidence. For a given ratio of the two the best beta has a closed
      !> form. So one search along the logarithm of the ratio, each step O(terms), finds the global
      !> maximum.
      subroutine maximise_over_ratio()
         integer, parameter :: n_grid = 240
         real(wp), parameter :: golden = 0.6180339887498949_wp
         real(wp) :: scale, low, high, x(n_grid), a, b, c, d, fc, fd
         integer :: j, middle

         ! The grid goes from a prior that constrains only what the data do not determine to one
         ! that the data cannot move.
         scale = log(max(maxval(spectrum%values), tiny(1.0_wp)))
         low = scale + log(1.0e-15_wp)
         high = scale + log(1.0e5_wp)
         x = [(low + (high - low)*(j - 1)/(n_grid - 1), j=1, n_grid)]
         middle = maxloc([(profile(x(j)), j=1, n_grid)], 1)
         a = x(max(1, middle - 1))
         b = x(min(n_grid, middle + 1))
         c = b - golden*(b - a)
         d = a + golden*(b - a)
         fc = profile(c)
         fd = profile(d)
         do while (b - a > 1.0e-9_wp)
            if (fc >= fd) then
               b = d
               d = c
               fd = fc
               c = b - golden*(b - a)
               fc = profile(c)
            else
               a = c
               c = d
               fc = fd
               d = a + golden*(b - a)
               fd = profile(d)
            end if
         end do
         ratio = exp(0.5_wp*(a + b))
         value = profile(log(ratio))
      end subroutine maximise_over_ratio

      pure real(wp) function profile(log_ratio)
         real(wp), intent(in) :: log_ratio
         real(wp) :: beta

         beta = best_beta(spectrum, exp(log_ratio), regression%least_noise)
         profile = log_evidence(spectrum, exp(log_ratio)*beta, beta)
      end function profile
   end subroutine maximise_evidence

   !> Compute the eigenvalues of the Gram matrix of the data, over data or over terms, whichever
   !> are fewer.
   subroutine compute_spectrum(regression, spectrum, error)
      type(regression_type), intent(in) :: regression
      type(spectrum_type), intent(out) :: spectrum
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: gram(:, :), projection(:)
      integer :: n, m, i

      n = regression%n_data
      m = min(n, regression%n_terms)
      spectrum = spectrum_type(n_data=n)
      allocate (spectrum%values(m))
      gram = gram_of(regression%terms, transposed=n <= regression%n_terms)
      if (n > regression%n_terms) spectrum%gram = gram
      call symmetric_eigen(gram, spectrum%values, error)
      if (allocated(error)) return
      if (n <= regression%n_terms) then
         spectrum%values = max(0.0_wp, spectrum%values)
         spectrum%squares = [(dot_product(gram(:, i), regression%targets), i=1, m)]**2
         return
      end if
      ! The rest after projection is computed as a vector: the difference of squares would cancel
      ! for a good fit.
      projection = [(dot_product(gram(:, i), regression%moment), i=1, m)]
      where (spectrum%values > m*epsilon(1.0_wp)*maxval(spectrum%values))
         projection = projection/spectrum%values
      else where
         projection = 0.0_wp
         spectrum%values = 0.0_wp
      end where
      spectrum%squares = projection**2*spectrum%values
      projection = matmul(gram, projection)
      spectrum%rest = sum([(regression%targets(i) &
         & - dot_product(regression%terms(:, i), projection), i=1, n)]**2)
   end subroutine compute_spectrum

   !> Compute mean and covariance from all data at the present alpha, beta (Eq. 7).
   subroutine compute_posterior(regression, error, gram)
      type(regression_type), intent(inout) :: regression
      type(error_type), allocatable, intent(out) :: error
      !> Gram matrix of all data over the terms, (n_terms, n_terms), if it is known.
      real(wp), intent(in), optional :: gram(:, :)
      real(wp), allocatable :: solution(:, :)
      integer :: i

      if (present(gram)) then
         regression%covariance = regression%beta*gram
      else
         regression%covariance = gram_of(regression%terms, factor=regression%beta)
      end if
      do i = 1, regression%n_terms
         regression%covariance(i, i) = regression%covariance(i, i) + regression%alpha
      end do
      call cholesky_factor(regression%covariance, error)
      if (allocated(error)) return
      solution = reshape(regression%beta*regression%moment, [regression%n_terms, 1])
      call cholesky_solve(regression%covariance, solution)
      regression%mean = solution(:, 1)
      call cholesky_inverse(regression%covariance)
   end subroutine compute_posterior

   !> Residual y - prediction, and sd of y (noise included), of each observation when its whole
   !> group is left out. They are exact at the present alpha, beta. Let Q = I - H, H = beta Φ S Φᵀ,
   !> and r the residuals with all data. The residuals without the group B are (Q_BB)^-1 r_B, with
   !> covariance (Q_BB)^-1/beta.
   subroutine leave_groups_out(regression, groups, residual, sd, error)
      type(regression_type), intent(in) :: regression
      !> Group number of each observation, in any order.
      integer, intent(in) :: groups(:)
      real(wp), intent(out) :: residual(:), sd(:)
      type(error_type), allocatable, intent(out) :: error
      !> 1 - h below which it has too few digits, so that the covariance of the data is factored
      !> instead.
      real(wp), parameter :: least_q = 1.0e-7_wp
      real(wp), allocatable :: projected(:, :), q(:, :), all_residuals(:), block_of_q(:, :)
      integer, allocatable :: members(:)
      logical :: over_data
      integer :: n, i, j

      n = regression%n_data
      associate (terms => regression%terms, targets => regression%targets, beta => regression%beta)
         over_data = n <= regression%n_terms
         if (.not. over_data) then
            allocate (projected(regression%n_terms, n))
            call multiply(regression%covariance, terms, projected)
            all_residuals = targets - matmul(regression%mean, terms)
            over_data = any([(1.0_wp - beta*dot_product(terms(:, i), projected(:, i)), i=1, n)] &
               & < least_q)
         end if
         if (over_data) then
            ! Q = (I + beta/alpha Φ Φᵀ)^-1, and r = Q y.
            q = gram_of(terms, transposed=.true., factor=beta/regression%alpha)
            do i = 1, n
               q(i, i) = q(i, i) + 1.0_wp
            end do
            call cholesky_factor(q, error)
            if (allocated(error)) return
            call cholesky_inverse(q)
            all_residuals = matmul(q, targets)
         end if
         do j = 1, n
            members = pack([(i, i=1, n)], groups == groups(j))
            if (members(1) < j) cycle
            if (over_data) then
               block_of_q = q(members, members)
            else
               block_of_q = -beta*matmul(transpose(terms(:, members)), projected(:, members))
               do i = 1, size(members)
                  block_of_q(i, i) = block_of_q(i, i) + 1.0_wp
               end do
            end if
            call cholesky_factor(block_of_q, error)
            if (allocated(error)) return
            call cholesky_inverse(block_of_q)
            residual(members) = matmul(block_of_q, all_residuals(members))
            sd(members) = [(sqrt(block_of_q(i, i)/beta), i=1, size(members))]
         end do
      end associate
   end subroutine leave_groups_out

   !> xᵀ S x of each vector x: |Lᵀ x|² with S = L Lᵀ, or without L, where S is singular to rounding,
   !> a product with S.
   subroutine factored_forms(matrix, factor, vectors, values)
      !> S, symmetric and not negative, (n, n); vectors, (n, m).
      real(wp), intent(in), contiguous :: matrix(:, :), vectors(:, :)
      !> L, lower, allocated if S has it.
      real(wp), intent(in), allocatable :: factor(:, :)
      !> (m).
      real(wp), intent(out) :: values(:)
      real(wp), allocatable :: product(:, :)

      product = vectors
      if (allocated(factor)) then
         call multiply_by_factor(factor, product)
         values = sum(product**2, 1)
      else
         call multiply(matrix, vectors, product)
         values = max(0.0_wp, sum(vectors*product, 1))
      end if
   end subroutine factored_forms

   !> Posterior mean of A.
   pure function coefficient_mean(regression) result(mean)
      type(regression_type), intent(in) :: regression
      real(wp) :: mean(regression%n_terms)

      mean = regression%prior_width*regression%mean
   end function coefficient_mean

   !> Posterior covariance of A.
   pure subroutine coefficient_covariance(regression, covariance)
      type(regression_type), intent(in) :: regression
      real(wp), allocatable, intent(out) :: covariance(:, :)

      covariance = spread(regression%prior_width, 1, regression%n_terms) &
                  & *spread(regression%prior_width, 2, regression%n_terms)*regression%covariance
   end subroutine coefficient_covariance
end module evidence_regression
