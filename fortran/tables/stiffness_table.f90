!> A known stiffness with its covariance, such as one from density functional theory. The CSV has a
!> column `row` and one for each constant of the class, the row 'mean' (GPa), and a row of the
!> covariance (GPa²) for each constant, in any order. Or the text is the matrix (GPa), 6 x 6 numbers
!> or the 21 of its upper triangle, whose constants have one relative standard deviation.
module stiffness_table
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: check_stiffness
   use errors, only: error_type, prefix_error, refuse
   use files, only: printable
   use kinds, only: wp
   use linear_algebra, only: cholesky_factor
   use point_tables, only: stiffness_most
   use tables, only: parse_table, table_type
   use text, only: join, newline, number_ok, read_real, to_text
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
   subroutine new_stiffness_table(content, relative_sd, class, self, error)
      !> Text of the file.
      character(len=*), intent(in) :: content
      !> Of each constant of a matrix; unallocated for a table.
      real(wp), allocatable, intent(in) :: relative_sd
      type(crystal_class_type), intent(in) :: class
      type(stiffness_table_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      type(table_type) :: table
      character(len=:), allocatable :: page

      if (allocated(relative_sd)) then
         call write_matrix(content, relative_sd, class, page, error)
      else if (scan(content, '+-.0123456789[') == verify(content, ' '//newline)) then
         call refuse(error, 'a matrix needs stiffness_relative_sd, the standard deviation of each ' &
            & //'constant relative to its value')
      else
         page = content
      end if
      if (.not. allocated(error)) call parse_table(page, table, error)
      if (.not. allocated(error)) call take_table(table, class, self, error)
   end subroutine new_stiffness_table

   !> Write the table of a matrix. Of entries that are equal by symmetry the first one counts.
   subroutine write_matrix(content, relative_sd, class, page, error)
      !> Numbers separated by blanks, commas or brackets.
      character(len=*), intent(in) :: content
      real(wp), intent(in) :: relative_sd
      type(crystal_class_type), intent(in) :: class
      !> Text of the table.
      character(len=:), allocatable, intent(out) :: page
      type(error_type), allocatable, intent(out) :: error
      character(len=*), parameter :: marks = ' ,[]'//achar(9)//achar(13)//newline
      real(wp), parameter :: tolerance = 0.01_wp
      real(wp) :: values(37), c(6, 6), right(6, 6), mean(class%n_constants)
      integer :: first, last, i, j, n, outcome

      values = 0.0_wp
      n = 0
      last = 0
      do while (n < size(values))
         first = last + verify(content(last + 1:), marks)
         if (first == last) exit
         last = first - 2 + scan(content(first:)//newline, marks)
         n = n + 1
         call read_real(content(first:last), values(n), outcome)
         if (outcome /= number_ok) then
            call refuse(error, ''''//printable(content(first:last))//''' is not a number; ' &
               & //'stiffness_relative_sd needs a matrix of 6 x 6 numbers')
            return
         end if
      end do
      if (n /= 21 .and. n /= 36) then
         call refuse(error, to_text(n)//' numbers; a matrix has 36, or 21 in its upper triangle')
         return
      end if
      c = reshape(values, [6, 6])
      first = 0
      do i = 1, merge(6, 0, n == 21)
         c(i:, i) = values(first + 1:first + 7 - i)
         c(i, i:) = c(i:, i)
         first = first + 7 - i
      end do
      mean = class%constants_of(c)
      right = class%stiffness(mean)
      associate (at => maxloc(abs(c - right)))
         i = at(2)
         j = at(1)
      end associate
      if (abs(c(j, i) - right(j, i)) > tolerance*maxval(abs(c))) then
         call refuse(error, 'row '//to_text(i)//', column '//to_text(j)//': '//to_text(c(j, i)) &
            & //' GPa, where a '//class%name//' crystal has '//to_text(right(j, i)) &
            & //' GPa; allowed within 1 % of the largest entry')
         return
      end if
      page = 'row,'//join(class%constants, ',')//newline//'mean'
      do j = 1, size(mean)
         page = page//','//to_text(mean(j))
      end do
      do i = 1, size(mean)
         page = page//newline//class%constants(i)
         do j = 1, size(mean)
            page = page//','//to_text(merge((relative_sd*mean(i))**2, 0.0_wp, i == j))
         end do
      end do
   end subroutine write_matrix

   !> Read the means and the covariance from the rows of a table.
   subroutine take_table(table, class, self, error)
      type(table_type), intent(in) :: table
      type(crystal_class_type), intent(in) :: class
      type(stiffness_table_type), intent(out) :: self
      type(error_type), allocatable, intent(out) :: error
      character(len=4), dimension(class%n_constants + 1) :: headers, labels
      integer, dimension(class%n_constants + 1) :: column, row
      real(wp), allocatable :: values(:, :)
      integer :: i, j

      self%table = table
      headers = [character(len=4) :: 'row', class%constants]
      labels = [character(len=4) :: 'mean', class%constants]
      column = [(table%find(trim(headers(j))), j=1, size(column))]
      do j = 1, size(column)
         call check(column(j) > 0, 'the column '//trim(headers(j))//' is missing; a '//class%name &
            & //' crystal needs '//join(headers, ', '))
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
      do j = 1, class%n_constants
         call check(abs(self%mean(j)) <= stiffness_most, 'the mean of '//class%constants(j)//', ' &
            & //to_text(self%mean(j))//' GPa, looks like MPa; allowed up to ' &
            & //to_text(stiffness_most)//' GPa')
      end do
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
   end subroutine take_table
end module stiffness_table
