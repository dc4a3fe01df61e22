!> The grains to measure next, by indentation or by the speed of a surface wave, chosen from draws
!> of a posterior.
module further_measurements
   use abstract_basis, only: grain_model_type
   use analysis, only: analysis_type
   use constants_posterior, only: posterior_type
   use crystal_class, only: crystal_class_type, lattice_type, new_lattice
   use crystal_elasticity, only: rotation_matrix
   use diagnostics, only: diagnostic_type
   use distinct_directions, only: angle_between, lattice_of_directions, new_region, region_type
   use errors, only: error_type, refuse
   use json, only: json_type
   use kinds, only: degree, wp
   use linear_algebra, only: orthonormalize
   use next_measurement, only: candidates_type, choose_measurements, suggestions_type
   use point_tables, only: points_type
   use direction_columns, only: angles_of_direction
   use problem, only: problem_type
   use field_reading, only: choose_field_degree
   use detected_speeds, only: are_detected, omit_undetected
   use observables, only: path_type, surface_path
   use problem_posterior, only: check_target
   use quantities, only: evaluate_draws, new_quantity, quantity_type
   use random, only: new_random_stream, random_stream_type
   use shared_errors, only: draw_shared
   use small_matrices, only: solve_lower
   use statistics, only: median, number_equal
   use text, only: to_text
   implicit none
   private
   public :: suggest_measurements, add_moduli, predict_candidates, write_suggestions

   !> Greatest number of draws, and number of scenarios of the results of earlier suggestions, for
   !> the expected gains.
   integer, parameter :: most_draws = 2000, scenarios = 48
   !> Every fifth of these draws is used for the degree of the harmonics and for the detected waves.
   integer, parameter :: degree_stride = 5
   !> Least angle between suggestions: the same grain cannot be measured again, and a grain of
   !> nearly the same orientation is hard to find.
   real(wp), parameter :: separation_deg = 5.0_wp
   !> Number of directions of propagation in a grain, and greatest number of grains.
   integer, parameter :: n_along = 12, most_grains = 200

contains

   !> Write the document of `next` from `draws` of the posterior into the object of a `page`:
   !> suggestions, each given those before it, and the gain of every candidate as the first one.
   subroutine suggest_measurements(analysis, draws, page, error)
      !> The degree of the harmonics of its posterior is chosen anew for these draws.
      type(analysis_type), intent(inout) :: analysis
      !> Draws of the posterior, (parameter, draw); the last parameter may be the factor on the sds.
      real(wp), intent(in) :: draws(:, :)
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      type(candidates_type) :: candidates
      type(suggestions_type) :: suggestions
      type(quantity_type) :: quantity(1)
      real(wp), allocatable :: few(:, :), values(:, :)
      real(wp) :: sd(2), factor
      integer :: m, n, threads

      analysis%warnings = [diagnostic_type ::]
      threads = analysis%problem%threads()
      call check_target(analysis%problem, error)
      if (.not. allocated(error)) then
         call omit_undetected(analysis%problem, analysis%surrogate, error)
      end if
      if (.not. allocated(error)) call analysis%prepare(error)
      if (allocated(error)) return
      few = draws(:, ::max(1, size(draws, 2)/most_draws))
      associate (problem => analysis%problem, posterior => analysis%posterior, &
         & wanted => analysis%problem%settings%next)
         m = posterior%n_moduli
         n = posterior%n_grains
         sd = [wanted%sd_gpa, wanted%velocity_sd_m_s]
         factor = 1.0_wp
         if (posterior%infers_scale) then
            factor = sum(draws(posterior%dimension, :))/size(draws, 2)
         end if
         if (.not. sd(1) > 0.0_wp .and. m > 0) sd(1) = factor*median(m, posterior%data%sd(:m))
         if (.not. sd(2) > 0.0_wp .and. n > m) then
            sd(2) = factor*median(n - m, posterior%data%sd(m + 1:))
         end if
         if (.not. sd(1) > 0.0_wp) then
            call problem%refuse('next', 'sd_gpa', 'the variable is missing; it is the sd of the ' &
               & //'next modulus, and no moduli were measured whose sd it could be', error)
            return
         else if (allocated(wanted%velocity_cost) .and. .not. sd(2) > 0.0_wp) then
            call problem%refuse('next', 'velocity_sd_m_s', 'the variable is missing; it is the ' &
               & //'sd of the next speed, and no speeds were measured whose sd it could be', error)
            return
         end if
         few(posterior%n_constants + 1:, :) = log(few(posterior%n_constants + 1:, :))
         if (posterior%grains%has_theory) then
            call choose_field_degree(posterior, few(:, ::degree_stride), threads, error)
         end if
         if (allocated(error)) return
         call add_moduli(problem, posterior%prior%class, candidates)
         if (allocated(wanted%velocity_cost)) call add_speeds(few(:, ::degree_stride))
         if (.not. allocated(error)) then
            call predict_candidates(problem, posterior, few, sd, candidates, error)
         end if
         call problem%locate('next', '', error)
         if (allocated(error)) return
         if (wanted%target /= 'all') then
            call new_quantity(wanted%target, quantity(1), error)
            call evaluate_draws(quantity, posterior%prior%class, few, values)
            candidates%target = values(1, :)
            ! A product of powers is replaced by its logarithm if that exists.
            if (quantity(1)%is_product() .and. all(candidates%target > 0.0_wp)) then
               candidates%target = log(candidates%target)
            end if
         end if
         call choose_measurements(candidates, wanted%count, scenarios, &
            & problem%settings%problem%seed, threads, suggestions)
         if (size(suggestions%chosen) < min(wanted%count, size(candidates%cost))) then
            call analysis%warn('few_apart', &
               & numbers=[real(wp) :: size(suggestions%chosen), wanted%count, separation_deg])
         end if
      end associate
      call write_suggestions(page, analysis%problem, candidates, suggestions, sd)

   contains

      !> Add speeds in several directions of propagation, if their waves are detected at the
      !> draws, in the grains of &next or else in the measured ones, which may have several rows
      !> each.
      subroutine add_speeds(draws)
         !> (parameter, draw).
         real(wp), intent(in) :: draws(:, :)
         type(points_type) :: grains
         real(wp), allocatable :: euler_deg(:, :)
         type(path_type), allocatable :: paths(:)
         integer, allocatable :: rows(:)
         integer :: i, j

         grains = analysis%problem%data%measurements
         if (allocated(analysis%problem%data%grains)) grains = analysis%problem%data%grains
         rows = pack([(i, i=1, grains%n)], number_equal(grains%euler_deg) == [(i, i=1, grains%n)])
         if (.not. grains%has_angles) then
            call refuse(error, &
               & 'velocity_cost: the grains have directions alone, and a wave needs Euler angles')
            return
         else if (size(rows) > most_grains) then
            call refuse(error, 'velocity_cost: '//to_text(size(rows))//' grains; allowed up to ' &
               & //to_text(most_grains))
            return
         end if
         rows = [((rows(i), j=1, n_along), i=1, size(rows))]
         paths = [(path_type(surface_path, 180.0_wp*modulo(i - 1, n_along)/n_along), &
            & i=1, size(rows))]
         euler_deg = grains%euler_deg(:, rows)
         associate (kept => pack([(i, i=1, size(rows))], &
            & are_detected(analysis%posterior, draws, euler_deg, paths)))
            candidates%euler_deg = reshape([candidates%euler_deg, euler_deg(:, kept)], &
               & [3, size(candidates%cost) + size(kept)])
            candidates%paths = [candidates%paths, paths(kept)]
            candidates%grain = [candidates%grain, rows(kept)]
            candidates%cost = [candidates%cost, &
               & spread(analysis%problem%settings%next%velocity_cost, 1, size(kept))]
         end associate
      end subroutine add_speeds
   end subroutine suggest_measurements

   !> Add the moduli of the grains of &next, each of which may be measured once, or else of all
   !> directions that differ by the symmetry of the crystal.
   subroutine add_moduli(problem, class, candidates)
      type(problem_type), intent(in) :: problem
      type(crystal_class_type), intent(in) :: class
      type(candidates_type), intent(inout) :: candidates
      type(region_type) :: region
      real(wp), allocatable :: directions(:, :)
      integer :: i, j, n

      if (allocated(problem%data%grains)) then
         candidates%euler_deg = problem%data%grains%euler_deg
         n = size(candidates%euler_deg, 2)
         candidates%grain = [(i, i=1, n)]
         allocate (candidates%angle(0, 0))
      else
         call new_region(class, region)
         call lattice_of_directions(region, directions)
         n = size(directions, 2)
         candidates%grain = spread(0, 1, n)
         allocate (candidates%euler_deg(3, n), candidates%angle(n, n))
         candidates%least_angle = separation_deg*degree
         do j = 1, n
            candidates%euler_deg(:, j) = angles_of_direction(directions(:, j))
            do i = 1, n
               candidates%angle(i, j) = angle_between(region, directions(:, i), directions(:, j))
            end do
         end do
      end if
      allocate (candidates%paths(n))
      candidates%cost = spread(1.0_wp, 1, n)
   end subroutine add_moduli

   !> Predict the measurement of each candidate by each draw.
   subroutine predict_candidates(problem, posterior, draws, sd, candidates, error)
      type(problem_type), intent(in) :: problem
      type(posterior_type), intent(in) :: posterior
      !> (parameter, draw), as the sampler has them.
      real(wp), intent(in) :: draws(:, :)
      !> Sds of the next modulus, GPa, and of the next speed, m/s.
      real(wp), intent(in) :: sd(2)
      type(candidates_type), intent(inout) :: candidates
      type(error_type), allocatable, intent(out) :: error
      !> Variances of the own errors, (candidate, draw); standard normal numbers, (error, draw);
      !> relative sds of the shared errors, (error, kind).
      real(wp), allocatable :: own_variance(:, :), normals(:, :), relative(:, :)
      class(grain_model_type), allocatable :: grains
      integer, allocatable :: kind(:)
      integer :: i

      call posterior%new_grains(candidates%euler_deg*degree, candidates%paths, grains, error, &
         & with_mean=.true.)
      if (allocated(error)) return
      kind = merge(2, 1, candidates%paths%is_speed())
      candidates%sd = sd(kind)
      call find_relative_errors()
      associate (n => size(kind), n_draws => size(draws, 2))
         allocate (own_variance(n, n_draws), candidates%predicted(n, n_draws), &
            & candidates%shared_variance(n, n_draws), candidates%target(0))
      end associate
      call draw_normals()
      do i = 1, size(draws, 2)
         call draw_measurements(posterior, draws(:, i), grains, relative(:, kind), &
            & count(kind == 1), normals(:, i), candidates%predicted(:, i), &
            & candidates%shared_variance(:, i), own_variance(:, i))
      end do
      candidates%predicted = transpose(candidates%predicted)
      candidates%shared_variance = transpose(candidates%shared_variance)
      candidates%sd = sqrt(candidates%sd**2 + sum(own_variance, 2)/size(draws, 2))

   contains

      !> Set the relative sds of the errors that a further modulus (1) or speed (2) shares, (error,
      !> kind): the calibration of the first group, and the stated errors of the mean measurement
      !> of the kind. If the kind was not measured, the last error has its calibration.
      subroutine find_relative_errors()
         real(wp) :: calibration(2)
         integer :: first(2), last(2), n_errors, k
         logical :: with_speeds

         with_speeds = any(kind == 2)
         first = [1, posterior%n_moduli + 1]
         last = [posterior%n_moduli, posterior%n_grains]
         calibration = [posterior%settings%calibration_sd, &
            & hypot(posterior%settings%velocity_calibration_sd, &
            & 0.5_wp*problem%settings%problem%density_sd_kg_m3/posterior%data%density)]
         n_errors = posterior%n_shared + merge(1, 0, &
            & first(1) > last(1) .or. (with_speeds .and. first(2) > last(2)))
         allocate (relative(n_errors, 2), source=0.0_wp)
         do k = 1, merge(2, 1, with_speeds)
            if (first(k) > last(k)) then
               relative(posterior%n_shared + 1, k) = calibration(k)
            else
               associate (n => posterior%grains%n_columns, calibrated => posterior%n_calibrated, &
                  & group => posterior%data%group(first(k)))
                  if (calibrated > n) relative(n + group, k) = posterior%laboratory%sd(group)
                  relative(calibrated + 1:calibrated + size(posterior%data%shared, 2), k) = &
                     & sum(posterior%data%shared(first(k):last(k), :), 1)/(last(k) - first(k) + 1)
               end associate
            end if
         end do
      end subroutine find_relative_errors

      !> Set standard normal numbers for the draws. For many draws they have no mean, unit
      !> covariance, and no correlation with any linear function of the draws. The variance of the
      !> shared errors then has no sampling noise, which would be larger than small gains.
      subroutine draw_normals()
         real(wp), allocatable :: columns(:, :)
         real(wp) :: mean
         type(random_stream_type) :: stream
         integer :: i, j, known

         stream = new_random_stream(problem%settings%problem%seed, 0)
         known = 1 + size(draws, 1)
         allocate (columns(size(draws, 2), known + size(relative, 1)))
         columns(:, 1) = 1.0_wp
         do j = 1, size(draws, 1)
            mean = sum(draws(j, :))/size(draws, 2)
            columns(:, 1 + j) = draws(j, :) - mean
         end do
         do i = 1, size(columns, 1)
            call stream%normals(columns(i, known + 1:))
         end do
         if (size(columns, 1) >= 4*size(columns, 2)) then
            call orthonormalize(columns)
            columns = columns*sqrt(real(size(columns, 1), wp))
         end if
         normals = transpose(columns(:, known + 1:))
      end subroutine draw_normals
   end subroutine predict_candidates

   !> Write each suggestion with the indented direction and that of propagation, as unit vectors in
   !> crystal axes and, if the unit cell is known, as [uvw]. Write the gains of all candidates.
   subroutine write_suggestions(page, problem, candidates, suggestions, sd)
      type(json_type), intent(inout) :: page
      type(problem_type), intent(in) :: problem
      type(candidates_type), intent(in) :: candidates
      type(suggestions_type), intent(in) :: suggestions
      !> Sds of the next modulus, GPa, and of the next speed, m/s.
      real(wp), intent(in) :: sd(2)
      type(lattice_type) :: lattice
      type(error_type), allocatable :: unknown
      real(wp), allocatable :: parameters(:)
      real(wp) :: mean, g(3, 3), along(3)
      integer :: i, draws

      draws = size(candidates%predicted, 1)
      allocate (parameters(0))
      if (allocated(problem%settings%problem%lattice)) parameters = problem%settings%problem%lattice
      call new_lattice(problem%class, parameters, lattice, unknown)
      call page%begin_array('suggestions')
      do i = 1, size(suggestions%chosen)
         associate (c => suggestions%chosen(i))
            mean = sum(candidates%predicted(:, c))/draws
            call begin_candidate(c)
            g = rotation_matrix(candidates%euler_deg(:, c)*degree)
            call page%put('direction', g(:, 3))
            if (suggestions%within(i) > 0.0_wp) then
               call page%put('within_deg', suggestions%within(i)/degree)
            end if
            if (.not. allocated(unknown)) call page%put('uvw', lattice%nearest(g(:, 3)))
            associate (path => candidates%paths(c))
               if (path%is_speed()) then
                  along = cos(path%propagation_deg*degree)*g(:, 1) &
                     & + sin(path%propagation_deg*degree)*g(:, 2)
                  call page%put('along', along)
                  if (.not. allocated(unknown)) call page%put('along_uvw', lattice%nearest(along))
               end if
            end associate
            call page%put_numbers('gain, predicted, sd', [suggestions%gains(i), mean, &
               & sqrt(sum((candidates%predicted(:, c) - mean)**2)/draws)])
            call page%end_object()
         end associate
      end do
      call page%end_array()
      call page%begin_array('candidates')
      do i = 1, size(candidates%cost)
         call begin_candidate(i)
         call page%put('gain', suggestions%first_gains(i))
         call page%end_object()
      end do
      call page%end_array()
      call page%put('target', problem%settings%next%target)
      call page%put('sd_gpa', sd(1))
      if (allocated(problem%settings%next%velocity_cost)) then
         call page%put_numbers('velocity_sd_m_s, velocity_cost', &
            & [sd(2), problem%settings%next%velocity_cost])
      end if
      call page%put('unit', trim(merge('nats                 ', 'share of the ' &
         & //'variance', size(candidates%target) == 0)))

   contains

      subroutine begin_candidate(c)
         integer, intent(in) :: c

         call page%begin_object('')
         if (allocated(problem%data%grains)) then
            call page%put('grain', problem%data%grains%name(candidates%grain(c)))
         else if (candidates%grain(c) > 0) then
            call page%put('grain', problem%data%measurements%name(candidates%grain(c)))
         end if
         call page%put('euler_deg', candidates%euler_deg(:, c))
         if (candidates%paths(c)%is_speed()) then
            call page%put('propagation_deg', candidates%paths(c)%propagation_deg)
         end if
      end subroutine begin_candidate
   end subroutine write_suggestions

   !> Draw further moduli, then speeds, of any grains at a point, of the measured kind and without
   !> their own errors.
   subroutine draw_measurements(posterior, x, grains, relative, n, z, values, shared_variance, &
      & own_variance)
      type(posterior_type), intent(in) :: posterior
      !> (parameter).
      real(wp), intent(in) :: x(:)
      class(grain_model_type), intent(in) :: grains
      !> See `find_relative_errors`, (error, measurement); standard normal numbers, (error).
      real(wp), intent(in) :: relative(:, :), z(:)
      !> Number of moduli.
      integer, intent(in) :: n
      !> GPa or m/s, (measurement), with the shared errors of these numbers, given the data.
      real(wp), intent(out), contiguous :: values(:)
      !> Variances, (measurement): of the shared errors given the data and the constants, and of the
      !> surrogate's errors that grains do not share.
      real(wp), intent(out), contiguous :: shared_variance(:), own_variance(:)
      !> Of the measurements, then of the directions over which moduli are averaged.
      real(wp), dimension(size(values) + size(posterior%mean_weights)) :: moduli, mean, slope, &
         & mean_slope
      real(wp) :: c(6, 6), influence(size(moduli), grains%n_columns), &
         & columns(size(values), size(z)), shared(size(z))
      real(wp), allocatable :: precision(:, :)
      real(wp) :: factor(posterior%n_groups)
      logical :: are_moduli(size(values))
      integer :: i, m

      m = posterior%n_shared
      c = posterior%stiffness(x)
      are_moduli = [(i <= n, i=1, size(values))]
      call draw_shared(posterior, x, z(:m), shared(:m), precision, factor)
      call grains%evaluate_moduli(c, moduli, slope)
      mean = moduli
      mean_slope = slope
      call observe(mean, mean_slope)
      shared(m + 1:) = z(m + 1:)
      columns = transpose(relative)*spread(mean(:size(values)), 2, size(z))
      if (grains%n_columns > 0) then
         call grains%evaluate_columns(c, influence)
         moduli = moduli + slope*matmul(influence, shared(:grains%n_columns))
         columns(:, :grains%n_columns) &
            & = spread(mean_slope(:size(values)), 2, grains%n_columns)*influence(:size(values), :)
      end if
      call observe(moduli, slope)
      values = (1.0_wp + matmul(shared, relative))*moduli(:size(values))
      do i = 1, size(values)
         call solve_lower(precision, columns(i, :m))
      end do
      shared_variance = sum(columns**2, 2)
      own_variance = 0.0_wp
      own_variance(:n) = posterior%scatter*mean_slope(:n)**2 &
         & + (posterior%grain_scatter(x)*mean(:n))**2

   contains

      !> Convert moduli to the measured kind, with the contrast and the factor of the first group.
      pure subroutine observe(moduli, slopes)
         real(wp), intent(inout) :: moduli(:), slopes(:)

         call posterior%set_contrast(x, are_moduli, moduli, slopes)
         call posterior%observable%to_measured(moduli(:n), slopes(:n))
         if (posterior%n_moduli == 0) return
         moduli(:n) = moduli(:n)*exp(posterior%log_factor(x, 1))
         slopes(:n) = slopes(:n)*exp(posterior%log_factor(x, 1))
      end subroutine observe
   end subroutine draw_measurements
end module further_measurements
