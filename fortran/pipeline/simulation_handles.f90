!> What another language holds of simulations: simulators and indentation models behind handles, made of a problem's &simulation.
module simulation_handles
   use errors, only: error_type
   use fe_indentation, only: indentation_model_type, new_indentation_model
   use kinds, only: i8
   use namelist_file, only: place
   use object_registry, only: find_object, keep_object
   use problem, only: problem_type
   use problem_handles, only: problem_of_handle
   use settings_groups, only: simulation_settings_type
   use simulate, only: new_simulator, simulator_type
   implicit none
   private
   public :: simulation_of_handle, new_model_handle, model_of_handle, new_simulator_handle, simulator_of_handle

   type :: held_simulator_type
      class(simulator_type), allocatable :: simulator
   end type held_simulator_type

contains

   !> &simulation of a problem; `mesh` takes the place of its own, unless it is ''.
   subroutine simulation_of_handle(problem, mesh, settings, error)
      !> Handle of a problem.
      integer(i8), intent(in) :: problem
      character(len=*), intent(in) :: mesh
      type(simulation_settings_type), intent(out) :: settings
      type(error_type), allocatable, intent(out) :: error
      type(problem_type), pointer :: self

      call problem_of_handle(problem, self, error)
      if (allocated(error)) return
      settings = self%settings%simulation
      if (len_trim(mesh) > 0) settings%mesh = trim(mesh)
   end subroutine simulation_of_handle

   !> Make the indentation model of a problem, `mesh` in place of its own unless it is ''; its handle is 0 if there is none.
   subroutine new_model_handle(problem, mesh, handle, error)
      integer(i8), intent(in) :: problem
      character(len=*), intent(in) :: mesh
      integer(i8), intent(out) :: handle
      type(error_type), allocatable, intent(out) :: error
      type(simulation_settings_type) :: settings
      type(indentation_model_type), pointer :: model

      allocate (model)
      call simulation_of_handle(problem, mesh, settings, error)
      if (.not. allocated(error)) call new_indentation_model(settings, model, error)
      call name_origin(problem, error)
      call keep_object(model, 'indentation', error, handle)
   end subroutine new_model_handle

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

   !> Make the simulator of a problem, `mesh` in place of its own unless it is ''; its handle is 0 if there is none.
   subroutine new_simulator_handle(problem, mesh, handle, error)
      integer(i8), intent(in) :: problem
      character(len=*), intent(in) :: mesh
      integer(i8), intent(out) :: handle
      type(error_type), allocatable, intent(out) :: error
      type(simulation_settings_type) :: settings
      type(held_simulator_type), pointer :: held

      allocate (held)
      call simulation_of_handle(problem, mesh, settings, error)
      if (.not. allocated(error)) call new_simulator(settings, held%simulator, error)
      call name_origin(problem, error)
      call keep_object(held, 'simulator', error, handle)
   end subroutine new_simulator_handle

   subroutine simulator_of_handle(handle, simulator, error)
      integer(i8), intent(in) :: handle
      class(simulator_type), pointer, intent(out) :: simulator
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

   !> Say in the message where the settings come from.
   subroutine name_origin(problem, error)
      integer(i8), intent(in) :: problem
      type(error_type), allocatable, intent(inout) :: error
      type(problem_type), pointer :: self
      type(error_type), allocatable :: unknown

      if (.not. allocated(error)) return
      call problem_of_handle(problem, self, unknown)
      if (associated(self)) error%message = place(self%path, 'simulation', '')//error%message
   end subroutine name_origin
end module simulation_handles
