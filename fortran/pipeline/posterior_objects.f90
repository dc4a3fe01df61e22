!> Posteriors that another language holds: the density, and what Step 2 found of it.
module posterior_objects
   use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
   use constants_posterior, only: posterior_type
   use errors, only: error_type, exit_bad_input, raise
   use extraction, only: extract, extraction_type
   use extraction_document, only: write_extraction
   use interruption, only: listen, stop_listening
   use kinds, only: i8, wp
   use object_registry, only: find_object, register_object
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use problem_posterior, only: new_problem_posterior
   use samplers, only: chains_type
   use surrogate_handles, only: find_surrogate_object
   use surrogate_model, only: surrogate_type
   use text, only: to_text
   implicit none
   private
   public :: posterior_object_type, register_posterior, posterior_of_handle, labelled_values_of, document_of

   type :: posterior_object_type
      type(posterior_type) :: density
      !> The chains that were run last.
      type(chains_type) :: chains
      !> What Step 2 found, if it was done.
      type(extraction_type), allocatable :: found
      !> Its document, and that of what to measure next; JSON.
      character(len=:), allocatable :: document, next
   end type posterior_object_type

   !> What is made of a problem and a surrogate: the density, the prior alone, or all of Step 2.
   integer, parameter, public :: density_alone = 0, prior_alone = 1, all_of_step_2 = 2

contains

   !> A handle for the posterior of `problem_handle` over `surrogate_handle`; 0 if `error` is set.
   subroutine register_posterior(problem_handle, surrogate_handle, what, handle, error)
      integer(i8), intent(in) :: problem_handle, surrogate_handle
      !> One of the three above.
      integer, intent(in) :: what
      integer(i8), intent(out) :: handle
      type(error_type), allocatable, intent(out) :: error
      type(posterior_object_type), pointer :: self
      class(*), pointer :: object
      type(problem_type), pointer :: problem
      type(surrogate_type), pointer :: surrogate

      handle = 0
      call problem_of_handle(problem_handle, problem, error)
      if (.not. allocated(error)) call find_surrogate_object(surrogate_handle, surrogate, error)
      if (allocated(error)) return
      allocate (self)
      if (what == all_of_step_2) then
         allocate (self%found)
         ! A signal between two runs of the sampler must not be missed.
         call listen()
         call extract(problem, surrogate, self%found, error)
         call stop_listening()
         if (.not. allocated(error)) then
            self%density = self%found%posterior
            self%document = write_extraction(problem, self%found)
         end if
      else
         call new_problem_posterior(problem, surrogate, what == prior_alone, self%density, error)
      end if
      if (allocated(error)) then
         deallocate (self)
      else
         object => self
         call register_object(object, 'posterior', handle)
      end if
   end subroutine register_posterior

   subroutine posterior_of_handle(handle, self, error)
      integer(i8), intent(in) :: handle
      type(posterior_object_type), pointer, intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      self => null()
      call find_object(handle, 'posterior', object, error)
      if (allocated(error)) return
      select type (object)
      type is (posterior_object_type)
         self => object
      end select
   end subroutine posterior_of_handle

   !> Numbers of a posterior by their `label`: 'lower', 'upper' bounds of the parameters, 'anisotropy_cap', 'share_inside' (of the stated
   !> crystals that the surrogate covers); of the chains that were run last 'draws' (parameter, sample, chain), 'log_density' (sample,
   !> chain), 'acceptance' (chain); if Step 2 was done the same of its chains ('found_draws', ..), 'prior_draws', for some of the draws
   !> 'predicted', 'log_likelihood', 'replicated' (grain, draw, chain), 'factor' (group, draw, chain), 'quantities' (quantity, draw,
   !> chain), 'log_prior' (draw, chain) and the 'stride' between these, see `predictions_type` and `checks_type`, and 'most_probable'
   !> (parameter, NaN where the data do not say).
   subroutine labelled_values_of(handle, label, sizes, error, values)
      integer(i8), intent(in) :: handle
      character(len=*), intent(in) :: label
      !> Of the array; 0 beyond its dimensions.
      integer, intent(out) :: sizes(3)
      type(error_type), allocatable, intent(out) :: error
      !> All of them in order; as many as there are.
      real(wp), intent(inout), optional :: values(:)
      type(posterior_object_type), pointer :: self

      sizes = 0
      call posterior_of_handle(handle, self, error)
      if (allocated(error)) return
      if (.not. allocated(self%found) .and. any([character(len=17) :: 'found_draws', 'found_log_density', 'found_acceptance', &
         & 'prior_draws', 'predicted', 'log_likelihood', 'replicated', 'log_prior', 'factor', 'quantities', 'stride', &
         & 'most_probable'] == label)) then
         call raise(error, 'Step 2 was not done with this posterior', exit_bad_input)
         return
      end if
      if (.not. allocated(self%chains%draws) .and. any([character(len=11) :: 'draws', 'log_density', 'acceptance'] == label)) then
         call raise(error, 'no chains were run with this posterior', exit_bad_input)
         return
      end if
      select case (label)
      case ('lower')
         call give(size(self%density%prior%lower), [self%density%prior%lower])
      case ('upper')
         call give(size(self%density%prior%upper), [self%density%prior%upper])
      case ('anisotropy_cap')
         call give(1, [self%density%prior%anisotropy_cap])
      case ('share_inside')
         call give(1, [self%density%prior%share_inside])
      case ('draws')
         call give_cube(self%chains%draws)
      case ('log_density')
         call give_table(self%chains%log_density)
      case ('acceptance')
         call give(size(self%chains%acceptance), self%chains%acceptance)
      case ('found_draws')
         call give_cube(self%found%chains%draws)
      case ('found_log_density')
         call give_table(self%found%chains%log_density)
      case ('found_acceptance')
         call give(size(self%found%chains%acceptance), self%found%chains%acceptance)
      case ('prior_draws')
         call give_cube(self%found%prior_chains%draws)
      case ('predicted')
         call give_cube(self%found%predictions%moduli)
      case ('log_likelihood')
         call give_cube(self%found%checks%log_likelihood)
      case ('replicated')
         call give_cube(self%found%checks%replicated)
      case ('log_prior')
         call give_table(self%found%checks%log_prior)
      case ('factor')
         call give_cube(self%found%predictions%factor)
      case ('quantities')
         call give_cube(self%found%predictions%quantities)
      case ('stride')
         call give(1, [real(self%found%predictions%stride, wp)])
      case ('most_probable')
         call give(size(self%found%most_probable), merge(self%found%most_probable, ieee_value(1.0_wp, ieee_quiet_nan), &
            & self%found%determined))
      case default
         call raise(error, 'a posterior has no '//label, exit_bad_input)
      end select

   contains

      subroutine give(n, source)
         integer, intent(in) :: n
         real(wp), intent(in) :: source(n)

         if (sizes(1) == 0) sizes(1) = n
         if (.not. present(values)) return
         if (size(values) == n) then
            values = source
         else
            call raise(error, label//' has '//to_text(n)//' values, not '//to_text(size(values)), exit_bad_input)
         end if
      end subroutine give

      subroutine give_table(source)
         real(wp), intent(in), contiguous :: source(:, :)

         sizes(:2) = shape(source)
         call give(size(source), source)
      end subroutine give_table

      subroutine give_cube(source)
         real(wp), intent(in), contiguous :: source(:, :, :)

         sizes = shape(source)
         call give(size(source), source)
      end subroutine give_cube
   end subroutine labelled_values_of

   !> The document of a `label`, 'extract' or 'next', JSON.
   subroutine document_of(handle, label, document, error)
      integer(i8), intent(in) :: handle
      character(len=*), intent(in) :: label
      character(len=:), allocatable, intent(out) :: document
      type(error_type), allocatable, intent(out) :: error
      type(posterior_object_type), pointer :: self

      call posterior_of_handle(handle, self, error)
      if (allocated(error)) return
      if (label == 'extract' .and. allocated(self%document)) document = self%document
      if (label == 'next' .and. allocated(self%next)) document = self%next
      if (.not. allocated(document)) call raise(error, 'the posterior has no document of '//label, exit_bad_input)
   end subroutine document_of
end module posterior_objects
