!> What an operation takes and gives: named values, a problem whose handle is among them, and an object that it made.
module exchange
   use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int64_t, c_loc
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: i8, wp
   use named_values, only: named_values_reader_type, named_values_type
   use object_registry, only: find_object, register_object
   use parallelism, only: thread_count
   use problem, only: problem_type
   use surrogate_lookup, only: places_type
   implicit none
   private
   public :: exchange_type

   type :: exchange_type
      type(named_values_reader_type) :: in
      type(named_values_type) :: out
      !> Of the value 'problem', a handle.
      type(problem_type), pointer :: problem => null()
      !> An object of the heap that another language is to hold, and its kind.
      class(*), pointer :: made => null()
      character(len=:), allocatable :: kind
      !> What many operations give: 'text', and 'values', whose columns are rows there.
      character(len=:), allocatable :: text
      real(wp), allocatable :: values(:, :)
      type(error_type), allocatable :: error
   contains
      procedure :: open
      procedure :: give
      procedure :: close
      procedure :: places
      procedure :: threads
      procedure :: crystals
      procedure :: refuse
   end type exchange_type

contains

   !> Take the values of a `request`, and find the problem among them.
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

   !> Let another language hold an object of a `kind`, which is freed after an error.
   subroutine give(self, object, kind)
      class(exchange_type), intent(inout) :: self
      !> Of the heap.
      class(*), intent(in), target :: object
      character(len=*), intent(in) :: kind

      self%made => object
      self%kind = kind
   end subroutine give

   !> Let `out` have all that is given: after an error its 'message' alone. The `status` of the operation.
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
         if (associated(self%made)) deallocate (self%made)
         return
      end if
      if (associated(self%made)) then
         call register_object(self%made, self%kind, handle)
         call self%out%put('handle', int(handle))
      end if
      if (allocated(self%text)) call self%out%put('text', self%text)
      if (allocated(self%values)) call self%out%put_array('values', self%values, shape(self%values))
   end subroutine close

   !> Where surrogates are looked for.
   function places(self)
      class(exchange_type), intent(inout) :: self
      type(places_type) :: places

      ! A function of deferred length in a structure constructor makes gfortran 12 allocate one byte for it.
      places%output = self%in%text('output')
      places%folder = self%in%text('folder')
      places%data_folder = self%in%text('data_folder')
      places%shipped = self%in%text('shipped')
   end function places

   !> How many threads the value 'threads' asks for.
   integer function threads(self)
      class(exchange_type), intent(inout) :: self

      threads = thread_count(self%in%integer('threads'))
   end function threads

   !> Stiffnesses (GPa): those of the problem, which stay where they are, or the value 'stiffness'.
   function crystals(self)
      class(exchange_type), intent(inout) :: self
      real(wp), pointer :: crystals(:, :, :)

      if (associated(self%problem)) then
         crystals => self%problem%crystals%stiffness
      else
         crystals => self%in%matrices('stiffness')
      end if
   end function crystals

   !> There is no operation of this name.
   subroutine refuse(self, operation)
      class(exchange_type), intent(inout) :: self
      character(len=*), intent(in) :: operation

      call raise(self%error, 'no operation is named '//operation, exit_bad_input)
   end subroutine refuse
end module exchange
