!> Quantities of crystals by name: closed forms, products of powers, what is reported of a class,
!> and refusals.
program test_quantities
   use crystal_elasticity, only: averages_type, polycrystal_averages
   use errors, only: error_type
   use kinds, only: wp
   use quantities, only: check_quantity, evaluate_quantities, new_quantity, quantity_type, &
      & reported_quantities
   use testing, only: check, check_close, check_refused, check_success, class_of, finish, &
      & stiffness_of
   implicit none

   real(wp), parameter :: copper(3) = [168.4_wp, 121.4_wp, 75.4_wp], &
      & zinc(5) = [161.1_wp, 34.2_wp, 38.3_wp, 61.1_wp, 50.3_wp]
   real(wp), parameter :: rutile(6) = [269.0_wp, 177.0_wp, 146.0_wp, 480.0_wp, 124.0_wp, 192.0_wp]

   call test_closed_forms()
   call test_directions()
   call test_names()
   call test_reported()
   call finish()

contains

   !> A quantity of a stiffness; NaN if the name is refused.
   function value_of(name, c) result(value)
      character(len=*), intent(in) :: name
      real(wp), intent(in) :: c(6, 6)
      real(wp) :: value
      type(quantity_type) :: quantity(1)
      type(error_type), allocatable :: error
      real(wp) :: values(1)

      call new_quantity(name, quantity(1), error)
      call check_success(name, error)
      values = 0.0_wp
      if (.not. allocated(error)) call evaluate_quantities(quantity, c, values)
      value = values(1)
   end function value_of

   subroutine test_closed_forms()
      real(wp) :: c(6, 6), bulk, shear
      type(averages_type) :: averages

      c = stiffness_of('cubic', copper)
      call check_close('cubic bulk modulus', value_of('bulk_modulus', c), &
         & (168.4_wp + 2.0_wp*121.4_wp)/3.0_wp, 1.0e-10_wp)
      call check_close('of the polycrystal too', value_of('polycrystal_bulk', c), &
         & value_of('bulk_modulus', c), 1.0e-10_wp)
      ! Young's moduli of copper along its axes, as in textbooks: 66.7, 130.3, 191.1 GPa.
      call check_close('copper along 100', value_of('young[100]', c), 66.7_wp, 0.1_wp)
      call check_close('copper along 110', value_of('young[110]', c), 130.3_wp, 0.3_wp)
      call check_close('copper along 111', value_of('young[1 1 1]', c), 191.1_wp, 0.3_wp)
      call check_close('torsion of copper about 100', value_of('shear[001]', c), &
         & 75.4_wp, 1.0e-10_wp)
      ! About 110 the compliance is the mean of those of C44 and C'.
      call check_close('about 110', value_of('shear[110]', c), &
         & 2.0_wp/(1.0_wp/75.4_wp + 1.0_wp/23.5_wp), 1.0e-10_wp)
      call check_close('compressibility of copper', value_of('compressibility[123]', c), &
         & 1000.0_wp/411.2_wp, 1.0e-10_wp)
      call check_close('C''', value_of('C''', c), 23.5_wp, 1.0e-12_wp)
      call check_close('Zener''s ratio', value_of('C44/C''', c), 75.4_wp/23.5_wp, 1.0e-12_wp)
      call check_close('powers', value_of('C11^1 C12^-0.3 * c44^2', c), &
         & 168.4_wp*121.4_wp**(-0.3_wp)*75.4_wp**2, 1.0e-7_wp)
      call check_close('a quotient of two', value_of('C11/C12/C44', c), &
         & 168.4_wp/121.4_wp/75.4_wp, 1.0e-12_wp)

      c = stiffness_of('hexagonal', zinc)
      averages = polycrystal_averages(c)
      bulk = 0.5_wp*(averages%bulk_voigt + averages%bulk_reuss)
      shear = 0.5_wp*(averages%shear_voigt + averages%shear_reuss)
      call check_close('zinc along c', value_of('young[001]', c), &
         & 61.1_wp - 2.0_wp*50.3_wp**2/(161.1_wp + 34.2_wp), 1.0e-10_wp)
      call check_close('its bulk modulus is Reuss''', value_of('bulk_modulus', c), &
         & averages%bulk_reuss, 1.0e-10_wp)
      call check_close('Hill''s bulk modulus', value_of('polycrystal_bulk', c), bulk, 1.0e-10_wp)
      call check_close('Hill''s shear modulus', value_of('polycrystal_shear', c), shear, 1.0e-10_wp)
      call check_close('Young''s modulus', value_of('polycrystal_young', c), &
         & 9.0_wp*bulk*shear/(3.0_wp*bulk + shear), 1.0e-10_wp)
      call check_close('Poisson''s ratio', value_of('polycrystal_poisson', c), &
         & value_of('polycrystal_young', c)/(2.0_wp*shear) - 1.0_wp, 1.0e-12_wp)
      call check_close('any entry', value_of('C66', c), 63.45_wp, 1.0e-12_wp)
      ! In closed form: S11 + S12 + S13 = (C33 - C13)/D, D = (C11 + C12) C33 - 2 C13².
      call check_close('compressibility of zinc across c', value_of('compressibility[100]', c), &
         & 1000.0_wp*(61.1_wp - 50.3_wp)/(195.3_wp*61.1_wp - 2.0_wp*50.3_wp**2), 1.0e-9_wp)
      call check_close('along c', value_of('compressibility[001]', c), &
         & 1000.0_wp*(195.3_wp - 2.0_wp*50.3_wp)/(195.3_wp*61.1_wp - 2.0_wp*50.3_wp**2), 1.0e-9_wp)
      call check_close('three of them make the bulk modulus', &
         & 2.0_wp*value_of('compressibility[100]', c) + value_of('compressibility[001]', c), &
         & 1000.0_wp/value_of('bulk_modulus', c), 1.0e-9_wp)

      c = stiffness_of('tetragonal', rutile)
      call check_close('rutile along c', value_of('young[001]', c), &
         & 480.0_wp - 2.0_wp*146.0_wp**2/(269.0_wp + 177.0_wp), 1.0e-9_wp)
      call check_close('torsion about c', value_of('shear[001]', c), 124.0_wp, 1.0e-9_wp)
      call check_close('torsion about a', value_of('shear[100]', c), &
         & 2.0_wp/(1.0_wp/124.0_wp + 1.0_wp/192.0_wp), 1.0e-9_wp)
   end subroutine test_closed_forms

   !> Directions and their opposites, in every way of writing them.
   subroutine test_directions()
      real(wp) :: c(6, 6)

      c = stiffness_of('trigonal', [86.6_wp, 6.7_wp, 12.6_wp, -17.8_wp, 106.4_wp, 57.8_wp])
      call check('quartz tells 011 from 01-1', &
         & abs(value_of('young[011]', c) - value_of('young[01-1]', c)) > 1.0_wp)
      call check_close('[0-11] is [01-1]', value_of('young[0-11]', c), &
         & value_of('young[01-1]', c), 1.0e-10_wp)
      call check_close('numbers apart', value_of('shear[ 0.5, -1.0 , 0.2]', c), &
         & value_of('shear[5 -10 2]', c), 1.0e-10_wp)
      call check_close('two digits', value_of('young[10 0 1]', c), &
         & value_of('young[1.0 0 0.1]', c), 1.0e-10_wp)
   end subroutine test_directions

   subroutine test_names()
      type(quantity_type) :: quantity
      type(error_type), allocatable :: error
      character(len=*), parameter :: wrong(9) = [character(len=12) :: 'hardness', 'C17', 'C21', &
         & 'young', 'young[000]', 'bulk[100]', 'C11^x', 'young[12]', '']
      integer :: i

      do i = 1, size(wrong)
         call new_quantity(trim(wrong(i)), quantity, error)
         call check('refused: '//trim(wrong(i)), allocated(error))
      end do
      call new_quantity('polycristal_young', quantity, error)
      call check_refused('a name that is near', error, 'did you mean polycrystal_young?')
      call check_refused('and what is allowed', error, 'compressibility[100]')
      call new_quantity('C33 / C11', quantity, error)
      call check('unit of a ratio', quantity%unit == '1' .and. quantity%is_product())
      call new_quantity('young[100]', quantity, error)
      call check('unit of a modulus', quantity%unit == 'GPa' .and. .not. quantity%is_product())
      call new_quantity('compressibility[001]', quantity, error)
      call check('unit of a compressibility', quantity%unit == '1/TPa')
      call new_quantity('C14', quantity, error)
      call check_quantity(quantity, class_of('trigonal'), error)
      call check_success('C14 of a trigonal crystal', error)
      call check_quantity(quantity, class_of('cubic'), error)
      call check_refused('C14 of a cubic one', error, 'cubic')
   end subroutine test_names

   subroutine test_reported()
      character(len=*), parameter :: averages = 'polycrystal_shear polycrystal_young ' &
         & //'polycrystal_poisson anisotropy_index '

      ! Where a crystal is compressed alike in all directions, and where it is stretched alike, the
      ! polycrystal has no modulus of its own.
      call compare('isotropic', 'C11 C12', averages)
      call compare('cubic', 'C11 C12 C44', averages//'young[001] young[110] young[111]')
      call compare('hexagonal', 'C11 C12 C44 C33 C13', &
         & 'polycrystal_bulk '//averages//'young[001] young[100] young[101] young[111]')
      call compare('tetragonal', 'C11 C12 C13 C33 C44 C66', &
         & 'polycrystal_bulk '//averages//'young[001] young[100] young[110] young[101] young[111]')
      call compare('orthorhombic', 'C11 C12 C13 C22 C23 C33 C44 C55 C66', &
         & 'polycrystal_bulk '//averages &
         & //'young[001] young[100] young[010] young[110] young[101] young[011] young[111]')
   end subroutine test_reported

   subroutine compare(name, first, last)
      character(len=*), intent(in) :: name, first, last
      type(quantity_type), allocatable :: list(:)
      type(error_type), allocatable :: error
      character(len=:), allocatable :: found
      integer :: i

      call reported_quantities(class_of(name), list, error)
      call check_success('reported of '//name, error)
      found = ''
      do i = 1, size(list)
         found = found//list(i)%name//' '
      end do
      call check(name//': constants, averages, directions', &
         & found == first//' bulk_modulus '//last//' ', found)
   end subroutine compare
end program test_quantities
