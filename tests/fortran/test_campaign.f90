!> The store of simulations: what it gives back, what it refuses, and how fast it is.
!> test_campaign.py looks at it with Python's sqlite3.
program test_campaign
   use campaign, only: campaign_type, row_type
   use campaign_import, only: import_points
   use errors, only: error_type
   use kinds, only: wp
   use point_tables, only: points_type
   use simulate, only: outcome_done, outcome_failed
   use campaign_file, only: database_type
   use testing, only: check, check_refused, check_success, class_of, finish
   use text, only: to_text
   implicit none

   character(len=*), parameter :: path = 'test_campaign/a/campaign.sqlite', &
      & theory = '{"simulator": "theory"}'
   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp], &
      & angles(3) = [10.0_wp, 20.0_wp, 30.0_wp]

   call remove(path)
   call test_rows()
   call test_import()
   call test_many()
   call test_foreign()
   call remove(path)
   call finish()

contains

   subroutine test_rows()
      type(campaign_type) :: store, second
      type(row_type) :: row, back
      type(row_type), allocatable :: rows(:)
      type(error_type), allocatable :: error
      character(len=:), allocatable :: others
      logical :: found, same
      integer :: position

      call store%open(path, theory, error)
      call check_success('a campaign is made with its folders', error)
      if (allocated(error)) return
      row%symmetry = 'cubic'
      row%constants = copper/3.0_wp
      row%euler_deg = angles
      row%outcome%status = outcome_done
      row%outcome%modulus = 0.1_wp + 0.2_wp
      row%outcome%seconds = 1.5_wp
      row%outcome%elements = 12
      row%outcome%depth = [0.1_wp, 1.0e-5_wp]
      row%outcome%force = [2.0_wp, -0.0_wp]
      call store%add(row, error)
      call check_success('a row', error)
      row%outcome%modulus = 7.0_wp
      call store%add(row, error)
      call check_success('of a point that is there is not stored', error)
      row%symmetry = 'tetragonal'
      row%constants = [copper, copper]
      row%outcome%status = outcome_failed
      row%outcome%message = 'no contact'
      call store%add(row, error)
      call store%next_position(position, error)
      call check('positions go on', position == 2, to_text(position))
      call store%file%close()

      call store%open(path, theory, error)
      call store%find('cubic', copper/3.0_wp, angles, back, found, error)
      call check('a point is found', found)
      same = all(back%constants == copper/3.0_wp) .and. all(back%euler_deg == angles) &
         & .and. back%position == 0 .and. back%outcome%status == outcome_done &
         & .and. back%outcome%modulus == 0.1_wp + 0.2_wp &
         & .and. back%outcome%elements == 12 .and. back%outcome%seconds == 1.5_wp &
         & .and. all(back%outcome%depth == [0.1_wp, 1.0e-5_wp]) .and. .not. back%imported
      call check('to the last bit', same)
      call store%find('cubic', copper, angles, back, found, error)
      call check('another is not', .not. found .and. .not. allocated(error))
      call store%rows(rows, error)
      call check('rows of all symmetries', size(rows) == 2)
      call check('a failed point with its reason', rows(2)%outcome%status == outcome_failed &
         & .and. rows(2)%outcome%message == 'no contact' .and. rows(2)%symmetry == 'tetragonal')

      ! Another physics in the same file, open at the same time.
      call second%open(path, '{"simulator": "fe"}', error)
      call check_success('two at once', error)
      call second%rows(rows, error)
      call check('physics are kept apart', size(rows) == 0)
      call second%other_physics(others, error)
      call check('and named', others == theory, others)
      call second%file%close()
      call store%file%close()
      call store%next_position(position, error)
      call check_refused('a closed campaign says so', error, 'the database is not open')
   end subroutine test_rows

   subroutine test_import()
      type(campaign_type) :: store
      type(points_type) :: points
      type(row_type), allocatable :: rows(:)
      type(error_type), allocatable :: error
      integer :: n

      points%n = 2
      allocate (points%classes(1))
      points%classes(1) = class_of('cubic')
      points%class = [1, 1]
      points%constants = reshape([copper, 2.0_wp*copper], [3, 2])
      points%euler_deg = reshape([angles, angles], [3, 2])
      points%modulus_gpa = [134.0_wp, 268.0_wp]
      call store%open(path, theory, error)
      call import_points(store, points, n, error)
      call check('results of others', n == 2 .and. .not. allocated(error))
      call import_points(store, points, n, error)
      call check('are taken once', n == 0 .and. .not. allocated(error))
      points%constants(:, 1) = 3.0_wp*copper
      points%modulus_gpa(2) = 269.0_wp
      call import_points(store, points, n, error)
      call check_refused('a contradiction', error, 'row 2 (C11 336.8, C12 242.8, C44 150.8): ' &
         & //'modulus_gpa is 269.0, but the same point has 268.0 GPa in the campaign; ')
      points%constants(:, 2) = points%constants(:, 1)
      call import_points(store, points, n, error)
      call check_refused('among the rows', error, 'has 134.0 GPa in an earlier row; ')
      call store%rows(rows, error)
      call check('store nothing', size(rows) == 4 .and. count(rows%imported) == 2)
   end subroutine test_import

   !> Added at once, found and read back, in seconds.
   subroutine test_many()
      integer, parameter :: n = 20000
      real(wp), parameter :: enough = 20.0_wp
      type(campaign_type) :: store
      type(row_type), allocatable :: rows(:)
      type(row_type) :: row
      type(error_type), allocatable :: error
      real(wp) :: start, now
      logical :: found, all_found
      integer :: i

      call cpu_time(start)
      call store%open(path, '{"simulator": "many"}', error)
      allocate (rows(n))
      do i = 1, n
         rows(i)%symmetry = 'cubic'
         rows(i)%constants = copper*i/real(n, wp)
         rows(i)%euler_deg = angles/i
         rows(i)%outcome%status = outcome_done
         rows(i)%outcome%modulus = real(i, wp)
      end do
      do i = 1, n
         if (.not. allocated(error)) call store%add_soon(rows(i), error)
      end do
      if (.not. allocated(error)) call store%flush(error)
      call check_success('many rows', error)
      all_found = .true.
      do i = 1, n
         call store%find('cubic', copper*i/real(n, wp), angles/i, row, found, error)
         all_found = all_found .and. found .and. row%outcome%modulus == real(i, wp) &
            & .and. row%position == i - 1
      end do
      call check('are found', all_found)
      call store%rows(rows, error)
      call check('and read', size(rows) == n)
      call cpu_time(now)
      call check('soon', now - start < enough, to_text(now - start)//' s')
   end subroutine test_many

   subroutine test_foreign()
      type(campaign_type) :: store
      type(database_type) :: database
      type(error_type), allocatable :: error

      call remove(path)
      call database%open(path, error)
      call database%run('CREATE TABLE recipes (name TEXT)', error)
      call database%close()
      call store%open(path, theory, error)
      call check_refused('a database of others', error, &
         & path//': is a database, but not a campaign of bayesindent; ')
      call remove(path)
      call store%open(path, theory, error)
      call store%file%close()
      call database%open(path, error)
      call database%run('PRAGMA user_version = 4', error)
      call database%close()
      call store%open(path, theory, error)
      call check_refused('another format', error, &
         & path//': is a campaign of format 4, not 3; move it away to start a new one')
      call store%open('test_campaign', theory, error)
      call check_refused('a folder', error, &
         & 'test_campaign: the campaign cannot be used: unable to open database file')
   end subroutine test_foreign

   subroutine remove(name)
      character(len=*), intent(in) :: name
      integer :: unit, status

      open (newunit=unit, file=name, status='old', iostat=status)
      if (status == 0) close (unit, status='delete')
   end subroutine remove
end program test_campaign
