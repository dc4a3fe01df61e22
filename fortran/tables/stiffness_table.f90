!> A whole stiffness that is known with its covariance, as from density functional theory: a CSV with a column `row` and one for each
!> constant of the class; the row 'mean' (GPa) and one row of the covariance (GPa²) for each constant, in any order.
module stiffness_table
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, exit_bad_input, raise
   use files, only: printable
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use tables, only: parse_table, read_table, table_type
   use text, only: join, to_text
   implicit none
   private
   public :: stiffness_table_type, read_stiffness_table, stiffness_table_of_text

   type :: stiffness_table_type
      !> The cells as written.
      type(table_type) :: table
      !> In the order of the class: GPa (n_constants), GPa² (n_constants, n_constants).
      real(wp), allocatable :: mean(:), covariance(:, :)
   end type stiffness_table_type

   !> GPa.
   real(wp), parameter :: stiffness_most = 5000.0_wp

contains

   !> Read a file.
   subroutine read_stiffness_table(path, prefix, class, self, error)
      !> With `prefix` messages begin.
      character(len=*), intent(in) :: path, prefix
      type(crystal_class_type), intent(in) :: class
      type(stiffness_table_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error

      call read_table(path, self%table, error)
      if (.not. allocated(error)) call read_rows(self, class, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine read_stiffness_table

   !> The same from a text that is no file.
   subroutine stiffness_table_of_text(page, prefix, class, self, error)
      !> CSV, and with what messages begin.
      character(len=*), intent(in) :: page, prefix
      type(crystal_class_type), intent(in) :: class
      type(stiffness_table_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error

      call parse_table(page, self%table, error)
      if (.not. allocated(error)) call read_rows(self, class, error)
      if (allocated(error)) error%message = prefix//error%message
   end subroutine stiffness_table_of_text

   subroutine read_rows(self, class, error)
      type(stiffness_table_type), intent(inout) :: self
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      integer :: column(0:class%n_constants), place, i, j, k

      k = class%n_constants
      column = [self%table%find('row'), (self%table%find(class%constants(j)), j=1, k)]
      do j = 0, k
         if (column(j) > 0) cycle
         call raise(error, 'the column '//label(j, 'row')//' is missing; a '//class%name//' crystal needs row, ' &
            & //join(class%constants, ', '), exit_bad_input)
         return
      end do
      do j = 1, self%table%columns
         if (any(column == j)) cycle
         call raise(error, 'the column '//printable(self%table%name(j))//' is none of row, '//join(class%constants, ', ') &
            & //', the constants of a '//class%name//' crystal', exit_bad_input)
         return
      end do
      allocate (self%mean(k), self%covariance(k, k))
      do i = 0, k
         call find_row(label(i, 'mean'), place)
         if (allocated(error)) return
         do j = 1, k
            if (i == 0) call self%table%number(column(j), place, self%mean(j), error)
            if (i > 0) call self%table%number(column(j), place, self%covariance(i, j), error)
            if (allocated(error)) return
         end do
      end do
      if (self%table%rows /= k + 1) call raise(error, to_text(self%table%rows)//' rows; '//to_text(k + 1) &
         & //' are needed: mean, '//join(class%constants, ', '), exit_bad_input)
      if (.not. allocated(error)) call check_mean(self, class, error)
      if (.not. allocated(error)) call check_covariance(self, class, error)

   contains

      !> The name of a constant, or what stands for 0.
      pure function label(number, zeroth) result(name)
         integer, intent(in) :: number
         character(len=*), intent(in) :: zeroth
         character(len=:), allocatable :: name

         name = zeroth
         if (number > 0) name = class%constants(number)
      end function label

      subroutine find_row(name, row)
         character(len=*), intent(in) :: name
         integer, intent(out) :: row
         integer :: r

         row = 0
         do r = 1, self%table%rows
            if (self%table%cell(column(0), r) /= name) cycle
            if (row > 0) call raise(error, 'line '//to_text(self%table%line(r))//': the row '//name//' is there twice', &
               & exit_bad_input)
            if (row > 0) return
            row = r
         end do
         if (row == 0) call raise(error, 'the row '//name//' is missing; the rows are mean (GPa) and those of the covariance ' &
            & //'(GPa^2), '//join(class%constants, ', '), exit_bad_input)
      end subroutine find_row
   end subroutine read_rows

   subroutine check_mean(self, class, error)
      type(stiffness_table_type), intent(in) :: self
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      integer :: j

      do j = 1, class%n_constants
         if (abs(self%mean(j)) <= stiffness_most) cycle
         call raise(error, 'the mean of '//class%constants(j)//', '//to_text(self%mean(j))//' GPa, looks like MPa; allowed up to ' &
            & //to_text(stiffness_most)//' GPa', exit_bad_input)
         return
      end do
      call check_stiffness(class%stiffness(self%mean), error)
      if (allocated(error)) error%message = 'the mean: '//error%message
   end subroutine check_mean

   !> Symmetric to the digits that people write, and positive definite.
   subroutine check_covariance(self, class, error)
      type(stiffness_table_type), intent(inout) :: self
      type(crystal_class_type), intent(in) :: class
      type(error_type), allocatable, intent(out) :: error
      real(wp), parameter :: tolerance = 1.0e-3_wp
      real(wp) :: correlation(class%n_constants, class%n_constants)
      integer :: i, j

      associate (c => self%covariance, names => class%constants)
         do i = 1, class%n_constants
            if (c(i, i) > 0.0_wp) cycle
            call raise(error, 'the variance of '//names(i)//' is '//to_text(c(i, i))//' GPa^2; above 0 is allowed', exit_bad_input)
            return
         end do
         do j = 1, class%n_constants
            do i = 1, class%n_constants
               correlation(i, j) = c(i, j)/sqrt(c(i, i))/sqrt(c(j, j))
               if (abs(c(i, j) - c(j, i)) <= tolerance*sqrt(c(i, i))*sqrt(c(j, j))) cycle
               call raise(error, 'the covariance is not symmetric: '//to_text(c(i, j))//' GPa^2 in row '//names(i)//', column ' &
                  & //names(j)//', but '//to_text(c(j, i))//' GPa^2 in row '//names(j)//', column '//names(i), exit_bad_input)
               return
            end do
         end do
         correlation = 0.5_wp*(correlation + transpose(correlation))
         c = 0.5_wp*(c + transpose(c))
      end associate
      call cholesky_factor(correlation, error)
      if (.not. allocated(error)) return
      deallocate (error)
      call raise(error, 'the covariance is not positive definite; it must say that no combination of the constants is known ' &
         & //'exactly', exit_bad_input)
   end subroutine check_covariance
end module stiffness_table
