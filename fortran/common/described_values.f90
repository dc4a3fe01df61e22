!> Labelled values for another language: a JSON document of them, arrays by their lengths, and one array in full.
module described_values
   use json, only: json_type
   use kinds, only: wp
   use labelled_values, only: labelled_values_type
   implicit none
   private
   public :: described_values_type

   type, extends(labelled_values_type) :: described_values_type
      type(json_type) :: document
      !> Label of the array that is wanted, and its values once it was met.
      character(len=:), allocatable :: wanted
      real(wp), allocatable :: values(:)
   contains
      procedure :: text => describe_text
      procedure :: lines => describe_text
      procedure :: integer => describe_integer
      procedure :: real => describe_real
      procedure :: reals => describe_reals
      procedure :: wants
      procedure :: array
   end type described_values_type

contains

   !> Whether an array that costs something to compute is asked for.
   pure logical function wants(self, label)
      class(described_values_type), intent(in) :: self
      !> Of the value, see `labelled_values`.
      character(len=*), intent(in) :: label

      wants = .false.
      if (allocated(self%wanted)) wants = self%wanted == label
   end function wants

   subroutine describe_text(self, label, value)
      class(described_values_type), intent(inout) :: self
      !> Of the value, see `labelled_values`.
      character(len=*), intent(in) :: label
      !> Given or taken.
      character(len=:), allocatable, intent(inout) :: value

      call self%document%put(label, value)
   end subroutine describe_text

   subroutine describe_integer(self, label, value)
      class(described_values_type), intent(inout) :: self
      !> Of the value, see `labelled_values`.
      character(len=*), intent(in) :: label
      !> Given or taken.
      integer, intent(inout) :: value

      call self%document%put(label, value)
   end subroutine describe_integer

   subroutine describe_real(self, label, value)
      class(described_values_type), intent(inout) :: self
      !> Of the value, see `labelled_values`.
      character(len=*), intent(in) :: label
      !> Given or taken.
      real(wp), intent(inout) :: value

      call self%document%put(label, value)
   end subroutine describe_real

   subroutine describe_reals(self, label, values)
      class(described_values_type), intent(inout) :: self
      !> Of the value, see `labelled_values`.
      character(len=*), intent(in) :: label
      !> Given or taken.
      real(wp), allocatable, intent(inout) :: values(:)

      call self%array(label, size(values), values)
   end subroutine describe_reals

   !> The n `values` of an array of any shape, in Fortran's order.
   subroutine array(self, label, n, values)
      class(described_values_type), intent(inout) :: self
      !> Of the array, see `labelled_values`.
      character(len=*), intent(in) :: label
      integer, intent(in) :: n
      real(wp), intent(in) :: values(n)

      call self%document%put(label, n)
      if (self%wants(label)) self%values = values
   end subroutine array
end module described_values
