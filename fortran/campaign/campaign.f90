!> campaign.sqlite: one row for each simulation that was made or imported. Rows are never changed.
!> Both programs read and continue the file.
!>
!> A row is on the disk when the call that adds it returns, so an interrupted campaign loses only
!> the simulations that were running. A failed simulation is not repeated. Each row belongs to a
!> physics (mesh, element, estimator, revision of the numerics), so several surrogates share a file,
!> and old results stay usable with a new release. Only one thread at a time may use a campaign;
!> several processes may share the file.
module campaign
   use files, only: checksum
   use, intrinsic :: iso_c_binding, only: c_null_char
   use campaign_file, only: begin_transaction, database_type, end_transaction, open_campaign_file, &
      & raise_damaged, text_value
   use crystal_class, only: crystal_class_type, new_crystal_class
   use errors, only: error_type
   use kinds, only: i8, nan, wp
   use simulate, only: n_derivatives, outcome_done, outcome_failed, outcome_type
   use text, only: line_type, newline, number_ok, number_text, quoted, read_integer, read_real, &
      & to_text
   implicit none
   private
   public :: campaign_type, row_type, campaign_name

   !> Name of the file in an output folder.
   character(len=*), parameter :: campaign_name = 'campaign.sqlite'

   !> One simulation of a crystal.
   type :: row_type
      !> Number in the order of choice within the physics, from 0. A new row with a number below 0
      !> gets the next one.
      integer :: position = -1
      !> Name of the crystal class; constants in its order, GPa; Bunge-Euler angles, degrees.
      character(len=12) :: symmetry = ''
      real(wp), allocatable :: constants(:)
      real(wp) :: euler_deg(3) = 0.0_wp
      !> Whether another program computed it.
      logical :: imported = .false.
      !> Done or failed. Values that the file does not have are 0, or empty.
      type(outcome_type) :: outcome
   end type row_type

   !> The rows of one physics in a campaign file.
   type :: campaign_type
      character(len=:), allocatable :: path
      !> The physics: JSON, keys sorted.
      character(len=:), allocatable, private :: identity
      type(database_type) :: file
      !> Number of the physics in the file.
      character(len=:), allocatable, private :: physics
      !> Rows that are not on the disk yet, and the clock count when the first of them came.
      type(row_type), allocatable, private :: waiting(:)
      integer, private :: n_waiting = 0
      integer(i8), private :: waiting_since = 0
   contains
      procedure :: open => open_campaign, rows, find, add, add_soon, flush, next_position, &
         & other_physics
      procedure, private :: read_row
      final :: finalize_campaign
   end type campaign_type

   !> Columns of a row, in the order of `read_row` and `add`.
   character(len=*), &
      & parameter :: columns = 'position, symmetry, constants, euler_deg, origin, status, ' &
      & //'message, depth_um, force_mn, modulus_by_stiffness, indentation_modulus_gpa, elements, ' &
      & //'seconds, checksum'
   !> Number of columns; number of those, from the second on, that are texts.
   integer, parameter :: n_columns = 14, n_texts = 9
   character(len=*), parameter :: lookup = 'SELECT '//columns//' FROM simulation WHERE ' &
      & //'physics_id = ? AND symmetry = ? AND constants = ? AND euler_deg = ?'
   character(len=*), parameter :: insertion = 'INSERT INTO simulation (physics_id, '//columns &
      & //', created) VALUES (?1, COALESCE(NULLIF(?2, ''-1''), (SELECT COALESCE(MAX(position) ' &
      & //'+ 1, 0) FROM simulation WHERE physics_id = ?1)), ?3, ?4, ?5, ' &
      & //'?6, ?7, ?8, NULLIF(?9, ''''), NULLIF(?10, ''''), NULLIF(?11, ' &
      & //'''''), NULLIF(?12, 0.0), NULLIF(?13, ''0''), NULLIF(?14, 0.0), ?15, ' &
      & //'strftime(''%Y-%m-%dT%H:%M:%S+00:00'', ''now'')) ON CONFLICT (physics_id, symmetry, ' &
      & //'constants, euler_deg) DO NOTHING'
   !> Values of the columns origin and status.
   character(len=*), parameter :: simulated = 'simulated', imported = 'told', done = 'done', &
      & failed = 'failed'

   !> Greatest number of rows that wait, and seconds after which they are written. Simulations of
   !> less than `quick_seconds` are written together.
   integer, parameter :: most_waiting = 1000, interval = 5
   real(wp), parameter :: quick_seconds = 0.01_wp

contains

   !> Open a file for the physics of an `identity` (see `simulate`), or make it if there is none.
   subroutine open_campaign(self, path, identity, error)
      class(campaign_type), intent(inout) :: self
      !> Path of the file; the physics, JSON with sorted keys.
      character(len=*), intent(in) :: path, identity
      type(error_type), allocatable, intent(out) :: error

      call self%file%close()
      self%path = path
      self%identity = identity
      call open_campaign_file(path, self%file, error)
      call self%file%value('INSERT OR IGNORE INTO physics (identity) VALUES (' &
         & //quoted(identity, '''')//'); SELECT id FROM physics WHERE identity = ' &
         & //quoted(identity, ''''), self%physics, error)
      if (allocated(error)) call self%file%close()
   end subroutine open_campaign

   subroutine finalize_campaign(self)
      type(campaign_type), intent(inout) :: self

      call self%file%close()
   end subroutine finalize_campaign

   !> Read the rows of this physics in the order of choice.
   subroutine rows(self, found, error)
      class(campaign_type), intent(in) :: self
      !> In the order of their positions.
      type(row_type), allocatable, intent(out) :: found(:)
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      character(len=:), allocatable :: cells
      integer :: at, i

      call self%file%query('SELECT '//columns//' FROM simulation WHERE physics_id = ' &
         & //'? ORDER BY position, id', text_value(self%physics), cells, error)
      allocate (found(count([(cells(i:i) == c_null_char, i=1, len(cells))])/n_columns))
      at = 1
      do i = 1, size(found)
         if (.not. allocated(error)) call self%read_row(cells, at, class, found(i), error)
      end do
   end subroutine rows

   !> Find the row of a crystal at an orientation.
   subroutine find(self, symmetry, constants, euler_deg, row, found, error)
      class(campaign_type), intent(inout) :: self
      !> Name of the crystal class.
      character(len=*), intent(in) :: symmetry
      !> Constants (k), GPa; Bunge-Euler angles (3), degrees.
      real(wp), intent(in) :: constants(:), euler_deg(:)
      type(row_type), intent(out) :: row
      !> Whether the file has the row.
      logical, intent(out) :: found
      type(error_type), allocatable, intent(out) :: error
      type(crystal_class_type) :: class
      character(len=:), allocatable :: cells
      integer :: at

      call self%file%query(lookup, text_value(self%physics)//text_value(trim(symmetry)) &
         & //text_value(list_text(constants))//text_value(list_text(euler_deg)), cells, error)
      found = len(cells) > 0
      at = 1
      if (found) call self%read_row(cells, at, class, row, error)
   end subroutine find

   !> Store a row on the disk, at its position or the next one. A row of the same point that another
   !> program stored meanwhile is kept instead.
   subroutine add(self, row, error)
      class(campaign_type), intent(inout) :: self
      type(row_type), intent(in) :: row
      !> After an error nothing is stored.
      type(error_type), allocatable, intent(inout) :: error
      type(line_type) :: texts(n_texts)
      type(outcome_type) :: outcome
      character(len=:), allocatable :: values, cells
      integer :: i

      texts(1)%text = trim(row%symmetry)
      texts(2)%text = list_text(row%constants)
      texts(3)%text = list_text(row%euler_deg)
      texts(4)%text = simulated
      if (row%imported) texts(4)%text = imported
      texts(5)%text = done
      texts(6)%text = ''
      outcome = row%outcome
      if (outcome%status /= outcome_done) then
         outcome%modulus = 0.0_wp
         texts(5)%text = failed
         texts(6)%text = outcome%message
      end if
      texts(7)%text = list_text(outcome%depth)
      texts(8)%text = list_text(outcome%force)
      texts(9)%text = list_text(outcome%by_stiffness)
      values = text_value(self%physics)//text_value(to_text(max(-1, row%position)))
      do i = 1, n_texts
         values = values//text_value(texts(i)%text)
      end do
      values = values//'r'//number_text(outcome%modulus)//c_null_char &
         & //text_value(to_text(max(0, outcome%elements))) &
         & //'r'//number_text(max(0.0_wp, outcome%seconds))//c_null_char
      call self%file%query(insertion, values//text_value(row_checksum(self%identity, texts, &
         & outcome)), cells, error)
   end subroutine add

   !> Store a row. Quick results, such as the theory's, wait until there are many of them or some
   !> seconds have passed.
   subroutine add_soon(self, row, error)
      class(campaign_type), intent(inout) :: self
      type(row_type), intent(in) :: row
      type(error_type), allocatable, intent(out) :: error
      integer(i8) :: now, rate

      if (.not. allocated(self%waiting)) allocate (self%waiting(most_waiting))
      call system_clock(now, rate)
      if (self%n_waiting == 0) self%waiting_since = now
      self%n_waiting = self%n_waiting + 1
      self%waiting(self%n_waiting) = row
      if (self%n_waiting == most_waiting .or. now - self%waiting_since > interval*rate &
         & .or. row%outcome%seconds > quick_seconds .or. row%outcome%elements > 0) then
         call self%flush(error)
      end if
   end subroutine add_soon

   !> Store the waiting rows: all, or none after an error.
   subroutine flush(self, error)
      class(campaign_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      if (self%n_waiting == 0) return
      call self%file%run(begin_transaction, error)
      do i = 1, self%n_waiting
         call self%add(self%waiting(i), error)
      end do
      call end_transaction(self%file, error)
      self%n_waiting = 0
   end subroutine flush

   !> Get the `position` of the next row.
   subroutine next_position(self, position, error)
      class(campaign_type), intent(in) :: self
      !> 0 after an error.
      integer, intent(out) :: position
      type(error_type), allocatable, intent(inout) :: error
      character(len=:), allocatable :: found
      integer :: outcome

      call self%file%value('SELECT COALESCE(MAX(position) + 1, 0) FROM simulation WHERE ' &
         & //'physics_id = '//self%physics, found, error)
      call read_integer(found, position, outcome)
   end subroutine next_position

   !> Get the identities of the other physics that have rows in the file.
   subroutine other_physics(self, identities, error)
      class(campaign_type), intent(in) :: self
      !> One on each line, or ''.
      character(len=:), allocatable, intent(out) :: identities
      type(error_type), allocatable, intent(out) :: error

      call self%file%value('SELECT GROUP_CONCAT(identity, CHAR(10)) FROM physics WHERE id <> ' &
         & //self%physics//' AND id IN (SELECT physics_id FROM simulation)', identities, error)
   end subroutine other_physics

   !> Read the row whose cells begin at the byte `at`, and move `at` to the next row.
   subroutine read_row(self, cells, at, class, row, error)
      class(campaign_type), intent(in) :: self
      !> Result of a query.
      character(len=*), intent(in) :: cells
      integer, intent(inout) :: at
      !> Class of the row before, which is often that of the row.
      type(crystal_class_type), intent(inout) :: class
      type(row_type), intent(out) :: row
      type(error_type), allocatable, intent(out) :: error
      type(line_type) :: cell(n_columns)
      type(error_type), allocatable :: unknown
      real(wp), allocatable :: euler_deg(:), numbers(:)
      logical :: is_right
      integer :: length, status, i

      do i = 1, n_columns
         length = index(cells(at:), c_null_char)
         cell(i)%text = cells(at:at + length - 2)
         at = at + length
      end do
      call read_integer(cell(1)%text, row%position, status)
      row%symmetry = cell(2)%text
      row%constants = numbers_in(cell(3)%text)
      row%imported = cell(5)%text == imported
      associate (outcome => row%outcome)
         outcome%status = merge(outcome_done, outcome_failed, cell(6)%text == done)
         outcome%message = cell(7)%text
         outcome%depth = numbers_in(cell(8)%text)
         outcome%force = numbers_in(cell(9)%text)
         outcome%by_stiffness = numbers_in(cell(10)%text)
         call read_real(cell(11)%text, outcome%modulus, status)
         call read_integer(cell(12)%text, outcome%elements, status)
         call read_real(cell(13)%text, outcome%seconds, status)
      end associate
      euler_deg = numbers_in(cell(4)%text)
      if (.not. allocated(class%name)) class%name = ''
      if (class%name /= cell(2)%text) call new_crystal_class(cell(2)%text, class, unknown)
      associate (outcome => row%outcome)
         is_right = cell(14)%text == row_checksum(self%identity, cell(2:1 + n_texts), outcome) &
            & .and. row%position >= 0 .and. .not. allocated(unknown)
         is_right = is_right .and. class%n_constants == size(row%constants) &
            & .and. size(euler_deg) == size(row%euler_deg)
         is_right = is_right .and. size(outcome%depth) == size(outcome%force) &
            & .and. any([0, n_derivatives] == size(outcome%by_stiffness))
         numbers = [row%constants, euler_deg, outcome%depth, outcome%force, outcome%by_stiffness]
         is_right = is_right .and. all(numbers > -huge(1.0_wp)) &
            & .and. (outcome%modulus > 0.0_wp .or. outcome%status /= outcome_done)
      end associate
      if (is_right) then
         row%euler_deg = euler_deg
      else
         call raise_damaged(self%path, &
            & 'the row of position '//to_text(row%position)//' was changed', error)
      end if
   end subroutine read_row

   !> The numbers of a JSON list; NaN for an entry that is no number. An empty text has no numbers.
   pure function numbers_in(list) result(numbers)
      character(len=*), intent(in) :: list
      real(wp), allocatable :: numbers(:)
      integer :: first, length, i, status

      allocate (numbers(count([(scan(list(i:i), '[,') > 0, i=1, len(list))])))
      first = 2
      do i = 1, size(numbers)
         length = scan(list(first:)//',', ',]')
         call read_real(trim(adjustl(list(first:first + length - 2))), numbers(i), status)
         if (status /= number_ok) numbers(i) = nan
         first = first + length
      end do
   end function numbers_in

   !> Checksum of a row: of the identity of its physics, its texts, and all bits of its numbers.
   pure function row_checksum(identity, texts, outcome) result(digits)
      character(len=*), intent(in) :: identity
      type(line_type), intent(in) :: texts(:)
      !> The modulus is 0 if there is none.
      type(outcome_type), intent(in) :: outcome
      character(len=16) :: digits
      character(len=:), allocatable :: content
      integer :: i

      content = identity
      ! Rows of campaigns that were made without derivatives have no text for them.
      do i = 1, size(texts) - merge(0, 1, len(texts(size(texts))%text) > 0)
         content = content//newline//texts(i)%text
      end do
      digits = checksum(content//newline//to_text(transfer(outcome%modulus, 1_i8)) &
         & //newline//to_text(max(0, outcome%elements)) &
         & //newline//to_text(transfer(max(0.0_wp, outcome%seconds), 1_i8)))
   end function row_checksum

   !> Numbers as a JSON list with all their digits; empty if there are none.
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
