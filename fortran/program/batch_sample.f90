!> The last stage of the batch program: samples of the constants behind the measured moduli.
module batch_sample
   use constants_posterior, only: posterior_type
   use errors, only: error_type
   use extraction, only: extract, extraction_type
   use extraction_document, only: write_extraction
   use files, only: new_file_type, replace_file
   use chain_checkpoints, only: chain_prefix
   use namelist_file, only: place
   use posterior_diagnostics, only: check_extraction
   use prior_text, only: describe_prior
   use problem, only: problem_type
   use problem_posterior, only: new_problem_posterior
   use running_command, only: remove_files
   use surrogate_lookup, only: load_named_surrogate, places_type
   use surrogate_model, only: surrogate_type
   use system, only: data_folder
   use text, only: join, to_text
   use version, only: shipped_surrogates
   use warning_lists, only: warning_type
   implicit none
   private
   public :: sample_constants, check_sampling

contains

   !> Sample: `posterior.csv` with every draw and its log density, `summary.json` with what they say.
   subroutine sample_constants(self, output, told, prior, warnings, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      !> One line for the user; the prior that was in effect, and what should be known.
      character(len=:), allocatable, intent(out) :: told
      type(warning_type), allocatable, intent(out) :: prior(:), warnings(:)
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: surrogate
      type(extraction_type) :: found

      call load_surrogate_of(self, output, surrogate, error)
      if (.not. allocated(error)) call extract(self, surrogate, found, error)
      if (.not. allocated(error)) call write_draws(found, output//'/posterior.csv', error)
      if (.not. allocated(error)) call replace_file(output//'/summary.json', write_extraction(self, found), error)
      if (allocated(error)) return
      call remove_files(output, chain_prefix)
      allocate (warnings(0))
      call describe_prior(found, prior)
      call check_extraction(self, found, warnings)
      told = to_text(size(found%chains%draws, 3))//' chains of '//to_text(size(found%chains%draws, 2))//' samples: '//output &
         & //'/posterior.csv'
   end subroutine sample_constants

   !> What `sample_constants` would refuse, unless the file's own build is still to make the surrogate.
   subroutine check_sampling(self, output, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type) :: surrogate
      type(posterior_type) :: posterior

      if (self%settings%design%given) return
      call load_surrogate_of(self, output, surrogate, error)
      if (.not. allocated(error)) call new_problem_posterior(self, surrogate, .false., posterior, error)
   end subroutine check_sampling

   !> The surrogate that &surrogate names, for crystals of the problem's class.
   subroutine load_surrogate_of(self, output, surrogate, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(surrogate_type), intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      type(places_type) :: places

      ! A function of deferred length in a structure constructor makes gfortran 12 allocate one byte for it.
      places%output = output//'/'
      places%folder = self%folder
      places%data_folder = data_folder()
      places%shipped = shipped_surrogates
      call load_named_surrogate(self%settings%surrogate%file, self%class%name, places, surrogate, error)
      if (allocated(error)) error%message = place(self%path, 'surrogate', 'file')//error%message
   end subroutine load_surrogate_of

   !> Every draw, a line each.
   subroutine write_draws(found, path, error)
      type(extraction_type), intent(in) :: found
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: all_digits = 17
      character, parameter :: newline = achar(10)
      type(new_file_type) :: file
      character(len=:), allocatable :: line
      integer :: i, j, chain

      call file%begin(path)
      call file%add('chain,draw,'//join(found%names, ',')//',log_density'//newline)
      do chain = 1, size(found%chains%draws, 3)
         do i = 1, size(found%chains%draws, 2)
            line = to_text(chain)//','//to_text(i)
            do j = 1, size(found%names)
               line = line//','//to_text(found%chains%draws(j, i, chain), all_digits)
            end do
            call file%add(line//','//to_text(found%chains%log_density(i, chain), all_digits)//newline)
         end do
      end do
      call file%finish(error)
   end subroutine write_draws
end module batch_sample
