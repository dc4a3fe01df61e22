!> Operations on analyses: Step 2 of a problem with a surrogate.
module analysis_operations
   use analysis, only: analysis_type
   use analysis_document, only: put_analysis, write_analysis
   use exchange, only: exchange_type
   use further_measurements, only: suggest_measurements
   use json, only: json_type
   use posterior_diagnostics, only: check_analysis
   use planned_measurements, only: plan_measurements
   use stage_documents, only: end_document
   implicit none
   private
   public :: use_analysis

contains

   subroutine use_analysis(verb, self, x)
      character(len=*), intent(in) :: verb
      type(analysis_type), intent(inout) :: self
      type(exchange_type), intent(inout) :: x
      type(json_type) :: page

      select case (verb)
      case ('infer')
         !> -> ..
         call self%infer(x%error)
         if (allocated(x%error)) return
         call check_analysis(self)
         call page%begin_object('')
         call write_analysis(self, page)
         call put_analysis(self, end_document(page, [self%problem%warnings, self%warnings]), x%out)
      case ('next')
         !> points -> text
         ! The points are draws, which have the factor on the sds itself, not its logarithm.
         call self%prepare(x%error)
         if (allocated(x%error)) return
         call page%begin_object('')
         call suggest_measurements(self, x%in%columns('points', self%posterior%dimension), page, &
            & x%error)
         x%text = end_document(page, [self%problem%warnings, self%warnings])
      case ('plan')
         !> -> text
         call page%begin_object('')
         call plan_measurements(self, page, x%error)
         x%text = end_document(page, self%problem%warnings)
      case default
         call x%refuse(verb)
      end select
   end subroutine use_analysis
end module analysis_operations
