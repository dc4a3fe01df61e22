!> `next`: the grain orientations worth measuring next, from draws of a posterior.
module next_stage
   use abstract_basis, only: grain_model_type
   use constants_posterior, only: posterior_type
   use crystal_class, only: crystal_class_type, lattice_type, new_lattice
   use crystal_elasticity, only: rotation_matrix
   use distinct_directions, only: angle_between, lattice_of_directions, new_region, region_type
   use errors, only: error_type, refuse, warn, warning_type
   use extract_stage, only: extract_stage_type
   use extraction, only: extract, extraction_type
   use json, only: json_type
   use kinds, only: degree, wp
   use linear_algebra, only: orthonormalize
   use namelist_file, only: place
   use next_measurement, only: candidates_type, choose_measurements, suggestions_type
   use table_columns, only: angles_of_direction
   use machine, only: thread_count
   use extraction_document, only: stored_draws
   use problem, only: problem_type
   use problem_posterior, only: check_target, choose_field_degree
   use quantities, only: evaluate_draws, new_quantity, quantity_type
   use random, only: new_random_stream, random_stream_type
   use running_command, only: remove_files
   use samplers, only: chain_prefix
   use small_matrices, only: solve_lower
   use stage_documents, only: inputs_of
   use statistics, only: flattened, median
   use text, only: fixed, to_text
   implicit none
   private
   public :: next_stage_type, next_document

   type, extends(extract_stage_type) :: next_stage_type
   contains
      procedure :: finish
   end type next_stage_type

   !> Draws of the posterior, and scenarios of what earlier suggestions will say, behind the expected gains.
   integer, parameter :: most_draws = 2000, scenarios = 48
   !> Of these draws every fifth chooses how finely theory is read.
   integer, parameter :: degree_stride = 5
   !> Suggestions are at least so far apart: the same grain cannot be measured again, and a near twin is hard to find.
   real(wp), parameter :: separation_deg = 5.0_wp

contains

   !> The document, from the draws that `extract` left in the folder, or from new ones.
   subroutine finish(self, page, error)
      class(next_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      type(extraction_type) :: found
      real(wp), allocatable :: draws(:, :)

      call stored_draws(self%output, inputs_of(self%problem, self%groups_of_posterior, self%places), self%posterior%dimension, &
         & draws, error)
      if (allocated(error)) return
      if (.not. allocated(draws)) then
         self%problem%kept_in = self%output
         call extract(self%problem, self%surrogate, found, error)
         if (allocated(error)) return
         draws = flattened(found%chains%draws)
         call remove_files(self%output, chain_prefix)
      end if
      call next_document(self%problem, self%posterior, draws, page, self%warnings, error)
      self%done = self%output//'/next.json'
   end subroutine finish

   !> The document of `next` from `draws` of the posterior, into the object of a `page`: suggestions, each given those before it, and the
   !> gain of every candidate as the first of them.
   subroutine next_document(problem, posterior, draws, page, warnings, error)
      type(problem_type), intent(in) :: problem
      !> Its theory is read as finely as these draws need, wherever they come from.
      type(posterior_type), intent(inout) :: posterior
      !> Draws of the posterior, (parameter, draw); the last parameter may be the factor on the sds.
      real(wp), intent(in) :: draws(:, :)
      type(json_type), intent(inout) :: page
      !> Beside those of the problem.
      type(warning_type), allocatable, intent(out) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      type(candidates_type) :: candidates
      type(suggestions_type) :: suggestions
      type(quantity_type) :: quantity(1)
      real(wp), allocatable :: few(:, :), euler_deg(:, :), values(:, :)
      real(wp) :: sd

      allocate (warnings(0))
      call check_target(problem, error)
      if (allocated(error)) return
      few = draws(:, ::max(1, size(draws, 2)/most_draws))
      associate (wanted => problem%settings%next)
         sd = wanted%sd_gpa
         if (.not. sd > 0.0_wp .and. posterior%n_moduli == 0) then
            call refuse(error, place(problem%path, 'next', 'sd_gpa')//'the variable is missing; it is the sd of the next ' &
               & //'modulus, and no moduli were measured whose sd it could be')
            return
         else if (.not. sd > 0.0_wp) then
            sd = median(posterior%n_moduli, posterior%data%sd(:posterior%n_moduli))
            if (posterior%dimension > posterior%n_constants) sd = sd*sum(draws(posterior%dimension, :))/size(draws, 2)
         end if
         if (posterior%dimension > posterior%n_constants) few(posterior%dimension, :) = log(few(posterior%dimension, :))
         if (posterior%grains%has_theory) call choose_field_degree(posterior, few(:, ::degree_stride), error)
         if (allocated(error)) return
         call place_candidates(problem, posterior%prior%class, candidates, euler_deg)
         call predict_candidates(posterior, few, sd, problem%settings%problem%seed, euler_deg, candidates, error)
         if (wanted%target /= 'all' .and. .not. allocated(error)) then
            call new_quantity(wanted%target, quantity(1), error)
            call evaluate_draws(quantity, posterior%prior%class, few, values)
            candidates%target = values(1, :)
            ! Of a product of powers its logarithm.
            if (quantity(1)%is_product()) candidates%target = log(candidates%target)
         end if
         if (.not. allocated(error)) call choose_measurements(candidates, wanted%count, scenarios, &
            & problem%settings%problem%seed, thread_count(problem%settings%execution%workers), suggestions)
      end associate
      if (allocated(error)) error%message = place(problem%path, 'next', '')//error%message
      if (allocated(error)) return
      associate (found => size(suggestions%chosen), count => problem%settings%next%count)
         if (found < min(count, size(euler_deg, 2))) call warn(warnings, 'only '//to_text(found)//' of '//to_text(count) &
            & //' orientations are '//fixed(separation_deg, 0)//' degrees apart')
      end associate
      call write_suggestions(page, problem, candidates, suggestions, euler_deg, sd)
   end subroutine next_document

   !> The grains of &next, each of which may be measured once, or all directions that the crystal tells apart.
   subroutine place_candidates(problem, class, candidates, euler_deg)
      type(problem_type), intent(in) :: problem
      type(crystal_class_type), intent(in) :: class
      type(candidates_type), intent(inout) :: candidates
      !> Bunge-Euler angles of the candidates, (3, candidate).
      real(wp), allocatable, intent(out) :: euler_deg(:, :)
      type(region_type) :: region
      real(wp), allocatable :: directions(:, :)
      integer :: i, j, n

      if (allocated(problem%grains)) then
         euler_deg = problem%grains%euler_deg
         n = size(euler_deg, 2)
         candidates%near = reshape([((i == j, i=1, n), j=1, n)], [n, n])
         return
      end if
      call new_region(class, region)
      call lattice_of_directions(region, directions)
      n = size(directions, 2)
      allocate (euler_deg(3, n), candidates%near(n, n))
      do j = 1, n
         euler_deg(:, j) = angles_of_direction(directions(:, j))
         do i = 1, n
            candidates%near(i, j) = angle_between(region, directions(:, i), directions(:, j)) < separation_deg*degree
         end do
      end do
   end subroutine place_candidates

   !> What each draw predicts at each candidate.
   subroutine predict_candidates(posterior, draws, sd, seed, euler_deg, candidates, error)
      type(posterior_type), intent(in) :: posterior
      !> (dimension, draw), as the sampler has them.
      real(wp), intent(in) :: draws(:, :)
      !> Of the next measurement, GPa.
      real(wp), intent(in) :: sd
      integer, intent(in) :: seed
      !> See `place_candidates`.
      real(wp), intent(in) :: euler_deg(:, :)
      type(candidates_type), intent(inout) :: candidates
      type(error_type), allocatable, intent(out) :: error
      real(wp), allocatable :: own_variance(:, :), normals(:, :)
      class(grain_model_type), allocatable :: grains
      integer :: i, n

      n = size(euler_deg, 2)
      call posterior%new_grains(euler_deg*degree, grains, error)
      if (allocated(error)) return
      allocate (own_variance(n, size(draws, 2)), candidates%predicted(n, size(draws, 2)), &
         & candidates%shared_variance(n, size(draws, 2)), candidates%target(0))
      normals = even_normals(draws, posterior%n_shared, seed)
      do i = 1, size(draws, 2)
         call draw_measurements(posterior, draws(:, i), grains, normals(:, i), candidates%predicted(:, i), &
            & candidates%shared_variance(:, i), own_variance(:, i))
      end do
      candidates%predicted = transpose(candidates%predicted)
      candidates%shared_variance = transpose(candidates%shared_variance)
      candidates%sd = sqrt(sd**2 + sum(own_variance, 2)/size(draws, 2))
   end subroutine predict_candidates

   !> Of each suggestion with the indented direction, as a unit vector in crystal axes and, where the unit cell is known, as [uvw].
   subroutine write_suggestions(page, problem, candidates, suggestions, euler_deg, sd)
      type(json_type), intent(inout) :: page
      type(problem_type), intent(in) :: problem
      type(candidates_type), intent(in) :: candidates
      type(suggestions_type), intent(in) :: suggestions
      real(wp), intent(in) :: euler_deg(:, :), sd
      type(lattice_type) :: lattice
      type(error_type), allocatable :: unknown
      real(wp), allocatable :: parameters(:)
      real(wp) :: mean, g(3, 3)
      integer :: i, draws

      draws = size(candidates%predicted, 1)
      allocate (parameters(0))
      if (allocated(problem%settings%problem%lattice)) parameters = problem%settings%problem%lattice
      call new_lattice(problem%class, parameters, lattice, unknown)
      call page%begin_array('suggestions')
      do i = 1, size(suggestions%chosen)
         associate (c => suggestions%chosen(i))
            mean = sum(candidates%predicted(:, c))/draws
            call page%begin_object()
            if (allocated(problem%grains)) call page%put('grain', problem%grains%name(c))
            call page%put('euler_deg', euler_deg(:, c))
            g = rotation_matrix(euler_deg(:, c)*degree)
            call page%put('direction', g(:, 3))
            if (.not. allocated(unknown)) call page%put('uvw', lattice%nearest(g(:, 3)))
            call page%put_numbers('gain, predicted, sd', [suggestions%gains(i), mean, &
               & sqrt(sum((candidates%predicted(:, c) - mean)**2)/draws)])
            call page%end_object()
         end associate
      end do
      call page%end_array()
      call page%begin_array('candidates')
      do i = 1, size(euler_deg, 2)
         call page%begin_object()
         if (allocated(problem%grains)) call page%put('grain', problem%grains%name(i))
         call page%put('euler_deg', euler_deg(:, i))
         call page%put('gain', suggestions%first_gains(i))
         call page%end_object()
      end do
      call page%end_array()
      call page%put('target', problem%settings%next%target)
      call page%put('sd_gpa', sd)
      call page%put('unit', trim(merge('nats                 ', 'share of the variance', size(candidates%target) == 0)))
   end subroutine write_suggestions

   !> Standard normal numbers beside the draws: where these are many, without a mean, of unit covariance, and uncorrelated with all that is
   !> linear in the draws. So the variance of the shared errors is known without the noise of a sample, which is larger than small gains.
   function even_normals(draws, n, seed) result(normals)
      !> (dimension, draw).
      real(wp), intent(in) :: draws(:, :)
      integer, intent(in) :: n, seed
      !> (n, draw).
      real(wp), allocatable :: normals(:, :)
      real(wp), allocatable :: columns(:, :)
      real(wp) :: mean
      type(random_stream_type) :: stream
      integer :: i, j, known

      stream = new_random_stream(seed, 0)
      known = 1 + size(draws, 1)
      allocate (columns(size(draws, 2), known + n))
      columns(:, 1) = 1.0_wp
      do j = 1, size(draws, 1)
         mean = sum(draws(j, :))/size(draws, 2)
         columns(:, 1 + j) = draws(j, :) - mean
      end do
      do i = 1, size(columns, 1)
         do j = known + 1, size(columns, 2)
            call stream%normal(columns(i, j))
         end do
      end do
      if (size(columns, 1) >= 4*size(columns, 2)) then
         call orthonormalize(columns)
         columns = columns*sqrt(real(size(columns, 1), wp))
      end if
      normals = transpose(columns(:, known + 1:))
   end function even_normals

   !> What a further measurement of any grains would give at a point, of the kind and the first group that were measured, without its
   !> own error.
   subroutine draw_measurements(posterior, x, grains, z, values, shared_variance, own_variance)
      type(posterior_type), intent(in) :: posterior
      !> (dimension).
      real(wp), intent(in) :: x(:)
      class(grain_model_type), intent(in) :: grains
      !> Standard normal numbers, (shared error).
      real(wp), intent(in) :: z(:)
      !> GPa, (grain), the shared errors of these numbers, given the data.
      real(wp), intent(out), contiguous :: values(:)
      !> GPa², (grain): of the shared errors given the data and the constants, and of the surrogate's that grains do not share.
      real(wp), intent(out), contiguous :: shared_variance(:), own_variance(:)
      real(wp), dimension(size(values)) :: slope, mean, mean_slope
      real(wp) :: c(6, 6), influence(size(values), grains%n_columns), columns(size(values), posterior%n_shared)
      real(wp) :: b(posterior%n_shared), precision(posterior%n_shared, posterior%n_shared), factor(posterior%n_groups)
      integer :: i

      c = posterior%stiffness(x)
      call posterior%infer_shared(x, b, precision)
      call grains%evaluate_moduli(c, values, slope)
      mean = values
      mean_slope = slope
      call posterior%observable%from_simulation(mean, mean_slope)
      columns = 0.0_wp
      if (posterior%settings%calibration_sd > 0.0_wp) columns(:, grains%n_columns + 1) = posterior%settings%calibration_sd*mean
      call posterior%place_shared(z, b, precision, factor)
      ! Of the errors that were stated it has those of the mean grain.
      do i = 1, size(posterior%data%shared, 2)
         associate (common => sum(posterior%data%shared(:posterior%n_moduli, i))/max(1, posterior%n_moduli))
            columns(:, posterior%n_calibrated + i) = common*mean
            factor = factor + common*b(posterior%n_calibrated + i)
         end associate
      end do
      if (grains%n_columns > 0) then
         call grains%evaluate_columns(c, influence)
         values = values + slope*matmul(influence, b(:grains%n_columns))
         do i = 1, grains%n_columns
            columns(:, i) = mean_slope*influence(:, i)
         end do
      end if
      call posterior%observable%from_simulation(values, slope)
      values = factor(1)*values
      do i = 1, size(values)
         call solve_lower(precision, columns(i, :))
      end do
      shared_variance = sum(columns**2, 2)
      own_variance = posterior%scatter*mean_slope**2 + (posterior%settings%scatter_sd*mean)**2
   end subroutine draw_measurements

end module next_stage
