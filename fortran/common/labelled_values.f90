!> Named values in a fixed order, which one procedure both gives and takes: it names them one by one to a visitor that writes them,
!> reads them, or describes them. So what is written, read and described cannot differ. After the first error nothing more is done.
module labelled_values
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   implicit none
   private
   public :: labelled_values_type

   type, abstract :: labelled_values_type
      !> Values are taken from the visitor; else they are given to it.
      logical :: reading = .false.
      type(error_type), allocatable :: error
   contains
      !> A text without line breaks.
      procedure(visit_text), deferred :: text
      !> A text of any number of lines.
      procedure(visit_text), deferred :: lines
      procedure(visit_integer), deferred :: integer
      procedure(visit_real), deferred :: real
      !> Any number of reals.
      procedure(visit_reals), deferred :: reals
      procedure :: fail
   end type labelled_values_type

   abstract interface
      subroutine visit_text(self, label, value)
         import :: labelled_values_type
         class(labelled_values_type), intent(inout) :: self
         !> One word.
         character(len=*), intent(in) :: label
         !> Given or taken.
         character(len=:), allocatable, intent(inout) :: value
      end subroutine visit_text

      subroutine visit_integer(self, label, value)
         import :: labelled_values_type
         class(labelled_values_type), intent(inout) :: self
         !> One word.
         character(len=*), intent(in) :: label
         !> Given or taken.
         integer, intent(inout) :: value
      end subroutine visit_integer

      subroutine visit_real(self, label, value)
         import :: labelled_values_type, wp
         class(labelled_values_type), intent(inout) :: self
         !> One word.
         character(len=*), intent(in) :: label
         !> Given or taken.
         real(wp), intent(inout) :: value
      end subroutine visit_real

      subroutine visit_reals(self, label, values)
         import :: labelled_values_type, wp
         class(labelled_values_type), intent(inout) :: self
         !> One word.
         character(len=*), intent(in) :: label
         !> Given or taken.
         real(wp), allocatable, intent(inout) :: values(:)
      end subroutine visit_reals
   end interface

contains

   !> Record an error, unless there is one already.
   subroutine fail(self, reason)
      class(labelled_values_type), intent(inout) :: self
      !> What is wrong, in words.
      character(len=*), intent(in) :: reason

      if (.not. allocated(self%error)) call raise(self%error, reason, exit_bad_input)
   end subroutine fail
end module labelled_values
