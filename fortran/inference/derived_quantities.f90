!> What a metallurgist asks of a crystal, as functions of its constants: polycrystal averages, ratios, directional moduli.
!>
!> The polycrystal values are Hill's: bulk and shear modulus are the means of Voigt's and Reuss' for a uniform texture, and
!> Young's modulus and Poisson's ratio follow from these two. For a cubic crystal the bulk modulus is (C11 + 2 C12)/3 exactly.
module derived_quantities
   use crystal_class, only: crystal_class_type
   use crystal_elasticity, only: anisotropy_index, averages_type, polycrystal_averages
   use kinds, only: wp
   implicit none
   private
   public :: quantity_count, quantity_names, quantity_units, quantity_number, evaluate_quantities
   public :: name_length, most_quantities

   integer, parameter :: name_length = 20
   !> No class has more quantities, its constants included.
   integer, parameter :: most_quantities = 26

contains

   !> How many quantities a crystal has; the first are its constants.
   pure integer function quantity_count(class) result(n)
      type(crystal_class_type), intent(in) :: class

      n = size(quantity_names(class))
   end function quantity_count

   !> Names of the quantities, the constants first.
   pure function quantity_names(class) result(names)
      type(crystal_class_type), intent(in) :: class
      character(len=name_length), allocatable :: names(:)
      character(len=name_length), allocatable :: derived(:)
      character(len=3), allocatable :: constants(:)

      constants = class%constants
      derived = [character(len=name_length) :: 'bulk_modulus', 'shear_modulus', 'youngs_modulus', 'poisson_ratio', &
         & 'anisotropy_index']
      select case (class%coordinate_set)
      case ('zener')
         derived = [character(len=name_length) :: derived, 'zener_ratio', 'youngs_100', 'youngs_110', 'youngs_111']
      case ('axial')
         derived = [character(len=name_length) :: derived, 'C66', 'ratio_C33_C11', 'ratio_C44_C66', 'ratio_C13_C12', &
            & 'youngs_a', 'youngs_45', 'youngs_c']
      case default
      end select
      allocate (names(size(constants) + size(derived)))
      names(:size(constants)) = constants
      names(size(constants) + 1:) = derived
   end function quantity_names

   !> 'GPa', or '1' of a ratio, of each quantity.
   pure function quantity_units(class) result(units)
      type(crystal_class_type), intent(in) :: class
      character(len=3), allocatable :: units(:)
      integer :: k

      k = class%n_constants
      allocate (units(quantity_count(class)))
      units = 'GPa'
      units(k + 4:k + 5) = '1'
      if (class%coordinate_set == 'zener') units(k + 6) = '1'
      if (class%coordinate_set == 'axial') units(k + 7:k + 9) = '1'
   end function quantity_units

   !> The number of the quantity of that name, as printed by `quantity_names`; 0 if there is none.
   pure integer function quantity_number(class, name) result(number)
      type(crystal_class_type), intent(in) :: class
      character(len=*), intent(in) :: name
      character(len=name_length), allocatable :: names(:)

      names = quantity_names(class)
      do number = 1, size(names)
         if (names(number) == name) return
      end do
      number = 0
   end function quantity_number

   !> All quantities of one Born-stable crystal, in the order of `quantity_names`.
   pure subroutine evaluate_quantities(class, constants, values)
      type(crystal_class_type), intent(in) :: class
      !> GPa.
      real(wp), intent(in) :: constants(:)
      real(wp), intent(out) :: values(:)
      type(averages_type) :: averages
      real(wp) :: c(6, 6), bulk, shear, c11, c12, c44, c33, c13, c66, det, s11, s12, s44, s33, s13
      integer :: k

      k = class%n_constants
      c = class%stiffness(constants)
      averages = polycrystal_averages(c)
      bulk = 0.5_wp*(averages%bulk_voigt + averages%bulk_reuss)
      shear = 0.5_wp*(averages%shear_voigt + averages%shear_reuss)
      c11 = c(1, 1)
      c12 = c(1, 2)
      c44 = c(4, 4)
      c66 = c(6, 6)
      c33 = c(3, 3)
      c13 = c(1, 3)
      select case (class%coordinate_set)
      case ('zener')
         s11 = (c11 + c12)/((c11 - c12)*(c11 + 2.0_wp*c12))
         s12 = -c12/((c11 - c12)*(c11 + 2.0_wp*c12))
         s44 = 1.0_wp/c44
         values(k + 6) = 2.0_wp*c44/(c11 - c12)
         values(k + 7) = 1.0_wp/s11
         values(k + 8) = 1.0_wp/(s11 - 0.5_wp*(s11 - s12 - 0.5_wp*s44))
         values(k + 9) = 1.0_wp/(s11 - 2.0_wp/3.0_wp*(s11 - s12 - 0.5_wp*s44))
      case ('axial')
         det = (c11 + c12)*c33 - 2.0_wp*c13**2
         s11 = (c11*c33 - c13**2)/(2.0_wp*c66*det)
         s33 = (c11 + c12)/det
         s13 = -c13/det
         values(k + 6) = c66
         values(k + 7) = c33/c11
         values(k + 8) = c44/c66
         values(k + 9) = c13/c12
         values(k + 10) = 1.0_wp/s11
         values(k + 11) = 4.0_wp/(s11 + s33 + 2.0_wp*s13 + 1.0_wp/c44)
         values(k + 12) = 1.0_wp/s33
      case default
      end select
      values(:k) = constants(:k)
      values(k + 1) = bulk
      values(k + 2) = shear
      values(k + 3) = 9.0_wp*bulk*shear/(3.0_wp*bulk + shear)
      values(k + 4) = (3.0_wp*bulk - 2.0_wp*shear)/(6.0_wp*bulk + 2.0_wp*shear)
      values(k + 5) = anisotropy_index(c)
   end subroutine evaluate_quantities
end module derived_quantities
