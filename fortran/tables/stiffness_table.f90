!> A known stiffness with its covariance, such as one from density functional theory. The CSV has a
!> column `row` and one for each constant of the class, the row 'mean' (GPa), and a row of the
!> covariance (GPa²) for each constant, in any order.
module stiffness_table
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, prefix_error, refuse
   use files, only: printable
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use tables, only: parse_table, table_type
   use text, only: join, to_text
   implicit none
   private
   public :: stiffness_table_type, new_stiffness_table

   type :: stiffness_table_type
      !> The table as it was written.
      type(table_type) :: table
      !> Means, GPa, (n_constants), and covariance, GPa², (n_constants, n_constants), in the order
      !> of the class.
      real(wp), allocatable :: mean(:), covariance(:, :)
   end type stiffness_table_type

contains

   !> Read the means and the covariance.
   subroutine new_stiffness_table(content, class, self, error)
      !> Text of the file.
      character(len=*), intent(in) :: content
      type(crystal_class_type), intent(in) :: class
      type(stiffness_table_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      !> Above all constants of solids, GPa.
      real(wp), parameter :: largest = 1300.0_wp
      integer :: i, j

      call parse_table(content, self%table, error)
      if (.not. allocated(error)) call read_rows(self%table)
      if (allocated(error)) return
      i = maxloc(abs(self%mean), dim=1)
      call check(abs(self%mean(i)) < largest, class%constants(i)//' is '//to_text(self%mean(i)) &
         & //' GPa, above that of diamond, 1080; are these kBar (10 kBar = 1 GPa) or MPa?')
      if (allocated(error)) return
      call check_stiffness(class%stiffness(self%mean), error)
      call prefix_error(error, 'the mean: ')
      if (.not. allocated(error)) call check_covariance()

   contains

      !> Refuse the table unless something is `right`, or it was refused before.
      subroutine check(right, message)
         logical, intent(in) :: right
         character(len=*), intent(in) :: message

         if (.not. (right .or. allocated(error))) call refuse(error, message)
      end subroutine check

      !> Read the means and the covariance from the rows of a table.
      subroutine read_rows(table)
         type(table_type), intent(in) :: table
         character(len=4), dimension(class%n_constants + 1) :: headers, labels
         integer, dimension(class%n_constants + 1) :: column, row
         real(wp), allocatable :: values(:, :)

         headers = [character(len=4) :: 'row', class%constants]
         labels = [character(len=4) :: 'mean', class%constants]
         column = [(table%find(trim(headers(j))), j=1, size(column))]
         do j = 1, size(column)
            call check(column(j) > 0, 'the column '//trim(headers(j))//' is missing; a ' &
               & //class%name//' crystal needs '//join(headers, ', ') &
               & //'; a matrix needs stiffness_relative_sd')
         end do
         do j = 1, table%columns
            call check(any(column == j), 'the column '//printable(table%name(j))//' is none of ' &
               & //join(headers, ', ')//', the constants of a '//class%name//' crystal')
         end do
         if (allocated(error)) return
         row = 0
         do i = 1, table%rows
            j = findloc(labels == table%cell(column(1), i), .true., dim=1)
            if (j == 0) cycle
            call check(row(j) == 0, 'line '//to_text(table%line(i))//': the row '//trim(labels(j)) &
               & //' is there twice')
            row(j) = i
         end do
         do j = 1, size(row)
            call check(row(j) > 0, 'the row '//trim(labels(j))//' is missing; the rows are mean ' &
               & //'(GPa) and those of the covariance (GPa^2), '//join(class%constants, ', '))
         end do
         call check(table%rows == size(row), to_text(table%rows)//' rows; '//to_text(size(row)) &
            & //' are needed: '//join(labels, ', '))
         if (allocated(error)) return
         call table%numbers(column(2:), values, error)
         if (allocated(error)) return
         self%mean = values(:, row(1))
         self%covariance = transpose(values(:, row(2:)))
      end subroutine read_rows

      !> Refuse a covariance that is not symmetric, apart from rounding, or not positive definite.
      subroutine check_covariance()
         real(wp), parameter :: tolerance = 1.0e-3_wp
         real(wp) :: correlation(class%n_constants, class%n_constants)

         associate (c => self%covariance, names => class%constants)
            do i = 1, class%n_constants
               call check(c(i, i) > 0.0_wp, 'the variance of '//names(i)//' is ' &
                  & //to_text(c(i, i))//' GPa^2; above 0 is allowed')
            end do
            if (allocated(error)) return
            do j = 1, class%n_constants
               do i = 1, class%n_constants
                  correlation(i, j) = c(i, j)/sqrt(c(i, i))/sqrt(c(j, j))
                  call check(abs(c(i, j) - c(j, i)) <= tolerance*sqrt(c(i, i))*sqrt(c(j, j)), &
                     & 'the covariance is not symmetric: '//to_text(c(i, j))//' GPa^2 in row ' &
                     & //names(i)//', column '//names(j)//', but '//to_text(c(j, i)) &
                     & //' GPa^2 in row '//names(j)//', column '//names(i))
               end do
            end do
            if (allocated(error)) return
            correlation = 0.5_wp*(correlation + transpose(correlation))
            c = 0.5_wp*(c + transpose(c))
         end associate
         call cholesky_factor(correlation, error)
         if (.not. allocated(error)) return
         deallocate (error)
         call refuse(error, 'the covariance is not positive definite; it must say that no ' &
            & //'combination of the constants is known exactly')
      end subroutine check_covariance
   end subroutine new_stiffness_table
end module stiffness_table
