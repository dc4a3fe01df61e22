!> Named values as bytes. In this form data enter and leave the core, and chains are stored.
!>
!> A value has a header of 48 bytes: its kind and its rank, a byte each, 2 unused bytes, 4 bytes for
!> the length of its name, 8 for the number of bytes of the value, 4 x 8 for its shape. Name and
!> value follow, each filled up with zeros to a multiple of 8 bytes. The kinds are t, a text; l,
!> texts that each end in a zero byte; i, integers of 8 bytes; b, the same as logicals; r, reals.
!> Arrays are in Fortran's order; C reads them with the axes reversed. The argument to write is
!> named `value`, `values` for an array, or `words`.
module named_values
   use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_loc, c_ptr
   use errors, only: error_type, refuse
   use kinds, only: i8, wp
   use text, only: line_type
   implicit none
   private
   public :: named_values_type, named_values_reader_type

   integer, parameter :: header_bytes = 48, most_axes = 4, unit_bytes = 8

   !> Values that are written one after the other.
   type :: named_values_type
      !> The written values are the first `filled` bytes.
      character(kind=c_char, len=:), allocatable :: bytes
      integer(i8) :: filled = 0
   contains
      procedure, private :: put_text, put_texts, put_words, put_integer, put_logical, put_real, &
         & put_reals, put_matrix, put_matrices
      generic :: put => put_text, put_texts, put_words, put_integer, put_logical, put_real, &
         & put_reals, put_matrix, put_matrices
      procedure :: put_array, put_integers
   end type named_values_type

   !> Values in bytes that the caller owns, found by their names. A missing value sets `error` and
   !> is returned empty.
   type :: named_values_reader_type
      character(kind=c_char), pointer :: bytes(:) => null()
      type(error_type), allocatable :: error
   contains
      procedure :: look_at, is_whole, has, text => text_of, integer => integer_of, &
         & logical => logical_of, real => real_of, reals => reals_of, columns => columns_of, &
         & matrices => matrices_of
   end type named_values_reader_type

contains

   !> Append the value of `n_bytes` bytes at an address.
   subroutine append(self, name, kind, axes, n_bytes, address)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      character, intent(in) :: kind
      !> Sizes of the axes of an array.
      integer, intent(in) :: axes(:)
      integer(i8), intent(in) :: n_bytes
      type(c_ptr), intent(in) :: address
      character(kind=c_char, len=:), allocatable :: larger
      character(kind=c_char), pointer :: content(:)
      integer(i8) :: shape(most_axes), start, i

      start = self%filled + header_bytes + padded(len(name, i8))
      if (.not. allocated(self%bytes)) allocate (character(len=4096) :: self%bytes)
      if (start + padded(n_bytes) > len(self%bytes, i8)) then
         allocate (character(len=start + padded(n_bytes) + len(self%bytes, i8)) :: larger)
         larger(:self%filled) = self%bytes(:self%filled)
         call move_alloc(larger, self%bytes)
      end if
      shape = 0
      shape(:size(axes)) = axes
      self%bytes(self%filled + 1:self%filled + header_bytes) = kind//achar(size(axes)) &
         & //repeat(achar(0), 2)//transfer(len(name), repeat(' ', 4)) &
         & //transfer([n_bytes, shape], repeat(' ', header_bytes - 8))
      self%bytes(self%filled + header_bytes + 1:start) = name &
         & //repeat(achar(0), int(padded(len(name, i8)) - len(name)))
      self%bytes(start + 1:start + padded(n_bytes)) = ''
      call c_f_pointer(address, content, [n_bytes])
      do i = 1, n_bytes
         self%bytes(start + i:start + i) = content(i)
      end do
      self%filled = start + padded(n_bytes)
   end subroutine append

   !> The next multiple of eight.
   pure integer(i8) function padded(n)
      integer(i8), intent(in) :: n

      padded = unit_bytes*((n + unit_bytes - 1)/unit_bytes)
   end function padded

   !> The text `value`.
   subroutine put_text(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(len=*), intent(in), target :: value

      call append(self, name, 't', [integer ::], len(value, i8), c_loc(value))
   end subroutine put_text

   !> The list of texts `value`.
   subroutine put_texts(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      type(line_type), intent(in) :: value(:)
      character(len=:), allocatable, target :: joined
      integer :: i, position

      allocate (character(len=sum([(len(value(i)%text) + 1, i=1, size(value))])) :: joined)
      position = 0
      do i = 1, size(value)
         joined(position + 1:position + len(value(i)%text) + 1) = value(i)%text//achar(0)
         position = position + len(value(i)%text) + 1
      end do
      call append(self, name, 'l', [size(value)], len(joined, i8), c_loc(joined))
   end subroutine put_texts

   !> A list of texts, each without the blanks at its end.
   subroutine put_words(self, name, words)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name, words(:)
      type(line_type) :: list(size(words))
      integer :: i

      do i = 1, size(words)
         list(i)%text = trim(words(i))
      end do
      call self%put(name, list)
   end subroutine put_words

   subroutine put_integer(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: value

      call self%put_integers(name, [value], [integer ::])
   end subroutine put_integer

   !> The integers `values` of an array of any shape.
   subroutine put_integers(self, name, values, shape)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: shape(:), values(product(shape))
      integer(i8), target :: bits(size(values))

      bits = values
      call append(self, name, 'i', shape, size(bits)*8_i8, c_loc(bits))
   end subroutine put_integers

   !> The logical `value`.
   subroutine put_logical(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(in) :: value
      integer(i8), target :: bits

      bits = merge(1_i8, 0_i8, value)
      call append(self, name, 'b', [integer ::], 8_i8, c_loc(bits))
   end subroutine put_logical

   !> The real `value`.
   subroutine put_real(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: value

      call self%put_array(name, [value], [integer ::])
   end subroutine put_real

   !> The reals `values` of an array of any shape.
   subroutine put_array(self, name, values, shape)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: shape(:)
      real(wp), intent(in), target :: values(product(shape))

      call append(self, name, 'r', shape, size(values, kind=i8)*8, c_loc(values))
   end subroutine put_array

   subroutine put_reals(self, name, values)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: values(:)

      call self%put_array(name, values, shape(values))
   end subroutine put_reals

   subroutine put_matrix(self, name, values)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: values(:, :)

      call self%put_array(name, values, shape(values))
   end subroutine put_matrix

   subroutine put_matrices(self, name, values)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: values(:, :, :)

      call self%put_array(name, values, shape(values))
   end subroutine put_matrices

   !> Read from the bytes of `content`, which must stay where it is.
   subroutine look_at(self, content)
      class(named_values_reader_type), intent(inout) :: self
      character(kind=c_char, len=*), intent(in), target :: content

      call c_f_pointer(c_loc(content), self%bytes, [len(content)])
   end subroutine look_at

   !> Whether the bytes are named values to their end, of known kinds, with shapes that fit their
   !> lengths. Bytes of a file may be anybody's.
   logical function is_whole(self)
      class(named_values_reader_type), intent(in) :: self
      integer(i8) :: position, n_bytes, n, shape(most_axes)
      integer :: length, rank, i

      is_whole = .false.
      position = 0
      do while (position < size(self%bytes, kind=i8))
         n = size(self%bytes, kind=i8) - position - header_bytes
         if (n < 0) return
         rank = ichar(self%bytes(position + 2))
         length = transfer(self%bytes(position + 5:position + 8), length)
         n_bytes = transfer(self%bytes(position + 9:position + 16), n_bytes)
         shape = transfer(self%bytes(position + 17:position + header_bytes), shape)
         if (scan(self%bytes(position + 1), 'tlibr') == 0 .or. rank > most_axes) return
         if (length < 1 .or. length > n .or. n_bytes < 0 .or. n_bytes > n) return
         if (padded(int(length, i8)) + padded(n_bytes) > n) return
         if (self%bytes(position + 1) == 'r' .or. self%bytes(position + 1) == 'i') then
            n = unit_bytes
            do i = 1, rank
               if (shape(i) < 0 .or. shape(i) > n_bytes) return
               n = min(n*shape(i), n_bytes + 1)
            end do
            if (n /= n_bytes) return
         end if
         position = position + header_bytes + padded(int(length, i8)) + padded(n_bytes)
      end do
      is_whole = .true.
   end function is_whole

   !> The bytes of a named value; not associated if the name is missing or its kind is not in
   !> `kinds`.
   function find(self, name, kinds) result(content)
      class(named_values_reader_type), intent(in) :: self
      character(len=*), intent(in) :: name, kinds
      character(kind=c_char), pointer :: content(:)
      integer(i8) :: position, start, n_bytes
      integer :: length, i

      content => null()
      if (.not. associated(self%bytes)) return
      position = 0
      do while (position + header_bytes <= size(self%bytes, kind=i8))
         length = transfer(self%bytes(position + 5:position + 8), length)
         n_bytes = transfer(self%bytes(position + 9:position + 16), n_bytes)
         start = position + header_bytes + padded(int(length, i8))
         if (length == len(name)) then
            if (all([(self%bytes(position + header_bytes + i) == name(i:i), i=1, length)])) then
               if (index(kinds, self%bytes(position + 1)) > 0) then
                  content => self%bytes(start + 1:start + n_bytes)
               end if
               return
            end if
         end if
         position = start + padded(n_bytes)
      end do
   end function find

   logical function has(self, name)
      class(named_values_reader_type), intent(in) :: self
      character(len=*), intent(in) :: name

      has = associated(find(self, name, 'tlibr'))
   end function has

   integer function integer_of(self, name) result(value)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(kind=c_char), pointer :: content(:)

      content => find(self, name, 'ib')
      value = 0
      if (associated(content)) then
         value = int(transfer(content, 0_i8))
      else
         call refuse(self%error, 'the integer '''//name//''' is missing')
      end if
   end function integer_of

   logical function logical_of(self, name) result(value)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name

      value = self%integer(name) /= 0
   end function logical_of

   real(wp) function real_of(self, name) result(value)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), pointer :: values(:)

      values => self%reals(name)
      value = 0.0_wp
      if (size(values) > 0) value = values(1)
   end function real_of

   function text_of(self, name) result(value)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: value
      character(kind=c_char), pointer :: content(:)

      content => find(self, name, 't')
      value = ''
      if (associated(content)) then
         value = transfer(content, repeat(' ', size(content)))
      else
         call refuse(self%error, 'the text '''//name//''' is missing')
      end if
   end function text_of

   !> The reals of an array of any shape, in Fortran's order, without a copy.
   function reals_of(self, name) result(values)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), pointer :: values(:)
      character(kind=c_char), pointer :: content(:)

      content => find(self, name, 'r')
      if (associated(content)) then
         call c_f_pointer(c_loc(content), values, [size(content)/8])
      else
         call refuse(self%error, 'the numbers '''//name//''' are missing')
         allocate (values(0))
      end if
   end function reals_of

   !> The reals as columns of length n.
   function columns_of(self, name, n) result(columns)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(in) :: n
      real(wp), pointer :: values(:), columns(:, :)

      values => self%reals(name)
      columns(1:n, 1:size(values)/n) => values
   end function columns_of

   !> The reals as matrices (6, 6, n).
   function matrices_of(self, name) result(matrices)
      class(named_values_reader_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(wp), pointer :: values(:), matrices(:, :, :)

      values => self%reals(name)
      matrices(1:6, 1:6, 1:size(values)/36) => values
   end function matrices_of
end module named_values
