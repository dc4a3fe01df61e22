!> What every procedure needs that another language calls: kinds of its numbers, and errors as a status and a message.
module interoperation
   use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int64_t
   use errors, only: error_to_status, error_type
   implicit none
   private
   public :: c_char, c_double, c_int, c_int64_t, error_to_status, error_type
end module interoperation
