!> The table of crystal classes: names, and the stiffnesses that follow from the generators.
program test_crystal_class
   use crystal_class, only: crystal_class_names, crystal_class_type, general_class, &
      & new_crystal_class
   use crystal_elasticity, only: rotate_stiffness
   use errors, only: error_type
   use kinds, only: wp
   use testing, only: check, check_refused, check_success, finish
   use text, only: split_list, to_text
   implicit none

   call test_names()
   call test_stiffness()
   call test_dependent_entries()
   call test_inclusion()
   call finish()

contains

   subroutine test_names()
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error

      call check('all names', crystal_class_names() == 'isotropic, cubic, m-3m, m-3, fcc, bcc, ' &
         & //'hexagonal, 6/mmm, 6/m, hcp, tetragonal, 4/mmm, 4/m, trigonal, -3m, -3, ' &
         & //'orthorhombic, mmm, monoclinic, 2/m, triclinic, -1', crystal_class_names())
      call new_crystal_class('6/MMM', class, error)
      call check_success('a synonym in upper case', error)
      call check('its class', class%name == 'hexagonal' .and. class%n_constants == 5)
      call check('in the paper''s order', &
         & all(class%constants == ['C11', 'C12', 'C44', 'C33', 'C13']))
      call new_crystal_class('kubic', class, error)
      call check_refused('an unknown name is refused', error, &
         & '''kubic'' is no crystal class; allowed isotropic, cubic, m-3m')
      call new_crystal_class('', class, error)
      call check_refused('no name is refused', error, 'allowed')
   end subroutine test_names

   !> The map spans exactly the stiffnesses that the generators leave alone.
   subroutine test_stiffness()
      type(crystal_class_type) :: class, general
      type(error_type), allocatable :: error
      real(wp) :: c(6, 6), average(6, 6), constants(21)
      character(len=:), allocatable :: names(:)
      integer :: i, g, step

      constants = [(100.0_wp + 17.0_wp*mod(7*i, 11), i=1, 21)]
      names = split_list(crystal_class_names())
      call new_crystal_class(general_class, general, error)
      call check_success('the general class', error)
      do i = 1, size(names)
         call new_crystal_class(names(i), class, error)
         call check_success(trim(names(i)), error)
         if (allocated(error)) cycle
         c = class%stiffness(constants(:class%n_constants))
         call check(trim(names(i))//' gives its constants back', all(class%constants_of(c) &
            & - constants(:class%n_constants) == 0.0_wp) .and. all(c - transpose(c) == 0.0_wp))
         do g = 1, size(class%generators, 3)
            call check(trim(names(i))//' is unchanged by generator '//to_text(g), &
               & maxval(abs(rotate_stiffness(c, class%generators(:, :, g)) - c)) < 1.0e-11_wp)
         end do
         ! Averaging over the generators again and again turns any stiffness into one of the class.
         average = general%stiffness(constants)
         do step = 1, 4000
            do g = 1, size(class%generators, 3)
               average = 0.5_wp*(average + rotate_stiffness(average, class%generators(:, :, g)))
            end do
         end do
         call check(trim(names(i))//' holds every invariant stiffness', &
            & maxval(abs(class%stiffness(class%constants_of(average)) - average)) < 1.0e-8_wp)
      end do
   end subroutine test_stiffness

   subroutine test_dependent_entries()
      type(crystal_class_type) :: class
      type(error_type), allocatable :: error
      real(wp) :: c(6, 6)
      integer :: i

      call new_crystal_class('trigonal', class, error)
      c = class%stiffness([86.6_wp, 6.7_wp, 12.6_wp, -17.8_wp, 106.1_wp, 57.8_wp])
      call check('trigonal: C24 = -C14, C56 = C14', same(c(2, 4), 17.8_wp) &
         & .and. same(c(5, 6), -17.8_wp))
      call check('trigonal: C66 = (C11 - C12)/2', same(c(6, 6), 0.5_wp*(86.6_wp - 6.7_wp)))
      call check('trigonal: no C15, C25, C46', all(same([c(1, 5), c(2, 5), c(4, 6)], 0.0_wp)))
      call new_crystal_class('-3', class, error)
      c = class%stiffness([205.0_wp, 71.0_wp, 57.4_wp, -19.5_wp, 113.0_wp, 39.8_wp, 13.7_wp])
      call check('-3: C25 = C46 = -C15', same(c(2, 5), -13.7_wp) .and. same(c(4, 6), -13.7_wp))
      call new_crystal_class('4/m', class, error)
      c = class%stiffness([144.0_wp, 65.0_wp, 47.0_wp, 127.0_wp, 36.8_wp, 45.8_wp, -13.5_wp])
      call check('4/m: C26 = -C16', same(c(2, 6), 13.5_wp))
      call new_crystal_class('hexagonal', class, error)
      c = class%stiffness([162.0_wp, 92.0_wp, 47.0_wp, 180.0_wp, 69.0_wp])
      call check('hexagonal: C66 = (C11 - C12)/2', same(c(6, 6), 0.5_wp*(162.0_wp - 92.0_wp)))
      call check('hexagonal: C55 = C44, C22 = C11, C23 = C13', &
         & same(c(5, 5), 47.0_wp) .and. same(c(2, 2), 162.0_wp) .and. same(c(2, 3), 69.0_wp))
      call new_crystal_class('isotropic', class, error)
      c = class%stiffness([77.39_wp, 15.85_wp])
      call check('isotropic: C44 = (C11 - C12)/2', &
         & all([(same(c(i, i), 0.5_wp*(77.39_wp - 15.85_wp)), i=4, 6)]))
   end subroutine test_dependent_entries

   !> Equal to the last bit.
   elemental logical function same(a, b)
      real(wp), intent(in) :: a, b

      same = abs(a - b) <= 0.0_wp
   end function same

   !> Which class holds the crystals of which.
   subroutine test_inclusion()
      character(len=12), parameter :: held(2, &
         & 8) = reshape([character(len=12) :: 'isotropic', 'cubic', 'isotropic', 'hexagonal', &
         & 'hexagonal', 'trigonal', 'cubic', 'tetragonal', 'tetragonal', '4/m', 'tetragonal', &
         & 'orthorhombic', 'orthorhombic', 'monoclinic', '-3', 'triclinic'], [2, 8])
      type(crystal_class_type) :: small, large
      type(error_type), allocatable :: error
      integer :: i

      do i = 1, size(held, 2)
         call new_crystal_class(trim(held(1, i)), small, error)
         call new_crystal_class(trim(held(2, i)), large, error)
         call check(trim(held(2, i))//' includes '//trim(held(1, i)), &
            & large%includes(small) .and. large%includes(large))
         call check(trim(held(1, i))//' does not include '//trim(held(2, i)), &
            & .not. small%includes(large))
      end do
      call new_crystal_class('cubic', small, error)
      call new_crystal_class('hexagonal', large, error)
      call check('neither of cubic and hexagonal the other', &
         & .not. (small%includes(large) .or. large%includes(small)))
   end subroutine test_inclusion
end program test_crystal_class
