!> The file of a campaign: its layout, and the check that a file is a campaign.
!>
!> libsqlite3 reads and writes database files (cpp/database.cpp). Failures of the machine, such as
!> a lock or a full disk, have their own error status. One thread at a time may use a database.
module campaign_file
   use, intrinsic :: iso_c_binding, only: c_associated, c_f_pointer, c_int, c_null_char, &
      & c_null_ptr, c_ptr
   use errors, only: error_type, machine_failure, prefix_error, raise, refuse
   use files, only: file_exists, folder_of, make_folder, name_beside, place_new_file, printable, &
      & replace_file
   use text, only: newline
   implicit none
   private
   public :: open_campaign_file, begin_transaction, end_transaction, raise_damaged, &
      & database_type, text_value

   !> Result codes of the library for failures of the machine: permission, busy, locked, memory,
   !> read-only, interrupt, input and output, full, cannot open; and the code for a database that is
   !> not open.
   integer, parameter :: machine_codes(9) = [3, 5, 6, 7, 8, 9, 10, 13, 14], read_only = 8, &
      & full = 13, misuse = 21

   type :: database_type
      private
      type(c_ptr) :: handle = c_null_ptr
      !> Path of the campaign, for messages.
      character(len=:), allocatable :: path
   contains
      procedure :: open => open_database, close => close_database, run, value, query
   end type database_type

   interface
      type(c_ptr) function c_open(path) bind(c, name='bayesindent_open_database')
         import
         character, intent(in) :: path(*)
      end function c_open
      subroutine c_close(handle) bind(c, name='bayesindent_close_database')
         import
         type(c_ptr), value :: handle
      end subroutine c_close
      type(c_ptr) function c_query(handle, sql, values, length, bytes, code) bind(c, &
         & name='bayesindent_query')
         import
         type(c_ptr), value :: handle
         character, intent(in) :: sql(*), values(*)
         integer(c_int), value :: length
         integer(c_int), intent(out) :: bytes, code
      end function c_query
   end interface

   !> Mark of the files of this package ('bayi'), and version of their layout.
   character(len=*), parameter :: application_id = '1650555241', layout_version = '3'
   !> Statement that begins a transaction. `end_transaction` keeps all of its changes, or none.
   character(len=*), parameter :: begin_transaction = 'BEGIN IMMEDIATE'

   !> Types and names of all objects of the layout, sorted.
   character(len=*), parameter :: tables = 'index simulation_by_position, table physics, ' &
      & //'table simulation, trigger simulation_is_not_changed, trigger simulation_is_not_deleted'

   !> The layout. `identity` is JSON with sorted keys. `position` numbers the simulations of a
   !> physics from 0, in the order in which they were chosen. The origin 'told' is an import. Lists
   !> are JSON: the constants in the order of the class, GPa; Bunge-Euler angles, degrees; depths,
   !> um, and forces, mN; the derivatives of the modulus by C11, C12 .. C66. `message` says why a
   !> simulation failed; `created` is in UTC. The checksum is `row_checksum`.
   character(len=*), parameter :: layout = 'CREATE TABLE physics (id INTEGER PRIMARY KEY, ' &
      & //'identity TEXT NOT NULL UNIQUE); CREATE TABLE simulation (id INTEGER PRIMARY KEY, ' &
      & //'physics_id INTEGER NOT NULL REFERENCES physics(id), position INTEGER NOT NULL, ' &
      & //'symmetry TEXT NOT NULL, constants TEXT NOT NULL, euler_deg TEXT NOT NULL, origin TEXT ' &
      & //'NOT NULL CHECK (origin IN (''simulated'', ''told'')), status TEXT NOT NULL CHECK ' &
      & //'(status IN (''done'', ''failed'')), message TEXT NOT NULL, indentation_modulus_gpa ' &
      & //'REAL, elements INTEGER, seconds REAL, depth_um TEXT, force_mn TEXT, ' &
      & //'modulus_by_stiffness TEXT, created TEXT NOT NULL, checksum TEXT, ' &
      & //'UNIQUE (physics_id, symmetry, constants, euler_deg)); ' &
      & //'CREATE INDEX simulation_by_position ON simulation (physics_id, position); ' &
      & //'CREATE TRIGGER simulation_is_not_changed BEFORE UPDATE ON simulation ' &
      & //'BEGIN SELECT RAISE(ABORT, ''a stored simulation is never changed''); END; ' &
      & //'CREATE TRIGGER simulation_is_not_deleted BEFORE DELETE ON simulation ' &
      & //'BEGIN SELECT RAISE(ABORT, ''a stored simulation is never deleted''); END; ' &
      & //'PRAGMA application_id = '//application_id//'; PRAGMA user_version = '//layout_version

contains

   !> Open a file.
   subroutine open_database(self, path, error)
      class(database_type), intent(inout) :: self
      character(len=*), intent(in) :: path
      !> If it is allocated on entry, nothing is executed, here and below.
      type(error_type), allocatable, intent(inout) :: error

      ! The library would make a missing file at once.
      if (allocated(error)) return
      ! Messages name the campaign, not the unfinished file of `create`.
      if (.not. allocated(self%path)) self%path = path
      self%handle = c_open(path//c_null_char)
      ! Time to wait for another process, ms.
      call self%run('PRAGMA busy_timeout = 60000; PRAGMA synchronous = FULL', error)
   end subroutine open_database

   !> Close the file. Changes that were not committed are lost.
   subroutine close_database(self)
      class(database_type), intent(inout) :: self

      if (c_associated(self%handle)) call c_close(self%handle)
      self%handle = c_null_ptr
   end subroutine close_database

   !> Execute `sql`: statements, separated by semicolons.
   subroutine run(self, sql, error)
      class(database_type), intent(in) :: self
      character(len=*), intent(in) :: sql
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: cells

      call self%query(sql, '', cells, error)
   end subroutine run

   !> Execute `sql`, and get the first cell of its result as `text`; '' if there is none.
   subroutine value(self, sql, text, error)
      class(database_type), intent(in) :: self
      character(len=*), intent(in) :: sql
      character(len=:), allocatable, intent(out) :: text
      type(error_type), allocatable, intent(inout) :: error

      call self%query(sql, '', text, error)
      text = text(:index(text, c_null_char) - 1)
   end subroutine value

   !> Execute a statement with values for its parameters, or several statements without parameters.
   !> A zero byte ends each of the resulting `cells`; NULL is ''. The message of an error has the
   !> file and the reason that the library states.
   subroutine query(self, sql, values, cells, error)
      class(database_type), intent(in) :: self
      !> Statements; values of the parameters, see `text_value`.
      character(len=*), intent(in) :: sql, values
      character(len=:), allocatable, intent(out) :: cells
      type(error_type), allocatable, intent(inout) :: error
      character, pointer :: bytes(:)
      type(c_ptr) :: address
      integer(c_int) :: n, code

      cells = ''
      if (allocated(error)) return
      code = misuse
      cells = 'the database is not open'
      if (c_associated(self%handle)) then
         address = c_query(self%handle, sql//c_null_char, values, len(values), n, code)
         call c_f_pointer(address, bytes, [n])
         cells = transfer(bytes, repeat(' ', n))
      end if
      if (code == 0) return
      ! The low byte is the primary code of an extended one.
      code = iand(code, 255)
      if (code == full) cells = 'the disk is full'
      if (code == read_only) cells = 'there is no permission to write it'
      if (any(machine_codes == code)) then
         call raise(error, self%path//': the campaign cannot be used: '//cells, machine_failure)
      else
         call raise_damaged(self%path, cells, error)
      end if
      cells = ''
   end subroutine query

   !> A `text`, or the digits of an integer, as a value of a query. The value of a real is an r, its
   !> digits and a zero byte.
   pure function text_value(text) result(value)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: value

      value = 't'//text//c_null_char
   end function text_value

   !> Open a campaign. If there is none, make it, and its folders.
   subroutine open_campaign_file(path, file, error)
      character(len=*), intent(in) :: path
      type(database_type), intent(inout) :: file
      type(error_type), allocatable, intent(out) :: error

      file%path = path
      if (len(folder_of(path)) > 0) call make_folder(folder_of(path), error)
      if (allocated(error)) return
      if (.not. file_exists(path)) call create()
      call file%open(path, error)
      call check()

   contains

      !> Make a complete file under another name. Then rename it, unless another process was first.
      !> So no process sees an incomplete campaign.
      subroutine create()
         type(database_type) :: part

         part%path = path
         ! A new empty file takes the place of a leftover.
         call replace_file(name_beside(path), '', error)
         call prefix_error(error, path//': the campaign cannot be used: ')
         call part%open(name_beside(path), error)
         call part%run('BEGIN IMMEDIATE; '//layout//'; COMMIT', error)
         call part%close()
         call place_new_file(path, whole=.not. allocated(error))
      end subroutine create

      !> Refuse a file that is not an undamaged campaign of the present format.
      subroutine check()
         character(len=:), allocatable :: schema, application, version, damage

         call file%value('SELECT group_concat(type || '' '' || name, '', '') FROM (SELECT * FROM ' &
            & //'sqlite_schema WHERE name NOT LIKE ''sqlite_%'' ORDER BY type, name)', schema, &
            & error)
         call file%value('PRAGMA application_id', application, error)
         call file%value('PRAGMA user_version', version, error)
         call file%value('PRAGMA integrity_check(1)', damage, error)
         if (allocated(error)) return
         if (len(schema) == 0) then
            call raise_damaged(path, 'it is empty', error)
         else if (application /= application_id) then
            call refuse(error, path//': is a database, but not a campaign of bayesindent; choose ' &
               & //'another output folder')
         else if (version /= layout_version) then
            call refuse(error, path//': is a campaign of format '//version//', not ' &
               & //layout_version//'; move it away to start a new one')
         else if (schema /= tables) then
            call raise_damaged(path, 'it has '//printable(schema)//' in place of '//tables, error)
         else if (damage /= 'ok') then
            ! The first line of a message of the check is a heading.
            call raise_damaged(path, damage(index(damage, newline, back=.true.) + 1:), error)
         end if
      end subroutine check
   end subroutine open_campaign_file

   !> Commit the changes since `begin_transaction`. After an `error` all of them are undone.
   subroutine end_transaction(file, error)
      type(database_type), intent(in) :: file
      type(error_type), allocatable, intent(inout) :: error
      type(error_type), allocatable :: aborted

      call file%run('COMMIT', error)
      if (allocated(error)) call file%run('ROLLBACK', aborted)
   end subroutine end_transaction

   !> Refuse a file that cannot be read as a campaign; `why` is the reason.
   subroutine raise_damaged(path, why, error)
      character(len=*), intent(in) :: path, why
      type(error_type), allocatable, intent(out) :: error

      call refuse(error, path//': is not a campaign, or is damaged ('//why &
         & //'); restore a copy, or move it away to start a new one')
   end subroutine raise_damaged
end module campaign_file
