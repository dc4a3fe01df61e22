!> The results of `curves`: tables of the moduli of the grains, of their shared errors and of the
!> fitted curves, and the document.
module curves_document
   use curve_tables, only: curve_set_type
   use elastic_window, only: n_shared
   use errors, only: error_type
   use files, only: new_file_type
   use json, only: json_type
   use kinds, only: nan, wp
   use shared_posterior, only: curves_posterior_type
   use small_matrices, only: factor_definite
   use stage_documents, only: cells_of_numbers
   use statistics, only: chi_square_above, median
   use tables, only: csv_cell
   use text, only: newline, split_list, to_text
   implicit none
   private
   public :: write_curve_files, write_document

   !> Columns of the table of tests that the table of measurements has as well.
   character(len=*), parameter :: copied = 'phi1_deg, phi1, Phi_deg, Phi, phi2_deg, phi2, q0, ' &
      & //'q1, q2, q3, u, v, w, h, k, l, orientation_sd_deg, grain_radius_um'
   !> Shared errors with relative loadings below this at every grain are left out.
   real(wp), parameter :: negligible = 1.0e-6_wp

contains

   !> Write measurements.csv, shared_errors.csv and fits.csv into the folder `output`.
   subroutine write_curve_files(set, found, output, error)
      type(curve_set_type), intent(in) :: set
      type(curves_posterior_type), intent(in) :: found
      character(len=*), intent(in) :: output
      type(error_type), allocatable, intent(out) :: error
      type(new_file_type) :: file
      real(wp), allocatable :: loadings(:, :)
      integer, allocatable :: grains(:), columns(:)
      character(len=:), allocatable :: names(:)
      integer :: i, j

      grains = found%grains()
      call find_loadings()
      names = split_list(copied)
      columns = [(set%tests%find(trim(names(j))), j=1, size(names))]
      columns = pack(columns, columns > 0)
      call file%add('grain'//cells_of(0)//',effective_modulus_gpa,sd_gpa'//newline)
      do i = 1, size(grains)
         associate (grain => found%materials(grains(i)))
            call file%add(csv_cell(grain%name) &
               & //cells_of(findloc(found%tests%material, grains(i), 1)) &
               & //cells_of_numbers(exp(grain%ln_modulus)*[1.0_wp, grain%own_sd]))
         end associate
      end do
      call file%finish(output//'/measurements.csv', error)
      if (allocated(error)) return
      call file%add('grain')
      do j = 1, size(loadings, 2)
         call file%add(',shared_'//to_text(j))
      end do
      call file%add(newline)
      do i = 1, size(grains)
         call file%add(csv_cell(found%materials(grains(i))%name)//cells_of_numbers(loadings(i, :)))
      end do
      call file%finish(output//'/shared_errors.csv', error)
      if (allocated(error)) return
      call file%add('test,time_s,depth_nm,load_mn,fit_nm,elastic'//newline)
      do i = 1, size(found%tests)
         if (.not. allocated(found%tests(i)%fit)) cycle
         associate (t => found%tests(i), c => found%tests(i)%curve)
            do j = 1, size(t%fit)
               call file%add(csv_cell(set%curves(i)%name) &
                  & //cells_of_numbers([c%time(j), c%depth(j), c%load(j), t%fit(j), t%elastic(j)]))
            end do
         end associate
      end do
      call file%finish(output//'/fits.csv', error)

   contains

      !> Cells of the copied columns in a row of the table of tests.
      function cells_of(row) result(line)
         integer, intent(in) :: row
         character(len=:), allocatable :: line
         integer :: k

         line = ''
         do k = 1, size(columns)
            line = line//','//csv_cell(set%tests%cell(columns(k), row))
         end do
      end function cells_of

      !> Set the loadings J L of the shared errors, relative to the modulus, (grain, error): J are
      !> the derivatives of ln(modulus) by the shared unknowns, L is the lower factor of their
      !> covariance. The errors that the loadings multiply are independent and of sd 1.
      subroutine find_loadings()
         real(wp), allocatable :: factor(:, :)
         integer :: n

         n = size(found%mean)
         factor = found%covariance
         call factor_definite(factor, 1.0e-13_wp)
         allocate (loadings(size(grains), n))
         do j = 1, n
            do i = 1, size(grains)
               loadings(i, j) = sum(found%materials(grains(i))%by_shared(j:)*factor(j:, j))
            end do
         end do
         loadings = loadings(:, pack([(j, j=1, n)], maxval(abs(loadings), 1) > negligible))
      end subroutine find_loadings
   end subroutine write_curve_files

   !> Write the document into the object of a `page`.
   subroutine write_document(page, set, found)
      type(json_type), intent(inout) :: page
      type(curve_set_type), intent(in) :: set
      type(curves_posterior_type), intent(in) :: found
      integer :: i

      call page%begin_object('tip')
      call put_shared('radius_um', 1, exp(found%mean(1)), exp(found%mean(1)))
      call put_shared('beta', 2, found%mean(2), 1.0_wp)
      call page%end_object()
      call page%begin_object('frame')
      call put_shared('compliance_nm_mn', 3, found%mean(3), 1.0_wp)
      associate (drift => pack(found%tests%drift, found%tests%used), &
         & sds => pack(found%tests%drift_sd, found%tests%used))
         call put_unknown('drift_nm_s', median(size(drift), drift), median(size(sds), sds), &
            & found%drift_prior_sd)
      end associate
      call page%end_object()
      call page%begin_array('sessions')
      do i = 1, size(found%sessions)
         call page%begin_object('')
         call page%put('session', found%sessions(i)%text)
         call put_shared('factor', n_shared + i, 1.0_wp + found%mean(n_shared + i), 1.0_wp)
         call page%end_object()
      end do
      call page%end_array()
      call page%put_numbers('references, grains', found%repeat_sd, 'repeat_sd')
      call put_tests()
      call put_grains(page, found)

   contains

      !> Write a shared unknown. An error of one in it is an error of `unit` in the printed value.
      subroutine put_shared(name, i, mean, unit)
         character(len=*), intent(in) :: name
         integer, intent(in) :: i
         real(wp), intent(in) :: mean, unit

         call put_unknown(name, mean, sqrt(found%covariance(i, i))*unit, found%prior_sd(i)*unit)
      end subroutine put_shared

      !> Write the posterior of an unknown, and whether the tests or the prior determine it.
      subroutine put_unknown(name, mean, sd, prior_sd)
         character(len=*), intent(in) :: name
         real(wp), intent(in) :: mean, sd, prior_sd
         !> The prior determines an unknown if the posterior sd is above this share of its sd.
         real(wp), parameter :: share_of_prior = 0.9_wp

         call page%begin_object(name)
         call page%put_numbers('mean, sd, prior_sd', [mean, sd, prior_sd])
         call page%put('decided_by', trim(merge('prior', 'tests', sd > share_of_prior*prior_sd)))
         call page%end_object()
      end subroutine put_unknown

      subroutine put_tests()
         integer :: k

         call page%begin_array('tests')
         do k = 1, size(found%tests)
            associate (t => found%tests(k), c => set%curves(k))
               call page%begin_object('')
               call page%put('test', c%name)
               call page%put(trim(merge('reference', 'grain    ', c%reference)), c%material)
               call page%put('session', c%session)
               call page%put('used', t%used)
               call page%put('reason', t%reason)
               ! NaN is written as null.
               call page%put_numbers('effective_modulus_gpa, sd_gpa, elastic_from_mn, ' &
                  & //'elastic_to_mn, zero_nm, drift_nm_s, drift_sd_nm_s, noise_nm', &
                  & merge([exp(t%ln_modulus)*[1.0_wp, sqrt(t%variance)], t%from_load, &
                  & t%to_load, t%zero, t%drift, t%drift_sd, t%noise], nan, t%used))
               call page%end_object()
            end associate
         end do
         call page%end_array()
      end subroutine put_tests
   end subroutine write_document

   !> Write the moduli of the grains, their derivatives by the shared unknowns, the sources of their
   !> errors, and the chi-square of the tests about the mean of their grain.
   subroutine put_grains(page, found)
      type(json_type), intent(inout) :: page
      type(curves_posterior_type), intent(in) :: found
      character(len=*), &
         & parameter :: names = 'radius, beta, compliance, session, drift, repeat_and_window'
      integer, parameter :: n_sources = n_shared + 3
      real(wp), allocatable :: budget(:, :), slopes(:, :), values(:), weight(:)
      integer, allocatable :: grains(:)
      real(wp) :: sd(size(found%mean)), chi_square
      integer :: i, j, freedom

      grains = found%grains()
      allocate (budget(n_sources, size(grains)), slopes(size(grains), size(sd)))
      sd = [(sqrt(found%covariance(j, j)), j=1, size(sd))]
      chi_square = 0.0_wp
      freedom = -size(grains)
      call page%begin_array('grains')
      do i = 1, size(grains)
         associate (m => found%materials(grains(i)), tests => found%tests, &
            & own => found%tests%material == grains(i) .and. found%tests%used)
            slopes(i, :) = m%by_shared
            budget(:n_shared, i) = abs(m%by_shared(:n_shared))*sd(:n_shared)
            budget(n_shared + 1, i) = norm2(m%by_shared(n_shared + 1:)*sd(n_shared + 1:))
            budget(n_shared + 2, i) = sqrt(sum(tests%variance*tests%drift_share, own))/count(own)
            budget(n_sources, i) = sqrt(max(0.0_wp, m%own_sd**2 - budget(n_shared + 2, i)**2))
            values = pack(tests%ln_modulus, own)
            weight = 1.0_wp/(pack(tests%variance, own) + found%repeat_sd(2)**2)
            chi_square = chi_square + sum(weight*(values - sum(weight*values)/sum(weight))**2)
            freedom = freedom + size(values)
            call page%begin_object('')
            call page%put('grain', m%name)
            call page%put('tests', size(values))
            call page%put_numbers('effective_modulus_gpa, sd_gpa, own_sd_gpa', &
               & exp(m%ln_modulus)*[1.0_wp, m%sd, m%own_sd])
            call page%put_numbers(names, budget(:, i), 'error_budget')
            call page%end_object()
         end associate
      end do
      call page%end_array()
      call page%begin_object('agreement')
      call page%put('chi_square', chi_square)
      call page%put('degrees_of_freedom', freedom)
      if (freedom > 0) call page%put('probability', chi_square_above(chi_square, freedom))
      call page%end_object()
      if (size(grains) > 0) then
         call page%put_numbers(names, [(median(size(grains), budget(j, :)), j=1, n_sources)], &
            & 'error_budget')
      end if
      call page%begin_object('shared')
      call page%put('loadings', slopes)
      call page%put('covariance', found%covariance)
      call page%end_object()
   end subroutine put_grains
end module curves_document
