!> The file of a campaign: its layout, and whether what is there is one.
!>
!> Database files are read and written through libsqlite3. What the machine could not do (a lock, the disk) is an error of its own kind. One
!> thread at a time may use a database. A statement that gave a row keeps the file locked until `reset`.
module campaign_file
   use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_intptr_t, c_null_char, &
      & c_null_ptr, c_ptr, c_size_t
   use errors, only: error_type, exit_bad_input, machine_failure, raise, refuse
   use files, only: file_exists, folder_of, make_folder, name_beside, place_new_file, replace_file
   use kinds, only: wp
   use text, only: newline
   implicit none
   private
   public :: open_campaign_file, begin_transaction, end_transaction, raise_damaged, database_type, statement_type

   !> Result codes of the library that are not errors, and those for which the machine is to blame: permission, busy, locked, memory,
   !> read-only, interrupt, input and output, full, cannot open.
   integer, parameter :: ok = 0, row_code = 100, done_code = 101, of_the_machine(9) = [3, 5, 6, 7, 8, 9, 10, 13, 14]
   integer, parameter :: read_only = 8, full = 13
   !> SQLITE_TRANSIENT in place of a destructor: the library copies a text at once.
   integer(c_intptr_t), parameter :: transient = -1_c_intptr_t
   !> How long to wait for another process, ms.
   character(len=*), parameter :: be_patient = 'PRAGMA busy_timeout = 60000'

   type :: database_type
      private
      type(c_ptr) :: handle = c_null_ptr
      !> Of the campaign, for messages.
      character(len=:), allocatable :: path
   contains
      procedure :: open => open_database, close => close_database, run, value, prepare
      procedure, private :: fail
   end type database_type

   type :: statement_type
      private
      type(c_ptr) :: handle = c_null_ptr
      type(database_type) :: database
      integer(c_int) :: bound = 0
   contains
      procedure, private :: bind_text, bind_real
      !> Columns that are integers take texts of them.
      generic :: bind => bind_text, bind_real
      procedure :: step, real => column_real, text => column_text, reset, finish
   end type statement_type

   abstract interface
      integer(c_int) function code_of(handle) bind(c)
         import :: c_int, c_ptr
         !> Of a database or a statement.
         type(c_ptr), value :: handle
      end function code_of
   end interface
   procedure(code_of), bind(c, name='sqlite3_close_v2') :: c_close
   procedure(code_of), bind(c, name='sqlite3_step') :: c_step
   procedure(code_of), bind(c, name='sqlite3_reset') :: c_reset
   procedure(code_of), bind(c, name='sqlite3_clear_bindings') :: c_clear_bindings
   procedure(code_of), bind(c, name='sqlite3_finalize') :: c_finalize

   interface
      integer(c_int) function c_open(path, handle) bind(c, name='sqlite3_open')
         import :: c_char, c_int, c_ptr
         character(kind=c_char), intent(in) :: path(*)
         type(c_ptr), intent(out) :: handle
      end function c_open
      type(c_ptr) function c_message(handle) bind(c, name='sqlite3_errmsg')
         import :: c_ptr
         type(c_ptr), value :: handle
      end function c_message
      integer(c_int) function c_exec(handle, sql, callback, argument, message) bind(c, name='sqlite3_exec')
         import :: c_char, c_int, c_ptr
         type(c_ptr), value :: handle, callback, argument, message
         character(kind=c_char), intent(in) :: sql(*)
      end function c_exec
      integer(c_int) function c_prepare(handle, sql, bytes, statement, rest) bind(c, name='sqlite3_prepare_v2')
         import :: c_char, c_int, c_ptr
         type(c_ptr), value :: handle, rest
         character(kind=c_char), intent(in) :: sql(*)
         integer(c_int), value :: bytes
         type(c_ptr), intent(out) :: statement
      end function c_prepare
      integer(c_int) function c_bind_text(statement, i, text, bytes, destructor) bind(c, name='sqlite3_bind_text')
         import :: c_char, c_int, c_intptr_t, c_ptr
         type(c_ptr), value :: statement
         character(kind=c_char), intent(in) :: text(*)
         integer(c_int), value :: i, bytes
         integer(c_intptr_t), value :: destructor
      end function c_bind_text
      integer(c_int) function c_bind_double(statement, i, number) bind(c, name='sqlite3_bind_double')
         import :: c_double, c_int, c_ptr
         type(c_ptr), value :: statement
         integer(c_int), value :: i
         real(c_double), value :: number
      end function c_bind_double
      real(c_double) function c_column_double(statement, i) bind(c, name='sqlite3_column_double')
         import :: c_double, c_int, c_ptr
         type(c_ptr), value :: statement
         integer(c_int), value :: i
      end function c_column_double
      type(c_ptr) function c_column_text(statement, i) bind(c, name='sqlite3_column_text')
         import :: c_int, c_ptr
         type(c_ptr), value :: statement
         integer(c_int), value :: i
      end function c_column_text
      integer(c_size_t) function c_length(text) bind(c, name='strlen')
         import :: c_ptr, c_size_t
         type(c_ptr), value :: text
      end function c_length
   end interface

   !> Marks the file as ours ('bayi'), and the version of its layout.
   character(len=*), parameter :: application_id = '1650555241', layout_version = '2'
   !> From here to `end_transaction` all changes are kept, or none.
   character(len=*), parameter :: begin_transaction = 'BEGIN IMMEDIATE'
   !> What version 2 has more than version 1, whose rows stay without a checksum.
   character(len=*), parameter :: from_version_1 = 'ALTER TABLE simulation ADD COLUMN checksum TEXT; PRAGMA user_version = 2'

   character(len=*), parameter :: layout = &
      & 'CREATE TABLE physics ('//newline// &
      & '    id INTEGER PRIMARY KEY,'//newline// &
      & '    identity TEXT NOT NULL UNIQUE           -- JSON, keys sorted'//newline// &
      & ');'//newline// &
      & 'CREATE TABLE simulation ('//newline// &
      & '    id INTEGER PRIMARY KEY,'//newline// &
      & '    physics_id INTEGER NOT NULL REFERENCES physics(id),'//newline// &
      & '    position INTEGER NOT NULL,              -- order of choice within the physics, from 0'//newline// &
      & '    symmetry TEXT NOT NULL,'//newline// &
      & '    constants TEXT NOT NULL,                -- JSON list, GPa, in the package''s order'//newline// &
      & '    euler_deg TEXT NOT NULL,                -- JSON list, Bunge-Euler angles'//newline// &
      & '    origin TEXT NOT NULL CHECK (origin IN (''simulated'', ''told'')),'//newline// &
      & '    status TEXT NOT NULL CHECK (status IN (''done'', ''failed'')),'//newline// &
      & '    message TEXT NOT NULL,                  -- why it failed'//newline// &
      & '    indentation_modulus_gpa REAL,'//newline// &
      & '    elements INTEGER,'//newline// &
      & '    seconds REAL,'//newline// &
      & '    depth_um TEXT,                          -- JSON list'//newline// &
      & '    force_mn TEXT,                          -- JSON list'//newline// &
      & '    created TEXT NOT NULL,                  -- UTC'//newline// &
      & '    checksum TEXT,                          -- of all before but id, position, created'//newline// &
      & '    UNIQUE (physics_id, symmetry, constants, euler_deg)'//newline// &
      & ');'//newline// &
      & 'CREATE INDEX simulation_by_position ON simulation (physics_id, position);'//newline// &
      & 'CREATE TRIGGER simulation_is_not_changed BEFORE UPDATE ON simulation'//newline// &
      & '    BEGIN SELECT RAISE(ABORT, ''a stored simulation is never changed''); END;'//newline// &
      & 'CREATE TRIGGER simulation_is_not_deleted BEFORE DELETE ON simulation'//newline// &
      & '    BEGIN SELECT RAISE(ABORT, ''a stored simulation is never deleted''); END;'//newline// &
      & 'PRAGMA application_id = '//application_id//'; PRAGMA user_version = '//layout_version

contains

   !> Open a file, which is made at the first statement that writes.
   subroutine open_database(self, path, error)
      class(database_type), intent(inout) :: self
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error

      if (.not. allocated(self%path)) self%path = path
      call self%fail(c_open(path//c_null_char, self%handle), error)
      if (.not. allocated(error)) call self%run(be_patient, error)
   end subroutine open_database

   !> Close the file; what was not committed is not done.
   subroutine close_database(self)
      class(database_type), intent(inout) :: self
      integer(c_int) :: code

      if (c_associated(self%handle)) code = c_close(self%handle)
      self%handle = c_null_ptr
   end subroutine close_database

   !> Perform statements, separated by semicolons.
   subroutine run(self, sql, error)
      class(database_type), intent(in) :: self
      !> Statements.
      character(len=*), intent(in) :: sql
      type(error_type), allocatable, intent(out) :: error

      call self%fail(c_exec(self%handle, sql//c_null_char, c_null_ptr, c_null_ptr, c_null_ptr), error)
   end subroutine run

   !> The first cell that a statement gives, as text; '' if it gives none.
   subroutine value(self, sql, text, error)
      class(database_type), intent(in) :: self
      !> One statement.
      character(len=*), intent(in) :: sql
      character(len=:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(out) :: error
      type(statement_type) :: statement
      logical :: found

      text = ''
      call self%prepare(sql, statement, error)
      if (.not. allocated(error)) call statement%step(found, error)
      if (.not. allocated(error)) call statement%text(1, text)
      call statement%finish()
   end subroutine value

   !> A statement whose parameters are then bound; `finish` frees it.
   subroutine prepare(self, sql, statement, error)
      class(database_type), intent(in) :: self
      !> One statement.
      character(len=*), intent(in) :: sql
      type(statement_type), intent(out) :: statement
      type(error_type), allocatable, intent(out) :: error

      statement%database = self
      call self%fail(c_prepare(self%handle, sql//c_null_char, -1_c_int, statement%handle, c_null_ptr), error)
   end subroutine prepare

   !> The error of a result code in the words of the library, if it is one, and with the file.
   subroutine fail(self, code, error)
      class(database_type), intent(in) :: self
      integer(c_int), intent(in) :: code
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: reason

      if (any(int(code) == [ok, row_code, done_code])) return
      reason = 'the database is not open'
      if (c_associated(self%handle)) call copy_text(c_message(self%handle), reason)
      if (iand(int(code), 255) == full) reason = 'the disk is full'
      if (iand(int(code), 255) == read_only) reason = 'there is no permission to write it'
      call raise(error, reason, merge(machine_failure, exit_bad_input, any(of_the_machine == iand(int(code), 255))))
      call name_file(self%path, error)
   end subroutine fail

   !> Bind the parameter with number `i`, from 1, to a `value`.
   subroutine bind_text(self, i, value)
      class(statement_type), intent(inout) :: self
      integer, intent(in) :: i
      character(len=*), intent(in) :: value

      self%bound = max(self%bound, c_bind_text(self%handle, i, value//c_null_char, len(value, c_int), transient))
   end subroutine bind_text

   !> Bind the parameter with number `i`, from 1, to a `value`.
   subroutine bind_real(self, i, value)
      class(statement_type), intent(inout) :: self
      integer, intent(in) :: i
      real(wp), intent(in) :: value

      self%bound = max(self%bound, c_bind_double(self%handle, i, value))
   end subroutine bind_real

   !> Go on to the next row, if one is `found`.
   subroutine step(self, found, error)
      class(statement_type), intent(inout) :: self
      logical, intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      integer(c_int) :: code

      code = self%bound
      if (code == ok) code = c_step(self%handle)
      found = code == row_code
      call self%database%fail(code, error)
   end subroutine step

   !> Column `i`, from 1, of the present row; NULL is 0.
   real(wp) function column_real(self, i)
      class(statement_type), intent(in) :: self
      integer, intent(in) :: i

      column_real = c_column_double(self%handle, i - 1)
   end function column_real

   !> Column `i`, from 1, of the present row; NULL is ''.
   subroutine column_text(self, i, text)
      class(statement_type), intent(in) :: self
      integer, intent(in) :: i
      character(len=:), allocatable, intent(out) :: text

      call copy_text(c_column_text(self%handle, i - 1), text)
   end subroutine column_text

   !> Make ready for other parameters, NULL until they are bound, and leave the file to others.
   subroutine reset(self)
      class(statement_type), intent(inout) :: self
      integer(c_int) :: code

      self%bound = 0
      if (.not. c_associated(self%handle)) return
      code = c_reset(self%handle)
      code = c_clear_bindings(self%handle)
   end subroutine reset

   subroutine finish(self)
      class(statement_type), intent(inout) :: self
      integer(c_int) :: code

      if (c_associated(self%handle)) code = c_finalize(self%handle)
      self%handle = c_null_ptr
   end subroutine finish

   !> A text of the library.
   subroutine copy_text(bytes, text)
      type(c_ptr), intent(in) :: bytes
      character(len=:), allocatable, intent(out) :: text
      character(kind=c_char), pointer :: characters(:)
      integer(c_size_t) :: n
      integer :: i

      n = 0
      if (c_associated(bytes)) n = c_length(bytes)
      allocate (character(len=n) :: text)
      call c_f_pointer(bytes, characters, [n])
      do i = 1, len(text)
         text(i:i) = characters(i)
      end do
   end subroutine copy_text

   !> Open a campaign; it is made, with its folders, if it is not there.
   subroutine open_campaign_file(path, file, error)
      character(len=*), intent(in) :: path
      type(database_type), intent(inout) :: file
      type(error_type), allocatable, intent(out) :: error

      file%path = path
      if (len(folder_of(path)) > 0) call make_folder(folder_of(path), error)
      if (allocated(error)) return
      if (.not. file_exists(path)) call create()
      if (.not. allocated(error)) call file%open(path, error)
      if (.not. allocated(error)) call file%run('PRAGMA synchronous = FULL', error)
      if (.not. allocated(error)) call verify()
      if (.not. allocated(error)) call migrate()
      call name_file(path, error)

   contains

      !> Make a file beside, and give it its name if no other process did so first: a campaign is never half a file.
      subroutine create()
         type(database_type) :: part

         part%path = path
         ! A file of our own, whatever is there of this name.
         call replace_file(name_beside(path), '', error)
         if (.not. allocated(error)) call part%open(name_beside(path), error)
         if (.not. allocated(error)) call part%run('BEGIN IMMEDIATE; '//layout//'; COMMIT', error)
         call part%close()
         call place_new_file(path, whole=.not. allocated(error))
      end subroutine create

      !> That the file is a whole campaign of a version that is known.
      subroutine verify()
         character(len=:), allocatable :: found

         call file%value('SELECT COUNT(*) FROM sqlite_master', found, error)
         if (found == '0' .and. .not. allocated(error)) call raise_damaged(path, 'it is empty', error)
         if (.not. allocated(error)) call file%value('PRAGMA application_id', found, error)
         if (allocated(error)) return
         if (found /= application_id) then
            call refuse(error, path//': is a database, but not a campaign of bayesindent; choose another output folder')
            return
         end if
         call file%value('SELECT user_version FROM pragma_user_version WHERE user_version > '//layout_version, found, error)
         if (allocated(error)) return
         if (len(found) > 0) then
            call refuse(error, path//': was written by a newer version (format '//found//', known: '//layout_version//')')
            return
         end if
         call file%value('PRAGMA integrity_check(1)', found, error)
         ! The first line of a complaint is a heading.
         if (found == 'ok' .or. allocated(error)) return
         found = found(index(found, newline, back=.true.) + 1:)
         call raise_damaged(path, found, error)
      end subroutine verify

      !> Bring a file of an earlier version to the present one. Another process may do so at the same time.
      subroutine migrate()
         character(len=:), allocatable :: version

         call file%value('PRAGMA user_version', version, error)
         if (allocated(error) .or. version == layout_version) return
         call file%run(begin_transaction, error)
         if (.not. allocated(error)) call file%value('PRAGMA user_version', version, error)
         if (version /= layout_version .and. .not. allocated(error)) call file%run(from_version_1, error)
         call end_transaction(file, error)
      end subroutine migrate
   end subroutine open_campaign_file

   !> Keep what was changed since `begin_transaction` was run, or nothing after an `error`.
   subroutine end_transaction(file, error)
      type(database_type), intent(in) :: file
      type(error_type), allocatable, intent(inout) :: error
      type(error_type), allocatable :: aborted

      if (.not. allocated(error)) call file%run('COMMIT', error)
      if (allocated(error)) call file%run('ROLLBACK', aborted)
   end subroutine end_transaction

   !> The error of a file that cannot be read as a campaign: `why`.
   subroutine raise_damaged(path, why, error)
      character(len=*), intent(in) :: path, why
      type(error_type), allocatable, intent(out) :: error

      call refuse(error, path//': is not a campaign, or is damaged ('//why//'); restore a copy, or move it away to start a new one')
   end subroutine raise_damaged

   !> Let an error of the library say which file it is about, and what to do; one that does so stays.
   subroutine name_file(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: why

      if (.not. allocated(error)) return
      if (index(error%message, path//': ') == 1) return
      if (error%status == machine_failure) then
         error%message = path//': the campaign cannot be used: '//error%message
      else
         why = error%message
         call raise_damaged(path, why, error)
      end if
   end subroutine name_file

end module campaign_file
