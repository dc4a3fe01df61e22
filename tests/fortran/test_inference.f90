!> Step 2: polynomials of the covariance, mixtures, samplers on known targets, error models.
program test_inference
   use abstract_sampler, only: chain_type, sampler_type
   use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
   use chain_diagnostics, only: diagnose_chains, diagnostics_type, normal_quantile
   use error_models, only: error_model_type, new_error_model
   use independent_draws, only: pareto_shape
   use ensemble_evolution, only: next_inverse
   use errors, only: error_type
   use student_mixture, only: draw_mixture, fit_mixture, log_mixture, mixture_type, new_mixture
   use kinds, only: pi, wp
   use known_targets, only: approximated_wavy_type, banana_type, counting_sampler_type, &
      & drawn_wavy_type, wavy_type
   use observables, only: modulus_kinds, new_observable, observable_type
   use settings_schema, only: measurements_settings_type
   use random, only: new_random_stream, random_stream_type
   use samplers, only: chains_type, new_sampler, &
      & run_settings_type, sample_chains, sampler_names
   use small_matrices, only: factor_columns
   use statistics, only: covariance_of, flattened
   use testing, only: check, check_close, check_refused, check_success, class_of, finish, long_cases
   use text, only: split_list, to_text
   use linear_algebra, only: exp_all, transposed_product
   implicit none
   character(len=:), allocatable :: names(:)
   integer :: k

   ! Some 10,000 effective samples, and 2,000: five standard errors.
   if (long_cases()) then
      call test_wavy_density(21, 2000, 3000, 0.11_wp)
   else
      call test_kernels()
      call test_cooling()
      call test_factor_columns()
      call test_error_models()
      call test_observables()
      call test_mixture()
      call test_pareto_shape()
      ! Those of the list, and the one that draws from priors.
      names = split_list(sampler_names//', direct')
      do k = 1, size(names)
         call test_any_sampler(trim(names(k)))
      end do
      call test_efforts()
      call test_walkers()
      call test_wavy_density(6, 1000, 10000, 0.05_wp)
      ! Chains are worth 6000 independent draws along the ridge (the paper's: 400) and 13000 or more
      ! across it.
      call test_sampler('ensemble', 20000, 20000, 0.05_wp)
      call test_sampler('scmh', 200000, 5000, 0.05_wp)
      call test_diagnostics()
   end if
   call finish()

contains

   subroutine test_kernels()
      real(wp) :: x(37), y(37), a(37, 6), z(6)
      integer :: i

      do i = 1, 37
         x(i) = -60.0_wp + 3.31_wp*i
      end do
      call exp_all(x, y)
      call check('exp_all to two units in the last place', &
         & maxval(abs(y/exp(x) - 1.0_wp)) <= 4.0_wp*epsilon(1.0_wp))
      do i = 1, 6
         a(:, i) = sin(x*i)
      end do
      call transposed_product(a, x, z)
      call check('transposed_product', maxval(abs(z - matmul(transpose(a), x))) < 1.0e-11_wp)
   end subroutine test_kernels

   !> A hundred points, then sixty more copies of the most probable one: with these alone any
   !> temperature would do.
   subroutine test_cooling()
      integer :: i
      real(wp) :: weights(100)
      real(wp), parameter :: density(100) = [(-0.1_wp*i, i=1, 99), 5.0_wp]

      weights = exp(next_inverse(density, 0.0_wp)*density)
      call check_close('a quarter of the points is of use', sum(weights)**2/sum(weights**2), &
         & 25.0_wp, 0.01_wp)
      call check('copies are one point', &
         & next_inverse(density([(min(i, 100), i=1, 160)]), 0.0_wp) < 1.0e-6_wp)
   end subroutine test_cooling

   !> The same covariance by no more columns than it has directions, whatever their order, and none
   !> where nothing matters.
   subroutine test_factor_columns()
      integer, parameter :: m = 12, n = 30, rank = 5
      real(wp) :: u(m, n), directions(m, rank), shares(rank, n)
      real(wp), allocatable :: f(:, :)
      type(random_stream_type) :: stream
      integer :: i, j

      stream = new_random_stream(5, 1)
      do j = 1, n
         do i = 1, m
            call stream%normal(u(i, j))
         end do
      end do
      call factor_columns(u, f)
      call check_close('a whole covariance', &
         & maxval(abs(matmul(f, transpose(f)) - matmul(u, transpose(u)))), 0.0_wp, 1.0e-7_wp)
      directions = u(:, :rank)
      shares = u(:rank, :)
      u = matmul(directions, shares)
      call factor_columns(u, f)
      call check('one of few directions has as few columns', size(f, 2) == rank)
      call check_close('and is the same', &
         & maxval(abs(matmul(f, transpose(f)) - matmul(u, transpose(u)))), 0.0_wp, 1.0e-7_wp)
      call factor_columns(u*1.0e-6_wp, f)
      call check('what does not matter beside the noise has none', size(f, 2) == 0)
   end subroutine test_factor_columns

   !> Shared errors against the determinant and the inverse in closed form; scales; words.
   subroutine test_error_models()
      class(error_model_type), allocatable :: model
      type(error_type), allocatable :: error
      real(wp), allocatable :: b(:), l(:, :)
      real(wp) :: r(4), u(4, 2), value, expected, large
      integer :: k

      call new_error_model(likelihood_of('normal', 0.0_wp), model, error)
      call check_success('normal errors', error)
      ! Two columns that are the same, s q with |q| = 1, are errors of covariance 2 s² q qᵀ.
      r = [3.5_wp, 2.5_wp, 1.0_wp, -1.0_wp]
      do k = 0, 9, 3
         large = 10.0_wp**k
         u = 0.5_wp*large
         call model%integrate(r, u, b, l, value)
         expected = -0.5_wp*(sum(r**2) - sum(0.5_wp*r)**2 + sum(0.5_wp*r)**2/(1.0_wp &
            & + 2.0_wp*large**2)) - 0.5_wp*log(1.0_wp + 2.0_wp*large**2) - 2.0_wp*log(2.0_wp*pi)
         call check_close('shared errors of sd 10^'//to_text(k), value, expected, 1.0e-9_wp)
      end do
      call check_close('normal density', model%log_density(r, 2.0_wp), &
         & -sum(r**2)/8.0_wp - 4.0_wp*log(2.0_wp) - 2.0_wp*log(2.0_wp*pi), 1.0e-13_wp)
      call new_error_model(likelihood_of('student', 3.0_wp), model, error)
      call check_close('Student''s t of sd 1: its scale', model%scale, &
         & 1.0_wp/sqrt(3.0_wp), 1.0e-15_wp)
      ! Three degrees of freedom: 2/(pi sqrt(3)) (1 + x²/3)^-2.
      call check_close('density of Student''s t', model%log_density([1.5_wp], 1.0_wp), &
         & log(2.0_wp/(pi*sqrt(3.0_wp))/1.75_wp**2), 1.0e-14_wp)
      u = 0.0_wp
      call model%integrate(r, u, b, l, value)
      call check_close('Student''s t without shared errors', value, &
         & model%log_density(r, 1.0_wp), 1.0e-13_wp)
      call new_error_model(likelihood_of('student', 1.5_wp), model, error)
      call check_close('without a variance the sd is the scale', model%scale, 1.0_wp, 0.0_wp)
      call new_error_model(likelihood_of('laplace', 1.0_wp), model, error)
      call check_refused('another likelihood', error, 'normal, student')
   end subroutine test_error_models

   !> The list comes from the module. The effective modulus in closed form.
   subroutine test_observables()
      type(measurements_settings_type) :: settings
      type(observable_type) :: observable
      type(error_type), allocatable :: error
      real(wp) :: modulus(1)
      integer :: k

      settings = measurements_settings_type(indenter_modulus_gpa=1140.0_wp, indenter_nu=0.07_wp, &
         & sample_nu=0.3_wp)
      do k = 1, size(modulus_kinds)
         call test_any_observable(trim(modulus_kinds(k)), settings)
      end do
      call new_observable('effective_modulus', settings, observable, error)
      modulus = 200.0_wp
      call observable%to_measured(modulus)
      call check_close('effective modulus', modulus(1), &
         & 1.0_wp/(1.0_wp/200.0_wp + (1.0_wp - 0.07_wp**2)/1140.0_wp), 1.0e-12_wp)
      call new_observable('modulus', settings, observable, error)
      call check_refused('another kind', error, 'sample_modulus')
   end subroutine test_observables

   !> What any kind of modulus does; `test_any_observable_has_a_column` of test_tables.py has label
   !> and unit. It is positive and grows with the indentation modulus, by the factor and the
   !> compliance of the type: m = a M/(1 + d M), which has the inverse M = m/(a - d m). The
   !> derivatives that come with the moduli are multiplied by its slope. Properties that no material
   !> has are refused.
   subroutine test_any_observable(name, settings)
      character(len=*), intent(in) :: name
      type(measurements_settings_type), intent(in) :: settings
      real(wp), parameter :: step = 1.0e-4_wp, moduli(6) = [0.01_wp, 3.0_wp, 70.0_wp, 200.0_wp, &
         & 450.0_wp, 1200.0_wp]
      type(observable_type) :: observable
      type(measurements_settings_type) :: wrong
      type(error_type), allocatable :: error
      real(wp), dimension(6) :: values, slopes, above, below
      character(len=:), allocatable :: title

      title = 'any '//name//': '
      call new_observable(name, settings, observable, error)
      call check_success(title//'is known', error)
      call check(title//'its name', observable%name == name)
      values = moduli
      slopes = [2.0_wp, 1.0_wp, -1.0_wp, 0.5_wp, 0.0_wp, 3.0_wp]
      call observable%to_measured(values, slopes)
      call check(title//'positive and growing', all(values > 0.0_wp) &
         & .and. all(values(2:) > values(:5)))
      call check_close(title//'its inverse', maxval(abs(values/(observable%factor &
         & - observable%compliance*values)/moduli - 1.0_wp)), 0.0_wp, 1.0e-12_wp)
      above = moduli*(1.0_wp + step)
      below = moduli*(1.0_wp - step)
      call observable%to_measured(above)
      call observable%to_measured(below)
      above = (above - below)/(2.0_wp*step*moduli)
      call check_close(title//'its slope', maxval(abs(slopes - above*[2.0_wp, 1.0_wp, -1.0_wp, &
         & 0.5_wp, 0.0_wp, 3.0_wp])), 0.0_wp, 1.0e-7_wp)
      above = moduli
      call observable%to_measured(above)
      call check(title//'the same without derivatives', all(above == values))
      wrong = settings
      wrong%indenter_modulus_gpa = -1.0_wp
      call new_observable(name, wrong, observable, error)
      call check_refused(title//'a negative modulus', error, 'must be positive')
   end subroutine test_any_observable

   !> A fit recovers the two clouds it is given, and the density integrates to one.
   subroutine test_mixture()
      integer, parameter :: many = 4000, cells = 2000
      ! About 1e-5 of a mixture of Student's t of four degrees is outside the square.
      real(wp), parameter :: width = 60.0_wp
      type(mixture_type) :: mixture
      type(random_stream_type) :: stream
      real(wp) :: points(2, many), weights(many), z, total, u(2)
      integer :: i, j

      stream = new_random_stream(5, 1)
      do i = 1, many
         do j = 1, 2
            call stream%normal(z)
            points(j, i) = z
         end do
         if (mod(i, 4) == 0) points(1, i) = points(1, i) + 8.0_wp
      end do
      weights = 1.0_wp
      call new_mixture(points, 4, mixture)
      call fit_mixture(points, weights, 200, mixture)
      total = 0.0_wp
      do j = 1, cells
         do i = 1, cells
            u = -width + 2.0_wp*width*([i, j] - 0.5_wp)/cells
            total = total + exp(log_mixture(mixture, u))*(2.0_wp*width/cells)**2
         end do
      end do
      call check_close('a mixture integrates to one', total, 1.0_wp, 1.0e-4_wp)
      call check_close('weight of the far cloud', &
         & sum(mixture%weight, mixture%mean(:, 1) > 4.0_wp), 0.25_wp, 0.01_wp)
      total = 0.0_wp
      do i = 1, 20000
         call draw_mixture(mixture, stream, u)
         if (u(1) > 4.0_wp) total = total + 1.0_wp/20000
      end do
      ! Four standard errors of a share of one quarter.
      call check_close('share of draws there', total, 0.25_wp, 0.0123_wp)
   end subroutine test_mixture

   !> The shape k of quantiles of Pareto distributions, against psislw of ArviZ 0.23.
   subroutine test_pareto_shape()
      integer, parameter :: n = 2000
      real(wp), parameter :: shapes(4) = [0.1_wp, 0.4_wp, 0.7_wp, 1.1_wp], of_arviz(4) = &
         & [0.13636156888512657_wp, 0.40749896921029505_wp, 0.6786439979721475_wp, &
         & 1.0401801989104693_wp]
      real(wp) :: values(n)
      integer :: i, j

      do j = 1, size(shapes)
         values = [(((i - 0.5_wp)/n)**(-shapes(j)), i=1, n)]
         call check_close('Pareto shape '//to_text(shapes(j)), pareto_shape(values), of_arviz(j), &
            & 1.0e-9_wp)
      end do
   end subroutine test_pareto_shape

   pure function likelihood_of(errors, student_dof) result(likelihood)
      character(len=*), intent(in) :: errors
      real(wp), intent(in) :: student_dof
      type(measurements_settings_type) :: likelihood

      likelihood%likelihood = errors
      likelihood%student_dof = student_dof
   end function likelihood_of

   !> What any sampler does. Its draws have the mean and the covariance of the density, and their
   !> log densities. A stream has the same draws whatever thread runs it, and another stream
   !> has others. A short run has as many samples as it was asked for. Nothing starts without a
   !> support.
   subroutine test_any_sampler(name)
      character(len=*), intent(in) :: name
      integer, parameter :: samples = 20000
      ! Five standard errors of 2000 independent draws.
      real(wp), parameter :: tolerance = 0.11_wp
      type(drawn_wavy_type) :: wavy
      type(banana_type) :: nowhere
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains, other
      type(chain_type) :: chain
      type(random_stream_type) :: stream
      type(error_type), allocatable :: error
      real(wp), allocatable :: straight(:, :), density(:)
      real(wp), target :: draws(2, 5), log_density(5)
      real(wp) :: mean(3), covariance(3, 3)
      integer :: threads, i

      wavy%dimension = 3
      call new_sampler(name, 2000, sampler, error)
      call check_success('any '//name//': is known', error)
      call sample_chains(wavy, sampler, run_settings_type(samples, 4, 1, 3), chains, error)
      call check_success('any '//name//': chains', error)
      call check('any '//name//': number of samples', all(shape(chains%draws) == [3, samples, 4]) &
         & .and. all(shape(chains%log_density) == [samples, 4]))
      call check('any '//name//': share of accepted proposals', &
         & all(chains%acceptance > 0.0_wp .and. chains%acceptance <= 1.0_wp))
      allocate (density(4*samples))
      call wavy%evaluate(flattened(chains%draws), density)
      call check_close('any '//name//': log densities are those of the draws', &
         & maxval(abs(density - reshape(chains%log_density, [4*samples]))), 0.0_wp, 1.0e-9_wp)
      straight = wavy%straightened(flattened(chains%draws))
      mean = 0.0_wp
      mean(1) = normal_density(-1.0_wp)/(0.5_wp*(1.0_wp + erf(1.0_wp/sqrt(2.0_wp))))
      covariance = reshape([1.0_wp - mean(1) - mean(1)**2, 0.0_wp, 0.0_wp, &
         & 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3])
      do i = 1, 3
         call check_close('any '//name//': mean '//to_text(i), sum(straight(i, :))/(4*samples), &
            & mean(i), tolerance)
      end do
      call check_close('any '//name//': covariance', &
         & maxval(abs(covariance_of(straight) - covariance)), 0.0_wp, 1.4_wp*tolerance)
      if (name == 'ensemble') call check_integral(chains)
      do threads = 2, 4, 2
         if (allocated(other%samplers)) deallocate (other%samplers)
         call sample_chains(wavy, sampler, run_settings_type(samples, 4, threads, 3), other, &
            & error)
         call check('any '//name//': the same to the bit on more threads', &
            & all(other%draws == chains%draws) .and. all(other%log_density == chains%log_density) &
            & .and. all(other%acceptance == chains%acceptance))
      end do
      call check('any '//name//': another stream has other draws', &
         & .not. any(chains%draws(1, :, 1) == chains%draws(1, :, 2)))
      call sample_chains(wavy, sampler, run_settings_type(7, 1, 1, 3), other, error)
      call check('any '//name//': few samples', all(shape(other%draws) == [3, 7, 1]) &
         & .and. all(other%draws(1, :, :) > -1.0_wp))
      nowhere%dimension = 2
      nowhere%lower = [2.0_wp, 2.0_wp]
      nowhere%upper = [1.0_wp, 1.0_wp]
      stream = new_random_stream(3, 1)
      chain = chain_type(draws, log_density)
      call sampler%run(1, nowhere, stream, chain)
      call check('any '//name//': nothing starts without a support', .not. chain%started)
   end subroutine test_any_sampler

   !> The draws of the wavy density are independent, and their weights give its integral.
   subroutine check_integral(chains)
      type(chains_type), intent(in) :: chains
      real(wp), parameter :: integral = 1.5_wp*log(2.0_wp*pi) &
         & + log(0.5_wp*(1.0_wp + erf(1.0_wp/sqrt(2.0_wp))))
      integer :: k

      call check('independent draws of two runs', allocated(chains%estimates))
      if (.not. allocated(chains%estimates)) return
      do k = 1, 2
         associate (estimate => chains%estimates(k))
            call check_close('the integral by weights', estimate%log_integral, integral, &
               & 4.0_wp*estimate%log_integral_error)
            call check('its error is small', estimate%log_integral_error < 0.01_wp)
         end associate
      end do
   end subroutine check_integral

   !> The ensemble in many dimensions where no polynomial makes the density straight: its moments.
   subroutine test_wavy_density(dimension, burn_in, samples, tolerance)
      integer, intent(in) :: dimension, burn_in, samples
      real(wp), intent(in) :: tolerance
      type(wavy_type) :: wavy
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains
      type(error_type), allocatable :: error
      real(wp), allocatable :: second(:, :), third(:, :)
      character(len=30) :: words
      real(wp) :: mean

      wavy%dimension = dimension
      words = 'a wavy density in '//to_text(dimension)
      call new_sampler('ensemble', burn_in, sampler, error)
      call sample_chains(wavy, sampler, run_settings_type(samples, 4, 2, 3), chains, error)
      call check_success(trim(words)//': chains', error)
      mean = normal_density(-1.0_wp)/(0.5_wp*(1.0_wp + erf(1.0_wp/sqrt(2.0_wp))))
      second = chains%draws(2, :, :) + 0.8_wp*sin(2.0_wp*chains%draws(1, :, :))
      third = chains%draws(3, :, :) + 0.3_wp*chains%draws(1, :, :)**2
      call check_close(trim(words)//': a cut normal', average(chains%draws(1, :, :)), &
         & mean, tolerance)
      call check_close(trim(words)//': its square', average(chains%draws(1, :, :)**2), &
         & 1.0_wp - mean, tolerance)
      call check_close(trim(words)//': the wave', average(second**2), 1.0_wp, 1.4_wp*tolerance)
      call check_close(trim(words)//': the wave does not depend', &
         & average(second*sin(2.0_wp*chains%draws(1, :, :))), 0.0_wp, tolerance)
      call check_close(trim(words)//': the bend', average(third**2), 1.0_wp, 1.4_wp*tolerance)
      call check_close(trim(words)//': the bend does not depend', &
         & average(third*chains%draws(1, :, :)), 0.0_wp, tolerance)
      call check_close(trim(words)//': the others', average(chains%draws(dimension, :, :)**2), &
         & 1.0_wp, 1.4_wp*tolerance)
   end subroutine test_wavy_density

   !> A further effort is made by the runs that have no estimate; the last one by all.
   subroutine test_efforts()
      integer, parameter :: efforts = 3, never = efforts + 1
      type(wavy_type) :: wavy
      type(counting_sampler_type) :: sampler
      type(counting_sampler_type) :: samplers(2)
      type(chains_type) :: chains
      type(error_type), allocatable :: error
      integer :: runs(2), case

      wavy%dimension = 3
      sampler%efforts = efforts
      do case = 1, 2
         samplers = sampler
         samplers(2)%first_good_effort = merge(2, never, case == 1)
         if (allocated(chains%samplers)) deallocate (chains%samplers)
         allocate (chains%samplers(2), source=samplers)
         call sample_chains(wavy, sampler, run_settings_type(10, 2, 1, 3), chains, error)
         call check_success('efforts', error)
         select type (used => chains%samplers)
         type is (counting_sampler_type)
            runs = used%runs
         end select
         if (case == 1) then
            call check('efforts: only the run without an estimate is repeated', all(runs == [1, 2]))
            call check('efforts: both have estimates', allocated(chains%estimates))
         else
            call check('efforts: the last one is of all runs', all(runs == [2, efforts]))
            call check('efforts: one has no estimate', .not. allocated(chains%estimates))
         end if
      end do
   end subroutine test_efforts

   !> The Markov chains that follow independent draws: an approximation of the density, by which
   !> they walk, does not change their moments.
   subroutine test_walkers()
      integer, parameter :: samples = 40000, independent_draws = 2, markov_chains = 3
      ! Five standard errors of 10,000 independent draws.
      real(wp), parameter :: tolerance = 0.05_wp
      type(approximated_wavy_type) :: wavy
      class(sampler_type), allocatable :: sampler
      type(chain_type) :: chain
      type(random_stream_type) :: stream
      type(error_type), allocatable :: error
      real(wp), target :: draws(3, samples), log_density(samples)
      real(wp) :: straight(3, samples), density(samples), mean

      wavy%dimension = 3
      call new_sampler('ensemble', 2000, sampler, error)
      stream = new_random_stream(3, 1)
      chain = chain_type(draws, log_density)
      call sampler%run(independent_draws, wavy, stream, chain)
      call check('before walkers: independent draws', allocated(chain%estimate))
      call sampler%run(markov_chains, wavy, stream, chain)
      call check('walkers: no independent draws', .not. allocated(chain%estimate))
      call check('walkers: share of accepted steps', chain%acceptance > 0.3_wp &
         & .and. chain%acceptance < 1.0_wp)
      call wavy%evaluate(draws, density)
      call check_close('walkers: log densities are the exact ones', &
         & maxval(abs(density - log_density)), 0.0_wp, 1.0e-9_wp)
      straight = wavy%straightened(draws)
      mean = normal_density(-1.0_wp)/(0.5_wp*(1.0_wp + erf(1.0_wp/sqrt(2.0_wp))))
      call check_close('walkers: a cut normal', sum(straight(1, :))/samples, mean, tolerance)
      call check_close('walkers: its square', sum(straight(1, :)**2)/samples, 1.0_wp - mean, &
         & tolerance)
      call check_close('walkers: the wave', sum(straight(2, :))/samples, 0.0_wp, tolerance)
      call check_close('walkers: its square', sum(straight(2, :)**2)/samples, 1.0_wp, &
         & 1.4_wp*tolerance)
      call check_close('walkers: the sine of the approximation', &
         & sum(sin(3.0_wp*draws(2, :)))/samples, sine_of_waves(), tolerance)
   end subroutine test_walkers

   !> The mean of sin 3 x2 over the wavy density, by quadrature: x2 is normal about -0.8 sin 2 x1.
   pure real(wp) function sine_of_waves() result(mean)
      integer, parameter :: n = 4000
      real(wp) :: x(n), weights(n)
      integer :: i

      x = [(-1.0_wp + 8.0_wp*(i - 0.5_wp)/n, i=1, n)]
      weights = exp(-0.5_wp*x**2)
      mean = sum(weights*sin(-2.4_wp*sin(2.0_wp*x)))/sum(weights)*exp(-4.5_wp)
   end function sine_of_waves

   !> Moments of a curved ridge that bounds cut.
   subroutine test_sampler(name, samples, burn_in, tolerance)
      character(len=*), intent(in) :: name
      integer, intent(in) :: samples, burn_in
      real(wp), intent(in) :: tolerance
      type(banana_type) :: banana
      class(sampler_type), allocatable :: sampler
      type(chains_type) :: chains
      type(error_type), allocatable :: error
      real(wp) :: mass, mean, square, acceptance
      real(wp), parameter :: a = -1.5_wp, b = 2.0_wp

      banana%dimension = 3
      banana%lower = [a, -10.0_wp, -5.0_wp]
      banana%upper = [b, 10.0_wp, 5.0_wp]
      call new_sampler(name, burn_in, sampler, error)
      call check_success(name//': is known', error)
      call sample_chains(banana, sampler, run_settings_type(samples, 4, 1, 7), chains, error)
      call check_success(name//': chains', error)
      mass = 0.5_wp*(erf(b/sqrt(2.0_wp)) - erf(a/sqrt(2.0_wp)))
      mean = (normal_density(a) - normal_density(b))/mass
      square = 1.0_wp + (a*normal_density(a) - b*normal_density(b))/mass
      call check_close(name//': mean along the ridge', average(chains%draws(1, :, :)), &
         & mean, tolerance)
      call check_close(name//': mean across it', average(chains%draws(2, :, :)), square, tolerance)
      call check_close(name//': square along it', average(chains%draws(1, :, :)**2), &
         & square, tolerance)
      call check_close(name//': variance across it', &
         & average((chains%draws(2, :, :) - chains%draws(1, :, :)**2)**2), 0.01_wp, 0.0005_wp)
      call check_close(name//': the third parameter', average(chains%draws(3, :, :)**2), &
         & 1.0_wp, tolerance)
      if (name == 'scmh') then
         acceptance = average(reshape(chains%acceptance, [4, 1]))
         call check_close(name//': acceptance', acceptance, 0.23_wp, 0.03_wp)
      end if
   end subroutine test_sampler

   pure real(wp) function normal_density(x)
      real(wp), intent(in) :: x

      normal_density = exp(-0.5_wp*x**2)/sqrt(2.0_wp*pi)
   end function normal_density

   pure real(wp) function average(values)
      real(wp), intent(in) :: values(:, :)

      average = sum(values)/size(values)
   end function average

   !> Against ess (bulk, tail) and rhat (rank) of ArviZ 0.23.4.
   subroutine test_diagnostics()
      real(wp), parameter :: probability(6) = [1.0e-300_wp, 1.0e-10_wp, 2.0e-6_wp, 0.02_wp, &
         & 0.3_wp, 0.975_wp]
      ! By scipy.stats.norm.ppf.
      real(wp), parameter :: quantile(6) = [-37.0470962993612_wp, -6.361340902404056_wp, &
         & -4.611382362302668_wp, -2.053748910631823_wp, -0.5244005127080409_wp, &
         & 1.959963984540054_wp]
      type(diagnostics_type) :: found
      real(wp) :: i(4000, 3), c(4000, 3)
      integer :: k

      do k = 1, size(probability)
         call check_close('normal quantile', normal_quantile(probability(k)), quantile(k), &
            & 1.0e-14_wp*abs(quantile(k)))
      end do
      call check_close('normal median', normal_quantile(0.5_wp), 0.0_wp, 1.0e-15_wp)
      i = spread([(real(k, wp), k=1, 4000)], 2, 3)
      c = spread([1.0_wp, 2.0_wp, 3.0_wp], 1, 4000)
      call compare('mixed chains', sin(i(:101, :)**2 + 7.0_wp*c(:101, :)), 307.0556532955_wp, &
         & 212.5921975008_wp, 1.002567893611_wp)
      call compare('slow chains', mod(i(:, :2) + 1300.0_wp*c(:, :2), 3001.0_wp), &
         & 27.23538127568_wp, 62.83359749428_wp, 1.059267583708_wp)
      call compare('repeated values', aint(4.0_wp + 4.0_wp*sin(i(:500, :2)**2/7.0_wp &
         & + c(:500, :2))), 1029.45935826_wp, 1000.0_wp, 1.000030083023_wp)
      call compare('antithetic chains', mod(i(:200, :2), 2.0_wp), 1040.823996531_wp, 400.0_wp, &
         & 0.9949874371066_wp)
      call compare('five samples', sin(i(:5, :2)**2 + 7.0_wp*c(:5, :2)), 7.224719895936_wp, &
         & 7.224719895936_wp, 1.626075932895_wp)
      found = diagnose_chains(sin(0.3_wp*i(:200, :1)))
      call check_close('one chain, bulk', found%ess_bulk, 35.03893156518_wp, 1.0e-8_wp)
      call check_close('one chain, tail', found%ess_tail, 181.7125961025_wp, 1.0e-8_wp)
      call check('one chain has no R-hat', ieee_is_nan(found%r_hat))
      found = diagnose_chains(0.0_wp*i(:100, :2) + 3.0_wp)
      call check_close('one value', found%ess_bulk, 200.0_wp, 0.0_wp)
      call check('one value has no R-hat', ieee_is_nan(found%r_hat))
      found = diagnose_chains(c(:100, :2))
      call check('one value a chain', found%ess_bulk < 3.0_wp .and. found%r_hat > 1.0e6_wp)
      found = diagnose_chains(i(:3, :))
      call check('three samples say nothing', ieee_is_nan(found%ess_bulk) &
         & .and. ieee_is_nan(found%ess_tail))
   end subroutine test_diagnostics

   subroutine compare(name, draws, ess_bulk, ess_tail, r_hat)
      character(len=*), intent(in) :: name
      real(wp), intent(in), contiguous :: draws(:, :)
      real(wp), intent(in) :: ess_bulk, ess_tail, r_hat
      type(diagnostics_type) :: found

      found = diagnose_chains(draws)
      call check_close(name//', bulk', found%ess_bulk, ess_bulk, 1.0e-10_wp*ess_bulk)
      call check_close(name//', tail', found%ess_tail, ess_tail, 1.0e-10_wp*ess_tail)
      call check_close(name//', R-hat', found%r_hat, r_hat, 1.0e-10_wp)
   end subroutine compare
end program test_inference
