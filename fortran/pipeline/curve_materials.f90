!> What the tests of a problem were made on: references, whose moduli are known, and grains; and the sessions of the tests.
module curve_materials
   use errors, only: error_type, refuse, warn, warning_type
   use files, only: printable
   use halfspace_theory, only: halfspace_moduli
   use kinds, only: wp
   use namelist_file, only: place
   use problem, only: problem_type
   use shared_posterior, only: curves_posterior_type, material_type
   use text, only: join
   implicit none
   private
   public :: find_materials

contains

   !> The materials of a problem's curves, in the order of their first tests, and the sessions.
   subroutine find_materials(problem, found, error)
      type(problem_type), intent(in) :: problem
      type(curves_posterior_type), intent(inout) :: found
      type(error_type), allocatable, intent(out) :: error
      type(warning_type), allocatable :: names(:)
      integer :: i, k

      allocate (names(0), found%sessions(0))
      do i = 1, size(found%tests)
         associate (c => problem%curves%curves(i))
            call number_name(merge('=', ' ', c%reference)//c%material, names, found%tests(i)%material)
            call number_name(c%session, found%sessions, found%tests(i)%session)
         end associate
      end do
      allocate (found%materials(size(names)))
      do k = 1, size(names)
         associate (m => found%materials(k))
            m%name = names(k)%text(2:)
            m%reference = names(k)%text(1:1) == '='
            if (m%reference) call find_reference(problem, m, error)
            if (allocated(error)) return
         end associate
      end do
   end subroutine find_materials

   !> The number of a name among the `names`, where it is then.
   subroutine number_name(name, names, number)
      character(len=*), intent(in) :: name
      type(warning_type), allocatable, intent(inout) :: names(:)
      integer, intent(out) :: number

      do number = 1, size(names)
         if (names(number)%text == name) return
      end do
      call warn(names, name)
   end subroutine number_name

   !> What &references says of a material.
   subroutine find_reference(problem, material, error)
      type(problem_type), intent(in) :: problem
      type(material_type), intent(inout) :: material
      type(error_type), allocatable, intent(out) :: error
      character(len=:), allocatable :: names
      real(wp) :: modulus(1), circular(1), sd, effective
      integer :: i

      names = ''
      modulus = 0.0_wp
      associate (r => problem%settings%references, indenter => problem%settings%curves)
         if (allocated(r%name)) then
            names = ', '//join(r%name, ', ')
            do i = 1, size(r%name)
               if (r%name(i) /= material%name) cycle
               modulus = r%young_gpa(i)/(1.0_wp - r%nu(i)**2)
               sd = r%young_sd_gpa(i)/r%young_gpa(i)
            end do
         end if
         if (allocated(problem%references)) then
            do i = 1, problem%references%n
               names = names//', '//problem%references%name(i)
               if (problem%references%name(i) /= material%name) cycle
               call halfspace_moduli(problem%references%stiffness(:, :, i:i), problem%references%euler_deg(:, i:i), 1, modulus, &
                  & circular, error)
               if (allocated(error)) return
               sd = r%crystal_sd
            end do
         end if
         if (.not. modulus(1) > 0.0_wp) then
            if (len(names) == 0) names = ', none'
            call refuse(error, place(problem%path, 'references', 'name')//'the tests have the reference ' &
               & //printable(material%name)//', whose modulus is not stated; stated: '//names(3:))
            return
         end if
         effective = 1.0_wp/(1.0_wp/modulus(1) + (1.0_wp - indenter%indenter_nu**2)/indenter%indenter_modulus_gpa)
         material%prior_mean = log(effective)
         material%prior_sd = max(1.0e-4_wp, sd*effective/modulus(1))
      end associate
   end subroutine find_reference
end module curve_materials
