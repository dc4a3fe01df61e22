!> The last stage of the batch program: samples of the constants behind the measured moduli.
module batch_sample
   use, intrinsic :: iso_fortran_env, only: error_unit
   use abstract_sampler, only: sampler_type
   use batch_simulate, only: worker_count
   use batch_stages, only: fits_surrogate, surrogate_name
   use chain_diagnostics, only: diagnose_chains, diagnostics_type
   use constants_posterior, only: likelihood_type, new_posterior, posterior_type
   use constants_prior, only: default_bounds, new_prior, normal_knowledge_type, prior_type
   use derived_quantities, only: quantity_names, quantity_number
   use errors, only: error_type, exit_bad_input, raise
   use files, only: file_exists, replace_file, resolve_path
   use kinds, only: degree, wp
   use namelist_file, only: place
   use problem, only: problem_type
   use samplers, only: chains_type, new_sampler, run_settings_type, sample_chains
   use surrogate_model, only: load_surrogate, surrogate_type
   use text, only: join, to_text
   implicit none
   private
   public :: sample_constants, check_sampling

   character, parameter :: newline = achar(10)

   !> Chains have mixed if R-hat is below and the effective sample sizes of a parameter are above this for each chain (Vehtari et
   !> al., Bayesian Anal. 16, 667, 2021). The Python package has the same, and the same words.
   real(wp), parameter :: greatest_r_hat = 1.01_wp
   integer, parameter :: least_size = 100

contains

   !> Sample: `posterior.csv` with every draw and its log density, `summary.nml` with what they say.
   subroutine sample_constants(self, output, told, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      character(len=:), allocatable, intent(out) :: told
      type(error_type), allocatable, intent(out) :: error
      type(posterior_type) :: posterior
      type(chains_type) :: chains
      type(diagnostics_type), allocatable :: diagnostics(:)
      class(sampler_type), allocatable :: sampler

      call posterior_of(self, output, posterior, error)
      if (allocated(error)) return
      call new_sampler(self%settings%sampler%method, self%settings%sampler%burn_in, sampler, error)
      if (.not. allocated(error)) call sample_chains(posterior, sampler, run_settings_of(self), chains, error)
      if (allocated(error)) then
         error%message = place(self%path, 'prior', '')//error%message
         return
      end if
      call write_draws(self, chains, output//'/posterior.csv', error)
      if (allocated(error)) return
      call diagnose(self, chains, diagnostics)
      call write_summary(self, posterior, chains, diagnostics, output//'/summary.nml', error)
      if (allocated(error)) return
      call tell_mixing(self, chains, diagnostics)
      told = to_text(size(chains%draws, 3))//' chains of '//to_text(size(chains%draws, 2))//' samples: '//output//'/posterior.csv'
   end subroutine sample_constants

   !> What `sample_constants` would refuse, unless the file's own fit is still to make the surrogate.
   subroutine check_sampling(self, output, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(error_type), allocatable, intent(out) :: error
      type(posterior_type) :: posterior

      if (fits_surrogate(self) .and. surrogate_path(self, output) == fitted_path(output)) return
      call posterior_of(self, output, posterior, error)
   end subroutine check_sampling

   !> The density that is sampled.
   subroutine posterior_of(self, output, posterior, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(posterior_type), intent(out) :: posterior
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: surrogate
      type(prior_type) :: prior
      real(wp), allocatable :: sd(:)

      call find_surrogate(self, output, surrogate, error)
      if (allocated(error)) return
      call prior_of(self, surrogate, prior, error)
      if (.not. allocated(error)) then
         associate (measured => self%measurements)
            sd = measured%sd_gpa
            ! Only where the sds are one unknown common value may they be absent.
            if (.not. all(sd > 0.0_wp)) sd = 1.0_wp
            call new_posterior(surrogate, prior, likelihood_of(self), measured%euler_deg*degree, measured%modulus_gpa, sd, &
               & posterior, error)
         end associate
      end if
      if (allocated(error)) error%message = place(self%path, 'prior', '')//error%message
   end subroutine posterior_of

   !> The surrogate that a fit leaves in the output folder.
   pure function fitted_path(output) result(path)
      character(len=*), intent(in) :: output
      character(len=:), allocatable :: path

      path = output//'/'//surrogate_name
   end function fitted_path

   !> The surrogate of the output folder, or the text file that &surrogate names, there or in the namelist's folder.
   function surrogate_path(self, output) result(path)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      character(len=:), allocatable :: path, name

      name = self%settings%surrogate%file
      path = fitted_path(output)
      if (len(name) <= 4) return
      if (name(len(name) - 3:) /= '.nml') return
      path = resolve_path(output//'/', name)
      if (path == fitted_path(output) .and. fits_surrogate(self)) return
      if (.not. file_exists(path)) path = resolve_path(self%folder, name)
   end function surrogate_path

   !> Load the surrogate, of the right symmetry.
   subroutine find_surrogate(self, output, surrogate, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: path

      path = surrogate_path(self, output)
      if (.not. file_exists(path)) then
         call raise(error, place(self%path, 'surrogate', 'file')//path//': there is no such surrogate; the batch program reads ' &
            & //'text, which it fits itself or Surrogate.write_text of the Python package writes', exit_bad_input)
         return
      end if
      call load_surrogate(path, surrogate, error)
      if (allocated(error)) then
         error%message = place(self%path, 'surrogate', 'file')//error%message
      else if (surrogate%basis%class%name /= self%class%name) then
         call raise(error, place(self%path, 'surrogate', 'file')//path//' is for '//surrogate%basis%class%name &
            & //' crystals, not '//self%class%name//' ones', exit_bad_input)
      end if
   end subroutine find_surrogate

   !> &prior and &knowledge over the surrogate's domain.
   subroutine prior_of(self, surrogate, prior, error)
      type(problem_type), intent(in) :: self
      type(surrogate_type), intent(in) :: surrogate
      type(prior_type), intent(out) :: prior
      type(error_type), allocatable, intent(out) :: error
      type(normal_knowledge_type), allocatable :: normals(:)
      real(wp), allocatable :: lower(:), upper(:)
      character(len=:), allocatable :: name
      real(wp) :: cap
      integer :: numbers(2), i, slash

      call default_bounds(surrogate, lower, upper)
      if (allocated(self%settings%prior%c_min)) lower = self%settings%prior%c_min
      if (allocated(self%settings%prior%c_max)) upper = self%settings%prior%c_max
      cap = surrogate%anisotropy_cap
      if (allocated(self%settings%prior%anisotropy_cap)) cap = self%settings%prior%anisotropy_cap
      allocate (normals(0))
      if (allocated(self%settings%knowledge%quantity)) then
         do i = 1, size(self%settings%knowledge%quantity)
            name = trim(self%settings%knowledge%quantity(i))
            slash = index(name//'/', '/')
            numbers(1) = quantity_number(self%class, name(:slash - 1))
            numbers(2) = quantity_number(self%class, name(slash + 1:))
            if (numbers(1) == 0 .or. (numbers(2) == 0 .and. slash <= len(name))) then
               call raise(error, ''''//name//''' is no quantity of the crystal; allowed ' &
                  & //join(quantity_names(self%class), ', ')//', or the ratio of two of them with a /', exit_bad_input)
               return
            end if
            normals = [normals, normal_knowledge_type(numbers(1), numbers(2), self%settings%knowledge%mean(i), &
               & self%settings%knowledge%sd(i))]
         end do
      end if
      call new_prior(surrogate, lower, upper, cap, normals, prior, error)
   end subroutine prior_of

   function likelihood_of(self) result(likelihood)
      type(problem_type), intent(in) :: self
      type(likelihood_type) :: likelihood

      associate (m => self%settings%measurements)
         likelihood%modulus_kind = m%modulus_kind
         likelihood%indenter_modulus = m%indenter_modulus_gpa
         likelihood%indenter_nu = m%indenter_nu
         likelihood%sample_nu = m%sample_nu
         likelihood%calibration_sd = m%calibration_sd
         likelihood%errors = m%likelihood
         likelihood%student_dof = m%student_dof
         likelihood%infer_scale = m%scale == 'inferred'
      end associate
      likelihood%surrogate_uncertainty = self%settings%sampler%surrogate_variance == 'full'
   end function likelihood_of

   function run_settings_of(self) result(settings)
      type(problem_type), intent(in) :: self
      type(run_settings_type) :: settings

      settings%samples = self%settings%sampler%samples
      settings%chains = self%settings%sampler%chains
      settings%seed = self%settings%problem%seed
      settings%threads = worker_count(self)
   end function run_settings_of

   !> Names of the parameters: the constants, then the factor on the sds where that is inferred.
   function parameter_names(self, n) result(names)
      type(problem_type), intent(in) :: self
      integer, intent(in) :: n
      character(len=9) :: names(n)
      integer :: k

      k = self%class%n_constants
      names(:k) = self%class%constants
      if (n > k) names(k + 1:) = 'sd_factor'
   end function parameter_names

   !> A parameter as it is written: the sampler's last one is the logarithm of the factor.
   elemental real(wp) function written(value, is_logarithm)
      real(wp), intent(in) :: value
      logical, intent(in) :: is_logarithm

      written = value
      if (is_logarithm) written = exp(value)
   end function written

   subroutine write_draws(self, chains, path, error)
      type(problem_type), intent(in) :: self
      type(chains_type), intent(in) :: chains
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      !> No number takes more characters.
      integer, parameter :: widest = 26, all_digits = 17
      character(len=:), allocatable :: page
      integer :: n, k, i, j, chain, filled

      n = size(chains%draws, 1)
      k = self%class%n_constants
      allocate (character(len=256 + widest*(n + 3)*size(chains%draws, 2)*size(chains%draws, 3)) :: page)
      filled = 0
      call put('chain,draw,'//join(parameter_names(self, n), ',')//',log_density'//newline)
      do chain = 1, size(chains%draws, 3)
         do i = 1, size(chains%draws, 2)
            call put(to_text(chain)//','//to_text(i)//',')
            do j = 1, n
               call put(to_text(written(chains%draws(j, i, chain), j > k), all_digits)//',')
            end do
            call put(to_text(chains%log_density(i, chain), all_digits)//newline)
         end do
      end do
      call replace_file(path, page(:filled), error)

   contains

      subroutine put(piece)
         character(len=*), intent(in) :: piece

         page(filled + 1:filled + len(piece)) = piece
         filled = filled + len(piece)
      end subroutine put
   end subroutine write_draws

   !> Draws of a parameter as they are written, (sample, chain).
   pure subroutine get_written(self, chains, parameter, values)
      type(problem_type), intent(in) :: self
      type(chains_type), intent(in) :: chains
      integer, intent(in) :: parameter
      real(wp), allocatable, intent(out) :: values(:, :)

      values = written(chains%draws(parameter, :, :), parameter > self%class%n_constants)
   end subroutine get_written

   !> How far the chains of each parameter have mixed.
   subroutine diagnose(self, chains, diagnostics)
      type(problem_type), intent(in) :: self
      type(chains_type), intent(in) :: chains
      type(diagnostics_type), allocatable, intent(out) :: diagnostics(:)
      real(wp), allocatable :: values(:, :)
      integer :: j

      allocate (diagnostics(size(chains%draws, 1)))
      !$omp parallel do num_threads(worker_count(self)) schedule(dynamic, 1) private(values)
      do j = 1, size(diagnostics)
         call get_written(self, chains, j, values)
         diagnostics(j) = diagnose_chains(values)
      end do
      !$omp end parallel do
   end subroutine diagnose

   !> Warn of chains that have not mixed.
   subroutine tell_mixing(self, chains, diagnostics)
      type(problem_type), intent(in) :: self
      type(chains_type), intent(in) :: chains
      type(diagnostics_type), intent(in) :: diagnostics(:)
      character(len=9) :: names(size(diagnostics))
      character(len=:), allocatable :: method, said, remedy
      real(wp) :: ess
      logical :: alone
      integer :: j

      names = parameter_names(self, size(diagnostics))
      method = self%settings%sampler%method
      remedy = 'take more samples'
      if (method /= 'ensemble') remedy = remedy//', or method ''ensemble'''
      alone = size(chains%draws, 3) == 1
      do j = 1, size(diagnostics)
         ess = min(diagnostics(j)%ess_bulk, diagnostics(j)%ess_tail)
         ! NaN has not mixed.
         if ((diagnostics(j)%r_hat < greatest_r_hat .or. alone) .and. ess > least_size*size(chains%draws, 3)) cycle
         said = 'there is one chain'
         if (.not. alone) said = 'R-hat is '//fixed(diagnostics(j)%r_hat, 3)//' (below '//to_text(greatest_r_hat)//' is well)'
         write (error_unit, '(a)') 'warning: the chains of '//trim(names(j))//' have not mixed: '//said &
            & //', and they are worth '//fixed(ess, 0)//' independent samples; '//remedy
      end do
   end subroutine tell_mixing

   !> A number >= 0 with so many digits after the point, and no point without them.
   pure function fixed(value, decimals) result(string)
      real(wp), intent(in) :: value
      integer, intent(in) :: decimals
      character(len=:), allocatable :: string
      character(len=40) :: buffer, layout

      if (.not. abs(value) <= huge(value)) then
         string = merge('inf', 'nan', value > 0.0_wp)
         return
      end if
      write (layout, '(a,i0,a)') '(f40.', decimals, ')'
      write (buffer, layout) value
      string = trim(adjustl(buffer))
      if (decimals == 0) string = string(:len(string) - 1)
   end function fixed

   !> Mean, sd, best draw and diagnostics of the parameters, and the predicted modulus of each grain.
   subroutine write_summary(self, posterior, chains, diagnostics, path, error)
      type(problem_type), intent(in) :: self
      type(posterior_type), intent(in) :: posterior
      type(chains_type), intent(in) :: chains
      type(diagnostics_type), intent(in) :: diagnostics(:)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      !> Draws for the predictions; more say nothing new.
      integer, parameter :: most_draws = 4000
      real(wp), allocatable :: values(:, :), moduli(:, :), slope(:), mean(:), sd(:), map(:)
      character(len=:), allocatable :: page
      integer :: n, samples, n_chains, j, stride, draws, i, chain, best(2)

      n = size(chains%draws, 1)
      samples = size(chains%draws, 2)
      n_chains = size(chains%draws, 3)
      best = maxloc(chains%log_density)
      allocate (mean(n), sd(n), map(n))
      do j = 1, n
         call get_written(self, chains, j, values)
         mean(j) = sum(values)/(samples*n_chains)
         sd(j) = sqrt(sum((values - mean(j))**2)/max(1, samples*n_chains - 1))
         map(j) = values(best(1), best(2))
      end do
      page = '! Posterior of the constants, GPa: every draw is in posterior.csv.'//newline//'&summary'//newline &
         & //'  parameters = '''//join(parameter_names(self, n), ''', ''')//''''//newline &
         & //line('mean', mean)//line('sd', sd)//line('map', map) &
         & //line('ess_bulk', diagnostics%ess_bulk)//line('ess_tail', diagnostics%ess_tail)//line('r_hat', diagnostics%r_hat) &
         & //line('acceptance', [sum(chains%acceptance)/n_chains]) &
         & //'  samples = '//to_text(samples)//newline//'  chains = '//to_text(n_chains)//newline//'/'//newline

      stride = max(1, samples*n_chains/most_draws)
      draws = n_chains*((samples + stride - 1)/stride)
      allocate (moduli(posterior%n_grains, draws), slope(posterior%n_grains))
      draws = 0
      do chain = 1, n_chains
         do i = 1, samples, stride
            draws = draws + 1
            call posterior%moduli(chains%draws(:, i, chain), moduli(:, draws))
            call posterior%kind%apply(moduli(:, draws), slope)
         end do
      end do
      mean = sum(moduli, dim=2)/draws
      sd = [(sqrt(sum((moduli(j, :) - mean(j))**2)/max(1, draws - 1)), j=1, size(moduli, 1))]
      page = page//'! Modulus of each grain by the surrogate''s mean, of the kind that was measured, GPa.'//newline//'&predicted' &
         & //newline//line('mean', mean)//line('sd', sd)//line('measured', self%measurements%modulus_gpa)//'/'//newline
      call replace_file(path, page, error)
   end subroutine write_summary

   !> `name = values`, one line of a namelist.
   function line(name, values)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: values(:)
      character(len=:), allocatable :: line
      integer :: i

      line = '  '//name//' = '
      do i = 1, size(values)
         if (i > 1) line = line//', '
         line = line//to_text(values(i), 9)
      end do
      line = line//newline
   end function line
end module batch_sample
