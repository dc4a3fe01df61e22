!> Step 1 of the batch program: simulations chosen, performed on threads and learnt from, see `step_1`.
module batch_build
   use, intrinsic :: iso_fortran_env, only: error_unit
   use batch_simulate, only: simulate_into
   use build_checks, only: check_build
   use build_document, only: conclude
   use campaign, only: row_type
   use errors, only: error_type
   use files, only: replace_file
   use kinds, only: i8, wp
   use namelist_file, only: place
   use problem, only: problem_type
   use simulate, only: new_simulator, simulator_type
   use step_1, only: build_type, open_build
   use surrogate_file, only: check_replaceable
   use text, only: to_text
   use parallelism, only: thread_count
   use warning_lists, only: warning_type
   implicit none
   private
   public :: build_surrogate, check_new_surrogate

contains

   !> The surrogate that &design asks for: its file, and `build.json`.
   subroutine build_surrogate(self, output, told, warnings, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      !> One line for the user.
      character(len=:), allocatable, intent(out) :: told
      type(warning_type), allocatable, intent(out) :: warnings(:)
      type(error_type), allocatable, intent(out) :: error
      type(build_type) :: build
      type(simulator_type), allocatable :: simulator
      character(len=:), allocatable :: document
      integer(i8) :: last_told, now, rate
      integer, parameter :: interval = 5

      call system_clock(last_told, rate)
      call open_build(self, output, build, error)
      do
         if (.not. allocated(error)) call build%advance(error)
         if (allocated(error)) return
         if (build%n_wanted() == 0) exit
         if (.not. allocated(simulator)) call new_simulator(self%settings, simulator, error)
         if (allocated(error)) then
            error%message = place(self%path, 'simulation', '')//error%message
            return
         end if
         call simulate_wanted(build, simulator, error)
         call system_clock(now)
         if (now - last_told < interval*rate) cycle
         last_told = now
         write (error_unit, '(4a)') 'build: ', to_text(build%learning%n()), ' simulations of ', to_text(build%learning%budget)
      end do
      call conclude(build, output, document, error)
      if (.not. allocated(error)) call replace_file(output//'/build.json', document, error)
      warnings = build%warnings
      told = to_text(build%learning%n())//' simulations, '//to_text(build%n_new)//' new, '//to_text(build%n_failed) &
         & //' failed, '//build%stopped//': '//output//'/'//self%settings%surrogate%file
   end subroutine build_surrogate

   !> Simulate on threads what is wanted; each result is kept as soon as it is there.
   subroutine simulate_wanted(build, simulator, error)
      type(build_type), intent(inout) :: build
      type(simulator_type), intent(in) :: simulator
      type(error_type), allocatable, intent(out) :: error
      type(row_type) :: rows(build%n_wanted())
      real(wp) :: stiffness(6, 6, size(rows))
      integer :: i, new

      do i = 1, size(rows)
         rows(i) = build%row(i)
         stiffness(:, :, i) = build%stiffness(i)
      end do
      call simulate_into(build%campaign, simulator, stiffness, thread_count(build%problem%settings%execution%workers), rows, new, &
         & error)
      do i = 1, size(rows)
         if (allocated(error)) return
         call build%store(i, rows(i)%outcome, error)
      end do
   end subroutine simulate_wanted

   !> Refuse a build that could not be, or whose surrogate could not be kept.
   subroutine check_new_surrogate(self, output, error)
      type(problem_type), intent(in) :: self
      character(len=*), intent(in) :: output
      type(error_type), allocatable, intent(out) :: error

      call check_build(self, error)
      if (allocated(error)) return
      call check_replaceable(output//'/'//self%settings%surrogate%file, error)
      if (allocated(error)) error%message = place(self%path, 'surrogate', 'file')//error%message
   end subroutine check_new_surrogate
end module batch_build
