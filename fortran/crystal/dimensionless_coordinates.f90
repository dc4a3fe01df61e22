!> Dimensionless ratios of the constants for surrogates, in closed form, for the classes whose row names a set of them.
module dimensionless_coordinates
   use crystal_class, only: crystal_class_type
   use kinds, only: wp
   implicit none
   private
   public :: has_ratios, ratios_of

contains

   !> Whether a class has dimensionless ratios, one fewer than constants.
   pure logical function has_ratios(class)
      type(crystal_class_type), intent(in) :: class

      has_ratios = len_trim(class%coordinate_set) > 0
   end function has_ratios

   !> The ratios and the stiffness scale s in GPa.
   !>
   !> 'zener': s = Voigt's shear modulus, K/(K+s), log of the Zener ratio. 'axial', with r = sqrt(C11 C33): s is the geometric
   !> mean of r-C13, r+C13, C44, C66; the coordinates are contrasts of their logarithms, and log C33/C11.
   pure subroutine ratios_of(class, constants, raw, scale)
      type(crystal_class_type), intent(in) :: class
      !> GPa, of a Born-stable crystal; the ratios of others may be NaN.
      real(wp), intent(in) :: constants(:)
      !> (n_constants - 1).
      real(wp), intent(out) :: raw(:), scale
      real(wp) :: bulk, r, a, b, c66

      select case (class%coordinate_set)
      case ('zener')
         bulk = (constants(1) + 2.0_wp*constants(2))/3.0_wp
         scale = (constants(1) - constants(2) + 3.0_wp*constants(3))/5.0_wp
         raw(1) = bulk/(bulk + scale)
         raw(2) = log(2.0_wp*constants(3)/(constants(1) - constants(2)))
      case ('axial')
         r = sqrt(constants(1)*constants(4))
         a = r - constants(5)
         b = r + constants(5)
         c66 = 0.5_wp*(constants(1) - constants(2))
         scale = sqrt(sqrt(a*b*constants(3)*c66))
         raw(1) = log(a/b)
         raw(2) = log(constants(3)/c66)
         raw(3) = log(a*b/(constants(3)*c66))
         raw(4) = log(constants(4)/constants(1))
      case default
         raw = 0.0_wp
         scale = 1.0_wp
      end select
   end subroutine ratios_of
end module dimensionless_coordinates
