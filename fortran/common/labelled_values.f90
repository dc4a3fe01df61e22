!> Values in a fixed order. One procedure names them one by one, and the same procedure writes them,
!> reads them and describes them, so that the three cannot differ. Each value is text, on one line
!> or on several:
!>
!>     degree 4
!>     lower 2
!>     0.15 2.0
!>
!> Reading is strict: the next line must have the expected label, values must be finite, counts must
!> be right, and the last line is a checksum of all lines before it. After the first error nothing
!> more is read or written. A description gives them as named values instead of text.
module labelled_values
   use errors, only: error_type, refuse
   use files, only: checksum, printable
   use kinds, only: i8, wp
   use named_values, only: named_values_type
   use text, only: append, newline, number_ok, read_integer, read_real, to_text
   implicit none
   private
   public :: labelled_values_type

   !> Digits that determine a real exactly.
   integer, parameter :: all_digits = 17
   !> Bytes of the largest text (see `files`).
   integer(i8), parameter :: largest = 1000000000_i8

   type :: labelled_values_type
      !> Whether values are read; they are written otherwise.
      logical :: reading = .false.
      !> If associated, the values are put here instead of into a text.
      type(named_values_type), pointer :: described => null()
      type(error_type), allocatable :: error
      !> The text to read; or the written text, in its first `filled` bytes.
      character(len=:), allocatable :: content
      integer(i8) :: filled = 0
      !> Position of the next byte to read, and number of the line before it.
      integer, private :: position = 1, line = 0
   contains
      procedure :: text => exchange_text, option => exchange_option, lines => exchange_lines, &
         & integer => exchange_integer, &
         & real => exchange_real, reals => exchange_reals, finish, fail
   end type labelled_values_type

contains

   !> Read or write a text without line breaks.
   subroutine exchange_text(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Label of the value, one word.
      character(len=*), intent(in) :: label
      !> Written, or replaced by the value that is read.
      character(len=:), allocatable, intent(inout) :: value
      character(len=:), allocatable :: line

      if (associated(self%described)) then
         call self%described%put(label, value)
      else if (self%reading) then
         call read_line(self, label, line)
         if (index(line, label//' ') /= 1) then
            call self%fail(''''//label//''' is expected, not '''//printable(line)//'''')
         end if
         value = line(len(label) + 2:)
      else
         call append(self%content, self%filled, label//' '//value//newline)
      end if
   end subroutine exchange_text

   !> Read or write a text that a file does not contain where it has its default value.
   subroutine exchange_option(self, label, value, default)
      class(labelled_values_type), intent(inout) :: self
      !> As in `exchange_text`.
      character(len=*), intent(in) :: label, default
      character(len=:), allocatable, intent(inout) :: value
      logical :: is_default

      if (self%reading) then
         is_default = index(self%content(self%position:), label//' ') /= 1
         if (is_default) value = default
      else
         is_default = value == default .and. .not. associated(self%described)
      end if
      if (.not. is_default) call self%text(label, value)
   end subroutine exchange_option

   !> Read or write a text of any number of lines.
   subroutine exchange_lines(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Label of the value, one word.
      character(len=*), intent(in) :: label
      !> Written, or replaced by the value that is read.
      character(len=:), allocatable, intent(inout) :: value
      character(len=:), allocatable :: line
      integer :: n, i, first

      if (associated(self%described)) then
         call self%described%put(label, value)
         return
      end if
      n = 1
      if (.not. self%reading) n = n + count([(value(i:i) == newline, i=1, len(value))])
      call self%integer(label, n)
      if (.not. self%reading) then
         call append(self%content, self%filled, value//newline)
         return
      end if
      first = self%position
      do i = 1, n
         call read_line(self, label, line)
         if (allocated(self%error)) return
      end do
      value = self%content(first:self%position - 2)
   end subroutine exchange_lines

   subroutine exchange_integer(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Label of the value, one word.
      character(len=*), intent(in) :: label
      !> Written, or replaced by the value that is read.
      integer, intent(inout) :: value
      character(len=:), allocatable :: text
      integer :: outcome

      if (associated(self%described)) then
         call self%described%put(label, value)
         return
      end if
      if (.not. self%reading) text = to_text(value)
      call self%text(label, text)
      if (.not. self%reading) return
      call read_integer(text, value, outcome)
      if (outcome /= number_ok) then
         call self%fail(''''//label//' '//printable(text)//''': a whole number is needed')
      end if
   end subroutine exchange_integer

   subroutine exchange_real(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Label of the value, one word.
      character(len=*), intent(in) :: label
      !> Written, or replaced by the value that is read.
      real(wp), intent(inout) :: value
      character(len=:), allocatable :: text

      if (associated(self%described)) then
         call self%described%put(label, value)
         return
      end if
      if (.not. self%reading) text = to_text(value, all_digits)
      call self%text(label, text)
      if (self%reading) call parse(self, text, label, value)
   end subroutine exchange_real

   !> Read or write any number of values, their count first.
   subroutine exchange_reals(self, label, values)
      class(labelled_values_type), intent(inout) :: self
      !> Label of the values, one word.
      character(len=*), intent(in) :: label
      !> Written, or replaced by the values that are read.
      real(wp), allocatable, intent(inout) :: values(:)
      integer, parameter :: values_per_line = 4
      character(len=:), allocatable :: line
      integer :: n, i, length

      if (associated(self%described)) then
         call self%described%put(label, values)
         return
      end if
      if (.not. self%reading) n = size(values)
      call self%integer(label, n)
      if (.not. self%reading) then
         do i = 1, size(values)
            call append(self%content, self%filled, to_text(values(i), all_digits) &
               & //merge(newline, ' ', mod(i, values_per_line) == 0 .or. i == size(values)))
         end do
         return
      end if
      if (allocated(self%error)) return
      ! A value takes at least two bytes.
      if (n < 0 .or. n > (len(self%content) - self%position)/2) then
         call self%fail(''''//label//''' has no '//to_text(n)//' values')
      end if
      if (allocated(self%error)) return
      values = reshape([real(wp) ::], [n], [0.0_wp])
      do i = 1, n
         if (mod(i, values_per_line) == 1) call read_line(self, label, line)
         length = index(line//' ', ' ') - 1
         call parse(self, line(:length), label, values(i))
         line = line(length + 2:)
         if ((mod(i, values_per_line) == 0 .or. i == n) .and. len(line) > 0) then
            call self%fail(''''//label//''' has a line that is too long')
         end if
         if (allocated(self%error)) return
      end do
   end subroutine exchange_reals

   !> Read or write the last line, a checksum. Nothing may follow it.
   subroutine finish(self)
      class(labelled_values_type), intent(inout) :: self
      character(len=:), allocatable :: stored_checksum
      integer :: last

      if (self%filled > largest) then
         call self%fail('would be larger than '//to_text(largest)//' bytes')
         return
      end if
      last = self%position - 1
      if (.not. self%reading) stored_checksum = checksum(self%content(:self%filled))
      call self%text('checksum', stored_checksum)
      if (.not. self%reading) return
      if (self%position <= len(self%content)) call self%fail('goes on after its checksum')
      if (stored_checksum /= checksum(self%content(:last))) then
         call self%fail('the checksum is not that of the content, which was changed')
      end if
   end subroutine finish

   !> Record an error that names the line, unless there is an error already.
   subroutine fail(self, reason)
      class(labelled_values_type), intent(inout) :: self
      !> What is wrong.
      character(len=*), intent(in) :: reason

      if (allocated(self%error)) return
      call refuse(self%error, reason)
      if (self%reading) self%error%message = 'line '//to_text(self%line)//': '//reason
   end subroutine fail

   !> Read the next line; it is empty at the end of the text and after an error.
   subroutine read_line(self, label, line)
      class(labelled_values_type), intent(inout) :: self
      !> Label of the value that is expected.
      character(len=*), intent(in) :: label
      character(len=:), allocatable, intent(out) :: line
      integer :: length

      line = ''
      if (allocated(self%error)) return
      self%line = self%line + 1
      length = index(self%content(self%position:), newline)
      if (length == 0) call self%fail('the file ends where '''//label//''' is expected')
      line = self%content(self%position:self%position + length - 2)
      self%position = self%position + length
   end subroutine read_line

   !> Read a finite number.
   subroutine parse(self, string, label, value)
      class(labelled_values_type), intent(inout) :: self
      character(len=*), intent(in) :: string, label
      real(wp), intent(out) :: value
      integer :: outcome

      call read_real(string, value, outcome)
      if (outcome /= number_ok) then
         call self%fail(''''//label//''': '''//printable(string)//''' is not a finite number')
      end if
   end subroutine parse
end module labelled_values
