!> The file of a campaign: its layout, and whether what is there is one.
module campaign_file
   use errors, only: error_type, machine_failure, refuse
   use files, only: file_exists, folder_of, make_folder, name_beside, place_new_file, replace_file
   use sqlite, only: database_type
   use text, only: newline
   implicit none
   private
   public :: open_campaign_file, begin_transaction, end_transaction, name_file, raise_damaged

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

   !> Open a campaign; it is made, with its folders, if it is not there.
   subroutine open_campaign_file(path, file, error)
      character(len=*), intent(in) :: path
      type(database_type), intent(inout) :: file
      type(error_type), allocatable, intent(out) :: error

      if (len(folder_of(path)) > 0) call make_folder(folder_of(path), error)
      if (allocated(error)) return
      if (.not. file_exists(path)) call create(path, error)
      if (.not. allocated(error)) call file%open(path, error)
      if (.not. allocated(error)) call file%run('PRAGMA synchronous = FULL', error)
      if (.not. allocated(error)) call verify(path, file, error)
      if (.not. allocated(error)) call migrate(file, error)
      call name_file(path, error)
   end subroutine open_campaign_file

   !> Make a file beside, and give it its name if no other process did so first: a campaign is never half a file.
   subroutine create(path, error)
      character(len=*), intent(in) :: path
      type(error_type), allocatable, intent(out) :: error
      type(database_type) :: file

      ! A file of our own, whatever is there of this name.
      call replace_file(name_beside(path), '', error)
      if (.not. allocated(error)) call file%open(name_beside(path), error)
      if (.not. allocated(error)) call file%run('BEGIN IMMEDIATE; '//layout//'; COMMIT', error)
      call file%close()
      call place_new_file(path, whole=.not. allocated(error))
   end subroutine create

   !> That the file is a whole campaign of a version that is known.
   subroutine verify(path, file, error)
      character(len=*), intent(in) :: path
      type(database_type), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
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
   subroutine migrate(file, error)
      type(database_type), intent(in) :: file
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: version

      call file%value('PRAGMA user_version', version, error)
      if (allocated(error) .or. version == layout_version) return
      call file%run(begin_transaction, error)
      if (.not. allocated(error)) call file%value('PRAGMA user_version', version, error)
      if (version /= layout_version .and. .not. allocated(error)) call file%run(from_version_1, error)
      call end_transaction(file, error)
   end subroutine migrate

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
