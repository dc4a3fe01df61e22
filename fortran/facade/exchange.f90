!> What an operation takes and gives: named values, and an object that it made.
module exchange
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: i8
   use named_values, only: named_values_reader_type, named_values_type
   use object_registry, only: find_object, register_object
   use parallelism, only: thread_count
   use problem, only: problem_type
   use surrogate_model, only: surrogate_type
   implicit none
   private
   public :: exchange_type

   type :: exchange_type
      type(named_values_reader_type) :: in
      type(named_values_type) :: out
      !> An object of the heap that another language is to hold, and its kind.
      class(*), pointer :: made => null()
      character(len=:), allocatable :: kind
   contains
      procedure :: give
      procedure :: keep
      procedure :: problem => problem_of
      procedure :: surrogate => surrogate_of
      procedure :: threads
      procedure, nopass :: refuse
   end type exchange_type

contains

   !> Let another language hold an object of a `kind`, which is freed after an error.
   subroutine give(self, object, kind)
      class(exchange_type), intent(inout) :: self
      !> Of the heap.
      class(*), intent(in), target :: object
      character(len=*), intent(in) :: kind

      self%made => object
      self%kind = kind
   end subroutine give

   !> Register the object that was made, as the value 'handle'.
   subroutine keep(self)
      class(exchange_type), intent(inout) :: self
      integer(i8) :: handle

      call register_object(self%made, self%kind, handle)
      call self%out%put('handle', int(handle))
   end subroutine keep

   !> The problem whose handle is a value, 'problem' if no name is given.
   function problem_of(self, error, name) result(problem)
      class(exchange_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=*), intent(in), optional :: name
      type(problem_type), pointer :: problem
      class(*), pointer :: object

      problem => null()
      if (present(name)) then
         call find_object(self%in%integer(name), 'problem', object, error)
      else
         call find_object(self%in%integer('problem'), 'problem', object, error)
      end if
      if (allocated(error)) return
      select type (object)
      type is (problem_type)
         problem => object
      end select
   end function problem_of

   !> The surrogate whose handle is the value 'surrogate'.
   function surrogate_of(self, error) result(surrogate)
      class(exchange_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      type(surrogate_type), pointer :: surrogate
      class(*), pointer :: object

      surrogate => null()
      call find_object(self%in%integer('surrogate'), 'surrogate', object, error)
      if (allocated(error)) return
      select type (object)
      type is (surrogate_type)
         surrogate => object
      end select
   end function surrogate_of

   !> How many threads the value 'threads' asks for.
   integer function threads(self)
      class(exchange_type), intent(inout) :: self

      threads = thread_count(int(self%in%integer('threads')))
   end function threads

   !> There is no operation of this name.
   subroutine refuse(verb, error)
      character(len=*), intent(in) :: verb
      type(error_type), allocatable, intent(out) :: error

      call raise(error, 'no operation is named '//verb, exit_bad_input)
   end subroutine refuse
end module exchange
