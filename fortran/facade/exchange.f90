!> Arguments and results of an operation: named values, the problem whose handle is among them, and
!> an object that the operation made.
!>
!> Another language holds an object by its handle, a number that is never used again. The registry
!> has the object and its kind.
!>
!> A handle that was freed, was never assigned, or is of another kind raises an error instead of a
!> crash. Threads may register, find and release objects at the same time. The holder of a handle
!> must not release it while it is in use.
module exchange
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int64_t, c_loc
   use errors, only: error_type, refuse
   use kinds, only: i8, wp
   use named_values, only: named_values_reader_type, named_values_type
   use machine, only: thread_count
   use problem, only: problem_type
   use simulate, only: n_derivatives
   use surrogate_model, only: places_type, simulations_type, values_alone
   use text, only: to_text
   implicit none
   private
   public :: exchange_type, register_object, find_object, release_object

   type :: entry_type
      integer(i8) :: handle = 0
      character(len=:), allocatable :: kind
      class(*), pointer :: object => null()
   end type entry_type

   type(entry_type), allocatable :: entries(:)
   integer(i8) :: last_handle = 0

   type :: exchange_type
      type(named_values_reader_type) :: in
      type(named_values_type) :: out
      !> Problem whose handle is the value 'problem'.
      type(problem_type), pointer :: problem => null()
      !> Object on the heap that another language will hold, and its kind.
      class(*), pointer :: made => null()
      character(len=:), allocatable :: kind
      !> Results of many operations: 'text', and 'values', whose columns are rows in Python.
      character(len=:), allocatable :: text
      real(wp), allocatable :: values(:, :)
      type(error_type), allocatable :: error
   contains
      procedure :: open, give, close, places, threads, crystals, simulations, &
         & refuse => refuse_operation
   end type exchange_type

contains

   !> Register an object on the heap; `release_object` frees it.
   subroutine register_object(object, kind, handle)
      class(*), pointer, intent(in) :: object
      !> Kind for messages: 'surrogate', 'posterior', ..
      character(len=*), intent(in) :: kind
      !> Handle of the object, above 0.
      integer(i8), intent(out) :: handle
      type(entry_type), allocatable :: larger(:)
      integer :: i

      !$omp critical (object_registry)
      if (.not. allocated(entries)) allocate (entries(16))
      i = index_of(0_i8)
      if (i == 0) then
         i = size(entries) + 1
         allocate (larger(2*size(entries)))
         larger(:i - 1) = entries
         call move_alloc(larger, entries)
      end if
      last_handle = last_handle + 1
      handle = last_handle
      entries(i)%handle = handle
      entries(i)%kind = kind
      entries(i)%object => object
      !$omp end critical (object_registry)
   end subroutine register_object

   !> Index of the entry of a handle; 0 if there is none.
   integer function index_of(handle)
      integer(i8), intent(in) :: handle

      index_of = 0
      if (allocated(entries)) index_of = findloc(entries%handle, handle, 1)
   end function index_of

   !> Find the object of a handle, which must be of this kind.
   subroutine find_object(handle, kind, object, error)
      integer(i8), intent(in) :: handle
      character(len=*), intent(in) :: kind
      class(*), pointer, intent(out) :: object
      type(error_type), allocatable, intent(out) :: error
      integer :: i

      object => null()
      i = 0
      !$omp critical (object_registry)
      if (handle > 0) i = index_of(handle)
      if (i > 0) then
         if (entries(i)%kind == kind) object => entries(i)%object
      end if
      !$omp end critical (object_registry)
      if (.not. associated(object)) then
         call refuse(error, 'the '//kind//' does not exist any more (handle '//to_text(handle) &
            & //' was freed, or is of another kind or process)')
      end if
   end subroutine find_object

   !> Free the object of a handle; one that was freed before is ignored.
   subroutine release_object(handle)
      integer(i8), intent(in) :: handle
      class(*), pointer :: object
      integer :: i

      object => null()
      !$omp critical (object_registry)
      ! A free entry has the handle 0 and no object.
      i = index_of(handle)
      if (i > 0) then
         object => entries(i)%object
         entries(i)%handle = 0
         entries(i)%object => null()
      end if
      !$omp end critical (object_registry)
      if (associated(object)) deallocate (object)
   end subroutine release_object

   !> Read the values of a `request`, and find the problem among them.
   subroutine open(self, request)
      class(exchange_type), intent(inout) :: self
      integer(c_int64_t), intent(in), target, contiguous :: request(:)
      class(*), pointer :: object

      call c_f_pointer(c_loc(request), self%in%bytes, [8*size(request, kind=i8)])
      if (.not. self%in%has('problem')) return
      call find_object(int(self%in%integer('problem'), i8), 'problem', object, self%error)
      if (allocated(self%error)) return
      select type (object)
      type is (problem_type)
         self%problem => object
      end select
   end subroutine open

   !> Return an object of a `kind` to the other language; after an error it is freed.
   subroutine give(self, object, kind)
      class(exchange_type), intent(inout) :: self
      !> Object on the heap.
      class(*), intent(in), target :: object
      character(len=*), intent(in) :: kind

      self%made => object
      self%kind = kind
   end subroutine give

   !> Put all results into `out`, or after an error only where and what it is, and set the `status`
   !> of the operation.
   subroutine close(self, status)
      class(exchange_type), intent(inout) :: self
      integer, intent(out) :: status
      integer(i8) :: handle

      if (.not. allocated(self%error) .and. allocated(self%in%error)) self%error = self%in%error
      status = 0
      if (allocated(self%error)) then
         status = self%error%status
         self%out%filled = 0
         call self%out%put('message', self%error%message)
         call self%out%put('file', self%error%file)
         call self%out%put('group', trim(self%error%group))
         call self%out%put('variable', trim(self%error%variable))
         if (associated(self%made)) deallocate (self%made)
         return
      end if
      if (associated(self%made)) then
         call register_object(self%made, self%kind, handle)
         call self%out%put('handle', int(handle))
      end if
      if (allocated(self%text)) call self%out%put('text', self%text)
      if (allocated(self%values)) call self%out%put('values', self%values)
   end subroutine close

   !> Folders in which surrogates are searched.
   function places(self)
      class(exchange_type), intent(inout) :: self
      type(places_type) :: places

      ! A function of deferred length in a structure constructor makes gfortran 12 allocate one byte
      ! for it.
      places%output = self%in%text('output')
      places%folder = self%in%text('folder')
      places%data_folder = self%in%text('data_folder')
      places%shipped = self%in%text('shipped')
   end function places

   !> Number of threads that the value 'threads' requests.
   integer function threads(self)
      class(exchange_type), intent(inout) :: self

      threads = thread_count(self%in%integer('threads'))
   end function threads

   !> Stiffnesses (GPa) of the problem, not copied, or those of the value 'stiffness'.
   function crystals(self, euler_deg)
      class(exchange_type), intent(inout) :: self
      !> Bunge-Euler angles from the same source, degrees.
      real(wp), pointer, intent(out), optional :: euler_deg(:, :)
      real(wp), pointer :: crystals(:, :, :)

      if (associated(self%problem)) then
         crystals => self%problem%data%crystals%stiffness
         if (present(euler_deg)) euler_deg => self%problem%data%crystals%euler_deg
      else
         crystals => self%in%matrices('stiffness')
         if (present(euler_deg)) euler_deg => self%in%columns('euler_deg', 3)
      end if
   end function crystals

   !> Simulated moduli, with their derivatives if the values have them.
   type(simulations_type) function simulations(self, n_constants)
      class(exchange_type), intent(inout) :: self
      !> Of the class of the crystals.
      integer, intent(in) :: n_constants

      simulations = values_alone(self%in%columns('constants', n_constants), &
         & self%in%columns('euler_deg', 3), self%in%reals('modulus_gpa'))
      if (self%in%has('by_stiffness')) then
         simulations%by_stiffness = self%in%columns('by_stiffness', n_derivatives)
      end if
   end function simulations

   !> Raise the error of an operation whose name is unknown.
   subroutine refuse_operation(self, operation)
      class(exchange_type), intent(inout) :: self
      character(len=*), intent(in) :: operation

      call refuse(self%error, 'no operation is named '//operation)
   end subroutine refuse_operation

end module exchange
