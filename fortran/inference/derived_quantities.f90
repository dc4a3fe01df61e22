!> What a metallurgist asks of a crystal, as functions of its constants: polycrystal averages, ratios, directional moduli.
!>
!> The polycrystal values are Hill's: bulk and shear modulus are the means of Voigt's and Reuss' for a uniform texture, and
!> Young's modulus and Poisson's ratio follow from these two. For a cubic crystal the bulk modulus is (C11 + 2 C12)/3 exactly.
module derived_quantities
   use crystal_elasticity, only: anisotropy_index, constant_count, constant_names, symmetry_cubic
   use kinds, only: wp
   implicit none
   private
   public :: quantity_count, quantity_names, quantity_units, quantity_number, evaluate_quantities
   public :: name_length, most_quantities

   integer, parameter :: name_length = 20
   !> No symmetry has more quantities, its constants included.
   integer, parameter :: most_quantities = 20

contains

   !> How many quantities a cubic or hexagonal crystal has; the first are its constants.
   pure integer function quantity_count(symmetry) result(n)
      integer, intent(in) :: symmetry

      n = size(quantity_names(symmetry))
   end function quantity_count

   !> Names of the quantities, the constants first.
   pure function quantity_names(symmetry) result(names)
      integer, intent(in) :: symmetry
      character(len=name_length), allocatable :: names(:)
      character(len=name_length), allocatable :: derived(:)
      character(len=3), allocatable :: constants(:)

      constants = constant_names(symmetry)
      if (symmetry == symmetry_cubic) then
         derived = [character(len=name_length) :: 'bulk_modulus', 'shear_modulus', 'youngs_modulus', 'poisson_ratio', &
            & 'anisotropy_index', 'zener_ratio', 'youngs_100', 'youngs_110', 'youngs_111']
      else
         derived = [character(len=name_length) :: 'bulk_modulus', 'shear_modulus', 'youngs_modulus', 'poisson_ratio', &
            & 'anisotropy_index', 'C66', 'ratio_C33_C11', 'ratio_C44_C66', 'ratio_C13_C12', 'youngs_a', 'youngs_45', &
            & 'youngs_c']
      end if
      allocate (names(size(constants) + size(derived)))
      names(:size(constants)) = constants
      names(size(constants) + 1:) = derived
   end function quantity_names

   !> 'GPa', or '1' of a ratio, of each quantity.
   pure function quantity_units(symmetry) result(units)
      integer, intent(in) :: symmetry
      character(len=3), allocatable :: units(:)
      integer :: k

      k = constant_count(symmetry)
      allocate (units(quantity_count(symmetry)))
      units = 'GPa'
      units(k + 4:k + 5) = '1'
      if (symmetry == symmetry_cubic) then
         units(k + 6) = '1'
      else
         units(k + 7:k + 9) = '1'
      end if
   end function quantity_units

   !> The number of the quantity of that name, as printed by `quantity_names`; 0 if there is none.
   pure integer function quantity_number(symmetry, name) result(number)
      integer, intent(in) :: symmetry
      character(len=*), intent(in) :: name
      character(len=name_length), allocatable :: names(:)

      names = quantity_names(symmetry)
      do number = 1, size(names)
         if (names(number) == name) return
      end do
      number = 0
   end function quantity_number

   !> All quantities of one Born-stable crystal, in the order of `quantity_names`.
   pure subroutine evaluate_quantities(symmetry, constants, values)
      integer, intent(in) :: symmetry
      !> GPa.
      real(wp), intent(in) :: constants(:)
      real(wp), intent(out) :: values(:)
      real(wp) :: c11, c12, c44, c33, c13, c66, bulk, shear, kv, gv, kr, gr, det, s11, s12, s44, s33, s13
      integer :: k

      k = constant_count(symmetry)
      c11 = constants(1)
      c12 = constants(2)
      c44 = constants(3)
      c66 = 0.5_wp*(c11 - c12)
      if (symmetry == symmetry_cubic) then
         bulk = (c11 + 2.0_wp*c12)/3.0_wp
         gv = (2.0_wp*c66 + 3.0_wp*c44)/5.0_wp
         gr = 5.0_wp/(2.0_wp/c66 + 3.0_wp/c44)
         s11 = (c11 + c12)/(2.0_wp*c66*3.0_wp*bulk)
         s12 = -c12/(2.0_wp*c66*3.0_wp*bulk)
         s44 = 1.0_wp/c44
         values(k + 6) = c44/c66
         values(k + 7) = 1.0_wp/s11
         values(k + 8) = 1.0_wp/(s11 - 0.5_wp*(s11 - s12 - 0.5_wp*s44))
         values(k + 9) = 1.0_wp/(s11 - 2.0_wp/3.0_wp*(s11 - s12 - 0.5_wp*s44))
      else
         ! Closed forms of the averages for hexagonal symmetry (Watt & Peselnick, J. Appl. Phys. 51, 1525, 1980).
         c33 = constants(4)
         c13 = constants(5)
         det = (c11 + c12)*c33 - 2.0_wp*c13**2
         shear = c11 + c12 + 2.0_wp*c33 - 4.0_wp*c13
         kv = (2.0_wp*(c11 + c12) + 4.0_wp*c13 + c33)/9.0_wp
         gv = (shear + 12.0_wp*c44 + 12.0_wp*c66)/30.0_wp
         kr = det/shear
         gr = 2.5_wp*det*c44*c66/(3.0_wp*kv*c44*c66 + det*(c44 + c66))
         bulk = 0.5_wp*(kv + kr)
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
      end if
      shear = 0.5_wp*(gv + gr)
      values(:k) = constants(:k)
      values(k + 1) = bulk
      values(k + 2) = shear
      values(k + 3) = 9.0_wp*bulk*shear/(3.0_wp*bulk + shear)
      values(k + 4) = (3.0_wp*bulk - 2.0_wp*shear)/(6.0_wp*bulk + 2.0_wp*shear)
      values(k + 5) = anisotropy_index(symmetry, constants)
   end subroutine evaluate_quantities
end module derived_quantities
