!> Read and write whole files, resolve their paths, and compute the checksum that reveals a change.
module files
   use, intrinsic :: iso_c_binding, only: c_associated, c_bool, c_int, c_int64_t, &
      & c_null_char, c_ptr
   use errors, only: error_type, exit_bad_input, machine_failure, raise, refuse
   use kinds, only: i8
   use text, only: append, to_text
   implicit none
   private
   public :: make_absolute
   public :: read_text_file, read_bytes, new_file_type, replace_file, make_folder, place_new_file
   public :: name_beside, folder_of, full_path, resolve_path, file_exists, is_folder, printable
   public :: process_number, checksum, hash_of

   !> Names of unfinished files begin with this text; the number of the writing process, '-' and the
   !> final name follow.
   character(len=*), parameter, public :: unfinished = '.part-'

   !> Largest file that is read, bytes. No input of this program is so large.
   integer, parameter :: largest = 1000000000

   interface
      subroutine c_make_folder(path) bind(c, name='bayesindent_make_folder')
         import
         character, intent(in) :: path(*)
      end subroutine c_make_folder
      subroutine c_place_file(beside, path, whole) bind(c, name='bayesindent_place_file')
         import
         character, intent(in) :: beside(*), path(*)
         logical(c_bool), value :: whole
      end subroutine c_place_file
      integer(c_int) function c_read_file(path, largest, n) bind(c, name='bayesindent_read_file')
         import
         character, intent(in) :: path(*)
         integer(c_int), value :: largest
         integer(c_int), intent(out) :: n
      end function c_read_file
      subroutine c_take_bytes(bytes) bind(c, name='bayesindent_take_bytes')
         import
         ! allow(C072)
         character, intent(out) :: bytes(*)
      end subroutine c_take_bytes
      subroutine c_write_file(path, beside, bytes, n, reason, size) bind(c, &
         & name='bayesindent_write_file')
         import
         character, intent(in) :: path(*), beside(*), bytes(*)
         integer(c_int64_t), value :: n
         ! allow(C072)
         character, intent(out) :: reason(*)
         integer(c_int), value :: size
      end subroutine c_write_file
      !> The number of this process.
      integer(c_int) function process_number() bind(c, name='getpid')
         import
      end function process_number
      type(c_ptr) function c_realpath(path, resolved) bind(c, name='realpath')
         import
         character, intent(in) :: path(*)
         ! allow(C072)
         character, intent(out) :: resolved(*)
      end function c_realpath
   end interface

   !> A file whose content is made piece by piece, before it is written.
   type :: new_file_type
      private
      character(len=:), allocatable :: content
      integer(i8) :: filled = 0
   contains
      procedure :: add, finish
   end type new_file_type

contains

   !> Read the `content` of a text file, without a UTF-8 byte order mark. The message of a refusal
   !> does not name the file.
   subroutine read_text_file(path, content, error, comment)
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      !> Sign that begins a comment. A comment that is not UTF-8 is replaced by blanks.
      character, intent(in), optional :: comment
      integer :: invalid_byte, line_start, line_end, first, i

      if (len_trim(path) == 0) then
         call refuse(error, 'the name of the file is empty')
      else if (is_folder(path)) then
         call refuse(error, 'is a folder; a file is needed')
      else if (.not. file_exists(path)) then
         call refuse(error, 'the file does not exist')
      else
         call read_bytes(path, content, error)
      end if
      if (allocated(error)) return
      invalid_byte = not_utf8(content)
      if (present(comment)) then
         ! Blank the comment of each invalid byte, from its sign to the end of the line.
         do while (invalid_byte > 0)
            line_end = invalid_byte + index(content(invalid_byte:)//achar(10), achar(10)) - 2
            line_start = index(content(:invalid_byte), achar(10), back=.true.) + 1
            first = line_start + index(content(line_start:invalid_byte), comment) - 1
            if (first < line_start) exit
            ! A sign after an odd number of quotes is part of a text.
            if (mod(count([(scan(content(i:i), '''"') > 0, i=line_start, first)]), 2) > 0) exit
            content(first:line_end) = ''
            invalid_byte = not_utf8(content)
         end do
      end if
      if (index(content, 'PK'//achar(3)//achar(4)) == 1) then
         call refuse(error, 'the file is a spreadsheet or another zip archive (.xlsx, .ods), not ' &
            & //'text: save its sheet as CSV')
      else if (index(content, achar(0)) > 0 .or. invalid_byte == 1) then
         ! Such as UTF-16, with zero bytes or a byte order mark that is not UTF-8.
         call refuse(error, 'the file is not plain text (save it as UTF-8)')
      else if (invalid_byte > 0) then
         line_start = index(content(:invalid_byte), achar(10), back=.true.) + 1
         call refuse(error, 'line ' &
            & //to_text(1 + count([(content(i:i) == achar(10), i=1, line_start - 1)]))//': byte ' &
            & //to_text(invalid_byte - line_start + 1)//' is not UTF-8 (save the file as UTF-8)')
      else
         if (index(content, char(239)//char(187)//char(191)) == 1) content = content(4:)
         if (verify(content, ' '//achar(9)//achar(10)//achar(13)) == 0) then
            call refuse(error, 'the file is empty')
         end if
      end if
   end subroutine read_text_file

   !> Read the bytes of a file unchanged.
   subroutine read_bytes(path, content, error)
      character(len=*), intent(in) :: path
      !> All bytes.
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      integer(c_int) :: outcome, n

      outcome = c_read_file(path//c_null_char, largest, n)
      allocate (character(len=n) :: content)
      call c_take_bytes(content)
      if (outcome == 1) call refuse(error, 'the file cannot be opened for reading')
      if (outcome == 2) call refuse(error, 'the file cannot be read')
      if (outcome == 3) call refuse(error, 'a device or a pipe is no file')
      if (n > largest) then
         call refuse(error, 'the file is too large; at most '//to_text(largest)//' bytes')
      end if
   end subroutine read_bytes

   !> Position of the first byte that is not valid UTF-8; 0 if all are valid.
   pure integer function not_utf8(string) result(i)
      character(len=*), intent(in) :: string
      integer :: first, second, following, k

      i = 1
      do while (i <= len(string))
         first = ichar(string(i:i))
         ! Number of the bytes that must follow.
         following = count(first >= [128, 224, 240])
         if ((first >= 128 .and. first < 194) .or. first > 244) return
         if (i + following > len(string)) return
         do k = 1, following
            second = ichar(string(i + k:i + k))
            if (second < 128 .or. second > 191) return
            if (k > 1) cycle
            ! A sequence longer than needed, a surrogate, or a code beyond the last character.
            if ((first == 224 .and. second < 160) .or. (first == 237 .and. second > 159)) return
            if ((first == 240 .and. second < 144) .or. (first == 244 .and. second > 143)) return
         end do
         i = i + 1 + following
      end do
      i = 0
   end function not_utf8

   !> Write a file with this `content`, completely or not at all.
   subroutine replace_file(path, content, error)
      character(len=*), intent(in) :: path, content
      type(error_type), allocatable, intent(out) :: error
      character(len=256) :: reason

      call c_write_file(path//c_null_char, name_beside(path)//c_null_char, content, &
         & len(content, i8), reason, len(reason))
      ! The reason is empty if the file was written.
      associate (n => index(reason, c_null_char) - 1)
         if (n > 0) then
            call raise(error, path//': cannot be written: '//reason(:n), machine_failure)
         end if
      end associate
   end subroutine replace_file

   !> Append `content`.
   subroutine add(self, content)
      class(new_file_type), intent(inout) :: self
      character(len=*), intent(in) :: content

      call append(self%content, self%filled, content)
   end subroutine add

   !> Write the content into the file of this path, and remove it.
   subroutine finish(self, path, error)
      class(new_file_type), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error

      call replace_file(path, self%content(:self%filled), error)
      self%filled = 0
   end subroutine finish

   !> The name under which this process writes a file until it is complete.
   function name_beside(path) result(name)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: name

      name = folder_of(path)//unfinished//to_text(process_number())//'-' &
         & //path(index(path, '/', back=.true.) + 1:)
   end function name_beside

   !> Rename the file at `name_beside` to `path` if it is complete and `path` does not exist; remove
   !> it otherwise.
   subroutine place_new_file(path, whole)
      character(len=*), intent(in) :: path
      !> Whether all of it was written.
      logical, intent(in) :: whole

      call c_place_file(name_beside(path)//c_null_char, path//c_null_char, logical(whole, c_bool))
   end subroutine place_new_file

   !> Make a folder and its parents, if they are missing.
   subroutine make_folder(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error

      call c_make_folder(path//c_null_char)
      if (.not. is_folder(path)) then
         call raise(error, path//': the folder cannot be made; a file ' &
            & //'may have this name, or permission or space be missing', &
            & merge(exit_bad_input, machine_failure, file_exists(path)))
      end if
   end subroutine make_folder

   !> The folder of a path with its last slash; empty for the current folder.
   pure function folder_of(path) result(folder)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: folder

      folder = path(:index(path, '/', back=.true.))
   end function folder_of

   !> `name` unchanged if it is absolute, else relative to `folder`, which ends in a slash or is
   !> empty.
   pure function resolve_path(folder, name) result(path)
      character(len=*), intent(in) :: folder, name
      character(len=:), allocatable :: path

      path = name
      if (index(name, '/') /= 1) path = folder//name
   end function resolve_path

   !> The absolute path of an existing file; the path unchanged if there is no file.
   function full_path(path) result(resolved)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: resolved
      !> The longest path of Linux has 4096 bytes, with the zero at its end.
      character(len=4097) :: buffer

      resolved = path
      if (c_associated(c_realpath(path//c_null_char, buffer))) then
         resolved = buffer(:index(buffer, c_null_char) - 1)
      end if
   end function full_path

   logical function file_exists(path)
      character(len=*), intent(in) :: path

      inquire (file=path, exist=file_exists)
      if (file_exists) file_exists = .not. is_folder(path)
   end function file_exists

   logical function is_folder(path)
      character(len=*), intent(in) :: path

      inquire (file=path//'/.', exist=is_folder)
   end function is_folder

   !> The user's text `string` for a message of one line: control characters become '?', and a long
   !> text is cut.
   pure function printable(string) result(shown)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: shown
      integer, parameter :: longest = 80
      integer :: i, last, code

      last = len(string)
      if (last > longest) then
         last = longest
         ! Do not cut a UTF-8 sequence, whose later bytes are 10xxxxxx.
         do while (last > 1 .and. iand(iachar(string(last + 1:last + 1)), 192) == 128)
            last = last - 1
         end do
      end if
      shown = string(:last)
      do i = 1, last
         code = iachar(shown(i:i))
         if (code < 32 .or. code == 127) shown(i:i) = '?'
         ! The control characters from 128 to 159 are the byte 194 and this one.
         if (code >= 128 .and. code < 160 .and. index(shown(:i), char(194), .true.) == i - 1) then
            shown(max(1, i - 1):i) = '??'
         end if
      end do
      if (last < len(string)) shown = shown//'...'
   end function printable

   !> The 64-bit hash FNV-1a of Fowler, Noll and Vo, in hexadecimal digits.
   pure character(len=16) function checksum(bytes) result(digits)
      !> Any number of bytes.
      character(len=*), intent(in) :: bytes

      write (digits, '(z16.16)') hash_of(bytes)
   end function checksum

   !> The hash FNV-1a as a number; its products wrap around.
   pure integer(i8) function hash_of(bytes) result(hash)
      !> Any number of bytes.
      character(len=*), intent(in) :: bytes
      integer(i8), parameter :: prime = 1099511628211_i8, basis = -3750763034362895579_i8
      integer :: i

      hash = basis
      do i = 1, len(bytes)
         hash = ieor(hash, int(iachar(bytes(i:i)), i8))*prime
      end do
   end function hash_of

   !> Make the name of a file in a folder absolute, if there is such a file.
   subroutine make_absolute(folder, name)
      character(len=*), intent(in) :: folder
      character(len=:), allocatable, intent(inout) :: name

      if (file_exists(resolve_path(folder, name))) name = full_path(resolve_path(folder, name))
   end subroutine make_absolute
end module files
