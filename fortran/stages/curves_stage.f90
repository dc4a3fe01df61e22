!> `curves`: Step 0, moduli of grains from measured curves. The tests are made on materials:
!> references, whose moduli are known, and grains.
module curves_stage
   use abstract_stage, only: stage_type
   use curves_document, only: write_curve_files, write_document
   use elastic_window, only: begin_test, leave_out, n_shared, score_test
   use errors, only: error_type, refuse
   use files, only: printable
   use halfspace_theory, only: halfspace_moduli
   use json, only: json_type
   use kinds, only: wp
   use loading_segment, only: take_loading
   use shared_posterior, only: curves_posterior_type, material_type
   use statistics, only: median
   use text, only: add_line, join, line_type, to_text
   implicit none
   private
   public :: curves_stage_type

   type, extends(stage_type) :: curves_stage_type
      !> Tests, materials and shared unknowns, and their posterior.
      type(curves_posterior_type) :: found
   contains
      procedure :: begin, finish
   end type curves_stage_type

   !> Limits of a first estimate of a modulus, GPa. An estimate outside means wrong units.
   real(wp), parameter :: moduli_allowed(2) = [0.01_wp, 5000.0_wp]

contains

   !> Find the elastic loading of each curve, and refuse impossible moduli.
   subroutine begin(self, error)
      class(curves_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      real(wp) :: radius_sd, modulus
      integer :: i

      allocate (self%found%tests(size(self%problem%data%curves%curves)))
      call find_materials()
      if (allocated(error)) return
      associate (asked => self%problem%settings%curves, s => self%found)
         do i = 1, size(s%tests)
            associate (c => self%problem%data%curves%curves(i), test => s%tests(i))
               call take_loading(c%points, merge(0.0_wp, c%drift, asked%drift_removed), test%curve)
               test%reason = test%curve%refusal
               test%used = len(test%reason) == 0
               ! This may leave out the test.
               if (test%used) call begin_test(test, asked%radius_um)
               if (.not. test%used) cycle
               modulus = exp(test%ln_modulus)
               if (modulus > moduli_allowed(1) .and. modulus < moduli_allowed(2)) cycle
               call refuse(error, 'test '//printable(c%name)//', line '//to_text(c%line) &
                  & //': the curve means a modulus of '//to_text(modulus, 2)//' GPa at a radius ' &
                  & //'of '//to_text(asked%radius_um)//' um; allowed 0.01 to 5000 GPa. Loads in ' &
                  & //'mN and depths in nm are needed')
               call self%problem%locate_curves(error)
               return
            end associate
         end do
         ! Relative; 30 % if none is stated (docs/namelists.md).
         radius_sd = 0.3_wp
         if (allocated(asked%radius_sd_um)) radius_sd = asked%radius_sd_um/asked%radius_um
         s%prior_mean = [log(asked%radius_um), asked%tip_beta, 0.0_wp, &
            & spread(0.0_wp, 1, size(s%sessions))]
         s%prior_sd = [radius_sd, asked%tip_beta_sd, asked%compliance_sd_nm_mn, &
            & spread(asked%session_sd, 1, size(s%sessions))]
         s%drift_prior_sd = asked%drift_sd_nm_s
      end associate

   contains

      !> Find the materials of the curves, in the order of their first tests, and the sessions.
      subroutine find_materials()
         type(line_type), allocatable :: names(:)
         integer :: i, k

         ! A reference and a grain may have the same name; '=' marks that of a reference.
         allocate (names(0), self%found%sessions(0))
         do i = 1, size(self%found%tests)
            associate (c => self%problem%data%curves%curves(i))
               call number_name(merge('=', ' ', c%reference)//c%material, names, &
                  & self%found%tests(i)%material)
               call number_name(c%session, self%found%sessions, self%found%tests(i)%session)
            end associate
         end do
         allocate (self%found%materials(size(names)))
         do k = 1, size(names)
            associate (m => self%found%materials(k))
               m%name = names(k)%text(2:)
               m%reference = names(k)%text(1:1) == '='
               if (m%reference) call find_reference(m)
               if (allocated(error)) return
            end associate
         end do
      end subroutine find_materials

      !> The number of a name among the `names`; a new name is appended to them.
      subroutine number_name(name, names, number)
         character(len=*), intent(in) :: name
         type(line_type), allocatable, intent(inout) :: names(:)
         integer, intent(out) :: number

         do number = 1, size(names)
            if (names(number)%text == name) return
         end do
         call add_line(names, name)
      end subroutine number_name

      !> Set the prior of a material's modulus to the value that &references states.
      subroutine find_reference(material)
         type(material_type), intent(inout) :: material
         character(len=:), allocatable :: names
         real(wp) :: modulus(1), sd, effective
         integer :: i

         ! References that are stated, for the message; the modulus of the one that is sought.
         names = ''
         modulus = 0.0_wp
         associate (r => self%problem%settings%references, indenter => self%problem%settings%curves)
            if (allocated(r%name)) then
               names = ', '//join(r%name, ', ')
               i = findloc(r%name == material%name, .true., 1, back=.true.)
               if (i > 0) then
                  modulus = r%young_gpa(i)/(1.0_wp - r%nu(i)**2)
                  sd = r%young_sd_gpa(i)/r%young_gpa(i)
               end if
            end if
            if (allocated(self%problem%data%references)) then
               associate (crystals => self%problem%data%references)
                  do i = 1, crystals%n
                     names = names//', '//crystals%name(i)
                     if (crystals%name(i) /= material%name) cycle
                     call halfspace_moduli(crystals%stiffness(:, :, i:i), &
                        & crystals%euler_deg(:, i:i), 1, modulus, error)
                     if (allocated(error)) return
                     sd = r%crystal_sd
                  end do
               end associate
            end if
            if (len(names) == 0) names = ', none'
            if (.not. modulus(1) > 0.0_wp) then
               call self%problem%refuse('references', 'name', &
                  & 'the tests have the reference '//printable(material%name) &
                  & //', whose modulus is not stated; stated: '//names(3:), error)
               return
            end if
            ! The effective modulus includes the indenter. Its relative sd follows from that of the
            ! modulus.
            effective = 1.0_wp/(1.0_wp/modulus(1) &
               & + (1.0_wp - indenter%indenter_nu**2)/indenter%indenter_modulus_gpa)
            material%prior_mean = log(effective)
            material%prior_sd = max(1.0e-4_wp, sd*effective/modulus(1))
         end associate
      end subroutine find_reference
   end subroutine begin

   !> Infer the moduli, and write the files and the document.
   subroutine finish(self, page, error)
      class(curves_stage_type), intent(inout) :: self
      type(json_type), intent(inout) :: page
      type(error_type), allocatable, intent(out) :: error
      integer :: i, step

      call iterate()
      if (allocated(error)) return
      associate (set => self%problem%data%curves, tests => self%found%tests)
         do i = 1, size(tests)
            if (.not. tests(i)%used) then
               call self%warn('test_left_out', set%curves(i)%name//' is left out: ' &
                  & //tests(i)%reason)
            end if
         end do
         call check_references(self, error)
         if (allocated(error)) return
         call write_curve_files(set, self%found, self%output, error)
         if (allocated(error)) return
         call write_document(page, set, self%found)
         self%done = to_text(count(tests%used))//' of '//to_text(size(tests)) &
            & //' tests: '//self%output//'/measurements.csv'
      end associate

   contains

      !> Alternate between the moduli of the tests for fixed shared unknowns and the posterior of
      !> the shared unknowns, until the shared unknowns have converged.
      subroutine iterate()
         integer, parameter :: most_steps = 8, fewest_steps = 3
         !> Largest change of a shared unknown at convergence, in units of its posterior sd.
         real(wp), parameter :: converged = 0.05_wp
         !> Prior sd of the depth at which a test begins, nm.
         real(wp), parameter :: zero_sd = 1.0e4_wp
         real(wp) :: before(n_shared)

         associate (asked => self%problem%settings%curves, s => self%found, &
            & tests => self%found%tests)
            s%mean = s%prior_mean
            do step = 1, most_steps
               !$omp parallel do schedule(dynamic) &
               !$omp & num_threads(self%problem%threads())
               do i = 1, size(tests)
                  if (tests(i)%used) then
                     call score_test(tests(i), s%mean(:n_shared), [s%prior_sd(:n_shared), zero_sd, &
                        & asked%drift_sd_nm_s, asked%load_sd_mn, asked%transient_sd_nm], &
                        & asked%transient_s)
                  end if
               end do
               call compare_tests()
               if (.not. any(tests%used)) then
                  call refuse(error, 'no test has an elastic part; test ' &
                     & //self%problem%data%curves%curves(1)%name//': '//tests(1)%reason &
                     & //'. Loads in mN and depths in nm are needed')
                  call self%problem%locate_curves(error)
                  return
               end if
               before = s%mean(:n_shared)
               call s%infer_shared(error)
               if (allocated(error)) return
               if (step >= fewest_steps .and. all(abs(s%mean(:n_shared) - before) &
                  & < [(converged*sqrt(s%covariance(i, i)), i=1, n_shared)])) then
                  exit
               end if
            end do
         end associate
      end subroutine iterate

      !> Compare the tests of each material with their median. The prior of a grain's modulus is
      !> centred on it. From the second step on, tests that are far from it are left out.
      subroutine compare_tests()
         !> Distance from the median, in ln(modulus), beyond which a test is left out.
         real(wp), parameter :: far = 0.5_wp
         integer, allocatable :: own(:)
         real(wp), allocatable :: ln_modulus(:)
         real(wp) :: centre
         integer :: i, k

         associate (tests => self%found%tests, materials => self%found%materials)
            do k = 1, size(materials)
               own = pack([(i, i=1, size(tests))], tests%material == k .and. tests%used)
               if (size(own) == 0) cycle
               ln_modulus = tests(own)%ln_modulus + tests(own)%shift
               centre = median(size(own), ln_modulus)
               if (.not. materials(k)%reference) materials(k)%prior_mean = centre
               if (size(own) < 3 .or. step == 1) cycle
               do i = 1, size(own)
                  if (abs(ln_modulus(i) - centre) > far) then
                     call leave_out(tests(own(i)), &
                        & 'its modulus of '//to_text(exp(ln_modulus(i)), 3) &
                        & //' GPa is far from the '//to_text(exp(centre), 3) &
                        & //' GPa of the other tests of '//materials(k)%name)
                  end if
               end do
            end do
         end associate
      end subroutine compare_tests
   end subroutine finish

   !> Refuse references that were measured with another tip. Warn if no reference was measured.
   subroutine check_references(self, error)
      class(curves_stage_type), intent(inout) :: self
      type(error_type), allocatable, intent(out) :: error
      !> The tip is that of the namelist if its radius is within this number of sds of the stated
      !> one, and if ln(modulus) of each reference is within this distance of the stated one.
      real(wp), parameter :: most_sds = 3.0_wp, most_misfit = 0.1_wp
      real(wp) :: distance, ln_modulus
      logical :: has_reference
      integer :: k

      has_reference = .false.
      associate (s => self%found, tests => self%found%tests)
         distance = abs(s%mean(1) - s%prior_mean(1))/s%prior_sd(1)
         do k = 1, size(s%materials)
            associate (m => s%materials(k), own => tests%material == k .and. tests%used)
               if (.not. (m%reference .and. any(own))) cycle
               has_reference = .true.
               ln_modulus = sum(tests%ln_modulus, own)/count(own)
               if (distance <= most_sds .and. abs(ln_modulus - m%prior_mean) <= most_misfit) cycle
               call self%problem%refuse('curves', 'radius_um', 'the curves of the reference ' &
                  & //m%name//' are those of another tip or material: at a radius of ' &
                  & //to_text(exp(s%mean(1)), 3)//' um, '//to_text(distance, 2) &
                  & //' sds from the stated one, they mean ' &
                  & //to_text(exp(ln_modulus), 3)//' GPa for its '//to_text(exp(m%prior_mean), 3) &
                  & //' GPa. Check radius_um, radius_sd_um and &references', error)
               return
            end associate
         end do
         if (.not. has_reference) then
            ! The sd of ln(1/sqrt(radius)), in per cent.
            call self%warn('no_reference', numbers=[50.0_wp*sqrt(s%covariance(1, 1))])
         end if
      end associate
   end subroutine check_references
end module curves_stage
