!> Rivals of time: moduli that drift with the row, the time, the depth or the position, and sessions
!> with factors of their own. The rows share relative errors, which are integrated out.
module drift_rivals
   use errors, only: error_type
   use kinds, only: wp
   use rival_cases, only: case_type, rival_type
   use text, only: to_text
   implicit none
   private
   public :: make_drift, make_session

   !> sd of the relative change of a modulus over the range of a column, and of that between
   !> sessions.
   real(wp), parameter :: drift_sd = 0.06_wp, session_sd = 0.06_wp
   !> Columns with which moduli may drift, and how each is called.
   character(len=*), parameter :: columns(5) = [character(len=8) :: 'row', 'time_s', 'depth_um', &
      & 'x_um', 'y_um']

contains

   !> A drift with column k.
   subroutine make_drift(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      real(wp) :: values(size(case%points))

      if (k > size(columns)) return
      rival%explanation = 'a drift of the moduli with '//trim(columns(k))
      rival%remedy = 'shared_errors with a column of the drift'
      call read_values()
      if (.not. maxval(values) > minval(values)) return
      values = (values - sum(values)/size(values))/(maxval(values) - minval(values))
      call add_errors(rival, reshape(drift_sd*values, [size(values), 1]))

   contains

      !> Set the values of the column for each compared grain; all the same if there is none.
      subroutine read_values()
         type(error_type), allocatable :: error
         integer :: column, i

         values = 0.0_wp
         associate (measured => case%problem%data%measurements)
            column = measured%table%find(trim(columns(k)))
            do i = 1, size(values)
               if (column == 0 .and. columns(k) == 'row') values(i) = measured%row(case%points(i))
               if (column == 0) cycle
               if (measured%table%is_empty(column, measured%row(case%points(i)))) cycle
               call measured%table%number(column, measured%row(case%points(i)), values(i), error)
               if (allocated(error)) exit
            end do
         end associate
         if (allocated(error)) values = 0.0_wp
      end subroutine read_values
   end subroutine make_drift

   !> Sessions: those of the column group, each with a factor; or two, one before and one after a
   !> part k of the rows.
   subroutine make_session(case, k, rival)
      type(case_type), intent(in) :: case
      integer, intent(in) :: k
      type(rival_type), intent(inout) :: rival
      integer, parameter :: parts = 6
      real(wp), allocatable :: shared(:, :)
      integer :: first, i, n

      n = size(case%points)
      if (k >= parts) return
      rival%remedy = 'calibration_sd = '//to_text(session_sd, 2)//' with a column group'
      first = 1 + (k*n)/parts
      rival%explanation = 'another session from row '//to_text(case%points(min(n, first)))//' on'
      if (n < parts) return
      if (case%stated%n_groups > 1) then
         if (k > 1 .or. any(case%stated%laboratory%sd > 0.0_wp)) return
         rival%explanation = 'sessions (column group) with factors of their own'
         allocate (shared(n, case%stated%n_groups))
         do i = 1, n
            shared(i, :) = merge(session_sd, 0.0_wp, &
               & [(first, first=1, size(shared, 2))] == case%stated%data%group(i))
         end do
      else
         shared = reshape(merge(session_sd, -session_sd, [(i >= first, i=1, n)])/sqrt(2.0_wp), &
            & [n, 1])
      end if
      call add_errors(rival, shared)
   end subroutine make_session

   !> The stated model with further relative errors that the measurements share, (grain, error).
   subroutine add_errors(rival, shared)
      type(rival_type), intent(inout) :: rival
      real(wp), intent(in) :: shared(:, :)

      rival%data%shared = reshape([rival%data%shared, shared], &
         & [size(shared, 1), size(shared, 2) + size(rival%data%shared, 2)])
      rival%differs = .true.
   end subroutine add_errors

end module drift_rivals
