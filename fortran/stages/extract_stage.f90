!> `extract`: Step 2, infer the constants from the measurements.
module extract_stage
   use errors, only: error_type
   use analysis_document, only: describe_prior, save_posterior, write_analysis
   use files, only: new_file_type
   use json, only: json_type
   use posterior_diagnostics, only: check_analysis
   use running_command, only: remove_files
   use stage_documents, only: end_document, inputs_of
   use surrogate_loading, only: analysis_stage_type
   use text, only: join, newline, number_text, to_text
   implicit none
   private
   public :: extract_stage_type

   character(len=*), parameter :: draws_name = 'posterior.csv'

   type, extends(analysis_stage_type) :: extract_stage_type
   contains
      procedure :: finish
   end type extract_stage_type

contains

   !> Sample, and write posterior.bin with all numbers, the document, and posterior.csv with the
   !> draws if it is asked for. One of an earlier run is removed.
   subroutine finish(self, page, error)
      class(extract_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error

      call self%analysis%infer(error)
      if (allocated(error)) return
      call check_analysis(self%analysis)
      call write_analysis(self%analysis, page)
      self%warnings = self%analysis%warnings
      call save_posterior(self%analysis, end_document(page, [self%problem%warnings, &
         & self%warnings]), self%output, inputs_of(self%problem, self%groups, self%places), error)
      if (allocated(error)) return
      call remove_files(self%output, draws_name)
      associate (draws => self%problem%settings%sampler%draws)
         if (draws == 'csv' .or. (len(draws) == 0 .and. self%problem%run%is_of_batch)) then
            call write_draws()
         end if
      end associate
      if (allocated(error)) return
      call describe_prior(self%analysis, self%more)
      associate (chains => self%analysis%chains)
         self%done = to_text(size(chains%draws, 3))//' chains of '//to_text(size(chains%draws, 2)) &
            & //' samples'
         if (allocated(chains%estimates)) self%done = self%done//' of independent draws'
      end associate
      self%done = self%done//': '//self%output//'/posterior.bin'

   contains

      !> Write a table with one row for each draw.
      subroutine write_draws()
         type(new_file_type) :: file
         character(len=:), allocatable :: line
         integer :: i, j, chain

         call file%add('chain,draw,'//join(self%analysis%names, ',')//',log_density'//newline)
         associate (chains => self%analysis%chains)
            do chain = 1, size(chains%draws, 3)
               do i = 1, size(chains%draws, 2)
                  line = to_text(chain)//','//to_text(i)
                  do j = 1, size(self%analysis%names)
                     line = line//','//number_text(chains%draws(j, i, chain))
                  end do
                  call file%add(line//','//number_text(chains%log_density(i, chain))//newline)
               end do
            end do
         end associate
         call file%finish(self%output//'/'//draws_name, error)
      end subroutine write_draws
   end subroutine finish
end module extract_stage
