!> campaign.sqlite: every simulation that was ever made or imported, one row each, never changed;
!> both programs read and continue it.
!>
!> A row is on the disk when the call that adds it returns, so that an interrupted campaign loses at
!> most what was under way. A point that failed stays failed. Rows belong to a physics (mesh,
!> element, estimator, revision of the numerics): several surrogates share a file, and a new release
!> does not orphan old results. One thread at a time may use a campaign; processes share the file.
module campaign
   use files, only: checksum
   use, intrinsic :: iso_c_binding, only: c_null_char
   use campaign_file, only: begin_transaction, database_type, end_transaction, open_campaign_file, &
      & raise_damaged, text_value
   use errors, only: error_type, warning_type
   use kinds, only: i8, wp
   use simulate, only: outcome_done, outcome_failed, outcome_type
   use text, only: number_ok, number_text, quoted, read_integer, read_real, to_text
   implicit none
   private
   public :: campaign_type, row_type, campaign_name

   !> The file in an output folder.
   character(len=*), parameter :: campaign_name = 'campaign.sqlite'

   !> One simulation of a crystal.
   type :: row_type
      !> Order of choice within the physics, from 0; below 0 in a row that is to be added: the next.
      integer :: position = -1
      !> Name of its class; its constants in the order of the class, GPa; Bunge's angles, degrees.
      character(len=12) :: symmetry = ''
      real(wp), allocatable :: constants(:)
      real(wp) :: euler_deg(3) = 0.0_wp
      !> Computed by another program.
      logical :: imported = .false.
      !> Done or failed. What the file has not is 0, or empty.
      type(outcome_type) :: outcome
   end type row_type

   !> The rows of one physics in a campaign file.
   type :: campaign_type
      character(len=:), allocatable :: path
      !> Of the physics: JSON, keys sorted.
      character(len=:), allocatable, private :: identity
      type(database_type) :: file
      !> The number of the physics in the file.
      character(len=:), allocatable, private :: physics
      !> Rows on their way to the disk, and since when the first of them waits.
      type(row_type), allocatable, private :: waiting(:)
      integer, private :: n_waiting = 0
      integer(i8), private :: since = 0
   contains
      procedure :: open => open_campaign, rows, find, add, add_soon, flush, next_position, &
         & other_physics
      procedure, private :: read_row
      final :: finalize_campaign
   end type campaign_type

   !> The columns of a row, in the order in which `read_row` takes them and `add` gives them.
   character(len=*), &
      & parameter :: columns = 'position, symmetry, constants, euler_deg, origin, status, ' &
      & //'message, depth_um, force_mn, indentation_modulus_gpa, elements, seconds, checksum'
   !> Those from the second on are texts.
   integer, parameter :: n_columns = 13, n_texts = 8
   character(len=*), parameter :: lookup = 'SELECT '//columns//' FROM simulation WHERE ' &
      & //'physics_id = ? AND symmetry = ? AND constants = ? AND euler_deg = ?'
   character(len=*), parameter :: insertion = 'INSERT INTO simulation (physics_id, '//columns &
      & //', created) VALUES (?1, COALESCE(NULLIF(?2, ''-1''), (SELECT COALESCE(MAX(position) ' &
      & //'+ 1, 0) FROM simulation WHERE physics_id = ?1)), ?3, ?4, ?5, ' &
      & //'?6, ?7, ?8, NULLIF(?9, ''''), NULLIF(?10, ''''), NULLIF(?11, ' &
      & //'0.0), NULLIF(?12, ''0''), NULLIF(?13, 0.0), ?14, ' &
      & //'strftime(''%Y-%m-%dT%H:%M:%S+00:00'', ''now'')) ON CONFLICT (physics_id, symmetry, ' &
      & //'constants, euler_deg) DO NOTHING'
   character(len=*), parameter :: simulated = 'simulated', told = 'told', done = 'done', &
      & failed = 'failed'

   !> Between the texts of a row, for its checksum.
   character, parameter :: separator = achar(10)

   !> Rows that wait at most, and seconds between two writes; seconds of a simulation that is not
   !> worth a write of its own.
   integer, parameter :: most_waiting = 1000, interval = 5
   real(wp), parameter :: quick = 0.01_wp

contains

   !> Open a file for the physics of an `identity` (see `simulate`); it is made if it is not there.
   subroutine open_campaign(self, path, identity, error)
      class(campaign_type), intent(inout) :: self
      !> Of the file; JSON, keys sorted.
      character(len=*), intent(in) :: path, identity
      type(error_type), allocatable, intent(out) :: error

      call self%file%close()
      self%path = path
      self%identity = identity
      call open_campaign_file(path, self%file, error)
      if (.not. allocated(error)) then
         call self%file%run('INSERT OR IGNORE INTO physics (identity) VALUES (' &
            & //quoted(identity, '''')//')', error)
      end if
      if (.not. allocated(error)) then
         call self%file%value('SELECT id FROM physics WHERE identity = '//quoted(identity, ''''), &
            & self%physics, error)
      end if
      if (allocated(error)) call self%file%close()
   end subroutine open_campaign

   subroutine finalize_campaign(self)
      type(campaign_type), intent(inout) :: self

      call self%file%close()
   end subroutine finalize_campaign

   !> All rows of this physics, of one symmetry or, of '', of all, in order of choice.
   subroutine rows(self, symmetry, found, error)
      class(campaign_type), intent(in) :: self
      !> Name of a class.
      character(len=*), intent(in) :: symmetry
      !> In order of position.
      type(row_type), allocatable, intent(out) :: found(:)
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: cells
      integer :: at, i

      call self%file%query('SELECT '//columns//' FROM simulation WHERE physics_id = ' &
         & //'?1 AND (?2 = '''' OR symmetry = ?2) ORDER BY position, id', &
         & text_value(self%physics)//text_value(trim(symmetry)), cells, error)
      allocate (found(count([(cells(i:i) == c_null_char, i=1, len(cells))])/n_columns))
      at = 1
      do i = 1, size(found)
         if (.not. allocated(error)) call self%read_row(cells, at, found(i), error)
      end do
   end subroutine rows

   !> The row of a point, if it is there.
   subroutine find(self, symmetry, constants, euler_deg, row, found, error)
      class(campaign_type), intent(inout) :: self
      !> Name of its class.
      character(len=*), intent(in) :: symmetry
      !> Of one crystal, GPa (k), and of one grain, degrees (3).
      real(wp), intent(in) :: constants(:), euler_deg(:)
      type(row_type), intent(out) :: row
      !> Whether it is there.
      logical, intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: cells
      integer :: at

      call self%file%query(lookup, text_value(self%physics)//text_value(trim(symmetry)) &
         & //text_value(list_text(constants))//text_value(list_text(euler_deg)), cells, error)
      found = len(cells) > 0
      at = 1
      if (found) call self%read_row(cells, at, row, error)
   end subroutine find

   !> Store a row, at its position or the next one; on return it is on the disk. One that is there
   !> already, from another program at work on the same file, stays.
   subroutine add(self, row, error)
      class(campaign_type), intent(inout) :: self
      type(row_type), intent(in) :: row
      type(error_type), allocatable, intent(out) :: error
      type(warning_type) :: texts(n_texts)
      character(len=:), allocatable :: values, cells
      real(wp) :: modulus
      integer :: i

      call get_texts(row, texts)
      values = text_value(self%physics)//text_value(to_text(max(-1, row%position)))
      do i = 1, n_texts
         values = values//text_value(texts(i)%text)
      end do
      associate (outcome => row%outcome)
         modulus = merge(outcome%modulus, 0.0_wp, outcome%status == outcome_done)
         values = values//'r'//number_text(modulus)//c_null_char &
            & //text_value(to_text(max(0, outcome%elements))) &
            & //'r'//number_text(max(0.0_wp, outcome%seconds))//c_null_char
         values = values//text_value(row_checksum(self%identity, texts, modulus, &
            & outcome%elements, outcome%seconds))
      end associate
      call self%file%query(insertion, values, cells, error)
   end subroutine add

   !> The texts of a row.
   subroutine get_texts(row, texts)
      type(row_type), intent(in) :: row
      type(warning_type), intent(out) :: texts(n_texts)

      texts(1)%text = trim(row%symmetry)
      texts(2)%text = list_text(row%constants)
      texts(3)%text = list_text(row%euler_deg)
      texts(4)%text = trim(merge(told//'     ', simulated, row%imported))
      texts(5)%text = trim(merge(done//'  ', failed, row%outcome%status == outcome_done))
      texts(6)%text = ''
      if (allocated(row%outcome%message) .and. row%outcome%status /= outcome_done) then
         texts(6)%text = row%outcome%message
      end if
      texts(7)%text = list_text(row%outcome%depth)
      texts(8)%text = list_text(row%outcome%force)
   end subroutine get_texts

   !> Store a row now, or, if it took next to no time, such as the theory's, when there are many of
   !> them or some seconds have passed.
   subroutine add_soon(self, row, error)
      class(campaign_type), intent(inout) :: self
      type(row_type), intent(in) :: row
      type(error_type), allocatable, intent(out) :: error
      integer(i8) :: now, rate
      logical :: full

      if (.not. allocated(self%waiting)) allocate (self%waiting(most_waiting))
      call system_clock(now, rate)
      if (self%n_waiting == 0) self%since = now
      self%n_waiting = self%n_waiting + 1
      self%waiting(self%n_waiting) = row
      full = self%n_waiting == most_waiting .or. now - self%since > interval*rate
      if (full .or. row%outcome%seconds > quick .or. row%outcome%elements > 0) then
         call self%flush(error)
      end if
   end subroutine add_soon

   !> Store all that wait: all or none.
   subroutine flush(self, error)
      class(campaign_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (self%n_waiting == 0) return
      call self%file%run(begin_transaction, error)
      do i = 1, self%n_waiting
         if (.not. allocated(error)) call self%add(self%waiting(i), error)
      end do
      call end_transaction(self%file, error)
      self%n_waiting = 0
   end subroutine flush

   !> The `position` of a row to come.
   subroutine next_position(self, position, error)
      class(campaign_type), intent(in) :: self
      integer, intent(out) :: position
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: found
      integer :: outcome

      position = 0
      call self%file%value('SELECT COALESCE(MAX(position) + 1, 0) FROM simulation WHERE ' &
         & //'physics_id = '//self%physics, found, error)
      if (allocated(error)) return
      call read_integer(found, position, outcome)
   end subroutine next_position

   !> The identities of the other physics in the file that have rows, one a line.
   subroutine other_physics(self, identities, error)
      class(campaign_type), intent(in) :: self
      !> Lines, or ''.
      character(len=:), allocatable, intent(out) :: identities
      type(error_type), allocatable, intent(out) :: error

      call self%file%value('SELECT GROUP_CONCAT(identity, CHAR(10)) FROM physics WHERE id <> ' &
         & //self%physics//' AND id IN (SELECT physics_id FROM simulation)', identities, error)
   end subroutine other_physics

   !> The row whose cells begin `at` a byte, which is left after them.
   subroutine read_row(self, cells, at, row, error)
      class(campaign_type), intent(in) :: self
      !> As a query gives them.
      character(len=*), intent(in) :: cells
      integer, intent(inout) :: at
      type(row_type), intent(out) :: row
      type(error_type), allocatable, intent(out) :: error
      type(warning_type) :: cell(n_columns)
      real(wp), allocatable :: angles(:)
      logical :: good(5)
      integer :: length, outcome, i

      do i = 1, n_columns
         length = index(cells(at:), c_null_char)
         cell(i)%text = cells(at:at + length - 2)
         at = at + length
      end do
      call read_integer(cell(1)%text, row%position, outcome)
      row%symmetry = cell(2)%text
      call read_list(cell(3)%text, row%constants, good(1))
      call read_list(cell(4)%text, angles, good(2))
      row%imported = cell(5)%text == told
      row%outcome%status = merge(outcome_done, outcome_failed, cell(6)%text == done)
      row%outcome%message = cell(7)%text
      call read_list(cell(8)%text, row%outcome%depth, good(3))
      call read_list(cell(9)%text, row%outcome%force, good(4))
      call read_real(cell(10)%text, row%outcome%modulus, outcome)
      call read_integer(cell(11)%text, row%outcome%elements, outcome)
      call read_real(cell(12)%text, row%outcome%seconds, outcome)
      good(5) = cell(13)%text == row_checksum(self%identity, cell(2:1 + n_texts), &
         & row%outcome%modulus, row%outcome%elements, row%outcome%seconds)
      if (all(good) .and. size(angles) == size(row%euler_deg)) then
         row%euler_deg = angles
      else
         call raise_damaged(self%path, &
            & 'the row of position '//to_text(row%position)//' was changed', error)
      end if
   end subroutine read_row

   !> The numbers of a JSON list, none of an empty text.
   pure subroutine read_list(list, values, good)
      character(len=*), intent(in) :: list
      real(wp), allocatable, intent(out) :: values(:)
      logical, intent(out) :: good
      integer :: j, n, first, last, outcome

      n = 0
      if (len(list) > 2) n = 1 + count([(list(j:j) == ',', j=1, len(list))])
      allocate (values(n), source=0.0_wp)
      good = .true.
      first = 2
      do j = 1, n
         ! Numbers are separated by a comma and a blank, the last ends before the bracket.
         last = first + index(list(first:), ',') - 2
         if (j == n) last = len(list) - 1
         call read_real(list(first:last), values(j), outcome)
         good = good .and. outcome == number_ok
         first = min(last + 3, len(list))
      end do
   end subroutine read_list

   !> The checksum of a row: of the identity of its physics, its texts, and its numbers, to the last
   !> bit.
   pure function row_checksum(identity, texts, modulus, elements, seconds) result(digits)
      character(len=*), intent(in) :: identity
      type(warning_type), intent(in) :: texts(:)
      !> GPa; number; s. Each is 0 where there is none.
      real(wp), intent(in) :: modulus, seconds
      integer, intent(in) :: elements
      character(len=16) :: digits
      character(len=:), allocatable :: words
      integer :: i

      words = identity
      do i = 1, size(texts)
         words = words//separator//texts(i)%text
      end do
      digits = checksum(words//separator//to_text(transfer(modulus, 1_i8))//separator &
         & //to_text(max(0, elements))//separator//to_text(transfer(max(0.0_wp, seconds), 1_i8)))
   end function row_checksum

   !> Numbers as the file spells them: a JSON list, every double to its last bit; empty if there are
   !> none.
   pure function list_text(values) result(list)
      real(wp), intent(in), optional :: values(:)
      character(len=:), allocatable :: list
      integer :: i

      list = ''
      if (.not. present(values)) return
      do i = 1, size(values)
         list = list//', '//number_text(values(i))
      end do
      if (size(values) > 0) list = '['//list(3:)//']'
   end function list_text

end module campaign
