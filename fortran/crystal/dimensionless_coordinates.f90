!> Closed-form coordinates of a crystal other than its constants, for the classes whose row names a set of them: dimensionless
!> ratios for surrogates, and logarithms of stiffnesses for chains.
module dimensionless_coordinates
   use crystal_class, only: crystal_class_type
   use kinds, only: wp
   implicit none
   private
   public :: has_ratios, ratios_of, to_logarithms, from_logarithms, log_volume_of

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

   !> Logarithms of stiffnesses, in which moduli are nearly linear and ridges nearly straight; of a class without a set the
   !> constants. 'zener': bulk modulus, C11 - C12, C44. 'axial', with r = sqrt(C11 C33): r - C13, r + C13, C44, C11 - C12 and the
   !> ratio C33/C11. All exist for stable crystals.
   pure subroutine to_logarithms(class, x, w)
      type(crystal_class_type), intent(in) :: class
      !> GPa, (n_constants).
      real(wp), intent(in) :: x(:)
      !> (n_constants).
      real(wp), intent(out) :: w(:)
      real(wp) :: r

      select case (class%coordinate_set)
      case ('zener')
         w = log([x(1) + 2.0_wp*x(2), x(1) - x(2), x(3)])
      case ('axial')
         r = sqrt(x(1)*x(4))
         w = log([r - x(5), r + x(5), x(3), x(1) - x(2), x(4)/x(1)])
      case default
         w = x
      end select
   end subroutine to_logarithms

   !> The constants x of coordinates w.
   pure subroutine from_logarithms(class, w, x)
      type(crystal_class_type), intent(in) :: class
      real(wp), intent(in) :: w(:)
      !> GPa, (n_constants).
      real(wp), intent(out) :: x(:)
      real(wp) :: e(5), r, ratio

      select case (class%coordinate_set)
      case ('zener')
         e(:3) = exp(min(50.0_wp, w))
         x = [(e(1) + 2.0_wp*e(2))/3.0_wp, (e(1) - e(2))/3.0_wp, e(3)]
      case ('axial')
         e = exp(min(50.0_wp, w))
         r = 0.5_wp*(e(1) + e(2))
         ratio = sqrt(e(5))
         x = [r/ratio, r/ratio - e(4), e(3), r*ratio, 0.5_wp*(e(2) - e(1))]
      case default
         x = w
      end select
   end subroutine from_logarithms

   !> Logarithm of the volume of constants that a unit volume of `w` stands for, up to a constant.
   pure real(wp) function log_volume_of(class, w)
      type(crystal_class_type), intent(in) :: class
      real(wp), intent(in) :: w(:)

      select case (class%coordinate_set)
      case ('zener')
         log_volume_of = sum(w)
      case ('axial')
         log_volume_of = sum(w(:4)) + log(exp(w(1)) + exp(w(2)))
      case default
         log_volume_of = 0.0_wp
      end select
   end function log_volume_of
end module dimensionless_coordinates
