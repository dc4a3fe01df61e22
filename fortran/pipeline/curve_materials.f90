!> What the tests of a problem were made on: references, whose moduli are known, and grains; and the sessions of the tests.
module curve_materials
   use elastic_window, only: test_type
   use errors, only: error_type, refuse, warn, warning_type
   use files, only: printable
   use halfspace_theory, only: halfspace_moduli
   use kinds, only: wp
   use namelist_file, only: place
   use problem, only: problem_type
   use settings_schema, only: curves_settings_type, references_settings_type
   use shared_posterior, only: material_type
   use text, only: join, to_text
   implicit none
   private
   public :: find_materials

contains

   !> The materials of a problem's curves, in the order of their first tests.
   subroutine find_materials(problem, tests, materials, sessions, error)
      type(problem_type), intent(in) :: problem
      type(test_type), intent(inout) :: tests(:)
      type(material_type), allocatable, intent(out) :: materials(:)
      !> Their names.
      type(warning_type), allocatable, intent(out) :: sessions(:)
      type(error_type), allocatable, intent(out) :: error
      integer :: i, k

      allocate (materials(0), sessions(0))
      do i = 1, size(tests)
         associate (c => problem%curves%curves(i))
            do k = 1, size(materials)
               if (materials(k)%name == c%material .and. (materials(k)%reference .eqv. c%reference)) exit
            end do
            tests(i)%material = k
            if (k > size(materials)) then
               ! A constructor would empty the name.
               materials = [materials, material_type()]
               materials(k)%name = c%material
               materials(k)%reference = c%reference
               if (c%reference) call find_reference(problem, materials(k), error)
               if (allocated(error)) return
            end if
            do k = 1, size(sessions)
               if (sessions(k)%text == c%session) exit
            end do
            tests(i)%session = k
            if (k > size(sessions)) call warn(sessions, c%session)
         end associate
      end do
   end subroutine find_materials

   !> What &references says of a material.
   subroutine find_reference(problem, material, error)
      type(problem_type), intent(in) :: problem
      type(material_type), intent(inout) :: material
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: names, prefix
      real(wp) :: modulus(1), circular(1)
      integer :: i

      prefix = place(problem%path, 'references', 'name')
      names = ''
      associate (r => problem%settings%references, indenter => problem%settings%curves)
         if (allocated(r%name)) then
            call check_lengths(r, prefix, error)
            if (allocated(error)) return
            names = join(r%name, ', ')
            do i = 1, size(r%name)
               if (r%name(i) /= material%name) cycle
               call set_prior(indenter, r%young_gpa(i)/(1.0_wp - r%nu(i)**2), r%young_sd_gpa(i)/r%young_gpa(i))
               return
            end do
         end if
         if (allocated(problem%references)) then
            do i = 1, problem%references%n
               names = names//', '//problem%references%name(i)
               if (problem%references%name(i) /= material%name) cycle
               call halfspace_moduli(problem%references%stiffness(:, :, i:i), problem%references%euler_deg(:, i:i), 1, modulus, &
                  & circular, error)
               if (.not. allocated(error)) call set_prior(indenter, modulus(1), r%crystal_sd)
               return
            end do
         end if
      end associate
      if (len(names) == 0) names = 'none'
      call refuse(error, prefix//'the tests have the reference '//printable(material%name)//', whose modulus is not stated; ' &
         & //'stated: '//names)

   contains

      !> Effective modulus, and its relative sd, of an indentation modulus.
      subroutine set_prior(indenter, modulus, sd)
         type(curves_settings_type), intent(in) :: indenter
         real(wp), intent(in) :: modulus, sd
         real(wp) :: effective

         effective = 1.0_wp/(1.0_wp/modulus + (1.0_wp - indenter%indenter_nu**2)/indenter%indenter_modulus_gpa)
         material%prior_mean = log(effective)
         material%prior_sd = max(1.0e-4_wp, sd*effective/modulus)
      end subroutine set_prior
   end subroutine find_reference

   !> The lists of isotropic references are of equal length.
   subroutine check_lengths(r, prefix, error)
      type(references_settings_type), intent(in) :: r
      character(len=*), intent(in) :: prefix
      type(error_type), allocatable, intent(out) :: error
      integer :: sizes(3)

      sizes = 0
      if (allocated(r%young_gpa)) sizes(1) = size(r%young_gpa)
      if (allocated(r%young_sd_gpa)) sizes(2) = size(r%young_sd_gpa)
      if (allocated(r%nu)) sizes(3) = size(r%nu)
      if (any(sizes /= size(r%name))) call refuse(error, prefix//to_text(size(r%name))//' references have '//to_text(sizes(1)) &
         & //' young_gpa, '//to_text(sizes(2))//' young_sd_gpa and '//to_text(sizes(3))//' nu; each reference needs one of each')
   end subroutine check_lengths
end module curve_materials
