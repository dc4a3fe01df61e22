!> Whole files in, whole files out, and the paths between them.
module files
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_int, c_null_char, c_ptr, c_size_t
   use errors, only: error_type, exit_bad_input, machine_failure, raise
   use kinds, only: i8
   use text, only: to_text
   implicit none
   private
   public :: read_text_file, read_bytes, read_entry, new_file_type, replace_file, make_folder, name_beside, &
      & place_new_file, remove_file
   public :: folder_of, full_path, resolve_path, file_exists, is_folder, printable

   !> How the names of files begin that are not whole yet; then come the process that writes, '-', and the name to be.
   character(len=*), parameter, public :: unfinished = '.part-'

   !> Larger files are refused, bytes: an input that big is no input of ours.
   integer, parameter :: largest = 1000000000

   integer(c_int), parameter :: read_only = 0

   interface
      integer(c_int) function c_rename(from, to) bind(c, name='rename')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: from(*), to(*)
      end function c_rename
      integer(c_int) function c_mkdir(path, mode) bind(c, name='mkdir')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: mode
      end function c_mkdir
      integer(c_int) function c_open(path, flags) bind(c, name='open')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: path(*)
         integer(c_int), value :: flags
      end function c_open
      integer(c_int) function c_fsync(descriptor) bind(c, name='fsync')
         import :: c_int
         integer(c_int), value :: descriptor
      end function c_fsync
      integer(c_size_t) function c_read(descriptor, bytes, n) bind(c, name='read')
         import :: c_char, c_int, c_size_t
         integer(c_int), value :: descriptor
         ! allow(C072)
         character(kind=c_char), intent(out) :: bytes(*)
         integer(c_size_t), value :: n
      end function c_read
      integer(c_int) function c_link(from, to) bind(c, name='link')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: from(*), to(*)
      end function c_link
      integer(c_int) function c_unlink(path) bind(c, name='unlink')
         import :: c_char, c_int
         character(kind=c_char), intent(in) :: path(*)
      end function c_unlink
      integer(c_int) function c_close(descriptor) bind(c, name='close')
         import :: c_int
         integer(c_int), value :: descriptor
      end function c_close
      type(c_ptr) function c_realpath(path, resolved) bind(c, name='realpath')
         import :: c_char, c_ptr
         character(kind=c_char), intent(in) :: path(*)
         ! allow(C072)
         character(kind=c_char), intent(out) :: resolved(*)
      end function c_realpath
      integer(c_int) function c_getpid() bind(c, name='getpid')
         import :: c_int
      end function c_getpid
   end interface

   !> A file that is written piece by piece, whole or not at all.
   type :: new_file_type
      private
      character(len=:), allocatable :: path, beside
      integer :: unit = 0, status = 0
      integer(i8) :: bytes = 0
      logical :: is_open = .false.
      character(len=256) :: reason = ''
   contains
      procedure :: begin
      procedure :: add
      procedure :: finish
   end type new_file_type

contains

   !> The text of a file or a pipe, without a UTF-8 byte order mark. The message of a refusal does not name the file.
   !> `content` is all of it.
   subroutine read_text_file(path, content, error)
      character(len=*), intent(in) :: path
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      integer :: wrong, i
      logical :: here

      inquire (file=path, exist=here)
      if (len_trim(path) == 0) then
         call raise(error, 'the name of the file is empty', exit_bad_input)
      else if (is_folder(path)) then
         call raise(error, 'is a folder; a file is needed', exit_bad_input)
      else if (.not. here) then
         call raise(error, 'the file does not exist', exit_bad_input)
      else
         call read_bytes(path, content, error)
      end if
      if (allocated(error)) return
      wrong = not_utf8(content)
      if (index(content, 'PK'//achar(3)//achar(4)) == 1) then
         call raise(error, 'the file is a spreadsheet or another zip archive (.xlsx, .ods), not text: save its sheet as CSV', &
            & exit_bad_input)
      else if (index(content, achar(0)) > 0 .or. wrong == 1) then
         call raise(error, 'the file is not plain text (save it as UTF-8)', exit_bad_input)
      else if (wrong > 0) then
         call raise(error, 'line '//to_text(1 + count([(content(i:i) == achar(10), i=1, wrong)])) &
            & //": '"//printable(content(index(content(:wrong - 1), achar(10), back=.true.) + 1:wrong - 1)) &
            & //"' is followed by what is not UTF-8 (save the file as UTF-8)", exit_bad_input)
      else
         if (index(content, char(239)//char(187)//char(191)) == 1) content = content(4:)
         if (verify(content, ' '//achar(9)//achar(10)//achar(13)) == 0) call raise(error, 'the file is empty', exit_bad_input)
      end if
   end subroutine read_text_file

   !> All that can be read of a file or a pipe, as it is.
   subroutine read_bytes(path, content, error)
      character(len=*), intent(in) :: path
      !> All of it.
      character(len=:), allocatable, intent(out) :: content
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: grown
      integer(c_int) :: descriptor, outcome
      integer :: n, got

      descriptor = c_open(path//c_null_char, read_only)
      if (descriptor < 0) then
         call raise(error, 'the file cannot be opened for reading', exit_bad_input)
         return
      end if
      allocate (character(len=65536) :: content)
      n = 0
      do
         got = int(c_read(descriptor, content(n + 1:), int(len(content) - n, c_size_t)))
         if (got <= 0) exit
         n = n + got
         if (n < len(content)) cycle
         if (n > largest) exit
         allocate (character(len=2*n) :: grown)
         grown(:n) = content
         call move_alloc(grown, content)
      end do
      outcome = c_close(descriptor)
      if (got < 0) call raise(error, 'the file cannot be read', exit_bad_input)
      if (n > largest) call raise(error, 'the file is too large; at most '//to_text(largest)//' bytes', exit_bad_input)
      content = content(:n)
   end subroutine read_bytes

   !> Place of the first byte that UTF-8 does not allow there, 0 where there is none.
   pure integer function not_utf8(string) result(i)
      character(len=*), intent(in) :: string
      integer :: first, second, more, k

      i = 1
      do while (i <= len(string))
         first = ichar(string(i:i))
         ! Bytes that must follow; below, second bytes that would make a sequence too long, a surrogate or beyond the last character.
         more = 0
         if (first >= 128) more = 1
         if (first >= 224) more = 2
         if (first >= 240) more = 3
         if ((first >= 128 .and. first < 194) .or. first > 244 .or. i + more > len(string)) return
         do k = 1, more
            second = ichar(string(i + k:i + k))
            if (second < 128 .or. second > 191) return
            if (k > 1) cycle
            if ((first == 224 .and. second < 160) .or. (first == 237 .and. second > 159)) return
            if ((first == 240 .and. second < 144) .or. (first == 244 .and. second > 143)) return
         end do
         i = i + 1 + more
      end do
      i = 0
   end function not_utf8

   !> The rest of the first line that begins with `key` in a file of the system; '' where there is none.
   subroutine read_entry(path, key, rest)
      character(len=*), intent(in) :: path, key
      character(len=:), allocatable, intent(out) :: rest
      character(len=8192) :: line
      integer :: unit, status

      rest = ''
      open (newunit=unit, file=path, action='read', status='old', iostat=status)
      if (status /= 0) return
      do
         read (unit, '(a)', iostat=status) line
         if (status /= 0) exit
         if (index(line, key) /= 1) cycle
         rest = trim(line(len(key) + 1:))
         exit
      end do
      close (unit)
   end subroutine read_entry

   !> Write a file of this `content` whole or not at all.
   subroutine replace_file(path, content, error)
      character(len=*), intent(in) :: path, content
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file

      call file%begin(path)
      call file%add(content)
      call file%finish(error)
   end subroutine replace_file

   !> Begin a file beside the one that it will replace.
   subroutine begin(self, path)
      class(new_file_type), intent(out) :: self
      character(len=*), intent(in) :: path

      self%path = path
      self%beside = name_beside(path)
      open (newunit=self%unit, file=self%beside, access='stream', form='unformatted', status='replace', action='write', &
         & iostat=self%status, iomsg=self%reason)
      self%is_open = self%status == 0
   end subroutine begin

   !> Write the `content` that comes next; after a failure nothing.
   subroutine add(self, content)
      class(new_file_type), intent(inout) :: self
      character(len=*), intent(in) :: content

      if (self%status == 0) write (self%unit, iostat=self%status, iomsg=self%reason) content
      self%bytes = self%bytes + len(content)
   end subroutine add

   !> To the disk, then in its place; after a failure, which is told now, there is no new file.
   subroutine finish(self, error)
      class(new_file_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer(c_int) :: descriptor, outcome
      integer(i8) :: bytes
      integer :: status

      if (self%status == 0) then
         close (self%unit, iostat=self%status, iomsg=self%reason)
         self%is_open = self%status /= 0
         ! The library does not tell what happens to the last of its buffers.
         inquire (file=self%beside, size=bytes)
         if (self%status == 0 .and. bytes /= self%bytes) then
            self%status = -1
            self%reason = 'the disk is full'
         end if
      end if
      if (self%status /= 0) then
         ! What the library says of a disk that is full.
         if (index(self%reason, 'No space left') > 0) self%reason = 'the disk is full'
         call raise(error, self%path//': cannot be written: '//trim(self%reason), machine_failure)
         if (self%is_open) close (self%unit, status='delete', iostat=status)
         outcome = c_unlink(self%beside//c_null_char)
         return
      end if
      descriptor = c_open(self%beside//c_null_char, read_only)
      outcome = -1_c_int
      if (descriptor >= 0) then
         outcome = c_fsync(descriptor)
         if (c_close(descriptor) /= 0) outcome = -1_c_int
      end if
      if (outcome /= 0) then
         call raise(error, self%path//': cannot be written: the disk does not take it', machine_failure)
      else if (c_rename(self%beside//c_null_char, self%path//c_null_char) /= 0) then
         call raise(error, self%path//': cannot be replaced', machine_failure)
      end if
      if (allocated(error)) outcome = c_unlink(self%beside//c_null_char)
   end subroutine finish

   !> The name by which this process writes a file until it is whole.
   function name_beside(path) result(name)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: name

      name = folder_of(path)//unfinished//to_text(int(c_getpid()))//'-'//path(index(path, '/', back=.true.) + 1:)
   end function name_beside

   !> Let the file `beside` have the name `path` if there is none of that name; else it is removed.
   subroutine place_new_file(beside, path)
      character(len=*), intent(in) :: beside, path
      integer(c_int) :: outcome

      outcome = c_link(beside//c_null_char, path//c_null_char)
      ! Not every file system has links.
      if (outcome /= 0 .and. .not. file_exists(path)) outcome = c_rename(beside//c_null_char, path//c_null_char)
      outcome = c_unlink(beside//c_null_char)
   end subroutine place_new_file

   !> Remove a file, if it is there.
   subroutine remove_file(path)
      character(len=*), intent(in) :: path
      integer(c_int) :: outcome

      outcome = c_unlink(path//c_null_char)
   end subroutine remove_file

   !> Make a folder and those above it, where they are missing.
   subroutine make_folder(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: all_may = 511
      integer(c_int) :: status
      integer :: i

      do i = 2, len(path)
         if (path(i:i) == '/') status = c_mkdir(path(:i - 1)//c_null_char, int(all_may, c_int))
      end do
      status = c_mkdir(path//c_null_char, int(all_may, c_int))
      if (.not. is_folder(path)) call raise(error, path//': the folder cannot be made', machine_failure)
   end subroutine make_folder

   !> The folder part of a path with its last slash, '' for the current folder.
   pure function folder_of(path) result(folder)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: folder

      folder = path(:index(path, '/', back=.true.))
   end function folder_of

   !> `name` as it is if absolute, else relative to `folder` (which ends in a slash, or is empty).
   pure function resolve_path(folder, name) result(path)
      character(len=*), intent(in) :: folder, name
      character(len=:), allocatable :: path

      if (index(name, '/') == 1) then
         path = name
      else
         path = folder//name
      end if
   end function resolve_path

   !> The absolute path of a file that is there, else as it is.
   function full_path(path) result(resolved)
      character(len=*), intent(in) :: path
      character(len=:), allocatable :: resolved
      character(kind=c_char, len=4097) :: buffer

      resolved = path
      if (c_associated(c_realpath(path//c_null_char, buffer))) resolved = buffer(:index(buffer, c_null_char) - 1)
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

   !> A user's text, `string`, fit for one line of a message: control characters shown as '?', long texts cut.
   pure function printable(string) result(shown)
      character(len=*), intent(in) :: string
      character(len=:), allocatable :: shown
      integer, parameter :: longest = 80
      integer :: i, last

      last = len(string)
      if (last > longest) then
         last = longest
         ! Never in the middle of a UTF-8 sequence, whose later bytes are 10xxxxxx.
         do while (last > 1 .and. iand(iachar(string(last + 1:last + 1)), 192) == 128)
            last = last - 1
         end do
      end if
      shown = string(:last)
      do i = 1, last
         if (iachar(shown(i:i)) < 32 .or. iachar(shown(i:i)) == 127) shown(i:i) = '?'
      end do
      if (last < len(string)) shown = shown//'...'
   end function printable
end module files
