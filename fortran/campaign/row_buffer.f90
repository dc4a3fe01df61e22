!> Rows of a campaign on their way to the disk. What took its time is stored at once; rows that took next to none, such as the theory's,
!> wait until there are many of them or some seconds have passed.
module row_buffer
   use campaign, only: campaign_type, row_type
   use errors, only: error_type
   use kinds, only: i8, wp
   implicit none
   private
   public :: row_buffer_type

   integer, parameter :: most_rows = 1000, interval = 5
   !> Seconds of a simulation that is not worth a write of its own.
   real(wp), parameter :: quick = 0.01_wp

   type :: row_buffer_type
      type(row_type), allocatable, private :: rows(:)
      integer, private :: n = 0
      integer(i8), private :: last = 0
   contains
      procedure :: add
      procedure :: flush => store_all
   end type row_buffer_type

contains

   !> Store a row now or soon.
   subroutine add(self, campaign, row, error)
      class(row_buffer_type), intent(inout) :: self
      type(campaign_type), intent(inout) :: campaign
      type(row_type), intent(in) :: row
      type(error_type), allocatable, intent(out) :: error
      integer(i8) :: now, rate
      logical :: full

      if (.not. allocated(self%rows)) allocate (self%rows(most_rows))
      call system_clock(now, rate)
      if (self%n == 0) self%last = now
      self%n = self%n + 1
      self%rows(self%n) = row
      full = self%n == most_rows .or. now - self%last > interval*rate
      if (full .or. row%outcome%seconds > quick .or. row%outcome%elements > 0) call self%flush(campaign, error)
   end subroutine add

   !> Store all that wait.
   subroutine store_all(self, campaign, error)
      class(row_buffer_type), intent(inout) :: self
      type(campaign_type), intent(inout) :: campaign
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (self%n > 0) call campaign%add_rows(self%rows, [(i, i=1, self%n)], error)
      self%n = 0
   end subroutine store_all
end module row_buffer
