!> Named values as bytes. In this form data enter and leave the core, and posteriors and chains are
!> stored in files.
!>
!> A value has a header of 48 bytes: its kind and its rank, a byte each, 2 unused bytes, 4 bytes for
!> the length of its name, 8 for the number of bytes of the value, 4 x 8 for its shape. Name and
!> value follow, each filled up to a multiple of 8 bytes. The kinds are t, a text; l,
!> texts that each end in a zero byte; i, integers of 8 bytes; b, the same as logicals; r, reals.
!> Arrays are in Fortran's order; C reads them with the axes reversed. The argument to write is
!> named `value`, `values` for an array, or `words`.
module named_values
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_loc, c_ptr
   use errors, only: error_type, refuse
   use files, only: checksum, read_bytes, replace_file
   use kinds, only: i8, wp
   use text, only: append, line_type, split_list
   implicit none
   private
   public :: named_values_type, named_values_reader_type, header_type, restore

   integer, parameter :: header_bytes = 48, most_axes = 4, unit_bytes = 8

   !> Values that are written one after the other.
   type :: named_values_type
      !> The written values are the first `filled` bytes.
      character(len=:), allocatable :: bytes
      integer(i8) :: filled = 0
   contains
      procedure, private :: put_text, put_texts, put_words, put_integer, put_logical, put_real, &
         & put_reals, put_matrix, put_matrices
      generic :: put => put_text, put_texts, put_words, put_integer, put_logical, put_real, &
         & put_reals, put_matrix, put_matrices
      procedure :: put_as, put_array, put_integers, store
   end type named_values_type

   !> Values in bytes that the caller owns, found by their names. A missing value sets `error` and
   !> is returned empty.
   type :: named_values_reader_type
      character, pointer :: bytes(:) => null()
      type(error_type), allocatable :: error
   contains
      procedure :: look_at, has, text => text_of, integer => integer_of, &
         & logical => logical_of, real => real_of, reals => reals_of, columns => columns_of, &
         & matrices => matrices_of, header => header_at
   end type named_values_reader_type

   !> What precedes a value that is in bytes, and where.
   type :: header_type
      character :: kind
      integer :: rank, name_bytes
      integer(i8) :: n_bytes, shape(most_axes)
      !> Numbers of bytes before the header, before the value, and before the next header.
      integer(i8) :: position, start, next
   contains
      procedure :: is_named, name => name_in
   end type header_type

contains

   !> Append the value of `n_bytes` bytes at an address.
   subroutine append_value(self, name, kind, axes, n_bytes, address)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      character, intent(in) :: kind
      !> Sizes of the axes of an array.
      integer, intent(in) :: axes(:)
      integer(i8), intent(in) :: n_bytes
      type(c_ptr), intent(in) :: address
      character(len=n_bytes), pointer :: content
      integer(i8) :: shape(most_axes)

      shape = 0
      shape(:size(axes)) = axes
      call add(kind//achar(size(axes))//repeat(achar(0), 2)//transfer(len(name), repeat(' ', 4)) &
         & //transfer([n_bytes, shape], repeat(' ', header_bytes - 8)))
      call add(name//repeat(achar(0), int(padded(len(name, i8)) - len(name))))
      ! An empty array may have no address.
      if (n_bytes > 0) then
         call c_f_pointer(address, content)
         call add(content)
      end if
      call add(repeat(' ', int(padded(n_bytes) - n_bytes)))

   contains

      subroutine add(piece)
         character(len=*), intent(in) :: piece

         call append(self%bytes, self%filled, piece)
      end subroutine add
   end subroutine append_value

   !> The next multiple of eight.
   pure integer(i8) function padded(n)
      integer(i8), intent(in) :: n

      padded = unit_bytes*((n + unit_bytes - 1)/unit_bytes)
   end function padded

   !> The text `value`.
   subroutine put_text(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name, value

      call self%put_as('t', name, value)
   end subroutine put_text

   !> A text of a kind that a document adds to those above, see `json`.
   subroutine put_as(self, kind, name, value)
      class(named_values_type), intent(inout) :: self
      character, intent(in) :: kind
      character(len=*), intent(in) :: name
      character(len=*), intent(in), target :: value

      call append_value(self, name, kind, [integer ::], len(value, i8), c_loc(value))
   end subroutine put_as

   !> The list of texts `value`.
   subroutine put_texts(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      type(line_type), intent(in) :: value(:)
      character(len=:), allocatable, target :: joined
      integer(i8) :: filled
      integer :: i

      joined = ''
      filled = 0
      do i = 1, size(value)
         call append(joined, filled, value(i)%text//achar(0))
      end do
      call append_value(self, name, 'l', [size(value)], filled, c_loc(joined))
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
      call append_value(self, name, 'i', shape, size(bits)*8_i8, c_loc(bits))
   end subroutine put_integers

   !> The logical `value`.
   subroutine put_logical(self, name, value)
      class(named_values_type), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(in) :: value
      integer(i8), target :: bits

      bits = merge(1_i8, 0_i8, value)
      call append_value(self, name, 'b', [integer ::], 8_i8, c_loc(bits))
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

      call append_value(self, name, 'r', shape, size(values, kind=i8)*8, c_loc(values))
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
      character(len=*), intent(in), target :: content

      call c_f_pointer(c_loc(content), self%bytes, [len(content)])
   end subroutine look_at

   !> Write the values into a file, with their checksum at its end.
   subroutine store(self, path, error)
      class(named_values_type), intent(in) :: self
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error

      associate (content => self%bytes(:self%filled))
         call replace_file(path, content//checksum(content), error)
      end associate
   end subroutine store

   !> Read the bytes of a file that `store` wrote. A file is refused that was changed, or that has
   !> other values than these: its bytes may be anybody's.
   subroutine restore(path, format, forms, remedy, content, error)
      character(len=*), intent(in) :: path
      !> Version of the format, the value 'format'.
      integer, intent(in) :: format
      !> The name of each value, in order; its kind, or n for reals that may be NaN where others
      !> must be finite; and the names of its axes; separated by commas. All axes of a name have the
      !> same size.
      character(len=*), intent(in) :: forms(:)
      !> What the user should do, for messages.
      character(len=*), intent(in) :: remedy
      !> The values without the checksum.
      character(len=:), allocatable, target, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      type(named_values_reader_type) :: values
      character(len=len(checksum(''))) :: found
      character(len=:), allocatable :: other
      integer :: n

      call read_bytes(path, content, error)
      if (allocated(error)) return
      n = max(0, len(content) - len(found))
      found = content(n + 1:)
      content = content(:n)
      call values%look_at(content)
      if (found /= checksum(content)) then
         call refuse(error, path//': is damaged, or was changed since it was written; '//remedy)
         return
      end if
      other = first_other()
      if (len(other) == 0) then
         if (values%integer('format') /= format) other = 'format'
      end if
      if (len(other) == 0) return
      call refuse(error, path//': is of an earlier version of the program, or damaged (its ''' &
         & //other//''' is another one); '//remedy)

   contains

      !> The name of the first value that has not its form; '' if all have, and no other values
      !> follow.
      function first_other() result(name)
         character(len=:), allocatable :: name, words(:)
         !> Axes that were met, and their sizes.
         character(len=len(forms)) :: axes(most_axes*size(forms))
         integer(i8) :: sizes(most_axes*size(forms)), position, left, n
         type(header_type) :: header
         real(wp), pointer :: numbers(:)
         character :: kind
         integer :: n_axes, k, i, j

         position = 0
         n_axes = 0
         do k = 1, size(forms)
            words = split_list(forms(k))
            name = trim(words(1))
            kind = words(2) (1:1)
            if (size(values%bytes) - position < header_bytes) return
            header = header_at(values, position)
            left = size(values%bytes) - header%start
            if (header%rank /= size(words) - 2 .or. left < 0) return
            if (.not. header%is_named(values, name)) return
            if (header%kind /= merge('r', kind, kind == 'n')) return
            if (header%n_bytes < 0 .or. header%n_bytes > left) return
            n = unit_bytes
            do i = 1, header%rank
               if (header%shape(i) < 0 .or. header%shape(i) > left) return
               n = min(n*header%shape(i), left + 1)
               do j = 1, n_axes
                  if (axes(j) == words(2 + i)) exit
               end do
               if (j > n_axes) then
                  n_axes = j
                  axes(j) = words(2 + i)
                  sizes(j) = header%shape(i)
               end if
               if (sizes(j) /= header%shape(i)) return
            end do
            position = header%next
            if ((kind /= 't' .and. n /= header%n_bytes) .or. position > size(values%bytes)) return
            if (header%kind /= 'r' .or. n == 0) cycle
            call c_f_pointer(c_loc(values%bytes(header%start + 1)), numbers, [n/unit_bytes])
            if (any(abs(numbers) > huge(numbers))) return
            if (kind == 'r' .and. any(numbers /= numbers)) return
         end do
         if (position == size(values%bytes)) name = ''
      end function first_other
   end subroutine restore

   !> The header at a position, from 0, where its bytes are.
   function header_at(self, position) result(header)
      class(named_values_reader_type), intent(in) :: self
      integer(i8), intent(in) :: position
      type(header_type) :: header

      associate (bytes => self%bytes(position + 1:position + header_bytes))
         header%position = position
         header%kind = bytes(1)
         header%rank = ichar(bytes(2))
         header%name_bytes = transfer(bytes(5:8), header%name_bytes)
         header%n_bytes = transfer(bytes(9:16), header%n_bytes)
         header%shape = transfer(bytes(17:), header%shape)
      end associate
      header%start = position + header_bytes + padded(int(header%name_bytes, i8))
      header%next = header%start + padded(header%n_bytes)
   end function header_at

   !> The name of the value.
   function name_in(self, values) result(name)
      class(header_type), intent(in) :: self
      class(named_values_reader_type), intent(in) :: values
      character(len=self%name_bytes) :: name

      associate (start => self%position + header_bytes)
         name = transfer(values%bytes(start + 1:start + self%name_bytes), name)
      end associate
   end function name_in

   !> Whether the value has this name.
   logical function is_named(self, values, name)
      class(header_type), intent(in) :: self
      class(named_values_reader_type), intent(in) :: values
      character(len=*), intent(in) :: name

      is_named = self%name_bytes == len(name)
      if (is_named) is_named = self%name(values) == name
   end function is_named

   !> The bytes of a named value; not associated if the name is missing or its kind is not in
   !> `kinds`.
   function find(self, name, kinds) result(content)
      class(named_values_reader_type), intent(in) :: self
      character(len=*), intent(in) :: name, kinds
      character, pointer :: content(:)
      type(header_type) :: header
      integer(i8) :: position

      content => null()
      if (.not. associated(self%bytes)) return
      position = 0
      do while (position + header_bytes <= size(self%bytes, kind=i8))
         header = header_at(self, position)
         if (header%is_named(self, name)) then
            if (index(kinds, header%kind) > 0) then
               content => self%bytes(header%start + 1:header%start + header%n_bytes)
            end if
            return
         end if
         position = header%next
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
      character, pointer :: content(:)

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
      character, pointer :: content(:)

      content => find(self, name, 'tlj')
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
      character, pointer :: content(:)

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
