!> The kinds of modulus that are measured, as functions of the indentation modulus M: all are a M/(1 + d M).
!>
!> M itself; E_eff of the contact with an elastic indenter, 1/E_eff = 1/M + (1-nu_i²)/E_i; E_s = (1-nu_s²) M of a sample whose
!> Poisson's ratio is assumed.
module modulus_kinds
   use errors, only: error_type, exit_bad_input, raise
   use kinds, only: wp
   use text, only: to_text
   implicit none
   private
   public :: modulus_kind_names, modulus_map_type, new_modulus_map

   !> A new kind: its name here, and its a and d in `new_modulus_map`.
   character(len=*), parameter :: modulus_kind_names = 'indentation_modulus, effective_modulus, sample_modulus'

   type :: modulus_map_type
      !> a; d in 1/GPa.
      real(wp) :: factor = 1.0_wp, compliance = 0.0_wp
   contains
      procedure :: apply
      procedure :: indentation_modulus
   end type modulus_map_type

contains

   !> The map of the kind with this `name`.
   subroutine new_modulus_map(name, indenter_modulus, indenter_nu, sample_nu, map, error)
      character(len=*), intent(in) :: name
      !> Young's modulus (GPa) and Poisson's ratio of the indenter, Poisson's ratio that was assumed of the sample.
      real(wp), intent(in) :: indenter_modulus, indenter_nu, sample_nu
      type(modulus_map_type), intent(out) :: map
      type(error_type), allocatable, intent(out) :: error

      if (.not. (indenter_modulus > 0.0_wp .and. abs(indenter_nu) < 1.0_wp .and. abs(sample_nu) < 1.0_wp)) then
         call raise(error, 'the indenter''s modulus ('//to_text(indenter_modulus)//' GPa) must be positive, Poisson''s ratios (' &
            & //to_text(indenter_nu)//', '//to_text(sample_nu)//') within -1 .. 1', exit_bad_input)
         return
      end if
      select case (name)
      case ('indentation_modulus')
         map = modulus_map_type()
      case ('effective_modulus')
         map%compliance = (1.0_wp - indenter_nu**2)/indenter_modulus
      case ('sample_modulus')
         map%factor = 1.0_wp - sample_nu**2
      case default
         call raise(error, 'modulus_kind: '''//name//''' is unknown; allowed: '//modulus_kind_names, exit_bad_input)
      end select
   end subroutine new_modulus_map

   !> From indentation modulus to the kind, value and slope with respect to any variable, in place.
   pure subroutine apply(self, modulus, slope)
      class(modulus_map_type), intent(in) :: self
      !> GPa.
      real(wp), intent(inout) :: modulus(:), slope(:)

      if (self%compliance > 0.0_wp) then
         slope = slope/(1.0_wp + self%compliance*modulus)**2
         modulus = modulus/(1.0_wp + self%compliance*modulus)
      end if
      slope = slope*self%factor
      modulus = modulus*self%factor
   end subroutine apply

   !> The indentation modulus behind a value of the kind, GPa; very large where there is none.
   pure real(wp) function indentation_modulus(self, measured)
      class(modulus_map_type), intent(in) :: self
      !> GPa.
      real(wp), intent(in) :: measured

      indentation_modulus = measured/max(self%factor - self%compliance*measured, 1.0e-3_wp)
   end function indentation_modulus
end module modulus_kinds
