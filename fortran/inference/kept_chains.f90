!> Finished chains on the disk, until what is made of them is written: a run that was stopped goes on with them, bit for bit.
!>
!> A chain follows from the target, the sampler's settings and its random stream. Its file is named by a hash of the settings and of the
!> densities of some points, whose bits tell other measurements, another surrogate and another prior. A chain that cannot be kept, or whose
!> file is damaged, is drawn again.
module kept_chains
   use abstract_sampler, only: draw_starts
   use checksums, only: checksum
   use errors, only: error_type
   use files, only: file_exists, read_text_file, replace_file
   use kinds, only: i8, wp
   use labelled_text, only: labelled_text_type
   use random, only: new_random_stream, random_stream_type
   use sampling_target, only: target_type
   use text, only: to_text
   implicit none
   private
   public :: chain_shelf_type, new_chain_shelf

   !> How the names of the files begin.
   character(len=*), parameter, public :: chain_prefix = '.chain-'

   type :: chain_shelf_type
      private
      !> Path of a chain's file but for its stream; unallocated: nothing is kept.
      character(len=:), allocatable :: stem
   contains
      procedure :: path => path_of
      procedure :: fetch
      procedure :: keep
   end type chain_shelf_type

contains

   !> Where chains of a target are kept: in a folder without its last slash, for settings that `inputs` tells apart.
   subroutine new_chain_shelf(folder, inputs, target, self)
      character(len=*), intent(in) :: folder, inputs
      class(target_type), intent(in) :: target
      type(chain_shelf_type), intent(out) :: self
      integer, parameter :: probes = 20
      type(random_stream_type) :: stream
      real(wp) :: points(target%dimension, probes), density(probes)
      character(len=:), allocatable :: told
      character(len=16) :: digits
      integer :: found, i

      stream = new_random_stream(0, 0)
      call draw_starts(target, stream, points, density, found)
      told = inputs
      do i = 1, found
         write (digits, '(z16.16)') transfer(density(i), 1_i8)
         told = told//digits
      end do
      self%stem = folder//'/'//chain_prefix//checksum(told)//'-'
   end subroutine new_chain_shelf

   !> The file of the chain of a random stream, `number`.
   function path_of(self, number) result(path)
      class(chain_shelf_type), intent(in) :: self
      integer, intent(in) :: number
      character(len=:), allocatable :: path

      path = self%stem//to_text(number)
   end function path_of

   !> The chain of a random stream, if it is there.
   subroutine fetch(self, number, draws, log_density, acceptance, found)
      class(chain_shelf_type), intent(in) :: self
      !> Of the stream.
      integer, intent(in) :: number
      !> (parameter, sample), (sample).
      real(wp), intent(inout) :: draws(:, :), log_density(:)
      !> See `sampler_type`.
      real(wp), intent(inout) :: acceptance
      !> Whether it is there; else nothing is changed.
      logical, intent(out) :: found
      type(labelled_text_type) :: file
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:), densities(:)
      real(wp) :: share

      found = .false.
      if (.not. allocated(self%stem)) return
      if (.not. file_exists(self%path(number))) return
      call read_text_file(self%path(number), file%content, error)
      if (allocated(error)) return
      file%reading = .true.
      call exchange(file, values, densities, share)
      if (allocated(file%error)) return
      if (size(values) /= size(draws) .or. size(densities) /= size(log_density)) return
      draws = reshape(values, shape(draws))
      log_density = densities
      acceptance = share
      found = .true.
   end subroutine fetch

   !> Keep the chain of a random stream.
   subroutine keep(self, number, draws, log_density, acceptance)
      class(chain_shelf_type), intent(in) :: self
      !> Of the stream.
      integer, intent(in) :: number
      !> (parameter, sample), (sample).
      real(wp), intent(in) :: draws(:, :), log_density(:)
      !> See `sampler_type`.
      real(wp), intent(in) :: acceptance
      type(labelled_text_type) :: file
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:), densities(:)
      real(wp) :: share

      if (.not. allocated(self%stem)) return
      values = reshape(draws, [size(draws)])
      densities = log_density
      share = acceptance
      call exchange(file, values, densities, share)
      if (.not. allocated(file%error)) call replace_file(self%path(number), file%content(:file%filled), error)
   end subroutine keep

   !> The content of a file.
   subroutine exchange(file, values, densities, share)
      type(labelled_text_type), intent(inout) :: file
      real(wp), allocatable, intent(inout) :: values(:), densities(:)
      real(wp), intent(inout) :: share

      call file%real('acceptance', share)
      call file%reals('log_density', densities)
      call file%reals('draws', values)
      call file%finish()
   end subroutine exchange
end module kept_chains
