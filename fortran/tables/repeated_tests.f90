!> Combine the tests of one grain (column `grain`), and compare their scatter with their stated sds.
!>
!> The tests of a grain in one group are one measurement: the mean with weights 1/sd², whose sd is
!> (sum of 1/sd²)^-1/2. Their chi-square, the sum of the squared deviations from that mean in sds,
!> has one degree of freedom less than there are tests.
module repeated_tests
   use crystal_class, only: crystal_class_type
   use diagnostics, only: diagnosed_type
   use distinct_directions, only: angle_between, new_region, region_type
   use errors, only: error_type, refuse
   use files, only: printable
   use kinds, only: degree, wp
   use point_tables, only: first_rows, points_type
   use statistics, only: chi_square_above, number_equal
   use text, only: fixed, to_text
   implicit none
   private
   public :: combine_tests, check_scatter, refuse_copied_rows

   !> A less probable scatter gives a warning; for single grains the probability is divided by their
   !> number.
   real(wp), parameter :: improbable = 0.01_wp

contains

   !> Refuse rows that were pasted twice: several rows in succession, of more than one orientation,
   !> whose numbers are all those of earlier rows. Equal rows of one grain are tests with rounded
   !> moduli.
   subroutine refuse_copied_rows(points, error)
      type(points_type), intent(in) :: points
      type(error_type), allocatable, intent(out) :: error
      integer, parameter :: least = 3
      character(len=*), parameter :: count_twice = 'Rows that count twice make the sds of the ' &
         & //'constants too small: remove them'
      integer :: first(points%n), copies(points%n), i, begin, grain

      first = number_equal(reshape([(points%euler_deg(:, i), points%modulus_gpa(i), &
         & points%sd_gpa(i), real(points%group(i), wp), i=1, points%n)], [6, points%n]))
      if (points%n == 0) return
      grain = points%table%find('grain')
      copies = 0
      do i = 1, points%n
         copies(first(i)) = copies(first(i)) + 1
      end do
      ! Some rounded tests are equal by chance, but not all the same number of times.
      i = maxval(copies)
      if (grain == 0 .and. i > 1 .and. count(copies > 0) >= least &
         & .and. all(copies == 0 .or. copies == i) .and. any(abs(points%euler_deg &
         & - spread(points%euler_deg(:, 1), 2, points%n)) > 0.0_wp)) then
         call refuse(error, 'each row is there '//to_text(i) &
            & //' times with the same angles, modulus and sd. '//count_twice)
         return
      end if
      begin = 1
      do i = 2, points%n + 1
         if (i <= points%n) then
            if (first(i) < i .and. first(i) == first(i - 1) + 1 .and. first(i - 1) < i - 1) cycle
         end if
         if (i - begin >= least .and. any(abs(points%euler_deg(:, begin:i - 1) &
            & - spread(points%euler_deg(:, begin), 2, i - begin)) > 0.0_wp)) then
            associate (line => points%table%line)
               call refuse(error, 'lines '//to_text(line(begin))//' to '//to_text(line(i - 1)) &
                  & //' repeat lines '//to_text(line(first(begin)))//' to ' &
                  & //to_text(line(first(i - 1)))//' with the same angles, moduli and sds. ' &
                  & //count_twice)
            end associate
            return
         end if
         begin = i
      end do
   end subroutine refuse_copied_rows

   !> Make each grain of a group one point, in the order of the first tests, which give the
   !> orientations.
   subroutine combine_tests(class, points, error)
      !> Class of the grains; symmetrically equivalent orientations count as equal.
      type(crystal_class_type), intent(in) :: class
      type(points_type), intent(inout) :: points
      type(error_type), allocatable, intent(out) :: error
      !> For each test the first test of its grain; all first tests.
      integer, allocatable :: first(:), kept(:)
      real(wp) :: key(2, points%n)
      integer :: column, i

      column = points%table%find('grain')
      if (column == 0) return
      i = findloc([(points%table%is_empty(column, i), i=1, points%n)], .true., dim=1)
      if (i > 0) then
         call refuse(error, points%table%place(column, i) &
            & //'the cell is empty; the name or number of the grain is needed')
         return
      end if
      points%named_by = column
      key(1, :) = points%group
      key(2, :) = first_rows(points%table, column)
      first = number_equal(key)
      if (all(first == points%row)) return
      call check_tests()
      if (.not. allocated(error)) call merge_tests()

   contains

      !> Refuse tests without sds, and tests of a grain that differ in orientation.
      subroutine check_tests()
         real(wp), parameter :: alike = 5.0_wp
         type(region_type) :: region
         real(wp) :: direction(3, points%n), angle

         if (.not. all(points%sd_gpa > 0.0_wp)) then
            call refuse(error, 'the column '//printable(points%table%name(column)) &
               & //' has several tests of one grain, and to combine them the column ' &
               & //'sd_gpa is needed')
            return
         end if
         call new_region(class, region)
         if (region%dimension == 0) return
         direction = points%directions()
         do i = 1, points%n
            angle = angle_between(region, direction(:, i), direction(:, first(i)))/degree
            if (angle > alike) then
               call points%table%refuse(column, i, &
                  & ' is indented '//fixed(angle, 1)//' degrees away from its direction on line ' &
                  & //to_text(points%table%line(first(i))) &
                  & //'; tests of one grain are within 5 degrees of each other', error)
               return
            end if
         end do
      end subroutine check_tests

      !> Set weighted means of the moduli, and plain means of the sizes and depths that are given.
      subroutine merge_tests()
         real(wp), dimension(points%n) :: weight, precision, modulus, chi_square, tests

         kept = pack(points%row, first == points%row)
         weight = 1.0_wp/points%sd_gpa**2
         tests = sums(spread(1.0_wp, 1, points%n))
         precision = sums(weight)
         modulus = sums(weight*points%modulus_gpa)
         modulus(kept) = modulus(kept)/precision(kept)
         chi_square = sums(weight*(points%modulus_gpa - modulus(first))**2)
         points%orientation_sd_deg = means_of(points%orientation_sd_deg)
         points%depth_um = means_of(points%depth_um)
         points%contact_radius_um = means_of(points%contact_radius_um)
         points%grain_radius_um = means_of(points%grain_radius_um)
         points%n = size(kept)
         points%euler_deg = points%euler_deg(:, kept)
         points%paths = points%paths(kept)
         points%group = points%group(kept)
         points%row = kept
         points%of_row(kept) = [(i, i=1, size(kept))]
         points%of_row = points%of_row(first)
         points%modulus_gpa = modulus(kept)
         points%sd_gpa = 1.0_wp/sqrt(precision(kept))
         points%tests = nint(tests(kept))
         points%chi_square = chi_square(kept)
      end subroutine merge_tests

      !> Sum of the `values` of the tests of each grain, at the index of its first test.
      pure function sums(values)
         real(wp), intent(in) :: values(:)
         real(wp) :: sums(size(values))
         integer :: i

         sums = 0.0_wp
         do i = 1, size(values)
            sums(first(i)) = sums(first(i)) + values(i)
         end do
      end function sums

      !> Mean of the given `values` of each grain; NaN if none is given.
      pure function means_of(values) result(means)
         real(wp), intent(in) :: values(:)
         real(wp) :: means(size(kept)), total(size(values)), given(size(values))

         total = sums(merge(values, 0.0_wp, values >= 0.0_wp))
         given = sums(merge(1.0_wp, 0.0_wp, values >= 0.0_wp))
         means = merge(total(kept)/max(given(kept), 1.0_wp), values(kept), given(kept) > 0.0_wp)
      end function means_of
   end subroutine combine_tests

   !> Warn of tests that scatter more or less than their stated sds: all together, and in single
   !> grains.
   subroutine check_scatter(points, subject, found)
      type(points_type), intent(in) :: points
      !> Subject of the diagnostics.
      character(len=*), intent(in) :: subject
      class(diagnosed_type), intent(inout) :: found
      real(wp) :: above
      integer :: freedom, i, repeated

      if (.not. allocated(points%chi_square)) return
      freedom = sum(points%tests - 1)
      repeated = count(points%tests > 1)
      above = chi_square_above(sum(points%chi_square), freedom)
      if (above < improbable .or. above > 1.0_wp - improbable) then
         call found%warn(merge('tests_scatter_more', 'tests_scatter_less', above < improbable), &
            & subject, excess(sum(points%chi_square), freedom))
      end if
      do i = 1, points%n
         if (points%tests(i) < 2) cycle
         if (chi_square_above(points%chi_square(i), points%tests(i) - 1) > improbable/repeated) then
            cycle
         end if
         call found%warn('tests_disagree', subject//': grain '//printable(points%name(i)), &
            & [real(points%tests(i), wp), excess(points%chi_square(i), points%tests(i) - 1)])
      end do
   end subroutine check_scatter

   !> How much the tests scatter over what their sds say, chi-square, and the degrees of freedom.
   pure function excess(chi_square, freedom) result(numbers)
      real(wp), intent(in) :: chi_square
      integer, intent(in) :: freedom
      real(wp) :: numbers(3)

      numbers = [sqrt(chi_square/freedom), chi_square, real(freedom, wp)]
   end function excess
end module repeated_tests
