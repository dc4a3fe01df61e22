!> Documents in JavaScript Object Notation (RFC 8259), written from front to back.
!>
!>     call document%begin_object('')
!>     call document%put('mean', 168.4_wp)
!>     call document%begin_array('rows')
!>     call document%put('', [1.0_wp, 2.0_wp])
!>     call document%end_array()
!>     call document%end_object()
!>
!> The key is empty for the outermost value and within arrays. A number that is not finite becomes
!> null. Other numbers are written with all digits, so that reading them restores every bit.
module json
   use kinds, only: i8, wp
   use named_values, only: header_type, named_values_reader_type, named_values_type
   use text, only: append, newline, number_text, split_list, to_text
   implicit none
   private
   public :: json_type, quoted

   integer, parameter :: deepest = 32

   !> The values of the document by their keys, and of four more kinds: { and [ open an object or an
   !> array, } closes either, and j is JSON already.
   type, extends(named_values_type) :: json_type
   contains
      procedure :: begin_object, end_object => close_level, begin_array, &
         & end_array => close_level, put_numbers, put_json, text => document_text
   end type json_type

contains

   !> Open an object; `key` is its name in the surrounding object, '' if there is none.
   subroutine begin_object(self, key)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key

      call self%put_as('{', key, '')
   end subroutine begin_object

   !> Open an array; `key` as of `begin_object`.
   subroutine begin_array(self, key)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key

      call self%put_as('[', key, '')
   end subroutine begin_array

   !> Write one of the numbers `values` for each name, into the open object or into a new one under
   !> `key`.
   subroutine put_numbers(self, names, values, key)
      class(json_type), intent(inout) :: self
      !> Separated by ', '; one value for each name.
      character(len=*), intent(in) :: names
      real(wp), intent(in) :: values(:)
      character(len=*), intent(in), optional :: key
      character(len=:), allocatable :: each(:)
      integer :: i

      each = split_list(names)
      if (present(key)) call self%begin_object(key)
      do i = 1, size(values)
         call self%put(trim(each(i)), values(i))
      end do
      if (present(key)) call self%end_object()
   end subroutine put_numbers

   !> Write `value`, which is JSON already, under `key`.
   subroutine put_json(self, key, value)
      class(json_type), intent(inout) :: self
      character(len=*), intent(in) :: key, value

      call self%put_as('j', key, value)
   end subroutine put_json

   !> Close the innermost object or array.
   subroutine close_level(self)
      class(json_type), intent(inout) :: self

      call self%put_as('}', '', '')
   end subroutine close_level

   !> The document, with a newline at its end.
   function document_text(self) result(text)
      class(json_type), intent(in), target :: self
      character(len=:), allocatable :: text, page, key, lines
      type(named_values_reader_type) :: values
      type(header_type) :: header
      real(wp), pointer :: reals(:)
      !> The brackets that close the open levels.
      character(len=deepest) :: brackets
      !> Whether the innermost level has a value.
      logical :: begun
      integer(i8) :: filled
      integer :: depth, n, i

      text = ''
      if (self%filled == 0) return
      call values%look_at(self%bytes(:self%filled))
      filled = 0
      depth = 0
      begun = .false.
      do while (size(values%bytes) > 0)
         header = values%header(0_i8)
         key = header%name(values)
         if (header%kind /= '}') call begin_value(key)
         select case (header%kind)
         case ('{', '[')
            call open(header%kind)
         case ('}')
            call close()
         case ('j')
            call add(values%text(key))
         case ('t')
            call add(quoted(values%text(key)))
         case ('l')
            lines = values%text(key)
            call open('[')
            do while (len(lines) > 0)
               n = index(lines, achar(0))
               call begin_value('')
               call add(quoted(lines(:n - 1)))
               lines = lines(n + 1:)
            end do
            call close()
         case ('i')
            call add(to_text(values%integer(key)))
         case ('b')
            call add(trim(merge('true ', 'false', values%logical(key))))
         case default
            reals => values%reals(key)
            n = int(header%shape(1))
            if (header%rank == 0) then
               call add(number(reals(1)))
            else if (header%rank == 1) then
               call add_numbers(reals)
            else
               ! The rows of a matrix.
               call open('[')
               do i = 1, n
                  call begin_value('')
                  call add_numbers(reals(i::n))
               end do
               call close()
            end if
         end select
         values%bytes => values%bytes(header%next + 1:)
      end do
      text = page(:filled)//newline

   contains

      subroutine add(piece)
         character(len=*), intent(in) :: piece

         call append(page, filled, piece)
      end subroutine add

      !> Write the comma, the line break and the key that precede a value.
      subroutine begin_value(key)
         character(len=*), intent(in) :: key

         if (begun) call add(',')
         if (depth > 0) call add(newline//repeat(' ', depth))
         begun = .true.
         if (len(key) > 0) call add(quoted(key)//': ')
      end subroutine begin_value

      subroutine open(bracket)
         character, intent(in) :: bracket

         call add(bracket)
         depth = depth + 1
         brackets(depth:depth) = merge('}', ']', bracket == '{')
         begun = .false.
      end subroutine open

      subroutine close()
         depth = depth - 1
         if (begun) call add(newline//repeat(' ', depth))
         call add(brackets(depth + 1:depth + 1))
         begun = .true.
      end subroutine close

      subroutine add_numbers(numbers)
         real(wp), intent(in) :: numbers(:)
         integer :: k

         call add('[')
         do k = 1, size(numbers)
            if (k > 1) call add(', ')
            call add(number(numbers(k)))
         end do
         call add(']')
      end subroutine add_numbers
   end function document_text

   pure function number(value) result(string)
      real(wp), intent(in) :: value
      character(len=:), allocatable :: string

      string = 'null'
      if (abs(value) <= huge(value)) string = number_text(value)
   end function number

   !> The text `string` as a JSON literal.
   pure function quoted(string) result(literal)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: literal
      character(len=6) :: escape
      integer :: i

      literal = '"'
      do i = 1, len(string)
         select case (iachar(string(i:i)))
         case (iachar('"'), iachar('\'))
            literal = literal//'\'//string(i:i)
         case (10)
            literal = literal//'\n'
         case (0:9, 11:31)
            write (escape, '(a,z4.4)') '\u', iachar(string(i:i))
            literal = literal//escape
         case default
            literal = literal//string(i:i)
         end select
      end do
      literal = literal//'"'
   end function quoted
end module json
