!> Builds that another language holds.
module build_handles
   use described_values, only: described_values_type
   use errors, only: error_type
   use kinds, only: i8
   use object_registry, only: find_object
   use step_1, only: build_type
   implicit none
   private
   public :: find_build

contains

   subroutine find_build(handle, build, error)
      integer(i8), intent(in) :: handle
      type(build_type), pointer, intent(out) :: build
      type(error_type), allocatable, intent(out) :: error
      class(*), pointer :: object

      build => null()
      call find_object(handle, 'build', object, error)
      if (allocated(error)) return
      select type (object)
      type is (build_type)
         build => object
      end select
   end subroutine find_build
end module build_handles
