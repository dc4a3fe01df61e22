! Objects that Python holds, for f2py. status: 0 done, 1 failure, 2 bad input; message: the reason, blank on success.

!> Give back the memory of an object of any kind; a handle that is not known any more does no harm.
subroutine object_release(handle)
   use, intrinsic :: iso_c_binding, only: c_int64_t
   use object_registry, only: release_object
   implicit none
   integer(c_int64_t), intent(in) :: handle

   call release_object(handle)
end subroutine object_release

!> The JSON document of an object of a kind, or of the settings (see `object_documents`): a text of full_length bytes, which is
!> given if there is room for them, `length`.
subroutine object_document(handle, kind, length, text, full_length, status, message)
   use described_values, only: described_values_type
   use interoperation, only: c_char, c_int, c_int64_t, error_to_status, error_type
   use object_documents, only: describe_object
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: kind
   integer(c_int), intent(in) :: length
   character(kind=c_char, len=1), intent(out) :: text(length)
   integer(c_int), intent(out) :: full_length, status
   character(len=4096), intent(out) :: message
   type(described_values_type) :: visitor
   type(error_type), allocatable :: error

   text = ' '
   full_length = 0
   call describe_object(handle, kind, visitor, error)
   call error_to_status(error, status, message)
   if (status /= 0) return
   full_length = len(visitor%document%text())
   if (full_length <= length) text(:full_length) = transfer(visitor%document%text(), text, full_length)
end subroutine object_document

!> The values of one array, by its label, of an object of this kind; the document gives the length.
subroutine object_values(handle, kind, label, length, values, status, message)
   use described_values, only: described_values_type
   use errors, only: raise
   use interoperation, only: c_double, c_int, c_int64_t, error_to_status, error_type
   use object_documents, only: describe_object
   implicit none
   integer(c_int64_t), intent(in) :: handle
   character(len=*), intent(in) :: kind, label
   integer(c_int), intent(in) :: length
   real(c_double), intent(out) :: values(length)
   integer(c_int), intent(out) :: status
   character(len=4096), intent(out) :: message
   type(described_values_type) :: visitor
   type(error_type), allocatable :: error

   values = 0
   visitor%wanted = label
   call describe_object(handle, kind, visitor, error)
   if (.not. allocated(error)) then
      if (.not. allocated(visitor%values)) allocate (visitor%values(0))
      if (size(visitor%values) /= length) then
         call raise(error, 'the '//kind//' has no '//label//' of this length')
      else
         values = visitor%values
      end if
   end if
   call error_to_status(error, status, message)
end subroutine object_values
