!> What another language holds of simulations: simulators and indentation models behind handles, made of a problem.
module simulation_handles
   use errors, only: error_type
   use fe_indentation, only: indentation_model_type, new_indentation_model
   use kinds, only: i8
   use namelist_file, only: place
   use object_registry, only: find_object, keep_object
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use simulate, only: new_simulator, simulator_type
   implicit none
   private
   public :: new_simulation_handle, model_of_handle, simulator_of_handle

   type :: held_simulator_type
      type(simulator_type), allocatable :: simulator
   end type held_simulator_type

contains

   !> Make what a problem asks for; the handle is 0 after an error.
   subroutine new_simulation_handle(problem, kind, handle, error)
      !> Handle of a problem.
      integer(i8), intent(in) :: problem
      !> 'indentation', the model of finite elements, or 'simulator'.
      character(len=*), intent(in) :: kind
      integer(i8), intent(out) :: handle
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: self
      type(indentation_model_type), pointer :: model
      type(held_simulator_type), pointer :: held

      handle = 0
      call problem_of_handle(problem, self, error)
      if (allocated(error)) return
      if (kind == 'indentation') then
         allocate (model)
         call new_indentation_model(self%settings, model, error)
         call keep_object(model, kind, error, handle)
      else
         allocate (held)
         call new_simulator(self%settings, held%simulator, error)
         call keep_object(held, kind, error, handle)
      end if
      if (allocated(error)) error%message = place(self%path, 'simulation', '')//error%message
   end subroutine new_simulation_handle

   subroutine model_of_handle(handle, model, error)
      integer(i8), intent(in) :: handle
      type(indentation_model_type), pointer, intent(out) :: model
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      model => null()
      call find_object(handle, 'indentation', object, error)
      if (allocated(error)) return
      select type (object)
      type is (indentation_model_type)
         model => object
      end select
   end subroutine model_of_handle

   subroutine simulator_of_handle(handle, simulator, error)
      integer(i8), intent(in) :: handle
      type(simulator_type), pointer, intent(out) :: simulator
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      simulator => null()
      call find_object(handle, 'simulator', object, error)
      if (allocated(error)) return
      select type (object)
      type is (held_simulator_type)
         simulator => object%simulator
      end select
   end subroutine simulator_of_handle
end module simulation_handles
