!> The part of the document of `extract` that lists other models of the measurements.
module diagnosis_document
   use json, only: json_type
   use rivals, only: diagnosis_type
   implicit none
   private
   public :: write_diagnosis

contains

   !> Write what else explains the measurements, the best first.
   subroutine write_diagnosis(page, diagnosis)
      type(json_type), intent(inout) :: page
      type(diagnosis_type), intent(in) :: diagnosis
      integer :: i, j

      call page%begin_array('diagnosis')
      do i = 1, size(diagnosis%rivals)
         associate (rival => diagnosis%rivals(i))
            call page%begin_object()
            call page%put('explanation', rival%explanation)
            call page%put('group', rival%group)
            call page%put('log_odds', rival%log_odds)
            call page%begin_object('constants')
            do j = 1, size(rival%mean)
               call page%put_numbers('mean, sd', [rival%mean(j), rival%sd(j)], rival%names(j))
            end do
            call page%end_object()
            call page%put('remedy', rival%remedy)
            call page%end_object()
         end associate
      end do
      call page%end_array()
   end subroutine write_diagnosis

end module diagnosis_document
