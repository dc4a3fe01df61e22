!> The objects of Step 1 that another language holds: each found again by its handle.
module surrogate_handles
   use abstract_basis, only: basis_type
   use bases, only: describe_basis
   use described_values, only: described_values_type
   use errors, only: error_type
   use kinds, only: i8
   use object_registry, only: find_object
   use surrogate_file, only: exchange_surrogate
   use surrogate_learner, only: describe_learner, learner_type
   use surrogate_model, only: surrogate_type
   implicit none
   private
   public :: find_basis, find_surrogate_object, find_learner, describe_object

contains

   subroutine find_basis(handle, basis, error)
      integer(i8), intent(in) :: handle
      class(basis_type), pointer, intent(out) :: basis
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      basis => null()
      call find_object(handle, 'basis', object, error)
      if (allocated(error)) return
      select type (object)
      class is (basis_type)
         basis => object
      end select
   end subroutine find_basis

   subroutine find_surrogate_object(handle, surrogate, error)
      integer(i8), intent(in) :: handle
      type(surrogate_type), pointer, intent(out) :: surrogate
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      surrogate => null()
      call find_object(handle, 'surrogate', object, error)
      if (allocated(error)) return
      select type (object)
      type is (surrogate_type)
         surrogate => object
      end select
   end subroutine find_surrogate_object

   subroutine find_learner(handle, learner, error)
      integer(i8), intent(in) :: handle
      type(learner_type), pointer, intent(out) :: learner
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      learner => null()
      call find_object(handle, 'learner', object, error)
      if (allocated(error)) return
      select type (object)
      type is (learner_type)
         learner => object
      end select
   end subroutine find_learner

   !> The numbers and texts of an object.
   subroutine describe_object(handle, kind, visitor, error)
      integer(i8), intent(in) :: handle
      !> 'basis', 'surrogate' or 'learner'.
      character(len=*), intent(in) :: kind
      type(described_values_type), intent(inout) :: visitor
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      call find_object(handle, kind, object, error)
      if (allocated(error)) return
      call visitor%document%begin_object()
      select type (object)
      class is (basis_type)
         call describe_basis(object, visitor)
      type is (surrogate_type)
         call exchange_surrogate(object, visitor)
      type is (learner_type)
         call describe_learner(object, visitor)
      end select
      call visitor%document%end_object()
   end subroutine describe_object
end module surrogate_handles
