!> The posterior that a problem asks for, over a surrogate, and chains of it.
module problem_posterior
   use abstract_sampler, only: sampler_type
   use constants_posterior, only: new_posterior, posterior_type
   use correction_basis, only: correction_grain_model_type
   use constants_prior, only: check_knowledge, knowledge_type, new_prior, prior_type
   use errors, only: error_type, exit_bad_input, prefix_error, refuse
   use files, only: printable
   use film_theory, only: film_name, young_of_film
   use halfspace_theory, only: halfspace_moduli
   use kinds, only: degree, pi, wp
   use measured_grains, only: mean_modulus, measured_type, reference_rows_type, &
      & spread_orientations
   use machine, only: check_memory
   use observables, only: new_observable, observable_type
   use point_tables, only: points_type
   use problem, only: problem_type
   use quantities, only: check_distinct, check_quantity, check_value, new_quantity, quantity_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   use settings_schema, only: measurements_settings_type
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: check_step_2, check_target, new_measured_posterior, new_table_posterior, &
      & sample_aside, sample_posterior, shared_errors

   !> Lengths of chains.
   type, public :: run_type
      integer :: burn_in, samples, chains
      !> Number of the random stream of the first chain; each further chain has the next one. The
      !> chains that &sampler asks for have the streams from 1.
      integer :: first_stream
      !> Whether any draws near the posterior are good enough.
      logical :: is_rough = .false.
   end type run_type
   !> Chains that show how the posterior must be evaluated, or which speeds are detected; of the
   !> prior; of the posterior without &knowledge; of the posterior by the theory alone; and of
   !> the posterior at which simulations are chosen.
   type(run_type), parameter, public :: pilot_run &
      & = run_type(3000, 400, 2, 2000001, is_rough=.true.)
   type(run_type), parameter, public :: prior_run = run_type(5000, 2500, 4, 1000001)
   type(run_type), parameter, public :: free_run = run_type(2000, 500, 2, 3000001)
   type(run_type), parameter, public :: theory_run = run_type(5000, 1500, 4, 4000001)
   type(run_type), parameter, public :: focus_run = run_type(3000, 600, 2, 5000001)

   !> Degree of the harmonics of a rough run, for up to `many` grains and for more. The error of all
   !> grains together would exceed the width of the posterior of many grains at the lower degree;
   !> the time of a higher degree is then small beside that of the grains.
   integer, parameter :: rough_degree = 12, degree_of_many = 20, many = 2000
   !> Bytes of a number, and the copies of all draws that memory must hold at a time.
   real(wp), parameter :: bytes = 8.0_wp, copies = 3.0_wp

contains

   !> Refuse what Step 2 would refuse whatever the surrogate: unknown quantities, knowledge that no
   !> crystal has, more draws than memory holds.
   subroutine check_step_2(problem, error)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(out) :: error
      type(knowledge_type) :: knowledge

      call read_knowledge(problem, knowledge, error)
      if (allocated(error)) return
      call check_knowledge(problem%class, knowledge, error)
      call problem%locate('knowledge', trim(merge('quantity      ', 'stiffness_file', &
         & allocated(problem%settings%knowledge%quantity))), error)
      if (allocated(error)) return
      associate (s => problem%settings%sampler)
         call check_memory(copies*bytes*(problem%class%n_constants + 2)*s%samples*s%chains, &
            & to_text(s%chains)//' chains of '//to_text(s%samples)//' samples', error)
      end associate
      call problem%locate('sampler', 'samples', error)
      if (allocated(error)) error%status = exit_bad_input
   end subroutine check_step_2

   !> Refuse a target of &next that is none.
   subroutine check_target(problem, error)
      type(problem_type), intent(in) :: problem
      type(error_type), allocatable, intent(out) :: error
      type(quantity_type) :: quantity

      if (problem%settings%next%target == 'all') return
      call new_quantity(problem%settings%next%target, quantity, error)
      if (.not. allocated(error)) call check_quantity(quantity, problem%class, error)
      call problem%locate('next', 'target', error)
      if (allocated(error)) error%message = error%message//'; or ''all'''
   end subroutine check_target

   !> What &knowledge says: its lists, then the constants of its file.
   subroutine read_knowledge(problem, knowledge, error)
      type(problem_type), intent(in) :: problem
      type(knowledge_type), intent(out) :: knowledge
      type(error_type), allocatable, intent(out) :: error
      integer :: listed, all, i

      associate (known => problem%settings%knowledge, class => problem%class)
         listed = 0
         if (allocated(known%quantity)) listed = size(known%quantity)
         all = listed
         if (allocated(problem%data%stiffness)) all = listed + class%n_constants
         allocate (knowledge%quantities(all), knowledge%mean(all))
         allocate (knowledge%covariance(all, all), source=0.0_wp)
         do i = 1, listed
            associate (quantity => knowledge%quantities(i))
               call new_quantity(trim(known%quantity(i)), quantity, error)
               if (.not. allocated(error)) call check_quantity(quantity, class, error)
               if (.not. allocated(error)) call check_value(quantity, known%mean(i), error)
            end associate
            if (allocated(error)) exit
            knowledge%mean(i) = known%mean(i)
            knowledge%covariance(i, i) = known%sd(i)**2
         end do
         if (.not. allocated(error)) then
            call check_distinct(knowledge%quantities(:listed), class, error)
         end if
         call problem%locate('knowledge', 'quantity', error)
         if (allocated(error)) return
         do i = listed + 1, all
            call new_quantity(class%constants(i - listed), knowledge%quantities(i), error)
         end do
         if (all > listed) then
            knowledge%mean(listed + 1:) = problem%data%stiffness%mean
            knowledge%covariance(listed + 1:, listed + 1:) = problem%data%stiffness%covariance
         end if
         call knowledge%widen()
      end associate
   end subroutine read_knowledge

   !> The density of the constants given the measurements of a table, with a model of their errors,
   !> and with &prior and &knowledge, cut to what the surrogate is valid for.
   subroutine new_table_posterior(problem, model, table, surrogate, posterior, error)
      type(problem_type), intent(in) :: problem
      type(measurements_settings_type), intent(in) :: model
      type(points_type), allocatable, intent(in) :: table
      type(surrogate_type), intent(in) :: surrogate
      type(posterior_type), intent(out) :: posterior
      type(error_type), allocatable, intent(out) :: error
      type(measured_type) :: measured

      if (allocated(table)) then
         call take_measurements()
         if (allocated(problem%data%reference_grains)) then
            call take_references(problem, model, table, measured%references, error)
            call problem%locate('measurements', '', error)
            if (allocated(error)) return
         end if
         call new_measured_posterior(problem, model, measured, surrogate, posterior, error)
      else
         call problem%refuse('measurements', '', &
            & 'there are no measurements: at least one grain is needed', error)
      end if

   contains

      !> Set the measurements of the table. If the orientations are unknown, all possible ones take
      !> their place.
      subroutine take_measurements()
         integer :: n_moduli

         measured%euler = table%euler_deg*degree
         measured%modulus = table%modulus_gpa
         measured%sd = table%sd_gpa
         ! An sd is absent only if all sds are one unknown value, which the factor on the sds
         ! infers.
         where (.not. measured%sd > 0.0_wp) measured%sd = 1.0_wp
         measured%tilt_sd = merge(table%orientation_sd_deg, &
            & problem%settings%measurements%orientation_sd_deg, &
            & table%orientation_sd_deg >= 0.0_wp)*degree
         measured%group = table%group
         measured%paths = table%paths
         if (allocated(problem%settings%problem%density_kg_m3)) then
            measured%density = problem%settings%problem%density_kg_m3
         end if
         n_moduli = count(.not. table%paths%is_speed())
         if (allocated(problem%data%shared_errors)) then
            measured%shared = shared_errors(problem, &
               & problem%data%shared_errors(table%row(:n_moduli), :), table%n)
         else
            measured%shared = shared_errors(problem, reshape([real(wp) ::], [n_moduli, 0]), table%n)
         end if
         if (problem%settings%measurements%orientations == 'unknown') then
            call let_be_unknown()
         end if
      end subroutine take_measurements

      !> Let each measurement be of any direction of the crystal, evenly over the sphere, or of any
      !> orientation of a texture.
      subroutine let_be_unknown()
         !> Directions, for sds of this part of the modulus or more, and at most.
         real(wp), parameter :: usual = 0.02_wp, enough = 1200.0_wp, most = 6000.0_wp
         integer :: n

         n = int(min(most, enough*max(1.0_wp, (usual/minval(measured%sd/measured%modulus))**2)))
         ! Where something is evaluated at the orientations of the measurements, there are as many.
         n = max(n, size(measured%modulus))
         if (allocated(problem%data%texture)) then
            associate (texture => problem%data%texture)
               n = texture%n*((size(measured%modulus) - 1)/texture%n + 1)
               measured%euler = reshape(texture%euler_deg*degree, [3, n], &
                  & pad=texture%euler_deg*degree)
            end associate
            measured%probability = spread(1.0_wp/n, 1, n)
         else
            call spread_orientations(problem%class, n, measured%euler, measured%probability)
            n = size(measured%probability)
         end if
         measured%tilt_sd = spread(0.0_wp, 1, n)
      end subroutine let_be_unknown
   end subroutine new_table_posterior

   !> Compare the measured references with their crystals.
   subroutine take_references(problem, model, table, references, error)
      type(problem_type), intent(in) :: problem
      type(measurements_settings_type), intent(in) :: model
      !> The measurements, of which each reference has a group.
      type(points_type), intent(in) :: table
      type(reference_rows_type), allocatable, intent(out) :: references
      type(error_type), allocatable, intent(out) :: error
      type(observable_type) :: observable
      real(wp), dimension(problem%data%reference_grains%n) :: log_modulus, log_mean, value, slope
      integer :: i

      call new_observable(model%modulus_kind, model, observable, error)
      if (allocated(error)) return
      allocate (references)
      associate (rows => problem%data%reference_grains, n => problem%data%reference_grains%n)
         references%sd = rows%sd_gpa/rows%modulus_gpa
         references%crystal_sd = spread(problem%settings%references%crystal_sd, 1, n)
         allocate (references%crystal(n), references%group(n))
         do i = 1, n
            call find_crystal(rows%name(i))
            if (.not. allocated(error)) call find_group()
            call prefix_error(error, 'line '//to_text(rows%table%line(i))//': ')
            if (allocated(error)) return
         end do
         slope = exp(model%contrast_mean)*(log_modulus - log_mean)
         value = exp(log_mean + slope)
         references%slope = value*slope
         call observable%to_measured(value, references%slope)
         references%slope = references%slope/value
         references%deviation = log(rows%modulus_gpa/value)
      end associate

   contains

      !> Find the crystal of row i and the logarithms of its modulus and of its mean over all
      !> directions.
      subroutine find_crystal(name)
         character(len=*), intent(in) :: name
         integer, parameter :: directions = 12
         real(wp), allocatable :: euler(:, :), weights(:), moduli(:)
         integer :: k, m

         associate (crystals => problem%data%references)
            k = 0
            if (allocated(problem%data%references)) then
               k = findloc([(crystals%name(m) == name, m=1, crystals%n)], .true., 1)
            end if
            if (k == 0) then
               call refuse(error, 'the reference '//printable(name)//' is no crystal of ' &
                  & //'&references')
               return
            end if
            references%crystal(i) = k
            call spread_orientations(crystals%classes(crystals%class(k)), directions, euler, &
               & weights)
            euler = reshape([problem%data%reference_grains%euler_deg(:, i), euler/degree], &
               & [3, size(weights) + 1])
            allocate (moduli(size(euler, 2)))
            call halfspace_moduli(spread(crystals%stiffness(:, :, k), 3, size(moduli)), euler, 1, &
               & moduli, error)
            if (allocated(error)) return
            log_modulus(i) = log(moduli(1))
            log_mean(i) = dot_product(weights, log(moduli(2:)))
         end associate
      end subroutine find_crystal

      !> Find the group of row i among those of the measurements.
      subroutine find_group()
         integer :: own, k

         references%group(i) = 1
         own = table%table%find('group')
         if (own == 0) return
         associate (cell => problem%data%reference_grains%table%cell(own, i))
            k = findloc([(table%table%cell(own, table%row(k)) == cell, k=1, size(table%row))], &
               & .true., 1)
            if (k == 0) then
               call refuse(error, 'no grain is of the group '//printable(cell)//' of the reference')
            else
               references%group(i) = table%group(k)
            end if
         end associate
      end subroutine find_group
   end subroutine take_references

   !> The posterior of other measurements, or with another model of their errors, than those of the
   !> problem. The prior and the knowledge are those of the problem.
   subroutine new_measured_posterior(problem, model, measured, surrogate, posterior, error)
      type(problem_type), intent(in) :: problem
      type(measurements_settings_type), intent(in) :: model
      type(measured_type), intent(in) :: measured
      type(surrogate_type), intent(in) :: surrogate
      type(posterior_type), intent(out) :: posterior
      type(error_type), allocatable, intent(out) :: error
      !> Poisson's ratio of an isotropic solid with the mean measurement: its Young's modulus sets
      !> the scale of the default prior.
      real(wp), parameter :: typical_poisson = 0.3_wp
      type(prior_type) :: prior
      type(knowledge_type) :: knowledge
      type(observable_type) :: observable
      real(wp) :: young

      call read_knowledge(problem, knowledge, error)
      if (allocated(error)) return
      call new_observable(model%modulus_kind, model, observable, error)
      if (allocated(error)) return
      young = (1.0_wp - typical_poisson**2)*mean_modulus(observable, measured)
      if (problem%settings%specimen%geometry == film_name) then
         young = young_of_film(problem, mean_modulus(observable, measured), typical_poisson)
      end if
      call new_prior(surrogate%basis%domain%support(), problem%class, problem%settings%prior, &
         & young, knowledge, prior, error)
      call problem%locate('prior', '', error)
      if (allocated(error)) return
      call new_posterior(surrogate, prior, model, &
         & problem%settings%sampler%surrogate_variance == 'full', measured, posterior, error)
      call problem%locate('measurements', '', error)
   end subroutine new_measured_posterior

   !> Relative errors that n measurements share, (measurement, error). The first rows are those of
   !> the moduli, with the errors that the user stated; the others are those of the speeds, with
   !> the error of the density. A speed is the power -1/2 of the density.
   pure function shared_errors(problem, stated, n) result(shared)
      type(problem_type), intent(in) :: problem
      !> (modulus, error).
      real(wp), intent(in) :: stated(:, :)
      integer, intent(in) :: n
      real(wp), allocatable :: shared(:, :)
      logical :: has_density

      associate (n_moduli => size(stated, 1), n_stated => size(stated, 2), &
         & density => problem%settings%problem%density_kg_m3, &
         & density_sd => problem%settings%problem%density_sd_kg_m3)
         has_density = n > n_moduli .and. density_sd > 0.0_wp
         allocate (shared(n, n_stated + merge(1, 0, has_density)), source=0.0_wp)
         shared(:n_moduli, :n_stated) = stated
         if (has_density) shared(n_moduli + 1:, n_stated + 1) = -0.5_wp*density_sd/density
      end associate
   end function shared_errors

   !> The chains that &sampler asks for.
   subroutine sample_posterior(problem, posterior, chains, error)
      type(problem_type), intent(in) :: problem
      type(posterior_type), intent(in) :: posterior
      !> On entry it may have the samplers of a similar posterior.
      type(chains_type), intent(inout) :: chains
      type(error_type), allocatable, intent(out) :: error

      call check_step_2(problem, error)
      if (allocated(error)) return
      associate (s => problem%settings%sampler)
         call run_chains(problem, posterior, s%method, &
            & run_type(s%burn_in, s%samples, s%chains, 1), chains, error)
      end associate
   end subroutine sample_posterior

   !> Chains that &sampler does not ask for, by the sampler that mixes best, from random streams of
   !> their own. The half-space theory is evaluated with few harmonics: its last digits do not
   !> matter.
   subroutine sample_aside(problem, density, run, chains, error)
      type(problem_type), intent(in) :: problem
      type(posterior_type), intent(inout) :: density
      !> One of those above.
      type(run_type), intent(in) :: run
      type(chains_type), intent(out) :: chains
      type(error_type), allocatable, intent(out) :: error

      if (density%grains%has_theory .and. .not. density%prior_only) then
         call density%set_field_degree(merge(degree_of_many, rough_degree, &
            & density%n_grains > many), error)
      end if
      if (allocated(error)) return
      call run_chains(problem, density, trim(merge('direct  ', 'ensemble', &
         & density%prior_only .and. density%prior%is_drawn())), run, chains, error)
   end subroutine sample_aside

   !> Chains of a density.
   subroutine run_chains(problem, density, method, run, chains, error)
      type(problem_type), intent(in) :: problem
      type(posterior_type), intent(in) :: density
      !> Of the sampler.
      character(len=*), intent(in) :: method
      type(run_type), intent(in) :: run
      type(chains_type), intent(inout) :: chains
      type(error_type), allocatable, intent(out) :: error
      class(sampler_type), allocatable :: sampler
      type(posterior_type) :: condensed

      call new_sampler(method, run%burn_in, sampler, error)
      if (run%is_rough) sampler%efforts = 1
      condensed = density
      call condense(condensed)
      if (.not. allocated(error)) then
         call sample_chains(condensed, sampler, run_settings_type(run%samples, run%chains, &
            & problem%threads(), problem%settings%problem%seed, run%first_stream), chains, error)
      end if
      call problem%locate('prior', '', error)
   end subroutine run_chains

   !> Replace the grains by fewer measurements with the same posterior density, where that is
   !> possible. No other result may be computed from the posterior afterwards.
   !>
   !> Many grains may depend on few coefficients of an expansion. If errors are normal, independent
   !> and of known sd, these have sufficient statistics: the sum of squares over all grains equals
   !> that over as many measurements as there are coefficients, plus a constant.
   subroutine condense(self)
      type(posterior_type), intent(inout) :: self
      real(wp), allocatable :: values(:)
      real(wp) :: rest
      integer :: n

      if (self%settings%likelihood /= 'normal' .or. self%infers_scale .or. self%n_shared > 0 &
         & .or. self%has_own_variance() .or. self%observable%compliance > 0.0_wp &
         & .or. self%laboratory%changes_moduli()) then
         return
      end if
      select type (grains => self%grains)
      type is (correction_grain_model_type)
         call grains%expansion%condense(self%observable%factor/self%scale, &
            & self%data%modulus/self%scale, values, rest)
      end select
      if (.not. allocated(values)) return
      n = size(values)
      self%log_scales = self%log_scales + 0.5_wp*(rest + (self%n_grains - n)*log(2.0_wp*pi))
      self%data%modulus = values*self%observable%factor
      self%scale = spread(self%observable%factor, 1, n)
      self%n_grains = n
      self%n_moduli = n
      self%euler = self%euler(:, :n)
      if (allocated(self%rough)) deallocate (self%rough)
   end subroutine condense
end module problem_posterior
