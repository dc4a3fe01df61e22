!> Values in a fixed order, which one procedure both gives and takes: it names them one by one. So
!> what is written, read and described cannot differ. They are text, a line or a block each:
!>
!>     degree 4
!>     lower 2
!>     0.15 2.0
!>
!> Reading is strict: the next line has the expected label, values are finite, counts hold, and the
!> last line is a checksum of all before it. After the first error nothing more is done. To describe
!> them they are given as named values instead.
module labelled_values
   use errors, only: error_type, refuse
   use files, only: checksum, printable
   use kinds, only: i8, wp
   use named_values, only: named_values_type
   use text, only: append, newline, number_ok, read_integer, read_real, to_text
   implicit none
   private
   public :: labelled_values_type

   !> They bring a number back.
   integer, parameter :: all_digits = 17
   !> Bytes; larger files are not read (see `files`).
   integer(i8), parameter :: largest = 1000000000_i8

   type :: labelled_values_type
      !> Values are taken; else they are given.
      logical :: reading = .false.
      !> What they are given to in place of a text.
      type(named_values_type), pointer :: described => null()
      type(error_type), allocatable :: error
      !> What is read; or what was written, in its first `filled` bytes.
      character(len=:), allocatable :: content
      integer :: filled = 0
      !> Next byte to read, and the number of the line before it.
      integer, private :: position = 1, line = 0
   contains
      procedure :: text => exchange_text, lines => exchange_lines, integer => exchange_integer, &
         & real => exchange_real, reals => exchange_reals, finish, fail
   end type labelled_values_type

contains

   !> A text without line breaks.
   subroutine exchange_text(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Of the value, one word.
      character(len=*), intent(in) :: label
      !> Given or taken.
      character(len=:), allocatable, intent(inout) :: value
      character(len=:), allocatable :: line

      if (associated(self%described)) then
         call self%described%put(label, value)
      else if (self%reading) then
         call take_line(self, label, line)
         if (index(line, label//' ') /= 1) then
            call self%fail(''''//label//''' is expected, not '''//printable(line)//'''')
         end if
         value = line(len(label) + 2:)
      else
         call put(self, label//' '//value//newline)
      end if
   end subroutine exchange_text

   !> A text of any number of lines.
   subroutine exchange_lines(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Of the value, one word.
      character(len=*), intent(in) :: label
      !> Given or taken.
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
         call put(self, value//newline)
         return
      end if
      first = self%position
      do i = 1, n
         call take_line(self, label, line)
         if (allocated(self%error)) return
      end do
      value = self%content(first:self%position - 2)
   end subroutine exchange_lines

   subroutine exchange_integer(self, label, value)
      class(labelled_values_type), intent(inout) :: self
      !> Of the value, one word.
      character(len=*), intent(in) :: label
      !> Given or taken.
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
      !> Of the value, one word.
      character(len=*), intent(in) :: label
      !> Given or taken.
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

   !> Any number of values, their count first.
   subroutine exchange_reals(self, label, values)
      class(labelled_values_type), intent(inout) :: self
      !> Of the value, one word.
      character(len=*), intent(in) :: label
      !> Given or taken.
      real(wp), allocatable, intent(inout) :: values(:)
      integer, parameter :: a_line = 4
      character(len=:), allocatable :: line
      integer :: n, i, length

      if (associated(self%described)) then
         call self%described%put_array(label, values, shape(values))
         return
      end if
      if (.not. self%reading) n = size(values)
      call self%integer(label, n)
      if (.not. self%reading) then
         do i = 1, size(values)
            call put(self, to_text(values(i), all_digits) &
               & //merge(newline, ' ', mod(i, a_line) == 0 .or. i == size(values)))
         end do
         return
      end if
      if (allocated(self%error)) return
      ! A value takes two bytes at least.
      if (n < 0 .or. n > (len(self%content) - self%position)/2) then
         call self%fail(''''//label//''' has no '//to_text(n)//' values')
      end if
      if (allocated(self%error)) return
      values = reshape([real(wp) ::], [n], [0.0_wp])
      do i = 1, n
         if (mod(i, a_line) == 1) call take_line(self, label, line)
         length = index(line//' ', ' ') - 1
         call parse(self, line(:length), label, values(i))
         line = line(length + 2:)
         if ((mod(i, a_line) == 0 .or. i == n) .and. len(line) > 0) then
            call self%fail(''''//label//''' has a line that is too long')
         end if
         if (allocated(self%error)) return
      end do
   end subroutine exchange_reals

   !> The last line: a checksum, after which there is nothing.
   subroutine finish(self)
      class(labelled_values_type), intent(inout) :: self
      character(len=:), allocatable :: rest
      integer :: last

      last = self%position - 1
      if (.not. self%reading) rest = checksum(self%content(:self%filled))
      call self%text('checksum', rest)
      if (.not. self%reading) return
      if (self%position <= len(self%content)) call self%fail('goes on after its checksum')
      if (rest /= checksum(self%content(:last))) then
         call self%fail('the checksum is not that of the content, which was changed')
      end if
   end subroutine finish

   !> Record an error that names the line, unless there is one already.
   subroutine fail(self, reason)
      class(labelled_values_type), intent(inout) :: self
      !> What is wrong, in words.
      character(len=*), intent(in) :: reason

      if (allocated(self%error)) return
      call refuse(self%error, reason)
      if (self%reading) self%error%message = 'line '//to_text(self%line)//': '//reason
   end subroutine fail

   !> The next line; '' where there is none, or after an error.
   subroutine take_line(self, label, line)
      class(labelled_values_type), intent(inout) :: self
      !> Of the value in it.
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
   end subroutine take_line

   !> A finite number.
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

   !> Append to the content.
   subroutine put(self, piece)
      class(labelled_values_type), intent(inout) :: self
      character(len=*), intent(in) :: piece

      if (allocated(self%error)) return
      if (int(self%filled, i8) + len(piece) > largest) then
         call self%fail('would be larger than '//to_text(largest)//' bytes')
      else
         call append(self%content, self%filled, piece)
      end if
   end subroutine put
end module labelled_values
