!> Finished chains on the disk, until what is made of them is written: a run that was stopped goes on with them, bit for bit.
!>
!> A chain follows from the target, the sampler's settings and its random stream. Its file is named by a hash of the settings and of the
!> densities of some points, whose bits tell other measurements, another surrogate and another prior. The file has the bits of acceptance,
!> densities and draws, and their checksum. A chain that cannot be kept, or whose file is damaged, is drawn again.
module chain_checkpoints
   use abstract_sampler, only: draw_starts
   use checksums, only: checksum
   use errors, only: error_type
   use files, only: file_exists, read_bytes, replace_file
   use kinds, only: i8, wp
   use random, only: new_random_stream, random_stream_type
   use sampling_target, only: target_type
   use text, only: to_text
   implicit none
   private
   public :: checkpoint_type, new_checkpoint

   !> How the names of the files begin.
   character(len=*), parameter, public :: chain_prefix = '.chain-'
   integer(i8), parameter :: bytes_of_real = storage_size(1.0_wp)/8

   type :: checkpoint_type
      private
      !> Path of a chain's file but for its stream; unallocated: nothing is kept.
      character(len=:), allocatable :: stem
   contains
      procedure :: path => path_of
      procedure :: restore
      procedure :: store
   end type checkpoint_type

contains

   !> Where chains of a target are kept: in a folder without its last slash, for settings that `inputs` tells apart.
   subroutine new_checkpoint(folder, inputs, target, self)
      character(len=*), intent(in) :: folder, inputs
      class(target_type), intent(in) :: target
      type(checkpoint_type), intent(out) :: self
      integer, parameter :: probes = 20
      type(random_stream_type) :: stream
      real(wp) :: points(target%dimension, probes), density(probes)
      character(len=:), allocatable :: identity
      character(len=16) :: digits
      integer :: found, i

      stream = new_random_stream(0, 0)
      call draw_starts(target, stream, points, density, found)
      identity = inputs
      do i = 1, found
         write (digits, '(z16.16)') transfer(density(i), 1_i8)
         identity = identity//digits
      end do
      self%stem = folder//'/'//chain_prefix//checksum(identity)//'-'
   end subroutine new_checkpoint

   !> The file of the chain of a random stream, `number`.
   function path_of(self, number) result(path)
      class(checkpoint_type), intent(in) :: self
      integer, intent(in) :: number
      character(len=:), allocatable :: path

      path = self%stem//to_text(number)
   end function path_of

   !> The chain of a random stream, if it is there.
   subroutine restore(self, number, draws, log_density, acceptance, found)
      class(checkpoint_type), intent(in) :: self
      !> Of the stream.
      integer, intent(in) :: number
      !> (parameter, sample), (sample).
      real(wp), intent(inout) :: draws(:, :), log_density(:)
      !> See `sampler_type`.
      real(wp), intent(inout) :: acceptance
      !> Whether it is there; else nothing is changed.
      logical, intent(out) :: found
      type(error_type), allocatable :: error
      character(len=:), allocatable :: content
      real(wp), allocatable :: values(:)
      integer(i8) :: last
      integer :: n

      found = .false.
      if (.not. allocated(self%stem)) return
      if (.not. file_exists(self%path(number))) return
      call read_bytes(self%path(number), content, error)
      if (allocated(error)) return
      allocate (values(1 + size(log_density) + size(draws)))
      last = size(values)*bytes_of_real
      if (len(content) /= last + len(checksum(''))) return
      if (content(last + 1:) /= checksum(content(:last))) return
      values = transfer(content(:last), values)
      n = size(log_density)
      acceptance = values(1)
      log_density = values(2:n + 1)
      draws = reshape(values(n + 2:), shape(draws))
      found = .true.
   end subroutine restore

   !> Keep the chain of a random stream.
   subroutine store(self, number, draws, log_density, acceptance)
      class(checkpoint_type), intent(in) :: self
      !> Of the stream.
      integer, intent(in) :: number
      !> (parameter, sample), (sample).
      real(wp), intent(in) :: draws(:, :), log_density(:)
      !> See `sampler_type`.
      real(wp), intent(in) :: acceptance
      type(error_type), allocatable :: error
      real(wp), allocatable :: values(:)
      character(len=:), allocatable :: content

      if (.not. allocated(self%stem)) return
      values = [acceptance, log_density, reshape(draws, [size(draws)])]
      allocate (character(len=size(values)*bytes_of_real) :: content)
      content = transfer(values, content)
      call replace_file(self%path(number), content//checksum(content), error)
   end subroutine store
end module chain_checkpoints
